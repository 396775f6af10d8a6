const show = (element, data, link) => (data.runs ? history(element, data) : new Page(element, data, link));

/** Where a server answers: plans and rows come from there, and the data again and again while a robot acts. */
const served = (base) => ({
  async json(method, body) {
    const answer = await fetch(`${base}page.json`, body ? { method, body: JSON.stringify(body), headers: { "Content-Type": "application/json" } } : { method });
    if (!answer.ok) throw new Error((await answer.text()).trim() || answer.statusText);
    return answer.json();
  },
  turn(turned) { return this.json("POST", turned); },
  async ask(query) {
    const answer = await fetch(`${base}sparql`, { method: "POST", body: query, headers: { "Content-Type": "application/sparql-query", Accept: "application/sparql-results+json, text/turtle;q=0.9" } });
    if (!answer.ok) return { problem: (await answer.text()).trim() };
    if ((answer.headers.get("Content-Type") || "").startsWith("text/turtle")) return { text: await answer.text() };
    const found = await answer.json();
    if (found.boolean !== undefined) return { columns: ["answer"], rows: [[String(found.boolean)]] };
    return { columns: found.head.vars, rows: found.results.bindings.map((row) => found.head.vars.map((name) => (row[name] ? row[name].value : ""))) };
  },
});

const start = async (element) => {
  const embedded = JSON.parse(document.getElementById("confab-data").textContent);
  if (embedded) { show(element, embedded, null); return; }
  const link = served("");
  let data = null;
  while (!data) {
    try { data = await link.json("GET"); } catch (error) { element.textContent = `waiting for the server: ${error.message}`; await new Promise((done) => { setTimeout(done, 500); }); }
  }
  document.title = data.title;
  const page = show(element, data, link);
  if (!data.live) { if (page.turning) page.turning.send(); return; }
  const state = made("p", { class: "note", role: "status" }, "live");
  page.head.after(state);
  for (let version = data.version; ;) {
    await new Promise((done) => { setTimeout(done, 400); });
    try {
      const answer = await fetch(`page.json?after=${version}`);
      if (answer.status === 204) continue;
      const next = await answer.json();
      version = next.version;
      page.update(next);
    } catch { state.textContent = "The program has ended. The page shows the last state that it received."; return; }
  }
};

/** In a notebook: what is turned and asked goes to the kernel. */
const render = ({ model, el }) => {
  let number = 0;
  const once = (name, fits) => new Promise((done) => {
    const look = () => { const value = model.get(name); if (fits(value)) { model.off(`change:${name}`, look); done(value); } };
    model.on(`change:${name}`, look);
  });
  const link = {
    turn(turned) {
      const answer = once("data", () => true);
      model.set("turned", turned);
      model.save_changes();
      return answer;
    },
    ask(query) {
      number += 1;
      const of = number, answer = once("rows", (value) => value.of === of);
      model.set("asked", { of, query });
      model.save_changes();
      return answer;
    },
  };
  const page = show(el, model.get("data"), link);
  return () => page.seen.disconnect();
};

const root = document.getElementById("confab");
if (root && document.getElementById("confab-data")) start(root);

export default { render };

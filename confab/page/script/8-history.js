/** A folder of runs: one is shown, two are compared. */
const history = (element, data) => {
  const chosen = new Set(data.shown), table = made("tbody", {}), out = made("div", {});
  const names = [...new Set(data.runs.flatMap((run) => Object.keys(run.figures)))].filter((name) => name !== "verdict");
  const value = (run, name) => run.figures[name] || "";
  const differ = names.filter((name) => data.runs.some((run) => value(run, name) !== value(data.runs[0], name))), same = names.filter((name) => !differ.includes(name) && value(data.runs[0], name));
  const rows = () => clear(table, data.runs.map((run, number) => made("tr", { class: chosen.has(number) ? "chosen" : "" },
    made("td", {}, made("label", {}, made("input", { type: "checkbox", checked: chosen.has(number), "aria-label": `show ${run.name}`, onchange: (event) => {
      if (event.target.checked) { chosen.add(number); if (chosen.size > 2) chosen.delete([...chosen][0]); } else chosen.delete(number);
      rows();
      show();
    } }), ` ${run.name}`)), made("td", { class: run.page.good ? "ok" : "bad" }, `${run.page.good ? "✓" : "✗"} ${run.page.status}`), made("td", {}, run.scene), made("td", {}, run.when.slice(0, 16).replace("T", " ")),
    differ.map((name) => made("td", {}, value(run, name))))));
  const show = () => {
    const two = [...chosen].sort((a, b) => a - b).map((number) => data.runs[number]);
    clear(out);
    if (two.length === 2) {
      const [one, other] = two, top = (run) => run.page.steps.filter((step) => !step.id.includes(".")).map((step) => step.what);
      const gone = top(one), fresh = top(other).filter((words) => { const at = gone.indexOf(words); if (at >= 0) gone.splice(at, 1); return at < 0; });
      const line = (name, a, b) => made("tr", { class: a === b ? "" : "differs" }, made("th", { scope: "row" }, name), made("td", {}, a), made("td", {}, b));
      out.append(made("section", {}, made("h2", {}, `${one.name} and ${other.name} compared`), made("div", { class: "scroll" }, made("table", {},
        made("thead", {}, made("tr", {}, ["", one.name, other.name].map((words) => made("th", { scope: "col" }, words)))),
        made("tbody", {}, line("verdict", one.page.status, other.page.status), names.filter((name) => value(one, name) || value(other, name)).map((name) => line(name, value(one, name), value(other, name)))))),
      made("p", { class: "changes" }, gone.map((words) => made("del", {}, words)), fresh.map((words) => made("ins", {}, words)),
        !gone.length && !fresh.length && made("span", { class: "note" }, "the steps of the first level are the same"))));
    }
    const end = Math.max(...two.map((run) => run.page.end));
    for (const run of two) {
      const root = made("div", { class: "run" });
      out.append(root);
      new Page(root, two.length === 2 ? { ...run.page, title: `${run.name}: ${run.page.title}`, end } : run.page, null);
    }
  };
  element.classList.add("confab");
  clear(element, made("h1", {}, data.title), made("p", { class: "note" }, "A mark shows a run; two of them are compared."), made("div", { class: "scroll" }, made("table", { class: "runs" },
    made("thead", {}, made("tr", {}, ["run", "verdict", "scene", "when", ...differ].map((words) => made("th", { scope: "col" }, words)))), table)),
    same.length > 0 && made("p", { class: "note" }, `The same in all: ${same.map((name) => `${name} ${value(data.runs[0], name)}`).join(" · ")}`), out);
  rows();
  show();
};

/** A query, typed or chosen, and its rows. */
const asking = (page) => {
  const ready = page.data.queries || [], out = made("div", { class: "answer", "aria-live": "polite" });
  const text = made("textarea", { rows: 6, spellcheck: "false", autocapitalize: "off", "aria-label": "SPARQL query", placeholder: "SELECT ?object ?place WHERE { ?object k:location ?place }" });
  const ask = async () => {
    clear(out, made("p", { class: "note" }, "asking …"));
    const begun = performance.now();
    try {
      const answer = await page.link.ask(text.value), seconds = ((performance.now() - begun) / 1000).toFixed(2);
      if (answer.problem) clear(out, made("p", { class: "bad", role: "alert" }, answer.problem));
      else if (answer.text !== undefined) clear(out, made("pre", {}, answer.text));
      else {
        const line = (row) => made("tr", {}, row.map((cell) => made("td", { title: cell }, page.short(cell))));
        clear(out, made("p", { class: "note" }, `${answer.rows.length} row${answer.rows.length === 1 ? "" : "s"} in ${seconds} s`),
          made("div", { class: "scroll" }, made("table", {}, made("thead", {}, made("tr", {}, answer.columns.map((name) => made("th", { scope: "col" }, name)))), made("tbody", {}, lined(answer.rows, line, answer.columns.length || 1, MANY)))));
      }
    } catch (error) { clear(out, made("p", { class: "bad", role: "alert" }, `the server doesn't answer: ${error.message}`)); }
  };
  text.addEventListener("keydown", (event) => { if (event.key === "Enter" && (event.ctrlKey || event.metaKey)) { event.preventDefault(); ask(); } });
  const choose = made("select", { "aria-label": "ready queries", onchange: () => { const one = ready[choose.value]; if (one) { text.value = one.text; ask(); } } },
    made("option", { value: "" }, "choose a ready query …"), ready.map((one, number) => made("option", { value: number }, one.question)));
  return made("section", { class: "asking" }, made("h2", {}, "SPARQL query"),
    made("p", { class: "note" }, "The query sees the scene's files and the facts observed while a robot acts. It doesn't see changes made on this page."),
    made("p", { class: "tools" }, choose), text, made("p", { class: "tools" }, made("button", { type: "button", onclick: ask }, "ask"), made("small", {}, " Ctrl+Enter")), out);
};

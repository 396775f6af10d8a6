// The board: what holds and what is wanted as choices, interventions below, and what comes of it beside. Python plans;
// this only shows `rows` and `answer`, and writes `turned`.
const made = (name, attributes = {}, ...inner) => {
  const element = Object.assign(document.createElement(name), attributes);
  element.append(...inner);
  return element;
};

const choice = (label, options, chosen, turn) => {
  const mark = () => select.classList.toggle("turned", select.value !== chosen);
  const select = made("select", { ariaLabel: label, onchange: () => { mark(); turn(select.value); } });
  for (const [value, words] of options) select.append(made("option", { value, textContent: words, selected: value === chosen }));
  return select;
};

function render({ model, el }) {
  const turned = { facts: {}, goals: {}, interventions: [] };
  const rows = model.get("rows"), byKey = Object.fromEntries(rows.map((row) => [row.key, row]));
  const headline = made("p", { className: "headline" }), changes = made("p", { className: "changes" });
  const plan = made("div", { className: "answer" }), people = made("div", { className: "people" });
  headline.setAttribute("aria-live", "polite");

  const send = () => {
    el.classList.add("busy");
    model.set("turned", structuredClone(turned));
    model.save_changes();
  };
  const turn = (where, row, first) => (value) => {
    const chosen = value === "" ? null : value;
    if (chosen === first) delete turned[where][row.key];
    else turned[where][row.key] = chosen;
    send();
  };

  const facts = () => made("table", {},
    made("thead", {}, made("tr", {}, ...["what", "is", "shall be"].map((words) => made("th", { textContent: words })))),
    made("tbody", {}, ...rows.map((row) => made("tr", {},
      made("th", { textContent: row.label, scope: "row" }),
      made("td", {}, choice(`${row.label}: is`, row.values, row.is, turn("facts", row, row.is))),
      made("td", {}, choice(`${row.label}: shall be`, [["", "–"], ...row.values], row.wanted ?? "", turn("goals", row, row.wanted))),
    ))));

  const interfere = () => {
    const steps = model.get("answer").steps;
    const controls = () => [...people.querySelectorAll("select, button")], focused = controls().indexOf(document.activeElement);
    people.replaceChildren(made("h4", { textContent: "While it acts, somebody interferes" }));
    turned.interventions.forEach((each, at) => {
      const values = byKey[each.key].values;
      const set = (name) => (value) => { each[name] = value; if (name === "key") each.value = byKey[value].values[0][0]; send(); };
      const known = steps.some(([id]) => String(id) === String(each.after)) ? steps : [[each.after, `step ${each.after}`], ...steps];
      people.append(made("p", {},
        "after ", choice("after which step", known.map(([id, words]) => [String(id), words]), String(each.after), set("after")), " ",
        choice("what changes", [["world", "it happens that"], ["goal", "it is wanted that"]], each.what, set("what")), " ",
        choice("of what", rows.map((row) => [row.key, row.label]), each.key, set("key")), " ",
        choice("becomes", values, each.value, set("value")), " ",
        made("button", { textContent: "remove", onclick: () => { turned.interventions.splice(at, 1); send(); } })));
    });
    const add = () => {
      const [row] = rows;
      turned.interventions.push({ after: String(steps[0][0]), what: "world", key: row.key, value: row.values[0][0] });
      send();
    };
    people.append(made("button", { textContent: "add an intervention", onclick: add, disabled: steps.length === 0 }));
    controls()[focused]?.focus();
  };

  const show = () => {
    const answer = model.get("answer");
    el.classList.remove("busy");
    headline.textContent = answer.headline;
    changes.replaceChildren(
      ...answer.gone.map((words) => made("del", { textContent: words })),
      ...answer.new.map((words) => made("ins", { textContent: words })));
    plan.innerHTML = answer.html;
    interfere();
  };
  const again = made("button", { textContent: "all as in the file", onclick: () => {
    Object.assign(turned, { facts: {}, goals: {}, interventions: [] });
    left.querySelector("table").replaceWith(facts());
    send();
  } });
  const left = made("div", { className: "left" }, facts(), again, people);

  el.classList.add("confab-board");
  el.append(left, made("div", { className: "right" }, headline, changes, plan));
  model.on("change:answer", show);
  show();
  return () => model.off("change:answer", show);
}

export default { render };

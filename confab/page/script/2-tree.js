/** The plan as a tree of lists that open; steps that a word is found in stand with what is above them. */
const tree = (page) => {
  const { steps } = page.data, below = new Map(), word = page.word;
  for (const step of steps) below.set(lead(step.id), [...(below.get(lead(step.id)) || []), step]);
  const few = (below.get("") || []).length <= UNFOLDED;
  let kept = null;
  if (word) {
    kept = new Set();
    for (const step of steps) {
      if (!`${step.what} ${step.number} ${step.name} ${step.note || ""}`.toLowerCase().includes(word)) continue;
      for (let id = step.id; ; id = lead(id)) { kept.add(id); if (!id.includes(".")) break; }
    }
  }
  const list = (id) => folded((below.get(id) || []).filter((step) => !kept || kept.has(step.id)), item, id || kept ? MANY : FEW);
  const pairs = (facts) => made("dl", {}, facts.map(([name, value]) => made("div", {}, made("dt", {}, name), made("dd", {}, value))));
  const reasons = (needs) => made("p", { class: "why" }, "needed: ", needs.slice(0, 2).map((need) => made("span", {}, need)),
    needs.length > 2 && made("details", { class: "others" }, made("summary", {}, `and ${needs.length - 2} more`), needs.slice(2).map((need) => made("span", {}, need))));
  const item = (step) => {
    const inner = below.get(step.id), timed = page.data.unit === "s" && step.end !== undefined ? ` · ${figure(step.end - step.begin)} s` : "";
    const head = [
      made("span", { class: "what" }, step.what), " ", made("small", {}, `${step.number} · ${step.name}${timed}`),
      step.ok !== undefined && made("span", { class: step.ok ? "ok" : "bad", title: step.ok ? "had its effects" : "failed" }, step.ok ? " ✓" : " ✗"),
      step.note && made("span", { class: step.note.includes("✗") ? "bad" : "note" }, ` ${step.note}`),
      step.begin !== undefined && made("button", { type: "button", class: "seek", title: `to ${figure(step.begin)} ${page.data.unit}`, "aria-label": `${step.what}: go to its time`,
        onclick: (event) => { event.preventDefault(); page.seek(step.begin); } }, `at ${figure(step.begin)}`),
    ];
    const body = [
      step.gives && step.gives.length && made("p", { class: "gives" }, `gives ${step.gives.join("; ")}`),
      step.needs && reasons(step.needs), step.facts && pairs(step.facts),
    ].filter(Boolean);
    if (!inner && !body.length) return made("li", { "data-step": step.id }, made("div", {}, head));
    const opened = page.opened.has(step.id) || kept !== null || (few && !step.id.includes(".") && !page.closed.has(step.id));
    const hold = made("div", {});
    const fill = () => { if (!hold.childNodes.length) clear(hold, body, inner && made("ul", {}, list(step.id))); };
    if (opened) fill();
    const details = made("details", { open: opened, ontoggle: () => {
      if (details.open) { fill(); page.opened.add(step.id); page.closed.delete(step.id); } else { page.opened.delete(step.id); page.closed.add(step.id); }
    } }, made("summary", {}, head), hold);
    return made("li", { "data-step": step.id }, details);
  };
  const top = list("");
  return top.length ? made("ul", { class: "plan" }, top) : made("p", { class: "note" }, steps.length ? "no step has that word" : "no steps");
};

/** Facts, goals and interventions as choices. */
class Turning {
  constructor(page) {
    this.page = page;
    this.turned = { facts: {}, goals: {}, interventions: [] };
    this.busy = false;
    this.word = "";
    this.table = made("tbody", {});
    this.people = made("div", { class: "people" });
    this.state = made("p", { class: "note", role: "status" });
    const search = made("input", { type: "search", placeholder: "filter facts", "aria-label": "show the facts with this word", oninput: () => { this.word = search.value.toLowerCase(); this.rows(); } });
    this.again = made("button", { type: "button", onclick: () => { this.turned = { facts: {}, goals: {}, interventions: [] }; this.rows(); this.interventions(); this.send(); } }, "reset");
    this.element = made("section", { class: "turning" }, made("h2", {}, "Change a fact or a goal"), made("p", { class: "note" }, "Each change starts a new plan; the scene's file stays unchanged."),
      made("p", { class: "tools" }, search, " ", this.again), this.state,
      made("div", { class: "scroll" }, made("table", {}, made("thead", {}, made("tr", {}, ["situation", "initial value", "goal value"].map((words) => made("th", { scope: "col" }, words)))), this.table)), this.people);
  }

  start() {
    const { rows } = this.page.data.turnable;
    this.byKey = new Map(rows.map((row) => [row.key, row]));
    this.rows();
    this.interventions();
  }

  choice(label, options, chosen, first, turn) {
    const known = options.find(([value]) => value === chosen), select = made("select", { "aria-label": label });
    const fill = () => { if (select.options.length <= 1) clear(select, options.map(([value, words]) => made("option", { value, selected: value === select.value }, words))); };
    select.append(made("option", { value: chosen, selected: true }, known ? known[1] : chosen));
    if (options.length <= 12) fill();
    const mark = () => select.classList.toggle("turned", select.value !== first);
    for (const event of ["pointerdown", "focus", "keydown"]) select.addEventListener(event, fill);
    select.addEventListener("change", () => { mark(); turn(select.value); });
    mark();
    return select;
  }

  rows() {
    const { turnable } = this.page.data;
    const shown = turnable.rows.filter((row) => !this.word || `${row.label} ${row.key}`.toLowerCase().includes(this.word));
    const changed = (row) => row.key in this.turned.facts || row.key in this.turned.goals;
    shown.sort((a, b) => Number(changed(b)) - Number(changed(a)) || Number(a.wanted === null) - Number(b.wanted === null) || natural(a.label, b.label));
    const line = (row) => {
      const values = turnable.values[row.values], wanted = row.wanted === null ? "" : row.wanted;
      const fact = this.turned.facts[row.key] ?? row.now, goal = row.key in this.turned.goals ? this.turned.goals[row.key] ?? "" : wanted;
      return made("tr", {}, made("th", { scope: "row" }, row.label),
        made("td", {}, this.choice(`${row.label}: initial value`, values, fact, row.now, (value) => this.turn("facts", row.key, value, row.now))),
        made("td", {}, this.choice(`${row.label}: goal value`, [["", "–"], ...values], goal, wanted, (value) => this.turn("goals", row.key, value === "" ? null : value, row.wanted))));
    };
    clear(this.table, lined(shown, line, 3));
    if (turnable.hidden) this.table.append(made("tr", {}, made("td", { colspan: 3, class: "note" }, `${turnable.hidden} without a row; scene.with_fact turns them in Python`)));
  }

  turn(where, key, value, first) {
    if (value === first) delete this.turned[where][key];
    else this.turned[where][key] = value;
    this.send();
  }

  interventions() {
    const steps = this.page.data.steps.filter((step) => !step.id.includes(".")).map((step) => [step.name.split("#")[1], `${step.number} ${step.what}`]);
    const rows = this.page.data.turnable.rows, values = (key) => this.page.data.turnable.values[this.byKey.get(key).values];
    const set = (one, name) => (value) => { one[name] = value; if (name === "key") [[one.value]] = values(value); this.interventions(); this.send(); };
    clear(this.people, made("h3", {}, "While the robot acts"), this.turned.interventions.map((one, at) => made("p", {},
      "after ", this.choice("after which step", steps.some(([id]) => id === one.after) ? steps : [[one.after, `step ${one.after}`], ...steps], one.after, one.after, set(one, "after")), " ",
      this.choice("what changes", [["world", "it happens that"], ["goal", "it is wanted that"]], one.what, one.what, set(one, "what")), " ",
      this.choice("of what", rows.map((row) => [row.key, row.label]), one.key, one.key, set(one, "key")), " ",
      this.choice("becomes", values(one.key), one.value, one.value, set(one, "value")), " ",
      made("button", { type: "button", onclick: () => { this.turned.interventions.splice(at, 1); this.interventions(); this.send(); } }, "remove"))),
    made("button", { type: "button", disabled: !steps.length || !rows.length, onclick: () => {
      this.turned.interventions.push({ after: steps[0][0], what: "world", key: rows[0].key, value: values(rows[0].key)[0][0] });
      this.interventions();
      this.send();
    } }, "add an intervention"));
  }

  /** Ask for the plan of what is turned; what is turned meanwhile is asked for next. */
  async send() {
    this.waiting = true;
    if (this.busy) return;
    this.busy = true;
    this.page.element.setAttribute("aria-busy", "true");
    while (this.waiting) {
      this.waiting = false;
      this.state.textContent = "planning …";
      try {
        const answer = await this.page.link.turn(structuredClone(this.turned));
        this.state.textContent = answer.problem || "";
        this.state.classList.toggle("bad", Boolean(answer.problem));
        if (!answer.problem) { this.page.update({ ...this.page.data, alarm: undefined, ...answer }, this.page.data.steps.length > 0 || this.page.asked);
          this.page.asked = true; this.interventions(); }
      } catch (error) {
        this.state.textContent = `the server doesn't answer: ${error.message}`;
        this.state.classList.add("bad");
      }
    }
    this.busy = false;
    this.page.element.removeAttribute("aria-busy");
  }
}

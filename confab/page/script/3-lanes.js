/** Lanes over one axis of time. Bars too narrow to be seen at this zoom stand together as one, which zooms in. */
class Lanes {
  constructor(page) {
    this.page = page;
    this.zoom = 1;
    this.body = made("div", { class: "rows" });
    this.cursor = made("div", { class: "cursor" });
    this.over = made("div", { class: "over" });
    this.scroll = made("div", { class: "lanes", tabindex: 0, role: "group", "aria-label": "Lanes; the arrow keys move the clock" }, made("div", { class: "sheet" }, this.body, this.over));
    this.element = this.scroll;
    this.shut = new Set(["fixed"]);
    this.whole = new Set();
    this.scroll.addEventListener("click", (event) => this.click(event));
    this.scroll.addEventListener("wheel", (event) => {
      if (!event.ctrlKey) return;
      event.preventDefault();
      this.zoomed(this.zoom * (event.deltaY < 0 ? 1.25 : 0.8), this.timeAt(event.clientX));
    }, { passive: false });
    this.scroll.addEventListener("keydown", (event) => {
      const turn = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (turn && event.target === this.scroll) { event.preventDefault(); page.next(turn); }
    });
  }

  /** The rows of a group that are shown, with a word in them: goals that aren't met, then what is another in the end, in natural order. */
  rows(group) {
    const word = this.page.word;
    const has = (row) => !word || row.label.toLowerCase().includes(word) || row.bars.some((bar) => bar.label.toLowerCase().includes(word));
    const found = this.page.data.rows.filter((row) => row.group === group && has(row));
    if (group === "levels") return found;
    const rank = (row) => (row.met === false ? 0 : row.bars.length && row.bars[0].label !== row.bars[row.bars.length - 1].label ? 1 : row.met ? 2 : 3);
    return found.sort((a, b) => (group === "actors" ? 0 : rank(a) - rank(b)) || natural(a.label, b.label));
  }

  draw() {
    const { data } = this.page, names = Math.min(160, Math.max(96, this.scroll.clientWidth * 0.2));
    this.names = names;
    this.room = Math.max(120, this.scroll.clientWidth - names - 26);
    this.width = this.room * this.zoom;
    this.marks = [];
    this.scroll.style.setProperty("--names", `${names}px`);
    this.scroll.style.setProperty("--track", `${this.width}px`);
    const many = data.rows.filter((row) => row.group === "changes").length > 24;
    this.scroll.classList.toggle("dense", many);
    const parts = [this.axis()];
    for (const [group, title] of Object.entries(GROUPS)) {
      const rows = this.rows(group), hidden = group === "fixed" && data.hidden && !this.page.word ? data.hidden : 0;
      if (!rows.length) continue;
      const shut = this.shut.has(group) && !this.page.word;
      const count = `${rows.length}${hidden ? ` and ${hidden} without a row` : ""}`;
      parts.push(made("button", { type: "button", class: "group", "aria-expanded": String(!shut),
        onclick: () => { if (shut) this.shut.delete(group); else this.shut.add(group); this.draw(); } }, made("span", {}, `${shut ? "▸" : "▾"} ${title} · ${count}`)));
      if (shut) continue;
      const most = this.whole.has(group) ? 100 * MANY : group === "fixed" ? FEW : MANY;
      parts.push(...rows.slice(0, most).map((row) => this.row(row)));
      if (rows.length > most) {
        parts.push(made("button", { type: "button", class: "more", onclick: () => { this.whole.add(group); this.draw(); } }, `${rows.length - most} more`));
      }
    }
    clear(this.body, parts);
    clear(this.over, this.cursor, data.marks.map((mark) => made("div", { class: "mark", title: mark.text, style: `left:${this.share(mark.at)}` })));
    this.show(this.page.time);
  }

  share(time) { return `${(100 * time) / this.page.data.end}%`; }

  row(row) {
    const met = row.met === undefined ? "" : row.met ? "✓" : "✗";
    return made("div", { class: `row ${row.group}` },
      made("div", { class: "who", title: row.label }, row.label),
      made("div", { class: "track" }, this.bars(row)),
      made("div", { class: row.met ? "met ok" : "met bad", title: met && (row.met ? "the goal is met" : "the goal is not met") }, met));
  }

  bars(row) {
    const scale = this.width / this.page.data.end, found = [];
    let group = [];
    const flush = () => {
      if (group.length > 1) found.push(this.together(group));
      else if (group.length) found.push(this.bar(group[0], row));
      group = [];
    };
    for (const bar of row.bars) {
      const narrow = (bar.end - bar.begin) * scale < 3 && bar.tone !== "failed";
      if (!narrow || (group.length && (bar.begin - group[group.length - 1].end) * scale > 1)) flush();
      group.push(bar);
      if (!narrow) flush();
    }
    flush();
    return found;
  }

  bar(bar, row) {
    const width = ((bar.end - bar.begin) * this.width) / this.page.data.end;
    const doing = row.group === "levels" || row.group === "actors", lines = doing ? 2 : 1, first = bar.label.split(" ")[0];
    // Of what is done at least the whole verb is shown, of a value at least some letters, or nothing. A click tells all of it.
    const room = (words) => wide(words) * (row.group === "actors" ? 1 : 1.2) <= width - (row.group === "actors" ? 4 : 9);
    const fits = doing ? (!room(first) ? "" : width > 60 ? bar.label : first) : room(bar.label) || width > 44 ? bar.label : "";
    const words = (bar.tone === "failed" ? "✗ " : "") + fits;
    const title = `${bar.label}${bar.note ? `: ${bar.note}` : ""} (${figure(bar.begin)} to ${figure(bar.end)} ${this.page.data.unit})`;
    const element = made("div", { class: `bar ${bar.tone} lines${lines}`, title, "data-step": bar.step, "data-begin": bar.begin,
      style: `left:${this.share(bar.begin)};width:${this.share(bar.end - bar.begin)}` }, words && made("span", {}, words));
    if (bar.step) this.marks.push([bar.begin, bar.end, element]);
    if (bar.slack === undefined) return element;
    return [element, made("div", { class: "slack", title: `may end up to ${figure(bar.slack)} ${this.page.data.unit} later`, style: `left:${this.share(bar.end)};width:${this.share(bar.slack)}` })];
  }

  together(bars) {
    const begin = bars[0].begin, end = bars[bars.length - 1].end, tones = [...new Set(bars.map((bar) => bar.tone))];
    return made("div", { class: `bar many ${tones.length === 1 ? tones[0] : "mixed"}`, title: `${bars.length} from ${figure(begin)} to ${figure(end)} ${this.page.data.unit}; a click zooms in`,
      "data-from": begin, "data-to": end, style: `left:${this.share(begin)};width:max(3px, ${this.share(end - begin)})` });
  }

  axis() {
    const { end, unit } = this.page.data, wanted = end / Math.max(3, (this.width / 90));
    const step = [1, 2, 5].flatMap((base) => [-2, -1, 0, 1, 2, 3, 4, 5, 6].map((power) => base * 10 ** power)).sort((a, b) => a - b).find((one) => one >= wanted && (unit === "s" || one >= 1)) || 1;
    const ticks = [];
    for (let i = 0; i < 2000 && (i === 0 || (end - i * step) * (this.width / end) > 28); i += 1) ticks.push(made("span", { style: `left:${this.share(i * step)}` }, `${figure(i * step)}${i && unit !== "s" ? "" : ` ${unit}`}`));
    return made("div", { class: "row axis" }, made("div", { class: "who" }), made("div", { class: "track" }, ticks), made("div", { class: "met" }));
  }

  timeAt(x) {
    const box = this.over.getBoundingClientRect();
    return Math.max(0, Math.min(this.page.data.end, ((x - box.left) / box.width) * this.page.data.end));
  }

  click(event) {
    const bar = event.target.closest(".bar");
    if (bar && bar.dataset.from !== undefined) {
      const [from, to] = [Number(bar.dataset.from), Number(bar.dataset.to)];
      this.zoomed(Math.max(this.zoom * 2, (0.7 * this.page.data.end) / Math.max(to - from, this.page.data.end / 1e4)), (from + to) / 2);
      return;
    }
    if (!event.target.closest(".track")) return;
    this.page.seek(this.timeAt(event.clientX));
    if (bar && bar.dataset.step !== undefined) this.page.open(bar.dataset.step);
    else if (bar) this.page.said.append(` · ${bar.closest(".row").querySelector(".who").textContent} ${bar.title}`);
  }

  zoomed(zoom, at = this.page.time) {
    const most = Math.max(1, Math.min(400, (this.page.data.steps.length * 60) / this.room + 4));
    this.zoom = Math.max(1, Math.min(most, zoom));
    this.draw();
    this.scroll.scrollLeft = (at / this.page.data.end) * this.width - this.room / 2;
  }

  show(time) {
    this.cursor.style.left = this.share(time);
    for (const [begin, end, element] of this.marks) element.classList.toggle("now", begin <= time && time < end);
    const x = (time / this.page.data.end) * this.width, left = this.scroll.scrollLeft;
    if (this.zoom > 1 && (x < left || x > left + this.room)) this.scroll.scrollLeft = x - this.room / 2;
  }
}

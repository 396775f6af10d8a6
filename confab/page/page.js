// The page: map, lanes and plan follow one clock; facts are turned and queries asked where something answers (a server or a
// notebook's kernel). It shows one JSON object (docs/page.md), wherever that comes from; `start` and `render` below say where.

const FEW = 40, MANY = 200; // rows shown at first, and by each further click
const natural = new Intl.Collator("en", { numeric: true }).compare;
const GROUPS = {
  levels: "the plan by level", actors: "who does what", changes: "what changes", wanted: "wanted, and so all the time", fixed: "never changes",
};
const TONES = [
  ["action", "being done"], ["planned", "still to be done"], ["failed", "failed"], ["start", "as in the beginning"],
  ["between", "neither that nor wanted"], ["wanted", "as wanted"],
];

const create = (element, attributes, inner) => {
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else element.setAttribute(name, value === true ? "" : value);
  }
  element.append(...inner.flat(3).filter((one) => one !== null && one !== undefined && one !== false));
  return element;
};
const made = (name, attributes = {}, ...inner) => create(document.createElement(name), attributes, inner);
const drawn = (name, attributes = {}, ...inner) => create(document.createElementNS("http://www.w3.org/2000/svg", name), attributes, inner);
const clear = (element, ...inner) => element.replaceChildren(...inner.flat(3).filter(Boolean));
const lead = (id) => id.slice(0, Math.max(0, id.lastIndexOf(".")));
const figure = (value) => (Math.abs(value) >= 100 ? value.toFixed(0) : value.toFixed(1)).replace(/\.0$/, "");

/** Elements for some values, a few at first; a button opens more of them. */
const folded = (values, element, few = FEW, step = MANY) => {
  const shown = values.slice(0, few).map(element), left = values.slice(few);
  if (!left.length) return shown;
  const more = made("button", { type: "button", class: "more", onclick: () => more.replaceWith(...folded(left, element, step, step)) }, `${left.length} more`);
  return [...shown, more];
};

/** The plan as a tree of lists that open; steps that a word is found in stand with what is above them. */
const tree = (page) => {
  const { steps } = page.data, below = new Map(), word = page.word;
  for (const step of steps) below.set(lead(step.id), [...(below.get(lead(step.id)) || []), step]);
  let kept = null;
  if (word) {
    kept = new Set();
    for (const step of steps) {
      if (!`${step.what} ${step.number} ${step.name} ${step.note || ""}`.toLowerCase().includes(word)) continue;
      for (let id = step.id; ; id = lead(id)) { kept.add(id); if (!id.includes(".")) break; }
    }
  }
  const list = (id) => folded((below.get(id) || []).filter((step) => !kept || kept.has(step.id)), item, MANY);
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
    const opened = page.opened.has(step.id) || kept !== null || (!step.id.includes(".") && !page.closed.has(step.id));
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

  /** The rows of a group that are shown: those that fail first, in natural order, with a word in them. */
  rows(group) {
    const word = this.page.word;
    const has = (row) => !word || row.label.toLowerCase().includes(word) || row.bars.some((bar) => bar.label.toLowerCase().includes(word));
    const found = this.page.data.rows.filter((row) => row.group === group && has(row));
    if (group === "levels") return found;
    const rank = (row) => (row.met === false ? 0 : row.met ? 1 : 2);
    return found.sort((a, b) => (group === "actors" ? 0 : rank(a) - rank(b)) || natural(a.label, b.label));
  }

  draw() {
    const { data } = this.page, names = Math.min(190, Math.max(96, this.scroll.clientWidth * 0.2));
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
      made("div", { class: row.met ? "met ok" : "met bad", title: met && (row.met ? "as wanted in the end" : "not as wanted in the end") }, met));
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
    const lines = row.group === "levels" || row.group === "actors" ? 2 : 1;
    const room = width - 3, first = bar.label.split(" ")[0], doing = row.group === "levels" || row.group === "actors";
    // Of what is done at least the whole verb is shown, or nothing; a value ends in dots. The title has all of it.
    const fits = room > (doing ? 60 : 20) ? bar.label : doing && room > first.length * 5.1 ? first : "";
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
    return made("div", { class: `bar many ${tones.length === 1 ? tones[0] : "start"}`, title: `${bars.length} from ${figure(begin)} to ${figure(end)} ${this.page.data.unit}; a click zooms in`,
      "data-from": begin, "data-to": end, style: `left:${this.share(begin)};width:max(3px, ${this.share(end - begin)})` });
  }

  axis() {
    const { end, unit } = this.page.data, wanted = end / Math.max(3, (this.width / 90));
    const step = [1, 2, 5].flatMap((base) => [-2, -1, 0, 1, 2, 3, 4, 5, 6].map((power) => base * 10 ** power)).sort((a, b) => a - b).find((one) => one >= wanted && (unit === "s" || one >= 1)) || 1;
    const ticks = [];
    for (let i = 0; i * step <= end && i < 2000; i += 1) ticks.push(made("span", { style: `left:${this.share(i * step)}` }, `${figure(i * step)}${i && unit !== "s" ? "" : ` ${unit}`}`));
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
    if (bar && bar.dataset.step) this.page.open(bar.dataset.step);
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

/** The map at the clock's time. Names that would lie on others are numbers, which a list beside the map explains. */
class Plot {
  constructor(page) {
    this.page = page;
    this.picture = made("div", { class: "picture" });
    this.told = made("p", { class: "told", "aria-live": "polite" });
    this.list = made("p", { class: "numbers" });
    this.caption = made("figcaption", {});
    this.element = made("figure", { class: "map" }, this.picture, this.list, this.told, this.caption);
    this.open = new Set();
  }

  at(thing, time) {
    let found = thing.at[0];
    for (const one of thing.at) if (one[0] <= time + 1e-9) found = one;
    return found;
  }

  draw(time) {
    const { map } = this.page.data;
    this.element.hidden = !map;
    if (!map) return;
    const where = map.things.map((thing) => this.at(thing, time)), key = `${this.picture.clientWidth}|${[...this.open]}|${where.map((one) => one[0])}`;
    if (key === this.key && map === this.drawnOf) return;
    this.key = key;
    this.drawnOf = map;
    const points = [...map.places.map((place) => place.at), ...map.areas.flatMap((area) => area.corners), ...map.robots.map((robot) => robot.at)];
    const xs = points.map(([x]) => x), ys = points.map(([, y]) => y);
    const [left, right, top, bottom] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
    const width = Math.max(220, this.picture.clientWidth), edge = Math.min(60, width / 8);
    const wide = Math.max(right - left, 1e-6), high = Math.max(bottom - top, 1e-6);
    let scale = (width - 2 * edge) / wide;
    const tallest = Math.min(this.page.data.film ? 560 : 430, Math.max(260, width * 0.9));
    if (map.metric && high * scale > tallest - 2 * edge) scale = (tallest - 2 * edge) / high;
    const down = map.metric ? scale : map.ways.length ? Math.min(scale, Math.max((tallest - 2 * edge) / high, 1e-6)) : 62; // rows with two names each
    const shift = (width - wide * scale) / 2, height = high * down + 2 * edge;
    const to = ([x, y]) => [shift + (x - left) * scale, edge + (y - top) * down];
    const spots = new Map(map.places.map((place) => [place.id, { ...place, xy: to(place.at), things: [] }]));
    const svg = drawn("svg", { viewBox: `0 0 ${width} ${height}`, width, height, role: "img", "aria-label": this.said(map, where) });
    const near = this.nearest([...spots.values()].map((spot) => spot.xy)), size = Math.min(14, Math.max(3.5, near * 0.3));
    const labels = [];
    for (const area of map.areas) {
      const corners = area.corners.map(to);
      svg.append(drawn("path", { class: "area", d: `M${corners.map((corner) => corner.map(figure).join(" ")).join("L")}Z` }, drawn("title", {}, area.label)));
      const [x, y] = [Math.min(...corners.map(([one]) => one)), Math.min(...corners.map(([, one]) => one))];
      labels.push({ words: area.label, kind: "area-name", x: x + 4, y: y + 12, size: 0, anchors: [[0, 0, "start"]], optional: true });
    }
    for (const [one, other] of map.ways) {
      const [[x1, y1], [x2, y2]] = [spots.get(one).xy, spots.get(other).xy];
      svg.append(drawn("line", { class: "way", x1, y1, x2, y2 }));
    }
    for (const robot of map.robots) {
      const [x, y] = to(robot.at);
      svg.append(drawn("path", { class: "robot", d: `M${x - 9} ${y - 7}h18v14h-18z` }, drawn("title", {}, robot.label)));
      labels.push({ words: robot.label, kind: "place", x, y, size: 9 });
    }
    for (const spot of spots.values()) svg.append(drawn("circle", { class: "spot", cx: spot.xy[0], cy: spot.xy[1], r: size }));
    const away = [];
    map.things.forEach((thing, number) => {
      const [, place, words, tone] = where[number];
      if (place) spots.get(place).things.push({ thing, words, tone });
      else away.push({ thing, words, tone });
    });
    for (const spot of spots.values()) {
      const [x, y] = spot.xy;
      spot.things.slice(0, 9).forEach(({ thing, words, tone }, number) => {
        const many = Math.min(spot.things.length, 9), around = many > 1 ? size * 0.55 : 0, turn = (2 * Math.PI * number) / many;
        svg.append(drawn("circle", { class: `thing ${tone}`, cx: x + around * Math.cos(turn), cy: y + around * Math.sin(turn), r: size * (many > 1 ? 0.42 : 0.66) },
          drawn("title", {}, words || thing.label)));
      });
      const names = spot.things.map(({ thing }) => thing.label).sort(natural);
      if (names.length) {
        const opened = this.open.has(spot.id) || names.length <= 2;
        const lines = opened ? names : [names[0], `+ ${names.length - 1} more`];
        labels.push({ lines, kind: "thing-name", x, y, size, first: true, spot, opens: names.length > 2 });
      }
      labels.push({ words: spot.label, kind: "place", x, y, size, spot });
    }
    this.place(svg, labels, width, height, [...spots.values()].map((spot) => ({ x: spot.xy[0] - size, y: spot.xy[1] - size, w: 2 * size, h: 2 * size })));
    clear(this.picture, svg);
    this.caption.textContent = map.note;
    clear(this.told, away.length > 0 && [made("b", {}, "not on the map: "), folded(away, ({ words, thing }) => made("span", { class: "away" }, words || thing.label), 4)]);
  }

  said(map, where) {
    return `Map: ${map.things.map((thing, number) => where[number][2] || thing.label).slice(0, 60).join("; ") || "no objects"}`;
  }

  nearest(points) {
    let best = 60;
    points.forEach(([x, y], i) => points.slice(0, i).forEach(([a, b]) => { const far = Math.hypot(x - a, y - b); if (far > 0.5) best = Math.min(best, far); }));
    return best;
  }

  /** Put each label where it covers no other one; what has no room becomes a number. */
  place(svg, labels, width, height, spots) {
    const taken = [...spots], numbered = [];
    const free = (box, own) => box.x >= 0 && box.y >= 0 && box.x + box.w <= width && box.y + box.h <= height
      && !taken.some((one) => one !== own && box.x < one.x + one.w && one.x < box.x + box.w && box.y < one.y + one.h && one.y < box.y + box.h);
    labels.sort((a, b) => Number(Boolean(b.first)) - Number(Boolean(a.first)) || Number(Boolean(a.optional)) - Number(Boolean(b.optional)));
    for (const label of labels) {
      const lines = label.lines || [label.words], line = 13, half = label.size + 3;
      const w = Math.max(...lines.map((one) => one.length)) * (label.kind === "thing-name" ? 6.9 : 6.1) + 2, h = lines.length * line;
      const up = [-w / 2, -half - h, "middle"], below = [-w / 2, half, "middle"], east = [half, -h / 2, "start"], west = [-half - w, -h / 2, "end"];
      const tries = label.anchors ? [[0, -10, "start"]] : label.kind === "thing-name" ? [up, below, east, west] : [below, up, east, west];
      let chosen = null;
      for (const [dx, dy, anchor] of tries) {
        const box = { x: label.x + dx, y: label.y + dy, w, h };
        if (free(box)) { chosen = [box, anchor]; break; }
      }
      if (!chosen && label.optional) continue;
      if (!chosen) {
        const words = lines.length > 1 && label.spot ? label.spot.things.map(({ thing }) => thing.label).sort(natural).join(", ") : lines[0];
        const same = numbered.find((one) => one.x === label.x && one.y === label.y);
        if (same) { same.words += `: ${words}`; continue; }
        numbered.push({ x: label.x, y: label.y, words: label.kind === "thing-name" && label.spot ? `${words}` : words });
        svg.append(drawn("text", { class: "place key", x: label.x, y: label.y + 4, "text-anchor": "middle" }, String(numbered.length)));
        continue;
      }
      const [box, anchor] = chosen, x = anchor === "middle" ? box.x + w / 2 : anchor === "start" ? box.x : box.x + w;
      taken.push(box);
      lines.forEach((words, number) => {
        const opens = label.opens && (lines.length === 2 ? number === 1 : number === lines.length - 1);
        const toggle = () => { if (this.open.has(label.spot.id)) this.open.delete(label.spot.id); else this.open.add(label.spot.id); this.key = null; this.draw(this.page.time); };
        svg.append(drawn("text", { class: `${label.kind}${opens ? " opens" : ""}`, x, y: box.y + line * number + 10, "text-anchor": anchor,
          tabindex: opens ? 0 : null, role: opens ? "button" : null, onclick: opens ? toggle : null,
          onkeydown: opens ? (event) => { if (event.key === "Enter" || event.key === " ") { event.preventDefault(); toggle(); } } : null }, words));
      });
    }
    clear(this.list, numbered.length > 0 && folded(numbered.map((one, number) => `${number + 1} ${one.words}`), (words) => made("span", {}, words), 60));
  }
}

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
    const search = made("input", { type: "search", placeholder: "a word of it", "aria-label": "show the facts with this word", oninput: () => { this.word = search.value.toLowerCase(); this.rows(); } });
    this.again = made("button", { type: "button", onclick: () => { this.turned = { facts: {}, goals: {}, interventions: [] }; this.rows(); this.interventions(); this.send(); } }, "all as in the file");
    this.element = made("section", { class: "turning" }, made("h2", {}, "Turn a fact or a goal"), made("p", { class: "note" }, "The plan is made anew at once; the file stays as it is."),
      made("p", { class: "tools" }, search, " ", this.again), this.state,
      made("div", { class: "scroll" }, made("table", {}, made("thead", {}, made("tr", {}, ["what", "is", "shall be"].map((words) => made("th", { scope: "col" }, words)))), this.table)), this.people);
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
        made("td", {}, this.choice(`${row.label}: is`, values, fact, row.now, (value) => this.turn("facts", row.key, value, row.now))),
        made("td", {}, this.choice(`${row.label}: shall be`, [["", "–"], ...values], goal, wanted, (value) => this.turn("goals", row.key, value === "" ? null : value, row.wanted))));
    };
    const rows = (those, few) => {
      const left = those.slice(few);
      const more = left.length && made("tr", {}, made("td", { colspan: 3 }, made("button", { type: "button", class: "more", onclick: () => more.replaceWith(...rows(left, MANY)) }, `${left.length} more`)));
      return [...those.slice(0, few).map(line), ...(more ? [more] : [])];
    };
    clear(this.table, rows(shown, FEW));
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
        this.state.textContent = `nothing answers: ${error.message}`;
        this.state.classList.add("bad");
      }
    }
    this.busy = false;
    this.page.element.removeAttribute("aria-busy");
  }
}

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
        const lines = (rows, few) => {
          const left = rows.slice(few), more = left.length && made("tr", {}, made("td", { colspan: answer.columns.length || 1 }, made("button", { type: "button", class: "more", onclick: () => more.replaceWith(...lines(left, MANY)) }, `${left.length} more`)));
          return [...rows.slice(0, few).map(line), ...(more ? [more] : [])];
        };
        clear(out, made("p", { class: "note" }, `${answer.rows.length} row${answer.rows.length === 1 ? "" : "s"} in ${seconds} s`),
          made("div", { class: "scroll" }, made("table", {}, made("thead", {}, made("tr", {}, answer.columns.map((name) => made("th", { scope: "col" }, name)))), made("tbody", {}, lines(answer.rows, MANY)))));
      }
    } catch (error) { clear(out, made("p", { class: "bad", role: "alert" }, `nothing answers: ${error.message}`)); }
  };
  text.addEventListener("keydown", (event) => { if (event.key === "Enter" && (event.ctrlKey || event.metaKey)) { event.preventDefault(); ask(); } });
  const choose = made("select", { "aria-label": "ready questions", onchange: () => { const one = ready[choose.value]; if (one) { text.value = one.text; ask(); } } },
    made("option", { value: "" }, "a ready question …"), ready.map((one, number) => made("option", { value: number }, one.question)));
  return made("section", { class: "asking" }, made("h2", {}, "Ask in SPARQL"),
    made("p", { class: "note" }, "Asked is the scene as it is in its files, and what was observed while the robot acts; what was turned above isn't in it."),
    made("p", { class: "tools" }, choose), text, made("p", { class: "tools" }, made("button", { type: "button", onclick: ask }, "ask"), made("small", {}, " Ctrl+Enter")), out);
};

class Page {
  constructor(element, data, link) {
    Object.assign(this, { element, data, link, time: 0, word: "", opened: new Set(), closed: new Set(), playing: false });
    element.classList.add("confab");
    this.head = made("header", {});
    this.alarm = made("div", {});
    this.film = made("div", { class: "filmed" });
    this.plot = new Plot(this);
    this.scene = made("section", { class: "scene" }, this.film, this.plot.element);
    this.lanes = new Lanes(this);
    this.changes = made("p", { class: "changes", "aria-live": "polite" });
    this.tree = made("div", {});
    this.rest = made("div", {});
    this.happened = made("ul", { class: "happened" });
    this.play = made("button", { type: "button", class: "play", onclick: () => this.toggle() }, "▶");
    this.range = made("input", { type: "range", min: 0, step: "any", "aria-label": "the clock", oninput: () => this.seek(Number(this.range.value)) });
    this.said = made("output", {});
    const find = made("input", { type: "search", class: "find", placeholder: "a word", "aria-label": "show the lanes and steps with this word", oninput: () => { this.word = find.value.trim().toLowerCase(); this.lanes.draw(); this.steps(); } });
    const zoom = (factor) => () => this.lanes.zoomed(this.lanes.zoom * factor);
    this.bar = made("div", { class: "clock" }, this.play, this.range,
      made("span", { class: "tools" }, find, made("button", { type: "button", "aria-label": "wider", title: "wider (Ctrl and the wheel)", onclick: zoom(1.6) }, "+"), made("button", { type: "button", "aria-label": "narrower", onclick: zoom(1 / 1.6) }, "−"),
        made("button", { type: "button", title: "light or dark", "aria-label": "light or dark", onclick: () => this.shade() }, "◐")), this.said);
    this.legend = made("p", { class: "legend" });
    this.timed = made("section", { class: "time" }, made("h2", {}, "Timeline"), this.bar, this.legend, this.lanes.element, this.happened);
    this.planned = made("section", {}, made("h2", {}, "The plan and its reasons"), this.changes, this.tree);
    this.columns = made("div", { class: "columns" }, this.planned);
    clear(element, this.head, this.alarm, this.scene, this.timed, this.columns, this.rest);
    if (link && data.turnable) { this.turning = new Turning(this); this.turning.start(); this.columns.append(this.turning.element); }
    if (link && link.ask) this.rest.before(asking(this));
    this.seen = new ResizeObserver(() => { if (this.width !== element.clientWidth) { this.width = element.clientWidth; this.lanes.draw(); this.plot.key = null; this.plot.draw(this.time); } });
    this.update(data);
    this.seen.observe(element);
  }

  shade() {
    const dark = getComputedStyle(this.element).colorScheme === "dark" || (getComputedStyle(this.element).colorScheme !== "light" && matchMedia("(prefers-color-scheme: dark)").matches);
    (this.element.closest(".page") || this.element).style.colorScheme = dark ? "light" : "dark";
  }

  short(text) {
    const end = /^[a-z][a-z0-9+.-]*:/i.test(text) && /[#/]([^#/]+)$/.exec(text);
    return end ? decodeURIComponent(end[1]) : text;
  }

  /** Show other data: what was opened, sought and typed stays. */
  update(data, tell = false) {
    const top = (of) => of.steps.filter((step) => !step.id.includes(".")).map((step) => step.what);
    const before = this.shown ? top(this.shown) : null, follows = data.live && (!this.shown || this.time >= (this.shown.now ?? this.shown.end) - 1e-6);
    this.data = data;
    this.shown = data;
    const sign = data.good === true ? "✓ " : data.good === false ? "✗ " : "";
    clear(this.head, made("h1", {}, data.title), made("p", { class: "iri" }, data.iri), made("div", { class: "tiles" },
      made("div", { class: `tile ${data.good === true ? "good" : data.good === false ? "bad" : ""}` }, made("span", {}, "verdict"), made("b", {}, sign + data.status)),
      data.tiles.map((tile) => made("div", { class: "tile" }, made("span", {}, tile.name), made("b", {}, tile.text)))));
    const { alarm } = data;
    clear(this.alarm, alarm && made("section", { class: "alarm" },
      made("h2", {}, "✗ ", alarm.step !== undefined ? made("a", { href: `#${alarm.step}`, onclick: (event) => { event.preventDefault(); this.open(alarm.step, true); } }, alarm.title) : alarm.title),
      folded(alarm.lines, (line) => made("p", {}, line), 8), alarm.measured && alarm.measured.length > 0 && made("dl", {}, alarm.measured.map(([name, value]) => made("div", {}, made("dt", {}, name), made("dd", {}, value))))));
    if ((data.film || {}).source !== this.source) this.filmed(data.film);
    this.scene.hidden = !data.film && !data.map;
    this.scene.classList.toggle("single", !data.film || !data.map);
    const tones = new Set(data.rows.flatMap((row) => row.bars.map((bar) => bar.tone)));
    clear(this.legend, TONES.filter(([tone]) => tones.has(tone)).map(([tone, words]) => [made("i", { class: `bar ${tone}` }), `${words} `]),
      data.marks.length > 0 && [made("i", { class: "mark" }), "interventions and changes of plan"]);
    clear(this.happened, folded(data.marks, (mark) => made("li", {}, made("button", { type: "button", class: "link", onclick: () => this.seek(mark.at) }, `${figure(mark.at)} ${data.unit}`), ` ${mark.text}`), 12));
    this.timed.hidden = !data.rows.length;
    this.range.max = data.end;
    if (tell && before) {
      const rest = [...before], fresh = top(data).filter((words) => { const at = rest.indexOf(words); if (at >= 0) rest.splice(at, 1); return at < 0; });
      clear(this.changes, folded(rest, (words) => made("del", {}, words)), folded(fresh, (words) => made("ins", {}, words)),
        !rest.length && !fresh.length && made("span", { class: "note" }, "the steps of the first level are the same"));
    }
    this.lanes.draw();
    this.steps();
    this.below();
    const failed = data.rows.flatMap((row) => (row.group === "actors" ? row.bars : [])).find((bar) => bar.tone === "failed");
    if (follows) this.seek(data.now ?? data.end);
    else if (before === null && failed) { this.seek(failed.begin); this.open(failed.step); } else this.seek(before === null ? 0 : Math.min(this.time, data.end));
  }

  filmed(film) {
    this.source = (film || {}).source;
    this.video = null;
    if (!film) { clear(this.film); return; }
    if (film.kind === "image/gif") { clear(this.film, made("figure", { class: "film" }, made("img", { src: film.source, alt: "film of the run" }), made("figcaption", {}, film.caption))); return; }
    this.video = made("video", { src: film.source, controls: true, playsinline: true, "aria-label": "film of the run" });
    this.video.muted = true;
    const follow = () => {
      if (this.sought) return;
      this.clock(this.video.currentTime * film.speed);
      if (!this.video.paused && !this.video.ended) requestAnimationFrame(follow);
    };
    for (const event of ["play", "timeupdate"]) this.video.addEventListener(event, follow);
    this.video.addEventListener("seeked", () => { this.sought = false; follow(); });
    clear(this.film, made("figure", { class: "film" }, this.video, made("figcaption", {}, `${film.caption}; the map is seen from the same side`)));
  }

  steps() { clear(this.tree, tree(this)); this.clock(this.time); }

  below() {
    const { goals, learned, notes, again } = this.data, ended = goals.some((goal) => goal.after !== undefined);
    clear(this.rest, goals.length > 0 && made("section", {}, made("h2", {}, "Goals"), made("div", { class: "scroll" }, made("table", {},
      made("thead", {}, made("tr", {}, ["goal", "before", ...(ended ? ["in the end"] : [])].map((words) => made("th", { scope: "col" }, words)))),
      made("tbody", {}, goals.map((goal) => made("tr", {}, made("td", {}, goal.label), made("td", {}, goal.before), ended && made("td", { class: goal.met ? "ok" : "bad" }, `${goal.met ? "✓" : "✗"} ${goal.after}`))))))),
    learned && made("section", {}, made("h2", {}, "What was learned"), made("p", {}, learned.text), learned.rules.map(([title, rules]) => [made("h3", {}, title), made("ul", {}, rules.map((rule) => made("li", {}, rule)))])),
    again && made("section", {}, made("h2", {}, "Again"), made("pre", {}, again)), notes.map((note) => made("p", { class: "note" }, note)));
  }

  toggle() {
    if (this.video) { if (this.video.paused) this.video.play(); else this.video.pause(); return; }
    this.playing = !this.playing;
    if (!this.playing) { this.clock(this.time); return; }
    if (this.time >= this.data.end - 1e-6) this.time = 0;
    const speed = Math.max(1, this.data.end / 25);
    let last = performance.now();
    const tick = (now) => {
      if (!this.playing) return;
      const time = this.time + ((now - last) / 1000) * speed;
      last = now;
      if (time >= this.data.end) this.playing = false;
      this.clock(Math.min(time, this.data.end));
      if (this.playing) requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }

  /** Move the clock, and the film with it. */
  seek(time) {
    if (this.video && this.data.film) { this.sought = true; this.video.pause(); this.video.currentTime = time / this.data.film.speed; }
    this.clock(time);
  }

  /** Move the clock to the next or the last beginning of a primitive. */
  next(turn) {
    const begins = [...new Set(this.data.rows.flatMap((row) => (row.group === "actors" ? row.bars.map((bar) => bar.begin) : [])))].sort((a, b) => a - b);
    const found = turn > 0 ? begins.find((begin) => begin > this.time + 1e-6) : begins.reverse().find((begin) => begin < this.time - 1e-6);
    this.seek(found ?? (turn > 0 ? this.data.end : 0));
  }

  /** Show a time: on the lanes, the map, the plan and in words. */
  clock(time) {
    const { data } = this;
    this.time = time;
    this.range.value = time;
    const now = data.steps.filter((step) => step.begin !== undefined && step.begin <= time + 1e-9 && time < step.end - 1e-9);
    const words = `${figure(time)} ${data.unit}${now.length ? `: ${now.map((step) => step.what).join(" › ")}` : ""}`;
    this.said.textContent = words;
    this.range.setAttribute("aria-valuetext", words);
    const running = this.video ? !this.video.paused : this.playing;
    this.play.textContent = running ? "⏸" : "▶";
    this.play.setAttribute("aria-label", running ? "pause" : "play");
    const current = new Set(now.map((step) => step.id));
    for (const item of this.tree.querySelectorAll("li.now")) if (!current.has(item.dataset.step)) item.classList.remove("now");
    for (const id of current) { const item = this.tree.querySelector(`li[data-step="${id}"]`); if (item) item.classList.add("now"); }
    this.lanes.show(time);
    this.plot.draw(time);
  }

  /** Open a step of the plan with all above it. */
  open(id, scroll = false) {
    const above = [];
    for (let one = id; one; one = lead(one)) above.unshift(one);
    for (const one of above) {
      const details = this.tree.querySelector(`li[data-step="${one}"] > details`);
      if (details) { details.open = true; details.dispatchEvent(new Event("toggle")); }
    }
    const item = this.tree.querySelector(`li[data-step="${id}"]`);
    for (const other of this.tree.querySelectorAll(".chosen")) other.classList.remove("chosen");
    if (item) { item.classList.add("chosen"); if (scroll) item.scrollIntoView({ block: "center" }); }
  }
}

/** A folder of runs: one is shown, two are compared. */
const history = (element, data) => {
  const chosen = new Set(data.runs.length ? [data.runs.length - 1] : []), table = made("tbody", {}), out = made("div", {});
  const names = [...new Set(data.runs.flatMap((run) => run.page.tiles.map((tile) => tile.name)))];
  const value = (run, name) => (run.page.tiles.find((tile) => tile.name === name) || { text: "" }).text;
  const rows = () => clear(table, data.runs.map((run, number) => made("tr", { class: chosen.has(number) ? "chosen" : "" },
    made("td", {}, made("label", {}, made("input", { type: "checkbox", checked: chosen.has(number), "aria-label": `show ${run.name}`, onchange: (event) => {
      if (event.target.checked) { chosen.add(number); if (chosen.size > 2) chosen.delete([...chosen][0]); } else chosen.delete(number);
      rows();
      show();
    } }), ` ${run.name}`)), made("td", {}, run.page.title), made("td", {}, run.when), made("td", { class: run.page.good ? "ok" : "bad" }, `${run.page.good ? "✓" : "✗"} ${run.page.status}`),
    names.map((name) => made("td", {}, value(run, name))), made("td", {}, run.memory))));
  const show = () => {
    const two = [...chosen].sort((a, b) => a - b).map((number) => data.runs[number]);
    clear(out);
    if (two.length === 2) {
      const [one, other] = two, top = (run) => run.page.steps.filter((step) => !step.id.includes(".")).map((step) => step.what);
      const gone = top(one), fresh = top(other).filter((words) => { const at = gone.indexOf(words); if (at >= 0) gone.splice(at, 1); return at < 0; });
      const line = (name, a, b) => made("tr", { class: a === b ? "" : "differs" }, made("th", { scope: "row" }, name), made("td", {}, a), made("td", {}, b));
      out.append(made("section", {}, made("h2", {}, `${one.name} and ${other.name} compared`), made("div", { class: "scroll" }, made("table", {},
        made("thead", {}, made("tr", {}, ["", one.name, other.name].map((words) => made("th", { scope: "col" }, words)))),
        made("tbody", {}, line("verdict", one.page.status, other.page.status), names.map((name) => line(name, value(one, name), value(other, name))), line("memory", one.memory, other.memory)))),
      made("p", { class: "changes" }, gone.map((words) => made("del", {}, words)), fresh.map((words) => made("ins", {}, words)),
        !gone.length && !fresh.length && made("span", { class: "note" }, "the steps of the first level are the same"))));
    }
    const end = Math.max(...two.map((run) => run.page.end));
    for (const run of two) {
      const root = made("div", { class: "run" });
      out.append(root);
      new Page(root, two.length === 2 ? { ...run.page, title: run.name, end } : run.page, null);
    }
  };
  element.classList.add("confab");
  clear(element, made("h1", {}, data.title), made("p", { class: "note" }, "One run is shown; two are compared."), made("div", { class: "scroll" }, made("table", { class: "runs" },
    made("thead", {}, made("tr", {}, ["run", "scene", "when", "verdict", ...names, "memory"].map((words) => made("th", { scope: "col" }, words)))), table)), out);
  rows();
  show();
};

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
    try { data = await link.json("GET"); } catch (error) { element.textContent = `nothing answers yet: ${error.message}`; await new Promise((done) => { setTimeout(done, 500); }); }
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
    } catch { state.textContent = "over: nothing answers any more; this is what was seen last"; return; }
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

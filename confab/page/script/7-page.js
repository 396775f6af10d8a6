class Page {
  constructor(element, data, link) {
    Object.assign(this, { element, data, link, time: 0, word: "", opened: new Set(), closed: new Set(), playing: false });
    element.classList.add("confab");
    this.head = made("header", {});
    this.alarm = made("div", {});
    this.film = made("div", { class: "filmed" });
    this.plot = new Plot(this);
    this.goals = made("section", { class: "goals" });
    this.scene = made("section", { class: "scene" }, this.film, this.plot.element);
    this.lanes = new Lanes(this);
    this.changes = made("p", { class: "changes", "aria-live": "polite" });
    this.tree = made("div", {});
    this.rest = made("div", {});
    this.happened = made("ul", { class: "happened" });
    this.play = made("button", { type: "button", class: "play", onclick: () => this.toggle() }, "▶");
    this.range = made("input", { type: "range", min: 0, step: "any", "aria-label": "the clock", oninput: () => this.seek(Number(this.range.value)) });
    this.said = made("output", {});
    const find = made("input", { type: "search", class: "find", placeholder: "filter rows", "aria-label": "show the lanes and steps with this word", oninput: () => { this.word = find.value.trim().toLowerCase(); this.lanes.draw(); this.steps(); } });
    const zoom = (factor) => () => this.lanes.zoomed(this.lanes.zoom * factor);
    this.bar = made("div", { class: "clock" }, this.play, this.range,
      made("span", { class: "tools" }, find, made("button", { type: "button", "aria-label": "wider", title: "wider (Ctrl and the wheel)", onclick: zoom(1.6) }, "+"), made("button", { type: "button", "aria-label": "narrower", onclick: zoom(1 / 1.6) }, "−"),
        made("button", { type: "button", title: "light or dark", "aria-label": "light or dark", onclick: () => this.shade() }, "◐")), this.said);
    this.legend = made("p", { class: "legend" });
    this.timed = made("section", { class: "time" }, this.title = made("h2", {}), this.bar, this.legend, this.lanes.element, this.happened);
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
    const beside = data.map && data.map.metric && !data.film; // such a map has room beside it
    this.scene.classList.toggle("single", !beside && (!data.film || !data.map));
    if (beside) this.scene.append(this.goals); else this.rest.before(this.goals);
    this.title.textContent = data.steps.length ? "Timeline" : "Facts";
    this.timed.classList.toggle("idle", !data.steps.length);
    this.planned.hidden = !data.steps.length && !this.changes.childNodes.length;
    const tones = new Set(data.rows.flatMap((row) => row.bars.map((bar) => bar.tone)));
    clear(this.legend, TONES.filter(([tone]) => tones.has(tone)).map(([tone, words]) => made("span", {}, made("i", { class: `bar ${tone}` }), words)),
      data.marks.length > 0 && made("span", {}, made("i", { class: "mark" }), "interventions and changes of plan"));
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
    this.video = made("video", { src: film.source, poster: film.poster, controls: true, playsinline: true, "aria-label": "film of the run" });
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
    const { learned, notes, again } = this.data, ended = this.data.goals.some((goal) => goal.after !== undefined), acting = this.data.live && this.data.good === null;
    const goals = [...this.data.goals].sort((a, b) => Number(a.met !== false) - Number(b.met !== false) || natural(a.label, b.label));
    clear(this.goals, goals.length > 0 && [made("h2", {}, "Goals"), made("div", { class: "scroll" }, made("table", {},
      made("thead", {}, made("tr", {}, ["goal", "before", ...(ended ? [acting ? "now" : "in the end"] : [])].map((words) => made("th", { scope: "col" }, words)))),
      made("tbody", {}, lined(goals, (goal) => made("tr", {}, made("td", {}, goal.label), made("td", {}, goal.before), ended && made("td", { class: goal.met ? "ok" : acting ? "" : "bad" }, `${goal.met ? "✓" : acting ? "" : "✗"} ${goal.after}`)), 3, UNFOLDED))))]);
    clear(this.rest, learned && made("section", {}, made("h2", {}, "What was learned"), made("p", {}, learned.text), learned.rules.map(([title, rules]) => [made("h3", {}, title), made("ul", {}, rules.map((rule) => made("li", {}, rule)))])),
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

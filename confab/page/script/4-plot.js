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
    this.whole = false;
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
    const where = map.things.map((thing) => this.at(thing, time)), key = `${this.picture.clientWidth}|${this.whole}|${[...this.open]}|${where.map((one) => one[0])}`;
    if (key === this.key && map === this.drawnOf) return;
    this.key = key;
    this.drawnOf = map;
    const ordered = !map.metric && !map.ways.length; // such places stand in as many columns as there is room for
    const columns = Math.max(2, Math.floor(this.picture.clientWidth / 80)), narrow = this.picture.clientWidth < 700;
    const used = new Set(map.things.flatMap((thing) => thing.at.map(([, place]) => place))), empty = map.places.filter((place) => !used.has(place.id));
    const folds = ordered && used.size > 0 && empty.length > UNFOLDED, shown = folds && !this.whole ? map.places.filter((place) => used.has(place.id)) : map.places;
    const turned = narrow && !map.metric && !ordered; // what connects places has no direction: on a narrow page it runs down
    const places = ordered ? shown.map((place, number) => ({ ...place, at: [number % columns, Math.floor(number / columns)] }))
      : turned ? map.places.map((place) => ({ ...place, at: [place.at[1], place.at[0]] })) : map.places;
    const points = [...places.map((place) => place.at), ...map.areas.flatMap((area) => area.corners), ...map.robots.map((robot) => robot.at)];
    const xs = points.map(([x]) => x), ys = points.map(([, y]) => y);
    const [left, right, top, bottom] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
    const width = Math.max(220, this.picture.clientWidth), edge = Math.min(60, width / 8);
    const wide = Math.max(right - left, 1e-6), high = Math.max(bottom - top, 1e-6);
    let scale = (width - 2 * edge) / wide;
    const tallest = turned ? width * 1.9 : Math.min(this.page.data.film ? 560 : 430, Math.max(260, width * 0.9));
    if (map.metric && high * scale > tallest - 2 * edge) scale = (tallest - 2 * edge) / high;
    const down = map.metric ? scale : ordered ? 74 : Math.min(turned ? Infinity : 1.4 * scale, Math.max((tallest - 2 * edge) / high, 1e-6));
    const shift = (width - wide * scale) / 2, height = high * down + 2 * edge;
    const to = ([x, y]) => [shift + (x - left) * scale, edge + (y - top) * down];
    const spots = new Map(places.map((place) => [place.id, { ...place, xy: to(place.at), things: [] }]));
    const svg = drawn("svg", { viewBox: `0 0 ${width} ${height}`, width, height, role: "img", "aria-label": this.said(map, where) });
    const near = this.nearest([...spots.values()].map((spot) => spot.xy)), size = Math.min(14, Math.max(3.5, near * 0.3));
    const labels = [];
    for (const area of map.areas) {
      const corners = area.corners.map(to);
      svg.append(drawn("path", { class: "area", d: `M${corners.map((corner) => corner.map(figure).join(" ")).join("L")}Z` }, drawn("title", {}, area.label)));
      if (spots.has(area.id)) continue; // its place bears the name
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
        const lines = names.length <= 2 ? names : opened ? [...names, "fold"] : [names[0], `+ ${names.length - 1} more`];
        labels.push({ lines, kind: "thing-name", x, y, size, first: true, spot, opens: names.length > 2 });
      }
      labels.push({ words: spot.label, kind: "place", x, y, size, spot });
    }
    this.place(svg, labels, width, height, [...spots.values()].map((spot) => ({ x: spot.xy[0] - size, y: spot.xy[1] - size, w: 2 * size, h: 2 * size })));
    clear(this.picture, svg);
    clear(this.caption, map.note, folds && ["; ", made("button", { type: "button", class: "link", onclick: () => { this.whole = !this.whole; this.draw(this.page.time); } },
      this.whole ? "fold the empty ones" : `${empty.length} stay empty`)]);
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
      const font = label.kind === "thing-name" ? "700 12px" : "11px", w = Math.max(...lines.map((one) => wide(one, font))) + 4, h = lines.length * line;
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
        const number = String(numbered.length), room = wide(number, "10px") + 2, beside = [[half, -6], [-half - room, -6], [-room / 2, half], [-room / 2, -half - 12]]
          .map(([dx, dy]) => ({ x: label.x + dx, y: label.y + dy, w: room, h: 12 })).find((box) => label.size < 8 && free(box));
        if (beside) taken.push(beside); // on a small circle a number can't be read
        svg.append(drawn("text", { class: "place key", x: beside ? beside.x + room / 2 : label.x, y: beside ? beside.y + 10 : label.y + 4, "text-anchor": "middle" }, number));
        continue;
      }
      const [box, anchor] = chosen, x = anchor === "middle" ? box.x + w / 2 : anchor === "start" ? box.x : box.x + w;
      taken.push(box);
      lines.forEach((words, number) => {
        const opens = label.opens && number === lines.length - 1;
        const toggle = () => { if (this.open.has(label.spot.id)) this.open.delete(label.spot.id); else this.open.add(label.spot.id); this.key = null; this.draw(this.page.time); };
        svg.append(drawn("text", { class: `${label.kind}${opens ? " opens" : ""}`, x, y: box.y + line * number + 10, "text-anchor": anchor,
          tabindex: opens ? 0 : null, role: opens ? "button" : null, onclick: opens ? toggle : null,
          onkeydown: opens ? (event) => { if (event.key === "Enter" || event.key === " ") { event.preventDefault(); toggle(); } } : null }, words));
      });
    }
    clear(this.list, numbered.length > 0 && folded(numbered.map((one, number) => `${number + 1} ${one.words}`), (words) => made("span", {}, words), 60));
  }
}

// The page: map, lanes and plan follow one clock; facts are turned and queries asked where something answers (a server or a
// notebook's kernel). It shows one JSON object (docs/page.md), wherever that comes from; `start` and `render` below say where.

const FEW = 40, MANY = 200; // rows shown at first, and by each further click
const UNFOLDED = 8; // most steps of the first level that stand open, most goals and most empty places that aren't folded
const natural = new Intl.Collator("en", { numeric: true }).compare;
const GROUPS = {
  levels: "steps by level", actors: "primitives by actor", changes: "facts that change", wanted: "goals about unchanged facts", fixed: "other unchanged facts",
};
const TONES = [
  ["action", "step"], ["planned", "step not yet executed"], ["failed", "failed"], ["start", "initial value"],
  ["between", "other value"], ["wanted", "goal value"],
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

/** The width of words in pixels, by default in the font of a lane of primitives. */
const wide = (() => {
  const pen = document.createElement("canvas").getContext("2d"), known = new Map();
  return (words, font = "9.6px") => {
    const key = `${font} ${words}`;
    pen.font = `${font} system-ui, -apple-system, "Segoe UI", sans-serif`;
    if (!known.has(key)) known.set(key, pen.measureText(words).width);
    return known.get(key);
  };
})();

/** Rows of a table for some values, a few at first; a button in a row of its own opens more of them. */
const lined = (values, row, columns, few = FEW) => {
  const left = values.slice(few);
  const more = left.length > 0 && made("tr", {}, made("td", { colspan: columns }, made("button", { type: "button", class: "more", onclick: () => more.replaceWith(...lined(left, row, columns, MANY)) }, `${left.length} more`)));
  return [...values.slice(0, few).map(row), ...(more ? [more] : [])];
};

/** Elements for some values, a few at first; a button opens more of them. */
const folded = (values, element, few = FEW, step = MANY) => {
  const shown = values.slice(0, few).map(element), left = values.slice(few);
  if (!left.length) return shown;
  const more = made("button", { type: "button", class: "more", onclick: () => more.replaceWith(...folded(left, element, step, step)) }, `${left.length} more`);
  return [...shown, more];
};

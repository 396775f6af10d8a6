// A click on the timeline seeks the film, and a cursor follows the film; without a film the click opens the step in the plan.
// The page works without this script: bars are links to steps.
(() => {
  "use strict";
  const open = (element) => {
    for (let e = element; e; e = e.parentElement) if (e.tagName === "DETAILS") e.open = true;
  };
  const goto = (id, scroll) => {
    const step = document.getElementById(id);
    if (!step) return;
    const inside = step.querySelector(":scope > details");
    open(inside || step);
    if (scroll) step.scrollIntoView({ block: "center" });
  };
  const figure = document.querySelector(".timeline");
  const film = document.querySelector(".film video");
  if (figure) {
    const end = Number(figure.dataset.end), speed = Number(figure.dataset.speed || 1), unit = figure.dataset.unit;
    const slack = end / 5000;
    const cursor = figure.querySelector(".cursor"), said = figure.querySelector("output");
    const bars = [...figure.querySelectorAll("a.bar")].map((bar) => ({ bar, begin: Number(bar.dataset.t), share: parseFloat(bar.style.width) }));
    let shown = null;
    const show = (time) => {
      shown = time;
      cursor.style.display = "block";
      cursor.style.left = `${(100 * Math.min(time, end)) / end}%`;
      const scroll = figure.querySelector(".scroll"), at = cursor.getBoundingClientRect().left, box = scroll.getBoundingClientRect();
      if (at < box.left + 110 || at > box.right - 30) scroll.scrollLeft += at - (box.left + 0.6 * box.width);
      const now = [];
      for (const { bar, begin, share } of bars) {
        const on = begin <= time + slack && time < begin + (share * end) / 100 - slack;
        bar.classList.toggle("now", on);
        if (on) now.push(bar.title);
      }
      said.textContent = `${time.toFixed(1)} ${unit}${now.length ? ": " + now.join(" › ") : ""}`;
    };
    addEventListener("resize", () => { if (shown !== null) show(shown); });
    const lanes = figure.querySelector(".lanes"), over = figure.querySelector(".over");
    lanes.addEventListener("click", (event) => {
      const box = over.getBoundingClientRect();
      const bar = event.target.closest("a.bar");
      const at = ((event.clientX - box.left) / box.width) * end;
      const time = bar && event.detail === 0 ? Number(bar.dataset.t) : Math.max(0, Math.min(end, at));
      if (bar) goto(bar.getAttribute("href").slice(1), false);
      if (film) {
        event.preventDefault();
        film.currentTime = time / speed;
        film.pause();
      }
      show(time);
    });
    if (film) {
      const follow = () => {
        show(film.currentTime * speed);
        if (!film.paused && !film.ended) requestAnimationFrame(follow);
      };
      for (const event of ["play", "seeked", "timeupdate"]) film.addEventListener(event, follow);
    }
    const failed = figure.querySelector("a.bar.failed:not(.level)");
    if (failed) {
      const time = Number(failed.dataset.t);
      show(time);
      if (film) film.addEventListener("loadedmetadata", () => { film.currentTime = time / speed; }, { once: true });
    }
  }
  const named = () => location.hash && goto(decodeURIComponent(location.hash.slice(1)), true);
  addEventListener("hashchange", named);
  named();
  addEventListener("beforeprint", () => { for (const each of document.querySelectorAll("details")) each.open = true; });
})();

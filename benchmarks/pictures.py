"""Pictures of the page in Chromium, in wide and narrow windows, light and dark, for inspection by a person.

    python -m benchmarks.pictures INTO [PART OF A NAME …]

The names are demo, objects, house, failed, unsolvable, live, endpoint and compared.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import confab
from confab.history import history_html, new_folder, runs
from confab.page.data import page_data
from confab.page.frozen import write_page
from confab.planner.acting.episode import Event
from confab.reasoner.files import write_whole
from confab.running import Job, run
from confab.serving import serving
from worlds.browser import Browser

SIZES = (1280, 420)
"""Widths of the window in pixels."""
TABLE = "beverage-serving"
MOMENTS = (0, 14, 30)
"""Numbers of finished primitives at which the page of an execution is pictured."""
DISTURBED = ("after=28 cup2 LOCATION location8", "after=28 goal cup2 LOCATION location8")
NOISE = 0.03
"""Standard deviation of perceived positions in metres at which a run fails."""


class Studio:
    """A browser that writes pictures of pages into a folder. `work` is a folder for the pages."""

    def __init__(self, into: Path, work: Path, browser: Browser) -> None:
        self.into, self.work, self.browser = into, work, browser

    def take(self, name: str, address: str, ready: str = "document.querySelector('h1') !== null") -> None:
        """Picture a URL at each size of the window, light and dark."""
        for width in SIZES:
            for dark in (False, True):
                self.browser.open(address, width, dark=dark)
                self.browser.wait(ready)
                self.browser.run("new Promise((done) => setTimeout(done, 150))")
                path = self.into / f"{name}-{width}-{'dark' if dark else 'light'}.png"
                self.browser.shot(path)
                print(path, flush=True)
        assert not self.browser.faults, self.browser.faults

    def file(self, name: str, html: str) -> str:
        """Write a page into the work folder, and return its URL."""
        write_whole(self.work / f"{name}.html", html)
        return (self.work / f"{name}.html").as_uri()


def demo(studio: Studio) -> None:
    """Picture the report of `confab run`."""
    run(Job(TABLE, studio.work / "demo", memory=studio.work / "demo" / "memory.ttl"))
    studio.take("demo", (studio.work / "demo" / "report.html").as_uri())


def objects(studio: Studio) -> None:
    """Picture the plan of a table with 50 objects."""
    scene = confab.generate("served", studio.work / "served.ttl", objects=50)
    studio.take("objects", write_page(studio.work / "objects.html", page_data(scene, scene.plan())).as_uri())


def house(studio: Studio) -> None:
    """Picture the plan in a house with many rooms."""
    scene = confab.load("house-large")
    studio.take("house", write_page(studio.work / "house.html", page_data(scene, scene.plan())).as_uri())


def failed(studio: Studio) -> None:
    """Draw a run that fails in physics."""
    run(Job(TABLE, studio.work / "failed", noise=NOISE, seed=1))
    studio.take("failed", (studio.work / "failed" / "report.html").as_uri())


def unsolvable(studio: Studio) -> None:
    """Picture the proof that a task has no plan."""
    scene = confab.load(TABLE)
    data = page_data(scene, scene.plan(["cup1 LOCATION location7", "cup2 LOCATION location7"]))
    studio.take("unsolvable", write_page(studio.work / "unsolvable.html", data).as_uri())


def live(studio: Studio) -> None:
    """Picture an execution at three moments."""
    scene = confab.load(TABLE)
    with serving(scene, 0) as server:

        def look(event: Event) -> None:
            server.service.take(event)
            if event.what == "begin" and event.seconds in MOMENTS:
                studio.take(f"live-{event.seconds:g}", server.url)

        scene.execute(interventions=DISTURBED, observer=look)


def endpoint(studio: Studio) -> None:
    """Picture the page with changed facts and queries."""
    with serving(confab.load(TABLE), 0) as server:
        studio.take("endpoint", server.url, "document.querySelector('.plan') !== null")


def compared(studio: Studio) -> None:
    """Picture the comparison of two runs, and the history of runs."""
    for goals in ((), ("cup1 LOCATION location8",)):
        run(Job(TABLE, new_folder(studio.work / "runs"), goals=goals, film=False))
    for name, shown in (("compared", ("001", "002")), ("history", ())):
        studio.take(name, studio.file(name, history_html(runs(studio.work / "runs"), "Runs", shown)))


SUBJECTS: dict[str, Callable[[Studio], None]] = {
    each.__name__: each for each in (demo, objects, house, failed, unsolvable, live, endpoint, compared)
}


def main() -> None:
    """Make the pictures whose names contain a given text, by default all pictures."""
    if len(sys.argv) < 2 or not sys.argv[0].endswith("pictures.py"):
        print("nothing pictured: python -m benchmarks.pictures INTO [PART OF A NAME …]")
        return
    into, parts = Path(sys.argv[1]), sys.argv[2:]
    into.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as work, Browser() as browser:
        studio = Studio(into, Path(work), browser)
        for name, picture in SUBJECTS.items():
            if not parts or any(part in name for part in parts):
                picture(studio)


if __name__ == "__main__":
    main()

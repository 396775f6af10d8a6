"""The report: one file that needs nothing else, for runs of every kind, on a phone and in the dark; notebooks show its pieces."""

import json
import re
import shutil
import subprocess
from dataclasses import replace
from html import unescape
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path

import pytest
from click.testing import CliRunner

import confab
from confab.cli import app
from confab.memory import Memory
from confab.planner.plan import Plan
from confab.report.course import of_episode, of_plan, of_rollout
from confab.report.maps import ground_of
from confab.report.notebook import SHOWN
from confab.report.page import report_html
from confab.report.pieces import anchor
from confab.sim.verdict import Verdict
from confab.sim.verify import Rollout, StepReport
from confab.table import Table

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
FLAGS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--virtual-time-budget=2000",
    "--dump-dom",
]
SYMBOLIC = ["towers-small", "house-small"]
FIGURE_8 = ("after=28 cup2 LOCATION location8", "after=28 goal cup2 LOCATION location8")


class Page(HTMLParser):
    """What a page loads, and which names its links lead to."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.loads: list[str] = []
        self.links: list[str] = []
        self.ids: set[str] = set()
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name == "id":
                self.ids.add(value or "")
            if name in ("src", "srcset", "poster", "data", "action") or (
                name == "href" and tag in ("link", "use", "image")
            ):
                self.loads.append(value or "")
            elif name == "href":
                self.links.append(value or "")


@pytest.fixture(scope="module")
def scene() -> confab.Scene:
    return confab.load("beverage-serving")


@pytest.fixture(scope="module")
def serving(scene: confab.Scene) -> confab.Result:
    return scene.plan()


@pytest.fixture(scope="module")
def failed(serving: confab.Result) -> confab.Report:
    """A run that lost the cup at its tenth primitive, as physics tells it."""
    steps = serving.plan.primitives[:10]
    reports = [StepReport(step, Verdict(True, measured={"joint_lag_rad": 0.01}), 1.0) for step in steps]
    lost = Verdict(False, "slip or drop", ("cup2",), {"joint_lag_rad": 0.0863}, "it was lost on the way")
    reports[-1] = StepReport(steps[-1], lost, 0.5)
    rollout = Rollout(0, False, tuple(reports), (), 2.0, 9.75, {})
    return confab.Report(serving.plan, serving.problem.goal, (rollout,), None, {}, serving.scene)


@pytest.fixture(scope="module")
def pages(
    scene: confab.Scene, serving: confab.Result, failed: confab.Report, tmp_path_factory: pytest.TempPathFactory
) -> dict[str, str]:
    memory = Memory.of(scene)
    memory.learn(scene, serving.plan)
    made = {
        "plan": report_html(scene, serving),
        "failed": report_html(scene, serving, failed),
        "learned": report_html(scene, serving, None, None, memory),
        "episode": report_html(scene, execution=scene.execute(interventions=FIGURE_8)),
        "none": report_html(scene, scene.plan(["cup1 LOCATION location7", "cup2 LOCATION location7"])),
    }
    for name in SYMBOLIC:
        result = confab.load(name).plan()
        made[name] = report_html(result.scene, result)
    return made


def test_a_page_loads_nothing_from_anywhere(pages: dict[str, str]) -> None:
    for name, page in pages.items():
        found = Page(page)
        assert [source for source in found.loads if not source.startswith("data:")] == [], name
        assert {link[1:] for link in found.links} <= found.ids, name
        assert "url(" not in page, name
        assert "@import" not in page, name
        assert "$" not in re.sub(r"<script>.*?</script>", "", page, flags=re.S), name


def test_a_page_speaks_in_labels_and_has_ids_small(pages: dict[str, str]) -> None:
    page = pages["plan"]
    assert "move cup 1 to location 7" in page
    assert "<small>L1#0 · B1_MOVE #22</small>" in page
    assert "it is wanted that cup 1 is at location 7" in page
    assert "left hand holds" in page
    assert "LOCATION" not in re.sub(r"<small>.*?</small>", "", page)


def test_a_failed_run_begins_with_what_failed_and_is_open_there(pages: dict[str, str], failed: confab.Report) -> None:
    page, step = pages["failed"], failed.rollouts[0].steps[-1].step
    assert 'class="tile bad"' in page
    assert "slip or drop" in page
    assert "0.0863" in page
    assert page.index('class="alarm"') < page.index('class="timeline"')
    for length in range(1, len(step.path)):
        assert f'<li id="{anchor(step.path[:length])}"><details open' in page


def test_every_kind_of_run_says_how_it_ended(pages: dict[str, str]) -> None:
    assert "✓ a plan, checked" in pages["towers-small"]
    assert "✓ reached" in pages["episode"]
    assert "repair:" in pages["episode"]
    assert "✗ unsolvable" in pages["none"]
    assert "What was learned" in pages["learned"]
    assert all("confab run" in page or "confab execute" in page for page in pages.values())


def test_places_that_static_relations_connect_are_a_map(pages: dict[str, str]) -> None:
    assert "cup from windowsill to kitchen table" in pages["house-small"]
    assert "<svg" not in pages["towers-small"]
    assert "cup 1 from location 2 to location 7" in pages["plan"]


def test_time_is_told_once_and_whole(serving: confab.Result, failed: confab.Report) -> None:
    for course in (
        of_plan(serving.problem, serving.plan),
        of_rollout(serving.problem, serving.plan, failed.rollouts[0]),
    ):
        for phases in course.phases.values():
            assert phases[0].begin == 0
            assert phases[-1].end == course.end
            assert all(a.end == b.begin and a.value != b.value for a, b in pairwise(phases))
    assert all(of_plan(serving.problem, serving.plan).met(symbol) for symbol in serving.problem.goal)
    assert course.failed is not None


def test_an_episode_is_told_as_it_was_seen() -> None:
    scene = confab.load("beverage-serving")
    episode = scene.execute(interventions=FIGURE_8).episode
    course = of_episode(scene.problem, episode)
    assert [text for _, text in course.marks][:2] == list(FIGURE_8)
    assert all(phases[-1].value == episode.observed[symbol] for symbol, phases in course.phases.items())


def test_nothing_to_do_makes_a_page(serving: confab.Result) -> None:
    nothing = replace(serving, outcome=replace(serving.outcome, plan=Plan(())))
    page = report_html(serving.scene, nothing)
    assert "✓ a plan, checked" in page
    assert 'class="timeline"' not in page


def test_what_is_quoted_is_escaped(serving: confab.Result, failed: confab.Report) -> None:
    first = failed.rollouts[0]
    bad = Verdict(False, "slip or drop", (), {}, "<script>alert(1)</script>")
    steps = (*first.steps[:-1], StepReport(first.steps[-1].step, bad, 0.5))
    report = confab.Report(serving.plan, serving.problem.goal, (Rollout(0, False, steps, (), 1.0, 9.5),))
    assert "<script>alert" not in report_html(serving.scene, serving, report)


def test_notebooks_show_the_same_pieces(scene: confab.Scene, serving: confab.Result, failed: confab.Report) -> None:
    shown = [
        scene, serving, failed, scene.execute(), Memory.of(scene), serving.why(0), serving.why_not("B1_MOVE cup2 location1"),
        serving.explain(),
    ]  # fmt: skip
    for value in shown:
        html = value._repr_html_()  # type: ignore[attr-defined]
        assert html.startswith('<div class="confab">'), value
        assert not [source for source in Page(html).loads if not source.startswith("data:")]
    plan = serving.plan
    values = [serving.outcome, plan, plan.steps[0], failed.rollouts[0].steps[-1].verdict]
    for (_, name), show in SHOWN.items():
        value = next(value for value in values if type(value).__name__ == name)
        assert "confab" in show(value)
    assert isinstance(Memory.of(scene).advice(), Table)


def test_a_result_and_an_execution_write_their_page(
    scene: confab.Scene, serving: confab.Result, tmp_path: Path
) -> None:
    assert serving.report(tmp_path / "plan.html").read_text().startswith("<!doctype html>")
    assert scene.execute().report(tmp_path / "run.html").read_text().rstrip().endswith("</html>")


WATCH = """<script>
window.faults = []; addEventListener("error", (e) => faults.push(e.message));
addEventListener("load", () => {
  const out = (e) => !e.closest(".scroll") && !e.closest("svg") && e.getBoundingClientRect().right > innerWidth + 1;
  const wide = [...document.querySelectorAll("body *")].filter(out).map((e) => e.className || e.tagName);
  const bar = document.querySelectorAll("a.bar")[7];
  if (bar) bar.click();
  const said = document.querySelector("output"), cursor = document.querySelector(".cursor");
  const over = document.documentElement.scrollWidth - innerWidth;
  document.title = "SEEN " + JSON.stringify({ over, wide: wide.slice(0, 5), faults,
    told: said ? said.textContent : "", cursor: cursor ? cursor.style.display : "" });
});</script>"""


@pytest.mark.skipif(CHROMIUM is None, reason="needs chromium (Debian: apt install chromium)")
@pytest.mark.parametrize(("name", "size"), [("failed", 1280), ("failed", 420), ("house-small", 420)])
def test_in_a_browser_nothing_runs_over_or_fails_and_a_click_is_followed(
    pages: dict[str, str], name: str, size: int, tmp_path: Path
) -> None:
    assert CHROMIUM is not None
    (tmp_path / "page.html").write_text(pages[name].replace("<title>", WATCH + "<title>", 1))
    line = [CHROMIUM, *FLAGS, f"--user-data-dir={tmp_path / 'profile'}", f"--window-size={size},900"]
    done = subprocess.run(
        [*line, (tmp_path / "page.html").as_uri()], capture_output=True, text=True, timeout=60, check=False
    )
    seen = re.search(r"<title>SEEN (.*?)</title>", done.stdout)
    assert seen is not None, done.stderr[-500:]
    told = json.loads(unescape(seen[1]))
    assert told["over"] <= 0
    assert told["wide"] == []
    assert told["faults"] == []
    assert told["cursor"] == "block"
    assert ":" in told["told"]


def test_plan_and_execute_write_a_page_and_learning_a_curve(tmp_path: Path) -> None:
    run = CliRunner().invoke
    page, curve = tmp_path / "page.html", tmp_path / "curve.svg"
    assert run(app, ["plan", "beverage-serving", "--report", str(page)]).exit_code == 0
    assert page.read_text().startswith("<!doctype html>")
    assert run(app, ["execute", "beverage-serving", "--report", str(page)]).exit_code == 0
    assert "✓ reached" in page.read_text()
    learn = ["learn", "beverage-serving", "--memory", str(tmp_path / "m.ttl")]
    assert run(app, [*learn, "--plot", str(curve), "--rounds", "2"]).exit_code == 0
    assert "</svg>" in curve.read_text()
    assert run(app, [*learn, "--plot", str(tmp_path / "curve.txt")]).exit_code != 0


def test_a_place_in_a_drawer_is_on_the_map_where_the_drawer_is() -> None:
    scene = confab.load("kitchen-corner")
    ground = ground_of(scene.problem, scene.embodiment)
    assert ground is not None
    for name, place in scene.embodiment.places.items():
        beside = min(
            abs(complex(*ground.spots[name]) - complex(*other)) for n, other in ground.spots.items() if n != name
        )
        assert beside > 0.05, (name, place)

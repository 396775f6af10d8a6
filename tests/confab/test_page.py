"""The page: one script displays one JSON object, in a file, from a server and in a notebook; a browser tests all of them."""

import json
import re
import sys
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rdflib
from click.testing import CliRunner

import confab
from confab.cli import app
from confab.memory import Memory
from confab.page.data import page_data
from confab.page.frozen import page_html, write_page
from confab.page.ground import ground_of
from confab.page.markup import script
from confab.page.notebook import SHOWN
from confab.page.schema import PageData
from confab.page.sheet import Sheet, Turned, ready_queries, turned_from
from confab.page.timeline import of_episode, of_plan, of_rollout
from confab.planner.plan import Plan
from confab.serving import Server, serving
from confab.sim.picture import view_of
from confab.sim.verdict import Verdict
from confab.sim.verify import Rollout, StepReport
from confab.table import Table
from worlds.browser import CHROMIUM, Browser

FIGURE_8 = ("after=28 cup2 LOCATION location8", "after=28 goal cup2 LOCATION location8")
needs_browser = pytest.mark.skipif(CHROMIUM is None, reason="needs chromium (Debian: apt install chromium)")
FACTS: Turned = {"facts": {"cup1 LOCATION": "location7"}}


@cache
def shipped(name: str = "beverage-serving") -> confab.Scene:
    return confab.load(name)


@pytest.fixture(scope="module")
def scene() -> confab.Scene:
    return shipped()


@pytest.fixture(scope="module")
def serving_plan(scene: confab.Scene) -> confab.Result:
    return scene.plan()


@pytest.fixture(scope="module")
def failed(serving_plan: confab.Result) -> confab.Report:
    """A run in which the cup was lost at the tenth primitive, as physics reports it."""
    steps = serving_plan.plan.primitives[:10]
    reports = [StepReport(step, Verdict(True, measured={"joint_lag_rad": 0.01}), 1.0) for step in steps]
    lost = Verdict(False, "slip or drop", ("cup2",), {"joint_lag_rad": 0.0863}, "it was lost </script><b>on the way")
    reports[-1] = StepReport(steps[-1], lost, 0.5)
    rollout = Rollout(0, False, tuple(reports), (), 2.0, 9.75, {})
    return confab.Report(serving_plan.plan, serving_plan.problem.goal, (rollout,), None, {}, serving_plan.scene)


@pytest.fixture(scope="module")
def pages(scene: confab.Scene, serving_plan: confab.Result, failed: confab.Report) -> dict[str, PageData]:
    memory = Memory.of(scene)
    memory.learn(scene, serving_plan.plan)
    made = {
        "plan": page_data(scene, serving_plan),
        "failed": page_data(scene, serving_plan, failed),
        "learned": page_data(scene, serving_plan, None, None, memory),
        "episode": page_data(scene, execution=scene.execute(interventions=FIGURE_8)),
        "none": page_data(scene, scene.plan(["cup1 LOCATION location7", "cup2 LOCATION location7"])),
    }
    result = shipped("house-small").plan()
    return {**made, "house-small": page_data(result.scene, result), "towers-small": page_data(shipped("towers-small"))}


# ------------------------------------------------------------------------------------------------------------ the data


def test_a_page_loads_nothing_and_its_text_is_data(pages: dict[str, PageData]) -> None:
    for name, data in pages.items():
        page = page_html(data, data["title"])
        assert not re.findall(r"""(?:src|href)="(?!data:)[^"]""", page.split("<script")[0]), name
        assert "@import" not in page, name
        assert page.count("</script>") == 2, name
        (content,) = re.findall(r'id="confab-data">(.*?)</script>', page, re.S)
        assert json.loads(content) == json.loads(json.dumps(data)), name


def test_the_page_shows_steps_in_labels_with_their_reasons_and_names(pages: dict[str, PageData]) -> None:
    first = pages["plan"]["steps"][0]
    assert (first["what"], first["number"], first["name"]) == ("move cup 1 to location 7", "L1#0", "B1_MOVE #22")
    assert first["needs"] == ["the goal requires that cup 1 is at location 7"]
    assert "left hand holds cup 1 (before: nothing)" in pages["plan"]["steps"][1]["gives"]


def test_the_page_of_a_failed_run_shows_the_failure_and_the_measurements(pages: dict[str, PageData]) -> None:
    data = pages["failed"]
    assert (data["good"], data["status"]) == (False, "failed in physics")
    assert data["alarm"]["measured"] == [("joint lag", "4.94°")]
    assert data["alarm"]["lines"][0].startswith("at 9.8 s")
    assert data["alarm"]["lines"][1].startswith("slip or drop")
    assert [bar["tone"] for row in data["rows"] if row["group"] == "actors" for bar in row["bars"]].count("failed") == 1


def test_the_page_of_every_kind_of_run_shows_its_result(pages: dict[str, PageData]) -> None:
    assert (pages["plan"]["good"], pages["plan"]["status"]) == (True, "a plan, checked")
    assert (pages["towers-small"]["good"], pages["towers-small"]["status"]) == (None, "not planned yet")
    assert (pages["episode"]["good"], pages["episode"]["status"]) == (True, "reached")
    told = [f"it {what} that cup 2 is at location 8" for what in ("happens", "is wanted")]
    assert [mark["text"] for mark in pages["episode"]["marks"]][:2] == told
    assert (pages["none"]["good"], pages["none"]["status"]) == (False, "unsolvable")
    assert any("An independent checker" in line for line in pages["none"]["alarm"]["lines"])
    assert pages["learned"]["learned"]["rules"]
    assert all(data["again"].startswith(("confab execute", "confab plan", "confab verify")) for data in pages.values())
    assert pages["failed"]["again"] == "confab verify beverage-serving PLAN.json"
    assert pages["none"]["again"] == "confab plan beverage-serving '--goal=cup2 LOCATION location7'"


def test_the_title_of_a_page_is_the_title_of_the_scene_s_ontology(
    scene: confab.Scene, pages: dict[str, PageData]
) -> None:
    assert pages["plan"]["title"] == scene.title == "Beverage serving"
    rdf = rdflib.Graph().parse(data="<https://x.org/kitchen> a <http://www.w3.org/2002/07/owl#Ontology> .")
    assert confab.load(rdf).title == "kitchen"
    rdf.add((rdflib.URIRef("https://x.org/kitchen"), rdflib.RDFS.label, rdflib.Literal("Our kitchen")))
    assert confab.load(rdf).title == "Our kitchen"


def test_each_colour_of_the_page_has_one_meaning(serving_plan: confab.Result, pages: dict[str, PageData]) -> None:
    problem, rows = serving_plan.problem, {row["label"]: row["bars"] for row in pages["plan"]["rows"]}
    assert [bar["tone"] for bar in rows["cup 1 is at"]] == ["start", "between", "wanted"]
    assert {bar["tone"] for bar in rows["left hand holds"]} == {"start", "between"}
    assert sum(row["group"] == "wanted" for row in pages["plan"]["rows"]) == 0
    assert sum("met" in row for row in pages["plan"]["rows"]) == len(problem.goal)


def test_the_map_has_furniture_connections_or_order(pages: dict[str, PageData], tmp_path: Path) -> None:
    house = pages["house-small"]["map"]
    assert "lines connect them" in house["note"]
    assert ("hall", "kitchen") in [tuple(way) for way in house["ways"]]
    assert "map" not in pages["towers-small"]
    assert pages["plan"]["map"]["areas"][0]["label"] == "table top"
    (cup,) = (thing for thing in pages["plan"]["map"]["things"] if thing["id"] == "cup1")
    assert [place for _, place, _, _ in cup["at"]] == ["location2", "", "location7"]
    made = confab.generate("served", tmp_path / "served.ttl", objects=6)
    assert "they stand in order" in page_data(made)["map"]["note"]


@pytest.mark.parametrize("name", ["beverage-serving", "two-tables", "kitchen-corner"])
def test_the_map_has_the_view_direction_of_the_film(name: str) -> None:
    scene = shipped(name)
    ground = ground_of(scene.problem, scene.embodiment)
    assert ground is not None
    camera = view_of(scene.embodiment)
    of = [
        (np.array(place.position), ground.spots[name])
        for name, place in scene.embodiment.places.items()
        if not place.carrier
    ]
    for (one, seen), (other, also) in pairwise(of):
        if abs(seen[0] - also[0]) > abs(seen[1] - also[1]):
            across = camera.pixel(other)[0] - camera.pixel(one)[0]
            assert (across > 0) == (also[0] > seen[0])


def test_a_place_in_a_drawer_is_on_the_map_where_the_drawer_is() -> None:
    scene = shipped("kitchen-corner")
    ground = ground_of(scene.problem, scene.embodiment)
    assert ground is not None
    spots = list(ground.spots.values())
    assert min(abs(complex(*a) - complex(*b)) for i, a in enumerate(spots) for b in spots[:i]) > 0.05


def test_a_scene_without_geometry_is_mapped_by_the_shapes_that_it_states() -> None:
    data = page_data(shipped("rooms-waste"))["map"]
    assert data["metric"]
    assert [area["label"] for area in data["areas"]] == ["closet", "dining", "kitchen", "office", "trash"]
    spots = {place["label"]: place["at"] for place in data["places"]}
    assert spots["desk desktop"] == (3.6, 2.3)  # the y axis of the page points down
    assert len(spots) == 20


def test_points_and_polygons_are_mapped_as_places_and_other_shapes_are_left_out() -> None:
    shapes = [("den", "POLYGON ((0 0, 4 0, 4 2, 0 2))"), ("hall", "LINESTRING (0 0, 1 1)"), ("door", "point(.5 1e0)")]
    ground = ground_of(shipped("rooms-waste").problem, None, shapes)
    assert ground is not None
    assert ground.spots == {"den": (2.0, -1.0), "door": (0.5, -1.0)}
    assert [area.name for area in ground.areas] == ["den"]


def test_the_periods_of_a_timeline_cover_its_time_without_gaps(
    serving_plan: confab.Result, failed: confab.Report
) -> None:
    problem, plan = serving_plan.problem, serving_plan.plan
    for timeline in (of_plan(problem, plan), of_rollout(problem, plan, failed.rollouts[0])):
        for periods in timeline.phases.values():
            assert (periods[0].begin, periods[-1].end) == (0, timeline.end)
            assert all(a.end == b.begin and a.value != b.value for a, b in pairwise(periods))
    assert timeline.failed is not None
    assert all(of_plan(problem, plan).met(symbol) for symbol in problem.goal)


@pytest.mark.parametrize("name", ["laboratory-small", "couriers-small"])
def test_a_schedule_has_a_lane_for_each_actor_with_slack(name: str) -> None:
    result = shipped(name).plan(minimise="makespan")
    data, timed = page_data(result.scene, result), result.timed
    assert timed is not None
    assert (data["unit"], data["tiles"][0]["text"]) == ("s", f"{float(timed.makespan):.3g} s")
    actors = [row for row in data["rows"] if row["group"] == "actors"]
    assert sum(len(row["bars"]) for row in actors) == sum(max(1, len(slot.actors)) for slot in timed.slots)
    slack = sorted(bar["slack"] for row in actors for bar in row["bars"] if "slack" in bar)
    assert slack == sorted(float(slot.slack) for slot in timed.slots for _ in slot.actors or ("",) if slot.slack)
    for row in data["rows"]:
        assert all(one["end"] <= other["begin"] + 1e-3 for one, other in pairwise(row["bars"])), row["label"]


def test_the_timeline_of_an_episode_ends_with_the_observed_values(scene: confab.Scene) -> None:
    episode = scene.execute(interventions=FIGURE_8).episode
    timeline = of_episode(scene.problem, episode)
    assert all(periods[-1].value == episode.observed[symbol] for symbol, periods in timeline.phases.items())


def test_an_empty_plan_has_a_page(serving_plan: confab.Result) -> None:
    nothing = replace(serving_plan, outcome=replace(serving_plan.outcome, plan=Plan(())))
    assert page_data(serving_plan.scene, nothing)["status"] == "nothing to do: all goals hold"


# ------------------------------------------------------------------------------------------------------ changed facts


def test_a_fact_changed_on_the_page_changes_the_plan(scene: confab.Scene) -> None:
    sheet = Sheet(scene)
    assert sheet.answer({})["headline"].startswith("solved: 4 / 10 / 32")
    answer = sheet.answer(FACTS)
    assert answer["headline"].startswith("solved: 3 / 8 / 26")
    assert (
        answer["again"] == "scene = confab.load('beverage-serving').with_fact('cup1 LOCATION location7')\nscene.plan()"
    )


def test_goals_are_changed_and_dropped_on_the_page_and_impossible_changes_get_a_reason(scene: confab.Scene) -> None:
    sheet = Sheet(scene)
    dropped: Turned = {"goals": {key: None for key, symbol in sheet.symbols.items() if symbol in sheet.problem.goal}}
    assert sheet.plan(dropped).plan.steps == ()
    assert sheet.answer({"goals": {"cup1 LOCATION": "location5"}})["headline"].startswith("unsolvable")
    assert "location5" in sheet.answer({"facts": {"cup1 LOCATION": "locaton5"}})["problem"]
    assert "there is no cup9" in sheet.answer({"facts": {"cup9 LOCATION": "location5"}})["problem"]


def test_shipped_queries_are_those_whose_vocabulary_the_scene_imports(scene: confab.Scene) -> None:
    there, elsewhere = ({one["name"] for one in ready_queries(s.knowledge)} for s in (scene, shipped("towers-small")))
    assert there - elsewhere >= {"where-is-everything", "what-can-be-poured"}
    assert "what-is-wanted" in there & elsewhere


def test_an_intervention_on_the_page_is_executed_and_an_impossible_one_is_reported(scene: confab.Scene) -> None:
    turned: Turned = {"interventions": [{"after": "28", "key": "cup2 LOCATION", "value": "location8", "what": "world"}]}
    assert "1 intervention, 1 change of plan" in Sheet(scene).answer(turned)["headline"]
    turned["interventions"][0]["value"] = "no_place"
    assert "no_place" in Sheet(scene).answer(turned)["problem"]


@pytest.mark.parametrize("name", ["house-small", "canal-small"])
def test_the_page_offers_changes_in_any_world(name: str) -> None:
    sheet = Sheet(shipped(name))
    turnable = sheet.turnable()
    for row in turnable["rows"]:
        values = [value for value, _ in turnable["values"][row["values"]]]
        assert row["now"] in values
        assert row["wanted"] is None or row["wanted"] in values
    assert sheet.answer({})["steps"]


@pytest.mark.parametrize(
    "data", [[], "x", {"facts": []}, {"facts": {"a": 1}}, {"goals": {"a": 1}}, {"interventions": [{}]}]
)
def test_invalid_changes_from_the_page_are_refused(data: object) -> None:
    with pytest.raises(confab.KnowledgeError):
        turned_from(data)


# ------------------------------------------------------------------------------------------------------------ notebooks


def test_notebooks_show_values_without_a_script(
    scene: confab.Scene, serving_plan: confab.Result, failed: confab.Report
) -> None:
    shown = [
        scene, serving_plan, failed, scene.execute(), Memory.of(scene), serving_plan.why(0),
        serving_plan.why_not("B1_MOVE cup2 location1"), serving_plan.explain(),
    ]  # fmt: skip
    for value in shown:
        html = value._repr_html_()  # type: ignore[attr-defined]
        assert html.startswith('<div class="confab">'), value
        assert "<script" not in html
    plan = serving_plan.plan
    values = [serving_plan.outcome, plan, plan.steps[0], failed.rollouts[0].steps[0].verdict]
    for (_, name), show in SHOWN.items():
        assert "confab" in show(next(value for value in values if type(value).__name__ == name))
    assert isinstance(Memory.of(scene).advice(), Table)


def test_the_message_without_anywidget_names_the_package_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "anywidget", None)
    with pytest.raises(confab.KnowledgeError, match=r"needs anywidget.*pip install anywidget"):
        shipped("two-cups").board()


@pytest.mark.skipif(find_spec("anywidget") is None, reason="needs anywidget (the extra notebook)")
def test_the_widget_answers_changes_and_queries_of_the_page(scene: confab.Scene) -> None:
    board: Any = scene.board()
    board.turned = FACTS
    assert board.data["headline"].startswith("solved: 3 / 8 / 26")
    assert board.result.plan.length == {1: 3, 2: 8, 3: 26}
    board.asked = {"of": 1, "query": "SELECT ?where WHERE { :cup1 k:location ?where }"}
    assert board.rows == {"of": 1, "columns": ["where"], "rows": [["location2"]]}
    board.asked = {"of": 2, "query": "SELEKT"}
    assert board.rows["problem"]


# ------------------------------------------------------------------------------------------------------------ in a browser


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with Browser() as one:
        yield one


@pytest.fixture(scope="module")
def served() -> Iterator[Server]:
    with serving(shipped(), 0) as server:
        yield server


SAID = "(document.querySelector('.clock output') || {}).textContent"
WIDE = """[...document.querySelectorAll("body *")].filter((e) => !e.closest(".scroll, .lanes, svg")
  && e.getBoundingClientRect().right > innerWidth + 1).map((e) => e.className || e.tagName)"""


@needs_browser
@pytest.mark.parametrize(("name", "width"), [("failed", 1280), ("failed", 420), ("house-small", 420), ("none", 420)])
def test_a_saved_page_is_shown_without_errors_at_any_width(
    browser: Browser, pages: dict[str, PageData], name: str, width: int, tmp_path: Path
) -> None:
    browser.open(write_page(tmp_path / "page.html", pages[name]).as_uri(), width, dark=width == 420)
    browser.wait("document.querySelector('h1') !== null")
    assert browser.run(WIDE) == []
    assert browser.run("document.documentElement.scrollWidth <= innerWidth")
    assert browser.faults == []
    if name == "failed":
        assert browser.run(SAID).startswith("9.3 s: move cup 2 to location 5")
        assert browser.run("document.querySelector('.plan .chosen .bad') !== null")


@needs_browser
def test_a_click_on_a_lane_moves_the_clock_the_map_and_the_plan(
    browser: Browser, pages: dict[str, PageData], tmp_path: Path
) -> None:
    browser.open(write_page(tmp_path / "page.html", pages["plan"]).as_uri())
    place = "document.querySelector('.map svg')?.getAttribute('aria-label')"
    assert "cup 1 is at location 2" in browser.wait(place)
    browser.click(".row.levels .bar[data-step='1']")
    assert browser.run(SAID).endswith("lift left hand from cup 2") or "move cup 2 to location 5" in browser.run(SAID)
    assert "cup 1 is at location 7" in browser.run(place)
    assert browser.run("document.querySelector('li.chosen').dataset.step") == "1"
    browser.run("document.querySelector('.lanes').focus()")
    before = browser.run("Number(document.querySelector('.clock input').value)")
    browser.call("Input.dispatchKeyEvent", type="keyDown", key="ArrowRight")
    assert browser.run("Number(document.querySelector('.clock input').value)") > before
    assert browser.faults == []


@needs_browser
def test_a_long_plan_is_folded_and_a_click_on_a_narrow_bar_shows_its_full_text(
    browser: Browser, tmp_path: Path
) -> None:
    scene = confab.generate("served", tmp_path / "served.ttl", objects=20)
    browser.open(write_page(tmp_path / "page.html", page_data(scene, scene.plan())).as_uri(), 420)
    browser.wait("document.querySelector('.plan') !== null")
    assert browser.run("document.querySelectorAll('.plan > li > details[open]').length") == 0
    assert browser.run("document.querySelectorAll('.goals tbody tr').length") == 9
    spots = "document.querySelectorAll('.map .spot').length"
    before = browser.run(spots)
    browser.click(".map button")
    assert browser.run(spots) > before
    browser.click(".row.changes .bar:not(.many)")
    assert " · cup 1 carries no beverage (0 to " in browser.run(SAID)
    assert browser.faults == []


@needs_browser
def test_facts_are_changed_and_queries_are_run_on_the_served_page(browser: Browser, served: Server) -> None:
    browser.open(served.url)
    lengths = "[...document.querySelectorAll('.tile')].map((e) => e.textContent).join(' ')"
    browser.wait(f"{lengths}.includes('4 / 10 / 32')")
    browser.choose("cup 1 is at: initial value", "location7")
    browser.wait(f"{lengths}.includes('3 / 8 / 26')")
    assert browser.run("document.querySelector('.changes del').textContent") == "move cup 1 to location 7"
    browser.choose("cup 1 is at: initial value", "location1")
    assert "the same LOCATION" in browser.wait("document.querySelector('.turning .bad')?.textContent")
    browser.type(".asking textarea", "SELECT ?where WHERE { :cup1 k:location ?where }")
    browser.click(".asking button")
    assert browser.wait("document.querySelector('.answer td')?.textContent") == "location2"
    browser.choose("ready queries", "1")
    browser.wait("document.querySelector('.answer td')?.textContent === 'bottle1'")
    assert browser.faults == []


@needs_browser
def test_the_page_follows_a_robot_that_acts(browser: Browser) -> None:
    scene = shipped()
    with serving(scene, 0) as server:
        said: list[str] = []

        def look(moment: Any) -> None:
            server.service.take(moment)
            if moment.what == "begin" and moment.seconds == 3:
                browser.open(server.url)
                said.append(browser.wait(SAID))
            if moment.what == "begin" and moment.seconds == 20:
                said.append(browser.wait(f"{SAID}.startsWith('20 steps') && {SAID}"))

        assert scene.execute(observer=look).reached
    # even after the server has ended
    browser.wait("document.querySelector('.tile')?.textContent.includes('✓ reached')")
    assert [words.split(":")[0] for words in said] == ["3 steps", "20 steps"]
    assert browser.faults == []


NOTEBOOK = """<!doctype html><meta charset="utf-8"><div id="el"></div><script type="module">
%s
const told = {}, model = { data: %s, rows: {}, get: (name) => model[name], set: (name, value) => { model[name] = value; },
  on: (what, f) => { (told[what] = told[what] || new Set()).add(f); }, off: (what, f) => { told[what]?.delete(f); },
  save_changes: () => { model.saved = (model.saved || 0) + 1; },
  give: (name, value) => { model[name] = value; for (const f of [...(told[`change:${name}`] || [])]) f(); } };
window.model = model;
window.leave = board.render({ model, el: document.getElementById("el") });
</script>"""


@needs_browser
def test_the_page_in_a_notebook_sends_queries_to_the_kernel(
    browser: Browser, scene: confab.Scene, tmp_path: Path
) -> None:
    sheet = Sheet(scene)
    data = json.dumps({**sheet.scene_data, **sheet.answer({})}).replace("<", "\\u003c")
    (tmp_path / "cell.html").write_text(NOTEBOOK % (script().replace("export default", "const board ="), data))
    browser.open((tmp_path / "cell.html").as_uri())
    browser.wait("window.leave !== undefined")
    browser.choose("cup 1 is at: initial value", "location7")
    assert browser.run("model.turned.facts") == FACTS["facts"]
    answer = json.dumps({**sheet.scene_data, **sheet.answer(FACTS)})
    browser.run(f"model.give('data', {answer})")
    browser.wait("document.querySelector('.changes del')?.textContent === 'move cup 1 to location 7'")
    browser.type(".asking textarea", "ASK {}")
    browser.click(".asking button")
    assert browser.run("model.asked") == {"of": 1, "query": "ASK {}"}
    browser.run("model.give('rows', { of: 1, columns: ['answer'], rows: [['true']] })")
    browser.wait("document.querySelector('.answer td')?.textContent === 'true'")
    browser.run("leave()")
    assert browser.faults == []


MEETING = """(() => { const words = [...document.querySelectorAll('.map text:not(.key)')];
  const boxes = words.map((e) => [e.getBoundingClientRect(), e.textContent]);
  return boxes.flatMap(([a, one], i) => boxes.slice(0, i).filter(([b]) => a.left < b.right - 1 && b.left < a.right - 1
    && a.top + 2 < b.bottom - 2 && b.top + 2 < a.bottom - 2).map(([, other]) => `${one} on ${other}`)); })()"""


@needs_browser
@pytest.mark.parametrize("name", ["beverage-serving", "cereal-serving", "kitchen-corner", "house-small", "two-tables"])
def test_labels_on_a_map_do_not_overlap_and_none_is_missing(browser: Browser, name: str, tmp_path: Path) -> None:
    data = page_data(shipped(name))
    address = write_page(tmp_path / "page.html", data).as_uri()
    for width in (1280, 420):
        browser.open(address, width)
        browser.wait("document.querySelector('.map text') !== null")
        assert browser.run(MEETING) == []
        shown = browser.run("document.querySelector('.map').textContent")
        assert [place["label"] for place in data["map"]["places"] if place["label"] not in shown] == []


# ------------------------------------------------------------------------------------------------------------ commands


def test_a_result_and_an_execution_write_their_page(
    scene: confab.Scene, serving_plan: confab.Result, tmp_path: Path
) -> None:
    assert serving_plan.report(tmp_path / "plan.html").read_text().startswith("<!doctype html>")
    assert scene.execute().report(tmp_path / "run.html").read_text().rstrip().endswith("</html>")


def test_plan_and_execute_write_a_page_and_learning_a_curve(tmp_path: Path) -> None:
    run = CliRunner().invoke
    page, curve = tmp_path / "page.html", tmp_path / "curve.svg"
    assert run(app, ["plan", "beverage-serving", "--report", str(page)]).exit_code == 0
    assert page.read_text().startswith("<!doctype html>")
    assert run(app, ["execute", "beverage-serving", "--report", str(page)]).exit_code == 0
    assert '"status":"reached"' in page.read_text()
    learn = ["learn", "beverage-serving", "--memory", str(tmp_path / "m.ttl")]
    assert run(app, [*learn, "--plot", str(curve), "--rounds", "1"]).exit_code == 0
    assert "</svg>" in curve.read_text()
    assert run(app, [*learn, "--plot", str(tmp_path / "curve.txt")]).exit_code != 0

"""The board: facts, goals and interventions are turned by hand, and the plan changes; without anywidget a sentence says so."""

import json
import re
import subprocess
import sys
from html import unescape
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

import confab
from confab.board import Sheet
from tests.confab.test_report import CHROMIUM, FLAGS

HERE = Path(confab.__file__).parent
FACTS: dict[str, Any] = {"facts": {"cup1 LOCATION": "location7"}}
PAGE = """<!doctype html><title>-</title><div id="el"></div><script type="module">
const faults = []; addEventListener("error", (e) => faults.push(e.message));
%s
const heard = {}, model = { rows: %s, answer: %s, get: (name) => model[name], on: (what, f) => { heard[what] = f; }, off: () => {},
  set: (name, value) => { model[name] = value; }, save_changes: () => { model.saved = (model.saved || 0) + 1; } };
const el = document.getElementById("el");
board.render({ model, el });
const turn = (label, value) => {
  const select = el.querySelector(`[aria-label="${label}"]`);
  select.value = value; select.dispatchEvent(new Event("change"));
};
turn("cup 1 is at: is", "location7"); turn("cup 2 is at: shall be", "");
[...el.querySelectorAll("button")].find((b) => b.textContent === "add an intervention").click();
const turned = structuredClone(model.turned);
model.answer = { ...model.answer, headline: "another", new: ["stir"] }; heard["change:answer"]();
document.title = "SEEN " + JSON.stringify({ turned, faults, saved: model.saved, headline: el.querySelector(".headline").textContent,
  now: el.querySelector("ins").textContent });
</script>"""


@pytest.fixture(scope="module")
def sheet() -> Sheet:
    return Sheet.of(confab.load("beverage-serving"))


def test_a_fact_that_is_turned_changes_the_plan_and_what_changed_is_told(sheet: Sheet) -> None:
    before = sheet.answer({})
    after = sheet.answer(FACTS, tuple(before["said"]))
    assert before["headline"].startswith("solved: 4 / 10 / 32")
    assert after["headline"].startswith("solved: 3 / 8 / 26")
    assert (after["gone"], after["new"]) == (["move cup 1 to location 7"], [])
    assert "it is wanted that" in after["html"]
    assert json.loads(json.dumps(after)) is not None


def test_a_goal_is_turned_and_dropped_and_what_cannot_be_says_why(sheet: Sheet) -> None:
    dropped = {"goals": {key: None for key, symbol in sheet.symbols.items() if symbol in sheet.problem.goal}}
    assert sheet.plan(dropped).plan.steps == ()
    clash = sheet.answer({"goals": {"cup1 LOCATION": "location5"}})
    assert clash["headline"].startswith("unsolvable")
    assert clash["steps"] == []


def test_who_interferes_is_heeded_and_a_sentence_says_what_cannot_be_done(sheet: Sheet) -> None:
    turned = {"after": "28", "key": "cup2 LOCATION", "value": "location8", "what": "world"}
    answer = sheet.answer({"interventions": [turned]})
    assert "1 intervention, 1 change of plan" in answer["headline"]
    wrong = sheet.answer({"interventions": [{**turned, "value": "no_place"}]}, ("a step",))
    assert "no_place" in wrong["headline"]
    assert wrong["said"] == ["a step"]


@pytest.mark.parametrize("name", ["towers-small", "house-small", "canal-small"])
def test_any_small_world_can_be_turned(name: str) -> None:
    sheet = Sheet.of(confab.load(name))
    for row in sheet.rows():
        values = [value for value, _ in row["values"]]
        assert row["is"] in values
        assert row["wanted"] is None or row["wanted"] in values
    assert sheet.answer({})["steps"]


def test_a_large_world_is_refused_in_words(tmp_path: Path) -> None:
    with pytest.raises(confab.KnowledgeError, match="a board has room for 80"):
        Sheet.of(confab.generate("served", tmp_path / "large.ttl", objects=50))


def test_without_anywidget_a_sentence_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "anywidget", None)
    with pytest.raises(confab.KnowledgeError, match=r"needs anywidget.*pip install 'confab-planner\[notebook\]'"):
        confab.load("two-cups").board()


@pytest.mark.skipif(find_spec("anywidget") is None, reason="needs anywidget (the extra notebook)")
def test_the_widget_answers_what_the_page_turns() -> None:
    board = confab.load("beverage-serving").board()
    board.turned = FACTS
    assert board.answer["headline"].startswith("solved: 3 / 8 / 26")
    assert board.result.plan.length == {1: 3, 2: 8, 3: 26}


@pytest.mark.skipif(CHROMIUM is None, reason="needs chromium (Debian: apt install chromium)")
def test_the_page_sends_what_is_turned_and_shows_what_comes_back(sheet: Sheet, tmp_path: Path) -> None:
    assert CHROMIUM is not None
    script = (HERE / "board.js").read_text().replace("export default", "const board =")
    page = PAGE % (script, json.dumps(sheet.rows()), json.dumps(sheet.answer({})).replace("</", "<\\/"))
    (tmp_path / "page.html").write_text(page)
    line = [CHROMIUM, *FLAGS, f"--user-data-dir={tmp_path / 'profile'}", (tmp_path / "page.html").as_uri()]
    done = subprocess.run(line, capture_output=True, text=True, timeout=60, check=False)
    seen = re.search(r"<title>SEEN (.*?)</title>", done.stdout)
    assert seen is not None, done.stdout[-500:] + done.stderr[-500:]
    told = json.loads(unescape(seen[1]))
    assert told["turned"]["facts"] == {"cup1 LOCATION": "location7"}
    assert told["turned"]["goals"] == {"cup2 LOCATION": None}
    assert told["turned"]["interventions"][0]["after"] == "22"
    assert (told["saved"], told["faults"], told["headline"], told["now"]) == (3, [], "another", "stir")

"""A value at a wrong place of a command line: the command does what is meant, or the error gives the correct command line."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import confab
from confab.cli import main
from tests.ontology.faults import skeleton

SCENE = "beverage-serving-moved"
GOAL = "cup2 LOCATION location8"
QUERY = "SELECT ?o { ?o k:location ?l }"


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a file of each kind."""
    folder, scene = tmp_path_factory.mktemp("files"), confab.load(SCENE)
    result, memory = scene.plan(), confab.Memory.of(scene)
    memory.learn(scene, result.plan)
    result.save(folder / "plan.json")
    memory.save(folder / "memory.ttl")
    scene.execute(result).save(folder / "episode.json")
    scene.execute(result).save(folder / "episode.ttl")
    result.report(folder / "page.html")
    scene.export(folder / "pddl")
    scene.save(folder / "scene.ttl")
    return folder


@pytest.mark.parametrize(
    ("line", "right"),
    [
        (["verify", "plan.json", SCENE], f"plan.json is a plan; use: confab verify {SCENE} plan.json"),
        (["verify", "plan.json"], "use: confab verify SCENE plan.json"),
        (["execute", SCENE, "plan.json"], f"use: confab execute {SCENE} --plan plan.json"),
        (["explain", "plan.json"], "use: confab explain SCENE --plan plan.json"),
        (["explain", SCENE, "plan.json"], f"use: confab explain {SCENE} --plan plan.json"),
        (["explain", SCENE, GOAL], f"'{GOAL}' is a fact; use: confab explain {SCENE} --not '{GOAL}'"),
        (["plan", SCENE, GOAL], f"use: confab plan {SCENE} --goal '{GOAL}'"),
        (["plan", SCENE, "x" * 5000], "got unexpected extra argument"),
        (["plan", SCENE, *GOAL.split()], f"use: confab plan {SCENE} --goal '{GOAL}'"),
        (["plan", "--scene", SCENE], f"missing argument 'SCENE'; {SCENE} is a scene; use: confab plan {SCENE};"),
        (["plan", SCENE, "new.json"], f"use: confab plan {SCENE} -o new.json"),
        (["plan", "memory.ttl"], "memory.ttl is a memory; use: confab plan SCENE --memory memory.ttl"),
        (["plan", "plan.json"], "use: confab verify SCENE plan.json | confab execute SCENE --plan plan.json | "),
        (["plan", "pddl/domain.pddl"], "use: confab import pddl/domain.pddl OTHER.pddl -o SCENE.ttl"),
        (["plan", SCENE, "--memory", "plan.json"], "wanted a memory; plan.json is a plan; use: confab verify SCENE"),
        (
            ["learn", SCENE, "-o", "m.ttl", "--episode", "episode.ttl"],
            "wanted JSON: save it as FILE.json; episode.ttl is an",
        ),
        (["ask", SCENE], "no such command 'ask'; did you mean 'query'?"),
        (["plan", "pddl/domain.pddl", "pddl/problem.pddl"], "use: confab import pddl/domain.pddl pddl/problem.pddl -o"),
        (["run", SCENE, "memory.ttl"], f"use: confab run {SCENE} --memory memory.ttl"),
        (["run", "plan.json"], "plan.json is a plan; use: confab verify SCENE plan.json | "),
        (["validate", "plan.json"], "plan.json is a plan; use: confab verify SCENE plan.json | "),
        (["execute", SCENE, f"after=28 {GOAL}"], f"use: confab execute {SCENE} --intervene 'after=28 {GOAL}'"),
        (["report", "episode.json"], "use: confab report SCENE --episode episode.json -o FILE.html"),
        (["report", SCENE, "new.html"], f"use: confab report {SCENE} -o new.html"),
        (["report", "page.html", "-o", "new.html"], "page.html is a report; a browser shows it"),
        (["query", QUERY, SCENE], f"use: confab query {SCENE} '{QUERY}'"),
        (["query", "where-is-everything"], "use: confab query SCENE where-is-everything"),
        (["query", SCENE, "SELECT", "?o", "{ ?o k:location ?l }"], f"use: confab query {SCENE} '{QUERY}'"),
        (["learn", SCENE, "memory.ttl"], f"use: confab learn {SCENE} --memory memory.ttl"),
        (
            ["learn", "episode.json", "-o", "memory.ttl"],
            "use: confab learn SCENE… --memory memory.ttl --episode episode",
        ),
        (["memory", "show", SCENE], f"{SCENE} is a scene; use: confab plan {SCENE} | "),
        (
            ["memory", SCENE],
            f"no such command 'memory {SCENE}'; wanted migrate, show, merge, trust; {SCENE} is a scene",
        ),
        (["memory", "learn", SCENE], "confab learn is a command"),
        (["memory", "merge", "memory.ttl", "both.ttl"], "use: confab memory merge memory.ttl -o both.ttl"),
        (["picture", SCENE, "new.png"], f"use: confab picture {SCENE} -o new.png"),
        (["generate", "served", "new.ttl"], "use: confab generate served -o new.ttl"),
        (["export", SCENE, "folder"], f"use: confab export {SCENE} -o folder"),
        (["export", "plan.json", "-o", "folder"], "use: confab export SCENE -o folder --plan plan.json"),
        (["new", "tearoom", "folder"], "use: confab new tearoom -o folder"),
        (["serve", SCENE, "8080"], f"use: confab serve {SCENE} --port 8080"),
        (["import", "scene.ttl", "-o", "new.ttl"], "scene.ttl is a scene; use: confab plan scene.ttl | "),
        ([SCENE], f"{SCENE} is a scene; use: confab plan {SCENE} | confab run {SCENE} | confab verify {SCENE}"),
        (["memory.ttl"], "memory.ttl is a memory; use: confab memory show memory.ttl | "),
        (["scenes", SCENE], f"use: confab plan {SCENE} | "),
        (["verify", SCENE, "missing.json"], "confab: missing.json: can't be read"),
    ],
    ids=lambda value: " ".join(value)[:60] if isinstance(value, list) else "",
)
def test_a_value_at_a_wrong_place_is_answered_by_the_correct_command_line(
    files: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], line: list[str], right: str
) -> None:
    monkeypatch.chdir(files)
    with pytest.raises(SystemExit, match="2"):
        main(line)
    assert right in capsys.readouterr().err


def test_a_memory_file_without_a_command_is_shown_and_learn_writes_its_output_as_a_memory(
    files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copy(files / "memory.ttl", "old.ttl")
    for line in (["memory", "old.ttl"], ["learn", "two-cups", "-o", "new.ttl"], ["memory", "show", "new.ttl"]):
        with pytest.raises(SystemExit, match="0"):
            main(line)
        assert "rules" in capsys.readouterr().out


def test_pddl_is_imported_in_either_order(files: Path, tmp_path: Path) -> None:
    for name, order in {"one": ("domain", "problem"), "other": ("problem", "domain")}.items():
        with pytest.raises(SystemExit, match="0"):
            main(
                [
                    "import",
                    *(str(files / "pddl" / f"{each}.pddl") for each in order),
                    "-o",
                    str(tmp_path / f"{name}.ttl"),
                ]
            )
    one, other = (confab.load(tmp_path / f"{name}.ttl") for name in ("one", "other"))
    assert one.facts == other.facts


def test_verify_without_a_plan_makes_a_plan_and_report_shows_a_given_plan(
    files: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit, match="0"):
        main(["verify", SCENE])
    assert "verified" in capsys.readouterr().out
    with pytest.raises(SystemExit, match="0"):
        main(["report", SCENE, "--plan", str(files / "plan.json"), "-o", str(tmp_path / "page.html")])
    assert "solved" in capsys.readouterr().out


def test_a_scene_in_the_place_of_a_memory_is_named_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    confab.load("two-cups").save("saved.ttl")
    for name in (skeleton(tmp_path).name, "saved.ttl"):
        with pytest.raises(SystemExit, match="2"):
            main(["memory", "show", name])
        wanted = f"confab: wanted a memory; {name} is a scene; use: confab plan {name} | "
        assert capsys.readouterr().err.startswith(wanted)

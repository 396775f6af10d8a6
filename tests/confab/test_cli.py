"""The command line for a new user: results on stdout, one clear line for each misuse, and one meaning for each exit code."""

import json
import os
import subprocess
import sys
from io import StringIO
from pathlib import Path

import pytest
from click.testing import CliRunner
from rich.console import Console

from confab import load
from confab.cli import app, main
from confab.commands.given import blame_reach
from confab.planner.plan import Outcome, Status
from confab.reasoner.limits import Deadline


def confab(*arguments: str, cwd: Path | None = None, **env: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", "from confab.start import main; main()", *arguments]
    return subprocess.run(
        command,
        capture_output=True,
        text=True,
        cwd=cwd,
        env={**os.environ, "COLUMNS": "200", **env},
        timeout=60,
        check=False,
    )


def test_plan_prints_the_tree_with_ids() -> None:
    done = confab("plan", "beverage-serving")
    assert done.returncode == 0
    assert "4 / 10 / 32 steps" in done.stdout
    assert "22 B1_MOVE cup1 location7" in done.stdout


def test_a_plan_is_printed_as_the_same_tree_in_a_pipe_and_in_a_terminal() -> None:
    result = load("beverage-serving").plan()
    plain, shown = StringIO(), StringIO()
    Console(file=plain, width=200).print(result)
    Console(file=shown, width=200, force_terminal=True, color_system=None).print(result)
    assert plain.getvalue().count("\n") == 47
    assert [line.rstrip() for line in plain.getvalue().splitlines()] == [
        line.rstrip() for line in shown.getvalue().splitlines()
    ]


def test_a_plan_is_printed_into_a_pipe_line_by_line() -> None:
    pieces = Console(file=StringIO(), width=200).render(load("beverage-serving").plan())
    assert max(piece.text.count("\n") for piece in pieces) == 1


def test_a_plan_command_adds_no_advice_on_reach_after_its_time_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = load("beverage-serving")
    monkeypatch.setattr("confab.reaching.unreached", lambda _: pytest.fail("reach is looked at after the limit"))
    blame_reach(scene, Outcome(Status.GAVE_UP, None), Deadline.after(0.0))


def test_plan_as_json_has_the_documented_keys() -> None:
    data = json.loads(confab("plan", "beverage-serving", "--json").stdout)
    assert data["status"] == "solved"
    assert data["length"] == {"1": 4, "2": 10, "3": 32}
    assert set(data["search"]["1"]) == {"generated", "evaluated", "expanded"}
    assert {"load", "quantify", "search"} <= set(data["seconds"])
    assert data["fallbacks"] == 0
    assert set(data["cache"]) == {"hits", "misses"}
    assert set(data["steps"][0]) >= {"path", "id", "level", "behavior", "arguments", "bindings", "steps"}
    assert data["steps"][0]["steps"][0]["steps"][1]["bindings"] == {"object": "cup1"}


def test_a_demonstration_in_the_order_of_the_figure_is_learned_from_the_command_line(tmp_path: Path) -> None:
    data = json.loads(confab("plan", "beverage-serving", "--json", "--mode", "paper").stdout)
    data["steps"].sort(key=lambda step: [22, 34, 28, 39].index(step["id"]))
    (tmp_path / "shown.json").write_text(json.dumps(data))
    learned = confab("learn", "beverage-serving", "--plan", "shown.json", "--memory", "memory.ttl", cwd=tmp_path)
    assert learned.returncode == 0, learned.stderr
    again = confab("plan", "beverage-serving", "--mode", "paper", "--memory", "memory.ttl", "--json", cwd=tmp_path)
    assert [step["id"] for step in json.loads(again.stdout)["steps"]] == [22, 34, 28, 39]


@pytest.mark.parametrize(
    ("arguments", "code", "word"),
    [
        (["plan", "no-such-scene"], 2, "no scene 'no-such-scene'"),
        (["plan", "beverage-serving", "--time-limit", "nan"], 2, "'nan' is no time limit"),
        (
            ["query", "beverage-serving", "where-is-everything", "--time-limit", "1e300"],
            2,
            "seconds up to 1,000,000,000",
        ),
        (["plan", "broken.ttl"], 2, "broken.ttl"),
        (["plan", "beverage-serving", "--goal", "cup9 LOCATION location8"], 2, "did you mean 'cup"),
        (["plan", "beverage-serving", "--goal", "bottle1 BEVERAGE no_beverage"], 1, "bottle1"),
        (["plan", "beverage-serving", "--goal", "cup1 LOCATION location4"], 1, "location4"),
        (["plan", "beverage-serving", "--mode", "magic"], 2, "unknown mode 'magic'"),
        (["plan", "beverage-serving", "--memory", "none.ttl"], 2, "no such memory file"),
        (["query", "beverage-serving", "SELEKT"], 2, "no shipped query 'SELEKT'"),
        (["query", "beverage-serving", "--show", "B2_PIK"], 2, "did you mean 'B2_PICK'"),
        (["plan", "domains/tabletop.ttl"], 2, "no scene"),
        (["verify", "beverage-serving", "broken.ttl"], 2, "broken.ttl"),
        (["generate", "served", "-o", "scene"], 2, "ends in .ttl"),
        (["explain", "beverage-serving", "--memory", "none.ttl"], 2, "no such memory file"),
        (["learn", "beverage-serving", "--plan", "none.json", "--memory", "m.ttl"], 2, "none.json"),
        (["learn", "beverage-serving", "--plan", "broken.ttl", "--memory", "m.ttl"], 2, "not JSON"),
        (["query", "beverage-serving", "none.rq"], 2, "none.rq: no such file"),
        (["query", "beverage-serving", "."], 2, "is a folder"),
        (["query", "beverage-serving", "ASK {}", "--show", "B2_PICK"], 2, "QUERY and --show exclude each other"),
        (["query", "beverage-serving", "--applicable"], 2, "give --show BEHAVIOR"),
        (
            ["plan", "beverage-serving", "--goal", "cup1 LOCATION location7", "--goal", "cup1 LOCATION location8"],
            2,
            "two goals for <cup1, LOCATION>",
        ),
        (["memory", "show", "m.ttl", "--most", "-1"], 2, "--most"),
        (["generate", "served", "-o", "s.ttl", "--seed", "-1"], 2, "--seed"),
        (["generate", "served", "-o", "/"], 2, "wanted the name of a file"),
        (["learn", "beverage-serving", "--memory", "."], 2, ".: is a folder"),
        (["plan", "beverage-serving", "--from-observed", os.devnull], 2, "no such file of observed facts"),
        (["plan", "beverage-serving", "--wrong"], 2, "see confab plan --help"),
        (["plan"], 2, "missing argument 'SCENE'"),
        (["nonsense"], 2, "no such command 'nonsense'"),
        (["picture", "beverage-serving", "-o", "x.jpg"], 2, "wanted .png"),
        (["picture", "beverage-serving", "-o", "x.png", "--behavior", "B2_PIK"], 2, "did you mean 'B2_PICK'"),
        (["fetch", "file:///etc/hostname"], 2, "wanted the http or https address"),
    ],
)
def test_bad_input_gives_one_clear_line_and_writes_no_file(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    code: int,
    word: str,
) -> None:
    (tmp_path / "broken.ttl").write_text("@prefix : <x")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    with pytest.raises(SystemExit) as end:
        main(arguments)
    done = capsys.readouterr()
    said = done.err if code == 2 else done.out
    assert end.value.code == code, done.err
    assert word in said
    assert said.count("\n") == 1
    assert "Traceback" not in done.err
    assert [path.name for path in tmp_path.iterdir()] == ["broken.ttl"]


def test_a_query_gives_table_csv_and_json() -> None:
    text = "SELECT ?o ?l WHERE { ?o k:location ?l } ORDER BY ?o"
    assert "bottle1\tlocation4\n" in confab("query", "beverage-serving", text).stdout
    assert confab("query", "beverage-serving", text, "--format", "csv").stdout.startswith("o,l\nbottle1,location4\n")
    assert json.loads(confab("query", "beverage-serving", text, "--json").stdout)[0] == {
        "o": "bottle1",
        "l": "location4",
    }


def test_an_empty_answer_is_an_answer_and_an_unknown_term_is_named() -> None:
    asked = confab("query", "beverage-serving", "SELECT ?o WHERE { ?o k:locaton ?l }")
    assert (asked.returncode, asked.stdout) == (0, "o\n")
    assert "no term k:locaton (did you mean 'location'?)" in asked.stderr


def test_plan_needs_neither_rdflib_nor_physics_nor_reasoners() -> None:
    script = (
        "import sys; from confab.scene import load; load('beverage-serving').plan(); "
        "print(sorted({'rdflib','pybullet','owlready2','pyshacl','matplotlib','pandas','networkx'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.strip() == "[]"


def test_the_description_of_each_command_fits_into_its_line_of_the_help() -> None:
    done = confab("--help", COLUMNS="80")
    assert done.returncode == 0
    assert not [line for line in done.stdout.splitlines()[1:] if line.endswith("...")]


def test_a_long_run_without_a_terminal_prints_its_stages(tmp_path: Path) -> None:
    done = confab("run", "two-places", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.splitlines()[0] == "confab: validating"


def test_empty_fact_files_and_memories_are_reported(tmp_path: Path) -> None:
    (tmp_path / "empty.ttl").touch()
    done = confab("plan", "beverage-serving", "--memory", "empty.ttl", cwd=tmp_path)
    assert "holds no memory" in done.stderr
    done = confab("plan", "beverage-serving", "--from-observed", "empty.ttl", cwd=tmp_path)
    assert done.returncode == 2
    assert "holds no observed facts" in done.stderr


def test_a_command_that_a_message_gives_is_quoted_for_a_shell(tmp_path: Path) -> None:
    out = tmp_path / "a b.ttl"
    said = CliRunner().invoke(app, ["generate", "served", "-o", str(out)]).output
    assert said.rstrip().endswith(f"confab plan '{out}'")

"""The commands: examples that run, one meaning of -o, progress messages, and no messages with --quiet."""

import io
import os
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import click
import pytest
from click.testing import CliRunner

import confab
from confab import progress
from confab.authoring import new_domain
from confab.cli import app
from confab.examples import EXAMPLES

SLOW = (
    "world.yaml",
    "confab serve",
    "--episode",
    "--serve",
    "picture",
    "validate",
    "run beverage",
    "confab run",
    "verify",
    "--perturb",
    "fetch",
    "--watch",
    "import",
    "towers-large",
    "mine.ttl",
    "memory ",
)


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> CliRunner:
    monkeypatch.chdir(tmp_path)
    return CliRunner()


def commands(group: Any = app, before: str = "") -> dict[str, click.Command]:
    """Return the commands of a group and of its subgroups, by the full name of the command."""
    found: dict[str, click.Command] = {}
    context = click.Context(group)
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        within = commands(command, f"{name} ") if isinstance(command, click.Group) else {before + name: command}
        found |= within
    return found


def test_every_command_has_examples_in_its_help(run: CliRunner) -> None:
    assert set(EXAMPLES) == set(commands())
    for name, lines in EXAMPLES.items():
        told = run.invoke(app, [*name.split(), "--help"])
        assert all(line in told.stdout for line in lines), told.stdout


@pytest.mark.parametrize("line", [line for lines in EXAMPLES.values() for line in lines if line.startswith("confab")])
def test_every_example_in_the_help_is_a_valid_call(run: CliRunner, line: str) -> None:
    words = shlex.split(line)[1:]
    if words[0] == "mcp":
        pytest.importorskip("mcp")
    if any(word in line for word in SLOW):
        name = next(name for name in commands() if f"{line} ".startswith(f"confab {name} "))
        commands()[name].make_context("confab", words[len(name.split()) :])
    else:
        assert run.invoke(app, words).exit_code == 0, line


@pytest.mark.parametrize("option", ["-o", "--output"])
def test_the_output_option_has_the_same_meaning_in_all_commands(run: CliRunner, option: str) -> None:
    for name, command in commands().items():
        for parameter in command.params:
            if {"--out", "--folder", "--into", "--save", "-o", "--output"} & {*parameter.opts}:
                assert option in parameter.opts, name
    assert run.invoke(app, ["plan", "towers-small", option, "plan.json"]).exit_code == 0
    assert "L2_MOVE" in Path("plan.json").read_text()
    told = run.invoke(app, ["plan", "towers-small", option, "plan.txt"])
    assert "ends in .json" in str(told.exception)


def test_a_scene_without_bodies_is_run_without_physics(run: CliRunner) -> None:
    told = run.invoke(app, ["run", "towers-small", "-o", "out"])
    assert told.exit_code == 0, told.output
    assert sorted(path.name for path in Path("out").iterdir()) == ["plan.json", "report.html", "run.json"]
    assert "a plan, checked" in Path("out/report.html").read_text()
    assert list(Path().iterdir()) == [Path("out")]


def test_a_run_learns_only_into_the_named_memory_file(run: CliRunner) -> None:
    for times in (1, 2):
        assert run.invoke(app, ["run", "towers-small", "-o", "out", "--memory", "mine.ttl"]).exit_code == 0
        assert sum(confab.Memory.load("mine.ttl").experience.episodes.values()) == times
    assert not Path("out/memory.ttl").exists()


def test_planning_refers_in_one_line_to_errors_that_validation_finds(run: CliRunner, tmp_path: Path) -> None:
    new_domain("tearoom", tmp_path)
    file = tmp_path / "tearoom-scene.ttl"
    assert run.invoke(app, ["plan", str(file)]).stderr == ""
    domain = tmp_path / "tearoom.ttl"
    domain.write_text(domain.read_text() + "\n:plate_is_dirty rdfs:seeAlso :cleanlines .\n:cup9 a :Plaet .\n")
    told = run.invoke(app, ["plan", str(file)])
    assert told.stderr.count("\n") == 1, told.stderr
    assert f"'confab validate {file}' finds errors" in told.stderr
    assert "did you mean 'Plate'" in told.stderr
    assert run.invoke(app, ["plan", str(file), "--quiet"]).stderr == ""
    assert run.invoke(app, ["--quiet", "plan", str(file)]).stderr == ""
    assert run.invoke(app, ["plan", str(file)]).stderr != ""


def test_the_message_on_a_misspelt_scene_names_the_most_similar_scene(run: CliRunner) -> None:
    told = run.invoke(app, ["plan", "beverage-servin"])
    assert "did you mean 'beverage-serving'" in str(told.exception)


def test_the_message_on_a_folder_or_a_name_without_suffix_names_the_scene_file(run: CliRunner) -> None:
    new_domain("tearoom", Path("tearoom"))
    for given in ("tearoom", "tearoom/tearoom-scene"):
        assert "did you mean 'tearoom/tearoom-scene.ttl'?" in str(run.invoke(app, ["plan", given]).exception)


def test_the_tab_key_completes_scenes_and_files(tmp_path: Path) -> None:
    (tmp_path / "beverages.ttl").touch()
    environment = {
        **os.environ,
        "_CONFAB_COMPLETE": "bash_complete",
        "COMP_WORDS": "confab plan bev",
        "COMP_CWORD": "2",
    }
    command = [sys.executable, "-c", "from confab.cli import main; main()"]
    done = subprocess.run(
        command, env=environment, cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False
    )
    completed = [line.split(",", 1)[1] for line in done.stdout.split()]
    assert completed == ["beverage-serving-moved", "beverage-serving", "beverages.ttl"]


def test_output_with_no_color_has_no_colours() -> None:
    command = [sys.executable, "-c", "from confab.cli import main; main()", "plan", "towers-small"]
    texts = [
        subprocess.run(
            command, env={**os.environ, "FORCE_COLOR": "1", **more}, capture_output=True, timeout=60, check=True
        )
        for more in ({}, {"NO_COLOR": "1"})
    ]
    assert b"\x1b[36m" in texts[0].stdout.replace(b"[1;36m", b"[36m")
    assert b"36m" not in texts[1].stdout


def test_a_long_command_shows_its_remaining_time(monkeypatch: pytest.MonkeyPatch) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    monkeypatch.setattr(progress, "PATIENCE", 0.0)
    terminal, pipe = Terminal(), io.StringIO()
    monkeypatch.setattr(sys, "stderr", terminal)
    with progress.progress("learning", 3) as advance:
        advance("learning towers", 1)
        time.sleep(0.2)
    shown = terminal.getvalue()
    assert "learning towers" in shown
    assert "1/3" in shown
    assert "left:" in shown
    monkeypatch.setattr(sys, "stderr", pipe)
    with progress.progress("learning", 3) as advance:
        advance("learning towers", 1)
    assert pipe.getvalue() == ""


def test_validation_with_watch_runs_again_after_each_edit(tmp_path: Path) -> None:
    new_domain("tearoom", tmp_path)
    domain, scene = tmp_path / "tearoom.ttl", tmp_path / "tearoom-scene.ttl"
    command = [sys.executable, "-c", "from confab.cli import main; main()", "validate", str(scene), "--watch"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as watching:
        assert watching.stdout is not None
        assert watching.stdout.readline() == "nothing is wrong\n"
        time.sleep(0.5)
        text = domain.read_text()
        domain.write_text(text + "\n:cup9 a :Plaet .\n")
        assert "did you mean 'Plate'" in watching.stdout.readline()
        time.sleep(0.5)
        domain.write_text(text)
        assert "nothing is wrong\n" in iter(watching.stdout.readline, "")
        watching.send_signal(signal.SIGINT)
        assert watching.wait(10) == 130

"""The command line in pipes: stdin and stdout, tables with tabs, saved runs, and refusals before any work begins."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from time import sleep

import pytest
from click.testing import CliRunner

import confab
from confab import ontology
from confab.cli import app
from confab.history import compared, new_folder, record, runs
from confab.page.data import page_data
from confab.plan_call import Found, PlanningTask, plan_task
from confab.sim.rollouts import Trial
from confab.sim.verify import Rollout

RUN = [sys.executable, "-c", "from confab.start import main; main()"]
WITHOUT = [sys.executable, "-c", "import sys; sys.modules['pybullet'] = None\nfrom confab.start import main; main()"]
TOWERS = (ontology.ROOT / "scenes" / "towers-small.ttl").read_bytes()


def piped(*arguments: str, given: bytes = b"", line: list[str] = RUN, at: Path | None = None) -> tuple[int, str, str]:
    """Return exit code, stdout and stderr of a command that reads its input from stdin."""
    done = subprocess.run([*line, *arguments], input=given, capture_output=True, cwd=at, check=False)
    return done.returncode, done.stdout.decode(), done.stderr.decode()


def test_a_scene_a_plan_and_a_query_come_from_stdin_and_results_go_to_stdout() -> None:
    code, plan, said = piped("plan", "-", "-o", "-", given=TOWERS)
    assert (code, json.loads(plan)["status"]) == (0, "solved")
    assert said.startswith("confab: solved")
    code, done, _ = piped("execute", "towers-small", "--plan", "-", "--json", given=plan.encode())
    assert (code, json.loads(done)["status"]) == (0, "reached")
    code, rows, _ = piped("query", "beverage-serving", "-", given=b"SELECT ?w WHERE { :cup1 k:location ?w }")
    assert (code, rows) == (0, "w\nlocation2\n")


def test_a_plan_is_printed_to_a_pipe_without_the_library_that_draws_in_terminals() -> None:
    undrawn = [*RUN[:2], f"import sys; sys.modules['rich'] = None\n{RUN[2]}"]
    code, plan, _ = piped("plan", "towers-small", line=undrawn)
    assert code == 0
    assert plan.splitlines()[1:] == piped("plan", "towers-small")[1].splitlines()[1:]
    assert plan.splitlines()[1].startswith("└── ")


def test_stdin_is_read_once_and_pictures_do_not_go_to_stdout() -> None:
    code, _, said = piped("execute", "-", "--plan", "-", given=TOWERS)
    assert code == 2
    assert "SCENE and --plan are both '-'" in said
    code, _, said = piped("picture", "two-cups", "-o", "-")
    assert code == 2
    assert "a picture can't be written to stdout" in said


def test_an_invalid_scene_on_stdin_is_refused_in_one_line() -> None:
    for given in (b"", b"\xff\xfe", b"{", b"<rdf:RDF", b"no turtle"):
        code, _, said = piped("plan", "-", given=given)
        assert (code, said.count("\n")) == (2, 1), said
        assert "/tmp" not in said


def test_a_scene_on_stdin_that_imports_a_file_is_refused_with_the_reason() -> None:
    given = TOWERS.replace(b"owl:imports ", b"owl:imports <https://example.org/mine>, ", 1)
    code, _, said = piped("plan", "-", given=given)
    assert (code, said.count("\n"), "/tmp" in said) == (2, 1, False), said
    assert "can import only shipped ontologies" in said


def test_verbose_prints_the_times_of_stages() -> None:
    _, _, said = piped("plan", "towers-small", "-v")
    assert "planning took" in said


def test_run_without_pybullet_names_the_missing_parts_first_and_writes_the_others(tmp_path: Path) -> None:
    code, out, said = piped("run", "two-cups", "-o", "out", line=WITHOUT, at=tmp_path)
    assert code == 2
    assert said.index("won't be verified, filmed or learned from") < said.index("planning")
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["plan.json", "report.html", "run.json"]
    assert "plan      out/plan.json" in out


def test_goals_of_a_run_are_kept_in_its_record(tmp_path: Path) -> None:
    goal = "c ON spot2"
    ran = CliRunner().invoke(app, ["run", "towers-small", "--goal", goal, "-o", str(tmp_path), "--seed", "1"])
    assert ran.exit_code == 0, ran.output
    (run,) = runs(tmp_path)
    assert (run.how["goals"], run.how["seed"]) == ([goal], 1)
    assert any("spot 2" in step["label"] for step in run.page["goals"])


def test_noise_reaches_physics(monkeypatch: pytest.MonkeyPatch) -> None:
    seen = []

    def run(trial: Trial, *arguments: object, **options: object) -> Rollout:
        seen.append(trial.noise)
        return Rollout(0, True, (), (), 0.0, 0.0)

    monkeypatch.setattr(Trial, "run", run)
    scene = confab.load("two-cups")
    scene.verify(scene.plan(), noise=0.002)
    assert seen == [0.002]


def test_noise_is_refused_in_a_world_without_measurements() -> None:
    with pytest.raises(confab.KnowledgeError, match="only in the world pybullet"):
        confab.load("towers-small").execute(noise=0.001)


def test_a_comparison_of_runs_has_costs_and_soft_goals(tmp_path: Path) -> None:
    scene = confab.load("wishes-small")
    for goals in ((), ("store STOCK 0",)):
        record(new_folder(tmp_path), page_data(scene, scene.plan(goals)), {"goals": goals}, "")
    found = {row[0]: row[1:] for row in compared(runs(tmp_path), "001", "002")}
    assert found["soft goals"] == ("1 of 2 met, unmet weight 8", "1 of 1 met")
    assert float(str(found["cost"][0])) < float(str(found["cost"][1]))


def test_runs_that_are_kept_are_listed_compared_and_shown(tmp_path: Path) -> None:
    invoke = CliRunner().invoke
    for mode in ("guarded", "paper"):
        made = ["run", "towers-small", "-o", str(tmp_path / "runs"), "--keep", "--mode", mode, "-q"]
        assert invoke(app, made).exit_code == 0
    listed = invoke(app, ["runs", str(tmp_path / "runs")]).output.splitlines()
    assert listed[0].split("\t")[:4] == ["run", "scene", "when", "verdict"]
    assert [line.split("\t")[0] for line in listed[1:]] == ["001", "002"]
    found = {row[0]: row[1:] for row in compared(runs(tmp_path / "runs"), "001", "002")}
    assert found["mode"] == ("guarded", "paper")
    assert "primitives" in found
    page = tmp_path / "history.html"
    assert invoke(app, ["runs", str(tmp_path / "runs"), "-o", str(page)]).exit_code == 0
    assert '"runs":[' in page.read_text()
    wrong = invoke(app, ["runs", str(tmp_path / "runs"), "001", "02"])
    assert "did you mean '002'?" in str(wrong.exception)
    (tmp_path / "runs" / "001" / "run.json").write_text('{"run": 1}')
    assert "is no record of a run" in str(invoke(app, ["runs", str(tmp_path / "runs")]).exception)


def test_each_kept_run_has_a_folder_of_its_own(tmp_path: Path) -> None:
    (tmp_path / "007").mkdir()
    assert [new_folder(tmp_path).name for _ in range(2)] == ["008", "009"]


def test_the_message_on_a_misspelt_engine_names_no_package_with_the_typo() -> None:
    with pytest.raises(confab.KnowledgeError) as told:
        confab.load("towers-small").plan(engine="fast-downwrad")
    assert "up-fast-downwrad" not in str(told.value)
    assert "fast-downward" in str(told.value)


def test_the_proved_bound_of_a_plan_is_reported_in_plain_words() -> None:
    assert "proved shortest on the lowest level" in repr(confab.load("two-cups").plan(optimal=True))
    said = repr(confab.load("beverage-serving").plan(optimal=True, time_limit=1))
    assert "not proved shortest: any plan for these goals has at least" in said


def test_a_plan_whose_steps_undo_each_other_is_reported_with_the_option_for_a_shorter_one() -> None:
    said = confab.load("three-cups").plan(leave_levels=False).dearer()
    assert said.startswith("12 of the 30 primitives only undo each other")
    assert "--optimal" in said
    assert confab.load("beverage-serving").plan().dearer() == ""


def test_a_remark_on_cheaper_plans_names_only_options_that_were_not_given() -> None:
    result = confab.load("three-cups").plan(leave_levels=False)
    assert "--optimal or --time-limit" in result.dearer()
    said = replace(result, options=replace(result.options, time_limit=5.0)).dearer()
    assert "--optimal" in said and "time" not in said


def test_the_printed_time_of_planning_includes_certificates_and_schedules(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = confab.load("beverage-serving")

    def slow(task: PlanningTask) -> Found:
        found = plan_task(task)
        sleep(0.2)
        return found

    monkeypatch.setattr("confab.planning.plan_task", slow)
    result = scene.plan()
    assert result.outcome.seconds >= 0.2
    assert f"{result.outcome.seconds * 1000:.0f} ms of planning" in repr(result)


def test_a_closed_output_pipe_has_another_exit_code_than_a_negative_answer() -> None:
    """The exit code is 141, like that of a process whose output pipe was closed."""
    done = subprocess.Popen(
        [sys.executable, "-m", "confab", "query", "drums-large", "--affords", "all"], stdout=subprocess.PIPE
    )
    assert done.stdout is not None
    done.stdout.close()
    assert done.wait(60) == 141


@pytest.mark.parametrize("command", ["plan", "explain"])
def test_a_plan_into_a_closed_pipe_has_another_exit_code_than_a_negative_answer(command: str) -> None:
    done = subprocess.Popen([*RUN, command, "towers-small"], stdout=subprocess.PIPE)
    assert done.stdout is not None
    done.stdout.close()
    assert done.wait(60) == 141


def test_output_is_utf_8_in_every_locale(tmp_path: Path) -> None:
    ascii_only = {
        **os.environ,
        "PYTHONIOENCODING": "ascii",
        "LC_ALL": "C",
        "PYTHONUTF8": "0",
        "PYTHONCOERCECLOCALE": "0",
    }
    for arguments, said in (
        (["query", "towers-small", 'SELECT ("ä☕" AS ?x) {}', "--json"], "ä☕"),
        (["plan", "towers-small"], "solved"),
        (["plan", "beverage-serving"], "└──"),
    ):
        done = subprocess.run([*RUN, *arguments], env=ascii_only, capture_output=True, check=False)
        assert (done.returncode, said in done.stdout.decode("utf-8")) == (0, True), done.stderr


def test_a_file_name_that_is_not_utf_8_is_printed_as_its_bytes(tmp_path: Path) -> None:
    name = os.fsencode(tmp_path) + b"/caf\xe9.json"
    done = subprocess.run(
        [*map(os.fsencode, RUN), b"plan", b"towers-small", b"-o", name], capture_output=True, check=False
    )
    assert (done.returncode, done.stdout.split(b":")[0]) == (0, name)


@pytest.mark.parametrize("query", [b"ASK {} \xff", b"", b" \n"])
def test_a_query_on_stdin_that_is_empty_or_not_utf_8_is_refused_in_one_line(query: bytes) -> None:
    code, _, said = piped("query", "towers-small", "-", given=query)
    assert (code, said.count("\n")) == (2, 1), said

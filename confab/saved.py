"""Reading of episodes and verdicts from JSON files (docs/execution.md, docs/command-line.md)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from confab.interchange import read_json, step_from
from confab.intervening import parse_intervention
from confab.known import Known
from confab.planner.acting.discovery import Discovery
from confab.planner.acting.episode import (
    BeliefChange,
    End,
    Episode,
    ExecutedPrimitive,
    Failure,
    Intervention,
    InterventionKind,
    Replan,
    Surprise,
    situation,
)
from confab.planner.acting.symbolic_world import with_individual
from confab.planner.plan import Plan, Reason, SoftGoal, Step
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.problem import Problem
from confab.reasoner.reading.goals import parse_fact
from confab.reasoner.symbols import Fact, Symbol

if TYPE_CHECKING:
    from confab.execution import Execution
    from confab.physics import Report

Data: TypeAlias = Mapping[str, Any]


def read_episode(scene: Known, path: Path) -> Execution:
    """Return the execution that a JSON file describes.

    Parameters
    ----------
    scene : Scene
        The scene of the execution.
    path : Path
        The output of ``confab execute --json``, or a JSON file of `Execution.save`. The returned execution lacks the states
        before failures, and the static facts on which steps relied, since the file doesn't contain these data.

    Raises
    ------
    KnowledgeError
        The file contains no episode, contains an episode of another scene, or mentions terms that the scene doesn't have.
    """
    from confab.execution import Execution

    with _read(path, "an episode; wanted what 'confab execute SCENE --json' prints") as data:
        if data["scene"] != scene.iri:
            raise KnowledgeError(f"{path}: is an episode of {data['scene']}; load that scene")
        people, late, problem = _interventions(scene.problem, data)
        initial = {_symbol(one): str(one["value"]) for one in data["initial"]}
        course = tuple(BeliefChange(float(one["seconds"]), _symbol(one), one["value"]) for one in data["course"])
        symbols = {str(s): s for s in (*initial, *(seen.symbol for seen in course), *problem.goal)}
        events = tuple(_event(one, symbols, path, problem) for one in data["events"])
        done = {event.step.path: event.step for event in events}
        episode = Episode(
            data["scene"],
            End(data["status"]),
            tuple(Reason(one["text"], tuple(one["terms"])) for one in data["reasons"]),
            _plan(data["planned"], path, problem),
            _plan(data["steps"], path, problem),
            initial,
            situation(initial, course),
            dict(parse_fact(problem, goal) for goal in data["goal"]),
            events,
            people,
            tuple(_replan(one, path, problem) for one in data["replans"]),
            tuple(
                Failure(done[tuple(one["path"])], str(one["code"]), tuple(one["objects"]), str(one["message"]), {})
                for one in data["failures"]
            ),
            {str(name): float(value) for name, value in data["seconds"].items()},
            late,
            course,
            discovered=tuple(
                (Discovery(one["individual"], tuple(one["classes"]), text=one["text"]), float(one["seconds"]))
                for one in data.get("discovered", [])
            ),
            measured=data.get("measured") is True,
            soft_goals=tuple(
                SoftGoal(Fact(*parse_fact(problem, one["goal"])), Fraction(str(one["weight"])), one["met"] is True)
                for one in data.get("soft_goals", [])
            ),
        )
    return Execution(scene, episode)


def read_report(scene: Known, verdicts: Path, plan: Plan) -> Report:
    """Return the report of a verification that a JSON file describes.

    Parameters
    ----------
    scene : Scene
    verdicts : Path
        The output of ``confab verify --json``, or the file ``verify.json`` of ``confab run``.
    plan : Plan
        The verified plan.

    Raises
    ------
    KnowledgeError
        The file contains no verdicts, or verdicts on another plan.
    """
    from confab.physics import Report
    from confab.sim.verdict import Verdict
    from confab.sim.verify import Rollout, StepReport

    steps = {step.path: step for step in plan.primitives}

    def step_of(one: Data) -> Step:
        step = steps.get(tuple(one["path"]))
        if step is None or step.id != one["id"]:
            where = ".".join(map(str, one["path"]))
            raise KnowledgeError(
                f"{verdicts}: step {where} with ID {one['id']} isn't in this plan; give the plan that was verified"
            )
        return step

    def report_of(one: Data) -> StepReport:
        verdict = Verdict(
            bool(one["ok"]), one["code"], tuple(one["objects"]), dict(one["measured"]), str(one["message"])
        )
        return StepReport(step_of(one), verdict, float(one.get("seconds", 0.0)))

    with _read(verdicts, "verdicts; wanted what 'confab verify SCENE PLAN --json' prints") as data:
        rollouts = tuple(
            Rollout(
                int(one["seed"]),
                bool(one["ok"]),
                tuple(map(report_of, one["steps"])),
                tuple(map(float, one["poured"])),
                float(one["cpu_seconds"]),
                float(one["simulated_seconds"]),
                dict(parse_fact(scene.problem, fact) for fact in one.get("seen", [])),
            )
            for one in data["rollouts"]
        )
        if not rollouts:
            raise ValueError("no rollouts")
        varied = bool(data.get("perturb", False)), float(data.get("noise", 0.0))
        return Report(plan, scene.problem.goal, rollouts, None, dict(data["trusted"]), scene, *varied)


@contextmanager
def _read(path: Path, wanted: str) -> Iterator[Data]:
    """Yield the JSON data in a file; an error of the ``with`` block about missing data becomes a `KnowledgeError`."""
    if path.suffix == ".ttl" and path.is_file():
        raise KnowledgeError(f"{path}: is Turtle, which with_episodes reads; wanted JSON: save it as FILE.json")
    data = read_json(path, wanted.partition(";")[0])
    try:
        yield data
    except KnowledgeError:
        raise
    except KeyError as error:
        raise KnowledgeError(f"{path}: isn't {wanted}; {error} is missing") from error
    except (TypeError, ValueError, AttributeError, IndexError) as error:
        raise KnowledgeError(f"{path}: isn't {wanted} ({error})") from error


def _interventions(
    problem: Problem, data: Data
) -> tuple[tuple[tuple[Intervention, float], ...], tuple[Intervention, ...], Problem]:
    """Return the interventions that took place, with times; the interventions that didn't take place; and the extended problem.

    The extended problem has the individuals that were discovered or added during the execution.
    """
    for one in data.get("discovered", []):
        for kind in one["classes"]:
            problem = with_individual(problem, one["individual"], kind)
    found: list[tuple[Intervention, float | None]] = []
    texts = [(one["text"], float(one["seconds"])) for one in data["interventions"]]
    for text, at in (*texts, *((text, None) for text in data["never_came"])):
        intervention = parse_intervention(problem, text)
        found.append((intervention, at))
        if intervention.change is InterventionKind.ADD:
            problem = with_individual(problem, intervention.individual, intervention.kind)
    came = tuple((one, at) for one, at in found if at is not None)
    return came, tuple(one for one, at in found if at is None), problem


def _symbol(one: Data) -> Symbol:
    return Symbol(str(one["situation"]), tuple(map(str, one["arguments"])))


def _plan(steps: Sequence[object], path: Path, problem: Problem) -> Plan:
    return Plan(tuple(step_from(one, (number,), path, problem) for number, one in enumerate(steps)))


def _event(one: Data, symbols: Mapping[str, Symbol], path: Path, problem: Problem) -> ExecutedPrimitive:
    step = step_from({**one, "bindings": {}, "steps": []}, tuple(one["path"]), path, problem)
    surprises = tuple(Surprise(symbols[s["symbol"]], s["expected"], s["observed"]) for s in one["surprises"])
    return ExecutedPrimitive(step, float(one["begin"]), float(one["end"]), bool(one["ok"]), one["code"], surprises)


def _replan(one: Data, path: Path, problem: Problem) -> Replan:
    steps = tuple(step_from(step, tuple(step["path"]), path, problem) for step in one["steps"])
    return Replan(
        tuple(one["after"]),
        str(one["kind"]),
        str(one["because"]),
        steps,
        float(one["cost"]),
        int(one["dropped"]),
        int(one["added"]),
        float(one["seconds"]),
    )

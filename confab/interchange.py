"""Plans and episodes as JSON, which the command line writes and reads (docs/command-line.md, docs/execution.md)."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from confab.formats import EpisodeJson, OutcomeJson, SeenJson, StepJson
from confab.planner.certificates import Certificate, certificate_from, certificate_json
from confab.planner.plan import Outcome, Plan, Status, Step
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.names import nearest
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import Behavior, Fact, Symbol

if TYPE_CHECKING:
    from confab.planner.acting.episode import Episode

DEEPEST = 50
"""Maximum depth of nested steps in a plan."""


def steps_json(steps: Iterable[Step]) -> list[StepJson]:
    """Return steps with their sub-steps as JSON data."""
    return [cast("StepJson", step.json()) for step in steps]


def outcome_json(scene: str, outcome: Outcome, seconds: Mapping[str, float]) -> OutcomeJson:
    """Return the outcome of a planning call as JSON data. The durations of the stages before the search are in `seconds`."""
    data: OutcomeJson = {
        "scene": scene,
        "status": outcome.status.value,
        "search": {
            str(level): {"generated": c.generated, "evaluated": c.evaluated, "expanded": c.expanded}
            for level, c in outcome.search.items()
        },
        "fallbacks": outcome.fallbacks,
        "given_up": list(outcome.given_up),
        "left": [
            {
                "level": left.level,
                "from": list(left.first),
                "to": list(left.last),
                "breaks": [{"step": list(broken.step), "text": broken.text} for broken in left.broken],
            }
            for left in outcome.left
        ],
        "cache": {"hits": outcome.hits, "misses": outcome.misses},
        "seconds": {**{k: round(v, 6) for k, v in seconds.items()}, "search": round(outcome.seconds, 6)},
    }
    if outcome.plan is not None:
        data["length"] = {str(level): count for level, count in outcome.plan.length.items()}
        data["steps"] = steps_json(outcome.plan.steps)
    if outcome.cost is not None:
        data["cost"] = outcome.cost
    if outcome.plan is not None and outcome.penalty is not None:
        data["penalty"] = float(outcome.penalty)
    if outcome.bound is not None:
        data["bound"] = outcome.bound
    if outcome.engine is not None:
        data["engine"] = outcome.engine
    if outcome.reason is not None:
        data["reason"] = {"text": outcome.reason.text, "terms": list(outcome.reason.terms)}
    if outcome.forgone:
        data["forgone"] = [
            {
                "goal": str(one.fact),
                "weight": float(one.weight),
                "price": None if one.price is None else float(one.price),
            }
            for one in outcome.forgone
        ]
    if outcome.certificate is not None:
        data["certificate"] = certificate_json(outcome.certificate)
    return data


def episode_json(episode: Episode) -> EpisodeJson:
    """Return an episode as JSON data (docs/execution.md)."""
    return {
        "scene": episode.scene,
        "status": episode.status.value,
        "reasons": [{"text": reason.text, "terms": list(reason.terms)} for reason in episode.reasons],
        "length": {str(level): count for level, count in episode.done.length.items()},
        "planned": steps_json(episode.planned.steps),
        "steps": steps_json(episode.done.steps),
        "events": [
            {
                "path": list(event.step.path),
                "id": event.step.id,
                "behavior": event.step.behavior,
                "arguments": list(event.step.arguments),
                "begin": round(event.begin, 4),
                "end": round(event.end, 4),
                "ok": event.ok,
                "code": event.code,
                "surprises": [
                    {"symbol": str(s.symbol), "expected": s.expected, "observed": s.observed} for s in event.surprises
                ],
            }
            for event in episode.events
        ],
        "interventions": [{"text": i.text, "seconds": round(at, 4)} for i, at in episode.interventions],
        "never_came": [i.text for i in episode.missed],
        "replans": [
            {
                "after": list(replan.after),
                "kind": replan.kind,
                "because": replan.because,
                "cost": replan.cost,
                "dropped": replan.dropped,
                "added": replan.added,
                "seconds": round(replan.seconds, 6),
                "steps": steps_json(replan.steps),
            }
            for replan in episode.replans
        ],
        "failures": [
            {
                "path": list(failure.step.path),
                "id": failure.step.id,
                "code": failure.code,
                "objects": list(failure.objects),
                "message": failure.message,
            }
            for failure in episode.failures
        ],
        "discovered": [
            {"individual": found.individual, "classes": list(found.kinds), "text": found.text, "seconds": round(at, 4)}
            for found, at in episode.discovered
        ],
        "goal": [str(Fact(symbol, value)) for symbol, value in sorted(episode.goal.items())],
        "initial": [_situated(symbol, value, 0.0) for symbol, value in sorted(episode.initial.items())],
        "course": [_situated(seen.symbol, seen.value, seen.seconds) for seen in episode.course],
        "seconds": {name: round(value, 6) for name, value in episode.seconds.items()},
        "measured": episode.measured,
    }


def _situated(symbol: Symbol, value: str | None, seconds: float) -> SeenJson:
    """Return the value of a symbol, and the time at which the symbol got this value, as JSON data."""
    return {
        "seconds": round(seconds, 4),
        "situation": symbol.situation,
        "arguments": list(symbol.arguments),
        "value": value,
    }


def read_plan(path: Path, problem: Problem) -> Plan:
    """Read a plan from a JSON file: the output of `confab plan --json`, or any object with ``steps`` of the same form.

    Raises
    ------
    KnowledgeError
        The file isn't the JSON of a plan, or a step mentions terms that the scene doesn't have. The message states the position.
    """
    data = read_json(path, "plan")
    status = data.get("status", Status.SOLVED.value) if isinstance(data, dict) else None
    if status is None or not isinstance(data.get("steps"), list):
        what = f"its status is '{status}'" if status not in (None, "solved", "reached") else "it has no 'steps'"
        raise KnowledgeError(
            f"{path}: holds no plan: {what}; wanted what 'confab plan --json' prints of a solved scene"
        )
    return Plan(tuple(step_from(step, (i,), path, problem) for i, step in enumerate(data["steps"])))


def read_certificate(path: Path) -> Certificate:
    """Read a certificate from a JSON file: the output of `confab plan --json` for an unsolvable task, or the certificate alone.

    Raises
    ------
    KnowledgeError
        The file isn't the JSON of a certificate. The message states the expected form.
    """
    data = read_json(path, "certificate")
    try:
        return certificate_from(data.get("certificate", data) if isinstance(data, dict) else data)
    except ValueError as error:
        raise KnowledgeError(f"{path}: {error}") from error


def read_json(path: Path, what: str) -> Any:
    """Return the content of a JSON file. In error messages, `what` names the expected content, such as a plan."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise KnowledgeError(f"{path}: can't be read: {error.strerror}") from error
    except RecursionError as error:
        raise KnowledgeError(f"{path}: no {what}: brackets are nested too deeply") from error
    except ValueError as error:  # invalid JSON, invalid UTF-8, or a number with thousands of digits
        raise KnowledgeError(f"{path}: not JSON: {error}") from error


def ground_named(problem: Problem, text: str) -> tuple[str, tuple[str, ...]]:
    """Return the quantified behaviour that a text like ``B2_PICK right_hand cup1`` denotes.

    Raises
    ------
    KnowledgeError
        The behaviour doesn't exist, or doesn't accept the given arguments.
    """
    name, *arguments = text.split() or [""]
    behavior = problem.domain.behaviors.get(name)
    if behavior is None:
        raise KnowledgeError(f"unknown behaviour '{name}'{nearest(name, problem.domain.behaviors)}")
    check_arguments(problem, behavior, tuple(arguments), f"'{text}'")
    return name, tuple(arguments)


def check_arguments(problem: Problem, behavior: Behavior, arguments: tuple[str, ...], where: str) -> None:
    """Raise `KnowledgeError` if a behaviour doesn't accept the arguments; the message begins with `where`."""
    if len(arguments) != len(behavior.parameters):
        raise KnowledgeError(
            f"{where}: {behavior.name} takes {len(behavior.parameters)} arguments, got {len(arguments)}"
        )
    for parameter, argument in zip(behavior.parameters, arguments, strict=True):
        members = problem.classes.get(parameter.kind, ())
        if argument not in members:
            raise KnowledgeError(f"{where}: '{argument}' is no {parameter.kind}{nearest(argument, members)}")


def step_from(data: Any, position: tuple[int, ...], path: Path, problem: Problem) -> Step:
    """Return the step, with its sub-steps, that JSON data describe; `position` is the step's position in the plan's tree.

    Raises
    ------
    KnowledgeError
        The data don't describe a step, or mention terms that the scene doesn't have. The message states the position.
    """
    where = f"{path}: step {'.'.join(map(str, position))}"
    if not isinstance(data, dict) or not isinstance(data.get("behavior"), str):
        raise KnowledgeError(f"{where}: wanted an object with 'behavior' and 'arguments'")
    behavior = problem.domain.behaviors.get(data["behavior"])
    if behavior is None:
        hint = nearest(data["behavior"], problem.domain.behaviors)
        raise KnowledgeError(f"{where}: the scene has no behaviour '{data['behavior']}'{hint}")
    said, bound, below = data.get("arguments", []), data.get("bindings", {}), data.get("steps", [])
    number, rank, joined = data.get("id"), data.get("rank"), data.get("joined", [])
    lists = {"arguments": said, "steps": below, "joined": joined}
    for name, value, kind in (*((key, one, list) for key, one in lists.items()), ("bindings", bound, dict)):
        if not isinstance(value, kind):
            wanted = "an object" if kind is dict else "a list"
            raise KnowledgeError(f"{where}: '{name}' is {json.dumps(value)[:40]}; wanted {wanted}")
    if len(position) > DEEPEST:
        raise KnowledgeError(
            f"{where}: lies inside more than {DEEPEST} others; a plan has a step of each level at most"
        )
    arguments = tuple(map(str, said))
    check_arguments(problem, behavior, arguments, where)
    return Step(
        path=position,
        id=number if type(number) is int else problem.id_of(behavior.name, arguments),
        level=behavior.level,
        behavior=behavior.name,
        arguments=arguments,
        bindings={str(k): str(v) for k, v in bound.items()},
        rank=rank if isinstance(rank, float) and isfinite(rank) else None,
        steps=tuple(step_from(step, (*position, i), path, problem) for i, step in enumerate(below)),
        joined=tuple(step_from(other, position, path, problem) for other in joined),
    )

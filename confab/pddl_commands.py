"""Conversion of PDDL files to a scene, of a level of a scene to PDDL, and of PDDL plans to plans of a scene."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeAlias

from confab.planner.grounded.grounding import ground
from confab.planner.grounded.plan_windows import regrouped, without_superfluous_steps
from confab.planner.grounded.task import Task
from confab.planner.paper.transitions import Model, Values
from confab.planner.plan import Plan, Step, UngroundableError
from confab.planner.timed.activities import EventKind
from confab.planner.timed.call import Timed, in_time
from confab.planner.timed.pieces import default_actors
from confab.reasoner.files import check_replaceable, made_folder, write_whole
from confab.reasoner.graph.knowledge import KnowledgeError, load
from confab.reasoner.kinds import DOMAIN, IMPORTED, PROBLEM, stamped
from confab.reasoner.limits import OutOfTimeError
from confab.reasoner.pddl.exporting import Exported, PlanLine, plan_of, to_pddl
from confab.reasoner.pddl.importing import imported
from confab.reasoner.pddl.syntax import parse_files
from confab.reasoner.pddl.turtle import turtle
from confab.reasoner.pddl.words import PddlError
from confab.reasoner.problem import Problem
from confab.reasoner.reading.problem import read
from confab.reasoner.symbols import GroundBehavior
from confab.timing import has_times

Ground: TypeAlias = tuple[str, tuple[str, ...]]
"""The name of a behaviour, and its arguments."""


def import_pddl(domain: Path, problem: Path, out: Path, level: int = 1) -> Problem:
    """Write a PDDL domain and problem, in either order, as a scene in Turtle, with all behaviours on one level.

    Returns
    -------
    Problem
        The problem of the new scene.

    Raises
    ------
    KnowledgeError
        The PDDL can't be used, or the scene can't be written. The message states the file, the line and the column, if they are
        known.
    """
    if _states_problem(domain) and not _states_problem(problem):
        domain, problem = problem, domain
    try:
        pddl = parse_files(domain, problem)
        found = imported(pddl, out.stem, level)
    except PddlError as error:
        raise KnowledgeError(str(error)) from error
    except RecursionError as error:
        raise KnowledgeError(f"{domain}, {problem}: formulas are nested too deeply; nest them less deeply") from error
    title = f"{pddl.problem} ({pddl.domain})"
    text = turtle(found.problem, title, f"The PDDL problem {pddl.problem} of the domain {pddl.domain}.", found.said)
    try:
        _check_scene(text)
    except KnowledgeError as error:
        raise KnowledgeError(f"{domain}, {problem}: the scene of this problem can't be used: {error}") from error
    write_whole(out, stamped(IMPORTED, [text]))
    return found.problem


def _states_problem(file: Path) -> bool:
    """Return whether a file begins with the definition of a PDDL problem."""
    with suppress(OSError):
        return (
            re.match(r"(\s|;[^\n]*\n)*\(define\s*\(problem\s", file.read_text(errors="replace"), re.IGNORECASE)
            is not None
        )
    return False


def _check_scene(text: str) -> None:
    """Raise `KnowledgeError` if a text isn't a scene that planning can use."""
    with TemporaryDirectory() as folder:
        file = Path(folder) / "scene.ttl"
        file.write_text(text, encoding="utf-8")
        read(load(file))


def exported(problem: Problem, level: int | None) -> Exported:
    """Return a level of a problem in PDDL, by default the lowest level; the lowest level of a problem with times has times.

    Raises
    ------
    KnowledgeError
        The scene doesn't have the level, or has no level at all.
    """
    levels = problem.domain.levels
    if not levels:
        raise KnowledgeError(
            "the scene has no behaviours, so that there is no level to export; import a domain that has some"
        )
    if level is not None and level not in levels:
        files = "" if isinstance(level, int) else "; scene.export(FOLDER) writes files"
        raise KnowledgeError(f"no level {level}; this scene has {', '.join(map(str, levels))}{files}")
    timed = has_times(problem) and level in (None, levels[-1])
    return to_pddl(problem, level, default_actors(problem) if timed else None)


def omitted_times(problem: Problem, level: int | None) -> str:
    """Return which times an export lacks, as a sentence, or an empty text if it lacks none."""
    if not has_times(problem):
        return ""
    if level not in (None, problem.domain.levels[-1]):
        return "the PDDL of an upper level has no durations, deadlines or windows of availability"
    lacking = ["deadlines"] * bool(problem.times and problem.times.deadlines)
    events = problem.times.events if problem.times else {}
    actions = [one for one in problem.domain.at_level(problem.domain.levels[-1]) if one.name not in events]
    lacking += ["costs"] * any(one.price is not None or one.cost != 1 for one in actions)
    return f"the PDDL has no {' and no '.join(lacking)}; its metric is the time" if lacking else ""


def export_pddl(problem: Problem, level: int | None, folder: Path) -> tuple[Path, Path]:
    """Write a level of a problem, by default the lowest, as ``domain.pddl`` and ``problem.pddl`` into a folder.

    Raises
    ------
    KnowledgeError
        The scene doesn't have the level, has no level at all, or the folder can't be written.
    """
    found = exported(problem, level)
    paths = folder / "domain.pddl", folder / "problem.pddl"
    files = tuple(zip(paths, (DOMAIN, PROBLEM), (found.domain, found.problem), strict=True))
    made_folder(folder)
    for path, kind, _ in files:
        check_replaceable(path, kind)
    for path, kind, text in files:
        write_whole(path, stamped(kind, [text], ";"))
    return paths


def read_pddl_plan(
    problem: Problem, level: int | None, text: str, regroup: bool = False, shorten: bool = False
) -> Plan:
    """Return the plan that another planner found for an exported level.

    A planner without a hierarchy orders independent steps arbitrarily, so that one hand may wait at a place that the other hand
    needs. With `regroup`, each step is moved directly after the latest step on which it depends. With `shorten`, steps that the
    goal doesn't need are removed. The values of a behaviour's variables (such as the object that is grasped) follow from the
    state before the step. If a step is inapplicable, the variables of this step and of all later steps have no values, and
    validation reports a fault.

    Raises
    ------
    KnowledgeError
        A line of the text isn't an action of the exported level.
    """
    level = problem.domain.levels[-1] if level is None else level
    timed = has_times(problem) and level == problem.domain.levels[-1] and "[" in text
    export = to_pddl(problem, level, default_actors(problem) if timed else None)
    found = [(line.behavior, line.arguments) for line in _lines(export, text)]
    if regroup or shorten:
        found = _regrouped(problem, level, found, shorten)
    return Plan(_steps(problem, level, found))


def read_timed_plan(problem: Problem, exported: Exported, text: str, seconds: float | None = None) -> Timed:
    """Return the timed plan that another planner found for a lowest level that was exported with times.

    The begins and ends of the steps keep their order; their times are calculated anew. External events are added at their times.

    Parameters
    ----------
    problem : Problem
    exported : Exported
        The export of the problem with times.
    text : str
        A line ``begin: (action object …) [duration]`` for each step.
    seconds : float, optional
        Time limit of the schedule.

    Raises
    ------
    KnowledgeError
        A line isn't an action of the exported level, or has no begin or duration.
    """
    found = [(line.behavior, line.arguments, line.begin, line.duration) for line in _lines(exported, text)]
    if lacking := next((one for one in found if one[2] is None or one[3] is None), None):
        raise KnowledgeError(
            f"a step of {lacking[0]} has no begin or no duration; wanted 'begin: (action object …) [duration]'"
        )
    last = max(((begin or 0) + (lasts or 0) for _, _, begin, lasts in found), default=Fraction(0))
    events = problem.times.events.items() if problem.times else ()
    found += [(name, (), at, Fraction(0)) for name, at in events if at <= last]
    found.sort(key=lambda one: one[2] or 0)
    level = problem.domain.levels[-1]
    steps = _steps(problem, level, [(behavior, arguments) for behavior, arguments, _, _ in found])
    order = []  # of simultaneous ends, that of the step that began last comes first
    for number, (_, _, begin, lasts) in enumerate(found):
        assert begin is not None and lasts is not None
        order.append((begin, 1, Fraction(number), number, EventKind.BEGIN))
        order.append((begin + lasts, 2 if not lasts else 0, -begin, number, EventKind.END))
    its_events = [(number, kind) for *_, number, kind in sorted(order, key=lambda one: one[:4])]
    return in_time(problem, Plan(steps), seconds, events=its_events)


def _lines(exported: Exported, text: str) -> list[PlanLine]:
    try:
        return plan_of(exported, text)
    except ValueError as error:
        raise KnowledgeError(str(error)) from error


def _steps(problem: Problem, level: int, found: Sequence[Ground]) -> tuple[Step, ...]:
    """Return steps with the values of their variables, as long as the steps are applicable in sequence."""
    model = Model(problem)
    values: Values | None = model.values(problem.initial)
    steps = []
    for i, (behavior, arguments) in enumerate(found):
        number = problem.id_of(behavior, arguments)
        applied = model.apply(GroundBehavior(number, behavior, arguments), values) if values is not None else None
        steps.append(Step((i,), number, level, behavior, arguments, applied.bindings if applied else {}))
        values = applied.after if applied else None
    return tuple(steps)


def _regrouped(problem: Problem, level: int, plan: list[Ground], shorten: bool) -> list[Ground]:
    """Return the regrouped steps. If the level can't be grounded, for example because time is short, return the steps unchanged."""
    try:
        task = ground(problem, level)
    except (OutOfTimeError, UngroundableError):
        return plan
    if not isinstance(task, Task):
        return plan
    chosen = task.operators_of(plan)
    if chosen is None:
        return plan
    if shorten and task.carried_out(task.initial, chosen)[0] & task.goal == task.goal:
        chosen = without_superfluous_steps(task, chosen)
    return [task.describe(operator)[:2] for operator in regrouped(task, chosen)]

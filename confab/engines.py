"""Planning a level with an external planner through unified-planning: export, plan, read back, order.

The result is a plan like those of Confab's own search. Each step directly follows the steps on which it depends. A run of steps
with exactly the effect of a behaviour of a higher level becomes the refinement of that behaviour. Every plan of an engine must
be accepted by `confab.planner.validation`.
"""

from __future__ import annotations

import logging
import re
import warnings
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from pkgutil import iter_modules
from subprocess import DEVNULL, TimeoutExpired
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import TYPE_CHECKING, Any

from confab.planner.hierarchical.regrouping import under_the_levels_above
from confab.planner.levels import levels_left
from confab.planner.plan import Outcome, Plan, Reason, Status
from confab.planner.validation import validate
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.limits import Deadline, within
from confab.reasoner.names import nearest
from confab.reasoner.pddl.exporting import to_pddl
from confab.reasoner.symbols import Problem, Symbol
from confab.reasoner.workers import CPU_SECONDS, WorkerError, call, end, start

if TYPE_CHECKING:
    import unified_planning.model

log = logging.getLogger(__name__)
ENGINE_SECONDS = 60.0
"""Default limit of an engine in seconds."""
IMPORTING = 1.0
"""Seconds for importing unified-planning; with less time left, no engine is started."""
READING = 0.93
"""Share of the time after which an engine is stopped; the rest is for reading and checking its plan."""
WITHOUT_NUMBERS = {"up_fast_downward", "up_pyperplan", "up_symk", "up_test_cases"}
"""Packages of engines without support for numbers."""
WITH_DEFINITIONS = {"up_fast_downward"}
"""Packages of engines that support derived predicates; unified-planning itself doesn't read them."""
KNOWN = {
    "aries": "up-aries",
    "enhsp": "up-enhsp",
    "fast-downward": "up-fast-downward",
    "fmap": "up-fmap",
    "lpg": "up-lpg",
    "pyperplan": "up-pyperplan",
    "symk": "up-symk",
    "tamer": "up-tamer",
}
"""Packages that provide an engine, by the engine's name in unified-planning."""
Answer = tuple[str, str, list[str]]
"""The engine's name, its status in the terms of unified-planning, and the steps of its plan as ``action object …``."""


def plan_by_engine(
    problem: Problem, engine: str | None, level: int | None = None, seconds: float | None = None
) -> Outcome:
    """Plan one level of a problem, the lowest if none is given, with an engine of unified-planning.

    Parameters
    ----------
    problem : Problem
    engine : str, optional
        Its name in unified-planning, e.g. ``fast-downward``; if left out, any installed engine that supports the problem.
    level : int, optional
    seconds : float, optional
        Time limit of the whole call; `ENGINE_SECONDS` if left out. A plan that the engine writes within the limit counts.

    Raises
    ------
    KnowledgeError
        There is no such engine or level, or the engine doesn't support the definitions or amounts of the problem.
    """
    with within(ENGINE_SECONDS if seconds is None else seconds) as deadline:  # exporting and importing are slow, too
        return _planned(problem, engine, level, deadline)


def _planned(problem: Problem, engine: str | None, level: int | None, deadline: Deadline) -> Outcome:
    began = perf_counter()
    level = problem.domain.levels[-1] if level is None else level
    if level not in problem.domain.levels:
        raise KnowledgeError(f"no level {level}; this scene has {', '.join(map(str, problem.domain.levels))}")
    wanted = replace(problem, goal={**at_rest(problem, level), **problem.goal})
    exported = to_pddl(wanted, level)
    if deadline.left is not None and deadline.left < IMPORTING:
        return Outcome(Status.GAVE_UP, None, Reason("timeout"), seconds=perf_counter() - began)
    name, said, lines = answer(exported.domain, exported.problem, engine, deadline)

    def outcome(status: Status, plan: Plan | None = None, reason: str = "") -> Outcome:
        why = Reason(f"{name}: {reason}") if reason else None
        left = tuple(levels_left(problem, plan)) if plan is not None else ()
        return Outcome(status, plan, why, seconds=perf_counter() - began, engine=name, left=left)

    if said == "UNSOLVABLE_PROVEN":
        return outcome(Status.UNSOLVABLE, reason=f"no plan exists on level {level}")
    if not said.startswith("SOLVED"):
        return outcome(Status.GAVE_UP, reason=said.lower().replace("_", " "))
    from confab.pddl_commands import read_pddl_plan

    found = read_pddl_plan(wanted, level, "".join(f"({line})\n" for line in lines), regroup=True, shorten=True)
    for plan in (under_the_levels_above(problem, found), found):
        faults = validate(problem, plan)
        if not faults:
            return outcome(Status.SOLVED, plan)
    return outcome(Status.GAVE_UP, reason=f"its plan is none here: {faults[0].text}")


def unified(domain: str, problem: str) -> unified_planning.model.Problem:
    """Return a PDDL domain and problem as unified-planning reads them.

    Raises
    ------
    KnowledgeError
        unified-planning isn't installed, or doesn't read them.
    """
    try:
        from unified_planning.io import PDDLReader
    except ImportError:
        raise KnowledgeError("this needs unified-planning: pip install unified-planning") from None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # it uses outdated names of pyparsing
            return PDDLReader().parse_problem_string(domain, problem)
    except Exception as error:  # of many kinds, for unsupported features
        raise KnowledgeError(f"unified-planning can't read this level: {error}") from error


def some_installed(problem: Problem) -> bool:
    """Whether unified-planning and an engine for such a problem seem to be installed.

    Only names are checked: importing the packages takes longer than most plans.
    """
    if find_spec("unified_planning") is None:
        return False
    engines = {module.name for module in iter_modules() if module.name.startswith("up_")}
    if problem.domain.rules:
        engines &= WITH_DEFINITIONS
    if any(situation.quantity is not None for situation in problem.domain.situations.values()):
        engines -= WITHOUT_NUMBERS
    return bool(engines)


def at_rest(problem: Problem, level: int) -> dict[Symbol, str]:
    """Return the initial rest values that only lower levels see: a plan has to restore them."""
    first = problem.domain.levels[0]
    return {symbol: value for symbol, value in problem.at_rest(level).items() if first < problem.first_level(symbol)}


def answer(domain: str, problem: str, engine: str | None, deadline: Deadline) -> Answer:
    """Plan with unified-planning.

    Raises
    ------
    KnowledgeError
        unified-planning isn't installed, has no such engine, or has none for such a problem.
    """
    try:
        from unified_planning.engines import PDDLPlanner
        from unified_planning.environment import Environment
    except ImportError:
        raise KnowledgeError("engines need unified-planning: pip install unified-planning") from None

    factory = Environment().factory
    if engine is not None and engine not in factory.engines:
        known = ", ".join(name for name in factory.engines if factory.engine(name).is_oneshot_planner()) or "none"
        raise KnowledgeError(
            f"no engine '{engine}' is installed{nearest(engine, KNOWN)} (installed: {known}); "
            + (f"pip install {KNOWN[engine]} brings it" if engine in KNOWN else "unified-planning lists its engines")
        )
    first = engine or next((name for name in factory.preference_list if name in factory.engines), None)
    if first and issubclass(factory.engine(first), PDDLPlanner) and ":numeric-fluents" not in domain:
        _tell(first, deadline)
        return first, *_directly(factory.engine(first)(), domain, problem, deadline)
    if "(:derived" in domain:
        said = f"{engine} takes no" if engine else "no installed engine takes"
        raise KnowledgeError(f"{said} derived predicates, as what is defined would be; plan without --engine")
    late = first or "unified-planning", "TIMEOUT", list[str]()
    _tell(late[0], deadline)
    try:
        seconds = CPU_SECONDS if deadline.left is None else deadline.left
        found: Answer = call(solved, domain, problem, engine, deadline.left, seconds=seconds, timeout=deadline.left)
    except TimeoutExpired:
        return late
    except WorkerError as error:
        if error.late:
            return late
        raise KnowledgeError(f"{late[0]} ended without an answer ({error.status}): {error.said[-200:]}") from None
    return found


def solved(domain: str, problem: str, engine: str | None, seconds: float | None) -> Answer:
    """Return unified-planning's answer for a level that it reads itself; runs in the process of `confab.reasoner.workers.call`."""
    from unified_planning import environment as environments
    from unified_planning.environment import Environment
    from unified_planning.exceptions import UPException
    from unified_planning.io import PDDLReader

    environment = Environment()
    environment.error_used_name, environment.credits_stream = False, None  # a type may be called as a predicate is
    environments.GLOBAL_ENVIRONMENT = environment  # where its reader makes metrics
    factory = environment.factory
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            task = PDDLReader(environment).parse_problem_string(domain, problem)
        except Exception as error:  # its reader's asserts and pyparsing's errors among them: ours goes on without it
            said = " ".join(str(error).split())[:200]
            raise KnowledgeError(f"unified-planning can't read this level: {type(error).__name__}: {said}") from None
        if engine and not {"INT_FLUENTS", "REAL_FLUENTS"}.isdisjoint(
            task.kind.features - factory.engine(engine).supported_kind().features
        ):
            raise KnowledgeError(f"{engine} takes no numbers; name an engine that does, or plan without --engine")
        try:
            chosen = {"name": engine} if engine else {"problem_kind": task.kind}
            with factory.OneshotPlanner(**chosen) as planner:
                planner.skip_checks = True  # some reject action costs although they accept them
                result = planner.solve(task, timeout=seconds)
                name = engine or planner.name
        except UPException as error:
            raise KnowledgeError(f"no engine takes this problem: {' '.join(str(error).split())}") from None
    actions = result.plan.actions if result.plan is not None else ()
    lines = [" ".join((action.action.name, *map(str, action.actual_parameters))) for action in actions]
    return name, "SOLVED_SATISFICING" if lines else result.status.name, lines


def _tell(engine: str, deadline: Deadline) -> None:
    """Report the engine and its time limit."""
    limit = "" if deadline.left is None else f", for up to {deadline.left:.3g} s (--time-limit)"
    log.warning("confab: the engine %s is asked for a plan%s; --engine none asks none", engine, limit)


def _directly(planner: Any, domain: str, problem: str, deadline: Deadline) -> tuple[str, list[str]]:
    """Give the files to an engine that reads PDDL itself; return its status and the steps.

    unified-planning would first read and write them again, which takes minutes for large relations, and it doesn't support derived
    predicates.
    """
    from unified_planning.model import Problem as Nothing

    with TemporaryDirectory() as folder:
        files = [Path(folder) / name for name in ("domain.pddl", "problem.pddl", "plan")]
        files[0].write_text(domain)
        files[1].write_text(problem)
        seconds = CPU_SECONDS if deadline.left is None else deadline.left
        process = start(
            planner._get_cmd(*map(str, files)), seconds, cwd=folder, stdin=DEVNULL, stdout=DEVNULL, stderr=DEVNULL
        )
        code = None
        try:
            code = process.wait(None if deadline.left is None else READING * deadline.left)
        except TimeoutExpired:
            pass
        finally:
            end(process)
        written = [file for file in Path(folder).iterdir() if re.fullmatch(r"plan(\.\d+)?", file.name)]
        for file in sorted(written, key=lambda file: file.stat().st_mtime_ns, reverse=True):
            text = file.read_text()
            if code is not None or text.endswith("\n"):  # else it was being written
                return "SOLVED_SATISFICING", re.findall(r"^\(([^()]*)\)", text, re.MULTILINE)
        return "TIMEOUT" if code is None else planner._result_status(Nothing(), None, code, []).name, []

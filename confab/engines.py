"""Planning on one level by an external planner (an engine) through the library unified-planning.

The level is exported to PDDL, and the engine's plan is read back. The result has the same form as a plan of Confab's own search.
Each step is moved directly after the steps on which it depends. If consecutive steps together have exactly the effect of a
behaviour of a higher level, they become the refinement of that behaviour. Every plan of an engine is validated by
`confab.planner.validation`.
"""

from __future__ import annotations

import logging
import re
import warnings
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
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
from confab.planner.timed.call import Timed, in_time
from confab.planner.timed.pieces import default_actors
from confab.planner.timed.plan import TimedOutcome
from confab.planner.validation import validate
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.limits import Deadline, overtime, within
from confab.reasoner.names import nearest
from confab.reasoner.pddl.exporting import to_pddl
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import Symbol
from confab.reasoner.workers import CPU_SECONDS, WorkerError, call, end, start

if TYPE_CHECKING:
    import unified_planning.model

log = logging.getLogger(__name__)
ENGINE_SECONDS = 60.0
"""Default time limit of a planning call by an engine in seconds."""
IMPORTING = 1.5
"""Seconds reserved for the import of unified-planning; if less time is left, no engine is started."""
READING = 0.93
"""Share of the remaining time that an engine may use. In the rest of the time, the engine's plan is read and validated."""
WITHOUT_NUMBERS = {"up_fast_downward", "up_pyperplan", "up_symk", "up_test_cases"}
"""Packages of engines without support for numbers."""
WITH_DEFINITIONS = {"up_fast_downward"}
"""Packages of engines that support derived predicates; unified-planning itself doesn't support derived predicates."""
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
"""The package that provides each engine, by the engine's name in unified-planning."""
Answer = tuple[str, str, list[str]]
"""The name of an engine, the status of its result in unified-planning, and the lines of its plan in the competition format."""
LINE = re.compile(r"^(?:[\d.]+\s*:\s*)?\([^()]*\)(?:\s*\[[\d.]+\])?", re.MULTILINE)
"""A line of a plan file: ``(action object …)``, or ``begin: (action object …) [duration]`` in a plan with times."""


def plan_by_engine(
    problem: Problem, engine: str | None, level: int | None = None, seconds: float | None = None
) -> Outcome:
    """Plan on one level of a problem with an engine of unified-planning.

    Parameters
    ----------
    problem : Problem
    engine : str, optional
        The engine's name in unified-planning, e.g. ``fast-downward``; by default any installed engine that supports the
        problem.
    level : int, optional
    seconds : float, optional
        Time limit of the whole call; by default `ENGINE_SECONDS`. If the engine has written a plan at the limit, this plan is
        used.

    Raises
    ------
    KnowledgeError
        The engine or the level doesn't exist, or the problem has derived predicates or amounts and the engine doesn't support
        them.
    """
    # the limit includes the export and the imports
    with within(ENGINE_SECONDS if seconds is None else seconds) as deadline:
        return _planned(problem, engine, level, deadline)


def _planned(problem: Problem, engine: str | None, level: int | None, deadline: Deadline) -> Outcome:
    began = perf_counter()
    level = problem.domain.levels[-1] if level is None else level
    if level not in problem.domain.levels:
        raise KnowledgeError(f"no level {level}; this scene has {', '.join(map(str, problem.domain.levels))}")
    wanted = replace(problem, goal={**at_rest(problem, level), **problem.goal})

    def late() -> bool:
        return deadline.left is not None and deadline.left < IMPORTING

    exported = None if late() else to_pddl(wanted, level)
    if exported is None or late():
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

    found = read_pddl_plan(wanted, level, "\n".join(lines), regroup=True, shorten=True)
    for plan in (under_the_levels_above(problem, found), found):
        with overtime():
            faults = validate(problem, plan)
        if not faults:
            return outcome(Status.SOLVED, plan)
    return outcome(Status.GAVE_UP, reason=f"its plan is invalid: {faults[0].text}")


def plans_in_time(engine: str | None) -> bool:
    """Return whether an installed engine plans durative actions."""
    if engine is None or find_spec("unified_planning") is None:
        return False
    from unified_planning.environment import Environment

    factory = Environment().factory
    return engine in factory.engines and "CONTINUOUS_TIME" in factory.engine(engine).supported_kind().features


def plan_in_time_by_engine(problem: Problem, engine: str, seconds: float | None = None) -> Outcome:
    """Plan the lowest level of a problem with times with an engine that plans durative actions.

    Parameters
    ----------
    problem : Problem
    engine : str
        The engine's name in unified-planning, e.g. ``lpg``.
    seconds : float, optional
        Time limit of the whole call; by default `ENGINE_SECONDS`.

    Returns
    -------
    Outcome
        A `TimedOutcome` with a timed plan that the checker accepts, or the outcome "gave up": that an engine finds no plan proves
        nothing.

    Raises
    ------
    KnowledgeError
        PDDL can't express the problem, or the engine can't read it.
    """
    with within(ENGINE_SECONDS if seconds is None else seconds) as deadline:
        began = perf_counter()
        wanted = replace(problem, goal={**at_rest(problem, problem.domain.levels[-1]), **problem.goal})
        exported = to_pddl(wanted, workers=default_actors(problem))
        name, said, lines = answer(exported.domain, exported.problem, engine, deadline)
        if not said.startswith("SOLVED"):
            return Outcome(
                Status.GAVE_UP,
                reason=Reason(f"{name}: {said.lower().replace('_', ' ')}"),
                seconds=perf_counter() - began,
            )
        from confab.pddl_commands import read_timed_plan

        with overtime():
            found = read_timed_plan(wanted, exported, "\n".join(lines))
            if found.plan is not None:  # other orders of the same steps may take less
                other = in_time(wanted, found.plan.plan, deadline.left)
                shorter = other.plan is not None and other.plan.makespan <= found.plan.makespan
                found = other if shorter else Timed(replace(found.plan, bound=Fraction(0)))
        spent = perf_counter() - began
        if found.plan is None:
            why = found.reason.text if found.reason else "it has no schedule"
            return Outcome(Status.GAVE_UP, reason=Reason(f"{name}: its plan is invalid: {why}"), seconds=spent)
        left = tuple(levels_left(problem, found.plan.plan))
        return TimedOutcome(Status.SOLVED, found.plan.plan, seconds=spent, engine=name, left=left, timed=found.plan)


def unified(domain: str, problem: str) -> unified_planning.model.Problem:
    """Return a PDDL domain and problem as a problem of unified-planning.

    Raises
    ------
    KnowledgeError
        unified-planning isn't installed, or can't read the domain or the problem.
    """
    try:
        from unified_planning.io import PDDLReader
    except ImportError:
        raise KnowledgeError("this needs unified-planning: pip install unified-planning") from None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # unified-planning uses deprecated names of pyparsing
            return PDDLReader().parse_problem_string(domain, problem)
    except Exception as error:  # unsupported features cause errors of many classes
        raise KnowledgeError(f"unified-planning can't read this level: {error}") from error


def some_installed(problem: Problem) -> bool:
    """Return whether unified-planning and an engine that supports a problem seem to be installed.

    Only the names of the installed packages are read, since an import of the packages takes longer than most planning calls.
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
    """Return the initial values that a plan must restore: the rest values of symbols that don't exist on the first level."""
    first = problem.domain.levels[0]
    return {symbol: value for symbol, value in problem.at_rest(level).items() if first < problem.first_level(symbol)}


def answer(domain: str, problem: str, engine: str | None, deadline: Deadline) -> Answer:
    """Plan a PDDL problem with an engine of unified-planning.

    Raises
    ------
    KnowledgeError
        unified-planning isn't installed, the engine isn't installed, or no installed engine supports the problem.
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
            f"no engine '{engine}' is installed{'' if engine in KNOWN else nearest(engine, KNOWN)} (installed: {known}); "
            + (f"pip install {KNOWN[engine]} brings it" if engine in KNOWN else "unified-planning lists its engines")
        )
    first = engine or next((name for name in factory.preference_list if name in factory.engines), None)
    late = first or "unified-planning", "TIMEOUT", list[str]()
    if deadline.left == 0:
        return late
    if first and issubclass(factory.engine(first), PDDLPlanner) and ":numeric-fluents" not in domain:
        _tell(first, deadline)
        return first, *_directly(factory.engine(first)(), domain, problem, deadline)
    if "(:derived" in domain:
        said = f"{engine} takes no" if engine else "no installed engine takes"
        raise KnowledgeError(f"{said} derived predicates, which definitions become; plan without engine=")
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
    """Return the answer of unified-planning to a PDDL problem.

    `confab.reasoner.workers.call` runs this function in a separate process.
    """
    from unified_planning import environment as environments
    from unified_planning.environment import Environment
    from unified_planning.exceptions import UPException
    from unified_planning.io import PDDLReader

    environment = Environment()
    # a type and a predicate may have the same name
    environment.error_used_name, environment.credits_stream = False, None
    # the reader of unified-planning makes metrics in the global environment
    environments.GLOBAL_ENVIRONMENT = environment
    factory = environment.factory
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            task = PDDLReader(environment).parse_problem_string(domain, problem)
        except Exception as error:  # for example assertion errors of the reader, and errors of pyparsing
            said = " ".join(str(error).split())[:200]
            raise KnowledgeError(f"unified-planning can't read this level: {type(error).__name__}: {said}") from None
        if engine and not {"INT_FLUENTS", "REAL_FLUENTS"}.isdisjoint(
            task.kind.features - factory.engine(engine).supported_kind().features
        ):
            raise KnowledgeError(f"{engine} takes no numbers; name an engine that does, or plan without engine=")
        try:
            chosen = {"name": engine} if engine else {"problem_kind": task.kind}
            with factory.OneshotPlanner(**chosen) as planner:
                planner.skip_checks = True  # some engines declare that they don't support action costs, but do
                result = planner.solve(task, timeout=seconds)
                name = engine or planner.name
        except UPException as error:
            raise KnowledgeError(f"no engine takes this problem: {' '.join(str(error).split())}") from None
        except Exception as error:  # engines have errors of their own
            said = " ".join(str(error).split())[:200]
            raise KnowledgeError(
                f"{engine or 'the engine'} ends with an error: {type(error).__name__}: {said}"
            ) from None
    lines = [] if result.plan is None else list(_lines(result.plan))
    return name, "SOLVED_SATISFICING" if lines else result.status.name, lines


def _lines(plan: Any) -> Iterator[str]:
    """Yield the lines of a plan of unified-planning, which is a sequence of actions, or actions with begins and durations."""

    def line(action: Any) -> str:
        return f"({' '.join((action.action.name, *map(str, action.actual_parameters)))})"

    if hasattr(plan, "timed_actions"):
        for begin, action, lasts in plan.timed_actions:
            yield f"{float(begin):.6f}: {line(action)} [{float(lasts or 0):.6f}]"
    else:
        yield from map(line, plan.actions)


def _tell(engine: str, deadline: Deadline) -> None:
    """Log the name of the engine and its time limit."""
    limit = "" if deadline.left is None else f", for up to {deadline.left:.3g} s (--time-limit)"
    log.warning("confab: trying the engine %s%s; with --engine none, Confab tries no engine", engine, limit)


def _directly(planner: Any, domain: str, problem: str, deadline: Deadline) -> tuple[str, list[str]]:
    """Run an engine that reads PDDL on the exported files, and return the engine's status and the steps of the plan.

    The reader of unified-planning takes minutes for large relations and doesn't support derived predicates. Therefore, the engine
    reads the exported files directly.
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
            if code is not None or text.endswith("\n"):  # without it, the engine was still writing the file
                return "SOLVED_SATISFICING", LINE.findall(text)
        return "TIMEOUT" if code is None else planner._result_status(Nothing(), None, code, []).name, []

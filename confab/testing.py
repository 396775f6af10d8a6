"""Conformance test of a robot's interface (`check_world`), which ``python -m confab.testing SCENE ROBOT`` runs.

Each check reports a verdict with numbers. The robot executes the primitives of a plan: keep people away from a real robot.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from threading import Thread
from time import perf_counter, sleep
from typing import Any

from confab.planner.acting.world import INTERRUPTED, Guarded, Verdict, World, WorldError
from confab.planner.hierarchical.planner import plan as hierarchical_plan
from confab.planner.plan import Limits, Step
from confab.planner.validation import successor
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import FALSE, State, Symbol

LOOKS = 5
"""The number of observations for which the latency is measured."""

SOON = 1.0
"""Maximum duration of an observation, and of `stop`, in seconds."""

STOPPED_WITHIN = 10.0
"""Default time in seconds within which `execute` must return after `stop`."""

ATTEMPTS = 5
"""Maximum number of attempts at a primitive."""

BEGUN = 0.05
"""Seconds between the begin of a primitive and the call of `stop`."""


@dataclass(frozen=True)
class Check:
    """A check with its name, its verdict, and a description of the result. The verdict is None if the check was impossible."""

    name: str
    passed: bool | None
    found: str

    def __str__(self) -> str:
        """Return the check as one line."""
        return f"{'ok  ' if self.passed else '-   ' if self.passed is None else 'FAIL'} {self.name:<14} {self.found}"


@dataclass(frozen=True)
class Conformance:
    """The results of all checks of a world."""

    checks: tuple[Check, ...]

    @property
    def passed(self) -> bool:
        """Whether every check passed or was impossible."""
        return all(check.passed is not False for check in self.checks)

    def __getitem__(self, name: str) -> Check:
        """Return the check that has the given name."""
        return next(check for check in self.checks if check.name == name)

    def __str__(self) -> str:
        """Return a line for each check."""
        return "\n".join(map(str, self.checks))


def check_world(
    world: World, problem: Problem, steps: Sequence[Step] | None = None, stopped_within: float = STOPPED_WITHIN
) -> Conformance:
    """Check a world against the protocol of `confab.planner.acting.world`.

    Parameters
    ----------
    world : World
        The world, whose state must be the initial state of the problem or a similar state.
    problem : Problem
        The problem of a scene, which defines the primitives and the symbols of the world.
    steps : sequence of Step, optional
        The primitives to execute, in order; by default, the primitives of a plan from the observed state to the problem's goal.
    stopped_within : float
        Time in seconds within which `execute` must return after `stop`.

    Examples
    --------
    >>> import confab
    >>> from confab.planner.acting.symbolic_world import SymbolicWorld
    >>> problem = confab.load("beverage-serving").problem
    >>> check_world(SymbolicWorld(problem), problem).passed
    True
    """
    guarded = Guarded(world)
    checks: list[Check] = []
    try:
        first = _observed(guarded, problem, checks)
        if any(symbol.situation not in problem.domain.situations for symbol in first):
            return Conformance(tuple(checks))
        if steps is None:
            now = {**problem.initial, **first}
            plan = hierarchical_plan(replace(problem, initial=now), limits=Limits(seconds=20.0)).plan
            steps = plan.primitives if plan is not None else ()
        checks.append(_refusal(guarded, first, steps[0].arguments if steps else ()))
        rest = _stopped(guarded, problem, steps, stopped_within, checks)
        _executed(guarded, problem, rest, checks)
    except WorldError as error:
        checks.append(Check("exceptions", False, str(error)))
    return Conformance(tuple(checks))


# ------------------------------------------------------------------------------------------------------------- observation


def _observed(world: Guarded, problem: Problem, checks: list[Check]) -> State:
    """Check the observations and the clock of a world; return the last observation."""
    times, seen, before = [], [], world.seconds
    for _ in range(LOOKS):
        begin = perf_counter()
        seen.append(dict(world.observe()))
        times.append(perf_counter() - begin)
    after = world.seconds
    slowest = max(times)
    checks.append(
        Check("latency", slowest <= SOON, f"observe() took {slowest * 1000:.0f} ms at most, of {LOOKS} times")
    )
    strange = sorted({f"{s}={v}" for look in seen for s, v in look.items() if not _known(problem, s, v)})
    text = f"unknown: {', '.join(strange[:3])}" if strange else f"{len(seen[-1])} symbols, all of the scene"
    checks.append(Check("symbols", not strange and bool(seen[-1]), text))
    moving = sorted({str(s) for look in seen for s in look.keys() | seen[0].keys() if look.get(s) != seen[0].get(s)})
    text = f"changed with nothing done: {', '.join(moving[:3])}" if moving else "the same each time"
    checks.append(Check("steadiness", not moving, text))
    checks.append(Check("clock", after >= before, f"from {before:.3f} to {after:.3f} s"))
    return seen[-1]


def _known(problem: Problem, symbol: Symbol, value: str) -> bool:
    kind = problem.domain.situations.get(symbol.situation)
    if kind is None or len(kind.arguments) != len(symbol.arguments):
        return False
    members = zip(symbol.arguments, kind.arguments, strict=True)
    if any(individual not in problem.classes.get(name, ()) for individual, name in members):
        return False
    if kind.quantity is not None:
        return True
    return value in (("true", "false") if kind.boolean else problem.classes.get(kind.range, ()))


# ------------------------------------------------------------------------------------------------------------- execution


def _refusal(world: Guarded, before: State, arguments: tuple[str, ...]) -> Check:
    """Check that the execution of an unknown primitive fails with an error code and has no effects."""
    verdict = world.execute(Step((0,), 0, 1, "NO_SUCH_BEHAVIOUR", arguments))
    after = world.observe()
    changed = sorted(str(s) for s in after.keys() | before.keys() if after.get(s) != before.get(s))
    if verdict.ok:
        return Check("refusal", False, "a primitive that doesn't exist is reported as done")
    if changed:
        return Check("refusal", False, f"a primitive that doesn't exist changed {', '.join(changed[:3])}")
    return Check(
        "refusal", bool(verdict.code), f"a primitive that doesn't exist fails: {verdict.code} ({verdict.message})"
    )


def _stopped(
    world: Guarded, problem: Problem, steps: Sequence[Step], within: float, checks: list[Check]
) -> Sequence[Step]:
    """Check that `stop` ends a running primitive and doesn't affect later primitives; return the remaining steps."""
    begin = perf_counter()
    world.stop()
    took = perf_counter() - begin
    checks.append(Check("idle stop", took <= SOON, f"stop() with nothing running took {took * 1000:.0f} ms"))
    if not steps:
        checks.append(Check("cancellation", None, "no plan, so that nothing could be executed"))
        return steps
    answers: list[Verdict | Exception] = []
    running = Thread(target=_noting(answers, lambda: world.execute(steps[0])), daemon=True)
    running.start()
    sleep(BEGUN)
    if not running.is_alive():
        checks.append(_after_idle_stop(steps[0], answers[0]))
    else:
        begin = perf_counter()
        world.stop()
        asked = perf_counter() - begin
        running.join(within)
        took = perf_counter() - begin
        if running.is_alive():
            checks.append(Check("cancellation", False, f"{steps[0]} went on for {within:g} s after stop()"))
            raise WorldError("execute() doesn't return after stop(), so that nothing else could be checked")
        ended = answers[0]
        if isinstance(ended, Exception):
            raise ended
        said = ended.code if not ended.ok else "done"
        fine = asked <= SOON and (ended.ok or ended.code == INTERRUPTED)
        checks.append(Check("cancellation", fine, f"execute() returned {took * 1000:.0f} ms after stop(): {said}"))
    now = world.observe()
    behavior = problem.domain.behaviors[steps[0].behavior]
    left = successor(problem, behavior, steps[0].arguments, {**problem.initial, **now})
    return steps if left is not None else steps[1:]


def _after_idle_stop(step: Step, ended: Verdict | Exception) -> Check:
    """Check that `stop` has no effect on the next primitive if it is called while no primitive runs."""
    if isinstance(ended, Exception):
        raise ended
    if ended.code == INTERRUPTED:
        return Check("cancellation", False, f"{step} was stopped by the stop() before it, when nothing was running")
    return Check("cancellation", None, f"{step} took less than {BEGUN * 1000:.0f} ms")


def _noting(answers: list[Verdict | Exception], work: Callable[[], Verdict]) -> Callable[[], None]:
    def run() -> None:
        try:
            answers.append(work())
        except Exception as error:
            answers.append(error)

    return run


def _executed(world: Guarded, problem: Problem, steps: Sequence[Step], checks: list[Check]) -> None:
    """Execute primitives, repeat failed primitives, and compare each verdict with the observation after the primitive."""
    done, failed, lies, understated, nameless, times = 0, 0, list[str](), list[str](), list[str](), list[float]()
    seen, wanted, ended = set[Symbol](), dict[Symbol, None](), ""
    for step in steps:
        for attempt in range(1, ATTEMPTS + 1):
            before = {**problem.initial, **world.observe()}
            expected = successor(problem, problem.domain.behaviors[step.behavior], step.arguments, before)
            if expected is None:
                ended = f"ended at {step}, whose preconditions aren't observed"
                break
            begin = perf_counter()
            verdict = world.execute(step)
            times.append(perf_counter() - begin)
            after = world.observe()
            seen.update(after)
            missing = _missing(problem, before, expected, after)
            if verdict.ok:
                done += 1
                changed = (s for s, value in expected.items() if before.get(s) != value)
                wanted.update(dict.fromkeys(s for s in changed if not problem.domain.situations[s.situation].boolean))
                lies += [f"{step}: {missing}"] if missing else []
                break
            failed += 1
            understated += [str(step)] if not missing else []
            nameless += [str(step)] if not isinstance(verdict.code, str) or not verdict.code else []
            if attempt == ATTEMPTS:
                ended = f"ended at {step}, which failed {ATTEMPTS} times: {verdict.code}"
        if ended:
            break
    longest = f", the longest in {max(times):.2f} s" if times else ""
    text = f"{done} of {len(steps)} primitives done, {failed} attempts failed{longest}"
    checks.append(Check("execution", not ended if steps else None, "; ".join(filter(None, (text, ended)))))
    never = sorted({str(symbol) for symbol in wanted if symbol not in seen})
    text = (
        f"reported as done, but not observed: {'; '.join(lies[:3])}"
        if lies
        else "the effects of each finished primitive were observed"
    )
    text += f"; never perceived, so not checked: {', '.join(never[:5])}" if never else ""
    checks.append(Check("effects", not lies if done else None, text))
    text = f"failed without a code: {', '.join(nameless[:3])}" if nameless else "every failure has a code"
    checks.append(Check("failures", not nameless if failed else None, text if failed else "nothing failed"))
    if understated:
        checks.append(
            Check("understated", None, f"reported as failed, but observed as done: {', '.join(understated[:3])}")
        )


def _missing(problem: Problem, before: State, expected: Mapping[Symbol, str], seen: State) -> str:
    """Return, as text, the first expected change that the observation contradicts; amounts aren't compared."""
    for symbol, value in sorted(expected.items()):
        kind = problem.domain.situations[symbol.situation]
        if before.get(symbol) == value or kind.quantity is not None:
            continue
        found = seen.get(symbol, FALSE if kind.boolean else None)
        if found is not None and found != value:
            return f"{symbol} is {found}, not {value}"
    return ""


def main(arguments: Sequence[str]) -> int:
    """Check the robot of a scene, print the results, and return the exit code."""
    from confab.connecting import connected
    from confab.reasoner.graph.knowledge import KnowledgeError
    from confab.scene import load

    if len(arguments) < 2:
        print("wanted: python -m confab.testing SCENE INTERFACE:ADDRESS [GOAL …]", file=sys.stderr)
        return 2
    try:
        scene: Any = load(arguments[0])
        for goal in arguments[2:]:
            scene = scene.with_goal(goal)
        world, _ = connected(scene, scene.problem, arguments[1])
    except KnowledgeError as error:
        print(error, file=sys.stderr)
        return 2
    report = check_world(world, scene.problem)
    print(report)
    return 0 if report.passed else 1


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))

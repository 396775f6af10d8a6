"""The hierarchical planner of the paper.

The planner searches the most abstract level, then refines each behaviour on the level below, down to primitives. The
goal of a refinement is defined in docs/levels.md. Symbols that the level of the refined behaviour sees must end with
the values that the behaviour states. Symbols that only the lower level sees must end at rest if the refinement changed
them; for example, hands must be empty, raised and upright. The next behaviour begins in the state in which the
refinement ended.

The planner stores the refinement of each behaviour in each state. If a behaviour has no refinement, or if the refinement makes
a later behaviour inapplicable, the planner searches the level again with the stored results. If a level has no plan, the
planner searches the level below for the goal.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import TypeAlias

from confab.planner.paper.astar import Goal, SearchResult, a_star, mismatches
from confab.planner.paper.cogency import PAPER, cogencies, ranking
from confab.planner.paper.transitions import Applied, Model, Values, ground
from confab.planner.plan import Counts, Limits, Outcome, Plan, Reason, Status, Step, UnsolvableError, renumbered
from confab.reasoner.limits import OutOfTimeError
from confab.reasoner.memory.links import Links
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import Fact, GroundBehavior

SETTLED, UNSETTLED = "settled", "unsettled"
"""Marks of a symbol that isn't at rest in the beginning (`Target`).

The symbol is settled if no step has changed the symbol, or if the symbol is at rest; otherwise the symbol is unsettled.
"""

DOUBT = 1_000
"""Number of expansions before the first attempt to prove unsolvability.

The planner repeats the attempt each time that the number of expansions has quadrupled.
"""
Proof: TypeAlias = "Callable[[Problem, int, float | None], UnsolvableError | None]"
"""Function of a problem, a number of states and a deadline.

The function returns an `UnsolvableError` if the problem is proved unsolvable, otherwise None.
"""

Refined: TypeAlias = "tuple[Step, Values] | None"
"""A step with its refinement, and the state after the refinement, or None if there is no refinement."""


@dataclass
class PaperCall:
    """One planning call: the compiled problem, the memory, the limits, the stored refinements and the counts."""

    model: Model
    grounds: Mapping[int, tuple[GroundBehavior, ...]]
    links: Links
    limits: Limits
    deadline: float | None
    proof: Proof
    expanded: int = 0
    counts: dict[int, Counts] = field(default_factory=dict)
    known: dict[tuple[Values, GroundBehavior], Refined] = field(default_factory=dict)
    gave_up: bool = False
    doubted: int = DOUBT
    given_up: list[str] = field(default_factory=list)


def unproved(problem: Problem, states: int, deadline: float | None) -> None:
    """Return None without attempting a proof."""


def plan(
    problem: Problem,
    links: Links | None = None,
    limits: Limits = Limits(),  # noqa: B008 - frozen
    grounds: Mapping[int, tuple[GroundBehavior, ...]] | None = None,
    leave_levels: bool = True,
    proof: Proof = unproved,
    levels: Sequence[int] | None = None,
) -> Outcome:
    """Plan as the paper does, with A* and eq. (5) on each level, and a refinement of each step on the next level.

    Parameters
    ----------
    problem : Problem
    links : Links, optional
        The confabulation memory, by default empty.
    limits : Limits
        Maximum number of expansions of each search, and seconds of the whole call.
    grounds : mapping of level to quantified behaviours, optional
        Results of `confab.reasoner.reading.quantification`; by default the arguments are computed from the problem's classes.
    leave_levels : bool
        Whether the planner searches the level below for the goal if a level has no plan with refinements.
    proof : Proof
        Function that tries to prove unsolvability, after `DOUBT` expansions and again later with a larger number of states.
    levels : sequence of int, optional
        The levels on which the planner searches, by default all levels; a single level is searched without refinement.
    """
    begin = perf_counter()
    levels = levels or problem.domain.levels
    call = PaperCall(
        model=Model(problem),
        grounds=grounds or {level: ground(problem, level) for level in levels},
        links=links or Links(),
        limits=limits,
        deadline=limits.end(),
        proof=proof,
        counts={level: Counts() for level in levels},
    )
    steps = None
    for level in levels:
        try:
            steps = task(call, level)
        except UnsolvableError as error:
            seconds = perf_counter() - begin
            return Outcome(
                Status.UNSOLVABLE, None, error.reason, call.counts, 0, seconds, certificate=error.certificate
            )
        if steps is not None or call.gave_up:
            break
        if not leave_levels and level != levels[-1]:
            reason = Reason(f"no plan of level {level} was found that can be refined, and levels must not be left")
            return Outcome(Status.GAVE_UP, None, reason, call.counts, 0, perf_counter() - begin)
        if level != levels[-1]:
            unseen = [str(Fact(s, value)) for s, value in problem.goal.items() if not problem.sees(level, s, value)]
            lacks = f", which doesn't know {', '.join(unseen)}," if unseen else ""
            call.given_up.append(f"level {level}{lacks} was given up: no plan of it was found that can be refined")
    return _outcome(call, steps, perf_counter() - begin)


def task(call: PaperCall, level: int) -> list[Step] | None:
    """Return a plan of one level, refined down to primitives, or None if the level has no plan with refinements."""
    problem, start = call.model.problem, call.model.values(call.model.problem.initial)
    goal = {i: problem.goal[symbol] for i, symbol in enumerate(call.model.symbols) if symbol in problem.goal}
    found = solve(call, level, start, target(call.model, 0, level, start, goal))
    return None if found is None else found[0]


@dataclass(frozen=True)
class Target:
    """The goal of a sequence of steps of one level.

    `values` are the required values at the end of the sequence. `restless` contains the symbols that aren't at rest in the
    beginning, each with its rest value. Each restless symbol must stay unchanged or end at rest.
    """

    values: Goal
    restless: Goal

    def marks(self, before: Values, after: Values, marks: tuple[str, ...]) -> tuple[str, ...]:
        """Return the marks of the restless symbols after a step, given both states and the marks before the step."""
        return tuple(
            SETTLED if after[i] == rest else mark if after[i] == before[i] else UNSETTLED
            for (i, rest), mark in zip(self.restless.items(), marks, strict=True)
        )

    def reached(self, state: Values, marks: tuple[str, ...]) -> bool:
        """Return whether a state has the required values and no mark is unsettled."""
        return not mismatches(state, self.values) and UNSETTLED not in marks


def target(model: Model, above: int, level: int, before: Values, said: Goal) -> Target:
    """Return the target of a level: the values `said` by the level above, and rest values of symbols that it doesn't see.

    If `above` is 0, the target is that of the task, whose goals release the symbols that they concern.
    """
    values, restless = dict(said), dict[int, str]()
    for i, symbol in enumerate(model.symbols):
        rest = model.problem.domain.situations[symbol.situation].rest
        released = not above and model.problem.releases(symbol)
        if rest is not None and i not in said and above < model.first_levels[i] <= level and not released:
            (values if before[i] == rest else restless)[i] = rest
    return Target(values, restless)


def solve(call: PaperCall, level: int, start: Values, wanted: Target) -> tuple[list[Step], Values] | None:
    """Return refined steps of one level that reach a target, and the state after the steps.

    Return None if the search finds no such steps. Each pass of the loop either succeeds or stores a new result of refining a
    behaviour in a state. Therefore the loop ends.
    """
    while True:
        found = search(call, level, start, wanted)
        if found.status is not Status.SOLVED:
            call.gave_up |= found.status is Status.GAVE_UP
            return None
        steps: list[Step] = []
        state, marks = start, (SETTLED,) * len(wanted.restless)
        for applied, rank in zip(found.path, found.ranks, strict=True):
            refined = refine(call, level, state, applied.ground)
            if refined is None:
                break
            steps.append(replace(refined[0], rank=rank))
            marks = wanted.marks(state, refined[1], marks)
            state = refined[1]
        else:
            if wanted.reached(state, marks):
                return steps, state
        if call.gave_up:
            return None


def refine(call: PaperCall, level: int, state: Values, ground: GroundBehavior) -> Refined:
    """Return a step with its refinement and the state after it, or None if the behaviour isn't applicable or has none."""
    if (state, ground) in call.known:
        return call.known[state, ground]
    applied = call.model.apply(ground, state)
    if applied is None:
        return None
    step = Step((), ground.id, level, ground.behavior, ground.arguments, applied.bindings)
    below = next((other for other in call.grounds if other > level), None)
    if below is None:
        return step, applied.after
    model, problem = call.model, call.model.problem
    said = {
        i: value
        for i, value in enumerate(applied.after)
        if (value != state[i] or problem.sees(level, model.symbols[i], value))
        and model.symbols[i].situation not in problem.domain.remembers
    }
    found = solve(call, below, state, target(model, level, below, state, said))
    call.known[state, ground] = None if found is None else (replace(step, steps=tuple(found[0])), found[1])
    return call.known[state, ground]


def search(call: PaperCall, level: int, start: Values, wanted: Target) -> SearchResult:
    """Search one level with eq. (5); behaviours that have no refinement in a state are excluded in this state.

    The search appends the marks of the target to each state of the model.
    """
    grounds, size = call.grounds[level], len(start)
    rank = ranker(call, level)

    def successors(state: Values) -> Iterable[Applied]:
        call.expanded += 1
        if call.expanded == call.doubted:
            call.doubted *= 4
            if proof := call.proof(call.model.problem, call.expanded - DOUBT, call.deadline):
                raise proof
        base, marks = state[:size], state[size:]
        for applied in call.model.successors(timely(grounds, call.deadline), base):
            after = applied.after
            if (base, applied.ground) in call.known:
                refined = call.known[base, applied.ground]
                if refined is None:
                    continue
                after = refined[1]
            yield Applied(applied.ground, applied.bindings, after + wanted.marks(base, after, marks))

    found = a_star(
        start=start + (SETTLED,) * len(wanted.restless),
        goal={**wanted.values, **{size + j: SETTLED for j in range(len(wanted.restless))}},
        successors=successors,
        cost=call.model.cost,
        rank=lambda state: rank(state[:size]),
        bonus=PAPER.bonus,
        limits=call.limits,
    )
    call.counts[level].add(found.counts)
    return found


def timely(grounds: Iterable[GroundBehavior], deadline: float | None) -> Iterator[GroundBehavior]:
    """Yield quantified behaviours; raise `OutOfTimeError` at the deadline.

    The deadline is tested for each behaviour, because one state of a large problem can take minutes.
    """
    for one in grounds:
        if deadline is not None and perf_counter() > deadline:
            raise OutOfTimeError("the time limit")
        yield one


def ranker(call: PaperCall, level: int) -> Callable[[Values], Callable[[Applied], float]]:
    """Return a function from a state to the ranking scores c_m (eq. 4) of the behaviours applicable in the state."""
    conclusions = [(g.behavior, g.arguments) for g in call.grounds[level]]
    learned = any(conclusion in call.links.tables for conclusion in conclusions)

    def of_state(values: Values) -> Callable[[Applied], float]:
        if not learned:
            return lambda applied: 1.0 / len(conclusions)  # all conclusions share the first rank
        problem = call.model.problem
        ranks = ranking(cogencies(call.links, conclusions, call.model.state(values), problem, level))
        return lambda applied: ranks[applied.ground.behavior, applied.ground.arguments]

    return of_state


def _outcome(call: PaperCall, steps: list[Step] | None, seconds: float) -> Outcome:
    limits, levels = call.limits, tuple(call.grounds)
    status, plan, reason = Status.SOLVED, None, None
    if steps is not None:
        plan = Plan(renumbered(steps))
    elif call.gave_up:
        seconds_too = f" or {limits.seconds:.3g} s" if limits.seconds else ""
        status = Status.GAVE_UP
        reason = Reason(f"stopped at the limit of {limits.expansions} expansions in one search{seconds_too}")
    else:
        rests = any(kind.rest is not None for kind in call.model.problem.domain.situations.values())
        what = "no state in which the goal holds" + (" and all changed symbols are at rest" if rests else "")
        status = Status.UNSOLVABLE
        reason = Reason(f"{what} can be reached; all states of level {levels[-1]} were tried")
    given_up = tuple(call.given_up)
    return Outcome(status, plan, reason, call.counts, len(given_up), seconds, given_up=given_up)

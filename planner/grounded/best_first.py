"""The flat core: one level of a problem, grounded and searched without hierarchy.

It plans imported domains that have one level only, and is the last resort where refinement fails.

state       a Python integer, a bit per fact
h           relaxed-plan heuristic of a state (`confab.planner.grounded.hff`)
least       least h so far; a lower one boosts the preferred operators and is followed by a lookahead
open        two queues of expanded nodes, by h: with all of a node's operators, with its preferred ones; two more by landmarks

Lazy greedy best-first search with preferred operators: Richter and Helmert, "Preferred operators and deferred
evaluation in satisficing planning", ICAPS 2009. Lookahead, with what is stuck replaced: Vidal, "A lookahead strategy
for heuristic search planning", ICAPS 2004. Landmarks to come: Richter and Westphal, "The LAMA planner", JAIR 39 (2010).
What is found is made shorter by `confab.planner.grounded.plan_windows`.
"""

from __future__ import annotations

import heapq
import math
from array import array
from collections import Counter
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cache, reduce
from operator import or_
from time import perf_counter
from typing import NamedTuple, TypeAlias

from confab.planner.grounded.grounding import MOST_ROWS, ground
from confab.planner.grounded.hff import Evaluate, EvaluateFor, Evaluation
from confab.planner.grounded.hff import heuristic as relaxed
from confab.planner.grounded.hff_amounts import heuristic as with_amounts
from confab.planner.grounded.hff_amounts import repeats
from confab.planner.grounded.hff_dense import Effort, EvaluateMany, effort
from confab.planner.grounded.hff_dense import heuristic as dense
from confab.planner.grounded.landmarks import in_series, landmarks
from confab.planner.grounded.novelty import MOST_BYTES, STATE_BYTES, Seen, by_novelty, path_to
from confab.planner.grounded.plan_windows import shorter
from confab.planner.grounded.task import Task, bits_of
from confab.planner.plan import OUT_OF_MEMORY, Counts, Limits, Outcome, Plan, Reason, Status, UngroundableError
from confab.reasoner.limits import OutOfTimeError
from confab.reasoner.symbols import Problem, State

BOOST = 1000
"""Turns that the preferred operators get on a new best h."""
FAR = 1 << 40
"""More than any h."""
ENABLING = 8
"""Bits, at most, that are tried to have set where a relaxed plan is stuck."""
SHORTEN, STEP, STEPS, SHORTENING = 200_000, 1_000, 400, 50
"""Operators looked at to make a plan shorter: at all, for each of so many first steps, and as a part of the search's work."""
WASTEFUL, AGAIN = 2, 40_000_000
"""A plan so many times as long as the relaxed one is searched again without lookahead, by looking at so many bits."""

Path: TypeAlias = "tuple[int, list[int]]"
"""A state, and the operators that lead to it."""


class Turn(NamedTuple):
    """A search and its share of the time: by novelty or by h, with landmarks, with lookahead, from landmark to landmark."""

    share: int
    by_novelty: bool = False
    by_landmarks: bool = False
    ahead: bool = False
    in_series: bool = False

    @property
    def slow(self) -> bool:
        """Whether it looks at each state of its plan by h."""
        return not self.by_novelty and not self.ahead


@dataclass(frozen=True)
class Portfolio:
    """How a task is searched.

    The searches that share the time; how many states are relaxed at once at most, where arrays are less work; whether a plan that
    was found is searched anew with less greed.
    """

    turns: tuple[Turn, ...]
    widest: int
    restarts: bool


LEVEL = Portfolio(
    (
        Turn(6, by_landmarks=True, ahead=True),
        Turn(4, by_landmarks=True),
        Turn(3, by_novelty=True),
        Turn(1, ahead=True),
        Turn(1, by_novelty=True, by_landmarks=True),
    ),
    widest=32,
    restarts=True,
)
"""For a whole level: large tasks, which landmarks lead through."""
WORLD = Portfolio(
    (
        Turn(6, by_novelty=True),
        Turn(4, ahead=True),
        Turn(3, by_novelty=True, by_landmarks=True),
        Turn(1, in_series=True),
    ),
    widest=1,
    restarts=False,
)
"""For a small world on the way to one goal: short plans, found before landmarks would pay; long ones go from one to the next."""


@dataclass(frozen=True)
class Flat:
    """What a flat search found: `plan`, operators of the task, is there exactly if `status` is solved; and its work, in bits."""

    status: Status
    plan: tuple[int, ...] = ()
    reason: Reason | None = None
    counts: Counts = field(default_factory=Counts)
    work: int = 0


def plan_level(
    problem: Problem,
    level: int | None = None,
    initial: State | None = None,
    goal: State | None = None,
    limits: Limits = Limits(),  # noqa: B008 - frozen
    most_work: float = math.inf,
    most_rows: int | None = None,
) -> Outcome:
    """Plan one level of a problem, the lowest if none is given.

    Parameters
    ----------
    problem : Problem
    level : int, optional
    initial, goal : State, optional
        In place of the problem's own; by default what is at rest in the beginning is wanted to be so in the end.
    limits : Limits
        The time includes grounding.
    most_work : float
        As for `search`.
    most_rows : int, optional
        As for `ground`.

    Returns
    -------
    Outcome
        Unsolvable is said of this level only.
    """
    began = perf_counter()
    deadline = limits.end()
    level = problem.domain.levels[-1] if level is None else level
    goal = problem.goal_on(level) if goal is None else goal
    try:
        task = ground(problem, level, initial, goal, most_rows or MOST_ROWS, deadline)
    except (UngroundableError, OutOfTimeError) as error:
        return Outcome(Status.GAVE_UP, reason=Reason(f"grounding stopped: {error}"), seconds=perf_counter() - began)
    except MemoryError:
        return Outcome(Status.GAVE_UP, reason=OUT_OF_MEMORY, seconds=perf_counter() - began)
    if isinstance(task, Reason):
        return Outcome(Status.UNSOLVABLE, reason=task, search={level: Counts()}, seconds=perf_counter() - began)
    try:
        found = search(task, limits, deadline, most_work=most_work)
    except OutOfTimeError:
        found = Flat(Status.GAVE_UP, (), Reason("the time limit came first"))
    plan = Plan(task.steps(found.plan)) if found.status is Status.SOLVED else None
    return Outcome(found.status, plan, found.reason, {level: found.counts}, seconds=perf_counter() - began)


def search(
    task: Task,
    limits: Limits = Limits(),  # noqa: B008 - frozen
    deadline: float | None = None,
    evaluate: Evaluate | None = None,
    found: Callable[[Sequence[int]], None] | None = None,
    most_work: float = math.inf,
    portfolio: Portfolio = LEVEL,
) -> Flat:
    """Search a plan for a grounded task.

    Several searches share the time (`LEVEL`, `WORLD`): by novelty, broad and deep; by h and by landmarks, too, with lookahead and
    without, since it can lead astray. Work is counted and not timed: the same limit of expansions (of those by h) gives the
    same plan, and a deadline can only cut the search short.

    Parameters
    ----------
    task : Task
    limits : Limits
        Their seconds are the caller's to turn into a deadline.
    deadline : float, optional
        On the clock of `time.perf_counter`.
    evaluate : function of a state, optional
        In place of h_FF; where that is less work, the searches by h evaluate many states at once, by arrays.
    found : function of a plan, optional
        Called with the first plan, before it is made shorter.
    most_work : float
        In bits followed by relaxed plans, or what takes as long.
    portfolio : Portfolio
        The searches that share the time.
    """
    counts = Counts()
    if task.initial & task.goal == task.goal:
        return Flat(Status.SOLVED, (), None, counts)
    bits = _bits(task)
    needed = effort(bits)
    work = needed.followed
    relaxing: EvaluateFor | None = None
    if task.amounts is not None and repeats(task):
        evaluate = evaluate or with_amounts(task)
        many = None
    else:
        width = min(needed.width, portfolio.widest)
        arrays = evaluate is None and needed.by_arrays(width) < width * work
        relaxing = relaxed(bits)
        evaluate = evaluate or _on_bits(task, relaxing)
        many = _all_on_bits(task, cache(lambda: dense(bits))) if arrays else None
    often = _Evaluator(evaluate, many, needed, min(needed.width, portfolio.widest) if many else 1)
    begun = evaluate(task.initial)
    if begun is None:
        return Flat(
            Status.UNSOLVABLE, (), Reason("the goal can't be reached even if nothing ever ceases to hold"), counts
        )
    lookahead, marks = ahead(task, deadline), cache(lambda: landmarks(task, deadline))
    searches: list[tuple[float, Generator[int, None, tuple[Seen, int] | None]]] = [
        (
            turn.share,
            by_novelty(task, evaluate, work, counts, marks if turn.by_landmarks else None)
            if turn.by_novelty
            else _in_series(task, often, relaxing, counts, deadline)
            if turn.in_series
            else _best_first(
                task, often, counts, lookahead if turn.ahead else None, marks if turn.by_landmarks else None
            ),
        )
        for turn in portfolio.turns
    ]
    kinds = list(portfolio.turns)
    spent = [0.0] * len(searches)
    total = 0
    while True:
        turn = spent.index(min(spent))
        share, search_ = searches[turn]
        try:
            done = next(search_)
            total += done
            spent[turn] += done / share
        except OutOfTimeError:
            return Flat(Status.GAVE_UP, (), Reason("the time limit came first"), counts, total)
        except MemoryError:
            del searches[turn], spent[turn], kinds[turn]
            if not searches:
                return Flat(Status.GAVE_UP, (), OUT_OF_MEMORY, counts)
        except StopIteration as end:
            if end.value is None:
                return Flat(
                    Status.UNSOLVABLE,
                    (),
                    Reason("no plan exists: all states that can be reached were searched"),
                    counts,
                )
            plan = path_to(*end.value)
            if found:
                found(plan)
            if portfolio.restarts and kinds[turn].ahead and len(plan) > WASTEFUL * begun[0]:
                slow = [one for (_, one), kind in zip(searches, kinds, strict=True) if kind.slow]
                plan = _again(task, slow, plan, deadline)
            shortening = SHORTEN + STEP * min(len(plan), STEPS) + total // SHORTENING
            best: Sequence[int] = plan
            with suppress(MemoryError):  # then it stays as it is
                best = shorter(task, plan, shortening, deadline, portfolio.restarts)
            return Flat(Status.SOLVED, tuple(best), None, counts, total)
        if total >= most_work:
            return Flat(Status.GAVE_UP, (), Reason("the limit of work came first"), counts, total)
        if counts.expanded >= limits.expansions:
            return Flat(Status.GAVE_UP, (), Reason(f"the limit of {limits.expansions} expansions came first"), counts)
        if deadline is not None and perf_counter() > deadline:
            return Flat(Status.GAVE_UP, (), Reason("the time limit came first"), counts)


def _again(
    task: Task,
    searches: Sequence[Generator[int, None, tuple[Seen, int] | None]],
    plan: list[int],
    deadline: float | None,
) -> list[int]:
    """Return a plan, or a shorter one that costs no more and that a search goes on to with bounded work."""
    for search_ in searches:
        work = 0
        try:
            while work < AGAIN and (deadline is None or perf_counter() < deadline):
                work += next(search_)
        except MemoryError:
            continue
        except StopIteration as end:
            other = plan if end.value is None else path_to(*end.value)
            return other if len(other) < len(plan) and task.cost_of(other) <= task.cost_of(plan) else plan
    return plan


def _bits(task: Task) -> Task:
    """Return a task without amounts, in which what may make a comparison true does so at once."""
    if task.amounts is None:
        return task
    return replace(task, amounts=None, initial=task.initial & (1 << task.size) - 1)


def _on_bits(task: Task, evaluate: Evaluate) -> Evaluate:
    """Return a function of a state's bits as one of a state that has amounts besides."""
    low = (1 << task.size) - 1
    return evaluate if task.amounts is None else lambda state: evaluate(state & low)


def _all_on_bits(task: Task, made: Callable[[], EvaluateMany]) -> EvaluateMany:
    """Return a function of the bits of states, made when it is first needed, as one of states that may have amounts besides."""
    low = (1 << task.size) - 1
    return lambda states: made()(states if task.amounts is None else [state & low for state in states])


@dataclass(frozen=True)
class _Evaluator:
    """Evaluates states one by one or, where that is less work, `width` of them by arrays: by the same costs throughout a search."""

    one: Evaluate
    many: EvaluateMany | None
    effort: Effort
    width: int

    def __call__(self, states: Sequence[int]) -> tuple[list[Evaluation], int]:
        """Return the evaluations, and the work done."""
        if self.many is None:
            return [self.one(state) for state in states], len(states) * self.effort.followed
        return self.many(states), self.effort.by_arrays(len(states))


class _Queues:
    """The nodes whose operators are still to be tried: by each rank two queues, with all operators and with the preferred ones.

    They take turns; those with preferred operators get more of them whenever a rank is the least so far.
    """

    def __init__(self, ranks: int) -> None:
        # of each node its rank, number, state, and the operators that are left
        self.queues: list[list[tuple[int, int, int, Iterator[int]]]] = [[] for _ in range(2 * ranks)]
        self.turns = [0] * len(self.queues)
        self.least = [FAR] * ranks
        self.number = self.bytes = 0

    def put(self, state: int, ranks: Sequence[int], relaxed_plan: Sequence[int], applicable: Sequence[int]) -> bool:
        """Add a node; return whether a rank of it is the least so far."""
        self.number += 1
        possible = set(applicable)
        preferred = [operator for operator in dict.fromkeys(relaxed_plan) if operator in possible]
        operators = array("q", (*preferred, *sorted(possible.difference(preferred))))
        self.bytes += operators.itemsize * len(operators)
        for i, rank in enumerate(ranks):
            if applicable:
                heapq.heappush(self.queues[2 * i], (rank, self.number, state, iter(operators)))
            if preferred:
                heapq.heappush(self.queues[2 * i + 1], (rank, self.number, state, iter(operators[: len(preferred)])))
        if all(rank >= known for rank, known in zip(ranks, self.least, strict=True)):
            return False
        self.least = [min(pair) for pair in zip(ranks, self.least, strict=True)]
        self.turns = [turn - BOOST * (which % 2) for which, turn in enumerate(self.turns)]
        return True

    def draw(self) -> tuple[int, int, int, int] | None:
        """Return the next state and operator, and by which rank it came and its value; None if there is none left."""
        while filled := [which for which, queue in enumerate(self.queues) if queue]:
            which = min(filled, key=lambda which: (self.turns[which], -which))
            rank, _, state, operators = self.queues[which][0]
            operator = next(operators, None)
            if operator is not None:
                self.turns[which] += 1
                return state, operator, which // 2, rank
            heapq.heappop(self.queues[which])
        return None


def _best_first(
    task: Task,
    evaluate: _Evaluator,
    counts: Counts,
    lookahead: Callable[[int, Sequence[int]], Path] | None = None,
    marked: Callable[[], int] | None = None,
) -> Generator[int, None, tuple[Seen, int] | None]:
    """Search greedily; yield the work of each evaluation, return what was seen and the last state, or None if there is no plan.

    Where there are landmarks (`marked`), two more queues go by how many of them (and of goals that were undone) are still to come.

    Raises
    ------
    MemoryError
        There are more states and operators than it may keep.
    """
    goal = task.goal
    marks = marked() | goal if marked else 0
    came_from: Seen = {task.initial: (task.initial, ())}
    met = {task.initial: task.initial & marks}
    queues = _Queues(2 if marks else 1)
    waiting = [(task.initial, 0, FAR)]  # states to be evaluated; which rank led there, and its value

    def reached(after: int, before: int, path: tuple[int, ...], which: int = 0, rank: int = FAR) -> bool:
        came_from[after] = (before, path)
        if marks:
            met[after] = met[before] | after & marks
        waiting.append((after, which, rank))
        return after & goal == goal

    at_once = 1  # states that are evaluated together: twice as many each time, until one is better than what led to it
    while True:
        while len(waiting) < at_once and (drawn := queues.draw()):
            state, operator, which, rank = drawn
            after = task.applied(state, operator)
            counts.generated += 1
            if after is not None and after not in came_from and reached(after, state, (operator,), which, rank):
                return came_from, after
        if not waiting:
            return None
        now, waiting = waiting, []
        evaluations, work = evaluate([state for state, _, _ in now])
        counts.evaluated += len(now)
        yield work
        if len(came_from) * (STATE_BYTES + task.size // 4) + queues.bytes > MOST_BYTES:
            raise MemoryError
        at_once = min(2 * at_once, evaluate.width)
        for (state, which, rank), evaluation in zip(now, evaluations, strict=True):
            if evaluation is None:
                continue
            counts.expanded += 1
            h, relaxed_plan, applicable = evaluation
            ranks = [h]
            if marks:
                ranks.append((marks & ~met[state]).bit_count() + (goal & met[state] & ~state).bit_count())
            if ranks[which] < rank:
                at_once = 1
            if queues.put(state, ranks, relaxed_plan, applicable) and lookahead:
                after, path = lookahead(state, relaxed_plan)
                if len(path) > 1 and after not in came_from and reached(after, state, tuple(path)):
                    return came_from, after


def _in_series(
    task: Task, evaluate: _Evaluator, relaxing: EvaluateFor | None, counts: Counts, deadline: float | None
) -> Generator[int, None, tuple[Seen, int] | None]:
    """Search from landmark to landmark; where that gets stuck, or the amounts have to be counted, greedily from the beginning."""
    if relaxing is not None:
        effort = evaluate.effort

        def greedy(part: Task, one: Evaluate) -> Generator[int, None, tuple[Seen, int] | None]:
            return _best_first(part, _Evaluator(one, None, effort, 1), counts)

        found = yield from in_series(task, relaxing, effort.followed, greedy, deadline)
        if found is not None:
            return found
    return (yield from _best_first(task, evaluate, counts))


def ahead(task: Task, deadline: float | None = None) -> Callable[[int, Sequence[int]], Path]:
    """Return a function that carries out a relaxed plan as far as it goes, from a state: what is reached, and by which operators.

    Where no operator of it is applicable, one is replaced by an applicable one that brings about what it was to bring about for
    a later one or the goal: a truck that went north in the meantime comes from there. Else one is put in that brings about what
    others lack and only that: it drives back, so that the next can be loaded. Of several, that after which most goals hold once
    the rest was carried out as far as it goes.
    """

    @cache
    def setters() -> list[dict[int, None]]:
        found: list[dict[int, None]] = [{} for _ in range(task.size)]
        for bits, owner in zip(task.adds.lists(), task.owners, strict=True):
            for bit in bits:
                if owner >= 0:
                    found[bit][owner] = None
        return found

    @cache
    def set_by(operator: int) -> int:
        found = reduce(or_, (set_ for _, _, set_ in task.known(operator)[1]), 0)
        return found if task.amounts is None else found | task.amounts.compared & moved()[operator]

    @cache
    def moved() -> list[int]:
        found = [0] * len(task)
        for bits, owner in zip(task.adds.lists(), task.owners, strict=True):
            if owner >= 0:
                found[owner] |= sum(1 << bit for bit in bits)
        return found

    def replaced(state: int, stuck: list[int]) -> tuple[int, int, list[int]] | None:
        needed = [task.goal]  # by the goal and, from the last on, by the operators behind
        for operator in reversed(stuck):
            needed.append(needed[-1] | task.known(operator)[0])
        for i, operator in enumerate(stuck):
            for bit in bits_of(set_by(operator) & needed[-2 - i] & ~state):
                for other in setters()[bit]:
                    after = task.applied(state, other)
                    if after is not None and after >> bit & 1:
                        return after, other, stuck[:i] + stuck[i + 1 :]
        return None

    def in_turn(state: int, left: Sequence[int]) -> tuple[int, list[int], list[int]]:
        done, stuck = [], []
        for operator in left:
            if set_by(operator) & ~state:  # else it has nothing left to do
                after = task.applied(state, operator)
                if after is None:
                    stuck.append(operator)
                elif after != state:
                    state = after
                    done.append(operator)
        return state, done, stuck

    def enabling(state: int, stuck: list[int]) -> tuple[int, int, list[int]] | None:
        lacking = Counter(task.known(operator)[0] & ~state for operator in stuck)
        best: tuple[tuple[int, int], int, int] | None = None
        applicable = task.applicable(state)[0]
        single = [bits for bits, _ in lacking.most_common() if bits.bit_count() == 1]
        for bits in single[:ENABLING]:
            other = next((o for o in applicable if set_by(o) & bits), None)
            after = None if other is None else task.applied(state, other)
            if other is None or after is None:
                continue
            end, done, _ = in_turn(after, stuck)
            rank = (end & task.goal).bit_count(), len(done)
            if done and (best is None or rank > best[0]):
                best = rank, after, other
        return None if best is None else (best[1], best[2], stuck)

    def carried_out(state: int, relaxed_plan: Sequence[int]) -> Path:
        path: list[int] = []
        left = list(relaxed_plan)
        while True:
            state, done, stuck = in_turn(state, left)
            path += done
            if deadline is not None and perf_counter() > deadline:
                return state, path
            if not done:
                instead = replaced(state, stuck) or enabling(state, stuck)
                if instead is None:
                    return state, path
                state, operator, stuck = instead
                path.append(operator)
            left = stuck

    return carried_out

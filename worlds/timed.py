"""Random worlds with durative actions, and their least makespan by an exhaustive search over schedules.

A world is a table of actions on a few facts. An action has conditions and effects at its start, throughout or at its end, a
duration, and an actor. At each whole second, the search tries every applicable action in any order. The search uses neither
behaviours nor plans.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import permutations
from random import Random

from confab.planner.timed.plan import TimedPlan
from confab.reasoner.aggregates.compiling import compiled
from confab.reasoner.aggregates.totals import with_totals
from confab.reasoner.amounts import Amount, Quantity
from confab.reasoner.problem import Domain, Problem
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    Aggregate,
    AmountEffect,
    Behavior,
    Comparison,
    Condition,
    Effect,
    Parameter,
    SituationType,
    Span,
    Symbol,
    Times,
    Timing,
    ValueCondition,
    ValueEffect,
)
from confab.reasoner.timing import projected

LEVEL, NO_LIMIT = 1_000, 100
MOST_STATES = 20_000
"""Maximum number of states of an exhaustive search; a larger world is drawn again."""
SPANS = {"start": Span.START, "throughout": Span.THROUGHOUT, "end": Span.END}

Literal = tuple[int, bool]


@dataclass(frozen=True)
class Action:
    """The conditions and effects of an action: facts with their values, at its start, throughout and at its end.

    `adds` changes the level of the world at the start or end; `limits` are the least and the greatest level before the change.
    """

    seconds: int
    actor: int | None
    asks: tuple[tuple[str, Literal], ...]
    makes: tuple[tuple[str, Literal], ...]
    adds: tuple[tuple[str, int], ...] = ()
    limits: tuple[tuple[str, int, int], ...] = ()

    def at(self, span: str, of: str = "asks") -> list[Literal]:
        """Return the conditions or effects in a span."""
        return [literal for at, literal in getattr(self, of) if at == span]


@dataclass(frozen=True)
class TimedWorld:
    """Actions, initial facts, goal literals, literals that may never hold together, deadlines of goals, and windows of actors.

    A deadline is a goal's fact and a time; a window is an actor and two times. A state with the level n has the fact `LEVEL` + n;
    `levels` are the least and the greatest level.
    """

    facts: int
    actions: tuple[Action, ...]
    initial: frozenset[int]
    goal: tuple[Literal, ...]
    never: tuple[Literal, ...] = ()
    deadlines: tuple[tuple[int, int], ...] = ()
    windows: tuple[tuple[int, int, int], ...] = ()
    levels: tuple[int, int] | None = None

    @property
    def last(self) -> int:
        """The latest of all times that the world states."""
        return max([0, *(by for _, by in self.deadlines), *(high for *_, high in self.windows)])

    def kept(self, facts: frozenset[int], time: int) -> bool:
        """Return whether every goal with an expired deadline holds."""
        over = {fact for fact, by in self.deadlines if by <= time}
        return all((fact in facts) is value for fact, value in self.goal if fact in over)

    def available(self, action: Action, time: int) -> bool:
        """Return whether the actor of an action is available from a time to the action's end."""
        return all(
            low <= time and time + action.seconds <= high for actor, low, high in self.windows if actor == action.actor
        )


Running = tuple[int, int]
"""The number of a running action and the seconds until its end."""
State = tuple[frozenset[int], frozenset[Running]]


def timed_world(seed: int, constrained: bool = False, limited: bool = False, shared: bool = False) -> TimedWorld:
    """Return the random world of a seed.

    With `constrained`, two literals may never hold together; with `limited`, the world has deadlines and windows; with `shared`,
    actions take and give units of a shared amount.
    """
    rng = Random(seed)
    while True:
        world = _drawn(rng)
        if constrained:
            never = tuple((fact, rng.random() < 0.6) for fact in sorted(rng.sample(range(world.facts), 2)))
            world = replace(world, never=never)
        if limited:
            deadlines = tuple((fact, rng.randint(2, 9)) for fact, _ in world.goal if rng.random() < 0.7)
            lows = [(actor, rng.randint(0, 3)) for actor in (0, 1) if rng.random() < 0.6]
            windows = tuple((actor, low, low + rng.randint(2, 8)) for actor, low in lows)
            world = replace(world, deadlines=deadlines, windows=windows)
        if shared:
            first, levels = rng.randint(1, 3), (rng.choice((-NO_LIMIT, 0)), rng.choice((3, 4, NO_LIMIT)))
            actions = tuple(_sharing(rng, one) for one in world.actions)
            initial = world.initial | {LEVEL + first}
            world = replace(world, actions=actions, initial=initial, levels=levels)
        if not _hold(world.initial, list(world.goal)) and not _violated(world, world.initial):
            return world


def _sharing(rng: Random, action: Action) -> Action:
    """Return an action that borrows, takes, gives, or only requires units of the shared amount."""
    units, kind = rng.randint(1, 2), rng.choice(("borrow", "borrow", "borrow", "take", "give", "fill", "need", "none"))
    needs = ("start", units, NO_LIMIT)
    if kind == "borrow":
        return replace(action, actor=None, adds=(("start", -units), ("end", units)), limits=(needs,))
    if kind == "take":
        return replace(
            action, adds=((rng.choice(("start", "end")), -units),), limits=(needs,) if rng.random() < 0.7 else ()
        )
    if kind == "give":
        return replace(action, adds=((rng.choice(("start", "end")), units),), limits=())
    if kind == "fill":
        return replace(
            action, actor=None, adds=(("start", units), ("end", -units)), limits=(("start", -NO_LIMIT, 3 - units),)
        )
    return replace(action, limits=((rng.choice(("start", "end")), units, NO_LIMIT),)) if kind == "need" else action


def _counted(world: TimedWorld, facts: frozenset[int], action: Action, span: str) -> frozenset[int] | None:
    """Return the facts after an action has changed the level at its start or end, or None if this exceeds a limit."""
    if world.levels is None:
        return facts
    (level,) = (fact - LEVEL for fact in facts if fact >= LEVEL // 2)
    if not all(least <= level <= most for at, least, most in action.limits if at == span):
        return None
    after = level + sum(change for at, change in action.adds if at == span)
    return (facts - {LEVEL + level}) | {LEVEL + after} if world.levels[0] <= after <= world.levels[1] else None


def _violated(world: TimedWorld, facts: frozenset[int]) -> bool:
    """Return whether all literals that may never hold together hold at once."""
    return bool(world.never) and _hold(facts, list(world.never))


def _drawn(rng: Random) -> TimedWorld:
    facts = rng.randint(3, 5)

    def literals(most: int, spans: tuple[str, ...]) -> tuple[tuple[str, Literal], ...]:
        chosen = rng.sample(range(facts), min(rng.randint(0, most), facts))
        return tuple((rng.choice(spans), (fact, rng.random() < 0.6)) for fact in chosen)

    actions = []
    for _ in range(rng.randint(2, 4)):
        makes = list(literals(2, ("throughout", "end", "end", "start")))
        if not makes:
            makes = [("end", (rng.randrange(facts), True))]
        if rng.random() < 0.4:  # a fact that holds only during the action
            fact = rng.randrange(facts)
            makes = [one for one in makes if one[1][0] != fact]
            makes += [("start", (fact, True)), ("end", (fact, False))]
        taken = {literal for _, literal in makes}
        asks = [
            one
            for one in literals(3, ("start", "throughout", "throughout", "end"))
            if one[0] == "start" or not any(one[1][0] == fact for fact, _ in taken)
        ]
        actor = rng.choice((None, 0, 0, 1))
        actions.append(Action(rng.randint(1, 4), actor, tuple(asks), tuple(makes)))
    initial = frozenset(fact for fact in range(facts) if rng.random() < 0.3)
    goal = tuple((fact, rng.random() < 0.8) for fact in rng.sample(range(facts), rng.randint(1, 2)))
    return TimedWorld(facts, tuple(actions), initial, goal)


def least_makespan(world: TimedWorld) -> int | None:
    """Return the least makespan of all plans, or None if there is no plan.

    Raises
    ------
    MemoryError
        The world has too many states.
    """
    start: State = world.initial, frozenset()
    seen: set[tuple[State, int]] = set()
    queue: list[tuple[int, int, State]] = [(0, 0, start)]
    number = 0
    while queue:
        time, _, state = heapq.heappop(queue)
        if (state, min(time, world.last)) in seen:
            continue
        seen.add((state, min(time, world.last)))
        if len(seen) > MOST_STATES:
            raise MemoryError
        facts, running = state
        if not running and all((fact in facts) is value for fact, value in world.goal):
            return time
        for seconds, after in _next(world, state, time):
            if (after, min(time + seconds, world.last)) not in seen:
                number += 1
                heapq.heappush(queue, (time + seconds, number, after))
    return None


def _next(world: TimedWorld, state: State, time: int) -> Iterator[tuple[int, State]]:
    """Yield each successor with the seconds until the successor holds: an action begins (0), or a second passes (1)."""
    facts, running = state
    for number in range(len(world.actions)):
        after = _begun(world, facts, running, number)
        if after is not None and world.available(world.actions[number], time):
            yield 0, after
    if (running or time < world.last) and world.kept(facts, time):
        for order in permutations(sorted(number for number, left in running if left == 1)):
            passed = _passed(world, facts, running, order)
            if passed is not None:
                yield 1, passed


def _begun(world: TimedWorld, facts: frozenset[int], running: frozenset[Running], number: int) -> State | None:
    action = world.actions[number]
    if any(other == number for other, _ in running):
        return None
    if action.actor is not None and any(world.actions[other].actor == action.actor for other, _ in running):
        return None
    asked = action.at("start")
    begun = action.at("start", "makes")
    held = action.at("throughout")
    if _taken(world, running, [*asked, *begun, *held, *action.at("throughout", "makes")]):
        return None
    if not _hold(facts, asked):
        return None
    counted = _counted(world, facts, action, "start")
    if counted is None:
        return None
    after = _made(counted, begun)
    if not _hold(after, held) or not _kept(world, after, running) or _violated(world, after):
        return None
    return after, running | {(number, action.seconds)}


def _passed(
    world: TimedWorld, facts: frozenset[int], running: frozenset[Running], order: tuple[int, ...]
) -> State | None:
    """Return the state after one second in which actions end in an order, or None if an action can't end."""
    left = frozenset((number, seconds - 1) for number, seconds in running)
    for number in order:
        action = world.actions[number]
        left = frozenset(one for one in left if one[0] != number)
        facts = _made(facts, action.at("throughout", "makes"))
        asked, made = action.at("end"), action.at("end", "makes")
        if _taken(world, left, [*asked, *made]) or not _hold(facts, asked):
            return None
        counted = _counted(world, facts, action, "end")
        if counted is None:
            return None
        facts = _made(counted, made)
        if not _kept(world, facts, left) or _violated(world, facts):
            return None
    return facts, left


def _taken(world: TimedWorld, running: frozenset[Running], literals: list[Literal]) -> bool:
    """Return whether a running action changes one of the facts throughout its duration."""
    making = {fact for number, _ in running for fact, _ in world.actions[number].at("throughout", "makes")}
    return any(fact in making for fact, _ in literals)


def _kept(world: TimedWorld, facts: frozenset[int], running: frozenset[Running]) -> bool:
    """Return whether the invariant conditions of all running actions hold."""
    return all(_hold(facts, world.actions[number].at("throughout")) for number, _ in running)


def _hold(facts: frozenset[int], literals: list[Literal]) -> bool:
    return all((fact in facts) is value for fact, value in literals)


def _made(facts: frozenset[int], literals: list[Literal]) -> frozenset[int]:
    false = {fact for fact, value in literals if not value}
    true = {fact for fact, value in literals if value}
    return (facts - false) | true


def problem_of(world: TimedWorld) -> Problem:
    """Return a world as a planning problem with one behaviour for each action; the behaviour names its actor."""
    situations = {f"F{i}": SituationType(f"F{i}", ("Thing",), "Truth", boolean=True) for i in range(world.facts)}
    behaviors = {}
    for number, action in enumerate(world.actions):
        asked: tuple[tuple[Span, Condition], ...] = tuple(
            (SPANS[span], ValueCondition(f"F{fact}", ("it",), TRUE if value else FALSE))
            for span, (fact, value) in action.asks
        )
        made = tuple(
            (SPANS[span], ValueEffect(f"F{fact}", ("it",), TRUE if value else FALSE))
            for span, (fact, value) in action.makes
        )
        asked += tuple(
            (SPANS[span], Comparison(Amount("N", ()), operator, Fraction(number)))
            for span, least, most in action.limits
            for operator, number in ((">=", least), ("<=", most))
            if abs(number) < NO_LIMIT
        )
        every: tuple[tuple[Span, Effect], ...] = (
            *made,
            *(
                (SPANS[span], AmountEffect("N", (), "increase" if change > 0 else "decrease", Fraction(abs(change))))
                for span, change in action.adds
            ),
        )
        conditions, effects = projected(asked, every)
        actors = () if action.actor is None else (f"actor{action.actor}",)
        behaviors[f"A{number}"] = Behavior(
            f"A{number}",
            1,
            (),
            (),
            conditions,
            tuple(e for e in effects if isinstance(e, ValueEffect)),
            amounts=tuple(e for e in effects if isinstance(e, AmountEffect)),
            timing=Timing(Fraction(action.seconds), actors, asked, every),
        )
    classes = {"Thing": ("it",), "Actor0": ("actor0",), "Actor1": ("actor1",)}
    initial = {Symbol(f"F{fact}", ("it",)): TRUE for fact in sorted(world.initial) if fact < LEVEL // 2}
    if world.levels is not None:
        least, most = (None if abs(one) == NO_LIMIT else Fraction(one) for one in world.levels)
        situations["N"] = SituationType("N", (), "N", quantity=Quantity(least=least, most=most))
        initial |= {Symbol("N", ()): str(fact - LEVEL) for fact in world.initial if fact >= LEVEL // 2}
    goal = {Symbol(f"F{fact}", ("it",)): TRUE if value else FALSE for fact, value in sorted(world.goal)}
    domain = Domain(situations, behaviors)
    if world.never:
        together = tuple(ValueCondition(f"F{fact}", ("it",), TRUE if value else FALSE) for fact, value in world.never)
        count = Aggregate("E", "count", Fraction(1), (), (Parameter("?it", "Thing"),), together)
        situations["E"] = SituationType("E", (), "E", quantity=Quantity(whole=True, most=Fraction(0)))
        domain = compiled(replace(domain, aggregates={"E": count}), classes)
        initial = with_totals(domain, classes, {}, initial)
    deadlines = {Symbol(f"F{fact}", ("it",)): Fraction(by) for fact, by in world.deadlines}
    windows = {f"actor{actor}": ((Fraction(low), Fraction(high)),) for actor, low, high in world.windows}
    times = Times(deadlines, windows) if deadlines or windows else None
    return Problem("urn:timed", domain, classes, {}, initial, goal, times=times)


def rejected(world: TimedWorld, timed: TimedPlan) -> str | None:
    """Return the fault of a timed plan in a world, found without the code of the plan checkers, or None if the plan is valid."""
    if any(slot.begin.denominator != 1 for slot in timed.slots):
        return "a step begins between two seconds"
    for slot in timed.slots:
        if not world.available(world.actions[int(slot.step.behavior[1:])], int(slot.begin)):
            return f"the actor of {slot.step} isn't available at {slot.begin} s"
    facts, running = world.initial, frozenset[Running]()
    begins: dict[int, list[int]] = {}
    for slot in timed.slots:
        begins.setdefault(int(slot.begin), []).append(int(slot.step.behavior[1:]))
    states: set[State] = {(facts, running)}
    for second in range(int(timed.makespan) + 1):
        if second:
            states = {
                after
                for facts, running in states
                for order in permutations(sorted(number for number, left in running if left == 1))
                if (after := _passed(world, facts, running, order)) is not None
            }
        ways = list(permutations(begins.get(second, [])))
        states = {end for state in states for way in ways if (end := _all_begun(world, state, way)) is not None}
        states = {state for state in states if world.kept(state[0], second)}
        if not states:
            return f"what begins or ends at {second} s can't, or a deadline is missed"
    if not any(not running and _hold(facts, list(world.goal)) for facts, running in states):
        return "the goal isn't reached"
    return None


def _all_begun(world: TimedWorld, state: State, numbers: tuple[int, ...]) -> State | None:
    for number in numbers:
        after = _begun(world, *state, number)
        if after is None:
            return None
        state = after
    return state

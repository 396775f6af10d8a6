"""Random problems with numbers, and their transitions in plain Python for an exhaustive search.

In `jugs`, water is filled in, poured away, and poured over as far as it fits, until jugs hold the goal amounts. In `rounds`, a
van with a capacity delivers parcels, and a drive costs its length times the load.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator
from fractions import Fraction
from random import Random
from typing import Any, TypeAlias

from confab.reasoner.amounts import Amount, Calculation, Expression, Measure, Quantity, written
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import AmountEffect, Behavior, Comparison, EqualityCondition, Parameter, SituationType
from worlds.writing import becomes, has, world

State: TypeAlias = Any
"""A hashable state."""
Next: TypeAlias = "Callable[[State], Iterator[tuple[Fraction, State]]]"
"""Function that yields the cost and the successor of each transition of a state."""


def cheapest(start: State, after: Next, wanted: Callable[[State], bool]) -> Fraction | None:
    """Return the least cost of a path to a goal state, or None if no goal state is reachable."""
    best, waiting, count = {start: Fraction(0)}, [(Fraction(0), 0, start)], 0
    while waiting:
        spent, _, state = heapq.heappop(waiting)
        if spent > best[state]:
            continue
        if wanted(state):
            return spent
        for cost, other in after(state):
            if other not in best or spent + cost < best[other]:
                best[other] = spent + cost
                count += 1
                heapq.heappush(waiting, (spent + cost, count, other))
    return None


def jugs(rng: Random) -> tuple[Problem, Fraction | None]:
    """Return a random problem of jugs, and the length of a shortest plan or None."""
    names = [f"jug{i}" for i in range(rng.choice((2, 2, 3)))]
    sizes = {name: Fraction(rng.choice((3, 4, 5, 6, 7, 9)), rng.choice((1, 1, 2))) for name in names}
    first = {name: rng.choice((Fraction(0), sizes[name])) for name in names}
    tap = rng.random() < 0.7
    goals = {
        name: Fraction(rng.randrange(0, 7), rng.choice((1, 2))) for name in rng.sample(names, rng.choice((1, 1, 2)))
    }
    jug, other = Parameter("?a", "Jug"), Parameter("?b", "Jug")
    size_a, size_b, a, b = (
        Measure("size", ("?a",)),
        Measure("size", ("?b",)),
        Amount("WATER", ("?a",)),
        Amount("WATER", ("?b",)),
    )
    room, two = Calculation("-", size_b, b), EqualityCondition("?a", "?b", negated=True)

    def moves(amount: Expression) -> tuple[AmountEffect, ...]:
        return AmountEffect("WATER", ("?a",), "decrease", amount), AmountEffect("WATER", ("?b",), "increase", amount)

    behaviors = [
        Behavior("POUR_ALL", 1, (jug, other), (), (two, Comparison(a, "<=", room)), amounts=moves(a)),
        Behavior("POUR_SOME", 1, (jug, other), (), (two, Comparison(a, ">", room)), amounts=moves(room)),
        Behavior("AWAY", 1, (jug,), amounts=(AmountEffect("WATER", ("?a",), "scale", Fraction(0)),)),
    ]
    if tap:
        behaviors.append(Behavior("FILL", 1, (jug,), amounts=(AmountEffect("WATER", ("?a",), "assign", size_a),)))
    problem = world(
        [SituationType("WATER", ("Jug",), "WATER", quantity=Quantity("l", least=Fraction(0)))], behaviors,
        {"Jug": tuple(names)}, {f"WATER {name}": written(first[name]) for name in names},
        {f"WATER {name}": rng.choice(("", ">=")) + written(goals[name]) for name in goals},
        {"size": [(name, written(sizes[name])) for name in names]},
    )  # fmt: skip
    asked = {symbol.arguments[0]: value for symbol, value in problem.goal.items()}

    def after(state: State) -> Iterator[tuple[Fraction, State]]:
        now = dict(zip(names, state, strict=True))
        for one in names:
            for level in (Fraction(0), *([sizes[one]] if tap else [])):
                yield Fraction(1), tuple({**now, one: level}.values())
            for into in names:
                if into != one:
                    flows = min(now[one], sizes[into] - now[into])
                    yield Fraction(1), tuple({**now, one: now[one] - flows, into: now[into] + flows}.values())

    def wanted(state: State) -> bool:
        now = dict(zip(names, state, strict=True))
        return all(
            now[name] >= goals[name] if text[0] == ">" else now[name] == goals[name] for name, text in asked.items()
        )

    return problem, cheapest(tuple(first.values()), after, wanted)


def rounds(rng: Random) -> tuple[Problem, Fraction | None]:
    """Return a random problem of a van, and the least cost of a plan; some roads are missing or have a negative length."""
    places, names, most = (
        ("yard", "north", "south", "hill"),
        tuple(f"parcel{i}" for i in range(rng.choice((1, 2, 3)))),
        4,
    )
    ways = {(x, y): rng.choice((-1, 1, 2, 3, 5, 8)) for x in places for y in places if x != y and rng.random() < 0.8}
    weights = {name: rng.choice((1, 2, 3)) for name in names}
    first = (rng.choice(places), tuple(rng.choice(places) for _ in names))
    goal = tuple(rng.choice(places) for _ in names)
    to, parcel, here = Parameter("?to", "PLACE"), Parameter("?p", "Parcel"), Parameter("?from", "PLACE")
    price = Calculation("*", Measure("WAY", ("?from", "?to")), Calculation("+", Fraction(1), Amount("LOAD", ("van",))))
    at, asked = has("PLACE", "van", "?from"), Comparison(price, ">=", Fraction(0))
    more, less = (AmountEffect("LOAD", ("van",), how, Measure("weight", ("?p",))) for how in ("increase", "decrease"))
    behaviors = [
        Behavior("DRIVE", 1, (to,), (here,), (at, asked), (becomes("PLACE", "van", "?to"),), price=price),
        Behavior(
            "TAKE", 1, (parcel,), (here,), (at, has("IN", "?p", "?from")), (becomes("IN", "?p", "van"),), 0.5, (more,)
        ),
        Behavior(
            "GIVE", 1, (parcel,), (here,), (at, has("IN", "?p", "van")), (becomes("IN", "?p", "?from"),), 0.5, (less,)
        ),
    ]
    quantity = Quantity("kg", least=Fraction(0), most=Fraction(most))
    problem = world(
        [SituationType("PLACE", ("Van",), "PLACE"), SituationType("IN", ("Parcel",), "IN"),
         SituationType("LOAD", ("Van",), "LOAD", quantity=quantity)], behaviors,
        {"Van": ("van",), "Parcel": names, "PLACE": places, "IN": (*places, "van")},
        {"PLACE van": first[0], "LOAD van": "0", **{f"IN {name}": where for name, where in zip(names, first[1], strict=True)}},
        {f"IN {name}": where for name, where in zip(names, goal, strict=True)},
        {"WAY": [(*way, str(length)) for way, length in ways.items()], "weight": [(n, str(w)) for n, w in weights.items()]},
    )  # fmt: skip

    def after(state: State) -> Iterator[tuple[Fraction, State]]:
        van, parcels = state
        load = sum(weights[name] for name, where in zip(names, parcels, strict=True) if where == "van")
        for place in places:
            if ways.get((van, place), -1) >= 0:
                yield Fraction(ways[van, place] * (1 + load)), (place, parcels)
        for i, name in enumerate(names):
            if parcels[i] == van and load + weights[name] <= most:
                yield Fraction(1, 2), (van, (*parcels[:i], "van", *parcels[i + 1 :]))
            if parcels[i] == "van":
                yield Fraction(1, 2), (van, (*parcels[:i], van, *parcels[i + 1 :]))

    return problem, cheapest(first, after, lambda state: state[1] == goal)

"""Comparison of the part of a scene that task recognition selects with the whole scene, by exhaustive search of both.

The planner hides a part that is too small: it checks each plan in the whole scene, and searches again in the whole scene if the
plan is refused or if the part has no plan. Therefore the part itself is compared.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from confab.reasoner.aggregates.dependencies import read_by
from confab.reasoner.amounts import situations_in
from confab.reasoner.language import situations_of, walk
from confab.reasoner.symbols import Problem, Symbol
from worlds.interpreter import Interpreter, State


def difference(meant: Interpreter, part: Interpreter, most: int) -> str:
    """Return the difference between a world and a part of the world, for the goal of the world; an empty text if there is none.

    On each level, the part must have the same least cost of the goal. The symbols of the part on which the goal depends must get
    the same combinations of values, with the same least costs.

    Raises
    ------
    TooManyStatesError
        The world or the part has more than `most` nodes.
    """
    if missing := sorted({*meant.problem.goal.items()} ^ {*part.problem.goal.items()}):
        return f"the goals differ: {missing}"
    kinds = relevant(meant.problem)
    symbols = [symbol for symbol in part.symbols if symbol.situation in kinds]
    for level in meant.problem.domain.levels:
        costs = [_costs(one, one.explored(level, most, rests=False).costs, symbols) for one in (meant, part)]
        if costs[0] != costs[1]:
            state, cost = min({*costs[0].items()} ^ {*costs[1].items()}, key=lambda item: float(item[1]))
            first = [meant.value(meant.initial, symbol) for symbol in symbols]
            changed = {s: v for s, v, old in zip(symbols, state, first, strict=True) if v != old}
            of = [one.get(state, "not reached") for one in costs]
            return f"level {level}: {changed} costs {of[0]}, in the part {of[1]}; least of both {cost}"
        least = [one.explored(level, most).least for one in (meant, part)]
        if least[0] != least[1]:
            return f"level {level}: the goal costs {least[0]}, in the part {least[1]}"
    return ""


def _costs(of: Interpreter, costs: Mapping[Any, Any], symbols: Iterable[Symbol]) -> dict[State, Any]:
    """Return the least cost of each reachable combination of the symbols' values."""
    found: dict[State, Any] = {}
    for (state, _), cost in costs.items():
        key = tuple("nothing" if (v := of.value(state, s)) is None or v != v else v for s in symbols)
        found[key] = min(cost, found.get(key, cost))
    return found


def relevant(problem: Problem) -> set[str]:
    """Return the situation types on which the goal depends, by behaviours, definitions, and bounds of sums and counts."""
    domain = problem.domain
    uses: list[tuple[frozenset[str], set[str]]] = []
    for doing in (*domain.behaviors.values(), *(rule.behavior for rules in domain.rules.values() for rule in rules)):
        asked = {s for one in doing.conditions for inner in walk(one) for s in situations_of(inner)}
        uses.append((doing.changes, asked.union(doing.changes, *(situations_in(e.amount) for e in doing.amounts))))
    uses += [(frozenset({name}), {name, *read_by(one)}) for name, one in domain.aggregates.items()]
    uses += [(frozenset({name}), {name, source}) for name, source in domain.remembers.items()]

    def closed(found: set[str], of: Sequence[tuple[frozenset[str], set[str]]]) -> set[str]:
        before = set[str]()
        while before != found:
            before, found = found, found.union(*(used for changes, used in of if changes & found))
        return found

    definitions = uses[len(domain.behaviors) :]
    bounded = {one.situation for one in domain.constraints.values()}
    bounded |= {name for name in domain.aggregates if (q := domain.situations[name].quantity) is not None and q.bounded}
    below = {name: closed({name}, definitions) for name in bounded}
    found, before = {symbol.situation for symbol in problem.goal}, set[str]()
    while before != found:
        before, found = found, closed(found, uses)
        changed = set().union(*(one.changes for one in domain.behaviors.values() if one.changes & found))
        found |= {name for name, its in below.items() if its & changed}
    return found

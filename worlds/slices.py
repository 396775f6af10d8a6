"""Comparison of the part of a scene that task recognition selects with the whole scene, by exhaustive search of both.

The planner hides a part that is too small: it checks each plan in the whole scene, and searches again in the whole scene if the
plan is refused or if the part has no plan. Therefore the part itself is compared.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from unittest.mock import patch

from confab.reasoner.aggregates.dependencies import read_by
from confab.reasoner.amounts import situations_in
from confab.reasoner.graph.knowledge import KnowledgeGraph
from confab.reasoner.language import situations_of, walk
from confab.reasoner.problem import Problem
from confab.reasoner.reading import relevance
from confab.reasoner.reading.problem import Reading
from worlds.interpreter import Interpreter, State, TooManyStatesError


@dataclass(frozen=True)
class Slice:
    """A comparison of the part of a scene that task recognition selects for `goals`, by few `queries`, with the whole scene.

    `meant` is the interpreter of the whole scene. `states` and `most` are parameters of `difference`.
    """

    knowledge: KnowledgeGraph
    goals: Sequence[str]
    queries: int
    meant: Interpreter
    states: Sequence[State]
    most: int

    def part(self) -> Reading:
        """Return the part of the scene that task recognition selects."""
        with patch.object(relevance, "ROUNDS", self.queries):
            return relevance.recognise(self.knowledge, self.goals)

    def wrong(self, part: Reading) -> str:
        """Return the difference between a part and the whole scene; an empty text if there is none."""
        return "" if part.whole else difference(self.meant, Interpreter(part.problem), self.states, self.most)


def difference(meant: Interpreter, part: Interpreter, states: Sequence[State], most: int) -> str:
    """Return the difference between a world and a part of the world, for the goal of the world; an empty text if there is none.

    In each of the given states, each behaviour of the part must do the same as in the world, and no other behaviour may change the
    part, as far as the goal depends on it. On each level, the part must have the same least cost of the goal, unless the world or
    the part has more than `most` nodes.
    """
    if missing := sorted({*meant.problem.goal.items()} ^ {*part.problem.goal.items()}):
        return f"the goals differ: {missing}"
    kinds = relevant(meant.problem)
    symbols = [symbol for symbol in part.symbols if symbol.situation in kinds]

    def seen(by: Interpreter, state: State) -> State:
        values = (by.value(state, symbol) for symbol in symbols)
        return tuple("nothing" if value is None or value != value else value for value in values)

    for level in meant.problem.domain.levels:
        actions = [one for one in meant.actions(level) if one.behavior.changes & kinds]
        own = {(one.behavior.name, one.arguments) for one in part.actions(level)}
        for state in states:
            values = [meant.value(state, symbol) for symbol in part.symbols[: part.stated]]
            values += part.initial[part.stated :]
            inside, before = part.closed(values), seen(meant, state)
            if seen(part, inside) != before:
                return f"level {level}: the derived values differ in {state}"
            for one in actions:
                key = one.behavior.name, one.arguments
                after = {(cost, seen(meant, made)) for cost, made in meant.done(*key, state)}
                ours = {(cost, seen(part, made)) for cost, made in part.done(*key, inside)} if key in own else after
                if ours != after or (key not in own and any(made != before for _, made in after)):
                    which = "differs" if key in own else "is missing and changes the part"
                    return f"level {level}: {key} {which} in {dict(zip(symbols, before, strict=True))}"
        with suppress(TooManyStatesError):
            least = [by.explored(level, most).least for by in (meant, part)]
            if least[0] != least[1]:
                return f"level {level}: the goal costs {least[0]}, in the part {least[1]}"
    return ""


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

"""Enumeration of reachable states without code of the planner, as the reference for random tables.

The plan checker's interpreter (`confab.planner.validation.BehaviorReader`) computes the effects of behaviours. For every
combination of values of the symbols that the interpreter reads, the interpreter is called once. The results form a decision
tree for each grounded behaviour, by which arrays of states are processed.

A *code* is a state as one integer, with a field of bits for each symbol. A *tree* maps the values of a symbol to trees; a leaf
contains the assigned values, or is None if the behaviour isn't applicable.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from confab.planner.validation import BehaviorReader, LoggedState
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import FALSE, TRUE, AnyOf, Behavior, Condition, Symbol, ValueCondition, Witness

Codes = NDArray[np.uint64]
UNSEEN, DEAD, ALIVE = 0, 1, 2
FEW = 200


class TooManyError(Exception):
    """Raised when there are more states than allowed, or when a state needs more than 63 bits."""


@dataclass
class Truth:
    """The number of reachable `states`, and in `shortest` the length of a shortest plan or None."""

    states: int
    shortest: int | None


class Asked(LoggedState):
    """A state that records the symbols that are read."""

    def __init__(self, problem: Problem, values: dict[Symbol, str]) -> None:
        super().__init__(problem, values)
        self.values, self.looked = values, dict[Symbol, str]()

    def value(self, situation: str, arguments: tuple[str, ...]) -> str | None:
        """Return a symbol's value, and record the symbol."""
        symbol = Symbol(situation, arguments)
        if symbol in self.values:
            self.looked.setdefault(symbol, self.values[symbol])
        return super().value(situation, arguments)

    def holders(self, situation: str, value: str) -> Iterator[tuple[str, ...]]:
        """Yield the arguments of the symbols with a value, and record each symbol that is read."""
        for symbol in self.values:
            if symbol.situation == situation and self.value(situation, symbol.arguments) == value:
                yield symbol.arguments


@dataclass
class Node:
    """A node of a decision tree, with the symbol that the interpreter reads next and a tree for each value of the symbol."""

    symbol: int
    known: NDArray[np.int8]
    after: dict[int, Any] = field(default_factory=dict)


class StateSpace:
    """The states of the lowest level of a problem, encoded in 63 bits."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        level = problem.domain.levels[-1]
        situations = problem.domain.situations
        behaviors = problem.domain.at_level(level)
        changing = {effect.situation for behavior in behaviors for effect in behavior.effects}
        state = dict(problem.initial)
        for situation in situations.values():
            if situation.boolean:
                for arguments in product(*(problem.classes.get(kind, ()) for kind in situation.arguments)):
                    state.setdefault(Symbol(situation.name, arguments), FALSE)
        self.fixed = {symbol: value for symbol, value in state.items() if symbol.situation not in changing}
        self.symbols = [symbol for symbol in state if symbol.situation in changing]
        self.values, self.shifts, self.widths, bits = [], [], [], 0
        for symbol in self.symbols:
            situation = situations[symbol.situation]
            members = (FALSE, TRUE) if situation.boolean else problem.classes.get(situation.range, ())
            self.values.append(list(dict.fromkeys((state[symbol], *members))))
            width = max((len(self.values[-1]) - 1).bit_length(), 1)
            self.shifts.append(np.uint64(bits))
            self.widths.append(np.uint64((1 << width) - 1))
            bits += width
        if bits > 63:
            raise TooManyError(f"a state takes {bits} bits")
        self.places = [(int(shift), int(mask)) for shift, mask in zip(self.shifts, self.widths, strict=True)]
        self.number = {symbol: i for i, symbol in enumerate(self.symbols)}
        self.ranks = [{value: rank for rank, value in enumerate(values)} for values in self.values]
        self.steps: list[tuple[Behavior, tuple[str, ...]]] = [
            (ordered, arguments)
            for behavior in behaviors
            for ordered in [replace(behavior, preconditions=tuple(sorted(behavior.preconditions, key=_breadth)))]
            for arguments in product(*(problem.classes.get(p.kind, ()) for p in behavior.parameters))
        ]
        self.rules = BehaviorReader(problem)
        self.trees: list[Any] = [UNSEEN] * len(self.steps)

    def field(self, codes: Codes, symbol: int) -> NDArray[np.int64]:
        """Return the index of a symbol's value in each state."""
        return ((codes >> self.shifts[symbol]) & self.widths[symbol]).astype(np.int64)

    def explore(self, most: int) -> Truth:
        """Visit all reachable states, and return their number and the length of a shortest plan."""
        layer: Codes = np.zeros(1, np.uint64)
        known, depth, shortest = layer, 0, None
        while len(layer):
            if shortest is None and self.wanted(layer).any():
                shortest = depth
            fields = [self.field(layer, i) for i in range(len(self.symbols))]
            found = [after for number in range(len(self.steps)) for after in self.do(number, layer, fields)]
            new = np.sort(np.concatenate(found)) if found else layer[:0]
            new = new[np.concatenate([[True], new[1:] != new[:-1]])] if len(new) else new
            places = np.searchsorted(known, new)
            fresh = known[np.minimum(places, len(known) - 1)] != new
            layer = new[fresh]
            known = np.insert(known, places[fresh], layer)
            depth += 1
            if len(known) > most:
                raise TooManyError(f"more than {most} states")
        return Truth(len(known), shortest)

    def wanted(self, codes: Codes) -> NDArray[np.bool_]:
        """Return for each state whether the goal holds."""
        fits = np.ones(len(codes), np.bool_)
        for symbol, value in self.problem.goal.items():
            if symbol in self.number:
                i = self.number[symbol]
                fits &= self.field(codes, i) == self.ranks[i].get(value, -1)
            else:
                fits &= self.fixed.get(symbol, FALSE) == value
        return fits

    def do(self, number: int, codes: Codes, fields: list[NDArray[np.int64]]) -> Iterator[Codes]:
        """Yield the successors, by a grounded behaviour, of the states in which the behaviour is applicable."""
        if self.trees[number] is UNSEEN:
            self.trees[number] = self.grown(number, UNSEEN, codes[0])
        waiting: list[tuple[Any, NDArray[np.int64] | None]] = [(self.trees[number], None)]
        while waiting:
            tree, rows = waiting.pop()
            if tree is None:
                continue
            if not isinstance(tree, Node):
                kept, given = tree
                yield ((codes if rows is None else codes[rows]) & kept) | given
                continue
            ranks = fields[tree.symbol] if rows is None else fields[tree.symbol][rows]
            state = tree.known[ranks]
            if not state.all():
                for rank in set(ranks[state == UNSEEN].tolist()):
                    row = int((ranks == rank).argmax())
                    self.grown(number, self.trees[number], codes[row if rows is None else rows[row]])
                state = tree.known[ranks]
            alive = (state == ALIVE).nonzero()[0]
            if not len(alive):
                continue
            ranks = ranks[alive]
            rows = alive if rows is None else rows[alive]
            present = set(ranks.tolist()) if len(ranks) < FEW else set(np.unique(ranks).tolist())
            for rank in sorted(present):
                waiting.append((tree.after[rank], rows if len(present) == 1 else rows[ranks == rank]))

    def grown(self, number: int, tree: Any, code: np.uint64) -> Any:
        """Call the interpreter for one state, and return the tree extended by the result."""
        ranks = [(int(code) >> shift) & mask for shift, mask in self.places]
        asked = Asked(self.problem, {s: self.values[i][ranks[i]] for i, s in enumerate(self.symbols)} | self.fixed)
        changes = self.rules.changes(*self.steps[number], asked)
        leaf = None
        if changes is not None:
            kept, given = 2**64 - 1, 0
            for situation, arguments, value in changes:
                i = self.number[Symbol(situation, arguments)]
                mask = int(self.widths[i]) << int(self.shifts[i])
                kept, given = kept & ~mask, given & ~mask | self.ranks[i][value] << int(self.shifts[i])
            leaf = np.uint64(kept), np.uint64(given)
        path = [self.number[symbol] for symbol in asked.looked if symbol in self.number]
        root: Any = leaf
        place: Node | None = None
        rank = 0
        for position, i in enumerate(path):
            if not isinstance(tree, Node):
                tree = Node(i, np.zeros(len(self.values[i]), np.int8))
                if place is not None:
                    place.after[rank] = tree
            assert tree.symbol == i, "the interpreter looks elsewhere in the same state"
            root = tree if position == 0 else root
            place, rank = tree, ranks[i]
            place.known[rank] = DEAD if leaf is None and position == len(path) - 1 else ALIVE
            tree = place.after.get(rank, UNSEEN)
        if place is not None and leaf is not None:
            place.after[rank] = leaf
        return root


def _breadth(condition: Condition) -> int:
    """Return a rank of conditions by the number of symbols that they read, for the order of a conjunction."""
    return 2 * isinstance(condition, Witness | AnyOf) + isinstance(condition, ValueCondition)

"""Transitions by quantified behaviours; a state is a tuple of values in the order of `Model.symbols`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import product

from confab.planner.derived_facts import CompiledRules
from confab.planner.transitions import Forward, PythonWriter, Table, key_of
from confab.reasoner.amounts import Number
from confab.reasoner.limits import check_listed, checked
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import FALSE, GroundBehavior, State, Symbol

Values = tuple[str, ...]


@dataclass(frozen=True)
class Applied:
    """An applied quantified behaviour, the individuals of its variables, and the state after the behaviour."""

    ground: GroundBehavior
    bindings: Mapping[str, str]
    after: Values


class Model:
    """The behaviours of a problem as functions of tuples of values: of stated and boolean symbols, and defined goals."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.defined = tuple(sorted(s for s in problem.goal if s.situation in problem.domain.rules))
        self.symbols = (*_symbols(problem), *self.defined)
        self.first_levels = tuple(map(problem.first_level, self.symbols))
        stated = self.symbols[: len(self.symbols) - len(self.defined)]
        self.cells = [(symbol.situation, key_of(symbol.arguments)) for symbol in stated]
        self.index = {cell: i for i, cell in enumerate(self.cells)}
        self.writer = PythonWriter(problem)
        self.here = tuple(problem.initial.get(symbol, FALSE) for symbol in stated)
        self.table = Table(problem.domain.situations, dict(zip(stated, self.here, strict=True)))
        if problem.domain.rules:
            CompiledRules(self.writer).define(self.table)
        lines = [line for b in problem.domain.behaviors.values() for line in self.writer.forward(b)]
        lines += [line for b in problem.domain.behaviors.values() for line in self.writer.priced(b)]
        bind = self.writer.function(["forward, prices = {}, {}", *lines], "(forward, prices)")
        self.forward: Mapping[str, Forward]
        self.prices: Mapping[str, Callable[..., Number]]
        self.forward, self.prices = bind(self.table.now, self.table.holders)

    def values(self, state: State) -> Values:
        """Return a state as a tuple of values."""
        return self.completed(tuple(state.get(symbol, FALSE) for symbol in self.symbols[: len(self.cells)]))

    def state(self, values: Values) -> dict[Symbol, str]:
        """Return a tuple of values as a state."""
        return dict(zip(self.symbols[: len(self.cells)], values, strict=False))

    def completed(self, stated: Values) -> Values:
        """Return the values of the stated symbols, followed by the values of the goal's defined symbols."""
        if not self.defined:
            return stated
        self._move(stated)
        return (*stated, *(self.table.now[s.situation].get(key_of(s.arguments), FALSE) for s in self.defined))

    def _move(self, values: Values) -> None:
        """Set the table to the state `values`."""
        for cell, old, new in zip(self.cells, self.here, values, strict=False) if values is not self.here else ():
            if old != new:
                self.table.put(*cell, new)
        self.here = values
        self.table.trail.clear()

    def apply(self, ground: GroundBehavior, values: Values) -> Applied | None:
        """Return the application of a quantified behaviour in a state, or None if the behaviour isn't applicable."""
        self._move(values)
        done = self.forward[ground.behavior](*ground.arguments)
        if done is None:
            return None
        after = list(values[: len(self.cells)])
        for situation, key, value in done[1]:
            if (situation, key) in self.index:
                after[self.index[situation, key]] = value
        bindings = dict(zip(self.writer.variables[ground.behavior], done[0], strict=True))
        return Applied(ground, bindings, self.completed(tuple(after)))

    def cost(self, values: Values, applied: Applied) -> float:
        """Return the cost of a behaviour that is applied in the state `values`."""
        name = applied.ground.behavior
        if name not in self.prices:
            return self.problem.domain.behaviors[name].cost
        self._move(values[: len(self.cells)])
        variables = [applied.bindings[variable] for variable in self.writer.variables[name]]
        return float(self.prices[name](*applied.ground.arguments, *variables))

    def successors(self, grounds: Iterable[GroundBehavior], values: Values) -> Iterator[Applied]:
        """Yield, in the order of `grounds`, the application of each behaviour that is applicable and changes the state."""
        for ground in grounds:
            applied = self.apply(ground, values)
            if applied is not None and applied.after != values:
                yield applied


def _symbols(problem: Problem) -> tuple[Symbol, ...]:
    """Return the symbols of the problem in a fixed order, without defined symbols."""
    found = set(problem.initial)
    for situation in problem.domain.situations.values():
        if situation.boolean and situation.name not in problem.domain.rules:
            kinds = (problem.classes.get(kind, ()) for kind in situation.arguments)
            found |= {Symbol(situation.name, arguments) for arguments in product(*kinds)}
    return tuple(sorted(found))


def ground(problem: Problem, level: int) -> tuple[GroundBehavior, ...]:
    """Return all quantified behaviours of a level in the order of their IDs, as the SPARQL queries of quantification do.

    Raises
    ------
    LimitError
        The deadline has passed, or the level has too many quantified behaviours for a list.
    """
    check_listed(problem.quantified(level), f"quantified behaviours of level {level}")
    number = problem.domain.first_ids.get(level, 0)
    found: list[GroundBehavior] = []
    for behavior in problem.domain.at_level(level):
        every = product(*(problem.classes.get(parameter.kind, ()) for parameter in behavior.parameters))
        for arguments in checked(every, f"quantifying {behavior.name}"):
            found.append(GroundBehavior(number + len(found), behavior.name, arguments))
    return tuple(found)

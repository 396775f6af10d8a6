"""What each quantified behaviour makes of a state: a tuple of values, one per symbol, in the order of `Model.symbols`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

from planner.transitions import Forward, Table, Writer, key_of
from reasoner.symbols import FALSE, GroundBehavior, Problem, State, Symbol

Values = tuple[str, ...]


@dataclass(frozen=True)
class Applied:
    """A ground behaviour that is applicable, the individuals of its variables, and the state that it leads to."""

    ground: GroundBehavior
    bindings: Mapping[str, str]
    after: Values


class Model:
    """The behaviours of one problem over states that are tuples.

    Parameters
    ----------
    problem : Problem
        Its `initial` gives the symbols; boolean symbols are completed.
    """

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.symbols = _symbols(problem)
        self.first_levels = tuple(map(problem.first_level, self.symbols))
        self.cells = [(symbol.situation, key_of(symbol.arguments)) for symbol in self.symbols]
        self.index = {cell: i for i, cell in enumerate(self.cells)}
        self.writer = Writer(problem)
        self.here = self.values(problem.initial)
        self.table = Table(problem.domain.situations, self.state(self.here))
        lines = [line for b in problem.domain.behaviors.values() for line in self.writer.forward(b)]
        bind = self.writer.function(["forward = {}", *lines], "forward")
        self.forward: Mapping[str, Forward] = bind(self.table.now, self.table.who)

    def values(self, state: State) -> Values:
        """Return a state as the tuple that search works on."""
        return tuple(state.get(symbol, FALSE) for symbol in self.symbols)

    def state(self, values: Values) -> dict[Symbol, str]:
        """Return a tuple of values as a state."""
        return dict(zip(self.symbols, values, strict=True))

    def apply(self, ground: GroundBehavior, values: Values) -> Applied | None:
        """Return what a ground behaviour does in a state, or None if it isn't applicable there."""
        for cell, old, new in zip(self.cells, self.here, values, strict=True) if values is not self.here else ():
            if old != new:
                self.table.put(*cell, new)
        self.here = values
        self.table.trail.clear()
        done = self.forward[ground.behavior](*ground.arguments)
        if done is None:
            return None
        after = list(values)
        for situation, key, value in done[1]:
            if (situation, key) in self.index:
                after[self.index[situation, key]] = value
        bindings = dict(zip(self.writer.variables[ground.behavior], done[0], strict=True))
        return Applied(ground, bindings, tuple(after))

    def successors(self, grounds: Sequence[GroundBehavior], values: Values) -> Iterator[Applied]:
        """Yield what each applicable one of the ground behaviours does, in their order."""
        for ground in grounds:
            applied = self.apply(ground, values)
            if applied is not None and applied.after != values:
                yield applied


def _symbols(problem: Problem) -> tuple[Symbol, ...]:
    """Return every symbol of the problem, in a fixed order."""
    found = set(problem.initial)
    for situation in problem.domain.situations.values():
        if situation.boolean:
            kinds = (problem.classes.get(kind, ()) for kind in situation.arguments)
            found |= {Symbol(situation.name, arguments) for arguments in product(*kinds)}
    return tuple(sorted(found))


def ground(problem: Problem, level: int) -> tuple[GroundBehavior, ...]:
    """Return all quantified behaviours of a level in the order of their IDs.

    The same set as the SPARQL queries of `reasoner.reading.quantification` yield, from the classes read once (tested equal).
    """
    number = problem.domain.first_ids.get(level, 0)
    found: list[GroundBehavior] = []
    for behavior in problem.domain.at_level(level):
        for arguments in product(*(problem.classes.get(parameter.kind, ()) for parameter in behavior.parameters)):
            found.append(GroundBehavior(number + len(found), behavior.name, arguments))
    return tuple(found)

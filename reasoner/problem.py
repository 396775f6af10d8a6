"""Domains and problems: the situation types and behaviours of a scene, with its initial state and goal."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from itertools import product
from math import prod

from confab.reasoner.amounts import amounts_of
from confab.reasoner.closure import closure
from confab.reasoner.language import groups, symbols_of
from confab.reasoner.names import brief, known_as
from confab.reasoner.symbols import (
    FALSE,
    Aggregate,
    Behavior,
    Condition,
    Constraint,
    Rule,
    SituationType,
    State,
    Symbol,
    Times,
    Witness,
)


@known_as("a domain")
@brief
@dataclass(frozen=True)
class Domain:
    """The situation types and behaviours of a domain, in declared order.

    `rules` contains the rules of each derived situation type, and `aggregates` contains the rules of derived amounts.
    `constraints` maps the name of a derived count of violations, whose maximum is 0, to the constraint. `remembers` maps each
    remembered situation type to the original situation type that it remembers, in order of dependency. A remembered symbol
    becomes true when the original symbol with the same arguments becomes true, and stays true.
    """

    situations: Mapping[str, SituationType]
    behaviors: Mapping[str, Behavior]
    first_ids: Mapping[int, int] = field(default_factory=dict)
    rules: Mapping[str, tuple[Rule, ...]] = field(default_factory=dict)
    aggregates: Mapping[str, Aggregate] = field(default_factory=dict)
    constraints: Mapping[str, Constraint] = field(default_factory=dict)
    remembers: Mapping[str, str] = field(default_factory=dict)

    @cached_property
    def authored(self) -> frozenset[str]:
        """The situation types of the ontology's author, without the situation types that Confab adds."""
        return frozenset(
            name for name, one in self.situations.items() if not one.added and name not in self.constraints
        )

    @property
    def levels(self) -> tuple[int, ...]:
        """The levels with behaviours, beginning with the most abstract level."""
        return tuple(sorted({b.level for b in self.behaviors.values()}))

    def at_level(self, level: int) -> tuple[Behavior, ...]:
        """Return the behaviours of a level in declared order."""
        return tuple(b for b in self.behaviors.values() if b.level == level)


@known_as("a problem")
@brief
@dataclass(frozen=True)
class Problem:
    """A planning problem: a scene with its domain, initial state and goal.

    Parameters
    ----------
    scene : str
        IRI of the scene.
    domain : Domain
    classes : mapping of class to individuals
        The members of each class and its subclasses, in declared order.
    relations : mapping of relation to set of tuples
        The rows of each static relation.
    initial : State
    goal : State
        The goal: values of some symbols.
    parents : mapping of class to its direct superclasses
        The superclasses are used by statistics that generalise over classes, and not by the search.
    value_levels : mapping of individual to level
        The first level on which each value exists; values without an entry exist from level 1 on.
    times : Times, optional
        Deadlines, time windows and measured durations (`confab.reasoner.timing`).
    weights : mapping of Symbol to Fraction
        The cost of leaving each soft goal unmet; a goal without a weight must be met.
    """

    scene: str
    domain: Domain
    classes: Mapping[str, tuple[str, ...]]
    relations: Mapping[str, frozenset[tuple[str, ...]]]
    initial: State
    goal: State
    parents: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    value_levels: Mapping[str, int] = field(default_factory=dict)
    times: Times | None = None
    weights: Mapping[Symbol, Fraction] = field(default_factory=dict)

    def only(self, unmet: Collection[Symbol]) -> Problem:
        """Return the problem without the soft goals `unmet`; all other goals must be met."""
        return replace(self.without_goals(unmet), weights={})

    def without_goals(self, dropped: Collection[Symbol]) -> Problem:
        """Return the problem without the goals for some symbols, their weights and their deadlines."""
        goal = {symbol: value for symbol, value in self.goal.items() if symbol not in dropped}
        weights = {symbol: weight for symbol, weight in self.weights.items() if symbol not in dropped}
        known = self.times.deadlines if self.times is not None else {}
        by = {symbol: seconds for symbol, seconds in known.items() if symbol not in dropped}
        times = replace(self.times, deadlines=by) if self.times is not None else None
        return replace(self, goal=goal, weights=weights, times=times)

    def values(self, symbol: Symbol, level: int) -> tuple[str, ...]:
        """Return the values that a symbol can have on a level, in declared order."""
        members = self.classes.get(self.domain.situations[symbol.situation].range, ())
        return tuple(value for value in members if self.value_levels.get(value, 1) <= level)

    def first_level(self, symbol: Symbol) -> int:
        """Return the first level on which a symbol, its situation type and its arguments exist."""
        individuals = (self.value_levels.get(argument, 1) for argument in symbol.arguments)
        return max((self.domain.situations[symbol.situation].level, *individuals))

    def sees(self, level: int, symbol: Symbol, value: str) -> bool:
        """Return whether a symbol and a value exist on a level."""
        return self.first_level(symbol) <= level and self.value_levels.get(value, 1) <= level

    def releases(self, symbol: Symbol) -> bool:
        """Return whether a goal is about a symbol, directly or by a definition, and so releases the symbol from its rest value."""
        terms = self.read_by_goals.get(symbol.situation, ())
        return symbol in self.goal or symbol in self.weights or any(self._fits(symbol, one) for one in terms)

    def concerns(self, goal: Symbol, symbol: Symbol) -> bool:
        """Return whether one goal is about a symbol, directly or by a definition."""
        return goal == symbol or any(self._fits(symbol, one) for one in self._read_by(goal).get(symbol.situation, ()))

    def may_leave_rest(self, goal: Symbol) -> bool:
        """Return whether a goal may demand other values than rest values."""
        rest = self.domain.situations[goal.situation].rest
        return bool(self._read_by(goal)) if rest is None else rest != self.goal.get(goal)

    def _fits(self, symbol: Symbol, terms: tuple[str, ...]) -> bool:
        """Return whether the arguments of a symbol fit terms: individuals, classes, or variables that stand for any individual."""
        of = zip(terms, symbol.arguments, strict=True)
        return all(term == one or term.startswith("?") or one in self.members(term) for term, one in of)

    @cached_property
    def read_by_goals(self) -> Mapping[str, set[tuple[str, ...]]]:
        """The individuals or classes of the symbols with rest values that definitions of goals read, by situation type."""
        found: dict[str, set[tuple[str, ...]]] = {}
        for goal in {*self.goal, *self.weights}:
            for situation, terms in self._read_by(goal).items():
                found.setdefault(situation, set()).update(terms)
        return found

    def _read_by(self, goal: Symbol) -> Mapping[str, set[tuple[str, ...]]]:
        if goal.situation not in self.domain.rules and goal.situation not in self.domain.aggregates:
            return {}
        found: dict[str, set[tuple[str, ...]]] = {}
        for situation, terms in read_through(goal, self.domain):
            if self.domain.situations[situation].rest is not None:
                found.setdefault(situation, set()).add(terms)
        return found

    def goal_on(self, level: int) -> dict[Symbol, str]:
        """Return the goal on a level: the task's goals, and the rest values that `at_rest` returns."""
        return {**self.at_rest(level), **self.goal}

    def at_rest(self, level: int) -> dict[Symbol, str]:
        """Return the symbols on a level that initially have their rest value, except those that a definition of a goal reads.

        Boolean symbols that the initial state omits are included if a behaviour of the level changes their situation type.
        """
        rests = {s.name: s.rest for s in self.domain.situations.values() if s.rest is not None}
        found = {s: v for s, v in self.initial.items() if v == rests.get(s.situation)}
        changed = frozenset[str]().union(*(behavior.changes for behavior in self.domain.at_level(level)))
        for name in sorted(changed & {name for name, rest in rests.items() if rest == FALSE}):
            for individuals in product(
                *(self.classes.get(kind, ()) for kind in self.domain.situations[name].arguments)
            ):
                if (symbol := Symbol(name, individuals)) not in self.initial:
                    found[symbol] = FALSE
        return {
            symbol: value
            for symbol, value in found.items()
            if self.first_level(symbol) <= level and (symbol in self.goal or not self.releases(symbol))
        }

    def members(self, kind: str) -> frozenset[str]:
        """Return the members of a class as a set."""
        return self._members.get(kind, frozenset())

    def related(self, relation: str, position: int) -> Mapping[str, list[tuple[str, ...]]]:
        """Return the tuples of a relation, indexed by the individual at a position."""
        if (relation, position) not in self._related:
            found = self._related[relation, position] = {}
            for row in sorted(self.relations.get(relation, ())):
                found.setdefault(row[position], []).append(row)
        return self._related[relation, position]

    @cached_property
    def _related(self) -> dict[tuple[str, int], dict[str, list[tuple[str, ...]]]]:
        return {}

    def superclasses(self, kind: str) -> set[str]:
        """Return a class with all its superclasses."""
        return superclasses(kind, self.parents)

    def below(self, kind: str, other: str) -> bool:
        """Return whether every individual of a class or union of classes belongs to another class or union."""
        return below(kind, other, self.parents)

    @cached_property
    def individuals(self) -> frozenset[str]:
        """All individuals of the problem's classes."""
        return frozenset[str]().union(*self.classes.values())

    @cached_property
    def _members(self) -> Mapping[str, frozenset[str]]:
        return {kind: frozenset(members) for kind, members in self.classes.items()}

    def id_of(self, behavior: str, arguments: tuple[str, ...]) -> int:
        """Return the ID of a quantified behaviour without enumerating other behaviours.

        IDs follow the declared order of behaviours, then of parameters, then of individuals (section 4 of PAPER.md).
        """
        number, kinds = self._numbers[behavior]
        rank = 0
        for kind, argument in zip(kinds, arguments, strict=True):
            ranks = self._ranks[kind]
            rank = rank * len(ranks) + ranks[argument]
        return number + rank

    def quantified(self, level: int) -> int:
        """Return the number of quantified behaviours of a level."""
        return sum(
            prod(len(self.classes.get(parameter.kind, ())) for parameter in behavior.parameters)
            for behavior in self.domain.at_level(level)
        )

    @cached_property
    def _numbers(self) -> Mapping[str, tuple[int, tuple[str, ...]]]:
        """The first ID of each behaviour, and the classes of its parameters."""
        found = {}
        for level in self.domain.levels:
            number = self.domain.first_ids.get(level, 0)
            for behavior in self.domain.at_level(level):
                kinds = tuple(parameter.kind for parameter in behavior.parameters)
                found[behavior.name] = number, kinds
                number += prod(len(self.classes.get(kind, ())) for kind in kinds)
        return found

    @cached_property
    def _ranks(self) -> Mapping[str, Mapping[str, int]]:
        return {kind: {member: i for i, member in enumerate(members)} for kind, members in self.classes.items()}


def superclasses(kind: str, parents: Mapping[str, Sequence[str]]) -> set[str]:
    """Return a class with all its superclasses; `parents` has the direct superclasses."""
    return closure([kind], lambda each: parents.get(each, ()))


def below(kind: str, other: str, parents: Mapping[str, Sequence[str]]) -> bool:
    """Return whether every individual of a class or union of classes belongs to another class or union."""
    above = {*other.split("|"), other}
    return not any(superclasses(part, parents).isdisjoint(above) for part in kind.split("|"))


def read_through(symbol: Symbol, domain: Domain) -> set[tuple[str, tuple[str, ...]]]:
    """Return the situation types that the definition of a derived symbol reads, directly or by further definitions.

    Each situation type has its terms: individuals, and classes in the place of variables. A stated symbol reads only itself.
    """

    def read(of: tuple[str, tuple[str, ...]]) -> Iterator[tuple[str, tuple[str, ...]]]:
        total = domain.aggregates.get(of[0])
        for one in (*domain.rules.get(of[0], ()), *((total,) if total else ())):
            arguments = {p.name: term for p, term in zip(one.parameters, of[1], strict=True)}
            kinds = {**{v.name: v.kind for v in one.variables}, **arguments}
            yield from _symbols_in(one.conditions, kinds)
            for situation, terms in amounts_of(one.amount) if isinstance(one, Aggregate) else ():
                yield situation, tuple(kinds.get(term, term) for term in terms)

    return closure([(symbol.situation, symbol.arguments)], read)


def _symbols_in(conditions: Sequence[Condition], kinds: Mapping[str, str]) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Yield the situation types that conditions read, with their terms; `kinds` maps variables to classes or individuals."""
    for condition in conditions:
        for situation, arguments in symbols_of(condition):
            yield situation, tuple(kinds.get(term, term) for term in arguments)
        inner = {**kinds, condition.variable: condition.kind} if isinstance(condition, Witness) else kinds
        for group in groups(condition):
            yield from _symbols_in(group, inner)

"""Ground conditions as conjunctions of bits.

A quantified condition is split into parts without common variables. For example, "the ferry is here and some car waits there" has
two parts: the bit of the ferry, and a derived bit for "some car waits there". The derived bit is created once for each place.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import count
from typing import Protocol

from confab.planner.grounded.amounts import AmountTable
from confab.planner.grounded.joins import JoinTable
from confab.planner.plan import UngroundableError
from confab.reasoner.amounts import Amount, bounds
from confab.reasoner.language import mentions, plain_variables, substituted
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    AnyOf,
    ClassCondition,
    Comparison,
    Condition,
    EqualityCondition,
    RelationCondition,
    SituationType,
    Symbol,
    ValueCondition,
    Witness,
)

CONDITIONS_PER_ROW = 20
"""Maximum number of ground conditions, as a multiple of the maximum number of rows of a join.

Nested quantifiers multiply the number of ground conditions.
"""

Literals = tuple[int, ...] | None
"""A conjunction of bits; the empty conjunction is true, and None is false."""


class ReachableFacts(Protocol):
    """Interface of the reachable facts that conditions read (`confab.planner.grounded.reachability.Reached`)."""

    problem: Problem
    most: int
    situations: dict[str, SituationType]
    individuals: tuple[str, ...]
    amounts: AmountTable
    tables: dict[tuple[str, str], JoinTable]
    symbols: dict[str, JoinTable]

    def find(self, situation: SituationType, arguments: Sequence[str], value: str) -> int:
        """Return the row of a fact in the table of its situation type, or -1 if the fact is unreachable."""

    def check_time(self) -> None:
        """Raise `OutOfTimeError` when the deadline has passed."""


@dataclass(frozen=True)
class _Component:
    """Conditions that are connected by shared free variables.

    `unbound` are the free variables, `bound` are the variables bound outside, and `kinds` are the classes of all variables.
    """

    conditions: tuple[Condition, ...]
    unbound: tuple[str, ...]
    bound: tuple[str, ...]
    kinds: Mapping[str, str]


class Formulas:
    """Ground conditions as conjunctions of bits; each disjunction becomes one derived bit.

    Before the caller fills `bits`, only static conditions can be evaluated.
    """

    def __init__(self, reached: ReachableFacts) -> None:
        self.reached = reached
        self.bits: dict[str, dict[tuple[str, ...], int]] = {}  # bit of each fact; -1: always true
        self.size = 0
        self.complements: dict[int, int] = {}
        self.facts_of: dict[int, int] = {}  # the inverse of `complements`
        self.derived: dict[tuple[tuple[int, ...], ...], int] = {}
        self._groups: dict[int, tuple[tuple[int, ...], ...]] = {}  # alternatives of disjunctions, by bit
        self.asked = 0
        self._known: dict[tuple[int, bool, tuple[str, ...]], Literals] = {}  # formulas by part and individuals
        self._parts_of: dict[tuple[int, frozenset[str]], tuple[Condition, list[list[_Component]]]] = {}
        self._relations: dict[tuple[str, int, int, tuple[int, ...]], dict[tuple[str, ...], dict[str, None]]] = {}
        self._members: dict[str, dict[str, None]] = {}
        self._names = count()

    def condition(
        self, condition: Condition, terms: Mapping[str, str], kinds: Mapping[str, str], negated: bool = False
    ) -> Literals:
        """Return the formula of a condition, or of its negation."""
        self.asked += 1
        if self.asked > CONDITIONS_PER_ROW * self.reached.most:
            raise UngroundableError(f"more than {CONDITIONS_PER_ROW * self.reached.most} ground conditions")
        if not self.asked % 1024:
            self.reached.check_time()

        def put(names: Sequence[str]) -> tuple[str, ...]:
            return tuple(terms.get(name, name) for name in names)

        match condition:
            case ValueCondition(situation, arguments, value, flipped):
                return self.value(situation, put(arguments), terms.get(value, value), flipped is not negated)
            case RelationCondition(relation, arguments, flipped):
                holds = put(arguments) in self.reached.problem.relations.get(relation, ())
            case ClassCondition(term, kind, flipped):
                holds = terms.get(term, term) in self.members(kind)
            case EqualityCondition(left, right, flipped):
                holds = terms.get(left, left) == terms.get(right, right)
            case Witness() | AnyOf():
                return self._any(condition, terms, kinds, condition.negated is not negated)
            case Comparison(left, sign, right, flipped):
                amounts = self.reached.amounts
                one, other = amounts.linear(left, terms), amounts.linear(right, terms)
                return self.any_of(amounts.comparison(one, sign, other, flipped is not negated, self.fresh))
        return () if holds is not (flipped is not negated) else None

    def _any(
        self, condition: Witness | AnyOf, terms: Mapping[str, str], kinds: Mapping[str, str], negated: bool
    ) -> Literals:
        """Return the formula for "some group of conditions holds for some individuals"; if `negated`, return the negation."""
        groups = self._groups_of(condition, frozenset(terms), kinds)
        if negated:
            return self.all_of(self.any_of(self._part(part, terms, True) for part in group) for group in groups)
        return self.any_of(self.all_of(self._part(part, terms) for part in group) for group in groups)

    def _part(self, part: _Component, terms: Mapping[str, str], negated: bool = False) -> Literals:
        """Return the formula for "some individuals satisfy all conditions of a part"; if `negated`, return the negation."""
        bound = {name: terms[name] for name in part.bound}
        key = id(part), negated, tuple(bound.values())
        if key not in self._known:
            solutions, kinds = self._solutions(part, part.unbound, bound), part.kinds
            each = ((self.condition(c, found, kinds, negated) for c in part.conditions) for found in solutions)
            self._known[key] = (
                self.named(self.all_of(map(self.any_of, each))) if negated else self.any_of(map(self.all_of, each))
            )
        return self._known[key]

    def _groups_of(
        self, condition: Witness | AnyOf, bound: frozenset[str], kinds: Mapping[str, str]
    ) -> list[list[_Component]]:
        """Return the groups of a condition, each split into parts that share no free variable."""
        key = id(condition), bound
        if key not in self._parts_of:
            groups: Iterable[Sequence[Condition]] = (
                [(replace(condition, negated=False),)] if isinstance(condition, Witness) else condition.alternatives
            )
            self._parts_of[key] = condition, [list(self._parts(group, bound, kinds)) for group in groups]
        return self._parts_of[key][1]

    def _parts(
        self, group: Sequence[Condition], bound: frozenset[str], kinds: Mapping[str, str]
    ) -> Iterator[_Component]:
        """Yield the parts of a group of conditions.

        For example, "a cup is clean and a hand is empty" has one part about the cup and one part about the hand.
        """
        kinds = dict(kinds)
        conditions = list(self._opened(group, bound | plain_variables(group), kinds))
        unbound = plain_variables(conditions) - bound
        while conditions:
            of_part, names = [conditions.pop(0)], set[str]()
            while True:
                names = {name for c in of_part for name in mentions(c)} & unbound
                more = [c for c in conditions if mentions(c) & names]
                if not more:
                    break
                of_part += more
                conditions = [c for c in conditions if c not in more]
            outside = {name for c in of_part for name in mentions(c)} & bound
            yield _Component(tuple(of_part), tuple(sorted(names)), tuple(sorted(outside)), kinds)

    def _opened(
        self, group: Sequence[Condition], shared: set[str] | frozenset[str], kinds: dict[str, str]
    ) -> Iterator[Condition]:
        """Yield the conditions of a group, with witnesses replaced by their conditions on uniquely named variables."""
        for c in group:
            if not isinstance(c, Witness) or c.negated:
                yield c
                continue
            own = {c.variable: c.kind} | {
                name: kinds[name] for name in plain_variables(c.conditions) - shared - {c.variable}
            }
            names = {name: f"{name}/{next(self._names)}" for name in sorted(own)}
            kinds |= {names[name]: kind for name, kind in own.items()}
            yield ClassCondition(names[c.variable], c.kind)
            inner = [substituted(one, names) for one in c.conditions]
            yield from self._opened(inner, shared | set(names.values()), kinds)

    def _solutions(
        self, part: _Component, unbound: Sequence[str], terms: Mapping[str, str]
    ) -> Iterator[Mapping[str, str]]:
        """Yield the bindings of a part's free variables that the reachable facts and the relations allow."""
        if not unbound:
            yield terms
            return
        name, values = min(
            ((name, self._candidates(name, part, terms)) for name in unbound), key=lambda pair: len(pair[1])
        )
        rest = [other for other in unbound if other != name]
        for value in values:
            yield from self._solutions(part, rest, {**terms, name: value})

    def _candidates(self, name: str, part: _Component, terms: Mapping[str, str]) -> Sequence[str]:
        """Return the individuals that a positive condition of a part allows for a variable.

        Without a suitable condition, return all individuals of the variable's class.
        """
        members = self.members(part.kinds[name])
        for c in part.conditions:
            if isinstance(c, ValueCondition) and not c.negated and c.value == name:
                arguments = tuple(terms.get(a, a) for a in c.arguments)
                if not any(a.startswith("?") for a in arguments):
                    return [v for v in self.values.get((c.situation, arguments), ()) if v in members]
            if isinstance(c, RelationCondition) and not c.negated and name in c.arguments:
                fixed = {i: terms.get(a, a) for i, a in enumerate(c.arguments) if a in terms or not a.startswith("?")}
                found = self._related(c.relation, len(c.arguments), c.arguments.index(name), tuple(fixed))
                return [v for v in found.get(tuple(fixed.values()), ()) if v in members]
        return list(members)

    def _related(
        self, relation: str, arity: int, place: int, fixed: tuple[int, ...]
    ) -> Mapping[tuple[str, ...], Mapping[str, None]]:
        """Map the individuals at the `fixed` positions of a relation's tuples to the individuals at position `place`."""
        key = relation, arity, place, fixed
        if key not in self._relations:
            found = self._relations[key] = {}
            for row in sorted(self.reached.problem.relations.get(relation, ())):
                if len(row) == arity:
                    found.setdefault(tuple(row[i] for i in fixed), {})[row[place]] = None
        return self._relations[key]

    @cached_property
    def values(self) -> Mapping[tuple[str, tuple[str, ...]], list[str]]:
        """The reachable values of each symbol that isn't boolean."""
        found: dict[tuple[str, tuple[str, ...]], list[str]] = defaultdict(list)
        names = self.reached.individuals
        for name in self.reached.symbols:
            for row in self.reached.tables["situation", name].rows.tolist():
                found[name, tuple(names[i] for i in row[:-1])].append(names[row[-1]])
        return found

    def members(self, kind: str) -> dict[str, None]:
        """Return the individuals of a class."""
        if kind not in self._members:
            self._members[kind] = dict.fromkeys(self.reached.problem.classes.get(kind, ()))
        return self._members[kind]

    def value(self, situation: str, arguments: tuple[str, ...], value: str, negated: bool) -> Literals:
        """Return the formula for "a symbol has a value"; if `negated`, return the negation."""
        kind = self.reached.situations.get(situation)
        if kind is None:  # the situation type doesn't exist on this level
            return () if negated else None
        if kind.boolean and value == FALSE:
            if not all(a in self.members(k) for a, k in zip(arguments, kind.arguments, strict=True)):
                return () if negated else None
            return self.value(situation, arguments, TRUE, not negated)
        bits = self.bits.get(situation)
        if bits is None:
            bit = -1 if self.reached.find(kind, arguments, value) >= 0 else None
        else:
            bit = bits.get(arguments if kind.boolean else (*arguments, value))
        if bit is None or bit == -1:
            return () if (bit is None) is negated else None
        return (self.complement(bit) if negated else bit,)

    def complement(self, bit: int) -> int:
        """Return the bit of the negation of a fact; for the bit of a negation, return the bit of the fact."""
        if bit in self.facts_of:
            return self.facts_of[bit]
        if bit not in self.complements:
            self.complements[bit] = self.fresh()
            self.facts_of[self.complements[bit]] = bit
        return self.complements[bit]

    def opposite(self, bit: int) -> Literals:
        """Return the formula for "a bit isn't set"."""
        groups = self._groups.get(bit)
        if groups is not None:
            return self.all_of(self.any_of(self.opposite(one) for one in group) for group in groups)
        contrary = self.reached.amounts.opposite(bit, self.fresh)
        return (self.complement(bit),) if contrary is None else self.any_of(contrary)

    def fresh(self) -> int:
        """Return an unused bit."""
        self.size += 1
        return self.size - 1

    def wanted(self, symbol: Symbol, value: str) -> Literals:
        """Return the formula of a goal: a symbol has the value, or an amount is within the bounds."""
        if self.reached.problem.domain.situations[symbol.situation].quantity is None:
            return self.value(symbol.situation, symbol.arguments, value, False)
        amount = Amount(symbol.situation, symbol.arguments)
        return self.all_of(self.condition(Comparison(amount, sign, limit), {}, {}) for sign, limit in bounds(value))

    def all_of(self, parts: Iterable[Literals]) -> Literals:
        """Return the conjunction of formulas."""
        found: set[int] = set()
        for part in parts:
            if part is None:
                return None
            found.update(part)
        return tuple(sorted(found))

    def named(self, literals: Literals) -> Literals:
        """Return one derived bit for a conjunction of several bits.

        Many operators may share this bit, for example the bit of "no object stands there".
        """
        if literals is None or len(literals) < 2:
            return literals
        if (literals,) not in self.derived:
            self.derived[literals,] = self.fresh()
            self._groups[self.derived[literals,]] = (literals,)
        return (self.derived[literals,],)

    def any_of(self, parts: Iterable[Literals]) -> Literals:
        """Return the disjunction of formulas as one derived bit, or as a simpler formula if possible."""
        found: set[tuple[int, ...]] = set()
        for part in parts:
            if part == ():
                return ()
            if part is not None:
                found.add(part)
        alternatives = tuple(sorted(found))
        if len(alternatives) < 2:
            return alternatives[0] if alternatives else None
        if alternatives not in self.derived:
            self.derived[alternatives] = self.fresh()
            self._groups[self.derived[alternatives]] = alternatives
        return (self.derived[alternatives],)

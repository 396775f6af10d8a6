"""Names of a scene's types, objects, predicates and functions in PDDL, and the initial facts of the named predicates."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import product

from confab.reasoner.amounts import Amount, Calculation, Expression, Measure
from confab.reasoner.language import walk
from confab.reasoner.pddl.formulas import FALSE as NEVER
from confab.reasoner.pddl.formulas import TRUE as ALWAYS
from confab.reasoner.pddl.formulas import (
    Arithmetic,
    Atom,
    Compare,
    Formula,
    FunctionTerm,
    Not,
    NumericTerm,
    PddlTerm,
    both,
)
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import TRUE, Behavior, Witness

WORLD = "World"
"""Class whose only individual is the argument of each symbol that has no argument in PDDL. The individual is an argument in PDDL,
too, if a term of a wider class can denote it, because the symbol doesn't exist for the other individuals of that class."""
RESERVED = """
all always and assign at-end at-most-once at-start constants decrease define derived domain effect either end
exists forall goal hold-after hold-during imply increase init is-violated maximize metric minimize not number
object objects or over parameters precondition predicates preference problem requirements scale-down scale-up
sometime sometime-after sometime-before start total-cost total-time types undefined when within
"""
"""Reserved words of PDDL, which can't be names."""


class PddlNames:
    """Mapping from the names of a problem to PDDL names.

    All PDDL names are different: even a type and an object have different names, because some parsers have one table for all
    names.
    """

    def __init__(self, problem: Problem) -> None:
        self.problem, domain = problem, problem.domain
        self.situations = domain.situations
        self.names: dict[tuple[str, str], str] = {}
        self.taken = set(RESERVED.split())
        self.used: dict[str, None] = {}  # situation types that have become predicates
        self.statics: dict[str, frozenset[tuple[str, ...]]] = {}  # rows of each static predicate
        self.predicates: dict[str, list[set[str]]] = {}  # types of the terms at each argument position
        self.functions: dict[str, list[set[str]]] = {}  # types of the terms at each argument position
        self.measured: dict[str, str] = {}  # function of each relation whose last argument is a number
        self.counted: dict[str, str] = {}  # function of each situation type that is an amount
        self.existing: dict[str, set[tuple[str, ...]]] = {}
        for symbol in problem.initial:
            self.existing.setdefault(symbol.situation, set()).add(symbol.arguments)
        kinds = self._kinds()
        world = problem.members(WORLD)
        self.one_world = len(world) == 1 and not any(world < problem.members(kind) for kind in kinds)
        self.types, self.above = self._types(kinds)
        large_first = sorted(self.types, key=lambda kind: -len(problem.members(kind)))
        self.lowest = {member: self.types[kind] for kind in large_first for member in problem.members(kind)}

    def name(self, kind: str, ours: str, wanted: str | None = None) -> str:
        """Return the PDDL name for a name in the scene, given the kind of the name."""
        if (kind, ours) not in self.names:
            text = re.sub(r"[^0-9a-z_-]", "_", (wanted or ours).lower())
            text = text if re.match(r"[a-z]", text) else f"x{text}"
            while text in self.taken:
                text += "_"
            self.taken.add(text)
            self.names[kind, ours] = text
        return self.names[kind, ours]

    # --------------------------------------------------------------------------------------------------------- types

    def _kinds(self) -> list[str]:
        """Return the classes of all terms, and of the arguments of amounts."""
        domain = self.problem.domain
        behaviors = [*domain.behaviors.values(), *(rule.behavior for its in domain.rules.values() for rule in its)]
        kinds = [term.kind for one in behaviors for term in (*one.parameters, *one.variables)]
        conditions = [part for one in behaviors for condition in one.conditions for part in walk(condition)]
        kinds += [part.kind for part in conditions if isinstance(part, Witness)]
        kinds += [kind for one in domain.situations.values() for kind in one.arguments if one.quantity is not None]
        return list(dict.fromkeys(kinds))

    def _types(self, kinds: Sequence[str]) -> tuple[dict[str, str], dict[str, str]]:
        """Return the PDDL types of classes, and their supertypes; of partially overlapping classes, only the larger has a type."""
        chosen: dict[frozenset[str], str] = {}
        for kind in sorted(kinds, key=lambda one: -len(self.problem.members(one))):
            members = self.problem.members(kind)
            if members and all(not members & other or members <= other for other in chosen):
                chosen.setdefault(members, kind)
        names = {members: self.name("type", kind) for members, kind in chosen.items()}
        above = {}
        for members in chosen:  # the classes are sorted from large to small
            larger = [names[other] for other in chosen if members < other]
            above[names[members]] = larger[-1] if larger else "object"
        types = {kind: names[its] for kind in self.problem.classes if (its := self.problem.members(kind)) in names}
        return types, above

    def variable(self, name: str, kind: str) -> PddlTerm:
        """Return a PDDL variable for the individuals of a class."""
        return PddlTerm(name, self.types.get(kind, "object"), self.problem.members(kind))

    def object(self, ours: str) -> PddlTerm:
        """Return the PDDL object for an individual."""
        return PddlTerm(self.name("object", ours), self.lowest.get(ours, "object"), frozenset((ours,)))

    def denoted(self, behavior: Behavior, term: str) -> frozenset[str]:
        """Return the individuals that a term of a behaviour can denote."""
        return self.problem.members(behavior.kinds[term]) if term in behavior.kinds else frozenset((term,))

    # ----------------------------------------------------------------------------------------------------- predicates

    def atom(self, predicate: str, terms: Sequence[PddlTerm]) -> Atom:
        """Return an atom, and record the types of its arguments."""
        for types, term in zip(self.predicates.setdefault(predicate, [set() for _ in terms]), terms, strict=True):
            types.add(term.type)
        return Atom(predicate, tuple(terms))

    def about(self, situation: str, terms: Sequence[PddlTerm]) -> tuple[PddlTerm, ...]:
        """Return the arguments of a symbol, except the individual that stands for the world."""
        kinds = self.situations[situation].arguments
        return tuple(term for kind, term in zip(kinds, terms, strict=True) if not (self.one_world and kind == WORLD))

    def value(self, situation: str, terms: Sequence[PddlTerm], value: PddlTerm | None) -> Atom:
        """Return the atom which states that a symbol has a value or, if `value` is None, that a boolean symbol is true."""
        self.used[situation] = None
        words = self.about(situation, terms)
        return self.atom(self.name("predicate", situation), words if value is None else (*words, value))

    def is_a(self, term: PddlTerm, kind: str) -> Formula:
        """Return the formula for membership of a term in a class; the formula is constant if its truth is known."""
        members = self.problem.members(kind)
        if term.members <= members:
            return ALWAYS
        if not term.members & members:
            return NEVER
        return self.static(f"is {kind}", f"is_{kind}", frozenset((member,) for member in members), (term,))

    def guard(self, term: PddlTerm, kind: str) -> Formula:
        """Return the formula for membership of a variable in its class; the formula is constant if the class is a PDDL type."""
        if kind in self.types:
            return ALWAYS
        return self.static(f"is {kind}", f"is_{kind}", frozenset((one,) for one in self.problem.members(kind)), (term,))

    def relation(self, relation: str, terms: Sequence[PddlTerm]) -> Formula:
        """Return the formula which states that a static relation holds for some terms."""
        return self.static(f"relation {relation}", relation, self.problem.relations.get(relation, frozenset()), terms)

    def differs(self, term: PddlTerm, constant: PddlTerm) -> Formula:
        """Return the formula which states that a term doesn't denote a given individual.

        The formula for "different from an individual" uses a predicate instead of PDDL's equality.
        """
        name = self.name("predicate", "different individuals", "different")
        rows: frozenset[tuple[str, ...]] = frozenset(
            (one, other) for one in term.members for other in constant.members - {one}
        )
        rows |= self.statics.get(name, frozenset())
        found = self.static("different individuals", "different", rows, (term, constant))
        return found if term.members & constant.members else ALWAYS

    def static(self, ours: str, wanted: str, rows: frozenset[tuple[str, ...]], terms: Sequence[PddlTerm]) -> Formula:
        """Return the atom of a static predicate with the given rows, or a constant formula if the truth of the atom is known."""
        if not rows:
            return NEVER
        if not any(term.variable for term in terms):
            return ALWAYS if tuple(next(iter(term.members)) for term in terms) in rows else NEVER
        name = self.name("predicate", ours, wanted)
        self.statics[name] = rows
        return self.atom(name, terms)

    def total(self, situation: str, terms: Sequence[PddlTerm]) -> bool:
        """Return whether the symbols of a situation type exist for all individuals that some terms can denote."""
        kind = self.situations[situation]
        within = all(t.members <= self.problem.members(k) for k, t in zip(kind.arguments, terms, strict=True))
        if kind.boolean:
            return within
        rows = self.existing.get(situation, set())
        if within and len(rows) == self.symbols(situation):
            return True
        return all(row in rows for row in product(*(sorted(term.members) for term in terms)))

    def symbols(self, situation: str) -> int:
        """Return the maximum number of symbols of a situation type: the product of the sizes of its argument classes."""
        number = 1
        for kind in self.situations[situation].arguments:
            number *= len(self.problem.classes.get(kind, ()))
        return number

    def exists(self, situation: str, terms: Sequence[PddlTerm]) -> Formula:
        """Return the formula which states that the symbol of a situation type exists for some terms."""
        kind = self.situations[situation]
        if self.total(situation, terms):
            return ALWAYS
        if kind.boolean:
            return both(self.is_a(term, one) for one, term in zip(kind.arguments, terms, strict=True))
        rows = frozenset(self.existing.get(situation, ()))
        return self.static(f"has {situation}", f"has_{situation}", rows, terms)

    # -------------------------------------------------------------------------------------------------------- numbers

    def amount(self, situation: str, terms: Sequence[PddlTerm]) -> FunctionTerm:
        """Return the PDDL function term for an amount."""
        name = self.name("function", situation, situation)
        self.counted[situation] = name
        return self.call(name, self.about(situation, terms))

    def measure(self, relation: str, terms: Sequence[PddlTerm]) -> FunctionTerm:
        """Return the PDDL function term for a static relation whose last argument is a number."""
        name = self.name("function", f"relation {relation}", relation)
        self.measured[relation] = name
        return self.call(name, terms)

    def call(self, name: str, terms: Sequence[PddlTerm]) -> FunctionTerm:
        """Return a function term, and record the types of its arguments."""
        for types, term in zip(self.functions.setdefault(name, [set() for _ in terms]), terms, strict=True):
            types.add(term.type)
        return FunctionTerm(name, tuple(terms))

    def common(self, types: Iterable[str]) -> str:
        """Return the lowest common supertype of some types."""
        chains = [list(self.upwards(one)) for one in sorted(types)]
        return next((one for one in chains[0] if all(one in chain for chain in chains)), "object")

    def upwards(self, kind: str) -> Iterator[str]:
        """Yield a type and its supertypes except ``object``."""
        while kind != "object":
            yield kind
            kind = self.above[kind]

    def number(self, expression: Expression, terms: Mapping[str, PddlTerm]) -> NumericTerm:
        """Return the PDDL expression for a numeric expression, with PDDL terms substituted for variables."""
        match expression:
            case Amount(situation, arguments):
                return self.amount(situation, self.terms(arguments, terms))
            case Measure(relation, arguments):
                return self.measure(relation, self.terms(arguments, terms))
            case Calculation(sign, left, right):
                return Arithmetic(sign, self.number(left, terms), self.number(right, terms))
            case Fraction():
                return expression

    def there(self, expression: Expression, terms: Mapping[str, PddlTerm]) -> Iterator[Formula]:
        """Yield the formulas which state that a numeric expression has a value: its parts exist, and no divisor is zero."""
        match expression:
            case Amount(situation, arguments):
                yield self.exists(situation, self.terms(arguments, terms))
            case Measure(relation, arguments):
                rows = frozenset(row[:-1] for row in self.problem.relations.get(relation, ()))
                its = self.terms(arguments, terms)
                if not all(row in rows for row in product(*(sorted(term.members) for term in its))):
                    yield self.static(f"has {relation}", f"has_{relation}", rows, its)
            case Calculation(sign, left, right):
                yield from self.there(left, terms)
                yield from self.there(right, terms)
                if sign == "/" and self.may_be_zero(right):
                    yield NEVER if right == 0 else Not(Compare("=", self.number(right, terms), Fraction(0)))
            case Fraction():
                return

    def may_be_zero(self, divisor: Expression) -> bool:
        """Return whether a divisor may have the value 0."""
        match divisor:
            case Measure(relation):
                return any(Fraction(row[-1]) == 0 for row in self.problem.relations.get(relation, ()))
            case Amount(situation):
                least = getattr(self.situations[situation].quantity, "least", None)
                return least is None or least <= 0
            case Calculation():
                return True
            case Fraction():
                return divisor == 0

    def terms(self, names: Sequence[str], terms: Mapping[str, PddlTerm]) -> tuple[PddlTerm, ...]:
        """Return the PDDL terms for names of variables and individuals."""
        return tuple(terms[name] if name in terms else self.object(name) for name in names)

    # ---------------------------------------------------------------------------------------------------- statements

    def facts(self) -> Iterator[Atom | tuple[FunctionTerm, Fraction]]:
        """Yield the initial atoms and function values of all predicates and functions that have been named."""
        for symbol, value in self.problem.initial.items():
            boolean, its = self.situations[symbol.situation].boolean, self.terms(symbol.arguments, {})
            if symbol.situation in self.counted:
                yield self.amount(symbol.situation, its), Fraction(value)
            elif symbol.situation in self.used and (value == TRUE or not boolean):
                yield self.value(symbol.situation, its, None if boolean else self.object(value))
        every = dict.fromkeys(one for members in self.problem.classes.values() for one in members)
        for situation in sorted(self.counted):  # many planners require an initial value for all arguments of a function
            kinds = self.situations[situation].arguments
            types = iter(map(self.common, self.functions[self.counted[situation]]))
            kept = self.about(situation, [PddlTerm(str(place)) for place in range(len(kinds))])
            wide = {int(term.name): next(types) for term in kept}
            things = [
                [one for one in every if wide[i] in ("object", *self.upwards(self.lowest.get(one, "object")))]
                if i in wide
                else self.problem.classes[kind]
                for i, kind in enumerate(kinds)
            ]
            missing = (row for row in product(*things) if row not in self.existing.get(situation, ()))
            yield from ((self.amount(situation, self.terms(row, {})), Fraction(0)) for row in missing)
        for relation in sorted(self.measured):
            for row in sorted(self.problem.relations.get(relation, ())):
                yield self.measure(relation, self.terms(row[:-1], {})), Fraction(row[-1])
        for predicate, rows in sorted(self.statics.items()):
            for row in sorted(rows):
                yield self.atom(predicate, self.terms(row, {}))

    def declared(self, ours: str) -> str:
        """Return the PDDL declaration of an object, with its type."""
        return f"{self.name('object', ours)} - {self.lowest.get(ours, 'object')}"

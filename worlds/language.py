"""Random behaviours and rules over a few individuals, with every kind of condition and effect, nested in one another.

Some behaviours have several effects on the same fact, two parameters with the same individual, symbols that don't exist,
special values (`nowhere`), or variables that only a part of a condition determines.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import product
from random import Random

from confab.reasoner.amounts import COMPARING, OPERATIONS, Amount, Calculation, Expression, Measure, Quantity, written
from confab.reasoner.problem import Domain, Problem
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    AmountEffect,
    AnyOf,
    Behavior,
    ClassCondition,
    Comparison,
    Condition,
    EqualityCondition,
    Parameter,
    RelationCondition,
    Rule,
    SituationType,
    Symbol,
    ValueCondition,
    ValueEffect,
    Witness,
)

CLASSES = {
    "Truth": (FALSE, TRUE),
    "Cup": ("cup1", "cup2"),
    "Shelf": ("shelf1", "shelf2"),
    "Thing": ("cup1", "cup2", "shelf1", "shelf2"),
    "PLACE": ("shelf1", "shelf2", "cup1", "nowhere"),
    "COLOR": ("red", "blue"),
}
SITUATIONS = {
    "PLACE": SituationType("PLACE", ("Cup",), "PLACE", rest="nowhere"),
    "COLOR": SituationType("COLOR", ("Cup", "Shelf"), "COLOR"),
    "FULL": SituationType("FULL", ("Thing",), "Truth", boolean=True),
    "NEAR": SituationType("NEAR", ("Cup", "Shelf"), "Truth", boolean=True),
}
AMOUNTS = {
    "SERVINGS": SituationType("SERVINGS", ("Thing",), "SERVINGS", quantity=Quantity("serving", least=Fraction(0))),
    "WEIGHT": SituationType(
        "WEIGHT", ("Cup", "Shelf"), "WEIGHT", quantity=Quantity("", True, Fraction(-2), Fraction(4))
    ),
}
MEASURES = {"size": ("Thing",), "way": ("Cup", "Shelf")}
DEFINED = {
    "SEEN": SituationType("SEEN", ("Thing",), "Truth", boolean=True),
    "ABOVE": SituationType("ABOVE", ("Thing", "Thing"), "Truth", boolean=True),
    "LOST": SituationType("LOST", ("Cup",), "Truth", boolean=True),
}
"""Situation types with random rules; the first two may depend on each other, the last on the negations of the first two."""
RELATIONS = {"fits": ("Thing", "Thing"), "marked": ("Shelf",)}
DEPTH = 2


class BehaviorWriter:
    """Writes one random behaviour."""

    def __init__(self, rng: Random, defined: Sequence[str] = (), positive: Sequence[str] = ()) -> None:
        self.rng = rng
        self.kinds: dict[str, str] = {}
        self.asked = {**SITUATIONS, **{name: DEFINED[name] for name in defined}}
        self.positive = positive  # situation types that occur only positively
        self.flipped = False

    def behavior(self, name: str, level: int = 1) -> Behavior:
        """Return a random behaviour whose conditions determine all of its variables."""
        rng = self.rng
        parameters = [self.fresh(rng.choice(("Cup", "Shelf", "Thing"))) for _ in range(rng.randrange(3))]
        bound = list(parameters)
        conditions = self.conditions(bound, rng.randrange(4), DEPTH)
        effects = []
        for _ in range(rng.randint(1, 4)):
            inner = list(bound)
            when = self.conditions(inner, rng.randint(1, 2), 1) if rng.random() < 0.4 else []
            effects.append(self.effect(inner, tuple(when)))
        if rng.random() < 0.5:  # a second effect on the fact of another effect
            one = rng.choice(effects)
            value = {TRUE: FALSE, FALSE: TRUE}.get(one.value) or rng.choice(CLASSES[SITUATIONS[one.situation].range])
            own = [t for t in (*one.arguments, one.value) if t.startswith("?") and t not in bound]
            effects.append(ValueEffect(one.situation, one.arguments, value, one.when if own else ()))
        amounts = []
        for _ in range(rng.choice((0, 0, 1, 1, 2, 3))):
            inner = list(bound)
            when = self.conditions(inner, 1, 1) if rng.random() < 0.3 else []
            amounts.append(self.amount_effect(inner, tuple(when)))
        rng.shuffle(conditions)
        rng.shuffle(effects)
        terms = [Parameter(term, self.kinds[term]) for term in self.kinds]
        return Behavior(
            name, level, tuple(t for t in terms if t.name in parameters), tuple(t for t in terms if t.name not in parameters),
            tuple(conditions), tuple(effects), amounts=tuple(amounts),
        )  # fmt: skip

    def rule(self, situation: str) -> Rule:
        """Return a random rule of a defined situation type."""
        wanted = DEFINED[situation].arguments
        parameters = [self.fresh(self.rng.choice((kind, kind, "Cup"))) for kind in wanted]
        conditions = self.conditions(list(parameters), self.rng.randint(1, 3), DEPTH)
        terms = [Parameter(term, self.kinds[term]) for term in self.kinds]
        return Rule(situation, tuple(terms[: len(wanted)]), tuple(terms[len(wanted) :]), tuple(conditions))

    def fresh(self, kind: str) -> str:
        """Return a new variable of a class."""
        term = f"?{kind.lower()}{len(self.kinds)}"
        self.kinds[term] = kind
        return term

    def term(self, bound: list[str]) -> str:
        """Return a bound term or an individual."""
        return self.rng.choice(bound) if bound and self.rng.random() < 0.8 else self.rng.choice(CLASSES["Thing"])

    def conditions(self, bound: list[str], most: int, depth: int) -> list[Condition]:
        """Return a random conjunction; the variables that the conjunction determines are added to `bound`."""
        return [self.condition(bound, depth) for _ in range(most)]

    def condition(self, bound: list[str], depth: int) -> Condition:
        """Return a random condition with limited nesting; the variables that the condition determines are added to `bound`."""
        rng = self.rng
        negated = rng.random() < 0.4
        match rng.choice(("value", "value", "binding", "relation", "class", "equal", "witness", "any", "amount")):
            case "binding":
                situation = rng.choice(("PLACE", "COLOR"))
                arguments = tuple(self.term(bound) for _ in SITUATIONS[situation].arguments)
                kind = "COLOR" if situation == "COLOR" else rng.choice(("Shelf", "PLACE", "Thing"))
                bound.append(self.fresh(kind))
                return ValueCondition(situation, arguments, bound[-1])
            case "relation":
                relation = rng.choice(sorted(RELATIONS))
                return RelationCondition(relation, tuple(self.term(bound) for _ in RELATIONS[relation]), negated)
            case "class":
                return ClassCondition(self.term(bound), rng.choice(("Cup", "Shelf", "COLOR")), negated)
            case "equal":
                return EqualityCondition(self.term(bound), self.term(bound), negated)
            case "amount":
                return Comparison(self.amount(bound, 1), rng.choice(sorted(COMPARING)), self.amount(bound, 1), negated)
            case "witness" if depth:
                variable = self.fresh(kind := rng.choice(("Cup", "Shelf", "Thing")))
                del self.kinds[variable]  # the variable isn't a variable of the behaviour
                self.flipped ^= negated
                inner = self.conditions([*bound, variable], rng.randint(1, 2), depth - 1)
                self.flipped ^= negated
                return Witness(variable, kind, tuple(inner), negated)
            case "any" if depth:
                self.flipped ^= negated
                groups = [self.conditions(list(bound), rng.randint(1, 2), depth - 1) for _ in range(rng.randint(1, 3))]
                self.flipped ^= negated
                return AnyOf(tuple(map(tuple, groups)), negated)
        situation = rng.choice(sorted(self.asked))
        arguments = tuple(self.term(bound) for _ in self.asked[situation].arguments)
        value = rng.choice(CLASSES[self.asked[situation].range])
        if situation in self.positive and (negated is not (value == FALSE)) is not self.flipped:
            negated = not negated
        return ValueCondition(situation, arguments, value, negated)

    def amount(self, bound: list[str], depth: int) -> Expression:
        """Return a random calculation over bound terms that is linear in the changing amounts; amounts may be missing."""
        rng = self.rng
        match rng.choice(
            ("constant", "amount", "amount", "measure", "sum", "product") if depth else ("constant", "amount")
        ):
            case "amount":
                situation = rng.choice(sorted(AMOUNTS))
                return Amount(situation, tuple(self.term(bound) for _ in AMOUNTS[situation].arguments))
            case "measure":
                relation = rng.choice(sorted(MEASURES))
                return Measure(relation, tuple(self.term(bound) for _ in MEASURES[relation]))
            case "sum":
                return Calculation(rng.choice("+-"), self.amount(bound, depth - 1), self.amount(bound, depth - 1))
            case "product":
                size = rng.choice((Fraction(2), Fraction(-1, 2), Fraction(0), Measure("size", (self.term(bound),))))
                return Calculation(rng.choice("*/"), self.amount(bound, depth - 1), size)
            case _:
                return Fraction(rng.randint(-2, 6), rng.choice((1, 1, 2, 3)))

    def amount_effect(self, bound: list[str], when: tuple[Condition, ...]) -> AmountEffect:
        """Return a random effect on an amount."""
        situation = self.rng.choice(sorted(AMOUNTS))
        arguments = tuple(self.term(bound) for _ in AMOUNTS[situation].arguments)
        return AmountEffect(situation, arguments, self.rng.choice(OPERATIONS), self.amount(bound, 1), when)

    def effect(self, bound: list[str], when: tuple[Condition, ...]) -> ValueEffect:
        """Return a random effect on bound terms."""
        rng = self.rng
        situation = rng.choice(sorted(SITUATIONS))
        kind = SITUATIONS[situation].range
        arguments = tuple(self.term(bound) for _ in SITUATIONS[situation].arguments)
        values = [t for t in bound if set(CLASSES[self.kinds[t]]) <= set(CLASSES[kind])]
        value = rng.choice(values) if values and rng.random() < 0.6 else rng.choice(CLASSES[kind])
        return ValueEffect(situation, arguments, value, when)


def language(seed: int, behaviors: int = 2, defined: bool = False) -> Problem:
    """Return a problem of one level with random behaviours, a random state and no goal; with `defined`, also random rules."""
    rng = Random(seed)
    names = tuple(DEFINED) if defined else ()
    made = [BehaviorWriter(rng, names).behavior(f"B{i}") for i in range(behaviors)]
    rules = {}
    for name in names:
        both = names[:2] if name in names[:2] else names
        rules[name] = tuple(
            BehaviorWriter(rng, both, both[:2] if name in names[:2] else (name,)).rule(name)
            for _ in range(rng.randint(1, 3))
        )
    relations = {
        name: frozenset(row for row in product(*(CLASSES[kind] for kind in kinds)) if rng.random() < 0.5)
        for name, kinds in RELATIONS.items()
    }
    initial: dict[Symbol, str] = {}
    for situation in SITUATIONS.values():
        for arguments in product(*(CLASSES[kind] for kind in situation.arguments)):
            value = rng.choice(CLASSES[situation.range])
            if value != FALSE:
                initial[Symbol(situation.name, arguments)] = value
    for name, kinds in (*((s.name, s.arguments) for s in AMOUNTS.values()), *MEASURES.items()):
        rows = {
            row: written(Fraction(rng.randint(0, 4), rng.choice((1, 2)) if name in ("SERVINGS", "size") else 1))
            for row in product(*(CLASSES[kind] for kind in kinds))
            if rng.random() < 0.8
        }
        if name in AMOUNTS:
            initial |= {Symbol(name, row): value for row, value in rows.items()}
        else:
            relations[name] = frozenset((*row, value) for row, value in rows.items())
    situations = SITUATIONS | AMOUNTS | {name: DEFINED[name] for name in names}
    domain = Domain(situations, {b.name: b for b in made}, rules=rules)
    return Problem("random", domain, CLASSES, relations, initial, {})

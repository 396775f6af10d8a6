"""Conditions, effects and calculations as RDF nodes: the properties of each kind of node, and their writing and reading.

A node is an individual of a core class, for example ``:ValueCondition``. The table lists the properties of each class; a negated
condition also has ``:negated true``.

========================  ==================================================================================
class                     properties
========================  ==================================================================================
`:ValueCondition`         ``:situationType``, arguments, ``:value``
`:RelationCondition`      ``:relation``, arguments; the last of several arguments is the ``:value``
`:ClassCondition`         ``:about``, ``:ofClass``
`:EqualityCondition`      ``:about``, ``:value``
`:Witness`                ``:witness`` (the variable), ``:condition`` for each condition
`:AnyOf`                  ``:alternative`` for each condition or `:AllOf`
`:AllOf`                  ``:condition`` for each condition
`:Comparison`             ``:sign``; left side: an amount or ``:left``; right side: ``:amount`` or ``:right``
`:Calculation`            those of a comparison, or only an amount, or only ``:amount``
`:ValueEffect`            those of a value condition, ``:when`` for each condition
`:AmountEffect`           an amount, ``:change``, ``:amount`` or ``:right``, ``:when`` for each condition
========================  ==================================================================================

An `:AnyOf` that enforces a constraint also has ``:enforces`` (`ENFORCED`), with the constrained situation types as arguments.

Arguments are ``:about``, ``:argument2`` and so on (`ARGUMENTS`). An amount is stated by a situation type with its arguments, or by
a relation with all of its arguments except the number.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import ClassVar, TypeAlias, TypeVar

import pyoxigraph as ox

from confab.reasoner.amounts import COMPARING, Amount, Calculation, Expression, Measure, exact, written
from confab.reasoner.symbols import (
    TRUE,
    AmountEffect,
    AnyOf,
    ClassCondition,
    Comparison,
    Condition,
    Constraint,
    Effect,
    EqualityCondition,
    Parameter,
    RelationCondition,
    ValueCondition,
    Witness,
)
from confab.reasoner.vocabulary import ARGUMENTS, CORE, TYPE, XSD

T = TypeVar("T")
NodeValues: TypeAlias = "Mapping[str, Sequence[str]]"
"""The values of a node by the IRI of the property; values are IRIs or the text of literals."""
Properties: TypeAlias = "dict[str, list[str]]"
"""The values of a node by the name of the property in the core."""
STRINGS = ("sign", "change", "aggregate", "enforces")
"""Properties whose values are words."""
LITERALS = {"negated": "boolean", "amount": "decimal", "index": "integer"}
"""Properties whose values are literals but not words, each with the datatype of its values."""
SIGNS = ("+", "-", "*", "/")
ENFORCED = ("never", "always", "atMostOnce", "onlyAfter")
"""The core's properties that state constraints; the last two are about the situation types in `Constraint.about`."""
DEEPEST = 50
"""Maximum depth of nested conditions and calculations. Conjunctions (`:AllOf`) don't count as levels."""
MOST_CONDITIONS = 10_000
"""Maximum number of conditions inside one condition; a condition is counted each time that it occurs."""
DECIMALS = 30
"""Number of decimal places to which a number without a finite decimal notation is rounded."""


# ---------------------------------------------------------------------------------------------------------- properties


def argument_properties(terms: Sequence[str]) -> Properties:
    """Return the properties that state arguments."""
    return {name: [term] for name, term in zip(ARGUMENTS, terms, strict=False)}


def symbol_properties(situation: str, arguments: Sequence[str], value: str | None = None) -> Properties:
    """Return the properties that state a symbol and its value; no value is stated for amounts and true symbols."""
    found = {"situationType": [situation], **argument_properties(arguments)}
    return found if value is None else {**found, "value": [value]}


def relation_properties(relation: str, terms: Sequence[str]) -> Properties:
    """Return the properties that state a relation and its arguments."""
    *first, last = terms
    found = {"relation": [relation], **argument_properties(first or [last])}
    return {**found, "value": [last]} if first else found


def class_properties(term: str, kind: str) -> Properties:
    """Return the properties that state an individual and a class."""
    return {"about": [term], "ofClass": [kind]}


def equality_properties(left: str, right: str) -> Properties:
    """Return the properties that state the two terms of an equality."""
    return {"about": [left], "value": [right]}


def triples(node: ox.NamedNode | ox.BlankNode, properties: Properties) -> Iterator[ox.Triple]:
    """Yield the triples of a node; keys of `properties` are names in the core, or the IRI `TYPE`."""
    for name, values in properties.items():
        prop = ox.NamedNode(name if name == TYPE else CORE + name)
        for value in values:
            yield ox.Triple(node, prop, _object(name, value))


def constraint_properties(constraint: Constraint, spelled: Callable[[str], str]) -> Properties:
    """Return the properties that state which constraint a condition enforces."""
    about = constraint.about or (constraint.situation,)
    word = ENFORCED[1 + len(about)] if constraint.about else ENFORCED[constraint.always]
    return {"enforces": [word], **argument_properties([*map(spelled, about)])}


def _object(name: str, value: str) -> ox.NamedNode | ox.Literal:
    if name in STRINGS:
        return ox.Literal(value)
    if name in LITERALS:
        return ox.Literal(value, datatype=ox.NamedNode(XSD + LITERALS[name]))
    return ox.NamedNode(value)


# ------------------------------------------------------------------------------------------------------------- writing


class NodeWriter:
    """Writer of the nodes of a behaviour, rule or learned item as Turtle statements.

    Parameters
    ----------
    prefix : str
        The prefix that the file declares for the core ontology.
    spelled : callable
        A function that returns the Turtle notation of an individual, class, relation or situation type.
    named : callable
        A function that returns the Turtle notation of a new node, given its kind (``condition``, ``amount``) and its position
        among the nodes.
    variable : callable
        A function that returns the Turtle notation of a witness variable, given its name, the witness's node and the position of
        this node.
    terms : mapping of variable to Turtle notation
        The Turtle notation of the parameters, and of the variables that are bound outside the conditions.
    boolean : callable, optional
        A function that returns whether the value `TRUE` of a situation type can be omitted.

    Attributes
    ----------
    nodes : list of str
        The statements without the final full stop; a node precedes the nodes inside it.
    """

    def __init__(
        self,
        prefix: str,
        spelled: Callable[[str], str],
        named: Callable[[str, int], str],
        variable: Callable[[str, str, int], str],
        terms: Mapping[str, str],
        boolean: Callable[[str], bool] = lambda situation: False,
    ) -> None:
        self.prefix, self.spelled, self.named, self.variable, self.boolean = prefix, spelled, named, variable, boolean
        self.terms = dict(terms)
        self.nodes: list[str] = []

    def put(self, term: str) -> str:
        """Return the Turtle notation of a variable or an individual."""
        return self.terms.get(term) or self.spelled(term)

    def said(self, properties: Properties) -> list[str]:
        """Return properties with their values in Turtle notation."""
        found = []
        for name, values in properties.items():
            objects = [f'"{value}"' for value in values] if name in STRINGS else values
            found += [f"{self.prefix}{name} {', '.join(objects)}"] if objects else []
        return found

    def statement(self, node: str, kind: str, properties: Properties, negated: bool = False) -> str:
        """Return the Turtle statement of a node."""
        head = f"{node} a owl:NamedIndividual, {self.prefix}{kind}"
        return " ; ".join([head, *self.said({**properties, "negated": ["true"] if negated else []})])

    def reserved(self, kind: str) -> tuple[str, int]:
        """Return a new node and the position that is reserved for its statement."""
        self.nodes.append("")
        return self.named(kind, len(self.nodes) - 1), len(self.nodes) - 1

    def symbol(self, situation: str, arguments: Sequence[str], value: str | None = None) -> Properties:
        """Return the properties that state a symbol and its value."""
        if value == TRUE and self.boolean(situation):
            value = None
        own = None if value is None else self.put(value)
        return symbol_properties(self.spelled(situation), [*map(self.put, arguments)], own)

    def condition(self, one: Condition) -> str:
        """Write a condition and its nested conditions, and return its node."""
        node, position = self.reserved("condition")
        match one:
            case ValueCondition(situation, arguments, value):
                kind, properties = "ValueCondition", self.symbol(situation, arguments, value)
            case RelationCondition(relation, arguments):
                kind = "RelationCondition"
                properties = relation_properties(self.spelled(relation), [*map(self.put, arguments)])
            case ClassCondition(term, of):
                kind, properties = "ClassCondition", class_properties(self.put(term), self.spelled(of))
            case EqualityCondition(left, right):
                kind, properties = "EqualityCondition", equality_properties(self.put(left), self.put(right))
            case Witness(variable, of, conditions):
                before, sought = dict(self.terms), self.variable(variable, node, position)
                self.terms[variable] = sought
                self.nodes.append(self.statement(sought, "Variable", {"termType": [self.spelled(of)]}))
                kind, properties = "Witness", {"witness": [sought], "condition": [*map(self.condition, conditions)]}
                self.terms = before
            case AnyOf(alternatives, _, constraint):
                enforced = {} if constraint is None else constraint_properties(constraint, self.spelled)
                kind, properties = "AnyOf", {"alternative": self.groups(alternatives, node), **enforced}
            case Comparison(left, sign, right):
                kind = "Comparison"
                properties = {"sign": [sign], **self.side("left", left), **self.side("right", right)}
        self.nodes[position] = self.statement(node, kind, properties, one.negated)
        return node

    def groups(self, alternatives: Sequence[Sequence[Condition]], node: str) -> list[str]:
        """Write the alternatives of a disjunction as nodes, and return these nodes.

        An alternative with a single condition is represented by the node of the condition.
        """
        return [self.condition(group[0]) if len(group) == 1 else self.all_of(group) for group in alternatives]

    def all_of(self, conditions: Sequence[Condition]) -> str:
        """Write a conjunction, and return its node."""
        node, position = self.reserved("condition")
        self.nodes[position] = self.statement(node, "AllOf", {"condition": [*map(self.condition, conditions)]})
        return node

    def measured(self, one: Amount | Measure) -> Properties:
        """Return the properties that state an amount, or a relation that gives a number."""
        if isinstance(one, Amount):
            return self.symbol(one.situation, one.arguments)
        return {"relation": [self.spelled(one.relation)], **argument_properties([*map(self.put, one.arguments)])}

    def side(self, name: str, one: Expression) -> Properties:
        """Return the properties for one operand; an amount on the left and a number on the right need no separate node."""
        if name == "right" and isinstance(one, Fraction) and finite(one):
            return {"amount": [decimal_text(one)]}
        if name == "left" and isinstance(one, Amount | Measure):
            return self.measured(one)
        return {name: [self.calculation(one)]}

    def calculation(self, one: Expression) -> str:
        """Write a numeric expression with nested expressions, and return its node."""
        node, position = self.reserved("amount")
        match one:
            case Calculation(sign, left, right):
                properties = {"sign": [sign], **self.side("left", left), **self.side("right", right)}
            case Amount() | Measure():
                properties = self.measured(one)
            case number if finite(number):
                properties = {"amount": [decimal_text(number)]}
            case number:
                over, under = Fraction(number.numerator), Fraction(number.denominator)
                properties = {"sign": ["/"], **self.side("left", over), **self.side("right", under)}
        self.nodes[position] = self.statement(node, "Calculation", properties)
        return node

    def effect(self, node: str, one: Effect) -> str:
        """Write an effect as the node `node`, and return this node."""
        when = {"when": [*map(self.condition, one.when)]}
        if isinstance(one, AmountEffect):
            changed = {**self.symbol(one.situation, one.arguments), "change": [one.operation]}
            kind, properties = "AmountEffect", {**changed, **self.side("right", one.amount)}
        else:
            kind, properties = "ValueEffect", self.symbol(one.situation, one.arguments, one.value)
        self.nodes.append(self.statement(node, kind, {**properties, **when}))
        return node


def finite(number: Fraction) -> bool:
    """Return whether a number has a finite decimal notation."""
    return "/" not in written(number)


def decimal_text(number: Fraction) -> str:
    """Return the Turtle notation of a number as a decimal, rounded to `DECIMALS` places.

    >>> decimal_text(Fraction(2)), decimal_text(Fraction(1, 8))
    ('2.0', '0.125')
    """
    text = written(number if finite(number) else Fraction(round(number * 10**DECIMALS), 10**DECIMALS))
    return text if "." in text else f"{text}.0"


# ------------------------------------------------------------------------------------------------------------- reading


class NodeReader:
    """Reader of conditions and numeric expressions from nodes.

    Subclasses implement `term` and `short`, which return the names of terms, classes, relations and situation types, and check
    these names.

    Attributes
    ----------
    error : type of ValueError
    nodes : mapping of IRI to node
    inside : list of str
        The nodes that are being read, from the outermost to the innermost.
    count : list of int
        The number of conditions that have been read inside the outermost node.
    """

    error: ClassVar[type[ValueError]] = ValueError
    nodes: Mapping[str, NodeValues]
    inside: list[str]
    count: list[int]

    def short(self, iri: str) -> str:
        """Return the name of a class, relation, situation type or individual."""
        raise NotImplementedError

    def term(self, iri: str) -> str:
        """Return the name of a variable or an individual."""
        raise NotImplementedError

    def values(self, iri: str, name: str) -> Sequence[str]:
        """Return the values of a node's property."""
        return self.nodes.get(iri, {}).get(CORE + name, ())

    def one(self, iri: str, name: str) -> str:
        """Return the value of a property that must have exactly one value."""
        found = self.values(iri, name)
        if len(found) != 1:
            raise self.error(f"<{iri}>: wanted one c:{name}, found {len(found)}; state it once")
        return found[0]

    def is_a(self, iri: str, *kinds: str) -> bool:
        """Return whether a node is stated to belong to one of some core classes."""
        types = self.nodes.get(iri, {}).get(TYPE, ())
        return any(CORE + kind in types for kind in kinds)

    def word(self, iri: str, name: str, known: Sequence[str]) -> str:
        """Return the value of a property, which must be one of the words in `known`."""
        said = self.one(iri, name)
        if said not in known:
            raise self.error(f"<{iri}>: c:{name} is '{said[:40]}'; wanted one of {' '.join(known)}")
        return said

    def decimal(self, iri: str, name: str) -> Fraction | None:
        """Return the value of a property as an exact number; return None if the property has no value."""
        if not self.values(iri, name):
            return None
        said = self.one(iri, name)
        if (found := exact(said)) is None:
            raise self.error(f"<{iri}>: c:{name} is '{said[:40]}'; wanted a number, like 2 or 1.5")
        return found

    def flag(self, iri: str, name: str) -> bool:
        """Return whether the value of a boolean property is true."""
        said = set(self.values(iri, name))
        if said - {"true", "false", "1", "0"} or len(said) > 1:
            raise self.error(f"<{iri}>: c:{name} is '{' and '.join(sorted(said))[:40]}'; wanted true or false")
        return bool(said & {"true", "1"})

    def arguments(self, iri: str) -> tuple[str, ...]:
        """Return the names of a node's arguments, in order."""
        return tuple(self.term(self.one(iri, name)) for name in ARGUMENTS if self.values(iri, name))

    def situation(self, iri: str) -> str:
        """Return the IRI of a node's situation type."""
        return self.one(iri, "situationType")

    def symbol(self, iri: str) -> tuple[str, tuple[str, ...], str]:
        """Return the situation type, the arguments and the value of a node."""
        value = self.term(self.one(iri, "value")) if self.values(iri, "value") else TRUE
        return self.short(self.situation(iri)), self.arguments(iri), value

    def relation(self, iri: str) -> str:
        """Return the name of a node's relation."""
        return self.short(self.one(iri, "relation"))

    def of_class(self, term: str, kind: str, negated: bool) -> Condition:
        """Return the condition that a term denotes a member of the class with the IRI `kind`."""
        return ClassCondition(term, self.short(kind), negated)

    def sought(self, iri: str) -> tuple[Parameter, tuple[Condition, ...]]:
        """Return the variable of a witness, and the conditions that its class implies."""
        return Parameter(self.term(iri), self.short(self.one(iri, "termType"))), ()

    def in_order(self, parts: Iterable[T]) -> tuple[T, ...]:
        """Return the conjuncts of a conjunction, or the alternatives of a disjunction, in the order in which they are listed."""
        return tuple(parts)

    def entered(self, iri: str, what: str) -> None:
        """Begin to read a node; raise an error if the node contains itself or is nested too deeply."""
        if iri not in self.nodes:
            raise self.error(f"<{iri}> is used as a {what} but isn't declared as one; declare it, or correct the name")
        depth = sum(not self.is_a(node, "AllOf") for node in self.inside)
        if iri in self.inside or depth > DEEPEST or len(self.inside) > 2 * DEEPEST:
            how = "contains itself" if iri in self.inside else f"lies inside more than {DEEPEST} others"
            raise self.error(f"<{iri}>: the {what} {how}; take it out of one of them")
        self.inside.append(iri)

    def condition(self, iri: str) -> Condition:
        """Return the condition of a node; raise an error for a node that contains itself or is nested too deeply."""
        self.entered(iri, "condition")
        self.count[0] = self.count[0] + 1 if len(self.inside) > 1 else 0
        if self.count[0] > MOST_CONDITIONS:
            raise self.error(
                f"<{self.inside[0]}>: more than {MOST_CONDITIONS} conditions, each counted once per occurrence; say less"
            )
        found = self.read(iri)
        self.inside.pop()
        return found

    def read(self, iri: str) -> Condition:
        """Return the condition of a node, according to the node's class."""
        negated = self.flag(iri, "negated")
        if self.is_a(iri, "ValueCondition"):
            return ValueCondition(*self.symbol(iri), negated)
        if self.is_a(iri, "RelationCondition"):
            arguments = (*self.arguments(iri), *map(self.term, self.values(iri, "value")))
            return RelationCondition(self.relation(iri), arguments, negated)
        if self.is_a(iri, "ClassCondition"):
            return self.of_class(self.term(self.one(iri, "about")), self.one(iri, "ofClass"), negated)
        if self.is_a(iri, "EqualityCondition"):
            return EqualityCondition(self.term(self.one(iri, "about")), self.term(self.one(iri, "value")), negated)
        if self.is_a(iri, "Witness"):
            variable, more = self.sought(self.one(iri, "witness"))
            return Witness(variable.name, variable.kind, (*self.conditions(iri, "condition"), *more), negated)
        if self.is_a(iri, "AnyOf"):
            alternatives = self.in_order(map(self.group, self.values(iri, "alternative")))
            return AnyOf(alternatives, negated, self.constraint(iri))
        if self.is_a(iri, "AllOf"):
            return AnyOf((self.conditions(iri, "condition"),), negated)
        if self.is_a(iri, "Comparison"):
            sign = self.word(iri, "sign", tuple(COMPARING))
            return Comparison(self.left(iri), sign, self.right(iri), negated)
        raise self.error(f"<{iri}>: a condition of no known kind; give it one of the subclasses of c:Condition")

    def constraint(self, iri: str) -> Constraint | None:
        """Return the constraint that a condition enforces, or None."""
        if not self.values(iri, "enforces"):
            return None
        word, situation = self.word(iri, "enforces", ENFORCED), self.short(self.one(iri, "about"))
        return Constraint(situation, word == "always", self.arguments(iri) if word in ENFORCED[2:] else ())

    def conditions(self, iri: str, name: str) -> tuple[Condition, ...]:
        """Return the conditions that are the values of a node's property."""
        return self.in_order(condition for value in self.values(iri, name) for condition in self.group(value))

    def group(self, iri: str) -> tuple[Condition, ...]:
        """Return the conjuncts of a conjunction node; for any other node, return the node's condition alone."""
        found = self.condition(iri)
        if self.is_a(iri, "AllOf") and isinstance(found, AnyOf) and not found.negated:
            return found.alternatives[0]
        return (found,)

    def left(self, iri: str) -> Expression:
        """Return the left operand of a node: the value of ``:left``, or the amount that the node itself states."""
        return self.expression(self.one(iri, "left")) if self.values(iri, "left") else self.measured(iri)

    def right(self, iri: str) -> Expression:
        """Return the right operand of a node: the value of ``:right``, or the number ``:amount``."""
        if self.values(iri, "right"):
            return self.expression(self.one(iri, "right"))
        number = self.decimal(iri, "amount")
        if number is None:
            raise self.error(f"<{iri}> has neither c:amount nor c:right; state a number or its terms")
        return number

    def measured(self, iri: str) -> Amount | Measure:
        """Return the amount or the relation whose number a node refers to."""
        if self.values(iri, "relation"):
            return Measure(self.relation(iri), self.arguments(iri))
        return Amount(self.short(self.situation(iri)), self.arguments(iri))

    def expression(self, iri: str) -> Expression:
        """Return the numeric expression of a node: an amount, a number or a calculation."""
        self.entered(iri, "calculation")
        if self.values(iri, "sign"):
            found: Expression = Calculation(self.word(iri, "sign", SIGNS), self.left(iri), self.right(iri))
        else:
            number = self.decimal(iri, "amount")
            found = self.measured(iri) if number is None else number
        self.inside.pop()
        return found

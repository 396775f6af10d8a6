"""SPARQL queries for the arguments with which a behaviour is applicable in a state.

A state is written into a separate named graph (`SITUATION`) with one fact for each symbol, including default values. The
preconditions of a behaviour become SPARQL graph patterns:

=========================  ===================================================================
condition                  pattern
=========================  ===================================================================
`ValueCondition`           ``GRAPH <urn:confab:graph:situation> { ?cup k:location ?l }``
`RelationCondition`        ``?hand k:canReach ?l`` on asserted and inferred facts
`ClassCondition`           ``?cup a/rdfs:subClassOf* k:Cup``
`Comparison`               ``GRAPH … { ?bottle k:servings ?n1 } FILTER(?n1 >= 2)``
`Witness`, `AnyOf`         ``FILTER EXISTS { … }``, with ``||`` between alternatives
negated condition          ``FILTER NOT EXISTS { … }``
=========================  ===================================================================
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from fractions import Fraction
from itertools import chain, product

import pyoxigraph as ox

from confab.reasoner.amounts import Amount, Calculation, Expression, Measure, after_effect
from confab.reasoner.derivation import circular, strata
from confab.reasoner.effects import allowed
from confab.reasoner.graph.knowledge import BASE, SCENE, KnowledgeGraph, text
from confab.reasoner.language import plain_variables
from confab.reasoner.limits import checked
from confab.reasoner.reading.problem import Reading
from confab.reasoner.reading.restating import VALUE_PROPERTIES, said, value_properties
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
    Fact,
    RelationCondition,
    SituationType,
    State,
    Symbol,
    ValueCondition,
    Witness,
)
from confab.reasoner.vocabulary import ARGUMENTS

SITUATION = BASE + "situation"
RELATION_PROPERTIES = (
    "SELECT DISTINCT ?relation WHERE { ?relation a/rdfs:subClassOf* :Relation ; a owl:ObjectProperty }"
)
MOST_TOGETHER = 3
"""Maximum number of other effects on an amount. If a behaviour has more, the query doesn't test the bounds of the amount."""


def write_situation(graph: KnowledgeGraph, reading: Reading, state: State | None = None) -> None:
    """Write a state (by default the initial state) and the facts that follow from the state into the graph `SITUATION`."""
    properties = value_properties(graph)
    graph.store.clear_graph(ox.NamedNode(SITUATION))
    stated = (state or reading.problem.initial).items()
    following = ((symbol, TRUE) for symbol in _following(graph, reading))
    for count, (symbol, value) in enumerate(checked(chain(stated, following), "writing the situation")):
        prop = properties.get(reading.names.iri(symbol.situation))
        graph.extend("situation", said(reading, Fact(symbol, value), prop, ox.BlankNode(f"fact{count}")))


def _following(graph: KnowledgeGraph, reading: Reading) -> Iterator[Symbol]:
    """Yield the facts that follow from the graph `SITUATION`, in the order of derivation.

    The caller must add each fact to the graph before the caller requests the next fact.
    """
    rules, writer = reading.problem.domain.rules, _PatternWriter(graph, reading)
    again = circular(rules)
    for group in strata(rules):
        seen, grown = set[Symbol](), True
        while grown:
            grown = False
            for rule in (rule for name in group for rule in rules[name]):
                for bindings in list(writer.rows(rule.behavior)):
                    symbol = Symbol(rule.situation, tuple(bindings[p.name] for p in rule.parameters))
                    if symbol not in seen:
                        seen.add(symbol)
                        grown = grown or rule.situation in again
                        yield symbol


def _names(condition: Condition, variable: str) -> bool:
    """Return whether a condition, if true, determines the value of a variable."""
    match condition:
        case ValueCondition(_, arguments, value, False) if value != FALSE:
            return variable in (*arguments, value)
        case RelationCondition(_, arguments, False):
            return variable in arguments
        case _:
            return False


def applicable_query(graph: KnowledgeGraph, reading: Reading, behavior: Behavior) -> str:
    """Return the SPARQL query for the arguments and variable bindings with which a behaviour is applicable.

    The query reads the graph `SITUATION`, which `write_situation` fills.
    """
    return _PatternWriter(graph, reading).query(behavior)


def _pairs(graph: KnowledgeGraph, query: str) -> Iterator[tuple[str, str]]:
    return ((text(one), text(other)) for one, other in graph.select(query, SCENE))


def allowed_together(behavior: Behavior, situations: Mapping[str, SituationType]) -> Iterator[Condition]:
    """Yield the preconditions that keep amounts within their bounds if several effects of a behaviour change the same amount.

    Whether two effects change the same symbol depends on their arguments. Each combination of equal and different arguments has its
    own condition.
    """
    for effect in behavior.amounts:
        quantity = situations[effect.situation].quantity
        every = [other for other in behavior.amounts if other.situation == effect.situation and other is not effect]
        others = [other for other in every if _may_coincide(effect, other)]
        if quantity is None or not every or len(others) > MOST_TOGETHER:
            continue
        for same in product((True, False), repeat=len(others)):
            where, together = [*effect.when], [effect]
            for other, is_same in zip(others, same, strict=True):
                pairs = zip(effect.arguments, other.arguments, strict=True)
                equal = (*(EqualityCondition(a, b) for a, b in pairs if a != b), *other.when)
                if not (equal or is_same):
                    break  # both effects always change the same symbol
                if is_same:
                    together.append(other)
                    where += equal
                else:
                    where.append(AnyOf((equal,), negated=True))
            else:
                before = Amount(effect.situation, effect.arguments)
                total: Expression = before
                # in the order in which they are applied
                for one in (one for one in behavior.amounts if one in together):
                    total = after_effect(total, one.operation, one.amount)
                if any(one.operation == "assign" for one in together):
                    where.append(Comparison(before, "=", before))  # an amount that doesn't exist isn't assigned
                for wrong, limit in (("<", quantity.least), (">", quantity.most)):
                    if limit is not None:
                        yield AnyOf(((*where, Comparison(total, wrong, limit)),), negated=True)


def calculable(behavior: Behavior) -> Iterator[Condition]:
    """Yield the preconditions that the price of a behaviour isn't negative and that the numbers of its effects exist."""
    if behavior.price is not None:
        yield Comparison(behavior.price, ">=", Fraction(0))
    for effect in behavior.amounts:
        if not isinstance(effect.amount, Fraction):
            before = Amount(effect.situation, effect.arguments)
            lacking = Comparison(effect.amount, "=", effect.amount, negated=True)
            yield AnyOf(((*effect.when, Comparison(before, "=", before), lacking),), negated=True)


def _may_coincide(one: AmountEffect, other: AmountEffect) -> bool:
    """Return whether two effects can change the same symbol."""
    pairs = zip(one.arguments, other.arguments, strict=True)
    return all(a == b or a.startswith("?") or b.startswith("?") for a, b in pairs)


class _PatternWriter:
    """Translation of conditions to SPARQL patterns."""

    def __init__(self, graph: KnowledgeGraph, reading: Reading) -> None:
        self.graph, self.reading = graph, reading
        self.properties = dict(_pairs(graph, VALUE_PROPERTIES))
        self.numbers = 0  # number of variables for amounts
        self.kinds: dict[str, str] = {}  # the classes of the variables of the behaviour
        self.bound: set[str] = set()  # the variables that aren't local to the present group
        self.relations = {text(iri) for (iri,) in graph.select(RELATION_PROPERTIES, SCENE)}

    def rows(self, behavior: Behavior) -> Iterator[dict[str, str]]:
        """Yield each binding of parameters and variables with which a behaviour is applicable; no binding is repeated."""
        names = self.names(behavior)
        for row in self.graph.select(self.query(behavior, ordered=False), SCENE):
            yield {name: self.reading.names.short(text(term)) for name, term in zip(names, row, strict=True)}

    def names(self, behavior: Behavior) -> list[str]:
        """Return the variables that a query binds: the parameters in order, then the variables determined by value conditions."""
        found = dict.fromkeys(parameter.name for parameter in behavior.parameters)
        for condition in behavior.preconditions:
            if isinstance(condition, ValueCondition) and not condition.negated and condition.value.startswith("?"):
                found[condition.value] = None
        return list(found)

    def query(self, behavior: Behavior, ordered: bool = True) -> str:
        names = self.names(behavior)
        kinds = behavior.kinds
        self.kinds, self.bound = dict(kinds), {*names, *plain_variables(behavior.preconditions)}
        situations = self.reading.problem.domain.situations
        bounds = (*allowed(behavior, situations), *allowed_together(behavior, situations), *calculable(behavior))
        conditions = (*behavior.preconditions, *bounds)
        lines = [f"{{ SELECT DISTINCT {name} WHERE {{ {self.typed(name, kinds[name])} }} }}" for name in names]
        lines += [line for condition in conditions for line in self.pattern(condition)]
        head = f"# {behavior.name}: where its preconditions hold in the graph {SITUATION}\n"
        chosen = " ".join(names) or "(1 AS ?once)"
        order = " ".join(names)
        body = "\n".join(f"  {line}" for line in lines)
        return f"{head}SELECT DISTINCT {chosen} WHERE {{\n{body}\n}}" + (
            f" ORDER BY {order}" if order and ordered else ""
        )

    def typed(self, name: str, kind: str) -> str:
        if kind in self.reading.names:
            return f"{name} a owl:NamedIndividual ; a/rdfs:subClassOf* <{self.reading.names.iri(kind)}> ."
        parts = " UNION ".join(
            f"{{ {name} a/rdfs:subClassOf* <{self.reading.names.iri(part)}> }}" for part in kind.split("|")
        )
        return parts + f" {name} a owl:NamedIndividual ."

    def term(self, name: str) -> str:
        return name if name.startswith("?") else f"<{self.reading.names.iri(name)}>"

    def pattern(self, condition: Condition) -> Iterator[str]:
        """Yield the SPARQL lines for a condition."""
        if condition.negated:
            inner = " ".join(self.positive(condition))
            yield f"FILTER NOT EXISTS {{ {inner} }}"
        elif isinstance(condition, Witness):
            yield f"FILTER EXISTS {{ {' '.join(self.positive(condition))} }}"
        else:
            yield from self.positive(condition)

    def positive(self, condition: Condition) -> Iterator[str]:
        """Yield the SPARQL lines for a condition without its negation."""
        match condition:
            case ValueCondition(situation, arguments, value):
                yield self.value(situation, arguments, value)
            case RelationCondition(relation, arguments):
                yield self.relation(relation, arguments)
            case ClassCondition(term, kind):
                yield self.typed(self.term(term), kind)
            case EqualityCondition(left, right):
                yield f"FILTER({self.term(left)} = {self.term(right)})"
            case Witness(variable, kind, conditions):
                self.kinds[variable] = kind
                yield from self.group(conditions, {variable})
                known = any(_names(inner, variable) for inner in conditions)
                # If the conditions bind the variable, a test of the class is hundreds of times as fast as a join.
                yield f"FILTER EXISTS {{ {self.typed(variable, kind)} }}" if known else self.typed(variable, kind)
            case AnyOf(alternatives):
                said = (" ".join(self.group(alternative)) for alternative in alternatives)
                yield "FILTER(" + " || ".join(f"EXISTS {{ {group} }}" for group in said) + ")"
            case Comparison(left, sign, right):
                patterns: list[str] = []
                test = f"FILTER({self.amount(left, patterns)} {sign} {self.amount(right, patterns)})"
                yield from (*patterns, test)

    def group(self, conditions: Sequence[Condition], typed: AbstractSet[str] = frozenset()) -> list[str]:
        """Return the SPARQL lines for a group of conditions, with the classes of its local variables except those in `typed`."""
        plain, bound = plain_variables(conditions), self.bound
        self.bound = bound | plain | typed
        lines = [line for inner in conditions for line in self.pattern(inner)]
        self.bound = bound
        for name in sorted((plain & self.kinds.keys()) - bound - typed):
            if not any(self.has_class(inner, name) for inner in conditions):
                known, said = any(_names(inner, name) for inner in conditions), self.typed(name, self.kinds[name])
                lines.append(f"FILTER EXISTS {{ {said} }}" if known else said)
        return lines

    def has_class(self, condition: Condition, variable: str) -> bool:
        """Return whether a condition determines a variable, and each value that it can determine has the variable's class."""
        match condition:
            case ValueCondition(situation, _, value, False) if value == variable:
                problem = self.reading.problem
                return problem.below(problem.domain.situations[situation].range, self.kinds[variable])
            case _:
                return False

    def having(self, situation: str, arguments: Sequence[str]) -> Iterator[str]:
        """Yield the SPARQL lines for the condition that individuals have a situation type, unless their classes imply it."""
        problem = self.reading.problem
        for term, kind in zip(arguments, problem.domain.situations[situation].arguments, strict=True):
            known = problem.below(self.kinds[term], kind) if term in self.kinds else term in problem.members(kind)
            if not known:
                yield f"FILTER EXISTS {{ {self.typed(self.term(term), kind)} }}"

    def amount(self, expression: Expression, patterns: list[str]) -> str:
        """Return the SPARQL expression of a numeric expression, and add the patterns that bind its variables to `patterns`."""
        match expression:
            case Calculation(sign, left, right):
                return f"({self.amount(left, patterns)} {sign} {self.amount(right, patterns)})"
            case Amount(situation, arguments):
                iri, where = self.reading.names.iri(situation), f"GRAPH <{SITUATION}> "
                said = f"[] :situationType <{iri}> ; "
                prop = self.properties.get(iri)
            case Measure(relation, arguments):
                prop, where = self.reading.names.iri(relation), ""
                said = f"[] a :SituatedObjectInstance ; :relation <{prop}> ; "
            case number:
                return f"({number.numerator}.0 / {number.denominator})"
        self.numbers += 1
        name, terms = f"?amount_{self.numbers}", [self.term(argument) for argument in arguments]
        if prop and len(terms) == 1:
            patterns.append(f"{where}{{ {terms[0]} <{prop}> {name} }}")
        else:
            parts = " ; ".join(f":{part} {term}" for part, term in zip(ARGUMENTS, terms, strict=False))
            patterns.append(f"{where}{{ {said}{parts} ; :amount {name} }}")
        return name

    def value(self, situation: str, arguments: tuple[str, ...], value: str) -> str:
        if value == FALSE:
            false = f"FILTER NOT EXISTS {{ {self.value(situation, arguments, TRUE)} }}"
            return " ".join([*self.having(situation, arguments), false])
        terms = [self.term(argument) for argument in (*arguments, *([] if value == TRUE else [value]))]
        prop = self.properties.get(self.reading.names.iri(situation))
        if prop and len(terms) == 2:
            return f"GRAPH <{SITUATION}> {{ {terms[0]} <{prop}> {terms[1]} }}"
        parts = [f":{name} {self.term(argument)}" for name, argument in zip(ARGUMENTS, arguments, strict=False)]
        parts += [] if value == TRUE else [f":value {terms[-1]}"]
        said = " ; ".join([f":situationType <{self.reading.names.iri(situation)}>", *parts])
        return f"GRAPH <{SITUATION}> {{ [] {said} }}"

    def relation(self, relation: str, arguments: tuple[str, ...]) -> str:
        iri, terms = self.reading.names.iri(relation), [self.term(argument) for argument in arguments]
        if iri in self.relations and len(terms) == 2:
            return f"{terms[0]} <{iri}> {terms[1]} ."
        parts = [f":{name} {term}" for name, term in zip(ARGUMENTS, terms, strict=False)]
        return f"[] a :SituatedObjectInstance ; :relation <{iri}> ; {' ; '.join(parts)} ."

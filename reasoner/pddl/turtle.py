"""A planning problem written as a scene in Turtle: what `confab.reasoner.reading.problem` reads back as the same problem.

Domain and scene go into one file. Every condition and effect is an individual with an IRI of its own, so that Protégé
shows and edits it. Effects are numbered in the order in which they are made.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property

import pyoxigraph as ox

from confab.reasoner.amounts import Amount, Calculation, Expression, Measure, bounds, written
from confab.reasoner.language import measures
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
    Problem,
    RelationCondition,
    Rule,
    SituationType,
    Span,
    Symbol,
    Times,
    Timing,
    ValueCondition,
    ValueEffect,
    Witness,
    substituted,
)
from confab.reasoner.timing import timing_of
from confab.reasoner.vocabulary import ARGUMENTS, CORE, OWL, RDFS, SKOS, XSD

HEADER = f"""\
@prefix :        <{{scene}}#> .
@prefix c:       <{CORE}> .
@prefix owl:     <{OWL}> .
@prefix rdfs:    <{RDFS}> .
@prefix skos:    <{SKOS}> .
@prefix xsd:     <{XSD}> .
@prefix dcterms: <http://purl.org/dc/terms/> .

<{{scene}}> a owl:Ontology ;
  owl:imports <https://w3id.org/confab/core> ;
  owl:versionIRI <{{scene}}/1> ;
  c:symbolicOnly true ;
  dcterms:title {{title}}@en ;
  dcterms:description {{description}}@en .
"""
CORE_CLASSES = ("Object", "Truth", "Hand", "Robot")
Said = Mapping[str, str]
"""The origin of a name, written as its label."""


def turtle(problem: Problem, title: str, description: str, labels: Said | None = None) -> str:
    """Return a scene file that states everything in a problem.

    Parameters
    ----------
    problem : Problem
        Its names become the local names of IRIs in the namespace of its scene.
    title, description : str
    labels : mapping of name to label, optional
        A name without one is its own label.
    """
    writer = _SceneWriter(problem, dict(labels or {}))
    header = HEADER.format(scene=problem.scene, title=_quoted(title), description=_quoted(description))
    return header + "\n".join(writer.lines()) + "\n"


def _quoted(text: str) -> str:
    return str(ox.Literal(text.replace("\n", " ")))


@dataclass
class _SceneWriter:
    problem: Problem
    labels: dict[str, str]
    nodes: list[str] = field(default_factory=list)  # of the behaviour being written
    terms: dict[str, str] = field(default_factory=dict)  # its terms' IRIs
    where: str = ""

    def lines(self) -> Iterator[str]:
        domain = self.problem.domain
        yield _banner("Objects")
        yield from self.classes()
        yield _banner("Situation types and relations")
        for situation in domain.situations.values():
            yield from self.situation(situation)
        yield from self.relations()
        for name, rules in domain.rules.items():
            for number, rule in enumerate(rules, start=1):
                yield from self.rule(f"{name}.rule{number}", rule)
        yield _banner("Behaviours")
        for index, behavior in enumerate(domain.behaviors.values(), start=1):
            yield from self.behavior(index, behavior)
        yield _banner("The scene")
        yield from self.individuals()
        yield from self.facts()
        yield _banner("What is wanted")
        yield from self.task()

    def iri(self, name: str) -> str:
        if name in (TRUE, FALSE) or name in CORE_CLASSES:
            return f"c:{name}"
        return f":{name}"

    def node(self, name: str, kinds: str, text: str, *pairs: tuple[str, str | Sequence[str]]) -> str:
        """Return one subject with its label, its definition if any, and its properties."""
        said = [f"{self.iri(name)} a {kinds} ; rdfs:label {_quoted(self.labels.get(name, name))}@en"]
        if text:
            said.append(f"skos:definition {_quoted(text)}@en")
        for key, values in pairs:
            found = [values] if isinstance(values, str) else list(values)
            if found:
                said.append(f"{key} {', '.join(found)}")
        return " ;\n  ".join(said) + " ."

    def classes(self) -> Iterator[str]:
        situations = self.problem.domain.situations
        for kind in self.problem.classes:
            if kind in CORE_CLASSES or kind in situations or "|" in kind:
                continue
            above = [self.iri(k) for k in self.problem.parents.get(kind, ())]
            if all(k in situations for k in self.problem.parents.get(kind, ())):
                above.insert(0, "c:Object")
            own = [self.iri(s.name) for s in situations.values() if s.arguments == (kind,)]
            text = f"A thing that the domain calls {self.labels.get(kind, kind)}."
            pairs = (("rdfs:subClassOf", above), ("c:hasSituationType", own))
            yield self.node(kind, "owl:Class, owl:NamedIndividual", text, *pairs)

    def situation(self, one: SituationType) -> Iterator[str]:
        if one.quantity is not None:
            yield from self.amount(one)
            return
        single = len(one.arguments) == 1
        pairs: list[tuple[str, str | Sequence[str]]] = []
        if one.level != 1:
            pairs.append(("c:fromLevel", str(one.level)))
        for key, value in (("c:restValue", one.rest), ("c:defaultValue", one.default)):
            if (
                value is not None
                and not (one.boolean and value == FALSE)
                and not (key == "c:defaultValue" and value == one.rest)
            ):
                pairs.append((key, self.iri(value)))
        if not single:
            pairs.append(("c:parameter", [f":{one.name}.{i}" for i in range(1, len(one.arguments) + 1)]))
        if single and not one.boolean:
            pairs.append(("c:valueProperty", f":{one.name}.value"))
        said = "Whether it holds." if one.boolean else "Which of its values holds."
        yield self.node(one.name, "owl:Class, owl:NamedIndividual, c:SituationType", said, *pairs)
        if single and not one.boolean:
            yield self.node(
                f"{one.name}.value",
                "owl:ObjectProperty, owl:FunctionalProperty, owl:NamedIndividual",
                f"Relates an object to its value of {one.name}.",
                ("rdfs:domain", self.iri(one.arguments[0])),
                ("rdfs:range", self.iri(one.name)),
            )
        if not single:
            for i, kind in enumerate(one.arguments, start=1):
                yield self.term(f"{one.name}.{i}", "c:Parameter", i, kind)

    def amount(self, one: SituationType) -> Iterator[str]:
        """Yield a situation type whose values are numbers."""
        quantity, single = one.quantity, len(one.arguments) == 1
        assert quantity is not None
        pairs: list[tuple[str, str | Sequence[str]]] = [("c:fromLevel", str(one.level))] if one.level != 1 else []
        limits = (("least", quantity.least), ("most", quantity.most), ("default", Fraction(one.default or 0)))
        for name, limit in limits:
            if limit is not None and (name != "default" or one.default is not None):
                pairs.append((f"c:{name}Amount", decimal(limit)))
        pairs += [("c:unit", _quoted(quantity.unit))] if quantity.unit else []
        if single:
            pairs.append(("c:valueProperty", f":{one.name}.value"))
        else:
            pairs.append(("c:parameter", [f":{one.name}.{i}" for i in range(1, len(one.arguments) + 1)]))
            pairs += [("c:wholeNumbers", "true")] if quantity.whole else []
        yield self.node(one.name, "owl:NamedIndividual, c:SituationType, c:Amount", "How much it is.", *pairs)
        if single:
            yield self.node(
                f"{one.name}.value",
                "owl:DatatypeProperty, owl:FunctionalProperty, owl:NamedIndividual",
                f"Says how much {one.name} is.",
                ("rdfs:domain", self.iri(one.arguments[0])),
                ("rdfs:range", "xsd:integer" if quantity.whole else "xsd:decimal"),
            )
        for i, kind in enumerate(() if single else one.arguments, start=1):
            yield self.term(f"{one.name}.{i}", "c:Parameter", i, kind)

    @cached_property
    def measures(self) -> frozenset[str]:
        """The relations that behaviours use as numbers."""
        return measures(self.problem.domain.behaviors.values())

    def term(self, name: str, kind_of_term: str, index: int | None, kind: str) -> str:
        said = [f":{name} a owl:NamedIndividual, {kind_of_term}"]
        said += [f"c:index {index}"] if index is not None else []
        return " ; ".join([*said, f"c:termType {self.iri(kind)}"]) + " ."

    def relations(self) -> Iterator[str]:
        for relation, tuples in self.problem.relations.items():
            binary = all(len(row) == 2 for row in tuples)
            prop = "owl:DatatypeProperty" if relation in self.measures else "owl:ObjectProperty"
            kinds = f"{prop}, owl:NamedIndividual, c:Relation" if binary else "owl:NamedIndividual, c:Relation"
            yield self.node(relation, kinds, "Holds or not, whatever is done.")

    def behavior(self, index: int, one: Behavior) -> Iterator[str]:
        self.where, self.nodes = one.name, []
        self.terms = {t.name: f":{one.name}.{t.name[1:]}" for t in (*one.parameters, *one.variables)}
        timing = timing_of(one)
        timed = sorted(timing.conditions, key=lambda pair: pair[0] is Span.THROUGHOUT)
        known = {c for _, c in timed}
        asked = [*timed, *((Span.THROUGHOUT, c) for c in one.asked if c not in known)]
        conditions = [self.spanned(self.condition(c), span) for span, c in asked if c not in (one.priced, one.lasting)]
        effects = []
        values = [(span, e) for span, e in timing.effects if isinstance(e, ValueEffect)]
        changes = [(span, e) for span, e in timing.effects if isinstance(e, AmountEffect)]
        for position, (span, effect) in enumerate(values, start=1):
            when = [self.condition(c) for c in effect.when]
            iri = f":{one.name}.effect{position:03}"
            at = self.value(Symbol(effect.situation, effect.arguments), effect.value)
            self.nodes.append(f"{iri} a owl:NamedIndividual, c:ValueEffect ; {at}{_some('c:when', when)} .")
            effects.append(self.spanned(iri, span))
        for position, (span, change) in enumerate(changes, start=len(values) + 1):
            when = [self.condition(c) for c in change.when]
            iri = f":{one.name}.effect{position:03}"
            at = " ; ".join([f"c:situationType {self.iri(change.situation)}", *self.arguments(change.arguments)])
            by = self.side("right", change.amount)
            said = f'c:AmountEffect ; {at} ; c:change "{change.operation}" ; {by}{_some("c:when", when)}'
            self.nodes.append(f"{iri} a owl:NamedIndividual, {said} .")
            effects.append(self.spanned(iri, span))
        cost = [] if one.cost == 1 else [f"{one.cost:f}"]
        price = [] if one.price is None else [self.calculation(one.price)]
        yield self.node(
            one.name,
            "owl:NamedIndividual, c:Behavior",
            f"The behaviour {self.labels.get(one.name, one.name)}.",
            ("c:level", str(one.level)),
            ("c:index", str(index)),
            ("c:cost", cost),
            ("c:price", price),
            *self.lasting(one.name, timing),
            ("c:parameter", [self.terms[p.name] for p in one.parameters]),
            ("c:precondition", conditions),
            ("c:postcondition", effects),
        )
        for i, parameter in enumerate(one.parameters, start=1):
            yield self.term(self.terms[parameter.name][1:], "c:Parameter", i, parameter.kind)
        for variable in one.variables:
            yield self.term(self.terms[variable.name][1:], "c:Variable", None, variable.kind)
        yield from self.nodes

    def spanned(self, iri: str, span: Span) -> str:
        """Say the span of a condition or an effect, if it isn't throughout; return its IRI."""
        if span is not Span.THROUGHOUT:
            self.nodes.append(f"{iri} c:during c:{span.value} .")
        return iri

    def lasting(self, name: str, timing: Timing) -> Iterator[tuple[str, str | Sequence[str]]]:
        """Yield what is said of the duration and the actors of a behaviour."""
        if isinstance(timing.duration, Fraction):
            yield "c:duration", seconds_text(timing.duration)
        elif timing.duration is not None:
            yield "c:calculatedDuration", self.calculation(timing.duration)
        yield "c:actor", [self.put(actor) for actor in timing.actors]
        at = (self.problem.times or Times()).events.get(name)
        if at is not None:
            yield "c:happensAt", seconds_text(at)

    def rule(self, name: str, one: Rule) -> Iterator[str]:
        self.where, self.nodes = name, []
        self.terms = {t.name: f":{name}.{t.name[1:]}" for t in (*one.parameters, *one.variables)}
        conditions = [self.condition(c) for c in one.conditions]
        head = self.value(Symbol(one.situation, tuple(p.name for p in one.parameters)), TRUE)
        yield f":{name} a owl:NamedIndividual, c:Rule ; {head}{_some('c:condition', conditions)} ."
        for i, parameter in enumerate(one.parameters, start=1):
            yield self.term(self.terms[parameter.name][1:], "c:Parameter", i, parameter.kind)
        for variable in one.variables:
            yield self.term(self.terms[variable.name][1:], "c:Variable", None, variable.kind)
        yield from self.nodes

    def put(self, term: str) -> str:
        return self.terms.get(term) or self.iri(term)

    def value(self, symbol: Symbol, value: str) -> str:
        """Return the properties that state the value of a symbol, which may contain variables."""
        said = [f"c:situationType {self.iri(symbol.situation)}", *self.arguments(symbol.arguments)]
        if not (self.problem.domain.situations[symbol.situation].boolean and value == TRUE):
            said.append(f"c:value {self.put(value)}")
        return " ; ".join(said)

    def arguments(self, terms: Sequence[str]) -> list[str]:
        names = (f"c:{name}" for name in ARGUMENTS)
        return [f"{name} {self.put(term)}" for name, term in zip(names, terms, strict=False)]

    def condition(self, one: Condition) -> str:
        """Write a condition with its nested conditions; return its IRI."""
        position = len(self.nodes)
        self.nodes.append("")
        iri = f":{self.where}.condition{position:03}"
        no = " ; c:negated true" if one.negated else ""
        match one:
            case ValueCondition(situation, arguments, value):
                said = f"c:ValueCondition ; {self.value(Symbol(situation, arguments), value)}"
            case RelationCondition(relation, terms):
                last = [f"c:value {self.put(terms[-1])}"] if len(terms) > 1 else []
                parts = [*self.arguments(terms[:-1] if last else terms), *last]
                said = f"c:RelationCondition ; c:relation {self.iri(relation)} ; {' ; '.join(parts)}"
            case ClassCondition(term, kind):
                said = f"c:ClassCondition ; c:about {self.put(term)} ; c:ofClass {self.iri(kind)}"
            case EqualityCondition(left, right):
                said = f"c:EqualityCondition ; c:about {self.put(left)} ; c:value {self.put(right)}"
            case Witness(variable, kind, conditions):
                if variable in self.terms:  # of another part of the behaviour: a node is one term
                    own = f"{variable}_{position}"
                    conditions = tuple(substituted(c, {variable: own}) for c in conditions)
                    variable = own
                self.terms[variable] = f":{self.where}.{variable[1:]}"
                self.nodes.append(self.term(self.terms[variable][1:], "c:Variable", None, kind))
                inner = [self.condition(c) for c in conditions]
                said = f"c:Witness ; c:witness {self.terms[variable]}{_some('c:condition', inner)}"
            case AnyOf(alternatives):
                groups = [self.group(group) for group in alternatives]
                said = f"c:AnyOf{_some('c:alternative', groups)}"
            case Comparison(left, sign, right):
                said = f'c:Comparison ; c:sign "{sign}" ; {self.side("left", left)} ; {self.side("right", right)}'
        self.nodes[position] = f"{iri} a owl:NamedIndividual, {said}{no} ."
        return iri

    def side(self, name: str, one: Expression) -> str:
        """Return the property for an amount; a number on the right and a symbol on the left need no node."""
        if name == "right" and isinstance(one, Fraction) and _ends(one):
            return f"c:amount {decimal(one)}"
        if name == "left" and isinstance(one, Amount | Measure):
            return self.measured(one)
        return f"c:{name} {self.calculation(one)}"

    def calculation(self, one: Expression) -> str:
        """Write a calculation with its nested ones; return its IRI."""
        position = len(self.nodes)
        self.nodes.append("")
        iri = f":{self.where}.amount{position:03}"
        match one:
            case Calculation(sign, left, right):
                said = f'c:sign "{sign}" ; {self.side("left", left)} ; {self.side("right", right)}'
            case Amount() | Measure():
                said = self.measured(one)
            case number if _ends(number):
                said = f"c:amount {decimal(number)}"
            case number:
                whole = Calculation("/", Fraction(number.numerator), Fraction(number.denominator))
                said = f'c:sign "/" ; {self.side("left", whole.left)} ; {self.side("right", whole.right)}'
        self.nodes[position] = f"{iri} a owl:NamedIndividual, c:Calculation ; {said} ."
        return iri

    def measured(self, one: Amount | Measure) -> str:
        key, name = ("situationType", one.situation) if isinstance(one, Amount) else ("relation", one.relation)
        return " ; ".join([f"c:{key} {self.iri(name)}", *self.arguments(one.arguments)])

    def group(self, conditions: Sequence[Condition]) -> str:
        if len(conditions) == 1:
            return self.condition(conditions[0])
        position = len(self.nodes)
        self.nodes.append("")
        inner = [self.condition(c) for c in conditions]
        iri = f":{self.where}.condition{position:03}"
        self.nodes[position] = f"{iri} a owl:NamedIndividual, c:AllOf{_some('c:condition', inner)} ."
        return iri

    def individuals(self) -> Iterator[str]:
        """Yield every individual with its lowest class, in the order in which the classes list them."""
        classes = self.problem.classes
        order = [name for kind in classes if kind not in CORE_CLASSES for name in classes[kind]]
        names = [name for name in dict.fromkeys(order) if name not in (TRUE, FALSE)]
        above = {kind: set(self.above(kind)) - {kind} for kind in classes}
        of: dict[str, list[str]] = {name: [] for name in names}
        for kind, members in classes.items():
            if "|" in kind or (kind in CORE_CLASSES and kind not in ("Hand", "Robot")):
                continue
            for name in members:
                if name in of:
                    of[name].append(kind)
        for index, name in enumerate(names, start=1):
            kinds = [k for k in of[name] if not any(k in above[other] for other in of[name])]
            said = ", ".join(["owl:NamedIndividual", *map(self.iri, kinds)])
            label = _quoted(self.labels.get(name, name))
            yield f"{self.iri(name)} a {said} ; c:index {index} ; rdfs:label {label}@en ."
        if len(names) > 1:
            different = " ".join(sorted(map(self.iri, names)))  # the OWL API, and so Protégé, saves them in this order
            yield f"[ a owl:AllDifferent ; owl:distinctMembers ( {different} ) ] ."

    def above(self, kind: str) -> Iterator[str]:
        yield kind
        for parent in self.problem.parents.get(kind, ()):
            yield from self.above(parent)

    def facts(self) -> Iterator[str]:
        situations, number = self.problem.domain.situations, 0
        for symbol, value in self.problem.initial.items():
            situation = situations[symbol.situation]
            if value in (situation.default, situation.rest) or (situation.boolean and value == FALSE):
                continue
            if situation.quantity is not None:
                amount = decimal(Fraction(value))
                if len(symbol.arguments) == 1:
                    yield f"{self.iri(symbol.arguments[0])} :{situation.name}.value {amount} ."
                    continue
                number += 1
                said = self.measured(Amount(symbol.situation, symbol.arguments))
                yield f":fact{number} a owl:NamedIndividual, c:SituatedObjectInstance ; {said} ; c:amount {amount} ."
            elif len(symbol.arguments) == 1 and not situation.boolean:
                yield f"{self.iri(symbol.arguments[0])} :{situation.name}.value {self.iri(value)} ."
            else:
                number += 1
                yield f":fact{number} a owl:NamedIndividual, c:SituatedObjectInstance ; {self.value(symbol, value)} ."
        for relation, tuples in self.problem.relations.items():
            binary = all(len(row) == 2 for row in tuples)
            for row in sorted(tuples):
                if relation in self.measures:
                    amount = decimal(Fraction(row[-1]))
                    if binary:
                        yield f"{self.iri(row[0])} {self.iri(relation)} {amount} ."
                        continue
                    number += 1
                    said = self.measured(Measure(relation, row[:-1]))
                    yield f":fact{number} a owl:NamedIndividual, c:SituatedObjectInstance ; {said} ; c:amount {amount} ."
                    continue
                if binary:
                    yield f"{self.iri(row[0])} {self.iri(relation)} {self.iri(row[1])} ."
                    continue
                number += 1
                last = [f"c:value {self.iri(row[-1])}"] if len(row) > 1 else []
                parts = " ; ".join([*self.arguments(row[:-1] if last else row), *last])
                kinds = "owl:NamedIndividual, c:SituatedObjectInstance"
                yield f":fact{number} a {kinds} ; c:relation {self.iri(relation)} ; {parts} ."

    def task(self) -> Iterator[str]:
        goals = [Fact(symbol, part) for symbol, value in self.problem.goal.items() for part in value.split(",")]
        iris = [f":goal{i}" for i in range(1, len(goals) + 1)]
        yield f':task a owl:NamedIndividual, c:Task ; rdfs:label "task"@en{_some("c:goal", iris)} .'
        for iri, fact in zip(iris, goals, strict=True):
            if self.problem.domain.situations[fact.symbol.situation].quantity is not None:
                [(sign, limit)] = bounds(fact.value)
                at = self.measured(Amount(fact.symbol.situation, fact.symbol.arguments))
                yield f'{iri} a owl:NamedIndividual, c:Comparison ; {at} ; c:sign "{sign}" ; c:amount {decimal(limit)} .'
                continue
            yield f"{iri} a owl:NamedIndividual, c:ValueCondition ; {self.value(fact.symbol, fact.value)} ."


def seconds_text(seconds: Fraction) -> str:
    """Return seconds as a literal in Turtle.

    >>> seconds_text(Fraction(5, 2))
    '"PT2.5S"^^xsd:dayTimeDuration'
    """
    text = written(seconds) if _ends(seconds) else written(Fraction(round(seconds * 10**12), 10**12))
    return f'"PT{text}S"^^xsd:dayTimeDuration'


def _ends(number: Fraction) -> bool:
    """Return whether a number has a finite decimal form."""
    return "/" not in written(number)


def decimal(number: Fraction) -> str:
    """Return a number as a decimal in Turtle; an infinite decimal fraction is cut off after thirty places."""
    text = written(number)
    if "/" in text:
        text = written(Fraction(round(number * 10**30), 10**30))
    return text if "." in text else f"{text}.0"


def _some(key: str, values: Sequence[str]) -> str:
    return f" ; {key} {', '.join(values)}" if values else ""


def _banner(text: str) -> str:
    return f"\n{'#' * 65}  {text}\n"

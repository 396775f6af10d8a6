"""Export of a planning problem as a scene in Turtle, from which `confab.reasoner.reading.problem` reads the same problem.

Domain and scene are in one file. Every condition and effect is an individual with an IRI, so that Protégé can show and
edit conditions and effects. Effects are numbered in the order of their execution.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import chain
from typing import TypeAlias

import pyoxigraph as ox

from confab.reasoner.amounts import Measure, bounds, written
from confab.reasoner.condition_nodes import NodeWriter, Properties, decimal_text, finite, relation_properties
from confab.reasoner.language import measures
from confab.reasoner.limits import checked
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    AmountEffect,
    Behavior,
    Fact,
    Parameter,
    Rule,
    SituationType,
    Span,
    Times,
    Timing,
)
from confab.reasoner.timing import timing_of
from confab.reasoner.vocabulary import CORE, OWL, RDFS, SKOS, XSD

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
"""Mapping from names to labels, for example to the original PDDL names."""
_TurtleFact: TypeAlias = "tuple[str, str, str, Properties]"
"""A fact: its subject, its value property (or an empty text), its value, and the properties of its node. Only a fact without a
value property has a node.
"""


def turtle(problem: Problem, title: str, description: str, labels: Said | None = None) -> str:
    """Return the text of a scene file that is equivalent to a problem.

    Parameters
    ----------
    problem : Problem
        The problem, whose names become local names of IRIs in the namespace of the scene.
    title, description : str
        The title and the description of the scene.
    labels : mapping of name to label, optional
        The labels of names; a name without an entry is its own label.
    """
    writer = _SceneWriter(problem, dict(labels or {}))
    header = HEADER.format(scene=problem.scene, title=_quoted(title), description=_quoted(description))
    return header + "\n".join(checked(writer.lines(), "writing the scene")) + "\n"


def _quoted(text: str) -> str:
    return str(ox.Literal(text.replace("\n", " ")))


@dataclass
class _SceneWriter:
    problem: Problem
    labels: dict[str, str]

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
        """Return the Turtle statements of one subject: classes, label, definition (unless `text` is empty) and properties."""
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
        constraint = self.problem.domain.constraints.get(f"{one.name}.exceptions")
        if constraint is not None:
            pairs.append(("c:always" if constraint.always else "c:never", "true"))
        if one.name in self.problem.domain.remembers:
            pairs.append(("c:remembers", self.iri(self.problem.domain.remembers[one.name])))
            pairs = [pair for pair in pairs if pair[0] != "c:fromLevel"]
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
        """Yield the statements of a situation type whose values are numbers."""
        quantity, single = one.quantity, len(one.arguments) == 1
        assert quantity is not None
        pairs: list[tuple[str, str | Sequence[str]]] = [("c:fromLevel", str(one.level))] if one.level != 1 else []
        limits = (("least", quantity.least), ("most", quantity.most), ("default", Fraction(one.default or 0)))
        for name, limit in limits:
            if limit is not None and (name != "default" or one.default is not None):
                pairs.append((f"c:{name}Amount", decimal_text(limit)))
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
        """The relations whose last argument is a number; a number that nothing reads is known by not being an individual."""
        domain, things = self.problem.domain, self.problem.individuals
        rules = [rule.behavior for its in domain.rules.values() for rule in its]
        unread = (name for name, rows in self.problem.relations.items() if any(row[-1] not in things for row in rows))
        return measures([*domain.behaviors.values(), *rules]).union(unread)

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
        nodes, timing = self.behavior_nodes(one.name, (*one.parameters, *one.variables)), timing_of(one)
        timed = sorted(timing.conditions, key=lambda pair: pair[0] is Span.THROUGHOUT)
        known = {c for _, c in timed}
        asked = [*timed, *((Span.THROUGHOUT, c) for c in one.asked if c not in known)]
        conditions = [
            _spanned(nodes, nodes.condition(c), span) for span, c in asked if c not in (one.priced, one.lasting)
        ]
        made = sorted(timing.effects, key=lambda pair: isinstance(pair[1], AmountEffect))
        effects = [
            _spanned(nodes, nodes.effect(f":{one.name}.effect{position:03}", effect), span)
            for position, (span, effect) in enumerate(made, start=1)
        ]
        cost = [] if one.cost == 1 else [decimal_text(Fraction(repr(float(one.cost))))]
        price = [] if one.price is None else [nodes.calculation(one.price)]
        yield self.node(
            one.name,
            "owl:NamedIndividual, c:Behavior",
            f"The behaviour {self.labels.get(one.name, one.name)}.",
            ("c:level", str(one.level)),
            ("c:index", str(index)),
            ("c:cost", cost),
            ("c:price", price),
            *self.lasting(one.name, timing, nodes),
            ("c:parameter", [nodes.terms[p.name] for p in one.parameters]),
            ("c:precondition", conditions),
            ("c:postcondition", effects),
        )
        yield from self.terms(nodes, one)

    def terms(self, nodes: NodeWriter, one: Behavior | Rule) -> Iterator[str]:
        """Yield the statements of the parameters and variables of a behaviour or rule, and of its condition and effect nodes."""
        for i, parameter in enumerate(one.parameters, start=1):
            yield self.term(nodes.terms[parameter.name][1:], "c:Parameter", i, parameter.kind)
        for variable in one.variables:
            yield self.term(nodes.terms[variable.name][1:], "c:Variable", None, variable.kind)
        yield from (f"{statement} ." for statement in nodes.nodes)

    def lasting(self, name: str, timing: Timing, nodes: NodeWriter) -> Iterator[tuple[str, str | Sequence[str]]]:
        """Yield the properties for the duration, the actors and the fixed time of a behaviour."""
        if isinstance(timing.duration, Fraction):
            yield "c:duration", seconds_text(timing.duration)
        elif timing.duration is not None:
            yield "c:calculatedDuration", nodes.calculation(timing.duration)
        yield "c:actor", [nodes.put(actor) for actor in timing.actors]
        at = (self.problem.times or Times()).events.get(name)
        if at is not None:
            yield "c:happensAt", seconds_text(at)

    def rule(self, name: str, one: Rule) -> Iterator[str]:
        nodes = self.behavior_nodes(name, (*one.parameters, *one.variables))
        conditions = [nodes.condition(c) for c in one.conditions]
        head = nodes.symbol(one.situation, [p.name for p in one.parameters], TRUE)
        yield f"{nodes.statement(f':{name}', 'Rule', {**head, 'condition': conditions})} ."
        yield from self.terms(nodes, one)

    def behavior_nodes(self, where: str, terms: Iterable[Parameter]) -> NodeWriter:
        """Return a writer of the conditions and effects of a behaviour or rule.

        The names of all nodes begin with the name `where` of the behaviour or rule.
        """
        taken = {t.name: f":{where}.{t.name[1:]}" for t in terms}
        sought = set(taken.values())

        def variable(name: str, node: str, position: int) -> str:
            found = f":{where}.{name[1:]}"
            if found in sought:  # the name already denotes a variable of another condition
                found += f"_{position}"
            sought.add(found)
            return found

        situations = self.problem.domain.situations
        return NodeWriter(
            "c:",
            self.iri,
            lambda kind, position: f":{where}.{kind}{position:03}",
            variable,
            taken,
            lambda situation: situations[situation].boolean,
        )

    def individuals(self) -> Iterator[str]:
        """Yield the statements of all individuals with their most specific classes, in the order of the classes' members."""
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
            different = " ".join(sorted(map(self.iri, names)))  # the OWL API (and Protégé) saves names in this order
            yield f"[ a owl:AllDifferent ; owl:distinctMembers ( {different} ) ] ."

    def above(self, kind: str) -> Iterator[str]:
        yield kind
        for parent in self.problem.parents.get(kind, ()):
            yield from self.above(parent)

    def facts(self) -> Iterator[str]:
        """Yield the initial facts.

        A fact is written as a statement of a value property if the property exists, and as a node otherwise.
        """
        number, fact = 0, self.unlike_others("fact")
        for subject, prop, value, properties in chain(self.values(), self.tuples()):
            if prop:
                yield f"{self.iri(subject)} {prop} {value} ."
                continue
            number += 1
            yield f"{self.individual.statement(f':{fact}{number}', 'SituatedObjectInstance', properties)} ."

    def unlike_others(self, word: str) -> str:
        """Return a word with underscores at its end such that no name of the problem is this word with a number."""
        domain = self.problem.domain
        names = {*self.problem.individuals, *self.problem.classes, *domain.situations, *domain.behaviors}
        while any(name.removeprefix(word).isdecimal() for name in names if name.startswith(word)):
            word += "_"
        return word

    def values(self) -> Iterator[_TurtleFact]:
        """Yield the initial values of symbols, except default values and rest values."""
        for symbol, value in self.problem.initial.items():
            situation = self.problem.domain.situations[symbol.situation]
            if value == (situation.default or situation.rest or (FALSE if situation.boolean else None)):
                continue
            single = len(symbol.arguments) == 1 and not situation.boolean
            prop = f":{situation.name}.value" if single else ""
            if situation.quantity is None:
                properties = self.individual.symbol(symbol.situation, symbol.arguments, value)
                yield symbol.arguments[0], prop, self.iri(value), properties
            else:
                amount = decimal_text(Fraction(value))
                properties = self.individual.symbol(symbol.situation, symbol.arguments)
                yield symbol.arguments[0], prop, amount, {**properties, "amount": [amount]}

    def tuples(self) -> Iterator[_TurtleFact]:
        """Yield the rows of static relations."""
        for relation, tuples in self.problem.relations.items():
            prop = self.iri(relation) if all(len(row) == 2 for row in tuples) else ""
            for row in sorted(tuples):
                if relation in self.measures:
                    amount = decimal_text(Fraction(row[-1]))
                    properties = self.individual.measured(Measure(relation, row[:-1]))
                    yield row[0], prop, amount, {**properties, "amount": [amount]}
                else:
                    properties = relation_properties(self.iri(relation), [*map(self.iri, row)])
                    yield row[0], prop, self.iri(row[-1]), properties

    @cached_property
    def individual(self) -> NodeWriter:
        """Writer of nodes without variables, such as facts."""
        return self.behavior_nodes("", ())

    def task(self) -> Iterator[str]:
        goals = [Fact(symbol, part) for symbol, value in self.problem.goal.items() for part in value.split(",")]
        name = self.unlike_others("goal")
        iris = [f":{name}{i}" for i in range(1, len(goals) + 1)]
        goal = f" ; c:goal {', '.join(iris)}" if iris else ""
        yield f':task a owl:NamedIndividual, c:Task ; rdfs:label "task"@en{goal} .'
        for iri, fact in zip(iris, goals, strict=True):
            symbol = fact.symbol
            weight = self.problem.weights.get(symbol)
            soft = {} if weight is None else {"weight": [decimal_text(weight)]}
            if self.problem.domain.situations[symbol.situation].quantity is not None:
                [(sign, limit)] = bounds(fact.value)
                properties = self.individual.symbol(symbol.situation, symbol.arguments)
                properties |= {"sign": [sign], "amount": [decimal_text(limit)], **soft}
                yield f"{self.individual.statement(iri, 'Comparison', properties)} ."
                continue
            properties = {**self.individual.symbol(symbol.situation, symbol.arguments, fact.value), **soft}
            yield f"{self.individual.statement(iri, 'ValueCondition', properties)} ."


def _spanned(nodes: NodeWriter, iri: str, span: Span) -> str:
    """Return the IRI of a condition or effect, whose time span is stated unless it is the whole duration."""
    if span is not Span.THROUGHOUT:
        nodes.nodes.append(f"{iri} c:during c:{span.value}")
    return iri


def seconds_text(seconds: Fraction) -> str:
    """Return a duration in seconds as a Turtle literal.

    >>> seconds_text(Fraction(5, 2))
    '"PT2.5S"^^xsd:dayTimeDuration'
    """
    text = written(seconds) if finite(seconds) else written(Fraction(round(seconds * 10**12), 10**12))
    return f'"PT{text}S"^^xsd:dayTimeDuration'


def _banner(text: str) -> str:
    return f"\n{'#' * 65}  {text}\n"

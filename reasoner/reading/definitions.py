"""Classes defined by situations, compiled into conditions.

"A full vessel is a vessel that carries some beverage" is true of a cup today and false tomorrow, so no reasoner may write down
who is one before planning. Wherever a behaviour names such a class, its definition takes its place:

=========================================  =======================================================
in OWL                                      in `reasoner.symbols`
=========================================  =======================================================
``A and B``                                 both conditions
``A or B``                                  `AnyOf`
``not A``                                   the condition negated
``p value v``, p a value property           `ValueCondition`
``p some C``, p a value property            `Witness`: some C is the value
``p only C``, p a value property            negated `Witness`: no value is outside C
the same with a static relation             `RelationCondition` in place of the `ValueCondition`
``inverse p some C``                        `Witness`: some C has the individual as its value
``{a, b}``                                  `AnyOf` of `EqualityCondition`
=========================================  =======================================================
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from reasoner.graph.knowledge import KnowledgeError
from reasoner.names import Names, local_name
from reasoner.symbols import (
    TRUE,
    AnyOf,
    ClassCondition,
    Condition,
    EqualityCondition,
    Parameter,
    RelationCondition,
    Rule,
    ValueCondition,
    Witness,
)
from reasoner.vocabulary import OWL, RDF, RDFS

THING = OWL + "Thing"
EXPRESSIONS = """{ ?node owl:equivalentClass ?value . BIND(owl:equivalentClass AS ?property) FILTER(isBlank(?value)) } UNION
    { ?class owl:equivalentClass ?expression .
      ?expression (owl:intersectionOf|owl:unionOf|owl:complementOf|owl:oneOf|owl:onProperty|owl:someValuesFrom
                   |owl:allValuesFrom|rdf:first|rdf:rest)* ?node .
      ?node ?property ?value . FILTER(isBlank(?node)) }"""
"""The part of a SPARQL query that yields every definition with what is nested inside, as (node, property, value)."""

AXIOMS = """{ ?situation :valueProperty ?node . ?node ?property ?value .
      FILTER(?property IN (owl:propertyChainAxiom, owl:inverseOf)
        || (?property = rdf:type && ?value IN (owl:TransitiveProperty, owl:SymmetricProperty))) } UNION
    { ?situation :valueProperty ?value . ?node ?property ?value . FILTER(?property IN (rdfs:subPropertyOf, owl:inverseOf))
      FILTER(isIRI(?node)) } UNION
    { ?situation :valueProperty/owl:propertyChainAxiom/rdf:rest* ?node . ?node ?property ?value .
      FILTER(?property IN (rdf:first, rdf:rest)) } UNION
    { ?situation :valueProperty/owl:propertyChainAxiom/rdf:rest*/rdf:first ?node . ?node ?property ?value .
      FILTER(?property = owl:inverseOf && isBlank(?node)) }"""
"""The part of a SPARQL query that yields what axioms say of value properties, as (node, property, value)."""


@dataclass(frozen=True)
class Definitions:
    """The class expressions of an ontology, by node.

    Attributes
    ----------
    nodes : mapping of node to property to values
    situations : mapping of value property to its situation type, and whether it is functional
    names : Names
    """

    nodes: Mapping[str, Mapping[str, Sequence[str]]]
    situations: Mapping[str, tuple[str, bool]]
    names: Names

    def changes(self, iri: str) -> bool:
        """Tell whether a class is defined by situations, so that its individuals change."""
        return iri in self._changing

    @cached_property
    def _changing(self) -> frozenset[str]:
        """The named classes whose definition speaks of a value property, or of a class that does."""
        defined = {iri for iri, node in self.nodes.items() if not _blank(iri) and OWL + "equivalentClass" in node}
        found: set[str] = set()
        while True:
            more = {iri for iri in defined - found if self._mentioned(iri) & (found | self.situations.keys())}
            if not more:
                return frozenset(found)
            found |= more

    def _mentioned(self, iri: str) -> set[str]:
        """Return the properties and classes that a definition names."""
        waiting = list(self._definitions(iri))
        seen: set[str] = set()
        found: set[str] = set()
        while waiting:
            node = waiting.pop()
            if not _blank(node):
                found.add(node)
            elif node not in seen:
                seen.add(node)
                waiting += [value for values in self.nodes.get(node, {}).values() for value in values]
        return found

    def _definitions(self, iri: str) -> Sequence[str]:
        return self.nodes.get(iri, {}).get(OWL + "equivalentClass", [])

    def base(self, iri: str) -> str:
        """Return the class that bounds a changing one: the first static class that its definition names as a part."""
        if not self.changes(iri):
            return iri
        expression = self._one_definition(iri)
        parts = self._list(expression, "intersectionOf") or [expression]
        for part in parts:
            if not _blank(part):
                return self.base(part)
        raise KnowledgeError(
            f"{local_name(iri)} is used as a type, but its definition names no class that says what it is one of; "
            f"define it as 'SomeClass and (…)'"
        )

    def conditions(self, term: str, iri: str, negated: bool = False) -> tuple[Condition, ...]:
        """Return what it takes for a term to be in a class: one class condition, or the definition of a changing class."""
        if not self.changes(iri):
            return (ClassCondition(term, self.names.short(iri), negated),)
        found = tuple(self._expression(term, self._one_definition(iri)))
        return (_negation(found),) if negated else found

    def condition(self, term: str, iri: str, negated: bool = False) -> Condition:
        """Return the same as one condition."""
        found = self.conditions(term, iri, negated)
        return found[0] if len(found) == 1 else AnyOf((found,))

    def beyond_base(self, term: str, iri: str) -> tuple[Condition, ...]:
        """Return what a changing class asks of a term besides its base; nothing for a class that doesn't change."""
        return self.conditions(term, iri) if self.changes(iri) else ()

    def _one_definition(self, iri: str) -> str:
        found = self._definitions(iri)
        if len(found) != 1:
            raise KnowledgeError(
                f"{local_name(iri)} has {len(found)} definitions; a class defined by situations has one"
            )
        return found[0]

    # -------------------------------------------------------------------------------------------------------- properties

    def rules(self, prop: str, situation: str, kinds: Sequence[str], more: bool = False) -> list[Rule]:
        """Return the rules that axioms about a value property say: it follows from others, or from chains of them.

        A transitive one is followed from what it follows from otherwise, one link after the other; `more` tells whether there are
        rules of another kind from which it does.
        """
        said = self.nodes.get(prop, {})
        ways: list[tuple[str, ...]] = [(other,) for other in self._below(prop)]
        ways += [tuple(self._items(chain)) for chain in said.get(OWL + "propertyChainAxiom", ())]
        types = said.get(RDF + "type", ())
        if OWL + "TransitiveProperty" in types:
            ways += [(*way, prop) for way in ways if prop not in way] + [(prop, prop)] * more
        found = [self._way(way, situation, kinds) for way in ways]
        inverses = [*said.get(OWL + "inverseOf", ()), *self._inverses(prop)]
        inverses += [prop] if OWL + "SymmetricProperty" in types and (found or more) else []
        for other in dict.fromkeys(inverses):
            if other != prop or found or more:
                found.append(self._rule(situation, kinds, (self._related(other, "?to", "?from"),), ()))
        return found

    def _below(self, prop: str) -> list[str]:
        """Return the properties that are said to be sub-properties of one."""
        nodes = self.nodes.items()
        return sorted(iri for iri, node in nodes if iri != prop and prop in node.get(RDFS + "subPropertyOf", ()))

    def _inverses(self, prop: str) -> list[str]:
        return sorted(
            iri for iri, node in self.nodes.items() if not _blank(iri) and prop in node.get(OWL + "inverseOf", ())
        )

    def _way(self, way: Sequence[str], situation: str, kinds: Sequence[str]) -> Rule:
        """Return the rule that a chain of properties is."""
        variables: list[Parameter] = []

        def rest(place: int, one: str) -> tuple[Condition, ...]:
            if place == len(way) - 1:
                return (self._related(way[place], one, "?to"),)
            middle, kind = f"?middle{place}", self._between(way[place], way[place + 1])
            link = self._related(way[place], one, middle)
            inner = rest(place + 1, middle)
            if isinstance(link, ValueCondition) and link.value == middle:
                variables.append(Parameter(middle, kind))
                return (link, *inner)
            return (Witness(middle, kind, (link, *inner)),)

        return self._rule(situation, kinds, rest(0, "?from"), tuple(variables))

    @staticmethod
    def _rule(
        situation: str, kinds: Sequence[str], conditions: tuple[Condition, ...], variables: tuple[Parameter, ...]
    ) -> Rule:
        return Rule(situation, (Parameter("?from", kinds[0]), Parameter("?to", kinds[1])), variables, conditions)

    def _between(self, one: str, other: str) -> str:
        """Return the class of what stands between two properties of a chain: the values of the first one."""
        for prop in (one, other):
            iri, inverse = self._named(prop)
            if iri in self.situations and inverse is (prop == other):
                return self.names.short(self.situations[iri][0])
        raise KnowledgeError(
            f"the chain of {local_name(self._named(one)[0])} and {local_name(self._named(other)[0])} leads over individuals of "
            "which nothing says the class; write it as a :Rule with a :Witness"
        )

    # -------------------------------------------------------------------------------------------------- class expressions

    def _expression(self, term: str, node: str) -> Iterator[Condition]:
        """Yield the conditions, all of which must hold, that a class expression stands for."""
        if not _blank(node):
            if node != THING:
                yield from self.conditions(term, node)
            return
        said = self.nodes.get(node, {})
        if OWL + "intersectionOf" in said:
            for part in self._list(node, "intersectionOf"):
                yield from self._expression(term, part)
        elif OWL + "unionOf" in said:
            yield AnyOf(tuple(tuple(self._expression(term, part)) for part in self._list(node, "unionOf")))
        elif OWL + "complementOf" in said:
            yield _negation(tuple(self._expression(term, said[OWL + "complementOf"][0])))
        elif OWL + "oneOf" in said:
            members = [self.names.short(member) for member in self._list(node, "oneOf")]
            yield AnyOf(tuple((EqualityCondition(term, member),) for member in members))
        elif OWL + "hasValue" in said:
            yield self._related(said[OWL + "onProperty"][0], term, self.names.short(said[OWL + "hasValue"][0]))
        elif OWL + "someValuesFrom" in said:
            yield self._some(said[OWL + "onProperty"][0], term, said[OWL + "someValuesFrom"][0], outside=False)
        elif OWL + "allValuesFrom" in said:
            yield self._some(said[OWL + "onProperty"][0], term, said[OWL + "allValuesFrom"][0], outside=True)
        else:
            raise KnowledgeError(
                "a class defined by situations uses a kind of OWL expression that doesn't become a condition; "
                "use and, or, not, value, some, only and {…}"
            )

    def _some(self, prop: str, term: str, filler: str, outside: bool) -> Witness:
        """Return that some value is in a class, or (`outside`) that none is outside it."""
        variable = f"{term if term.startswith('?') else '?' + term}_{local_name(self._named(prop)[0])}"
        inside = tuple(self._expression(variable, filler))
        if outside:
            inside = (_negation(inside),)
            kind = self._range(prop)
        else:
            kind = self.names.short(self.base(filler)) if not _blank(filler) and filler != THING else self._range(prop)
            if inside and inside[0] == ClassCondition(variable, kind):
                inside = inside[1:]
        return Witness(variable, kind, (self._related(prop, term, variable), *inside), negated=outside)

    def _range(self, prop: str) -> str:
        """Return the class of what a property leads to: the situation type, for a value property."""
        iri, inverse = self._named(prop)
        if iri not in self.situations or inverse:
            raise KnowledgeError(
                f"'{local_name(iri)} some' and 'only' need a named class behind them here; name one in the definition"
            )
        return self.names.short(self.situations[iri][0])

    def _related(self, prop: str, term: str, value: str) -> Condition:
        """Return that a property relates a term to a value."""
        iri, inverse = self._named(prop)
        one, other = (value, term) if inverse else (term, value)
        if iri not in self.situations:
            return RelationCondition(self.names.short(iri), (one, other))
        situation, functional = self.situations[iri]
        name = self.names.short(situation)
        return ValueCondition(name, (one,), other) if functional else ValueCondition(name, (one, other), TRUE)

    def _named(self, prop: str) -> tuple[str, bool]:
        """Return a property's IRI, and whether the inverse of it is meant."""
        inverse = self.nodes.get(prop, {}).get(OWL + "inverseOf", [])
        return (inverse[0], True) if inverse and prop not in self.situations else (prop, False)

    def _list(self, node: str, name: str) -> list[str]:
        return self._items(*self.nodes.get(node, {}).get(OWL + name, [RDF + "nil"]), name=name)

    def _items(self, *rests_: str, name: str = "propertyChainAxiom") -> list[str]:
        found: list[str] = []
        rests, seen = list(rests_), set[str]()
        while rests != [RDF + "nil"]:
            cell = self.nodes.get(rests[0], {})
            if len(rests) != 1 or rests[0] in seen or len(cell.get(RDF + "first", ())) != 1:
                raise KnowledgeError(f"the list of an owl:{name} isn't whole; write it as ( … )")
            seen.add(rests[0])
            found += cell[RDF + "first"]
            rests = list(cell.get(RDF + "rest", []))
            if not rests:
                raise KnowledgeError(f"the list of an owl:{name} has no end; write it as ( … )")
        return found


def _negation(conditions: tuple[Condition, ...]) -> Condition:
    """Return that not all of some conditions hold."""
    if len(conditions) == 1:
        return replace(conditions[0], negated=not conditions[0].negated)
    return AnyOf((conditions,), negated=True)


def _blank(node: str) -> bool:
    return ":" not in node  # an IRI has a colon, the label of a blank node has none

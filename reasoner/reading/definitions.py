"""Compilation of classes that are defined by situations into conditions.

The members of a class such as "a full vessel is a vessel that carries some beverage" change during a plan. The OWL reasoner must
not infer members that change during a plan. In a behaviour, a class that is defined by situations is replaced by the conditions of
its definition:

=========================================  =======================================================
in OWL                                      in `confab.reasoner.symbols`
=========================================  =======================================================
``A and B``                                 both conditions
``A or B``                                  `AnyOf`
``not A``                                   negated condition
``p value v``, p a value property           `ValueCondition`
``p some C``, p a value property            `Witness`: the value is a member of C
``p only C``, p a value property            negated `Witness`: no value is outside C
the same with a static relation             `RelationCondition` instead of the `ValueCondition`
``inverse p some C``                        `Witness`: the individual is the value of a member of C
``p min 2 C``, ``max``, ``exactly``         nested `Witness`es of different values; negated for a maximum
``p Self``                                  the condition with the individual as its own value
``{a, b}``                                  `AnyOf` of `EqualityCondition`
``p some decimal[>= 2]``, p an amount       `Comparison`s of the amount with the bounds
=========================================  =======================================================
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

from confab.reasoner.amounts import Amount, Expression, Measure, exact
from confab.reasoner.closure import closure
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.names import Names, local_name
from confab.reasoner.symbols import (
    TRUE,
    AnyOf,
    ClassCondition,
    Comparison,
    Condition,
    EqualityCondition,
    Parameter,
    RelationCondition,
    Rule,
    ValueCondition,
    Witness,
)
from confab.reasoner.vocabulary import OWL, RDF, RDFS

THING = OWL + "Thing"
INSIDE = "|".join(
    f"<{OWL}{name}>"
    for name in (
        *(
            "intersectionOf",
            "unionOf",
            "complementOf",
            "oneOf",
            "onProperty",
            "someValuesFrom",
            "allValuesFrom",
            "onClass",
        ),
        *("onDataRange", "withRestrictions", "datatypeComplementOf"),
    )
)
"""Properties that lead from a class expression to its parts, except the properties of RDF lists."""
EXPRESSIONS = f"""{{ ?node owl:equivalentClass ?value . BIND(owl:equivalentClass AS ?property) FILTER(!isLiteral(?value)) }} UNION
    {{ ?class owl:equivalentClass ?expression . ?expression ({INSIDE}|rdf:first|rdf:rest)* ?node .
      ?node ?property ?value . FILTER(isBlank(?node)) }}"""
"""SPARQL pattern for all class definitions and their parts, as (node, property, value)."""

AXIOMS = """{ ?situation :valueProperty ?node . ?node ?property ?value .
      FILTER(?property IN (owl:propertyChainAxiom, owl:inverseOf, owl:equivalentProperty)
        || (?property = rdf:type && ?value IN (owl:TransitiveProperty, owl:SymmetricProperty, owl:ReflexiveProperty))) } UNION
    { ?situation :valueProperty ?value . ?node ?property ?value .
      FILTER(?property IN (rdfs:subPropertyOf, owl:equivalentProperty, owl:inverseOf))
      FILTER(isIRI(?node) || ?property != owl:inverseOf) } UNION
    { ?situation :valueProperty/^rdfs:subPropertyOf ?node . ?node ?property ?value .
      FILTER(?property = owl:inverseOf && isBlank(?node)) } UNION
    { ?situation :valueProperty/owl:propertyChainAxiom/rdf:rest* ?node . ?node ?property ?value .
      FILTER(?property IN (rdf:first, rdf:rest)) } UNION
    { ?situation :valueProperty/owl:propertyChainAxiom/rdf:rest*/rdf:first ?node . ?node ?property ?value .
      FILTER(?property = owl:inverseOf && isBlank(?node)) }"""
"""SPARQL pattern for all axioms about value properties, as (node, property, value)."""

_DEFINED = OWL + "equivalentClass"
CLOSED = {OWL + name for name in ("complementOf", "allValuesFrom", "oneOf", "hasSelf")}
CLOSED |= {OWL + name for name in ("cardinality", "minCardinality", "maxCardinality")}
CLOSED |= {OWL + name for name in ("qualifiedCardinality", "minQualifiedCardinality", "maxQualifiedCardinality")}
"""OWL constructs from which OWL 2 RL infers no members of a class. Planning infers the members of classes with these constructs,
because planning treats unstated facts as false.
"""
MOST = 5
"""Maximum cardinality in a definition; the evaluation of larger cardinalities would take longer than planning."""
FACETS = {"minInclusive": ">=", "minExclusive": ">", "maxInclusive": "<=", "maxExclusive": "<"}


@dataclass(frozen=True)
class Definitions:
    """The class definitions and property axioms of an ontology.

    Attributes
    ----------
    nodes : mapping of node to property to values
    situations : mapping of value property to its situation type, and whether it is functional
    names : Names
    numbers : set of properties whose values are numbers
    kinds : mapping of property to its domain and range as class names; an empty text for an unstated class
    concluded : mapping of class to situation type and owner
        The classes whose members follow from rules: from SWRL rules, or from a recursive definition. For each class: the
        situation type that is true for the members, and its owner. The owner is the class that has the situation type, or an
        empty text if several classes have the situation type.
    """

    nodes: Mapping[str, Mapping[str, Sequence[str]]]
    situations: Mapping[str, tuple[str, bool]]
    names: Names
    numbers: frozenset[str] = frozenset()
    kinds: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    concluded: Mapping[str, tuple[str, str]] = field(default_factory=dict)

    def changes(self, iri: str) -> bool:
        """Return whether conditions replace a class.

        The members of such a class change, or OWL 2 RL doesn't find all of them.
        """
        return iri in self._changing

    @cached_property
    def recursive(self) -> frozenset[str]:
        """The classes whose definitions refer to themselves, directly or through other classes."""
        names = {iri: self._mentioned(iri) for iri, node in self.nodes.items() if not _blank(iri) and _DEFINED in node}
        return frozenset(iri for iri in names if iri in closure(names[iri], lambda each: names.get(each, ())))

    @cached_property
    def _changing(self) -> frozenset[str]:
        return self._spread({*self.concluded, *self._closed})

    @cached_property
    def _situated(self) -> frozenset[str]:
        return self._spread(set(self.concluded))

    def _spread(self, found: set[str]) -> frozenset[str]:
        """Return the classes in `found`, and all classes whose definitions depend on these classes or on a value property."""
        defined = {
            iri: self._mentioned(iri) for iri, node in self.nodes.items() if not _blank(iri) and _DEFINED in node
        }
        while more := {iri for iri in defined.keys() - found if defined[iri] & (found | self.situations.keys())}:
            found |= more
        return frozenset(found)

    def without_members(self, used: Collection[str]) -> Iterator[str]:
        """Yield those classes in `used`, and in their definitions, of whose members OWL 2 RL and conditions may miss some."""
        defined = {iri for iri, node in self.nodes.items() if not _blank(iri) and _DEFINED in node}
        for iri in sorted(closure(used, lambda each: self._mentioned(each) if each in defined else ())):
            inside = [self.nodes.get(node, {}) for node in self._expressions(iri)] if iri in defined else []
            if not self.changes(iri) and any(CLOSED & said.keys() for said in inside):
                yield iri

    @cached_property
    def _closed(self) -> frozenset[str]:
        """The classes whose members OWL 2 RL can't infer because their definitions contain `CLOSED` constructs.

        A class is included only if its definition has the form *Base and …* with known properties.
        """
        known = self.situations.keys() | self.kinds.keys() | self.numbers
        found = set()
        for iri in (iri for iri, node in self.nodes.items() if not _blank(iri) and len(node.get(_DEFINED, ())) == 1):
            parts = self._list(self._definitions(iri)[0], "intersectionOf")
            inside = [self.nodes.get(node, {}) for node in self._expressions(iri)]
            properties = {self._named(prop)[0] for said in inside for prop in said.get(OWL + "onProperty", ())}
            if (
                any(not _blank(part) for part in parts)
                and properties <= known
                and any(CLOSED & said.keys() for said in inside)
            ):
                found.add(iri)
        return frozenset(found)

    def _mentioned(self, iri: str) -> set[str]:
        """Return the properties and classes that a definition mentions."""
        inside = [self.nodes.get(node, {}) for node in self._expressions(iri)]
        named = [*self._definitions(iri), *(value for said in inside for values in said.values() for value in values)]
        return {value for value in named if not _blank(value)}

    def _expressions(self, iri: str) -> list[str]:
        """Return all class expressions in a definition, including nested expressions."""
        found = dict.fromkeys(node for node in self._definitions(iri) if _blank(node))
        waiting = list(found)
        while waiting:
            more = [value for values in self.nodes.get(waiting.pop(), {}).values() for value in values if _blank(value)]
            waiting += (more := [node for node in dict.fromkeys(more) if node not in found])
            found |= dict.fromkeys(more)
        return list(found)

    def _definitions(self, iri: str) -> Sequence[str]:
        return self.nodes.get(iri, {}).get(OWL + "equivalentClass", [])

    def base(self, iri: str) -> str:
        """Return a class itself if the class is static; otherwise return the first static class in its definition."""
        if not self.changes(iri):
            return iri
        if iri in self.concluded:
            situation, owner = self.concluded[iri]
            if not owner:
                raise KnowledgeError(
                    f"{local_name(iri)} is used as a type, but {local_name(situation)} is a situation type of several classes or "
                    "of no class; let exactly one class have it"
                )
            return owner
        expression = self._one_definition(iri)
        parts = self._list(expression, "intersectionOf") or [expression]
        for part in parts:
            if not _blank(part):
                return self.base(part)
        raise KnowledgeError(
            f"{local_name(iri)} is used as a type, but its definition names no class to which its members belong; "
            f"define it as 'SomeClass and (…)'"
        )

    def required(self, iri: str) -> set[str]:
        """Return the static classes that contain all members of a class according to its definition, not their superclasses."""

        def parts(each: str) -> Sequence[str]:
            if _blank(each):
                return self._list(each, "intersectionOf")
            return self._definitions(each) if self.changes(each) and each not in self.concluded else ()

        owners = (self.concluded.get(each, (each, each))[1] for each in closure([iri], parts) if not _blank(each))
        return {each for each in owners if each and not self.changes(each)}

    def conditions(self, term: str, iri: str, negated: bool = False) -> tuple[Condition, ...]:
        """Return the conditions that a term is a member of a class: a class condition, or the definition of a changing class."""
        if not self.changes(iri):
            return (ClassCondition(term, self.names.short(iri), negated),)
        if iri in self.recursive - self.concluded.keys():
            raise KnowledgeError(
                f"{local_name(iri)} is defined by itself; define a situation type with c:holdsOf {local_name(iri)}, which may be "
                f"recursive, or remove {local_name(iri)} from its own definition",
                iri,
            )
        if iri in self.concluded:
            return (ValueCondition(self.names.short(self.concluded[iri][0]), (term,), TRUE, negated),)
        found = tuple(self.expression(term, self._one_definition(iri)))
        if iri not in self._situated:  # a scene may also state members of the class
            found = (AnyOf(((ClassCondition(term, self.names.short(iri)),), found)),)
        return (_negation(found),) if negated else found

    def holding(self, term: str, iri: str) -> tuple[Condition, ...]:
        """Return the conditions under which a term is a member of a class, for the rule of a situation type with the same meaning.

        The rules of this situation type itself aren't used.
        """
        if iri not in self.concluded:
            return self.conditions(term, iri)
        if self._definitions(iri):
            return tuple(self.expression(term, self._one_definition(iri)))
        return (ClassCondition(term, self.names.short(iri)),)

    def condition(self, term: str, iri: str, negated: bool = False) -> Condition:
        """Return the conjunction of `conditions` as one condition."""
        found = self.conditions(term, iri, negated)
        return found[0] if len(found) == 1 else AnyOf((found,))

    def beyond_base(self, term: str, iri: str) -> tuple[Condition, ...]:
        """Return the conditions under which a member of the base class belongs to a changing class; none for a static class."""
        return self.conditions(term, iri) if self.changes(iri) else ()

    def _one_definition(self, iri: str) -> str:
        found = self._definitions(iri)
        if len(found) != 1:
            raise KnowledgeError(f"{local_name(iri)} has {len(found)} definitions; keep one of them")
        return found[0]

    # -------------------------------------------------------------------------------------------------------- properties

    def rules(self, prop: str, situation: str, kinds: Sequence[str], more: bool = False) -> list[Rule]:
        """Return the rules that follow from the axioms about a value property: subproperties, chains, inverses and characteristics.

        The rule of a transitive property adds one link at a time to the pairs that the other rules derive. `more` states whether
        the situation type has rules besides the rules from axioms.
        """
        said = self.nodes.get(prop, {})
        chains: list[tuple[str, ...]] = [(other,) for other in self._below(prop)]
        chains += [tuple(self._items(chain)) for chain in said.get(OWL + "propertyChainAxiom", ())]
        types = said.get(RDF + "type", ())
        if OWL + "TransitiveProperty" in types:
            chains += [(*chain, prop) for chain in chains if prop not in chain] + [(prop, prop)] * more
        found = [self._chain_rule(chain, situation, kinds) for chain in chains]
        inverses = [*said.get(OWL + "inverseOf", ()), *self._inverses(prop)]
        inverses += [prop] if OWL + "SymmetricProperty" in types and (found or more) else []
        for other in dict.fromkeys(inverses):
            if other != prop or found or more:
                found.append(self._rule(situation, kinds, (self.related(other, "?to", "?from"),), ()))
        if OWL + "ReflexiveProperty" in types:
            found.append(self._rule(situation, kinds, (EqualityCondition("?from", "?to"),), ()))
        return found

    def _below(self, prop: str) -> list[str]:
        """Return the stated subproperties and equivalent properties of a property."""
        nodes, said = self.nodes.items(), (RDFS + "subPropertyOf", OWL + "equivalentProperty")
        found = {iri for iri, node in nodes for name in said if prop in node.get(name, ())}
        return sorted((found | {*self.nodes.get(prop, {}).get(said[1], ())}) - {prop})

    def _inverses(self, prop: str) -> list[str]:
        return sorted(
            iri for iri, node in self.nodes.items() if not _blank(iri) and prop in node.get(OWL + "inverseOf", ())
        )

    def _chain_rule(self, chain: Sequence[str], situation: str, kinds: Sequence[str]) -> Rule:
        """Return the rule that a property chain implies."""
        variables: list[Parameter] = []

        def rest(place: int, one: str) -> tuple[Condition, ...]:
            if place == len(chain) - 1:
                return (self.related(chain[place], one, "?to"),)
            middle, kind = f"?middle{place}", self._between(chain[place], chain[place + 1])
            link = self.related(chain[place], one, middle)
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
        if len(kinds) != 2:
            raise KnowledgeError(
                f"{situation} follows from axioms about its value property, so it needs two arguments; "
                "state by c:hasSituationType which class has it"
            )
        return Rule(situation, (Parameter("?from", kinds[0]), Parameter("?to", kinds[1])), variables, conditions)

    def _between(self, one: str, other: str) -> str:
        """Return the class of the individuals that are values of one property of a chain and subjects of the next property."""
        for prop, at_its_end in ((one, True), (other, False)):
            iri, inverse = self._named(prop)
            if kind := self.kinds.get(iri, ("", ""))[at_its_end is not inverse]:
                return kind
        raise KnowledgeError(
            f"the chain of {local_name(self._named(one)[0])} and {local_name(self._named(other)[0])} leads over individuals "
            "whose class isn't stated; write the chain as a c:Rule with a c:Witness"
        )

    # -------------------------------------------------------------------------------------------------- class expressions

    def expression(self, term: str, node: str) -> Iterator[Condition]:
        """Yield conditions whose conjunction is equivalent to membership of a term in a class expression."""
        if not _blank(node):
            if node != THING:
                yield from self.conditions(term, node)
            return
        said = self.nodes.get(node, {})
        if OWL + "intersectionOf" in said:
            for part in self._list(node, "intersectionOf"):
                yield from self.expression(term, part)
        elif OWL + "unionOf" in said:
            yield AnyOf(tuple(tuple(self.expression(term, part)) for part in self._list(node, "unionOf")))
        elif OWL + "complementOf" in said:
            yield _negation(tuple(self.expression(term, said[OWL + "complementOf"][0])))
        elif OWL + "oneOf" in said:
            members = [self.names.short(member) for member in self._list(node, "oneOf")]
            yield AnyOf(tuple((EqualityCondition(term, member),) for member in members))
        elif self._named(said.get(OWL + "onProperty", [""])[0])[0] in self.numbers:
            yield self._numbers(said, term)
        elif OWL + "hasValue" in said:
            yield self.related(said[OWL + "onProperty"][0], term, self.names.short(said[OWL + "hasValue"][0]))
        elif OWL + "hasSelf" in said:
            yield self.related(said[OWL + "onProperty"][0], term, term)
        elif bounds := self._cardinality(said):
            yield from self._counted(said[OWL + "onProperty"][0], term, said.get(OWL + "onClass", [THING])[0], *bounds)
        elif OWL + "someValuesFrom" in said:
            yield self._some(said[OWL + "onProperty"][0], term, said[OWL + "someValuesFrom"][0], outside=False)
        elif OWL + "allValuesFrom" in said:
            yield self._some(said[OWL + "onProperty"][0], term, said[OWL + "allValuesFrom"][0], outside=True)
        else:
            raise KnowledgeError(
                "the definition of a class uses an OWL expression that planning doesn't support; "
                "use and, or, not, value, some, only, min, max, exactly, Self and {…}"
            )

    @staticmethod
    def _cardinality(said: Mapping[str, Sequence[str]]) -> tuple[int, int | None] | None:
        """Return the minimum and maximum (None if unbounded) of a cardinality restriction; return None for other restrictions."""
        for name in ("cardinality", "qualifiedCardinality"):
            capital = name[0].upper() + name[1:]
            found = [said.get(OWL + one, [""])[0] for one in (name, f"min{capital}", f"max{capital}")]
            if any(found):
                if wrong := next((one for one in found if one and not one.isdecimal()), ""):
                    raise KnowledgeError(
                        f"the definition of a class counts up to '{wrong[:40]}' values; wanted a whole number"
                    )
                exactly, least, most = (int(one) if one else None for one in found)
                if exactly is not None:
                    return exactly, exactly
                return least or 0, most
        return None

    def _counted(self, prop: str, term: str, filler: str, least: int, most: int | None) -> Iterator[Condition]:
        """Yield the conditions that the number of a term's values in a class lies between a minimum and a maximum."""
        if max(least, -1 if most is None else most) > MOST:
            raise KnowledgeError(
                f"a definition counts up to {max(least, most or 0)} values of {local_name(self._named(prop)[0])}; planning counts "
                f"only up to {MOST}; use an amount that behaviours change"
            )
        if least:
            yield self._some(prop, term, filler, outside=False, others=least - 1)
        if most is not None:
            yield replace(self._some(prop, term, filler, outside=False, others=most), negated=True)

    def _numbers(self, said: Mapping[str, Sequence[str]], term: str) -> Condition:
        """Return the condition of a restriction on an amount or on a relation whose values are numbers."""
        prop = said[OWL + "onProperty"][0]
        amount = self.number(prop, term)
        there = Comparison(amount, "=", amount)
        if OWL + "hasValue" in said:
            return Comparison(amount, "=", self._exact(prop, said[OWL + "hasValue"][0]))
        if OWL + "someValuesFrom" in said:
            within = self._data_range(prop, amount, said[OWL + "someValuesFrom"][0])
            if not any(isinstance(one, Comparison) and not one.negated for one in within):
                within = (there, *within)  # negations and disjunctions may hold without a number
            return within[0] if len(within) == 1 else AnyOf((within,))
        if OWL + "allValuesFrom" in said:
            within = self._data_range(prop, amount, said[OWL + "allValuesFrom"][0])
            return AnyOf(((replace(there, negated=True),), within))
        raise KnowledgeError(
            f"the definition of a class counts the values of {local_name(prop)}, but an amount has one value; use 'some' or 'value'"
        )

    def _data_range(self, prop: str, amount: Expression, node: str) -> tuple[Condition, ...]:
        """Return conditions whose conjunction states that an amount is in a data range."""
        said = self.nodes.get(node, {})
        if not said:
            return (Comparison(amount, "=", amount),)  # a datatype allows every number
        if OWL + "withRestrictions" in said:
            found: list[Condition] = []
            for facet in self._items(*said[OWL + "withRestrictions"], name="withRestrictions"):
                for name, values in self.nodes.get(facet, {}).items():
                    if local_name(name) not in FACETS:
                        raise KnowledgeError(
                            f"{local_name(prop)}: the facet {local_name(name)} doesn't apply to numbers"
                        )
                    found.append(Comparison(amount, FACETS[local_name(name)], self._exact(prop, values[0])))
            return tuple(found)
        if OWL + "intersectionOf" in said:
            return tuple(c for part in self._list(node, "intersectionOf") for c in self._data_range(prop, amount, part))
        if OWL + "unionOf" in said:
            return (AnyOf(tuple(self._data_range(prop, amount, part) for part in self._list(node, "unionOf"))),)
        if OWL + "oneOf" in said:
            numbers = [self._exact(prop, one) for one in self._list(node, "oneOf")]
            return (AnyOf(tuple((Comparison(amount, "=", one),) for one in numbers)),)
        if OWL + "datatypeComplementOf" in said:
            return (_negation(self._data_range(prop, amount, said[OWL + "datatypeComplementOf"][0])),)
        raise KnowledgeError(
            f"a definition may restrict {local_name(prop)} only by comparisons with numbers; use decimal[>= 2]"
        )

    @staticmethod
    def _exact(prop: str, said: str) -> Expression:
        found = exact(said)
        if found is None:
            raise KnowledgeError(f"{local_name(prop)} is compared with '{said[:40]}'; wanted a number, like 2 or 1.5")
        return found

    def number(self, prop: str, term: str) -> Expression:
        """Return the numeric expression for the value of a property of a term."""
        if prop not in self.situations:
            return Measure(self.names.short(prop), (term,))
        return Amount(self.names.short(self.situations[prop][0]), (term,))

    def _some(
        self, prop: str, term: str, filler: str, outside: bool, others: int = 0, before: tuple[str, ...] = ()
    ) -> Witness:
        """Return the condition that a term has `others` + 1 different values in a class.

        If `outside` is true, return the condition that no value of the term is outside the class.
        """
        variable = f"{term if term.startswith('?') else '?' + term}_{local_name(self._named(prop)[0])}"
        variable += str(len(before) + 1) if before else ""
        inside = tuple(self.expression(variable, filler))
        if outside:
            inside = (_negation(inside),)
            kind = self._range(prop)
        else:
            kind = self.names.short(self.base(filler)) if not _blank(filler) and filler != THING else self._range(prop)
            if inside and inside[0] == ClassCondition(variable, kind):
                inside = inside[1:]
        inside += tuple(EqualityCondition(variable, other, negated=True) for other in before)
        if others:
            inside += (self._some(prop, term, filler, outside, others - 1, (*before, variable)),)
        return Witness(variable, kind, (self.related(prop, term, variable), *inside), negated=outside)

    def _range(self, prop: str) -> str:
        """Return the class of a property's values, which is the situation type for a value property."""
        iri, inverse = self._named(prop)
        kind = self.kinds.get(iri, ("", ""))[not inverse]
        if not kind:
            raise KnowledgeError(
                f"'some' and 'only' need a named class after {local_name(iri)}; name a class in the definition"
            )
        return kind

    def related(self, prop: str, term: str, value: str) -> Condition:
        """Return the condition that a property relates a term to a value."""
        iri, inverse = self._named(prop)
        one, other = (value, term) if inverse else (term, value)
        if iri not in self.situations:
            if iri not in self.kinds:
                raise KnowledgeError(
                    f"a definition uses {local_name(iri)}, which is neither a value property nor a relation; "
                    "declare it as a c:Relation, or correct the name"
                )
            return RelationCondition(self.names.short(iri), (one, other))
        situation, functional = self.situations[iri]
        name = self.names.short(situation)
        return ValueCondition(name, (one,), other) if functional else ValueCondition(name, (one, other), TRUE)

    def _named(self, prop: str) -> tuple[str, bool]:
        """Return the IRI of a property expression, and whether the expression is the inverse of this property."""
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
                raise KnowledgeError(f"the list of an owl:{name} is incomplete; write it as ( … )")
            seen.add(rests[0])
            found += cell[RDF + "first"]
            rests = list(cell.get(RDF + "rest", []))
            if not rests:
                raise KnowledgeError(f"the list of an owl:{name} has no end; write it as ( … )")
        return found


def _negation(conditions: tuple[Condition, ...]) -> Condition:
    """Return the condition that a conjunction is false."""
    if len(conditions) == 1:
        return replace(conditions[0], negated=not conditions[0].negated)
    return AnyOf((conditions,), negated=True)


def _blank(node: str) -> bool:
    return ":" not in node  # an IRI has a colon, the label of a blank node has none

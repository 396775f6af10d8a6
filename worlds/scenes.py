"""Random worlds as Turtle files with domain, scene and task, in all forms that a scene may use."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from random import Random

from confab.reasoner.amounts import Amount, Calculation, Expression, Measure, bounds, written
from confab.reasoner.derivation import TASK
from confab.reasoner.language import groups, is_variable, plain_variables, substituted, terms, walk
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    Aggregate,
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
from confab.reasoner.updates.writing import Situations, update
from confab.reasoner.vocabulary import ARGUMENTS
from worlds.constraining import stated
from worlds.mixed import RandomWorld
from worlds.phrases import ANYONE, EACH, LOCAL, SELF

HEADER = """\
@prefix :        <https://example.org/w#> .
@prefix c:       <https://w3id.org/confab/core#> .
@prefix owl:     <http://www.w3.org/2002/07/owl#> .
@prefix rdfs:    <http://www.w3.org/2000/01/rdf-schema#> .
@prefix skos:    <http://www.w3.org/2004/02/skos/core#> .
@prefix xsd:     <http://www.w3.org/2001/XMLSchema#> .
@prefix dcterms: <http://purl.org/dc/terms/> .
<https://example.org/w> a owl:Ontology ; owl:imports <https://w3id.org/confab/core> ; c:symbolicOnly true ;
  dcterms:title "w"@en ; dcterms:description "w"@en .
"""
TUPLES = frozenset({"way", "between"})
"""Relations whose rows are individuals of the scene: a number of two individuals, and a relation of three individuals."""
CONTRARY = {"<": ">=", "<=": ">", ">=": "<", ">": "<="}
"""The sign of the negation of a comparison."""


def scene(world: RandomWorld) -> str:
    """Return a world as a scene in Turtle."""
    return HEADER + "\n".join(_Scene(world).lines()) + "\n"


def _iri(name: str) -> str:
    return f"c:{name}" if name in (TRUE, FALSE) else f":{name}"


def _decimal(number: Fraction) -> str:
    said = written(number)
    return said if "." in said else f"{said}.0"


def without(one: Behavior, other: Behavior) -> Behavior | None:
    """Return what a behaviour adds to another behaviour that it extends, or None if it lacks a part of the other one."""
    parts = ("parameters", "variables", "preconditions", "effects", "amounts")
    mine, its = ([getattr(each, part) for part in parts] for each in (one, other))
    written = set[str]().union(*map(_names, other.conditions))
    its[1] = tuple(variable for variable in its[1] if variable.name in written)
    mine[1] = (*its[1], *(variable for variable in mine[1] if variable not in its[1]))
    if any(part[: len(less)] != less for part, less in zip(mine, its, strict=True)):
        return None
    return replace(one, **{name: part[len(less) :] for name, part, less in zip(parts, mine, its, strict=True)})


def _names(condition: Condition) -> set[str]:
    """Return the variables of a condition, with the variables of witnesses."""
    witnesses = {inner.variable for inner in walk(condition) if isinstance(inner, Witness)}
    return witnesses.union(*(filter(is_variable, terms(inner)) for inner in walk(condition)))


def _joined(conditions: Sequence[Condition], outside: frozenset[str] = frozenset()) -> bool:
    """Return whether a name is local to a side of UNION, and occurs outside of the UNION; an update may not contain such names."""
    shared = plain_variables(conditions)
    for i, one in enumerate(conditions):
        if isinstance(one, AnyOf) and len(one.alternatives) > 1 and not one.negated:
            others = outside.union(*map(_names, (*conditions[:i], *conditions[i + 1 :])))
            if not (_names(one) - shared).isdisjoint(name for name in others if name.startswith((LOCAL, "?u"))):
                return True
    return any(_joined(group) for one in conditions for group in groups(one))


class _Scene:
    """Writes one world as Turtle."""

    def __init__(self, world: RandomWorld) -> None:
        self.world, self.problem = world, world.problem
        self.situations = world.problem.domain.situations
        self.nodes: list[str] = []
        self.written: list[tuple[Behavior, str]] = []  # behaviours written as updates, and the updates
        self.terms: dict[str, str] = {}
        self.where, self.count = "", 0
        self.rng, self.queries = Random(f"goals {world.seed}"), Random(f"queries {world.seed}")

    def lines(self) -> Iterator[str]:
        yield from self.classes()
        for one in self.situations.values():
            if one.arguments != (TASK,) and not one.added:
                yield from self.situation(one)
        for relation, kind in (("near", "owl:ObjectProperty"), ("size", "owl:DatatypeProperty")):
            if relation in self.problem.relations:
                yield self.node(relation, f"{kind}, owl:NamedIndividual, c:Relation")
        for relation in sorted(TUPLES & self.problem.relations.keys()):
            yield self.node(relation, "owl:NamedIndividual, c:Relation")
        for name, rules in self.problem.domain.rules.items():
            if self.situations[name].arguments == (TASK,) or self.situations[name].added:
                continue
            yield from self.world.axioms.get(name, ())
            for number, rule in enumerate(() if name in self.world.axioms else rules):
                yield from self.rule(f"{name}.r{number}", rule)
        for aggregate in self.problem.domain.aggregates.values():
            yield from self.aggregate(aggregate)
        for index, behavior in enumerate(self.problem.domain.behaviors.values(), start=1):
            yield from self.behavior(index, behavior)
        yield from self.individuals()
        yield from self.facts()
        yield from self.task()

    def node(self, name: str, kinds: str, *said: str) -> str:
        """Return an individual with its label and definition."""
        parts = [f"{_iri(name)} a {kinds}", *said, f'rdfs:label "{name}"@en', f'skos:definition "{name}."@en']
        return " ; ".join(parts) + " ."

    def part(self, kind: str, *said: str) -> str:
        """Write a part of a behaviour, and return the IRI of the part."""
        self.count += 1
        iri = f":{self.where}.c{self.count:03}"
        self.nodes.append(" ; ".join([f"{iri} a owl:NamedIndividual, c:{kind}", *said, 'rdfs:label "c"@en']) + " .")
        return iri

    # ------------------------------------------------------------------------------------------------------------ domain

    def classes(self) -> Iterator[str]:
        for name, parents in self.world.parents.items():
            above = [] if any(p in self.world.parents for p in parents) else ["c:Object"]
            owned = [_iri(s) for s, owners in self.world.owners.items() if name in owners]
            said = [f"rdfs:subClassOf {', '.join([*above, *map(_iri, dict.fromkeys(parents))])}"]
            said += [f"c:hasSituationType {', '.join(owned)}"] if owned else []
            said += [f"owl:equivalentClass {self.world.definitions[name]}"] if name in self.world.definitions else []
            yield self.node(name, "owl:Class, owl:NamedIndividual", *said)
        for name in sorted(self.world.definitions.keys() - self.world.parents.keys()):
            yield self.node(
                name, "owl:Class, owl:NamedIndividual", f"owl:equivalentClass {self.world.definitions[name]}"
            )

    def situation(self, one: SituationType) -> Iterator[str]:
        name, owners = one.name, self.world.owners[one.name]
        domain = self.problem.domain
        derived = {*domain.rules, *domain.aggregates, *domain.remembers}
        said = [f"c:fromLevel {one.level}"] if one.level != 1 and name not in derived else []
        said += [f"c:restValue {_iri(one.rest)}"] if one.rest is not None else []
        said += stated(self.problem, name)
        quantity = one.quantity
        if quantity is None and one.default not in (None, FALSE, one.rest):
            said.append(f"c:defaultValue {_iri(str(one.default))}")
        if quantity is not None:
            said += [f"c:leastAmount {_decimal(quantity.least)}"] if quantity.least is not None else []
            said += [f"c:mostAmount {_decimal(quantity.most)}"] if quantity.most is not None else []
            said += [f"c:defaultAmount {one.default}.0"] if one.default is not None else []
            said += ["c:wholeNumbers true"] if quantity.whole and not owners else []
        has_property = bool(owners) and (name in self.world.pairs or not one.boolean)
        said += [f"c:valueProperty :{name.lower()}"] if has_property else []
        if name in self.problem.domain.remembers:
            said.append(f"c:remembers :{self.problem.domain.remembers[name]}")
        if not owners:
            said.append("c:parameter " + ", ".join(f":{name}.{i}" for i in range(1, len(one.arguments) + 1)))
        kinds = (
            "owl:NamedIndividual, c:SituationType, c:Amount"
            if quantity
            else "owl:Class, owl:NamedIndividual, c:SituationType"
        )
        yield self.node(name, kinds, *said)
        for i, kind in enumerate(() if owners else one.arguments, start=1):
            yield f":{name}.{i} a owl:NamedIndividual, c:Parameter ; c:index {i} ; c:termType :{kind} ."
        if has_property:
            kinds = "owl:DatatypeProperty" if quantity else "owl:ObjectProperty"
            kinds += "" if name in self.world.pairs else ", owl:FunctionalProperty"
            ends = [f"rdfs:domain :{owners[0]}"] if len(owners) == 1 and name not in self.world.axioms else []
            if quantity:
                ends.append(f"rdfs:range xsd:{'integer' if quantity.whole else 'decimal'}")
            elif name not in self.world.axioms:
                ends.append(f"rdfs:range :{name}")
            yield self.node(name.lower(), f"{kinds}, owl:NamedIndividual", *ends)
        for value in self.problem.classes.get(name, ()):
            if value.startswith(name):
                level = self.problem.value_levels.get(value, 1)
                yield self.node(
                    value, f"owl:NamedIndividual, :{name}", *([f"c:fromLevel {level}"] if level != 1 else [])
                )

    def rule(self, name: str, rule: Rule) -> Iterator[str]:
        parameters, conditions = self.by_class(rule.parameters, rule.conditions)
        rule = replace(rule, parameters=parameters, conditions=conditions)
        opened = self.with_own(rule.behavior)
        rule = replace(rule, variables=opened.variables, conditions=opened.preconditions)
        if self.world.queries and self.queries.random() < 0.5 and (text := self.as_update(rule.behavior)) is not None:
            query = text.replace("INSERT", "CONSTRUCT", 1)
            yield self.node(name, "owl:NamedIndividual, c:Rule", f'c:construct """{query}"""')
            return
        self.begin(name, [p.name for p in (*rule.parameters, *rule.variables)])
        asked = [self.condition(one) for one in rule.conditions]
        head = self.said(rule.situation, [p.name for p in rule.parameters], TRUE)
        said = [f"c:condition {', '.join(asked)}"] if asked else []
        yield self.node(name, "owl:NamedIndividual, c:Rule", *head, *said)
        yield from self.declared(rule.behavior)
        yield from self.nodes

    def aggregate(self, one: Aggregate) -> Iterator[str]:
        name = f"{one.situation}.total"
        terms, conditions = self.by_class((*one.parameters, *one.variables), one.conditions)
        many = len(one.parameters)
        one = replace(one, parameters=terms[:many], variables=terms[many:], conditions=conditions)
        opened = self.with_own(one.behavior)
        one = replace(one, conditions=opened.preconditions)
        self.begin(name, [p.name for p in (*opened.parameters, *opened.variables)])
        owners = [p.name for p in one.parameters]
        if "|" in one.parameters[0].kind and isinstance(one.conditions[0], EqualityCondition):
            owners = [one.conditions[0].right]  # the rule of a total of several classes names one individual
            one = replace(one, parameters=(), conditions=one.conditions[1:])
        asked = [self.condition(condition) for condition in one.conditions]
        said = [f"c:situationType :{one.situation}", *self.arguments(owners)]
        said += [f'c:aggregate "{one.function}"', f"c:over {', '.join(self.terms[v.name] for v in one.variables)}"]
        said += [self.side("right", one.amount)] if one.function != "count" else []
        said += [f"c:condition {', '.join(asked)}"] if asked else []
        yield self.node(name, "owl:NamedIndividual, c:Rule", *said)
        yield from self.declared(replace(opened, parameters=one.parameters))
        yield from self.nodes

    def begin(self, name: str, terms: Sequence[str]) -> None:
        self.where, self.nodes, self.count = name, [], 0
        self.terms = {term: f":{name}.{term[1:]}" for term in terms}

    def declared(self, one: Behavior) -> Iterator[str]:
        for i, parameter in enumerate(one.parameters, start=1):
            said = f"c:Parameter ; c:index {i} ; c:termType {_iri(parameter.kind)}"
            yield f"{self.terms[parameter.name]} a owl:NamedIndividual, {said} ."
        for variable in one.variables:
            said = f"c:Variable ; c:termType {_iri(variable.kind)}"
            yield f"{self.terms[variable.name]} a owl:NamedIndividual, {said} ."

    def behavior(self, index: int, one: Behavior) -> Iterator[str]:
        head = [f"c:level {one.level}", f"c:index {index}"]
        head += [f"c:cost {one.cost}"] if one.cost != 1 else []
        parameters, conditions = self.by_class(one.parameters, one.preconditions)
        one = self.with_own(replace(one, parameters=parameters, preconditions=conditions))
        if one.name in self.world.updates and one.price is None and (text := self.as_update(one)) is not None:
            said = [f'c:update """{text}"""']
            for other, its in self.written if self.world.extending else ():
                more = without(one, other)
                added = None if more is None else self.as_update(more)
                if added is not None and self.numbers(added).isdisjoint(self.numbers(its)):
                    said = [f"c:extends :{other.name}", f'c:update """{added}"""']
                    break
            self.written.append((one, text))
            yield self.node(one.name, "owl:NamedIndividual, c:Behavior", *head, *said)
            return
        self.begin(one.name, [p.name for p in (*one.parameters, *one.variables)])
        head += [f"c:parameter {', '.join(self.terms[p.name] for p in one.parameters)}"] if one.parameters else []
        head += [f"c:price {self.calculation(one.price)}"] if one.price is not None else []
        asked = [self.condition(condition) for condition in one.asked]
        head += [f"c:precondition {', '.join(asked)}"] if asked else []
        effects = []
        for effect in one.every_effect:
            if effect.each is not None:
                (each,), conditions = self.by_class((effect.each,), effect.when)
                effect, self.terms[EACH] = replace(effect, when=conditions), f":{each.kind}"
            when = [self.condition(condition) for condition in effect.when]
            tail = [f"c:when {', '.join(when)}"] if when else []
            if isinstance(effect, ValueEffect):
                made = self.part("ValueEffect", *self.said(effect.situation, effect.arguments, effect.value), *tail)
            else:
                made = self.part(
                    "AmountEffect", f"c:situationType :{effect.situation}", *self.arguments(effect.arguments),
                    f'c:change "{effect.operation}"', self.side("right", effect.amount), *tail,
                )  # fmt: skip
            effects.append(made)
        yield self.node(one.name, "owl:NamedIndividual, c:Behavior", *head, f"c:postcondition {', '.join(effects)}")
        yield from self.declared(one)
        yield from self.nodes

    def numbers(self, text: str) -> set[str]:
        """Return the variables of an update that stand for numbers; two updates that are joined share variables of one name."""
        amounts = [name for name, its in self.situations.items() if its.quantity is not None]
        stems = ["after", *amounts, *map(str.lower, amounts)]
        return set(re.findall(rf"\?(?:{'|'.join(stems)})\w*", text))

    def as_update(self, one: Behavior) -> str | None:
        """Return a behaviour as a SPARQL update, or None if an update can't express the behaviour."""
        every = [replace(effect, when=tuple(map(self.with_classes, effect.when))) for effect in one.every_effect]
        one = replace(
            one, preconditions=tuple(map(self.with_classes, one.preconditions)),
            effects=tuple(effect for effect in every if isinstance(effect, ValueEffect)),
            amounts=tuple(effect for effect in every if isinstance(effect, AmountEffect)),
        )  # fmt: skip
        properties = {
            name: name.lower()
            for name, its in self.situations.items()
            if self.world.owners.get(name) and (name in self.world.pairs or not its.boolean)
        }
        if _joined(one.asked, frozenset(name for effect in every for c in effect.when for name in _names(c))):
            return None
        try:
            return update(one, Situations(properties, self.world.pairs), _iri)
        except ValueError:
            return None

    # -------------------------------------------------------------------------------------------------------- conditions

    def class_of(self, one: Condition) -> tuple[str, str, str] | None:
        """Return the term of a condition that a described class expresses, with the class and its base, or None."""
        if isinstance(one, AnyOf) and len(one.alternatives) == 1 and isinstance(one.alternatives[0][0], ClassCondition):
            of = one.alternatives[0][0]
            for name, conditions in self.world.described.items():
                if one.alternatives[0] == tuple(substituted(each, {SELF: of.term}) for each in conditions):
                    return of.term, name, of.kind
        return None

    def with_own(self, one: Behavior) -> Behavior:
        """Return a behaviour with the conditions of local variables in place of the variables' witnesses."""
        kinds = dict(one.kinds)
        conditions = tuple(self.opened(condition, kinds) for condition in one.preconditions)
        effects = tuple(replace(e, when=tuple(self.opened(c, kinds) for c in e.when)) for e in one.effects)
        amounts = tuple(replace(e, when=tuple(self.opened(c, kinds) for c in e.when)) for e in one.amounts)
        variables = (Parameter(name, kind) for name, kind in kinds.items() if name not in one.kinds)
        return replace(
            one, variables=(*one.variables, *variables), preconditions=conditions, effects=effects, amounts=amounts
        )

    def opened(self, one: Condition, kinds: dict[str, str]) -> Condition:
        """Return a condition whose groups have local variables in place of witnesses; add the variables' classes to `kinds`."""

        def group(conditions: Sequence[Condition]) -> tuple[Condition, ...]:
            found = list[Condition]()
            for each in conditions:
                if isinstance(each, Witness) and not each.negated and each.variable.startswith(LOCAL):
                    (own,), inner = self.by_class((Parameter(each.variable, each.kind),), each.conditions)
                    if kinds.setdefault(own.name, own.kind) == own.kind:
                        found += group(inner)
                        continue
                found.append(self.opened(each, kinds))
            return tuple(found)

        match one:
            case Witness():
                return replace(one, conditions=group(one.conditions))
            case AnyOf(alternatives) if self.class_of(one) is None:
                return replace(one, alternatives=tuple(map(group, alternatives)))
            case _:
                return one

    def with_classes(self, one: Condition) -> Condition:
        """Return a condition with described classes in place of their conditions."""
        match one:
            case AnyOf(alternatives):
                if (said := self.class_of(one)) is not None:
                    return ClassCondition(said[0], said[1], one.negated)
                return replace(one, alternatives=tuple(tuple(map(self.with_classes, group)) for group in alternatives))
            case Witness():
                return replace(one, conditions=tuple(map(self.with_classes, one.conditions)))
            case _:
                return one

    def by_class(
        self, parameters: tuple[Parameter, ...], conditions: tuple[Condition, ...]
    ) -> tuple[tuple[Parameter, ...], tuple[Condition, ...]]:
        """Return parameters and conditions; described classes become the classes of parameters."""
        found = {one.name: one for one in parameters}
        left = []
        for one in conditions:
            said = None if one.negated else self.class_of(one)
            if said is not None and said[0] in found and found[said[0]].kind == said[2]:
                found[said[0]] = Parameter(said[0], said[1])
            else:
                left.append(one)
        return tuple(found.values()), tuple(left)

    def put(self, term: str) -> str:
        return self.terms.get(term) or _iri(term)

    def arguments(self, terms: Sequence[str]) -> list[str]:
        return [f"c:{name} {self.put(term)}" for name, term in zip(ARGUMENTS, terms, strict=False)]

    def said(self, situation: str, arguments: Sequence[str], value: str) -> list[str]:
        """Return the properties that state a value of a situation type for its arguments."""
        first = f"c:situationType :{situation}"
        if situation in self.world.pairs:
            subject, target = arguments
            said = [first, f"c:about {self.put(subject)}", f"c:value {self.put(target)}"]
            return [*said, "c:negated true"] if value == FALSE else said
        said = [first, *self.arguments(arguments)]
        if self.situations[situation].boolean and value == FALSE and sum(map(ord, situation)) % 2:
            return [*said, "c:negated true"]
        return said if value == TRUE else [*said, f"c:value {self.put(value)}"]

    def wanted(self, symbol: Symbol, value: str) -> list[str]:
        """Return the properties that state a goal; a negated goal excludes the only other value of the symbol."""
        others = [
            other for other in self.problem.classes.get(self.situations[symbol.situation].range, ()) if other != value
        ]
        if len(others) == 1 and self.rng.random() < 0.4:
            said = self.said(symbol.situation, symbol.arguments, others[0])
            return said[:-1] if said[-1] == "c:negated true" else [*said, "c:negated true"]
        return self.said(symbol.situation, symbol.arguments, value)

    def wish(self, one: Condition) -> str:
        """Write a goal that isn't a fact, and return the IRI of the goal; a goal on one amount names the amount itself."""
        match one:
            case Comparison(Amount(situation, arguments), "=", Fraction() as limit, True):
                said = [f"c:situationType :{situation}", *self.arguments(arguments), f"c:amount {_decimal(limit)}"]
                return self.part("Comparison", *said, 'c:sign "="', "c:negated true")
            case Comparison(Amount(situation, arguments), sign, Fraction() as limit, False) if self.rng.random() < 0.5:
                said = [f"c:situationType :{situation}", *self.arguments(arguments), f"c:amount {_decimal(limit)}"]
                return self.part("Comparison", *said, f'c:sign "{sign}"')
            case AnyOf((group,), False) if len(group) > 1:
                return self.part("AllOf", f"c:condition {', '.join(self.condition(each) for each in group)}")
            case _:
                return self.condition(one)

    def condition(self, one: Condition) -> str:
        """Write a condition with its nested conditions, and return the IRI of the condition."""
        no = ["c:negated true"] if one.negated else []
        match one:
            case ValueCondition(situation, arguments, value):
                return self.part("ValueCondition", *self.said(situation, arguments, value), *no)
            case RelationCondition(relation, arguments):
                subject, *others = arguments
                said = [f"c:relation :{relation}", *self.arguments(arguments)]
                if relation not in TUPLES:
                    said = [f"c:relation :{relation}", f"c:about {self.put(subject)}", f"c:value {self.put(others[0])}"]
                return self.part("RelationCondition", *said, *no)
            case ClassCondition(term, kind):
                return self.part("ClassCondition", f"c:about {self.put(term)}", f"c:ofClass :{kind}", *no)
            case EqualityCondition(left, right):
                return self.part("EqualityCondition", f"c:about {self.put(left)}", f"c:value {self.put(right)}", *no)
            case Comparison(left, sign, right):
                said = [f'c:sign "{sign}"', self.side("left", left), self.side("right", right)]
                return self.part("Comparison", *said, *no)
            case AnyOf() if (of_class := self.class_of(one)) is not None:
                return self.part("ClassCondition", f"c:about {self.put(of_class[0])}", f"c:ofClass :{of_class[1]}", *no)
            case AnyOf(alternatives):
                groups = [self.group(group) for group in alternatives]
                return self.part("AnyOf", f"c:alternative {', '.join(groups)}", *no)
            case Witness(variable, kind, (ValueCondition(situation, _, value),)) if variable == ANYONE:
                said = [f"c:situationType :{situation}", f"c:ofClass :{kind}"]
                said += [] if value == TRUE else [f"c:value {self.put(value)}"]
                return self.part("AbsenceCondition", *said, *([] if one.negated else ["c:negated true"]))
            case Witness(variable, kind, (ValueCondition() as inner,), True) if variable == EACH:
                before = self.terms.get(EACH)
                self.terms[EACH] = f":{kind}"
                no = [] if inner.negated else ["c:negated true"]
                found = self.part("ValueCondition", *self.said(inner.situation, inner.arguments, inner.value), *no)
                if before is not None:
                    self.terms[EACH] = before
                return found
            case Witness(variable, kind, conditions):
                (sought_of,), conditions = self.by_class((Parameter(variable, kind),), conditions)
                self.count += 1
                before = self.terms.get(variable)
                self.terms[variable] = f":{self.where}.w{self.count:03}"
                self.nodes.append(
                    f"{self.terms[variable]} a owl:NamedIndividual, c:Variable ; c:termType {_iri(sought_of.kind)} ."
                )
                inside = [self.condition(each) for each in conditions]
                sought = f"c:witness {self.terms[variable]}"
                if before is not None:
                    self.terms[variable] = before
                return self.part("Witness", sought, f"c:condition {', '.join(inside)}", *no)

    def group(self, conditions: Sequence[Condition]) -> str:
        inside = [self.condition(one) for one in conditions]
        return inside[0] if len(inside) == 1 else self.part("AllOf", f"c:condition {', '.join(inside)}")

    def side(self, name: str, one: Expression) -> str:
        """Return the property that states one side of a comparison or calculation."""
        if name == "right" and isinstance(one, Fraction):
            return f"c:amount {_decimal(one)}"
        return f"c:{name} {self.calculation(one)}"

    def calculation(self, one: Expression) -> str:
        match one:
            case Calculation(sign, left, right):
                return self.part("Calculation", f'c:sign "{sign}"', self.side("left", left), self.side("right", right))
            case Amount(situation, arguments):
                return self.part("Calculation", f"c:situationType :{situation}", *self.arguments(arguments))
            case Measure(relation, arguments):
                return self.part("Calculation", f"c:relation :{relation}", *self.arguments(arguments))
            case Fraction():
                return self.part("Calculation", f"c:amount {_decimal(one)}")

    # ------------------------------------------------------------------------------------------------------------- scene

    def individuals(self) -> Iterator[str]:
        classes = self.problem.classes
        everyone = list(dict.fromkeys([*classes["A"], *classes["B"]]))
        parents = {kind: its for kind, its in self.world.parents.items() if kind not in self.world.definitions}
        for index, name in enumerate(everyone, start=1):
            own = [kind for kind in parents if name in classes[kind]]
            kinds = [f":{kind}" for kind in own if not any(kind in parents[other] for other in own)]
            said = [f"c:index {index}"]
            for symbol, value in self.problem.initial.items():
                situation = self.situations[symbol.situation]
                if symbol.arguments[0] != name or not self.world.owners[symbol.situation]:
                    continue
                if symbol.situation in self.world.pairs:
                    said.append(f":{symbol.situation.lower()} {_iri(symbol.arguments[1])}")
                elif not situation.boolean and value != (situation.default or situation.rest):
                    said.append(f":{symbol.situation.lower()} {value if situation.quantity else _iri(value)}")
            said += [
                f":near {_iri(row[1])}" for row in sorted(self.problem.relations.get("near", ())) if row[0] == name
            ]
            said += [f":size {row[1]}.0" for row in sorted(self.problem.relations.get("size", ())) if row[0] == name]
            yield self.node(name, f"owl:NamedIndividual, {', '.join(kinds)}", *said)
        own = [v for name in self.situations for v in classes.get(name, ()) if v.startswith(name)]
        if len(everyone) + len(own) > 1:
            yield f"[ a owl:AllDifferent ; owl:distinctMembers ( {' '.join(sorted(map(_iri, [*everyone, *own])))} ) ] ."

    def facts(self) -> Iterator[str]:
        """Yield the initial facts that can't be written as properties of individuals."""
        number = 0
        for relation, row in ((r, row) for r in sorted(TUPLES) for row in sorted(self.problem.relations.get(r, ()))):
            number += 1
            said = [f"c:relation :{relation}", *self.arguments(row[:-1] if relation == "way" else row)]
            said += [f"c:amount {row[-1]}.0"] if relation == "way" else []
            yield self.node(f"fact{number}", "owl:NamedIndividual, c:SituatedObjectInstance", *said)
        for symbol, value in self.problem.initial.items():
            situation = self.situations[symbol.situation]
            if self.world.owners[symbol.situation] and (not situation.boolean or symbol.situation in self.world.pairs):
                continue
            if value == situation.default:
                continue
            number += 1
            if situation.quantity is not None:
                said = [
                    f"c:situationType :{symbol.situation}",
                    *self.arguments(symbol.arguments),
                    f"c:amount {value}.0",
                ]
            else:
                said = self.said(symbol.situation, symbol.arguments, value)
            yield self.node(f"fact{number}", "owl:NamedIndividual, c:SituatedObjectInstance", *said)

    def task(self) -> Iterator[str]:
        self.begin("task", ())
        goals, hard, variables = list[str](), list[str](), dict[Parameter, None]()
        for symbol, value in self.goals():
            weight = self.problem.weights.get(symbol)
            soft = [] if weight is None else [f"c:weight {_decimal(weight)}"]
            if symbol.arguments == ("task",):
                name, _, member = symbol.situation.partition(".")
                if member not in ("", "0"):
                    continue  # one node states a wish about all individuals of a class
                (rule,) = self.problem.domain.rules[symbol.situation]
                goals.append(f":{name}")
                wanted = self.world.wishes[int(name.removeprefix("wish"))].condition if member else rule.conditions[0]
                kinds = dict[str, str]()
                wanted = self.opened(wanted, kinds)
                self.terms |= {variable: f":task.{variable[1:]}" for variable in kinds}
                variables |= {Parameter(variable, kind): None for variable, kind in kinds.items()}
                node = self.wish(wanted)
                self.nodes[-1] = (
                    " ; ".join([self.nodes[-1].replace(node, goals[-1], 1).removesuffix(" ."), *soft]) + " ."
                )
                continue
            found = goals if soft else hard
            if self.situations[symbol.situation].quantity is None:
                found.append(self.part("ValueCondition", *self.wanted(symbol, value), *soft))
                continue
            for sign, limit in bounds(value):
                said = [f"c:situationType :{symbol.situation}", *self.arguments(symbol.arguments), *soft]
                if sign in CONTRARY and self.rng.random() < 0.2:
                    sign, said = CONTRARY[sign], [*said, "c:negated true"]
                found.append(self.part("Comparison", *said, f'c:sign "{sign}"', f"c:amount {_decimal(limit)}"))
        if len(hard) > 1 and self.rng.random() < 0.1:
            hard = [self.part("AllOf", f"c:condition {', '.join(hard)}")]
        yield self.node("task", "owl:NamedIndividual, c:Task", f"c:goal {', '.join([*goals, *hard])}")
        for one in variables:
            yield f"{self.terms[one.name]} a owl:NamedIndividual, c:Variable ; c:termType {_iri(one.kind)} ."
        yield from self.nodes

    def goals(self) -> Iterator[tuple[Symbol, str]]:
        """Yield the goals as they are written: a class may stand for all of its members."""
        left = {symbol: value for symbol, value in self.problem.goal.items() if symbol not in self.problem.weights}
        for name, value in sorted({(symbol.situation, value) for symbol, value in left.items()}):
            kind = self.situations[name]
            symbols = {Symbol(name, (one,)) for one in self.problem.classes[kind.arguments[0]]}
            alike = all(left.get(symbol) == value for symbol in symbols) and kind.arguments[0] in self.world.parents
            if alike and len(kind.arguments) == 1 and kind.quantity is None and self.rng.random() < 0.8:
                left = {symbol: of for symbol, of in left.items() if symbol not in symbols}
                yield Symbol(name, kind.arguments), value
        yield from left.items()
        yield from ((symbol, self.problem.goal[symbol]) for symbol in self.problem.weights)

"""Validation rules on derived situation types, and on axioms that planning ignores."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence, Set

import pyoxigraph as ox

from confab.reasoner.closure import closure
from confab.reasoner.condition_nodes import NodeValues
from confab.reasoner.derivation import needed
from confab.reasoner.names import local_name
from confab.reasoner.problem import Domain
from confab.reasoner.reading.definitions import Definitions
from confab.reasoner.reading.frame import definitions_of
from confab.reasoner.reading.rows import OntologySchema
from confab.reasoner.symbols import ClassCondition, Parameter, Rule, ValueCondition
from confab.reasoner.validation.case import Fault, ReadCase
from confab.reasoner.vocabulary import CORE, OWL, RDF, RDFS

AXIOMS_OF_PROPERTIES = {
    OWL + "TransitiveProperty": "is transitive",
    OWL + "SymmetricProperty": "is symmetric",
    OWL + "ReflexiveProperty": "is reflexive",
}
NOT_EVALUATED = {
    OWL + "sameAs": "that two names mean one individual",
    OWL + "hasKey": "keys",
    OWL + "NegativePropertyAssertion": "negative assertions",
    OWL + "disjointUnionOf": "unions of disjoint classes",
}


def definitions_without_effect(case: ReadCase) -> Iterator[Fault]:
    """Find axioms and definitions that planning ignores, and stated facts about derived situation types."""
    schema, names, rules = case.reading.schema, case.names, case.problem.domain.rules
    of, relations = schema.value_properties, {*schema.of_kind("Relation", "ReachRelation")}
    nodes = (*schema.nodes.values(), *schema.swrl.values())
    used = {value for node in nodes for values in node.values() for value in values}
    for iri in definitions_of(schema, names).without_members(used):
        yield (
            iri,
            f"planning doesn't infer all members of {local_name(iri)}, since its definition has a negation, a number, 'only', "
            "'Self' or a list of individuals, and isn't of the form 'SomeClass and (…)' with known properties",
            "OWL 2 RL doesn't infer these members, so behaviours and rules about the class miss them",
            "define it once, as 'SomeClass and (…)', with value properties, relations and amounts; or state its members",
        )
    changed = {
        iri for effect in schema.of_kind("ValueEffect") for iri in schema.nodes[effect].get(CORE + "situationType", ())
    }
    for triple in case.triples:
        subject, predicate, value = triple.subject, triple.predicate.value, triple.object
        named = subject.value if isinstance(subject, ox.NamedNode) else ""
        other = value.value if isinstance(value, ox.NamedNode) else ""
        said = ""
        if named in of and predicate == RDF + "type" and other in AXIOMS_OF_PROPERTIES:
            said, prop = f"{local_name(named)} {AXIOMS_OF_PROPERTIES[other]}", named
        elif named in of and predicate == OWL + "propertyChainAxiom":
            said, prop = f"{local_name(named)} is a chain", named
        elif other in of and predicate == RDFS + "subPropertyOf" and named != other:
            said, prop = f"{local_name(named)} is a subproperty of {local_name(other)}", other
        elif named in of and other in of and predicate == OWL + "inverseOf":
            said, prop = f"{local_name(named)} is the inverse of {local_name(other)}", named
            if names.short(of[other]) in rules:
                continue
        elif named in of and other in of and predicate == OWL + "equivalentProperty":
            said, prop = f"{local_name(named)} and {local_name(other)} are equivalent", named
            if names.short(of[other]) in rules:
                continue
        for below, above in ((named, other), (other, named)):
            if below not in of or above not in relations:
                continue
            mutual = (
                predicate in (OWL + "equivalentProperty", OWL + "inverseOf") and names.short(of[below]) not in rules
            )
            if mutual or (below, predicate) == (named, RDFS + "subPropertyOf"):
                how = "the inverse of " if predicate == OWL + "inverseOf" else ""
                yield (
                    below,
                    f"planning doesn't evaluate that facts of {local_name(above)} follow from {how}{local_name(below)}, since "
                    f"{local_name(above)} is a relation",
                    "the facts of a relation are the same in every state, and don't follow from situations",
                    f"make {local_name(above)} the value property of a situation type that no behaviour changes, or drop the axiom",
                )
        if (
            said
            and names.short(of[prop]) not in rules
            and (fault := _unevaluated(schema, of[prop], prop, changed, said))
        ):
            yield fault
        if predicate in of and names.short(of[predicate]) in rules and named:
            yield (
                named,
                f"{local_name(named)} states {local_name(predicate)}, which is defined",
                "a defined situation follows from other facts in every state; stated facts about it are ignored",
                "state the facts from which it follows, or drop this one",
            )
        beyond = predicate if predicate in NOT_EVALUATED else other if predicate == RDF + "type" else ""
        if beyond in NOT_EVALUATED:
            yield (
                named or "the ontology",
                f"{NOT_EVALUATED[beyond]} ({local_name(beyond)}) aren't evaluated by planning",
                "individuals are told apart by their names, and what isn't stated is false",
                "state it as a rule or as facts of the scene, or drop it",
            )


def _unevaluated(schema: OntologySchema, situation: str, prop: str, changed: Set[str], said: str) -> Fault | None:
    """Return the reason why planning ignores an axiom about a value property, or None if another check reports the reason."""
    name, what = local_name(prop), f"planning doesn't evaluate that {said}, since "
    nodes = {**schema.axioms, **schema.expressions}
    into = any(
        prop in node.get(by, ())
        for node in nodes.values()
        for by in (RDFS + "subPropertyOf", OWL + "equivalentProperty")
    )
    into = into or any(nodes.get(prop, {}).get(OWL + by) for by in ("propertyChainAxiom", "equivalentProperty"))
    if situation in changed and not into:
        what += f"behaviours change {local_name(situation)}"
        why = "axioms can define static facts only; planning ignores this one"
        return (situation, what, why, "let behaviours change a subproperty of this one, or drop the axiom")
    if situation not in schema.pairs:
        what += f"{name} is functional"
        why = "a defined situation is true or false for each pair; a functional value property gives one value"
        return situation, what, why, f"drop owl:FunctionalProperty of {name}, or drop the axiom"
    if situation in changed:
        return None  # `effect-on-definition` reports the fault at the effect
    what += f"no property implies {name}"
    why = "planning derives consequences of situations that behaviours change and of static facts"
    mend = f"make a property that behaviours change, or a static one, rdfs:subPropertyOf {name}; or drop the axiom"
    return situation, what, why, mend


def defined(case: ReadCase) -> Iterator[Fault]:
    """Report, for each derived situation type, the changing situation types on which it depends, or that it is static."""
    domain, names = case.problem.domain, case.names
    changed = frozenset[str]().union(*(behavior.changes for behavior in domain.behaviors.values()))
    reads = {name: {s for rule in its for s, _ in needed(rule.conditions)} for name, its in domain.rules.items()}
    for name in domain.rules:
        if name not in names or names.iri(name) not in case.reading.schema.nodes:
            continue  # it expresses a constraint on several states, or a goal about a further member of a class
        if closure([name], lambda each: reads.get(each, ())) & changed:
            what = f"{name} is derived: in every state it follows from {' and '.join(sorted(reads[name] - {name}))}"
            why = "planning derives it in each state from its definition; no behaviour changes it"
            yield names.iri(name), what, why, "nothing"
        else:
            what = f"{name} is static: no behaviour changes the facts from which it follows"
            why = "it is the same in every state"
            yield (
                names.iri(name),
                what,
                why,
                "nothing, if intended; otherwise define it by situations that behaviours change",
            )


def conclusions_outside_class(case: ReadCase) -> Iterator[Fault]:
    """Find rules whose conclusion is about an individual of a wrong class, for example because of swapped arguments."""
    domain, names = case.problem.domain, case.names
    for name, rules in domain.rules.items():
        for rule in rules:
            for parameter, wanted in zip(rule.parameters, domain.situations[name].arguments, strict=True):
                of = next((kind for kind in _asked(rule, parameter, domain) if not both(case, kind, wanted)), None)
                if of is not None:
                    said = ", ".join(p.name.removeprefix("?") for p in rule.parameters)
                    yield (
                        names.iri(name),
                        f"a rule concludes {name}({said}), but its conditions require that "
                        f"{parameter.name.removeprefix('?')} is of the "
                        f"class {of.replace('|', ' or ')}, and {name} needs an individual of {wanted.replace('|', ' or ')} there",
                        "the rule never concludes anything",
                        "correct the order of the arguments in the conclusion, or a class or property in the conditions; or "
                        "state that "
                        f"the class {of.split('|')[0]} has {name}, too",
                    )


def _asked(rule: Rule, parameter: Parameter, domain: Domain) -> Iterator[str]:
    """Yield the classes that a rule's parameter must belong to according to the rule's conditions."""
    yield parameter.kind
    for condition in rule.conditions:
        match condition:
            case ClassCondition(term, kind, False) if term == parameter.name:
                yield kind
            case ValueCondition(situation, arguments, _, False):
                for term, kind in zip(arguments, domain.situations[situation].arguments, strict=True):
                    if term == parameter.name:
                        yield kind
            case _:
                pass


def both(case: ReadCase, one: str, other: str) -> bool:
    """Return whether an individual may belong to two classes (or unions): a common member or a common subclass exists."""
    problem = case.problem
    if {*problem.classes.get(one, ())} & {*problem.classes.get(other, ())}:
        return True

    def below(kind: str) -> set[str]:
        return closure(kind.split("|"), lambda each: (sub for sub, above in problem.parents.items() if each in above))

    return not below(one).isdisjoint(below(other))


NOT_ENFORCED = {
    OWL + "InverseFunctionalProperty": "has at most one value for each individual",
    OWL + "AsymmetricProperty": "is asymmetric",
    OWL + "IrreflexiveProperty": "relates no individual to itself",
}


def axioms_not_watched(case: ReadCase) -> Iterator[Fault]:
    """Find axioms that planning ignores: axioms that restrict every state, and subclass axioms that no definition implies."""
    known = case.reading.schema.expressions
    of = {prop for node in case.reading.schema.nodes.values() for prop in node.get(CORE + "valueProperty", ())}
    definitions = Definitions(known, dict.fromkeys(of, ("", True)), case.names)
    inside: dict[object, list[ox.Triple]] = defaultdict(list)
    for triple in case.triples:
        inside[triple.subject].append(triple)
    why = "behaviours change it, and their results aren't checked against this axiom"
    mend = "state it as a precondition of the behaviours that could violate it, or drop the axiom"
    for triple in case.triples:
        subject, predicate, value = triple.subject, triple.predicate.value, triple.object
        named = subject.value if isinstance(subject, ox.NamedNode) else ""
        other = value.value if isinstance(value, ox.NamedNode) else ""
        if named in of and predicate == RDF + "type" and other in NOT_ENFORCED:
            yield named, f"planning doesn't enforce that {local_name(named)} {NOT_ENFORCED[other]}", why, mend
        if named in of and predicate == OWL + "propertyDisjointWith":
            said = f"planning doesn't enforce that {local_name(named)} and {local_name(other)} never lead to the same individual"
            yield named, said, why, mend
        if predicate != RDFS + "subClassOf":
            continue
        if not other and _properties_in(value, inside) & of:
            yield (
                named,
                f"planning doesn't enforce the axiom about each {local_name(named)} in every state",
                why,
                mend,
            )
        elif not named and other and _properties_in(subject, inside) & of:
            yield (
                other,
                f"an expression is stated to be a subclass of {local_name(other)}, from which planning draws no conclusions",
                "the members of a class follow from its definition, and from stated types",
                f"define {local_name(other)} by owl:equivalentClass, or conclude it by a SWRL rule",
            )
        elif named and other and definitions.changes(named) and other not in _above(case, named):
            yield (
                named,
                f"planning doesn't conclude that each {local_name(named)} is of the class {local_name(other)}",
                "the members of a class follow from its definition, and from stated types",
                f"name {local_name(other)} in the definition of {local_name(named)}, or define it as a union with that",
            )


def _properties_in(node: object, inside: Mapping[object, Sequence[ox.Triple]]) -> set[str]:
    """Return the properties in the restrictions of a class expression."""

    def parts(node: object) -> Iterator[object]:
        return (triple.object for triple in inside.get(node, ()) if isinstance(triple.object, ox.BlankNode))

    return {
        triple.object.value
        for part in closure([node], parts)
        for triple in inside.get(part, ())
        if triple.predicate.value == OWL + "onProperty" and isinstance(triple.object, ox.NamedNode)
    }


def _above(case: ReadCase, iri: str) -> set[str]:
    """Return the classes that contain every member of a defined class: equivalent classes, conjuncts, and their superclasses."""
    schema = case.reading.schema

    def conjuncts(kind: str) -> Iterator[str]:
        for node in schema.expressions.get(kind, {}).get(OWL + "equivalentClass", ()):
            yield from (part for part in (node, *_items(schema.expressions, node)) if ":" in part)
        yield from (
            other for other, node in schema.expressions.items() if kind in node.get(OWL + "equivalentClass", ())
        )

    return closure([*closure(conjuncts(iri), conjuncts), OWL + "Thing"], lambda kind: schema.supers.get(kind, ()))


def _items(expressions: Mapping[str, NodeValues], node: str) -> Iterator[str]:
    """Yield the conjuncts of an intersection."""
    cells, seen = list(expressions.get(node, {}).get(OWL + "intersectionOf", ())), set[str]()
    while cells:
        cell = cells.pop()
        if cell in expressions and cell not in seen:
            seen.add(cell)
            yield from expressions[cell].get(RDF + "first", ())
            cells += expressions[cell].get(RDF + "rest", ())


def earlier_states_of_others(case: ReadCase) -> Iterator[Fault]:
    """Find situation types whose condition about earlier states concerns a situation type of other individuals."""
    schema, names, problem = case.reading.schema, case.names, case.problem
    kinds = {*problem.classes, *problem.parents}
    for iri in schema.of_kind("SituationType"):
        for word, never in (("onlyAfter", "be true"), ("remembers", "become true")):
            for other in schema.nodes[iri].get(CORE + word, ()):
                one, two = (problem.domain.situations[names.short(each)] for each in (iri, other))
                for mine, its in zip(one.arguments, two.arguments, strict=True):
                    if problem.members(mine) & problem.members(its):
                        continue
                    if any(problem.below(kind, mine) and problem.below(kind, its) for kind in kinds):
                        continue
                    yield (
                        iri,
                        f"{one.name} of the class {mine} has c:{word} {two.name} of the class {its}, but the classes have no "
                        "common individual",
                        f"c:{word} compares the two situation types for the same individuals, so {one.name} can never {never}",
                        f"name a situation type of {mine} in c:{word}; if {its} is meant, define such a type by a c:Rule, as in "
                        f"CONSTRUCT {{ ?x :NEW true }} WHERE {{ ?x a :{mine} . ?y a :{its} ; :{two.name} true … }}",
                    )

"""Our own rules of validation, those that a SPARQL query can't say well: see `RULES` at the end.

Each rule is a function from a `Case` to findings, written as (node, what, why, remedy); its name is its first docstring word.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import combinations
from pathlib import Path
from urllib.parse import unquote

import pyoxigraph as ox

import ontology
from reasoner.amounts import Amount, Calculation, Expression, Measure, inside, situations_in, terms_of
from reasoner.derivation import needed
from reasoner.graph.knowledge import BASE, SCENE, KnowledgeGraph, text
from reasoner.language import groups, mentions, walk
from reasoner.names import local_name, nearest
from reasoner.reading.definitions import Definitions
from reasoner.reading.problem import Reading
from reasoner.reading.rows import Node, Schema
from reasoner.reading.swrl import SWRL
from reasoner.symbols import (
    FALSE,
    AmountEffect,
    AnyOf,
    Behavior,
    ClassCondition,
    Comparison,
    Condition,
    Domain,
    Parameter,
    Problem,
    Rule,
    ValueCondition,
    ValueEffect,
    Witness,
)
from reasoner.vocabulary import CORE, OWL, RDF, RDFS, XSD

Fault = tuple[str, str, str, str]
"""Node, what, why, remedy."""

BUILT_IN = (OWL, RDF, RDFS, XSD, SWRL, SWRL.replace("swrl#", "swrlb#"))
ATOMS = (SWRL + "argument1", SWRL + "argument2")
EVERY_OTHER = re.compile(r"\?each\d")
"""Who a class stands for where another one stands for somebody already (`reasoner.reading.parts`)."""
OF_A_RULE = "a variable or an individual of a SWRL rule"
OF_CLASSES = {RDF + "type", RDFS + "subClassOf", SWRL + "classPredicate"}
OF_CLASSES |= {
    OWL + name
    for name in ("disjointWith", "equivalentClass", "complementOf", "someValuesFrom", "allValuesFrom", "onClass")
}
OF_PROPERTIES = {OWL + "onProperty", RDFS + "subPropertyOf", OWL + "inverseOf", SWRL + "propertyPredicate"}
PROPERTIES = {OWL + kind for kind in ("ObjectProperty", "DatatypeProperty", "AnnotationProperty")}


@dataclass(frozen=True)
class Case:
    """What rules look at: the graph, and the problem read from it unless it couldn't be read."""

    graph: KnowledgeGraph
    reading: Reading | None

    @cached_property
    def triples(self) -> Sequence[ox.Triple]:
        """Every triple of the graphs that planning starts from."""
        names = [ox.NamedNode(BASE + name) for name in SCENE]
        return [quad.triple for name in names for quad in self.graph.store.quads_for_pattern(None, None, None, name)]

    @cached_property
    def types(self) -> dict[str, set[str]]:
        """The classes that each IRI is stated to have."""
        found: dict[str, set[str]] = defaultdict(set)
        for triple in self.triples:
            if (
                triple.predicate.value == RDF + "type"
                and isinstance(triple.subject, ox.NamedNode)
                and isinstance(triple.object, ox.NamedNode)
            ):
                found[triple.subject.value].add(triple.object.value)
        return found


# ------------------------------------------------------------------------------------------------------------------ names


def undeclared_terms(case: Case) -> Iterator[Fault]:
    """Find predicates that are no property, types that are no class, and individuals without a type."""
    seen = set()
    for subject, iri, wanted, kinds in _undeclared(case):
        if iri in seen:
            continue
        seen.add(iri)
        name = local_name(iri)
        known = {other: local_name(other) for other, types in case.types.items() if not kinds or kinds & types}
        elsewhere = sorted(other for other, called in known.items() if called == name and other != iri)
        hint = f"; did you mean <{elsewhere[0]}>?" if elsewhere else nearest(name, [*known.values()])
        yield (
            subject.value if isinstance(subject, ox.NamedNode) else iri,
            f"{name} is used as {wanted}, but isn't declared as one{hint}",
            "an unknown name is read as a new one, without a warning; what was meant by it is lost",
            f"mend the name, or declare <{iri}>{' a swrl:Variable' if wanted is OF_A_RULE else ''}",
        )


def _undeclared(case: Case) -> Iterator[tuple[object, str, str, set[str]]]:
    """Yield each use of a term that isn't declared: the subject, the term, what it has to be, in words and as classes."""
    for triple in case.triples:
        for iri, wanted, kinds in _uses(triple, case.types.get(triple.predicate.value, set())):
            types = case.types.get(iri, set())
            if not iri.startswith(BUILT_IN) and not (kinds & types if kinds else types):
                yield triple.subject, iri, wanted, kinds


def misread(case: Case) -> set[str]:
    """Return what names a term that isn't declared, and what names that: other faults of these may follow from it."""
    first = {subject.value for subject, *_ in _undeclared(case) if isinstance(subject, ox.NamedNode)}
    return first | {
        triple.subject.value
        for triple in case.triples
        if isinstance(triple.object, ox.NamedNode)
        and isinstance(triple.subject, ox.NamedNode)
        and triple.object.value in first
    }


def _uses(triple: ox.Triple, kinds_of_predicate: set[str]) -> Iterator[tuple[str, str, set[str]]]:
    """Yield the IRIs of a triple with what they have to be."""
    predicate, value = triple.predicate.value, triple.object
    yield predicate, "a property", PROPERTIES
    if not isinstance(value, ox.NamedNode):
        return
    if predicate in OF_CLASSES:
        yield value.value, "a class", {OWL + "Class", RDFS + "Datatype"}
    elif predicate in ATOMS:
        yield value.value, OF_A_RULE, set()
    elif OWL + "ObjectProperty" in kinds_of_predicate or predicate in (RDF + "first", OWL + "hasValue"):
        yield value.value, "a term", set()
    elif predicate in OF_PROPERTIES:
        yield value.value, "a property", PROPERTIES


MERGEABLE = """
SELECT DISTINCT ?individual ?class WHERE {
  { SELECT DISTINCT ?class WHERE {
    { ?above a :SituationType } UNION { ?above rdfs:subClassOf :Object } UNION { VALUES ?above { :Object } }
    UNION { ?property a owl:FunctionalProperty, owl:ObjectProperty ; rdfs:range ?above }
    ?class rdfs:subClassOf* ?above . FILTER(isIRI(?class) && (!STRSTARTS(STR(?class), STR(:)) || ?class = :Hand))
  } }
  ?individual a ?class, owl:NamedIndividual . FILTER NOT EXISTS { ?individual a owl:Class }
}"""


def individuals_not_different(case: Case) -> Iterator[Fault]:
    """Find things, or values of a functional property, of one class that nothing says to be different."""
    groups = _all_different(case)
    apart = {frozenset(pair) for pair in _pairs(case, OWL + "differentFrom")}
    members: dict[str, set[str]] = defaultdict(set)
    for individual, its_class in case.graph.select(MERGEABLE, ["asserted"]):
        members[text(its_class)].add(text(individual))
    for kind, individuals in sorted(members.items()):
        if len(individuals) < 2 or any(individuals <= group for group in groups):
            continue
        if len(individuals) < 50 and all(
            frozenset(pair) in apart or any(set(pair) <= group for group in groups)
            for pair in combinations(sorted(individuals), 2)
        ):
            continue
        missing = sorted(individuals - max(groups, key=lambda group: len(group & individuals), default=frozenset()))
        names = ", ".join(local_name(iri) for iri in missing[:5]) + (", …" if len(missing) > 5 else "")
        yield (
            missing[0] if missing else min(individuals),
            f"nothing says that {names} and the other individuals of {local_name(kind)} are different",
            "OWL lets two names mean one individual: a reasoner would merge them where a functional property clashes",
            "list all of them in one owl:AllDifferent (Protégé: Edit, Make all individuals different)",
        )


def _all_different(case: Case) -> list[frozenset[str]]:
    rows = case.graph.select(
        "SELECT ?group ?member WHERE { ?group owl:distinctMembers|owl:members ?list . "
        "?group a owl:AllDifferent . ?list rdf:rest*/rdf:first ?member }",
        SCENE,
    )
    groups: dict[str, set[str]] = defaultdict(set)
    for group, member in rows:
        groups[str(group)].add(member.value)  # type: ignore[union-attr]
    return [frozenset(group) for group in groups.values()]


def _pairs(case: Case, predicate: str) -> Iterator[tuple[str, str]]:
    for triple in case.triples:
        if triple.predicate.value == predicate and isinstance(triple.object, ox.NamedNode):
            yield triple.subject.value, triple.object.value  # type: ignore[union-attr]


def files_and_iris(case: Case) -> Iterator[Fault]:
    """Find files whose name isn't the last part of their IRI, and catalogs that lead elsewhere."""
    for iri, file in case.graph.files.items():
        wanted = unquote(local_name(iri))
        if file.stem != wanted:
            yield (
                iri,
                f"the file is called {file.name}, its ontology {wanted}",
                "who looks for an import finds it by its name, unless a catalog says otherwise",
                f"call the file {wanted}{file.suffix}, or the ontology …/{file.stem}",
            )
        for catalog in {file.with_name(ontology.CATALOG), ontology.ROOT / ontology.CATALOG}:
            if catalog.is_file() and (entry := ontology.catalog(catalog).get(iri)) and not _same(entry, file):
                yield (
                    iri,
                    f"{catalog} says that <{iri}> lies in {entry}, not here",
                    "Protégé would open the other file",
                    "mend the entry of the catalog",
                )


def _same(one: Path, other: Path) -> bool:
    return one.resolve() == other.resolve()


# ------------------------------------------------------------------------------------------------------------- behaviours


def undetermined_variables(case: Case) -> Iterator[Fault]:
    """Find variables that an effect or a negated condition names and that nothing determines."""
    if case.reading is None:
        return
    domain = case.reading.problem.domain
    rules = [(name, rule.behavior) for name, its in domain.rules.items() for rule in its]
    for name, behavior in (*domain.behaviors.items(), *rules):
        node = case.reading.names.iri(name)
        bound = {parameter.name for parameter in behavior.parameters}
        free = _undetermined(behavior.preconditions, bound)
        for effect in behavior.every_effect:
            inner = set(bound)
            free |= _undetermined(effect.when, inner)
            named = terms_of(effect.amount) if isinstance(effect, AmountEffect) else (effect.value,)
            free |= {term for term in (*effect.arguments, *named) if term.startswith("?")} - inner
        for variable in sorted(free):
            yield (
                node,
                f"nothing determines the variable {variable[1:]} of {name}",
                "a variable gets its individual from the situation: from a value condition that isn't negated",
                f"add a value condition whose value is {variable[1:]}, make it a parameter, or seek it with a witness",
            )


def _undetermined(conditions: Sequence[Condition], bound: set[str]) -> set[str]:
    """Return the variables that stay free in a conjunction; what it determines is added to `bound`."""
    waiting = list(conditions)
    progress = True
    while progress:
        progress = False
        for condition in list(waiting):
            if not isinstance(condition, ValueCondition) or condition.negated:
                continue
            if {term for term in condition.arguments if term.startswith("?")} <= bound:
                bound |= {condition.value} if condition.value.startswith("?") else set()
                waiting.remove(condition)
                progress = True
    free: set[str] = set()
    for condition in waiting:
        match condition:
            case Witness(variable, _, inner):
                free |= _undetermined(inner, bound | {variable})
            case AnyOf(alternatives):
                free |= set().union(*(_undetermined(group, set(bound)) for group in alternatives))
            case _:
                free |= mentions(condition) - bound
    return free


def other_kinds_in_when(case: Case) -> Iterator[Fault]:
    """Find effects on all of a class whose `when` asks something of all of another one that shares individuals with it."""
    if case.reading is None:
        return
    problem = case.reading.problem
    for name, behavior in problem.domain.behaviors.items():
        for effect in behavior.every_effect:
            for condition in effect.when:
                if not isinstance(condition, Witness) or not EVERY_OTHER.match(condition.variable):
                    continue
                kind = condition.kind
                if problem.members(kind) & {*effect.arguments}:
                    yield (
                        case.reading.names.iri(name),
                        f"{name} changes {effect.situation} of each of a class where something is so of every {kind}",
                        f"in :when only the effect's own class means the same individual; {kind} means all of its individuals",
                        f"name the effect's class there, and ask by a class condition that it is a {kind}",
                    )


def unreachable_behaviors(case: Case) -> Iterator[Fault]:
    """Find behaviours that ask for a value which is neither there at first nor the effect of any behaviour."""
    if case.reading is None or not case.reading.problem.initial:
        return
    problem, names = case.reading.problem, case.reading.names
    there = {(symbol.situation, value) for symbol, value in problem.initial.items()}
    there |= {(s.name, FALSE) for s in problem.domain.situations.values() if s.boolean}
    present = {symbol.situation for symbol in problem.initial}
    changed = frozenset[str]().union(*(behavior.changes for behavior in problem.domain.behaviors.values()))
    for situation in (
        problem.domain.situations.values()
    ):  # what no behaviour changes, somebody else does; what no object of the scene has is no matter here
        if situation.name not in changed or situation.name not in present:
            there |= {(situation.name, value) for value in problem.classes.get(situation.range, ())}
    waiting = dict(problem.domain.behaviors)
    while True:
        ready = [b for b in waiting.values() if all(_possible(c, b, problem, there) for c in b.preconditions)]
        if not ready:
            break
        for behavior in ready:
            del waiting[behavior.name]
            there |= {(e.situation, v) for e in behavior.effects for v in _individuals(e.value, behavior, problem)}
    for name, behavior in waiting.items():
        lacking = [c for c in behavior.preconditions if not _possible(c, behavior, problem, there)]
        said = "; ".join(sorted(_words(c) for c in lacking))
        yield (
            names.iri(name),
            f"{name} can never be chosen: nothing leads to {said}",
            "neither the initial situation nor any behaviour gives what its precondition asks for",
            "add a behaviour with that effect, state it in the scene, or drop the precondition",
        )
    for symbol, value in problem.goal.items():
        if problem.domain.situations[symbol.situation].quantity is not None:
            continue  # what it can come to is for planning to find out
        if problem.initial.get(symbol, FALSE) != value and (symbol.situation, value) not in there:
            yield (
                names.iri(symbol.arguments[0]),
                f"the goal {symbol} = {value} can't be reached: no behaviour leads to it",
                "neither the initial situation nor any behaviour gives what the goal asks for",
                "add a behaviour with that effect, or drop the goal",
            )


def _possible(condition: Condition, behavior: Behavior, problem: Problem, there: set[tuple[str, str]]) -> bool:
    match condition:
        case ValueCondition(situation, _, value, False):
            values = _individuals(value, behavior, problem)
            return not values or any((situation, v) in there for v in values)
        case Witness(_, _, inner, False):
            return all(_possible(c, behavior, problem, there) for c in inner)
        case AnyOf(alternatives, False):
            return any(all(_possible(c, behavior, problem, there) for c in group) for group in alternatives)
        case _:
            return True


def _individuals(term: str, behavior: Behavior, problem: Problem) -> Sequence[str]:
    """Return what a term can stand for; nothing for one that is bound inside a condition."""
    if not term.startswith("?"):
        return (term,)
    kinds = behavior.kinds
    return problem.classes.get(kinds.get(term, ""), ())


def _words(condition: Condition) -> str:
    if isinstance(condition, ValueCondition):
        return f"{condition.situation} = {condition.value.lstrip('?')}"
    return type(condition).__name__


def gaps_of_values(case: Case) -> Iterator[Fault]:
    """Find effects none of whose values a behaviour of the next level leads to."""
    if case.reading is None:
        return
    problem, names = case.reading.problem, case.reading.names
    leads: dict[tuple[int, str], set[str]] = defaultdict(set)
    for behavior in problem.domain.behaviors.values():
        for effect in behavior.effects:
            leads[behavior.level, effect.situation].update(_individuals(effect.value, behavior, problem))
    for behavior in problem.domain.behaviors.values():
        level = behavior.level + 1
        for effect in behavior.effects:
            values, finer = _individuals(effect.value, behavior, problem), leads.get((level, effect.situation))
            if values and finer and finer.isdisjoint(values):
                kind = behavior.kinds.get(effect.value)
                said = f"a {kind}" if kind else effect.value
                yield (
                    names.iri(behavior.name),
                    f"{behavior.name} on level {behavior.level} gives {effect.situation} {said}, "
                    f"and no behaviour of level {level} gives that",
                    "a refinement has to reach the same situation with behaviours of the next level; here it can't",
                    f"add a behaviour on level {level} with that effect, or widen the class of a parameter of one that has another",
                )


def crowded_places(case: Case) -> Iterator[Fault]:
    """Find things that have one value together at first, though every behaviour that gives it asks for it to be free."""
    if case.reading is None:
        return
    problem, names = case.reading.problem, case.reading.names
    asks: dict[tuple[str, str], set[str]] = {}  # of what is given: the classes of which nobody may have it already
    for behavior in problem.domain.behaviors.values():
        for effect in behavior.effects:
            free = {kind for c in behavior.preconditions if (kind := _none_has(c, effect))}
            for value in _individuals(effect.value, behavior, problem):
                given = effect.situation, value
                asks[given] = asks.get(given, free) & free
    holders: dict[tuple[str, str], list[str]] = defaultdict(list)
    for symbol, value in sorted(problem.initial.items()):
        if len(symbol.arguments) == 1 and asks.get((symbol.situation, value)):
            holders[symbol.situation, value].append(symbol.arguments[0])
    for (situation, value), individuals in holders.items():
        for kind in sorted(asks[situation, value]):
            several = [one for one in individuals if one in problem.classes.get(kind, ())]
            if len(several) > 1:
                some = ", ".join(several[:5]) + (", …" if len(several) > 5 else "")
                yield (
                    names.iri(several[1]),
                    f"the {situation} of {some} is {value} at first, though each behaviour giving that asks that no {kind} has it",
                    "no behaviour leads to such a situation, so it is likely not meant",
                    f"state another {situation} of all but one, or let the behaviours take several {kind} there",
                )


def _none_has(condition: Condition, effect: ValueEffect) -> str:
    """Return the class none of which has the value of an effect, if that is what a condition says."""
    match condition:
        case Witness(variable, kind, (ValueCondition(situation, (about,), value, False),), True):
            same = (situation, about, value) == (effect.situation, variable, effect.value)
            return kind if same and value.startswith("?") else ""
        case _:
            return ""


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


def definitions_without_effect(case: Case) -> Iterator[Fault]:
    """Find what OWL says of situations and planning doesn't evaluate, and facts stated of what is defined."""
    if case.reading is None:
        return
    schema, names, rules = case.reading.schema, case.reading.names, case.reading.problem.domain.rules
    of = {
        prop: iri
        for iri in schema.of_kind("SituationType")
        for prop in schema.nodes[iri].get(CORE + "valueProperty", ())
    }
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
            said, prop = f"{local_name(named)} is below {local_name(other)}", other
        elif named in of and other in of and predicate == OWL + "inverseOf":
            said, prop = f"{local_name(named)} is the inverse of {local_name(other)}", named
            if names.short(of[other]) in rules:
                continue
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
                "what is defined follows from other facts, in every state; what is stated of it isn't read",
                "state what it follows from, or drop the fact",
            )
        beyond = predicate if predicate in NOT_EVALUATED else other if predicate == RDF + "type" else ""
        if beyond in NOT_EVALUATED:
            yield (
                named or "the ontology",
                f"{NOT_EVALUATED[beyond]} ({local_name(beyond)}) are nothing that planning evaluates",
                "individuals are told apart by their names, and what isn't stated is false",
                "say it in a rule or in the scene's facts, or drop it",
            )


def _unevaluated(schema: Schema, situation: str, prop: str, changed: Set[str], said: str) -> Fault | None:
    """Return why an axiom about a value property is none that planning evaluates, unless the effects are at fault."""
    name, what = local_name(prop), f"that {said} isn't evaluated, since "
    nodes = {**schema.axioms, **schema.expressions}
    into = any(
        prop in node.get(by, ())
        for node in nodes.values()
        for by in (RDFS + "subPropertyOf", OWL + "equivalentProperty")
    )
    into = into or any(nodes.get(prop, {}).get(OWL + by) for by in ("propertyChainAxiom", "equivalentProperty"))
    if situation in changed and not into:
        what += f"behaviours change {local_name(situation)}"
        why = "only what no behaviour changes is defined by axioms; planning takes no notice of this one"
        return (
            situation,
            what,
            why,
            "let behaviours change another property, which follows into this one, or drop the axiom",
        )
    if situation not in schema.pairs:
        what += f"{name} is functional"
        why = "what is defined is true or false for each pair; a functional value property gives one value"
        return situation, what, why, f"drop owl:FunctionalProperty of {name}, or drop the axiom"
    if situation in changed:
        return None  # `effect-on-definition` says it where the effect is
    what += f"no property leads into {name}"
    why = "planning works out what follows from what behaviours change or what is static"
    mend = f"make a property that behaviours change, or a static one, rdfs:subPropertyOf {name}; or drop the axiom"
    return situation, what, why, mend


def defined(case: Case) -> Iterator[Fault]:
    """Tell of each situation type that is defined whether it is worked out in every state, and from what, or is static."""
    if case.reading is None:
        return
    domain, names = case.reading.problem.domain, case.reading.names
    changed = frozenset[str]().union(*(behavior.changes for behavior in domain.behaviors.values()))
    reads = {name: {s for rule in its for s, _ in needed(rule.conditions)} for name, its in domain.rules.items()}
    for name in domain.rules:
        below, waiting = {name}, [name]
        while waiting:
            waiting += (more := reads.get(waiting.pop(), set()) - below)
            below |= more
        if below & changed:
            what = f"{name} is derived: in every state it follows from {' and '.join(sorted(reads[name] - {name}))}"
            why = "planning works it out anew after each step, as its definition says; no behaviour changes it"
            yield names.iri(name), what, why, "nothing"
        else:
            what = f"{name} is static: no behaviour changes what it follows from"
            why = "it is the same in every state"
            yield names.iri(name), what, why, "nothing, if it is meant; else define it by what behaviours change"


def conclusions_about_nobody(case: Case) -> Iterator[Fault]:
    """Find rules that conclude something of who can't have it, as where the arguments of a conclusion have changed places."""
    if case.reading is None:
        return
    domain, names = case.reading.problem.domain, case.reading.names
    for name, rules in domain.rules.items():
        for rule in rules:
            for parameter, wanted in zip(rule.parameters, domain.situations[name].arguments, strict=True):
                of = next((kind for kind in _asked(rule, parameter, domain) if not _both(case, kind, wanted)), None)
                if of is not None:
                    said = ", ".join(p.name.removeprefix("?") for p in rule.parameters)
                    yield (
                        names.iri(name),
                        f"a rule concludes {name}({said}), where {parameter.name.removeprefix('?')} has to be a "
                        f"{wanted.replace('|', ' or ')}; its conditions make it a {of.replace('|', ' or ')}, and nothing is both",
                        "the rule never concludes anything",
                        "mend the rule: the arguments of its conclusion may have changed places, or a class or property in its "
                        f"conditions may be another; or say that a {of.split('|')[0]} has {name}, too",
                    )


def _asked(rule: Rule, parameter: Parameter, domain: Domain) -> Iterator[str]:
    """Yield the classes of which the conditions of a rule ask that a parameter is."""
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


def _both(case: Case, one: str, other: str) -> bool:
    """Whether something is in both of two classes, each of which may be any of several, or could be: a class is below both."""
    assert case.reading is not None
    problem = case.reading.problem
    if {*problem.classes.get(one, ())} & {*problem.classes.get(other, ())}:
        return True
    below = []
    for kinds in (one.split("|"), other.split("|")):
        found = {*kinds}
        while more := {sub for sub, above in problem.parents.items() if not found.isdisjoint(above)} - found:
            found |= more
        below.append(found)
    return not below[0].isdisjoint(below[1])


WATCHED_BY_NOBODY = {
    OWL + "InverseFunctionalProperty": "leads to no two from one",
    OWL + "AsymmetricProperty": "never leads both ways",
    OWL + "IrreflexiveProperty": "leads from nothing to itself",
}


def axioms_not_watched(case: Case) -> Iterator[Fault]:
    """Find what OWL demands of every state, and what it concludes of a class without a definition: planning does neither."""
    if case.reading is None:
        return
    known = case.reading.schema.expressions
    of = {prop for node in case.reading.schema.nodes.values() for prop in node.get(CORE + "valueProperty", ())}
    definitions = Definitions(known, dict.fromkeys(of, ("", True)), case.reading.names)
    inside: dict[object, list[ox.Triple]] = defaultdict(list)
    for triple in case.triples:
        inside[triple.subject].append(triple)
    why = "behaviours change it, and what comes of that isn't checked against this axiom"
    mend = "say it as a precondition of the behaviours that could break it, or drop the axiom"
    for triple in case.triples:
        subject, predicate, value = triple.subject, triple.predicate.value, triple.object
        named = subject.value if isinstance(subject, ox.NamedNode) else ""
        other = value.value if isinstance(value, ox.NamedNode) else ""
        if named in of and predicate == RDF + "type" and other in WATCHED_BY_NOBODY:
            yield named, f"that {local_name(named)} {WATCHED_BY_NOBODY[other]} isn't watched in a plan", why, mend
        if named in of and predicate == OWL + "propertyDisjointWith":
            said = f"that {local_name(named)} and {local_name(other)} never lead to the same isn't watched in a plan"
            yield named, said, why, mend
        if predicate != RDFS + "subClassOf":
            continue
        if not other and _properties_in(value, inside) & of:
            yield (
                named,
                f"what each {local_name(named)} is said to be in every state isn't watched in a plan",
                why,
                mend,
            )
        elif not named and other and _properties_in(subject, inside) & of:
            yield (
                other,
                f"an expression is said to be below {local_name(other)}, which planning doesn't conclude from",
                "a class has whom its definition has, and who is stated",
                f"define {local_name(other)} by owl:equivalentClass, or conclude it by a SWRL rule",
            )
        elif named and other and definitions.changes(named) and other not in _above(case, named):
            yield (
                named,
                f"each {local_name(named)} is said to be a {local_name(other)}, which planning doesn't conclude",
                "a class has whom its definition has, and who is stated",
                f"name {local_name(other)} in the definition of {local_name(named)}, or define it as a union with that",
            )


def _properties_in(node: object, inside: Mapping[object, Sequence[ox.Triple]]) -> set[str]:
    """Return the properties that a class expression speaks of."""
    found, waiting, seen = set[str](), [node], set[object]()
    while waiting:
        if not isinstance(one := waiting.pop(), ox.BlankNode) or one in seen:
            continue
        seen.add(one)
        for triple in inside.get(one, ()):
            waiting.append(triple.object)
            if triple.predicate.value == OWL + "onProperty" and isinstance(triple.object, ox.NamedNode):
                found.add(triple.object.value)
    return found


def _above(case: Case, iri: str) -> set[str]:
    """Return the classes that a definition names as its parts, with all above these."""
    assert case.reading is not None
    schema, found = case.reading.schema, {OWL + "Thing"}
    waiting = [iri]
    while waiting:
        for node in schema.expressions.get(waiting.pop(), {}).get(OWL + "equivalentClass", ()):
            parts = [node, *_items(schema.expressions, node)]
            for part in (part for part in parts if ":" in part and part not in found):
                found.add(part)
                waiting.append(part)
    above = list(found)
    while above:
        for kind in schema.supers.get(above.pop(), ()):
            if kind not in found:
                found.add(kind)
                above.append(kind)
    return found


def _items(expressions: Mapping[str, Node], node: str) -> Iterator[str]:
    """Yield the members of an intersection."""
    cells, seen = list(expressions.get(node, {}).get(OWL + "intersectionOf", ())), set[str]()
    while cells:
        cell = cells.pop()
        if cell in expressions and cell not in seen:
            seen.add(cell)
            yield from expressions[cell].get(RDF + "first", ())
            cells += expressions[cell].get(RDF + "rest", ())


def unlike_units(case: Case) -> Iterator[Fault]:
    """Find amounts of different units that are compared, added, or assigned to one another."""
    if case.reading is None:
        return
    reading = case.reading
    units = {name: s.quantity.unit for name, s in reading.problem.domain.situations.items() if s.quantity}
    relations = {
        reading.names.short(iri): node.get(CORE + "unit", [""])[0] for iri, node in reading.schema.nodes.items()
    }

    def unit(expression: Expression) -> tuple[str, str]:
        """Return the unit of an amount, none if it has none or could have any, and two that don't go together."""
        match expression:
            case Amount(situation):
                return units.get(situation, ""), ""
            case Measure(relation):
                return relations.get(relation, ""), ""
            case Calculation(sign, left, right):
                (one, wrong), (other, also) = unit(left), unit(right)
                if sign in "+-" and one and other and one != other:
                    return one, f"{one} and {other}"
                if sign in "*/" and one and other:
                    return "", wrong or also  # servings by the hour
                return one or (other if sign != "/" else ""), wrong or also
            case Fraction():
                return "", ""

    for name, behavior in reading.problem.domain.behaviors.items():
        for left, right, does in _together(behavior):
            (one, wrong), (other, also) = unit(left), unit(right)
            both = wrong or also or (f"{one} and {other}" if one and other and one != other else "")
            if both:
                about = " and ".join(sorted(situations_in(left) | situations_in(right)))
                yield (
                    reading.names.iri(name),
                    f"{name} {does} {both} ({about})",
                    "a number of one unit says nothing of an amount of another",
                    "name amounts of one unit, mend a :unit, or multiply by a number that leads from one unit to the other",
                )


def _together(behavior: Behavior) -> Iterator[tuple[Expression, Expression, str]]:
    """Yield the pairs of amounts that a behaviour compares, or changes one by the other, and which of that it does."""
    for one in (inner for condition in behavior.conditions for inner in walk(condition)):
        if isinstance(one, Comparison):
            yield one.left, one.right, "compares"
    for effect in behavior.amounts:
        by: Expression = effect.amount
        if effect.operation == "scale":  # by a number without a unit
            by = Calculation("*", Amount(effect.situation, effect.arguments), effect.amount)
        yield Amount(effect.situation, effect.arguments), by, f"{effect.operation}s"


def multiplied_amounts(case: Case) -> Iterator[Fault]:
    """Find amounts that change and are multiplied, or divided by: a whole level isn't searched with such a calculation."""
    if case.reading is None:
        return
    domain, names = case.reading.problem.domain, case.reading.names
    changed = {effect.situation for behavior in domain.behaviors.values() for effect in behavior.amounts}
    rules = [(name, rule.behavior) for name, its in domain.rules.items() for rule in its]
    for name, behavior in (*domain.behaviors.items(), *rules):
        found = dict[tuple[str, str, str], None]()
        for left, right, does in _together(behavior):
            for part in (*inside(left), *(() if does == "scales" else inside(right))):
                if isinstance(part, Calculation) and part.operator in "*/":
                    one, other = (sorted(situations_in(side) & changed) for side in (part.left, part.right))
                    if other and (one or part.operator == "/"):
                        found[part.operator, " and ".join(one), " and ".join(other)] = None
        for sign, first, second in found:
            does = f"multiplies {first} by {second}" if sign == "*" else f"divides by {second}"
            yield (
                names.iri(name),
                f"{name} {does}, {'both of which' if first and sign == '*' else 'which'} behaviors change",
                "where a whole level is searched, as in a world of one level or for the cheapest plan, that is refused",
                "multiply by a relation's number or a constant, which never changes, or add and subtract instead",
            )


def numbers_missing(case: Case) -> Iterator[Fault]:
    """Find individuals without a number that a behaviour reads of their class: nothing can be done with them."""
    if case.reading is None:
        return
    problem, names = case.reading.problem, case.reading.names
    lacking: dict[tuple[str, str], dict[str, set[str]]] = defaultdict(lambda: defaultdict(set))
    for behavior in problem.domain.behaviors.values():
        among = {term: (kind, frozenset(problem.classes.get(kind, ()))) for term, kind in behavior.kinds.items()}
        read = [*_measured(behavior.preconditions, among, problem)]
        for effect in behavior.amounts:
            conditions = (*behavior.preconditions, *effect.when, Comparison(effect.amount, "=", effect.amount))
            read += _measured(conditions, among, problem)
        for relation, kind, individuals in read:
            stated = {row[0] for row in problem.relations.get(relation, ())}
            for one in individuals - stated:
                lacking[relation, kind][one].add(behavior.name)
    for (relation, kind), found in sorted(lacking.items()):
        who = sorted(found)
        some = ", ".join(who[:5]) + (", …" if len(who) > 5 else "")
        readers = " and ".join(sorted(set().union(*found.values())))
        has = "have" if len(who) > 1 else "has"
        yield (
            names.iri(who[0]),
            f"{some} {has} no {relation}, which {readers} read{'' if ' and ' in readers else 's'} of each {kind}",
            "what isn't stated compares with nothing, so that no such behaviour can be done with it",
            f"state {relation} of {some}, or give it to another class than {kind}",
        )


def _measured(
    conditions: Sequence[Condition], among: Mapping[str, tuple[str, frozenset[str]]], problem: Problem
) -> Iterator[tuple[str, str, frozenset[str]]]:
    """Yield each relation that gives a number of one term, with the term's class and the individuals that it can stand for."""
    among = dict(among)
    for condition in conditions:
        if isinstance(condition, ClassCondition) and not condition.negated and condition.term in among:
            individuals = among[condition.term][1] & frozenset(problem.classes.get(condition.kind, ()))
            among[condition.term] = condition.kind, individuals
    for condition in conditions:
        match condition:
            case Comparison(left, _, right):
                for part in (*inside(left), *inside(right)):
                    if isinstance(part, Measure) and len(part.arguments) == 1 and part.arguments[0] in among:
                        yield part.relation, *among[part.arguments[0]]
            case Witness(variable, kind):
                members = kind, frozenset(problem.classes.get(kind, ()))
                for group in groups(condition):
                    yield from _measured(group, {**among, variable: members}, problem)
            case _:
                for group in groups(condition):
                    yield from _measured(group, among, problem)


RULES: dict[str, Callable[[Case], Iterator[Fault]]] = {
    "undeclared-term": undeclared_terms,
    "missing-all-different": individuals_not_different,
    "file-name-and-iri": files_and_iris,
    "undetermined-variable": undetermined_variables,
    "other-kind": other_kinds_in_when,
    "unreachable": unreachable_behaviors,
    "value-gap": gaps_of_values,
    "crowded": crowded_places,
    "definition-without-effect": definitions_without_effect,
    "axiom-not-watched": axioms_not_watched,
    "unit-mismatch": unlike_units,
    "product-of-amounts": multiplied_amounts,
    "conclusion-outside-class": conclusions_about_nobody,
    "number-missing": numbers_missing,
    "defined": defined,
}
WARNINGS = frozenset({"axiom-not-watched", "crowded", "number-missing", "other-kind", "product-of-amounts"})
"""Rules of what can be planned with all the same."""
REMARKS = frozenset({"defined"})
"""Rules that tell of what isn't wrong."""

"""Validation rules on names: undeclared terms, individuals that may be identical, and names of files."""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Iterator, Mapping
from itertools import combinations
from pathlib import Path
from urllib.parse import unquote

import pyoxigraph as ox

from confab import ontology
from confab.reasoner.graph.knowledge import SCENE, text
from confab.reasoner.names import local_name, nearest
from confab.reasoner.reading.goals import some_of
from confab.reasoner.reading.swrl import SWRL
from confab.reasoner.validation.case import Case, Fault
from confab.reasoner.vocabulary import CORE, MEMORY, OWL, RDF, RDFS, XSD

BUILT_IN = (OWL, RDF, RDFS, XSD, SWRL, SWRL.replace("swrl#", "swrlb#"), MEMORY)
ATOMS = (SWRL + "argument1", SWRL + "argument2")
OF_A_RULE = "a variable or an individual of a SWRL rule"
OF_CLASSES = {RDF + "type", RDFS + "subClassOf", SWRL + "classPredicate"}
OF_CLASSES |= {
    OWL + name
    for name in ("disjointWith", "equivalentClass", "complementOf", "someValuesFrom", "allValuesFrom", "onClass")
}
OF_PROPERTIES = {OWL + "onProperty", RDFS + "subPropertyOf", OWL + "inverseOf", SWRL + "propertyPredicate"}
PROPERTIES = {OWL + kind for kind in ("ObjectProperty", "DatatypeProperty", "AnnotationProperty")}


def undeclared_terms(case: Case) -> Iterator[Fault]:
    """Find undeclared properties and classes, and individuals without a type."""
    seen, shipped = set(), ontology.shipped()
    for subject, iri, wanted, kinds in _undeclared(case):
        if iri in seen:
            continue
        seen.add(iri)
        name, home = local_name(iri), iri.partition("#")[0]
        known = {other: local_name(other) for other, types in case.types.items() if not kinds or kinds & types}
        elsewhere = sorted(other for other, called in known.items() if called == name and other != iri)
        hint = f"; did you mean <{elsewhere[0]}>?" if elsewhere else nearest(name, [*known.values()])
        yield (
            subject.value if isinstance(subject, ox.NamedNode) else iri,
            f"{name} is used as {wanted}, but isn't declared as one{hint}",
            "an unknown name is read as a new one without a warning, and the intended statement is lost",
            f"import <{home}>, which no file imports"
            if home in shipped and home not in case.types
            else f"correct the name, or declare <{iri}>{' a swrl:Variable' if wanted is OF_A_RULE else ''}",
        )


def relative_iris(case: Case) -> Iterator[Fault]:
    """Find relative IRIs, whose meaning depends on the folder of the file."""
    for node in sorted(case.relative):
        name = local_name(node)
        yield (
            node,
            f"{name} is written as a relative IRI",
            f"it is read as <{node}>, and the name changes when the file is moved",
            f"write it with a prefix, like :{name}, or write the whole IRI",
        )


def _undeclared(case: Case) -> Iterator[tuple[object, str, str, set[str]]]:
    """Yield each use of an undeclared term: the subject, the term, and the expected kind of term, in words and as classes."""
    for triple in case.triples:
        for iri, wanted, kinds in _uses(triple, case.types.get(triple.predicate.value, set())):
            types = case.types.get(iri, set())
            if not iri.startswith((*BUILT_IN, "file:")) and not (kinds & types if kinds else types):
                yield triple.subject, iri, wanted, kinds


def with_undeclared(case: Case) -> set[str]:
    """Return the nodes that mention undeclared terms directly."""
    return {subject.value for subject, *_ in _undeclared(case) if isinstance(subject, ox.NamedNode)}


def misread(case: Case) -> set[str]:
    """Return the nodes that mention undeclared terms, relative IRIs or owl:Thing, directly or through another node."""
    first = with_undeclared(case) | case.relative
    first |= {
        triple.subject.value
        for triple in case.triples
        if triple.predicate.value == CORE + "termType" and triple.object == ox.NamedNode(OWL + "Thing")
        if isinstance(triple.subject, ox.NamedNode)
    }
    return first | {
        triple.subject.value
        for triple in case.triples
        if isinstance(triple.object, ox.NamedNode)
        and isinstance(triple.subject, ox.NamedNode)
        and triple.object.value in first
    }


def _uses(triple: ox.Triple, kinds_of_predicate: set[str]) -> Iterator[tuple[str, str, set[str]]]:
    """Yield each IRI in a triple with the kind of term that is expected in its place."""
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
    """Find individuals of one class that aren't declared to be different."""
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
        names = some_of([local_name(iri) for iri in missing], 5)
        yield (
            missing[0] if missing else min(individuals),
            f"no statement says that {names} and the other individuals of {local_name(kind)} are different",
            "in OWL, two names can denote one individual: a reasoner would merge two values of a functional property",
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
    """Find files whose name differs from the last part of their ontology's IRI, and catalog entries that lead to another file."""
    read: dict[Path, Mapping[str, Path]] = {}
    for iri, file in case.graph.files.items():
        wanted = unquote(local_name(iri))
        if file.stem != wanted:
            yield (
                iri,
                f"the file is called {file.name}, but its ontology is called {wanted}",
                "imports are found by file name, unless a catalog maps them",
                f"rename the file to {wanted}{file.suffix}, or the ontology to …/{file.stem}",
            )
        for catalog in {file.with_name(ontology.CATALOG), ontology.ROOT / ontology.CATALOG}:
            if catalog not in read:
                read[catalog] = ontology.catalog(catalog) if catalog.is_file() else {}
            if (entry := read[catalog].get(iri)) and not _same(entry, file):
                yield (
                    iri,
                    f"according to {catalog}, <{iri}> is in {entry}, not in this file",
                    "Protégé would open the other file",
                    "correct the entry of the catalog",
                )


def _same(one: Path, other: Path) -> bool:
    return os.path.realpath(one) == os.path.realpath(other)

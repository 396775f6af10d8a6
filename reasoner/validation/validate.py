"""Validation of ontologies during their development, with the position, cause and remedy of each fault.

==================  ========================================================================
checked property    location of the checks
==================  ========================================================================
form                SHACL shapes, `ontology/shapes/*.ttl`
violations          SPARQL queries that must have no rows, `ontology/checks/*.rq`
rules in Python     `confab.reasoner.validation.rules`
measures of bodies  `confab.reasoner.embodiment.measures.RULES`, if the scene has a robot
joints, features    `confab.reasoner.embodiment.joint_checks.RULES`, if the scene has a robot
skills in phases    `confab.reasoner.embodiment.skill_checks.RULES`, if the scene has a robot
overlapping solids  `confab.reasoner.embodiment.solid_checks`, if the scene has a robot
logic (`deep`)      HermiT: consistency, empty classes, unsatisfiable preconditions
==================  ========================================================================
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import pyoxigraph as ox

from confab import ontology
from confab.reasoner.closure import closure
from confab.reasoner.embodiment import joint_checks, measures, skill_checks, solid_checks
from confab.reasoner.embodiment.facts import EmbodimentError
from confab.reasoner.embodiment.reading import read_embodiment
from confab.reasoner.files import silent_about_numbers
from confab.reasoner.graph.inference import infer
from confab.reasoner.graph.knowledge import BASE, GRAPHS, KnowledgeError, KnowledgeGraph, load, scene_file, text
from confab.reasoner.memory.experience_file import parse
from confab.reasoner.memory.links_file import memory_lines
from confab.reasoner.names import local_name
from confab.reasoner.reading.problem import read
from confab.reasoner.updates.compiling import UpdateFault
from confab.reasoner.validation.case import Case, ReadCase
from confab.reasoner.validation.contradictions import impossible_situations
from confab.reasoner.validation.findings import ERROR, REMARK, WARNING, Finding, Places, fill, unique
from confab.reasoner.validation.rules import REMARKS, RULES, RULES_ON_PROBLEMS, WARNINGS
from confab.reasoner.validation.terms import misread, with_undeclared
from confab.reasoner.vocabulary import CORE, EMBODIMENT, PREFIXES, RDF, SHACL

if TYPE_CHECKING:
    import rdflib

CONSEQUENCES = {
    "fact-without-situation-type",
    "fact-outside-range",
    "goal-without-situation-type",
    "value-outside-range",
    "effect-without-situation-type",
    "condition-without-situation-type",
    "term-type-is-no-class",
    "term-type-is-no-individual",
    "object-without-shape",
    "relation-outside-domain",
    "relation-outside-range",
    "pair-outside-class",
    "tuple-outside-class",
    "not-a-named-individual",
}
"""Rules that are skipped for nodes that mention an undeclared term or owl:Thing, because the faults may be its consequences."""
SAID_BETTER = {"effect-without-situation-type": "effect-on-definition"}
"""A mapping of a check to a more precise check. The first check skips each node about which the second check has a finding."""
WRONG_FACTS = {"fact-outside-range", "fact-outside-domain", "fact-without-situation-type", "clashing-values"}
WRONG_FACTS |= {"amount-out-of-bounds", "no-value"}
"""Checks whose findings are about initial facts or bounds, like the findings of ``impossible-situation``."""
FROM_FACTS = {"unreachable", "amount-out-of-reach"}
"""Rules that depend on the initial state; these rules are skipped if the initial facts are faulty."""
NEEDS_ALL_BEHAVIORS = {"changed-below-only", "level-gap", "rest-value-out-of-reach", "no-value"}
"""Rules that are skipped if the text of a behaviour or rule can't be compiled."""

MEASURES = measures.RULES | joint_checks.RULES | skill_checks.RULES | solid_checks.RULES
"""Rules on a scene's robots and bodies."""

STAGES = 4
"""Number of stages of the validation of a file without HermiT."""
QUICK = 100_000
"""Maximum number of triples of a graph that is checked for errors during planning."""
ROBOTS = f"""PREFIX e: <{EMBODIMENT}>
SELECT ?robot WHERE {{ ?robot e:urdf ?file . FILTER NOT EXISTS {{ ?ontology :symbolicOnly true }} }}"""
SPOKEN_OF = (CORE, *(PREFIXES[prefix] for prefix in ("rdf", "rdfs", "owl", "skos")))
"""Namespaces of the properties that the shapes check; the many facts of a scene have properties in other namespaces."""
LISTS = (RDF + "first", RDF + "rest")


def validate(
    files: Sequence[str | Path], *, deep: bool = False, done: Callable[[str], object] | None = None
) -> list[Finding]:
    """Return the findings in ontology files and their imports.

    Parameters
    ----------
    files : sequence of str or Path
        Paths of files, or names of shipped scenes. Each file is checked together with its imports.
    deep : bool
        Whether to run HermiT, too, which needs Java.
    done : callable, optional
        Function that is called with a description at the beginning of each stage: `STAGES` times per file, and once more if
        `deep`.

    Returns
    -------
    list of Finding
        The findings, sorted by file and line; findings on undeclared terms come first. The list is empty if there are no faults.
        Findings that aren't `serious` are warnings or remarks.

    Raises
    ------
    KnowledgeError
        A file doesn't exist.
    confab.reasoner.validation.hermit.NoJavaError
        `deep` is set and no Java was found; the message states how to install it.
    """
    return unique(finding for file in files for finding in _validate_one(file, deep, done or (lambda _: None)))


def quick_errors(graph: KnowledgeGraph) -> list[Finding]:
    """Return the errors that can be found quickly, without shapes, bodies and HermiT, in a graph with inferred facts.

    Return no errors for a graph with more than `QUICK` triples.
    """
    if len(graph.store) > QUICK:
        return []
    places = Places(graph)
    found = [finding for finding in _violations(graph, places) if finding.serious]
    case, problem = _read(graph)
    if problem and not found:
        found += _unread(case, places, problem)
    sure = [*_sure(found, case)]
    return unique(finding for finding in (*sure, *_by_rules(case, places, sure)) if finding.serious)


def _sure(found: Sequence[Finding], case: Case) -> Iterator[Finding]:
    """Yield findings, except those that may be consequences of an undeclared term."""
    unsure = misread(case)
    yield from (finding for finding in found if finding.rule not in CONSEQUENCES or finding.node not in unsure)


def _by_rules(case: Case, places: Places, found: Sequence[Finding]) -> Iterator[Finding]:
    """Yield the findings of the rules in Python, except those that may be consequences of faulty initial facts."""
    rules = [(rule, faults(case)) for rule, faults in RULES.items()]
    if isinstance(case, ReadCase):
        wrong_facts = any(finding.rule in WRONG_FACTS for finding in found) or any(impossible_situations(case))
        skipped = FROM_FACTS if wrong_facts else set()
        rules += [(rule, faults(case)) for rule, faults in RULES_ON_PROBLEMS.items() if rule not in skipped]
    for rule, faults in rules:
        for node, what, why, remedy in faults:
            severity = WARNING if rule in WARNINGS else REMARK if rule in REMARKS else ERROR
            yield places.finding(rule, node, what, why, remedy, severity)


def _validate_one(file: str | Path, deep: bool, done: Callable[[str], object]) -> Iterator[Finding]:
    path = scene_file(file)
    done(f"reading {path.name}")
    faults: list[UpdateFault] = []
    try:
        graph = load(path, faults=faults)
    except KnowledgeError as error:
        why = "nothing else can be checked before this is corrected"
        said = str(error).removeprefix(f"{path}: ")
        yield Finding(str(path), 0, "", "", "unreadable", said, why, "see the message")
        return
    places = Places(graph)
    if graph.select("SELECT ?memory { ?memory :memoryFormat ?format }"):
        yield from _in_memory(path, graph, places)
        return
    for fault in faults:
        readers = "a behaviour whose update can't be read has no effect"
        why = readers if fault.place.form == "update" else "a rule whose query can't be read defines nothing"
        yield places.in_update("update", fault.place, fault.what, why, fault.remedy)
    done(f"checking {path.name}")
    yield from _merged(graph, places)
    found = [*_violations(graph, places)]
    done(f"checking the shapes of {path.name}")
    found += _ill_formed(graph, places)
    done(f"reading {path.name} as the planner does")
    case, problem = _read(graph)
    unread = _extending(graph, {fault.place.behavior for fault in faults})
    if faults:
        found = [f for f in found if f.node not in unread and f.rule not in NEEDS_ALL_BEHAVIORS]
    found = [*_sure(found, case)]
    yield from found
    if faults:
        parts = tuple(f"<{behavior}." for behavior in unread)  # the parameters in a faulty update are unknown
        undeclared = (finding for finding in _by_rules(case, places, found) if finding.rule == "undeclared-term")
        yield from (finding for finding in undeclared if not any(part in finding.remedy for part in parts))
        return
    if problem and not any(finding.serious for finding in found):
        yield from _unread(case, places, problem)
    if not any(finding.serious for finding in found):
        yield from _measured(case, places)
    yield from _by_rules(case, places, found)
    if deep:
        done(f"asking HermiT about {path.name}")
        from confab.reasoner.validation.hermit import faults as deep_faults

        for rule, node, what, why, remedy in deep_faults(graph):
            yield places.finding(rule, node, what, why, remedy)


def _in_memory(path: Path, graph: KnowledgeGraph, places: Places) -> Iterator[Finding]:
    """Yield the findings in a memory file: undeclared terms, wrong forms, and parts that planning can't read."""
    case = Case(graph)
    found = [places.finding("undeclared-term", *fault) for fault in RULES["undeclared-term"](case)]
    found += _sure([*_violations(graph, places), *_ill_formed(graph, places)], case)
    yield from found
    try:
        parse(memory_lines(path), str(path))
    except KnowledgeError as error:
        if not found:
            why = "planning continues without the memory"
            yield Finding(
                str(path), 0, "", "", "unreadable", str(error).removeprefix(f"{path}: "), why, "see the message"
            )


def _extending(graph: KnowledgeGraph, behaviors: set[str]) -> set[str]:
    """Return the given behaviours and all behaviours that extend them, directly or indirectly."""
    pairs = [(text(one), text(other)) for one, other in graph.select("SELECT ?one ?other { ?one :extends ?other }")]
    return closure(behaviors, lambda extended: (one for one, other in pairs if other == extended))


def _merged(graph: KnowledgeGraph, places: Places) -> Iterator[Finding]:
    """Add the inferences of OWL 2 RL to the graph; yield a finding if the inferences identify two individuals."""
    try:
        infer(graph)
    except KnowledgeError as error:
        why = "a reasoner would conclude that facts about one individual hold for the other"
        yield places.finding("merged-individuals", graph.scene, str(error), why, "drop one of the facts")


def _measured(case: Case, places: Places) -> Iterator[Finding]:
    """Yield the findings on robots and bodies if the scene has a robot."""
    if not isinstance(case, ReadCase) or not case.graph.select(ROBOTS):
        return
    try:
        embodiment = read_embodiment(case.graph.store, case.names.short, case.graph.folders)
    except EmbodimentError as error:
        why = "physics reads the file in the same way"
        yield places.finding("unreadable-body", error.node or case.graph.scene, str(error), why, "see the message")
        return
    flaws = {rule: faults(embodiment) for rule, faults in MEASURES.items()}
    flaws |= {rule: faults(embodiment, case.problem.initial) for rule, faults in solid_checks.FIRST_RULES.items()}
    for rule, found in flaws.items():
        for name, what, why, remedy in found:
            yield places.finding(rule, name if "://" in name else case.names.iri(name), what, why, remedy)


def _read(graph: KnowledgeGraph) -> tuple[Case, KnowledgeError | None]:
    """Return the case of a graph; if its planning problem can't be read, return the error, too."""
    try:
        return ReadCase(graph, read(graph)), None
    except KnowledgeError as error:
        return Case(graph), error
    except (KeyError, ValueError) as error:
        return Case(graph), KnowledgeError(f"{type(error).__name__}: {error}")


def _unread(case: Case, places: Places, problem: KnowledgeError) -> Iterator[Finding]:
    """Yield a finding about an unreadable file, unless the fault is about a node with an undeclared term, which is a finding."""
    finding = _unreadable(case.graph, places, problem)
    if finding.node not in with_undeclared(case):
        yield finding


def _unreadable(graph: KnowledgeGraph, places: Places, problem: KnowledgeError) -> Finding:
    """Return a finding with the error message about an unreadable file, at the node that the message mentions."""
    why, said = "the planner reads the file in the same way", str(problem)
    if problem.rule == "violated-constraint":
        why = "constraints hold in every state, from the first one on"
    named = [problem.node, *re.findall(r"<([^<>\s]+:[^<>\s]+)>", said)]
    what, mark, remedy = said.rpartition("; ")
    for node in filter(None, named):
        if next(graph.store.quads_for_pattern(ox.NamedNode(node), None, None, None), None) is not None:
            return places.finding(
                problem.rule, node, what if mark else said, why, remedy if mark else "see the message"
            )
    return Finding(
        str(graph.path), 0, graph.scene, places.label(graph.scene), problem.rule, said, why, "see the message"
    )


# ------------------------------------------------------------------------------------------------------------- violations


@dataclass(frozen=True)
class EmptyQuery:
    """A query whose result must be empty, and templates of the sentences that describe a row of the result."""

    rule: str
    what: str
    why: str
    remedy: str
    severity: str
    query: str


@cache
def checks(folder: Path = ontology.ROOT / "checks") -> tuple[EmptyQuery, ...]:
    """Return the checks in a folder; ``# What:``, ``# Why:``, ``# Do:`` and optionally ``# Severity:`` begin each file."""
    found = []
    for path in sorted(folder.glob("*.rq")):
        text = path.read_text(encoding="utf-8")
        head = dict(line[2:].split(": ", 1) for line in text.splitlines() if line.startswith("# ") and ": " in line)
        severity = head.get("Severity", ERROR)
        found.append(EmptyQuery(path.stem, head["What"], head["Why"], head["Do"], severity, text))
    return tuple(found)


def _violations(graph: KnowledgeGraph, places: Places) -> Iterator[Finding]:
    said: dict[str, set[str]] = defaultdict(set)
    for check in sorted(checks(), key=lambda check: check.rule in SAID_BETTER):
        answer = graph.query(check.query, GRAPHS)
        assert isinstance(answer, ox.QuerySolutions)
        names = [variable.value for variable in answer.variables]
        for row in answer:
            words = {name: _word(term) for name, term in zip(names, row, strict=True)}
            node = row["node"].value if isinstance(row["node"], ox.NamedNode) else ""
            if node in said[SAID_BETTER.get(check.rule, "")]:
                continue
            said[check.rule].add(node)
            yield places.finding(
                check.rule,
                node,
                fill(check.what, words),
                fill(check.why, words),
                fill(check.remedy, words),
                check.severity,
            )


def _word(term: object) -> str:
    if isinstance(term, ox.NamedNode):
        return local_name(term.value)
    return str(term.value) if isinstance(term, ox.Literal) else "(without a name)"


# ------------------------------------------------------------------------------------------------------------------ shapes


def _ill_formed(graph: KnowledgeGraph, places: Places) -> Iterator[Finding]:
    """Yield the findings of pySHACL. The sentences of a finding are annotations of the violated shape."""
    from pyshacl import validate as shacl
    from rdflib import BNode, Graph, Namespace
    from rdflib.namespace import RDFS

    from confab.reasoner.graph.rdflib_graph import rdflib_term

    sh = Namespace(SHACL)
    shapes = _shapes()
    data = Graph()
    with silent_about_numbers():  # invalid numbers, which the shapes report
        for quad in graph.store.quads_for_pattern(None, None, None, ox.NamedNode(BASE + "asserted")):
            if quad.predicate.value.startswith(SPOKEN_OF) and quad.predicate.value not in LISTS:
                data.add(tuple(map(rdflib_term, quad.triple)))  # type: ignore[arg-type]
        conforms, report, _ = shacl(data, shacl_graph=shapes, advanced=False, inference="none", do_owl_imports=False)
    if conforms or not isinstance(report, Graph):
        return
    for result in report.objects(None, sh.result):
        focus = report.value(result, sh.focusNode)
        source = report.value(result, sh.sourceConstraint) or report.value(result, sh.sourceShape)
        if isinstance(focus, BNode):  # a class expression needs no label
            continue
        message = _short(str(report.value(result, sh.resultMessage)))
        rule, why, remedy = (str(shapes.value(source, said) or "") for said in (sh.name, sh.description, RDFS.comment))
        severity = WARNING if report.value(result, sh.resultSeverity) == sh.Warning else ERROR
        yield places.finding(rule, str(focus), f"{local_name(str(focus))} {message}", why, remedy, severity)


@cache
def _shapes() -> rdflib.Graph:
    import rdflib

    shapes = rdflib.Graph()
    for path in sorted((ontology.ROOT / "shapes").glob("*.ttl")):
        shapes.parse(path)
    return shapes


def _short(text: str) -> str:
    """Return a text with local names instead of IRIs."""
    words = (
        local_name(word.strip("<>,")) + ("," if word.endswith(",") else "") if "://" in word else word
        for word in text.split(" ")
    )
    return " ".join(words)

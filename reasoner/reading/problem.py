"""Reading of planning problems from the knowledge graph.

A few large queries read the graph. The rows of the results become nodes (`confab.reasoner.reading.rows`). The nodes become
conditions, effects and behaviours (`confab.reasoner.reading.parts`) and goals (`confab.reasoner.reading.goals`) of a problem:

============================  ==============================================
in the ontology               in `confab.reasoner.symbols`
============================  ==============================================
``:SituationType``            `SituationType`
``:Behavior``                 `Behavior`, whose variables start with ``?``
``:AbsenceCondition``         a negated `Witness`
``x valueProperty v``         the value of a `Symbol` in `Problem.initial`
``:goal`` of the ``:Task``    `Problem.goal`
============================  ==============================================
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from confab.reasoner.aggregates.compiling import compiled
from confab.reasoner.aggregates.totals import exceptions, with_totals
from confab.reasoner.condition_nodes import NodeValues
from confab.reasoner.graph.knowledge import SCENE, KnowledgeError, KnowledgeGraph, text
from confab.reasoner.language import DomainError
from confab.reasoner.limits import check, checked
from confab.reasoner.names import Names, brief
from confab.reasoner.problem import Problem
from confab.reasoner.reading.facts import check_values, facts_of, initial_state
from confab.reasoner.reading.frame import Frame, frame, names_of
from confab.reasoner.reading.goals import with_task
from confab.reasoner.reading.rows import (
    HIGHEST_LEVEL,
    Member,
    OntologySchema,
    Triple,
    core_triple,
    index_of,
    nodes_of,
    stated,
)
from confab.reasoner.reading.schema import read_schema
from confab.reasoner.reading.times import with_times

MEMBERS = """
SELECT DISTINCT ?individual ?class ?index WHERE {
  ?individual a owl:NamedIndividual, ?class .
  FILTER(isIRI(?class) && !STRSTARTS(STR(?class), STR(owl:)))
  OPTIONAL { ?individual :index ?index }
}"""
FACTS = """
SELECT DISTINCT ?subject ?property ?object WHERE {
  { SELECT DISTINCT ?property {
      { ?situation :valueProperty ?property } UNION { ?property a/rdfs:subClassOf* :Relation }
      UNION { ?property a :SituationType } } }
  ?subject ?property ?object .
}"""
"""The query has an inner query, because a store would otherwise join its properties with all triples."""
TUPLES = """
SELECT DISTINCT ?fact ?property ?value WHERE {
  ?fact a :SituatedObjectInstance ; ?property ?value
}"""


@brief
@dataclass(frozen=True)
class Reading:
    """A scene as a planning problem, with the mapping from the problem's names to IRIs.

    `whole` states whether the problem contains all individuals of the scene, or only the individuals that the task can need
    (`confab.reasoner.reading.relevance`). `schema` contains the part of the ontology that is independent of individuals.
    """

    problem: Problem
    names: Names
    schema: OntologySchema
    whole: bool = True


def read(graph: KnowledgeGraph, schema: OntologySchema | None = None) -> Reading:
    """Return the planning problem of a knowledge graph, with all of its individuals.

    Parameters
    ----------
    graph : KnowledgeGraph
    schema : OntologySchema, optional
        The result of `read_schema`, if this result is known already.

    Raises
    ------
    KnowledgeError
        The scene is invalid: for example, a symbol has no value or two values, or a condition lacks a part.
    """
    members = members_of(graph)
    schema = read_schema(graph) if schema is None else schema
    rows = [stated(row, schema.numbers) for row in graph.select(FACTS, SCENE)]
    types = {*schema.of_kind("SituationType")} - schema.value_properties.keys()
    facts = [row for row in rows if row[1] not in types]  # a situation type isn't a property
    tuples = nodes_of(core_triple(row) for row in graph.select(TUPLES, SCENE))
    known = frame(schema, members)
    check("reading the scene")
    return reading_of(graph.scene, known, facts, tuples)


def read_names(graph: KnowledgeGraph) -> Names:
    """Return the short names that `read` would give to the terms of a whole scene, without reading facts."""
    schema, members = read_schema(graph), members_of(graph)
    check("reading the scene")
    return names_of(schema, members)


def members_of(graph: KnowledgeGraph) -> list[Member]:
    """Return the individuals of a graph with their classes and indices."""
    rows = checked(graph.select(MEMBERS, SCENE), "reading the scene")
    return [(text(iri), text(kind), index_of(text(iri), text(index))) for iri, kind, index in rows]


def reading_of(
    scene: str, known: Frame, facts: Iterable[Triple], tuples: Mapping[str, NodeValues], whole: bool = True
) -> Reading:
    """Return the planning problem with the individuals of a frame.

    Parameters
    ----------
    scene : str
    known : Frame
    facts : triples of IRIs
        The facts that value properties and relations state about the individuals.
    tuples : mapping of IRI to node
        The facts that are stated as nodes.
    whole : bool
        Whether the frame contains all individuals of the scene.
    """
    schema, names = known.schema, known.names
    try:
        domain = compiled(known.domain, known.classes)
    except DomainError as error:
        raise KnowledgeError(str(error)) from None
    check("reading the scene")
    relations, stated = facts_of(facts, {**tuples, **schema.facts}, known.properties, domain, names, schema.numbers)
    initial = initial_state(domain, known.classes, stated, names)
    check("reading the scene")
    initial = with_totals(domain, known.classes, relations, initial)
    check_values(initial | exceptions(domain, known.classes, relations, initial), domain, names)
    check("reading the scene")
    lowest = max(domain.levels, default=HIGHEST_LEVEL)  # this level sees all values
    levels = {names.short(iri): min(at, lowest) for iri, at in schema.from_levels.items() if iri not in schema.nodes}
    problem = Problem(scene, domain, known.classes, relations, initial, {}, known.parents, levels)
    wanted = with_task(problem, known.parts, schema.of_kind("Task"))
    return Reading(with_times(wanted, known.parts, schema), names, schema, whole)

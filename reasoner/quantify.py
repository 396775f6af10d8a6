"""Quantification: a behaviour with free variables becomes a SPARQL query, and its rows the quantified behaviours.

The query has one sub-select per parameter, which yields the individuals of its type in declared order; together they yield
every assignment in the order that numbers them (PAPER.md section 4): behaviours in declared order, then parameters in theirs,
then individuals in theirs. Whether a quantified behaviour can be done here is not asked: M counts them all.
"""

from __future__ import annotations

from reasoner.graph import SCENE, KnowledgeError, KnowledgeGraph, text
from reasoner.names import nearest
from reasoner.reading import Reading
from reasoner.symbols import Behavior, GroundBehavior


def query_for(reading: Reading, behavior: Behavior) -> str:
    """Return the SPARQL 1.1 query that quantifies a behaviour: one column per parameter, one row per assignment.

    Raises
    ------
    KnowledgeError
        The type of a parameter has no IRI, as the union of several classes hasn't.
    """
    names = [parameter.name for parameter in behavior.parameters]
    selects = []
    for parameter in behavior.parameters:
        if parameter.kind not in reading.names:
            raise KnowledgeError(
                f"{behavior.name}: the type {parameter.kind} of {parameter.name} isn't in the ontology"
            )
        kind = reading.names.iri(parameter.kind)
        selects.append(
            f"  {{ SELECT DISTINCT {parameter.name} {parameter.name}_index WHERE {{\n"
            f"      {parameter.name} a owl:NamedIndividual ; a/rdfs:subClassOf* <{kind}> .\n"
            f"      OPTIONAL {{ {parameter.name} :index {parameter.name}_declared }}\n"
            f"      BIND(COALESCE({parameter.name}_declared, 1000000000) AS {parameter.name}_index) }} }}"
        )
    order = " ".join(f"{name}_index STR({name})" for name in names)
    return "\n".join(
        [
            f"# {behavior.name}({', '.join(f'{p.name[1:]}: {p.kind}' for p in behavior.parameters)}), level {behavior.level}",
            f"SELECT {' '.join(names) or '(1 AS ?once)'} WHERE {{",
            *selects,
            "}" + (f" ORDER BY {order}" if order else ""),
        ]
    )


def quantify(graph: KnowledgeGraph, reading: Reading, level: int) -> tuple[GroundBehavior, ...]:
    """Return the quantified behaviours of a level with their IDs, from the graph by SPARQL.

    Examples
    --------
    >>> from reasoner.graph import load
    >>> from reasoner.reading import read
    >>> graph = load("beverage-serving")
    >>> for ground in quantify(graph, read(graph), 2)[:3]:
    ...     print(ground)
    0 B2_PICK left_hand bottle1
    1 B2_PICK left_hand bottle2
    2 B2_PICK left_hand cup1
    """
    domain = reading.problem.domain
    found: list[GroundBehavior] = []
    number = domain.first_ids.get(level, 0)
    for behavior in domain.at_level(level):
        for row in graph.select(query_for(reading, behavior), SCENE):
            arguments = tuple(reading.names.short(text(term)) for term in row[: len(behavior.parameters)])
            found.append(GroundBehavior(number + len(found), behavior.name, arguments))
    return tuple(found)


def behavior_named(reading: Reading, name: str) -> Behavior:
    """Return a behaviour by its name; the error of an unknown one has the nearest known name."""
    behaviors = reading.problem.domain.behaviors
    if name not in behaviors:
        raise KnowledgeError(f"unknown behaviour '{name}'{nearest(name, behaviors)} (known: {', '.join(behaviors)})")
    return behaviors[name]

"""Quantification: a behaviour with parameters becomes a SPARQL query whose rows are the quantified behaviours.

The query has one sub-select per parameter, which yields the individuals of the parameter's class. Quantified behaviours are
numbered in the declared order of their behaviours, then by the declared order of the individuals for the first parameter, then
for the second parameter, and so on (PAPER.md section 4). `quantify` calculates the IDs without an ORDER BY clause, which makes
the query ten times as fast and lets a time limit stop the query. Applicability isn't tested: the number M in the paper counts all
quantified behaviours.
"""

from __future__ import annotations

import pyoxigraph as ox

from confab.reasoner.graph.knowledge import SCENE, KnowledgeError, KnowledgeGraph, text
from confab.reasoner.limits import check_listed, checked
from confab.reasoner.names import nearest
from confab.reasoner.reading.problem import Reading
from confab.reasoner.reading.rows import FIRST_INDEX_OF_NONE
from confab.reasoner.symbols import Behavior, GroundBehavior, Parameter


def quantify(graph: KnowledgeGraph, reading: Reading, level: int) -> tuple[GroundBehavior, ...]:
    """Return all quantified behaviours of a level, sorted by ID.

    Examples
    --------
    >>> from confab.reasoner.graph.knowledge import load
    >>> from confab.reasoner.reading.problem import read
    >>> graph = load("beverage-serving")
    >>> for ground in quantify(graph, read(graph), 2)[:3]:
    ...     print(ground)
    0 B2_PICK left_hand bottle1
    1 B2_PICK left_hand bottle2
    2 B2_PICK left_hand cup1
    """
    problem = reading.problem
    check_listed(problem.quantified(level), f"quantified behaviours of level {level}")
    found: dict[int, GroundBehavior] = {}
    for behavior in problem.domain.at_level(level):
        kinds = [parameter.kind for parameter in behavior.parameters]
        rows = graph.solutions(query_for(reading, behavior, ordered=False), SCENE)
        for row in checked(rows, f"quantifying {behavior.name}"):
            arguments = tuple(reading.names.short(text(term)) for term in tuple(row)[: len(kinds)])
            for argument, kind in zip(arguments, kinds, strict=True):
                if argument not in problem.members(kind):
                    raise KnowledgeError(
                        f"{argument} is of class {kind}, but is also a part of behaviours, goals or situation types; "
                        "it can't be both: take one of its classes away, or the owl:sameAs that gives it"
                    )
            number = problem.id_of(behavior.name, arguments)
            found[number] = GroundBehavior(number, behavior.name, arguments)
    return tuple(found[number] for number in sorted(found))


def behavior_named(reading: Reading, name: str) -> Behavior:
    """Return the behaviour with a name; raise `KnowledgeError` with the most similar name if the name is unknown."""
    behaviors = reading.problem.domain.behaviors
    if name not in behaviors:
        raise KnowledgeError(f"unknown behaviour '{name}'{nearest(name, behaviors)} (known: {', '.join(behaviors)})")
    return behaviors[name]


def query_for(reading: Reading, behavior: Behavior, ordered: bool = True) -> str:
    """Return the SPARQL 1.1 query that quantifies a behaviour: one column per parameter, one row per assignment.

    If `ordered`, the rows are sorted by ID. The order may differ from the IDs if individuals have the same index, or have no
    index and belong to several ontologies. If the reading contains only a part of the scene, the query is restricted to the
    individuals of this part.

    Raises
    ------
    KnowledgeError
        The class of a parameter has no IRI, because it is a union of several classes.
    """
    names = [parameter.name for parameter in behavior.parameters]
    order = " ".join(f"{name}_index STR({name})" for name in names) if ordered else ""
    return "\n".join(
        [
            f"# {behavior.name}({', '.join(f'{p.name[1:]}: {p.kind}' for p in behavior.parameters)}), level {behavior.level}",
            f"SELECT {' '.join(names) or '(1 AS ?once)'} WHERE {{",
            *(_select(reading, parameter) for parameter in behavior.parameters),
            "}" + (f" ORDER BY {order}" if order else ""),
        ]
    )


def _select(reading: Reading, parameter: Parameter) -> str:
    """Return the sub-select for the individuals of a parameter's class and their positions in the declared order."""
    name = parameter.name
    return (
        f"  {{ SELECT DISTINCT {name} {name}_index WHERE {{\n"
        f"      {_typed(reading, name, parameter.kind)}\n"
        f"      OPTIONAL {{ {name} :index {name}_declared }}\n"
        f"      BIND(COALESCE({name}_declared, {FIRST_INDEX_OF_NONE}) AS {name}_index) }} }}"
    )


def _typed(reading: Reading, term: str, kind: str) -> str:
    """Return the graph pattern for members of a class; for a part of a scene, return a VALUES clause with the members."""
    if not reading.whole:
        members = (reading.names.iri(member) for member in reading.problem.classes.get(kind, ()))
        return f"VALUES {term} {{ {' '.join(str(ox.NamedNode(iri)) for iri in members)} }}"
    if kind not in reading.names:
        raise KnowledgeError(
            f"the type {kind} of {term} isn't in the ontology; the union of several classes has no query"
        )
    return f"{term} a owl:NamedIndividual ; a/rdfs:subClassOf* <{reading.names.iri(kind)}> ."

"""Observed facts of a scene, stored in a separate file.

Each observed fact is a situated object instance: a node that states an object, a situation type and a value. An observation isn't
stored as a property assertion: the observed place of a cup would contradict the cup's place in the scene. A planning call that
starts from observations replaces the scene's values by the observed values.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pyoxigraph as ox

from confab.reasoner.aggregates.totals import following
from confab.reasoner.amounts import written
from confab.reasoner.condition_nodes import symbol_properties, triples
from confab.reasoner.files import write_whole
from confab.reasoner.graph.knowledge import BASE, KnowledgeError, KnowledgeGraph, read_into, text
from confab.reasoner.names import Names
from confab.reasoner.possible import ImpossibleStateError, refuse_impossible
from confab.reasoner.problem import Problem
from confab.reasoner.reading.problem import Reading
from confab.reasoner.symbols import State, Symbol
from confab.reasoner.vocabulary import ARGUMENTS, CORE, INDIVIDUAL, OWL, TYPE

FACTS = """
SELECT DISTINCT ?fact ?property ?value WHERE { ?fact a :SituatedObjectInstance ; ?property ?value } ORDER BY ?fact ?property"""


def save_observed(path: Path, state: State, names: Names, scene: str) -> None:
    """Write an observed state to a file, as situated object instances.

    Parameters
    ----------
    path : Path
    state : State
        The observed value of each symbol.
    names : Names
        Mapping from the scene's names to IRIs.
    scene : str
        IRI of the scene; the file imports it.
    """
    prefixes = {"owl": OWL, "": CORE, "s": observed_iri(scene) + "#"}
    write_whole(path, ox.serialize(_triples(state, names, scene), format=ox.RdfFormat.TURTLE, prefixes=prefixes) or b"")


def assert_observed(graph: KnowledgeGraph, state: State, names: Names) -> None:
    """Replace the contents of the graph `observed` by an observed state."""
    graph.store.clear_graph(ox.NamedNode(BASE + "observed"))
    graph.extend("observed", _triples(state, names, graph.scene))


def load_observed(path: Path, reading: Reading) -> Reading:
    """Return a reading whose initial state has the observed facts of a file in place of the scene's facts.

    Raises
    ------
    KnowledgeError
        The file is missing, isn't Turtle, or mentions names that the scene doesn't have.
    """
    if not path.is_file():
        raise KnowledgeError(f"{path}: no such file of observed facts; 'confab run' and 'confab execute' write one")
    graph = KnowledgeGraph("")
    read_into(graph, path, "observed")
    nodes: dict[str, dict[str, str]] = {}
    for fact, predicate, value in graph.select(FACTS):
        word, said = text(predicate).removeprefix(CORE), text(value)
        if word == "amount":
            nodes.setdefault(text(fact), {})["value"] = _amount(said, path)
        else:
            nodes.setdefault(text(fact), {})[word] = reading.names.short(said)
    if not nodes:
        raise KnowledgeError(f"{path}: holds no observed facts; 'confab run' and 'confab execute' write such a file")
    seen: dict[Symbol, str] = {}
    for iri, node in nodes.items():
        symbol = _symbol(iri, node, reading.problem, path)
        if (other := seen.setdefault(symbol, node["value"])) != node["value"]:
            raise KnowledgeError(
                f"{path}: {symbol} is {other} and {node['value']}, but only one of the two can be observed; "
                "give the file that 'confab run' or 'confab execute' wrote"
            )
    problem = reading.problem
    now = following(problem, {**problem.initial, **seen})
    try:
        refuse_impossible(problem, problem.initial, now, str(path))
    except ImpossibleStateError as error:
        raise KnowledgeError(f"{error}; observe this scene again") from error
    return replace(reading, problem=replace(problem, initial=now))


def observed_iri(scene: str) -> str:
    """Return the IRI of the ontology that contains the observed facts of a scene."""
    return f"{scene.rstrip('#/')}.observed"


def _symbol(iri: str, node: Mapping[str, str], problem: Problem, path: Path) -> Symbol:
    arguments = tuple(node[name] for name in ARGUMENTS if name in node)
    symbol = Symbol(node.get("situationType", ""), arguments)
    if (symbol not in problem.initial and not _is_false(symbol, problem)) or "value" not in node:
        raise KnowledgeError(f"{path}: <{iri}> names {symbol}, which the scene doesn't have; observe this scene again")
    return symbol


def _is_false(symbol: Symbol, problem: Problem) -> bool:
    """Return whether a symbol is of a boolean situation type of the scene that rules don't define; without a value it is false."""
    kind = problem.domain.situations.get(symbol.situation)
    if (
        kind is None
        or not kind.boolean
        or kind.name in problem.domain.rules
        or len(kind.arguments) != len(symbol.arguments)
    ):
        return False
    return all(one in problem.members(of) for one, of in zip(symbol.arguments, kind.arguments, strict=True))


def _amount(number: str, path: Path) -> str:
    try:
        return written(Fraction(number))
    except (ValueError, ZeroDivisionError) as error:
        raise KnowledgeError(f"{path}: the amount '{number}' is no number; observe this scene again") from error


def _triples(state: State, names: Names, scene: str) -> list[ox.Triple]:
    iri, owl, kind = observed_iri(scene), OWL, ox.NamedNode(TYPE)
    found = [
        ox.Triple(ox.NamedNode(iri), kind, ox.NamedNode(owl + "Ontology")),
        ox.Triple(ox.NamedNode(iri), ox.NamedNode(owl + "imports"), ox.NamedNode(scene)),
    ]
    for symbol, value in sorted(state.items()):
        local = ".".join((*symbol.arguments[:1], symbol.situation, *symbol.arguments[1:])).replace(":", "-")
        fact = ox.NamedNode(f"{iri}#{local}")
        arguments = [*map(names.iri, symbol.arguments)]
        known = names.iri(value) if value in names else None
        amount = {"amount": [value]} if known is None else {}
        properties = {**symbol_properties(names.iri(symbol.situation), arguments, known), **amount}
        found += triples(fact, {TYPE: [INDIVIDUAL, CORE + "SituatedObjectInstance"], **properties})
    return found

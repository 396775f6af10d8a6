"""Derivation of the facts that a query needs: initial values of defined situation types (derived predicates), sums and counts."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator
from itertools import product

import pyoxigraph as ox

from confab.planner.derived_facts import CompiledRules
from confab.planner.transitions import PythonWriter, Table, key_of
from confab.reasoner.graph.knowledge import BASE, DERIVED, SCENE, KnowledgeGraph
from confab.reasoner.limits import check
from confab.reasoner.names import local_name
from confab.reasoner.problem import Problem
from confab.reasoner.reading.problem import Reading
from confab.reasoner.reading.restating import said, value_properties
from confab.reasoner.symbols import TRUE, Fact, Symbol
from confab.reasoner.vocabulary import CORE, TYPE

DEFINED = """
ASK {
  { ?rule a :Rule } UNION { ?situation :holdsOf ?class } UNION { ?situation :remembers ?other } UNION
  { ?situation :valueProperty ?property .
    { ?other rdfs:subPropertyOf|owl:equivalentProperty|owl:inverseOf ?property }
    UNION { ?property owl:propertyChainAxiom|owl:equivalentProperty|owl:inverseOf ?other }
    UNION { ?atom <http://www.w3.org/2003/11/swrl#propertyPredicate> ?property } }
}"""
"""Query that asks whether a scene has definitions. A scene without definitions needn't be read as a problem before a query."""


def write_following(graph: KnowledgeGraph, read: Callable[[], Reading], sparql: str) -> None:
    """Write the initial facts about the derived or remembered situation types in a query into the named graph `DERIVED`."""
    graph.store.clear_graph(ox.NamedNode(BASE + DERIVED))
    if not graph.query(DEFINED, SCENE):
        return
    reading = read()
    problem, properties = reading.problem, value_properties(graph)
    classes: dict[str, list[str]] = {}
    stored = {name for name, one in problem.domain.aggregates.items() if one.kept} | problem.domain.remembers.keys()
    for situation in defined_in(reading, (*problem.domain.rules, *sorted(stored))):
        iri = reading.names.iri(situation)
        of = list(reading.schema.nodes[iri].get(CORE + "holdsOf", ()))
        words = (local_name(one) for one in (iri, properties.get(iri, iri), *of))
        if any(re.search(rf"(?<!\w){re.escape(word)}(?!\w)", sparql) for word in words):
            classes[situation] = of
    facts = [Fact(symbol, TRUE) for symbol in following(problem, [name for name in classes if name not in stored])]
    known = sorted(symbol for symbol in problem.initial if symbol.situation in stored and symbol.situation in classes)
    facts += [Fact(symbol, problem.initial[symbol]) for symbol in known]
    for count, fact in enumerate(facts):
        symbol, prop = fact.symbol, properties.get(reading.names.iri(fact.symbol.situation))
        triples = list(said(reading, fact, prop, ox.BlankNode(f"follows{count}")))
        about = ox.NamedNode(reading.names.iri(symbol.arguments[0]))
        triples += [ox.Triple(about, ox.NamedNode(TYPE), ox.NamedNode(kind)) for kind in classes[symbol.situation]]
        graph.extend(DERIVED, triples)


def defined_in(reading: Reading, situations: Collection[str] | None = None) -> list[str]:
    """Return the situation types, by default all that rules define, without those that only express constraints."""
    names, nodes = reading.names, reading.schema.nodes
    given = reading.problem.domain.rules if situations is None else situations
    return [name for name in given if name in names and names.iri(name) in nodes]


def following(problem: Problem, situations: Collection[str]) -> Iterator[Symbol]:
    """Yield, for some defined situation types, the symbols that are true in the initial state."""
    if not situations:
        return
    table = Table(problem.domain.situations, problem.initial)
    CompiledRules(PythonWriter(problem)).define(table)
    for name in situations:
        for arguments in product(
            *(problem.classes.get(kind, ()) for kind in problem.domain.situations[name].arguments)
        ):
            check(f"deriving {name} in the initial state")
            if table.now[name].get(key_of(arguments)) == TRUE:
                yield Symbol(name, arguments)

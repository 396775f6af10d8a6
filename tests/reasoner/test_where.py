"""The WHERE of a random update holds for the same individuals in Confab as in SPARQL; rdflib answers the same text as a query."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from random import Random
from string import Template

import pytest
from rdflib import Graph, Variable

import confab
from confab.planner.affordances import affordances
from confab.reasoner.graph.knowledge import KnowledgeError

WORLD = """
@prefix : <https://example.org/w#> .
@prefix c: <https://w3id.org/confab/core#> .
@prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
@prefix xsd: <http://www.w3.org/2001/XMLSchema#> .
<https://example.org/w> a owl:Ontology ; owl:imports <https://w3id.org/confab/core> ; c:symbolicOnly true .
:Van a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object ; c:hasSituationType :AT, :N .
:Lorry a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object ; c:hasSituationType :AT .
:Town a owl:Class, owl:NamedIndividual ; rdfs:subClassOf :AT .
:AT a owl:Class, owl:NamedIndividual, c:SituationType ; c:valueProperty :at .
:at a owl:ObjectProperty, owl:FunctionalProperty, owl:NamedIndividual ; rdfs:range :AT .
:N a owl:NamedIndividual, c:SituationType, c:Amount ; c:valueProperty :n .
:n a owl:DatatypeProperty, owl:FunctionalProperty, owl:NamedIndividual ; rdfs:domain :Van ; rdfs:range xsd:integer .
:near a owl:ObjectProperty, owl:NamedIndividual, c:Relation ; rdfs:domain :Town ; rdfs:range :Town .
:size a owl:DatatypeProperty, owl:NamedIndividual, c:Relation ; rdfs:domain :Town ; rdfs:range xsd:integer .
:van1 a owl:NamedIndividual, :Van ; c:index 1 ; :at :north ; :n 3 .
:van2 a owl:NamedIndividual, :Van ; c:index 2 ; :at :mid ; :n 1 .
:van3 a owl:NamedIndividual, :Van ; c:index 3 ; :at :north ; :n 2 .
:lorry1 a owl:NamedIndividual, :Lorry ; c:index 4 ; :at :mid .
:lorry2 a owl:NamedIndividual, :Lorry ; c:index 5 ; :at :south .
:north a owl:NamedIndividual, :Town ; c:index 6 ; :near :mid, :north ; :size 4 .
:mid a owl:NamedIndividual, :Town ; c:index 7 ; :near :north, :south ; :size 2 .
:south a owl:NamedIndividual, :Town ; c:index 8 ; :near :mid .
:task a owl:NamedIndividual, c:Task ; c:goal :task.goal .
:task.goal a owl:NamedIndividual, c:ValueCondition ; c:about :van1 ; c:situationType :AT ; c:value :south .
"""
GROUPS = (
    "?v :at $x . $x a :Town", "?v :at $x . $x :near ?to", "?l :at $x . $x a :Town", "?l :at $x . $x :near ?to",
    "$x a :Town ; :near ?to", "$o a :Lorry ; :at $x . $x :near ?to", "$o a :Van ; :at ?to", "$o a :Van ; :at $x FILTER($x != ?to)",
    "$o a :Van ; :at ?to ; :n $k", "$x a :Town ; :size $k FILTER($k > 2)", "?v :n $k", "$o a :Van ; :n $k FILTER($k >= 2)",
    "?to :size $k", "?v :at $x FILTER($x NOT IN (:north, :mid))", "$o a :Lorry ; :at $x . ?p a :Van ; :at $x",
    "$x a :Town ; :near ?to . $o a :Van ; :at $x", "?v :at $x . $o a :Lorry ; :at $x",
)  # fmt: skip
PATTERNS = (
    "?v :at $x", "?l :at $x . $x :near ?to", "?to :size $k", "?v :n $k", "?v :n $k FILTER($k > 1)",
    "?v :n $k BIND($k + 1 AS ?more) FILTER(?more > 3)", "VALUES ?to { :mid :south }", "VALUES (?to) { (:mid) (:north) }",
    "VALUES (?v ?to) { (:van1 :mid) (UNDEF :south) }", "?to :near ?to",
)  # fmt: skip
FILTERS = (
    "FILTER EXISTS { G }", "FILTER NOT EXISTS { G }", "FILTER(!EXISTS { G })", "FILTER(!(NOT EXISTS { G }))", "{ G } UNION { G }",
    "FILTER(EXISTS { G } || EXISTS { G })", "FILTER(EXISTS { G } && !EXISTS { G })", "FILTER(!(EXISTS { G } && EXISTS { G }))",
    "FILTER NOT EXISTS { G FILTER NOT EXISTS { G } }", "FILTER EXISTS { G FILTER EXISTS { G } }",
)  # fmt: skip
NAMES = {"x": ("?x", "?x", "?y"), "o": ("?o", "?x", "?z"), "k": ("?k", "?k", "?x")}


def drawn(random: Random, texts: Sequence[str]) -> str:
    return Template(random.choice(texts)).substitute({letter: random.choice(names) for letter, names in NAMES.items()})


def where(random: Random) -> str:
    """Return the WHERE of an update about a van, a lorry and a town; different groups often use the same names."""
    found = ["?v a :Van . ?l a :Lorry . ?to a :Town"]
    for _ in range(random.randint(1, 3)):
        if random.random() < 0.3:
            found.append(drawn(random, PATTERNS))
        else:
            first, *more = random.choice(FILTERS).split("G")
            found.append(first + "".join(drawn(random, GROUPS) + between for between in more))
    return " .\n  ".join(found)


def answers(folder: Path, text: str) -> tuple[set[tuple[str, ...]], set[tuple[str, ...]]] | None:
    """Return the applicable (van, lorry, town) of Confab and of rdflib; return None if Confab refuses the text."""
    file = folder / "w.ttl"
    behavior = (
        ':GO a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 1 ; c:update """INSERT { ?v :at ?to } WHERE {'
    )
    file.write_text(f'{WORLD}{behavior} {text} }}""" .\n', encoding="utf-8")
    rows = Graph().parse(file).query(f"PREFIX : <https://example.org/w#> SELECT ?v ?l ?to WHERE {{ {text} }}")
    meant = {
        tuple(str(row[name]).rpartition("#")[2] for name in map(Variable, ("v", "l", "to"))) for row in rows.bindings
    }
    try:
        problem = confab.load(file).problem
    except KnowledgeError:
        return None
    return {found.arguments for found in affordances(problem, problem.initial)}, meant


@pytest.mark.parametrize("block", range(4))
def test_a_where_holds_for_the_same_individuals_as_in_sparql(tmp_path: Path, block: int) -> None:
    compared = 0
    for seed in range(25 * block, 25 * block + 25):
        text = where(Random(seed))
        if (both := answers(tmp_path, text)) is not None:
            compared += 1
            assert both[0] == both[1], f"seed {seed}: {text}"
    assert compared > 12


TOTAL = """
:TOTAL a owl:NamedIndividual, c:SituationType, c:Amount ; c:valueProperty :total . :Town c:hasSituationType :TOTAL .
:total a owl:DatatypeProperty, owl:FunctionalProperty, owl:NamedIndividual ; rdfs:domain :Town ; rdfs:range xsd:integer .
:GO a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 1 ; c:update \"\"\"
  INSERT { ?v :at ?to } WHERE { ?v a :Van . ?to a :Town ; :total ?t FILTER(?t > 0) }\"\"\" .
:TOTAL.rule a owl:NamedIndividual, c:Rule ; c:construct \"\"\"CONSTRUCT { ?to :total ?sum } WHERE { SELECT }\"\"\" .
"""


@pytest.mark.parametrize("function", ["SUM(?q)", "SUM(?q + 1)", "COUNT(?v)", "COUNT(*)"])
def test_a_sum_and_a_count_are_those_of_sparql(tmp_path: Path, function: str) -> None:
    compared, file = 0, tmp_path / "w.ttl"
    for seed in range(15):
        text = where(Random(f"{function} {seed}"))
        select = f"SELECT ?to ({function} AS ?sum) WHERE {{ {text} . ?v :n ?q }} GROUP BY ?to"
        file.write_text(WORLD + TOTAL.replace("SELECT", select), encoding="utf-8")
        rows = Graph().parse(file).query(f"PREFIX : <https://example.org/w#> {select}")
        town, total = Variable("to"), Variable("sum")
        meant = {str(row[town]).rpartition("#")[2]: int(str(row[total])) for row in rows.bindings if town in row}
        try:
            initial = confab.load(file).problem.initial
        except KnowledgeError:
            continue
        compared += 1
        found = {cell.arguments[0]: int(value) for cell, value in initial.items() if cell.situation == "TOTAL"}
        assert found == {name: meant.get(name, 0) for name in ("north", "mid", "south")}, text
    assert compared > 5

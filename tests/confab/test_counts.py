"""The cost of a call in counts: the rows and triples that recognition reads, the queries to the store, and the imported modules."""

import json
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pyoxigraph as ox
import pytest
import rdflib
from rdflib.plugins.stores.memory import SimpleMemory

import confab
from confab.checking import refused
from confab.planner.solve import Request, solve
from confab.reasoner.generate import write_scene
from confab.reasoner.graph.knowledge import BASE, SCENE, Answer, KnowledgeGraph, load, text
from confab.reasoner.names import local_name
from confab.reasoner.reading.relevance import recognise
from confab.reasoner.reading.rows import Member, OntologySchema
from confab.reasoner.reading.schema import SCHEMA


class Looked(SimpleMemory):
    """The triples of a knowledge graph for rdflib's query engine, with a count of the triples that the engine reads."""

    def __init__(self, store: ox.Store) -> None:
        super().__init__()
        self.store, self.count = store, 0

    def triples(self, triple_pattern: Any, context: Any = None) -> Iterator[Any]:
        """Yield the triples that match a pattern."""
        s, p, o = (None if term is None else to_oxigraph(term) for term in triple_pattern)
        for graph in SCENE:
            for quad in self.store.quads_for_pattern(s, p, o, ox.NamedNode(BASE + graph)):
                self.count += 1
                yield (to_rdflib(quad.subject), to_rdflib(quad.predicate), to_rdflib(quad.object)), iter(())


def to_oxigraph(term: Any) -> Any:
    """Return a term of rdflib as a term of pyoxigraph."""
    if isinstance(term, rdflib.Literal):
        return (
            ox.Literal(str(term), language=term.language)
            if term.language
            else ox.Literal(str(term), datatype=ox.NamedNode(str(term.datatype or rdflib.XSD.string)))
        )
    return ox.BlankNode(str(term)) if isinstance(term, rdflib.BNode) else ox.NamedNode(str(term))


def to_rdflib(term: Any) -> Any:
    """Return a term of pyoxigraph as a term of rdflib."""
    if isinstance(term, ox.Literal):
        named = None if term.language else rdflib.URIRef(term.datatype.value)
        return rdflib.Literal(term.value, lang=term.language, datatype=named)
    return rdflib.BNode(term.value) if isinstance(term, ox.BlankNode) else rdflib.URIRef(term.value)


@dataclass
class Counting:
    """A remote store that counts the queries, the rows and bytes of its answers, and the triples that it reads for them.

    The store evaluates the patterns of a query in the written order, as plain engines do. So the count of triples depends on
    the query alone, and not on an engine's optimiser. The query for the schema is the same for every task; Oxigraph evaluates
    it, and only its rows are counted.
    """

    graph: KnowledgeGraph
    counts: Counter[str] = field(default_factory=Counter)

    def query(self, query: str, prefixes: Mapping[str, str], bindings: Mapping[str, str], noted: bool = True) -> Answer:
        """Answer a query."""
        looked = Looked(self.graph.store)
        if query == SCHEMA:
            data = self.graph.solutions(query, SCENE).serialize(format=ox.QueryResultsFormat.JSON) or b""
        else:
            data = rdflib.Graph(looked).query(query, initNs=dict(prefixes)).serialize(format="json") or b""
        rows = json.loads(data)["results"]["bindings"]
        self.counts += Counter(
            queries=1,
            rows=len(rows),
            bytes=len(query) + sum(len(t["value"]) for row in rows for t in row.values() if t["type"] != "bnode"),
            looked=looked.count,
        )
        return ox.parse_query_results(data, format=ox.QueryResultsFormat.JSON)

    def confirm(self) -> None:
        """Do nothing, because this store never changes."""


def counted(path: Path, goals: tuple[str, ...] = ()) -> Counter[str]:
    """Return the counts of recognition in a scene."""
    graph = load(path)
    remote = Counting(graph)
    there = KnowledgeGraph(graph.scene, remote=remote)
    assert recognise(there, goals).problem == recognise(graph, goals).problem
    return remote.counts


def checked(path: Path) -> Counter[str]:
    """Return the counts of the check of a plan in a scene."""
    graph = load(path)
    part = recognise(graph)
    plan = solve(Request(part.problem)).plan
    assert plan is not None
    remote = Counting(graph)
    assert refused(KnowledgeGraph(graph.scene, remote=remote), part, plan) == []
    return remote.counts


def test_the_check_of_a_plan_reads_no_irrelevant_objects(tmp_path: Path) -> None:
    path = tmp_path / "scene.ttl"
    write_scene(path, "served")
    alone = checked(path)
    assert alone["queries"] == 2
    write_scene(path, "served", clutter=1_000)
    assert checked(path) == alone


@pytest.mark.parametrize("goals", [(), ("cup1 LOCATION location3",)])
def test_recognition_reads_no_irrelevant_objects(tmp_path: Path, goals: tuple[str, ...]) -> None:
    """A task among 20,000 irrelevant objects needs the same numbers of queries, rows, bytes and triples as the task alone."""
    path = tmp_path / "scene.ttl"
    write_scene(path, "served")
    alone = counted(path, goals)
    assert alone["queries"] == 6 + bool(goals)
    for clutter in (1_000, 20_000):
        write_scene(path, "served", clutter=clutter)
        assert counted(path, goals) == alone


def test_a_query_for_all_individuals_with_a_name_is_detected(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Commit 40b5436 had this fault: a query for individuals with the same name read all individuals."""

    def namesakes(graph: KnowledgeGraph, schema: OntologySchema, members: Sequence[Member]) -> set[str]:
        endings = {local_name(individual) for individual, _, _ in members}
        found = {text(x) for (x,) in graph.select("SELECT ?x WHERE { ?x a owl:NamedIndividual }", SCENE)}
        return {x for x in found if local_name(x) in endings} - {individual for individual, _, _ in members}

    monkeypatch.setattr("confab.reasoner.reading.relevance._namesakes", namesakes)
    path = tmp_path / "scene.ttl"
    write_scene(path, "served")
    alone = counted(path)
    write_scene(path, "served", clutter=100)
    among = counted(path)
    assert among["queries"] == alone["queries"]
    assert all(among[what] > alone[what] + 100 for what in ("rows", "bytes", "looked"))


def test_a_call_sends_few_queries_to_the_store() -> None:
    """Loading takes two queries and one per file; recognition takes six, the check takes two, and a changed goal takes one more."""
    scene = confab.load("beverage-serving")
    assert scene.knowledge.round_trips == 2 + len(scene.knowledge.files)
    assert scene.plan().queries == 6 + 2
    assert scene.plan(["cup1 BEVERAGE no_beverage"]).queries == 7 + 2


def test_an_unsolvable_answer_takes_three_additional_queries(tmp_path: Path) -> None:
    """Three queries read the individuals that were left out: their types, their facts, and facts in separate nodes."""
    write_scene(tmp_path / "scene.ttl", "unsolvable", clutter=10)
    scene = confab.load(tmp_path / "scene.ttl")
    result = scene.plan()
    assert not result.solved
    assert result.queries == 6 + 3


UNWANTED = (
    *(
        "rdflib",
        "owlready2",
        "pybullet",
        "networkx",
        "matplotlib",
        "pyshacl",
        "reasonable",
        "urllib3",
        "imageio",
        "numpy",
        "pydantic",
    ),
    *(
        "sim",
        "confab.planner.acting",
        "confab.planner.experience",
        "confab.planner.grounded",
        "confab.reasoner.embodiment",
        "confab.reasoner.validation",
        "confab.reasoner.pddl",
        "confab.reasoner.memory.experience_file",
    ),
)
"""Modules that a plan in a shipped scene doesn't need: large packages, and packages of other commands."""
MOST_MODULES = 166
"""The modules are 42 of rich, 106 of Confab, 12 of click, and a few others."""
MOST_OWN = 148
"""The modules of Python's standard library; each version of Python imports different modules below them."""


def imported(before: str = "") -> list[str]:
    """Return the modules that the command `confab plan` imports after a line of Python."""
    script = (
        f"{before}\nimport sys; sys.argv = ['confab', 'plan', 'beverage-serving']\n"
        "from confab.cli import main\n"
        "try: main()\n"
        "finally: print(*sys.modules, file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    return done.stderr.split()


def own(modules: list[str]) -> int:
    """Return the number of modules that belong to Python's standard library."""
    return sum(name.split(".")[0] in sys.stdlib_module_names for name in modules)


def test_the_plan_command_imports_what_it_needs() -> None:
    modules = imported()
    assert [name for name in modules if name in UNWANTED] == []
    assert len(modules) - own(modules) <= MOST_MODULES
    assert own(modules) <= MOST_OWN


def test_the_import_of_an_unneeded_module_is_detected() -> None:
    modules = imported("import rdflib, confab.planner.grounded.task")
    assert {name for name in modules if name in UNWANTED} >= {"rdflib", "confab.planner.grounded"}
    assert len(modules) - own(modules) > MOST_MODULES

"""Competency questions: each question was first asked in words, and its answer is known.

The file of a question contains the question, the scene, the expected rows, and a property without whose triples the answer
differs. `python -m tests.ontology.test_questions` prints the rows of each question in the form in which the files contain them.
"""

from dataclasses import dataclass
from pathlib import Path

import pyoxigraph as ox
import pytest

from confab import ontology
from confab.reasoner.graph.inference import infer
from confab.reasoner.graph.knowledge import BASE, KnowledgeGraph, load, text
from confab.reasoner.names import local_name
from confab.reasoner.vocabulary import CORE, TYPE


@dataclass(frozen=True)
class Question:
    name: str
    words: str
    scene: str
    rows: list[str]
    needs: str
    query: str


def question(path: Path) -> Question:
    content = path.read_text(encoding="utf-8")
    head = [line[2:].split(": ", 1) for line in content.splitlines() if line.startswith("# ")]
    said = dict(pair for pair in head if pair[0] != "Row")
    rows = [pair[1] for pair in head if pair[0] == "Row"]
    return Question(path.stem, said["Question"], said["Scene"], rows, said["Fails without"], content)


QUESTIONS = [question(path) for path in sorted((ontology.ROOT / "questions").glob("*.rq"))]


def scene(name: str) -> KnowledgeGraph:
    graph = load(name)
    infer(graph)
    return graph


def answer(graph: KnowledgeGraph, question: Question) -> list[str]:
    rows = graph.select(question.query)
    return [" | ".join(local_name(text(t)) if isinstance(t, ox.NamedNode) else text(t) for t in row) for row in rows]


@pytest.mark.parametrize("question", QUESTIONS, ids=lambda question: question.name)
def test_a_question_has_its_known_answer(question: Question) -> None:
    assert question.words.endswith("?")
    assert question.rows
    assert answer(scene(question.scene), question) == question.rows


@pytest.mark.parametrize("question", QUESTIONS, ids=lambda question: question.name)
def test_a_question_has_another_answer_without_the_triples_that_it_needs(question: Question) -> None:
    graph = scene(question.scene)
    prefix, name = question.needs.split(":")
    needed = ox.NamedNode(graph.prefixes[prefix] + name)
    for quad in list(graph.store.quads_for_pattern(None, needed, None, None)):
        graph.store.remove(quad)
    assert answer(graph, question) != question.rows


@pytest.mark.parametrize(
    ("name", "rows"),
    [
        ("canteen-small", [*(f"cup{i} | DRINK | tea | no" for i in (1, 2, 3)), "jug1 | SERVINGS | >=0.5 | yes"]),
        ("assembly-small", ["cover | JOINED | housing | no", "shaft | JOINED | housing | no"]),
        ("packing-small", ["ring | INSIDE | casket | ", "ring | STORED_AWAY | true | "]),
    ],
    ids=["amounts and defaults", "pairs", "defined"],
)
def test_each_goal_is_listed_whatever_its_initial_value(name: str, rows: list[str]) -> None:
    wanted = next(question for question in QUESTIONS if question.name == "what-is-wanted")
    assert answer(scene(name), wanted) == rows


def test_a_goal_that_combines_conditions_is_listed_by_its_name() -> None:
    graph, wanted = scene("canteen-small"), next(one for one in QUESTIONS if one.name == "what-is-wanted")
    (task,) = {quad.subject for quad in graph.store.quads_for_pattern(None, ox.NamedNode(CORE + "goal"), None, None)}
    either = ox.NamedNode("https://example.org/either")
    for triple in ((task, CORE + "goal", either), (either, TYPE, ox.NamedNode(CORE + "AnyOf"))):
        graph.store.add(ox.Quad(triple[0], ox.NamedNode(triple[1]), triple[2], ox.NamedNode(BASE + "asserted")))
    assert answer(graph, wanted) == ["either | AnyOf | true | ", *answer(scene("canteen-small"), wanted)]


if __name__ == "__main__":
    for asked in QUESTIONS:
        print(asked.name, *(f"# Row: {row}" for row in answer(scene(asked.scene), asked)), sep="\n")

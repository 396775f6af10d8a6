"""A behaviour as a SPARQL update equals the same behaviour as individuals, in both directions; faults have line and column."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import confab
from confab import ontology
from confab.planner.solve import Request, solve
from confab.reasoner.amounts import Amount, Calculation, Measure
from confab.reasoner.graph.inference import infer
from confab.reasoner.graph.knowledge import SCENE, Answer, KnowledgeError, KnowledgeGraph, load, read_into
from confab.reasoner.names import local_name
from confab.reasoner.pddl.turtle import turtle
from confab.reasoner.reading.frame import as_written
from confab.reasoner.reading.problem import read
from confab.reasoner.reading.schema import read_schema
from confab.reasoner.symbols import AmountEffect, Behavior, Comparison
from confab.reasoner.updates.compiling import UpdateFault
from confab.reasoner.updates.converting import compiled_again, convert, plainly, situations_of
from confab.reasoner.updates.writing import update
from confab.reasoner.validation.validate import validate
from confab.reasoner.vocabulary import CORE
from worlds.language import language

ROOT = Path(__file__).resolve().parents[2]
LABORATORY = ROOT / "docs" / "examples" / "laboratory"
THEATRE = ROOT / "docs" / "examples" / "theatre" / "theatre.ttl"
RANDOM = "https://example.org/random"


def behaviors(graph: KnowledgeGraph) -> dict[str, Behavior]:
    schema = read_schema(graph)
    return as_written(schema, schema.of_kind("Behavior"))


def again(graph: KnowledgeGraph, iri: str, behavior: Behavior, prefixes: dict[str, str]) -> tuple[str, object]:
    """Return the update of a behaviour, and the behaviour that is read from this update."""

    def spell(term: str) -> str:
        found = [f"{prefix}:{term.removeprefix(ns)}" for prefix, ns in prefixes.items() if term.startswith(ns)]
        return found[0] if found else f"<{term}>"

    written = update(behavior, situations_of(read_schema(graph)), spell)
    found = compiled_again(graph, iri, written, prefixes)
    return written, found if isinstance(found, str) else plainly(found)


@given(seed=st.integers(0, 10**9))
@settings(max_examples=settings().max_examples // 5)
def test_any_behavior_survives_a_round_trip_through_its_update(seed: int) -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "random.ttl"
        path.write_text(turtle(replace(language(seed, 1), scene=RANDOM), "random", "random"))
        graph = load(path)
    for iri, behavior in behaviors(graph).items():
        try:
            written, found = again(graph, iri, behavior, {"": f"{RANDOM}#", "c": CORE})
        except ValueError as error:  # an amount becomes the sum of itself and a number, but not by an increase
            assert "assigns an amount" in str(error)
            continue
        assert found == plainly(behavior), written


@pytest.mark.parametrize("name", sorted(path.stem for path in (ontology.ROOT / "domains").glob("*.ttl")))
def test_every_shipped_behavior_survives_a_round_trip_through_its_update(name: str) -> None:
    graph = load(ontology.ROOT / "domains" / f"{name}.ttl")
    for iri, behavior in behaviors(graph).items():
        if iri.rpartition("#")[0] == graph.scene:
            written, found = again(graph, iri, behavior, graph.declared)
            assert found == plainly(behavior), written


def test_a_file_converted_to_updates_and_back_keeps_its_behaviors_and_all_other_lines(tmp_path: Path) -> None:
    path = ontology.ROOT / "domains" / "towers.ttl"
    before, short, long = behaviors(load(path)), tmp_path / "short.ttl", tmp_path / "long.ttl"
    short.write_text(convert(path, "sparql").text)
    long.write_text(convert(short, "individuals").text)
    for file in (short, long):
        found = behaviors(load(file))
        assert {iri: plainly(behavior) for iri, behavior in found.items()} == {
            iri: plainly(behavior) for iri, behavior in before.items()
        }
    kept = [line for line in path.read_text().splitlines() if "rdfs:subClassOf" in line or line.startswith("#")]
    assert kept
    assert set(kept) <= set(short.read_text().splitlines())
    assert len(short.read_text().splitlines()) < len(path.read_text().splitlines())
    assert "c:ValueCondition" not in short.read_text()
    assert "c:update" not in long.read_text()


def test_effects_on_all_individuals_of_a_class_are_written_with_the_class() -> None:
    graph = load(THEATRE)
    found = convert(THEATRE, "sparql")
    assert found.notes == []
    assert "INSERT { :Prop :isAt ?room }" in found.text
    for iri, behavior in behaviors(graph).items():
        written, there_and_back = again(graph, iri, behavior, graph.declared)
        assert there_and_back == plainly(behavior), written


def test_the_laboratory_in_updates_is_under_a_hundred_lines_and_plans_like_its_individuals(tmp_path: Path) -> None:
    assert len((LABORATORY / "lab.ttl").read_text().splitlines()) < 100
    (tmp_path / "lab.ttl").write_text(convert(LABORATORY / "lab.ttl", "individuals").text)
    (tmp_path / "lab-scene.ttl").write_text((LABORATORY / "lab-scene.ttl").read_text())
    plans = []
    for folder in (LABORATORY, tmp_path):
        graph = load(folder / "lab-scene.ttl")
        infer(graph)
        outcome = solve(Request(read(graph).problem))
        assert outcome.plan is not None
        plans.append([str(step) for step in outcome.plan.walk()])
        assert len(outcome.plan.primitives) <= 52  # the length if each step of level 1 is refined alone
    assert plans[0] == plans[1]
    assert validate([LABORATORY / "lab-scene.ttl"]) == []


SMALL = """
@prefix : <https://example.org/small#> .
@prefix c: <https://w3id.org/confab/core#> .
@prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
<https://example.org/small> a owl:Ontology ; owl:imports <https://w3id.org/confab/core> .
:Tube a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object ; c:hasSituationType :SPOT ; rdfs:label "tube"@en .
:Slot a owl:Class, owl:NamedIndividual ; rdfs:subClassOf :SPOT ; rdfs:label "slot"@en .
:SPOT a owl:Class, owl:NamedIndividual, c:SituationType ; c:valueProperty :spot .
:spot a owl:ObjectProperty, owl:FunctionalProperty, owl:NamedIndividual .
:fits a owl:ObjectProperty, owl:NamedIndividual, c:Relation .
:MOVE a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 1 ; c:update \"\"\"TEXT\"\"\" .
"""
HEAD = "DELETE { ?tube :spot ?from } INSERT { ?tube :spot ?slot } WHERE { ?tube a :Tube . ?slot a :Slot . ?tube :spot ?from "


def faults(folder: Path, text: str) -> list[UpdateFault]:
    found: list[UpdateFault] = []
    (folder / "small.ttl").write_text(SMALL.replace("TEXT", text))
    load(folder / "small.ttl", faults=found)
    return found


@pytest.mark.parametrize(
    ("text", "what", "remedy", "place"),
    [
        (HEAD + "; :spto ?x }", ":spto is neither a property", "correct the name", (1, len(HEAD) + 3)),
        (HEAD + "}\nFILTER (?a)", "'FILTER' isn't expected here", "write DELETE", (2, 1)),
        (HEAD + ".\n ?a :fits ?slot }", "nothing determines the variable ?a", "state its type", (2, 2)),
        (
            HEAD + ".\n ?slot :fits ?a }",
            "nothing determines the variable ?a, since :fits may have several values",
            "a situation with one value at a time and with ?a as its value",
            (2, 14),
        ),
        (
            HEAD + ".\n FILTER EXISTS { ?a a :Slot . ?tube :fits ?a } ?a :fits ?slot }",
            "nothing determines the variable ?a here; another ?a is local to its braces",
            "state its type",
            (2, 48),
        ),
        (HEAD + ".\n ?tube :fits/:fits ?slot }", "a path isn't supported", "a pattern for each step", (2, 8)),
        (HEAD + ".\n OPTIONAL { ?tube :fits ?slot } }", "OPTIONAL isn't supported", "a further operation", (2, 13)),
        (HEAD + ".\n MINUS { ?tube :fits ?slot } }", "MINUS isn't supported", "FILTER NOT EXISTS", (2, 10)),
        (HEAD + ".\n FILTER(REGEX(?a, 'b')) }", "this FILTER isn't supported", "compare two terms", (2, 15)),
        (HEAD + ".\n ?tube :spot 3 }", "the number 3 is in the place of an individual", "name an individual", (2, 8)),
        (HEAD + ".\n (?tube ?slot) :fits ?from }", "begins with something that has no name", "a list comes last", (2, 16)),
        (HEAD + ".\n ?tube x:spot ?y }", "the prefix 'x:' isn't declared", "declare it", (2, 8)),
        ("DELETE { ?t :spot ?s } WHERE { ?t a :Tube ; :spot ?s }", "would have none", "insert the one", (1, 13)),
        ("INSERT { ?t :fits ?s } WHERE { ?t a :Tube . ?s a :Slot }", "nothing changes", "property of a situation", (1, 13)),
        ("INSERT { ?t a :Tube } WHERE { ?t a :Tube }", "doesn't change", "property of a situation", (1, 13)),
        (HEAD + "} ; INSERT { ?t :spot ?slot } WHERE { ?t a :Tube }", "would denote all", "a parameter", (1, len(HEAD) + 14)),
        (HEAD + ".\n ?tube !:fits ?slot }", "a path isn't supported", "UNION for each choice", (2, 9)),
        (HEAD + ".\n ?tube (:fits|:spot) ?slot }", "a path isn't supported", "UNION for each choice", (2, 9)),
        (HEAD + ".\n VALUES (?tube ?from) { (:a) } }", "not as many values", "UNDEF", (2, 10)),
        (HEAD + ".\n ?slot :size ?n BIND(?n + 1 AS ?n) }", "a second value", "a new variable", (2, 32)),
        (HEAD + ".\n { ?tube :spot ?x } UNION { ?x a :Slot } ?x :fits ?slot }", "outside of it", "another name", (2, 16)),
        ("CLEAR ALL", "deletes and inserts", "without WITH", (1, 1)),
    ],
)  # fmt: skip
def test_a_fault_in_an_update_has_line_and_column(
    tmp_path: Path, text: str, what: str, remedy: str, place: tuple[int, int]
) -> None:
    (fault,) = faults(tmp_path, text)
    assert what in fault.what
    assert remedy in fault.remedy
    assert (fault.place.line, fault.place.column) == place


ALIKE = [
    ("FILTER(?tube IN (:a, :b))", "VALUES ?tube { :a :b }"),
    ("FILTER(?tube NOT IN (:a, :b))", "FILTER(?tube != :a) FILTER(?tube != :b)"),
    ("FILTER(?tube = :a || ?tube = :b)", "{ FILTER(?tube = :a) } UNION { FILTER(?tube = :b) }"),
    ("VALUES (?tube ?slot) { (:a :b) (:c UNDEF) }", "FILTER(?tube = :a && ?slot = :b || ?tube = :c)"),
    ("FILTER(! EXISTS { ?tube :fits ?slot })", "FILTER NOT EXISTS { ?tube :fits ?slot }"),
    ("FILTER EXISTS { ?tube :fits ?slot }", "{ ?tube :fits ?slot }"),
    (
        "FILTER NOT EXISTS { ?t a :Tube . ?s a :Slot . ?t :spot ?s FILTER(?s != ?slot) FILTER(?t != ?tube) }",
        "FILTER NOT EXISTS { ?t a :Tube FILTER(?t != ?tube) FILTER EXISTS { ?s a :Slot . ?t :spot ?s FILTER(?s != ?slot) } }",
    ),
    ("FILTER(! (?tube = :a && ?slot = :b))", "FILTER NOT EXISTS { FILTER(?tube = :a) FILTER(?slot = :b) }"),
    ("FILTER NOT EXISTS { ?anyone a :Tube ; :spot ?slot }", "FILTER NOT EXISTS { ?t a :Tube ; :spot ?slot }"),
    ("; :fits ?slot ; . ?slot a :Slot ;", "; :fits ?slot . ?slot a :Slot"),
]


@pytest.mark.parametrize(("one", "other"), ALIKE)
def test_equivalent_sparql_forms_give_the_same_condition(tmp_path: Path, one: str, other: str) -> None:
    found = []
    for said in (one, other):
        assert faults(tmp_path, f"{HEAD} {said} }}") == []
        (behavior,) = behaviors(load(tmp_path / "small.ttl")).values()
        found.append(plainly(behavior))
    assert found[0] == found[1]
    assert found[0] != plainly(only(tmp_path, f"{HEAD} }}"))


def only(folder: Path, text: str) -> Behavior:
    assert faults(folder, text) == []
    (behavior,) = behaviors(load(folder / "small.ttl")).values()
    return behavior


AMOUNT = """
:JUG a owl:NamedIndividual, c:SituationType, c:Amount ; c:valueProperty :jug . :Tube c:hasSituationType :JUG .
:jug a owl:DatatypeProperty, owl:FunctionalProperty, owl:NamedIndividual ; rdfs:domain :Tube .
:size a owl:DatatypeProperty, owl:NamedIndividual, c:Relation ; rdfs:domain :Slot .
"""


def test_numbers_are_compared_and_changed(tmp_path: Path) -> None:
    text = """DELETE { ?tube :jug ?n } INSERT { ?tube :jug ?m }
      WHERE { ?tube a :Tube ; :jug ?n . ?slot a :Slot ; :size ?size FILTER(?n >= ?size + 2 && ?n != 7.5) BIND(?n - ?size AS ?m) }"""
    (tmp_path / "small.ttl").write_text(SMALL.replace("TEXT", text) + AMOUNT)
    (found,) = behaviors(load(tmp_path / "small.ttl")).values()
    tube, size = (
        Amount("https://example.org/small#JUG", ("?tube",)),
        Measure("https://example.org/small#size", ("?slot",)),
    )
    assert found.amounts == (AmountEffect(tube.situation, ("?tube",), "decrease", size),)
    assert set(found.preconditions) == {
        Comparison(tube, ">=", Calculation("+", size, Fraction(2))),
        Comparison(tube, "=", Fraction(15, 2), negated=True),
    }


def test_parameters_are_the_variables_whose_triples_begin_with_a_type_in_that_order(tmp_path: Path) -> None:
    text = "INSERT { ?tube :spot ?to } WHERE { ?to a :Slot . ?tube a :Tube ; :spot ?from ; :fits ?to . ?from a :Slot }"
    said = only(tmp_path, text)
    assert [(p.name, local_name(p.kind)) for p in said.parameters] == [("?to", "Slot"), ("?tube", "Tube")]
    assert [(v.name, local_name(v.kind)) for v in said.variables] == [("?from", "Slot")]


def test_a_behaviour_can_extend_a_behaviour_of_another_level(tmp_path: Path) -> None:
    faults(tmp_path, f"{HEAD}}}")
    text = (tmp_path / "small.ttl").read_text()
    more = (
        ":LOW a owl:NamedIndividual, c:Behavior ; c:level 2 ; c:index 1 ; c:extends :MOVE ; c:update "
        '"INSERT {} WHERE { ?tube :fits ?slot }" .\n'
    )
    (tmp_path / "small.ttl").write_text(text + more)
    low, move = sorted(behaviors(load(tmp_path / "small.ttl")).values(), key=lambda behavior: behavior.name)
    assert low.parameters == move.parameters
    assert low.effects == move.effects
    assert set(move.preconditions) < set(low.preconditions)
    assert len(low.preconditions) == len(move.preconditions) + 1
    (tmp_path / "small.ttl").write_text(text.replace("c:update", "c:extends :LOW ; c:update") + more)
    with pytest.raises(KnowledgeError, match="extends itself"):
        load(tmp_path / "small.ttl")


def test_the_parameters_of_an_extended_behaviour_come_before_a_declared_one(tmp_path: Path) -> None:
    faults(tmp_path, f"{HEAD}}}")
    with (tmp_path / "small.ttl").open("a") as file:
        file.write(
            ":LOW a owl:NamedIndividual, c:Behavior ; c:level 2 ; c:index 1 ; c:extends :MOVE ; c:parameter :LOW.alpha ; "
            'c:update "INSERT {} WHERE { ?alpha :fits ?slot }" .\n'
            ":LOW.alpha a owl:NamedIndividual, c:Parameter ; c:index 3 ; c:termType :Tube .\n"
        )
    low, move = sorted(behaviors(load(tmp_path / "small.ttl")).values(), key=lambda behavior: behavior.name)
    assert [p.name for p in low.parameters] == [*(p.name for p in move.parameters), "?alpha"]
    (own,) = set(low.preconditions) - set(move.preconditions)
    assert "?alpha" in str(own)


def test_a_behaviour_can_extend_two_behaviours_that_extend_the_same_behaviour(tmp_path: Path) -> None:
    faults(tmp_path, f"{HEAD}}}")
    sides = {"LEFT": "?tube :fits ?slot", "RIGHT": "?tube :spot ?slot"}
    more = [
        f':{name} a owl:NamedIndividual, c:Behavior ; c:level 2 ; c:extends :MOVE ; c:update "INSERT {{}} WHERE {{ {said} }}" .'
        for name, said in sides.items()
    ]
    more.append(":BOTH a owl:NamedIndividual, c:Behavior ; c:level 2 ; c:extends :LEFT, :RIGHT .")
    with (tmp_path / "small.ttl").open("a") as file:
        file.write("\n".join(more))
    found = {local_name(iri): behavior for iri, behavior in behaviors(load(tmp_path / "small.ttl")).items()}
    assert found["BOTH"].effects == found["MOVE"].effects
    assert {*found["BOTH"].preconditions} == {*found["LEFT"].preconditions, *found["RIGHT"].preconditions}


def test_an_update_that_is_already_expanded_is_not_expanded_again(tmp_path: Path) -> None:
    said = only(tmp_path, f"{HEAD}}}")
    lines = load(tmp_path / "small.ttl").ntriples().splitlines(keepends=True)
    own = b"".join(line for line in lines if line.startswith(b"<https://example.org/small"))
    (tmp_path / "small.ttl").write_bytes(own)
    (found,) = behaviors(load(tmp_path / "small.ttl")).values()
    assert plainly(found) == plainly(said)


def test_a_behaviour_of_a_remote_store_is_read_from_the_text_of_its_update(tmp_path: Path) -> None:
    said = only(tmp_path, f"{HEAD}}}")
    path = tmp_path / "small.ttl"
    graph = KnowledgeGraph("https://example.org/small")
    for file in (ontology.ROOT / "core.ttl", path):
        read_into(graph, file, "asserted")
    remote = KnowledgeGraph(graph.scene, remote=Elsewhere(graph))
    (found,) = behaviors(remote).values()
    assert plainly(found) == plainly(said)


@dataclass
class Elsewhere:
    """A store that answers like an endpoint."""

    graph: KnowledgeGraph

    def query(self, query: str, prefixes: Mapping[str, str], bindings: Mapping[str, str], noted: bool = True) -> Answer:
        return self.graph.query(query, SCENE, **bindings)

    def confirm(self) -> None: ...


def test_validation_and_loading_report_a_fault_of_an_update_with_its_line(tmp_path: Path) -> None:
    assert faults(tmp_path, HEAD + ".\n ?tube :spto ?slot }")
    path = tmp_path / "small.ttl"
    (finding,) = (finding for finding in validate([path]) if finding.serious)
    assert finding.what.endswith("did you mean 'spot'? (line 2, column 8 of the update of MOVE)")
    line = next(n for n, text in enumerate(path.read_text().splitlines(), 1) if ":spto" in text)
    assert (finding.rule, finding.line, local_name(finding.node)) == ("update", line, "MOVE")
    with pytest.raises(KnowledgeError, match=r"small#MOVE>: :spto is .*\(line 2, column 8 of the update of MOVE\)"):
        load(path)


def test_a_price_about_the_terms_of_the_extended_behaviour_is_reported_with_both_terms(tmp_path: Path) -> None:
    confab.new_domain("far", tmp_path)
    with (tmp_path / "far.ttl").open("a", encoding="utf-8") as file:
        file.write(
            ":B1_RUSH a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 9 ; c:extends :B1_HURRY ; c:price :B1_HURRY.price ; "
            'c:update "INSERT {} WHERE {}" . '
            ":B1_HURRY a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 8 ; c:price :B1_HURRY.price ; "
            'c:update "INSERT { ?item :cleanliness :clean } WHERE { ?item a :Item . ?item :isAt ?where }" . '
            ":B1_HURRY.price a owl:NamedIndividual, c:Calculation ; c:about :B1_HURRY.where ; c:relation :far . "
            ":far a owl:DatatypeProperty, owl:NamedIndividual, c:Relation ; rdfs:domain :Place ; "
            "rdfs:range <http://www.w3.org/2001/XMLSchema#decimal> .\n"
        )
    with pytest.raises(
        KnowledgeError, match=r"called where: B1_HURRY\.where and B1_RUSH\.where; give each a name of its own"
    ):
        _ = confab.load(tmp_path / "far-scene.ttl").problem

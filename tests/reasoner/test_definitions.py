"""A class that is defined by situations becomes conditions, so membership follows the changes of the state."""

from dataclasses import replace
from pathlib import Path

import pytest

from confab.planner.paper.transitions import Model
from confab.planner.solve import Request, solve
from confab.planner.validation import LoggedState
from confab.reasoner.graph.inference import infer
from confab.reasoner.graph.knowledge import KnowledgeError, load
from confab.reasoner.reading.problem import Reading, read
from confab.reasoner.symbols import (
    AnyOf,
    ClassCondition,
    Condition,
    EqualityCondition,
    GroundBehavior,
    Symbol,
    ValueCondition,
    Witness,
)
from confab.reasoner.validation.validate import validate
from confab.reasoner.vocabulary import XSD
from tests.ontology.faults import skeleton

DIRTY = "c:about :B1_WASH.item ; c:situationType :CLEANLINESS ; c:value :dirty"


def scene(folder: Path, *definitions: str, asked: str = "Special") -> Path:
    """Write the skeleton, in which washing requires items of a class `asked` that the given axioms define."""
    path = skeleton(folder)
    domain = folder / "washing.ttl"
    text = domain.read_text()
    assert DIRTY in text
    text = text.replace(
        ":B1_WASH.isDirty a owl:NamedIndividual, c:ValueCondition",
        ":B1_WASH.isDirty a owl:NamedIndividual, c:ClassCondition",
    )
    text = text.replace(DIRTY, f"c:about :B1_WASH.item ; c:ofClass :{asked}")
    domain.write_text(text + "\n".join(definitions))
    return path


def defined(expression: str, name: str = "Special") -> str:
    return (
        f':{name} a owl:Class, owl:NamedIndividual ; rdfs:label "{name.lower()}" ; owl:equivalentClass {expression} .'
    )


def restriction(prop: str, said: str) -> str:
    return f"[ a owl:Restriction ; owl:onProperty {prop} ; {said} ]"


def both(*parts: str) -> str:
    return f"[ a owl:Class ; owl:intersectionOf ( {' '.join(parts)} ) ]"


IS_DIRTY = restriction(":cleanliness", "owl:hasValue :dirty")
AT_SINK = restriction(":isAt", "owl:someValuesFrom :Sink")
DIRTY_VALUE = ValueCondition("CLEANLINESS", ("?item",), "dirty")
AT_SOME_SINK = Witness("?item_isAt", "Sink", (ValueCondition("PLACE", ("?item",), "?item_isAt"),))
OTHERS = (ValueCondition("PLACE", ("?item",), "?where"), ClassCondition("?where", "Sink"))


def asked_of_item(path: Path) -> Condition:
    reading = read(load(path))
    conditions = reading.problem.domain.behaviors["B1_WASH"].preconditions
    return next(condition for condition in conditions if condition not in OTHERS)


@pytest.mark.parametrize(
    ("expression", "condition"),
    [
        (IS_DIRTY, DIRTY_VALUE),
        (AT_SINK, AT_SOME_SINK),
        (both(":Item", IS_DIRTY), AnyOf(((ClassCondition("?item", "Item"), DIRTY_VALUE),))),
        (f"[ a owl:Class ; owl:unionOf ( {IS_DIRTY} {AT_SINK} ) ]", AnyOf(((DIRTY_VALUE,), (AT_SOME_SINK,)))),
        (
            f"[ a owl:Class ; owl:complementOf {IS_DIRTY} ]",
            ValueCondition("CLEANLINESS", ("?item",), "dirty", negated=True),
        ),
        (
            restriction(":isAt", "owl:allValuesFrom :Sink"),
            Witness(
                "?item_isAt",
                "PLACE",
                (ValueCondition("PLACE", ("?item",), "?item_isAt"), ClassCondition("?item_isAt", "Sink", negated=True)),
                negated=True,
            ),
        ),
        (
            restriction(":isAt", "owl:someValuesFrom [ a owl:Class ; owl:oneOf ( :clean ) ]"),
            Witness(
                "?item_isAt",
                "PLACE",
                (
                    ValueCondition("PLACE", ("?item",), "?item_isAt"),
                    AnyOf(((EqualityCondition("?item_isAt", "clean"),),)),
                ),
            ),
        ),
    ],
)
def test_owl_expressions_become_conditions(tmp_path: Path, expression: str, condition: Condition) -> None:
    assert asked_of_item(scene(tmp_path, defined(expression))) == condition


def test_a_definition_may_name_another_one(tmp_path: Path) -> None:
    path = scene(tmp_path, defined(IS_DIRTY, "Dirty"), defined(both(":Item", ":Dirty")))
    assert asked_of_item(path) == AnyOf(((ClassCondition("?item", "Item"), DIRTY_VALUE),))


def test_an_inverse_property_swaps_the_individuals_of_the_condition(tmp_path: Path) -> None:
    occupied = restriction("[ owl:inverseOf :isAt ]", "owl:someValuesFrom :Plate")
    path = scene(tmp_path, defined(both(":Place", occupied)))
    text = (
        (tmp_path / "washing.ttl")
        .read_text()
        .replace("c:about :B1_WASH.item ; c:ofClass :Special", "c:about :B1_WASH.where ; c:ofClass :Special")
    )
    (tmp_path / "washing.ttl").write_text(text)
    (found,) = (c for c in read(load(path)).problem.domain.behaviors["B1_WASH"].preconditions if isinstance(c, AnyOf))
    assert found.alternatives[0][1] == Witness(
        "?where_isAt", "Plate", (ValueCondition("PLACE", ("?where_isAt",), "?where"),)
    )


def applicable(reading: Reading, item: str, **changes: str) -> bool:
    """Return whether an item can be washed in the initial state with some changes to the item."""
    model = Model(reading.problem)
    state = {**reading.problem.initial, **{Symbol(name, (item,)): value for name, value in changes.items()}}
    return model.apply(GroundBehavior(0, "B1_WASH", (item,)), model.values(state)) is not None


def test_membership_follows_the_state(tmp_path: Path) -> None:
    reading = read(load(scene(tmp_path, defined(both(":Item", IS_DIRTY)))))
    assert applicable(reading, "plate1", PLACE="sink")
    assert not applicable(reading, "plate1", PLACE="sink", CLEANLINESS="clean")
    assert not applicable(reading, "plate2", PLACE="sink")
    assert applicable(reading, "plate2", PLACE="sink", CLEANLINESS="dirty")


AT_LEAST_2 = f"""[ a rdfs:Datatype ; owl:onDatatype <{XSD}decimal> ;
    owl:withRestrictions ( [ <{XSD}minInclusive> 2.0 ] ) ]"""
BELOW_2 = f"[ a rdfs:Datatype ; owl:datatypeComplementOf {AT_LEAST_2} ]"


@pytest.mark.parametrize(
    ("values", "members"),
    [
        (f"owl:someValuesFrom {BELOW_2}", [True, False, False]),
        (f"owl:someValuesFrom [ a rdfs:Datatype ; owl:unionOf ( {BELOW_2} {BELOW_2} ) ]", [True, False, False]),
        (f"owl:someValuesFrom {AT_LEAST_2}", [False, True, False]),
        (f"owl:someValuesFrom <{XSD}decimal>", [True, True, False]),
        (f"owl:allValuesFrom {BELOW_2}", [True, False, True]),
        (f"owl:allValuesFrom {AT_LEAST_2}", [False, True, True]),
    ],
)
def test_some_number_in_a_data_range_requires_that_there_is_a_number(
    tmp_path: Path, values: str, members: list[bool]
) -> None:
    weighs = f":weighs a owl:DatatypeProperty, c:Relation ; rdfs:domain :Item ; rdfs:range <{XSD}decimal> ."
    path = scene(tmp_path, weighs, defined(both(":Item", IS_DIRTY, restriction(":weighs", values))))
    plates = ":plate1 d:weighs 1.0 . :plate2 d:weighs 3.0 . :plate3 a owl:NamedIndividual, d:Plate ; d:isAt :shelf ; "
    path.write_text(f"{path.read_text()} {plates} d:cleanliness d:clean .")
    reading = read(load(path))
    asked = [applicable(reading, f"plate{i}", PLACE="sink", CLEANLINESS="dirty") for i in (1, 2, 3)]
    assert asked == members


def test_a_parameter_of_a_defined_class_ranges_over_its_base_and_is_tested_in_the_state(tmp_path: Path) -> None:
    path = scene(tmp_path, defined(both(":Plate", IS_DIRTY)), asked="Plate")
    text = (tmp_path / "washing.ttl").read_text()
    old = ":B1_WASH.item a owl:NamedIndividual, c:Parameter ; c:index 1 ; c:termType :Item"
    assert old in text
    (tmp_path / "washing.ttl").write_text(text.replace(old, old.replace(":Item", ":Special")))
    reading = read(load(path))
    assert reading.problem.domain.behaviors["B1_WASH"].parameters[0].kind == "Plate"
    assert applicable(reading, "plate1", PLACE="sink")
    assert not applicable(reading, "plate1", PLACE="sink", CLEANLINESS="clean")


def test_inference_adds_no_members_to_a_class_that_changes(tmp_path: Path) -> None:
    graph = load(scene(tmp_path, defined(both(":Item", IS_DIRTY))))
    infer(graph, always=True)
    assert graph.select("SELECT ?x WHERE { ?x a <https://example.org/washing#Special> }") == []


def test_a_domain_with_definitions_is_valid(tmp_path: Path) -> None:
    assert [str(f) for f in validate([scene(tmp_path, defined(both(":Item", IS_DIRTY)))])] == []


def test_a_type_without_a_bounding_class_is_refused_by_name(tmp_path: Path) -> None:
    path = scene(tmp_path, defined(IS_DIRTY), asked="Plate")
    text = (tmp_path / "washing.ttl").read_text()
    (tmp_path / "washing.ttl").write_text(
        text.replace("c:index 1 ; c:termType :Item", "c:index 1 ; c:termType :Special")
    )
    with pytest.raises(KnowledgeError, match="Special is used as a type"):
        read(load(path))


def test_a_property_that_is_neither_situation_nor_relation_is_refused_by_name(tmp_path: Path) -> None:
    there = restriction(":liesBy", "owl:someValuesFrom :Sink")
    path = scene(tmp_path, ":liesBy a owl:ObjectProperty . " + defined(both(":Item", IS_DIRTY, there)))
    with pytest.raises(
        KnowledgeError, match="a definition uses liesBy, which is neither a value property nor a relation"
    ):
        read(load(path))


RULED = """@prefix : <https://example.org/port#> .
@prefix c: <https://w3id.org/confab/core#> .
@prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
<https://example.org/port> a owl:Ontology ; owl:imports <https://w3id.org/confab/core> ; c:symbolicOnly true .
:Box a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object ; c:hasSituationType :PAID, :CLEARED, :SEALED .
:PAID a owl:NamedIndividual, c:SituationType .
:CLEARED a owl:NamedIndividual, c:SituationType ; c:holdsOf :Cleared . :Cleared a owl:Class .
:CLEARED.rule a owl:NamedIndividual, c:Rule ; c:situationType :CLEARED ; c:about :CLEARED.box ; c:condition :CLEARED.paid .
:CLEARED.box a owl:NamedIndividual, c:Parameter ; c:index 1 ; c:termType :Box .
:CLEARED.paid a owl:NamedIndividual, c:ValueCondition ; c:about :CLEARED.box ; c:situationType :PAID .
:SEALED a owl:NamedIndividual, c:SituationType ; c:holdsOf :Sealed .
:Sealed a owl:Class ;
  owl:equivalentClass [ a owl:Class ; owl:intersectionOf ( :Box [ a owl:Class ; owl:complementOf :Cleared ] ) ] .
:PAY a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 1 ;
  c:update "INSERT { ?box :PAID true } WHERE { ?box a :Box . ?box :SEALED true }" .
:box1 a owl:NamedIndividual, :Box ; c:index 1 . :box2 a owl:NamedIndividual, :Box ; c:index 2 .
:fact a owl:NamedIndividual, c:SituatedObjectInstance ; c:about :box2 ; c:situationType :PAID .
[ a owl:AllDifferent ; owl:distinctMembers ( :box1 :box2 ) ] .
"""


def test_a_class_that_a_rule_concludes_may_be_named_in_another_definition(tmp_path: Path) -> None:
    """No individual is stated to be in the class.

    If the class were considered static, it would be empty, and each box would stay sealed.
    """
    path = tmp_path / "port.ttl"
    path.write_text(RULED)
    problem = read(load(path)).problem
    facts = LoggedState(problem, problem.initial)
    assert [facts.value("SEALED", (box,)) for box in ("box1", "box2")] == ["true", "false"]
    plan = solve(Request(replace(problem, goal={Symbol("SEALED", ("box1",)): "false"}))).plan
    assert plan is not None
    assert [step.behavior for step in plan.steps] == ["PAY"]


@pytest.mark.parametrize(
    ("expression", "members"),
    [
        (both(":Place", "[ a owl:Class ; owl:complementOf :Sink ]"), {"shelf", "table"}),
        (both(":Place", "[ a owl:Class ; owl:oneOf ( :hook :sink ) ]"), {"sink"}),
        (both(":Place", restriction(":near", "owl:allValuesFrom :Sink")), {"shelf", "table", "sink"}),
        (both(":Place", restriction(":near", f'owl:minCardinality "2"^^<{XSD}nonNegativeInteger>')), set()),
        (both(":Place", both("[ a owl:Class ; owl:complementOf :Sink ]", "[ a owl:Class ; owl:complementOf :Old ]")), {"table"}),
        (both(":Place", ":Sink"), {"sink"}),
    ],
)  # fmt: skip
def test_a_static_class_has_the_right_members_even_if_owl_rl_infers_none(
    tmp_path: Path, expression: str, members: set[str]
) -> None:
    """A class that names a static class is closed, too, and contains the individuals that are stated to be its members."""
    old = (
        defined(both(":Place", "[ a owl:Class ; owl:oneOf ( :hook ) ]"), "Old")
        + " :hook a owl:NamedIndividual, :Sink . <https://example.org/washing-scene#shelf> a :Old ."
    )
    near = ":near a owl:ObjectProperty, owl:NamedIndividual, c:Relation ; rdfs:domain :Place ; rdfs:range :Place ."
    odd = ":ODD a owl:NamedIndividual, c:SituationType ; c:holdsOf :Special . :Place c:hasSituationType :ODD ."
    path = scene(tmp_path, defined(expression), old, near, odd, asked="Item")
    infer(graph := load(path))
    problem = read(graph).problem
    facts = LoggedState(problem, problem.initial)
    assert {place for place in problem.classes["Place"] if facts.value("ODD", (place,)) == "true"} - {"hook"} == members


OF_THE_CLASS = ":Special c:hasSituationType :TIRED . :TIRED a owl:Class, owl:NamedIndividual, c:SituationType ."
OF_AN_ARGUMENT = (
    ":TIRED a owl:Class, owl:NamedIndividual, c:SituationType ; c:parameter :TIRED.1 . "
    ":TIRED.1 a owl:NamedIndividual, c:Parameter ; c:index 1 ; c:termType :Special ."
)


@pytest.mark.parametrize("tired", [OF_THE_CLASS, OF_AN_ARGUMENT])
def test_a_class_that_becomes_conditions_has_no_situation_type(tmp_path: Path, tired: str) -> None:
    path = scene(tmp_path, defined(both(":Item", "[ a owl:Class ; owl:complementOf :Sink ]")), tired)
    with pytest.raises(KnowledgeError, match="TIRED is a situation type of Special, but"):
        read(load(path))


def test_a_class_that_becomes_conditions_has_no_values(tmp_path: Path) -> None:
    below = ":Special rdfs:subClassOf :NEAR . :NEAR a owl:Class, owl:NamedIndividual, c:SituationType ."
    path = scene(tmp_path, defined(both(":Item", "[ a owl:Class ; owl:complementOf :Sink ]")), below)
    with pytest.raises(KnowledgeError, match="Special is a subclass of the situation type NEAR, but"):
        read(load(path))


def test_a_class_that_becomes_conditions_may_have_values_that_another_class_of_its_definition_contains(
    tmp_path: Path,
) -> None:
    close = ":Close a owl:Class, owl:NamedIndividual ; rdfs:subClassOf :Place, :NEAR . :hook a owl:NamedIndividual, :Close ."
    near = (
        ":NEAR a owl:Class, owl:NamedIndividual, c:SituationType ; c:valueProperty :near ; c:defaultValue :hook . "
        ":near a owl:ObjectProperty, owl:FunctionalProperty, owl:NamedIndividual . "
        ":Item c:hasSituationType :NEAR . :Special rdfs:subClassOf :NEAR ."
    )
    inner = both(":Close", "[ a owl:Class ; owl:complementOf :Sink ]")
    infer(graph := load(scene(tmp_path, defined(both(":Place", inner)), close, near, asked="Item")))
    assert read(graph).problem.classes["NEAR"] == ("hook",)


def test_a_rule_concludes_nothing_about_individuals_that_lack_its_situation_type() -> None:
    """The total adds up individuals of which a rule concludes D0, but no class of these individuals has D0."""
    problem = read(load(Path(__file__).parents[1] / "planner" / "cases" / "rule-of-another-class.ttl")).problem
    facts = LoggedState(problem, problem.initial)
    assert facts.value("S0", ("z3",)) == "0"
    assert facts.value("D0", ("a1",)) in (None, "false")

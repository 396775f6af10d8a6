"""Definitions of every kind in one small world: compared with HermiT, used in planning, and refused if unsupported."""

from collections.abc import Callable
from pathlib import Path
from random import Random

import pytest

from confab.planner.solve import Request, solve
from confab.planner.validation import LoggedState, validate
from confab.reasoner.graph.inference import infer
from confab.reasoner.graph.knowledge import KnowledgeError, load
from confab.reasoner.reading.goals import with_goals
from confab.reasoner.reading.problem import read
from confab.reasoner.reading.relevance import recognise
from confab.reasoner.symbols import EqualityCondition, RelationCondition, Rule, ValueCondition, Witness
from confab.reasoner.validation.validate import validate as check
from tests.planner import naive
from worlds.derivations import NAMES, compared, derived, first_problem, in_state
from worlds.entailed import CONCLUDED, DEFINED, PROPERTIES, atoms, domain, every, implies, random_state, some
from worlds.owlapi import jars, jvm

PUT = """
:PUT a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 1 ; c:update
  "INSERT { ?thing :liesIn ?place } WHERE { ?thing a :Thing . ?place a :Place FILTER(?thing != ?place) }" .
"""
STATE = """
:box1 :liesIn :room1 ; :weight 5 ; :cleanliness :clean . :box2 :liesIn :room1 ; :weight 1.5 ; :cleanliness :dirty .
:box3 :liesIn :room2 ; :weight 7 ; :cleanliness :clean . :cup1 :liesIn :room2 ; :cleanliness :clean .
:cup2 :liesIn :room2 ; :cleanliness :dirty . :cup3 :liesIn :room1 ; :cleanliness :clean .
:hand1 :near :room1 . :room1 :partOf :floor1 . :room2 :partOf :floor2 .
"""
Yard = Callable[[str], Path]


@pytest.fixture
def yard(tmp_path: Path) -> Yard:
    def written(more: str = "") -> Path:
        path = tmp_path / "yard.ttl"
        path.write_text("\n".join([domain(), PUT, STATE, more]), encoding="utf-8")
        return path

    return written


@pytest.mark.slow
@pytest.mark.skipif(not jars() or jvm() is None, reason="HermiT comes with the extra owlapi")
def test_planning_derives_exactly_the_facts_that_hermit_entails() -> None:
    true, wrong = compared(first_problem(), range(12))
    assert set(true) == {kind[1:] for kind, _ in DEFINED.values()} | {k[1:] for k in CONCLUDED.values()} | {*PROPERTIES}
    assert wrong == {"search": [], "checker": [], "plain Python": []}


@pytest.mark.parametrize("seed", range(4))
def test_planning_derives_exactly_the_facts_of_the_naive_interpreter(seed: int) -> None:
    problem = in_state(first_problem(), random_state(Random(seed)))
    truth = naive.complete(problem)
    plain = {s for s in truth if s.situation in problem.domain.rules and truth[s] == "true"}
    for _, found in derived(problem):
        assert found == {(NAMES[s.situation], *s.arguments) for s in plain}


@pytest.mark.parametrize(
    ("goal", "steps"),
    [
        ("box2 CROWDED", 2),
        ("room2 SPARSE", 2),
        ("cup2 GUARDED", 1),
        ("hand1 SEES cup1", 1),
        ("cup1 ON_FLOOR floor1", 1),
        ("box2 DEEP", 1),
        ("room1 CONTAINS cup2", 1),
    ],
)
def test_plans_achieve_defined_goals(yard: Yard, goal: str, steps: int) -> None:
    for reading in (read(load(yard(""))), recognise(load(yard("")), [goal])):
        plan = solve(Request(with_goals(reading.problem, [goal]))).plan
        assert plan is not None
        assert len(plan.steps) == steps


def rules(path: Path, situation: str) -> tuple[Rule, ...]:
    return read(load(path)).problem.domain.rules[situation]


def test_a_variable_of_a_swrl_rule_is_bound_by_a_value_or_becomes_a_witness(yard: Yard) -> None:
    more = implies(":sees ?h ?x", ":liesIn ?x ?p", ":liesIn ?y ?p", ":near ?h ?p", "different ?x ?y", ":Cup ?y")
    rule = next(rule for rule in rules(yard(more), "SEES") if len(rule.conditions) == 3)
    assert [term.name for term in rule.variables] == ["?p"]
    value, near, witness = rule.conditions
    assert value == ValueCondition("LIES_IN", ("?x",), "?p")
    assert near == RelationCondition("near", ("?h", "?p"))
    assert isinstance(witness, Witness)
    assert (witness.variable, witness.kind) == ("?y", "Cup")
    assert set(witness.conditions) == {
        EqualityCondition("?x", "?y", negated=True),
        ValueCondition("LIES_IN", ("?y",), "?p"),
    }


BUILT_IN = "http://www.w3.org/2003/11/swrlb#"


def counted(built_in: str, number: str) -> str:
    """Return a rule: a box is guarded if the double of its weight satisfies a comparison with a number."""
    x, w, s = (f"<urn:swrl:var#{name}>" for name in "xws")

    def atoms(*said: str) -> str:
        return "rdf:nil" if not said else f"[ a swrl:AtomList ; rdf:first {said[0]} ; rdf:rest {atoms(*said[1:])} ]"

    body = atoms(
        f"[ a swrl:DatavaluedPropertyAtom ; swrl:propertyPredicate :weight ; swrl:argument1 {x} ; swrl:argument2 {w} ]",
        f"[ a swrl:BuiltinAtom ; swrl:builtin <{BUILT_IN}add> ; swrl:arguments ( {s} {w} {w} ) ]",
        f"[ a swrl:BuiltinAtom ; swrl:builtin <{BUILT_IN}{built_in}> ; swrl:arguments ( {s} {number} ) ]",
    )
    head = atoms(f"[ a swrl:ClassAtom ; swrl:classPredicate :Guarded ; swrl:argument1 {x} ]")
    declared = "".join(f"{v} a swrl:Variable . " for v in (x, w, s))
    return f'{declared}[ a swrl:Imp ; rdfs:label "by weight" ; swrl:body {body} ; swrl:head {head} ] .'


@pytest.mark.parametrize(
    ("built_in", "guarded"),
    [("greaterThan", False), ("greaterThanOrEqual", True), ("equal", True), ("notEqual", False), ("lessThan", False)],
)
def test_amounts_are_computed_and_compared(yard: Yard, built_in: str, guarded: bool) -> None:
    problem = read(load(yard(counted(built_in, "14")))).problem
    assert (LoggedState(problem, problem.initial).value("GUARDED", ("box3",)) == "true") is guarded


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (implies(":sees ?h ?x", ":Hand ?h"), r"Hand\(\?h\) -> sees\(\?h, \?x\): the variable \?x of its head is in no atom"),
        (implies(":liesIn ?x :box1", ":Cup ?x"), "concludes liesIn, which is functional"),
        (implies(":Cup ?x", ":Box ?x"), "concludes Cup, and no situation type holds of that class"),
        (implies(":near ?h ?p", ":Hand ?h", ":Room ?p"), "concludes near; planning concludes classes"),
        (implies(":sees ?h ?x", ":knows ?h ?x"), "knows is neither the value property of a situation type nor a relation"),
        (counted("matches", "14"), "'by weight': planning doesn't evaluate swrlb:matches"),
        (counted("equal", "<urn:swrl:var#x>"), r"no atom determines the number \?x"),
        (counted("equal", "14 15"), "equal has 3 arguments there; wanted two"),
        (counted("subtract", ""), "subtract has 1 argument there; wanted a result and two numbers"),
        (implies(":sees ?h ?x", ":Hand ?h", ":liesIn ?x"), "liesIn has 1 argument there; wanted two"),
        (implies(":Cup ?x", ":liesIn ?x :box1").replace(atoms(":Cup ?x"), "rdf:nil"), "it has no head, so it forbids its body"),
    ],
)  # fmt: skip
def test_a_rule_that_planning_does_not_evaluate_is_refused_with_its_remedy(yard: Yard, more: str, said: str) -> None:
    with pytest.raises(KnowledgeError, match=said):
        read(load(yard(more)))


def test_the_inverse_of_a_property_may_be_a_subproperty_of_a_defined_one(yard: Yard) -> None:
    more = """[ owl:inverseOf :liesIn ] rdfs:subPropertyOf :hasIn . :hasIn a owl:ObjectProperty .
        :HAS_IN a owl:Class, owl:NamedIndividual, c:SituationType ; c:valueProperty :hasIn .
        :Place c:hasSituationType :HAS_IN . :Thing rdfs:subClassOf :HAS_IN ."""
    path = yard(more)
    infer(graph := load(path))
    problem = read(graph).problem
    state = LoggedState(problem, problem.initial)
    assert state.value("HAS_IN", ("room1", "cup3")) == "true"
    assert state.value("HAS_IN", ("room2", "cup3")) == "false"
    assert "definition-without-effect" not in {finding.rule for finding in check([path])}


NOT_CUP = "[ a owl:Class ; owl:complementOf :Cup ]"


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (":liesIn rdfs:subPropertyOf :near .", "facts of near follow from liesIn, since near is a relation"),
        (":near owl:inverseOf :liesIn .", "facts of near follow from the inverse of liesIn"),
        (":liesIn owl:equivalentProperty :cleanliness .", "liesIn and cleanliness are equivalent, since liesIn is functional"),
        (f":Odd owl:equivalentClass {NOT_CUP} .", "all members of Odd"),
        (f":Odd owl:equivalentClass [ a owl:Class ; owl:unionOf ( :Box {every(':Cup', NOT_CUP)} ) ] .", "all members of Odd"),
        (f":Odd owl:equivalentClass {every(':Box', some(':knows', 'owl:allValuesFrom :Cup'))} .", "all members of Odd"),
        (f":Odd owl:equivalentClass {every(':Box', NOT_CUP)}, {every(':Thing', NOT_CUP)} .", "all members of Odd"),
        (f":Odd owl:equivalentClass {every(':Box', NOT_CUP)} .", ""),
    ],
)  # fmt: skip
def test_an_axiom_that_planning_does_not_evaluate_is_an_error(yard: Yard, more: str, said: str) -> None:
    uses = """:Odd a owl:Class, owl:NamedIndividual . :USED a owl:Class, owl:NamedIndividual, c:SituationType .
        :Thing c:hasSituationType :USED . :USED.rule a owl:NamedIndividual, c:Rule ;
        c:construct "CONSTRUCT { ?x :USED true } WHERE { ?x a :Odd }" ."""
    findings = [one for one in check([yard(uses + more)]) if one.rule == "definition-without-effect"]
    assert [one.what for one in findings if said in one.what] == [one.what for one in findings]
    assert len(findings) == bool(said)


@pytest.mark.parametrize("kind", [":Box", every(":Thing", some(":liesIn", "owl:hasValue :room1"))])
def test_two_names_of_one_class_are_no_fault(yard: Yard, kind: str) -> None:
    of = f":Odd a owl:Class, owl:NamedIndividual ; owl:equivalentClass {kind} . :Same a owl:Class ; owl:equivalentClass :Odd ."
    said = {one.rule for one in check([yard(of)])}
    assert not said & {"subclass-cycle", "axiom-not-watched"}


@pytest.mark.parametrize("number", ["-1", '"several"'])
def test_a_class_counts_whole_numbers(yard: Yard, number: str) -> None:
    path = yard("")
    path.write_text(path.read_text().replace('"2"^^xsd:nonNegativeInteger', number))
    with pytest.raises(KnowledgeError, match=r"values; wanted a whole number"):
        read(load(path))


def test_a_class_counts_up_to_five(yard: Yard) -> None:
    path = yard("")
    path.write_text(path.read_text().replace('"2"^^xsd:nonNegativeInteger', '"9"^^xsd:nonNegativeInteger'))
    with pytest.raises(KnowledgeError, match=r"counts up to 9 values of \w+; planning counts only up to 5"):
        read(load(path))


KEPT = """
:KEPT a owl:NamedIndividual, c:SituationType ; c:holdsOf :{held} . :Thing c:hasSituationType :KEPT .
:Kept a owl:Class ; owl:equivalentClass [ a owl:Class ; owl:intersectionOf ( :Thing
  [ a owl:Restriction ; owl:onProperty :liesIn ; owl:someValuesFrom
    [ a owl:Class ; owl:unionOf ( [ a owl:Class ; owl:oneOf ( :box1 ) ] :{inner} ) ] ] ) ] .
:Other a owl:Class ; owl:equivalentClass [ a owl:Class ; owl:intersectionOf ( :Thing {other} ) ] .
"""


def test_a_goal_on_a_recursively_defined_class_is_achieved(yard: Yard) -> None:
    path = yard(KEPT.format(held="Kept", inner="Kept", other="[ a owl:Class ; owl:complementOf :Kept ]"))
    problem = with_goals(read(load(path)).problem, ["cup1 KEPT", "cup1 LIES_IN box3"])
    plan = solve(Request(problem)).plan
    assert plan is not None
    assert len(plan.steps) == 2  # the cup is put into the third box, and this box into the first
    assert validate(problem, plan) == []


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (KEPT.format(held="Other", inner="Kept", other=":Kept"), "Kept is defined by itself; define a situation type"),
        (
            KEPT.format(held="Kept", inner="Other", other="[ a owl:Class ; owl:complementOf :Kept ]")
            + ":OTHER a owl:NamedIndividual, c:SituationType ; c:holdsOf :Other . :Thing c:hasSituationType :OTHER .",
            "KEPT follows if OTHER is false|OTHER follows if KEPT is false",
        ),
    ],
)  # fmt: skip
def test_a_recursive_class_without_situation_type_or_through_negation_is_refused(
    yard: Yard, more: str, said: str
) -> None:
    with pytest.raises(KnowledgeError, match=said):
        read(load(yard(more)))

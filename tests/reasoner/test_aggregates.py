"""Derived amounts: sums and counts that effects maintain, maxima and minima as conditions, and rules as CONSTRUCT queries."""

from dataclasses import replace
from pathlib import Path

import pytest

import confab
from confab import ontology
from confab.planner.plan import Status
from confab.planner.validation import validate
from confab.reasoner.aggregates.compiling import compiled
from confab.reasoner.aggregates.dependencies import unfolded
from confab.reasoner.aggregates.totals import with_totals
from confab.reasoner.graph.knowledge import KnowledgeError, load
from confab.reasoner.reading.problem import read
from confab.reasoner.symbols import Symbol
from worlds.interpreter import Interpreter, TooManyStatesError
from worlds.mixed import mixed

SEEDS = (
    0,
    2,
    3,
    12,
    13,
    14,
    16,
    18,
    21,
    22,
    23,
    25,
    28,
    30,
    36,
    37,
    39,
    40,
    44,
    45,
    20061,
)  # these worlds have derived amounts
STATES = 300
CONSTRUCTED = '''
d:OVER a owl:Class, owl:NamedIndividual, c:SituationType . d:Cart c:hasSituationType d:OVER .
d:OVER.rule a owl:NamedIndividual, c:Rule ; c:construct """
  CONSTRUCT { ?cart d:OVER true }
  WHERE { ?cart a d:Cart ; d:load ?load . ?crate a d:Crate ; d:in ?cart ; d:bears ?bears FILTER(?load > ?bears) }""" .
'''


@pytest.mark.parametrize("seed", SEEDS)
def test_effects_keep_each_total_as_its_rule_derives_it_in_every_state(seed: int) -> None:
    derived = mixed(seed).problem
    level = derived.domain.levels[-1]
    aggregates = {
        name: unfolded(one, derived.domain.rules, derived.domain.situations)
        for name, one in derived.domain.aggregates.items()
    }
    domain = compiled(replace(derived.domain, aggregates=aggregates), derived.classes)
    extrema = {name for name, one in derived.domain.aggregates.items() if not one.kept}
    situations = {name: kind for name, kind in domain.situations.items() if name not in extrema}
    kept = replace(
        derived,
        domain=replace(domain, situations=situations, aggregates={}),
        initial=with_totals(domain, derived.classes, derived.relations, derived.initial),
    )
    by_rules, by_effects = Interpreter(replace(derived, goal={})), Interpreter(replace(kept, goal={}))
    symbols = [s for s in by_rules.slots if s.situation not in extrema]
    try:
        meant, got = by_rules.explored(level, STATES, rests=False), by_effects.explored(level, STATES, rests=False)
    except TooManyStatesError:
        pytest.skip("too many states to compare")
    states = [
        {
            tuple(str(interpreter.value(state, symbol)) for symbol in symbols): cost
            for (state, _), cost in truth.costs.items()
        }
        for interpreter, truth in ((by_rules, meant), (by_effects, got))
    ]
    assert states[0] == states[1]


def test_a_rule_reads_the_same_as_a_query_and_as_individuals(tmp_path: Path) -> None:
    domain = load("carts-small").files["https://w3id.org/confab/carts"].read_text("utf-8")
    query = """:STOCK.rule a owl:NamedIndividual, c:Rule ; c:construct \"\"\"
      CONSTRUCT { ?rack :stock ?stock } WHERE {
        SELECT ?rack (COUNT(?crate) AS ?stock) WHERE { ?rack a :Rack . ?crate a :Crate ; :in ?rack } GROUP BY ?rack }\"\"\" ."""
    begin = domain.index(":STOCK.rule a")
    other = domain[:begin] + query + "\n" + domain[domain.index("#####", begin) :]
    scene = ontology.ROOT / "scenes" / "carts-small.ttl"
    (tmp_path / "carts.ttl").write_text(other, "utf-8")
    (tmp_path / "scene.ttl").write_text(scene.read_text("utf-8"), "utf-8")
    uri = '<uri name="https://w3id.org/confab/carts" uri="carts.ttl"/>'
    catalog = f'<catalog xmlns="urn:oasis:names:tc:entity:xmlns:xml:catalog">{uri}</catalog>'
    (tmp_path / "catalog-v001.xml").write_text(catalog, "utf-8")
    written, queried = read(load(scene)).problem, read(load(tmp_path / "scene.ttl")).problem
    assert written.domain.aggregates["STOCK"] == queried.domain.aggregates["STOCK"]
    assert written.initial == queried.initial
    assert written.domain.behaviors == queried.domain.behaviors


def test_a_rule_without_an_aggregate_is_a_query_too(tmp_path: Path) -> None:
    scene = (ontology.ROOT / "scenes" / "carts-small.ttl").read_text("utf-8")
    file = tmp_path / "scene.ttl"
    file.write_text(scene + CONSTRUCTED, "utf-8")
    (rule,) = read(load(file)).problem.domain.rules["OVER"]
    assert rule.parameters[0].kind == "Cart"
    assert [condition.kind for condition in rule.conditions] == ["Crate"]  # type: ignore[union-attr]


def test_the_checker_calculates_a_total_from_its_rule() -> None:
    scene = confab.load("carts-small")
    result = scene.plan()
    assert result.outcome.status is Status.SOLVED
    problem, plan = result.problem, result.plan
    assert validate(problem, plan) == []
    effects = {name: replace(one, amounts=()) for name, one in problem.domain.behaviors.items()}
    unkept = replace(problem, domain=replace(problem.domain, behaviors=effects))
    assert validate(unkept, plan) == []  # no effect maintains the totals, and all totals have their goal values
    heavy = {symbol: ("9" if symbol == Symbol("STOCK", ("shop",)) else v) for symbol, v in problem.initial.items()}
    assert validate(replace(problem, initial=heavy), plan) == []  # stated totals are ignored, too
    full = replace(problem, goal={Symbol("STOCK", ("store",)): ">=1"})
    assert [fault.text for fault in validate(full, plan)] == [
        "the goal <store, STOCK> = >=1 isn't reached: it is 0 in the end"
    ]


def test_a_changed_fact_changes_the_amounts_that_are_derived_from_it() -> None:
    moved = confab.load("carts-small").with_fact("books IN cart").problem
    assert moved.initial[Symbol("LOAD", ("cart",))] == "7"
    assert moved.initial[Symbol("STOCK", ("store",))] == "2"


LAMPS = """
@prefix : <https://example.org/lamps#> .
@prefix c: <https://w3id.org/confab/core#> .
@prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
@prefix skos: <http://www.w3.org/2004/02/skos/core#> .
@prefix xsd: <http://www.w3.org/2001/XMLSchema#> .
@prefix dcterms: <http://purl.org/dc/terms/> .
<https://example.org/lamps> a owl:Ontology ; owl:imports <https://w3id.org/confab/core> ; c:symbolicOnly true .
:Lamp a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object ; c:hasSituationType :ON .
:ON a owl:Class, owl:NamedIndividual, c:SituationType .
:House a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object ; c:hasSituationType :LAMPS .
:LAMPS a owl:NamedIndividual, c:SituationType, c:Amount ; c:valueProperty :lamps ; c:mostAmount 1 .
:lamps a owl:DatatypeProperty, owl:FunctionalProperty, owl:NamedIndividual ; rdfs:domain :House ; rdfs:range xsd:integer .
:LAMPS.rule a owl:NamedIndividual, c:Rule ;
  c:construct '''CONSTRUCT { ?h :lamps ?n } WHERE {
    SELECT ?h (COUNT(?l) AS ?n) WHERE { ?h a :House . ?l a :Lamp ; :ON true } GROUP BY ?h }''' .
:B1_ON a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 1 ;
  c:update "INSERT { ?l :ON true } WHERE { ?l a :Lamp . ?l :ON false }" .
:house a owl:NamedIndividual, :House ; c:index 1 .
:l1 a owl:NamedIndividual, :Lamp ; c:index 2 .
:l2 a owl:NamedIndividual, :Lamp ; c:index 3 .
[ a owl:AllDifferent ; owl:distinctMembers ( :l1 :l2 ) ] .
:task a owl:NamedIndividual, c:Task ; c:goal :task.one, :task.two .
:task.one a owl:NamedIndividual, c:ValueCondition ; c:about :l1 ; c:situationType :ON ; c:value c:true .
:task.two a owl:NamedIndividual, c:ValueCondition ; c:about :l2 ; c:situationType :ON ; c:value c:true .
"""
"""The goal requires that two lamps are on, but at most one lamp of a house may be on; only the count mentions the house."""


def test_the_bound_of_a_count_holds_even_if_no_goal_and_no_behaviour_names_its_individual(tmp_path: Path) -> None:
    (tmp_path / "lamps.ttl").write_text(LAMPS)
    outcome = confab.load(tmp_path / "lamps.ttl").plan().outcome
    assert outcome.status is Status.UNSOLVABLE
    (tmp_path / "more.ttl").write_text(LAMPS.replace("c:mostAmount 1", "c:mostAmount 2"))
    assert confab.load(tmp_path / "more.ttl").plan().plan.length == {1: 2}


DIMMED = """
:Dimmable a owl:Class, owl:NamedIndividual ; rdfs:subClassOf :Lamp ; c:hasSituationType :DIM .
:DIM a owl:Class, owl:NamedIndividual, c:SituationType .
:l3 a owl:NamedIndividual, :Dimmable ; c:index 4 .
"""


def test_a_count_of_a_false_situation_leaves_out_the_individuals_that_lack_the_situation_type(tmp_path: Path) -> None:
    bright = LAMPS.replace(":ON true } GROUP", ":ON true ; :DIM false } GROUP")
    bright = bright.replace(":ON false }", ":ON false FILTER NOT EXISTS { ?l :DIM true } }") + DIMMED
    assert bright.count(":DIM false } GROUP") == bright.count(":DIM true }") == 1
    (tmp_path / "lacking.ttl").write_text(bright)
    (tmp_path / "having.ttl").write_text(bright.replace(", :Lamp ;", ", :Dimmable ;"))
    assert confab.load(tmp_path / "lacking.ttl").plan().plan.length == {1: 2}
    assert confab.load(tmp_path / "having.ttl").plan().outcome.status is Status.UNSOLVABLE


def test_a_count_is_0_for_an_individual_outside_of_the_class_that_its_rule_names(tmp_path: Path) -> None:
    villas = (
        LAMPS.replace("?h a :House", "?h a :Villa")
        + ":Villa a owl:Class, owl:NamedIndividual ; rdfs:subClassOf :House ."
    )
    dark = villas.replace(":ON false }", ":ON false . ?h a :House ; :lamps ?n FILTER(?n = 0) }")
    (tmp_path / "house.ttl").write_text(dark)
    (tmp_path / "villa.ttl").write_text(
        dark.replace(":house a owl:NamedIndividual, :House", ":house a owl:NamedIndividual, :Villa")
    )
    scene = confab.load(tmp_path / "house.ttl")
    assert scene.problem.initial[Symbol("LAMPS", ("house",))] == "0"
    assert scene.plan().plan.length == {1: 2}
    assert confab.load(tmp_path / "villa.ttl").plan().outcome.status is Status.UNSOLVABLE


WATTS = ":watts a owl:DatatypeProperty, owl:NamedIndividual, c:Relation ; rdfs:domain :Lamp ; rdfs:range xsd:integer ."


def test_a_maximum_with_a_bound_and_a_goal_about_one_in_words_are_refused(tmp_path: Path) -> None:
    (tmp_path / "bound.ttl").write_text(
        LAMPS.replace("COUNT(?l)", "MAX(?w)").replace(":ON true } GROUP", ":ON true ; :watts ?w } GROUP") + WATTS
    )
    with pytest.raises(KnowledgeError, match="LAMPS is a max with bounds, but planning can't enforce"):
        confab.load(tmp_path / "bound.ttl").plan()
    with pytest.raises(KnowledgeError, match="HEAVIEST is a max; state such a goal in the scene"):
        confab.load("carts-small").plan("cart HEAVIEST >=1")


def test_a_goal_about_a_maximum_is_told_as_its_comparison(tmp_path: Path) -> None:
    of_watts = LAMPS.replace("COUNT(?l)", "MAX(?w)").replace(":ON true } GROUP", ":ON true ; :watts ?w } GROUP")
    before, _, after = of_watts.replace(" ; c:mostAmount 1 .", " .").partition(":task a ")
    assert after
    goal = ":task a owl:NamedIndividual, c:Task ; c:goal :task.one . :task.one a owl:NamedIndividual, c:Comparison ;"
    goal += ' c:about :house ; c:situationType :LAMPS ; c:sign ">=" ; c:amount 80.0'
    for name, end in (("hard", " ."), ("soft", " ; c:weight 1 .")):
        (tmp_path / f"{name}.ttl").write_text(f"{before}{WATTS} :l1 :watts 40 . :l2 :watts 60 . {goal}{end}")
    scene = confab.load(tmp_path / "hard.ttl")
    outcome = scene.plan().outcome
    assert outcome.status is Status.UNSOLVABLE
    assert outcome.reason is not None and outcome.reason.text.startswith("house LAMPS >= 80 can't be reached")
    assert "The goal requires that house LAMPS at least 80; this never holds." in str(scene.plan().explain())
    (left,) = confab.load(tmp_path / "soft.ttl").plan().outcome.forgone
    assert ", which means house LAMPS >= 80 (weight 1" in str(left)


@pytest.mark.parametrize(
    ("sign", "number", "reason"),
    [
        (">=", 6, "house LAMPS >= 6 can't be reached: l1 WATER is at least 0 and at most 5"),
        ("<", 3, "no behaviour of level 1 takes l1 WATER below 3; so l1 WATER >=3 always holds"),
    ],
)
def test_the_reason_of_an_extremum_is_a_bound_or_that_no_behaviour_changes_an_amount(
    tmp_path: Path, sign: str, number: int, reason: str
) -> None:
    goal = ":task a owl:NamedIndividual, c:Task ; c:goal :task.one . :task.one a owl:NamedIndividual, c:Comparison ;"
    goal += f' c:about :house ; c:situationType :LAMPS ; c:sign "{sign}" ; c:amount {number}.0 .'
    water = """
:Lamp c:hasSituationType :WATER .
:WATER a owl:NamedIndividual, c:SituationType, c:Amount ; c:valueProperty :water ; c:leastAmount 0.0 ; c:mostAmount 5.0 .
:water a owl:DatatypeProperty, owl:FunctionalProperty, owl:NamedIndividual ; rdfs:domain :Lamp ; rdfs:range xsd:integer .
:B1_FILL a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 2 ;
  c:update "DELETE { ?l :water ?m } INSERT { ?l :water ?n } WHERE { ?l a :Lamp ; :water ?m BIND(?m + 1 AS ?n) }" .
:l1 :water 3 . :l2 :water 4 .
"""
    of_water = LAMPS.replace("COUNT(?l)", "MIN(?w)").replace("?l a :Lamp ; :ON true }", "?l a :Lamp ; :water ?w }")
    before, _, after = of_water.replace(" ; c:mostAmount 1 .", " .").partition(":task a ")
    assert after
    (tmp_path / "lamps.ttl").write_text(before + water + goal)
    outcome = confab.load(tmp_path / "lamps.ttl").plan().outcome
    assert outcome.status is Status.UNSOLVABLE
    assert outcome.reason is not None and reason in outcome.reason.text

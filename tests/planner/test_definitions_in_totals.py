"""Totals, constraints and remembered situations that read defined situations mean what the definitions mean elsewhere."""

from pathlib import Path

import pytest

import confab
from confab.planner.plan import Status

CASES = Path(__file__).parent / "cases"
DARK = (CASES / "dark-houses.ttl").read_text("utf-8")
"""A house is dark if no lamp is in a kitchen; lamp l1 is in kitchen k1 and has to go to room r, and lamp l2 is in kitchen k2."""
COLD = (CASES / "cold-houses.ttl").read_text("utf-8")
"""A house is cold if it isn't heated; a barn is a building, but no house. Two buildings must not be cold."""
NEVER, WANTED = "c:never true", ":l1 ; c:situationType :AT ; c:value :r"
COUNTED = """:N a owl:NamedIndividual, c:SituationType, c:Amount ; c:valueProperty :n . :House c:hasSituationType :N .
:n a owl:DatatypeProperty, owl:FunctionalProperty, owl:NamedIndividual ; rdfs:domain :House ; rdfs:range xsd:integer .
:N.rule a owl:NamedIndividual, c:Rule ; c:construct '''CONSTRUCT { ?c :n ?x }
  WHERE { SELECT ?c (COUNT(?h) AS ?x) WHERE { ?c a :House . ?h a :House ; :DARK true } GROUP BY ?c }''' .
:task c:goal :all . :all a owl:NamedIndividual, c:Comparison ; c:about :house ; c:situationType :N ; c:sign '=' ; c:amount 1.0 .
"""
REMEMBERED = """:House c:hasSituationType :WAS . :WAS a owl:Class, owl:NamedIndividual, c:SituationType ; c:remembers :DARK .
:task c:goal :was . :was a owl:NamedIndividual, c:ValueCondition ; c:about :house ; c:situationType :WAS .
"""
UNION = (
    "FILTER NOT EXISTS { ?l a :Lamp ; :at ?r . ?r a :Kitchen }",
    "{ ?l a :Lamp ; :at ?q . ?q a :Cellar } UNION { :l1 :at :r }",
)


def planned(folder: Path, text: str, *changes: tuple[str, str], more: str = "") -> tuple[Status, int]:
    """Return the status and the number of primitives of a plan for a scene with some changes."""
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / "scene.ttl").write_text(text + more, "utf-8")
    result = confab.load(folder / "scene.ttl").plan()
    return result.outcome.status, len(result.plan.primitives) if result.outcome.plan is not None else 0


@pytest.mark.parametrize(
    ("changes", "more", "wanted"),
    [
        ([], "", (Status.SOLVED, 1)),
        ([(f" ; {NEVER}", "")], COUNTED, (Status.SOLVED, 2)),
        ([(f" ; {NEVER}", "")], REMEMBERED, (Status.SOLVED, 2)),
        (
            [
                (NEVER, "c:always true"),
                (":at :k1", ":at :r"),
                (":at :k2", ":at :r"),
                (WANTED, WANTED.replace(":r", ":k1")),
            ],
            "",
            (Status.UNSOLVABLE, 0),
        ),
        (
            [UNION],
            ":Cellar a owl:Class, owl:NamedIndividual ; rdfs:subClassOf :Room .",
            (Status.UNSOLVABLE, 0),
        ),
    ],
    ids=["never", "counted", "remembered", "always", "union with an empty class"],
)
def test_variables_of_a_definition_are_local_to_its_braces(
    changes: list[tuple[str, str]], more: str, wanted: tuple[Status, int], tmp_path: Path
) -> None:
    assert planned(tmp_path, DARK, *changes, more=more) == wanted


def test_a_total_counts_no_individual_that_lacks_the_defined_situation_type_as_false(tmp_path: Path) -> None:
    assert planned(tmp_path, COLD) == (Status.UNSOLVABLE, 0)
    assert planned(tmp_path, COLD, ("c:amount 2.0", "c:amount 1.0")) == (Status.SOLVED, 1)


def test_a_constraint_holds_of_individuals_that_lack_the_defined_situation_type(tmp_path: Path) -> None:
    bad = """:City c:hasSituationType :BAD . :BAD a owl:Class, owl:NamedIndividual, c:SituationType ; c:never true .
:BAD.rule a owl:NamedIndividual, c:Rule ; c:construct '''CONSTRUCT { ?c :BAD true }
  WHERE { ?c a :City . ?h a :Building ; :COLD false ; :HEATED true }''' .
"""
    goal = 'c:Comparison ; c:about :city ; c:situationType :N ; c:sign "=" ; c:amount 2.0'
    heated = "c:ValueCondition ; c:about :barn ; c:situationType :HEATED"
    assert planned(tmp_path, COLD, (goal, heated), more=bad) == (Status.SOLVED, 1)


def test_a_variable_of_a_negated_precondition_is_another_one_in_each_firing_of_an_effect(tmp_path: Path) -> None:
    """Two lamps at different powered rooms go on in one step, so that the number of pairs of lamps that are on becomes 2."""
    assert planned(tmp_path, (CASES / "pairs-of-lamps.ttl").read_text("utf-8")) == (Status.SOLVED, 1)


WARM = (CASES / "warm-rooms.ttl").read_text("utf-8")
"""A warm room is a room whose temperature is warm; both rooms are cold, and a step of cost 7 changes the temperature of a room."""
STEP = ":B1 a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 1 ; c:update '''{}''' .\n"
MOVE = STEP.format("INSERT { ?l :at ?r } WHERE { ?l a :Lamp . ?r a :Room }")
NO_LAMP = "FILTER NOT EXISTS { ?o a :Lamp ; :at ?v . ?v a :WarmRoom }"
LAMP = """:task.o a owl:NamedIndividual, c:Variable ; c:termType :Lamp .
:task.v a owl:NamedIndividual, c:Variable ; c:termType :WarmRoom .
:task.c a owl:NamedIndividual, c:ValueCondition ; c:about :task.o ; c:situationType :AT ; c:value :task.v .
:task.one a owl:NamedIndividual, c:Witness ; c:witness :task.o ; c:condition :task.c """
FINISHED = ":task.one a owl:NamedIndividual, c:ValueCondition ; c:about :house ; c:situationType :FIN .\n"
COUNTED_LAMPS = (
    """:House c:hasSituationType :N . :N a owl:NamedIndividual, c:SituationType, c:Amount ; c:valueProperty :n .
:n a owl:DatatypeProperty, owl:FunctionalProperty, owl:NamedIndividual ; rdfs:domain :House ; rdfs:range xsd:integer .
:N.rule a owl:NamedIndividual, c:Rule ; c:construct '''CONSTRUCT { ?h :n ?z }
  WHERE { SELECT ?h (COUNT(?x) AS ?z) WHERE { ?h a :House . ?x a :Lamp """
    + NO_LAMP
    + """ } GROUP BY ?h }''' .
:task.one a owl:NamedIndividual, c:Comparison ; c:about :house ; c:situationType :N ; c:sign "=" ; c:amount 1.0 .
"""
)
EXISTS = STEP.format("INSERT { ?h :FIN true } WHERE { ?h a :House " + NO_LAMP + " }")


@pytest.mark.parametrize(
    ("more", "steps"),
    [
        (MOVE + LAMP + "; c:negated true .", 0),
        (MOVE + LAMP + ".", 1),
        (COUNTED_LAMPS, 0),
        (EXISTS + FINISHED, 1),
    ],
    ids=["goal of no lamp", "goal of some lamp", "count", "precondition"],
)
def test_the_class_of_a_variable_is_required_where_the_variable_is_determined(
    more: str, steps: int, tmp_path: Path
) -> None:
    assert planned(tmp_path, WARM, more=more) == (Status.SOLVED, steps)

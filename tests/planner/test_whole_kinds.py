"""A class in place of an individual stands for all members of the class: in conditions, effects and goals.

The theatre was written from docs/authoring.md alone; a simulator that shares no code with the planner executes its plans.
"""

from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import pytest

from confab.planner.hierarchical.operators import named
from confab.planner.plan import Step
from confab.planner.solve import Request, solve
from confab.reasoner.graph.knowledge import KnowledgeError, load
from confab.reasoner.reading.problem import read
from confab.reasoner.reading.relevance import recognise
from confab.reasoner.symbols import Symbol
from confab.reasoner.validation.validate import validate

THEATRE = Path(__file__).parents[2] / "docs" / "examples" / "theatre"
Theatre = Callable[[str, str], Path]


@pytest.fixture
def theatre(tmp_path: Path) -> Theatre:
    def changed(old: str, new: str) -> Path:
        for file in THEATRE.glob("*.ttl"):
            text = file.read_text(encoding="utf-8")
            (tmp_path / file.name).write_text(text.replace(old, new), encoding="utf-8")
        return tmp_path / "first-night.ttl"

    return changed


class Stage:
    """The theatre, written without any code of the planner."""

    def __init__(self) -> None:
        self.at = {"crown": "store", "skull": "store", "sword": "store", "chair": "store", "cloud": "attic"}
        self.cart, self.load, self.lit = "stage", set[str](), set[str]()
        self.hours = {"spot1": Fraction(2), "spot2": Fraction(1, 2), "flood": Fraction(1)}

    def do(self, step: Step) -> None:
        match step.behavior, step.arguments:
            case "LOAD", (_, prop):
                assert self.at[prop] == self.cart
                assert prop not in self.load
                assert len(self.load) < 3
                self.load.add(prop)
            case "UNLOAD", (_, prop):
                self.load.remove(prop)
            case "PUSH", (_, room):
                assert room != self.cart
                self.cart = room
                self.at |= dict.fromkeys(self.load, room)
            case "SWITCH", (circuit,):
                assert set(self.at.values()) == {"stage"}
                assert not self.load
                for lamp in {"front": ("spot1", "spot2"), "back": ("flood",)}[circuit]:
                    assert self.hours[lamp] >= Fraction(1, 2)
                    self.lit.add(lamp)
            case other:
                raise AssertionError(other)


@pytest.mark.parametrize("mode", ["guarded", "optimal", "paper"])
def test_all_objects_on_the_cart_move_with_it_and_every_lamp_is_lit(mode: str) -> None:
    stage, plan = Stage(), solve(Request(recognise(load(THEATRE / "first-night.ttl")).problem, mode)).plan
    assert plan is not None
    for step in plan.steps:
        stage.do(step)
    assert stage.lit == {"spot1", "spot2", "flood"}
    assert not stage.load
    assert mode != "optimal" or len(plan.steps) == 17


def test_a_goal_for_all_of_a_class_is_one_for_each() -> None:
    problem = read(load(THEATRE / "first-night.ttl")).problem
    wanted = {Symbol("LIT", (lamp,)): "true" for lamp in problem.classes["Lamp"]}
    assert problem.goal == wanted | {Symbol("STOWED", (prop,)): "false" for prop in problem.classes["Prop"]}


def test_one_member_that_violates_a_condition_on_its_class_prevents_the_step(theatre: Theatre) -> None:
    goal = ":night.off"
    path = theatre(f"c:goal :night.lit, {goal}", "c:goal :night.lit")
    for old, status in (("d:hours 0.5", "SOLVED"), ("d:hours 0.4", "UNSOLVABLE")):
        path.write_text(path.read_text().replace("d:hours 0.5", old))
        assert solve(Request(read(load(path)).problem)).status.name == status


def test_the_slice_contains_all_members_of_a_class_that_a_goal_names(theatre: Theatre) -> None:
    more = ":lantern a owl:NamedIndividual, d:Lamp ; c:index 15 ; d:hangsOn :front ; d:hours 1.0 .\n:night a"
    path = theatre(":night a", more)
    assert "lantern" in recognise(load(path)).problem.classes["Lamp"]


def test_the_theatre_is_valid() -> None:
    assert [str(f) for f in validate([THEATRE / "first-night.ttl"]) if f.severity != "remark"] == []


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (":Prop ; c:situationType :AT ; c:value :stage", ":Prop ; c:situationType :AT ; c:value :Room", "the class Room as the"),
        ("d:Prop ; c:situationType d:STOWED", "d:Stowed ; c:situationType d:STOWED", "a class that situations define"),
        (":Prop ; c:situationType :STOWED ;", ":Prop ; c:situationType :LADEN ; c:value :Prop ;", "names the class Prop twice"),
    ],
)  # fmt: skip
def test_invalid_uses_of_a_class_in_place_of_an_individual_are_refused(
    theatre: Theatre, old: str, new: str, said: str
) -> None:
    with pytest.raises(KnowledgeError, match=said):
        read(load(theatre(old, new)))


def test_validation_names_a_class_that_never_has_the_situation_type(theatre: Theatre) -> None:
    found = [f.what for f in validate([theatre("c:about d:Lamp", "c:about d:Circuit")])]
    assert "night.lit requires LIT of Circuit, but no Circuit can have that situation type" in found


def test_individuals_that_are_only_members_of_a_named_class_do_not_count_as_named(theatre: Theatre) -> None:
    problem = read(load(THEATRE / "first-night.ttl")).problem
    spread = {one for behavior in problem.domain.behaviors.values() for one in behavior.spread}
    assert {"crown", "skull", "sword"} <= spread
    assert spread.isdisjoint(named(problem))

"""Behaviour trees: a small interpreter executes plans by ticking them, also after disturbances; their files are complete."""

import ast
import random
import re
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from fractions import Fraction
from functools import cache
from pathlib import Path

import pytest
from click.testing import CliRunner

import confab
from confab.cli import app
from confab.planner.acting.symbolic_world import SymbolicWorld
from confab.planner.acting.world import WorldReport
from confab.planner.behavior_tree import Element, Situation
from confab.planner.plan import Plan, Step
from confab.planner.validation import open_goals, validate
from confab.reasoner.amounts import Amount, Quantity
from confab.reasoner.problem import Domain, Problem
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    AmountEffect,
    AnyOf,
    Behavior,
    Comparison,
    Parameter,
    Rule,
    SituationType,
    Symbol,
    ValueCondition,
    ValueEffect,
)
from confab.trees import Tree, behavior_tree, export_trees


class Ticking:
    """The common semantics of both engines in one class; a primitive is executed at once, and then the tree is ticked again."""

    def __init__(self, problem: Problem, tree: Tree, world: SymbolicWorld) -> None:
        self.problem, self.tree, self.world = problem, tree, world
        self.variables: dict[str, int] = {}
        self.begun = False
        self.done: list[str] = []

    def tick(self) -> bool | None:
        """Return whether the tree succeeds or fails; None while the tree is running."""
        self.situation = Situation(self.problem, self.world.observe())
        if not self.begun:
            assert self.element(self.tree.subtrees[self.tree.first])
        said = self.element(self.tree.subtrees[self.tree.then])
        self.begun = said is not False
        return said

    def element(self, one: Element) -> bool | None:
        match one.kind:
            case "SubTree":
                return self.element(self.tree.subtrees[one.name])
            case "Check":
                own, number = self.variables[one.name], int(one.ports["number"])
                return own >= number if one.ports["comparison"] == ">=" else own < number
            case "Set":
                self.variables[one.name] = int(one.ports["number"])
                return True
            case "Again":
                return None
            case "Condition":
                return self.situation.asks(self.tree.leaves[one.key])
            case "Action":
                step = self.tree.leaves[one.key]
                assert isinstance(step, Step)
                self.done.append(str(step))
                return self.world.execute(step).ok
            case "Parallel":
                said = [self.element(child) for child in one.children]
                return False if False in said else None if None in said else True
            case kind:
                for child in one.children:
                    told = self.element(child)
                    if told is not (kind != "Fallback"):
                        return told
                return kind != "Fallback"


def run(problem: Problem, plan: Plan, world: SymbolicWorld, most: int = 300) -> tuple[bool, Ticking]:
    """Tick the tree until it succeeds, or fails five times like its retry node."""
    ticking, failures = Ticking(problem, behavior_tree(problem, plan), world), 0
    for _ in range(most):
        said = ticking.tick()
        failures += said is False
        if said or failures == 5:
            return bool(said), ticking
    return False, ticking


@cache
def planned(name: str) -> tuple[Problem, Plan]:
    scene = confab.load(name)
    plan = scene.plan().plan
    assert plan is not None
    return scene.problem, plan


ANY_FORM = [
    "rooms-waste",
    "two-cups",
    "drawers-small",
    "towers-small",
    "iiwa-serving",
    "laboratory-small",
    "wishes-small",
]
"""Scenes with one and several levels, several steps refined together, steps that put things back, and unmet soft goals."""


@pytest.mark.parametrize("name", ANY_FORM)
def test_a_behaviour_tree_executes_its_plan_in_the_order_of_the_plan(name: str) -> None:
    problem, plan = planned(name)
    world = SymbolicWorld(problem)
    reached, ticking = run(problem, plan, world)
    assert reached
    assert open_goals(replace(problem, initial=world.state)) == open_goals(
        replace(problem, initial=after(problem, plan)[-1])
    )
    assert ticking.done == [str(step) for step in plan.primitives]


def after(problem: Problem, plan: Plan) -> list[dict[Symbol, str]]:
    """Return the states before and after each primitive of a plan."""
    world = SymbolicWorld(problem)
    states = [dict(world.state)]
    for step in plan.primitives:
        world.execute(step)
        states.append(dict(world.state))
    return states


@pytest.mark.parametrize("name", ANY_FORM)
def test_a_behaviour_tree_continues_from_each_state_of_its_plan(name: str) -> None:
    problem, plan = planned(name)
    for number, state in enumerate(after(problem, plan)):
        world = SymbolicWorld(replace(problem, initial=state))
        reached, ticking = run(problem, plan, world)
        assert reached
        assert ticking.done == [str(step) for step in plan.primitives[number:]]


WATER = Amount("WATER", ("tub",))


def washing(goal: dict[str, str], water: int = 2) -> Problem:
    """Return the problem of a tub that is filled, emptied and scrubbed; the tub is fine if it is clean, full or not dirty."""
    fine = AnyOf(
        (
            (ValueCondition("CLEAN", ("tub",), TRUE),),
            (Comparison(WATER, ">=", Fraction(8)),),
            (ValueCondition("DIRTY", ("tub",), FALSE),),
        )
    )

    def behavior(name: str, *parts: ValueEffect | AmountEffect, least: int = 0) -> Behavior:
        asked = (Comparison(WATER, ">=", Fraction(least)),)
        effects = tuple(part for part in parts if isinstance(part, ValueEffect))
        return Behavior(name, 1, (), (), asked, effects, amounts=tuple(p for p in parts if isinstance(p, AmountEffect)))

    behaviors = [
        behavior("POUR", AmountEffect("WATER", ("tub",), "increase", Fraction(2))),
        behavior("EMPTY", AmountEffect("WATER", ("tub",), "decrease", Fraction(2))),
        behavior("SCRUB", ValueEffect("DONE", ("tub",), TRUE), ValueEffect("DIRTY", ("tub",), TRUE), least=4),
        behavior(
            "RINSE",
            AmountEffect("WATER", ("tub",), "increase", Fraction(2)),
            ValueEffect("CLEAN", ("tub",), TRUE),
        ),
    ]
    truth = {name: SituationType(name, ("Tub",), "Truth", boolean=True) for name in ("DONE", "CLEAN", "DIRTY", "FINE")}
    water_of = SituationType("WATER", ("Tub",), "WATER", quantity=Quantity(least=Fraction(0)))
    rule = Rule("FINE", (Parameter("?tub", "Tub"),), (), (fine,))
    domain = Domain({**truth, "WATER": water_of}, {one.name: one for one in behaviors}, rules={"FINE": (rule,)})
    wanted = {Symbol(name, ("tub",)): value for name, value in goal.items()}
    return Problem("urn:tub", domain, {"Tub": ("tub",)}, {}, {Symbol("WATER", ("tub",)): str(water)}, wanted)


@pytest.mark.parametrize(
    ("goal", "water", "names"),
    [
        ({"DONE": TRUE, "WATER": "2"}, 2, ["POUR", "SCRUB", "EMPTY"]),
        ({"DONE": TRUE, "FINE": TRUE}, 4, ["RINSE", "SCRUB"]),
        ({"DONE": TRUE, "FINE": TRUE}, 6, ["SCRUB", "RINSE"]),
    ],
    ids=[
        "an amount returns to its value",
        "a goal holds before the step",
        "two alternatives at once",
    ],
)
def test_a_behaviour_tree_executes_each_required_step_once(goal: dict[str, str], water: int, names: list[str]) -> None:
    problem = washing(goal, water)
    plan = Plan(tuple(Step((i,), problem.id_of(name, ()), 1, name, ()) for i, name in enumerate(names)))
    assert not validate(problem, plan)
    reached, ticking = run(problem, plan, SymbolicWorld(problem))
    assert reached
    assert [said.split()[-1] for said in ticking.done] == names


class Undone(SymbolicWorld):
    """A world in which one goal is undone once: an object is back at its first place, or furniture in its first state."""

    def __init__(self, problem: Problem, after: int, draw: random.Random) -> None:
        super().__init__(problem)
        self.left, self.draw, self.undone = after, draw, ""

    def execute(self, step: Step) -> WorldReport:
        said = super().execute(step)
        self.left -= 1
        free = all(
            value not in self.problem.members("MobileRobot")
            for s, value in self.state.items()
            if s.situation == "THING_AT"
        )
        first = {s: self.problem.initial.get(s, "false") for s in self.state}
        changed = [s for s in self.problem.goal if self.state.get(s, "false") != first.get(s, "false") and free]
        if self.left <= 0 and not self.undone and changed:
            symbol = self.draw.choice(sorted(changed))
            self.undone = f"{step}: {symbol}"
            self.state[symbol] = first[symbol]
        return said


@pytest.mark.parametrize("name", ["rooms-waste", "rooms-breakfast"])
def test_a_behaviour_tree_continues_after_a_disturbance_that_undoes_a_step(name: str) -> None:
    problem, plan = planned(name)
    for after in range(1, len(plan.primitives), 4):
        world = Undone(problem, after, random.Random(after))
        reached, ticking = run(problem, plan, world)
        assert reached, (world.undone, ticking.done)
        assert not open_goals(replace(problem, initial=world.state))


def test_steps_of_different_workers_that_do_not_disturb_one_another_are_parallel() -> None:
    problem, plan = planned("drawers-small")
    text = "".join(kind for one in behavior_tree(problem, plan).subtrees.values() for kind in kinds(one))
    assert "Parallel" in text


def kinds(element: Element) -> list[str]:
    return [element.kind, *(kind for child in element.children for kind in kinds(child))]


def test_the_files_of_a_behaviour_tree_are_complete_and_define_their_leaves(tmp_path: Path) -> None:
    problem, plan = planned("rooms-waste")
    xml, python = export_trees(problem, plan, tmp_path)
    root = ElementTree.parse(xml).getroot()
    trees = {tree.get("ID") for tree in root.iter("BehaviorTree")}
    assert root.get("main_tree_to_execute") in trees
    assert {tree.get("ID") for tree in root.iter("SubTree")} <= trees
    model = root.find("TreeNodesModel")
    assert model is not None
    ports = {node.get("ID"): {port.get("name") for port in node} for node in model}
    own = {"BehaviorTree", "SubTree", "RetryUntilSuccessful", "ReactiveFallback", "ReactiveSequence", "Sequence"}
    own |= {"Parallel", "Script", "ScriptCondition", "Sleep"}
    for tree in root.iter("BehaviorTree"):
        for leaf in [node for node in tree.iter() if node.tag not in own]:
            assert {*leaf.attrib} - {"name"} == ports[leaf.tag]
    names = [str(node.get("ID", "x")) for node in root.iter()]
    assert all(re.fullmatch(r"\w+", name) for name in names), "BehaviorTree.CPP refuses other names"
    assert {"B2_PICK", "B2_PICK_possible", "THING_AT"} <= ports.keys()
    ast.parse(python.read_text(encoding="utf-8"))
    export_trees(problem, plan, tmp_path)  # an export replaces its own files
    xml.write_text(xml.read_text(encoding="utf-8").replace("plan", "my plan"), encoding="utf-8")
    with pytest.raises(OSError, match=r"tree\.xml"):
        export_trees(problem, plan, tmp_path)


def test_the_tree_of_a_plan_without_steps_has_no_node_without_a_child(tmp_path: Path) -> None:
    problem = washing({"DONE": TRUE})
    held = replace(problem, initial={**problem.initial, **problem.goal})
    assert run(held, Plan(()), SymbolicWorld(held))[0]
    root = ElementTree.parse(export_trees(held, Plan(()), tmp_path)[0]).getroot()
    assert [node.tag for node in root.iter() if node.tag.endswith(("Sequence", "Fallback")) and len(node) == 0] == []


@pytest.mark.parametrize(
    ("name", "leaves"), [("plan", {"plan__", "plan_", "plan_possible"}), ("wash", {"wash_", "wash", "wash_possible"})]
)
def test_a_leaf_never_has_the_name_of_a_subtree_or_of_another_kind_of_leaf(name: str, leaves: set[str]) -> None:
    behavior = Behavior(name, 1, (), (), (), (ValueEffect(name, ("tub",), TRUE),))
    situations = {name: SituationType(name, ("Tub",), "Truth", boolean=True)}
    problem = replace(washing({name: TRUE}), domain=Domain(situations, {name: behavior}), initial={})
    tree = behavior_tree(problem, Plan((Step((0,), 0, 1, name, ()),)))
    assert {one.name for element in tree.subtrees.values() for one in every(element) if one.key} == leaves
    assert "plan" in tree.subtrees


@pytest.mark.parametrize("name", ["Inverter", "Repeat", "Switch3", "SubTreePlus", "AsyncSequence", "TryCatch"])
def test_a_leaf_never_has_the_name_of_a_node_of_an_engine(name: str) -> None:
    assert name not in names_of({name: name})


def test_different_facts_primitives_and_arguments_have_different_names() -> None:
    both = {"A.B UP": "LIFT A.B", "A B.UP": "LIFT A B", "Holds": "A B UP"}
    assert len(names_of(both)) == 3 * len(both)
    assert len(names_of({"UP": "X", "X possible": "Y"})) == 6
    parameters = (Parameter("?left.arm", "Tub"), Parameter("?right.arm", "Tub"))
    lift = Behavior("lift", 1, parameters, (), (), (ValueEffect("UP", ("?left.arm",), TRUE),))
    problem = replace(washing({"UP": TRUE}), domain=Domain(HELD_UP, {"lift": lift}), initial={})
    problem = replace(problem, classes={"Tub": ("tub", "basin")})
    tree = behavior_tree(problem, Plan((Step((0,), 0, 1, "lift", ("tub", "basin")),)))
    leaves = [one for element in tree.subtrees.values() for one in every(element) if one.kind == "Action"]
    assert [sorted(leaf.ports.values()) for leaf in leaves] == [["basin", "tub"]]


HELD_UP = {"UP": SituationType("UP", ("Tub",), "Truth", boolean=True)}


def names_of(givers: dict[str, str]) -> set[str]:
    """Return the names of the leaves of a plan in which each situation type has a behaviour that makes it true."""
    behaviors = {
        name: Behavior(name, 1, (), (), (), (ValueEffect(fact, ("tub",), TRUE),)) for fact, name in givers.items()
    }
    situations = {fact: SituationType(fact, ("Tub",), "Truth", boolean=True) for fact in givers}
    goal = dict.fromkeys(givers, TRUE)
    problem = replace(washing(goal), domain=Domain(situations, behaviors), initial={})
    tree = behavior_tree(problem, Plan(tuple(Step((i,), i, 1, name, ()) for i, name in enumerate(givers.values()))))
    return {one.name for element in tree.subtrees.values() for one in every(element) if one.key}


def every(element: Element) -> list[Element]:
    return [element, *(one for child in element.children for one in every(child))]


def test_the_command_line_exports_trees(tmp_path: Path) -> None:
    said = CliRunner().invoke(app, ["export", "rooms-snacks", "--bt", "-o", str(tmp_path / "out")])
    assert said.exit_code == 0, said.output
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["tree.py", "tree.xml"]

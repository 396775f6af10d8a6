"""Refutations by motion planning: the next plan avoids them, and the scene stores them until their objects are gone."""

from functools import cache
from pathlib import Path
from shutil import copy

import pytest

import confab
from confab import ontology
from confab.physics import Report
from confab.planner.solve import Mode
from confab.reasoner.refutations import Refutation
from confab.reasoner.symbols import Fact, Symbol
from confab.refuting import keep, knowing, refuted_in
from confab.scene import Scene
from confab.sim.swings import check_swing
from confab.sim.verdict import SkillError
from confab.sim.verify import expectations
from confab.sim.world import PhysicsWorld

BLOCKED = "blocked-cupboard"
IN_THE_WAY = Fact(Symbol("LOCATION", ("bottle",)), "before_door")


@cache
def first() -> tuple[Scene, Report]:
    """The scene, and the verdict of physics on the first plan: the door can't be opened."""
    scene = confab.load(BLOCKED)
    return scene, scene.verify(scene.plan())


def own(folder: Path) -> Path:
    """Return the scene as a user's own file."""
    for kind in ("ttl", "reach.ttl"):
        copy(ontology.ROOT / "scenes" / f"{BLOCKED}.{kind}", folder / f"{BLOCKED}.{kind}")
    return folder / f"{BLOCKED}.ttl"


def done(scene: Scene, mode: Mode = "guarded") -> list[tuple[str, ...]]:
    return [(step.behavior, *step.arguments) for step in scene.plan(mode=mode).plan.primitives]


def test_a_blocked_swing_is_refuted_for_every_hand_both_directions_and_all_obstacles() -> None:
    scene, report = first()
    assert report.shown.failure is not None
    verdict = report.shown.failure.verdict
    assert verdict.objects == ("door", "bottle")
    assert verdict.facts == (IN_THE_WAY, Fact(Symbol("OPENED", ("door",)), "false"))
    refuted = refuted_in(scene, report)
    assert {one.behavior for one in refuted} == {"F2_OPEN", "F3_OPEN", "F2_SHUT", "F3_SHUT"}
    assert {one.arguments for one in refuted} == {("", "door")}
    things = {one.facts[0].symbol.arguments[0]: set[str]() for one in refuted}
    for one in refuted:
        things[one.facts[0].symbol.arguments[0]].add(one.facts[0].value)
    # a hand that has lifted the bottle holds it in the way, too
    assert things.pop("bottle") == {"before_door", "in_hand"}
    assert things == {thing: {"before_door"} for thing in ("cup", "jar", "lid")}
    assert str(refuted[-1]) == "not F3_OPEN any door while bottle LOCATION before_door: no path: door, bottle"


def test_the_next_plan_after_one_refutation_avoids_the_obstacle() -> None:
    scene, report = first()
    known = knowing(scene, refuted_in(scene, report))
    steps = known.plan().plan.primitives
    before = [known.problem.initial, *expectations(known.problem, steps)]
    swings = [state for step, state in zip(steps, before, strict=False) if step.behavior in ("F3_OPEN", "F3_SHUT")]
    assert len(swings) == 2
    assert {state[IN_THE_WAY.symbol] for state in swings}.isdisjoint({"before_door", "in_hand"})


def test_an_object_at_another_place_does_not_block_a_swing() -> None:
    scene, _ = first()
    with PhysicsWorld(scene.embodiment, dict(scene.problem.initial) | {IN_THE_WAY.symbol: "left_spot"}) as world:
        check_swing(world, "door", [0.0, 0.5, 1.0, 1.5])
    with (
        PhysicsWorld(scene.embodiment, scene.problem.initial) as world,
        pytest.raises(SkillError, match="bottle stands in the way of door"),
    ):
        check_swing(world, "door", [0.0, 0.5, 1.0, 1.5])


@pytest.mark.parametrize("mode", ["guarded", "paper"])
def test_the_next_plan_moves_the_obstacle_away_first(mode: Mode) -> None:
    scene, report = first()
    steps = done(knowing(scene, refuted_in(scene, report)), mode)
    before = steps[: steps.index(("F3_OPEN", "left_hand", "door"))]
    assert any(name == "B3_REACH_HAND_OBJECT" and thing[-1] == "bottle" for name, *thing in before)
    assert done(scene)[0] == ("F3_OPEN", "left_hand", "door")  # the scene itself stays unchanged


def test_refutations_are_stored_in_a_file_beside_the_scene_for_the_next_call(tmp_path: Path) -> None:
    _, report = first()
    scene = confab.load(own(tmp_path))
    keep(scene, refuted_in(scene, report))
    keep(scene, refuted_in(scene, report))
    again = confab.load(own_path := tmp_path / f"{BLOCKED}.ttl")
    assert done(again)[0] != ("F3_OPEN", "left_hand", "door")
    text = own_path.with_name(f"{BLOCKED}.reach.ttl").read_text(encoding="utf-8")
    assert text.count("not F3_OPEN any door while bottle LOCATION before_door") == 1
    assert "canReach" in text


def test_refutations_about_a_removed_object_are_ignored(tmp_path: Path) -> None:
    _, report = first()
    path = own(tmp_path)
    scene = confab.load(path)
    keep(scene, refuted_in(scene, report))
    lines = path.read_text(encoding="utf-8").splitlines()
    path.write_text("\n".join(line for line in lines if ":bottle" not in line), encoding="utf-8")
    assert done(confab.load(path))[0] == ("F3_OPEN", "left_hand", "door")


def test_a_refutation_can_depend_on_a_false_fact() -> None:
    scene = confab.load(BLOCKED)
    while_shut = (Fact(Symbol("OPENED", ("drawer",)), "false"),)
    refuted = [Refutation("B2_PICK", (hand, "lid"), while_shut) for hand in ("left_hand", "right_hand")]
    assert ("F3_OPEN", "right_hand", "drawer") not in done(scene)
    assert ("F3_OPEN", "right_hand", "drawer") in done(knowing(scene, refuted))


def test_refutations_are_not_written_into_shipped_files() -> None:
    scene, report = first()
    file = ontology.ROOT / "scenes" / f"{BLOCKED}.reach.ttl"
    before = file.read_text(encoding="utf-8")
    keep(scene, refuted_in(scene, report))
    assert file.read_text(encoding="utf-8") == before

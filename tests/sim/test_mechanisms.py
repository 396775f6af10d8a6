"""Furniture with moving links: skills that the ontology describes open, shut and press the links, by friction alone."""

import re
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import confab
from confab.planner.acting.episode import Intervention, InterventionKind
from confab.planner.plan import Step
from confab.reaching import with_reach
from confab.reasoner.embodiment.skill_checks import RULES
from confab.reasoner.embodiment.skills import CONDITIONS, FINGERS, MOTIONS, QUANTITIES, VERDICTS
from confab.reasoner.embodiment.values import Embodiment, Feature, Link, Mechanism, Part, SkillUse
from confab.reasoner.symbols import Fact, Symbol
from confab.scene import Scene
from confab.sim import measuring, phases, touch
from confab.sim.faults import displaced
from confab.sim.linkage import posts, read_mechanism, solids
from confab.sim.live import LiveWorld
from confab.sim.skills import perform
from confab.sim.staging import Perturbation
from confab.sim.verdict import CODES, SkillError, Verdict
from confab.sim.verify import compare, expectations, verify
from confab.sim.world import PhysicsWorld

PANEL = Mechanism(
    "panel",
    (0.5, -0.1, 0.7),
    0.0,
    (Part("panel.body", "box", (0.06, 0.2, 0.2), (0.03, 0.0, 0.1)),),
    (
        Link(
            "button",
            "prismatic",
            (Part("button.cap", "cylinder", (0.03, 0.03, 0.02), (-0.012, 0.0, 0.0), (0.0, 1.5708, 0.0)),),
            {"cap": Feature("cap", (-0.022, 0.0, 0.0))},
            position=(0.0, 0.0, 0.12),
            axis=(1.0, 0.0, 0.0),
            upper=0.01,
            mass=0.05,
            opened=0.003,
            shut=0.002,
            spring=6.0,
            latches=True,
        ),
    ),
)
"""A board with a button that stays in after one press, and comes out after the next press."""


@cache
def kitchen() -> Scene:
    return confab.load("kitchen-corner")


def by_skill(embodiment: Embodiment) -> Mapping[str, SkillUse]:
    return {use.skill: use for use in embodiment.skills.values()}


def with_panel(**changed: float) -> PhysicsWorld:
    """Return a world with only the board; the joint of the button may be replaced."""
    button = replace(PANEL.links[0], **changed)  # type: ignore[arg-type]
    return PhysicsWorld(
        replace(kitchen().embodiment, mechanisms=(replace(PANEL, links=(button,)),), places={}, perceivers={}), {}
    )


def test_a_cup_is_brought_from_a_cupboard_that_is_opened_and_shut_and_a_lid_is_put_on_a_pot() -> None:
    scene = kitchen()
    plan = scene.plan().plan
    assert plan is not None
    done = [step.behavior for step in plan.primitives]
    assert done.index("F3_OPEN") < done.index("B3_GRASP") < done.index("F3_SHUT")
    expected = expectations(scene.problem, plan.primitives)
    rollout = verify(scene.embodiment, scene.problem.initial, plan.primitives, expected, beads=False)
    assert rollout.failure is None
    seen = {(symbol.situation, *symbol.arguments): value for symbol, value in rollout.state.items()}
    assert seen["OPENED", "door"] == "false"
    assert seen["LOCATION", "cup"] == "left_spot"
    assert seen["LOCATION", "lid"] == "pot_top"


def test_tubes_are_put_into_a_centrifuge_that_is_started_with_its_lid_shut() -> None:
    scene = confab.load("centrifuge")
    plan = scene.plan().plan
    assert plan is not None
    expected = expectations(scene.problem, plan.primitives)
    rollout = verify(scene.embodiment, scene.problem.initial, plan.primitives, expected)
    assert rollout.failure is None
    seen = {(symbol.situation, *symbol.arguments): value for symbol, value in rollout.state.items()}
    assert (seen["OPENED", "cover"], seen["RUNNING", "start"]) == ("false", "true")
    assert (seen["LOCATION", "tube1"], seen["LOCATION", "tube2"]) == ("slot1", "slot2")


def test_an_object_in_a_drawer_moves_with_it_and_stays_at_its_place() -> None:
    scene = kitchen()
    skills, roles = by_skill(scene.embodiment), {"hand": "right_hand", "object": "drawer"}
    with PhysicsWorld(scene.embodiment, scene.problem.initial, seed=3, perturb=Perturbation(), beads=False) as world:
        before = world.truth("jar")[1]
        measured = perform(world, skills["operate"], roles)
        moved = world.truth("jar")[1] - before
        state = world.observe()
        assert np.linalg.norm(moved) == pytest.approx(measured["joint"], abs=0.003)
        assert state[Symbol("OPENED", ("drawer",))] == "true"
        assert state[Symbol("LOCATION", ("jar",))] == "compartment"
        perform(world, skills["operate_back"], roles)
        assert np.linalg.norm(world.truth("jar")[1] - before) < 0.005
        assert world.observe()[Symbol("OPENED", ("drawer",))] == "false"


def test_a_handle_that_one_finger_missed_is_grasped_again_and_the_drawer_opens() -> None:
    scene = kitchen()
    roles = {"hand": "right_hand", "object": "drawer"}
    with PhysicsWorld(scene.embodiment, scene.problem.initial, 7007, Perturbation(), beads=False, noise=0.008) as world:
        perform(world, by_skill(scene.embodiment)["operate"], roles)
        assert world.observe()[Symbol("OPENED", ("drawer",))] == "true"


def test_fingers_open_less_at_a_handle_with_little_room_beside_it() -> None:
    scene = kitchen()
    roles = {"hand": "left_hand", "object": "door"}
    with PhysicsWorld(scene.embodiment, scene.problem.initial, 7013, Perturbation(), beads=False, noise=0.008) as world:
        for skill in ("operate", "operate_back"):
            perform(world, by_skill(scene.embodiment)[skill], roles)
        assert world.observe()[Symbol("OPENED", ("door",))] == "false"


@pytest.mark.parametrize(
    ("name", "link", "opened", "off"),
    [
        ("kitchen-corner", "door", False, 0.0085),
        ("centrifuge", "cover", True, 0.012),
    ],
)
def test_a_link_is_operated_even_if_its_handle_seems_farther_away_than_it_is(
    name: str, link: str, opened: bool, off: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = confab.load(name)
    with PhysicsWorld(scene.embodiment, scene.problem.initial, beads=False, noise=0.004) as world:
        world.links[link].set(link, opened)
        farther = {mechanic.body: np.array([off, 0.0, 0.0]) for mechanic in world.mechanics}
        monkeypatch.setattr(world, "look", lambda before=0: world.shifts.update(farther))
        skill = by_skill(scene.embodiment)["operate_back" if opened else "operate"]
        perform(world, skill, {"hand": "left_hand", "object": link})
        assert world.observe()[Symbol("OPENED", (link,))] == str(not opened).lower()


def test_objects_in_a_drawer_move_with_it_when_a_person_opens_it() -> None:
    scene = kitchen()
    with PhysicsWorld(scene.embodiment, scene.problem.initial, beads=False) as world:
        before = world.truth("jar")[1]
        opened = Symbol("OPENED", ("drawer",))
        LiveWorld(world, {}).disturb(Intervention(InterventionKind.WORLD, (Fact(opened, "true"),)))
        assert world.observe()[opened] == "true"
        assert before[0] - world.truth("jar")[1][0] == pytest.approx(
            world.links["drawer"].values()["drawer"], abs=0.003
        )


def test_a_button_latches_and_comes_out_when_it_is_pressed_again() -> None:
    press, roles = by_skill(kitchen().embodiment)["press"], {"hand": "right_hand", "object": "button"}
    with with_panel() as world:
        for held in (True, False):
            perform(world, press, roles)
            assert (world.links["button"].values()["button"] > PANEL.links[0].opened) is held


def test_a_button_that_resists_too_much_is_given_up_as_stuck() -> None:
    press, roles = by_skill(kitchen().embodiment)["press"], {"hand": "right_hand", "object": "button"}
    with with_panel(spring=200.0) as world, pytest.raises(SkillError) as failure:
        perform(world, press, roles)
    assert (failure.value.verdict.code, failure.value.verdict.objects) == ("stuck", ("button",))
    assert failure.value.verdict.measured["joint"] < 0.003


def test_an_obstacle_of_a_door_is_named_before_the_hand_moves() -> None:
    scene = kitchen()
    operate, roles = by_skill(scene.embodiment)["operate"], {"hand": "left_hand", "object": "door"}
    with PhysicsWorld(scene.embodiment, scene.problem.initial, beads=False) as world:
        displaced("lid", (-0.02, 0.52))(world)
        with pytest.raises(SkillError) as failure:
            perform(world, operate, roles)
        assert (failure.value.verdict.code, failure.value.verdict.objects) == ("no path", ("door", "lid"))
        assert world.steps == 0


def test_the_lever_of_the_guide_is_turned_and_turned_back(tmp_path: Path) -> None:
    guide = (Path(confab.__file__).parents[1] / "docs" / "bodies.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```turtle\n(.*?)^```$", guide, re.MULTILINE | re.DOTALL)
    (block,) = (block for block in blocks if "lever" in block)
    imports = ", ".join(f"<https://w3id.org/confab/{name}>" for name in ("fittings-bodies", "two-arms"))
    confab_prefixes = {"f": "fittings", "r": "two-arms", "e": "embodiment", "c": "core"}
    prefixes = {name: f"https://w3id.org/confab/{file}#" for name, file in confab_prefixes.items()}
    prefixes |= {"": "https://example.org/wall#", "owl": "http://www.w3.org/2002/07/owl#"}
    prefixes |= {"rdfs": "http://www.w3.org/2000/01/rdf-schema#"}
    head = "".join(f"@prefix {name}: <{iri}> .\n" for name, iri in prefixes.items())
    file = tmp_path / "wall.ttl"
    file.write_text(
        f"{head}<https://example.org/wall> a owl:Ontology ; owl:imports {imports} .\n{block}", encoding="utf-8"
    )
    assert list(confab.validate(file)) == []
    embodiment = confab.load(str(file)).embodiment
    skills, roles = by_skill(embodiment), {"hand": "left_hand", "object": "lever"}
    with PhysicsWorld(embodiment, {}, seed=2, perturb=Perturbation()) as world:
        for skill, value in (("operate", "true"), ("operate_back", "false")):
            perform(world, skills[skill], roles)
            assert world.observe()[Symbol("OPENED", ("lever",))] == value


def test_a_knob_is_turned_and_a_door_slides_aside_as_an_author_describes_them(tmp_path: Path) -> None:
    file = Path(__file__).parents[2] / "docs" / "examples" / "workshop" / "workshop.ttl"
    (tmp_path / file.name).write_text(file.read_text())
    scene = with_reach(confab.load(tmp_path / file.name))
    assert str(scene.plan().verify()).startswith("verified")
    with PhysicsWorld(scene.embodiment, scene.problem.initial, seed=1, perturb=Perturbation(), beads=False) as world:
        for i, behavior in enumerate(("F3_OPEN", "F3_SHUT")):
            verdict = world.execute(Step((i,), 0, 3, behavior, ("right_hand", "valve")))
            assert verdict.ok, verdict
            assert (world.links["valve"].values()["valve"] > 1.0) == (behavior == "F3_OPEN")


@pytest.mark.parametrize("position", ["e:x 0.55 ; e:y 0.2", "e:x 0.52 ; e:y 0.3"])
def test_a_hand_turns_about_the_pin_of_a_crank_in_a_scene_without_places(tmp_path: Path, position: str) -> None:
    file = Path(__file__).parents[2] / "docs" / "examples" / "sluice" / "sluice.ttl"
    (tmp_path / file.name).write_text(file.read_text().replace("e:x 0.55 ; e:y 0.2", position))
    scene = with_reach(confab.load(tmp_path / file.name))
    assert not scene.embodiment.places
    assert str(scene.plan().verify(rollouts=2, perturb=True)).startswith("verified")


def test_a_button_that_seems_nearer_than_it_is_is_pressed_completely(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = confab.load("centrifuge")
    press = by_skill(scene.embodiment)["press"]
    with PhysicsWorld(scene.embodiment, scene.problem.initial, beads=False, noise=0.004) as world:
        nearer = {mechanic.body: np.array([-0.009, 0.0, 0.0]) for mechanic in world.mechanics}
        monkeypatch.setattr(world, "look", lambda before=0: world.shifts.update(nearer))
        perform(world, press, {"hand": "right_hand", "object": "start"})
        assert world.observe()[Symbol("RUNNING", ("start",))] == "true"


def test_a_phase_without_its_role_or_setting_is_reported_as_ill_defined() -> None:
    scene = kitchen()
    operate = by_skill(scene.embodiment)["operate"]
    wrong = replace(operate, phases=(replace(operate.phases[0], to="thing.handle"),))
    unset = replace(operate, phases=(replace(operate.phases[0], above="hover"),))
    with PhysicsWorld(scene.embodiment, scene.problem.initial, beads=False) as world:
        for use, word in ((wrong, "thing"), (unset, "hover")):
            with pytest.raises(SkillError, match=f"'{word}' is not stated") as failure:
                perform(world, use, {"hand": "left_hand", "object": "door"})
            assert failure.value.verdict.code == "ill-defined"


def test_validation_finds_a_missing_feature_of_a_link() -> None:
    embodiment = kitchen().embodiment
    operate = embodiment.skills["F3_OPEN"]
    wrong = replace(operate, phases=(replace(operate.phases[0], to="object.knob"),))
    found = list(RULES["unknown-feature"](replace(embodiment, skills={"F3_OPEN": wrong})))
    assert [name for name, *_ in found] == ["door", "drawer"]
    assert list(RULES["unknown-feature"](embodiment)) == []


def test_the_model_of_a_mechanism_has_the_poses_of_physics() -> None:
    mechanism = next(one for one in kitchen().embodiment.mechanisms if one.name == "cupboard")
    mechanism = replace(mechanism, yaw=0.3)
    with PhysicsWorld(replace(kitchen().embodiment, mechanisms=(mechanism,), places={}, perceivers={}), {}) as world:
        mechanic = world.links["door"]
        for opened in (False, True):
            mechanic.set("door", opened)
            solid = next(one for one in mechanic.solids() if one.part == "door.bar")
            rotation, origin = mechanic.frame("door")
            bar = next(part for part in mechanic.link("door").parts if part.name == "door.bar")
            np.testing.assert_allclose(solid.center, origin + rotation @ np.array(bar.position), atol=1e-9)
        assert mechanic.values()["door"] == pytest.approx(mechanic.link("door").wide)
    assert read_mechanism(mechanism).parents["door"].kind == "revolute"


def test_the_interpreter_supports_all_terms_of_phases() -> None:
    assert {*phases.MOTIONS, "free"} == set(MOTIONS)
    assert set(touch.FINGERS) == set(FINGERS)
    assert set(phases.CONDITIONS) == set(CONDITIONS)
    assert set(measuring.QUANTITIES) == set(QUANTITIES)
    assert set(VERDICTS) == set(CODES)


def test_a_joint_that_is_not_open_is_reported_with_its_perceived_value_and_thresholds() -> None:
    scene = kitchen()
    with PhysicsWorld(scene.embodiment, scene.problem.initial) as world:
        before = Verdict(True, measured={"joint": 1.2})
        verdict = compare(world, {Symbol("OPENED", ("door",)): "true"}, before)
    assert verdict.code == "stuck"
    assert verdict.measured == pytest.approx({"joint": 0.0, "opened": 1.0, "shut": 0.06}, abs=1e-3)


def test_the_first_unreachable_joint_value_of_a_motion_is_reported() -> None:
    scene = kitchen()
    cupboard, *others = scene.embodiment.mechanisms
    x, y, z = cupboard.position
    away = replace(scene.embodiment, mechanisms=(replace(cupboard, position=(x + 0.1, y + 0.35, z)), *others))
    with PhysicsWorld(away, scene.problem.initial) as world:
        verdict = world.execute(Step((0,), 0, 3, "F3_OPEN", ("left_hand", "door")))
    assert verdict.code == "unreachable"
    assert verdict.message == "where the joint is at 1.05, the hand would be too far"
    assert verdict.measured == pytest.approx({"joint": 1.05, "beyond_m": 0.009}, abs=0.01)


def test_pictured_posts_join_the_bar_of_a_handle_to_the_door_and_are_no_solids() -> None:
    for mechanism in confab.load("kitchen-corner").embodiment.mechanisms:
        for link in mechanism.links:
            first, second = posts(link)
            assert np.allclose([first.size[2], second.size[2]], 0.045, atol=0.002)
            assert [
                solid.part for solid in solids(mechanism, read_mechanism(mechanism), {}) if "post" in solid.part
            ] == []

"""Reading of an `Embodiment` from the graph: bodies, places, robots, skills and perceivers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import pyoxigraph as ox

from confab import ontology
from confab.reasoner.embodiment.facts import BodyFacts, EmbodimentError, rows
from confab.reasoner.embodiment.measured import MEASURED, asked, bounds
from confab.reasoner.embodiment.mechanisms import mechanisms
from confab.reasoner.embodiment.skills import skill_uses
from confab.reasoner.embodiment.values import (
    Body,
    Color,
    Embodiment,
    Filling,
    Fixture,
    Hand,
    PerceiverUse,
    Place,
    Robot,
    Shape,
    Stand,
)
from confab.reasoner.names import local_name

PALETTE: tuple[Color, ...] = (
    (0.95, 0.50, 0.10, 1.0),
    (0.80, 0.12, 0.28, 1.0),
    (0.95, 0.93, 0.88, 1.0),
    (0.35, 0.20, 0.10, 1.0),
    (0.20, 0.55, 0.90, 1.0),
    (0.55, 0.75, 0.20, 1.0),
)
"""Colours for fillings without a stated colour; the fillings get these colours in declared order."""
VALUED = "SELECT DISTINCT ?situation WHERE { ?situation c:valueProperty ?property }"
ONE_VALUED = "SELECT DISTINCT ?situation WHERE { ?situation c:valueProperty/a owl:FunctionalProperty }"
"""Queries for the situation types with a value property, and for those whose symbols have exactly one value."""


def read_embodiment(
    store: ox.Store, names: Callable[[str], str], folders: Sequence[Path] = (ontology.ROOT,)
) -> Embodiment:
    """Return the embodiment that a graph describes.

    Parameters
    ----------
    store : pyoxigraph.Store
        The scene with its imports; the union of all named graphs is read.
    names : callable
        A function that returns the short name of an IRI, as used in plans.
    folders : sequence of Path
        Folders in which URDF files and meshes are searched.

    Raises
    ------
    EmbodimentError
        An attribute is missing or invalid, or a file is missing.
    """
    facts = BodyFacts.read(store)
    robots = facts.ordered({*facts.having("urdf")} - {*facts.members("Mechanism")})
    return Embodiment(
        robots=tuple(_robot(facts, node, names, folders) for node in robots),
        fixtures=tuple(_fixture(facts, node, names) for node in facts.members("Fixture")),
        places={names(node): _place(facts, node, names) for node in _places(facts)},
        bodies={names(node): _body(facts, node, shape, names) for node, shape in _shaped(facts)},
        fillings=_fillings(facts, names),
        skills=skill_uses(facts, names, store),
        perceivers=_perceivers(facts, names, store),
        mechanisms=mechanisms(facts, names, folders),
        stands={
            names(node): Stand(names(node), facts.position(node, "0"), facts.number(node, "yaw", 0.0))
            for node in facts.members("Stand")
        },
        cameras=tuple(facts.position(node) for node in facts.members("Camera")),
    )


# ----------------------------------------------------------------------------------------------- bodies


def _fixture(facts: BodyFacts, node: str, names: Callable[[str], str]) -> Fixture:
    size = (facts.number(node, "size_x"), facts.number(node, "size_y"), facts.number(node, "size_z"))
    yaw, friction = facts.number(node, "yaw", 0.0), facts.number(node, "friction", 0.8)
    return Fixture(names(node), size, facts.position(node), yaw, facts.color(node), friction)


def _places(facts: BodyFacts) -> list[str]:
    """Return the places: all nodes with coordinates or a carrier, except robots, stands and parts of furniture."""
    other = {
        node for kind in ("Fixture", "Mechanism", "Link", "Part", "Feature", "Stand") for node in facts.members(kind)
    }
    other |= {node for node, links in facts.links.items() if "part_of" in links} | {*facts.having("urdf")}
    placed = {*facts.having("x"), *(node for node, links in facts.links.items() if "carried_by" in links)}
    return facts.ordered(placed - other)


def _place(facts: BodyFacts, node: str, names: Callable[[str], str]) -> Place:
    carriers, stands = facts.linked(node, "carried_by"), facts.linked(node, "reached_from")
    return Place(
        names(node),
        facts.position(node, "0" if carriers else None),
        names(carriers[0]) if carriers else "",
        names(stands[0]) if stands else "",
        facts.number(node, "grasped_at") if "grasped_at" in facts.attributes.get(node, {}) else None,
    )


def _shaped(facts: BodyFacts) -> list[tuple[str, str]]:
    """Return each individual with its shape: its own shape, or the shape of the most specific class that has a shape."""
    found = []
    for node in facts.ordered(facts.classes):
        if node in facts.supers or any(node in kinds for kinds in facts.classes.values()):
            continue
        shapes = [shape for kind in facts.nearest_first(node) for shape in facts.linked(kind, "shape")]
        if shapes:
            found.append((node, shapes[0]))
    return found


def _body(facts: BodyFacts, node: str, shape: str, names: Callable[[str], str]) -> Body:
    numbers = facts.all_numbers(shape)
    points = facts.ordered(facts.linked(shape, "profile_point"))
    profile = sorted(
        ((facts.number(point, "height"), facts.number(point, "inner_radius")) for point in points),
        key=lambda point: point[0],  # points of equal height, as at a step, stay in the order of their indices
    )
    return Body(
        names(node),
        Shape(
            facts.text(shape, "kind"),
            facts.number(shape, "mass"),
            facts.number(shape, "grasp_height"),
            tuple(profile),
            {name: numbers[name] for name in ("wall", "radius", "height", "width", "depth") if name in numbers},
            facts.color(shape),
            facts.number(shape, "friction", 0.8),
        ),
        facts.number(node, "servings", facts.number(shape, "servings", 1.0)),
    )


def _fillings(facts: BodyFacts, names: Callable[[str], str]) -> dict[str, Filling]:
    """Return the fillings: individuals that have beads, or whose most specific class has beads."""
    found: dict[str, Filling] = {}
    for node in facts.ordered(facts.classes):
        kinds = [kind for kind in facts.nearest_first(node) if "serving_beads" in facts.attributes.get(kind, {})]
        if not kinds or node in facts.supers or node == kinds[0] != node:
            continue
        if kinds[0] == node and any(node in classes for classes in facts.classes.values()):
            continue
        kind, color = kinds[0], PALETTE[len(found) % len(PALETTE)]
        found[names(node)] = Filling(
            names(node),
            int(facts.number(kind, "serving_beads")),
            facts.number(kind, "bead_radius"),
            facts.number(kind, "bead_mass"),
            facts.number(kind, "bead_friction"),
            facts.color(node, " ".join(str(part) for part in color)),
        )
    return found


# ----------------------------------------------------------------------------------------------- robots


def _robot(facts: BodyFacts, node: str, names: Callable[[str], str], folders: Sequence[Path]) -> Robot:
    hands = facts.ordered(hand for hand, links in facts.links.items() if node in links.get("hand_of", ()))
    return Robot(
        names(node),
        facts.file(node, "urdf", folders),
        tuple(_hand(facts, hand, names, folders) for hand in hands),
        facts.position(node),
        facts.number(node, "yaw", 0.0),
        facts.number(node, "acceleration"),
        facts.number(node, "driving_speed", 0.0),
        facts.number(node, "turning_speed", 1.0),
    )


def _hand(facts: BodyFacts, node: str, names: Callable[[str], str], folders: Sequence[Path]) -> Hand:
    arm, home = tuple(facts.text(node, "arm_joints").split()), facts.numbers(node, "home_posture")
    if len(arm) != len(home):
        raise EmbodimentError(f"{node} has {len(arm)} e:armJoints and {len(home)} angles in e:homePosture", node)
    flange, mounting = facts.text(node, "flange", ""), facts.numbers(node, "mounting", "0 0 0 0 0 0")
    if len(mounting) != 6:
        raise EmbodimentError(f"{node} has {len(mounting)} numbers in e:mounting; wanted x y z roll pitch yaw", node)
    prefix = f"{names(node)}." if flange else ""
    return Hand(
        names(node),
        prefix + facts.text(node, "tip"),
        arm,
        tuple(prefix + name for name in facts.text(node, "finger_joints").split()),
        home,
        facts.number(node, "opening"),
        facts.number(node, "grip"),
        facts.turned(node),
        facts.file(node, "gripper", folders) if flange else "",
        flange,
        mounting,
    )


# ----------------------------------------------------------------------------------------------- perceivers


def _perceivers(facts: BodyFacts, names: Callable[[str], str], store: ox.Store) -> dict[str, PerceiverUse]:
    with_one_value, with_values = ({row[0] for row in rows(store, query)} for query in (ONE_VALUED, VALUED))
    found = {}
    for situation in facts.ordered(node for node, links in facts.links.items() if "perceiver" in links):
        perceiver = facts.linked(situation, "perceiver")[0]
        special = {
            name.removeprefix("value_"): names(values[0])
            for name, values in facts.links[situation].items()
            if name.startswith("value_")
        }
        kinds = {kind for kind, links in facts.links.items() if situation in links.get("has_situation_type", ())}
        links = facts.ordered(node for node, linked in facts.links.items() if "part_of" in linked)
        choices = [node for node in facts.ordered(facts.classes) if situation in facts.nearest_first(node)[1:]]
        settings, values = facts.settings(perceiver, situation), tuple(map(names, choices))
        measured = local_name(perceiver) == MEASURED
        alone = situation not in with_values
        found[names(situation)] = PerceiverUse(
            names(situation),
            local_name(perceiver),
            settings,
            special,
            values,
            tuple(names(link) for link in links if kinds & set(facts.nearest_first(link))),
            bounds(facts, situation, settings, alone) if measured else (),
            asked(facts, situation, () if alone else values, names)
            if measured and situation not in with_one_value
            else (),
        )
    return found

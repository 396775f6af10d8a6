"""Perceivers: functions that read the values of situation types from a world, and that set values up in a new world.

Each situation type of the ontology has a perceiver, thresholds (in metres, newtons and radians) and individuals that stand for
special values. `BUILT_IN` lists the perceivers of this package. The function `observe` returns the value that holds for the
arguments, or None. The function `arrange` makes a value true in the draft of a new world. `code` is the failure code of a
primitive whose expected value is not observed.
Perceivers of other packages register as entry points of the group `confab.perceivers`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from importlib.metadata import entry_points

import numpy as np

from confab.reasoner.amounts import written
from confab.reasoner.embodiment.values import PerceiverUse
from confab.reasoner.symbols import FALSE, TRUE
from confab.sim.base import offset_from_stand
from confab.sim.engine import Engine
from confab.sim.measured import measure as measure_measured
from confab.sim.measured import observe_measured
from confab.sim.urdf import Array
from confab.sim.whereabouts import level_place, point_of


@dataclass
class Draft:
    """The layout of a new world: places of bodies, contents and servings of vessels, open links, stands of robots."""

    places: dict[str, str] = field(default_factory=dict)
    contents: dict[str, list[str]] = field(default_factory=dict)
    servings: dict[str, float] = field(default_factory=dict)
    opened: dict[str, bool] = field(default_factory=dict)
    stands: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Perceiver:
    """The functions that read and set up values of situation types, and a failure code.

    `spatial` is true if the values are positions. `measure` returns the measured numbers that determine the value.
    """

    observe: Callable[[Engine, PerceiverUse, tuple[str, ...]], str | None]
    arrange: Callable[[Draft, PerceiverUse, tuple[str, ...], str], None]
    code: str
    spatial: bool = False
    measure: Callable[[Engine, PerceiverUse, tuple[str, ...]], Mapping[str, float]] | None = None


def tilt_of(rotation: Array) -> float:
    """Return the angle in radians between a frame's z axis and the vertical."""
    return float(np.arccos(np.clip(rotation[2, 2], -1.0, 1.0)))


# ------------------------------------------------------------------------------------------ places of objects


def observe_place(world: Engine, use: PerceiverUse, arguments: tuple[str, ...]) -> str | None:
    """Return the place at which the object stands, or `in_hand` if a hand holds it."""
    body = arguments[0]
    if not world.knows(body):
        return None
    rotation, position = world.sense(body)
    place, beside = level_place(world, position, use.numbers["contact_height"], world.load(body))
    if beside < use.numbers["nearness"] and tilt_of(rotation) < use.numbers["upright_angle"]:
        return place
    if any(world.held(hand) == body for hand in world.hands):
        return use.values["in_hand"]
    return None


def measure_place(world: Engine, use: PerceiverUse, arguments: tuple[str, ...]) -> Mapping[str, float]:
    """Return the horizontal and vertical distance of an object from the nearest place, and the object's tilt."""
    if not world.knows(arguments[0]) or not world.embodiment.places:
        return {}
    rotation, position = world.sense(arguments[0])
    load = world.load(arguments[0])
    gaps = [
        position - world.place(name) for name, place in world.embodiment.places.items() if place.carrier not in load
    ]
    nearest = min(gaps, key=lambda gap: float(np.linalg.norm(gap)), default=None)
    if nearest is None:
        return {}
    beside, above = float(np.hypot(*nearest[:2])), float(nearest[2])
    return {"beside_place_m": beside, "above_place_m": above, "tilt_rad": tilt_of(rotation)}


def arrange_place(draft: Draft, use: PerceiverUse, arguments: tuple[str, ...], value: str) -> None:
    """Put the object at a place; raise `ValueError` for an object in a hand, since hands are empty in a new world."""
    if value == use.values["in_hand"]:
        raise ValueError(f"a world cannot begin with {arguments[0]} in a hand: let it stand at a place")
    draft.places[arguments[0]] = value


# ------------------------------------------------------------------------------------------ contents of vessels


def observe_content(world: Engine, use: PerceiverUse, arguments: tuple[str, ...]) -> str | None:
    """Return the main filling of the vessel, or `empty` if the vessel contains less than `least` servings of each filling."""
    if not world.knows(arguments[0]):
        return None
    amounts = {name: world.amount(arguments[0], name) for name in world.embodiment.fillings if name in use.choices}
    enough = {name: amount for name, amount in amounts.items() if amount >= use.numbers["least"]}
    return max(enough, key=enough.__getitem__) if enough else use.values["empty"]


def arrange_content(draft: Draft, use: PerceiverUse, arguments: tuple[str, ...], value: str) -> None:
    """Fill the vessel, unless the value is `empty`."""
    if value != use.values["empty"]:
        draft.contents.setdefault(arguments[0], []).append(value)


def observe_servings(world: Engine, use: PerceiverUse, arguments: tuple[str, ...]) -> str | None:
    """Return the number of servings in the vessel, rounded to a multiple of `grain`."""
    if not world.knows(arguments[0]):
        return None
    grain = Fraction(str(use.numbers["grain"]))
    return written(round(world.servings(arguments[0]) / grain) * grain)


def arrange_servings(draft: Draft, use: PerceiverUse, arguments: tuple[str, ...], value: str) -> None:
    """Set the number of servings in the vessel."""
    draft.servings[arguments[0]] = float(Fraction(value))


# ------------------------------------------------------------------------------------------ hands


def observe_held(world: Engine, use: PerceiverUse, arguments: tuple[str, ...]) -> str | None:
    """Return the body that both fingers press, or `nothing`."""
    return world.held(arguments[0], use.numbers["force"]) or use.values["nothing"]


def observe_position(world: Engine, use: PerceiverUse, arguments: tuple[str, ...]) -> str | None:
    """Return the position to which a hand has moved: `raised`, an object, or a place.

    Return None if the hand was stopped on its way, or if the object at its position has moved away without the hand.
    """
    hand = arguments[0]
    at = world.hands[hand].at
    if at.lost:
        return None
    if at.point is None:
        return use.values["raised"]
    if at.target in world.embodiment.places or world.held(hand) == at.target:
        return at.target
    there = (
        world.knows(at.target)
        and float(np.linalg.norm(point_of(world, at.target) - at.point)) < use.numbers["nearness"]
    )
    return at.target if there else None


def observe_tilt(world: Engine, use: PerceiverUse, arguments: tuple[str, ...]) -> str | None:
    """Return `upright` or `tilted` for a hand, or None for a tilt between the two thresholds."""
    angle = tilt_of(world.hands[arguments[0]].frame()[0])
    if angle <= use.numbers["upright_angle"]:
        return use.values["upright"]
    return use.values["tilted"] if angle >= use.numbers["tilted_angle"] else None


# ------------------------------------------------------------------------------------------ joints


def observe_joint(world: Engine, use: PerceiverUse, arguments: tuple[str, ...]) -> str | None:
    """Return `opened` or `shut` for a link, or None for a joint value between the two thresholds."""
    name = arguments[0]
    if name not in world.links:
        return None
    link, value = world.links[name].link(name), world.links[name].values()[name]
    if value >= link.opened:
        return use.values.get("opened", "true")
    return use.values.get("shut", "false") if value <= link.shut else None


def measure_joint(world: Engine, use: PerceiverUse, arguments: tuple[str, ...]) -> Mapping[str, float]:
    """Return the present value of a joint, the minimum value at which it is open, and the maximum value at which it is shut."""
    if arguments[0] not in world.links:
        return {}
    name, mechanic = arguments[0], world.links[arguments[0]]
    link = mechanic.link(name)
    return {"joint": mechanic.values()[name], "opened": link.opened, "shut": link.shut}


def arrange_joint(draft: Draft, use: PerceiverUse, arguments: tuple[str, ...], value: str) -> None:
    """Open the link, or leave the link shut."""
    draft.opened[arguments[0]] = value == use.values.get("opened", "true")


# ------------------------------------------------------------------------------------------ visibility


def observe_covered(world: Engine, use: PerceiverUse, arguments: tuple[str, ...]) -> str | None:
    """Return whether something other than a robot hides a known object."""
    name = arguments[0]
    if not world.knows(name):
        return None
    robots = {hand.body for hand in world.hands.values()}
    return TRUE if not world.perceives(name) and world.sight().covers.get(name) not in robots else FALSE


def arrange_nothing(draft: Draft, use: PerceiverUse, arguments: tuple[str, ...], value: str) -> None:
    """Do nothing, since the value follows from the positions of objects."""


# ------------------------------------------------------------------------------------------ stands of robots


def observe_stand(world: Engine, use: PerceiverUse, arguments: tuple[str, ...]) -> str | None:
    """Return the stand at whose position and heading the robot's base is, or None."""
    if arguments[0] not in world.bases:
        return None
    for name, stand in world.embodiment.stands.items():
        away, turned = offset_from_stand(world.bases[arguments[0]], stand)
        if away < use.numbers["nearness"] and turned < use.numbers["angle_tolerance"]:
            return name
    return None


def arrange_stand(draft: Draft, use: PerceiverUse, arguments: tuple[str, ...], value: str) -> None:
    """Put the robot at the stand."""
    draft.stands[arguments[0]] = value


# ------------------------------------------------------------------------------------------ rest values


def arrange_rest(special: str) -> Callable[[Draft, PerceiverUse, tuple[str, ...], str], None]:
    """Return an `arrange` function that accepts only the value `special`, since hands are at rest in a new world."""

    def arrange(draft: Draft, use: PerceiverUse, arguments: tuple[str, ...], value: str) -> None:
        """Accept the rest value; raise `ValueError` for any other value."""
        if value != use.values[special]:
            raise ValueError(
                f"a world cannot begin with {use.situation} of {arguments[0]} {value}: only {use.values[special]}"
            )

    return arrange


BUILT_IN: Mapping[str, Perceiver] = {
    "perceive_place": Perceiver(observe_place, arrange_place, "misplaced", True, measure_place),
    "perceive_content": Perceiver(observe_content, arrange_content, "under-pour"),
    "perceive_servings": Perceiver(observe_servings, arrange_servings, "under-pour"),
    "perceive_held": Perceiver(observe_held, arrange_rest("nothing"), "slip or drop"),
    "perceive_hand_position": Perceiver(observe_position, arrange_rest("raised"), "unexpected", True),
    "perceive_joint": Perceiver(observe_joint, arrange_joint, "stuck", True, measure_joint),
    "perceive_measured": Perceiver(observe_measured, arrange_nothing, "unexpected", measure=measure_measured),
    "perceive_covered": Perceiver(observe_covered, arrange_nothing, "unexpected"),
    "perceive_stand": Perceiver(observe_stand, arrange_stand, "misplaced", True),
    "perceive_hand_tilt": Perceiver(observe_tilt, arrange_rest("upright"), "unexpected"),
}


def perceiver(name: str) -> Perceiver:
    """Return the built-in perceiver or the entry point of the given name; raise `KeyError` if there is none."""
    if name in BUILT_IN:
        return BUILT_IN[name]
    for point in entry_points(group="confab.perceivers", name=name):
        found: Perceiver = point.load()
        return found
    raise KeyError(
        f"no perceiver '{name}' (built in: {', '.join(BUILT_IN)}; others register in the group confab.perceivers)"
    )

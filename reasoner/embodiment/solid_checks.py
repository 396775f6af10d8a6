"""Validation rules on overlapping solids: joints moved through their range, and objects in the initial state.

Each joint of a mechanism is moved from `lower` to `upper`. The moved links must not overlap the base of their mechanism,
neighbouring links or furniture. A neighbouring link that can move may be shut, or open as wide as a hand opens it. An overlap
with a link that can move is a fault only if it occurs both when this link is shut and when it is open.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations

import numpy as np

from confab.reasoner.embodiment.solids import PlacedSolid, blocks_of, body_blocks, fixture_block, overlap, place_frame
from confab.reasoner.embodiment.values import Embodiment, Flaw, Link, Mechanism
from confab.reasoner.possible import PLACE
from confab.reasoner.symbols import TRUE, State

JOINT = "perceive_joint"
"""The perceiver that distinguishes an open joint from a shut joint."""

DEEP = 0.0015
"""Maximum overlap in metres at which two solids still count as being only in contact."""

SAMPLES = 33
"""Number of joint values at which the links are checked."""

Met = tuple[float, float, PlacedSolid, PlacedSolid]
"""Depth of an overlap in metres, the joint value, and the two solids."""


def through_a_solid(embodiment: Embodiment) -> Iterator[Flaw]:
    """Yield links that pass through solids of their own mechanism, of another mechanism or of furniture."""
    own = [mechanism for mechanism in embodiment.mechanisms if not mechanism.urdf]
    for mechanism in own:
        around = [fixture_block(fixture) for fixture in embodiment.fixtures]
        around += [block for other in own if other is not mechanism for block in blocks_of(other, {})]
        yield from _base_inside(mechanism, around)
        for link in mechanism.links:
            yield from _swept(mechanism, link, around)


def _base_inside(mechanism: Mechanism, around: Sequence[PlacedSolid]) -> Iterator[Flaw]:
    """Yield, for each neighbouring body, its deepest overlap with the base of a mechanism."""
    base = [block for block in blocks_of(mechanism, {}) if block.owner == mechanism.name]
    for _, _, one, other in _deepest(_meeting(base, around, 0.0)):
        yield _flaw(one, other, overlap(one, other), "", f"move {mechanism.name} or {other.owner} apart")


def _swept(mechanism: Mechanism, link: Link, around: Sequence[PlacedSolid]) -> Iterator[Flaw]:
    """Yield, for each body that a link passes through, the deepest overlap."""
    taken = _taken_along(mechanism, link)
    values = np.linspace(link.lower, link.upper, SAMPLES) if link.kind != "fixed" else np.zeros(1)
    met: list[Met] = []
    neighbours = [one for one in mechanism.links if one.name not in taken and one.kind != "fixed"]
    opened = {one.name: one.wide for one in neighbours}
    for value in values.tolist():
        shut = blocks_of(mechanism, {link.name: value})
        moving = [block for block in shut if block.owner in taken]
        met += _meeting(moving, [*around, *_still(mechanism, shut, link, opened)], value)
        beside = {block.part: block for block in blocks_of(mechanism, {**opened, link.name: value})}
        for pair in _meeting(moving, [block for block in shut if block.owner in opened], value):
            if overlap(pair[2], beside[pair[3].part]) > DEEP:
                met.append(pair)
    for deep, value, one, other in _deepest(met):
        if other.part not in link.touches and one.part not in link.touches:
            begun = min((at for _, at, a, b in met if (a.owner, b.owner) == (one.owner, other.owner)), key=abs)
            where = f" where the joint of {link.name} is at {value:.3g}"
            if begun != value:
                where += f" (and from {begun:.3g} on)"
            if other.owner in opened:
                where += f", whether {other.owner} is shut or at {opened[other.owner]:.3g}, to which a hand opens it"
            remedy = (
                f"move or shorten one of the two, or end the joint of {link.name} before they meet (e:lower, e:upper)"
            )
            if other.part:
                remedy += f"; if they are meant to touch, state e:touchesPart {other.part} of {link.name}"
            yield _flaw(one, other, deep, where, remedy)


def _still(
    mechanism: Mechanism, shut: Sequence[PlacedSolid], link: Link, opened: Mapping[str, float]
) -> Iterator[PlacedSolid]:
    """Yield the solids of a mechanism that remain at rest while a link and its neighbours move."""
    taken = _taken_along(mechanism, link)
    return (block for block in shut if block.owner not in taken and block.owner not in opened)


def _taken_along(mechanism: Mechanism, link: Link) -> set[str]:
    """Return a link and all links that it carries."""
    found = {link.name}
    for one in mechanism.links:  # parents come before children
        if one.parent in found:
            found.add(one.name)
    return found


def _meeting(ones: Sequence[PlacedSolid], others: Sequence[PlacedSolid], value: float) -> Iterator[Met]:
    """Yield the overlapping pairs of solids, with the depth of the overlap and the given joint value."""
    if not ones or not others:
        return
    boxes = [
        (np.array([b.center for b in some]), np.array([b.extent(np.eye(3)) for b in some])) for some in (ones, others)
    ]
    (middles, sizes), (there, wide) = boxes
    near = (np.abs(middles[:, None] - there[None]) < sizes[:, None] + wide[None] - DEEP).all(-1)
    for i, j in np.argwhere(near):
        deep = overlap(ones[i], others[j])
        if deep > DEEP:
            yield deep, value, ones[i], others[j]


def _deepest(met: Iterator[Met] | Sequence[Met]) -> list[Met]:
    """Return the deepest overlap for each pair of bodies."""
    found: dict[tuple[str, str], Met] = {}
    for one in met:
        key = one[2].owner, one[3].owner
        if key not in found or one[0] > found[key][0]:
            found[key] = one
    return list(found.values())


def _flaw(one: PlacedSolid, other: PlacedSolid, deep: float, where: str, remedy: str) -> Flaw:
    return (
        one.part or one.owner,
        f"{one.name} is {deep * 1000:.0f} mm inside {other.name}{where}",
        "solids don't pass through each other: physics would stop the joint, or push the two apart",
        remedy,
    )


def overlapping_at_first(embodiment: Embodiment, initial: State) -> Iterator[Flaw]:
    """Yield objects that overlap another object, furniture or a mechanism in the initial state.

    Two objects at the same place aren't yielded, because the rules on exclusive values report this fault.
    """
    where, values = _initially(embodiment, initial)
    standing: dict[str, list[PlacedSolid]] = {}
    for name, place in where.items():
        frame = place_frame(embodiment, place, where, values)
        if frame is not None and name in embodiment.bodies:
            standing[name] = [*body_blocks(embodiment.bodies[name], frame)]
    around = [fixture_block(fixture) for fixture in embodiment.fixtures]
    around += [block for one in embodiment.mechanisms if not one.urdf for block in blocks_of(one, values)]
    vessels = {name for name, body in embodiment.bodies.items() if body.shape.kind == "vessel"}
    met = [one for blocks in standing.values() for one in _meeting(blocks, around, 0.0)]
    for one, other in combinations(standing, 2):
        on = {embodiment.places[where[one]].carrier: other, embodiment.places[where[other]].carrier: one}
        inside = any(lower in vessels and upper in (one, other) for lower, upper in on.items())
        if not inside and where[one] != where[other]:  # an object in a vessel is between the vessel's walls
            met += _meeting(standing[one], standing[other], 0.0)
    for deep, _, first, second in _deepest(met):
        places = [f"{name} is at {where[name]}" for name in (first.owner, second.owner) if name in where]
        yield (
            first.owner,
            f"{first.name} is {deep * 1000:.0f} mm inside {second.name} initially",
            f"{' and '.join(places)}: two solids in one place, which physics would push apart",
            f"move the places apart by {deep * 1000:.0f} mm or more, or begin with {first.owner} at another place",
        )


def _initially(embodiment: Embodiment, initial: State) -> tuple[dict[str, str], dict[str, float]]:
    """Return the place of each object and the value of each joint in a state."""
    where: dict[str, str] = {}
    values: dict[str, float] = {}
    links = {link.name: link for mechanism in embodiment.mechanisms for link in mechanism.links}
    for symbol, value in initial.items():
        use = embodiment.perceivers.get(symbol.situation)
        if use is not None and use.perceiver == PLACE and value in embodiment.places:
            where[symbol.arguments[0]] = value
        if use is not None and use.perceiver == JOINT and symbol.arguments[0] in links:
            link = links[symbol.arguments[0]]
            values[link.name] = link.opened if value == use.values.get("opened", TRUE) else 0.0
    return where, values


RULES = {"through-a-solid": through_a_solid}
FIRST_RULES = {"overlapping-at-first": overlapping_at_first}

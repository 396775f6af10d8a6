"""What stands in the way of a link that moves with its joint: now, and wherever else it would.

Whoever moves the link, and whichever way: a body that the link would meet between `shut` and `opened` stops it. So one motion
that is found blocked tells of all that would be blocked likewise.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from reasoner.embodiment.values import PerceiverUse, SkillUse
from reasoner.refutations import Refutation
from reasoner.symbols import Fact, Symbol
from sim.bodies import height_of, outline
from sim.collision import column
from sim.engine import Engine
from sim.linkage import wide
from sim.running import evaluate
from sim.urdf import Array
from sim.verdict import SkillError

SAMPLES = 9
"""Values of a joint at which its link is looked at on its way."""


def gap(world: Engine, link: str, values: Sequence[float], body: str, pose: tuple[Array, Array]) -> float:
    """Return the metres that a link keeps from a body at a pose, on its way through some values of its joint."""
    mechanic, shape = world.links[link], world.bodies[body].shape
    spheres = column(*outline(shape), bottom=height_of(shape) / 10)
    points = pose[1] + spheres.centers @ pose[0].T
    gaps = (
        float((solid.distance(points) - spheres.radii).min())
        for value in values
        for solid in mechanic.solids({**mechanic.values(), link: value})
        if solid.name == link
    )
    return min(gaps, default=1.0)


def check_swing(world: Engine, link: str, values: Sequence[float]) -> None:
    """Raise `SkillError` if a body stands where a link passes on its way through some values of its joint."""
    for name in world.bodies:
        if not world.knows(name):
            continue
        pose = world.sense(name)
        if world.known[name][0] == link:
            continue
        left = gap(world, link, values[1:], name, pose)
        if left <= 0:
            error = SkillError("no path", (link, name), f"{name} stands in the way of {link}", clearance_m=left)
            error.verdict = replace(error.verdict, swings=link)
            raise error


def refuted(world: Engine, symbols: Iterable[Symbol], link: str) -> tuple[Refutation, ...]:
    """Return what can't be done as long as something stands in the way of a link, wherever that would be, whoever does it."""
    found = [fact for symbol in symbols for fact in _in_the_way(world, symbol, link)]
    return tuple(
        Refutation(
            use.behavior, tuple(link if part == role else "" for part in use.parameters), (fact,), _why(link, fact)
        )
        for use in world.embodiment.skills.values()
        for role in _moving(world, use, link)
        for fact in found
    )


def _why(link: str, fact: Fact) -> str:
    return f"no path: {link}, {fact.symbol.arguments[0]}"


def _moving(world: Engine, use: SkillUse, link: str) -> Iterator[str]:
    """Yield the role of a link that a skill moves all the way between shut and opened."""
    one = world.links[link].link(link)
    known = {"opened": one.opened, "shut": one.shut, "lower": one.lower, "upper": one.upper, "wide": wide(one)}
    for phase in use.phases:
        role = phase.to.partition(".")[0]
        if phase.motion == "joint" and role in use.parameters and link in use.links.get(role, ()):
            value = evaluate(phase.value, {**use.numbers, **known})
            if value <= one.shut or value >= one.opened:
                yield role


def _in_the_way(world: Engine, symbol: Symbol, link: str) -> Iterator[Fact]:
    """Yield where a body would be in the way: at which places, and in a hand that has taken it from where it is."""
    use, body = world.embodiment.perceivers[symbol.situation], symbol.arguments[0]
    if use.perceiver != "perceive_place" or body not in world.bodies or not world.knows(body):
        return
    one = world.links[link].link(link)
    values = np.linspace(one.shut, one.opened, SAMPLES).tolist()
    moving = {*world.bodies, *(link for mechanic in world.mechanics for link in mechanic.joints)}
    for name, place in world.embodiment.places.items():
        if place.carrier not in moving and gap(world, link, values, body, (np.eye(3), world.place(name))) <= 0:
            yield Fact(symbol, name)
            if _lifted_into(world, use, link, body, name, values):
                yield Fact(symbol, use.values["in_hand"])


def _lifted_into(world: Engine, use: PerceiverUse, link: str, body: str, place: str, values: Sequence[float]) -> bool:
    """Tell whether a body that stands at a place is in the way, too, where a hand has lifted it from there."""
    point = world.place(place)
    rotation, base = world.sense(body)
    if float(np.linalg.norm(base - point)) > use.numbers["nearness"]:
        return False
    rises = [
        evaluate(phase.above, one.numbers)
        for one in world.embodiment.skills.values()
        for phase in one.phases
        if phase.motion == "rise"
    ]
    above = np.array([0.0, 0.0, max(rises, default=0.0)])
    return bool(rises) and gap(world, link, values, body, (rotation, point + above)) <= 0

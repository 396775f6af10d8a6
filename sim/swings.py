"""Bodies that block the motion of a link, such as a door, at their present places and at all other places.

A body that the link would touch between the joint values `shut` and `opened` blocks the link for every hand and in both
directions. Therefore one blocked motion refutes all similar motions.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from confab.reasoner.embodiment.skill_checks import JOINT_NUMBERS
from confab.reasoner.embodiment.skills import evaluate
from confab.reasoner.embodiment.values import PerceiverUse, SkillUse
from confab.reasoner.refutations import Refutation
from confab.reasoner.symbols import Fact, Symbol
from confab.sim.bodies import height_of, outline
from confab.sim.collision import column
from confab.sim.engine import Engine
from confab.sim.urdf import Array
from confab.sim.verdict import SkillError

SAMPLES = 9
"""Number of joint values at which a link is checked for contact."""


def gap(world: Engine, link: str, values: Sequence[float], body: str, pose: tuple[Array, Array]) -> float:
    """Return the smallest distance in metres between a link and a body at a pose, over the given values of the link's joint."""
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
    """Raise `SkillError` if a body blocks a link at any of the given values of its joint."""
    for name in world.bodies:
        if not world.knows(name):
            continue
        pose = world.sense(name)
        if world.known[name][0] == link:
            continue
        gaps = {value: gap(world, link, [value], name, pose) for value in values[1:]}
        met = min(gaps, key=gaps.__getitem__)
        if gaps[met] <= 0:
            message = f"{name} stands in the way of {link}"
            error = SkillError("no path", (link, name), message, clearance_m=gaps[met], joint=met)
            error.verdict = replace(error.verdict, swings=link)
            raise error


def refuted(world: Engine, symbols: Iterable[Symbol], link: str) -> tuple[Refutation, ...]:
    """Return refutations of the motions of a link; each refutation holds while a body blocks the link from its place."""
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
    """Yield the roles in which a skill moves a link until the link is shut or opened."""
    one = world.links[link].link(link)
    known = {name: getattr(one, name) for name in JOINT_NUMBERS}
    for phase in use.phases:
        role = phase.to.partition(".")[0]
        if phase.motion == "joint" and role in use.parameters and link in use.links.get(role, ()):
            value = evaluate(phase.value, {**use.numbers, **known})
            if value <= one.shut or value >= one.opened:
                yield role


def _in_the_way(world: Engine, symbol: Symbol, link: str) -> Iterator[Fact]:
    """Yield the facts under which a body blocks the link: places of the body, or a hand that has lifted the body."""
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
    """Return whether a body at a place still blocks the link after a hand has lifted the body from the place."""
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

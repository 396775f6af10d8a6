"""Detection of faulty mechanisms: shipped mechanisms with a moved part, a wider limit or a turned axis.

    python -m benchmarks.solids [MUTANTS [SEED]]

The distances of PyBullet between shapes tell whether a mutant is faulty, independently of the tested validation. A mutant is
faulty if two solids overlap by 3 mm or more at a value of a joint. A mutant is harmless if no solids overlap at any value.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pybullet

import confab
from confab.reasoner.embodiment.solid_checks import through_a_solid
from confab.reasoner.embodiment.values import Embodiment, Link, Mechanism, Part
from confab.sim.bodies import load_written
from confab.sim.linkage import written

EXAMPLES = Path(__file__).parents[1] / "docs" / "examples"
SHIPPED = ("kitchen-corner", "centrifuge", str(EXAMPLES / "workshop/workshop.ttl"), str(EXAMPLES / "sluice/sluice.ttl"))
"""Scenes with mechanisms. Scenes that import one of these scenes add no mechanisms."""

WRONG, HARMLESS = 0.003, 0.0
"""Minimum overlap of a faulty mutant, and maximum overlap of a harmless mutant, in metres."""

VALUES = 25
"""Number of values of each joint at which PyBullet's distances are computed."""


@dataclass(frozen=True)
class Mutant:
    """The embodiment of a scene with one change, and the maximum overlap of two solids over the values of a joint, in metres."""

    scene: str
    change: str
    embodiment: Embodiment
    depth: float

    @property
    def refused(self) -> bool:
        """Whether validation finds a solid that passes through another solid."""
        return next(iter(through_a_solid(self.embodiment)), None) is not None


def mutants(seed: int = 0, scenes: Sequence[str] = SHIPPED) -> Iterator[Mutant]:
    """Yield mutants of the shipped mechanisms, without end."""
    rng = np.random.default_rng(seed)
    shipped = [(Path(name).stem, confab.load(name).embodiment) for name in scenes]
    while True:
        scene, embodiment = shipped[rng.integers(len(shipped))]
        moving = [mechanism for mechanism in embodiment.mechanisms if mechanism.links]
        mechanism = moving[rng.integers(len(moving))]
        link = mechanism.links[rng.integers(len(mechanism.links))]
        change, other = _changed(link, rng)
        links = tuple(other if one is link else one for one in mechanism.links)
        changed = replace(mechanism, links=links)
        every = tuple(changed if one is mechanism else one for one in embodiment.mechanisms)
        mutated = replace(embodiment, mechanisms=every)
        yield Mutant(scene, change, mutated, depth_of(mutated, changed))


def _changed(link: Link, rng: np.random.Generator) -> tuple[str, Link]:
    """Return a link with a moved part, a wider limit or a turned axis."""
    kind = ("part", "limit", "axis")[rng.integers(3)]
    if kind == "part":
        part = link.parts[rng.integers(len(link.parts))]
        step = rng.uniform(0.02, 0.1) * (1 if rng.random() < 0.5 else -1)
        moved = [float(value) for value in part.position]
        moved[rng.integers(3)] += float(step)
        other: Part = replace(part, position=(moved[0], moved[1], moved[2]))
        return f"{part.name} moved", replace(link, parts=tuple(other if one is part else one for one in link.parts))
    if kind == "limit":
        wider = float(rng.uniform(1.0, 3.0)) * (link.upper - link.lower)
        if rng.random() < 0.5:
            return f"upper limit of {link.name} widened", replace(link, upper=link.upper + wider)
        return f"lower limit of {link.name} widened", replace(link, lower=link.lower - wider)
    x, y, z = link.axis
    turned = ((y, z, x), (z, x, y), (-x, -y, -z))[rng.integers(3)]
    return f"axis of {link.name} turned", replace(link, axis=turned)


def depth_of(embodiment: Embodiment, mechanism: Mechanism) -> float:
    """Return the maximum overlap in metres, by PyBullet, of a mechanism's solids with any solids over the values of its joints."""
    client = pybullet.connect(pybullet.DIRECT)
    try:
        own, numbers = _loaded(client, mechanism)
        others = [_loaded(client, one)[0] for one in embodiment.mechanisms if one is not mechanism]
        for fixture in embodiment.fixtures:
            half = [extent / 2 for extent in fixture.size]
            shape = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half, physicsClientId=client)
            turned = pybullet.getQuaternionFromEuler([0, 0, fixture.yaw])
            others.append(pybullet.createMultiBody(0, shape, -1, fixture.position, turned, physicsClientId=client))
        return max((_swept(client, own, others, mechanism, link, numbers) for link in mechanism.links), default=0.0)
    finally:
        pybullet.disconnect(client)


def _loaded(client: int, mechanism: Mechanism) -> tuple[int, Mapping[str, int]]:
    turned = pybullet.getQuaternionFromEuler([0, 0, mechanism.yaw])
    body = load_written(written(mechanism), mechanism.position, turned, useFixedBase=True, physicsClientId=client)
    count = pybullet.getNumJoints(body, physicsClientId=client)
    return body, {pybullet.getJointInfo(body, i, physicsClientId=client)[12].decode(): i for i in range(count)}


def _swept(
    client: int, own: int, others: Sequence[int], mechanism: Mechanism, link: Link, numbers: Mapping[str, int]
) -> float:
    """Return the maximum overlap of a link over the values of its joint, with neighbouring joints shut or wide open."""
    deepest, names = 0.0, {-1: mechanism.name} | {number: name for name, number in numbers.items()}
    owners: list[Mechanism | Link] = [mechanism, *mechanism.links]
    parts = {one.name: {part.name for part in one.parts} for one in owners}
    for value in np.linspace(link.lower, link.upper, VALUES):
        for one in mechanism.links:
            at = float(value) if one is link else 0.0
            pybullet.resetJointState(own, numbers[one.name], at, physicsClientId=client)
        number = numbers[link.name]
        for body in others:
            for i in range(-1, pybullet.getNumJoints(body, physicsClientId=client)):
                deepest = max(deepest, _depth(client, (own, number), (body, i)))
        for i in {-1, *numbers.values()} - {number}:
            if parts[names[i]] & {*link.touches}:
                continue
            depth = _depth(client, (own, number), (own, i))
            if i >= 0 and depth > 0:
                upper = next(one.upper for one in mechanism.links if one.name == names[i])
                pybullet.resetJointState(own, i, upper, physicsClientId=client)
                depth = min(depth, _depth(client, (own, number), (own, i)))
                pybullet.resetJointState(own, i, 0.0, physicsClientId=client)
            deepest = max(deepest, depth)
    return deepest


def _depth(client: int, one: tuple[int, int], other: tuple[int, int]) -> float:
    points = pybullet.getClosestPoints(one[0], other[0], 0.001, one[1], other[1], physicsClientId=client)
    return max((-float(point[8]) for point in points if point[8] < 0), default=0.0)


def main() -> None:
    """Print the numbers of faulty mutants, harmless mutants and shipped mechanisms that validation refuses."""
    most, seed = (int(word) for word in [*sys.argv[1:], *("40", "0")[len(sys.argv) - 1 :]])
    counts: Counter[tuple[str, bool]] = Counter()
    for mutant in mutants(seed):
        kind = "wrong" if mutant.depth >= WRONG else "harmless" if mutant.depth <= HARMLESS else "touching"
        counts[kind, mutant.refused] += 1
        if (kind == "wrong" and not mutant.refused) or (kind == "harmless" and mutant.refused):
            print(f"{kind}: {mutant.scene}, {mutant.change}, {mutant.depth * 1000:.1f} mm")
        if counts["wrong", True] + counts["wrong", False] >= most:
            break
    for kind in ("wrong", "harmless", "touching"):
        print(f"{kind}: {counts[kind, True]} of {counts[kind, True] + counts[kind, False]} mutants refused")
    alarms = sum(len([*through_a_solid(confab.load(name).embodiment)]) for name in SHIPPED)
    print(f"shipped: {alarms} findings in {len(SHIPPED)} scenes")


if __name__ == "__main__":
    main()

"""Validation rules on mechanisms without their own URDF file: joints, features, solids and places (`RULES`)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from confab.reasoner.embodiment.values import Embodiment, Feature, Flaw, Link, Mechanism, Part

JOINT = "perceive_joint"
"""The perceiver that distinguishes an open joint from a shut joint."""


def _links(embodiment: Embodiment) -> Iterator[Link]:
    return (link for mechanism in embodiment.mechanisms if not mechanism.urdf for link in mechanism.links)


def joint_that_stays(embodiment: Embodiment) -> Iterator[Flaw]:
    """Yield links that should move according to the ontology, but whose joint is fixed or has no range."""
    for link in _links(embodiment):
        reach = f"from {link.lower:g} to {link.upper:g}"
        if link.kind == "fixed" and (link.lower or link.upper):
            yield (
                link.name,
                f"{link.name} moves {reach}, but its e:joint is fixed or not stated",
                "a link without a joint of its own is rigid",
                f'state e:joint "revolute" or "prismatic" of {link.name}, or drop e:lower and e:upper',
            )
        if link.kind != "fixed" and link.lower >= link.upper:
            yield (
                link.name,
                f"the joint of {link.name} goes {reach}",
                "a joint moves from e:lower (0 by default) up to e:upper",
                f"state an e:upper of {link.name} above its e:lower; swap the two if they are reversed",
            )


def threshold_outside(embodiment: Embodiment) -> Iterator[Flaw]:
    """Yield joints with faulty thresholds: a joint is always or never open, always or never shut, or both at once."""
    uses = [use for use in embodiment.perceivers.values() if use.perceiver == JOINT]
    perceived = {name for use in uses for name in use.links}
    for link in _links(embodiment):
        if link.kind == "fixed" or link.lower >= link.upper or link.name not in perceived:
            continue
        wrong = []
        if not link.lower < link.opened <= link.upper:
            wrong.append(f"open from {link.opened:g} on")
        if not link.lower <= link.shut < link.upper:
            wrong.append(f"shut up to {link.shut:g}")
        if not wrong and link.shut > link.opened:
            wrong.append(f"open from {link.opened:g} on and as shut up to {link.shut:g}, so that both overlap")
        for said in wrong:
            yield (
                link.name,
                f"the joint of {link.name} goes from {link.lower:g} to {link.upper:g}, and counts as {said}",
                "the joint's value has to distinguish open from shut",
                f"correct the numbers of {link.name}: e:lower <= e:shut < e:opened <= e:upper",
            )


def feature_off_its_part(embodiment: Embodiment) -> Iterator[Flaw]:
    """Yield features whose distance to their nearest part exceeds the opening of the widest hand."""
    openings = [2 * hand.opening for robot in embodiment.robots for hand in robot.hands]
    for link in _links(embodiment) if openings else ():
        own = {part.name: part for part in link.parts if part.kind != "mesh"}
        for feature in link.features.values():
            touched = [part for name in feature.parts if (part := own.get(name)) is not None]
            away = min((_least_distance(feature, part) for part in touched), default=0.0)
            if len(touched) == len(feature.parts) and away > max(openings):
                yield (
                    touched[0].name,
                    f"{touched[0].name} is {away * 100:.0f} cm or more away from the feature {feature.name} of {link.name}, "
                    "where the fingers touch the part",
                    "the fingers would close on nothing",
                    f"correct the coordinates of {touched[0].name} or of the feature: both are in the frame of {link.name}",
                )


def _least_distance(feature: Feature, part: Part) -> float:
    """Return a lower bound of the distance between a feature and a part: the distance to the part's bounding sphere."""
    return math.dist(feature.position, part.position) - math.hypot(*part.size) / 2


def part_of_two(embodiment: Embodiment) -> Iterator[Flaw]:
    """Yield solids that belong to two links, or to a link and its mechanism."""
    owners: dict[str, str] = {}
    for name, parts in _bodies(embodiment):
        for part in parts:
            first = owners.setdefault(part.name, name)
            if first != name:
                yield (
                    part.name,
                    f"{part.name} is part of {first} and of {name}",
                    "a solid moves with one link; a shared solid would exist twice",
                    f"state a separate part for {name}",
                )


def carried_off_its_surface(embodiment: Embodiment) -> Iterator[Flaw]:
    """Yield faulty places of furniture and links: places that aren't on a supporting surface, or that are inside a solid.

    Places near meshes and tilted solids aren't checked.
    """
    bodies = dict(_bodies(embodiment))
    grounds = {mechanism.name: mechanism for mechanism in embodiment.mechanisms}
    for place in embodiment.places.values():
        parts = bodies.get(place.carrier, ())
        near = [part for part in parts if _distance_beside(part, place.position) <= 0]
        if not parts or any(
            _without_flat_top(part) for part in parts if math.dist(part.position, place.position) < max(part.size)
        ):
            continue
        x, y, z = place.position
        tops = [part.position[2] + part.size[2] / 2 for part in near]
        inside = [part for part, top in zip(near, tops, strict=True) if top - part.size[2] < z + SURFACE < top]
        ground = place.carrier in grounds and _on_ground(embodiment, grounds[place.carrier], place.position)
        if inside or not (ground or any(abs(top - z) < SURFACE for top in tops)):
            where = f"inside {inside[0].name}" if inside else f"not on a surface of {place.carrier}"
            yield (
                place.name,
                f"{place.name} is {where}: it is at ({x:g}, {y:g}, {z:g}) in the frame of {place.carrier}",
                "an object placed there would fall, or has no room",
                f"give {place.name} the height of its supporting surface: e:z of that part plus half its sizeZ or height",
            )


SURFACE = 0.005
"""Maximum distance in metres between a place and its supporting surface."""


def _bodies(embodiment: Embodiment) -> Iterator[tuple[str, tuple[Part, ...]]]:
    """Yield the name and the solids of each mechanism's base and of each link."""
    for mechanism in embodiment.mechanisms:
        if not mechanism.urdf:
            yield mechanism.name, mechanism.parts
            yield from ((link.name, link.parts) for link in mechanism.links)


def _without_flat_top(part: Part) -> bool:
    """Return whether a solid has no horizontal top, or is of a kind (such as a mesh) whose top isn't calculated."""
    return part.kind not in ("box", "cylinder") or any(abs(angle) > 1e-6 for angle in part.turned[:2])


def _distance_beside(part: Part, point: tuple[float, float, float]) -> float:
    """Return the horizontal distance in metres of a point from an upright solid; above, below or inside the solid at most 0."""
    dx, dy = point[0] - part.position[0], point[1] - part.position[1]
    if part.kind == "cylinder":
        return math.hypot(dx, dy) - part.size[0] / 2
    cos, sin = math.cos(part.turned[2]), math.sin(part.turned[2])
    return max(abs(cos * dx + sin * dy) - part.size[0] / 2, abs(cos * dy - sin * dx) - part.size[1] / 2)


def _on_ground(embodiment: Embodiment, mechanism: Mechanism, point: tuple[float, float, float]) -> bool:
    """Return whether a point in the frame of a mechanism is on the top of a fixture."""
    cos, sin = math.cos(mechanism.yaw), math.sin(mechanism.yaw)
    x = mechanism.position[0] + cos * point[0] - sin * point[1]
    y = mechanism.position[1] + sin * point[0] + cos * point[1]
    z = mechanism.position[2] + point[2]
    return any(
        abs(fixture.position[2] + fixture.size[2] / 2 - z) < SURFACE
        and math.hypot(x - fixture.position[0], y - fixture.position[1]) <= math.hypot(*fixture.size[:2]) / 2
        for fixture in embodiment.fixtures
    )


RULES: dict[str, Callable[[Embodiment], Iterator[Flaw]]] = {
    "joint-that-stays": joint_that_stays,
    "threshold-outside": threshold_outside,
    "feature-off-its-part": feature_off_its_part,
    "part-of-two": part_of_two,
    "carried-off-its-surface": carried_off_its_surface,
}

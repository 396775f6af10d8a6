"""Validation rules on the dimensions of objects, which SPARQL can't calculate (`RULES`).

Each rule is a function that yields the flaws of an `Embodiment`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise

from confab.reasoner.embodiment.values import Embodiment, Flaw, Shape

ROOM = 0.002
"""Least room in metres that a hand needs between its open fingers beside an object."""


def too_wide(embodiment: Embodiment) -> Iterator[Flaw]:
    """Yield objects that are too wide for every hand."""
    openings = [2 * hand.opening for robot in embodiment.robots for hand in robot.hands]
    for name, body in embodiment.bodies.items():
        width = _width(body.shape)
        if openings and width > max(openings) - ROOM:
            yield (
                name,
                f"{name} is {width * 100:.1f} cm wide at its grasp height; the fingers of the widest hand open to "
                f"{max(openings) * 100:.1f} cm",
                "a hand grasps objects from the side, between two fingers",
                "make the shape narrower at e:graspHeight, or state another e:graspHeight where it is narrower",
            )


def grasped_outside(embodiment: Embodiment) -> Iterator[Flaw]:
    """Yield objects whose grasp height isn't between their base and their top."""
    for name, body in embodiment.bodies.items():
        top = body.shape.profile[-1][0] if body.shape.profile else body.shape.numbers.get("height", 0.0)
        if not 0 < body.shape.grasp_height < top:
            yield (
                name,
                f"{name} is grasped {body.shape.grasp_height * 100:.1f} cm above its base, but is {top * 100:.1f} cm high",
                "the fingers would close on nothing",
                "state an e:graspHeight of its shape that is less than its height",
            )


def _width(shape: Shape) -> float:
    """Return the width in metres of a shape between the fingers at its grasp height."""
    if not shape.profile:
        return min(shape.numbers.get("width", 0.0), shape.numbers.get("depth", 0.0)) or 2 * shape.numbers["radius"]
    radius = shape.profile[-1][1]
    for (low, below), (high, above) in pairwise(shape.profile):
        if low <= shape.grasp_height <= high:
            radius = below + (above - below) * (shape.grasp_height - low) / ((high - low) or 1.0)
    return 2 * (radius + (shape.numbers.get("wall", 0.004) if shape.kind == "vessel" else 0.0))


RULES: dict[str, Callable[[Embodiment], Iterator[Flaw]]] = {"too-wide": too_wide, "grasped-outside": grasped_outside}

"""Rules of validation on joints and features of links: see `RULES` at the end.

A mechanism with a URDF file has its joints from there; nothing is said of those.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from reasoner.embodiment.values import Embodiment, Feature, Link, Part

JOINT = "perceive_joint"
"""The perceiver that tells open from shut."""

Fault = tuple[str, str, str, str]
"""Short name of the link or part, what, why, remedy."""


def _links(embodiment: Embodiment) -> Iterator[Link]:
    return (link for mechanism in embodiment.mechanisms if not mechanism.urdf for link in mechanism.links)


def joint_that_stays(embodiment: Embodiment) -> Iterator[Fault]:
    """Find links that are said to move and can't."""
    for link in _links(embodiment):
        reach = f"from {link.lower:g} to {link.upper:g}"
        if link.kind == "fixed" and (link.lower or link.upper):
            yield (
                link.name,
                f"{link.name} moves {reach}, but its e:joint is fixed, or not stated",
                "a link without a joint of its own is rigid",
                f'state e:joint "revolute" or "prismatic" of {link.name}, or drop e:lower and e:upper',
            )
        if link.kind != "fixed" and link.lower >= link.upper:
            yield (
                link.name,
                f"the joint of {link.name} goes {reach}",
                "it moves from e:lower (0 if nothing is said) up to e:upper",
                f"state an e:upper of {link.name} above its e:lower; swap the two if they are the wrong way round",
            )


def threshold_outside(embodiment: Embodiment) -> Iterator[Fault]:
    """Find joints that are perceived and never count as open or shut, always do, or count as both."""
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
            wrong.append(f"open from {link.opened:g} on and shut up to {link.shut:g}, in between as both")
        for said in wrong:
            yield (
                link.name,
                f"the joint of {link.name} goes from {link.lower:g} to {link.upper:g}, and counts as {said}",
                "where the joint is has to tell open from shut",
                f"state numbers of {link.name} so that e:lower <= e:shut < e:opened <= e:upper",
            )


def feature_off_its_part(embodiment: Embodiment) -> Iterator[Fault]:
    """Find features whose part is further away than the widest hand opens."""
    openings = [2 * hand.opening for robot in embodiment.robots for hand in robot.hands]
    for link in _links(embodiment) if openings else ():
        own = {part.name: part for part in link.parts if part.kind != "mesh"}
        for feature in link.features.values():
            touched = [part for name in feature.parts if (part := own.get(name)) is not None]
            away = min((_apart(feature, part) for part in touched), default=0.0)
            if len(touched) == len(feature.parts) and away > max(openings):
                yield (
                    touched[0].name,
                    f"{touched[0].name} is {away * 100:.0f} cm or more away from the feature {feature.name} of {link.name}, "
                    "at which the fingers are to touch it",
                    "the fingers would close on nothing",
                    f"mend the coordinates of {touched[0].name} or of the feature: both are in the frame of {link.name}",
                )


def _apart(feature: Feature, part: Part) -> float:
    """Return how far a feature is from a part at least: from the ball around it."""
    return math.dist(feature.position, part.position) - math.hypot(*part.size) / 2


RULES: dict[str, Callable[[Embodiment], Iterator[Fault]]] = {
    "joint-that-stays": joint_that_stays,
    "threshold-outside": threshold_outside,
    "feature-off-its-part": feature_off_its_part,
}

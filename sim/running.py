"""The state of a running skill: objects by role, measured numbers, perceived features and chosen grasp."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from confab.reasoner.embodiment.skill_checks import JOINT_NUMBERS
from confab.reasoner.embodiment.skills import evaluate
from confab.reasoner.embodiment.values import Phase
from confab.sim.attempt import Attempt
from confab.sim.engine import Engine
from confab.sim.features import FeatureFrame, Ways, locate, touched
from confab.sim.mechanisms import Mechanic
from confab.sim.stages import Numbers
from confab.sim.urdf import Array
from confab.sim.verdict import SkillError, named

TOLD = ("object", "source", "target", "place")
"""The order of roles in which a failure names the objects of a skill."""

LEDGE = 0.01
"""Maximum height in metres by which a fixture may rise above a place that it supports."""


@dataclass
class SkillRun:
    """A running skill: objects by role, settings, measured numbers, chosen grasp, gripped link or body, and perceived features."""

    attempt: Attempt
    roles: Mapping[str, str]
    numbers: Numbers
    measured: dict[str, float] = field(default_factory=dict)
    way: Ways | None = None
    gripped: str = ""
    seen: dict[tuple[str, str], FeatureFrame] = field(default_factory=dict)

    @property
    def world(self) -> Engine:
        """The world in which the skill runs."""
        return self.attempt.world

    @property
    def spread(self) -> float:
        """Opening in metres of each finger of an open hand."""
        return self.numbers.get("spread", self.attempt.hand.hand.opening)

    def feature_of(self, target: str) -> tuple[str, str]:
        """Return the individual and the feature that ``role.feature`` denotes."""
        role, _, feature = target.partition(".")
        name = self.roles[role]
        if not (name in self.world.embodiment.places or name in self.world.links):
            self.attempt.body(name)
        return name, feature

    def at(self, target: str, values: Mapping[str, float] | None = None) -> FeatureFrame:
        """Return the perceived frame of the feature that ``role.feature`` denotes.

        The frame of an object is measured once per skill, so that noise doesn't move the frame.
        """
        name, feature = self.feature_of(target)
        if name in self.world.links:
            frame = locate(self.world, name, feature, values)
            return replace(frame, point=frame.point + self.world.shift(self.world.links[name]))
        carrier = self.world.embodiment.places[name].carrier if name in self.world.embodiment.places else ""
        if self.attempt.held and carrier in self.world.load(self.attempt.held):
            message = f"{name} is a place of {carrier}, which the hand carries"
            raise SkillError("goal in collision", named(name, self.attempt.held, carrier), message)
        if (name, feature) not in self.seen:
            self.seen[name, feature] = locate(self.world, name, feature)
        return self.seen[name, feature]

    def joint(self, target: str) -> tuple[Mechanic, str]:
        """Return the mechanism and the link that ``role.feature`` denotes."""
        name, _ = self.feature_of(target)
        if name not in self.world.links or name not in self.world.links[name].joints:
            raise SkillError("no grasp", (name,), f"{name} has no joint that could be moved")
        return self.world.links[name], name

    def number(self, expression: str, link: str = "") -> float:
        """Return the value of a sum of settings and numbers.

        With `link`, the sum may contain values of the link's joint (`opened`, `shut`, …).
        """
        known = dict(self.numbers)
        if "clear" in expression:
            known["clear"] = self.clear()
        if link:
            one = self.world.links[link].link(link)
            known |= {name: getattr(one, name) for name in JOINT_NUMBERS}
        return evaluate(expression, known)

    def clear(self) -> float:
        """Return the height above the target at which the load is clear of obstacles; for an empty hand, the setting `hover`."""
        hover, attempt = self.numbers["hover"], self.attempt
        if attempt.held is None:
            return hover
        point = self.at("target").point
        return self.world.clear_height(attempt.hand, attempt.held, point, hover, self.numbers["raised"])

    def things(self) -> tuple[str, ...]:
        """Return the objects in the skill's roles and the held body, without the hands."""
        held = self.attempt.held
        ordered = sorted(self.roles.items(), key=lambda pair: TOLD.index(pair[0]) if pair[0] in TOLD else len(TOLD))
        return named(*(name for _, name in ordered if name not in self.world.hands), *([] if held is None else [held]))

    def arrived(self, goal: Array) -> None:
        """Raise `SkillError` if the skill states a tolerance and the hand is farther away from its goal."""
        if "tolerance" in self.numbers:
            self.measured |= self.attempt.check_arrival(goal, self.numbers)

    def free_of(self, phase: Phase) -> tuple[str, ...]:
        """Return the things that a phase may touch: objects, parts of a link at a feature, and supports of a place."""
        found: list[str] = []
        for word in phase.touches:
            if word == "supports":
                place = self.roles.get("place") or self.world.nearest_place(self.attempt.hand.frame()[1])[0]
                height = self.world.place(place)[2] + LEDGE
                fixtures = self.world.embodiment.fixtures
                found += [one.name for one in fixtures if one.position[2] + one.size[2] / 2 < height]
                found += self.world.below(place)
            elif "." in word:
                found += touched(self.world, *self.feature_of(word))
            elif word in self.roles:
                found.append(self.roles[word])
        return tuple(found)

"""A skill that is being carried out: who takes part, what was measured, where things were seen, the way that was chosen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from reasoner.embodiment.skills import TERM
from reasoner.embodiment.values import Phase
from sim.attempt import Attempt
from sim.engine import Engine
from sim.features import Frame, Ways, locate, touched
from sim.linkage import wide
from sim.mechanisms import Mechanic
from sim.stages import Numbers
from sim.urdf import Array
from sim.verdict import SkillError, named

TOLD = ("object", "source", "target", "place")
"""The order in which a failure names who takes part."""


@dataclass
class Run:
    """One execution of a skill: who takes part, what was measured, the way chosen, what is held and where things were seen."""

    attempt: Attempt
    roles: Mapping[str, str]
    numbers: Numbers
    measured: dict[str, float] = field(default_factory=dict)
    way: Ways | None = None
    gripped: str = ""
    seen: dict[tuple[str, str], Frame] = field(default_factory=dict)

    @property
    def world(self) -> Engine:
        """The world."""
        return self.attempt.world

    @property
    def spread(self) -> float:
        """Metres by which each finger of an open hand is open."""
        return self.numbers.get("spread", self.attempt.hand.hand.opening)

    def who(self, target: str) -> tuple[str, str]:
        """Return the individual and the feature of ``role.feature``."""
        role, _, feature = target.partition(".")
        name = self.roles[role]
        if not (name in self.world.embodiment.places or name in self.world.links):
            self.attempt.body(name)
        return name, feature

    def at(self, target: str, values: Mapping[str, float] | None = None) -> Frame:
        """Return where ``role.feature`` is perceived to be: looked at once in a skill, so that noise doesn't make it jump."""
        name, feature = self.who(target)
        if name in self.world.links:
            frame = locate(self.world, name, feature, values)
            return replace(frame, point=frame.point + self.world.shift(self.world.links[name]))
        if (name, feature) not in self.seen:
            self.seen[name, feature] = locate(self.world, name, feature)
        return self.seen[name, feature]

    def joint(self, target: str) -> tuple[Mechanic, str]:
        """Return the mechanism and the link of ``role.feature``."""
        name, _ = self.who(target)
        if name not in self.world.links or name not in self.world.links[name].joints:
            raise SkillError("no grasp", (name,), f"{name} has no joint that could be moved")
        return self.world.links[name], name

    def number(self, expression: str, link: str = "") -> float:
        """Return the value of an expression: settings, and what is said of the joint of a `link`, with signs between them."""
        known = dict(self.numbers)
        if link:
            one = self.world.links[link].link(link)
            known |= {name: getattr(one, name) for name in ("opened", "shut", "lower", "upper")}
            known["wide"] = wide(one)
        return evaluate(expression, known)

    def things(self) -> tuple[str, ...]:
        """Return what takes part, what is held included and the hand excepted."""
        held = self.attempt.held
        ordered = sorted(self.roles.items(), key=lambda pair: TOLD.index(pair[0]) if pair[0] in TOLD else len(TOLD))
        return named(*(name for role, name in ordered if role != "hand"), *([] if held is None else [held]))

    def arrived(self, goal: Array) -> None:
        """Check that the hand is where it should be, if the skill says how exactly."""
        if "tolerance" in self.numbers:
            self.measured |= self.attempt.check_arrival(goal, self.numbers)

    def free_of(self, phase: Phase) -> tuple[str, ...]:
        """Return the names of what a phase may touch: of a link the parts at the feature, of a place what carries it."""
        found: list[str] = []
        for word in phase.touches:
            if word == "supports":
                found += [fixture.name for fixture in self.world.embodiment.fixtures]
                below = self.world.nearest_place(self.attempt.hand.frame()[1])[0]
                found.append(self.world.embodiment.places[self.roles.get("place", below)].carrier)
            elif "." in word:
                found += touched(self.world, *self.who(word))
            elif word in self.roles:
                found.append(self.roles[word])
        return tuple(found)


def evaluate(expression: str, known: Mapping[str, float]) -> float:
    """Return the sum that an expression names.

    >>> round(evaluate("raised-0.03", {"raised": 0.19}), 2)
    0.16
    """
    total = 0.0
    for sign, term in TERM.findall(expression):
        total += (-1.0 if sign == "-" else 1.0) * (known[term] if term in known else float(term))
    return total

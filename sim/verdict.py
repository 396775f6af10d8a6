"""The verdict on a step in the physical world: success, or a failure code with the objects and the measured numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TypedDict

from confab.reasoner.names import brief, known_as
from confab.reasoner.refutations import Refutation
from confab.reasoner.symbols import Fact

CODES = {
    "unreachable": "no posture of the arm takes the hand there",
    "goal in collision": "the hand or its load would touch something there",
    "no path": "the hand cannot get there without touching something",
    "tracking error": "the arm did not follow its motion: something stopped it",
    "object disturbed": "something moved that should have stayed where it was",
    "no grasp": "the fingers did not get hold of the object",
    "slip or drop": "the object moved in the hand or fell from it",
    "under-pour": "too little reached the target",
    "spill": "too much was spilled beside the target",
    "toppled": "something fell over",
    "misplaced": "the object is not where it should be",
    "stuck": "the joint did not reach its target value, or resists too much",
    "too slow": "the skill exceeded its time limit",
    "ill-defined": "the skill can't be carried out as the ontology describes it",
    "unexpected": "the perceived facts differ from the behaviour's effects",
}
"""Failure codes and their meanings. `Verdict.code` is one of these codes, or None for success."""


REFUTED = ("no path", "goal in collision")
"""Codes of failures in motion planning; such a failure refutes a step in the present state of the world."""


class _Verdict(TypedDict):
    ok: bool
    code: str | None
    message: str
    objects: list[str]
    measured: dict[str, float]


_While = TypedDict("_While", {"while": list[str]}, total=False)


class VerdictJson(_Verdict, _While):
    """A verdict as JSON; while the facts in `while` hold, the motion is impossible."""


class StepReportJson(VerdictJson):
    """The verdict on a primitive, with the primitive's path in the plan and its ID."""

    path: list[int]
    id: int


class RolloutJson(TypedDict):
    """One execution of a plan in the simulated world, as JSON."""

    seed: int
    ok: bool
    steps: list[StepReportJson]
    poured: list[float]
    cpu_seconds: float
    simulated_seconds: float
    believed: list[str]


@known_as("a verdict")
@brief
@dataclass(frozen=True)
class Verdict:
    """The result of a step in the world.

    `measured` maps names to measured numbers; each name ends with the unit. After failed motion planning, `facts` has the
    positions of the step's objects. The step is refuted while these facts hold. If a body blocks a link, `swings` names the
    link, and `likewise` contains the refutations of the other steps that the body blocks, for any hand.
    """

    ok: bool
    code: str | None = None
    objects: tuple[str, ...] = ()
    measured: Mapping[str, float] = field(default_factory=dict)
    message: str = ""
    facts: tuple[Fact, ...] = ()
    swings: str = ""
    likewise: tuple[Refutation, ...] = ()

    def __str__(self) -> str:
        """Return the verdict in one line, for example ``tracking error: hidden wall (joint_lag_rad 0.084)``."""
        numbers = ", ".join(f"{name} {value:.3g}" for name, value in self.measured.items())
        head = "done" if self.ok else f"{self.code}: {self._what()}"
        return head + (f" ({numbers})" if numbers else "")

    def _what(self) -> str:
        """Return the objects and the message; leave out a message that repeats the code, and objects that the message names."""
        if self.message in CODES.values():
            return ", ".join(self.objects) or self.message
        unnamed = not all(name in self.message for name in self.objects)
        return ", ".join([*(self.objects if unnamed else ()), *([self.message] if self.message else [])])

    def as_json(self) -> VerdictJson:
        """Return the verdict as `confab verify --json` prints it."""
        data: VerdictJson = {
            "ok": self.ok,
            "code": self.code,
            "message": self.message,
            "objects": list(self.objects),
            "measured": {name: round(value, 6) for name, value in self.measured.items()},
        }
        if self.facts:
            data["while"] = [str(fact) for fact in self.facts]
        return data


class SkillError(Exception):
    """Error of a failed skill, which `PhysicsWorld.execute` turns into a `Verdict`."""

    def __init__(self, code: str, objects: tuple[str, ...] = (), message: str = "", /, **measured: float) -> None:
        super().__init__(message or CODES[code])
        self.verdict = Verdict(False, code, objects, measured, message or CODES[code])


def named(*objects: str) -> tuple[str, ...]:
    """Return the objects without duplicates, in order."""
    return tuple(dict.fromkeys(objects))

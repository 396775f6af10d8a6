"""What physics says about a step: it did what it should, or how it failed, with the objects and the measured number."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from reasoner.refutations import Refutation
from reasoner.symbols import Fact

CODES = {
    "unreachable": "no posture of the arm takes the hand there",
    "goal in collision": "the hand, or what it holds, would touch something there",
    "no path": "the hand cannot get there without touching something",
    "tracking error": "the arm did not follow its motion: something stopped it",
    "object disturbed": "something moved that should have stayed where it was",
    "no grasp": "the fingers did not get hold of the object",
    "slip or drop": "the object moved in the hand or fell from it",
    "under-pour": "too little reached the target",
    "spill": "too much went beside the target",
    "toppled": "something fell over",
    "misplaced": "the object is not where it should be",
    "stuck": "the joint did not come to where it should be, or resists too much",
    "too slow": "the skill did not end in its time",
    "ill-defined": "the skill can't be carried out as the ontology describes it",
    "unexpected": "what is perceived afterwards is not what the behaviour promises",
}
"""Failure codes and what they mean. `Verdict.code` is one of them, or None for success."""


REFUTED = ("no path", "goal in collision")
"""With these codes a planner of motions says that something can't be done as things stand."""


@dataclass(frozen=True)
class Verdict:
    """How a step went in the world. `measured` has numbers by name; the name ends with the unit.

    `facts` say where everything was that took part, if a planner of motions found no way: as long as they hold there is none.
    If it is the joint of a link that `swings` into something, `likewise` has what else is refuted by that, whoever does it.
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
        """Return one line, e.g. ``tracking error: hidden wall (joint_lag_rad 0.084)``."""
        numbers = ", ".join(f"{name} {value:.3g}" for name, value in self.measured.items())
        head = "done" if self.ok else f"{self.code}: {self._what()}"
        return head + (f" ({numbers})" if numbers else "")

    def _what(self) -> str:
        """Return the objects, and the message where it says more than the code and names not all of them."""
        if self.message in CODES.values():
            return ", ".join(self.objects) or self.message
        unnamed = not all(name in self.message for name in self.objects)
        return ", ".join([*(self.objects if unnamed else ()), *([self.message] if self.message else [])])

    def as_json(self) -> dict[str, Any]:
        """Return it as `confab verify --json` prints it."""
        return {
            "ok": self.ok,
            "code": self.code,
            "message": self.message,
            "objects": list(self.objects),
            "measured": {name: round(value, 6) for name, value in self.measured.items()},
            **({"while": [str(fact) for fact in self.facts]} if self.facts else {}),
        }


class SkillError(Exception):
    """Raised inside a skill when it cannot go on; `World.execute` turns it into a `Verdict`."""

    def __init__(self, code: str, objects: tuple[str, ...] = (), message: str = "", /, **measured: float) -> None:
        super().__init__(message or CODES[code])
        self.verdict = Verdict(False, code, objects, measured, message or CODES[code])


def named(*objects: str) -> tuple[str, ...]:
    """Return each object once, in order."""
    return tuple(dict.fromkeys(objects))

"""Faults planted in the paper's plan and in plans with joints: the step at which the plan stops, and the failure.

    python -m benchmarks.faults          print the table

Faults that stop the plan at another step or with another code than expected are marked.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache

import confab
from benchmarks.physics import case
from confab.sim import faults
from confab.sim.faults import PlantedFault
from confab.sim.rollouts import Trial
from confab.sim.verify import Rollout, expectations

MEANS = {
    "unreachable": "beyond_m",
    "goal in collision": "clearance_m",
    "no path": "clearance_m",
    "object disturbed": "moved_m",
    "slip or drop": "slip_m",
    "under-pour": "poured",
    "spill": "spilled",
    "toppled": "tilt_rad",
    "misplaced": "off_place_m",
    "stuck": "joint",
    "too slow": "seconds",
}
"""The measured number that characterises a failure code, for codes with such a number."""


@dataclass(frozen=True)
class Planted:
    """A fault, the number of the primitive at which it must stop the plan, and the code and objects that must be named."""

    kind: str
    fault: PlantedFault
    step: int
    code: str
    objects: tuple[str, ...] = ()
    beads: bool = False
    scene: str = "beverage-serving"

    def run(self, trial: Trial) -> Rollout:
        """Return the rollout with the fault."""
        return replace(trial, prepare=self.fault, beads=self.beads).run(0)

    def found(self, rollout: Rollout) -> bool:
        """Return whether the rollout stopped at the expected step with the expected code."""
        failure = rollout.failure
        return (
            failure is not None
            and len(rollout.steps) - 1 == self.step
            and failure.verdict.code == self.code
            and set(self.objects) <= set(failure.verdict.objects)
            and bool(failure.verdict.measured)
        )


WALL_ON_THE_WAY = faults.hidden_wall("location7", 0.08, (0.02, 0.2, 0.5))
CORNER, SPINNER = "kitchen-corner", "centrifuge"
SMALL = (0.03, 0.03, 0.05)
LEFT_ARM_THERE = faults.arm_at("left_hand", (0.54, -0.12, 0.9), -0.6, 12)

ON_A_TABLE = (
    Planted("unreachable object", faults.displaced("cup1", (0.55, 0.0)), 0, "unreachable", ("cup1",)),
    Planted("unreachable location", faults.place_displaced("location7", (0.4, 0.0)), 3, "unreachable", ("location7",)),
    Planted("occupied location", faults.stranger((0.56, -0.12, 0.7)), 3, "goal in collision", ("location7", "stranger")),
    Planted("object built in", faults.stranger((0.34, 0.12, 0.7), (0.03, 0.3, 0.2)), 0, "goal in collision", ("cup1", "stranger")),
    Planted("hidden wall before the object", faults.hidden_wall("cup1"), 0, "tracking error", ("hidden wall",)),
    Planted("hidden wall on the way", WALL_ON_THE_WAY, 3, "slip or drop", ("cup1", "hidden wall")),
    Planted("heavy object", faults.heavy("cup1", 8.0), 2, "slip or drop", ("cup1",)),
    Planted("slippery object", faults.slippery("cup1"), 2, "slip or drop", ("cup1",)),
    Planted("vanished object", faults.gone("cup1"), 0, "no grasp", ("cup1",)),
    Planted("object taken from the hand", faults.gone("cup1", 3, 0.3), 3, "slip or drop", ("cup1",)),
    Planted("lying object", faults.lying("cup1"), 0, "toppled", ("cup1",)),
    Planted("object displaced before the grasp", faults.displaced("cup1", (0.05, 0.0), 0, 0.5), 0, "object disturbed", ("cup1",)),
    Planted("object displaced from between the fingers", faults.displaced("cup1", (0.08, 0.0), 1, 0.0), 1, "no grasp", ("cup1",)),
    Planted("bystander knocked over", faults.knocked("cup2", 3, 0.5), 3, "toppled", ("cup2",)),
    Planted("object pushed after release", faults.displaced("cup1", (0.05, 0.0), 4, 1.1), 4, "misplaced", ("cup1", "location7")),
    Planted("hand opens in the air", faults.lets_go("left_hand", 3, 0.3), 3, "slip or drop", ("cup1",)),
    Planted("weak grip", faults.weak_grip("left_hand", 0.4), 1, "no grasp", ("cup1",)),
    Planted("hand stays shut", faults.shut("left_hand"), 0, "object disturbed", ("cup1",)),
    Planted("weak arm", faults.weak_arm("left_hand", 0.02), 0, "tracking error"),
    Planted("joint jammed", faults.jammed("left_hand", 3, 2, 0.1), 2, "tracking error"),
    Planted("joint limit", faults.joint_range("left_hand", 3, -1.0, -0.6), 0, "unreachable", ("cup1",)),
    Planted("arm in the way of the other", LEFT_ARM_THERE, 15, "goal in collision", ("left_hand",)),
    Planted("sensor noise of 5 cm", faults.noisy(0.05), 0, "object disturbed", ("cup1",)),
    Planted("camera off by 3 cm", faults.misaligned((0.0, 0.03)), 0, "object disturbed", ("cup1",)),
    Planted("bottle empty", faults.drained("bottle1"), 0, "under-pour", ("bottle1",), True),
    Planted("bottle nearly empty", faults.drained("bottle1", 6), 16, "under-pour", ("bottle1", "cup1"), True),
    Planted("neck blocked", faults.sealed("bottle1"), 16, "under-pour", ("bottle1", "cup1"), True),
    Planted("under-tilt", faults.settings("B3_TILT", pour_angle=1.25), 16, "under-pour", ("bottle1", "cup1"), True),
    Planted("too slow a turn", faults.settings("B3_TILT", slow=0.01), 16, "too slow", ("right_hand",), True),
    Planted("slow arm", faults.slow_arm("left_hand", 0.1), 0, "too slow", ("left_hand",)),
    Planted("cup displaced while it is filled", faults.displaced("cup1", (0.06, 0.0), 16, 0.8), 16, "spill", ("cup1",), True),
)  # fmt: skip


KITCHEN = (
    Planted("door stuck", faults.stiff("door", 60.0), 0, "slip or drop", ("door",), scene=CORNER),
    Planted("door stops halfway", faults.stopped("door", 0.0, 0.5), 0, "slip or drop", ("door",), scene=CORNER),
    Planted("door falls shut when let go", faults.sprung("door", 0.0, 1.5), 0, "stuck", ("door",), scene=CORNER),
    Planted("door's value read .3 too low", faults.misread("door", -0.3), 0, "goal in collision", ("door",), scene=CORNER),
    Planted("handle of the door greasy", faults.greasy("door", 0.004), 0, "slip or drop", ("door",), scene=CORNER),
    Planted("weak grip at the door", faults.weak_grip("left_hand", 0.4), 0, "no grasp", ("door",), scene=CORNER),
    Planted("box in the door's swing", faults.stranger((0.42, 0.42, 0.7)), 0, "no path", ("door", "stranger"), scene=CORNER),
    Planted("door shut by a person meanwhile", faults.swung("door", 0.0, 1, 0.3), 1, "tracking error", ("door",), scene=CORNER),
    Planted("cup taken from the hand", faults.gone("cup", 3, 0.3), 3, "slip or drop", ("cup",), scene=CORNER),
    Planted("door stopped while it is shut", faults.stopped("door", 0.4, 1.8, 7, 0.0), 7, "stuck", ("door",), scene=CORNER),
    Planted("pot occupied", faults.stranger((0.6, 0.0, 0.8), SMALL), 11, "goal in collision", ("lid", "stranger"), scene=CORNER),
    Planted("lid pushed off", faults.displaced("lid", (0.0, 0.045), 12, 0.9), 12, "misplaced", ("lid",), scene=CORNER),
)  # fmt: skip

LABORATORY = (
    Planted("lid stuck", faults.stiff("cover", 60.0), 0, "slip or drop", ("cover",), scene=SPINNER),
    Planted("lid stops halfway", faults.stopped("cover", 0.0, 0.6), 0, "slip or drop", ("cover",), scene=SPINNER),
    Planted("lid falls shut when let go", faults.sprung("cover", 0.0, 2.0), 0, "stuck", ("cover",), scene=SPINNER),
    Planted("lid shut by a person meanwhile", faults.swung("cover", 0.0, 4, 0.0), 4, "tracking error", ("cover",), scene=SPINNER),
    Planted("slot occupied", faults.stranger((0.57, 0.15, 0.74), SMALL), 4, "goal in collision", ("stranger",), scene=SPINNER),
    Planted("lid not shut", faults.stopped("cover", 0.3, 2.0, 13, 0.0), 13, "slip or drop", ("cover",), scene=SPINNER),
    Planted("lid springs open again", faults.sprung("cover", 0.5, 3.0, 13, 4.0), 13, "stuck", ("cover",), scene=SPINNER),
    Planted("button not latched", faults.unlatched("start"), 14, "stuck", ("start",), scene=SPINNER),
    Planted("button stuck", faults.stiff("start", 200.0), 14, "stuck", ("start",), scene=SPINNER),
    Planted("button's value read 1 cm too low", faults.misread("start", -0.01), 14, "stuck", ("start",), scene=SPINNER),
)  # fmt: skip

PLANTED = (*ON_A_TABLE, *KITCHEN, *LABORATORY)


def row(planted: Planted, rollout: Rollout) -> str:
    """Return a line of the table."""
    failure = rollout.failure
    if failure is None:
        return f"| {planted.kind} | `{planted.fault}` | **not found** | | | |"
    verdict = failure.verdict
    name = MEANS.get(verdict.code or "", next(iter(verdict.measured), ""))
    name = name if name in verdict.measured else next(iter(verdict.measured), "")
    number = f"{name} {verdict.measured[name]:.3g}" if name else "-"
    mark = "" if planted.found(rollout) else f" **(expected {planted.step + 1}, {planted.code})**"
    where = f"{len(rollout.steps)} `{failure.step}`{mark}"
    return (
        f"| {planted.kind} | `{planted.fault}` | {where} | {verdict.code} | {', '.join(verdict.objects)} | {number} |"
    )


@cache
def nominal(name: str) -> Trial:
    """Return the trial of a scene without a fault: the paper's plan, or the plan of a scene with joints."""
    if name == "beverage-serving":
        return case(name)
    scene = confab.load(name)
    steps = scene.plan().plan.primitives
    return Trial(scene.embodiment, scene.problem.initial, steps, expectations(scene.problem, steps))


def rows() -> Iterator[tuple[bool, str]]:
    """Yield for each fault whether it was found as expected, and its line of the table."""
    for planted in PLANTED:
        rollout = planted.run(nominal(planted.scene))
        yield planted.found(rollout), row(planted, rollout)


def main() -> None:
    """Print the table."""
    print(
        "| fault | planted as (`confab.sim.faults`) | stops at | code | objects | number |\n|---|---|---|---|---|---|"
    )
    good = 0
    for found, text in rows():
        good += found
        print(text, flush=True)
    print(f"\n{good} of {len(PLANTED)} stop where and as they must.")


if __name__ == "__main__":
    main()

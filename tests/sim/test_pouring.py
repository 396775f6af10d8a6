"""Control of a flow: when the hand rolls on, waits, and rolls the vessel back."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from confab.sim.engine import RATE
from confab.sim.pouring import _Servo, _Way
from confab.sim.trajectory import Recorder
from confab.sim.verify import verify

from .conftest import Case

NUMBERS = {"lag": 0.3, "flow": 0.15, "wait": 1.0, "pour_angle": 2.09, "slow": 0.3}


def servo_at(angle: float) -> tuple[_Servo, Any]:
    """Return a servo of a hand with one joint that follows each command, and its world, which counts steps."""
    world: Any = SimpleNamespace(rate=240, steps=0, check_course=lambda hand: None)
    world.run = lambda steps: setattr(world, "steps", world.steps + steps)
    hand: Any = SimpleNamespace(posture=np.zeros(1), command=lambda posture, speed: None)
    return _Servo(world, hand, _Way(np.array([0.0, 3.0]), np.array([[0.0], [3.0]])), angle), world


def test_an_almost_complete_amount_suffices_when_the_flow_has_stopped() -> None:
    servo, world = servo_at(1.7)

    def poured() -> float:
        """Eighteen beads at ten per second; then the flow is blocked until the hand rolls on and releases a burst."""
        return 1.6 if servo.angle > 1.75 else min(world.steps // 24, 18) / 20

    assert servo.meter(NUMBERS, enough=1.15, nearly=0.9, poured=poured)
    assert poured() == 0.9


def test_the_hand_rolls_on_when_the_flow_stops_early() -> None:
    servo, world = servo_at(1.7)

    def poured() -> float:
        return 1.2 if servo.angle > 1.75 else min(world.steps // 24, 12) / 20

    assert servo.meter(NUMBERS, enough=1.15, nearly=0.9, poured=poured)
    assert poured() == 1.2


def test_the_joints_that_shift_a_pouring_hand_never_jerk(moved: Case) -> None:
    until = next(i for i, step in enumerate(moved.steps) if step.behavior == "B3_TILT") + 1
    recorder = Recorder()
    rollout = verify(
        moved.embodiment, moved.initial, moved.steps[:until], moved.expected[:until], beads=False, watch=recorder
    )
    assert rollout.ok
    hand = moved.steps[until - 1].arguments[0]
    tilting = np.array(recorder.tapes[hand].postures)[-round(rollout.steps[-1].seconds * RATE) :]
    acceleration = np.abs(np.diff(tilting, n=2, axis=0)).max(0) * RATE**2
    assert acceleration[:-1].max() < 60  # radians per second squared; the last joint rolls the hand

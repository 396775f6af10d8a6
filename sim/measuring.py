"""Quantities that skills measure. A guard is a bound on a quantity that ends a motion, or that must hold after a motion."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from confab.reasoner.embodiment.values import Guard, Phase
from confab.sim.base import offset_from_stand
from confab.sim.perception import tilt_of
from confab.sim.running import SkillRun
from confab.sim.verdict import SkillError
from confab.sim.whereabouts import floor_below


def finger_force(run: SkillRun, name: str) -> float:
    """Return the smaller of the two forces, in newtons, with which the fingers press a body or link."""
    return min(finger_forces(run, name))


def finger_forces(run: SkillRun, name: str) -> tuple[float, ...]:
    """Return the force in newtons with which each finger presses a body or link."""
    hand, world = run.attempt.hand, run.world
    if name in world.links:
        mechanic = world.links[name]
        return hand.pressing(mechanic.body, mechanic.joints[name])
    return hand.pressing(world.bodies[name].body) if name in world.bodies else (0.0, 0.0)


def _slip(run: SkillRun) -> float | None:
    measured = run.attempt.check_grip({**run.numbers, "slip": np.inf})
    run.measured |= {name: value for name, value in measured.items() if name != "slip_m"}
    return measured.get("slip_m")


def _load(run: SkillRun) -> str:
    """Return the held body; if the hand is empty, return the skill's object."""
    return run.attempt.held or run.roles.get("object", "")


def _height(run: SkillRun) -> float:
    base = run.world.truth(_load(run))[1]
    if "place" in run.roles:
        return float(abs(base[2] - run.world.place(run.roles["place"])[2]))
    return float(base[2] - floor_below(run.world, run.attempt.hand.hand.name, base))


def _bearing(run: SkillRun) -> float:
    """Return the force in newtons with which bodies other than the hand carry the held or just released object."""
    world, load = run.world, _load(run)
    others = (c for c in world.contacts(world.bodies[load].body) if c[2] != run.attempt.hand.body)
    return float(sum(contact[9] * max(contact[7][2], 0.0) for contact in others))


def _off(run: SkillRun) -> float:
    place = run.roles.get("place", run.roles.get("target", ""))
    held = _load(run)
    reached = run.world.truth(held)[1] if held else run.attempt.hand.frame()[1]
    return float(np.hypot(*(reached - run.world.place(place))[:2]))


def _grip(run: SkillRun) -> float | None:
    name = run.gripped or run.roles.get("object", "") or run.attempt.held
    return finger_force(run, name) if name else None


def _value(run: SkillRun) -> float:
    mechanic, link = run.joint("object")
    return mechanic.values()[link]


def _stand_offset(run: SkillRun) -> float:
    return max(offset_from_stand(run.world.bases[run.roles["robot"]], run.world.embodiment.stands[run.roles["target"]]))


@dataclass(frozen=True)
class MeasuredQuantity:
    """A measured quantity: the measuring function, the name in a verdict, and the failure code for a value out of bounds."""

    measure: Callable[[SkillRun], float | None]
    name: str
    code: str


QUANTITIES: Mapping[str, MeasuredQuantity] = {
    "slip": MeasuredQuantity(_slip, "slip_m", "slip or drop"),
    "tilt": MeasuredQuantity(lambda run: tilt_of(run.world.truth(_load(run))[0]), "tilt_rad", "toppled"),
    "height": MeasuredQuantity(_height, "height_m", "misplaced"),
    "off": MeasuredQuantity(_off, "off_place_m", "misplaced"),
    "joint": MeasuredQuantity(_value, "joint", "stuck"),
    "push": MeasuredQuantity(lambda run: run.attempt.hand.push(), "force_n", "stuck"),
    "grip": MeasuredQuantity(_grip, "grip_n", "slip or drop"),
    "bearing": MeasuredQuantity(_bearing, "bearing_n", "misplaced"),
    "astray": MeasuredQuantity(_stand_offset, "off_stand_m", "misplaced"),
    "leaning": MeasuredQuantity(
        lambda run: tilt_of(run.world.truth(run.feature_of("target")[0])[0]), "tilt_rad", "toppled"
    ),
}


def _holds(run: SkillRun, guard: Guard) -> tuple[bool, float | None, float]:
    """Return whether a guard holds, the measured value, and the bound."""
    value = QUANTITIES[guard.quantity].measure(run)
    link = run.roles.get("object", "") if guard.quantity == "joint" else ""
    bound = run.number(guard.bound, link)
    return value is None or (value - bound) * guard.sign >= 0, value, bound


def check(run: SkillRun, phase: Phase, guard: Guard) -> None:
    """Measure the quantity of a guard; raise `SkillError` with phase, value and bound if the guard doesn't hold."""
    holds, value, bound = _holds(run, guard)
    quantity = QUANTITIES[guard.quantity]
    if value is not None:
        run.measured[quantity.name] = value
    if not holds:
        load = _load(run)
        of_others = guard.quantity in ("off", "height", "joint", "push", "astray")
        things = (load,) if load and not of_others else run.things()
        wanted = f"{'at least' if guard.sign > 0 else 'at most'} {bound:.3g}"
        message = f"{guard.quantity} {value:.3g} after {phase.name}, wanted {wanted}"
        raise SkillError(guard.code or quantity.code, things, message, **run.measured)


def until(run: SkillRun, phase: Phase) -> Callable[[], bool] | None:
    """Return a function that tests whether a guard ends the motion of a phase, or None if the phase has no such guard."""
    if not phase.until:
        return None
    return lambda: any(_holds(run, guard)[0] for guard in phase.until)

"""Who carries out a primitive: a skill that the ontology describes in phases, or a Python function.

Skills in phases are interpreted by `sim.phases`. A Python skill is a function of (engine, roles, numbers): `roles` are the
individuals that take part (`hand`, `target`, `object`, `place`, `source`), `numbers` its settings from the ontology in metres,
radians, seconds and newtons. It returns what it measured, or raises `SkillError`. Two are built in, since the path of a lip and
watching a flow are physics of their own; those of other packages register as entry points of the group `confab.skills`.

============== =============================================================== =======================================
Python skill   motion                                                          checked in the world
============== =============================================================== =======================================
tilt           roll about the lip until a serving has left, then hold back     a serving arrived; little spilled
stand_upright  roll back                                                       upright, not slipped
============== =============================================================== =======================================
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib.metadata import entry_points

from reasoner.embodiment.values import SkillUse
from sim.engine import Engine
from sim.phases import carry_out
from sim.pouring import stand_upright, tilt
from sim.stages import Numbers

Roles = Mapping[str, str]
Skill = Callable[[Engine, Roles, Numbers], Mapping[str, float]]

BUILT_IN: Mapping[str, Skill] = {"tilt": tilt, "stand_upright": stand_upright}


def perform(engine: Engine, use: SkillUse, roles: Roles) -> Mapping[str, float]:
    """Let the robot do what a behaviour's skill says; return what was measured, or raise `SkillError`."""
    return carry_out(engine, use, roles) if use.phases else skill(use.skill)(engine, roles, use.numbers)


def skill(name: str) -> Skill:
    """Return the Python skill of that name, built in or an entry point; raise `KeyError` that lists the built-in ones."""
    if name in BUILT_IN:
        return BUILT_IN[name]
    for point in entry_points(group="confab.skills", name=name):
        found: Skill = point.load()
        return found
    raise KeyError(
        f"skill '{name}' has no e:phase and no function of that name is known (built in: {', '.join(BUILT_IN)}; others "
        "register in the group confab.skills)"
    )

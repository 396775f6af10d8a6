"""The skills that execute primitives: phases described in the ontology, or Python functions.

`confab.sim.phases` interprets skills in phases. A Python skill is a function of (engine, roles, numbers). The argument `roles`
maps role names (`hand`, `target`, `object`, `place`, `source`) to individuals. The argument `numbers` has the skill's settings
from the ontology, in metres, radians, seconds and newtons. A skill returns the numbers that it measured, or raises
`SkillError`. Two skills are built in, since phases can express neither the path of a lip nor the control of a flow. Skills of
other packages register as entry points of the group `confab.skills`.

============== =============================================================== =======================================
Python skill   motion                                                          checked in the world
============== =============================================================== =======================================
tilt           roll about the lip until a serving has left, then back          a serving arrived; little spilled
stand_upright  roll back                                                       upright, not slipped
============== =============================================================== =======================================
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib.metadata import entry_points

from confab.reasoner.embodiment.values import SkillUse
from confab.sim.engine import Engine
from confab.sim.phases import carry_out
from confab.sim.pouring import stand_upright, tilt
from confab.sim.stages import Numbers

Roles = Mapping[str, str]
Skill = Callable[[Engine, Roles, Numbers], Mapping[str, float]]

BUILT_IN: Mapping[str, Skill] = {"tilt": tilt, "stand_upright": stand_upright}


def perform(engine: Engine, use: SkillUse, roles: Roles) -> Mapping[str, float]:
    """Execute a behaviour's skill with individuals in its roles; return the measured numbers, or raise `SkillError`."""
    return carry_out(engine, use, roles) if use.phases else skill(use.skill)(engine, roles, use.numbers)


def skill(name: str) -> Skill:
    """Return the built-in Python skill or the entry point of the given name; raise `KeyError` if there is none."""
    if name in BUILT_IN:
        return BUILT_IN[name]
    for point in entry_points(group="confab.skills", name=name):
        found: Skill = point.load()
        return found
    raise KeyError(
        f"skill '{name}' has no e:phase, and there is no Python skill of that name (built in: {', '.join(BUILT_IN)}; "
        "others register in the group confab.skills)"
    )

"""Connection of external robots to a scene."""

from __future__ import annotations

from typing import TYPE_CHECKING

from confab.planner.acting.retries import DEFAULT, RetryPolicy
from confab.reasoner.embodiment.interfaces import Interface, read_interface
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.problem import Problem
from confab.sim.robots.adapter import InterfaceWorld
from confab.sim.robots.transport import RobotError, Transport
from confab.sim.robots.transports import TRANSPORTS

if TYPE_CHECKING:
    from confab.known import Known

FORM = "wanted INTERFACE:ADDRESS, e.g. pyrobosim:world.yaml or rover:http://localhost:8080"


def connected(scene: Known, problem: Problem, on: str, seed: int = 0) -> tuple[InterfaceWorld, RetryPolicy]:
    """Return the world of an external robot, and the retry policy that the robot's interface states.

    Parameters
    ----------
    scene : Scene
        The scene whose graph describes the interface.
    problem : Problem
        The problem whose symbols the robot perceives.
    on : str
        The robot as ``INTERFACE:ADDRESS``.
    seed : int
        Seed of a simulated robot.

    Raises
    ------
    KnowledgeError
        `on` isn't of the form ``INTERFACE:ADDRESS``, the scene has no such interface, the interface has no action for a primitive,
        or no connection is possible.
    """
    name, where = parts_of(on)
    interface = read_interface(scene.knowledge.store, scene.names.short, name)
    lowest = problem.domain.at_level(problem.domain.levels[-1])
    if lacking := [behavior.name for behavior in lowest if behavior.name not in interface.calls]:
        raise KnowledgeError(f"{name} has no action for {', '.join(lacking)}; state e:carriesOut of one of its actions")
    world = InterfaceWorld(interface, reached(interface, where, seed), problem)
    attempts, failures = interface.attempts or DEFAULT.attempts, interface.failures or DEFAULT.failures
    return world, RetryPolicy(attempts, failures)


def parts_of(on: str) -> tuple[str, str]:
    """Return the two parts of ``INTERFACE:ADDRESS``; raise `KnowledgeError` if the text has another form."""
    name, colon, where = on.partition(":")
    if not colon or not name or not where:
        raise KnowledgeError(f"'{on}' names no robot; {FORM}")
    return name, where


def reached(interface: Interface, where: str, seed: int) -> Transport:
    """Return the connection to a robot; raise `KnowledgeError` if the connection fails."""
    if interface.transport not in TRANSPORTS:
        known = ", ".join(TRANSPORTS)
        raise KnowledgeError(f"{interface.name} has the e:transport '{interface.transport}'; wanted one of {known}")
    try:
        return TRANSPORTS[interface.transport](where, seed)
    except RobotError as error:
        raise KnowledgeError(str(error)) from error

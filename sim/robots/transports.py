"""The table of transports, which connect to the actions and the world model of a robot."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from confab.sim.robots.transport import Transport


def pyrobosim(where: str, seed: int) -> Transport:
    """Return a connection to pyrobosim with the world of a YAML file."""
    from confab.sim.robots.pyrobosim_transport import Pyrobosim

    return Pyrobosim(where, seed)


def http(where: str, seed: int) -> Transport:
    """Return a connection to the robot whose server has the URL `where`."""
    from confab.sim.robots.http_transport import HttpRobot

    return HttpRobot(where)


TRANSPORTS: Mapping[str, Callable[[str, int], Transport]] = {"http": http, "pyrobosim": pyrobosim}
"""The transports by their name in `e:transport`: functions of an address and a seed that return a connection."""

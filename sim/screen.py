"""PyBullet's window, which shows the world in step with real time and does not change the results of a rollout."""

from __future__ import annotations

import ctypes
import ctypes.util
import os
import sys
import time

import numpy as np
import pybullet

from confab.sim.engine import Engine
from confab.sim.picture import view_of

PACE_CHECK = 4
"""Number of simulation steps between comparisons with the clock."""


def require_screen() -> None:
    """Raise `RuntimeError` if no display is available, since PyBullet itself would end the process.

    Raises
    ------
    RuntimeError
        No display is available. The message states the remedy.
    """
    if sys.platform != "linux":
        return
    display = os.environ.get("DISPLAY", "")
    if not display:
        raise RuntimeError("no screen to show the world on: DISPLAY isn't set; leave out gui=True, or film with video=")
    library = ctypes.util.find_library("X11")
    if library is None:
        raise RuntimeError("no screen to show the world on: libX11 is missing; leave out gui=True, or film with video=")
    x11 = ctypes.CDLL(library)
    x11.XOpenDisplay.restype = ctypes.c_void_p
    opened = x11.XOpenDisplay(display.encode())
    if not opened:
        raise RuntimeError(
            f"no screen to show the world on: display '{display}' doesn't answer; leave out gui=True, or film with video="
        )
    x11.XCloseDisplay(ctypes.c_void_p(opened))


class Screen:
    """Camera, caption and pace of PyBullet's window, to be passed to `confab.sim.verify.verify` as `watch` with ``gui=True``.

    Parameters
    ----------
    titles : sequence of str
        Caption of each primitive.
    speed : float
        Maximum ratio of simulated time to real time.
    """

    def __init__(self, titles: tuple[str, ...] = (), speed: float = 1.0) -> None:
        self.titles, self.speed = titles, speed
        self._begin: tuple[float, int] | None = None
        self._current, self._caption = -1, -1

    def __call__(self, world: Engine) -> None:
        """Update the caption, and wait while the simulation is ahead of the clock."""
        if self._begin is None:
            self._begin = time.monotonic(), world.steps
            self._look(world)
        if world.current != self._current:
            self._current = world.current
            self._write(world)
        if world.steps % PACE_CHECK == 0:
            begin, steps = self._begin
            ahead = (world.steps - steps) / world.rate / self.speed - (time.monotonic() - begin)
            if ahead > 0:
                time.sleep(ahead)

    def _look(self, world: Engine) -> None:
        """Set the camera of the window to the view of films."""
        camera = view_of(world.embodiment)
        x, y, z = np.array(camera.target) - np.array(camera.eye)
        distance = float(np.linalg.norm([x, y, z]))
        yaw, pitch = float(np.degrees(np.arctan2(-x, y))), float(np.degrees(np.arcsin(z / distance)))
        client = world.client
        for option in (pybullet.COV_ENABLE_GUI, pybullet.COV_ENABLE_KEYBOARD_SHORTCUTS):
            pybullet.configureDebugVisualizer(option, 0, physicsClientId=client)
        pybullet.resetDebugVisualizerCamera(distance, yaw, pitch, camera.target, physicsClientId=client)

    def _write(self, world: Engine) -> None:
        """Write the caption of the present primitive above the middle of all places."""
        if not 0 <= self._current < len(self.titles):
            return
        x, y, z = np.mean([place.position for place in world.embodiment.places.values()], axis=0)
        self._caption = pybullet.addUserDebugText(
            self.titles[self._current],
            (float(x), float(y), float(z) + 0.6),
            textColorRGB=(0.1, 0.1, 0.15),
            textSize=1.4,
            replaceItemUniqueId=self._caption,
            physicsClientId=world.client,
        )

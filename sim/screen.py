"""The world on a screen, for people who have one: PyBullet's own window, which doesn't run faster than the simulated time.

What is shown changes nothing: a rollout on a screen gives what it gives without one.
"""

from __future__ import annotations

import ctypes
import ctypes.util
import os
import sys
import time

import numpy as np
import pybullet

from sim.engine import Engine
from sim.picture import view_of

OFTEN = 4
"""Steps between two looks at the clock."""


def require_screen() -> None:
    """Raise `RuntimeError` if there is no display to open a window on: PyBullet itself would end the process.

    Raises
    ------
    RuntimeError
        There is none; the message says what to do.
    """
    if sys.platform != "linux":
        return
    display = os.environ.get("DISPLAY", "")
    if not display:
        raise RuntimeError("no screen to show the world on: DISPLAY isn't set; leave out --gui, or film with --video")
    library = ctypes.util.find_library("X11")
    if library is None:
        raise RuntimeError("no screen to show the world on: libX11 is missing; leave out --gui, or film with --video")
    x11 = ctypes.CDLL(library)
    x11.XOpenDisplay.restype = ctypes.c_void_p
    opened = x11.XOpenDisplay(display.encode())
    if not opened:
        raise RuntimeError(
            f"no screen to show the world on: display '{display}' doesn't answer; leave out --gui, or film with --video"
        )
    x11.XCloseDisplay(ctypes.c_void_p(opened))


class Screen:
    """Shows a world that it watches: give it to `sim.verify.verify` as `watch`, with ``gui=True``.

    Parameters
    ----------
    titles : sequence of str
        What to write above the table for each primitive.
    speed : float
        How much faster than the simulated time it may run.
    """

    def __init__(self, titles: tuple[str, ...] = (), speed: float = 1.0) -> None:
        self.titles, self.speed = titles, speed
        self._begin: tuple[float, int] | None = None
        self._current, self._caption = -1, -1

    def __call__(self, world: Engine) -> None:
        """Keep pace with the clock, and write what is done."""
        if self._begin is None:
            self._begin = time.monotonic(), world.steps
            self._look(world)
        if world.current != self._current:
            self._current = world.current
            self._write(world)
        if world.steps % OFTEN == 0:
            begin, steps = self._begin
            ahead = (world.steps - steps) / world.rate / self.speed - (time.monotonic() - begin)
            if ahead > 0:
                time.sleep(ahead)

    def _look(self, world: Engine) -> None:
        """Turn the window's camera to where films are taken from."""
        camera = view_of(world.embodiment)
        x, y, z = np.array(camera.target) - np.array(camera.eye)
        distance = float(np.linalg.norm([x, y, z]))
        yaw, pitch = float(np.degrees(np.arctan2(-x, y))), float(np.degrees(np.arcsin(z / distance)))
        client = world.client
        for option in (pybullet.COV_ENABLE_GUI, pybullet.COV_ENABLE_KEYBOARD_SHORTCUTS):
            pybullet.configureDebugVisualizer(option, 0, physicsClientId=client)
        pybullet.resetDebugVisualizerCamera(distance, yaw, pitch, camera.target, physicsClientId=client)

    def _write(self, world: Engine) -> None:
        """Write the primitive that is done now above the middle of the places."""
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

"""Physics worlds free their memory when they are closed."""

import ctypes
import gc
import tempfile
from pathlib import Path

import pybullet

from confab.sim.world import PhysicsWorld
from tests.sim.conftest import Case


class Malloc(ctypes.Structure):
    """Memory statistics of glibc."""

    _fields_ = [(name, ctypes.c_size_t) for name in ["arena", "b", "c", "d", "e", "f", "g", "used", "free", "keep"]]


def used() -> int:
    """Return the number of bytes that Python and PyBullet have allocated, without Python's small objects."""
    gc.collect()
    ask = ctypes.CDLL("libc.so.6").mallinfo2
    ask.restype = Malloc
    return int(ask().used)


def test_closed_worlds_free_their_memory_and_leave_no_files(serving: Case) -> None:
    def open_and_close(times: int) -> None:
        for _ in range(times):
            with PhysicsWorld(serving.embodiment, serving.initial, 0):
                pass

    open_and_close(3)
    before = used()
    open_and_close(10)
    assert used() - before < 200_000  # four vessels in each world; their meshes would take 2 MB
    assert not any(pybullet.isConnected(client) for client in range(64))
    assert not list(Path(tempfile.gettempdir()).glob(f"confab-bodies-{Path('/proc/self').resolve().name}-*"))

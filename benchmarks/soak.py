"""Test that memory, time per episode, open files and PyBullet's clients of a process don't grow over many episodes.

    python -m benchmarks.soak              1,000 symbolic episodes and 100 in physics
    python -m benchmarks.soak 1000 10      these numbers of episodes

An episode loads a scene, plans, executes the plan and learns. Memory is compared after a tenth of the episodes and at the end.
CPU time is compared between the first and the last tenth.
"""

from __future__ import annotations

import gc
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from time import process_time

import confab
from confab import sim  # noqa: F401 - imports PyBullet without its banner
from confab.memory import Memory

import pybullet  # isort: skip

PAGE = 4096


def resident() -> float:
    """Return the resident memory of this process in megabytes."""
    gc.collect()
    return int(Path("/proc/self/statm").read_text().split()[1]) * PAGE / 2**20


def files() -> int:
    """Return the number of open files of this process."""
    return len(list(Path("/proc/self/fd").iterdir()))


def clients() -> int:
    """Return the number of PyBullet servers to which this process is connected."""
    return sum(bool(pybullet.isConnected(client)) for client in range(64))


def symbolic(folder: Path) -> None:
    """Execute one episode in the symbolic world, and learn from it."""
    scene = confab.load("living-room")
    memory = Memory.of(scene)
    done = scene.execute(scene.plan())
    memory.live(scene.problem, done.episode)
    memory.save(folder / "memory.ttl")


def physics(folder: Path) -> None:
    """Execute one plan in physics."""
    scene = confab.load("one-arm-serving")
    assert scene.plan().verify().verified


def soak(episode: Callable[[Path], None], many: int) -> str:
    """Run episodes; return a row with the measurements after a tenth of the episodes and at the end."""
    times = []
    tenth = max(many // 10, 1)
    with tempfile.TemporaryDirectory() as name:
        for number in range(many):
            begin = process_time()
            episode(Path(name))
            times.append(process_time() - begin)
            if number + 1 == tenth:
                before = resident(), files(), clients()
    after = resident(), files(), clients()
    speed = [1000 * sum(part) / tenth for part in (times[:tenth], times[-tenth:])]
    growth = after[0] / before[0] - 1
    name = str(episode.__doc__).rstrip(".")
    return (
        f"| {name} | {many} | {before[0]:.0f} → {after[0]:.0f} MB ({growth:+.1%}) | {speed[0]:.0f} → {speed[1]:.0f} ms "
        f"| {before[1]} → {after[1]} | {before[2]} → {after[2]} |"
    )


def main() -> None:
    """Print the table."""
    counts = [int(word) for word in sys.argv[1:3]] or [1000, 100]
    print(
        "| episode | number | memory | CPU time of one episode | open files | PyBullet clients |\n|---|---|---|---|---|---|"
    )
    for episode, many in zip((symbolic, physics), counts, strict=False):
        if many:
            print(soak(episode, many), flush=True)


if __name__ == "__main__":
    main()

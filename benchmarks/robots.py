"""Robots that learn at once on a Ray cluster, are killed and parted at random, and in the end know the same, byte by byte.

    python -m benchmarks robots
    CONFAB_ROBOTS=16 CONFAB_ROUNDS=6 …     so many robots, so many rounds

Each robot has a memory file of its own. In each round it learns from a small table of its own and merges the files of those that it
can reach; some are killed in the middle of that, and go on from their file. In the end all can reach each other again. Of each
file the line that says who learns into it is left out.
"""

from __future__ import annotations

import os
import random
import tempfile
from pathlib import Path

from confab.reasoner.memory.experience import Experience
from confab.reasoner.memory.experience_file import load, save
from confab.reasoner.names import Names

SCENE = "https://example.org/table"
FAMILIES = ("served", "swap", "rotate", "handover", "blocked", "full")


def main() -> None:
    """Print how many were killed, and whether all ended with the same bytes."""
    robots, rounds = int(os.environ.get("CONFAB_ROBOTS", "16")), int(os.environ.get("CONFAB_ROUNDS", "6"))
    with tempfile.TemporaryDirectory() as folder:
        killed, texts = lived(Path(folder), robots, rounds, random.Random(1))
    print(
        f"{robots} robots, {rounds} rounds, {killed} killed: {len(set(texts))} different memories of {len(texts[0])} bytes"
    )
    if len(set(texts)) > 1:
        raise AssertionError("robots that heard of each other ended with different memories")


def lived(folder: Path, robots: int, rounds: int, chance: random.Random) -> tuple[int, list[bytes]]:
    """Let robots live, and return how many were killed and what each has in its file in the end."""
    import ray

    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False)
    killed = 0
    try:
        live = ray.remote(num_cpus=0.25, max_retries=0)(episode)
        for number in range(rounds):
            parts = [chance.randrange(3) for _ in range(robots)]  # who is in another part can't be reached
            running = []
            for robot in range(robots):
                peers = [other for other in range(robots) if parts[other] == parts[robot] and other != robot]
                running.append(live.remote(folder, robot, number, peers))
            for task in chance.sample(running, robots // 4):
                ray.wait([task], timeout=chance.random())
                ray.cancel(task, force=True)
            for task in running:
                try:
                    ray.get(task)
                except ray.exceptions.RayError:
                    killed += 1
        for _ in range(2):
            ray.get([live.remote(folder, robot, None, list(range(robots))) for robot in range(robots)])
    finally:
        ray.shutdown()
    files = [_file(folder, robot).read_bytes().splitlines() for robot in range(robots)]
    return killed, [b"\n".join(line for line in lines if b":learnsAs" not in line) for lines in files]


def episode(folder: Path, robot: int, number: int | None, peers: list[int]) -> None:
    """Learn from a table, if there is an episode, and merge what others know; written whole or not at all."""
    from confab.planner.experience.lessons import teach
    from worlds.lessons import problem

    own = _file(folder, robot)
    memory = load(own, Names(())) if own.exists() else Experience(f"robot{robot}")
    memory.replica = f"robot{robot}"
    if number is not None:
        teach(memory, problem(FAMILIES[(robot + number) % len(FAMILIES)], 4, robot))
        save(own, memory, Names(()), SCENE)
    for peer in peers:
        if _file(folder, peer).exists():  # else it was killed before it had learned anything
            memory.merge(load(_file(folder, peer), Names(())))
    save(own, memory, Names(()), SCENE)


def _file(folder: Path, robot: int) -> Path:
    return folder / f"robot{robot}.ttl"


if __name__ == "__main__":
    main()

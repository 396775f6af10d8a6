"""A process that learns and saves without end, prints the number of saved episodes after each save, and is killed by a test."""

import sys
from pathlib import Path

from confab.reasoner.memory.experience import Experience, GoalKind, Lesson, Tally
from confab.reasoner.names import Names
from worlds.memories import load, save


def main(path: Path) -> None:
    experience = load(path) if path.is_file() else Experience("robot")
    while True:
        number = experience.episodes.get("robot", 0)
        experience.learn(Lesson(counted=[(GoalKind("MOVE", ("Cup",)), ("number", str(number)), Tally(1))]))
        save(path, experience, Names(()), "https://x.org/k")
        print(experience.episodes["robot"], flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))

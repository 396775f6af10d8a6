"""Learns and saves without end, and says after each save how many episodes are safe: a process to be killed."""

import sys
from pathlib import Path

from reasoner.memory.counts import Candidate, Conclusion, Decision, Experience
from reasoner.memory.counts_file import load, save
from reasoner.names import Names


def main(path: Path) -> None:
    experience = load(path) if path.is_file() else Experience("robot")
    while True:
        number = experience.episodes.get("robot", 0)
        experience.learn([Decision(Candidate(Conclusion("MOVE", ("Cup",)), (("number", str(number)),)))])
        save(path, experience, Names(()), "https://x.org/k")
        print(experience.episodes["robot"], flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))

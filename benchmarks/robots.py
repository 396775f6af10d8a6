"""The problems of a workshop on deliberation, executed in the simulator pyrobosim.

``python -m benchmarks.robots WORLDS [problems|disturbed] [-n SEEDS] [-p 1 2 3 4]``. WORLDS is the folder of the workshop's
world files. Goals are checked against the state of pyrobosim, not against Confab's perception. A line for each run is written
to ``confab-out/robots``.
"""

from __future__ import annotations

import argparse
import json
import random
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from statistics import mean, median
from time import perf_counter, process_time
from typing import Any

import confab
from confab.connecting import connected
from confab.execution import Execution, execute
from confab.planner.acting.world import WorldReport
from confab.planner.plan import Limits, Step
from confab.scene import Scene
from confab.sim.robots.adapter import InterfaceWorld

PLANNING = Limits(seconds=300.0)
"""Limit of planning in wall-clock seconds, which allows for a busy machine."""

OUT = Path("confab-out") / "robots"
SCENES = {1: "rooms-snacks", 2: "rooms-waste", 3: "rooms-breakfast", 4: "rooms-battery"}
COLUMNS = ["problem", "runs", "reached", "agrees with pyrobosim", "planned ÷ reference", "planning s", "executed"]
COLUMNS += ["replans", "least charge", "CPU s"]
REFERENCE = {1: 4, 2: 15, 3: 16, 4: 34}
WANTED: Mapping[int, tuple[tuple[str, str | bool], ...]] = {
    1: (("snacks0", "table"),),
    2: (("waste0", "dumpster"), ("waste1", "dumpster"), ("dumpster", False)),
    3: (("bread0", "table"), ("butter0", "table"), ("fridge", False), ("pantry", False)),
}
"""The goals of the workshop: the location of an object, or whether a location is open."""


def at_goal(world: Any, problem: int) -> bool:
    """Return whether the goals of a problem hold in the state of pyrobosim."""
    if problem == 4:
        return at_goal(world, 2) and at_goal(world, 3)
    for name, wanted in WANTED[problem]:
        if isinstance(wanted, bool):
            if world.get_location_by_name(name).is_open != wanted:
                return False
        else:
            where = world.get_object_by_name(name).parent
            if getattr(getattr(where, "parent", None), "name", None) != wanted:
                return False
    return True


class Watched(InterfaceWorld):
    """A world that records the minimum charge of the battery, and is disturbed once before an action."""

    least = 100.0
    disturbed = ""
    due = -1
    hand: Callable[[Any], str] | None = None

    def execute(self, step: Step) -> WorldReport:
        """Execute a primitive; before the chosen primitive, disturb the world."""
        self.due -= 1
        world = self.transport.world  # type: ignore[attr-defined]
        if self.due == 0 and self.hand is not None:
            self.disturbed = self.hand(world)
        said = super().execute(step)
        self.least = min(self.least, *(robot.battery_level for robot in world.robots))
        return said


def another_hand(draw: random.Random) -> Callable[[Any], str]:
    """Return a function that moves an object, shuts a door or a location, or moves the robot to another place."""

    def moves(world: Any) -> str:
        robot = world.robots[0]
        things = [thing for thing in world.objects if thing is not robot.manipulated_object]
        thing = draw.choice(things)
        spot = draw.choice([spot for place in world.locations for spot in place.children if not place.is_charger])
        world.update_object(thing, spot)
        return f"{thing.name} is moved to {spot.name}"

    def shuts(world: Any) -> str:
        here = world.robots[0].location
        open_ = [each for each in (*world.hallways, *world.locations) if each.is_open]
        each = draw.choice([one for one in open_ if one is not here and one is not getattr(here, "parent", None)])
        world.close_location(each)
        return f"{each.name} is shut"

    def carries(world: Any) -> str:
        robot = world.robots[0]
        room = draw.choice([room for room in world.rooms if room.nav_poses])
        robot.set_pose(room.nav_poses[0])
        if robot.manipulated_object is not None:
            robot.manipulated_object.set_pose(robot.get_pose())
        return f"the robot is carried to {room.name}"

    return draw.choice([moves, shuts, carries])


def run(scene: Scene, problem: int, worlds: Path, seed: int, disturbed: bool) -> dict[str, Any]:
    """Return the result of one run."""
    file = worlds / f"world{problem}.yaml"
    inner, retry_policy = connected(scene, scene.problem, f"pyrobosim:{file}", seed)
    world = Watched(inner.interface, inner.transport, scene.problem)
    draw = random.Random(seed)
    if disturbed:
        world.due, world.hand = draw.randint(2, REFERENCE[problem]), another_hand(draw)
    wall, cpu = perf_counter(), process_time()
    done: Execution = execute(scene, scene.problem, world=world, retry_policy=replace(retry_policy, planning=PLANNING))
    episode = done.episode
    truth = at_goal(inner.transport.world, problem)  # type: ignore[attr-defined]
    return {
        "problem": problem,
        "seed": seed,
        "status": episode.status.value,
        "at_goal": truth,
        "agrees": truth == (episode.status.value == "reached"),
        "planned": len(episode.planned.primitives),
        "planning": episode.seconds["planning"],
        "executed": len(episode.events),
        "failures": len(episode.failures),
        "replans": len(episode.replans),
        "least_charge": round(world.least, 1),
        "disturbed": world.disturbed,
        "wall": round(perf_counter() - wall, 1),
        "cpu": round(process_time() - cpu, 1),
        "reasons": [reason.text for reason in episode.reasons],
    }


def main() -> None:
    """Run the problems, and print a row for each run."""
    parser = argparse.ArgumentParser()
    parser.add_argument("worlds", type=Path)
    parser.add_argument("what", nargs="?", choices=("problems", "disturbed"), default="problems")
    parser.add_argument("-n", type=int, default=10)
    parser.add_argument("-p", type=int, nargs="+", default=[1, 2, 3, 4])
    given = parser.parse_args()
    OUT.mkdir(parents=True, exist_ok=True)
    print("| " + " | ".join(COLUMNS) + " |")
    print("|---" * len(COLUMNS) + "|")
    for problem in given.p:
        scene = confab.load(SCENES[problem])
        rows = []
        with (OUT / f"{given.what}-{problem}.jsonl").open("w", encoding="utf-8") as file:
            for seed in range(given.n):
                rows.append(run(scene, problem, given.worlds, seed, given.what == "disturbed"))
                file.write(json.dumps(rows[-1]) + "\n")
                file.flush()
        reached = sum(row["at_goal"] and row["status"] == "reached" for row in rows)
        print(
            f"| {problem} | {len(rows)} | {reached} | {sum(row['agrees'] for row in rows)} "
            f"| {max(row['planned'] for row in rows)} ÷ {REFERENCE[problem]} | {median(row['planning'] for row in rows):.2f} "
            f"| {mean(row['executed'] for row in rows):.1f} | {mean(row['replans'] for row in rows):.1f} "
            f"| {min(row['least_charge'] for row in rows):.0f} | {mean(row['cpu'] for row in rows):.1f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()

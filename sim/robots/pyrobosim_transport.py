"""pyrobosim as a robot: its actions, and its world as a model of entities and fields (extra `pyrobosim`)."""

from __future__ import annotations

import logging
import random
from collections.abc import Iterable, Iterator, Mapping
from itertools import chain, product
from pathlib import Path
from typing import Any

import networkx
import numpy as np

from confab.sim.robots.transport import RobotError, WorldModel

AS_FAST_AS_POSSIBLE = -1.0
"""pyrobosim's real-time factor for a simulation without waiting."""

DETOUR = 1.5
"""Assumed maximum ratio of a path that a sampling planner finds to the shortest path along the axes."""

USES = ("navigate", "pick", "place", "open", "close", "detect")
"""The actions whose battery usage a world file states."""


class Pyrobosim:
    """A transport (`confab.sim.robots.transport.Transport`) to a simulated world without a window.

    Parameters
    ----------
    where : str
        Path of a YAML file with a world.
    seed : int
        Seed of all random numbers.

    Raises
    ------
    RobotError
        pyrobosim isn't installed, or the file can't be read.
    """

    def __init__(self, where: str, seed: int = 0) -> None:
        try:
            from pyrobosim.core.yaml_utils import WorldYamlLoader
        except ImportError as error:
            raise RobotError(f"pyrobosim isn't installed ({error}); pip install 'confab-planner[pyrobosim]'") from error
        random.seed(seed)
        np.random.seed(seed % 2**32)
        before = logging.root.manager.disable
        try:
            logging.disable(logging.INFO)  # worlds and robots write to the log before their loggers can be configured
            self.world: Any = WorldYamlLoader().from_file(Path(where))
        except Exception as error:
            raise RobotError(f"{where}: pyrobosim can't read this world ({type(error).__name__}: {error})") from error
        finally:
            logging.disable(before)
        self.running: Any = None
        self.searched: set[str] = set()
        self._quiet()
        for number, robot in enumerate(self.world.robots):
            for kind, options in sorted(robot.action_execution_options.items()):
                options.rng = np.random.default_rng([seed, number, *kind.encode()])

    def _quiet(self) -> None:
        """Restrict pyrobosim's log to errors, since verdicts report failures."""
        for owner in (self.world, *self.world.robots):
            owner.logger.setLevel(logging.ERROR)

    def call(self, action: str, arguments: Mapping[str, str]) -> tuple[str, str]:
        """Execute an action by the robot that the argument `robot` names, or by the only robot."""
        from pyrobosim.planning.actions import TaskAction

        robot = self._robot(arguments.get("robot", ""))
        rest = {name: value for name, value in arguments.items() if name != "robot"}
        try:
            wanted = TaskAction(action, **rest)
        except TypeError as error:
            raise RobotError(f"pyrobosim's actions take no such argument: {error}") from error
        self.running, robot.last_detected_objects = robot, None
        try:
            result = robot.execute_action(wanted, realtime_factor=AS_FAST_AS_POSSIBLE)
        finally:
            self.running = None
        if result.is_success() and robot.last_detected_objects is not None:
            self._note_search(robot)
        return result.status.name, result.message or ""

    def _note_search(self, robot: Any) -> None:
        """Mark the robot's location as searched if the robot knows all objects there."""
        there = {thing.name for thing in getattr(robot.location, "children", ())}
        if there <= {thing.name for thing in robot.get_known_objects()}:
            self.searched.add(robot.location.name)

    def _robot(self, name: str) -> Any:
        found = [robot for robot in self.world.robots if name in ("", robot.name)]
        if not found:
            known = ", ".join(robot.name for robot in self.world.robots)
            raise RobotError(f"pyrobosim has no robot '{name}' (robots: {known})")
        return found[0]

    def cancel(self) -> None:
        """End the running action."""
        robot = self.running
        if robot is not None:
            robot.cancel_actions()

    def model(self) -> WorldModel:
        """Return rooms, hallways, locations with their spawns, objects known to the robots, robots, and paths."""
        world = self.world
        known = {thing.name for robot in world.robots for thing in robot.get_known_objects()}
        spots = [spot for location in world.locations for spot in location.children]
        found: dict[str, dict[str, Any]] = {}
        for room in world.rooms:
            found[room.name] = {"kind": "room"}
        for hall in world.hallways:
            ends = [hall.room_start.name, hall.room_end.name]
            found[hall.name] = {"kind": "hallway", "open": hall.is_open, "locked": hall.is_locked, "rooms": ends}
        for location in world.locations:
            found[location.name] = {
                "kind": "location",
                "category": location.category,
                "open": location.is_open,
                "locked": location.is_locked,
                "room": location.parent.name,
            }
        for spot in spots:
            charger = spot.parent.is_charger
            found[spot.name] = {"kind": "charger" if charger else "spot", "location": spot.parent.name}
            found[spot.name]["room"] = spot.parent.parent.name
        for thing in world.objects:
            seen = thing.name in known
            found[thing.name] = {
                "kind": "object",
                "category": thing.category,
                "at": thing.parent.name if seen else None,
                "may_be_at": [] if seen else [spot.name for spot in spots if spot.name not in self.searched],
            }
        for robot in world.robots:
            options = robot.action_execution_options
            found[robot.name] = {
                "kind": "robot",
                "at": getattr(robot.location, "name", None),
                "room": self._room_of(robot),
                "battery": float(robot.battery_level),
                **{f"{kind}_use": options[kind].battery_usage if kind in options else 0.0 for kind in USES},
            }
        return found

    def _room_of(self, robot: Any) -> str | None:
        """Return the room of a robot; for a robot in a hallway, the room at the nearer end."""
        here = robot.location
        if hasattr(here, "room_start"):
            place = robot.get_pose()
            ends = [(here.nav_poses[0], here.room_start), (here.nav_poses[-1], here.room_end)]
            return str(min(ends, key=lambda end: end[0].get_linear_distance(place))[1].name)
        while here is not None and here not in self.world.rooms:
            here = getattr(here, "parent", None)
        return None if here is None else str(here.name)

    def scene_model(self) -> WorldModel:
        """Return the world model with shapes, and with the longest path in metres between places of any two rooms."""
        shapes = self._shapes()
        shaped = {name: {**fields, "shape": shapes.get(name, [])} for name, fields in self.model().items()}
        return {**shaped, **dict(self._ways())}

    def _shapes(self) -> dict[str, list[str]]:
        """Return the polygon of each room, and a point of each room, hallway and spot, as well-known text (WKT)."""
        world = self.world
        spots = (spot for location in world.locations for spot in location.children)
        solid = [(each.name, each.polygon) for each in chain(world.rooms, world.hallways, spots)]
        shapes = {name: [_text("POINT ({})", polygon.representative_point().coords)] for name, polygon in solid}
        for room in world.rooms:
            shapes[room.name].append(_text("POLYGON (({}))", room.polygon.exterior.coords))
        return shapes

    def _ways(self) -> Iterator[tuple[str, Mapping[str, Any]]]:
        world = self.world
        graph: networkx.Graph[tuple[str, tuple[float, float]]] = networkx.Graph()
        inside: dict[str, list[tuple[float, float]]] = {}
        for room in world.rooms:
            spots = (spot for location in room.locations for spot in location.children)
            halls = world.get_hallways_attached_to_room(room)
            poses = chain(room.nav_poses, *(each.nav_poses for each in chain(spots, halls)))
            points = sorted({(round(pose.x, 3), round(pose.y, 3)) for pose in poses})
            inside[room.name] = points or [tuple(room.centroid)]
            for one, other in product(inside[room.name], repeat=2):
                graph.add_edge((room.name, one), (room.name, other), way=_apart(one, other))
        for hall in world.hallways:
            ends = [(round(pose.x, 3), round(pose.y, 3)) for pose in (hall.nav_poses[0], hall.nav_poses[-1])]
            for one, other in product(ends, repeat=2):
                graph.add_edge((hall.room_start.name, one), (hall.room_end.name, other), way=_apart(one, other))
        lengths = dict(networkx.all_pairs_dijkstra_path_length(graph, weight="way"))
        for begin, end in product(sorted(inside), repeat=2):
            ways = [lengths[begin, one].get((end, other), 0.0) for one, other in product(inside[begin], inside[end])]
            yield (
                f"way.{begin}.{end}",
                {"kind": "way", "begin": begin, "end": end, "metres": round(DETOUR * max(ways), 1)},
            )


def _apart(one: tuple[float, float], other: tuple[float, float]) -> float:
    return abs(one[0] - other[0]) + abs(one[1] - other[1])


def _text(form: str, points: Iterable[tuple[float, float]]) -> str:
    """Return points as well-known text (WKT), rounded to centimetres."""
    return form.format(", ".join(f"{round(x, 2) + 0.0:g} {round(y, 2) + 0.0:g}" for x, y in points))

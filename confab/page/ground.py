"""The background of the map: places, areas and robots at their coordinates, or a computed layout of places without coordinates."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import cos, hypot, sin

import numpy as np

from confab.reasoner.embodiment.values import Embodiment
from confab.reasoner.problem import Problem

Point = tuple[float, float]
MOST_SPOTS = 400
"""Maximum number of places on a map."""
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
"""Pattern of a coordinate in well-known text."""
STRETCH = 1.7
"""Factor by which a layout of connected places is stretched horizontally, since pages and names are wider than high."""


@dataclass(frozen=True)
class Area:
    """A polygon with a name, such as a table, a shelf or a room."""

    name: str
    corners: tuple[Point, ...]


@dataclass(frozen=True)
class MapGround:
    """The background of the map: positions of places, areas, connections between places, and positions of robots.

    The x axis points to the right, and the y axis points down. If `metric` is true, positions are in metres, otherwise positions
    have no unit. The text `note` tells the user where the positions come from.
    """

    spots: Mapping[str, Point]
    areas: tuple[Area, ...] = ()
    ways: tuple[tuple[str, str], ...] = ()
    robots: tuple[tuple[str, Point], ...] = ()
    metric: bool = True
    note: str = ""


def ground_of(
    problem: Problem, embodiment: Embodiment | None, shapes: Iterable[tuple[str, str]] = ()
) -> MapGround | None:
    """Return the background of the map, or None if the problem has no places.

    Places are drawn at their coordinates. Without coordinates, places that static relations connect are drawn near each other;
    other places are drawn in rows. If there are more than `MOST_SPOTS` places, the map shows no places, and its note states the
    reason.

    Parameters
    ----------
    problem : Problem
    embodiment : Embodiment, optional
    shapes : iterable of pairs of an individual and its shape
        Points and polygons as well-known text, in metres, with the y axis up (`c:shape`).
    """
    if embodiment is not None and embodiment.places:
        return _furnished(embodiment)
    return _drawn(shapes) or _connected(problem) or _in_order(problem)


def _too_many(number: int) -> MapGround:
    return MapGround({}, note=f"there is no map, since {number:,} places are too many for one ({MOST_SPOTS} at most)")


def _furnished(embodiment: Embodiment) -> MapGround:
    """Return the furniture and places of an embodiment in the view of the film, whose camera is opposite the robots."""
    if len(embodiment.places) > MOST_SPOTS:
        return _too_many(len(embodiment.places))
    from confab.sim.linkage import with_open_mechanisms

    places, solids = with_open_mechanisms(embodiment)
    middle = np.array([place.position for place in places.values()]).mean(0)
    robots = [robot.position for robot in embodiment.robots]
    ahead, aside = (middle - np.mean(robots, axis=0))[:2] if robots else (1.0, 0.0)
    length = hypot(ahead, aside)
    ahead, aside = (float(ahead) / length, float(aside) / length) if length > 1e-9 else (1.0, 0.0)

    def seen(x: float, y: float) -> Point:
        return round(ahead * y - aside * x, 4), round(ahead * x + aside * y, 4)

    areas = []
    for fixture in embodiment.fixtures:
        half = [(dx * fixture.size[0] / 2, dy * fixture.size[1] / 2) for dx, dy in ((1, 1), (1, -1), (-1, -1), (-1, 1))]
        turned = [
            (x * cos(fixture.yaw) - y * sin(fixture.yaw), x * sin(fixture.yaw) + y * cos(fixture.yaw)) for x, y in half
        ]
        corners = tuple(seen(fixture.position[0] + x, fixture.position[1] + y) for x, y in turned)
        areas.append(Area(fixture.name, corners))
    of: dict[str, list[Point]] = {}
    for solid in solids:
        reach = abs(solid.rotation) @ np.array(solid.half)
        for sign in (-1, 1):
            of.setdefault(solid.name, []).append(seen(*(solid.center + sign * reach)[:2]))
    for name, points in of.items():  # the area that a mechanism occupies when every joint is open
        (left, right), (back, front) = ((min(side), max(side)) for side in zip(*points, strict=True))
        areas.append(Area(name, ((left, back), (right, back), (right, front), (left, front))))
    return MapGround(
        {place.name: seen(*place.position[:2]) for place in places.values()},
        tuple(areas),
        robots=tuple((robot.name, seen(*robot.position[:2])) for robot in embodiment.robots),
        note="to scale, seen from the side of the film's camera",
    )


def _drawn(shapes: Iterable[tuple[str, str]]) -> MapGround | None:
    """Return the polygons and points of shapes, or None; without a point, the mean of the polygon's corners is the point."""
    spots: dict[str, Point] = {}
    areas: list[Area] = []
    for name, text in shapes:
        kind, numbers = text.split("(")[0].strip().upper(), [float(number) for number in NUMBER.findall(text)]
        points = tuple((x, -y) for x, y in zip(numbers[::2], numbers[1::2], strict=False))
        if kind == "POINT" and len(points) == 1:
            spots[name] = points[0]
        elif kind == "POLYGON" and len(points) > 2:
            areas.append(Area(name, points[:-1] if points[0] == points[-1] else points))
    for area in areas:
        right, down = zip(*area.corners, strict=True)
        spots.setdefault(area.name, (sum(right) / len(right), sum(down) / len(down)))
    if not spots:
        return None
    if len(spots) > MOST_SPOTS:
        return _too_many(len(spots))
    return MapGround(spots, tuple(areas), note="to scale")


def _connected(problem: Problem) -> MapGround | None:
    """Return a layout in which connected places are close together. Return None for fewer than three places."""
    import networkx

    values = _values(problem)
    graph: networkx.Graph[str] = networkx.Graph()
    for _, rows in sorted(problem.relations.items()):
        graph.add_edges_from(sorted(row for row in rows if len(row) == 2 and row[0] != row[1] and values >= {*row}))
    shown = max(networkx.connected_components(graph), key=lambda part: (len(part), min(part)), default=set())
    if len(shown) < 3:
        return None
    if len(shown) > MOST_SPOTS:
        return _too_many(len(shown))
    graph = networkx.Graph(sorted((min(pair), max(pair)) for pair in graph.subgraph(shown).edges))
    places = networkx.kamada_kawai_layout(graph)
    spots = {name: (round(STRETCH * float(x), 4), round(float(y), 4)) for name, (x, y) in places.items()}
    ways = tuple(sorted((min(pair), max(pair)) for pair in graph.edges))
    return MapGround(
        spots, ways=ways, metric=False, note="places have no coordinates; lines connect them as static relations do"
    )


def _in_order(problem: Problem) -> MapGround | None:
    """Return a layout of the places in rows, ordered by name. Return None for fewer than three places."""
    kinds = {
        problem.domain.situations[symbol.situation].range
        for symbol in problem.initial
        if len(symbol.arguments) == 1 and problem.domain.situations[symbol.situation].rest is None
    }
    held = {symbol.arguments[0] for symbol in problem.initial if symbol.arguments}
    lists = [problem.classes.get(kind, ()) for kind in sorted(kinds)]
    places = max((those for those in lists if not held & {*those}), key=len, default=())
    if len(places) < 3:
        return None
    if len(places) > MOST_SPOTS:
        return _too_many(len(places))
    wide = max(3, round((2.2 * len(places)) ** 0.5))
    names = sorted(places, key=natural)
    spots = {name: (float(number % wide), float(number // wide)) for number, name in enumerate(names)}
    return MapGround(spots, metric=False, note="places have neither coordinates nor connections: they stand in order")


def natural(name: str) -> list[tuple[int, str]]:
    """Return the sort key of a name in natural order, in which ``cup2`` precedes ``cup10``.

    >>> sorted(["cup10", "cup2"], key=natural)
    ['cup2', 'cup10']
    """
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in re.split(r"(\d+)", name)]


def _values(problem: Problem) -> set[str]:
    """Return all values of the situation types of initial facts."""
    situations = {symbol.situation for symbol in problem.initial}
    return {v for name in situations for v in problem.classes.get(problem.domain.situations[name].range, ())}

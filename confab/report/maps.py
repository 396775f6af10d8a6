"""A map of moved objects: of the table if places have coordinates, else of the places that static relations connect."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import cos, sin
from typing import TYPE_CHECKING

import numpy as np

from confab.reasoner.embodiment.values import Embodiment
from confab.reasoner.symbols import Problem
from confab.report.course import Timeline
from confab.report.markup import Markup, tag

if TYPE_CHECKING:
    from confab.labels import Labels

Spots = Mapping[str, tuple[float, float]]
MOST_SPOTS = 60
"""Maximum number of places of a legible map."""
MOST_NAMES = 2
"""Maximum number of names shown at one place."""
STRETCH = 1.7
"""Horizontal stretch of a layout of connected places, since pages and names are wide."""
LINE, NAME = 13.0, 90.0
"""Approximate height and width of a name, in units of the picture."""


@dataclass(frozen=True)
class Ground:
    """Positions of places (x to the right, y down), boxes by their corners, connections between places, positions of robots."""

    spots: Spots
    boxes: tuple[tuple[tuple[float, float], ...], ...] = ()
    ways: tuple[tuple[str, str], ...] = ()
    robots: tuple[tuple[float, float], ...] = ()


def ground_of(problem: Problem, embodiment: Embodiment | None) -> Ground | None:
    """Return the background of the map, or None if places have neither coordinates nor connections."""
    if embodiment is not None and embodiment.places:
        return _table(embodiment)
    return _graph(problem)


def _table(embodiment: Embodiment) -> Ground | None:
    """Return a table from the robot's point of view: the robot is below, its left is on the left."""
    if len(embodiment.places) > MOST_SPOTS:
        return None

    def seen(x: float, y: float) -> tuple[float, float]:
        return -y, -x

    from confab.sim.linkage import with_open_mechanisms

    places, solids = with_open_mechanisms(embodiment)
    boxes = []
    for fixture in embodiment.fixtures:
        half = [(dx * fixture.size[0] / 2, dy * fixture.size[1] / 2) for dx, dy in ((1, 1), (1, -1), (-1, -1), (-1, 1))]
        turned = [
            (x * cos(fixture.yaw) - y * sin(fixture.yaw), x * sin(fixture.yaw) + y * cos(fixture.yaw)) for x, y in half
        ]
        boxes.append(tuple(seen(fixture.position[0] + x, fixture.position[1] + y) for x, y in turned))
    of: dict[str, list[tuple[float, float]]] = {}
    for solid in solids:
        reach = abs(solid.rotation) @ np.array(solid.half)
        for sign in (-1, 1):
            of.setdefault(solid.name, []).append(seen(*(solid.center + sign * reach)[:2]))
    for corners in of.values():  # the area of mechanisms with every joint open
        (left, right), (back, front) = ((min(side), max(side)) for side in zip(*corners, strict=True))
        boxes.append(((left, back), (right, back), (right, front), (left, front)))
    return Ground(
        {place.name: seen(*place.position[:2]) for place in places.values()},
        tuple(boxes),
        robots=tuple(seen(*robot.position[:2]) for robot in embodiment.robots),
    )


def _graph(problem: Problem) -> Ground | None:
    """Return values of a situation type that static relations connect, laid out so that connected ones are near."""
    import networkx

    situations = {symbol.situation for symbol in problem.initial}
    values = {v for name in situations for v in problem.classes.get(problem.domain.situations[name].range, ())}
    graph: networkx.Graph[str] = networkx.Graph()
    for _, rows in sorted(problem.relations.items()):
        graph.add_edges_from(sorted(row for row in rows if len(row) == 2 and row[0] != row[1]))
    parts = [part for part in networkx.connected_components(graph) if len(part & values) > 1]
    shown = max(parts, key=lambda part: (len(part & values), min(part)), default=set())
    if len(shown) < 3 or len(shown) > MOST_SPOTS:
        return None
    graph = networkx.Graph(sorted((min(pair), max(pair)) for pair in graph.subgraph(shown).edges))
    places = networkx.kamada_kawai_layout(graph)
    spots = {name: (STRETCH * float(x), float(y)) for name, (x, y) in places.items()}
    return Ground(spots, ways=tuple(sorted((min(pair), max(pair)) for pair in graph.edges)))


def place_map(ground: Ground, course: Timeline, labels: Labels | None = None) -> Markup:
    """Return a picture of the initial and final places of objects."""
    moves = _moves(ground, course)
    xs, ys = zip(*[*ground.spots.values(), *(corner for box in ground.boxes for corner in box)], strict=True)
    wide, high = max(max(xs) - min(xs), 1e-9), max(max(ys) - min(ys), 1e-9)
    crowd = min(2.2, max(1.0, len(ground.spots) / 12))
    scale = 440 * crowd / max(wide, 1.6 * high)

    size = _size({name: (x * scale, y * scale) for name, (x, y) in ground.spots.items()})
    stretch = _stretch([(x * scale, y * scale) for x, y in ground.spots.values()], size, _most_together(moves))

    def at(point: tuple[float, float]) -> tuple[float, float]:
        return 52 + (point[0] - min(xs)) * scale, 50 + (point[1] - min(ys)) * scale * stretch

    spots = {name: at(point) for name, point in ground.spots.items()}
    width = 104 + wide * scale
    height = 100 + high * scale * stretch + (46 if ground.robots else 0)

    def name(of: str) -> str:
        return labels.name(of) if labels else of

    drawn: list[Markup] = [
        tag("path", d="M" + " L".join(f"{x:.1f} {y:.1f}" for x, y in map(at, box)) + " Z", class_="table")
        for box in ground.boxes
    ]
    for a, b in ground.ways:
        (x1, y1), (x2, y2) = spots[a], spots[b]
        drawn.append(tag("line", x1=f"{x1:.1f}", y1=f"{y1:.1f}", x2=f"{x2:.1f}", y2=f"{y2:.1f}", class_="way"))
    for x, y in spots.values():
        drawn.append(tag("circle", cx=f"{x:.1f}", cy=f"{y:.1f}", r=f"{size:.1f}", class_="spot"))
    together: dict[str, list[str]] = {}
    for number, (thing, before, after, away) in enumerate(moves):
        color, (x, y) = f"v{number % 8}", spots[after]
        way = f"{name(before)} → {name(after)}" if before != after else name(after)
        if before != after:
            drawn += _arrow(spots[before], spots[after], size, color)
        x += 5 * len(together.setdefault(after, []))
        together[after].append(f"{name(thing)} ({name(away)})" if away else name(thing))
        dot = {"cx": f"{x:.1f}", "cy": f"{y:.1f}", "r": f"{size * 0.66:.1f}"}
        drawn.append(
            tag(
                "circle",
                tag("title", f"{name(thing)}: {way}"),
                class_=f"{'before' if away else 'thing'} {color}",
                **dot,
            )
        )
    drawn += [_text(x, y + size + 12, name(spot), "place") for spot, (x, y) in spots.items()]
    for after, things in together.items():
        more = [f"+ {len(things) - MOST_NAMES} more"] if len(things) > MOST_NAMES else []
        for up, words in enumerate([*more, *things[:MOST_NAMES]]):
            drawn.append(_text(spots[after][0], spots[after][1] - size - 4 - 13 * up, words, "thing"))
    base = at((0.0, max(ys)))[1]
    for x, y in map(at, ground.robots):
        drawn.append(_text(x, min(max(y, base + 24), height - 30), "robot (its left is left)", "place"))
    said = "; ".join(
        f"{name(thing)} from {name(before)} to {name(after)}" for thing, before, after, _ in moves if before != after
    )
    svg = tag(
        "svg", drawn, viewBox=f"0 0 {width:.0f} {height:.0f}", role="img", aria_label=f"Map: {said or 'nothing moved'}"
    )
    legend = "dashed: before; filled: after" if said else "nothing changed its place"
    legend += f"; depth drawn {stretch:.1f} times as large" if ground.boxes and stretch > 1 else ""
    return tag("figure", svg, tag("figcaption", legend), class_="map")


def _moves(ground: Ground, course: Timeline) -> list[tuple[str, str, str, str]]:
    """Return the objects on the map: name, first and last place there, and final value if that is not on the map.

    The place of an object is the value of a symbol that begins on the map and whose situation type has no rest value, since a
    hand's position is no place of an object. Of several such symbols, the one that is longest on the map counts.
    """
    situations = course.problem.domain.situations
    found: dict[str, tuple[float, str, str, str]] = {}
    for symbol, phases in sorted(course.phases.items()):
        places = [phase for phase in phases if phase.value in ground.spots]
        if len(symbol.arguments) != 1 or not places or phases[0].value not in ground.spots:
            continue
        if situations[symbol.situation].rest is not None:
            continue
        (thing,) = symbol.arguments
        long = sum(phase.end - phase.begin for phase in places)
        if thing not in found or long > found[thing][0]:
            last = phases[-1].value
            found[thing] = long, places[0].value, places[-1].value, "" if last in ground.spots else last
    return [(thing, before, after, away) for thing, (_, before, after, away) in sorted(found.items())]


def _most_together(moves: Sequence[tuple[str, str, str, str]]) -> int:
    """Return the maximum number of names above one final place."""
    places = [after for _, _, after, _ in moves]
    return max((min(places.count(place), MOST_NAMES + 1) for place in places), default=0)


def _stretch(points: Sequence[tuple[float, float]], size: float, names: int) -> float:
    """Return the vertical stretch at which the name of a place and those of objects behind it don't overlap."""
    needed = 2 * size + LINE * (names + 1) + 8
    near = [
        abs(a[1] - b[1])
        for i, a in enumerate(points)
        for b in points[:i]
        if abs(a[0] - b[0]) < NAME and abs(a[1] - b[1]) > size
    ]
    return min(3.0, max(1.0, needed / min(near, default=needed)))


def _size(spots: Spots) -> float:
    """Return the radius of places at which neighbours don't touch."""
    points = list(spots.values())
    apart = min(
        (abs(complex(*a) - complex(*b)) for i, a in enumerate(points) for b in points[:i] if a != b), default=80.0
    )
    return min(15.0, max(4.0, 0.3 * apart))


def _text(x: float, y: float, words: str, kind: str) -> Markup:
    return tag("text", words, x=f"{x:.1f}", y=f"{y:.1f}", class_=kind)


def _arrow(start: tuple[float, float], end: tuple[float, float], size: float, color: str) -> Sequence[Markup]:
    """Return a dashed ring at the initial place, and a bent arrow from there to the final place."""
    (x1, y1), (x2, y2) = start, end
    length = max(abs(complex(x2 - x1, y2 - y1)), 1e-9)
    ux, uy = (x2 - x1) / length, (y2 - y1) / length
    bend = min(0.18 * length, 40.0)
    mx, my = (x1 + x2) / 2 - uy * bend, (y1 + y2) / 2 + ux * bend
    away = abs(complex(x2 - mx, y2 - my)) or 1.0
    vx, vy = (x2 - mx) / away, (y2 - my) / away  # the direction in which the arrow arrives
    tx, ty = x2 - vx * size * 1.15, y2 - vy * size * 1.15
    head = [(tx, ty), (tx - vx * 10 - vy * 5, ty - vy * 10 + vx * 5), (tx - vx * 10 + vy * 5, ty - vy * 10 - vx * 5)]
    tip = " L".join(f"{x:.1f} {y:.1f}" for x, y in head)
    return [
        tag("circle", cx=f"{x1:.1f}", cy=f"{y1:.1f}", r=f"{size * 0.66:.1f}", class_=f"before {color}"),
        tag(
            "path",
            d=f"M{x1:.1f} {y1:.1f} Q{mx:.1f} {my:.1f} {tx - vx * 8:.1f} {ty - vy * 8:.1f}",
            class_=f"move {color}",
        ),
        tag("path", d=f"M{tip} Z", class_=f"tip {color}"),
    ]

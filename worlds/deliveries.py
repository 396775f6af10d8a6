"""Mobile robots that deliver boxes between rooms; each robot carries one box and has its own speed."""

from __future__ import annotations

from fractions import Fraction
from random import Random

from confab.reasoner.amounts import Expression, Measure
from confab.reasoner.problem import Domain, Problem
from confab.reasoner.symbols import (
    Behavior,
    Condition,
    EqualityCondition,
    Parameter,
    SituationType,
    Span,
    Symbol,
    Timing,
    ValueCondition,
    ValueEffect,
)


def deliveries(boxes: int, robots: int = 3, seed: int = 0) -> Problem:
    """Return a problem of random deliveries between rooms on a grid."""
    rng = Random(f"deliveries {boxes} {robots} {seed}")
    every = [f"robot{i + 1}" for i in range(robots)]
    parcels = [f"box{i + 1}" for i in range(boxes)]
    rooms = [f"room{i + 1}" for i in range(max(4, boxes // 2))]
    places = dict(
        zip(rooms, rng.sample([(x, y) for x in range(len(rooms)) for y in range(4)], len(rooms)), strict=True)
    )
    speeds = {robot: Fraction(rng.choice((2, 3, 4)), 2) for robot in every}

    def seconds(robot: str, one: str, other: str) -> str:
        way = sum(abs(a - b) for a, b in zip(places[one], places[other], strict=True))
        return str(way / speeds[robot])

    pairs = [(one, other) for one in rooms for other in rooms if one != other]
    ways = frozenset((robot, *pair, seconds(robot, *pair)) for robot in every for pair in pairs)
    situations = {
        "STANDS": SituationType("STANDS", ("Robot",), "Room"),
        "LIES": SituationType("LIES", ("Box",), "Place"),
        "CARRIES": SituationType("CARRIES", ("Robot",), "Load", rest="nothing"),
    }
    robot, box, room, other = (
        Parameter(*one) for one in (("?r", "Robot"), ("?b", "Box"), ("?o", "Room"), ("?p", "Room"))
    )
    stands, empty = ValueCondition("STANDS", ("?r",), "?o"), ValueCondition("CARRIES", ("?r",), "nothing")
    go = _behavior(
        "GO",
        (robot, other),
        (room,),
        (stands, EqualityCondition("?o", "?p", negated=True)),
        (ValueEffect("STANDS", ("?r",), "?p"),),
        Measure("seconds", ("?r", "?o", "?p")),
    )
    load = _behavior(
        "LOAD",
        (robot, box),
        (room,),
        (stands, empty, ValueCondition("LIES", ("?b",), "?o")),
        (ValueEffect("LIES", ("?b",), "?r"), ValueEffect("CARRIES", ("?r",), "?b")),
        Fraction(3),
    )
    unload = _behavior(
        "UNLOAD",
        (robot, box),
        (room,),
        (stands, ValueCondition("CARRIES", ("?r",), "?b")),
        (ValueEffect("LIES", ("?b",), "?o"), ValueEffect("CARRIES", ("?r",), "nothing")),
        Fraction(2),
    )
    classes = {
        "Robot": tuple(every),
        "Box": tuple(parcels),
        "Room": tuple(rooms),
        "Place": (*rooms, *every),
        "Load": (*parcels, "nothing"),
    }
    initial = {Symbol("STANDS", (one,)): rng.choice(rooms) for one in every}
    initial |= {Symbol("CARRIES", (one,)): "nothing" for one in every}
    initial |= {Symbol("LIES", (one,)): rng.choice(rooms) for one in parcels}
    goal = {
        symbol: rng.choice([r for r in rooms if r != initial[symbol]])
        for symbol in initial
        if symbol.situation == "LIES"
    }
    behaviors = {one.name: one for one in (go, load, unload)}
    return Problem("urn:deliveries", Domain(situations, behaviors), classes, {"seconds": ways}, initial, goal)


def _behavior(
    name: str,
    parameters: tuple[Parameter, ...],
    variables: tuple[Parameter, ...],
    conditions: tuple[Condition, ...],
    effects: tuple[ValueEffect, ...],
    seconds: Expression,
) -> Behavior:
    timing = Timing(
        seconds,
        ("?r",),
        tuple((Span.THROUGHOUT, one) for one in conditions),
        tuple((Span.THROUGHOUT, one) for one in effects),
    )
    return Behavior(name, 1, parameters, variables, conditions, effects, timing=timing)

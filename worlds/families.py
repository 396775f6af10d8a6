"""Tabletop problems of any size, for tests and benchmarks, of the families that `confab generate` writes."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

from confab.reasoner.graph.knowledge import load
from confab.reasoner.problem import Problem
from confab.reasoner.reading.problem import read
from confab.reasoner.symbols import Symbol

FAMILIES = ("served", "swap", "rotate", "full", "packed", "handover", "blocked")


@lru_cache(maxsize=1)
def tabletop() -> Problem:
    """Return the problem of the shipped scene. All tables have the domain and the classes of this scene."""
    return read(load("beverage-serving")).problem


def table(
    places: int,
    hands: int,
    cups: int,
    bottles: int,
    at: Sequence[int],
    goals: dict[str, int],
    pours: dict[str, str],
    reach: Sequence[set[int]],
    drinks: dict[str, str] | None = None,
    filled: dict[str, str] | None = None,
) -> Problem:
    """Return a problem of a table, on which bottles and then cups stand at the places numbered in `at`."""
    base = tabletop()
    bottle_names = tuple(f"bottle{i + 1}" for i in range(bottles))
    cup_names = tuple(f"cup{i + 1}" for i in range(cups))
    objects = bottle_names + cup_names
    locations = tuple(f"location{i + 1}" for i in range(places))
    hand_names = tuple(("left_hand", "right_hand")[:hands]) if hands <= 2 else tuple(f"hand{i}" for i in range(hands))
    carried = drinks or {bottle: f"beverage{i + 1}" for i, bottle in enumerate(bottle_names)}
    beverages = tuple(dict.fromkeys([*carried.values(), *pours.values(), *(filled or {}).values()]))
    classes = {
        "BEVERAGE": (*beverages, "no_beverage"),
        "Beverage": beverages,
        "Bottle": bottle_names,
        "Cup": cup_names,
        "HAND_POSITION": (*objects, *locations, "raised"),
        "HAND_TILT": ("tilted", "upright"),
        "HOLDS": (*objects, "nothing"),
        "Hand": hand_names,
        "LOCATION": (*locations, "in_hand"),
        "Location": locations,
        "Movable": objects,
        "Vessel": objects,
    }
    initial = {Symbol("LOCATION", (o,)): f"location{p}" for o, p in zip(objects, at, strict=True)}
    initial |= {Symbol("BEVERAGE", (b,)): carried[b] for b in bottle_names}
    initial |= {Symbol("BEVERAGE", (c,)): (filled or {}).get(c, "no_beverage") for c in cup_names}
    for hand in hand_names:
        initial[Symbol("HOLDS", (hand,))] = "nothing"
        initial[Symbol("HAND_POSITION", (hand,))] = "raised"
        initial[Symbol("HAND_TILT", (hand,))] = "upright"
    goal = {Symbol("LOCATION", (o,)): f"location{p}" for o, p in goals.items()}
    goal |= {Symbol("BEVERAGE", (c,)): d for c, d in pours.items()}
    can = frozenset((hand_names[h], f"location{p}") for h, ps in enumerate(reach) for p in ps)
    return replace(
        base, scene="generated", classes=classes, relations={"canReach": can}, initial=initial, goal=goal, parents={}
    )


def strips(places: int, columns: int, hands: int) -> list[set[int]]:
    """Return the places in reach of each hand, which are overlapping strips of columns."""
    width = (3 * columns + 3) // 4 if hands == 2 else max(2, -(-2 * columns // hands))
    found = []
    for hand in range(hands):
        first = round(hand * (columns - width) / max(hands - 1, 1))
        found.append({p for p in range(1, places + 1) if first <= (p - 1) % columns < first + width})
    return found


def family(name: str, n: int, seed: int = 0, hands: int = 2) -> Problem:
    """Return a problem of a family with n objects, half of them cups and half bottles."""
    rng = random.Random(f"{name} {n} {seed} {hands}")
    cups, bottles = n // 2, n - n // 2
    objects = [f"bottle{i + 1}" for i in range(bottles)] + [f"cup{i + 1}" for i in range(cups)]
    columns, places = n, 2 * n
    if name in ("full", "packed"):
        places = n + (name == "full")
        columns = (places + 1) // 2
    reach = strips(places, columns, hands)
    near = rng.sample(range(1, columns + 1), min(n, columns))
    at = near if len(near) == n else rng.sample(range(1, places + 1), n)
    goals: dict[str, int] = {}
    pours: dict[str, str] = {}
    if name == "served":
        far = rng.sample(range(columns + 1, places + 1), cups)
        goals = {f"cup{i + 1}": far[i] for i in range(cups)}
        goals |= {f"bottle{i + 1}": at[i] for i in range(bottles)}
        pours = {f"cup{i + 1}": f"beverage{i + 1}" for i in range(cups)}
    elif name == "swap":
        for i in range(0, n - 1, 2):
            goals[objects[i]], goals[objects[i + 1]] = at[i + 1], at[i]
    elif name == "rotate":
        goals = {objects[i]: at[(i + 1) % n] for i in range(n)}
    elif name in ("full", "packed"):
        aims = rng.sample(at, n)
        goals = {objects[i]: aims[i] for i in range(n)}
    elif name == "handover":
        only = [
            [p for p in range(columns + 1, places + 1) if p in reach[h] and p not in reach[-1 - h]] for h in (0, -1)
        ]
        ends = [[p for p in range(1, columns + 1) if p in reach[h] and p not in reach[-1 - h]] for h in (0, -1)]
        movers = min(len(only[0]), len(only[1]), cups // 2)
        spots = [p for p in range(1, columns + 1) if p not in ends[0][:movers] and p not in ends[1][:movers]]
        rng.shuffle(spots)
        at = [spots.pop() for _ in range(bottles)]
        for i in range(cups):
            side = i % 2
            if i // 2 < movers:
                at.append(ends[side][i // 2])
                goals[f"cup{i + 1}"] = only[1 - side][i // 2]
            else:
                at.append(spots.pop())
        goals |= {f"bottle{i + 1}": at[i] for i in range(bottles)}
        pours = {f"cup{i + 1}": f"beverage{i + 1}" for i in range(cups) if f"cup{i + 1}" in goals}
    elif name == "blocked":
        served = cups // 2
        goals = {f"cup{i + 1}": at[bottles + served + i] for i in range(served)}  # places of the other cups
        pours = {f"cup{i + 1}": f"beverage{i + 1}" for i in range(served)}
        goals |= {f"bottle{i + 1}": at[(i + 1) % bottles] for i in range(bottles)}
    return table(places, hands, cups, bottles, at, goals, pours, reach)


def random_table(seed: int) -> Problem:
    """Return a small random problem of a table; about a third of the problems are unsolvable."""
    rng = random.Random(f"random {seed}")
    places = rng.randint(3, 6)
    bottles, cups = rng.randint(0, 2), rng.randint(1, 2)
    hands = rng.choice((1, 2, 2, 2))
    count = min(bottles + cups, places)
    cups = count - bottles
    at = rng.sample(range(1, places + 1), count)
    reach = [set(rng.sample(range(1, places + 1), rng.randint(2, places))) for _ in range(hands)]
    drinks = {f"bottle{i + 1}": rng.choice(("beverage1", "beverage2")) for i in range(bottles)}
    names = [f"bottle{i + 1}" for i in range(bottles)] + [f"cup{i + 1}" for i in range(cups)]
    wanted = rng.sample(names, rng.randint(1, count))
    aims = rng.sample(range(1, places + 1), len(wanted))
    filled = {f"cup{i + 1}": rng.choice(("beverage1", "beverage2")) for i in range(cups) if rng.random() < 0.15}
    pours = {
        f"cup{i + 1}": rng.choice(sorted(set(drinks.values())) or ["beverage1"])
        for i in range(cups)
        if bottles and rng.random() < 0.6
    }
    return table(places, hands, cups, bottles, at, dict(zip(wanted, aims, strict=True)), pours, reach, drinks, filled)

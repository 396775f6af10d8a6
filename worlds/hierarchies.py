"""Random worlds of two or three levels in which a robot carries items between spots.

Each world has a random choice of features. Covers over spots may have to be shut again at the end. The robot has one or two
hands. The robot may drive on roads, need fuel, and have to return. A spot has room for one item, two items or any number. Items
may fit only some spots, and may have to be treated at a station before a move. A lamp may be turned off and on by one move. The
levels are the levels of the paper: actions on items, actions of hands, and motions of arms. The worlds are small enough for an
exhaustive search.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from math import prod
from random import Random

from confab.reasoner.problem import Problem
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    AnyOf,
    Behavior,
    ClassCondition,
    Condition,
    EqualityCondition,
    RelationCondition,
    SituationType,
    ValueEffect,
    Witness,
)
from worlds.writing import becomes, behavior, has, lacks, world

SMALL = 4_000
"""Maximum number of states, reachable or not, on the lowest level of a world."""


def hierarchy(seed: int) -> Problem:
    """Return a random world; equal seeds give equal worlds."""
    rng = Random(seed)
    while True:
        problem = _Draft(rng).problem()
        if states(problem) <= SMALL and any(problem.initial.get(s, FALSE) != v for s, v in problem.goal.items()):
            return problem


def states(problem: Problem) -> int:
    """Return the number of states, reachable or not; a hand's state is counted with as many values as there are hands."""
    held = len(problem.classes["Hand"])
    return prod(
        2 if problem.domain.situations[s.situation].boolean
        else held if s.situation == "HOLDS"
        else len(problem.classes[s.situation])
        for s in problem.initial
    )  # fmt: skip


class _Draft:
    """The randomly drawn features of a world."""

    def __init__(self, rng: Random) -> None:
        self.rng = rng
        self.levels = rng.choice((2, 3))
        self.items = tuple(f"item{i + 1}" for i in range(rng.choice((1, 2, 2, 3))))
        self.spots = tuple(f"spot{i + 1}" for i in range(rng.choice((2, 3, 3, 4))))
        self.hands = tuple(f"hand{i + 1}" for i in range(rng.choice((1, 1, 2))))
        self.covers = tuple(f"cover{i + 1}" for i in range(rng.choice((0, 1, 1, 2))))
        self.drives, self.room = self.chance(0.5), rng.choice((1, 1, 2, 9))
        self.fuel = rng.choice((0, 0, 2, 3)) if self.drives else 0
        self.fits, self.treats, self.lamp, self.shy = (
            self.chance(0.3),
            self.chance(0.5),
            self.chance(0.3),
            self.chance(0.3),
        )
        self.under = rng.choice(("open", "shut", ""))  # required state of the station's cover
        self.free_hand, self.sticky = self.chance(0.5), self.chance(0.15)
        self.no_return, self.stay = self.chance(0.1), self.chance(0.6)
        self.shuts = not self.chance(0.1)

    def chance(self, p: float) -> bool:
        return self.rng.random() < p

    def rows(self, *kinds: tuple[str, ...], p: float) -> list[tuple[str, ...]]:
        """Return a random static relation."""
        return [row for row in product(*kinds) if self.chance(p)]

    def problem(self) -> Problem:
        rng = self.rng
        covers: list[tuple[str, ...]] = [(cover, rng.choice(self.spots)) for cover in self.covers]
        roads: list[tuple[str, ...]] = [(a, b) for a, b in product(self.spots, repeat=2) if a != b and self.chance(0.9)]
        initial = {f"AT {item}": rng.choice(self.spots) for item in self.items}
        if self.room < 9:
            spots = [spot for spot in self.spots for _ in range(self.room)]
            rng.shuffle(spots)
            initial = {f"AT {item}": spots[i % len(spots)] for i, item in enumerate(self.items)}
        initial |= {f"HOLDS {hand}": "nothing" for hand in self.hands}
        initial |= {f"COVER {cover}": "open" if self.chance(0.2) else "shut" for cover in self.covers}
        initial |= {"ROBOT_AT robot": "spot1"} if self.drives else {}
        initial |= {"FUEL robot": f"fuel{self.fuel}"} if self.fuel else {}
        initial |= {f"DONE {item}": FALSE for item in self.items} if self.treats else {}
        initial |= {f"LIT {spot}": FALSE for spot in self.spots} if self.lamp else {}
        initial |= {f"ARM {hand}": "tucked" for hand in self.hands} if self.levels == 3 else {}
        goal = {f"AT {item}": rng.choice(self.spots) for item in self.items if self.chance(0.7)}
        goal |= {f"DONE {item}": TRUE for item in self.items if self.treats and self.chance(0.6)}
        goal |= {f"LIT {rng.choice(self.spots)}": TRUE} if self.lamp and self.chance(0.6) else {}
        goal |= {"ROBOT_AT robot": rng.choice(self.spots)} if self.drives and self.chance(0.1) else {}
        goal |= {f"COVER {cover}": "open" for cover in self.covers if self.chance(0.05)}
        classes = {
            "Item": self.items, "Spot": self.spots, "Hand": self.hands, "Cover": self.covers, "Robot": ("robot",),
            "Fragile": self.items[:1], "AT": (*self.spots, "held"), "HOLDS": (*self.items, "nothing"), "COVER": ("open", "shut"),
            "ROBOT_AT": self.spots, "FUEL": tuple(f"fuel{i}" for i in range(self.fuel + 1)),
            "ARM": (*self.spots, *self.covers, "tucked"),
        }  # fmt: skip
        relations: dict[str, list[tuple[str, ...]]] = {
            "covers": covers, "road": roads, "fits": self.rows(self.items, self.spots, p=0.85),
            "station": [(rng.choice(self.spots),)],
        }  # fmt: skip
        return world(self.situations(), self.behaviors(), classes, initial, goal, relations, {"held": 2})

    def situations(self) -> list[SituationType]:
        rest = None if self.no_return else "shut"
        found = [
            SituationType("AT", ("Item",), "AT"),
            SituationType("DONE", ("Item",), "Truth", boolean=True),
            SituationType("LIT", ("Spot",), "Truth", boolean=True),
            SituationType("HOLDS", ("Hand",), "HOLDS", level=2, rest=None if self.sticky else "nothing"),
            SituationType("COVER", ("Cover",), "COVER", level=2, rest=rest),
            SituationType("ROBOT_AT", ("Robot",), "ROBOT_AT", level=2, rest=None if self.stay else "spot1"),
            SituationType("FUEL", ("Robot",), "FUEL", level=2),
        ]
        return [*found, SituationType("ARM", ("Hand",), "ARM", level=3, rest="tucked")] if self.levels == 3 else found

    # ------------------------------------------------------------------------------------------------------ conditions

    def roomy(self, spot: str) -> list[Condition]:
        """Return the condition that a spot isn't full."""
        if self.room == 1:
            return [Witness("?o", "Item", (has("AT", "?o", spot),), negated=True)]
        if self.room == 2:
            second = Witness("?q", "Item", (has("AT", "?q", spot), EqualityCondition("?q", "?o", negated=True)))
            return [Witness("?o", "Item", (has("AT", "?o", spot), second), negated=True)]
        return []

    def uncovered(self, spot: str) -> Condition:
        inside = (RelationCondition("covers", ("?c", spot)), has("COVER", "?c", "shut"))
        return Witness("?c", "Cover", inside, negated=True)

    def at(self, spot: str) -> list[Condition]:
        """Return the condition that the robot is at a spot; no condition if the robot doesn't drive."""
        return [has("ROBOT_AT", "robot", spot)] if self.drives else []

    def beside(self, cover: str) -> list[Condition]:
        """Return the condition that the robot is at a cover's spot; no condition if the robot doesn't drive."""
        inside = (RelationCondition("covers", (cover, "?w")), has("ROBOT_AT", "robot", "?w"))
        return [Witness("?w", "Spot", inside)] if self.drives else []

    def may(self, item: str, spot: str) -> list[Condition]:
        """Return the condition that an item fits a spot, in worlds where items fit only some spots."""
        return [RelationCondition("fits", (item, spot))] if self.fits else []

    def unlit(self, a: str, b: str) -> list[ValueEffect]:
        """Return the effects of a move from `a` to `b` on lamps: on at `b` and off at `a`."""
        return [becomes("LIT", b, TRUE), becomes("LIT", a, FALSE)] if self.lamp else []

    def burnt(self) -> list[ValueEffect]:
        """Return the effects by which a drive uses one unit of fuel."""
        return [
            becomes("FUEL", "robot", f"fuel{i - 1}", when=(has("FUEL", "robot", f"fuel{i}"),))
            for i in range(1, self.fuel + 1)
        ]

    def fueled(self) -> list[Condition]:
        return [lacks("FUEL", "robot", "fuel0")] if self.fuel else []

    def some_hand(self) -> list[Condition]:
        return [Witness("?f", "Hand", (has("HOLDS", "?f", "nothing"),))] if self.free_hand else []

    # ------------------------------------------------------------------------------------------------------ behaviours

    def behaviors(self) -> list[Behavior]:
        made = [*self.first(), *self.second()]
        return [*made, *self.third()] if self.levels == 3 else made

    def first(self) -> list[Behavior]:
        shy = [AnyOf(((has("DONE", "?i", TRUE),), (ClassCondition("?i", "Fragile", negated=True),)))]
        apart = [] if self.lamp else [EqualityCondition("?a", "?b", negated=True)]
        room = (
            [] if self.lamp and self.room == 1 else self.roomy("?b")
        )  # a move from a spot to the same spot turns the lamp on as well
        move = behavior(
            "MOVE", 1, "?i:Item ?b:Spot",
            [has("AT", "?i", "?a"), *apart, *room, *self.may("?i", "?b"), *(shy if self.shy and self.treats else [])],
            [becomes("AT", "?i", "?b"), *self.unlit("?a", "?b")], "?a:Spot",
        )  # fmt: skip
        treat = behavior("TREAT", 1, "?i:Item", self.treatable(), self.treated(), "?a:Spot")
        return [move, treat] if self.treats else [move]

    def treatable(self) -> list[Condition]:
        return [has("AT", "?i", "?a"), RelationCondition("station", ("?a",)), has("DONE", "?i", FALSE)]

    def treated(self) -> list[ValueEffect]:
        alone = Witness(
            "?o", "Item", (has("AT", "?o", "?a"), EqualityCondition("?o", "?i", negated=True)), negated=True
        )
        lamp = [becomes("LIT", "?a", FALSE, when=(alone,))] if self.lamp else []
        return [becomes("DONE", "?i", TRUE), *lamp]

    def second(self) -> list[Behavior]:
        holds, put = has("HOLDS", "?h", "?i"), becomes("HOLDS", "?h", "nothing")
        covered = (RelationCondition("covers", ("?c", "?a")), has("COVER", "?c", "open"))
        station: dict[str, list[Condition]] = {
            "open": [self.uncovered("?a")],
            "shut": [Witness("?c", "Cover", covered, negated=True)],
        }
        self.station = [*self.at("?a"), *station.get(self.under, [])]
        lit = self.unlit("?a", "?b")
        found = [
            behavior("PICK", 2, "?h:Hand ?i:Item",
                     [has("HOLDS", "?h", "nothing"), has("AT", "?i", "?a"), *self.at("?a"), self.uncovered("?a")],
                     [becomes("HOLDS", "?h", "?i"), becomes("AT", "?i", "held"), *lit[1:]], "?a:Spot"),
            behavior("PLACE", 2, "?h:Hand ?b:Spot",
                     [holds, *self.at("?b"), self.uncovered("?b"), *self.roomy("?b"), *self.may("?i", "?b")],
                     [becomes("AT", "?i", "?b"), put, *lit[:1]], "?i:Item"),
            behavior("TREAT2", 2, "?i:Item", [*self.treatable(), *self.station], self.treated(), "?a:Spot"),
            behavior("OPEN", 2, "?c:Cover", [has("COVER", "?c", "shut"), *self.beside("?c"), *self.some_hand()],
                     [becomes("COVER", "?c", "open")]),
            behavior("SHUT", 2, "?c:Cover", [has("COVER", "?c", "open"), *self.beside("?c"), *self.some_hand()],
                     [becomes("COVER", "?c", "shut")]),
            behavior("GO", 2, "?b:Spot", [has("ROBOT_AT", "robot", "?a"), RelationCondition("road", ("?a", "?b")), *self.fueled()],
                     [becomes("ROBOT_AT", "robot", "?b"), *self.burnt()], "?a:Spot"),
        ]  # fmt: skip
        return [b for b in found if self.there_is(b.name)]

    def there_is(self, name: str) -> bool:
        """Return whether a world of these features has a behaviour of the given name."""
        needs: dict[str, Callable[[], bool]] = {
            "TREAT2": lambda: self.treats, "PRESS": lambda: self.treats, "OPEN": lambda: bool(self.covers),
            "LIFT": lambda: bool(self.covers), "SHUT": lambda: bool(self.covers) and self.shuts,
            "LOWER": lambda: bool(self.covers) and self.shuts, "GO": lambda: self.drives, "ROLL": lambda: self.drives,
        }  # fmt: skip
        return needs.get(name, lambda: True)()

    def third(self) -> list[Behavior]:
        tucked = has("ARM", "?h", "tucked")
        all_tucked = Witness("?f", "Hand", (lacks("ARM", "?f", "tucked"),), negated=True)
        lit = self.unlit("?a", "?b")
        found = [
            behavior("REACH", 3, "?h:Hand ?b:Spot", [tucked, *self.at("?b"), self.uncovered("?b")], [becomes("ARM", "?h", "?b")]),
            behavior("TOUCH", 3, "?h:Hand ?c:Cover", [tucked, *self.beside("?c")], [becomes("ARM", "?h", "?c")]),
            behavior("TUCK", 3, "?h:Hand", [lacks("ARM", "?h", "tucked")], [becomes("ARM", "?h", "tucked")]),
            behavior("GRASP", 3, "?h:Hand ?i:Item", [has("ARM", "?h", "?a"), has("AT", "?i", "?a"), has("HOLDS", "?h", "nothing")],
                     [becomes("HOLDS", "?h", "?i"), becomes("AT", "?i", "held"), *lit[1:]], "?a:Spot"),
            behavior("RELEASE", 3, "?h:Hand",
                     [has("ARM", "?h", "?b"), has("HOLDS", "?h", "?i"), *self.roomy("?b"), *self.may("?i", "?b")],
                     [becomes("AT", "?i", "?b"), becomes("HOLDS", "?h", "nothing"), *lit[:1]], "?b:Spot ?i:Item"),
            behavior("LIFT", 3, "?h:Hand ?c:Cover", [has("ARM", "?h", "?c"), has("COVER", "?c", "shut"), *self.some_hand()],
                     [becomes("COVER", "?c", "open")]),
            behavior("LOWER", 3, "?h:Hand ?c:Cover", [has("ARM", "?h", "?c"), has("COVER", "?c", "open"), *self.some_hand()],
                     [becomes("COVER", "?c", "shut")]),
            behavior("ROLL", 3, "?b:Spot",
                     [has("ROBOT_AT", "robot", "?a"), RelationCondition("road", ("?a", "?b")), *self.fueled(), all_tucked],
                     [becomes("ROBOT_AT", "robot", "?b"), *self.burnt()], "?a:Spot"),
            behavior("PRESS", 3, "?i:Item", [*self.treatable(), *self.station], self.treated(), "?a:Spot"),
        ]  # fmt: skip
        return [b for b in found if self.there_is(b.name)]

"""Discoveries of a live world: objects that no fact mentions, and new places (spots).

A *spot* is a new place for an object that stands at none of the scene's places, or a free place on the furniture at which an
object can be put down. A spot belongs to the classes that all places of the scene share. A spot has the static facts of the
place beside the spot. The reach facts of a spot are computed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pybullet

from confab.planner.acting.discovery import Discovery
from confab.planner.acting.symbolic_world import met, shared_kinds
from confab.reasoner.embodiment.values import PerceiverUse, Place
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import Fact, Symbol
from confab.sim.attempt import CLOSE
from confab.sim.bodies import outer_radius
from confab.sim.engine import NEAR_PLACE
from confab.sim.perception import tilt_of
from confab.sim.reach import reach
from confab.sim.urdf import Array
from confab.sim.whereabouts import LEVEL
from confab.sim.world import PhysicsWorld

REST = 0.05
"""Speed in metres per second below which an object is at rest."""

BESIDE = 0.3
"""Maximum distance in metres between a spot and the place whose static facts the spot shares."""

GRID = 0.08
"""Distance in metres between the points on furniture that are tested for free room."""

ROOMY = 0.1
"""Minimum distance in metres of a free spot from places, objects and edges."""

SPOTS, TRIED = 3, 12
"""Maximum number of free spots that are offered, and of points whose reach is computed."""

HEIGHTS = (0.06, 0.12, 0.18)
"""Heights in metres above a free spot that must be free of obstacles."""


@dataclass
class Lookout:
    """Discovers objects and spots in a world, and adds both to a problem. The relation `reaching` has the reach facts."""

    world: PhysicsWorld
    problem: Problem
    reaching: str = ""
    news: list[Discovery] = field(default_factory=list)

    def look(self) -> bool:
        """Discover new objects and spots; return whether any were found."""
        before = len(self.news)
        spoken_of = {symbol.arguments[0] for symbol in self.world.symbols}
        for name in [name for name in self.world.bodies if name not in spoken_of and self.world.knows(name)]:
            self._meet(name)
        for symbol in list(self.world.symbols):
            use = self.world.embodiment.perceivers[symbol.situation]
            if use.perceiver == "perceive_place" and self._astray(symbol, use):
                self._add_spot(symbol)
        return len(self.news) > before

    def why_unplaced(self, name: str) -> str:
        """Return why an object has no perceived place."""
        if name not in self.world.bodies or not self.world.knows(name):
            return ""
        rotation, base = self.world.sense(name)
        tilt = np.degrees(tilt_of(rotation))
        state = "stands" if tilt < 10 else f"leans by {tilt:.0f}°" if tilt < 60 else "lies"
        place, away = self.world.nearest_place(base)
        return f"{state} {away * 100:.0f} cm from {place}, from where no behaviour can take it"

    def free_spots(self) -> Sequence[Discovery]:
        """Return new spots on the furniture with free room around them, the spot with most room first."""
        found: list[Discovery] = []
        for point in list(self._roomy())[:TRIED]:
            spot = self._spot(point, "", None)
            if any(name == self.reaching for name, _ in spot.relations):
                found.append(self._adopted(replace(spot, text=f"there is room at {spot.individual}")))
                if len(found) == SPOTS:
                    break
        return found

    # ------------------------------------------------------------------------------------------------- things

    def _meet(self, name: str) -> None:
        """Discover an object.

        The object becomes a member of the class for which the situation type of places is declared. An object too wide for every
        hand counts as fixed.
        """
        world, problem = self.world, self.problem
        uses = world.embodiment.perceivers
        wheres = [s for s in problem.domain.situations.values() if s.name in uses]
        kinds = {s.arguments[0] for s in wheres if uses[s.name].perceiver == "perceive_place" and len(s.arguments) == 1}
        if not kinds:
            return
        width, widest = (
            2 * outer_radius(world.bodies[name].shape),
            max(2 * h.hand.opening for h in world.hands.values()),
        )
        wide = f"{width * 100:.0f} cm wide; hands open to {widest * 100:.0f} cm"
        text = f"{name}, which isn't in the scene, is {width * 100:.0f} cm wide"
        found = Discovery(name, tuple(sorted(kinds)), fixed=wide if width >= widest else "", text=text)
        for place in (place for place in world.embodiment.places if self._is_at(name, place)):
            symbols = (Symbol(s.name, (name,)) for s in wheres if uses[s.name].perceiver == "perceive_place")
            found = replace(found, blocked=self._covered(name, place), by=Fact(next(symbols), place))
        self.problem = met(problem, found)
        classes = self.problem.classes
        world.symbols = [
            *world.symbols,
            *(
                Symbol(s.name, (name,))
                for s in wheres
                if len(s.arguments) == 1 and name in classes.get(s.arguments[0], ()) and s.name in uses
            ),
        ]
        self.news.append(found)

    # ------------------------------------------------------------------------------------------------- spots

    def _astray(self, symbol: Symbol, use: PerceiverUse) -> bool:
        """Return whether an object stands at rest, held by no hand and away from all places."""
        world, name = self.world, symbol.arguments[0]
        if not world.knows(name) or name not in world.bodies:
            return False
        rotation, base = world.sense(name)
        if tilt_of(rotation) >= use.numbers["upright_angle"] or any(world.held(hand) == name for hand in world.hands):
            return False
        speed = np.linalg.norm(pybullet.getBaseVelocity(world.bodies[name].body, physicsClientId=world.client)[0])
        if speed > REST:
            return False
        height, near = use.numbers["contact_height"], use.numbers["nearness"]
        gaps = [base - world.place(place) for place in world.embodiment.places]
        return not any(abs(gap[2]) < height and np.hypot(*gap[:2]) < near for gap in gaps)

    def _is_at(self, name: str, place: str) -> bool:
        """Return whether an object stands at a place."""
        gap = self.world.sense(name)[1] - self.world.place(place)
        return bool(abs(gap[2]) < LEVEL and np.hypot(*gap[:2]) < NEAR_PLACE)

    def _covered(self, name: str, own: str) -> tuple[str, ...]:
        """Return the places, except `own`, to which a thing is so near that no other object fits there."""
        world = self.world
        base, radius = world.sense(name)[1], outer_radius(world.bodies[name].shape)
        least = (
            min(outer_radius(thing.shape) for other, thing in world.bodies.items() if other != name)
            if len(world.bodies) > 1
            else 0.0
        )
        near = {place: base - world.place(place) for place in world.embodiment.places if place != own}
        return tuple(
            place for place, gap in near.items() if abs(gap[2]) < LEVEL and np.hypot(*gap[:2]) < radius + least + CLOSE
        )

    def _add_spot(self, symbol: Symbol) -> None:
        """Discover the spot at which an object stands."""
        world, name = self.world, symbol.arguments[0]
        base = world.sense(name)[1]
        carrier, away = self._support(name), world.nearest_place(base)
        spot = self._spot(base, carrier, world.bodies[name].shape.grasp_height)
        hands = [row[0] for relation, row in spot.relations if relation == self.reaching]
        text = f"{name} stands {away[1] * 100:.0f} cm from {away[0]}: {spot.individual}"
        if self.reaching:
            text += f", reached by {' and '.join(hands) or 'no hand'}"
        blocked = self._covered(name, spot.individual)
        if blocked:
            text += f"; there is no room at {' and '.join(blocked)}"
        by = Fact(symbol, spot.individual)
        self.news.append(self._adopted(replace(spot, text=text, blocked=blocked, by=by)))

    def _adopted(self, spot: Discovery) -> Discovery:
        self.problem = met(self.problem, spot)
        return spot

    def _support(self, name: str) -> str:
        """Return the link or body on which an object stands; an empty string if the object stands on fixed furniture."""
        world = self.world
        below = (c for c in world.contacts(world.bodies[name].body) if c[7][2] > 0.5)
        carriers = (world.name_of(contact[2], contact[4]) for contact in below)
        return next((one for one in carriers if one in world.links or one in world.bodies), "")

    def _spot(self, point: Array, carrier: str, height: float | None) -> Discovery:
        """Add a place to the world at a point, in the frame of its carrier, and return the place as a discovery."""
        world, embodiment, problem = self.world, self.world.embodiment, self.problem
        number = 1 + sum(name.startswith("spot") for name in embodiment.places)
        while f"spot{number}" in problem.individuals or f"spot{number}" in embodiment.places:
            number += 1
        name = f"spot{number}"
        fixed = [place for place in embodiment.places if place in problem.individuals and not place.startswith("spot")]
        beside = self._beside(point, carrier, fixed)
        turned, origin = world.carrier(carrier)
        x, y, z = turned.T @ (point - origin)
        neighbour = embodiment.places[beside] if beside else Place("", (0.0, 0.0, 0.0))
        stand, height = neighbour.stand, neighbour.height or height
        place = Place(name, (float(x), float(y), float(z)), carrier, stand, neighbour.height)
        world.embodiment = replace(embodiment, places={**embodiment.places, name: place})
        shared = [
            (relation, tuple(name if one == beside else one for one in row))
            for relation, rows in sorted(problem.relations.items())
            for row in sorted(rows)
            if beside and beside in row and relation != self.reaching
        ]
        reached = (
            [(self.reaching, (hand, name)) for hand in self._reaching(point, height, stand)] if self.reaching else []
        )
        return Discovery(name, shared_kinds(problem, fixed), (*shared, *reached))

    def _beside(self, point: Array, carrier: str, places: Sequence[str]) -> str:
        """Return the nearest place beside a point, at the same height and on the same carrier; an empty string if there is none."""
        world = self.world
        gaps = {
            name: float(np.hypot(*(world.place(name) - point)[:2]))
            for name in places
            if world.embodiment.places[name].carrier == carrier and abs(world.place(name)[2] - point[2]) < 0.02
        }
        best = min(gaps, key=gaps.__getitem__, default="")
        return best if best and gaps[best] < BESIDE else ""

    def _reaching(self, point: Array, height: float | None, stand: str) -> list[str]:
        """Return the hands that reach a point of the world."""
        x, y, z = point.tolist()
        place = Place("here", (x, y, z), "", stand, height)
        try:
            return sorted(hand for hand, _ in reach(replace(self.world.embodiment, places={"here": place})).pairs)
        except ValueError:  # the scene has no skill with a reach
            return []

    def _roomy(self) -> Iterator[Array]:
        """Yield points, far from all objects, on the furniture that bears places; points with most room come first."""
        world = self.world
        places = [world.place(name) for name in world.embodiment.places]
        bodies = [
            (world.sense(name)[1], outer_radius(world.bodies[name].shape)) for name in world.bodies if world.knows(name)
        ]
        solids = [solid for hand in list(world.hands)[:1] for solid in world.surroundings(hand).solids]
        free: list[tuple[float, Array]] = []
        for fixture in world.embodiment.fixtures:
            top = fixture.position[2] + fixture.size[2] / 2
            if fixture.yaw or not any(abs(place[2] - top) < 0.01 for place in places):
                continue
            sides = [
                np.arange(c - s / 2 + ROOMY, c + s / 2 - ROOMY + 1e-9, GRID)
                for c, s in zip(fixture.position[:2], fixture.size[:2], strict=True)
            ]
            around = [solid for solid in solids if solid.name not in (fixture.name, *world.bodies)]
            for x, y in ((x, y) for x in sides[0] for y in sides[1]):
                point = np.array([x, y, top])
                room = [float(np.hypot(*(place - point)[:2])) for place in places]
                room += [float(np.hypot(*(base - point)[:2])) - radius for base, radius in bodies]
                column = point + np.array([[0.0, 0.0, height] for height in HEIGHTS])
                room += [float(solid.distance(column).min()) for solid in around]
                if min(room, default=1.0) >= ROOMY:
                    free.append((min(room), point))
        return (point for _, point in sorted(free, key=lambda pair: (-round(pair[0], 3), *pair[1].tolist())))

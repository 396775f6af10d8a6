"""Perceived facts compared with the truth in random scenes at several levels of noise: wrong and missing facts.

    python -m benchmarks.perception [SCENES]

In each scene, objects stand at random places with perturbations. Some objects stand away from all places or lie, and some
vessels are filled. Then a hand grasps an object and lifts it. After each of these steps, the scene is perceived repeatedly at
every level of noise. The true facts follow from the setup and the actions, not from perception without noise.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

import confab
from confab.reasoner.embodiment.values import Embodiment, SkillUse
from confab.reasoner.symbols import Symbol
from confab.sim.bodies import outer_radius
from confab.sim.faults import displaced, lying
from confab.sim.skills import perform
from confab.sim.staging import Perturbation
from confab.sim.verdict import SkillError
from confab.sim.world import PhysicsWorld

NOISE = (0.0, 0.002, 0.005, 0.01, 0.02)
"""Standard deviations of perceived positions in metres."""

LOOKS = 4
"""Number of observations of the whole scene after each step, at each level of noise."""

AT_REST = {"perceive_held": "nothing", "perceive_hand_position": "raised", "perceive_hand_tilt": "upright"}
"""The value that each perceiver of hands has for a hand at rest."""

Truth = dict[Symbol, str | None]


@dataclass
class Tally:
    """Counts by situation type and level of noise.

    `looks` counts observations of a symbol, `wrong` counts observed values that aren't true, and `missed` counts true
    values that were not observed. A false value in place of a true value counts as wrong and as missed.
    """

    looks: Counter[tuple[str, float]] = field(default_factory=Counter)
    wrong: Counter[tuple[str, float]] = field(default_factory=Counter)
    missed: Counter[tuple[str, float]] = field(default_factory=Counter)

    def add(self, world: PhysicsWorld, truth: Truth) -> None:
        """Observe the scene at every level of noise, and count the values."""
        for noise in NOISE:
            world.noise = noise
            for _ in range(LOOKS):
                world.look()
                seen = world.observe()
                for symbol, value in truth.items():
                    key = symbol.situation, noise
                    self.looks[key] += 1
                    self.wrong[key] += seen.get(symbol) not in (None, value)
                    self.missed[key] += value is not None and seen.get(symbol) != value
        world.noise = 0.0

    def lines(self) -> Iterator[str]:
        """Yield the lines of the table in Markdown."""
        yield "| situation type | looks | " + " | ".join(f"{1000 * noise:g} mm" for noise in NOISE) + " |"
        yield "|---" * (2 + len(NOISE)) + "|"
        for situation in dict.fromkeys(situation for situation, _ in self.looks):
            counts = [f"{self.wrong[situation, noise]} / {self.missed[situation, noise]}" for noise in NOISE]
            yield f"| {situation} | {self.looks[situation, NOISE[0]]} | " + " | ".join(counts) + " |"


def look_at(embodiment: Embodiment, symbols: Sequence[Symbol], seed: int, tally: Tally) -> bool:
    """Set up a scene, and observe the scene before and after a hand grasps an object; return whether an object was grasped."""
    rng = np.random.default_rng(seed)
    truth = _drawn(embodiment, symbols, rng)
    initial = {symbol: value for symbol, value in truth.items() if value is not None}
    with PhysicsWorld(embodiment, initial, seed, Perturbation()) as world:
        _disturb(world, truth, rng)
        tally.add(world, truth)
        uses = {use.skill: use for use in embodiment.skills.values()}
        hand, name = _taken(world, truth, rng, uses["reach"])
        if not name:
            return False
        _set(embodiment, truth, "perceive_hand_position", hand, name)
        tally.add(world, truth)
        for step, roles in (("grasp", {"hand": hand, "object": name}), ("lift", {"hand": hand, "object": name})):
            perform(world, uses[step], roles)
            if step == "grasp":
                _set(embodiment, truth, "perceive_held", hand, name)
            else:
                _set(embodiment, truth, "perceive_place", name, "in_hand")
                _set(embodiment, truth, "perceive_hand_position", hand, "raised")
            tally.add(world, truth)
    return True


def _drawn(embodiment: Embodiment, symbols: Sequence[Symbol], rng: np.random.Generator) -> Truth:
    """Return facts in which objects are at random places, vessels have random contents, and hands are at rest."""
    places = iter(rng.permutation(list(embodiment.places)).tolist())
    truth: Truth = {}
    for symbol in symbols:
        use = embodiment.perceivers[symbol.situation]
        if use.perceiver == "perceive_place":
            truth[symbol] = next(places)
        elif use.perceiver == "perceive_content":
            contents = [*embodiment.fillings, use.values["empty"]]
            truth[symbol] = contents[rng.integers(len(contents))]
        else:
            truth[symbol] = use.values[AT_REST[use.perceiver]]
    return truth


def _disturb(world: PhysicsWorld, truth: Truth, rng: np.random.Generator) -> None:
    """Shift one in five empty objects away from all places, and lay one in five on their side, so that both are at no place."""
    uses = world.embodiment.perceivers
    for symbol in [s for s in truth if uses[s.situation].perceiver == "perceive_place"]:
        name, draw = symbol.arguments[0], rng.random()
        contents = [s for s in truth if uses[s.situation].perceiver == "perceive_content" and s.arguments == (name,)]
        if draw >= 0.4 or any(truth[s] != uses[s.situation].values["empty"] for s in contents):
            continue
        if draw < 0.2:
            turn = rng.uniform(0, 2 * np.pi)
            by = (0.08 * float(np.cos(turn)), 0.08 * float(np.sin(turn)))
            if not _free(world, name, world.truth(name)[1][:2] + by):
                continue
            displaced(name, by)(world)
        else:
            lying(name)(world)
        truth[symbol] = None
    world.run(60)


def _free(world: PhysicsWorld, name: str, spot: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> bool:
    """Return whether an object has room at a position (x and y in metres) that is on the table and away from all places."""
    gaps = [np.hypot(*(world.truth(other)[1][:2] - spot)) for other in world.bodies if other != name]
    away = world.nearest_place(np.array([*spot, 0.0]))[1]
    places = np.array([place.position[:2] for place in world.embodiment.places.values()])
    inside = bool(np.all(spot > places.min(0) - 0.085) and np.all(spot < places.max(0) + 0.085))
    return inside and away > 0.065 and min(gaps) > 2.2 * outer_radius(world.bodies[name].shape)


def _taken(world: PhysicsWorld, truth: Truth, rng: np.random.Generator, reach: SkillUse) -> tuple[str, str]:
    """Let a random hand reach for a random object at a place; return both names, or empty names if no hand reaches an object."""
    uses = world.embodiment.perceivers
    standing = [
        s.arguments[0] for s, v in truth.items() if uses[s.situation].perceiver == "perceive_place" and v is not None
    ]
    pairs = [(hand, name) for hand in world.hands for name in standing]
    for i in rng.permutation(len(pairs)):
        hand, name = pairs[i]
        try:
            perform(world, reach, {"hand": hand, "target": name})
        except SkillError:
            if not np.allclose(world.hands[hand].posture, world.hands[hand].hand.home):
                return "", ""  # the hand has left its rest posture, and its position has no name
            continue
        return hand, name
    return "", ""


def _set(embodiment: Embodiment, truth: Truth, kind: str, subject: str, value: str) -> None:
    """Set the true values of an individual for the situation types of a perceiver."""
    for symbol in truth:
        use = embodiment.perceivers[symbol.situation]
        if use.perceiver == kind and symbol.arguments == (subject,):
            truth[symbol] = use.values.get(value, value)


def perception(scenes: int = 30, tell: Callable[[str], None] = print) -> Tally:
    """Print the table for random scenes with development seeds from 5100."""
    scene = confab.load("beverage-serving")
    symbols = [s for s in scene.problem.initial if s.situation in scene.embodiment.perceivers]
    tally, took = Tally(), 0
    for seed in range(5100, 5100 + scenes):
        took += look_at(scene.embodiment, symbols, seed, tally)
    tell(f"{scenes} random scenes, in {took} a hand took something; wrong / missed by noise:")
    for line in tally.lines():
        tell(line)
    return tally


if __name__ == "__main__":
    perception(int(sys.argv[1]) if len(sys.argv) > 1 else 30)

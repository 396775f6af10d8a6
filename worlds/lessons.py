"""Generated scenes as problems, and experience gathered on small scenes."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

from confab.planner.experience.advice import Advisor
from confab.planner.experience.lessons import teach
from confab.reasoner.generate import generate
from confab.reasoner.graph.knowledge import load
from confab.reasoner.memory.experience import Experience, LearnedRule
from confab.reasoner.problem import Problem
from confab.reasoner.reading.problem import Reading, read
from confab.reasoner.reading.relevance import recognise
from confab.reasoner.symbols import ValueCondition


def as_it_is(text: str) -> str:
    """Return the text unchanged."""
    return text


def reading_of(text: str) -> Reading:
    """Return a scene in Turtle as a `Reading`."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.ttl"
        path.write_text(text)
        return read(load(path))


@lru_cache(maxsize=64)
def problem(
    family: str, objects: int, seed: int = 0, clutter: int = 0, edit: Callable[[str], str] = as_it_is, hands: int = 2
) -> Problem:
    """Return the problem of a generated scene whose Turtle text the function `edit` may change."""
    return reading_of(edit(generate(family, objects, hands, clutter, seed))).problem


@lru_cache(maxsize=64)
def recognised(family: str, objects: int, seed: int = 0, clutter: int = 0) -> Problem:
    """Return the problem of a generated scene without the parts that are irrelevant to its task, as ``confab plan`` reads it."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.ttl"
        path.write_text(generate(family, objects, clutter=clutter, seed=seed))
        return recognise(load(path)).problem


def single_level(problem: Problem, level: int) -> Problem:
    """Return a problem without the levels above `level`."""
    behaviors = {name: b for name, b in problem.domain.behaviors.items() if b.level >= level}
    return replace(problem, domain=replace(problem.domain, behaviors=behaviors))


def backwards(rule: LearnedRule) -> LearnedRule:
    """Return a wrong rule, with the goal and the opposite condition exchanged or, if impossible, with half of the conditions."""
    for c in rule.asks:
        same = isinstance(c, ValueCondition) and (c.situation, c.arguments) == (
            rule.goal.situation,
            rule.goal.arguments,
        )
        if isinstance(c, ValueCondition) and same and not c.negated:
            return replace(rule, goal=c, asks=(*(other for other in rule.asks if other != c), rule.goal))
    return replace(rule, asks=rule.asks[::2])


@lru_cache(maxsize=8)
def taught(families: Sequence[str] = ("served", "swap"), level: int = 1, seeds: Sequence[int] = (100,)) -> Advisor:
    """Return a memory that has learned from scenes of 4 and 6 objects."""
    experience = Experience("taught")
    for family in families:
        for objects in (4, 6):
            for seed in seeds:
                teach(experience, single_level(problem(family, objects, seed), level))
    return Advisor(experience)

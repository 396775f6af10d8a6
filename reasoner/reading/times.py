"""The times that a scene states beside the deadlines of goals: time windows of individuals, and behaviours at fixed times."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace
from fractions import Fraction

from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.names import local_name
from confab.reasoner.problem import Problem
from confab.reasoner.reading.parts import Parts
from confab.reasoner.reading.rows import OntologySchema
from confab.reasoner.symbols import Times


def with_times(problem: Problem, parts: Parts, schema: OntologySchema) -> Problem:
    """Return a problem with the time windows and the fixed times that its scene states, or the problem itself without them.

    Raises
    ------
    KnowledgeError
        A time window is empty, or a behaviour at a fixed time has parameters.
    """
    known, windows, events = problem.times or Times(), windows_of(problem, parts, schema), happenings(parts, schema)
    return replace(problem, times=replace(known, windows=windows, events=events)) if windows or events else problem


def windows_of(
    problem: Problem, parts: Parts, schema: OntologySchema
) -> dict[str, tuple[tuple[Fraction, Fraction | None], ...]]:
    """Return the time windows, in seconds, in which individuals are available."""
    found: dict[str, list[tuple[Fraction, Fraction | None]]] = defaultdict(list)
    for iri in schema.of_kind("Window"):
        individual = parts.names.short(parts.one(iri, "ofIndividual"))
        if individual not in problem.individuals:
            continue  # the individual isn't in the task's part of the scene
        low, high = parts.seconds(iri, "availableFrom") or Fraction(0), parts.seconds(iri, "availableUntil")
        if high is not None and high <= low:
            raise KnowledgeError(f"<{iri}>: the window of {individual} ends at {high} s and begins at {low} s")
        found[individual].append((low, high))
    return {one: tuple(sorted(its, key=lambda window: window[0])) for one, its in sorted(found.items())}


def happenings(parts: Parts, schema: OntologySchema) -> dict[str, Fraction]:
    """Return the time in seconds of each behaviour that happens at a fixed time."""
    found = {}
    for iri in schema.of_kind("Behavior"):
        at = parts.seconds(iri, "happensAt")
        if at is None:
            continue
        if parts.values(iri, "parameter"):
            raise KnowledgeError(f"{local_name(iri)} happens at a time (c:happensAt), so it can't have parameters")
        found[parts.names.short(iri)] = at
    return found

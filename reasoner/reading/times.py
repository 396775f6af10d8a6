"""The times that a scene states: deadlines of goals, time windows of individuals, and behaviours at fixed times."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace
from fractions import Fraction

from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.names import local_name
from confab.reasoner.reading.parts import Parts
from confab.reasoner.reading.rows import OntologySchema
from confab.reasoner.symbols import Problem, Symbol, Times, ValueCondition


def with_times(problem: Problem, parts: Parts, schema: OntologySchema) -> Problem:
    """Return a problem with the times that its scene states; return the problem itself if the scene states no times.

    Raises
    ------
    KnowledgeError
        A goal with a deadline isn't a fact that behaviours can change, or a time window is empty.
    """
    times = Times(deadlines(problem, parts, schema), windows(problem, parts, schema), {}, happenings(parts, schema))
    return replace(problem, times=times) if times != Times() else problem


def deadlines(problem: Problem, parts: Parts, schema: OntologySchema) -> dict[Symbol, Fraction]:
    """Return the deadline in seconds of each goal that has a deadline."""
    found: dict[Symbol, Fraction] = {}
    for task in schema.of_kind("Task"):
        for iri in parts.values(task, "goal"):
            by = parts.seconds(iri, "by")
            if by is None:
                continue
            wanted = parts.condition(iri)
            if not isinstance(wanted, ValueCondition) or wanted.situation in problem.domain.rules:
                raise KnowledgeError(
                    f"<{iri}> has a deadline (:by), which only the value of one symbol can have that behaviours change; "
                    "name an individual and a situation type without rules"
                )
            symbol = Symbol(wanted.situation, wanted.arguments)
            if symbol in problem.goal:
                found[symbol] = min(by, found.get(symbol, by))
    return found


def windows(
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

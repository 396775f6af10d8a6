"""Rules on the initial situation and on the goal: states that physics doesn't allow."""

from __future__ import annotations

from collections.abc import Iterator

from confab.reasoner.possible import against_physics
from confab.reasoner.validation.case import Case, Fault


def impossible_situations(case: Case) -> Iterator[Fault]:
    """Find impossible initial situations, and goals that can't hold together."""
    if case.reading is None:
        return
    problem, names = case.reading.problem, case.reading.names
    found = set()
    for fault in against_physics(problem, problem.initial):
        found.add(fault.what)
        yield names.iri(fault.symbol.arguments[0]), fault.what, fault.why, fault.remedy
    levels = problem.domain.levels
    for fault in against_physics(problem, problem.goal_on(levels[-1]) if levels else problem.goal):
        if fault.what not in found:
            yield (
                names.iri(fault.symbol.arguments[0]),
                f"the goals can't hold together: {fault.what}",
                fault.why,
                "want another value of one of them",
            )

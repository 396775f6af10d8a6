"""Validation of a plan in the whole scene, after the plan was made in a part of the scene."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

from confab.planner.checked_conditions import Lookups
from confab.planner.plan import Plan
from confab.planner.validation import Fault, carried_out
from confab.reasoner.graph.knowledge import KnowledgeGraph
from confab.reasoner.limits import overtime
from confab.reasoner.reading.goals import parse_fact
from confab.reasoner.reading.problem import Reading
from confab.reasoner.reading.surroundings import Surroundings
from confab.reasoner.symbols import Symbol


def refused(
    graph: KnowledgeGraph, slice_: Reading, plan: Plan, goals: Sequence[str] = (), unmet: Collection[Symbol] = ()
) -> list[Fault]:
    """Return the faults that a plan has in the whole scene, after it was made in a part of the scene. A valid plan has no faults.

    The checker first executes the plan with the individuals of the part. If conditions or effects depend on other individuals,
    these individuals are read from the graph, and the check is repeated. The check doesn't use the code that selects the part of
    a scene.

    Parameters
    ----------
    graph : KnowledgeGraph
    slice_ : Reading
        The scene in which the plan was made.
    plan : Plan
    goals : sequence of str
        Goals that replace goals of the task.
    unmet : collection of Symbol
        The soft goals that the plan may leave unmet.
    """
    given = dict(parse_fact(slice_.problem, goal) for goal in goals)
    with overtime():
        around = Surroundings(graph, slice_)
        while True:
            if not around.agree:
                return [Fault((), "another individual has a name that the plan uses")]
            lookups: Lookups = {}
            problem = around.problem()
            problem = replace(problem, goal={**problem.goal, **given}).only(unmet)
            faults = carried_out(problem, plan, lookups, around.lifted)
            if not around.widen(lookups):
                return faults

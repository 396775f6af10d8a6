"""The explanation of a failed planning call: the current goal, the step without a refinement, and insufficient amounts."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction

from confab.planner.hierarchical.call import Call
from confab.planner.hierarchical.relevance import Asked, relevant_achievers
from confab.planner.plan import Limits, Reason
from confab.planner.transitions import Cell, arguments_of
from confab.reasoner.amounts import Quantity, meets, possible_bounds
from confab.reasoner.limits import LimitError
from confab.reasoner.problem import Domain
from confab.reasoner.symbols import Fact, Symbol

QUESTIONS, LOOKED, AMOUNTS = 160, 100_000, 3
"""Maximum number of examined values, maximum number of examined achievers, and maximum number of reported amounts."""


def gave_up(call: Call, why: str) -> Reason:
    """Return the reason `why` planning gave up, with the number of reached goals, the current goal and the current step."""
    parts, terms = [why], dict[str, None]()
    if call.aim:
        goals = [str(Fact(Symbol(cell[0], arguments_of(cell[1])), value)) for cell, value in call.aim.items()]
        for cell, value in call.aim.items():
            terms.update(dict.fromkeys((cell[0], *arguments_of(cell[1]), value)))
        parts.append(
            f"{len(call.achieved)} of {len(call.goal)} goals were reached, {goals[0]}{', …' * (len(goals) > 1)} was next"
        )
    if call.refiner.unrefined is not None:
        name, arguments = call.refiner.unrefined
        parts.append(f"{' '.join((name, *arguments))} wasn't refined there")
        terms.update(dict.fromkeys((name, *arguments)))
    parts += missing_amounts(call)
    return Reason("; ".join(parts), tuple(terms))


def missing_amounts(call: Call) -> Iterator[str]:
    """Yield the requirements on amounts that the final state doesn't meet.

    The requirements come from the behaviours that could achieve the first goal of the latest attempt.
    """
    space, situations = call.space, call.problem.domain.situations
    if all(situation.quantity is None for situation in situations.values()):
        return
    space.deadline, space.most_looked = (
        Limits().end(),
        space.looked + LOOKED,
    )  # the search may have reached the previous limits
    call.replace_steps(call.steps)
    told: dict[Cell, str] = {}
    for (cell, value), level in [(goal, level) for goal in list(call.aim.items())[:1] for level in call.program.levels]:
        asked: Asked = set()
        with suppress(LimitError):
            for _ in relevant_achievers(space, level, cell, value, QUESTIONS, asked=asked):
                pass
        told.update(
            {
                (name, key): wanted
                for name, key, wanted in sorted(asked, key=str)
                if situations[name].quantity is not None and not meets(call.table.now[name].get(key), wanted)
            }
        )
    found = [(cell, possible_bounds(wanted, _quantity(call.problem.domain, cell[0]))) for cell, wanted in told.items()]
    for (name, key), wanted in sorted(found, key=lambda one: not one[1])[:AMOUNTS]:
        there = " ".join(filter(None, (call.table.now[name].get(key, ""), _quantity(call.problem.domain, name).unit)))
        needed = f"{wanted} wanted" if wanted else "no possible amount suffices"
        yield f"{name} of {', '.join(arguments_of(key))}: {there} there, {needed}"


def _quantity(domain: Domain, name: str) -> Quantity:
    """Return the properties of the amounts of a situation type; a count is a whole number from 0 on."""
    quantity = domain.situations[name].quantity
    assert quantity is not None
    aggregate = domain.aggregates.get(name)
    counts = aggregate is not None and aggregate.function == "count"
    return replace(quantity, whole=True, least=max(quantity.least or Fraction(0), Fraction(0))) if counts else quantity

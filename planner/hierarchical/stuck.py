"""The explanation of a failed planning call: the current goal, the step without a refinement, and insufficient amounts."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

from confab.planner.hierarchical.call import Call
from confab.planner.hierarchical.relevance import Asked, relevant_achievers
from confab.planner.plan import Limits, Reason
from confab.planner.transitions import Cell, arguments_of
from confab.reasoner.amounts import bounds_written, meets
from confab.reasoner.limits import LimitError
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
            f"{len(call.kept)} of {len(call.goal)} goals were reached, {goals[0]}{', …' * (len(goals) > 1)} was next"
        )
    if call.refiner.at is not None:
        name, arguments = call.refiner.at
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
    for (name, key), wanted in list(told.items())[:AMOUNTS]:
        unit = situations[name].quantity.unit  # type: ignore[union-attr]
        there = " ".join(filter(None, (call.table.now[name].get(key, ""), unit)))
        yield f"{name} of {', '.join(arguments_of(key))}: {there} there, {bounds_written(wanted)} wanted"

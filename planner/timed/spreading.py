"""Spreading of turns over values: objects that the plan puts down at one place, one after another, are put down at several places.

A value that is looked up, such as a place, has turns (`confab.planner.timed.order`). Another value takes a turn if the static
conditions allow it, if no symbol has it at first or in the goal, and if it is free between the first and the last step of the turn
in the sequence. The plan checker judges the result.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping

from confab.planner.plan import Plan
from confab.planner.timed.activities import InapplicableError, activities, in_sequence
from confab.planner.timed.exchange import exchanged, possible
from confab.planner.timed.order import order_of
from confab.planner.validation import BehaviorReader, LoggedState, validate
from confab.reasoner.symbols import Problem


def spread(problem: Problem, plan: Plan) -> Plan:
    """Return a plan with the same behaviours, in which the turns at looked-up values are spread over equal values.

    Return the given plan if the checker doesn't accept the result.
    """
    steps = plan.primitives
    try:
        order = order_of(problem, activities(problem, steps, in_sequence(steps)), in_sequence(steps))
    except InapplicableError:
        return plan
    rules, facts = BehaviorReader(problem), LoggedState(problem, problem.initial)
    every = {step.path: step for step in plan.walk()}
    above = [[every[step.path[:depth]] for depth in range(1, len(step.path) + 1)] for step in steps]
    naming: dict[str, list[int]] = defaultdict(list)
    for number, step in enumerate(steps):
        for one in dict.fromkeys((*step.arguments, *step.bindings.values())):
            naming[one].append(number)
    used = {value for state in (problem.initial, problem.goal) for value in state.values()}
    used |= {one for symbol in (*problem.initial, *problem.goal) for one in symbol.arguments}
    kinds = {one: {kind for kind, its in problem.classes.items() if one in its} for one in naming}
    looked = {one.value: one.turns for one in order.resources if one.value is not None and one.value in naming}
    spans: dict[str, list[tuple[int, int, list[int]]]] = defaultdict(list)
    for value, turns in looked.items():
        last = -1
        for turn in (one for one in turns if not one.reading):
            end = max(turn.members)
            its = [number for number in naming[value] if last < number <= end]
            spans[value].append((min([*turn.members, *its]), end, its))
            last = end
    taken = {value: [(first, end) for first, end, _ in its] for value, its in spans.items()}
    renamed: dict[int, Mapping[str, str]] = {}
    for value, turns_of_value in spans.items():
        free = [
            other
            for other in dict.fromkeys(one for kind in sorted(kinds[value]) for one in problem.classes[kind])
            if other not in used
            and (other in looked or other not in naming)
            and all(other in problem.classes[kind] for kind in kinds[value])
        ]
        for first, end, its in turns_of_value:
            taken[value].remove((first, end))
            upper = {step.path: step for number in its for step in above[number]}
            able = [
                other
                for other in sorted(free, key=lambda one: len(taken.setdefault(one, [])))
                if all(after < first or end < before for before, after in taken[other])
                and all(possible(problem, rules, facts, step, {value: other}) for step in upper.values())
            ]
            chosen = able[0] if able else value
            taken[chosen].append((first, end))
            if chosen != value:
                renamed |= {number: {**renamed.get(number, {}), value: chosen} for number in its}
    new = exchanged(problem, plan, renamed) if renamed else plan
    return plan if validate(problem, new) else new

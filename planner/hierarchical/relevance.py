"""Relevant behaviours: achievers of a required value, achievers of their unmet conditions, and so on backwards.

A chain is a sequence of achievers from an applicable behaviour to the required value. The length of a chain is a lower bound on the
number of steps, because each unmet condition is considered separately.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import TypeAlias

from confab.planner.hierarchical.condition_tests import Env
from confab.planner.hierarchical.operators import Achiever
from confab.planner.hierarchical.subgoals import Subgoal
from confab.planner.hierarchical.workspace import Ground, Workspace
from confab.planner.transitions import Cell, Key, arguments_of
from confab.reasoner.symbols import TRUE

Asked: TypeAlias = "set[tuple[str, Key, str]]"
"""The examined subgoals, each as a situation type, a key and a value."""
QUESTIONS = 1000
"""Maximum number of values that are examined on the chains towards one required value."""


def relevant(space: Workspace, level: int, off: Mapping[Cell, str], depth: int) -> Iterator[Ground]:
    """Yield the distinct applicable behaviours of a level that start a chain of at most `depth` steps to a value in `off`."""
    given: set[Ground] = set()
    for cell, value in off.items():
        for length, ground in relevant_achievers(space, level, cell, value):
            if length > depth:
                break
            if ground is not None and ground not in given:
                given.add(ground)
                yield ground


def relevant_achievers(
    space: Workspace,
    level: int,
    cell: Cell,
    value: str,
    most_values: int = QUESTIONS,
    met: dict[str, None] | None = None,
    asked: Asked | None = None,
) -> Iterator[tuple[int, Ground | None]]:
    """Yield the applicable behaviours that start chains towards a value, each with the length of the chain, shortest first.

    The first layer contains the achievers of the value. Each further layer contains the achievers of the unmet conditions of the
    layer before. A pair with None marks the start of a layer. The function adds the individuals in chains to `met`, and the
    examined values to `asked`.
    """
    asked = set() if asked is None else asked
    space.subgoals.concern(frozenset((*arguments_of(cell[1]), value)))
    subgoals: Iterable[Subgoal] = [(*cell, (value,))]
    if cell[0] in space.program.rules:
        subgoals = space.subgoals.defining(*cell, value == TRUE, level)
    blocked: list[tuple[Achiever, tuple[int, ...], Env]] = []
    length = 0
    while (blocked or not length) and len(asked) < most_values:
        length += 1
        yield length, None
        if blocked:  # only callers that need longer chains reach this point
            subgoals = _unmet_subgoals(space, level, blocked)
        blocked = []
        for situation, key, values in subgoals:
            for wanted in values:
                if (question := (situation, key, wanted)) in asked:
                    continue
                asked.add(question)
                for achiever in space.program.achievers.get((level, situation), ()):
                    achieve = space.achieving[achiever.behavior, achiever.effect]
                    for arguments, unmet, env in achieve(*arguments_of(key), wanted):
                        space.look()
                        if met is not None:
                            met.update(dict.fromkeys((*arguments_of(key), wanted, *arguments)))
                            met.update((found, None) for found in env.values() if found) if env else None
                        if unmet:
                            blocked.append((achiever, unmet, env))
                        else:
                            yield length, (achiever.behavior, arguments)


def _unmet_subgoals(
    space: Workspace, level: int, blocked: list[tuple[Achiever, tuple[int, ...], Env]]
) -> list[Subgoal]:
    """Return the subgoals for the unmet conditions of achievers that aren't applicable."""
    found: list[Subgoal] = []
    for achiever, unmet, env in blocked:
        space.check_time()
        for number in unmet:
            found += space.subgoals.towards(achiever, number, env, level)
    return found


def waits_for(space: Workspace, level: int, cell: Cell, value: str) -> list[Cell]:
    """Return the symbols whose change could make a value reachable in one step."""
    blocked: list[tuple[Achiever, tuple[int, ...], Env]] = []
    space.subgoals.concern(frozenset((*arguments_of(cell[1]), value)))
    if cell[0] in space.program.rules:
        return [subgoal[:2] for subgoal in space.subgoals.defining(*cell, value == TRUE, level)]
    for achiever in space.program.achievers.get((level, cell[0]), ()):
        for _, unmet, env in space.achieving[achiever.behavior, achiever.effect](*arguments_of(cell[1]), value):
            space.look()
            blocked.append((achiever, unmet, env))
    return list(dict.fromkeys(subgoal[:2] for subgoal in _unmet_subgoals(space, level, blocked)))

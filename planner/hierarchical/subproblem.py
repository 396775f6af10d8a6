"""A small world cut out of a large one: a few individuals with what holds between them, all else left as it is.

Where few things stand in each other's way (a full table, two hands), the way out is short in states, not in steps: it is found by
going through all states of the things concerned and one of each sort of place beside them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import product

from planner.grounded.state_space import Space, TooLargeError
from planner.hierarchical.operators import Program
from planner.hierarchical.state import Cell, Table, arguments_of, key_of
from planner.hierarchical.subplans import Ground, LimitError
from reasoner.symbols import Problem, Symbol

ALWAYS = 4
"""Classes of so few individuals (the hands) are part of every world."""
OPERATORS, STATES = 500, 40_000
"""The largest world that is searched."""


def world(program: Program, table: Table, level: int, inside: set[str]) -> Problem:
    """Return the problem of the individuals `inside` and the few that are always there, as they are now, without a goal."""
    problem = program.problem
    inside = {*inside, *program.named}
    classes = {
        kind: members if len(members) <= ALWAYS else tuple(m for m in members if m in inside)
        for kind, members in problem.classes.items()
    }
    inside.update(*classes.values())
    initial = {
        symbol: value
        for symbol, value in _around(program, table, inside)
        if problem.domain.situations[symbol.situation].level <= level
    }
    return replace(problem, classes=classes, initial=initial, goal={})


def _around(program: Program, table: Table, inside: set[str]) -> Iterator[tuple[Symbol, str]]:
    """Yield the facts that hold now between individuals of a small world."""
    for situation, cells in table.now.items():
        kinds = program.domain.situations[situation].arguments
        for arguments in product(*(sorted(inside & program.members.get(kind, frozenset())) for kind in kinds)):
            key = key_of(arguments)
            if key in cells:
                yield Symbol(situation, arguments), cells[key]


def detour(
    program: Program,
    table: Table,
    level: int,
    goal: tuple[Cell, str],
    kept: Mapping[Cell, str],
    breadth: int,
    deadline: float | None,
) -> list[Ground] | None:
    """Return the fewest steps of a level to one goal in a world of what it concerns; what is kept holds again after them.

    Parameters
    ----------
    program : Program
    table : Table
        The present state; isn't changed.
    level : int
    goal : cell and value
    kept : mapping of cell to value
    breadth : int
        So many values of each sort that the goal's symbol could take are part of the world, with those that have them.
    deadline : float, optional
    """
    cell, value = goal
    inside = {*arguments_of(cell[1]), value}
    now = table.now[cell[0]].get(cell[1])
    inside.update(() if now is None else (now,))
    members = program.problem.classes.get(program.domain.situations[cell[0]].range, ())
    for group in program.alike.groups(members):
        ranked = sorted(group, key=lambda member: (_burden(table, cell[0], member, kept), member in inside))
        inside.update(ranked[:breadth])
    while True:  # whoever has one of these, or is had by one, belongs to them
        more = set(_neighbours(program, table, cell[0], inside)) - inside
        if not more:
            break
        inside |= more
    small = world(program, table, level, inside)
    wanted = {s: kept[c] for s in small.initial if (c := (s.situation, key_of(s.arguments))) in kept}
    wanted[Symbol(cell[0], arguments_of(cell[1]))] = value
    try:
        found = Space(replace(small, goal=wanted), level, OPERATORS).search(STATES, deadline)
    except TooLargeError:
        return None
    except TimeoutError as error:
        raise LimitError("the time limit") from error
    return None if found.steps is None else [(step.behavior, step.arguments) for step in found.steps]


def _burden(table: Table, situation: str, value: str, kept: Mapping[Cell, str]) -> int:
    """Return how little a value is to be had: less what nobody has, more what must be given back."""
    keys = table.who[situation].get(value, ())
    return 1 + any((situation, key) in kept for key in keys) if keys else 0


def _neighbours(program: Program, table: Table, situation: str, inside: set[str]) -> Iterator[str]:
    """Yield who alone has one of these individuals as a value, their own values, and what the few always there have."""
    few = {m for members in program.problem.classes.values() if len(members) <= ALWAYS for m in members}
    for values in table.who.values():
        for individual in inside.difference(program.named):
            keys = values.get(individual, {})
            if len(keys) == 1:
                yield from arguments_of(next(iter(keys)))
    for name, cells in table.now.items():
        for individual in inside | few if name == situation else few:
            if individual in cells:
                yield cells[individual]

"""Proofs that there is no plan, cheapest first, each with its reason in the ontology's terms.

All of them look at the lowest level only: what an upper level can't do proves nothing, since the level below may do it
otherwise. A proof here is sound and seldom complete; what is left is decided by search.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import reduce
from operator import or_
from typing import TYPE_CHECKING, TypeAlias

from planner.hierarchical.operators import Achieve, Achiever, Program
from planner.hierarchical.subplans import Segments
from planner.hierarchical.subproblem import LEAST
from planner.plan import OUT_OF_MEMORY, Reason, TooLargeError, UnsolvableError
from planner.transitions import Cell, Table, arguments_of, key_of
from reasoner.limits import LimitError
from reasoner.symbols import (
    FALSE,
    Behavior,
    Fact,
    Problem,
    RelationCondition,
    State,
    Symbol,
    ValueCondition,
    Witness,
)

if TYPE_CHECKING:
    from planner.grounded.reachability import Reached
    from planner.grounded.task import Task

LOOKING = 1_800_000
"""The work of looking at all states, in states times relaxed operators, that no search has to come before."""
AT_ONCE = 300_000
"""The most ways to achieve values that are looked at to show at once that there is no plan: about a second."""
TOLD, NAMED = 5_000, 3
"""Of so many states, at most, it is said what can be done in none of them; and so many facts are named."""
MOST_ROWS, MOST_CHANGES = 2_000_000, 10_000_000
"""The largest join of relaxed reachability (some 200 MB), and the most changes of a level that is grounded (600 MB)."""

Achievers: TypeAlias = "Mapping[tuple[str, int], Achieve]"
Asked: TypeAlias = "dict[tuple[Cell, str], bool]"
"""For each value of a symbol whether it counts as attainable."""


def impossible(problem: Problem, program: Program | None = None) -> Reason | None:
    """Return why a problem has no plan, or None if that can't be shown with little work; `program` saves compiling."""
    goal = {(s.situation, key_of(s.arguments)): value for s, value in problem.goal.items()}
    table = Table(problem.domain.situations, problem.initial)
    start = Segments(program or Program(problem), table, goal)
    start.most_looked = AT_ONCE
    with suppress(LimitError):
        return refuted(start)
    return None


def refuted(segments: Segments) -> Reason | None:
    """Return why the goals can't be reached from a situation, or None if that can't be shown at once."""
    return unattainable(segments) or contested(segments)


def unattainable(segments: Segments) -> Reason | None:
    """Return why a goal can't be brought about in any situation, or None if that can't be shown at once.

    A value counts as attainable unless each behaviour that sets it lacks a static fact, or needs a value that isn't
    attainable; what is being asked already counts as attainable, so that a "no" is a proof.
    """
    program = segments.program
    level = program.levels[-1]
    asked: Asked = {}
    achieve = program.bind(segments.table, few=sys.maxsize).achieve
    for cell, value in segments.goal.items():
        if not _attainable(segments, achieve, level, cell, value, asked):
            return _reason(segments, achieve, level, cell, value, asked)
    return None


def _attainable(segments: Segments, achieve: Achievers, level: int, cell: Cell, value: str, asked: Asked) -> bool:
    """Return whether a value counts as attainable; chains of needs may be longer than the interpreter's stack is deep."""
    waiting, answer = [_needs(segments, achieve, level, cell, value, asked)], None
    while waiting:
        try:
            needed = waiting[-1].send(answer)
        except StopIteration as end:
            waiting.pop()
            answer = end.value
        else:
            waiting.append(_needs(segments, achieve, level, *needed, asked))
            answer = None
    return answer is True


def _needs(
    segments: Segments, achieve: Achievers, level: int, cell: Cell, value: str, asked: Asked
) -> Generator[tuple[Cell, str], bool | None, bool]:
    """Yield what a value needs, one fact after the other, and take whether it is attainable; return whether the value is."""
    if cell[0] in segments.program.rules or segments.table.now[cell[0]].get(cell[1], FALSE) == value:
        return True
    if segments.program.domain.situations[cell[0]].quantity is not None:
        return True  # what an effect makes of it depends on what it comes to be before
    known = asked.get((cell, value))
    if known is not None:
        return known
    asked[cell, value] = True
    for achiever in segments.program.achievers.get((level, cell[0]), ()):
        for _, unmet, env in achieve[achiever.behavior, achiever.effect](*arguments_of(cell[1]), value):
            segments.look()
            for number in unmet:
                needed = _needed(segments, achiever, number, env)
                if needed is not None and not (yield needed):
                    break
            else:
                return True
    asked[cell, value] = False
    return False


def _needed(segments: Segments, achiever: Achiever, number: int, env: dict[str, str | None]) -> tuple[Cell, str] | None:
    """Return the one fact that an unmet condition needs, if it needs one."""
    condition = achiever.soft[number]
    if not isinstance(condition, ValueCondition) or condition.negated:
        return None
    if any(term in achiever.determined for term in (*condition.arguments, condition.value)):
        return None
    arguments = tuple(env.get(a) or a for a in condition.arguments)
    key = arguments[0] if len(arguments) == 1 else arguments
    return (condition.situation, key), env.get(condition.value) or condition.value


def _reason(segments: Segments, achieve: Achievers, level: int, cell: Cell, value: str, asked: Asked) -> Reason:
    """Return a goal with the missing static facts at the end of the chain of what it needs."""
    goal = Fact(Symbol(cell[0], arguments_of(cell[1])), value)
    lacking: dict[str, tuple[str, ...]] = {}
    seen: set[tuple[Cell, str]] = set()
    queue = [(cell, value)]
    for at, wanted in queue:
        if (at, wanted) in seen:
            continue
        seen.add((at, wanted))
        program = segments.program
        for achiever in program.achievers.get((level, at[0]), ()):
            behavior = program.domain.behaviors[achiever.behavior]
            found = False
            for _, unmet, env in achieve[achiever.behavior, achiever.effect](*arguments_of(at[1]), wanted):
                found = True
                for number in unmet:
                    needed = _needed(segments, achiever, number, env)
                    if needed is not None and asked.get(needed) is False:
                        queue.append(needed)
            if not found:
                for text, names in _missing(program, behavior, achiever.effect, (*arguments_of(at[1]), wanted)):
                    lacking[text] = names
    if not lacking:
        return Reason(f"{goal}: nothing brings this about", (*goal.symbol.arguments, goal.symbol.situation, goal.value))
    terms = dict.fromkeys((*goal.symbol.arguments, goal.symbol.situation, goal.value))
    for more in lacking.values():
        terms.update(dict.fromkeys(more))
    return Reason(f"{goal}: {'; '.join(lacking)}", tuple(terms))


def _missing(
    program: Program, behavior: Behavior, effect: int, given: tuple[str, ...]
) -> list[tuple[str, tuple[str, ...]]]:
    """Return the static relations of a behaviour that no individual has to what its effect names."""
    change = behavior.effects[effect]
    env = {t: v for t, v in zip((*change.arguments, change.value), given, strict=True) if t.startswith("?")}
    kinds = behavior.kinds
    found = []
    for condition in behavior.preconditions:
        if isinstance(condition, RelationCondition) and not condition.negated:
            bound = [env.get(a, a) for a in condition.arguments]
            rows = program.problem.relations.get(condition.relation, frozenset())
            if any(all(b.startswith("?") or b == r for b, r in zip(bound, row, strict=True)) for row in rows):
                continue
            # Said of all individuals of the first argument's class where it is true of all of them.
            if all(row[1:] != tuple(bound[1:]) for row in rows) and condition.arguments[0] in kinds:
                names = [f"no {kinds[condition.arguments[0]]}", *bound[1:]]
            else:
                names = [f"not {bound[0]}", *bound[1:]]
            text = " ".join((names[0], condition.relation, *names[1:]))
            found.append((text, (condition.relation, *(b for b in names[1:] if not b.startswith("?")))))
    return found


def contested(segments: Segments) -> Reason | None:
    """Return which two goals want one value that only one symbol can have at a time, or None.

    A situation type is exclusive on the lowest level if no two symbols share a value at the start, and every behaviour that
    sets one to a value requires that nobody has it.
    """
    program = segments.program
    takers: dict[tuple[str, str], Cell] = {}
    for cell, value in segments.goal.items():
        if program.domain.situations[cell[0]].quantity is not None:
            continue
        other = takers.setdefault((cell[0], value), cell)
        if other != cell and cell[0] not in program.rules and _exclusive(segments, cell[0], value):
            a, b = (Fact(Symbol(c[0], arguments_of(c[1])), value) for c in (other, cell))
            terms = (*a.symbol.arguments, *b.symbol.arguments, a.symbol.situation, value)
            return Reason(
                f"{a} and {b} exclude each other: {program.domain.situations[cell[0]].name} {value} is for one", terms
            )
    return None


def _exclusive(segments: Segments, situation: str, value: str) -> bool:
    program = segments.program
    if len(segments.table.who[situation].get(value, ())) > 1:
        return False
    for behavior in program.domain.at_level(program.levels[-1]):
        kinds = behavior.kinds
        setting = [e for e in behavior.effects if e.situation == situation]
        for effect in setting:
            if not effect.value.startswith("?"):
                if effect.value == value:
                    return False
            elif value in program.members.get(kinds[effect.value], ()) and (
                len(setting) > 1
                or not any(
                    isinstance(c, Witness)
                    and c.negated
                    and c.conditions == (ValueCondition(situation, (c.variable,), effect.value),)
                    and program.members.get(program.domain.situations[situation].arguments[0], frozenset())
                    <= program.members.get(c.kind, frozenset())
                    for c in behavior.preconditions
                )
            ):
                return False
    return True


# ---------------------------------------------------------------------------------------- on the lowest level, grounded


def closed(problem: Problem, level: int, deadline: float | None, initial: State | None = None) -> Reached:
    """Return what could be reached on a level, from the problem's initial state or another, if nothing ever became false."""
    from planner.grounded import reachability

    reached = reachability.Reached(problem, level, problem.initial if initial is None else initial, MOST_ROWS, deadline)
    reached.close()
    return reached


def refusal(reached: Reached, most: int = MOST_CHANGES) -> Reason | None:
    """Return why a level isn't to be grounded, if it would take too much memory: an effect on a symbol touches all its values."""
    values = {}
    for name, situation in reached.situations.items():
        rows = len(reached.tables["situation", name])
        values[name] = 1 if situation.boolean else 1 + rows // max(len(reached.symbols[name]), 1)
    changes = sum(
        len(rows) * sum(values[effect.situation] for _, effect in schema.effects)
        for schema, rows in zip(reached.schemas, reached.rows, strict=True)
    )
    if changes <= most:
        return None
    return Reason(f"level {reached.level} is too large to be grounded: {changes} changes, more than the {most} allowed")


def proved(problem: Problem, level: int, deadline: float | None = None) -> Task | Reason:
    """Raise `UnsolvableError` if a goal can't be reached on a level even if nothing ever became false.

    Else that level is returned, grounded, or why it is too large for that.
    """
    from planner.grounded.grounding import ground
    from planner.grounded.unreachable import unreachable

    try:
        reached = closed(problem, level, deadline)
        for symbol, value in sorted(problem.goal.items()):
            if not reached.possible(symbol, value):
                raise UnsolvableError(unreachable(reached, Fact(symbol, value)))
        too_large = refusal(reached)
        if too_large is not None:
            return too_large
        task = ground(problem, level, deadline=deadline)
    except TooLargeError as error:
        return Reason(f"level {level} is too large to be grounded: {error}")
    except MemoryError:
        return OUT_OF_MEMORY
    if isinstance(task, Reason):
        raise UnsolvableError(task)
    return task


def looked_at(task: Task, segments: Segments, before: int) -> int:
    """Raise `UnsolvableError` if none of all states that can be reached fulfils the goal; return how many were looked at.

    That may cost as much as the searches have up to now. Nothing is done if these aren't twice as many as were looked at `before`.
    """
    state = max(len(task.owners), LEAST)
    most = max(LOOKING, segments.worked) // state
    if most < 2 * before:
        return before
    if reason := exhausted(task, most, segments.deadline):
        raise UnsolvableError(reason)
    return most


def exhausted(task: Task, most: int, deadline: float | None = None) -> Reason | None:
    """Return that none of all states fulfils the goal, if that is so and at most so many have to be looked at."""
    from planner.grounded.shortest import shortest

    found = shortest(task, most=most, deadline=deadline, known=most)
    if found.plan is not None or found.bound < math.inf:
        return None
    states = list(found.states)
    text = f"all {len(states)} states of level {task.level} that can be reached were looked at"
    ever = reduce(or_, states)
    never = [text for bit, text in _named(task) if task.goal & ~ever & bit] or ["the whole goal"]
    idle = _never_done(task, states[:TOLD]) if len(states) <= TOLD else []
    said = f"; {', '.join(idle)} can never be done" if idle else ""
    more = f" (nor do {len(never) - NAMED} more)" if len(never) > NAMED else ""
    return Reason(f"{text}: in none does {' or '.join(never[:NAMED])} hold{more}{said}")


def _named(task: Task) -> Iterator[tuple[int, str]]:
    """Yield the bits that stand for facts, or for their not holding, and what these are in words."""
    for bit, fact in enumerate(task.facts):
        yield 1 << bit, str(fact)
    for bit, fact in task.complements.items():
        yield 1 << bit, f"not {fact}"


def _never_done(task: Task, states: Sequence[int]) -> list[str]:
    """Return the level's behaviours that can be done in none of some states."""
    left = {behavior.name for behavior in task.problem.domain.at_level(task.level)}
    for state in states:
        if not left:
            break
        for operator in task.applicable(state)[0]:
            name = task.describe(operator)[0]
            if name in left and task.applied(state, operator) is not None:
                left.discard(name)
    return sorted(left)

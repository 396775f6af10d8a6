"""A scope: a part of the world, grounded and searched flat, for what no short chain of relevant steps achieves.

focus      the individuals that may act and be acted on: those of the targets, and those that chains towards the targets meet
frozen     others that have a value of theirs, or that a condition looks for: they stand where they stand, so that whether there is
           an individual such that … is judged as in the whole world
targets    the symbols that shall get a value; what is kept besides is said by a function, as for
`confab.planner.hierarchical.chains`

What holds of the individuals in focus is exact, so that steps found here can be done in the whole world; that there are none here
proves nothing. Everything is done on one level; the caller refines the steps and bars those that can't be. The room that grounds
and searches is imported where a scope is searched: numpy alone takes longer to import than a small task to plan.
"""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Set as AbstractSet
from contextlib import suppress
from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING

from confab.planner.hierarchical.effort import Effort
from confab.planner.hierarchical.relevance import chains
from confab.planner.hierarchical.workspace import Ground, Keep, Workspace
from confab.planner.plan import Counts, Limits, Reason, Status, UngroundableError
from confab.planner.transitions import Cell, arguments_of, key_of
from confab.reasoner.amounts import meets
from confab.reasoner.language import walk
from confab.reasoner.limits import OutOfTimeError
from confab.reasoner.symbols import (
    FALSE,
    Parameter,
    Problem,
    RelationCondition,
    State,
    Symbol,
    ValueCondition,
    Witness,
)

if TYPE_CHECKING:
    from confab.planner.grounded.task import Task

FEW = 4
"""Classes of so few individuals (the hands) are part of every scope, and so many holders of one value are."""

BITS = 20
"""Bits that a flat search follows for each relaxed operator of a state, with what it does besides."""
LEAST, MAKING = 300, 100
"""A task counts as having at least so many relaxed operators, since a state costs something whatever can be done there; and
making it as much as looking at so many states. A scope of which not a fifth as many could be looked at isn't grounded."""


class Scope:
    """A scope on one level, as it is now: a grounded task, searched as often as steps turn out not to be refinable."""

    def __init__(self, space: Workspace, level: int, targets: Mapping[Cell, str], keep: Keep, effort: Effort) -> None:
        self.space, self.level, self.effort = space, level, effort
        self.plan: tuple[int, ...] = ()
        self.task: Task | None = None
        self.held: State = {}
        with suppress(UngroundableError, OutOfTimeError, MemoryError):
            task = self._grounded(targets, keep, effort)
            self.task = None if isinstance(task, Reason) else task
        space.check_time()

    def _grounded(self, targets: Mapping[Cell, str], keep: Keep, effort: Effort) -> Task | Reason:
        from confab.planner.grounded.grounding import ground

        space, level = self.space, self.level
        inside = focus(space, level, targets, effort)
        small = problem_of(space, level, inside, with_frozen(space, level, inside) if inside else frozenset())
        goal = {Symbol(cell[0], arguments_of(cell[1])): value for cell, value in targets.items()}
        for symbol, value in small.initial.items():
            wanted = keep((symbol.situation, key_of(symbol.arguments)), value)
            # What isn't at rest may stay so; who touches it is found out by the caller.
            if wanted is not None and meets(value, wanted):
                goal.setdefault(symbol, wanted)
        for cell in space.defined:
            if wanted := keep(cell, ""):
                goal.setdefault(Symbol(cell[0], arguments_of(cell[1])), wanted)
        self.held = small.initial
        return ground(small, level, goal=goal, most=5 * effort.work // MAKING, deadline=space.deadline, apart=True)

    def search(self) -> list[Ground] | None:
        """Return steps, or None if none were found; `bar` takes one of them back."""
        from confab.planner.grounded.best_first import search

        if self.task is None:
            self.space.spend(self.level, Counts(), MAKING * LEAST)
            return None
        size = max(len(self.task.owners), LEAST)
        limits, most = Limits(self.effort.work // LEAST), BITS * self.effort.work
        found = search(self.task, limits, self.space.deadline, most_work=most)
        work = max(LEAST * found.counts.expanded, found.work // BITS)
        self.space.spend(self.level, found.counts, MAKING * size + work)
        self.plan = found.plan
        if found.status is not Status.SOLVED:
            return None
        return [self.task.describe(operator)[:2] for operator in found.plan]

    def bar(self, position: int) -> None:
        """Take back the plan that was found last because of one of its steps, which can't be refined where it stands."""
        assert self.task is not None
        state = self.task.initial
        for operator in self.plan[:position]:
            state = self.task.applied(state, operator) or state
        name = self.task.describe(self.plan[position])[:2]
        self.task.barred.update((state, o) for o in range(len(self.task)) if self.task.describe(o)[:2] == name)


def focus(space: Workspace, level: int, targets: Mapping[Cell, str], effort: Effort) -> set[str] | None:
    """Return the individuals that acting towards the targets may concern; None are all."""
    if effort.questions is None:
        return None
    program, table = space.program, space.table
    met: dict[str, None] = dict.fromkeys(program.named)
    for cell, value in targets.items():
        met.update(dict.fromkeys((*arguments_of(cell[1]), value)))
    for cell, value in targets.items():
        for _ in chains(space, level, cell, value, effort.questions, met):
            pass
    for members in program.problem.classes.values():
        if len(members) <= FEW:
            met.update(dict.fromkeys(members))
    met.update(dict.fromkeys(space.wants.spare(met, level, effort.spares)))
    for individual in tuple(met):  # what these have, and who has what these are, as far as these are few
        for situation, cells in table.now.items():
            if program.domain.situations[situation].level > level:
                continue
            if individual in cells:
                met[cells[individual]] = None
            holders = table.who[situation].get(individual, ())
            if len(holders) <= FEW:
                for key in holders:
                    met.update(dict.fromkeys(arguments_of(key)))
    return set(met) - {FALSE}


def problem_of(
    space: Workspace, level: int, inside: AbstractSet[str] | None, frozen: AbstractSet[str] = frozenset()
) -> Problem:
    """Return one level of the problem as it is now, without a goal, of the individuals inside alone, or of all."""
    program, table = space.program, space.table
    problem = program.problem
    situations = problem.domain.situations
    if inside is None:
        initial = {s: v for s, v in table.state().items() if situations[s.situation].level <= level}
        return replace(problem, initial=initial, goal={})
    there = inside | frozen
    classes = {kind: tuple(m for m in members if m in there) for kind, members in problem.classes.items()}
    behaviors = {}
    for behavior in problem.domain.at_level(level):
        parameters = []
        for parameter in behavior.parameters:
            kind = f"{parameter.kind} in focus"
            classes[kind] = tuple(m for m in classes.get(parameter.kind, ()) if m in inside)
            parameters.append(Parameter(parameter.name, kind))
        behaviors[behavior.name] = replace(behavior, parameters=tuple(parameters))
    relations = {}
    for relation, rows in program.rows_of.items():
        individuals = -1 if relation in program.measures else None  # a number isn't one
        within = (row for one in there for row in rows.get(one, ()) if there >= set(row[:individuals]))
        relations[relation] = frozenset(within)
    initial = {
        Symbol(situation, arguments): table.now[situation][key]
        for situation in table.now
        if situations[situation].level <= level
        for arguments in product(*(classes.get(k, ()) for k in situations[situation].arguments))
        if (key := key_of(arguments)) in table.now[situation]
    }
    domain = replace(problem.domain, behaviors=behaviors)
    return replace(problem, domain=domain, classes=classes, relations=relations, initial=initial, goal={})


def with_frozen(space: Workspace, level: int, inside: AbstractSet[str]) -> set[str]:
    """Return individuals with those on whom it depends what they can do, though these don't take part.

    These are the values that they have, the values of these and so on; and where a behaviour asks whether there is an individual
    such that …, those who have one of them as a value, and those in a static relation to them.
    """
    program, table = space.program, space.table
    behaviors = program.domain.at_level(level)
    behaviors += tuple(rule.behavior for its in program.domain.rules.values() for rule in its)
    witnesses = [inner for b in behaviors for c in b.conditions for inner in walk(c) if isinstance(inner, Witness)]
    there, fresh = set(inside), set(inside)
    for _ in range(1 + max([depth(witness) for witness in witnesses], default=0)):
        met: set[str] = set()
        for condition, kind in ((c, witness.kind) for witness in witnesses for c in witness.conditions):
            if isinstance(condition, ValueCondition):
                holders = table.who[condition.situation]
                keys = [key for one in fresh for key in tuple(holders.get(one, ()))[: FEW + 1]]
                met.update(argument for key in keys for argument in arguments_of(key))
            elif isinstance(condition, RelationCondition):
                rows, members = program.rows_of.get(condition.relation, {}), program.members.get(kind, ())
                met.update(x for one in fresh for row in rows.get(one, ()) for x in row if x in members)
        waiting = [*fresh, *met]
        while waiting:
            individual = waiting.pop()
            for situation, cells in table.now.items():
                value = dict.get(cells, individual)  # of what is kept, nothing is worked out
                if value is not None and value not in met and program.domain.situations[situation].level <= level:
                    met.add(value)
                    waiting.append(value)
        fresh = met - there
        there |= fresh
    return there


def depth(witness: Witness) -> int:
    """Return how many witnesses are asked for one inside the other."""
    return 1 + max([depth(inner) for inner in witness.conditions if isinstance(inner, Witness)], default=0)

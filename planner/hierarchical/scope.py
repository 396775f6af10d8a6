"""A scope: a part of the world that is grounded and searched on one level if a few relevant steps don't suffice.

The individuals in *focus* occur in the targets, or in chains towards the targets. Steps involve only individuals in focus.
*Frozen* individuals have a fixed state. The frozen individuals are the values of individuals in focus, and the individuals over
which conditions quantify. Because of the frozen individuals, quantified conditions have the same truth value as in the whole
world.

The state of the individuals in focus is exact. Therefore the steps of a successful search are applicable in the whole world. A
failed search proves nothing. The caller refines the steps, and bars steps that have no refinement. The grounding package is
imported only when a scope is searched, because importing numpy takes longer than planning a small task.
"""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Set as AbstractSet
from contextlib import suppress
from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING

from confab.planner.hierarchical.relevance import relevant_achievers
from confab.planner.hierarchical.search_budget import SearchBudget
from confab.planner.hierarchical.workspace import Ground, Keep, Workspace
from confab.planner.plan import Counts, Limits, Reason, Status, UngroundableError
from confab.planner.transitions import Cell, arguments_of, key_of
from confab.reasoner.amounts import meets
from confab.reasoner.language import walk
from confab.reasoner.limits import OutOfTimeError
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import FALSE, Parameter, RelationCondition, State, Symbol, ValueCondition, Witness

if TYPE_CHECKING:
    from confab.planner.grounded.task import Task

SMALL_CLASS = 4
"""Maximum size of a class, such as the hands, that is part of every scope.

The objects that have an individual of the scope as value are added to the scope if there are at most `SMALL_CLASS` of them.
"""

BITS = 20
"""Number of bits that a search processes for each relaxed operator and state, including overhead."""
LEAST, MAKING = 300, 100
"""Minimum number of relaxed operators that is assumed for a grounded scope, and cost of grounding it, in examined states."""
ROWS = 5
"""Maximum number of rows of a join when a scope is grounded, for each state whose examination costs as much as the budget allows
after grounding."""


class Scope:
    """A scope on one level in the current state, as a grounded task; the caller repeats the search if a step has no refinement."""

    def __init__(
        self, space: Workspace, level: int, targets: Mapping[Cell, str], keep: Keep, budget: SearchBudget
    ) -> None:
        self.space, self.level, self.budget = space, level, budget
        self.plan: tuple[int, ...] = ()
        self.task: Task | None = None
        self.held: State = {}
        with suppress(UngroundableError, OutOfTimeError, MemoryError):
            task = self._grounded(targets, keep, budget)
            self.task = None if isinstance(task, Reason) else task
        space.check_time()

    def _grounded(self, targets: Mapping[Cell, str], keep: Keep, budget: SearchBudget) -> Task | Reason:
        from confab.planner.grounded.grounding import ground

        space, level = self.space, self.level
        inside = focus(space, level, targets, budget)
        small = problem_of(space, level, inside, with_frozen(space, level, inside) if inside else frozenset())
        goal = {Symbol(cell[0], arguments_of(cell[1])): value for cell, value in targets.items()}
        for symbol, value in small.initial.items():
            wanted = keep((symbol.situation, key_of(symbol.arguments)), value)
            # A symbol that isn't at rest may stay unchanged. The caller detects steps that change a symbol which isn't
            # at rest.
            if wanted is not None and meets(value, wanted):
                goal.setdefault(symbol, wanted)
        for cell in space.defined:
            if wanted := keep(cell, ""):
                goal.setdefault(Symbol(cell[0], arguments_of(cell[1])), wanted)
        self.held = small.initial
        return ground(small, level, goal=goal, most=ROWS * budget.work // MAKING, deadline=space.deadline, apart=True)

    def search(self) -> list[Ground] | None:
        """Return steps that achieve the targets, or None if no steps are found."""
        from confab.planner.grounded.best_first import search

        if self.task is None:
            self.space.spend(self.level, Counts(), MAKING * LEAST)
            return None
        size = max(len(self.task.owners), LEAST)
        limits, most = Limits(self.budget.work // LEAST), BITS * self.budget.work
        found = search(self.task, limits, self.space.deadline, most_work=most)
        work = max(LEAST * found.counts.expanded, found.work // BITS)
        self.space.spend(self.level, found.counts, MAKING * size + work)
        self.plan = found.plan
        if found.status is not Status.SOLVED:
            return None
        return [self.task.describe(operator)[:2] for operator in found.plan]

    def bar(self, position: int) -> None:
        """Exclude the step at `position` of the last plan from the next search, in the state before this step."""
        assert self.task is not None
        state = self.task.initial
        for operator in self.plan[:position]:
            after = self.task.applied(state, operator)
            assert after is not None
            state = after
        name = self.task.describe(self.plan[position])[:2]
        self.task.barred.update((state, o) for o in range(len(self.task)) if self.task.describe(o)[:2] == name)


def focus(space: Workspace, level: int, targets: Mapping[Cell, str], budget: SearchBudget) -> set[str] | None:
    """Return the individuals in focus for the given targets, or None for all individuals."""
    if budget.most_values is None:
        return None
    program, table = space.program, space.table
    met: dict[str, None] = dict.fromkeys(program.named)
    for cell, value in targets.items():
        met.update(dict.fromkeys((*arguments_of(cell[1]), value)))
    for cell, value in targets.items():
        for _ in relevant_achievers(space, level, cell, value, budget.most_values, met):
            pass
    for members in program.problem.classes.values():
        if len(members) <= SMALL_CLASS:
            met.update(dict.fromkeys(members))
    met.update(dict.fromkeys(space.candidates.spare(met, level, budget.spares)))
    for individual in tuple(met):  # add the values of the individual, and the few objects whose value is the individual
        for situation, cells in table.now.items():
            if program.domain.situations[situation].level > level:
                continue
            if individual in cells:
                met[cells[individual]] = None
            holders = table.holders[situation].get(individual, ())
            if len(holders) <= SMALL_CLASS:
                for key in holders:
                    met.update(dict.fromkeys(arguments_of(key)))
    return set(met) - {FALSE}


def problem_of(
    space: Workspace, level: int, inside: AbstractSet[str] | None, frozen: AbstractSet[str] = frozenset()
) -> Problem:
    """Return one level of the problem in the current state, without a goal.

    The arguments of behaviours are restricted to the individuals in `inside`, unless `inside` is None.
    """
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
        individuals = -1 if relation in program.measures else None  # numbers aren't individuals
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
    """Return the individuals in focus together with the frozen individuals.

    The values of individuals in focus are frozen, and the values of these values, and so on. If a behaviour quantifies over
    individuals, two more kinds of individuals are frozen: individuals whose value is an individual of the scope, and
    individuals that a static relation relates to an individual of the scope.
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
                holders = table.holders[condition.situation]
                keys = [key for one in fresh for key in tuple(holders.get(one, ()))[: SMALL_CLASS + 1]]
                met.update(argument for key in keys for argument in arguments_of(key))
            elif isinstance(condition, RelationCondition):
                rows, members = program.rows_of.get(condition.relation, {}), program.members.get(kind, ())
                met.update(x for one in fresh for row in rows.get(one, ()) for x in row if x in members)
        waiting = [*fresh, *met]
        while waiting:
            individual = waiting.pop()
            for situation, cells in table.now.items():
                value = dict.get(cells, individual)  # read without calculating derived values
                if value is not None and value not in met and program.domain.situations[situation].level <= level:
                    met.add(value)
                    waiting.append(value)
        fresh = met - there
        there |= fresh
    return there


def depth(witness: Witness) -> int:
    """Return the number of nested witnesses, including the given witness."""
    return 1 + max([depth(inner) for inner in witness.conditions if isinstance(inner, Witness)], default=0)

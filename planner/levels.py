"""Conditions of a level that a plan violates while steps of a lower level replace steps of this level (docs/levels.md).

If a level has no plan with refinements, steps of the level below replace the steps of the level. The lower-level steps
satisfy the conditions of their level, but may violate conditions of the level above, such as "a filled cup isn't
moved". This module lists the violated conditions.

A level sees a change if a symbol of the level gets another value of the level. A level doesn't see intermediate values of lower
levels, such as a cup in a hand. For each visible change that persists, the level must have an applicable behaviour that makes the
change. A behaviour that makes a visible change may also make the visible changes directly before it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations

from confab.planner.checked_conditions import Bindings, unified
from confab.planner.plan import Broken, Left, Plan, Step
from confab.planner.validation import BehaviorReader, Cell, LoggedState, stretches
from confab.reasoner.language import is_variable, mentions, substituted
from confab.reasoner.problem import Problem
from confab.reasoner.sentences import said
from confab.reasoner.symbols import AmountEffect, Behavior, Condition, Fact, Symbol, Times, ValueCondition, ValueEffect

MOST_LACKING = 4
"""Maximum number of conditions that are removed together to find the failing conditions of a behaviour."""


def levels_left(problem: Problem, plan: Plan) -> list[Left]:
    """Return the runs of consecutive lower-level steps in a valid plan, each with the conditions that the run violates."""
    return list(_Watch(problem).carried_out(plan.steps, 0))


class _Watch:
    """The execution of a plan, with the state that each level sees."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.rules = BehaviorReader(problem)
        self.events = (problem.times or Times()).events
        self.facts = LoggedState(problem, problem.initial)
        self.views = {
            level: LoggedState(
                problem, {s: value for s, value in problem.initial.items() if problem.sees(level, s, value)}
            )
            for level in problem.domain.levels
        }
        self.left: dict[int, list[Broken]] = {}  # the violations so far, by replaced level
        self.history: dict[
            int, list[tuple[Cell, str | None]]
        ] = {}  # the visible changes, with the values before, by replaced level

    def carried_out(self, steps: Sequence[Step], above: int) -> Iterator[Left]:
        level = next((level for level in self.problem.domain.levels if level > above), above)
        for part in stretches(steps, level):
            if all(step.behavior in self.events for step in part):  # an external event takes the place of no step
                for step in part:
                    self.step(step)
            elif part[0].level > level:
                self.left[level], self.history[level] = [], []
                yield from self.carried_out(part, level)
                yield Left(level, part[0].path, part[-1].path, tuple(self.broken(level)))
            elif part[0].steps:
                yield from self.carried_out(part[0].steps, level)
            else:
                self.step(part[0])

    def broken(self, level: int) -> Iterator[Broken]:
        """Yield the violations of a finished run of lower-level steps, except violations by changes that the run undid."""
        before: dict[Cell, str | None] = {}
        for cell, old in self.history.pop(level):
            before.setdefault(cell, old)
        for one in self.left.pop(level):
            cell = one.change.symbol.situation, one.change.symbol.arguments
            if self.views[level].value(*cell) != before[cell]:
                yield one

    def step(self, step: Step) -> None:
        behavior = self.problem.domain.behaviors[step.behavior]
        changes = {(s, key): value for s, key, value in self.rules.changes(behavior, step.arguments, self.facts) or ()}
        for (situation, arguments), value in changes.items():
            symbol = Symbol(situation, arguments)
            for level in self.left:
                old = self.views[level].value(situation, arguments)
                stays = situation not in self.problem.domain.remembers and old != value
                if self.problem.sees(level, symbol, value) and stays:
                    self.left[level].extend(self.judged(level, step, Fact(symbol, value)))
                    self.history[level].append(((situation, arguments), old))
                    self.views[level].put(situation, arguments, value)
        for (situation, arguments), value in changes.items():
            self.facts.put(situation, arguments, value)
            for level, view in self.views.items():
                if self.problem.sees(level, Symbol(situation, arguments), value):
                    view.put(situation, arguments, value)

    def judged(self, level: int, step: Step, change: Fact) -> Iterator[Broken]:
        """Yield the violation of a change if no behaviour of the level could make the change in the current state."""
        best: Broken | None = None
        view = self.views[level]
        for behavior in self.problem.domain.at_level(level):
            for effect in behavior.every_effect:
                if effect.situation != change.symbol.situation:
                    continue
                value = (
                    effect.value if isinstance(effect, ValueEffect) else None
                )  # amounts are known only after execution
                own, wanted = frozenset(behavior.kinds), (*change.symbol.arguments, change.value)
                terms = unified(self.problem, behavior, own, (*effect.arguments, value), wanted)
                if terms is None:
                    continue
                if self.could(level, behavior, effect, terms, change):
                    return
                most = None if best is None else len(best.conditions) - 1
                conditions, views = (*behavior.preconditions, *effect.when), (self.mixed(level, change.symbol), view)
                found, asked = failing_conditions(self.rules, conditions, terms, behavior.kinds, views, most)
                arguments = tuple(found.get(p.name, p.name) for p in behavior.parameters)
                if best is None or len(asked) < len(best.conditions):
                    text = f"{change}: {' '.join((behavior.name, *arguments))} requires that {' and '.join(map(said, asked))}"
                    best = Broken(step.path, change, behavior.name, arguments, asked, text)
        yield best or Broken(step.path, change, None, (), (), f"{change}: no behaviour of that level makes this change")

    def could(
        self, level: int, behavior: Behavior, effect: ValueEffect | AmountEffect, terms: Bindings, change: Fact
    ) -> bool:
        """Return whether a behaviour could make a change, possibly together with the visible changes just before the change."""
        view = self.views[level]
        conditions, kinds = (*behavior.preconditions, *effect.when), behavior.kinds
        if self.rules.satisfied(conditions, terms, kinds, view) is not None:
            return True
        if self.rules.satisfied(conditions, terms, kinds, self.mixed(level, change.symbol)) is not None:
            return True
        made = {(change.symbol.situation, change.symbol.arguments): change.value}
        undone: dict[Cell, str] = {}
        possible = False
        for cell, old in list(reversed(self.history[level]))[: len(behavior.effects) - 1]:
            now = view.value(*cell)
            if old is None or now is None:
                break
            made.setdefault(cell, now)
            undone.setdefault(cell, now)
            view.put(*cell, old)
            found = self.rules.satisfied(conditions, terms, kinds, view)
            if found is not None:
                arguments = tuple(found.get(p.name, "") for p in behavior.parameters)
                all_ = {(s, key): value for s, key, value in self.rules.changes(behavior, arguments, view) or ()}
                possible = possible or made.items() <= all_.items()
        for cell, now in undone.items():
            view.put(*cell, now)
        return possible

    def mixed(self, level: int, symbol: Symbol) -> LoggedState:
        """Return the current state, except that one symbol has the last value that the level saw."""
        values = self.facts.state()
        seen = self.views[level].value(symbol.situation, symbol.arguments)
        return LoggedState(self.problem, values if seen is None else {**values, symbol: seen})


def failing_conditions(
    rules: BehaviorReader,
    conditions: Sequence[Condition],
    terms: Bindings,
    kinds: Mapping[str, str],
    views: Sequence[LoggedState],
    most: int | None = None,
) -> tuple[Bindings, tuple[Condition, ...]]:
    """Return the smallest set of failing conditions, and bindings with which the other conditions hold in one of the states.

    If more than `most` conditions fail (`MOST_LACKING` by default), the set contains each condition that no individuals satisfy
    in any of the states.
    """

    def gives(number: int) -> bool:
        """Return whether a condition determines a variable.

        Conditions that determine variables are removed last, because other conditions could hold for nonexistent values.
        """
        c = conditions[number]
        return isinstance(c, ValueCondition) and not c.negated and c.value.startswith("?") and c.value not in terms

    def fewest(part: Sequence[int], facts: LoggedState, limit: int) -> tuple[int, ...] | None:
        """Return the smallest set of at most `limit` conditions in `part` without which the others hold, or None."""
        for without in (c for size in range(min(len(part), limit) + 1) for c in combinations(part, size)):
            if rules.satisfied([conditions[i] for i in part if i not in without], terms, kinds, facts) is not None:
                return without
        return None

    limit = MOST_LACKING if most is None else min(most, MOST_LACKING)
    order = sorted(range(len(conditions)), key=gives)
    found: list[tuple[tuple[int, ...], LoggedState]] = []
    for facts in views:
        without: tuple[int, ...] | None = ()
        for part in _independent(conditions, order, terms):
            more = None if without is None else fewest(part, facts, limit - len(without))
            without = None if without is None or more is None else (*without, *more)
        if without is not None:
            found.append((tuple(sorted(without, key=order.index)), facts))
    if found:
        without, facts = min(found, key=lambda one: (len(one[0]), [order.index(i) for i in one[0]]))
        bindings = rules.satisfied([c for i, c in enumerate(conditions) if i not in without], terms, kinds, facts)
        assert bindings is not None
        return bindings, tuple(substituted(conditions[i], bindings) for i in sorted(without))
    alone = [c for c in conditions if all(rules.satisfied([c], terms, kinds, facts) is None for facts in views)]
    return terms, tuple(substituted(condition, terms) for condition in alone)


def _independent(conditions: Sequence[Condition], order: Sequence[int], terms: Bindings) -> list[list[int]]:
    """Return the positions of conditions in groups without common variables; each group has the given order."""
    groups: list[tuple[set[str], set[int]]] = []
    for number in order:
        free = {term for term in mentions(conditions[number]) if is_variable(term) and term not in terms}
        joined, apart = [g for g in groups if g[0] & free], [g for g in groups if not g[0] & free]
        groups = [*apart, (free.union(*(g[0] for g in joined)), {number}.union(*(g[1] for g in joined)))]
    return [sorted(numbers, key=order.index) for _, numbers in groups]

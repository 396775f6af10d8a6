"""The purpose of each step of a plan: causal links to the goal, to the step above it, or to a later step.

A later step needs an earlier step of the same level if the later step depends on a fact that the earlier step makes true. If the
fact's symbol had its previous value, the later step would be inapplicable or lose a required effect. Because the later step is
tested with the previous value, causal links are found for any kind of condition, for example "no object stands on the shelf". The
checker (`confab.planner.validation`) rejects a plan without a needed step. Each level has a separate sequence of steps. Where the
plan leaves a level, lower-level steps replace the steps of the level. The facts that a step reads are recorded, and only these
facts are reset to their previous values. Therefore the effort grows with the number of facts that the steps read, and not with the
square of the plan's length.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from functools import partial
from operator import itemgetter
from typing import TypeVar

from confab.planner.checked_conditions import Arguments
from confab.planner.plan import Plan, Step
from confab.planner.validation import BehaviorReader, Cell, LoggedState
from confab.reasoner.amounts import meets
from confab.reasoner.language import substituted
from confab.reasoner.limits import check
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import FALSE, TRUE, Condition, Fact, Symbol, ValueCondition

Path = tuple[int, ...]
T = TypeVar("T")


class NeedKind(Enum):
    """The kind of need for a fact."""

    GOAL = "goal"  # a goal
    ABOVE = "above"  # an effect, or an unchanged fact, of the step above
    REST = "rest"  # the rest value of a symbol that was changed
    LATER = "later"  # a precondition of a later step of the same level, or a fact on which its effects depend


@dataclass(frozen=True)
class FactChange:
    """A fact that a step makes true, with the previous value of its symbol."""

    fact: Fact
    before: str


@dataclass(frozen=True)
class Need:
    """A need for some of the facts that a step makes true.

    `gives` lists the facts that are needed. `by` is the path of the step that needs the facts; the path is empty for
    the goal and for rest values at the end of the plan. `conditions` lists the ground preconditions of the later step
    that fail without the facts; the list is empty if only the later step's effects would differ. For a goal,
    `conditions` lists the defined goals that follow from the facts.
    """

    kind: NeedKind
    gives: tuple[FactChange, ...]
    by: Path = ()
    conditions: tuple[Condition, ...] = ()


@dataclass(frozen=True)
class Purpose:
    """The facts that a step makes true on its level, and the needs for them, nearest first; without needs, it is superfluous."""

    gives: tuple[FactChange, ...]
    needs: tuple[Need, ...]


def purposes(problem: Problem, plan: Plan) -> dict[Path, Purpose]:
    """Return the purpose of every step of a valid plan, by its path."""
    gives: dict[Path, tuple[FactChange, ...]] = {}
    needs: dict[Path, list[Need]] = {step.path: [] for step in plan.walk()}
    for level in sorted({step.level for step in plan.walk()}):
        course = _LevelExecution(problem, plan, level)
        for path, need in course.links():
            if need not in needs[path]:
                needs[path].append(need)
        gives |= course.gives
    return {path: Purpose(gives[path], tuple(sorted(found, key=_nearest(path)))) for path, found in needs.items()}


def _nearest(path: Path) -> Callable[[Need], tuple[int, Path]]:
    """Return the sort key of a step's needs.

    The order is: the goal, conditions of steps of the same refinement, the step above, other steps, rest values.
    """
    order = {NeedKind.GOAL: 0, NeedKind.ABOVE: 2, NeedKind.REST: 4}

    def key(need: Need) -> tuple[int, Path]:
        beside = need.by[:-1] == path[:-1] and need.conditions
        return order.get(need.kind, 1 if beside else 3), need.by

    return key


def on_level(steps: Iterable[Step], level: int) -> Iterator[Step]:
    """Yield the steps of a level in order, and where the plan leaves the level, the lower-level steps in their place."""
    for step in steps:
        if step.level >= level or not step.steps:
            yield step
        else:
            yield from on_level(step.steps, level)


class _NeedRecorder(LoggedState):
    """A view of the facts that records two kinds of reads: the value of a symbol, and all symbols with a given value."""

    def __init__(self, problem: Problem, state: Mapping[Symbol, str]) -> None:
        super().__init__(problem, state)
        self.cells: dict[Cell, None] = {}
        self.of_value: dict[tuple[str, str], None] = {}

    def value(self, situation: str, arguments: Arguments) -> str | None:
        self.cells[situation, arguments] = None
        return super().value(situation, arguments)

    def holders(self, situation: str, value: str) -> Iterable[Arguments]:
        self.of_value[situation, value] = None
        return list(super().holders(situation, value))


class _LevelExecution:
    """The steps of one level, executed in order."""

    def __init__(self, problem: Problem, plan: Plan, level: int) -> None:
        self.problem, self.level = problem, level
        self.steps = list(on_level(plan.steps, level))
        self.rules = BehaviorReader(problem)
        self.facts = _NeedRecorder(problem, problem.initial)
        self.written: dict[
            Cell, dict[int, str]
        ] = {}  # the steps that gave a symbol its value, with its value without each step
        self.having: dict[tuple[str, str], dict[Cell, None]] = {}  # symbols that have or had a value, by value
        self.gives: dict[Path, tuple[FactChange, ...]] = {}
        self.groups = {step.path: step for step in plan.walk() if step.steps and _least(step.steps) == level}
        self.whole = plan.steps if _least(plan.steps) == level else ()

    def links(self) -> Iterator[tuple[Path, Need]]:
        """Yield each needed step with its need."""
        found: list[tuple[Path, Need]] = []
        deeds: list[tuple[int, int, tuple[FactChange, ...], frozenset[Cell]]] = []
        open_: dict[Path, tuple[int, int, dict[Cell, str]]] = {}
        for number, step in enumerate(self.steps):
            check("explaining the plan")
            for path, group in self.groups.items():
                if group.steps[0].path == step.path:
                    open_[path] = number, len(self.facts.log), self.changes(group) or {}
            for writer, changes, conditions, differs in sorted(self.needs_of(step), key=itemgetter(0)):
                if conditions or not differs:
                    found.append((self.steps[writer].path, Need(NeedKind.LATER, changes, step.path, conditions)))
                else:
                    deeds.append((writer, number, changes, differs))
            self.done(number, step)
            for path in [path for path in open_ if self.groups[path].steps[-1].path == step.path]:
                first, mark, wanted = open_.pop(path)
                found += self.left(path, self.groups[path].level, first, mark, wanted)
        if self.whole:
            goal = {(symbol.situation, symbol.arguments): value for symbol, value in self.problem.goal.items()}
            found += self.left((), 0, 0, 0, goal)
            found += [need for cell, value in goal.items() for need in self.derivation_givers(cell, value)]
        needed = {(path, change.fact.symbol) for path, need in found for change in need.gives}
        for writer, number, changes, differs in reversed(deeds):
            step = self.steps[number]
            if any((step.path, Symbol(*cell)) in needed for cell in differs):
                found.append((self.steps[writer].path, Need(NeedKind.LATER, changes, step.path)))
                needed |= {(self.steps[writer].path, change.fact.symbol) for change in changes}
        yield from found

    def changes(self, step: Step) -> dict[Cell, str] | None:
        """Return the changes of a step in the current state, of joint steps one after another; None if it isn't applicable."""
        found: dict[Cell, str] = {}
        applicable = True
        for _, made in self.in_turn(step):
            applicable = made is not None
            found |= made or {}
        return found if applicable else None

    def in_turn(self, step: Step) -> Iterator[tuple[Step, dict[Cell, str] | None]]:
        """Yield each of the steps that are refined together, with its changes in the state after the steps before it.

        The changes of an inapplicable step are None, and no step follows it. After the last step, the facts have their previous
        values again.
        """
        mark = len(self.facts.log)
        for one in step.together:
            found = self.rules.changes(self.problem.domain.behaviors[one.behavior], one.arguments, self.facts)
            yield one, None if found is None else {(situation, key): value for situation, key, value in found}
            if found is None:
                break
            for change in found if step.joined else ():
                self.facts.put(*change)
        self.facts.undo(mark)

    def needs_of(
        self, step: Step
    ) -> Iterator[tuple[int, tuple[FactChange, ...], tuple[Condition, ...], frozenset[Cell]]]:
        """Yield the steps that a step needs, with the conditions or symbols that would differ without the needed step."""
        before, read = self.with_reads(lambda: self.changes(step) or {})
        given: list[FactChange] = []
        for cell, value in before.items():
            if (old := self.facts.value(*cell)) is not None and old != value:
                given.append(FactChange(Fact(Symbol(*cell), value), old))
        self.gives[step.path] = tuple(given)
        bound = [self.bindings(one) for one, _ in self.in_turn(step)]
        for writer, without in self.writers_that_matter(
            read, lambda without: self.failures_without(step, without, before, bound)
        ):
            yield writer, *without

    def with_reads(self, result: Callable[[], T]) -> tuple[T, dict[Cell, None]]:
        """Return a result of the current state, and the written symbols that its calculation reads."""
        self.facts.cells, self.facts.of_value = {}, {}
        found = result()
        read = dict.fromkeys(cell for cell in self.facts.cells if cell in self.written)
        for wanted in self.facts.of_value:
            read.update(self.having.get(wanted, {}))
        return found, read

    def writers_that_matter(
        self, read: Iterable[Cell], result: Callable[[Mapping[Cell, str]], T | None]
    ) -> Iterator[tuple[int, T]]:
        """Yield the steps without whose changes of some symbols a result would differ, with the result for these values.

        The symbols that a step has written are tested one by one, and together if none of them matters alone. The tests may read
        further symbols of the step: those of another alternative. If the last change of a symbol doesn't matter, the change before
        it is tested.
        """
        by: dict[int, dict[Cell, str]] = {}
        for cell in read:
            for giver, before in self.written[cell].items():
                by.setdefault(giver, {})[cell] = before
        settled = set[Cell]()
        for writer, written in sorted(by.items(), reverse=True):
            without = {cell: before for cell, before in written.items() if cell not in settled}
            found, further = dict[tuple[Cell, ...], T](), dict[Cell, None]()
            groups: list[dict[Cell, str]] = [{cell: before} for cell, before in without.items()]
            while groups:
                for group in groups:
                    one, cells = self.with_reads(partial(result, group))
                    further |= cells
                    if one is not None:
                        found[tuple(group)] = one
                more = {cell: self.written[cell][writer] for cell in further if writer in self.written[cell]}
                wider = without | {cell: before for cell, before in more.items() if cell not in settled}
                groups = [wider] if not found and len(wider) > max(1, *map(len, groups)) else []
            settled.update(cell for cells in found for cell in cells if not self.counted(cell))
            yield from ((writer, one) for one in found.values())

    @contextmanager
    def reset(self, without: Mapping[Cell, str]) -> Iterator[tuple[FactChange, ...]]:
        """Give some symbols the values `without` while the context is active; the context's value are their changes."""
        mark = len(self.facts.log)
        now = {cell: Fact(Symbol(*cell), str(self.facts.value(*cell))) for cell in without}
        for cell, before in without.items():
            self.facts.put(*cell, before)
        yield tuple(FactChange(fact, without[cell]) for cell, fact in now.items())
        self.facts.undo(mark)

    def bindings(self, step: Step) -> Mapping[str, str]:
        """Return the individuals of the parameters of a step, and of its variables in the current state."""
        behavior = self.problem.domain.behaviors[step.behavior]
        terms = {p.name: argument for p, argument in zip(behavior.parameters, step.arguments, strict=True)}
        return self.rules.satisfied(behavior.preconditions, terms, behavior.kinds, self.facts) or terms

    def failures_without(
        self, step: Step, without: Mapping[Cell, str], before: Mapping[Cell, str], bound: Sequence[Mapping[str, str]]
    ) -> tuple[tuple[FactChange, ...], tuple[Condition, ...], frozenset[Cell]] | None:
        """Return the conditions of a step that fail if symbols have the values `without`.

        `bound` are the bindings of each of the steps that are refined together. Return None if the values don't affect the step.
        """
        check("explaining the plan")
        after: dict[Cell, str] | None = {}
        broken: list[Condition] = []
        with self.reset(without) as changes:
            for (one, made), terms in zip(self.in_turn(step), bound, strict=False):
                after = None if after is None or made is None else after | made
                if made is None:
                    preconditions = self.problem.domain.behaviors[one.behavior].preconditions
                    grounded = [substituted(condition, terms) for condition in preconditions]
                    broken = [c for c in grounded if self.rules.satisfied([c], {}, {}, self.facts) is None]
        if after is None:
            return changes, tuple(broken), frozenset()
        differs = frozenset(
            cell
            for cell, value in before.items()
            if after.get(cell) != value and (cell not in without or self.counted(cell))
        )
        return (changes, (), differs) if differs else None

    def givers(self, number: int, step: Step, cell: Cell, now: str) -> dict[int, str]:
        """Return the steps that gave a symbol its value `now`, with the value that `step` would leave without each of them.

        The givers of an amount are the last step that increased and the last step that decreased it. The other givers are `step`,
        and the last step that ended each other earlier value. The state is the one before `step`.
        """
        before = str(self.facts.value(*cell))
        found = {number: before}
        if not self.counted(cell):
            found |= {giver: old for giver, old in self.written.get(cell, {}).items() if old not in (before, now)}
        elif before != now:
            rises = Fraction(before) < Fraction(now)
            for giver, old in self.written.get(cell, {}).items():
                if (Fraction(old) < Fraction(before)) != rises:
                    mark = len(self.facts.log)
                    self.facts.put(*cell, old)
                    self.execute(step)
                    without = str(self.facts.value(*cell))
                    self.facts.undo(mark)
                    found |= {giver: without} if without != now else {}
        return found

    def execute(self, step: Step) -> None:
        """Execute a step with all its sub-steps."""
        for primitive in Plan((step,)).primitives:
            for cell, value in (self.changes(primitive) or {}).items():
                self.facts.put(*cell, value)

    def counted(self, cell: Cell) -> bool:
        """Return whether a symbol has an amount; a step that changes an amount depends on the previous amount."""
        return self.problem.domain.situations[cell[0]].quantity is not None

    def done(self, number: int, step: Step) -> None:
        """Execute a step with all its sub-steps, and record the symbols that the step changed."""
        mark = len(self.facts.log)
        self.execute(step)
        after = {cell: (before, str(self.facts.value(*cell))) for cell, before in self.facts.since(mark).items()}
        self.facts.undo(mark)
        givers = {cell: self.givers(number, step, cell, now) for cell, (_, now) in after.items()}
        self.execute(step)
        for cell, (before, now) in after.items():
            for value in (*self.written.get(cell, {}).values(), before):
                self.having.get((cell[0], value), {}).pop(cell, None)
            self.written[cell] = givers[cell]
            for value in (*self.written[cell].values(), now):
                self.having.setdefault((cell[0], value), {})[cell] = None

    def left(
        self, path: Path, level: int, first: int, mark: int, wanted: Mapping[Cell, str]
    ) -> Iterator[tuple[Path, Need]]:
        """Yield each fact that sub-steps achieve for their parent (the plan on level 0), and the step that achieves the fact."""
        touched = dict[Cell, str]()
        for situation, arguments, old in self.facts.log[mark:]:
            touched.setdefault((situation, arguments), old)
        for cell, begun in touched.items():
            symbol, value = Symbol(*cell), str(self.facts.value(*cell))
            kind = self.problem.domain.situations[symbol.situation]
            if cell in wanted and meets(value, wanted[cell]):
                why = NeedKind.ABOVE if level else NeedKind.GOAL
            elif level and value == begun and self.problem.sees(level, symbol, begun):
                why = NeedKind.ABOVE
            elif value == kind.rest and level < self.problem.first_level(symbol) <= self.level:
                why = NeedKind.REST
            else:
                continue
            givers = self.written.get(cell, {})
            for giver in givers if self.counted(cell) else [max(givers, default=-1)]:
                without = givers.get(giver, value)
                met = why is not NeedKind.REST and self.counted(cell) and meets(without, wanted.get(cell, value))
                if giver >= first and not met:
                    yield self.steps[giver].path, Need(why, (FactChange(Fact(symbol, value), without),), path)

    def derivation_givers(self, cell: Cell, wanted: str) -> Iterator[tuple[Path, Need]]:
        """Yield the steps whose facts the derivation of a defined goal reads, and without which the goal wouldn't hold."""
        if cell[0] not in self.problem.domain.rules:
            return
        _, read = self.with_reads(lambda: self.facts.value(*cell))

        def lacking(without: Mapping[Cell, str]) -> tuple[FactChange, ...] | None:
            with self.reset(without) as changes:
                return changes if self.facts.value(*cell) != wanted else None

        for writer, changes in self.writers_that_matter(read, lacking):
            condition = ValueCondition(cell[0], cell[1], TRUE, wanted == FALSE)
            yield self.steps[writer].path, Need(NeedKind.GOAL, changes, (), (condition,))


def _least(steps: Sequence[Step]) -> int:
    """Return the most abstract level among steps of the same parent."""
    return min((step.level for step in steps), default=0)

"""Goals in series: each by a few relevant steps on one table, and what was achieved before is kept.

active   goals to try in one step
asleep   goals that something stands in the way of; they wake when a symbol that they wait for changes
kept     goals that are achieved: a segment may undo them, but must restore them
before   goals after which others could no longer be achieved (a full cup isn't moved) wait for those

When no goal is attainable in one step, longer segments are searched, then segments on the level below, for one goal after the
other. Steps are refined and done as soon as a segment is found, so that a step which can't be refined is noticed where it stands,
forbidden there, and the segment searched again.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, TypeAlias, TypeVar

from planner.hierarchical.operators import Achiever, Program
from planner.hierarchical.refinement_cache import RefinedStep, Refiner, Template
from planner.hierarchical.subplans import Effort, LimitError, Segments
from planner.hierarchical.subproblem import Width
from planner.hierarchical.unsolvability import impossible
from planner.plan import Outcome, OutOfTimeError, Plan, Reason, Status, Step, TooLargeError
from planner.transitions import Cell, Table, arguments_of, key_of
from reasoner.amounts import meets
from reasoner.symbols import FALSE, Condition, Fact, Problem, State, Symbol

if TYPE_CHECKING:
    from planner.grounded.reachability import Reached

EASY, LONGER = Effort(depth=1, expansions=10), Effort(depth=3, expansions=150)
"""For a goal that one step achieves, and for one that a few relevant steps do."""
FEW_OPERATORS, FEW_STATES = 300, 6_000
"""The smallest problems, of which every state is looked at before the greater efforts."""
MOST_TOGETHER = 20_000
"""The largest level, in quantified behaviours, on which all goals are searched at once."""
ALL, SOME = (Width(None, 1, 10_000_000),), (Width(None, 1, 100_000),)
"""All goals at once in the whole world; the second where a plan is known, and a shorter one is looked for."""
ANEW = (Width(None, 1, 1_500_000),)
"""All goals at once from the beginning, on the most abstract level: the goals reached so far may be in the way for good."""
Attempt: TypeAlias = "Effort | Sequence[Width]"
Done = TypeVar("Done")
COSTLY = 4
"""From so many goals that need more than a few steps on, the observer is told."""
MOST_ROWS, MOST_CHANGES = 2_000_000, 10_000_000
"""The largest join of relaxed reachability (some 200 MB), and the most changes of a level that is grounded (600 MB)."""


class UnsolvableError(Exception):
    """A proof that there is no plan came up; the reason is its argument."""

    def __init__(self, reason: Reason) -> None:
        super().__init__(reason.text)
        self.reason = reason


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


@dataclass
class Compiled:
    """What can be kept between calls on problems with the same domain, individuals and static facts."""

    program: Program
    templates: dict[str, list[Template]] = field(default_factory=dict)
    shapes: dict[object, Template | None] = field(default_factory=dict)


def compiled(problem: Problem) -> Compiled:
    """Compile the behaviours of a problem, for use in any number of calls with other initial states and goals."""
    return Compiled(Program(problem))


class Call:
    """One planning call: the table, what is achieved, what sleeps, and the steps done so far."""

    def __init__(self, problem: Problem, using: Compiled, deadline: float | None, most: int) -> None:
        self.problem = problem
        self.using = using
        self.program = using.program
        self.goal = {(s.situation, key_of(s.arguments)): value for s, value in problem.goal.items()}
        self.table = Table(problem.domain.situations, problem.initial)
        self.segments = Segments(self.program, self.table, self.goal, deadline, most)
        self.refiner = Refiner(self.segments, using.templates)
        self.kept = {cell: value for cell, value in self.goal.items() if self.met(cell)}
        self.rest = {
            (symbol.situation, key_of(symbol.arguments)): value
            for symbol, value in problem.initial.items()
            if self.segments.rest.get(symbol.situation) == value
        }
        first = self.program.levels[0]
        rests = {s.name: s.rest for s in problem.domain.situations.values()}
        self.unseen = {
            cell: value
            for cell, value in self.goal.items()
            if not self.segments.visible(first, cell) and rests[cell[0]] in (None, value)
        }
        """Goals unknown to the most abstract level, and free of rest values: its last step brings them about."""
        self.steps: list[RefinedStep] = []
        self.given_up: list[str] = []
        self.failed: dict[Cell, set[tuple[int, Attempt]]] = {}
        self.moved = False
        self.doubted = self.proved = False
        self.restarts = self.finished = 0
        self.gone_back = False
        self.wary = False
        self.tried: dict[int, int] = {}
        self.too_large: Reason | None = None
        self.ladder: list[tuple[int, Attempt]] = []
        for level in self.program.levels:
            *small, large = self.refiner.worlds(level)
            self.ladder += [(level, attempt) for attempt in (LONGER, (*small,), (large,), ALL)]

    def serialise(self) -> bool:
        """Achieve the goals one after the other; whether all are."""
        first = self.program.levels[0]
        active: deque[Cell] = deque()
        asleep: dict[Cell, None] = {}
        waiting: dict[Cell, list[Cell]] = {}
        before = self.order()
        active.extend(cell for cell in self.goal if cell not in self.kept)

        def sleep(cell: Cell, until: Sequence[Cell]) -> None:
            asleep[cell] = None
            for other in until:
                waiting.setdefault(other, []).append(cell)

        def wake(mark: int) -> None:
            for situation, key, _ in self.table.trail[mark:]:
                for cell in waiting.pop((situation, key), ()):
                    if cell in asleep:
                        del asleep[cell]
                        active.append(cell)
                        self.failed.pop(cell, None)
                cell = situation, key
                if cell in self.kept:
                    asleep.pop(cell, None)
                    if not self.met(cell):
                        del self.kept[cell]
                        active.append(cell)
                elif cell in asleep:
                    del asleep[cell]
                    active.append(cell)
            for cell in self.segments.defined:
                if cell in self.kept and not self.met(cell):
                    del self.kept[cell]
                    active.append(cell)
                elif cell in asleep and self.met(cell):
                    del asleep[cell]
                    active.append(cell)

        while active or asleep:
            mark = len(self.table.trail)
            while active:
                cell = active.popleft()
                self.segments.check_time()
                if self.met(cell):
                    self.kept[cell] = self.goal[cell]
                    continue
                unmet = [other for other in before.get(cell, ()) if other not in self.kept]
                if unmet:
                    sleep(cell, unmet)
                elif self.achieve(first, cell, EASY):
                    wake(mark)
                    mark = len(self.table.trail)
                else:
                    sleep(cell, self.segments.waits_for(first, cell, self.goal[cell]))
            restarts = self.restarts
            if asleep and not self.harder(asleep, before):
                return False
            if self.restarts > restarts:
                return self.serialise()
            wake(mark)
        return True

    def harder(self, asleep: dict[Cell, None], before: Mapping[Cell, Sequence[Cell]]) -> bool:
        """Achieve one of the sleeping goals by a longer segment, or by one on a lower level."""

        def candidates() -> Iterator[Cell]:
            none = True
            for cell in asleep:
                if all(other in self.kept for other in before.get(cell, ())):
                    none = False
                    yield cell
            if none:  # where goals wait for each other, none waits
                yield from asleep

        if not self.doubted:
            self.doubted = True
            reason = impossible(self.problem, self.program)
            if reason:
                raise UnsolvableError(reason)
        if self.unseen.keys() >= asleep.keys() and self.finish():
            self.restarts += 1
            return True
        for level, attempt in self.ladder:
            if attempt is not LONGER and len(self.goal) - len(self.kept) >= COSTLY:
                self.segments.watch(None)
            if attempt is ALL:
                if self.together(level):
                    return True
                continue
            for cell in candidates():
                if (level, attempt) in self.failed.get(cell, ()):
                    continue
                if self.achieve(level, cell, attempt):
                    return True
                self.failed.setdefault(cell, set()).add((level, attempt))
                if not isinstance(attempt, Effort):
                    self.prove()
                    if not self.gone_back:
                        self.gone_back = True
                        if self.retreat() or self.anew(self.program.levels[:1], ANEW):
                            self.restarts += 1
                            return True
        if self.moved:  # something was done since some of these attempts failed
            self.failed.clear()
            self.moved = False
            return self.harder(asleep, before)
        return False

    def finish(self) -> bool:
        """Do the last step again so that it brings about what its level doesn't see, too; else all is as it was."""
        steps = self.steps
        if not steps or steps[-1].level != self.program.levels[0] or self.finished > len(self.goal):
            return False
        self.finished += 1  # what is done after that may undo it, but not for ever
        self.redo(steps[:-1])
        self.refiner.besides = self.unseen
        last = self.refiner.do(*steps[-1][:3])
        self.refiner.besides = {}
        if last is None:
            self.redo(steps)
            return False
        self.steps = [*steps[:-1], last]
        self.kept.update(self.unseen)
        return True

    def anew(self, levels: Sequence[int], width: Attempt = ALL) -> bool:
        """Achieve all goals at once from the beginning, where taking them in series has led astray; else all is as it was."""
        if not self.steps:
            return False  # nothing has led anywhere
        steps, given_up, kept, tried = self.steps, self.given_up, self.kept, self.tried
        self.table.undo(0)
        self.steps, self.given_up, self.tried = [], [], {}
        self.kept = {cell: value for cell, value in self.goal.items() if self.met(cell)}
        if any(self.together(level, width) for level in levels):
            return True
        self.redo(steps)
        self.steps, self.given_up, self.kept, self.tried = steps, given_up, kept, tried
        return False

    def retreat(self) -> bool:
        """Go back to where all goals could still be reached, and do the step that led astray so that they can be from there, too.

        A key that lies in the room that it unlocks: no level above sees that. Whether all can be reached from there on; else all
        is as it was.
        """
        if not self.refiner.drifting or not self.steps or self.hopeful():
            return False
        steps = self.steps
        low, high = 0, len(steps)
        while high - low > 1:
            middle = (low + high) // 2
            self.redo(steps[:middle])
            low, high = (middle, high) if self.hopeful() else (low, middle)
        self.redo(steps[:low])
        mark = len(self.table.trail)
        self.refiner.again(steps[low])
        step = self.tidily(mark, lambda: self.refiner.do(*steps[low][:3]))
        if step is None:
            self.redo(steps)
            return False
        self.wary = True
        self.steps = [*steps[:low], step]
        self.kept = {cell: value for cell, value in self.goal.items() if self.met(cell)}
        return True

    def hopeful(self) -> bool:
        """Whether every goal could be reached from here on the lowest level if nothing ever became false."""
        initial = {**self.problem.initial, **self.table.state()}
        if any(s.quantity is not None for s in self.problem.domain.situations.values()):
            return self.sufficient(initial)
        try:
            reached = closed(self.problem, self.program.levels[-1], self.segments.deadline, initial)
        except TooLargeError:
            return True
        except OutOfTimeError as error:
            raise LimitError("the time limit") from error
        return all(reached.possible(symbol, value) for symbol, value in self.problem.goal.items())

    def sufficient(self, initial: State) -> bool:
        """Whether every goal could be reached from a state if nothing became false and no amount were in the way of another."""
        from planner.grounded.grounding import ground
        from planner.grounded.hff_amounts import heuristic

        level, deadline = self.program.levels[-1], self.segments.deadline
        try:
            task = ground(self.problem, level, initial, most=MOST_ROWS, deadline=deadline)
        except TooLargeError:
            return True
        except OutOfTimeError as error:
            raise LimitError("the time limit") from error
        if isinstance(task, Reason) or task.amounts is None:
            return not isinstance(task, Reason)
        return heuristic(task)(task.initial) is not None

    def tidily(self, mark: int, do: Callable[[], Done | None]) -> Done | None:
        """Do once more what was done since a mark, so that all goals can be reached; None, and the table as at the mark, if not.

        Of what was left in another state than at the mark, and might be anything, only that is left as it was which has to be.
        """
        table = self.table
        after = table.since(mark)
        table.undo(mark)
        free = [cell for cell in after if not self.segments.visible(self.program.levels[0], cell)]
        needed = set(free)
        for cell in free:
            table_mark = len(table.trail)
            for other, value in after.items():
                if other == cell or other not in needed:
                    table.put(*other, value)
            if self.hopeful():
                needed.discard(cell)
            table.undo(table_mark)
        self.segments.tidy = frozenset(needed)
        try:
            done = do()
        finally:
            self.segments.tidy = frozenset()
        if done is None or self.hopeful():
            return done
        table.undo(mark)
        return None

    def redo(self, steps: Sequence[RefinedStep]) -> None:
        """Do steps from the beginning in place of those done so far."""
        self.table.undo(0)
        for step in steps:
            self.refiner.again(step)

    def at_rest_in_the_end(self) -> Problem:
        """Return the problem with the rest values of what rests in the beginning as goals, for planners that know no levels."""
        rest = {Symbol(s, arguments_of(key)): value for (s, key), value in self.rest.items()}
        return replace(self.problem, goal={**rest, **self.problem.goal})

    def prove(self) -> None:
        """Raise `UnsolvableError` if a goal can't be reached on the lowest level even if nothing ever became false."""
        from planner.grounded.grounding import ground
        from planner.grounded.shortest import shortest
        from planner.grounded.unreachable import unreachable

        if not self.proved:
            self.proved = True
            level, deadline = self.program.levels[-1], self.segments.deadline
            try:
                reached = closed(self.problem, level, deadline)
                for symbol, value in sorted(self.problem.goal.items()):
                    if not reached.possible(symbol, value):
                        raise UnsolvableError(unreachable(reached, Fact(symbol, value)))
                self.segments.watch(None)
                self.too_large = refusal(reached)
                if self.too_large is not None:
                    return
                task = ground(self.problem, level, deadline=deadline)
            except TooLargeError as error:
                self.too_large = Reason(f"level {level} is too large to be grounded: {error}")
                return
            except OutOfTimeError as error:
                raise LimitError("the time limit") from error
            if isinstance(task, Reason):
                raise UnsolvableError(task)
            if len(task) <= FEW_OPERATORS:
                most = FEW_STATES // (1 + len(task.derived.parts) // 10)  # a state costs what follows from it, too
                found = shortest(task, most=most, deadline=deadline)
                if found.plan is None and found.bound == math.inf:
                    raise UnsolvableError(
                        Reason(f"all {found.states} states of level {level} that can be reached were looked at")
                    )

    def achieve(self, level: int, cell: Cell, attempt: Attempt) -> bool:
        """Achieve one goal and keep the others, by steps of a level that are refined and done; whether that succeeded."""
        return self.reach(level, {cell: self.goal[cell]}, attempt)

    def together(self, level: int, width: Attempt = ALL) -> bool:
        """Achieve all goals at once on a level, from here; whether that succeeded, and not tried twice from one state."""
        if self.program.size(level) > MOST_TOGETHER or self.tried.get(level) == len(self.steps):
            return False
        self.tried[level] = len(self.steps)
        return self.reach(level, {c: v for c, v in self.goal.items() if not self.met(c)}, width)

    def reach(self, level: int, targets: dict[Cell, str], attempt: Attempt) -> bool:
        """Do refined steps of a level after which the targets and all goals reached before hold; whether there are some."""
        first = level == self.program.levels[0]
        hidden = self.unseen if first else {}  # seldom any: no copy of all goals for each of them
        kept = {c: v for c, v in self.kept.items() if c not in hidden} if hidden else self.kept
        keep = self.segments.keeping(kept)
        mark = len(self.table.trail)
        steps = self.refiner.achieve(level, targets, keep, (), attempt)
        if steps is not None and self.wary and not self.hopeful():
            steps = self.tidily(mark, lambda: self.refiner.achieve(level, targets, keep, (), attempt))
        if steps is None:
            return False
        self.steps.extend(steps)
        self.moved = True
        self.kept.update(targets)
        if not first:
            goals = ", ".join(str(Fact(Symbol(c[0], arguments_of(c[1])), v)) for c, v in targets.items())
            self.given_up.append(
                f"level {self.program.levels[0]} was given up for {goals}: no steps of it were found that can be refined; "
                f"steps of level {level} stand there"
            )
        return True

    def met(self, cell: Cell) -> bool:
        """Whether a goal holds now."""
        return meets(self.table.now[cell[0]].get(cell[1], FALSE), self.goal[cell])

    def order(self) -> dict[Cell, list[Cell]]:
        """Return for each goal those that must come before it: once it holds, they couldn't be achieved any more."""
        by_individual: dict[str, list[Cell]] = {}
        for cell in self.goal:
            plain = cell[0] not in self.program.rules and self.problem.domain.situations[cell[0]].quantity is None
            if cell not in self.kept and plain:
                for individual in {*arguments_of(cell[1]), self.goal[cell]}:
                    by_individual.setdefault(individual, []).append(cell)
        before: dict[Cell, list[Cell]] = {}
        known: dict[tuple[str, str, int], bool] = {}
        for cells in by_individual.values():
            for cell in cells:
                for other in cells:
                    if cell is not other:
                        pattern = cell[0], other[0], self.program.alike.sort.get(arguments_of(cell[1])[0], -1)
                        if pattern not in known:
                            known[pattern] = self.rules_out(other, cell)
                        if known[pattern]:
                            before.setdefault(other, []).append(cell)
        return before

    def rules_out(self, first: Cell, then: Cell) -> bool:
        """Whether with goal `first` achieved, no behaviour of the first level could achieve goal `then` any more."""
        level = self.program.levels[0]
        mark = len(self.table.trail)
        self.table.put(*first, self.goal[first])
        try:
            dead = False
            for achiever in self.program.achievers.get((level, then[0]), ()):
                achieve = self.segments.achieve[achiever.behavior, achiever.effect]
                for _, unmet, env in achieve(*arguments_of(then[1]), self.goal[then]):
                    if all(self.attainable(level, achiever.soft[number], achiever, env) for number in unmet):
                        return False
                    dead = True
            return dead
        finally:
            self.table.undo(mark)

    def attainable(self, level: int, condition: Condition, achiever: Achiever, env: Mapping[str, str | None]) -> bool:
        """Whether some behaviour of a level has an effect that could bring an unmet condition about."""
        for situation, key, values in self.segments.wants.of(achiever, condition, env, level):
            for other in self.program.achievers.get((level, situation), ()):
                for value in values:
                    achieve = self.segments.achieve[other.behavior, other.effect]
                    if next(achieve(*arguments_of(key), value), None) is not None:
                        return True
        return False

    def outcome(self, status: Status, plan: Plan | None, reason: Reason | None, seconds: float) -> Outcome:
        """Return how the call ended, with what it counted."""
        cache, given_up = self.refiner, tuple(self.given_up)
        return Outcome(
            status,
            plan,
            reason,
            self.segments.counts,
            len(given_up),
            seconds,
            hits=cache.hits,
            misses=cache.misses,
            given_up=given_up,
        )

    def tree(self) -> Plan:
        """Return the steps done as a plan."""
        id_of, variables = self.program.problem.id_of, self.program.variables

        def step(done: RefinedStep, path: tuple[int, ...]) -> Step:
            level, name, arguments, bindings, below = done
            bound = dict(zip(variables[name], bindings, strict=True)) if bindings else {}
            inner = tuple([step(child, (*path, i)) for i, child in enumerate(below)])
            return Step(path, id_of(name, arguments), level, name, arguments, bound, None, inner)

        return Plan(tuple([step(done, (i,)) for i, done in enumerate(self.steps)]))

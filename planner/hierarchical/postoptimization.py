"""A plan made shorter: steps that concern the same things are planned anew together.

Both work below the most abstract level, where a step "hands empty again" costs something, and leave a step of the upper level
in the plan only where its own refinement is still intact. Every change is played through on the table before it is kept.
What the levels above ask of a change is asked of steps that are planned anew, too
(`confab.planner.hierarchical.inherited_preconditions`).

whole    a task so small that its states are few is planned anew as a whole, one level above the lowest
cluster  steps close together that change the same symbols, or one of which takes the place that another leaves
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from confab.planner.hierarchical.concerns import Concern, concerns, put_aside
from confab.planner.hierarchical.inherited_preconditions import binding
from confab.planner.hierarchical.refinement_cache import RefinedStep, Refiner, Template
from confab.planner.hierarchical.subplans import Ground
from confab.planner.hierarchical.subproblem import FEW, problem_of
from confab.planner.plan import Reason, UngroundableError
from confab.planner.transitions import Cell, arguments_of, key_of
from confab.reasoner.symbols import Domain, Problem, Symbol

PER_PRIMITIVE = 3
"""So many steps of the most abstract level are given up for a primitive less, at most: they say what the primitives are for."""
REACH = 30
"""So many steps ahead a cluster looks for steps that concern it."""
LARGEST = 7
"""So many steps a cluster has at most."""
OPERATORS = 400
"""The largest world in which steps are planned anew, in operators; in rows of a join on the way to them fifty times as many."""
STATES = 2_500
"""So many states are expanded for each cluster allowed."""
WHOLE_BITS = 48
"""The largest world that is planned anew as a whole, in bits of a state if every symbol could take every value."""


def length(steps: Sequence[RefinedStep], level: int | None = None) -> int:
    """Return the number of primitives, or of steps at a level."""
    return sum(length(step[4], level) if step[4] and step[0] != level else 1 for step in steps)


def worth_it(old: Sequence[RefinedStep], new: Sequence[RefinedStep]) -> bool:
    """Whether new steps are shorter by enough for the steps of the most abstract level that they give up."""
    first = min(step.level for step in old) if old else 0
    given_up = [sum(step.level == first for step in steps) for steps in (old, new)]
    return worth(length(old) - length(new), given_up[0] - given_up[1])


def worth(saved: int, given_up: int) -> bool:
    """Whether primitives that are saved are worth the steps of the most abstract level that are given up for them."""
    return saved > max(given_up, 0) / PER_PRIMITIVE


@dataclass
class Improver:
    """Shortens the plan that a refiner has done; its table must be in the initial state.

    Parameters
    ----------
    refiner : Refiner
    known : dict
        For each shape of a cluster the steps that replace it, or None; kept between calls.
    clusters_left : int
        So many shapes of clusters may be planned anew, in worlds as much larger, with an effort of `STATES` for each.
    """

    refiner: Refiner
    known: dict[object, Template | None]
    clusters_left: int

    def __post_init__(self) -> None:
        self.table = self.refiner.table
        self.segments = self.refiner.segments
        self.work = STATES * self.clusters_left
        self.lowest = self.segments.program.levels[-1]
        self.bound: dict[int, Domain] = {}

    def improve(self, steps: Sequence[RefinedStep], known: Sequence[Concern] = ()) -> list[RefinedStep]:
        """Return steps to the same end, no longer than these; the table is left in the initial state.

        What they concern is looked for here if it isn't given.
        """
        best = list(steps)
        self.table.undo(0)
        anew = self.whole(best)
        self.table.undo(0)
        if anew is not None:
            return anew if worth_it(best, anew) else best
        found = self.clusters(known or concerns(self.refiner, best))
        self.table.undo(0)
        return found if worth_it(best, found) else best

    # ------------------------------------------------------------------------------------------------------------ whole

    def whole(self, steps: Sequence[RefinedStep]) -> list[RefinedStep] | None:
        """Return all planned anew, the same steps if that is no shorter, None if the world isn't small or refining fails.

        What these steps leave as it was is left so, too.
        """
        problem, levels = self.segments.program.problem, self.segments.program.levels
        if len(levels) < 2:
            return None  # there is no level above the lowest that could be planned anew
        level = levels[-2]
        changing = {effect.situation for behavior in problem.domain.at_level(level) for effect in behavior.effects}
        kinds = {situation: problem.domain.situations[situation].range for situation in changing}
        bits = sum(
            len(problem.classes.get(kind, ())).bit_length() * len(self.table.now[s]) for s, kind in kinds.items()
        )
        if bits > WHOLE_BITS or not all(self.refiner.redo(step) for step in steps):
            return None
        targets = self.table.since(0)
        self.table.undo(0)
        initial = {
            symbol: value
            for symbol, value in self.table.state().items()
            if problem.domain.situations[symbol.situation].level <= level
        }
        goal = {s: value for s, value in initial.items() if (s.situation, key_of(s.arguments)) not in targets}
        goal |= {Symbol(s, arguments_of(key)): value for (s, key), value in self.segments.goal.items()}
        shortest = self._shortest(replace(problem, initial=initial, goal=goal), level, steps)
        if not shortest:
            return None if shortest is None else list(steps)
        found = []
        for name, arguments in shortest:
            step = self.refiner.do(level, name, arguments)
            if step is None:
                return None
            found.append(step)
        return found

    def _shortest(self, problem: Problem, level: int, old: Sequence[RefinedStep]) -> list[Ground] | None:
        """Return the fewest steps of a level, empty if there are no fewer than of old ones; None if that takes too much."""
        from confab.planner.grounded.grounding import ground
        from confab.planner.grounded.shortest import shortest, ways

        problem = replace(problem, domain=self._binding(level))
        try:
            task = ground(problem, level, most=50 * OPERATORS, deadline=self.segments.deadline)
        except UngroundableError:
            return None
        if isinstance(task, Reason) or len(task) > OPERATORS:
            return None
        task = replace(task, costs=[1.0] * len(task), prices={})
        upper = length(old, level)
        found = shortest(task, ways(task), upper, self.work, self.segments.deadline)
        self.work -= len(found.states)
        if found.plan is not None:
            return [task.describe(operator)[:2] for operator in found.plan]
        return [] if found.bound >= upper else None

    def _binding(self, level: int) -> Domain:
        if level not in self.bound:
            self.bound[level] = binding(self.segments.program.problem, level)
        return self.bound[level]

    # --------------------------------------------------------------------------------------------------------- clusters

    def clusters(self, concerns: Sequence[Concern]) -> list[RefinedStep]:
        """Plan each cluster of the steps that concern these anew, one level further down, and keep what is shorter."""
        rest = list(concerns)
        steps = [concern.step for concern in rest]
        if all(len(self._cluster(rest, position)) == 1 for position in range(len(rest))):
            return steps
        found: list[RefinedStep] = []
        position, disturbed = 0, 0  # up to the second, steps are done in other states than they were
        while position < len(rest):
            self.segments.check_time()
            members = self._cluster(rest, position)
            replaced = self._replace([c.step for c in rest[position : members[-1] + 1]], members, position)
            if replaced is not None:
                found.extend(replaced)
                disturbed = max(disturbed, members[-1] + 1)
                between = [rest[p] for p in range(position, members[-1] + 1) if p not in members]
                position = members[-1] + 1 - len(between)
                rest[position : members[-1] + 1] = between
                continue
            step = rest[position].step
            if position < disturbed:
                again = self.refiner.again(step)
                if again is None:
                    return steps
                step = again
            else:
                self.table.put_all(rest[position].after)
            found.append(step)
            position += 1
        return found

    def _cluster(self, steps: Sequence[Concern], first: int) -> list[int]:
        """Return the positions of a step and of those soon after it that concern the same individuals.

        Only the step itself, if none of them puts anything aside: each then does something that must be done.
        """
        members, concerned = [first], steps[first].moved
        for position in range(first + 1, min(first + REACH, len(steps))):
            if not concerned.isdisjoint(steps[position].moved):
                members.append(position)
                concerned = concerned | steps[position].moved
                if len(members) == LARGEST:
                    break
        return members if put_aside([steps[position] for position in members]) else [first]

    def _replace(self, span: Sequence[RefinedStep], members: Sequence[int], first: int) -> list[RefinedStep] | None:
        """Do shorter steps for a cluster, if there are any after which those between its members can be done; return them."""
        old = [span[position - first] for position in members]
        if len(old) < 2 or old[0][0] == self.lowest:
            return None
        key, roles = self._shape(old)
        if self.known.get(key) is None and (key in self.known or self.clusters_left <= 0 or self.work <= 0):
            return None
        mark = len(self.table.trail)
        after = targets = self._changed(old)
        if len(old) < len(span):
            after = self._changed(span)
        if targets is None or after is None:
            return None
        level = min(max(step[0] for step in old) + 1, self.segments.program.levels[-2])
        new = self._anew(level, key, roles, old, targets)
        if new is not None and length(new) < length(old):
            middle = len(self.table.trail)
            between = (step for position, step in enumerate(span, first) if position not in members)
            if all(self.refiner.again(step) is not None for step in between) and self.table.since(mark) == after:
                self.table.undo(middle)
                return new
        self.table.undo(mark)
        return None

    def _changed(self, steps: Sequence[RefinedStep]) -> dict[Cell, str] | None:
        """Return what steps change, None if they can't be done; the table is left as it was."""
        mark = len(self.table.trail)
        done = all(self.refiner.again(step) is not None for step in steps)
        changed = self.table.since(mark)
        self.table.undo(mark)
        return changed if done else None

    def _shape(self, steps: Sequence[RefinedStep]) -> tuple[object, tuple[str, ...]]:
        """Return what steps have in common with others of their shape, and their individuals in the order of its roles."""
        individuals: dict[str, int] = {}
        shape = []
        for _, name, arguments, bindings, _ in steps:
            shape.append((name, tuple([individuals.setdefault(a, len(individuals)) for a in (*arguments, *bindings)])))
        sorts = self.segments.program.alike.sort
        return (tuple(shape), tuple([sorts.get(individual, -1) for individual in individuals])), tuple(individuals)

    def _anew(
        self, level: int, key: object, roles: tuple[str, ...], old: Sequence[RefinedStep], targets: dict[Cell, str]
    ) -> list[RefinedStep] | None:
        """Do what brings about the same changes, from what is known of this shape of cluster or by planning."""
        if key not in self.known:
            self.known[key] = self._plan(level, roles, targets, old)
        template = self.known[key]
        if template is None:
            return None
        for chosen in self.refiner.roles(template, roles):
            found = self.refiner.replay(level, template, chosen, targets, lambda _, first: first)
            if found is not None:
                return list(found)
        return None

    def _plan(
        self, level: int, roles: tuple[str, ...], targets: dict[Cell, str], old: Sequence[RefinedStep]
    ) -> Template | None:
        """Return a shortest way to make these changes in a world of these individuals and the few that are always there."""
        self.clusters_left -= 1
        program = self.segments.program
        few = {m for members in program.problem.classes.values() if len(members) <= FEW for m in members}
        small = problem_of(self.segments, level, {*roles, *few, *program.named})
        goal = {s: targets.get((s.situation, key_of(s.arguments)), value) for s, value in small.initial.items()}
        steps = self._shortest(replace(small, goal=goal), level, old)
        return self.refiner.template(steps, roles) if steps else None

"""A plan made shorter: detours are dropped, and steps that concern the same things are planned anew together.

Both work below the most abstract level, where a step "hands empty again" costs something, and leave a step of the upper level
in the plan only where its own refinement is still intact. Every change is played through on the table before it is kept.
What the levels above ask of a change is asked of steps that are planned anew, too (`planner.hierarchical.inherited_preconditions`).

whole    a task so small that its states are few is planned anew as a whole, one level above the lowest
detour   two steps of which the second undoes what the first did (put down, picked up again), and nothing between needed it
cluster  steps close together that change the same symbols, or one of which takes the place that another leaves
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby

from planner.grounded.state_space import Space, TooLargeError
from planner.hierarchical.inherited_preconditions import binding
from planner.hierarchical.refinement_cache import Done, Refiner, Template
from planner.hierarchical.state import Cell, arguments_of, key_of
from planner.hierarchical.subplans import Ground, LimitError
from planner.hierarchical.subproblem import world
from reasoner.symbols import Domain, Problem, Symbol

REACH = 30
"""So many steps ahead a cluster looks for steps that concern it."""
LARGEST = 7
"""So many steps a cluster has at most."""
OPERATORS, STATES = 400, 5_000
"""The largest world in which a cluster is planned anew, the states for each cluster allowed."""
WORK, WHOLE_WORK, PER_OPERATOR = 1_000_000, 1_700_000, 4_000
"""For each cluster allowed so many pairs of a state and an operator may be looked at in all, in clusters and in a whole plan;
putting an operator in counts as so many. A million take some 8 ms, so that time is bounded without a look at the clock."""
WHOLE_BITS, WHOLE_STATES = 48, 20_000
"""The largest world, in bits of a state if every symbol could take every value, and the most states for a whole plan anew."""


def length(steps: Sequence[Done], level: int | None = None) -> int:
    """Return the number of primitives, or of steps at a level."""
    return sum(length(step[4], level) if step[4] and step[0] != level else 1 for step in steps)


@dataclass
class Improver:
    """Shortens the plan that a refiner has done; its table must be in the initial state.

    Parameters
    ----------
    refiner : Refiner
    known : dict
        For each shape of a cluster the steps that replace it, or None; kept between calls.
    clusters_left : int
        So many shapes of clusters may be planned anew, in worlds as much larger, with an effort of `WORK` for each.
    """

    refiner: Refiner
    known: dict[object, Template | None]
    clusters_left: int

    def __post_init__(self) -> None:
        self.table = self.refiner.table
        self.segments = self.refiner.segments
        self.states = min(STATES * self.clusters_left, 40 * STATES)
        self.work = WHOLE_WORK * self.clusters_left
        self.lowest = self.segments.program.levels[-1]
        self.bound: dict[int, Domain] = {}

    def improve(self, steps: Sequence[Done]) -> list[Done]:
        """Return steps to the same end, no longer than these; the table is left in the initial state."""
        best = list(steps)
        if len(self.segments.program.levels) < 2:
            return best
        self.table.undo(0)
        anew = self.whole(best)
        self.table.undo(0)
        if anew is not None:
            return anew if length(anew) < length(best) else best
        self.work = min(self.work, WORK * self.clusters_left)
        for shorten in (self.clusters, self.detours):
            found = shorten(best)
            self.table.undo(0)
            if length(found) < length(best):
                best = found
        return best

    # ------------------------------------------------------------------------------------------------------------ whole

    def whole(self, steps: Sequence[Done]) -> list[Done] | None:
        """Return all planned anew, the same steps if that is no shorter, None if the world isn't small or refining fails.

        What these steps leave as it was is left so, too.
        """
        problem = self.segments.program.problem
        level = self.segments.program.levels[-2]
        changing = {effect.situation for behavior in problem.domain.at_level(level) for effect in behavior.effects}
        kinds = {situation: problem.domain.situations[situation].range for situation in changing}
        bits = sum(
            len(problem.classes.get(kind, ())).bit_length() * len(self.table.now[s]) for s, kind in kinds.items()
        )
        if bits > WHOLE_BITS or any(self.again(step) is None for step in steps):
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
        shortest = self._shortest(replace(problem, initial=initial, goal=goal), level, WHOLE_STATES, steps)
        if not shortest:
            return None if shortest is None else list(steps)
        found = []
        for name, arguments in shortest:
            step = self.refiner.do(level, name, arguments)
            if step is None:
                return None
            found.append(step)
        return found

    def _shortest(self, problem: Problem, level: int, states: int, old: Sequence[Done]) -> list[Ground] | None:
        """Return the fewest steps of a level, empty if there are no fewer than of old ones; None if that takes too much."""
        space = None
        try:
            bound = replace(problem, domain=self._binding(level))
            space = Space(bound, level, min(OPERATORS, self.work // PER_OPERATOR))
            self.work -= PER_OPERATOR * len(space.operators)
            most = min(states, self.work // max(len(space.operators), 1))
            found = space.search(most, self.segments.deadline, length(old, level) - 1)
            self.work -= found.states * len(space.operators)
        except TooLargeError:
            self.work -= PER_OPERATOR * OPERATORS if space is None else most * len(space.operators)
            return None
        except TimeoutError as error:
            raise LimitError("the time limit") from error
        return [(step.behavior, step.arguments) for step in found.steps or ()]

    def _binding(self, level: int) -> Domain:
        if level not in self.bound:
            self.bound[level] = binding(self.segments.program.problem, level)
        return self.bound[level]

    # ---------------------------------------------------------------------------------------------------------- detours

    def detours(self, steps: Sequence[Done]) -> list[Done]:
        """Drop pairs of steps that undo each other."""
        parts: list[tuple[Done, int]] = []  # steps above the lowest level, each with the number of its parent
        for number, step in enumerate(steps):
            parts.extend((part, number) for part in self._parts(step))
        undone = self._undone([part for part, _ in parts])
        self.table.undo(0)
        if not undone:
            return list(steps)
        kept: list[tuple[Done, int]] = []
        k = 0
        while k < len(parts):
            self.segments.check_time()
            j = undone.get(k)
            mark = len(self.table.trail)
            if j is not None and all(self.again(part) is not None for part, _ in parts[k + 1 : j]):
                kept.extend(parts[k + 1 : j])
                k = j + 1
                continue
            self.table.undo(mark)
            if self.again(parts[k][0]) is None:
                return list(steps)
            kept.append(parts[k])
            k += 1
        self.table.undo(0)
        return self._assembled(steps, kept)

    def _undone(self, parts: Sequence[Done]) -> dict[int, int]:
        """Return for steps that a later one undoes exactly, before anything else touches the same symbols, that one."""
        latest: dict[Cell, int] = {}
        changes: list[tuple[dict[Cell, str], dict[Cell, str]]] = []
        found: dict[int, int] = {}
        for j, part in enumerate(parts):
            mark = len(self.table.trail)
            if self.again(part) is None:
                return {}
            after = self.table.since(mark)
            before: dict[Cell, str] = {}
            for situation, key, old in self.table.trail[mark:]:
                before.setdefault((situation, key), old)
            before = {cell: before[cell] for cell in after}
            changes.append((before, after))
            makers = {latest.get(cell, -1) for cell in before}
            i = makers.pop()
            if not makers and i >= 0 and changes[i] == (after, before):
                found[i] = j
            latest.update(dict.fromkeys(before, j))
        return found

    def _assembled(self, steps: Sequence[Done], parts: Sequence[tuple[Done, int]]) -> list[Done]:
        """Return parts under their parents again, where all parts of a parent are there and it still does what it says."""
        result: list[Done] = []
        for parent, group in groupby(parts, key=lambda entry: entry[1]):
            mine = [part for part, _ in group]
            whole = self.again(steps[parent]) if len(mine) == max(len(self._parts(steps[parent])), 1) else None
            again = [whole] if whole is not None else [self.again(part) for part in mine]
            result.extend(step for step in again if step is not None)
        return result

    def _parts(self, step: Done) -> tuple[Done, ...]:
        return step[4] if step[4] and step[4][0][0] < self.lowest else (step,)

    def again(self, step: Done) -> Done | None:
        """Do a step once more by the same sub-steps, and return it with its present bindings; None if it can't be done."""
        level, name, arguments, _, below = step
        done = self.segments.forward[name](*arguments)
        if done is None:
            return None
        if not below:
            self.refiner.apply(done[1])
            return level, name, arguments, done[0], ()
        mark = len(self.table.trail)
        wanted = {(s, k): v for s, k, v in done[1] if self.table.now[s].get(k) != v}
        inner = []
        for child in below:
            again = self.again(child)
            if again is None:
                self.table.undo(mark)
                return None
            inner.append(again)
        if self.table.since(mark) != wanted:
            self.table.undo(mark)
            return None
        return level, name, arguments, done[0], tuple(inner)

    # --------------------------------------------------------------------------------------------------------- clusters

    def clusters(self, steps: Sequence[Done]) -> list[Done]:
        """Plan each cluster anew, one level further down, and keep what is shorter."""
        rest = []
        for step in steps:
            self.segments.check_time()
            mark = len(self.table.trail)
            if self.again(step) is None:
                return list(steps)
            rest.append((step, *self._concern(step, mark)))
        self.table.undo(0)
        if all(len(self._cluster(rest, position)) == 1 for position in range(len(rest))):
            return list(steps)
        found: list[Done] = []
        position = 0
        while position < len(rest):
            self.segments.check_time()
            members = self._cluster(rest, position)
            replaced = self._replace([step for step, _, _ in rest[position : members[-1] + 1]], members, position)
            if replaced is not None:
                found.extend(replaced)
                between = [rest[p] for p in range(position, members[-1] + 1) if p not in members]
                position = members[-1] + 1 - len(between)
                rest[position : members[-1] + 1] = between
                continue
            again = self.again(rest[position][0])
            if again is None:
                return list(steps)
            found.append(again)
            position += 1
        return found

    def _concern(self, step: Done, mark: int) -> tuple[frozenset[str], frozenset[Cell]]:
        """Return what a step has moved since a mark, and what it has touched.

        Moved are the individuals whose values changed, and these values; touched the symbols that its own level knows.
        """
        level, _, arguments, bindings, _ = step
        found: set[str] = set()
        touched: set[Cell] = set()
        for situation, key, old in self.table.trail[mark:]:
            if self.segments.program.domain.situations[situation].level <= level:
                found.update((old, self.table.now[situation][key]), (key,) if isinstance(key, str) else key)
                touched.add((situation, key))
        return frozenset(found & {*arguments, *bindings}), frozenset(touched)

    def _cluster(self, steps: Sequence[tuple[Done, frozenset[str], frozenset[Cell]]], first: int) -> list[int]:
        """Return the positions of a step and of those soon after it that concern the same individuals.

        Only the step itself, if no two of them touch the same symbol: each then does something that must be done.
        """
        _, concerned, touched = steps[first]
        members, twice = [first], False
        for position in range(first + 1, min(first + REACH, len(steps))):
            _, moved, cells = steps[position]
            if not concerned.isdisjoint(moved):
                members.append(position)
                twice |= not touched.isdisjoint(cells)
                concerned, touched = concerned | moved, touched | cells
                if len(members) == LARGEST:
                    break
        return members if twice else [first]

    def _replace(self, span: Sequence[Done], members: Sequence[int], first: int) -> list[Done] | None:
        """Do shorter steps for a cluster, if there are any after which those between its members can be done; return them."""
        old = [span[position - first] for position in members]
        if len(old) < 2 or old[0][0] == self.lowest:
            return None
        key, roles = self._shape(old)
        if self.known.get(key) is None and (key in self.known or self.clusters_left <= 0 or self.work <= 0):
            return None
        mark = len(self.table.trail)
        if any(self.again(step) is None for step in old):
            self.table.undo(mark)
            return None
        targets = self.table.since(mark)
        self.table.undo(mark)
        level = min(max(step[0] for step in old) + 1, self.segments.program.levels[-2])
        new = self._anew(level, key, roles, old, targets)
        if new is not None and length(new) < length(old):
            middle = len(self.table.trail)
            between = (step for position, step in enumerate(span, first) if position not in members)
            if all(self.again(step) is not None for step in between):
                self.table.undo(middle)
                return new
        self.table.undo(mark)
        return None

    def _shape(self, steps: Sequence[Done]) -> tuple[object, tuple[str, ...]]:
        """Return what steps have in common with others of their shape, and their individuals in the order of its roles."""
        individuals: dict[str, int] = {}
        shape = []
        for _, name, arguments, bindings, _ in steps:
            shape.append((name, tuple([individuals.setdefault(a, len(individuals)) for a in (*arguments, *bindings)])))
        sorts = self.segments.program.alike.sort
        return (tuple(shape), tuple([sorts.get(individual, -1) for individual in individuals])), tuple(individuals)

    def _anew(
        self, level: int, key: object, roles: tuple[str, ...], old: Sequence[Done], targets: dict[Cell, str]
    ) -> list[Done] | None:
        """Do what brings about the same changes, from what is known of this shape of cluster or by planning."""
        if key not in self.known:
            self.known[key] = self._plan(level, roles, targets, old)
        template = self.known[key]
        if template is None:
            return None
        for chosen in self.refiner.roles(template, roles):
            found = self.refiner.replay(level, template, chosen, targets)
            if found is not None:
                return list(found)
        return None

    def _plan(
        self, level: int, roles: tuple[str, ...], targets: dict[Cell, str], old: Sequence[Done]
    ) -> Template | None:
        """Return a shortest way to make these changes in a world of these individuals and the few that are always there."""
        self.clusters_left -= 1
        small = world(self.segments.program, self.table, level, set(roles))
        goal = {s: targets.get((s.situation, key_of(s.arguments)), value) for s, value in small.initial.items()}
        steps = self._shortest(replace(small, goal=goal), level, self.states, old)
        return self.refiner.template(steps, roles) if steps else None

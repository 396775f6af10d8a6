"""What a rule lacks becomes a goal of its own, for which rules are asked again: chains of rules, on every level.

way        a rule with individuals in its roles, and which of its conditions are unmet
distance   how many rules must follow each other at least, each condition taken by itself; beyond a chain's end nothing is promised
lacks      the wants, one of which would do, for an unmet condition (`confab.planner.hierarchical.subgoals`)
attain     the nearest way is gone: its conditions are brought about in the order in which plans did, the farthest first where
           none is known, then its step is done; what was reached on the way may be lost and brought about again, a few times
together   several goals, where one alone would put the others out of reach: what all of them lack comes before their last steps

A want isn't sought while it is sought already. Each step that is done costs the budget, and what comes to nothing is undone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from math import inf
from typing import NamedTuple, TypeAlias

from confab.planner.experience.matching import Bind, Find, finder, soft
from confab.planner.hierarchical.call import Call
from confab.planner.hierarchical.operators import FEW, Achiever
from confab.planner.hierarchical.refinement import RefinedStep
from confab.planner.hierarchical.symmetry import representatives
from confab.planner.transitions import Cell, Key, arguments_of, key_of
from confab.reasoner.amounts import meets, number, towards
from confab.reasoner.memory.experience import Ground, Rule
from confab.reasoner.symbols import FALSE, TRUE, Condition, Fact, Problem, Symbol, ValueCondition, Witness

WAYS, TRIES = 40, 3
"""So many ways to follow a rule are compared, and so many of the best of all rules tried."""
SLACK = 2
"""By so much longer than the nearest a way may be that is tried."""
FARTHEST = 30
"""Longer chains aren't looked for."""
ASKED, DONE = 5, 100
"""To ask a rule takes about so many microseconds, and so many to do a step; that is, states times operators of a search."""

Roles: TypeAlias = "tuple[str, ...]"
Goal: TypeAlias = "tuple[Cell, str]"
Steps: TypeAlias = "list[RefinedStep]"


class Candidate(NamedTuple):
    """A way to follow a rule now: the symbol that it is for, the individuals in its roles, and which conditions are unmet."""

    rule: Rule
    goal: Cell
    roles: Roles
    unmet: tuple[int, ...] = ()

    @property
    def named(self) -> dict[str, str]:
        """The individuals by role."""
        return dict(zip((role for role, _ in self.rule.kinds), self.roles, strict=True))

    @property
    def ground(self) -> Ground:
        """The step to do."""
        filled = self.named
        return self.rule.does[0], tuple([filled.get(term, term) for term in self.rule.does[1]])


@dataclass
class Budget:
    """How many steps may still be done."""

    left: int


class TooMuchError(Exception):
    """Rules were asked for longer than they may be."""


class Chains:
    """Chains of rules in one call.

    Parameters
    ----------
    call : Call
    rules : mapping of level and situation type to rules
        It may grow.
    joins : dict
        What was compiled of rules for other calls over the same program; grows.
    score : function of a candidate, optional
        Of ways that are equally near the one of the greatest value is gone first.
    before : function of two conditions with who is in their roles
        Whether the first is known to be brought about before the second.
    """

    def __init__(
        self,
        call: Call,
        rules: Mapping[tuple[int, str], list[Rule]],
        joins: dict[str, Bind | None],
        score: Callable[[Candidate], float] | None,
        before: Callable[[Condition, Condition, Mapping[str, str]], bool],
    ) -> None:
        self.call, self.rules, self.joins, self.score, self.before = call, rules, joins, score, before
        self.finds: dict[str, Find | None] = {}
        self.achievers: dict[str, Achiever] = {}
        self.bring: dict[tuple[int, Cell, str, bool], set[Goal]] = {}
        """What all ways to a goal bring about."""
        self.cells: dict[int, list[dict[Key, str]]] = {}
        """Of candidates, by the identity of the program's tuple, the situation types that they have values of."""
        self.age = -1
        self.spent, self.most = 0, inf
        """How much effort was made, and how much may be, in microseconds."""
        self.found: dict[tuple[int, Cell, str, bool], list[Candidate]] = {}
        self.near: dict[tuple[int, Cell, str, bool], int] = {}
        self.beyond: dict[tuple[int, Cell, str, bool], float] = {}
        """How long chains may be that lead to a goal, and how long they may not."""
        self.picked: dict[tuple[int, str], Sequence[str]] = {}
        self.lacking: dict[tuple[int, int], tuple[Candidate, list[Goal]]] = {}
        self.seen: set[tuple[int, Cell, str, bool]] = set()
        self.needed: list[dict[Cell, str]] = []
        """What steps that are to be done ask, of each that is being prepared."""
        self.cut = False
        self.taken: frozenset[str] = frozenset()
        """Who is used up by ways that are to be gone together with those that are looked for."""

    def met(self, goal: Goal) -> bool:
        """Whether something is as wanted now."""
        (situation, key), value = goal
        return meets(self.call.table.now[situation].get(key, FALSE), value)

    def fresh(self) -> None:
        """Forget what was found of another state."""
        if self.age != self.call.table.age:
            self.age = self.call.table.age
            for known in (self.found, self.near, self.beyond, self.picked, self.lacking, self.bring):
                known.clear()

    def ways(self, level: int, goal: Goal, everybody: bool = False) -> list[Candidate]:
        """Return the ways to follow rules for a goal now."""
        self.fresh()
        (cell, value), key = goal, (level, *goal, everybody)
        if key not in self.found:
            rules = self.rules.get((level, cell[0]), ())
            self.spend(ASKED * len(rules))
            self.found[key] = [
                Candidate(rule, cell, *way)
                for rule in rules
                for way in islice(self.find(rule, cell, value, everybody), WAYS)
                if self.taken.isdisjoint(way[0])
            ]
        return self.found[key]

    def spend(self, effort: int) -> None:
        """Count effort, and raise `TooMuchError` where that is more than there may be."""
        self.spent += effort
        if self.spent > self.most:
            raise TooMuchError

    def find(self, rule: Rule, cell: Cell, value: str, everybody: bool) -> Iterator[tuple[Roles, tuple[int, ...]]]:
        """Return ways to fill the roles of a rule; it is compiled when it is first asked."""
        name, program = rule.name, self.call.program
        if name not in self.finds:
            asks = soft(rule, program.problem)
            if name not in self.joins:
                self.joins[name] = finder(rule, program.writer, asks)
            bind = self.joins[name]
            self.finds[name] = bind(self.call.table, self.pick) if bind is not None else None
            self.achievers[name] = Achiever(name, 0, asks, {}, dict(rule.kinds), deep=True)
        find = self.finds[name]
        if program.domain.situations[cell[0]].quantity is not None:
            value = towards(self.call.table.now[cell[0]].get(cell[1]), value)
        return find(*arguments_of(cell[1]), value, everybody) if find is not None else iter(())

    def pick(self, candidates: tuple[str, ...], situation: str) -> Sequence[str]:
        """Return of many candidates for the value of a situation type one of each sort with values of equal sorts, of free ones."""
        found, which = self.picked.get((id(candidates), situation)), id(candidates)
        if found is None:
            self.spent += len(candidates)
            table, symmetry, wanted = self.call.table, self.call.program.symmetry, self.call.space.subgoals.wanted
            found = free = tuple([who for who in candidates if who not in self.taken]) if self.taken else candidates
            if len(free) > FEW:
                if which not in self.cells:
                    among = set(candidates)
                    self.cells[which] = [cells for cells in table.now.values() if not among.isdisjoint(cells)]
                first = representatives(
                    symmetry.groups(free), table.holders.get(situation, {}), wanted.get(situation, {})
                )
                sort, cells = symmetry.class_of.get, self.cells[which]
                unlike = {(sort(w), *[sort(its.get(w, "")) for its in cells]): w for w in (*free[::-1], *first[::-1])}
                found = list(unlike.values())[::-1]
            self.picked[which, situation] = found
        self.spent += 1 + len(found)
        return found

    def lacks(self, level: int, way: Candidate, number: int) -> list[Goal]:
        """Return the wants of which one would do for a condition."""
        self.fresh()
        if (id(way), number) not in self.lacking:
            self.lacking[id(way), number] = way, self.wanting(level, way, number)
        return self.lacking[id(way), number][1]

    def wanting(self, level: int, way: Candidate, number: int) -> list[Goal]:
        """Return the same, anew."""
        achiever, env = self.achievers[way.rule.name], way.named
        asked = achiever.soft[number]
        defined = isinstance(asked, ValueCondition) and asked.situation in self.call.program.rules
        if isinstance(asked, ValueCondition) and defined and (level, asked.situation) in self.rules:
            key = key_of(tuple([env.get(a, a) for a in asked.arguments]))
            return [((asked.situation, key), TRUE if (asked.value == TRUE) is not asked.negated else FALSE)]
        if isinstance(asked, ValueCondition) and not defined and not asked.negated:
            key = key_of(tuple([env.get(a, a) for a in asked.arguments]))
            if key in self.call.table.now[asked.situation]:
                return [((asked.situation, key), env.get(asked.value, asked.value))]
        wants = self.call.space.subgoals.of(achiever, asked, env, level)
        return [((situation, key), value) for situation, key, values in wants for value in values]

    # --------------------------------------------------------------------------------------------------------- distance

    def distance(self, level: int, goal: Goal, everybody: bool) -> float:
        """Return how long a chain to a goal is at least; infinity if there is none, or a longer one."""
        for n in range(FARTHEST + 1):
            self.cut, self.seen, before = False, set(), len(self.near)
            if self.within(level, goal, n, everybody):
                return n
            if not self.cut and len(self.near) == before:  # no chain of any length leads to it
                self.beyond.update((key, inf) for key in self.seen if key not in self.near)
                return inf
        return inf

    def far(self, level: int, goal: Goal) -> float:
        """Return the same, of somebody who comes to mind if there is a chain, else of anybody."""
        near = self.distance(level, goal, False)
        return near if near < inf else self.distance(level, goal, True)

    def within(self, level: int, goal: Goal, most: int, everybody: bool) -> bool:
        """Whether a chain of at most so many rules may lead to a goal."""
        if self.met(goal):
            return True
        ways = self.ways(level, goal, everybody)
        key = (level, *goal, everybody)
        if self.near.get(key, inf) <= most:
            return True
        if most <= 0 or self.beyond.get(key, 0) >= most:
            self.cut |= (key not in self.seen or key in self.near) and self.beyond.get(key, 0) < inf
            return False
        before, self.beyond[key] = self.beyond.get(key, 0), most  # met again on the way, it isn't nearer
        self.seen.add(key)
        if any(all(self.mended(level, way, n, most - 1, everybody) for n in way.unmet) for way in ways):
            self.near[key], self.beyond[key] = most, before
            return True
        return False

    def mended(self, level: int, way: Candidate, number: int, most: int, everybody: bool) -> bool:
        """Whether chains of at most so many rules may lead to a condition; of what nothing is known to lead to, one hopes so."""
        lacks = self.lacks(level, way, number)
        if any(self.within(level, goal, most, everybody) for goal in lacks):
            return True
        return most > 0 and (not lacks or self.comes(level, way, lacks[0], most, everybody))

    def comes(self, level: int, way: Candidate, goal: Goal, most: int, everybody: bool) -> bool:
        """Whether something comes with what brings about another condition that a way lacks."""
        wants = (its[0] for n in way.unmet if (its := self.lacks(level, way, n)) and its[0] != goal)
        return any(
            goal in self.brought(level, want, everybody) and self.within(level, want, most, everybody) for want in wants
        )

    def brought(self, level: int, goal: Goal, everybody: bool) -> set[Goal]:
        """Return what all the ways to a goal bring about, if there are some that bring about more than one thing."""
        key, problem = (level, *goal, everybody), self.call.program.problem
        if key not in self.bring:
            behaviors, rules = problem.domain.behaviors, self.rules.get((level, goal[0][0]), ())
            several = any(len(behaviors[rule.does[0]].effects) > 1 for rule in rules)
            all_ = [set(made(way, problem).items()) for way in self.ways(level, goal, everybody)] if several else []
            self.bring[key] = {((s, key_of(who)), v) for (s, who), v in set.intersection(*all_)} if all_ else set()
        return self.bring[key]

    def nearest(self, level: int, goal: Goal, below: float = inf) -> Iterator[tuple[float, Candidate]]:
        """Yield the nearest ways to a goal, each with its distance, the best first; a farther one is looked for when asked."""
        found = 0
        for everybody in (False, True):
            most = self.distance(level, goal, everybody)
            left = self.ways(level, goal, everybody) if most < inf and not found else []
            for far in range(int(most), int(min(most + SLACK + 1, below))) if left else ():
                near = [way for way in left if all(self.mended(level, way, n, far - 1, everybody) for n in way.unmet)]
                now = {*map(id, near)}  # two ways may be long to compare
                left = [way for way in left if id(way) not in now]
                for way in islice(self.best(level, near), TRIES - found):
                    yield far, way
                found += len(near)
                if found >= TRIES:
                    return

    def best(self, level: int, ways: Sequence[Candidate]) -> Iterator[Candidate]:
        """Yield ways that are equally near in the order in which to try them."""
        groups: dict[tuple[int, int, int], list[Candidate]] = {}
        for way in ways:
            wants = [its[0] for n in way.unmet if (its := self.lacks(level, way, n))]
            left = sum(not self.comes(level, way, want, FARTHEST, False) for want in wants) if len(ways) > 1 else 0
            groups.setdefault((self.spoils(level, way) if len(ways) > 1 else 0, left, len(way.unmet)), []).append(way)
        for _, group in sorted(groups.items()):
            if self.score is not None and len(group) > 1:
                group.sort(key=self.score, reverse=True)
            yield from group

    def spoils(self, level: int, way: Candidate) -> int:
        """Return how many changes by a way, or changes that it lacks, would spoil what is kept or was brought about for others."""
        if way.unmet:
            wants = (self.lacks(level, way, n) for n in way.unmet)
            changes = [lacks[0] for lacks in wants if len(lacks) == 1]
        else:
            done = self.call.space.forward[way.ground[0]](*way.ground[1])
            changes = [((situation, key), value) for situation, key, value in done[1]] if done is not None else []
        situations, asked = self.call.program.domain.situations, (self.call.kept, *self.needed)
        return sum(
            situations[cell[0]].quantity is None and any(value != its.get(cell, value) for its in asked)
            for cell, value in changes
        )

    # ---------------------------------------------------------------------------------------------------------- attaining

    def attain(
        self, level: int, goal: Goal, budget: Budget, above: tuple[Goal, ...] = (), below: float = inf
    ) -> Steps | None:
        """Do steps that lead to a goal; None, and the table as it was, without any."""
        if self.met(goal):
            return []
        if goal in above or len(above) > FARTHEST:
            return None
        table, off = self.call.table, self.off(goal)
        for cost, way in self.nearest(level, goal, below):
            if budget.left <= 0:
                return None
            mark, left = len(table.trail), budget.left
            steps = self.go(level, way, budget, (*above, goal))
            if steps:
                on = cost
                if (steps[-1].behavior, steps[-1].arguments) == way.ground:
                    # What is defined, or an amount, may need the same once more.
                    on = below if self.off(goal) < off else 0.0
                    budget.left = left if on else budget.left
                rest = self.attain(level, goal, budget, above, on)
                if rest is not None and (above or self.hopeful(level, mark)):
                    return steps + rest
            table.undo(mark)
        return None

    def hopeful(self, level: int, mark: int) -> bool:
        """Whether chains may lead back to the goals reached before that were spoiled since a mark."""
        kept, first = self.call.kept, self.call.program.levels[0]
        spoiled = dict.fromkeys((s, key) for s, key, _ in self.call.table.trail[mark:] if (s, key) in kept)
        return level != first or all(self.far(level, (cell, kept[cell])) < inf for cell in spoiled)

    def off(self, goal: Goal) -> float:
        """Return by how much an amount isn't as wanted, or in how many respects what is defined isn't; nothing of others."""
        (situation, key), value = goal
        if situation in self.call.program.rules:
            return len(self.call.space.subgoals.defining(situation, key, value == TRUE, self.call.program.levels[-1]))
        if self.call.program.domain.situations[situation].quantity is None:
            return 0.0
        now = float(number(self.call.table.now[situation].get(key)))
        return min(abs(now - float(number(bound.lstrip("<>=")))) for bound in value.split(","))

    def go(self, level: int, way: Candidate, budget: Budget, above: tuple[Goal, ...]) -> Steps | None:
        """Bring about what a way lacks, and do its step; where it is no way any more, stop before that.

        Without steps the table may be changed.
        """
        call, steps = self.call, list[RefinedStep]()
        asks = self.achievers[way.rule.name].soft
        rounds, fewest = 2 * len(asks), inf
        while way.unmet:
            lacking = sum(len(self.lacks(level, way, n)) for n in way.unmet)
            rounds, fewest = rounds - (lacking >= fewest), min(lacking, fewest)
            if rounds < 0:
                return None
            env = way.named
            facts = (fact(c, env) for i, c in enumerate(asks) if i not in way.unmet)
            self.needed.append(
                {(f.symbol.situation, key_of(f.symbol.arguments)): f.value for f in facts if f is not None}
            )
            done = self.mend(level, way, budget, above)
            self.needed.pop()
            if done is None:
                return None
            steps += done
            same = self.same(level, way, above[-1])
            if same is None:
                return steps
            way = same
        ground = way.ground
        if budget.left <= 0 or call.space.forward[ground[0]](*ground[1]) is None:
            return None
        budget.left -= 1
        call.space.expand(level)
        effort = call.space.effort
        step = call.refiner.do(level, *ground)
        # A refinement that was searched in vain counts.
        self.spend(DONE if step is not None else call.space.effort - effort)
        return None if step is None else [*steps, step]

    def together(self, level: int, goals: Sequence[Goal]) -> Steps | None:
        """Do steps that lead to goals of which none can be reached after the others: what their last steps ask comes first.

        Each has a way of its own, so that nobody is used up twice; of all that these lack the nearest is brought about first that
        leaves the rest within reach. Without steps the table may be changed.
        """
        ways, steps = list[tuple[Goal, Candidate]](), list[RefinedStep]()
        try:
            for goal in goals:
                found = next(self.nearest(level, goal), None)
                if found is None:
                    return None
                ways.append((goal, found[1]))
                self.take(self.taken | used_up(found[1], self.call.program.problem))
        finally:
            self.take(frozenset())
        lacks = (self.lacks(level, way, n) for _, way in ways for n in way.unmet)
        wants = list(dict.fromkeys(its[0] for its in lacks if its))
        effort = self.call.space.effort
        while wants:
            done = self.first(level, wants)
            self.spend(self.call.space.effort - effort)  # refinements that are searched count, too
            effort = self.call.space.effort
            if done is None:
                return None
            steps += done
            wants = [want for want in wants if not self.met(want)]
        for goal, way in ways:
            now = self.same(level, way, goal)
            done = self.go(level, now, Budget(SLACK), (goal,)) if now is not None else None
            if done is None:
                return None
            steps += done
        return steps

    def first(self, level: int, wants: Sequence[Goal]) -> Steps | None:
        """Bring about the nearest of some wants after which those about as near are within reach."""
        table, far = self.call.table, {want: self.far(level, want) for want in wants}
        for want in sorted((want for want in wants if far[want] < inf), key=far.__getitem__):
            beside = [other for other in wants if other != want and far[other] <= far[want] + SLACK]
            mark, done = len(table.trail), self.attain(level, want, Budget(int(far[want]) + SLACK))
            if done and all(self.far(level, other) < inf for other in beside):
                return done
            table.undo(mark)
        return None

    def take(self, taken: frozenset[str]) -> None:
        """Let nobody be looked for who is taken."""
        self.taken = taken
        self.found.clear()
        self.picked.clear()

    def same(self, level: int, way: Candidate, goal: Goal) -> Candidate | None:
        """Return the way by the same rule to go on with: to the same step while it lacks less and less, else what lacks least.

        A way that lacks nothing but what the way to the same step lacks, too, is as good.
        """

        def lacks(its: Iterable[Candidate]) -> set[Goal]:
            return {goal for w in its for n in w.unmet for goal in self.lacks(level, w, n)}

        now = [w for e in (False, True) for w in self.ways(level, goal, e) if w.rule is way.rule]
        own = [w for w in now if w.ground == way.ground]
        nearer = [w for w in now if own and len(w.unmet) < len(way.unmet) and lacks([w]) <= lacks(own)]
        others = [w for w in now if len(w.unmet) <= len(way.unmet)]
        return min(nearer or [*own, *others], key=lambda w: (len(w.unmet), w.ground != way.ground), default=None)

    def mend(self, level: int, way: Candidate, budget: Budget, above: tuple[Goal, ...]) -> Steps | None:
        """Bring about the next of the conditions that a way lacks."""
        asks, env, table = self.achievers[way.rule.name].soft, way.named, self.call.table
        found, passed, last = dict[int, list[Goal]](), dict[int, dict[Cell, str]](), dict[int, tuple[bool, float]]()
        for n in way.unmet:
            lacks = self.lacks(level, way, n)
            near = sorted(
                (self.far(level, g), len(lacks) > 1 and not self.mends(way, n, g), i, g) for i, g in enumerate(lacks)
            )
            if not near:
                continue  # perhaps it comes with the others
            comes = self.comes(level, way, lacks[0], FARTHEST, near[0][0] == inf)
            last[n] = comes, near[0][0] if comes else -near[0][0]
            if near[0][0] < inf:
                found[n], passed[n] = [g for far, *_, g in near if far < inf], self.passed(level, near[0][-1])
            elif not comes:
                return None

        def later(n: int) -> tuple[int, tuple[bool, float], int]:
            cell, value = found[n][0]
            first = (self.before(asks[m], asks[n], env) or passed[m].get(cell, value) != value for m in found if m != n)
            return sum(first), last[n], n

        for n in sorted(found, key=later):
            goals = found[n]
            lost = False
            for goal in goals[:TRIES]:
                mark, left = len(table.trail), budget.left
                done = self.attain(level, goal, budget, above)
                if done is None:
                    continue
                if isinstance(asks[n], Witness) and asks[n].negated:
                    budget.left = left  # each whom it forbids has steps of its own
                others = (its for m, its in found.items() if m != n)
                if all(any(self.far(level, g) < inf for g in its) for its in others):
                    return done
                table.undo(mark)
                lost = True
            if not lost:  # else another condition comes first: this one put the others out of reach
                return None
        return None

    def passed(self, level: int, goal: Goal) -> dict[Cell, str]:
        """Return what the nearest way to a goal lacks, of those that were looked at: what is brought about on the way there."""
        for everybody in (False, True):
            ways = self.found.get((level, *goal, everybody), ())
            wants = [[its[0] for n in way.unmet if (its := self.lacks(level, way, n))] for way in ways]
            far = [max((self.near.get((level, *want, everybody), inf) for want in its), default=0) for its in wants]
            if min(far, default=inf) < inf:
                return dict(wants[far.index(min(far))])
        return {}

    def mends(self, way: Candidate, number: int, goal: Goal) -> bool:
        """Whether a want alone would do for a condition; of amounts and of what is defined that isn't asked."""
        table, achiever, program = self.call.table, self.achievers[way.rule.name], self.call.program
        if goal[0][0] in program.rules or program.domain.situations[goal[0][0]].quantity is not None:
            return True
        mark, fresh = len(table.trail), self.age == table.age
        table.put(*goal[0], goal[1])
        holds = self.call.space.subgoals.holds(achiever, achiever.soft[number], way.named)
        table.undo(mark)
        if fresh:
            self.age = table.age  # all is as it was
        return holds


def made(way: Candidate, problem: Problem) -> dict[tuple[str, tuple[str, ...]], str]:
    """Return what the step of a way makes so, as far as it says of whom."""
    behavior = problem.domain.behaviors[way.rule.does[0]]
    put = {p.name: who for p, who in zip(behavior.parameters, way.ground[1], strict=True)}
    return {
        (e.situation, tuple([put.get(a, a) for a in e.arguments])): put.get(e.value, e.value) for e in behavior.effects
    }


def used_up(way: Candidate, problem: Problem) -> set[str]:
    """Return of whom a way asks something that its step makes otherwise."""
    now, env = made(way, problem), way.named
    asked = [found for c in way.rule.asks if (found := fact(c, env)) is not None]
    return {
        who
        for f in asked
        if now.get((f.symbol.situation, f.symbol.arguments), f.value) != f.value
        for who in f.symbol.arguments
    }


def fact(condition: Condition, env: Mapping[str, str]) -> Fact | None:
    """Return the value that a condition asks for, if it asks for one."""
    if not isinstance(condition, ValueCondition) or condition.negated:
        return None
    arguments = tuple([env.get(a, a) for a in condition.arguments])
    return Fact(Symbol(condition.situation, arguments), env.get(condition.value, condition.value))

"""Learned rules as methods of subgoals: what a rule lacks is achieved first, by rules again, then its step is done.

way      a rule with individuals in its roles, and which of its conditions are unmet; the wants of which one would do for each of
         them are subgoals (`confab.planner.hierarchical.subgoals`)
cost     how many rules must follow each other at least, each condition taken by itself, as h_max: the ways to a goal, the ways to
         what these lack, and so on, layer by layer, until no deeper layer could make it cheaper
attain   a goal by its cheapest ways, of these first by what spoils least and is most cogent: their conditions one by one, those
         that plans brought about first, else the dearest; then the step, refined and done on the table
budget   the unit of the search (`confab.planner.hierarchical.workspace`); of all effort a tenth may come to nothing, and a little

`Guide.follow` leaves the table as wanted, with all kept that must be, or as it was: so the search goes on as if rules hadn't been
asked, and a wrong rule costs a part of the same budget.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import groupby, islice
from math import inf
from typing import NamedTuple, TypeAlias, TypeVar

from confab.planner.experience.matching import Bind, Find, finder, known, soft
from confab.planner.hierarchical.call import Call
from confab.planner.hierarchical.methods import Ranked, unranked
from confab.planner.hierarchical.operators import FEW, Achiever, Program
from confab.planner.hierarchical.refinement import RefinedStep
from confab.planner.hierarchical.symmetry import representatives
from confab.planner.hierarchical.workspace import EXPANSION, Keep
from confab.planner.transitions import Cell, arguments_of, key_of
from confab.reasoner.amounts import meets, number, towards
from confab.reasoner.memory.experience import ITSELF, Experience, Ground, Order, Rule, Tally
from confab.reasoner.symbols import FALSE, TRUE, Condition, Fact, Symbol, ValueCondition, Witness

WAYS, TRIES = 40, 3
"""Maximum number of instances of a rule that are compared, and of instances for a goal that are tried."""
FARTHEST, SLACK = 30, 2
"""Maximum cost of a goal, and maximum excess in cost of an instance over the cheapest one."""
ASKED = 5
"""Cost of matching a rule, in states times operators (about a microsecond each)."""
WASTE, FREE = 10, 500_000
"""Inverse of the share of expansions, and of effort, that unsuccessful rules may take, and the effort assumed before the call."""
PATIENCE = 3
"""Maximum ratio of applied steps to a goal's cost, beside `SLACK` more: each condition is costed separately."""
TWICE = 2
"""Maximum number of times that a goal is achieved: what was shut may be opened once more."""
CASES, NEARLY = 3, 0.95
"""Minimum number of cases of an order of goals, and minimum share of cases in which it held."""

Roles: TypeAlias = "tuple[str, ...]"
Goal: TypeAlias = "tuple[Cell, str]"
Asked: TypeAlias = "tuple[int, Goal, bool]"
"""A level, a goal on it, and whether individuals are considered that the state doesn't suggest."""
Steps: TypeAlias = "list[RefinedStep]"
Found = TypeVar("Found")


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


Score: TypeAlias = "Callable[[Candidate], float]"


class TooMuchError(Exception):
    """Following rules took more than may come to nothing."""


class Guide:
    """Rules bound to one call: its table, its goals and the order of these.

    Parameters
    ----------
    call : Call
    rules : iterable of Rule
    orders : sequence of Order
    score : function of a candidate, optional
        The greater, the sooner tried.
    joins : dict, optional
        What was compiled of rules for other calls over the same program; grows.
    ranked : function of a method and ways to fill its roles, optional
        Returns these, the best first.
    """

    def __init__(
        self,
        call: Call,
        rules: Iterable[Rule],
        orders: Sequence[Order] = (),
        score: Score | None = None,
        joins: dict[str, Bind | None] | None = None,
        ranked: Ranked = unranked,
    ) -> None:
        self.call, self.ranked, self.score = call, ranked, score
        self.joins: dict[str, Bind | None] = {} if joins is None else joins
        self.first = call.program.levels[0]
        self.constants = frozenset(call.program.named) | {TRUE, FALSE}
        self.orders = frozenset(orders)
        self.before = _before(call.goal, orders, call.program)
        self.rules: dict[tuple[int, str], list[Rule]] = {}
        for rule in rules:
            if known(rule, call.program.problem):
                level = call.program.domain.behaviors[rule.does[0]].level
                self.rules.setdefault((level, rule.goal.situation), []).append(rule)
        self.expects = all((self.first, situation) in self.rules for situation, _ in self.open())
        self.finds: dict[str, Find | None] = {}
        self.achievers: dict[str, Achiever] = {}
        self.spent, self.most, self.vain, self.wasted = 0, inf, 0.0, 0
        """Effort of asking rules, what it may become, and what came to nothing: in all, and in expansions of the first level."""
        self.left = 0
        """How many steps may still be done for what is to be attained."""
        self.taken: frozenset[str] = frozenset()
        """Individuals that ways to other goals use up."""
        self.serial, self.passed = True, set[str]()
        """Whether goals were achieved one after the other so far, and of which situation types one was."""
        self.age = -1
        self.found: dict[Asked, list[Candidate]] = {}
        self.least: dict[Asked, int] = {}
        self.more: dict[Asked, float] = {}
        """What goals cost at most, and more than what."""
        self.seen: set[Asked] = set()
        self.cut = False
        self.picked: dict[tuple[int, str], Sequence[str]] = {}
        self.lacking: dict[tuple[int, int, int], tuple[Candidate, list[Goal]]] = {}

    # ----------------------------------------------------------------------------------------------------- the call's goals

    def open(self) -> dict[Cell, str]:
        """Return the goals of the call that don't hold now."""
        return {cell: value for cell, value in self.call.goal.items() if not self.call.met(cell)}

    def waits(self, cell: Cell) -> bool:
        """Whether another open goal comes first."""
        return any(not self.call.met(other) for other in self.before.get(cell, ()))

    def every(self, cells: Mapping[Cell, str]) -> Iterator[Candidate]:
        """Yield the ways to follow a rule of the most abstract level now for some values, or for what the cheapest ways lack."""
        goals = dict.fromkeys(cells.items())
        for goal in (asked := list(goals)):
            ready = [way for way in self.ways((self.first, goal, False)) if not way.unmet]
            yield from ready
            for _, way in () if ready else self.cheapest(self.first, goal):
                new = [g for n in way.unmet for g in self.lacks(self.first, way, n) if g not in goals]
                goals.update(dict.fromkeys(new))
                asked += new

    def rank(self, cell: Cell) -> int:
        """Return 1 if rules promise a goal by one step, 2 if ways to it lack something, 0 if they promise nothing."""
        goal = cell, self.call.goal[cell]

        def ask() -> int:
            ways = self.ways((self.first, goal, False)) or self.ways((self.first, goal, True))
            return min((1 + bool(way.unmet) for way in ways), default=0)

        return self.bounded(self.first, ask) or 0

    # ------------------------------------------------------------------------------------------------------------ the budget

    def allowed(self) -> float:
        """Return how much more may come to nothing."""
        return (self.call.space.effort + self.spent + FREE) / WASTE - self.vain

    def ready(self) -> bool:
        """Whether more may come to nothing."""
        return self.wasted * WASTE <= self.call.space.expanded and self.allowed() > 0

    def bounded(self, level: int, ask: Callable[[], Found | None]) -> Found | None:
        """Return what rules answer, None if they have no answer or asking takes more than what may come to nothing."""
        if not self.ready() if level == self.first else self.allowed() <= 0:
            return None
        outer, vain, began = self.most, self.vain, self.spent
        self.most = min(outer, began + self.allowed())
        try:
            found = ask()
        except TooMuchError:
            found = None
        self.most = outer + self.spent - began  # what it is a part of isn't stopped by it
        if not found:
            self.vain = max(self.vain, vain + self.spent - began)
        return found

    def spend(self, effort: int) -> None:
        """Count effort, and raise `TooMuchError` where that is more than there may be."""
        self.spent += effort
        if self.spent > self.most:
            raise TooMuchError

    # ------------------------------------------------------------------------------------------------------------- following

    def follow(self, level: int, targets: Mapping[Cell, str], keep: Keep) -> Steps | None:
        """Do steps of a level, refined, that achieve the targets and keep the rest; None, and the table as it was, without any."""
        return self.bounded(level, lambda: self.tried(level, targets, keep))

    def tried(self, level: int, targets: Mapping[Cell, str], keep: Keep) -> Steps | None:
        """Do the same, however much comes to nothing."""
        call, space, vain = self.call, self.call.space, self.vain
        start, expanded, began = len(call.table.trail), space.expanded, space.effort + self.spent
        other = self.another(targets) if level == self.first else None
        try:
            steps = self.led(level, targets, keep)
            if steps is not None and other is not None:
                self.passed.add(other[0][0])
                self.serial = self.far(level, other) < inf
                if not self.serial:
                    call.table.undo(start)
                    steps = self.together(level, list(self.open().items()))
        except TooMuchError:
            steps = None
        if steps is not None and call.refiner.wrong_value(start, targets, keep) is None:
            return steps if level == self.first else call.refiner.pruned(steps, start, targets, keep)
        self.wasted += space.expanded - expanded if level == self.first else 0
        self.vain = max(self.vain, vain + space.effort + self.spent - began)
        call.table.undo(start)
        return None

    def led(self, level: int, targets: Mapping[Cell, str], keep: Keep) -> Steps | None:
        """Attain what is wanted, and what was touched on the way and is to be kept, until nothing is off."""
        start, steps = len(self.call.table.trail), list[RefinedStep]()
        closed: dict[Cell, int] = {}
        while off := self.off(start, targets, keep):
            before = _before(off, self.orders, self.call.program) if len(off) > 1 else {}
            among = [goal for goal in off.items() if closed.get(goal[0], 0) < TWICE]
            far = {goal: self.far(level, goal) for goal in among}
            among.sort(key=lambda goal: (sum(other in off for other in before.get(goal[0], ())), -far[goal]))
            for goal in among:
                self.left = int(SLACK + PATIENCE * far[goal]) if far[goal] < inf else 0
                done = self.attain(level, goal) if self.left else None
                if done is not None:
                    steps += done
                    closed[goal[0]] = closed.get(goal[0], 0) + 1
                    break
            else:
                return None
        return steps

    def off(self, start: int, targets: Mapping[Cell, str], keep: Keep) -> dict[Cell, str]:
        """Return what isn't yet as it must be in the end: targets, and what was touched since a mark."""
        now, wanted = self.call.table.now, dict(targets)
        for cell in self.call.space.defined:
            if value := keep(cell, ""):
                wanted.setdefault(cell, value)
        for cell, first in self.call.table.before(start).items():
            if cell not in wanted and (value := keep(cell, first)) is not None:
                wanted[cell] = value
        return {cell: value for cell, value in wanted.items() if not meets(now[cell[0]].get(cell[1], FALSE), value)}

    # ------------------------------------------------------------------------------------------------------------------ ways

    def fresh(self) -> None:
        """Forget what was found of another state."""
        if self.age != self.call.table.age:
            self.age = self.call.table.age
            for found in (self.found, self.least, self.more, self.picked, self.lacking):
                found.clear()

    def ways(self, asked: Asked) -> list[Candidate]:
        """Return the ways to follow rules for a goal now."""
        self.fresh()
        if asked not in self.found:
            level, (cell, value), everybody = asked
            rules = self.rules.get((level, cell[0]), ())
            self.spend(ASKED * len(rules))
            self.found[asked] = [
                Candidate(rule, cell, *way)
                for rule in rules
                for way in islice(self.find(rule, cell, value, everybody), WAYS)
                if self.taken.isdisjoint(way[0])
            ]
        return self.found[asked]

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
        found = self.picked.get((id(candidates), situation))
        if found is None:
            self.spent += len(candidates)
            table, symmetry, wanted = self.call.table, self.call.program.symmetry, self.call.space.subgoals.wanted
            found = free = tuple([who for who in candidates if who not in self.taken]) if self.taken else candidates
            if len(free) > FEW:
                among = set(candidates)
                cells = [its for its in table.now.values() if not among.isdisjoint(its)]
                first = representatives(
                    symmetry.groups(free), table.holders.get(situation, {}), wanted.get(situation, {})
                )
                sort = symmetry.class_of.get
                unlike = {(sort(w), *[sort(its.get(w, "")) for its in cells]): w for w in (*free[::-1], *first[::-1])}
                found = list(unlike.values())[::-1]
            self.picked[id(candidates), situation] = found
        self.spent += 1 + len(found)
        return found

    def lacks(self, level: int, way: Candidate, position: int) -> list[Goal]:
        """Return the wants of which one would do for a condition."""
        self.fresh()
        if (key := (level, id(way), position)) not in self.lacking:
            self.lacking[key] = way, self.wanting(level, way, position)
        return self.lacking[key][1]

    def wanting(self, level: int, way: Candidate, position: int) -> list[Goal]:
        """Return the same, anew."""
        achiever, env = self.achievers[way.rule.name], way.named
        asked = achiever.soft[position]
        if isinstance(asked, ValueCondition):
            key = key_of(tuple([env.get(a, a) for a in asked.arguments]))
            if asked.situation in self.call.program.rules:
                if (level, asked.situation) in self.rules:
                    return [((asked.situation, key), TRUE if (asked.value == TRUE) is not asked.negated else FALSE)]
            elif not asked.negated and key in self.call.table.now[asked.situation]:
                return [((asked.situation, key), env.get(asked.value, asked.value))]
        wants = self.call.space.subgoals.of(achiever, asked, env, level)
        return [((situation, key), value) for situation, key, values in wants for value in values]

    # ------------------------------------------------------------------------------------------------------------------ cost

    def met(self, goal: Goal) -> bool:
        """Whether something is as wanted now."""
        (situation, key), value = goal
        return meets(self.call.table.now[situation].get(key, FALSE), value)

    def cost(self, level: int, goal: Goal, everybody: bool) -> float:
        """Return how many rules must follow each other at least for a goal; infinity if no chain leads to it, or a longer one."""
        for most in range(FARTHEST + 1):
            self.cut, self.seen, before = False, set(), len(self.least)
            if self.within(level, goal, most, everybody):
                return most
            if not self.cut and len(self.least) == before:  # no chain of any length leads to it
                self.more.update((asked, inf) for asked in self.seen if asked not in self.least)
                return inf
        return inf

    def far(self, level: int, goal: Goal) -> float:
        """Return the cost of a goal by individuals that the state suggests if there is a chain, else by any."""
        cost = self.cost(level, goal, False)
        return cost if cost < inf else self.cost(level, goal, True)

    def within(self, level: int, goal: Goal, most: int, everybody: bool) -> bool:
        """Whether a goal costs at most so much."""
        if self.met(goal):
            return True
        asked = level, goal, everybody
        ways = self.ways(asked)
        if self.least.get(asked, inf) <= most:
            return True
        if most <= 0 or self.more.get(asked, 0) >= most:
            self.cut |= (asked not in self.seen or asked in self.least) and self.more.get(asked, 0) < inf
            return False
        before, self.more[asked] = self.more.get(asked, 0), most  # met again on the way, it isn't cheaper
        self.seen.add(asked)
        if any(self.leads(level, way, most, everybody) for way in ways):
            self.least[asked], self.more[asked] = most, before
            return True
        return False

    def leads(self, level: int, way: Candidate, most: int, everybody: bool) -> bool:
        """Whether a way costs at most so much; what nothing is known to lead to is hoped for."""
        lacking = (self.lacks(level, way, n) for n in way.unmet)
        return all(
            any(self.within(level, goal, most - 1, everybody) for goal in lacks) if lacks else most > 1
            for lacks in lacking
        )

    def priced(self, level: int, goal: Goal, below: float = inf) -> Iterator[tuple[int, list[Candidate]]]:
        """Yield the ways to a goal by cost, up to a little more than that of the cheapest."""
        for everybody in (False, True):
            most, found = self.cost(level, goal, everybody), False
            left = self.ways((level, goal, everybody)) if most < inf else []
            for cost in range(int(most), int(min(most + SLACK + 1, below))) if left else ():
                near = [way for way in left if self.leads(level, way, cost, everybody)]
                now = {*map(id, near)}  # two ways may be long to compare
                left, found = [way for way in left if id(way) not in now], found or bool(near)
                yield cost, near
            if found:
                return

    def cheapest(self, level: int, goal: Goal, below: float = inf) -> Iterator[tuple[int, Candidate]]:
        """Yield the cheapest ways to a goal, each with its cost, the best first; a dearer one is looked for when asked."""
        ways = ((cost, way) for cost, near in self.priced(level, goal, below) for way in self.best(level, near))
        return islice(ways, TRIES)

    def best(self, level: int, ways: Sequence[Candidate]) -> Iterator[Candidate]:
        """Yield ways of the same cost in the order in which to try them."""
        if len(ways) < 2:
            yield from ways
            return
        rank = {id(way): (self.spoils(level, way), len(way.unmet)) for way in ways}
        for _, alike in groupby(sorted(ways, key=lambda way: rank[id(way)]), key=lambda way: rank[id(way)]):
            group = list(alike)
            if self.score is not None and len(group) > 1:
                group.sort(key=self.score, reverse=True)
            yield from group

    def spoils(self, level: int, way: Candidate) -> int:
        """Return how many of a way's changes, or of the changes that it lacks, would spoil goals reached before."""
        if way.unmet:
            lacking = (self.lacks(level, way, n) for n in way.unmet)
            changes = [lacks[0] for lacks in lacking if len(lacks) == 1]
        else:
            done = self.call.space.forward[way.ground[0]](*way.ground[1])
            changes = [((situation, key), value) for situation, key, value in done[1]] if done is not None else []
        return sum(value != self.call.kept.get(cell, value) for cell, value in changes)

    # ------------------------------------------------------------------------------------------------------------- attaining

    def attain(self, level: int, goal: Goal, above: tuple[Goal, ...] = (), below: float = inf) -> Steps | None:
        """Do steps that lead to a goal; None, and the table as it was, without any."""
        if self.met(goal):
            return []
        if goal in above or len(above) > FARTHEST:
            return None
        table, amiss = self.call.table, self.amiss(goal)
        for cost, way in self.cheapest(level, goal, below):
            if self.left <= 0:
                return None
            mark, left = len(table.trail), self.left
            steps = self.go(level, way, (*above, goal))
            if steps:
                most: float = cost
                if (steps[-1].behavior, steps[-1].arguments) == way.ground:
                    # What is defined, or an amount, may need the same once more.
                    most = below if self.amiss(goal) < amiss else 0.0
                    self.left = left if most else self.left
                rest = self.attain(level, goal, above, most)
                if rest is not None and (above or self.hopeful(level, mark)):
                    return steps + rest
            table.undo(mark)
        return None

    def hopeful(self, level: int, mark: int) -> bool:
        """Whether the goals reached before that were spoiled since a mark are still within reach."""
        kept = self.call.kept
        spoiled = dict.fromkeys((s, key) for s, key, _ in self.call.table.trail[mark:] if (s, key) in kept)
        return level != self.first or all(self.far(level, (cell, kept[cell])) < inf for cell in spoiled)

    def amiss(self, goal: Goal) -> float:
        """Return by how much an amount isn't as wanted, or in how many respects what is defined isn't; nothing of others."""
        (situation, key), value = goal
        if situation in self.call.program.rules:
            return len(self.call.space.subgoals.defining(situation, key, value == TRUE, self.call.program.levels[-1]))
        if self.call.program.domain.situations[situation].quantity is None:
            return 0.0
        now = float(number(self.call.table.now[situation].get(key)))
        return min(abs(now - float(number(bound.lstrip("<>=")))) for bound in value.split(","))

    def go(self, level: int, way: Candidate, above: tuple[Goal, ...]) -> Steps | None:
        """Bring about what a way lacks, and do its step; where it is no way any more, stop before that.

        Without steps the table may be changed.
        """
        call, steps = self.call, list[RefinedStep]()
        rounds, fewest = 2 * len(self.achievers[way.rule.name].soft), inf
        while way.unmet:
            lacking = sum(len(self.lacks(level, way, n)) for n in way.unmet)
            rounds, fewest = rounds - (lacking >= fewest), min(lacking, fewest)
            done = self.mend(level, way, above) if rounds >= 0 else None
            if done is None:
                return None
            steps += done
            now = self.same(level, way, above[-1])
            if now is None:
                return steps
            way = now
        if self.left <= 0:
            return None
        self.left -= 1
        call.space.expand(level)
        effort = call.space.effort
        step = call.refiner.do(level, *way.ground)
        self.spend(EXPANSION if step is not None else call.space.effort - effort)  # what was searched in vain counts
        return None if step is None else [*steps, step]

    def same(self, level: int, way: Candidate, goal: Goal) -> Candidate | None:
        """Return the cheapest way by the same rule to go on with, of these the one to the same step."""
        mine = ([w for w in near if w.rule is way.rule] for _, near in self.priced(level, goal))
        near = next(filter(None, mine), [])
        return min(near, key=lambda w: (len(w.unmet), w.ground != way.ground), default=None)

    def mend(self, level: int, way: Candidate, above: tuple[Goal, ...]) -> Steps | None:
        """Bring about the next of the conditions that a way lacks, so that the others stay within reach."""
        asks, env, table = self.achievers[way.rule.name].soft, way.named, self.call.table
        goals = dict[int, list[Goal]]()
        far = dict[Goal, float]()
        for n in way.unmet:
            lacks = self.lacks(level, way, n)
            far |= {goal: self.far(level, goal) for goal in lacks}
            there = [goal for goal in lacks if far[goal] < inf]
            goals[n] = sorted(there, key=lambda goal: (far[goal], len(there) > 1 and not self.mends(way, n, goal)))
        ready = [n for n in goals if goals[n]]

        def later(n: int) -> tuple[int, float]:
            return sum(self.sooner(asks[m], asks[n], env) for m in ready if m != n), -far[goals[n][0]]

        for n in sorted(ready, key=later):
            lost = False
            for goal in goals[n][:TRIES]:
                mark, left = len(table.trail), self.left
                done = self.attain(level, goal, above)
                if done is None:
                    continue
                if isinstance(asks[n], Witness) and asks[n].negated:
                    self.left = left  # each individual that it forbids has steps of its own
                if all(any(self.far(level, other) < inf for other in goals[m]) for m in ready if m != n):
                    return done
                table.undo(mark)
                lost = True
            if not lost:  # else another condition comes first: this one put the others out of reach
                return None
        return None

    def mends(self, way: Candidate, position: int, goal: Goal) -> bool:
        """Whether a want alone would do for a condition; of amounts and of what is defined that isn't asked."""
        table, achiever, program = self.call.table, self.achievers[way.rule.name], self.call.program
        if goal[0][0] in program.rules or program.domain.situations[goal[0][0]].quantity is not None:
            return True
        mark, age = len(table.trail), table.age
        table.put(*goal[0], goal[1])
        holds = self.call.space.subgoals.holds(achiever, achiever.soft[position], way.named)
        table.undo(mark)
        self.age = table.age if self.age == age else self.age  # all is as it was
        return holds

    def sooner(self, first: Condition, then: Condition, env: Mapping[str, str]) -> bool:
        """Whether one condition is known to be brought about before another one."""
        one, other = fact(first, env), fact(then, env)
        return one is not None and other is not None and Order.of(one, other, self.constants) in self.orders

    # ------------------------------------------------------------------------------------------------------- goals together

    def another(self, targets: Mapping[Cell, str]) -> Goal | None:
        """Return another open goal of a target's situation type that is within reach, if that wasn't asked of the type before."""
        kinds = {cell[0] for cell in targets} - self.passed if self.serial else set()
        for cell, value in reversed(self.call.goal.items()) if kinds else ():
            if cell[0] in kinds and cell not in targets and not self.call.met(cell):
                return (cell, value) if self.far(self.first, (cell, value)) < inf else None
        return None

    def together(self, level: int, goals: Sequence[Goal]) -> Steps | None:
        """Do steps that lead to goals of which none can be reached after the others: what their last steps ask comes first.

        Each has a way of its own, so that no individual is used up twice. Without steps the table may be changed.
        """
        ways, steps = list[tuple[Goal, Candidate]](), list[RefinedStep]()
        try:
            for goal in goals:
                found = next(self.cheapest(level, goal), None)
                if found is None:
                    return None
                ways.append((goal, found[1]))
                self.taken |= self.used_up(found[1])
                self.age = -1
        finally:
            self.taken, self.age = frozenset(), -1
        lacking = (self.lacks(level, way, n) for _, way in ways for n in way.unmet)
        wants = list(dict.fromkeys(lacks[0] for lacks in lacking if lacks))
        while wants:
            done = self.nearest(level, wants)
            if done is None:
                return None
            steps += done
            wants = [want for want in wants if not self.met(want)]
        for goal, way in ways:
            now = self.same(level, way, goal)
            self.left = SLACK
            last = self.go(level, now, (goal,)) if now is not None else None
            if last is None:
                return None
            steps += last
        return steps

    def nearest(self, level: int, wants: Sequence[Goal]) -> Steps | None:
        """Bring about the cheapest of some wants after which those about as cheap are within reach."""
        table, far = self.call.table, {want: self.far(level, want) for want in wants}
        for want in sorted((want for want in wants if far[want] < inf), key=far.__getitem__):
            beside = [other for other in wants if other != want and far[other] <= far[want] + SLACK]
            self.left, mark = int(far[want]) + SLACK, len(table.trail)
            done = self.attain(level, want)
            if done and all(self.far(level, other) < inf for other in beside):
                return done
            table.undo(mark)
        return None

    def used_up(self, way: Candidate) -> set[str]:
        """Return of whom a way asks something that its step changes."""
        env, behavior = way.named, self.call.program.domain.behaviors[way.rule.does[0]]
        put = {p.name: who for p, who in zip(behavior.parameters, way.ground[1], strict=True)}
        made = {(e.situation, tuple([put.get(a, a) for a in e.arguments])): e.value for e in behavior.effects}
        asked = [found for c in way.rule.asks if (found := fact(c, env)) is not None]
        return {
            who
            for f in asked
            if put.get(value := made.get((f.symbol.situation, f.symbol.arguments), f.value), value) != f.value
            for who in f.symbol.arguments
        }


def by_rules(guide: Guide) -> None:
    """Achieve goals by rules alone, as many as they can."""
    call, reached = guide.call, True
    while reached:
        reached = False
        for cell, value in sorted(guide.open().items(), key=lambda item: guide.waits(item[0])):
            if not call.met(cell):
                steps = guide.tried(guide.first, {cell: value}, call.space.keeping(call.kept))
                if steps is not None:
                    call.steps += steps
                    call.kept[cell] = value
                    reached = True


def rules_in(experience: Experience) -> list[Rule]:
    """Return the rules that may be followed."""
    said = sorted(experience.said.items())
    return [one for name, one in said if isinstance(one, Rule) and name not in experience.disabled]


def usable(experience: Experience) -> list[Order]:
    """Return the orders that held in nearly all cases; one between goals that share nobody, of different situation types only."""
    counts = experience.totals()
    found = []
    for name, order in sorted(experience.said.items()):
        if isinstance(order, Order) and name not in experience.disabled and (order.shared or order.first != order.then):
            so = counts.get(name, {}).get(ITSELF, Tally()).chosen
            other = counts.get(order.reversed.name, {}).get(ITSELF, Tally()).chosen
            if so >= CASES and so >= NEARLY * (so + other):
                found.append(order)
    return found


def fact(condition: Condition, env: Mapping[str, str]) -> Fact | None:
    """Return the value that a condition asks for, if it asks for one."""
    if not isinstance(condition, ValueCondition) or condition.negated:
        return None
    arguments = tuple([env.get(a, a) for a in condition.arguments])
    return Fact(Symbol(condition.situation, arguments), env.get(condition.value, condition.value))


def _before(goal: Mapping[Cell, str], orders: Iterable[Order], program: Program) -> dict[Cell, list[Cell]]:
    """Return for each goal those that come before it."""
    found: dict[Cell, list[Cell]] = {}
    parts = {cell: (*arguments_of(cell[1]), value) for cell, value in goal.items()}
    constants = frozenset(program.named) | {TRUE, FALSE}
    facts = {cell: Fact(Symbol(cell[0], arguments_of(cell[1])), value) for cell, value in goal.items()}
    for order in orders:
        index: dict[tuple[str, ...], list[Cell]] = {}
        for cell, terms in parts.items():
            if cell[0] == order.first:
                index.setdefault(tuple(terms[i] for i, _ in order.shared), []).append(cell)
        for cell, terms in parts.items():
            if cell[0] == order.then:
                for other in index.get(tuple(terms[j] for _, j in order.shared), ()):
                    if other != cell and Order.of(facts[other], facts[cell], constants) == order:
                        found.setdefault(cell, []).append(other)
    return found

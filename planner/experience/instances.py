"""Instances of learned rules in the current state, and the cost of a goal as a number of rules.

An instance is a rule with an individual in each role. An unmet condition of an instance has one or more goals; achieving
one of these goals makes the condition true. The cost of a goal is the least number of rules in a chain that achieves the
goal. Conditions are costed separately, as in the heuristic h_max. Costs are computed by iterative deepening.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import groupby, islice
from math import inf
from typing import NamedTuple, TypeAlias

from confab.planner.experience.allowance import Allowance
from confab.planner.experience.matching import Bind, Find, finder, known, soft
from confab.planner.hierarchical.call import Call
from confab.planner.hierarchical.operators import FEW, Achiever
from confab.planner.hierarchical.symmetry import representatives
from confab.planner.transitions import Cell, arguments_of, key_of
from confab.reasoner.amounts import meets, towards
from confab.reasoner.limits import check, checked
from confab.reasoner.memory.experience import Ground, LearnedRule
from confab.reasoner.symbols import FALSE, TRUE, ValueCondition

COMPARED, TRIES = 40, 3
"""Maximum number of instances of a rule that are compared, and of instances for a goal that are tried."""
FARTHEST, SLACK = 30, 2
"""Maximum cost of a goal, and maximum difference between the cost of a rule instance and the least cost."""
MATCHING = 5
"""Cost of matching a rule; the unit is one operator in one state, about a microsecond."""

Roles: TypeAlias = "tuple[str, ...]"
Goal: TypeAlias = "tuple[Cell, str]"
Query: TypeAlias = "tuple[int, Goal, bool]"
"""A request for rule instances: a level, a goal, and whether the roles may have any individuals or only suggested individuals."""


class RuleInstance(NamedTuple):
    """A rule with the symbol of a goal, an individual for each role, and the positions of the unmet conditions."""

    rule: LearnedRule
    goal: Cell
    roles: Roles
    unmet: tuple[int, ...] = ()

    @property
    def named(self) -> dict[str, str]:
        """The individual in each role."""
        return dict(zip((role for role, _ in self.rule.kinds), self.roles, strict=True))

    @property
    def ground(self) -> Ground:
        """The step of the rule, with the individuals as arguments."""
        filled = self.named
        return self.rule.does[0], tuple([filled.get(term, term) for term in self.rule.does[1]])


Score: TypeAlias = "Callable[[RuleInstance], float]"


class Instances:
    """The instances of rules in the current state of a call, and the costs of goals; both are cached until the state changes.

    `rules` maps a level and a situation type to rules. Individuals in `excluded` fill no role, since rule instances for other goals
    consume them. `joins` contains compiled rules that several planning calls share.
    """

    def __init__(
        self,
        call: Call,
        rules: Iterable[LearnedRule],
        allowance: Allowance,
        score: Score | None = None,
        joins: dict[str, Bind | None] | None = None,
    ) -> None:
        self.call, self.allowance, self.score = call, allowance, score
        self.joins: dict[str, Bind | None] = {} if joins is None else joins
        self.rules: dict[tuple[int, str], list[LearnedRule]] = {}
        for rule in rules:
            if known(rule, call.program.problem):
                level = call.program.domain.behaviors[rule.does[0]].level
                self.rules.setdefault((level, rule.goal.situation), []).append(rule)
        self.finds: dict[str, Find | None] = {}
        self.achievers: dict[str, Achiever] = {}
        self.excluded: frozenset[str] = frozenset()
        self.age = -1
        self.found: dict[Query, list[RuleInstance]] = {}
        self.least: dict[Query, int] = {}
        self.more_than: dict[Query, float] = {}
        """Known bounds of the costs of goals: the cost is at most the bound in `least`, and exceeds the bound in `more_than`."""
        self.seen: set[Query] = set()
        self.cut = False
        self.picked: dict[tuple[int, str], Sequence[str]] = {}
        self.goals: dict[tuple[int, int, int], tuple[RuleInstance, list[Goal]]] = {}

    # ------------------------------------------------------------------------------------------------------------- instances

    def exclude(self, individuals: frozenset[str]) -> None:
        """Set the individuals that are excluded from all roles."""
        self.excluded, self.age = individuals, -1

    def refresh(self) -> None:
        """Clear the caches if the state has changed."""
        if self.age != self.call.table.age:
            self.age = self.call.table.age
            for cache in (self.found, self.least, self.more_than, self.picked, self.goals):
                cache.clear()

    def of(self, query: Query) -> list[RuleInstance]:
        """Return the rule instances for a goal in the current state."""
        self.refresh()
        if query not in self.found:
            level, (cell, value), suggested_or_not = query
            rules = self.rules.get((level, cell[0]), ())
            self.allowance.spend(MATCHING * len(rules))
            self.found[query] = [
                RuleInstance(rule, cell, *filled)
                for rule in rules
                for filled in islice(self.fillings(rule, cell, value, suggested_or_not), COMPARED)
                if self.excluded.isdisjoint(filled[0])
            ]
        return self.found[query]

    def fillings(
        self, rule: LearnedRule, cell: Cell, value: str, suggested_or_not: bool
    ) -> Iterator[tuple[Roles, tuple[int, ...]]]:
        """Return individuals for the roles of a rule, with the unmet conditions; the rule is compiled at its first use."""
        name, program = rule.name, self.call.program
        if name not in self.finds:
            conditions = soft(rule, program.problem)
            if name not in self.joins:
                self.joins[name] = finder(rule, program.writer, conditions)
            bind = self.joins[name]
            self.finds[name] = bind(self.call.table, self.pick) if bind is not None else None
            self.achievers[name] = Achiever(name, 0, conditions, {}, dict(rule.kinds), deep=True)
        find = self.finds[name]
        if program.domain.situations[cell[0]].quantity is not None:
            value = towards(self.call.table.now[cell[0]].get(cell[1]), value)
        return find(*arguments_of(cell[1]), value, suggested_or_not) if find is not None else iter(())

    def pick(self, candidates: tuple[str, ...], situation: str) -> Sequence[str]:
        """Return candidates for a role whose individual becomes the value of a situation type, free candidates first.

        If there are many candidates, the result contains one candidate for each combination of symmetry class and state.
        """
        found = self.picked.get((id(candidates), situation))
        if found is None:
            self.allowance.spent += len(candidates)
            table, symmetry, wanted = self.call.table, self.call.program.symmetry, self.call.space.candidates.wanted
            found = free = tuple([c for c in candidates if c not in self.excluded]) if self.excluded else candidates
            if len(free) > FEW:
                among = set(candidates)
                cells = [values for values in table.now.values() if not among.isdisjoint(values)]
                first = representatives(
                    symmetry.groups(free), table.holders.get(situation, {}), wanted.get(situation, {})
                )
                class_of = symmetry.class_of.get
                unlike = {
                    (class_of(c), *[class_of(values.get(c, "")) for values in cells]): c
                    for c in (*free[::-1], *first[::-1])
                }
                found = list(unlike.values())[::-1]
            self.picked[id(candidates), situation] = found
        self.allowance.spent += 1 + len(found)
        return found

    def goals_of(self, level: int, instance: RuleInstance, position: int) -> list[Goal]:
        """Return the goals for an unmet condition of a rule instance; achieving one of these goals suffices."""
        self.refresh()
        if (key := (level, id(instance), position)) not in self.goals:
            self.goals[key] = instance, self._goals_of(level, instance, position)
        return self.goals[key][1]

    def _goals_of(self, level: int, instance: RuleInstance, position: int) -> list[Goal]:
        achiever, named = self.achievers[instance.rule.name], instance.named
        condition = achiever.soft[position]
        if isinstance(condition, ValueCondition):
            situation, key = condition.situation, key_of(tuple([named.get(a, a) for a in condition.arguments]))
            if situation in self.call.program.rules:
                if (level, situation) in self.rules:
                    return [((situation, key), TRUE if (condition.value == TRUE) is not condition.negated else FALSE)]
            elif not condition.negated and key in self.call.table.now[situation]:
                return [((situation, key), named.get(condition.value, condition.value))]
        subgoals = self.call.space.subgoals.of(achiever, condition, named, level)
        return [((situation, key), value) for situation, key, values in subgoals for value in values]

    # ------------------------------------------------------------------------------------------------------------------ cost

    def met(self, goal: Goal) -> bool:
        """Return whether a goal holds in the current state."""
        (situation, key), value = goal
        return meets(self.call.table.now[situation].get(key, FALSE), value)

    def distance(self, level: int, goal: Goal) -> float:
        """Return the cost of a goal with suggested individuals, or else with any; infinite if no chain of rules achieves it."""
        cost = self.cost(level, goal, False)
        return cost if cost < inf else self.cost(level, goal, True)

    def cost(self, level: int, goal: Goal, suggested_or_not: bool) -> float:
        """Return the least number of rules in a chain that achieves a goal, or infinity if the number exceeds `FARTHEST`."""
        for most in range(FARTHEST + 1):
            self.cut, self.seen, before = False, set(), len(self.least)
            if self.within(level, goal, most, suggested_or_not):
                return most
            if not self.cut and len(self.least) == before:  # no chain of any length achieves the goal
                self.more_than.update((query, inf) for query in self.seen if query not in self.least)
                return inf
        return inf

    def within(self, level: int, goal: Goal, most: int, suggested_or_not: bool) -> bool:
        """Return whether the cost of a goal is at most `most`."""
        if self.met(goal):
            return True
        query = level, goal, suggested_or_not
        instances = self.of(query)
        if self.least.get(query, inf) <= most:
            return True
        if most <= 0 or self.more_than.get(query, 0) >= most:
            self.cut |= (query not in self.seen or query in self.least) and self.more_than.get(query, 0) < inf
            return False
        # A chain of rules that has its own goal as a subgoal isn't cheaper.
        before, self.more_than[query] = self.more_than.get(query, 0), most
        self.seen.add(query)
        if any(self.instance_within(level, one, most, suggested_or_not) for one in instances):
            self.least[query], self.more_than[query] = most, before
            return True
        return False

    def instance_within(self, level: int, instance: RuleInstance, most: int, suggested_or_not: bool) -> bool:
        """Return whether a rule instance costs at most `most`; an unmet condition without goals costs one rule."""
        alternatives = (self.goals_of(level, instance, n) for n in instance.unmet)
        return all(
            any(self.within(level, goal, most - 1, suggested_or_not) for goal in goals) if goals else most > 1
            for goals in alternatives
        )

    def by_cost(self, level: int, goal: Goal, below: float = inf) -> Iterator[tuple[int, list[RuleInstance]]]:
        """Yield the rule instances for a goal by increasing cost, up to `SLACK` above the least cost."""
        for suggested_or_not in (False, True):
            least, found = self.cost(level, goal, suggested_or_not), False
            left = self.of((level, goal, suggested_or_not)) if least < inf else []
            for cost in range(int(least), int(min(least + SLACK + 1, below))) if left else ():
                check("comparing applications of rules")
                equal = [one for one in left if self.instance_within(level, one, cost, suggested_or_not)]
                taken = {*map(id, equal)}  # comparing the instances themselves takes longer
                left, found = [one for one in left if id(one) not in taken], found or bool(equal)
                yield cost, equal
            if found:
                return

    def cheapest(self, level: int, goal: Goal, below: float = inf) -> Iterator[tuple[int, RuleInstance]]:
        """Yield at most `TRIES` rule instances for a goal with their costs, the best first; costs are computed on demand."""
        ranked = ((cost, one) for cost, equal in self.by_cost(level, goal, below) for one in self.ranked(level, equal))
        return islice(ranked, TRIES)

    def ranked(self, level: int, instances: Sequence[RuleInstance]) -> Iterator[RuleInstance]:
        """Yield equally cheap rule instances in order of preference.

        Instances that undo fewer achieved goals come first, then instances with fewer unmet conditions, then instances with
        a greater score.
        """
        if len(instances) < 2:
            yield from instances
            return
        every = checked(instances, "comparing applications of rules")
        rank = {id(one): (self.undone(level, one), len(one.unmet)) for one in every}
        for _, alike in groupby(sorted(instances, key=lambda one: rank[id(one)]), key=lambda one: rank[id(one)]):
            group = list(alike)
            if self.score is not None and len(group) > 1:
                group.sort(key=self.score, reverse=True)
            yield from group

    def undone(self, level: int, instance: RuleInstance) -> int:
        """Return the number of achieved goals that the step of a rule instance undoes.

        If an instance has unmet conditions, only the conditions with a single goal count: return the number of achieved goals that
        these single goals undo.
        """
        if instance.unmet:
            alternatives = (self.goals_of(level, instance, n) for n in instance.unmet)
            changes = [goals[0] for goals in alternatives if len(goals) == 1]
        else:
            done = self.call.space.forward[instance.ground[0]](*instance.ground[1])
            changes = [((situation, key), value) for situation, key, value in done[1]] if done is not None else []
        return sum(value != self.call.achieved.get(cell, value) for cell, value in changes)

    def next(self, level: int, instance: RuleInstance, goal: Goal) -> RuleInstance | None:
        """Return the cheapest instance of the same rule for a goal in the current state, or None if there is no such instance.

        Among equally cheap instances, instances with fewer unmet conditions are preferred, then the same step as before.
        """
        same_rule = ([w for w in equal if w.rule is instance.rule] for _, equal in self.by_cost(level, goal))
        equal = next(filter(None, same_rule), [])
        return min(equal, key=lambda w: (len(w.unmet), w.ground != instance.ground), default=None)

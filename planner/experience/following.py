"""Learned rules used as methods: to achieve a goal, achieve the unmet conditions of a rule, then apply the rule's step.

Other rules achieve the unmet conditions, one condition at a time. The cheapest rule instances for a goal are tried first
(`confab.planner.experience.instances`); of equally cheap instances, the most cogent is tried first. Conditions are achieved in
the order of earlier plans; without such an order, the most expensive condition is achieved first.

Rules spend the budget of the search. Failed attempts may waste a tenth of the budget (`confab.planner.experience.allowance`).
If `RulePolicy.follow` fails, the table of current values is unchanged, and the planner continues with a search.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import inf
from typing import TypeAlias

from confab.planner.experience.allowance import Allowance, OverspentError
from confab.planner.experience.instances import FARTHEST, SLACK, TRIES, Goal, Instances, RuleInstance, Score
from confab.planner.experience.matching import Bind
from confab.planner.hierarchical.call import Call
from confab.planner.hierarchical.methods import Ranked, unranked
from confab.planner.hierarchical.operators import Program
from confab.planner.hierarchical.refinement import RefinedStep
from confab.planner.hierarchical.workspace import EXPANSION, Keep
from confab.planner.transitions import Cell, arguments_of
from confab.reasoner.amounts import meets, number
from confab.reasoner.memory.experience import ITSELF, Experience, LearnedOrder, LearnedRule, Tally
from confab.reasoner.symbols import FALSE, TRUE, Condition, Fact, Symbol, ValueCondition, Witness

STEPS_PER_COST = 3
"""A goal of cost c may take at most `STEPS_PER_COST` * c + `SLACK` steps.

The cost of a goal may be smaller than the number of required steps, because the conditions are costed separately.
"""
TWICE = 2
"""Maximum number of times that `RulePolicy.achieve_all` achieves the same goal; a later goal may undo an earlier goal once."""
CASES, NEARLY = 3, 0.95
"""Two goals are ordered if at least `CASES` plans achieved both in this order; `NEARLY` is the required share of such plans."""

Steps: TypeAlias = "list[RefinedStep]"


class RulePolicy:
    """A policy that follows learned rules to achieve the goals of one planning call.

    Of equally cheap instances, the one with the greatest `score` is tried first. `joins` contains compiled rules that several
    planning calls share. `ranked` sorts the individuals for the roles of a method by preference.
    """

    def __init__(
        self,
        call: Call,
        rules: Iterable[LearnedRule],
        orders: Sequence[LearnedOrder] = (),
        score: Score | None = None,
        joins: dict[str, Bind | None] | None = None,
        ranked: Ranked = unranked,
    ) -> None:
        self.call, self.ranked = call, ranked
        self.allowance = Allowance(call.space)
        self.instances = Instances(call, rules, self.allowance, score, joins)
        self.first = call.program.levels[0]
        self.constants = frozenset(call.program.named) | {TRUE, FALSE}
        self.orders = frozenset(orders)
        self.before = _before(call.goal, orders, call.program)
        self.expects = all((self.first, situation) in self.instances.rules for situation, _ in self.open())
        self.steps_left = 0
        """Number of steps that may still be applied for the current goal."""
        self.serial, self.passed = True, set[str]()
        """`serial` is true until an achieved goal makes another goal unreachable.

        `passed` contains the situation types for which the policy has checked reachability.
        """

    # ----------------------------------------------------------------------------------------------------- the call's goals

    def open(self) -> dict[Cell, str]:
        """Return the goals of the call that don't hold in the current state."""
        return {cell: value for cell, value in self.call.goal.items() if not self.call.met(cell)}

    def waits(self, cell: Cell) -> bool:
        """Return whether another open goal should be achieved first."""
        return any(not self.call.met(other) for other in self.before.get(cell, ()))

    def every(self, cells: Mapping[Cell, str]) -> Iterator[RuleInstance]:
        """Yield the applicable rule instances of the most abstract level, for given goals or for their subgoals."""
        goals = dict.fromkeys(cells.items())
        for goal in (waiting := list(goals)):
            ready = [one for one in self.instances.of((self.first, goal, False)) if not one.unmet]
            yield from ready
            for _, one in () if ready else self.instances.cheapest(self.first, goal):
                new = [g for n in one.unmet for g in self.instances.goals_of(self.first, one, n) if g not in goals]
                goals.update(dict.fromkeys(new))
                waiting += new

    def ready(self) -> bool:
        """Return whether the effort wasted by rules is within the allowance."""
        return self.allowance.ready()

    def rank(self, cell: Cell) -> int:
        """Return 1 if one step of a rule achieves a goal, 2 if rules need several steps, and 0 if there is no rule for the goal."""
        goal = cell, self.call.goal[cell]

        def fewest() -> int:
            found = self.instances.of((self.first, goal, False)) or self.instances.of((self.first, goal, True))
            return min((1 + bool(one.unmet) for one in found), default=0)

        return (self.allowance.bounded(fewest) if self.ready() else 0) or 0

    # ------------------------------------------------------------------------------------------------------------- following

    def follow(self, level: int, targets: Mapping[Cell, str], keep: Keep) -> Steps | None:
        """Follow rules of a level to achieve the targets; return the applied steps, each with its refinement.

        Return None and leave the table unchanged if the rules fail, change a value to be kept, or exceed the allowance.
        """
        if not (self.ready() if level == self.first else self.allowance.left() > 0):
            return None
        return self.allowance.bounded(lambda: self.attempt(level, targets, keep))

    def attempt(self, level: int, targets: Mapping[Cell, str], keep: Keep) -> Steps | None:
        """Follow rules as `follow` does, without setting a limit on the effort of matching."""
        call, space, allowance = self.call, self.call.space, self.allowance
        wasted, start, expanded, began = (
            allowance.wasted_effort,
            len(call.table.trail),
            space.expanded,
            space.effort + allowance.spent,
        )
        other = self.other_open_goal(targets) if level == self.first else None
        try:
            steps = self.achieve_all(level, targets, keep)
            if steps is not None and other is not None:
                self.passed.add(other[0][0])
                self.serial = self.instances.distance(level, other) < inf
                if not self.serial:
                    call.table.undo(start)
                    steps = self.achieve_jointly(level, list(self.open().items()))
        except OverspentError:
            steps = None
        if steps is not None and call.refiner.wrong_value(start, targets, keep) is None:
            return steps
        allowance.wasted_expansions += space.expanded - expanded if level == self.first else 0
        allowance.wasted_effort = max(allowance.wasted_effort, wasted + space.effort + allowance.spent - began)
        call.table.undo(start)
        return None

    def achieve_all(self, level: int, targets: Mapping[Cell, str], keep: Keep) -> Steps | None:
        """Achieve the targets and restore the values to be kept; return the steps, or None if the rules fail."""
        start, steps = len(self.call.table.trail), list[RefinedStep]()
        achieved: dict[Cell, int] = {}
        while differing := self.differing(start, targets, keep):
            before = _before(differing, self.orders, self.call.program) if len(differing) > 1 else {}
            among = [goal for goal in differing.items() if achieved.get(goal[0], 0) < TWICE]
            cost = {goal: self.instances.distance(level, goal) for goal in among}
            among.sort(key=lambda goal: (sum(other in differing for other in before.get(goal[0], ())), -cost[goal]))
            for goal in among:
                self.steps_left = int(SLACK + STEPS_PER_COST * cost[goal]) if cost[goal] < inf else 0
                done = self.achieve(level, goal) if self.steps_left else None
                if done is not None:
                    steps += done
                    achieved[goal[0]] = achieved.get(goal[0], 0) + 1
                    break
            else:
                return None
        return steps

    def differing(self, start: int, targets: Mapping[Cell, str], keep: Keep) -> dict[Cell, str]:
        """Return the required values that don't hold: targets, and values to be kept that changed since `start`."""
        now, wanted = self.call.table.now, dict(targets)
        for cell in self.call.space.defined:
            if value := keep(cell, ""):
                wanted.setdefault(cell, value)
        for cell, first in self.call.table.before(start).items():
            if cell not in wanted and (value := keep(cell, first)) is not None:
                wanted[cell] = value
        return {cell: value for cell, value in wanted.items() if not meets(now[cell[0]].get(cell[1], FALSE), value)}

    # -------------------------------------------------------------------------------------------------------------- one goal

    def achieve(self, level: int, goal: Goal, above: tuple[Goal, ...] = (), below: float = inf) -> Steps | None:
        """Apply steps that achieve a goal; return None and leave the table unchanged if no rule instance achieves the goal.

        The goal is a subgoal of the goals `above`. Only instances with a cost less than `below` are tried.
        """
        if self.instances.met(goal):
            return []
        if goal in above or len(above) > FARTHEST:
            return None
        table, deviation = self.call.table, self.deviation(goal)
        for cost, instance in self.instances.cheapest(level, goal, below):
            if self.steps_left <= 0:
                return None
            mark, left = len(table.trail), self.steps_left
            steps = self.apply(level, instance, (*above, goal))
            if steps:
                most: float = cost
                if (steps[-1].behavior, steps[-1].arguments) == instance.ground:
                    # A defined situation type or an amount may need the same step several times.
                    most = below if self.deviation(goal) < deviation else 0.0
                    self.steps_left = left if most else self.steps_left
                rest = self.achieve(level, goal, above, most)
                if rest is not None and (above or self.undone_within_reach(level, mark)):
                    return steps + rest
            table.undo(mark)
        return None

    def undone_within_reach(self, level: int, mark: int) -> bool:
        """Return whether rules can restore the achieved goals of the call that were undone since a marked state."""
        kept, trail = self.call.achieved, self.call.table.trail[mark:]
        undone = dict.fromkeys((situation, key) for situation, key, _ in trail if (situation, key) in kept)
        return level != self.first or all(self.instances.distance(level, (cell, kept[cell])) < inf for cell in undone)

    def deviation(self, goal: Goal) -> float:
        """Return the distance of an amount from its goal, the number of wrong facts of a defined goal, otherwise zero."""
        (situation, key), value = goal
        if situation in self.call.program.rules:
            return len(self.call.space.subgoals.defining(situation, key, value == TRUE, self.call.program.levels[-1]))
        if self.call.program.domain.situations[situation].quantity is None:
            return 0.0
        now = float(number(self.call.table.now[situation].get(key)))
        return min(abs(now - float(number(bound.lstrip("<>=")))) for bound in value.split(","))

    def apply(self, level: int, instance: RuleInstance, above: tuple[Goal, ...]) -> Steps | None:
        """Achieve the unmet conditions of a rule instance, and apply the step of the rule; return the steps.

        If no instance of the rule for the goal remains after a condition is achieved, the method returns the steps so far. On
        failure the method returns None and may leave the table changed.
        """
        call, steps = self.call, list[RefinedStep]()
        rounds, fewest = 2 * len(self.instances.achievers[instance.rule.name].soft), inf
        while instance.unmet:
            many = sum(len(self.instances.goals_of(level, instance, n)) for n in instance.unmet)
            rounds, fewest = rounds - (many >= fewest), min(many, fewest)
            done = self.achieve_condition(level, instance, above) if rounds >= 0 else None
            if done is None:
                return None
            steps += done
            following = self.instances.next(level, instance, above[-1])
            if following is None:
                return steps
            instance = following
        if self.steps_left <= 0:
            return None
        self.steps_left -= 1
        call.space.expand(level)
        effort = call.space.effort
        step = call.refiner.do(level, *instance.ground)
        self.allowance.spend(EXPANSION if step is not None else call.space.effort - effort)  # also a failed search
        return None if step is None else [*steps, step]

    def achieve_condition(self, level: int, instance: RuleInstance, above: tuple[Goal, ...]) -> Steps | None:
        """Achieve an unmet condition of an instance so that the others remain reachable; return None if the rules achieve none."""
        conditions, named, table = self.instances.achievers[instance.rule.name].soft, instance.named, self.call.table
        goals = dict[int, list[Goal]]()
        cost = dict[Goal, float]()
        for n in instance.unmet:
            alternatives = self.instances.goals_of(level, instance, n)
            cost |= {goal: self.instances.distance(level, goal) for goal in alternatives}
            reachable = [goal for goal in alternatives if cost[goal] < inf]
            goals[n] = sorted(
                reachable, key=lambda goal: (cost[goal], len(reachable) > 1 and not self.suffices(instance, n, goal))
            )
        ready = [n for n in goals if goals[n]]

        def later(n: int) -> tuple[int, float]:
            earlier = (self.ordered(conditions[m], conditions[n], named) for m in ready if m != n)
            return sum(earlier), -cost[goals[n][0]]

        for n in sorted(ready, key=later):
            others_lost = False
            for goal in goals[n][:TRIES]:
                mark, left = len(table.trail), self.steps_left
                done = self.achieve(level, goal, above)
                if done is None:
                    continue
                condition = conditions[n]
                if isinstance(condition, Witness) and condition.negated:
                    self.steps_left = left  # each individual that the condition excludes may need separate steps
                if all(any(self.instances.distance(level, other) < inf for other in goals[m]) for m in ready if m != n):
                    return done
                table.undo(mark)
                others_lost = True
            if not others_lost:  # otherwise another condition is tried first
                return None
        return None

    def suffices(self, instance: RuleInstance, position: int, goal: Goal) -> bool:
        """Return whether achieving a goal satisfies an unmet condition; true, untested, for amounts and defined situation types."""
        table, achiever, program = self.call.table, self.instances.achievers[instance.rule.name], self.call.program
        if goal[0][0] in program.rules or program.domain.situations[goal[0][0]].quantity is not None:
            return True
        mark, age = len(table.trail), table.age
        table.put(*goal[0], goal[1])
        holds = self.call.space.subgoals.tests.holds(achiever, achiever.soft[position], instance.named)
        table.undo(mark)
        if self.instances.age == age:
            self.instances.age = table.age  # undoing has restored the state
        return holds

    def ordered(self, first: Condition, then: Condition, named: Mapping[str, str]) -> bool:
        """Return whether earlier plans achieved the condition `first` before the condition `then`."""
        one, other = fact(first, named), fact(then, named)
        return one is not None and other is not None and LearnedOrder.of(one, other, self.constants) in self.orders

    # --------------------------------------------------------------------------------------------------------- goals jointly

    def other_open_goal(self, targets: Mapping[Cell, str]) -> Goal | None:
        """Return a reachable open goal of a target's situation type that isn't checked yet and isn't a target, or None."""
        kinds = {cell[0] for cell in targets} - self.passed if self.serial else set()
        for cell, value in reversed(self.call.goal.items()) if kinds else ():
            if cell[0] in kinds and cell not in targets and not self.call.met(cell):
                goal = cell, value
                return goal if self.instances.distance(self.first, goal) < inf else None
        return None

    def achieve_jointly(self, level: int, goals: Sequence[Goal]) -> Steps | None:
        """Achieve the conditions of the last step of every goal first, then apply all these last steps; return the steps.

        This method is for goals that make each other unreachable. The rule instances of two goals never consume the same
        individual. On failure, the method returns None and may leave the table changed.
        """
        chosen, steps = list[tuple[Goal, RuleInstance]](), list[RefinedStep]()
        try:
            for goal in goals:
                found = next(self.instances.cheapest(level, goal), None)
                if found is None:
                    return None
                chosen.append((goal, found[1]))
                self.instances.exclude(self.instances.excluded | self.consumed(found[1]))
        finally:
            self.instances.exclude(frozenset())
        alternatives = (self.instances.goals_of(level, one, n) for _, one in chosen for n in one.unmet)
        subgoals = list(dict.fromkeys(of_one[0] for of_one in alternatives if of_one))
        while subgoals:
            done = self.achieve_nearest(level, subgoals)
            if done is None:
                return None
            steps += done
            subgoals = [goal for goal in subgoals if not self.instances.met(goal)]
        for goal, one in chosen:
            following = self.instances.next(level, one, goal)
            self.steps_left = SLACK
            last = self.apply(level, following, (goal,)) if following is not None else None
            if last is None:
                return None
            steps += last
        return steps

    def achieve_nearest(self, level: int, subgoals: Sequence[Goal]) -> Steps | None:
        """Achieve the cheapest subgoal that keeps other subgoals of such costs reachable, or return None if there is none."""
        table, cost = self.call.table, {goal: self.instances.distance(level, goal) for goal in subgoals}
        for goal in sorted((goal for goal in subgoals if cost[goal] < inf), key=cost.__getitem__):
            near = [other for other in subgoals if other != goal and cost[other] <= cost[goal] + SLACK]
            self.steps_left, mark = int(cost[goal]) + SLACK, len(table.trail)
            done = self.achieve(level, goal)
            if done and all(self.instances.distance(level, other) < inf for other in near):
                return done
            table.undo(mark)
        return None

    def consumed(self, instance: RuleInstance) -> set[str]:
        """Return the individuals in those conditions of a rule instance that the rule's step makes false."""
        named, behavior = instance.named, self.call.program.domain.behaviors[instance.rule.does[0]]
        bound = {p.name: individual for p, individual in zip(behavior.parameters, instance.ground[1], strict=True)}
        made = {(e.situation, tuple([bound.get(a, a) for a in e.arguments])): e.value for e in behavior.effects}
        required = [found for c in instance.rule.asks if (found := fact(c, named)) is not None]
        return {
            individual
            for one in required
            if bound.get(value := made.get((one.symbol.situation, one.symbol.arguments), one.value), value) != one.value
            for individual in one.symbol.arguments
        }


def by_rules(policy: RulePolicy) -> None:
    """Achieve goals of a call by rules alone, until the rules achieve no further goal."""
    call, progress = policy.call, True
    while progress:
        progress = False
        for cell, value in sorted(policy.open().items(), key=lambda item: policy.waits(item[0])):
            if not call.met(cell):
                steps = policy.attempt(policy.first, {cell: value}, call.space.keeping(call.achieved))
                if steps is not None:
                    call.steps += steps
                    call.achieved[cell] = value
                    progress = True


def rules_in(experience: Experience) -> list[LearnedRule]:
    """Return the rules of an experience that aren't disabled."""
    said = sorted(experience.said.items())
    return [one for name, one in said if isinstance(one, LearnedRule) and name not in experience.disabled]


def usable(experience: Experience) -> list[LearnedOrder]:
    """Return the orders of goals that nearly all plans had; goals of one situation type must have a common individual."""
    counts = experience.totals()
    found = []
    for name, order in sorted(experience.said.items()):
        if (
            isinstance(order, LearnedOrder)
            and name not in experience.disabled
            and (order.shared or order.first != order.then)
        ):
            so = counts.get(name, {}).get(ITSELF, Tally()).chosen
            other = counts.get(order.reversed.name, {}).get(ITSELF, Tally()).chosen
            if so >= CASES and so >= NEARLY * (so + other):
                found.append(order)
    return found


def fact(condition: Condition, named: Mapping[str, str]) -> Fact | None:
    """Return the fact that a positive value condition requires, with individuals in the roles; None for other conditions."""
    if not isinstance(condition, ValueCondition) or condition.negated:
        return None
    arguments = tuple([named.get(a, a) for a in condition.arguments])
    return Fact(Symbol(condition.situation, arguments), named.get(condition.value, condition.value))


def _before(goal: Mapping[Cell, str], orders: Iterable[LearnedOrder], program: Program) -> dict[Cell, list[Cell]]:
    """Return, for each goal, the goals that the orders place before this goal."""
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
                    if other != cell and LearnedOrder.of(facts[other], facts[cell], constants) == order:
                        found.setdefault(cell, []).append(other)
    return found

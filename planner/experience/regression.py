"""Goal regression through a plan: each step that achieves a needed fact becomes a lifted rule.

The regression starts with the goals and visits the steps of the plan backwards. A condition is needed if the remaining steps
achieve the goals only under this condition. A step is relevant if a needed condition holds after the step and not before the
step; the step's preconditions then replace this condition. Each needed change of a relevant step becomes the goal of a rule
for the step. In a rule, individuals that no behaviour names become roles; a role has the narrowest class that a condition
requires.

Goal regression is due to Waldinger, "Achieving several goals simultaneously", Machine Intelligence 8 (1977). Lifted rules are
learned in a similar way by Moose (Chen et al., AAAI 2026). In this module, each rule stands for one causal link; chains of
rules cover longer plans. A quantified condition is replaced by the conditions of the individual that satisfied it, and a
disjunction by the alternative that held. The plan checker evaluates all conditions (`confab.planner.validation`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import permutations

from confab.planner.hierarchical.operators import named
from confab.planner.validation import BehaviorReader, LoggedState
from confab.reasoner.afterwards import closed
from confab.reasoner.amounts import Amount, inside, meets, towards
from confab.reasoner.derivation import strata
from confab.reasoner.language import substituted, terms, walk
from confab.reasoner.limits import check
from confab.reasoner.memory.experience import Ground, LearnedOrder, LearnedRule, LearningError
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    AnyOf,
    ClassCondition,
    Comparison,
    Condition,
    EqualityCondition,
    Fact,
    RelationCondition,
    ValueCondition,
    Witness,
)

WRITABLE = ValueCondition, RelationCondition, ClassCondition, EqualityCondition, Witness, AnyOf
"""Types of conditions that memory files can express; rules with other conditions aren't learned."""
STATIC = RelationCondition, ClassCondition
BINDINGS = 100
"""Maximum number of derivations of a defined fact that are examined to find a derivation without a cycle."""


@dataclass(frozen=True)
class ExecutedStep:
    """An executed step: the ground preconditions, and the changes, each with the conditions of the effect."""

    ground: Ground
    asked: tuple[Condition, ...]
    changes: tuple[tuple[str, tuple[str, ...], str, tuple[Condition, ...]], ...]
    mark: int


class PlanTrace:
    """The steps of a plan, executed one after another on the facts of the plan checker."""

    def __init__(self, problem: Problem, steps: Sequence[Ground]) -> None:
        self.problem, self.rules, self.facts = problem, BehaviorReader(problem), LoggedState(problem, problem.initial)
        self.constants = frozenset(named(problem)) | {TRUE, FALSE}
        self.written = frozenset(named(problem, rests=False)) | {TRUE, FALSE}
        """The individuals that behaviours name; all other individuals, including rest values, become roles."""
        self.done: list[ExecutedStep] = []
        self.achieved: dict[Fact, int] = {}
        for number, (name, arguments) in enumerate(steps):
            self._do(number, name, arguments)

    def _do(self, number: int, name: str, arguments: tuple[str, ...]) -> None:
        check("learning")
        behavior, facts = self.problem.domain.behaviors[name], self.facts
        given = {p.name: argument for p, argument in zip(behavior.parameters, arguments, strict=True)}
        bound = self.rules.satisfied(behavior.preconditions, given, behavior.kinds, facts)
        if bound is None:
            raise LearningError(f"step {number} ({' '.join((name, *arguments))}): its preconditions don't hold there")
        asked = list(self.plain(behavior.preconditions, bound, behavior.kinds, facts))
        kinds = [
            ClassCondition(bound[individual], kind)
            for individual, kind in behavior.kinds.items()
            if individual in bound
        ]
        because: dict[tuple[str, tuple[str, ...]], list[Condition]] = {}
        for effect in behavior.effects:
            inner = self.rules.satisfied(effect.when, bound, behavior.kinds, facts) if effect.when else None
            if inner is not None:
                cell = effect.situation, tuple([inner.get(a, a) for a in effect.arguments])
                because.setdefault(cell, []).extend(self.plain(effect.when, inner, behavior.kinds, facts))
        made = self.rules.changes(behavior, arguments, facts)
        if made is None:
            raise LearningError(
                f"step {number} ({' '.join((name, *arguments))}): an amount would take a value that isn't allowed"
            )
        changes = [(situation, key, value, tuple(because.get((situation, key), ()))) for situation, key, value in made]
        self.done.append(ExecutedStep((name, arguments), (*kinds, *asked), tuple(changes), len(facts.log)))
        goals = self.problem.goal
        before = {s for s, value in goals.items() if meets(facts.value(s.situation, s.arguments), value)}
        for situation, key, value, _ in changes:
            facts.put(situation, key, value)
        for symbol, value in goals.items():
            if symbol not in before and meets(facts.value(symbol.situation, symbol.arguments), value):
                self.achieved[Fact(symbol, value)] = number

    def plain(
        self, conditions: Sequence[Condition], bound: Mapping[str, str], kinds: Mapping[str, str], facts: LoggedState
    ) -> Iterator[Condition]:
        """Yield ground conditions without quantifiers and alternatives.

        A quantified condition is replaced by the conditions of an individual that satisfies the condition; alternatives
        are replaced by an alternative that holds. In a negated condition, local variables become explicit witnesses.
        """
        for condition in (substituted(lifted, bound) for lifted in closed(conditions, frozenset(bound), kinds)):
            if isinstance(condition, Witness) and not condition.negated:
                inner = {**kinds, condition.variable: condition.kind}
                wanted = (*condition.conditions, ClassCondition(condition.variable, condition.kind))
                found = self.rules.satisfied(wanted, {}, inner, facts)
                if found is not None:
                    yield from self.plain(wanted, found, inner, facts)
            elif isinstance(condition, AnyOf) and not condition.negated:
                alternatives = (
                    (group, self.rules.satisfied(group, {}, kinds, facts)) for group in condition.alternatives
                )
                group, found = next(
                    (alternative for alternative in alternatives if alternative[1] is not None), ((), None)
                )
                yield from self.plain(group, found or {}, kinds, facts)
            else:
                yield condition

    def because(self, condition: ValueCondition, facts: LoggedState) -> Iterator[list[Condition]]:
        """Yield the derivations of a defined situation in a state; each derivation is a list of conditions."""
        rules = self.problem.domain.rules
        of = [(rule.conditions, rule.behavior.kinds, rule.parameters) for rule in rules[condition.situation]]
        group = next(group for group in strata(rules) if condition.situation in group)
        for conditions, kinds, parameters in sorted(of, key=lambda its: any(s in group for s in situations_of(its[0]))):
            own = dict(zip((p.name for p in parameters), condition.arguments, strict=True))
            if not all(individual in self.problem.members(kinds[name]) for name, individual in own.items()):
                continue
            conditions, kinds = opened(conditions, kinds)
            for _ in range(BINDINGS):
                found = self.rules.satisfied(conditions, own, kinds, facts)
                if found is None:
                    break
                classes = [ClassCondition(found[v], kind) for v, kind in kinds.items() if v in found]
                yield [*classes, *self.plain(conditions, found, kinds, facts)]
                others = [EqualityCondition(v, found[v], negated=True) for v in kinds if v in found and v not in own]
                conditions = (*conditions, AnyOf(tuple((other,) for other in others)))

    # -------------------------------------------------------------------------------------------------------- regressing

    def rules_of(self) -> Iterator[LearnedRule]:
        """Yield a rule for each needed change of a step; afterwards, the facts of the trace are those of the initial state."""
        later, facts = self.facts, LoggedState(self.problem, self.problem.initial)
        for done in self.done:
            for situation, key, value, _ in done.changes:
                facts.put(situation, key, value)
        need: dict[Condition, None] = {
            ValueCondition(s.situation, s.arguments, value): None
            for s, value in self.problem.goal.items()
            if meets(later.value(s.situation, s.arguments), value)
        }
        for done in reversed(self.done):
            check("learning")
            facts.undo(done.mark)
            before, achieved = self.needed(need, done, facts, later)
            if achieved:
                yield from self.links(done, achieved, facts, later)
                others = (rest for _, rest in self.hindered(achieved, facts))
                need = {c: None for c in (*before, *others) if not isinstance(c, (*STATIC, EqualityCondition))}
            later.undo(done.mark)

    def needed(
        self, after: Iterable[Condition], done: ExecutedStep, facts: LoggedState, later: LoggedState
    ) -> tuple[dict[Condition, None], dict[Condition, None]]:
        """Return the conditions needed before a step, and the conditions that the step achieves.

        The conditions `after` are needed after the step. If the step makes a defined situation true, the facts of a
        derivation replace the situation. If the step makes a defined situation false, the facts of a derivation before the
        step replace the situation.
        """
        need, achieved = dict[Condition, None](), dict[Condition, None]()
        tries = BINDINGS

        def rests(c: Condition, above: tuple[Condition, ...]) -> list[tuple[Condition, bool]] | None:
            """Return a derivation's conditions, and whether each holds before the step; None if every derivation is circular."""
            nonlocal tries
            if self.rules.satisfied([c], {}, {}, facts) is not None:
                return [(c, True)]
            if not isinstance(c, ValueCondition) or c.situation not in self.problem.domain.rules:
                return [(c, False)]
            for alternative in (
                self.because(c, later if (c.value == TRUE) is not c.negated else facts) if c not in above else ()
            ):
                tries -= 1
                found: list[tuple[Condition, bool]] = [(c, False)]
                for other in alternative:
                    inner = rests(other, (*above, c)) if tries > 0 else None
                    if inner is None:
                        break
                    found += inner
                else:
                    return found
            return None

        changed, defined = {(situation, key) for situation, key, _, _ in done.changes}, self.problem.domain.rules
        for c in after:
            if isinstance(c, ValueCondition) and not (c.situation in defined or (c.situation, c.arguments) in changed):
                need[c] = None
                continue
            for other, holds in rests(c, ()) or [(c, False)]:
                (need if holds else achieved)[other] = None
        if achieved:
            need.update(dict.fromkeys(done.asked))
            for c in achieved:
                need.update(dict.fromkeys(self.before(c, done)))
        return need, achieved

    def links(
        self,
        done: ExecutedStep,
        achieved: Iterable[Condition],
        facts: LoggedState,
        later: LoggedState,
    ) -> Iterator[LearnedRule]:
        """Yield the rule for each needed change of a step; the change is the rule's goal."""
        goals: dict[ValueCondition, None] = {}
        for c in achieved:
            if isinstance(c, ValueCondition) and c.situation in self.problem.domain.rules:
                value = c.value if not c.negated else FALSE if c.value == TRUE else TRUE
                goals[ValueCondition(c.situation, c.arguments, value)] = None
                continue
            about = list(asked(c))
            for situation, key, value, _ in done.changes:
                if any(i.situation == situation and (i is not c or i.arguments == key) for i in about):
                    goals[ValueCondition(situation, key, value)] = None
        for goal in goals:
            need, own = self.needed([goal], done, facts, later)
            if own:
                need.update(dict.fromkeys(c for individual, _ in self.hindered(own, facts) for c in individual))
                order = dict.fromkeys((*goal.arguments, goal.value, *done.ground[1]))
                order.update((t, None) for c in need for i in walk(c) for t in terms(i) if not t.startswith("?"))
                rule = self.lifted(self.aimed(goal, facts), tuple(need), done.ground, tuple(order))
                if rule is not None:
                    yield rule

    def aimed(self, goal: ValueCondition, facts: LoggedState) -> ValueCondition:
        """Return the goal of a rule: of an amount, the direction of its change, since equal amounts are rare in other problems."""
        if self.problem.domain.situations[goal.situation].quantity is None:
            return goal
        return replace(goal, value=towards(facts.value(goal.situation, goal.arguments), goal.value))

    def before(self, condition: Condition, done: ExecutedStep) -> Iterator[Condition]:
        """Yield the conditions of those effects of a step that contribute to a given condition."""
        about = {(c.situation, c.arguments) for c in walk(condition) if isinstance(c, ValueCondition)}
        situations = {situation for situation, _ in about}
        plain = isinstance(condition, ValueCondition)
        for situation, key, _, when in done.changes:
            if when and ((situation, key) in about if plain else situation in situations):
                yield from when

    def hindered(
        self, achieved: Iterable[Condition], facts: LoggedState
    ) -> Iterator[tuple[list[Condition], Condition]]:
        """For each achieved "no object …" condition that exactly one individual violated, yield two results.

        The first result contains the conditions that the individual satisfied before the step. The second result is the
        condition that no other individual satisfies these conditions.
        """
        for c in achieved:
            if isinstance(c, Witness) and c.negated:
                wanted = (*c.conditions, ClassCondition(c.variable, c.kind))
                found = self.rules.satisfied(wanted, {}, {c.variable: c.kind}, facts)
                other = EqualityCondition(c.variable, (found or {}).get(c.variable, ""), negated=True)
                rest = replace(c, conditions=(*c.conditions, other))
                if found is not None and self.rules.satisfied([rest], {}, {}, facts) is not None:
                    yield list(self.plain(wanted, found, {}, facts)), rest

    def lifted(
        self, goal: ValueCondition, need: Sequence[Condition], step: Ground, order: Sequence[str]
    ) -> LearnedRule | None:
        """Return a rule with roles and without implied conditions, or None if memory files can't express a condition."""
        members = self.problem.members
        if not all(isinstance(inner, WRITABLE) for c in need if not isinstance(c, Comparison) for inner in walk(c)):
            return None
        kinds: dict[str, str] = {}

        def narrow(individual: str, kind: str) -> None:
            known = kind in self.problem.classes and individual not in self.written
            if known and (individual not in kinds or len(members(kind)) < len(members(kinds[individual]))):
                kinds[individual] = kind

        for c in need:
            if isinstance(c, ClassCondition) and not c.negated:
                narrow(c.term, self.plainest(c.term, c.kind))
        situations = self.problem.domain.situations
        asked = [inner for c in (goal, *need) for inner in walk(c)]
        for inner in sorted(asked, key=lambda inner: isinstance(inner, RelationCondition)):
            ends: Iterable[tuple[str, str]] = ()
            if isinstance(inner, ValueCondition):
                kind = situations[inner.situation]
                ends = zip((*inner.arguments, inner.value), (*kind.arguments, kind.range), strict=True)
                if kind.quantity is not None:
                    ends = zip(inner.arguments, kind.arguments, strict=True)
            elif isinstance(inner, RelationCondition):
                ends = ((individual, "") for individual in inner.arguments)
            for individual, of in ends:
                if individual not in kinds and not individual.startswith("?"):
                    narrow(individual, self.plainest(individual, of))
        roles: dict[str, str] = {}
        for individual in order:
            if individual in kinds:
                of = kinds[individual]
                base = "?" + (of.lower() if of.isupper() else of[0].lower() + of[1:])
                same = sum(role.rstrip("0123456789") == base for role in roles.values())
                roles[individual] = base if not same else f"{base}{same + 1}"
        known = {(c.situation, c.arguments) for c in need if isinstance(c, ValueCondition) and not c.negated}
        asks: dict[Condition, None] = {}
        for c in need:
            if isinstance(c, EqualityCondition | Comparison):
                continue  # different roles have different individuals; the behaviour contains the comparisons
            if isinstance(c, ValueCondition) and c.negated and (c.situation, c.arguments) in known:
                continue
            if isinstance(c, ClassCondition) and not c.negated:
                known_already = c.term in self.written or members(kinds[c.term]) <= members(c.kind)
                if known_already:
                    continue
            asks[ordered_inside(substituted(c, roles))] = None
        own = {term: roles.get(term, term) for term in (*goal.arguments, goal.value, *step[1])}
        used = {*own.values(), *(term for c in asks for inner in walk(c) for term in terms(inner))}
        return LearnedRule(
            ValueCondition(goal.situation, tuple(own[a] for a in goal.arguments), own[goal.value]),
            tuple(sorted(asks, key=repr)),
            (step[0], tuple(own[a] for a in step[1])),
            tuple((role, kinds[individual]) for individual, role in roles.items() if role in used),
        )

    def plainest(self, individual: str, of: str) -> str:
        """Return `of`, or if it is empty or a situation type, the individual's widest class within `of` that isn't one."""
        members, situations = self.problem.members, self.problem.domain.situations
        if of and of not in situations:
            return of
        within = [
            k
            for k in self.problem.classes
            if k not in situations and individual in members(k) and (not of or members(k) <= members(of))
        ]
        return max(within, key=lambda k: len(members(k)), default=of)

    # ------------------------------------------------------------------------------------------------------------ order

    def orders(self) -> Iterator[LearnedOrder]:
        """For every two goals that different steps achieved, yield the order in which they were achieved."""
        for first, then in permutations(self.achieved, 2):
            if self.achieved[first] < self.achieved[then]:
                yield LearnedOrder.of(first, then, self.constants)


def opened(conditions: Iterable[Condition], kinds: Mapping[str, str]) -> tuple[tuple[Condition, ...], dict[str, str]]:
    """Return the classes of all variables, and the conditions; a positive `Witness` is replaced by the conditions inside of it."""
    found, of = list[Condition](), dict(kinds)
    for condition in conditions:
        if isinstance(condition, Witness) and not condition.negated:
            individual = condition.variable
            while individual in of:  # another variable of the same name
                individual += "_"
            of[individual] = condition.kind
            inner, of = opened([substituted(c, {condition.variable: individual}) for c in condition.conditions], of)
            found += [*inner, ClassCondition(individual, condition.kind)]
        else:
            found.append(condition)
    return tuple(found), of


def situations_of(conditions: Iterable[Condition]) -> Iterator[str]:
    """Yield the situation types in conditions."""
    for condition in conditions:
        yield from (inner.situation for inner in walk(condition) if isinstance(inner, ValueCondition))


def asked(condition: Condition) -> Iterator[ValueCondition | Amount]:
    """Yield the conditions on symbols, and the amounts, inside a condition."""
    for inner in walk(condition):
        if isinstance(inner, ValueCondition):
            yield inner
        elif isinstance(inner, Comparison):
            yield from (i for e in (inner.left, inner.right) for i in inside(e) if isinstance(i, Amount))


def ordered_inside(condition: Condition) -> Condition:
    """Return a condition with its parts in canonical order; equal rules then have equal names."""
    if isinstance(condition, Witness):
        return replace(condition, conditions=tuple(sorted(map(ordered_inside, condition.conditions), key=repr)))
    if isinstance(condition, AnyOf):
        groups = (tuple(sorted(map(ordered_inside, group), key=repr)) for group in condition.alternatives)
        return replace(condition, alternatives=tuple(sorted(groups, key=repr)))
    return condition

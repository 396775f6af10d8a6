"""Is this a plan? A checker that shares no code with any search, and reads conditions as they are written.

A behaviour's preconditions hold if *some* individuals, put in for its variables, satisfy them all. Each conjunction is read once
into a list of tests and choices, the most determined condition first, and then asked of every state: a long plan is checked
in time that grows with its length and not with the world.

What a plan of several levels means is in docs/levels.md. In short: what a step's level sees is in the end as the step says; of
what the level below adds, that which has a rest value and was touched is at rest; the next step begins where this one ended.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, groupby
from typing import TypeAlias

from planner.plan import Plan, Step
from reasoner.symbols import (
    FALSE,
    AnyOf,
    Behavior,
    ClassCondition,
    Condition,
    EqualityCondition,
    Problem,
    RelationCondition,
    State,
    Symbol,
    ValueCondition,
    ValueEffect,
    Witness,
    substituted,
)

Arguments: TypeAlias = "tuple[str, ...]"
Bindings: TypeAlias = "dict[str, str]"
Cell: TypeAlias = "tuple[str, Arguments]"
"""A symbol as its situation type and arguments."""
Test: TypeAlias = "Callable[[Facts, Bindings], bool]"
Choice: TypeAlias = "tuple[str, frozenset[str], Callable[[Facts, Bindings], Iterable[str]]]"
"""A variable, the individuals of its class, and those of which one can be it."""
Part: TypeAlias = "Test | Choice"
Change: TypeAlias = "tuple[str, Arguments, str]"

MOST_LACKING = 4
"""Conditions that are left out together where it is asked which of them a behaviour lacks."""


@dataclass(frozen=True)
class Fault:
    """What is wrong with a plan: where in the tree (empty for the whole), and what."""

    path: tuple[int, ...]
    text: str


def validate(problem: Problem, plan: Plan) -> list[Fault]:
    """Return what is wrong with a plan; nothing if it is one.

    Checked are: every step's ID; on each level, every step's preconditions in the state in which it is done; that the
    refinement of a step leaves what that step says, as far as its level knows the symbols, and at rest what else it touched;
    and the goal. After a step that can't be done, nothing more is checked.
    """
    check = _Check(problem, max((step.level for step in plan.walk()), default=0))
    if check.carried_out(plan.steps, 0, (), "the plan"):
        for symbol, wanted in problem.goal.items():
            got = check.facts.value(symbol.situation, symbol.arguments) or FALSE
            if got != wanted:
                check.fault((), f"the goal {symbol} = {wanted} isn't reached: it is {got} in the end")
    return check.faults


def successor(problem: Problem, behavior: Behavior, arguments: Sequence[str], state: State) -> dict[Symbol, str] | None:
    """Return the state after a behaviour, or None if its preconditions don't hold."""
    rules = Rules(problem)
    fits = rules.fits(behavior, tuple(arguments))
    changes = rules.changes(behavior, tuple(arguments), Facts(problem, state)) if fits else None
    if changes is None:
        return None
    return {**state, **{Symbol(situation, key): value for situation, key, value in changes}}


class _Check:
    """A plan carried out on paper: the facts so far, and what was wrong."""

    def __init__(self, problem: Problem, depth: int) -> None:
        self.problem = problem
        self.levels = problem.domain.levels
        self.rests = {name: kind.rest for name, kind in problem.domain.situations.items() if kind.rest is not None}
        self.depth = depth  # the lowest level that the plan speaks of
        self.rules = Rules(problem)
        self.facts = Facts(problem, problem.initial)
        self.faults: list[Fault] = []

    def fault(self, path: tuple[int, ...], text: str) -> None:
        self.faults.append(Fault(path, text))

    def carried_out(
        self, steps: Sequence[Step], above: int, path: tuple[int, ...], name: str, inside: bool = False
    ) -> bool:
        """Carry out steps that together refine one of level `above`, or the task (level 0); whether all could be done.

        What the goal says of a symbol comes before its rest value, but not `inside` of a step, which knows no goal.

        Among the steps of the next level may be stretches of lower ones, each of which stands in the place of such a step.
        """
        level = next((level for level in self.levels if level > above), above)
        touched: dict[Cell, None] = {}
        for part in stretches(steps, level):
            mark = len(self.facts.log)
            if part[0].level > level:
                done = self.carried_out(part, level, part[0].path, f"the stretch from {part[0]} to {part[-1]}", inside)
            else:
                done = self.step(part[0])
            if not done:
                return False
            touched.update(dict.fromkeys(self.facts.since(mark)))
        for situation, arguments in touched:
            rest = self.rests.get(situation)
            if rest is None or self.facts.value(situation, arguments) == rest:
                continue
            symbol = Symbol(situation, arguments)
            if above < self.problem.first_level(symbol) <= level and (inside or symbol not in self.problem.goal):
                got = self.facts.value(situation, arguments)
                self.fault(path, f"{name} touches {symbol} and leaves it {got}; at rest it is {rest}")
        return True

    def step(self, step: Step) -> bool:
        """Carry out one step with its refinement; whether all of it could be done."""
        behavior = self.problem.domain.behaviors.get(step.behavior)
        if behavior is None or not self.rules.fits(behavior, step.arguments):
            self.fault(step.path, f"{step}: no such behaviour, or its parameters don't take these arguments")
            return False
        expected_id = self.problem.id_of(step.behavior, step.arguments)
        if step.id != expected_id:
            self.fault(step.path, f"{step}: its ID by the numbering of level {behavior.level} is {expected_id}")
        changes = self.rules.changes(behavior, step.arguments, self.facts)
        if changes is None:
            self.fault(step.path, f"{step}: its preconditions don't hold where it is done")
            return False
        mark = len(self.facts.log)
        if not step.steps:
            for situation, arguments, value in changes:
                self.facts.put(situation, arguments, value)
            if behavior.level < self.depth and self.facts.since(mark):
                self.fault(step.path, f"{step}: it isn't refined, and other steps are")
            return True
        wanted = {(situation, arguments): value for situation, arguments, value in changes}
        if not self.carried_out(step.steps, behavior.level, step.path, str(step), inside=True):
            return False
        said = {**self.facts.since(mark), **wanted}  # what isn't named stays as it was before
        for cell in sorted(cell for cell, value in said.items() if self.facts.value(*cell) != value):
            symbol, got = Symbol(*cell), self.facts.value(*cell) or FALSE
            if cell in wanted or self.problem.sees(behavior.level, symbol, said[cell]):
                self.fault(step.path, f"{step}: its refinement leaves {symbol} = {got}, not {said[cell]}")
        return True


def stretches(steps: Sequence[Step], level: int) -> Iterator[list[Step]]:
    """Yield each step of a level by itself, and what is below that level in stretches."""
    for lower, group in groupby(steps, key=lambda step: step.level > level):
        part = list(group)
        yield from [part] if lower else ([step] for step in part)


# ------------------------------------------------------------------------------------------------------ states and rules


class Facts:
    """A state that remembers what was changed: ``log`` has what was overwritten, oldest first."""

    def __init__(self, problem: Problem, state: State) -> None:
        self.problem = problem
        self.log: list[tuple[str, Arguments, str]] = []
        self._values: dict[str, dict[Arguments, str]] = {name: {} for name in problem.domain.situations}
        self._holders: dict[str, dict[str, dict[Arguments, None]]] = {}
        for symbol, value in state.items():
            self._values[symbol.situation][symbol.arguments] = value

    def value(self, situation: str, arguments: Arguments) -> str | None:
        """Return the value of a symbol, or None if there is no such symbol."""
        value = self._values[situation].get(arguments)
        return FALSE if value is None and self.exists(situation, arguments) else value

    def state(self) -> dict[Symbol, str]:
        """Return what is stated now."""
        return {Symbol(name, key): value for name, values in self._values.items() for key, value in values.items()}

    def exists(self, situation: str, arguments: Arguments) -> bool:
        """Return whether there is such a symbol: it is stated, or boolean and about individuals of the right classes."""
        if arguments in self._values[situation]:
            return True
        kind = self.problem.domain.situations[situation]
        return kind.boolean and all(
            argument in self.problem.members(of) for argument, of in zip(arguments, kind.arguments, strict=True)
        )

    def holders(self, situation: str, value: str) -> Iterable[Arguments]:
        """Return the arguments of the symbols that are stated to have a value."""
        if situation not in self._holders:
            of: dict[str, dict[Arguments, None]] = {}
            for arguments, its in self._values[situation].items():
                of.setdefault(its, {})[arguments] = None
            self._holders[situation] = of
        return self._holders[situation].get(value, ())

    def put(self, situation: str, arguments: Arguments, value: str) -> None:
        """Give a symbol that exists a value."""
        old = self._values[situation].get(arguments, FALSE)
        if old == value:
            return
        self.log.append((situation, arguments, old))
        self._values[situation][arguments] = value
        if situation in self._holders:
            self._holders[situation].get(old, {}).pop(arguments, None)
            self._holders[situation].setdefault(value, {})[arguments] = None

    def since(self, mark: int) -> dict[Cell, str]:
        """Return what has another value than when the log had the length `mark`, with the value of then."""
        before: dict[Cell, str] = {}
        for situation, arguments, old in self.log[mark:]:
            before.setdefault((situation, arguments), old)
        return {cell: old for cell, old in before.items() if self._values[cell[0]][cell[1]] != old}


class Rules:
    """What the behaviours of one problem ask and do, each read when it is first asked for."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self._read: dict[str, tuple[list[Part], list[tuple[list[Part], ValueEffect]]]] = {}
        self._rows: dict[tuple[str, int], dict[str, list[Arguments]]] = {}

    def fits(self, behavior: Behavior, arguments: Arguments) -> bool:
        """Whether the arguments are of the classes of the behaviour's parameters."""
        if len(arguments) != len(behavior.parameters):
            return False
        for parameter, argument in zip(behavior.parameters, arguments, strict=True):
            if argument not in self.problem.members(parameter.kind):
                return False
        return True

    def changes(self, behavior: Behavior, arguments: Arguments, facts: Facts) -> list[Change] | None:
        """Return the values that a behaviour gives to arguments that fit, in order; None if it isn't applicable."""
        if behavior.name not in self._read:
            self._read[behavior.name] = self._behavior(behavior)
        preconditions, effects = self._read[behavior.name]
        terms = {p.name: argument for p, argument in zip(behavior.parameters, arguments, strict=True)}
        satisfied = _first(preconditions, facts, terms)
        if satisfied is None:
            return None
        found = []
        for when, effect in effects:
            inner = _first(when, facts, satisfied) if when else satisfied
            if inner is not None:
                key = tuple([inner.get(a, a) for a in effect.arguments])
                if facts.exists(effect.situation, key):
                    found.append((effect.situation, key, inner.get(effect.value, effect.value)))
        return found

    def satisfied(
        self, conditions: Sequence[Condition], terms: Bindings, kinds: Mapping[str, str], facts: Facts
    ) -> Bindings | None:
        """Return a way to put individuals in for the other variables of conditions with which all hold, or None."""
        return _first(self.conjunction(conditions, set(terms), kinds), facts, terms)

    def lacking(
        self, conditions: Sequence[Condition], terms: Bindings, kinds: Mapping[str, str], views: Sequence[Facts]
    ) -> tuple[Bindings, tuple[Condition, ...]]:
        """Return the fewest conditions without which the others hold in one of some states, with individuals put in.

        Also returns with which individuals the others hold. More than `MOST_LACKING` are looked for one by one.
        """

        def gives(number: int) -> bool:
            """Whether a condition gives a variable its value: without it the others hold of what isn't there."""
            c = conditions[number]
            return isinstance(c, ValueCondition) and not c.negated and c.value.startswith("?") and c.value not in terms

        order = sorted(range(len(conditions)), key=gives)
        for size in range(1, min(len(conditions), MOST_LACKING) + 1):
            for without in combinations(order, size):
                rest = [c for i, c in enumerate(conditions) if i not in without]
                for facts in views:
                    found = self.satisfied(rest, terms, kinds, facts)
                    if found is not None:
                        return found, tuple(substituted(conditions[i], found) for i in sorted(without))
        alone = [c for c in conditions if all(self.satisfied([c], terms, kinds, facts) is None for facts in views)]
        return terms, tuple(substituted(condition, terms) for condition in alone)

    def _behavior(self, behavior: Behavior) -> tuple[list[Part], list[tuple[list[Part], ValueEffect]]]:
        kinds = {p.name: p.kind for p in (*behavior.parameters, *behavior.variables)}
        bound = {p.name for p in behavior.parameters}
        preconditions = self.conjunction(behavior.preconditions, bound, kinds)
        # What becomes true wins, as in PDDL.
        effects = sorted(behavior.effects, key=lambda effect: effect.value != FALSE)
        return preconditions, [(self.conjunction(e.when, set(bound), kinds), e) for e in effects]

    def conjunction(self, conditions: Sequence[Condition], bound: set[str], kinds: Mapping[str, str]) -> list[Part]:
        """Return conditions as tests and choices; `bound` grows by what is chosen.

        What only nested conditions (`AnyOf`, `Witness`) mention is their own.
        """
        waiting = [c for c in conditions if not isinstance(c, AnyOf | Witness)]
        parts: list[Part] = []
        while waiting:
            condition = min(waiting, key=lambda c: (len(_plain(c) - bound), _breadth(c, bound)))
            unknown = sorted(_plain(condition) - bound)
            if not unknown:
                waiting.remove(condition)
                parts.append(self.test(condition, bound, kinds))
                continue
            bound.add(unknown[0])
            parts.append(self.choice(condition, unknown, kinds))
        nested = [c for c in conditions if isinstance(c, AnyOf | Witness)]
        return parts + [self.test(condition, bound, kinds) for condition in nested]

    def choice(self, condition: Condition, unknown: Sequence[str], kinds: Mapping[str, str]) -> Choice:
        """Return a choice of the first unknown variable of a condition: the individuals that could satisfy it."""
        variable, kind = unknown[0], kinds[unknown[0]]
        members = self.problem.members(kind)
        match condition:
            case ValueCondition(situation, arguments, value, False) if value == variable and variable not in arguments:
                if len(unknown) == 1:

                    def had(facts: Facts, terms: Bindings) -> Iterable[str]:
                        found = facts.value(situation, tuple([terms.get(a, a) for a in arguments]))
                        return () if found is None else (found,)

                    return variable, members, had
            case ValueCondition(situation, arguments, value, False) if value not in unknown:
                position = arguments.index(variable)

                def having(facts: Facts, terms: Bindings) -> Iterable[str]:
                    wanted = terms.get(value, value)
                    if wanted == FALSE:  # which is seldom stated
                        return self.problem.classes.get(kind, ())
                    return (found[position] for found in facts.holders(situation, wanted))

                return variable, members, having
            case RelationCondition(relation, arguments, False) if len(unknown) < len(set(arguments)):
                position = arguments.index(variable)
                known = next(i for i, a in enumerate(arguments) if a not in unknown)

                def related(facts: Facts, terms: Bindings) -> Iterable[str]:
                    rows = self._related(relation, known).get(terms.get(arguments[known], arguments[known]), ())
                    return dict.fromkeys([row[position] for row in rows])

                return variable, members, related
        return variable, members, lambda facts, terms: self.problem.classes.get(kind, ())

    def _related(self, relation: str, position: int) -> Mapping[str, list[Arguments]]:
        if (relation, position) not in self._rows:
            found: dict[str, list[Arguments]] = {}
            for row in sorted(self.problem.relations.get(relation, ())):
                found.setdefault(row[position], []).append(row)
            self._rows[relation, position] = found
        return self._rows[relation, position]

    def test(self, condition: Condition, bound: set[str], kinds: Mapping[str, str]) -> Test:
        """Return a condition as a test."""
        match condition:
            case ValueCondition(situation, arguments, value, negated):

                def equal(facts: Facts, b: Bindings) -> bool:
                    got = facts.value(situation, tuple([b.get(a, a) for a in arguments]))
                    return (got == b.get(value, value)) is not negated

                return equal
            case RelationCondition(relation, arguments, negated):
                rows = self.problem.relations.get(relation, frozenset())
                return lambda facts, b: (tuple([b.get(a, a) for a in arguments]) in rows) is not negated
            case ClassCondition(term, kind, negated):
                members = self.problem.members(kind)
                return lambda facts, b: (b.get(term, term) in members) is not negated
            case EqualityCondition(left, right, negated):
                return lambda facts, b: (b.get(left, left) == b.get(right, right)) is not negated
            case Witness(variable, kind, conditions, negated):
                wanted = (*conditions, ClassCondition(variable, kind))
                inner = self.conjunction(wanted, bound - {variable}, {**kinds, variable: kind})
                return lambda facts, b: (_first(inner, facts, _without(b, variable)) is not None) is not negated
            case AnyOf(alternatives, negated):
                groups = [self.conjunction(group, set(bound), kinds) for group in alternatives]
                return lambda facts, b: any(_first(group, facts, b) is not None for group in groups) is not negated


def _first(parts: Sequence[Part], facts: Facts, terms: Bindings, start: int = 0) -> Bindings | None:
    """Return the first way to make all choices with which all tests hold."""
    for i in range(start, len(parts)):
        part = parts[i]
        if isinstance(part, tuple):
            variable, members, candidates = part
            for candidate in candidates(facts, terms):
                if candidate in members:
                    found = _first(parts, facts, {**terms, variable: candidate}, i + 1)
                    if found is not None:
                        return found
            return None
        if not part(facts, terms):
            return None
    return terms


def _without(terms: Bindings, variable: str) -> Bindings:
    return {name: value for name, value in terms.items() if name != variable} if variable in terms else terms


def _breadth(condition: Condition, bound: set[str]) -> int:
    """Rank conditions with unknown variables: 0 where the state leaves one individual, 1 where few could do, 2 for others."""
    if isinstance(condition, ValueCondition | RelationCondition) and not condition.negated:
        return not (isinstance(condition, ValueCondition) and _plain(condition) - bound == {condition.value})
    return 2


def _plain(condition: Condition) -> set[str]:
    """Return the variables of a condition that isn't nested."""
    match condition:
        case ValueCondition(_, arguments, value):
            terms = {*arguments, value}
        case RelationCondition(_, arguments):
            terms = set(arguments)
        case ClassCondition(term):
            terms = {term}
        case EqualityCondition(left, right):
            terms = {left, right}
        case _:
            terms = set()
    return {term for term in terms if term.startswith("?")}

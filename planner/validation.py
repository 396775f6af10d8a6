"""The plan checker; it shares no code with any search.

The preconditions of a behaviour hold if *some* individuals, as the variables of the behaviour, satisfy all
preconditions. The checker compiles each conjunction once into a list of tests and choices, the most determined
condition first. Therefore the time to check a plan grows with the length of the plan, and not with the size of the
world.

docs/levels.md defines the meaning of a plan with several levels. After the refinement of a step, the symbols that the step's
level sees have the values that the step states. Symbols of the level below that changed and have a rest value are then at rest.
The next step begins in the state after the refinement. Several steps that are refined together are applied one after another to
the state that their level sees; their common refinement has to lead to the resulting values.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import product
from operator import contains
from typing import TypeAlias

from confab.planner.checked_amounts import changed, worth
from confab.planner.checked_conditions import Arguments, Bindings, ConditionReader, Lookups, Values, all_hold
from confab.planner.checked_definitions import BoundedTotals, DefinedValues, Total, stratum_of
from confab.planner.plan import Plan, Step
from confab.reasoner.amounts import Quantity, meets
from confab.reasoner.limits import check
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import FALSE, TRUE, Behavior, ClassCondition, Condition, Fact, State, Symbol

Cell: TypeAlias = "tuple[str, Arguments]"
"""A cell of a state: a symbol as its situation type and arguments."""
NewValue: TypeAlias = "tuple[str, Arguments, str]"


@dataclass(frozen=True)
class Fault:
    """A fault of a plan: the path of the step (empty for the whole plan), and a sentence."""

    path: tuple[int, ...]
    text: str


def validate(problem: Problem, plan: Plan) -> list[Fault]:
    """Return the faults that `carried_out` finds in a plan, and its wrong IDs; the list is empty for a valid plan."""
    return carried_out(problem, plan) + wrong_ids(problem, plan)


def wrong_ids(problem: Problem, plan: Plan) -> list[Fault]:
    """Return a fault for each step of a plan whose ID isn't the number of its behaviour with its arguments."""
    steps = [step for node in plan.walk() for step in node.together if fitting(problem, step)]
    numbered = [(step, problem.id_of(step.behavior, step.arguments)) for step in steps]
    return [
        Fault(step.path, f"{step}: its ID by the numbering of level {step.level} is {number}")
        for step, number in numbered
        if number != step.id
    ]


def fitting(problem: Problem, step: Step) -> bool:
    """Return whether the behaviour of a step exists, and the arguments belong to the classes of the parameters."""
    behavior = problem.domain.behaviors.get(step.behavior)
    if behavior is None or len(behavior.parameters) != len(step.arguments):
        return False
    return all(a in problem.members(p.kind) for p, a in zip(behavior.parameters, step.arguments, strict=True))


def carried_out(
    problem: Problem, plan: Plan, lookups: Lookups | None = None, lifted: Mapping[str, Behavior] | None = None
) -> list[Fault]:
    """Return the faults of a plan when its steps are executed on symbols.

    On each level, the preconditions of every step must hold in the state before the step. After the refinement of a step, the
    symbols that the step's level sees must have the values that the step states. Other changed symbols must be at rest. The goal
    must hold after the last step. The checker stops at an inapplicable step.

    The checker adds the individuals on which the check depends to `lookups`: if the problem has all of these individuals, every
    larger problem of the same scene has the same faults. `lifted` has the behaviours in their original form, in which an effect may
    apply to every member of a class; the individuals that such an effect can change are also recorded in `lookups`.
    """
    rules = BehaviorReader(problem, lookups, lifted)
    check = _PlanExecution(problem, max((step.level for step in plan.walk()), default=0), rules)
    if check.carried_out(plan.steps, 0, (), "the plan") is not None:
        for fact, got in _unreached(problem, check.facts):
            check.fault((), f"the goal {fact.symbol} = {fact.value} isn't reached: it is {got} in the end")
    return check.faults


def open_goals(problem: Problem) -> list[Fact]:
    """Return the goals that don't hold in the initial state; goals may be stated or derived facts."""
    return [fact for fact, _ in _unreached(problem, LoggedState(problem, problem.initial))]


def unmet_goals(problem: Problem, plan: Plan) -> frozenset[Symbol]:
    """Return the symbols of the goals that don't hold after the steps of a plan."""
    check = _PlanExecution(problem, max((step.level for step in plan.walk()), default=0), BehaviorReader(problem))
    check.carried_out(plan.steps, 0, (), "the plan")
    return frozenset(fact.symbol for fact, _ in _unreached(problem, check.facts))


def _unreached(problem: Problem, facts: LoggedState) -> Iterator[tuple[Fact, str]]:
    """Yield each goal that doesn't hold, with the actual value of its symbol."""
    for symbol, wanted in problem.goal.items():
        got = facts.value(symbol.situation, symbol.arguments) or FALSE
        if not meets(got, wanted):
            yield Fact(symbol, wanted), got


def successor(problem: Problem, behavior: Behavior, arguments: Sequence[str], state: State) -> dict[Symbol, str] | None:
    """Return the state after a behaviour, or None if the behaviour isn't applicable."""
    rules = BehaviorReader(problem)
    fits = rules.fits(behavior, tuple(arguments))
    changes = rules.changes(behavior, tuple(arguments), LoggedState(problem, state)) if fits else None
    if changes is None:
        return None
    return {**state, **{Symbol(situation, key): value for situation, key, value in changes}}


def followed(problem: Problem, steps: Iterable[Step], state: State) -> State | None:
    """Return the state after the behaviours of some steps, or None if one of them isn't applicable; sub-steps don't count."""
    now: State | None = state
    for step in steps:
        now = None if now is None else successor(problem, problem.domain.behaviors[step.behavior], step.arguments, now)
    return now


class _PlanExecution:
    """The execution of a plan on symbols, with the current facts and the faults."""

    def __init__(self, problem: Problem, depth: int, rules: BehaviorReader) -> None:
        self.problem = problem
        self.levels = problem.domain.levels
        self.rests = {name: kind.rest for name, kind in problem.domain.situations.items() if kind.rest is not None}
        self.depth = depth  # the lowest level with steps in the plan
        self.rules = rules
        self.facts = LoggedState(problem, problem.initial, rules)
        self.rules.remember(self.facts)
        self.exceptions = exceptions_of(problem, self.facts)
        self.faults: list[Fault] = []

    def fault(self, path: tuple[int, ...], text: str) -> None:
        self.faults.append(Fault(path, text))

    def carried_out(
        self, steps: Sequence[Step], above: int, path: tuple[int, ...], what: object, inside: bool = False
    ) -> set[Cell] | None:
        """Execute the steps that refine a step of level `above`, or the task (level 0).

        Return the symbols that a step has changed, even if a later step has changed them back, or None if a step wasn't applicable.
        In the task, the goal of a symbol takes precedence over the symbol's rest value. If `inside` is true, the steps refine a
        step, and the rest value is required. Runs of consecutive lower-level steps may replace steps of the next level.
        """
        level = next((level for level in self.levels if level > above), above)
        touched = set[Cell]()
        for part in stretches(steps, level):
            check("checking the plan")
            if part[0].level <= above:
                self.fault(part[0].path, f"{part[0]} of level {part[0].level} can't refine {what} of level {above}")
                return None
            if part[0].level > level:
                stretch = f"the stretch from {part[0]} to {part[-1]}"
                changed = self.carried_out(part, level, part[0].path, stretch, inside)
            else:
                changed = self.step(part[0])
            if changed is None:
                return None
            touched |= changed
        for cell in sorted(cell for cell in touched if cell[0] in self.rests):
            symbol, got, rest = Symbol(*cell), self.facts.value(*cell) or FALSE, self.rests[cell[0]]
            own = above < self.problem.first_level(symbol) <= level
            if got != rest and own and (inside or not self.problem.releases(symbol)):
                self.fault(path, f"{what} touches {symbol} and leaves it {got}; at rest it is {rest}")
        return touched

    def step(self, step: Step) -> set[Cell] | None:
        """Execute one step with its refinement; return the symbols that it changes.

        Return None if the step or a sub-step wasn't applicable. Changes inside of a refinement count only if they last; of steps
        that are refined together, the changes that each of them states count.
        """
        if step.joined and not self.joinable(step):
            return None
        mark = len(self.facts.log)
        stated = self.stated(step)
        if stated is None:
            return None
        wanted, touched = stated
        level = self.problem.domain.behaviors[step.behavior].level
        if not step.steps:
            for (situation, arguments), value in wanted.items():
                self.facts.put(situation, arguments, value)
            self.rules.remember(self.facts)
            if level < self.depth and self.facts.since(mark):
                self.fault(step.path, f"{step}: it has no refinement, but other steps have one")
            return touched.union(self.facts.since(mark)) if self.within_bounds(step, mark) else None
        if self.carried_out(step.steps, level, step.path, step, inside=True) is None:
            return None
        totals = self.problem.domain.aggregates  # a level determines only the totals that the level sees
        said = {**self.facts.since(mark), **wanted}  # other symbols keep their values
        for cell in sorted([cell for cell, value in said.items() if self.facts.value(*cell) != value]):
            if cell[0] in self.problem.domain.remembers:
                continue  # a refinement may make remembered symbols true
            symbol, got = Symbol(*cell), self.facts.value(*cell) or FALSE
            if (cell in wanted and cell[0] not in totals) or self.problem.sees(level, symbol, said[cell]):
                self.fault(step.path, f"{step}: its refinement leaves {symbol} = {got}, not {said[cell]}")
        return touched.union(self.facts.since(mark))

    def joinable(self, step: Step) -> bool:
        """Return whether steps that are refined together are of one level and share their sub-steps; record a fault if not."""
        behaviors = [self.problem.domain.behaviors.get(one.behavior) for one in step.together]
        levels = {behavior.level for behavior in behaviors if behavior is not None}
        if step.steps and len(levels) <= 1 and not any(one.steps or one.joined for one in step.joined):
            return True
        self.fault(
            step.path, f"{step}: steps that are refined together have one level and one common sequence of steps"
        )
        return False

    def stated(self, step: Step) -> tuple[dict[Cell, str], set[Cell]] | None:
        """Return the values that a step, or steps that are refined together, state, and the symbols that they change.

        The facts are unchanged. Steps that are refined together are applied one after another. Return None if one of the steps
        isn't applicable.
        """
        mark, exceptions, touched = len(self.facts.log), dict(self.exceptions), set[Cell]()
        wanted: dict[Cell, str] = {}
        made, last = self.changes(step), step
        for one in step.joined if made is not None else ():
            touched |= self.different(made or {})
            wanted |= made or {}
            for (situation, arguments), value in wanted.items():
                self.facts.put(situation, arguments, value)
            level = self.problem.domain.behaviors[last.behavior].level
            self.rules.remember(self.facts, level)
            allowed = self.within_bounds(last, mark, level)
            made, last = self.changes(one) if allowed else None, one
            if made is None:
                break
        touched |= self.different(made or {})
        self.facts.undo(mark)
        self.exceptions = exceptions
        return None if made is None else (wanted | made, touched)

    def different(self, made: Mapping[Cell, str]) -> set[Cell]:
        """Return the symbols that have another value now than in `made`."""
        return {cell for cell, value in made.items() if self.facts.value(*cell) != value}

    def changes(self, step: Step) -> dict[Cell, str] | None:
        """Return the values that a step gives to symbols in the current state; record a fault if the step isn't applicable.

        Remembered symbols are left out, because `BehaviorReader.remember` computes them.
        """
        behavior = self.problem.domain.behaviors.get(step.behavior)
        if behavior is None or not self.rules.fits(behavior, step.arguments):
            self.fault(step.path, f"{step}: no such behaviour, or its parameters don't take these arguments")
            return None
        if step.level != behavior.level:
            self.fault(
                step.path, f"{step}: the step is of level {step.level}, but its behaviour of level {behavior.level}"
            )
            return None
        changes = self.rules.changes(behavior, step.arguments, self.facts)
        if changes is None:
            beyond = self.rules.beyond(behavior, step.arguments, self.facts)
            why = (
                f"{beyond[1]} would be out of bounds"
                if beyond
                else "its preconditions don't hold in the state before it"
            )
            self.fault(step.path, f"{step}: {why}")
            return None
        remembers = self.problem.domain.remembers
        return {(situation, key): value for situation, key, value in changes if situation not in remembers}

    def within_bounds(self, step: Step, mark: int, level: int | None = None) -> bool:
        """Return whether a step keeps all totals within their bounds and violates no constraint; if not, record the violation.

        The changes of the step are in the log since the log had the length `mark`.

        If a level is given, only the totals and constraints that the level sees count.

        The initial state may have exceptions to a constraint. A step violates the constraint if the number of exceptions grows.
        """
        if self.rules.lookups is not None:
            self.note_totals(mark)
        found = violation(self.rules, self.facts, self.exceptions, level)
        if found is not None:
            self.fault(step.path, f"{step}: {found}")
        return found is None

    def note_totals(self, mark: int) -> None:
        """Look up the totals with bounds that depend on the changes since a mark of the log, as they are before and afterwards."""
        facts, end, before = self.facts, len(self.facts.log), self.facts.since(mark)
        changes = {cell: {old, facts.value(*cell) or FALSE} for cell, old in before.items()}
        self.rules.bounded_totals.note(facts, changes)
        for cell, old in before.items():
            facts.put(*cell, old)
        self.rules.bounded_totals.note(facts, changes)
        facts.undo(end)


def exceptions_of(problem: Problem, facts: LoggedState) -> dict[str, Fraction]:
    """Return the number of exceptions to each constraint."""
    return {name: Fraction(facts.value(name, ()) or 0) for name in problem.domain.constraints}


def violation(
    rules: BehaviorReader, facts: LoggedState, exceptions: dict[str, Fraction], level: int | None = None
) -> str | None:
    """Return the constraint that a step has violated, or the total that it leaves out of its bounds, as text, or None.

    `exceptions` contains the number of exceptions to each constraint before the step, and afterwards the number after the step.
    """
    domain, classes = rules.problem.domain, rules.problem.classes
    for name in rules.bounded:
        kind = domain.situations[name]
        if level is not None and kind.level > level:
            continue
        for arguments in product(*(classes.get(of, ()) for of in kind.arguments)):
            got = facts.value(name, arguments)
            if got is None or kind.quantity is None:
                continue
            if name in domain.constraints:
                before, exceptions[name] = exceptions[name], Fraction(got)
                if Fraction(got) > before:
                    one = domain.constraints[name]
                    return f"{one}, and is {'false' if one.always else 'true'} after it"
            elif not kind.quantity.allows(Fraction(got)):
                return f"it leaves {Symbol(name, arguments)} = {got}, which is out of its bounds"
    return None


def stretches(steps: Sequence[Step], level: int) -> Iterator[list[Step]]:
    """Yield a list with each single step of the level, and a list with each run of consecutive lower-level steps."""
    lower: list[Step] = []
    for step in steps:
        if step.level > level:
            lower.append(step)
            continue
        if lower:
            yield lower
            lower = []
        yield [step]
    if lower:
        yield lower


# ------------------------------------------------------------------------------------------------------ states and rules


class LoggedState:
    """A state with a log of overwritten values, oldest first."""

    def __init__(self, problem: Problem, state: State, rules: BehaviorReader | None = None) -> None:
        self.problem = problem
        self.rules = rules or BehaviorReader(problem)
        self.log: list[tuple[str, Arguments, str]] = []
        self._values: dict[str, dict[Arguments, str]] = {name: {} for name in problem.domain.situations}
        self._holders: dict[str, dict[str, dict[Arguments, None]]] = {}
        self._totals: dict[Cell, str | None] = {}  # totals of the current state
        for symbol, value in state.items():
            self._values[symbol.situation][symbol.arguments] = value

    def value(self, situation: str, arguments: Arguments) -> str | None:
        """Return the value of a symbol, or None if the symbol doesn't exist."""
        if situation in self.problem.domain.rules:
            if not self.exists(situation, arguments):
                return None
            return TRUE if self._definitions.follows((situation, arguments)) else FALSE
        if situation in self.rules.totals:
            if (situation, arguments) not in self._totals:
                self._totals[situation, arguments] = self.rules.totals[situation].value(self, arguments)
            return self._totals[situation, arguments]
        value = self._values[situation].get(arguments)
        return FALSE if value is None and self.exists(situation, arguments) else value

    @cached_property
    def _definitions(self) -> DefinedValues:
        return DefinedValues(self.rules.strata, lambda about, key: self.rules.follows(about, key, self))

    def state(self) -> dict[Symbol, str]:
        """Return the stated facts of the current state."""
        return {Symbol(name, key): value for name, values in self._values.items() for key, value in values.items()}

    def exists(self, situation: str, arguments: Arguments) -> bool:
        """Return whether a symbol exists: it has a stated value, or is boolean and its arguments belong to the right classes."""
        if arguments in self._values[situation]:
            return True
        kind = self.problem.domain.situations[situation]
        return kind.boolean and all(
            argument in self.problem.members(of) for argument, of in zip(arguments, kind.arguments, strict=True)
        )

    def holders(self, situation: str, value: str) -> Iterable[Arguments]:
        """Return the arguments of the symbols whose stated value is the given value."""
        if situation not in self._holders:
            of: dict[str, dict[Arguments, None]] = {}
            for arguments, its in self._values[situation].items():
                of.setdefault(its, {})[arguments] = None
            self._holders[situation] = of
        return self._holders[situation].get(value, ())

    def put(self, situation: str, arguments: Arguments, value: str) -> None:
        """Set the value of an existing symbol, and log the old value."""
        old = self._values[situation].get(arguments, FALSE)
        if old == value:
            return
        self.log.append((situation, arguments, old))
        self._values[situation][arguments] = value
        self._totals.clear()
        if self.problem.domain.rules:
            self._definitions.forget()
        if situation in self._holders:
            self._holders[situation].get(old, {}).pop(arguments, None)
            self._holders[situation].setdefault(value, {})[arguments] = None

    def undo(self, mark: int) -> None:
        """Undo all changes since the log had the length `mark`."""
        for situation, arguments, old in reversed(self.log[mark:]):
            self.put(situation, arguments, old)
        del self.log[mark:]

    def since(self, mark: int) -> dict[Cell, str]:
        """Return the symbols that have changed since the log had the length `mark`, with their earlier values."""
        before: dict[Cell, str] = {}
        for situation, arguments, old in self.log[mark:]:
            before.setdefault((situation, arguments), old)
        return {cell: old for cell, old in before.items() if self._values[cell[0]][cell[1]] != old}


class BehaviorReader:
    """The behaviours of a problem, each compiled at its first use; for `lookups` and `lifted`, see `carried_out`."""

    def __init__(
        self, problem: Problem, lookups: Lookups | None = None, lifted: Mapping[str, Behavior] | None = None
    ) -> None:
        self.problem = problem
        self.lookups, self.lifted = lookups, lifted or {}
        self.strata = stratum_of(problem.domain.rules)
        self._read: dict[str, _CompiledBehavior] = {}
        self._defined: dict[str, list[_CompiledBehavior]] = {}
        self.totals = {name: Total(self, one) for name, one in problem.domain.aggregates.items() if one.kept}
        self.bounded = [
            name for name in self.totals if problem.domain.situations[name].quantity not in (None, Quantity())
        ]

    @cached_property
    def bounded_totals(self) -> BoundedTotals:
        """The totals with bounds, by the changes on which they depend."""
        return BoundedTotals(self, self.bounded)

    def follows(self, situation: str, arguments: Arguments, facts: LoggedState) -> bool:
        """Return whether some rule of a situation type derives the situation with the given arguments."""
        if situation not in self._defined:
            self._defined[situation] = [
                _CompiledBehavior(self, rule.behavior) for rule in self.problem.domain.rules[situation]
            ]
        for rule in self._defined[situation]:
            values = [*arguments, *rule.terms[len(arguments) :]]
            if all(map(contains, rule.members, arguments)) and all_hold(rule.preconditions, facts, values):
                return True
        return False

    def remember(self, facts: LoggedState, level: int | None = None) -> None:
        """Make each remembered symbol (that `level` sees, if given) true if the symbol that it keeps in memory is true."""
        for name, source in self.problem.domain.remembers.items():
            if level is not None and self.problem.domain.situations[name].level > level:
                continue
            kinds = self.problem.domain.situations[name].arguments
            for arguments in product(*(self.problem.classes.get(kind, ()) for kind in kinds)):
                if facts.value(name, arguments) != TRUE and facts.value(source, arguments) == TRUE:
                    facts.put(name, arguments, TRUE)

    def read(self, behavior: Behavior) -> _CompiledBehavior:
        """Return a behaviour in its compiled form."""
        if behavior.name not in self._read:
            self._read[behavior.name] = _CompiledBehavior(self, behavior)
        return self._read[behavior.name]

    def fits(self, behavior: Behavior, arguments: Arguments) -> bool:
        """Return whether the arguments belong to the classes of the behaviour's parameters."""
        members = self.read(behavior).members
        return len(arguments) == len(members) and all(map(contains, members, arguments))

    def changes(self, behavior: Behavior, arguments: Arguments, facts: LoggedState) -> list[NewValue] | None:
        """Return the values that a behaviour gives to symbols, in order, or None if it isn't applicable; the arguments must fit."""
        read = self.read(behavior)
        values = [*arguments, *read.terms[len(arguments) :]]
        if not all_hold(read.preconditions, facts, values):
            return None
        for tests in read.changed:
            all_hold(tests, facts, values.copy())
        found = []
        for when, situation, key, value in read.effects:
            inner = values
            if when:
                inner = values.copy()
                if not all_hold(when, facts, inner):
                    continue
            about = key(inner)
            if facts.exists(situation, about):
                found.append((situation, about, inner[value]))
        if not read.amounts:
            return found
        quantities = {name: kind.quantity for name, kind in self.problem.domain.situations.items()}
        more = changed(read.on_amounts(values, facts), facts.value, quantities)
        return None if more is None else found + more

    def beyond(self, behavior: Behavior, arguments: Arguments, facts: LoggedState) -> tuple[Fact, Fact] | None:
        """Return the first amount that a behaviour would make invalid, before and after the behaviour, or None."""
        read = self.read(behavior)
        values = [*arguments, *read.terms[len(arguments) :]]
        if not all_hold(read.preconditions, facts, values):
            return None
        free = dict.fromkeys(self.problem.domain.situations, Quantity())
        for situation, key, value in changed(read.on_amounts(values, facts), facts.value, free) or ():
            quantity, before = self.problem.domain.situations[situation].quantity, facts.value(situation, key)
            if quantity is not None and before is not None and not quantity.allows(Fraction(value)):
                return Fact(Symbol(situation, key), before), Fact(Symbol(situation, key), value)
        return None

    def price(self, behavior: Behavior, arguments: Arguments, facts: LoggedState) -> Fraction | None:
        """Return the price of a behaviour in the current state, or None if the behaviour has no price or isn't applicable."""
        read = self.read(behavior)
        values = [*arguments, *read.terms[len(arguments) :]]
        return read.price(facts.value, values) if read.price and all_hold(read.preconditions, facts, values) else None

    def satisfied(
        self, conditions: Sequence[Condition], terms: Bindings, kinds: Mapping[str, str], facts: LoggedState
    ) -> Bindings | None:
        """Return bindings that extend the bindings `terms` and with which all conditions hold, or None if there are none."""
        reading, bound = ConditionReader(self, terms), set(terms)
        tests = reading.conjunction(conditions, bound, kinds)
        values = [terms.get(term, term) for term in reading.places]
        if not all_hold(tests, facts, values):
            return None
        return {term: value for term, value in zip(reading.places, values, strict=True) if term in bound}


class _CompiledBehavior:
    """A behaviour in compiled form: positions of terms, preconditions, and effects with their conditions."""

    def __init__(self, rules: BehaviorReader, behavior: Behavior) -> None:
        reading, bound = (
            ConditionReader(rules, [p.name for p in behavior.parameters]),
            {p.name for p in behavior.parameters},
        )
        kinds = {p.name: p.kind for p in (*behavior.parameters, *behavior.variables)}
        self.preconditions = reading.conjunction(behavior.preconditions, bound, kinds)
        self.effects = [
            (
                reading.conjunction(e.when, set(bound), kinds),
                e.situation,
                reading.key(e.arguments),
                reading.place(e.value),
            )
            # A value that becomes true takes precedence, as in PDDL.
            for e in sorted(behavior.effects, key=lambda effect: effect.value != FALSE)
        ]
        self.amounts = [
            (
                reading.conjunction(e.when, set(bound), kinds),
                e.situation,
                reading.key(e.arguments),
                e.operation,
                worth(e.amount, reading.key, rules.problem.relations),
            )
            for operations in (("assign",), ("scale",), ("increase", "decrease"))
            for e in behavior.amounts
            if e.operation in operations
        ]
        self.price = None if behavior.price is None else worth(behavior.price, reading.key, rules.problem.relations)
        lifted = rules.lifted.get(behavior.name, behavior)
        self.changed = [  # tests that never hold, but record every individual that an effect on a class can change
            reading.conjunction(
                (*e.when, ClassCondition(e.each.name, "")), set(bound), {**kinds, e.each.name: e.each.kind}
            )
            for e in lifted.every_effect
            if e.each is not None
        ]
        self.terms = tuple(reading.places)
        self.members = [rules.problem.members(p.kind) for p in behavior.parameters]

    def on_amounts(self, values: Values, facts: LoggedState) -> Iterator[tuple[Cell, str, Fraction | None]]:
        """Yield the symbols whose amounts change, each with the operation and the operand."""
        for when, situation, key, operation, amount in self.amounts:
            inner = values.copy()
            if all_hold(when, facts, inner):
                yield (situation, key(inner)), operation, amount(facts.value, inner)

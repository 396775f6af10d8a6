"""Every state that one level can reach, breadth first and by the million: the last word on small problems.

code       a state in one 64-bit integer: each symbol that can change has a field of bits
operator   a behaviour with all its parameters and determined variables put in, as a mask and its bits (the values that it
           needs), a formula for what isn't a conjunction of values, and its effects
layer      the codes of one distance from the initial state, sorted

A layer's successors come from a handful of array operations per operator; what was reached before is removed by merging.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from time import perf_counter
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from planner.language import mentions, needs
from planner.plan import Step
from reasoner.symbols import (
    FALSE,
    AnyOf,
    Behavior,
    ClassCondition,
    Condition,
    EqualityCondition,
    Fact,
    Problem,
    RelationCondition,
    Symbol,
    ValueCondition,
    Witness,
)

Codes: TypeAlias = "NDArray[np.uint64]"
Truth: TypeAlias = "NDArray[np.bool_]"
Formula: TypeAlias = "bool | Fact | tuple[str, tuple[Formula, ...]]"
"""True, False, a fact, or ``("and" | "or" | "not", parts)``."""
Env: TypeAlias = "dict[str, str]"
Schedule: TypeAlias = "tuple[list[tuple[Condition, list[str]]], Sequence[Condition], ValueCondition | None]"


AT_ONCE = 300_000
"""So many pairs of a state and an operator are looked at in one array operation."""
FEW = 20_000
"""Over so few states a formula is worked out once for all operators that need it; over more, for those that fit else."""


class TooLargeError(Exception):
    """The states don't fit: more bits than 63, more operators or more states than allowed.

    `layers` of the search were finished before.
    """

    def __init__(self, message: str, layers: int = 0) -> None:
        super().__init__(message)
        self.layers = layers


@dataclass
class Operator:
    """A behaviour with everything put in. Masks and bits are filled in once the fields are laid out.

    If no effect is conditional (`plain`), the state after is the state without the bits `kept` leaves out, and with `given`.
    """

    behavior: str
    arguments: tuple[str, ...]
    bindings: dict[str, str]
    facts: tuple[Fact, ...]
    rest: tuple[Formula, ...]
    effects: tuple[tuple[Formula, Fact], ...]
    mask: int = 0
    bits: int = 0
    plain: bool = False
    kept: int = 2**64 - 1
    given: int = 0


@dataclass(frozen=True)
class Exhausted:
    """What breadth-first search found: `steps` is a shortest plan, or None if there is none; `states` were reached."""

    steps: tuple[Step, ...] | None
    states: int
    layers: int


@dataclass
class Space:
    """The state space of one level of a problem.

    Parameters
    ----------
    problem : Problem
    level : int
    most_operators : int

    Raises
    ------
    TooLargeError
        There are more operators than allowed, or a state needs more than 63 bits.
    """

    problem: Problem
    level: int
    most_operators: int = 5_000
    operators: list[Operator] = field(default_factory=list)
    same: dict[Formula, Formula] = field(default_factory=dict)
    known: dict[tuple[object, ...], Formula] = field(default_factory=dict)
    schedules: dict[tuple[object, ...], Schedule] = field(default_factory=dict)
    tests: dict[Fact, tuple[np.uint64, np.uint64, bool]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.members = {kind: frozenset(members) for kind, members in self.problem.classes.items()}
        changed = {e.situation for b in self.problem.domain.at_level(self.level) for e in b.effects}
        self.fluent = changed
        for behavior in self.problem.domain.at_level(self.level):
            self.operators.extend(self._operators(behavior))
            if len(self.operators) > self.most_operators:
                raise TooLargeError(f"more than {self.most_operators} operators")
        self.values: dict[Symbol, dict[str, int]] = {}
        while True:  # until no operator needs a value that no operator left gives
            self.values = self._given()
            possible = [o for o in self.operators if all(map(self._possible, o.facts))]
            if len(possible) == len(self.operators):
                break
            self.operators = possible
        self.shift: dict[Symbol, int] = {}
        self.width: dict[Symbol, int] = {}
        total = 0
        for symbol in sorted(self.values):
            self.shift[symbol], self.width[symbol] = total, max(1, (len(self.values[symbol]) - 1).bit_length())
            total += self.width[symbol]
        self.bits = total
        if total > 63:
            raise TooLargeError(f"a state takes {total} bits, more than 63")
        for operator in self.operators:
            for fact in operator.facts:
                mask, bits = self._place(fact)
                operator.mask |= mask
                operator.bits |= bits
            operator.plain = all(when is True for when, _ in operator.effects)
            for _, fact in operator.effects:
                mask, bits = self._place(fact)
                operator.kept &= ~mask
                operator.given = (operator.given & ~mask) | bits

    def _given(self) -> dict[Symbol, dict[str, int]]:
        """Return the values that each symbol can take, the initial one first."""
        values: dict[Symbol, dict[str, int]] = {}
        for operator in self.operators:
            for _, fact in operator.effects:
                taken = values.setdefault(fact.symbol, {self.problem.initial.get(fact.symbol, FALSE): 0})
                taken.setdefault(fact.value, len(taken))
        return values

    # ------------------------------------------------------------------------------------------------------- searching

    def search(self, most: int, deadline: float | None = None, longest: int | None = None) -> Exhausted:
        """Search breadth first from the initial state until the goal is reached or there is nothing new.

        With `longest`, only plans of at most so many steps are looked for: what can't reach the goal with the steps left is
        dropped. No plan then means none that short.

        Raises
        ------
        TooLargeError
            More than `most` states were reached.
        TimeoutError
            The deadline (of `perf_counter`) has passed.
        """
        wanted: Formula = _all(self._fact(Fact(symbol, value)) for symbol, value in sorted(self.problem.goal.items()))
        layers = [np.zeros(1, np.uint64)]
        known = layers[0]
        ways = [] if longest is None else self._ways()
        while True:
            reached = layers[-1][self._holds(wanted, layers[-1])]
            if len(reached):
                return Exhausted(self._path(layers, reached[0]), len(known), len(layers))
            if not len(layers[-1]):
                return Exhausted(None, len(known), len(layers) - 1)
            new = self._next(layers[-1], deadline)
            places = np.minimum(np.searchsorted(known, new), len(known) - 1)
            new = new[known[places] != new]
            if longest is not None:
                new = new[self._away(ways, new) <= longest - len(layers)]
            known = np.sort(np.concatenate([known, new]), kind="stable")
            if len(known) > most:
                raise TooLargeError(f"more than {most} states", len(layers))
            layers.append(new)

    def _next(self, codes: Codes, deadline: float | None) -> Codes:
        """Return all successors of some states, each once: operator by operator, or of few states all at once."""
        if len(codes) * len(self.operators) > AT_ONCE:
            found = [after for _, after in self._successors(codes, deadline)]
        else:
            if deadline is not None and perf_counter() > deadline:
                raise TimeoutError
            masks, bits, kept, given, formulas, others = self._columns
            fits = (masks & codes) == bits  # operators by states
            for formula, needing in formulas:
                fits[needing] &= self._holds(formula, codes)
            found = [self._after(self.operators[o], codes[fits[o]]) for o in others]
            fits[others] = False
            operator = np.repeat(np.arange(len(fits)), np.count_nonzero(fits, axis=1))
            state = np.flatnonzero(fits) - operator * len(codes)
            found.append((codes[state] & kept[operator]) | given[operator])
        return _distinct(np.concatenate(found)) if found else np.zeros(0, np.uint64)

    @cached_property
    def _columns(self) -> tuple[Codes, Codes, Codes, Codes, list[tuple[Formula, list[int]]], list[int]]:
        """What operators need and give, as arrays; each formula with the operators that need it; those that aren't plain."""
        masks, bits, kept, given = (
            np.array([getattr(operator, name) for operator in self.operators], np.uint64)
            for name in ("mask", "bits", "kept", "given")
        )
        formulas: dict[int, tuple[Formula, list[int]]] = {}
        for o, operator in enumerate(self.operators):
            for formula in operator.rest:
                formulas.setdefault(id(formula), (formula, []))[1].append(o)
        others = [o for o, operator in enumerate(self.operators) if not operator.plain]
        return masks[:, None], bits[:, None], kept, given, list(formulas.values()), others

    def _successors(self, codes: Codes, deadline: float | None = None) -> Iterator[tuple[Operator, Codes]]:
        """Yield each operator that is applicable in any of the states, with the states that it leads to."""
        truths: dict[int, Truth] | None = {} if len(codes) <= FEW else None
        for operator in self.operators:
            if deadline is not None and perf_counter() > deadline:
                raise TimeoutError
            before = self._applicable(operator, codes, truths)
            if len(before):
                yield operator, self._after(operator, before)

    def _applicable(self, operator: Operator, codes: Codes, truths: dict[int, Truth] | None = None) -> Codes:
        """Return the states that an operator is applicable in; `truths` keeps what formulas are over these codes."""
        fits = (codes & np.uint64(operator.mask)) == np.uint64(operator.bits)
        if truths is not None and operator.rest and fits.any():
            for formula in operator.rest:
                if id(formula) not in truths:
                    truths[id(formula)] = self._holds(formula, codes)
                fits &= truths[id(formula)]
            found: Codes = codes[fits]
            return found
        before: Codes = codes[fits]
        for formula in operator.rest:
            if not len(before):
                break
            before = before[self._holds(formula, before)]
        return before

    def _after(self, operator: Operator, before: Codes) -> Codes:
        if operator.plain:
            plain: Codes = (before & np.uint64(operator.kept)) | np.uint64(operator.given)
            return plain
        after: Codes = before.copy()
        for when, fact in operator.effects:
            mask, bits = self._place(fact)
            changed = (after & ~np.uint64(mask)) | np.uint64(bits)
            after = changed if when is True else np.where(self._holds(when, before), changed, after)
        return after

    def _ways(self) -> list[tuple[Symbol, NDArray[np.int64]]]:
        """Return for each goal how many steps each value of its symbol is away from it.

        Every operator counts for one symbol only, so that the sum over the goals is no more than any plan has.
        """
        wanted = [symbol for symbol in self.problem.goal if symbol in self.values]
        wanted.sort(key=lambda symbol: (-len(self.values[symbol]), symbol))
        setting: dict[Symbol, dict[int, set[int]]] = {}
        for number, operator in enumerate(self.operators):
            for _, fact in operator.effects:
                value = self.values[fact.symbol][fact.value]
                setting.setdefault(fact.symbol, {}).setdefault(number, set()).add(value)
        counted: set[int] = set()
        ways = []
        for symbol in wanted:
            values = self.values[symbol]
            moves: set[tuple[int, int]] = set()
            for number, after in setting.get(symbol, {}).items():
                needed = [values[fact.value] for fact in self.operators[number].facts if fact.symbol == symbol]
                free = number in counted
                moves.update((u, v) if not free else (~u, v) for u in needed or values.values() for v in after)
                counted.add(number)
            far = len(self.operators) + 1
            away = np.full(len(values), far, np.int64)
            if self.problem.goal[symbol] in values:
                away[values[self.problem.goal[symbol]]] = 0
            for _ in values:
                for u, v in moves:
                    before, cost = (u, 1) if u >= 0 else (~u, 0)
                    away[before] = min(away[before], away[v] + cost)
            ways.append((symbol, away))
        return ways

    def _away(self, ways: Sequence[tuple[Symbol, NDArray[np.int64]]], codes: Codes) -> NDArray[np.int64]:
        """Return how many steps each state is away from the goal at least."""
        total = np.zeros(len(codes), np.int64)
        for symbol, away in ways:
            mask = (1 << self.width[symbol]) - 1
            total += away[(codes >> np.uint64(self.shift[symbol])) & np.uint64(mask)]
        return total

    def _path(self, layers: Sequence[Codes], last: np.uint64) -> tuple[Step, ...]:
        steps: list[Operator] = []
        for layer in reversed(layers[:-1]):
            for operator in self.operators:
                if operator.plain and int(last) & ~operator.kept != operator.given:
                    continue
                before = self._applicable(operator, layer)
                hits = before[self._after(operator, before) == last]
                if len(hits):
                    last = hits[0]
                    steps.append(operator)
                    break
        return tuple(
            Step((i,), self.problem.id_of(o.behavior, o.arguments), self.level, o.behavior, o.arguments, o.bindings)
            for i, o in enumerate(reversed(steps))
        )

    # ------------------------------------------------------------------------------------------------------- formulas

    def _holds(self, formula: Formula, codes: Codes) -> Truth:
        if isinstance(formula, bool):
            return np.full(len(codes), formula)
        if isinstance(formula, Fact):
            test = self.tests.get(formula)
            if test is None:
                possible = self._possible(formula)
                mask, bits = self._place(formula) if possible else (0, 0)
                test = self.tests[formula] = np.uint64(mask), np.uint64(bits), possible
            equal: Truth = (codes & test[0]) == test[1] if test[2] else np.zeros(len(codes), np.bool_)
            return equal
        kind, parts = formula
        inner = [self._holds(part, codes) for part in parts]
        joined: Truth = np.logical_or.reduce(inner) if kind == "or" else np.logical_and.reduce(inner)
        return ~joined if kind == "not" else joined

    def _possible(self, fact: Fact) -> bool:
        if fact.symbol in self.values:
            return fact.value in self.values[fact.symbol]
        return self.problem.initial.get(fact.symbol, FALSE) == fact.value

    def _place(self, fact: Fact) -> tuple[int, int]:
        if fact.symbol not in self.values:
            return 0, 0
        shift = self.shift[fact.symbol]
        return ((1 << self.width[fact.symbol]) - 1) << shift, self.values[fact.symbol][fact.value] << shift

    def _fact(self, fact: Fact) -> Formula:
        """Return a fact, or its truth if nothing can change it."""
        if not self._exists(fact.symbol):
            return False
        if fact.symbol.situation not in self.fluent:
            return self.problem.initial.get(fact.symbol, FALSE) == fact.value
        return fact

    def _exists(self, symbol: Symbol) -> bool:
        situation = self.problem.domain.situations[symbol.situation]
        kinds = zip(symbol.arguments, situation.arguments, strict=True)
        return symbol in self.problem.initial or (
            situation.boolean and all(argument in self.members.get(kind, ()) for argument, kind in kinds)
        )

    def formula(self, condition: Condition, env: Mapping[str, str], kinds: Mapping[str, str]) -> Formula:
        """Return a condition with all outer variables put in as a formula over facts."""
        match condition:
            case ValueCondition(situation, arguments, value, negated):
                symbol = Symbol(situation, tuple(env.get(a, a) for a in arguments))
                return _not(self._fact(Fact(symbol, env.get(value, value))), negated)
            case RelationCondition(relation, arguments, negated):
                rows = self.problem.relations.get(relation, frozenset())
                return (tuple(env.get(a, a) for a in arguments) in rows) is not negated
            case ClassCondition(term, kind, negated):
                return (env.get(term, term) in self.members.get(kind, ())) is not negated
            case EqualityCondition(left, right, negated):
                return (env.get(left, left) == env.get(right, right)) is not negated
            case Witness(variable, kind, conditions, negated):
                inner = {**kinds, variable: kind}
                members = self.problem.classes.get(kind, ())
                parts = (self._conjunction(conditions, {**env, variable: m}, inner) for m in members)
                return _not(_any(parts), negated)
            case AnyOf(alternatives, negated):
                return _not(_any(self._conjunction(group, dict(env), kinds) for group in alternatives), negated)

    def _conjunction(self, conditions: Sequence[Condition], env: Env, kinds: Mapping[str, str]) -> Formula:
        """Return a conjunction; over what it determines itself, as an alternative per value."""
        return _any(_all(parts) for _, parts in self._grounded(conditions, env, kinds))

    def _grounded(
        self, waiting: Sequence[Condition], env: Env, kinds: Mapping[str, str]
    ) -> Iterator[tuple[Env, tuple[Formula, ...]]]:
        """Yield each way to put values in for what the conditions determine, with what is left of the conditions."""
        parts: list[Formula] = []
        while True:
            ready, waiting, binding = self._schedule(waiting, env)
            for condition, names in ready:
                key = (id(condition), *[env[name] for name in names])
                part = self.known.get(key)
                if part is None:
                    part = self.formula(condition, env, kinds)
                    part = self.known[key] = self.same.setdefault(part, part)
                if part is False:
                    return
                if part is not True:
                    parts.append(part)
            if not waiting:
                yield env, tuple(parts)
                return
            if binding is not None:
                break
        for value in self.problem.classes.get(kinds[binding.value], ()):
            for bound, more in self._grounded(waiting, {**env, binding.value: value}, kinds):
                yield bound, (*parts, *more)

    def _schedule(self, waiting: Sequence[Condition], env: Env) -> Schedule:
        """Return the conditions that can be put in now, each with its variables; those that can't; one that binds a variable."""
        key = (*map(id, waiting), *env)
        if key not in self.schedules:
            pending = {c.value for c in waiting if isinstance(c, ValueCondition) and _binds(c, env)}
            ready = [c for c in waiting if not needs(c) - env.keys() and not mentions(c) & pending]
            ready.sort(key=lambda c: isinstance(c, ValueCondition) + 2 * isinstance(c, Witness | AnyOf))
            rest = [c for c in waiting if not any(c is other for other in ready)]
            binders = (c for c in rest if isinstance(c, ValueCondition) and not needs(c) - env.keys())
            binding = next(binders) if rest and not ready else None
            pairs = [(c, sorted(mentions(c) & env.keys())) for c in ready]
            self.schedules[key] = pairs, rest, binding
        return self.schedules[key]

    def _operators(self, behavior: Behavior) -> Iterator[Operator]:
        self.known.clear()  # the classes of variables may differ from those of another behaviour
        kinds = behavior.kinds
        names = [parameter.name for parameter in behavior.parameters]
        choices = [self.problem.classes.get(parameter.kind, ()) for parameter in behavior.parameters]
        size = 1
        for members in choices:
            size *= len(members)
        if size > 5 * self.most_operators:
            raise TooLargeError(f"{behavior.name} has {size} quantifications")
        for arguments in product(*choices):
            for env, parts in self._grounded(behavior.preconditions, dict(zip(names, arguments, strict=True)), kinds):
                effects: list[tuple[Formula, Fact]] = []
                for effect in behavior.effects:
                    for inner, when in self._grounded(effect.when, env, kinds):
                        symbol = Symbol(effect.situation, tuple(inner.get(a, a) for a in effect.arguments))
                        fact = Fact(symbol, inner.get(effect.value, effect.value))
                        if self._exists(symbol):
                            effects.append((_all(when), fact))
                bindings = {n[1:]: v for n, v in sorted(env.items()) if n not in names}
                facts = tuple(part for part in parts if isinstance(part, Fact))
                rest = tuple(part for part in parts if not isinstance(part, Fact))
                yield Operator(behavior.name, arguments, bindings, facts, rest, tuple(effects))


def _distinct(codes: Codes) -> Codes:
    """Return codes in order, each once; several times as fast as `np.unique`, which hashes."""
    codes = np.sort(codes)
    first = np.ones(len(codes), np.bool_)
    np.not_equal(codes[1:], codes[:-1], out=first[1:])
    found: Codes = codes[first]
    return found


def _binds(condition: Condition, env: Mapping[str, str]) -> bool:
    return isinstance(condition, ValueCondition) and not condition.negated and _is_unbound(condition.value, env)


def _is_unbound(term: str, env: Mapping[str, str]) -> bool:
    return term.startswith("?") and term not in env


def _not(formula: Formula, negated: bool = True) -> Formula:
    if not negated:
        return formula
    return not formula if isinstance(formula, bool) else ("not", (formula,))


def _all(parts: Iterator[Formula] | Sequence[Formula]) -> Formula:
    found = tuple(part for part in parts if part is not True)
    if any(part is False for part in found):
        return False
    return found[0] if len(found) == 1 else ("and", found) if found else True


def _any(parts: Iterator[Formula] | Sequence[Formula]) -> Formula:
    found = tuple(part for part in parts if part is not False)
    if any(part is True for part in found):
        return True
    return found[0] if len(found) == 1 else ("or", found) if found else False

"""A plain interpreter of problems: the successor of a state by each grounded behaviour, and the reachable states.

The interpreter shares no code with the searches, the proofs and the plan checker, so that it can serve as their reference.
Conditions are grounded by trying every binding, and written as Python expressions over a tuple of values.

A *slot* is the position of a symbol's value in a state; static symbols have no slot. A *state* is a tuple with a text for each
symbol and a number for each amount; defined situations come last. A *node* is a state with the changed symbols that don't have
their rest value.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from fractions import Fraction
from heapq import heappop, heappush
from itertools import product
from typing import Any

from confab.reasoner.aggregates.dependencies import in_order, read_by
from confab.reasoner.amounts import LARGEST, Amount, Calculation, Expression, Measure, terms_of
from confab.reasoner.derivation import strata
from confab.reasoner.language import situations_of, walk
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    Aggregate,
    AmountEffect,
    AnyOf,
    Behavior,
    ClassCondition,
    Comparison,
    Condition,
    EqualityCondition,
    Parameter,
    RelationCondition,
    Symbol,
    ValueCondition,
    ValueEffect,
    Witness,
)

Terms = Mapping[str, str]
State = tuple[Any, ...]
Node = tuple[State, frozenset[int]]
NOTHING = math.nan
"""The value of a missing number: a comparison with a missing number is false, and the result of a calculation is missing, too."""


class TooManyStatesError(Exception):
    """Raised when more states than allowed are reachable."""


def divided(one: Any, other: Any) -> Any:
    """Return a quotient, or `NOTHING` if the divisor is zero or a number is missing."""
    if other == 0 or other != other or one != one:
        return NOTHING
    result = Fraction(one) / Fraction(other)
    return result.numerator if result.denominator == 1 else result


def number(text: str | Fraction) -> Any:
    """Return a whole number as an integer, and any other number as a fraction."""
    value = Fraction(text)
    return value.numerator if value.denominator == 1 else value


def variables(condition: Condition) -> set[str]:
    """Return the variables that must be bound before a condition is evaluated, without variables inside `AnyOf` and `Witness`."""
    match condition:
        case ValueCondition(_, arguments, value):
            terms = {*arguments, value}
        case RelationCondition(_, arguments):
            terms = set(arguments)
        case ClassCondition(term):
            terms = {term}
        case EqualityCondition(left, right):
            terms = {left, right}
        case Comparison(left, _, right):
            terms = {*terms_of(left), *terms_of(right)}
        case _:
            terms = set()
    return {term for term in terms if term.startswith("?")}


@dataclass(frozen=True)
class Action:
    """A grounded behaviour; `outcomes` has one function from a state to its successor or None for each binding of variables."""

    behavior: Behavior
    arguments: tuple[str, ...]
    outcomes: tuple[Any, ...]


@dataclass(frozen=True)
class Truth:
    """The reachable nodes of a level with their least costs, and the least cost of a goal node."""

    costs: Mapping[Node, Any]
    least: Any | None


class Interpreter:
    """An interpreter of one problem."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        domain = problem.domain
        self.kinds = domain.situations
        changed = {effect.situation for one in domain.behaviors.values() for effect in one.every_effect}
        self.slots: dict[Symbol, int] = {}
        self.constants: dict[Symbol, Any] = {}
        initial: list[Any] = []
        for name, kind in self.kinds.items():
            if name in domain.rules or name in domain.aggregates:
                continue
            for arguments in product(*(problem.classes.get(of, ()) for of in kind.arguments)):
                symbol = Symbol(name, arguments)
                value: Any = problem.initial.get(symbol, FALSE if kind.boolean else None)
                if value is None:
                    continue
                value = value if kind.quantity is None else number(value)
                if name in changed or name in domain.remembers:
                    self.slots[symbol] = len(initial)
                    initial.append(value)
                else:
                    self.constants[symbol] = value
        self.stated = len(initial)
        for name in domain.rules:
            for arguments in product(*(problem.classes.get(of, ()) for of in self.kinds[name].arguments)):
                self.slots[Symbol(name, arguments)] = len(initial)
                initial.append(FALSE)
        self.symbols = list(self.slots)
        for name, aggregate in domain.aggregates.items():
            for arguments in product(*(problem.classes.get(of, ()) for of in self.kinds[name].arguments)):
                self.slots[Symbol(name, arguments)] = len(initial)
                initial.append(0 if aggregate.kept else NOTHING)  # the value outside of the class that the rule names
        self.totals = [made for one in in_order(domain.aggregates) for made in self.aggregated(one)]
        self.rules = [(self.derivations(group), self.recursive(group)) for group in strata(domain.rules)]
        mutual = any(read_by(one) & domain.rules.keys() for one in domain.aggregates.values())
        self.rounds = 1 + len(domain.aggregates) if mutual else 1  # rules and amounts may depend on each other
        self.remembered = [
            (self.kinds[name].level, self.sources(name, other)) for name, other in domain.remembers.items()
        ]
        self.initial = self.closed(initial)
        self.rests = self.unsettled()
        self._actions: dict[int, list[Action]] = {}
        self._named: dict[tuple[str, tuple[str, ...]], Action] = {}

    def unsettled(self) -> dict[int, str]:
        """Return the rest values that must hold at the end, by slot, for symbols without a goal."""
        return {
            i: rest
            for symbol, i in self.slots.items()
            if (rest := self.kinds[symbol.situation].rest) is not None and not self.problem.releases(symbol)
        }

    def wanting(self, goal: Mapping[Symbol, str]) -> Interpreter:
        """Return an interpreter of the same problem with another goal."""
        other = copy(self)
        other.problem = replace(self.problem, goal=goal)
        other.rests = other.unsettled()
        return other

    def without_weights(self) -> Interpreter:
        """Return an interpreter of the same problem without weights, in which only goals release symbols from rest values."""
        other = copy(self)
        other.problem = replace(self.problem, weights={})
        return other

    # ------------------------------------------------------------------------------------------------------ conditions

    def bindings(self, conditions: Iterable[Condition], kinds: Terms, terms: Terms) -> Iterator[Terms]:
        """Yield the bindings of the unbound variables in a conjunction."""
        free = sorted(set().union(*map(variables, conditions)) - terms.keys())
        for values in product(*(self.problem.classes.get(kinds[name], ()) for name in free)):
            yield {**terms, **dict(zip(free, values, strict=True))}

    def all_of(self, conditions: Iterable[Condition], terms: Terms, kinds: Terms) -> str:
        """Return a conjunction as a Python expression."""
        return _joined([self.condition(one, terms, kinds) for one in conditions], "and", "True", "False")

    def some(self, conditions: Sequence[Condition], terms: Terms, kinds: Terms) -> str:
        """Return the Python expression that is true if a conjunction holds for some binding of its unbound variables."""
        ways = [self.all_of(conditions, trial, kinds) for trial in self.bindings(conditions, kinds, terms)]
        return _joined(ways, "or", "False", "True")

    def condition(self, condition: Condition, terms: Terms, kinds: Terms) -> str:
        """Return a condition as a Python expression over the state ``s``."""

        def get(name: str) -> str:
            return terms.get(name, name)

        match condition:
            case ValueCondition(situation, arguments, value, negated):
                symbol = Symbol(situation, tuple(map(get, arguments)))
                if symbol in self.slots:
                    return f"s[{self.slots[symbol]}] {'!=' if negated else '=='} {get(value)!r}"
                return str((self.constants.get(symbol) == get(value)) is not negated)
            case RelationCondition(relation, arguments, negated):
                rows = self.problem.relations.get(relation, frozenset())
                return str((tuple(map(get, arguments)) in rows) is not negated)
            case ClassCondition(term, kind, negated):
                return str((get(term) in self.problem.classes.get(kind, ())) is not negated)
            case EqualityCondition(left, right, negated):
                return str((get(left) == get(right)) is not negated)
            case Witness(variable, kind, inner, negated):
                members = self.problem.classes.get(kind, ())
                ways = [self.some(inner, {**terms, variable: one}, {**kinds, variable: kind}) for one in members]
                return _negated(_joined(ways, "or", "False", "True"), negated)
            case AnyOf(alternatives, negated):
                ways = [self.some(group, terms, kinds) for group in alternatives]
                return _negated(_joined(ways, "or", "False", "True"), negated)
            case Comparison(left, sign, right, negated):
                python = "==" if sign == "=" else sign
                return _negated(f"({self.worth(left, terms)} {python} {self.worth(right, terms)})", negated)

    def worth(self, expression: Expression, terms: Terms) -> str:
        """Return a calculation as a Python expression over the state ``s``."""
        match expression:
            case Amount(situation, arguments):
                symbol = Symbol(situation, tuple(terms.get(a, a) for a in arguments))
                if symbol in self.slots:
                    return f"s[{self.slots[symbol]}]"
                return repr(self.constants[symbol]) if symbol in self.constants else "nan"
            case Measure(relation, arguments):
                key = tuple(terms.get(a, a) for a in arguments)
                rows = [row for row in self.problem.relations.get(relation, ()) if row[:-1] == key]
                return repr(number(rows[0][-1])) if rows else "nan"
            case Calculation("/", left, right):
                return f"divided({self.worth(left, terms)}, {self.worth(right, terms)})"
            case Calculation(sign, left, right):
                return f"({self.worth(left, terms)} {sign} {self.worth(right, terms)})"
            case Fraction():
                return repr(number(expression))

    def holds(self, conditions: Sequence[Condition], state: State) -> bool:
        """Return whether a conjunction holds in a state for some binding of its variables."""
        return bool(eval(self.some(conditions, {}, {}), {**NAMES, "s": state}))

    # ------------------------------------------------------------------------------------------------------- behaviours

    def derivations(self, names: Iterable[str]) -> list[tuple[int, Any]]:
        """Return the slot of each symbol of a group of mutually dependent rules, with the function that returns its truth."""
        ways: dict[int, list[str]] = {}
        for rule in (rule for name in names for rule in self.problem.domain.rules[name]):
            kinds = {one.name: one.kind for one in (*rule.parameters, *rule.variables)}
            for values in product(*(self.problem.classes.get(one.kind, ()) for one in rule.parameters)):
                symbol = Symbol(rule.situation, values)
                terms = dict(zip((one.name for one in rule.parameters), values, strict=True))
                if symbol in self.slots and (said := self.some(rule.conditions, terms, kinds)) != "False":
                    ways.setdefault(self.slots[symbol], []).append(said)
        return [(slot, eval(f"lambda s: {_joined(said, 'or', 'False', 'True')}", NAMES)) for slot, said in ways.items()]

    def recursive(self, names: Iterable[str]) -> bool:
        """Return whether the rules of a group may depend on the group's own conclusions."""
        group = set(names)
        rules = [rule for name in group for rule in self.problem.domain.rules[name]]
        return any(group & situations_of(inner) for rule in rules for c in rule.conditions for inner in walk(c))

    def sources(self, name: str, other: str) -> list[tuple[int, Any]]:
        """Return the slot of each symbol of a remembered type, with a function: whether the symbol that it remembers is true."""
        found = []
        for symbol, slot in self.slots.items():
            if symbol.situation == name:
                said = self.condition(ValueCondition(other, symbol.arguments, TRUE), {}, {})
                found.append((slot, eval(f"lambda s: {said}", NAMES)))
        return found

    def closed(self, values: list[Any], level: float = math.inf) -> State:
        """Return a state with all derived values.

        The remembered symbols that a level sees become true if the symbols that they remember are true.
        """
        self.derive(values)
        for cells in (cells for first, cells in self.remembered if first <= level):
            for slot in [slot for slot, true in cells if true(values)]:
                values[slot] = TRUE
            self.derive(values)
        return tuple(values)

    def derive(self, values: list[Any]) -> None:
        """Set all derived values: first amounts, and then rules group by group, each up to a fixed point."""
        for _ in range(self.rounds):
            for slot, total in self.totals:
                values[slot] = total(values)
            for slot in range(self.stated, len(self.symbols)):
                values[slot] = FALSE
            for group, recursive in self.rules:
                more = True
                while more:
                    found = [slot for slot, test in group if values[slot] == FALSE and test(values)]
                    for slot in found:
                        values[slot] = TRUE
                    more = recursive and bool(found)

    def aggregated(self, one: Aggregate) -> Iterator[tuple[int, Any]]:
        """Yield the slot of each symbol of a derived amount, with the function from a state to the symbol's number."""
        kinds = {term.name: term.kind for term in (*one.parameters, *one.variables)}
        for arguments in product(*(self.problem.classes.get(p.kind, ()) for p in one.parameters)):
            symbol = Symbol(one.situation, arguments)
            if symbol not in self.slots:
                continue
            terms = dict(zip((p.name for p in one.parameters), arguments, strict=True))
            numbers = []
            for values in product(*(self.problem.classes.get(v.kind, ()) for v in one.variables)):
                solution = {**terms, **dict(zip((v.name for v in one.variables), values, strict=True))}
                when = self.some(one.conditions, solution, kinds)
                if when != "False":
                    numbers.append(f"({self.worth(one.amount, solution)} if {when} else nan)")
            said = f"aggregated({one.function!r}, [{', '.join(numbers)}])"
            yield self.slots[symbol], eval(f"lambda s: {said}", {**NAMES, "aggregated": aggregated})

    def actions(self, level: int) -> list[Action]:
        """Return the grounded behaviours of a level that may be applicable in some state."""
        if level not in self._actions:
            found = []
            for one in self.problem.domain.at_level(level):
                for arguments in product(*(self.problem.classes.get(p.kind, ()) for p in one.parameters)):
                    action = self.action(one, arguments)
                    self._named[one.name, arguments] = action
                    if action.outcomes:
                        found.append(action)
            self._actions[level] = found
        return self._actions[level]

    def action(self, one: Behavior, arguments: tuple[str, ...]) -> Action:
        """Return a behaviour grounded with the given arguments."""
        kinds = {term.name: term.kind for term in (*one.parameters, *one.variables)}
        terms = dict(zip((p.name for p in one.parameters), arguments, strict=True))
        outcomes = []
        for trial in self.bindings(one.preconditions, kinds, terms):
            asked = self.all_of(one.preconditions, trial, kinds)
            if asked != "False":
                outcomes.append(self.outcome(one, asked, trial, kinds))
        return Action(one, arguments, tuple(outcomes))

    def outcome(self, one: Behavior, asked: str, terms: Terms, kinds: Terms) -> Any:
        """Return a function from a state to the cost and the successor, or to None if the behaviour isn't applicable."""
        lines = ["def outcome(s):", f" if not ({asked}): return None", " t = list(s)"]
        for effect in sorted(one.effects, key=lambda effect: effect.value != FALSE):
            for when, symbol, value in self.instances(effect, terms, kinds):
                lines.append(f"{when} t[{self.slots[symbol]}] = {value!r}")
        limits: dict[int, str] = {}
        for operations in (("assign",), ("scale",), ("increase", "decrease")):
            for change in (change for change in one.amounts if change.operation in operations):
                for when, symbol, by in self.instances(change, terms, kinds):
                    slot = self.slots[symbol]
                    sign = {"scale": "*", "increase": "+", "decrease": "-"}.get(change.operation)
                    new = by if sign is None else f"t[{slot}] {sign} {by}"
                    lines.append(f"{when} t[{slot}] = {new} if t[{slot}] == t[{slot}] and {by} == {by} else nan")
                    limits[slot] = self.limit(symbol, f"t[{slot}]")
        lines += [f" if not ({limit}): return None" for limit in limits.values()]
        price = repr(one.cost) if one.price is None else self.worth(one.price, terms)
        lines.append(f" t = closed(t, {one.level})")
        lines += [f" if not ({limit}): return None" for limit in (*self.limits(), *self.prevented())]
        lines.append(f" return {price}, t")
        names: dict[str, Any] = {**NAMES, "closed": self.closed}
        exec("\n".join(lines), names)
        return names["outcome"]

    def instances(
        self, effect: ValueEffect | AmountEffect, terms: Terms, kinds: Terms
    ) -> Iterator[tuple[str, Symbol, str]]:
        """Yield each symbol that an effect changes, with the condition as the beginning of a code line and the new value."""
        each = effect.each or Parameter("?each", "")
        for one in self.problem.classes.get(each.kind, ()) if effect.each else ("",):
            for trial in self.bindings(effect.when, {**kinds, each.name: each.kind}, {**terms, each.name: one}):
                symbol = Symbol(effect.situation, tuple(trial.get(a, a) for a in effect.arguments))
                when = self.all_of(effect.when, trial, kinds)
                if symbol in self.slots and when != "False" and symbol.situation not in self.problem.domain.remembers:
                    if isinstance(effect, ValueEffect):
                        said = trial.get(effect.value, effect.value)
                    else:
                        said = self.worth(effect.amount, trial)
                    yield "" if when == "True" else f" if {when}:", symbol, said

    def limits(self) -> Iterator[str]:
        """Yield Python expressions that are true if sums and counts are within their bounds."""
        for name, one in self.problem.domain.aggregates.items():
            quantity = self.kinds[name].quantity
            if one.kept and quantity is not None and (quantity.least, quantity.most) != (None, None):
                for symbol in (s for s in self.slots if s.situation == name):
                    yield self.limit(symbol, f"t[{self.slots[symbol]}]")

    def prevented(self) -> Iterator[str]:
        """Yield Python expressions that are false if a step violates a constraint that held before the step."""
        for one in self.problem.domain.constraints.values():
            wanted = TRUE if one.always else FALSE
            for symbol, slot in self.slots.items():
                if symbol.situation == one.situation:
                    yield f"t[{slot}] == {wanted!r} or s[{slot}] != {wanted!r}"

    def limit(self, symbol: Symbol, amount: str) -> str:
        """Return the Python expression that is true if an amount is within its bounds."""
        quantity = self.kinds[symbol.situation].quantity
        assert quantity is not None
        said = [
            f"{amount} == {amount}",
            f"abs({amount}.numerator) <= {LARGEST}",
            f"(type({amount}) is int or {amount}.denominator <= {LARGEST})",
        ]
        said += [f"{amount} >= {number(quantity.least)!r}"] if quantity.least is not None else []
        said += [f"{amount} <= {number(quantity.most)!r}"] if quantity.most is not None else []
        said += [f"{amount} == int({amount})"] if quantity.whole else []
        return " and ".join(said)

    def done(self, name: str, arguments: tuple[str, ...], state: State) -> Iterator[tuple[Any, State]]:
        """Yield the costs and successors of a behaviour in a state."""
        behavior = self.problem.domain.behaviors.get(name)
        if behavior is None:
            return
        self.actions(behavior.level)
        action = self._named.get((name, arguments))
        for outcome in action.outcomes if action else ():
            if (made := outcome(state)) is not None:
                yield made

    # ------------------------------------------------------------------------------------------------------------ search

    def wanted(self, state: State) -> bool:
        """Return whether the goal holds in a state."""
        return all(self.meets(state, symbol, value) for symbol, value in self.problem.goal.items())

    def meets(self, state: State, symbol: Symbol, value: str) -> bool:
        """Return whether a symbol has its goal value."""
        got = self.value(state, symbol)
        if got is None or self.kinds[symbol.situation].quantity is None:
            return (FALSE if got is None else got) == value
        for part in value.split(","):
            sign = next((sign for sign in ("<=", ">=", "<", ">", "=") if part.startswith(sign)), "")
            limit = number(part[len(sign) :])
            if not {"<=": got <= limit, ">=": got >= limit, "<": got < limit, ">": got > limit}.get(sign, got == limit):
                return False
        return True

    def value(self, state: State, symbol: Symbol) -> Any:
        """Return the value of a symbol in a state, or None if the problem has no such symbol."""
        return state[self.slots[symbol]] if symbol in self.slots else self.constants.get(symbol)

    def explored(self, level: int, most: int, rests: bool = True) -> Truth:
        """Return the nodes that behaviours of a level can reach; with `rests`, changed symbols must end with their rest values.

        Raises
        ------
        TooManyStatesError
            More than `most` nodes are reachable, and none of the first `most` nodes satisfies the goal.
        """
        actions = [(outcome, action) for action in self.actions(level) for outcome in action.outcomes]
        watched = dict(self.rests) if rests else {}
        start: Node = (self.initial, frozenset())
        costs: dict[Node, Any] = {start: 0}
        done: set[Node] = set()
        waiting: list[tuple[Any, int, Node]] = [(0, 0, start)]
        count, least = 0, None
        while waiting:
            cost, _, node = heappop(waiting)
            if node in done:
                continue
            done.add(node)
            state, restless = node
            if least is None and not restless and self.wanted(state):
                least = cost
            for outcome, _ in actions:
                made = outcome(state)
                if made is None:
                    continue
                price, after = made
                if not price >= 0:
                    continue
                still = restless
                if watched:
                    still = frozenset(
                        slot
                        for slot, rest in watched.items()
                        if after[slot] != rest and (slot in restless or after[slot] != state[slot])
                    )
                follower = after, still
                if follower not in done and cost + price < costs.get(follower, math.inf):
                    if len(costs) >= most:
                        if least is not None and self.problem.goal:
                            return Truth(costs, least)
                        raise TooManyStatesError
                    costs[follower] = cost + price
                    count += 1
                    heappush(waiting, (cost + price, count, follower))
        return Truth(costs, least)


def _joined(parts: Sequence[str], word: str, empty: str, decisive: str) -> str:
    """Return expressions joined by `and` or `or`, without redundant expressions."""
    if decisive in parts:
        return decisive
    left = [part for part in dict.fromkeys(parts) if part != empty]
    if not left:
        return empty
    return left[0] if len(left) == 1 else "(" + f" {word} ".join(f"({part})" for part in left) + ")"


def _negated(said: str, negated: bool) -> str:
    if not negated:
        return said
    return {"True": "False", "False": "True"}.get(said, f"not ({said})")


def aggregated(function: str, numbers: Sequence[Any]) -> Any:
    """Return the sum, count, maximum or minimum of numbers, without missing numbers."""
    found = [one for one in numbers if one == one]
    if function == "count":
        return len(found)
    if function == "sum":
        return sum(found)
    return {"max": max, "min": min}[function](found) if found else NOTHING


NAMES: dict[str, Any] = {"nan": NOTHING, "divided": divided, "Fraction": Fraction}
"""Names that generated expressions may contain besides the state."""

"""A state as a table that is changed in place, and Python code generated for conditions and effects.

The dictionary ``now`` of a table is the state, and maps each situation type and key to a value. A key is an individual,
or a tuple of individuals if the symbol has several arguments. The dictionary ``holders`` maps each situation type and
value to the keys with this value, except for the value false. The list ``trail`` contains the overwritten values,
oldest first, and lets `undo` restore earlier values. The number ``age`` counts all changes, including undone changes.
Results that are derived from the table are valid while the age is the same.

The table contains no defined situations. ``now`` derives a defined situation when its value is read
(`confab.planner.derived_facts`).

The time to copy a state would grow with the size of the world. A change and its undoing take a microsecond in any world. A
condition becomes one Python expression over `now` and `holders`. A behaviour becomes a function ``forward(arguments)``. This
function returns the individuals of the behaviour's variables and the changes, or None if the behaviour isn't applicable.
`PythonWriter.expression` has a case for each kind of condition.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from typing import Any, TypeAlias

from confab.planner.amount_transitions import amount, change, comparison, settled
from confab.planner.generated import code, identifier, key_written, tuple_written, written
from confab.reasoner.amounts import terms_of
from confab.reasoner.language import DomainError, needs, nothing_determines
from confab.reasoner.limits import check
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    AmountEffect,
    AnyOf,
    Behavior,
    ClassCondition,
    Comparison,
    Condition,
    EqualityCondition,
    RelationCondition,
    State,
    Symbol,
    ValueCondition,
    Witness,
)

Key: TypeAlias = "str | tuple[str, ...]"
Cell: TypeAlias = "tuple[str, Key]"
"""A cell of a table: the situation type and the key of a symbol."""
Change: TypeAlias = "tuple[str, Key, str]"
"""A change: the situation type and the key of a symbol, and the new value."""
Changes: TypeAlias = "tuple[dict[Cell, str], dict[Cell, str]]"
"""The net changes of cells: a mapping of cells to the values before, and a mapping of cells to the values after."""
Forward: TypeAlias = "Callable[..., tuple[tuple[str, ...], list[Change]] | None]"
"""Function of arguments that returns the individuals of a behaviour's variables and the behaviour's changes."""


def key_of(arguments: tuple[str, ...]) -> Key:
    """Return the table key for the arguments of a symbol."""
    return arguments[0] if len(arguments) == 1 else arguments


def arguments_of(key: Key) -> tuple[str, ...]:
    """Return the arguments of a symbol with the given table key."""
    return (key,) if isinstance(key, str) else key


class Table:
    """A state that is changed in place, with a log of overwritten values."""

    def __init__(self, situations: Iterable[str], state: State) -> None:
        self.now: dict[str, dict[Key, str]] = {name: {} for name in situations}
        self.holders: dict[str, dict[str, dict[Key, None]]] = {name: {} for name in self.now}
        self.trail: list[tuple[str, Key, str]] = []
        self.age = 0
        for symbol, value in state.items():
            key = key_of(symbol.arguments)
            self.now[symbol.situation][key] = value
            if value != FALSE:
                self.holders[symbol.situation].setdefault(value, {})[key] = None

    def put(self, situation: str, key: Key, value: str) -> None:
        """Set the value of a symbol, and record the old value."""
        self.age += 1
        cells = self.now[situation]
        old = cells.get(key, FALSE)
        cells[key] = value
        holders = self.holders[situation]
        if old != FALSE:
            del holders[old][key]
        if value != FALSE:
            keys = holders.get(value)
            if keys is None:
                holders[value] = {key: None}
            else:
                keys[key] = None
        self.trail.append((situation, key, old))

    def put_all(self, values: Mapping[Cell, str]) -> None:
        """Set the values of several symbols."""
        for (situation, key), value in values.items():
            self.put(situation, key, value)

    def undo(self, mark: int) -> None:
        """Undo all changes that were made after the trail had the length `mark`."""
        trail = self.trail
        while len(trail) > mark:
            situation, key, old = trail.pop()
            self.put(situation, key, old)
            trail.pop()

    def before(self, mark: int) -> dict[Cell, str]:
        """Return the symbols set since a marked state, with their values in the marked state."""
        found: dict[Cell, str] = {}
        for situation, key, old in self.trail[mark:]:
            found.setdefault((situation, key), old)
        return found

    def since(self, mark: int) -> dict[Cell, str]:
        """Return the symbols whose values have changed since a marked state, with the current values."""
        now = self.now
        return {cell: now[cell[0]][cell[1]] for cell, old in self.before(mark).items() if now[cell[0]][cell[1]] != old}

    def changes(self, mark: int) -> Changes:
        """Return the net changes since a marked state: the values in the marked state, and the current values."""
        before, after = self.before(mark), self.since(mark)
        return {cell: before[cell] for cell in after}, after

    def state(self) -> dict[Symbol, str]:
        """Return the state as a mapping of symbols to values."""
        return {Symbol(s, arguments_of(key)): value for s, cells in self.now.items() for key, value in cells.items()}


class PythonWriter:
    """Writer of Python code that evaluates the conditions and behaviours of one problem on the dictionaries of a table.

    The initial state and the goal of the problem aren't used.
    """

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.constants: dict[str, object] = {}
        self.variables: dict[str, tuple[str, ...]] = {}
        self._fan: dict[str, float] = {}
        self._tables = {
            identifier(table, s): f"{table}[{s!r}]" for s in problem.domain.situations for table in ("now", "holders")
        }

    def function(self, lines: Iterable[str], result: str, given: str = "") -> Callable[..., Any]:
        """Return a function of a table's `now` and `holders`, and of `given`, that executes lines and returns an expression."""
        body = [f"    {line}" for line in (*lines, f"return {result}")]
        text = "\n".join(body)
        names = [f"    {name} = {table}" for name, table in self._tables.items() if name in text]
        exec(code("\n".join([f"def bind(now, holders{given}):", *names, text])), self.constants)
        return self.constants.pop("bind")  # type: ignore[return-value]

    def forward(self, behavior: Behavior) -> Iterator[str]:
        """Yield the lines that define the function of a behaviour and store the function in `forward`."""
        kinds = behavior.kinds
        parameters = [p.name for p in behavior.parameters]
        bound = set(parameters)
        tests = [self.member(p.name, p.kind) for p in behavior.parameters]
        tests += self.conjunction(behavior.preconditions, bound, kinds, behavior.name)
        variables = sorted(v.name for v in behavior.variables if v.name in bound)
        self.variables[behavior.name] = tuple(variable[1:] for variable in variables)
        yield f"def {identifier('forward', behavior.name)}({', '.join(map(written, parameters))}):"
        yield f"    if not ({' and '.join(tests) or 'True'}): return None"
        yield "    changes = []"
        if behavior.amounts:
            yield "    amounts = {}"
        for effect in behavior.every_effect:
            inner = set(bound)
            when = self.conjunction(effect.when, inner, kinds, behavior.name)
            given = terms_of(effect.amount) if isinstance(effect, AmountEffect) else (effect.value,)
            free = {t for t in (*effect.arguments, *given) if t.startswith("?")} - inner
            if free:
                raise DomainError(
                    f"{behavior.name}: nothing determines {', '.join(sorted(free))}, which an effect names"
                )
            key = key_written(effect.arguments)
            if isinstance(effect, AmountEffect):
                when.append(f"{key} in {identifier('now', effect.situation)}")
                does = change(effect, self.problem.relations, self.constant)
            else:
                when += self._exists(effect.situation, effect.arguments, kinds)
                does = f"changes.append(({effect.situation!r}, {key}, {written(effect.value)}))"
            yield f"    if {' and '.join(when)}: {does}" if when else f"    {does}"
        if behavior.amounts:
            quantities = {s.name: s.quantity for s in self.problem.domain.situations.values() if s.quantity}
            known = self.constant(("amounts", "quantities"), quantities)
            yield f"    if not {self.constant(('amounts', 'settled'), settled)}(amounts, {known}, changes): return None"
        yield f"    return {tuple_written(map(written, variables))}, changes"
        yield f"forward[{behavior.name!r}] = {identifier('forward', behavior.name)}"

    def priced(self, behavior: Behavior) -> Iterator[str]:
        """Yield the line that stores the cost function of a behaviour in `prices`, if the behaviour has a price.

        The arguments of the cost function are the individuals of the behaviour's parameters and variables.
        """
        if behavior.price is not None:
            terms = [*(p.name for p in behavior.parameters), *(f"?{name}" for name in self.variables[behavior.name])]
            price = amount(behavior.price, self.problem.relations, self.constant)
            yield f"prices[{behavior.name!r}] = lambda {', '.join(map(written, terms))}: {price}"

    def conjunction(
        self, conditions: Sequence[Condition], bound: set[str], kinds: Mapping[str, str], where: str
    ) -> list[str]:
        """Return conditions as expressions, in an order that binds each variable before its use; `bound` gets the new variables."""
        check("compiling conditions")
        return [self.expression(ready, bound, kinds, where) for ready in in_binding_order(conditions, bound, where)]

    def expression(self, condition: Condition, bound: set[str], kinds: Mapping[str, str], where: str) -> str:
        """Return a condition as a Python expression, which assigns a variable if the condition determines the variable."""
        match condition:
            case ValueCondition(situation, arguments, value, negated):
                look = self.look(condition)
                if value.startswith("?") and value not in bound:
                    bound.add(value)
                    return f"({written(value)} := {look}) in {self.kind(kinds[value])}"
                test = " and ".join([f"{look} == {written(value)}", *self._exists(situation, arguments, kinds)])
                return f"not ({test})" if negated else test
            case RelationCondition(relation, arguments, negated):
                tuples = self.constant(("relation", relation), self.problem.relations.get(relation, frozenset()))
                return f"({tuple_written(map(written, arguments))} {'not in' if negated else 'in'} {tuples})"
            case ClassCondition(term, kind, negated):
                return f"{written(term)} {'not in' if negated else 'in'} {self.kind(kind)}"
            case EqualityCondition(left, right, negated):
                return f"{written(left)} {'!=' if negated else '=='} {written(right)}"
            case Witness(variable, _, _, negated):
                source, tests = self.satisfying(condition, bound, kinds, where)
                found = (
                    f"any(({' and '.join(tests)}) for {written(variable)} in {source})" if tests else f"bool({source})"
                )
                return f"not {found}" if negated else found
            case AnyOf(alternatives, negated):
                groups = [" and ".join(self.conjunction(g, set(bound), kinds, where)) or "True" for g in alternatives]
                return ("not " if negated else "") + "(" + " or ".join(f"({g})" for g in groups) + ")"
            case Comparison():
                return comparison(condition, self.problem.relations, self.constant)

    def satisfying(
        self, condition: Witness, bound: set[str], kinds: Mapping[str, str], where: str
    ) -> tuple[str, list[str]]:
        """Return an expression for the candidates of a witness, and the tests that a candidate must pass."""
        term, kind = condition.variable, condition.kind
        inner = {**kinds, term: kind}
        candidates = self.problem.classes.get(kind, ())
        found: list[tuple[float, Condition | None, str]] = [
            (len(candidates), None, self.constant(("members", kind), candidates))
        ]
        for c in condition.conditions:
            match c:
                case ValueCondition(situation, (only,), value, False) if only == term and value != term:
                    if self.listed(situation, value) and (value in bound or not value.startswith("?")):
                        found.append((1.0, c, f"{identifier('holders', situation)}.get({written(value)}, ())"))
                case RelationCondition(relation, arguments, False) if arguments.count(term) == 1:
                    if not {a for a in arguments if a.startswith("?")} - bound - {term}:
                        text, fan = self.adjacent(relation, arguments, term)
                        found.append((fan, c, text))
        _, consumed, source = min(found, key=lambda entry: entry[0])
        rest = [c for c in condition.conditions if c is not consumed]
        tests = self.conjunction(rest, bound | {term}, inner, where)
        if consumed is not None and not (
            isinstance(consumed, ValueCondition)
            and self.problem.members(self.problem.domain.situations[consumed.situation].arguments[0])
            <= self.problem.members(kind)
        ):
            tests.insert(0, self.member(term, kind))
        return source, tests

    def listed(self, situation: str, value: str) -> bool:
        """Return whether the table lists the symbols with the given value.

        The table has no such lists for defined situations. For a boolean situation type, the table lists only the true symbols.
        """
        domain = self.problem.domain
        return situation not in domain.rules and (value == TRUE or not domain.situations[situation].boolean)

    def look(self, condition: ValueCondition) -> str:
        """Return the expression for the current value of a condition's symbol."""
        default = f", {FALSE!r}" if self.problem.domain.situations[condition.situation].boolean else ""
        return f"{identifier('now', condition.situation)}.get({key_written(condition.arguments)}{default})"

    def _exists(self, situation: str, arguments: Sequence[str], kinds: Mapping[str, str]) -> list[str]:
        """Return tests that a symbol exists; a term whose class guarantees the existence needs no test."""
        return [
            self.member(term, wanted)
            for term, wanted in zip(arguments, self.problem.domain.situations[situation].arguments, strict=True)
            if not (term in kinds and self.problem.members(kinds[term]) <= self.problem.members(wanted))
        ]

    def member(self, term: str, kind: str) -> str:
        """Return the test that a term belongs to a class."""
        return f"{written(term)} in {self.kind(kind)}"

    def adjacent(
        self, relation: str, arguments: Sequence[str], term: str, unbound: AbstractSet[str] = frozenset()
    ) -> tuple[str, float]:
        """Return an expression for the individuals related to the other arguments, any if unbound, and their average number."""
        position = list(arguments).index(term)
        known = [i for i, other in enumerate(arguments) if i != position and other not in unbound]
        name = "_".join(map(str, (identifier("adjacent", relation), position, *known)))
        if name not in self.constants:
            table: dict[tuple[str, ...], dict[str, None]] = {}
            for row in sorted(self.problem.relations.get(relation, ())):
                table.setdefault(tuple([row[i] for i in known]), {})[row[position]] = None
            self.constants[name] = {others: tuple(found) for others, found in table.items()}
            self._fan[name] = sum(map(len, table.values())) / max(len(table), 1)
        return f"{name}.get({tuple_written(written(arguments[i]) for i in known)}, ())", self._fan[name]

    def kind(self, kind: str) -> str:
        """Return the name, in generated code, of the set of a class's individuals."""
        return self.constant(("kind", kind), self.problem.members(kind))

    def constant(self, what: tuple[str, str], value: object) -> str:
        """Store a value under a name for generated code, and return the name."""
        name = identifier(*what)
        self.constants[name] = value
        return name


_COST: Mapping[type[Condition], int] = {
    ClassCondition: 0,
    EqualityCondition: 0,
    ValueCondition: 1,
    RelationCondition: 2,
    Comparison: 3,
    AnyOf: 4,
    Witness: 5,
}


def in_binding_order(conditions: Iterable[Condition], bound: AbstractSet[str], where: str) -> Iterator[Condition]:
    """Yield the conditions in an order that binds each variable before its use, cheap conditions first.

    The caller adds newly bound variables to `bound`.

    Raises
    ------
    DomainError
        No condition binds the variables of the remaining conditions.
    """
    waiting = [(_COST[type(condition)], needs(condition), condition) for condition in conditions]
    while waiting:
        ready = [place for place, (_, needed, _) in enumerate(waiting) if needed <= bound]
        if not ready:
            raise nothing_determines(where, [condition for _, _, condition in waiting], bound)
        yield waiting.pop(min(ready, key=lambda place: waiting[place][0]))[2]

"""Grounding: one level of a problem becomes a `Task`, by joins in rounds of relaxed reachability.

reach       what can become true if nothing ever becomes false, round by round, each join starting from what is new
(semi-naive) assemble    bits for the facts that can change, operators for the rows that were joined goal        a
wanted fact that isn't reachable even so proves that there is no plan

Conditions that only a state can decide are left out of the joins, which keeps reachability on the safe side; they are
worked out once per combination of individuals when operators are assembled, as conjunctions of literals
(`_Formulas`).

Semi-naive grounding as a database does it: Helmert, "Concise finite-domain representations for PDDL planning tasks",
Artificial Intelligence 173 (2009), section 6. We join arrays and not tuples, and keep one value per symbol from the
start.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from time import perf_counter
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from planner.grounded.joins import Ints, Table, TooLargeError, pack
from planner.grounded.schemas import Atom, Schema, plain_variables, schemas
from planner.grounded.task import Change, Grouped, Task
from planner.language import mentions
from planner.plan import Reason
from reasoner.symbols import (
    FALSE,
    TRUE,
    AnyOf,
    ClassCondition,
    Condition,
    EqualityCondition,
    Fact,
    Problem,
    RelationCondition,
    SituationType,
    State,
    Symbol,
    ValueCondition,
    ValueEffect,
    Witness,
)

Flags: TypeAlias = NDArray[np.bool_]
MOST_ROWS = 20_000_000  # of one join: about 1 GB

__all__ = ["OutOfTimeError", "TooLargeError", "ground"]


class OutOfTimeError(Exception):
    """The deadline came before grounding was done."""


def ground(
    problem: Problem,
    level: int | None = None,
    initial: State | None = None,
    goal: State | None = None,
    most: int = MOST_ROWS,
    deadline: float | None = None,
) -> Task | Reason:
    """Ground one level of a problem.

    Parameters
    ----------
    problem : Problem
    level : int, optional
        The lowest level if not given.
    initial, goal : State, optional
        In place of the problem's own.
    most : int
        Rows that one join may have.
    deadline : float, optional
        On the clock of `time.perf_counter`.

    Returns
    -------
    Task or Reason
        A reason proves that no behaviours of this level lead from `initial` to `goal`, and says why.

    Raises
    ------
    TooLargeError
        A join would have more than `most` rows.
    OutOfTimeError
        The deadline came first.
    DomainError
        A behaviour names a variable that nothing determines.
    """
    level = problem.domain.levels[-1] if level is None else level
    reached = Reached(problem, level, problem.initial if initial is None else initial, most, deadline)
    reached.close()
    wanted = problem.goal if goal is None else goal
    for symbol, value in sorted(wanted.items()):
        if not reached.possible(symbol, value):
            from planner.grounded.unreachable import unreachable  # it reads what was reached

            return unreachable(reached, Fact(symbol, value))
    return _Assembly(reached).task(wanted)


class Reached:
    """The tables of a level, and what becomes reachable in them.

    Attributes
    ----------
    tables : mapping of (kind, name) to Table
        Kind is situation, relation or class; the rows of a situation type are arguments and value (no value if it is
        boolean, of which only the true ones are listed).
    rows : list of Ints
        Per schema, the individuals put in for its terms.
    """

    def __init__(self, problem: Problem, level: int, initial: State, most: int, deadline: float | None) -> None:
        self.problem, self.level, self.most, self.deadline = problem, level, most, deadline
        self.situations = {s.name: s for s in problem.domain.situations.values() if s.level <= level}
        self.initial = {symbol: value for symbol, value in initial.items() if symbol.situation in self.situations}
        behaviors = problem.domain.at_level(level)
        changed = frozenset(effect.situation for behavior in behaviors for effect in behavior.effects)
        situations, members = problem.domain.situations, problem.members
        self.schemas = [s for behavior in behaviors for s in schemas(behavior, situations, changed, members)]
        self.individuals = tuple(dict.fromkeys(self._individuals()))
        self.number = {name: i for i, name in enumerate(self.individuals)}
        self.radix = max(len(self.individuals), 1)
        self.tables: dict[tuple[str, str], Table] = defaultdict(lambda: Table(1, self.radix))
        self.symbols: dict[str, Table] = {}
        self._fill()
        self.rows: list[Ints] = [np.empty((0, len(schema.terms)), np.int64) for schema in self.schemas]

    def _individuals(self) -> Iterator[str]:
        for members in self.problem.classes.values():
            yield from members
        yield from (TRUE, FALSE)
        for symbol, value in self.initial.items():
            yield from (*symbol.arguments, value)
        for tuples in self.problem.relations.values():
            for arguments in sorted(tuples):
                yield from arguments
        for schema in self.schemas:
            for atom in schema.atoms:
                yield from (term for term in atom.terms if not term.startswith("?"))
            for _, effect in schema.effects:
                yield from (term for term in (*effect.arguments, effect.value) if not term.startswith("?"))

    def _fill(self) -> None:
        for kind, members in self.problem.classes.items():
            self._put(("class", kind), 1, [(name,) for name in members])
        for relation, tuples in self.problem.relations.items():
            for arity in sorted({len(arguments) for arguments in tuples}):
                self._put(("relation", relation), arity, [a for a in tuples if len(a) == arity])
        by_situation: dict[str, list[tuple[str, ...]]] = {name: [] for name in self.situations}
        for symbol, value in self.initial.items():
            if not self.situations[symbol.situation].boolean:
                by_situation[symbol.situation].append((*symbol.arguments, value))
            elif value == TRUE:
                by_situation[symbol.situation].append(symbol.arguments)
        for name, facts in by_situation.items():
            situation = self.situations[name]
            arity = len(situation.arguments) + (not situation.boolean)
            self._put(("situation", name), arity, facts)
            if not situation.boolean:
                self.symbols[name] = Table(arity - 1, self.radix)
                self.symbols[name].add(self.tables["situation", name].rows[:, :-1])

    def _put(self, key: tuple[str, str], arity: int, rows: Sequence[tuple[str, ...]]) -> None:
        number = self.number
        table = self.tables[key] = Table(arity, self.radix)
        flat = [number[name] for row in rows for name in row]
        table.add(np.array(flat, np.int64).reshape(len(rows), arity))

    def close(self) -> None:
        """Join every schema with what is new, until nothing is."""
        fluents = [("situation", name) for name in self.situations]
        before = dict.fromkeys(fluents, 0)
        found: list[list[Ints]] = [[] for _ in self.schemas]
        first = True
        while True:
            size = {key: len(self.tables[key]) for key in fluents}
            candidates: dict[tuple[str, str], list[Ints]] = defaultdict(list)
            for i, schema in enumerate(self.schemas):
                for rows in self._new_rows(schema, before, size, first):
                    found[i].append(rows)
                    for _, effect in schema.effects:
                        if effect.value != FALSE:
                            candidates["situation", effect.situation].append(self.effect_rows(schema, effect, rows))
            for key, parts in candidates.items():
                rows = np.concatenate(parts)
                self.tables[key].add(rows[self._exists(key[1], rows)])
            before, first = size, False
            if all(len(self.tables[key]) == size[key] for key in fluents):
                break
        for i, parts in enumerate(found):
            if parts:
                rows = np.concatenate(parts)
                _, unique = np.unique(pack(rows, self.radix), return_index=True)
                self.rows[i] = rows[unique]

    def _new_rows(
        self, schema: Schema, before: Mapping[tuple[str, str], int], size: Mapping[tuple[str, str], int], first: bool
    ) -> Iterator[Ints]:
        """Yield the schema's rows that use at least one fact of the last round, each combination of facts once."""
        fluent = [i for i, atom in enumerate(schema.atoms) if atom.fluent]
        if not fluent and first:
            yield from self.joined(schema, None, {})
        for position, start in enumerate(fluent):
            key = schema.atoms[start].table
            ranges = {start: (before[key], size[key])}
            ranges |= {i: (0, before[schema.atoms[i].table]) for i in fluent[:position]}
            if all(low < high for low, high in ranges.values()):
                yield from self.joined(schema, start, ranges)

    def joined(
        self, schema: Schema, start: int | None = None, ranges: Mapping[int, tuple[int, int]] | None = None
    ) -> Iterator[Ints]:
        """Yield the rows of a schema's terms, at most once, that match every atom inside its range of rows."""
        self.check_time()
        columns: dict[str, Ints] = {}
        count, waiting, filters = 1, list(range(len(schema.atoms))), list(schema.filters)
        while waiting:
            i = start if start in waiting else min(waiting, key=lambda i: self._fan_out(schema.atoms[i], columns))
            assert i is not None
            waiting.remove(i)
            columns, count = self._step(schema.atoms[i], columns, count, (ranges or {}).get(i))
            ready = [f for f in filters if self._variables(f, schema) <= columns.keys()]
            filters = [f for f in filters if f not in ready]
            for condition in ready:
                keep = self._decide(condition, columns, count, schema.kinds)
                columns, count = {name: column[keep] for name, column in columns.items()}, int(keep.sum())
            if not count:
                return
        for condition in filters:  # without atoms, or with local variables only
            keep = self._decide(condition, columns, count, schema.kinds)
            columns, count = {name: column[keep] for name, column in columns.items()}, int(keep.sum())
        if count:
            yield np.stack([columns[t] for t in schema.terms], axis=1) if schema.terms else np.zeros((1, 0), np.int64)

    def check_time(self) -> None:
        """Raise `OutOfTimeError` when the deadline has passed."""
        if self.deadline is not None and perf_counter() > self.deadline:
            raise OutOfTimeError("the time limit came first")

    def _fan_out(self, atom: Atom, columns: Mapping[str, Ints]) -> float:
        """Estimate how many rows of the atom's table match one row of `columns`."""
        free = len({t for t in atom.terms if t.startswith("?")} - columns.keys())
        return float(max(len(self.tables[atom.table]), 1) ** (free / max(len(atom.terms), 1)) - (not free))

    def _step(
        self, atom: Atom, columns: dict[str, Ints], count: int, limits: tuple[int, int] | None
    ) -> tuple[dict[str, Ints], int]:
        """Join `columns` with an atom."""
        table = self.tables[atom.table]
        if table.arity != len(atom.terms):
            return {name: column[:0] for name, column in columns.items()} | {
                t: np.empty(0, np.int64) for t in atom.terms if t.startswith("?")
            }, 0
        known = [c for c, t in enumerate(atom.terms) if t in columns or not t.startswith("?")]
        values = np.empty((count, len(known)), np.int64)
        for place, column in enumerate(known):
            term = atom.terms[column]
            values[:, place] = columns[term] if term in columns else self.number[term]
        if len(known) == table.arity:
            right = table.find(values)
            left = np.flatnonzero(right >= 0)
            right = right[left]
        elif not known and count == 1 and limits:
            right = np.arange(*limits)
            left = np.zeros(len(right), np.int64)
        else:
            left, right = table.match(known, values, self.most)
        if limits:
            inside = (right >= limits[0]) & (right < limits[1])
            left, right = left[inside], right[inside]
        joined = {name: column[left] for name, column in columns.items()}
        keep = None
        for column, term in enumerate(atom.terms):
            if column in known:
                continue
            new = table.rows[right, column]
            if term in joined:
                same = joined[term] == new
                keep = same if keep is None else keep & same
            else:
                joined[term] = new
        if keep is None:
            return joined, len(left)
        return {name: column[keep] for name, column in joined.items()}, int(keep.sum())

    def _variables(self, condition: Condition, schema: Schema) -> set[str]:
        bound = {t for atom in schema.atoms for t in atom.terms}
        return {t for t in mentions(condition) if t in bound}

    def _decide(self, condition: Condition, columns: Mapping[str, Ints], count: int, kinds: Mapping[str, str]) -> Flags:
        """Return for each row whether a static condition holds."""
        match condition:
            case EqualityCondition(left, right, negated):
                a, b = (columns[t] if t in columns else self.number.get(t, -1) for t in (left, right))
                return np.broadcast_to((np.asarray(a) == np.asarray(b)) != negated, (count,))
            case RelationCondition(relation, terms, negated):
                table = self.tables["relation", relation]
                if all(t in columns for t in terms) and table.arity == len(terms):
                    places = table.find(np.stack([columns[t] for t in terms], axis=1))
                    return np.asarray((places >= 0) != negated)
            case ClassCondition(term, kind, negated):
                if term in columns:
                    places = self.tables["class", kind].find(columns[term][:, None])
                    return np.asarray((places >= 0) != negated)
        used = sorted(mentions(condition) & columns.keys())
        combinations, inverse = self.combinations(columns, used, count)
        holds = [self.formulas.condition(condition, dict(zip(used, c, strict=True)), kinds) == () for c in combinations]
        return np.array(holds, bool)[inverse]

    def combinations(
        self, columns: Mapping[str, Ints], used: Sequence[str], count: int
    ) -> tuple[list[tuple[str, ...]], Ints]:
        """Return the distinct combinations of individuals in some columns, and which of them each row has."""
        if not used:
            return [()], np.zeros(count, np.int64)
        matrix = np.stack([columns[name] for name in used], axis=1)
        _, first, inverse = np.unique(pack(matrix, self.radix), return_index=True, return_inverse=True)
        return [tuple(self.individuals[i] for i in row) for row in matrix[first].tolist()], inverse.ravel()

    @cached_property
    def formulas(self) -> Formulas:
        """Evaluates conditions; before bits are assigned, static ones only."""
        return Formulas(self)

    def effect_rows(self, schema: Schema, effect: ValueEffect, rows: Ints, value: bool = True) -> Ints:
        """Return the table rows (the symbols' only, without `value`) that an effect makes true, one per row of the schema."""
        boolean = self.situations[effect.situation].boolean
        terms = effect.arguments if boolean or not value else (*effect.arguments, effect.value)
        place = {name: column for column, name in enumerate(schema.terms)}
        columns = [rows[:, place[t]] if t in place else np.full(len(rows), self.number[t]) for t in terms]
        return np.stack(columns, axis=1) if columns else np.zeros((len(rows), 0), np.int64)

    def _exists(self, name: str, rows: Ints) -> Flags:
        """Return for each row of a situation type's table whether there is such a symbol."""
        situation = self.situations[name]
        if not situation.boolean:
            return self.symbols[name].find(rows[:, :-1]) >= 0
        exists = np.ones(len(rows), bool)
        for column, kind in enumerate(situation.arguments):
            exists &= self.tables["class", kind].find(rows[:, [column]]) >= 0
        return exists

    def possible(self, symbol: Symbol, value: str) -> bool:
        """Return whether a fact is reachable if nothing ever becomes false."""
        situation = self.situations.get(symbol.situation)
        if situation is None:
            return False
        if situation.boolean and value == FALSE:
            return True
        return self.find(situation, symbol.arguments, value) >= 0

    def find(self, situation: SituationType, arguments: Sequence[str], value: str) -> int:
        """Return the row of a fact in its table, or -1."""
        words = arguments if situation.boolean else (*arguments, value)
        numbers = [self.number.get(word, -1) for word in words]
        table = self.tables["situation", situation.name]
        if -1 in numbers or len(numbers) != table.arity:
            return -1
        return int(table.find(np.array([numbers], np.int64).reshape(1, -1))[0])


Literals = tuple[int, ...] | None
"""A conjunction of bits; the empty one is true, None is false."""


class Formulas:
    """Conditions with individuals put in, as conjunctions of bits. Disjunctions become derived bits, each made once.

    Until `facts` is filled, situation types that change have no bits: only static conditions may be asked about.
    """

    def __init__(self, reached: Reached) -> None:
        self.reached = reached
        self.bits: dict[str, dict[tuple[str, ...], int]] = {}  # of facts that can change, -1 for those always true
        self.size = 0
        self.complements: dict[int, int] = {}
        self.derived: dict[tuple[tuple[int, ...], ...], int] = {}

    def condition(
        self, condition: Condition, terms: Mapping[str, str], kinds: Mapping[str, str], negated: bool = False
    ) -> Literals:
        """Return what must hold for a condition (negated: its contrary) to hold."""

        def put(names: Sequence[str]) -> tuple[str, ...]:
            return tuple(terms.get(name, name) for name in names)

        match condition:
            case ValueCondition(situation, arguments, value, flipped):
                return self.value(situation, put(arguments), terms.get(value, value), flipped is not negated)
            case RelationCondition(relation, arguments, flipped):
                holds = put(arguments) in self.reached.problem.relations.get(relation, ())
            case ClassCondition(term, kind, flipped):
                holds = terms.get(term, term) in self.members(kind)
            case EqualityCondition(left, right, flipped):
                holds = terms.get(left, left) == terms.get(right, right)
            case Witness(variable, kind, conditions, flipped):
                groups: Iterable[Sequence[Condition]] = [(ClassCondition(variable, kind), *conditions)]
                inner = {name: term for name, term in terms.items() if name != variable}
                return self._any(groups, inner, {**kinds, variable: kind}, flipped is not negated)
            case AnyOf(alternatives, flipped):
                return self._any(alternatives, terms, kinds, flipped is not negated)
        return () if holds is not (flipped is not negated) else None

    def _any(
        self, groups: Iterable[Sequence[Condition]], terms: Mapping[str, str], kinds: Mapping[str, str], negated: bool
    ) -> Literals:
        """Return what must hold for some group to hold with some individuals for its own variables (negated: for none to)."""
        cases = [(group, found) for group in groups for found in self._solutions(list(group), dict(terms), kinds)]
        if negated:
            return self.all_of(
                self.any_of(self.condition(c, found, kinds, negated=True) for c in group) for group, found in cases
            )
        return self.any_of(self.all_of(self.condition(c, found, kinds) for c in group) for group, found in cases)

    def _solutions(
        self, group: list[Condition], terms: dict[str, str], kinds: Mapping[str, str]
    ) -> Iterator[dict[str, str]]:
        """Yield every way to put individuals in for a group's unbound variables that static knowledge doesn't rule out."""
        unbound = sorted(plain_variables(group) - terms.keys())
        if not unbound:
            yield terms
            return
        name, values = min(
            ((name, self._candidates(name, group, terms, kinds)) for name in unbound), key=lambda pair: len(pair[1])
        )
        for value in values:
            yield from self._solutions(group, {**terms, name: value}, kinds)

    def _candidates(
        self, name: str, group: Sequence[Condition], terms: Mapping[str, str], kinds: Mapping[str, str]
    ) -> Sequence[str]:
        """Return individuals for a variable: those that a positive condition of the group leaves, else its whole class."""
        members = self.members(kinds[name])
        for c in group:
            if isinstance(c, ValueCondition) and not c.negated and c.value == name:
                arguments = tuple(terms.get(a, a) for a in c.arguments)
                if not any(a.startswith("?") for a in arguments):
                    return [v for v in self.values.get((c.situation, arguments), ()) if v in members]
            if isinstance(c, RelationCondition) and not c.negated and name in c.arguments:
                fixed = {i: terms[a] for i, a in enumerate(c.arguments) if a in terms}
                place = c.arguments.index(name)
                tuples = self.reached.problem.relations.get(c.relation, ())
                found = {t[place] for t in tuples if all(t[i] == value for i, value in fixed.items())}
                return [v for v in members if v in found]
        return list(members)

    @cached_property
    def values(self) -> Mapping[tuple[str, tuple[str, ...]], list[str]]:
        """The reachable values of each symbol that isn't boolean."""
        found: dict[tuple[str, tuple[str, ...]], list[str]] = defaultdict(list)
        names = self.reached.individuals
        for name in self.reached.symbols:
            for row in self.reached.tables["situation", name].rows.tolist():
                found[name, tuple(names[i] for i in row[:-1])].append(names[row[-1]])
        return found

    def members(self, kind: str) -> dict[str, None]:
        """Return the individuals of a class."""
        if kind not in self._members:
            self._members[kind] = dict.fromkeys(self.reached.problem.classes.get(kind, ()))
        return self._members[kind]

    @cached_property
    def _members(self) -> dict[str, dict[str, None]]:
        return {}

    def value(self, situation: str, arguments: tuple[str, ...], value: str, negated: bool) -> Literals:
        """Return what must hold for a symbol to have a value (negated: not to have it)."""
        kind = self.reached.situations.get(situation)
        if kind is None:  # it doesn't exist on this level
            return () if negated else None
        if kind.boolean and value == FALSE:
            if not all(a in self.members(k) for a, k in zip(arguments, kind.arguments, strict=True)):
                return () if negated else None
            return self.value(situation, arguments, TRUE, not negated)
        bits = self.bits.get(situation)
        if bits is None:
            bit = -1 if self.reached.find(kind, arguments, value) >= 0 else None
        else:
            bit = bits.get(arguments if kind.boolean else (*arguments, value))
        if bit is None or bit == -1:
            return () if (bit is None) is negated else None
        return (self.complement(bit) if negated else bit,)

    def complement(self, bit: int) -> int:
        """Return the bit that says that a fact doesn't hold."""
        if bit not in self.complements:
            self.complements[bit] = self.size
            self.size += 1
        return self.complements[bit]

    def all_of(self, parts: Iterable[Literals]) -> Literals:
        """Return the conjunction."""
        found: set[int] = set()
        for part in parts:
            if part is None:
                return None
            found.update(part)
        return tuple(sorted(found))

    def any_of(self, parts: Iterable[Literals]) -> Literals:
        """Return the disjunction: one derived bit unless it is simpler than that."""
        found: set[tuple[int, ...]] = set()
        for part in parts:
            if part == ():
                return ()
            if part is not None:
                found.add(part)
        alternatives = tuple(sorted(found))
        if len(alternatives) < 2:
            return alternatives[0] if alternatives else None
        if alternatives not in self.derived:
            self.derived[alternatives] = self.size
            self.size += 1
        return (self.derived[alternatives],)


class _Assembly:
    """Operators and bits, made from what was reached."""

    def __init__(self, reached: Reached) -> None:
        self.reached = reached
        self.formulas = Formulas(reached)
        self.fact_bit: dict[str, Ints] = {}  # per situation type and row of its table, -1 if it never changes
        self.facts: list[Fact] = []
        self.constants: dict[Symbol, str] = {}
        self.symbol_of: dict[str, Ints] = {}  # per situation type and row of its table
        self.symbol_start: dict[str, int] = {}
        self.symbols = 0

    def task(self, goal: State) -> Task | Reason:
        self._number_facts()
        base = [i for i, schema in enumerate(self.reached.schemas) if not schema.conditional]
        rows, needs = {}, {}
        for i, schema in enumerate(self.reached.schemas):
            rows[i], needs[i] = self._needs(schema, self.reached.rows[i])
        wanted = self._goal(goal)
        if wanted is None:
            return Reason("the goals exclude one another, or what is wanted to end can't")
        # Number the operators, then the conditional effects behind them; those whose operator fell away fall away too.
        owners, first, count = {}, {}, 0
        for i in base:
            first[i] = count
            owners[i] = np.arange(count, count + len(rows[i]))
            count += len(rows[i])
        operators = count
        for i, schema in enumerate(self.reached.schemas):
            if schema.conditional:
                parent = max(b for b in base if b < i)
                table = Table(len(self.reached.schemas[parent].terms), self.reached.radix)
                table.rows = rows[parent]
                place = table.find(rows[i][:, : table.arity])
                keep = np.flatnonzero(place >= 0)
                new = np.full(len(rows[i]), -1)
                new[keep] = np.arange(len(keep))
                row, bit = needs[i]
                held = new[row] >= 0
                needs[i] = (new[row[held]], bit[held])
                rows[i], owners[i] = rows[i][keep], first[parent] + place[keep]
                first[i] = count
                count += len(keep)
        return self._build(rows, needs, owners, first, operators, count, wanted)

    def _number_facts(self) -> None:
        """Give a bit to every reachable fact whose symbol can change."""
        reached, names = self.reached, self.reached.individuals
        for name, situation in reached.situations.items():
            reached.check_time()
            table = reached.tables["situation", name]
            if situation.boolean:
                symbols = np.arange(len(table))
                number = len(table)
                changes = self._ever_false(name) | (np.arange(len(table)) >= self._true_at_first(name))
            else:
                symbols = reached.symbols[name].find(table.rows[:, :-1])
                number = len(reached.symbols[name])
                changes = np.bincount(symbols, minlength=number)[symbols] > 1
            self.symbol_start[name], self.symbol_of[name] = self.symbols, symbols + self.symbols
            self.symbols += number
            bits = np.full(len(table), -1)
            bits[changes] = np.arange(changes.sum()) + len(self.facts)
            self.fact_bit[name] = bits
            known = self.formulas.bits[name] = {}
            for row, bit in zip(table.rows.tolist(), bits.tolist(), strict=True):
                words = tuple(names[i] for i in row)
                known[words] = bit
                symbol, value = (
                    (Symbol(name, words), TRUE) if situation.boolean else (Symbol(name, words[:-1]), words[-1])
                )
                if bit < 0:
                    self.constants[symbol] = value
                else:
                    self.facts.append(Fact(symbol, value))
        self.formulas.size = len(self.facts)

    def _true_at_first(self, name: str) -> int:
        return sum(v == TRUE for s, v in self.reached.initial.items() if s.situation == name)

    def _ever_false(self, name: str) -> Flags:
        table = self.reached.tables["situation", name]
        found = np.zeros(len(table), bool)
        for schema, rows in zip(self.reached.schemas, self.reached.rows, strict=True):
            for _, effect in schema.effects:
                if effect.situation == name and effect.value == FALSE and len(rows):
                    places = table.find(self.reached.effect_rows(schema, effect, rows))
                    found[places[places >= 0]] = True
        return found

    def _needs(self, schema: Schema, rows: Ints) -> tuple[Ints, tuple[Ints, Ints]]:
        """Return the rows of a schema that can ever hold, and pairs of row and bit that it needs."""
        place = {name: column for column, name in enumerate(schema.terms)}
        columns = {name: rows[:, column] for name, column in place.items()}
        keep = np.ones(len(rows), bool)
        pairs: list[tuple[Ints, Ints]] = []
        for condition in schema.residue:
            self.reached.check_time()
            used = sorted(mentions(condition) & columns.keys())
            combinations, inverse = self.reached.combinations(columns, used, len(rows))
            found = [
                self.formulas.condition(condition, dict(zip(used, c, strict=True)), schema.kinds) for c in combinations
            ]
            keep &= np.array([literals is not None for literals in found], bool)[inverse]
            sizes = np.array([len(literals or ()) for literals in found], np.int64)
            flat = np.array([bit for literals in found for bit in literals or ()], np.int64)
            counts = sizes[inverse]
            starts = (np.cumsum(sizes) - sizes)[inverse]
            row = np.repeat(np.arange(len(rows)), counts)
            pairs.append((row, flat[_ranges(starts, counts)]))
        for atom in schema.atoms:
            if atom.fluent and len(rows):
                name = atom.table[1]
                values = [
                    columns[t] if t in columns else np.full(len(rows), self.reached.number[t]) for t in atom.terms
                ]
                table = self.reached.tables[atom.table]
                matrix = np.stack(values, axis=1) if values else np.zeros((len(rows), 0), np.int64)
                bits = self.fact_bit[name][table.find(matrix)]
                row = np.flatnonzero(bits >= 0)
                pairs.append((row, bits[row]))
        new = np.cumsum(keep) - 1
        row, bit = (np.concatenate([p[k] for p in pairs] or [np.empty(0, np.int64)]) for k in (0, 1))
        held = keep[row]
        return rows[keep], (new[row[held]], bit[held])

    def _goal(self, goal: State) -> Literals:
        return self.formulas.all_of(
            self.formulas.value(symbol.situation, symbol.arguments, value, False) for symbol, value in goal.items()
        )

    def _build(
        self,
        rows: Mapping[int, Ints],
        needs: Mapping[int, tuple[Ints, Ints]],
        owners: Mapping[int, Ints],
        first: Mapping[int, int],
        operators: int,
        count: int,
        wanted: tuple[int, ...],
    ) -> Task:
        schemas_, reached, formulas = self.reached.schemas, self.reached, self.formulas
        owner = np.concatenate([owners[i] for i in sorted(first, key=first.__getitem__)] or [np.empty(0, np.int64)])
        own_row = np.concatenate([needs[i][0] + first[i] for i in first] or [np.empty(0, np.int64)])
        own_bit = np.concatenate([needs[i][1] for i in first] or [np.empty(0, np.int64)])
        # A conditional effect needs what its operator needs as well.
        of_operator = _grouped(own_row[own_row < operators], own_bit[own_row < operators], operators)
        extra = np.arange(operators, count)
        lengths = np.diff(of_operator.starts)[owner[extra]]
        inherited = of_operator.items[_ranges(of_operator.starts[owner[extra]], lengths)]
        need = _grouped(
            np.concatenate([own_row, np.repeat(extra, lengths)]), np.concatenate([own_bit, inherited]), count
        )
        # Effects: relaxed operator, position, symbol, bit (-1: false).
        reached.check_time()
        effects = self._effects(rows, first)
        symbol_bits: dict[int, list[int]] = defaultdict(list)
        for name, bits in self.fact_bit.items():
            for symbol, bit in zip(self.symbol_of[name].tolist(), bits.tolist(), strict=True):
                if bit >= 0:
                    symbol_bits[symbol].append(bit)
        add = self._adds(effects, need, symbol_bits, count)
        reached.check_time()
        by_owner = np.lexsort((effects[:, 1], owner[effects[:, 0]])) if len(effects) else np.empty(0, np.int64)
        ordered = effects[by_owner]
        starts = np.searchsorted(owner[ordered[:, 0]], np.arange(operators + 1))
        masks = {
            symbol: (
                sum(1 << b for b in bits),
                sum(1 << formulas.complements[b] for b in bits if b in formulas.complements),
            )
            for symbol, bits in symbol_bits.items()
        }
        initial = sum(1 << bit for bit in self._initial_bits())

        def change(operator: int) -> tuple[int, tuple[Change, ...]]:
            precondition = sum(1 << bit for bit in need[operator])
            found: list[Change] = []
            for relaxed, _, symbol, bit in ordered[starts[operator] : starts[operator + 1]].tolist():
                when = 0 if relaxed == operator else sum(1 << b for b in need[relaxed]) & ~precondition
                bits, complements = masks[symbol]
                added = complements
                if bit >= 0:
                    bits &= ~(1 << bit)
                    added = 1 << bit
                    if complements:
                        added |= complements & ~(1 << formulas.complements.get(bit, bit))
                        bits |= complements & ~added
                else:
                    bits &= ~added
                if found and found[-1][0] == when:
                    _, cleared, set_ = found[-1]
                    found[-1] = (when, (cleared & ~added) | bits, (set_ & ~bits) | added)
                else:
                    found.append((when, bits, added))
            return precondition, tuple(found)

        bases = sorted((i for i in first if not schemas_[i].conditional), key=first.__getitem__)
        begins = np.array([first[i] for i in bases])

        def describe(operator: int) -> tuple[str, tuple[str, ...], dict[str, str]]:
            i = bases[int(np.searchsorted(begins, operator, "right")) - 1]
            schema = schemas_[i]
            words = [reached.individuals[n] for n in rows[i][operator - first[i]].tolist()]
            parameters = len(schema.behavior.parameters)
            declared = {variable.name for variable in schema.behavior.variables}
            more = zip(schema.terms[parameters:], words[parameters:], strict=True)
            return schema.behavior.name, tuple(words[:parameters]), {n[1:]: w for n, w in more if n in declared}

        costs = np.concatenate(
            [np.full(len(rows[i]), schemas_[i].behavior.cost) for i in bases] or [np.empty(0)]
        ).tolist()
        derived = tuple(
            (1 << bit, tuple(sum(1 << b for b in group) for group in groups))
            for groups, bit in formulas.derived.items()
        )
        # Derived bits in the relaxed task: an operator of no cost per alternative, owned by nobody.
        need, add, owner = _with_derived(need, add, owner, formulas.derived)
        task = Task(
            problem=reached.problem,
            level=reached.level,
            facts=self.facts,
            complements={complement: self.facts[bit] for bit, complement in formulas.complements.items()},
            size=formulas.size,
            initial=initial,
            goal=sum(1 << bit for bit in wanted),
            constants=self.constants,
            costs=costs,
            owners=owner.tolist(),
            needs=need,
            adds=add,
            derived=derived,
            change=change,
            describe=describe,
        )
        return task if not derived else _completed(task)

    def _initial_bits(self) -> Iterator[int]:
        true = set()
        for symbol, value in self.reached.initial.items():
            boolean = self.reached.situations[symbol.situation].boolean
            if boolean and value != TRUE:
                continue
            words = symbol.arguments if boolean else (*symbol.arguments, value)
            bit = self.formulas.bits[symbol.situation][words]
            if bit >= 0:
                true.add(bit)
        yield from true
        yield from (complement for bit, complement in self.formulas.complements.items() if bit not in true)

    def _effects(self, rows: Mapping[int, Ints], first: Mapping[int, int]) -> Ints:
        parts = []
        for i, begin in first.items():
            schema = self.reached.schemas[i]
            if not len(rows[i]):
                continue
            for position, effect in schema.effects:
                name, situation = effect.situation, self.reached.situations[effect.situation]
                table = self.reached.tables["situation", name]
                place = table.find(self.reached.effect_rows(schema, effect, rows[i]))
                at = np.flatnonzero(place >= 0)
                bit = (
                    np.full(len(at), -1)
                    if effect.value == FALSE and situation.boolean
                    else self.fact_bit[name][place[at]]
                )
                live = self.fact_bit[name][place[at]] >= 0
                at, bit, symbol = at[live], bit[live], self.symbol_of[name][place[at]][live]
                parts.append(np.stack([at + begin, np.full(len(at), position), symbol, bit], axis=1))
        return np.concatenate(parts) if parts else np.empty((0, 4), np.int64)

    def _adds(self, effects: Ints, need: Grouped, symbol_bits: Mapping[int, Sequence[int]], count: int) -> Grouped:
        """Return the bits that each relaxed operator may set: complements only of values that the symbol may have had."""
        positive = effects[:, 3] >= 0
        pairs = [(effects[positive, 0], effects[positive, 3])]
        complements = self.formulas.complements
        if complements:
            symbol_of = np.full(self.formulas.size, -1)
            for symbol, bits in symbol_bits.items():
                symbol_of[list(bits)] = symbol
            owner = np.repeat(np.arange(count), np.diff(need.starts))
            before = symbol_of[need.items]
            stride = self.symbols + 1
            known = dict(zip((owner * stride + before).tolist(), need.items.tolist(), strict=True))
            extra_row, extra_bit = [], []
            for number, (relaxed, _, symbol, bit) in enumerate(effects.tolist()):
                if not number % 1000:
                    self.reached.check_time()
                had = known.get(relaxed * stride + symbol)
                for value in symbol_bits[symbol] if had is None else (had,):
                    if value != bit and value in complements:
                        extra_row.append(relaxed)
                        extra_bit.append(complements[value])
            pairs.append((np.array(extra_row, np.int64), np.array(extra_bit, np.int64)))
        return _grouped(np.concatenate([p[0] for p in pairs]), np.concatenate([p[1] for p in pairs]), count)


def _completed(task: Task) -> Task:
    return replace(task, initial=task.completed(task.initial))


def _with_derived(
    need: Grouped, add: Grouped, owner: Ints, derived: Mapping[tuple[tuple[int, ...], ...], int]
) -> tuple[Grouped, Grouped, Ints]:
    cases = [(group, bit) for groups, bit in derived.items() for group in groups]
    if not cases:
        return need, add, owner
    more = np.array([bit for group, _ in cases for bit in group], np.int64)
    ends = need.starts[-1] + np.cumsum([len(group) for group, _ in cases])
    need = Grouped(np.concatenate([need.starts, ends]), np.concatenate([need.items, more]))
    ends = add.starts[-1] + np.arange(1, len(cases) + 1)
    add = Grouped(np.concatenate([add.starts, ends]), np.concatenate([add.items, np.array([bit for _, bit in cases])]))
    return need, add, np.concatenate([owner, np.full(len(cases), -1)])


def _grouped(owner: Ints, items: Ints, count: int) -> Grouped:
    """Return the items of each owner in ascending order, each once."""
    if len(owner):
        order = np.lexsort((items, owner))
        owner, items = owner[order], items[order]
        new = np.ones(len(owner), bool)
        new[1:] = (owner[1:] != owner[:-1]) | (items[1:] != items[:-1])
        owner, items = owner[new], items[new]
    return Grouped(np.searchsorted(owner, np.arange(count + 1)), items)


def _ranges(starts: Ints, counts: Ints) -> Ints:
    """Return start, start + 1, … for each start, as many as its count."""
    ends = np.cumsum(counts)
    total = int(ends[-1]) if len(ends) else 0
    result: Ints = np.arange(total) - np.repeat(ends - counts, counts) + np.repeat(starts, counts)
    return result

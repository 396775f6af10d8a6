"""Relaxed reachability: rounds of joins compute the facts of a level that can become true under delete relaxation."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import replace
from functools import cached_property
from time import perf_counter
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from confab.planner.grounded.amounts import AmountTable
from confab.planner.grounded.formulas import Formulas
from confab.planner.grounded.joins import Ints, JoinTable, pack
from confab.planner.grounded.merged_effects import merged
from confab.planner.grounded.schemas import Schema, TablePattern, rules_apart, schemas
from confab.planner.grounded.separation import in_parts
from confab.reasoner.language import mentions
from confab.reasoner.limits import OutOfTimeError, check
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    AnyOf,
    ClassCondition,
    Comparison,
    Condition,
    EqualityCondition,
    RelationCondition,
    SituationType,
    State,
    Symbol,
    ValueCondition,
    ValueEffect,
    Witness,
)

Flags: TypeAlias = NDArray[np.bool_]


class Reached:
    """The tables of a level with all facts that are reachable under delete relaxation.

    Attributes
    ----------
    tables : mapping of (kind, name) to JoinTable
        The kind is situation, relation or class. A row of a situation type contains the arguments and the value. A row of a boolean
        situation type contains only the arguments, because the table lists only true facts.
    rows : list of Ints
        The matching rows of each schema, with a column of individuals for each term of the schema.
    changed : set of situation types
        Situation types that behaviours change or rules define.
    together : set of relations
        Auxiliary relations for merged effects of the same shape.
    made : set of situation types
        Auxiliary situation types that represent a part of a rule.
    """

    def __init__(
        self, problem: Problem, level: int, initial: State, most: int, deadline: float | None, apart: bool = False
    ) -> None:
        given, problem = problem, merged(problem, level)
        self.together = problem.relations.keys() - given.relations.keys()
        self.problem, self.level, self.most, self.deadline = problem, level, most, deadline
        known = (s for s in problem.domain.situations.values() if s.level <= level and s.quantity is None)
        self.situations = {s.name: s for s in known}
        self.amounts = AmountTable(problem, level, initial)
        self.initial = {symbol: value for symbol, value in initial.items() if symbol.situation in self.situations}
        behaviors = problem.domain.at_level(level)
        changed = frozenset[str]().union(*(behavior.changes for behavior in behaviors))
        situations, members = dict(problem.domain.situations), problem.members
        self.defined = self.situations.keys() & problem.domain.rules.keys()
        self.made = frozenset[str]()
        rules = [rule.behavior for name in sorted(self.defined) for rule in problem.domain.rules[name]]
        if rules:
            changed |= self.defined
            rules, made = rules_apart(rules, changed)
            self.situations |= made
            situations |= made
            self.made = frozenset(made)
            self.defined |= made.keys()
            changed |= made.keys()
        self.changed = changed
        self.schemas, parts = [], list[Schema]()
        for behavior in behaviors:
            base, *conditional = schemas(behavior, situations, changed, members)
            if apart and not conditional:
                (base, *more), made = in_parts(base, members)
                parts += more
                self.situations |= made
                self.made |= made.keys()
                self.defined |= made.keys()
            self.schemas += [base, *conditional]
        self.schemas += parts
        self.schemas += [replace(s, rule=True) for rule in rules for s in schemas(rule, situations, changed, members)]
        self.individuals = tuple(dict.fromkeys(self._individuals()))
        self.number = {name: i for i, name in enumerate(self.individuals)}
        self.radix = max(len(self.individuals), 1)
        self.tables: dict[tuple[str, str], JoinTable] = defaultdict(lambda: JoinTable(1, self.radix))
        self.symbols: dict[str, JoinTable] = {}
        self._fill()
        self.rows: list[Ints] = [np.empty((0, len(schema.terms)), np.int64) for schema in self.schemas]

    def _individuals(self) -> Iterator[str]:
        for members in self.problem.classes.values():
            yield from members
        yield from (TRUE, FALSE)
        for symbol, value in self.initial.items():
            yield from (*symbol.arguments, value)
        for tuples in self.problem.relations.values():
            self.check_time()
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
                self.symbols[name] = JoinTable(arity - 1, self.radix)
                self.symbols[name].add(self.tables["situation", name].rows[:, :-1])

    def _put(self, key: tuple[str, str], arity: int, rows: Sequence[tuple[str, ...]]) -> None:
        self.check_time()
        number = self.number
        table = self.tables[key] = JoinTable(arity, self.radix)
        flat = [number[name] for row in rows for name in row]
        table.add(np.array(flat, np.int64).reshape(len(rows), arity))

    def close(self) -> None:
        """Join every schema with the rows that the last round added, until a round adds no row."""
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
        """Yield the rows of a schema that use at least one fact of the last round; each combination of facts occurs once."""
        fluent = [i for i, atom in enumerate(schema.atoms) if atom.fluent]
        if not fluent and first:
            yield from self.joined(schema, None, {})
        for position, start in enumerate(fluent):
            key = schema.atoms[start].table
            if before[key] == size[key]:
                continue
            ranges = {start: (before[key], size[key])}
            ranges |= {i: (0, before[schema.atoms[i].table]) for i in fluent[:position]}
            if all(low < high for low, high in ranges.values()):
                yield from self.joined(schema, start, ranges)

    def joined(
        self, schema: Schema, start: int | None = None, ranges: Mapping[int, tuple[int, int]] | None = None
    ) -> Iterator[Ints]:
        """Yield at most one array: the rows of a schema's terms that match all atoms.

        `ranges` restricts atoms to ranges of table rows.
        """
        columns: dict[str, Ints] = {}
        count, waiting, filters = 1, list(range(len(schema.atoms))), list(schema.filters)
        while waiting:
            self.check_time()
            i = start if start in waiting else self._narrowest(schema, waiting, columns)
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
            wanted = {*schema.terms, *(t for j in waiting for t in schema.atoms[j].terms)}.union(
                *(self._variables(f, schema) for f in filters)
            )
            columns, count = self._projected(columns, count, wanted)
        self.check_time()
        for condition in filters:  # the remaining filters have only local variables, or the schema has no atoms
            keep = self._decide(condition, columns, count, schema.kinds)
            columns, count = {name: column[keep] for name, column in columns.items()}, int(keep.sum())
        if count:
            yield np.stack([columns[t] for t in schema.terms], axis=1) if schema.terms else np.zeros((1, 0), np.int64)

    def _projected(self, columns: dict[str, Ints], count: int, wanted: Set[str]) -> tuple[dict[str, Ints], int]:
        """Return the distinct rows of the columns for the variables in `wanted`, and the number of rows."""
        left = {name: column for name, column in columns.items() if name in wanted}
        if len(left) == len(columns):
            return columns, count
        if not left:
            return {}, 1
        _, first = np.unique(pack(np.stack([*left.values()], axis=1), self.radix), return_index=True)
        return {name: column[first] for name, column in left.items()}, len(first)

    def check_time(self) -> None:
        """Raise `OutOfTimeError` when the deadline has passed."""
        if self.deadline is not None and perf_counter() > self.deadline:
            raise OutOfTimeError("the time limit")
        check("grounding")

    def _narrowest(self, schema: Schema, waiting: Sequence[int], columns: Mapping[str, Ints]) -> int:
        """Return the position of the first atom that matches the fewest rows; atoms without unbound variables are preferred."""
        best, least = -1, float("inf")
        for i in waiting:
            rows = self._fan_out(schema.atoms[i], columns)
            if rows < least:
                best, least = i, rows
                if not rows:
                    break
        return best

    def _fan_out(self, atom: TablePattern, columns: Mapping[str, Ints]) -> float:
        """Estimate how many rows of the atom's table match one row of `columns`."""
        free = len({t for t in atom.terms if t.startswith("?")} - columns.keys())
        return float(max(len(self.tables[atom.table]), 1) ** (free / max(len(atom.terms), 1)) - (not free))

    def _step(
        self, atom: TablePattern, columns: dict[str, Ints], count: int, limits: tuple[int, int] | None
    ) -> tuple[dict[str, Ints], int]:
        """Join `columns` with an atom; return the joined columns and the number of their rows."""
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
        """Return an array that contains, for each row, whether a static condition holds."""
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
            case ValueCondition() | Witness() | AnyOf() | Comparison():
                pass
        used = sorted(mentions(condition) & columns.keys())
        combinations, inverse = self.combinations(columns, used, count)
        holds = [self.formulas.condition(condition, dict(zip(used, c, strict=True)), kinds) == () for c in combinations]
        return np.array(holds, bool)[inverse]

    def combinations(
        self, columns: Mapping[str, Ints], used: Sequence[str], count: int
    ) -> tuple[list[tuple[str, ...]], Ints]:
        """Return the distinct combinations of individuals in some columns, and the index of each row's combination."""
        if not used:
            return [()], np.zeros(count, np.int64)
        matrix = np.stack([columns[name] for name in used], axis=1)
        _, first, inverse = np.unique(pack(matrix, self.radix), return_index=True, return_inverse=True)
        return [tuple(self.individuals[i] for i in row) for row in matrix[first].tolist()], inverse.ravel()

    @cached_property
    def formulas(self) -> Formulas:
        """The evaluation of static conditions."""
        return Formulas(self)

    def effect_rows(self, schema: Schema, effect: ValueEffect, rows: Ints) -> Ints:
        """Return the table row that an effect makes true, for each row of a schema."""
        boolean = self.situations[effect.situation].boolean
        terms = effect.arguments if boolean else (*effect.arguments, effect.value)
        place = {name: column for column, name in enumerate(schema.terms)}
        columns = [rows[:, place[t]] if t in place else np.full(len(rows), self.number[t]) for t in terms]
        return np.stack(columns, axis=1) if columns else np.zeros((len(rows), 0), np.int64)

    def _exists(self, name: str, rows: Ints) -> Flags:
        """Return an array that contains, for each row of a situation type, whether the symbol of the row exists."""
        situation = self.situations[name]
        if not situation.boolean:
            return self.symbols[name].find(rows[:, :-1]) >= 0
        exists = np.ones(len(rows), bool)
        for column, kind in enumerate(situation.arguments):
            exists &= self.tables["class", kind].find(rows[:, [column]]) >= 0
        return exists

    def possible(self, symbol: Symbol, value: str) -> bool:
        """Return whether a fact is reachable under delete relaxation."""
        situation = self.situations.get(symbol.situation)
        if situation is None:
            return symbol in self.amounts.now
        if situation.boolean and value == FALSE:
            return True
        return self.find(situation, symbol.arguments, value) >= 0

    def find(self, situation: SituationType, arguments: Sequence[str], value: str) -> int:
        """Return the row of a fact in the table of its situation type, or -1 if the fact is unreachable."""
        words = arguments if situation.boolean else (*arguments, value)
        numbers = [self.number.get(word, -1) for word in words]
        table = self.tables["situation", situation.name]
        if -1 in numbers or len(numbers) != table.arity:
            return -1
        return int(table.find(np.array([numbers], np.int64).reshape(1, -1))[0])

"""Grounding of one level of a problem to a `Task`, by joins in rounds of relaxed reachability.

The first stage finds the facts that can become true under delete relaxation (`confab.planner.grounded.reachability`). If a goal is
unreachable, there is no plan. The second stage creates bits for the facts that can change, and operators from the joined rows.

The joins ignore conditions that depend on the state and aren't atoms. Therefore reachability is overestimated. In the second
stage, each ignored condition becomes a conjunction of bits for each combination of individuals
(`confab.planner.grounded.formulas`).

The method is semi-naive evaluation, known from databases (Helmert, "Concise finite-domain representations for PDDL planning
tasks", Artificial Intelligence 173, 2009, section 6). This implementation joins arrays instead of single tuples.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from confab.planner.grounded.amounts import Amounts, Linear, Move
from confab.planner.grounded.derived import Derived
from confab.planner.grounded.fact_bits import FactBits
from confab.planner.grounded.formulas import Formulas, Literals
from confab.planner.grounded.joins import Ints, JoinTable, ranges
from confab.planner.grounded.meanings import Meanings, expanded
from confab.planner.grounded.reachability import Reached
from confab.planner.grounded.relaxed_changes import RelaxedChanges, only, with_derived
from confab.planner.grounded.schemas import Schema
from confab.planner.grounded.shortage import shortage
from confab.planner.grounded.task import BitChange, Task, grouped
from confab.planner.plan import Reason
from confab.reasoner.amounts import written
from confab.reasoner.language import mentions
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import Fact, State

MOST_ROWS = 20_000_000
"""Maximum number of rows of one join (about 1 GB)."""


def ground(
    problem: Problem,
    level: int | None = None,
    initial: State | None = None,
    goal: State | None = None,
    most: int = MOST_ROWS,
    deadline: float | None = None,
    apart: bool = False,
) -> Task | Reason:
    """Ground one level of a problem.

    Parameters
    ----------
    problem : Problem
    level : int, optional
        The level to ground, by default the lowest level.
    initial, goal : State, optional
        The initial state and the goal; by default, those of the problem.
    most : int
        Maximum number of rows of one join.
    deadline : float, optional
        The deadline on the clock of `time.perf_counter`.
    apart : bool
        Whether only arguments and effects identify an operator; then the condition "some crane is free" doesn't lead to one
        operator for each crane.

    Returns
    -------
    Task or Reason
        The task, or the reason why no behaviours of the level lead from `initial` to `goal`.

    Raises
    ------
    UngroundableError
        A join would exceed `most` rows, or a changing amount is a divisor or is multiplied by another changing amount.
    OutOfTimeError
        The deadline has passed.
    DomainError
        A behaviour names a variable that no condition determines.
    """
    level = problem.domain.levels[-1] if level is None else level
    reached = Reached(problem, level, problem.initial if initial is None else initial, most, deadline, apart)
    reached.close()
    wanted = problem.goal if goal is None else goal
    for symbol, value in sorted(wanted.items()):
        if not reached.possible(symbol, value):
            return Reason(f"{Fact(symbol, value)} can't be reached")
    task = _TaskBuilder(reached).task(wanted)
    return task if isinstance(task, Reason) else shortage(task) or task


class _TaskBuilder:
    """Assembly of the operators and bits of a task from the reachable facts."""

    def __init__(self, reached: Reached) -> None:
        self.reached = reached
        self.formulas = Formulas(reached)
        self.bits = FactBits(reached, self.formulas)
        self.meanings = Meanings(reached, self.formulas, self.bits)
        self.changes = RelaxedChanges(reached, self.formulas, self.bits)

    def task(self, goal: State) -> Task | Reason:
        base = [i for i, schema in enumerate(self.reached.schemas) if not schema.conditional and not schema.rule]
        rows, needs = {}, {}
        for i, schema in enumerate(self.reached.schemas):
            rows[i], needs[i] = self._needs(schema, self.reached.rows[i])
        wanted = self._goal(goal)
        derived, cases, means = self.meanings.of_bits(rows, needs)
        if means is not None and wanted is not None:
            needs = {i: expanded(*pairs, means) for i, pairs in needs.items()}
            wanted = tuple(sorted({one for bit in wanted for one in means[bit]}))
        if wanted is None:
            return self._excluded(goal)
        # Number the operators, then their conditional effects. Drop conditional effects of dropped operators.
        owners, first, count = {}, {}, 0
        for i in base:
            first[i] = count
            owners[i] = np.arange(count, count + len(rows[i]))
            count += len(rows[i])
        operators = count
        for i, schema in enumerate(self.reached.schemas):
            if schema.conditional:
                parent = max(b for b in base if b < i)
                table = JoinTable(len(self.reached.schemas[parent].terms), self.reached.radix)
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
        return self._build(rows, needs, owners, first, operators, count, wanted, derived, cases)

    def _needs(self, schema: Schema, rows: Ints) -> tuple[Ints, tuple[Ints, Ints]]:
        """Return the rows of a schema with satisfiable conditions, and pairs of a row and a bit that the row requires."""
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
            pairs.append((row, flat[ranges(starts, counts)]))
        for atom in schema.atoms:
            if atom.fluent and len(rows):
                name = atom.table[1]
                values = [
                    columns[t] if t in columns else np.full(len(rows), self.reached.number[t]) for t in atom.terms
                ]
                table = self.reached.tables[atom.table]
                matrix = np.stack(values, axis=1) if values else np.zeros((len(rows), 0), np.int64)
                bits = self.bits.fact_bit[name][table.find(matrix)]
                row = np.flatnonzero(bits >= 0)
                pairs.append((row, bits[row]))
        new = np.cumsum(keep) - 1
        row, bit = (np.concatenate([p[k] for p in pairs] or [np.empty(0, np.int64)]) for k in (0, 1))
        held = keep[row]
        return rows[keep], (new[row[held]], bit[held])

    def _goal(self, goal: State) -> Literals:
        return self.formulas.all_of(self.formulas.wanted(symbol, value) for symbol, value in goal.items())

    def _excluded(self, goal: State) -> Reason:
        """Return the reason why no state satisfies the goal: a single goal is impossible, or the goals exclude one another."""
        for symbol, value in sorted(goal.items()):
            if self.formulas.wanted(symbol, value) is None:
                quantity = self.reached.problem.domain.situations[symbol.situation].quantity
                limits = (("at least", quantity.least), ("at most", quantity.most)) if quantity else ()
                stays = ", ".join(f"{word} {written(limit)}" for word, limit in limits if limit is not None)
                text = f"{Fact(symbol, value)} can't be" + (f": it is {stays}" if stays else "")
                return Reason(text, (symbol.situation, *symbol.arguments))
        return Reason("the goals exclude one another, or a fact that has to end can't end")

    def _build(
        self,
        rows: Mapping[int, Ints],
        needs: Mapping[int, tuple[Ints, Ints]],
        owners: Mapping[int, Ints],
        first: Mapping[int, int],
        operators: int,
        count: int,
        wanted: tuple[int, ...],
        derived: Derived,
        cases: Sequence[tuple[tuple[int, ...], int]],
    ) -> Task:
        schemas_, reached, formulas = self.reached.schemas, self.reached, self.formulas
        owner = np.concatenate([owners[i] for i in sorted(first, key=first.__getitem__)] or [np.empty(0, np.int64)])
        own_row = np.concatenate([needs[i][0] + first[i] for i in first] or [np.empty(0, np.int64)])
        own_bit = np.concatenate([needs[i][1] for i in first] or [np.empty(0, np.int64)])
        # A conditional effect also requires the preconditions of its operator.
        of_operator = grouped(own_row[own_row < operators], own_bit[own_row < operators], operators)
        extra = np.arange(operators, count)
        lengths = np.diff(of_operator.starts)[owner[extra]]
        inherited = of_operator.items[ranges(of_operator.starts[owner[extra]], lengths)]
        need = grouped(
            np.concatenate([own_row, np.repeat(extra, lengths)]), np.concatenate([own_bit, inherited]), count
        )
        # Effects: relaxed operator, position, symbol, bit (-1: false).
        reached.check_time()
        effects = self.changes.effects(rows, first)
        symbol_bits: dict[int, list[int]] = defaultdict(list)
        for name, symbols in self.bits.symbol_of.items():
            for symbol, bit in zip(symbols.tolist(), self.bits.fact_bit[name].tolist(), strict=True):
                if bit >= 0:
                    symbol_bits[symbol].append(bit)
        moves = self.changes.moves(rows, first)
        add, left = self.changes.adds(effects, need, symbol_bits, count, self.changes.pushed(moves, owner))
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
        initial = sum(1 << bit for bit in self.bits.initial())
        table = reached.amounts
        rows_of = defaultdict[int, list[int]](list)
        for relaxed in moves:
            rows_of[int(owner[relaxed])].append(relaxed)

        def moved(operator: int) -> tuple[Move, ...]:
            precondition, found = set(need[operator]), list[Move]()
            for relaxed in rows_of.get(operator, ()):
                when = 0 if relaxed == operator else sum(1 << b for b in need[relaxed] if b not in precondition)
                found += [replace(move, when=when) if when else move for move in moves[relaxed]]
            return tuple(sorted(found, key=lambda move: move.position))

        amounts = (
            Amounts(
                tuple(table.place),
                table.first,
                table.quantities,
                table.bits,
                formulas.size,
                moved,
            )
            if table.place
            else None
        )
        if amounts is not None:
            initial = amounts.begun(initial)

        def change(operator: int) -> tuple[int, tuple[BitChange, ...]]:
            precondition = sum(1 << bit for bit in need[operator])
            found: list[BitChange] = []
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

        costs, prices = self._costs(bases, rows, first)
        # In the relaxed task, a conditional effect that sets no bit is useless. An alternative of a derived bit is an operator
        # of cost 0 without an owner.
        telling = (np.arange(count) < operators) | (np.diff(add.starts) > 0)
        relaxed_needs, relaxed_adds, owner = with_derived(
            only(need, telling), only(add, telling), owner[telling], [*cases, *left]
        )
        return Task(
            problem=reached.problem,
            level=reached.level,
            facts=self.bits.facts,
            complements={
                c: self.bits.facts[bit] for bit, c in formulas.complements.items() if bit < len(self.bits.facts)
            },
            size=formulas.size,
            initial=derived.completed(initial),
            goal=sum(1 << bit for bit in wanted),
            constants=self.bits.constants,
            costs=costs,
            owners=owner.tolist(),
            needs=relaxed_needs,
            adds=relaxed_adds,
            derived=derived,
            change=change,
            describe=describe,
            amounts=amounts,
            prices=prices,
        )

    def _costs(
        self, bases: Sequence[int], rows: Mapping[int, Ints], first: Mapping[int, int]
    ) -> tuple[list[float], dict[int, Linear]]:
        """Return the least cost of each operator, and the cost expressions of operators whose cost depends on amounts."""
        costs: list[float] = []
        prices: dict[int, Linear] = {}
        for i in bases:
            schema = self.reached.schemas[i]
            price = schema.behavior.price
            if price is None:
                costs += [schema.behavior.cost] * len(rows[i])
                continue
            self.reached.check_time()
            for operator, row in enumerate(rows[i].tolist(), first[i]):
                terms = dict(zip(schema.terms, (self.reached.individuals[n] for n in row), strict=True))
                found = self.reached.amounts.linear(price, terms)
                assert found is not None  # the preconditions require a value
                if found.terms:
                    prices[operator] = found
                costs.append(max(float(found.bounds(self.reached.amounts.ranges)[0]), 0.0))
        return costs, prices

"""Grounding: one level of a problem becomes a `Task`, by joins in rounds of relaxed reachability.

reach      facts that can become true under delete relaxation (`confab.planner.grounded.reachability`)
assemble   bits for the facts that can change, operators for the joined rows
goal       an unreachable goal proves that there is no plan

Conditions that depend on the state are left out of the joins, so reachability is overestimated; they become conjunctions of
literals, once per combination of individuals, when operators are assembled
(`confab.planner.grounded.reachability`).

Semi-naive grounding as in databases: Helmert, "Concise finite-domain representations for PDDL planning tasks",
Artificial Intelligence 173 (2009), section 6. Here arrays are joined instead of tuples, and each symbol has one value from the
start.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import replace
from fractions import Fraction

import numpy as np

from confab.planner.grounded.amounts import Amounts, Linear, Move, pushes, settled
from confab.planner.grounded.derived import Derived, in_parts
from confab.planner.grounded.derived_arrays import Bit
from confab.planner.grounded.formulas import Formulas, Literals
from confab.planner.grounded.joins import Ints, JoinTable, ranges
from confab.planner.grounded.reachability import Flags, Reached
from confab.planner.grounded.schemas import Schema
from confab.planner.grounded.shortage import shortage
from confab.planner.grounded.task import BitChange, Grouped, Task
from confab.planner.plan import Reason
from confab.reasoner.amounts import COMPARING, written
from confab.reasoner.derivation import circular
from confab.reasoner.language import mentions
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    Fact,
    Problem,
    Rule,
    State,
    Symbol,
)

MOST_ROWS = 20_000_000
"""Maximum size of one join: about 1 GB."""
SAID_ONCE = 20_000
"""Minimum number of conditions saved, over all operators, before a shared condition is evaluated once per state: evaluating that
number of conditions for one relaxed plan takes a millisecond."""


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
        The lowest level if not given.
    initial, goal : State, optional
        In place of the problem's own.
    most : int
        Maximum number of rows of one join.
    deadline : float, optional
        On the clock of `time.perf_counter`.
    apart : bool
        Whether operators may be identified by arguments and effects alone: "some crane is free", whichever crane it is.

    Returns
    -------
    Task or Reason
        A reason proves that no behaviours of this level lead from `initial` to `goal`, and states the cause.

    Raises
    ------
    UngroundableError
        A join would exceed `most` rows, or an amount that changes is a divisor or is multiplied by another.
    OutOfTimeError
        The deadline has passed.
    DomainError
        A behaviour names a variable that nothing determines.
    """
    level = problem.domain.levels[-1] if level is None else level
    reached = Reached(problem, level, problem.initial if initial is None else initial, most, deadline, apart)
    reached.close()
    wanted = problem.goal if goal is None else goal
    for symbol, value in sorted(wanted.items()):
        if not reached.possible(symbol, value):
            return Reason(f"{Fact(symbol, value)} can't be reached")
    task = _Assembly(reached).task(wanted)
    return task if isinstance(task, Reason) else shortage(task) or task


class _Assembly:
    """Operators and bits, made from the reachable facts."""

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
        base = [i for i, schema in enumerate(self.reached.schemas) if not schema.conditional and not schema.rule]
        rows, needs = {}, {}
        for i, schema in enumerate(self.reached.schemas):
            rows[i], needs[i] = self._needs(schema, self.reached.rows[i])
        wanted = self._goal(goal)
        derived, cases, means = self._derived(rows, needs)
        if means is not None and wanted is not None:
            needs = {i: _expanded(*pairs, means) for i, pairs in needs.items()}
            wanted = tuple(sorted({one for bit in wanted for one in means[bit]}))
        if wanted is None:
            return self._excluded(goal)
        # Number the operators, then their conditional effects; a conditional effect whose operator was dropped is dropped, too.
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

    def _number_facts(self) -> None:
        """Give a bit to every reachable fact whose symbol can change."""
        reached, names = self.reached, self.reached.individuals
        for name, situation in reached.situations.items():
            reached.check_time()
            if name in reached.defined:
                continue
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
        amounts = reached.amounts
        self.constants |= {symbol: amounts.text(symbol) for symbol in amounts.now if symbol not in amounts.place}
        size = len(self.facts)
        for name in sorted(reached.defined):  # after all stated facts
            table = reached.tables["situation", name]
            self.fact_bit[name] = np.arange(size, size + len(table))
            rows = (tuple(names[i] for i in row) for row in table.rows.tolist())
            self.formulas.bits[name] = dict(zip(rows, range(size, size + len(table)), strict=True))
            size += len(table)
        self.formulas.size = size

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
        """Return the rows of a schema that can ever hold, and pairs of a row and a bit that it requires."""
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
                bits = self.fact_bit[name][table.find(matrix)]
                row = np.flatnonzero(bits >= 0)
                pairs.append((row, bits[row]))
        new = np.cumsum(keep) - 1
        row, bit = (np.concatenate([p[k] for p in pairs] or [np.empty(0, np.int64)]) for k in (0, 1))
        held = keep[row]
        return rows[keep], (new[row[held]], bit[held])

    def _derived(
        self, rows: Mapping[int, Ints], needs: Mapping[int, tuple[Ints, Ints]]
    ) -> tuple[Derived, list[tuple[tuple[int, ...], int]], Grouped | None]:
        """Return the derived bits, the alternatives of each for the relaxed task, and the meaning of each bit.

        A bit with one alternative is replaced by the bits of that alternative, unless the alternative is long and many operators
        require it ("no object stands in that place").
        """
        formulas = self.formulas
        ways: dict[int, dict[tuple[int, ...], None]] = {}  # alternatives of each bit of a defined situation type
        for name in self.reached.defined:
            ways |= {int(bit): {} for bit in self.fact_bit[name]}
        for i, schema in enumerate(self.reached.schemas):
            if schema.rule:
                effect = schema.effects[0][1]
                table = self.reached.tables["situation", effect.situation]
                places = table.find(self.reached.effect_rows(schema, effect, rows[i]))
                lists = _grouped(*needs[i], len(rows[i])).lists()
                for place, found in zip(places.tolist(), lists, strict=True):
                    if place >= 0:
                        ways[int(self.fact_bit[effect.situation][place])][tuple(found)] = None
        if not ways and not formulas.derived:
            return Derived(), [], None
        circular = self._circular()
        self._opposites(ways, circular)
        for groups, bit in formulas.derived.items():
            ways[bit] = dict.fromkeys(groups)
        means: dict[int, tuple[int, ...]] = {}
        none = np.empty(0, np.int64)
        asked = np.bincount(np.concatenate([none, *(bit for _, bit in needs.values())]), minlength=formulas.size)
        only = {bit: len(next(iter(its))) for bit, its in ways.items() if len(its) == 1}
        saved = {bit: int(size * asked[bit] - size - asked[bit]) for bit, size in only.items()}
        if sum(less for less in saved.values() if less > 0) > SAID_ONCE:
            means |= {bit: (bit,) for bit, less in saved.items() if less > 0}
        for bit in ways:
            _meaning(bit, ways, circular, means)
        kept = {
            bit: dict.fromkeys(
                tuple(sorted({one for other in way for one in means.get(other, (other,))})) for way in its
            )
            for bit, its in ways.items()
            if means[bit] == (bit,)
        }
        bits = {bit: Bit(1 << bit, tuple(_mask(found) for found in its)) for bit, its in kept.items()}
        cases = [(found, bit) for bit, its in kept.items() for found in its]
        for bit, opposite in formulas.complements.items():
            if bit in kept and opposite not in ways:
                bits[opposite] = Bit(1 << opposite, (1 << bit,), opposite=True)
                cases.append(((), opposite))
        all_of = [means.get(bit, (bit,)) for bit in range(formulas.size)]
        starts = np.concatenate([[0], np.cumsum([len(found) for found in all_of])]).astype(np.int64)
        return in_parts(bits), cases, Grouped(starts, np.array([one for found in all_of for one in found], np.int64))

    def _opposites(self, ways: dict[int, dict[tuple[int, ...], None]], circular: set[int]) -> None:
        """Add the conditions under which a defined fact doesn't hold, where required and unless the definition is recursive."""
        formulas = self.formulas
        waiting = [bit for bit in formulas.complements if bit in ways]
        for bit in waiting:  # the list grows
            self.reached.check_time()
            if bit in circular:
                continue
            known = len(formulas.complements)
            found = formulas.all_of(formulas.any_of(formulas.opposite(one) for one in way) for way in ways[bit])
            ways[formulas.complements[bit]] = {} if found is None else {found: None}
            waiting += [other for other in list(formulas.complements)[known:] if other in ways]

    def _circular(self) -> set[int]:
        """Return the bits of recursively defined situation types, and of those that depend on them."""
        rules: dict[str, list[Rule]] = {name: [] for name in self.reached.defined}
        for schema in self.reached.schemas:
            if schema.rule:
                behavior = schema.behavior
                rules[behavior.effects[0].situation].append(Rule(behavior.name, (), (), behavior.preconditions))
        return {bit for name in circular(rules) for bit in self.fact_bit[name].tolist()}

    def _goal(self, goal: State) -> Literals:
        return self.formulas.all_of(self.formulas.wanted(symbol, value) for symbol, value in goal.items())

    def _excluded(self, goal: State) -> Reason:
        """Return the reason that a goal holds in no state; if each goal alone is satisfiable, the goals exclude one another."""
        for symbol, value in sorted(goal.items()):
            if self.formulas.wanted(symbol, value) is None:
                quantity = self.reached.problem.domain.situations[symbol.situation].quantity
                limits = (("at least", quantity.least), ("at most", quantity.most)) if quantity else ()
                stays = ", ".join(f"{word} {written(limit)}" for word, limit in limits if limit is not None)
                text = f"{Fact(symbol, value)} can't be" + (f": it is {stays}" if stays else "")
                return Reason(text, (symbol.situation, *symbol.arguments))
        return Reason("the goals exclude one another, or what is wanted to end can't")

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
        of_operator = _grouped(own_row[own_row < operators], own_bit[own_row < operators], operators)
        extra = np.arange(operators, count)
        lengths = np.diff(of_operator.starts)[owner[extra]]
        inherited = of_operator.items[ranges(of_operator.starts[owner[extra]], lengths)]
        need = _grouped(
            np.concatenate([own_row, np.repeat(extra, lengths)]), np.concatenate([own_bit, inherited]), count
        )
        # Effects: relaxed operator, position, symbol, bit (-1: false).
        reached.check_time()
        effects = self._effects(rows, first)
        symbol_bits: dict[int, list[int]] = defaultdict(list)
        for name, symbols in self.symbol_of.items():
            for symbol, bit in zip(symbols.tolist(), self.fact_bit[name].tolist(), strict=True):
                if bit >= 0:
                    symbol_bits[symbol].append(bit)
        moves = self._moves(rows, first)
        add, left = self._adds(effects, need, symbol_bits, count, self._pushed(moves, owner))
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
        table = reached.amounts
        rows_of = defaultdict[int, list[int]](list)
        for relaxed in moves:
            rows_of[int(owner[relaxed])].append(relaxed)

        def moved(operator: int) -> tuple[Move, ...]:
            precondition, found = set(need[operator]), list[Move]()
            for relaxed in rows_of.get(operator, ()):
                when = 0 if relaxed == operator else sum(1 << b for b in need[relaxed] if b not in precondition)
                found += [replace(move, when=when) for move in moves[relaxed]]
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
        # In the relaxed task a conditional effect that sets no bit is useless. An alternative of a derived bit is an
        # operator of cost 0 there, without an owner.
        telling = (np.arange(count) < operators) | (np.diff(add.starts) > 0)
        relaxed_needs, relaxed_adds, owner = _with_derived(
            _only(need, telling), _only(add, telling), owner[telling], [*cases, *left]
        )
        return Task(
            problem=reached.problem,
            level=reached.level,
            facts=self.facts,
            complements={c: self.facts[bit] for bit, c in formulas.complements.items() if bit < len(self.facts)},
            size=formulas.size,
            initial=derived.completed(initial),
            goal=sum(1 << bit for bit in wanted),
            constants=self.constants,
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
        """Return the least cost of each operator, and the operators whose cost depends on amounts."""
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
                costs.append(max(float(found.bounds(self.reached.amounts.quantities)[0]), 0.0))
        return costs, prices

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

    def _moves(self, rows: Mapping[int, Ints], first: Mapping[int, int]) -> dict[int, list[Move]]:
        """Return the changes of amounts by each relaxed operator that has any."""
        names, table = self.reached.individuals, self.reached.amounts
        found = defaultdict[int, list[Move]](list)
        for i, begin in first.items():
            schema = self.reached.schemas[i]
            for number, row in enumerate(rows[i].tolist() if schema.amounts else ()):
                terms = dict(zip(schema.terms, (names[n] for n in row), strict=True))
                for position, effect in schema.amounts:
                    symbol = Symbol(effect.situation, tuple(terms.get(a, a) for a in effect.arguments))
                    if symbol in table.place:
                        by = table.linear(effect.amount, terms)
                        found[begin + number].append(Move(position, 0, table.place[symbol], effect.operation, by))
        return found

    def _pushed(self, moves: Mapping[int, Sequence[Move]], owner: Ints) -> tuple[Ints, Ints]:
        """Return pairs of a relaxed operator and the bit of a comparison that it may make true."""
        by_place = defaultdict[int, list[tuple[Linear, str]]](list)
        for difference, sign in self.reached.amounts.bits:
            for place, _ in difference.terms:
                by_place[place].append((difference, sign))
        often = Counter((owner[relaxed], move.place) for relaxed, found in moves.items() for move in found)

        def may(relaxed: int, found: Sequence[Move], difference: Linear, sign: str) -> bool:
            alone = [move for move in found if often[owner[relaxed], move.place] == 1]
            amount, push = settled(alone, difference), pushes(found, difference)
            if amount is not None:
                return COMPARING[sign](Fraction(amount), Fraction(0))
            return push is None or push > 0 or (push != 0 and sign == "=")

        pairs = [
            (relaxed, self.reached.amounts.bits[key])
            for relaxed, found in moves.items()
            for key in dict.fromkeys(key for move in found for key in by_place.get(move.place, ()))
            if may(relaxed, found, *key)
        ]
        both = np.array(pairs, np.int64).reshape(-1, 2)
        return both[:, 0], both[:, 1]

    def _adds(
        self,
        effects: Ints,
        need: Grouped,
        symbol_bits: Mapping[int, Sequence[int]],
        count: int,
        pushed: tuple[Ints, Ints],
    ) -> tuple[Grouped, list[tuple[tuple[int, ...], int]]]:
        """Return the bits that each relaxed operator may set: complements only of values that the symbol may have had.

        Where these are many, operators set one auxiliary bit "changed" of the relaxed task; the bits implied by it are returned,
        too.
        """
        changed: dict[int, int] = {}
        opposites: dict[int, dict[int, int]] = {}
        positive = effects[:, 3] >= 0
        pairs = [(effects[positive, 0], effects[positive, 3]), pushed]
        complements = self.formulas.complements
        if complements:
            symbol_of = np.full(self.formulas.size, -1)
            for symbol, bits in symbol_bits.items():
                symbol_of[list(bits)] = symbol
            owner = np.repeat(np.arange(count), np.diff(need.starts))
            before = symbol_of[need.items]
            stride = self.symbols + 1
            known = dict(zip((owner * stride + before).tolist(), need.items.tolist(), strict=True))
            opposites = {
                symbol: {bit: complements[bit] for bit in bits if bit in complements}
                for symbol, bits in symbol_bits.items()
            }
            lost: list[tuple[int, int, list[int]]] = []
            for number, (relaxed, _, symbol, bit) in enumerate(effects.tolist()):
                if not number % 1000:
                    self.reached.check_time()
                had, of = known.get(relaxed * stride + symbol), opposites[symbol]
                lost.append((relaxed, symbol, [o for value, o in of.items() if value != bit and had in (None, value)]))
            more = sum(len(bits) for _, _, bits in lost) - len(lost)
            if more > SAID_ONCE and not self.reached.amounts.place:  # consumption is counted per bit
                several = dict.fromkeys(symbol for _, symbol, bits in lost if len(bits) > 1)
                changed = {symbol: self.formulas.fresh() for symbol in several}
            lost = [(r, s, [changed[s]] if s in changed and len(bits) > 1 else bits) for r, s, bits in lost]
            extra = [(relaxed, bit) for relaxed, _, bits in lost for bit in bits]
            both = np.array(extra, np.int64).reshape(-1, 2)
            pairs.append((both[:, 0], both[:, 1]))
        add = _grouped(np.concatenate([p[0] for p in pairs]), np.concatenate([p[1] for p in pairs]), count)
        return add, [((bit,), o) for symbol, bit in changed.items() for o in opposites[symbol].values()]


def _only(groups: Grouped, wanted: Flags) -> Grouped:
    """Return the groups that are wanted."""
    sizes = np.diff(groups.starts)
    items = groups.items[np.repeat(wanted, sizes)]
    return Grouped(np.concatenate([[0], np.cumsum(sizes[wanted])]), items)


def _with_derived(
    need: Grouped, add: Grouped, owner: Ints, cases: Sequence[tuple[tuple[int, ...], int]]
) -> tuple[Grouped, Grouped, Ints]:
    if not cases:
        return need, add, owner
    more = np.array([bit for group, _ in cases for bit in group], np.int64)
    ends = need.starts[-1] + np.cumsum([len(group) for group, _ in cases])
    need = Grouped(np.concatenate([need.starts, ends]), np.concatenate([need.items, more]))
    ends = add.starts[-1] + np.arange(1, len(cases) + 1)
    add = Grouped(np.concatenate([add.starts, ends]), np.concatenate([add.items, np.array([bit for _, bit in cases])]))
    return need, add, np.concatenate([owner, np.full(len(cases), -1)])


def _meaning(
    bit: int,
    ways: Mapping[int, Mapping[tuple[int, ...], None]],
    circular: AbstractSet[int],
    means: dict[int, tuple[int, ...]],
) -> None:
    """Enter the meaning of a bit into `means`: the bits of its only alternative if it has just one, otherwise the bit itself."""
    waiting = [bit]
    while waiting:
        one = waiting[-1]
        its = ways.get(one, {})
        if one in means or one in circular or not its or (len(its) > 1 and () not in its):
            means.setdefault(one, (one,))
            waiting.pop()
            continue
        way = () if () in its else next(iter(its))
        missing = [other for other in way if other not in means]
        waiting += missing
        if not missing:
            means[one] = tuple(sorted({found for other in way for found in means[other]}))
            waiting.pop()


def _expanded(row: Ints, bit: Ints, means: Grouped) -> tuple[Ints, Ints]:
    """Return pairs of row and bit in which each bit is replaced by its meaning."""
    counts = np.diff(means.starts)[bit]
    return np.repeat(row, counts), means.items[ranges(means.starts[bit], counts)]


def _mask(bits: Sequence[int]) -> int:
    return sum(1 << bit for bit in bits)


def _grouped(owner: Ints, items: Ints, count: int) -> Grouped:
    """Return the items of each owner in ascending order, each once."""
    if len(owner):
        order = np.lexsort((items, owner))
        owner, items = owner[order], items[order]
        new = np.ones(len(owner), bool)
        new[1:] = (owner[1:] != owner[:-1]) | (items[1:] != items[:-1])
        owner, items = owner[new], items[new]
    return Grouped(np.searchsorted(owner, np.arange(count + 1)), items)

"""A grounded task: facts are bits, a state is a Python integer, and behaviours are operators on states.

==============================  =================================================================
in `confab.reasoner.symbols`    in a grounded task
==============================  =================================================================
`Fact`                          a bit, unless the fact is always true or never reachable
the negation of a fact          a complement bit, if a condition requires the negation
`AnyOf`, a negated `Witness`    a derived bit, unless static facts decide it
`Behavior` with all its terms   an operator
conditional effect              a change of an operator, and a separate relaxed operator
`Comparison`                    a bit derived from the amounts (`confab.planner.grounded.amounts`)
==============================  =================================================================
"""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from confab.planner.grounded.amounts import Amounts, Linear
from confab.planner.grounded.derived import Derived
from confab.planner.grounded.derived_arrays import union
from confab.planner.grounded.joins import Ints
from confab.planner.grounded.successors import tree
from confab.planner.plan import Step
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import FALSE, Fact, Symbol

BitChange = tuple[int, int, int]
"""Three masks: a condition, the bits to clear, and the bits to set afterwards.

The change takes place if all bits of the condition are set.
"""
OF_BYTE = [[bit for bit in range(8) if octet >> bit & 1] for octet in range(256)]
"""The positions of the set bits of each byte value."""


@dataclass(frozen=True)
class Grouped:
    """Several lists of integers in one array; list `i` is ``items[starts[i]:starts[i + 1]]``."""

    starts: Ints
    items: Ints

    @classmethod
    def of(cls, lists: Sequence[Sequence[int]]) -> Grouped:
        """Return the arrays of several lists."""
        starts = np.concatenate([[0], np.cumsum([len(one) for one in lists])]).astype(np.int64)
        return cls(starts, np.array(list(itertools.chain.from_iterable(lists)), np.int64))

    def __getitem__(self, i: int) -> list[int]:
        """Return the list with the number `i`."""
        found: list[int] = self.items[self.starts[i] : self.starts[i + 1]].tolist()
        return found

    def lists(self) -> list[list[int]]:
        """Return all lists."""
        items, starts = self.items.tolist(), self.starts.tolist()
        return [items[low:high] for low, high in itertools.pairwise(starts)]


def grouped(owner: Ints, items: Ints, count: int) -> Grouped:
    """Return a list of distinct items in ascending order for each owner."""
    if len(owner):
        order = np.lexsort((items, owner))
        owner, items = owner[order], items[order]
        new = np.ones(len(owner), bool)
        new[1:] = (owner[1:] != owner[:-1]) | (items[1:] != items[:-1])
        owner, items = owner[new], items[new]
    return Grouped(np.searchsorted(owner, np.arange(count + 1)), items)


@dataclass(frozen=True, eq=False)
class Task:
    """One level of a problem, grounded by `confab.planner.grounded.grounding.ground`.

    Parameters
    ----------
    problem : Problem
    level : int
    facts : sequence of Fact
        The facts that the first bits represent.
    complements : mapping of bit to Fact
        The bits that represent the negation of a fact.
    size : int
        Number of bits: facts, complements and derived bits.
    initial, goal : int
        The initial state; the mask of the bits that the goal requires.
    constants : mapping of Symbol to value
        The symbols that no operator changes.
    costs : list of float
        The cost of each operator; the minimum if the cost depends on amounts.
    owners : list of int
        The operator that each relaxed operator belongs to; -1 for an alternative of a derived bit.
    needs, adds : Grouped
        The bits that each relaxed operator requires, and the bits that it may set.
    derived : Derived
        The bits that are derived from other bits.
    change : function of an operator
        Function that returns the operator's precondition and changes, in order of execution.
    describe : function of an operator
        Function that returns the operator's behaviour, arguments and bindings.
    amounts : Amounts, optional
        The amounts of the task, or None if no operator changes an amount.
    prices : mapping of operator to Linear
        The costs that depend on amounts.
    whole : Task, optional
        A task with the same bits, of which this task is a part.
    barred : set of (state, operator)
        Pairs of a state and an operator that the search excludes, because the operator's step has no refinement in the state.
    """

    problem: Problem
    level: int
    facts: Sequence[Fact]
    complements: Mapping[int, Fact]
    size: int
    initial: int
    goal: int
    constants: Mapping[Symbol, str]
    costs: list[float]
    owners: list[int]
    needs: Grouped
    adds: Grouped
    derived: Derived
    change: Callable[[int], tuple[int, tuple[BitChange, ...]]]
    describe: Callable[[int], tuple[str, tuple[str, ...], dict[str, str]]]
    amounts: Amounts | None = None
    prices: Mapping[int, Linear] = field(default_factory=dict)
    whole: Task | None = field(default=None, repr=False)
    barred: set[tuple[int, int]] = field(default_factory=set, repr=False)
    _changes: dict[int, tuple[int, tuple[BitChange, ...]]] = field(default_factory=dict, repr=False)

    def __len__(self) -> int:
        """Return the number of operators."""
        return len(self.costs)

    def spent(self, state: int, operator: int) -> float:
        """Return the cost of an operator in a state."""
        price = self.prices.get(operator)
        return (
            self.costs[operator] if price is None or self.amounts is None else price.worth(self.amounts.vector(state))
        )

    def cost_of(self, plan: Sequence[int]) -> float:
        """Return the cost of a plan that starts in the initial state."""
        total, state = 0.0, self.initial
        for operator in plan:
            total += self.spent(state, operator)
            after = self.applied(state, operator) if self.prices else state
            state = state if after is None else after
        return total

    def applied(self, state: int, operator: int, follow: bool = True) -> int | None:
        """Return the state after an operator, or None if the operator isn't applicable.

        If `follow` is false, derived bits aren't updated.
        """
        precondition, changes = self._changes.get(operator) or self.changes_of(operator)
        if state & precondition != precondition or (self.barred and (state, operator) in self.barred):
            return None
        after = state
        for when, cleared, set_ in changes:
            if state & when == when:
                after = after & ~cleared | set_
        if self.amounts is not None:
            moved = self.amounts.applied(state, after, operator)
            if moved is None:
                return None
            after = moved
        return self.derived.after(after, state) if follow and self.derived.parts else after

    def carried_out(self, state: int, plan: Sequence[int]) -> tuple[int, list[int]]:
        """Execute the applicable operators of a plan in sequence; return the final state and the executed operators.

        Before each operator, the method calculates only the derived bits that the operator requires.
        """
        follow = bool(self.barred) or not self.derived.parts  # barred pairs contain complete states
        kept = []
        for operator in plan:
            if not follow:
                asked, changes = self.changes_of(operator)
                for when, _, _ in changes:
                    asked |= when
                for move in () if self.amounts is None else self.amounts.made(operator):
                    asked |= move.when
                state = self.derived.fresh(state, asked)
            after = self.applied(state, operator, follow)
            if after is not None:
                state = after
                kept.append(operator)
        return state if follow else self.derived.completed(state), kept

    @cached_property
    def applicable(self) -> Callable[[int], tuple[list[int], int]]:
        """Function of a state that returns the applicable operators and the number of tests."""
        return tree(self.needs.starts[: len(self) + 1], self.needs.items, self.of_symbol).of

    @cached_property
    def of_symbol(self) -> Sequence[int]:
        """For each bit, the mask of all bits of the same symbol."""
        if self.whole is not None:
            return self.whole.of_symbol
        found: dict[Symbol, int] = {}
        for bit, fact in enumerate(self.facts):
            found[fact.symbol] = found.get(fact.symbol, 0) | 1 << bit
        return [found[fact.symbol] for fact in self.facts] + [1 << bit for bit in range(len(self.facts), self.size)]

    def changes_of(self, operator: int) -> tuple[int, tuple[BitChange, ...]]:
        """Return the precondition and the changes of an operator; both are computed only once."""
        known = self._changes.get(operator)
        if known is None:
            known = self._changes[operator] = self.change(operator)
        return known

    def set_by(self, operator: int) -> int:
        """Return the mask of the facts that an operator may set."""
        return union(set_ for _, _, set_ in self.changes_of(operator)[1])

    def operators_of(self, steps: Sequence[tuple[str, tuple[str, ...]]]) -> list[int] | None:
        """Return the operators of `steps` (behaviours with arguments), applied in sequence, or None if a step isn't applicable."""
        wanted, named = set(steps), defaultdict(list)
        for operator in range(len(self)):
            step = self.describe(operator)[:2]
            if step in wanted:
                named[step].append(operator)
        state, found = self.initial, []
        for step in steps:
            done = next(((o, after) for o in named[step] if (after := self.applied(state, o)) is not None), None)
            if done is None:
                return None
            found.append(done[0])
            state = done[1]
        return found

    def values(self, state: int) -> dict[Symbol, str]:
        """Return a state as a mapping of symbols to values, without boolean symbols that can't become true."""
        found = dict(self.constants)
        situations = self.problem.domain.situations
        for i, fact in enumerate(self.facts):
            if state >> i & 1:
                found[fact.symbol] = fact.value
            elif situations[fact.symbol.situation].boolean:
                found[fact.symbol] = FALSE
        if self.amounts is not None:
            found |= {fact.symbol: fact.value for fact in self.amounts.facts(state)}
        return found

    def steps(self, plan: Sequence[int]) -> tuple[Step, ...]:
        """Return the operators of a plan as steps of the task's level."""
        found = []
        for position, operator in enumerate(plan):
            behavior, arguments, bindings = self.describe(operator)
            number = self.problem.id_of(behavior, arguments)
            found.append(Step((position,), number, self.level, behavior, arguments, bindings))
        return tuple(found)


def bits_of(mask: int) -> list[int]:
    """Return the positions of the bits that are set in a mask.

    >>> bits_of(0b1010)
    [1, 3]
    """
    octets = mask.to_bytes((mask.bit_length() + 7) // 8, "little")
    return [8 * i + bit for i, octet in enumerate(octets) if octet for bit in OF_BYTE[octet]]

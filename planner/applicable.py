"""The arguments with which behaviours are applicable in a state, found by joins.

Generated Python code binds the parameters of a behaviour one after another from the facts of the state, the static relations and
the classes, whichever has the fewest candidates.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from itertools import product
from math import prod
from typing import TypeAlias

from confab.planner.generated import GeneratorFunction, identifier, tuple_written, written
from confab.planner.transitions import PythonWriter, Table
from confab.reasoner.language import is_variable, mentions, needs
from confab.reasoner.limits import check
from confab.reasoner.symbols import (
    AnyOf,
    Behavior,
    Condition,
    EqualityCondition,
    RelationCondition,
    ValueCondition,
    Witness,
)

MOST_COMBINED = 16
"""Maximum number of combinations of alternatives of a behaviour that are joined separately."""
Join: TypeAlias = "Callable[[], Iterator[tuple[str, ...]]]"
"""Function that yields distinct arguments with which a behaviour may be applicable in the current state of a table."""
Sizes: TypeAlias = "Mapping[tuple[str, str], int]"
"""The number of symbols of a situation type that have a value."""


def joins(writer: PythonWriter, behaviors: Iterable[Behavior], table: Table) -> Mapping[str, Join]:
    """Return the joins of behaviours, bound to a table; the joins suit the present numbers of facts in the table."""
    sizes = {(name, value): len(keys) for name, values in table.holders.items() for value, keys in values.items()}
    lines = [line for behavior in behaviors for line in _lines(writer, behavior, sizes)]
    bind = writer.function(["applicable = {}", *lines], "applicable")
    found: Mapping[str, Sequence[Join]] = bind(table.now, table.holders)
    return {name: partial(_distinct, its) for name, its in found.items()}


def _distinct(its: Sequence[Join]) -> Iterator[tuple[str, ...]]:
    """Yield the arguments that some joins yield, each once."""
    tried = set[tuple[str, ...]]()
    for join in its:
        for arguments in join():
            if arguments not in tried:
                tried.add(arguments)
                yield arguments


def _lines(writer: PythonWriter, behavior: Behavior, sizes: Sizes) -> Iterator[str]:
    """Yield the lines that define the functions `Join` of a behaviour in the dictionary `applicable`."""
    names = []
    for number, conditions in enumerate(_alternatives(behavior.preconditions)):
        names.append(f"{identifier('join', behavior.name)}_{number}")
        yield from _joined(writer, names[-1], behavior, conditions, sizes)
    yield f"applicable[{behavior.name!r}] = {tuple_written(names)}"


def _alternatives(conditions: Sequence[Condition]) -> Iterable[Sequence[Condition]]:
    """Return conjunctions, one of which holds if the given conditions hold: each has one alternative of each `AnyOf`."""
    choices = [c for c in conditions if isinstance(c, AnyOf) and not c.negated]
    if prod(len(c.alternatives) for c in choices) > MOST_COMBINED:
        return [conditions]
    others = [c for c in conditions if c not in choices]
    return [
        [*others, *(c for group in groups for c in group)] for groups in product(*(c.alternatives for c in choices))
    ]


def _joined(
    writer: PythonWriter, name: str, behavior: Behavior, conditions: Sequence[Condition], sizes: Sizes
) -> Iterator[str]:
    """Yield the lines of functions that yield the arguments with which conditions may hold, with a loop for each source."""
    kinds, block = behavior.kinds, GeneratorFunction(name)
    waiting, bound, tests = list(conditions), set[str](), list[str]()
    parameters = [p.name for p in behavior.parameters]
    look = writer.constant(("look", "time"), partial(check, "looking for applicable behaviours"))
    while True:
        slow = False
        while ready := next((c for c in waiting if _open_terms(c, kinds) <= bound), None):
            waiting.remove(ready)
            tests.append(writer.expression(ready, bound, kinds, behavior.name))
            slow = slow or isinstance(ready, Witness | AnyOf)
        if slow:
            block.add(f"{look}()")
        if tests:
            block.open(f"if {' and '.join(f'({test})' for test in tests)}:")
        if bound.issuperset(parameters):
            block.add(f"yield {tuple_written(map(written, parameters))}")
            yield from block.lines
            return
        block.add(f"{look}()")
        loop, terms = _loop(writer, behavior, waiting, bound, sizes)
        block.loop(loop, [written(term) for term in sorted(bound)])
        tests = [f"{written(term)} == {source}" for term, source in terms if term in bound or not is_variable(term)]
        fresh = {term: source for term, source in reversed(terms) if is_variable(term) and term not in bound}
        for term, source in fresh.items():
            block.add(f"{written(term)} = {source}")
            tests.append(writer.member(term, kinds[term]))
        tests += [f"{written(term)} == {source}" for term, source in terms if term in fresh and source != fresh[term]]
        bound.update(fresh)


def _open_terms(condition: Condition, kinds: Mapping[str, str]) -> set[str]:
    """Return the terms that must be bound before a condition is tested; `kinds` contains the terms of the behaviour."""
    if isinstance(condition, ValueCondition) and not condition.negated:
        return needs(condition)
    return mentions(condition) & kinds.keys()


def _loop(
    writer: PythonWriter,
    behavior: Behavior,
    waiting: Sequence[Condition],
    bound: set[str],
    sizes: Sizes,
) -> tuple[str, list[tuple[str, str]]]:
    """Return the head of a loop over the fewest candidates for unbound terms, and the terms, each with its expression."""
    found: list[tuple[float, str, list[tuple[str, str]]]] = []
    for condition in waiting:
        match condition:
            case EqualityCondition(left, right, False):
                for term, other in ((left, right), (right, left)):
                    if is_variable(term) and term not in bound and (other in bound or not is_variable(other)):
                        found.append((0.5, f"for t in ({written(other)},):", [(term, "t")]))
            case RelationCondition(relation, arguments, False):
                unbound = {a for a in arguments if is_variable(a)} - bound
                for term in sorted(unbound):
                    if arguments.count(term) == 1:
                        text, fan = writer.adjacent(relation, arguments, term, unbound)
                        found.append((fan, f"for t in {text}:", [(term, "t")]))
            case ValueCondition(situation, arguments, value, False) if situation not in writer.problem.domain.rules:
                given = not is_variable(value) or value in bound
                keys = (
                    [(arguments[0], "t")] if len(arguments) == 1 else [(a, f"t[{i}]") for i, a in enumerate(arguments)]
                )
                size = sum(
                    number
                    for (name, one), number in sizes.items()
                    if name == situation and (one == value or is_variable(value))
                )
                if given and writer.listed(situation, value):
                    text = f"{identifier('holders', situation)}.get({written(value)}, ())"
                    found.append((max(size, 1.0), f"for t in {text}:", keys))
                elif not given:
                    text = f"{identifier('now', situation)}.items()"
                    found.append((max(size, 1.0), f"for t, u in {text}:", [*keys, (value, "u")]))
    for parameter in behavior.parameters:
        if parameter.name not in bound:
            members = writer.problem.classes.get(parameter.kind, ())
            text = writer.constant(("members", parameter.kind), members)
            found.append((len(members) + 1.0, f"for t in {text}:", [(parameter.name, "t")]))
    _, head, terms = min(found, key=lambda entry: entry[0])
    return head, terms

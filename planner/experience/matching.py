"""A rule as a join over the table: generated Python that yields the ways to fill its roles now.

The goal fills its own roles; each condition is tested as soon as its roles are filled. What fills another role is, in this order
of preference: the value that a symbol has; who has a value; a static relation; a class. Different roles are different individuals.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TypeAlias

from planner.generated import identifier, tuple_written, written
from planner.language import mentions, walk
from planner.transitions import Table, Writer
from reasoner.memory.experience import Rule
from reasoner.symbols import Condition, Problem, RelationCondition, ValueCondition

Find: TypeAlias = "Callable[..., Iterator[tuple[str, ...]]]"
"""Given the arguments and the value of a goal, yields individuals for the roles of a rule, in its order."""

DEEPEST = 18
"""So many loops inside each other Python allows, with a few to spare."""


def finder(rule: Rule, writer: Writer) -> Callable[[Table], Find] | None:
    """Return what binds a rule to a table; None where it looks for too many individuals.

    The problem has what it speaks of (`known`).
    """
    lines = _lines(rule, writer)
    if lines is None:
        return None
    bind = writer.function(lines, "find")
    return lambda table: bind(table.now, table.who)


def known(rule: Rule, problem: Problem) -> bool:
    """Whether a problem has the behaviour, the classes and the situation types of a rule."""
    domain, classes = problem.domain, problem.classes
    behavior = domain.behaviors.get(rule.does[0])
    if (
        behavior is None
        or len(behavior.parameters) != len(rule.does[1])
        or rule.goal.situation not in domain.situations
    ):
        return False
    if any(kind not in classes for _, kind in rule.kinds):
        return False
    inner = [c for condition in (rule.goal, *rule.asks) for c in walk(condition)]
    return all(
        c.situation in domain.situations and len(c.arguments) == len(domain.situations[c.situation].arguments)
        for c in inner
        if isinstance(c, ValueCondition)
    )


def _lines(rule: Rule, writer: Writer) -> list[str] | None:
    kinds = dict(rule.kinds)
    given = (*rule.goal.arguments, rule.goal.value)
    lines = [f"def find({', '.join(f'i{i}' for i in range(len(given)))}):"]
    bound: set[str] = set()
    waiting = list(rule.asks)
    depth = 0
    leave = "return"

    def emit(text: str) -> None:
        lines.append("    " * (depth + 1) + text)

    def unless(test: str) -> None:
        emit(f"if not ({test}): {leave}")

    def fill(role: str) -> None:
        """Say that a role is filled: by one of its class, and none that fills another one."""
        unless(writer.member(role, kinds[role]))
        members = writer.problem.members
        others = [r for r in sorted(bound) if not members(kinds[r]).isdisjoint(members(kinds[role]))]
        if others:
            unless(f"{written(role)} not in {tuple_written(map(written, others))}")
        bound.add(role)

    for i, term in enumerate(given):
        if term.startswith("?") and term not in bound:
            emit(f"{written(term)} = i{i}")
            fill(term)
        else:
            unless(f"i{i} == {written(term)}")
    while True:
        ready = [c for c in waiting if not mentions(c) - bound]
        for condition in sorted(ready, key=lambda c: not isinstance(c, ValueCondition)):
            waiting.remove(condition)
            unless(writer.expression(condition, set(bound), kinds, rule.name))
        left = [role for role, _ in rule.kinds if role not in bound]
        if not left:
            break
        _, filled, source, tests = min(_ways(waiting, bound, left, kinds, writer), key=lambda way: way[0])
        if source is None:
            emit(f"{written(filled[0])} = {tests[0]}")
        else:
            depth_of = written(filled[0]) if len(filled) == 1 and not tests else "key"
            emit(f"for {depth_of} in {source}:")
            depth += 1
            leave = "continue"
            for test in tests:
                emit(test)
        for role in filled:
            fill(role)
        if depth > DEEPEST:
            return None
    emit(f"yield {tuple_written(written(role) for role, _ in rule.kinds)}")
    return lines


def _ways(
    waiting: Sequence[Condition], bound: set[str], left: Sequence[str], kinds: Mapping[str, str], writer: Writer
) -> Iterator[tuple[float, list[str], str | None, list[str]]]:
    """Yield ways to fill roles: how many there may be, the roles, what to go through (None: a value), and lines for each."""
    problem = writer.problem
    for condition in waiting:
        match condition:
            case ValueCondition(situation, arguments, value, False):
                unknown = [a for a in dict.fromkeys(arguments) if a in left]
                if value in left and not unknown:
                    yield 0.0, [value], None, [writer.look(condition)]
                elif unknown and value not in left and writer.listed(situation, value):
                    who = f"{identifier('who', situation)}.get({written(value)}, ())"
                    values = len(problem.classes.get(problem.domain.situations[situation].range, ())) or 1
                    symbols = 1.0
                    for of in problem.domain.situations[situation].arguments:
                        symbols *= len(problem.classes.get(of, ()))
                    fan = symbols / values if value != "true" else symbols ** (len(unknown) / len(arguments))
                    if len(arguments) == 1:
                        yield fan, unknown, who, []
                    elif len(set(arguments)) == len(arguments):
                        tests = [
                            f"if key[{i}] != {written(a)}: continue"
                            for i, a in enumerate(arguments)
                            if a not in unknown
                        ]
                        tests += [f"{written(a)} = key[{i}]" for i, a in enumerate(arguments) if a in unknown]
                        yield fan, unknown, who, tests
            case RelationCondition(relation, arguments, False):
                unknown = [a for a in dict.fromkeys(arguments) if a in left]
                if len(unknown) == 1 and arguments.count(unknown[0]) == 1:
                    source, fan = writer.adjacent(relation, arguments, unknown[0])
                    yield fan, unknown, source, []
    for role in left:
        members = problem.classes.get(kinds[role], ())
        yield len(members) + 1.0, [role], writer.constant(("members", kinds[role]), members), []

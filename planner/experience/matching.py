"""Matching of rules: each rule is compiled to a Python function that yields the rule instances in the current state.

The static conditions of an instance hold. Conditions on the state may be *unmet*, because steps can achieve these conditions later.
The preferred candidates for a role are values of symbols, and objects that have a required value. If no preferred candidate fits,
or if all instances are requested, the candidates come from a static relation or from the role's class, one individual of each
symmetry class. Different roles have different individuals.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TypeAlias

from confab.planner.generated import identifier, tuple_written, written
from confab.planner.transitions import PythonWriter, Table
from confab.reasoner.language import is_variable, mentions, substituted, walk
from confab.reasoner.memory.experience import LearnedRule
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import Comparison, Condition, RelationCondition, ValueCondition

Find: TypeAlias = "Callable[..., Iterator[tuple[tuple[str, ...], tuple[int, ...]]]]"
"""Function that yields the instances of a rule, each as the individuals in the roles and the positions of unmet conditions.

The parameters are the arguments of the goal's symbol, the goal's value, and whether all instances are requested.
"""

Pick: TypeAlias = "Callable[[tuple[str, ...], str], Sequence[str]]"
"""Function that returns one of the given individuals for each symmetry class.

The second parameter names the situation type whose value the individual becomes. Free individuals come first.
"""
Bind: TypeAlias = "Callable[[Table, Pick], Find]"

DEEPEST = 18
"""Maximum number of nested loops in a generated function; Python allows slightly more."""


def soft(rule: LearnedRule, problem: Problem) -> tuple[Condition, ...]:
    """Return the conditions that steps can achieve: conditions of a rule on the state, and comparisons of its behaviour."""
    behavior = problem.domain.behaviors[rule.does[0]]
    put = {p.name: term for p, term in zip(behavior.parameters, rule.does[1], strict=True)}
    compared = (c for c in behavior.preconditions if isinstance(c, Comparison) and mentions(c) <= put.keys())
    return (*(c for c in rule.asks if not _static(c)), *(substituted(c, put) for c in compared))


def finder(rule: LearnedRule, writer: PythonWriter, asks: Sequence[Condition]) -> Bind | None:
    """Return the function that binds a compiled rule to a table of current values, or None if the rule has too many roles.

    The problem must have the rule's behaviour, classes and situation types (`known`).
    """
    lines = _Join(rule, writer, asks).lines()
    if lines is None:
        return None
    bind = writer.function(lines, "find", ", pick")
    return lambda table, pick: bind(table.now, table.holders, pick)


def known(rule: LearnedRule, problem: Problem) -> bool:
    """Return whether a problem has the behaviour, all classes and all situation types of a rule."""
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


def _static(condition: Condition) -> bool:
    return not any(isinstance(inner, ValueCondition | Comparison) for inner in walk(condition))


def _variables(terms: Iterable[str]) -> set[str]:
    return {term for term in terms if is_variable(term)}


class _Join:
    """Writer of the Python function that yields the instances of one rule."""

    def __init__(self, rule: LearnedRule, writer: PythonWriter, asks: Sequence[Condition]) -> None:
        self.rule, self.writer, self.soft = rule, writer, asks
        self.kinds, self.problem = dict(rule.kinds), writer.problem
        self.hard = [c for c in rule.asks if c not in asks]
        self.bound: set[str] = set()

    def lines(self) -> list[str] | None:
        """Return the lines of the function, or None if the function would need too many nested loops."""
        rule, depth = self.rule, 0
        given = (*rule.goal.arguments, rule.goal.value)
        lines = [f"def find({', '.join(f'i{i}' for i in range(len(given)))}, everybody):"]
        for i, term in enumerate(given):
            if term in self.kinds and term not in self.bound:
                lines += [f"    {written(term)} = i{i}", f"    if not ({' and '.join(self.tests(term))}): return"]
            else:
                lines.append(f"    if i{i} != {written(term)}: return")
        lines.append(f"    if not ({' and '.join(self.ready()) or True}): return")
        while left := [role for role, _ in rule.kinds if role not in self.bound]:
            role, now, others = min(
                ((role, *self.sources(role)) for role in left), key=lambda way: (not way[1], way[2][0])
            )
            name, indent = written(role), "    " * (depth + 1)
            tests = " and ".join(self.tests(role))
            asked = (c for c in (rule.goal, *self.soft) if isinstance(c, ValueCondition) and c.value == role)
            of = next((c.situation for c in asked), "")
            picked = f"[{name} for {name} in pick({others[1]}, {of!r}) if {tests}]"
            if now:
                lines.append(f"{indent}found = [{name} for {name} in dict.fromkeys([{', '.join(now)}]) if {tests}]")
                lines.append(f"{indent}if everybody or not found: found = list(dict.fromkeys(found + {picked}))")
            else:
                lines.append(f"{indent}found = {picked}")
            lines.append(f"{indent}for {name} in found:")
            depth += 1
            if depth > DEEPEST:
                return None
        indent = "    " * (depth + 1)
        lines.append(f"{indent}unmet = ()")
        for number, c in enumerate(self.soft):
            text = self.writer.expression(c, set(self.bound), self.kinds, rule.name)
            lines.append(f"{indent}if not ({text}): unmet += ({number},)")
        lines.append(f"{indent}yield {tuple_written(written(role) for role, _ in rule.kinds)}, unmet")
        return lines

    def tests(self, role: str) -> list[str]:
        """Mark a role as bound; return the tests of its individual: the class, other roles, and the rule's conditions."""
        members = self.problem.members
        mine = members(self.kinds[role])
        others = [r for r in sorted(self.bound) if not members(self.kinds[r]).isdisjoint(mine)]
        found = [self.writer.member(role, self.kinds[role])]
        if others:
            found.append(f"{written(role)} not in {tuple_written(map(written, others))}")
        self.bound.add(role)
        return found + self.ready() + self.ahead(role)

    def ahead(self, role: str) -> list[str]:
        """For each static relation between a role and unbound roles, return a test that an unbound role has a candidate."""
        found = []
        for c in self.hard:
            if isinstance(c, RelationCondition) and not c.negated and role in c.arguments:
                for other in sorted(others := _variables(c.arguments) - self.bound)[:1]:
                    found.append(self.writer.adjacent(c.relation, c.arguments, other, others)[0])
        return found

    def ready(self) -> list[str]:
        """Return tests for the required conditions whose roles are all bound; each condition is tested once."""
        now = [c for c in self.hard if not mentions(c) - self.bound]
        self.hard = [c for c in self.hard if c not in now]
        now.sort(key=lambda c: not isinstance(c, ValueCondition))
        return [self.writer.expression(c, set(self.bound), self.kinds, self.rule.name) for c in now]

    def sources(self, role: str) -> tuple[list[str], tuple[float, str]]:
        """Return expressions for the candidates that the state suggests for a role, and for the other candidates.

        The expression for the other candidates is preceded by their estimated number.
        """
        now, writer = list[str](), self.writer
        members = self.problem.classes.get(self.kinds[role], ())
        other = len(members) + 1.0, writer.constant(("members", self.kinds[role]), members)
        for c in (*self.soft, *self.hard):
            if isinstance(c, ValueCondition) and not c.negated:
                others = _variables((*c.arguments, c.value)) - self.bound
                if others == {role} and c.value == role and role not in c.arguments:
                    now.append(writer.look(c))
                elif (
                    c.value != role
                    and others == {role}
                    and c.arguments.count(role) == 1
                    and writer.listed(c.situation, c.value)
                ):
                    holders, place = (
                        f"{identifier('holders', c.situation)}.get({written(c.value)}, ())",
                        c.arguments.index(role),
                    )
                    if len(c.arguments) > 1:
                        same = (f"k[{i}] == {written(a)}" for i, a in enumerate(c.arguments) if i != place)
                        holders = f"[k[{place}] for k in {holders} if {' and '.join(same)}]"
                    now.append(f"*{holders}")
            elif isinstance(c, RelationCondition) and not c.negated and c.arguments.count(role) == 1:
                if _variables(c.arguments) - self.bound != {role}:
                    continue
                text, fan = writer.adjacent(c.relation, c.arguments, role)
                other = min(other, (fan, text))
        return now, other

"""Behaviours compiled to Python source, once per problem: what each does, and how each could bring a value about.

For every behaviour there is one function ``forward(arguments)``, and for every effect of it one ``achieve(key …, value)``:

forward   the bindings and the changes, or None if the behaviour isn't applicable now
achieve   each binding with which the effect would give that symbol that value, with the preconditions that are unmet now

A condition becomes a Python expression. What enumerates an unbound parameter is, in this order of preference: a static
relation to what is bound; the inverse of a situation type that nothing can change there; a class. What the state alone
determines comes last and is *soft*: a static relation that fails on a value which can change is something to want, not a
dead end.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import prod
from types import CodeType
from typing import TypeAlias

from planner.hierarchical.state import Alike, Change, Key, Table, representatives
from planner.language import DomainError, mentions, needs, nothing_determines, terms, walk
from reasoner.symbols import (
    FALSE,
    TRUE,
    AnyOf,
    Behavior,
    ClassCondition,
    Condition,
    EqualityCondition,
    Problem,
    RelationCondition,
    ValueCondition,
    Witness,
)

Arguments: TypeAlias = "tuple[str, ...]"
Forward: TypeAlias = "Callable[..., tuple[tuple[str, ...], list[Change]] | None]"
Achieve: TypeAlias = "Callable[..., Iterator[tuple[Arguments, tuple[int, ...], dict[str, str | None]]]]"
"""Yields arguments, positions of unmet conditions, and (if any is unmet) the binding in which they are."""


@dataclass(frozen=True)
class Achiever:
    """One effect of one behaviour, seen from the value that it brings about.

    `soft` are the conditions that the state can change, by position; `determined` says of which symbol a variable is the
    value: its situation type and argument terms.
    """

    behavior: str
    effect: int
    soft: tuple[Condition, ...]
    determined: Mapping[str, tuple[str, tuple[str, ...]]]
    kinds: Mapping[str, str]


@dataclass
class Bound:
    """The compiled functions, bound to the table that they look at."""

    forward: dict[str, Forward]
    achieve: dict[tuple[str, int], Achieve]


FEW = 8
"""So many candidates are all tried; of more, one of each sort."""


class Program:
    """The compiled behaviours of one problem: they serve any table over the same individuals and static facts.

    Parameters
    ----------
    problem : Problem
        Its initial state and goal aren't looked at.
    """

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.domain = problem.domain
        self.members = {kind: frozenset(members) for kind, members in problem.classes.items()}
        self.levels = problem.domain.levels
        self.achievers: dict[tuple[int, str], list[Achiever]] = {}
        self.thorough = False
        self.variables: dict[str, tuple[str, ...]] = {}
        self.named = named(problem)
        self.alike = Alike(problem, self.named)
        self._globals: dict[str, object] = {"prefer": prefer, "pick": self._picker}
        self._fan: dict[str, float] = {}
        self.source = "\n".join(self._module())
        exec(_code(self.source), self._globals)

    def bind(self, table: Table, focus: Mapping[str, None]) -> Bound:
        """Return the functions over a table; of many that could be enumerated, those in `focus` are preferred."""
        forward, achieve = self._globals["bind"](table.now, table.who, focus)  # type: ignore[operator]
        return Bound(forward, achieve)

    def _picker(
        self, candidates: tuple[str, ...], focus: Mapping[str, None], who: Mapping[str, Mapping[Key, None]]
    ) -> Sequence[str]:
        found = [term for term in focus if term in candidates] if focus else []
        if found or len(candidates) <= FEW or self.thorough:
            return found or candidates
        return representatives(self.alike.groups(candidates), who, {})

    def size(self, level: int) -> int:
        """Return how many behaviours a level has at most, quantified over all individuals."""
        classes = self.problem.classes
        return sum(
            prod(len(classes.get(parameter.kind, ())) for parameter in behavior.parameters)
            for behavior in self.domain.at_level(level)
        )

    @cached_property
    def rows_of(self) -> Mapping[str, Mapping[str, list[tuple[str, ...]]]]:
        """For each static relation the tuples that an individual occurs in."""
        found: dict[str, dict[str, list[tuple[str, ...]]]] = {}
        for relation, rows in self.problem.relations.items():
            index = found.setdefault(relation, {})
            for row in sorted(rows):
                for individual in dict.fromkeys(row):
                    index.setdefault(individual, []).append(row)
        return found

    # ---------------------------------------------------------------------------------------------------------- source

    def _module(self) -> Iterator[str]:
        yield "def bind(now, who, focus):"
        for situation in sorted(self.domain.situations):
            yield f"    {_name('now', situation)} = now[{situation!r}]; {_name('who', situation)} = who[{situation!r}]"
        yield "    forward, achieve = {}, {}"
        for behavior in self.domain.behaviors.values():
            yield from ("    " + line for line in self._forward(behavior))
            for number in range(len(behavior.effects)):
                yield from ("    " + line for line in self._achieve(behavior, number))
        yield "    return forward, achieve"

    def _forward(self, behavior: Behavior) -> Iterator[str]:
        kinds = behavior.kinds
        parameters = [p.name for p in behavior.parameters]
        bound = set(parameters)
        tests = [self._member(p.name, p.kind) for p in behavior.parameters]
        tests += self.conjunction(behavior.preconditions, bound, kinds, behavior.name)
        variables = sorted(v.name for v in behavior.variables if v.name in bound)
        self.variables[behavior.name] = tuple(name[1:] for name in variables)
        yield f"def {_name('forward', behavior.name)}({', '.join(map(_term, parameters))}):"
        yield f"    if not ({' and '.join(tests) or 'True'}): return None"
        yield "    changes = []"
        for effect in behavior.effects:
            inner = set(bound)
            when = self.conjunction(effect.when, inner, kinds, behavior.name)
            free = {t for t in (*effect.arguments, effect.value) if t.startswith("?")} - inner
            if free:
                raise DomainError(
                    f"{behavior.name}: nothing determines {', '.join(sorted(free))}, which an effect names"
                )
            when += self._exists(effect.situation, effect.arguments, kinds)
            change = f"changes.append(({effect.situation!r}, {_key(effect.arguments)}, {_term(effect.value)}))"
            yield f"    if {' and '.join(when)}: {change}" if when else f"    {change}"
        yield f"    return {_tuple(map(_term, variables))}, changes"
        yield f"forward[{behavior.name!r}] = {_name('forward', behavior.name)}"

    def _achieve(self, behavior: Behavior, number: int) -> Iterator[str]:
        effect = behavior.effects[number]
        kinds = behavior.kinds
        name = f"{_name('achieve', behavior.name)}_{number}"
        inputs = [f"i{i}" for i in range(len(effect.arguments) + 1)]
        hard: set[str] = set()
        tests: list[str] = []
        lines: list[str] = []
        for term, given in zip((*effect.arguments, effect.value), inputs, strict=True):
            if term.startswith("?") and term not in hard:
                hard.add(term)
                lines.append(f"{_term(term)} = {given}")
                tests.append(self._member(term, kinds[term]))
            else:
                tests.append(f"{given} == {_term(term)}")
        waiting = [*effect.when, *behavior.preconditions]
        free = [p.name for p in behavior.parameters if p.name not in hard]
        depth = 0

        def emit(text: str) -> None:
            lines.append("    " * depth + text)

        # Hard: tests on what is bound, and enumeration of what isn't.
        while True:
            ready = [c for c in waiting if self._static(c, kinds, behavior) and not mentions(c) - hard]
            for condition in ready:
                waiting.remove(condition)
                tests.append(self.expression(condition, hard, kinds, behavior.name))
            generator = self._generator(waiting, hard, kinds, behavior, free)
            if tests:
                emit(f"if {' and '.join(tests)}:")
                depth, tests = depth + 1, []
            if generator is None:
                break
            term, text = generator
            emit(f"for {_term(term)} in {text}:")
            depth += 1
            hard.add(term)
            free = [p for p in free if p != term]
            tests.append(self._member(term, kinds[term]))
        # Soft: what the state determines, and tests on it.
        emit("unmet = ()")
        bound = set(hard)
        soft: list[Condition] = []
        determined: dict[str, tuple[str, tuple[str, ...]]] = {}
        while waiting:
            condition = _ready(waiting, bound, behavior.name)
            waiting.remove(condition)
            if (
                isinstance(condition, ValueCondition)
                and condition.value.startswith("?")
                and condition.value not in bound
            ):
                # A binding is made whether or not it is of the right class, for the tests that follow.
                bound.add(condition.value)
                determined[condition.value] = condition.situation, condition.arguments
                emit(f"{_term(condition.value)} = {self._look(condition)}")
                test = self._member(condition.value, kinds[condition.value])
            else:
                test = self.expression(condition, bound, kinds, behavior.name)
            emit(f"if not ({test}): unmet += ({len(soft)},)")
            soft.append(condition)
        names = ", ".join(f"{term!r}: {_term(term)}" for term in sorted(bound))
        arguments = _tuple(_term(p.name) for p in behavior.parameters)
        emit(f"yield {arguments}, unmet, {{{names}}} if unmet else None")
        yield f"def {name}({', '.join(inputs)}):"
        yield from ("    " + line for line in lines)
        yield f"achieve[{behavior.name!r}, {number}] = {name}"
        achiever = Achiever(behavior.name, number, tuple(soft), determined, kinds)
        self.achievers.setdefault((behavior.level, effect.situation), []).append(achiever)

    def _generator(
        self,
        waiting: Sequence[Condition],
        hard: set[str],
        kinds: Mapping[str, str],
        behavior: Behavior,
        free: Sequence[str],
    ) -> tuple[str, str] | None:
        """Return the cheapest way to enumerate one more unbound term, as its name and an iterable expression."""
        found: list[tuple[float, str, str]] = []
        for condition in waiting:
            match condition:
                case RelationCondition(relation, arguments, False):
                    unbound = {a for a in arguments if a.startswith("?")} - hard
                    if len(unbound) == 1 and arguments.count(term := unbound.pop()) == 1 and term in free:
                        text = self._pick(self._adjacent(relation, arguments, term), term, behavior)
                        found.append((self._adjacency(relation, arguments, term), term, text))
                case ValueCondition(situation, (term,), value, False) if term.startswith("?") and term not in hard:
                    constant = self._listed(situation, value) and (not value.startswith("?") or value in hard)
                    if constant and not self.changeable(situation, (term,), kinds, behavior):
                        who = f"{_name('who', situation)}.get({_term(value)}, ())"
                        found.append((4.0, term, f"prefer({who}, focus)"))
        for term in free:
            members = self._constant(("members", kinds[term]), self.problem.classes.get(kinds[term], ()))
            found.append((len(self._kind(kinds[term])) + 1.0, term, self._pick(members, term, behavior)))
        if not found:
            return None
        _, term, text = min(found, key=lambda entry: entry[0])
        return term, text

    def _pick(self, candidates: str, term: str, behavior: Behavior) -> str:
        """Return an iterable expression for those candidates that are in focus, else one of each sort that is free."""
        taken = next((_name("who", e.situation) for e in behavior.effects if e.value == term), "{}")
        return f"pick({candidates}, focus, {taken})"

    def _static(self, condition: Condition, kinds: Mapping[str, str], behavior: Behavior) -> bool:
        """Whether nothing that this level does can change the truth of a condition."""
        match condition:
            case ValueCondition(situation, arguments, _, _):
                return not self.changeable(situation, arguments, kinds, behavior)
            case Witness(variable, kind, conditions):
                return all(self._static(c, {**kinds, variable: kind}, behavior) for c in conditions)
            case AnyOf(alternatives):
                return all(self._static(c, kinds, behavior) for group in alternatives for c in group)
        return True

    def changeable(
        self, situation: str, arguments: Sequence[str], kinds: Mapping[str, str], behavior: Behavior
    ) -> bool:
        """Whether an effect on the level of `behavior` can fall on a symbol with these terms."""
        here = [self._possible(term, kinds, behavior) for term in arguments]
        for other in self.domain.at_level(behavior.level):
            others = other.kinds
            for effect in other.effects:
                if effect.situation == situation:
                    there = [self._possible(term, others, other) for term in effect.arguments]
                    if all(not a.isdisjoint(b) for a, b in zip(here, there, strict=True)):
                        return True
        return False

    def _possible(self, term: str, kinds: Mapping[str, str], behavior: Behavior) -> frozenset[str]:
        """Return the individuals that a term of a behaviour can stand for."""
        if not term.startswith("?"):
            return frozenset((term,))
        found = self._kind(kinds[term])
        for condition in behavior.preconditions:
            if isinstance(condition, ClassCondition) and condition.term == term:
                kind = self._kind(condition.kind)
                found = found - kind if condition.negated else found & kind
        return found

    # ----------------------------------------------------------------------------------------------------- expressions

    def conjunction(
        self, conditions: Sequence[Condition], bound: set[str], kinds: Mapping[str, str], where: str
    ) -> list[str]:
        """Return the conditions as expressions, in an order that binds before it uses; `bound` grows."""
        waiting, found = list(conditions), []
        while waiting:
            ready = _ready(waiting, bound, where)
            waiting.remove(ready)
            found.append(self.expression(ready, bound, kinds, where))
        return found

    def expression(self, condition: Condition, bound: set[str], kinds: Mapping[str, str], where: str) -> str:
        """Return a condition as a Python expression; a variable that it determines is assigned in it."""
        match condition:
            case ValueCondition(situation, arguments, value, negated):
                look = self._look(condition)
                if value.startswith("?") and value not in bound:
                    bound.add(value)
                    return f"({_term(value)} := {look}) in {self._constant(('kind', kinds[value]), self._kind(kinds[value]))}"
                test = " and ".join([f"{look} == {_term(value)}", *self._exists(situation, arguments, kinds)])
                return f"not ({test})" if negated else test
            case RelationCondition(relation, arguments, negated):
                tuples = self._constant(("relation", relation), self.problem.relations.get(relation, frozenset()))
                return f"({_tuple(map(_term, arguments))} {'not in' if negated else 'in'} {tuples})"
            case ClassCondition(term, kind, negated):
                return (
                    f"{_term(term)} {'not in' if negated else 'in'} {self._constant(('kind', kind), self._kind(kind))}"
                )
            case EqualityCondition(left, right, negated):
                return f"{_term(left)} {'!=' if negated else '=='} {_term(right)}"
            case Witness(_, _, _, negated):
                return ("not " if negated else "") + self._witness(condition, bound, kinds, where)
            case AnyOf(alternatives, negated):
                groups = [" and ".join(self.conjunction(g, set(bound), kinds, where)) or "True" for g in alternatives]
                return ("not " if negated else "") + "(" + " or ".join(f"({g})" for g in groups) + ")"

    def _witness(self, condition: Witness, bound: set[str], kinds: Mapping[str, str], where: str) -> str:
        term, kind = condition.variable, condition.kind
        inner = {**kinds, term: kind}
        candidates = self.problem.classes.get(kind, ())
        best: tuple[float, Condition | None, str] = (
            len(candidates),
            None,
            self._constant(("members", kind), candidates),
        )
        for c in condition.conditions:
            match c:
                case ValueCondition(situation, (only,), value, False) if only == term and value != term:
                    if self._listed(situation, value) and (value in bound or not value.startswith("?")):
                        best = min(best, (1.0, c, f"{_name('who', situation)}.get({_term(value)}, ())"), key=_cost)
                case RelationCondition(relation, arguments, False) if arguments.count(term) == 1:
                    if not {a for a in arguments if a.startswith("?")} - bound - {term}:
                        text = self._adjacent(relation, arguments, term)
                        best = min(best, (self._adjacency(relation, arguments, term), c, text), key=_cost)
        _, consumed, source = best
        rest = [c for c in condition.conditions if c is not consumed]
        tests = self.conjunction(rest, bound | {term}, inner, where)
        if consumed is not None and not (
            isinstance(consumed, ValueCondition)
            and self._kind(self.domain.situations[consumed.situation].arguments[0]) <= self._kind(kind)
        ):
            tests.insert(0, self._member(term, kind))
        if not tests:
            return f"bool({source})"
        return f"any(({' and '.join(tests)}) for {_term(term)} in {source})"

    def _listed(self, situation: str, value: str) -> bool:
        """Whether the table lists who has a value: what is false isn't listed, and a variable could be that."""
        return value == TRUE or not self.domain.situations[situation].boolean

    def _look(self, condition: ValueCondition) -> str:
        default = f", {FALSE!r}" if self.domain.situations[condition.situation].boolean else ""
        return f"{_name('now', condition.situation)}.get({_key(condition.arguments)}{default})"

    def _exists(self, situation: str, arguments: Sequence[str], kinds: Mapping[str, str]) -> list[str]:
        """Return tests that the symbol exists, where the terms' classes don't already say so."""
        return [
            self._member(term, wanted)
            for term, wanted in zip(arguments, self.domain.situations[situation].arguments, strict=True)
            if not (term.startswith("?") and self._kind(kinds[term]) <= self._kind(wanted))
        ]

    def _member(self, term: str, kind: str) -> str:
        return f"{_term(term)} in {self._constant(('kind', kind), self._kind(kind))}"

    def _kind(self, kind: str) -> frozenset[str]:
        return self.members.get(kind, frozenset())

    def _adjacent(self, relation: str, arguments: Sequence[str], term: str) -> str:
        position = list(arguments).index(term)
        table: dict[tuple[str, ...], list[str]] = {}
        name = _name("adjacent", relation) + f"_{position}"
        if name not in self._globals:
            for row in sorted(self.problem.relations.get(relation, ())):
                table.setdefault(row[:position] + row[position + 1 :], []).append(row[position])
            self._globals[name] = {others: tuple(found) for others, found in table.items()}
            self._fan[name] = sum(map(len, table.values())) / max(len(table), 1)
        others = [*arguments[:position], *arguments[position + 1 :]]
        return f"{name}.get({_tuple(map(_term, others))}, ())"

    def _adjacency(self, relation: str, arguments: Sequence[str], term: str) -> float:
        self._adjacent(relation, arguments, term)
        return self._fan[_name("adjacent", relation) + f"_{list(arguments).index(term)}"]

    def _constant(self, what: tuple[str, str], value: object) -> str:
        name = _name(*what)
        self._globals[name] = value
        return name


def prefer(candidates: Sequence[str] | Mapping[Key, None], focus: Mapping[str, None]) -> Sequence[str]:
    """Return those of the candidates that are in focus, or all if none is."""
    if focus:
        found = [term for term in focus if term in candidates]
        if found:
            return found
    return list(candidates)  # type: ignore[arg-type]


def named(problem: Problem) -> list[str]:
    """Return the individuals that behaviours mention by name, and the values that situation types start or rest with."""
    found: dict[str, None] = {}

    for behavior in problem.domain.behaviors.values():
        whens = [condition for effect in behavior.effects for condition in effect.when]
        for condition in (*behavior.preconditions, *whens):
            found.update(dict.fromkeys(term for inner in walk(condition) for term in terms(inner)))
        for effect in behavior.effects:
            found.update(dict.fromkeys((*effect.arguments, effect.value)))
    for situation in problem.domain.situations.values():
        found.update(dict.fromkeys(value for value in (situation.rest, situation.default) if value is not None))
    return sorted(term for term in found if not term.startswith("?"))


def _cost(entry: tuple[float, object, str]) -> float:
    return entry[0]


_COST = {ClassCondition: 0, EqualityCondition: 0, ValueCondition: 1, RelationCondition: 2, AnyOf: 3, Witness: 4}


def _ready(waiting: Sequence[Condition], bound: set[str], where: str) -> Condition:
    """Return the cheapest condition to test of those whose variables are bound."""
    ready = [condition for condition in waiting if not needs(condition) - bound]
    if not ready:
        raise nothing_determines(where, waiting, bound)
    return min(ready, key=lambda condition: _COST[type(condition)])


def _name(prefix: str, name: str) -> str:
    """Return an identifier for a term, in ASCII (Python takes µ for μ); distinct terms get distinct ones."""
    clean = re.sub(r"[^A-Za-z0-9]", lambda m: "__" if m[0] == "_" else f"_{ord(m[0]):x}_", name)
    return f"{prefix}_{clean}"


def _term(term: str) -> str:
    return _name("v", term[1:]) if term.startswith("?") else repr(term)


def _tuple(items: Iterator[str] | Sequence[str] | map[str]) -> str:
    return "(" + "".join(f"{item}, " for item in items) + ")"


def _key(arguments: Sequence[str]) -> str:
    return _term(arguments[0]) if len(arguments) == 1 else _tuple(map(_term, arguments))


@lru_cache(maxsize=32)
def _code(source: str) -> CodeType:
    return compile(source, "<compiled behaviours>", "exec")

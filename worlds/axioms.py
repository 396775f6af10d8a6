"""Random PDDL tasks with axioms.

Derived predicates are arranged in strata. An axiom may use predicates of its own stratum, and the truth or negation of
predicates of lower strata. Axioms, preconditions, conditions of effects and goals contain random formulas over
constants, equality and predicates with up to two arguments. A task is text, so that every planner parses it with its
own parser. `Plain` evaluates the tasks directly by the semantics of PDDL. `Plain` selects reachable goals, and serves
as an independent reference.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import product
from random import Random
from typing import Any, TypeAlias

Fact: TypeAlias = tuple[str, ...]
State: TypeAlias = frozenset[Fact]

MEMBERS = {"a": ("a1", "a2"), "b": ("b1", "b2", "b3")}
CONSTANTS = {"a": ("a1",), "b": ("b1",)}
"""Constants that the domain may name."""
CHANGED: Mapping[str, tuple[str, ...]] = {"f": (), "p": ("a",), "q": ("b",), "r": ("a", "b"), "s": ("b", "b")}
STATIC: Mapping[str, tuple[str, ...]] = {"e": ("b", "b")}
HEAD = "(:requirements :adl :derived-predicates) (:types a b - object) (:constants a1 - a b1 - b)"


class Formulas:
    """Writes random formulas.

    Parameters
    ----------
    rng : Random
    known : mapping of predicate to the types of its arguments
        Predicates whose truth or negation a condition may require.
    own : mapping of predicate to the types of its arguments
        Predicates of the same stratum, which occur only positively and not under a universal quantifier. Fast Downward reads a
        universal quantifier as a negated existential quantifier.
    """

    def __init__(self, rng: Random, known: Mapping[str, tuple[str, ...]], own: Mapping[str, tuple[str, ...]]) -> None:
        self.rng, self.known, self.own, self.names = rng, known, own, 0

    def variable(self, bound: dict[str, str]) -> str:
        """Return a new variable, which is added to `bound`."""
        self.names += 1
        bound[name := f"?x{self.names}"] = self.rng.choice(sorted(MEMBERS))
        return name

    def term(self, bound: Mapping[str, str], kind: str) -> str:
        """Return a bound variable or a constant of a type."""
        free = [name for name, its in bound.items() if its == kind]
        return self.rng.choice(free) if free and self.rng.random() < 0.93 else self.rng.choice(CONSTANTS[kind])

    def formula(self, bound: Mapping[str, str], depth: int = 2, helps: bool = True) -> str:
        """Return a random formula over bound variables that occurs positively if `helps` is true, otherwise negatively."""
        rng, deeper = self.rng, depth - 1
        match rng.choice((*("atom",) * 8, "same", "and", "or", "not", "imply", "exists", "forall")):
            case "same":
                kind = rng.choice(sorted(MEMBERS))
                said = f"(= {self.term(bound, kind)} {self.term(bound, kind)})"
                return said if rng.random() < 0.4 else f"(not {said})"
            case ("and" | "or") as word if depth:
                parts = [self.formula(bound, deeper, helps) for _ in range(rng.choice((2, 2, 3)))]
                return f"({word} {' '.join(parts)})"
            case "not" if depth:
                return f"(not {self.formula(bound, deeper, not helps)})"
            case "imply" if depth:
                return f"(imply {self.formula(bound, deeper, not helps)} {self.formula(bound, deeper, helps)})"
            case ("exists" | "forall") as word if depth:
                inner = dict(bound)
                new = self.variable(inner)
                own, self.own = self.own, self.own if (word == "exists") is helps else {}
                said = self.formula(inner, deeper, helps)
                self.own = own
                return f"({word} ({new} - {inner[new]}) {said})"
        name = rng.choice([*self.known, *self.own, *self.own])
        said = self.atom(name, bound)
        negated = not helps if name in self.own else rng.random() < 0.35
        return f"(not {said})" if negated else said

    def body(self, bound: Mapping[str, str]) -> str:
        """Return a conjunction of formulas over bound variables and up to two existentially quantified variables."""
        inner, rng = dict(bound), self.rng
        new = [self.variable(inner) for _ in range(rng.choice((0, 0, 1, 1, 2)))]
        parts = [self.formula(inner, rng.choice((0, 0, 0, 1, 2))) for _ in range(rng.choice((1, 2, 2, 3)))]
        said = f"(and {' '.join(parts)})"
        return f"(exists ({' '.join(f'{name} - {inner[name]}' for name in new)}) {said})" if new else said

    def atom(self, name: str, bound: Mapping[str, str]) -> str:
        """Return an atom of a predicate over random terms."""
        kinds = {**CHANGED, **self.known, **self.own}[name]
        return f"({' '.join([name, *(self.term(bound, kind) for kind in kinds)])})"


def axioms(rng: Random) -> tuple[str, str]:
    """Return a random PDDL domain with axioms, and a PDDL problem of the domain."""
    strata = _strata(rng)
    derived = {name: kinds for stratum in strata for name, kinds in stratum.items()}
    everything = {**CHANGED, **STATIC, **derived}
    said = [HEAD, "(:predicates " + " ".join(_declared(name, kinds) for name, kinds in everything.items()) + ")"]
    below: dict[str, tuple[str, ...]] = {**CHANGED, **STATIC}
    for stratum in strata:
        for name, kinds in stratum.items():
            for _ in range(rng.choice((1, 2, 2, 3))):
                bound = {f"?v{place}": kind for place, kind in enumerate(kinds)}
                said.append(f"(:derived {_declared(name, kinds)} {Formulas(rng, below, stratum).body(bound)})")
        below |= stratum
    said += [_action(rng, f"act{number}", everything) for number in range(rng.choice((4, 5, 6)))]
    objects = " ".join(f"{one} - {kind}" for kind, its in MEMBERS.items() for one in its if one not in CONSTANTS[kind])
    stated = [row for name in (*CHANGED, *STATIC) for row in _rows(everything[name], name) if rng.random() < 0.35]
    head = f"(define (problem one) (:domain random) (:objects {objects})\n (:init {' '.join(map(_said, stated))})"
    domain = f"(define (domain random) {chr(10).join(said)})"
    rows = [row for name, kinds in everything.items() for row in _rows(kinds, name)]
    wanted = _wanted(rng, Plain(domain), frozenset(stated), rows)
    return domain, f"{head}\n (:goal (and {' '.join(wanted)})))"


def _wanted(rng: Random, plain: Plain, state: State, rows: Sequence[Fact]) -> list[str]:
    """Return two to four goal literals, most of which hold at the end of a random walk."""
    first = now = plain.derived(state)
    for _ in range(rng.choice((4, 8, 16))):
        after = sorted(set(plain.successors(state)), key=sorted)
        state = rng.choice(after) if after else state
        now = plain.derived(state)
    changed = [row for row in rows if (row in first) is not (row in now)]
    odd = rng.random() < 0.3
    chosen = [rng.choice(changed if changed and rng.random() < 0.8 else rows) for _ in range(rng.choice((2, 3, 4)))]
    return [_said(row) if (row in now) is not (odd and rng.random() < 0.5) else f"(not {_said(row)})" for row in chosen]


def _strata(rng: Random) -> list[dict[str, tuple[str, ...]]]:
    """Return derived predicates in mutually recursive groups."""
    kinds = [(), ("a",), ("b",), ("b", "b"), ("a", "b")]
    return [
        {f"d{stratum}{number}": rng.choice(kinds) for number in range(rng.choice((1, 1, 2)))}
        for stratum in range(rng.choice((2, 3, 4)))
    ]


def _declared(name: str, kinds: Sequence[str]) -> str:
    return f"({' '.join([name, *(f'?v{place} - {kind}' for place, kind in enumerate(kinds))])})"


def _action(rng: Random, name: str, known: Mapping[str, tuple[str, ...]]) -> str:
    """Return an action with preconditions and up to three effects; effects may be conditional or universal."""
    formulas = Formulas(rng, known, {})
    bound = {f"?v{place}": rng.choice(sorted(MEMBERS)) for place in range(rng.choice((0, 1, 2, 2, 3)))}
    head = " ".join(f"{name} - {kind}" for name, kind in bound.items())
    effects = []
    for _ in range(rng.choice((1, 1, 2, 3))):
        inner = dict(bound)
        new = formulas.variable(inner) if rng.random() < 0.2 else ""
        said = formulas.atom(rng.choice(sorted(CHANGED)), inner)
        said = said if rng.random() < 0.6 else f"(not {said})"
        if rng.random() < 0.35:
            said = f"(when {formulas.formula(inner, 2)} {said})"
        effects.append(f"(forall ({new} - {inner[new]}) {said})" if new else said)
    asked = formulas.body(bound)
    return f"(:action {name} :parameters ({head}) :precondition {asked} :effect (and {' '.join(effects)}))"


def _rows(kinds: Sequence[str], *begin: str) -> list[Fact]:
    return [(*begin, *row) for row in product(*(MEMBERS[kind] for kind in kinds))]


def _said(row: Fact) -> str:
    return f"({' '.join(row)})"


class Plain:
    """A plain evaluator of PDDL tasks, which tries all individuals and evaluates all axioms in every state."""

    def __init__(self, domain: str) -> None:
        parts = parsed(domain)[2:]
        self.actions = [part for part in parts if part[0] == ":action"]
        self.strata: dict[str, list[Any]] = {}
        for part in parts:
            if part[0] == ":derived":
                self.strata.setdefault(part[1][0][:2], []).append(part[1:])

    def derived(self, state: State) -> State:
        """Return a state with all derived atoms, computed stratum by stratum."""
        found = set(state)
        for _, axioms_ in sorted(self.strata.items()):
            size = -1
            while size != len(found):
                size = len(found)
                for (name, *declared), body in axioms_:
                    for terms in _bindings(declared):
                        if (row := (name, *terms.values())) not in found and holds(body, terms, found):
                            found.add(row)
        return frozenset(found)

    def successors(self, state: State) -> Iterator[State]:
        """Yield the successors of a state."""
        now = self.derived(state)
        for _, _, _, declared, _, asked, _, effect in self.actions:
            for terms in _bindings(declared):
                if holds(asked, terms, now):
                    made = [*_changes(effect, terms, now)]
                    ended = {row for row, becomes in made if not becomes}
                    yield (state - ended) | {row for row, becomes in made if becomes}

    def shortest(self, problem: str) -> int | None:
        """Return the length of a shortest plan, or None if there is no plan."""
        *_, init, goal = parsed(problem)
        layer, seen, length = {frozenset(map(tuple, init[1:]))}, set[State](), 0
        while layer:
            if any(holds(goal[1], {}, self.derived(state)) for state in layer):
                return length
            seen |= layer
            layer = {after for state in layer for after in self.successors(state)} - seen
            length += 1
        return None


def parsed(text: str) -> Any:
    """Return PDDL as nested lists.

    >>> parsed("(and (p ?x) (f))")
    ['and', ['p', '?x'], ['f']]
    """
    stack: list[list[Any]] = [[]]
    for word in re.findall(r"[()]|[^()\s]+", text):
        if word == "(":
            stack.append([])
        elif word == ")":
            stack[-2].append(stack.pop())
        else:
            stack[-1].append(word)
    return stack[0][0]


def holds(formula: Any, terms: Mapping[str, str], state: Iterable[Fact]) -> bool:
    """Return whether a formula holds in a state for a binding of its variables."""
    word, *parts = formula
    match word:
        case "and":
            return all(holds(part, terms, state) for part in parts)
        case "or":
            return any(holds(part, terms, state) for part in parts)
        case "not":
            return not holds(parts[0], terms, state)
        case "imply":
            return not holds(parts[0], terms, state) or holds(parts[1], terms, state)
        case "exists" | "forall":
            tried = (holds(parts[1], {**terms, **more}, state) for more in _bindings(parts[0]))
            return any(tried) if word == "exists" else all(tried)
        case _:
            row = tuple(terms.get(part, part) for part in parts)
            return row[0] == row[1] if word == "=" else (word, *row) in state


def _bindings(declared: Sequence[str]) -> Iterator[dict[str, str]]:
    for row in product(*(MEMBERS[kind] for kind in declared[2::3])):
        yield dict(zip(declared[::3], row, strict=True))


def _changes(effect: Any, terms: Mapping[str, str], state: State) -> Iterator[tuple[Fact, bool]]:
    """Yield each fact that an effect changes, with its new truth value."""
    word, *parts = effect
    match word:
        case "and":
            for part in parts:
                yield from _changes(part, terms, state)
        case "when":
            if holds(parts[0], terms, state):
                yield from _changes(parts[1], terms, state)
        case "forall":
            for more in _bindings(parts[0]):
                yield from _changes(parts[1], {**terms, **more}, state)
        case "not":
            yield from ((row, False) for row, _ in _changes(parts[0], terms, state))
        case _:
            yield (word, *(terms.get(part, part) for part in parts)), True

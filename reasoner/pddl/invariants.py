"""Invariant synthesis for a PDDL domain.

An invariant is a set of predicates; in every reachable state, at most one fact with these predicates holds for each object. The
predicates of an invariant form one state variable of the object. The search for an invariant starts with a guess that contains one
changing predicate. The guess is proved if every action that adds a fact of the invariant also deletes a fact of the invariant. If
the proof fails for an action, a predicate that the action deletes is added to the guess. For example, the predicate *in* is added
to the predicate *at*.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

from confab.reasoner.pddl.declarations import Action, Pddl
from confab.reasoner.pddl.forms import Atom, PddlEffect, atoms_in, conjuncts, words_of
from confab.reasoner.pddl.words import Form

COUNTED: Mapping[int, tuple[tuple[int, int | None], ...]] = {1: ((0, None),), 2: ((0, 1), (1, 0))}
"""The possible positions of the object and of the value among a predicate's arguments, by the number of arguments."""


@dataclass(frozen=True)
class InvariantPart:
    """A predicate of an invariant, with the positions of the object (`key`) and of the value (`counted`) among its arguments.

    For a predicate of one argument, `counted` is None, and the predicate itself is the value.
    """

    predicate: str
    key: int
    counted: int | None


@dataclass
class Invariants:
    """Search for the invariants of a domain.

    Parameters
    ----------
    pddl : Pddl
    effects : mapping of action to its effects
    changing : set of str
        The predicates that invariants may contain.
    fluent : set of str
        All predicates whose facts change.
    sets : mapping of type to its objects
    """

    pddl: Pddl
    effects: Mapping[str, Sequence[PddlEffect]]
    changing: frozenset[str]
    fluent: frozenset[str]
    sets: Mapping[str, frozenset[str]]

    def found(self) -> list[tuple[InvariantPart, ...]]:
        """Return the proved invariants; no predicate is in two of them. Each invariant is a tuple of its parts."""
        candidates: list[tuple[InvariantPart, ...]] = [
            (InvariantPart(predicate, key, counted),)
            for predicate, signature in self.pddl.predicates.items()
            if predicate in self.changing
            for key, counted in COUNTED.get(len(signature), ())
        ]
        proved: list[tuple[InvariantPart, ...]] = []
        seen = set(candidates)
        while candidates:
            parts = candidates.pop(0)
            extra = self.unbalanced(parts)
            if extra is None:
                proved.append(parts)
            for part in extra or ():
                larger = tuple(sorted((*parts, part), key=lambda p: p.predicate))
                if larger not in seen and len(seen) < 300 and len({p.predicate for p in larger}) == len(larger):
                    seen.add(larger)
                    candidates.append(larger)
        proved = [parts for parts in proved if self.at_most_one(parts) and any(p.counted is not None for p in parts)]
        proved = [parts for parts in proved if self.distinguishable(parts)]
        proved.sort(key=lambda parts: (-len(parts), sum(p.key for p in parts), [p.predicate for p in parts]))
        used: set[str] = set()
        found = []
        for parts in proved:
            if not used & {p.predicate for p in parts}:
                used |= {p.predicate for p in parts}
                order = {predicate: i for i, predicate in enumerate(self.pddl.predicates)}
                found.append(tuple(sorted(parts, key=lambda p: (p.counted is None, order[p.predicate]))))
        return found

    def at_most_one(self, parts: Sequence[InvariantPart]) -> bool:
        """Return whether at most one fact of the invariant holds for each object in the initial state."""
        of = {part.predicate: part for part in parts}
        count = Counter(fact[1 + of[fact[0]].key] for fact in dict.fromkeys(self.pddl.initial) if fact[0] in of)
        return all(number == 1 for number in count.values())

    def distinguishable(self, parts: Sequence[InvariantPart]) -> bool:
        """Return whether at most one predicate of the invariant can relate a given object and a given value."""
        counted = [p for p in parts if p.counted is not None]
        of = {p.predicate: p for p in counted}
        for predicate, domains in self.mentioned:
            for other in counted:
                if predicate in of and other.predicate != predicate:
                    part = of[predicate]
                    keys = domains[part.key] & self.possible[other.predicate][other.key]
                    values = domains[part.counted or 0] & self.possible[other.predicate][other.counted or 0]
                    if keys and values:
                        return False
        return True

    @cached_property
    def possible(self) -> dict[str, list[frozenset[str]]]:
        """For each predicate, the objects that may occur at each argument position in a fact of a reachable state."""
        found = {name: [set[str]() for _ in signature] for name, signature in self.pddl.predicates.items()}
        for fact in self.pddl.initial:
            for position, thing in enumerate(fact[1:]):
                found[fact[0]][position].add(thing)
        for name, action in self.pddl.actions.items():
            for effect in self.effects[name]:
                own = {v.name: self.sets[v.type] for v in effect.variables}
                for position, term in enumerate(effect.atom[1:]):
                    found[effect.atom[0]][position] |= own.get(term) or self.domain_of(action, term)
        return {name: [frozenset(things) for things in positions] for name, positions in found.items()}

    @cached_property
    def mentioned(self) -> list[tuple[str, list[frozenset[str]]]]:
        """The predicate of every atom in conditions, effects and goals, with the objects that each of its terms may denote."""
        found = []
        for _name, action in self.pddl.actions.items():
            forms = [form for form in (action.precondition, action.effect) if form]
            for atom, own in [pair for form in forms for pair in atoms_in(form, self.pddl.predicates, {})]:
                found.append(
                    (atom[0], [self.sets[own[t]] if t in own else self.domain_of(action, t) for t in atom[1:]])
                )
        others = [(axiom.condition, {p.name: p.type for p in axiom.parameters}) for axiom in self.pddl.axioms]
        goals = [form for form in (self.pddl.goal, *self.pddl.preferences.values()) if form]
        for form, types in [*others, *((goal, dict[str, str]()) for goal in goals)]:
            for atom, own in atoms_in(form, self.pddl.predicates, types):
                found.append((atom[0], [self.sets[own[t]] if t in own else frozenset({t}) for t in atom[1:]]))
        return found

    def domain_of(self, action: Action, term: str) -> frozenset[str]:
        """Return the objects that a term of an action may denote, according to the term's type and static preconditions."""
        if not term.startswith("?"):
            return frozenset({term})
        kind = next((p.type for p in action.parameters if p.name == term), "object")
        domain = self.sets[kind]
        for form in conjuncts(action.precondition):
            atom = words_of(form) if form.head in self.pddl.predicates else ()
            if len(atom) == 2 and atom[1] == term and atom[0] not in self.fluent:
                domain &= {fact[1] for fact in self.pddl.initial if fact[0] == atom[0]}
        return domain

    def unbalanced(self, parts: Sequence[InvariantPart]) -> list[InvariantPart] | None:
        """Return None if every action preserves the invariant; otherwise return parts whose addition might repair the invariant."""
        of = {part.predicate: part for part in parts}
        for name, action in self.pddl.actions.items():
            effects = self.effects[name]
            adds = [e for e in effects if e.true and e.atom[0] in of]
            needed = {words_of(form) for form in conjuncts(action.precondition) if form.head not in ("not", "or", "=")}
            for one, other in combinations(adds, 2):
                same_key = self.may_be_one(
                    action, one.atom[1 + of[one.atom[0]].key], other.atom[1 + of[other.atom[0]].key]
                )
                if one.atom != other.atom and same_key:
                    return []
            spent: set[Atom] = set()
            for add in adds:
                key = add.atom[1 + of[add.atom[0]].key]
                if add.variables and not {t for t in add.atom if t in [v.name for v in add.variables]} <= {key}:
                    return []
                held = needed | {words_of(f) for form in add.when for f in conjuncts(form)}
                if add.atom in held:
                    continue
                deleted = [
                    e.atom
                    for e in effects
                    if not e.true
                    and e.atom in held
                    and e.atom not in spent
                    and e.atom != add.atom
                    and (not e.when or e.when == add.when)
                    and e.variables in ((), add.variables)
                ]
                match = next((a for a in deleted if a[0] in of and a[1 + of[a[0]].key] == key), None)
                if match:
                    spent.add(match)
                    continue
                return [
                    InvariantPart(atom[0], position, counted)
                    for atom in deleted
                    if atom[0] not in of and len(atom) <= 3
                    for position, term in enumerate(atom[1:])
                    if term == key
                    for counted in ([None] if len(atom) == 2 else [1 - position])
                ]
        return None

    def may_be_one(self, action: Action, one: str, other: str) -> bool:
        """Return whether two terms of an action may denote the same object."""
        if one == other:
            return True
        for form in conjuncts(action.precondition):
            inner = form.items[1] if form.head == "not" else form
            if form is not inner and isinstance(inner, Form) and {*words_of(inner)} == {"=", one, other}:
                return False
        return bool(self.domain_of(action, one) & self.domain_of(action, other))

"""Extra predicates of an exported domain, which express "no individual of a class has this value" without quantifiers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from confab.reasoner.pddl.formulas import Atom, PddlTerm
from confab.reasoner.pddl.vocabulary import PddlNames
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import Behavior, Condition, ValueCondition, Witness


class NegationPredicates:
    """The extra predicates that an export declares for the negative preconditions of its behaviours.

    `contrary` maps a situation type to values; for each of these values, the export needs a predicate ``not_TYPE``, whose arguments
    are an individual and the value. `free` maps a class and a situation type to values that at most one individual can have at a
    time; for each of these values, the export needs only a predicate ``no_CLASS_has_TYPE``, whose argument is the value.
    """

    def __init__(self, problem: Problem, behaviors: Sequence[Behavior], words: PddlNames) -> None:
        self.problem, self.behaviors, self.words = problem, behaviors, words
        self.contrary: dict[str, set[str]] = {}
        self.free: dict[tuple[str, str], frozenset[str]] = {}
        for behavior in behaviors:
            for condition in behavior.preconditions:
                if absent := self.absent(condition):
                    self.keep(behavior, *absent)

    def absent(self, condition: Condition) -> tuple[str, str, str] | None:
        """Return class, situation type and value of a condition "no individual of the class has this value", else None."""
        match condition:
            case Witness(variable, kind, (ValueCondition(situation, (about,), value, False),), True):
                known = situation not in self.problem.domain.rules and not self.words.situations[situation].boolean
                if about == variable != value and known:
                    return kind, situation, value
            case _:
                pass
        return None

    def keep(self, behavior: Behavior, kind: str, situation: str, value: str) -> None:
        """Record the extra predicate that a negative precondition of a behaviour needs."""
        if (kind, situation) not in self.free and self.exclusive(kind, situation):
            self.free[kind, situation] = self.asked(kind, situation)
        if (kind, situation) not in self.free:
            self.contrary.setdefault(situation, set()).update(self.members(behavior, value))

    def members(self, behavior: Behavior, term: str) -> frozenset[str]:
        """Return the individuals that a term of a behaviour can denote."""
        return self.problem.members(behavior.kinds[term]) if term in behavior.kinds else frozenset((term,))

    def asked(self, kind: str, situation: str) -> frozenset[str]:
        """Return the values that occur in preconditions "no individual of the class has this value"."""
        found = frozenset[str]()
        for behavior in self.behaviors:
            for absent in map(self.absent, behavior.preconditions):
                if absent and absent[:2] == (kind, situation):
                    found |= self.members(behavior, absent[2])
        return found

    def exclusive(self, kind: str, situation: str) -> bool:
        """Return whether each value of `asked` can belong to at most one individual of a class at a time."""
        asked, its = self.asked(kind, situation), self.problem.members(kind)
        held = [v for s, v in self.problem.initial.items() if s.situation == situation and s.arguments[0] in its]
        held = [value for value in held if value in asked]
        if len(held) > len(set(held)):
            return False
        for behavior in self.behaviors:
            empty = {a[2] for a in map(self.absent, behavior.preconditions) if a and a[:2] == (kind, situation)}
            filling = [
                effect
                for effect in behavior.effects
                if effect.situation == situation
                and self.members(behavior, effect.arguments[0]) & its
                and self.members(behavior, effect.value) & asked
            ]
            if len(filling) > 1 or any(effect.when or effect.value not in empty for effect in filling):
                return False
        return True

    def lacks(self, situation: str, terms: tuple[PddlTerm, ...], value: PddlTerm) -> Atom:
        """Return the atom of ``not_TYPE``: the symbol doesn't have the value."""
        words = self.words
        name = words.name("predicate", f"not {situation}", f"not_{situation}")
        return words.atom(name, (*words.about(situation, terms), value))

    def none_has(self, kind: str, situation: str, value: PddlTerm) -> Atom:
        """Return the atom of ``no_CLASS_has_TYPE``: no individual of the class has the value."""
        name = self.words.name("predicate", f"free {kind} {situation}", f"no_{kind}_has_{situation}")
        return self.words.atom(name, (value,))

    def facts(self) -> Iterator[Atom]:
        """Yield the atoms of the extra predicates that hold in the initial state."""
        state = self.problem.initial
        for situation, values in sorted(self.contrary.items()):
            for symbol, has in state.items():
                if symbol.situation == situation:
                    terms = self.words.terms(symbol.arguments, {})
                    yield from (self.lacks(situation, terms, self.words.object(v)) for v in sorted(values - {has}))
        for (kind, situation), asked in self.free.items():
            its = self.problem.members(kind)
            held = {has for s, has in state.items() if s.situation == situation and s.arguments[0] in its}
            yield from (self.none_has(kind, situation, self.words.object(v)) for v in sorted(asked - held))

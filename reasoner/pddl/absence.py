"""Extra predicates of an exported domain, which express "no individual of a class has this value" without quantifiers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from confab.reasoner.language import is_variable, plain_variables
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
        asked: dict[tuple[str, str], frozenset[str]] = {}
        for behavior in behaviors:
            for kind, situation, value in self.absences(behavior):
                known = asked.get((kind, situation), frozenset[str]())
                asked[kind, situation] = known | words.denoted(behavior, value)
        self.free = {key: values for key, values in asked.items() if self.exclusive(*key, values)}
        self.contrary: dict[str, set[str]] = {}
        for (kind, situation), values in asked.items():
            if (kind, situation) not in self.free:
                self.contrary.setdefault(situation, set()).update(values)

    def absent(self, behavior: Behavior, condition: Condition) -> tuple[str, str, str] | None:
        """Return class, situation type and value of a precondition "no individual of the class has this value", else None.

        "No individual of the class has any of these values" isn't such a precondition: the value is local to the condition.
        """
        match condition:
            case Witness(variable, kind, (ValueCondition(situation, (about,), value, False),), True):
                known = situation not in self.problem.domain.rules and not self.words.situations[situation].boolean
                bound = {p.name for p in behavior.parameters} | plain_variables(behavior.preconditions)
                if about == variable != value and known and (value in bound or not is_variable(value)):
                    return kind, situation, value
            case _:
                pass
        return None

    def absences(self, behavior: Behavior) -> Iterator[tuple[str, str, str]]:
        """Yield class, situation type and value of the preconditions "no individual of the class has this value"."""
        yield from (found for one in behavior.preconditions if (found := self.absent(behavior, one)))

    def exclusive(self, kind: str, situation: str, asked: frozenset[str]) -> bool:
        """Return whether each of some values can belong to at most one individual of a class at a time."""
        its, denoted = self.problem.members(kind), self.words.denoted
        held = [v for s, v in self.problem.initial.items() if s.situation == situation and s.arguments[0] in its]
        held = [value for value in held if value in asked]
        if len(held) > len(set(held)):
            return False
        for behavior in self.behaviors:
            empty = {a[2] for a in self.absences(behavior) if a[:2] == (kind, situation)}
            filling = [
                effect
                for effect in behavior.effects
                if effect.situation == situation
                and denoted(behavior, effect.arguments[0]) & its
                and denoted(behavior, effect.value) & asked
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

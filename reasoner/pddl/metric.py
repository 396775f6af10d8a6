"""The metric of a PDDL problem as a weighted sum of functions and of violated preferences."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property

from confab.reasoner.pddl.declarations import Pddl
from confab.reasoner.pddl.forms import Atom, numeric_of, words_of
from confab.reasoner.pddl.words import Form, PddlError, PddlWord

TOTAL_COST, TOTAL_TIME = ("total-cost",), ("total-time",)
VIOLATED = "is-violated"
Sum = Mapping[Atom, Fraction]
"""A sum of terms with their factors; the constant has the key ``()``."""


@dataclass
class Metric:
    """A metric whose terms have been checked against the declarations.

    Parameters
    ----------
    pddl : Pddl
    fail : callable
        A function that returns the error for a part of the text and a message.
    """

    pddl: Pddl
    fail: Callable[[PddlWord | Form, str], PddlError]
    places: dict[Atom, Form] = field(default_factory=dict)  # where each term is in the text

    @cached_property
    def changed(self) -> frozenset[str]:
        """The functions that actions change."""
        return frozenset(e.function.head for action in self.pddl.actions.values() for e in numeric_of(action.effect))

    def weights(self, form: Form) -> dict[str, Fraction] | None:
        """Return the weight of each function and of each ``is-violated NAME``, or None if the metric is only ``(total-time)``.

        Raises
        ------
        PddlError
            The cost of a plan isn't the sum of its actions' costs and of the weights of violated preferences.
        """
        terms = {term: factor for term, factor in self.sum(form).items() if term}
        time = terms.pop(TOTAL_TIME, None)
        if time is not None and time < 0:
            raise self.fail(self.places[TOTAL_TIME], "(total-time) must have a positive weight in the metric")
        found: dict[str, Fraction] = {}
        for term, factor in terms.items():
            if term[0] == VIOLATED:
                if factor < 0:
                    raise self.fail(self.places[term], f"the violation of preference '{term[1]}' reduces the metric")
                found[" ".join(term)] = factor
                continue
            others = [words for words in self.pddl.numbers if words[0] == term[0]]
            if any(terms.get(words, 0) != factor for words in others):
                said = f"the terms of '{term[0]}' must have the same weight in the metric for all objects"
                raise self.fail(self.places[term], said)
            self.check(term)
            found[term[0]] = factor
        return None if time is not None and not found else found

    def check(self, term: Atom) -> None:
        """Raise an error if an action changes a function of the metric in another way than by adding to it in each case."""
        for name, action in self.pddl.actions.items():
            for effect in numeric_of(action.effect):
                if effect.function.head == term[0] and (effect.when or effect.head not in ("increase", "decrease")):
                    how = "under a condition" if effect.when else f"by '{effect.head}'"
                    said = f"action '{name}' changes '{term[0]}' {how}; a function of the metric may only be increased"
                    raise self.fail(self.places[term], said)

    def sum(self, item: PddlWord | Form) -> Sum:
        """Return an expression as a sum.

        Raises
        ------
        PddlError
            The expression isn't linear.
        """
        if isinstance(item, PddlWord):
            return {(): Fraction(item.text)}
        if item.head not in ("+", "-", "*", "/"):
            term = words_of(item)
            if term in (TOTAL_COST, TOTAL_TIME) or item.head == VIOLATED or item.head in self.changed:
                self.places.setdefault(term, item)
                return {term: Fraction(1)}
            if term not in self.pddl.numbers:
                raise self.fail(item, f"({' '.join(term)}) has no number in :init")
            return {(): self.pddl.numbers[term]}
        first, *others = [self.sum(one) for one in item.items[1:]]
        if item.head == "-" and not others:
            first, others = {}, [first]
        for other in others:
            if item.head in ("+", "-"):
                sign = 1 if item.head == "+" else -1
                first = {term: first.get(term, Fraction(0)) + sign * other.get(term, 0) for term in {**first, **other}}
                continue
            if item.head == "*" and not first.keys() - {()}:
                first, other = other, first
            factor = other.get((), Fraction(0))
            if other.keys() - {()} or (item.head == "/" and not factor):
                raise self.fail(item, f"the metric must be a weighted sum; ({item.head} …) isn't")
            first = {term: one * factor if item.head == "*" else one / factor for term, one in first.items()}
        return {term: factor for term, factor in first.items() if factor}

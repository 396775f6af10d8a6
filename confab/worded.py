"""Recognition of behaviours and facts that are written in the words of their labels, as in explanations."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from itertools import product

from confab.labels import Labels
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import FALSE, TRUE, Behavior, Fact, Symbol


def worded_behavior(problem: Problem, labels: Labels, text: str) -> tuple[Behavior, Mapping[str, str]] | None:
    """Return the behaviour that a text expresses as a sentence, with the individuals of its roles, or None.

    Roles that the text doesn't mention have no individual.
    """
    asked = _with_labels(problem, labels, text)
    for behavior in problem.domain.behaviors.values():
        roles = [each.name for each in behavior.parameters]
        pools = [(None, *_mentioned(problem, labels, asked, behavior.kinds[role])) for role in roles]
        for chosen in product(*pools):
            terms = {role: one for role, one in zip(roles, chosen, strict=True) if one is not None}
            if labels.behavior(behavior, terms).lower() == asked:
                return behavior, terms
    return None


def worded_fact(problem: Problem, labels: Labels, text: str) -> Fact | None:
    """Return the fact that a text expresses as a sentence, or None if there is no such fact."""
    asked = _with_labels(problem, labels, text)
    for situation in problem.domain.situations.values():
        pools = [list(_mentioned(problem, labels, asked, kind)) for kind in situation.arguments]
        values = [TRUE, FALSE] if situation.boolean else list(problem.classes.get(situation.range, ()))
        for *about, value in product(*pools, values):
            fact = Fact(Symbol(situation.name, tuple(about)), value)
            if labels.fact(fact).lower() == asked:
                return fact
    return None


def _with_labels(problem: Problem, labels: Labels, text: str) -> str:
    """Return a text in lower case, in which labels replace the names of individuals."""
    known = problem.individuals
    return " ".join(labels.name(word) if word in known else word for word in text.split()).lower()


def _mentioned(problem: Problem, labels: Labels, text: str, kind: str) -> Iterator[str]:
    """Yield the members of a class whose labels a text contains."""
    members: Iterable[str] = problem.classes.get(kind, ())
    return (member for member in members if labels.name(member).lower() in text)

"""Situated affordances: the behaviours that each object affords in a state."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from confab.planner.applicable import joins
from confab.planner.derived_facts import CompiledRules
from confab.planner.transitions import PythonWriter, Table, arguments_of, key_of
from confab.reasoner.amounts import Amount, inside
from confab.reasoner.limits import check, checked
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import Comparison, Condition, Fact, State, Symbol, ValueCondition


@dataclass(frozen=True, order=True)
class Affordance:
    """A behaviour that an object affords in a situation.

    Attributes
    ----------
    object : str
    behavior : str
    arguments : tuple of str
        The arguments of the behaviour, including the object.
    situation : tuple of Fact
        The facts that satisfy positive value conditions among the preconditions, and the amounts that preconditions compare.
    effect : tuple of Fact
        The values and amounts that the behaviour's effects give.
    """

    object: str
    behavior: str
    arguments: tuple[str, ...]
    situation: tuple[Fact, ...]
    effect: tuple[Fact, ...]


def affordances(problem: Problem, state: State | None = None, of: str | None = None) -> list[Affordance]:
    """Return the sorted affordances of an object, or of all objects, in a state (by default the initial state)."""
    domain, writer = problem.domain, PythonWriter(problem)
    table = Table(domain.situations, problem.initial if state is None else state)
    if domain.rules:
        CompiledRules(writer).define(table)
    lines = [line for behavior in domain.behaviors.values() for line in writer.forward(behavior)]
    forward = writer.function(["forward = {}", *lines], "forward")(table.now, table.holders)
    found = defaultdict[str, list[Affordance]](list)
    for name, join in joins(writer, domain.behaviors.values(), table).items():
        behavior = domain.behaviors[name]
        terms = [p.name for p in behavior.parameters] + [f"?{variable}" for variable in writer.variables[name]]
        for arguments in checked(join(), "listing affordances"):
            done = forward[name](*arguments) if of is None or of in arguments else None
            if done is None:
                continue
            bindings = dict(zip(terms, (*arguments, *done[0]), strict=True))
            after = {(situation, key): value for situation, key, value in done[1] if situation in domain.authored}
            situation = tuple(sorted({*_facts(behavior.asked, bindings, table)}))
            effect = tuple(sorted(Fact(Symbol(at, arguments_of(key)), value) for (at, key), value in after.items()))
            about = {individual for fact in (*situation, *effect) for individual in fact.symbol.arguments[:1]}
            for one in dict.fromkeys(arguments):
                if one in about and of in (None, one):
                    found[one].append(Affordance(one, name, arguments, situation, effect))
    every: list[Affordance] = []
    for one in sorted(found):
        check("sorting affordances")
        every += sorted(found[one])
    return every


def _facts(conditions: Sequence[Condition], bindings: Mapping[str, str], table: Table) -> Iterator[Fact]:
    """Yield the facts of positive value conditions, and the amounts that comparisons name, for the given variable bindings."""

    def symbol(said: ValueCondition | Amount) -> Symbol:
        return Symbol(said.situation, tuple(bindings.get(argument, argument) for argument in said.arguments))

    for condition in conditions:
        if isinstance(condition, ValueCondition) and not condition.negated:
            yield Fact(symbol(condition), bindings.get(condition.value, condition.value))
        elif isinstance(condition, Comparison):
            for part in (*inside(condition.left), *inside(condition.right)):
                if isinstance(part, Amount):
                    amount = table.now[part.situation].get(key_of(symbol(part).arguments))
                    if amount is not None:
                        yield Fact(symbol(part), amount)

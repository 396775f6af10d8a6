"""Several constraints of random worlds: on every state, and on the order of states as ``c:atMostOnce`` and ``c:onlyAfter``."""

from __future__ import annotations

from dataclasses import replace
from random import Random

from confab.reasoner.derivation import circular
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import FALSE, TRUE, Constraint, Parameter, Rule, SituationType, ValueCondition
from worlds.interpreter import Interpreter

MOST, TRIES = 3, 12
"""Maximum number of constraints that a problem gets, and number of attempts to draw constraints that hold initially."""


def with_constraints(seed: int, problem: Problem, share: float) -> Problem:
    """Return a problem; in a share of the worlds, it gets several constraints, all of which hold initially."""
    rng = Random(f"several {seed}")
    if rng.random() >= share:
        return problem
    kinds = [
        one
        for one in problem.domain.situations.values()
        if one.boolean and one.name not in circular(problem.domain.rules)
    ]
    most = len(problem.domain.constraints) + rng.choice((2, 2, MOST))
    for _ in range(TRIES if kinds else 0):
        changed = [one for one in kinds if not _derived(problem, one.name)]
        of = rng.choice(rng.choice((changed or kinds, kinds)))
        alike = [one.name for one in kinds if one.arguments == of.arguments and one is not of]
        match rng.choice(("never", "always", "once", "once", "after", "after")):
            case "once":
                other = _at_most_once(problem, of)
            case "after" if alike:
                other = _only_after(problem, of, rng.choice(alike))
            case word:
                constraint = Constraint(of.name, word == "always")
                constraints = {**problem.domain.constraints, f"{of.name}.exceptions": constraint}
                other = replace(problem, domain=replace(problem.domain, constraints=constraints))
        if other is not None and len(other.domain.constraints) <= most and _kept(other):
            problem = other
    return problem


def stated(problem: Problem, name: str) -> list[str]:
    """Return the properties of a situation type that state its constraints."""
    found = []
    for one in problem.domain.constraints.values():
        if one.situation == name:
            found.append(f"c:{'always' if one.always else 'never'} true")
        elif one.situation == f"{name}.again":
            found.append("c:atMostOnce true")
        elif one.situation.startswith(f"{name}.before."):
            found.append(f"c:onlyAfter :{one.situation.removeprefix(f'{name}.before.')}")
    return found


def _derived(problem: Problem, name: str) -> bool:
    return name in problem.domain.rules or name in problem.domain.remembers


def _kept(problem: Problem) -> bool:
    """Return whether all constraints hold initially."""
    meant = Interpreter(problem)
    facts = {**{s: meant.initial[i] for s, i in meant.slots.items()}, **meant.constants}
    wanted = {one.situation: TRUE if one.always else FALSE for one in problem.domain.constraints.values()}
    return all(value == wanted.get(symbol.situation, value) for symbol, value in facts.items())


def _at_most_once(problem: Problem, of: SituationType) -> Problem | None:
    """Return a problem in which a situation, after it has been true and then false, is never true again."""
    name = of.name
    if f"{name}.again" in problem.domain.situations:
        return None
    problem = _remembering(problem, f"{name}.begun", name)
    problem = _both(problem, f"{name}.over", f"{name}.begun", name, FALSE)
    problem = _remembering(problem, f"{name}.ended", f"{name}.over")
    return _never(_both(problem, f"{name}.again", name, f"{name}.ended", TRUE), f"{name}.again")


def _only_after(problem: Problem, of: SituationType, other: str) -> Problem | None:
    """Return a problem in which a situation is true only if another one was true in an earlier state."""
    name = of.name
    if f"{name}.before.{other}" in problem.domain.situations:
        return None
    problem = _both(problem, f"{name}.without.{other}", other, name, FALSE)
    problem = _remembering(problem, f"{name}.after.{other}", f"{name}.without.{other}")
    before = f"{name}.before.{other}"
    return _never(_both(problem, before, name, f"{name}.after.{other}", FALSE), before)


def _remembering(problem: Problem, name: str, source: str) -> Problem:
    domain = problem.domain
    remembers = {**domain.remembers, name: source}
    return _with(
        replace(problem, domain=replace(domain, remembers=remembers)), name, domain.situations[source].level, source
    )


def _both(problem: Problem, name: str, true: str, other: str, value: str) -> Problem:
    """Return a problem with a situation type that is true if `true` is true and `other` has a value."""
    domain = problem.domain
    head = tuple(Parameter(f"?argument{i}", kind) for i, kind in enumerate(domain.situations[true].arguments))
    terms = tuple(one.name for one in head)
    rule = Rule(name, head, (), (ValueCondition(true, terms, TRUE), ValueCondition(other, terms, TRUE, value == FALSE)))
    level = max(domain.situations[one].level for one in (true, other))
    return _with(replace(problem, domain=replace(domain, rules={**domain.rules, name: (rule,)})), name, level, true)


def _with(problem: Problem, name: str, level: int, like: str) -> Problem:
    situations = problem.domain.situations
    kind = SituationType(name, situations[like].arguments, "Truth", level, boolean=True, default=FALSE, added=True)
    return replace(problem, domain=replace(problem.domain, situations={**situations, name: kind}))


def _never(problem: Problem, name: str) -> Problem:
    constraints = {**problem.domain.constraints, f"{name}.exceptions": Constraint(name)}
    return replace(problem, domain=replace(problem.domain, constraints=constraints))

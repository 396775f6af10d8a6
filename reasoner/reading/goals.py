"""Goals: reading of a task's goals, and parsing of goals that users write."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import chain

from confab.reasoner.aggregates.extrema import with_extrema
from confab.reasoner.amounts import DECIMAL, Amount, bounds_written, written
from confab.reasoner.closure import closure
from confab.reasoner.derivation import TASK, needed
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.language import is_variable, mentions, substituted, terms, walk
from confab.reasoner.local_variables import rule_named_apart
from confab.reasoner.names import nearest
from confab.reasoner.problem import Domain, Problem
from confab.reasoner.reading.parts import Parts, with_classes
from confab.reasoner.reading.rows import is_a
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    Comparison,
    Condition,
    Fact,
    Parameter,
    Rule,
    SituationType,
    Symbol,
    Times,
    ValueCondition,
    Witness,
)

BOUNDS = re.compile(rf"((<=?|>=?|=)?{DECIMAL.pattern})(,(<=?|>=?|=)?{DECIMAL.pattern})*")
"""Notation of a number or bounds in a goal on an amount."""


def with_goals(problem: Problem, goals: Iterable[str]) -> Problem:
    """Return a problem in which goals such as ``cup2 LOCATION location8`` replace the task's goals for the same symbols.

    Raises
    ------
    KnowledgeError
        A word is unknown, an object doesn't have the situation type, or two goals contradict each other.
    """
    given: dict[Symbol, str] = {}
    for fact in goals:
        symbol, value = parse_fact(problem, fact)
        aggregate = problem.domain.aggregates.get(symbol.situation)
        if aggregate is not None and not aggregate.kept:
            raise KnowledgeError(
                f"'{fact}': {symbol.situation} is a {aggregate.function}; state such a goal in the scene, as a c:Comparison"
            )
        if given.setdefault(symbol, value) != value:
            raise KnowledgeError(f"there are two goals for {symbol}: {given[symbol]} and {value}; give only one")
    others = problem.without_goals(given)
    return replace(others, goal=dict(sorted({**others.goal, **given}.items())))


def parse_fact(problem: Problem, fact: str) -> tuple[Symbol, str]:
    """Return the symbol and the value of a fact in the notation ``object SITUATION [argument …] value``.

    Raises
    ------
    KnowledgeError
        A word is unknown; the message suggests the most similar known name.
    """
    words = fact.split()
    individuals, known = problem.individuals, problem.domain.situations
    authored = [name for name in known if name in problem.domain.authored]
    about, name, *rest = words if len(words) > 1 else ("", "")
    if name not in known and (len(words) < 3 or about not in individuals):
        example = next((f", e.g. '{Fact(*one)}'" for one in chain(problem.goal.items(), problem.initial.items())), "")
        meant = _with_situation(problem, words) or (nearest(name, authored) if len(words) > 2 else "")
        wanted = f"wanted 'object SITUATION value'{example}{_not_one_fact(words) or meant}"
        raise KnowledgeError(f"'{fact}' is no fact; {wanted}")
    if about not in individuals:
        if about in problem.classes and name in known:
            node = f"a c:ValueCondition ; c:about :{about} ; c:situationType :{name} ; …"
            raise KnowledgeError(
                f"'{fact}': {about} is a class, and each fact is about one individual ({some_of(problem.classes[about])}); "
                f"the goal that each {about} has this value is written in the scene: :task c:goal [ {node} ]"
            )
        members = problem.classes.get(known[name].arguments[0], ()) if name in known else ()
        hint = f"{name} is of {some_of(members)}" if members else ""
        raise KnowledgeError(f"unknown individual '{about}' in '{fact}'{nearest(about, individuals, hint)}")
    if name not in known:
        meant = next((each for each, situation in known.items() if name in situation.properties), "")
        near = nearest(name, authored) or _with_situation(problem, words)
        if not meant and name in problem.relations:
            raise KnowledgeError(
                f"'{fact}': {name} is a relation, which never changes, and a fact or goal is about a situation; change "
                f"{name} in the file of the scene"
            )
        hint = f"; it is the value property of {meant}" if meant else near
        raise KnowledgeError(f"unknown situation type '{name}' in '{fact}'{hint} (known: {', '.join(authored)})")
    situation = known[name]
    if situation.boolean and len(rest) == len(situation.arguments) - 1:
        rest.append(TRUE)
    if len(rest) != len(situation.arguments):
        many = len(situation.arguments)
        after = "one word" if many == 1 else f"{many} words"
        if len(rest) > many and rest[-1] == FALSE and not situation.boolean:
            about = f"a c:ValueCondition ; c:about :{about} ; c:situationType :{name} ; c:value :{rest[-2]} ; c:negated true"
            raise KnowledgeError(
                f"'{fact}': only a situation that is true or false can be false; state another value of {name} "
                f"({some_of(problem.classes.get(situation.range, ()))}), or write the goal that it isn't {rest[-2]} in the scene: "
                f":task c:goal [ {about} ]"
            )
        got = f"got {len(rest) or 'none'}{_not_one_fact(words)}"
        raise KnowledgeError(f"'{fact}': {name} needs {after} after it, a value last; {got}")
    if situation.quantity is not None:
        if not BOUNDS.fullmatch(rest[-1]):
            raise KnowledgeError(
                f"'{fact}': '{rest[-1]}' is no amount; write a number like 2 or 1.5, or bounds like >=2"
            )
        rest[-1] = bounds_written(rest[-1])
    ranges = (*situation.arguments[1:], *([] if situation.quantity else [situation.range]))
    for kind, word in zip(ranges, rest, strict=situation.quantity is None):
        if word not in individuals and word not in (TRUE, FALSE):
            members = problem.classes.get(kind, ())
            raise KnowledgeError(
                f"unknown individual '{word}' in '{fact}'{nearest(word, members, f'values: {some_of(members)}')}"
            )
        if word not in problem.members(kind):
            raise KnowledgeError(
                f"'{fact}': {word} is no value of {name}; values: {some_of(problem.classes.get(kind, ()))}"
            )
    symbol = Symbol(name, (about, *rest[:-1]))
    if about not in problem.members(situation.arguments[0]):
        raise KnowledgeError(f"'{fact}': {about} has no {name}, since it is no {situation.arguments[0]}")
    return symbol, rest[-1]


def _not_one_fact(words: Sequence[str]) -> str:
    """Return how to state a negation, or several facts, if a text attempts this in the place of one fact."""
    if words and words[0].lower() in ("not", "no", "!"):
        return "; there is no negation: state another value, or false"
    if any(word.lower() in ("and", "&", "&&") or word[-1] in ",;" for word in words):
        return "; give each fact by itself"
    return ""


def _with_situation(problem: Problem, words: Sequence[str]) -> str:
    """Return a hint to the only situation type for the first word as object and the last as value, or an empty text."""
    about, value = (words[0], words[-1]) if words else ("", "")
    found = [
        each.name
        for each in problem.domain.situations.values()
        if len(each.arguments) == 1
        and about in problem.members(each.arguments[0])
        and value in problem.members(each.range)
    ]
    return f"; did you mean '{about} {found[0]} {value}'?" if len(found) == 1 else ""


def with_task(problem: Problem, parts: Parts, tasks: Iterable[str]) -> Problem:
    """Return a problem with the goals of the given tasks.

    Raises
    ------
    KnowledgeError
        Two goals contradict each other, a goal mentions an individual that isn't in the scene, or a goal with a deadline isn't the
        value of one symbol that behaviours can change.
    """
    goal, weights, deadlines = dict[Symbol, str](), dict[Symbol, Fraction](), dict[Symbol, Fraction]()
    found = [(task, iri, _weight(parts, iri)) for task in tasks for iri in parts.values(task, "goal")]
    found.sort(key=lambda one: one[2] is not None)  # hard goals first
    for task, iri, weight, (wanted, by) in (
        (*one, wanted) for one in found for wanted in _wanted(parts, one[1], problem.classes)
    ):
        if by is not None and not (isinstance(wanted, ValueCondition) and wanted.situation not in problem.domain.rules):
            raise KnowledgeError(
                f"<{iri}> has a deadline (:by), which only the value of one symbol can have that behaviours change; "
                "name an individual and a situation type without rules"
            )
        taken = weight is not None and _symbol_of(wanted) in goal  # the goal counts by itself
        if taken or not _is_fact(wanted, problem):
            variables = {parts.term(one): parts.parameter(one) for one in sorted(parts.terms_below(iri))}
            asked = tuple(variables[name] for name in sorted(mentions(wanted)) if name in variables)
            of_class = {parts.term(one): parts.membership(one) for one in sorted(parts.terms_below(iri))}
            told = with_classes([wanted], {name: conditions for name, conditions in of_class.items() if conditions})
            problem, symbol = with_derived_goal(problem, parts.names.short(task), parts.names.short(iri), told, asked)
            goal[symbol] = TRUE
            weights |= {} if weight is None else {symbol: weight}
            deadlines |= {} if by is None else {symbol: by}
            continue
        if isinstance(wanted, Comparison):
            symbol, value = _bounds(iri, wanted)
            value = bounds_written(f"{goal[symbol]},{value}" if symbol in goal else value)
            goal[symbol] = value
            weights |= {} if weight is None else {symbol: weight}
            if symbol not in problem.initial:
                raise KnowledgeError(f"<{iri}>: there is no {symbol}; the scene states no amount of it")
            continue
        assert isinstance(wanted, ValueCondition)
        symbol = Symbol(wanted.situation, wanted.arguments)
        check_arguments(symbol, problem.domain, "a goal")
        value = _other_values(wanted, problem)[0] if wanted.negated else wanted.value
        kind = problem.domain.situations[symbol.situation]
        if value in (TRUE, FALSE) and not kind.boolean:
            raise KnowledgeError(f"<{iri}>: the goal is about {symbol}, but states no value of it; name one as c:value")
        members = (problem.classes.get(of, ()) for of in kind.arguments)
        if value == FALSE and not all(a in its for a, its in zip(symbol.arguments, members, strict=True)):
            continue  # the symbol doesn't exist
        weights |= {} if weight is None else {symbol: weight}
        deadlines |= {} if by is None else {symbol: min(by, deadlines.get(symbol, by))}
        if goal.setdefault(symbol, value) != value:
            raise KnowledgeError(
                f"two goals require that {symbol} is {goal[symbol]} and {value}; drop one of the goals"
            )
        if symbol not in problem.initial and not problem.domain.situations[symbol.situation].boolean:
            raise KnowledgeError(f"<{iri}>: there is no {symbol}; the object or its situation type isn't in the scene")
    times = Times(deadlines) if deadlines else None
    return replace(problem, goal=dict(sorted(goal.items())), weights=weights, times=times)


def symbols_of(problem: Problem, parts: Parts, task: str, iri: str) -> set[Symbol]:
    """Return the symbols of the goals that a goal node of a task denotes; several for a class, or for a conjunction."""
    name = re.compile(rf"{re.escape(parts.names.short(iri))}(_\d+)?")
    derived = {
        symbol
        for symbol in problem.goal
        if symbol.arguments == (parts.names.short(task),) and name.fullmatch(symbol.situation)
    }
    if derived and _weight(parts, iri) is not None:
        return derived
    facts = [_symbol_of(wanted) for wanted, _ in _wanted(parts, iri, problem.classes) if _is_fact(wanted, problem)]
    return derived | problem.goal.keys() & facts


def _symbol_of(wanted: Condition) -> Symbol | None:
    """Return the symbol of a goal that is about one symbol."""
    match wanted:
        case ValueCondition(situation, arguments) | Comparison(Amount(situation, arguments)):
            return Symbol(situation, arguments)
        case _:
            return None


def _weight(parts: Parts, iri: str) -> Fraction | None:
    """Return the weight of a soft goal; None for a goal that must be met."""
    weight = parts.decimal(iri, "weight")
    if weight is not None and weight <= 0:
        raise KnowledgeError(
            f"<{iri}>: the c:weight is {written(weight)}; state the cost of leaving the goal unmet, a number greater than 0",
            iri,
        )
    return weight


def _is_fact(wanted: Condition, problem: Problem) -> bool:
    """Return whether a goal is equivalent to a fact: the value of a symbol, or bounds of an amount that the state contains."""
    match wanted:
        case ValueCondition(negated=negated):
            return not negated or len(_other_values(wanted, problem)) == 1
        case Comparison(Amount(situation), sign, Fraction(), negated):
            aggregates = problem.domain.aggregates
            return (situation not in aggregates or aggregates[situation].kept) and not (negated and sign == "=")
        case _:
            return False


def with_derived_goal(
    problem: Problem, task: str, name: str, wanted: Sequence[Condition], variables: tuple[Parameter, ...] = ()
) -> tuple[Problem, Symbol]:
    """Return a problem with a new boolean situation type, and the symbol of this type.

    The symbol is true if the conditions `wanted` hold; `variables` are the variables that these conditions determine.

    The symbol that represents the goal has the task as its argument. A derived situation type turns a goal with alternatives or
    quantifiers into a fact like other goals.
    """
    domain = problem.domain
    names = [name, *(f"{name}_{number}" for number in range(2, len(domain.situations) + 3))]
    free = next(one for one in names if one not in domain.situations and one not in problem.individuals)
    conditions = with_extrema(wanted, domain.aggregates)
    individuals = {t for c in conditions for inner in walk(c) for t in terms(inner) if not is_variable(t)}
    levels = [domain.situations[situation].level for situation, _ in needed(conditions)]
    levels += [problem.value_levels.get(individual, 1) for individual in individuals]
    derived = SituationType(free, (TASK,), "Truth", max(levels, default=1), default=FALSE, boolean=True)
    rule = rule_named_apart(Rule(free, (Parameter("?task", TASK),), variables, conditions))
    tasks = tuple(dict.fromkeys((*problem.classes.get(TASK, ()), task)))
    more = replace(domain, situations={**domain.situations, free: derived}, rules={**domain.rules, free: (rule,)})
    classes = {**problem.classes, TASK: tasks, "Truth": problem.classes.get("Truth", (FALSE, TRUE))}
    return replace(problem, domain=more, classes=classes), Symbol(free, (task,))


def _other_values(excluded: ValueCondition, problem: Problem) -> list[str]:
    """Return the values of all levels that the symbol of a condition can have instead of the condition's value."""
    check_arguments(symbol := Symbol(excluded.situation, excluded.arguments), problem.domain, "a goal")
    kind = problem.domain.situations[symbol.situation]
    values = (FALSE, TRUE) if kind.boolean else problem.classes.get(kind.range, ())
    return [value for value in values if value != excluded.value]


def _wanted(
    parts: Parts, iri: str, classes: Mapping[str, tuple[str, ...]], by: Fraction | None = None
) -> list[tuple[Condition, Fraction | None]]:
    """Return the goals that a goal node denotes, each with its deadline, which is `by` at the latest.

    If an argument of the node is a class, there is one goal for each member of the class. A hard conjunction denotes its conjuncts.
    """
    found = parts.condition(iri)
    of_several = iri in parts.nodes and is_a(parts.nodes[iri], "AllOf") and not parts.flag(iri, "negated")
    if of_several and not parts.values(iri, "weight"):
        each, by = parts.values(iri, "condition"), _earliest(parts, [iri], by)
        return list(parts.in_order(one for conjunct in each for one in _wanted(parts, conjunct, classes, by)))
    by = _earliest(
        parts, closure([iri], lambda one: (*parts.values(one, "condition"), *parts.values(one, "alternative"))), by
    )
    if not (isinstance(found, Witness) and parts.classes_in(iri)):
        return [(found, by)]
    wanted: list[Condition] = [found]
    while isinstance(found, Witness):
        *others, _ = found.conditions
        if others:
            raise KnowledgeError(
                f"<{iri}> is a goal about all individuals of a class that situations define; name another class, "
                "or state the goal with a defined situation type"
            )
        wanted = [
            substituted(one.conditions[-1], {one.variable: member})
            for one in wanted
            if isinstance(one, Witness)
            for member in classes.get(one.kind, ())
        ]
        found = found.conditions[-1]
    return [(replace(one, negated=not one.negated), by) for one in wanted]


def _earliest(parts: Parts, nodes: Iterable[str], by: Fraction | None) -> Fraction | None:
    """Return the earliest of the deadlines of nodes and the deadline `by`."""
    every = (by, *(parts.seconds(node, "by") for node in nodes))
    return min((one for one in every if one is not None), default=None)


def _bounds(iri: str, wanted: Comparison) -> tuple[Symbol, str]:
    """Return the symbol and the bounds of a goal that concerns an amount."""
    contrary = {"<": ">=", "<=": ">", ">=": "<", ">": "<="}
    sign = contrary.get(wanted.operator, "") if wanted.negated else wanted.operator
    if not sign or not isinstance(wanted.left, Amount) or not isinstance(wanted.right, Fraction):
        raise KnowledgeError(
            f"<{iri}>: a goal with a comparison compares the amount of one object with a number, by <, <=, =, >= or >"
        )
    symbol = Symbol(wanted.left.situation, wanted.left.arguments)
    return symbol, f"{sign}{written(wanted.right)}"


def check_arguments(symbol: Symbol, domain: Domain, what: str) -> None:
    """Raise `KnowledgeError` if a symbol and its situation type have different numbers of arguments."""
    many, wanted = len(symbol.arguments), len(domain.situations[symbol.situation].arguments)
    if many != wanted:
        raise KnowledgeError(f"{symbol}: {what} about {many} individuals; {symbol.situation} is about {wanted}")


def some_of(names: Sequence[str], most: int = 12) -> str:
    """Return a text that lists the first `most` names."""
    return ", ".join(names[:most]) + (", …" if len(names) > most else "")

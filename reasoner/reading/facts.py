"""Reading of a scene's facts: static relations and the initial state."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import product

from confab.reasoner.amounts import Measure, written
from confab.reasoner.condition_nodes import NodeValues
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.language import measured, walk
from confab.reasoner.limits import checked
from confab.reasoner.names import Names
from confab.reasoner.possible import earlier_states, values_at_fault
from confab.reasoner.problem import Domain
from confab.reasoner.reading.definitions import Definitions
from confab.reasoner.reading.goals import check_arguments
from confab.reasoner.reading.parts import Parts
from confab.reasoner.symbols import TRUE, RelationCondition, SituationType, State, Symbol
from confab.reasoner.vocabulary import CORE

READING = "reading the scene"


def facts_of(
    rows: Iterable[tuple[str, ...]],
    tuples: Mapping[str, NodeValues],
    properties: Mapping[str, tuple[str, bool]],
    domain: Domain,
    names: Names,
    numbers: Collection[str],
) -> tuple[dict[str, frozenset[tuple[str, ...]]], dict[Symbol, set[str]]]:
    """Return the rows of each static relation, and the values that the scene states for each symbol."""
    relations: dict[str, set[tuple[str, ...]]] = defaultdict(set)
    numbered: dict[str, set[tuple[str, ...]]] = defaultdict(set)  # relations whose rows end with a number
    stated: dict[Symbol, set[str]] = defaultdict(set)
    for subject, predicate, value in checked(rows, READING):
        number = predicate in numbers
        pair = (names.short(subject), value if number else names.short(value))
        if predicate not in properties:
            (numbered if number else relations)[names.short(predicate)].add(pair)
            continue
        situation, boolean = properties[predicate]
        if situation in domain.rules:
            continue  # the facts of the situation type are derived
        if boolean:
            stated[Symbol(situation, pair)].add(TRUE)
        else:
            stated[Symbol(situation, pair[:1])].add(pair[1])
    facts = Parts(tuples, names, set(), set(), Definitions({}, {}, names))
    of_tuples: dict[str, tuple[str, tuple[str, ...]]] = {}
    for iri, node in checked(tuples.items(), READING):
        if facts.flag(iri, "negated"):
            raise KnowledgeError(
                f"<{iri}> is a fact with c:negated, but facts state what holds; remove the fact, or state c:value c:false",
                iri,
            )
        if CORE + "relation" in node:
            individuals = (*facts.arguments(iri), *(names.short(v) for v in facts.values(iri, "value")))
            relation, amount = names.short(facts.one(iri, "relation")), facts.decimal(iri, "amount")
            of_tuples[iri] = relation, individuals
            if amount is None:
                relations[relation].add(individuals)
            else:
                numbered[relation].add((*individuals, written(amount)))
        else:
            values = facts.values(iri, "value")
            symbol = Symbol(names.short(facts.one(iri, "situationType")), facts.arguments(iri))
            amount = facts.decimal(iri, "amount")
            said = names.short(values[0]) if values else TRUE
            stated[symbol].add(said if amount is None else written(amount))
    for symbol in stated:
        if symbol.situation not in domain.situations:
            raise KnowledgeError(f"the situation type of the fact {symbol} is unknown")
        if symbol.situation in domain.rules or symbol.situation in domain.aggregates:
            raise KnowledgeError(
                f"{symbol} is stated, but a rule defines it; drop the fact, or the rule of {symbol.situation}",
                names.iri(symbol.arguments[0]) if symbol.arguments[0] in names else "",
            )
        check_arguments(symbol, domain, "a fact")
    for relation, pairs in numbered.items():
        _check_numbers(relation, pairs, relations.get(relation, ()))
    asked = individuals_named(domain, names)
    without_numbers = {relation: {row[:-1] for row in rows} for relation, rows in numbered.items()}
    for relation, rows in sorted({**relations, **without_numbers}.items()):
        lengths = {len(row) for row in rows}
        many, user = asked.get(relation, (max(lengths, default=0), ""))
        if user and len(rows) > 1 and lengths != {many} and len(lengths) == 1:
            (length,) = lengths
            raise KnowledgeError(
                f"{user} names {many} individual{'s' * (many != 1)} for {relation}, but all facts of {relation} name {length}; "
                "state the missing individual, or remove the superfluous one",
                names.iri(user) if user in names else "",
            )
        for row in sorted(rows):
            if len(row) != many:
                others = "behaviours and rules" if relation in asked else "others"
                raise KnowledgeError(
                    f"{relation} of {', '.join(row)} names {len(row)} individual{'s' * (len(row) != 1)}; {others} name {many}; "
                    "state the missing individual, or remove the superfluous one",
                    next((iri for iri, said in of_tuples.items() if said == (relation, row)), ""),
                )
    return {name: frozenset(pairs) for name, pairs in sorted({**relations, **numbered}.items())}, stated


def individuals_named(domain: Domain, names: Names) -> dict[str, tuple[int, str]]:
    """Return the number of individuals that behaviours and rules name for each static relation, with one that names them.

    Raises
    ------
    KnowledgeError
        Two conditions or calculations use the same relation with different numbers of individuals.
    """
    found: dict[str, tuple[int, str]] = {}
    rules = [rule.behavior for its in domain.rules.values() for rule in its]
    rules += [aggregate.behavior for aggregate in domain.aggregates.values()]
    for behavior in (*domain.behaviors.values(), *rules):
        conditions = (inner for condition in behavior.conditions for inner in walk(condition))
        named: list[RelationCondition | Measure] = [c for c in conditions if isinstance(c, RelationCondition)]
        for one in (*named, *measured(behavior)):
            many, first = found.setdefault(one.relation, (len(one.arguments), behavior.name))
            if many != len(one.arguments):
                other = "in one place and" if first == behavior.name else f"and {behavior.name} names"
                raise KnowledgeError(
                    f"{first} names {many} individual{'s' * (many != 1)} for {one.relation} {other} {len(one.arguments)}"
                    "; name the same number in all conditions and calculations",
                    names.iri(behavior.name) if behavior.name in names else "",
                )
    return found


def _check_numbers(relation: str, rows: Iterable[tuple[str, ...]], bare: Collection[tuple[str, ...]]) -> None:
    """Raise `KnowledgeError` if a relation has two numbers for the same individuals, or a number for only some individuals."""
    for row in bare:
        raise KnowledgeError(
            f"{relation} of {', '.join(row)} has no number, but other facts of {relation} have one; state its c:amount"
        )
    found: dict[tuple[str, ...], str] = {}
    for *individuals, value in sorted(rows):
        if (old := found.setdefault(tuple(individuals), value)) != value:
            raise KnowledgeError(f"{relation} of {', '.join(individuals)} is {old} and {value}; state one number")


def _of_two_classes(
    domain: Domain, classes: Mapping[str, tuple[str, ...]], situation: SituationType, arguments: Sequence[str]
) -> str:
    """Return the advice to drop the class that has a situation type, if an individual also belongs to an unrelated class."""
    for individual, kind in zip(arguments, situation.arguments, strict=True):
        own = {*classes[kind]}
        others = [
            other
            for other, members in classes.items()
            if individual in members and other not in domain.situations and {*members} - own and own - {*members}
        ]
        if others:
            least = min(others, key=lambda other: (len(classes[other]), other))
            return f"{individual} is a {kind}, which has {situation.name}, and a {least}: drop one of the two classes, "
    return ""


def initial_state(
    domain: Domain, classes: Mapping[str, tuple[str, ...]], stated: Mapping[Symbol, set[str]], names: Names
) -> dict[Symbol, str]:
    """Return the initial value of each symbol: the stated value, or the situation type's default.

    Raise `KnowledgeError` if a symbol has several stated values, or has no stated value and no default.
    """
    initial = {}
    defined = {*domain.rules, *domain.aggregates, *domain.remembers}
    for situation in domain.situations.values():
        if situation.name in defined or (situation.boolean and situation.default != TRUE):
            continue  # a missing boolean symbol is false
        every = product(*(classes.get(kind, ()) for kind in situation.arguments))
        for arguments in checked(every, READING):
            symbol = Symbol(situation.name, arguments)
            if situation.quantity and len(arguments) > 1 and symbol not in stated and not situation.default:
                continue  # e.g. a distance exists only if it is stated
            values = sorted(stated.get(symbol, ())) or [v for v in [situation.default] if v]
            if len(values) != 1:
                default = "c:defaultAmount" if situation.quantity else "c:defaultValue"
                what = f"several values ({', '.join(values)})" if values else "no value"
                wrong = "" if values else _of_two_classes(domain, classes, situation, arguments)
                raise KnowledgeError(
                    f"{symbol} has {what}; {wrong}state "
                    + ("one of them" if values else f"a value in the scene, or a {default} of {situation.name}")
                )
            if not situation.boolean or values[0] == TRUE:
                initial[symbol] = values[0]
    members = {kind: frozenset(those) for kind, those in classes.items()}
    for symbol in sorted(
        s for s, values in stated.items() if domain.situations[s.situation].boolean and TRUE in values
    ):
        kinds = domain.situations[symbol.situation].arguments
        if all(a in members.get(kind, ()) for a, kind in zip(symbol.arguments, kinds, strict=True)):
            initial[symbol] = TRUE  # symbols of unread individuals are omitted
    initial |= earlier_states(domain, initial)
    return initial


def check_values(state: State, domain: Domain, names: Names) -> None:
    """Raise `KnowledgeError` if a symbol has an undeclared value, an amount is out of bounds, or a constraint is violated."""
    for fault in values_at_fault(state, domain, names):
        constraint = domain.constraints.get(fault.symbol.situation)
        about = next(iter(fault.symbol.arguments), "") if constraint is None else constraint.situation
        rule = "unreadable" if constraint is None else "violated-constraint"
        raise KnowledgeError(str(fault), names.iri(about) if about in names else "", rule)

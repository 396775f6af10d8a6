"""Detection of impossible states, with the same messages for all sources of states.

The facts of a state may come from files, callers, observations, interventions, or the page in a notebook. A value must belong to
its situation type, an amount must be within its bounds, and an exclusive value may belong to only one individual. A symbol
without a value is unknown, which is allowed.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Container, Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

from confab.reasoner.amounts import DECIMAL, Quantity, written
from confab.reasoner.problem import Domain, Problem
from confab.reasoner.symbols import FALSE, TRUE, Constraint, Fact, State, Symbol, ValueCondition

PLACE, HELD, POSITION = "perceive_place", "perceive_held", "perceive_hand_position"
"""Perceivers of an object's place, of the object in a hand, and of a hand's position."""


class ImpossibleStateError(ValueError):
    """Raised if a given state is impossible; the message states the reason and the remedy."""


@dataclass(frozen=True)
class Impossible:
    """The reason why a state is impossible.

    Attributes
    ----------
    symbol : Symbol
        A symbol with a faulty value.
    what, why, remedy : str
        The fault, the reason why the value is a fault, and the remedy.
    """

    symbol: Symbol
    what: str
    why: str
    remedy: str

    def __str__(self) -> str:
        """Return the fault and the remedy."""
        return f"{self.what}; {self.remedy}"


def impossible(problem: Problem, state: State) -> Iterator[Impossible]:
    """Yield the reasons why a state is impossible.

    Parameters
    ----------
    problem : Problem
        Problem with the situation types and the individuals; its initial state isn't used.
    state : State
        The values of some or all symbols.
    """
    declared = problem.individuals
    wrong = [*values_at_fault(state, problem.domain, declared)]
    yield from wrong
    for symbol, value in state.items():
        situation = problem.domain.situations[symbol.situation]
        among = (TRUE, FALSE) if situation.boolean else problem.members(situation.range)
        if situation.quantity is None and value in (declared | {TRUE, FALSE}) and value not in among:
            yield Impossible(
                symbol,
                f"the value of {symbol} is {value}, which isn't a value of {situation.name}",
                "no behaviour gives or requires such a value",
                f"name an individual of {situation.name}",
            )
    if not wrong:
        yield from against_physics(problem, state)


def against_physics(problem: Problem, state: State) -> Iterator[Impossible]:
    """Yield exclusive values that belong to two individuals, and objects that are both in a hand and at a place."""
    yield from _had_twice(problem, state)
    yield from _held_elsewhere(problem, state)


def refuse_impossible(problem: Problem, before: State, after: State, cause: str = "") -> None:
    """Raise `ImpossibleStateError` if a state is impossible, unless the previous state is impossible for the same reason.

    Parameters
    ----------
    problem : Problem
    before, after : State
        The previous state and the state to check.
    cause : str
        A description of the transition, for the error message.
    """
    known = {fault.what for fault in impossible(problem, before)}
    for fault in impossible(problem, after):
        if fault.what not in known:
            raise ImpossibleStateError(f"{cause}: {fault}" if cause else str(fault))


def refuse_derived(domain: Domain, facts: Iterable[Fact], cause: str = "") -> None:
    """Raise `ImpossibleStateError` if a rule defines a fact's situation type, or a fact makes a remembered type false."""
    for fact in facts:
        if (name := fact.symbol.situation) in domain.rules or name in domain.aggregates:
            text = f"a rule defines {name}; change a fact that it follows from"
            raise ImpossibleStateError(f"{cause}: {text}" if cause else text)
        if name in domain.remembers and fact.value == FALSE:
            text = f"{name} remembers {domain.remembers[name]}, so it never becomes false; leave the fact out"
            raise ImpossibleStateError(f"{cause}: {text}" if cause else text)


def earlier_states(domain: Domain, state: State) -> dict[Symbol, str]:
    """Return what ``:onlyAfter`` remembers of states before a first state, in which remembered situation types are already true."""
    found = {}
    for constraint in domain.constraints.values():
        if len(constraint.about) > 1 and (earlier := constraint.about[1]) in domain.remembers:
            allowed = domain.rules[constraint.situation][0].conditions[1]
            assert isinstance(allowed, ValueCondition)
            true = (symbol for symbol, value in state.items() if symbol.situation == earlier and value == TRUE)
            found.update({Symbol(allowed.situation, symbol.arguments): TRUE for symbol in true})
    return found


def violated(constraint: Constraint, arguments: Sequence[str]) -> str:
    """Return as text that a constraint is violated for individuals."""
    about = f" of {' and '.join(arguments)}" if arguments else ""
    return f"{constraint}, and it is {'false' if constraint.always else 'true'}{about}"


def values_at_fault(state: State, domain: Domain, declared: Container[str]) -> Iterator[Impossible]:
    """Yield undeclared values, invalid amounts, amounts out of bounds, and violated constraints."""
    for symbol, value in state.items():
        quantity = domain.situations[symbol.situation].quantity
        if quantity is not None and (limits := _limits(value, quantity)):
            name, remedy = symbol.situation, "state such an amount"
            if value == domain.situations[name].default:
                remedy += f", or correct the c:defaultAmount of {name}"
            if name in domain.constraints:
                constraint = domain.constraints[name]
                yield Impossible(
                    symbol,
                    f"{violated(constraint, symbol.arguments)} here",
                    "constraints hold in every state, from the first one on",
                    _remedy(domain, constraint, symbol.arguments),
                )
                continue
            if name in domain.aggregates:
                remedy = f"change the facts from which {name} is calculated, or the bound of {name}"
            yield Impossible(
                symbol, f"{symbol} is {value[:40]}; {limits}", "an amount never violates its bounds", remedy
            )
        for name in symbol.arguments if quantity else (*symbol.arguments, value):
            if name not in declared and name not in (TRUE, FALSE):
                yield Impossible(
                    symbol,
                    f"{symbol} is {value}, but {name} isn't declared as an individual",
                    "an unknown name is read as a new individual",
                    "declare it, or correct the name",
                )


def _remedy(domain: Domain, constraint: Constraint, arguments: Sequence[str]) -> str:
    """Return how to change a scene whose initial state violates a constraint."""
    if len(constraint.about) < 2:
        return f"change the facts from which {constraint.situation} follows, or its rule"
    name, earlier = constraint.about
    of = f"{earlier} of {' and '.join(arguments)}"
    if earlier in domain.remembers:
        return f"state {of} in the scene if it was true before, or change the facts from which {name} follows"
    return (
        f"if {of} was true before the scene begins, declare a situation type that c:remembers {earlier}, name it in c:onlyAfter, "
        f"and state it in the scene; otherwise change the facts from which {name} follows"
    )


def _limits(value: str, quantity: Quantity) -> str:
    """Return the requirement that an amount violates, or an empty text."""
    if not DECIMAL.fullmatch(value):
        return "wanted a number, like 2 or 1.5"
    if quantity.allows(Fraction(value)):
        return ""
    limits = [] if quantity.least is None else [f"at least {written(quantity.least)}"]
    limits += [] if quantity.most is None else [f"at most {written(quantity.most)}"]
    limits += ["a whole number"] if quantity.whole else []
    return f"it has to be {' and '.join(limits)}"


def _had_twice(problem: Problem, state: State) -> Iterator[Impossible]:
    """Yield exclusive values that belong to two individuals."""
    having: dict[tuple[str, str], list[Symbol]] = defaultdict(list)
    for symbol, value in sorted(state.items()):
        perceived = problem.domain.situations[symbol.situation].perceived
        if perceived is not None and perceived.exclusive and value not in (v for _, v in perceived.special):
            having[symbol.situation, value].append(symbol)
    for (situation, value), (first, *others) in having.items():
        for other in others:
            yield Impossible(
                other,
                f"{first.arguments[0]} and {other.arguments[0]} have the same {situation}, {value}",
                f"physics gives each value of {situation} to one {_owner(problem, situation)} at a time",
                f"state another {situation} of one of the two",
            )


def _held_elsewhere(problem: Problem, state: State) -> Iterator[Impossible]:
    """Yield objects at a place although a hand at another place holds them, and objects "in a hand" although no hand holds them.

    While a hand grasps or releases an object, the object may be both in the hand and at its place.
    """
    by = {s.perceived.by: s for s in problem.domain.situations.values() if s.perceived is not None}
    if PLACE not in by or HELD not in by:
        return
    place, held = by[PLACE], by[HELD]
    in_hand = dict(place.perceived.special).get("valueInHand") if place.perceived else None
    hands = {value: symbol for symbol, value in sorted(state.items()) if symbol.situation == held.name}
    for symbol, value in state.items():
        if symbol.situation != place.name:
            continue
        (thing,) = symbol.arguments
        hand = hands.get(thing)
        if value == in_hand:
            if hands and hand is None:
                yield Impossible(
                    symbol,
                    f"{symbol} is {value}, but no {_owner(problem, held.name)} has {thing} as its {held.name}",
                    "an object in a hand is held by exactly one hand",
                    f"state {held.name} {thing} of the hand that holds {thing}, or another {place.name} of {thing}",
                )
        elif hand is not None and POSITION in by:
            at = state.get(Symbol(by[POSITION].name, hand.arguments))
            if at is not None and at != thing:
                yield Impossible(
                    symbol,
                    f"{hand} is {thing}, but {symbol} is {value}, and {hand.arguments[0]} isn't at {value}",
                    "an object in a hand isn't at a place",
                    f"state {place.name} {in_hand} of {thing}, or another {held.name} of {hand.arguments[0]}",
                )


def _owner(problem: Problem, situation: str) -> str:
    return problem.domain.situations[situation].arguments[0].replace("|", " or ")

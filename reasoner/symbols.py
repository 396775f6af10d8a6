"""The reasoner's output values: symbols, conditions, effects, behaviours and problems, read from the knowledge graph.

This module knows neither RDF nor search nor physics. Every name is a string, unique within one scene (`cup1`, `B1_MOVE`,
`LOCATION`); the reasoner keeps its IRI. A term that starts with ``?`` is a parameter or variable of a behaviour, any other term is
an individual.

============================  =========================================  =====================
the paper                     the field                                  here
============================  =========================================  =====================
situated object symbol        state variable (SAS+)                      `Symbol`
situated object instance      fact                                       `Fact`
situation type                the variable's property, and its domain    `SituationType`
behaviour                     action schema                              `Behavior`
quantified behaviour          ground action                              `GroundBehavior`
(none)                        derived predicate, and its axioms          `Rule`
(none)                        derived amount: sum, count, extremum       `Aggregate`
============================  =========================================  =====================
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from fractions import Fraction
from functools import cached_property
from itertools import product
from math import prod
from typing import TypeAlias

from confab.reasoner.amounts import OPERATIONS, Amount, Calculation, Expression, Quantity, put_in, situations_in

TRUE = "true"
FALSE = "false"


@dataclass(frozen=True, order=True)
class Symbol:
    """A situated object symbol ``<o, S>``: a situation type with its arguments, the first of them the object."""

    situation: str
    arguments: tuple[str, ...]

    def __str__(self) -> str:
        """Return the symbol in the paper's notation, e.g. ``<cup1, LOCATION>``."""
        return f"<{', '.join((*self.arguments, self.situation))}>"


@dataclass(frozen=True, order=True)
class Fact:
    """A situated object instance ``<o, s>``: a symbol with one of its values."""

    symbol: Symbol
    value: str

    def __str__(self) -> str:
        """Return the fact in goal notation, e.g. ``cup1 LOCATION location7``."""
        return " ".join((*self.symbol.arguments[:1], self.symbol.situation, *self.symbol.arguments[1:], self.value))


State: TypeAlias = Mapping[Symbol, str]
"""A value for every symbol of the scene; a missing boolean symbol is `FALSE`."""


@dataclass(frozen=True)
class Perceived:
    """The perception of a situation type's values.

    Attributes
    ----------
    by : str
        The perceiver.
    exclusive : bool
        Whether no two individuals can have the same value at once, except for special values.
    special : tuple of (str, str)
        The special values as pairs of name and value: ``("valueInHand", "in_hand")``.
    """

    by: str
    exclusive: bool = False
    special: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class SituationType:
    """A property of objects, which is also the class of its values.

    `arguments` are the classes of the arguments; `range` is the class of the values. A property that isn't functional is
    `boolean`: its value is the last argument, and there is one symbol per value, which is `TRUE` or `FALSE`. The symbols exist
    from `level` on; `rest` is the value that a refinement must restore; `default` is the value of symbols that the scene
    doesn't state. With a `quantity` the values are numbers (`confab.reasoner.amounts`), and only the symbols with a stated
    amount exist. `perceived` states how physics reads the values, if it reads them.
    """

    name: str
    arguments: tuple[str, ...]
    range: str
    level: int = 1
    rest: str | None = None
    default: str | None = None
    boolean: bool = False
    quantity: Quantity | None = None
    perceived: Perceived | None = None


# ---------------------------------------------------------------------------------------------------------- conditions


@dataclass(frozen=True)
class ValueCondition:
    """``situation(arguments) = value``. If the value is an unbound variable, the condition determines it.

    A symbol that doesn't exist has no value: the condition is then false, and its negation true.
    """

    situation: str
    arguments: tuple[str, ...]
    value: str
    negated: bool = False


@dataclass(frozen=True)
class RelationCondition:
    """A static relation holds between the arguments."""

    relation: str
    arguments: tuple[str, ...]
    negated: bool = False


@dataclass(frozen=True)
class ClassCondition:
    """The term is an individual of the class."""

    term: str
    kind: str
    negated: bool = False


@dataclass(frozen=True)
class EqualityCondition:
    """Both terms are the same individual."""

    left: str
    right: str
    negated: bool = False


@dataclass(frozen=True)
class Witness:
    """Some individual of class `kind`, substituted for `variable`, satisfies all `conditions`; negated: none does.

    "The location is free" is ``Witness("?o", "Movable", (LOCATION(?o) = ?l,), negated=True)``.
    """

    variable: str
    kind: str
    conditions: tuple[Condition, ...]
    negated: bool = False


@dataclass(frozen=True)
class Constraint:
    """A condition on every state: a situation type is true of no individuals, or of all individuals of its classes."""

    situation: str
    always: bool = False

    def __str__(self) -> str:
        return f"{self.situation} must {'always' if self.always else 'never'} be true"


@dataclass(frozen=True)
class AnyOf:
    """At least one alternative, which is a conjunction, holds; negated: none does. It binds no variables outside of itself.

    `constraint` is the constraint that a precondition maintains, for its sentence; it makes no difference to the meaning.
    """

    alternatives: tuple[tuple[Condition, ...], ...]
    negated: bool = False
    constraint: Constraint | None = field(default=None, compare=False)


@dataclass(frozen=True)
class Comparison:
    """A comparison of two amounts by `operator` (a key of `amounts.COMPARING`); false if one of them is missing."""

    left: Expression
    operator: str
    right: Expression
    negated: bool = False


Condition: TypeAlias = (
    "ValueCondition | RelationCondition | ClassCondition | EqualityCondition | Witness | AnyOf | Comparison"
)


@dataclass(frozen=True)
class ValueEffect:
    """``situation(arguments)`` becomes `value`, if all of `when` held before; variables in `when` are determined there.

    With `each`, the effect is on every individual of that class, substituted for that variable. A `Problem` has an effect for each
    of them instead (`spread`).
    """

    situation: str
    arguments: tuple[str, ...]
    value: str
    when: tuple[Condition, ...] = ()
    each: Parameter | None = None


@dataclass(frozen=True)
class AmountEffect:
    """The amount of ``situation(arguments)`` is assigned, increased, decreased or scaled, if all of `when` held before.

    The number is evaluated in the state before; changes of one symbol are added.
    """

    situation: str
    arguments: tuple[str, ...]
    operation: str
    amount: Expression
    when: tuple[Condition, ...] = ()
    each: Parameter | None = None


Effect: TypeAlias = "ValueEffect | AmountEffect"


# ---------------------------------------------------------------------------------------------------------------- time


class Span(Enum):
    """The part of a step at which a condition must hold, or an effect takes place."""

    START = "atStart"
    THROUGHOUT = "throughout"  # of an effect: it is in the making until the end
    END = "atEnd"


@dataclass(frozen=True)
class Timing:
    """A behaviour in time.

    Attributes
    ----------
    duration : Expression, optional
        Seconds, evaluated where the behaviour begins. None: the duration of its refinement; for a primitive, the measured
        duration.
    actors : tuple of str
        Terms whose individuals can take part in only one step at a time.
    conditions, effects : tuple of pairs
        All conditions and effects, each with its span.
    """

    duration: Expression | None = None
    actors: tuple[str, ...] = ()
    conditions: tuple[tuple[Span, Condition], ...] = ()
    effects: tuple[tuple[Span, Effect], ...] = ()

    def asked(self, span: Span) -> tuple[Condition, ...]:
        """Return the conditions of a span."""
        return tuple(condition for at, condition in self.conditions if at is span)

    def made(self, span: Span) -> tuple[Effect, ...]:
        """Return the effects of a span."""
        return tuple(effect for at, effect in self.effects if at is span)


@dataclass(frozen=True)
class Times:
    """The times of a task, in seconds from the begin of the plan.

    Attributes
    ----------
    deadlines : mapping of Symbol to seconds
        The latest time from which on a goal has to hold.
    windows : mapping of individual to pairs of seconds
        When an individual is available. A window without an end (None) lasts for ever; an individual without windows is always
        available.
    measured : mapping of behaviour to seconds
        The average measured duration of behaviours without a stated duration.
    events : mapping of behaviour to seconds
        Events, which no actor executes: they happen at that time (PDDL's timed initial literals).
    """

    deadlines: Mapping[Symbol, Fraction] = field(default_factory=dict)
    windows: Mapping[str, tuple[tuple[Fraction, Fraction | None], ...]] = field(default_factory=dict)
    measured: Mapping[str, Fraction] = field(default_factory=dict)
    events: Mapping[str, Fraction] = field(default_factory=dict)


# ---------------------------------------------------------------------------------------------------------- behaviours


@dataclass(frozen=True)
class Parameter:
    """A parameter (enumerated by quantification) or variable (determined by the state) with the class of its values."""

    name: str
    kind: str


@dataclass(frozen=True)
class Behavior:
    """A lifted behaviour.

    Effects are applied in order, false facts first. So a fact that one binding makes both false and true is true, as in PDDL.
    The behaviour is not applicable if an amount that it changes would violate the bounds of its situation type. `spread` has
    the individuals that effects on all members of a class name. A `price` replaces `cost`, and a precondition requires that the
    price is defined (`priced`). `timing` states when its conditions must hold and its effects take place
    (`confab.reasoner.timing`).
    """

    name: str
    level: int
    parameters: tuple[Parameter, ...]
    variables: tuple[Parameter, ...] = ()
    preconditions: tuple[Condition, ...] = ()
    effects: tuple[ValueEffect, ...] = ()
    cost: float = 1.0
    amounts: tuple[AmountEffect, ...] = ()
    spread: frozenset[str] = frozenset()
    price: Expression | None = None
    timing: Timing | None = None

    def __post_init__(self) -> None:
        """Sort the effects."""
        object.__setattr__(self, "effects", tuple(sorted(self.effects, key=lambda effect: effect.value != FALSE)))
        if self.amounts:
            ordered = sorted(self.amounts, key=lambda effect: OPERATIONS.index(effect.operation))
            object.__setattr__(self, "amounts", tuple(ordered))

    @cached_property
    def priced(self) -> Comparison | None:
        """The conditions of the price: it is a number, and not negative."""
        return None if self.price is None else Comparison(self.price, ">=", Fraction(0))

    @cached_property
    def lasting(self) -> Comparison | None:
        """The conditions of a calculated duration: it is a number, and not negative."""
        duration = None if self.timing is None else self.timing.duration
        return None if isinstance(duration, Fraction | None) else Comparison(duration, ">=", Fraction(0))

    @cached_property
    def asked(self) -> tuple[Condition, ...]:
        """The preconditions without those of the price and the duration."""
        return tuple(condition for condition in self.preconditions if condition not in (self.priced, self.lasting))

    @cached_property
    def every_effect(self) -> tuple[ValueEffect | AmountEffect, ...]:
        """The behaviour's effects on values, then those on amounts."""
        return (*self.effects, *self.amounts)

    @cached_property
    def changes(self) -> frozenset[str]:
        """The situation types that the behaviour changes."""
        return frozenset(effect.situation for effect in self.every_effect)

    @cached_property
    def conditions(self) -> tuple[Condition, ...]:
        """The behaviour's preconditions and the conditions of its effects."""
        return (*self.preconditions, *(condition for effect in self.every_effect for condition in effect.when))

    @cached_property
    def kinds(self) -> Mapping[str, str]:
        """The class of each parameter and variable."""
        return {term.name: term.kind for term in (*self.parameters, *self.variables)}


@dataclass(frozen=True)
class Rule:
    """A rule of a defined situation type: it is true of its arguments in every state in which all conditions hold.

    If a situation type has several rules, one true rule suffices; if none is true, the situation is false. States don't contain
    its symbols: their values are computed on demand. Rules may depend on each other, but not on the negation of a situation
    type that depends on them (`confab.reasoner.derivation`).

    Parameters
    ----------
    situation : str
        A boolean situation type, which no behaviour changes.
    parameters : tuple of Parameter
        The names of its arguments in the conditions, and their classes.
    variables : tuple of Parameter
        Further variables, which the conditions determine, as in a behaviour.
    conditions : tuple of Condition
    """

    situation: str
    parameters: tuple[Parameter, ...]
    variables: tuple[Parameter, ...] = ()
    conditions: tuple[Condition, ...] = ()

    @cached_property
    def behavior(self) -> Behavior:
        """The rule as a behaviour that makes its situation type true, for functions that look for achievers."""
        head = ValueEffect(self.situation, tuple(p.name for p in self.parameters), TRUE)
        return Behavior(self.situation, 1, self.parameters, self.variables, self.conditions, (head,), 0.0)


AGGREGATES = ("sum", "count", "max", "min")
"""The functions of an aggregate."""


@dataclass(frozen=True)
class Aggregate:
    """A rule of a derived amount: in every state the sum, count, maximum or minimum over all solutions of its conditions.

    A solution assigns an individual to each of the `variables`. A solution for which `amount` is not defined is left out. A sum
    or count without solutions is zero; a maximum or minimum without solutions doesn't exist. No behaviour that an author writes
    changes a derived amount; `confab.reasoner.aggregates` adds the effects that keep it up to date.

    Parameters
    ----------
    situation : str
        The situation type of the amount.
    function : str
        One of `AGGREGATES`.
    amount : Expression
        The number to be summed or compared; 1 for a count.
    parameters : tuple of Parameter
        The names of its arguments in the conditions, and their classes.
    variables : tuple of Parameter
        The variables of the individuals to be aggregated.
    conditions : tuple of Condition
    """

    situation: str
    function: str
    amount: Expression
    parameters: tuple[Parameter, ...]
    variables: tuple[Parameter, ...] = ()
    conditions: tuple[Condition, ...] = ()

    @cached_property
    def kept(self) -> bool:
        """Whether the amount is part of each state; a maximum or minimum is replaced by conditions instead."""
        return self.function in ("sum", "count")

    @cached_property
    def kinds(self) -> Mapping[str, str]:
        """The class of each parameter and variable."""
        return {term.name: term.kind for term in (*self.parameters, *self.variables)}

    @cached_property
    def behavior(self) -> Behavior:
        """The aggregate as a behaviour that changes its amount, for functions that determine the dependencies of an amount."""
        head = AmountEffect(self.situation, tuple(p.name for p in self.parameters), "increase", self.amount)
        return Behavior(self.situation, 1, self.parameters, self.variables, self.conditions, cost=0.0, amounts=(head,))


@dataclass(frozen=True, order=True)
class GroundBehavior:
    """A quantified behaviour with the ID that its level's numbering gives it."""

    id: int
    behavior: str
    arguments: tuple[str, ...]

    def __str__(self) -> str:
        """Return the behaviour as in the paper's figures, e.g. ``22 B1_MOVE cup1 location7``."""
        return " ".join((str(self.id), self.behavior, *self.arguments))


@dataclass(frozen=True)
class Domain:
    """The situation types and behaviours of a domain, in declared order.

    `rules` has the defined situation types, each with its rules; `aggregates` the derived amounts. `constraints` has the situation
    types that are never true, or always true, by the name of the derived count of exceptions, whose maximum is 0.
    """

    situations: Mapping[str, SituationType]
    behaviors: Mapping[str, Behavior]
    first_ids: Mapping[int, int] = field(default_factory=dict)
    rules: Mapping[str, tuple[Rule, ...]] = field(default_factory=dict)
    aggregates: Mapping[str, Aggregate] = field(default_factory=dict)
    constraints: Mapping[str, Constraint] = field(default_factory=dict)

    @property
    def levels(self) -> tuple[int, ...]:
        """The levels with behaviours, the most abstract first."""
        return tuple(sorted({b.level for b in self.behaviors.values()}))

    def at_level(self, level: int) -> tuple[Behavior, ...]:
        """Return the behaviours of one level in declared order."""
        return tuple(b for b in self.behaviors.values() if b.level == level)


@dataclass(frozen=True)
class Problem:
    """A planning problem: a scene with its domain, initial state and goal.

    Parameters
    ----------
    scene : str
        IRI of the scene.
    domain : Domain
    classes : mapping of class to individuals
        In declared order; superclasses include their subclasses' individuals.
    relations : mapping of relation to set of tuples
        Static facts.
    initial : State
        One value for every symbol.
    goal : State
        Goal values of some symbols.
    parents : mapping of class to its direct superclasses
        For statistics that back off; the planner's search doesn't use it.
    value_levels : mapping of individual to level
        The first level on which a value exists, where that isn't 1.
    times : Times, optional
        Deadlines, windows and measured durations (`confab.reasoner.timing`).
    weights : mapping of Symbol to Fraction
        The costs of leaving goals unmet; goals without a weight must be met.
    """

    scene: str
    domain: Domain
    classes: Mapping[str, tuple[str, ...]]
    relations: Mapping[str, frozenset[tuple[str, ...]]]
    initial: State
    goal: State
    parents: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    value_levels: Mapping[str, int] = field(default_factory=dict)
    times: Times | None = None
    weights: Mapping[Symbol, Fraction] = field(default_factory=dict)

    def values(self, symbol: Symbol, level: int) -> tuple[str, ...]:
        """Return the values that a symbol can have on a level, in declared order."""
        members = self.classes.get(self.domain.situations[symbol.situation].range, ())
        return tuple(value for value in members if self.value_levels.get(value, 1) <= level)

    def first_level(self, symbol: Symbol) -> int:
        """Return the first level on which a symbol exists, with its situation type and its arguments."""
        individuals = (self.value_levels.get(argument, 1) for argument in symbol.arguments)
        return max((self.domain.situations[symbol.situation].level, *individuals))

    def sees(self, level: int, symbol: Symbol, value: str) -> bool:
        """Return whether a level sees a symbol and its value."""
        return self.first_level(symbol) <= level and self.value_levels.get(value, 1) <= level

    def goal_on(self, level: int) -> dict[Symbol, str]:
        """Return the goal of one level: the task's goal, and rest values of the symbols of `at_rest`."""
        return {**self.at_rest(level), **self.goal}

    def at_rest(self, level: int) -> dict[Symbol, str]:
        """Return the symbols that a level sees and that are initially at rest.

        Unstated boolean symbols count if the level changes them.
        """
        rests = {s.name: s.rest for s in self.domain.situations.values() if s.rest is not None}
        found = {s: v for s, v in self.initial.items() if v == rests.get(s.situation)}
        changed = frozenset[str]().union(*(behavior.changes for behavior in self.domain.at_level(level)))
        for name in sorted(changed & {name for name, rest in rests.items() if rest == FALSE}):
            for individuals in product(
                *(self.classes.get(kind, ()) for kind in self.domain.situations[name].arguments)
            ):
                if (symbol := Symbol(name, individuals)) not in self.initial:
                    found[symbol] = FALSE
        return {symbol: value for symbol, value in found.items() if self.first_level(symbol) <= level}

    def members(self, kind: str) -> frozenset[str]:
        """Return the individuals of a class as a set."""
        return self._members.get(kind, frozenset())

    @cached_property
    def individuals(self) -> frozenset[str]:
        """The individuals of all classes."""
        return frozenset[str]().union(*self.classes.values())

    @cached_property
    def _members(self) -> Mapping[str, frozenset[str]]:
        return {kind: frozenset(members) for kind, members in self.classes.items()}

    def id_of(self, behavior: str, arguments: tuple[str, ...]) -> int:
        """Return the ID of a quantified behaviour without enumerating the others.

        IDs are in declared order: of behaviours, then of parameters, then of individuals (section 4 of PAPER.md).
        """
        number, kinds = self._numbers[behavior]
        rank = 0
        for kind, argument in zip(kinds, arguments, strict=True):
            ranks = self._ranks[kind]
            rank = rank * len(ranks) + ranks[argument]
        return number + rank

    @cached_property
    def _numbers(self) -> Mapping[str, tuple[int, tuple[str, ...]]]:
        """The first ID of each behaviour, and the classes of its parameters."""
        found = {}
        for level in self.domain.levels:
            number = self.domain.first_ids.get(level, 0)
            for behavior in self.domain.at_level(level):
                kinds = tuple(parameter.kind for parameter in behavior.parameters)
                found[behavior.name] = number, kinds
                number += prod(len(self.classes.get(kind, ())) for kind in kinds)
        return found

    @cached_property
    def _ranks(self) -> Mapping[str, Mapping[str, int]]:
        return {kind: {member: i for i, member in enumerate(members)} for kind, members in self.classes.items()}


def substituted(condition: Condition, terms: Mapping[str, str]) -> Condition:
    """Return a condition with some terms substituted."""

    def put(names: Sequence[str]) -> tuple[str, ...]:
        return tuple(terms.get(name, name) for name in names)

    match condition:
        case ValueCondition(situation, arguments, value, negated):
            return ValueCondition(situation, put(arguments), terms.get(value, value), negated)
        case RelationCondition(relation, arguments, negated):
            return RelationCondition(relation, put(arguments), negated)
        case ClassCondition(term, kind, negated):
            return ClassCondition(terms.get(term, term), kind, negated)
        case EqualityCondition(left, right, negated):
            return EqualityCondition(terms.get(left, left), terms.get(right, right), negated)
        case Witness(variable, kind, conditions, negated):
            own = f"{variable}_inside" if variable in terms.values() else variable  # else it would capture that term
            inner = {**terms, variable: own}
            return Witness(own, kind, tuple(substituted(c, inner) for c in conditions), negated)
        case AnyOf(alternatives, negated, constraint):
            groups = tuple(tuple(substituted(c, terms) for c in group) for group in alternatives)
            return AnyOf(groups, negated, constraint)
        case Comparison(one, sign, other, negated):
            return Comparison(put_in(one, terms), sign, put_in(other, terms), negated)


def made_of(effect: Effect, one: str) -> Effect:
    """Return an effect on all individuals of a class as an effect on one of them."""
    if effect.each is None:
        return effect
    terms = {effect.each.name: one}
    arguments = tuple(terms.get(a, a) for a in effect.arguments)
    when = tuple(substituted(condition, terms) for condition in effect.when)
    if isinstance(effect, ValueEffect):
        return ValueEffect(effect.situation, arguments, terms.get(effect.value, effect.value), when)
    return AmountEffect(effect.situation, arguments, effect.operation, put_in(effect.amount, terms), when)


def spread(behavior: Behavior, classes: Mapping[str, Sequence[str]]) -> Behavior:
    """Return a behaviour with each effect on all individuals of a class replaced by effects on the individuals."""
    if all(effect.each is None for effect in behavior.every_effect):
        return behavior

    def single(effect: Effect) -> list[Effect]:
        return [effect] if effect.each is None else [made_of(effect, one) for one in classes.get(effect.each.kind, ())]

    every = [one for effect in behavior.every_effect for one in single(effect)]
    effects = tuple(one for one in every if isinstance(one, ValueEffect))
    amounts = tuple(one for one in every if isinstance(one, AmountEffect))
    kinds = {effect.each.kind for effect in behavior.every_effect if effect.each is not None}
    all_of = frozenset(one for kind in kinds for one in classes.get(kind, ()))
    by_name = {one for effect in behavior.effects for one in (*effect.arguments, effect.value)}
    by_name |= {one for one in all_of if any(substituted(c, {one: "?"}) != c for c in behavior.conditions)}
    return replace(behavior, effects=effects, amounts=amounts, spread=all_of - by_name)


def allowed(behavior: Behavior, situations: Mapping[str, SituationType]) -> tuple[Condition, ...]:
    """Return the preconditions that follow from the bounds of the amounts that a behaviour changes, if conditions can express them.

    Each is the negation of a violated bound, so it holds for missing amounts, which effects don't change.
    """
    found: list[Condition] = []
    changed = [effect.situation for effect in behavior.amounts]
    for effect in behavior.amounts:
        quantity, before = situations[effect.situation].quantity, Amount(effect.situation, effect.arguments)
        if quantity is None or changed.count(effect.situation) > 1:
            continue
        sign = {"increase": "+", "decrease": "-", "scale": "*"}.get(effect.operation)
        if sign == "*" and situations_in(effect.amount):
            continue
        after = effect.amount if sign is None else Calculation(sign, before, effect.amount)
        there = [Comparison(before, "=", before)] if sign is None else []
        for wrong, limit in (("<", quantity.least), (">", quantity.most)):
            if limit is not None:
                refused = (*effect.when, *there, Comparison(after, wrong, limit))
                found.append(
                    replace(refused[0], negated=True) if len(refused) == 1 else AnyOf((refused,), negated=True)
                )
    return tuple(found)

"""Dataclasses for symbols, facts, conditions, effects, behaviours and rules.

The module is independent of RDF, search and physics. Every name is a string that is unique in the scene (`cup1`, `B1_MOVE`,
`LOCATION`); `Names` maps names to IRIs. A term that starts with ``?`` is a parameter or variable; any other term is an individual.

============================  =========================================  =====================
in the paper                  standard term                              class
============================  =========================================  =====================
situated object symbol        state variable (SAS+)                      `Symbol`
situated object instance      fact                                       `Fact`
situation type                property of state variables, with domain   `SituationType`
behaviour                     action schema                              `Behavior`
quantified behaviour          ground action                              `GroundBehavior`
(none)                        axiom of a derived predicate               `Rule`
(none)                        derived amount: sum, count, extremum       `Aggregate`
============================  =========================================  =====================
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from fractions import Fraction
from functools import cached_property
from typing import Protocol, TypeAlias

from confab.reasoner.amounts import OPERATIONS, Expression, Quantity
from confab.reasoner.names import brief, known_as

TRUE = "true"
FALSE = "false"


@known_as("a symbol")
@dataclass(frozen=True, order=True)
class Symbol:
    """A situated object symbol ``<o, S>``: a situation type with its arguments; the first argument is the object."""

    situation: str
    arguments: tuple[str, ...]

    def __str__(self) -> str:
        """Return the symbol in the paper's notation, e.g. ``<cup1, LOCATION>``."""
        return f"<{', '.join((*self.arguments, self.situation))}>"


@known_as("a fact")
@dataclass(frozen=True, order=True)
class Fact:
    """A situated object instance ``<o, s>``: a symbol with a value."""

    symbol: Symbol
    value: str

    def __str__(self) -> str:
        """Return the fact in the notation of goals, e.g. ``cup1 LOCATION location7``."""
        return " ".join((*self.symbol.arguments[:1], self.symbol.situation, *self.symbol.arguments[1:], self.value))


State: TypeAlias = Mapping[Symbol, str]
"""The value of every symbol; a missing boolean symbol is `FALSE`."""


@dataclass(frozen=True)
class Perceived:
    """The way in which the values of a situation type are perceived.

    Attributes
    ----------
    by : str
        The perceiver.
    exclusive : bool
        Whether only one individual at a time can have a given value, unless the value is a special value.
    special : tuple of (str, str)
        Pairs of a name and a special value, e.g. ``("valueInHand", "in_hand")``.
    """

    by: str
    exclusive: bool = False
    special: tuple[tuple[str, str], ...] = ()


@known_as("a situation")
@brief
@dataclass(frozen=True)
class SituationType:
    """A property of objects that varies between states; the situation type is also the class of the property's values.

    `arguments` are the classes of the arguments, and `range` is the class of the values. A property that isn't functional is
    `boolean`: the property's value becomes the last argument of the symbol, and the symbol's own value is `TRUE` or `FALSE`. With a
    `quantity`, the values are numbers (`confab.reasoner.amounts`), and only symbols with a stated amount exist.

    `level` is the first level on which the symbols exist. `rest` is the value that a refinement must restore. `default` is the
    initial value of a symbol for which the scene states no value. `perceived` states how the values are perceived in physics; it is
    None for values that aren't perceived. `properties` are the names of the value properties. `added` states whether Confab added
    the situation type to express a condition about earlier states.
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
    properties: tuple[str, ...] = field(default=(), compare=False)
    added: bool = field(default=False, compare=False)


# ---------------------------------------------------------------------------------------------------------- conditions


@dataclass(frozen=True)
class ValueCondition:
    """The condition ``situation(arguments) = value``.

    If the value is an unbound variable, the condition determines the variable's value.

    A symbol that doesn't exist has no value: a condition on this symbol is false, and the negated condition is true.
    """

    situation: str
    arguments: tuple[str, ...]
    value: str
    negated: bool = False


@dataclass(frozen=True)
class RelationCondition:
    """The condition that a static relation holds between the arguments."""

    relation: str
    arguments: tuple[str, ...]
    negated: bool = False


@dataclass(frozen=True)
class ClassCondition:
    """The condition that a term denotes a member of a class."""

    term: str
    kind: str
    negated: bool = False


@dataclass(frozen=True)
class EqualityCondition:
    """The condition that two terms denote the same individual."""

    left: str
    right: str
    negated: bool = False


@dataclass(frozen=True)
class Witness:
    """The condition that some individual of class `kind`, denoted by `variable`, satisfies all `conditions`.

    A negated witness is the condition that no individual satisfies all `conditions`. "The location is free" is
    ``Witness("?o", "Movable", (LOCATION(?o) = ?l,), negated=True)``. If a witness that isn't negated expresses a comparison with a
    maximum or minimum, `comparison` is this comparison, which messages show.
    """

    variable: str
    kind: str
    conditions: tuple[Condition, ...]
    negated: bool = False
    comparison: Comparison | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True)
class Constraint:
    """A condition on every state: a situation type is never true, or is always true for all individuals of its argument classes.

    `about` names the constrained situation types if the constraint expresses that a type is true at most once, or only after
    another type.
    """

    situation: str
    always: bool = False
    about: tuple[str, ...] = ()

    def __str__(self) -> str:
        if self.about:
            return f"{self.about[0]} must be true {' '.join(('only after' if self.about[1:] else 'at most once', *self.about[1:]))}"
        return f"{self.situation} must {'always' if self.always else 'never'} be true"


@dataclass(frozen=True)
class AnyOf:
    """The condition that at least one alternative (a conjunction) is true; if negated, no alternative is true.

    A disjunction doesn't bind variables for conditions outside the disjunction. If the condition is a precondition that enforces
    a constraint, `constraint` is the constraint, which messages name.
    """

    alternatives: tuple[tuple[Condition, ...], ...]
    negated: bool = False
    constraint: Constraint | None = field(default=None, compare=False, repr=False)


NEVER = AnyOf(())
"""The condition that no state satisfies."""


@dataclass(frozen=True)
class Comparison:
    """A comparison of two numeric expressions by `operator` (a key of `amounts.COMPARING`).

    The comparison is false if a value is missing.
    """

    left: Expression
    operator: str
    right: Expression
    negated: bool = False


Condition: TypeAlias = (
    "ValueCondition | RelationCondition | ClassCondition | EqualityCondition | Witness | AnyOf | Comparison"
)


@dataclass(frozen=True)
class ValueEffect:
    """The effect that ``situation(arguments)`` becomes `value` if all conditions in `when` hold in the state before the behaviour.

    Conditions in `when` may determine variables. If the variable `each` is given, every member of its class has the effect. In a
    `Problem`, an effect on every member of a class has been replaced by one effect per member (`spread`).
    """

    situation: str
    arguments: tuple[str, ...]
    value: str
    when: tuple[Condition, ...] = ()
    each: Parameter | None = None


@dataclass(frozen=True)
class AmountEffect:
    """The effect that an amount is assigned, increased, decreased or scaled.

    The effect takes place if all conditions in `when` hold in the state before the behaviour.

    The number by which the amount changes is evaluated in the state before the behaviour; several changes of one amount are
    added.
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
    """The part of a step's duration in which a condition must hold, or the time at which an effect takes place."""

    START = "atStart"
    THROUGHOUT = "throughout"  # an effect with this span takes place at the end
    END = "atEnd"


@dataclass(frozen=True)
class Timing:
    """The duration of a behaviour, and the spans of its conditions and effects.

    Attributes
    ----------
    duration : Expression, optional
        The duration in seconds, evaluated in the state at the start of the behaviour. None stands for the duration of the
        refinement or, for a primitive behaviour, for the measured duration.
    actors : tuple of str
        Terms that denote the actors; an actor can take part in only one step at a time.
    conditions, effects : tuple of pairs
        All conditions and effects, each with its span.
    """

    duration: Expression | None = None
    actors: tuple[str, ...] = ()
    conditions: tuple[tuple[Span, Condition], ...] = ()
    effects: tuple[tuple[Span, Effect], ...] = ()

    def asked(self, span: Span) -> tuple[Condition, ...]:
        """Return the conditions that have the given span."""
        return tuple(condition for at, condition in self.conditions if at is span)

    def made(self, span: Span) -> tuple[Effect, ...]:
        """Return the effects that have the given span."""
        return tuple(effect for at, effect in self.effects if at is span)

    def before(self, span: Span) -> tuple[Condition, ...]:
        """Return the conditions that hold immediately before the effects in a span take place.

        A condition throughout the behaviour holds after the effects at the start, and before the pending effects take place.
        """
        apart = {Span.START: Span.START, Span.END: Span.THROUGHOUT}
        changed = {effect.situation for effect in self.made(apart[span])} if span in apart else set[str]()
        held = (
            one
            for one in self.asked(Span.THROUGHOUT)
            if not (isinstance(one, ValueCondition) and one.situation in changed)
        )
        return (*(() if span is Span.THROUGHOUT else self.asked(span)), *held)


@dataclass(frozen=True)
class Times:
    """The times of a task, in seconds from the beginning of the plan, or from the later moment `since`.

    Attributes
    ----------
    deadlines : mapping of Symbol to seconds
        The deadline of each goal: the goal must become true at this time at the latest, and hold from then on.
    windows : mapping of individual to pairs of seconds
        Time windows in which an individual is available; None as the end means that the window has no end. An individual without
        windows is always available.
    measured : mapping of behaviour to seconds
        The average measured duration of behaviours without a stated duration.
    events : mapping of behaviour to seconds
        The fixed times of events, which no actor executes (PDDL's timed initial literals).
    of_actors : mapping of (behaviour, actor) to seconds
        The average measured duration of a behaviour by a certain actor, which is used in place of the average over all actors.
    since : seconds
        The moment from which the times count, in seconds from the beginning of the plan. Reasons state times from the beginning.
    """

    deadlines: Mapping[Symbol, Fraction] = field(default_factory=dict)
    windows: Mapping[str, tuple[tuple[Fraction, Fraction | None], ...]] = field(default_factory=dict)
    measured: Mapping[str, Fraction] = field(default_factory=dict)
    events: Mapping[str, Fraction] = field(default_factory=dict)
    of_actors: Mapping[tuple[str, str], Fraction] = field(default_factory=dict)
    since: Fraction = Fraction(0)


# ---------------------------------------------------------------------------------------------------------- behaviours


@dataclass(frozen=True)
class Parameter:
    """A parameter (enumerated by quantification) or variable (determined by the state), with its class."""

    name: str
    kind: str


@known_as("a behaviour")
@brief
@dataclass(frozen=True)
class Behavior:
    """A lifted behaviour (action schema).

    Effects are applied in order; effects that make facts false come first. As in PDDL, if a behaviour makes a fact both false and
    true, the fact is true. A behaviour isn't applicable if it would violate the bounds of an amount.

    A `price` replaces `cost`; a precondition requires that the price is a number (`priced`). `timing` states the spans of
    conditions and effects (`confab.reasoner.timing`). If effects on all members of a class were replaced by effects on each member,
    `every` contains the replaced effects, and `spread` contains the individuals that only the effects on each member mention.
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
    every: tuple[Effect, ...] = ()

    def __post_init__(self) -> None:
        """Sort the effects in the order of their application."""
        object.__setattr__(self, "effects", tuple(sorted(self.effects, key=lambda effect: effect.value != FALSE)))
        if self.amounts:
            ordered = sorted(self.amounts, key=lambda effect: OPERATIONS.index(effect.operation))
            object.__setattr__(self, "amounts", tuple(ordered))

    @cached_property
    def priced(self) -> Comparison | None:
        """The precondition that the price is a number and not negative; None without a price."""
        return None if self.price is None else Comparison(self.price, ">=", Fraction(0))

    @cached_property
    def lasting(self) -> Comparison | None:
        """The precondition that a calculated duration is a number and not negative; None for other durations."""
        duration = None if self.timing is None else self.timing.duration
        return None if isinstance(duration, Fraction | None) else Comparison(duration, ">=", Fraction(0))

    @cached_property
    def asked(self) -> tuple[Condition, ...]:
        """The preconditions except `priced` and `lasting`."""
        return tuple(condition for condition in self.preconditions if condition not in (self.priced, self.lasting))

    @cached_property
    def every_effect(self) -> tuple[ValueEffect | AmountEffect, ...]:
        """The effects on values, followed by the effects on amounts."""
        return (*self.effects, *self.amounts)

    @cached_property
    def changes(self) -> frozenset[str]:
        """The situation types that the behaviour changes."""
        return frozenset(effect.situation for effect in self.every_effect)

    @cached_property
    def conditions(self) -> tuple[Condition, ...]:
        """The preconditions and the conditions of all effects."""
        return (*self.preconditions, *(condition for effect in self.every_effect for condition in effect.when))

    @cached_property
    def kinds(self) -> Mapping[str, str]:
        """The class of each parameter and variable."""
        return {term.name: term.kind for term in (*self.parameters, *self.variables)}


@dataclass(frozen=True)
class Rule:
    """A rule of a derived situation type: its symbol is true in every state in which all conditions hold.

    A symbol is true if at least one rule applies to the symbol, and false otherwise. States don't contain derived symbols; their
    values are computed on demand. Rules may be recursive, unless the recursion passes through a negation
    (`confab.reasoner.derivation`).

    Parameters
    ----------
    situation : str
        A boolean situation type that no behaviour changes.
    parameters : tuple of Parameter
        The names and classes of the arguments.
    variables : tuple of Parameter
        Further variables, whose individuals the conditions determine.
    conditions : tuple of Condition
    """

    situation: str
    parameters: tuple[Parameter, ...]
    variables: tuple[Parameter, ...] = ()
    conditions: tuple[Condition, ...] = ()

    @cached_property
    def behavior(self) -> Behavior:
        """The rule in the form of a behaviour that makes the situation type true.

        Functions that search for achievers use rules in the form of behaviours.
        """
        head = ValueEffect(self.situation, tuple(p.name for p in self.parameters), TRUE)
        return Behavior(self.situation, 1, self.parameters, self.variables, self.conditions, (head,), 0.0)


AGGREGATES = ("sum", "count", "max", "min")
"""Aggregate functions."""


@dataclass(frozen=True)
class Aggregate:
    """A rule of a derived amount: the sum, count, maximum or minimum over all solutions of its conditions, in every state.

    A solution assigns an individual to each variable in `variables`. Solutions for which `amount` has no value are
    ignored. A sum or count without solutions is zero; a maximum or minimum without solutions doesn't exist. Behaviours
    of the domain don't change a derived amount directly; `confab.reasoner.aggregates` adds effects that update the
    amount.

    Parameters
    ----------
    situation : str
        The situation type of the amount.
    function : str
        One of `AGGREGATES`.
    amount : Expression
        The number that is aggregated; it is 1 for a count.
    parameters : tuple of Parameter
        The names and classes of the arguments.
    variables : tuple of Parameter
        The variables over whose individuals the aggregate is computed.
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
        """Whether states contain the amount. States contain sums and counts; conditions replace maxima and minima."""
        return self.function in ("sum", "count")

    @cached_property
    def kinds(self) -> Mapping[str, str]:
        """The class of each parameter and variable."""
        return {term.name: term.kind for term in (*self.parameters, *self.variables)}

    @cached_property
    def behavior(self) -> Behavior:
        """The aggregate in the form of a behaviour that changes the amount; functions that determine dependencies use this form."""
        head = AmountEffect(self.situation, tuple(p.name for p in self.parameters), "increase", self.amount)
        return Behavior(self.situation, 1, self.parameters, self.variables, self.conditions, cost=0.0, amounts=(head,))


@dataclass(frozen=True, order=True)
class GroundBehavior:
    """A quantified behaviour (ground action) with its ID on its level."""

    id: int
    behavior: str
    arguments: tuple[str, ...]

    def __str__(self) -> str:
        """Return the behaviour in the notation of the paper's figures, e.g. ``22 B1_MOVE cup1 location7``."""
        return " ".join((str(self.id), self.behavior, *self.arguments))


class PrimitiveStep(Protocol):
    """A primitive of a plan, such as a `confab.planner.plan.Step`."""

    @property
    def path(self) -> tuple[int, ...]:
        """Position in the plan's tree."""

    @property
    def id(self) -> int:
        """ID of the grounded behaviour."""

    @property
    def behavior(self) -> str:
        """Name of the behaviour."""

    @property
    def arguments(self) -> tuple[str, ...]:
        """Individuals for the behaviour's parameters, in order."""

    @property
    def bindings(self) -> Mapping[str, str]:
        """Individuals for the variables that the parameters determine."""

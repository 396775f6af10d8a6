"""Dataclasses for planning problems: symbols, facts, conditions, effects, behaviours, rules and domains.

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

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from fractions import Fraction
from functools import cached_property
from itertools import product
from math import prod
from typing import Protocol, TypeAlias

from confab.reasoner.amounts import OPERATIONS, Amount, Calculation, Expression, Quantity, inside, put_in, situations_in
from confab.reasoner.closure import closure
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
    ``Witness("?o", "Movable", (LOCATION(?o) = ?l,), negated=True)``.
    """

    variable: str
    kind: str
    conditions: tuple[Condition, ...]
    negated: bool = False


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


@dataclass(frozen=True)
class Times:
    """The times of a task, in seconds from the beginning of the plan.

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
    """

    deadlines: Mapping[Symbol, Fraction] = field(default_factory=dict)
    windows: Mapping[str, tuple[tuple[Fraction, Fraction | None], ...]] = field(default_factory=dict)
    measured: Mapping[str, Fraction] = field(default_factory=dict)
    events: Mapping[str, Fraction] = field(default_factory=dict)
    of_actors: Mapping[tuple[str, str], Fraction] = field(default_factory=dict)


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


@known_as("a domain")
@brief
@dataclass(frozen=True)
class Domain:
    """The situation types and behaviours of a domain, in declared order.

    `rules` contains the rules of each derived situation type, and `aggregates` contains the rules of derived amounts.
    `constraints` maps the name of a derived count of violations, whose maximum is 0, to the constraint. `remembers` maps each
    remembered situation type to the original situation type that it remembers, in order of dependency. A remembered symbol
    becomes true when the original symbol with the same arguments becomes true, and stays true.
    """

    situations: Mapping[str, SituationType]
    behaviors: Mapping[str, Behavior]
    first_ids: Mapping[int, int] = field(default_factory=dict)
    rules: Mapping[str, tuple[Rule, ...]] = field(default_factory=dict)
    aggregates: Mapping[str, Aggregate] = field(default_factory=dict)
    constraints: Mapping[str, Constraint] = field(default_factory=dict)
    remembers: Mapping[str, str] = field(default_factory=dict)

    @cached_property
    def authored(self) -> frozenset[str]:
        """The situation types of the ontology's author, without the situation types that Confab adds."""
        return frozenset(
            name for name, one in self.situations.items() if not one.added and name not in self.constraints
        )

    @property
    def levels(self) -> tuple[int, ...]:
        """The levels with behaviours, beginning with the most abstract level."""
        return tuple(sorted({b.level for b in self.behaviors.values()}))

    def at_level(self, level: int) -> tuple[Behavior, ...]:
        """Return the behaviours of a level in declared order."""
        return tuple(b for b in self.behaviors.values() if b.level == level)


@known_as("a problem")
@brief
@dataclass(frozen=True)
class Problem:
    """A planning problem: a scene with its domain, initial state and goal.

    Parameters
    ----------
    scene : str
        IRI of the scene.
    domain : Domain
    classes : mapping of class to individuals
        The members of each class and its subclasses, in declared order.
    relations : mapping of relation to set of tuples
        The rows of each static relation.
    initial : State
    goal : State
        The goal: values of some symbols.
    parents : mapping of class to its direct superclasses
        The superclasses are used by statistics that generalise over classes, and not by the search.
    value_levels : mapping of individual to level
        The first level on which each value exists; values without an entry exist from level 1 on.
    times : Times, optional
        Deadlines, time windows and measured durations (`confab.reasoner.timing`).
    weights : mapping of Symbol to Fraction
        The cost of leaving each soft goal unmet; a goal without a weight must be met.
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

    def only(self, unmet: Collection[Symbol]) -> Problem:
        """Return the problem without the soft goals `unmet`; all other goals must be met."""
        return replace(self.without_goals(unmet), weights={})

    def without_goals(self, dropped: Collection[Symbol]) -> Problem:
        """Return the problem without the goals for some symbols, their weights and their deadlines."""
        goal = {symbol: value for symbol, value in self.goal.items() if symbol not in dropped}
        weights = {symbol: weight for symbol, weight in self.weights.items() if symbol not in dropped}
        known = self.times.deadlines if self.times is not None else {}
        by = {symbol: seconds for symbol, seconds in known.items() if symbol not in dropped}
        times = replace(self.times, deadlines=by) if self.times is not None else None
        return replace(self, goal=goal, weights=weights, times=times)

    def values(self, symbol: Symbol, level: int) -> tuple[str, ...]:
        """Return the values that a symbol can have on a level, in declared order."""
        members = self.classes.get(self.domain.situations[symbol.situation].range, ())
        return tuple(value for value in members if self.value_levels.get(value, 1) <= level)

    def first_level(self, symbol: Symbol) -> int:
        """Return the first level on which a symbol, its situation type and its arguments exist."""
        individuals = (self.value_levels.get(argument, 1) for argument in symbol.arguments)
        return max((self.domain.situations[symbol.situation].level, *individuals))

    def sees(self, level: int, symbol: Symbol, value: str) -> bool:
        """Return whether a symbol and a value exist on a level."""
        return self.first_level(symbol) <= level and self.value_levels.get(value, 1) <= level

    def releases(self, symbol: Symbol) -> bool:
        """Return whether a goal is about a symbol, directly or by a definition, and so releases the symbol from its rest value."""
        terms = self.read_by_goals.get(symbol.situation, ())
        return symbol in self.goal or symbol in self.weights or any(self._fits(symbol, one) for one in terms)

    def concerns(self, goal: Symbol, symbol: Symbol) -> bool:
        """Return whether one goal is about a symbol, directly or by a definition."""
        return goal == symbol or any(self._fits(symbol, one) for one in self._read_by(goal).get(symbol.situation, ()))

    def may_leave_rest(self, goal: Symbol) -> bool:
        """Return whether a goal may demand other values than rest values."""
        rest = self.domain.situations[goal.situation].rest
        return bool(self._read_by(goal)) if rest is None else rest != self.goal.get(goal)

    def _fits(self, symbol: Symbol, terms: tuple[str, ...]) -> bool:
        """Return whether the arguments of a symbol fit terms: individuals, classes, or variables that stand for any individual."""
        of = zip(terms, symbol.arguments, strict=True)
        return all(term == one or term.startswith("?") or one in self.members(term) for term, one in of)

    @cached_property
    def read_by_goals(self) -> Mapping[str, set[tuple[str, ...]]]:
        """The individuals or classes of the symbols with rest values that definitions of goals read, by situation type."""
        found: dict[str, set[tuple[str, ...]]] = {}
        for goal in {*self.goal, *self.weights}:
            for situation, terms in self._read_by(goal).items():
                found.setdefault(situation, set()).update(terms)
        return found

    def _read_by(self, goal: Symbol) -> Mapping[str, set[tuple[str, ...]]]:
        if goal.situation not in self.domain.rules and goal.situation not in self.domain.aggregates:
            return {}
        found: dict[str, set[tuple[str, ...]]] = {}
        for situation, terms in read_through(goal, self.domain):
            if self.domain.situations[situation].rest is not None:
                found.setdefault(situation, set()).add(terms)
        return found

    def goal_on(self, level: int) -> dict[Symbol, str]:
        """Return the goal on a level: the task's goals, and the rest values that `at_rest` returns."""
        return {**self.at_rest(level), **self.goal}

    def at_rest(self, level: int) -> dict[Symbol, str]:
        """Return the symbols on a level that initially have their rest value, except those that a definition of a goal reads.

        Boolean symbols that the initial state omits are included if a behaviour of the level changes their situation type.
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
        return {
            symbol: value
            for symbol, value in found.items()
            if self.first_level(symbol) <= level and (symbol in self.goal or not self.releases(symbol))
        }

    def members(self, kind: str) -> frozenset[str]:
        """Return the members of a class as a set."""
        return self._members.get(kind, frozenset())

    def superclasses(self, kind: str) -> set[str]:
        """Return a class with all its superclasses."""
        return closure([kind], lambda each: self.parents.get(each, ()))

    def below(self, kind: str, other: str) -> bool:
        """Return whether every individual of a class or union of classes belongs to another class or union."""
        above = {*other.split("|"), other}
        return not any(self.superclasses(part).isdisjoint(above) for part in kind.split("|"))

    @cached_property
    def individuals(self) -> frozenset[str]:
        """All individuals of the problem's classes."""
        return frozenset[str]().union(*self.classes.values())

    @cached_property
    def _members(self) -> Mapping[str, frozenset[str]]:
        return {kind: frozenset(members) for kind, members in self.classes.items()}

    def id_of(self, behavior: str, arguments: tuple[str, ...]) -> int:
        """Return the ID of a quantified behaviour without enumerating other behaviours.

        IDs follow the declared order of behaviours, then of parameters, then of individuals (section 4 of PAPER.md).
        """
        number, kinds = self._numbers[behavior]
        rank = 0
        for kind, argument in zip(kinds, arguments, strict=True):
            ranks = self._ranks[kind]
            rank = rank * len(ranks) + ranks[argument]
        return number + rank

    def quantified(self, level: int) -> int:
        """Return the number of quantified behaviours of a level."""
        return sum(
            prod(len(self.classes.get(parameter.kind, ())) for parameter in behavior.parameters)
            for behavior in self.domain.at_level(level)
        )

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


def read_through(symbol: Symbol, domain: Domain) -> set[tuple[str, tuple[str, ...]]]:
    """Return the situation types that the definition of a derived symbol reads, directly or by further definitions.

    Each situation type has its terms: individuals, and classes in the place of variables. A stated symbol reads only itself.
    """

    def read(of: tuple[str, tuple[str, ...]]) -> Iterator[tuple[str, tuple[str, ...]]]:
        total = domain.aggregates.get(of[0])
        for one in (*domain.rules.get(of[0], ()), *((total,) if total else ())):
            arguments = {p.name: term for p, term in zip(one.parameters, of[1], strict=True)}
            kinds = {**{v.name: v.kind for v in one.variables}, **arguments}
            yield from _symbols_in(one.conditions, kinds)
            if isinstance(one, Aggregate):
                yield from _amounts_in(one.amount, kinds)

    return closure([(symbol.situation, symbol.arguments)], read)


def _symbols_in(conditions: Sequence[Condition], kinds: Mapping[str, str]) -> Iterator[tuple[str, tuple[str, ...]]]:
    for condition in conditions:
        match condition:
            case ValueCondition(situation, arguments):
                yield situation, tuple(kinds.get(term, term) for term in arguments)
            case Comparison(left, _, right):
                yield from _amounts_in(left, kinds)
                yield from _amounts_in(right, kinds)
            case Witness(variable, kind, inner):
                yield from _symbols_in(inner, {**kinds, variable: kind})
            case AnyOf(alternatives):
                for group in alternatives:
                    yield from _symbols_in(group, kinds)
            case RelationCondition() | ClassCondition() | EqualityCondition():
                pass


def _amounts_in(expression: Expression, kinds: Mapping[str, str]) -> Iterator[tuple[str, tuple[str, ...]]]:
    for part in inside(expression):
        if isinstance(part, Amount):
            yield part.situation, tuple(kinds.get(term, term) for term in part.arguments)


def substituted(condition: Condition, terms: Mapping[str, str]) -> Condition:
    """Return a condition in which `terms` maps terms to their replacements."""

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
            own = f"{variable}_inside" if variable in terms.values() else variable  # avoids variable capture
            inner = {**terms, variable: own}
            return Witness(own, kind, tuple(substituted(c, inner) for c in conditions), negated)
        case AnyOf(alternatives, negated, constraint):
            groups = tuple(tuple(substituted(c, terms) for c in group) for group in alternatives)
            return AnyOf(groups, negated, constraint)
        case Comparison(one, sign, other, negated):
            return Comparison(put_in(one, terms), sign, put_in(other, terms), negated)


def made_of(effect: Effect, one: str) -> Effect:
    """Return, for an effect on all members of a class, the effect on one of the members."""
    if effect.each is None:
        return effect
    terms = {effect.each.name: one}
    arguments = tuple(terms.get(a, a) for a in effect.arguments)
    when = tuple(substituted(condition, terms) for condition in effect.when)
    if isinstance(effect, ValueEffect):
        return ValueEffect(effect.situation, arguments, terms.get(effect.value, effect.value), when)
    return AmountEffect(effect.situation, arguments, effect.operation, put_in(effect.amount, terms), when)


def spread(behavior: Behavior, classes: Mapping[str, Sequence[str]]) -> Behavior:
    """Return a behaviour in which each effect on all members of a class is replaced by one effect per member."""
    timing = behavior.timing
    if all(
        effect.each is None
        for effect in (*behavior.every_effect, *(one for _, one in (timing.effects if timing else ())))
    ):
        return behavior

    def single(effect: Effect) -> list[Effect]:
        return [effect] if effect.each is None else [made_of(effect, one) for one in classes.get(effect.each.kind, ())]

    every = [one for effect in behavior.every_effect for one in single(effect)]
    effects = tuple(one for one in every if isinstance(one, ValueEffect))
    amounts = tuple(one for one in every if isinstance(one, AmountEffect))
    replaced = tuple(effect for effect in behavior.every_effect if effect.each is not None)
    kinds = {effect.each.kind for effect in replaced if effect.each is not None}
    all_of = frozenset(one for kind in kinds for one in classes.get(kind, ()))
    by_name = {one for effect in behavior.effects for one in (*effect.arguments, effect.value)}
    by_name |= {one for one in all_of if any(substituted(c, {one: "?"}) != c for c in behavior.conditions)}
    if timing is not None:
        timing = replace(timing, effects=tuple((at, one) for at, effect in timing.effects for one in single(effect)))
    return replace(behavior, effects=effects, amounts=amounts, timing=timing, spread=all_of - by_name, every=replaced)


def spread_to(behavior: Behavior, individual: str, kinds: Collection[str]) -> Behavior:
    """Return a behaviour with the effects on one more member of the classes `kinds`; see `spread`."""
    more = [made_of(one, individual) for one in behavior.every if one.each is not None and one.each.kind in kinds]
    if not more:
        return behavior
    effects = (*behavior.effects, *(one for one in more if isinstance(one, ValueEffect)))
    amounts = (*behavior.amounts, *(one for one in more if isinstance(one, AmountEffect)))
    return replace(behavior, effects=effects, amounts=amounts, spread=behavior.spread | {individual})


def allowed(behavior: Behavior, situations: Mapping[str, SituationType]) -> tuple[Condition, ...]:
    """Return preconditions under which a behaviour keeps amounts within their bounds, as far as conditions can express this.

    Each precondition states that a bound isn't violated. For an amount that doesn't exist, the precondition holds; an effect
    doesn't change an amount that doesn't exist.
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

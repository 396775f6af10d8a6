"""The pieces of a behaviour: its conditions and effects at the begin, throughout its duration, and at the end.

==========  ==========================================  =========================================================
piece       conditions                                  effects
==========  ==========================================  =========================================================
begin       at the start                                at the start
middle      throughout                                  pending: determined at the begin
end         at the end                                  at the end
==========  ==========================================  =========================================================
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from confab.planner.checked_amounts import worth
from confab.planner.checked_conditions import Arguments, ConditionReader
from confab.planner.plan import Step
from confab.planner.validation import BehaviorReader, LoggedState
from confab.reasoner.amounts import Quantity
from confab.reasoner.derivation import deciding
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import (
    AmountEffect,
    Behavior,
    Condition,
    Effect,
    Parameter,
    Span,
    Times,
    Timing,
    ValueEffect,
)
from confab.reasoner.timing import fixed_at_begin, on_each, timing_of, with_fixed

SECOND = Fraction(1)
"""Default duration of a primitive, in seconds."""


@dataclass(frozen=True)
class Pieces:
    """The pieces of a behaviour.

    The parameters of each piece are the parameters of the behaviour, followed by `fixed`, the variables that the preconditions
    determine. `held` has the conditions of the middle without its effects.
    """

    whole: Behavior
    fixed: tuple[Parameter, ...]
    timing: Timing
    begin: Behavior
    middle: Behavior
    end: Behavior
    held: Behavior


def pieces_of(problem: Problem, behavior: Behavior) -> Pieces:
    """Return the pieces of a behaviour, without effects on totals that the state alone determines."""
    timing, free = timing_of(behavior), free_totals(problem)
    fixed, own = fixed_at_begin(behavior), with_fixed(behavior)

    def piece(name: str, conditions: Sequence[Condition], effects: Sequence[Effect]) -> Behavior:
        spread = on_each([one for one in effects if one.situation not in free], problem.classes)
        return replace(
            own,
            name=f"{behavior.name}@{name}",
            preconditions=tuple(conditions),
            effects=tuple(e for e in spread if isinstance(e, ValueEffect)),
            amounts=tuple(e for e in spread if isinstance(e, AmountEffect)),
            price=None,
            timing=None,
        )

    begin, middle, end = (
        piece(span.value, timing.asked(span), timing.made(span)) for span in (Span.START, Span.THROUGHOUT, Span.END)
    )
    held = piece("held", timing.asked(Span.THROUGHOUT), ())
    return Pieces(behavior, fixed, timing, begin, middle, end, held)


def free_totals(problem: Problem) -> frozenset[str]:
    """Return the totals without bounds that decide no goal with a deadline.

    A step that reads such a total reads the facts that determine the total.
    """
    deadlines = problem.times.deadlines if problem.times is not None else ()
    timed = {deciding(problem, goal).situation for goal in deadlines if goal in problem.goal}
    kinds, every = problem.domain.situations, problem.domain.aggregates.items()
    return frozenset(
        name for name, one in every if one.kept and name not in timed and kinds[name].quantity in (None, Quantity())
    )


def terms_at(rules: BehaviorReader, pieces: Pieces, arguments: Arguments, facts: LoggedState) -> Arguments:
    """When a behaviour begins, return the individuals for the parameters of its pieces."""
    behavior = pieces.whole
    if not pieces.fixed:
        return arguments
    given = {p.name: argument for p, argument in zip(behavior.parameters, arguments, strict=True)}
    found = rules.satisfied(behavior.preconditions, given, behavior.kinds, facts) or given
    return (*arguments, *(found.get(v.name, v.name) for v in pieces.fixed))


def duration_of(problem: Problem, behavior: Behavior, arguments: Arguments, facts: LoggedState) -> Fraction | None:
    """Return the duration of a step at its begin, in seconds, or None if the duration isn't a number or is negative.

    `arguments` is a result of `terms_at`.
    """
    stated = timing_of(behavior).duration
    if stated is None:
        times = problem.times or Times()
        acting = actors_of(problem, behavior, arguments, default_actors(problem)) if times.of_actors else ()
        own = [times.of_actors[behavior.name, a] for a in acting if (behavior.name, a) in times.of_actors]
        return max(own, default=times.measured.get(behavior.name, SECOND))
    names = [term.name for term in with_fixed(behavior).parameters]
    reader = ConditionReader(BehaviorReader(problem), names)
    its = worth(stated, reader.key, problem.relations)
    seconds = its(facts.value, [*arguments, *list(reader.places)[len(arguments) :]])
    return None if seconds is None or seconds < 0 else seconds


def actors_of(problem: Problem, behavior: Behavior, arguments: Arguments, resting: frozenset[str]) -> tuple[str, ...]:
    """Return the actors that the behaviour of a step names; if it names none, return the first argument in `resting`.

    `resting` is the result of `default_actors`.
    """
    stated = timing_of(behavior).actors
    if stated:
        given: Mapping[str, str] = dict(zip((t.name for t in with_fixed(behavior).parameters), arguments, strict=False))
        return tuple(dict.fromkeys(given.get(actor, actor) for actor in stated))
    return next(((argument,) for argument in arguments if argument in resting), ())


def actors_of_step(problem: Problem, step: Step, resting: frozenset[str]) -> tuple[str, ...]:
    """Return the actors of a step, as far as its arguments and bindings determine them; `resting` is as for `actors_of`."""
    behavior = problem.domain.behaviors[step.behavior]
    fixed = (step.bindings.get(v.name[1:], v.name) for v in fixed_at_begin(behavior))
    return actors_of(problem, behavior, (*step.arguments, *fixed), resting)


def default_actors(problem: Problem) -> frozenset[str]:
    """Return the workers of a problem, or no individuals if some behaviour names its actors."""
    named = any(timing_of(behavior).actors for behavior in problem.domain.behaviors.values())
    return frozenset() if named else workers_of(problem)


def workers_of(problem: Problem) -> frozenset[str]:
    """Return the individuals whose class is the first argument of a situation type with a rest value.

    A worker executes one primitive at a time.
    """
    kinds = {s.arguments[0] for s in problem.domain.situations.values() if s.rest is not None and s.arguments}
    return frozenset(individual for kind in kinds for individual in problem.classes.get(kind, ()))

"""Durations, actors and time spans of behaviours (docs/levels.md, "In time").

The preconditions and effects of a behaviour are its *projection*: the conditions before the behaviour and the effects after the
behaviour, if no other step overlaps the behaviour. All planners use the projection. In addition, `Timing` states when each
condition must hold and when each effect takes place.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Container, Iterable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction

from confab.reasoner.afterwards import Afterwards, Simplified, TooManyCasesError, closed
from confab.reasoner.amounts import (
    COMPARING,
    OPERATIONS,
    Amount,
    Expression,
    after_effect,
    inside,
    situations_in,
    terms_of,
    with_amounts,
)
from confab.reasoner.effects import made_of
from confab.reasoner.language import DomainError, is_variable, plain_variables, situations_of, terms, walk
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import (
    FALSE,
    NEVER,
    TRUE,
    AmountEffect,
    AnyOf,
    Behavior,
    Comparison,
    Condition,
    Effect,
    Parameter,
    SituationType,
    Span,
    Timing,
    ValueCondition,
    ValueEffect,
    Witness,
)


def timing_of(behavior: Behavior) -> Timing:
    """Return a behaviour's timing; by default, all conditions and effects have the span `THROUGHOUT`."""
    if behavior.timing is not None:
        return behavior.timing
    conditions = tuple((Span.THROUGHOUT, condition) for condition in behavior.preconditions)
    return Timing(None, (), conditions, tuple((Span.THROUGHOUT, effect) for effect in behavior.every_effect))


def fixed_at_begin(behavior: Behavior) -> tuple[Parameter, ...]:
    """Return the variables that the preconditions of a behaviour determine when a step begins; they keep their individuals."""
    named = {term for condition in behavior.preconditions for term in terms(condition)}
    return tuple(variable for variable in behavior.variables if variable.name in named)


def with_fixed(behavior: Behavior) -> Behavior:
    """Return a behaviour whose parameters include the variables that its preconditions determine when a step begins."""
    fixed = fixed_at_begin(behavior)
    others = tuple(variable for variable in behavior.variables if variable not in fixed)
    return replace(behavior, parameters=(*behavior.parameters, *fixed), variables=others)


def projected(
    conditions: Sequence[tuple[Span, Condition]],
    effects: Sequence[tuple[Span, Effect]],
    given: Callable[[Span, Condition, Effect], tuple[Condition, ...]] | None = None,
) -> tuple[tuple[Condition, ...], tuple[Effect, ...]]:
    """Return the preconditions and effects of a behaviour that no other step overlaps.

    A condition that earlier effects of the behaviour achieve is omitted; `NEVER` follows a condition that they contradict. A
    condition on amounts that earlier effects change becomes a condition on the amounts before the behaviour, and so do the
    calculations and conditions of effects. An effect that a later effect overwrites is omitted. Increases, decreases and factors
    overwrite nothing, and equal ones add up; if an amount is increased or decreased before it is scaled, it is assigned the result.
    `given` returns what a condition of an effect requires before the behaviour if this function leaves the condition as it is.
    """
    spans = tuple(Span)

    certain = sorted(
        ((spans.index(span), one) for span, one in effects if not one.when and not one.each), key=lambda pair: pair[0]
    )
    set_last = {
        (one.situation, one.arguments): at
        for at, one in certain
        if isinstance(one, ValueEffect) or one.operation == "assign"
    }
    made = {span: [e for its, e in effects if its is span] for span in spans}
    amounts: dict[Span, dict[Amount, Expression]] = {}
    now = dict[Amount, Expression]()
    for span in spans:
        amounts[span], now = now, _amounts_after(now, made[span])

    def before(span: Span, condition: Condition) -> tuple[Condition, ...]:
        earlier = [made[other] for other in reversed(spans[: spans.index(span)])]
        if isinstance(condition, ValueCondition):
            decided = _decided(condition, earlier)
            return (condition,) if decided is None else () if decided else (condition, NEVER)
        return _compared_before(condition, amounts[span]) if isinstance(condition, Comparison) else (condition,)

    def required(span: Span, condition: Condition, effect: Effect) -> tuple[Condition, ...]:
        found = before(span, condition)
        return found if given is None or found != (condition,) else given(span, condition, effect)

    changes = [(at, one, Amount(one.situation, one.arguments)) for at, one in certain if isinstance(one, AmountEffect)]
    scaled_last = {cell: at for at, one, cell in changes if one.operation == "scale"}
    mixed = dict.fromkeys(
        cell for at, one, cell in changes if one.operation in ("increase", "decrease") and at < scaled_last.get(cell, 0)
    )
    asked = dict.fromkeys(one for span, condition in conditions for one in before(span, condition))
    found = list[Effect]()
    for span, effect in effects:
        when = tuple(one for condition in effect.when for one in required(span, condition, effect))
        cell = Amount(effect.situation, effect.arguments)
        overwritten = spans.index(span) < set_last.get((effect.situation, effect.arguments), 0)
        if overwritten or (cell in mixed and not effect.when and not effect.each):
            continue
        if isinstance(effect, AmountEffect):
            effect = replace(effect, amount=with_amounts(effect.amount, amounts[span]))
        found.append(replace(effect, when=when))
    assigned = (AmountEffect(one.situation, one.arguments, "assign", now[one]) for one in mixed)
    return tuple(asked), (*found, *assigned)


def _amounts_after(now: Mapping[Amount, Expression], effects: Iterable[Effect]) -> dict[Amount, Expression]:
    """Return the amounts after effects without conditions as expressions of the amounts at first, given those before."""
    after = {**now}
    amounts = [e for e in effects if isinstance(e, AmountEffect) and not e.when and not e.each]
    for effect in sorted(amounts, key=lambda one: OPERATIONS.index(one.operation)):
        cell = Amount(effect.situation, effect.arguments)
        after[cell] = after_effect(after.get(cell, cell), effect.operation, with_amounts(effect.amount, now))
    return after


def _decided(condition: ValueCondition, effects: Iterable[Sequence[Effect]]) -> bool | None:
    """Return whether effects achieve or contradict a condition, or None for neither; the latest effects come first."""
    wanted, uncertain = condition.value, False
    for made in effects:
        about = [e for e in made if isinstance(e, ValueEffect) and e.situation == condition.situation]
        certain = [e for e in about if e.arguments == condition.arguments and not e.when and not e.each]
        uncertain = uncertain or len(certain) < len(about)
        if certain:
            value = max((e.value for e in certain), key=lambda one: one != FALSE)  # the step's falsehoods come first
            if value != wanted and "?" in (value[0], wanted[0]):
                return None
            holds = (value == wanted) is not condition.negated
            return holds or (None if uncertain else False)
    return None


def _compared_before(condition: Comparison, amounts: Mapping[Amount, Expression]) -> tuple[Condition, ...]:
    """Return the conditions under which a comparison holds, given the changed amounts as expressions of the amounts before."""
    parts = (part for one in (condition.left, condition.right) for part in inside(one))
    there = dict.fromkeys(part for part in parts if isinstance(part, Amount) and part in amounts)
    if not there:
        return (condition,)
    left, right = with_amounts(condition.left, amounts), with_amounts(condition.right, amounts)
    found: list[Condition] = [Comparison(cell, "=", cell) for cell in there]  # no effect changes a missing amount
    holds = COMPARING[condition.operator]
    if not (isinstance(left, Fraction) and isinstance(right, Fraction) and holds(left, right) is not condition.negated):
        found.append(replace(condition, left=left, right=right))
    return tuple(found)


def given_itself(
    behavior: Behavior,
    conditions: Iterable[Condition],
    spans: Collection[Span],
    situations: Mapping[str, SituationType],
    classes: Mapping[str, Sequence[str]],
    since: Span = Span.START,
) -> tuple[Condition, ...]:
    """Return conditions of a durative behaviour before its own effects in earlier spans, beginning with the span `since`.

    In contrast to `projected`, the conditions may have alternatives, witnesses or totals, and the effects may have conditions.
    """
    found = list[Condition]()
    for condition in conditions:
        its = [span for span, one in timing_of(behavior).conditions if one == condition and span in spans]
        for span in its:
            found += _given(condition, span, behavior, situations, classes, since)
        if not its:
            found.append(condition)
    return tuple(dict.fromkeys(found))


def with_given_effects(
    behavior: Behavior,
    totals: Container[str],
    situations: Mapping[str, SituationType],
    classes: Mapping[str, Sequence[str]],
) -> Behavior:
    """Return a durative behaviour whose effects have the conditions that they require before the behaviour.

    In contrast to `projected`, the conditions may have alternatives, witnesses or totals, and the effects in earlier spans may
    have conditions. The effects on `totals` are left as they are.
    """
    own = [(span, effect) for span, effect in timing_of(behavior).effects if effect.situation not in totals]

    def given(span: Span, condition: Condition, effect: Effect) -> tuple[Condition, ...]:
        return _given(condition, span, behavior, situations, classes, effect=effect)

    _, effects = projected((), own, given)
    if effects == projected((), own)[1]:
        return behavior
    others = (one for one in behavior.amounts if one.situation in totals)
    return replace(
        behavior,
        effects=tuple(one for one in effects if isinstance(one, ValueEffect)),
        amounts=(*(one for one in effects if isinstance(one, AmountEffect)), *others),
    )


def _given(
    condition: Condition,
    span: Span,
    behavior: Behavior,
    situations: Mapping[str, SituationType],
    classes: Mapping[str, Sequence[str]],
    since: Span = Span.START,
    effect: Effect | None = None,
) -> tuple[Condition, ...]:
    """Return what a condition in a span requires before the effects of a durative behaviour in earlier spans.

    If `effect` is given, the condition is a condition of this effect, whose variables are bound, too. A condition that binds a
    variable is left as it is.
    """
    timing, kinds = timing_of(behavior), dict(behavior.kinds)
    fixed = {p.name for p in behavior.parameters}
    bound = frozenset(fixed | plain_variables(behavior.preconditions))
    if effect is not None:
        each = {effect.each.name: effect.each.kind} if effect.each else {}
        kinds, fixed = kinds | each, fixed | each.keys()
        used = (effect.value,) if isinstance(effect, ValueEffect) else terms_of(effect.amount)
        bound = bound.union(each, effect.arguments, used, plain_variables(effect.when))
    binds = isinstance(condition, ValueCondition) and any(is_variable(t) and t not in fixed for t in terms(condition))
    if binds or not isinstance(condition, AnyOf | Witness | Comparison | ValueCondition):
        return (condition,)
    if condition in (behavior.priced, behavior.lasting):
        return (condition,)
    found: Simplified = condition
    for earlier in reversed(tuple(Span)[tuple(Span).index(since) : tuple(Span).index(span)]):
        made = timing.made(earlier)
        part = replace(
            behavior,
            effects=tuple(one for one in made if isinstance(one, ValueEffect)),
            amounts=tuple(one for one in made if isinstance(one, AmountEffect)),
        )
        if isinstance(found, bool) or not any(situations_of(one) & part.changes for one in walk(found)):
            continue
        kinds |= {one.each.name: one.each.kind for one in made if one.each is not None}
        after = Afterwards(part, situations, classes, kinds, timing.before(earlier))
        (found,) = closed([found], bound, after.kinds)
        try:
            found = after.condition(after.renamed(found))
        except TooManyCasesError:
            raise DomainError(
                f"{behavior.name}: too many of its effects may decide one of its conditions; use fewer effects"
            ) from None
        if not isinstance(found, bool):
            (found,) = closed([found], bound, after.kinds)
    return (found,) if not isinstance(found, bool) else () if found else (condition, NEVER)


def only_during(problem: Problem) -> frozenset[str]:
    """Return the behaviours that give a symbol a required value only during their execution.

    The goal or another behaviour may require this value.

    A plan that uses a value of this kind needs concurrency: if steps are executed one after another, no other step ever finds the
    value.
    """
    found = set[str]()
    for behavior in problem.domain.behaviors.values():
        for effect in _passing(behavior):
            kinds = {**behavior.kinds, **({effect.each.name: effect.each.kind} if effect.each else {})}
            if any(
                _asks(problem, other, effect, kinds)
                for other in problem.domain.behaviors.values()
                if other.name != behavior.name and other.level == behavior.level
            ) or any(
                s.situation == effect.situation
                and v == effect.value
                and _may_agree(problem, (effect.arguments, kinds), (s.arguments, {}))
                for s, v in problem.goal.items()
            ):
                found.add(behavior.name)
    return frozenset(found)


def may_overlap_by_need(problem: Problem) -> bool:
    """Return whether a condition or effect concerns the start or end of a step.

    If conditions or effects concern only the start or end of a step, overlapping steps may reach more goals.
    """
    return any(
        span is not Span.THROUGHOUT
        for behavior in problem.domain.behaviors.values()
        if behavior.timing is not None
        for span, _ in (*behavior.timing.conditions, *behavior.timing.effects)
    )


def judged_by_events(problem: Problem) -> bool:
    """Return whether the begins and ends of steps determine alone whether a timed plan is valid (docs/levels.md, "In time").

    Otherwise the steps of a timed plan also have to be a valid plan if they are executed one after another.
    """
    return may_overlap_by_need(problem) and len(problem.domain.levels) == 1 and not problem.domain.remembers


def by_events(problem: Problem) -> Problem | None:
    """Return a problem in which the begin, the duration and the end of a step are separate behaviours, and which has no times.

    The variables that the preconditions determine are parameters of all parts of a step. The conditions throughout a step have to
    hold at some time between its begin and its end. So every timed plan of the given problem gives a plan of this problem: if this
    problem has no plan, overlapping steps don't help either. Return the given problem if no condition or effect concerns the start
    or end of a step. Return None if no such problem is known: plans aren't judged by events alone, or an effect at the end depends
    on the state at the begin.
    """
    if not may_overlap_by_need(problem):
        return problem
    behaviors, situations = dict[str, Behavior](), dict(problem.domain.situations)
    for name, one in problem.domain.behaviors.items():
        timing, part_of = timing_of(one), with_fixed(one)
        its, kinds = tuple(p.name for p in part_of.parameters), tuple(p.kind for p in part_of.parameters)
        by_begin = any(
            effect.when or (isinstance(effect, AmountEffect) and situations_in(effect.amount))
            for effect in timing.made(Span.THROUGHOUT)
        )
        if by_begin or {v.name for v in one.variables}.intersection(timing.actors):
            return None
        held, first = bool(timing.asked(Span.THROUGHOUT)), timing.made(Span.THROUGHOUT)
        apart = bool(first and (timing.asked(Span.END) or timing.made(Span.END)))
        marks = [f"{name}@{mark}" for mark in ("running", *["held"] * held, *["made"] * apart)]
        for mark in marks:
            situations[mark] = SituationType(mark, kinds, "Truth", one.level, FALSE, FALSE, boolean=True)
        parts = [("begin", timing.asked(Span.START), timing.made(Span.START), marks[:1], FALSE)]
        if held:
            parts.append(("during", timing.asked(Span.THROUGHOUT), (), marks[1:2], FALSE))
        if apart:
            parts.append(("made", (), first, marks[-1:], FALSE))
        ending = timing.made(Span.END) if apart else (*first, *timing.made(Span.END))
        parts.append(("end", timing.asked(Span.END), ending, marks, TRUE))
        for part, asked, made, changed, was in parts:
            wanted = [c for c in asked if c not in (one.priced, one.lasting)]
            wanted += [ValueCondition(mark, its, was) for mark in changed]
            wanted += [ValueCondition(marks[0], its, TRUE)] if part in ("during", "made") else []
            becomes = FALSE if was == TRUE else TRUE
            behaviors[f"{name}@{part}"] = replace(
                part_of,
                name=f"{name}@{part}",
                preconditions=tuple(dict.fromkeys(wanted)),
                effects=(
                    *(e for e in made if isinstance(e, ValueEffect)),
                    *(ValueEffect(mark, its, becomes) for mark in changed),
                ),
                amounts=tuple(e for e in made if isinstance(e, AmountEffect)),
                price=None,
                timing=None,
            )
    domain = replace(problem.domain, situations=situations, behaviors=behaviors, first_ids={})
    return replace(problem, domain=domain, times=None)


def _passing(behavior: Behavior) -> tuple[ValueEffect, ...]:
    """Return the effects at the start of a behaviour that a later effect of the behaviour reverses."""
    if behavior.timing is None:
        return ()
    last = {
        (e.situation, e.arguments): e.value
        for span, e in behavior.timing.effects
        if span is not Span.START and isinstance(e, ValueEffect) and not e.when
    }
    return tuple(
        effect
        for effect in behavior.timing.made(Span.START)
        if isinstance(effect, ValueEffect)
        and last.get((effect.situation, effect.arguments), effect.value) != effect.value
    )


def _may_agree(problem: Problem, *lists: tuple[Sequence[str], Mapping[str, str]]) -> bool:
    """Return whether two lists of terms may denote the same individuals; each list has the classes of its variables."""

    def individuals(term: str, kinds: Mapping[str, str]) -> Collection[str]:
        return problem.members(kinds[term]) if term in kinds else problem.individuals if term[0] == "?" else {term}

    possible = ([individuals(term, kinds) for term in terms] for terms, kinds in lists)
    return not any(set(ours).isdisjoint(theirs) for ours, theirs in zip(*possible, strict=True))


def _asks(problem: Problem, behavior: Behavior, effect: ValueEffect, its: Mapping[str, str]) -> bool:
    """Return whether the value of an effect may satisfy a condition of a behaviour.

    `its` maps the variables of the effect to their classes.

    Effects that count the violations of a constraint are left out, because no step needs a violation.
    """
    made = (one for _, one in timing_of(behavior).effects if one.situation not in problem.domain.constraints)
    whens = [c for one in made for c in one.when]
    asked = [c for _, condition in timing_of(behavior).conditions for c in walk(condition)]
    kinds = dict(behavior.kinds)
    for one in (*asked, *(c for when in whens for c in walk(when))):
        if isinstance(one, Witness):
            kinds[one.variable] = one.kind
        if not isinstance(one, ValueCondition) or one.situation != effect.situation:
            continue
        if not _may_agree(problem, (effect.arguments, its), (one.arguments, kinds)):
            continue
        both = {one.value, effect.value}
        if any(value.startswith("?") for value in both):
            members = problem.members(kinds.get(one.value, "")) if one.value.startswith("?") else None
            if members is None or effect.value.startswith("?") or effect.value in members or one.negated:
                return True
        elif (one.value == effect.value) is not one.negated:
            return True
    return False


def on_each(effects: Sequence[Effect], classes: Mapping[str, Sequence[str]]) -> tuple[Effect, ...]:
    """Return effects with one effect per member in place of each effect on all members of a class."""
    found: list[Effect] = []
    for effect in effects:
        every = () if effect.each is None else classes.get(effect.each.kind, ())
        found += [effect] if effect.each is None else [made_of(effect, one) for one in every]
    return tuple(found)


DAY_TIME = re.compile(
    r"P(?=.)(?:(?P<days>\d{1,9})D)?(?:T(?=.)(?:(?P<hours>\d{1,9})H)?(?:(?P<minutes>\d{1,9})M)?"
    r"(?:(?P<seconds>\d{1,9}(?:\.\d{1,12})?)S)?)?"
)
"""A non-negative duration in the notation of xsd:dayTimeDuration."""
PARTS = {"days": 86400, "hours": 3600, "minutes": 60, "seconds": 1}


def seconds_of(text: str) -> Fraction | None:
    """Return the seconds of an xsd:dayTimeDuration, or None if the text isn't a non-negative duration.

    >>> seconds_of("PT1M2.5S"), seconds_of("P1D"), seconds_of("2 s")
    (Fraction(125, 2), Fraction(86400, 1), None)
    """
    found = DAY_TIME.fullmatch(text)
    if found is None:
        return None
    return sum((Fraction(found[name] or 0) * factor for name, factor in PARTS.items()), Fraction(0))

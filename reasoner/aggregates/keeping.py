"""Effects by which a behaviour updates a sum or a count.

Soundness: A tuple of individuals contributes to a total if the tuple satisfies the aggregate's conditions. The contribution of a
tuple can change only if an effect changes a symbol in the aggregate's conditions or in the aggregated number. Consider each pair of
an effect and a symbol in the aggregate that the effect may change. A tuple is a *candidate* of such a pair if, for this tuple, the
aggregate's symbol has the arguments of the effect, and its value before or after the effect. If the conditions hold for a candidate
only after the behaviour (`confab.reasoner.afterwards`), the candidate's number is added to the total. If the conditions hold for a
candidate only before the behaviour, the candidate's number is subtracted. A tuple that is a candidate of several pairs is counted
for the first pair only.

If the aggregated number is linear in the changing amounts (only additions and subtractions), each change of an amount changes the
total directly. The change is added for every tuple that satisfies the conditions after the behaviour. The changes are independent
of each other.

If the maximum of a count is 0, no tuple contributes before a behaviour, and a single contributing tuple violates the bound.
Therefore, nothing needs to be subtracted from such a count, and a tuple may be counted for several pairs. A tuple for which a
symbol only loses a value doesn't start to contribute, unless the condition on this value is negated.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

from confab.reasoner.afterwards import (
    OPPOSITE,
    Afterwards,
    Conjunction,
    ScaledAmount,
    Simplified,
    TooManyCasesError,
    both,
    closed,
    negation,
)
from confab.reasoner.aggregates.dependencies import divides, existing, read_by
from confab.reasoner.amounts import Amount, Calculation, Expression, inside, put_in, terms_of
from confab.reasoner.effects import made_of
from confab.reasoner.language import groups, is_variable, mentions, plain_variables, substituted, walk
from confab.reasoner.limits import check
from confab.reasoner.symbols import (
    Aggregate,
    AmountEffect,
    Behavior,
    Comparison,
    Condition,
    Effect,
    Parameter,
    SituationType,
    ValueCondition,
    ValueEffect,
)

MOST_CONDITIONS = 5_000
"""Maximum number of conditions of a behaviour that updates derived amounts; nested conditions are counted, too. A behaviour with
this number of conditions is compiled in one second."""
MOST_COMPARED = 300
"""Maximum number of candidates of a total that are compared with each other; the comparison takes one second."""


def kept(
    behavior: Behavior,
    aggregates: Iterable[Aggregate],
    situations: Mapping[str, SituationType],
    classes: Mapping[str, Sequence[str]],
) -> Behavior:
    """Return a behaviour with additional effects that update sums and counts.

    Parameters
    ----------
    behavior : Behavior
        The behaviour, whose effects on all members of a class aren't yet expanded to one effect per member.
    aggregates : iterable of Aggregate
        Aggregates in the order of `in_order`.
    situations : mapping of name to SituationType
    classes : mapping of class to individuals

    Raises
    ------
    TooManyCasesError
        Too many effects of the behaviour change the same total.
    """
    for aggregate in aggregates:
        if aggregate.kept and read_by(aggregate) & behavior.changes:
            behavior = _Keeping(behavior, aggregate, situations, classes).behavior()
    return behavior


def kept_in_time(
    behavior: Behavior,
    aggregate: Aggregate,
    situations: Mapping[str, SituationType],
    classes: Mapping[str, Sequence[str]],
) -> Behavior:
    """Return a durative behaviour whose timing changes a total at the same times as the facts on which the total depends.

    Effects at the start of the behaviour change the total at the start, under the conditions at the start. The same holds for the
    end.
    """
    timing = behavior.timing
    assert timing is not None
    if not aggregate.kept:
        return behavior
    read, effects = read_by(aggregate), list(timing.effects)
    for span in dict.fromkeys(span for span, effect in effects if effect.situation in read):
        made = timing.made(span)
        part = replace(
            behavior,
            effects=tuple(effect for effect in made if isinstance(effect, ValueEffect)),
            amounts=tuple(effect for effect in made if isinstance(effect, AmountEffect)),
        )
        keeping = _Keeping(part, aggregate, situations, classes, timing.before(span))
        behavior = replace(behavior, variables=keeping.behavior().variables)
        effects += [(span, effect) for effect in keeping.made]
    return replace(behavior, timing=replace(timing, effects=tuple(effects)))


@dataclass(frozen=True)
class _Contribution:
    """The tuples whose contribution to a total may be changed by one effect on one symbol of the aggregate.

    `effect` is a copy of the effect in which the variables have new names. `named` are the arguments of the symbol and `value` its
    value (None for an amount). If `before` is true, the tuples contain the value that the symbol has before the effect, otherwise
    the value after the effect. If the aggregated number is linear and the effect changes only one term of this number, `term` is
    this term. Such an effect doesn't change which tuples contribute to the total.
    """

    effect: Effect
    named: tuple[str, ...]
    value: str | None
    before: bool
    term: ScaledAmount | None = None


class _Keeping:
    """Derivation of the effects of one behaviour on one total."""

    def __init__(
        self,
        behavior: Behavior,
        aggregate: Aggregate,
        situations: Mapping[str, SituationType],
        classes: Mapping[str, Sequence[str]],
        holding: Sequence[Condition] | None = None,
    ) -> None:
        kinds = {**behavior.kinds, **{e.each.name: e.each.kind for e in behavior.every_effect if e.each is not None}}
        self.own, self.situations = behavior, situations
        self.after = Afterwards(behavior, situations, classes, kinds, holding)
        self.terms = {one.name: self.after.fresh(one.kind) for one in (*aggregate.parameters, *aggregate.variables)}
        asked = (substituted(condition, self.terms) for condition in aggregate.conditions)
        self.conditions = [self.after.renamed(condition) for condition in asked]
        self.defined = [substituted(condition, self.terms) for condition in existing(aggregate)]
        if divides(aggregate.amount):
            self.conditions, self.defined = [*self.conditions, *self.defined], []
        self.amount = put_in(aggregate.amount, self.terms)
        self.arguments = tuple(self.terms[p.name] for p in aggregate.parameters)
        self.aggregate, self.names = aggregate, {*self.terms.values()}
        self.linear = self.after.linear(self.amount)
        quantity = situations[aggregate.situation].quantity
        self.forbidden = aggregate.function == "count" and quantity is not None and quantity.most == 0
        self.candidates = list(self._candidates())
        if not self.forbidden and sum(1 for one in self.candidates if one.term is None) > MOST_COMPARED:
            raise TooManyCasesError

    @cached_property
    def made(self) -> tuple[AmountEffect, ...]:
        """The effects on the total."""
        effects, many = list[AmountEffect](), 0
        for effect in (effect for i in range(len(self.candidates)) for effect in self.effects(i)):
            effects.append(effect)
            many += sum(1 for condition in effect.when for _ in walk(condition))
            if many > MOST_CONDITIONS:
                raise TooManyCasesError
        return tuple(effects)

    def behavior(self) -> Behavior:
        """Return the behaviour with the effects on the total."""
        effects, known = self.made, self.own.kinds
        used = {
            t for e in effects for t in (*e.arguments, *terms_of(e.amount), *(m for c in e.when for m in mentions(c)))
        }
        each = {e.each.name for e in effects if e.each is not None}
        more = sorted(t for t in used - each if is_variable(t) and t not in known)
        variables = (*self.own.variables, *(Parameter(name, self.after.kinds[name]) for name in more))
        amounts = (*self.own.amounts, *effects)
        return replace(self.own, variables=variables, amounts=amounts)

    def _candidates(self) -> Iterator[_Contribution]:
        """Yield a candidate for each pair of an effect and a symbol in the aggregate that the effect may change."""
        for condition, wanted in (pair for c in self.conditions for pair in _signed(c)):
            if isinstance(condition, ValueCondition):
                only_after = condition.value not in self.names or (self.forbidden and wanted)
                for effect in (e for e in self.own.effects if e.situation == condition.situation):
                    for before in (False,) if only_after else (False, True):
                        yield self._candidate(effect, condition.arguments, condition.value, before)
            elif isinstance(condition, Comparison):
                yield from self._of_amounts(condition.left)
                yield from self._of_amounts(condition.right)
        if self.linear is None:
            yield from self._of_amounts(self.amount)
        for term in self.linear or ():
            for change in (e for e in self.after.amounts if e.situation == term[0].situation):
                yield replace(self._candidate(change, term[0].arguments, None, False), term=term)

    def _of_amounts(self, expression: Expression) -> Iterator[_Contribution]:
        for part in inside(expression):
            if isinstance(part, Amount):
                for effect in (e for e in self.after.amounts if e.situation == part.situation):
                    yield self._candidate(effect, part.arguments, None, False)

    def _candidate(self, effect: Effect, named: tuple[str, ...], value: str | None, before: bool) -> _Contribution:
        """Return the candidate of an effect and a symbol.

        For an effect on each member of a class, a witness may bind the member; the candidate then doesn't name the member.
        """
        effect = self.after.apart(effect)
        if effect.each is None:
            return _Contribution(effect, named, value, before)
        sought = named[effect.arguments.index(effect.each.name)]
        if sought in self.names or not is_variable(sought):
            return _Contribution(effect, named, value, before)
        own = zip(effect.arguments, named, strict=True)
        named = tuple(name if self.after.fixed(argument) else sought for argument, name in own)
        if before or (isinstance(effect, ValueEffect) and not self.after.fixed(effect.value)):
            value = None  # the value is different for each member
        return _Contribution(replace(effect, each=None, when=()), named, value, before)

    def agrees(self, candidate: _Contribution, tuple_: Mapping[str, str]) -> Conjunction:
        """Return the condition that a tuple is one of the tuples of a candidate."""
        effect = candidate.effect
        found: list[Simplified] = []
        if effect.each is not None:
            at = effect.arguments.index(effect.each.name)
            named = tuple_.get(candidate.named[at], candidate.named[at])
            found.append(self.after.among(named, effect.each.kind))
            effect = made_of(effect, named)
        found += effect.when
        for own, name in zip(effect.arguments, candidate.named, strict=True):
            if name in self.names or not is_variable(name):
                found.append(self.after.equal(own, tuple_.get(name, name)))
        if isinstance(effect, ValueEffect) and candidate.value in self.names:
            value = tuple_[candidate.value]
            if candidate.before:
                found.append(self.after.value(effect.situation, effect.arguments, value))
            else:
                found.append(self.after.equal(effect.value, value))
        return both(found)

    def effects(self, number: int) -> Iterator[AmountEffect]:
        """Yield the effects on the total of a candidate's tuples, except tuples that belong to an earlier candidate."""
        candidate = self.candidates[number]
        effect = candidate.effect
        tuple_: dict[str, str] = {}
        guard: list[Simplified] = list(effect.when)
        for own, name in zip(effect.arguments, candidate.named, strict=True):
            if name in self.names:
                guard.append(self._put(tuple_, name, own))
            elif not is_variable(name):
                guard.append(self.after.equal(own, name))
        if isinstance(effect, ValueEffect) and candidate.value is not None and candidate.value in self.names:
            if candidate.before:
                old, determined = self.after.old(effect.situation, effect.arguments, self.after.kinds[candidate.value])
                guard += [False] if determined is None else determined
                guard.append(self._put(tuple_, candidate.value, old))
            else:
                guard.append(self._put(tuple_, candidate.value, effect.value))
        for whole, each, more in self._completed(tuple_, effect.each):
            check("deriving amounts")
            if candidate.term is not None:
                yield from self._changes(effect, candidate.term, whole, each, [*guard, *more])
            else:
                earlier = () if self.forbidden else self.candidates[:number]
                others = [negation(self.agrees(one, whole)) for one in earlier if one.term is None]
                yield from self._differences(whole, each, [*guard, *more, *others])

    def _put(self, tuple_: dict[str, str], name: str, term: str) -> Simplified:
        """Replace a variable of the aggregate by a term in `tuple_`, and return the conditions for this replacement."""
        if name in tuple_:
            return self.after.equal(tuple_[name], term)
        tuple_[name] = term
        return self.after.among(term, self.after.kinds[name])

    def _completed(
        self, tuple_: Mapping[str, str], each: Parameter | None
    ) -> Iterator[tuple[dict[str, str], Parameter | None, list[Simplified]]]:
        """Yield tuples with a term for every variable.

        The term for a variable is determined by a condition, or stands for each member of a class, or is each individual in turn.
        """
        found, more = dict(tuple_), list[Simplified]()
        determined = True
        while determined:
            determined = False
            for condition in self.conditions:
                if (
                    isinstance(condition, ValueCondition)
                    and not condition.negated
                    and condition.value in self.names - found.keys()
                    and not self.after.changed(condition)
                    and all(a in found for a in condition.arguments if a in self.names)
                ):
                    own = substituted(condition, found)
                    assert isinstance(own, ValueCondition)
                    term, asked = self.after.old(own.situation, own.arguments, self.after.kinds[condition.value])
                    found[condition.value] = term
                    more += [False] if asked is None else asked
                    determined = True
        left = sorted(self.names - found.keys())
        if left and each is None:
            kind = self.after.kinds[left[0]]
            each = Parameter(self.after.fresh(kind), kind)
            found[left.pop(0)] = each.name
        for row in product(*(self.after.classes.get(self.after.kinds[name], ()) for name in left)):
            yield {**found, **dict(zip(left, row, strict=True))}, each, more

    def _changes(
        self,
        effect: Effect,
        term: ScaledAmount,
        tuple_: Mapping[str, str],
        each: Parameter | None,
        guard: Sequence[Simplified],
    ) -> Iterator[AmountEffect]:
        """Yield the effects on the total of a change of one amount, for tuples that contribute after the behaviour."""
        assert isinstance(effect, AmountEffect)
        amount, operation, scaled = term
        arguments = tuple(tuple_.get(argument, argument) for argument in amount.arguments)
        always, _, after = self._contributing(tuple_)
        fires = self.after.fires(effect, arguments)
        if effect.operation == "decrease":
            operation = OPPOSITE[operation]
        by = put_in(scaled(effect.amount), tuple_)
        yield from self._effects(tuple_, each, [(operation, by, [*guard, *_parts(fires), *always, *_parts(after)])])

    def _differences(
        self, tuple_: Mapping[str, str], each: Parameter | None, guard: Sequence[Simplified]
    ) -> Iterator[AmountEffect]:
        """Yield the effects for tuples that begin to contribute, cease to contribute, or contribute another number."""
        always, before, after = self._contributing(tuple_)
        always = [*guard, *always]
        amount = put_in(self.amount, tuple_)
        cases = [((), amount)] if self.linear is not None else self.after.cases(amount)
        found = [("decrease", amount, [*always, *_parts(before), negation(after)])]
        for when, changed in cases:
            found.append(("increase", changed, [*always, *when, *_parts(after), negation(before)]))
            if changed != amount:
                found.append((*_difference(changed, amount), [*always, *when, *_parts(before), *_parts(after)]))
        yield from self._effects(tuple_, each, found)

    def _contributing(self, tuple_: Mapping[str, str]) -> tuple[list[Simplified], Conjunction, Conjunction]:
        """Return the conditions under which a tuple contributes.

        The three groups are constant conditions, conditions before the behaviour, and conditions after the behaviour.
        """
        conditions = [substituted(condition, tuple_) for condition in self.conditions]
        changing = [condition for condition in conditions if self.after.changed(condition)]
        always = [self.after.before(c) for c in conditions if not self.after.changed(c)]
        always += [substituted(condition, tuple_) for condition in self.defined]
        before = None if self.forbidden else both(map(self.after.before, changing))
        return always, before, both(map(self.after.condition, changing))

    def _effects(
        self,
        tuple_: Mapping[str, str],
        each: Parameter | None,
        found: Iterable[tuple[str, Expression, list[Simplified]]],
    ) -> Iterator[AmountEffect]:
        """Yield the effects of a tuple on the total, except effects with contradictory conditions."""
        arguments = tuple(tuple_[name] for name in self.arguments)
        for operation, by, formulas in found:
            asked = both(formulas)
            if asked is not None:
                own = (*arguments, *tuple_.values(), *terms_of(by), *self.own.kinds)
                fixed = {*own, *([each.name] if each is not None else [])}
                yield AmountEffect(self.aggregate.situation, arguments, operation, by, self._closed(asked, fixed), each)

    def _closed(self, asked: tuple[Condition, ...], bound: Iterable[str]) -> tuple[Condition, ...]:
        """Return a conjunction with a witness for each variable that is local to a disjunction.

        Such a variable may come from an effect that the disjunction distinguishes: in one alternative, the effect changes the
        amount for some value of the variable, and in another alternative for none.
        """
        return closed(asked, frozenset({*bound, *plain_variables(asked)}), self.after.kinds)


def _signed(condition: Condition, wanted: bool = True) -> Iterator[tuple[Condition, bool]]:
    """Yield a condition and all conditions inside it, each with a flag that is false for a condition under a negation."""
    wanted = wanted is not condition.negated
    yield condition, wanted
    for group in groups(condition):
        for inner in group:
            yield from _signed(inner, wanted)


def _parts(conjunction: Conjunction) -> Sequence[Simplified]:
    return (False,) if conjunction is None else conjunction


def _difference(after: Expression, before: Expression) -> tuple[str, Expression]:
    """Return the operation and the number that change one amount into another."""
    if isinstance(after, Calculation) and after.left == before and after.operator in ("+", "-"):
        return ("increase" if after.operator == "+" else "decrease"), after.right
    return "increase", Calculation("-", after, before)

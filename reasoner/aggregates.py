"""Derived amounts: a sum, a count, a maximum or a minimum over individuals, in terms of other conditions and effects.

A sum or a count becomes an amount that is part of each state. Its first value is calculated from the initial state (`totals`);
each behaviour gets the effects that keep it up to date (`kept`). For ``LOAD(cart)``, the sum of ``weight(item)`` over all items
in the cart, PUT(?item, ?cart) increases LOAD(?cart) by weight(?item) and decreases LOAD of the cart that the item was in before.

A maximum or a minimum needs no effects: a condition that reads it becomes a witness, the individual of which none has more
(`with_extrema`).

Soundness of `kept`: a tuple of individuals adds to a total as long as it satisfies the aggregate's conditions. It can begin or
cease to satisfy them, or add another number, only if an effect changes a symbol that these conditions or the number name. So every
such tuple is among the *candidates* of an effect and such a name: it agrees with the effect in the arguments, and in the value
before or after. A candidate's number is added if the conditions hold afterwards and not before (`confab.reasoner.afterwards`), and
subtracted if they hold before and not afterwards. A tuple of several candidates is counted for the first one only.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import chain, count, islice, product

from confab.reasoner.afterwards import Afterwards, Conjunction, Formula, TooManyCasesError, both, negation
from confab.reasoner.amounts import (
    COMPARING,
    NOTHING,
    Amount,
    Calculation,
    Expression,
    Measure,
    Number,
    divided,
    inside,
    number,
    put_in,
    situations_in,
    terms_of,
    written,
)
from confab.reasoner.derivation import circular
from confab.reasoner.language import DomainError, is_variable, mentions, situations_of, walk
from confab.reasoner.limits import check
from confab.reasoner.symbols import (
    FALSE,
    Aggregate,
    AmountEffect,
    AnyOf,
    Behavior,
    ClassCondition,
    Comparison,
    Condition,
    Domain,
    Effect,
    EqualityCondition,
    Parameter,
    Problem,
    RelationCondition,
    Rule,
    SituationType,
    Symbol,
    ValueCondition,
    ValueEffect,
    Witness,
    made_of,
    spread,
    substituted,
)

MOST_CONDITIONS = 5_000
"""Maximum number of conditions, nested ones included, of a behaviour that keeps derived amounts: a second to bind for search."""


def compiled(domain: Domain, classes: Mapping[str, Sequence[str]]) -> Domain:
    """Return a domain whose behaviours keep its sums and counts, name no maximum or minimum, and no class in an effect.

    Raises
    ------
    DomainError
        An effect or a price reads a maximum or minimum, or too many effects change one number at once.
    """
    domain = extrema_replaced(domain)
    aggregates = domain.aggregates.values()
    behaviors = {}
    for name, behavior in domain.behaviors.items():
        check("deriving amounts")
        behaviors[name] = spread(kept(behavior, aggregates, domain.situations, classes), classes)
        conditions = chain.from_iterable(map(walk, behaviors[name].conditions))
        many = sum(1 for _ in islice(conditions, MOST_CONDITIONS + 1))
        if aggregates and many > MOST_CONDITIONS:
            raise DomainError(
                f"{name}: the effects that keep {' and '.join(sorted(domain.aggregates))} take more than {MOST_CONDITIONS} "
                "conditions; let fewer of its effects change them, or let no derived amount depend on another"
            )
    return replace(domain, behaviors=behaviors)


def with_totals(
    domain: Domain,
    classes: Mapping[str, Sequence[str]],
    relations: Mapping[str, frozenset[tuple[str, ...]]],
    state: Mapping[Symbol, str],
) -> dict[Symbol, str]:
    """Return a state with the sums and counts that follow from it."""
    found = dict(state)
    for aggregate in (one for one in domain.aggregates.values() if one.kept):
        found |= totals(aggregate, classes, relations, found, domain.situations)
    return found


def following(problem: Problem, state: Mapping[Symbol, str]) -> dict[Symbol, str]:
    """Return a state that observations or interventions have changed, with the sums and counts that follow from it."""
    return with_totals(problem.domain, problem.classes, problem.relations, state)


def in_order(aggregates: Mapping[str, Aggregate]) -> list[Aggregate]:
    """Return aggregates in order of dependency.

    Raises
    ------
    DomainError
        One depends on itself. The message names it.
    """
    found: dict[str, Aggregate] = {}
    waiting = dict(aggregates)
    while waiting:
        ready = [name for name, one in waiting.items() if not read_by(one) & waiting.keys()]
        if not ready:
            name = min(waiting)
            raise DomainError(
                f"{name} is calculated from {' and '.join(sorted(read_by(waiting[name]) & waiting.keys()))}, "
                f"and that from {name} in turn; take one of them out of its rule"
            )
        for name in ready:
            found[name] = waiting.pop(name)
    return list(found.values())


def read_by(aggregate: Aggregate) -> frozenset[str]:
    """Return the situation types from which an aggregate is calculated."""
    asked = (s for c in aggregate.conditions for inner in walk(c) for s in situations_of(inner))
    return situations_in(aggregate.amount).union(asked)


def unfolded(aggregate: Aggregate, rules: Mapping[str, Sequence[Rule]]) -> Aggregate:
    """Return an aggregate whose conditions name no defined situation type, but the conditions of its rules.

    Raises
    ------
    DomainError
        A situation type that it names is defined by itself. The message names both.
    """
    if not read_by(aggregate) & rules.keys():
        return aggregate
    if lost := sorted(read_by(aggregate) & circular(rules)):
        raise DomainError(
            f"{aggregate.situation} is calculated from {lost[0]}, which is defined recursively; aggregate over situation types "
            "that behaviours change, or over one whose definition isn't recursive"
        )
    numbers = count(1)

    def one(condition: Condition) -> Condition:
        match condition:
            case ValueCondition(situation, arguments, value, negated) if situation in rules:
                ways = tuple(way(rule, arguments) for rule in rules[situation])
                return AnyOf(ways, negated is not (value == FALSE))
            case Witness(_, _, inner):
                return replace(condition, conditions=tuple(map(one, inner)))
            case AnyOf(alternatives):
                return replace(condition, alternatives=tuple(tuple(map(one, group)) for group in alternatives))
            case _:
                return condition

    def way(rule: Rule, arguments: Sequence[str]) -> tuple[Condition, ...]:
        number = next(numbers)
        terms = dict(zip((p.name for p in rule.parameters), arguments, strict=True))
        terms |= {v.name: f"{v.name}_rule{number}" for v in rule.variables}
        found = tuple(one(substituted(condition, terms)) for condition in rule.conditions)
        for variable in rule.variables:
            found = (Witness(terms[variable.name], variable.kind, found),)
        members = (ClassCondition(terms[p.name], p.kind) for p in rule.parameters)
        return (*members, *found)

    return unfolded(replace(aggregate, conditions=tuple(map(one, aggregate.conditions))), rules)


# ------------------------------------------------------------------------------------------------------ maximum, minimum


def with_extrema(conditions: Sequence[Condition], aggregates: Mapping[str, Aggregate]) -> tuple[Condition, ...]:
    """Return conditions in which each comparison with a maximum or minimum is a witness that none exceeds."""
    return tuple(_with_extremum(condition, aggregates) for condition in conditions)


def _with_extremum(condition: Condition, aggregates: Mapping[str, Aggregate]) -> Condition:
    if isinstance(condition, Comparison):
        read = [a for side in (condition.left, condition.right) for a in _extrema(side, aggregates)]
        if not read:
            return condition
        return _of_extremum(condition, read[0], aggregates)
    if isinstance(condition, Witness):
        return replace(condition, conditions=with_extrema(condition.conditions, aggregates))
    if isinstance(condition, AnyOf):
        return replace(
            condition, alternatives=tuple(with_extrema(group, aggregates) for group in condition.alternatives)
        )
    return condition


def _extrema(expression: Expression, aggregates: Mapping[str, Aggregate]) -> list[Amount]:
    """Return the maxima and minima in an expression."""
    amounts = [part for part in inside(expression) if isinstance(part, Amount)]
    return [part for part in amounts if part.situation in aggregates and not aggregates[part.situation].kept]


def _of_extremum(condition: Comparison, read: Amount, aggregates: Mapping[str, Aggregate]) -> Condition:
    """Return a comparison with the number of the individuals of which none has more, or less, in the place of an extremum."""
    aggregate = aggregates[read.situation]
    taken = {*mentions(condition), *read.arguments}
    best, other = (_solution(aggregate, read.arguments, suffix, taken) for suffix in ("", "_other"))
    sign = ">" if aggregate.function == "max" else "<"
    conditions, amount, variables = best
    exceeding = (*other[0], Comparison(other[1], sign, amount))
    compared = replace(
        condition, left=_in_place(condition.left, read, amount), right=_in_place(condition.right, read, amount)
    )
    inner = with_extrema(
        [*conditions, _sought(other[2], exceeding, True), replace(compared, negated=False)], aggregates
    )
    return _sought(variables, inner, condition.negated)


def _solution(
    aggregate: Aggregate, arguments: Sequence[str], suffix: str, taken: set[str]
) -> tuple[tuple[Condition, ...], Expression, tuple[Parameter, ...]]:
    """Return the conditions, the number and the variables of an aggregate for some arguments, with names of their own."""
    terms = dict(zip((p.name for p in aggregate.parameters), arguments, strict=True))
    variables = []
    for one in aggregate.variables:
        name = f"{one.name}{suffix}"
        while name in taken:
            name += "_"
        terms[one.name] = name
        variables.append(Parameter(name, one.kind))
    members = (ClassCondition(p.name, p.kind) for p in aggregate.parameters)  # of others there is no such amount
    asked = (*members, *aggregate.conditions, *existing(aggregate))
    conditions = tuple(substituted(condition, terms) for condition in asked)
    return conditions, put_in(aggregate.amount, terms), tuple(variables)


def _sought(variables: Sequence[Parameter], conditions: tuple[Condition, ...], negated: bool) -> Condition:
    """Return that some individuals, or none, satisfy conditions."""
    found: Condition | None = None
    for variable in reversed(variables):
        found = Witness(variable.name, variable.kind, conditions if found is None else (found,))
    assert found is not None
    return replace(found, negated=negated)


def _in_place(expression: Expression, old: Expression, new: Expression) -> Expression:
    if expression == old:
        return new
    if isinstance(expression, Calculation):
        return replace(
            expression, left=_in_place(expression.left, old, new), right=_in_place(expression.right, old, new)
        )
    return expression


def existing(aggregate: Aggregate) -> tuple[Condition, ...]:
    """Return the condition that the number of an aggregate is defined, where it may not be."""
    whole = aggregate.amount
    amounts = [part for part in inside(whole) if isinstance(part, Amount | Measure)]
    return (Comparison(whole, "=", whole),) if amounts or divides(whole) else ()


def divides(expression: Expression) -> bool:
    """Whether a number is divided in an expression."""
    return any(isinstance(part, Calculation) and part.operator == "/" for part in inside(expression))


def extrema_replaced(domain: Domain) -> Domain:
    """Return a domain in which no condition reads a maximum or a minimum.

    Raises
    ------
    DomainError
        An effect, a price or a sum reads one. The message names both.
    """
    aggregates = domain.aggregates
    if all(one.kept for one in aggregates.values()):
        return domain

    def effect(behavior: Behavior, one: Effect) -> Effect:
        if isinstance(one, AmountEffect):
            _refuse(f"an effect of {behavior.name}", one.amount)
        return replace(one, when=with_extrema(one.when, aggregates))

    def _refuse(what: str, expression: Expression) -> None:
        for read in _extrema(expression, aggregates):
            raise DomainError(
                f"{what} is calculated from {read.situation}, a {aggregates[read.situation].function}, which only conditions "
                "and goals can name; use a variable for the individual that has it"
            )

    behaviors = {}
    for name, one in domain.behaviors.items():
        if one.price is not None:
            _refuse(f"the price of {name}", one.price)
        behaviors[name] = replace(
            one,
            preconditions=with_extrema(one.preconditions, aggregates),
            effects=tuple(e for e in (effect(one, e) for e in one.effects) if isinstance(e, ValueEffect)),
            amounts=tuple(e for e in (effect(one, e) for e in one.amounts) if isinstance(e, AmountEffect)),
        )
    rules = {
        name: tuple(replace(rule, conditions=with_extrema(rule.conditions, aggregates)) for rule in its)
        for name, its in domain.rules.items()
    }
    found = {}
    for name, aggregate in aggregates.items():
        _refuse(name, aggregate.amount)
        found[name] = replace(aggregate, conditions=with_extrema(aggregate.conditions, aggregates))
    return replace(domain, behaviors=behaviors, rules=rules, aggregates=found)


# ------------------------------------------------------------------------------------------------------------ sum, count


def kept(
    behavior: Behavior,
    aggregates: Iterable[Aggregate],
    situations: Mapping[str, SituationType],
    classes: Mapping[str, Sequence[str]],
) -> Behavior:
    """Return a behaviour with the effects that keep sums and counts up to date.

    Parameters
    ----------
    behavior : Behavior
        As it is written, with its effects on all of a class.
    aggregates : iterable of Aggregate
        In the order of `in_order`.
    situations : mapping of name to SituationType
    classes : mapping of class to individuals

    Raises
    ------
    DomainError
        Too many of the behaviour's effects change one number at once.
    """
    for aggregate in aggregates:
        if aggregate.kept and read_by(aggregate) & behavior.changes:
            try:
                behavior = _Keeping(behavior, aggregate, situations, classes).behavior()
            except TooManyCasesError:
                raise DomainError(
                    f"{behavior.name} changes the facts that determine {aggregate.situation} by too many effects at once; "
                    "use fewer effects, or another behaviour for some of them"
                ) from None
    return behavior


@dataclass(frozen=True)
class _Candidate:
    """Tuples that may begin or cease to add to a total: those that agree with an effect on a symbol of an effect.

    `effect` has its variables renamed apart; `named` are the arguments of the symbol as the aggregate has them, `value` the
    value (None of an amount); `before` tells whether a tuple agrees with the value before the effect or with the one after it.
    """

    effect: Effect
    named: tuple[str, ...]
    value: str | None
    before: bool


class _Keeping:
    """The effects of one behaviour on one total."""

    def __init__(
        self,
        behavior: Behavior,
        aggregate: Aggregate,
        situations: Mapping[str, SituationType],
        classes: Mapping[str, Sequence[str]],
    ) -> None:
        kinds = {**behavior.kinds, **{e.each.name: e.each.kind for e in behavior.every_effect if e.each is not None}}
        self.own, self.situations = behavior, situations
        self.after = Afterwards(behavior, situations, classes, kinds)
        self.terms = {one.name: self.after.fresh(one.kind) for one in (*aggregate.parameters, *aggregate.variables)}
        asked = (substituted(condition, self.terms) for condition in aggregate.conditions)
        self.conditions = [self.after.renamed(condition) for condition in asked]
        self.defined = [substituted(condition, self.terms) for condition in existing(aggregate)]
        if divides(aggregate.amount):
            self.conditions, self.defined = [*self.conditions, *self.defined], []
        self.amount = put_in(aggregate.amount, self.terms)
        self.arguments = tuple(self.terms[p.name] for p in aggregate.parameters)
        self.aggregate, self.names = aggregate, {*self.terms.values()}
        self.candidates = list(self._candidates())

    def behavior(self) -> Behavior:
        """Return the behaviour with these effects."""
        effects = [effect for i in range(len(self.candidates)) for effect in self.effects(i)]
        known = self.own.kinds
        used = {
            t for e in effects for t in (*e.arguments, *terms_of(e.amount), *(m for c in e.when for m in mentions(c)))
        }
        each = {e.each.name for e in effects if e.each is not None}
        more = sorted(t for t in used - each if is_variable(t) and t not in known)
        variables = (*self.own.variables, *(Parameter(name, self.after.kinds[name]) for name in more))
        return replace(self.own, variables=variables, amounts=(*self.own.amounts, *effects))

    def _candidates(self) -> Iterator[_Candidate]:
        """Yield what may change the total: each effect with each symbol that the conditions or the number name."""
        for condition in (inner for c in self.conditions for inner in walk(c)):
            if isinstance(condition, ValueCondition):
                for effect in (e for e in self.own.effects if e.situation == condition.situation):
                    for before in (False, True) if condition.value in self.names else (False,):
                        yield self._candidate(effect, condition.arguments, condition.value, before)
            elif isinstance(condition, Comparison):
                yield from self._of_amounts(condition.left)
                yield from self._of_amounts(condition.right)
        yield from self._of_amounts(self.amount)

    def _of_amounts(self, expression: Expression) -> Iterator[_Candidate]:
        for part in inside(expression):
            if isinstance(part, Amount):
                for effect in (e for e in self.after.amounts if e.situation == part.situation):
                    yield self._candidate(effect, part.arguments, None, False)

    def _candidate(self, effect: Effect, named: tuple[str, ...], value: str | None, before: bool) -> _Candidate:
        """Return a candidate; of an effect on all of a class whose individuals a witness seeks, without what names them."""
        effect = self.after.apart(effect)
        if effect.each is None:
            return _Candidate(effect, named, value, before)
        sought = named[effect.arguments.index(effect.each.name)]
        if sought in self.names or not is_variable(sought):
            return _Candidate(effect, named, value, before)
        own = zip(effect.arguments, named, strict=True)
        named = tuple(name if self.after.fixed(argument) else sought for argument, name in own)
        if isinstance(effect, ValueEffect) and not self.after.fixed(effect.value):
            value = None
        return _Candidate(replace(effect, each=None, when=()), named, value, before)

    def agrees(self, candidate: _Candidate, tuple_: Mapping[str, str]) -> Conjunction:
        """Return that a tuple is one of a candidate's."""
        effect = candidate.effect
        found: list[Formula] = []
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
        """Yield the effects on the total for the tuples of one candidate, without those of earlier candidates."""
        candidate = self.candidates[number]
        effect = candidate.effect
        tuple_: dict[str, str] = {}
        guard: list[Formula] = list(effect.when)
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
            others = [negation(self.agrees(other, whole)) for other in self.candidates[:number]]
            yield from self._differences(whole, each, [*guard, *more, *others])

    def _put(self, tuple_: dict[str, str], name: str, term: str) -> Formula:
        """Substitute a term for a variable of the aggregate; return the conditions that this implies."""
        if name in tuple_:
            return self.after.equal(tuple_[name], term)
        tuple_[name] = term
        return self.after.among(term, self.after.kinds[name])

    def _completed(
        self, tuple_: Mapping[str, str], each: Parameter | None
    ) -> Iterator[tuple[dict[str, str], Parameter | None, list[Formula]]]:
        """Yield a tuple with terms for all variables: determined by a condition, members of a class, or all individuals."""
        found, more = dict(tuple_), list[Formula]()
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

    def _differences(
        self, tuple_: Mapping[str, str], each: Parameter | None, guard: Sequence[Formula]
    ) -> Iterator[AmountEffect]:
        """Yield the effects for the tuples that a guard admits: added, no longer added, or added with another number."""
        conditions = [substituted(condition, tuple_) for condition in self.conditions]
        changing = [condition for condition in conditions if self.after.changed(condition)]
        always = [*guard, *(self.after.before(c) for c in conditions if not self.after.changed(c))]
        always += [substituted(condition, tuple_) for condition in self.defined]
        before, after = both(map(self.after.before, changing)), both(map(self.after.condition, changing))
        amount, arguments = put_in(self.amount, tuple_), tuple(tuple_[name] for name in self.arguments)
        cases = self.after.cases(amount)
        found = [("decrease", amount, [*always, *_parts(before), negation(after)])]
        for when, changed in cases:
            found.append(("increase", changed, [*always, *when, *_parts(after), negation(before)]))
            if changed != amount:
                found.append((*_difference(changed, amount), [*always, *when, *_parts(before), *_parts(after)]))
        for operation, by, formulas in found:
            asked = both(formulas)
            if asked is not None:
                yield AmountEffect(self.aggregate.situation, arguments, operation, by, asked, each)


def _parts(conjunction: Conjunction) -> Sequence[Formula]:
    return (False,) if conjunction is None else conjunction


def _difference(after: Expression, before: Expression) -> tuple[str, Expression]:
    """Return the operation and the number that lead from an amount to another one."""
    if isinstance(after, Calculation) and after.left == before and after.operator in ("+", "-"):
        return ("increase" if after.operator == "+" else "decrease"), after.right
    return "increase", Calculation("-", after, before)


# --------------------------------------------------------------------------------------------------------- initial state


def totals(
    aggregate: Aggregate,
    classes: Mapping[str, Sequence[str]],
    relations: Mapping[str, frozenset[tuple[str, ...]]],
    state: Mapping[Symbol, str],
    situations: Mapping[str, SituationType],
) -> dict[Symbol, str]:
    """Return a sum or count for all of its arguments in a state, as texts of exact numbers."""
    world = _World(classes, relations, state, situations)
    kinds = [classes.get(p.kind, ()) for p in aggregate.parameters]
    found = {row: Fraction(0) for row in product(*kinds)}
    solutions = set[tuple[str, ...]]()
    names = tuple(aggregate.kinds)
    for terms in world.solutions(aggregate.conditions, {}, aggregate.kinds, names):
        row = tuple(terms[name] for name in names)
        number = world.worth(aggregate.amount, terms)
        if row not in solutions and isinstance(number, Fraction):
            solutions.add(row)
            found[row[: len(kinds)]] += number
    return {Symbol(aggregate.situation, row): written(number) for row, number in found.items()}


class _World:
    """A state in which conditions are tested by trying individuals."""

    def __init__(
        self,
        classes: Mapping[str, Sequence[str]],
        relations: Mapping[str, frozenset[tuple[str, ...]]],
        state: Mapping[Symbol, str],
        situations: Mapping[str, SituationType],
    ) -> None:
        self.classes, self.relations, self.state, self.situations = classes, relations, state, situations
        self.members = {kind: frozenset(those) for kind, those in classes.items()}
        self.numbers: dict[str, dict[tuple[str, ...], Number]] = {}

    def value(self, situation: str, arguments: tuple[str, ...]) -> str | None:
        """Return the value of a symbol, None if there is no such symbol."""
        found = self.state.get(Symbol(situation, arguments))
        kind = self.situations[situation]
        if found is None and kind.boolean:
            there = zip(arguments, kind.arguments, strict=True)
            return FALSE if all(a in self.members.get(of, ()) for a, of in there) else None
        return found

    def worth(self, expression: Expression, terms: Mapping[str, str]) -> Number:
        """Return the number that an expression has."""
        match expression:
            case Amount(situation, arguments):
                return number(self.value(situation, tuple(terms.get(a, a) for a in arguments)))
            case Measure(relation, arguments):
                key = tuple(terms.get(a, a) for a in arguments)
                if relation not in self.numbers:
                    self.numbers[relation] = {r[:-1]: number(r[-1]) for r in self.relations.get(relation, ())}
                return self.numbers[relation].get(key, NOTHING)
            case Calculation(sign, left, right):
                one, other = self.worth(left, terms), self.worth(right, terms)
                return (
                    divided(one, other) if sign == "/" else {"+": one + other, "-": one - other, "*": one * other}[sign]
                )
            case exact:
                return exact

    def solutions(
        self, conditions: Sequence[Condition], terms: dict[str, str], kinds: Mapping[str, str], names: Sequence[str]
    ) -> Iterator[dict[str, str]]:
        """Yield the individuals for some terms with which conditions hold; variables that a value determines aren't enumerated."""
        if any(not self.holds(c, terms, kinds) for c in conditions if not mentions(c) - terms.keys()):
            return
        waiting = [c for c in conditions if mentions(c) - terms.keys()]
        for c in waiting:
            if (
                isinstance(c, ValueCondition)
                and not c.negated
                and mentions(c) - terms.keys() == {c.value} - {*c.arguments}
            ):
                found = self.value(c.situation, tuple(terms.get(a, a) for a in c.arguments))
                if found is not None and found in self.members.get(kinds[c.value], ()):
                    yield from self.solutions(conditions, {**terms, c.value: found}, kinds, names)
                return
        left = [name for name in reversed(names) if name not in terms]
        left += sorted({t for c in waiting for t in mentions(c)} - terms.keys() - {*left})
        if not left:
            yield terms
            return
        for individual in self.classes.get(kinds[left[0]], ()):
            yield from self.solutions(conditions, {**terms, left[0]: individual}, kinds, names)

    def holds(self, condition: Condition, terms: Mapping[str, str], kinds: Mapping[str, str]) -> bool:
        """Return whether a condition whose terms are bound holds."""
        of = terms.get
        match condition:
            case ValueCondition(situation, arguments, value, negated):
                return (self.value(situation, tuple(of(a, a) for a in arguments)) == of(value, value)) is not negated
            case RelationCondition(relation, arguments, negated):
                return (tuple(of(a, a) for a in arguments) in self.relations.get(relation, ())) is not negated
            case ClassCondition(term, kind, negated):
                return (of(term, term) in self.members.get(kind, ())) is not negated
            case EqualityCondition(left, right, negated):
                return (of(left, left) == of(right, right)) is not negated
            case Comparison(left, sign, right, negated):
                return COMPARING[sign](self.worth(left, terms), self.worth(right, terms)) is not negated
            case Witness(variable, kind, inner, negated):
                open_ = {name: one for name, one in terms.items() if name != variable}
                found = self.solutions(inner, open_, {**kinds, variable: kind}, (variable,))
                return any(True for _ in found) is not negated
            case AnyOf(alternatives, negated):
                ways = (self.solutions(group, dict(terms), kinds, ()) for group in alternatives)
                return any(True for way in ways for _ in way) is not negated

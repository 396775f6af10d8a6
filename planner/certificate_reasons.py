"""The reason for unsolvability as a sentence, read from a certificate: the first cause, and its consequences up to the goal."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from fractions import Fraction

from confab.planner.certificate_checks import Cases, CaseView, Claims
from confab.planner.certificates import Certificate
from confab.planner.checked_conditions import own_variables, unified, variables
from confab.planner.plan import Reason
from confab.planner.possibilities import (
    ANYTHING,
    OPERATORS,
    FactEvaluation,
    Lowest,
    Range,
    WorkLimitError,
    calculated,
    compared,
)
from confab.reasoner.amounts import MORE, bounds, number, terms_of, towards, written
from confab.reasoner.derivation import conditions_of_goal
from confab.reasoner.language import substituted, terms, walk
from confab.reasoner.problem import Problem
from confab.reasoner.sentences import an, said
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    AmountEffect,
    AnyOf,
    Behavior,
    ClassCondition,
    Comparison,
    Condition,
    Effect,
    EqualityCondition,
    Fact,
    RelationCondition,
    Rule,
    Symbol,
    ValueCondition,
    Witness,
)

WORK = 300_000
"""Maximum number of tests to find the first cause."""
WORDS, ONE = ("none", "one", "two", "three", "four", "five"), "?one"
"""The small numbers as words, and the name of a variable for a counted individual."""
SHOWN = 4
"""Maximum number of facts that a sentence names."""
NOTHING = "no behaviour has this effect"
"""The cause that is stated if no other cause is found."""


@dataclass(frozen=True)
class Claim:
    """A fact that never or always holds; with variables, for all individuals of the variables' classes."""

    fact: Fact
    kinds: tuple[tuple[str, str], ...] = ()

    def __str__(self) -> str:
        """Return the claim as text; a variable is written as its class."""
        names = {variable: f"some {kind}" for variable, kind in self.kinds}
        symbol = self.fact.symbol
        named = Symbol(symbol.situation, tuple(names.get(a, a) for a in symbol.arguments))
        return str(Fact(named, names.get(self.fact.value, self.fact.value)))


@dataclass(frozen=True)
class Cause:
    """The reason why a fact can't hold: a sentence, its terms, and the claims on which the reason depends."""

    text: str
    terms: tuple[str, ...] = ()
    rests_on: tuple[Claim, ...] = ()
    parts: int = 1  # number of conditions in the sentence


def told(problem: Problem, certificate: Certificate) -> Reason:
    """Return the reason, read from a certificate, why a problem has no plan."""
    goals, causes = certificate.unmet[:SHOWN], _Causes(problem, certificate)
    what = " and ".join(_goal(problem, goal) for goal in goals) + " …" * (len(certificate.unmet) > SHOWN)
    many = len(goals) > 1
    how, more = "exclude each other" if many else "can't be reached", tuple[str, ...]()
    if certificate.told_apart:
        text = f"{what} {how}: {_of_cases(certificate)}"
    elif certificate.bounded or many:
        why = ""
        with suppress(WorkLimitError, RecursionError):
            why, more = causes.excluded()
        text = what + (" exclude each other" if many else " can't hold") + why
    else:
        why, named = causes.why(Claim(goals[0]))
        text, more = f"{what} {how}: {why}", tuple(word for word in named if not word.startswith("?"))
    return Reason(text, tuple(dict.fromkeys((*(word for fact in goals for word in _words(fact)), *more))))


def _goal(problem: Problem, goal: Fact) -> str:
    """Return a goal as text; a goal about a maximum or minimum is written as its comparison."""
    match conditions_of_goal(problem.domain, goal.symbol):
        case (Witness(comparison=Comparison()) as wanted,) if goal.value == TRUE:
            return said(wanted)
        case _:
            return str(goal)


def _of_cases(certificate: Certificate) -> str:
    """Return as text that no reachable combination of values contains the goals."""
    goals, symbols = certificate.unmet[:SHOWN], sorted(certificate.told_apart)
    values = {(fact.symbol.situation, fact.value) for fact in goals}
    if certificate.kind == "pair" and len(goals) == 2 and len(values) == 1 and goals[0].value not in (TRUE, FALSE):
        return "no reachable state has both"
    about = ", ".join(map(str, symbols[:SHOWN])) + f" and {len(symbols) - SHOWN} more" * (len(symbols) > SHOWN)
    wanted = "all of these goals" if len(goals) > 1 else "this goal"
    if certificate.cases == 1:
        return f"the only reachable combination of values of {about} doesn't contain {wanted}"
    return f"none of the {certificate.cases} reachable combinations of values of {about} contains {wanted}"


def _listed(claims: Sequence[Claim]) -> str:
    """Return the first claims as text, with the number of the other claims."""
    shown = [*map(str, claims[:SHOWN]), *([f"{len(claims) - SHOWN} more"] if len(claims) > SHOWN else [])]
    return " and ".join(filter(None, (", ".join(shown[:-1]), shown[-1])))


def _words(fact: Fact) -> tuple[str, ...]:
    return (*fact.symbol.arguments, fact.symbol.situation, fact.value)


class _Causes:
    """The causes of the claims in a certificate."""

    def __init__(self, problem: Problem, certificate: Certificate) -> None:
        self.problem, self.certificate = problem, certificate
        self.lowest = Lowest(problem, WORK)
        self.claims = Claims(self.lowest, certificate)

    def excluded(self) -> tuple[str, tuple[str, ...]]:
        """Return why the goals exclude each other, as text that continues this statement, and the terms of the text."""
        they = "together they" if len(self.certificate.unmet) > 1 else "it would"
        needed, (why, terms) = self.needed(), self.violation()
        because = f", because {' and '.join(self.holding(needed))}" if needed else ""
        words = [word for claim in needed for word in _words(claim.fact)]
        if terms or not needed:
            return f": {they} {why}{because}", (*terms, *words)
        if len(needed) > 1:
            return because, tuple(words)
        why, terms = self.why(needed[0])
        return f"{because}: {why}", (*words, *terms)

    def violation(self) -> tuple[str, tuple[str, ...]]:
        """Return what the goals violate, as text that completes "they would", and the terms of the text."""
        cases = Cases(self.lowest, self.certificate)
        for symbol in self.certificate.bounded:
            excess = cases.excess(FactEvaluation(self.lowest, cases.final(())), symbol)
            if excess is None:
                continue
            constraint = self.problem.domain.constraints.get(symbol.situation)
            if constraint is not None:
                return f"violate the constraint that {constraint}", (constraint.situation,)
            found, allowed = excess
            over = found.low > allowed.high
            got, end = (found.low, allowed.high) if over else (found.high, allowed.low)
            more, most = ("least", "maximum") if over else ("most", "minimum")
            amounts = f"at {more} {written(Fraction(got))}, and its {most} is {written(Fraction(end))}"
            return f"make {_named(symbol)} {amounts}", (*symbol.arguments, symbol.situation)
        return "contradict the definitions of derived facts", ()

    def needed(self) -> list[Claim]:
        """Return claims of the certificate that together exclude the goals from a final state; none of them is superfluous."""
        certificate, found = self.certificate, list[Claim]()
        for fact in sorted({*certificate.never, *map(Fact, certificate.always, certificate.always.values())}):
            always = {symbol: value for symbol, value in certificate.always.items() if Fact(symbol, value) != fact}
            fewer = replace(certificate, never=certificate.never - {fact}, always=always)
            if Cases(self.lowest, fewer).ends_here(()):
                found.append(Claim(fact))
            else:
                certificate = fewer
        return found

    def why(self, claim: Claim) -> tuple[str, tuple[str, ...]]:
        """Return the first cause of a claim and its consequences as text, and the terms of the text."""
        try:
            chain, cause = self.chain(claim)
        except (WorkLimitError, RecursionError):
            chain, cause = [], Cause(NOTHING)
        follows = [one for one in reversed(chain) if one.fact != claim.fact]
        so = "".join(f"; so {text}" for text in self.holding(follows))
        return cause.text + so, (*cause.terms, *(word for one in follows for word in _words(one.fact)))

    def holding(self, claims: Sequence[Claim]) -> Iterator[str]:
        """Yield as text which claims always hold, and which claims never hold."""
        kept = [*filter(self.kept, claims)]
        for facts, what in ((kept, "always"), ([claim for claim in claims if claim not in kept], "never")):
            if facts:
                yield f"{_listed(facts)} {what} hold{'s' * (len(facts) == 1)}"

    def limits(self, symbol: Symbol) -> str:
        """Return the bounds of an amount as text, or an empty text if it has no bounds."""
        found = self.lowest.allowed(symbol)
        ends = (("least", found.low), ("most", found.high))
        stated = [f"at {end} {written(number)}" for end, number in ends if isinstance(number, Fraction)]
        return f"{_named(symbol)} is {' and '.join(stated)}" if stated else ""

    def reading(self, amounts: bool = True) -> tuple[FactEvaluation, _ClaimRecorder]:
        """Return the reader of conditions, and the view that records the used claims, of amounts only if `amounts`."""
        claims = self.claims
        if not amounts:
            always = {s: v for s, v in self.certificate.always.items() if not self.amount(s)}
            claims = Claims(self.lowest, replace(self.certificate, always=always))
        view = _ClaimRecorder(claims, ())
        return FactEvaluation(self.lowest, view), view

    def chain(self, goal: Claim) -> tuple[list[Claim], Cause]:
        """Return the shortest chain of claims from the given claim to a claim whose cause depends on no other claim.

        If each cause depends on a claim, the chain ends at a claim about an amount with a cause that depends only on claims of the
        chain (a drive needs charge), together with its other causes (charging needs the dock); otherwise at a claim with a cause
        that depends only on facts that always hold, together with all such facts (every place is taken); otherwise, it is the given
        claim alone.
        """
        queue: list[tuple[Claim, ...]] = [(goal,)]
        seen = {goal}
        found = list[tuple[tuple[Claim, ...], Cause]]()
        for chain in queue:  # the loop appends chains to the queue
            for cause in self.causes(chain[-1], first=len(chain) == 1):
                if not cause.rests_on:
                    return [*chain], cause
                found.append((chain, cause))
                queue += [(*chain, claim) for claim in dict.fromkeys(cause.rests_on) if claim not in seen]
                seen.update(cause.rests_on)
        for chain, cause in found:
            if self.amount(chain[-1].fact.symbol) and {*cause.rests_on} <= {*chain}:
                others = [other for of, other in found if of is chain and other is not cause]
                every = [cause, *others][:SHOWN]
                return [*chain], Cause(
                    ", and ".join(one.text for one in every), tuple(w for one in every for w in one.terms)
                )
        for chain, cause in found:
            if all(map(self.kept, cause.rests_on)):
                held = [claim for claim in sorted(seen, key=str) if self.kept(claim) and claim not in chain]
                because = f", because {' and '.join(self.holding(held))}" if len(held) > 1 else ""
                words = [word for claim in held for word in _words(claim.fact)]
                return [*chain], Cause(cause.text + because, (*cause.terms, *words))
        return [goal], found[0][1] if found else Cause(NOTHING)

    def amount(self, symbol: Symbol) -> bool:
        """Return whether the values of a symbol are amounts."""
        return self.lowest.quantity(symbol.situation) is not None

    def kept(self, claim: Claim) -> bool:
        """Return whether a claim states that a fact always holds."""
        return self.certificate.always.get(claim.fact.symbol) == claim.fact.value

    def causes(self, claim: Claim, first: bool) -> list[Cause]:
        """For each behaviour that could make a claim false, return the cause that prevents it, the simplest cause first.

        The text of a cause doesn't repeat the `first` claim of a sentence.
        """
        fact, free, lowest = claim.fact, dict(claim.kinds), self.lowest
        symbol, situation = fact.symbol, fact.symbol.situation
        if not free and not lowest.exists(situation, symbol.arguments):
            return [Cause(f"there is no {symbol} on level {lowest.level}")]
        if limits := self.exceeded(fact):
            return [Cause(limits, (*symbol.arguments, situation))]
        if (total := self.too_much(fact)) is not None:
            return [total]
        found: list[Cause] = []
        for rule in self.problem.domain.rules.get(situation, ()):
            given = {p.name: a for p, a in zip(rule.parameters, symbol.arguments, strict=True) if a not in free}
            cause = self.too_few(rule, given) or self.lacking(claim, rule.behavior, rule.conditions, given)
            found.append(cause)
        amount = self.amount(symbol)
        kept = not amount and self.kept(claim)
        for behavior in lowest.behaviors:
            for effect in behavior.every_effect:
                if effect.situation != situation:
                    continue
                own = own_variables(behavior).union(*(variables(condition) for condition in effect.when))
                terms = (*effect.arguments, None if amount else getattr(effect, "value", None))
                if kept and terms[-1] == fact.value:  # any other value would make the claim false
                    continue
                words = (*symbol.arguments, None if amount or kept else fact.value)
                bound = unified(
                    self.problem, behavior, own, terms, tuple(None if word in free else word for word in words)
                )
                members = self.problem.members
                if (
                    bound is None
                    or (amount and not self.towards(effect, bound, fact))
                    or any(
                        members(free[word]).isdisjoint(
                            members(behavior.kinds[term]) if term in behavior.kinds else {term}
                        )
                        for term, word in zip(terms, words, strict=True)
                        if word in free and term is not None
                    )
                ):
                    continue
                classes = [
                    ClassCondition(term, free[word])
                    for term, word in zip(terms, words, strict=True)
                    if word in free and term in own and not members(behavior.kinds[term]) <= members(free[word])
                ]
                asked = (*behavior.preconditions, *effect.when)
                named = bound.keys() | set[str]().union(*map(variables, asked))
                classes += [ClassCondition(p.name, p.kind) for p in behavior.parameters if p.name not in named]
                found.append(self.lacking(claim, behavior, (*asked, *classes), bound))
        inapplicable = bool(found)
        found = [cause for cause in found if cause.text]
        if amount and not found and self.kept(claim):
            return [Cause(f"no behaviour of level {lowest.level} {_leaving(fact)}")]
        if amount and not found:
            return [Cause(f"no behaviour of level {lowest.level} gives {self.direction(fact)}")]
        if not found and kept:
            return [Cause(f"no behaviour of level {lowest.level} gives {_named(symbol)} another value")]
        if not found:
            has = "this effect" if first else f"the effect {claim}"
            what = f"with {has} is ever applicable" if inapplicable else f"has {has}"
            return [Cause(f"no behaviour of level {lowest.level} {what}")]
        return sorted(found, key=lambda cause: (bool(cause.rests_on), cause.parts, len(cause.rests_on)))

    def exceeded(self, fact: Fact) -> str:
        """Return as text the bound that a goal value exceeds, or an empty text if the value is within bounds."""
        if not self.amount(fact.symbol):
            return ""
        found = _end_before(self.lowest.bounds_of(fact.symbol.situation), fact.value)
        return f"{_named(fact.symbol)} is at {found[0]} {written(found[1])}" if found else ""

    def too_much(self, fact: Fact) -> Cause | None:
        """Return the range of a sum or count as a cause, if no number in the range satisfies a goal; otherwise None."""
        aggregate = self.problem.domain.aggregates.get(fact.symbol.situation)
        if aggregate is None or not aggregate.kept:
            return None
        reading, view = self.reading()
        found = _end_before(reading.total(aggregate, fact.symbol.arguments), fact.value)
        if found is None:
            return None
        what = "count of all individuals" if aggregate.function == "count" else "sum of all numbers"
        may = "may" if found[0] == "most" else "must"
        text = f"{_named(fact.symbol)} is at {found[0]} {written(found[1])}, the {what} that {may} belong to it"
        return Cause(text, (*fact.symbol.arguments, fact.symbol.situation), tuple(map(Claim, view.claimed)))

    def direction(self, fact: Fact) -> str:
        """Return `MORE` or `LESS`: the direction in which an amount must change to satisfy its goal."""
        return towards(self.problem.initial.get(fact.symbol), fact.value)

    def towards(self, effect: Effect, given: dict[str, str], fact: Fact) -> bool:
        """Return whether an effect may move an amount towards its goal, or beyond its claimed bounds."""
        if fact.value == self.certificate.always.get(fact.symbol) or not isinstance(effect, AmountEffect):
            return True
        reading, _ = self.reading()
        known = all(term in given for term in terms_of(effect.amount) if term.startswith("?"))
        by = reading.expression(effect.amount, given) if known else ANYTHING
        if by is None or effect.operation not in ("increase", "decrease"):
            return True
        more = (self.direction(fact) == MORE) is (effect.operation == "increase")
        return by.high > 0 if more else by.low < 0

    def too_few(self, rule: Rule, given: dict[str, str]) -> Cause | None:
        """Return a cause if a behaviour or rule requires more individuals than can exist."""
        for condition in rule.conditions:
            many, kind, own = counted(substituted(condition, given))
            if many < 2:
                continue
            kinds = {**rule.behavior.kinds, ONE: kind}
            reading, _ = self.reading()
            there = {env[ONE] for one in self.problem.classes.get(kind, ())
                     for env in reading.solutions(own, {ONE: one}, kinds)}  # fmt: skip
            if len(there) < many:
                each = " and ".join(said(substituted(c, {ONE: "each"})) for c in own)
                text = f"{rule.situation} requires {WORDS[many]} {kind}, {each}; there can be only {WORDS[len(there)]}"
                return Cause(text, (rule.situation, kind))
        return None

    def lacking(
        self, claim: Claim, behavior: Behavior, conditions: Sequence[Condition], given: dict[str, str]
    ) -> Cause:
        """Return a smallest set of conditions, preferably static, that can't hold together and keep a behaviour from its effect."""
        from confab.reasoner.validation.contradictions import clashing

        if clash := clashing(conditions, self.problem, behavior.kinds):
            text = f"{behavior.name} requires {self._all(clash, given, behavior.kinds)}, and no state satisfies both"
            return Cause(text, (behavior.name,), (), 2)
        core = self.core(conditions, given, behavior)
        if core is None:
            return self.out_of_bounds(behavior, conditions, given)
        opened, kinds, witness = core, dict(behavior.kinds), core[0]
        if len(core) == 1 and isinstance(witness, Witness) and not witness.negated and witness.comparison is None:
            kinds[witness.variable] = witness.kind
            inner = self.core(self.lowest.inside(witness), given, behavior, kinds)
            opened = [c for c in inner or core if not (isinstance(c, ClassCondition) and c.term == witness.variable)]
            opened = opened or core
        reading, view = self.reading()
        inside = {c.term: c.kind for c in opened if isinstance(c, ClassCondition) and not c.negated and c.term in kinds}
        any(True for _ in reading.solutions(with_classes(opened, given, kinds), given, {**kinds, **inside}))
        text, limits = self.words(opened, given, kinds), ""
        if any(self.amount(fact.symbol) for fact in view.claimed):
            unclaimed = self.reading(amounts=False)
            if not any(
                True for _ in unclaimed[0].solutions(with_classes(opened, given, kinds), given, {**kinds, **inside})
            ):
                view = unclaimed[1]
                bounded = [*filter(None, map(self.limits, view.read))]
                limits = " and ".join(bounded[:SHOWN]) + " …" * (len(bounded) > SHOWN)
                text += f", because {limits}" * bool(limits)
        names = tuple(
            word
            for condition in opened
            for word in (getattr(condition, "relation", getattr(condition, "situation", "")), *given.values())
            if word
        )
        claims = [Claim(fact) for fact in view.claimed]
        if claims == [claim] and not self.kept(claim):
            return Cause(f"{behavior.name} requires that {claim} already holds", (behavior.name, *names), (claim,))
        (first, *more) = [substituted(condition, given) for condition in opened]
        if len(claims) > 1 and not more and isinstance(first, ValueCondition) and not first.negated:
            free = {term for term in (*first.arguments, first.value) if term.startswith("?")}
            if free and free <= kinds.keys():  # for all individuals at once, if possible
                of_all = Fact(Symbol(first.situation, first.arguments), first.value)
                claims.insert(0, Claim(of_all, tuple((term, kinds[term]) for term in sorted(free))))
        if limits and not claims and conditions_of_goal(self.problem.domain, claim.fact.symbol):
            return Cause(limits, names)
        return Cause(f"{behavior.name} requires {text}", (behavior.name, *names), tuple(claims), len(opened))

    def core(
        self,
        conditions: Sequence[Condition],
        given: dict[str, str],
        behavior: Behavior,
        kinds: dict[str, str] | None = None,
    ) -> list[Condition] | None:
        """Return a minimal set of jointly unsatisfiable conditions, or None if all conditions are satisfiable."""
        kinds = kinds or dict(behavior.kinds)

        def can(some: Sequence[Condition]) -> bool:
            reading, _ = self.reading()
            return any(True for _ in reading.solutions(with_classes(some, given, kinds), given, kinds))

        if can(conditions):
            return None
        order = sorted(conditions, key=lambda c: (isinstance(c, ClassCondition), self.lowest.constant(c)))
        core = list(order)
        for condition in order:
            rest = [c for c in core if c is not condition]
            if not can(rest):
                core = rest
        return core

    def out_of_bounds(self, behavior: Behavior, conditions: Sequence[Condition], given: dict[str, str]) -> Cause:
        """Return the amount that a behaviour would move beyond its bounds."""
        reading, _ = self.reading()
        for env in reading.solutions(tuple(conditions), given, behavior.kinds):
            if reading.amounts(behavior, env) is not None:
                continue
            for effect in behavior.amounts:
                ways = reading.solutions(effect.when, env, behavior.kinds, must=True) if effect.when else [env]
                for text, words in (found for way in ways for found in self.beyond(reading, way, effect)):
                    return Cause(f"{behavior.name} {text}", (behavior.name, *words))
        return Cause("")

    def beyond(
        self, reading: FactEvaluation, env: Mapping[str, str], effect: AmountEffect
    ) -> Iterator[tuple[str, tuple[str, ...]]]:
        """Yield as text how an effect would violate the bounds of an amount; the text continues the name of a behaviour."""
        symbol = Symbol(effect.situation, tuple(env.get(a, a) for a in effect.arguments))
        quantity = self.lowest.quantity(effect.situation)
        old = reading.between(effect.situation, symbol.arguments)
        by = reading.expression(effect.amount, env)
        if quantity is None or old is None:
            return
        words, terms = _named(symbol), (*symbol.arguments, symbol.situation)
        new = by if by is None or effect.operation == "assign" else calculated(OPERATORS[effect.operation], old, by)
        constraint = self.problem.domain.constraints.get(symbol.situation)
        if by is None or new is None:
            yield f"would make {words} an amount that can't be calculated", terms
        elif constraint is not None:
            if quantity.most is not None and new.low > quantity.most:
                yield f"would violate the constraint that {constraint}", (constraint.situation,)
        elif quantity.most is not None and new.low > quantity.most and isinstance(new.low, Fraction):
            yield f"would take {words} to {written(new.low)}, more than its maximum, {written(quantity.most)}", terms
        elif quantity.least is not None and new.high < quantity.least and isinstance(new.high, Fraction):
            needed, unit = quantity.least + Fraction(by.low), " " * bool(quantity.unit) + quantity.unit
            if effect.operation == "decrease":
                there = "are there" if old.high == number(self.lowest.initial(symbol)) else "can be there at most"
                has = f"{written(Fraction(old.high))}{unit} {there}, and nothing gives more"
                yield f"requires {written(needed)}{unit} of {words}; {has}", terms
            else:
                yield (
                    f"would take {words} to {written(new.high)}, less than its minimum, {written(quantity.least)}",
                    terms,
                )
        elif quantity.whole and new.low == new.high and isinstance(new.low, Fraction) and new.low.denominator != 1:
            yield f"would take {words} to {written(new.low)}, which is no whole number", terms

    def words(self, core: Sequence[Condition], given: dict[str, str], kinds: dict[str, str]) -> str:
        """Return failing conditions as text, phrased as a requirement: ``a Hand that canReach location9, and there is none``."""

        def term(name: str) -> str:
            return given.get(name, f"some {kinds[name]}" if name in kinds else name)

        if len(core) == 1:
            condition = substituted(core[0], given)
            if isinstance(condition, ClassCondition) and not condition.negated:
                if condition.term.startswith("?"):
                    return f"{an(condition.kind)}, and there is none"
                return f"that {term(condition.term)} is {an(condition.kind)}, but {term(condition.term)} isn't"
            if isinstance(condition, RelationCondition) and not condition.negated and len(condition.arguments) == 2:
                left, right = condition.arguments
                if left.startswith("?"):
                    return f"{an(kinds[left])} that {condition.relation} {term(right)}, and there is none"
                if right.startswith("?"):
                    return f"{an(kinds[right])} that {left} {condition.relation}, and there is none"
        all_ = self._all(core, given, kinds)
        if len(core) > 1:
            return f"{all_}, which nothing satisfies"
        return f"{all_}, which {'does not hold' if self.lowest.constant(core[0]) else 'never holds'}"

    def _all(self, conditions: Sequence[Condition], given: dict[str, str], kinds: Mapping[str, str]) -> str:
        """Return a conjunction as text; variables without a value are written as their classes."""
        named = {**given, **{name: f"some {kind}" for name, kind in kinds.items() if name not in given}}
        return " and ".join(said(substituted(possible(substituted(c, given)), named)) for c in conditions)


def with_classes(
    conditions: Sequence[Condition], given: Mapping[str, str], kinds: Mapping[str, str]
) -> tuple[Condition, ...]:
    """Return conditions with the classes of the variables in quantifiers and alternatives, which bind only their own variables."""
    nested = {
        name for one in conditions if isinstance(one, AnyOf | Witness) for part in walk(one) for name in terms(part)
    }
    return (*conditions, *(ClassCondition(name, kinds[name]) for name in sorted(nested & kinds.keys() - given.keys())))


def possible(condition: Condition) -> Condition:
    """Return a disjunction without the alternatives that an equality of two individuals makes false."""
    if not isinstance(condition, AnyOf) or condition.negated:
        return condition
    groups = [group for group in condition.alternatives if not any(map(false_equality, group))]
    if len(groups) == 1 and len(groups[0]) == 1 and condition.constraint is None:
        return groups[0][0]
    return replace(condition, alternatives=tuple(groups or condition.alternatives))


def false_equality(condition: Condition) -> bool:
    """Return whether a condition is an equality that is false for all values of its variables."""
    if not isinstance(condition, EqualityCondition):
        return False
    left, right = condition.left, condition.right
    return condition.negated if left == right else not condition.negated and "?" not in (left[0], right[0])


def counted(condition: Condition | None) -> tuple[int, str, tuple[Condition, ...]]:
    """Return the number of different individuals that a condition requires, their class, and their common conditions."""
    before: list[str] = []
    found: tuple[str, tuple[Condition, ...]] = ("", ())
    while isinstance(condition, Witness) and not condition.negated and len(before) < len(WORDS) - 1:
        apart = {EqualityCondition(condition.variable, other, negated=True) for other in before}
        own = [c for c in condition.conditions if c not in apart]
        nested = own.pop() if own and isinstance(own[-1], Witness) and own[-1].kind == condition.kind else None
        one = condition.kind, tuple(substituted(c, {condition.variable: ONE}) for c in own)
        if before and (one != found or not apart <= {*condition.conditions}):
            break
        found = one
        before.append(condition.variable)
        condition = nested
    return len(before), *found


@dataclass
class _ClaimRecorder(CaseView):
    """A view of a case that records which claims made facts impossible."""

    claimed: dict[Fact, None] = field(default_factory=dict)
    read: dict[Symbol, None] = field(default_factory=dict)

    def may(self, symbol: Symbol, value: str) -> bool:
        """Return whether a symbol has a value in at least one state of the case."""
        found = super().may(symbol, value)
        if not found and value in self.claims.lowest.given[symbol.situation]:
            self.claimed[Fact(symbol, value)] = None
        return found

    def may_not(self, symbol: Symbol, value: str) -> bool:
        """Return whether a symbol has a value other than the given value in at least one state of the case."""
        found = super().may_not(symbol, value)
        if not found and symbol in self.claims.certificate.always:
            self.claimed[Fact(symbol, value)] = None
        return found

    def between(self, symbol: Symbol) -> Range:
        """Return the range of amounts of a symbol in the case."""
        self.read[symbol] = None
        always = self.claims.certificate.always.get(symbol)
        if always is not None:
            self.claimed[Fact(symbol, always)] = None
        return super().between(symbol)


def _leaving(fact: Fact) -> str:
    """Return what a behaviour does that makes a fact about an amount false, as text."""
    ends = {">=": "below", "<=": "above"}
    beyond = [f"{ends[sign]} {written(number)}" for sign, number in bounds(fact.value) if sign in ends]
    return f"takes {_named(fact.symbol)} {' or '.join(beyond)}" if beyond else f"changes {_named(fact.symbol)}"


def _end_before(found: Range, wanted: str) -> tuple[str, Fraction] | None:
    """Return the end of a range, most or least, that lies before a goal, or None if a number in the range satisfies the goal."""
    for sign, limit in bounds(wanted):
        if not compared(found, sign, Range(limit, limit), must=False):
            most = limit > found.high or (limit == found.high and sign[0] == ">")
            return ("most", Fraction(found.high)) if most else ("least", Fraction(found.low))
    return None


def _named(symbol: Symbol) -> str:
    """Return the first argument of a symbol, if the symbol has arguments, and the situation type of the symbol."""
    return " ".join((*symbol.arguments[:1], symbol.situation))

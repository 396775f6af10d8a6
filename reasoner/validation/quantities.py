"""Validation rules on amounts: their units, products of amounts, and the numbers that behaviours read."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from math import inf

from confab.reasoner.amounts import Amount, Calculation, Expression, Measure, exact, inside, situations_in, written
from confab.reasoner.language import groups, is_variable, walk
from confab.reasoner.problem import Problem
from confab.reasoner.reading.goals import some_of
from confab.reasoner.sentences import counted, plain
from confab.reasoner.symbols import AmountEffect, Behavior, ClassCondition, Comparison, Condition, Witness
from confab.reasoner.validation.case import Fault, ReadCase


def unlike_units(case: ReadCase) -> Iterator[Fault]:
    """Find amounts with different units that are compared, added or assigned to each other."""
    domain, units = case.problem.domain, case.units

    def unit(expression: Expression) -> tuple[str, str]:
        """Return the unit of an expression, and a mismatch of units inside the expression.

        The unit is empty if the expression has no unit or any unit.
        """
        match expression:
            case Amount(name) | Measure(name):
                return units.get(name, ""), ""
            case Calculation(sign, left, right):
                (one, wrong), (other, also) = unit(left), unit(right)
                if sign in "+-" and one and other and one != other:
                    return one, f"{one} and {other}"
                if sign in "*/" and one and other:
                    return "", wrong or also  # a derived unit
                return one or (other if sign != "/" else ""), wrong or also
            case Fraction():
                return "", ""

    causes: dict[tuple[str, str], dict[str, str]] = defaultdict(dict)  # by mismatch: the behaviours and their units
    totals = {name: one.behavior for name, one in domain.aggregates.items()}
    for name, behavior in (*totals.items(), *domain.behaviors.items()):
        for left, right, _ in _together(behavior):
            (one, wrong), (other, also) = unit(left), unit(right)
            if both := wrong or also or (f"{one} and {other}" if one and other and one != other else ""):
                parts = [part for side in (left, right) for part in inside(side)]
                about = {part.situation for part in parts if isinstance(part, Amount)}
                about |= {part.relation for part in parts if isinstance(part, Measure)}
                cause = " and ".join(sorted(both.split(" and "))), " and ".join(sorted(about))
                causes[cause].setdefault(name, both)
    for (_, named), done in causes.items():
        first, *others = done
        more = f"; {some(others)} {'have' if len(others) > 1 else 'has'} the same fault" if others else ""
        yield (
            case.names.iri(first),
            f"{first} combines numbers in {done[first]} ({named}){more}",
            "numbers of different units can't be combined",
            "use amounts of one unit, correct a c:unit, or multiply by a factor that converts one unit to the other",
        )


def _together(behavior: Behavior) -> Iterator[tuple[Expression, Expression, str]]:
    """Yield the pairs of expressions that a behaviour compares or combines, with the operation in words."""
    for one in (inner for condition in behavior.conditions for inner in walk(condition)):
        if isinstance(one, Comparison):
            yield one.left, one.right, "compares"
    for effect in behavior.amounts:
        by: Expression = effect.amount
        if effect.operation == "scale":  # a factor has no unit
            by = Calculation("*", Amount(effect.situation, effect.arguments), effect.amount)
        yield Amount(effect.situation, effect.arguments), by, f"{effect.operation}s"


def multiplied_amounts(case: ReadCase) -> Iterator[Fault]:
    """Find products and quotients of changing amounts.

    The search for plans of a whole level doesn't support products and quotients of changing amounts.
    """
    domain, names = case.problem.domain, case.names
    changed = {effect.situation for behavior in domain.behaviors.values() for effect in behavior.amounts}
    for name, behavior in case.behaviors_and_rules:
        found = dict[tuple[str, str, str], None]()
        for left, right, does in _together(behavior):
            for part in (*inside(left), *(() if does == "scales" else inside(right))):
                if isinstance(part, Calculation) and part.operator in "*/":
                    one, other = (sorted(situations_in(side) & changed) for side in (part.left, part.right))
                    if other and (one or part.operator == "/"):
                        found[part.operator, " and ".join(one), " and ".join(other)] = None
        for sign, first, second in found:
            does = f"multiplies {first} by {second}" if sign == "*" else f"divides by {second}"
            yield (
                names.iri(name),
                f"{name} {does}, {'both of which' if first and sign == '*' else 'which'} behaviours change",
                "a level with such a calculation can't be grounded: the planner gives up hard tasks, and proves no plan optimal",
                "multiply by a constant or by the number of a relation, or add and subtract instead",
            )


def numbers_missing(case: ReadCase) -> Iterator[Fault]:
    """Find individuals for which the ontology lacks a number that a behaviour reads.

    A behaviour isn't applicable to an individual without a number that the behaviour reads.
    """
    problem, names = case.problem, case.names
    lacking: dict[tuple[str, str], dict[str, set[str]]] = defaultdict(lambda: defaultdict(set))
    for behavior in problem.domain.behaviors.values():
        among = {term: (kind, frozenset(problem.classes.get(kind, ()))) for term, kind in behavior.kinds.items()}
        read = [*_measured(behavior.preconditions, among, problem)]
        for effect in behavior.amounts:
            conditions = (*behavior.preconditions, *effect.when, Comparison(effect.amount, "=", effect.amount))
            read += _measured(conditions, among, problem)
        for relation, kind, individuals in read:
            stated = {row[0] for row in problem.relations.get(relation, ())}
            for one in individuals - stated:
                lacking[relation, kind][one].add(behavior.name)
    for (relation, kind), found in sorted(lacking.items()):
        objects = sorted(found)
        some = some_of(objects, 5)
        readers = " and ".join(sorted(set().union(*found.values())))
        has = "have" if len(objects) > 1 else "has"
        yield (
            names.iri(objects[0]),
            f"{some} {has} no {relation}, but {readers} read{'' if ' and ' in readers else 's'} {relation} of every {kind}",
            "a comparison with a missing number is false, so no such behaviour is applicable to these individuals",
            f"state {relation} of {some}, or let {readers} be about another class than {kind}",
        )


def numbers_missing_for_members(case: ReadCase) -> Iterator[Fault]:
    """Find numbers that an effect on all members of a class reads, and that are stated for some of the members only."""
    problem, names = case.problem, case.names
    for name, behavior in problem.domain.behaviors.items():
        found: dict[tuple[str, str], dict[str, set[tuple[str, ...]]]] = defaultdict(lambda: defaultdict(set))
        for effect in behavior.amounts:
            for part in inside(effect.amount) if not effect.when else ():
                if (
                    isinstance(part, Measure)
                    and len(its := [one for one in part.arguments if one in behavior.spread]) == 1
                ):
                    rows = problem.relations.get(part.relation, ())
                    found[effect.situation, part.relation][its[0]].update(_values_of_variables(part.arguments, rows))
        for (situation, relation), by in found.items():
            every = set[tuple[str, ...]]().union(*by.values())
            missing = sorted((*values, member) for values in every for member, its in by.items() if values not in its)
            if missing:
                least, more = " and ".join(missing[0]), f" and {len(missing) - 1} others" * (len(missing) > 1)
                here = f", here with {missing[0][0]}" if len(missing[0]) > 1 else ""
                yield (
                    names.iri(name),
                    f"{name} changes {situation} of each member of a class by {relation}, but without the number of {least}{more}",
                    f"an effect without a number makes the behaviour inapplicable{here}",
                    f"state {relation} of {least} (0 for no change)",
                )


def _values_of_variables(arguments: Sequence[str], rows: Iterable[Sequence[str]]) -> Iterator[tuple[str, ...]]:
    """Yield the values of the variables among the arguments of a number in each row that has the other arguments."""
    for row in rows:
        pairs = list(zip(arguments, row, strict=False))
        if all(is_variable(argument) or argument == value for argument, value in pairs):
            yield tuple(value for argument, value in pairs if is_variable(argument))


def _measured(
    conditions: Sequence[Condition], among: Mapping[str, tuple[str, frozenset[str]]], problem: Problem
) -> Iterator[tuple[str, str, frozenset[str]]]:
    """Yield each relation that assigns a number to a single term, with the term's class and possible individuals."""
    among = dict(among)
    for condition in conditions:
        if isinstance(condition, ClassCondition) and not condition.negated and condition.term in among:
            individuals = among[condition.term][1] & frozenset(problem.classes.get(condition.kind, ()))
            among[condition.term] = condition.kind, individuals
    for condition in conditions:
        match condition:
            case Comparison(left, _, right):
                for part in (*inside(left), *inside(right)):
                    if isinstance(part, Measure) and len(part.arguments) == 1 and part.arguments[0] in among:
                        yield part.relation, *among[part.arguments[0]]
            case Witness(variable, kind):
                members = kind, frozenset(problem.classes.get(kind, ()))
                for group in groups(condition):
                    yield from _measured(group, {**among, variable: members}, problem)
            case _:
                for group in groups(condition):
                    yield from _measured(group, among, problem)


# --------------------------------------------------------------------------------------------------- reachable ranges of amounts

Range = tuple[Fraction | float, Fraction | float]
"""Minimum and maximum of an amount."""
ANY: Range = (-inf, inf)
ROUNDS = 4
"""Number of rounds after which a range that is still growing is treated as unbounded."""


def amounts_out_of_reach(case: ReadCase) -> Iterator[Fault]:
    """Find behaviours that are never applicable because their conditions or effects require unreachable amounts."""
    if not case.problem.initial:
        return
    problem, names = case.problem, case.names
    ranges = _Ranges(problem)
    waiting = {
        name: one
        for name, one in problem.domain.behaviors.items()
        if one.amounts or any(isinstance(condition, Comparison) for condition in one.preconditions)
    }
    for turn in range(ROUNDS + 2 * len(waiting)):
        ready = [b for b in problem.domain.behaviors.values() if not ranges.lacking(b)]
        grown = [ranges.extend(b, turn >= ROUNDS) for b in ready]
        if not any(grown):
            break
    told: dict[str, list[tuple[str, str]]] = defaultdict(list)
    for name, behavior in waiting.items():
        if lacking := ranges.lacking(behavior):
            told[lacking[1]].append((name, lacking[0]))
    for about, ((first, lacks), *others) in told.items():
        more = f"; neither is {some([name for name, _ in others])}" if others else ""
        yield (
            names.iri(first),
            f"{first} is never applicable: {lacks}, and {about}{more}",
            "this holds in the initial state, and no applicable behaviour leads to another amount",
            "correct the amount or the bounds, state another amount in the scene, or add a behaviour that leads to a suitable "
            "amount",
        )


class _Ranges:
    """For each situation type, the range of its amounts over all individuals and all sequences of behaviours."""

    def __init__(self, problem: Problem) -> None:
        self.quantities = {name: s.quantity for name, s in problem.domain.situations.items() if s.quantity is not None}
        self.known: dict[str, Range] = {}
        for symbol, value in problem.initial.items():
            if symbol.situation in self.quantities:
                self.widen(symbol.situation, (Fraction(value), Fraction(value)))
        self.numbers = {
            relation: (min(found), max(found))
            for relation, rows in problem.relations.items()
            if (found := [number for row in rows if (number := exact(row[-1])) is not None])
        }

    def widen(self, situation: str, more: Range, endlessly: bool = False) -> bool:
        """Extend the range of a situation type, to infinity if `endlessly`; return whether the range changed."""
        old = self.known.get(situation)
        low, high = more if old is None else (min(old[0], more[0]), max(old[1], more[1]))
        if endlessly and old is not None:
            low, high = (low if low == old[0] else -inf), (high if high == old[1] else inf)
        quantity = self.quantities[situation]
        low = low if quantity.least is None else max(low, quantity.least)
        high = high if quantity.most is None else min(high, quantity.most)
        self.known[situation] = low, high
        return self.known[situation] != old

    def of(self, expression: Expression, narrowed: Mapping[Expression, Range]) -> Range | None:
        """Return the range of a numeric expression; return None for an expression without a value."""
        if expression in narrowed:
            return narrowed[expression]
        match expression:
            case Amount(situation):
                return self.known.get(situation)
            case Measure(relation):
                return self.numbers.get(relation)
            case Calculation(sign, left, right):
                one, other = self.of(left, narrowed), self.of(right, narrowed)
                return None if one is None or other is None else _calculated(sign, one, other)
            case Fraction():
                return expression, expression

    def lacking(self, behavior: Behavior) -> tuple[str, str] | None:
        """Return the reason why a behaviour is never applicable, with the ranges of the amounts concerned.

        Return None if the behaviour may be applicable.
        """
        narrowed: dict[Expression, Range] = {}
        for condition in behavior.preconditions:
            if not isinstance(condition, Comparison) or condition.negated:
                continue
            left, right = self.of(condition.left, narrowed), self.of(condition.right, narrowed)
            if left is None or right is None:
                continue  # missing numbers are reported by another rule
            if not _possible(condition.operator, left, right):
                return f"it requires that {plain(condition)}", self.about(condition)
            if isinstance(condition.left, Amount):
                narrowed[condition.left] = _narrowed(condition.operator, left, right)
            if isinstance(condition.right, Amount):
                narrowed[condition.right] = _narrowed(CONVERSE[condition.operator], right, left)
        for effect in behavior.amounts:
            quantity = self.quantities.get(effect.situation)
            after = self.after(effect, narrowed)
            same = sum(other.situation == effect.situation for other in behavior.amounts)
            if effect.when or quantity is None or after is None or same > 1:
                continue
            amount = counted(Amount(effect.situation, effect.arguments)).replace("?", "")
            if quantity.most is not None and after[0] > quantity.most:
                limit = f"above its maximum of {written(quantity.most)}"
                return f"it would make {amount} {_written(after[0])} or more, {limit}", self.about(effect)
            if quantity.least is not None and after[1] < quantity.least:
                limit = f"below its minimum of {written(quantity.least)}"
                return f"it would make {amount} {_written(after[1])} or less, {limit}", self.about(effect)
        return None

    def about(self, part: Comparison | AmountEffect) -> str:
        """Return a clause that states the ranges of the amounts in a condition or effect."""
        found = (
            situations_in(part.left) | situations_in(part.right)
            if isinstance(part, Comparison)
            else situations_in(part.amount) | ({part.situation} if part.operation != "assign" else frozenset())
        )
        said = []
        for situation in sorted(found):
            low, high = self.known.get(situation, ANY)
            if low == high:
                within = f"always {_written(low)}"
            elif high == inf:
                within = f"never less than {_written(low)}"
            elif low == -inf:
                within = f"never more than {_written(high)}"
            else:
                within = f"always from {_written(low)} to {_written(high)}"
            said.append(f"{situation} is {within}")
        return " and ".join(said) or "no state satisfies this"

    def after(self, effect: AmountEffect, narrowed: Mapping[Expression, Range]) -> Range | None:
        """Return the range of an amount after an effect; return None if the range is unknown."""
        now, by = self.of(Amount(effect.situation, effect.arguments), narrowed), self.of(effect.amount, narrowed)
        if now is None or by is None:
            return None
        sign = {"increase": "+", "decrease": "-", "scale": "*"}.get(effect.operation)
        return by if sign is None else _calculated(sign, now, by)

    def extend(self, behavior: Behavior, endlessly: bool) -> bool:
        """Extend the ranges by the effects of a behaviour; return whether a range changed."""
        found = [(effect.situation, self.after(effect, {})) for effect in behavior.amounts]
        new = [self.widen(situation, after, endlessly) for situation, after in found if after is not None]
        return any(new)


CONVERSE = {"<": ">", "<=": ">=", "=": "=", ">=": "<=", ">": "<"}


def _possible(sign: str, left: Range, right: Range) -> bool:
    """Return whether a comparison is true for some pair of numbers from two ranges."""
    match sign:
        case "<":
            return left[0] < right[1]
        case "<=":
            return left[0] <= right[1]
        case ">":
            return left[1] > right[0]
        case ">=":
            return left[1] >= right[0]
        case _:
            return left[0] <= right[1] and right[0] <= left[1]


def _narrowed(sign: str, left: Range, right: Range) -> Range:
    """Return the part of the range `left` for which a comparison with some number of the range `right` is true."""
    low = max(left[0], right[0]) if sign in (">", ">=", "=") else left[0]
    high = min(left[1], right[1]) if sign in ("<", "<=", "=") else left[1]
    return low, high


def _calculated(sign: str, one: Range, other: Range) -> Range:
    if sign == "+":
        return one[0] + other[0], one[1] + other[1]
    if sign == "-":
        return one[0] - other[1], one[1] - other[0]
    if sign == "/" or inf in (*map(abs, one), *map(abs, other)):
        return ANY
    products = [left * right for left in one for right in other]
    return min(products), max(products)


def _written(amount: Fraction | float) -> str:
    return written(amount) if isinstance(amount, Fraction) else str(amount)


def some(names: Sequence[str], most: int = 5) -> str:
    """Return an enumeration of names for a sentence; after `most` names, the enumeration ends with "others"."""
    shown = [*names[:most], *(["others"] if len(names) > most else [])]
    return " and ".join(filter(None, (", ".join(shown[:-1]), shown[-1])))

"""Durative actions of PDDL 2.1: their durations, and their conditions and effects with times."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction

from confab.reasoner.pddl.words import Form, PddlWord, is_number

SPANS = {("at", "start"): "start", ("over", "all"): "all", ("at", "end"): "end"}
DURATION = "?duration"


@dataclass(frozen=True)
class Durative:
    """The duration, conditions and effects of a durative action; each condition and effect has the time `start`, `all` or `end`."""

    duration: PddlWord | Form
    conditions: tuple[tuple[str, Form], ...]
    effects: tuple[tuple[str, Form], ...]


class NotTimedError(ValueError):
    """Raised if a part of a durative action states no time or an unsupported time; `at` is the part's position in the text."""

    def __init__(self, at: PddlWord | Form, text: str) -> None:
        super().__init__(text)
        self.at = at


def duration_in(form: Form) -> PddlWord | Form:
    """Return the number or expression that a ``:duration`` form states; return the lower bound if the form states only bounds."""
    found: dict[str, PddlWord | Form] = {}
    for one in _bounds(form):
        if (
            one.head not in ("=", "<=", ">=")
            or len(one.items) != 3
            or not (isinstance(one.items[1], PddlWord) and one.items[1].text == DURATION)
        ):
            raise NotTimedError(one, "wanted (= ?duration …), or bounds by (>= ?duration …) and (<= ?duration …)")
        if found and (one.head in found or "=" in (*found, one.head)):
            raise NotTimedError(one, "wanted (= ?duration …) alone, or one lower and one upper bound of ?duration")
        found[one.head] = one.items[2]
    chosen = found.get("=") or found.get(">=") or found.get("<=")
    if chosen is None:
        raise NotTimedError(form, "wanted (= ?duration …)")
    numbers = {sign: Fraction(one.text) for sign, one in found.items() if isinstance(one, PddlWord) and is_number(one)}
    if ">=" in numbers and numbers[">="] > numbers.get("<=", numbers[">="]):
        raise NotTimedError(form, "the lower bound of ?duration is above its upper bound")
    return chosen


def _bounds(form: Form) -> Iterator[Form]:
    """Yield the comparisons of a ``:duration`` form, without their times as in ``(at start (= ?duration …))``."""
    parts = (
        form.items[1:] if form.head == "and" else form.items[2:] if form.head == "at" and len(form.items) == 3 else ()
    )
    if not parts:
        yield form
    for part in parts:
        if not isinstance(part, Form):
            raise NotTimedError(form, f"wanted bounds of ?duration, got '{part.text}'")
        yield from _bounds(part)


def timed(form: Form | None, what: str, duration: PddlWord | Form) -> Iterator[tuple[str, Form]]:
    """Yield the time and the form of each condition or effect of a durative action; `duration` replaces ``?duration``."""
    if form is None or not form.items:
        return
    words = tuple(item.text for item in form.items[:2] if isinstance(item, PddlWord))
    if form.head == "and":
        for item in form.items[1:]:
            if not isinstance(item, Form):
                raise NotTimedError(item, f"wanted a {what} with its time, got '{item.text}'")
            yield from timed(item, what, duration)
    elif words in SPANS and len(form.items) == 3 and isinstance(form.items[2], Form):
        if words == ("over", "all") and what == "effect":
            raise NotTimedError(form, "an effect is (at start …) or (at end …)")
        yield SPANS[words], _put(form.items[2], duration)
    elif form.head == "forall" and len(form.items) == 3 and isinstance(form.items[2], Form):
        for span, inner in timed(form.items[2], what, duration):
            yield span, replace(form, items=(*form.items[:2], inner))
    elif form.head == "when" and len(form.items) == 3 and all(isinstance(one, Form) for one in form.items[1:]):
        asked = list(timed(form.items[1], "condition", duration))  # type: ignore[arg-type]
        for span, inner in timed(form.items[2], what, duration):  # type: ignore[arg-type]
            if any(at != span for at, _ in asked):
                raise NotTimedError(form, "a condition of an effect at another time than the effect is not supported")
            yield span, replace(form, items=(form.items[0], _both([one for _, one in asked], form), inner))
    elif form.head in ("increase", "decrease") and any(_names(item, "#t") for item in form.items):
        raise NotTimedError(form, "continuous effects are not supported (#t)")
    else:
        raise NotTimedError(form, f"wanted (at start …), (over all …) or (at end …), got ({form.head or '…'} …)")


def whole(parts: Durative, place: Form) -> tuple[Form, Form]:
    """Return all conditions of a durative action as one formula, and all its effects as one effect, without their times."""
    return _both([one for _, one in parts.conditions], place), _both([one for _, one in parts.effects], place)


def _both(forms: list[Form], place: Form) -> Form:
    return Form((PddlWord("and", place.line, place.column), *forms), place.line, place.column)


def _put(form: Form, duration: PddlWord | Form) -> Form:
    """Return a copy of a form with `duration` substituted for the variable ``?duration``."""
    return replace(
        form,
        items=tuple(
            _put(item, duration) if isinstance(item, Form) else duration if item.text == DURATION else item
            for item in form.items
        ),
    )


def _names(item: PddlWord | Form, text: str) -> bool:
    return item.text == text if isinstance(item, PddlWord) else any(_names(one, text) for one in item.items)

"""Functions that flatten and inspect parsed PDDL conditions and effects, which are nested lists of words (`Form`)."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from math import prod
from typing import TypeAlias

from confab.reasoner.pddl.declarations import CHANGES, Typed, either
from confab.reasoner.pddl.words import Form, PddlWord

Atom = tuple[str, ...]
"""A predicate followed by its terms."""
MOST_CONJUNCTS = 10_000
"""Maximum number of conjuncts that replace one universally quantified conjunct of a goal."""


@dataclass(frozen=True)
class PddlEffect:
    """An effect that makes an atom true or false for all values of `variables` that satisfy the conditions `when`."""

    atom: Atom
    true: bool
    when: tuple[Form, ...] = ()
    variables: tuple[Typed, ...] = ()


@dataclass(frozen=True)
class NumericEffect:
    """An effect that changes a function by the operation `head` (one of `CHANGES`) if the conditions `when` hold."""

    head: str
    function: Form
    amount: PddlWord | Form
    when: tuple[Form, ...] = ()
    variables: tuple[Typed, ...] = ()


FormChange: TypeAlias = "tuple[Form, tuple[Form, ...], tuple[Typed, ...]]"
"""A single change of an effect, its conditions, and its universally quantified variables."""


def typed_in(form: Form) -> list[Typed]:
    """Return the variables, with their types, that a list such as ``(?x ?y - truck)`` declares.

    The syntax of the list must be correct.
    """
    found: list[Typed] = []
    waiting: list[PddlWord] = []
    items = iter(form.items)
    for item in items:
        assert isinstance(item, PddlWord)
        if item.text == "-":
            kind = next(items)
            found += [
                Typed(w.text, kind.text if isinstance(kind, PddlWord) else either(words_of(kind)[1:]), w)
                for w in waiting
            ]
            waiting = []
        else:
            waiting.append(item)
    return [*found, *(Typed(w.text, "object", w) for w in waiting)]


def distinct(form: Form, taken: Collection[str], names: Mapping[str, str] | None = None) -> Form:
    """Return a copy of a formula or an effect in which no quantified variable has the name of a variable in whose scope it is.

    Parameters
    ----------
    form : Form
        A formula or an effect whose syntax has been checked.
    taken : collection of str
        The variables in whose scope `form` is.
    names : mapping of str to str, optional
        The new names of quantified variables in whose scope `form` is.
    """
    names = names or {}
    if form.head in ("exists", "forall"):
        assert isinstance(form.items[1], Form)
        for one in typed_in(form.items[1]):
            new = one.name
            while new in taken:
                new += "_"
            taken, names = {*taken, new}, {**names, one.name: new}
    items = (
        distinct(item, taken, names) if isinstance(item, Form) else
        replace(item, text=names[item.text]) if item.text in names else item
        for item in form.items
    )  # fmt: skip
    return replace(form, items=tuple(items))


def words_of(form: Form) -> Atom:
    """Return the words of a list, without the words of nested lists."""
    return tuple(item.text for item in form.items if isinstance(item, PddlWord))


def words_in(*forms: Form | None) -> Iterator[Atom]:
    """Yield the words of each list in the given forms, including nested lists."""
    for form in forms:
        if form is not None:
            yield words_of(form)
            yield from words_in(*(item for item in form.items if isinstance(item, Form)))


def conjuncts(form: Form | None) -> Iterator[Form]:
    """Yield the conjuncts of a formula; nested conjunctions are flattened."""
    if form is None:
        return
    if form.head == "and":
        for item in form.items[1:]:
            assert isinstance(item, Form)
            yield from conjuncts(item)
    elif form.items:
        yield form


def spread(form: Form, objects: Callable[[str], Sequence[str]], holds: Callable[[Atom], bool | None]) -> Iterator[Form]:
    """Yield the conjuncts of a formula; a universally quantified conjunct becomes one conjunct per object.

    Conjuncts that always hold are omitted.

    Parameters
    ----------
    form : Form
        A formula without free variables.
    objects : callable
        A function that returns the objects of a type.
    holds : callable
        A function that returns True for an atom that always holds, False for an atom that never holds, and None for other atoms.
    """
    rest = [item for item in form.items[1:] if isinstance(item, Form)]
    if form.head == "and":
        for item in rest:
            yield from spread(item, objects, holds)
    elif form.head == "forall":
        typed = typed_in(rest[0])
        things = [objects(one.type) for one in typed]
        if prod(map(len, things)) > MOST_CONJUNCTS:
            yield form
            return
        for row in product(*things):
            yield from spread(_with(rest[1], dict(zip((one.name for one in typed), row, strict=True))), objects, holds)
    elif form.head == "imply" and (known := _known(rest[0], holds)) is not None:
        if known:
            yield from spread(rest[1], objects, holds)
    elif form.items and _known(form, holds) is not True:
        yield form


def _with(form: Form, terms: Mapping[str, str]) -> Form:
    """Return a copy of a form with terms substituted for free variables."""
    if form.head in ("exists", "forall"):
        assert isinstance(form.items[1], Form)
        own = {one.name for one in typed_in(form.items[1])}
        terms = {name: term for name, term in terms.items() if name not in own}
    return replace(
        form,
        items=tuple(
            _with(item, terms) if isinstance(item, Form) else replace(item, text=terms.get(item.text, item.text))
            for item in form.items
        ),
    )


def _known(form: Form, holds: Callable[[Atom], bool | None]) -> bool | None:
    """Return whether a condition without variables always holds (True), never holds (False) or may change (None)."""
    rest = [item for item in form.items[1:] if isinstance(item, Form)]
    if form.head in ("and", "or"):
        found = {_known(item, holds) for item in rest}
        sure = form.head == "or"
        return sure if sure in found else None if None in found else not sure
    if form.head == "not":
        inner = _known(rest[0], holds)
        return None if inner is None else not inner
    return None if rest or not form.items else holds(words_of(form))


def effects_of(form: Form | None) -> Iterator[PddlEffect]:
    """Yield the parts of an effect that make atoms true or false."""
    for change, when, variables in _changes(form):
        if change.head == "not":
            negated = change.items[1]
            assert isinstance(negated, Form)
            yield PddlEffect(words_of(negated), False, when, variables)
        elif change.head not in CHANGES:
            yield PddlEffect(words_of(change), True, when, variables)


def numeric_of(form: Form | None) -> Iterator[NumericEffect]:
    """Yield the parts of an effect that change functions."""
    for change, when, variables in _changes(form):
        if change.head in CHANGES:
            function = change.items[1]
            assert isinstance(function, Form)
            yield NumericEffect(change.head, function, change.items[2], when, variables)


def _changes(form: Form | None, when: tuple[Form, ...] = (), variables: tuple[Typed, ...] = ()) -> Iterator[FormChange]:
    """Yield the single changes of an effect, each with its conditions and quantified variables."""
    if form is None or not form.items:
        return
    rest = [item for item in form.items[1:] if isinstance(item, Form)]
    if form.head == "and":
        for item in rest:
            yield from _changes(item, when, variables)
    elif form.head == "when":
        yield from _changes(rest[1], (*when, rest[0]), variables)
    elif form.head == "forall":
        yield from _changes(rest[1], when, (*variables, *typed_in(rest[0])))
    else:
        yield form, when, variables


def functions_read(form: Form | None) -> Iterator[str]:
    """Yield the functions that a form reads (the first words of its lists), without the function that a numeric effect changes."""
    if form is None:
        return
    for item in form.items[2 if form.head in CHANGES else 0 :]:
        if isinstance(item, Form):
            yield item.head
            yield from functions_read(item)


def atoms_in(form: Form, predicates: Collection[str], own: dict[str, str]) -> list[tuple[Atom, dict[str, str]]]:
    """Return the atoms of a formula, each with the types of the quantified variables in whose scope it occurs."""
    if form.head in ("exists", "forall"):
        assert isinstance(form.items[1], Form)
        own = own | {t.name: t.type for t in typed_in(form.items[1])}
    elif form.head in predicates:
        return [(words_of(form), own)]
    return [found for item in form.items[1:] if isinstance(item, Form) for found in atoms_in(item, predicates, own)]

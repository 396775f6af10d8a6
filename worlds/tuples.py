"""Random relations and situation types of two or three individuals, which exist for some individuals only.

Each function draws with a generator of its own, which keeps worlds without such relations unchanged.
"""

from __future__ import annotations

from fractions import Fraction
from itertools import product
from random import Random

from confab.reasoner.amounts import Quantity
from confab.reasoner.symbols import FALSE, SituationType, Symbol
from worlds.phrases import Vocabulary

KINDS = ("A", "B", "A1")


def numbers_of_some(draft: Vocabulary, own: Random, levels: int) -> None:
    """Draw constants and amounts that only some pairs have, and a true-or-false type of the individuals of a small class."""
    draft.partial = True
    ends = own.choice(KINDS), own.choice(KINDS)
    pairs = product(*(draft.classes[of] for of in ends))
    if rows := frozenset((*row, str(own.randint(0, 3))) for row in pairs if own.random() < 0.5):
        draft.relations["way"], draft.ends["way"] = rows, ends
    if own.random() < 0.8:
        least, most = own.choice((Fraction(0), Fraction(-1), None)), own.choice((Fraction(2), Fraction(3)))
        quantity = Quantity("", own.random() < 0.6, least, most)
        kinds = own.choice(KINDS), own.choice(KINDS)
        add(draft, SituationType("M8", kinds, "M8", own.randint(1, levels), quantity=quantity))
        for row in product(*(draft.classes[of] for of in kinds)):
            if own.random() < 0.5:
                draft.initial[Symbol("M8", row)] = str(own.randint(0, 2))
    if own.random() < 0.5:
        kind = own.choice(("A1", "B"))
        add(draft, SituationType("P8", (kind,), "Truth", own.randint(1, levels), None, FALSE, boolean=True), kind)
        for one in draft.classes[kind]:
            if own.random() < 0.4:
                draft.initial[Symbol("P8", (one,))] = "true"


def of_three(draft: Vocabulary, own: Random, levels: int) -> None:
    """Draw a situation type of three arguments, and sometimes a static relation of three individuals."""
    kinds = tuple(own.choice(KINDS) for _ in range(3))
    rows = list(product(*(draft.classes[of] for of in kinds)))
    level = own.randint(1, levels)
    shape = own.choice("QQGM")
    name = f"{shape}7"
    if shape == "Q":
        rest = FALSE if level > 1 and own.random() < 0.4 else None
        add(draft, SituationType(name, kinds, "Truth", level, rest, FALSE, boolean=True))
        draft.initial |= {Symbol(name, row): "true" for row in rows if own.random() < (0.3 if rest is None else 0.05)}
    elif shape == "G":
        values = (f"{name}v0", f"{name}v1")
        draft.classes[name] = values
        add(draft, SituationType(name, kinds, name, level, None, own.choice(values)))
        draft.initial |= {Symbol(name, row): own.choice(values) for row in rows}
    else:
        quantity = Quantity("", own.random() < 0.6, Fraction(0), own.choice((Fraction(2), Fraction(3))))
        default = own.choice(("1", None))
        add(draft, SituationType(name, kinds, name, level, None, default, quantity=quantity))
        stated = [row for row in rows if default is not None or own.random() < 0.5]
        draft.initial |= {Symbol(name, row): str(own.randint(0, 2)) for row in stated}
    if own.random() < 0.5:
        ends = tuple(own.choice(KINDS) for _ in range(3))
        draft.ends["between"] = ends
        among = product(*(draft.classes[of] for of in ends))
        draft.relations["between"] = frozenset(row for row in among if own.random() < 0.5)


def add(draft: Vocabulary, one: SituationType, *owners: str) -> None:
    """Add a situation type to a world; a type of several arguments has no owners."""
    draft.situations[one.name], draft.owners[one.name] = one, owners

"""What follows from rules, as the checker works it out, without a line in common with any search."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TypeAlias

from confab.reasoner.derivation import strata
from confab.reasoner.symbols import Rule

Cell: TypeAlias = "tuple[str, tuple[str, ...]]"


def stratum_of(rules: Mapping[str, Sequence[Rule]]) -> dict[str, tuple[str, ...]]:
    """Return for each situation type that rules define those that depend on it and on which it depends."""
    return {name: group for group in strata(rules) for name in group}


class Definitions:
    """What is defined, asked one symbol at a time, and known until `forget`.

    Parameters
    ----------
    strata : mapping of situation type to its stratum
        From `stratum_of`.
    given : function of a situation type and arguments to a truth value
        Whether one of the rules gives it; what rules ask for in turn they ask of `follows`.
    """

    def __init__(self, strata: Mapping[str, tuple[str, ...]], given: Callable[[str, tuple[str, ...]], bool]) -> None:
        self._given, self._strata = given, strata
        self._asking: dict[tuple[str, ...], dict[Cell, bool]] = {}
        self._known: dict[Cell, bool] = {}

    def forget(self) -> None:
        """Take notice that something has changed that rules may ask for."""
        self._known.clear()

    def follows(self, cell: Cell) -> bool:
        """Return whether something that is defined holds: whether its rules give it, or what they ask for in turn.

        What is asked for while something else is being asked for is put down and counts as false, and all that was put down is
        tried again until nothing more becomes true. What is true by then stays so, and all else that was asked for is false.
        """
        if cell in self._known:
            return self._known[cell]
        stratum = self._strata[cell[0]]
        asked = self._asking.get(stratum)
        if asked is not None:
            return asked.setdefault(cell, False)
        asked = self._asking[stratum] = {cell: False}
        seen, grown = 0, False
        try:
            while not asked[cell] and (seen < len(asked) or grown):
                fresh = list(asked)[seen:]
                seen, grown = len(asked), bool(fresh) and grown
                for one in fresh or [one for one in reversed(asked) if not asked[one]]:
                    asked[one] = self._given(*one)
                    grown |= asked[one]
            self._known |= {one: holds for one, holds in asked.items() if holds or not asked[cell]}
            return asked[cell]
        finally:
            del self._asking[stratum]

"""A discovery: what a world has come across that the scene doesn't have."""

from __future__ import annotations

from dataclasses import dataclass

from confab.reasoner.symbols import Fact


@dataclass(frozen=True)
class Discovery:
    """An individual that a world has come across and the scene doesn't have: a thing, or a spot that is no place of the scene.

    Attributes
    ----------
    individual : str
    kinds : tuple of str
        Its classes; their superclasses follow.
    relations : tuple of (str, tuple of str)
        Static facts about it.
    fixed : str
        Why nothing can move it, if that is so.
    blocked : tuple of str
        Places at which nothing else has room as long as the fact `by` holds.
    by : Fact, optional
    text : str
        What it is, and where, in words.
    """

    individual: str
    kinds: tuple[str, ...]
    relations: tuple[tuple[str, tuple[str, ...]], ...] = ()
    fixed: str = ""
    blocked: tuple[str, ...] = ()
    by: Fact | None = None
    text: str = ""

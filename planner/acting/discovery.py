"""A discovery: an individual that the world has found and that the scene doesn't contain."""

from __future__ import annotations

from dataclasses import dataclass

from confab.reasoner.symbols import Fact


@dataclass(frozen=True)
class Discovery:
    """An individual that the world has found and that the scene doesn't contain: an object, or a free spot.

    Attributes
    ----------
    individual : str
    kinds : tuple of str
        The classes of the individual; their superclasses needn't be listed.
    relations : tuple of (str, tuple of str)
        Static facts about the individual.
    fixed : str
        The reason why the individual can't be moved; empty if the individual can be moved.
    blocked : tuple of str
        Places without room for another object while the fact `by` holds.
    by : Fact, optional
    text : str
        A description of the individual and its position.
    """

    individual: str
    kinds: tuple[str, ...]
    relations: tuple[tuple[str, tuple[str, ...]], ...] = ()
    fixed: str = ""
    blocked: tuple[str, ...] = ()
    by: Fact | None = None
    text: str = ""

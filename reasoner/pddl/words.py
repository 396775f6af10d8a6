"""The words and lists that a PDDL text consists of, each with its place."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Word:
    """A name or number in lower case, with its place."""

    text: str
    line: int
    column: int


@dataclass(frozen=True)
class Form:
    """A list in parentheses, with its place."""

    items: tuple[Word | Form, ...]
    line: int
    column: int

    @property
    def head(self) -> str:
        """The first word; empty if there is none."""
        return self.items[0].text if self.items and isinstance(self.items[0], Word) else ""

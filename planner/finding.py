"""Lookup of steps in a plan by number, path or words."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import NamedTuple, Protocol, TypeAlias

from confab.reasoner.names import nearest

Path: TypeAlias = "tuple[int, ...]"


class Placed(Protocol):
    """A step, or the place of a step: a path in the tree and a level."""

    @property
    def path(self) -> Path:
        """The position in the tree."""

    @property
    def level(self) -> int:
        """The level of the step."""


class StepPosition(NamedTuple):
    """The place of a step in a plan: its path, its level, its ID, and texts with its words; messages show the last text."""

    path: Path
    level: int
    id: int
    texts: tuple[str, ...]


class UnknownStepError(LookupError):
    """Raised if no step, or more than one step, has the given number, path or words."""


def numbers(places: Iterable[Placed]) -> dict[Path, str]:
    """Return a number such as ``L2#3`` for each path: the level and the position on the level, counted from 0."""
    seen: dict[int, int] = {}
    found = {}
    for place in places:
        seen[place.level] = seen.get(place.level, -1) + 1
        found[place.path] = f"L{place.level}#{seen[place.level]}"
    return found


def find(places: Sequence[StepPosition], asked: int | str | Sequence[int | str], hint: str = "") -> Path:
    """Return the path of the step that the argument `asked` names; `places` has steps before their sub-steps.

    `asked` is the number of a step of the first level, counted from 0, or from the end if it is negative; ``L3#12`` for step 12 of
    level 3, counted from 0; a path like ``0.1.2``; or words of the step, also as a tuple. The error message ends with `hint` if no
    step is similar.

    Raises
    ------
    UnknownStepError
        No step matches, or several steps match.
    """
    by_number = {number: path for path, number in numbers(places).items()}
    number_of = {path: number for number, path in by_number.items()}
    if isinstance(asked, str) and asked.strip().isdecimal():
        asked = int(asked)
    if isinstance(asked, int):
        first = [place.path for place in places if len(place.path) == 1]
        if not -len(first) <= asked < len(first):
            named = [number_of[place.path] for place in places if place.id == asked]
            more = f"; {asked} is the ID of {', '.join(named[:6])}" if named else ""
            raise UnknownStepError(f"no step {asked}: the first level has {len(first)}, counted from 0{more}")
        return first[asked]
    if not isinstance(asked, str) and any(isinstance(word, str) for word in asked):
        asked = " ".join(map(str, asked))  # the tuple is a behaviour with its arguments
    text = asked.strip() if isinstance(asked, str) else ".".join(map(str, asked))
    if re.fullmatch(r"[lL]\d+#\d+", text):
        if text.upper() not in by_number:
            level = int(text[1:].split("#")[0])
            has = sum(place.level == level for place in places)
            raise UnknownStepError(f"no step {text}: level {level} has {has}, counted from 0")
        return by_number[text.upper()]
    if re.fullmatch(r"(\d+(\.\d+)*)?", text):
        path = tuple(int(part) for part in text.split(".") if part)
        if path not in number_of:
            raise UnknownStepError(f"no step at '{text}' in the tree of the plan")
        return path
    words = " ".join(text.lower().split())
    names = {place.path: [name.lower() for name in place.texts] for place in places}
    for fits in (
        lambda name: words == name or f" {words}" == name[name.find(" ") :],
        lambda name: re.search(rf"(?<![^\W_]){re.escape(words)}", name) is not None,
    ):
        found = [place for place in places if any(fits(name) for name in names[place.path])]
        tops = [one for one in found if not any(one.path[: len(o.path)] == o.path for o in found if o is not one)]
        if len(tops) == 1:
            return tops[0].path
        if tops:
            shown = "; ".join(f"{number_of[place.path]} {place.texts[-1]}" for place in tops[:6])
            raise UnknownStepError(
                f"'{asked}' names {len(tops)} steps: {shown}; give one, e.g. {number_of[tops[0].path]}"
            )
    known = [name for place in places for name in place.texts]
    raise UnknownStepError(f"no step '{asked}' in the plan{nearest(text, known, hint)}")

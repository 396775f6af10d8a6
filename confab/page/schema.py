"""The form of the page's JSON object (docs/page.md)."""

from __future__ import annotations

from typing import TypedDict

FORMAT = 1
"""Version of the JSON object; a page shows the objects of its own version."""


class Interval(TypedDict, total=False):
    """A part of a row: from `begin` to `end`, a step or a value, and the meaning of its colour (`tone`).

    `step` is the ID of the step that it shows. `slack` is the time until which its end may be delayed without delaying the end
    of the plan.
    """

    begin: float
    end: float
    label: str
    tone: str  # action, planned, failed; of facts: start, between, wanted
    step: str
    note: str
    slack: float


class Row(TypedDict, total=False):
    """A lane. Its `group` is levels, actors, changes, wanted or fixed; `met` states whether its goal holds in the end."""

    group: str
    label: str
    bars: list[Interval]
    met: bool


class StepData(TypedDict, total=False):
    """A step of the plan; `id` is its path, joined by dots, so that the ID of its parent is a prefix."""

    id: str
    number: str
    what: str
    name: str
    ok: bool
    note: str
    begin: float
    end: float
    gives: list[str]
    needs: list[str]
    facts: list[tuple[str, str]]


class Thing(TypedDict):
    """An object on the map: the times at which it reaches a place (empty: no place), in words, with the tone of each place."""

    id: str
    label: str
    at: list[tuple[float, str, str, str]]


class AreaData(TypedDict):
    """A polygon of the map."""

    id: str
    label: str
    corners: list[tuple[float, float]]


class Spot(TypedDict):
    """A point of the map."""

    id: str
    label: str
    at: tuple[float, float]


class MapData(TypedDict):
    """The map: x to the right, y down."""

    areas: list[AreaData]
    ways: list[tuple[str, str]]
    places: list[Spot]
    robots: list[Spot]
    things: list[Thing]
    metric: bool
    note: str


class Alarm(TypedDict, total=False):
    """A failure: its text, its position, and the measured numbers."""

    title: str
    step: str
    lines: list[str]
    measured: list[tuple[str, str]]


class Film(TypedDict, total=False):
    """A film of the run.

    `speed` is the ratio of the page's time to the film's, `poster` the picture that is shown before the film is played.
    """

    source: str
    kind: str
    speed: float
    caption: str
    poster: str


class Tile(TypedDict):
    """A figure with its name."""

    name: str
    text: str


class GoalData(TypedDict, total=False):
    """A goal, its initial and its final value."""

    label: str
    before: str
    after: str
    met: bool


class Mark(TypedDict):
    """An intervention or a change of plan."""

    at: float
    text: str


class Learned(TypedDict):
    """The content of memory after the run."""

    text: str
    rules: list[tuple[str, list[str]]]


class TurnableRow(TypedDict):
    """A symbol whose value the user can change.

    Its key, its words, the name of its list of values, its current value and its goal value.
    """

    key: str
    label: str
    values: str
    now: str
    wanted: str | None


class Turnable(TypedDict):
    """All symbols whose values the user can change; `values` has each list of values by its name, and each value with its words."""

    rows: list[TurnableRow]
    values: dict[str, list[tuple[str, str]]]
    hidden: int


class ReadyQuery(TypedDict):
    """A query that ships with Confab, with the question that it answers."""

    name: str
    question: str
    text: str


class PageData(TypedDict, total=False):
    """The data of the page; `problem` is the reason why planning failed after a change on the page."""

    format: int
    title: str
    iri: str
    good: bool | None
    status: str
    headline: str
    tiles: list[Tile]
    alarm: Alarm
    film: Film
    map: MapData
    end: float
    unit: str
    now: float
    marks: list[Mark]
    rows: list[Row]
    hidden: int
    steps: list[StepData]
    goals: list[GoalData]
    learned: Learned
    notes: list[str]
    again: str
    live: bool
    version: int
    turnable: Turnable
    queries: list[ReadyQuery]
    problem: str

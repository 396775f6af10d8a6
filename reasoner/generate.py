"""Generation of test scenes as ordinary ontology files from Turtle templates.

A family is a Turtle file in ``ontology/families``. A line ``#* SECTION`` begins a block of text. The block is repeated for each
row of the section, with the row's values in place of the words ``_WORD_``. This module names no class, situation type or
behaviour of a domain: a template has objects of two kinds, `first` and `second`.

==============================  ========================================================================
section                         words
==============================  ========================================================================
(beginning), ``once``           SCENE, FAMILY, OBJECTS, HANDS, CLUTTER, SEED
``hand``, ``place``             HAND, PLACE
``reach``                       HAND and PLACE, for each place that a hand reaches
``first``, ``second``           ITEM (number within its kind), INDEX, START and GOAL (places), OTHER (a random item)
``some first``, ``some second`` the same words, for a random half of the objects
``clutter``                     ITEM, ROOM
==============================  ========================================================================

``#* like NAME`` inserts the blocks of ``parts/NAME.ttl`` before the family's own blocks. ``#* placement NAME`` selects one of
`PLACEMENTS`. The places form a grid of two rows: the places 1 … n are near the hands, and the places n + 1 … 2 n are far. Each
hand reaches a strip of columns. The strips of neighbouring hands overlap by two thirds. If there are two hands, each hand reaches
three quarters of the columns.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from random import Random
from urllib.parse import quote

from confab import ontology
from confab.reasoner.files import write_whole
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.kinds import GENERATED, stamped
from confab.reasoner.names import nearest

FOLDER = ontology.ROOT / "families"
WORD = re.compile(r"_([A-Z]+)_")
PER_ROOM = 100  # number of irrelevant objects in a room

Row = Mapping[str, object]


@dataclass(frozen=True)
class Layout:
    """The places of a table and the positions of objects on it.

    `reach` contains the places that each hand reaches. `starts` and `goals` contain a place for each object, first for
    the objects of the first kind.
    """

    places: Sequence[int]
    reach: Sequence[Sequence[int]]
    starts: Sequence[int]
    goals: Sequence[int]


def generate(family: str, objects: int = 4, hands: int = 2, clutter: int = 0, seed: int = 0) -> str:
    """Return a scene as Turtle text; equal arguments give equal texts.

    Parameters
    ----------
    family : str
        One of `families`.
    objects : int
        An even number of objects: half of the objects are of the first kind (bottles), half of the second kind (cups).
    hands : int
    clutter : int
        Number of irrelevant objects in other rooms, which no hand reaches.
    seed : int
        Seed of the random numbers.

    Raises
    ------
    KnowledgeError
        The family is unknown, or has no layout for the given numbers.

    Examples
    --------
    >>> text = generate("served", objects=4)
    >>> [line.split(" ; ") for line in text.splitlines() if line.startswith(":cup1 ")]  # doctest: +ELLIPSIS
    [[':cup1 a owl:NamedIndividual, k:Cup', ..., 'k:location :location2', 'k:beverage k:no_beverage .']]
    """
    return "".join(pieces(family, objects, hands, clutter, seed))


def write_scene(path: Path, family: str, objects: int = 4, hands: int = 2, clutter: int = 0, seed: int = 0) -> None:
    """Write a generated scene to a file atomically, in pieces; the scene is named after the file.

    The parameters are explained at `generate`.
    """
    write_whole(path, stamped(GENERATED, pieces(family, objects, hands, clutter, seed, path.stem)))


def families() -> tuple[str, ...]:
    """Return the names of the families, in alphabetical order.

    >>> families()
    ('blocked', 'full', 'handover', 'random', 'rotate', 'served', 'swap', 'unsolvable')
    """
    return tuple(sorted(path.stem for path in FOLDER.glob("*.ttl")))


def pieces(family: str, objects: int, hands: int, clutter: int, seed: int, name: str | None = None) -> Iterator[str]:
    """Yield the text of `generate` in pieces; `name` is the last part of the scene's IRI."""
    if family not in families():
        raise KnowledgeError(f"no family '{family}'{nearest(family, families())} (families: {', '.join(families())})")
    if objects < 2 or objects % 2 or hands < 1 or clutter < 0:
        raise KnowledgeError(
            f"wanted an even number of objects from 2 on, a hand at least and no negative clutter; "
            f"got {objects} objects, {hands} hands, {clutter} clutter"
        )
    random = Random(f"{family} {objects} {hands} {seed}")
    blocks = _blocks(FOLDER / f"{family}.ttl")
    (placement,) = (name.removeprefix("placement ") for name, _ in blocks if name.startswith("placement "))
    layout = PLACEMENTS[placement](objects, hands, random)
    scene = quote(name or f"{family}-{objects}-{hands}-{clutter}-{seed}", safe="")
    once = {"SCENE": scene, "FAMILY": family, "OBJECTS": objects, "HANDS": hands, "CLUTTER": clutter, "SEED": seed}
    for section, text in blocks:
        pattern = WORD.sub(r"%(\1)s", text.replace("%", "%%"))
        for row in _rows(section, once, layout, clutter, random):
            yield pattern % row


def _blocks(path: Path) -> list[tuple[str, str]]:
    """Return the sections of a template with their texts; the sections of the template that ``like`` names come first."""
    found: list[tuple[str, str]] = []
    section, lines = "once", list[str]()
    for line in [*path.read_text(encoding="utf-8").splitlines(keepends=True), "#* end"]:
        if not line.startswith("#* "):
            lines.append(line)
            continue
        if lines or section.startswith("placement "):
            found.append((section, "".join(lines)))
        section, lines = line.removeprefix("#* ").strip(), []
        if section.startswith("like "):
            found += _blocks(FOLDER / "parts" / f"{section.removeprefix('like ')}.ttl")
    return found


def _rows(section: str, once: Row, layout: Layout, clutter: int, random: Random) -> Iterable[Row]:
    """Return the rows of a section; a row has a value for every word of the section."""
    half = len(layout.starts) // 2
    if section == "hand":
        return ({"HAND": hand + 1} for hand in range(len(layout.reach)))
    if section == "place":
        return ({"PLACE": place} for place in layout.places)
    if section == "reach":
        return ({"HAND": hand + 1, "PLACE": place} for hand, places in enumerate(layout.reach) for place in places)
    if section == "clutter":
        return ({"ITEM": item + 1, "ROOM": item // PER_ROOM + 1} for item in range(clutter))
    if section.removeprefix("some ") in ("first", "second"):
        first = 0 if section.endswith("first") else half
        chosen = range(first, first + half)
        return (
            {
                "ITEM": i - first + 1,
                "INDEX": i + 1,
                "START": layout.starts[i],
                "GOAL": layout.goals[i],
                "OTHER": random.randint(1, half),
            }
            for i in (sorted(random.sample(chosen, (half + 1) // 2)) if section.startswith("some ") else chosen)
        )
    return [once]  # one row for the section `once` and for text below a directive


# ----------------------------------------------------------------------------------------------------------- placements


def strips(columns: int, hands: int, places: Sequence[int]) -> list[list[int]]:
    """Return the places that each hand reaches: strips of columns that overlap by two thirds.

    >>> strips(4, 2, range(1, 9))
    [[1, 2, 3, 5, 6, 7], [2, 3, 4, 6, 7, 8]]
    """
    found = []
    for hand in range(hands):
        first, last = hand * columns // (hands + 2), -(-(hand + 3) * columns // (hands + 2))
        found.append([place for place in places if first <= (place - 1) % columns < last])
    return found


def _side_by_side(objects: int, hands: int, random: Random) -> Layout:
    """Return a layout with all objects in the near row; each goal is a random far place."""
    places = range(1, 2 * objects + 1)
    goals = random.sample(places[objects:], objects)
    return Layout(places, strips(objects, hands, places), places[:objects][::-1], goals)


def _exchange(objects: int, hands: int, random: Random) -> Layout:
    """Return a layout in which random pairs of objects have to exchange their places."""
    layout = _side_by_side(objects, hands, random)
    order, goals = random.sample(range(objects), objects), list(layout.starts)
    for one, other in zip(order[::2], order[1::2], strict=True):
        goals[one], goals[other] = layout.starts[other], layout.starts[one]
    return Layout(layout.places, layout.reach, layout.starts, goals)


def _rotation(objects: int, hands: int, random: Random) -> Layout:
    """Return a layout in which the goal of each object is the place of the next object."""
    layout = _side_by_side(objects, hands, random)
    return Layout(layout.places, layout.reach, layout.starts, [*layout.starts[1:], layout.starts[0]])


def _crowded(objects: int, hands: int, random: Random) -> Layout:
    """Return a layout with one free place; each goal is a random place."""
    places = range(1, objects + 2)
    reach = strips(-(-len(places) // 2), hands, places)
    return Layout(places, reach, random.sample(places, objects), random.sample(places, objects))


def _opposite(objects: int, hands: int, random: Random) -> Layout:
    """Return a layout in which objects have to change sides.

    Objects at places that only the first hand reaches have goals that only the last hand reaches, and vice versa.

    If the sides have too few places, the remaining objects stay at places in the middle.
    """
    places = range(1, 2 * objects + 1)
    reach = strips(objects, hands, places)
    of_first = set(reach[0]).difference(*reach[1:]) if hands > 1 else set()
    if not of_first:
        raise KnowledgeError(
            f"{objects} objects and {hands} hands leave no place to one hand alone, so nothing can be handed over; "
            "take 2 hands or more, and as many objects as hands and 2 more"
        )
    sides = sorted(of_first), sorted(set(reach[-1]).difference(*reach[:-1]))
    between = [place for place in places if place not in {*sides[0], *sides[1]}]
    across = dict(zip(sides[0] + sides[1], sides[1] + sides[0], strict=True))
    starts = random.sample([*across], min(objects, len(across)))
    starts += random.sample(between, objects - len(starts))
    random.shuffle(starts)
    return Layout(places, reach, starts, [across.get(place, place) for place in starts])


def _occupied(objects: int, hands: int, random: Random) -> Layout:
    """Return a layout in which objects of the first kind occupy the goals of the second kind."""
    places, half = range(1, 2 * objects + 1), objects // 2
    starts = random.sample(places[objects:], half) + random.sample(places[:objects], half)
    return Layout(places, strips(objects, hands, places), starts, starts[:half] + random.sample(starts[:half], half))


def _anywhere(objects: int, hands: int, random: Random) -> Layout:
    """Return a layout with random places and goals, in which a hand reaches each place with probability 3/4."""
    places = range(1, 2 * objects + 1)
    reach = [[place for place in places if random.random() < 0.75] for _ in range(hands)]
    return Layout(places, reach, random.sample(places, objects), random.sample(places, objects))


def _unreachable(objects: int, hands: int, random: Random) -> Layout:
    """Return the layout of `_side_by_side`, changed so that no hand reaches the goal of one object of the second kind."""
    layout = _side_by_side(objects, hands, random)
    barred = random.choice(layout.goals[objects // 2 :])
    reach = [[place for place in places if place != barred] for places in layout.reach]
    return Layout(layout.places, reach, layout.starts, layout.goals)


PLACEMENTS: Mapping[str, Callable[[int, int, Random], Layout]] = {
    "side-by-side": _side_by_side,
    "exchange": _exchange,
    "rotation": _rotation,
    "crowded": _crowded,
    "opposite": _opposite,
    "occupied": _occupied,
    "anywhere": _anywhere,
    "unreachable": _unreachable,
}

"""The state that the fast planner changes in place: one value per symbol, a trail to undo it, and who has which value.

now    situation type → key → value. The key is the individual, or the tuple of individuals where a type has several arguments
who    situation type → value → the keys that have it, in the order in which they came to it; not kept for `FALSE`
trail  what was overwritten, oldest first; `undo` takes it back to a mark
age    how often anything was changed, undoing included: what was read off the table at this age still holds

Copying a state costs time in the size of the world; a change and its undoing cost a microsecond in any world.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from typing import TypeAlias

from reasoner.symbols import FALSE, Problem, State, Symbol

Key: TypeAlias = "str | tuple[str, ...]"
Cell: TypeAlias = "tuple[str, Key]"
"""A symbol as the table addresses it: situation type and key."""
Change: TypeAlias = "tuple[str, Key, str]"
"""A cell and its value."""


def key_of(arguments: tuple[str, ...]) -> Key:
    """Return the key of a symbol's arguments."""
    return arguments[0] if len(arguments) == 1 else arguments


def arguments_of(key: Key) -> tuple[str, ...]:
    """Return the arguments behind a key."""
    return (key,) if isinstance(key, str) else key


class Table:
    """A state in place.

    Parameters
    ----------
    situations : iterable of str
        Names of all situation types.
    state : State
    """

    def __init__(self, situations: Iterable[str], state: State) -> None:
        self.now: dict[str, dict[Key, str]] = {name: {} for name in situations}
        self.who: dict[str, dict[str, dict[Key, None]]] = {name: {} for name in self.now}
        self.trail: list[tuple[str, Key, str]] = []
        self.age = 0
        for symbol, value in state.items():
            key = key_of(symbol.arguments)
            self.now[symbol.situation][key] = value
            if value != FALSE:
                self.who[symbol.situation].setdefault(value, {})[key] = None

    def put(self, situation: str, key: Key, value: str) -> None:
        """Give a symbol a value, and remember the old one."""
        self.age += 1
        cells = self.now[situation]
        old = cells.get(key, FALSE)
        cells[key] = value
        who = self.who[situation]
        if old != FALSE:
            del who[old][key]
        if value != FALSE:
            keys = who.get(value)
            if keys is None:
                who[value] = {key: None}
            else:
                keys[key] = None
        self.trail.append((situation, key, old))

    def undo(self, mark: int) -> None:
        """Take back all changes since the trail had the length `mark`."""
        trail = self.trail
        while len(trail) > mark:
            situation, key, old = trail.pop()
            self.put(situation, key, old)
            trail.pop()

    def since(self, mark: int) -> dict[Cell, str]:
        """Return the net changes since a mark, with the present values."""
        before: dict[Cell, str] = {}
        for situation, key, old in self.trail[mark:]:
            before.setdefault((situation, key), old)
        now = self.now
        return {cell: now[cell[0]][cell[1]] for cell, old in before.items() if now[cell[0]][cell[1]] != old}

    def state(self) -> dict[Symbol, str]:
        """Return the state as a value for those outside of the search."""
        return {Symbol(s, arguments_of(key)): value for s, cells in self.now.items() for key, value in cells.items()}


class Alike:
    """Individuals that no static fact tells apart, so that one of them can stand for all.

    Two individuals are alike if they belong to the same classes, exist from the same level on, and exchanging them leaves
    every static relation as it is. Names that behaviours mention are alike to nobody.

    Parameters
    ----------
    problem : Problem
    named : iterable of str
        Individuals that behaviours mention.
    """

    def __init__(self, problem: Problem, named: Iterable[str]) -> None:
        marks: dict[str, list[object]] = {}
        for kind in sorted(problem.classes):
            for member in problem.classes[kind]:
                marks.setdefault(member, []).append(kind)
        for relation in sorted(problem.relations):
            tuples = problem.relations[relation]
            for row in sorted(tuples):
                for position, individual in enumerate(row):
                    if individual in marks:
                        marks[individual].append((relation, position, row[:position] + row[position + 1 :]))
        for individual, level in problem.value_levels.items():
            marks.setdefault(individual, []).append(level)
        for individual in named:
            marks.setdefault(individual, []).append(individual)
        numbers: dict[tuple[object, ...], int] = {}
        self.sort = {who: numbers.setdefault(tuple(what), len(numbers)) for who, what in marks.items()}
        self.members: dict[int, list[str]] = {}
        for individual, number in self.sort.items():
            self.members.setdefault(number, []).append(individual)
        self._groups: dict[tuple[str, ...], list[list[str]]] = {}

    def groups(self, members: tuple[str, ...]) -> list[list[str]]:
        """Return `members` grouped by likeness, in their order."""
        found = self._groups.get(members)
        if found is None:
            by_sort: dict[int, list[str]] = {}
            for member in members:
                by_sort.setdefault(self.sort.get(member, -1), []).append(member)
            found = self._groups[members] = list(by_sort.values())
        return found


def representatives(
    groups: Sequence[Sequence[str]],
    who: Mapping[str, Mapping[Key, None]],
    wanted: Mapping[str, object],
    breadth: int = 1,
    cursors: dict[int, int] | None = None,
) -> list[str]:
    """Return one value per group: the first that nobody has and no goal wants.

    Where there is none, a few that nobody has; where there are none of these either, the first `breadth`. With `cursors` (by
    the group's `id`) the first is looked for from where the last one was found, so that a long group isn't gone through anew.

    >>> representatives([["a", "b", "c"], ["d"]], {"a": {"x": None}}, {"b": True})
    ['c', 'd']
    """
    found = []
    for group in groups:
        start = cursors.get(id(group), 0) if cursors is not None else 0
        for position in chain(range(start, len(group)), range(start)):
            value = group[position]
            if not who.get(value) and value not in wanted:
                found.append(value)
                if cursors is not None:
                    cursors[id(group)] = position
                break
        else:
            found.extend([value for value in group if not who.get(value)][:4] or group[:breadth])
    return found

"""Individuals that no static fact tells apart, so that one of them can stand for all."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import chain

from planner.transitions import Key
from reasoner.symbols import Problem


class Alike:
    """The individuals of a problem by what static facts say of them.

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

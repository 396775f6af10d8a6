"""Symmetry classes: sets of individuals with the same static facts; one individual can represent its class."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import chain

from confab.planner.transitions import Key
from confab.reasoner.limits import checked
from confab.reasoner.problem import Problem

ENDS = 8
"""Number of individuals at each end of a large class; only the states of these individuals are examined."""


class SymmetryClasses:
    """The symmetry classes of a problem's individuals.

    Two individuals are symmetric if they belong to the same classes, exist on the same levels, and have the same tuples in every
    static relation. An individual that a behaviour names is symmetric to no other individual.

    Parameters
    ----------
    problem : Problem
    named : iterable of str
        Individuals that behaviours name.
    """

    def __init__(self, problem: Problem, named: Iterable[str]) -> None:
        marks: dict[str, list[object]] = {}
        for kind in sorted(problem.classes):
            for member in problem.classes[kind]:
                marks.setdefault(member, []).append(kind)
        for relation in sorted(problem.relations):
            tuples = problem.relations[relation]
            for row in checked(sorted(tuples), "compiling the behaviours"):
                for position, individual in enumerate(row):
                    if individual in marks:
                        marks[individual].append((relation, position, row[:position] + row[position + 1 :]))
        for individual, level in problem.value_levels.items():
            marks.setdefault(individual, []).append(level)
        for individual in named:
            marks.setdefault(individual, []).append(individual)
        numbers: dict[tuple[object, ...], int] = {}
        self.class_of = {
            individual: numbers.setdefault(tuple(what), len(numbers)) for individual, what in marks.items()
        }
        self.members: dict[int, list[str]] = {}
        for individual, number in self.class_of.items():
            self.members.setdefault(number, []).append(individual)
        self._groups: dict[tuple[str, ...], list[list[str]]] = {}
        self._named = frozenset(named)
        of = {s.name: s.arguments for s in problem.domain.situations.values()}
        self._whose = {name: problem.members(kinds[0]) for name, kinds in of.items() if len(kinds) == 1}
        """The individuals that can be the argument of each situation type with one argument."""

    def groups(self, members: tuple[str, ...]) -> list[list[str]]:
        """Return `members` grouped by symmetry class, in the given order."""
        found = self._groups.get(members)
        if found is None:
            by_class: dict[int, list[str]] = {}
            for member in members:
                by_class.setdefault(self.class_of.get(member, -1), []).append(member)
            found = self._groups[members] = list(by_class.values())
        return found

    def unlike(self, members: tuple[str, ...], known: Sequence[str], now: Mapping[str, Mapping[Key, str]]) -> list[str]:
        """Return the known members, and further members that differ in their state from all known members of their symmetry class.

        In a large class, only a few members at both ends are examined, because the planner assigns values from one end.
        """
        found = list(known)
        classes = {self.class_of.get(one) for one in known}
        for group in self.groups(members):
            number = self.class_of.get(group[0])
            if len(group) == 1:
                found += group if number not in classes else ()
                continue
            cells = [its for name, its in now.items() if group[0] in self._whose.get(name, ())]
            seen = {self._state(one, cells) for one in known if self.class_of.get(one) == number}
            if seen and not cells:
                continue
            for one in group if len(group) <= 2 * ENDS else (*group[:ENDS], *group[-ENDS:]):
                state = self._state(one, cells)
                if state not in seen:
                    seen.add(state)
                    found.append(one)
        return found

    def _state(self, one: str, cells: Sequence[Mapping[Key, str]]) -> tuple[str | None, ...]:
        """Return the values of an individual in the mappings `cells`, with None for values that no behaviour names."""
        values = [its.get(one) for its in cells]
        return tuple([value if value in self._named else None for value in values])


def representatives(
    groups: Sequence[Sequence[str]],
    holders: Mapping[str, Mapping[Key, None]],
    wanted: Mapping[str, object],
    cursors: dict[int, int] | None = None,
) -> list[str]:
    """Return one value for each group: the first value that no object has and no goal requires.

    For a group without such a value, return a few values that no object has, or otherwise the first value.
    `cursors` contains the position of the last result in each group, by the group's `id`. The next search in the group starts at
    this position.

    >>> representatives([["a", "b", "c"], ["d"]], {"a": {"x": None}}, {"b": True})
    ['c', 'd']
    """
    found = []
    for group in groups:
        start = cursors.get(id(group), 0) if cursors is not None else 0
        for position in chain(range(start, len(group)), range(start)):
            value = group[position]
            if not holders.get(value) and value not in wanted:
                found.append(value)
                if cursors is not None:
                    cursors[id(group)] = position
                break
        else:
            free = [value for value in group if not holders.get(value)][:4]
            found.extend(free or group[:1])
    return found

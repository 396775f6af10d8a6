"""Symmetry classes: individuals with the same static facts, of which one can represent all."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import chain

from confab.planner.transitions import Key
from confab.reasoner.symbols import Problem

ENDS = 8
"""Number of individuals at each end of a large class that are examined for a different state."""


class SymmetryClasses:
    """The symmetry classes of a problem's individuals.

    Two individuals are symmetric if they belong to the same classes, exist from the same level on, and exchanging them leaves
    every static relation unchanged. An individual that a behaviour names is symmetric to no other.

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
        """Maps each situation type with one argument to the individuals that can have it."""

    def groups(self, members: tuple[str, ...]) -> list[list[str]]:
        """Return `members` grouped by symmetry class, in their order."""
        found = self._groups.get(members)
        if found is None:
            by_class: dict[int, list[str]] = {}
            for member in members:
                by_class.setdefault(self.class_of.get(member, -1), []).append(member)
            found = self._groups[members] = list(by_class.values())
        return found

    def unlike(self, members: tuple[str, ...], known: Sequence[str], now: Mapping[str, Mapping[Key, str]]) -> list[str]:
        """Return the known members, and one more member for each other state that members of a symmetry class have.

        In a large class only the first and last few members are examined, since values are used up from one end.
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
        """Return the values of an individual, one for each mapping in `cells`; None for a value that no behaviour names."""
        values = [its.get(one) for its in cells]
        return tuple([value if value in self._named else None for value in values])


def representatives(
    groups: Sequence[Sequence[str]],
    holders: Mapping[str, Mapping[Key, None]],
    wanted: Mapping[str, object],
    cursors: dict[int, int] | None = None,
    burden: Callable[[str], int] = lambda value: 0,
) -> list[str]:
    """Return one value per group: the first value that no object has and no goal requires.

    If a group has no such value, a few values that no object has are returned; if there are none, the value of least `burden`.
    With `cursors` (by the group's `id`), a search starts where the previous search ended, so a long group isn't scanned again.



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
            found.extend(free or [min(group, key=burden)])
    return found

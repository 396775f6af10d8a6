"""Nogoods: targets for which the search of a scope failed, with the state of the scope.

Roles replace the individuals that the targets name. For example, a search that failed for one parcel also fails for every parcel
with the same static facts, if the rest of the scope has the same state. A nogood saves a search, but never proves that there is no
plan.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeAlias

from confab.planner.hierarchical.search_budget import SearchBudget
from confab.planner.hierarchical.workspace import Keep, Workspace
from confab.planner.transitions import Cell, arguments_of, key_of
from confab.reasoner.symbols import State

RoleTerm: TypeAlias = "str | int"
"""An individual, or the number of a role."""
Held: TypeAlias = "tuple[str, tuple[RoleTerm, ...], RoleTerm, RoleTerm | None]"
"""A situation type, its arguments, the value at the time of the failed search, and the required final value.

The required final value is None if any value is allowed.
"""


class Nogoods:
    """The nogoods of one program; all nogoods are valid for all initial states and goals."""

    def __init__(self, space: Workspace) -> None:
        self.space = space
        self.known: dict[object, list[list[Held]]] = {}

    def apply(self, level: int, targets: Mapping[Cell, str], keep: Keep, budget: SearchBudget) -> bool:
        """Return whether a search for symmetric targets with the same budget has failed in a scope with the same state."""
        roles = individuals(targets)
        known = self.known.get(self.key(level, targets, roles, budget))
        if not known:
            return False
        now, names = self.space.table.now, list(roles)

        def named(term: RoleTerm | None) -> str | None:
            return names[term] if isinstance(term, int) else term

        def holds(held: Held) -> bool:
            situation, arguments, value, kept = held
            key = key_of(tuple([names[a] if isinstance(a, int) else a for a in arguments]))
            found = now[situation].get(key)
            return found is not None and found == named(value) and keep((situation, key), found) == named(kept)

        return any(all(map(holds, nogood)) for nogood in known)

    def learn(self, level: int, targets: Mapping[Cell, str], keep: Keep, budget: SearchBudget, around: State) -> None:
        """Record that the search for targets with a budget failed in a scope with the state `around`."""
        roles = individuals(targets)

        def lifted(term: str) -> RoleTerm:
            return roles.get(term, term)

        held: list[Held] = []
        for symbol, value in around.items():
            kept = keep((symbol.situation, key_of(symbol.arguments)), value)
            arguments = tuple([lifted(a) for a in symbol.arguments])
            held.append((symbol.situation, arguments, lifted(value), None if kept is None else lifted(kept)))
        held.sort(key=lambda one: not any(isinstance(a, int) for a in one[1]))  # the most specific facts come first
        self.known.setdefault(self.key(level, targets, roles, budget), []).append(held)

    def key(self, level: int, targets: Mapping[Cell, str], roles: Mapping[str, int], budget: SearchBudget) -> object:
        """Return a key of targets that is equal for targets with symmetric individuals."""
        pattern = tuple(
            (situation, tuple([roles[a] for a in arguments_of(key)]), roles.get(value, value))
            for (situation, key), value in targets.items()
        )
        symmetry = self.space.program.symmetry.class_of
        return level, budget, pattern, tuple([symmetry.get(individual, individual) for individual in roles])


def individuals(targets: Mapping[Cell, str]) -> dict[str, int]:
    """Return the individuals named by targets, each with its role."""
    terms = dict.fromkeys(term for (_, key), value in targets.items() for term in (*arguments_of(key), value))
    return {term: number for number, term in enumerate(terms)}

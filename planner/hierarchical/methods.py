"""Methods: refinements in which roles replace individuals, so that the refinement for one hand is applicable to all hands.

The individuals of the refined step fill the first roles of a method. Some other roles are determined by a condition; the individual
is then the current value of a symbol, such as the place of a van. For each remaining role, the planner tries one individual of each
symmetry class. Every step of a method is checked (`confab.planner.hierarchical.refinement`). Therefore an inapplicable method costs
time, but never leads to a wrong plan.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import islice, product
from typing import TypeAlias

from confab.planner.hierarchical.workspace import Ground, Workspace
from confab.planner.transitions import key_of
from confab.reasoner.memory.experience import Method, OpenRole
from confab.reasoner.symbols import Behavior, ValueCondition

METHODS, CHOICES = 6, 24
"""Maximum number of methods per behaviour, and maximum number of assignments of individuals to the open roles of a method."""

Roles: TypeAlias = "tuple[str | None, ...]"
"""The individuals in the roles of a method; the individual is None for a role that the table determines."""
Ranked: TypeAlias = "Callable[[Method, list[Roles]], list[Roles]]"


def unranked(method: Method, ways: list[Roles]) -> list[Roles]:
    """Return the role assignments of a method in the given order."""
    return ways


class Methods:
    """The methods of each behaviour, and the individuals that fill their roles.

    Parameters
    ----------
    space : Workspace
    known : dict
        Methods of earlier calls with the same program, by behaviour; new methods are added.
    """

    def __init__(self, space: Workspace, known: dict[str, list[Method]]) -> None:
        self.space, self.known = space, known
        self.ranked: Ranked = unranked
        """Function that sorts the role assignments of a method, the best assignment first."""

    def of(self, behavior: str, individuals: tuple[str, ...]) -> Iterator[tuple[Method, Roles]]:
        """Yield the methods for a step with each role assignment, the shortest method first."""
        for method in tuple(self.known.get(behavior, ())):
            for roles in self.ways(method, individuals):
                yield method, roles

    def ways(self, method: Method, individuals: tuple[str, ...]) -> Iterable[Roles]:
        """Return the role assignments of a method for the individuals of a step.

        An assignment contains the individuals of the step, None for each determined role, and a candidate for each other role.
        """
        candidates = self.space.candidates
        choices: list[Sequence[str | None]] = []
        for role in method.open:
            if role.source is not None:
                choices.append((None,))
            elif role.becomes is not None:
                choices.append(candidates.values(role.becomes, "", role.kind))
            else:
                choices.append(candidates.one_of_each(role.kind))
        ways: list[Roles] = [individuals + chosen for chosen in islice(product(*choices), CHOICES)]
        return self.ranked(method, ways) if len(ways) > 1 else ways

    def filled(self, method: Method, roles: Roles) -> Iterator[Ground]:
        """Yield the steps of a method; the individuals of determined roles are read from the table before each step.

        Stop if the table has no value for a determined role.
        """
        filled = list(roles)
        first = len(roles) - len(method.open)
        for name, places in method.steps:
            for place in places:
                if filled[place] is None:
                    situation, arguments = method.open[place - first].source  # type: ignore[misc]
                    key = key_of(tuple(filled[i] or "" for i in arguments))
                    filled[place] = self.space.table.now[situation].get(key)
            individuals = tuple([found for place in places if (found := filled[place]) is not None])
            if len(individuals) < len(places):
                return
            yield name, individuals

    def prefer(self, method: Method) -> None:
        """Move a successful method to the front of its behaviour's methods, unless the first method is shorter."""
        known = self.known[method.behavior]
        if known[0] is not method and len(known[0].steps) >= len(method.steps):
            known.remove(method)
            known.insert(0, method)

    def learn(self, behavior: str, steps: Sequence[Ground], individuals: tuple[str, ...]) -> None:
        """Store the steps that refined a behaviour with the given individuals as a method."""
        known = self.known.setdefault(behavior, [])
        known.append(self.lifted(behavior, steps, individuals))
        known.sort(key=lambda method: len(method.steps))
        del known[METHODS:]

    def lifted(self, behavior: str, steps: Sequence[Ground], individuals: tuple[str, ...]) -> Method:
        """Return a method that consists of the steps that refined a behaviour.

        `individuals` become the first roles of the method. All other individuals become open roles.
        """
        behaviors = self.space.program.domain.behaviors
        places: dict[str, int] = {}
        for place, individual in enumerate(individuals):
            places.setdefault(individual, place)
        opened: list[OpenRole] = []
        lifted = []
        for name, arguments in steps:
            one = behaviors[name]
            terms = dict(zip((p.name for p in one.parameters), arguments, strict=True))
            for parameter in [p for p in one.parameters if terms[p.name] not in places]:
                if terms[parameter.name] not in places:
                    opened.append(open_role(one, parameter.name, parameter.kind, terms, places))
                    places[terms[parameter.name]] = len(individuals) + len(opened) - 1
            lifted.append((name, tuple(places[argument] for argument in arguments)))
        return Method(behavior, len(individuals), tuple(lifted), tuple(opened))


def open_role(
    behavior: Behavior, parameter: str, kind: str, terms: Mapping[str, str], places: Mapping[str, int]
) -> OpenRole:
    """Return an open role for a parameter, with the symbol whose value determines the individual, if there is such a symbol."""
    for condition in behavior.preconditions:
        if isinstance(condition, ValueCondition) and not condition.negated and condition.value == parameter:
            known = [places.get(terms.get(a, a)) for a in condition.arguments]
            if None not in known:
                return OpenRole(kind, (condition.situation, tuple(place for place in known if place is not None)), None)
    becomes = next((effect.situation for effect in behavior.effects if effect.value == parameter), None)
    return OpenRole(kind, None, becomes)

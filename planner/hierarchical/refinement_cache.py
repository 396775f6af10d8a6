"""Refinement by what was learned from refining before: a PICK refined once is refined for all hands and objects.

A refinement that search found is kept as a template: its steps, with the individuals that the parent names replaced by their
places in the parent (roles), all others left open. Replaying a template checks every step forward, and in the end that the
changes are exactly the parent's; so a template can be useless somewhere, but never wrong.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import TypeAlias

from planner.hierarchical.state import Cell, Change
from planner.hierarchical.subplans import Effort, Forbidden, Ground, Segments
from reasoner.symbols import FALSE

Done: TypeAlias = "tuple[int, str, tuple[str, ...], tuple[str, ...], tuple[Done, ...]]"
"""A step that was done: level, behaviour, arguments, individuals of its variables, and the steps that refine it."""

FIRST = Effort(depth=10, expansions=600)
AGAIN = Effort(depth=10, expansions=40)
"""For a behaviour of which no refinement is known yet, and for one of which those that are known fail here."""
TEMPLATES = 8
"""So many templates are kept per behaviour, the last successful first."""


@dataclass(frozen=True)
class Template:
    """Steps of a refinement over roles: positions below the number of the parent's individuals, then open ones.

    `open` gives for each open role the individual that it was and the class of the parameter that it filled.
    """

    steps: tuple[tuple[str, tuple[int, ...]], ...]
    open: tuple[tuple[str, str], ...]


class Refiner:
    """Does behaviours on a table, by way of their primitives.

    Parameters
    ----------
    segments : Segments
        Its table is the state.
    templates : dict
        What was learned from earlier calls over the same program; grows.
    """

    def __init__(self, segments: Segments, templates: dict[str, list[Template]]) -> None:
        self.segments = segments
        self.table = segments.table
        self.levels = segments.program.levels
        self.templates = templates
        self.hits = 0
        self.misses = 0
        self.failures = 0
        self.use_templates = True

    def do(self, level: int, name: str, arguments: tuple[str, ...]) -> Done | None:
        """Do a behaviour, refined to primitives, and return it so; None, and the table as it was, if that can't be done."""
        done = self.segments.forward[name](*arguments)
        if done is None:
            return None
        bindings, changes = done
        if level == self.levels[-1]:
            self.apply(changes)
            return level, name, arguments, bindings, ()
        children = self._refine(level, name, arguments + bindings, changes)
        return None if children is None else (level, name, arguments, bindings, children)

    def apply(self, changes: Sequence[Change]) -> None:
        """Make changes, as far as the symbols exist."""
        now, put = self.table.now, self.table.put
        for situation, key, value in changes:
            old = now[situation].get(key)
            if old != value and (old is not None or self.segments.exists(situation, key)):
                put(situation, key, value)

    def _refine(
        self, level: int, name: str, individuals: tuple[str, ...], changes: Sequence[Change]
    ) -> tuple[Done, ...] | None:
        now = self.table.now
        targets: dict[Cell, str] = {}
        for situation, key, value in changes:
            old = now[situation].get(key, FALSE if self.segments.exists(situation, key) else None)
            if old is not None:
                targets[situation, key] = value
        targets = {cell: value for cell, value in targets.items() if now[cell[0]].get(cell[1], FALSE) != value}
        below = self.levels[self.levels.index(level) + 1]
        known = self.templates.setdefault(name, [])
        for position, template in enumerate(known if self.use_templates else ()):
            for roles in self.roles(template, individuals):
                steps = self.replay(below, template, roles, targets)
                if steps is not None:
                    self.hits += 1
                    if position:
                        known.insert(0, known.pop(position))
                    return steps
        self.misses += 1
        found = self._search(below, individuals, targets, AGAIN if known else FIRST)
        if found is None:
            self.failures += 1
            return None
        known.insert(0, self.template([step[1:3] for step in found], individuals))
        del known[TEMPLATES:]
        return found

    def replay(
        self, level: int, template: Template, roles: Sequence[str], targets: dict[Cell, str]
    ) -> tuple[Done, ...] | None:
        """Do a template's steps; None, and the table as it was, if one can't be done or the changes aren't the targets."""
        mark = len(self.table.trail)
        steps = []
        for name, places in template.steps:
            step = self.do(level, name, tuple([roles[place] for place in places]))
            if step is None:
                self.table.undo(mark)
                return None
            steps.append(step)
        if self.table.since(mark) != targets:
            self.table.undo(mark)
            return None
        return tuple(steps)

    def _search(
        self, level: int, individuals: tuple[str, ...], targets: dict[Cell, str], effort: Effort
    ) -> tuple[Done, ...] | None:
        """Search a refinement; a step of it that can't itself be refined is forbidden there, and the search repeated."""
        segments, table = self.segments, self.table
        forbidden: set[Forbidden] = set()
        outer = dict(segments.focus)
        mark = len(table.trail)
        while True:
            segments.focus.clear()
            segments.focus.update(dict.fromkeys(individuals))
            found = segments.find(level, targets, None, effort, forbidden)
            if found is None and not forbidden:
                segments.focus.clear()
                found = segments.find(level, targets, None, effort, forbidden)
            segments.focus.clear()
            segments.focus.update(outer)
            if found is None:
                return None
            steps: list[Done] = []
            for name, arguments in found:
                step = self.do(level, name, arguments)
                if step is None:
                    forbidden.add(((name, arguments), frozenset(table.since(mark).items())))
                    break
                steps.append(step)
            if len(steps) == len(found):
                return tuple(steps)
            table.undo(mark)

    def template(self, steps: Sequence[Ground], individuals: tuple[str, ...]) -> Template:
        """Return steps with individuals replaced by their places among those given, and by open roles."""
        behaviors = self.segments.program.domain.behaviors
        places: dict[str, int] = {}
        for place, individual in enumerate(individuals):
            places.setdefault(individual, place)
        opened: dict[str, str] = {}
        lifted = []
        for name, arguments in steps:
            for argument, parameter in zip(arguments, behaviors[name].parameters, strict=True):
                if argument not in places:
                    places[argument] = len(individuals) + len(opened)
                    opened[argument] = parameter.kind
            lifted.append((name, tuple(places[argument] for argument in arguments)))
        return Template(tuple(lifted), tuple(opened.items()))

    def roles(self, template: Template, individuals: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
        """Yield ways to fill the roles of a template: the parent's individuals, and one of each sort for open roles."""
        if not template.open:
            yield individuals
            return
        choices = [self.segments.wants._some(kind) for _, kind in template.open]
        for chosen in product(*choices):
            yield individuals + chosen

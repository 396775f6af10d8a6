"""Behaviours done on the table by way of their primitives, and what refining taught: a PICK refined once is refined for all hands.

A refinement that search found is kept as a template: its steps, with the individuals that the parent names replaced by their
places in the parent (roles). A role that the parent doesn't name is read off the table where a condition determines it (the place
where the van is), else one individual of each symmetry class is tried. Replaying a template checks every step forward, and in the
end that the refinement leaves what it must (docs/levels.md); so a template can be useless somewhere, but never wrong.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice, product
from typing import NamedTuple, Protocol, TypeAlias

from confab.planner.hierarchical.chains import REFINING, Chain, Effort, Ground, Keep, Segments
from confab.planner.hierarchical.scope import Subproblem, Width, focus, problem_of
from confab.planner.transitions import Cell, Change, Changes, key_of
from confab.reasoner.amounts import meets
from confab.reasoner.memory.experience import OpenRole
from confab.reasoner.symbols import FALSE, Behavior, ValueCondition

MUCH = 1_500_000
"""What a search in a large scope may cost, in states times operators."""
NEAR, WIDER = Width(10, 0, 50_000), Width(20)
WIDE, WHOLE = Width(160, 4, MUCH), Width(None, work=MUCH)
"""The scopes that are searched one after the other; each costs about as much as all before."""
MOST_OPERATORS = 3_000
"""A level with at most so many quantified behaviours is looked at as a whole at once."""
LONG = 4
"""From so many steps on, and wherever something may be left as it comes to be, a template may do here what isn't needed here."""
TEMPLATES, CHOICES, ATTEMPTS = 6, 24, 40
"""Templates kept of a behaviour, ways to fill the open roles of one, and searches for steps that can all be refined."""


class RefinedStep(NamedTuple):
    """A step that was done: the individuals of its variables are `bindings`, `steps` refine it."""

    level: int
    behavior: str
    arguments: tuple[str, ...]
    bindings: tuple[str, ...]
    steps: tuple[RefinedStep, ...]


@dataclass(frozen=True)
class Template:
    """Steps of a refinement over roles: positions below the number of the parent's individuals, then open ones."""

    steps: tuple[tuple[str, tuple[int, ...]], ...]
    open: tuple[OpenRole, ...]


Roles: TypeAlias = "tuple[str | None, ...]"
"""Who fills the roles of a template; None for whom the table will tell."""


class Advice(Protocol):
    """What may know steps before they are searched, and whom to take for them."""

    def follow(self, level: int, targets: Mapping[Cell, str], keep: Keep) -> list[RefinedStep] | None:
        """Do steps that achieve the targets and keep the rest; None, and the table as it was, without any."""

    def ranked(self, behavior: str, template: Template, ways: list[Roles]) -> list[Roles]:
        """Return ways to fill the roles of a behaviour's template, who proved good first."""


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
        changed = frozenset[str]().union(*(b.changes for b in segments.program.domain.behaviors.values()))
        situations = segments.program.domain.situations.values()
        self.drifting = any(s.level > self.levels[0] and s.rest is None and s.name in changed for s in situations)
        self.besides: dict[Cell, str] = {}
        """What a step of the most abstract level shall bring about besides, of what this level doesn't see."""
        self.failed: dict[object, list[list[tuple[Cell, str]]]] = {}
        """Nogoods: of each step that couldn't be refined, what held in the scope in which that was found out."""
        self.found: dict[object, tuple[RefinedStep, ...]] = {}
        """What search found, by the state: steps after which another can't be refined are done again on the next way."""
        self.careful = False
        """Whether refinements leave as it was what the level above doesn't see, if they can."""
        self.advice: Advice | None = None
        self.at: Ground | None = None
        """The behaviour of the most abstract level that is being refined, or couldn't be."""

    def do(self, level: int, name: str, arguments: tuple[str, ...]) -> RefinedStep | None:
        """Do a behaviour, refined to primitives, and return it so; None, and the table as it was, if that can't be done."""
        done = self.segments.forward[name](*arguments)
        if done is None:
            return None
        bindings, changes = done
        if level == self.levels[-1]:
            self.segments.apply(changes)
            return RefinedStep(level, name, arguments, bindings, ())
        children = None
        for careful in (True, False) if self.careful else (False,):
            children = children or self._refine(level, name, arguments, bindings, changes, careful)
        return None if children is None else RefinedStep(level, name, arguments, bindings, children)

    def targets(self, changes: Sequence[Change]) -> dict[Cell, str]:
        """Return what changes make different from what is now."""
        now = self.table.now
        found: dict[Cell, str] = {}
        for situation, key, value in changes:
            if now[situation].get(key) is not None or self.segments.exists(situation, key):
                found[situation, key] = value
        return {cell: value for cell, value in found.items() if not meets(now[cell[0]].get(cell[1], FALSE), value)}

    def left_wrong(self, mark: int, targets: Mapping[Cell, str], keep: Keep) -> Cell | None:
        """Return a symbol touched since a mark, or a target, that isn't what it must be; None if all are."""
        now = self.table.now
        for cell, first in self.table.before(mark).items():
            wanted = targets.get(cell) or keep(cell, first)
            if wanted is not None and not meets(now[cell[0]][cell[1]], wanted):
                return cell
        return next(
            (cell for cell, value in targets.items() if not meets(now[cell[0]].get(cell[1], FALSE), value)), None
        )

    def again(self, step: RefinedStep) -> RefinedStep | None:
        """Do a step once more by the same sub-steps, and return it with its present bindings; None if it can't be done."""
        level, name, arguments, _, below = step
        done = self.segments.forward[name](*arguments)
        if done is None:
            return None
        if not below:
            self.segments.apply(done[1])
            return RefinedStep(level, name, arguments, done[0], ())
        mark = len(self.table.trail)
        targets = self.targets(done[1])
        inner = []
        for child in below:
            again = self.again(child)
            if again is None:
                self.table.undo(mark)
                return None
            inner.append(again)
        if self.left_wrong(mark, targets, self.segments.refining(level)) is not None:
            self.table.undo(mark)
            return None
        return RefinedStep(level, name, arguments, done[0], tuple(inner))

    def redo(self, step: RefinedStep) -> bool:
        """Do the primitives of a step that was done in this very state before; whether all could be done."""
        if step.steps:
            return all(self.redo(child) for child in step.steps)
        done = self.segments.forward[step.behavior](*step.arguments)
        if done is not None:
            self.segments.apply(done[1])
        return done is not None

    # -------------------------------------------------------------------------------------------------------- refining

    def _refine(
        self,
        level: int,
        name: str,
        arguments: tuple[str, ...],
        bindings: tuple[str, ...],
        changes: Sequence[Change],
        careful: bool,
    ) -> tuple[RefinedStep, ...] | None:
        targets, keep = self.targets(changes), self.segments.refining(level, careful)
        if level == self.levels[0]:
            targets |= self.besides
        below = self.levels[self.levels.index(level) + 1]
        individuals = arguments + bindings
        known = self.templates.setdefault(name, [])
        for position, template in enumerate(known):
            for roles in self.roles(template, individuals, name):
                steps = self.replay(below, template, roles, targets, keep)
                if steps is not None:
                    self.hits += 1
                    if position and len(known[0].steps) >= len(template.steps):
                        known.insert(0, known.pop(position))
                    return steps
        now = self.table.now
        widths = self.scopes(below)
        question = name, arguments, careful, tuple(self.besides)
        here = question, frozenset(self.table.since(0).items())
        if here in self.found:
            for step in self.found[here]:
                self.redo(step)
            self.hits += 1
            return self.found[here]
        for facts in self.failed.get(question, ()):
            if all(now[situation].get(key) == value for (situation, key), value in facts):
                return None
        self.misses += 1
        self.at = (name, arguments) if level == self.levels[0] else self.at
        found = self.advice.follow(below, targets, keep) if self.advice is not None else None
        if found is None:
            found = self.achieve(below, targets, keep, REFINING)
        if found is None:
            found = self.achieve(below, targets, keep, widths)
        if found is None:
            around = problem_of(self.segments, below, focus(self.segments, below, targets, widths[-1]))
            facts = [((s.situation, key_of(s.arguments)), value) for s, value in around.initial.items()]
            self.failed.setdefault(question, []).append(facts)
            return None
        self.at = None if level == self.levels[0] else self.at
        self.found[here] = tuple(found)
        known.append(self.template([(step.behavior, step.arguments) for step in found], individuals))
        known.sort(key=lambda template: len(template.steps))
        del known[TEMPLATES:]
        return self.found[here]

    def scopes(self, level: int) -> tuple[Width, ...]:
        """Return the scopes to search one after the other, the last of them large."""
        return (NEAR, WIDER, WHOLE if self.segments.program.size(level) <= MOST_OPERATORS else WIDE)

    def achieve(
        self,
        level: int,
        targets: Mapping[Cell, str],
        keep: Keep,
        effort: Effort | Sequence[Width],
    ) -> list[RefinedStep] | None:
        """Do steps of a level, refined, that achieve the targets and keep the rest; None, and the table as it was, without any.

        A step that can't be refined is forbidden where it stands, and the steps are searched again.
        """
        if isinstance(effort, Effort):
            return self._done(level, targets, keep, partial(Chain, self.segments, level, keep=keep, effort=effort))
        insides = [focus(self.segments, level, targets, width) for width in effort]
        for width, inside, following in zip(effort, insides, [*insides[1:], set()], strict=True):
            if inside != following:  # else the next search sees the same scope, and longer
                search = partial(Subproblem, self.segments, level, keep=keep, width=width)
                found = self._done(level, targets, keep, search)
                if found is not None:
                    return found
        return None

    def _done(
        self,
        level: int,
        targets: Mapping[Cell, str],
        keep: Keep,
        begun: Callable[[Mapping[Cell, str]], Chain | Subproblem],
    ) -> list[RefinedStep] | None:
        """Do the steps that a search finds, refined; what they touch and leave wrong becomes a target of the next search."""
        table, mark, targets = self.table, len(self.table.trail), dict(targets)
        search = begun(targets)
        for _ in range(ATTEMPTS):
            found = search.search()
            if found is None:
                return None
            steps: list[RefinedStep] = []
            for position, (name, arguments) in enumerate(found):
                step = self.do(level, name, arguments)
                if step is None:
                    search.forbid(position)
                    break
                steps.append(step)
            if len(steps) == len(found):
                wrong = self.left_wrong(mark, targets, keep)
                if wrong is None:
                    return steps
                first = next((old for s, key, old in table.trail[mark:] if (s, key) == wrong), None)
                wanted = keep(wrong, first) if first is not None else None
                if wrong in targets or wanted is None:
                    table.undo(mark)
                    return None
                targets[wrong] = wanted
                table.undo(mark)
                search = begun(targets)
            table.undo(mark)
        return None

    # ------------------------------------------------------------------------------------------------------- templates

    def replay(
        self, level: int, template: Template, roles: Roles, targets: Mapping[Cell, str], keep: Keep
    ) -> tuple[RefinedStep, ...] | None:
        """Do a template's steps; None, and the table as it was, if one can't be done or it leaves what it mustn't."""
        mark, steps = len(self.table.trail), list[RefinedStep]()
        for name, arguments in self.filled(template, roles):
            step = self.do(level, name, arguments)
            if step is None:
                break
            steps.append(step)
        if len(steps) < len(template.steps) or self.left_wrong(mark, targets, keep) is not None:
            self.table.undo(mark)
            return None
        if template.open and (self.drifting or len(steps) >= LONG):
            return self.lean(tuple(steps), mark, targets, keep)
        return tuple(steps)

    def filled(self, template: Template, roles: Roles) -> Iterator[Ground]:
        """Yield a template's steps, each as the table tells when those before are done; it ends where the table doesn't tell."""
        filled = list(roles)
        first = len(roles) - len(template.open)
        for name, places in template.steps:
            for place in places:
                if filled[place] is None:
                    situation, arguments = template.open[place - first].source  # type: ignore[misc]
                    key = key_of(tuple(filled[i] or "" for i in arguments))
                    filled[place] = self.table.now[situation].get(key)
            who = tuple([found for place in places if (found := filled[place]) is not None])
            if len(who) < len(places):
                return
            yield name, who

    def lean(
        self, steps: tuple[RefinedStep, ...], mark: int, targets: Mapping[Cell, str], keep: Keep
    ) -> tuple[RefinedStep, ...]:
        """Do steps, done since a mark, without those that nothing here needs: alone, or with the step that undoes them."""
        for dropped in self._droppable(steps, mark, keep):
            rest = [step for i, step in enumerate(steps) if i not in dropped]
            if self._redone(rest, mark) and self.left_wrong(mark, targets, keep) is None:
                return self.lean(tuple(rest), mark, targets, keep)
        self._redone(steps, mark)
        return steps

    def _redone(self, steps: Sequence[RefinedStep], mark: int) -> bool:
        """Do steps in place of what was done since a mark; whether all could be done."""
        self.table.undo(mark)
        return all(self.again(step) is not None for step in steps)

    def _droppable(self, steps: Sequence[RefinedStep], mark: int, keep: Keep) -> list[set[int]]:
        """Return single steps that change only what may be anything in the end, and pairs of which one undoes the other."""
        self.table.undo(mark)
        changes: list[Changes] = []
        for step in steps:
            begin = len(self.table.trail)
            self.again(step)
            changes.append(self.table.changes(begin))
        alone = [
            {i} for i, (old, _) in enumerate(changes) if all(keep(cell, value) is None for cell, value in old.items())
        ]
        return alone + [{i, j} for j, (old, new) in enumerate(changes) for i in range(j) if changes[i] == (new, old)]

    def template(self, steps: Sequence[Ground], individuals: tuple[str, ...]) -> Template:
        """Return steps with individuals replaced by their places among those given, and by open roles."""
        behaviors = self.segments.program.domain.behaviors
        places: dict[str, int] = {}
        for place, individual in enumerate(individuals):
            places.setdefault(individual, place)
        opened: list[OpenRole] = []
        lifted = []
        for name, arguments in steps:
            behavior = behaviors[name]
            terms = dict(zip((p.name for p in behavior.parameters), arguments, strict=True))
            new = [p for p in behavior.parameters if terms[p.name] not in places]
            for parameter in new:
                if terms[parameter.name] not in places:
                    opened.append(open_role(behavior, parameter.name, parameter.kind, terms, places))
                    places[terms[parameter.name]] = len(individuals) + len(opened) - 1
            lifted.append((name, tuple(places[argument] for argument in arguments)))
        return Template(tuple(lifted), tuple(opened))

    def roles(self, template: Template, individuals: tuple[str, ...], behavior: str | None = None) -> Iterable[Roles]:
        """Return ways to fill the roles of a template: the parent's individuals, None for what the table will tell, others.

        Of a behaviour's template as advice ranks them.
        """
        wants = self.segments.wants
        choices: list[Sequence[str | None]] = []
        for role in template.open:
            if role.source is not None:
                choices.append((None,))
            elif role.becomes is not None:
                choices.append(wants.candidates(role.becomes, "", role.kind))
            else:
                choices.append(wants.one_of_each(role.kind))
        ways: list[Roles] = [individuals + chosen for chosen in islice(product(*choices), CHOICES)]
        if self.advice is None or behavior is None or len(ways) < 2:
            return ways
        return self.advice.ranked(behavior, template, ways)


def open_role(
    behavior: Behavior, parameter: str, kind: str, terms: Mapping[str, str], places: Mapping[str, int]
) -> OpenRole:
    """Return how a parameter that no earlier role fills is found: by the condition that determines it, if there is one."""
    for condition in behavior.preconditions:
        if isinstance(condition, ValueCondition) and not condition.negated and condition.value == parameter:
            known = [places.get(terms.get(a, a)) for a in condition.arguments]
            if None not in known:
                return OpenRole(kind, (condition.situation, tuple(place for place in known if place is not None)), None)
    becomes = next((effect.situation for effect in behavior.effects if effect.value == parameter), None)
    return OpenRole(kind, None, becomes)

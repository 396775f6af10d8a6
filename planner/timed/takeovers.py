"""Takeovers: an actor takes over some primitives of another actor of the same plan, with the steps above them.

A *private* step changes only symbols about its actor, such as the actor's place. After a takeover, all other steps still have their
effects, and the private steps of both actors are chosen anew: as few as possible, before a step that isn't applicable without them,
or for goals and rest values. They are private steps of the plan, with any actor. A step that isn't applicable at its position comes
later in the step that contains it. The caller checks the resulting plan.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

from confab.planner.plan import Plan, Step, renumbered
from confab.planner.timed.pieces import actors_of_step, default_actors
from confab.planner.validation import BehaviorReader, Cell, LoggedState, NewValue
from confab.reasoner.amounts import meets
from confab.reasoner.problem import Problem

MOST_TRIED = 40
"""Maximum number of sequences of private steps that are tried before a step."""
MOST_WORK = 30
"""Maximum number of primitives that are tried for a takeover, in units of the number of the plan's primitives."""


@dataclass(frozen=True)
class Takeover:
    """Primitives of the actor `giver`, by their paths, that the actor `taker` takes over."""

    giver: str
    taker: str
    taken: frozenset[tuple[int, ...]]


class SharedSteps:
    """The steps of a plan, with the actors of its primitives, its private steps, and the values that primitives give to symbols.

    A private step with sub-steps has only private sub-steps, all of one actor. The values of amounts are left out.
    """

    def __init__(self, problem: Problem, steps: Sequence[Step], rules: BehaviorReader) -> None:
        self.problem, self.steps, self.rules = problem, steps, rules
        self.primitives = Plan(tuple(steps)).primitives
        resting, kinds = default_actors(problem), problem.domain.situations
        self.actors = {one.path: actors_of_step(problem, one, resting) for one in self.primitives}
        self.private, self.made = dict[tuple[int, ...], str](), dict[tuple[int, ...], list[NewValue]]()
        facts = LoggedState(problem, problem.initial, rules)
        for one in self.primitives:
            changes = rules.changes(problem.domain.behaviors[one.behavior], one.arguments, facts) or []
            self.made[one.path] = [change for change in changes if kinds[change[0]].quantity is None]
            for change in changes:
                facts.put(*change)
        for step in steps:
            self._owner(step)
        self.alike = cache(self._alike)

    def _owner(self, step: Step) -> str | None:
        """Return the actor of a private step, or None for other steps, and note all private steps."""
        if step.steps:
            owners = {self._owner(one) for one in step.steps}
            owner = owners.pop() if len(owners) == 1 else None
        else:
            behavior, owner = self.problem.domain.behaviors[step.behavior], None
            for actor in self.actors[step.path] if len(self.actors[step.path]) == 1 else ():
                terms = {p.name for p, a in zip(behavior.parameters, step.arguments, strict=True) if a == actor}
                owner = actor if all(terms & set(effect.arguments) for effect in behavior.every_effect) else None
        if owner is not None:
            self.private[step.path] = owner
        return owner

    def _alike(self, level: int, actor: str) -> list[Step]:
        """Return the private steps of a level, each once, as steps of one actor."""
        its = (one for step in self.steps for one in step.walk() if one.level == level and one.path in self.private)
        found = (self.renamed(one, self.private[one.path], actor) for one in its)
        return list({(one.behavior, one.arguments): one for one in found if actor in one.arguments}.values())

    def takeovers(self, one: Step, takers: Sequence[str]) -> Iterator[Takeover]:
        """Yield the takeovers in which an actor of a primitive gives this primitive, or primitives with the same individuals.

        These are the given primitive, or the primitives in the same first-level step or in the whole plan that name an individual
        of the given one, or all primitives in the same first-level step.
        """
        for giver in self.actors[one.path]:
            of = [s for s in self.primitives if giver in self.actors[s.path] and s.path not in self.private]
            near = [s for s in of if s.path[0] == one.path[0]]
            others = [argument for argument in one.arguments if argument != giver]
            parts = [[s for s in of if s is one], near]
            parts += [[s for s in some if other in s.arguments] for other in others for some in (near, of)]
            for part in parts:
                for taker in takers:
                    taken = frozenset(s.path for s in part if self.fits(s, giver, taker))
                    if taken:
                        yield Takeover(giver, taker, taken)

    def fits(self, step: Step, giver: str, taker: str) -> bool:
        """Return whether a step names an actor, and may name another one, which it doesn't name, in its place."""
        arguments = tuple(taker if a == giver else a for a in step.arguments)
        behavior = self.problem.domain.behaviors[step.behavior]
        return giver in step.arguments and taker not in step.arguments and self.rules.fits(behavior, arguments)

    def renamed(self, step: Step, giver: str, taker: str) -> Step:
        """Return a step that names another actor, as far as it and its sub-steps may do so."""
        inside, joined = (tuple(self.renamed(s, giver, taker) for s in some) for some in (step.steps, step.joined))
        if not self.fits(step, giver, taker):
            return replace(step, steps=inside, joined=joined)
        arguments = tuple(taker if a == giver else a for a in step.arguments)
        number = self.problem.id_of(step.behavior, arguments)
        return replace(step, id=number, arguments=arguments, steps=inside, joined=joined)

    def after(self, one: Takeover, ends: Sequence[int]) -> list[tuple[Step, ...]] | None:
        """Return the parts of the plan after a takeover, or None if some step isn't applicable.

        `ends` are the numbers of first-level steps at which the parts end.
        """
        course, found = _Course(self, one), list[tuple[Step, ...]]()
        for first, end in zip((0, *ends), ends, strict=False):
            done = course.run(self.steps[first:end])
            if done is not None and end == len(self.steps):
                done += course.after(self.steps[-1].level, (one.giver, one.taker), course.finished) or ()
            if done is None:
                return None
            found.append(renumbered(done))
        return found


class _Course:
    def __init__(self, shared: SharedSteps, change: Takeover) -> None:
        self.shared, self.change, self.pair = shared, change, {change.giver, change.taker}
        self.facts = LoggedState(shared.problem, shared.problem.initial, shared.rules)
        self.left = MOST_WORK * len(shared.primitives)

    def run(self, steps: Sequence[Step]) -> list[Step] | None:
        """Execute consecutive steps of one level and return them, or return None if some step isn't applicable."""
        done, waiting = list[Step](), list[Step]()
        for step in steps:
            if self.shared.private.get(step.path) not in self.pair:
                waiting.append(self.moved(step))
            i = 0
            while i < len(waiting):
                names = {argument for one in waiting[i].walk() for argument in one.arguments}
                its = self.after(step.level, self.pair & names, partial(self.executed, waiting[i]))
                if its is not None:
                    done += its
                    del waiting[i]
                i = i + 1 if its is None else 0
        return None if waiting else done

    def moved(self, step: Step) -> Step:
        """Return a step that names the taker if the taker takes over all primitives of the step that aren't private."""
        giver, private = self.change.giver, self.shared.private
        own = [s.path for s in step.walk() if not s.steps and giver in s.arguments and s.path not in private]
        return self.shared.renamed(step, giver, self.change.taker) if own and self.change.taken >= {*own} else step

    def after(self, level: int, actors: Iterable[str], then: Callable[[], Sequence[Step] | None]) -> list[Step] | None:
        """Execute as few private steps of actors as possible after which something is possible, and do it.

        Return the private steps and the result of `then`, or None if nothing was found.
        """
        mark, seen, paths = len(self.facts.log), set[frozenset[tuple[Cell, str]]](), [tuple[Step, ...]()]
        for path in paths:  # the loop appends paths to the list
            if all(map(self.applied, path)):
                state = frozenset((cell, self.facts.value(*cell) or "") for cell in self.facts.since(mark))
                last = None if state in seen else then()
                if last is not None:
                    return [*path, *last]
                if state not in seen and len(paths) < MOST_TRIED:
                    paths += [(*path, one) for actor in sorted(actors) for one in self.shared.alike(level, actor)]
                seen.add(state)
            self.facts.undo(mark)
        return None

    def executed(self, step: Step) -> list[Step] | None:
        """Execute a step and return it with its present sub-steps, or return None if it isn't applicable."""
        if not step.steps:
            return [step] if self.applied(step) else None
        inside = self.run(step.steps)
        if inside is None:
            return None
        inside += self.after(step.steps[0].level, self.pair, self.at_rest) or ()
        return [replace(step, steps=tuple(inside))] if inside else None

    def applied(self, step: Step) -> bool:
        """Execute the primitives of a step; return whether they are applicable and give symbols the same values as in the plan."""
        if step.steps:
            return all(map(self.applied, step.steps))
        self.left -= 1
        behavior = self.shared.problem.domain.behaviors[step.behavior]
        changes = self.shared.rules.changes(behavior, step.arguments, self.facts) if self.left > 0 else None
        if changes is None:
            return False
        for name, key, value in self.shared.made[step.path] if step.path not in self.shared.private else ():
            moved = value == self.change.giver and step.path in self.change.taken
            if self.pair.isdisjoint(key) and (name, key, self.change.taker if moved else value) not in changes:
                return False
        for change in changes:
            self.facts.put(*change)
        return True

    def at_rest(self) -> Sequence[Step] | None:
        """Return no steps if all changed symbols about both actors have their rest values, otherwise None."""
        kinds = self.shared.problem.domain.situations
        changed = [cell for cell in self.facts.since(0) if not self.pair.isdisjoint(cell[1])]
        return () if all(kinds[cell[0]].rest in (None, self.facts.value(*cell)) for cell in changed) else None

    def finished(self) -> Sequence[Step] | None:
        """Return no steps if both actors are at rest and the goals about them hold, otherwise None."""
        goal = self.shared.problem.goal.items()
        about = [(symbol, value) for symbol, value in goal if not self.pair.isdisjoint(symbol.arguments)]
        met = all(meets(self.facts.value(symbol.situation, symbol.arguments), value) for symbol, value in about)
        return self.at_rest() if met else None


def with_bindings(facts: LoggedState, steps: Sequence[Step]) -> tuple[Step, ...]:
    """Return steps with their bindings in the state before each of them, and execute them."""
    found = list[Step]()
    for step in steps:
        behavior = facts.problem.domain.behaviors[step.behavior]
        terms = {p.name: argument for p, argument in zip(behavior.parameters, step.arguments, strict=True)}
        bound = {f"?{name}": value for name, value in step.bindings.items()}
        if bound and facts.rules.satisfied(behavior.preconditions, terms | bound, behavior.kinds, facts) is None:
            now = facts.rules.satisfied(behavior.preconditions, terms, behavior.kinds, facts) or bound
            step = replace(step, bindings={name: now.get(f"?{name}", value) for name, value in step.bindings.items()})
        for change in (None if step.steps else facts.rules.changes(behavior, step.arguments, facts)) or ():
            facts.put(*change)
        found.append(replace(step, steps=with_bindings(facts, step.steps)))
    return tuple(found)

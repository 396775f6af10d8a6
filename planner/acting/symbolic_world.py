"""A world of symbols: behaviours have exactly their stated effects, except for interventions and injected faults."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Mapping, Set
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from heapq import heappop, heappush
from typing import TYPE_CHECKING

from confab.planner.acting.discovery import Discovery
from confab.planner.acting.episode import Intervention, InterventionKind
from confab.planner.acting.schedule import WorkerSlot
from confab.planner.acting.world import INTERRUPTED, WorldReport
from confab.planner.plan import Step
from confab.planner.timed.activities import InapplicableError, StepSimulation
from confab.planner.timed.pieces import SECOND
from confab.planner.validation import successor
from confab.reasoner.aggregates.totals import following
from confab.reasoner.effects import spread_to
from confab.reasoner.possible import PLACE, refuse_impossible
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import State, Symbol

if TYPE_CHECKING:
    from confab.planner.timed.dispatch import Dispatch

DONE = WorldReport(True)
FaultInjection = Callable[[Step, State], WorldReport | None]
"""Function that decides, for tests, whether and how a primitive fails in a situation."""


class SymbolicWorld:
    """A world that begins in a problem's initial state; a primitive takes its duration and then has its effects.

    Parameters
    ----------
    problem : Problem
    seconds_of : mapping of behaviour to seconds, optional
        Durations that replace the durations in the problem (docs/levels.md, "In time").
    fault : callable, optional
    stretch : callable
        Function that returns the actual duration of a primitive, given its expected duration in seconds.
    """

    measured = False
    """Whether the clock is measured: durations in this world are assumed, so that nothing is learned from them."""

    def __init__(
        self,
        problem: Problem,
        seconds_of: Mapping[str, float] | None = None,
        fault: FaultInjection | None = None,
        stretch: Callable[[Fraction], Fraction] = lambda expected: expected,
    ) -> None:
        self.problem = problem
        self.state: dict[Symbol, str] = dict(problem.initial)
        self.seconds = 0.0
        self._seconds_of = dict(seconds_of or {})
        self._fault = fault
        self._stretch = stretch
        self._waiting: list[Intervention] = []
        self._news: list[Discovery] = []
        self._happened = set[str]()  # behaviours that were executed with others, and external events

    def observe(self) -> State:
        """Return the whole state."""
        return dict(self.state)

    def announce(self, interventions: tuple[Intervention, ...]) -> None:
        """Record interventions with their times."""
        self._waiting = sorted((i for i in interventions if i.at is not None), key=lambda i: i.at or 0.0)

    def execute(self, step: Step) -> WorldReport:
        """Execute a primitive; an intervention stops the running primitive if the primitive's precondition no longer holds."""
        end = self.seconds + float(self._lasting(step))
        disturbed = False
        while self._waiting and (self._waiting[0].at or 0.0) < end:
            disturbed = self._disturbed_by_the_clock() or disturbed
        behavior = self.problem.domain.behaviors.get(step.behavior)
        after = None if behavior is None else successor(self.problem, behavior, step.arguments, self.state)
        if after is None:
            lost = "its precondition was lost in the meantime" if disturbed else "its precondition doesn't hold"
            return WorldReport(False, INTERRUPTED if disturbed else "not applicable", step.arguments, lost)
        self.seconds = end
        fault = self._fault(step, self.state) if self._fault is not None else None
        if fault is not None:
            return fault
        self.state = after
        return DONE

    def execute_together(
        self, dispatch: Dispatch, may_begin: Callable[[Set[int]], bool]
    ) -> list[tuple[WorkerSlot, WorldReport]]:
        """Execute the primitives of a dispatch; an intervention stops the primitives that read or change a changed fact.

        External events that aren't in the dispatch happen, too, as long as primitives remain. Their slots have the positions after
        the primitives of the dispatch.
        """
        start, now = Fraction(self.seconds), Fraction(0)
        steps = list(map(dispatch.step, dispatch.waiting))
        coming = self._other_events({*self._happened, *(step.behavior for step in steps)})
        course = StepSimulation(
            replace(self.problem, initial=self.state), [*steps, *(self._event(name) for _, name in coming)]
        )
        dates = [(at - start, number) for number, (at, _) in enumerate(coming, len(steps))]
        running, ended = list[tuple[Fraction, int, Fraction]](), dict[int, tuple[WorkerSlot, WorldReport]]()

        def report(number: int, begin: Fraction, verdict: WorldReport) -> None:
            worker = "".join(dispatch.order.activities[number].actors[:1]) if number < len(steps) else ""
            slot = WorkerSlot(course.steps[number], number, worker, float(start + begin), float(start + now))
            ended[number] = slot, verdict

        def interrupt(stopped: Container[int]) -> None:
            for _, number, begin in [one for one in running if one[1] in stopped]:
                report(number, begin, _interrupted(course.steps[number]))
            running[:] = sorted(one for one in running if one[1] not in stopped)

        def going_on() -> bool:
            own = {number for number in ended if number < len(steps)}
            return all(ended[number][1].ok for number in own) and may_begin(own)

        while True:
            while dates and dates[0][0] <= now and (running or dispatch.waiting):
                number = dates.pop(0)[1]
                self._happened.add(course.steps[number].behavior)
                with suppress(InapplicableError):  # an inapplicable event has no effect
                    course.begin(number)
                    heappush(running, (now + course.seconds[number], number, now))
                    interrupt(course.lost(other for _, other, _ in running if other != number))
            while going_on() and (ready := dispatch.ready(now)):
                number = ready[0]
                try:
                    course.begin(number)
                except InapplicableError as error:
                    report(number, now, _inapplicable(course.steps[number], str(error)))
                    break
                dispatch.begin(number, now)
                self._happened.add(course.steps[number].behavior)
                given = self._seconds_of.get(course.steps[number].behavior, course.seconds[number])
                heappush(running, (now + self._stretch(Fraction(given)), number, now))
                interrupt(course.lost(other for _, other, _ in running if other != number))
            wakes = dispatch.wakes(now) if going_on() else None
            times = [end for end, *_ in running[:1]] + ([] if wakes is None else [wakes])
            if not times:
                break
            times += [at for at, _ in dates[:1]]
            if self._waiting and Fraction(self._waiting[0].at or 0.0) - start < min(times):
                self.state = course.facts.state()
                self._disturbed_by_the_clock()
                now = max(now, Fraction(self.seconds) - start)
                interrupt(course.change(self.state))
                continue
            now = dispatch.misses(now, min(times)) or min(times)
            self.seconds = float(start + now)
            while running and running[0][0] == now:
                _, number, begin = heappop(running)
                report(number, begin, self._ended(course, number))
                if number < len(steps):
                    dispatch.end(number, now)
                interrupt(course.lost(other for _, other, _ in running))
        self.state = course.facts.state()
        return sorted(ended.values(), key=lambda one: (one[0].begin, one[0].position))

    def _other_events(self, known: Container[str]) -> list[tuple[Fraction, str]]:
        """Return the times and names of the external events from now on, except for the known ones."""
        events = self.problem.times.events if self.problem.times is not None else {}
        return sorted((at, name) for name, at in events.items() if at >= self.seconds and name not in known)

    def _event(self, name: str) -> Step:
        """Return an external event as a step."""
        return Step((), self.problem.id_of(name, ()), self.problem.domain.behaviors[name].level, name, ())

    def _ended(self, course: StepSimulation, number: int) -> WorldReport:
        """Make the effects of the end of a primitive, unless a fault prevents them."""
        step = course.steps[number]
        fault = self._fault(step, course.facts.state()) if self._fault is not None else None
        if fault is not None:
            return fault
        try:
            course.end(number)
        except InapplicableError as error:
            return _inapplicable(step, str(error))
        return DONE

    def _lasting(self, step: Step) -> Fraction:
        """Return the duration of a primitive that begins now; an inapplicable primitive takes a second."""
        behavior, timed = self.problem.domain.behaviors.get(step.behavior), self.problem.times is not None
        if behavior is None or not (timed or behavior.timing):
            return self._stretch(Fraction(self._seconds_of.get(step.behavior, SECOND)))
        course = StepSimulation(replace(self.problem, initial=self.state), [step])
        with suppress(InapplicableError):
            course.begin(0)
        return self._stretch(Fraction(self._seconds_of.get(step.behavior, course.seconds.get(0, SECOND))))

    def _disturbed_by_the_clock(self) -> bool:
        """Make the next announced intervention take place; return whether the intervention changes the world."""
        happening = self._waiting.pop(0)
        self.seconds = max(self.seconds, happening.at or 0.0)
        if happening.of_world:
            self.disturb(happening)
        return happening.of_world

    def stop(self) -> None:
        """Do nothing, because a primitive of a symbolic world takes no computing time."""

    def disturb(self, intervention: Intervention) -> None:
        """Apply an intervention.

        Raises
        ------
        ImpossibleStateError
            The resulting state is impossible.
        """
        if intervention.change in (InterventionKind.ADD, InterventionKind.BOX):
            self.problem = with_individual(self.problem, intervention.individual, intervention.kind)
        if intervention.change is InterventionKind.BOX:
            text = f"{intervention.individual}, which isn't in the scene, is there"
            self._news.append(Discovery(intervention.individual, (intervention.kind,), text=text))
        if intervention.change is InterventionKind.PUSH:
            self._add_spot(intervention.individual)
            return
        after = disturbed(self.problem, self.state, intervention)
        if intervention.change is InterventionKind.REMOVE:
            self.problem = without_individual(self.problem, intervention.individual)
        after = following(self.problem, after)
        refuse_impossible(self.problem, self.state, after, f"'{intervention.text}' can't happen")
        self.state = after

    def discoveries(self) -> tuple[Discovery, ...]:
        """Return the objects and spots that have appeared since the last call."""
        news, self._news = tuple(self._news), []
        return news

    def free_spots(self) -> tuple[Discovery, ...]:
        """Return no spots: a symbolic world has no room besides the places of the scene."""
        return ()

    def why_unplaced(self, individual: str) -> str:
        """Return the text that an object lies on the floor, if the object still exists."""
        return "lies" if any(individual in symbol.arguments[:1] for symbol in self.state) else ""

    def _add_spot(self, individual: str) -> None:
        """Put a displaced object on a new spot beside its place; the spot gets the static facts of the place."""
        symbols = place_symbols(self.problem, individual)
        there = next((self.state[s] for s in symbols if self.state.get(s) in self.problem.individuals), None)
        symbol = next((s for s in symbols if s in self.state), None)
        if there is None or symbol is None:
            return
        name = f"spot{1 + sum(one.startswith('spot') for one in self.problem.individuals)}"
        relations = tuple(
            (relation, tuple(name if one == there else one for one in row))
            for relation, rows in sorted(self.problem.relations.items())
            for row in sorted(rows)
            if there in row
        )
        values = self.problem.classes[self.problem.domain.situations[symbol.situation].range]
        special = {
            s for one in self.problem.domain.situations.values() if one.perceived for _, s in one.perceived.special
        }
        kinds = shared_kinds(self.problem, [value for value in values if value not in special])
        found = Discovery(name, kinds, relations, text=f"{individual} stands beside {there}: {name}")
        problem = met(self.problem, found)
        after = following(problem, {**self.state, symbol: name})
        refuse_impossible(problem, self.state, after, f"{individual} can't be pushed")
        self.problem, self.state = problem, after
        self._news.append(found)


def _interrupted(step: Step) -> WorldReport:
    return WorldReport(False, INTERRUPTED, step.arguments, "a fact on which it depends has changed")


def _inapplicable(step: Step, why: str) -> WorldReport:
    return WorldReport(False, "not applicable", step.arguments, why)


def disturbed(problem: Problem, state: State, intervention: Intervention) -> dict[Symbol, str]:
    """Return the state after an intervention.

    An object that is moved, knocked over or removed is released. A hand that held the object comes to rest; a hand that only
    touched the object stays in place. An object that lies on the floor has no place.
    """
    after = dict(state)
    if intervention.change is InterventionKind.KNOCK:
        for symbol in place_symbols(problem, intervention.individual):
            after.pop(symbol, None)
        _let_go(problem, state, after, intervention.individual)
    if intervention.change is InterventionKind.REMOVE:
        for symbol in state:
            if intervention.individual in symbol.arguments:
                del after[symbol]
        _let_go(problem, state, after, intervention.individual)
    for fact in intervention.facts:
        if (
            fact.symbol.arguments
            and state.get(fact.symbol) != fact.value
            and _is_whereabouts(problem, fact.symbol.situation)
        ):
            _let_go(problem, state, after, fact.symbol.arguments[0])
        after[fact.symbol] = fact.value
    return after


def _let_go(problem: Problem, state: State, after: dict[Symbol, str], individual: str) -> None:
    """Replace each value that is a released individual by the individual's former place, or by the symbol's rest value."""
    own = [value for symbol, value in state.items() if individual in symbol.arguments[:1]]
    for symbol, value in state.items():
        if value == individual and symbol in after:
            situation = problem.domain.situations[symbol.situation]
            possible = problem.classes.get(situation.range, ())
            instead = next((v for v in own if v in possible), situation.rest)
            if instead is None:
                del after[symbol]
            else:
                after[symbol] = instead


def _is_whereabouts(problem: Problem, situation: str) -> bool:
    """Return whether a situation type shares values with another situation type, so that a move changes symbols of both."""
    own = set(problem.classes.get(problem.domain.situations[situation].range, ()))
    return any(
        own & set(problem.classes.get(other.range, ()))
        for other in problem.domain.situations.values()
        if other.name != situation and not other.boolean
    )


def with_individual(problem: Problem, individual: str, kind: str) -> Problem:
    """Return the problem with an individual that comes last in each of its classes, and to which effects on the classes apply."""
    kinds = problem.superclasses(kind)
    classes = {
        name: (*members, individual) if name in kinds and individual not in members else members
        for name, members in problem.classes.items()
    }
    behaviors = problem.domain.behaviors
    spread = {name: spread_to(behavior, individual, kinds) for name, behavior in behaviors.items()}
    domain = replace(problem.domain, behaviors=spread) if spread != behaviors else problem.domain
    return replace(problem, classes=classes, domain=domain)


def without_individual(problem: Problem, individual: str) -> Problem:
    """Return the problem without an individual, which is in none of its classes; relations and goals keep their names."""
    classes = {name: tuple(one for one in members if one != individual) for name, members in problem.classes.items()}
    return replace(problem, classes=classes)


def met(problem: Problem, found: Discovery) -> Problem:
    """Return the problem with a discovered individual and the static facts about it."""
    for kind in found.kinds:
        problem = with_individual(problem, found.individual, kind)
    relations = dict(problem.relations)
    for name, row in found.relations:
        relations[name] = relations.get(name, frozenset()) | {row}
    return replace(problem, relations=relations)


def shared_kinds(problem: Problem, individuals: Iterable[str]) -> tuple[str, ...]:
    """Return the common classes of some individuals; superclasses of other common classes are left out."""
    names = {*individuals}
    common = [kind for kind, members in problem.classes.items() if names and names <= {*members}]
    above = {parent for kind in common for parent in problem.parents.get(kind, ())}
    return tuple(kind for kind in common if kind not in above)


def place_symbols(problem: Problem, individual: str) -> list[Symbol]:
    """Return the symbols that give the place of an object."""
    situations = problem.domain.situations.values()
    return [Symbol(s.name, (individual,)) for s in situations if s.perceived is not None and s.perceived.by == PLACE]

"""The executive: it plans, executes primitives, observes, handles interventions, and repairs the plan.

`belief` is the situation as last observed, with the current goal and the doubts that failures have raised. `agenda` contains
the steps still to be done; the first step may be partly done. `expected` is the situation that the next observation should
show. `aside` contains goals that are impossible in the present situation; they are pursued again after an unexpected
observation or a change of the goals. `put_off` contains goals that are unreachable while facts are in doubt; they are tried again
when all other goals are done. Beside the goals, the episode pursues the rest values of the symbols that executed steps have changed
(`Belief.restless`), except those that can't be restored in the present situation (`Belief.unrestorable`).

Rule 1: a primitive is begun only if its precondition holds in the last observation. Rule 2: the world is observed after
every primitive; an unexpected observation triggers a check of the remaining plan. Rule 3: an unreachable goal is
dropped or postponed; the other goals are still pursued. Rule 4: every loop terminates, because primitives and failures
are counted and planning has limits.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence, Set
from contextlib import suppress
from dataclasses import dataclass, field, replace
from fractions import Fraction
from time import perf_counter

from confab.planner.acting.agenda import Postponed, RemainingSteps, chains_of, tree_of, without
from confab.planner.acting.belief import UNSEEN, Belief
from confab.planner.acting.dispatching import Concurrency, Remaining, in_order, remaining
from confab.planner.acting.episode import (
    End,
    Episode,
    Event,
    ExecutedPrimitive,
    Failure,
    Intervention,
    InterventionKind,
    Replan,
    Surprise,
    changed,
    holds_from,
)
from confab.planner.acting.failure_memory import Caution, refuted_by, relied_on_by
from confab.planner.acting.record import Record
from confab.planner.acting.repair import RepairResult, chosen, difference, repair_or_replan, replan, vanished
from confab.planner.acting.retries import DEFAULT, Retries, RetryPolicy
from confab.planner.acting.unreached import blamed, blocked, unrestored, with_discoveries
from confab.planner.acting.world import INTERRUPTED, WITHOUT_EFFECT, Guarded, Verdict, World, WorldError, WorldReport
from confab.planner.hierarchical.planner import plan as hierarchical_plan
from confab.planner.plan import Limits, Outcome, Plan, Planner, Reason, SoftGoal, Status, Step, renumbered
from confab.planner.plan import changed as facts_changed
from confab.planner.plan_costs import cost_of
from confab.planner.timed.activities import InapplicableError, StepSimulation
from confab.planner.timed.pieces import actors_of_step, default_actors
from confab.planner.validation import followed, open_goals, unmet_goals
from confab.reasoner.derivation import said_by
from confab.reasoner.limits import LimitError, check, current
from confab.reasoner.problem import Problem
from confab.reasoner.refutations import Refutation
from confab.reasoner.symbols import FALSE, Fact, State, Symbol, Times


def act(
    problem: Problem,
    world: World,
    plan: Plan | None = None,
    interventions: Sequence[Intervention] = (),
    planner: Planner | None = None,
    retry_policy: RetryPolicy = DEFAULT,
    observer: Callable[[Event], None] | None = None,
    caution: Caution | None = None,
    together: Concurrency | None = None,
) -> Episode:
    """Execute a task in a world until all goals are achieved, the task is proved impossible, or a limit is reached.

    Parameters
    ----------
    problem : Problem
        The initial situation, and the goals. Soft goals are chosen with each plan, from those that the first plan meets.
    world : World
        A simulation, a robot or a `confab.planner.acting.symbolic_world.SymbolicWorld`: any object with `observe` and `execute`.
    plan : Plan, optional
        The first plan; if left out, `act` plans.
    interventions : sequence of Intervention
        The interventions by people during the episode.
    planner : callable, optional
        Function that makes a new plan from a situation in which all hands are at rest; if left out, the default planner.
    retry_policy : RetryPolicy
    observer : callable, optional
        Function that is called with every `Event`.
    caution : Caution, optional
        Failures in earlier episodes; unreliable facts and behaviours are avoided if there is an alternative.
    together : Concurrency, optional
        Several actors execute primitives at once, until a primitive fails; the world must be `Concurrent`.
    """
    if caution is not None and plan is None:
        problem = caution.applied(problem, planner or hierarchical_plan, retry_policy.planning)
    goal = problem.goal
    soft = {s: SoftGoal(Fact(s, goal[s]), weight, False) for s, weight in problem.weights.items() if s in goal}
    unmet = frozenset[Symbol]() if plan is None or not soft else unmet_goals(problem, plan)
    run = _RunningEpisode(
        Belief(replace(problem, weights={})),
        Guarded(world),
        list(interventions),
        planner,
        Retries(retry_policy),
        observer,
        together,
        soft,
        unmet & soft.keys(),
    )
    try:
        run.look(run.belief.state)
        run.start(plan)
        while run.going:
            check("acting")
            run.intervene()
            if run.requested:
                run.reconsider()
            elif not run.agenda.steps:
                run.finish()
            elif run.together and (left := run.remaining()) is not None:
                run.perform_together(left)
            elif run.requested:
                continue
            elif (expected := run.expected()) is None:
                run.request_replan("the next primitive's precondition doesn't hold")
            else:
                chain, before, verdict = run.perform(expected)
                if not verdict.ok:
                    run.learn_from(chain, before, verdict)
            if len(run.record.events) >= run.retries.most:
                run.give_up(Reason(f"stopped at the limit of {run.retries.most} primitives"))
    except (WorldError, LimitError) as error:
        run.world.stop()
        run.break_off(str(error))
    except BaseException:  # also for Ctrl-C, so that no motion continues without the executive
        run.world.stop()
        raise
    return run.episode()


@dataclass
class _RunningEpisode:
    """An episode in progress. `act` is the main loop; each other method is one action of the loop."""

    belief: Belief
    world: Guarded
    waiting: list[Intervention]
    planner: Planner | None
    retries: Retries
    observer: Callable[[Event], None] | None
    together: Concurrency | None
    soft: dict[Symbol, SoftGoal]  # the soft goals of the task
    left: frozenset[Symbol]  # the soft goals that the given plan leaves unmet
    began: float = 0.0  # the world's clock at the beginning
    going: bool = True
    goals: Postponed = field(default_factory=Postponed)
    requested: str = ""  # the reason for checking the agenda, if a check is requested
    late: dict[Symbol, Fraction] = field(default_factory=dict)  # goals that can't be in time, and when this was known
    missed: dict[Symbol, str | None] = field(default_factory=dict)  # values that were expected and not observed

    def __post_init__(self) -> None:
        self.record, self.agenda = Record(self.belief.state), RemainingSteps(self.belief.problem)

    # --------------------------------------------------------------------------------------------------- beginning, end

    def start(self, plan: Plan | None) -> None:
        """Make a plan, unless the caller has given one.

        Nothing waits for the first plan: only the current deadline limits its time, as in a planning call without execution.
        """
        record = self.record
        record.initial = self.belief.state
        record.course.clear()  # the facts seen so far are the initial situation
        self.began = self.world.seconds
        self.world.announce(tuple(i for i in self.waiting if i.at is not None and i.at > self.began))
        self.want_soft_goals()
        begun, outcome, limits = plan, None, replace(self.retries.policy.planning, seconds=None)
        if begun is None:
            self.requested = ""
            self.set_aside_the_vanished()
            begin = perf_counter()

            def search() -> RepairResult:
                steps, outcome = replan(self.belief.problem, self.planner, self.belief.using, limits.until(end))
                return RepairResult("replan", steps, 0.0, outcome)

            end = limits.end()
            found = self.choose(search)
            outcome = found.outcome
            record.seconds["planning"] += perf_counter() - begin
            begun = Plan(renumbered(found.steps or ()))
        self.agenda.steps, record.planned, self.agenda.planned_for = begun.steps, begun, self.belief.problem
        self.retries.most = self.retries.policy.primitives * max(len(begun.primitives), 20)
        if outcome is not None and outcome.plan is None:
            self.on_no_plan(outcome, self.retries.policy.planning)
        self.say("plan", text="; ".join(reason.text for _, reason in self.goals.aside.values()))

    def finish(self) -> None:
        """Handle an empty agenda: check the agenda again, resume a postponed goal, or end the episode."""
        record = self.record
        if missing := open_goals(self.belief.pursued):
            self.request_replan(f"{missing[0]} doesn't hold yet")
            return
        unsure = bool(self.goals.put_off or (self.belief.doubted and self.belief.restless))
        doubtful = self.belief.doubted and not self.eligible.keys() <= self.belief.goal.keys()
        if (unsure or doubtful) and self.try_anew("all other goals are handled"):
            return
        if unsure:
            record.status = End.GAVE_UP
        for reason in (*self.unreached(), *self.missed_times()):
            record.reason(reason)
        self.going = False
        if record.reasons and record.status is End.REACHED:
            record.status = End.IMPOSSIBLE
        self.say("over", text=record.status.value)

    def unreached(self) -> Iterator[Reason]:
        """Yield the reasons for dropped and postponed goals, and for symbols that can't be brought to rest."""
        yield from self.goals.reasons()
        left = self.belief.restless
        yield from (reason for symbol, reason in self.belief.unrestorable.items() if symbol in left)

    def missed_times(self) -> Iterator[Reason]:
        """Yield a reason for each hard goal that was reached after its deadline, and for each step outside of its times."""
        problem = self.belief.problem
        times = problem.times or Times()
        for goal, by in times.deadlines.items():
            if goal in problem.goal.keys() - self.soft.keys() and (
                reached := holds_from(problem, goal, self.record.initial, self.record.course)
            ) > float(by):
                known = f"; this was known at {float(self.late[goal]):g} s" if goal in self.late else ""
                yield Reason(
                    f"{said_by(problem, goal)} is a goal by {float(by):g} s, and holds from {reached:g} s on{known}"
                )
        resting = default_actors(problem)
        for event in self.record.events:
            took = f"{event.step} took from {event.begin:g} to {event.end:g} s"
            for one in dict.fromkeys((*event.step.arguments, *actors_of_step(problem, event.step, resting))):
                windows = times.windows.get(one, ((Fraction(0), None),))
                if not any(
                    float(low) <= event.begin and (high is None or event.end <= float(high)) for low, high in windows
                ):
                    yield Reason(f"{took}, and {one} isn't available then")
            at = times.events.get(event.step.behavior)
            if at is not None and event.begin != float(at):
                yield Reason(f"{took}, and happens at {float(at):g} s")

    def break_off(self, why: str) -> None:
        """End the episode at once, because the world doesn't respond."""
        self.going, self.record.status = False, End.GAVE_UP
        self.record.reason(Reason(why))
        self.say("over", text=f"{End.GAVE_UP.value}: {why}")

    def episode(self) -> Episode:
        """Return the episode."""
        clock = 0.0
        with suppress(WorldError):
            clock = self.world.seconds
        soft = tuple(self.soft_goals())
        return self.record.episode(self.belief.problem, clock, tuple(self.waiting), self.world.measured, soft)

    def soft_goals(self) -> Iterator[SoftGoal]:
        """Yield the soft goals, the heaviest first, with what holds in the end; a goal that is reached late is unmet."""
        task, deadlines = self.belief.problem, self.belief.times.deadlines
        wanted = replace(task, goal={symbol: one.fact.value for symbol, one in self.soft.items()})
        unmet = {fact.symbol for fact in open_goals(wanted)}
        for symbol, one in sorted(self.soft.items(), key=lambda each: (-each[1].weight, each[0])):
            by = deadlines.get(symbol)
            late = by is not None and holds_from(wanted, symbol, self.record.initial, self.record.course) > float(by)
            yield one._replace(met=symbol not in unmet and not late)

    def whole(self) -> Plan:
        """Return the tree of the executed and the remaining steps."""
        return Plan(tree_of({**self.record.done, **{step.path: step for step in Plan(self.agenda.steps).walk()}}))

    def path_of(self, name: str) -> tuple[int, ...] | None:
        """Return the path of the step with a name such as ``L3#2`` in the whole tree, or None if there is no such step."""
        with suppress(LookupError):
            return self.whole()[name].path
        return None

    def say(self, what: str, step: Step | None = None, expected: Iterable[Fact] = (), text: str = "") -> None:
        """Notify the observer of an event, if the episode has an observer."""
        if self.observer is None:
            return
        done, events = self.record.done, self.record.events
        surprises = events[-1].surprises if events and what == "end" else ()
        clock = 0.0
        with suppress(WorldError):
            clock = self.world.seconds
        self.observer(
            Event(
                what, self.whole(), frozenset(done), step, tuple(expected), surprises, text, clock, self.belief.problem
            )
        )

    # --------------------------------------------------------------------------------------------------- acting

    def expected(self) -> dict[Symbol, str] | None:
        """Return the situation expected after the next primitive, or None if the primitive's precondition doesn't hold."""
        step, problem = next(chains_of(self.agenda.steps))[-1], self.belief.task
        after = followed(problem, [step], problem.initial)
        return None if after is None else _perceived(after)

    def perform(self, expected: dict[Symbol, str]) -> tuple[tuple[Step, ...], State, Verdict]:
        """Execute the next primitive and observe; a failed primitive counts as done if its effects are observed.

        Return the primitive with its ancestors, the situation before it, and the verdict.
        """
        chain, record = next(chains_of(self.agenda.steps)), self.record
        step, before = chain[-1], self.belief.problem.initial
        changes = facts_changed(before, expected)
        start = self.begin(chain, before)
        self.say("begin", step, changes)
        begin = self.world.seconds
        verdict = self.world.execute(step)
        self.note_what_happened_by_the_clock()
        seen = self.world.observe()
        if verdict.ok and self.without_effect(changes, seen):
            text = f"{step} was reported as done, but {changes[0]} is not seen"
            verdict = WorldReport(False, WITHOUT_EFFECT, step.arguments, text)
        done = is_done(verdict, changes, seen)
        surprises = self.look(expected if done else dict(before), seen)
        now = self.belief.problem.initial
        made = [fact.symbol for fact in changes if now.get(fact.symbol) != before.get(fact.symbol)]
        self.belief.note_changes(step.path[0], start, {symbol: now.get(symbol, FALSE) for symbol in made})
        relied_on = tuple(relied_on_by(self.belief.problem, chain))
        record.events.append(
            ExecutedPrimitive(step, begin, self.world.seconds, verdict.ok, verdict.code, surprises, relied_on)
        )
        if done:
            record.done.update((above.path, above) for above in chain)
            self.agenda.steps = without(self.agenda.steps, {step.path})
        if surprises:
            self.request_replan("", surprises)
        self.say("end", step, changes)
        return chain, before, verdict

    def begin(self, chain: tuple[Step, ...], before: State) -> State:
        """Record that the ancestors of a primitive have begun; return the situation before the first of the steps."""
        for above in chain[:-1]:
            self.agenda.begun.setdefault(above.path, before)
        return self.agenda.begun.get(chain[0].path, before)

    def remaining(self) -> Remaining | None:
        """Return the dispatch of the remaining primitives; without a schedule, one primitive at a time is executed from now on."""
        assert self.together is not None
        now, steps = Fraction(self.world.seconds), self.agenda.steps
        happened = {event.step.behavior for event in self.record.events}
        limits, begin = self.retries.policy.planning, perf_counter()
        end = begin if any(step.path in self.agenda.begun for step in steps) else limits.end()
        left = None if end is None else end - begin
        found = remaining(self.belief.task, steps, now, self.together, self.free(), happened, left)
        if isinstance(found, Reason):
            self.together = None
            if self.by_the_clock:  # one primitive after another would ignore windows and events
                self.give_up(found)
            return None
        if min(step.path[0] for step in found.steps) > max(step.path[0] for step in steps):
            why, cost = "the steps had no schedule", cost_of(self.belief.task, Plan(found.steps))
            self.change_plan("replan", why, steps, found.steps, cost, perf_counter() - begin)
        self.agenda.steps = found.steps
        for goal in found.given_up:
            self.tell_late(goal, now)
        return found

    @property
    def by_the_clock(self) -> bool:
        """Whether the task has time windows or external events."""
        times = self.belief.problem.times or Times()
        return bool(times.windows or times.events)

    def tell_late(self, goal: Symbol, now: Fraction) -> None:
        """Say once that the deadline of a goal can't be kept any more."""
        if goal not in self.late:
            self.late[goal] = now
            self.say("late", text=f"the deadline of {said_by(self.belief.problem, goal)} can't be kept any more")

    def perform_together(self, left: Remaining) -> None:
        """Execute the remaining primitives with all actors at once, until all have ended or something unexpected happens.

        The world is observed afterwards. After a failure, the episode continues with one primitive at a time.
        """
        record, start, dispatch, paths = self.record, Fraction(self.world.seconds), left.dispatch, left.paths

        def may_begin(done: Set[int]) -> bool:
            if current().left == 0:
                return False
            now = Fraction(self.world.seconds) - start
            for late in dispatch.late(now) if dispatch.begun else ():  # other worlds have an order of their own
                if late.certain:
                    self.tell_late(late.goal, start + now)
            return not self.due({paths[number] for number in done})

        interventions = len(record.interventions)
        ended = self.world.execute_together(dispatch, may_begin)
        self.note_what_happened_by_the_clock()
        seen, every = self.world.observe(), {chain[-1].path: chain for chain in chains_of(self.agenda.steps)}
        paths = (*paths, *self.unplanned([slot.step for slot, _ in ended if slot.position >= len(paths)], every))
        chains = [every[paths[slot.position]] for slot, _ in ended]
        course = StepSimulation(self.belief.task, [chain[-1] for chain in chains])
        starts = dict[int, State]()
        finished, failed = set[tuple[int, ...]](), list[tuple[tuple[Step, ...], State, Verdict]]()
        for number, is_end in in_order([slot for slot, _ in ended]):
            chain, step, (slot, verdict) = chains[number], chains[number][-1], ended[number]
            with suppress(InapplicableError):  # the observation shows what has happened instead
                if not is_end:
                    before: State = _perceived(course.facts.state())
                    starts[number] = self.begin(chain, before)
                    relied_on = tuple(relied_on_by(self.belief.problem, chain))
                    record.events.append(
                        ExecutedPrimitive(step, slot.begin, slot.end, verdict.ok, verdict.code, (), relied_on)
                    )
                    failed += [] if verdict.ok else [(chain, before, verdict)]
                    course.begin(number)
                    self.belief.note_changes(step.path[0], starts[number], course.changes(number, "begin"))
                    record.course += changed(course.changes(number, "begin"), slot.begin)
                    continue
                changes = [Fact(*one) for one in course.changes(number, "begin", "middle").items()]
                self.say("end", step, changes)
                if is_done(verdict, changes, seen):
                    record.done.update((above.path, above) for above in chain)
                    finished.add(step.path)
                    course.end(number)
                    ending = course.changes(number, "middle", "end")
                    self.belief.note_changes(step.path[0], starts[number], ending)
                    record.course += changed(ending, slot.end)
        record.course.sort(key=lambda change: change.seconds)
        self.agenda.steps = without(self.agenda.steps, finished)
        state = _perceived(course.facts.state())
        self.belief.problem = replace(self.belief.problem, initial=state)
        surprises = self.look(dict(state), seen)
        if not ended and len(record.interventions) == interventions and not self.due():
            self.give_up(
                Reason("no remaining step can begin: a window is over, or the order of two ends isn't certain")
            )
        elif surprises or self.agenda.steps:
            self.request_replan("" if surprises else "the actors were interrupted", surprises)
        for chain, before, verdict in failed:
            self.together = self.together if verdict.code == INTERRUPTED or self.by_the_clock else None
            self.learn_from(chain, before, verdict)

    def unplanned(
        self, events: Iterable[Step], every: dict[tuple[int, ...], tuple[Step, ...]]
    ) -> Iterator[tuple[int, ...]]:
        """Yield the paths of external events that have happened and weren't in the dispatch, and add the events to `every`."""
        free = self.free()
        for number, event in enumerate(events, free):
            every[number,] = (replace(event, path=(number,)),)
            yield (number,)

    def free(self) -> int:
        """Return the number of the first step that can be added at the top of the tree of executed and remaining steps."""
        return 1 + max(path[0] for path in (*self.record.done, *(step.path for step in self.agenda.steps)))

    def without_effect(self, changes: Sequence[Fact], seen: State) -> bool:
        """Return whether some of the expected changes are perceptible, but none of them was perceived."""
        found = [
            seen.get(fact.symbol, FALSE) == fact.value
            for fact in changes
            if fact.symbol in seen or self.belief.boolean(fact.symbol)
        ]
        return bool(found) and not any(found)

    def look(self, expected: dict[Symbol, str], seen: State | None = None) -> tuple[Surprise, ...]:
        """Update the belief with an observation (`seen`, or a new one), and return the differences from the expected situation."""
        seen = self.world.observe() if seen is None else seen
        self.meet()
        for symbol, value in seen.items():
            if why := self.belief.fault(symbol, value):
                raise WorldError(f"the world's observe() says {symbol} = {value}; {why}")
        before = self.belief.state
        surprises = self.belief.take_in(expected, seen)
        self.record.changes(before, self.belief.problem.initial, self.world.seconds)
        return surprises

    def meet(self) -> None:
        """Add the individuals that the world has discovered to the belief."""
        for found in self.world.discoveries():
            self.belief.meet(found)
            self.record.discovered.append((found, self.world.seconds))
            self.request_replan(found.text or f"there is {found.individual}")
            self.say("discovery", text=found.text)

    # ------------------------------------------------------------------------------------------------------- interventions

    def intervene(self) -> None:
        """Execute the interventions that are due after the last primitive, or before the first."""
        due = [i for i in self.due() if i.at is None or not i.of_world or i.at <= self.began]
        for intervention in due:
            self.waiting.remove(intervention)
            now = self.world.seconds
            if intervention.of_world:
                self.world.disturb(intervention)
            self.note(intervention, now)
        if any(i.of_world for i in due):
            surprises = self.look(self.belief.state)
            self.request_replan("", surprises)

    def due(self, finished: Container[tuple[int, ...]] = ()) -> list[Intervention]:
        """Return the interventions that are due when, beside the recorded primitives, those at some paths have finished."""
        if not self.waiting:
            return []
        steps = self.agenda.steps if self.together else self.agenda.steps[:1]
        left = {step.path for step in Plan(without(steps, finished)).walk()}
        gone = {step.path: step for step in (*self.record.done.values(), *Plan(steps).walk())}
        gone = {path: step for path, step in gone.items() if path not in left}
        ids = {one.id for step in gone.values() if len(step.path) == 1 for one in step.together}
        named = {i.after for i in self.waiting if isinstance(i.after, str) and self.path_of(i.after) in gone}
        due = [i for i in self.waiting if i.after in {*ids, *gone, *named}]
        return due + [i for i in self.waiting if i.at is not None and i.at <= self.world.seconds]

    def note_what_happened_by_the_clock(self) -> None:
        """Record announced interventions whose time has passed."""
        for intervention in [i for i in self.waiting if i.at is not None and i.of_world]:
            if (intervention.at or 0.0) <= self.world.seconds:
                self.waiting.remove(intervention)
                self.note(intervention, intervention.at or 0.0)

    def note(self, intervention: Intervention, seconds: float) -> None:
        """Record an intervention; if the intervention changes the goal, change the goal of the belief."""
        self.record.interventions.append((intervention, seconds))
        goal = self.belief.goal
        if intervention.change is InterventionKind.GOAL:
            self.belief.drop_deadlines({f.symbol for f in intervention.facts if goal.get(f.symbol) != f.value})
            goal.update((fact.symbol, fact.value) for fact in intervention.facts)
            self.forget(fact.symbol for fact in intervention.facts)
        elif intervention.change is InterventionKind.DROP_GOAL and intervention.symbol is not None:
            goal.pop(intervention.symbol, None)
            self.forget([intervention.symbol])
        elif intervention.change is InterventionKind.ADD:
            self.belief.add(intervention.individual, intervention.kind)
        elif intervention.change is InterventionKind.REMOVE:
            self.belief.remove(intervention.individual)
        if goal != self.belief.problem.goal:
            self.belief.want(goal)
            self.want_again(self.goals.aside)
            self.request_replan("the goals have changed")
        self.say("intervention", text=intervention.text)

    def forget(self, symbols: Iterable[Symbol]) -> None:
        """Forget the soft, the dropped and the postponed goals of symbols whose goals an intervention drops or replaces."""
        for symbol in (gone := list(symbols)):
            self.soft.pop(symbol, None)
        self.goals.forget(gone)

    def request_replan(self, why: str, surprises: Sequence[Surprise] = ()) -> None:
        """Request that the agenda is checked again, for a reason or because of surprises."""
        why = why or "; ".join(map(_told, surprises[:3]))
        if why not in self.requested:
            self.requested = f"{self.requested}; {why}" if self.requested else why
        for surprise in surprises:
            self.missed.setdefault(surprise.symbol, surprise.expected)
        changes = {s.symbol: s.observed for s in surprises}
        for step in next(chains_of(self.agenda.steps), ())[:-1]:
            if step.path in self.agenda.begun:
                as_if = {s: v for s, v in {**self.agenda.begun[step.path], **changes}.items() if v is not None}
                self.agenda.sound = self.agenda.sound and self.belief.could_begin(step, as_if)

    # --------------------------------------------------------------------------------------------------- repairing

    def reconsider(self) -> None:
        """Repair the plan, or replan; choose among the soft goals, and drop unreachable goals."""
        why, self.requested, belief, record = self.requested, "", self.belief, self.record
        if self.missed:
            self.want_again(self.goals.aside)
        self.want_soft_goals()
        self.set_aside_the_vanished()
        counted = len(record.events), len(record.interventions), len(record.failures), len(record.discovered)
        doubts = len(belief.withdrawn), len(belief.refuted), len(belief.unrestorable), self.retries.rounds
        standing = (*counted, *doubts, record.status, *belief.problem.goal)
        self.retries.pondered[standing] += 1
        if self.retries.pondered[standing] > self.retries.policy.rounds:
            text = f"planned {self.retries.policy.rounds} times in the same situation, and no step could be done: {why}"
            self.give_up(Reason(text))
            return
        begin = perf_counter()
        limits, old = self.retries.policy.planning, self.agenda.steps
        end = limits.end()
        expected = {s: v for s, v in {**belief.state, **self.missed}.items() if v is not None}
        known = self.agenda.planned_for
        planned = replace(known, initial=expected, goal={**belief.rests, **known.goal})
        begun = bool(old) and old[0].path in self.agenda.begun

        def search() -> RepairResult:
            left, sound = limits.until(end), self.agenda.sound
            return repair_or_replan(belief.pursued, old, planned, self.planner, belief.using, sound, left, begun)

        found = self.choose(search)
        steps = found.steps
        seconds = perf_counter() - begin
        record.seconds["repairing"] += seconds
        self.agenda.planned_for, self.agenda.sound, self.missed = belief.problem, True, {}
        if steps is None:
            self.on_no_plan(found.outcome, limits.until(end))
            return
        self.agenda.steps = self.agenda.numbered(steps, record.done)
        self.change_plan(found.kind, why, old, self.agenda.steps, found.cost, seconds)

    def change_plan(
        self, kind: str, why: str, old: tuple[Step, ...], steps: tuple[Step, ...], cost: float, seconds: float
    ) -> None:
        """Record that other steps replace steps of the plan, unless their primitives are the same."""
        dropped, added = difference(old, steps)
        if dropped or added:
            last = self.record.events[-1].step.path if self.record.events else ()
            self.record.replans.append(Replan(last, kind, why, steps, cost, dropped, added, seconds))
            self.say(kind, text=why)

    @property
    def eligible(self) -> dict[Symbol, str]:
        """The soft goals that a plan may be made for: those that the first plan meets, but none if a hard goal is given up."""
        if self.goals.aside or self.goals.put_off or self.record.status is not End.REACHED:
            return {}
        return {symbol: one.fact.value for symbol, one in self.soft.items() if symbol not in self.left}

    def want_soft_goals(self) -> None:
        """Want all eligible soft goals; `choose` then drops those that aren't worth their price."""
        hard = {symbol: value for symbol, value in self.belief.goal.items() if symbol not in self.soft}
        self.belief.want(hard | self.eligible)

    def choose(self, search: Callable[[], RepairResult]) -> RepairResult:
        """Search for steps for the hard goals and the soft goals that are worth their price; then only these goals are wanted."""
        if self.goals.aside:
            self.want_soft_goals()
        weights = {symbol: one.weight for symbol, one in self.soft.items() if symbol in self.belief.goal}
        if not weights:
            return search()

        def searched(choice: Problem) -> RepairResult:
            self.belief.want(choice.goal)  # the rest values to restore depend on the goals
            return search()

        task, found = chosen(replace(self.belief.task, weights=weights), searched)
        self.belief.want(task.goal)
        return found

    def set_aside(self, impossible: Mapping[Symbol, Reason]) -> None:
        """Drop impossible goals, and record the reasons for hard goals."""
        if impossible:
            goal = self.belief.goal
            self.goals.aside |= {s: (goal[s], reason) for s, reason in impossible.items() if s not in self.soft}
            self.belief.want({s: v for s, v in goal.items() if s not in impossible})

    def want_again(self, goals: dict[Symbol, tuple[str, Reason]]) -> None:
        """Resume goals that were dropped or postponed, and all rest values."""
        self.belief.unrestorable.clear()
        if goals:
            self.belief.want({**self.belief.goal, **{symbol: value for symbol, (value, _) in goals.items()}})
            goals.clear()

    def set_aside_the_vanished(self) -> None:
        """Drop the goals about an object that has vanished, or that is at no place of the scene."""
        self.set_aside(dict(vanished(self.belief.problem, self.world.why_unplaced)))

    def on_no_plan(self, outcome: Outcome | None, limits: Limits) -> None:
        """Handle a failure of planning: look for free spots, drop or postpone goals, retry, or end the episode.

        Each unreachable goal is dropped or postponed. If all goals are reachable, the planner tries again, or the episode ends.

        A goal that needs facts in doubt is postponed until all other goals are handled.
        """
        check("planning")  # no plan is missing if the time of the episode is over
        belief = self.belief
        reason = outcome.reason if outcome is not None and outcome.reason else Reason("no plan was found")
        unsolvable, end = outcome is not None and outcome.status is Status.UNSOLVABLE, limits.end()
        if unsolvable and self.make_room():
            return
        rests, hopeless = self.hopeless(limits.until(end)) if unsolvable else ({}, {})
        if rests:
            belief.unrestorable |= rests
            self.request_replan("rest values can't be restored")
        elif hopeless and belief.doubted:
            goal = belief.goal
            self.goals.put_off |= {
                symbol: (goal[symbol], blamed(self.record, symbol, goal[symbol])) for symbol in hopeless
            }
            belief.want({s: v for s, v in goal.items() if s not in hopeless})
            self.request_replan("unreachable goals are postponed")
        elif hopeless:
            self.set_aside(hopeless)
            self.request_replan("unreachable goals are dropped")
        elif not (belief.doubted and self.try_anew("no alternative is left")):
            self.give_up(reason, End.IMPOSSIBLE if unsolvable and not belief.doubted else End.GAVE_UP)

    def hopeless(self, limits: Limits) -> tuple[dict[Symbol, Reason], dict[Symbol, Reason]]:
        """Return the symbols that can't be brought to rest or, if there are none, the unreachable goals, each with the reason.

        Each goal is tried alone, together with the rest values. The other goals still release their symbols from the rest values,
        unless each goal is then reachable, although not all are.
        """
        belief, known, rests, end = self.belief, self.belief.problem, self.belief.rests, limits.end()
        free = tuple(symbol for symbol in {**known.goal, **known.weights} if known.may_leave_rest(symbol))

        def why(goal: dict[Symbol, str], released: Sequence[Symbol] = free) -> Reason | None:
            weights = {symbol: Fraction(0) for symbol in released if symbol not in goal}
            alone = replace(belief.task, goal=goal, weights=weights)
            steps, single = replan(alone, None, belief.using, limits.until(end))
            return single.reason if steps is None and single.status is Status.UNSOLVABLE else None

        if rests and (together := why(rests)):
            each = {symbol: reason for symbol, rest in rests.items() if (reason := why({symbol: rest}))}
            each = each or dict.fromkeys(rests, together)
            return {s: unrestored(belief, self.record, Fact(s, rests[s]), reason) for s, reason in each.items()}, {}
        found = dict[Symbol, Reason]()
        for released in dict.fromkeys((free, ())):
            for fact in () if found else open_goals(known):
                if (reason := why({**rests, fact.symbol: fact.value}, released)) is not None:
                    found[fact.symbol] = blocked(belief, fact, limits.until(end)) or with_discoveries(
                        belief, self.record, fact, reason
                    )
        return {}, found

    def make_room(self) -> bool:
        """Ask the world once for free spots outside the scene's places; return whether there are any."""
        if self.retries.room_wanted:
            return False
        self.retries.room_wanted = True
        spots = self.world.free_spots()
        for spot in spots:
            self.belief.meet(spot)
            self.record.discovered.append((spot, self.world.seconds))
        if spots:
            self.request_replan(f"no place is free; {', '.join(spot.individual for spot in spots)} would be")
        return bool(spots)

    def give_up(self, reason: Reason, status: End = End.GAVE_UP) -> None:
        """Drop all goals, so that the planner only restores rest values; if there were no goals left, end the episode."""
        if not self.belief.problem.goal and self.record.status is not End.REACHED:
            self.going = False
        self.record.status = status
        for earlier in self.unreached():
            self.record.reason(earlier)
        self.record.reason(reason)
        self.belief.want({})
        self.goals.clear()
        self.retries.most = len(self.record.events) + self.retries.policy.primitives
        self.requested = reason.text

    # ---------------------------------------------------------------------------------------------------- failures

    def learn_from(self, chain: tuple[Step, ...], before: State, verdict: Verdict) -> None:
        """Handle a failed behaviour: retry it, then look for an alternative; later, it counts as impossible."""
        step, code, belief, record = chain[-1], verdict.code or "failed", self.belief, self.record
        if code == INTERRUPTED:
            self.request_replan(verdict.message)
            return
        record.failures.append(Failure(step, code, verdict.objects, verdict.message, before))
        if step.path not in record.done:
            self.retries.attempts[step.behavior, step.arguments] += 1
        if len(record.failures) >= self.retries.policy.failures:
            text = f"stopped after {len(record.failures)} failures, the last of {step}: {verdict.message or code}"
            self.give_up(Reason(text, verdict.objects))
            return
        facts, likewise = getattr(verdict, "facts", ()), getattr(verdict, "likewise", ())
        refuted = refuted_by(belief.problem, chain, facts, code, likewise)
        if refuted and not belief.refuted.keys() >= {*refuted}:
            record.refuted |= dict.fromkeys(refuted)
            self.rethink(f"{refuted[-1]}", refutations=refuted)
        elif self.retries.attempts[step.behavior, step.arguments] >= self.retries.policy.attempts:
            relied_on = relied_on_by(belief.problem, chain)
            why = f"{step} failed {self.retries.policy.attempts} times ({code})"
            never = () if relied_on else (Refutation(step.behavior, step.arguments, (), code),)
            self.rethink(why, relied_on, never)

    def rethink(
        self,
        why: str,
        facts: Iterable[tuple[str, tuple[str, ...]]] = (),
        refutations: Iterable[Refutation] = (),
    ) -> None:
        """Put static facts, or the applicability of behaviours, in doubt, and plan the step in progress again."""
        self.belief.withdraw(facts, refutations)
        self.agenda.sound = False
        self.request_replan(why)

    def try_anew(self, why: str) -> bool:
        """Return whether another round is allowed; if so, trust all facts again and resume postponed goals."""
        if not self.retries.another_round():
            return False
        self.belief.trust_again()
        self.want_again(self.goals.put_off)
        self.agenda.sound = False
        self.request_replan(f"failed primitives are retried: {why}")
        return True


def is_done(verdict: Verdict, changes: Sequence[Fact], seen: State) -> bool:
    """Return whether a primitive has succeeded: it was reported as done, or all its effects are observed."""
    there = bool(changes) and all(seen.get(fact.symbol) == fact.value for fact in changes)
    return verdict.ok or (there and verdict.code != INTERRUPTED)


def _perceived(state: State) -> dict[Symbol, str]:
    """Return a state without symbols of which no value is perceived."""
    return {symbol: value for symbol, value in state.items() if value != UNSEEN}


def _told(surprise: Surprise) -> str:
    return f"{surprise.symbol} is {surprise.observed or 'not seen'}, expected {surprise.expected or 'nothing'}"

"""One planning call: the task is read, searched and, if necessary, scheduled.

```text
read_task          read the individuals that the task can need, or the whole scene
plan_task          if steps must overlap, plan with times
                   otherwise search; if the part of the scene has no valid plan, search in the whole scene
                   schedule the plan, or plan with times if steps may have to overlap
in_time            schedule the plan; with a time limit, then shorten the plan as long as its schedule keeps all deadlines
choose_and_search  choose among the soft goals; each choice is a search
search             the engine that the caller names, or Confab's own search and then an installed engine
```
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from math import inf
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, NamedTuple

from confab.checking import refused
from confab.known import Known
from confab.plan_options import NO_ENGINE, PlanOptions
from confab.planner.certified import certified
from confab.planner.plan import Counts, Forgone, Limits, Outcome, Plan, Reason, Shortening, Status
from confab.planner.plan_costs import compared, cost_of
from confab.planner.solve import DEFAULT_MODE, Request, solve, unchecked
from confab.planner.timed.plan import schedule_of
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.limits import Deadline, OutOfTimeError
from confab.reasoner.memory.links import Links
from confab.reasoner.problem import Problem
from confab.reasoner.reading.goals import with_goals
from confab.reasoner.reading.problem import Reading
from confab.reasoner.reading.relevance import recognise
from confab.reasoner.refining import never_done, without
from confab.reasoner.symbols import Behavior, Fact, GroundBehavior
from confab.timing import (
    asks_for_times,
    has_times,
    needs_others_meanwhile,
    scheduled,
    with_unit_costs,
)

if TYPE_CHECKING:
    from confab.memory import Memory
    from confab.planner.timed.plan import TimedPlan

OURS = 0.6
"""The share of the time limit in which Confab's own search must find a plan if an engine may follow.

If an engine may follow, a search before a schedule, or in the modes optimal and paper, ends after this share. An optimal search
before a schedule always ends after this share, since the time left is for the schedule.
"""
OURS_WORK = 10_000_000
"""Maximum work of Confab's own search (states times operators) before an engine is tried, if there is no time limit.

The search does this maximum work in ten to twenty seconds.
"""
CHOICE = 0.25
"""The share of the remaining time in which a plan for one choice of soft goals is searched."""
KEPT, KEPT_IN_TIME = 0.1, 0.3
"""The shares of the time limit that choosing among soft goals leaves: by default, and for a schedule of the chosen goals."""
SHORTENING = 0.7
"""The share of the remaining time in which a plan with a schedule is shortened; the rest is for the new schedule."""
CHOICE_WORK = 300_000
"""Maximum work of the search of a plan for one choice of soft goals.

After more work for another choice, the maximum is twice that work.
"""


@dataclass(frozen=True)
class PlanningTask:
    """The task of one planning call.

    `reading` contains the individuals that the task can need, or the whole scene; `problem` is its problem with the goals of the
    call. `grounds` are the quantified behaviours for the paper's mode.
    """

    scene: Known
    goals: list[str]
    memory: Memory | Links | None
    options: PlanOptions
    deadline: Deadline
    reading: Reading
    problem: Problem
    grounds: Mapping[int, tuple[GroundBehavior, ...]] | None
    checking: float
    """The expected time of the check in the whole scene, in seconds: the check reads the part of the scene again."""
    choosing: bool = True
    """Whether the planner chooses among the soft goals; if not, it plans for the other goals alone."""

    def whole(self) -> Problem:
        """Return the problem with all individuals of the scene."""
        return with_goals(self.scene.read_whole(self.reading.schema), self.goals)

    def with_measured_durations(self, problem: Problem) -> Problem:
        """Return a problem with the durations that the memory has measured."""
        if self.memory is None or isinstance(self.memory, Links):
            return problem
        from confab.planner.timed.measuring import with_durations

        return with_durations(problem, self.memory.statistics)


class Found(NamedTuple):
    """What a planning call has found.

    `part` is the part of the scene from which `problem` was read, or None for the whole scene. `optimal` states whether the search
    looked for an optimal plan.
    """

    problem: Problem
    outcome: Outcome
    timed: TimedPlan | None
    part: Reading | None
    optimal: bool


class Searching(NamedTuple):
    """The mode of a search, the share of the time limit that the search may use, and the work for a shorter plan.

    By default, the work for a shorter plan depends on the time limit. If `most_work` is given, it limits the work of the search,
    and the search uses no engine. `first` is an outcome whose plan is extended or shortened instead of searching. Shortening keeps
    only plans that `accepts` allows.
    """

    mode: str
    share: float = 1.0
    shortening: Shortening | None = None
    most_work: float = inf
    first: Outcome | None = None
    accepts: Callable[[Plan], bool] | None = None


def read_task(
    scene: Known, goals: list[str], memory: Memory | Links | None, options: PlanOptions, deadline: Deadline
) -> PlanningTask:
    """Read the task of a planning call; the paper's mode and observed facts require the whole scene."""
    grounds, paper, begin = None, options.strategy == "paper", perf_counter()
    if paper or options.observed is not None:
        reading = scene.reading
        if options.observed is not None:
            from confab.reasoner.reading.observed import load_observed

            reading = load_observed(Path(options.observed), reading)
        problem = with_goals(reading.problem, goals)
    else:
        reading = recognise(scene.knowledge, goals)
        problem = reading.problem
    if paper:
        from confab.reasoner.reading.quantification import quantify

        grounds = {level: quantify(scene.knowledge, reading, level) for level in reading.problem.domain.levels}
    scene.knowledge.confirm()
    checking = 0.0 if reading.whole else perf_counter() - begin
    return PlanningTask(scene, goals, memory, options, deadline, reading, problem, grounds, checking)


def plan_task(task: PlanningTask) -> Found:
    """Plan, and schedule the plan if the task asks for times."""
    problem, part = task.problem, None if task.reading.whole else task.reading
    faulty = [*never_done(problem)]
    if faulty and part is not None:  # an individual that wasn't read may have the value
        problem, part = task.whole(), None
        faulty = [*never_done(problem)]
    if task.options.by_engine and has_times(problem) and not problem.weights:
        from confab.engines import plan_in_time_by_engine, plans_in_time

        if task.options.engine is not None and plans_in_time(task.options.engine):
            problem = task.with_measured_durations(problem if task.reading.whole else task.whole())
            outcome = plan_in_time_by_engine(problem, task.options.engine, task.deadline.left)
            return Found(problem, outcome, schedule_of(outcome), None, False)
    if needs_others_meanwhile(problem):
        if task.options.by_engine:
            raise KnowledgeError(
                "the steps of this task must overlap, which this engine doesn't plan; leave out the engine, or name another one"
            )
        if problem.weights:
            raise KnowledgeError("a task whose steps must overlap can't have soft goals; drop the :weight of its goals")
        problem = task.with_measured_durations(problem if task.reading.whole else task.whole())
        outcome = solve(Request(problem, limits=Limits(seconds=task.deadline.left)))
        return Found(problem, outcome, schedule_of(outcome), None, False)
    if asks_for_times(problem, task.options.minimise):
        import_module("confab.planner.timed.call")  # the search has a share of the time that is left afterwards
    if faulty:
        problem, outcome = choose_without(task, problem, faulty)
    else:
        problem, outcome = choose_and_search(task, problem)
    try:
        if part is not None and needs_the_whole_scene(task, outcome):
            whole = task.whole()
            if whole != task.problem:
                part = None
                problem, outcome = choose_and_search(task, whole)
    except OutOfTimeError as error:
        if outcome.plan is None:
            raise
        outcome = unchecked(outcome, error)
    problem, timed = task.with_measured_durations(problem), schedule_of(outcome)
    if timed is None and asks_for_times(problem, task.options.minimise):
        outcome, timed = in_time(task, problem, outcome)
    if timed is not None and task.problem.weights:  # a plan that leaves more soft goals unmet may be shorter
        timed = replace(timed, least=Fraction(0))
    return Found(problem, outcome, timed, part, task.options.strategy == "optimal")


def in_time(task: PlanningTask, problem: Problem, outcome: Outcome) -> tuple[Outcome, TimedPlan | None]:
    """Schedule a plan; if it misses deadlines or windows, schedule a plan that is hardly shortened instead.

    A plan that isn't shortened for its makespan is shortened after it has been scheduled, if there is a time limit.
    """
    shorten, mode = task.options.minimise == "makespan", task.options.strategy
    found, timed = scheduled(problem, outcome, task.deadline, shorten)
    if outcome.plan is None or task.options.by_engine:
        return found, timed
    how = Searching(DEFAULT_MODE if mode == "optimal" else mode, shortening="brief")
    with suppress(OutOfTimeError):
        if timed is None:
            other = search(task, problem, how)
            if other.plan is not None and other.plan.primitives != outcome.plan.primitives:
                longer, timed = scheduled(problem, other, task.deadline, shorten)
                if timed is not None:
                    found = replace(longer, bound=outcome.bound, penalty=outcome.penalty, forgone=outcome.forgone)
        if timed is not None and not shorten and mode != "paper" and task.deadline.left is not None:
            return shortened_in_time(task, problem, found, timed, how)
    return found, timed


def shortened_in_time(
    task: PlanningTask, problem: Problem, found: Outcome, timed: TimedPlan, how: Searching
) -> tuple[Outcome, TimedPlan]:
    """Shorten a plan with a schedule; return the cheapest plan whose schedule keeps all deadlines and windows."""
    from confab.planner.timed.call import keeps_times

    priced = with_unit_costs(problem) if task.options.minimise == "steps" else problem
    total = cost_of(priced, timed.plan) + float(found.penalty or 0)
    if schedule_of(found) is not None or (found.bound is not None and total <= found.bound):
        return found, timed
    before = compared(priced, timed.plan.primitives)
    how = how._replace(share=SHORTENING, shortening="repeated", first=found, accepts=partial(keeps_times, problem))
    shorter = search(task, problem, how).plan
    if shorter is not None and compared(priced, shorter.primitives) < before:
        other, again = scheduled(problem, replace(found, plan=shorter), task.deadline, False)
        if again is not None and compared(priced, again.plan.primitives) < before:
            return other, again
    return found, timed


def needs_the_whole_scene(task: PlanningTask, outcome: Outcome) -> bool:
    """Return whether the whole scene must be searched: its part has no plan, or the plan has faults in the whole scene."""
    if outcome.status is Status.UNSOLVABLE:
        return True
    plan, knowledge = outcome.plan, task.scene.knowledge
    return bool(plan and refused(knowledge, task.reading, plan, task.goals, outcome.unmet))


def choose_without(
    task: PlanningTask, problem: Problem, faulty: Sequence[tuple[Behavior, str]]
) -> tuple[Problem, Outcome]:
    """Search without behaviours that no plan can contain; if there is no plan without them, the first reason is an error."""
    possible = without(problem, [behavior for behavior, _ in faulty])
    behavior, why = faulty[0]
    error = KnowledgeError(why, task.reading.names.iri(behavior.name))
    leaves = task.options.leave_levels and task.options.strategy != "paper"
    if not leaves and none_at_all(possible, task.deadline):
        raise error
    chosen, outcome = choose_and_search(task, possible)
    if leaves and outcome.status is Status.UNSOLVABLE:
        raise error
    if outcome.status is Status.GAVE_UP and outcome.reason:
        outcome = replace(outcome, reason=replace(outcome.reason, text=f"{outcome.reason.text}; {why}"))
    return replace(problem, goal=chosen.goal, weights={}), outcome


def none_at_all(problem: Problem, deadline: Deadline) -> bool:
    """Return whether the task can be proved unsolvable in half of the remaining time."""
    from confab.planner.certificate_checks import refusal

    limits = Limits(seconds=None if deadline.left is None else deadline.left / 2)
    certificate = solve(Request(problem.only(problem.weights), limits=limits)).certificate
    return certificate is not None and refusal(problem, certificate) is None


# ------------------------------------------------------------------------------------------------------------- searching


def choose_and_search(task: PlanningTask, problem: Problem) -> tuple[Problem, Outcome]:
    """Search, and choose among soft goals; return the problem with the chosen goals, and the outcome."""
    mode = task.options.strategy
    if not problem.weights:
        return problem, search(task, problem, Searching(mode))
    if not task.choosing:
        hard = problem.only(problem.weights)
        left = tuple(Forgone(Fact(one, problem.goal[one]), weight, None) for one, weight in problem.weights.items())
        return hard, replace(search(task, hard, Searching(mode)), forgone=left)
    from confab.planner.preferences import preferred

    alike = with_unit_costs(problem) if task.options.minimise == "steps" else problem
    first, seconds = Searching(DEFAULT_MODE if mode == "optimal" else mode, shortening="none"), task.deadline.left
    bounded, worked = first._replace(share=CHOICE, most_work=CHOICE_WORK), 0
    kept = (seconds or 0.0) * (KEPT_IN_TIME if asks_for_times(problem, task.options.minimise) else KEPT)
    known: dict[tuple[object, ...], Outcome] = {}
    fixed = task.options.by_engine or mode == "paper"
    searches, begin = list[Outcome](), perf_counter()

    def counted(found: Outcome) -> Outcome:
        searches.append(found)
        return found

    def comparing(choice: Problem) -> Searching:
        if choice.goal.keys().isdisjoint(problem.weights):
            return first
        return bounded._replace(most_work=max(CHOICE_WORK, 2 * worked))

    def in_shorter_time(choice: Problem, found: Outcome) -> Outcome:
        from confab.planner.timed.call import keeps_times

        timed = task.with_measured_durations(choice)
        with suppress(OutOfTimeError):
            if not fixed and found.plan is not None and not keeps_times(timed, found.plan):
                other = counted(search(task, choice, comparing(choice)._replace(shortening="compared", first=found)))
                if other.plan is not None and keeps_times(timed, other.plan):
                    return other
        return found

    def in_its_times(choice: Problem, found: Outcome) -> Outcome:
        if not asks_for_times(choice, None):
            return found
        found = in_shorter_time(choice, found)
        if found.plan is None:
            return found
        key = (*choice.goal, *((step.behavior, step.arguments) for step in found.plan.primitives))
        if key not in known:
            left = task.deadline.left
            half = task.deadline if left is None else Deadline.after(left / 2)
            known[key] = scheduled(task.with_measured_durations(choice), found, half, False)[0]
        same = known[key]
        return replace(found, status=same.status, plan=same.plan, reason=same.reason, left=same.left, cost=same.cost)

    def choose(choice: Problem) -> Outcome:
        limit = "half of the time limit, which is for a cheaper plan or proofs"
        found = counted(search_in_time(task, comparing(choice), (seconds or 0.0) / 2, limit, choice))
        nonlocal worked
        worked = max(worked, found.effort if found.plan is not None else 0)
        return in_its_times(choice, found)

    def shorten(choice: Problem, found: Outcome, briefly: bool) -> Outcome:
        how = comparing(choice)._replace(shortening="compared") if briefly else Searching(mode)
        return in_its_times(choice, counted(search(task, choice, how._replace(first=found))))

    def extended(choice: Problem, found: Outcome) -> Outcome:
        how = bounded._replace(first=found)
        return in_its_times(choice, counted(search_in_time(task, how, kept, "the time limit", choice)))

    extend = None if fixed else extended
    if mode != "optimal":
        chosen, outcome = preferred(alike, choose, shorten=None if fixed else shorten, extend=extend)
    else:
        least = max(kept, 2 * task.checking)

        def prove(choice: Problem) -> Outcome:
            how = Searching(mode, share=0.5)
            return in_its_times(choice, counted(search_in_time(task, how, least, "the time limit", choice)))

        chosen, outcome = preferred(alike, choose, prove, extend=extend)
    outcome = replace(outcome, search=counts_of(searches), seconds=perf_counter() - begin)
    return replace(problem, goal=chosen.goal, weights=chosen.weights), outcome


def counts_of(outcomes: Sequence[Outcome]) -> dict[int, Counts]:
    """Return the sums of the counts of searches, by levels."""
    total: dict[int, Counts] = {}
    for outcome in outcomes:
        for level, counts in sorted(outcome.search.items()):
            total.setdefault(level, Counts()).add(counts)
    return total


def search_in_time(task: PlanningTask, how: Searching, least: float, limit: str, problem: Problem) -> Outcome:
    """Search; if fewer than `least` seconds are left, raise `OutOfTimeError` with the name of the limit."""
    if task.deadline.left is not None and task.deadline.left < least:
        raise OutOfTimeError(limit)
    return search(task, problem, how)


def search(task: PlanningTask, problem: Problem, how: Searching) -> Outcome:
    """Search with the named engine, or with Confab's own search and then an installed engine."""
    options, deadline = task.options, task.deadline
    deadline.check("reading the problem")
    if options.by_engine:
        from confab.engines import plan_by_engine

        return certified(problem, plan_by_engine(problem, options.engine, options.level, deadline.left))
    engines = options.leave_levels and options.engine != NO_ENGINE and how.most_work == inf
    request = own_request(task, problem, how, engines)
    unlimited = request.limits.seconds is None and how.mode != "paper" and find_spec("unified_planning") is not None
    again = request if engines and unlimited else None
    outcome = solve(replace(request, limits=replace(request.limits, work=OURS_WORK)) if again else request)
    if schedule_of(outcome) is not None and task.problem.weights:
        return Outcome(Status.GAVE_UP, reason=Reason("only steps that must overlap reach these soft goals"))
    if outcome.status is not Status.GAVE_UP or not engines or deadline.left == 0:
        return outcome
    return by_installed_engine(problem, deadline, outcome, again)


def own_request(task: PlanningTask, problem: Problem, how: Searching, engines: bool) -> Request:
    """Return the request for Confab's own search; if engines or scheduling may follow, a part of the time is kept for them."""
    options, seconds, memory = task.options, task.deadline.left, task.memory
    timed, finding = asks_for_times(problem, options.minimise), 1.0
    if seconds is not None:
        from confab.engines import some_installed

        share, before_engine = how.share, engines and some_installed(problem)
        if how.mode in {"optimal", "paper"} or timed:
            share *= OURS if before_engine or (timed and how.mode == "optimal") else 1.0
        elif before_engine:
            finding = OURS
        seconds = min(seconds * share, max(seconds - task.checking, seconds / 2))
    once = seconds is None or timed
    shortening = how.shortening or ("once" if once else "repeated")
    links = (
        memory
        if isinstance(memory, Links)
        else memory.links
        if memory is not None and options.strategy == "paper"
        else None
    )
    return Request(
        task.with_measured_durations(with_unit_costs(problem) if options.minimise == "steps" else problem),
        how.mode,
        Limits(seconds=seconds, work=how.most_work, shortening=shortening, accepts=how.accepts, finding=finding),
        None if memory is None or isinstance(memory, Links) else memory.advisor,
        links,
        task.grounds,
        options.leave_levels,
        how.first,
    )


def by_installed_engine(problem: Problem, deadline: Deadline, outcome: Outcome, again: Request | None) -> Outcome:
    """Return the outcome of an installed engine after Confab's own search gave up.

    If the engine finds no plan, the result is the outcome of the own search, which is first repeated with the request `again`, if
    given.
    """
    from confab.engines import plan_by_engine, some_installed

    began = perf_counter() - outcome.seconds
    tried = some_installed(problem)
    why = "it found no plan"
    if tried:
        try:
            theirs = plan_by_engine(problem, None, None, deadline.left)
        except (KnowledgeError, OutOfTimeError) as error:
            why = str(error)
        else:
            if theirs.status is Status.SOLVED:
                return replace(theirs, seconds=perf_counter() - began)
            why = theirs.reason.text if theirs.reason else why
    outcome = solve(again) if again else outcome
    if tried and outcome.status is Status.GAVE_UP:
        ours = outcome.reason.text if outcome.reason else "gave up"
        reason = Reason(f"{ours}; an installed engine was tried {'before' if again else 'then'}: {why}")
        outcome = replace(outcome, reason=reason)
    return replace(outcome, seconds=perf_counter() - began)

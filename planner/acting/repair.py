"""Repair of a plan: steps that are still valid are kept, and the other steps are planned again.

The remaining steps of the plan are replayed on a state table from the present situation. A step is dropped if the facts that it
should make true hold already, or are no longer goals. A step is kept if its primitives still have their effects; otherwise the step
is refined again (for another hand, for instance). A step is put off if the step isn't applicable yet; later steps about the same
individuals are then put off, too. The steps that were put off are tried again after each successful step. The default planner then
achieves the remaining goals, on the same state table. If a hand is in the middle of a step, the step is finished first, or the hand
is brought to rest.

If this repair fails and the goal has changed, the repair is the rest of the plan without the primitives that are now wrong or
superfluous. This repair keeps the primitives that several steps of the first level share.

`confab.planner.validation` checks every repaired plan.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from difflib import SequenceMatcher

from confab.planner.certified import certified
from confab.planner.hierarchical.agenda import Agenda, order
from confab.planner.hierarchical.call import Call, Compiled, as_refined, bring_to_rest, compiled
from confab.planner.hierarchical.planner import plan as hierarchical_plan
from confab.planner.hierarchical.refinement import RefinedStep
from confab.planner.hierarchical.search_budget import ONE_STEP
from confab.planner.hierarchical.unsolvability import impossible
from confab.planner.plan import Limits, Outcome, Plan, Planner, Reason, Status, Step, UnsolvableError, renumbered
from confab.planner.plan_costs import cost_of, costs_of_steps
from confab.planner.preferences import preferred
from confab.planner.transitions import Cell, arguments_of, key_of
from confab.planner.validation import BehaviorReader, LoggedState, validate
from confab.reasoner.amounts import meets
from confab.reasoner.limits import LimitError, check, within
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import FALSE, State, Symbol, Times
from confab.reasoner.timing import may_overlap_by_need

CLOSE = 1.1
"""Maximum ratio of a repair's cost to a new plan's cost; if the repair costs more, the new plan is taken."""

MOST = 5_000
"""Maximum number of expansions of a repair; at this number, the whole task is planned again."""

SHARE = 0.5
"""Share of the remaining time for a repair; the rest of the time is reserved for a new plan."""


@dataclass(frozen=True)
class RepairResult:
    """The remaining steps after a repair or a new plan, None if no plan was found, and the way in which they were found."""

    kind: str
    steps: tuple[Step, ...] | None
    cost: float
    outcome: Outcome | None = None


@dataclass(frozen=True)
class Repaired:
    """The result of a repair: the steps, their cost, and `least`, an estimate of the least cost of a plan for the open goals."""

    steps: tuple[Step, ...]
    cost: float
    least: float


def repair_or_replan(
    problem: Problem,
    rest: Sequence[Step],
    planned: Problem,
    planner: Planner | None = None,
    using: Compiled | None = None,
    in_progress: bool = True,
    limits: Limits = Limits(),  # noqa: B008 - frozen
    begun: bool = False,
) -> RepairResult:
    """Return the remaining steps for a situation that differs from the expected one: a repair of `rest`, or a new plan.

    Parameters
    ----------
    problem : Problem
        The present situation, and the present goal.
    rest : sequence of Step
        The remaining steps; if the first step is partly done, `rest` contains only the remaining sub-steps of this step.
    planned : Problem
        The problem for which `rest` was planned: the expected situation, and the goal.
    planner, using, limits
        As for `replan`; the limits are those of the whole call.
    in_progress, begun : bool
        Whether the first step of `rest` may be finished as planned, and whether it has begun. A step that has begun is finished
        even if its own precondition no longer holds.
    """
    using, end = using or compiled(problem), limits.end()
    repaired = repair(problem, rest, planned, using, in_progress, limits, begun)
    if repaired is not None and rejected(problem, repaired.steps):
        repaired = None
    if repaired is None and planned.goal != problem.goal:
        left = limits.until(end).seconds
        with suppress(LimitError), within(None if left is None else SHARE * left):
            kept = still_needed(problem, rest)
            repaired = None if kept is None else Repaired(kept, cost_of(problem, Plan(kept)), 0.0)
    fewer = planned.goal.keys() - problem.goal.keys()  # steps for a goal that was dropped may be superfluous
    if repaired is not None and not fewer and repaired.cost <= repaired.least:
        return RepairResult("repair", repaired.steps, repaired.cost)
    anew, outcome = replan(problem, planner, using, limits.until(end))
    if repaired is not None and (anew is None or repaired.cost <= CLOSE * cost_of(problem, Plan(anew))):
        return RepairResult("repair", repaired.steps, repaired.cost)
    return RepairResult("replan", anew, cost_of(problem, Plan(anew or ())), outcome)


def still_needed(problem: Problem, rest: Sequence[Step]) -> tuple[Step, ...] | None:
    """Return steps without the primitives that changed goals make wrong or superfluous, or None if the others aren't a plan.

    A primitive is wrong if it changes a goal that holds before it and no longer holds at the end. The sub-steps of a step that
    loses a primitive take its place.
    """
    primitives = Plan(renumbered(rest)).primitives
    rules, events = BehaviorReader(problem), (problem.times or Times()).events
    wrong = set[int]()
    for _ in primitives:
        facts, after = LoggedState(problem, problem.initial, rules), dict[Symbol, list[int]]()
        for number, step in enumerate(primitives):
            changes = rules.changes(problem.domain.behaviors[step.behavior], step.arguments, facts)
            if number in wrong or changes is None:
                wrong.add(number)
                continue
            for symbol in {Symbol(situation, key) for situation, key, _ in changes} & problem.goal.keys():
                if meets(facts.value(symbol.situation, symbol.arguments) or FALSE, problem.goal[symbol]):
                    after[symbol] = []
                if symbol in after:
                    after[symbol].append(number)
            for change in changes:
                facts.put(*change)
        lost = [
            number
            for symbol, numbers in after.items()
            if not meets(facts.value(symbol.situation, symbol.arguments) or FALSE, problem.goal[symbol])
            for number in numbers
        ]
        if not lost:
            break
        wrong.update(lost)

    def without(some: set[int]) -> tuple[Step, ...]:
        gone = {primitives[number].path for number in some}

        def left(step: Step) -> tuple[Step, ...]:
            if not step.steps:
                return () if step.path in gone else (step,)
            inside = tuple(one for child in step.steps for one in left(child))
            return (step,) if inside == step.steps else inside

        return tuple(one for step in renumbered(rest) for one in left(step))

    if rejected(problem, without(wrong)):
        return None
    numbers = {step.path: number for number, step in enumerate(primitives)}
    for step in reversed([step for one in renumbered(rest) for step in one.walk()]):
        check("repairing the plan")
        its = {numbers[one.path] for one in step.walk() if not one.steps and one.behavior not in events}
        if not its <= wrong and not rejected(problem, without(wrong | its)):
            wrong |= its
    return without(wrong)


def chosen(problem: Problem, search: Callable[[Problem], RepairResult]) -> tuple[Problem, RepairResult]:
    """Choose among the soft goals of a problem; return the problem with the chosen goals, and the steps that `search` finds.

    Without steps for the hard goals, no soft goal is chosen.
    """
    found: list[tuple[Plan, RepairResult]] = []

    def outcome(choice: Problem) -> Outcome:
        result = search(choice)
        if result.steps is None:
            return result.outcome or Outcome(Status.GAVE_UP)
        plan = Plan(renumbered(Plan(result.steps).primitives))  # the first step may be in progress
        found.append((plan, result))
        return Outcome(Status.SOLVED, plan)

    task, best = preferred(problem, outcome)
    return task, next((result for plan, result in found if plan is best.plan), RepairResult("replan", None, 0.0, best))


def repair(
    problem: Problem,
    rest: Sequence[Step],
    planned: Problem,
    using: Compiled,
    in_progress: bool,
    limits: Limits,
    begun: bool = False,
) -> Repaired | None:
    """Return steps that achieve the open goals and contain as many valid steps of `rest` as possible, or None.

    The estimate `least` is the total cost of some steps: the step in progress, the planned steps that name no changed
    individual, one step per open goal, and one step per changed individual.
    """
    wanted = planned.goal
    touched = changed_individuals(planned, problem)
    call = Call(problem, using, limits.end(SHARE), min(limits.expansions, MOST))
    # Only replanning can prove that the task is impossible. A repair undoes no applied step, because a restart would be a new
    # plan.
    agenda = Agenda(call)
    pending = list(rest)
    try:
        if in_progress and (begun or not call.at_rest()):
            _finish(call, pending, wanted)
        elif not call.at_rest():
            del pending[:1]
        bring_to_rest(call)
        finished = len(call.steps)
        _restore(call, pending)
        restored = len(call.steps)
        whole = _replay(call, pending, wanted)
        # If no step is dropped, every kept step still has a purpose.
        kept = (*range(finished), *range(restored, len(call.steps))) if whole else ()
        bring_to_rest(call)
        now = replace(problem, initial={**problem.initial, **call.table.state()})
        solved = not impossible(now) and agenda.achieve_all()
    except (LimitError, UnsolvableError):
        solved = False
    if not solved:
        return None
    costs = costs_of_steps(call.problem, call.tree().steps)
    named = [{argument for one in step.together for argument in one.arguments} for step in call.steps]
    needed = {i for i in kept if touched.isdisjoint(named[i])} | _last_steps(call)
    for individual in sorted(touched):  # one step might replace all steps about the individual
        together = [i for i in needed if individual in named[i]]
        needed.difference_update(sorted(together, key=lambda i: -costs[i])[1:])
    return Repaired(call.tree().steps, sum(costs), sum(costs[i] for i in needed))


def changed_individuals(planned: Problem, now: Problem) -> set[str]:
    """Return the individuals in whose symbols or goals two problems differ."""
    touched: set[str] = set()
    for old, new in ((planned.initial, now.initial), (planned.goal, now.goal)):
        for symbol in old.keys() | new.keys():
            was, is_ = old.get(symbol, FALSE), new.get(symbol, FALSE)
            if was != is_:
                touched.update((*symbol.arguments, was, is_))
    return touched


def replan(
    problem: Problem, planner: Planner | None, using: Compiled, limits: Limits
) -> tuple[tuple[Step, ...] | None, Outcome]:
    """Return a new plan: first the hands are brought to rest, then `planner` (or the default planner) plans the task.

    `using` is the result of `confab.planner.hierarchical.planner.compiled` for the same domain, individuals and static facts.
    """
    first: tuple[Step, ...] = ()
    now, end = problem, limits.end()
    call = Call(problem, using, end, limits.expansions)
    if not call.at_rest():
        try:
            bring_to_rest(call)
        except LimitError as limit:
            return None, Outcome(Status.GAVE_UP, None, Reason(f"stopped at the limit: {limit}"))
        first, problem = call.tree().steps, replace(problem, initial=call.table.state())
    left = limits.until(end)
    outcome = planner(problem, limits=left) if planner else hierarchical_plan(problem, limits=left, using=using)
    if outcome.status is Status.UNSOLVABLE and may_overlap_by_need(now):
        text = "no sequence of whole steps reaches the goal; steps that overlap by need are planned only before the first step"
        return None, replace(outcome, status=Status.GAVE_UP, certificate=None, reason=Reason(text))
    if outcome.plan is None:
        with within(left.seconds):
            return None, certified(now, outcome)
    check("planning")  # a plan that can't be begun in time needn't be checked
    steps = renumbered((*first, *outcome.plan.steps)) if first else outcome.plan.steps
    reason = rejected(now, steps)
    return (None, replace(outcome, status=Status.GAVE_UP, plan=None, reason=reason)) if reason else (steps, outcome)


def rejected(problem: Problem, steps: Sequence[Step]) -> Reason | None:
    """Return the reason why the independent checker rejects some steps.

    Return None if the steps lead from the present situation to the goal.

    Only the primitives are checked: the first step may be in progress, so the preconditions of its ancestors held
    earlier.
    """
    faults = validate(problem, Plan(renumbered(Plan(tuple(steps)).primitives)))
    return Reason(f"the steps that were found can't be followed: {faults[0].text}") if faults else None


def vanished(problem: Problem, why: Callable[[str], str] = lambda one: "") -> list[tuple[Symbol, Reason]]:
    """Return the goals that can't hold because their object is gone or is at no perceived place, each with the reason.

    `why` maps an object to the reason why it has no perceived place, if the reason is known.
    """
    return [
        (
            symbol,
            Reason(
                f"{symbol} = {value} is wanted, but {symbol.arguments[0]} "
                + (why(symbol.arguments[0]) or "isn't to be seen"),
                (*symbol.arguments, value),
            ),
        )
        for symbol, value in problem.goal.items()
        if symbol not in problem.initial and not problem.domain.situations[symbol.situation].boolean
    ]


def difference(old: Iterable[Step], new: Iterable[Step]) -> tuple[int, int]:
    """Return how many primitives the new steps drop and add; a primitive at another position counts as dropped and added."""
    before, after = (tuple((p.behavior, p.arguments) for p in Plan(tuple(steps)).primitives) for steps in (old, new))
    same = sum(block.size for block in SequenceMatcher(None, before, after, autojunk=False).get_matching_blocks())
    return len(before) - same, len(after) - same


# -------------------------------------------------------------------------------------------------------------- replaying


def _finish(call: Call, pending: list[Step], wanted: State) -> None:
    """Apply the unexecuted sub-steps of the step in progress until all symbols are at rest, and remove the step from `pending`.

    No sub-step is applied if the sub-steps don't bring all symbols to rest, or if they achieve only former goals. The step in
    progress is then dropped, unless all symbols are at rest already.
    """
    mark = len(call.table.trail)
    for count, step in enumerate(pending, 1):
        done = _redo(call, step, begun=count == 1)
        if done is None:
            break
        call.steps.append(done)
        if call.at_rest():
            if _useless(call, call.table.since(mark), wanted):
                break  # a step without an effect on the upper levels isn't finished
            del pending[:count]
            return
    call.table.undo(mark)
    call.steps.clear()
    if not call.at_rest():
        del pending[:1]


def _restore(call: Call, pending: Sequence[Step]) -> None:
    """Achieve the disturbed goals first: the open goals that no pending step achieves and that one step can achieve."""
    planned = {cell for step in pending for cell in _effects(call, step)}
    orphans = [cell for cell in call.goal if cell not in planned and not call.met(cell)]
    before = order(call) if orphans else {}
    for cell in orphans:
        if not any(other in orphans for other in before.get(cell, ())):
            call.achieve_goal(call.program.levels[0], cell, ONE_STEP)


def _replay(call: Call, pending: list[Step], wanted: State) -> bool:
    """Apply as many pending steps as possible, preferably in their order; return whether all were applied."""
    progress, whole = True, True
    while progress and pending:
        progress, put_off, waiting = False, list[Step](), set[str]()
        steps = pending[::-1]
        while steps:
            step = steps.pop()
            call.space.check_time()
            if step.joined:  # if the joint refinement can't be replayed, its steps are applied one by one
                done = _redo(call, step)
                if done is None:
                    steps += reversed(step.steps)
                    whole = False
                else:
                    call.steps.append(done)
                    progress = True
                continue
            if not waiting.isdisjoint(step.arguments):
                put_off.append(step)
                continue
            effects = _effects(call, step)
            if _useless(call, effects, wanted):
                _achieve_instead(call, effects)
                whole = False
                continue
            if all(call.table.now[s].get(k) == value for (s, k), value in effects.items()):
                whole = False
                continue
            done = _redo(call, step) or call.refiner.do(step.level, step.behavior, step.arguments)
            if done is None:
                put_off.append(step)
                waiting.update(individual for _, key in effects for individual in arguments_of(key))
            else:
                call.steps.append(done)
                progress = True
        pending[:] = put_off
    return whole and not pending


def _redo(call: Call, step: Step, begun: bool = False) -> RefinedStep | None:
    """Apply a step with its primitives; on failure, leave the table unchanged and return None.

    If `begun`, the step was begun earlier, so only its primitives are checked; otherwise the step must be applicable and have
    its effects.
    """
    mark = len(call.table.trail)
    one = as_refined(call, (step,))[0]._replace(steps=())
    applicable, stated = call.refiner.stated(one)
    if not step.steps or (applicable is None and not begun):
        return applicable if not step.steps else None
    call.table.undo(mark)
    below = []
    for child in step.steps:
        done = _redo(call, child, begun)
        if done is None:
            call.table.undo(mark)
            return None
        below.append(done)
    now = call.table.now
    if not begun and any(now[s].get(k, FALSE) != value for (s, k), value in stated.items()):
        call.table.undo(mark)
        return None
    return (applicable or one)._replace(steps=tuple(below))


def _achieve_instead(call: Call, effects: Mapping[Cell, str]) -> None:
    """For each symbol that a step would change, achieve the symbol's open goal instead, if one step can achieve it."""
    for cell in effects:
        if cell in call.goal and not call.met(cell):
            call.achieve_goal(call.program.levels[0], cell, ONE_STEP)


def _useless(call: Call, effects: Mapping[Cell, str], wanted: State) -> bool:
    """Return whether every first-level change of a step achieves a former goal that is no longer a goal."""
    situations, first = call.problem.domain.situations, call.program.levels[0]
    return all(
        call.goal.get((name, key)) != value and wanted.get(Symbol(name, arguments_of(key))) == value
        for (name, key), value in effects.items()
        if situations[name].level <= first
    )


def _effects(call: Call, step: Step) -> dict[Cell, str]:
    """Return the values that a step would give to symbols, whether or not the step is applicable."""
    found: dict[Cell, str] = {}
    for one in step.together:
        lifted = call.problem.domain.behaviors[one.behavior]
        env = {p.name: argument for p, argument in zip(lifted.parameters, one.arguments, strict=True)}
        env |= {f"?{name}": value for name, value in one.bindings.items()}
        for effect in lifted.effects:
            if not effect.when:
                key = key_of(tuple(env.get(a, a) for a in effect.arguments))
                found[effect.situation, key] = env.get(effect.value, effect.value)
    return found


def _last_steps(call: Call) -> set[int]:
    """Return the positions of the last steps that change open goals; consecutive steps below the first level count as one group."""
    start, first = call.problem.initial, call.program.levels[0]
    last: dict[Cell, int] = {}
    together: dict[int, set[int]] = {}
    before: set[int] = set()
    for position, step in enumerate(call.tree().steps):
        for cell in _effects(call, step):
            last[cell] = position
        before = {*before, position} if step.level > first else set()
        together[position] = before or {position}
    found: set[int] = set()
    for symbol, value in call.problem.goal.items():
        cell = symbol.situation, key_of(symbol.arguments)
        if cell in last and not meets(start.get(symbol, FALSE), value):
            found |= together[last[cell]]
    return found

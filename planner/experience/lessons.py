"""Lessons from an episode: rules, orders of goals, methods, choices, and the record of known rules.

The record counts, for each kind of goal, the goals that known rules achieve without search. New rules follow from the plan
by goal regression (`confab.planner.experience.regression`). The plan is also replayed: in each state, the applicable rule
instance with the plan's step counts as chosen, and the other applicable instances count as passed over. `teach` also plans
with the goals in other orders, because one plan doesn't show whether an order is required.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

from confab.planner.experience.advice import Advisor
from confab.planner.experience.evidence import FactReader, fillers
from confab.planner.experience.following import by_rules, rules_in
from confab.planner.experience.instances import RuleInstance
from confab.planner.experience.regression import PlanTrace
from confab.planner.hierarchical import planner as fast
from confab.planner.hierarchical.call import Call, Compiled, compiled
from confab.planner.hierarchical.methods import Methods, Roles
from confab.planner.hierarchical.workspace import Keep
from confab.planner.plan import Limits, Plan, Step
from confab.planner.transitions import Cell, Change, arguments_of
from confab.reasoner.limits import LimitError, check
from confab.reasoner.memory.experience import (
    ITSELF,
    Experience,
    GoalKind,
    Ground,
    LearnedRule,
    LearningError,
    Lesson,
    Method,
    RoleFact,
    Tally,
)
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import Symbol

SINGLE, OTHERS = 6, 2
"""Maximum number of goals that are taught separately, and maximum number of additional orders of all goals."""
SHORT = Limits(expansions=20_000, seconds=20.0)
"""Limits of one planning call during learning."""
CHOSEN, PASSED, FAILED = Tally(chosen=1), Tally(passed_over=1), Tally(failed=1)
"""Counts of a single case in which an instance or individual was chosen, was passed over, or failed."""


def teach(experience: Experience, problem: Problem, plan: Plan | None = None) -> Plan | None:
    """Learn to solve a problem, with its goals in several orders and separately; return the given or found plan, or None."""
    using = compiled(problem)
    plan = plan or fast.plan(problem, limits=SHORT, using=using).plan
    if plan is None:
        return None
    lesson = record(experience, problem, using)
    for variant in variants(problem):
        found = fast.plan(variant, limits=SHORT, using=using, improve=0).plan
        if found is not None:
            lesson += rules_and_methods(variant, found, using)
    rules = [one for one in lesson.said if isinstance(one, LearnedRule)]
    lesson += learned(experience, problem, plan, using, rules=rules)
    lesson.personal.clear()  # the planner's own choices aren't counted as preferences
    experience.learn(with_first_record(experience, lesson, problem, using))
    return plan


def variants(problem: Problem) -> Iterator[Problem]:
    """Yield the unchanged problem, then the problem with its goals in other orders, then with single goals."""
    goals = list(problem.goal.items())
    yield problem
    if len(goals) > 1:
        half = len(goals) // 2
        for order in (goals[::-1], goals[half:] + goals[:half])[:OTHERS]:
            yield replace(problem, goal=dict(order))
        for goal in goals[:: max(1, len(goals) // SINGLE)][:SINGLE]:
            yield replace(problem, goal=dict([goal]))


def live(
    experience: Experience,
    parts: Iterable[tuple[Problem, Plan]],
    failed: tuple[int, ...] | None = None,
    failures: Iterable[tuple[Problem, Step, Sequence[int]]] = (),
) -> None:
    """Learn from the executed plans of one episode, each with a problem whose initial state is the state before the plan.

    `failed` is the path of the step of the plan that failed, before later steps were tried. `failures` are other steps of the most
    abstract level that failed, each with its problem, and the path of its failed sub-step.

    Raises
    ------
    LearningError
        The preconditions of a step don't hold in the state before the step. The experience is unchanged.
    """
    lesson = Lesson()
    for problem, plan in parts:
        using = compiled(problem)
        own = record(experience, problem, using) if failed is None else Lesson()
        own += learned(experience, problem, plan, using, failed)
        lesson += with_first_record(experience, own, problem, using) if failed is None else own
    for there, step, path in failures:
        lesson += lesson_of_failure(experience, there, step, path[1:], compiled(there))
    experience.learn(lesson)


def grounds(steps: Sequence[Step]) -> list[Ground]:
    """Return the behaviour name and the arguments of each step; each of several steps that are refined together is listed."""
    return [(one.behavior, one.arguments) for step in steps for one in step.together]


def changes(call: Call, ground: Ground) -> tuple[tuple[str, ...], Sequence[Change]]:
    """Return the individuals that the current state assigns to a behaviour's variables, and the behaviour's changes.

    Raises
    ------
    LearningError
        The preconditions of the behaviour don't hold.
    """
    done = call.space.forward[ground[0]](*ground[1])
    if done is None:
        raise LearningError(f"{' '.join((ground[0], *ground[1]))}: its preconditions don't hold there")
    return done


def on_one_level(steps: Sequence[Step]) -> list[Step]:
    """Return steps of the lowest level in place of others, since refinements also change symbols that upper levels don't see."""
    found, lowest = list(steps), max((step.level for step in steps), default=0)
    while any(step.level < lowest for step in found):
        found = [inner for step in found for inner in (step.steps if step.level < lowest else (step,))]
        lowest = max((step.level for step in found), default=0)
    return found


def carry_out(call: Call, step: Step) -> None:
    """Apply the refinement of a step, including the changes that the step's level doesn't see."""
    for inner in step.steps:
        carry_out(call, inner)
    if not step.steps:
        call.space.apply(changes(call, (step.behavior, step.arguments))[1])


def with_first_record(experience: Experience, lesson: Lesson, problem: Problem, using: Compiled) -> Lesson:
    """Return a lesson, with the record of how its rules solve the problem if `experience` has no rules yet."""
    if not rules_in(experience):
        alone = Experience("alone")
        alone.learn(lesson)
        lesson += record(alone, problem, using)
    return lesson


def record(experience: Experience, problem: Problem, using: Compiled) -> Lesson:
    """Return the record of the known rules on a problem: the goals that the rules achieve without search."""
    memory = Advisor(experience)
    call = Call(problem, memory.warmed(using), None, SHORT.expansions)
    policy = memory.policy(call)
    lesson, open_ = Lesson(), policy.open()
    with suppress(LimitError):
        by_rules(policy)
    check("learning")  # if the rules had no time, the record would count failures
    for cell in open_:
        kinds = {rule.goals for rule in policy.instances.rules.get((call.program.levels[0], cell[0]), ())}
        lesson.counted += [
            (kind, ITSELF, CHOSEN if call.met(cell) else FAILED) for kind in kinds if about(kind, cell, problem)
        ]
    return lesson


def about(kind: GoalKind, cell: Cell, problem: Problem) -> bool:
    """Return whether a goal belongs to a kind of goals."""
    return kind.situation == cell[0] and all(
        individual in problem.members(of) or individual == of
        for individual, of in zip(arguments_of(cell[1]), kind.classes, strict=True)
    )


def learned(
    experience: Experience,
    problem: Problem,
    plan: Plan,
    using: Compiled,
    failed: tuple[int, ...] | None = None,
    rules: Sequence[LearnedRule] = (),
) -> Lesson:
    """Return the lesson of a plan: rules, orders, methods, chosen individuals, and individuals passed over."""
    steps = list(plan.steps)
    at = next((i for i, step in enumerate(steps) if failed and failed[:1] == step.path[:1]), None)
    if at is not None:
        return lesson_of_failure(experience, problem, steps[at], (failed or ())[1:], using, steps[:at])
    lesson = rules_and_methods(problem, plan, using)
    own = [rule for rule in lesson.said if isinstance(rule, LearnedRule)]
    lesson += chosen([*rules, *own], experience, problem, steps, using)
    return lesson


def rules_and_methods(problem: Problem, plan: Plan, using: Compiled) -> Lesson:
    """Return the rules, orders and methods of a plan and of the refinements of its steps."""
    trace = PlanTrace(problem, grounds(on_one_level(plan.steps)))
    lesson = Lesson(said=list(trace.rules_of()))
    lesson.counted += [(order, ITSELF, CHOSEN) for order in trace.orders()]
    lesson += refined(Call(problem, using, None, SHORT.expansions), plan.steps)
    return lesson


def refined(call: Call, steps: Iterable[Step]) -> Lesson:
    """Apply steps; return, for each refined step, the method, the individuals in the method's roles, and the rules.

    The joint refinement of several steps yields neither a method nor a rule for any of these steps.
    """
    lesson = Lesson()
    for step in steps:
        check("learning")
        if step.joined:
            lesson += refined(call, step.steps)
            continue
        mark = len(call.table.trail)
        bindings, made = changes(call, (step.behavior, step.arguments))
        if not step.steps:
            call.space.apply(made)
            continue
        targets = call.refiner.targets(step.level, made)
        method, roles = method_of(call.refiner.methods, step, (*step.arguments, *bindings))
        lesson.counted.append((method, ITSELF, CHOSEN))
        lesson.personal += taken(call, method, roles)
        lesson += refined(call, step.steps)
        if len({inner.level for inner in step.steps}) == 1:
            keep = call.space.refining(step.level)
            rules = list(trace_of(call, mark, targets, keep, grounds(step.steps)).rules_of())
            lesson.said += rules
            lesson.counted += [(rule, ITSELF, CHOSEN) for rule in rules]
    return lesson


def taken(call: Call, method: Method, roles: Roles) -> Iterator[tuple[Method, RoleFact, Tally]]:
    """Yield the individuals in the open roles of a method as chosen; yield other possible individuals as passed over.

    Another individual is possible if the steps of the method are applicable with this individual.
    """
    own = fillers(method, roles, call.problem)
    yield from ((method, fact, CHOSEN) for fact in own)
    for place, role in enumerate(method.open, method.roles) if own else ():
        for other in call.problem.classes[role.kind] if role.source is None else ():
            instead = (*roles[:place], other, *roles[place + 1 :])
            if possible(call, method, instead):
                yield from ((method, f, PASSED) for f in fillers(method, instead, call.problem) if f not in own)


def possible(call: Call, method: Method, roles: Roles) -> bool:
    """Return whether the steps of a method are applicable in the current state; refinements aren't tested."""
    mark, left = len(call.table.trail), len(method.steps)
    for name, arguments in call.refiner.methods.filled(method, roles):
        done = call.space.forward[name](*arguments)
        if done is None:
            break
        call.space.apply(done[1])
        left -= 1
    call.table.undo(mark)
    return not left


def trace_of(call: Call, mark: int, targets: Mapping[Cell, str], keep: Keep, done: Sequence[Ground]) -> PlanTrace:
    """Return the trace of a level's steps since a marked state, whose goals are the targets and the values to be kept."""
    before, state = call.table.before(mark), call.table.state()
    goal = {}
    for cell, first in before.items():
        symbol = Symbol(cell[0], arguments_of(cell[1]))
        state[symbol] = first
        wanted = targets.get(cell) or keep(cell, first)
        if wanted is not None:
            goal[symbol] = wanted
    for cell in targets.keys() - before.keys():
        goal[Symbol(cell[0], arguments_of(cell[1]))] = targets[cell]
    return PlanTrace(replace(call.problem, initial=state, goal=goal), done)


def method_of(methods: Methods, step: Step, own: tuple[str, ...]) -> tuple[Method, Roles]:
    """Return a step's refinement as a method, and the individual of each role, None where the current state determines it."""
    method = methods.lifted(step.behavior, grounds(step.steps), own)
    filled = dict(zip(range(len(own)), own, strict=True))
    for (_, places), (_, arguments) in zip(method.steps, grounds(step.steps), strict=True):
        filled.update(zip(places, arguments, strict=True))
    determined = {place for place, role in enumerate(method.open, len(own)) if role.source is not None}
    return method, tuple(
        [None if place in determined else filled[place] for place in range(len(own) + len(method.open))]
    )


def chosen(
    rules: Iterable[LearnedRule], experience: Experience, problem: Problem, steps: Sequence[Step], using: Compiled
) -> Lesson:
    """Return the chosen and the passed-over rule instances of a plan, among instances of known and given rules.

    If steps are refined together, the changes that each step states are applied before the choice of the next step.
    """
    call = Call(problem, using, None, SHORT.expansions)
    policy = Advisor(experience).policy(call, also=rules)
    reader = FactReader(using.program, call.table, call.goal)
    lesson = Lesson()
    later = grounds(steps)
    for step in steps:
        mark = len(call.table.trail)
        for ground in grounds([step]):
            check("learning")
            del later[0]
            open_ = policy.open() if problem.domain.behaviors[ground[0]].level == policy.first else {}
            ready = {cell: value for cell, value in open_.items() if not policy.waits(cell)}
            applicable = list(policy.every(ready)) or list(policy.every(open_))
            done = [c for c in applicable if c.ground == ground]
            if done:
                rest = set(later)
                passed = {c.ground: c for c in applicable if c.ground != ground and c.ground not in rest}
                lesson += compared(reader, done, list(passed.values()))
            if step.joined:
                call.space.apply(changes(call, ground)[1])
        if step.joined:
            call.table.undo(mark)
        carry_out(call, step)
    return lesson


def counts_of(reader: FactReader, c: RuleInstance, tally: Tally) -> Iterator[tuple[LearnedRule, RoleFact, Tally]]:
    """Yield a tally for the rule of an instance, and for each fact about the individuals in the rule's roles."""
    return ((c.rule, fact, tally) for fact in (ITSELF, *reader.facts(c.rule, c.roles)))


def compared(reader: FactReader, done: Sequence[RuleInstance], passed: Sequence[RuleInstance]) -> Lesson:
    """Return the lesson of a choice: the cases of chosen and of passed-over rule instances."""
    lesson = Lesson()
    for c in {c.rule.name: c for c in done}.values():
        lesson.counted += counts_of(reader, c, CHOSEN)
    for c in passed:
        lesson.counted += counts_of(reader, c, PASSED)
    for c in done:
        for other in passed:
            different = [
                (a, b)
                for a, b in zip(
                    reader.individuals(c.rule, c.roles), reader.individuals(other.rule, other.roles), strict=False
                )
                if a != b
            ]
            if c.rule == other.rule and len(different) == 1:
                lesson.personal += [(c.rule, different[0][0], CHOSEN), (other.rule, different[0][1], PASSED)]
    return lesson


def lesson_of_failure(
    experience: Experience,
    problem: Problem,
    step: Step,
    path: Sequence[int],
    using: Compiled,
    before: Sequence[Step] = (),
) -> Lesson:
    """Return the lesson of a step whose sub-step with the given path failed.

    The lesson counts one failure for each of these: the rules that would have chosen the step, the facts about the individuals in
    the rules' roles, and the individuals in the step's refinement. Steps that are refined together teach nothing, since any of them
    may have caused the failure.
    """
    call = Call(problem, using, None, SHORT.expansions)
    policy = Advisor(experience).policy(call)
    for earlier in before:
        carry_out(call, earlier)
    reader = FactReader(using.program, call.table, call.goal)
    lesson = Lesson()
    wanted = (step.behavior, step.arguments)
    for c in policy.every(policy.open()):
        if c.ground == wanted and not step.joined:
            lesson.counted += counts_of(reader, c, FAILED)
            lesson.personal += [(c.rule, fact, PASSED) for fact in reader.individuals(c.rule, c.roles)]
    for number in (*path, 0):
        done = call.space.forward[step.behavior](*step.arguments)
        if done is None or step.joined or number >= len(step.steps):
            break
        method, roles = method_of(call.refiner.methods, step, (*step.arguments, *done[0]))
        failed = [(method, fact, FAILED) for fact in fillers(method, roles, problem)]
        lesson.personal += failed
        lesson.counted += [] if failed else [(method, ITSELF, FAILED)]  # other individuals might have succeeded
        for earlier in step.steps[:number]:
            with suppress(LearningError):
                carry_out(call, earlier)
        step = step.steps[number]
    return lesson

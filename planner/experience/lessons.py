"""What an episode teaches: rules, the order of goals, methods, and how good what was known before proved.

steps      of a plan, each with its refinement
before     what is known already is tried first: which goals it reaches by itself is its record, for each kind of goal
regress    the plan becomes rules (`confab.planner.experience.regression`)
replay     where rules apply, that which the plan did was chosen and the others passed over, with the facts of each
orders     a teacher plans for the same goals in other orders, too: only what is the same in all of them must be so
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

from confab.planner.experience.advice import Memory
from confab.planner.experience.evidence import View, fillers
from confab.planner.experience.following import Candidate, by_rules, rules_in
from confab.planner.experience.regression import Course
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
    Fact,
    GoalKind,
    Ground,
    LearningError,
    Lesson,
    Method,
    Rule,
    Tally,
)
from confab.reasoner.symbols import Problem, Symbol

SINGLE, OTHERS = 6, 2
"""So many goals are taught one by one, and so many other orders of all."""
SHORT = Limits(expansions=20_000, seconds=20.0)
"""Of planning one lesson."""
CHOSEN, PASSED, FAILED = Tally(chosen=1), Tally(passed_over=1), Tally(failed=1)
"""What one case adds."""


def teach(experience: Experience, problem: Problem, plan: Plan | None = None) -> Plan | None:
    """Learn how a problem is solved, with its goals in several orders and one by one; return the plan, None if there is none.

    Parameters
    ----------
    experience : Experience
    problem : Problem
    plan : Plan, optional
        Made if left out.
    """
    using = compiled(problem)
    plan = plan or fast.plan(problem, limits=SHORT, using=using).plan
    if plan is None:
        return None
    lesson = tried(experience, problem, using)
    for variant in variants(problem):
        found = fast.plan(variant, limits=SHORT, using=using, improve=0).plan
        if found is not None:
            lesson += shows(variant, found, using)
    rules = [one for one in lesson.said if isinstance(one, Rule)]
    lesson += learned(experience, problem, plan, using, rules=rules)
    lesson.personal.clear()  # whom a planner took is no preference
    experience.learn(shown(experience, lesson, problem, using))
    return plan


def variants(problem: Problem) -> Iterator[Problem]:
    """Yield the problem as it is, with its goals in other orders, and with some of its goals alone."""
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
    problem: Problem,
    plan: Plan,
    failed: tuple[int, ...] | None = None,
    vain: Iterable[tuple[Problem, Step, Sequence[int]]] = (),
) -> None:
    """Learn from a plan that was carried out.

    Parameters
    ----------
    experience : Experience
    problem : Problem
        Its initial state is where the plan began.
    plan : Plan
    failed : path of a step, optional
        It failed; what comes after it wasn't tried.
    vain : iterable of (problem, step, path)
        Other steps of the most abstract level that failed, each with the state in which it was begun, and what of it failed.

    Raises
    ------
    LearningError
        A step's preconditions don't hold where it is done; nothing is learned then.
    """
    using = compiled(problem)
    lesson = tried(experience, problem, using) if failed is None and plan.steps else Lesson()
    if plan.steps:
        lesson += learned(experience, problem, plan, using, failed)
        lesson = shown(experience, lesson, problem, using) if failed is None else lesson
    for there, step, path in vain:
        lesson += in_vain(experience, there, step, path[1:], using)
    experience.learn(lesson)


def grounds(steps: Sequence[Step]) -> list[Ground]:
    """Return steps as behaviours with their arguments."""
    return [(step.behavior, step.arguments) for step in steps]


def changes(call: Call, ground: Ground) -> tuple[tuple[str, ...], Sequence[Change]]:
    """Return whom a behaviour binds now, and what it changes.

    Raises
    ------
    LearningError
        Its preconditions don't hold.
    """
    done = call.space.forward[ground[0]](*ground[1])
    if done is None:
        raise LearningError(f"{' '.join((ground[0], *ground[1]))}: its preconditions don't hold there")
    return done


def on_one_level(steps: Sequence[Step]) -> list[Step]:
    """Return steps, in the place of those above the lowest level their refinement: they don't see all that it changes."""
    found, lowest = list(steps), max((step.level for step in steps), default=0)
    while any(step.level < lowest for step in found):
        found = [inner for step in found for inner in (step.steps if step.level < lowest else (step,))]
        lowest = max((step.level for step in found), default=0)
    return found


def carry_out(call: Call, step: Step) -> None:
    """Do a step by its refinement, which changes what the step doesn't see."""
    for inner in step.steps:
        carry_out(call, inner)
    if not step.steps:
        call.space.apply(changes(call, (step.behavior, step.arguments))[1])


def shown(experience: Experience, lesson: Lesson, problem: Problem, using: Compiled) -> Lesson:
    """Return a lesson with what it shows on its own problem, where nothing was known before: that is all that it has shown."""
    if not rules_in(experience):
        alone = Experience("alone")
        alone.learn(lesson)
        lesson += tried(alone, problem, using)
    return lesson


def tried(experience: Experience, problem: Problem, using: Compiled) -> Lesson:
    """Return how good what is known proves on a problem: which of its goals it reaches by itself."""
    memory = Memory(experience)
    call = Call(problem, memory.warmed(using), None, SHORT.expansions)
    guide = memory.guide(call)
    lesson, open_ = Lesson(), guide.open()
    with suppress(LimitError):
        by_rules(guide)
    check("learning")  # without time for its rules nothing is shown
    for cell in open_:
        kinds = {rule.goals for rule in guide.rules.get((call.program.levels[0], cell[0]), ())}
        lesson.counted += [
            (kind, ITSELF, CHOSEN if call.met(cell) else FAILED) for kind in kinds if about(kind, cell, problem)
        ]
    return lesson


def about(kind: GoalKind, cell: Cell, problem: Problem) -> bool:
    """Whether a goal is of a kind."""
    return kind.situation == cell[0] and all(
        who in problem.members(of) or who == of for who, of in zip(arguments_of(cell[1]), kind.classes, strict=True)
    )


def learned(
    experience: Experience,
    problem: Problem,
    plan: Plan,
    using: Compiled,
    failed: tuple[int, ...] | None = None,
    rules: Sequence[Rule] = (),
) -> Lesson:
    """Return what a plan teaches: its rules and orders, its methods, and what it chose and passed over."""
    steps = list(plan.steps)
    at = next((i for i, step in enumerate(steps) if failed and failed[:1] == step.path[:1]), None)
    if at is not None:
        return in_vain(experience, problem, steps[at], (failed or ())[1:], using, steps[:at])
    lesson = shows(problem, plan, using)
    own = [rule for rule in lesson.said if isinstance(rule, Rule)]
    lesson += chosen([*rules, *own], experience, problem, steps, using)
    return lesson


def shows(problem: Problem, plan: Plan, using: Compiled) -> Lesson:
    """Return the rules and orders of a plan's steps, and those of their refinements with the methods."""
    course = Course(problem, grounds(on_one_level(plan.steps)))
    lesson = Lesson(said=list(course.rules_of()))
    lesson.counted += [(order, ITSELF, CHOSEN) for order in course.orders()]
    lesson += refined(Call(problem, using, None, SHORT.expansions), plan.steps)
    return lesson


def refined(call: Call, steps: Iterable[Step]) -> Lesson:
    """Do steps, and return how each was refined: the method, who was taken for it, and the rules."""
    lesson = Lesson()
    for step in steps:
        check("learning")
        mark = len(call.table.trail)
        bindings, made = changes(call, (step.behavior, step.arguments))
        if not step.steps:
            call.space.apply(made)
            continue
        targets = call.refiner.targets(made)
        method, roles = method_of(call.refiner.methods, step, (*step.arguments, *bindings))
        lesson.counted.append((method, ITSELF, CHOSEN))
        lesson.personal += taken(call, method, roles)
        lesson += refined(call, step.steps)
        if len({inner.level for inner in step.steps}) == 1:
            keep = call.space.refining(step.level)
            rules = list(course(call, mark, targets, keep, grounds(step.steps)).rules_of())
            lesson.said += rules
            lesson.counted += [(rule, ITSELF, CHOSEN) for rule in rules]
    return lesson


def taken(call: Call, method: Method, roles: Roles) -> Iterator[tuple[Method, Fact, Tally]]:
    """Yield who was taken for the open roles of a method, and who was passed over that the next level would have let do it."""
    own = fillers(method, roles, call.problem)
    yield from ((method, fact, CHOSEN) for fact in own)
    for place, role in enumerate(method.open, method.roles) if own else ():
        for other in call.problem.classes[role.kind] if role.source is None else ():
            instead = (*roles[:place], other, *roles[place + 1 :])
            if possible(call, method, instead):
                yield from ((method, f, PASSED) for f in fillers(method, instead, call.problem) if f not in own)


def possible(call: Call, method: Method, roles: Roles) -> bool:
    """Return whether the steps of a method could be done now, however they are refined."""
    mark, left = len(call.table.trail), len(method.steps)
    for name, arguments in call.refiner.methods.filled(method, roles):
        done = call.space.forward[name](*arguments)
        if done is None:
            break
        call.space.apply(done[1])
        left -= 1
    call.table.undo(mark)
    return not left


def course(call: Call, mark: int, targets: Mapping[Cell, str], keep: Keep, done: Sequence[Ground]) -> Course:
    """Return steps of a level, done since a mark, as a way from the state there to what they should leave."""
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
    return Course(replace(call.problem, initial=state, goal=goal), done)


def method_of(methods: Methods, step: Step, own: tuple[str, ...]) -> tuple[Method, Roles]:
    """Return a step's refinement over roles, and the individuals in these, None where the table told."""
    method = methods.lifted(step.behavior, grounds(step.steps), own)
    who = dict(zip(range(len(own)), own, strict=True))
    for (_, places), inner in zip(method.steps, step.steps, strict=True):
        who.update(zip(places, inner.arguments, strict=True))
    told = {place for place, role in enumerate(method.open, len(own)) if role.source is not None}
    return method, tuple([None if place in told else who[place] for place in range(len(own) + len(method.open))])


def chosen(
    rules: Iterable[Rule], experience: Experience, problem: Problem, steps: Sequence[Step], using: Compiled
) -> Lesson:
    """Return what a plan chose where what is known, and some rules, applied: what it did of that, and what it passed over."""
    call = Call(problem, using, None, SHORT.expansions)
    guide = Memory(experience).guide(call, also=rules)
    view = View(using.program, call.table, call.goal)
    later = grounds(steps)
    lesson = Lesson()
    for number, ground in enumerate(later):
        check("learning")
        open_ = guide.open() if problem.domain.behaviors[ground[0]].level == guide.first else {}
        ready = {cell: value for cell, value in open_.items() if not guide.waits(cell)}
        tried_ = list(guide.every(ready)) or list(guide.every(open_))
        done = [c for c in tried_ if c.ground == ground]
        if done:
            rest = set(later[number + 1 :])
            passed = {c.ground: c for c in tried_ if c.ground != ground and c.ground not in rest}
            lesson += compared(view, done, list(passed.values()))
        carry_out(call, steps[number])
    return lesson


def judged(view: View, c: Candidate, tally: Tally) -> Iterator[tuple[Rule, Fact, Tally]]:
    """Yield what is counted of a rule that was followed, and of what held of who was in its roles."""
    return ((c.rule, fact, tally) for fact in (ITSELF, *view.facts(c.rule, c.roles)))


def compared(view: View, done: Sequence[Candidate], passed: Sequence[Candidate]) -> Lesson:
    """Return what is counted where these were chosen and those passed over."""
    lesson = Lesson()
    for c in {c.rule.name: c for c in done}.values():
        lesson.counted += judged(view, c, CHOSEN)
    for c in passed:
        lesson.counted += judged(view, c, PASSED)
    for c in done:
        for other in passed:
            who = [
                (a, b)
                for a, b in zip(
                    view.individuals(c.rule, c.roles), view.individuals(other.rule, other.roles), strict=False
                )
                if a != b
            ]
            if c.rule == other.rule and len(who) == 1:
                lesson.personal += [(c.rule, who[0][0], CHOSEN), (other.rule, who[0][1], PASSED)]
    return lesson


def in_vain(
    experience: Experience,
    problem: Problem,
    step: Step,
    path: Sequence[int],
    using: Compiled,
    before: Sequence[Step] = (),
) -> Lesson:
    """Return what a step teaches of which the sub-step with a path failed.

    The rules that would have chosen it, with its facts, and whom its refinement had taken.
    """
    call = Call(problem, using, None, SHORT.expansions)
    guide = Memory(experience).guide(call)
    for earlier in before:
        carry_out(call, earlier)
    view = View(using.program, call.table, call.goal)
    lesson = Lesson()
    wanted = (step.behavior, step.arguments)
    for c in guide.every(guide.open()):
        if c.ground == wanted:
            lesson.counted += judged(view, c, FAILED)
            lesson.personal += [(c.rule, fact, PASSED) for fact in view.individuals(c.rule, c.roles)]
    for number in (*path, 0):
        done = call.space.forward[step.behavior](*step.arguments)
        if done is None or number >= len(step.steps):
            break
        method, roles = method_of(call.refiner.methods, step, (*step.arguments, *done[0]))
        who = [(method, fact, FAILED) for fact in fillers(method, roles, problem)]
        lesson.personal += who
        lesson.counted += [] if who else [(method, ITSELF, FAILED)]  # others might have done it in the same way
        for earlier in step.steps[:number]:
            with suppress(LearningError):
                carry_out(call, earlier)
        step = step.steps[number]
    return lesson

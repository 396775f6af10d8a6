"""Planning in a scene: the function `plan`, and its result."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, TypeAlias, cast, overload

from confab.accepting import Facts, check_goal, check_seconds, named_for, several
from confab.checking import refused
from confab.formats import ResultJson
from confab.interchange import outcome_json
from confab.known import Known
from confab.plan_call import PlanningTask, Searching, own_request, plan_task, read_task
from confab.plan_options import PlanOptions
from confab.planner.plan import Forgone, Outcome, Plan, SoftGoal, Status, Step, paused_collection, renumbered
from confab.planner.plan_costs import stated_cost
from confab.planner.solve import DEFAULT_MODE, Mode, solve
from confab.planner.timed.plan import schedule_of
from confab.planner.validation import Fault, unmet_goals, validate
from confab.reasoner.derivation import conditions_of_goal
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.kinds import PLAN
from confab.reasoner.limits import Deadline, within
from confab.reasoner.memory.links import Links
from confab.reasoner.names import RightNames, right_names
from confab.reasoner.problem import Problem
from confab.reasoner.reading.goals import with_goals
from confab.reasoner.reading.problem import Reading
from confab.reasoner.symbols import Fact
from confab.reasoner.timing import may_overlap_by_need
from confab.timing import Minimise, lanes, needs_others_meanwhile, schedule_json, with_unit_costs

if TYPE_CHECKING:
    from typing import Unpack

    from confab import execution, physics
    from confab.execution import Execution
    from confab.labels import Labels
    from confab.memory import Memory
    from confab.physics import Report
    from confab.planner.acting.episode import Event
    from confab.planner.acting.world import World
    from confab.planner.causal_links import Purpose
    from confab.planner.certificates import Certificate
    from confab.planner.timed.plan import TimedPlan
    from confab.show import PlanTree
    from confab.why import Account, Because, WhyNot


def plan(
    scene: Known,
    goals: Facts = (),
    memory: Memory | Links | str | Path | None = None,
    mode: Mode = DEFAULT_MODE,
    time_limit: float | Deadline | None = None,
    optimal: bool = False,
    observed: str | Path | None = None,
    engine: str | None = None,
    level: int | None = None,
    leave_levels: bool = True,
    minimise: Minimise | None = None,
    *,
    goal: Facts = (),
) -> Result:
    """Plan in a scene, and return the result.

    Parameters
    ----------
    scene : Scene
    goals, goal : str or iterable of str
        Facts like ``cup2 LOCATION location8``. Each goal replaces the scene's goal for the same symbol.
    memory : Memory, its file or endpoint, or Links alone in paper mode; optional
        The memory that guides the search; by default none.
    mode : str
        ``paper`` is A* with the paper's equation (5) on each level; the scene's behaviours are quantified with all individuals.
        ``guarded``, ``leading`` and ``strict`` are modes of the default planner, which reads only the individuals that the task
        can need. In ``leading``, learned rules always guide the search; in ``guarded``, only rules that have proved useful do; in
        ``strict``, no rules do. For ``optimal``, see the parameter `optimal`.
    time_limit : float or Deadline, optional
        Time limit of the call in seconds, or its deadline. Only the optimal search has a default limit, which is
        `OPTIMAL_SECONDS`.
    optimal : bool
        Improve the plan until it is proved optimal or the time limit is reached. The result has the bound that was proved. The
        optimal search can't use a memory.
    observed : str or Path, optional
        File of observed facts, which replace the scene's facts.
    engine : str, optional
        An external planner (engine) of unified-planning, e.g. ``fast-downward``. By default, an installed engine is tried if
        Confab's own search gives up and `leave_levels` is true. If an engine may be tried, Confab's own search must find a plan in
        three fifths of the time limit. Without a time limit, the engine is tried after about twenty seconds of search; if it finds
        no plan, the search starts again without a limit. With ``none``, no engine is tried.
    level : int, optional
        The level on which the engine plans; by default the lowest level.
    leave_levels : bool
        Whether steps of a lower level may replace steps of a level on which no plan can be refined. The outcome names the
        replaced parts of the plan, and the violated conditions of the upper level.
    minimise : str, optional
        With ``makespan``, the plan gets a schedule (`Result.timed`), in which equivalent actors may be exchanged. ``cost`` is the
        same as `optimal`. ``steps`` is the optimal search with a cost of 1 for every step. By default, the plan needn't be
        minimal.

    Raises
    ------
    KnowledgeError
        A goal mentions terms that the scene doesn't have, the mode is unknown, or options exclude each other.
    LimitError
        The time limit passed before the search began. If the limit passes during the search, the status of the outcome is "gave
        up".
    """
    facts = [*several(goals), *several(goal)]
    for word in (fact for fact in facts if " " not in fact.strip()):
        raise KnowledgeError(f"the goal '{word}' is no fact; wanted one text, 'object SITUATION value'")
    options = PlanOptions(memory, mode, time_limit, optimal, observed, engine, level, leave_levels, minimise)
    return plan_by(scene, facts, options)


def plan_by(scene: Known, goals: list[str], options: PlanOptions, choosing: bool = True) -> Result:
    """Plan in a scene with validated options; without `choosing`, only for the hard goals and `goals`."""
    scene.settle()
    scene.knowledge.require_whole()
    with within(options.limit) as deadline, paused_collection():
        memory = options.memory
        if isinstance(memory, str | Path):
            from confab.memory import Memory

            memory = Memory.load(memory, scene)
        if memory is not None and not isinstance(memory, Links) and not hasattr(memory, "advisor"):
            raise KnowledgeError(
                f"memory={memory!r} is no memory; wanted a file's name, Memory.load(FILE) or Memory.of(SCENE)"
            )
        begin, asked = perf_counter(), scene.knowledge.round_trips
        task = read_task(scene, goals, memory, options, deadline)
        quantified = perf_counter() - begin
        check_goal(scene.iri, task.problem)
        found = plan_task(replace(task, choosing=choosing))
        outcome = replace(found.outcome, seconds=perf_counter() - begin - quantified)
        seconds = {**scene.seconds, "quantify": quantified}
        queries = scene.knowledge.round_trips - asked
        return Result(
            scene, found.problem, outcome, seconds, queries, found.part, tuple(goals), found.timed, found.optimal,
            replace(options, memory=memory),
        )  # fmt: skip


def result_of(scene: Known, plan: Plan, goals: Facts = ()) -> Result:
    """Return the result of a planning call that found a given plan.

    Parameters
    ----------
    scene : Scene
    plan : Plan
        The plan, which may leave soft goals unmet.
    goals : str or iterable of str
        The goals of the plan. Each goal replaces the scene's goal for the same symbol.

    Raises
    ------
    KnowledgeError
        The plan isn't valid in the scene; the message has the first fault.
    """
    texts = tuple(several(goals))
    task = problem = with_goals(scene.problem, texts)
    penalty, forgone = None, list[Forgone]()
    if not needs_others_meanwhile(problem):
        unmet = task.weights.keys() & unmet_goals(task, plan)
        problem = task.only(unmet)
        if faults := validate(problem, plan):
            alone = "; its steps are read without their times: if they have to overlap, plan again"
            raise KnowledgeError(
                f"the plan isn't valid in this scene with these goals: {faults[0].text}"
                f"{alone if may_overlap_by_need(problem) else ''}"
            )
        left = [Fact(one, task.goal[one]) for one in task.weights if one in unmet]
        forgone = [
            Forgone(one, task.weights[one.symbol], None, conditions_of_goal(task.domain, one.symbol)) for one in left
        ]
        penalty = sum((one.weight for one in forgone), Fraction(0)) if task.weights else None
    outcome = Outcome(Status.SOLVED, plan, cost=stated_cost(problem, plan), penalty=penalty, forgone=tuple(forgone))
    return Result(scene, problem, outcome, dict(scene.seconds), goals=texts)


class NoPlanError(KnowledgeError):
    """Raised if a plan is needed and planning found none; `status` is the status of planning."""

    def __init__(self, message: str, status: str = "") -> None:
        super().__init__(message)
        self.status = status


AnyStep: TypeAlias = "int | str | tuple[int, ...] | tuple[str, ...] | Step"
"""The notations of a step of a plan; `Result.why` describes them."""


@right_names("a result", "scene.plan()")
@dataclass
class Result(metaclass=RightNames):
    """The result of planning: the outcome, with the plan if one was found, and the scene of the call.

    `problem` has the individuals that the task can need. `queries` is the number of queries to the store. `part` is the part of
    the scene from which the problem was read; it is None for the whole scene. `goals` are the given goals, which replaced goals
    of the task for the same symbols. `optimal` states whether the search looked for an optimal plan. `options` are the options of
    the call; alternatives are planned with the same options.
    """

    scene: Known = field(compare=False)
    problem: Problem
    outcome: Outcome
    seconds: dict[str, float]
    queries: int = 0
    part: Reading | None = field(default=None, compare=False)
    goals: tuple[str, ...] = ()
    timed: TimedPlan | None = None
    optimal: bool = False
    options: PlanOptions = field(default=PlanOptions(), compare=False)

    def faults(self, plan: Plan) -> list[Fault]:
        """Return the faults that a plan for the same task has in the whole scene; the list is empty if the plan is valid."""
        faults = validate(self.problem, plan)
        if faults or self.part is None:
            return faults
        return refused(self.scene.knowledge, self.part, plan, self.goals, self.outcome.unmet)

    @property
    def plan(self) -> Plan:
        """The plan. If there is no plan, a `NoPlanError` with the reason is raised."""
        if self.outcome.plan is None:
            status, reason = self.outcome.status.value, self.outcome.reason
            raise NoPlanError(f"there is no plan ({status}): {reason.text if reason else ''}", status)
        return self.outcome.plan

    @property
    def task(self) -> Problem:
        """The task in the whole scene: all goals of the call, the observed facts, and the measured durations."""
        stated, own = with_goals(self.scene.reading.problem, self.goals), self.problem
        times = own.times and replace(
            stated.times or own.times, measured=own.times.measured, of_actors=own.times.of_actors
        )
        return replace(stated, initial=own.initial if self.part is None else stated.initial, times=times)

    @property
    def soft_goals(self) -> tuple[SoftGoal, ...]:
        """The soft goals of the task, the heaviest first."""
        task, met = with_goals((self.part or self.scene.reading).problem, self.goals), self.problem.goal
        found = [SoftGoal(Fact(s, task.goal[s]), weight, s in met) for s, weight in task.weights.items()]
        return tuple(sorted(found, key=lambda one: (-one.weight, one.fact.symbol)))

    def __bool__(self) -> bool:
        """Return whether there is a plan."""
        return self.solved

    def __iter__(self) -> Iterator[Step]:
        """Yield the steps of the plan's first level."""
        return iter(self.plan)

    def __len__(self) -> int:
        """Return the number of steps of the plan's first level."""
        return len(self.plan)

    def __getitem__(self, index: AnyStep) -> Step:
        """Return the step of the plan that an index names in one of the notations of `why`.

        A negative number counts from the end.
        """
        from confab.why import find_step

        return self.plan[index] if isinstance(index, int) else find_step(self.plan, index, self.labels)

    def in_order(self, *ids: int) -> Plan:
        """Return the plan with its first-level steps in another order, for example the order of a demonstration.

        Raises
        ------
        KnowledgeError
            `ids` doesn't contain the ID of each first-level step exactly once, or the steps can't be executed in this order.

        Examples
        --------
        >>> import confab
        >>> [step.id for step in confab.load("beverage-serving").plan().in_order(22, 34, 28, 39).steps]
        [22, 34, 28, 39]
        """
        waiting = list(self.plan.steps)
        there = [step.id for step in waiting]
        if sorted(there) != sorted(ids):
            raise KnowledgeError(
                f"wanted {', '.join(map(str, there))} in another order; got {', '.join(map(str, ids)) or 'nothing'}"
            )
        steps = [waiting.pop(next(i for i, step in enumerate(waiting) if step.id == wanted)) for wanted in ids]
        plan = Plan(renumbered(steps))
        if faults := self.faults(plan):
            raise KnowledgeError(f"the plan can't be done in that order: {faults[0].text}")
        return plan

    def verify(self, rollouts: int = 1, seed: int = 0, **options: Unpack[physics.VerifyKeywords]) -> Report:
        """Verify the plan in PyBullet (`confab.physics.verify`)."""
        from confab.physics import verify

        self.scene.settle()
        options.setdefault("goal", self.problem.goal)
        return verify(self.scene, self.plan, rollouts, seed, **options)

    def execute(
        self,
        interventions: Facts = (),
        world: str | World = "symbolic",
        memory: Memory | Links | str | Path | None = None,
        mode: Mode = DEFAULT_MODE,
        seed: int = 0,
        observer: Callable[[Event], None] | None = None,
        watch: bool = False,
        time_limit: float | None = None,
        **options: Unpack[execution.ExecuteKeywords],
    ) -> Execution:
        """Execute the task in a closed loop, beginning with this plan (`Scene.execute`)."""
        from confab.execution import carry_out

        return carry_out(
            self.scene, self, interventions, world, (), memory, mode, seed, observer, watch, time_limit, **options
        )

    @cached_property
    def labels(self) -> Labels:
        """The labels of the problem's behaviours, situation types and individuals."""
        from confab.labels import labels_of

        return labels_of(self.scene.knowledge, self.scene.names, self.problem)

    @cached_property
    def purposes(self) -> dict[tuple[int, ...], Purpose]:
        """The causal links of each step, by the step's path (`confab.planner.causal_links`)."""
        from confab.planner.causal_links import purposes

        if not self._in_sequence:
            raise KnowledgeError("steps of this plan must overlap; reasons are given for sequences of steps only")
        return purposes(self.problem, self.plan)

    @property
    def _in_sequence(self) -> bool:
        """Whether the steps can be executed one after another; otherwise some steps must overlap."""
        return schedule_of(self.outcome) is None and not needs_others_meanwhile(self.problem)

    def why(self, step: AnyStep) -> Because:
        """Return why a step is in the plan: the step's effects, and the steps and goals that need these effects.

        Parameters
        ----------
        step : Step, int, str or path
            The step in one of these notations, in which steps are counted from 0: the number of a first-level step; ``L3#12`` for
            step 12 of level 3; a path like ``0.1.2``; or words of the step, as one text or as a tuple.

        Examples
        --------
        >>> import confab
        >>> confab.load("beverage-serving").plan().why("pick cup 1")
        L2#0  pick cup 1 with left hand
          gives   left hand holds cup 1 (before: nothing)
          gives   cup 1 is in a hand (before: location 2)
          because “place cup 1 in left hand to location 7” (L2#1) requires that left hand holds cup 1
        """
        from confab.why import because, find_step

        found = find_step(self.plan, step, self.labels)
        return because(self.plan, found, self.purposes[found.path], self.labels)

    def why_not(
        self, asked: str | tuple[str, ...] | Step, instead: AnyStep | None = None, seconds: float | None = None
    ) -> WhyNot:
        """Return why an alternative isn't in the plan.

        The answer has the failing conditions of the alternative, or a plan with the alternative and the additional cost of this
        plan. This plan is made with the options of this result, and for the soft goals that the present plan meets. If no such
        plan is found, the planner chooses the soft goals anew. The answer names the soft goals that only one of both plans meets.

        Parameters
        ----------
        asked : str, words or Step
            The alternative. An alternative is a goal like ``cup2 LOCATION location8`` or ``cup2 LOCATION location8 by
            left_hand``, or a behaviour like ``B2_PICK right_hand cup1`` or ``B2_PICK hand=right_hand``.
        instead : Step, int, str or path, optional
            The step that the behaviour would replace. By default, it is the most similar step in whose place the behaviour is
            applicable.
        seconds : float, optional
            Time limit of the whole call.
        """
        from confab.why import BY, find_step, why_not

        if isinstance(seconds, str):
            raise KnowledgeError(
                "the alternative is one text, e.g. why_not('cup2 LOCATION location8'), or a tuple of words"
            )
        check_seconds("seconds", seconds)
        words = " ".join(several(str(asked) if isinstance(asked, Step) else asked)).split()
        if words[:1] and words[0].isdecimal():  # the text of a step begins with its ID
            words = words[1:]
        if "+" in words:  # the text of steps that are refined together; the question is about the first
            words = words[: words.index("+")]
        if not words:
            raise KnowledgeError("the alternative is empty; wanted a goal, or a behaviour with individuals")
        asked = " ".join(words)

        limit = self.options.time_limit
        options = replace(self.options, time_limit=limit.seconds if isinstance(limit, Deadline) else limit)

        def ask(problem: Problem) -> Outcome:
            memory = options.memory if not isinstance(options.memory, str | Path) else None
            reading, how = self.part or self.scene.reading, Searching(options.strategy)
            with within(options.limit) as deadline:
                task = PlanningTask(self.scene, [], memory, options, deadline, reading, problem, None, 0.0)
                return solve(own_request(task, problem, how, engines=False))

        def replan(goals: Sequence[str]) -> tuple[Problem, Outcome, Labels]:
            other = plan_by(self.scene, [*goals], options, choosing=not self.solved)
            met = {str(goal.fact) for goal in soft if goal.met}
            if not other.solved and (hard := [goal for goal in goals[:-1] if goal not in met]) != [*goals[:-1]]:
                other = plan_by(self.scene, [*hard, goals[-1]], options)
            other = other.in_whole_scene() if choice else other
            return priced(other.problem), other.outcome, other.labels

        def priced(problem: Problem) -> Problem:
            return with_unit_costs(problem) if options.minimise == "steps" else problem

        with within(seconds), paused_collection():
            choice = BY.search(asked) is not None  # perhaps only the whole scene has the individual
            if choice and self.part is not None:
                return self.in_whole_scene().why_not(asked, instead)
            labels = self.labels
            place = None if instead is None else find_step(self.plan, instead, labels)
            soft = self.soft_goals
            try:
                told = why_not(asked, priced(self.problem), self.outcome.plan, labels, ask, replan, place, soft)
            except KnowledgeError:  # possibly only the whole scene has an individual of the text
                if self.part is None:
                    raise
                told = None
            if told is None:
                return self.in_whole_scene().why_not(asked, instead)
            # Plans for other goals come from `replan`, which has checked them.
            own = words[0] in self.problem.domain.behaviors
            if not own or self.part is None or told.plan is None or not self.faults(told.plan):
                return told
            return self.in_whole_scene().why_not(asked, instead)

    def in_whole_scene(self) -> Result:
        """Return the same result, with the problem of the whole scene in place of the problem of a part."""
        if self.part is None:
            return self
        whole = with_goals(self.scene.problem, self.goals)
        return replace(self, problem=whole.only(self.outcome.unmet), part=None)

    @overload
    def explain(self) -> Account: ...
    @overload
    def explain(self, step: AnyStep) -> Because: ...

    def explain(self, step: AnyStep | None = None) -> Account | Because:
        """Return the reasons why each step is in the plan, or the reason why there is no plan.

        If `step` is given, return why this step is in the plan, as the method `why` does.
        """
        from confab.show import summary
        from confab.why import Account, account, proved

        if step is not None:
            return self.why(step)
        headline = summary(self.outcome)
        if self.solved:
            return account(self.plan, self.purposes, self.labels, headline)
        return Account(headline, proof=() if self.certificate is None else proved(self.certificate, self.labels))

    @property
    def certificate(self) -> Certificate | None:
        """The certificate that the task has no plan, which `confab.planner.certificate_checks` has verified.

        The value is None if there is no certificate.
        """
        return self.outcome.certificate

    @property
    def cost(self) -> float:
        """The sum of the costs of the plan's primitives.

        Examples
        --------
        >>> import confab
        >>> confab.load("beverage-serving").plan().cost
        32.0
        """
        from confab.planner.plan_costs import cost_of

        return cost_of(self.problem, self.plan)

    def dearer(self) -> str:
        """Return a remark on possible cheaper plans, and the option that searches for a cheaper plan.

        The text is empty if nothing suggests that a cheaper plan exists, or if the plan is proved optimal.

        Examples
        --------
        >>> import confab
        >>> confab.load("beverage-serving").plan().dearer()
        ''
        """
        from confab.planner.plan_costs import in_circles

        if self.outcome.plan is None or self.outcome.proved or schedule_of(self.outcome) is not None:
            return ""
        if self.optimal:
            return "a longer time limit (--time-limit, in Python time_limit) may prove more, or find a better plan"
        how = "--optimal or --time-limit (in Python optimal=True, time_limit=S) looks for a cheaper one"
        if self.options.time_limit is not None:
            how = "--optimal (in Python optimal=True) looks for a cheaper one"
        if circles := in_circles(self.problem, self.plan):
            of = len(self.plan.primitives)
            return f"{circles} of the {of} primitives only undo each other (the steps above ask for them); {how}"
        costs = {behavior.cost for behavior in self.problem.domain.behaviors.values()}
        if self.outcome.bound is not None:
            return how
        if self.outcome.cost is not None or len(costs) > 1:
            return f"the plan costs {self.cost:g}, and no bound is known: {how}"
        return ""

    @property
    def solved(self) -> bool:
        """Whether there is a plan."""
        return self.outcome.status is Status.SOLVED

    def json(self) -> ResultJson:
        """Return the result as JSON data (docs/command-line.md)."""
        data = cast("ResultJson", outcome_json(self.scene.iri, self.outcome, self.seconds))
        data["queries"] = self.queries
        if self.timed is not None:
            data["schedule"] = schedule_json(self.timed)
        return data

    def save(self, path: str | Path) -> Path:
        """Write the result into a JSON file, and return the path."""
        from confab.reasoner.files import write_whole

        path = named_for(PLAN, path)
        write_whole(path, json.dumps(self.json(), indent=1, ensure_ascii=False) + "\n")
        return path

    def __rich__(self) -> PlanTree | str:
        """Return the plan as a tree for rich; without a plan, return the summary."""
        from confab.show import plan_tree, summary

        if not self.solved:
            return summary(self.outcome)
        more = () if self.timed is None else ("", *lanes(self.timed))
        return plan_tree(self.plan, "\n".join((summary(self.outcome), *more)))

    def __repr__(self) -> str:
        """Return the outcome in one line."""
        from confab.show import summary

        return summary(self.outcome).split("\n")[0]

    def __str__(self) -> str:
        """Return the summary and the first-level steps."""
        from confab.show import summary

        steps = self.outcome.plan.steps if self.outcome.plan else ()
        more = () if self.timed is None else lanes(self.timed)
        return "\n".join([summary(self.outcome), *(f"  {step}" for step in steps), *more])

    def report(self, path: str | Path) -> Path:
        """Write the plan, with the reasons for its steps, as one HTML page, and return the path."""
        from confab.page.data import page_data
        from confab.page.frozen import write_page

        return write_page(path, page_data(self.scene, self))

    def _repr_html_(self) -> str:
        from confab.page.data import MOST_STEPS
        from confab.page.markup import styled, tag
        from confab.page.pieces import tree
        from confab.show import summary

        headline = tag("p", summary(self.outcome))
        if self.outcome.plan is None:
            return styled(headline)
        short = self._in_sequence and sum(1 for _ in self.plan.walk()) <= MOST_STEPS
        needed = self.purposes if short else None
        return styled(headline, tree(self.plan, self.labels, None, needed))

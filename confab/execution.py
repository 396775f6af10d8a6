"""Execution of a task in a scene (`execute`), and its result (`Execution`)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from pathlib import Path
from random import Random
from typing import TYPE_CHECKING, Any, TypedDict

from confab.accepting import (
    AnyPlan,
    Facts,
    check_goal,
    check_noise,
    check_seconds,
    named_for,
    number,
    plan_of,
    possible,
    several,
)
from confab.formats import EpisodeJson
from confab.interchange import episode_json
from confab.intervening import parse_interventions
from confab.planner.acting.dispatching import Concurrency
from confab.planner.acting.episode import End, Episode, Event, Intervention, InterventionKind, situation
from confab.planner.acting.executed import observed_before, with_newcomers
from confab.planner.acting.executive import act
from confab.planner.acting.failure_memory import Caution
from confab.planner.acting.retries import RetryPolicy
from confab.planner.acting.symbolic_world import SymbolicWorld
from confab.planner.acting.world import World
from confab.planner.finding import numbers
from confab.planner.plan import Plan, Planner, SoftGoal
from confab.planner.solve import DEFAULT_MODE, Mode
from confab.reasoner.aggregates.totals import exceptions
from confab.reasoner.amounts import written
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.kinds import EPISODE
from confab.reasoner.limits import within
from confab.reasoner.memory.links import Links
from confab.reasoner.names import RightNames, right_names
from confab.reasoner.possible import violated
from confab.reasoner.problem import Problem
from confab.reasoner.reading.goals import some_of, with_goals
from confab.reasoner.symbols import Symbol
from confab.timing import has_times

if TYPE_CHECKING:
    from typing import Unpack

    import networkx

    from confab.known import Known
    from confab.memory import Memory
    from confab.planner.timed.plan import TimedPlan
    from confab.show import PlanTree
    from confab.sim.world import PhysicsWorld

WORLDS = ("symbolic", "pybullet")
SPREAD = Fraction(3, 10)
"""The greatest relative deviation of a duration in a perturbed symbolic world."""


@right_names("an execution", "scene.execute() or scene.read_episode(FILE)")
@dataclass(frozen=True)
class Execution(metaclass=RightNames):
    """The result of executing a task: an episode, and the scene in which it happened."""

    scene: Known
    episode: Episode

    @property
    def plan(self) -> Plan:
        """The executed part of the plan."""
        return self.episode.done

    @property
    def reached(self) -> bool:
        """Whether the execution reached all goals."""
        return self.episode.status is End.REACHED

    @property
    def violations(self) -> tuple[str, ...]:
        """The violations of constraints that were observed, each with its time; steps cause none, but interventions may."""
        episode = self.episode
        problem = with_newcomers(self.scene.problem, episode)
        texts, before = list[str](), set[Symbol]()
        for seconds in sorted({change.seconds for change in episode.course}) if problem.domain.constraints else ():
            state = situation(episode.initial, episode.course, seconds)
            found = exceptions(problem.domain, problem.classes, problem.relations, state)
            gone = {
                one.individual
                for one, at in episode.interventions
                if one.change is InterventionKind.REMOVE and at <= seconds
            }
            now = {symbol for symbol, number in found.items() if number != "0" and gone.isdisjoint(symbol.arguments)}
            texts += [
                f"at {seconds:g} s: {violated(problem.domain.constraints[symbol.situation], symbol.arguments)}"
                for symbol in sorted(now - before)
            ]
            before = now
        return tuple(texts)

    @property
    def soft_goals(self) -> tuple[SoftGoal, ...]:
        """The goals that were soft until the end, the heaviest first, and whether they hold."""
        return self.episode.soft_goals

    def json(self) -> EpisodeJson:
        """Return the episode as JSON data (docs/execution.md)."""
        data = episode_json(self.episode)
        if soft := self.soft_goals:
            data["soft_goals"] = [{"goal": str(one.fact), "weight": float(one.weight), "met": one.met} for one in soft]
        if violations := self.violations:
            data["violations"] = [*violations]
        return data

    def notes(self) -> dict[tuple[int, ...], str]:
        """Return remarks on steps by the step's path: failures, unexpected values, and changes of the plan."""
        same = {step.path: (step.behavior, step.arguments) for step in self.plan.walk()}
        notes = {
            event.step.path: "✗ " + (event.code or "; ".join(str(s.symbol) for s in event.surprises))
            for event in self.episode.events
            if (not event.ok or event.surprises)
            and same.get(event.step.path) == (event.step.behavior, event.step.arguments)
        }
        for replan in self.episode.replans:
            text = f"↻ {replan.kind} (−{replan.dropped} +{replan.added}): {replan.because}"
            notes[replan.after] = " ".join((notes.get(replan.after, ""), text)).strip()
        return notes

    def summary(self) -> str:
        """Return a summary of the episode in one line."""
        from confab.memory import counted

        episode = self.episode
        primitives = len(episode.done.primitives)
        text = f"{episode.status.value}: {primitives} primitives done"
        text += f", {counted(len(episode.interventions), 'intervention')}"
        text += f", {counted(len(episode.replans), 'change of plan', 'changes of plan')}"
        text += f", {counted(len(episode.failures), 'failure')}"
        if has_times(self.scene.problem):
            text += f", in {episode.seconds['simulated']:g} s"
        for met, what in ((True, "soft goal reached"), (False, "soft goal left unmet")):
            text += "".join(
                f"; {what}: {one.fact} (weight {written(one.weight)})" for one in self.soft_goals if one.met is met
            )
        text += "".join(f"; seen: {found.text}" for found, _ in episode.discovered if found.text)
        text += "".join(f"; {violation}" for violation in self.violations)
        text += "".join(f"; {reason.text}" for reason in episode.reasons)
        if not episode.missed:
            return text
        missed = ", ".join(intervention.text for intervention in episode.missed)
        asked = {intervention.after for intervention in episode.missed if isinstance(intervention.after, int)}
        ids = some_of([*dict.fromkeys(str(step.id) for step in episode.planned.steps)])
        names = numbers(episode.planned.walk())
        below = {step.id: names[step.path] for step in reversed([*episode.planned.walk()]) if step.id in asked}
        said = f" (after=ID names a step at the top of the plan: {ids})" if asked and ids else ""
        said += "".join(f"; {one} is the ID of {name}, which after={name} names" for one, name in sorted(below.items()))
        return f"{text}; the step or time of an intervention wasn't reached: {missed}{said}"

    def graph(self) -> networkx.DiGraph[int]:
        """Return the partial order of the executed primitives. An edge leads from a primitive to a primitive that depends on it."""
        from confab.planner.acting.schedule import partial_order

        episode = self.episode
        problem = replace(with_newcomers(self.scene.problem, episode), initial=episode.initial)
        return partial_order(problem, episode.done.primitives, observed_before(episode))

    def save(self, path: str | Path) -> Path:
        """Write the episode into a file atomically, and return the path.

        The format is JSON if the file's name ends in ``.json``, otherwise Turtle (PROV-O).
        """
        from confab.reasoner.memory.episodes import save_episode

        path = named_for(EPISODE, path)
        if path.suffix == ".json":
            import json

            from confab.reasoner.files import write_whole

            write_whole(path, json.dumps(self.json(), indent=1, ensure_ascii=False) + "\n")
        else:
            save_episode(path, self.json(), self.scene.names)
        return path

    def __rich__(self) -> PlanTree:
        """Return the executed plan as a tree for rich."""
        from confab.show import plan_tree

        return plan_tree(self.episode.done, self.summary(), self.notes())

    def __repr__(self) -> str:
        """Return the summary of the episode."""
        return self.summary()

    def report(self, path: str | Path) -> Path:
        """Write the episode as one HTML page, and return the path."""
        from confab.page.data import page_data
        from confab.page.frozen import write_page

        return write_page(path, page_data(self.scene, execution=self))

    def _repr_html_(self) -> str:
        from confab.labels import labels_of
        from confab.page.markup import styled, tag
        from confab.page.pieces import tree

        labels = labels_of(self.scene.knowledge, self.scene.names, self.scene.problem)
        return styled(tag("p", self.summary()), tree(self.episode.done, labels, self.notes()))


class ExecuteKeywords(TypedDict, total=False):
    """Further options of `execute`."""

    prepare: Callable[[PhysicsWorld], None] | None
    retry_policy: RetryPolicy
    caution: Caution | None
    perturb: bool
    noise: float
    both_hands: bool


def carry_out(
    scene: Known,
    plan: AnyPlan | None = None,
    interventions: Facts = (),
    world: str | World = "symbolic",
    goals: Facts = (),
    memory: Memory | Links | str | Path | None = None,
    mode: Mode = DEFAULT_MODE,
    seed: int = 0,
    observer: Callable[[Event], None] | None = None,
    watch: bool = False,
    time_limit: float | None = None,
    **options: Unpack[ExecuteKeywords],
) -> Execution:
    """Execute a task with the arguments of `confab.scene.Scene.execute`."""
    from confab.live import spectator

    scene.settle()
    problem = _whole_problem(scene, plan, several(goals))
    begun = None if plan is None else plan_of(plan, problem)
    if isinstance(memory, str | Path):
        from confab.memory import Memory

        memory = Memory.load(memory, scene)
    planner = planner_of(mode, memory if isinstance(memory, Links) or memory is None else memory.links)
    if memory is not None and not isinstance(memory, Links):
        from confab.planner.timed.measuring import with_durations

        problem = with_durations(problem, memory.statistics)
    if planner is None and memory is not None and not isinstance(memory, Links):
        from confab.planner.experience.advice import plan as plan_with

        planner = partial(plan_with, memory=memory.advisor, mode=mode)
    number("seed", seed, "an integer")
    texts = several(interventions)
    check_seconds("time_limit", time_limit)
    with within(time_limit), spectator(watch, observer) as heard:
        schedule: TimedPlan | None = _own(scene, plan, "timed")
        return execute(scene, problem, begun, texts, world, planner, seed, heard, schedule=schedule, **options)


def _whole_problem(scene: Known, plan: AnyPlan | None, goals: Sequence[str]) -> Problem:
    """Return the problem of the whole scene with the given goals; if `plan` is a result of the scene, also with its goals.

    The part of the scene that was read for the first plan may be too small for plans that are made during execution.
    """
    own: Problem | None = _own(scene, plan, "task")
    problem = with_goals(own or scene.reading.problem, goals)
    check_goal(scene.iri, problem)
    return problem


def _own(scene: Known, plan: AnyPlan | None, name: str) -> Any:
    """Return an attribute of a result if it is a result of the scene; return None for any other plan."""
    return getattr(plan, name, None) if getattr(plan, "scene", None) is scene else None


def planner_of(mode: Mode, memory: Links | None = None) -> Planner | None:
    """Return the planner of a mode, which makes new plans during execution; return None for the default planner.

    Raises
    ------
    KnowledgeError
        The mode is unknown.
    """
    from confab.planner.solve import MODES

    if mode not in MODES:
        raise KnowledgeError(f"unknown mode '{mode}'; wanted one of {', '.join(MODES)}")
    if mode != "paper":
        return None
    from confab.planner.paper.hierarchy import plan as paper_plan

    return partial(paper_plan, links=memory)


def execute(
    scene: Known,
    problem: Problem,
    plan: Plan | None = None,
    interventions: Iterable[str | Intervention] = (),
    world: str | World = "symbolic",
    planner: Planner | None = None,
    seed: int = 0,
    observer: Callable[[Event], None] | None = None,
    prepare: Callable[[PhysicsWorld], None] | None = None,
    retry_policy: RetryPolicy = RetryPolicy(),  # noqa: B008 - the default is immutable
    caution: Caution | None = None,
    perturb: bool = False,
    noise: float = 0.0,
    both_hands: bool = False,
    schedule: TimedPlan | None = None,
) -> Execution:
    """Execute a task in a closed loop of action and observation.

    In a symbolic world, a task with durations, deadlines or windows is executed by all actors at once.

    Parameters
    ----------
    scene : Scene
    problem : Problem
        The scene's problem, or the same problem with other goals.
    plan : Plan, optional
        The first plan.
    interventions : iterable of str or Intervention
        Texts like ``after=28 cup2 LOCATION location8``, or interventions.
    world : {'symbolic', 'pybullet'}, World, or str
        The world in which the task is executed. A text like ``pyrobosim:world.yaml`` names an interface in the scene and the
        address of a robot.
    planner : callable, optional
        The function that makes a new plan; by default the hierarchical planner.
    seed : int
        Seed of all random numbers in physics.
    observer : callable, optional
        A function that is called with every event.
    prepare : callable, optional
        A function that is called with the PyBullet world before the execution, for instance to inject a fault.
    retry_policy : RetryPolicy
    caution : Caution, optional
        The knowledge that was learned from failures in earlier episodes.
    perturb : bool
        Vary poses, friction, masses and filled amounts in PyBullet at random, with `seed`; in a symbolic world, vary durations.
    noise : float
        Standard deviation of perceived positions in PyBullet, in metres.
    both_hands : bool
        Execute the plan with all hands at once. After a failure, execute the remaining steps one after another.
    schedule : TimedPlan, optional
        The schedule of `plan`.

    Raises
    ------
    KnowledgeError
        An intervention has an unknown form or is impossible in the world, the scene has no geometry, or the world is unknown.
    """
    texts = list(interventions)
    wanted = [i for i in texts if isinstance(i, Intervention)]
    wanted += parse_interventions(problem, [i for i in texts if isinstance(i, str)])
    check_noise(noise)
    if noise and world != "pybullet":
        raise KnowledgeError(f"noise of {noise:g} m: only in the world pybullet, since nothing is measured elsewhere")
    if both_hands and world not in WORLDS:
        raise KnowledgeError(f"both hands at once: only in the worlds {' and '.join(WORLDS)}")
    in_time = both_hands or (world == "symbolic" and has_times(problem))
    spread = SPREAD if perturb else Fraction(0)
    together = Concurrency(schedule, spread) if in_time else None
    if world == "symbolic":
        symbolic = SymbolicWorld(problem, stretch=_stretched(seed, spread))
        with possible():
            episode = act(problem, symbolic, plan, wanted, planner, retry_policy, observer, caution, together)
        return Execution(scene, episode)
    if isinstance(world, str) and ":" in world:
        from confab.connecting import connected

        world, stated = connected(scene, problem, world, seed)
        retry_policy = stated if retry_policy == RetryPolicy() else retry_policy
    if not isinstance(world, str):
        if wanted and not (hasattr(world, "disturb") and hasattr(world, "announce")):
            raise KnowledgeError(
                "interventions can take place in simulated worlds only, which have disturb and announce"
            )
        with possible():
            return Execution(scene, act(problem, world, plan, wanted, planner, retry_policy, observer, caution))
    if world != "pybullet":
        raise KnowledgeError(
            f"unknown world '{world}'; wanted {', '.join(WORLDS)}, or a robot like pyrobosim:world.yaml"
        )
    from confab.physics import require_skills
    from confab.sim.live import LiveWorld
    from confab.sim.staging import Perturbation
    from confab.sim.world import PhysicsWorld

    lowest = problem.domain.at_level(problem.domain.levels[-1])
    require_skills(scene, [behavior.name for behavior in lowest])
    varied = Perturbation() if perturb else None
    with possible(), PhysicsWorld(scene.embodiment, problem.initial, seed, varied, noise=noise) as physics:
        if prepare is not None:
            prepare(physics)
        live = LiveWorld(physics, problem.classes, problem, _reach_of(scene))
        for intervention in wanted:
            if (why := live.impossible(intervention)) is not None:
                raise KnowledgeError(f"'{intervention.text}' can't happen in PyBullet: {why}")
        episode = act(problem, live, plan, wanted, planner, retry_policy, observer, caution, together)
        return Execution(scene, episode)


def _stretched(seed: int, spread: Fraction) -> Callable[[Fraction], Fraction]:
    """Return a function that varies durations at random, by at most the share `spread`."""
    rng = Random(seed)
    return lambda expected: expected * (1 + spread * Fraction(rng.randint(-1000, 1000), 1000))


def _reach_of(scene: Known) -> str:
    """Return the name of the relation of the scene's reach facts; an empty text if the scene has no such relation."""
    from confab.reasoner.embodiment.reach import reach_relation

    try:
        return scene.names.short(reach_relation(scene.knowledge))
    except KnowledgeError:
        return ""

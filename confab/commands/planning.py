"""The commands plan, run, verify, execute and explain."""

from __future__ import annotations

import json
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.exceptions import Exit

from confab.commands.given import (
    FACT,
    INTERVENTION,
    blame_reach,
    load_scene,
    memory_for,
    plan_in,
    warn_of_errors,
)
from confab.commands.options import (
    AS_JSON,
    CHANGES,
    GOALS,
    GUI,
    MEMORY_FILE,
    MODE,
    NO_MEMORY,
    NOISE,
    OUT,
    PATH,
    QUIET,
    SCENE,
    SCENE_IRI,
    SEED,
    TIME_LIMIT,
    Input,
    Output,
    Text,
    command,
    output_option,
    scene_argument,
)
from confab.examples import examples
from confab.planner.solve import DEFAULT_MODE, Mode
from confab.progress import progress
from confab.reasoner.files import check_folder
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.kinds import EPISODE, FILM, MEMORY, OBSERVED, PICTURE, PLAN, REPORT, VERDICTS
from confab.reasoner.limits import LimitError, within
from confab.terminal import EXIT, GAVE_UP, NO, YES, limited, remark, show_result, told

if TYPE_CHECKING:
    from confab.explaining import Explanation
    from confab.memory import Memory
    from confab.planning import Result
    from confab.timing import Minimise


@command(epilog=examples("plan"))
@SCENE
@GOALS
@MEMORY_FILE
@NO_MEMORY
@MODE
@TIME_LIMIT
@click.option(
    "--optimal", is_flag=True, help="As --mode optimal: improve the plan until it is proved optimal, for up to 10 s."
)
@click.option(
    "--levels",
    type=click.Choice(["free", "strict"]),
    default="free",
    metavar="free|strict",
    help="strict: fail if a level has no plan that can be refined.",
)
@click.option(
    "--from-observed",
    "observed",
    type=Input(OBSERVED),
    metavar="FILE",
    help="File of observed facts, which replace the scene's facts.",
)
@click.option("--diff", metavar="OLD_SCENE", help="Only print the differences from this scene and its plan in --mode.")
@click.option(
    "--engine", metavar="NAME", help="An engine of unified-planning; none: no engine even if the search gives up."
)
@click.option("--level", type=int, metavar="N", help="Level on which the engine plans; by default the lowest.")
@click.option(
    "--minimise",
    metavar="makespan|cost|steps",
    help="makespan: schedule the steps of all actors; cost, steps: as --optimal.",
)
@click.option(
    "--report", type=Output(REPORT), metavar="FILE.html", help="Write the plan and its reasons as an HTML page."
)
@output_option(type=Output(PLAN), metavar="PLAN.json", help="Write the plan into this file.")
@SCENE_IRI
@AS_JSON
@QUIET
def plan(
    scene: str,
    goal: tuple[str, ...],
    memory: Path | None,
    no_memory: bool,
    mode: Mode,
    time_limit: float | None,
    optimal: bool,
    levels: str,
    observed: Path | None,
    diff: str | None,
    engine: str | None,
    level: int | None,
    minimise: Minimise | None,
    report: Path | None,
    out: Path | None,
    iri: str | None,
    as_json: bool,
) -> None:
    """Plan in a scene, and print the plan as a tree of steps."""
    from confab.plan_options import PlanOptions
    from confab.planning import plan_by
    from confab.show import summary
    from confab.timing import lanes

    free = levels == "free"
    others = {
        "--memory": memory,
        "--optimal": optimal or None,
        "--levels strict": None if free else levels,
        "--from-observed": observed,
        "--engine": engine,
        "--level": level,
        "--minimise": minimise,
        "--report": report,
        "-o": out,
    }
    if diff is not None and (unused := [name for name, given in others.items() if given is not None]):
        raise KnowledgeError(
            f"--diff compares two scenes, each with a new plan of --mode; leave out {' and '.join(unused)}"
        )
    with limited(time_limit) as deadline:
        loaded = load_scene(scene, iri)
        if diff is not None:
            from confab.authoring import difference

            old = load_scene(diff, changed=False)
            old, loaded = (one.with_goal(*goal) if goal else one for one in (old, loaded))
            changed = difference(old, loaded, mode)
            show_result(changed.json() if as_json else str(changed))
            raise Exit(YES)
        remembered = memory_for(memory, no_memory, loaded)
        limit = None if time_limit is None else deadline
        options = PlanOptions(remembered, mode, limit, optimal, observed, engine, level, free, minimise)
        with progress("planning"):
            result = plan_by(loaded, list(goal), options)
    if report is not None:
        remark(f"the page is {result.report(report)}")
    if out is not None:
        told(result.save(out), "\n".join((summary(result.outcome), *(lanes(result.timed) if result.timed else ()))))
    else:
        # The library rich, whose import takes time, prints only plans: without a plan, the time limit may be over.
        show_result(result.json() if as_json else result if result.solved else str(result))
    with suppress(LimitError), within(deadline):
        if dearer := result.dearer():
            remark(dearer)
    warn_of_errors(loaded, deadline)
    blame_reach(loaded, result.outcome, deadline)
    raise Exit(EXIT[result.outcome.status.value])


@command(epilog=examples("run"))
@scene_argument(
    "scene",
    metavar="[SCENE]",
    help="Shipped name, file, or URL of a SPARQL endpoint.",
    required=False,
    default="beverage-serving",
)
@CHANGES
@GOALS
@MEMORY_FILE
@MODE
@SEED
@NOISE
@OUT
@click.option(
    "--keep", is_flag=True, help="Store the run in a new folder in DIR (001, 002, …); 'confab runs' lists runs."
)
@click.option("--no-video", is_flag=True, help="Don't film: faster.")
@GUI
@TIME_LIMIT
@QUIET
def run(
    scene: str,
    goal: tuple[str, ...],
    memory: Path | None,
    mode: Mode,
    seed: int,
    noise: float,
    out: Path,
    keep: bool,
    no_video: bool,
    gui: bool,
    time_limit: float | None,
) -> None:
    """Validate a scene, plan, verify the plan, learn and report."""
    from confab.history import new_folder
    from confab.running import Job
    from confab.running import run as run_all

    with limited(time_limit):
        check_folder(out)
        folder = new_folder(out) if keep else out
        raise Exit(run_all(Job(scene, folder, goal, memory, mode, seed, noise, not no_video, gui)))


@command(epilog=examples("verify"))
@SCENE
@click.argument(
    "plan",
    type=Input(PLAN),
    required=False,
    metavar="[PLAN.json]",
    help="Output of 'confab plan --json', or a plan in PDDL; by default a new plan.",
)
@GOALS
@click.option(
    "--rollouts", type=click.IntRange(min=1), default=1, metavar="N", help="Number of rollouts, with seeds S, S+1, …"
)
@SEED
@NOISE
@click.option(
    "--workers", default="1", metavar="W", help="Number of processes for the rollouts, or ray, ray://HOST:PORT."
)
@click.option("--perturb", is_flag=True, help="Vary poses, friction, masses and filled amounts.")
@click.option("--video", type=Output(FILM), metavar="OUT.mp4", help="Film the first rollout.")
@GUI
@click.option(
    "--memory", type=Output(MEMORY), metavar="FILE", help="Write the measured durations into this memory file."
)
@output_option(type=Output(VERDICTS), metavar="VERDICTS.json", help="Write the verdicts into this file.")
@TIME_LIMIT
@AS_JSON
@QUIET
def verify(
    scene: str,
    plan: Path | None,
    goal: tuple[str, ...],
    rollouts: int,
    seed: int,
    noise: float,
    workers: str,
    perturb: bool,
    video: Path | None,
    gui: bool,
    memory: Path | None,
    out: Path | None,
    time_limit: float | None,
    as_json: bool,
) -> None:
    """Execute a plan in physics, and check every primitive."""
    from confab.physics import counted
    from confab.refuting import keep, refuted_in

    with limited(time_limit), counted(rollouts) as done:
        loaded = load_scene(scene)
        loaded = loaded.with_goal(*goal) if goal else loaded
        report = loaded.verify(
            None if plan is None else plan_in(plan, loaded),
            rollouts,
            seed,
            perturb=perturb,
            noise=noise,
            video=video,
            workers=workers,
            done=done,
            gui=gui,
        )
    if not (perturb or noise):  # with perturbations, a failure in one rollout says nothing about the scene
        keep(loaded, refuted_in(loaded, report))
    if memory is not None:
        from confab.memory import memory_at, undisturbed

        with undisturbed(memory):
            remembered = memory_at(memory, loaded)
            remembered.measure(loaded.problem, report)
            remembered.save(memory)
    if out is not None:
        from confab.reasoner.files import write_whole

        write_whole(out, json.dumps(report.json(), indent=1) + "\n")
        told(out, report.summary())
    else:
        show_result(report.json() if as_json else report)
    raise Exit(YES if report.verified else NO)


@command(epilog=examples("execute"))
@SCENE
@click.option("--world", default="symbolic", help="World to act in: symbolic or pybullet.")
@click.option("--on", metavar="INTERFACE:ADDRESS", help="Robot to act on, e.g. pyrobosim:world.yaml; excludes --world.")
@click.option(
    "--intervene",
    type=Text(INTERVENTION),
    multiple=True,
    metavar="'WHEN WHAT'",
    help="e.g. 'after=28 cup2 LOCATION location8', or a file of interventions.",
)
@click.option("--plan", type=Input(PLAN), metavar="PLAN.json", help="Plan to begin with.")
@GOALS
@MEMORY_FILE
@NO_MEMORY
@MODE
@SEED
@click.option(
    "-o",
    "--output",
    "--save",
    "save",
    type=Output(EPISODE),
    metavar="EPISODE.ttl",
    help="Write the episode into this file.",
)
@click.option("--report", type=Output(REPORT), metavar="FILE.html", help="Write the episode as an HTML page.")
@SCENE_IRI
@click.option(
    "--perturb", is_flag=True, help="Vary poses, friction, masses, filled amounts; durations without physics."
)
@NOISE
@click.option("--both-hands", is_flag=True, help="Execute with all hands at once.")
@click.option("--learn", is_flag=True, help="Learn from the episode and its failures into --memory.")
@TIME_LIMIT
@click.option(
    "--serve",
    "serve_at",
    type=click.IntRange(0, 65535),
    metavar="PORT",
    help="Serve the page and SPARQL on this port during execution.",
)
@AS_JSON
@QUIET
def execute(
    scene: str,
    world: str,
    on: str | None,
    intervene: tuple[str, ...],
    plan: Path | None,
    goal: tuple[str, ...],
    memory: Path | None,
    no_memory: bool,
    mode: Mode,
    seed: int,
    save: Path | None,
    report: Path | None,
    iri: str | None,
    perturb: bool,
    noise: float,
    both_hands: bool,
    learn: bool,
    time_limit: float | None,
    serve_at: int | None,
    as_json: bool,
) -> None:
    """Execute a task in a closed loop, with repair and replanning."""
    from confab.live import both, spectator
    from confab.memory import UNTAUGHT, memory_at, undisturbed

    with ExitStack() as stack:
        stack.enter_context(limited(time_limit))
        loaded = load_scene(scene, iri)
        remembered = memory_for(memory, no_memory, loaded, new=learn)
        if learn and (memory is None or remembered is None):
            raise KnowledgeError("--learn needs --memory FILE, a memory that can be read or a new file")
        observer = stack.enter_context(spectator())
        if serve_at is not None:
            from confab.serving import serving

            server = stack.enter_context(serving(loaded, serve_at))
            remark(f"{server.url} shows what happens, {server.url}sparql answers SPARQL 1.1")
            observer = both(observer, server.service.take)
        execution = loaded.execute(
            plan,
            intervene or (),
            on or world,
            goal or (),
            remembered,
            mode,
            seed,
            observer,
            perturb=perturb,
            noise=noise,
            both_hands=both_hands,
        )
    exact = on is None and not (perturb or noise)  # only in this world do refutations follow from the scene's geometry
    if execution.episode.refuted and exact:
        from confab.refuting import keep

        # later calls don't know these individuals
        met = {found.individual for found, _ in execution.episode.discovered}
        keep(loaded, [one for one in execution.episode.refuted if met.isdisjoint(one.individuals)])
    if learn and memory is not None:
        with undisturbed(memory):  # other processes may have changed the file during the episode
            newest = memory_at(memory, loaded)
            if not newest.live(loaded.problem, execution.episode):
                remark(f"nothing was learned: {UNTAUGHT}")
            newest.save(memory)
    if save is not None:
        execution.save(save)
    if report is not None:
        remark(f"the page is {execution.report(report)}")
    show_result(execution.json() if as_json else execution)
    raise Exit({"reached": YES, "impossible": NO, "gave-up": GAVE_UP}[execution.episode.status.value])


@command(epilog=examples("explain"))
@SCENE
@click.argument(
    "which",
    required=False,
    metavar="[STEP]",
    help="L3#12 (step 12 of level 3, from 0), a path 0.1.2, or words of the step.",
)
@click.option(
    "--not",
    "instead",
    type=Text(FACT),
    metavar="WHAT",
    help="The alternative: 'cup2 LOCATION location8 by left_hand', 'B2_PICK right_hand cup1'.",
)
@click.option("--plan", type=Input(PLAN), metavar="PLAN.json", help="Plan to explain, instead of a new one.")
@GOALS
@MEMORY_FILE
@MODE
@click.option("--optimal", is_flag=True, help="As --mode optimal: explain a plan of the search for an optimal plan.")
@click.option(
    "--step",
    type=click.IntRange(min=0),
    default=0,
    metavar="N",
    help="Number of the step on its level, counted from 0.",
)
@click.option("--level", type=int, default=1, metavar="L", help="Level of the step.")
@click.option("--check", type=PATH, metavar="FILE", help="Verify a certificate from `plan --json`, without planning.")
@click.option("--against", metavar="BEHAVIOR", help="With --memory: the alternative, 'B2_PICK right_hand cup1'.")
@click.option(
    "--plot", type=Output(PICTURE), metavar="FILE", help="With --memory: draw the reasons into a PNG, SVG or PDF file."
)
@TIME_LIMIT
@AS_JSON
@QUIET
def explain(
    scene: str,
    which: str | None,
    instead: str | None,
    plan: Path | None,
    goal: tuple[str, ...],
    memory: Path | None,
    mode: Mode,
    optimal: bool,
    step: int,
    level: int,
    check: Path | None,
    against: str | None,
    plot: Path | None,
    time_limit: float | None,
    as_json: bool,
) -> None:
    """Explain a plan, an alternative, or why there is no plan."""
    from confab.certificates import checked_certificate
    from confab.planning import Result

    if check is not None:
        if any(given is not None for given in (which, instead, plan, memory, against, plot)):
            raise KnowledgeError(
                "--check verifies a certificate and plans nothing; leave out STEP, --not, --plan and options of memory"
            )
        with limited(time_limit):
            checked = checked_certificate(load_scene(scene), goal, check)
        show_result(checked.json() if as_json else str(checked))
        raise Exit(YES if checked.holds else NO)
    if plan is not None and (optimal or mode != DEFAULT_MODE):
        raise KnowledgeError("--plan names the plan to explain, so that none is made; leave out --mode and --optimal")
    with limited(time_limit):
        loaded = load_scene(scene)
        remembered = memory_for(memory, False, loaded)
        with progress("planning"):
            if plan is not None:
                result = loaded.read_result(plan_in(plan, loaded), goal)
            else:
                planner = None if optimal or mode == "optimal" else remembered  # the optimal search uses no memory
                result = loaded.plan(goal, planner, mode, optimal=optimal)
        told = _explained(result, which, instead, remembered, step, level, against, plot)
    if isinstance(told, Result):
        because = told.explain()
        show_result({**told.json(), "proof": list(because.proof)} if as_json else because)
        raise Exit(EXIT[told.outcome.status.value])
    show_result(told.json() if as_json else told)


def _explained(
    result: Result,
    which: str | None,
    instead: str | None,
    remembered: Memory | None,
    step: int,
    level: int,
    against: str | None,
    plot: Path | None,
) -> Any:
    """Return the requested explanation of a result; without STEP or --not, and if there is no plan, return the result."""
    if instead is None and which is None and not result.solved:
        return result
    if level not in result.problem.domain.levels:
        raise KnowledgeError(f"no level {level}; this scene has {', '.join(map(str, result.problem.domain.levels))}")
    if which is None and (step, level) != (0, 1):
        which = f"L{level}#{step}"
    if instead is not None:
        return result.why_not(instead, which)
    if remembered is not None:
        return _by_memory(result, remembered, which or "L1#0", against, plot)
    if against is not None or plot is not None:
        raise KnowledgeError("--against and --plot need --memory FILE; without a memory, give --not WHAT")
    return result.explain() if which is None else result.why(which)


def _by_memory(result: Result, memory: Memory, which: str, against: str | None, plot: Path | None) -> Explanation:
    """Return why memory prefers a step of a plan to an alternative; if `plot` is given, draw the reasons into this file."""
    from confab.explaining import explain as explain_step
    from confab.interchange import ground_named
    from confab.why import find_step

    if plot is not None and plot.suffix.lower() not in (".png", ".svg", ".pdf"):
        raise KnowledgeError(f"{plot}: can't draw into '{plot.suffix}'; wanted .png, .svg or .pdf")
    asked = find_step(result.plan, which, result.labels)
    on = result.plan.at_level(asked.level)
    steps = [(s.behavior, s.arguments) for s in on]
    result = result.in_whole_scene() if against else result  # the task may not need an individual of the alternative
    other = ground_named(result.problem, against) if against else None
    found = explain_step(result.problem, memory, steps, on.index(asked), other, result.labels)
    if plot is not None:
        found.plot(plot)
    return found

"""The command line: one function per command, each a few calls to the rooms behind it.

Results go to stdout, progress and errors to stderr (`confab.terminal`). Exit 0: yes; 1: the answer is no; 2: misuse or
unreadable input; 3: gave up at a limit; 4: a fault of ours. Heavy imports wait inside the commands that need them.
"""

from __future__ import annotations

import glob
import json
import logging
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import click
from click.exceptions import Exit

import ontology
from confab.examples import examples
from confab.progress import progress
from confab.terminal import GAVE_UP, NO, YES, remark, run_to_end, show_result
from reasoner.graph.knowledge import KnowledgeError

if TYPE_CHECKING:
    from confab.explaining import Explanation
    from confab.memory import Memory
    from confab.scene import Result, Scene
    from confab.table import Table
    from planner.plan import Plan
    from reasoner.limits import Deadline

FORMS = {
    ".ttl": "turtle",
    ".txt": "table",
    ".csv": "csv",
    ".json": "json",
    ".tsv": "tsv",
    ".srj": "sparql-json",
    ".srx": "sparql-xml",
}
"""What a query's answer can be written as, by the ending of the file's name."""
EXIT = {"solved": YES, "unsolvable": NO, "gave-up": GAVE_UP}

PATH = click.Path(path_type=Path)
SETTINGS = {"help_option_names": ["-h", "--help"], "show_default": True}


class InOrder(click.Group):
    """A group whose help lists its commands as they stand here, the main one first."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return their names."""
        return list(self.commands)


def _version(context: click.Context, option: click.Parameter, wanted: bool) -> None:
    if wanted:
        from confab import __version__

        print(f"confab {__version__}")
        raise Exit


def _quiet(context: click.Context, option: click.Parameter, wanted: bool) -> None:
    if wanted or context.parent is None:
        logging.disable(logging.WARNING if wanted else logging.NOTSET)


def _completion(context: click.Context, option: click.Parameter, shell: str | None) -> None:
    if shell:
        from click.shell_completion import get_completion_class

        kind = get_completion_class(shell)
        assert kind is not None
        print(kind(app, {}, "confab", "_CONFAB_COMPLETE").source())
        raise Exit


def _scenes(context: click.Context, option: click.Parameter, begun: str) -> list[str]:
    """Return what a scene's name can go on with: shipped names, and files of ontologies."""
    folder = Path(begun.rpartition("/")[0] or ("/" if begun.startswith("/") else "."))
    found = sorted(folder.glob(f"{glob.escape(begun.rpartition('/')[2])}*"))
    files = [str(path) + "/" * path.is_dir() for path in found if path.is_dir() or path.suffix in ontology.SUFFIXES]
    return [*(name for name in ontology.scenes() if name.startswith(begun)), *files]


QUIET = click.option(
    "-q", "--quiet", is_flag=True, expose_value=False, callback=_quiet, help="Say nothing but results and errors."
)


@click.group(name="confab", cls=InOrder, context_settings=SETTINGS)
@click.option(
    "--version", is_flag=True, is_eager=True, expose_value=False, callback=_version, help="Print the version and exit."
)
@click.option(
    "--completion",
    type=click.Choice(["bash", "zsh", "fish"]),
    is_eager=True,
    expose_value=False,
    callback=_completion,
    help='Print what completes commands, scenes and files: eval "$(confab --completion bash)".',
)
@QUIET
def app() -> None:
    """Plan what a robot does from an ontology, and verify it in physics."""


SCENE = click.argument(
    "scene", metavar="SCENE", shell_complete=_scenes, help="Shipped name, file, or URL of a SPARQL endpoint."
)
SCENE_IRI = click.option("--scene", "iri", metavar="IRI", help="Which scene of an endpoint, if it holds several.")
GOALS = click.option(
    "--goal",
    multiple=True,
    metavar="FACT",
    help="A goal that replaces that symbol's, e.g. 'cup2 LOCATION location8'; repeatable.",
)
MEMORY_FILE = click.option(
    "--memory", type=PATH, metavar="FILE", help="The only place where memory is read or written."
)
NO_MEMORY = click.option("--no-memory", is_flag=True, help="Plan without memory, in so many words.")
MODE = click.option(
    "--mode",
    default="guarded",
    metavar="MODE",
    shell_complete=lambda *_: ["guarded", "leading", "strict", "optimal", "paper"],
    help="guarded, leading, strict, optimal, or paper (eq. 5).",
)
TIME_LIMIT = click.option(
    "--time-limit",
    type=click.FloatRange(min=0.0),
    metavar="S",
    help="Seconds from the start on after which it gives up (exit 3).",
)
SEED = click.option("--seed", type=click.IntRange(min=0), default=0, help="Seed of everything that is random.")
AS_JSON = click.option("--json", "as_json", is_flag=True, help="Print one JSON object instead of text.")
GUI = click.option("--gui", is_flag=True, help="Show the first rollout in a window; needs a screen.")
OUT = click.option(
    "-o",
    "--output",
    "--out",
    "out",
    type=PATH,
    default=Path("confab-out"),
    metavar="DIR",
    help="Folder to write into.",
)


@app.command(epilog=examples("plan"))
@SCENE
@GOALS
@MEMORY_FILE
@NO_MEMORY
@MODE
@TIME_LIMIT
@click.option(
    "--optimal", is_flag=True, help="--mode optimal: improve until proved or the limit (10 s); tell the bound."
)
@click.option(
    "--levels",
    default="free",
    metavar="free|strict",
    help="Strict: no steps of a lower level where a level has no plan that can be refined.",
)
@click.option(
    "--from-observed", "observed", type=PATH, metavar="FILE", help="Start from what was seen, not from the scene."
)
@click.option("--diff", metavar="OLD_SCENE", help="Say what changed since that scene instead.")
@click.option(
    "--engine", metavar="NAME", help="A planner that unified-planning knows, or none: not even where ours gives up."
)
@click.option("--level", type=int, metavar="N", help="The level the engine plans; the lowest.")
@click.option("--report", type=PATH, metavar="FILE.html", help="Write the plan and its reasons as a page.")
@click.option("-o", "--output", "out", type=PATH, metavar="PLAN.json", help="Write the plan into this file.")
@SCENE_IRI
@AS_JSON
@QUIET
def plan(
    scene: str,
    goal: tuple[str, ...],
    memory: Path | None,
    no_memory: bool,
    mode: str,
    time_limit: float | None,
    optimal: bool,
    levels: str,
    observed: Path | None,
    diff: str | None,
    engine: str | None,
    level: int | None,
    report: Path | None,
    out: Path | None,
    iri: str | None,
    as_json: bool,
) -> None:
    """Plan in a scene: a tree of behaviours down to primitives."""
    from confab.show import summary
    from reasoner.limits import Deadline

    deadline = Deadline.after(time_limit)
    if out is not None:
        _json(out)
    loaded = _load(scene, iri, deadline)
    if diff is not None:
        from confab.authoring import difference

        changed = difference(_load(diff), loaded, mode)
        show_result(changed.json() if as_json else str(changed))
        raise Exit(YES)
    remembered = _memory(memory, no_memory, loaded)
    if levels not in ("free", "strict"):
        raise KnowledgeError(f"--levels is '{levels}'; wanted free or strict")
    limit = None if time_limit is None else deadline
    with progress("planning"):
        result = loaded.plan(
            goal or (), remembered, mode, limit, optimal, observed, engine, level, leave_levels=levels == "free"
        )
    if report is not None:
        result.report(report)
    if out is not None:
        show_result(f"{result.save(out)}: {summary(result.outcome)}")
    else:
        show_result(result.json() if as_json else result)
    _doubt(loaded)
    raise Exit(EXIT[result.outcome.status.value])


@app.command(epilog=examples("run"))
@click.argument(
    "scene",
    required=False,
    default="beverage-serving",
    metavar="[SCENE]",
    shell_complete=_scenes,
    help="Shipped name, file, or URL of a SPARQL endpoint.",
)
@MEMORY_FILE
@MODE
@SEED
@OUT
@click.option("--no-video", is_flag=True, help="Don't film: faster.")
@GUI
@QUIET
def run(scene: str, memory: Path | None, mode: str, seed: int, out: Path, no_video: bool, gui: bool) -> None:
    """Validate, plan, verify in physics, learn and report."""
    from confab.running import run as run_all

    raise Exit(run_all(scene, memory, mode, seed, out, film=not no_video, gui=gui))


@app.command(epilog=examples("verify"))
@SCENE
@click.argument(
    "plan", type=PATH, metavar="PLAN.json", help="What 'confab plan --json' prints, or a plan in PDDL's form."
)
@click.option("--rollouts", type=click.IntRange(min=1), default=1, metavar="N", help="How often, with seeds S, S+1, …")
@SEED
@click.option("--workers", default="1", metavar="W", help="Processes that share the rollouts; or ray, ray://HOST:PORT.")
@click.option("--perturb", is_flag=True, help="Vary poses, friction, masses and fill.")
@click.option("--video", type=PATH, metavar="OUT.mp4", help="Film the first rollout.")
@GUI
@click.option("-o", "--output", "out", type=PATH, metavar="VERDICTS.json", help="Write the verdicts into this file.")
@AS_JSON
@QUIET
def verify(
    scene: str,
    plan: Path,
    rollouts: int,
    seed: int,
    workers: str,
    perturb: bool,
    video: Path | None,
    gui: bool,
    out: Path | None,
    as_json: bool,
) -> None:
    """Carry a plan out in physics and check every primitive."""
    from confab.physics import counted

    if out is not None:
        _json(out)
    loaded = _load(scene)
    with counted(rollouts) as done:
        report = loaded.verify(
            _plan(plan, loaded), rollouts, seed, perturb=perturb, video=video, workers=workers, done=done, gui=gui
        )
    if out is not None:
        from reasoner.files import write_whole

        write_whole(out, json.dumps(report.json(), indent=1) + "\n")
        show_result(f"{out}: {report.summary()}")
    else:
        show_result(report.json() if as_json else report)
    raise Exit(YES if report.verified else NO)


@app.command(epilog=examples("execute"))
@SCENE
@click.option("--world", default="symbolic", help="Where to act: symbolic or pybullet.")
@click.option(
    "--intervene", multiple=True, metavar="'WHEN WHAT'", help="e.g. 'after=28 cup2 LOCATION location8'; or a file."
)
@click.option("--plan", type=PATH, metavar="PLAN.json", help="What to begin with.")
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
    type=PATH,
    metavar="EPISODE.ttl",
    help="Write the episode into this file.",
)
@click.option("--report", type=PATH, metavar="FILE.html", help="Write what happened as a page.")
@SCENE_IRI
@click.option("--perturb", is_flag=True, help="Vary poses, friction, masses and fill.")
@click.option("--both-hands", is_flag=True, help="In PyBullet: all hands at once, without interventions.")
@click.option("--learn", is_flag=True, help="Learn the episode, failures too, into --memory.")
@click.option(
    "--serve",
    "serve_at",
    type=click.IntRange(0, 65535),
    metavar="PORT",
    help="Meanwhile show it on a page, and answer SPARQL, at this port.",
)
@AS_JSON
@QUIET
def execute(
    scene: str,
    world: str,
    intervene: tuple[str, ...],
    plan: Path | None,
    goal: tuple[str, ...],
    memory: Path | None,
    no_memory: bool,
    mode: str,
    seed: int,
    save: Path | None,
    report: Path | None,
    iri: str | None,
    perturb: bool,
    both_hands: bool,
    learn: bool,
    serve_at: int | None,
    as_json: bool,
) -> None:
    """Act in a closed loop: watch, be interrupted, repair, replan."""
    from confab.live import both, spectator
    from confab.memory import Memory, undisturbed

    loaded = _load(scene, iri)
    remembered = _memory(memory, no_memory, loaded)
    if learn and (memory is None or remembered is None):
        raise KnowledgeError("--learn needs a memory that can be read: give --memory FILE ('confab learn' makes one)")
    with ExitStack() as stack:
        tell = stack.enter_context(spectator())
        if serve_at is not None:
            from confab.serving import serving

            server = stack.enter_context(serving(loaded, serve_at))
            remark(f"{server.url} shows what happens, {server.url}sparql answers SPARQL 1.1")
            tell = both(tell, server.service.take)
        execution = loaded.execute(
            plan,
            intervene or (),
            world,
            goal or (),
            remembered,
            mode,
            seed,
            tell,
            perturb=perturb,
            both_hands=both_hands,
        )
    if learn and memory is not None:
        with undisturbed(memory):  # others may have learned meanwhile
            newest = Memory.load(memory, loaded)
            newest.live(loaded.problem, execution.episode)
            newest.save(memory)
    if save is not None:
        execution.save(save)
    if report is not None:
        execution.report(report)
    show_result(execution.json() if as_json else execution)
    raise Exit({"reached": YES, "impossible": NO, "gave-up": GAVE_UP}[execution.episode.status.value])


@app.command(epilog=examples("serve"))
@SCENE
@click.option(
    "--port", type=click.IntRange(0, 65535), default=7879, metavar="N", help="On 127.0.0.1; 0 is any free one."
)
@click.option(
    "--time-limit",
    type=click.FloatRange(min=0.0),
    default=60.0,
    metavar="S",
    help="Seconds after which a query ends.",
)
@click.option(
    "--rows", type=click.IntRange(min=1), default=100000, metavar="N", help="More rows than this end it, too."
)
@QUIET
def serve(scene: str, port: int, time_limit: float, rows: int) -> None:
    """Serve a scene as a read-only SPARQL 1.1 endpoint, until Ctrl-C."""
    from threading import Event

    from confab.serving import serving
    from reasoner.graph.apart import QueryLimits

    with serving(_load(scene), port, QueryLimits(seconds=time_limit, rows=rows)) as server:
        show_result(f"{server.url}sparql answers SPARQL 1.1, {server.url} shows the scene; Ctrl-C ends it")
        sys.stdout.flush()
        Event().wait()


@app.command(epilog=examples("query"))
@SCENE
@click.argument(
    "sparql", required=False, metavar="[QUERY]", help="SPARQL text, a .rq file, or a ready query: where-was-it."
)
@click.option(
    "--episodes", multiple=True, type=PATH, metavar="FILE", help="Ask this saved episode as well; repeatable."
)
@click.option("--show", metavar="BEHAVIOR", help="Print the query that quantifies it.")
@click.option("--applicable", is_flag=True, help="With --show: the query with its preconditions, where it can be done.")
@click.option("--affords", metavar="OBJECT", help="List what an object affords here; 'all' for every object.")
@click.option("--format", "form", help="table, csv, json; or a standard one: tsv, sparql-json, sparql-xml.")
@click.option("--iris", is_flag=True, help="Whole IRIs in place of short names.")
@click.option(
    "-o",
    "--output",
    "out",
    type=PATH,
    metavar="FILE",
    help="Into a file; FILE.ttl takes what CONSTRUCT gives, as an ontology.",
)
@click.option(
    "--time-limit",
    type=click.FloatRange(min=0.0),
    default=60.0,
    metavar="S",
    help="Seconds after which the query ends (exit 3).",
)
@click.option(
    "--rows", type=click.IntRange(min=1), default=100000, metavar="N", help="More rows than this end it, too."
)
@click.option("--service", is_flag=True, help="Let the query ask other endpoints (SERVICE).")
@SCENE_IRI
@AS_JSON
@QUIET
def query(
    scene: str,
    sparql: str | None,
    episodes: tuple[Path, ...],
    show: str | None,
    applicable: bool,
    affords: str | None,
    form: str | None,
    iris: bool,
    out: Path | None,
    time_limit: float,
    rows: int,
    service: bool,
    iri: str | None,
    as_json: bool,
) -> None:
    """Ask a scene in SPARQL, or what its objects afford."""
    from reasoner.graph.apart import QueryLimits

    limits = QueryLimits(seconds=time_limit, rows=rows, service=service)
    asked = {"QUERY": sparql, "--show": show, "--affords": affords}
    given = [name for name, value in asked.items() if value is not None]
    if len(given) > 1:
        raise KnowledgeError(f"{' and '.join(given)} exclude each other; give one")
    if applicable and show is None:
        raise KnowledgeError("--applicable says which query --show prints; give --show BEHAVIOR, too")
    loaded = _load(scene, iri).with_episodes(*episodes)
    if show is not None:
        print(loaded.applicable_query(show) if applicable else loaded.quantifying_query(show))
        return
    if sparql is None and affords is None:
        raise KnowledgeError("no query; give SPARQL text, a .rq file, --show BEHAVIOR or --affords OBJECT")
    if out is not None and out.suffix.lower() == ".ttl":
        if sparql is None:
            raise KnowledgeError("-o FILE.ttl takes what a CONSTRUCT query gives; give the query, too")
        print(f"{out}: {loaded.construct(sparql, out, limits)} triples")
        return
    with progress("asking"):
        table = loaded.affordances(affords) if sparql is None else loaded.query(sparql, limits)
    form = form or ("json" if as_json else FORMS.get(out.suffix.lower()) if out is not None else "table")
    if form is None or form not in FORMS.values():
        wanted = f"wanted a file in {', '.join(FORMS)}" if form is None else f"wanted {', '.join(FORMS.values())}"
        raise KnowledgeError(f"unknown format '{form or out}'; {wanted}")
    _rows(table.iris() if iris else table, form, out, loaded.knowledge.spoken)
    raise Exit(NO if table.truth is False else YES)


@app.command(epilog=examples("learn"))
@click.argument(
    "scenes",
    nargs=-1,
    required=True,
    metavar="SCENE…",
    shell_complete=_scenes,
    help="Scenes to gather experience in.",
)
@click.option("--memory", type=PATH, required=True, metavar="FILE", help="Memory file to learn into; made if missing.")
@click.option("--plan", "demonstration", type=PATH, metavar="PLAN.json", help="Learn from this plan instead.")
@click.option("--plot", type=PATH, metavar="FILE", help="Draw expansions over the episodes: PNG, SVG or PDF.")
@click.option(
    "--rounds",
    type=click.IntRange(1),
    metavar="N",
    help="How often all scenes are gone through.",
)
@AS_JSON
@QUIET
def learn(
    scenes: tuple[str, ...],
    memory: Path,
    demonstration: Path | None,
    plot: Path | None,
    rounds: int | None,
    as_json: bool,
) -> None:
    """Learn how scenes are best solved, or from a demonstration."""
    from confab.curve import Curve, require_drawable
    from confab.interchange import read_plan
    from confab.memory import MOST_LINKS, Memory, undisturbed

    remembered: Memory | None = None
    status, curve = YES, Curve()
    if plot is not None:
        require_drawable(plot)
    scenes *= rounds or (6 if plot is not None and len(scenes) == 1 else 1)
    with undisturbed(memory), progress("learning", 2 * len(scenes)) as advance:
        for name in scenes:
            advance(f"planning in {name}", 0)
            loaded = _load(name)
            if remembered is None:
                remembered = Memory.load(memory, loaded) if memory.is_file() else Memory.of(loaded)
            if plot is not None:
                curve.measure(name, loaded, remembered)
            links = remembered.links
            if demonstration:
                remembered.learn(loaded, read_plan(demonstration, loaded.problem))
                advance(f"learned {name}", 2)
            else:
                result = loaded.plan()
                if not result.solved:
                    status = EXIT[result.outcome.status.value]
                    why = result.outcome.reason.text if result.outcome.reason else ""
                    remark(f"{name}: nothing to learn, {result.outcome.status.value}: {why}")
                    advance(name, 2)
                    continue
                advance(f"learning {name}", 1)
                remembered.teach(loaded, result.plan)
                advance(f"learned {name}", 1)
            if remembered.links is links:
                remark(f"{name}: would make more than {MOST_LINKS:,} of the paper's links; only counts were learned")
        assert remembered is not None
        if remembered.experience.episodes:
            remembered.save(memory)
    if plot is not None:
        curve.save(plot)
    data = {"memory": str(memory), "links": len(remembered.links), "behaviors": len(remembered.links.tables)}
    show_result(data if as_json else f"{memory}: {remembered!r}")
    raise Exit(status)


@app.command(epilog=examples("new"))
@click.argument("domain", metavar="DOMAIN", help="Name of the domain: letters, digits, _ or -.")
@click.option(
    "-o",
    "--output",
    "--folder",
    "folder",
    type=PATH,
    metavar="DIR",
    help="Folder to write into; default: DOMAIN.",
)
@click.option("--bodies", is_flag=True, help="With shapes, a table and skills, so that 'confab run' can carry it out.")
def new(domain: str, folder: Path | None, bodies: bool) -> None:
    """Begin a domain of your own with a commented skeleton."""
    from confab import authoring

    files = authoring.new_domain(domain, folder, bodies)
    scene = next(file for file in files if file.stem.endswith("-scene"))
    then = "run" if bodies else "plan"
    show_result(
        "\n".join([*map(str, files), f"next: confab validate {scene}; confab {then} {scene}; docs/authoring.md"])
    )


@app.command(epilog=examples("fetch"))
@click.argument("url", metavar="URL", help="IRI of an ontology that lies on the web.")
@click.option(
    "-o",
    "--output",
    "--into",
    "folder",
    type=PATH,
    default=Path(),
    metavar="DIR",
    help="Folder of the file that imports it.",
)
def fetch(url: str, folder: Path) -> None:
    """Fetch an ontology that is imported by URL."""
    from reasoner.graph.fetching import fetch as fetch_ontology

    fetched = fetch_ontology(url, folder)
    show_result(
        "\n".join([f"{fetched.file}, named in {fetched.catalog}", *(f"it imports {iri}" for iri in fetched.imports)])
    )


@app.command(epilog=examples("picture"))
@SCENE
@click.option("-o", "--output", "out", type=PATH, required=True, metavar="FILE.png", help="File to draw into.")
@click.option("--behavior", metavar="BEHAVIOR", help="Draw its conditions and effects instead.")
@click.option("--classes", is_flag=True, help="Draw the classes of objects instead.")
def picture(scene: str, out: Path, behavior: str | None, classes: bool) -> None:
    """Draw the table with its places, a behaviour, or the classes."""
    from confab.picturing import draw
    from confab.scene import load

    print(draw(load(scene), out, behavior, classes))


@app.group("memory", cls=InOrder)
def memory_app() -> None:
    """Look after a memory file."""


@memory_app.command(epilog=examples("memory migrate"))
@click.argument("memory", type=PATH, metavar="MEMORY", help="Memory file; it is replaced as a whole.")
@click.argument("renames", nargs=-1, required=True, metavar="OLD=NEW…", help="Terms that were renamed in the ontology.")
def migrate(memory: Path, renames: tuple[str, ...]) -> None:
    """Rename terms in a memory, so that what was learned of them isn't lost."""
    from confab.authoring import migrate as rename

    show_result(f"{memory}: {rename(memory, renames)} statements changed")


@app.command(epilog=examples("validate"))
@click.argument(
    "files",
    nargs=-1,
    required=True,
    metavar="FILE…",
    shell_complete=_scenes,
    help="Ontology files, or names of shipped scenes.",
)
@click.option("--deep", is_flag=True, help="Ask HermiT for contradictions as well; needs Java.")
@click.option("--strict", is_flag=True, help="Count a warning as an error: exit 1.")
@click.option("--watch", is_flag=True, help="Check again whenever one of the files changes, until Ctrl-C.")
@AS_JSON
@QUIET
def validate(files: tuple[str, ...], deep: bool, strict: bool, watch: bool, as_json: bool) -> None:
    """Check ontologies: what is wrong where, why, and what to do."""
    from confab.watching import again_and_again

    code = _validated(files, deep, strict, as_json)
    for _ in again_and_again(files) if watch else ():
        code = _validated(files, deep, strict, as_json)
    raise Exit(code)


def _validated(files: tuple[str, ...], deep: bool, strict: bool, as_json: bool) -> int:
    """Check some files, print what was found, and return the exit code."""
    from reasoner.validation.findings import ERROR, WARNING
    from reasoner.validation.validate import STAGES
    from reasoner.validation.validate import validate as check

    with progress("validating", len(files) * STAGES) as advance:
        findings = check(files, deep=deep, done=lambda what: advance(what, 1))
    errors, warnings = (sum(finding.severity == kind for finding in findings) for kind in (ERROR, WARNING))
    if as_json:
        show_result([finding.as_dict() for finding in findings])
    else:
        show_result("\n".join([*map(str, findings), *([] if errors or warnings else ["nothing is wrong"])]))
        if errors or warnings:
            from confab.memory import counted

            remark(f"{counted(errors, 'error')}, {counted(warnings, 'warning')}")
    sys.stdout.flush()
    return NO if errors or (strict and warnings) else YES


@app.command(epilog=examples("explain"))
@SCENE
@click.argument(
    "which", required=False, metavar="[STEP]", help="L3#12 (step 12 of level 3, from 0), a path 0.1.2, or its words."
)
@click.option(
    "--not",
    "instead",
    metavar="WHAT",
    help="Why not this: 'cup2 LOCATION location8 by left_hand', 'B2_PICK right_hand cup1'.",
)
@GOALS
@MEMORY_FILE
@click.option(
    "--step", type=click.IntRange(min=0), default=0, metavar="N", help="Which step of the level, counted from 0."
)
@click.option("--level", type=int, default=1, metavar="L", help="On which level of the plan.")
@click.option("--against", metavar="BEHAVIOR", help="With --memory: the alternative, 'B2_PICK right_hand cup1'.")
@click.option("--plot", type=PATH, metavar="FILE", help="Draw memory's reasons: PNG, SVG or PDF.")
@AS_JSON
@QUIET
def explain(
    scene: str,
    which: str | None,
    instead: str | None,
    goal: tuple[str, ...],
    memory: Path | None,
    step: int,
    level: int,
    against: str | None,
    plot: Path | None,
    as_json: bool,
) -> None:
    """Say why each step is there, why not another one, or why no plan."""
    loaded = _load(scene)
    remembered = _memory(memory, False, loaded)
    with progress("planning"):
        result = loaded.plan(goal or (), remembered)
    if not result.solved:
        show_result(result.json() if as_json else result)
        raise Exit(EXIT[result.outcome.status.value])
    if level not in result.problem.domain.levels:
        raise KnowledgeError(f"no level {level}; this scene has {', '.join(map(str, result.problem.domain.levels))}")
    if which is None and (step, level) != (0, 1):
        which = f"L{level}#{step}"
    if instead is not None:
        told: Any = result.why_not(instead, which)
    elif remembered is not None:
        told = _by_memory(result, remembered, which or "L1#0", against, plot)
    else:
        if against is not None or plot is not None:
            raise KnowledgeError(
                "--against and --plot ask memory, so they need --memory FILE; without it, ask --not WHAT"
            )
        told = result.explain() if which is None else result.why(which)
    show_result(told.json() if as_json else told)


def _by_memory(result: Result, memory: Memory, which: str, against: str | None, plot: Path | None) -> Explanation:
    """Return why memory prefers a step of a plan to another one, and draw it."""
    from confab.explaining import explain as explain_step
    from confab.interchange import ground_named
    from confab.why import find_step

    if plot is not None and plot.suffix.lower() not in (".png", ".svg", ".pdf"):
        raise KnowledgeError(f"{plot}: can't draw into '{plot.suffix}'; wanted .png, .svg or .pdf")
    asked = find_step(result.plan, which, result.labels)
    on = result.plan.at_level(asked.level)
    steps = [(s.behavior, s.arguments) for s in on]
    other = ground_named(result.problem, against) if against else None
    found = explain_step(result.problem, memory, steps, on.index(asked), other, result.labels)
    if not found.note and not any(counts.evaluated for counts in result.outcome.search.values()):
        found = replace(found, note="the planner found this plan before memory was asked: so memory sees its choices")
    if plot is not None:
        found.plot(plot)
    return found


@memory_app.command(epilog=examples("memory show"))
@click.argument("memory", metavar="FILE_OR_URL", help="Memory file, or SPARQL endpoint.")
@click.option("--most", type=click.IntRange(min=1), default=30, metavar="N", help="So many rows.")
@AS_JSON
def show(memory: str, most: int, as_json: bool) -> None:
    """Show what a memory has counted, what discriminates first."""
    from confab.memory import Memory

    loaded = Memory.load(memory)
    if as_json:
        show_result({"memory": memory, "summary": repr(loaded), "counts": loaded.counts(most).records()})
    else:
        show_result(repr(loaded))
        show_result(loaded.counts(most))


@memory_app.command(epilog=examples("memory merge"))
@click.argument("memories", nargs=-1, required=True, metavar="FILE_OR_URL…", help="Memories to merge.")
@click.option(
    "-o", "--output", "out", type=PATH, required=True, metavar="FILE", help="The merged memory; may be one of them."
)
@click.option("--trust", is_flag=True, help="Let what they have counted lead; else it runs in strict mode.")
def merge(memories: tuple[str, ...], out: Path, trust: bool) -> None:
    """Merge memories: the counts of each replica, in any order, once or many times."""
    from confab.memory import Memory, undisturbed

    with undisturbed(out):
        merged = Memory.load(memories[0])
        for source in memories[1:]:
            merged.merge(Memory.load(source), trust)
        merged.save(out)
    show_result(f"{out}: {merged!r}")


@memory_app.command("trust", epilog=examples("memory trust"))
@click.argument("memory", type=PATH, metavar="MEMORY", help="Memory file; it is replaced as a whole.")
@click.argument("replicas", nargs=-1, required=True, metavar="REPLICA…", help="IDs of replicas in it, or 'all'.")
def trust_(memory: Path, replicas: tuple[str, ...]) -> None:
    """Let what other replicas have counted lead the search, too."""
    from confab.memory import Memory, undisturbed

    with undisturbed(memory):
        loaded = Memory.load(memory)
        loaded.trust(sorted(loaded.experience.episodes) if replicas == ("all",) else replicas)
        loaded.save(memory)
    show_result(f"{memory}: leads with {len(loaded.trusted | {loaded.experience.replica})} of its replicas")


@app.command(epilog=examples("generate"))
@click.argument("family", metavar="FAMILY", help="served, swap, rotate, full, handover, blocked, random or unsolvable.")
@click.option("-o", "--output", "out", type=PATH, required=True, metavar="SCENE.ttl", help="File to write.")
@click.option("--objects", type=int, default=4, metavar="N", help="Objects, half of them cups.")
@click.option("--hands", type=int, default=2, metavar="H", help="Hands.")
@click.option("--clutter", type=int, default=0, metavar="K", help="Irrelevant objects in other rooms.")
@SEED
def generate(family: str, out: Path, objects: int, hands: int, clutter: int, seed: int) -> None:
    """Write a scene for trials as an ordinary ontology file."""
    from confab.authoring import turtle_path
    from reasoner.generate import write_scene

    write_scene(turtle_path(out), family, objects, hands, clutter, seed)
    print(f"{out}: a scene of the family {family}; plan in it with: confab plan {out}")


@app.command("import", epilog=examples("import"))
@click.argument("domain", type=PATH, metavar="DOMAIN.pddl")
@click.argument("problem", type=PATH, metavar="PROBLEM.pddl")
@click.option("-o", "--output", "out", type=PATH, required=True, metavar="SCENE.ttl", help="File to write.")
@click.option(
    "--level", type=click.IntRange(min=1), default=1, help="Level of its behaviours; abstract ones can be added above."
)
def import_(domain: Path, problem: Path, out: Path, level: int) -> None:
    """Turn a PDDL problem into a scene."""
    from confab.authoring import turtle_path
    from confab.pddl_commands import import_pddl

    imported = import_pddl(domain, problem, turtle_path(out), level)
    behaviors, facts = len(imported.domain.behaviors), len(imported.initial)
    print(f"{out}: {behaviors} behaviours, {facts} facts; plan in it with: confab plan {out}")


@app.command(epilog=examples("export"))
@SCENE
@click.option("-o", "--output", "out", type=PATH, required=True, metavar="FOLDER", help="Folder to write into.")
@click.option("--level", type=int, help="Level to export; the lowest if not given.")
def export(scene: str, out: Path, level: int | None) -> None:
    """Write one level of a scene as PDDL, for other planners."""
    from confab.pddl_commands import export_pddl
    from confab.scene import load

    for path in export_pddl(load(scene).problem, level, out):
        print(path)


def _load(source: str, iri: str | None = None, deadline: Deadline | None = None) -> Scene:
    """Load a scene, with what its hands reach if it has a body."""
    from confab.reaching import with_current_reach
    from confab.scene import load

    with progress(f"reading {source}"):
        scene = load(source, iri, deadline)
    return with_current_reach(scene, remark)


def _doubt(scene: Scene) -> None:
    """Say in one line if `confab validate` would find errors in a scene of the user's own."""
    path = scene.knowledge.path
    if path is None or path.is_relative_to(ontology.ROOT):
        return
    from reasoner.validation.validate import quick_errors

    errors = quick_errors(scene.knowledge)
    if errors:
        more = f" and {len(errors) - 1} more" if len(errors) > 1 else ""
        remark(f"'confab validate {path}' finds errors, so this may not be what was meant: {errors[0].what}{more}")


def _memory(path: Path | None, none: bool, scene: Scene) -> Memory | None:
    """Return the memory to plan with, if one was asked for."""
    if path is not None and none:
        raise KnowledgeError("--memory and --no-memory exclude each other; give one")
    if path is None:
        return None
    from confab.memory import Memory

    try:
        lines = None
        if path.is_file():
            from confab.authoring import unknown_terms
            from reasoner.memory.links_file import memory_lines

            lines = memory_lines(path)
            if unknown := unknown_terms(lines, scene.knowledge):
                remark(f"{path} counts what this scene doesn't know: {'; '.join(unknown)}")
        return Memory.load(path, scene, lines=lines)
    except KnowledgeError as error:
        if not path.is_file():
            raise
        remark(f"{error}; planning goes on without memory")
        return None


def _rows(table: Table, form: str, out: Path | None, prefixes: dict[str, str]) -> None:
    """Print the rows of a query, or write them into a file."""
    if form == "table" and out is None:
        show_result("true" if table.truth else table if table.truth is None else "false")
        return
    if form == "table":
        text = f"{table!r}\n"
    elif form == "csv":
        text = table.csv()
    elif form == "json":
        data = table.records() if table.truth is None else table.truth
        text = json.dumps(data, indent=1, ensure_ascii=False) + "\n"
    elif form == "turtle":
        text = table.turtle(prefixes)
    else:
        text = table.standard(form).decode("utf-8").rstrip("\n") + "\n"
    if out is None:
        print(text, end="")
        return
    from reasoner.files import write_whole

    write_whole(out, text)
    print(f"{out}: {len(table)} rows")


def _json(path: Path) -> Path:
    """Return the path of a plan or of verdicts to write, if it says that it is JSON."""
    if path.suffix.lower() != ".json":
        raise KnowledgeError(f"{path}: is written as JSON; wanted a name that ends in .json")
    return path


def _plan(path: Path, scene: Scene) -> Plan:
    """Return the plan in a file: JSON of ours, else a list of actions as PDDL planners write it for our export."""
    if path.suffix.lower() in (".json", ""):
        from confab.interchange import read_plan

        return read_plan(path, scene.problem)
    from confab.pddl_commands import read_pddl_plan

    try:
        return read_pddl_plan(scene.problem, None, path.read_text(encoding="utf-8"), regroup=True)
    except (KnowledgeError, UnicodeDecodeError) as error:
        raise KnowledgeError(f"{path}: {error}") from error


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run the command line: whatever happens in it ends as an exit code and at most one line on stderr."""
    run_to_end(lambda: app(arguments, prog_name="confab", standalone_mode=False))

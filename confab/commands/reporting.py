"""The commands report, runs and scenes, which show saved results, stored runs and the shipped scenes."""

from __future__ import annotations

from pathlib import Path
from shlex import quote

import click

from confab.commands.given import load_scene, plan_in
from confab.commands.options import AS_JSON, FOLDER, GOALS, QUIET, SCENE, TIME_LIMIT, Input, Output, command
from confab.examples import examples
from confab.progress import progress
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.kinds import EPISODE, PLAN, REPORT, VERDICTS
from confab.terminal import limited, show_result, told


@command(epilog=examples("report"))
@SCENE
@click.option("-o", "--output", "out", type=Output(REPORT), required=True, metavar="FILE.html", help="File to write.")
@GOALS
@click.option("--plan", type=Input(PLAN), metavar="PLAN.json", help="Show this plan, or the plan of --verdicts.")
@click.option(
    "--verdicts",
    type=Input(VERDICTS),
    metavar="VERDICTS.json",
    help="Show the verdicts in a file of 'confab verify -o'.",
)
@click.option(
    "--episode", type=Input(EPISODE), metavar="EPISODE.json", help="Show the episode in a file of 'confab execute -o'."
)
@TIME_LIMIT
@QUIET
def report(
    scene: str,
    out: Path,
    goal: tuple[str, ...],
    plan: Path | None,
    verdicts: Path | None,
    episode: Path | None,
    time_limit: float | None,
) -> None:
    """Write the page of a plan, or of a saved result, into a file."""
    from confab.page.data import page_data
    from confab.page.frozen import write_page

    if plan is None and verdicts is not None:
        raise KnowledgeError("--verdicts belong to a plan; also give --plan PLAN.json")
    if episode is not None and (goal or plan is not None):
        raise KnowledgeError("--episode shows an execution alone; leave out --goal, --plan and --verdicts")
    with limited(time_limit):
        loaded = load_scene(scene)
        if episode is not None:
            data = page_data(loaded, execution=loaded.read_episode(episode))
        elif plan is not None and verdicts is not None:
            data = page_data(loaded, report=loaded.read_report(verdicts, plan_in(plan, loaded)))
            data["again"] = data["again"].replace("PLAN.json", quote(str(plan)))
        elif plan is not None:
            data = page_data(loaded, loaded.read_result(plan_in(plan, loaded), goal))
        else:
            with progress("planning"):
                data = page_data(loaded, loaded.plan(goal))
        told(write_page(out, data), data["headline"])


@command(epilog=examples("runs"))
@click.argument(
    "folder",
    type=FOLDER,
    default="confab-out",
    metavar="[FOLDER]",
    help="Folder in which 'confab run --keep' stores runs.",
)
@click.argument("names", nargs=-1, metavar="[RUN OTHER]", help="Two runs to compare.")
@click.option("-o", "--output", "out", type=Output(REPORT), metavar="FILE.html", help="Write the runs as an HTML page.")
@AS_JSON
@QUIET
def runs(folder: Path, names: tuple[str, ...], out: Path | None, as_json: bool) -> None:
    """List stored runs, or compare two runs."""
    from confab.history import compared, history_html, listed
    from confab.history import runs as read

    found = read(folder)
    if len(names) not in (0, 2):
        raise KnowledgeError(f"got {len(names)} run; wanted two to compare ('confab runs {folder} 001 002'), or none")
    if out is not None:
        from confab.reasoner.files import write_whole

        write_whole(out, history_html(found, f"Runs in {folder.name or folder}", names))
        told(out, f"{len(found)} runs")
        return
    table = compared(found, *names) if names else listed(found)
    show_result(table.records() if as_json else table)


@command(epilog=examples("scenes"))
@AS_JSON
@QUIET
def scenes(as_json: bool) -> None:
    """List the shipped scenes with their titles."""
    from confab.scene import described

    table = described()
    show_result(table.records() if as_json else table)

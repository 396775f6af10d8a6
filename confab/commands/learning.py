"""Commands for memories: learn, show, merge, trust, rename."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.exceptions import Exit

from confab.commands.given import load_scene
from confab.commands.misplaced import kind_of_value, known_as
from confab.commands.options import AS_JSON, QUIET, TIME_LIMIT, Command, Input, Output, Text, command, scene_argument
from confab.examples import examples
from confab.progress import progress
from confab.reasoner.kinds import EPISODE, MEMORY, PICTURE, PLAN
from confab.terminal import EXIT, NO, YES, limited, remark, show_result

if TYPE_CHECKING:
    from confab.memory import Memory


@command(epilog=examples("learn"))
@scene_argument("scenes", metavar="SCENE…", help="Scenes to plan in and learn from.", nargs=-1, required=True)
@click.option(
    "--memory",
    "-o",
    "--output",
    "memory",
    type=Output(MEMORY),
    required=True,
    metavar="FILE",
    help="Memory file to update; created if missing.",
)
@click.option("--plan", "demonstration", type=Input(PLAN), metavar="PLAN.json", help="Learn from this plan only.")
@click.option(
    "--episode",
    "lived",
    type=Input(EPISODE),
    multiple=True,
    metavar="EPISODE.json",
    help="Learn from this output of 'confab execute --json' only; repeatable.",
)
@click.option(
    "--plot", type=Output(PICTURE), metavar="FILE", help="Draw expansions over the episodes: PNG, SVG or PDF."
)
@click.option("--rounds", type=click.IntRange(1), metavar="N", help="Number of rounds through all scenes.")
@TIME_LIMIT
@AS_JSON
@QUIET
def learn(
    scenes: tuple[str, ...],
    memory: Path,
    demonstration: Path | None,
    lived: tuple[Path, ...],
    plot: Path | None,
    rounds: int | None,
    time_limit: float | None,
    as_json: bool,
) -> None:
    """Learn from solutions of scenes, a demonstration, or episodes."""
    from confab.curve import Curve, require_drawable
    from confab.interchange import read_plan
    from confab.memory import MOST_LINKS, UNTAUGHT, memory_at, undisturbed

    remembered: Memory | None = None
    status, curve = YES, Curve()
    if plot is not None:
        require_drawable(plot)
    scenes *= rounds or (6 if plot is not None and len(scenes) == 1 else 1)
    with undisturbed(memory), limited(time_limit), progress("learning", 2 * len(scenes)) as advance:
        for name in scenes:
            advance(f"planning in {name}", 0)
            loaded = load_scene(name)
            if remembered is None:
                remembered = memory_at(memory, loaded)
            if plot is not None:
                curve.measure(name, loaded, remembered)
            links = remembered.links
            if demonstration or lived:
                if demonstration:
                    remembered.learn(loaded, read_plan(demonstration, loaded.problem))
                for episode in lived:
                    if not remembered.live(loaded.problem, loaded.read_episode(episode).episode):
                        status = NO
                        remark(f"{episode}: nothing was learned: {UNTAUGHT}")
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
            if remembered.links is links and not lived:
                remark(f"{name}: would make more than {MOST_LINKS:,} of the paper's links; only rules were learned")
            if remembered.experience.episodes:
                remembered.save(memory)  # a later scene may exceed the time limit
        assert remembered is not None
    if plot is not None:
        curve.save(plot)
    data = {"memory": str(memory), "links": len(remembered.links), "behaviors": len(remembered.links.tables)}
    show_result(data if as_json else f"{memory}: {remembered.said()}")
    raise Exit(status)


class InOrder(click.Group):
    """A command group whose help lists its commands in the order of this module."""

    command_class = Command

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names of the commands."""
        return list(self.commands)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the command with a name; a memory file in place of a command is shown."""
        if args and args[0] not in self.commands:
            if kind_of_value(args[0]) == MEMORY:
                return super().resolve_command(ctx, ["show", *args])
            root = ctx.find_root().command
            known = isinstance(root, click.Group) and args[0] in root.list_commands(ctx)
            more = f"confab {args[0]} is a command" if known else known_as(args[:1], ctx)
            said = f"no such command 'memory {args[0]}'; wanted {', '.join(self.commands)}"
            raise click.UsageError("; ".join(filter(None, (said, more))), ctx)
        return super().resolve_command(ctx, args)


@click.group("memory", cls=InOrder)
def memory_app() -> None:
    """Show, merge or trust memories, or rename terms in a memory."""


@memory_app.command(epilog=examples("memory migrate"))
@click.argument("memory", type=Output(MEMORY), metavar="MEMORY", help="Memory file, which is rewritten.")
@click.argument("renames", nargs=-1, required=True, metavar="OLD=NEW…", help="Terms that were renamed in the ontology.")
def migrate(memory: Path, renames: tuple[str, ...]) -> None:
    """Rename terms in a memory after they were renamed in the ontology."""
    from confab.authoring import migrate as rename

    show_result(f"{memory}: {rename(memory, renames)} statements changed")


@memory_app.command(epilog=examples("memory show"))
@click.argument("memory", type=Text(MEMORY), metavar="FILE_OR_URL", help="Memory file, or SPARQL endpoint.")
@click.option("--most", type=click.IntRange(min=1), default=30, metavar="N", help="Maximum number of rows.")
@AS_JSON
def show(memory: str, most: int, as_json: bool) -> None:
    """Show the learned rules, orders of goals, methods and durations of a memory."""
    from confab.memory import Memory
    from confab.scene import scenes

    loaded = Memory.load(memory)
    name = loaded.scene.rpartition("/")[2]
    if name in scenes():  # a shipped scene provides the labels
        loaded = Memory.load(memory, load_scene(name))
    if as_json:
        rules, also = loaded.advice(most).records(), loaded.also()[:most]
        durations = loaded.durations(most).records()
        show_result({"memory": memory, "summary": repr(loaded), "rules": rules, "also": also, "durations": durations})
    else:
        show_result(loaded.page(most))


@memory_app.command(epilog=examples("memory merge"))
@click.argument(
    "memories", type=Text(MEMORY), nargs=-1, required=True, metavar="FILE_OR_URL…", help="Memories to merge."
)
@click.option(
    "-o",
    "--output",
    "out",
    type=Output(MEMORY, may_be="memories"),
    required=True,
    metavar="FILE",
    help="The merged memory; may be one of the inputs.",
)
@click.option("--trust", is_flag=True, help="Let all counts guide the search; by default planning is strict.")
def merge(memories: tuple[str, ...], out: Path, trust: bool) -> None:
    """Merge the counts of memories into one memory."""
    from confab.memory import Memory, undisturbed

    with undisturbed(out):
        merged = Memory.load(memories[0])
        for source in memories[1:]:
            merged.merge(Memory.load(source), trust)
        merged.save(out)
    show_result(f"{out}: {merged.said()}")


@memory_app.command("trust", epilog=examples("memory trust"))
@click.argument("memory", type=Output(MEMORY), metavar="MEMORY", help="Memory file, which is rewritten.")
@click.argument(
    "replicas", nargs=-1, required=True, metavar="REPLICA…", help="IDs of replicas in the memory, or 'all'."
)
def trust_(memory: Path, replicas: tuple[str, ...]) -> None:
    """Let the counts of other replicas also guide the search."""
    from confab.memory import Memory, undisturbed

    with undisturbed(memory):
        loaded = Memory.load(memory)
        loaded.trust(sorted(loaded.experience.episodes) if replicas == ("all",) else replicas)
        loaded.save(memory)
    show_result(
        f"{memory}: the counts of {len(loaded.trusted | {loaded.experience.replica})} replicas guide the search"
    )

"""Options of several commands, declared once."""

from __future__ import annotations

import glob
import logging
import os
from functools import partial
from pathlib import Path
from typing import Any

import click

from confab import ontology
from confab.reasoner.files import STDOUT
from confab.reasoner.kinds import CONVERTED, EPISODE, GENERATED, IMPORTED, PLAN, VERDICTS

TEXTS = ("", PLAN, VERDICTS, EPISODE, GENERATED, IMPORTED, CONVERTED)
"""Kinds of content that can go to standard output; the empty kind is the result of a query."""

STDIN = Path("/dev/stdin")


class Input(click.Path):
    """A file that a command reads; ``-`` is standard input."""

    def __init__(self) -> None:
        super().__init__(path_type=Path)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the path."""
        return STDIN if value == "-" else super().convert(value, param, ctx)


PATH = Input()
FOLDER = click.Path(path_type=Path)


class Output(click.Path):
    """A file that a command writes; ``-`` is standard output, for text that is the result of a command.

    Parameters
    ----------
    kind : str
        The kind of the output file, as in `confab.reasoner.kinds`; empty if only the command knows.
    may_be : str
        The parameter whose files may be replaced.
    """

    def __init__(self, kind: str = "", may_be: str = "") -> None:
        super().__init__(path_type=Path)
        self.kind, self.may_be = kind, may_be

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the path, if content of this kind may be written there."""
        path = Path(str(super().convert(value, param, ctx)))
        if path == STDOUT and self.kind not in TEXTS:
            self.fail(f"{self.kind or 'this'} can't be written to stdout; wanted the name of a file", param, ctx)
        if self.kind and ctx is not None and not ctx.resilient_parsing:
            from confab.reasoner.files import check_replaceable

            check_replaceable(path, self.kind)
        return path


class Command(click.Command):
    """A command whose outputs differ from its inputs and from each other, and that reads stdin for at most one input."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command, unless one file is given for two purposes."""
        read = [p for p in self.params if _reads_stdin(ctx.params.get(p.name or ""), p)]
        if len(read) > 1:
            names = " and ".join(map(_name, read))
            raise click.UsageError(f"stdin can be read for one thing; {names} are both '-'", ctx)
        for output in self.params:
            path = ctx.params.get(output.name or "")
            if not isinstance(output.type, Output) or not isinstance(path, Path) or path == STDOUT:
                continue
            for other in self.params:
                given = ctx.params.get(other.name or "")
                if other is output or other.name == output.type.may_be:
                    continue
                if any(_same_file(path, one, other) for one in (given if isinstance(given, tuple) else (given,))):
                    raise click.UsageError(
                        f"one file for two purposes: {path} is both {_name(other)} and {_name(output)}; give another name",
                        ctx,
                    )
        return super().invoke(ctx)


def _reads_stdin(given: object, parameter: click.Parameter) -> bool:
    """Return whether a parameter's value denotes standard input."""
    values = given if isinstance(given, tuple) else (given,)
    return any(value in (STDIN, "-") for value in values) and not isinstance(parameter.type, Output)


def _same_file(path: Path, given: object, parameter: click.Parameter) -> bool:
    """Return whether the value of a parameter denotes a given file, possibly through links."""
    if not isinstance(given, str | Path):
        return False
    try:
        return path.samefile(given)
    except (OSError, ValueError):  # one of them isn't there
        is_file = isinstance(parameter, click.Argument) or isinstance(parameter.type, click.Path)
        return is_file and os.path.realpath(path) == os.path.realpath(str(given).replace("\0", ""))


def _name(parameter: click.Parameter) -> str:
    return max(parameter.opts, key=len) if isinstance(parameter, click.Option) else (parameter.metavar or "an argument")


command = partial(click.command, cls=Command)


def _quiet(context: click.Context, option: click.Parameter, wanted: bool) -> None:
    if wanted or context.parent is None:
        logging.disable(logging.WARNING if wanted else logging.NOTSET)


def _verbose(context: click.Context, option: click.Parameter, wanted: bool) -> None:
    if wanted:
        from confab.progress import be_verbose

        be_verbose()


def scene_names(context: click.Context, option: click.Parameter, begun: str) -> list[str]:
    """Return the completions of a scene's name: shipped names, and ontology files."""
    folder = Path(begun.rpartition("/")[0] or ("/" if begun.startswith("/") else "."))
    found = sorted(folder.glob(f"{glob.escape(begun.rpartition('/')[2])}*"))
    files = [str(path) + "/" * path.is_dir() for path in found if path.is_dir() or path.suffix in ontology.SUFFIXES]
    return [*(name for name in ontology.scenes() if name.startswith(begun)), *files]


_QUIET = click.option(
    "-q", "--quiet", is_flag=True, expose_value=False, callback=_quiet, help="Say nothing but results and errors."
)
_VERBOSE = click.option(
    "-v", "--verbose", is_flag=True, expose_value=False, callback=_verbose, help="Say what each stage takes, on stderr."
)


def QUIET(function: Any) -> Any:  # noqa: N802 - an option as the others
    """Add the two options for the amount of output."""
    return _QUIET(_VERBOSE(function))


SCENE = click.argument(
    "scene",
    metavar="SCENE",
    shell_complete=scene_names,
    help="Shipped name, file, URL of a SPARQL endpoint, or - for stdin.",
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
NO_MEMORY = click.option("--no-memory", is_flag=True, help="Plan explicitly without memory.")
MODE = click.option(
    "--mode",
    default="guarded",
    metavar="MODE",
    shell_complete=lambda *_: ["guarded", "leading", "strict", "optimal", "paper"],
    help="guarded, leading, strict, optimal, or paper (eq. 5).",
)


class Seconds(click.FloatRange):
    """A number of seconds that a clock can wait for."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return the seconds, if they are a number within the maximum."""
        seconds = float(super().convert(value, param, ctx))
        if not seconds <= LONGEST:  # as 'nan' isn't
            self.fail(f"'{value}' is no time to wait; wanted seconds up to {LONGEST:,.0f}", param, ctx)
        return seconds


LONGEST = 1e9
"""Maximum number of seconds of a time limit; beyond it, leave the limit out."""
TIME_LIMIT = click.option(
    "--time-limit",
    type=Seconds(min=0.0),
    metavar="S",
    help="Seconds after which it gives up (exit 3).",
)
SEED = click.option("--seed", type=click.IntRange(min=0), default=0, help="Seed of everything that is random.")
AS_JSON = click.option("--json", "as_json", is_flag=True, help="Print one JSON object instead of text.")
NOISE = click.option(
    "--noise",
    type=click.FloatRange(0.0, 0.05),
    default=0.0,
    metavar="M",
    help="Standard deviation of perceived positions in metres, e.g. 0.002.",
)
GUI = click.option("--gui", is_flag=True, help="Show the first rollout in a window; needs a screen.")
OUT = click.option(
    "-o",
    "--output",
    "--out",
    "out",
    type=FOLDER,
    default=Path("confab-out"),
    metavar="DIR",
    help="Folder to write into.",
)
QUERY_SECONDS = click.option(
    "--time-limit",
    type=Seconds(min=0.0),
    default=60.0,
    metavar="S",
    help="Seconds after which a query ends (exit 3).",
)
QUERY_ROWS = click.option(
    "--rows", type=click.IntRange(min=1), default=100000, metavar="N", help="More rows than this end it, too."
)

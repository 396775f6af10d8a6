"""Arguments and options that several commands share."""

from __future__ import annotations

import glob
import logging
import os
import sys
from functools import partial
from pathlib import Path
from typing import Any

import click
from click.exceptions import Exit

from confab import ontology
from confab.commands.given import FACT, IRI
from confab.commands.given import SCENE as A_SCENE
from confab.reasoner.files import STDOUT
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.kinds import CONVERTED, EPISODE, GENERATED, IMPORTED, MEMORY, PLAN, VERDICTS

TEXTS = ("", PLAN, VERDICTS, EPISODE, GENERATED, IMPORTED, CONVERTED)
"""Kinds of content that a command can write to standard output. The empty text is the kind of query results."""

STDIN = Path("/dev/stdin")


class Text(click.types.StringParamType):
    """A text of a kind of `confab.commands.given`, for example a goal, or the name of a scene."""

    def __init__(self, kind: str) -> None:
        self.kind = kind


class Input(click.Path):
    """A file that a command reads, or ``-`` for standard input; `kind` is the kind of the file, empty for any kind."""

    def __init__(self, kind: str = "") -> None:
        super().__init__(path_type=Path)
        self.kind = kind

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the path."""
        return STDIN if value == "-" else super().convert(value, param, ctx)


PATH = Input()
FOLDER = click.Path(path_type=Path)


class Output(click.Path):
    """A file that a command writes, or ``-`` for standard output; only content of the kinds in `TEXTS` can go to standard output.

    Parameters
    ----------
    kind : str
        The kind of the output file, as in `confab.reasoner.kinds`; empty if the command determines the kind.
    may_be : str
        The name of the parameter whose input file the output may replace.
    """

    def __init__(self, kind: str = "", may_be: str = "") -> None:
        super().__init__(path_type=Path)
        self.kind, self.may_be = kind, may_be

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the path; fail if content of this kind can't be written to the path."""
        path = Path(str(super().convert(value, param, ctx)))
        if path == STDOUT and self.kind not in TEXTS:
            self.fail(f"{self.kind or 'this'} can't be written to stdout; wanted the name of a file", param, ctx)
        if self.kind and ctx is not None and not ctx.resilient_parsing:
            from confab.accepting import named_for
            from confab.reasoner.files import check_folder, check_replaceable

            named_for(self.kind, path)
            if path != STDOUT:
                check_folder(path)
            check_replaceable(path, self.kind)
        return path


class Command(click.Command):
    """A command that refuses to use one file as input and output, one file for two outputs, or stdin for two inputs."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the arguments.

        Errors of the parser get the command as context, so that their messages can refer to the command's help.
        """
        ctx.meta[GIVEN] = [*args]
        try:
            return super().parse_args(ctx, args)
        except click.UsageError as error:
            error.ctx = error.ctx or ctx
            missing = isinstance(error, click.MissingParameter)
            if type(error) is click.UsageError or missing:
                from confab.commands.misplaced import correction

                right = correction(ctx, ctx.meta[GIVEN], missing)
                said = [error.format_message().rstrip(".")] if missing or not right else []
                raise click.UsageError("; ".join([*said, *([right] if right else [])]), ctx) from error
            raise

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; raise `UsageError` if one file, or stdin, is given for two purposes."""
        read = [p for p in self.params if _reads_stdin(ctx.params.get(p.name or ""), p)]
        if len(read) > 1:
            names = " and ".join(map(_name, read))
            raise click.UsageError(f"stdin can be read only once; {names} are both '-'", ctx)
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
        try:
            if any(_is_no_scene(each, ctx.params.get(each.name or "")) for each in self.params):
                raise KnowledgeError("wanted a scene")
            return super().invoke(ctx)
        except Exit as end:  # click would free all data of the command, which takes seconds for a large scene
            sys.stdout.flush()
            raise SystemExit(end.exit_code) from end
        except KnowledgeError as error:
            from confab.commands.misplaced import correction
            from confab.reasoner.memory.links_file import AnotherKindError

            if right := correction(ctx, ctx.meta[GIVEN], known=True):
                said = f"{error}; " * (len(str(error)) <= SHORT)
                if isinstance(error, AnotherKindError):  # the correct command line begins with the kind of the file
                    said = "wanted a memory; "
                raise KnowledgeError(said + right) from error
            raise


GIVEN = "confab.given"
"""The index of the words of the command line in `click.Context.meta`."""
SHORT = 100
"""Maximum length of an error about a value that precedes the correct command line; longer ones are left out."""


def _is_no_scene(parameter: click.Parameter, given: object) -> bool:
    """Return whether a scene is wanted and a file of Confab with another kind of content is given."""
    values = given if isinstance(given, tuple) else (given,)
    named = [value for value in values if isinstance(value, str) and value.endswith(".json")]
    if not named or getattr(parameter.type, "kind", "") != A_SCENE:
        return False
    from confab.commands.misplaced import kind_of_value

    return any(kind_of_value(value) not in ("", A_SCENE) for value in named)


def _reads_stdin(given: object, parameter: click.Parameter) -> bool:
    """Return whether a value of a parameter denotes standard input."""
    values = given if isinstance(given, tuple) else (given,)
    return any(value in (STDIN, "-") for value in values) and not isinstance(parameter.type, Output)


def _same_file(path: Path, given: object, parameter: click.Parameter) -> bool:
    """Return whether the value of a parameter denotes the same file as a path, possibly through links."""
    if not isinstance(given, str | Path):
        return False
    try:
        return path.samefile(given)
    except (OSError, ValueError):  # one of the files doesn't exist
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
    """Return the completions of a scene argument whose beginning is given: shipped scenes, folders and ontology files."""
    folder = Path(begun.rpartition("/")[0] or ("/" if begun.startswith("/") else "."))
    found = sorted(folder.glob(f"{glob.escape(begun.rpartition('/')[2])}*"))
    files = [str(path) + "/" * path.is_dir() for path in found if path.is_dir() or path.suffix in ontology.SUFFIXES]
    return [*(name for name in ontology.scenes() if name.startswith(begun)), *files]


_QUIET = click.option(
    "-q", "--quiet", is_flag=True, expose_value=False, callback=_quiet, help="Print only results and errors."
)
_VERBOSE = click.option(
    "-v",
    "--verbose",
    is_flag=True,
    expose_value=False,
    callback=_verbose,
    help="Print the duration of each stage on stderr.",
)


def QUIET(function: Any) -> Any:  # noqa: N802 - it is used like the constants that are options
    """Add the options ``--quiet`` and ``--verbose`` to a command."""
    return _QUIET(_VERBOSE(function))


scene_argument = partial(click.argument, type=Text(A_SCENE), shell_complete=scene_names)
output_option = partial(click.option, "-o", "--output", "out")
_SCENE = scene_argument("scene", metavar="SCENE", help="Shipped name, file, URL of a SPARQL endpoint, or - for stdin.")


def _stored(context: click.Context, option: click.Parameter, given: tuple[str, ...]) -> None:
    context.meta[str(option.name)] = given


_change = partial(click.option, multiple=True, expose_value=False, callback=_stored)
_FACTS = _change(
    "--fact",
    "with_fact",
    metavar="FACT",
    help="A fact that replaces the scene's fact about its symbol, e.g. 'cup1 LOCATION location3'; repeatable.",
)
_WITHOUT_GOALS = _change(
    "--without-goal",
    "without_goal",
    metavar="GOAL",
    help="A goal of the scene to leave out, by its first words, e.g. 'cup1 LOCATION'; all: every goal; repeatable.",
)


def CHANGES(function: Any) -> Any:  # noqa: N802 - it is used like the constants that are options
    """Add the options that change a scene to a command; `confab.commands.given.with_changes` applies them."""
    return _FACTS(_WITHOUT_GOALS(function))


def SCENE(function: Any) -> Any:  # noqa: N802 - it is used like the constants that are options
    """Add the argument SCENE, and the options that change the scene, to a command."""
    return _SCENE(CHANGES(function))


SCENE_IRI = click.option(
    "--scene", "iri", type=Text(IRI), metavar="IRI", help="IRI of the scene at an endpoint with several scenes."
)
GOALS = click.option(
    "--goal",
    type=Text(FACT),
    multiple=True,
    metavar="FACT",
    help="A goal that replaces the goal of its symbol, e.g. 'cup2 LOCATION location8'; repeatable.",
)
MEMORY_FILE = click.option(
    "--memory", type=Input(MEMORY), metavar="FILE", help="Memory file; no other memory is read or written."
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
    """A time limit in seconds, of at most `LONGEST`."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return the value as a number of seconds; fail if the value exceeds `LONGEST` or isn't a number."""
        seconds = float(super().convert(value, param, ctx))
        if not seconds <= LONGEST:  # also excludes 'nan'
            self.fail(f"'{value}' is no time limit; wanted seconds up to {LONGEST:,.0f}", param, ctx)
        return seconds


LONGEST = 1e9
"""Maximum time limit in seconds."""
TIME_LIMIT = click.option(
    "--time-limit", type=Seconds(min=0.0, min_open=True), metavar="S", help="Time limit in seconds (exit 3)."
)
SEED = click.option("--seed", type=click.IntRange(min=0), default=0, help="Seed of all random numbers.")
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
    type=Seconds(min=0.0, min_open=True),
    default=60.0,
    metavar="S",
    help="Time limit of a query in seconds (exit 3).",
)
QUERY_ROWS = click.option(
    "--rows",
    type=click.IntRange(min=1),
    default=100000,
    metavar="N",
    help="Maximum number of rows of a query (exit 3).",
)

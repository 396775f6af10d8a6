"""Streams, exit codes and messages of the command line.

Results go to stdout; remarks and errors go to stderr, one line each. Users never see a traceback.
"""

from __future__ import annotations

import json
import os
import re
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from io import TextIOWrapper, UnsupportedOperation
from pathlib import Path
from threading import Timer, current_thread, main_thread
from typing import TYPE_CHECKING, Any, NoReturn

import click

from confab.progress import quiet
from confab.reasoner.graph.knowledge import KnowledgeError

if TYPE_CHECKING:
    from confab.reasoner.limits import Deadline

Ending = Callable[[int], NoReturn]
"""A function that ends the process at once with an exit code."""
YES, NO, MISUSE, GAVE_UP, BUG, INTERRUPTED, PIPE_CLOSED = 0, 1, 2, 3, 4, 130, 141
EXIT = {"solved": YES, "unsolvable": NO, "gave-up": GAVE_UP}
"""Exit codes by the status of a planning call."""
LONGEST = 2_000
"""Maximum number of characters of a message."""

WITHOUT_PHYSICS = (
    "this needs physics, and PyBullet isn't installed; pip install pybullet has wheels for Python 3.10 and 3.11, and compiles "
    "for other versions; all functions except physics work without PyBullet"
)


def run_to_end(call: Callable[[], int | None]) -> NoReturn:
    """Run the command line, and turn each exception into an exit code and one line on stderr."""
    from confab.reasoner.language import DomainError
    from confab.reasoner.limits import LimitError

    _open_streams()
    try:
        code = _interruptible(call) or YES  # a command without an exit code returns None
        sys.stdout.flush()
    except SystemExit as error:
        # click has replaced stdout if the reader of a pipe has ended
        closed = "PacifyFlush" in type(sys.stdout).__name__
        sys.exit(PIPE_CLOSED if closed else error.code)
    except click.ClickException as error:
        _end(MISUSE, _usage(error))
    except (KnowledgeError, DomainError) as error:
        _end(EXIT.get(getattr(error, "status", ""), MISUSE), by_options(str(error)))
    except LimitError as error:
        _end(GAVE_UP, by_options(str(error)))
    except MemoryError:
        _end(GAVE_UP, "gave up: there isn't enough memory for this")
    except RecursionError as error:
        _end(GAVE_UP, f"gave up: the input is nested too deeply; the position is in {_log(error)}")
    except (KeyboardInterrupt, click.Abort):
        _end(INTERRUPTED, "interrupted; every file is unchanged or complete")
    except OSError as error:
        try:
            sys.stdout.flush()
        except OSError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # discards the buffered output
        _end(MISUSE, f"{error.filename or 'stdout'}: {error.strerror or error}")
    except Exception as error:
        if isinstance(error, ModuleNotFoundError) and error.name == "pybullet":
            _end(MISUSE, WITHOUT_PHYSICS)
        what = f"{type(error).__name__}: {error}"
        _end(
            BUG,
            f"a fault of Confab, not yours ({what[:200]}); please open an issue (CONTRIBUTING.md) with {_log(error)}",
        )
    sys.exit(code)


def _interruptible(call: Callable[[], int | None]) -> int | None:
    """Call a function. On Ctrl-C, raise `KeyboardInterrupt` even if a library turns the interrupt into another error."""
    came = []

    def interrupt(sign: int, _: object) -> NoReturn:
        came.append(sign)
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGINT, interrupt) if current_thread() is main_thread() else None
    try:
        return call()
    except BaseException as error:
        if came:
            raise KeyboardInterrupt from error
        raise
    finally:
        if before is not None:
            signal.signal(signal.SIGINT, before)


@contextmanager
def limited(seconds: float | None) -> Iterator[Deadline]:
    """Limit the time of a command. If the command exceeds the limit by a tenth, the process is ended."""
    from confab.reasoner.limits import within

    with within(seconds) as deadline, ended_by(deadline, click.get_current_context().obj):
        yield deadline


@contextmanager
def ended_by(deadline: Deadline, ending: Ending | None) -> Iterator[None]:
    """End the process if a ``with`` block exceeds its time limit by a tenth, since a query of a store can't be interrupted.

    If the process ends, every file that the block writes is either complete or unchanged (`confab.reasoner.files.write_whole`).
    """
    if deadline.left is None or ending is None:
        yield
        return

    def end() -> None:
        _say(
            f"gave up after {deadline.seconds:g} s, within a step that can't be interrupted; give more time (--time-limit)"
        )
        ending(GAVE_UP)

    watch = Timer(deadline.left + deadline.seconds / 10, end)
    watch.daemon = True
    watch.start()
    try:
        yield
    finally:
        watch.cancel()


def told(out: Path, text: str) -> None:
    """Print the path of a written file and a text on stdout. If stdout is the written file, print the text on stderr."""
    if out == Path("-"):
        remark(text)
    else:
        print(f"{out}: {text}")


def show_result(what: Any) -> None:
    """Print JSON data, a text, a table or an object of rich to stdout; a table in a pipe has tab-separated values."""
    # The check reads the class: for an unknown attribute of an object, all modules would be searched for the meant name.
    tsv = getattr(type(what), "tsv", None)
    if tsv is not None and not sys.stdout.isatty():
        print(tsv(what), end="")
    elif isinstance(what, dict | list):
        print(json.dumps(what, indent=1, ensure_ascii=False))
    elif isinstance(what, str):
        print(what)
    else:
        from confab.show import show as show_whole

        show_whole(what)


def _open_streams() -> None:
    """Open the null device for each closed standard stream, and use UTF-8 in every locale.

    Without the null device, another file would get the descriptor of a closed stream. A file name that isn't UTF-8 is printed as
    the bytes of the name.
    """
    for stream in (sys.stdin, sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            with suppress(UnsupportedOperation):  # a stream that was read before keeps its encoding
                stream.reconfigure(encoding="utf-8", errors="surrogateescape")
    closed = [stream for stream in (0, 1, 2) if not _is_open(stream)]
    for _ in closed:
        os.open(os.devnull, os.O_RDWR)  # the device gets the lowest free file descriptor
    if 2 in closed:
        sys.stderr = open(2, "w", encoding="utf-8")  # noqa: SIM115
    if 1 in closed:
        sys.stdout = open(1, "w", encoding="utf-8")  # noqa: SIM115
        _end(MISUSE, "stdout is closed, so that no result can be printed; nothing was done")


def _is_open(stream: int) -> bool:
    try:
        os.fstat(stream)
    except OSError:
        return False
    return True


def _log(error: BaseException) -> str:
    """Write the traceback of an exception into a new file, and return the path of the file."""
    import tempfile
    import traceback

    said = "".join(traceback.format_exception(error))
    try:
        with tempfile.NamedTemporaryFile("w", prefix="confab-", suffix=".log", delete=False, encoding="utf-8") as file:
            file.write(f"{sys.version}\n{sys.argv}\n{said}")
    except OSError as failure:
        return f"this traceback, since no log can be written ({failure.strerror}): {said.splitlines()[-3:]}"
    return file.name


PARAMETER = re.compile(
    r"(?<![\w'])(?P<name>classes|engine|gui|memory|minimise|mode|optimal|port|scene|time_limit|video)=(?P<value>None|True|'\w[\w-]*'|)"
    r"(?=[\s),;.]|$)"
)
"""Pattern of a Python parameter, perhaps with a value, that also exists as an option of the command line."""


PLAINER = (
    (r" is not a valid float( range)?", " is no number"),
    (r" is not a valid integer( range)?", " is no whole number"),
    (r"([-\d.e+]+) is not in the range x>(=?)([-\d.e+]+)$", r"\1; wanted a number >\2 \3"),
    (r"([-\d.e+]+) is not in the range ([-\d.e+]+)<=x<=([-\d.e+]+)$", r"\1; wanted a number from \2 to \3"),
)
"""Patterns of messages of the library click about numbers, each with a plainer wording."""


def _usage(error: Any) -> str:
    """Return the error of a wrong call of the command in one line; for a call without arguments, print the help and exit."""
    if type(error).__name__ == "NoArgsIsHelpError":
        error.show()
        sys.exit(MISUSE)
    command = error.ctx.command_path if getattr(error, "ctx", None) else "confab"
    if isinstance(error, click.NoSuchOption) and error.ctx:
        return f"no such option '{error.option_name}'{_in_place_of(error.option_name, error.ctx)}; see {command} --help"
    said = " ".join(error.format_message().split()).rstrip(".")
    for pattern, plain in PLAINER:
        said = re.sub(pattern, plain, said)
    return f"{said[:1].lower()}{said[1:]}; see {command} --help"


def by_options(text: str) -> str:
    """Return an error's text with options of the command line in place of parameters in Python.

    >>> by_options("give more time"), by_options("name one, e.g. engine='fast-downward'")
    ('give more time (--time-limit)', 'name one, e.g. --engine fast-downward')
    """

    def option(found: re.Match[str]) -> str:
        name, value = found["name"].replace("_", "-"), found["value"].strip("'")
        if value == "None":
            return f"--no-{name}"
        return f"--{name} {value}".rstrip() if value != "True" else f"--{name}"

    text = text.replace("leave_levels=False", "--levels strict").replace(
        "give more time", "give more time (--time-limit)"
    )
    return PARAMETER.sub(option, text)


def _in_place_of(option: str, context: click.Context) -> str:
    """Return what to use in place of an unknown option: another option, an argument, or an option of other commands."""
    from confab.guessing import chosen, needless
    from confab.reasoner.names import nearest

    def names(command: click.Command | None) -> list[str]:
        options = [each for each in command.params if isinstance(each, click.Option)] if command else []
        return [name for each in options for name in each.opts if name.startswith("--")]

    plain = option.lstrip("-").replace("-", "_").lower()
    for each in context.command.params:
        if isinstance(each, click.Argument) and plain in (
            each.name,
            *re.split(r"[.…\[\]]", (each.metavar or "").lower()),
        ):
            return f"; give {(each.metavar or '').strip('[]…')} without the name of an option"
    if meant := chosen(option, names(context.command)):
        return f"; did you mean '{meant}'?"
    if why := needless(option):
        return f"; {why}"
    plainly = {name.lstrip("-"): name for name in names(context.command)}
    if near := nearest(option.lstrip("-"), plainly):
        return near.replace("'", "'--", 1)
    group = context.find_root().command
    if not isinstance(group, click.Group):
        return ""
    if plain in group.list_commands(context):
        return f"; confab {plain} is a command"
    commands = {name: names(group.get_command(context, name)) for name in group.list_commands(context)}
    others = [name for name, known in commands.items() if option in known]
    return f"; it is an option of {', '.join(others)}" if others else ""


def remark(text: str) -> None:
    """Print a line on stderr unless the option ``--quiet`` is given."""
    if not quiet():
        _say(text)


def _say(text: str) -> None:
    """Print a line on stderr, with unprintable characters escaped."""
    line = " ".join(text.split())
    shown = "".join(sign if sign.isprintable() else sign.encode("unicode_escape").decode() for sign in line[:LONGEST])
    with suppress(OSError):
        print(f"confab: {shown}{' …' if len(line) > LONGEST else ''}", file=sys.stderr)


def _end(code: int, text: str) -> NoReturn:
    _say(text)
    sys.exit(code)

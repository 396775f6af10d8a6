"""The correct command line for values at wrong places: files of another kind, goals, queries, numbers and names of output files.

Each argument and each option takes values of one kind, which is the attribute `kind` of its type. The kind of a given value is the
kind of an existing file (`confab.reasoner.kinds`), or follows from the value's text. A value moves to a free argument or option of
its kind; if the command has none, the hint names the commands that take values of this kind.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from shlex import quote

import click

from confab import ontology
from confab.commands.given import FACT, INTERVENTION, NUMBER, PDDL, QUERY, SCENE, TURTLE_EPISODE
from confab.reasoner.kinds import EPISODE, FILM, MEMORY, OBSERVED, PICTURE, PLAN, REPORT, VERDICTS, kind_of

OF_FILES = {PDDL: "PDDL", SCENE: "scene|ontology|XML document"} | {
    kind: kind for kind in (PLAN, VERDICTS, EPISODE, MEMORY, OBSERVED, REPORT, PICTURE, FILM)
}
"""The kinds of files, each with a pattern of its name in `confab.reasoner.kinds`."""
OF_TEXTS = {
    QUERY: r"(?i)\s*(SELECT|ASK|CONSTRUCT|DESCRIBE|PREFIX)\b\s*\S.*",
    INTERVENTION: r"(after|at)=\S+ .*",
    NUMBER: r"\d+",
    FACT: r"\S+ [A-Z]\w*( \S+)*",
}
"""The kinds of other values, each with a pattern."""
MOST = 3
"""Maximum number of calls that a hint gives."""

Placed = list[tuple[click.Parameter, str | None]]


def kind_of_value(value: str) -> str:
    """Return the kind of a value of the command line; return an empty text if the value may be of any kind.

    >>> kind_of_value("three-cups"), kind_of_value("cup1 LOCATION location7"), kind_of_value("ASK { ?o ?p ?x }"), kind_of_value("x")
    ('a scene', 'a fact', 'a query', '')
    """
    with suppress(OSError, ValueError):  # the text can't be the name of a file, or the file can't be read
        if Path(value).is_file():
            return _kind_of_file(Path(value), Path(value).stat().st_mtime_ns)
    if value in ontology.scenes():
        return SCENE
    if any(file.stem == value for file in (ontology.ROOT / "questions").glob("**/*.rq")):
        return QUERY
    return next((kind for kind, text in OF_TEXTS.items() if re.fullmatch(text, value, re.DOTALL)), "")


@cache
def _kind_of_file(path: Path, changed: int) -> str:
    """Return the kind of a file that was changed at a time; empty for other kinds of files."""
    found = kind_of(path)
    if found and found.name == EPISODE and path.suffix == ".ttl":
        return TURTLE_EPISODE
    return next((kind for kind, name in OF_FILES.items() if found and re.search(name, found.name)), "")


def _exists(value: str) -> bool:
    with suppress(OSError, ValueError):
        return Path(value).exists()
    return True


def taken(parameter: click.Parameter) -> str:
    """Return the kind of values that an argument or an option takes; an empty text for any kind."""
    return NUMBER if isinstance(parameter.type, click.IntRange) else getattr(parameter.type, "kind", "")


def written(parameter: click.Parameter) -> bool:
    """Return whether a parameter is the option for the main output of a command."""
    return isinstance(parameter, click.Option) and "-o" in parameter.opts


def scanned(command: click.Command, words: Sequence[str]) -> Iterator[tuple[click.Parameter | None, str | None]]:
    """Yield the words of a command line: each option with its value, or with None for a flag, and None with each other value."""
    options = {name: each for each in command.params if isinstance(each, click.Option) for name in each.opts}
    waiting = [*words]
    while waiting:
        word = waiting.pop(0)
        name, equals, value = word.partition("=")
        option = options.get(name)
        if option is None:
            yield None, word
        elif option.is_flag or equals or waiting:
            yield option, None if option.is_flag else value if equals else waiting.pop(0)


def rearranged(command: click.Command, words: Sequence[str]) -> tuple[Placed, list[str], list[str]]:
    """Return the values by their right places, the values that have moved, and the values without a place."""
    placed, loose, moved = Placed(), list[tuple[click.Parameter | None, str]](), list[str]()
    for option, value in scanned(command, words):
        if option and (
            value is None or taken(option) in ("", NUMBER, kind_of_value(value)) or not kind_of_value(value)
        ):
            placed.append((option, value))
        elif value is not None:
            loose.append((option, value))
    values = [value for option, value in loose if option is None]
    rest = " ".join(values[1:])
    if len(values) > 2 and kind_of_value(rest) in (FACT, QUERY):  # a text without quotes
        loose = [(None, values[0]), (None, rest), *((option, value) for option, value in loose if option)]
        moved.append(rest)

    def free(parameters: Iterable[click.Parameter]) -> list[click.Parameter]:
        full = {id(each) for each, _ in placed if each.nargs == 1 and not getattr(each, "multiple", False)}
        return [each for each in parameters if id(each) not in full]

    arguments = [each for each in command.params if isinstance(each, click.Argument)]
    options = [each for each in command.params if isinstance(each, click.Option)]
    order = [each for each in arguments for _ in range(1 if each.nargs == 1 else len(loose))]
    before = dict(zip((id(pair) for pair in loose if pair[0] is None), order, strict=False))
    for sure in (True, False):  # values of other kinds get the places that are left
        for pair in [*loose]:
            option, value = pair
            kind = kind_of_value(value)
            fitting = [
                each for each in free(command.params) if taken(each) == kind and (not written(each) or kind == MEMORY)
            ]
            fitting.sort(key=lambda each: isinstance(each, click.Option))
            if not sure:
                anywhere = [each for each in free(arguments) if kind in ("", NUMBER) or not taken(each)]
                fitting = anywhere or (fitting if kind == NUMBER else [])
                outputs = [each for each in free(options) if written(each) and kind == "" and not _exists(value)]
                endings = ("", Path(value).suffix)
                if outputs and (not fitting or (endings[1] and Path(outputs[0].metavar or "").suffix in endings)):
                    fitting = outputs
            elif kind in ("", NUMBER):
                continue
            if fitting:
                placed.append((fitting[0], value))
                moved += [value] * (fitting[0] is not (option or before.get(id(pair))))
                loose.remove(pair)
    return placed, moved, [value for _, value in loose]


def line(path: str, command: click.Command, context: click.Context, placed: Placed) -> str:
    """Return the call of a command with the given values, and with a placeholder for each missing value."""
    words = [path]
    for argument in (each for each in command.params if isinstance(each, click.Argument)):
        values = [quote(value) for each, value in placed if each is argument and value is not None]
        both = taken(argument) and any(value and kind_of_value(value) == taken(argument) for _, value in placed)
        wanted = bool(argument.required or both)
        words += values or [(argument.metavar or "").strip("[]")] * wanted
    given = [(each, value) for each, value in placed if isinstance(each, click.Option)]
    for option, value in given:
        words += [option.opts[0], *([] if value is None else [quote(value)])]
    for each in command.params:
        if isinstance(each, click.Option) and each.required and all(option is not each for option, _ in given):
            words += [each.opts[0], each.make_metavar(context)]
    return " ".join(words)


def taking(values: Sequence[str], group: click.Command, context: click.Context, path: str = "confab") -> list[str]:
    """Return the calls of all commands that take values of these kinds, those with arguments for them first."""
    if isinstance(group, click.Group):
        found = [(name, group.get_command(context, name)) for name in group.list_commands(context)]
        calls = [call for name, each in found if each for call in taking(values, each, context, f"{path} {name}")]
        return sorted(calls, key=lambda call: re.search(r" --\w+ (?!FILE)", call) is not None)
    placed, _, left = rearranged(group, values)
    fits = all(value is not None and taken(each) == kind_of_value(value) for each, value in placed)
    changed = any(hasattr(each.type, "may_be") for each, _ in placed)  # a file that the command writes
    return [line(path, group, context, placed)] if placed and not left and fits and not changed else []


def known_as(values: Sequence[str], context: click.Context) -> str:
    """Return what the first value of a known kind is, and calls that take all values; empty if no call takes them."""
    known = [value for value in values if kind_of_value(value) not in ("", NUMBER)]
    if not known:
        return ""
    said = f"{quote(known[0])} is {kind_of_value(known[0])}"
    if kind_of_value(known[0]) in (REPORT, PICTURE, FILM):
        return f"{said}; a browser shows it"
    root = context.find_root().command
    calls = taking(known, root, context) or taking(known[:1], root, context)
    return f"{said}; use: {' | '.join(calls[:MOST])}" if calls else ""


def correction(context: click.Context, words: Sequence[str], missing: bool = False, known: bool = False) -> str:
    """Return the correct call for given words, or calls of other commands for values that the command doesn't take.

    The text is empty if no value is at a wrong place; if a value is missing, the call with a placeholder is returned. If `known`,
    only values of a known kind count.
    """
    placed, moved, left = rearranged(context.command, words)
    if left:
        return known_as(left, context)
    kinds = [f"{quote(value)} is {kind_of_value(value)}" for value in moved if kind_of_value(value) not in ("", NUMBER)]
    call = line(context.command_path, context.command, context, placed)
    return "; ".join([*kinds[:1], f"use: {call}"]) if kinds or (moved and not known) or missing else ""

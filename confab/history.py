"""Stored runs of ``confab run`` as a list, a comparison or a page. Each run has a folder with a record ``run.json``."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, cast

from confab.interchange import read_json
from confab.reasoner.files import made_folder, write_whole
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.names import local_name, nearest, right_arguments
from confab.table import Table

if TYPE_CHECKING:
    from confab.page.schema import PageData

RECORD = "run.json"
"""Name of the file with the record of a run."""


@dataclass(frozen=True)
class Run:
    """A stored run: the name of its folder, its date, its options, the content of the memory as text, and the data of its page.

    Examples
    --------
    `confab run SCENE -o runs --keep` makes a stored run; `confab.history.runs("runs")` reads all stored runs.
    """

    name: str
    when: str
    how: Mapping[str, object]
    memory: str
    page: PageData

    def figures(self) -> dict[str, str]:
        """Return the verdict, the figures, the options and the memory of the run as texts, by name."""
        sign = {True: "✓ ", False: "✗ ", None: ""}[self.page.get("good")]
        figures = {"verdict": sign + self.page["status"]}
        figures |= {tile["name"]: tile["text"] for tile in self.page["tiles"]}
        return {**figures, **{name: _text(value) for name, value in self.how.items()}, "memory": self.memory}

    def steps(self) -> list[str]:
        """Return the steps of the first level as sentences."""
        return [step["what"] for step in self.page["steps"] if "." not in step["id"]]


def record(folder: Path, page: PageData, how: Mapping[str, object], memory: str) -> Path:
    """Write the record of a run into the run's folder, without the film, and return the path of the record."""
    shown = {key: value for key, value in page.items() if key != "film"}
    when = datetime.now().astimezone().isoformat(timespec="seconds")
    data = {"run": folder.resolve().name, "when": when, "how": dict(how), "memory": memory, "page": shown}
    write_whole(folder / RECORD, json.dumps(data, ensure_ascii=False) + "\n")
    return folder / RECORD


def new_folder(runs: Path) -> Path:
    """Create a folder for the next run in `runs`, and return its path. Folders are numbered from 001."""
    made_folder(runs)
    last = max((int(one.name) for one in runs.iterdir() if one.name.isdecimal() and one.name.isascii()), default=0)
    while True:
        last += 1
        folder = runs / f"{last:03}"
        try:
            folder.mkdir()  # fails if another process has just created the folder
        except FileExistsError:
            continue
        return folder


@right_arguments
def runs(folder: str | Path) -> list[Run]:
    """Return the runs in a folder in the order of their dates.

    Raises
    ------
    KnowledgeError
        The folder doesn't exist or contains no run, or a record can't be read.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise KnowledgeError(f"{folder}: no such folder; 'confab run SCENE -o {folder} --keep' creates the folder")
    files = [folder / RECORD, *sorted(folder.glob(f"*/{RECORD}"))]
    found = [_read(file) for file in files if file.is_file()]
    if not found:
        raise KnowledgeError(f"{folder}: has no runs; 'confab run SCENE -o {folder} --keep' keeps one there")
    return sorted(found, key=lambda run: (run.when, run.name))


def _read(file: Path) -> Run:
    data = read_json(file, "record of a run")
    match data:
        case {"when": str(when), "how": dict(how), "memory": str(memory), "page": dict(page)} if _is_page(page):
            return Run(file.parent.resolve().name, when, how, memory, cast("PageData", page))
    raise KnowledgeError(f"{file}: is no record of a run; wanted what 'confab run' writes")


def _is_page(page: Mapping[str, object]) -> bool:
    lists = ("tiles", "steps", "rows", "goals", "marks", "notes")
    return isinstance(page.get("status"), str) and all(isinstance(page.get(name), list) for name in lists)


@right_arguments
def listed(those: Sequence[Run] | str | Path) -> Table:
    """Return a table with a row for each run, or each run in a folder, and a column for each figure."""
    those = runs(those) if isinstance(those, str | Path) else those
    figures = [run.figures() for run in those]
    names = tuple(dict.fromkeys(name for one in figures for name in one))
    rows = tuple(
        (run.name, local_name(run.page["iri"]), run.when, *(one.get(name, "") for name in names))
        for run, one in zip(those, figures, strict=True)
    )
    return Table(("run", "scene", "when", *names), rows)


@right_arguments
def compared(those: Sequence[Run] | str | Path, one: str, other: str) -> Table:
    """Return a table of the differences between two runs, in figures, in first-level steps, and in final values of goals.

    `those` are the runs, or the folder that contains them.

    Raises
    ------
    KnowledgeError
        No run has one of the given names.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> import confab
    >>> from confab.page.data import page_data
    >>> scene = confab.load("two-cups")
    >>> with TemporaryDirectory() as folder:
    ...     for goal in ("cup2 LOCATION location2", "cup2 LOCATION location8"):
    ...         page = page_data(scene, scene.plan(goal))
    ...         written = record(new_folder(Path(folder)), page, {"goal": goal}, "none")
    ...     those = runs(folder)
    >>> [run.name for run in those]
    ['001', '002']
    >>> [row for row in compared(those, "001", "002") if row[0] in ("goal", "primitives")]
    [('primitives', '20', '26'), ('goal', 'cup2 LOCATION location2', 'cup2 LOCATION location8')]
    """
    by_name = _by_name(runs(those) if isinstance(those, str | Path) else those, (one, other))
    return Table(("what", one, other), tuple(_differences(by_name[one], by_name[other])))


def _by_name(those: Sequence[Run], wanted: Sequence[str]) -> dict[str, Run]:
    """Return all runs by name; raise `KnowledgeError` if a run of `wanted` is missing."""
    by_name = {run.name: run for run in those}
    for name in wanted:
        if name not in by_name:
            raise KnowledgeError(f"no run '{name}'{nearest(name, by_name)} (runs: {', '.join(by_name)})")
    return by_name


def _differences(one: Run, other: Run) -> Iterator[tuple[str, str, str]]:
    a, b = one.figures(), other.figures()
    for name in dict.fromkeys((*a, *b)):
        if a.get(name, "") != b.get(name, ""):
            yield name, a.get(name, ""), b.get(name, "")
    first, second = Counter(one.steps()), Counter(other.steps())
    for step in (first - second).elements():
        yield "step", step, ""
    for step in (second - first).elements():
        yield "step", "", step
    ends = [{goal["label"]: goal.get("after", "") for goal in run.page["goals"]} for run in (one, other)]
    for goal in dict.fromkeys((*ends[0], *ends[1])):
        if ends[0].get(goal) != ends[1].get(goal):
            yield f"in the end ({goal})", ends[0].get(goal, "not pursued"), ends[1].get(goal, "not pursued")


def history_html(those: Sequence[Run], title: str, names: Sequence[str] = ()) -> str:
    """Return the HTML page that shows and compares runs. The page first shows the runs in `names`, by default the last run.

    Raises
    ------
    KnowledgeError
        No run has one of the given names.
    """
    from confab.page.frozen import page_html

    by_name = _by_name(those, names)
    shown = [those.index(by_name[name]) for name in names] or [len(those) - 1]
    told = [
        {
            "name": run.name,
            "scene": local_name(run.page["iri"]),
            "when": run.when,
            "figures": run.figures(),
            "page": run.page,
        }
        for run in those
    ]
    return page_html({"title": title, "runs": told, "shown": shown}, title)


def _text(value: object) -> str:
    if isinstance(value, list):
        return ", ".join(map(_text, value))
    return f"{value:g}" if isinstance(value, float) else str(value)

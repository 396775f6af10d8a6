"""Detection of changes of ontology files and their imports."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from time import sleep

from confab import ontology
from confab.reasoner.graph.knowledge import KnowledgeError, load, scene_file

PAUSE = 0.3
"""Seconds between two checks of the files."""


def again_and_again(files: Sequence[str | Path]) -> Iterator[None]:
    """Yield None whenever ontology files or their imports have changed; the iterator never ends."""
    watched = _with_imports(files)
    seen = _stamps(watched)
    while True:
        sleep(PAUSE)
        if _stamps(watched) != seen:
            sleep(PAUSE)  # an editor may write a file in several steps
            watched = _with_imports(files)
            seen = _stamps(watched)
            yield


def _with_imports(files: Sequence[str | Path]) -> set[Path]:
    found: set[Path] = set()
    for file in files:
        path = scene_file(file)
        found |= {path, path.with_name(ontology.CATALOG)}
        try:
            found |= set(load(path, tolerant=True).files.values())
        except KnowledgeError:  # validation reports the error
            continue
    return found


def _stamps(files: set[Path]) -> dict[Path, tuple[int, int] | None]:
    return {file: (file.stat().st_size, file.stat().st_mtime_ns) if file.is_file() else None for file in files}

"""Watching edited files: report every change of a file or of an import."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from time import sleep

from confab import ontology
from confab.reasoner.graph.knowledge import KnowledgeError, load, scene_file

PAUSE = 0.3
"""Seconds between two looks."""


def again_and_again(files: Sequence[str | Path], pause: float = PAUSE) -> Iterator[None]:
    """Yield whenever some ontology files or their imports have changed; without end."""
    watched = _with_imports(files)
    seen = _stamps(watched)
    while True:
        sleep(pause)
        if _stamps(watched) != seen:
            sleep(pause)  # an editor that writes a file in several steps is done by then
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
        except KnowledgeError:  # reported by validation
            continue
    return found


def _stamps(files: set[Path]) -> dict[Path, tuple[int, int] | None]:
    return {file: (file.stat().st_size, file.stat().st_mtime_ns) if file.is_file() else None for file in files}

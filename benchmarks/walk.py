"""The files that one planning call enters, with their lengths, traced by `sys.settrace`."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path
from types import FrameType

import confab

ROOT = Path(__file__).resolve().parents[1]
SCENE = os.environ.get("CONFAB_SCENE", "beverage-serving")


def entered(call: Callable[[], object]) -> dict[str, int]:
    """Return the files of this repository whose functions a call enters, with their numbers of lines; imports don't count."""
    call()
    files: set[str] = set()

    def trace(frame: FrameType, event: str, argument: object) -> None:
        if frame.f_code.co_name != "<module>":
            files.add(frame.f_code.co_filename)

    sys.settrace(trace)
    try:
        call()
    finally:
        sys.settrace(None)
    here = sorted(Path(file) for file in files if file.startswith(f"{ROOT}{os.sep}"))
    inside = [path for path in here if ".venv" not in path.relative_to(ROOT).parts]
    return {str(path.relative_to(ROOT)): len(path.read_text(encoding="utf-8").splitlines()) for path in inside}


def main() -> None:
    """Print the numbers of files and lines, in total and in `planner/`, for the default mode and the paper's mode."""
    print("| mode | files, lines in all | in `planner/` | which |\n|---|---|---|---|")
    for mode in ("guarded", "paper"):
        files = entered(lambda mode=mode: confab.load(SCENE).plan(mode=mode))  # type: ignore[misc]
        ours = {path: lines for path, lines in files.items() if "planner/" in path}
        names = ", ".join(f"{path.partition('planner/')[2]} {lines}" for path, lines in ours.items())
        print(f"| {mode} | {len(files)}, {sum(files.values()):,} | {len(ours)}, {sum(ours.values()):,} | {names} |")

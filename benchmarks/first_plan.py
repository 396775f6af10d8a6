"""The time from a clone to the first verified plan, without installed packages and caches.

    python -m benchmarks.first_plan

The steps are the clone, the installation from the package index, and `make demo`, which also makes a film and a report.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

from benchmarks._processes import seconds_of_children

ROOT = Path(__file__).resolve().parents[1]


def timed(command: Sequence[str], folder: Path) -> tuple[float, float, str]:
    """Run a command; return its duration in seconds, its CPU seconds and its output."""
    environment = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "VIRTUAL_ENV", "MAKEFLAGS")}
    begin, before = perf_counter(), seconds_of_children()
    done = subprocess.run(
        command, cwd=folder, env={**environment, "PIP_NO_CACHE_DIR": "1"}, capture_output=True, text=True, check=False
    )
    if done.returncode:
        sys.exit(f"{' '.join(command)}: {done.stderr[-500:]}")
    return perf_counter() - begin, seconds_of_children() - before, done.stdout


def main() -> None:
    """Print a table of the steps and their times."""
    print("| step | s | CPU s |\n|---|---|---|")
    total = work = 0.0
    with TemporaryDirectory() as name:
        folder = Path(name)
        house = folder / "confab"
        for what, command, where in (
            ("`git clone`", ["git", "clone", "-q", str(ROOT), "confab"], folder),
            ("`make .venv/installed`: Python packages, from the index", ["make", ".venv/installed"], house),
            ("`make demo`: validate, plan, verify, film, learn, report", ["make", "demo"], house),
        ):
            seconds, cpu, printed = timed(command, where)
            total, work = total + seconds, work + cpu
            print(f"| {what} | {seconds:.0f} | {cpu:.0f} |", flush=True)
    if "✓" not in printed:
        sys.exit("the demo's plan wasn't verified")
    print(f"| from nothing to the first verified plan | {total:.0f} | {work:.0f} |")


if __name__ == "__main__":
    main()

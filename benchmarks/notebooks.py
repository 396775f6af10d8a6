"""Execution of all notebooks by `make notebooks`, which stores their outputs and prints the time of each notebook.

python -m benchmarks.notebooks [PART OF A NAME …]
"""

from __future__ import annotations

import resource
import sys
from pathlib import Path
from time import perf_counter

import nbformat
from nbclient import NotebookClient

FOLDER = Path(__file__).resolve().parents[1] / "notebooks"
SLOWEST = 60.0
"""CPU seconds after which a notebook is too slow for readers."""


def execute(path: Path) -> tuple[float, float]:
    """Execute a notebook in its folder and save its outputs; return its seconds and CPU seconds."""
    book = nbformat.read(path, as_version=4)  # type: ignore[no-untyped-call]
    begin, before = perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    client = NotebookClient(book, timeout=600, record_timing=False, resources={"metadata": {"path": str(path.parent)}})
    client.execute()
    took = perf_counter() - begin
    for cell in book.cells:
        cell.metadata.pop("execution", None)
        for output in cell.get("outputs", []):
            data = output.get("data", {})
            if "image/png" in data:  # one form of a picture is enough
                data.pop("image/jpeg", None)
    nbformat.write(book, path)  # type: ignore[no-untyped-call]
    return took, resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before


def main() -> None:
    """Execute the notebooks whose names contain a given part, or all."""
    wanted = sys.argv[1:] if sys.argv[0].endswith("notebooks.py") else []
    print("| notebook | s | CPU s |\n|---|---|---|")
    for path in sorted(FOLDER.glob("*.ipynb")):
        if not wanted or any(part in path.name for part in wanted):
            seconds, cpu = execute(path)
            slow = f" (over {SLOWEST:g})" if cpu > SLOWEST else ""
            print(f"| {path.stem} | {seconds:.0f} | {cpu:.0f}{slow} |", flush=True)


if __name__ == "__main__":
    main()

"""Run all benchmarks, or the benchmarks named on the command line.

    python -m benchmarks [NAME …]

A benchmark is a module of this folder with a function ``main()`` that prints tables.
"""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path
from time import perf_counter

NAMES = tuple(
    sorted(
        path.stem
        for path in Path(__file__).parent.glob("*.py")
        if not path.stem.startswith("_") and "def main()" in path.read_text(encoding="utf-8")
    )
)


def run(names: list[str]) -> int:
    """Run the named benchmarks; return 2 if a name is unknown."""
    unknown = [name for name in names if name not in NAMES]
    if unknown:
        print(f"no benchmark {', '.join(unknown)}; there are: {', '.join(NAMES)}", file=sys.stderr)
        return 2
    for name in names or NAMES:
        begin = perf_counter()
        print(f"\n## {name}\n", flush=True)
        import_module(f"benchmarks.{name}").main()
        print(f"\n({name}: {perf_counter() - begin:.0f} s)", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(run(sys.argv[1:]))

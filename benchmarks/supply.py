"""The licences of all packages in the lock files, as the packages state them.

    python -m benchmarks.supply

Packages for other systems, and packages that aren't installed, are listed without a licence. The command `make lock` pins
versions and hashes of packages. The command `make` installs only pinned packages.
"""

from __future__ import annotations

import re
from collections import defaultdict
from importlib.metadata import PackageNotFoundError, metadata
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LOCKS = {"requirements.lock": "make", "requirements-bench.lock": "make bench, make docs, make test with CI=true"}
PINNED = re.compile(r"^([a-z0-9][a-z0-9._-]*)==(\S+)", re.MULTILINE)
SHORT = 60


def licence(package: str) -> str:
    """Return the licence that an installed package states, or the reason why no licence is available."""
    try:
        said = metadata(package)
    except PackageNotFoundError:
        return "(not installed here)"
    kinds = [c.rsplit(" :: ", 1)[-1] for c in said.get_all("Classifier") or () if c.startswith("License ::")]

    def one(field: str) -> str:
        return str(said.json.get(field.lower().replace("-", "_"), ""))

    stated = one("License-Expression") or " / ".join(kinds) or one("License").strip().split("\n")[0]
    return stated[:SHORT] or "(states none)"


def main() -> None:
    """Print a table of the licences, with the number and the names of the packages."""
    found: dict[str, set[str]] = {name: {p for p, _ in PINNED.findall((ROOT / name).read_text())} for name in LOCKS}
    light, all_of = found["requirements.lock"], set().union(*found.values())
    by_licence: dict[str, list[str]] = defaultdict(list)
    for package in sorted(all_of):
        by_licence[licence(package)].append(package if package in light else f"*{package}*")
    print(
        "| licence | packages | which (*those of `make bench`, `make docs` and `make test` with CI=true alone*) |\n|---|---|---|"
    )
    for kind, packages in sorted(by_licence.items(), key=lambda row: (-len(row[1]), row[0])):
        print(f"| {kind} | {len(packages)} | {', '.join(packages)} |")


if __name__ == "__main__":
    main()

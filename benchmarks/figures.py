"""Blocks of figures in the documentation; the header of a block names its command, its commit, and the measured code.

    <!-- figures NAME: COMMAND; commit ABC1234; 2026-01-31; measures PATH PATH; table 2; quick -->
    …
    <small>Commit ABC1234, 2026-01-31</small>

    <!-- end -->

    python -m benchmarks.figures            list the blocks that are older than the code that they measure
    python -m benchmarks.figures quick      update the blocks marked quick: counts, lengths, ratios (`make figures`)
    python -m benchmarks.figures all        update all blocks, which takes hours (`make bench`)
    python -m benchmarks.figures NAME …     update the named blocks

A block contains the output of its command, or the table of the stated number in the output. The last line of a block shows the
commit and the date of the header in small print, because readers of the site don't see the header. Several blocks may share a
command, which is then run once. A block marked `prose` was edited by hand. The new figures of a `prose` block are written to
confab-out/figures/NAME.md, for another edit by hand.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
ASIDE = ROOT / "confab-out" / "figures"
BLOCK = re.compile(r"<!-- figures (?P<name>[\w-]+): (?P<header>.*?) -->\n(?P<text>.*?)<!-- end -->", re.DOTALL)
COMMIT, DATE = re.compile(r"commit ([0-9a-f]{7,40})"), re.compile(r"\d{4}-\d\d-\d\d")
NOISE = re.compile(r"(?m)^(#+ .*|\(\w+: \d+ s\))$\n?")
"""The headings and times that `python -m benchmarks` prints."""


class NoHistoryError(Exception):
    """Raised when Git can't list the changes since a commit, for example in a shallow clone."""


@dataclass(frozen=True)
class Block:
    """One block of figures; missing fields of its header are empty."""

    page: Path
    name: str
    header: str

    @property
    def fields(self) -> list[str]:
        """The parts of the header; the first is the command."""
        return [part.strip() for part in self.header.split(";")]

    @property
    def commit(self) -> str:
        """The commit at which the figures were measured."""
        return next((found[1] for field in self.fields[1:] if (found := COMMIT.fullmatch(field))), "")

    @property
    def date(self) -> str:
        """The day of the measurement."""
        return next((field for field in self.fields[1:] if DATE.fullmatch(field)), "")

    @property
    def small_print(self) -> str:
        """The last line of the block, which shows readers the commit and the date."""
        return f"<small>Commit {self.commit}, {self.date}</small>"

    @property
    def measures(self) -> list[str]:
        """The paths of the code that is measured."""
        return next((field.split()[1:] for field in self.fields[1:] if field.startswith("measures ")), [])

    @property
    def table(self) -> int:
        """The number of the table in the output; 0 for the whole output."""
        return next((int(field[6:]) for field in self.fields[1:] if field.startswith("table ")), 0)

    def faults(self, root: Path) -> Iterator[str]:
        """Yield a message for each missing or wrong field of the header."""
        if not re.search(r"\bpython -m \w", self.fields[0]):
            yield f"{self}: no command, but '{self.fields[0]}'; wanted one with 'python -m …' first"
        if not self.commit:
            yield f"{self}: no commit; wanted '; commit ABC1234'"
        if not self.date:
            yield f"{self}: no date; wanted '; 2026-01-31'"
        if not self.measures:
            yield f"{self}: nothing that it measures; wanted '; measures PATH …'"
        yield from (
            f"{self}: measures {path}, which doesn't exist" for path in self.measures if not (root / path).exists()
        )

    def since(self, root: Path) -> list[str]:
        """Return the commits that changed the measured code since the measurement, newest first."""
        command = ["git", "-C", str(root), "log", "--format=%h", f"{self.commit}..HEAD", "--", *self.measures]
        try:
            done = subprocess.run(command, capture_output=True, text=True, check=False)
        except OSError as error:
            raise NoHistoryError(str(error)) from error
        if done.returncode:
            raise NoHistoryError(done.stderr.strip().splitlines()[0])
        return done.stdout.split()

    def last(self, root: Path) -> str:
        """Return the last commit that changed the measured code; a rebase of later commits doesn't change this commit."""
        command = ["git", "-C", str(root), "log", "-1", "--format=%h", "--", *self.measures]
        return subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout.strip()

    def __str__(self) -> str:
        return f"{self.page.name} {self.name}"


def blocks(root: Path = ROOT) -> list[Block]:
    """Return all blocks of figures in README.md and docs/, including subfolders."""
    pages = [page for page in (root / "README.md", *sorted((root / "docs").rglob("*.md"))) if page.exists()]
    return [Block(page, m["name"], m["header"]) for page in pages for m in BLOCK.finditer(page.read_text("utf-8"))]


def stale(root: Path = ROOT) -> list[str]:
    """Return a line for each block that is older than the measured code or has an unknown age."""
    found = []
    for block in blocks(root):
        try:
            commits = block.since(root)
        except NoHistoryError as error:
            found.append(f"{block}: can't be dated ({error})")
            continue
        if commits:
            found.append(f"{block}: of {block.commit}, {len(commits)} commits behind {commits[0]}: {block.fields[0]}")
    return found


def printed(command: str) -> str:
    """Run a command with this Python, and return its output; an empty text if the command fails."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}"
    env = {**os.environ, "PATH": path}
    done = subprocess.run(command, shell=True, cwd=ROOT, env=env, stdout=subprocess.PIPE, text=True, check=False)
    return NOISE.sub("", done.stdout).strip() if done.returncode == 0 else ""


def chosen(text: str, number: int) -> str:
    """Return table `number` of a text; for 0 the whole text, as a code block if it has no tables."""
    tables = [found.strip() for found in re.findall(r"(?:^\|.*\n?)+", text, re.MULTILINE)]
    if number:
        return tables[number - 1] if number <= len(tables) else ""
    return text if tables or not text else f"```\n{text}\n```"


def write(wanted: Sequence[Block]) -> int:
    """Measure blocks again, and write each result into its page at once; return 1 if a result is missing."""
    failed = 0
    for command in dict.fromkeys(block.fields[0] for block in wanted):
        text = printed(command)
        for block in (block for block in wanted if block.fields[0] == command):
            figures = chosen(text, block.table)
            if not figures:
                failed = 1
                print(f"{block}: left as it was, since this printed no such figures: {command}", file=sys.stderr)
            elif "prose" in block.fields:
                ASIDE.mkdir(parents=True, exist_ok=True)
                (ASIDE / f"{block.name}.md").write_text(figures + "\n", "utf-8")
                print(f"{block}: to be edited by hand, from {(ASIDE / block.name).relative_to(ROOT)}.md", flush=True)
            else:
                header = DATE.sub(str(date.today()), COMMIT.sub(f"commit {block.last(ROOT)}", block.header))
                small_print = Block(block.page, block.name, header).small_print
                new = f"<!-- figures {block.name}: {header} -->\n\n{figures}\n\n{small_print}\n\n<!-- end -->"
                old = block.page.read_text("utf-8")
                this = next(m[0] for m in BLOCK.finditer(old) if m["name"] == block.name)
                block.page.write_text(old.replace(this, new), "utf-8")
                print(f"{block}: written", flush=True)
    return failed


def main(names: Sequence[str]) -> int:
    """Update the named blocks, or list the stale blocks."""
    there = blocks()
    unknown = set(names) - {block.name for block in there} - {"quick", "all"}
    if unknown:
        print(
            f"no figures {', '.join(sorted(unknown))}; there are: {', '.join(b.name for b in there)}", file=sys.stderr
        )
        return 2
    dirty = subprocess.run(
        ["git", "-C", str(ROOT), "status", "--porcelain", "--", *{p for b in there for p in b.measures}],
        capture_output=True, text=True, check=False,
    ).stdout  # fmt: skip
    if names and dirty:
        print(f"commit first, so that the figures have a commit; changed are:\n{dirty}", file=sys.stderr)
        return 2
    if not names:
        print(*stale(), sep="\n")
        return 0
    return write([b for b in there if "all" in names or b.name in names or ("quick" in names and "quick" in b.fields)])


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

"""Draw random sentences from docstrings and pages, to be rated by readers who don't know the project.

    python -m benchmarks.sentences                     two hundred sentences of this checkout, with seed 1
    python -m benchmarks.sentences 50 7                fifty, with seed 7
    python -m benchmarks.sentences 200 1 COMMIT        two hundred sentences of a commit

A reader rates each sentence as understood at once, understood at the second reading, or not understood.
"""

from __future__ import annotations

import ast
import random
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
ROOMS = ("planner", "reasoner", "sim", "confab", "worlds", "benchmarks")
FEWEST = 4
"""Minimum number of words of a sentence that is drawn."""
END = re.compile(r"(?<=[.?!:;])\s+(?=[A-Z`*\"])")


def docstrings(source: str) -> Iterator[str]:
    """Yield all docstrings of a module, including texts below constants."""
    for node in ast.walk(ast.parse(source)):
        body = getattr(node, "body", ())
        for statement in body if isinstance(body, list) else ():
            text = (
                statement.value.value
                if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)
                else 0
            )
            if isinstance(text, str):
                yield text


def sentences(text: str) -> Iterator[str]:
    """Yield the sentences of a text in Markdown or numpydoc, without code, tables and headings."""
    text = re.sub(r"```.*?```|<!--.*?-->", "", text, flags=re.DOTALL)
    for paragraph in re.split(r"\n\s*\n|\n\s*(?=[-*] |\d+\. )", text):
        lines = [line.strip() for line in paragraph.splitlines()]
        if any(line.startswith(("|", "#", ">>>", "...", "---")) for line in lines) or not any(lines):
            continue
        for sentence in END.split(" ".join(lines)):
            if len(sentence.split()) >= FEWEST and sentence.rstrip().endswith((".", "?", "!", ":", ";")):
                yield sentence.strip()


def drawn(files: dict[str, str], count: int, seed: int) -> list[tuple[str, str]]:
    """Return `count` sentences with the names of their files, half from docstrings and half from pages."""
    found: dict[str, list[tuple[str, str]]] = {".py": [], ".md": []}
    for name, text in sorted(files.items()):
        texts = docstrings(text) if name.endswith(".py") else [text]
        found[name[-3:]] += [(name, sentence) for one in texts for sentence in sentences(one)]
    draw = random.Random(seed)
    return [pair for kind in (".py", ".md") for pair in draw.sample(sorted(set(found[kind])), count // 2)]


def files_of(commit: str) -> dict[str, str]:
    """Return the modules and pages of a commit, by default of this checkout."""

    def git(*words: str) -> str:
        return subprocess.run(["git", "-C", str(ROOT), *words], capture_output=True, text=True, check=True).stdout

    names = (git("ls-tree", "-r", "--name-only", commit) if commit else git("ls-files")).splitlines()
    wanted = [
        name
        for name in names
        if (name.endswith(".py") and name.split("/")[0] in ROOMS)
        or (name.endswith(".md") and (name.startswith("docs/") or name == "README.md"))
    ]
    return {name: git("show", f"{commit}:{name}") if commit else (ROOT / name).read_text("utf-8") for name in wanted}


def main(arguments: list[str]) -> None:
    """Print the sentences."""
    count, seed, commit = (*arguments, *("200", "1", "")[len(arguments) :])
    for number, (name, sentence) in enumerate(drawn(files_of(commit), int(count), int(seed)), 1):
        print(f"{number:3}  {name}  {sentence}")


if __name__ == "__main__":
    main(sys.argv[1:])

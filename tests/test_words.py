"""Docstrings, comments, messages and pages name things: pronouns that stand for a missing noun only ever become fewer."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
PRONOUNS = re.compile(
    r"\b(somebody|anybody|nobody|whom|whoever|so many|so much|so often|as little as|of what|of whom)\b", re.IGNORECASE
)
WITHOUT = ("sim", "reasoner/embodiment", "reasoner/memory", "planner/paper", "confab/page")
PAGES = ("comparison", "execution", "how-to", "levels", "notebooks", "physics", "physics-faults", "theory", "tutorial")
"""Folders and pages that have none."""
LEFT = 375
"""Occurrences in all other folders and pages at most; lower it when there are fewer."""


def pronouns(file: Path) -> int:
    """Return the number of pronouns in a file, also those that a line break splits."""
    return len(PRONOUNS.findall(" ".join(file.read_text(encoding="utf-8").split())))


def test_the_pronouns_that_stand_for_a_missing_noun_become_fewer() -> None:
    code = [file for room in ("reasoner", "planner", "sim", "confab") for file in sorted((ROOT / room).rglob("*.py"))]
    found = {file.relative_to(ROOT).as_posix(): pronouns(file) for file in (*code, *(ROOT / "docs").rglob("*.md"))}
    rewritten = tuple(f"{folder}/" for folder in WITHOUT) + tuple(f"docs/{page}.md" for page in PAGES)
    assert {file: count for file, count in found.items() if count and file.startswith(rewritten)} == {}
    left = sum(count for file, count in found.items() if not file.startswith(rewritten))
    assert left <= LEFT, "name the object, role, step or value instead of a pronoun"

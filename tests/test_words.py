"""Docstrings, comments, messages and pages name things: no pronoun stands for a missing noun, and no turn has to be guessed."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
PRONOUNS = re.compile(
    r"\b(somebody|anybody|nobody|whom|whoever|so many|so much|so often|as little as|of what|of whom)\b", re.IGNORECASE
)
RIDDLES = re.compile(
    r"\b(is to be had|comes? to nothing|in vain|what it takes|what (comes|came|becomes|became) of|by whichever"
    r"|as \w+ as can be|for want of|take note of|worked out|puts? aside)\b",
    re.IGNORECASE,
)
"""Turns of speech in place of the field's nouns and verbs: calculated, not applicable, failed, result, move away."""
REWRITTEN: tuple[str, ...] = (
    "sim",
    "confab",
    "reasoner/embodiment",
    "reasoner/graph",
    "reasoner/memory",
    "reasoner/pddl",
)
REWRITTEN += ("reasoner/validation", "planner/acting", "planner/paper")
OTHER_PAGES = ("memory",)
"""Pages that may have some; all others have none, nor have the rewritten rooms."""
LEFT, RIDDLES_LEFT = 118, 36
"""Occurrences in all other rooms and pages, and riddles everywhere, at most; lower them when there are fewer."""
KIND = '"facts of what hands reach"'
"""The name of a kind of file."""


def texts() -> dict[str, str]:
    """Return all modules and pages in one line each, so that a line break splits no words."""
    code = [file for room in ("reasoner", "planner", "sim", "confab") for file in sorted((ROOT / room).rglob("*.py"))]
    files = (*code, *(ROOT / "docs").rglob("*.md"))
    return {
        file.relative_to(ROOT).as_posix(): " ".join(file.read_text("utf-8").split()).replace(KIND, "") for file in files
    }


def test_no_pronoun_stands_for_a_missing_noun() -> None:
    found = {file: count for file, text in texts().items() if (count := len(PRONOUNS.findall(text)))}
    rooms = tuple(f"{room}/" for room in REWRITTEN)
    others = tuple(f"docs/{page}.md" for page in OTHER_PAGES)
    done = {f: n for f, n in found.items() if f.startswith(rooms) or (f.startswith("docs/") and f not in others)}
    assert done == {}, "name the object, role, step or value instead of a pronoun"
    assert sum(found.values()) <= LEFT, "name the object, role, step or value instead of a pronoun"


def test_turns_that_have_to_be_guessed_become_fewer() -> None:
    found = {file: count for file, text in texts().items() if (count := len(RIDDLES.findall(text)))}
    assert sum(found.values()) <= RIDDLES_LEFT, f"use the field's verb or noun: {found}"

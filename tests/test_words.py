"""Docstrings, comments, messages and pages use the nouns of the field: no pronoun replaces a noun, and no phrase is a riddle."""

import ast
import re
from collections import defaultdict
from collections.abc import Iterator
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
"""Phrases in place of the field's nouns and verbs, such as calculated, not applicable, failed, result, move away."""
OLD_NAMES = {
    *("Alike", "Concern", "Effort", "Mended", "Moment", "Patience", "Want", "Wants", "Width"),
    *("astray", "despair", "fast_plan", "mending", "wary", "Guide", "attain", "vain"),
}
"""Names of classes, functions and parameters that were replaced: SymmetryClasses, StepFootprint, SearchBudget, RepairResult,
Event, RetryPolicy, Subgoal, Subgoals, SearchBudget, dead_end, on_no_plan, hierarchical_plan, repairs, meanwhile,
RulePolicy, achieve, wasted_effort."""
NEW_ROOMS = ("planner", "reasoner", "confab", "sim")
SHARED = frozenset(["Episode", "Outcome", "Step", "Table", "Verdict"])
"""Names of two classes: an episode, result or step and its JSON, a planner's state and a user's table, verdicts of a world."""
IN_FILES = ('"facts of what hands reach"', '"somebody"', '"nobody"')
"""Texts that files contain: the name of a kind of file, and facts in files of memories."""


def texts() -> dict[str, str]:
    """Return the text of each module and page as one line, so that a line break splits no phrase."""
    code = [file for room in ("reasoner", "planner", "sim", "confab") for file in sorted((ROOT / room).rglob("*.py"))]
    files = (*code, *(ROOT / "docs").rglob("*.md"))
    found = {}
    for file in files:
        text = " ".join(file.read_text("utf-8").split())
        for name in IN_FILES:
            text = text.replace(name, "")
        found[file.relative_to(ROOT).as_posix()] = text
    return found


def defined(path: Path) -> Iterator[str]:
    """Yield the names of classes, functions, parameters and type aliases of a module."""
    tree = ast.parse(path.read_text("utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            yield node.name
        if isinstance(node, ast.arg):
            yield node.arg
    for node in tree.body:
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            yield node.target.id
        elif isinstance(node, ast.Assign):
            yield from (target.id for target in node.targets if isinstance(target, ast.Name))


def test_replaced_names_do_not_come_back() -> None:
    modules = [file for room in NEW_ROOMS for file in sorted((ROOT / room).rglob("*.py"))]
    names = {file.relative_to(ROOT).as_posix(): set(defined(file)) for file in modules}
    back = {file: found & OLD_NAMES for file, found in names.items() if found & OLD_NAMES}
    assert back == {}, "use the new name (the docstring of OLD_NAMES)"


def test_each_name_of_a_class_denotes_one_class() -> None:
    files: dict[str, list[str]] = defaultdict(list)
    for room in NEW_ROOMS:
        for file in sorted((ROOT / room).rglob("*.py")):
            for node in ast.parse(file.read_text("utf-8")).body:
                if isinstance(node, ast.ClassDef):
                    files[node.name.lstrip("_")].append(file.relative_to(ROOT).as_posix())
    twice = {name: found for name, found in files.items() if len(found) > 1 and name not in SHARED}
    assert twice == {}, "one name for one thing"


def test_no_pronoun_stands_for_a_missing_noun() -> None:
    found = {file: words for file, text in texts().items() if (words := PRONOUNS.findall(text))}
    assert found == {}, "name the object, role, step or value instead of a pronoun"


def test_names_of_tests_have_no_pronouns_for_missing_nouns() -> None:
    names = [
        name
        for file in (ROOT / "tests").rglob("test_*.py")
        for name in re.findall(r"def (test_\w+)", file.read_text("utf-8"))
    ]
    assert len(names) > 1000
    found = [name for name in names if re.search(r"_(who|whom|whoever|nobody|somebody|anybody)_", name)]
    assert found == [], "name the object, role, step or value instead of a pronoun"


def test_no_phrase_is_a_riddle() -> None:
    found = {file: words for file, text in texts().items() if (words := [m[0] for m in RIDDLES.finditer(text)])}
    assert found == {}, "use the field's verb or noun"

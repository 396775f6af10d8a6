"""Mutation testing: the share of small faults in a module that the module's fast tests detect.

    python -m benchmarks.mutants               try 60 faults in each module, continuing the last run
    python -m benchmarks.mutants 20 validation try 20 faults in one module
    python -m benchmarks.mutants --again repair try the surviving faults of one module again
    python -m benchmarks.mutants --table       print the table of docs/figures/promises.md

The faults are mutations of cosmic-ray (`pip install cosmic-ray`). A separate process runs the module's tests with one fault
until the first test fails. Mutations of annotations and docstrings are left out. ``mutants.json`` has the results, with a hash
of the module. After a change of the module, its record begins again. The entry of a surviving fault that changes nothing is
moved by hand from ``survived`` to ``same``, with the reason.
"""

from __future__ import annotations

import ast
import contextlib
import hashlib
import json
import os
import random
import signal
import sys
from collections.abc import Iterator, Sequence
from importlib import import_module
from importlib.abc import Loader
from importlib.machinery import ModuleSpec
from importlib.util import spec_from_loader
from itertools import islice
from pathlib import Path
from types import ModuleType
from typing import TypedDict

from benchmarks._processes import fork, silence

ROOT = Path(__file__).resolve().parents[1]
RECORD = Path(__file__).with_name("mutants.json")
MANY = 60
SECONDS, TIMES, WAITING = 10, 5, 6
"""Limits of the tests with a fault: minimum CPU seconds, factor of the CPU time without a fault, and factor by the clock."""
LIBRARIES = ("pytest", "hypothesis", "numpy", "networkx", "pyoxigraph", "rdflib", "urllib3")
"""Modules without injected faults, which are imported once."""
TESTS: dict[str, tuple[str, ...]] = {
    "reasoner/language.py": ("tests/planner/test_language.py", "tests/planner/test_behaviors.py"),
    "reasoner/symbols.py": ("tests/reasoner/test_symbols.py", "tests/planner/test_validation.py"),
    "planner/validation.py": ("tests/planner/test_checker.py", "tests/planner/test_validation.py"),
    "planner/hierarchical/lowest_level.py": ("tests/planner/test_proofs.py",),
    "planner/hierarchical/unsolvability.py": ("tests/planner/test_proofs.py",),
    "planner/certificate_checks.py": ("tests/planner/test_certificates.py", "tests/planner/test_proofs.py"),
    "planner/possibilities.py": ("tests/planner/test_certificates.py", "tests/planner/test_proofs.py"),
    "planner/acting/repair.py": ("tests/planner/test_repair.py",),
    "planner/acting/schedule.py": ("tests/planner/test_schedule.py",),
    "reasoner/files.py": ("tests/reasoner/test_files.py",),
    "reasoner/memory/experience_file.py": ("tests/reasoner/test_memory_lines.py", "tests/reasoner/test_remembering.py"),
    "reasoner/memory/rules_file.py": ("tests/reasoner/test_memory_lines.py", "tests/reasoner/test_remembering.py"),
    "reasoner/memory/links_file.py": ("tests/reasoner/test_memory.py",),
}
"""The fast tests of each module; tests that detect most faults come first."""
SAME = ("Eq_Is", "Eq_IsNot")
"""Mutations without effect: tests for equality and for identity agree on names, since Python stores equal names once."""
Fault = tuple[str, int]
"""An operator of cosmic-ray, and the index of the place to which it is applied."""


def faults(source: str, draw: random.Random) -> Iterator[tuple[Fault, str]]:
    """Yield faults of a module's text that change its behaviour, each with the changed text, in random order."""
    import cosmic_ray.plugins
    from cosmic_ray.ast import ast_nodes, get_ast
    from cosmic_ray.mutating import mutate_code

    nodes, plain = list(ast_nodes(get_ast(source))), meaning(source)
    names = [name for name in sorted(cosmic_ray.plugins.operator_names()) if not name.endswith(SAME)]
    operators = {name: cosmic_ray.plugins.get_operator(name) for name in names}
    places: list[Fault] = []
    for name, operator in operators.items():
        with contextlib.suppress(TypeError):  # an operator that needs arguments
            many = sum(1 for node in nodes for _ in operator().mutation_positions(node))
            places += [(name, number) for number in range(many)]
    draw.shuffle(places)
    for name, number in places:
        with contextlib.suppress(SyntaxError):
            text = mutate_code(source, operators[name](), number)
            if text is not None and meaning(text) != plain:
                yield (name, number), text


def meaning(source: str) -> str:
    """Return the text of a module without annotations and docstrings."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(node, ast.AnnAssign | ast.arg):
            node.annotation = ast.Constant(None) if isinstance(node, ast.AnnAssign) else None
        elif isinstance(node, ast.FunctionDef):
            node.returns = None
        if isinstance(body := getattr(node, "body", None), list):
            kept = [s for s in body if not (isinstance(s, ast.Expr) and isinstance(s.value, ast.Constant))]
            node.body = [  # type: ignore[attr-defined]
                s for s in kept if not (isinstance(s, ast.If) and ast.unparse(s.test).endswith("TYPE_CHECKING"))
            ]
    return ast.dump(tree)


class Record(TypedDict):
    """The results for the faults of a module."""

    of: str
    noticed: list[str]
    survived: dict[str, str]
    same: dict[str, str]


def noticed(file: str, text: str, seconds: float = 600.0) -> bool:
    """Return whether a module's tests fail, or don't end in time, with a changed text of the module."""

    def run() -> int:
        signal.setitimer(signal.ITIMER_PROF, seconds)
        signal.alarm(int(WAITING * seconds))  # some faults let a test wait for ever
        silence()
        sys.meta_path.insert(0, Instead(file, text))
        import pytest

        return int(
            pytest.main(["-q", "-x", "-p", "no:cacheprovider", "-p", "no:xdist", "--assert=plain", *TESTS[file]])
        )

    _, state = os.waitpid(fork(run), 0)
    return not (os.WIFEXITED(state) and os.WEXITSTATUS(state) == 0)


class Instead(Loader):
    """An importer that loads one module with another text."""

    def __init__(self, file: str, text: str) -> None:
        within = "" if file.startswith("confab/") else "confab."
        self.name, self.file, self.text = within + file.removesuffix(".py").replace("/", "."), ROOT / file, text

    def find_spec(self, name: str, path: object = None, target: object = None) -> ModuleSpec | None:
        """Return the import specification if `name` is the name of the module, otherwise None."""
        return spec_from_loader(name, self, origin=str(self.file)) if name == self.name else None

    def create_module(self, spec: ModuleSpec) -> None:
        """Return None, so that Python creates the module."""

    def exec_module(self, module: ModuleType) -> None:
        """Execute the replacement text as the module."""
        module.__file__ = str(self.file)
        exec(compile(self.text, str(self.file), "exec"), module.__dict__)


def records() -> dict[str, Record]:
    """Return the results for each module."""
    found: dict[str, Record] = json.loads(RECORD.read_text("utf-8")) if RECORD.is_file() else {}
    return found


def record(file: str, source: str) -> Record:
    """Return the results for the present text of a module."""
    of = hashlib.sha256(meaning(source).encode()).hexdigest()[:12]
    known = records().get(file)
    return known if known and known["of"] == of else Record(of=of, noticed=[], survived={}, same={})


def try_out(file: str, many: int, again: bool) -> None:
    """Draw faults of a module, test new faults or survivors, and record each result at once."""
    source = (ROOT / file).read_text("utf-8")
    its, used = record(file, source), os.times()
    wanted = set(its["survived"]) if again else None
    if again and not wanted:
        return
    if noticed(file, source):
        raise SystemExit(f"{file}: its tests fail without any fault: {' '.join(TESTS[file])}")
    limit = max(SECONDS, TIMES * (os.times().children_user - used.children_user))
    for (name, number), text in islice(faults(source, random.Random(file)), many):
        key = f"{name.removeprefix('core/')}:{number}"
        if key not in wanted if wanted is not None else key in {*its["noticed"], *its["survived"], *its["same"]}:
            continue
        line = next(new for old, new in zip(source.splitlines(), [*text.splitlines(), ""], strict=False) if old != new)
        if noticed(file, text, limit):
            its["survived"].pop(key, None)
            its["noticed"] = sorted({*its["noticed"], key})
        else:
            its["survived"][key] = line.strip()
        known = {**records(), file: its}
        RECORD.write_text(json.dumps(known, indent=1, sort_keys=True, ensure_ascii=False) + "\n", "utf-8")
        print(file, key, its["survived"].get(key, "noticed"), flush=True)


def table() -> None:
    """Print the share of detected faults of each module, and the lines with survivors."""
    print(
        "| module | faults tried | without observable effect | detected of the others | | not detected |\n|---|---|---|---|---|---|"
    )
    known = {file: its for file, its in records().items() if file in TESTS}
    for file, its in known.items():
        others = len(its["noticed"]) + len(its["survived"])
        share = len(its["noticed"]) / max(1, others)
        stale = "" if its == record(file, (ROOT / file).read_text("utf-8")) else " (as it was)"
        row = f"{others + len(its['same'])} | {len(its['same'])} | {len(its['noticed'])} | {share:.0%} | {len(its['survived'])}"
        print(f"| `{file}`{stale} | {row} |")
    print("\nLines with a fault that the tests didn't detect:\n\n```text")
    for file, its in known.items():
        for line in its["survived"].values():
            print(f"{file}: {' '.join(line.split())[:140]}")


def main(arguments: Sequence[str]) -> None:
    """Test the requested modules."""
    if "--table" in arguments:
        table()
        return
    for name in LIBRARIES:
        import_module(name)
    words = [word for word in arguments if word != "--again"]
    many = int(words.pop(0)) if words and words[0].isdigit() else MANY
    for file in TESTS:
        if all(word in file for word in words):
            try_out(file, many, "--again" in arguments)


if __name__ == "__main__":
    main(sys.argv[1:])

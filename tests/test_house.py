"""A room imports only rooms to its left, and every room is the one in this repository."""

import ast
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
ROOMS = ["ontology", "reasoner", "planner", "sim", "confab"]  # left to right
BARRED_FROM_PLANNER = {"rdflib", "pyoxigraph", "owlready2", "pyshacl", "reasonable", "pybullet", "pybullet_data"}


def imported_packages(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Yield line and top-level name of every absolute import, also one inside a function."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield node.lineno, alias.name.split(".")[0]
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            yield node.lineno, node.module.split(".")[0]
        elif isinstance(node, ast.Call) and ast.unparse(node.func).split(".")[-1] in {"import_module", "__import__"}:
            for argument in node.args[:1]:
                if isinstance(argument, ast.Constant) and isinstance(argument.value, str):
                    yield node.lineno, argument.value.split(".")[0]


def violations(root: Path) -> list[str]:
    """Return each import below `root` that points to the right, or brings RDF or physics into the planner."""
    found = []
    for position, room in enumerate(ROOMS):
        barred = {"tests", "benchmarks", *ROOMS[position + 1 :]}
        if room == "planner":
            barred |= BARRED_FROM_PLANNER
        for path in sorted((root / room).rglob("*.py")):
            for line, package in imported_packages(ast.parse(path.read_text(encoding="utf-8"))):
                if package in barred:
                    found.append(f"{path.relative_to(root)}:{line}: {room} imports {package}")
    return found


def test_rooms_import_only_rooms_to_their_left() -> None:
    assert violations(ROOT) == []


@pytest.mark.parametrize(
    ("path", "source", "package"),
    [
        ("ontology/seeded.py", "import reasoner.graph.knowledge\n", "reasoner"),
        ("reasoner/seeded.py", "from planner import search\n", "planner"),
        ("reasoner/deep/seeded.py", "import os, sim as body\n", "sim"),
        ("planner/seeded.py", "def f():\n    from sim.world import World\n", "sim"),
        ("planner/seeded.py", "import rdflib\n", "rdflib"),
        ("planner/seeded.py", "import pybullet as p\n", "pybullet"),
        ("sim/seeded.py", "import importlib\nimportlib.import_module('confab.cli')\n", "confab"),
        ("confab/seeded.py", "from tests import toy\n", "tests"),
    ],
)
def test_a_seeded_violation_is_caught(tmp_path: Path, path: str, source: str, package: str) -> None:
    for room in ROOMS:
        (tmp_path / room).mkdir()
        (tmp_path / room / "__init__.py").write_text("")
    assert violations(tmp_path) == []
    seeded = tmp_path / path
    seeded.parent.mkdir(exist_ok=True)
    seeded.write_text(source)
    (violation,) = violations(tmp_path)
    assert violation.startswith(path)
    assert violation.endswith(f"imports {package}")


def test_imports_to_the_left_and_within_a_room_are_allowed(tmp_path: Path) -> None:
    (tmp_path / "planner").mkdir()
    source = "import ontology\nfrom reasoner.symbols import Symbol\nfrom . import sim\nfrom planner.grounded.task import Task\n"
    (tmp_path / "planner" / "fine.py").write_text(source)
    assert violations(tmp_path) == []


def run_elsewhere(code: str, directory: Path) -> object:
    """Run `code` in a fresh interpreter outside the repository; return the JSON it prints."""
    done = subprocess.run([sys.executable, "-c", code], cwd=directory, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def test_every_room_is_the_one_in_this_repository(tmp_path: Path) -> None:
    code = f"import importlib, json; print(json.dumps([importlib.import_module(room).__file__ for room in {ROOMS}]))"
    assert run_elsewhere(code, tmp_path) == [str(ROOT / room / "__init__.py") for room in ROOMS]


def test_planner_loads_no_rdf_and_no_physics(tmp_path: Path) -> None:
    modules = [
        ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
        for path in sorted((ROOT / "planner").rglob("*.py"))
        if path.name != "__main__.py"
    ]
    assert "planner" in modules
    code = (
        f"import importlib, json, sys\nfor module in {modules}: importlib.import_module(module)\n"
        f"print(json.dumps(sorted({BARRED_FROM_PLANNER} & set(sys.modules))))"
    )
    assert run_elsewhere(code, tmp_path) == []

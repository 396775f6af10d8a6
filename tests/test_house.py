"""A room imports only rooms to its left, and every room is the one in this repository."""

import ast
import json
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
ROOMS = ["ontology", "reasoner", "planner", "sim", "confab"]  # left to right
SUBROOMS = {  # of the planner: what each may import beside itself; plan, validation, language, levels and transitions all may
    "paper": set[str](),
    "grounded": set[str](),
    "hierarchical": {"grounded"},
    "experience": {"hierarchical", "paper"},
    "acting": {"hierarchical"},
}
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


def imports(root: Path, folders: Sequence[str]) -> dict[str, set[str]]:
    """Return for each module below some folders those that it imports, inside functions and for type checking included."""
    paths = [path for folder in folders for path in sorted((root / folder).rglob("*.py"))]
    modules = {".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__"): path for path in paths}
    found: dict[str, set[str]] = {}
    for module, path in modules.items():
        names: set[str] = set()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module:
                whole = {f"{node.module}.{alias.name}" for alias in node.names}
                names |= (whole & modules.keys()) or {node.module}
        found[module] = names & modules.keys() - {module}
    return found


def cycles(graph: Mapping[str, set[str]]) -> list[set[str]]:
    """Return the sets of modules that import each other, directly or through others."""
    reached: dict[str, set[str]] = {}
    for module in graph:
        waiting, seen = [*graph[module]], set[str]()
        while waiting:
            if (other := waiting.pop()) not in seen:
                seen.add(other)
                waiting += graph[other]
        reached[module] = seen
    found = [{other for other in reached[module] if module in reached[other]} for module in sorted(graph)]
    return [group for i, group in enumerate(found) if group and group not in found[:i]]


def test_no_modules_import_each_other() -> None:
    assert cycles(imports(ROOT, [*ROOMS, "worlds", "benchmarks"])) == []


@pytest.mark.parametrize(
    "back",
    ["from planner import one", "def f():\n    import planner.one", "if TYPE_CHECKING:\n    from planner.one import X"],
)
def test_a_seeded_cycle_is_found(tmp_path: Path, back: str) -> None:
    (tmp_path / "planner").mkdir()
    (tmp_path / "planner" / "one.py").write_text("from planner.two import f\n")
    (tmp_path / "planner" / "two.py").write_text("import planner.three\n")
    (tmp_path / "planner" / "three.py").write_text("")
    assert cycles(imports(tmp_path, ["planner"])) == []
    (tmp_path / "planner" / "three.py").write_text(back + "\n")
    assert cycles(imports(tmp_path, ["planner"])) == [{"planner.one", "planner.two", "planner.three"}]


def astray(graph: Mapping[str, set[str]]) -> list[str]:
    """Return the imports from one sub-room of the planner to another that it doesn't build on, or to what is above all."""
    found = []
    for module, others in sorted(graph.items()):
        room = module.split(".")[1] if module.count(".") == 2 else ""
        for other in sorted(others):
            to = other.split(".")[1] if "." in other else ""
            if room in SUBROOMS and to not in {
                room,
                "plan",
                "plan_costs",
                "validation",
                "checked_amounts",
                "checked_definitions",
                "certified",
                "certifying",
                "certificate_reasons",
                "language",
                "levels",
                "transitions",
                "generated",
                "amount_transitions",
                "derived_facts",
                *SUBROOMS[room],
            }:
                found.append(f"{module} imports {other}")
    return found


def test_sub_rooms_of_the_planner_import_only_what_they_build_on() -> None:
    assert astray(imports(ROOT, ["planner"])) == []
    folders = {path.parent.name for path in (ROOT / "planner").glob("*/*.py")}
    assert folders == SUBROOMS.keys()


def test_a_seeded_import_astray_is_found() -> None:
    graph = imports(ROOT, ["planner"])
    graph["planner.paper.astar"] = {"planner.hierarchical.symmetry", "planner.plan"}
    graph["planner.grounded.joins"] = {"planner.hierarchical.symmetry", "planner.solve"}
    assert astray(graph) == [
        "planner.grounded.joins imports planner.hierarchical.symmetry",
        "planner.grounded.joins imports planner.solve",
        "planner.paper.astar imports planner.hierarchical.symmetry",
    ]


def test_benchmarks_and_shared_worlds_import_no_tests() -> None:
    paths = [path for folder in ("benchmarks", "worlds") for path in sorted((ROOT / folder).rglob("*.py"))]
    wrong = [
        f"{path.relative_to(ROOT)}:{line}"
        for path in paths
        for line, package in imported_packages(ast.parse(path.read_text(encoding="utf-8")))
        if package == "tests" or (package == "benchmarks" and path.parent.name == "worlds")
    ]
    assert wrong == []


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

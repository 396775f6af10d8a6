"""A room imports only rooms to its left, and every room is the one in this repository."""

import ast
import json
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
ROOMS = [
    "ontology",
    "reasoner",
    "planner",
    "sim",
    "confab",
]  # from left to right; all but the last are links in the folder `confab`
# the sub-rooms of the planner, each with the sub-rooms that it may import; all may import plan, validation, language, levels
# and transitions
SUBROOMS = {
    "paper": set[str](),
    "grounded": set[str](),
    "hierarchical": {"grounded", "paper"},
    "experience": {"hierarchical"},
    "acting": {"hierarchical", "timed"},
    "timed": {"grounded", "hierarchical"},
}
BARRED_FROM_PLANNER = {"rdflib", "pyoxigraph", "owlready2", "pyshacl", "reasonable", "pybullet", "pybullet_data"}


def package_of(module: str) -> str:
    """Return the room or package of a module's full name."""
    first, second = [*module.split("."), ""][:2]
    if first in ROOMS[:-1]:
        return f"{first} outside of confab"
    return second if first == "confab" and second in ROOMS else first


def imported_packages(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Yield the line of every absolute import, also inside functions, with the imported room or top-level package."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield node.lineno, package_of(alias.name)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            for alias in node.names:
                yield node.lineno, package_of(f"{node.module}.{alias.name}")
        elif isinstance(node, ast.Call) and ast.unparse(node.func).split(".")[-1] in {"import_module", "__import__"}:
            for argument in node.args[:1]:
                if isinstance(argument, ast.Constant) and isinstance(argument.value, str):
                    yield node.lineno, package_of(argument.value)


def violations(root: Path) -> list[str]:
    """Return each import below `root` that points to the right, or brings RDF or physics into the planner."""
    found = []
    for position, room in enumerate(ROOMS):
        barred = {"tests", "benchmarks", *ROOMS[position + 1 :], *(f"{name} outside of confab" for name in ROOMS)}
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
        ("ontology/seeded.py", "import confab.reasoner.graph.knowledge\n", "reasoner"),
        ("reasoner/seeded.py", "from confab.planner import search\n", "planner"),
        ("reasoner/deep/seeded.py", "import os, confab.sim as body\n", "sim"),
        ("planner/seeded.py", "def f():\n    from confab.sim.world import World\n", "sim"),
        ("planner/seeded.py", "from confab import sim\n", "sim"),
        ("planner/seeded.py", "from planner.plan import Plan\n", "planner outside of confab"),
        ("planner/seeded.py", "import rdflib\n", "rdflib"),
        ("planner/seeded.py", "import pybullet as p\n", "pybullet"),
        ("sim/seeded.py", "import importlib\nimportlib.import_module('confab.cli')\n", "confab"),
        ("confab/seeded.py", "from tests import toy\n", "tests"),
    ],
)
def test_an_inserted_import_of_a_room_to_the_right_is_detected(
    tmp_path: Path, path: str, source: str, package: str
) -> None:
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
    source = "from confab import ontology\nfrom confab.reasoner import names\nfrom confab.planner.grounded.task import Task\n"
    (tmp_path / "planner" / "fine.py").write_text(source)
    assert violations(tmp_path) == []


def module_name(path: Path) -> str:
    """Return the full name of the module in a file, whose path begins with a room."""
    names = [name for name in path.with_suffix("").parts if name != "__init__"]
    return ".".join(["confab"] * (names[0] in ROOMS[:-1]) + names)


def imports(root: Path, folders: Sequence[str]) -> dict[str, set[str]]:
    """Return for each module the modules that it imports, including imports inside functions and for type checking."""
    paths = [path for folder in folders for path in sorted((root / folder).rglob("*.py"))]
    modules = {module_name(path.relative_to(root)): path for path in paths}
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
    [
        "from confab.planner import one",
        "def f():\n    import confab.planner.one",
        "if TYPE_CHECKING:\n    from confab.planner.one import X",
    ],
)
def test_an_inserted_import_cycle_is_detected(tmp_path: Path, back: str) -> None:
    (tmp_path / "planner").mkdir()
    (tmp_path / "planner" / "one.py").write_text("from confab.planner.two import f\n")
    (tmp_path / "planner" / "two.py").write_text("import confab.planner.three\n")
    (tmp_path / "planner" / "three.py").write_text("")
    assert cycles(imports(tmp_path, ["planner"])) == []
    (tmp_path / "planner" / "three.py").write_text(back + "\n")
    assert cycles(imports(tmp_path, ["planner"])) == [
        {"confab.planner.one", "confab.planner.two", "confab.planner.three"}
    ]


def astray(graph: Mapping[str, set[str]]) -> list[str]:
    """Return the imports of modules that a sub-room of the planner must not import."""
    found = []
    for module, others in sorted(graph.items()):
        room = module.split(".")[2] if module.count(".") == 3 else ""
        for other in sorted(others):
            to = other.split(".")[2] if other.count(".") > 1 else ""
            if room in SUBROOMS and to not in {
                room,
                "plan",
                "plan_costs",
                "preferences",
                "validation",
                "checked_amounts",
                "checked_conditions",
                "checked_definitions",
                "certified",
                "certifying",
                "certificate_reasons",
                "language",
                "levels",
                "transitions",
                "generated",
                "amount_transitions",
                "applicable",
                "derived_facts",
                *SUBROOMS[room],
            }:
                found.append(f"{module} imports {other}")
    return found


def test_sub_rooms_of_the_planner_import_only_the_sub_rooms_on_which_they_build() -> None:
    assert astray(imports(ROOT, ["planner"])) == []
    folders = {path.parent.name for path in (ROOT / "planner").glob("*/*.py")}
    assert folders == SUBROOMS.keys()


def test_an_inserted_forbidden_import_within_the_planner_is_detected() -> None:
    graph = imports(ROOT, ["planner"])
    graph["confab.planner.paper.astar"] = {"confab.planner.hierarchical.symmetry", "confab.planner.plan"}
    graph["confab.planner.grounded.joins"] = {"confab.planner.hierarchical.symmetry", "confab.planner.solve"}
    assert astray(graph) == [
        "confab.planner.grounded.joins imports confab.planner.hierarchical.symmetry",
        "confab.planner.grounded.joins imports confab.planner.solve",
        "confab.planner.paper.astar imports confab.planner.hierarchical.symmetry",
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


def foreign_benchmarks(root: Path) -> list[str]:
    """Return the imports of benchmarks by tests; the test with the name of a benchmark may import it."""
    found = []
    for path in sorted((root / "tests").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] == "benchmarks":
                module = node.module or ""
                names = [module.partition(".")[2]] if "." in module else [alias.name for alias in node.names]
                found += [f"{path.relative_to(root)} imports {name}" for name in names if path.stem != f"test_{name}"]
    return found


def test_a_benchmark_is_imported_by_its_own_test_only(tmp_path: Path) -> None:
    assert foreign_benchmarks(ROOT) == []
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests" / "test_load.py").write_text("from benchmarks.load import measured\n")
    assert foreign_benchmarks(tmp_path) == []
    (tmp_path / "tests" / "test_page.py").write_text("def f():\n    from benchmarks import load\n")
    assert foreign_benchmarks(tmp_path) == ["tests/test_page.py imports load"]


def run_elsewhere(code: str, directory: Path) -> object:
    """Run `code` in a fresh interpreter outside the repository; return the JSON it prints."""
    done = subprocess.run([sys.executable, "-c", code], cwd=directory, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def test_all_rooms_are_imported_from_this_repository(tmp_path: Path) -> None:
    names = [module_name(Path(room)) for room in ROOMS]
    code = f"import importlib, json; print(json.dumps([importlib.import_module(room).__file__ for room in {names}]))"
    assert run_elsewhere(code, tmp_path) == [str(ROOT.joinpath(*name.split("."), "__init__.py")) for name in names]


def test_planner_loads_no_rdf_and_no_physics(tmp_path: Path) -> None:
    modules = [
        module_name(path.relative_to(ROOT))
        for path in sorted((ROOT / "planner").rglob("*.py"))
        if path.name != "__main__.py"
    ]
    assert "confab.planner" in modules
    code = (
        f"import importlib, json, sys\nfor module in {modules}: importlib.import_module(module)\n"
        f"print(json.dumps(sorted({BARRED_FROM_PLANNER} & set(sys.modules))))"
    )
    assert run_elsewhere(code, tmp_path) == []

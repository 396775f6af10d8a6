"""The site: each page is in the navigation once, commands and calls exist, the tutorial prints its outputs, without warnings."""

import ast
import doctest
import importlib
import inspect
import re
import shlex
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from pkgutil import resolve_name

import click
import pytest

import confab
from confab.cli import app

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
SITE = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
COMMAND = re.compile(r"`confab ([^`]+)`|^\$ confab (.+)$", re.MULTILINE)
CALL = re.compile(r"`(?:with )?(scene|result|confab|run|report|memory)\.(\w+)\(([^`]*)\)[^`]*`")
HOMES = {"scene": confab.Scene, "result": confab.Result, "run": confab.Execution, "report": confab.Report}


def test_every_page_is_in_the_navigation_once() -> None:
    listed = re.findall(r"(\S+\.md)$", SITE[SITE.index("\nnav:") :], re.MULTILINE)
    assert sorted(listed) == sorted(path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.md"))


def test_the_reference_has_every_public_name() -> None:
    there = set(re.findall(r"^::: confab\.(\w+)$", (DOCS / "reference.md").read_text(), re.MULTILINE))
    assert there == set(confab.__all__)
    for home, name in re.findall(r"^::: (\S+)\.(\w+)$", (DOCS / "reference.md").read_text(), re.MULTILINE):
        assert inspect.getdoc(getattr(importlib.import_module(home), name)), name


def test_public_functions_have_docstrings_and_the_main_ones_have_examples() -> None:
    without = [
        f"{name}.{member}" if member else name
        for name in confab.__all__
        for member, of in [("", getattr(confab, name)), *inspect.getmembers(getattr(confab, name), inspect.isfunction)]
        if callable(of) and not member.startswith("_") and not issubclass_of_error(of) and not inspect.getdoc(of)
    ]
    assert without == []
    for function in (confab.load, confab.scenes, confab.generate, confab.practise, confab.new_domain, confab.validate):
        assert ">>>" in (inspect.getdoc(function) or ""), function


def issubclass_of_error(of: object) -> bool:
    return isinstance(of, type) and issubclass(of, Exception)


@pytest.mark.parametrize("page", ["tutorial", "how-to"])
def test_all_commands_and_calls_of_a_page_exist(page: str) -> None:
    text = (DOCS / f"{page}.md").read_text(encoding="utf-8")
    commands = [one or other for one, other in COMMAND.findall(text)]
    assert len(commands) >= 6
    for line in commands:
        words = [word for word in shlex.split(line.replace("…", "x")) if word]
        command: click.Command | None = app
        while isinstance(command, click.Group) and words:
            command = command.get_command(click.Context(command), words.pop(0))
        assert command is not None, f"confab {line}"
        options = {word.split("=")[0] for word in words if word.startswith("-") and word != "-"}
        known = {option for parameter in command.params for option in parameter.opts}
        assert options <= known, f"confab {line}: {options - known}"
    for home, name, given in CALL.findall(text):
        where = HOMES.get(home, confab if home == "confab" else confab.Memory)
        function = getattr(where, name)
        named = {word.arg for word in ast.parse(f"f({given})", mode="eval").body.keywords}  # type: ignore[attr-defined]
        takes = inspect.signature(function).parameters
        assert named <= takes.keys() or "options" in takes, f"{home}.{name}({given})"


def test_the_code_of_the_tutorial_prints_the_stated_outputs() -> None:
    page = (DOCS / "tutorial.md").read_text(encoding="utf-8")
    code = "\n".join(re.findall(r"```python\n(.*?)```", page, re.DOTALL))
    example = doctest.DocTestParser().get_doctest(code, {}, "tutorial", "tutorial.md", 0)
    result = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(example)
    assert result.attempted >= 15
    assert result.failed == 0


def test_the_tests_and_benchmarks_of_each_promise_exist() -> None:
    text = (DOCS / "promises.md").read_text(encoding="utf-8")
    shown = set(re.findall(r"`pytest (\S+)(?: -k (?:\"([^\"]+)\"|(\w+)))?`", text))
    assert len(shown) == len(set(re.findall(r"`pytest [^`]*`", text))) > 12
    collect = [sys.executable, "-m", "pytest", "-q", "--collect-only", "-n0", "-p", "no:cacheprovider"]
    files = sorted({file for file, *_ in shown})
    done = subprocess.run([*collect, *files], cwd=ROOT, capture_output=True, text=True, check=False)
    tests = [line for line in done.stdout.splitlines() if "::" in line]
    for file, several, one in shown:
        words = several.split(" or ") if several else [one]
        for word in words:
            assert any(line.startswith(file) and word in line.split("::")[1] for line in tests), f"{file} -k {word}"
    for module in set(re.findall(r"`python -m ([\w.]+)", text)):
        assert find_spec(module), module


def defined(file: Path) -> set[str]:
    """Return the top-level names of a module, followed by the names in its classes with the class as prefix."""
    found = set()
    for node in ast.parse(file.read_text(encoding="utf-8")).body:
        for one, prefix in (
            (node, ""),
            *((inner, f"{node.name}.") for inner in getattr(node, "body", ()) if isinstance(node, ast.ClassDef)),
        ):
            if isinstance(one, ast.ClassDef | ast.FunctionDef):
                found.add(prefix + one.name)
            elif isinstance(one, ast.Assign | ast.AnnAssign):
                targets = one.targets if isinstance(one, ast.Assign) else [one.target]
                found |= {prefix + target.id for target in targets if isinstance(target, ast.Name)}
    return found


def test_the_files_and_names_in_references_of_the_docs_exist() -> None:
    text = "\n".join(page.read_text(encoding="utf-8") for page in (DOCS / "architecture.md", DOCS / "conditions.md"))
    named = re.findall(r"`([\w/]+\.py): ([\w., ]+)`", text)
    assert len(named) > 20
    missing = [
        f"{file}: {name}"
        for file, names in named
        for name in names.split(", ")
        if not (ROOT / file).exists() or name not in defined(ROOT / file)
    ]
    assert missing == []


def test_the_python_files_and_the_names_of_modules_on_all_pages_exist() -> None:
    pages = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *DOCS.rglob("*.md")]
    text = "\n".join(page.read_text(encoding="utf-8") for page in pages)
    files = set(re.findall(r"`((?:\w+/)+\w+\.py)\b", text))
    assert len(files) > 100
    assert sorted(file for file in files if not (ROOT / file).exists()) == []
    groups_of_entry_points = {"confab.skills", "confab.perceivers"}
    names = set(re.findall(r"\bconfab(?:\.\w+)+", text)) - groups_of_entry_points
    assert sorted(name for name in names if not resolves(name)) == []


def resolves(name: str) -> bool:
    try:
        resolve_name(name)
    except (AttributeError, ImportError):
        return False
    return True

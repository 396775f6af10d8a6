"""The wheel is complete: installed outside the repository into a new environment, it plans and verifies."""

import os
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path
from shutil import copy, copytree, ignore_patterns

import pytest

from confab import ontology

ROOT = Path(__file__).resolve().parents[1]
ROOMS = ("ontology", "planner", "reasoner", "sim")
BUILD = "import sys; from setuptools.build_meta import build_wheel; print(build_wheel(sys.argv[1]))"
COMMAND = "from importlib.metadata import distribution as d; d('confab-planner').entry_points['confab'].load()()"


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wheel, built from a copy so that nothing is left in the repository."""
    source, dist = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("dist")
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        copy(ROOT / name, source)
    for name in ("confab", *ROOMS):
        copytree(ROOT / name, source / name, ignore=ignore_patterns("__pycache__"), symlinks=True)
    done = subprocess.run([sys.executable, "-c", BUILD, str(dist)], cwd=source, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    (built,) = dist.glob("*.whl")
    return built


def test_every_file_of_the_packages_is_in_the_wheel(wheel: Path) -> None:
    there = set(zipfile.ZipFile(wheel).namelist())
    wanted = {
        f"confab/{path.relative_to(base).as_posix()}"
        for folder, base in ((ROOT / "confab", ROOT / "confab"), *((ROOT / room, ROOT) for room in ROOMS))
        for path in folder.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts and not path.name.startswith(".")
    }
    assert wanted - there == set()
    assert {name.split("/")[0] for name in there if ".dist-info/" not in name} == {"confab"}
    assert {Path(name).suffix for name in wanted} >= {".py", ".ttl", ".rq", ".html", ".css", ".js", ".urdf"}


def test_the_installed_wheel_plans_and_verifies_outside_of_the_repository(wheel: Path, tmp_path: Path) -> None:
    """The environment contains the locked packages and the wheel's own files, and no file of the repository."""
    pytest.importorskip("pybullet")
    home = tmp_path / "environment"
    venv.create(home, symlinks=True, with_pip=False)
    paths = sysconfig.get_paths(vars={"base": str(home), "platbase": str(home)})
    site = Path(paths["purelib"])
    zipfile.ZipFile(wheel).extractall(site)
    (site / "beside.pth").write_text(sysconfig.get_paths()["purelib"] + "\n")
    python = str(home / "bin" / "python")
    where = {"PATH": os.environ["PATH"], "HOME": str(tmp_path)}
    for taken in (
        "planner.py",
        "ontology.py",
        "sim/__init__.py",
        "reasoner/__init__.py",
    ):  # names that a user's module may have, too
        (tmp_path / taken).parent.mkdir(exist_ok=True)
        (tmp_path / taken).write_text("raise AssertionError\n")
    code = "import sys, confab.ontology; print(confab.__file__, confab.ontology.ROOT)"
    found = subprocess.run([python, "-c", code], cwd=tmp_path, env=where, capture_output=True, text=True, check=True)
    assert all(Path(path).is_relative_to(site) for path in found.stdout.split())
    line = [python, "-c", COMMAND, "run", "beverage-serving-moved", "--no-video", "--memory", "memory.ttl"]
    done = subprocess.run(line, cwd=tmp_path, env=where, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-1000:] + done.stderr[-1000:]
    assert "verified: 10 primitives" in done.stdout
    report = (tmp_path / "confab-out" / "report.html").read_text(encoding="utf-8")
    assert "verified in physics" in report
    assert str(ROOT) not in report
    assert (tmp_path / "memory.ttl").stat().st_size > 1000
    assert ontology.ROOT.is_relative_to(ROOT)

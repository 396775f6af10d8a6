"""The notebooks: each is stored with its outputs, asserts its claims, uses no helper code, and links to the next.

`make test` executes the quick notebooks (`testpaths` in pyproject.toml); `make notebooks` executes all, and stores their
outputs.
"""

import json
import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

BOOK = sorted((Path(__file__).resolve().parents[2] / "notebooks").glob("*.ipynb"))
LARGEST = 600_000


def cells(path: Path, kind: str) -> list[dict[str, Any]]:
    return [cell for cell in json.loads(path.read_text(encoding="utf-8"))["cells"] if cell["cell_type"] == kind]


def test_there_are_eight_notebooks_and_each_links_to_the_next() -> None:
    assert [path.name[:3] for path in BOOK] == [f"0{number}-" for number in range(1, 9)]
    for path, following in pairwise(BOOK):
        assert f"]({following.name})" in "".join(cells(path, "markdown")[-1]["source"]), path.name


@pytest.mark.parametrize("path", BOOK, ids=lambda path: path.stem)
def test_a_notebook_is_executed_and_small_has_assertions_and_no_helper_code(path: Path) -> None:
    code = cells(path, "code")
    assert [cell["execution_count"] for cell in code] == list(range(1, len(code) + 1))
    assert not [output for cell in code for output in cell["outputs"] if output["output_type"] == "error"]
    source = "\n".join("".join(cell["source"]) for cell in code)
    assert "assert " in source
    assert not re.search(r"^\s*(def|class|async|from|sys\.|os\.)\b|^import (?!confab$)|sys\.path", source, re.M)
    assert path.stat().st_size < LARGEST


@pytest.mark.parametrize("path", BOOK, ids=lambda path: path.stem)
def test_the_link_targets_of_a_notebook_exist(path: Path) -> None:
    text = "\n".join("".join(cell["source"]) for cell in cells(path, "markdown"))
    for target in re.findall(r"\]\(([^)#\s]+)", text):
        assert (path.parent / target).exists(), target

"""Figures in the documentation state their command and date; figures older than the measured code are listed."""

import subprocess
import warnings
from pathlib import Path

import pytest

from benchmarks import figures

GOOD = "python -m benchmarks counts; commit {}; 2026-01-31; measures code"


def page(root: Path, header: str) -> None:
    (root / "docs").mkdir(exist_ok=True)
    (root / "docs" / "page.md").write_text(f"<!-- figures one: {header} -->\n\n| 1 |\n\n<!-- end -->\n")


def commit(root: Path, text: str) -> str:
    (root / "code").mkdir(exist_ok=True)
    (root / "code" / "a.py").write_text(text)

    def git(*words: str) -> str:
        who = ("-c", "user.name=a", "-c", "user.email=a@b", "-c", "commit.gpgsign=false")
        done = subprocess.run(["git", "-C", str(root), *who, *words], capture_output=True, text=True, check=True)
        return done.stdout.strip()

    if not (root / ".git").exists():
        git("init", "-q")
    git("add", "-A")
    git("commit", "-qm", text)
    return git("rev-parse", "--short", "HEAD")


@pytest.mark.filterwarnings("default:stale figures")
def test_every_block_of_figures_states_its_command_commit_and_date_and_stale_blocks_are_listed() -> None:
    there = figures.blocks()
    assert len(there) >= 10
    assert [fault for block in there for fault in block.faults(figures.ROOT)] == []
    names = [block.name for block in there]
    assert len(set(names)) == len(names)
    if stale := figures.stale():
        warnings.warn(
            "stale figures; `make figures` or `make bench` measures them anew:\n" + "\n".join(stale), stacklevel=1
        )


def test_readers_see_the_commit_and_the_date_of_every_block_of_figures() -> None:
    for path in [figures.ROOT / "README.md", *sorted((figures.ROOT / "docs").rglob("*.md"))]:
        for found in figures.BLOCK.finditer(path.read_text("utf-8")):
            block = figures.Block(path, found["name"], found["header"])
            assert found["text"].rstrip().endswith("\n\n" + block.small_print), block


def test_every_block_of_figures_ends_before_the_next_one_begins() -> None:
    for path in [figures.ROOT / "README.md", *sorted((figures.ROOT / "docs").rglob("*.md"))]:
        text = path.read_text("utf-8")
        assert len(figures.BLOCK.findall(text)) == text.count("<!-- figures "), path.name
        assert not any("<!-- figures " in block["text"] for block in figures.BLOCK.finditer(text)), path.name


def test_a_block_of_figures_is_stale_after_a_change_of_the_measured_code(tmp_path: Path) -> None:
    first = commit(tmp_path, "first")
    page(tmp_path, GOOD.format(first))
    assert figures.stale(tmp_path) == []
    (block,) = figures.blocks(tmp_path)
    assert block.last(tmp_path) == first
    second = commit(tmp_path, "second")
    assert figures.stale(tmp_path) == [
        f"page.md one: of {first}, 1 commits behind {second}: python -m benchmarks counts"
    ]


def test_a_block_without_its_commit_in_the_history_is_reported(tmp_path: Path) -> None:
    page(tmp_path, GOOD.format("1234567"))
    (line,) = figures.stale(tmp_path)
    assert "can't be dated" in line


@pytest.mark.parametrize(
    ("header", "said"),
    [
        ("by hand; commit 1234567; 2026-01-31; measures code", "no command"),
        ("python -m benchmarks counts; 2026-01-31; measures code", "no commit"),
        ("python -m benchmarks counts; commit 1234567; measures code", "no date"),
        ("python -m benchmarks counts; commit 1234567; 2026-01-31", "nothing that it measures"),
        ("python -m benchmarks counts; commit 1234567; 2026-01-31; measures code/gone.py", "which doesn't exist"),
    ],
)
def test_an_incomplete_block_of_figures_is_a_fault(tmp_path: Path, header: str, said: str) -> None:
    (tmp_path / "code").mkdir()
    page(tmp_path, header)
    (block,) = figures.blocks(tmp_path)
    (fault,) = block.faults(tmp_path)
    assert said in fault


def test_a_table_is_extracted_from_printed_output() -> None:
    text = "first\n\n| a |\n|---|\n| 1 |\n\nsecond\n\n| b |\n|---|\n| 2 |"
    assert figures.chosen(text, 2) == "| b |\n|---|\n| 2 |"
    assert figures.chosen(text, 0) == text
    assert figures.chosen("no table", 0) == "```\nno table\n```"

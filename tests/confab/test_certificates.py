"""The command line verifies a saved certificate again, without a search."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from confab.cli import app
from confab.planner import certifying
from confab.planner.hierarchical import planner
from confab.reasoner.graph.knowledge import KnowledgeError

GOAL = ("--goal", "left_hand HAND_POSITION location8")


@pytest.fixture(scope="module")
def proof(tmp_path_factory: pytest.TempPathFactory) -> Path:
    told = CliRunner().invoke(app, ["plan", "beverage-serving", *GOAL, "--json"])
    assert told.exit_code == 1
    file = tmp_path_factory.mktemp("proof") / "proof.json"
    file.write_text(told.stdout)
    return file


def test_a_saved_certificate_is_checked_without_a_search(proof: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for module, name in ((planner, "plan"), (certifying, "certify")):
        monkeypatch.setattr(module, name, None)
    told = CliRunner().invoke(app, ["explain", "beverage-serving", *GOAL, "--check", str(proof)])
    assert told.exit_code == 0
    assert told.stdout.startswith("the certificate holds: there is no plan")


def test_a_certificate_of_another_task_and_a_changed_certificate_are_rejected(proof: Path, tmp_path: Path) -> None:
    told = CliRunner().invoke(app, ["explain", "beverage-serving", "--check", str(proof)])
    assert told.exit_code == 1
    assert "not accepted: left_hand HAND_POSITION location8 isn't wanted in this task" in told.stdout
    data = json.loads(proof.read_text())["certificate"]
    changed = tmp_path / "changed.json"
    changed.write_text(json.dumps({**data, "never": [], "always": []}))
    told = CliRunner().invoke(app, ["explain", "beverage-serving", *GOAL, "--check", str(changed), "--json"])
    assert told.exit_code == 1
    assert json.loads(told.stdout)["holds"] is False


@pytest.mark.parametrize(
    "text", ["{}", "[]", "{", '{"status": "solved", "steps": []}', '{"certificate": null}', "[" * 100_000]
)
def test_a_file_without_a_certificate_is_misuse(text: str, tmp_path: Path) -> None:
    file = tmp_path / "none.json"
    file.write_text(text)
    told = CliRunner().invoke(app, ["explain", "beverage-serving", "--check", str(file)])
    assert isinstance(told.exception, KnowledgeError)
    assert str(file) in str(told.exception)

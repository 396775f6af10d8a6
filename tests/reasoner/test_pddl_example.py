"""The example of docs/pddl.md: a level added by hand on top of an imported domain."""

from __future__ import annotations

from pathlib import Path

import confab
from confab.pddl_commands import import_pddl
from confab.planner.validation import validate as faults
from confab.reasoner.validation.validate import validate

EXAMPLE = Path(__file__).resolve().parents[2] / "docs" / "examples" / "ferry"


def test_the_imported_file_of_the_example_equals_the_output_of_the_import(tmp_path: Path) -> None:
    import_pddl(EXAMPLE / "domain.pddl", EXAMPLE / "problem.pddl", tmp_path / "ferry.ttl", level=2)
    assert (tmp_path / "ferry.ttl").read_text() == (EXAMPLE / "ferry.ttl").read_text()


def test_a_level_written_by_hand_above_an_import_is_valid_and_is_planned() -> None:
    assert {finding.rule for finding in validate([EXAMPLE / "ferry-levels.ttl"])} == {"from-level-without-rest"}
    scene = confab.load(EXAMPLE / "ferry-levels.ttl")
    plan = scene.plan().outcome.plan
    assert plan is not None and faults(scene.problem, plan) == []
    assert [step.behavior for step in plan.steps] == ["SHIP"] * 3
    assert {step.behavior for step in plan.at_level(2)} <= {"SAIL", "BOARD", "LEAVE"}

"""Goals that together violate a constraint, or a bound of a derived amount, are unsolvable without a search."""

from __future__ import annotations

from dataclasses import replace

import pytest
from click.testing import CliRunner

import confab
import ontology
from confab.cli import app
from confab.planner.certificate_checks import refusal
from confab.planner.certificates import Certificate
from confab.planner.plan import Status
from confab.reasoner.symbols import Fact, Symbol

CARTS = (ontology.ROOT / "domains" / "carts.ttl").read_text("utf-8")
SCENE = (ontology.ROOT / "scenes" / "carts-small.ttl").read_text("utf-8")
CATALOG = """<?xml version="1.0"?><catalog xmlns="urn:oasis:names:tc:entity:xmlns:xml:catalog">
  <uri name="https://w3id.org/confab/carts" uri="carts.ttl"/></catalog>"""
BAYS = ["acid2 IN bay1", "base2 IN bay2", "bleach IN bay3", "fuel IN bay5", "peroxide IN bay4", "solvent IN bay6"]


@pytest.fixture(scope="module")
def carts(tmp_path_factory: pytest.TempPathFactory) -> confab.Scene:
    """The small scene with carts that carry at most 8 kg."""
    folder = tmp_path_factory.mktemp("carts")
    (folder / "carts.ttl").write_text(
        CARTS.replace("c:valueProperty :load ;", "c:valueProperty :load ; c:mostAmount 8.0 ;")
    )
    (folder / "scene.ttl").write_text(SCENE)
    (folder / "catalog-v001.xml").write_text(CATALOG)
    return confab.load(folder / "scene.ttl")


@pytest.mark.parametrize(
    ("goal", "unmet", "constraint"),
    [
        (["acid1 IN bay6", "base1 IN bay6"], ["acid1 IN bay6", "base1 IN bay6"], "CLASH must never be true"),
        (["bay6 CLASH true"], ["bay6 CLASH true"], "CLASH must never be true"),
        (["store RESERVE false"], ["store RESERVE false"], "RESERVE must always be true"),
        (["acid1 IN bay1", "base1 IN bay2", *BAYS], [*BAYS], "RESERVE must always be true"),
    ],
)
def test_the_certificate_has_only_the_goals_that_violate_the_constraint(
    goal: list[str], unmet: list[str], constraint: str
) -> None:
    outcome = confab.load("drums-large").plan(goal=goal).outcome
    assert outcome.certificate is not None and outcome.reason is not None
    assert (outcome.certificate.kind, [*map(str, outcome.certificate.unmet)]) == ("bounds", unmet)
    assert outcome.reason.text.endswith(f"violate the constraint that {constraint}")


def test_an_explanation_names_the_violated_constraint_and_the_goals() -> None:
    goals = ("--goal", "acid IN bay1", "--goal", "base IN bay1")
    told = CliRunner().invoke(app, ["explain", "drums-small", *goals])
    assert told.exit_code == 1
    assert "constraint: clash must never be true" in told.stdout
    assert "acid in bay 1 and base in bay 1; these never hold together" in " ".join(told.stdout.split())


def test_goals_that_exceed_a_derived_amount_are_unsolvable(carts: confab.Scene) -> None:
    outcome = carts.plan(goal=["books IN cart", "glass IN cart", "paper IN shop"]).outcome
    assert outcome.status is Status.UNSOLVABLE and outcome.reason is not None
    assert outcome.reason.text.endswith("together they make cart LOAD at least 9, and its maximum is 8")


def test_goals_that_contradict_the_definition_of_an_amount_are_unsolvable() -> None:
    outcome = confab.load("carts-small").plan(goal=["books IN shop", "glass IN shop", "shop STOCK 1"]).outcome
    assert outcome.status is Status.UNSOLVABLE and outcome.reason is not None
    assert outcome.reason.text.endswith("contradict the definitions of derived facts")


@pytest.mark.parametrize("bounded", [Symbol("LOAD", ("cart",)), Symbol("STOCK", ("shop",)), Symbol("LOAD", ())])
def test_the_checker_rejects_a_bound_that_the_goals_respect_and_an_amount_without_bounds(
    bounded: Symbol, carts: confab.Scene
) -> None:
    goal = {Symbol("IN", (crate,)): "cart" for crate in ("glass", "paper")}
    forged = Certificate(unmet=tuple(map(Fact, goal, goal.values())), bounded=(bounded,))
    assert refusal(replace(carts.problem, goal=goal), forged) is not None

"""Faults in amounts, inserted into the shipped canteen: validation names the node and the remedy."""

from collections.abc import Callable
from pathlib import Path

import pytest

from confab import ontology
from confab.reasoner.graph.knowledge import KnowledgeError, load
from confab.reasoner.reading.problem import read
from confab.reasoner.validation.validate import validate

CATALOG = """<catalog prefer="public" xmlns="urn:oasis:names:tc:entity:xmlns:xml:catalog">
<uri name="https://w3id.org/confab/canteen" uri="canteen.ttl"/></catalog>"""


@pytest.fixture
def canteen(tmp_path: Path) -> Callable[[str, str], Path]:
    def changed(old: str, new: str) -> Path:
        for file in (ontology.ROOT / "domains" / "canteen.ttl", ontology.ROOT / "scenes" / "canteen-small.ttl"):
            text = file.read_text(encoding="utf-8")
            (tmp_path / file.name).write_text(text.replace(old, new), encoding="utf-8")
        (tmp_path / ontology.CATALOG).write_text(CATALOG, encoding="utf-8")
        return tmp_path / "canteen-small.ttl"

    return changed


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("d:servings 1.5", "d:servings -1.5", "<jug1, SERVINGS> is -1.5; it has to be at least 0"),
        ("d:battery 6.0", "d:battery 26.0", "<trolley, BATTERY> is 26; it has to be at least 0 and at most 20"),
        (':battery ; c:fromLevel 2 ; c:unit "Wh"', ':battery ; c:fromLevel 2 ; c:unit "min"', "min and Wh ("),
        (':BATTERY ; c:sign "<"', ':TROLLEY_AT ; c:sign "<"', "TROLLEY_AT isn't an amount, so it can't be compared with a number"),
        ('c:change "assign"', 'c:change "set"', "has no kind of change, several kinds, or an invalid kind"),
        ('c:sign "<" ; c:amount 20.0', 'c:sign "<"', "L2_CHARGE.notFull> has neither c:amount nor c:right"),
        ("owl:NamedIndividual, c:SituationType, c:Amount", "owl:NamedIndividual, c:SituationType", "isn't declared as an amount"),
    ],
)  # fmt: skip
def test_a_fault_in_amounts_is_reported_with_its_node_and_a_remedy(
    canteen: Callable[[str, str], Path], old: str, new: str, said: str
) -> None:
    found = [finding for finding in validate([canteen(old, new)]) if said in finding.what]
    assert found, said
    assert all(finding.remedy for finding in found)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("d:portion 0.5", "d:portion 0.5, 2.75", "portion of cup3 is 0.5 and 2.75; state one number"),
        (
            "c:argument2 d:dock ; c:amount 2.0 .",
            "c:argument2 d:dock ; c:amount 2.0, 9.0 .",
            "wanted one c:amount, found 2",
        ),
        (
            "c:argument2 d:dock ; c:amount 2.0 .",
            "c:argument2 d:dock .",
            "WAY of tap, dock has no number, but other facts of WAY have one",
        ),
    ],
)
def test_a_relation_gives_one_number_for_its_individuals(
    canteen: Callable[[str, str], Path], old: str, new: str, said: str
) -> None:
    with pytest.raises(KnowledgeError, match=said):
        read(load(canteen(old, new)))


def test_a_goal_with_a_comparison_of_an_undeclared_calculation_is_refused(canteen: Callable[[str, str], Path]) -> None:
    path = canteen('c:sign ">=" ; c:amount 0.5', 'c:sign ">=" ; c:right :round.half')
    with pytest.raises(KnowledgeError, match=r"used as a calculation"):
        read(load(path))

"""A relation with a number column refers to the same individuals in every calculation, condition and fact."""

from pathlib import Path

import pytest

from confab import ontology
from confab.reasoner.validation.validate import validate

ROOT = Path(ontology.__file__).parent
FILES = {"canteen": ROOT / "domains/canteen.ttl", "canteen-small": ROOT / "scenes/canteen-small.ttl"}


@pytest.mark.parametrize(
    ("file", "old", "new", "what"),
    [
        ("canteen", "c:argument2 :L2_DRIVE.spot ; c:relation :WAY", "c:relation :WAY",
         "L2_DRIVE names 1 individual for WAY, but all facts of WAY name 2"),
        ("canteen-small", "c:about :tap ; c:argument2 d:dock", "c:about :tap",
         "WAY of tap names 1 individual; behaviours and rules name 2"),
        ("canteen", ":L1_REFILL.capacity a owl:NamedIndividual, c:Calculation ; c:about :L1_REFILL.jug ;",
         ":L1_REFILL.capacity a owl:NamedIndividual, c:Calculation ;", "for capacity"),
    ],
    ids=["calculation", "fact", "data property"],
)  # fmt: skip
def test_a_missing_individual_is_a_finding(tmp_path: Path, file: str, old: str, new: str, what: str) -> None:
    for name, path in FILES.items():
        text = path.read_text(encoding="utf-8")
        assert name != file or old in text
        text = text.replace(old, new) if name == file else text
        (tmp_path / path.name.replace("canteen", "mess")).write_text(text.replace("canteen", "mess"), encoding="utf-8")
    found = [f for f in validate([tmp_path / "mess-small.ttl"]) if f.serious]
    assert any(what in finding.what for finding in found), found
    assert all(finding.line for finding in found)

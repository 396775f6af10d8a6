"""Entailments of the reasoner HermiT, which are the reference for definitions.

The command `python -m worlds.entailed` reads a JSON object from stdin, with ``logic`` and ``states`` in Turtle, and with the
requested ``classes`` and ``properties``. For each state the command prints the entailments ``[class, individual]`` and
``[property, one, other]``. The command runs in a separate process, since a JVM can't be stopped. `random_state` returns random
states of `LOGIC`. An unstated fact may be true in OWL but is false in planning, so `asserted` adds axioms that exclude further
facts.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator, Sequence
from random import Random
from typing import Any

from worlds.owlapi import jars, jvm

SPACE = "https://example.org/yard#"
PREFIXES = f"""@prefix : <{SPACE}> .
@prefix c: <https://w3id.org/confab/core#> .
@prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix rdf: <http://www.w3.org/1999/02/22-rdf-syntax-ns#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
@prefix swrl: <http://www.w3.org/2003/11/swrl#> .
@prefix xsd: <http://www.w3.org/2001/XMLSchema#> .
"""


def some(prop: str, said: str) -> str:
    """Return an OWL restriction on a property in Turtle."""
    return f"[ a owl:Restriction ; owl:onProperty {prop} ; {said} ]"


def every(*parts: str) -> str:
    """Return the OWL intersection of classes in Turtle."""
    return f"[ a owl:Class ; owl:intersectionOf ( {' '.join(parts)} ) ]"


def atoms(*said: str) -> str:
    """Return a list of SWRL atoms in the OWL API's form, from texts such as ``:liesIn ?x ?y`` and ``:Box ?x``."""
    text = "rdf:nil"
    for atom in reversed(said):
        predicate, *terms = [f"<urn:swrl:var#{w[1:]}>" if w.startswith("?") else w for w in atom.split()]
        if predicate in ("same", "different"):
            kind = f"swrl:{predicate.title()}Individual{'s' if predicate == 'different' else ''}Atom"
        elif len(terms) == 1:
            kind = f"swrl:ClassAtom ; swrl:classPredicate {predicate}"
        else:
            kind = f"swrl:IndividualPropertyAtom ; swrl:propertyPredicate {predicate}"
        of = " ; ".join(f"swrl:argument{place} {term}" for place, term in enumerate(terms, 1))
        text = f"[ a swrl:AtomList ; rdf:first [ a {kind} ; {of} ] ; rdf:rest {text} ]"
    return text


def implies(head: str, *body: str) -> str:
    """Return a SWRL rule and the declarations of its variables."""
    variables = sorted({w[1:] for atom in (head, *body) for w in atom.split() if w.startswith("?")})
    declared = "".join(f"<urn:swrl:var#{v}> a swrl:Variable .\n" for v in variables)
    return f"{declared}[ a swrl:Imp ; swrl:body {atoms(*body)} ; swrl:head {atoms(head)} ] .\n"


def two(filler: str, many: str) -> str:
    """Return a qualified cardinality restriction for a text such as ``min 2``."""
    name, number = many.split()
    capital = "qualifiedCardinality" if name == "exactly" else f"{name}QualifiedCardinality"
    return f'owl:{capital} "{number}"^^xsd:nonNegativeInteger ; owl:onClass {filler}'


IN = "[ owl:inverseOf :liesIn ]"
DEFINED = {
    "SERVABLE": (":Servable", every(":Cup", some(":cleanliness", "owl:hasValue :clean"),
        some(":liesIn", "owl:someValuesFrom :Room"),
        f"[ a owl:Class ; owl:complementOf {some('[ owl:inverseOf :holds ]', 'owl:someValuesFrom :Hand')} ]")),
    "TIDY": (":Tidy", every(":Box", some(IN, "owl:allValuesFrom [ a owl:Class ; owl:unionOf ( :Box "
        f"{some(':cleanliness', 'owl:hasValue :clean')} ) ]"))),
    "CROWDED": (":Crowded", every(":Box", some(IN, two(":Cup", "min 2")))),
    "SPARSE": (":Sparse", every(":Place", some(IN, two(":Thing", "max 1")))),
    "PAIRED": (":Paired", every(":Hand", some(":holds", two(":Thing", "exactly 2")))),
    "HEAVY": (":Heavy", every(":Box", some(":weight", "owl:someValuesFrom [ a rdfs:Datatype ; owl:onDatatype xsd:decimal ; "
        "owl:withRestrictions ( [ xsd:minInclusive 2.5 ] [ xsd:maxExclusive 7.0 ] ) ]"))),
    "DEEP": (":Deep", every(":Thing", some(":isInside", f"owl:someValuesFrom {every(':Box', ':Heavy')}"))),
    "FOUND": (":Found", every(":Place", some("[ owl:inverseOf :leadsTo ]", "owl:someValuesFrom :Hand"))),
}  # fmt: skip
"""Situation types that hold of the members of a class (`holdsOf`), with the definition of the class."""
CONCLUDED = {"GUARDED": ":Guarded", "TOUCHED": ":Touched", "SOUGHT": ":Sought"}
"""Situation types that hold of the members of a class; SWRL rules conclude the members of the class."""
PROPERTIES = ("isInside", "contains", "onFloor", "sees", "linked", "leadsTo", "endsOn")
LOGIC = f"""
:Place a owl:Class . :Thing a owl:Class . :Floor a owl:Class . :Hand a owl:Class . :Cleanliness a owl:Class .
:Room a owl:Class ; rdfs:subClassOf :Place . :Box a owl:Class ; rdfs:subClassOf :Place, :Thing .
:Cup a owl:Class ; rdfs:subClassOf :Thing .
[ a owl:AllDisjointClasses ; owl:members ( :Room :Box :Cup :Floor :Hand :Cleanliness ) ] .
:liesIn a owl:ObjectProperty, owl:FunctionalProperty ; rdfs:subPropertyOf :isInside .
:isInside a owl:ObjectProperty, owl:TransitiveProperty .
:contains a owl:ObjectProperty ; owl:inverseOf :isInside .
:partOf a owl:ObjectProperty .
:onFloor a owl:ObjectProperty ; owl:propertyChainAxiom ( :isInside :partOf ) .
:cleanliness a owl:ObjectProperty, owl:FunctionalProperty .
:leadsTo a owl:ObjectProperty, owl:TransitiveProperty .
:endsOn a owl:ObjectProperty ; owl:propertyChainAxiom ( :leadsTo :partOf ) .
:holds a owl:ObjectProperty . :near a owl:ObjectProperty . :sees a owl:ObjectProperty . :linked a owl:ObjectProperty .
:weight a owl:DatatypeProperty, owl:FunctionalProperty .
:clean a owl:NamedIndividual, :Cleanliness . :dirty a owl:NamedIndividual, :Cleanliness .
{"".join(f"{kind} a owl:Class . " for kind in CONCLUDED.values())}
{"".join(f"{kind} a owl:Class ; owl:equivalentClass {said} .{chr(10)}" for kind, said in DEFINED.values())}
{implies(":sees ?h ?x", ":Hand ?h", ":near ?h ?r", ":liesIn ?x ?r")}
{implies(":sees ?h ?x", ":sees ?h ?y", ":liesIn ?x ?y")}
{implies(":linked ?x ?y", ":holds ?h ?x", ":holds ?h ?y", "different ?x ?y")}
{implies(":linked ?x ?z", ":linked ?x ?y", ":linked ?y ?z")}
{implies(":Guarded ?x", ":liesIn ?x ?b", ":Heavy ?b", ":cleanliness ?b :clean")}
{implies(":Guarded ?x", ":liesIn ?x ?b", ":Guarded ?b")}
{implies(":Touched ?x", ":Servable ?x")}
{implies(":Touched ?x", ":holds ?h ?y", ":liesIn ?y ?b", ":liesIn ?x ?b", ":Cup ?x")}
{implies(":leadsTo ?h ?x", ":Hand ?h", ":holds ?h ?x")}
{implies(":leadsTo ?h ?x", ":Hand ?h", ":near ?h ?x")}
{implies(":leadsTo ?x ?y", ":liesIn ?x ?y", ":cleanliness ?x :clean")}
{implies(":Sought ?x", ":Deep ?x", ":liesIn ?x ?y", ":Found ?y")}
"""
"""Definitions of every kind that planning supports: class expressions, chains, transitivity, recursion, numbers and SWRL rules.

A SWRL rule concludes a transitive property, a property chain uses the transitive property, and another rule uses a
class that is defined by the transitive property. No rule body contains a transitive property, since HermiT's
entailments are then incomplete.
"""

THINGS = ("box1", "box2", "box3", "cup1", "cup2", "cup3")
PLACES = ("box1", "box2", "box3", "room1", "room2")
ALL = (*THINGS, "room1", "room2", "floor1", "floor2", "hand1", "hand2")


def domain() -> str:
    """Return a domain and scene in Turtle whose situation types are defined by `LOGIC`."""
    changed = {"LIES_IN": "liesIn", "CLEANLINESS": "cleanliness", "HOLDS": "holds"}
    parts = [
        f"{PREFIXES}<https://example.org/yard> a owl:Ontology ; owl:imports <https://w3id.org/confab/core> ; c:symbolicOnly true .",
        LOGIC,
        ":Thing c:hasSituationType :LIES_IN, :INSIDE, :ON_FLOOR, :LINKED, :DEEP, :CLEANLINESS, :GUARDED, :SOUGHT .",
        ":Cup c:hasSituationType :SERVABLE, :TOUCHED . :Box c:hasSituationType :TIDY, :CROWDED, :HEAVY, :WEIGHT .",
        ":Place c:hasSituationType :SPARSE, :CONTAINS, :FOUND . :Hand c:hasSituationType :PAIRED, :HOLDS, :SEES .",
        ":WEIGHT a owl:NamedIndividual, c:SituationType, c:Amount ; c:valueProperty :weight . :weight rdfs:range xsd:decimal .",
        ":Place rdfs:subClassOf :LIES_IN, :INSIDE . :Floor rdfs:subClassOf :ON_FLOOR . :Cleanliness rdfs:subClassOf :CLEANLINESS .",
        ":Thing rdfs:subClassOf :HOLDS, :LINKED, :CONTAINS, :SEES, :LEADS_TO . :Place rdfs:subClassOf :LEADS_TO .",
        ":Source a owl:Class ; c:hasSituationType :LEADS_TO, :ENDS_ON .",
        ":Thing rdfs:subClassOf :Source . :Hand rdfs:subClassOf :Source .",
        ":Floor rdfs:subClassOf :ENDS_ON .",
        ":partOf a c:Relation ; rdfs:domain :Place ; rdfs:range :Floor .",
        ":near a c:Relation ; rdfs:domain :Hand ; rdfs:range :Place .",
    ]
    defined = {"INSIDE": "isInside", "ON_FLOOR": "onFloor", "LINKED": "linked", "CONTAINS": "contains", "SEES": "sees"}
    defined |= {"LEADS_TO": "leadsTo", "ENDS_ON": "endsOn"}
    for situation, prop in (changed | defined).items():
        parts.append(f":{situation} a owl:Class, owl:NamedIndividual, c:SituationType ; c:valueProperty :{prop} .")
    for situation, kind in ({s: kind for s, (kind, _) in DEFINED.items()} | CONCLUDED).items():
        parts.append(f":{situation} a owl:NamedIndividual, c:SituationType ; c:holdsOf {kind} .")
    for place, name in enumerate(ALL, 1):
        parts.append(f":{name} a owl:NamedIndividual, :{name[:-1].title()} ; c:index {place} .")
    return "\n".join(parts)


def random_state(rng: Random) -> list[tuple[str, str, str]]:
    """Return the facts of a random state: nested boxes, also in cycles, held things, and static relations."""
    facts = [(thing, "liesIn", rng.choice(PLACES)) for thing in THINGS]
    facts += [(thing, "cleanliness", rng.choice(("clean", "dirty"))) for thing in THINGS]
    facts += [(thing, "weight", rng.choice(("0", "2.5", "5", "6.99", "7"))) for thing in THINGS[:3]]
    facts += [("hand1", "holds", thing) for thing in rng.sample(THINGS, rng.choice((0, 1, 2, 3)))]
    facts += [("hand2", "holds", thing) for thing in rng.sample(THINGS, rng.choice((0, 0, 1, 2)))]
    facts += [(hand, "near", place) for hand in ("hand1", "hand2") for place in PLACES if rng.random() < 0.2]
    return facts + [
        (room, "partOf", rng.choice(("floor1", "floor2"))) for room in ("room1", "room2") if rng.random() < 0.8
    ]


def asserted(facts: Sequence[tuple[str, str, str]]) -> str:
    """Return a state as axioms in Turtle, with axioms that exclude further values of counted properties."""
    said = {(one, prop, f'"{other}"^^xsd:decimal' if prop == "weight" else f":{other}") for one, prop, other in facts}
    lines = [f":{one} :{prop} {other} ." for one, prop, other in sorted(said)]
    lines += [f":{name} a owl:NamedIndividual, :{name[:-1].title()} ." for name in ALL]
    for name in ALL:
        for prop, back in (("holds", False), ("holds", True), ("liesIn", True)):
            many = sum(fact[1] == prop and fact[2 if back else 0] == name for fact in facts)
            role = f"[ owl:inverseOf :{prop} ]" if back else f":{prop}"
            lines.append(f':{name} a {some(role, f"""owl:maxCardinality "{many}"^^xsd:nonNegativeInteger""")} .')
    different = " ".join(f":{name}" for name in (*ALL, "clean", "dirty"))
    return "\n".join([*lines, f"[ a owl:AllDifferent ; owl:distinctMembers ( {different} ) ] ."])


def plainly(facts: Sequence[tuple[str, str, str]]) -> set[tuple[str, ...]]:
    """Return the consequences of `LOGIC` in a state, computed in plain Python as an independent reference."""
    of: dict[str, set[tuple[str, str]]] = {
        prop: set() for prop in ("liesIn", "holds", "near", "partOf", "cleanliness", "weight")
    }
    for one, prop, other in facts:
        of[prop].add((one, other))
    boxes, cups = (tuple(name for name in THINGS if name.startswith(kind)) for kind in ("box", "cup"))
    lies, holds, clean = of["liesIn"], of["holds"], {x for x, how in of["cleanliness"] if how == "clean"}
    inside = _closed(lies)
    heavy = {x for x, weight in of["weight"] if 2.5 <= float(weight) < 7}
    leads = _closed(holds | of["near"] | {(x, y) for x, y in lies if x in clean})
    sees = {(h, x) for h, r in of["near"] for x, y in inside if y == r}
    held = {x for _, x in holds}
    servable = {x for x, y in lies if x in cups and x in clean and y.startswith("room") and x not in held}
    deep = {x for x, y in inside if y in heavy}
    guarding = {b for b in heavy if b in clean}
    around = {y for h, x in holds for z, y in lies if z == x}
    found = {y for x, y in leads if x.startswith("hand") and y in PLACES}
    into = {place: [x for x, y in lies if y == place] for place in PLACES}
    own = {
        "Servable": servable, "Deep": deep, "Guarded": {x for x, b in inside if b in guarding}, "Heavy": heavy, "Found": found,
        "Tidy": {box for box in boxes if all(x in boxes or x in clean for x in into[box])},
        "Crowded": {box for box in boxes if sum(x in cups for x in into[box]) >= 2},
        "Sparse": {place for place in PLACES if len(into[place]) <= 1},
        "Paired": {hand for hand in ("hand1", "hand2") if sum(h == hand for h, _ in holds) == 2},
        "Touched": servable | {x for x, y in lies if x in cups and y in around},
        "Sought": {x for x, y in lies if x in deep and y in found},
    }  # fmt: skip
    pairs = {
        "isInside": inside, "contains": {(y, x) for x, y in inside}, "sees": sees, "leadsTo": leads,
        "linked": _closed({(x, y) for h, x in holds for g, y in holds if h == g and x != y}),
        "onFloor": {(x, f) for x, y in inside for p, f in of["partOf"] if p == y},
        "endsOn": {(x, f) for x, y in leads for p, f in of["partOf"] if p == y},
    }  # fmt: skip
    return {(name, x) for name, those in own.items() for x in those} | {
        (name, *both) for name, those in pairs.items() for both in those
    }


def _closed(pairs: set[tuple[str, str]]) -> set[tuple[str, str]]:
    """Return the transitive closure of a relation."""
    found: set[tuple[str, str]] = set()
    while found != (found := found | pairs | {(x, z) for x, y in found for w, z in pairs if w == y}):
        pass
    return found


def entailed(states: Sequence[str]) -> list[set[tuple[str, ...]]]:
    """Return HermiT's entailments in each state by local names: classes with an individual, properties with two individuals."""
    classes = [kind[1:] for kind, _ in DEFINED.values()] + [kind[1:] for kind in CONCLUDED.values()]
    asked = {"logic": LOGIC, "states": [*states], "classes": classes, "properties": PROPERTIES}
    done = subprocess.run(
        [sys.executable, "-m", "worlds.entailed"], input=json.dumps(asked), capture_output=True, text=True, check=True
    )
    return [{tuple(one) for one in state} for state in json.loads(done.stdout)]


def _answers(asked: dict[str, Any]) -> Iterator[list[list[str]]]:
    """Yield HermiT's entailments in each state."""
    from org.semanticweb.HermiT import ReasonerFactory
    from org.semanticweb.owlapi.apibinding import OWLManager
    from org.semanticweb.owlapi.io import StringDocumentSource
    from org.semanticweb.owlapi.model import IRI

    factory = ReasonerFactory()
    for state in asked["states"]:
        manager: Any = OWLManager.createOWLOntologyManager()
        data = manager.getOWLDataFactory()
        head = f"{PREFIXES}<{SPACE}> a owl:Ontology .\n"
        ontology = manager.loadOntologyFromOntologyDocument(StringDocumentSource(head + asked["logic"] + state))
        reasoner = factory.createReasoner(ontology)
        found = []
        for name in asked["classes"]:
            kind = data.getOWLClass(IRI.create(SPACE + name))
            found += [[name, _local(one)] for one in reasoner.getInstances(kind, False).getFlattened()]
        for name in asked["properties"]:
            prop = data.getOWLObjectProperty(IRI.create(SPACE + name))
            for one in ALL:
                individual = data.getOWLNamedIndividual(IRI.create(SPACE + one))
                values = reasoner.getObjectPropertyValues(individual, prop).getFlattened()
                found += [[name, one, _local(other)] for other in values]
        reasoner.dispose()
        yield found


def _local(individual: Any) -> str:
    return str(individual.getIRI().getIRIString()).removeprefix(SPACE)


def main() -> None:
    """Print the entailments for the request on stdin."""
    import jpype
    import jpype.imports

    asked = json.load(sys.stdin)
    jpype.startJVM(jvm(), "-Xss16m", "-Dorg.slf4j.simpleLogger.defaultLogLevel=off", classpath=jars())
    print(json.dumps([*_answers(asked)]))


if __name__ == "__main__":
    main()

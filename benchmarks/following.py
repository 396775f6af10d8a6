"""The cost of derived situations: a scene with three defined ones, compared with the same scene with handwritten effects.

python -m benchmarks following
CONFAB_SIZES=66,333 …   how many cups; there are two places to each, and two rooms

Cups stand at places of rooms. Which room a cup is in, whether a place is taken, and whether a cup is servable (clean, in the
hall) are defined by a chain and two classes, or kept by each behaviour. A tenth of the cups shall be servable. Calls by turns.
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from statistics import median
from time import process_time

import confab

HEAD = """@prefix : <https://example.org/cups#> .
@prefix c: <https://w3id.org/confab/core#> .
@prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
<https://example.org/cups> a owl:Ontology ; owl:imports <https://w3id.org/confab/core> ; c:symbolicOnly true .
:Cup a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object ; c:hasSituationType :AT, :CLEANLINESS, :ROOM, :SERVABLE .
:Room a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object, :ROOM .
:Place a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object, :AT ; c:hasSituationType :TAKEN .
:AT a owl:Class, owl:NamedIndividual, c:SituationType ; c:valueProperty :at .
:at a owl:ObjectProperty, owl:FunctionalProperty .
:CLEANLINESS a owl:Class, owl:NamedIndividual, c:SituationType ; c:valueProperty :is .
:is a owl:ObjectProperty, owl:FunctionalProperty .
:clean a owl:NamedIndividual, :CLEANLINESS . :dirty a owl:NamedIndividual, :CLEANLINESS .
:ROOM a owl:Class, owl:NamedIndividual, c:SituationType ; c:valueProperty :inRoom . :inRoom a owl:ObjectProperty .
:partOf a owl:ObjectProperty, owl:NamedIndividual, c:Relation ; rdfs:domain :Place ; rdfs:range :Room .
:hall a owl:NamedIndividual, :Room . :kitchen a owl:NamedIndividual, :Room .
:TAKEN a owl:NamedIndividual, c:SituationType . :SERVABLE a owl:NamedIndividual, c:SituationType .
"""
DEFINED = """
:inRoom owl:propertyChainAxiom ( :at :partOf ) .
:TAKEN c:holdsOf :TakenPlace . :SERVABLE c:holdsOf :ServableCup .
:TakenPlace a owl:Class ; owl:equivalentClass [ a owl:Class ; owl:intersectionOf ( :Place
  [ a owl:Restriction ; owl:onProperty [ owl:inverseOf :at ] ; owl:someValuesFrom :Cup ] ) ] .
:ServableCup a owl:Class ; owl:equivalentClass [ a owl:Class ; owl:intersectionOf ( :Cup
  [ a owl:Restriction ; owl:onProperty :is ; owl:hasValue :clean ]
  [ a owl:Restriction ; owl:onProperty :inRoom ; owl:hasValue :hall ] ) ] .
:MOVE a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 1 ; c:update '''INSERT { ?cup :at ?place }
  WHERE { ?cup a :Cup . ?place a :Place FILTER NOT EXISTS { ?place :TAKEN true } }''' .
:WASH a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 2 ; c:update '''INSERT { ?cup :is :clean }
  WHERE { ?cup a :Cup . ?cup :inRoom :kitchen }''' .
"""
BY_HAND = """
:inRoom a owl:FunctionalProperty .
:HallPlace a owl:Class, owl:NamedIndividual ; rdfs:subClassOf :Place .
:KitchenPlace a owl:Class, owl:NamedIndividual ; rdfs:subClassOf :Place .
:TO_HALL a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 1 ; c:update '''
  DELETE { ?from :TAKEN true } INSERT { ?cup :at ?place ; :inRoom :hall . ?place :TAKEN true }
  WHERE { ?cup a :Cup . ?place a :HallPlace . ?cup :at ?from FILTER NOT EXISTS { ?place :TAKEN true } } ;
  INSERT { ?cup :SERVABLE true } WHERE { ?cup :is :clean }''' .
:TO_KITCHEN a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 2 ; c:update '''
  DELETE { ?from :TAKEN true . ?cup :SERVABLE true } INSERT { ?cup :at ?place ; :inRoom :kitchen . ?place :TAKEN true }
  WHERE { ?cup a :Cup . ?place a :KitchenPlace . ?cup :at ?from FILTER NOT EXISTS { ?place :TAKEN true } }''' .
:WASH a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 3 ; c:update '''
  INSERT { ?cup :is :clean } WHERE { ?cup a :Cup . ?cup :inRoom :kitchen } ;
  INSERT { ?cup :SERVABLE true } WHERE { ?cup :inRoom :hall }''' .
"""


def scene(cups: int, defined: bool) -> str:
    """Return a scene: half of the cups in each room, every second cup dirty, as many free places as cups."""
    lines = [HEAD, DEFINED if defined else BY_HAND]
    wanted = [f":task.goal{i}" for i in range(max(cups // 10, 1))]
    for i in range(2 * cups):
        room = "hall" if i % 2 else "kitchen"
        kind = "Place" if defined else f"{room.title()}Place"
        lines.append(f":place{i} a owl:NamedIndividual, :{kind} ; c:index {i + 1} ; :partOf :{room} .")
    for i in range(cups):
        state, room = "dirty" if i % 4 < 2 else "clean", "hall" if i % 2 else "kitchen"
        lines.append(
            f":cup{i} a owl:NamedIndividual, :Cup ; c:index {2 * cups + i + 1} ; :at :place{i} ; :is :{state} ."
        )
        if not defined:
            lines.append(f":cup{i} :inRoom :{room} .")
            lines.append(_fact(f"place{i}", "TAKEN"))
            lines += [_fact(f"cup{i}", "SERVABLE")] if (state, room) == ("clean", "hall") else []
    lines.append(f":task a owl:NamedIndividual, c:Task ; c:goal {', '.join(wanted)} .")
    for i, goal in enumerate(wanted):
        lines.append(
            f"{goal} a owl:NamedIndividual, c:ValueCondition ; c:about :cup{10 * i + i % 4} ; c:situationType :SERVABLE ."
        )
    return "\n".join(lines)


def _fact(about: str, situation: str) -> str:
    said = f"c:about :{about} ; c:situationType :{situation}"
    return f":{about}.{situation} a owl:NamedIndividual, c:SituatedObjectInstance ; {said} ."


def main() -> None:
    """Print the table."""
    print(
        "| objects | whole call, defined, CPU s | by hand | ratio | steps, defined | by hand |\n|---|---|---|---|---|---|"
    )
    for cups in map(int, os.environ.get("CONFAB_SIZES", "66,333").split(",")):
        seconds: dict[bool, list[float]] = {True: [], False: []}
        length = {}
        with tempfile.TemporaryDirectory() as folder:
            for _ in range(5 if cups <= 200 else 3):
                for defined in seconds:
                    path = Path(folder) / "cups.ttl"
                    path.write_text(scene(cups, defined), encoding="utf-8")
                    begin = process_time()
                    found = confab.load(path).plan()
                    seconds[defined].append(process_time() - begin)
                    length[defined] = len(found.plan.steps) if found.plan else found.outcome.status.value
        one, other = (median(seconds[defined]) for defined in (True, False))
        print(
            f"| {3 * cups + 2:,} | {one:.2f} | {other:.2f} | {one / other:.2f} | {length[True]} | {length[False]} |",
            flush=True,
        )

"""A scene with cups in two rooms; its situation types are either defined by axioms or updated by every behaviour."""

from __future__ import annotations

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
    """Return a scene in Turtle with half of the cups in each room, and as many free places as cups."""
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

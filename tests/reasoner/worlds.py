"""Random worlds for property tests: behaviours and situations are drawn at random and written as ordinary Turtle."""

import re
from pathlib import Path

from hypothesis import strategies as st

from confab.reasoner.graph.knowledge import KnowledgeGraph, load

HEAD = """
@prefix : <https://w3id.org/confab/core#> .
@prefix w: <https://example.org/world#> .
@prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
<https://example.org/world> a owl:Ontology ; owl:imports <https://w3id.org/confab/core> .
w:Thing a owl:Class, owl:NamedIndividual ; rdfs:subClassOf :Object ; :hasSituationType w:AT, w:COLOR, w:TOUCHES, w:FILL .
w:Tool a owl:Class, owl:NamedIndividual ; rdfs:subClassOf w:Thing .
w:Spot a owl:Class, owl:NamedIndividual ; rdfs:subClassOf w:AT .
w:AT a owl:Class, owl:NamedIndividual, :SituationType ; :valueProperty w:at .
w:at a owl:ObjectProperty, owl:FunctionalProperty, owl:NamedIndividual .
w:nowhere a owl:NamedIndividual, w:AT .
w:COLOR a owl:Class, owl:NamedIndividual, :SituationType ; :valueProperty w:color ; :defaultValue w:red .
w:color a owl:ObjectProperty, owl:FunctionalProperty, owl:NamedIndividual .
w:red a owl:NamedIndividual, w:COLOR .
w:blue a owl:NamedIndividual, w:COLOR .
w:TOUCHES a owl:Class, owl:NamedIndividual, :SituationType ; :valueProperty w:touches .
w:touches a owl:ObjectProperty, owl:NamedIndividual .
w:Spot rdfs:subClassOf w:TOUCHES .
w:FILL a owl:NamedIndividual, :SituationType, :Amount ; :valueProperty w:fill .
w:FILL :leastAmount 0 ; :mostAmount 2.5 ; :defaultAmount 1 .
w:fill a owl:DatatypeProperty, owl:FunctionalProperty, owl:NamedIndividual .
w:size a owl:DatatypeProperty, owl:NamedIndividual, :Relation .
w:near a owl:ObjectProperty, owl:NamedIndividual, :Relation .
w:fits a owl:ObjectProperty, owl:NamedIndividual, :Relation .
w:LENT a owl:NamedIndividual, :SituationType ; :parameter w:LENT.1, w:LENT.2, w:LENT.3 .
w:LENT.1 a owl:NamedIndividual, :Parameter ; :index 1 ; :termType w:Thing .
w:LENT.2 a owl:NamedIndividual, :Parameter ; :index 2 ; :termType w:Tool .
w:LENT.3 a owl:NamedIndividual, :Parameter ; :index 3 ; :termType w:Spot .
"""
KINDS = {"x": "w:Thing", "y": "w:Tool", "z": "w:Spot", "u": "w:Spot", "v": "w:Thing"}
THINGS, SPOTS = ["x", "y", "v"], ["z", "u"]


@st.composite
def leaf(draw: st.DrawFn, behavior: str, name: str) -> str:
    """Return a condition without nested conditions, over the terms of a behaviour."""
    thing, other = (f"w:{behavior}.{draw(st.sampled_from(THINGS))}" for _ in range(2))
    spot, spot2 = (f"w:{behavior}.{draw(st.sampled_from(SPOTS))}" for _ in range(2))
    negated = draw(st.sampled_from(["", "", "", " ; :negated true"]))
    sign, amount = draw(st.sampled_from(["<", "<=", "=", ">=", ">"])), draw(st.sampled_from(["0", "1", "1.5", "2.50"]))
    body = draw(
        st.sampled_from(
            [
                f":ValueCondition ; :about {thing} ; :situationType w:AT ; :value {spot}",
                f":ValueCondition ; :about {thing} ; :situationType w:AT ; :value w:nowhere",
                f":ValueCondition ; :about {thing} ; :situationType w:COLOR ; :value w:red",
                f":ValueCondition ; :about {thing} ; :situationType w:COLOR ; :value w:blue",
                f":ValueCondition ; :about {thing} ; :situationType w:TOUCHES ; :value {spot}",
                f":ValueCondition ; :about {thing} ; :argument2 w:{behavior}.y ; :argument3 {spot} ; :situationType w:LENT",
                f":ValueCondition ; :about {thing} ; :argument2 w:{behavior}.y ; :argument3 w:s0 ; :situationType w:LENT",
                f":RelationCondition ; :about {spot} ; :relation w:near ; :value {spot2}",
                f":RelationCondition ; :about {spot} ; :relation w:near ; :value w:s0",
                f":RelationCondition ; :about {thing} ; :relation w:fits ; :value {spot}",
                f":ClassCondition ; :about {thing} ; :ofClass w:Tool",
                f":EqualityCondition ; :about {thing} ; :value {other}",
                f':Comparison ; :about {thing} ; :situationType w:FILL ; :sign "{sign}" ; :amount {amount}',
                f':Comparison ; :left w:{name}_l ; :sign "{sign}" ; :right w:{name}_r',
            ]
        )
    )
    more = (
        f"w:{name}_l a owl:NamedIndividual, :Calculation ; :about {thing} ; :relation w:size .\n"
        f'w:{name}_r a owl:NamedIndividual, :Calculation ; :about {other} ; :situationType w:FILL ; :sign "+" ; :amount -0.5 .\n'
    )
    return f"w:{name} a owl:NamedIndividual, {body}{negated} .\n" + more * (":left" in body)


@st.composite
def condition(draw: st.DrawFn, behavior: str, name: str) -> str:
    """Return a condition; some are nested: a free spot, a witness or alternatives."""
    kind = draw(st.sampled_from(["leaf"] * 4 + ["free", "witness", "any"]))
    spot = f"w:{behavior}.{draw(st.sampled_from(SPOTS))}"
    if kind == "free":
        return (
            f"w:{name} a owl:NamedIndividual, :AbsenceCondition ; :ofClass w:Thing ; :situationType w:AT ; "
            f":value {spot} .\n"
        )
    if kind == "any":
        inner = draw(leaf(behavior, f"{name}a")) + draw(leaf(behavior, f"{name}b"))
        return f"w:{name} a owl:NamedIndividual, :AnyOf ; :alternative w:{name}a, w:{name}b .\n{inner}"
    if kind == "witness":
        negated = draw(st.sampled_from(["", " ; :negated true"]))
        seen = draw(
            st.sampled_from(
                [
                    f":ValueCondition ; :about w:{name}w ; :situationType w:AT ; :value {spot}",
                    f":ValueCondition ; :about w:{name}w ; :situationType w:TOUCHES ; :value {spot}",
                    f":ValueCondition ; :about w:{name}w ; :argument2 w:{name}w ; :argument3 w:s0 ; :situationType w:LENT",
                    f":RelationCondition ; :about w:{name}w ; :relation w:fits ; :value {spot}",
                    f":RelationCondition ; :about w:{name}w ; :relation w:fits ; :value w:s0",
                    f":ValueCondition ; :about w:{name}w ; :situationType w:COLOR ; :value w:blue",
                ]
            )
        )
        return (
            f"w:{name} a owl:NamedIndividual, :Witness ; :witness w:{name}w ; :condition w:{name}c{negated} .\n"
            f"w:{name}w a owl:NamedIndividual, :Variable ; :termType w:Tool .\n"
            f"w:{name}c a owl:NamedIndividual, {seen} .\n"
        )
    return draw(leaf(behavior, name))


@st.composite
def of_each(draw: st.DrawFn, name: str) -> str:
    """Return an effect on all things or tools, sometimes only on those at a spot or of a color, or an effect on another thing."""
    about = draw(st.sampled_from(["w:Thing", "w:Tool", f"w:{name}.v"]))
    what = draw(
        st.sampled_from(
            [
                ':AmountEffect ; :situationType w:FILL ; :change "decrease" ; :amount 1',
                ':AmountEffect ; :situationType w:FILL ; :change "increase" ; :amount 0.5',
                ":ValueEffect ; :situationType w:COLOR ; :value w:blue",
                f":ValueEffect ; :situationType w:AT ; :value w:{name}.z",
            ]
        )
    )
    when = draw(
        st.sampled_from(
            [
                "",
                f":ValueCondition ; :about {about} ; :situationType w:AT ; :value w:{name}.u",
                f":ValueCondition ; :about {about} ; :situationType w:COLOR ; :value w:blue",
                f":RelationCondition ; :about {about} ; :relation w:fits ; :value w:s0",
            ]
        )
    )
    said = f"w:{name}_f a owl:NamedIndividual, {what} ; :about {about}{f' ; :when w:{name}_w' if when else ''} .\n"
    return said + (f"w:{name}_w a owl:NamedIndividual, {when} .\n" if when else "")


@st.composite
def behavior(draw: st.DrawFn, name: str) -> str:
    """Return a behaviour; a spot that a condition determines is sometimes a variable, and every other term is a parameter."""
    conditions = draw(st.integers(1, 3))
    text = "".join(draw(condition(name, f"{name}_{i}")) for i in range(conditions))
    thing, spot = draw(st.sampled_from(THINGS)), draw(st.sampled_from(SPOTS))
    effects = {
        "AT": draw(st.sampled_from([f"w:{name}.{spot}", f"w:{name}.{spot}", "w:nowhere"])),
        "COLOR": draw(st.sampled_from(["w:red", "w:blue"])),
        "TOUCHES": f"w:{name}.{spot}",
        "LENT": f":true ; :argument2 w:{name}.y ; :argument3 w:{name}.{spot}",
    }
    situation = draw(st.sampled_from(["AT", "AT", "COLOR", "TOUCHES", "LENT"]))
    negated = draw(st.sampled_from(["", " ; :negated true"])) if situation == "TOUCHES" else ""
    text += (
        f"w:{name}_e a owl:NamedIndividual, :ValueEffect ; :about w:{name}.{thing} ; "
        f":situationType w:{situation} ; :value {effects[situation]}{negated} .\n"
    )
    effects_of = [f"w:{name}_e"]
    if draw(st.sampled_from([True, True, False])):
        text += draw(of_each(name))
        effects_of.append(f"w:{name}_f")
    if draw(st.booleans()):
        change = draw(st.sampled_from(["assign", "increase", "decrease", "scale"]))
        effects_of.append(f"w:{name}_a")
        text += (
            f"w:{name}_a a owl:NamedIndividual, :AmountEffect ; :about w:{name}.{draw(st.sampled_from(THINGS))} ; "
            f':situationType w:FILL ; :change "{change}" ; :amount {draw(st.sampled_from(["0.5", "1", "-1"]))} .\n'
        )
    used = [term for term in KINDS if f"w:{name}.{term} " in text]
    determined = {
        term for term in used for i in range(conditions) if _determines(text, f"{name}_{i}", f"{name}.{term}")
    }
    variables = {term for term in sorted(determined) if draw(st.booleans())}
    for i, term in enumerate(used):
        role = ":Variable" if term in variables else f":Parameter ; :index {i}"
        text += f"w:{name}.{term} a owl:NamedIndividual, {role} ; :termType {KINDS[term]} .\n"
    parameters = ", ".join(f"w:{name}.{term}" for term in used if term not in variables)
    listed = ", ".join(f"w:{name}_{i}" for i in range(conditions))
    return (
        text
        + f"w:{name} a owl:NamedIndividual, :Behavior ; :level 1 {'; :parameter ' * bool(parameters)}{parameters} ; "
        f":precondition {listed} ; :postcondition {', '.join(effects_of)} .\n"
    )


def _determines(text: str, condition: str, term: str) -> bool:
    lines = [line for line in text.splitlines() if line.startswith(f"w:{condition} ")]
    return any(
        ":ValueCondition" in line and line.endswith(f":situationType w:AT ; :value w:{term} .") for line in lines
    )


@st.composite
def worlds(draw: st.DrawFn) -> str:
    """Return a world as Turtle: two or three behaviours, a few things and spots, and a goal of one or two facts."""
    text = HEAD
    spots = [f"s{i}" for i in range(draw(st.integers(1, 3)))]
    things = [f"t{i}" for i in range(draw(st.integers(1, 4)))]
    for spot in spots:
        text += f"w:{spot} a owl:NamedIndividual, w:Spot .\n"
        text += "".join(f"w:{spot} w:near w:{other} .\n" for other in spots if draw(st.booleans()))
    for thing in things:
        place, kind = draw(st.sampled_from([*spots, "nowhere"])), draw(st.sampled_from(["Thing", "Tool"]))
        text += f"w:{thing} a owl:NamedIndividual, w:{kind} ; w:at w:{place} .\n"
        text += draw(st.sampled_from(["", f"w:{thing} w:color w:blue .\n"]))
        text += draw(
            st.sampled_from(
                [
                    f"w:{thing} w:size 0.5 .\n",
                    f"w:{thing} w:fill 2.5 ; w:size 1.50 .\n",
                    f"w:{thing} w:fill 0 .\n",
                ]
            )
        )
        text += "".join(f"w:{thing} w:fits w:{spot} .\n" for spot in spots if draw(st.booleans()))
        text += "".join(f"w:{thing} w:touches w:{spot} .\n" for spot in spots if draw(st.booleans()))
    kinds = dict(re.findall(r"^w:(t\d) a owl:NamedIndividual, w:(\w+)", text, re.M))
    for n, (thing, tool) in enumerate((a, b) for a in things for b in things if kinds[b] == "Tool"):
        if draw(st.booleans()):
            text += f"w:lent{n} a owl:NamedIndividual, :SituatedObjectInstance ; :situationType w:LENT ; :about w:{thing} ; "
            text += f":argument2 w:{tool} ; :argument3 w:{draw(st.sampled_from(spots))} ; :value :true .\n"
    for i in range(draw(st.integers(2, 3))):
        text += draw(behavior(f"B{i}"))
    thing, spot = draw(st.sampled_from(things)), draw(st.sampled_from(spots))
    wanted = draw(
        st.sampled_from([f"w:AT ; :value w:{spot}", "w:COLOR ; :value w:blue", f"w:TOUCHES ; :value w:{spot}"])
    )
    text += "w:task a owl:NamedIndividual, :Task ; :goal w:task.g .\n"
    return text + f"w:task.g a owl:NamedIndividual, :ValueCondition ; :about w:{thing} ; :situationType {wanted} .\n"


def graph_of(text: str, folder: Path) -> KnowledgeGraph:
    """Return a world as a knowledge graph."""
    path = folder / "world.ttl"
    path.write_text(text, encoding="utf-8")
    return load(path)

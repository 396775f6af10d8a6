"""Further kinds of input for `benchmarks.broken_inputs`: definitions, amounts, SPARQL updates, numbers in PDDL, rules, meshes."""

from __future__ import annotations

import random
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pyoxigraph as ox

from benchmarks.broken_inputs import (
    HERE,
    MUTATIONS,
    TYPE,
    Arguments,
    Triples,
    mutated_bytes,
    mutated_triples,
    mutated_words,
)
from confab.reasoner.vocabulary import CORE, OWL, RDF, RDFS, XSD

ROOT = HERE.parent
WORLDS = {"defined": ("packing", "gallery"), "amounts": ("canteen",), "updates": ("packing-updates", "canteen-updates")}
NUMBERS = (
    "0",
    "-1",
    "2",
    "1.5",
    "-0.5",
    "0.1",
    "1e3",
    "1e60",
    "1e61",
    "1e400",
    "9" * 61,
    "0." + "0" * 70 + "1",
    "NaN",
    "INF",
    "x",
)
DEFINING = (
    *(RDFS + word for word in ("subPropertyOf", "subClassOf", "domain", "range")),
    *(OWL + word for word in ("inverseOf", "propertyChainAxiom", "equivalentClass", "complementOf", "someValuesFrom")),
    *(OWL + word for word in ("allValuesFrom", "hasValue", "intersectionOf", "unionOf", "onProperty", "oneOf")),
    *(CORE + word for word in ("holdsOf", "condition", "situationType", "value", "about", "restValue", "fromLevel")),
)
MEASURING = (
    "left",
    "right",
    "amount",
    "sign",
    "change",
    "leastAmount",
    "mostAmount",
    "defaultAmount",
    "unit",
    "relation",
)
PDDL = (
    """(define (domain boxes) (:requirements :typing :derived-predicates :numeric-fluents)
 (:types thing - object box - thing)
 (:predicates (in ?t - thing ?b - box) (inside ?t - thing ?b - box) (loose ?t - thing) (shut ?b - box) (reachable ?t - thing))
 (:functions (room ?b - box) (size ?t - thing) (effort))
 (:derived (inside ?t ?b) (or (in ?t ?b) (exists (?c - box) (and (in ?t ?c) (inside ?c ?b)))))
 (:derived (loose ?t) (not (exists (?b - box) (in ?t ?b))))
 (:derived (reachable ?t) (forall (?b - box) (imply (inside ?t ?b) (not (shut ?b)))))
 (:action open :parameters (?b - box) :precondition (reachable ?b) :effect (and (not (shut ?b)) (increase (effort) 0.5)))
 (:action put :parameters (?t - thing ?b - box)
  :precondition (and (loose ?t) (reachable ?b) (not (shut ?b)) (not (= ?t ?b)) (not (inside ?b ?t)) (>= (room ?b) (size ?t)))
  :effect (and (in ?t ?b) (decrease (room ?b) (size ?t))))
 (:action take :parameters (?t - thing ?b - box) :precondition (and (in ?t ?b) (reachable ?t) (not (shut ?b)))
  :effect (and (not (in ?t ?b)) (increase (room ?b) (* 1 (size ?t))))))""",
    """(define (problem packing) (:domain boxes) (:objects ball - thing small large - box)
 (:init (in ball large) (shut large) (= (room small) 1) (= (room large) 3) (= (size ball) 1) (= (size small) 1.5)
  (= (size large) 9) (= (effort) 0))
 (:goal (and (inside ball large) (in ball small) (<= (effort) 4))))""",
)
WORDS = (
    *(":derived", ":functions", ":numeric-fluents", "increase", "decrease", "assign", "scale-up", "scale-down", "total-cost"),
    *("(room ?b)", "(size ?t)", "(effort)", ">=", "<=", ">", "<", "=", "+", "-", "*", "/", "not", "and", "or", "when"),
    *("forall", "exists", "imply", "(", ")", "?t", "?b", "(loose ?t)", "(inside ?t ?b)", "(in ?t ?b)", *NUMBERS),
)  # fmt: skip
FORMULAS = (
    "in",
    "inside",
    "loose",
    "shut",
    "reachable",
    "not",
    "and",
    "or",
    "exists",
    "forall",
    "=",
    ">=",
    "<",
    "increase",
)
CALCULATIONS = ("room", "size", "effort", "+", "-", "*", "/")
CUBE = [(x, y, z) for x in (-0.02, 0.02) for y in (-0.02, 0.02) for z in (-0.02, 0.02)]
OBJ = (
    "".join(f"v {x} {y} {z}\n" for x, y, z in CUBE)
    + "f 1 2 4 3\nf 5 6 8 7\nf 1 2 6 5\nf 3 4 8 7\nf 1 3 7 5\nf 2 4 8 6\n"
)
STL = "\n".join(
    ["solid a"]
    + [
        "\n".join(
            ["facet normal 0 0 0", "outer loop", *(f"vertex {x} {y} {z}" for x, y, z in corners), "endloop", "endfacet"]
        )
        for corners in (CUBE[:3], CUBE[1:4], CUBE[4:7], CUBE[2:5])
    ]
)


def sources(folder: Path) -> None:
    """Write the valid inputs: small worlds with definitions or amounts, with and without SPARQL updates, and their memories."""
    import confab
    from confab.memory import Memory
    from confab.reasoner.updates.converting import convert

    for world in ("packing", "gallery", "canteen"):
        place = folder / world
        place.mkdir(parents=True)
        shutil.copy(ROOT / "ontology" / "domains" / f"{world}.ttl", place / "domain.ttl")
        shutil.copy(ROOT / "ontology" / "scenes" / f"{world}-small.ttl", place / "scene.ttl")
        (place / "catalog-v001.xml").write_text(
            '<?xml version="1.0"?>\n<catalog xmlns="urn:oasis:names:tc:entity:xmlns:xml:catalog">\n'
            f'  <uri name="https://w3id.org/confab/{world}" uri="domain.ttl"/>\n</catalog>\n'
        )
        scene = confab.load(place / "scene.ttl")
        memory = Memory.of(scene)
        memory.experience.replica = "fuzz"
        memory.teach(scene, scene.plan())
        memory.save(place / "memory.ttl")
        shutil.copytree(place, folder / f"{world}-updates")
        text = convert(place / "domain.ttl", "sparql").text
        (folder / f"{world}-updates" / "domain.ttl").write_text(text)


def defining(draw: random.Random, triples: Triples) -> None:
    """Add an axiom between two nodes, a type of property, or a property chain."""
    if triples:
        one, other = draw.choice(triples), draw.choice(triples)
        if draw.random() < 0.2:
            kind = draw.choice(("TransitiveProperty", "SymmetricProperty", "FunctionalProperty", "Class"))
            triples.append(ox.Triple(one.subject, TYPE, ox.NamedNode(OWL + kind)))
        elif draw.random() < 0.3:
            cell, rest = ox.BlankNode(), ox.NamedNode(RDF + "nil")
            triples.append(ox.Triple(cell, ox.NamedNode(RDF + "first"), other.predicate))
            triples.append(ox.Triple(cell, ox.NamedNode(RDF + "rest"), rest))
            triples.append(ox.Triple(one.predicate, ox.NamedNode(OWL + "propertyChainAxiom"), cell))
        else:
            end = draw.choice((other.subject, other.object, other.predicate))
            triples.append(
                ox.Triple(draw.choice((one.subject, one.predicate)), ox.NamedNode(draw.choice(DEFINING)), end)
            )


def numeric(draw: random.Random, triples: Triples) -> None:
    """Replace a number, sign or operation of a calculation, or add a part to a calculation."""
    kinds = ("decimal", "integer", "double", "string")
    number = ox.Literal(draw.choice(NUMBERS), datatype=ox.NamedNode(XSD + draw.choice(kinds)))
    places = [i for i, t in enumerate(triples) if re.fullmatch(r"[-+.\dEe]+", getattr(t.object, "value", ""))]
    if places and draw.random() < 0.5:
        place = draw.choice(places)
        triples[place] = ox.Triple(triples[place].subject, triples[place].predicate, number)
        return
    signs = [i for i, t in enumerate(triples) if t.predicate.value in (CORE + "sign", CORE + "change")]
    if signs and draw.random() < 0.5:
        place = draw.choice(signs)
        said = draw.choice(
            ("<", "<=", "=", ">=", ">", "+", "-", "*", "/", "assign", "increase", "decrease", "scale", "x")
        )
        triples[place] = ox.Triple(triples[place].subject, triples[place].predicate, ox.Literal(said))
    elif triples:
        one, other = draw.choice(triples), draw.choice(triples)
        end = draw.choice((number, other.subject, other.object))
        triples.append(ox.Triple(one.subject, ox.NamedNode(CORE + draw.choice(MEASURING)), end))


# ----------------------------------------------------------------------------------------------------------------- doors


def _planned(draw: random.Random, folder: Path) -> Arguments:
    modes: tuple[Arguments, ...] = (["--mode", "paper"], ["--optimal"], ["--mode", "strict"], [], [], [])
    chosen = draw.choice(modes)
    if draw.random() < 0.15:
        return draw.choice(
            (["validate", str(folder / "scene.ttl")], ["query", str(folder / "scene.ttl"), "--affords", "all"])
        )
    return ["plan", str(folder / "scene.ttl"), "--time-limit", "5", "--json", *chosen]


def defined(draw: random.Random, folder: Path) -> Arguments:
    """Plan with broken definitions of derived situations."""
    more = (defining, *draw.choices(MUTATIONS, k=2))
    mutated_triples(draw, folder / draw.choice(("domain.ttl", "domain.ttl", "scene.ttl")), more)
    return _planned(draw, folder)


def amounts(draw: random.Random, folder: Path) -> Arguments:
    """Plan with broken amounts, bounds and calculations."""
    more = (numeric, numeric, *draw.choices(MUTATIONS, k=2))
    mutated_triples(draw, folder / draw.choice(("domain.ttl", "scene.ttl")), more)
    return _planned(draw, folder)


def updates(draw: random.Random, folder: Path) -> Arguments:
    """Plan with behaviours whose SPARQL updates are broken."""
    file = folder / "domain.ttl"
    text = file.read_text()
    at = draw.choice([match.span(1) for match in re.finditer(r'c:update """(.*?)"""', text, re.DOTALL)])
    words = re.findall(r"[?:]\w+|\bd:\w+", text)
    more = (
        "?x",
        "FILTER",
        "NOT EXISTS",
        "{",
        "}",
        "UNION",
        "BIND",
        "(?n + 1 AS ?m)",
        ";",
        ".",
        "DELETE",
        "INSERT",
        "true",
        *words,
    )
    broken = mutated_words(draw, text[slice(*at)], more).replace("\\", "").replace('"', "")
    file.write_text(text[: at[0]] + broken + text[at[1] :], encoding="utf-8", errors="replace")
    return _planned(draw, folder)


def numbers(draw: random.Random, folder: Path) -> Arguments:
    """Plan with or import broken PDDL that has derived predicates and numbers."""
    from confab.pddl_commands import import_pddl

    texts = list(PDDL)
    which = draw.choice((0, 0, 1))
    texts[which] = mutated_words(draw, texts[which], WORDS) if draw.random() < 0.2 else _regrouped(draw, texts[which])
    files = [folder / "domain.pddl", folder / "problem.pddl"]
    for file, text in zip(files, texts, strict=True):
        file.write_text(text, encoding="utf-8", errors="replace")
    try:
        import_pddl(files[0], files[1], folder / "imported.ttl")
    except Exception:  # the command must report the error
        return ["import", *map(str, files), "-o", str(folder / "out.ttl")]
    mode: tuple[Arguments, ...] = (["--optimal"], ["--mode", "paper"], [], [])
    return ["plan", str(folder / "imported.ttl"), "--time-limit", "5", "--json", *draw.choice(mode)]


def _regrouped(draw: random.Random, text: str) -> str:
    """Delete, negate, nest or replace formulas and calculations of a PDDL text."""
    for _ in range(draw.choice((1, 1, 2, 3))):
        kinds: dict[bool, list[tuple[int, int]]] = {True: [], False: []}
        opened: list[int] = []
        for match in re.finditer(r"[()]|[^\s()]+", text):
            if match[0] == "(":
                opened.append(match.start())
            elif match[0] == ")" and opened:
                begin = opened.pop()
                head = text[begin + 1 :].split(maxsplit=1)[0].strip("()")
                if head in FORMULAS or head in CALCULATIONS:
                    kinds[head in FORMULAS].append((begin, match.end()))
            elif re.fullmatch(r"[\d.]+", match[0]):
                kinds[False].append(match.span())
        formula = draw.random() < 0.5
        spot, other = draw.choice(kinds[formula]), draw.choice(kinds[formula])
        said, new = text[slice(*spot)], text[slice(*other)]
        if formula:
            new = draw.choice(
                (
                    new,
                    new,
                    "(and)",
                    f"(not {said})",
                    f"(or {said} {new})",
                    f"(and {said} {new})",
                    f"(when {new} {said})",
                )
            )
        else:
            new = draw.choice((new, new, draw.choice(NUMBERS), f"({draw.choice('+-*/')} {said} {new})"))
        text = text[: spot[0]] + new + text[spot[1] :]
    return text


def edited(draw: random.Random, folder: Path) -> Arguments:
    """Plan with a memory whose rules have random changes of conditions, roles, steps and counts."""
    file, scene = folder / "memory.ttl", str(folder / "scene.ttl")
    text = file.read_text()
    for _ in range(draw.choice((1, 1, 2, 4))):
        spots = list(re.finditer(r"(:\w+) (-?\d[\d.]*|m:[\w.]+|<[^>]*>|:\w+|\"[^\"]*\")(?= [;,.])", text))
        spot, other = draw.choice(spots), draw.choice(spots)
        odd = ("-1", "0", "1000000", "1000000000000", "1e6", "true", '"x"', spot[2] + "x", "<urn:fuzz:nowhere>")
        new = draw.choice((other[2], *odd))
        match draw.randrange(5):
            case 0:
                text = text[: spot.start(1)] + other[1] + text[spot.end(1) :]
            case 1:
                text = text[: spot.end(2)] + f", {new}" + text[spot.end(2) :]
            case _:
                text = text[: spot.start(2)] + new + text[spot.end(2) :]
    file.write_text(text)
    modes = ("guarded", "leading", "strict")
    calls: tuple[Arguments, ...] = (
        ["plan", scene, "--memory", str(file), "--json", "--time-limit", "5", "--mode", draw.choice(modes)],
        ["execute", scene, "--memory", str(file), "--learn"],
        ["memory", "show", str(file), "--most", "3"],
        ["memory", "trust", str(file), "all"],
        ["explain", scene, "--memory", str(file)],
    )
    return draw.choice((calls[0], calls[0], *calls))


def meshes(draw: random.Random, folder: Path) -> Arguments:
    """Compute the reach of a robot whose hand has a broken mesh."""
    from benchmarks.broken_inputs import urdf

    call = urdf(random.Random(0), folder)  # writes the files; the URDF is replaced below
    robot, bodies = ROOT / "ontology" / "robots" / "two-arms.urdf", folder / "bodies"
    kind, text = draw.choice((("obj", OBJ), ("stl", STL)))
    boxes = list(re.finditer(r"<box size=\"[^\"]*\"/>", robot.read_text()))
    spot, scale = (
        draw.choice(boxes),
        draw.choice(("", "", ' scale="1 1 1"', ' scale="0 1 1"', ' scale="1e9 1 1"', ' scale="x"')),
    )
    name = draw.choice(("part", "part", "part", "missing", "../part")) + f".{kind}"
    whole = robot.read_text()
    whole = whole[: spot.start()] + f'<mesh filename="{name}"{scale}/>' + whole[spot.end() :]
    (bodies / "broken.urdf").write_text(whole)
    part = bodies / f"part.{kind}"
    part.write_text(mutated_words(draw, text, ("v", "f", "vertex", *NUMBERS, "1e308", "0/0", "-9")), errors="replace")
    if draw.random() < 0.3:
        mutated_bytes(draw, part)
    return call


DOORS: dict[str, tuple[Callable[[random.Random, Path], Arguments], int]] = {
    door.__name__: (door, share)
    for door, share in ((defined, 40), (amounts, 40), (updates, 40), (numbers, 60), (edited, 30), (meshes, 3))
}
"""The doors (kinds of input) with their functions and relative numbers of cases, in addition to `benchmarks.broken_inputs`."""

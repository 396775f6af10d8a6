"""Whole valid inputs, broken in their structure, at every door of the command line: each answer is a result or one line.

    python -m benchmarks.fuzz                          100,000 cases, going on where the last run ended
    python -m benchmarks.fuzz --cases 500 --door plan  some of one door
    python -m benchmarks.fuzz --again memory:17        one case again, its files kept

A case is a door and a number, from which everything in it is drawn. It runs in a process of its own, with limits of time and
memory. What broke is kept in ``fuzz-seeds.txt``; `tests/confab/test_fuzz.py` runs it again, and a share of new cases.
"""

from __future__ import annotations

import argparse
import gc
import io
import json
import os
import random
import re
import resource
import shutil
import signal
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import pyoxigraph as ox

from reasoner.graph.knowledge import KnowledgeError
from reasoner.vocabulary import CORE, OWL, RDF, RDFS, XSD

HERE = Path(__file__).resolve().parent
SEEDS = HERE / "fuzz-seeds.txt"
PROGRESS = Path("confab-out") / "fuzz.json"
SECONDS, MEGABYTES = 30, 4_000
TYPE = ox.NamedNode(RDF + "type")
ODD = (
    *(
        "",
        " ",
        "-1",
        "0",
        "1",
        "1.5",
        "NaN",
        "inf",
        "1e999",
        "9" * 30,
        "9" * 5000,
        "true",
        "x",
        "µ²",
        "$x$",
        "a b",
        "\t",
        "\r",
        "\n",
    ),
    *(
        "\0",
        "\x1b[2J",
        "\u202e",
        "…",
        "'",
        '"',
        "\\",
        "%s",
        "{0}",
        "../x",
        "/",
        "-",
        "--",
        "=",
        "a=b",
        "nothing",
        "?x",
        "<x>",
    ),
    *("[bad", "é" * 300),
)
OWL_WORDS = (
    "sameAs equivalentClass disjointWith onProperty unionOf complementOf intersectionOf someValuesFrom oneOf imports"
)
CORE_WORDS = (
    "condition alternative when precondition parameter goal witness valueProperty argument2 restValue defaultValue "
    "hasSituationType fromLevel firstId negated cost symbolicOnly"
)
DOMAINS = ("tearoom", "ferry", "served")


@dataclass(frozen=True)
class Failure:
    """What broke: the case, and how."""

    door: str
    seed: int
    what: str

    def __str__(self) -> str:
        """Return it as it stands in the file of seeds."""
        return f"{self.door}:{self.seed}  {' '.join(self.what.split())[:160]}"


# ---------------------------------------------------------------------------------------------------------------- inputs


def sources(folder: Path) -> None:
    """Write what the cases begin with: three small domains with a scene each, a memory, a plan, what was observed."""
    import confab
    from confab.authoring import new_domain
    from confab.memory import Memory
    from confab.pddl_commands import import_pddl
    from reasoner.generate import write_scene
    from reasoner.reading.observed import save_observed

    new_domain("tearoom", folder / "tearoom")
    (folder / "tearoom" / "tearoom-scene.ttl").rename(folder / "tearoom" / "scene.ttl")
    catalog = folder / "tearoom" / "catalog-v001.xml"
    catalog.write_text(catalog.read_text().replace("tearoom-scene.ttl", "scene.ttl"))
    ferry = HERE.parent / "docs" / "examples" / "ferry"
    import_pddl(ferry / "domain.pddl", ferry / "problem.pddl", folder / "ferry" / "scene.ttl")
    write_scene(folder / "served" / "scene.ttl", "served", 2, 1, 0, 0)
    for domain in DOMAINS:
        scene = confab.load(folder / domain / "scene.ttl")
        result, memory = scene.plan(), Memory.of(scene)
        result.save(folder / domain / "plan.json")
        memory.teach(scene, result.plan)
        memory.save(folder / domain / "memory.ttl")
        save_observed(folder / domain / "observed.ttl", scene.problem.initial, scene.names, scene.iri)


def mutated_triples(draw: random.Random, file: Path) -> None:
    """Break an ontology file in its structure: parts deleted, doubled, swapped, given another type, another end, a circle."""
    parser = ox.parse(path=str(file), format=ox.RdfFormat.TURTLE, base_iri="urn:fuzz:base")
    triples = [quad.triple for quad in parser]
    for _ in range(draw.choice((1, 1, 1, 2, 3, 5))):
        draw.choice(MUTATIONS)(draw, triples)
    prefixes = {k: v for k, v in parser.prefixes.items() if k}
    file.write_bytes(ox.serialize(triples, format=ox.RdfFormat.TURTLE, prefixes=prefixes) or b"")


Triples = list[ox.Triple]


def _any(draw: random.Random, triples: Triples) -> int:
    """Return the place of a triple, one about the core's words rather than another."""
    places = [i for i, t in enumerate(triples) if t.predicate.value.startswith(CORE) or draw.random() < 0.4]
    return draw.choice(places or range(len(triples)))


def delete(draw: random.Random, triples: Triples) -> None:
    """Drop a triple."""
    if triples:
        del triples[_any(draw, triples)]


def delete_node(draw: random.Random, triples: Triples) -> None:
    """Drop all that is said of a node."""
    if triples:
        node = triples[_any(draw, triples)].subject
        triples[:] = [t for t in triples if t.subject != node]


def double(draw: random.Random, triples: Triples) -> None:
    """Say all that is said of a node of another one, too, and perhaps name that wherever the first is named."""
    if triples:
        node = triples[_any(draw, triples)].subject
        twin = ox.NamedNode(getattr(node, "value", "x") + "Twin") if isinstance(node, ox.NamedNode) else ox.BlankNode()
        triples += [ox.Triple(twin, t.predicate, t.object) for t in triples if t.subject == node]
        if draw.random() < 0.7:
            triples += [ox.Triple(t.subject, t.predicate, twin) for t in triples if t.object == node]


def swap(draw: random.Random, triples: Triples) -> None:
    """Let two triples lead where the other led."""
    if triples:
        one, other = _any(draw, triples), _any(draw, triples)
        a, b = triples[one], triples[other]
        triples[one] = ox.Triple(a.subject, a.predicate, b.object)
        triples[other] = ox.Triple(b.subject, b.predicate, a.object)


def retype(draw: random.Random, triples: Triples) -> None:
    """Give a node the type of another."""
    types = [i for i, t in enumerate(triples) if t.predicate == TYPE]
    if types:
        place = draw.choice(types)
        triples[place] = ox.Triple(triples[place].subject, TYPE, triples[draw.choice(types)].object)


def other_end(draw: random.Random, triples: Triples) -> None:
    """Let a triple lead to anything: another node, itself, a text, a number, something without a name."""
    if not triples:
        return
    place = _any(draw, triples)
    t = triples[place]
    odd = draw.choice(ODD)
    ends: list[Any] = [
        draw.choice(triples).subject,
        draw.choice(triples).object,
        t.subject,
        ox.Literal(odd),
        ox.Literal(
            odd, datatype=ox.NamedNode(XSD + draw.choice(("integer", "decimal", "boolean", "double", "string")))
        ),
        ox.Literal(draw.choice((0, -1, 2, 10**15, 1.5, True))),
        ox.NamedNode("urn:fuzz:nowhere"),
        ox.NamedNode(CORE + draw.choice(("true", "false", "Object", "nothing", "Behavior", "World"))),
        ox.NamedNode("https://example.org/µ²/Ünknown-1.2"),
        ox.BlankNode(),
    ]
    triples[place] = ox.Triple(t.subject, t.predicate, draw.choice(ends))


def other_property(draw: random.Random, triples: Triples) -> None:
    """Say a triple by another property."""
    if triples:
        place, by = _any(draw, triples), draw.choice(triples).predicate
        triples[place] = ox.Triple(triples[place].subject, by, triples[place].object)


def axiom(draw: random.Random, triples: Triples) -> None:
    """Add a statement of OWL or of the core between two nodes."""
    if triples:
        said = [OWL + word for word in OWL_WORDS.split()] + [CORE + word for word in CORE_WORDS.split()]
        said += [RDF + "rest", RDF + "first", RDFS + "subClassOf"]
        one, other = draw.choice(triples).subject, draw.choice(triples)
        triples.append(ox.Triple(one, ox.NamedNode(draw.choice(said)), draw.choice((other.subject, other.object))))


def rename(draw: random.Random, triples: Triples) -> None:
    """Give a node another name wherever it is named."""
    named = [t.subject for t in triples if isinstance(t.subject, ox.NamedNode)]
    if named:
        old = draw.choice(named)
        space = re.split(r"(?<=[#/])(?=[^#/]*$)", old.value)[0]
        new = ox.NamedNode(
            space
            + draw.choice(
                ("µCar", "Car²", "a-b", "a.b", "true", "None", "class", "a%20b", "x:y", "_", "1", "Ω…", old.value[-1:])
            )
        )
        triples[:] = [
            ox.Triple(*(new if term == old else term for term in (t.subject, t.predicate, t.object)))  # type: ignore[arg-type]
            for t in triples
        ]


MUTATIONS: tuple[Callable[[random.Random, Triples], None], ...] = (
    delete,
    delete_node,
    double,
    swap,
    retype,
    other_end,
    other_end,
    other_property,
    axiom,
    rename,
)


def mutated_bytes(draw: random.Random, file: Path) -> None:
    """Break a file anywhere: bytes dropped, doubled, changed, cut off."""
    content = bytearray(file.read_bytes())
    for _ in range(draw.choice((1, 1, 2, 5, 20))):
        at = draw.randrange(len(content) + 1)
        end = min(len(content), at + draw.choice((1, 1, 2, 10, 200)))
        match draw.randrange(5):
            case 0:
                del content[at:end]
            case 1:
                content[at:at] = content[at:end]
            case 2:
                content[at:end] = draw.choice(ODD).encode("utf-8", "surrogatepass")
            case 3:
                content[at:at] = bytes([draw.randrange(256)])
            case _ if draw.random() < 0.2:
                del content[at:]
    file.write_bytes(bytes(content))


def mutated_words(draw: random.Random, text: str, more: Sequence[str] = ()) -> str:
    """Break a text in its words and signs: dropped, doubled, swapped, nested, or others in their place."""
    words = re.findall(r"\w+|\s+|[^\w\s]", text)
    for _ in range(draw.choice((1, 1, 2, 3, 6))):
        if not words:
            break
        at, other = draw.randrange(len(words)), draw.randrange(len(words))
        match draw.randrange(7):
            case 0:
                del words[at]
            case 1:
                words.insert(other, words[at])
            case 2:
                words[at], words[other] = words[other], words[at]
            case 3:
                words[at] = draw.choice((*ODD, *more))
            case 4:
                words.insert(at, draw.choice((*ODD, *more)))
            case 5:
                words[at] *= draw.choice((2, 3, 50))
            case _:
                del words[at : at + draw.randrange(1, 8)]
    return "".join(words)


def mutated_json(draw: random.Random, data: Any) -> Any:
    """Break JSON data in its structure."""
    odd: list[Any] = [None, True, 0, -1, 1.5, 10**30, "", "x", [], {}, [[]], {"steps": []}, float("nan"), *ODD[:12]]
    if isinstance(data, dict) and data and draw.random() < 0.85:
        key = draw.choice(sorted(data))
        match draw.randrange(6):
            case 0:
                return {k: v for k, v in data.items() if k != key}
            case 1:
                return {**data, key: draw.choice(odd)}
            case 2:
                return {
                    **data,
                    draw.choice(("steps", "path", "id", "level", "arguments", "bindings", "rank")): draw.choice(odd),
                }
            case _:
                return {**data, key: mutated_json(draw, data[key])}
    if isinstance(data, list) and data and draw.random() < 0.85:
        at = draw.randrange(len(data))
        match draw.randrange(6):
            case 0:
                return data[:at] + data[at + 1 :]
            case 1:
                return [*data, data[at]]
            case 2:
                return [*data[:at], draw.choice(odd), *data[at + 1 :]]
            case 3:
                return data[::-1]
            case _:
                return [*data[:at], mutated_json(draw, data[at]), *data[at + 1 :]]
    return draw.choice(odd)


# ----------------------------------------------------------------------------------------------------------------- doors

Call = list[str]
"""The words of a command line."""


def _domain(draw: random.Random) -> str:
    return draw.choice(DOMAINS)


def _broken(draw: random.Random, folder: Path) -> str:
    """Break the ontology of a domain; return its scene."""
    files = [file for file in sorted(folder.glob("*.ttl")) if file.stem in ("scene", "tearoom")]
    mutated_triples(draw, draw.choice(files))
    return str(folder / "scene.ttl")


def plan(draw: random.Random, folder: Path) -> Call:
    """Plan in a scene whose structure is broken."""
    modes: tuple[Call, ...] = (["--mode", "paper"], ["--optimal"], ["--memory", str(folder / "memory.ttl")], [], [], [])
    return ["plan", _broken(draw, folder), "--time-limit", "5", "--json", *draw.choice(modes)]


def validate(draw: random.Random, folder: Path) -> Call:
    """Validate it."""
    return ["validate", _broken(draw, folder)]


def look(draw: random.Random, folder: Path) -> Call:
    """Ask what its objects afford; draw, export, explain or learn from it."""
    scene, memory = _broken(draw, folder), str(folder / "memory.ttl")
    return draw.choice(
        [
            ["query", scene, "--affords", "all"],
            ["query", scene, "--show", draw.choice(("B1_WASH", "SAIL", "B1_MOVE"))],
            ["picture", scene, "--classes", "-o", str(folder / "out.svg")],
            [
                "picture",
                scene,
                "--behavior",
                draw.choice(("B1_WASH", "SAIL", "B1_MOVE")),
                "-o",
                str(folder / "out.svg"),
            ],
            ["export", scene, "-o", str(folder / "out")],
            ["explain", scene, "--memory", memory],
            ["learn", scene, "--memory", memory],
            ["execute", scene, "--memory", memory, "--learn", "--save", str(folder / "out.ttl")],
            ["plan", scene, "--from-observed", str(folder / "observed.ttl"), "--time-limit", "5"],
            ["plan", scene, "--diff", str(folder / "scene.ttl"), "--mode", "guarded"],
        ]
    )


def files(draw: random.Random, folder: Path) -> Call:
    """Plan in a scene whose bytes are broken, in each of the formats; or with a broken catalog."""
    scene = folder / "scene.ttl"
    catalog = folder / "catalog-v001.xml"
    if catalog.is_file() and draw.random() < 0.2:
        mutated_bytes(draw, catalog)
        return ["plan", str(scene), "--time-limit", "5"]
    kind, form = draw.choice(
        ((".ttl", ox.RdfFormat.TURTLE), (".nt", ox.RdfFormat.N_TRIPLES), (".owl", ox.RdfFormat.RDF_XML))
    )
    triples = [quad.triple for quad in ox.parse(path=str(scene), format=ox.RdfFormat.TURTLE, base_iri="urn:fuzz:base")]
    scene.unlink()
    scene = scene.with_suffix(kind)
    content = ox.serialize(triples, format=form, prefixes={"c": CORE, "owl": OWL}) or b""
    if kind == ".owl" and draw.random() < 0.5:
        entity = draw.choice(("a", "b", "owl"))
        value = draw.choice(("x", "&b;", "http://x.org/", "%p;"))
        doctype = f'<!DOCTYPE rdf:RDF [<!ENTITY {entity} "{value}"> <!ENTITY b "{"y" * 99}">]>'
        content = content.replace(b"<rdf:RDF", doctype.encode() + b"<rdf:RDF", 1).replace(
            b"urn:fuzz", b"&a;", draw.randrange(3)
        )
    scene.write_bytes(content)
    if draw.random() < 0.9:
        mutated_bytes(draw, scene)
    return [draw.choice(("plan", "validate")), str(scene)]


QUERIES = (
    "SELECT ?o ?l WHERE { ?o a owl:NamedIndividual ; rdfs:label ?l } ORDER BY ?o LIMIT 5",
    "SELECT (COUNT(*) AS ?n) WHERE { ?a ?b ?c OPTIONAL { ?c ?d ?e } FILTER(?a != ?c) } GROUP BY ?b",
    "CONSTRUCT { ?s rdfs:label ?l } WHERE { ?s rdfs:label ?l . FILTER(STRLEN(?l) > 3) }",
    "ASK { ?s :goal/:about ?o }",
    "SELECT ?s WHERE { { ?s a :Behavior } UNION { ?s a :Task } MINUS { ?s :cost ?c } VALUES ?s { :x } }",
    "SELECT ?x WHERE { ?x (rdfs:subClassOf|^rdf:first)* ?y . BIND(REPLACE(STR(?x), '(a+)+$', 'b') AS ?z) }",
    "DESCRIBE :Object",
)
TOKENS = [
    "SERVICE",
    "SELECT",
    "{",
    "}",
    "(",
    ")",
    "?x",
    "FILTER",
    "*",
    "GRAPH",
    "<http://127.0.0.1:9/>",
    "EXISTS",
    "UNION",
    "REGEX",
    '"',
]


def sparql(draw: random.Random, folder: Path) -> Call:
    """Ask a broken query."""
    text = draw.choice(QUERIES)
    text = mutated_words(draw, text, TOKENS) if draw.random() < 0.95 else "SELECT * WHERE " + "{" * 2000 + "}" * 2000
    more = (
        ["-o", str(folder / "out.ttl")]
        if draw.random() < 0.2
        else ["--format", draw.choice(("table", "csv", "json", "x"))]
    )
    return ["query", str(folder / "scene.ttl"), text, "--time-limit", "3", "--rows", "1000", *more]


def pddl(draw: random.Random, folder: Path) -> Call:
    """Import broken PDDL."""
    which = draw.choice(("domain", "problem"))
    for name in ("domain", "problem"):
        text = (HERE.parent / "docs" / "examples" / "ferry" / f"{name}.pddl").read_text()
        words = (
            ":typing",
            "(",
            ")",
            "?x",
            "-",
            "either",
            "not",
            "and",
            "or",
            "when",
            "forall",
            "exists",
            "=",
            "increase",
            ":requirements",
        )
        (folder / f"{name}.pddl").write_text(mutated_words(draw, text, words) if name == which else text)
    return ["import", str(folder / "domain.pddl"), str(folder / "problem.pddl"), "-o", str(folder / "out.ttl")]


def plans(draw: random.Random, folder: Path) -> Call:
    """Begin with a broken plan, or learn from it."""
    file, scene = folder / "plan.json", str(folder / "scene.ttl")
    if draw.random() < 0.8:
        data = json.loads(file.read_text())
        for _ in range(draw.choice((1, 1, 2, 4))):
            data = mutated_json(draw, data)
        file.write_text(json.dumps(data))
    else:
        mutated_bytes(draw, file)
    if draw.random() < 0.5:
        return ["execute", scene, "--plan", str(file), "--json"]
    return ["learn", scene, "--plan", str(file), "--memory", str(folder / "memory.ttl")]


def memory(draw: random.Random, folder: Path) -> Call:
    """Use a broken memory, or a good one with a broken one."""
    good, broken, scene = folder / "memory.ttl", folder / "broken.ttl", str(folder / "scene.ttl")
    shutil.copy(good, broken)
    if draw.random() < 0.7:
        mutated_triples(draw, broken)
    else:
        mutated_bytes(draw, broken)
    return draw.choice(
        [
            ["memory", "show", str(broken), "--most", "3"],
            ["memory", "merge", str(good), str(broken), "-o", str(good), *draw.choice(([], ["--trust"]))],
            ["memory", "merge", str(broken), str(good), "-o", str(good)],
            ["memory", "trust", str(broken), draw.choice(("all", "x", *ODD))],
            [
                "memory",
                "migrate",
                str(broken),
                f"{draw.choice(('Cup', 'Plate', 'B1_WASH', 'B1_MOVE', *ODD))}={draw.choice(('Mug', *ODD))}",
            ],
            [
                "plan",
                scene,
                "--memory",
                str(broken),
                "--json",
                "--time-limit",
                "5",
                "--mode",
                draw.choice(("guarded", "leading", "strict", "paper")),
            ],
            ["learn", scene, "--memory", str(broken)],
            ["explain", scene, "--memory", str(broken)],
            ["execute", scene, "--memory", str(broken), "--learn"],
        ]
    )


FACTS = (
    *(
        "plate1 PLACE shelf",
        "plate2 CLEANLINESS dirty",
        "cup1 LOCATION location3",
        "red AT south",
        "goal plate1 PLACE sink",
    ),
    *(
        "drop-goal plate1 CLEANLINESS",
        "remove plate2",
        "add Plate plate9 PLACE sink CLEANLINESS dirty",
        "remove plate1",
    ),
    "add Cup cup9 LOCATION location1",
)


def interventions(draw: random.Random, folder: Path) -> Call:
    """Interfere in words that are broken."""
    call = ["execute", str(folder / "scene.ttl"), "--json"]
    for _ in range(draw.choice((1, 2, 4))):
        when = draw.choice(("after=1", "after=0", "at=0", "at=1.5", "after=0.0", "after=99"))
        text = f"{when} {draw.choice(FACTS)}"
        call += ["--intervene", mutated_words(draw, text) if draw.random() < 0.6 else text]
    return _without_zeros(call)


def options(draw: random.Random, folder: Path) -> Call:
    """Ask in words that mean nothing."""
    scene, out = str(folder / "scene.ttl"), str(folder / "out")
    calls = (
        ["plan", scene, "--goal", mutated_words(draw, draw.choice(FACTS)), "--time-limit", "5"],
        [
            "plan",
            scene,
            "--goal",
            draw.choice(FACTS),
            "--mode",
            draw.choice(("guarded", "paper", "strict")),
            "--time-limit",
            "5",
        ],
        ["plan", draw.choice(ODD), "--mode", draw.choice(ODD), "--time-limit", draw.choice(ODD)],
        [
            "plan",
            scene,
            draw.choice(("--mode", "--time-limit", "--memory", "--goal", "--diff", "--from-observed", "--scene")),
            draw.choice(ODD),
        ],
        [
            "query",
            scene,
            draw.choice(("--show", "--affords", "--format", "--rows", "--time-limit", "-o")),
            draw.choice(ODD),
        ],
        [
            "generate",
            draw.choice(("served", "swap", "full", "handover", *ODD)),
            "-o",
            out + draw.choice((".ttl", *ODD[:20])),
            "--objects",
            draw.choice(("0", "1", "3", "5", *ODD)),
            "--hands",
            draw.choice(("0", "1", "2", *ODD)),
        ],
        [
            "picture",
            scene,
            "-o",
            out + draw.choice((".svg", ".png", *ODD)),
            "--behavior",
            draw.choice(("B1_WASH", *ODD)),
        ],
        [
            "explain",
            scene,
            "--memory",
            str(folder / "memory.ttl"),
            draw.choice(("--step", "--level", "--against", "--plot")),
            draw.choice(ODD),
        ],
        ["export", scene, "-o", out, "--level", draw.choice(ODD)],
        ["import", scene, scene, "-o", out + ".ttl", "--level", draw.choice(ODD)],
        ["new", draw.choice(ODD), "--folder", out],
        ["memory", "show", str(folder / "memory.ttl"), "--most", draw.choice(ODD)],
        [
            "execute",
            scene,
            draw.choice(("--world", "--plan", "--mode", "--seed", "--save", "--intervene")),
            draw.choice(ODD),
        ],
        [draw.choice(("plan", "query", "learn", "memory", *ODD)), draw.choice(ODD), draw.choice(ODD)],
        ["fetch", draw.choice(("http://[bad", "http://127.0.0.1:9/x", *ODD)), "--into", out],
        ["plan", draw.choice(("http://[bad", "http://127.0.0.1:9/query", "http://x y/", "https://"))],
    )
    return _without_zeros(list(draw.choice(calls)))


def observed(draw: random.Random, folder: Path) -> Call:
    """Start from what was seen, in a broken file."""
    draw.choice((mutated_triples, mutated_triples, mutated_bytes))(draw, folder / "observed.ttl")
    return [
        "plan",
        str(folder / "scene.ttl"),
        "--from-observed",
        str(folder / "observed.ttl"),
        "--json",
        "--time-limit",
        "5",
    ]


def bodies(draw: random.Random, folder: Path) -> Call:
    """Validate broken measures of bodies, robots, shapes and skills."""
    from confab.authoring import new_domain

    files = new_domain("pouring", folder / "bodies", bodies=True)
    scene = next(file for file in files if file.stem.endswith("-scene"))
    mutated_triples(draw, draw.choice([file for file in files if file.suffix == ".ttl"]))
    return ["validate", str(scene)]


def _without_zeros(call: Call) -> Call:
    """No process can be given a zero byte."""
    return [word.replace("\0", "0") for word in call]


DOORS: dict[str, Callable[[random.Random, Path], Call]] = {
    door.__name__: door
    for door in (plan, validate, look, files, sparql, pddl, plans, memory, interventions, options, observed, bodies)
}
TARGETS = {"memory.ttl", "broken.ttl", "out", "out.ttl", "out.svg"}
"""What a case may write."""


# ----------------------------------------------------------------------------------------------------------- one case


def run_case(door: str, seed: int, given: Path, keep: bool = False) -> Failure | None:
    """Run a case in a process of its own; return what broke."""
    folder = Path(tempfile.mkdtemp(prefix="confab-fuzz-"))
    try:
        draw = random.Random(f"{door} {seed}")
        case = folder / "case"
        shutil.copytree(given / _domain(draw), case)
        call = DOORS[door](draw, case)
        before = _contents(case)
        what = _judged(folder, case, call, before)
        if keep:
            print(f"{door}:{seed}", *map(repr, call), f"\n{what or 'holds'}", sep=" ")
        return Failure(door, seed, what) if what else None
    finally:
        if keep:
            print("files:", folder)
        else:
            shutil.rmtree(folder, ignore_errors=True)


def _judged(folder: Path, case: Path, call: Call, before: dict[str, bytes]) -> str:
    """Run a command and return what is wrong with how it ended; nothing if all is well."""
    out, err = folder / "stdout", folder / "stderr"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Python warns of forking beside threads
        child = os.fork()
    if child == 0:
        _answer(call, case, out, err)
    _, state = os.waitpid(child, 0)
    said, printed = (path.read_text(errors="replace") if path.is_file() else "" for path in (err, out))
    if os.WIFSIGNALED(state):
        sign = os.WTERMSIG(state)
        return f"no end within {SECONDS} s" if sign == signal.SIGALRM else f"killed by signal {sign}: {said[-200:]}"
    code = os.WEXITSTATUS(state)
    if code not in (0, 1, 2, 3):
        return f"exit {code}: {said}"
    if "Traceback" in said + printed:
        return f"a traceback: {said[-300:]}"
    told = [line for line in said.splitlines() if line.startswith("confab: ")]
    if code == 2 and (printed or not told):
        return f"exit 2 with {len(told)} lines and with output: {printed[:100]}"
    after = _contents(case)
    changed = sorted(name for name in {*before, *after} if before.get(name) != after.get(name))
    if bad := [name for name in changed if name.split("/")[0] not in {*TARGETS, *call} and not name.startswith("out")]:
        return f"files changed: {', '.join(bad)}"
    if code == 2 and changed and call[0] != "learn":
        return f"exit 2, but {', '.join(changed)} changed"
    return ""


def _contents(case: Path) -> dict[str, bytes]:
    return {str(file.relative_to(case)): file.read_bytes() for file in sorted(case.rglob("*")) if file.is_file()}


def _answer(call: Call, case: Path, out: Path, err: Path) -> None:
    """In the child: answer a command and never come back."""
    code = 99
    try:
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.alarm(SECONDS)
        resource.setrlimit(resource.RLIMIT_AS, (MEGABYTES << 20, MEGABYTES << 20))
        os.chdir(case)
        from confab.cli import main

        with out.open("w") as stdout, err.open("w") as stderr, redirect_stdout(stdout), redirect_stderr(stderr):
            try:
                main(call)
            except SystemExit as end:
                code = int(end.code or 0)
            if code == 0:
                _check_answer(call, case, out)
    except BaseException:
        import traceback

        with err.open("a") as file:
            traceback.print_exc(file=file)
        code = 98
    os._exit(code)


def _check_answer(call: Call, case: Path, out: Path) -> None:
    """Raise AssertionError if what was answered is wrong: a plan that is none, a file that can't be read."""
    from confab.memory import Memory

    memory = case / "memory.ttl"
    if (
        call[0] in ("learn", "memory", "execute")
        and str(memory) in call
        and call[1] not in ("show", "migrate", "trust")
    ):
        with redirect_stdout(io.StringIO()):
            Memory.load(memory)
    if call[0] == "plan" and "--json" in call and "--from-observed" not in call:
        _check_plan(call, case)
    for file in case.glob("out.ttl"):
        list(ox.parse(path=str(file), format=ox.RdfFormat.TURTLE, base_iri="urn:fuzz:base"))


def _check_plan(call: Call, case: Path) -> None:
    import confab
    from planner.validation import validate as validate_plan
    from reasoner.reading.problem import with_goals

    mode = call[call.index("--mode") + 1] if "--mode" in call else "guarded"
    scene = confab.load(Path(call[1]))
    result = scene.plan(mode=mode, time_limit=5.0)
    if not result.solved:
        return
    faults = validate_plan(result.problem, result.plan)
    assert not faults, f"no plan of what was read: {faults[0]}"
    whole: list[Any] = []
    with suppress(KnowledgeError):  # what the task doesn't need may be broken
        whole = [
            fault for fault in validate_plan(with_goals(scene.reading, ()), result.plan) if "its ID" not in str(fault)
        ]
    assert not whole, f"no plan of the whole scene: {whole[0]}"


# ------------------------------------------------------------------------------------------------------------- many


def _import_all() -> None:
    """Import what the cases need, once for all of them."""
    rooms = (
        *(
            "confab." + name
            for name in [
                "cli",
                "execution",
                "explaining",
                "picturing",
                "pddl_commands",
                "authoring",
                "reaching",
                "show",
                "live",
            ]
        ),
        *(
            "planner." + name
            for name in ["acting.executive", "experience.portfolio", "hierarchical.bounds", "paper.hierarchy"]
        ),
        *("reasoner." + name for name in ["validation.validate", "graph.apart", "reading.affordance"]),
    )
    for name in (*rooms, "matplotlib.figure", "pyshacl"):
        import_module(name)
    gc.freeze()


def known() -> Iterator[tuple[str, int]]:
    """Yield the cases that broke once."""
    for line in SEEDS.read_text(encoding="utf-8").splitlines() if SEEDS.is_file() else ():
        if match := re.match(r"(\w+):(\d+)", line):
            yield match[1], int(match[2])


def fuzz(
    cases: int, doors: Sequence[str], first: dict[str, int], tell: bool = True
) -> tuple[Counter[str], list[Failure]]:
    """Run so many cases, door by door in turn; return how many were tried at each, and what broke."""
    tried: Counter[str] = Counter()
    broke: list[Failure] = []
    with tempfile.TemporaryDirectory() as folder:
        given = Path(folder)
        sources(given)
        _import_all()
        begin = time.monotonic()
        for number in range(cases):
            door = doors[number % len(doors)]
            failure = run_case(door, first.get(door, 0) + tried[door], given)
            tried[door] += 1
            if failure is not None:
                broke.append(failure)
                if tell:
                    print(failure, flush=True)
            if tell and number % 1000 == 999:
                print(
                    f"{number + 1:,} cases in {time.monotonic() - begin:.0f} s, {len(broke)} broke",
                    file=sys.stderr,
                    flush=True,
                )
    return tried, broke


def main() -> int:
    """Run the cases that were asked for; return 1 if one broke."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=100_000)
    parser.add_argument("--door", choices=DOORS, action="append")
    parser.add_argument("--again", metavar="DOOR:NUMBER")
    asked = parser.parse_args()
    if asked.again:
        door, _, number = asked.again.partition(":")
        with tempfile.TemporaryDirectory() as folder:
            sources(Path(folder))
            return int(run_case(door, int(number), Path(folder), keep=True) is not None)
    first: dict[str, int] = {}
    with suppress(OSError, ValueError):
        first = json.loads(PROGRESS.read_text())
    tried, broke = fuzz(asked.cases, asked.door or tuple(DOORS), first)
    PROGRESS.parent.mkdir(exist_ok=True)
    PROGRESS.write_text(json.dumps({door: first.get(door, 0) + tried[door] for door in DOORS}))
    failed = Counter(failure.door for failure in broke)
    for door in tried:
        print(f"{door:<14} {tried[door]:>7,} tried {failed[door]:>5} broke")
    with SEEDS.open("a", encoding="utf-8") as file:
        file.writelines(f"{failure}\n" for failure in broke)
    return int(bool(broke))


if __name__ == "__main__":
    sys.exit(main())

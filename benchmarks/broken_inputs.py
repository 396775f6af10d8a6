"""Valid inputs of the command line, and random mutations that break their structure or their bytes.

A *door* is a kind of input with a function that breaks a file in a folder and returns the command that reads the file.
"""

from __future__ import annotations

import json
import random
import re
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pyoxigraph as ox

from confab.reasoner.vocabulary import CORE, OWL, RDF, RDFS, XSD

HERE = Path(__file__).resolve().parent
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

# ---------------------------------------------------------------------------------------------------------------- inputs


def sources(folder: Path) -> None:
    """Write the valid inputs: three small domains, each with a scene, a memory, a plan and observed facts."""
    import confab
    from confab.authoring import new_domain
    from confab.memory import Memory
    from confab.pddl_commands import import_pddl
    from confab.reasoner.generate import write_scene
    from confab.reasoner.memory.links import Links
    from confab.reasoner.reading.observed import save_observed

    new_domain("tearoom", folder / "tearoom")
    (folder / "tearoom" / "tearoom-scene.ttl").rename(folder / "tearoom" / "scene.ttl")
    catalog = folder / "tearoom" / "catalog-v001.xml"
    catalog.write_text(catalog.read_text().replace("tearoom-scene.ttl", "scene.ttl"))
    for domain in ("ferry", "served"):
        (folder / domain).mkdir()
    ferry = HERE.parent / "docs" / "examples" / "ferry"
    import_pddl(ferry / "domain.pddl", ferry / "problem.pddl", folder / "ferry" / "scene.ttl")
    write_scene(folder / "served" / "scene.ttl", "served", 2, 1, 0, 0)
    for domain in DOMAINS:
        scene = confab.load(folder / domain / "scene.ttl")
        result, memory = scene.plan(), Memory.of(scene)
        result.save(folder / domain / "plan.json")
        memory.experience.replica = "fuzz"  # the same name in every run
        memory.teach(scene, result.plan)
        links = list(memory.links.tables.items())[:3]
        memory.links = Links({conclusion: dict(list(table.items())[:3]) for conclusion, table in links})
        memory.save(folder / domain / "memory.ttl")
        save_observed(folder / domain / "observed.ttl", scene.problem.initial, scene.names, scene.iri)


def mutated_triples(draw: random.Random, file: Path, mutations: Sequence[Mutation] | None = None) -> None:
    """Break the structure of an ontology file by random mutations of its triples."""
    parser = ox.parse(path=str(file), format=ox.RdfFormat.TURTLE, base_iri="urn:fuzz:base")
    triples = [quad.triple for quad in parser]
    for _ in range(draw.choice((1, 1, 1, 2, 3, 5))):
        draw.choice(mutations or MUTATIONS)(draw, triples)
    prefixes = {k: v for k, v in parser.prefixes.items() if k}
    file.write_bytes(ox.serialize(triples, format=ox.RdfFormat.TURTLE, prefixes=prefixes) or b"")


Triples = list[ox.Triple]
Mutation = Callable[[random.Random, Triples], None]


def _any(draw: random.Random, triples: Triples) -> int:
    """Return the index of a random triple, preferably of a triple with a property of the core ontology."""
    places = [i for i, t in enumerate(triples) if t.predicate.value.startswith(CORE) or draw.random() < 0.4]
    return draw.choice(places or range(len(triples)))


def delete(draw: random.Random, triples: Triples) -> None:
    """Delete a triple."""
    if triples:
        del triples[_any(draw, triples)]


def delete_node(draw: random.Random, triples: Triples) -> None:
    """Delete all triples of a node."""
    if triples:
        node = triples[_any(draw, triples)].subject
        triples[:] = [t for t in triples if t.subject != node]


def double(draw: random.Random, triples: Triples) -> None:
    """Copy all triples of a node to a new node, and perhaps the references to the node."""
    if triples:
        node = triples[_any(draw, triples)].subject
        twin = ox.NamedNode(getattr(node, "value", "x") + "Twin") if isinstance(node, ox.NamedNode) else ox.BlankNode()
        triples += [ox.Triple(twin, t.predicate, t.object) for t in triples if t.subject == node]
        if draw.random() < 0.7:
            triples += [ox.Triple(t.subject, t.predicate, twin) for t in triples if t.object == node]


def swap(draw: random.Random, triples: Triples) -> None:
    """Exchange the objects of two triples."""
    if triples:
        one, other = _any(draw, triples), _any(draw, triples)
        a, b = triples[one], triples[other]
        triples[one] = ox.Triple(a.subject, a.predicate, b.object)
        triples[other] = ox.Triple(b.subject, b.predicate, a.object)


def retype(draw: random.Random, triples: Triples) -> None:
    """Give a node the type of another node."""
    types = [i for i, t in enumerate(triples) if t.predicate == TYPE]
    if types:
        place = draw.choice(types)
        triples[place] = ox.Triple(triples[place].subject, TYPE, triples[draw.choice(types)].object)


def other_end(draw: random.Random, triples: Triples) -> None:
    """Replace the object of a triple by another node, the triple's subject, a text, a number or a blank node."""
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
    """Replace the property of a triple."""
    if triples:
        place, by = _any(draw, triples), draw.choice(triples).predicate
        triples[place] = ox.Triple(triples[place].subject, by, triples[place].object)


def axiom(draw: random.Random, triples: Triples) -> None:
    """Add a triple with a property of OWL or of the core ontology between two nodes."""
    if triples:
        said = [OWL + word for word in OWL_WORDS.split()] + [CORE + word for word in CORE_WORDS.split()]
        said += [RDF + "rest", RDF + "first", RDFS + "subClassOf"]
        one, other = draw.choice(triples).subject, draw.choice(triples)
        triples.append(ox.Triple(one, ox.NamedNode(draw.choice(said)), draw.choice((other.subject, other.object))))


def rename(draw: random.Random, triples: Triples) -> None:
    """Rename a node in all triples."""
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


MUTATIONS: tuple[Mutation, ...] = (
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
    """Delete, copy, change or cut off bytes of a file."""
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
    """Delete, copy, exchange, nest or replace words and signs of a text."""
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
    """Break the structure of JSON data."""
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

Arguments = list[str]
"""The words of a command line."""


def _domain(draw: random.Random) -> str:
    return draw.choice(DOMAINS)


def _broken(draw: random.Random, folder: Path) -> str:
    """Break an ontology file of a domain; return the path of the scene."""
    files = [file for file in sorted(folder.glob("*.ttl")) if file.stem in ("scene", "tearoom")]
    mutated_triples(draw, draw.choice(files))
    return str(folder / "scene.ttl")


def plan(draw: random.Random, folder: Path) -> Arguments:
    """Plan with a scene whose structure is broken."""
    modes: tuple[Arguments, ...] = (
        ["--mode", "paper"],
        ["--optimal"],
        ["--memory", str(folder / "memory.ttl")],
        [],
        [],
        [],
    )
    return ["plan", _broken(draw, folder), "--time-limit", "5", "--json", *draw.choice(modes)]


def validate(draw: random.Random, folder: Path) -> Arguments:
    """Validate a scene whose structure is broken."""
    return ["validate", _broken(draw, folder)]


def look(draw: random.Random, folder: Path) -> Arguments:
    """Query, draw, export, explain, learn or execute with a scene whose structure is broken."""
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


def files(draw: random.Random, folder: Path) -> Arguments:
    """Plan with a scene whose bytes are broken, in each file format, or with a broken catalog."""
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


def sparql(draw: random.Random, folder: Path) -> Arguments:
    """Send a broken SPARQL query."""
    text = draw.choice(QUERIES)
    text = mutated_words(draw, text, TOKENS) if draw.random() < 0.95 else "SELECT * WHERE " + "{" * 2000 + "}" * 2000
    more = (
        ["-o", str(folder / "out.ttl")]
        if draw.random() < 0.2
        else ["--format", draw.choice(("table", "csv", "json", "x"))]
    )
    return ["query", str(folder / "scene.ttl"), text, "--time-limit", "3", "--rows", "1000", *more]


def pddl(draw: random.Random, folder: Path) -> Arguments:
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


def plans(draw: random.Random, folder: Path) -> Arguments:
    """Start from a broken plan, or learn from a broken plan."""
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


def memory(draw: random.Random, folder: Path) -> Arguments:
    """Use a broken memory, or merge a valid memory with a broken memory."""
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


def interventions(draw: random.Random, folder: Path) -> Arguments:
    """Execute with broken interventions."""
    call = ["execute", str(folder / "scene.ttl"), "--json"]
    for _ in range(draw.choice((1, 2, 4))):
        when = draw.choice(("after=1", "after=0", "at=0", "at=1.5", "after=0.0", "after=99"))
        text = f"{when} {draw.choice(FACTS)}"
        call += ["--intervene", mutated_words(draw, text) if draw.random() < 0.6 else text]
    return _without_zeros(call)


def options(draw: random.Random, folder: Path) -> Arguments:
    """Call commands with meaningless option values."""
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


def observed(draw: random.Random, folder: Path) -> Arguments:
    """Plan from a broken file of observed facts."""
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


def bodies(draw: random.Random, folder: Path) -> Arguments:
    """Validate a domain with broken bodies, robots, shapes and skills."""
    from confab.authoring import new_domain

    files = new_domain("pouring", folder / "bodies", bodies=True)
    scene = next(file for file in files if file.stem.endswith("-scene"))
    mutated_triples(draw, draw.choice([file for file in files if file.suffix == ".ttl"]))
    return ["validate", str(scene)]


def catalogs(draw: random.Random, folder: Path) -> Arguments:
    """Plan or validate with imports that a broken catalog resolves."""
    catalog = folder / "catalog-v001.xml"
    if not catalog.is_file():
        scene = "urn:fuzz:scene"
        catalog.write_text(
            '<?xml version="1.0"?>\n<catalog xmlns="urn:oasis:names:tc:entity:xmlns:xml:catalog">\n'
            f'  <uri name="{scene}" uri="scene.ttl"/>\n  <nextCatalog catalog="catalog-v001.xml"/>\n</catalog>\n'
        )
    if draw.random() < 0.5:
        words = (
            "uri",
            "name",
            "<",
            "/>",
            "&a;",
            "nextCatalog",
            "rewriteURI",
            '"',
            "file:///dev/zero",
            "http://[bad",
            ".",
        )
        catalog.write_text(mutated_words(draw, catalog.read_text(), words), errors="replace")
    else:
        mutated_bytes(draw, catalog)
    return [draw.choice(("plan", "validate")), str(folder / "scene.ttl")]


def urdf(draw: random.Random, folder: Path) -> Arguments:
    """Compute the reach of a robot with a broken URDF file."""
    from confab.authoring import new_domain

    bodies = folder / "bodies"
    new_domain("pouring", bodies, bodies=True)
    robots = HERE.parent / "ontology" / "robots"
    robot = (robots / "two-arms.ttl").read_text().replace("robots/two-arms.urdf", "broken.urdf")
    (bodies / "two-arms.ttl").write_text(robot)
    catalog = bodies / "catalog-v001.xml"
    catalog.write_text(re.sub(r"file://[^\"]*/two-arms\.ttl", "two-arms.ttl", catalog.read_text()))
    file = bodies / "broken.urdf"
    shutil.copy(robots / "two-arms.urdf", file)
    if draw.random() < 0.8:
        words = (
            "link",
            "joint",
            "parent",
            "child",
            "origin",
            "xyz",
            "rpy",
            "axis",
            "limit",
            "<",
            "/>",
            '"',
            "&a;",
            "0 0",
            "1e400",
        )
        names = re.findall(r'(?:name|link)="(\w+)"', file.read_text())
        file.write_text(mutated_words(draw, file.read_text(), (*words, *names)), errors="replace")
    else:
        mutated_bytes(draw, file)
    return ["plan", str(bodies / "pouring-scene.ttl"), "--time-limit", "20"]


def _without_zeros(call: Arguments) -> Arguments:
    """Replace zero bytes, which the arguments of a process can't contain."""
    return [word.replace("\0", "0") for word in call]


DOORS: dict[str, tuple[Callable[[random.Random, Path], Arguments], int]] = {
    door.__name__: (door, share)
    for door, share in (
        (plan, 185),
        (validate, 20),
        (look, 130),
        (files, 120),
        (catalogs, 40),
        (sparql, 80),
        (pddl, 150),
        (plans, 60),
        (memory, 80),
        (interventions, 90),
        (options, 90),
        (observed, 80),
        (bodies, 5),
        (urdf, 5),
    )
}
"""The doors (kinds of input) with their functions, and their relative numbers of cases; slow doors have fewer cases."""
TARGETS = {"memory.ttl", "broken.ttl", "out", "out.ttl", "out.svg"}
"""Names of the files that a command may change."""

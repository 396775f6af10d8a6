"""Experience on disk and in stores: counters as annotated axioms, in Turtle that Protégé opens.

Each counter is an individual per replica, epoch, behaviour and classes of its roles, `:associatedWith` the patterns that it
counted; an ``owl:Axiom`` on each of these links has `:chosen`, `:passedOver`, `:failed` and the `:probability` that they amount to.
Writers never share a counter, patterns are named by their content: the union of two files is a file of both memories. A pattern
leads to its lifted facts, each an individual with what it asks, the answer, and its place among the others.

A file is written one link a line, and such lines are read by a regular expression; in any other layout (Protégé's, say) the
triples themselves are read.
"""

from __future__ import annotations

import hashlib
import re
import uuid
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import astuple, dataclass, field
from pathlib import Path
from urllib.error import URLError
from urllib.parse import quote, unquote, urlencode
from urllib.request import Request, urlopen

import pyoxigraph as ox

from reasoner.files import write_whole
from reasoner.graph.knowledge import KnowledgeError
from reasoner.memory.counts import Conclusion, Experience, Pattern, Tally
from reasoner.names import Names
from reasoner.vocabulary import ARGUMENTS, CORE, MEMORY, OWL, RDFS

FORMAT, OLDER = 3, 2
"""In an older file a pattern has all its facts in one text."""
TALLY = ("chosen", "passedOver", "failed")
BETWEEN = " | "  # facts of a pattern in an older file
SHOWN = 3  # facts of a pattern that its label names
PRIOR = 1.0  # pseudo-counts, half a choice and half a pass, behind every probability

HEAD = """@prefix : <{core}> .
@prefix owl: <{owl}> .
@prefix rdfs: <{rdfs}> .
@prefix m: <{space}> .

{iri} a owl:Ontology ; owl:imports {domain} ; :memoryFormat {format} ; :learnsAs {replica} .
"""
LINK = (
    "m:{counter} :associatedWith m:{pattern} . [] a owl:Axiom ; owl:annotatedSource m:{counter} ; "
    "owl:annotatedProperty :associatedWith ; owl:annotatedTarget m:{pattern} ; "
    ":chosen {t.chosen} ; :passedOver {t.passed_over} ; :failed {t.failed} ; :probability {p:.4f} .\n"
)
MOST = 2**53  # so far counts are exact as floating-point numbers
COUNTS = re.compile(
    r"^m:(?:(pattern_\w+) a owl:NamedIndividual, :Pattern ; "
    r"(?:rdfs:label \"[^\"\\\n]*\" ; :fact (m:[^\n;]*)|:facts \"([^\"\\\n]*)\") \.\n|"
    r"(\S+) :associatedWith m:(\S+) \. \[\] a owl:Axiom ; owl:annotatedSource m:\4 ; "
    r"owl:annotatedProperty :associatedWith ; owl:annotatedTarget m:\5 ; "
    r":chosen (\d+) ; :passedOver (\d+) ; :failed (\d+) ; :probability [\d.]+ \.\n)",
    re.MULTILINE,
)
"""Most of a file are such lines: facts of a pattern, or counts of a link. The rest, in any layout, is left to the Turtle parser."""


@dataclass(frozen=True)
class Lines:
    """A memory file taken apart: the links with their counts, the facts of patterns, and the rest as Turtle.

    `facts` are a pattern's facts as the file names them (``m:fact_…``), `texts` what older files say of a pattern.
    """

    links: list[tuple[str, str, Tally]] = field(default_factory=list)
    facts: dict[str, list[str]] = field(default_factory=dict)
    texts: dict[str, str] = field(default_factory=dict)
    rest: str = ""


def lines(text: str) -> Lines:
    """Take a memory file apart."""
    links, facts, texts, rest, at = [], {}, {}, [], 0
    for match in COUNTS.finditer(text):
        if match.start() > at:
            rest.append(text[at : match.start()])
        at = match.end()
        pattern, parts, said, counter, about, *counts = match.groups()
        if parts is not None:
            facts[MEMORY + pattern] = parts.split(", ")
        elif pattern is not None:
            texts[MEMORY + pattern] = said
        else:
            links.append((counter, about, Tally(*map(int, counts))))
    return Lines(links, facts, texts, "".join([*rest, text[at:]]))


def new_replica() -> str:
    """Return an ID for a new memory, which no other has."""
    return str(uuid.uuid4())


def probability(tally: Tally) -> float:
    """Return how probable it is that such a candidate is chosen and works, with half a choice and half a pass as prior.

    >>> probability(Tally(chosen=3, passed_over=0))
    0.875
    """
    total = tally.chosen + tally.passed_over + tally.failed
    return (tally.chosen + PRIOR / 2) / (total + PRIOR)


# ------------------------------------------------------------------------------------------------------------- writing


def save(path: Path, experience: Experience, names: Names, domain: str) -> None:
    """Write a memory file, whole or not at all.

    Parameters
    ----------
    path : Path
    experience : Experience
    names : Names
        Lead the behaviours' and classes' names back to IRIs.
    domain : str
        IRI of the ontology that the file imports, for Protégé.
    """
    write_whole(path, turtle(experience, names, domain))


def turtle(experience: Experience, names: Names, domain: str, only: str | None = None) -> Iterator[str]:
    """Yield a memory as Turtle, counter by counter; `only` those of one replica."""
    iri = _node("urn:uuid:", experience.replica)
    prefixes = {"core": CORE, "owl": OWL, "rdfs": RDFS, "space": MEMORY}
    replica = _text(experience.replica)
    yield HEAD.format(**prefixes, iri=iri, domain=ox.NamedNode(domain), format=FORMAT, replica=replica)
    for replica in sorted(experience.trusts) if only is None else ():
        yield f"{iri} :trusts {_text(replica)} .\n"
    for replica, episodes in sorted(experience.episodes.items()):
        if only in (None, replica):
            node = _node(MEMORY, "replica_" + replica)
            yield f"{node} a owl:NamedIndividual, :Replica ; :replica {_text(replica)} ; :episodes {episodes} .\n"
    written: set[Pattern] = set()
    ids: dict[Pattern, str] = {}
    lifted: dict[tuple[int, str, str], str] = {}
    for (replica, epoch), tallies in sorted(experience.counts.items()):
        if only not in (None, replica):
            continue
        for conclusion, patterns in sorted(tallies.items()):
            counter = _counter(replica, epoch, conclusion)
            roles = " ; ".join(
                f":{role} {_term(kind, names)}" for role, kind in zip(ARGUMENTS, conclusion.classes, strict=False)
            )
            yield (
                f"m:{counter} a owl:NamedIndividual, :Counter ; :replica {_text(replica)} ; :epoch {epoch} ; "
                f":behavior {_term(conclusion.behavior, names)}{' ; ' + roles if roles else ''} ; "
                f"rdfs:label {_text(str(conclusion))} .\n"
            )
            for pattern, tally in sorted(patterns.items()):
                name = ids.get(pattern) or ids.setdefault(pattern, _pattern(pattern))
                if pattern not in written:
                    written.add(pattern)
                    for place, (fact, value) in enumerate(pattern):
                        if (place, fact, value) not in lifted:
                            lifted[place, fact, value] = _lifted(place, fact, value)
                            yield (
                                f"m:{lifted[place, fact, value]} a owl:NamedIndividual, :LiftedFact ; :index {place} ; "
                                f":asks {_text(fact)} ; :answer {_text(value)} ; rdfs:label {_text(f'{fact}: {value}')} .\n"
                            )
                    parts = ", ".join(f"m:{lifted[place, fact, value]}" for place, (fact, value) in enumerate(pattern))
                    facts = f" ; :fact {parts}" if parts else ""
                    yield f"m:{name} a owl:NamedIndividual, :Pattern ; rdfs:label {_text(_label(pattern))}{facts} .\n"
                yield LINK.format(counter=counter, pattern=name, t=tally, p=probability(tally))


def _counter(replica: str, epoch: int, conclusion: Conclusion) -> str:
    """Return a counter's name, which says what it counts and is nobody else's."""
    words = ".".join((conclusion.behavior, *conclusion.classes))
    digest = hashlib.sha1(f"{words} {replica}".encode(), usedforsecurity=False).hexdigest()[:16]
    return f"{re.sub(r'[^A-Za-z0-9_]', '_', words)}_{epoch}_{digest}"


def _lifted(place: int, fact: str, value: str) -> str:
    """Return the name of a lifted fact, which says what it is and is no other's."""
    digest = hashlib.sha1(f"{place}|{fact}|{value}".encode(), usedforsecurity=False).hexdigest()[:14]
    return f"fact_{digest}"


def _label(pattern: Pattern) -> str:
    said = ", ".join(f"{fact}: {value}" for fact, value in pattern[:SHOWN])
    return said + (f" and {len(pattern) - SHOWN} more" if len(pattern) > SHOWN else "")


def _pattern(pattern: Pattern) -> str:
    return "pattern_" + hashlib.sha1(repr(pattern).encode(), usedforsecurity=False).hexdigest()[:20]


def _term(name: str, names: Names) -> str:
    """Return a behaviour or class as an IRI; what the scene doesn't know is kept under its name."""
    return str(ox.NamedNode(names.iri(name))) if name in names else _node(MEMORY, name)


def _node(space: str, name: str) -> str:
    """Return the IRI of any name in a namespace, as Turtle and SPARQL write it."""
    return str(ox.NamedNode(space + quote(name, safe="")))


def _text(text: str) -> str:
    return str(ox.Literal(text))


# ------------------------------------------------------------------------------------------------------------- reading


def load(path: Path, names: Names | None = None) -> Experience:
    """Read a memory file.

    Raises
    ------
    KnowledgeError
        The file is missing, broken, of a newer format or no memory of this kind; the message says which, and what to do.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise KnowledgeError(f"{path}: no such memory file; 'confab learn' makes one") from None
    except (OSError, UnicodeDecodeError) as error:
        raise KnowledgeError(f"{path}: no memory: it can't be read as text ({error})") from error
    return parse(lines(text), str(path), names)


def parse(found: Lines, source: str, names: Names | None = None) -> Experience:
    """Read a memory; `source` names it in messages."""
    try:
        triples = [q.triple for q in ox.parse(found.rest, format=ox.RdfFormat.TURTLE, base_iri=MEMORY)]
    except SyntaxError as error:
        raise KnowledgeError(f"{source}: broken memory: {error}; plan with --no-memory, or restore a copy") from error
    return _experience(triples, found, source, names)


class Pairs(dict[str, tuple[str, str]]):
    """Facts with their values, by the text of both; each is taken apart once."""

    def __init__(self) -> None:
        self.doubtful: set[str] = set()

    def __missing__(self, part: str) -> tuple[str, str]:
        """Take a text apart, and note whether that can be done in several ways."""
        fact, _, value = part.rpartition(": ")
        if part.count(": ") != 1:
            self.doubtful.add(part)
        self[part] = fact, value
        return fact, value


def _experience(triples: Iterable[ox.Triple], found: Lines, source: str, names: Names | None) -> Experience:
    links, facts, texts = list(found.links), dict(found.facts), dict(found.texts)
    nodes: dict[str, dict[str, str]] = {}
    trusts: dict[str, set[str]] = {}
    lifted: dict[str, set[str]] = {}
    for triple in triples:
        predicate = triple.predicate.value.removeprefix(CORE)
        if predicate == "trusts":
            trusts.setdefault(_id(triple.subject), set()).add(_id(triple.object))
        if predicate == "fact":
            lifted.setdefault(_id(triple.subject), set()).add(_id(triple.object))
        nodes.setdefault(_id(triple.subject), {})[predicate] = _id(triple.object)
    iri, head = next(((iri, node) for iri, node in nodes.items() if "memoryFormat" in node), ("", None))
    if head is None:
        raise KnowledgeError(
            f"{source}: no memory of counts: it says no :memoryFormat; a memory of the paper's mode has none"
        )
    if head["memoryFormat"] not in (str(FORMAT), str(OLDER)):
        raise KnowledgeError(
            f"{source}: memory of format {head['memoryFormat']}, wanted {FORMAT}: this version doesn't read it; "
            "learn anew, or use the version of Confab that wrote it"
        )
    if "learnsAs" not in head:
        raise KnowledgeError(f"{source}: broken memory: it doesn't say who learns into it (:learnsAs); restore a copy")
    experience = Experience(head["learnsAs"], trusts=trusts.get(iri, set()))
    try:
        for node in nodes.values():
            if "episodes" in node:
                experience.episodes[node["replica"]] = _count(node["episodes"], "episodes")
            if "chosen" in node:  # the paper's links have a probability alone
                counter, pattern = (_local(node[OWL + end]) for end in ("annotatedSource", "annotatedTarget"))
                links.append((counter, pattern, Tally(*(int(node.get(key, "0")) for key in TALLY))))
        counters = {key: _meaning(node, names) for key, node in nodes.items() if "epoch" in node}
        texts |= {key: node["facts"] for key, node in nodes.items() if "facts" in node}
        pairs = Pairs()
        patterns = {key: _facts(text, _local(key), source, pairs) for key, text in texts.items()}
        said = {
            key: (int(node["index"]), (node["asks"], node["answer"])) for key, node in nodes.items() if "asks" in node
        }
        patterns |= {key: () for key in nodes.keys() - patterns.keys() if key.startswith(MEMORY + "pattern_")}
        short = {f"m:{_local(key)}": fact for key, fact in said.items()}
        for known, parts_of in ((said, lifted), (short, facts)):
            for name, parts in parts_of.items():
                patterns[name] = tuple([fact for _, fact in sorted([known[part] for part in parts])])
        for counter, pattern, tally in links:
            who, conclusion = counters[MEMORY + counter]
            table = experience.counts.setdefault(who, {}).setdefault(conclusion, {})
            key = patterns[MEMORY + pattern]
            if not 0 <= min(tally.chosen, tally.passed_over, tally.failed) <= sum(astuple(tally)) < MOST:
                raise ValueError(f"{counter} counts {tally}; wanted numbers from 0 to {MOST}")
            table[key] = table[key] | tally if key in table else tally
    except KnowledgeError:
        raise
    except (KeyError, ValueError) as error:
        raise KnowledgeError(f"{source}: broken memory: a link or counter lacks a part ({error})") from error
    return experience


def _meaning(node: Mapping[str, str], names: Names | None) -> tuple[tuple[str, int], Conclusion]:
    def short(iri: str) -> str:
        if iri.startswith(MEMORY):  # what the scene didn't know is kept under its name
            return unquote(iri.removeprefix(MEMORY))
        return names.short(iri) if names is not None else _local(iri)

    classes = tuple(short(node[role]) for role in ARGUMENTS if role in node)
    return (node["replica"], _count(node["epoch"], "epoch")), Conclusion(short(node["behavior"]), classes)


def _count(text: str, what: str) -> int:
    """Return a number that something was counted to; raise ValueError if that can't be."""
    if not 0 <= (number := int(text)) < MOST:
        raise ValueError(f":{what} {number}; wanted a number from 0 to {MOST}")
    return number


def _facts(text: str, name: str, source: str, pairs: Pairs) -> Pattern:
    """Return the facts of a pattern; in the first files of this format they stood on lines of their own."""
    parts = [part for part in text.split("\n" if "\n" in text else BETWEEN) if part]
    found = tuple([pairs[part] for part in parts])
    if pairs.doubtful and not pairs.doubtful.isdisjoint(parts) and _pattern(found) != name:
        raise KnowledgeError(
            f"{source}: broken memory: the facts of {name} can't be told apart: '{text[:60]}…'; wanted 'fact: value' joined "
            f"by '{BETWEEN}'; restore the file as Confab wrote it, or plan with --no-memory"
        )
    return found


def _id(term: object) -> str:
    return str(getattr(term, "value", term))


def _local(iri: str) -> str:
    return iri.rsplit("#", 1)[-1].rsplit("/", 1)[-1]


# ------------------------------------------------------------------------------------------------------------ endpoints


def pull(endpoint: str, names: Names | None = None, replica: str | None = None, timeout: float = 60.0) -> Experience:
    """Read all memories that a SPARQL endpoint has, as one.

    Each replica has a named graph of its own there, so that writers never meet. An endpoint without memory gives an empty one.
    """
    query = f'CONSTRUCT {{ ?s ?p ?o }} WHERE {{ GRAPH ?g {{ ?s ?p ?o }} FILTER(STRSTARTS(STR(?g), "{MEMORY}graph/")) }}'
    answer = _ask(endpoint, {"query": query}, timeout)
    own = replica or new_replica()
    triples = [q.triple for q in ox.parse(answer, format=ox.RdfFormat.N_TRIPLES)]
    if not triples:
        return Experience(own)
    found = _experience(triples, Lines(), endpoint, names)
    found.replica = own
    return found


def push(endpoint: str, experience: Experience, names: Names, domain: str, timeout: float = 60.0) -> None:
    """Replace this replica's own graph at a SPARQL endpoint by what it has counted; no other replica's is touched."""
    graph = _node(MEMORY + "graph/", experience.replica)
    text = "".join(turtle(experience, names, domain, only=experience.replica))
    data = ox.serialize([q.triple for q in ox.parse(text, format=ox.RdfFormat.TURTLE)], format=ox.RdfFormat.N_TRIPLES)
    body = (data or b"").decode("utf-8")
    _ask(endpoint, {"update": f"DROP SILENT GRAPH {graph} ; INSERT DATA {{ GRAPH {graph} {{ {body} }} }}"}, timeout)


def _ask(endpoint: str, form: Mapping[str, str], timeout: float) -> bytes:
    url = endpoint if "query" in form else re.sub(r"/(query|sparql)/?$", "/update", endpoint)
    headers = {"Content-Type": "application/x-www-form-urlencoded", "Accept": "application/n-triples"}
    try:
        with urlopen(Request(url, urlencode(form).encode(), headers), timeout=timeout) as answer:
            found: bytes = answer.read()
            return found
    except (URLError, OSError) as error:
        raise KnowledgeError(f"{endpoint}: no memory there: {error}; is it a SPARQL 1.1 endpoint?") from error

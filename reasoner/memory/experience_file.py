"""Files and stores of experience: learned items as triples and tallies as annotated axioms, in Turtle that Protégé can open.

Each learned item is written once (`confab.reasoner.memory.rules_file`). A counter exists for each replica, epoch and item
(`:countsFor`). The property `:associatedWith` links the counter to the item and to the lifted facts that held. An ``owl:Axiom``
on each link of a counter has the numbers `:chosen`, `:passedOver` and `:failed`, and the resulting `:probability`. Replicas never
share a counter, and the names of all other nodes are derived from their content. The union of two memory files is therefore the
union of both memories. A rule that was edited in the file keeps its tallies.

A `:DurationStatistic` exists for each replica, behaviour and actor. The property `:durationStatistic` links the behaviour to the
statistic, and an ``owl:Axiom`` on this link has the numbers `:mean`, `:spread` and `:count`.

Each link is written as one line, which is read by a regular expression. Files in another layout, such as that of Protégé, are read
by the Turtle parser.
"""

from __future__ import annotations

import hashlib
import re
import uuid
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import astuple, dataclass, field
from functools import cached_property
from math import isfinite
from pathlib import Path
from urllib.parse import quote

import pyoxigraph as ox

from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.memory.experience import (
    DIGITS,
    ITSELF,
    Experience,
    LearnedItem,
    MeasuredDuration,
    RoleFact,
    Tally,
    duration_name,
)
from confab.reasoner.memory.rules_file import RuleReader, RuleWriter, Words, label
from confab.reasoner.names import Names
from confab.reasoner.vocabulary import CORE, MEMORY, OWL, RDFS

FORMAT = 5
TALLY = ("chosen", "passedOver", "failed")
PRIOR = 1.0  # added to each of two numbers in every probability

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
DURATION = (
    "m:{name} a owl:NamedIndividual, :DurationStatistic ; rdfs:label {label}{actor} ; :replica {replica}{off} . "
    "{behavior} :durationStatistic m:{name} . [] a owl:Axiom ; owl:annotatedSource {behavior} ; "
    "owl:annotatedProperty :durationStatistic ; owl:annotatedTarget m:{name} ; "
    ":mean {one.mean:.{digits}f} ; :spread {one.spread:.{digits}f} ; :count {one.count} .\n"
)
MOST = 2**53  # larger counts aren't exact as floating-point numbers
COUNTS = re.compile(
    r"^m:(?:(fact_\w+) a owl:NamedIndividual, :LiftedFact ; :asks \"([^\"\\\n]*)\" ; :answer \"([^\"\\\n]*)\" ; "
    r"rdfs:label [^\n]* \.\n|"
    r"(\S+) :associatedWith m:(\S+) \. \[\] a owl:Axiom ; owl:annotatedSource m:\4 ; "
    r"owl:annotatedProperty :associatedWith ; owl:annotatedTarget m:\5 ; "
    r":chosen (\d+) ; :passedOver (\d+) ; :failed (\d+) ; :probability [\d.]+ \.\n)",
    re.MULTILINE,
)
"""Lines of lifted facts and of tallies, which make up most of a file; the Turtle parser reads all other lines."""


PAPER = re.compile(r"^((?:(?:_:link\d+|<[^>\s]+\.memory#[^>\s]+>) <[^\n]* \.\n)+)", re.MULTILINE)
"""Lines of knowledge links, which only the paper's planner reads, and which can make up most of a file."""


@dataclass(frozen=True)
class MemoryLines:
    """The parts of a memory file: links with tallies, lifted facts by name, knowledge links, and all other lines as Turtle."""

    links: list[tuple[str, str, Tally]] = field(default_factory=list)
    facts: dict[str, RoleFact] = field(default_factory=dict)
    rest: str = ""
    paper: str = ""

    @cached_property
    def triples(self) -> list[ox.Triple]:
        """The triples in the text `rest`; invalid Turtle raises `SyntaxError`."""
        return [q.triple for q in ox.parse(self.rest, format=ox.RdfFormat.TURTLE, base_iri=MEMORY)]


def no_such_file(path: Path) -> KnowledgeError:
    """Return the error for a missing memory file."""
    several = "; several goals are a list: goals=[…, …]" if str(path).count(" ") > 1 else ""
    return KnowledgeError(f"{path}: no such memory file; 'confab learn' makes one{several}")


def lines(text: str) -> MemoryLines:
    """Split the text of a memory file into its parts."""
    links, facts, rest, at = [], {}, list[str](), 0
    parts = PAPER.split(text)
    text = "".join(parts[::2])
    for match in COUNTS.finditer(text):
        if match.start() > at:
            rest.append(text[at : match.start()])
        at = match.end()
        fact, asks, answer, counter, about, *counts = match.groups()
        if fact is not None:
            facts[fact] = asks, answer
        else:
            links.append((counter, about, Tally(*map(int, counts))))
    return MemoryLines(links, facts, "".join([*rest, text[at:]]), "".join(parts[1::2]))


def new_replica() -> str:
    """Return a unique ID for the replica of a new memory."""
    return str(uuid.uuid4())


def probability(tally: Tally) -> float:
    """Return the probability that a candidate is chosen and succeeds.

    The prior adds 0.5 to each of the numbers `chosen` and `passed_over`.

    >>> probability(Tally(chosen=3, passed_over=0))
    0.875
    """
    total = tally.chosen + tally.passed_over + tally.failed
    return (tally.chosen + PRIOR / 2) / (total + PRIOR)


# ------------------------------------------------------------------------------------------------------------- writing


def turtle(
    experience: Experience, names: Names, domain: str, only: str | None = None, words: Words = label
) -> Iterator[str]:
    """Yield a memory as Turtle, item by item.

    If `only` is given, the text contains only the tallies of this replica. The function `words` returns the label of an item.
    """
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
    writer = RuleWriter(names, words)
    for name, one in sorted(experience.said.items()):
        yield writer.said(one, name not in experience.disabled)
    facts: dict[RoleFact, str] = {}
    for (replica, epoch), counts in sorted(experience.counts.items()):
        if only not in (None, replica):
            continue
        for name, tallies in sorted(counts.items()):
            counter = f"counter_{name}_{epoch}_{_digest(replica)}"
            yield (
                f"m:{counter} a owl:NamedIndividual, :Counter ; :replica {_text(replica)} ; :epoch {epoch} ; "
                f":countsFor m:{name} .\n"
            )
            for fact, tally in sorted(tallies.items()):
                if fact != ITSELF and fact not in facts:
                    facts[fact] = f"fact_{_digest(repr(fact))}"
                    asks, answer = fact
                    yield (
                        f"m:{facts[fact]} a owl:NamedIndividual, :LiftedFact ; :asks {_text(asks)} ; :answer {_text(answer)} ; "
                        f"rdfs:label {_text(f'{asks}: {answer}')} .\n"
                    )
                target = name if fact == ITSELF else facts[fact]
                yield LINK.format(counter=counter, pattern=target, t=tally, p=probability(tally))
    for replica, known in sorted(experience.durations.items()):
        for (behavior, actor), lasted in sorted(known.items()) if only in (None, replica) else ():
            name = duration_name((behavior, actor))
            yield DURATION.format(
                name=f"{name}_{_digest(replica)}",
                label=_text(f"{behavior} by {actor}" if actor else behavior),
                actor=f" ; :byActor {writer.term(actor)}" if actor else "",
                replica=_text(replica),
                off=" ; :enabled false" if name in experience.disabled else "",
                behavior=writer.term(behavior),
                one=lasted,
                digits=DIGITS,
            )


def _digest(text: str) -> str:
    return hashlib.sha1(text.encode(), usedforsecurity=False).hexdigest()[:16]


def _node(space: str, name: str) -> str:
    """Return the IRI of a name in a namespace, in the notation of Turtle and SPARQL."""
    return str(ox.NamedNode(space + quote(name, safe="")))


def _text(text: str) -> str:
    return str(ox.Literal(text))


# ------------------------------------------------------------------------------------------------------------- reading


def parse(found: MemoryLines, source: str, names: Names | None = None) -> Experience:
    """Return the experience in the parts of a memory file; `source` names the file in messages."""
    try:
        triples = found.triples
    except SyntaxError as error:
        raise KnowledgeError(f"{source}: broken memory: {error}; plan with memory=None, or restore a copy") from error
    return _experience(triples, found, source, names)


def _experience(triples: Iterable[ox.Triple], found: MemoryLines, source: str, names: Names | None) -> Experience:
    links, facts = list(found.links), dict(found.facts)
    nodes: dict[str, dict[str, list[str]]] = {}
    for triple in triples:
        values = nodes.setdefault(_id(triple.subject), {}).setdefault(triple.predicate.value.removeprefix(CORE), [])
        if (value := _id(triple.object)) not in values:
            values.append(value)
    heads = {iri: node for iri, node in nodes.items() if "memoryFormat" in node}
    if not heads:
        raise KnowledgeError(
            f"{source}: no memory of counts: :memoryFormat is missing, as in a memory of the paper's mode"
        )
    head = next(iter(heads.values()))
    if head["memoryFormat"] != [str(FORMAT)]:
        raise KnowledgeError(
            f"{source}: memory of format {', '.join(head['memoryFormat'])}, wanted {FORMAT}: this version doesn't read it; "
            "learn again, or use the version of Confab that wrote it"
        )
    if "learnsAs" not in head:
        raise KnowledgeError(f"{source}: broken memory: :learnsAs, the ID of its replica, is missing; restore a copy")
    experience = Experience(head["learnsAs"][0], trusts=set(head.get("trusts", ())))
    reader = RuleReader(nodes, names)
    try:
        named: dict[str, str] = {}  # an edited rule has another name, but keeps its tallies
        for subject, node in nodes.items():
            one: LearnedItem | None = reader.said(subject)
            if one is not None:
                named[_local(subject)] = one.name
                experience.said[one.name] = one
                if "false" in node.get("enabled", ()):
                    experience.disabled.add(one.name)
            if "episodes" in node:
                # a union of two versions has two numbers
                several = [_count(text, "episodes") for text in node["episodes"]]
                experience.episodes[node["replica"][0]] = max(several)
            if "chosen" in node:  # knowledge links have only a probability
                counter, target = (
                    _local(reader.one(subject, OWL + end)) for end in ("annotatedSource", "annotatedTarget")
                )
                links.append((counter, target, Tally(*(int(node.get(key, ["0"])[0]) for key in TALLY))))
            if "asks" in node:
                facts[_local(subject)] = reader.one(subject, "asks"), reader.one(subject, "answer")
        counters: dict[str, dict[RoleFact, Tally]] = {}
        for subject, node in nodes.items():
            if "epoch" in node:
                who = reader.one(subject, "replica"), _count(reader.one(subject, "epoch"), "epoch")
                about = _local(reader.one(subject, "countsFor")) if "countsFor" in node else ""
                if about in named:
                    tallies = experience.counts.setdefault(who, {}).setdefault(named[about], {})
                    counters[_local(subject)] = tallies
                else:  # the item was deleted, for example in Protégé
                    counters[_local(subject)] = {}
        for counter, target, tally in links:
            fact = facts[target] if target.startswith("fact_") else ITSELF
            tallies = counters[counter]
            if not 0 <= min(tally.chosen, tally.passed_over, tally.failed) <= sum(astuple(tally)) < MOST:
                raise ValueError(f"{counter} counts {tally}; wanted numbers from 0 to {MOST}")
            tallies[fact] = tallies[fact] | tally if fact in tallies else tally
        _durations(experience, reader)
        for replica, epoch in experience.counts:
            if epoch > (lived := experience.episodes.get(replica, epoch)):
                raise ValueError(
                    f":epoch {epoch} of {replica!r}, which has {lived} :episodes; wanted an epoch of at most {lived}"
                )
    except KnowledgeError:
        raise
    except (KeyError, ValueError, IndexError) as error:
        raise KnowledgeError(f"{source}: broken memory: a rule, link or counter lacks a part ({error})") from error
    return experience


def _durations(experience: Experience, reader: RuleReader) -> None:
    """Add the measured durations in the nodes of a reader; raise `ValueError` for a number that is out of range."""
    for subject, node in reader.nodes.items():
        target = node.get(OWL + "annotatedTarget", [""])[0]
        if "mean" not in node or target not in reader.nodes:  # a statistic was deleted, for example in Protégé
            continue
        statistic = reader.nodes[target]
        actor = reader.short(reader.one(target, "byActor")) if "byActor" in statistic else ""
        key = reader.short(reader.one(subject, OWL + "annotatedSource")), actor
        count = _count(reader.one(subject, "count"), "count")
        one = MeasuredDuration(count, *(round(float(reader.one(subject, part)), DIGITS) for part in ("mean", "spread")))
        if not count or not (isfinite(one.mean + one.spread) and min(one.mean, one.spread) >= 0):
            raise ValueError(
                f"{' '.join(key)} lasts {one}; wanted a count from 1 on, and a mean and a spread from 0 on"
            )
        known = experience.durations.setdefault(reader.one(target, "replica"), {})
        known[key] = max(one, known.get(key, one))
        if "false" in statistic.get("enabled", ()):
            experience.disabled.add(duration_name(key))


def _count(text: str, what: str) -> int:
    """Return a text as a whole number; raise `ValueError` for a number that is out of range."""
    if not 0 <= (number := int(text)) < MOST:
        raise ValueError(f":{what} {number}; wanted a number from 0 to {MOST}")
    return number


def _id(term: object) -> str:
    return str(getattr(term, "value", term))


def _local(iri: str) -> str:
    return iri.rsplit("#", 1)[-1].rsplit("/", 1)[-1]


# ------------------------------------------------------------------------------------------------------------ endpoints


def pull(endpoint: str, names: Names | None = None, replica: str | None = None, timeout: float = 60.0) -> Experience:
    """Return the union of all memories at a SPARQL endpoint.

    Each replica has a named graph at the endpoint, so that writers don't conflict. An endpoint without memories gives an empty
    experience.
    """
    query = f'CONSTRUCT {{ ?s ?p ?o }} WHERE {{ GRAPH ?g {{ ?s ?p ?o }} FILTER(STRSTARTS(STR(?g), "{MEMORY}graph/")) }}'
    answer = _ask(endpoint, {"query": query}, timeout)
    own = replica or new_replica()
    triples = [q.triple for q in ox.parse(answer, format=ox.RdfFormat.N_TRIPLES)]
    if not triples:
        return Experience(own)
    found = _experience(triples, MemoryLines(), endpoint, names)
    found.replica = own
    return found


def push(endpoint: str, experience: Experience, names: Names, domain: str, timeout: float = 60.0) -> None:
    """Replace the graph of this replica at a SPARQL endpoint by its tallies; the graphs of other replicas remain unchanged."""
    graph = _node(MEMORY + "graph/", experience.replica)
    text = "".join(turtle(experience, names, domain, only=experience.replica))
    data = ox.serialize([q.triple for q in ox.parse(text, format=ox.RdfFormat.TURTLE)], format=ox.RdfFormat.N_TRIPLES)
    body = (data or b"").decode("utf-8")
    _ask(endpoint, {"update": f"DROP SILENT GRAPH {graph} ; INSERT DATA {{ GRAPH {graph} {{ {body} }} }}"}, timeout)


def _ask(endpoint: str, form: Mapping[str, str], timeout: float) -> bytes:
    from urllib.error import URLError  # imported here because these modules are slow to import
    from urllib.parse import urlencode
    from urllib.request import Request, urlopen

    url = endpoint if "query" in form else re.sub(r"/(query|sparql)/?$", "/update", endpoint)
    headers = {"Content-Type": "application/x-www-form-urlencoded", "Accept": "application/n-triples"}
    try:
        with urlopen(Request(url, urlencode(form).encode(), headers), timeout=timeout) as answer:
            found: bytes = answer.read()
            return found
    except (URLError, OSError) as error:
        raise KnowledgeError(f"{endpoint}: no memory there: {error}; is it a SPARQL 1.1 endpoint?") from error

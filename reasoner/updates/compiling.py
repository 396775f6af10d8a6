"""Compilation of all SPARQL updates in a graph into individuals (see `confab.reasoner.updates.behaviors`)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import pyoxigraph as ox

from confab.reasoner.closure import closure
from confab.reasoner.limits import check
from confab.reasoner.names import local_name
from confab.reasoner.updates.behaviors import UpdateCompiler
from confab.reasoner.updates.texts import Ask, TextPosition, Update, Vocabulary
from confab.reasoner.updates.words import UpdateError
from confab.reasoner.vocabulary import CORE, PREFIXES

UPDATES = """SELECT ?behavior ?property ?value WHERE {
  VALUES ?property { :update :extends :construct } ?behavior ?property ?value
  FILTER NOT EXISTS { ?behavior :postcondition ?effect . FILTER(STR(?effect) = CONCAT(STR(?behavior), ".effect001")) }
  FILTER(?property != :construct || NOT EXISTS { ?behavior :situationType ?situation })
} ORDER BY ?behavior ?property ?value"""
"""Query for the updates that haven't been compiled into individuals; stores that were filled from files already contain the
individuals.
"""
DECLARED = """SELECT ?behavior ?term ?type ?index WHERE {
  ?behavior a/rdfs:subClassOf* :Behavior . { ?behavior :update ?text } UNION { ?behavior :extends ?other }
  ?term :termType ?type . FILTER(STRSTARTS(STR(?term), CONCAT(STR(?behavior), ".")) || EXISTS { ?behavior :parameter ?term })
  OPTIONAL { ?behavior :parameter ?term . ?term :index ?index }
} ORDER BY ?behavior ?index ?term"""
PREFERRED = """SELECT ?prefix ?namespace WHERE {
  ?ontology <http://purl.org/vocab/vann/preferredNamespacePrefix> ?prefix ;
            <http://purl.org/vocab/vann/preferredNamespaceUri> ?namespace } ORDER BY ?prefix ?namespace"""


@dataclass(frozen=True)
class UpdateFault:
    """The reason why an update can't be compiled, with its position and a remedy."""

    place: TextPosition
    what: str
    remedy: str

    def __str__(self) -> str:
        """Return behaviour, reason, position and remedy in one line."""
        return f"<{self.place.behavior}>: {self.what} ({self.place}); {self.remedy}"


@dataclass
class CompiledUpdates:
    """Result of the compilation of a graph's updates: the individuals' triples, the individuals' positions, and the faults."""

    triples: list[ox.Triple] = field(default_factory=list)
    places: dict[str, TextPosition] = field(default_factory=dict)
    faults: list[UpdateFault] = field(default_factory=list)


def compiled(ask: Ask, spelled: Mapping[str, Mapping[str, str]], prefixes: Mapping[str, str]) -> CompiledUpdates:
    """Compile the updates of a graph into individuals.

    Parameters
    ----------
    ask : callable
        A function that returns the rows of a query on the graph.
    spelled : mapping of behaviour to prefixes
        The prefixes of the file that contains the behaviour's update.
    prefixes : mapping of prefix to namespace
        The prefixes of all files; these prefixes are used if the file of an update is unknown.
    """
    texts: dict[str, str] = {}
    extends: dict[str, list[str]] = {}
    rules = set[str]()
    for behavior, prop, value in ask(UPDATES):
        if prop.value in (CORE + "update", CORE + "construct"):
            texts[behavior.value] = value.value
            rules |= {behavior.value} if prop.value == CORE + "construct" else set()
        else:
            extends.setdefault(behavior.value, []).append(value.value)
    done = CompiledUpdates()
    if not texts and not extends:
        return done
    vocabulary = Vocabulary.read(ask)
    common = {**PREFIXES, **prefixes, **{row[0].value: row[1].value for row in ask(PREFERRED)}}
    updates = {}
    for behavior, text in texts.items():
        own = {"": behavior[: len(behavior) - len(local_name(behavior))]}
        updates[behavior] = Update(behavior, text, {**common, **own, **spelled.get(behavior, {})})
    declared: dict[str, dict[str, tuple[str, str, int]]] = {}
    for behavior, node, kind, index in ask(DECLARED):
        name = "?" + local_name(node.value).rsplit(".", 1)[-1]
        number = int(index.value) if index is not None and index.value.isdigit() else 0
        declared.setdefault(behavior.value, {})[name] = node.value, kind.value, number
    for rule in sorted(rules):
        check("compiling rules")
        compiler = UpdateCompiler(rule, vocabulary, {})
        try:
            compiler.write_rule(updates.pop(rule))
        except UpdateError as error:
            place = replace(Update(rule, texts[rule], {}).place(error.at), form="rule")
            done.faults.append(UpdateFault(place, error.what, error.remedy))
            continue
        done.triples += compiler.nodes.triples()
        done.places |= {node: replace(place, form="rule") for node, place in compiler.nodes.places.items()}
    for behavior in sorted({*updates, *extends}):
        check("compiling updates")
        _compile(behavior, updates, extends, declared, vocabulary, done)
    return done


def _compile(
    behavior: str,
    updates: Mapping[str, Update],
    extends: Mapping[str, Sequence[str]],
    declared: Mapping[str, Mapping[str, tuple[str, str, int]]],
    vocabulary: Vocabulary,
    done: CompiledUpdates,
) -> None:
    """Compile one behaviour together with the behaviours that it extends, or record the fault."""
    sources = list(_sources(behavior, extends, set()))
    if lacking := [source for source in sources if source not in updates and source not in extends]:
        name = local_name(lacking[0])
        what = f"it extends {name}, which isn't written as an update"
        remedy = f"write {name} as one (confab convert --behaviors sparql), or repeat what it says"
        done.faults.append(UpdateFault(TextPosition(behavior, 1, 1), what, remedy))
        return
    if any(source in closure(extends.get(source, ()), lambda each: extends.get(each, ())) for source in sources):
        done.faults.append(UpdateFault(TextPosition(behavior, 1, 1), "it extends itself", "take out one c:extends"))
        return
    terms = {name: ("", *known[1:]) for source in sources for name, known in declared.get(source, {}).items()}
    compiler = UpdateCompiler(behavior, vocabulary, {**terms, **declared.get(behavior, {})})
    for source, update in ((source, updates[source]) for source in sources if source in updates):
        try:
            compiler.write(update, declared.get(source, ()))
        except UpdateError as error:
            done.faults.append(UpdateFault(update.place(error.at), error.what, error.remedy))
            return
    done.triples += compiler.nodes.triples()
    done.places |= compiler.nodes.places


def _sources(behavior: str, extends: Mapping[str, Sequence[str]], seen: set[str]) -> Iterator[str]:
    """Yield all behaviours that a behaviour extends, each after those that it extends itself, and the behaviour itself last."""
    seen.add(behavior)
    for other in extends.get(behavior, ()):
        if other not in seen:
            yield from _sources(other, extends, seen)
    yield behavior

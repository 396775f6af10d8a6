"""From the knowledge graph to the values of `reasoner.symbols`: what is there, what can be done, what holds, what is wanted.

The graph is read in a few large queries; their rows become nodes (subject → property → values), and the nodes become values:

============================  ==============================================
in the ontology               in `reasoner.symbols`
============================  ==============================================
``:SituationType``            `SituationType`
``:Behavior``                 `Behavior`, its terms starting with ``?``
``:AbsenceCondition``         a negated `Witness`
``x valueProperty v``         the value of `Symbol` in `Problem.initial`
``:goal`` of the ``:Task``    `Problem.goal`
============================  ==============================================
"""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from itertools import chain, product

import pyoxigraph as ox

from reasoner.amounts import (
    COMPARING,
    DECIMAL,
    OPERATIONS,
    Amount,
    Calculation,
    Expression,
    Measure,
    Quantity,
    bounds_written,
    exact,
    inside,
    written,
)
from reasoner.derivation import circles, needed
from reasoner.graph.knowledge import SCENE, KnowledgeError, KnowledgeGraph, Term, text
from reasoner.names import Names, local_name, nearest
from reasoner.reading import swrl
from reasoner.reading.definitions import AXIOMS, EXPRESSIONS, Definitions
from reasoner.symbols import (
    FALSE,
    TRUE,
    AmountEffect,
    AnyOf,
    Behavior,
    Comparison,
    Condition,
    Domain,
    Effect,
    EqualityCondition,
    Parameter,
    Problem,
    RelationCondition,
    Rule,
    SituationType,
    Symbol,
    ValueCondition,
    ValueEffect,
    Witness,
    spread,
    substituted,
)
from reasoner.vocabulary import ARGUMENTS, CORE, OWL, RDFS, TYPE

WITH_CLASS = ("AbsenceCondition", "ClassCondition")
FIRST_INDEX_OF_NONE = 10**9  # what has no index comes last, by name
KINDS = (
    "SituationType",
    "Behavior",
    "Term",
    "Condition",
    "Effect",
    "Level",
    "Task",
    "Relation",
    "Calculation",
    "Rule",
)  # of the schema's nodes

SCHEMA = f"""
SELECT DISTINCT ?part ?node ?property ?value WHERE {{
  {{ VALUES ?kind {{ {" ".join(":" + kind for kind in KINDS)} }}
    ?node a/rdfs:subClassOf* ?kind ; ?property ?value . BIND("node" AS ?part) }}
  UNION {{ ?node rdfs:subClassOf ?value . FILTER(isIRI(?node) && isIRI(?value))
    FILTER NOT EXISTS {{ VALUES ?kind {{ {" ".join(":" + kind for kind in KINDS)} }} ?node rdfs:subClassOf* ?kind }}
    BIND("class" AS ?part) BIND(rdfs:subClassOf AS ?property) }}
  UNION {{ ?node :hasSituationType ?value . BIND("owner" AS ?part) BIND(:hasSituationType AS ?property) }}
  UNION {{ ?node :valueProperty ?property . FILTER NOT EXISTS {{ ?property a owl:FunctionalProperty }}
    BIND("pair" AS ?part) BIND(?property AS ?value) }}
  UNION {{ ?node :valueProperty/rdfs:range ?value . FILTER(?value IN (xsd:integer, xsd:decimal))
    BIND("range" AS ?part) BIND(rdfs:range AS ?property) }}
  UNION {{ ?node :fromLevel ?value . BIND("level" AS ?part) BIND(:fromLevel AS ?property) }}
  UNION {{ ?node a :SituatedObjectInstance ; ?property ?value .
    FILTER NOT EXISTS {{ ?node :about ?object }} BIND("fact" AS ?part) }}
  UNION {{ {{ SELECT ?node WHERE {{ ?node a :SituatedObjectInstance ; :about ?object }} LIMIT 1 }}
    BIND("tuples" AS ?part) BIND(rdf:type AS ?property) BIND(:SituatedObjectInstance AS ?value) }}
  UNION {{ ?node a owl:Ontology . BIND("ontology" AS ?part) BIND(rdf:type AS ?property) BIND(owl:Ontology AS ?value) }}
  UNION {{ {EXPRESSIONS} BIND("expression" AS ?part) }}
  UNION {{ {AXIOMS} BIND("axiom" AS ?part) }}
  UNION {{ {swrl.RULES} BIND("swrl" AS ?part) }}
}}"""
"""What every planning call in a world needs, in one round trip; ``tuples`` says that there are facts with nodes of their own.

No query of this module orders its rows: a store takes longer to order them than to find them, and what is made of them is
ordered where that counts (`_nodes`, `_classes`, `_initial`).
"""
MEMBERS = """
SELECT DISTINCT ?individual ?class ?index WHERE {
  ?individual a owl:NamedIndividual, ?class .
  FILTER(isIRI(?class) && !STRSTARTS(STR(?class), STR(owl:)))
  OPTIONAL { ?individual :index ?index }
}"""
FACTS = """
SELECT DISTINCT ?subject ?property ?object WHERE {
  { ?situation :valueProperty ?property } UNION { ?property a/rdfs:subClassOf* :Relation }
  ?subject ?property ?object .
}"""
TUPLES = """
SELECT DISTINCT ?fact ?property ?value WHERE {
  ?fact a :SituatedObjectInstance ; ?property ?value
}"""

DATA = frozenset(CORE + name for name in ("index", "negated", "level", "fromLevel", "firstId", "cost", "update"))
DATA |= {CORE + name for name in ("amount", "sign", "change", "unit", "wholeNumbers")}
DATA |= {CORE + name for name in ("leastAmount", "mostAmount", "defaultAmount")}
"""What the core says of its nodes in numbers, signs, truth values and text; all else that it says leads to other nodes."""
OF_ONTOLOGIES = frozenset({CORE + "symbolicOnly", CORE + "inputsHash"})
SIGNS = ("+", "-", "*", "/")
BOUNDS = re.compile(rf"((<=?|>=?|=)?{DECIMAL.pattern})(,(<=?|>=?|=)?{DECIMAL.pattern})*")
"""What is wanted of an amount, as people write it."""
HIGHEST_LEVEL = 1_000
HIGHEST_COST = 10**9
HIGHEST_NUMBER = 10**9
DEEPEST = 50
"""Conditions inside one another."""
MOST_CONDITIONS = 10_000
"""In one behaviour, each counted as often as it is named."""

Node = Mapping[str, Sequence[str]]
Triple = tuple[str, str, str]
Member = tuple[str, str, int]
"""An individual, a class of it, and its index."""


@dataclass(frozen=True)
class Reading:
    """A scene as the planner takes it, with the table that leads from its names back to IRIs.

    `whole` tells whether all individuals of the scene are in it, or those only that its task can need
    (`reasoner.reading.relevance`); `schema` is what it was read by.
    """

    problem: Problem
    names: Names
    schema: Schema
    whole: bool = True


@dataclass(frozen=True)
class Schema:
    """What is the same for every individual: the rows of `SCHEMA`, as IRIs.

    `nodes` are situation types, behaviours with their parts, relations and tasks; `pairs` the situation types whose value
    property isn't functional; `whole` the amounts whose value property takes whole numbers only; `tuples` tells whether some
    facts are nodes of their own, and `facts` has those about nobody;
    `expressions` are the definitions of classes, `axioms` what is said of value properties, `swrl` the rules; `ontologies` the
    IRIs of what was loaded.
    """

    nodes: Mapping[str, Node]
    supers: Mapping[str, Sequence[str]]
    owners: Sequence[tuple[str, str]]
    pairs: frozenset[str]
    whole: frozenset[str]
    from_levels: Mapping[str, int]
    facts: Mapping[str, Node]
    tuples: bool
    expressions: Mapping[str, Node]
    axioms: Mapping[str, Node]
    swrl: Mapping[str, Node]
    ontologies: Sequence[str]

    @cached_property
    def by_kind(self) -> Mapping[str, Sequence[str]]:
        """The nodes of each class that they are said to be of, in the order of their IRIs."""
        found: dict[str, list[str]] = defaultdict(list)
        for iri, node in self.nodes.items():
            for kind in node[TYPE]:
                found[kind].append(iri)
        return found

    @cached_property
    def numbers(self) -> frozenset[str]:
        """The properties that lead to numbers: value properties of amounts, and relations that give one."""
        amounts = {p for iri in self.of_kind("Amount") for p in self.nodes[iri].get(CORE + "valueProperty", ())}
        return frozenset(amounts.union(self.by_kind.get(OWL + "DatatypeProperty", ())))

    @cached_property
    def individuals_of(self) -> frozenset[str]:
        """The classes of objects: where an individual is expected, they stand for all of theirs."""
        known = {*self.supers, *chain.from_iterable(self.supers.values()), *(kind for kind, _ in self.owners)}
        known |= {iri for iri, node in self.expressions.items() if OWL + "equivalentClass" in node}
        return frozenset(known - self.nodes.keys())

    def of_kind(self, *kinds: str) -> list[str]:
        """Return the nodes of some classes of the core."""
        return [iri for kind in kinds for iri in self.by_kind.get(CORE + kind, ())]


def read(graph: KnowledgeGraph, schema: Schema | None = None) -> Reading:
    """Read the planning problem out of a knowledge graph, with every individual that it has.

    Parameters
    ----------
    graph : KnowledgeGraph
    schema : Schema, optional
        If it was read already.

    Raises
    ------
    KnowledgeError
        An object has no value of a situation type, or two; a behaviour's condition lacks a part. The message names it.
    """
    members = [
        (text(who), text(kind), index_of(text(who), text(index))) for who, kind, index in graph.select(MEMBERS, SCENE)
    ]
    schema = read_schema(graph) if schema is None else schema
    facts = [stated(row, schema.numbers) for row in graph.select(FACTS, SCENE)]
    tuples = _nodes(_core_triple(row) for row in graph.select(TUPLES, SCENE))
    return reading_of(graph.scene, frame(schema, members), facts, tuples)


def read_schema(graph: KnowledgeGraph) -> Schema:
    """Read what doesn't depend on how many individuals there are, in one query."""
    parts: dict[str, list[tuple[str, str, str]]] = defaultdict(list)
    for part, *row in graph.solutions(SCHEMA, SCENE):
        parts[text(part)].append(_core_triple(row))
    written = [triple for triple in parts["node"] if graph.remote and triple[1] in (CORE + "update", CORE + "extends")]
    if written:  # a store elsewhere has the text alone
        from reasoner.updates.compiling import compiled

        found = compiled(lambda query: graph.select(query, SCENE), {}, graph.prefixes)
        if found.faults:
            raise KnowledgeError(str(found.faults[0]))
        parts["node"] += [_core_triple(triple) for triple in found.triples]  # type: ignore[arg-type]
    return Schema(
        nodes=_nodes(parts["node"]),
        supers=_superclasses(sorted((sub, sup) for sub, _, sup in parts["class"])),
        owners=sorted((kind, situation) for kind, _, situation in parts["owner"]),
        pairs=frozenset(situation for situation, _, _ in parts["pair"])
        - {situation for situation, _, kind in parts["node"] if kind == CORE + "Amount"},
        whole=frozenset(situation for situation, _, kind in parts["range"] if kind.endswith("integer")),
        from_levels={
            value: whole_number(level, f"<{value}>: :fromLevel", 0, HIGHEST_LEVEL) for value, _, level in parts["level"]
        },
        facts=_nodes(parts["fact"]),
        tuples=bool(parts["tuples"]),
        expressions=_nodes(parts["expression"]),
        axioms=_nodes(parts["axiom"]),
        swrl=_nodes(parts["swrl"]),
        ontologies=sorted(iri for iri, _, _ in parts["ontology"]),
    )


class _Whole(Names):
    """Names that are IRIs, but for truth values."""

    def short(self, iri: str) -> str:
        return {CORE + TRUE: TRUE, CORE + FALSE: FALSE}.get(iri, iri)

    def __contains__(self, name: object) -> bool:
        return True


def as_written(schema: Schema, behaviors: Iterable[str]) -> dict[str, Behavior]:
    """Return behaviours as they are written: with IRIs for names, and classes that situations define left as they are named."""
    names = _Whole(())
    terms = set(schema.of_kind("Parameter", "Variable"))
    parts = _Schema(schema.nodes, names, terms, set(schema.pairs), Definitions({}, {}, names), schema.individuals_of)
    return {iri: parts.behavior(iri) for iri in behaviors}


@dataclass(frozen=True)
class Frame:
    """A schema as values, for some individuals: everything of a problem but its facts and its goal.

    `properties` leads from the IRI of a value property to the name of its situation type, and whether it takes many values;
    `lifted` are the behaviours with effects for all of a class still in one.
    """

    schema: Schema
    parts: _Schema
    domain: Domain
    classes: dict[str, tuple[str, ...]]
    parents: dict[str, tuple[str, ...]]
    properties: dict[str, tuple[str, bool]]
    lifted: dict[str, Behavior]

    @property
    def names(self) -> Names:
        """Short names of the schema's terms and of the individuals."""
        return self.parts.names


def frame(
    schema: Schema,
    members: Sequence[Member],
    namesakes: Collection[str] = (),
    earlier: Frame | None = None,
) -> Frame:
    """Return the behaviours and situation types as values, and the classes of some individuals.

    `namesakes` are others that end like one of these, so that their names are those of the whole scene; `earlier` is the frame
    of fewer individuals, whose behaviours hold as long as the new ones leave the names in them alone.
    """
    nodes, supers = schema.nodes, schema.supers
    instances = [(individual, kind, index) for individual, kind, index in members if individual not in nodes]
    named = schema.of_kind("SituationType", "Behavior", "Relation", "ReachRelation")
    typed = (nodes[iri] for iri in schema.of_kind("Parameter", "Variable", *WITH_CLASS))
    names = Names(
        {
            *named,
            *(iri for iri in namesakes if iri not in nodes),
            *chain.from_iterable((individual, kind) for individual, kind, _ in instances),
            *chain.from_iterable((sub, *above) for sub, above in supers.items()),
            *(kind for node in typed for name in ("termType", "ofClass") for kind in node.get(CORE + name, ())),
        }
    )
    definitions = _definitions(schema, names)
    terms = set(schema.of_kind("Parameter", "Variable"))
    parts = _Schema(nodes, names, terms, set(schema.pairs), definitions, schema.individuals_of)
    classes, parents = _classes(instances, supers, names)
    situations, properties = _situations(parts, schema, classes)
    if earlier is not None and earlier.names.agree(names):
        lifted = earlier.lifted
    else:
        ordered = sorted(_ordered(schema.of_kind("Behavior"), nodes, names), key=parts.level)
        lifted = {names.short(iri): parts.behavior(iri) for iri in ordered}
    rules = _rules(parts, schema, {s.name: s for s in situations})
    domain = Domain(
        situations={s.name: s for s in _on_their_levels(situations, rules)},
        behaviors={name: spread(behavior, classes) for name, behavior in lifted.items()},
        first_ids={
            parts.level(iri): parts.number(iri, "firstId", 0, HIGHEST_NUMBER, 0) for iri in schema.of_kind("Level")
        },
        rules=rules,
    )
    for behavior in lifted.values():
        _check_behavior(behavior, domain)
    for rule in chain.from_iterable(rules.values()):
        _check_behavior(replace(rule.behavior, level=domain.situations[rule.situation].level), domain)
    return Frame(schema, parts, domain, classes, parents, properties, lifted)


def reading_of(
    scene: str, known: Frame, facts: Iterable[Triple], tuples: Mapping[str, Node], whole: bool = True
) -> Reading:
    """Return the planning problem of a frame's individuals.

    Parameters
    ----------
    scene : str
    known : Frame
    facts : triples of IRIs
        Of value properties and relations, between the individuals.
    tuples : mapping of IRI to node
        Facts that are nodes of their own.
    whole : bool
    """
    schema, names = known.schema, known.names
    relations, stated = _facts(facts, {**tuples, **schema.facts}, known.properties, known.domain, names, schema.numbers)
    initial = _initial(known.domain, known.classes, stated, names)
    levels = {names.short(iri): level for iri, level in schema.from_levels.items() if iri not in schema.nodes}
    problem = Problem(scene, known.domain, known.classes, relations, initial, {}, known.parents, levels)
    return Reading(_with_goal(problem, known), names, schema, whole)


def with_goals(reading: Reading, goals: Iterable[str]) -> Problem:
    """Return the problem with some goals replaced, each written like ``cup2 LOCATION location8``.

    Raises
    ------
    KnowledgeError
        A word names nothing of its kind, the object doesn't have the situation type, or two goals exclude each other.
    """
    problem = reading.problem
    given: dict[Symbol, str] = {}
    for fact in goals:
        symbol, value = parse_fact(problem, fact)
        if given.setdefault(symbol, value) != value:
            raise KnowledgeError(f"two goals for {symbol}: {given[symbol]} and {value}; give one")
    return replace(problem, goal=dict(sorted({**problem.goal, **given}.items())))


def parse_fact(problem: Problem, fact: str) -> tuple[Symbol, str]:
    """Return symbol and value of a fact written as ``object SITUATION [argument …] value``.

    Raises
    ------
    KnowledgeError
        A word names nothing of its kind; the message has the nearest known name.
    """
    words = fact.split()
    individuals = {name for members in problem.classes.values() for name in members}
    if len(words) < 2:
        raise KnowledgeError(f"'{fact}' is no fact; wanted 'object SITUATION value', e.g. 'cup2 LOCATION location8'")
    about, name, *rest = words
    if about not in individuals:
        raise KnowledgeError(f"unknown individual '{about}' in '{fact}'{nearest(about, individuals)}")
    if name not in problem.domain.situations:
        known = problem.domain.situations
        raise KnowledgeError(
            f"unknown situation type '{name}' in '{fact}'{nearest(name, known)} (known: {', '.join(known)})"
        )
    situation = problem.domain.situations[name]
    if situation.boolean and len(rest) == len(situation.arguments) - 1:
        rest.append(TRUE)
    if len(rest) != len(situation.arguments):
        raise KnowledgeError(f"'{fact}': {name} takes {len(situation.arguments)} words behind it, got {len(rest)}")
    if situation.quantity is not None:
        if not BOUNDS.fullmatch(rest[-1]):
            raise KnowledgeError(
                f"'{fact}': '{rest[-1]}' is no amount; write a number like 2 or 1.5, or bounds like >=2"
            )
        rest[-1] = bounds_written(rest[-1])
    ranges = (*situation.arguments[1:], *([] if situation.quantity else [situation.range]))
    for kind, word in zip(ranges, rest, strict=situation.quantity is None):
        if word not in individuals and word not in (TRUE, FALSE):
            raise KnowledgeError(
                f"unknown individual '{word}' in '{fact}'{nearest(word, problem.classes.get(kind, ()))}"
            )
        if word not in problem.classes.get(kind, ()):
            raise KnowledgeError(
                f"'{fact}': {word} is no value of {name}; values: {_some(problem.classes.get(kind, ()))}"
            )
    symbol = Symbol(name, (about, *rest[:-1]))
    if about not in problem.classes.get(situation.arguments[0], ()):
        raise KnowledgeError(f"'{fact}': {about} has no {name}, since it is no {situation.arguments[0]}")
    return symbol, rest[-1]


# ------------------------------------------------------------------------------------------------------- from rows to nodes


def _nodes(triples: Iterable[tuple[str, str, str]]) -> dict[str, dict[str, list[str]]]:
    """Return what is said of each subject: the subjects in order, and the values of each property."""
    nodes: dict[str, dict[str, list[str]]] = {}
    for subject, predicate, value in triples:
        nodes.setdefault(subject, {}).setdefault(predicate, []).append(value)
    for node in nodes.values():
        for values in node.values():
            if len(values) > 1:
                values.sort()
    return dict(sorted(nodes.items()))


def _core_triple(row: Sequence[Term]) -> Triple:
    """Return a triple as text, once it is sure that a text isn't taken for the name of what is meant."""
    subject, predicate, value = row
    named = text(predicate)
    return (
        link(row, blank=True) if named.startswith(CORE) and named not in DATA else (text(subject), named, text(value))
    )


def link(row: Sequence[Term], blank: bool = False) -> Triple:
    """Return a triple that leads from one individual to another, as text; only the core's own nodes can go without a name.

    Raises
    ------
    KnowledgeError
        A text, or something without a name, stands where an individual belongs.
    """
    subject, predicate, value = row
    if text(predicate) in OF_ONTOLOGIES:
        said = local_name(text(predicate))
        raise KnowledgeError(
            f"<{text(subject)}>: {said} is said of an ontology, not of an individual; move it beside owl:imports"
        )
    for term in (subject, value):
        if not (isinstance(term, ox.NamedNode) or (blank and isinstance(term, ox.BlankNode))):
            what = f"'{text(term)[:60]}', a text" if isinstance(term, ox.Literal) else "something without a name"
            raise KnowledgeError(
                f"<{text(subject)}>: {local_name(text(predicate))} leads to {what}, where an individual belongs; name one"
                + (", without quotation marks" if isinstance(term, ox.Literal) else "")
            )
    return text(subject), text(predicate), text(value)


def stated(row: Sequence[Term], numbers: Collection[str]) -> Triple:
    """Return a fact as text: a link, or by one of the properties that lead to numbers an amount."""
    subject, predicate, value = row
    if text(predicate) not in numbers:
        return link(row)
    what = f"<{text(subject)}>: {local_name(text(predicate))}"
    if not isinstance(value, ox.Literal):
        raise KnowledgeError(f"{what} leads to {text(value)[:60]}, where a number belongs; write one, like 2 or 1.5")
    return text(subject), text(predicate), written(decimal(text(value), what))


def decimal(text: str, what: str) -> Fraction:
    """Return a number that stands in an ontology, exact.

    Raises
    ------
    KnowledgeError
        It is none.
    """
    found = exact(text)
    if found is None:
        raise KnowledgeError(f"{what} is '{text[:40]}'; wanted a number, like 2 or 1.5")
    return found


def index_of(iri: str, index: str) -> int:
    """Return a node's place in the declared order; what has no index comes last."""
    if not index:
        return FIRST_INDEX_OF_NONE
    return whole_number(index, f"<{iri}>: :index", -HIGHEST_NUMBER, HIGHEST_NUMBER)


def whole_number(text: str, what: str, least: int, most: int) -> int:
    """Return a number that stands in an ontology.

    Raises
    ------
    KnowledgeError
        It is none, or out of range.
    """
    number = int(text) if re.fullmatch(r"[+-]?\d{1,18}", text) else None
    if number is None or not least <= number <= most:
        raise KnowledgeError(f"{what} is '{text[:40]}'; wanted a whole number from {least} to {most}")
    return number


def _is(node: Node, *kinds: str) -> bool:
    types = node[TYPE]
    return any(CORE + kind in types for kind in kinds)


def _ordered(iris: Iterable[str], nodes: Mapping[str, Node], names: Names) -> list[str]:
    """Return nodes by their index, then by name."""

    def key(iri: str) -> tuple[int, str]:
        if iri not in nodes:
            raise KnowledgeError(
                f"<{iri}> is used as a parameter but isn't declared as one; declare it, or mend the name"
            )
        index, *_ = nodes[iri].get(CORE + "index", [""])
        return (index_of(iri, index), names.short(iri))

    return sorted(iris, key=key)


def _superclasses(pairs: Iterable[tuple[str, str]]) -> dict[str, list[str]]:
    supers: dict[str, list[str]] = defaultdict(list)
    for sub, sup in pairs:
        if sub != sup:
            supers[sub].append(sup)
    return dict(supers)


def _classes(
    instances: Sequence[Member], supers: Mapping[str, Sequence[str]], names: Names
) -> tuple[dict[str, tuple[str, ...]], dict[str, tuple[str, ...]]]:
    """Return the individuals of each class in declared order, superclasses included, and each class's direct superclasses."""
    above: dict[str, frozenset[str]] = {}

    def closure(kind: str) -> frozenset[str]:
        if kind not in above:
            found, waiting = {kind}, [kind]
            while waiting:
                for sup in supers.get(waiting.pop(), ()):
                    if sup not in found:
                        found.add(sup)
                        waiting.append(sup)
            above[kind] = frozenset(found)
        return above[kind]

    of: dict[str, set[str]] = defaultdict(set)
    place: dict[str, int] = {}
    for individual, kind, index in instances:
        of[individual] |= closure(kind)
        place[individual] = min(index, place.get(individual, index))
    members: dict[str, list[str]] = {kind: [] for kind in {*supers, *chain.from_iterable(supers.values())}}
    for _, name, kinds in sorted(
        (place[individual], names.short(individual), kinds) for individual, kinds in of.items()
    ):
        for kind in kinds:
            members.setdefault(kind, []).append(name)
    classes = {name: tuple(members[kind]) for name, kind in sorted((names.short(kind), kind) for kind in members)}
    return classes, {names.short(sub): tuple(map(names.short, group)) for sub, group in supers.items()}


# ------------------------------------------------------------------------------------------------------ from nodes to values


@dataclass(frozen=True)
class _Schema:
    """The nodes of behaviours, conditions and situation types, read as values."""

    nodes: Mapping[str, Node]
    names: Names
    terms: set[str]
    pairs: set[str]  # situation types whose value is one of the arguments of a boolean symbol
    definitions: Definitions
    individuals_of: frozenset[str] = frozenset()  # classes that stand for all of their individuals
    standing: dict[str, str] = field(
        default_factory=dict
    )  # those of what is being read, and the term for each individual
    inside: list[str] = field(default_factory=list)  # the conditions that are being read, one inside the other
    count: Counter[str] = field(default_factory=Counter)  # of conditions, by behaviour

    def values(self, iri: str, name: str) -> Sequence[str]:
        return self.nodes.get(iri, {}).get(CORE + name, ())

    def one(self, iri: str, name: str) -> str:
        found = self.values(iri, name)
        if len(found) != 1:
            raise KnowledgeError(f"<{iri}>: wanted one :{name}, found {len(found)}; state it in the ontology")
        return found[0]

    def number(self, iri: str, name: str, least: int, most: int, default: int | None = None) -> int:
        found = self.values(iri, name)
        if not found and default is not None:
            return default
        return whole_number(self.one(iri, name), f"<{iri}>: :{name}", least, most)

    def level(self, iri: str) -> int:
        return self.number(iri, "level", 1, HIGHEST_LEVEL)

    def price(self, iri: str) -> Expression | None:
        if not self.values(iri, "price"):
            return None
        if self.values(iri, "cost"):
            raise KnowledgeError(f"<{iri}> has a :cost and a :price; keep one of them")
        return self.expression(self.one(iri, "price"))

    def cost(self, iri: str) -> float:
        if not self.values(iri, "cost"):
            return 1.0
        said = self.one(iri, "cost")
        try:
            cost = float(said)
        except ValueError:
            cost = -1.0
        if not 0 <= cost <= HIGHEST_COST:  # not a number is neither
            raise KnowledgeError(f"<{iri}>: :cost is '{said[:40]}'; wanted a number from 0 to {HIGHEST_COST}")
        return cost

    def decimal(self, iri: str, name: str) -> Fraction | None:
        if not self.values(iri, name):
            return None
        return decimal(self.one(iri, name), f"<{iri}>: :{name}")

    def word(self, iri: str, name: str, known: Sequence[str]) -> str:
        said = self.one(iri, name)
        if said not in known:
            raise KnowledgeError(f"<{iri}>: :{name} is '{said[:40]}'; wanted one of {' '.join(known)}")
        return said

    def flag(self, iri: str, name: str) -> bool:
        said = set(self.values(iri, name))
        if said - {"true", "false", "1", "0"} or len(said) > 1:
            raise KnowledgeError(f"<{iri}>: :{name} is '{' and '.join(sorted(said))[:40]}'; wanted true or false")
        return bool(said & {"true", "1"})

    def term(self, iri: str) -> str:
        """Return a term's name (``?hand`` for the parameter B2_PICK.hand), or the individual's."""
        if iri in self.terms:
            return "?" + local_name(iri).rsplit(".", 1)[-1]
        if iri in self.standing:
            return self.standing[iri]
        name = self.names.short(iri)
        if self.terms and name not in self.names and name not in (TRUE, FALSE):  # a scene's facts have no terms
            raise KnowledgeError(
                f"<{iri}> is named in a behaviour, but isn't declared as a parameter, a variable or an individual; declare it, "
                "or mend the name"
            )
        return name

    def parameter(self, iri: str) -> Parameter:
        if iri not in self.terms:
            raise KnowledgeError(
                f"<{iri}> is used as a parameter but isn't declared as one; declare it, or mend the name"
            )
        return Parameter(self.term(iri), self.names.short(self.definitions.base(self.one(iri, "termType"))))

    def membership(self, iri: str) -> tuple[Condition, ...]:
        """Return what the type of a term asks of it, if that is a class defined by situations."""
        return self.definitions.beyond_base(self.term(iri), self.one(iri, "termType"))

    def arguments(self, iri: str) -> tuple[str, ...]:
        return tuple(self.term(value) for name in ARGUMENTS for value in self.values(iri, name)[:1])

    def situation(self, iri: str) -> str:
        """Return the situation type that a condition, an effect or a calculation is about."""
        situation = self.one(iri, "situationType")
        if situation not in self.nodes or not _is(self.nodes[situation], "SituationType"):
            raise KnowledgeError(f"<{iri}>: <{situation}> is no situation type; declare it as one, or mend the name")
        return situation

    def situation_and_value(self, iri: str) -> tuple[str, tuple[str, ...], str]:
        """Return situation type, arguments and value; a value that is an argument of a boolean symbol moves there."""
        situation = self.situation(iri)
        if _is(self.nodes[situation], "Amount"):
            raise KnowledgeError(
                f"<{iri}>: {local_name(situation)} is an amount, which no value condition or effect speaks of; "
                "use a :Comparison or an :AmountEffect"
            )
        arguments = self.arguments(iri)
        value = [self.term(v) for v in self.values(iri, "value")]
        if situation in self.pairs:
            arguments, value = (*arguments, *value), []
        return self.names.short(situation), arguments, value[0] if value else TRUE

    def condition(self, iri: str) -> Condition:
        if iri not in self.nodes:
            raise KnowledgeError(f"<{iri}> is used as a condition but isn't declared as one")
        if iri in self.inside or len(self.inside) > DEEPEST:
            what = "contains itself" if iri in self.inside else f"lies inside more than {DEEPEST} others"
            raise KnowledgeError(f"<{iri}>: the condition {what}; take it out of one of them")
        self.count[self.inside[0] if self.inside else ""] += 1
        if self.inside and self.count[self.inside[0]] > MOST_CONDITIONS:
            raise KnowledgeError(
                f"<{self.inside[0]}>: more than {MOST_CONDITIONS} conditions, each counted as often as it is named; say less"
            )
        self.inside.append(iri)
        found = self._of_all(iri)
        self.inside.pop()
        return found

    def classes_in(self, iri: str) -> list[str]:
        """Return the classes that stand in the place of an individual of a condition or an effect, and stand for nobody yet."""
        said = [value for name in (*ARGUMENTS, "value") for value in self.values(iri, name)[:1]]
        found = [value for value in said if value in self.individuals_of and value not in self.standing]
        if twice := [kind for kind in found if found.count(kind) > 1]:
            raise KnowledgeError(
                f"<{iri}> names the class {local_name(twice[0])} twice, so that it can't be told whether the same individual is "
                "meant; use a :Witness with a variable for one of them"
            )
        situation = self.values(iri, "situationType")[:1]
        if found and found[-1:] == [*self.values(iri, "value")] and situation and situation[0] not in self.pairs:
            raise KnowledgeError(
                f"<{iri}> wants every {local_name(found[-1])} as the one value of {local_name(situation[0])}; name an individual, "
                "or seek some one by a :Witness"
            )
        return found

    def _of_all(self, iri: str) -> Condition:
        """Return a condition; of a class in the place of an individual it asks for each of the class."""
        kinds = self.classes_in(iri)
        for kind in kinds:
            self.standing[kind] = f"?each{len(self.standing) or ''}"
        found = self._condition(iri)
        for kind in reversed(kinds):
            term = self.standing.pop(kind)
            contrary = replace(found, negated=not found.negated)
            inner = (*self.definitions.beyond_base(term, kind), contrary)
            found = Witness(term, self.names.short(self.definitions.base(kind)), inner, negated=True)
        return found

    def _condition(self, iri: str) -> Condition:
        node, negated = self.nodes[iri], self.flag(iri, "negated")
        if _is(node, "ValueCondition"):
            return ValueCondition(*self.situation_and_value(iri), negated)
        if _is(node, "RelationCondition"):
            arguments = (*self.arguments(iri), *(self.term(v) for v in self.values(iri, "value")))
            relation = self.one(iri, "relation")
            if relation not in self.nodes or not _is(self.nodes[relation], "Relation", "ReachRelation"):
                raise KnowledgeError(f"<{iri}>: <{relation}> is no relation; declare it as one, or mend the name")
            return RelationCondition(self.names.short(relation), arguments, negated)
        if _is(node, "ClassCondition"):
            return self.definitions.condition(self.term(self.one(iri, "about")), self.one(iri, "ofClass"), negated)
        if _is(node, "EqualityCondition"):
            return EqualityCondition(self.term(self.one(iri, "about")), self.term(self.one(iri, "value")), negated)
        if _is(node, "AbsenceCondition"):
            name, _, value = self.situation_and_value(iri)
            anyone, kind = "?anyone", self.one(iri, "ofClass")
            inner = (ValueCondition(name, (anyone,), value), *self.definitions.beyond_base(anyone, kind))
            return Witness(anyone, self.names.short(self.definitions.base(kind)), inner, not negated)
        if _is(node, "Witness"):
            sought = self.one(iri, "witness")
            variable, inner = self.parameter(sought), (*self.conditions(iri, "condition"), *self.membership(sought))
            return Witness(variable.name, variable.kind, inner, negated)
        if _is(node, "AnyOf"):
            groups = [self.group(alternative) for alternative in self.values(iri, "alternative")]
            return AnyOf(tuple(groups), negated)
        if _is(node, "AllOf"):
            return AnyOf((self.conditions(iri, "condition"),), negated)
        if _is(node, "Comparison"):
            sign = self.word(iri, "sign", tuple(COMPARING))
            return Comparison(self.left(iri), sign, self.right(iri), negated)
        raise KnowledgeError(f"<{iri}>: a condition of no known kind; give it one of the subclasses of :Condition")

    def left(self, iri: str) -> Expression:
        """Return the left side of a comparison or calculation: its own amount, if it has no other."""
        return self.expression(self.one(iri, "left")) if self.values(iri, "left") else self.measured(iri)

    def right(self, iri: str) -> Expression:
        """Return the right side of a comparison, calculation or effect: its own number, if it has no other."""
        if self.values(iri, "right"):
            return self.expression(self.one(iri, "right"))
        number = self.decimal(iri, "amount")
        if number is None:
            raise KnowledgeError(
                f"<{iri}> has neither :amount nor :right; state a number, or what it is worked out from"
            )
        return number

    def measured(self, iri: str) -> Expression:
        """Return the amount of an object, or what a relation gives for it."""
        if self.values(iri, "relation"):
            relation = self.one(iri, "relation")
            if relation not in self.nodes or not _is(self.nodes[relation], "Relation", "ReachRelation"):
                raise KnowledgeError(f"<{iri}>: <{relation}> is no relation; declare it as one, or mend the name")
            return Measure(self.names.short(relation), self.arguments(iri))
        situation = self.situation(iri)
        if not _is(self.nodes[situation], "Amount"):
            raise KnowledgeError(
                f"<{iri}>: {local_name(situation)} is no amount, so that no number compares with it or changes it; "
                "declare it as :Amount, or use a value condition or effect"
            )
        return Amount(self.names.short(situation), self.arguments(iri))

    def expression(self, iri: str) -> Expression:
        if iri not in self.nodes:
            raise KnowledgeError(f"<{iri}> is used as a calculation but isn't declared as one")
        if iri in self.inside or len(self.inside) > DEEPEST:
            what = "contains itself" if iri in self.inside else f"lies inside more than {DEEPEST} others"
            raise KnowledgeError(f"<{iri}>: the calculation {what}; take it out of one of them")
        self.inside.append(iri)
        if self.values(iri, "sign"):
            found: Expression = Calculation(self.word(iri, "sign", SIGNS), self.left(iri), self.right(iri))
        else:
            number = self.decimal(iri, "amount")
            found = self.measured(iri) if number is None else number
        self.inside.pop()
        return found

    def conditions(self, iri: str, name: str) -> tuple[Condition, ...]:
        return tuple(condition for value in self.values(iri, name) for condition in self.group(value))

    def group(self, iri: str) -> tuple[Condition, ...]:
        """Return a condition, or those that all have to hold where it says so."""
        found = self.condition(iri)
        if isinstance(found, AnyOf) and len(found.alternatives) == 1 and not found.negated:
            return found.alternatives[0]
        return (found,)

    def effect(self, iri: str) -> Effect:
        """Return an effect; with a class in the place of an individual it is made for each of the class for which `when` holds."""
        if iri not in self.nodes:
            raise KnowledgeError(f"<{iri}> is used as an effect but isn't declared as one")
        kinds = self.classes_in(iri)
        if len(kinds) > 1:
            raise KnowledgeError(
                f"<{iri}> is about all of two classes, {' and '.join(map(local_name, kinds))}; make one of them a parameter"
            )
        for kind in kinds:
            self.standing[kind] = "?each"
        of_amount = _is(self.nodes[iri], "AmountEffect")
        found = self.amount_effect(iri) if of_amount else self.value_effect(iri)
        for kind in kinds:
            term = self.standing.pop(kind)
            each = Parameter(term, self.names.short(self.definitions.base(kind)))
            found = replace(found, when=(*self.definitions.beyond_base(term, kind), *found.when), each=each)
        return found

    def value_effect(self, iri: str) -> ValueEffect:
        situation, arguments, value = self.situation_and_value(iri)
        if self.flag(iri, "negated"):
            value = FALSE
        return ValueEffect(situation, arguments, value, self.conditions(iri, "when"))

    def amount_effect(self, iri: str) -> AmountEffect:
        changed = self.measured(iri)
        if not isinstance(changed, Amount):
            raise KnowledgeError(f"<{iri}>: a static relation can't be changed; make it an :Amount")
        operation = self.word(iri, "change", OPERATIONS)
        when = self.conditions(iri, "when")
        return AmountEffect(changed.situation, changed.arguments, operation, self.right(iri), when)

    def behavior(self, iri: str) -> Behavior:
        parameters = tuple(map(self.parameter, _ordered(self.values(iri, "parameter"), self.nodes, self.names)))
        used = sorted(self.terms_below(iri) - set(self.values(iri, "parameter")))
        effects = [self.effect(effect) for effect in self.values(iri, "postcondition")]
        price = self.price(iri)
        return Behavior(
            name=self.names.short(iri),
            level=self.level(iri),
            parameters=parameters,
            variables=tuple(map(self.parameter, used)),
            preconditions=(
                *self.conditions(iri, "precondition"),
                *(c for term in (*self.values(iri, "parameter"), *used) for c in self.membership(term)),
                *([] if price is None else [Comparison(price, ">=", Fraction(0))]),
            ),
            effects=tuple(effect for effect in effects if isinstance(effect, ValueEffect)),
            cost=self.cost(iri),
            amounts=tuple(effect for effect in effects if isinstance(effect, AmountEffect)),
            price=price,
        )

    def rule(self, iri: str, kinds: Sequence[str]) -> Rule:
        """Return a rule of a situation type with arguments of some classes; an individual among its terms is compared."""
        situation, arguments, value = self.situation_and_value(iri)
        if value != TRUE:
            raise KnowledgeError(f"<{iri}>: a rule says what is true; leave out the value, or negate its conditions")
        if len(arguments) != len(kinds):
            raise KnowledgeError(f"<{iri}> speaks of {situation} with {len(arguments)} arguments; it has {len(kinds)}")
        parameters: list[Parameter] = []
        compared: list[Condition] = []
        own = {self.term(t): t for t in self.terms_below(iri)}
        for i, (term, kind) in enumerate(zip(arguments, kinds, strict=True)):
            if term in own and term not in [p.name for p in parameters]:
                parameters.append(self.parameter(own[term]))
            else:
                parameters.append(Parameter(f"?argument{i}", kind))
                compared.append(EqualityCondition(f"?argument{i}", term))
        names = {p.name for p in parameters}
        membership = (c for t in sorted(own.values()) for c in self.membership(t))
        variables = tuple(self.parameter(t) for name, t in sorted(own.items()) if name not in names)
        conditions = (*compared, *self.conditions(iri, "condition"), *membership)
        return Rule(situation, tuple(parameters), variables, conditions)

    def terms_below(self, iri: str) -> set[str]:
        """Return the terms that occur anywhere below a behaviour, those bound by a witness left out."""
        found: set[str] = set()
        bound: set[str] = set()
        waiting, seen = [iri], {iri}
        while waiting:
            node = waiting.pop()
            bound.update(self.values(node, "witness"))
            for values in self.nodes.get(node, {}).values():
                for value in values:
                    if value in self.terms:
                        found.add(value)
                    elif value in self.nodes and value not in seen and _is_part(self.nodes[value]):
                        seen.add(value)
                        waiting.append(value)
        return found - bound


def _rules(parts: _Schema, schema: Schema, situations: Mapping[str, SituationType]) -> dict[str, tuple[Rule, ...]]:
    """Return the rules of each situation type that is defined: by rules, by a class, or by axioms about its value property.

    Raises
    ------
    KnowledgeError
        A behaviour changes one that has rules, one isn't true or false, or is defined by its own negation.
    """
    changed = {
        parts.one(iri, "situationType") for iri in schema.of_kind("ValueEffect") if parts.values(iri, "situationType")
    }
    written: dict[str, list[str]] = defaultdict(list)
    for iri in schema.of_kind("Rule"):
        written[parts.one(iri, "situationType")].append(iri)
    arguments = {iri: situations[parts.names.short(iri)].arguments for iri in schema.of_kind("SituationType")}
    by_swrl = swrl.compiled(parts.definitions, arguments) if schema.swrl else {}
    found: dict[str, tuple[Rule, ...]] = {}
    for iri, kinds in arguments.items():
        name, said = parts.names.short(iri), parts.values(iri, "holdsOf")
        if by := [*written[iri], *said, *(["SWRL"] if iri in by_swrl else [])]:
            if iri in changed:
                who = min(e for e in schema.of_kind("ValueEffect") if list(parts.values(e, "situationType")) == [iri])
                raise KnowledgeError(
                    f"<{who}> changes {name}, which is defined by <{min(by)}>; take the effect out, or drop the definition",
                    who,
                )
            if not situations[name].boolean:
                raise KnowledgeError(
                    f"<{iri}> is defined by <{min(by)}>, but has values; what is defined is true or false: "
                    "make its value property not functional"
                )
        rules = [parts.rule(rule, kinds) for rule in written[iri]] + by_swrl.get(iri, [])
        if said and len(kinds) != 1:
            raise KnowledgeError(
                f"<{iri}> holds of what is in a class, so that it is about one individual, and {len(kinds)} are said; "
                "say by :hasSituationType which class has it"
            )
        for kind in said:
            head = (Parameter("?it", kinds[0]),)
            rules.append(Rule(name, head, (), parts.definitions.holding("?it", kind)))
        if iri not in changed and iri in schema.pairs:
            for prop in parts.values(iri, "valueProperty"):
                rules += parts.definitions.rules(prop, name, kinds, bool(rules))
        if not rules:
            continue
        found[name] = tuple(rules)
    for name, other in circles(found):
        raise KnowledgeError(
            f"{name} is defined by {other} not being true, which is defined by {name} in turn: which of them holds can't be told; "
            "take one of these conditions out of its rule",
            next((rule for iri, rules in written.items() if parts.names.short(iri) == name for rule in rules), None)
            or parts.names.iri(name),
        )
    return found


def _on_their_levels(
    situations: Iterable[SituationType], rules: Mapping[str, Sequence[Rule]]
) -> Iterator[SituationType]:
    """Yield situation types; what is defined exists from the level on that has all that it is defined by."""
    known = {s.name: s for s in situations}
    before = None
    while before != known:
        before = dict(known)
        for name, its in rules.items():
            read = {s for rule in its for s, _ in needed(rule.conditions)} | {name}
            known[name] = replace(known[name], level=max(known[s].level for s in read if s in known))
    yield from known.values()


def _definitions(schema: Schema, names: Names) -> Definitions:
    """Return what defines classes and situation types, with the kinds of what the properties in it lead from and to."""
    properties, kinds = _value_properties(schema), dict[str, tuple[str, str]]()
    owners: dict[str, list[str]] = defaultdict(list)
    for kind, situation in schema.owners:
        owners[situation].append(kind)
    for prop, (situation, _) in properties.items():
        kinds[prop] = "|".join(map(names.short, owners[situation])), names.short(situation)
    for iri in schema.of_kind("Relation", "ReachRelation"):
        ends = (schema.nodes[iri].get(RDFS + end, ()) for end in ("domain", "range"))
        one, other = (names.short(end[0]) if len(end) == 1 and ":" in end[0] else "" for end in ends)
        kinds[iri] = one, other
    concluded = {}
    of_rules = swrl.heads(schema.swrl) if schema.swrl else ()
    ruled = {one for rule in schema.of_kind("Rule") for one in schema.nodes[rule].get(CORE + "situationType", ())}
    for iri in schema.of_kind("SituationType") if of_rules or ruled else ():
        for kind in schema.nodes[iri].get(CORE + "holdsOf", ()):
            if kind in of_rules or iri in ruled:
                concluded[kind] = iri, owners[iri][0] if len(owners[iri]) == 1 else ""
    nodes = {**schema.expressions, **schema.axioms, **schema.swrl}
    return Definitions(nodes, properties, names, schema.numbers, kinds, concluded)


def _value_properties(schema: Schema) -> dict[str, tuple[str, bool]]:
    """Return the situation type of each value property, and whether it is functional."""
    return {
        prop: (iri, iri not in schema.pairs)
        for iri in schema.of_kind("SituationType")
        for prop in schema.nodes[iri].get(CORE + "valueProperty", ())
    }


def _check_behavior(behavior: Behavior, domain: Domain) -> None:
    """Raise `KnowledgeError` if two terms of a behaviour share a name, or a part of it has more or fewer arguments than it can."""
    names = [term.name for term in (*behavior.parameters, *behavior.variables)]
    if twice := sorted({name[1:] for name in names if names.count(name) > 1}):
        raise KnowledgeError(
            f"{behavior.name} has several terms called {', '.join(twice)}; give each a name of its own"
        )
    said: list[Condition | ValueEffect | AmountEffect | Expression]
    said = [*behavior.preconditions, *behavior.effects, *behavior.amounts]
    while said:
        match said.pop():
            case (
                ValueCondition(situation, arguments)
                | ValueEffect(situation, arguments)
                | AmountEffect(situation, arguments)
                | Amount(situation, arguments)
            ) as part:
                wanted = len(domain.situations[situation].arguments)
                if len(arguments) != wanted:
                    raise KnowledgeError(
                        f"{behavior.name} speaks of {situation} with {len(arguments)} arguments; it has {wanted}: "
                        "mend the condition or effect, or say what has that situation type"
                    )
                if domain.situations[situation].level > behavior.level:
                    raise KnowledgeError(
                        f"{behavior.name} on level {behavior.level} speaks of {situation}, which exists from level "
                        f"{domain.situations[situation].level} on; mend the behaviour's :level or the situation type's :fromLevel"
                    )
                said += part.when if isinstance(part, ValueEffect | AmountEffect) else ()
                said += inside(part.amount) if isinstance(part, AmountEffect) else ()
            case Comparison(left, _, right):
                said += [*inside(left), *inside(right)]
            case Witness(_, _, inner):
                said += inner
            case AnyOf(alternatives):
                said += (condition for group in alternatives for condition in group)


def _is_part(node: Node) -> bool:
    return not _is(node, "Behavior", "SituationType", "Task", "Relation", "ReachRelation", "Level")


def _situations(
    schema: _Schema, read: Schema, classes: dict[str, tuple[str, ...]]
) -> tuple[list[SituationType], dict[str, tuple[str, bool]]]:
    """Return the situation types by name, and for each value property its situation type and whether it is boolean."""
    found, properties = [], {}
    for iri in sorted(read.of_kind("SituationType"), key=schema.names.short):
        name = schema.names.short(iri)
        owning = [schema.names.short(kind) for kind, situation in read.owners if situation == iri]
        parameters = [
            schema.parameter(p) for p in _ordered(schema.values(iri, "parameter"), schema.nodes, schema.names)
        ]
        arguments = tuple(p.kind for p in parameters) or ((_union(owning, classes),) if owning else ())
        value_property = schema.values(iri, "valueProperty")
        boolean = set(classes.get(name, ())) <= {TRUE, FALSE}
        if iri in schema.pairs:
            arguments, boolean = (*arguments, name), True
        for iri_of_property in value_property:
            properties[iri_of_property] = (name, iri in schema.pairs)
        if quantity := _quantity(schema, iri, iri in read.whole):
            boolean = False
        rest = schema.values(iri, "restValue")
        default = schema.values(iri, "defaultValue") or rest
        found.append(
            SituationType(
                name=name,
                arguments=arguments,
                range="Truth" if boolean else name,
                level=schema.number(iri, "fromLevel", 0, HIGHEST_LEVEL, 1),
                rest=schema.term(rest[0]) if rest else None,
                default=schema.term(default[0]) if default else (FALSE if boolean else None),
                boolean=boolean,
                quantity=quantity,
            )
        )
        if quantity and (amount := schema.decimal(iri, "defaultAmount")) is not None:
            found[-1] = replace(found[-1], default=written(amount))
    return found, properties


def _quantity(schema: _Schema, iri: str, whole: bool) -> Quantity | None:
    if not _is(schema.nodes[iri], "Amount"):
        return None
    unit = schema.one(iri, "unit") if schema.values(iri, "unit") else ""
    least, most = schema.decimal(iri, "leastAmount"), schema.decimal(iri, "mostAmount")
    return Quantity(unit, whole or schema.flag(iri, "wholeNumbers"), least, most)


def _union(kinds: Sequence[str], classes: dict[str, tuple[str, ...]]) -> str:
    """Return the class of all individuals of several classes, made if there is more than one."""
    name = "|".join(kinds)
    if name not in classes:
        classes[name] = tuple(dict.fromkeys(member for kind in kinds for member in classes.get(kind, ())))
    return name


def _facts(
    rows: Iterable[tuple[str, ...]],
    tuples: Mapping[str, Node],
    properties: Mapping[str, tuple[str, bool]],
    domain: Domain,
    names: Names,
    numbers: Collection[str],
) -> tuple[dict[str, frozenset[tuple[str, ...]]], dict[Symbol, set[str]]]:
    """Return the static relations, and the values that the scene states of each symbol."""
    relations: dict[str, set[tuple[str, ...]]] = defaultdict(set)
    numbered: dict[str, set[tuple[str, ...]]] = defaultdict(set)  # those that give a number, at the end of each row
    stated: dict[Symbol, set[str]] = defaultdict(set)
    for subject, predicate, value in rows:
        number = predicate in numbers
        pair = (names.short(subject), value if number else names.short(value))
        if predicate not in properties:
            (numbered if number else relations)[names.short(predicate)].add(pair)
            continue
        situation, boolean = properties[predicate]
        if situation in domain.rules:
            continue  # it follows from what is stated of others
        if boolean:
            stated[Symbol(situation, pair)].add(TRUE)
        else:
            stated[Symbol(situation, pair[:1])].add(pair[1])
    facts = _Schema(tuples, names, set(), set(), Definitions({}, {}, names))
    for iri, node in tuples.items():
        if CORE + "relation" in node:
            individuals = (*facts.arguments(iri), *(names.short(v) for v in facts.values(iri, "value")))
            relation, amount = names.short(facts.one(iri, "relation")), facts.decimal(iri, "amount")
            if amount is None:
                relations[relation].add(individuals)
            else:
                numbered[relation].add((*individuals, written(amount)))
        else:
            values = facts.values(iri, "value")
            symbol = Symbol(names.short(facts.one(iri, "situationType")), facts.arguments(iri))
            amount = facts.decimal(iri, "amount")
            said = names.short(values[0]) if values else TRUE
            stated[symbol].add(said if amount is None else written(amount))
    for symbol in stated:
        if symbol.situation not in domain.situations:
            raise KnowledgeError(f"{symbol}: a fact of no known situation type")
        _check_arguments(symbol, domain, "a fact")
    for relation, pairs in numbered.items():
        _check_numbers(relation, pairs, relations.get(relation, ()))
    asked = _asked(domain)
    for relation, rows in sorted(relations.items()):
        many = asked.get(relation) or max(map(len, rows))
        for row in sorted(rows):
            if len(row) != many:
                others = "conditions" if relation in asked else "others"
                raise KnowledgeError(
                    f"{relation} of {', '.join(row)} names {len(row)} individuals; {others} name {many}; state what is lacking, "
                    "or drop what is too much"
                )
    return {name: frozenset(pairs) for name, pairs in sorted({**relations, **numbered}.items())}, stated


def _asked(domain: Domain) -> dict[str, int]:
    """Return how many individuals conditions name for each relation without a number."""
    found: dict[str, int] = {}
    rules = [rule.behavior for its in domain.rules.values() for rule in its]
    waiting = [condition for behavior in (*domain.behaviors.values(), *rules) for condition in behavior.conditions]
    while waiting:
        match waiting.pop():
            case RelationCondition(relation, arguments):
                found[relation] = len(arguments)
            case Witness(_, _, inner):
                waiting += inner
            case AnyOf(alternatives):
                waiting += chain.from_iterable(alternatives)
    return found


def _check_numbers(relation: str, rows: Iterable[tuple[str, ...]], bare: Collection[tuple[str, ...]]) -> None:
    """Raise `KnowledgeError` if a relation gives two numbers for the same individuals, or for some none."""
    for row in bare:
        raise KnowledgeError(f"{relation} of {', '.join(row)} has no number, where others have one; say its :amount")
    found: dict[tuple[str, ...], str] = {}
    for *individuals, value in sorted(rows):
        if (old := found.setdefault(tuple(individuals), value)) != value:
            raise KnowledgeError(f"{relation} of {', '.join(individuals)} is {old} and {value}; state one number")


def _check_arguments(symbol: Symbol, domain: Domain, what: str) -> None:
    many, wanted = len(symbol.arguments), len(domain.situations[symbol.situation].arguments)
    if many != wanted:
        raise KnowledgeError(f"{symbol}: {what} about {many} individuals; {symbol.situation} is about {wanted}")


def _initial(
    domain: Domain, classes: Mapping[str, tuple[str, ...]], stated: Mapping[Symbol, set[str]], names: Names
) -> dict[Symbol, str]:
    initial = {}
    for situation in domain.situations.values():
        if situation.boolean:
            continue
        for arguments in product(*(classes.get(kind, ()) for kind in situation.arguments)):
            symbol = Symbol(situation.name, arguments)
            if situation.quantity and len(arguments) > 1 and symbol not in stated and not situation.default:
                continue  # distances, prices: only what is stated is there
            values = sorted(stated.get(symbol, ())) or [v for v in [situation.default] if v]
            if len(values) != 1:
                what = f"several values ({', '.join(values)})" if values else "no value"
                raise KnowledgeError(f"{symbol} has {what}; state one in the scene, or a default of {situation.name}")
            initial[symbol] = values[0]
            if situation.quantity:
                _check_amount(symbol, values[0], situation.quantity, names)
    true = [s for s, (v, *_) in stated.items() if domain.situations[s.situation].boolean and v == TRUE]
    initial |= dict.fromkeys(sorted(true), TRUE)
    for symbol, value in initial.items():
        number = domain.situations[symbol.situation].quantity is not None
        for name in symbol.arguments if number else (*symbol.arguments, value):
            if name not in names and name not in (TRUE, FALSE):
                raise KnowledgeError(
                    f"{symbol} is {value}, but {name} isn't declared as an individual; declare it, or mend the name"
                )
    return initial


def _check_amount(symbol: Symbol, value: str, quantity: Quantity, names: Names) -> None:
    """Raise `KnowledgeError` if a symbol has an amount that it can't have."""
    node = names.iri(symbol.arguments[0]) if symbol.arguments[0] in names else ""
    if not DECIMAL.fullmatch(value):
        raise KnowledgeError(f"{symbol} is {value[:40]}; wanted a number, like 2 or 1.5", node)
    if not quantity.allows(Fraction(value)):
        limits = [] if quantity.least is None else [f"at least {written(quantity.least)}"]
        limits += [] if quantity.most is None else [f"at most {written(quantity.most)}"]
        limits += ["a whole number"] if quantity.whole else []
        raise KnowledgeError(f"{symbol} is {value}; it has to be {' and '.join(limits)}; mend the scene", node)


def _with_goal(problem: Problem, known: Frame) -> Problem:
    schema, goal = known.parts, dict[Symbol, str]()
    for task in known.schema.of_kind("Task"):
        goals = schema.values(task, "goal")
        for iri, wanted in ((goal, one) for goal in goals for one in _wanted(schema, goal, known)):
            if isinstance(wanted, Comparison):
                symbol, value = _bounds(iri, wanted)
                value = bounds_written(f"{goal[symbol]},{value}" if symbol in goal else value)
                goal[symbol] = value
                if symbol not in problem.initial:
                    raise KnowledgeError(f"<{iri}>: there is no {symbol}; the scene states no amount of it")
                continue
            if not isinstance(wanted, ValueCondition):
                raise KnowledgeError(f"<{iri}>: a goal has to be a value condition or a comparison")
            symbol = Symbol(wanted.situation, wanted.arguments)
            _check_arguments(symbol, problem.domain, "a goal")
            value = _wanted_value(iri, wanted, known)
            kind = problem.domain.situations[symbol.situation]
            members = (known.classes.get(of, ()) for of in kind.arguments)
            if value == FALSE and not all(a in its for a, its in zip(symbol.arguments, members, strict=True)):
                continue  # what can't be so of these isn't
            if goal.setdefault(symbol, value) != value:
                raise KnowledgeError(f"{symbol} is wanted to be both {goal[symbol]} and {value}; drop one of the goals")
            if symbol not in problem.initial and not problem.domain.situations[symbol.situation].boolean:
                raise KnowledgeError(
                    f"<{iri}>: there is no {symbol}; the object or its situation type isn't in the scene"
                )
    return replace(problem, goal=dict(sorted(goal.items())))


def _wanted_value(iri: str, wanted: ValueCondition, known: Frame) -> str:
    """Return the value that a goal wants; of a negated one, what is left if not this.

    Raises
    ------
    KnowledgeError
        Several values are left.
    """
    if not wanted.negated:
        return wanted.value
    situation = known.domain.situations[wanted.situation]
    if situation.boolean:
        return FALSE if wanted.value == TRUE else TRUE
    left = [value for value in known.classes.get(situation.range, ()) if value != wanted.value]
    if len(left) != 1:
        raise KnowledgeError(
            f"<{iri}>: the goal says which value {wanted.situation} shall not have, and leaves {_some(left) or 'none'}; name the "
            "one that it shall have, or want a situation type that is defined"
        )
    return left[0]


def _wanted(schema: _Schema, iri: str, known: Frame) -> list[Condition]:
    """Return what a goal wants: of a class in the place of an individual, the same of each of the class."""
    found = schema.condition(iri)
    if not (isinstance(found, Witness) and schema.classes_in(iri)):
        return [found]
    wanted: list[Condition] = [found]
    while isinstance(found, Witness):
        *others, _ = found.conditions
        if others:
            raise KnowledgeError(
                f"<{iri}> wants something of all of a class whose individuals change; name a class that situations don't define, "
                "or want a situation type that is defined"
            )
        wanted = [
            substituted(one.conditions[-1], {one.variable: member})
            for one in wanted
            if isinstance(one, Witness)
            for member in known.classes.get(one.kind, ())
        ]
        found = found.conditions[-1]
    return [replace(one, negated=not one.negated) for one in wanted]


def _bounds(iri: str, wanted: Comparison) -> tuple[Symbol, str]:
    """Return of which symbol a goal wants an amount, and its bounds."""
    contrary = {"<": ">=", "<=": ">", ">=": "<", ">": "<="}
    sign = contrary.get(wanted.operator, "") if wanted.negated else wanted.operator
    if not sign or not isinstance(wanted.left, Amount) or not isinstance(wanted.right, Fraction):
        raise KnowledgeError(f"<{iri}>: a goal compares the amount of one object with a number, as <, <=, =, >= or >")
    symbol = Symbol(wanted.left.situation, wanted.left.arguments)
    return symbol, f"{sign}{written(wanted.right)}"


def _some(names: Sequence[str], most: int = 12) -> str:
    return ", ".join(names[:most]) + (", …" if len(names) > most else "")

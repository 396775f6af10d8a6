"""From the knowledge graph to the values of `confab.reasoner.symbols`: what is there, what can be done, what holds, what is wanted.

The graph is read in a few large queries; their rows become nodes (`confab.reasoner.reading.rows`), the nodes become conditions,
effects and behaviours (`confab.reasoner.reading.parts`) and goals (`confab.reasoner.reading.goals`), and all of them a problem:

============================  ==============================================
in the ontology               in `confab.reasoner.symbols`
============================  ==============================================
``:SituationType``            `SituationType`
``:Behavior``                 `Behavior`, its terms starting with ``?``
``:AbsenceCondition``         a negated `Witness`
``x valueProperty v``         the value of `Symbol` in `Problem.initial`
``:goal`` of the ``:Task``    `Problem.goal`
============================  ==============================================
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, product

from confab.reasoner.aggregates import compiled, in_order, read_by, unfolded, with_totals
from confab.reasoner.amounts import (
    Amount,
    Quantity,
    inside,
    written,
)
from confab.reasoner.condition_nodes import Node
from confab.reasoner.derivation import circles, needed
from confab.reasoner.graph.knowledge import SCENE, KnowledgeError, KnowledgeGraph, text
from confab.reasoner.language import DomainError, walk
from confab.reasoner.limits import check
from confab.reasoner.names import Names, local_name
from confab.reasoner.possible import values_at_fault
from confab.reasoner.reading import swrl
from confab.reasoner.reading.definitions import AXIOMS, EXPRESSIONS, Definitions
from confab.reasoner.reading.goals import check_arguments, with_task
from confab.reasoner.reading.parts import Parts
from confab.reasoner.reading.rows import (
    HIGHEST_LEVEL,
    HIGHEST_NUMBER,
    Member,
    Schema,
    Triple,
    classes_of,
    core_triple,
    derived_goals,
    index_of,
    is_a,
    nodes_of,
    ordered,
    stated,
    superclasses,
    whole_number,
)
from confab.reasoner.reading.times import with_times
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    Aggregate,
    AmountEffect,
    Behavior,
    Comparison,
    Domain,
    Parameter,
    Perceived,
    Problem,
    RelationCondition,
    Rule,
    SituationType,
    State,
    Symbol,
    ValueCondition,
    ValueEffect,
)
from confab.reasoner.vocabulary import CORE, EMBODIMENT, RDFS

TEXTS = tuple(CORE + name for name in ("update", "extends", "construct"))
"""What is said as text, which a store elsewhere doesn't write out."""
WITH_CLASS = ("AbsenceCondition", "ClassCondition")
KINDS = (
    "SituationType",
    "Behavior",
    "Term",
    "Condition",
    "Effect",
    "Level",
    "Span",
    "Task",
    "Relation",
    "Calculation",
    "Rule",
    "Window",
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
  UNION {{ ?node <{EMBODIMENT}perceiver>/<{EMBODIMENT}exclusive> ?value .
    BIND("exclusive" AS ?part) BIND(<{EMBODIMENT}exclusive> AS ?property) }}
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
ordered where that counts (`nodes_of`, `classes_of`, `_initial`).
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


@dataclass(frozen=True)
class Reading:
    """A scene as the planner takes it, with the table that leads from its names back to IRIs.

    `whole` tells whether all individuals of the scene are in it, or those only that its task can need
    (`confab.reasoner.reading.relevance`); `schema` is what it was read by.
    """

    problem: Problem
    names: Names
    schema: Schema
    whole: bool = True


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
    members = _members(graph)
    schema = read_schema(graph) if schema is None else schema
    facts = [stated(row, schema.numbers) for row in graph.select(FACTS, SCENE)]
    tuples = nodes_of(core_triple(row) for row in graph.select(TUPLES, SCENE))
    known = frame(schema, members)
    check("reading the scene")
    return reading_of(graph.scene, known, facts, tuples)


def read_names(graph: KnowledgeGraph) -> Names:
    """Return the short names of a whole scene, as `read` does, without what it says of them."""
    return _names(read_schema(graph), _members(graph))


def _members(graph: KnowledgeGraph) -> list[Member]:
    return [
        (text(who), text(kind), index_of(text(who), text(index))) for who, kind, index in graph.select(MEMBERS, SCENE)
    ]


def read_schema(graph: KnowledgeGraph) -> Schema:
    """Read what doesn't depend on how many individuals there are, in one query."""
    parts: dict[str, list[tuple[str, str, str]]] = defaultdict(list)
    for count, (part, *row) in enumerate(graph.solutions(SCHEMA, SCENE)):
        if not count % 4096:
            check("reading the scene")
        parts[text(part)].append(core_triple(row))
    written = [triple for triple in parts["node"] if graph.remote and triple[1] in TEXTS]
    if written:  # a store elsewhere has the text alone
        from confab.reasoner.updates.compiling import compiled

        found = compiled(lambda query: graph.select(query, SCENE), {}, graph.prefixes)
        if found.faults:
            raise KnowledgeError(str(found.faults[0]))
        parts["node"] += [core_triple(triple) for triple in found.triples]  # type: ignore[arg-type]
    return Schema(
        nodes=nodes_of(parts["node"]),
        supers=superclasses(sorted((sub, sup) for sub, _, sup in parts["class"])),
        owners=sorted((kind, situation) for kind, _, situation in parts["owner"]),
        pairs=frozenset(situation for situation, _, _ in parts["pair"])
        - {situation for situation, _, kind in parts["node"] if kind == CORE + "Amount"},
        whole=frozenset(situation for situation, _, kind in parts["range"] if kind.endswith("integer")),
        from_levels={
            value: whole_number(level, f"<{value}>: :fromLevel", 0, HIGHEST_LEVEL) for value, _, level in parts["level"]
        },
        facts=nodes_of(parts["fact"]),
        tuples=bool(parts["tuples"]),
        expressions=nodes_of(parts["expression"]),
        axioms=nodes_of(parts["axiom"]),
        swrl=nodes_of(parts["swrl"]),
        ontologies=sorted(iri for iri, _, _ in parts["ontology"]),
        exclusive=frozenset(situation for situation, _, value in parts["exclusive"] if value in ("true", "1")),
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
    parts = Parts(schema.nodes, names, terms, set(schema.pairs), Definitions({}, {}, names), schema.individuals_of)
    return {iri: parts.behavior(iri) for iri in behaviors}


@dataclass(frozen=True)
class Frame:
    """A schema as values, for some individuals: everything of a problem but its facts and its goal.

    `properties` leads from the IRI of a value property to the name of its situation type, and whether it takes many values;
    `lifted` are the behaviours with effects for all of a class still in one.
    """

    schema: Schema
    parts: Parts
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
    names = _names(schema, instances, namesakes)
    definitions = _definitions(schema, names)
    terms = set(schema.of_kind("Parameter", "Variable"))
    parts = Parts(nodes, names, terms, set(schema.pairs), definitions, schema.individuals_of)
    classes, parents = classes_of(instances, supers, names)
    situations, properties = _situations(parts, schema, classes)
    if earlier is not None and earlier.names.agree(names):
        lifted = earlier.lifted
    else:
        in_order = sorted(ordered(schema.of_kind("Behavior"), nodes, names), key=parts.level)
        lifted = {names.short(iri): parts.behavior(iri) for iri in in_order}
    rules = _rules(parts, schema, {s.name: s for s in situations})
    aggregates = _aggregates(parts, schema, {s.name: s for s in situations}, rules)
    domain = Domain(
        situations={s.name: s for s in _on_their_levels(situations, rules, aggregates)},
        behaviors=lifted,
        first_ids={
            parts.level(iri): parts.number(iri, "firstId", 0, HIGHEST_NUMBER, 0) for iri in schema.of_kind("Level")
        },
        rules=rules,
        aggregates=aggregates,
    )
    for behavior in lifted.values():
        _check_behavior(behavior, domain)
    following: list[Rule | Aggregate] = [*chain.from_iterable(rules.values()), *aggregates.values()]
    for one in following:
        _check_behavior(replace(one.behavior, level=domain.situations[one.situation].level), domain)
    _asked(domain)
    try:
        domain = compiled(domain, classes)
    except DomainError as error:
        raise KnowledgeError(str(error)) from None
    return Frame(schema, parts, domain, classes, parents, properties, lifted)


def _names(schema: Schema, members: Iterable[Member], namesakes: Iterable[str] = ()) -> Names:
    """Return short names of a schema's terms, of some individuals, and of others that may end alike."""
    nodes = schema.nodes
    typed = (nodes[iri] for iri in schema.of_kind("Parameter", "Variable", *WITH_CLASS))
    derived = {*derived_goals(schema)}
    return Names(
        {
            *schema.of_kind("SituationType", "Behavior", "Relation", "ReachRelation"),
            *(iri for iri in namesakes if iri not in nodes),
            *derived,
            *(task for task in schema.of_kind("Task") if derived.intersection(nodes[task].get(CORE + "goal", ()))),
            *chain.from_iterable((individual, kind) for individual, kind, _ in members if individual not in nodes),
            *chain.from_iterable((sub, *above) for sub, above in schema.supers.items()),
            *(kind for node in typed for name in ("termType", "ofClass") for kind in node.get(CORE + name, ())),
        }
    )


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
    initial = with_totals(known.domain, known.classes, relations, initial)
    check_values(initial, known.domain, names)
    levels = {names.short(iri): level for iri, level in schema.from_levels.items() if iri not in schema.nodes}
    problem = Problem(scene, known.domain, known.classes, relations, initial, {}, known.parents, levels)
    wanted = with_task(problem, known.parts, schema.of_kind("Task"))
    return Reading(with_times(wanted, known.parts, schema), names, schema, whole)


def _rules(parts: Parts, schema: Schema, situations: Mapping[str, SituationType]) -> dict[str, tuple[Rule, ...]]:
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
        if not parts.values(iri, "aggregate"):
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
                mend = (
                    "state the :aggregate of the rule"
                    if situations[name].quantity
                    else "make its value property not functional"
                )
                raise KnowledgeError(
                    f"<{iri}> is defined by <{min(by)}>, but has values; what is defined is true or false, or an amount that is "
                    f"aggregated: {mend}"
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


def _aggregates(
    parts: Parts,
    schema: Schema,
    situations: Mapping[str, SituationType],
    rules: Mapping[str, Sequence[Rule]],
) -> dict[str, Aggregate]:
    """Return the derived amounts, each behind those that it reads.

    Raises
    ------
    KnowledgeError
        A behaviour changes one, one has two rules, isn't an amount, or depends on itself.
    """
    found: dict[str, Aggregate] = {}
    for iri in schema.of_kind("Rule"):
        if not parts.values(iri, "aggregate"):
            continue
        situation = parts.one(iri, "situationType")
        name = parts.names.short(situation)
        if name in found:
            raise KnowledgeError(f"<{iri}>: {name} has two rules; a derived amount has one", iri)
        for effect in schema.of_kind("AmountEffect"):
            if list(parts.values(effect, "situationType")) == [situation]:
                raise KnowledgeError(
                    f"<{effect}> changes {name}, which is defined by <{iri}>; take the effect out, or drop the rule",
                    effect,
                )
        try:
            found[name] = unfolded(parts.aggregate(iri, situations[name].arguments), rules)
        except DomainError as error:
            raise KnowledgeError(f"<{iri}>: {error}", iri) from None
    try:
        return {one.situation: one for one in in_order(found)}
    except DomainError as error:
        raise KnowledgeError(str(error), parts.names.iri(str(error).split()[0])) from None


def _on_their_levels(
    situations: Iterable[SituationType],
    rules: Mapping[str, Sequence[Rule]],
    aggregates: Mapping[str, Aggregate],
) -> Iterator[SituationType]:
    """Yield situation types; what is defined exists from the level on that has all that it is defined by."""
    known = {s.name: s for s in situations}
    before = None
    reads = {name: {s for rule in its for s, _ in needed(rule.conditions)} for name, its in rules.items()}
    reads |= {name: {*read_by(one)} for name, one in aggregates.items()}
    while before != known:
        before = dict(known)
        for name, its in reads.items():
            read = its | {name}
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
    nodes = {**schema.expressions, **schema.axioms, **schema.swrl}
    found = Definitions(nodes, properties, names, schema.numbers, kinds)
    concluded = {}
    of_rules = {*found.recursive, *(swrl.heads(schema.swrl) if schema.swrl else ())}
    ruled = {one for rule in schema.of_kind("Rule") for one in schema.nodes[rule].get(CORE + "situationType", ())}
    for iri in schema.of_kind("SituationType") if of_rules or ruled else ():
        for kind in schema.nodes[iri].get(CORE + "holdsOf", ()):
            if kind in of_rules or iri in ruled:
                concluded[kind] = iri, owners[iri][0] if len(owners[iri]) == 1 else ""
    return replace(found, concluded=concluded)


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
    conditions = [inner for condition in behavior.conditions for inner in walk(condition)]
    compared = [side for c in conditions if isinstance(c, Comparison) for side in (c.left, c.right)]
    amounts = (*compared, *(effect.amount for effect in behavior.amounts))
    parts = (
        *conditions,
        *behavior.effects,
        *behavior.amounts,
        *(part for amount in amounts for part in inside(amount)),
    )
    for part in parts:
        if not isinstance(part, ValueCondition | ValueEffect | AmountEffect | Amount):
            continue
        situation = domain.situations[part.situation]
        if len(part.arguments) != len(situation.arguments):
            raise KnowledgeError(
                f"{behavior.name} speaks of {part.situation} with {len(part.arguments)} arguments; it has "
                f"{len(situation.arguments)}: correct the condition or effect, or say what has that situation type"
            )
        if situation.level > behavior.level:
            raise KnowledgeError(
                f"{behavior.name} on level {behavior.level} speaks of {part.situation}, which exists from level "
                f"{situation.level} on; correct the behaviour's :level or the situation type's :fromLevel"
            )


def _situations(
    schema: Parts, read: Schema, classes: dict[str, tuple[str, ...]]
) -> tuple[list[SituationType], dict[str, tuple[str, bool]]]:
    """Return the situation types by name, and for each value property its situation type and whether it is boolean."""
    found, properties = [], {}
    for iri in sorted(read.of_kind("SituationType"), key=schema.names.short):
        name = schema.names.short(iri)
        owning = [schema.names.short(kind) for kind, situation in read.owners if situation == iri]
        parameters = [schema.parameter(p) for p in ordered(schema.values(iri, "parameter"), schema.nodes, schema.names)]
        arguments = tuple(p.kind for p in parameters) or ((_union(owning, classes),) if owning else ())
        value_property = schema.values(iri, "valueProperty")
        # A value property says so even where no individual that was read is one of its values.
        boolean = not value_property and set(classes.get(name, ())) <= {TRUE, FALSE}
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
                perceived=_perceived(schema, iri, iri in read.exclusive),
            )
        )
        if quantity and (amount := schema.decimal(iri, "defaultAmount")) is not None:
            found[-1] = replace(found[-1], default=written(amount))
    return found, properties


def _perceived(schema: Parts, iri: str, exclusive: bool) -> Perceived | None:
    """Return how a situation type is perceived; None if nothing perceives it."""
    node = schema.nodes[iri]
    if not (perceivers := node.get(EMBODIMENT + "perceiver")):
        return None
    special = (
        (local_name(prop), schema.names.short(value))
        for prop, values in sorted(node.items())
        if prop.startswith(EMBODIMENT + "value")
        for value in values
    )
    return Perceived(local_name(perceivers[0]), exclusive, tuple(special))


def _quantity(schema: Parts, iri: str, whole: bool) -> Quantity | None:
    if not is_a(schema.nodes[iri], "Amount"):
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
    facts = Parts(tuples, names, set(), set(), Definitions({}, {}, names))
    of_tuples: dict[str, tuple[str, tuple[str, ...]]] = {}
    for iri, node in tuples.items():
        if CORE + "relation" in node:
            individuals = (*facts.arguments(iri), *(names.short(v) for v in facts.values(iri, "value")))
            relation, amount = names.short(facts.one(iri, "relation")), facts.decimal(iri, "amount")
            if amount is None:
                of_tuples[iri] = relation, individuals
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
        if symbol.situation in domain.aggregates:
            raise KnowledgeError(
                f"{symbol} is stated, but a rule defines it; drop the fact, or the rule of {symbol.situation}",
                names.iri(symbol.arguments[0]) if symbol.arguments[0] in names else "",
            )
        check_arguments(symbol, domain, "a fact")
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
                    "or drop what is too much",
                    next((iri for iri, said in of_tuples.items() if said == (relation, row)), ""),
                )
    return {name: frozenset(pairs) for name, pairs in sorted({**relations, **numbered}.items())}, stated


def _asked(domain: Domain) -> dict[str, int]:
    """Return how many individuals conditions name for each relation without a number; raise `KnowledgeError` if they differ."""
    found: dict[str, int] = {}
    rules = [rule.behavior for its in domain.rules.values() for rule in its]
    rules += [aggregate.behavior for aggregate in domain.aggregates.values()]
    for behavior in (*domain.behaviors.values(), *rules):
        for one in (inner for condition in behavior.conditions for inner in walk(condition)):
            if not isinstance(one, RelationCondition):
                continue
            if found.setdefault(one.relation, len(one.arguments)) != len(one.arguments):
                fewest, most = sorted((found[one.relation], len(one.arguments)))
                raise KnowledgeError(
                    f"conditions of {one.relation} name {fewest} individuals here and {most} there; let all of them name as many"
                )
    return found


def _check_numbers(relation: str, rows: Iterable[tuple[str, ...]], bare: Collection[tuple[str, ...]]) -> None:
    """Raise `KnowledgeError` if a relation gives two numbers for the same individuals, or for some none."""
    for row in bare:
        raise KnowledgeError(f"{relation} of {', '.join(row)} has no number, where others have one; say its :amount")
    found: dict[tuple[str, ...], str] = {}
    for *individuals, value in sorted(rows):
        if (old := found.setdefault(tuple(individuals), value)) != value:
            raise KnowledgeError(f"{relation} of {', '.join(individuals)} is {old} and {value}; state one number")


def _initial(
    domain: Domain, classes: Mapping[str, tuple[str, ...]], stated: Mapping[Symbol, set[str]], names: Names
) -> dict[Symbol, str]:
    initial = {}
    for situation in domain.situations.values():
        if situation.boolean or situation.name in domain.aggregates:
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
    members = {kind: frozenset(those) for kind, those in classes.items()}
    for symbol in sorted(
        s for s, values in stated.items() if domain.situations[s.situation].boolean and TRUE in values
    ):
        kinds = domain.situations[symbol.situation].arguments
        if all(a in members.get(kind, ()) for a, kind in zip(symbol.arguments, kinds, strict=True)):
            initial[symbol] = TRUE  # of others it isn't asked
    return initial


def check_values(state: State, domain: Domain, names: Names) -> None:
    """Raise `KnowledgeError` if a symbol has a value that is declared nowhere, or an amount that it can't have."""
    for fault in values_at_fault(state, domain, names):
        about = next(iter(fault.symbol.arguments), "")
        raise KnowledgeError(str(fault), names.iri(about) if about in names else "")

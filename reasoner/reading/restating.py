"""Copies of a scene's graph with other facts, other goals or additional refutations.

A refutation (`confab.reasoner.refutations`) becomes a precondition.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from hashlib import sha256

import pyoxigraph as ox

from confab.reasoner.amounts import bounds, written
from confab.reasoner.condition_nodes import Properties, equality_properties, symbol_properties, triples
from confab.reasoner.derivation import TASK
from confab.reasoner.files import as_iri_part
from confab.reasoner.graph.knowledge import BASE, SCENE, KnowledgeError, KnowledgeGraph, text
from confab.reasoner.possible import ImpossibleStateError, earlier_states, refuse_derived, refuse_impossible
from confab.reasoner.reading.frame import frame
from confab.reasoner.reading.goals import symbols_of
from confab.reasoner.reading.problem import Reading, members_of
from confab.reasoner.refutations import Refutation
from confab.reasoner.symbols import FALSE, TRUE, Fact, Symbol
from confab.reasoner.vocabulary import ARGUMENTS, CORE, INDIVIDUAL, LABEL, TYPE, XSD

VALUE_PROPERTIES = "SELECT ?situation ?property WHERE { ?situation :valueProperty ?property }"
STATED = "SELECT ?node ?property ?value WHERE { ?node a :SituatedObjectInstance ; ?property ?value }"
TASKS = "SELECT DISTINCT ?task WHERE { ?task a/rdfs:subClassOf* :Task } ORDER BY ?task"
PARAMETERS = "SELECT ?behavior ?term WHERE { ?behavior :parameter ?term . ?term :index ?index } ORDER BY ?index"

DECIMAL = ox.NamedNode(XSD + "decimal")

Node = Mapping[str, str]


def with_facts(graph: KnowledgeGraph, reading: Reading, facts: Sequence[Fact]) -> KnowledgeGraph:
    """Return a copy of a graph in which the given facts replace the facts about the same symbols.

    The caller has to run inference on the copy.

    Raises
    ------
    KnowledgeError
        The facts are inconsistent with the rest of the state.
    """
    initial = reading.problem.initial
    try:
        refuse_derived(reading.problem.domain, facts)
        after = {**initial, **{fact.symbol: fact.value for fact in facts}}
        refuse_impossible(reading.problem, initial, after | earlier_states(reading.problem.domain, after))
    except ImpossibleStateError as error:
        raise KnowledgeError(f"{', '.join(map(str, facts))}: {error}") from error
    copy = copied(graph)
    properties = value_properties(graph)
    for fact in facts:
        symbol, iri = fact.symbol, reading.names.iri
        about, prop = ox.NamedNode(iri(symbol.arguments[0])), properties.get(iri(symbol.situation))
        if prop:
            pair = iri(symbol.situation) in reading.schema.pairs
            _remove(copy, about, ox.NamedNode(prop), ox.NamedNode(iri(symbol.arguments[1])) if pair else None)
        for node in _about(copy, reading, symbol):
            _remove(copy, node)
        name = as_iri_part(".".join(("fact", *symbol.arguments, symbol.situation)))
        node = ox.NamedNode(f"{graph.scene.rstrip('#/')}#{name}")
        copy.extend("asserted", said(reading, fact, prop, node))
        if fact.value == FALSE and reading.problem.domain.situations[symbol.situation].default == TRUE:
            stated = symbol_properties(iri(symbol.situation), [*map(iri, symbol.arguments)], CORE + FALSE)
            copy.extend("asserted", triples(node, {TYPE: [CORE + "SituatedObjectInstance"], **stated}))
    return copy


def with_goals(graph: KnowledgeGraph, reading: Reading, goals: Sequence[Fact]) -> KnowledgeGraph:
    """Return a copy of a graph in which the given goals replace the goals for the same symbols.

    Raises
    ------
    KnowledgeError
        A goal isn't a fact, but stands for the conditions of a compound goal.
    """
    copy = copied(graph)
    for goal in goals:
        if reading.problem.domain.situations[goal.symbol.situation].arguments == (TASK,):
            raise KnowledgeError(
                f"'{goal}' stands for the conditions of {goal.symbol.situation}, and only facts can be given as goals; "
                "with_goal keeps this goal of the scene; without_goal removes it; a file can state other conditions"
            )
    others = _unstate_goals(copy, reading, {goal.symbol for goal in goals})
    _state_goals(copy, reading, [*others, *goals])
    return copy


def _state_goals(graph: KnowledgeGraph, reading: Reading, goals: Sequence[Fact]) -> None:
    """Add goals to the task of a graph."""
    task = next((text(row[0]) for row in graph.select(TASKS)), f"{graph.scene.rstrip('#/')}#task")
    graph.add("asserted", [(task, TYPE, INDIVIDUAL), (task, TYPE, CORE + "Task")])
    for goal in goals:
        for number, part in enumerate(goal.value.split(",")):  # two bounds of an amount are two goals
            name = ".".join(("goal", *goal.symbol.arguments, goal.symbol.situation, *[str(number)] * bool(number)))
            node = ox.NamedNode(f"{graph.scene.rstrip('#/')}#{as_iri_part(name)}")
            graph.add("asserted", [(task, CORE + "goal", node.value)])
            graph.extend("asserted", _wanted(reading, replace(goal, value=part), node))


def without_goals(graph: KnowledgeGraph, reading: Reading, goals: Sequence[Fact]) -> KnowledgeGraph:
    """Return a copy of a graph without the goals for the symbols of the given facts.

    If a goal node states several goals, the other goals of the node are stated one by one.

    Raises
    ------
    KnowledgeError
        Another goal of such a node isn't a fact, or has a weight.
    """
    copy = copied(graph)
    _state_goals(copy, reading, _unstate_goals(copy, reading, {goal.symbol for goal in goals}))
    return copy


def _unstate_goals(graph: KnowledgeGraph, reading: Reading, symbols: Collection[Symbol]) -> list[Fact]:
    """Remove the nodes of the goals for some symbols from a graph; return the other goals of these nodes."""
    problem, parts, others = reading.problem, frame(reading.schema, members_of(graph)).parts, set[Symbol]()
    for task in reading.schema.of_kind("Task"):
        for iri in parts.values(task, "goal"):
            found = symbols_of(problem, parts, task, iri)
            if found.isdisjoint(symbols):
                continue
            rest = sorted(found.difference(symbols))
            if alone := [one for one in rest if one in problem.weights or parts.names.short(task) in one.arguments]:
                raise KnowledgeError(
                    f"<{iri}> states {len(found)} goals, of which '{alone[0]}' can't remain alone; also remove it"
                )
            others.update(rest)
            node = ox.BlankNode(iri.removeprefix("_:")) if iri.startswith("_:") else ox.NamedNode(iri)
            _remove(graph, None, ox.NamedNode(CORE + "goal"), node)
            _remove(graph, node)
    return [Fact(symbol, problem.goal[symbol]) for symbol in sorted(others)]


def with_refuted(graph: KnowledgeGraph, reading: Reading, refutations: Sequence[Refutation]) -> KnowledgeGraph:
    """Return a copy of a graph with additional refutations, stored in the graph of the scene's geometry."""
    copy = copied(graph)
    copy.extend("reach", (triple for one in refutations for triple in refuted(graph, reading, one)))
    return copy


def refuted(graph: KnowledgeGraph, reading: Reading, one: Refutation) -> Iterator[ox.Triple]:
    """Yield the triples of a refutation, which becomes a precondition.

    With the arguments of the refutation, the behaviour isn't applicable while the facts hold.
    """
    behavior = reading.names.iri(one.behavior)
    terms = [row[1] for row in graph.select(PARAMETERS, SCENE, behavior=behavior)]
    if len(terms) != len(one.arguments):
        raise KnowledgeError(f"{one}: {one.behavior} has {len(terms)} parameters with an index")
    digest = sha256(repr(replace(one, why="")).encode()).hexdigest()[:8]
    node = ox.NamedNode(f"{graph.scene.rstrip('#/')}.reach#refuted-{digest}")
    every = ox.NamedNode(f"{node.value}.all")
    yield ox.Triple(ox.NamedNode(behavior), ox.NamedNode(CORE + "precondition"), node)
    yield from _individual(node, "AnyOf", str(one), {"negated": ["true"], "alternative": [every.value]})
    yield from _individual(every, "AllOf", "all of this", {})
    for number, (term, argument) in enumerate(zip(terms, one.arguments, strict=True), 1):
        if not argument:
            continue  # an empty argument stands for all individuals
        part = ox.NamedNode(f"{node.value}.argument{number}")
        yield ox.Triple(every, ox.NamedNode(CORE + "condition"), part)
        same = equality_properties(text(term), reading.names.iri(argument))
        yield from _individual(part, "EqualityCondition", f"it is {argument}", same)
    for number, fact in enumerate(one.facts, 1):
        part = ox.NamedNode(f"{node.value}.fact{number}")
        yield ox.Triple(every, ox.NamedNode(CORE + "condition"), part)
        yield from _wanted(reading, fact, part)


def value_properties(graph: KnowledgeGraph) -> dict[str, str]:
    """Return a mapping of the situation types with a value property to this property; keys and values are IRIs."""
    return {text(situation): text(prop) for situation, prop in graph.select(VALUE_PROPERTIES, SCENE)}


def said(reading: Reading, fact: Fact, prop: str | None, node: ox.BlankNode | ox.NamedNode) -> Iterator[ox.Triple]:
    """Yield the triples of a fact: one triple with its value property if possible, otherwise the triples of a node.

    A false fact has no triples.
    """
    iri, symbol, value = reading.names.iri, fact.symbol, fact.value
    if value == FALSE:
        return
    arguments = [ox.NamedNode(iri(argument)) for argument in symbol.arguments]
    number = ox.Literal(value, datatype=DECIMAL) if _counted(reading, symbol) else None
    if prop and number and len(arguments) == 1:
        yield ox.Triple(arguments[0], ox.NamedNode(prop), number)
        return
    if prop and len(arguments) + (value != TRUE) == 2:
        tail = arguments[1] if value == TRUE else ox.NamedNode(iri(value))
        yield ox.Triple(arguments[0], ox.NamedNode(prop), tail)
        return
    stated = None if number or value == TRUE else iri(value)
    properties = symbol_properties(iri(symbol.situation), [*map(iri, symbol.arguments)], stated)
    amount = {"amount": [value]} if number else {}
    yield from triples(node, {TYPE: [CORE + "SituatedObjectInstance"], **properties, **amount})


def _counted(reading: Reading, symbol: Symbol) -> bool:
    return reading.problem.domain.situations[symbol.situation].quantity is not None


def _wanted(reading: Reading, goal: Fact, node: ox.NamedNode) -> Iterator[ox.Triple]:
    """Yield the triples of the value condition or comparison that is equivalent to a fact."""
    iri, symbol, value = reading.names.iri, goal.symbol, goal.value
    situation, arguments = iri(symbol.situation), [*map(iri, symbol.arguments)]
    if _counted(reading, symbol):
        [(sign, limit)] = bounds(value)
        compared = {"sign": [sign], "amount": [written(limit)], **symbol_properties(situation, arguments)}
        yield from _individual(node, "Comparison", str(goal), compared)
        return
    pair = situation in reading.schema.pairs
    wanted = CORE + value if value in (TRUE, FALSE) else iri(value)
    if pair:
        *arguments, wanted = arguments
    negated = {"negated": ["true"]} if pair and value == FALSE else {}
    properties = {**negated, **symbol_properties(situation, arguments, wanted)}
    yield from _individual(node, "ValueCondition", str(goal), properties)


def _individual(node: ox.NamedNode, kind: str, label: str, properties: Properties) -> Iterator[ox.Triple]:
    """Yield the triples of a node: its core class, its label and its properties."""
    yield from triples(node, {TYPE: [INDIVIDUAL, CORE + kind]})
    yield ox.Triple(node, ox.NamedNode(LABEL), ox.Literal(label, language="en"))
    yield from triples(node, properties)


def _about(graph: KnowledgeGraph, reading: Reading, symbol: Symbol) -> list[ox.NamedNode | ox.BlankNode]:
    """Return the nodes of the facts about a symbol."""
    nodes: dict[ox.NamedNode | ox.BlankNode, dict[str, str]] = {}
    for node, prop, value in graph.select(STATED, SCENE):
        if isinstance(node, ox.NamedNode | ox.BlankNode):
            nodes.setdefault(node, {})[text(prop).removeprefix(CORE)] = text(value)
    return [node for node, parts in nodes.items() if _symbol(parts, reading) == symbol]


def _symbol(node: Node, reading: Reading) -> Symbol:
    terms = [node[name] for name in ARGUMENTS if name in node]
    if node.get("situationType") in reading.schema.pairs and "value" in node:
        terms.append(node["value"])
    return Symbol(reading.names.short(node.get("situationType", "")), tuple(map(reading.names.short, terms)))


def _remove(
    graph: KnowledgeGraph,
    subject: ox.NamedNode | ox.BlankNode | None,
    predicate: ox.NamedNode | None = None,
    value: ox.NamedNode | ox.BlankNode | None = None,
) -> None:
    for name in SCENE:
        for quad in list(graph.store.quads_for_pattern(subject, predicate, value, ox.NamedNode(BASE + name))):
            graph.store.remove(quad)


def copied(graph: KnowledgeGraph) -> KnowledgeGraph:
    """Return a copy of a graph; raise `KnowledgeError` if the graph is at a SPARQL endpoint."""
    if graph.remote:
        raise KnowledgeError(f"{graph.scene}: a remote store is only read; change it with its own tools")
    store = ox.Store()
    store.bulk_load(input=graph.store.dump(format=ox.RdfFormat.N_QUADS), format=ox.RdfFormat.N_QUADS)
    return replace(graph, store=store, files=dict(graph.files), prefixes=dict(graph.prefixes), round_trips=0)

"""Task recognition: finds the individuals of a large world that a task can need, by few queries.

The slice is closed: if a behaviour can change a situated object of the slice, the slice also contains all individuals in its
conditions and its other effects. So planning in the slice and planning in the whole world have the same answer
(the proof is in docs/quantification.md, the tests in tests/reasoner/test_recognition.py and test_closure.py). Two steps:

1. `routes` examines the behaviours alone. For each behaviour that can change a situated object, it finds routes from that object
   to the other terms of its preconditions and effects: forward over a value (the place of the object), over a static
   relation (a hand that reaches the place), or backward from a value (other objects at the place). For a term without a
   route, all individuals of its class are needed.
2. `recognise` starts from the individuals of the goal and follows the routes in the graph, one round per query, until no new
   individual is found: then no individual outside the slice can help, so a task without a plan in the slice has no plan.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import TypeAlias

import pyoxigraph as ox

from confab.reasoner.aggregates.dependencies import read_by
from confab.reasoner.amounts import situations_in, terms_of
from confab.reasoner.graph.knowledge import SCENE, KnowledgeError, KnowledgeGraph, text
from confab.reasoner.language import situations_of, terms
from confab.reasoner.limits import check
from confab.reasoner.names import local_name
from confab.reasoner.reading.frame import Frame, frame
from confab.reasoner.reading.goals import BOUNDS, with_goals
from confab.reasoner.reading.individuals import FACT, PLACES, Individuals, constants_of, goal_conditions, values_of
from confab.reasoner.reading.problem import Reading, read, reading_of
from confab.reasoner.reading.rows import Member, Schema, Triple, derived_goals
from confab.reasoner.reading.schema import read_schema
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    Aggregate,
    AmountEffect,
    AnyOf,
    Behavior,
    Condition,
    Effect,
    RelationCondition,
    ValueCondition,
    ValueEffect,
    Witness,
)
from confab.reasoner.vocabulary import CORE, PREFIXES, TYPE

ROUNDS = 6
"""Maximum number of queries that follow routes by one step each; after them, one property path closes the slice."""
FREE, RELATION, BACKWARD, FROM_CONSTANT = range(4)  # the cheapest of the steps that reach a term is taken


@dataclass
class Routes:
    """Routes from relevant individuals to others, as IRIs.

    `forward` has the properties that are followed from subject to object. `backward` has the properties that are followed from
    object to subject, each with the constants from which it is followed, too. (A constant is a value that a behaviour names,
    such as "nothing"; many symbols may have it.) `classes` has the classes whose individuals are all relevant.
    """

    forward: set[str] = field(default_factory=set)
    backward: dict[str, set[str]] = field(default_factory=dict)
    classes: set[str] = field(default_factory=set)


def recognise(graph: KnowledgeGraph, goals: Sequence[str] = ()) -> Reading:
    """Read the individuals of a scene that its task can need; the number of queries doesn't depend on their number.

    Parameters
    ----------
    graph : KnowledgeGraph
    goals : sequence of str
        Goals that replace some of the task's, as in `confab.reasoner.reading.problem.with_goals`; their individuals are read, too.

    Returns
    -------
    Reading
        Like the result of `confab.reasoner.reading.problem.read`, with fewer individuals. IDs number these individuals.

    Raises
    ------
    KnowledgeError
        As `confab.reasoner.reading.problem.read`, for the individuals that matter.

    Examples
    --------
    >>> from confab.reasoner.graph.knowledge import load
    >>> recognise(load("beverage-serving")).problem.classes["Movable"]
    ('bottle1', 'bottle2', 'cup1', 'cup2')
    """
    schema = read_schema(graph)
    if derived_goals(schema):
        reading = read(graph, schema)  # their alternatives may be about any individual
        return replace(reading, problem=with_goals(reading.problem, goals))
    constants = constants_of(schema)
    seeds = _goal_individuals(schema) | _named(graph, schema, goals)
    search = _Search(graph, schema)
    if nameless := sorted(term for term in seeds | constants if ":" not in term):
        raise KnowledgeError(
            f"a condition, an effect or a goal leads to something without a name (_:{nameless[0]}), where an individual belongs"
        )
    fresh = search.visit(seeds | constants)
    check("recognising what the task needs")
    lifted = frame(schema, [member for member in search.members() if member[0] in constants])
    bounds = routes(lifted, [goal.split()[1] for goal in goals if " " in goal.strip()])
    search.close(fresh, constants, bounds)
    members = search.members()
    known = frame(schema, members, _namesakes(graph, schema, members), lifted)
    reading = reading_of(graph.scene, known, search.facts(known), search.tuples(), whole=False)
    return replace(reading, problem=with_goals(reading.problem, goals))


# ------------------------------------------------------------------------------------------------- 1. what leads to what


def routes(known: Frame, more_situations: Iterable[str] = ()) -> Routes:
    """Return the routes from the individuals of a goal to all individuals that relevant steps can involve or change.

    A behaviour counts if it changes a situation type that counts; a rule counts if it defines one. All situation types in the
    conditions and effects of a counting behaviour or rule count, too. If a fact is looked up from some of its terms, routes
    also lead from these terms in effects to the other terms of the behaviour.

    Parameters
    ----------
    known : Frame
        Of the constants alone.
    more_situations : iterable of str
        Situation types that count besides those of the task's goals.
    """
    found = Routes(forward=set(known.properties) - known.schema.numbers, classes=_goal_classes(known.schema))
    counting = {known.names.short(s) for s in _goal_situations(known.schema)} | set(more_situations)
    looked_up: LookedUp = {}
    rules = (rule.behavior for its in known.domain.rules.values() for rule in its)
    aggregates = [_Doing(one.behavior, {*one.kinds}) for one in known.domain.aggregates.values()]
    doing = [*(_Doing(behavior) for behavior in (*known.lifted.values(), *rules)), *aggregates]
    for total in aggregates:
        total.follow(
            known, found, looked_up
        )  # each total in the slice follows from all of its facts, also if no step counts
    changed = set[str]()
    before = -1
    while before != (before := len(counting) + len(changed) + len(looked_up) + sum(map(len, looked_up.values()))):
        for one in doing:
            if one.behavior.changes & counting:
                one.follow(known, found, looked_up)
                counting |= one.situations
                changed |= one.behavior.changes
        for aggregate in known.domain.aggregates.values():
            quantity = known.domain.situations[aggregate.situation].quantity
            if quantity is not None and quantity.bounded and read_by(aggregate) & changed:
                counting.add(aggregate.situation)  # its bound may forbid a step
                _span_to_totals(aggregate, changed, known, found, looked_up)
    return found


def _span_to_totals(aggregate: Aggregate, changed: set[str], known: Frame, found: Routes, looked_up: LookedUp) -> None:
    """Add the routes from facts that relevant steps change to the individuals whose derived amounts follow from these facts."""
    kinds = {term.name: term.kind for term in (*aggregate.parameters, *aggregate.variables)}
    named, left = {parameter.name for parameter in aggregate.parameters}, read_by(aggregate) & changed
    for scope in _scopes(aggregate.conditions, kinds):
        for condition in scope.conditions:
            if isinstance(condition, ValueCondition) and condition.situation in changed:
                start = {*condition.arguments, condition.value} - {TRUE, FALSE}
                _span(scope, start, named, known, found, looked_up)
                left -= {condition.situation}
    if left:  # the facts are read in another way
        found.classes.update(known.names.iri(parameter.kind) for parameter in aggregate.parameters)


LookedUp: TypeAlias = "dict[tuple[str, int], set[str]]"
"""Positions among the terms of situation types from which symbols are looked up, each with the constants that may occur there."""


class _Doing:
    """A behaviour or rule as recognition follows it: from each effect to the whole step, and from the step to all of its changes.

    Attributes
    ----------
    situations : set of str
        The situation types in its conditions and effects.
    step : set of str
        The parameters, the variables in positive conditions, and the variables that are `always` needed: a total also counts
        the individuals of a variable without a condition.
    """

    def __init__(self, behavior: Behavior, always: Collection[str] = ()) -> None:
        self.behavior = behavior
        self.asks = _scopes(behavior.preconditions, behavior.kinds)
        self.step = {t for c in self.asks[0].conditions for t in terms(c)} & behavior.kinds.keys()
        self.step |= {*always, *(parameter.name for parameter in behavior.parameters)}
        self.effects = []
        for effect in behavior.every_effect:
            kinds = {**behavior.kinds, **({effect.each.name: effect.each.kind} if effect.each else {})}
            self.effects.append((effect, _scopes((*behavior.preconditions, *effect.when), kinds), _terms_in(effect)))
        amounts = [situations_in(effect.amount) for effect in behavior.amounts]
        scopes = [*self.asks, *(scope for _, scopes, _ in self.effects for scope in scopes)]
        asked = (s for scope in scopes for condition in scope.conditions for s in situations_of(condition))
        self.situations = behavior.changes.union(asked, *amounts)
        self.spanned = set[tuple[int, frozenset[str]]]()

    def follow(self, known: Frame, found: Routes, looked_up: LookedUp) -> None:
        """Add the routes to all individuals of a behaviour that changes a relevant symbol, and to all symbols that it changes."""
        if not self.spanned:
            for scope in self.asks[1:]:  # negated conditions, and alternatives
                _span(scope, self.step, set(), known, found, looked_up)
            for _, (first, *groups), named in self.effects:
                _span(first, self.step, named, known, found, looked_up)
                for scope in groups:
                    _span(scope, self.step | named, set(), known, found, looked_up)
        for number, (effect, (first, *_), named) in enumerate(self.effects):
            for start in (frozenset(effect.arguments), *_given(effect, looked_up)):
                if (number, start) not in self.spanned:
                    self.spanned.add((number, start))
                    _span(first, set(start), self.step | named, known, found, looked_up)


def _terms_in(effect: Effect) -> set[str]:
    """Return the terms of an effect: its arguments and its value."""
    given = (effect.value,) if isinstance(effect, ValueEffect) else terms_of(effect.amount)
    return {*effect.arguments, *given} - {TRUE, FALSE}


def _given(effect: Effect, looked_up: LookedUp) -> Iterator[frozenset[str]]:
    """Yield each term of an effect from which its fact is looked up."""
    if isinstance(effect, AmountEffect) or effect.value == FALSE:
        return
    for at, term in enumerate(effect.arguments if effect.value == TRUE else (*effect.arguments, effect.value)):
        constants = looked_up.get((effect.situation, at))
        if constants is not None and (term.startswith("?") or term in constants):
            yield frozenset({term})


@dataclass(frozen=True)
class _Scope:
    """A conjunction with the classes of its terms.

    The preconditions of a behaviour, or conditions that would prevent the behaviour.
    """

    conditions: tuple[Condition, ...]
    kinds: Mapping[str, str]


def _scopes(conditions: Sequence[Condition], kinds: Mapping[str, str]) -> list[_Scope]:
    """Return the conjunctions in nested conditions.

    The positive conditions, and these with each alternative and each negated group.
    """
    leaves: list[Condition] = []
    groups: list[tuple[tuple[Condition, ...], Mapping[str, str]]] = []
    waiting = list(conditions)
    kinds = dict(kinds)
    while waiting:
        match waiting.pop():
            case Witness(variable, kind, inner, negated):
                if negated:
                    groups.append((inner, {variable: kind}))
                else:
                    kinds[variable] = kind
                    waiting += inner
            case AnyOf(alternatives):
                groups += [(alternative, {}) for alternative in alternatives]
            case leaf:
                leaves.append(leaf)
    found = [_Scope(tuple(leaves), kinds)]
    for inner, bound in groups:
        found += _scopes((*leaves, *inner), {**kinds, **bound})
    return found


def _span(scope: _Scope, start: set[str], more: set[str], known: Frame, found: Routes, looked_up: LookedUp) -> None:
    """Add the cheapest steps by which all terms of a conjunction, and some further terms, are reached from given terms."""
    steps = [step for condition in scope.conditions for step in _steps(condition, scope, known)]
    in_use = {t for c in scope.conditions for t in terms(c)} - {TRUE, FALSE} | more
    reached = start | {t for t in in_use if not t.startswith("?")}
    waiting = in_use - reached
    while waiting:
        usable = [step for step in steps if step.source in reached and step.target in waiting]
        if not usable:
            lost = min(waiting)
            found.classes.update(map(known.names.iri, scope.kinds[lost].split("|")))
            waiting.remove(lost)
            reached.add(lost)
            continue
        step = min(usable, key=lambda s: (s.cost, s.source, s.target))
        found.forward |= step.forward
        for name in step.backward:
            found.backward.setdefault(name, set()).update(known.names.iri(c) for c in step.constants)
        if step.looks_up:
            looked_up.setdefault(step.looks_up, set()).update(step.constants)
        waiting.remove(step.target)
        reached.add(step.target)


@dataclass(frozen=True)
class _Step:
    """One route from a term to another: the properties to follow, and its cost.

    `constants` may occur in place of the source; `looks_up` is the position of the source, unless the source alone determines
    the symbol.
    """

    source: str
    target: str
    cost: int
    forward: frozenset[str]
    backward: frozenset[str]
    constants: frozenset[str]
    looks_up: tuple[str, int] | None


def _steps(condition: Condition, scope: _Scope, known: Frame) -> Iterator[_Step]:
    """Yield the steps that a positive condition allows: between any two of its terms, by stated facts.

    Facts that are nodes of their own are always followed from their first argument.
    """
    arguments: tuple[str, ...]
    match condition:
        case RelationCondition(relation, arguments, False):
            situation, properties = None, frozenset({known.names.iri(relation)})
        case ValueCondition(name, about, value, False) if value != FALSE and name not in known.domain.rules:
            situation, arguments = known.domain.situations[name], about if value == TRUE else (*about, value)
            properties = frozenset(p for p, (of, _) in known.properties.items() if of == name)
        case _:
            return  # facts of rules aren't stated: the rules' conditions are followed
    if len(arguments) != 2:
        properties = frozenset()
    nodes = frozenset(PLACES[1:]) if known.schema.tuples else frozenset()
    unstated = (
        situation is not None
        and len(arguments) > len(situation.arguments)
        and (situation.default in _constants(arguments[-1], scope, known))
    )  # a symbol that has the default may not be stated: none of its arguments can be found by it
    for at, source in enumerate(arguments):
        kind = scope.kinds.get(source)
        constants = _constants(source, scope, known)
        if situation is None:
            cost = RELATION if properties or not at else BACKWARD
        elif not properties:
            cost = BACKWARD if at else RELATION
        else:
            cost = FREE if not at else FROM_CONSTANT if kind is None else BACKWARD
        alone = situation is None or (not at and len(situation.arguments) == 1)
        for target in (other for other in arguments if other != source):
            if unstated and target != arguments[-1]:
                continue
            yield _Step(
                source,
                target,
                cost,
                forward=properties,
                backward=properties | nodes if at else frozenset(),
                constants=constants,
                looks_up=None if alone or situation is None else (situation.name, at),
            )


def _constants(term: str, scope: _Scope, known: Frame) -> frozenset[str]:
    """Return the constants that a term may denote."""
    kind = scope.kinds.get(term)
    return frozenset({term} if kind is None else known.classes.get(kind, ()))


# ------------------------------------------------------------------------------------------------- 2. following it


class _Search(Individuals):
    """The individuals that recognition has read, and the routes from them."""

    def close(self, fresh: list[Triple], constants: set[str], bounds: Routes) -> None:
        """Follow the routes from the first individuals until no new ones are found, in rounds and then by one property path."""
        reached, asked = set(self.seen), set[str]()
        classes = bounds.classes
        for _ in range(ROUNDS):
            self._follow(fresh, bounds, reached)
            new = reached - asked
            back = {name: {x for x in new if x not in constants or x in own} for name, own in bounds.backward.items()}
            if self.schema.tuples:
                back.setdefault(CORE + "about", new)
            unread = new - self.seen
            asked |= new
            if not unread and not classes and not any(back.values()):
                return
            fresh = self.visit(unread, back, classes)
            classes = set()
        self._follow(fresh, bounds, reached)
        if reached - asked:
            self._close_by_path(reached - asked, bounds)

    def _follow(self, triples: Sequence[Triple], bounds: Routes, reached: set[str]) -> None:
        """Add the individuals to which some triples lead to `reached`."""
        kinds = self.below(bounds.classes)
        facts = set[str]()
        backward = bounds.backward.keys() - {*PLACES}
        nodes, forward = self.schema.nodes, bounds.forward
        for s, p, o in triples:
            if s in nodes:
                continue
            if p in forward:
                reached.add(s)
                reached.add(o)
            elif p in backward or (p == TYPE and o in kinds):
                reached.add(s)
            elif p == TYPE and o == FACT:
                facts.add(s)
        if facts:
            reached.update(o for s, p, o in triples if s in facts and p in PLACES)

    def _close_by_path(self, frontier: set[str], bounds: Routes) -> None:
        """Read everything that the routes reach from a frontier; a path doesn't distinguish constants, so it may reach more."""
        ways = [f"<{p}>" for p in sorted(bounds.forward)] + [f"^<{p}>" for p in sorted({*bounds.backward} - {*PLACES})]
        if self.schema.tuples:
            node = "|".join(f"<{p}>" for p in PLACES)
            ways.append(f"(^({node})/({node}))")
        rows = self.graph.select(
            f"SELECT DISTINCT ?x WHERE {{ VALUES ?seed {{ {values_of(frontier)} }} ?seed ({'|'.join(ways)})* ?x "
            "FILTER(isIRI(?x)) }",
            SCENE,
        )
        far = {text(x) for (x,) in rows} - self.schema.nodes.keys()
        self.visit(far - self.seen, {CORE + "about": far} if self.schema.tuples else None)


def _namesakes(graph: KnowledgeGraph, schema: Schema, members: Sequence[Member]) -> set[str]:
    """Return the namesakes of a part of the scene: individuals and classes with the same local name, in all known namespaces.

    Each possible IRI is looked up separately, so that no other row is read. As in the whole scene, an individual counts if it
    has a class, and a class counts if it has individuals that aren't nodes of the schema.
    """
    terms = {iri for individual, kind, _ in members for iri in (individual, kind)} - schema.nodes.keys()
    endings = {local_name(iri) for iri in terms}
    candidates = {space + ending for space in _spaces(graph, schema, terms) for ending in endings} - terms
    if not candidates:
        return set()
    rows = graph.select(
        f"SELECT ?x ?named WHERE {{ VALUES ?x {{ {values_of(candidates)} }} BIND(EXISTS {{ ?x a owl:NamedIndividual, ?kind "
        "FILTER(isIRI(?kind) && !STRSTARTS(STR(?kind), STR(owl:))) } AS ?named) "
        "FILTER(?named || EXISTS { ?member a ?x }) }",
        SCENE,
    )
    found = {text(x) for x, _ in rows}
    doubtful = {text(x) for x, named in rows if text(named) != TRUE}
    doubtful &= {kind for node in schema.nodes.values() for kind in node.get(TYPE, ())}
    if doubtful:
        query = f"SELECT DISTINCT ?x ?member WHERE {{ VALUES ?x {{ {values_of(doubtful)} }} ?member a ?x, owl:NamedIndividual }}"
        found -= doubtful
        found |= {text(x) for x, member in graph.select(query, SCENE) if text(member) not in schema.nodes}
    return found


def _spaces(graph: KnowledgeGraph, schema: Schema, terms: Iterable[str]) -> set[str]:
    """Return the namespaces of some terms, the namespaces for which files have prefixes, and those of other ontologies."""
    found = {iri.removesuffix(local_name(iri)) for iri in terms if ":" in iri}
    found |= {*graph.prefixes.values()} - ({*PREFIXES.values()} - {CORE})
    for ontology in schema.ontologies:
        both = {ontology.rstrip("#/") + mark for mark in "#/"}
        found |= set() if both & found else both
    return found


def _goal_situations(schema: Schema) -> set[str]:
    return {s for iri in goal_conditions(schema) for s in schema.nodes.get(iri, {}).get(CORE + "situationType", ())}


def _goal_individuals(schema: Schema) -> set[str]:
    """Return the individuals in goals and in facts without arguments."""
    goals = [schema.nodes.get(iri, {}) for iri in goal_conditions(schema)]
    nodes = chain(goals, schema.facts.values())
    named = {v for node in nodes for name in PLACES for v in node.get(name, ()) if v not in schema.nodes}
    return named - schema.individuals_of


def _goal_classes(schema: Schema) -> set[str]:
    """Return the classes in goals about all individuals of a class, and in goals that exclude a value."""
    goals = [schema.nodes.get(iri, {}) for iri in goal_conditions(schema)]
    wanted = {v for node in goals for name in PLACES for v in node.get(name, ()) if v in schema.individuals_of}
    negated = (node for node in goals if {"true", "1"}.intersection(node.get(CORE + "negated", ())))
    return wanted | {v for node in negated for v in node.get(CORE + "situationType", ()) if v not in schema.pairs}


def _named(graph: KnowledgeGraph, schema: Schema, goals: Sequence[str]) -> set[str]:
    """Return the individuals that the words of goals can mean, by their short names.

    They are looked up in the known namespaces; an individual that isn't found there is looked up among all individuals.
    """
    words = {word.rsplit(":", 1)[-1] for goal in goals for word in goal.split() if not BOUNDS.fullmatch(word)}
    if not words:
        return set()
    spaces = _spaces(graph, schema, chain(schema.nodes, schema.supers, _goal_individuals(schema)))
    rows = graph.select(
        f"SELECT ?x WHERE {{ VALUES ?x {{ {values_of(space + word for space in spaces for word in words)} }} "
        "FILTER EXISTS { ?x a owl:NamedIndividual } }",
        SCENE,
    )
    found = {text(x) for (x,) in rows}
    terms = {local_name(iri) for iri in (*found, *schema.nodes, *schema.supers)} | {TRUE, FALSE}
    if lost := words - terms:
        rows = graph.select(
            "SELECT DISTINCT ?x WHERE { ?x a owl:NamedIndividual . "
            f"VALUES ?word {{ {' '.join(str(ox.Literal(word)) for word in sorted(lost))} }} "
            'FILTER(STRENDS(STR(?x), ?word)) FILTER(REPLACE(STR(?x), "^.*[#/:]", "") = ?word) }',
            SCENE,
        )
        found |= {text(x) for (x,) in rows}
    return found

"""Task recognition: few queries select the individuals in a large world that a task can need.

The set of selected individuals, the *slice*, is closed: if a behaviour can change a symbol of the slice, the slice also contains
all individuals in the behaviour's conditions and other effects. Planning in the slice therefore gives the same result as planning
in the whole world (proof: docs/quantification.md; tests: test_recognition.py, test_closure.py). Recognition has two steps:

First, `routes` reads only the behaviours. For each behaviour that can change a symbol, the function finds routes (chains of
properties in the graph) from the symbol's object to the other terms of the behaviour. A route goes forward to a value (the place of
the object), along a static relation (a hand that reaches the place), or backward from a value (other objects at the place). If no
route leads to a term, the slice contains all individuals of the term's class.

Then `recognise` follows the routes in the graph from the individuals of the goal. Each query follows the routes by one property,
until a query finds no new individual. If the task has no plan in the complete slice, it has no plan in the world.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import TypeAlias

import pyoxigraph as ox

from confab.reasoner.aggregates.dependencies import read_by
from confab.reasoner.amounts import situations_in, terms_of
from confab.reasoner.graph.knowledge import SCENE, KnowledgeError, KnowledgeGraph, text
from confab.reasoner.language import situations_of, substituted, terms
from confab.reasoner.limits import check, checked
from confab.reasoner.names import local_name
from confab.reasoner.reading.frame import Frame, frame, names_of
from confab.reasoner.reading.goals import BOUNDS, with_goals
from confab.reasoner.reading.individuals import (
    FACT,
    PLACES,
    RECOGNISING,
    Individuals,
    constants_of,
    goal_conditions,
    values_of,
)
from confab.reasoner.reading.problem import Reading, read, reading_of
from confab.reasoner.reading.remembering import concerns_the_past
from confab.reasoner.reading.rows import Member, OntologySchema, Triple, derived_goals
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
"""Maximum number of queries that follow the routes by one property each. If the last query still finds new
individuals, one query with a property path completes the slice.
"""
FREE, RELATION, BACKWARD, FROM_CONSTANT = range(4)  # costs of steps; the cheapest step to a term is chosen
WORD = re.compile(r"""([^\x00-\x20<>"{}|^`\\#/:%]|%[0-9A-Fa-f]{2})+""")
IRI = re.compile(
    r"""[A-Za-z][A-Za-z0-9+.-]*://([^\x00-\x20<>"{}|^`\\#%]|%[0-9A-Fa-f]{2})+(#([^\x00-\x20<>"{}|^`\\#%]|%[0-9A-Fa-f]{2})*)?"""
)
"""Forms of words in goals: a name that may be a part of an IRI, and an IRI."""


@dataclass
class Routes:
    """The properties (as IRIs) by which task recognition gets from relevant individuals to further relevant individuals.

    `forward` contains the properties that are followed from subject to object. The keys of `backward` are the properties that are
    followed from object to subject, and the values are constants from which the property is followed, too. A constant is a value
    that a behaviour names, such as "nothing"; many symbols may have this value. `classes` contains the classes whose individuals
    are all relevant.
    """

    forward: set[str] = field(default_factory=set)
    backward: dict[str, set[str]] = field(default_factory=dict)
    classes: set[str] = field(default_factory=set)


def recognise(graph: KnowledgeGraph, goals: Sequence[str] = ()) -> Reading:
    """Return the planning problem of the individuals that a scene's task can need, by a bounded number of queries.

    Parameters
    ----------
    graph : KnowledgeGraph
    goals : sequence of str
        Goals that replace goals of the task (`confab.reasoner.reading.goals.with_goals`); their individuals are included.

    Returns
    -------
    Reading
        The result of `confab.reasoner.reading.problem.read` with fewer individuals. The IDs of behaviours depend on the
        individuals that are read.

    Raises
    ------
    KnowledgeError
        The part of the scene that is read is invalid, as in `confab.reasoner.reading.problem.read`.

    Examples
    --------
    >>> from confab.reasoner.graph.knowledge import load
    >>> recognise(load("beverage-serving")).problem.classes["Movable"]
    ('bottle1', 'bottle2', 'cup1', 'cup2')
    """
    schema = read_schema(graph)
    if derived_goals(schema) or concerns_the_past(schema):
        reading = read(graph, schema)  # derived goals and remembered situations may depend on any individual
        return replace(reading, problem=with_goals(reading.problem, goals))
    constants = constants_of(schema)
    seeds = _goal_individuals(schema) | _named(graph, schema, goals)
    search = _RouteSearch(graph, schema)
    if nameless := sorted(term for term in seeds | constants if ":" not in term):
        raise KnowledgeError(
            f"a condition, an effect or a goal leads to something without a name (_:{nameless[0]}), where an individual belongs"
        )
    fresh = search.visit(seeds | constants)
    check(RECOGNISING)
    lifted = frame(schema, [member for member in search.members() if member[0] in constants])
    bounds = routes(lifted, _situations_in(goals, lifted))
    search.close(fresh, constants, bounds)
    members = search.members()
    known = frame(schema, members, _namesakes(graph, schema, members), lifted)
    reading = reading_of(graph.scene, known, search.facts(known), search.tuples(), whole=False)
    return replace(reading, problem=with_goals(reading.problem, goals))


# ------------------------------------------------------------------------------------------------- 1. routes


def routes(known: Frame, more_situations: Iterable[str] = ()) -> Routes:
    """Return the routes from a goal's individuals to all individuals that relevant behaviours can involve or change.

    A behaviour is relevant if it changes a relevant situation type; a rule is relevant if it derives a relevant situation type. All
    situation types in conditions and effects of relevant behaviours and rules are relevant. Facts of a situation type may be looked
    up by one of their terms, such as a place; an effect on such a fact may then concern the slice. In this case, routes also lead
    from the effect's term at this position to the other terms of the behaviour.

    Parameters
    ----------
    known : Frame
        The frame (domain and classes) that contains only the individuals that the ontology's behaviours and definitions name.
    more_situations : iterable of str
        Situation types that are relevant in addition to the situation types in the task's goals.
    """
    found = Routes(forward=set(known.properties) - known.schema.numbers, classes=_goal_classes(known.schema))
    goals = [known.schema.nodes.get(iri, {}) for iri in goal_conditions(known.schema)]
    counting = {known.names.short(s) for goal in goals for s in goal.get(CORE + "situationType", ())}
    counting |= set(more_situations)
    looked_up: LookedUp = {}
    rules = (rule.behavior for its in known.domain.rules.values() for rule in its)
    aggregates = [_Doing(one.behavior, {*one.kinds}) for one in known.domain.aggregates.values()]
    doing = [*(_Doing(behavior) for behavior in (*known.lifted.values(), *rules)), *aggregates]
    for total in aggregates:
        # a total in the slice depends on all of its facts, even if no behaviour is relevant
        total.follow(known, found, looked_up)
    changed = set[str]()
    before: tuple[int, ...] = ()
    while before != (before := (len(counting), len(changed), len(looked_up), sum(map(len, looked_up.values())))):
        for one in doing:
            if one.behavior.changes & counting:
                one.follow(known, found, looked_up)
                counting |= one.situations
                changed |= one.behavior.changes
        following = set(changed)
        for aggregate in known.domain.aggregates.values():  # totals come after the totals that they add up
            if not read_by(aggregate) & following:
                continue
            following.add(aggregate.situation)
            quantity = known.domain.situations[aggregate.situation].quantity
            if quantity is not None and quantity.bounded:
                counting.add(aggregate.situation)  # the bounds of the total restrict behaviours
                _span_to_totals(aggregate, following, known, found, looked_up)
    return found


def _span_to_totals(aggregate: Aggregate, changed: set[str], known: Frame, found: Routes, looked_up: LookedUp) -> None:
    """Add the routes from changing facts to the individuals whose derived amounts depend on these facts."""
    named, left = {parameter.name for parameter in aggregate.parameters}, read_by(aggregate) & changed
    for scope in _scopes(aggregate.conditions, aggregate.kinds):
        for condition in scope.conditions:
            if isinstance(condition, ValueCondition) and condition.situation in changed:
                _span(scope, {*condition.arguments, condition.value}, named, known, found, looked_up)
                left -= {condition.situation}
    if left:  # the facts occur in nested conditions
        kinds = (kind for parameter in aggregate.parameters for kind in parameter.kind.split("|"))
        found.classes.update(map(known.names.iri, kinds))


LookedUp: TypeAlias = "dict[tuple[str, int], set[str]]"
"""The positions of terms by which facts are looked up. A key is a situation type and a position; the value contains the constants
that the term at this position may denote.
"""


class _Doing:
    """A behaviour or rule in task recognition, with the routes from each of its effects to all of its terms.

    Attributes
    ----------
    situations : set of str
        The situation types in the conditions and effects of the behaviour.
    step : set of str
        The parameters, the variables in positive conditions, and the variables in `always`. For a total, `always` has the variables
        that occur in no condition, since the total depends on the individuals of these variables, too.
    """

    def __init__(self, behavior: Behavior, always: Collection[str] = ()) -> None:
        self.behavior = behavior
        self.asks = _scopes(behavior.preconditions, behavior.kinds)
        self.step = {t for c in self.asks[0].conditions for t in terms(c)} & behavior.kinds.keys()
        self.step |= {*always, *(parameter.name for parameter in behavior.parameters)}
        self.effects = []
        for effect in behavior.every_effect:
            kinds = {**behavior.kinds, **({effect.each.name: effect.each.kind} if effect.each else {})}
            scopes = _scopes((*behavior.preconditions, *effect.when), kinds)
            given = (effect.value,) if isinstance(effect, ValueEffect) else terms_of(effect.amount)
            self.effects.append((effect, scopes, {*effect.arguments, *given}))
        amounts = [situations_in(effect.amount) for effect in behavior.amounts]
        scopes = [*self.asks, *(scope for _, scopes, _ in self.effects for scope in scopes)]
        asked = (s for scope in scopes for condition in scope.conditions for s in situations_of(condition))
        self.situations = behavior.changes.union(asked, *amounts)
        self.spanned = set[tuple[int, frozenset[str]]]()

    def follow(self, known: Frame, found: Routes, looked_up: LookedUp) -> None:
        """Add the routes from each effect to all individuals of the behaviour, and to all symbols that the behaviour changes."""
        if not self.spanned:
            for scope in self.asks[1:]:  # the other scopes belong to negated conditions and alternatives
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


def _given(effect: Effect, looked_up: LookedUp) -> Iterator[frozenset[str]]:
    """Yield each term of an effect by which the changed fact may be looked up."""
    if isinstance(effect, AmountEffect) or effect.value == FALSE:
        return
    for at, term in enumerate(effect.arguments if effect.value == TRUE else (*effect.arguments, effect.value)):
        constants = looked_up.get((effect.situation, at))
        if constants is not None and (term.startswith("?") or term in constants):
            yield frozenset({term})


@dataclass(frozen=True)
class _TypedConjunction:
    """A conjunction with the classes of its terms: a behaviour's positive preconditions, possibly with a nested conjunction."""

    conditions: tuple[Condition, ...]
    kinds: Mapping[str, str]


def _scopes(conditions: Sequence[Condition], kinds: Mapping[str, str]) -> list[_TypedConjunction]:
    """Return the conjunctions that conditions contain, including nested conjunctions.

    The first conjunction contains the positive conditions. Each further conjunction adds an alternative or a negated conjunction to
    the positive conditions. Different variables of nested conjunctions get different names.
    """
    leaves: list[Condition] = []
    groups: list[tuple[Sequence[Condition], Mapping[str, str]]] = []
    waiting, kinds, named = list(conditions), dict(kinds), {*kinds}

    def apart(variable: str, inner: Sequence[Condition]) -> tuple[str, list[Condition]]:
        name = variable
        while name in named:
            name += "'"
        named.add(name)
        return name, [substituted(condition, {variable: name}) for condition in inner]

    while waiting:
        match waiting.pop():
            case Witness(variable, kind, inner, negated):
                name, inside = apart(variable, inner)
                if negated:
                    groups.append((inside, {name: kind}))
                else:
                    kinds[name] = kind
                    waiting += inside
            case AnyOf(alternatives):
                groups += [(alternative, {}) for alternative in alternatives]
            case leaf:
                leaves.append(leaf)
    found = [_TypedConjunction(tuple(leaves), kinds)]
    for group, bound in groups:
        found += _scopes((*leaves, *group), {**kinds, **bound})
    return found


def _span(
    scope: _TypedConjunction, start: set[str], more: set[str], known: Frame, found: Routes, looked_up: LookedUp
) -> None:
    """Add the cheapest routes from the terms in `start` to all terms of a conjunction and to the terms in `more`."""
    steps = [step for condition in scope.conditions for step in _steps(condition, scope, known)]
    in_use = more.union(*map(terms, scope.conditions))
    waiting = {t for t in in_use if t.startswith("?")} - start
    reached = start | in_use - waiting
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
class _Route:
    """A route from one term of a condition to another term: the properties that the route follows, and its cost.

    `constants` are the individuals that the source may denote. If the source alone determines the symbol, `looks_up` is None;
    otherwise, `looks_up` has the situation type, and the source's position among the arguments.
    """

    source: str
    target: str
    cost: int
    forward: frozenset[str]
    backward: frozenset[str]
    constants: frozenset[str]
    looks_up: tuple[str, int] | None


def _steps(condition: Condition, scope: _TypedConjunction, known: Frame) -> Iterator[_Route]:
    """Yield the routes between any two terms of a positive condition; a node is followed from its first argument."""
    arguments: tuple[str, ...]
    match condition:
        case RelationCondition(relation, arguments, False):
            situation, properties = None, frozenset({known.names.iri(relation)})
        case ValueCondition(name, about, value, False) if value != FALSE and name not in known.domain.rules:
            situation, arguments = known.domain.situations[name], about if value == TRUE else (*about, value)
            properties = frozenset(p for p, (of, _) in known.properties.items() if of == name)
        case _:
            return  # derived facts aren't stated; the conditions of their rules are followed
    if len(arguments) != 2:
        properties = frozenset()
    nodes = frozenset(PLACES[1:]) if known.schema.tuples else frozenset()
    # facts with a default value may be unstated, so these facts can't be used to find arguments
    if situation is not None and situation.default == TRUE:
        return
    unstated = (
        situation is not None
        and len(arguments) > len(situation.arguments)
        and (situation.default in _constants(arguments[-1], scope, known))
    )
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
            yield _Route(
                source,
                target,
                cost,
                forward=properties,
                backward=properties | nodes if at else frozenset(),
                constants=constants,
                looks_up=None if alone or situation is None else (situation.name, at),
            )


def _constants(term: str, scope: _TypedConjunction, known: Frame) -> frozenset[str]:
    """Return the constants that a term may denote."""
    kind = scope.kinds.get(term)
    return frozenset({term} if kind is None else known.classes.get(kind, ()))


# ------------------------------------------------------------------------------------------------- 2. search


class _RouteSearch(Individuals):
    """The individuals that task recognition has read, and the search along routes."""

    def close(self, fresh: list[Triple], constants: set[str], bounds: Routes) -> None:
        """Follow the routes until no new individual is found: by `ROUNDS` queries of one step each, then by a property path."""
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
        """Add to `reached` the individuals to which the routes lead along some triples."""
        kinds = self.below(bounds.classes)
        facts = set[str]()
        backward = bounds.backward.keys() - {*PLACES}
        nodes, forward = self.schema.nodes, bounds.forward
        for s, p, o in checked(triples, RECOGNISING):
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
        """Read all individuals that the routes reach from a frontier, or more, because a property path ignores constants."""
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


def _namesakes(graph: KnowledgeGraph, schema: OntologySchema, members: Sequence[Member]) -> set[str]:
    """Return the IRIs that differ only in the namespace from an individual, a class or a term that has been read.

    Only known namespaces are searched.

    The candidates are looked up by their whole IRIs. An individual is included only if a class of the individual is stated. A class
    is included only if it has individuals besides the nodes that describe behaviours.
    """
    terms = {*names_of(schema, members).iris}
    endings = {local_name(iri) for iri in terms}
    check(RECOGNISING)
    candidates = {space + ending for space in _spaces(graph, schema, terms) for ending in endings} - terms
    check(RECOGNISING)
    if not candidates:
        return set()
    rows = graph.select(
        f"SELECT ?x ?named WHERE {{ VALUES ?x {{ {values_of(candidates)} }} BIND(EXISTS {{ ?x a owl:NamedIndividual, ?kind "
        "FILTER(isIRI(?kind) && !STRSTARTS(STR(?kind), STR(owl:))) } AS ?named) "
        "FILTER(?named || EXISTS { ?member a ?x FILTER EXISTS { ?member a owl:NamedIndividual } }) }",
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


def _spaces(graph: KnowledgeGraph, schema: OntologySchema, terms: Iterable[str]) -> set[str]:
    """Return the namespaces of some terms, of the files' prefixes and of the loaded ontologies."""
    found = {iri.removesuffix(local_name(iri)) for iri in terms if ":" in iri}
    found |= {*graph.prefixes.values()} - ({*PREFIXES.values()} - {CORE})
    for ontology in schema.ontologies:
        both = {ontology.rstrip("#/") + mark for mark in "#/"}
        found |= set() if both & found else both
    return found


def _goal_individuals(schema: OntologySchema) -> set[str]:
    """Return the individuals that goals mention, or that facts without arguments mention."""
    goals = [schema.nodes.get(iri, {}) for iri in goal_conditions(schema)]
    nodes = chain(goals, schema.facts.values())
    named = {v for node in nodes for name in PLACES for v in node.get(name, ()) if v not in schema.nodes}
    return named - schema.individuals_of


def _goal_classes(schema: OntologySchema) -> set[str]:
    """Return the classes that stand for all their members in goals."""
    goals = [schema.nodes.get(iri, {}) for iri in goal_conditions(schema)]
    return {v for node in goals for name in PLACES for v in node.get(name, ()) if v in schema.individuals_of}


def _situations_in(goals: Sequence[str], known: Frame) -> set[str]:
    """Return the situation types that goals name; the whole scene may have a longer name for a situation type than `known`."""
    named = {local_name(goal.split()[1]) for goal in goals if " " in goal.strip()}
    return {name for name in known.domain.situations if local_name(name) in named}


def _named(graph: KnowledgeGraph, schema: OntologySchema, goals: Sequence[str]) -> set[str]:
    """Return the IRIs of the individuals that goals name; known namespaces are searched before all individuals."""
    given = {word for goal in goals for word in goal.split()}
    words = {name for word in given if WORD.fullmatch(name := local_name(word))}
    if not words:
        return set()
    spaces = _spaces(graph, schema, chain(schema.nodes, schema.supers, _goal_individuals(schema)))
    iris = {space + word for space in spaces for word in words} | {word for word in given if IRI.fullmatch(word)}
    rows = graph.select(
        f"SELECT ?x WHERE {{ VALUES ?x {{ {values_of(sorted(iris))} }} FILTER EXISTS {{ ?x a owl:NamedIndividual }} }}",
        SCENE,
    )
    found = {text(x) for (x,) in rows}
    terms = {local_name(iri) for iri in (*found, *schema.nodes, *schema.supers)} | {TRUE, FALSE}
    if lost := {word for word in words - terms if not BOUNDS.fullmatch(word)}:
        rows = graph.select(
            "SELECT DISTINCT ?x WHERE { ?x a owl:NamedIndividual . "
            f"VALUES ?word {{ {' '.join(str(ox.Literal(word)) for word in sorted(lost))} }} "
            'FILTER(STRENDS(STR(?x), ?word)) FILTER(REPLACE(STR(?x), "^.*[#/:]", "") = ?word) }',
            SCENE,
        )
        found |= {text(x) for (x,) in rows}
    return found

"""Task recognition: which individuals of a large world the task at hand can need, read by few queries.

The slice is closed. Whatever a behaviour could do to a situated object of the slice, and whatever that depends on, is in the
slice as well; so planning in it and planning in the whole world have the same answer (the proof is in
docs/quantification.md, the test in tests/reasoner/test_recognition.py). Two steps:

1. `routes` looks at the behaviours alone. For each behaviour that can change a situated object, it finds how its other
   terms are reached from that object: forward over a value (the object is at a place), over a static relation (a hand
   reaches the place), or backward from a value (what else is at the place). A term that nothing leads to has to be looked
   for among all individuals of its class.
2. `recognise` starts from what the goal names and follows the routes in the graph, a round of them per query, until nothing
   new comes: the slice widens until nothing outside can help, so a task that has no plan in it has none.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain

import pyoxigraph as ox

from reasoner.graph.knowledge import CORE, PREFIXES, SCENE, KnowledgeGraph, text
from reasoner.names import local_name
from reasoner.reading.problem import (
    FIRST_INDEX_OF_NONE,
    Frame,
    Individuals,
    Node,
    Reading,
    Schema,
    frame,
    read_schema,
    reading_of,
)
from reasoner.symbols import (
    FALSE,
    TRUE,
    AnyOf,
    Condition,
    RelationCondition,
    ValueCondition,
    Witness,
)

ROUNDS = 6
"""Queries that follow routes one step each; what lies farther is closed by a property path, of which the last is one."""
TYPE = PREFIXES["rdf"] + "type"
ARGUMENTS = (CORE + "about", *(f"{CORE}argument{position}" for position in range(2, 10)), CORE + "value")
"""What leads from a fact that is a node of its own to the individuals in it."""
FREE, RELATION, BACKWARD, FROM_CONSTANT = range(4)  # the cheapest of the steps that reach a term is taken

Triple = tuple[str, str, str]


@dataclass
class Routes:
    """How to get from individuals that matter to others that matter, as IRIs.

    `forward` are the properties followed from subject to object; `backward` those followed from object to subject, each with
    the constants from which it is followed too (a constant is a value that a behaviour names, such as "nothing": half the
    world may have it). `classes` are those all of whose individuals matter.
    """

    forward: set[str] = field(default_factory=set)
    backward: dict[str, set[str]] = field(default_factory=dict)
    classes: set[str] = field(default_factory=set)


def recognise(graph: KnowledgeGraph, goals: Sequence[str] = ()) -> Reading:
    """Read those individuals of a scene that its task can need, in few queries however many there are.

    Parameters
    ----------
    graph : KnowledgeGraph
    goals : sequence of str
        Goals that will replace some of the task's (`reasoner.reading.problem.with_goals`): what they name is read as well.

    Returns
    -------
    Reading
        As `reasoner.reading.problem.read` gives, with fewer individuals. IDs number what was read.

    Raises
    ------
    KnowledgeError
        As `reasoner.reading.problem.read`, for the individuals that matter.

    Examples
    --------
    >>> from reasoner.graph.knowledge import load
    >>> recognise(load("beverage-serving")).problem.classes["Movable"]
    ('bottle1', 'bottle2', 'cup1', 'cup2')
    """
    schema = read_schema(graph)
    constants = _constants(schema)
    seeds = _goal_individuals(schema) | _named(graph, goals)
    search = _Search(graph, schema)
    search.visit(seeds | constants, Routes())
    bounds = routes(frame(schema, search.members()), schema, [goal.split()[1] for goal in goals if " " in goal.strip()])
    search.close(seeds | constants, constants, bounds)
    read = search.individuals(bounds)
    return reading_of(graph.scene, schema, replace(read, namesakes=_namesakes(graph, read.members)), whole=False)


# ------------------------------------------------------------------------------------------------- 1. what leads to what


def routes(known: Frame, schema: Schema, more_situations: Iterable[str] = ()) -> Routes:
    """Return how to reach, from what the goal names, everything that a behaviour on it can involve.

    A behaviour counts if it changes a situation type that counts; then so do those in its conditions and its other effects.
    `looked_up` are the situation types that are followed backward, each with the constants from which it is: a behaviour
    that gives somebody such a value counts from that value on, too.
    """
    found = Routes(forward=set(known.properties))
    counting = {known.schema.names.short(s) for s in _goal_situations(schema)} | set(more_situations)
    looked_up: dict[str, set[str]] = {}
    before = -1
    while before != (before := len(counting) + len(looked_up) + sum(map(len, looked_up.values()))):
        for behavior in known.domain.behaviors.values():
            if not any(effect.situation in counting for effect in behavior.effects):
                continue
            counting |= {effect.situation for effect in behavior.effects}
            kinds = {term.name: term.kind for term in (*behavior.parameters, *behavior.variables)}
            for effect in behavior.effects:
                starts = [set(effect.arguments)]
                if effect.situation in looked_up and (
                    effect.value.startswith("?") or effect.value in looked_up[effect.situation]
                ):
                    starts.append({effect.value})
                scopes = _scopes((*behavior.preconditions, *effect.when), kinds)
                counting |= {c.situation for s in scopes for c in s.conditions if isinstance(c, ValueCondition)}
                own = {t for s in scopes for c in s.conditions for t in _terms(c)} | {*effect.arguments, effect.value}
                own &= kinds.keys()
                for start in starts:
                    # What must not hold, or need not, leads to nothing that the behaviour itself is done with.
                    _span(scopes[0], start, own, known, schema, found, looked_up)
                    for scope in scopes[1:]:
                        _span(scope, start | own, set(), known, schema, found, looked_up)
    return found


@dataclass(frozen=True)
class _Scope:
    """A conjunction with the terms in it: conditions that hold together when a behaviour is done, or would forbid it."""

    conditions: tuple[Condition, ...]
    kinds: Mapping[str, str]


def _scopes(conditions: Sequence[Condition], kinds: Mapping[str, str]) -> list[_Scope]:
    """Return the conjunctions in nested conditions: what must hold, and with it each alternative and each negated group."""
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


def _span(
    scope: _Scope,
    start: set[str],
    more: set[str],
    known: Frame,
    schema: Schema,
    found: Routes,
    looked_up: dict[str, set[str]],
) -> None:
    """Add the steps by which all terms of a conjunction, and some more, are reached from some, by the cheapest first."""
    steps = [step for condition in scope.conditions for step in _steps(condition, scope, known, schema)]
    in_use = {t for c in scope.conditions for t in _terms(c)} | more
    waiting = (in_use | {t for t in start if t.startswith("?")}) - start
    reached = set(start) | {t for t in in_use if not t.startswith("?")}
    waiting -= reached
    while waiting:
        usable = [step for step in steps if step.source in reached and step.target in waiting]
        if not usable:
            lost = min(waiting)
            found.classes.add(known.schema.names.iri(scope.kinds[lost]))
            waiting.remove(lost)
            reached.add(lost)
            continue
        step = min(usable, key=lambda s: (s.cost, s.source, s.target))
        found.forward |= step.forward
        for name in step.backward:
            found.backward.setdefault(name, set()).update(known.schema.names.iri(c) for c in step.constants)
        if step.looks_up:
            looked_up.setdefault(step.looks_up, set()).update(step.constants)
        waiting.remove(step.target)
        reached.add(step.target)


@dataclass(frozen=True)
class _Step:
    """One way from a term to another: the properties to follow, and what that costs."""

    source: str
    target: str
    cost: int
    forward: frozenset[str] = frozenset()
    backward: frozenset[str] = frozenset()
    constants: frozenset[str] = frozenset()
    looks_up: str | None = None


def _steps(condition: Condition, scope: _Scope, known: Frame, schema: Schema) -> Iterator[_Step]:
    """Yield the steps that a positive condition allows."""
    names = known.schema.names
    if isinstance(condition, RelationCondition) and not condition.negated:
        iri = names.iri(condition.relation)
        terms = condition.arguments
        if len(terms) == 2:
            yield _Step(terms[0], terms[1], RELATION, forward=frozenset({iri}))
            yield _Step(terms[1], terms[0], RELATION, backward=frozenset({iri}))
        yield from _steps_by_nodes(terms, len(terms) > 2, schema)
    elif isinstance(condition, ValueCondition) and not condition.negated and condition.value != FALSE:
        situation = known.domain.situations[condition.situation]
        terms = condition.arguments if condition.value == TRUE else (*condition.arguments, condition.value)
        if len(terms) != 2 or condition.situation not in {name for name, _ in known.properties.values()}:
            yield from _steps_by_nodes(terms, True, schema, condition.situation)
            return
        subject, value = terms
        properties = frozenset(p for p, (name, _) in known.properties.items() if name == condition.situation)
        yield _Step(subject, value, FREE)
        kind = scope.kinds.get(value)
        constants = frozenset({value}) if kind is None else frozenset(known.classes.get(kind, ()))
        if situation.default in constants:
            return  # who has the default may not say so: it can't be found by it
        back = properties | (frozenset({CORE + "value"}) if schema.tuples else frozenset())
        cost = FROM_CONSTANT if kind is None else BACKWARD
        yield _Step(value, subject, cost, backward=back, constants=constants, looks_up=condition.situation)


def _steps_by_nodes(terms: Sequence[str], only: bool, schema: Schema, situation: str | None = None) -> Iterator[_Step]:
    """Yield the steps over facts that are nodes of their own; from their first argument they are always followed."""
    if not (only or schema.tuples):
        return
    for source in terms:
        for target in terms:
            if source != target:
                first = source == terms[0]
                yield _Step(
                    source,
                    target,
                    RELATION if first else BACKWARD,
                    backward=frozenset() if first else frozenset(ARGUMENTS[1:]),
                    looks_up=None if first else situation,
                )


def _terms(condition: Condition) -> set[str]:
    """Return the terms of a condition that isn't nested, individuals among them."""
    match condition:
        case ValueCondition(_, arguments, value):
            return {*arguments, *([value] if value not in (TRUE, FALSE) else [])}
        case RelationCondition(_, arguments):
            return set(arguments)
    return {t for name in ("term", "left", "right") for t in [getattr(condition, name, None)] if t}


# ------------------------------------------------------------------------------------------------- 2. following it


class _Search:
    """What was read of the individuals so far."""

    def __init__(self, graph: KnowledgeGraph, schema: Schema) -> None:
        self.graph, self.schema = graph, schema
        self.triples: dict[Triple, None] = {}
        self.seen: set[str] = set()

    def visit(self, individuals: set[str], bounds: Routes, back: Mapping[str, set[str]] | None = None) -> list[Triple]:
        """Read what is said of some individuals, and by whom they are named over the properties in `back`."""
        values = _values(individuals)
        parts = [f"{{ VALUES ?s {{ {values} }} ?s ?p ?o }}"] if individuals else []
        for name, whom in (back or {}).items():
            if not whom:
                continue
            if name in ARGUMENTS:
                parts.append(
                    f"{{ VALUES ?x {{ {_values(whom)} }} ?s <{name}> ?x ; ?p ?o . ?s a :SituatedObjectInstance }}"
                )
            else:
                parts.append(
                    f"{{ SELECT ?s (<{name}> AS ?p) ?o WHERE {{ VALUES ?o {{ {_values(whom)} }} ?s <{name}> ?o }} }}"
                )
        for kind in sorted(bounds.classes):
            parts.append(f"{{ ?s a owl:NamedIndividual ; a/rdfs:subClassOf* <{kind}> ; ?p ?o }}")
        rows = self._ask("SELECT ?s ?p ?o WHERE {\n  " + "\n  UNION ".join(parts) + " }\nORDER BY ?s ?p ?o")
        self.seen |= individuals
        return rows

    def close(self, seeds: set[str], constants: set[str], bounds: Routes) -> None:
        """Follow the routes from the seeds until nothing new comes, by rounds and then by one property path."""
        fresh = list(self.triples)
        reached, asked = set(seeds), set[str]()
        classes = bounds.classes
        for _ in range(ROUNDS):
            self._follow(fresh, bounds, reached)
            new = reached - asked
            if not new and not classes:
                return
            back = {name: {x for x in new if x not in constants or x in own} for name, own in bounds.backward.items()}
            if self.schema.tuples:
                back.setdefault(CORE + "about", new)
            unread = new - self.seen
            asked |= new
            if not unread and not classes and not any(back.values()):
                return
            fresh = self.visit(unread, Routes(classes=classes), back)
            classes = set()
        self._follow(fresh, bounds, reached)
        if reached - asked:
            self._close_by_path(reached - asked, bounds)

    def _follow(self, triples: Iterable[Triple], bounds: Routes, reached: set[str]) -> None:
        """Add to `reached` where some triples lead."""
        facts = set[str]()
        for s, p, o in triples:
            if s in self.schema.nodes:
                continue
            if p in bounds.forward:
                reached |= {s, o}
            elif p in bounds.backward and p not in ARGUMENTS:
                reached.add(s)
            elif p == TYPE and o == CORE + "SituatedObjectInstance":
                facts.add(s)
            elif p == TYPE and o in bounds.classes | self._below(bounds.classes):
                reached.add(s)
        for s, p, o in triples:
            if s in facts and p in ARGUMENTS:
                reached.add(o)

    def _below(self, classes: set[str]) -> set[str]:
        """Return the subclasses of some classes."""
        found, before = set(classes), -1
        while before != (before := len(found)):
            found |= {sub for sub, above in self.schema.supers.items() if found & set(above)}
        return found

    def _close_by_path(self, frontier: set[str], bounds: Routes) -> None:
        """Read everything that the routes reach from a frontier; a path can't tell constants, so it may be more."""
        ways = [f"<{p}>" for p in sorted(bounds.forward)] + [
            f"^<{p}>" for p in sorted({*bounds.backward} - {*ARGUMENTS})
        ]
        if self.schema.tuples:
            node = "|".join(f"<{p}>" for p in ARGUMENTS)
            ways.append(f"(^({node})/({node}))")
        rows = self.graph.select(
            f"SELECT DISTINCT ?x WHERE {{ VALUES ?seed {{ {_values(frontier)} }} ?seed ({'|'.join(ways)})* ?x "
            "FILTER(isIRI(?x)) } ORDER BY ?x",
            SCENE,
        )
        far = {text(x) for (x,) in rows} - set(self.schema.nodes)
        self.visit(far - self.seen, Routes(), {CORE + "about": far} if self.schema.tuples else None)

    def _ask(self, query: str) -> list[Triple]:
        rows = []
        for s, p, o in self.graph.select(query, SCENE):
            if isinstance(s, ox.NamedNode) and not isinstance(o, ox.BlankNode):
                rows.append((s.value, text(p), text(o)))
        self.triples.update(dict.fromkeys(rows))
        return rows

    def members(self) -> list[tuple[str, str, int]]:
        """Return individual, class and index of what was read."""
        named = {s for s, p, o in self.triples if p == TYPE and o == PREFIXES["owl"] + "NamedIndividual"}
        indices = {s: int(o) for s, p, o in self.triples if p == CORE + "index"}
        return [
            (s, o, indices.get(s, FIRST_INDEX_OF_NONE))
            for s, p, o in self.triples
            if p == TYPE and s in named and s in self.seen and not o.startswith(PREFIXES["owl"])
        ]

    def individuals(self, bounds: Routes) -> Individuals:
        """Return what was read, for those individuals only whose own triples were read."""
        nodes: dict[str, dict[str, list[str]]] = {}
        for s, p, o in self.triples:
            if s not in self.schema.nodes:
                nodes.setdefault(s, {}).setdefault(p, []).append(o)
        facts: dict[str, Node] = {
            s: node
            for s, node in nodes.items()
            if CORE + "SituatedObjectInstance" in node.get(TYPE, ())
            and all(o in self.seen for p in ARGUMENTS for o in node.get(p, ()) if o not in self.schema.nodes)
        }
        relations = {iri for iri, node in self.schema.nodes.items() if CORE + "valueProperty" not in node}
        wanted = bounds.forward | relations
        triples = [(s, p, o) for s, p, o in self.triples if p in wanted and s in self.seen and o in self.seen]
        return Individuals(self.members(), sorted(triples), facts)


def _namesakes(graph: KnowledgeGraph, members: Sequence[tuple[str, str, int]]) -> set[str]:
    """Return what ends like an individual or class of a part of the scene, in the namespace of any of its ontologies."""
    terms = {iri for individual, kind, _ in members for iri in (individual, kind)}
    endings = {local_name(iri) for iri in terms}
    spaces = {iri.removesuffix(local_name(iri)) for iri in terms}
    query = f"""
      SELECT DISTINCT ?x WHERE {{
        VALUES ?ending {{ {" ".join(str(ox.Literal(ending)) for ending in sorted(endings))} }}
        {{ ?ontology a owl:Ontology . VALUES ?mark {{ "#" "/" }} BIND(CONCAT(STR(?ontology), ?mark) AS ?space) }}
        UNION {{ VALUES ?space {{ {" ".join(str(ox.Literal(space)) for space in sorted(spaces))} }} }}
        BIND(IRI(CONCAT(?space, ?ending)) AS ?x)
        FILTER(EXISTS {{ ?x a owl:NamedIndividual }} || EXISTS {{ ?member a ?x, owl:NamedIndividual }})
      }} ORDER BY ?x"""
    return {text(x) for (x,) in graph.select(query, SCENE)} if endings else set()


def _values(iris: Iterable[str]) -> str:
    """Return IRIs as they stand in a VALUES clause; what isn't an IRI is refused by `NamedNode`."""
    return " ".join(str(ox.NamedNode(iri)) for iri in sorted(iris))


def _constants(schema: Schema) -> set[str]:
    """Return what the schema names: in conditions, effects and definitions of classes, and as rest and default values."""
    goals = _goal_conditions(schema)
    names = (*ARGUMENTS, CORE + "restValue", CORE + "defaultValue")
    found = {v for iri, node in schema.nodes.items() if iri not in goals for name in names for v in node.get(name, ())}
    named = (PREFIXES["owl"] + "hasValue", PREFIXES["rdf"] + "first")
    found |= {v for node in schema.expressions.values() for name in named for v in node.get(name, ()) if ":" in v}
    return (found - set(schema.nodes)) | {CORE + "true", CORE + "false"}


def _goal_conditions(schema: Schema) -> set[str]:
    return {iri for node in schema.nodes.values() for iri in node.get(CORE + "goal", ())}


def _goal_situations(schema: Schema) -> set[str]:
    return {s for iri in _goal_conditions(schema) for s in schema.nodes.get(iri, {}).get(CORE + "situationType", ())}


def _goal_individuals(schema: Schema) -> set[str]:
    """Return what the goals and the facts about nobody name."""
    goals = [schema.nodes.get(iri, {}) for iri in _goal_conditions(schema)]
    nodes = chain(goals, schema.facts.values())
    return {v for node in nodes for name in ARGUMENTS for v in node.get(name, ()) if v not in schema.nodes}


def _named(graph: KnowledgeGraph, goals: Sequence[str]) -> set[str]:
    """Return the individuals that the words of goals can mean, by their short names."""
    words = {word.rsplit(":", 1)[-1] for goal in goals for word in goal.split()}
    if not words:
        return set()
    rows = graph.select(
        "SELECT DISTINCT ?x WHERE { ?x a owl:NamedIndividual . "
        f"VALUES ?word {{ {' '.join(str(ox.Literal(word)) for word in sorted(words))} }} "
        'FILTER(STRENDS(STR(?x), ?word)) FILTER(REPLACE(STR(?x), "^.*[#/:]", "") = ?word) } ORDER BY ?x',
        SCENE,
    )
    return {text(x) for (x,) in rows}

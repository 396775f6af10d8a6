"""A part of a scene that grows with the lookups of a check, independently of the routes of task recognition.

A checker looks up the members of a class that initially satisfy conditions. One query finds the individuals for all lookups, and
their values are read. The lookups are repeated until no new individual is found.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from typing import TypeAlias

from confab.reasoner.graph.knowledge import SCENE, KnowledgeGraph, text
from confab.reasoner.language import substituted
from confab.reasoner.problem import Problem
from confab.reasoner.reading.frame import Frame, frame
from confab.reasoner.reading.individuals import FACT, PLACES, Individuals, constants_of, goal_conditions, values_of
from confab.reasoner.reading.problem import Reading, reading_of
from confab.reasoner.symbols import FALSE, TRUE, Behavior, Condition, RelationCondition, ValueCondition, Witness
from confab.reasoner.vocabulary import CORE, TYPE

LookupForm: TypeAlias = "tuple[tuple[str, tuple[bool, ...]], ...]"
"""The form of a lookup's conditions. For each condition, it has the IRI of a situation type or relation, and a flag for each
argument: the flag tells whether the argument is the individual that is looked up.
"""


class Surroundings:
    """A growing set of a scene's individuals with their facts: initially a slice, the members of goal classes, and constants.

    Attributes
    ----------
    individuals : Individuals
        The individuals that have been read from the graph so far.
    """

    def __init__(self, graph: KnowledgeGraph, slice_: Reading) -> None:
        self.graph, self.schema, self.names = graph, slice_.schema, slice_.names
        self.individuals = Individuals(graph, self.schema)
        self.forward = self.schema.value_properties.keys() - self.schema.numbers
        known = slice_.problem.individuals
        self._add({self.names.iri(name) for name in known} | constants_of(self.schema), self._classes_of_goals())
        self._known: Frame | None = None

    def _classes_of_goals(self) -> set[str]:
        """Return the classes in goals, and the classes of the values that goals exclude."""
        goals = [self.schema.nodes.get(iri, {}) for iri in goal_conditions(self.schema)]
        named = {v for node in goals for values in node.values() for v in values}
        values = {v for node in goals if CORE + "negated" in node for v in node.get(CORE + "situationType", ())}
        return (named & self.schema.individuals_of) | (values - self.schema.pairs)

    def _add(self, fresh: set[str], classes: Iterable[str] = ()) -> None:
        """Read individuals and members of classes, and then their values, until no new individual is found."""
        seen, nodes = self.individuals.seen, self.schema.nodes
        while fresh or classes:
            rows = self.individuals.visit(fresh, {CORE + "about": fresh} if self.schema.tuples else None, classes)
            facts = {s for s, p, o in rows if p == TYPE and o == FACT}
            led = {o for s, p, o in rows if p in self.forward or (s in facts and p in PLACES)}
            fresh, classes = {iri for iri in led if ":" in iri} - seen - nodes.keys(), ()

    @property
    def frame(self) -> Frame:
        """The domain and the classes of the individuals that have been read."""
        if self._known is None:
            self._known = frame(self.schema, self.individuals.members(), self.names.iris)
        return self._known

    @property
    def agree(self) -> bool:
        """Whether the names of the slice denote the same individuals and terms in the surroundings."""
        return self.names.agree(self.frame.names)

    @property
    def lifted(self) -> Mapping[str, Behavior]:
        """The behaviours, whose effects on all members of a class aren't yet expanded to one effect per member."""
        return self.frame.lifted

    def problem(self) -> Problem:
        """Return the planning problem of the individuals that have been read."""
        facts, tuples = self.individuals.facts(self.frame), self.individuals.tuples()
        return reading_of(self.graph.scene, self.frame, facts, tuples, whole=False).problem

    def widen(self, lookups: Mapping[tuple[Witness, tuple[str, ...]], Iterable[tuple[str, ...]]]) -> bool:
        """Read the individuals that lookups find for each row of known terms; return whether a new individual was found."""
        classes, shapes = set[str](), defaultdict[LookupForm, set[tuple[str, ...]]](set)
        for (witness, known), rows in lookups.items():
            for row in rows:
                terms = dict(zip(known, row, strict=True))
                asked = [*self._asked(witness.variable, (substituted(c, terms) for c in witness.conditions))]
                if asked:
                    shape = tuple((name, tuple(t is None for t in about)) for name, about in asked)
                    shapes[shape].add(tuple(t for _, about in asked for t in about if t is not None))
                else:
                    classes.add(witness.kind)
        parts = [self._pattern(shape, rows) for shape, rows in sorted(shapes.items())]
        parts += [
            f"{{ ?x a owl:NamedIndividual ; a/rdfs:subClassOf* <{self.frame.names.iri(name)}> }}"
            for kind in sorted(classes)
            for name in kind.split("|")
        ]
        if not parts:
            return False
        rows_found = self.graph.select("SELECT DISTINCT ?x WHERE {\n  " + "\n  UNION ".join(parts) + " }", SCENE)
        fresh = {text(x) for (x,) in rows_found} - self.individuals.seen - self.schema.nodes.keys()
        self._add(fresh)
        if fresh:
            self._known = None
        return bool(fresh)

    def _asked(self, variable: str, conditions: Iterable[Condition]) -> Iterator[tuple[str, tuple[str | None, ...]]]:
        """Yield, for each condition on stated facts, its IRI and its terms; None stands for the variable."""
        iri, situations, rules = self.frame.names.iri, self.frame.domain.situations, self.frame.domain.rules
        for condition in conditions:
            match condition:
                case RelationCondition(relation, about, False):
                    name, terms = iri(relation), about
                case ValueCondition(situation, about, value, False) if value != FALSE and situation not in rules:
                    kind = situations[situation]
                    if kind.quantity is not None or kind.default == value:
                        continue
                    name, terms = iri(situation), about if value == TRUE else (*about, value)
                case _:
                    continue
            yield name, tuple(None if t == variable else iri(t) for t in terms)

    def _pattern(self, shape: LookupForm, rows: Iterable[tuple[str, ...]]) -> str:
        """Return a pattern that binds ``?x`` to the individuals that a lookup finds for each row of known terms."""
        number, parts = 0, []
        at = "|".join(f"<{place}>" for place in PLACES)
        for i, (name, places) in enumerate(shape):
            terms = []
            for open_ in places:
                terms.append("?x" if open_ else f"?k{number}")
                number += not open_
            ways = [" ; ".join([f"?f{i} :situationType|:relation <{name}>", *(f"{at} {term}" for term in terms)])]
            properties = self.schema.nodes[name].get(CORE + "valueProperty", [name])
            direct = [f"{terms[0]} <{p}> {terms[1]}" for p in properties] if len(terms) == 2 else []
            ways = (ways if self.schema.tuples else []) + direct
            parts.append("{ " + " } UNION { ".join(ways or ["FILTER(false)"]) + " }")
        if not number:
            return "{ " + " ".join(parts) + " }"
        head = " ".join(f"?k{i}" for i in range(number))
        values = " ".join(f"({values_of(row)})" for row in sorted(rows))
        return f"{{ VALUES ({head}) {{ {values} }} {' '.join(parts)} }}"

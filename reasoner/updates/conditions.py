"""Compilation of the conditions of an update (patterns, filters and groups) into nodes."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

from rdflib.plugins.sparql.parserutils import CompValue

from confab.reasoner.condition_nodes import (
    Properties,
    class_properties,
    equality_properties,
    relation_properties,
    symbol_properties,
)
from confab.reasoner.names import local_name, nearest
from confab.reasoner.updates.nodes import Nodes
from confab.reasoner.updates.numbers import Numbers, unwrapped
from confab.reasoner.updates.scope import Group, VariableScope, last_of, mentioned, variables_in
from confab.reasoner.updates.words import A, Triple, Truth, UpdateError, Word, parts, place, term
from confab.reasoner.vocabulary import ARGUMENTS, CORE, INDIVIDUAL, TYPE

SIGNS = {sign: sign for sign in ("<", "<=", "=", ">=", ">")} | {"!=": "="}
ANYONE = "?anyone"
"""Name of the witness variable in the SPARQL text of an absence condition."""


@dataclass(frozen=True)
class Conditions:
    """Compiler of the conditions of one behaviour or rule."""

    nodes: Nodes
    scope: VariableScope
    numbers: Numbers

    def sought(self, group: Group, known: Collection[str], at: int) -> list[str]:
        """Return the condition nodes of a nested group.

        If the group introduces variables with a type, witnesses enclose the conditions.
        """
        if not group.chosen:
            self.scope.determine(group, nested=True)
            return self.all_of(group, {*known, *group.names})
        return [self.witness(group, known, at)]

    def witness(self, group: Group, known: Collection[str], at: int) -> str:
        """Return the outermost of the nested witnesses for a group's variables.

        Each condition is moved as far outward as possible.
        """
        inside = {*known, *group.names}
        names = list(group.chosen)
        depth = {name: level for level, name in enumerate(names)}
        for one in [part for part in group.parts if isinstance(part, Triple)] * len(group.determined):
            last = last_of(one)
            if last in group.determined:
                depth[str(last)] = max(depth.get(word, 0) for word in variables_in(one))
        for name, said in group.numbers.items():
            depth[name] = max((depth.get(word, 0) for word in mentioned(said)), default=0)
        levels: list[list[Any]] = [[] for _ in names]
        for part in group.parts:
            levels[max((depth.get(name, 0) for name in mentioned(part)), default=0)].append(part)
        made = []
        for name, word in group.chosen.items():
            node, kind = self.nodes.new("condition", "Witness", word.at), self.scope.iri(word)
            self.scope.bind(name, kind, "Variable", "", self.nodes.now.place(word.at), "witness")
            self.nodes.said[node]["witness"] = [self.scope.terms[name]]
            made.append((node, name, kind))
        self.scope.determine(group, nested=True)
        for level, (node, sought, kind) in enumerate(made):
            found = self.all_of(Group(levels[level]), inside)
            found += [deeper for deeper, *_ in made[level + 1 : level + 2]]
            if not found:  # the class is the only condition
                found = [self.nodes.condition("ClassCondition", at, class_properties(self.scope.terms[sought], kind))]
            self.nodes.said[node]["condition"] = found
        return made[0][0]

    def all_of(self, group: Group, known: Collection[str]) -> list[str]:
        """Return the condition nodes of all parts of a group."""
        return [node for part in group.parts for node in self.part(part, known)]

    def part(self, part: Any, known: Collection[str]) -> list[str]:
        """Return the condition nodes of one part of a group."""
        if isinstance(part, Triple):
            return [self.pattern(part, known)]
        if part.name == "Filter":
            return self.filter(part.expr, known)
        if part.name == "GroupOrUnionGraphPattern":
            return [self.any_of([self.inside(graph, known) for graph in part.graph], place(part))]
        if part.name == "InlineData":
            return [self.values(part, known)]
        advice = {
            "MinusGraphPattern": "write FILTER NOT EXISTS { … }",
            "OptionalGraphPattern": "write an effect for some only as a further operation, behind a semicolon",
        }
        raise UpdateError(
            f"{part.name.removesuffix('GraphPattern').upper()} isn't supported",
            advice.get(part.name, "write patterns, FILTER, UNION and VALUES"),
            place(part),
        )

    def inside(self, graph: Any, known: Collection[str]) -> list[str]:
        """Return the condition nodes of a group in braces."""
        return self.sought(self.scope.group(parts(graph), known), known, place(graph))

    def filter(self, expression: Any, known: Collection[str]) -> list[str]:
        """Return the nodes of conditions; their conjunction is equivalent to a FILTER."""
        one = unwrapped(expression)
        name = getattr(one, "name", "")
        if name == "ConditionalAndExpression":
            return [node for each in (one.expr, *one.other) for node in self.filter(each, known)]
        if name == "ConditionalOrExpression":
            return [self.any_of([self.filter(each, known) for each in (one.expr, *one.other)], place(one))]
        inner = unwrapped(one.expr) if name == "UnaryNot" else None
        if name == "UnaryNot" and getattr(inner, "name", "") not in ("Builtin_EXISTS", "Builtin_NOTEXISTS"):
            return [self.negated(self.filter(inner, known), False, place(one))]
        one, name, opposite = (inner, inner.name, True) if inner is not None else (one, name, False)
        if name in ("Builtin_EXISTS", "Builtin_NOTEXISTS"):
            if (name == "Builtin_EXISTS") != opposite:
                return self.inside(one.graph, known)
            group = self.scope.group(parts(one.graph), known)
            return [self.negated(self.sought(group, known, place(one)), bool(group.determined), place(one))]
        if (
            name == "RelationalExpression"
            and one.op in SIGNS
            and (self.numbers.is_number(one.expr) or self.numbers.is_number(one.other))
        ):
            left, right = (self.numbers.expression(side, known, place(one)) for side in (one.expr, one.other))
            return [self.numbers.comparison(left, SIGNS[one.op], right, one.op == "!=", place(one))]
        if name == "RelationalExpression" and one.op in ("=", "!="):
            return [self.equal(one.expr, one.other, one.op == "!=", known)]
        if name == "RelationalExpression" and one.op in ("IN", "NOT IN"):
            equal = [self.equal(one.expr, other, one.op == "NOT IN", known) for other in one.other]
            return equal if one.op == "NOT IN" else [self.any_of([[node] for node in equal], place(one))]
        raise UpdateError(
            "this FILTER isn't supported",
            "compare two terms by = or !=, IN, or write EXISTS, NOT EXISTS, &&, || or !",
            place(one),
        )

    def equal(self, left: Any, right: Any, negated: bool, known: Collection[str]) -> str:
        """Return the node of the condition that two terms are equal or, if `negated`, that they are different."""
        at = place((left, right))
        one, other = (self.scope.put(term(unwrapped(side), at), known, at) for side in (left, right))
        return self.nodes.condition("EqualityCondition", at, equality_properties(one, other), negated)

    def values(self, part: Any, known: Collection[str]) -> str:
        """Return the condition node of a VALUES clause, which states that the variables equal the values of some row."""
        at = place(part)
        rows = [(row,) if isinstance(row, str | CompValue) else tuple(row) for row in part.value or ()]
        if any(len(row) != len(part.var) for row in rows):
            raise UpdateError(
                "a row of VALUES has not as many values as there are variables", "write a value or UNDEF for each", at
            )
        groups = [
            [
                self.equal(name, one, False, known)
                for name, one in zip(part.var, row, strict=True)
                if str(one) != "UNDEF"
            ]
            for row in rows
        ]
        if not groups:
            raise UpdateError("VALUES without a value can never hold", "name some", at)
        return self.any_of(groups, at)

    def any_of(self, groups: Sequence[Sequence[str]], at: int, negated: bool = False) -> str:
        """Return the node of a disjunction of conjunctions; for a single condition, return the node of the condition."""
        if len(groups) == 1 and len(groups[0]) == 1 and not negated:
            return groups[0][0]
        node = self.nodes.new("condition", "AnyOf", at)
        alternatives = []
        for group in groups:
            if not group:
                raise UpdateError("an alternative is empty", "remove it, or write its condition", at)
            if len(group) == 1:
                alternatives.append(group[0])
                continue
            alternatives.append(self.nodes.new("condition", "AllOf", at))
            self.nodes.said[alternatives[-1]]["condition"] = list(group)
        self.nodes.said[node]["alternative"] = alternatives
        if negated:
            self.nodes.negate(node)
        return node

    def negated(self, conditions: Sequence[str], binds: bool, at: int) -> str:
        """Return the node of the negation of a conjunction."""
        if len(conditions) != 1 or (binds and "witness" not in self.nodes.said[conditions[0]]):
            return self.any_of([conditions], at, negated=True)
        self.nodes.negate(conditions[0])
        return self.absence(conditions[0])

    def absence(self, witness: str) -> str:
        """Change a negated witness to an absence condition if the witness tests only one value; return the node."""
        said = self.nodes.said[witness]
        sought, inner = said.get("witness", [""])[0], said.get("condition", [])
        if sought.rpartition(".")[2] != ANYONE[1:] or len(inner) != 1:
            return witness
        tested = self.nodes.said[inner[0]]
        about, *more = (tested.get(name) for name in ARGUMENTS)
        plain = about == [sought] and not any(more) and tested.get("value") != [sought] and "negated" not in tested
        if CORE + "ValueCondition" not in tested[TYPE] or not plain or tested["situationType"][0] in self.pairs:
            return witness
        del self.nodes.said[inner[0]], said["condition"], said["witness"]
        said |= {TYPE: [INDIVIDUAL, CORE + "AbsenceCondition"], "ofClass": self.nodes.said[sought]["termType"]}
        said |= {key: tested[key] for key in ("situationType", "value") if key in tested}
        self.nodes.negate(witness)
        return witness

    @property
    def pairs(self) -> Collection[str]:
        """The situation types that can have several values for one subject."""
        return {s for p, s in self.scope.vocabulary.properties.items() if p not in self.scope.vocabulary.functional}

    def pattern(self, one: Triple, known: Collection[str]) -> str:
        """Return the condition node of a triple pattern."""
        at = one.subject.at
        if one.predicate == A:
            if not isinstance(one.object, Word) or one.object.variable:
                raise UpdateError("a class can't be a variable", "name the class", one.predicate.at)
            term, kind = self.scope.put(one.subject, known, at), self.scope.iri(one.object)
            return self.nodes.condition("ClassCondition", at, class_properties(term, kind))
        prop, vocabulary = self.scope.iri(one.predicate), self.scope.vocabulary
        if vocabulary.numeric(prop):
            right = self.numbers.expression(last_of(one), known, one.predicate.at)
            return self.numbers.comparison(self.numbers.measured(one, known), "=", right, False, at)
        if prop in vocabulary.relations:
            properties = relation_properties(prop, self.arguments(one, known))
            return self.nodes.condition("RelationCondition", at, properties)
        return self.nodes.condition("ValueCondition", at, self.situation(one, known))

    def arguments(self, one: Triple, known: Collection[str]) -> list[str]:
        """Return the nodes of the subject and the objects of a triple; a final ``true`` is left out."""
        said = one.object if isinstance(one.object, tuple) else (one.object,)
        at = one.predicate.at
        if said and isinstance(said[-1], Truth):
            if not said[-1].value:
                raise UpdateError("a relation can't be stated to be false", "write FILTER NOT EXISTS { … true }", at)
            said = said[:-1]
        return [self.scope.put(each, known, at) for each in (one.subject, *said)]

    def situation(self, one: Triple, known: Collection[str]) -> Properties:
        """Return the properties of a condition or effect node that states a symbol's value."""
        prop, at, vocabulary = self.scope.iri(one.predicate), one.predicate.at, self.scope.vocabulary
        if prop in vocabulary.properties:
            if isinstance(one.object, tuple):
                raise UpdateError(f"{one.predicate} takes one value, not a list", "write the value alone", at)
            subject, value = (self.scope.put(each, known, at) for each in (one.subject, one.object))
            return symbol_properties(vocabulary.properties[prop], [subject], value)
        if prop in vocabulary.bare:
            *middle, last = one.object if isinstance(one.object, tuple) else (one.object,)
            terms = [self.scope.put(each, known, at) for each in (one.subject, *middle)]
            return symbol_properties(prop, terms, None if last == Truth(True) else self.scope.put(last, known, at))
        names = {local_name(iri) for iri in (*vocabulary.properties, *vocabulary.bare, *vocabulary.relations)}
        raise UpdateError(
            f"{one.predicate} is neither a property of a situation type, nor a situation type without one, nor a relation"
            f"{nearest(local_name(prop), names)}",
            "correct the name, or declare it",
            at,
        )

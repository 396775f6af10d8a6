"""Compilation of a SPARQL update into a behaviour's individuals, and of a CONSTRUCT query into a rule's individuals.

==========================================  =====================================================================
in the update                               as individuals
==========================================  =====================================================================
``?cup a :Cup`` in the first WHERE          a `:Parameter`, numbered in the order of these patterns
``?cup :at ?from`` with a new ``?from``      a `:ValueCondition` that determines the `:Variable` ``?from``
``?from a :Slot`` after this pattern        the type of ``?from``
``?cup :fits ?slot``                        a `:RelationCondition`
``?shelf :COLOR (?cup :red)``               a `:ValueCondition` whose situation type has several arguments or no value property
``FILTER(?a != ?b)``, ``IN``, ``VALUES``    an `:EqualityCondition`, or an `:AnyOf` of several
``?jug :servings ?n``, ``BIND(… AS ?m)``    ``?n`` and ``?m`` denote numbers; a FILTER on numbers is a `:Comparison`
``FILTER EXISTS { ?x a :Tube … }``          a `:Witness` for ``?x``
``FILTER NOT EXISTS { … }``                 the negation of the conditions inside
``{ … } UNION { … }``, ``||``               an `:AnyOf`
``INSERT``, ``DELETE``                      `:ValueEffect`, `:AmountEffect`; a further operation's WHERE is their `:when`
``CONSTRUCT { ?a :p ?b } WHERE { … }``      a `:Rule` with these conditions; a `:Witness` for variables that the head lacks
``SELECT ?a (SUM(?n) AS ?s) … GROUP BY``    the `:aggregate` of the rule, `:over` the variables that have a type pattern
==========================================  =====================================================================

All conditions, including the conditions of further operations, are evaluated in the state before the behaviour. A variable
denotes the same individual or number in all operations of an update.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction

from confab.reasoner.updates.conditions import Conditions
from confab.reasoner.updates.nodes import Nodes
from confab.reasoner.updates.numbers import Numbers, Sum
from confab.reasoner.updates.scope import Group, VariableScope, last_of, middle_of, variables_in
from confab.reasoner.updates.texts import Update, Vocabulary
from confab.reasoner.updates.words import (
    SELECT,
    A,
    Construction,
    NumberLiteral,
    Triple,
    Truth,
    UpdateError,
    UpdateOperation,
    constructed,
    parsed,
    place,
    words,
)

CHANGES = {"+": "increase", "-": "decrease", "*": "scale"}
"""The kind of change for each operator that combines the old amount with a term."""


class UpdateCompiler:
    """Compiler of the updates of one behaviour, or of the query of one rule.

    Attributes
    ----------
    known : set of str
        The variables that occur in the first WHERE of any update compiled so far.
    """

    def __init__(self, behavior: str, vocabulary: Vocabulary, declared: Mapping[str, tuple[str, str, int]]) -> None:
        self.nodes = Nodes(behavior)
        self.scope = VariableScope(self.nodes, vocabulary, declared)
        self.numbers = Numbers(self.nodes, self.scope)
        self.conditions = Conditions(self.nodes, self.scope, self.numbers)
        self.known: set[str] = set()

    def write(self, update: Update, declared: Collection[str] = ()) -> None:
        """Compile an update.

        The first operation of an update states preconditions and effects; further operations state conditional effects. The
        parameters that the update names or `declared` names come after those of the updates compiled before.
        """
        own, operations = parsed(update.text)
        self.nodes.now, self.scope.prefixes = update, {**update.prefixes, **own}
        first = operations[0]
        later = [(one.delete, one.insert, one.where) for one in operations[1:]]
        used = set(words([first.delete, first.insert, *later]))
        named = {*declared, *used, *words(first.where)}
        for name, (node, kind, number) in self.scope.declared.items():
            if number and name in named and name not in self.scope.terms:
                self.scope.bind(name, kind, "Parameter", node, update.place(0))
        known = self.known | {name for name, (*_, number) in self.scope.declared.items() if number and name in named}
        group = self.scope.group(first.where, known, used)
        for name, kind in group.chosen.items():
            self.scope.bind(name, self.scope.iri(kind), "Parameter", "", update.place(kind.at))
        self.scope.determine(group)
        within = self.known = known | group.names
        self.nodes.links["precondition"] += self.conditions.all_of(group, within)
        self.effects(first, [], within, group)
        for operation in operations[1:]:
            inner = self.scope.group(operation.where, within, set(words([operation.delete, operation.insert])))
            if lost := [
                n for t in (*operation.delete, *operation.insert) for n in variables_in(t) if n in inner.chosen
            ]:
                raise UpdateError(
                    f"{lost[0]} would denote all individuals of its class, but an effect is about one individual",
                    "state its type in the first WHERE, so that it becomes a parameter",
                    lost[0].at,
                )
            when = self.conditions.sought(inner, within, operation.at)
            self.effects(operation, when, within | (inner.names - inner.chosen.keys()), group, inner)

    def write_rule(self, query: Update) -> None:
        """Compile a CONSTRUCT query.

        The head of the query is the rule's conclusion; its WHERE states the rule's conditions or the aggregated tuples.
        """
        own, rule = constructed(query.text)
        self.nodes.now, self.scope.prefixes = query, {**query.prefixes, **own}
        self.nodes.links = {}
        head, prop = rule.head, self.scope.iri(rule.head.predicate)
        group = self.scope.group(rule.where, set(), set(words(rule.argument)) if rule.function != "count" else ())
        named = [word for word in variables_in(head) if word != rule.name]
        if rule.function and {*named} != rule.grouped:
            (lost, *_) = sorted({*named} ^ rule.grouped)
            raise UpdateError(f"{lost} is in the head or in GROUP BY, but not in both", SELECT, head.subject.at)
        for name in named:
            if name in group.chosen:
                kind = group.chosen.pop(name)
                self.scope.bind(name, self.scope.iri(kind), "Variable", "", query.place(kind.at))
        if rule.function or not group.chosen:
            self.scope.determine(group)
        within = {*self.scope.terms, *group.names}
        if rule.function:
            self.total(rule, group, within)
        else:
            asked = self.conditions.witness(group, {*self.scope.terms}, head.subject.at) if group.chosen else None
            self.nodes.links["condition"] = [asked] if asked else self.conditions.all_of(group, within)
            if self.scope.vocabulary.numeric(prop):
                raise UpdateError(f"{head.predicate} is an amount, which a rule aggregates", SELECT, head.predicate.at)
            self.changes(head)
            self.nodes.links |= self.conditions.situation(head, within)
        self.nodes.links = {key: values for key, values in self.nodes.links.items() if values}

    def total(self, rule: Construction, group: Group, within: set[str]) -> None:
        """Compile an aggregate: its amount, the aggregated variables, and the number that each binding adds."""
        at = rule.head.subject.at
        if last_of(rule.head) != rule.name or not self.scope.vocabulary.numeric(self.scope.iri(rule.head.predicate)):
            raise UpdateError(
                f"the head of a rule that aggregates gives an amount the number {rule.name}",
                f"end it by {rule.name}",
                at,
            )
        for name, kind in group.chosen.items():
            self.scope.bind(name, self.scope.iri(kind), "Variable", "", self.nodes.now.place(kind.at))
        self.nodes.links["over"] = [self.scope.terms[name] for name in group.chosen]
        self.nodes.links["condition"] = self.conditions.all_of(group, within)
        own = self.numbers.measured(
            replace(rule.head, object=(*middle_of(rule.head), NumberLiteral(Fraction(0)))), within
        )
        self.nodes.said[self.nodes.behavior] = {**own.properties, "aggregate": [rule.function]}
        for part in group.parts:
            if not isinstance(part, Triple) and part.name == "GroupOrUnionGraphPattern":
                raise UpdateError(
                    "an aggregate counts each alternative of UNION",
                    "write FILTER(EXISTS { … } || EXISTS { … })",
                    place(part),
                )
        if rule.function == "count":
            if lost := sorted({*words(rule.argument)} - within):
                raise UpdateError(f"nothing outside of braces determines {lost[0]}, which is counted", SELECT, at)
        else:
            self.numbers.side(self.nodes.behavior, "right", self.numbers.expression(rule.argument, within, at), at)

    def effects(self, operation: UpdateOperation, when: Sequence[str], known: Collection[str], *asked: Group) -> None:
        """Compile the deletions and insertions of an operation into effects with the conditions `when`."""
        inserted = {(one.subject, one.predicate, middle_of(one)) for one in operation.insert}
        said = {(t.subject, t.predicate, t.object) for group in asked for t in group.parts if isinstance(t, Triple)}
        vocabulary = self.scope.vocabulary
        for one in operation.delete:
            self.changes(one)
            prop = self.scope.iri(one.predicate)
            pair = prop in vocabulary.properties and prop not in vocabulary.functional
            numeric = vocabulary.numeric(prop) and self.scope.numbers.get(str(last_of(one))) == one
            if pair or last_of(one) == Truth(True):
                self.effect(one, when, known, negated=True)
                continue
            where = "(… DELETE { ?x :p ?old } INSERT { ?x :p ?new } WHERE { ?x :p ?old … })"
            if (one.subject, one.predicate, middle_of(one)) not in inserted:
                raise UpdateError(
                    f"{one.predicate} always has one value, and would have none",
                    f"insert the one that it gets {where}",
                    one.predicate.at,
                )
            if (one.subject, one.predicate, one.object) not in said and not numeric:
                raise UpdateError(
                    f"{one.predicate} is deleted with a value that WHERE doesn't state",
                    f"state it there, or leave out DELETE: the inserted value replaces the previous one {where}",
                    one.predicate.at,
                )
        for one in operation.insert:
            self.changes(one)
            self.effect(one, when, known, negated=False)

    def changes(self, one: Triple) -> None:
        """Raise `UpdateError` unless the predicate of a triple is a situation type or the value property of a situation type."""
        prop = "" if one.predicate == A else self.scope.iri(one.predicate)
        if prop and prop not in self.scope.vocabulary.relations:
            return
        what = (
            f"{one.predicate} is a relation, which nothing changes"
            if prop
            else "the class of an individual doesn't change"
        )
        raise UpdateError(what, "use the property of a situation type", one.predicate.at)

    def effect(self, one: Triple, when: Sequence[str], known: Collection[str], negated: bool) -> None:
        """Compile an inserted triple, or a deleted triple if `negated`, into an effect."""
        if self.scope.vocabulary.numeric(self.scope.iri(one.predicate)):
            node = self.nodes.new("effect", "AmountEffect", one.subject.at)
            own, by = self.numbers.measured(one, known), self.numbers.expression(last_of(one), known, one.predicate.at)
            change = CHANGES[by.sign] if isinstance(by, Sum) and by.left == own and by.sign in CHANGES else "assign"
            self.nodes.said[node] |= {**own.properties, "change": [change]}
            by = by.right if isinstance(by, Sum) and change != "assign" else by
            self.numbers.side(node, "right", by, one.subject.at)
        else:
            node = self.nodes.new("effect", "ValueEffect", one.subject.at)
            self.nodes.said[node] |= self.conditions.situation(one, known)
        if negated:
            self.nodes.negate(node)
        if when:
            self.nodes.said[node]["when"] = list(when)
        self.nodes.links["postcondition"].append(node)

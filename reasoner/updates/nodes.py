"""A behaviour written as a SPARQL update, or a rule as a CONSTRUCT query, compiled into the individuals that say the same.

==========================================  =====================================================================
in the update                               as individuals
==========================================  =====================================================================
``?cup a :Cup`` in the first WHERE          a `:Parameter`, in the order of these patterns
``?cup :at ?from``, ``?from`` being new     a `:ValueCondition` that determines the `:Variable` ``?from``
``?from a :Slot`` behind that               the type of that variable
``?cup :fits ?slot``                        a `:RelationCondition`
``?shelf :COLOR (?cup :red)``               a situation type without a property of its own, or with several arguments
``FILTER(?a != ?b)``, ``IN``, ``VALUES``    `:EqualityCondition`, several in an `:AnyOf`
``?jug :servings ?n``, ``BIND(… AS ?m)``    ``?n`` and ``?m`` stand for numbers; a FILTER of them is a `:Comparison`
``FILTER EXISTS { ?x a :Tube … }``          a `:Witness` that looks for ``?x``
``FILTER NOT EXISTS { … }``                 what is inside, negated
``{ … } UNION { … }``, ``||``               an `:AnyOf`
``INSERT``, ``DELETE``                      `:ValueEffect`, `:AmountEffect`; those of a further operation `:when` its WHERE held
``CONSTRUCT { ?a :p ?b } WHERE { … }``      a `:Rule` with these conditions; a variable that isn't in the head, in a `:Witness`
``SELECT ?a (SUM(?n) AS ?s) … GROUP BY``    the `:aggregate` of that rule, `:over` the variables that begin with their type
==========================================  =====================================================================

All that is asked is asked of the situation before the behaviour, also by further operations; a variable means the same in all.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any, TypeAlias

import pyoxigraph as ox

from confab.reasoner.amounts import written
from confab.reasoner.names import local_name, nearest
from confab.reasoner.updates.texts import Place, Update, Vocabulary
from confab.reasoner.updates.words import (
    SELECT,
    A,
    Construction,
    Number,
    Operation,
    Said,
    Triple,
    Truth,
    UpdateError,
    Word,
    constructed,
    parsed,
    parts,
    place,
    term,
    triples,
    words,
)
from confab.reasoner.vocabulary import ARGUMENTS, CORE, INDIVIDUAL, TYPE, XSD

SIGNS = {sign: sign for sign in ("<", "<=", "=", ">=", ">")} | {"!=": "="}
CHANGES = {"+": "increase", "-": "decrease", "*": "scale"}
"""The change of an amount that becomes itself, an operator, and a term."""
ARITHMETIC = ("AdditiveExpression", "MultiplicativeExpression", "UnaryMinus")
ANYONE = "?anyone"
"""The name of a variable that is only the subject of an absence condition."""


@dataclass
class Writer:
    """Writes the nodes of one behaviour.

    `terms` leads from a variable to its node; `known` are those of the first WHERE of each update so far; `kinds` tells of each
    node what it is, so that two things of one name become two nodes; `nodes` has the properties of each node, `links` those of
    the behaviour; `now` is the update being read.
    """

    behavior: str
    vocabulary: Vocabulary
    declared: Mapping[str, tuple[str, str, int]]
    terms: dict[str, str] = field(default_factory=dict)
    known: set[str] = field(default_factory=set)
    kinds: dict[str, tuple[str, str, bool]] = field(default_factory=dict)
    nodes: dict[str, dict[str, list[str]]] = field(default_factory=dict)
    places: dict[str, Place] = field(default_factory=dict)
    links: dict[str, list[str]] = field(
        default_factory=lambda: {"parameter": [], "precondition": [], "postcondition": []}
    )
    count: dict[str, int] = field(default_factory=dict)
    prefixes: dict[str, str] = field(default_factory=dict)
    numbers: dict[str, Any] = field(default_factory=dict)
    now: Update = field(default_factory=lambda: Update("", "", {}))

    def write(self, update: Update) -> None:
        """Add an update; its first operation is the behaviour's, further ones are conditional."""
        own, operations = parsed(update.text)
        self.now, self.prefixes = update, {**update.prefixes, **own}
        for name, (node, kind, number) in self.declared.items():
            if number and name not in self.terms:
                self.bind(name, kind, "Parameter", node, update.place(0))
        known, first = self.known | {name for name, (_, _, number) in self.declared.items() if number}, operations[0]
        group = self.group(first.where, known)
        for name, kind in group.chosen.items():
            self.bind(name, self.iri(kind), "Parameter", "", update.place(kind.at))
        self.determine(group)
        within = self.known = known | group.names
        self.links["precondition"] += self.conditions(group, within)
        self.effects(first, [], within, group)
        for operation in operations[1:]:
            inner = self.group(operation.where, within)
            if lost := [n for t in (*operation.delete, *operation.insert) for n in _variables(t) if n in inner.chosen]:
                raise UpdateError(
                    f"{lost[0]} would stand for all of its class, but an effect is about one individual",
                    "make it a parameter by giving it its type in the first WHERE",
                    lost[0].at,
                )
            when = self.sought(inner, within, operation.at)
            self.effects(operation, when, within | (inner.names - inner.chosen.keys()), group, inner)

    def write_rule(self, query: Update) -> None:
        """Add what a CONSTRUCT query says: its head is what follows, its WHERE when it does, or what is aggregated."""
        own, rule = constructed(query.text)
        self.now, self.prefixes = query, {**query.prefixes, **own}
        self.links = {}
        head, prop = rule.head, self.iri(rule.head.predicate)
        group = self.group(rule.where, set())
        named = [word for word in _variables(head) if word != rule.name]
        if rule.function and {*named} != rule.grouped:
            (lost, *_) = sorted({*named} ^ rule.grouped)
            raise UpdateError(f"{lost} stands in the head or in GROUP BY, and not in both", SELECT, head.subject.at)
        for name in named:
            if name in group.chosen:
                kind = group.chosen.pop(name)
                self.bind(name, self.iri(kind), "Variable", "", query.place(kind.at))
        self.determine(group)
        within = {*self.terms, *group.names}
        if rule.function:
            self.total(rule, group, within)
        else:
            asked = self.witness(group, {*self.terms}, head.subject.at) if group.chosen else None
            self.links["condition"] = [asked] if asked else self.conditions(group, within)
            if self.vocabulary.numeric(prop):
                raise UpdateError(f"{head.predicate} is an amount, which a rule aggregates", SELECT, head.predicate.at)
            self.changes(head)
            self.links |= {key: [value] for key, value in self.situation(head, within).items()}
        self.links = {key: values for key, values in self.links.items() if values}

    def total(self, rule: Construction, group: _Group, within: set[str]) -> None:
        """Add what an aggregate says: its amount, what it is aggregated over, and the number of each."""
        at = rule.head.subject.at
        if _last(rule.head) != rule.name or not self.vocabulary.numeric(self.iri(rule.head.predicate)):
            raise UpdateError(
                f"the head of a rule that aggregates gives an amount the number {rule.name}",
                f"end it by {rule.name}",
                at,
            )
        for name, kind in group.chosen.items():
            self.bind(name, self.iri(kind), "Variable", "", self.now.place(kind.at))
        self.links["over"] = [self.terms[name] for name in group.chosen]
        self.links["condition"] = self.conditions(group, within)
        own = self.measured(replace(rule.head, object=(*_middle(rule.head), Number(Fraction(0)))), within)
        self.nodes[self.behavior] = {**own.said(), CORE + "aggregate": [rule.function]}
        if rule.argument is not None:
            self.side(self.behavior, "right", self.expression(rule.argument, within, at), at)

    # ---------------------------------------------------------------------------------------------------------- terms

    def bind(self, name: str, kind: str, role: str, node: str, place: Place, sought: bool = False) -> None:
        """Make a variable a term of the behaviour; a different variable of the same name becomes another term."""
        found = self.declared.get(name, ("", "", 0))
        if not node and found[0]:
            node = found[0]
        for attempt in range(1, 1000):
            iri = node or f"{self.behavior}.{name[1:]}{'' if attempt == 1 else f'_{attempt}'}"
            if self.kinds.setdefault(iri, (role, kind, sought)) == (role, kind, sought):
                break
        self.terms[name] = iri
        if iri in self.places:
            return
        self.places[iri] = place
        if role == "Parameter":
            self.links["parameter"].append(iri)
        if found[0] != iri:
            self.nodes[iri] = {TYPE: [INDIVIDUAL, CORE + role], CORE + "termType": [kind]}
            if role == "Parameter":
                self.nodes[iri][CORE + "index"] = [str(len(self.links["parameter"]))]

    def determine(self, group: _Group) -> None:
        """Make variables of the terms that value conditions determine."""
        for name, (kind, at) in group.determined.items():
            iri = self.iri(kind) if isinstance(kind, Word) else kind
            self.bind(name, iri, "Variable", "", self.now.place(at))

    def iri(self, word: Word) -> str:
        """Return the IRI of a name."""
        if word.startswith("<"):
            return word[1:-1]
        prefix, _, name = word.partition(":")
        if prefix not in self.prefixes:
            raise UpdateError(
                f"nothing says what the prefix '{prefix}:' stands for{nearest(prefix, self.prefixes)}",
                f"declare it at the top of the file, or write PREFIX {prefix}: <…> before the update",
                word.at,
            )
        return self.prefixes[prefix] + name

    def put(self, said: Said, known: Collection[str], at: int) -> str:
        """Return the node or individual of a term."""
        if isinstance(said, Truth):
            return CORE + ("true" if said.value else "false")
        if isinstance(said, Number):
            raise UpdateError(
                f"'{written(said.value)}' stands where an individual belongs",
                "name an individual, or use a variable",
                at,
            )
        if not said.variable:
            return self.iri(said)
        if said in self.numbers:
            raise UpdateError(
                f"{said} is a number, and stands where an individual belongs", "name an individual", said.at
            )
        if said not in known:
            raise UpdateError(
                f"nothing says what {said} stands for",
                f"give it a type where it begins ({said} a …) to choose or seek it, or let a situation determine it (… ?x {said})",
                said.at,
            )
        return self.terms[said]

    # --------------------------------------------------------------------------------------------------------- groups

    def group(self, where: Sequence[Any], known: Collection[str]) -> _Group:
        """Return the parts of a group, and the variables introduced in it: by class, or as the value of a situation."""
        found = _Group()
        for part in where:
            if part.name in ("TriplesBlock", "Read"):
                flat = part.triples if part.name == "Read" else [t for block in part.triples for t in triples(block)]
                found.parts += [one for one in flat if not self.begins(one, found, known)]
            elif part.name == "GroupOrUnionGraphPattern" and len(part.graph) == 1:
                inner = self.group(parts(part.graph[0]), {*known, *found.names})
                found.parts += inner.parts
                found.chosen |= inner.chosen
                found.determined |= inner.determined
                found.numbers |= inner.numbers
            elif part.name == "Bind":
                found.numbers[part.var] = part.expr
            else:
                found.parts.append(part)
        self.numbers |= found.numbers
        return found

    def begins(self, one: Triple, group: _Group, known: Collection[str]) -> bool:
        """Record a triple about new variables; return whether it has no other meaning."""
        subject, value = one.subject, one.object
        if one.predicate == A:
            if subject.variable and isinstance(value, Word) and not value.variable and subject not in known:
                if subject not in group.names:
                    group.chosen[subject] = value
                    return True
                if subject in group.determined and not isinstance(group.determined[subject][0], Word):
                    group.determined[subject] = value, subject.at
                    return True
            return False
        last = value[-1] if isinstance(value, tuple) and value else value
        if isinstance(last, Word) and last.variable and last not in known and last not in group.names:
            prop = self.iri(one.predicate)
            if self.vocabulary.numeric(prop):
                group.numbers[last] = one
                return True
            if prop in self.vocabulary.functional and prop in self.vocabulary.properties:
                group.determined[last] = self.vocabulary.properties[prop], last.at
            elif prop in self.vocabulary.bare:
                group.determined[last] = prop, last.at
        return False

    def sought(self, group: _Group, known: Collection[str], at: int) -> list[str]:
        """Return the conditions of a nested group, with witnesses for the variables that it introduces."""
        if not group.chosen:
            self.determine(group)
            return self.conditions(group, {*known, *group.names})
        return [self.witness(group, known, at)]

    def witness(self, group: _Group, known: Collection[str], at: int) -> str:
        """Return nested witnesses for the variables that a group introduces."""
        inside = {*known, *group.names}
        names = list(group.chosen)
        depth = {name: level for level, name in enumerate(names)}
        for one in [part for part in group.parts if isinstance(part, Triple)] * len(group.determined):
            last = _last(one)
            if last in group.determined:
                depth[str(last)] = max(depth.get(word, 0) for word in _variables(one))
        for name, said in group.numbers.items():
            depth[name] = max((depth.get(word, 0) for word in _mentioned(said)), default=0)
        levels: list[list[Any]] = [[] for _ in names]
        for part in group.parts:
            levels[max((depth.get(name, 0) for name in _mentioned(part)), default=0)].append(part)
        made = []
        for name, word in group.chosen.items():
            node, kind = self.new("condition", "Witness", word.at), self.iri(word)
            self.bind(name, kind, "Variable", "", self.now.place(word.at), sought=True)
            self.nodes[node][CORE + "witness"] = [self.terms[name]]
            made.append((node, name, kind))
        self.determine(group)
        for level, (node, sought, kind) in enumerate(made):
            found = self.conditions(_Group(levels[level]), inside)
            found += [deeper for deeper, *_ in made[level + 1 : level + 2]]
            if not found:  # that there is one of its class is all
                found = [self.leaf("ClassCondition", at, about=self.terms[sought], ofClass=kind)]
            self.nodes[node][CORE + "condition"] = found
        return made[0][0]

    # ----------------------------------------------------------------------------------------------------- conditions

    def conditions(self, group: _Group, known: Collection[str]) -> list[str]:
        """Return the nodes of a group's conditions."""
        return [node for part in group.parts for node in self.part(part, known)]

    def part(self, part: Any, known: Collection[str]) -> list[str]:
        """Return the conditions of one part of a group."""
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
            f"{part.name.removesuffix('GraphPattern').upper()} isn't read here",
            advice.get(part.name, "write patterns, FILTER, UNION and VALUES"),
            place(part),
        )

    def inside(self, graph: Any, known: Collection[str]) -> list[str]:
        """Return the conditions of a group in braces."""
        return self.sought(self.group(parts(graph), known), known, place(graph))

    def filter(self, expression: Any, known: Collection[str]) -> list[str]:
        """Return the conditions whose conjunction a FILTER means."""
        one = _unwrapped(expression)
        name = getattr(one, "name", "")
        if name == "ConditionalAndExpression":
            return [node for each in (one.expr, *one.other) for node in self.filter(each, known)]
        if name == "ConditionalOrExpression":
            return [self.any_of([self.filter(each, known) for each in (one.expr, *one.other)], place(one))]
        if name == "UnaryNot":
            return [self.negated(self.filter(one.expr, known), False, place(one))]
        if name == "Builtin_EXISTS":
            return self.inside(one.graph, known)
        if name == "Builtin_NOTEXISTS":
            group = self.group(parts(one.graph), known)
            return [self.negated(self.sought(group, known, place(one)), bool(group.determined), place(one))]
        if (
            name == "RelationalExpression"
            and one.op in SIGNS
            and (self.is_number(one.expr) or self.is_number(one.other))
        ):
            left, right = (self.expression(side, known, place(one)) for side in (one.expr, one.other))
            return [self.comparison(left, SIGNS[one.op], right, one.op == "!=", place(one))]
        if name == "RelationalExpression" and one.op in ("=", "!="):
            return [self.equal(one.expr, one.other, one.op == "!=", known)]
        if name == "RelationalExpression" and one.op in ("IN", "NOT IN"):
            equal = [self.equal(one.expr, other, one.op == "NOT IN", known) for other in one.other]
            return equal if one.op == "NOT IN" else [self.any_of([[node] for node in equal], place(one))]
        raise UpdateError(
            "this FILTER isn't read here",
            "compare two terms by = or !=, IN, or write EXISTS, NOT EXISTS, &&, || or !",
            place(one),
        )

    def equal(self, left: Any, right: Any, negated: bool, known: Collection[str]) -> str:
        """Return the condition that two terms are the same, or differ."""
        at = place((left, right))
        one, other = (term(_unwrapped(side), at) for side in (left, right))
        node = self.leaf("EqualityCondition", at, about=self.put(one, known, at), value=self.put(other, known, at))
        if negated:
            self.nodes[node][CORE + "negated"] = ["true"]
        return node

    def values(self, part: Any, known: Collection[str]) -> str:
        """Return the condition of VALUES: one of its rows applies."""
        at = place(part)
        several = not isinstance(part.var[0], str) or len(part.var) > 1
        rows = [tuple(row) if several else (row,) for row in part.value or ()]
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
        """Return a disjunction of groups of conditions; of a single condition, that condition."""
        if len(groups) == 1 and len(groups[0]) == 1 and not negated:
            return groups[0][0]
        node = self.new("condition", "AnyOf", at)
        alternatives = []
        for group in groups:
            if not group:
                raise UpdateError("an alternative says nothing", "take it out, or say what has to hold", at)
            if len(group) == 1:
                alternatives.append(group[0])
                continue
            alternatives.append(self.new("condition", "AllOf", at))
            self.nodes[alternatives[-1]][CORE + "condition"] = list(group)
        self.nodes[node][CORE + "alternative"] = alternatives
        if negated:
            self.nodes[node][CORE + "negated"] = ["true"]
        return node

    def negated(self, conditions: Sequence[str], binds: bool, at: int) -> str:
        """Return the negation of a conjunction."""
        if len(conditions) != 1 or (binds and CORE + "witness" not in self.nodes[conditions[0]]):
            return self.any_of([conditions], at, negated=True)
        said = self.nodes[conditions[0]]
        if said.pop(CORE + "negated", None) is None:
            said[CORE + "negated"] = ["true"]
        return self.absence(conditions[0])

    def absence(self, witness: str) -> str:
        """Return a witness that only tests a value as the equivalent absence condition."""
        said = self.nodes[witness]
        found = [self.nodes[inner] for inner in said.get(CORE + "condition", ())]
        sought = said.get(CORE + "witness", [""])[0]
        if sought.rpartition(".")[2] != ANYONE[1:] or len(found) != 1 or CORE + "ValueCondition" not in found[0][TYPE]:
            return witness
        about, *more = (found[0].get(CORE + name) for name in ARGUMENTS)
        pair = found[0].get(CORE + "situationType", [""])[0] in self.pairs
        if (
            about != [sought]
            or any(more)
            or found[0].get(CORE + "value") == [sought]
            or CORE + "negated" in found[0]
            or pair
        ):
            return witness
        said[TYPE] = [INDIVIDUAL, CORE + "AbsenceCondition"]
        said |= {CORE + "ofClass": self.nodes[sought][CORE + "termType"]}
        said |= {key: found[0][key] for key in (CORE + "situationType", CORE + "value") if key in found[0]}
        if said.pop(CORE + "negated", None) is None:
            said[CORE + "negated"] = ["true"]
        del self.nodes[said.pop(CORE + "condition")[0]], said[CORE + "witness"]
        return witness

    @property
    def pairs(self) -> Collection[str]:
        """The situation types with several values per subject."""
        return {s for p, s in self.vocabulary.properties.items() if p not in self.vocabulary.functional}

    def pattern(self, one: Triple, known: Collection[str]) -> str:
        """Return the condition of a triple."""
        if one.predicate == A:
            if not isinstance(one.object, Word) or one.object.variable:
                raise UpdateError("a class isn't looked for", "name the class", one.predicate.at)
            about = self.put(one.subject, known, one.subject.at)
            return self.leaf("ClassCondition", one.subject.at, about=about, ofClass=self.iri(one.object))
        prop = self.iri(one.predicate)
        if self.vocabulary.numeric(prop):
            right = self.expression(_last(one), known, one.predicate.at)
            return self.comparison(self.measured(one, known), "=", right, False, one.subject.at)
        if prop in self.vocabulary.relations:
            arguments = self.arguments(one, known)
            *first, last = arguments
            said = dict(zip(ARGUMENTS, first or [last], strict=False)) | ({"value": last} if first else {})
            return self.leaf("RelationCondition", one.subject.at, relation=prop, **said)
        return self.leaf("ValueCondition", one.subject.at, **self.situation(one, known))

    def arguments(self, one: Triple, known: Collection[str]) -> list[str]:
        """Return the nodes of subject and object, ``true`` left out."""
        said = one.object if isinstance(one.object, tuple) else (one.object,)
        at = one.predicate.at
        if said and isinstance(said[-1], Truth):
            if not said[-1].value:
                raise UpdateError("a relation isn't said to be false", "write FILTER NOT EXISTS { … true }", at)
            said = said[:-1]
        return [self.put(one.subject, known, at), *(self.put(each, known, at) for each in said)]

    def situation(self, one: Triple, known: Collection[str]) -> dict[str, str]:
        """Return the properties that state a situation's value."""
        prop, at = self.iri(one.predicate), one.predicate.at
        if prop in self.vocabulary.properties:
            if isinstance(one.object, tuple):
                raise UpdateError(f"{one.predicate} takes one value, not a list", "write the value alone", at)
            return {
                "about": self.put(one.subject, known, at),
                "situationType": self.vocabulary.properties[prop],
                "value": self.put(one.object, known, at),
            }
        if prop in self.vocabulary.bare:
            *middle, last = one.object if isinstance(one.object, tuple) else (one.object,)
            terms = [self.put(each, known, at) for each in (one.subject, *middle)]
            said = dict(zip(ARGUMENTS, terms, strict=False)) | {"situationType": prop}
            return said if last == Truth(True) else {**said, "value": self.put(last, known, at)}
        names = {
            local_name(iri) for iri in (*self.vocabulary.properties, *self.vocabulary.bare, *self.vocabulary.relations)
        }
        raise UpdateError(
            f"{one.predicate} is neither a property of a situation type, nor a situation type without one, nor a relation"
            f"{nearest(local_name(prop), names)}",
            "mend the name, or declare it",
            at,
        )

    # -------------------------------------------------------------------------------------------------------- numbers

    def is_number(self, tree: Any) -> bool:
        """Return whether an expression is numeric."""
        one = _unwrapped(tree)
        if isinstance(one, Word):
            return one in self.numbers
        return getattr(one, "name", "") in ARITHMETIC or isinstance(_term_or_none(one), Number)

    def expression(self, tree: Any, known: Collection[str], at: int) -> _Side:
        """Return the calculation of a number."""
        one = _unwrapped(tree)
        if isinstance(one, Number):
            return one
        if isinstance(one, Word) and one in self.numbers and one in known:
            said = self.numbers[one]
            return self.measured(said, known) if isinstance(said, Triple) else self.expression(said, known, at)
        name = getattr(one, "name", "")
        if name == "UnaryMinus":
            found = self.expression(one.expr, known, at)
            return Number(-found.value) if isinstance(found, Number) else _Sum("-", Number(Fraction(0)), found)
        if name in ARITHMETIC:
            found = self.expression(one.expr, known, at)
            for sign, other in zip(one.op, one.other, strict=True):
                found = _Sum(str(sign), found, self.expression(other, known, at))
            return found
        number = _term_or_none(one)
        if isinstance(number, Number):
            return number
        what = f"{one} is no number" if isinstance(one, Word) else "this is no number"
        raise UpdateError(what, "compare and calculate with numbers, and with variables that amounts give one", at)

    def measured(self, one: Triple, known: Collection[str]) -> _Measured:
        """Return the amount in a triple."""
        prop, at = self.iri(one.predicate), one.predicate.at
        terms = [self.put(each, known, at) for each in (one.subject, *_middle(one))]
        kind = "relation" if prop in self.vocabulary.measures else "situationType"
        return _Measured(kind, self.vocabulary.properties.get(prop, prop), tuple(terms))

    def comparison(self, left: _Side, sign: str, right: _Side, negated: bool, at: int) -> str:
        """Return a comparison of two numbers."""
        node = self.new("condition", "Comparison", at)
        self.nodes[node][CORE + "sign"] = [sign]
        self.side(node, "left", left, at)
        self.side(node, "right", right, at)
        if negated:
            self.nodes[node][CORE + "negated"] = ["true"]
        return node

    def side(self, node: str, name: str, side: _Side, at: int) -> None:
        """Write one side of a comparison, calculation or effect: an amount on the left and a number on the right need no node."""
        if name == "left" and isinstance(side, _Measured):
            self.nodes[node] |= side.said()
            return
        if name == "right" and isinstance(side, Number):
            self.nodes[node][CORE + "amount"] = [written(side.value)]
            return
        inner = self.new("amount", "Calculation", at)
        self.nodes[node][CORE + name] = [inner]
        match side:
            case _Measured():
                self.nodes[inner] |= side.said()
            case Number(value):
                self.nodes[inner][CORE + "amount"] = [written(value)]
            case _Sum(sign, left, right):
                self.nodes[inner][CORE + "sign"] = [sign]
                self.side(inner, "left", left, at)
                self.side(inner, "right", right, at)

    # -------------------------------------------------------------------------------------------------------- effects

    def effects(self, operation: Operation, when: Sequence[str], known: Collection[str], *asked: _Group) -> None:
        """Add the deletions and insertions of an operation."""
        inserted = {(one.subject, one.predicate, _middle(one)) for one in operation.insert}
        said = {(t.subject, t.predicate, t.object) for group in asked for t in group.parts if isinstance(t, Triple)}
        for one in operation.delete:
            self.changes(one)
            prop = self.iri(one.predicate)
            pair = prop in self.vocabulary.properties and prop not in self.vocabulary.functional
            one_value = not pair and _last(one) != Truth(True)
            numeric = self.vocabulary.numeric(self.iri(one.predicate)) and self.numbers.get(str(_last(one))) == one
            if not one_value:
                self.effect(one, when, known, negated=True)
                continue
            where = "(… DELETE { ?x :p ?old } INSERT { ?x :p ?new } WHERE { ?x :p ?old … })"
            if (one.subject, one.predicate, _middle(one)) not in inserted:
                raise UpdateError(
                    f"{one.predicate} always has one value, and would have none",
                    f"insert the one that it gets {where}",
                    one.predicate.at,
                )
            if (one.subject, one.predicate, one.object) not in said and not numeric:
                raise UpdateError(
                    f"{one.predicate} is deleted with a value that WHERE doesn't say it has",
                    f"say so there, or leave out DELETE: what is inserted takes the place of what was {where}",
                    one.predicate.at,
                )
        for one in operation.insert:
            self.changes(one)
            self.effect(one, when, known, negated=False)

    def changes(self, one: Triple) -> None:
        """Raise `UpdateError` unless a triple is about a changing situation."""
        prop = "" if one.predicate == A else self.iri(one.predicate)
        if prop and prop not in self.vocabulary.relations:
            return
        what = (
            f"{one.predicate} is a relation, which nothing changes" if prop else "what is of which class doesn't change"
        )
        raise UpdateError(what, "use the property of a situation type", one.predicate.at)

    def effect(self, one: Triple, when: Sequence[str], known: Collection[str], negated: bool) -> None:
        """Add the effect of a triple: inserted, or deleted if negated."""
        if self.vocabulary.numeric(self.iri(one.predicate)):
            node = self.new("effect", "AmountEffect", one.subject.at)
            own, by = self.measured(one, known), self.expression(_last(one), known, one.predicate.at)
            change = CHANGES[by.sign] if isinstance(by, _Sum) and by.left == own and by.sign in CHANGES else "assign"
            self.nodes[node] |= {**own.said(), CORE + "change": [change]}
            self.side(node, "right", by.right if isinstance(by, _Sum) and change != "assign" else by, one.subject.at)
        else:
            node = self.new("effect", "ValueEffect", one.subject.at)
            self.nodes[node] |= {CORE + key: [value] for key, value in self.situation(one, known).items()}
        if negated:
            self.nodes[node][CORE + "negated"] = ["true"]
        if when:
            self.nodes[node][CORE + "when"] = list(when)
        self.links["postcondition"].append(node)

    # ---------------------------------------------------------------------------------------------------------- nodes

    def new(self, name: str, kind: str, at: int) -> str:
        """Return a new node, named by a number."""
        self.count[name] = self.count.get(name, 0) + 1
        node = f"{self.behavior}.{name}{self.count[name]:03}"
        self.nodes[node] = {TYPE: [INDIVIDUAL, CORE + kind]}
        self.places[node] = self.now.place(at)
        return node

    def leaf(self, kind: str, at: int, **said: str) -> str:
        """Return a new condition with nothing but its properties."""
        node = self.new("condition", kind, at)
        self.nodes[node] |= {CORE + key: [value] for key, value in said.items()}
        return node

    def triples(self) -> Iterator[ox.Triple]:
        """Yield the triples of the behaviour and its nodes."""
        links = {CORE + link: found for link, found in self.links.items()}
        for node, said in [(self.behavior, links), *self.nodes.items()]:
            for prop, found in said.items():
                for value in found:
                    yield ox.Triple(ox.NamedNode(node), ox.NamedNode(prop), _object(prop, value))


@dataclass(frozen=True)
class _Measured:
    """The amount of some individuals, or the number that a relation gives for them."""

    kind: str
    of: str
    terms: tuple[str, ...]

    def said(self) -> dict[str, list[str]]:
        """Return the properties that say it."""
        terms = {CORE + name: [node] for name, node in zip(ARGUMENTS, self.terms, strict=False)}
        return {CORE + self.kind: [self.of], **terms}


@dataclass(frozen=True)
class _Sum:
    """An arithmetic operation on two numbers."""

    sign: str
    left: _Side
    right: _Side


_Side: TypeAlias = "_Measured | _Sum | Number"


@dataclass
class _Group:
    """A group of patterns, without those that only say how its variables begin.

    `chosen` are variables that begin with their type; `determined` those that begin as the value of a situation, each with
    its type (a word), or the situation type if it has none, and its place; `numbers` those that stand for a number, each with
    the triple that gives it or the expression of its BIND.
    """

    parts: list[Any] = field(default_factory=list)
    chosen: dict[str, Word] = field(default_factory=dict)
    determined: dict[str, tuple[Word | str, int]] = field(default_factory=dict)
    numbers: dict[str, Any] = field(default_factory=dict)

    @property
    def names(self) -> set[str]:
        return {*self.chosen, *self.determined, *self.numbers}


def _object(prop: str, value: str) -> ox.NamedNode | ox.Literal:
    if prop == CORE + "negated":
        return ox.Literal(True)
    if prop == CORE + "amount":
        return ox.Literal(value, datatype=ox.NamedNode(XSD + "decimal"))
    if prop in (CORE + "sign", CORE + "change", CORE + "aggregate"):
        return ox.Literal(value)
    return ox.Literal(int(value)) if prop == CORE + "index" else ox.NamedNode(value)


def _term_or_none(tree: Any) -> Said | None:
    """Return a term, if it is one."""
    with suppress(UpdateError):
        return term(tree, 0)
    return None


def _variables(one: Triple) -> list[Word]:
    said = one.object if isinstance(one.object, tuple) else (one.object,)
    return [word for word in (one.subject, *said) if isinstance(word, Word) and word.variable]


def _last(one: Triple) -> Said:
    return one.object[-1] if isinstance(one.object, tuple) else one.object


def _middle(one: Triple) -> tuple[Said, ...]:
    return one.object[:-1] if isinstance(one.object, tuple) else ()


def _unwrapped(expression: Any) -> Any:
    """Return an expression without redundant levels of the grammar."""
    passing = ("ConditionalOrExpression", "ConditionalAndExpression", "RelationalExpression", "AdditiveExpression")
    while getattr(expression, "name", "") in (*passing, "MultiplicativeExpression") and not expression.other:
        expression = expression.expr
    return expression


def _mentioned(part: Any) -> set[str]:
    return {word for word in words(part) if word.variable}

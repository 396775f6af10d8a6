"""Compilation of SWRL rules, in the form that Protégé writes, into rules of situation types.

===========================================  ==================================================================
in SWRL                                      in `confab.reasoner.symbols`
===========================================  ==================================================================
head ``isInside(?x, ?z)``                    `Rule` of the situation type with this value property
head ``Heavy(?x)``                           `Rule` of the situation type that ``:holdsOf`` the class
first class atom ``Cup(?x)`` of ``?x``       the class of the term ``?x``
further class atoms of ``?x``                `ClassCondition`, or the conditions of the class's definition
``liesIn(?x, ?y)``                           `ValueCondition` or `RelationCondition`
``sameAs``, ``differentFrom``                `EqualityCondition`
``weight(?x, ?w)``                           ``?w`` denotes the amount
``greaterThan(?w, 5)``, ``add(?s, ?w, 1)``   `Comparison`, `Calculation`
===========================================  ==================================================================

A variable that occurs only in the body is determined by a functional value property or bound by a `Witness`. Rules are DL-safe:
variables denote only named individuals of the scene.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from confab.reasoner.amounts import Calculation, Expression, exact
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.language import mentions
from confab.reasoner.names import local_name
from confab.reasoner.reading.definitions import INSIDE, Definitions
from confab.reasoner.symbols import (
    TRUE,
    Comparison,
    Condition,
    EqualityCondition,
    Parameter,
    Rule,
    ValueCondition,
    Witness,
)
from confab.reasoner.vocabulary import LABEL, RDF, TYPE

SWRL = "http://www.w3.org/2003/11/swrl#"
BUILT_IN = "http://www.w3.org/2003/11/swrlb#"
ENABLED = "http://swrl.stanford.edu/ontologies/3.3/swrla.owl#isRuleEnabled"
RULES = f"""{{ ?rule a <{SWRL}Imp> .
      ?rule (<{SWRL}body>|<{SWRL}head>|rdf:first|rdf:rest|<{SWRL}arguments>|<{SWRL}classPredicate>|{INSIDE})* ?node .
      ?node ?property ?value . FILTER(isBlank(?node) || ?node = ?rule) }} UNION
    {{ ?node a <{SWRL}Variable> . BIND(rdf:type AS ?property) BIND(<{SWRL}Variable> AS ?value) }}"""
"""SPARQL pattern for all SWRL rules and their parts, as (node, property, value)."""

COMPARES = {"lessThan": "<", "lessThanOrEqual": "<=", "equal": "=", "greaterThanOrEqual": ">=", "greaterThan": ">"}
COMPUTES = {"add": "+", "subtract": "-", "multiply": "*", "divide": "/"}

_FIRST, _REST = RDF + "first", RDF + "rest"

Node = Mapping[str, Sequence[str]]
Atom = tuple[str, tuple[str, ...]]
"""A predicate and its arguments: IRIs of variables and individuals, or numbers as text."""


def heads(nodes: Mapping[str, Node]) -> set[str]:
    """Return the classes in the heads of the rules."""
    atoms = (node for node in nodes.values() if SWRL + "ClassAtom" in node.get(TYPE, ()))
    by_atom = {id(atom): atom.get(SWRL + "classPredicate", [""])[0] for atom in atoms}
    found = set()
    for rule in _rules(nodes):
        for cell in _cells(nodes, nodes[rule].get(SWRL + "head", ())):
            for first in nodes[cell].get(_FIRST, ()):
                found.add(by_atom.get(id(nodes.get(first)), ""))
    return found - {""}


def _rules(nodes: Mapping[str, Node]) -> list[str]:
    """Return the rules that aren't disabled."""
    return [
        iri
        for iri, node in nodes.items()
        if SWRL + "Imp" in node.get(TYPE, ()) and node.get(ENABLED, ["true"])[0] != "false"
    ]


def _cells(nodes: Mapping[str, Node], start: Sequence[str]) -> Iterator[str]:
    waiting, seen = list(start), set[str]()
    while waiting:
        if (cell := waiting.pop()) in nodes and cell not in seen:
            seen.add(cell)
            yield cell
            waiting += nodes[cell].get(_REST, ())


def compiled(definitions: Definitions, arguments: Mapping[str, Sequence[str]]) -> dict[str, list[Rule]]:
    """Return the rules that are equivalent to SWRL rules, by the IRI of their situation type.

    Parameters
    ----------
    definitions : Definitions
        The definitions of the ontology, including the nodes of the SWRL rules.
    arguments : mapping of IRI of a situation type to the classes of its arguments

    Raises
    ------
    KnowledgeError
        A rule contains an atom that planning doesn't support; the message names the rule and an alternative.
    """
    found: dict[str, list[Rule]] = {}
    for iri in _rules(definitions.nodes):
        for situation, rule in _Imp(definitions, arguments, iri).rules():
            found.setdefault(situation, []).append(rule)
    return found


@dataclass
class _Imp:
    """The compilation of one SWRL rule: the classes and numbers of its variables, and the conditions of its body."""

    definitions: Definitions
    arguments: Mapping[str, Sequence[str]]
    iri: str
    kinds: dict[str, str] = field(default_factory=dict)
    amounts: dict[str, Expression] = field(default_factory=dict)
    asked: list[Condition] = field(default_factory=list)

    def rules(self) -> Iterator[tuple[str, Rule]]:
        body = self._atoms("body")
        self._check_arguments([*body, *self._atoms("head")])
        self._numbers(body)
        for atom in sorted(body, key=lambda atom: (len(atom[1]) != 1, self.definitions.changes(atom[0]))):
            self._said(*atom)  # class atoms come first and determine the classes of variables
        if not (head := self._atoms("head")):
            raise self.error(
                "it has no head, so it forbids its body; let a rule conclude a situation type, and state c:never true of that type"
            )
        for predicate, said in head:
            yield self._concluded(predicate, said)

    def error(self, what: str) -> KnowledgeError:
        labels = self.definitions.nodes[self.iri].get(LABEL, ())
        body = " ^ ".join(f"{local_name(p)}({', '.join(map(self.word, of))})" for p, of in self._atoms("body"))
        head = " ^ ".join(f"{local_name(p)}({', '.join(map(self.word, of))})" for p, of in self._atoms("head"))
        name = f"<{self.iri}>" if ":" in self.iri else f"'{labels[0]}'" if labels else f"{body} -> {head}"
        concluded = (predicate for predicate, _ in self._atoms("head"))
        return KnowledgeError(f"the SWRL rule {name}: {what}", self.iri if ":" in self.iri else next(concluded, ""))

    def word(self, argument: str) -> str:
        return "?" + local_name(argument) if self.variable(argument) else local_name(argument)

    def variable(self, argument: str) -> bool:
        return SWRL + "Variable" in self.definitions.nodes.get(argument, {}).get(TYPE, ())

    def term(self, argument: str) -> str:
        return self.word(argument) if self.variable(argument) else self.definitions.names.short(argument)

    # ---------------------------------------------------------------------------------------------------------- reading

    def _atoms(self, part: str) -> list[Atom]:
        """Return the atoms of the body or the head, sorted."""
        nodes = self.definitions.nodes
        found: list[Atom] = []
        for cell in _cells(nodes, nodes[self.iri].get(SWRL + part, ())):
            for iri in nodes[cell].get(_FIRST, ()):
                atom = nodes.get(iri, {})
                if builtin := atom.get(SWRL + "builtin", ()):
                    given = [
                        a for c in _cells(nodes, atom.get(SWRL + "arguments", ())) for a in nodes[c].get(_FIRST, ())
                    ]
                    found.append((builtin[0], tuple(given)))
                    continue
                both = (atom.get(SWRL + f"argument{place}", ()) for place in (1, 2))
                said = tuple(argument for arguments in both for argument in arguments[:1])
                kind = local_name(atom.get(TYPE, [""])[0])
                other = {"SameIndividualAtom": "sameAs", "DifferentIndividualsAtom": "differentFrom"}.get(kind, "")
                named = (*atom.get(SWRL + "classPredicate", ()), *atom.get(SWRL + "propertyPredicate", ()), other)
                found.append((named[0], said))
        return sorted(found)

    def _check_arguments(self, atoms: Sequence[Atom]) -> None:
        """Raise `KnowledgeError` if an atom has the wrong number of arguments."""
        definitions = self.definitions
        for predicate, said in atoms:
            known, many = predicate in definitions.situations or predicate in definitions.kinds, len(said)
            if self._built_in(predicate, COMPUTES):
                fits, wanted = (
                    many == 3 or (many > 3 and local_name(predicate) in ("add", "multiply")),
                    "a result and two numbers",
                )
            elif known or self._built_in(predicate, COMPARES) or predicate == BUILT_IN + "notEqual":
                fits, wanted = many == 2, "two"
            else:
                fits, wanted = many > 0, "one or two"
            if not fits:
                raise self.error(
                    f"{local_name(predicate)} has {many} argument{'s' * (many != 1)} there; wanted {wanted}"
                )

    def _numbers(self, body: Sequence[Atom]) -> None:
        """Find the numeric expressions that the variables of the body denote."""
        numbers = self.definitions.numbers
        for predicate, said in body:
            if predicate in numbers and len(said) == 2 and self.variable(said[1]):
                self.amounts.setdefault(said[1], self.definitions.number(predicate, self.term(said[0])))
        waiting = [(COMPUTES[local_name(p)], said) for p, said in body if self._built_in(p, COMPUTES)]
        while ready := [one for one in waiting if all(self._known(argument) for argument in one[1][1:])]:
            for sign, (result, *given) in ready:
                worth = self.worth(given[0])
                for other in given[1:]:
                    worth = Calculation(sign, worth, self.worth(other))
                if self._known(result):
                    self.asked.append(Comparison(self.worth(result), "=", worth))
                else:
                    self.amounts[result] = worth
            waiting = [one for one in waiting if one not in ready]
        for _, (_, *given) in waiting:
            lost = next(self.word(argument) for argument in given if not self._known(argument))
            raise self.error(f"no atom determines the number {lost}; add an atom of an amount with it")

    @staticmethod
    def _built_in(predicate: str, known: Mapping[str, str]) -> bool:
        return predicate.startswith(BUILT_IN) and local_name(predicate) in known

    def _known(self, argument: str) -> bool:
        return argument in self.amounts or exact(argument) is not None

    def worth(self, argument: str) -> Expression:
        if argument in self.amounts:
            return self.amounts[argument]
        found = exact(argument)
        if found is None:
            raise self.error(f"no atom determines the number {self.word(argument)}; add an atom of an amount with it")
        return found

    def _said(self, predicate: str, said: tuple[str, ...]) -> None:
        """Record the condition of an atom in the rule's body."""
        definitions = self.definitions
        terms = tuple(map(self.term, said)) if not predicate.startswith(BUILT_IN) else ()
        if predicate in ("sameAs", "differentFrom"):
            self.asked.append(EqualityCondition(terms[0], terms[1], negated=predicate == "differentFrom"))
        elif predicate in definitions.numbers:
            worth, amount = self.worth(said[1]), definitions.number(predicate, terms[0])
            self.asked.append(Comparison(amount, "=", worth))
        elif self._built_in(predicate, COMPARES) or predicate == BUILT_IN + "notEqual":
            one, other = map(self.worth, said)
            sign = COMPARES.get(local_name(predicate), "=")
            self.asked.append(Comparison(one, sign, other, negated=local_name(predicate) == "notEqual"))
        elif predicate.startswith(BUILT_IN):
            if not self._built_in(predicate, COMPUTES):
                known = ", ".join([*COMPARES, "notEqual", *COMPUTES])
                raise self.error(f"planning doesn't evaluate swrlb:{local_name(predicate)}; it knows {known}")
        elif len(terms) == 1:
            self._of_class(predicate, terms[0])
        elif predicate in definitions.situations or predicate in definitions.kinds:
            self.asked.append(definitions.related(predicate, terms[0], terms[1]))
            for term, kind in zip(terms, definitions.kinds.get(predicate, ("", "")), strict=True):
                if kind and term.startswith("?"):
                    self.kinds.setdefault(term, kind)
        else:
            raise self.error(
                f"{local_name(predicate)} is neither the value property of a situation type nor a relation; declare it as one"
            )

    def _of_class(self, iri: str, term: str) -> None:
        definitions = self.definitions
        if ":" not in iri:
            self.asked += definitions.expression(term, iri)
            return
        if term.startswith("?") and term not in self.kinds:
            self.kinds[term] = definitions.names.short(definitions.base(iri))
            if not definitions.changes(iri):
                return
        self.asked += definitions.conditions(term, iri)

    # -------------------------------------------------------------------------------------------------------- concluding

    def _concluded(self, predicate: str, said: tuple[str, ...]) -> tuple[str, Rule]:
        """Return the situation type about which an atom of the head states a conclusion, and the rule for this type."""
        definitions = self.definitions
        if len(said) == 1 and predicate in definitions.concluded:
            situation = definitions.concluded[predicate][0]
        elif len(said) == 2 and predicate in definitions.situations and predicate not in definitions.numbers:
            situation, functional = definitions.situations[predicate]
            if functional:
                raise self.error(
                    f"it concludes {local_name(predicate)}, which is functional; a rule can derive only the value property of a "
                    "situation type of its own, which isn't functional"
                )
        elif len(said) == 1 and predicate:
            raise self.error(
                f"it concludes {local_name(predicate)}, and no situation type holds of that class; declare one with "
                f":holdsOf {local_name(predicate)}"
            )
        else:
            raise self.error(
                f"it concludes {local_name(predicate)}; planning concludes classes that a situation type holds of, and value "
                "properties of situation types"
            )
        classes = self.arguments[situation]
        if len(classes) != len(said):
            raise self.error(
                f"it concludes {definitions.names.short(situation)} of {len(said)}; that is about {len(classes)}"
            )
        parameters: list[Parameter] = []
        compared: list[Condition] = []
        for place, (argument, kind) in enumerate(zip(said, classes, strict=True)):
            term = self.term(argument)
            if self.variable(argument) and term not in [p.name for p in parameters]:
                if not any(term in mentions(condition) for condition in self.asked) and term not in self.kinds:
                    raise self.error(
                        f"the variable {term} of its head is in no atom of its body; add an atom with it there"
                    )
                parameters.append(Parameter(term, self.kinds.get(term, kind)))
            else:
                parameters.append(Parameter(f"?argument{place}", kind))
                compared.append(EqualityCondition(f"?argument{place}", term))
        variables: list[Parameter] = []
        sought = {*self.kinds, *(t for c in self.asked for t in mentions(c))} - {p.name for p in parameters}
        conditions = self._nested([*compared, *self.asked], {p.name for p in parameters}, sorted(sought), variables)
        return situation, Rule(definitions.names.short(situation), tuple(parameters), tuple(variables), conditions)

    def _nested(
        self, asked: Sequence[Condition], bound: set[str], sought: Sequence[str], variables: list[Parameter]
    ) -> tuple[Condition, ...]:
        """Return conditions in which each further variable is determined by a value or bound by a nested witness."""
        here = tuple(condition for condition in asked if mentions(condition) <= bound)
        rest = [condition for condition in asked if condition not in here]
        if not sought:
            return here
        for condition in rest:
            match condition:
                case ValueCondition(_, arguments, value, False) if value in sought and value != TRUE:
                    if {a for a in arguments if a.startswith("?")} <= bound:
                        variables.append(Parameter(value, self._kind(value)))
                        others = [one for one in rest if one is not condition]
                        deeper = self._nested(others, bound | {value}, [v for v in sought if v != value], variables)
                        return (*here, condition, *deeper)
        nearest = {v: sum(v in mentions(c) and bool(mentions(c) & bound) for c in rest) for v in sought}
        chosen = max(sought, key=lambda variable: nearest[variable])
        deeper = self._nested(rest, bound | {chosen}, [v for v in sought if v != chosen], variables)
        return (*here, Witness(chosen, self._kind(chosen), deeper))

    def _kind(self, variable: str) -> str:
        if variable not in self.kinds:
            raise self.error(f"no atom states the class of {variable}; add an atom of a class with it")
        return self.kinds[variable]

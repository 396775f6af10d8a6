"""Reading of remembered situation types, and of constraints that concern several states of a plan.

============================  ==========================================================================
in the ontology               in `confab.reasoner.symbols`
============================  ==========================================================================
``M :remembers S``            ``Domain.remembers``: M is true in the first state in which S is true, and
                              in all later states
``S :atMostOnce true``        ``S.again`` is never true: S is true, and ``S.ended`` remembers that S,
                              which ``S.begun`` remembers, was false later
``S :onlyAfter E``            ``S.before.E`` is never true: S is true, and ``S.after.E`` doesn't remember
                              that E was true while S was false
============================  ==========================================================================
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from confab.reasoner.aggregates.dependencies import read_by
from confab.reasoner.aggregates.remembering import in_order_of_update
from confab.reasoner.closure import closure
from confab.reasoner.derivation import circular, needed
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.names import Names, local_name
from confab.reasoner.problem import Domain
from confab.reasoner.reading.parts import Parts
from confab.reasoner.reading.rows import OntologySchema
from confab.reasoner.symbols import FALSE, TRUE, Constraint, Parameter, Rule, SituationType, ValueCondition
from confab.reasoner.vocabulary import CORE


@dataclass
class Past:
    """The situation types of an ontology, together with all parts of its domain that concern earlier states.

    `situations` contains all situation types of the ontology. Situation types, rules and constraints are added to express
    ``:atMostOnce`` and ``:onlyAfter``.
    """

    situations: dict[str, SituationType]
    remembers: dict[str, str] = field(default_factory=dict)
    rules: dict[str, tuple[Rule, ...]] = field(default_factory=dict)
    constraints: dict[str, Constraint] = field(default_factory=dict)

    def remember(self, name: str, source: str) -> str:
        """Add a situation type that remembers a given situation type, and return the new type's name."""
        self.remembers[name] = source
        self._add(name, source)
        return name

    def both(self, name: str, true: str, other: str, value: str) -> str:
        """Add a situation type that is true if the type `true` is true and the type `other` has a value; return its name."""
        self._add(name, true)
        parameters = tuple(Parameter(f"?argument{i}", kind) for i, kind in enumerate(self.situations[true].arguments))
        terms = tuple(one.name for one in parameters)
        conditions = ValueCondition(true, terms, TRUE), ValueCondition(other, terms, TRUE, value == FALSE)
        self.rules[name] = (Rule(name, parameters, (), conditions),)
        return name

    def never(self, name: str, about: tuple[str, ...]) -> None:
        """Add the constraint that a situation type is never true.

        `about` contains the situation types on which the ontology's author stated the constraint.
        """
        self.constraints[f"{name}.exceptions"] = Constraint(name, about=about)

    def _add(self, name: str, like: str) -> None:
        arguments = self.situations[like].arguments
        self.situations[name] = SituationType(name, arguments, "Truth", default=FALSE, boolean=True, added=True)


def iris_of_the_past(schema: OntologySchema) -> Iterator[str]:
    """Yield the IRIs of the situation types that express ``:atMostOnce`` and ``:onlyAfter``."""
    for iri in schema.of_kind("SituationType"):
        if CORE + "atMostOnce" in schema.nodes[iri]:
            yield from (f"{iri}.{word}" for word in ("begun", "over", "ended", "again"))
        for other in schema.nodes[iri].get(CORE + "onlyAfter", ()):
            yield from (f"{iri}.{word}.{local_name(other)}" for word in ("without", "after", "before"))


def concerns_the_past(schema: OntologySchema) -> bool:
    """Return whether a situation type is remembered, or has a constraint that concerns several states."""
    words = {CORE + word for word in ("remembers", "atMostOnce", "onlyAfter")}
    return any(words & schema.nodes[iri].keys() for iri in schema.of_kind("SituationType"))


def past(parts: Parts, schema: OntologySchema, situations: Sequence[SituationType]) -> Past:
    """Return all situation types, together with the remembered situation types and the constraints that concern several states.

    Raises
    ------
    KnowledgeError
        A situation type has values other than true and false, or two related situation types have different numbers of arguments.
        A remembered situation type has a level, a rest value or a default value, or is changed by a behaviour.
    """
    found = Past({situation.name: situation for situation in situations})
    short = parts.names.short
    for iri in sorted(schema.of_kind("SituationType"), key=short):
        if parts.values(iri, "remembers"):
            found.remembers[short(iri)] = short(_checked(parts, schema, found, iri))
    for name, source in found.remembers.items():
        _check_arguments(found, parts.names, name, source, "remembers")
    for iri in sorted(schema.of_kind("SituationType"), key=short):
        name = short(iri)
        if parts.flag(iri, "atMostOnce"):
            _check_boolean(parts, found, iri, "atMostOnce", iri)
            held = found.remember(short(f"{iri}.begun"), name)
            ended = found.remember(short(f"{iri}.ended"), found.both(short(f"{iri}.over"), held, name, FALSE))
            found.never(found.both(short(f"{iri}.again"), name, ended, TRUE), (name,))
        for other in parts.values(iri, "onlyAfter"):
            earlier, end = short(other), local_name(other)
            _check_boolean(parts, found, iri, "onlyAfter", iri, other)
            _check_arguments(found, parts.names, name, earlier, "is true only after")
            without = found.both(short(f"{iri}.without.{end}"), earlier, name, FALSE)
            allowed = found.remember(short(f"{iri}.after.{end}"), without)
            found.never(found.both(short(f"{iri}.before.{end}"), name, allowed, FALSE), (name, earlier))
    return found


def _checked(parts: Parts, schema: OntologySchema, found: Past, iri: str) -> str:
    """Return the IRI of the original of a remembered situation type; raise `KnowledgeError` if the original can't be remembered."""
    source, name = parts.one(iri, "remembers"), parts.names.short(iri)
    _check_boolean(parts, found, iri, "remembers", iri, source)
    for said in ("fromLevel", "restValue", "defaultValue"):
        if parts.values(iri, said):
            raise KnowledgeError(
                f"<{iri}> has a c:{said}; a situation type with c:remembers exists on the levels of the remembered situation "
                f"type, is false at first, and never becomes false again; drop c:{said}",
                iri,
            )
    for effect in schema.of_kind("ValueEffect"):
        if list(parts.values(effect, "situationType")) == [iri]:
            raise KnowledgeError(
                f"<{effect}> changes {name}, which remembers {parts.names.short(source)}; remove the effect, or drop c:remembers",
                effect,
            )
    return source


def _check_boolean(parts: Parts, found: Past, iri: str, word: str, *both: str) -> None:
    """Raise `KnowledgeError` unless a node is a situation type whose values are true and false."""
    for one in both:
        name = parts.names.short(one)
        if not parts.is_a(one, "SituationType"):
            raise KnowledgeError(
                f"<{iri}>: c:{word} names <{one}>, which isn't a situation type; name a situation type", iri
            )
        if not found.situations[name].boolean:
            raise KnowledgeError(
                f"<{iri}>: c:{word} needs situation types that are true or false, but {name} has other values; define a "
                "situation type by a rule about these values, and use it instead",
                iri,
            )


def _check_arguments(found: Past, names: Names, name: str, other: str, verb: str) -> None:
    """Raise `KnowledgeError` if two situation types have different numbers of arguments."""
    one, two = (len(found.situations[each].arguments) for each in (name, other))
    if one != two:
        raise KnowledgeError(
            f"{name} has {one} arguments and {verb} {other}, which has {two}; state the same number, or define a situation type "
            "with these arguments by a rule",
            names.iri(name),
        )


def remembers_in_order(domain: Domain, names: Names) -> dict[str, str]:
    """Return the remembered situation types of a domain in order of dependency.

    Raises
    ------
    KnowledgeError
        A remembered situation type depends on itself or on a recursive definition.
    """
    for name, source in domain.remembers.items():
        read = closure([source], lambda situation: _needed(domain, situation))
        if name in read:
            raise KnowledgeError(
                f"{name} remembers {source}, which depends on {name}; take {name} out of the definition of {source}",
                names.iri(name),
            )
        if read & circular(domain.rules):
            raise KnowledgeError(
                f"{name} remembers {source}, which depends on a recursive definition; remember a situation type without a "
                "recursive definition",
                names.iri(name),
            )
    order = [one.situation for one in in_order_of_update(domain)]
    return {name: domain.remembers[name] for name in order if name in domain.remembers}


def _needed(domain: Domain, situation: str) -> set[str]:
    """Return the situation types on which a situation type depends directly."""
    read = {s for rule in domain.rules.get(situation, ()) for s, _ in needed(rule.conditions)}
    read |= read_by(domain.aggregates[situation]) if situation in domain.aggregates else set()
    return read | ({domain.remembers[situation]} if situation in domain.remembers else set())

"""Translation of nodes to the parts of behaviours and goals: terms, conditions, calculations and effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import ClassVar

from confab.reasoner.afterwards import closed
from confab.reasoner.amounts import OPERATIONS, Amount, Expression, Measure, terms_of
from confab.reasoner.closure import closure
from confab.reasoner.condition_nodes import NodeReader, NodeValues
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.language import groups, mentions, plain_variables
from confab.reasoner.names import Names, local_name
from confab.reasoner.reading.definitions import Definitions
from confab.reasoner.reading.rows import HIGHEST_COST, HIGHEST_LEVEL, is_a, ordered, whole_number
from confab.reasoner.symbols import (
    AGGREGATES,
    FALSE,
    TRUE,
    Aggregate,
    AmountEffect,
    AnyOf,
    Behavior,
    ClassCondition,
    Comparison,
    Condition,
    Effect,
    EqualityCondition,
    Parameter,
    Rule,
    Span,
    Timing,
    ValueCondition,
    ValueEffect,
    Witness,
)
from confab.reasoner.timing import projected, seconds_of
from confab.reasoner.vocabulary import ARGUMENTS, CORE


@dataclass(frozen=True)
class Parts(NodeReader):
    """Reader of the nodes of behaviours, conditions and situation types."""

    error: ClassVar[type[ValueError]] = KnowledgeError
    nodes: Mapping[str, NodeValues]
    names: Names
    terms: set[str]
    pairs: set[str]  # situation types with a many-valued value property
    definitions: Definitions
    individuals_of: frozenset[str] = frozenset()  # classes that can stand for all of their members
    standing: dict[str, str] = field(default_factory=dict)  # variable of each class that stands for its members
    inside: list[str] = field(default_factory=list)  # the nested conditions that are being read
    count: list[int] = field(default_factory=lambda: [0])

    def short(self, iri: str) -> str:
        """Return the short name of an IRI."""
        return self.names.short(iri)

    def number(self, iri: str, name: str, least: int, most: int, default: int | None = None) -> int:
        """Return the value of a property as a whole number between `least` and `most`; without a value, return the default."""
        found = self.values(iri, name)
        if not found and default is not None:
            return default
        return whole_number(self.one(iri, name), f"<{iri}>: c:{name}", least, most)

    def level(self, iri: str) -> int:
        """Return the level of a behaviour."""
        return self.number(iri, "level", 1, HIGHEST_LEVEL)

    def price(self, iri: str) -> Expression | None:
        """Return the expression for the price of a behaviour; return None if the behaviour has no price."""
        if not self.values(iri, "price"):
            return None
        if self.values(iri, "cost"):
            raise KnowledgeError(f"<{iri}> has a c:cost and a c:price; keep one of them")
        return self.expression(self.one(iri, "price"))

    def cost(self, iri: str) -> float:
        """Return the fixed cost of a behaviour, which is 1 by default."""
        if not self.values(iri, "cost"):
            return 1.0
        said = self.one(iri, "cost")
        try:
            cost = float(said)
        except ValueError:
            cost = -1.0
        if not 0 <= cost <= HIGHEST_COST:  # NaN fails both comparisons
            raise KnowledgeError(f"<{iri}>: c:cost is '{said[:40]}'; wanted a number from 0 to {HIGHEST_COST}")
        return cost

    def term(self, iri: str) -> str:
        """Return the name of a term (``?hand`` for the parameter ``B2_PICK.hand``) or of an individual."""
        if iri in self.terms:
            return "?" + local_name(iri).rsplit(".", 1)[-1]
        if iri in self.standing:
            return self.standing[iri]
        name = self.names.short(iri)
        if self.terms and name not in self.names and name not in (TRUE, FALSE):  # a scene's facts have no terms
            raise KnowledgeError(
                f"<{iri}> is named in a behaviour, but isn't declared as a parameter, a variable or an individual; declare it, "
                "or correct the name"
            )
        return name

    def parameter(self, iri: str) -> Parameter:
        """Return a parameter or variable with its name and class."""
        if iri not in self.terms:
            raise KnowledgeError(
                f"<{iri}> is used as a parameter but isn't declared as one; declare it, or correct the name"
            )
        return Parameter(self.term(iri), self.names.short(self.definitions.base(self.one(iri, "termType"))))

    def sought(self, iri: str) -> tuple[Parameter, tuple[Condition, ...]]:
        """Return the variable of a witness.

        If the class of the variable is defined by situations, also return the conditions of the definition.
        """
        return self.parameter(iri), self.membership(iri)

    def membership(self, iri: str) -> tuple[Condition, ...]:
        """Return the conditions that define a term's class; return no conditions for a static class."""
        return self.definitions.beyond_base(self.term(iri), self.one(iri, "termType"))

    def situation(self, iri: str) -> str:
        """Return the situation type of a condition, an effect or a calculation."""
        situation = self.one(iri, "situationType")
        if not self.is_a(situation, "SituationType"):
            raise KnowledgeError(
                f"<{iri}>: <{situation}> isn't a situation type; declare it as one, or correct the name"
            )
        return situation

    def symbol(self, iri: str) -> tuple[str, tuple[str, ...], str]:
        """Return situation type, arguments and value of a node; the value of a many-valued property becomes the last argument."""
        situation = self.situation(iri)
        if self.is_a(situation, "Amount"):
            raise KnowledgeError(
                f"<{iri}>: {local_name(situation)} is an amount, but a value condition or value effect can't be about an amount; "
                "use a c:Comparison or a c:AmountEffect"
            )
        arguments = self.arguments(iri)
        value = [self.term(self.one(iri, "value"))] if self.values(iri, "value") else []
        if situation in self.pairs:
            arguments, value = (*arguments, *value), []
        return self.names.short(situation), arguments, value[0] if value else TRUE

    def relation(self, iri: str) -> str:
        """Return the relation of a condition or a calculation."""
        relation = self.one(iri, "relation")
        if not self.is_a(relation, "Relation", "ReachRelation"):
            raise KnowledgeError(f"<{iri}>: <{relation}> isn't a relation; declare it as one, or correct the name")
        return self.names.short(relation)

    def of_class(self, term: str, kind: str, negated: bool) -> Condition:
        """Return the condition that a term is a member of a class; a class defined by situations is replaced by its definition."""
        return self.definitions.condition(term, kind, negated)

    def measured(self, iri: str) -> Amount | Measure:
        """Return the amount or the relation whose number a node refers to."""
        found = super().measured(iri)
        if isinstance(found, Amount) and not self.is_a(situation := self.situation(iri), "Amount"):
            raise KnowledgeError(
                f"<{iri}>: {local_name(situation)} isn't an amount, so it can't be compared with a number or changed by a number; "
                "declare it as c:Amount, or use a value condition or effect"
            )
        return found

    def classes_in(self, iri: str) -> list[str]:
        """Return the classes that are arguments or the value of a node and stand for all of their members."""
        said = [value for name in (*ARGUMENTS, "value") for value in self.values(iri, name)[:1]]
        found = [value for value in said if value in self.individuals_of and value not in self.standing]
        if twice := [kind for kind in found if found.count(kind) > 1]:
            raise KnowledgeError(
                f"<{iri}> names the class {local_name(twice[0])} twice, so it is unclear whether both mean the same individual; "
                "use a c:Witness with a variable for one of them"
            )
        situation = self.values(iri, "situationType")[:1]
        if found and found[-1:] == [*self.values(iri, "value")] and situation and situation[0] not in self.pairs:
            raise KnowledgeError(
                f"<{iri}> has the class {local_name(found[-1])} as the value of {local_name(situation[0])}; name an individual, "
                "or use a c:Witness for some individual of the class"
            )
        return found

    def read(self, iri: str) -> Condition:
        """Return the condition of a node.

        If the node names a class in place of its members, the condition must hold for every member.
        """
        kinds = self.classes_in(iri)
        for kind in kinds:
            self.standing[kind] = f"?each{len(self.standing) or ''}"
        found = self.absence(iri) if self.is_a(iri, "AbsenceCondition") else super().read(iri)
        for kind in reversed(kinds):
            term = self.standing.pop(kind)
            contrary = replace(found, negated=not found.negated)
            inner = (*self.definitions.beyond_base(term, kind), contrary)
            found = Witness(term, self.names.short(self.definitions.base(kind)), inner, negated=True)
        return found

    def absence(self, iri: str) -> Condition:
        """Return the condition that no individual of a class has a value."""
        name, _, value = self.symbol(iri)
        anyone, kind = "?anyone", self.one(iri, "ofClass")
        inner = (ValueCondition(name, (anyone,), value), *self.definitions.beyond_base(anyone, kind))
        return Witness(anyone, self.names.short(self.definitions.base(kind)), inner, not self.flag(iri, "negated"))

    def effect(self, iri: str) -> Effect:
        """Return the effect of a node. If a class stands for its members, every member that satisfies `when` has the effect."""
        if iri not in self.nodes:
            raise KnowledgeError(f"<{iri}> is used as an effect but isn't declared as one")
        kinds = self.classes_in(iri)
        if len(kinds) > 1:
            raise KnowledgeError(
                f"<{iri}> is about all individuals of two classes, {' and '.join(map(local_name, kinds))}; make one of them "
                "a parameter"
            )
        for kind in kinds:
            self.standing[kind] = "?each"
        of_amount = self.is_a(iri, "AmountEffect")
        found = self.amount_effect(iri) if of_amount else self.value_effect(iri)
        for kind in kinds:
            term = self.standing.pop(kind)
            each = Parameter(term, self.names.short(self.definitions.base(kind)))
            found = replace(found, when=(*self.definitions.beyond_base(term, kind), *found.when), each=each)
        return found

    def value_effect(self, iri: str) -> ValueEffect:
        """Return the effect of a node that gives a symbol a value."""
        situation, arguments, value = self.symbol(iri)
        if self.flag(iri, "negated"):
            value = FALSE
        return ValueEffect(situation, arguments, value, self.conditions(iri, "when"))

    def amount_effect(self, iri: str) -> AmountEffect:
        """Return the effect of a node that changes an amount."""
        changed = self.measured(iri)
        if not isinstance(changed, Amount):
            raise KnowledgeError(f"<{iri}>: a static relation can't be changed; make it a c:Amount")
        operation = self.word(iri, "change", OPERATIONS)
        when = self.conditions(iri, "when")
        return AmountEffect(changed.situation, changed.arguments, operation, self.right(iri), when)

    def behavior(self, iri: str) -> Behavior:
        """Return a behaviour with its terms, conditions, effects, cost and timing."""
        parameters = tuple(map(self.parameter, ordered(self.values(iri, "parameter"), self.nodes, self.names)))
        used = sorted(self.terms_below(iri) - set(self.values(iri, "parameter")))
        self.check_names(iri, (*self.values(iri, "parameter"), *used))
        asked = [(self.span(one), c) for one in self.values(iri, "precondition") for c in self.group(one)]
        made = [(self.span(one), self.effect(one)) for one in self.values(iri, "postcondition")]
        price, duration = self.price(iri), self.duration(iri)
        told = plain_variables(c for _, c in asked)
        told |= {t for n in (price, duration) if n is not None for t in terms_of(n)}
        told |= {self.term(actor) for actor in self.values(iri, "actor")}
        more = [c for term in self.values(iri, "parameter") for c in self.membership(term)]
        more += [c for term in used if self.term(term) in told for c in self.membership(term)]
        local = {
            name: found for term in used if (name := self.term(term)) not in told and (found := self.membership(term))
        }
        if local:  # the classes of variables that only a group of conditions or an effect determines
            asked = [(span, in_groups(condition, local)) for span, condition in asked]
            made = [(span, _of_classes(effect, local)) for span, effect in made]
        more += [Comparison(n, ">=", Fraction(0)) for n in (price, duration) if not isinstance(n, Fraction | None)]
        preconditions, effects = projected(asked, made)
        timing = Timing(
            duration,
            tuple(map(self.term, self.values(iri, "actor"))),
            (*asked, *((Span.THROUGHOUT, condition) for condition in more)),
            tuple(made),
        )
        plain = not timing.actors and duration is None and all(s is Span.THROUGHOUT for s, _ in (*asked, *made))
        return Behavior(
            name=self.names.short(iri),
            level=self.level(iri),
            parameters=parameters,
            variables=tuple(map(self.parameter, used)),
            preconditions=(*preconditions, *more),
            effects=tuple(effect for effect in effects if isinstance(effect, ValueEffect)),
            cost=self.cost(iri),
            amounts=tuple(effect for effect in effects if isinstance(effect, AmountEffect)),
            price=price,
            timing=None if plain else timing,
        )

    def check_names(self, iri: str, terms: Sequence[str]) -> None:
        """Raise `KnowledgeError` if two terms of a behaviour have the same name."""
        called = [self.term(term) for term in terms]
        for name in sorted({name for name in called if called.count(name) > 1}):
            same = " and ".join(sorted(local_name(t) for t, other in zip(terms, called, strict=True) if other == name))
            raise KnowledgeError(
                f"{local_name(iri)} has several terms called {name[1:]}: {same}; give each a name of its own, or let the price, "
                f"the duration, the actors and the conditions of {local_name(iri)} refer to its own term",
                iri,
            )

    def span(self, iri: str) -> Span:
        """Return the time span of a behaviour's condition or effect."""
        if not self.values(iri, "during"):
            return Span.THROUGHOUT
        said = self.one(iri, "during")
        found = next((span for span in Span if CORE + span.value == said), None)
        if found is None:
            raise KnowledgeError(f"<{iri}>: c:during is <{said}>; wanted c:atStart, c:throughout or c:atEnd")
        return found

    def duration(self, iri: str) -> Expression | None:
        """Return the duration of a behaviour in seconds; return None if no duration is stated."""
        if self.values(iri, "calculatedDuration"):
            if self.values(iri, "duration"):
                raise KnowledgeError(f"<{iri}> has a c:duration and a c:calculatedDuration; keep one of them")
            return self.expression(self.one(iri, "calculatedDuration"))
        return self.seconds(iri, "duration")

    def seconds(self, iri: str, name: str) -> Fraction | None:
        """Return the duration in seconds that a property states; return None if the property has no value."""
        if not self.values(iri, name):
            return None
        found = seconds_of(self.one(iri, name))
        if found is None:
            said = self.one(iri, name)[:40]
            raise KnowledgeError(
                f"<{iri}>: c:{name} is '{said}'; state a non-negative xsd:dayTimeDuration such as PT2.5S"
            )
        return found

    def rule(self, iri: str, kinds: Sequence[str]) -> Rule:
        """Return a rule.

        If an individual is among the rule's arguments, a new parameter with an equality condition replaces the individual.
        """
        situation, arguments, value = self.symbol(iri)
        if value != TRUE:
            raise KnowledgeError(
                f"<{iri}>: a rule can only conclude that a situation is true; leave out the value, or "
                "negate its conditions"
            )
        parameters, variables, conditions = self.head_and_body(iri, situation, arguments, kinds)
        return Rule(situation, parameters, variables, conditions)

    def aggregate(self, iri: str, kinds: Sequence[str]) -> Aggregate:
        """Return the rule of a derived amount whose arguments have the given classes; a sum or count exists for all members."""
        function, derived = self.word(iri, "aggregate", AGGREGATES), self.measured(iri)
        if not isinstance(derived, Amount):
            raise KnowledgeError(f"<{iri}>: a static relation isn't derived; make it a c:Amount")
        if function == "count" and (self.values(iri, "right") or self.values(iri, "amount")):
            raise KnowledgeError(
                f"<{iri}> counts individuals, but also names a number; drop the number, or use the aggregate sum, max or min"
            )
        number = Fraction(1) if function == "count" else self.right(iri)
        parameters, variables, conditions = self.head_and_body(iri, derived.situation, derived.arguments, kinds)
        over = {self.term(term) for term in self.values(iri, "over")}.union(*map(mentions, filter(_plain, conditions)))
        over |= {*terms_of(number)}
        counted = tuple(one for one in variables if one.name in over)
        if not counted:
            raise KnowledgeError(
                f"<{iri}> has an aggregate without a variable; let c:over name the variable that it counts or adds up"
            )
        bound = frozenset(one.name for one in (*parameters, *counted))
        asked = closed(conditions, bound, {one.name: one.kind for one in (*parameters, *variables)})
        found = Aggregate(derived.situation, function, number, parameters, counted, asked)
        if not found.kept:
            return found
        narrower = (ClassCondition(p.name, p.kind) for p, kind in zip(parameters, kinds, strict=True) if p.kind != kind)
        every = tuple(replace(p, kind=kind) for p, kind in zip(parameters, kinds, strict=True))
        return replace(found, parameters=every, conditions=(*narrower, *asked))

    def head_and_body(
        self, iri: str, situation: str, arguments: Sequence[str], kinds: Sequence[str]
    ) -> tuple[tuple[Parameter, ...], tuple[Parameter, ...], tuple[Condition, ...]]:
        """Return the parameters, the other variables and the conditions of a rule."""
        if len(arguments) != len(kinds):
            raise KnowledgeError(f"<{iri}> uses {situation} with {len(arguments)} arguments, but it has {len(kinds)}")
        parameters: list[Parameter] = []
        compared: list[Condition] = []
        own = {self.term(t): t for t in self.terms_below(iri)}
        for i, (term, kind) in enumerate(zip(arguments, kinds, strict=True)):
            if term in own and term not in [p.name for p in parameters]:
                parameters.append(self.parameter(own[term]))
            else:
                parameters.append(Parameter(f"?argument{i}", kind))
                compared.append(EqualityCondition(f"?argument{i}", term))
        names = {p.name for p in parameters}
        variables = tuple(self.parameter(t) for name, t in sorted(own.items()) if name not in names)
        told = names | {self.term(term) for term in self.values(iri, "over")}
        if self.values(iri, "right"):
            told |= {*terms_of(self.right(iri))}
        members = {name: found for name, t in sorted(own.items()) if (found := self.membership(t))}
        conditions = with_classes((*compared, *self.conditions(iri, "condition")), members, told)
        return tuple(parameters), variables, conditions

    def terms_below(self, iri: str) -> set[str]:
        """Return all terms in the parts of a behaviour or rule, except the terms that a witness binds."""

        def mentioned(node: str) -> list[str]:
            return [value for values in self.nodes.get(node, {}).values() for value in values]

        def parts(node: str) -> list[str]:
            inner = (value for value in mentioned(node) if value not in self.terms)
            return [value for value in inner if value in self.nodes and _is_part(self.nodes[value])]

        nodes = closure([iri], parts)
        binding = [(term, node) for node in nodes for term in self.values(node, "witness")]
        bound = {term: closure([node for one, node in binding if one == term], parts) for term, _ in binding}
        for node in sorted(nodes):
            for term in sorted(bound.keys() & {*mentioned(node)}):
                if node not in bound[term]:
                    raise KnowledgeError(
                        f"<{node}>: {local_name(term)} is the c:witness of another condition, and has no meaning outside of it; "
                        "declare another c:Variable"
                    )
        return {value for node in nodes for value in mentioned(node) if value in self.terms} - bound.keys()


def with_classes(
    conditions: Sequence[Condition], classes: Mapping[str, Sequence[Condition]], told: AbstractSet[str] = frozenset()
) -> tuple[Condition, ...]:
    """Return a conjunction in which the definition of a variable's class stands beside the conditions that mention the variable.

    Parameters
    ----------
    conditions : sequence of Condition
    classes : mapping of variable to conditions
        The definitions of the classes of some variables.
    told : set of str
        The variables that belong to the whole conjunction, whatever the conditions mention.
    """
    plain = plain_variables(conditions) | told
    local = {name: definition for name, definition in classes.items() if name not in plain}
    found = tuple(in_groups(condition, local) for condition in conditions) if local else tuple(conditions)
    return (*found, *(one for name in classes if name in plain for one in classes[name]))


def in_groups(condition: Condition, classes: Mapping[str, Sequence[Condition]]) -> Condition:
    """Return a condition whose nested groups contain the definitions of the classes of their variables."""
    match condition:
        case Witness(_, _, inner):
            return replace(condition, conditions=with_classes(inner, classes))
        case AnyOf(alternatives):
            return replace(condition, alternatives=tuple(with_classes(group, classes) for group in alternatives))
        case _:
            return condition


def _of_classes(effect: Effect, classes: Mapping[str, Sequence[Condition]]) -> Effect:
    """Return an effect whose conditions contain the definitions of the classes of its own variables."""
    named = {*effect.arguments, *([effect.value] if isinstance(effect, ValueEffect) else terms_of(effect.amount))}
    return replace(effect, when=with_classes(effect.when, classes, classes.keys() & named))


def _plain(condition: Condition) -> bool:
    return not groups(condition)


def _is_part(node: NodeValues) -> bool:
    return not is_a(node, "Behavior", "SituationType", "Task", "Relation", "ReachRelation", "Level", "Window")

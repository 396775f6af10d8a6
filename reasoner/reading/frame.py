"""Translation of a schema for some individuals: situation types, behaviours, rules and aggregates, with all checks."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import TypeVar

from confab.reasoner.aggregates.dependencies import in_order, read_by, unfolded
from confab.reasoner.aggregates.extrema import extrema_replaced
from confab.reasoner.aggregates.remembering import NONE_ALLOWED, solutions_of
from confab.reasoner.amounts import Amount, Quantity, inside, written
from confab.reasoner.closure import closure
from confab.reasoner.derivation import TASK, circles, needed
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.language import DomainError, walk
from confab.reasoner.limits import checked
from confab.reasoner.local_variables import named_apart, rule_named_apart
from confab.reasoner.names import Names, local_name
from confab.reasoner.problem import Domain, below
from confab.reasoner.reading import swrl
from confab.reasoner.reading.definitions import THING, Definitions
from confab.reasoner.reading.facts import individuals_named
from confab.reasoner.reading.parts import Parts
from confab.reasoner.reading.remembering import Past, iris_of_the_past, past, remembers_in_order
from confab.reasoner.reading.rows import (
    HIGHEST_LEVEL,
    HIGHEST_NUMBER,
    NOT_OF_AMOUNTS,
    Member,
    OntologySchema,
    classes_of,
    goals_of,
    is_a,
    ordered,
)
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    Aggregate,
    AmountEffect,
    Behavior,
    ClassCondition,
    Comparison,
    Condition,
    Constraint,
    Parameter,
    Perceived,
    Rule,
    SituationType,
    ValueCondition,
    ValueEffect,
)
from confab.reasoner.vocabulary import CORE, EMBODIMENT, RDFS

WITH_CLASS = ("AbsenceCondition", "ClassCondition")
Derived = TypeVar("Derived", Rule, Aggregate)


class _Whole(Names):
    """A mapping of IRIs to names in which each IRI is its own name, except the IRIs of truth values."""

    def short(self, iri: str) -> str:
        return {CORE + TRUE: TRUE, CORE + FALSE: FALSE}.get(iri, iri)

    def __contains__(self, name: object) -> bool:
        return True


def as_written(schema: OntologySchema, behaviors: Iterable[str]) -> dict[str, Behavior]:
    """Return the given behaviours as written: names are IRIs, and classes aren't replaced by their definitions."""
    names = _Whole(())
    terms = set(schema.of_kind("Parameter", "Variable"))
    parts = Parts(schema.nodes, names, terms, set(schema.pairs), Definitions({}, {}, names), schema.individuals_of)
    return {iri: parts.behavior(iri) for iri in behaviors}


@dataclass(frozen=True)
class Frame:
    """The domain of a problem and the classes of some individuals: everything in a problem except its facts and its goal.

    `properties` maps the IRI of a value property to its situation type, and to whether an individual may have several values. In
    `domain`, maxima and minima have been replaced in all conditions, but behaviours don't yet update sums and counts. `lifted`
    contains the behaviours whose effects on all members of a class aren't yet expanded to one effect per member.
    """

    schema: OntologySchema
    parts: Parts
    domain: Domain
    classes: dict[str, tuple[str, ...]]
    parents: dict[str, tuple[str, ...]]
    properties: dict[str, tuple[str, bool]]
    lifted: dict[str, Behavior]

    @property
    def names(self) -> Names:
        """Short names of the schema's terms and of the individuals."""
        return self.parts.names


def frame(
    schema: OntologySchema, members: Sequence[Member], namesakes: Collection[str] = (), earlier: Frame | None = None
) -> Frame:
    """Return the domain that a schema describes, together with the classes of some individuals.

    `namesakes` are the IRIs of individuals that weren't read, but have the same local names as individuals that were read; short
    names differ from these, too. `earlier` is a frame of fewer individuals; the behaviours of this frame are reused unless a name
    in a behaviour has changed.
    """
    nodes, supers = schema.nodes, schema.supers
    instances = [(individual, kind, index) for individual, kind, index in members if individual not in nodes]
    names = names_of(schema, instances, namesakes)
    definitions = definitions_of(schema, names)
    terms = set(schema.of_kind("Parameter", "Variable"))
    parts = Parts(nodes, names, terms, set(schema.pairs), definitions, schema.individuals_of)
    classes, parents = classes_of(instances, supers, names)
    situations, properties = _situations(parts, schema, classes)
    before = past(parts, schema, situations)
    situations = [*before.situations.values()]
    constraints = _constraints(parts, schema, situations) | before.constraints
    situations += [SituationType(name, (), name, 1, quantity=NONE_ALLOWED) for name in constraints]
    if earlier is not None and earlier.names.agree(names):
        lifted = earlier.lifted
    else:
        in_order = sorted(ordered(schema.of_kind("Behavior"), nodes, names), key=parts.level)
        lifted = {names.short(iri): named_apart(parts.behavior(iri)) for iri in in_order}
    kinds = {s.name: s for s in situations}
    stated = _rules(parts, schema, kinds)
    rules = {
        name: tuple(_of_class(one, kinds[name], parents) for one in its) for name, its in stated.items()
    } | before.rules
    derived = _aggregates(parts, schema, kinds, rules, constraints)
    aggregates = {name: _of_class(one, kinds[name], parents) for name, one in derived.items()}
    domain = Domain(
        situations={s.name: s for s in _on_their_levels(situations, rules, aggregates, before)},
        behaviors=lifted,
        first_ids={
            parts.level(iri): parts.number(iri, "firstId", 0, HIGHEST_NUMBER, 0) for iri in schema.of_kind("Level")
        },
        rules=rules,
        aggregates=aggregates,
        constraints=constraints,
        remembers=before.remembers,
    )
    domain = replace(domain, remembers=remembers_in_order(domain, names))
    _check_rest_values(domain, names)
    for behavior in lifted.values():
        _check_behavior(behavior, domain)
    following: list[Rule | Aggregate] = [*chain.from_iterable(rules.values()), *aggregates.values()]
    for one in following:
        _check_behavior(replace(one.behavior, level=domain.situations[one.situation].level), domain)
    individuals_named(domain, names)
    lowest = max(domain.levels, default=HIGHEST_LEVEL)
    seen = {name: replace(one, level=min(one.level, lowest)) for name, one in domain.situations.items()}
    try:
        domain = extrema_replaced(
            replace(domain, situations=seen)
        )  # the lowest level with behaviours sees all situation types
    except DomainError as error:
        raise KnowledgeError(str(error)) from None
    return Frame(schema, parts, domain, classes, parents, properties, lifted)


def names_of(schema: OntologySchema, members: Iterable[Member], namesakes: Iterable[str] = ()) -> Names:
    """Return unique short names for a schema's terms, some individuals, and other IRIs with the same local names."""
    nodes = schema.nodes
    typed = (nodes[iri] for iri in schema.of_kind("Parameter", "Variable", *WITH_CLASS))
    return Names(
        {
            *schema.of_kind("SituationType", "Behavior", "Relation", "ReachRelation"),
            *(iri for iri in namesakes if iri not in nodes),
            *checked(goals_of(nodes), "reading the scene"),
            *schema.of_kind("Task"),
            *iris_of_the_past(schema),
            *chain.from_iterable(
                (iri, kind) for iri, kind, _ in checked(members, "reading the scene") if iri not in nodes
            ),
            *chain.from_iterable((sub, *above) for sub, above in schema.supers.items()),
            *(kind for node in typed for name in ("termType", "ofClass") for kind in node.get(CORE + name, ())),
        },
        {TASK: CORE + "Task"},
    )


def _rules(
    parts: Parts, schema: OntologySchema, situations: Mapping[str, SituationType]
) -> dict[str, tuple[Rule, ...]]:
    """Return the rules of each derived situation type: stated rules, and rules from class definitions and property axioms.

    Raise `KnowledgeError` for a derived type that a behaviour changes, that isn't boolean, or that depends on its own negation.
    """
    changed = {
        parts.one(iri, "situationType") for iri in schema.of_kind("ValueEffect") if parts.values(iri, "situationType")
    }
    written: dict[str, list[str]] = defaultdict(list)
    for iri in schema.of_kind("Rule"):
        if not parts.values(iri, "aggregate"):
            written[parts.one(iri, "situationType")].append(iri)
    arguments = {iri: situations[parts.names.short(iri)].arguments for iri in schema.of_kind("SituationType")}
    by_swrl = swrl.compiled(parts.definitions, arguments) if schema.swrl else {}
    found: dict[str, tuple[Rule, ...]] = {}
    for iri, kinds in arguments.items():
        name, said = parts.names.short(iri), parts.values(iri, "holdsOf")
        if by := [*written[iri], *said, *(["SWRL"] if iri in by_swrl else [])]:
            if parts.values(iri, "remembers"):
                raise KnowledgeError(
                    f"<{iri}> remembers a situation type, and <{min(by)}> defines it; keep one of them, or let c:remembers name a "
                    "defined situation type",
                    iri,
                )
            if iri in changed:
                who = min(e for e in schema.of_kind("ValueEffect") if list(parts.values(e, "situationType")) == [iri])
                raise KnowledgeError(
                    f"<{who}> changes {name}, which is defined by <{min(by)}>; remove the effect, or drop the definition",
                    who,
                )
            if not situations[name].boolean:
                mend = (
                    "state the c:aggregate of the rule"
                    if situations[name].quantity
                    else "make its value property not functional"
                )
                raise KnowledgeError(
                    f"<{iri}> is defined by <{min(by)}>, but has values; a defined situation type is boolean or an amount that is "
                    f"aggregated: {mend}"
                )
        rules = [rule_named_apart(parts.rule(rule, kinds)) for rule in written[iri]] + by_swrl.get(iri, [])
        if said and len(kinds) != 1:
            raise KnowledgeError(
                f"<{iri}> has c:holdsOf, so it needs one argument, but {len(kinds)} are stated; "
                "state by c:hasSituationType which class has it"
            )
        for kind in said:
            head = (Parameter("?it", kinds[0]),)
            rules.append(Rule(name, head, (), parts.definitions.holding("?it", kind)))
        if iri not in changed and iri in schema.pairs and not parts.values(iri, "remembers"):
            for prop in parts.values(iri, "valueProperty"):
                rules += parts.definitions.rules(prop, name, kinds, bool(rules))
        if not rules:
            continue
        found[name] = tuple(rules)
    for name, other in circles(found):
        raise KnowledgeError(
            f"{name} follows if {other} is false, and {other} depends on {name}, so the truth values of both are undefined; "
            "remove one of these conditions from its rule",
            next((rule for iri, rules in written.items() if parts.names.short(iri) == name for rule in rules), None)
            or parts.names.iri(name),
        )
    return found


def _of_class(one: Derived, kind: SituationType, parents: Mapping[str, Sequence[str]]) -> Derived:
    """Return a rule that concludes nothing about individuals outside of the classes that have its situation type."""
    heads = zip(one.parameters, kind.arguments, strict=True)
    more: list[Condition] = [ClassCondition(p.name, of) for p, of in heads if not below(p.kind, of, parents)]
    return replace(one, conditions=(*more, *one.conditions)) if more else one


def _aggregates(
    parts: Parts,
    schema: OntologySchema,
    situations: Mapping[str, SituationType],
    rules: Mapping[str, Sequence[Rule]],
    constraints: Mapping[str, Constraint],
) -> dict[str, Aggregate]:
    """Return the derived amounts, and the counts of the violations of constraints, in order of dependency.

    Raise `KnowledgeError` for a derived amount that a behaviour changes, with two rules, undeclared, or dependent on itself.
    """
    found: dict[str, Aggregate] = {}
    for iri in schema.of_kind("Rule"):
        if not parts.values(iri, "aggregate"):
            continue
        situation = parts.one(iri, "situationType")
        name = parts.names.short(situation)
        if name in found:
            raise KnowledgeError(f"<{iri}>: {name} has two rules with an aggregate; keep one of the rules", iri)
        for effect in schema.of_kind("AmountEffect"):
            if list(parts.values(effect, "situationType")) == [situation]:
                raise KnowledgeError(
                    f"<{effect}> changes {name}, which is defined by <{iri}>; remove the effect, or drop the rule",
                    effect,
                )
        try:
            found[name] = unfolded(parts.aggregate(iri, situations[name].arguments), rules, situations)
        except DomainError as error:
            raise KnowledgeError(f"<{iri}>: {error}", iri) from None
        quantity = situations[name].quantity
        if quantity is not None and quantity.bounded and not found[name].kept:
            raise KnowledgeError(
                f"{name} is a {found[name].function} with bounds, but planning can't enforce these bounds; "
                "let the behaviours require a comparison instead",
                situation,
            )
    for name, constraint in constraints.items():
        try:
            found[name] = unfolded(
                solutions_of(name, situations[constraint.situation], constraint.always), rules, situations
            )
        except DomainError:
            raise KnowledgeError(
                f"{constraint}, but it is defined recursively; constrain a situation type whose definition isn't recursive",
                parts.names.iri(constraint.situation),
            ) from None
    try:
        return {one.situation: one for one in in_order(found)}
    except DomainError as error:
        raise KnowledgeError(str(error), parts.names.iri(str(error).split()[0])) from None


def _constraints(parts: Parts, schema: OntologySchema, situations: Iterable[SituationType]) -> dict[str, Constraint]:
    """Return the constraints by the name of the amount that counts their violations.

    Raise `KnowledgeError` for a type that isn't boolean, or that is constrained to be both never and always true.
    """
    found, known = {}, {situation.name: situation for situation in situations}
    for iri in sorted(schema.of_kind("SituationType"), key=parts.names.short):
        name, said = parts.names.short(iri), [word for word in ("never", "always") if parts.flag(iri, word)]
        if len(said) > 1:
            raise KnowledgeError(f"<{iri}> has both c:never and c:always; keep one of the two", iri)
        if said and not known[name].boolean:
            raise KnowledgeError(
                f"<{iri}>: c:{said[0]} needs a situation type that is true or false, but {name} has other values; "
                "define a situation type by a rule about these values, and constrain that instead",
                iri,
            )
        if said:
            found[f"{name}.exceptions"] = Constraint(name, said == ["always"])
    return found


def _on_their_levels(
    situations: Iterable[SituationType],
    rules: Mapping[str, Sequence[Rule]],
    aggregates: Mapping[str, Aggregate],
    before: Past,
) -> Iterator[SituationType]:
    """Yield the situation types with their levels; a derived type has the first level with all types on which it depends."""
    known = {s.name: s for s in situations}
    reads = {name: {s for rule in its for s, _ in needed(rule.conditions)} for name, its in rules.items()}
    reads |= {name: {*read_by(one)} for name, one in aggregates.items()}
    reads |= {name: {source} for name, source in before.remembers.items()}
    for name, situation in known.items():
        read = closure([name], lambda each: reads.get(each, ()))
        yield replace(situation, level=max(known[each].level for each in read if each in known))


def definitions_of(schema: OntologySchema, names: Names) -> Definitions:
    """Return the definitions of classes and situation types, with the domains and ranges of properties."""
    properties = {prop: (iri, iri not in schema.pairs) for prop, iri in schema.value_properties.items()}
    kinds: dict[str, tuple[str, str]] = {}
    owners: dict[str, list[str]] = defaultdict(list)
    for kind, situation in schema.owners:
        owners[situation].append(kind)
    for prop, (situation, _) in properties.items():
        kinds[prop] = "|".join(map(names.short, owners[situation])), names.short(situation)
    for iri in schema.of_kind("Relation", "ReachRelation"):
        ends = (schema.nodes[iri].get(RDFS + end, ()) for end in ("domain", "range"))
        one, other = (
            names.short(end[0]) if len(end) == 1 and ":" in end[0] and end[0] != THING else "" for end in ends
        )
        kinds[iri] = one, other
    nodes = {**schema.expressions, **schema.axioms, **schema.swrl}
    found = Definitions(nodes, properties, names, schema.numbers, kinds)
    concluded = {}
    of_rules = {*found.recursive, *(swrl.heads(schema.swrl) if schema.swrl else ())}
    ruled = {one for rule in schema.of_kind("Rule") for one in schema.nodes[rule].get(CORE + "situationType", ())}
    for iri in schema.of_kind("SituationType") if of_rules or ruled else ():
        for kind in schema.nodes[iri].get(CORE + "holdsOf", ()):
            if kind in of_rules or iri in ruled:
                concluded[kind] = iri, owners[iri][0] if len(owners[iri]) == 1 else ""
    return replace(found, concluded=concluded)


def _check_rest_values(domain: Domain, names: Names) -> None:
    """Raise `KnowledgeError` if a derived situation type has a rest value."""
    for name in sorted(domain.rules):
        if domain.situations[name].rest is not None:
            raise KnowledgeError(
                f"{name} is derived, and has a c:restValue; only behaviours restore rest values; state rest values of the "
                "situation types that its rules read, or a goal, instead",
                names.iri(name),
            )


def _check_behavior(behavior: Behavior, domain: Domain) -> None:
    """Raise `KnowledgeError` for a wrong number of arguments, or a situation type that the behaviour's level doesn't have."""
    conditions = [inner for condition in behavior.conditions for inner in walk(condition)]
    compared = [side for c in conditions if isinstance(c, Comparison) for side in (c.left, c.right)]
    amounts = (*compared, *(effect.amount for effect in behavior.amounts))
    parts = (
        *conditions,
        *behavior.effects,
        *behavior.amounts,
        *(part for amount in amounts for part in inside(amount)),
    )
    for part in parts:
        if not isinstance(part, ValueCondition | ValueEffect | AmountEffect | Amount):
            continue
        situation = domain.situations[part.situation]
        if len(part.arguments) != len(situation.arguments):
            raise KnowledgeError(
                f"{behavior.name} uses {part.situation} with {len(part.arguments)} arguments, but it has "
                f"{len(situation.arguments)}: correct the condition or effect, or state which class has that situation type"
            )
        if situation.level > behavior.level:
            raise KnowledgeError(
                f"{behavior.name} on level {behavior.level} uses {part.situation}, but this situation type exists only from level "
                f"{situation.level} on; correct the behaviour's c:level or the situation type's c:fromLevel"
            )


def _check_classes(schema: Parts, iri: str, owners: Sequence[str], supers: Mapping[str, Sequence[str]]) -> None:
    """Raise `KnowledgeError` if conditions define a class whose individuals have a situation type or are its values."""
    for kind in filter(schema.definitions.changes, sorted(supers)):
        required = schema.definitions.required(kind)
        above, implied = (closure(each, lambda one: supers.get(one, ())) for each in ([kind], required))
        if iri in above - implied:
            base = schema.definitions.base(kind)
            raise KnowledgeError(
                f"{local_name(kind)} is a subclass of the situation type {local_name(iri)}, but the definition of "
                f"{local_name(kind)} becomes conditions, so its members can't be values; make {local_name(base)} the subclass, or "
                "state the values one by one",
                iri,
            )
    for kind in (*owners, *(schema.one(parameter, "termType") for parameter in schema.values(iri, "parameter"))):
        if schema.definitions.changes(kind):
            base = local_name(schema.definitions.base(kind))
            raise KnowledgeError(
                f"{local_name(iri)} is a situation type of {local_name(kind)}, but the definition of {local_name(kind)} becomes "
                f"conditions, which no situation type depends on; make it one of {base}, and require {local_name(kind)} in the "
                "behaviours",
                iri,
            )


def _situations(
    schema: Parts, read: OntologySchema, classes: dict[str, tuple[str, ...]]
) -> tuple[list[SituationType], dict[str, tuple[str, bool]]]:
    """Return the sorted situation types, and for each value property its situation type and whether the type is boolean."""
    found, properties = [], {}
    for iri in sorted(read.of_kind("SituationType"), key=schema.names.short):
        name = schema.names.short(iri)
        owners = [kind for kind, situation in read.owners if situation == iri]
        _check_classes(schema, iri, owners, read.supers)
        owning = list(map(schema.names.short, owners))
        parameters = [schema.parameter(p) for p in ordered(schema.values(iri, "parameter"), schema.nodes, schema.names)]
        arguments = tuple(p.kind for p in parameters) or ((_union(owning, classes),) if owning else ())
        value_property = schema.values(iri, "valueProperty")
        # A situation type with a value property has values other than true and false, even if no other value has been
        # read.
        boolean = not value_property and set(classes.get(name, ())) <= {TRUE, FALSE}
        if iri in schema.pairs:
            arguments, boolean = (*arguments, name), True
        for iri_of_property in value_property:
            properties[iri_of_property] = (name, iri in schema.pairs)
        if quantity := _quantity(schema, iri, iri in read.whole):
            boolean = False
            for prop, remedy in NOT_OF_AMOUNTS.items():
                if schema.nodes[iri].get(prop):
                    raise KnowledgeError(f"{name} is an amount, and has a c:{local_name(prop)}; {remedy}", iri)
        rest = schema.values(iri, "restValue")
        default = schema.values(iri, "defaultValue") or rest
        if iri in schema.pairs and default and schema.term(default[0]) == TRUE:
            raise KnowledgeError(
                f"{name} holds only of the pairs that are stated, so a rest value or default can't make it true of all; "
                "drop the value, or declare the opposite situation type",
                iri,
            )
        found.append(
            SituationType(
                name=name,
                arguments=arguments,
                range="Truth" if boolean else name,
                level=schema.number(iri, "fromLevel", 0, HIGHEST_LEVEL, 1),
                rest=schema.term(rest[0]) if rest else None,
                default=schema.term(default[0]) if default else (FALSE if boolean else None),
                boolean=boolean,
                quantity=quantity,
                perceived=_perceived(schema, iri, iri in read.exclusive),
                properties=tuple(map(schema.names.short, value_property)),
            )
        )
        if quantity and (amount := schema.decimal(iri, "defaultAmount")) is not None:
            found[-1] = replace(found[-1], default=written(amount))
    return found, properties


def _perceived(schema: Parts, iri: str, exclusive: bool) -> Perceived | None:
    """Return how a situation type is perceived; return None if no perceiver is stated."""
    node = schema.nodes[iri]
    if not (perceivers := node.get(EMBODIMENT + "perceiver")):
        return None
    special = (
        (local_name(prop), schema.names.short(value))
        for prop, values in sorted(node.items())
        if prop.startswith(EMBODIMENT + "value")
        for value in values
    )
    return Perceived(local_name(perceivers[0]), exclusive, tuple(special))


def _quantity(schema: Parts, iri: str, whole: bool) -> Quantity | None:
    if not is_a(schema.nodes[iri], "Amount"):
        return None
    unit = schema.one(iri, "unit") if schema.values(iri, "unit") else ""
    least, most = schema.decimal(iri, "leastAmount"), schema.decimal(iri, "mostAmount")
    return Quantity(unit, whole or schema.flag(iri, "wholeNumbers"), least, most)


def _union(kinds: Sequence[str], classes: dict[str, tuple[str, ...]]) -> str:
    """Return the name of the union of several classes, and add the union to `classes` if it doesn't exist."""
    name = "|".join(kinds)
    if name not in classes:
        classes[name] = tuple(dict.fromkeys(member for kind in kinds for member in classes.get(kind, ())))
    return name

"""Random classes that share individuals with other classes, and classes that an OWL expression defines.

A *defined* class has the individuals of an expression over other classes. A *described* class has the individuals that satisfy
conditions in a state: its expression has restrictions on value properties. In a problem, a described class is a disjunction of
one alternative, which a scene writes as the class.
"""

from __future__ import annotations

from fractions import Fraction
from random import Random

from confab.reasoner.amounts import Amount
from confab.reasoner.language import substituted
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    AnyOf,
    ClassCondition,
    Comparison,
    Condition,
    EqualityCondition,
    Parameter,
    RelationCondition,
    Rule,
    SituationType,
    ValueCondition,
    Witness,
)
from worlds.phrases import SELF, Vocabulary, contrary, named

FILLER, OTHER = "?filler", "?other"


def overlapping(draft: Vocabulary, own: Random) -> None:
    """Draw individuals of two classes: a class of some individuals of all classes, one below two classes, and defined classes."""
    classes, both = draft.classes, tuple(f"b{i}" for i in range(own.choice((0, 1, 1))))
    for kind in ("A", "B"):
        classes[kind] = (*classes[kind], *both)
    classes["AB"], draft.parents["AB"] = both, ("A", "B")
    draft.objects = tuple(dict.fromkeys((*draft.objects, *both)))
    classes["C"] = tuple(one for one in draft.objects if own.random() < 0.5)
    draft.parents["C"] = ()
    draft.owning = ("AB", "C", "C")
    draft.overlaps = list(draft.owning)
    if own.random() < 0.25:
        apart = own.choice((("A", "C"), ("A", "B"), ("C", "A1"), ("B", "A")))
        members = tuple(one for one in classes[apart[0]] if one not in classes[apart[1]])
        classes["N"], draft.parents["N"] = members, (apart[0],)
        draft.definitions["N"] = _every(f":{apart[0]}", _no(f":{apart[1]}"))
        draft.overlaps.append("N")
    if own.random() < 0.4:
        parts = own.choice((("A1", "B"), ("B", "C"), ("AB", "C"), ("A1", "C")))
        define(
            draft,
            "U",
            tuple(one for one in draft.objects if any(one in classes[of] for of in parts)),
            "unionOf",
            *parts,
        )
    if own.random() < 0.4:
        parts = own.choice((("A", "C"), ("B", "C"), ("A", "B"), ("A1", "C")))
        define(
            draft, "I", tuple(one for one in classes[parts[0]] if one in classes[parts[1]]), "intersectionOf", *parts
        )


def define(draft: Vocabulary, name: str, members: tuple[str, ...], operator: str, *parts: str) -> None:
    """Add a class with an expression over other classes."""
    draft.classes[name], draft.parents[name] = members, ()
    draft.definitions[name] = f"[ a owl:Class ; owl:{operator} ( {' '.join(f':{part}' for part in parts)} ) ]"
    draft.overlaps.append(name)
    draft.owning = (*draft.owning, name)


def describe(draft: Vocabulary, own: Random) -> None:
    """Draw up to two classes that restrictions on value properties define."""
    for number in range(own.choice((1, 1, 2))):
        base = own.choice(("A", "A", "B", "A1", "AB", "C"))
        found = [expression(draft, own, base) for _ in range(own.choice((1, 1, 2)))]
        if not (parts := [one for one in found if one is not None]):
            continue
        draft.described[f"K{number}"] = (ClassCondition(SELF, base), *(condition for _, condition in parts))
        draft.definitions[f"K{number}"] = _every(f":{base}", *(text for text, _ in parts))
        if own.random() < 0.4:  # a situation type that holds of the members of the class
            hold(draft, f"D{number + 5}", f"K{number}", base, draft.described[f"K{number}"])

    links = [
        one
        for one in draft.situations.values()
        if one.name[0] in "FR" and draft.owners[one.name] and one.name not in draft.rules
    ]
    if links and own.random() < 0.3:  # a class that refers to itself
        one, base = own.choice(links), own.choice(("A", "B", "C"))
        if (first := expression(draft, own, base)) is None:
            return
        linked = (SELF, FILLER), TRUE
        of, value = linked if one.boolean else ((SELF,), FILLER)
        further = Witness(FILLER, base, (ValueCondition(one.name, of, value), ValueCondition("D4", (FILLER,), TRUE)))
        draft.definitions["K4"] = _every(
            f":{base}",
            f"[ a owl:Class ; owl:unionOf ( {first[0]} {_some(f':{one.name.lower()}', 'owl:someValuesFrom :K4')} ) ]",
        )
        hold(draft, "D4", "K4", base, (AnyOf(((first[1],), (further,))),))


def hold(draft: Vocabulary, name: str, kind: str, base: str, conditions: tuple[Condition, ...]) -> None:
    """Add a situation type that holds of the members of a class."""
    level = max((draft.situations[each].level for each in named(conditions) - {name}), default=1)
    draft.owners[name] = (base,)
    draft.situations[name] = SituationType(name, (base,), "Truth", level, boolean=True, default=FALSE)
    draft.rules[name] = (Rule(name, (Parameter(SELF, base),), (), conditions),)
    draft.axioms[name] = (f":{name} c:holdsOf :{kind} .",)


def expression(draft: Vocabulary, own: Random, base: str, depth: int = 1) -> tuple[str, Condition] | None:
    """Return a class expression and the condition that it expresses, or None if there is no property."""
    draw = own.random()
    if depth and draw < 0.2:
        if None in (parts := [expression(draft, own, base, 0) for _ in range(2)]):
            return None
        (one, first), (other, second) = (part for part in parts if part is not None)
        return f"[ a owl:Class ; owl:unionOf ( {one} {other} ) ]", AnyOf(((first,), (second,)))
    if draw < 0.3 and draft.classes[base]:
        one = own.choice(draft.classes[base])
        return f"[ a owl:Class ; owl:oneOf ( :{one} ) ]", EqualityCondition(SELF, one)
    if draw < 0.4:
        kind = own.choice(("A1", "C", "AB"))
        return f":{kind}", ClassCondition(SELF, kind)
    if (found := restriction(draft, own, base)) is None or own.random() < 0.65:
        return found
    return _no(found[0]), contrary(found[1])


def restriction(draft: Vocabulary, own: Random, base: str) -> tuple[str, Condition] | None:
    """Return an OWL restriction on a property, and the condition that it expresses, or None if there is no property."""
    members = {*draft.classes[base]}
    situations = [
        one
        for one in draft.situations.values()
        if one.name[0] in "FRN" and draft.owners[one.name] and members & {*draft.classes[one.arguments[0]]}
    ]
    if ("near" in draft.ends and own.random() < 0.15) or not situations:
        if "near" not in draft.ends:
            return None
        kind = own.choice(("A", "B", "C"))
        inner: Condition = RelationCondition("near", (SELF, FILLER))
        return _some(":near", f"owl:someValuesFrom :{kind}"), Witness(FILLER, kind, (inner,))
    one = own.choice(situations)
    of = f":{one.name.lower()}"
    if one.quantity is not None:
        facet, sign = own.choice((("minInclusive", ">="), ("maxExclusive", "<"), ("maxInclusive", "<=")))
        limit = own.choice((1, 2))
        within = (
            f"[ a rdfs:Datatype ; owl:onDatatype xsd:decimal ; owl:withRestrictions ( [ xsd:{facet} {limit}.0 ] ) ]"
        )
        return _some(of, f"owl:someValuesFrom {within}"), Comparison(Amount(one.name, (SELF,)), sign, Fraction(limit))
    pairs = one.boolean
    values = draft.classes[one.arguments[1] if pairs else one.range]
    seen = [value for value in values if draft.values.get(value, 1) == 1]
    if seen and own.random() < 0.6:
        value = own.choice(seen)
        said: Condition = (
            ValueCondition(one.name, (SELF, value), TRUE) if pairs else ValueCondition(one.name, (SELF,), value)
        )
        return _some(of, f"owl:hasValue :{value}"), said
    kind = own.choice(("A", "B", "C"))
    said = ValueCondition(one.name, (SELF, FILLER), TRUE) if pairs else ValueCondition(one.name, (SELF,), FILLER)
    if own.random() < 0.3:
        said = ValueCondition(one.name, (FILLER, SELF), TRUE) if pairs else ValueCondition(one.name, (FILLER,), SELF)
        of = f"[ owl:inverseOf {of} ]"
        pairs = True
    if pairs and own.random() < 0.3:  # at least two
        other = Witness(
            OTHER, kind, (substituted(said, {FILLER: OTHER}), EqualityCondition(OTHER, FILLER, negated=True))
        )
        text = f'owl:minQualifiedCardinality "2"^^xsd:nonNegativeInteger ; owl:onClass :{kind}'
        return _some(of, text), Witness(FILLER, kind, (said, other))
    if of.startswith(":") and own.random() < 0.3:  # only
        outside = (said, ClassCondition(FILLER, kind, negated=True))
        range_of = one.arguments[1] if one.boolean else one.range
        return _some(of, f"owl:allValuesFrom :{kind}"), Witness(FILLER, range_of, outside, negated=True)
    return _some(of, f"owl:someValuesFrom :{kind}"), Witness(FILLER, kind, (said,))


def _every(*parts: str) -> str:
    return f"[ a owl:Class ; owl:intersectionOf ( {' '.join(parts)} ) ]"


def _no(part: str) -> str:
    return f"[ a owl:Class ; owl:complementOf {part} ]"


def _some(of: str, said: str) -> str:
    return f"[ a owl:Restriction ; owl:onProperty {of} ; {said} ]"

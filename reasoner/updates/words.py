"""Parser of SPARQL updates and CONSTRUCT queries; it uses rdflib's grammar and adds positions.

rdflib's grammar doesn't record positions. In a copy of the grammar, variables and names are parsed as a `Word` with its original
text and position. All other parts of the syntax tree are those that rdflib creates.
"""

from __future__ import annotations

import math
import re
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from copy import deepcopy
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from functools import cache
from typing import Any

import pyparsing

from confab.reasoner.files import silent_about_numbers
from confab.reasoner.vocabulary import RDF

A = "a"
FIRST, REST, NIL = (RDF + name for name in ("first", "rest", "nil"))


class Word(str):
    """A variable (``?cup``), a name (``:Cup``, ``<https://…>``) or ``a`` in its original notation, with its position `at`."""

    at: int = 0

    @property
    def variable(self) -> bool:
        """Whether the word is a variable."""
        return self.startswith("?")


@dataclass(frozen=True)
class Truth:
    """A truth value, ``true`` or ``false``."""

    value: bool


@dataclass(frozen=True)
class NumberLiteral:
    """An exact number."""

    value: Fraction


Said = Word | Truth | NumberLiteral
Value = Word | Truth | NumberLiteral | tuple[Said, ...]


@dataclass(frozen=True)
class Triple:
    """A triple pattern.

    If the object of a pattern is an RDF list, such as ``(?shelf true)``, the object is represented by a tuple.
    """

    subject: Word
    predicate: Word
    object: Value


@dataclass(frozen=True)
class UpdateOperation:
    """The operation ``DELETE { … } INSERT { … } WHERE { … }``; `where` contains the parts of the WHERE group."""

    delete: Sequence[Triple]
    insert: Sequence[Triple]
    where: Sequence[Any]
    at: int


@dataclass(frozen=True)
class Construction:
    """The query ``CONSTRUCT { head } WHERE { … }``.

    If WHERE contains a SELECT, the other fields describe the aggregate and the GROUP BY of the SELECT.
    """

    head: Triple
    where: Sequence[Any]
    function: str = ""
    argument: Any = None
    name: str = ""
    grouped: frozenset[str] = frozenset()


class UpdateError(ValueError):
    """Raised if an update can't be compiled; contains the reason, a remedy, and the position in the text."""

    def __init__(self, what: str, remedy: str, at: int) -> None:
        super().__init__(f"{what}; {remedy}")
        self.what, self.remedy, self.at = what, remedy, at


@silent_about_numbers()
def parsed(text: str) -> tuple[Mapping[str, str], list[UpdateOperation]]:
    """Return the prefixes that an update declares, and its operations in order.

    >>> prefixes, (operation,) = parsed("PREFIX : <urn:x#> DELETE { ?a :p ?b } INSERT { ?a :p :c } WHERE { ?a :p ?b }")
    >>> prefixes, operation.delete[0].object, operation.insert[0].object.at
    ({'': 'urn:x#'}, '?b', 53)

    Raises
    ------
    UpdateError
        The text isn't a SPARQL update, or it contains an operation other than a deletion or an insertion.
    """
    write = "write DELETE { … } INSERT { … } WHERE { … }"
    tree = _tree("UpdateUnit", text, "update", write)[0]
    if not tree.request:
        raise UpdateError("the update is empty", write, 0)
    return _prefixes(tree.prologue or ()), [_operation(request, text) for request in tree.request or ()]


CONSTRUCT = "write CONSTRUCT { ?x :property ?y } WHERE { … }"
PATHS = ("PathAlternative", "PathSequence", "PathElt", "PathPrimary")
"""The names of the parts of a path that may enclose a single property."""
SELECT = "write SELECT ?x (SUM(?n) AS ?total) WHERE { … } GROUP BY ?x"
AGGREGATE = re.compile("Aggregate_(Sum|Count|Max|Min)")


@silent_about_numbers()
def constructed(text: str) -> tuple[Mapping[str, str], Construction]:
    """Return the prefixes that a CONSTRUCT query declares, and its head and conditions.

    >>> total = "SELECT ?a (COUNT(?b) AS ?n) WHERE { ?b <urn:q> ?a } GROUP BY ?a"
    >>> _, one = constructed(f"CONSTRUCT {{ ?a <urn:p> ?n }} WHERE {{ {total} }}")
    >>> one.function, one.name, sorted(one.grouped)
    ('count', '?n', ['?a'])

    Raises
    ------
    UpdateError
        The text isn't a CONSTRUCT query, or its head has more than one pattern.
    """
    prologue, tree = _tree("QueryUnit", text, "CONSTRUCT query", CONSTRUCT)
    if tree.name != "ConstructQuery" or tree.datasetClause or not tree.template:
        raise UpdateError("a rule has to be a CONSTRUCT query with a head", CONSTRUCT, 0)
    if tree.groupby or tree.having or tree.orderby or tree.limitoffset or tree.valuesClause:
        raise UpdateError(
            "a rule has no GROUP BY, HAVING, ORDER BY, LIMIT or VALUES behind WHERE",
            "put VALUES inside the braces of WHERE",
            0,
        )
    heads = [triple for block in tree.template for triple in triples(block)]
    if len(heads) != 1:
        raise UpdateError(
            f"the head of the rule has {len(heads)} patterns",
            "write one pattern, and a separate rule for each further pattern",
            heads[-1].subject.at,
        )
    if tree.where.name != "SubSelect":
        return _prefixes([prologue]), Construction(heads[0], parts(tree.where))
    return _prefixes([prologue]), _aggregated(heads[0], tree.where)


def _aggregated(head: Triple, select: Any) -> Construction:
    """Return a rule whose WHERE is a SELECT with an aggregate."""
    at = head.subject.at
    computed = [one for one in select.projection or () if one.evar]
    if len(computed) != 1 or select.having or select.orderby or select.limitoffset or select.valuesClause:
        raise UpdateError(
            "the SELECT of a rule needs exactly one aggregate, without HAVING, ORDER BY, LIMIT and VALUES", SELECT, at
        )
    grouped = list(select.groupby.condition) if select.groupby else []
    shown = [one.var for one in select.projection if not one.evar]
    if not all(isinstance(one, Word) for one in grouped) or {*shown} != {*grouped}:
        raise UpdateError("SELECT and GROUP BY don't name the same variables", SELECT, place(select.projection) or at)
    inner = computed[0].expr
    while getattr(inner, "name", "").endswith("Expression") and not inner.other:
        inner = inner.expr
    found = AGGREGATE.fullmatch(getattr(inner, "name", ""))
    if not found:
        raise UpdateError(
            "the SELECT of a rule computes another function than SUM, COUNT, MAX and MIN", SELECT, computed[0].evar.at
        )
    if inner.distinct:
        raise UpdateError(
            "DISTINCT isn't supported",
            "put the conditions on variables that aren't counted into FILTER EXISTS { … }",
            computed[0].evar.at,
        )
    return Construction(
        head, parts(select.where), found[1].lower(), inner.vars, str(computed[0].evar), frozenset(map(str, grouped))
    )


def _tree(unit: str, text: str, what: str, write: str) -> Any:
    """Return the syntax tree of a text, or raise `UpdateError` with the position at which parsing stopped."""
    try:
        return _grammar(unit).parse_string(text, parse_all=True)
    except pyparsing.ParseBaseException:
        at = _stuck(unit, text)
        near = text[at:].split()
        found = f"'{near[0][:30]}' isn't expected here" if near else "something is missing at the end"
        raise UpdateError(f"this is no SPARQL {what}: {found}", write, at) from None


def _prefixes(prologues: Iterable[Any]) -> dict[str, str]:
    """Return the prefixes that PREFIX declarations define."""
    prefixes = {}
    for prologue in prologues:
        for declared in prologue:
            if declared.name == "Base":
                raise UpdateError("BASE isn't supported", "write whole IRIs, or PREFIX lines", 0)
            prefixes[str(declared.prefix or "")] = str(declared.iri).strip("<>")
    return prefixes


def _copied(*elements: Any) -> tuple[Any, ...]:
    """Return copies of grammar elements. All copies share the token with which pyparsing marks a missing optional part."""
    missing = pyparsing.Opt(pyparsing.Empty()).defaultValue
    return deepcopy(elements, {id(missing): missing})


@cache
def _grammar(unit_name: str) -> pyparsing.ParserElement:
    from rdflib import Literal
    from rdflib.plugins.sparql import parser

    unit, variable, name, iri, a, negative = _copied(
        getattr(parser, unit_name), parser.Var, parser.PrefixedName, parser.IRIREF, parser.A, parser.DECIMAL_NEGATIVE
    )
    negative.set_parse_action(lambda tokens: Literal(-tokens[0].value))  # rdflib's own action fails with decimals

    def word(element: pyparsing.ParserElement, spelled: Any) -> None:
        def placed(text: str, at: int, tokens: pyparsing.ParseResults) -> Word:
            found = Word(spelled(tokens[0]))
            found.at = _skipped(text, at)
            return found

        element.add_parse_action(placed)

    word(variable, lambda token: f"?{token}")
    word(name, lambda token: f"{token.prefix or ''}:{token.localname or ''}")
    word(iri, lambda token: f"<{token}>")
    word(a, lambda _: A)
    unit.parse_with_tabs()
    assert isinstance(unit, pyparsing.ParserElement)
    return unit


def _stuck(unit_name: str, text: str) -> int:
    """Return the farthest position in an invalid text at which an element of the grammar failed."""
    from rdflib.plugins.sparql import parser

    unit, farthest = _copied(getattr(parser, unit_name))[0].parse_with_tabs(), 0

    def failed(_: str, at: int, *__: object) -> None:
        nonlocal farthest
        farthest = max(farthest, at)

    for element in unit.visit_all():
        element.set_fail_action(failed)
    with suppress(pyparsing.ParseBaseException, TypeError):  # rdflib raises TypeError for -0.5
        unit.parse_string(text, parse_all=True)
    return _skipped(text, farthest)


def _skipped(text: str, at: int) -> int:
    """Return the position of the first character at or after `at` that isn't white space."""
    return len(text) - len(text[at:].lstrip())


def _operation(request: Any, text: str) -> UpdateOperation:
    if request.name == "DeleteWhere":
        delete = _quads(request.quads)
        return UpdateOperation(delete, (), [_DeletePattern(delete)], _least(delete, 0))
    if request.name == "InsertData":
        insert = _quads(request.quads)
        return UpdateOperation((), insert, (), _least(insert, 0))
    if request.name != "Modify" or request.withClause or request.using:
        raise UpdateError(
            "a behaviour deletes and inserts in the situation that it is done in",
            "write DELETE { … } INSERT { … } WHERE { … } without WITH, USING, GRAPH and other operations",
            0,
        )
    delete = _quads(request.delete.quads) if request.delete else []
    insert = _quads(request.insert.quads) if request.insert else []
    return UpdateOperation(delete, insert, parts(request.where), _least([*delete, *insert], 0))


@dataclass(frozen=True)
class _DeletePattern:
    """The triples of a DELETE WHERE operation, in the form of a part of a group."""

    triples: Sequence[Triple]
    name: str = "Read"


def _least(triples: Sequence[Triple], otherwise: int) -> int:
    return min((triple.subject.at for triple in triples), default=otherwise)


def _quads(quads: Any) -> list[Triple]:
    if quads.quadsNotTriples:
        raise UpdateError("GRAPH isn't supported", "leave GRAPH out, since a behaviour is about one situation", 0)
    return [triple for block in quads.triples or () for triple in triples(block)]


def parts(group: Any) -> Sequence[Any]:
    """Return the parts of a group graph pattern."""
    if group.name == "SubSelect":
        raise UpdateError("a SELECT inside isn't supported", "write its patterns themselves", 0)
    return group.part or ()


def triples(block: Sequence[Any]) -> Iterator[Triple]:
    """Yield the triples of a flat list of terms; RDF lists become tuples."""
    cells: dict[object, list[Any]] = {}
    rows = [(block[i], block[i + 1], block[i + 2]) for i in range(0, len(block), 3)]
    for subject, predicate, value in rows:
        if str(predicate) in (FIRST, REST):
            cells.setdefault(subject, [None, None])[str(predicate) == REST] = value
    for subject, predicate, value in rows:
        if str(predicate) in (FIRST, REST):
            continue
        where = _predicate(predicate)
        if not isinstance(subject, Word):
            raise UpdateError(
                "a pattern begins with something that has no name",
                "begin it with a variable or an individual; a list comes last, as in ?from :WAY (?to ?m)",
                where.at,
            )
        yield Triple(subject, where, _value(value, cells, where.at))


def _value(value: Any, cells: Mapping[object, list[Any]], at: int) -> Value:
    if not isinstance(value, Hashable) or value not in cells:  # literals are unhashable parts of the tree
        return term(value, at)
    found = []
    while str(value) != NIL:
        first, value = cells[value]
        found.append(term(first, at))
    return tuple(found)


def term(value: Any, at: int) -> Said:
    """Return a variable, a name, a truth value or a number of the syntax tree.

    Raises
    ------
    UpdateError
        The value is of another kind, for example a text or a blank node.
    """
    if isinstance(value, Word):
        return value
    said = getattr(value, "value", None)
    if isinstance(said, bool):
        return Truth(said)
    if isinstance(said, int | float | Decimal):
        if not math.isfinite(said):
            raise UpdateError("a number is too large", "write a smaller number", at)
        return NumberLiteral(Fraction(str(value)))
    text = value if type(value).__name__ == "Literal" else getattr(value, "string", None)
    if text is None:
        raise UpdateError(
            "a node without a name is in the place of an individual", "name an individual, or use a variable", at
        )
    remedy = f"write {text} without quotation marks" if str(text) in ("true", "false") else ""
    raise UpdateError(
        f"the text '{text}' is in the place of an individual", remedy or "name an individual, or use a variable", at
    )


def _predicate(path: Any) -> Word:
    """Return the property of a property path, which must consist of a single property."""
    at = place(path)
    while not isinstance(path, Word):
        inner = path.part if isinstance(path.part, Word | Mapping) else [*(path.part or ())]
        if path.mod or path.name not in PATHS or (isinstance(inner, list) and len(inner) != 1):
            raise UpdateError(
                "a path isn't supported", "write a pattern for each step of it, and UNION for each choice", at
            )
        path = inner[0] if isinstance(inner, list) else inner
    return path


def words(tree: Any) -> Iterator[Word]:
    """Yield the words of a part of the syntax tree.

    >>> _, (operation,) = parsed("INSERT {} WHERE { FILTER NOT EXISTS { ?a <urn:p> ?b } }")
    >>> [str(word) for word in words(operation.where)]
    ['?a', '<urn:p>', '?b']
    """
    if isinstance(tree, Word):
        yield tree
    elif isinstance(tree, Triple):
        said = tree.object if isinstance(tree.object, tuple) else (tree.object,)
        yield from (word for word in (tree.subject, tree.predicate, *said) if isinstance(word, Word))
    elif not isinstance(tree, str) and isinstance(tree, Iterable):
        for part in tree.values() if isinstance(tree, dict) else tree:
            yield from words(part)


def place(tree: Any) -> int:
    """Return the position of the first word in a part of the syntax tree; return 0 if the part contains no word."""
    return min((word.at for word in words(tree)), default=0)

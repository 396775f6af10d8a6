"""Conversion of the behaviours in a Turtle file to SPARQL updates or to individuals.

The file is split into statements. Only the statements about behaviours and their parts are replaced. If the other form can't
express a behaviour, the behaviour remains unchanged, and the reason is reported.
"""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import pyoxigraph as ox

from confab.reasoner.closure import closure
from confab.reasoner.graph.knowledge import SCENE, KnowledgeError, KnowledgeGraph, load, readable, scene_file, text
from confab.reasoner.language import substituted
from confab.reasoner.names import local_name
from confab.reasoner.reading.frame import as_written
from confab.reasoner.reading.rows import OntologySchema
from confab.reasoner.reading.schema import read_schema
from confab.reasoner.symbols import AnyOf, Behavior, Condition, Span, Witness
from confab.reasoner.updates.compiling import compiled
from confab.reasoner.updates.writing import Situations, update
from confab.reasoner.vocabulary import CORE, INDIVIDUAL, LABEL, SKOS, TYPE, XSD

TOKEN = re.compile(
    r'"""(?:[^"\\]|\\.|"(?!""))*"""|\'\'\'(?:[^\'\\]|\\.|\'(?!\'\'))*\'\'\'|"(?:[^"\\\n]|\\.)*"|\'(?:[^\'\\\n]|\\.)*\''
    r"|<[^<>\s]*>|#[^\n]*|(?P<end>\.(?=\s|#|$))|[^\"'<#.]+|.",
    re.DOTALL,
)
LINKS = tuple(CORE + name for name in ("parameter", "precondition", "postcondition"))
TEXT = (CORE + "update", CORE + "extends")
LOCAL = re.compile(r"[A-Za-z_]([\w.-]*[\w-])?")
Form = Literal["sparql", "individuals"]
Triples = Sequence[tuple[ox.NamedNode | ox.BlankNode, ox.NamedNode, ox.NamedNode | ox.BlankNode | ox.Literal]]


@dataclass(frozen=True)
class Converted:
    """Result of a conversion: the file's new text, the converted behaviours, and the reasons for unchanged behaviours."""

    text: str
    behaviors: Sequence[str]
    notes: Sequence[str]


@dataclass
class _Statement:
    """A statement of a Turtle file with its triples; prefix declarations and comments have no triples."""

    text: str
    triples: Triples = ()
    subject: str = ""


@dataclass
class _File:
    """A Turtle file as a list of statements, with the prefixes that abbreviate its IRIs."""

    statements: list[_Statement]
    prefixes: Mapping[str, str]
    said: dict[str, list[_Statement]] = field(default_factory=dict)

    def spell(self, iri: str) -> str:
        """Return an IRI as it is written in the file and its updates, abbreviated by a prefix if possible."""
        for prefix, namespace in sorted(self.prefixes.items(), key=lambda pair: -len(pair[1])):
            local = iri.removeprefix(namespace)
            if iri.startswith(namespace) and LOCAL.fullmatch(local):
                return f"{prefix}:{local}"
        return f"<{iri}>"

    def term(self, term: ox.NamedNode | ox.BlankNode | ox.Literal) -> str:
        if isinstance(term, ox.NamedNode):
            return self.spell(term.value)
        if not isinstance(term, ox.Literal):
            return str(term)
        if term.datatype.value in (XSD + "integer", XSD + "boolean", XSD + "decimal"):
            return term.value
        if "\n" in term.value:
            quoted = term.value.replace("\\", "\\\\").replace('"""', '\\"\\"\\"')
            return f'"""{quoted}"""' + (f"@{term.language}" if term.language else "")
        if term.datatype.value.startswith(XSD) and term.datatype.value != XSD + "string":
            return f"{ox.Literal(term.value)}^^{self.spell(term.datatype.value)}"
        return str(term)

    def statement(self, subject: str, triples: Triples) -> str:
        """Return triples with a common subject as one Turtle statement."""
        said: dict[str, list[str]] = {}
        for _, predicate, value in triples:
            name = "a" if predicate.value == TYPE else self.spell(predicate.value)
            said.setdefault(name, []).append(self.term(value))
        parts = [f"{name} {', '.join(dict.fromkeys(values))}" for name, values in said.items()]
        return f"{self.spell(subject)} " + " ; ".join(parts) + " ."


def convert(path: Path, form: Form) -> Converted:
    """Return a Turtle file with all of its behaviours in the given form.

    Parameters
    ----------
    path : Path
    form : str
        The form: ``sparql`` for SPARQL updates, or ``individuals`` for conditions and effects that are individuals.

    Raises
    ------
    KnowledgeError
        The file isn't Turtle, the file or an import can't be read, or an update in the file has a fault.
    """
    path = Path(os.path.realpath(path))
    if path.suffix != ".ttl":
        raise KnowledgeError(f"{path}: only Turtle files are converted; save it as Turtle (Protégé: File, Save as …)")
    graph = load(scene_file(path))
    file = _file(path)
    schema = read_schema(graph)
    typed = {iri for iri, said in file.said.items() if any(t[1].value == TYPE for s in said for t in s.triples)}
    own = [iri for iri in schema.of_kind("Behavior") if iri in typed]
    return _to_updates(file, graph, schema, own) if form == "sparql" else _to_individuals(file, graph, own)


def update_of(graph: KnowledgeGraph, schema: OntologySchema, iri: str) -> str:
    """Return a behaviour as a SPARQL update with the PREFIX declarations for its names.

    Raises
    ------
    ValueError
        The behaviour has parts that an update can't express.
    """
    (behavior,) = as_written(schema, [iri]).values()
    file = _File([], dict(sorted(graph.spoken.items(), key=lambda pair: pair[0] != "confab")))
    written = update(behavior, situations_of(schema), file.spell)
    used = {
        prefix: namespace
        for prefix, namespace in file.prefixes.items()
        if re.search(rf"(?<![\w:]){prefix}:\w", written)
    }
    return "".join(f"PREFIX {prefix}: <{namespace}>\n" for prefix, namespace in sorted(used.items())) + written


def _file(path: Path) -> _File:
    with readable(path) as (content, form):
        parser = ox.parse(content, format=form, base_iri=path.as_uri())
        list(parser)
        prefixes = dict(parser.prefixes)
    head = "".join(f"@prefix {prefix}: <{namespace}> .\n" for prefix, namespace in prefixes.items())
    file = _File([], prefixes)
    piece = ""
    for token in TOKEN.finditer(content.decode()):
        piece += token.group()
        if token.lastgroup == "end":
            file.statements.append(_Statement(piece))
            piece = ""
    for statement in file.statements:
        quads = list(ox.parse(head + statement.text, format=form, base_iri=path.as_uri()))
        subjects = {quad.subject.value for quad in quads if isinstance(quad.subject, ox.NamedNode)}
        if len(subjects) == 1 and all(isinstance(quad.subject, ox.NamedNode) for quad in quads):
            statement.triples = [(q.subject, q.predicate, q.object) for q in quads]
            statement.subject = subjects.pop()
            file.said.setdefault(statement.subject, []).append(statement)
    file.statements.append(_Statement(piece))
    return file


def _to_updates(file: _File, graph: KnowledgeGraph, schema: OntologySchema, own: Sequence[str]) -> Converted:
    situations = situations_of(schema)
    done, notes, kept = [], [], set[str]()
    gone: set[str] = set()
    for iri in own:
        node = schema.nodes[iri]
        if any(name in node for name in TEXT) or not any(name in node for name in LINKS):
            continue
        parts = _parts(iri, schema)
        try:
            (behavior,) = as_written(schema, [iri]).values()
            labels = [_label(graph, condition) for condition in schema.nodes[iri].get(CORE + "precondition", ())]
            written = update(behavior, situations, file.spell, labels)
            why = _why_not(iri, parts, file, schema) or _differs(graph, iri, behavior, written, file.prefixes)
        except ValueError as error:
            why = str(error)
        if why:
            notes.append(f"{local_name(iri)} is unchanged: {why}")
            kept |= parts
            continue
        done.append(iri)
        gone |= parts
        _exchange(file, iri, [(CORE + "update", ox.Literal("\n" + written))], [])
    for part in sorted(gone - kept):
        for statement in file.said.get(part, ()):
            rest = [t for t in statement.triples if not _replaced(t, _is_term(part, schema))]
            lead = _lead(statement.text)
            statement.text = lead + file.statement(part, rest) if rest else lead.rstrip(" ") if "#" in lead else ""
    return Converted(_joined(file), done, notes)


def _to_individuals(file: _File, graph: KnowledgeGraph, own: Sequence[str]) -> Converted:
    done = []
    for iri in own:
        stated = [t for s in file.said[iri] for t in s.triples]
        if not any(predicate.value in TEXT for _, predicate, _ in stated):
            continue
        links: list[tuple[str, ox.NamedNode | ox.Literal]] = []
        nodes: dict[str, list[tuple[ox.NamedNode, ox.NamedNode, ox.NamedNode | ox.Literal]]] = {}
        for node in [iri, *(node for node in graph.written if node.startswith(f"{iri}.") and node not in file.said)]:
            for quad in graph.store.quads_for_pattern(ox.NamedNode(node), None, None, None):
                subject, predicate, value = quad.subject, quad.predicate, quad.object
                if node != iri:
                    nodes.setdefault(node, []).append((subject, predicate, value))  # type: ignore[arg-type]
                elif predicate.value in LINKS and (subject, predicate, value) not in stated:
                    links.append((predicate.value, value))  # type: ignore[arg-type]
        links.sort(key=lambda link: (LINKS.index(link[0]), str(link[1])))
        order = (TYPE, CORE + "index", CORE + "termType", CORE + "negated")
        for said in nodes.values():
            said.sort(
                key=lambda t: (order.index(t[1].value) if t[1].value in order else len(order), t[1].value, str(t[2]))
            )
            said.sort(key=lambda t: t[1].value == TYPE and t[2].value != INDIVIDUAL)
            said.sort(key=lambda t: t[1].value != TYPE)
        made = [file.statement(node, said) for node, said in nodes.items()]
        _exchange(file, iri, links, made)
        done.append(iri)
    return Converted(_joined(file), done, [])


def _exchange(
    file: _File, iri: str, links: Sequence[tuple[str, ox.NamedNode | ox.Literal]], behind: Sequence[str]
) -> None:
    """Replace a behaviour's conditions and effects by the properties in `links`, and append the statements `behind`."""
    node = ox.NamedNode(iri)
    for number, statement in enumerate(file.said[iri]):
        rest = [t for t in statement.triples if t[1].value not in (*LINKS, *TEXT)]
        if number == 0:
            rest += [(node, ox.NamedNode(name), value) for name, value in links]
        lead = _lead(statement.text)
        lines = [file.statement(iri, rest), *(behind if number == 0 else ())] if rest else []
        statement.text = lead + "\n".join(lines) if lines else ""


def _lead(statement: str) -> str:
    """Return the white space and comments at the beginning of a statement's text."""
    found = ""
    for token in (match.group() for match in TOKEN.finditer(statement)):
        if token.startswith("#"):
            found += token
        elif token.strip():
            return found + token[: len(token) - len(token.lstrip())]
        else:
            found += token
    return found


def _joined(file: _File) -> str:
    return re.sub(r"\n{3,}", "\n\n", "".join(statement.text for statement in file.statements)).rstrip() + "\n"


def _parts(iri: str, schema: OntologySchema) -> set[str]:
    """Return the terms, conditions and effects of a behaviour."""

    def parts(values: Iterable[str]) -> list[str]:
        return [v for v in values if v in schema.nodes and (_is_term(v, schema) or _is_said(v, schema))]

    def below(part: str) -> list[str]:
        return parts(v for name, values in schema.nodes[part].items() if name.startswith(CORE) for v in values)

    return closure(parts(part for name in LINKS for part in schema.nodes[iri].get(name, ())), below)


def _is_term(iri: str, schema: OntologySchema) -> bool:
    return bool({CORE + "Parameter", CORE + "Variable"} & set(schema.nodes[iri][TYPE]))


def _is_said(iri: str, schema: OntologySchema) -> bool:
    return any(
        kind.startswith(CORE) and kind.endswith(("Condition", "Effect", "Of", "Witness", "Comparison", "Calculation"))
        for kind in schema.nodes[iri][TYPE]
    )


def _why_not(iri: str, parts: Iterable[str], file: _File, schema: OntologySchema) -> str:
    """Return the reason why the statements of a behaviour's parts can't be replaced; an empty text if replacement is possible."""
    for part in sorted(parts):
        if part not in file.said:
            return f"{local_name(part)} isn't stated in this file"
        if _is_term(part, schema):
            if part.rpartition(".")[0] != iri:
                return f"its term {local_name(part)} isn't called {local_name(iri)}.…"
        elif any(not _replaced(t, False) for s in file.said[part] for t in s.triples):
            return f"{local_name(part)} has other statements, too"
    return ""


def _replaced(triple: tuple[object, ox.NamedNode, object], is_term: bool) -> bool:
    """Return whether a triple can be dropped, because it only labels a condition or because the other form expresses it."""
    predicate = triple[1].value
    return (
        predicate == TYPE or predicate.startswith(CORE) or (not is_term and predicate in (LABEL, SKOS + "definition"))
    )


def _differs(graph: KnowledgeGraph, iri: str, behavior: Behavior, written: str, prefixes: Mapping[str, str]) -> str:
    """Return the reason why an update isn't equivalent to the behaviour; an empty text for an equivalent update."""
    if behavior.price is not None:
        return "an update can't express a calculated price"
    if spans_of(behavior):
        return "an update can't express a condition or an effect at the start or the end"
    again = compiled_again(graph, iri, written, prefixes)
    if isinstance(again, str):
        return again
    return "" if plainly(again) == plainly(behavior) else "its update would have another meaning"


def compiled_again(graph: KnowledgeGraph, iri: str, written: str, prefixes: Mapping[str, str]) -> Behavior | str:
    """Return the behaviour that the compilation of an update in the graph yields, or the reason why the compilation fails."""

    def ask(query: str) -> Sequence[Sequence[object]]:
        if "?text" in query:
            return []
        if "VALUES ?property" in query:
            return [(ox.NamedNode(iri), ox.NamedNode(CORE + "update"), ox.Literal(written))]
        return graph.select(query, SCENE)

    found = compiled(ask, {iri: prefixes}, graph.prefixes)
    if found.faults:
        return f"{found.faults[0].what} ({found.faults[0].place})"
    nodes: dict[str, dict[str, list[str]]] = {}
    for triple in found.triples:
        nodes.setdefault(text(triple.subject), {}).setdefault(triple.predicate.value, []).append(text(triple.object))  # type: ignore[arg-type]
    schema = read_schema(graph)
    nodes[iri] = {**{k: list(v) for k, v in schema.nodes[iri].items() if k not in LINKS}, **nodes[iri]}

    def mentioned(node: str) -> list[str]:
        return [v for values in schema.nodes[node].values() for v in values if v in schema.nodes]

    # updates can't express prices, so the calculation is kept
    priced = closure(schema.nodes[iri].get(CORE + "price", ()), mentioned)
    others = {
        node: said
        for node, said in schema.nodes.items()
        if node in priced - {iri} or (not node.startswith(f"{iri}.") and node != iri)
    }
    return as_written(replace(schema, nodes={**others, **nodes}), [iri])[iri]


def situations_of(schema: OntologySchema) -> Situations:
    """Return the value properties and the many-valued situation types of a schema."""
    properties = {
        iri: prop
        for iri in schema.of_kind("SituationType")
        for prop in schema.nodes[iri].get(CORE + "valueProperty", ())
    }
    return Situations(properties, schema.pairs)


def plainly(behavior: Behavior) -> object:
    """Return a canonical form of a behaviour.

    Behaviours have equal forms if they differ only in the names of bound variables and in the order of their parts.
    """
    effects = ((e.situation, e.arguments, e.value, _plain(e.when), e.each) for e in behavior.effects)
    return (
        behavior.name,
        behavior.level,
        behavior.parameters,
        frozenset(behavior.variables),
        behavior.cost,
        behavior.price,
        _plain(behavior.asked),
        frozenset(effects),
        frozenset(
            Counter(
                (e.situation, e.arguments, e.operation, e.amount, _plain(e.when), e.each) for e in behavior.amounts
            ).items()
        ),
        behavior.timing and (behavior.timing.duration, behavior.timing.actors, spans_of(behavior)),
    )


def spans_of(behavior: Behavior) -> frozenset[object]:
    """Return the conditions and effects that concern only the start or only the end of a behaviour, each with its span."""
    if behavior.timing is None:
        return frozenset()
    asked = ((span, _plain([c])) for span, c in behavior.timing.conditions if span is not Span.THROUGHOUT)
    return frozenset((*asked, *(one for one in behavior.timing.effects if one[0] is not Span.THROUGHOUT)))


def _plain(conditions: Iterable[Condition], depth: int = 0) -> frozenset[object]:
    """Return a canonical form of a conjunction, in which bound variables are numbered and trivial disjunctions are resolved."""
    found: set[object] = set()
    for condition in conditions:
        match condition:
            case Witness(variable, kind, inner, negated):
                bound = [substituted(c, {variable: f"?bound{depth}"}) for c in inner]
                found.add(("some", kind, _plain(bound, depth + 1), negated))
            case AnyOf((group,), False):
                found |= _plain(group, depth)
            case AnyOf(((one,),), True):
                found |= _plain([replace(one, negated=not one.negated)], depth)
            case AnyOf(alternatives, negated):
                found.add(("any", frozenset(_plain(group, depth) for group in alternatives), negated))
            case _:
                found.add(condition)
    return frozenset(found)


def _label(graph: KnowledgeGraph, node: str) -> str:
    quads = graph.store.quads_for_pattern(ox.NamedNode(node), ox.NamedNode(LABEL), None, None)
    found = [quad.object for quad in quads if isinstance(quad.object, ox.Literal)]
    return min(found, key=lambda label: (label.language != "en", label.value)).value if found else ""

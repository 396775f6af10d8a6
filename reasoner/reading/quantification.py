"""Quantification: a behaviour with free variables becomes a SPARQL query, and its rows the quantified behaviours.

The query has one sub-select per parameter, which yields the individuals of its type in declared order; together they yield
every assignment in the order that numbers them (PAPER.md section 4): behaviours in declared order, then parameters in theirs,
then individuals in theirs. Whether a quantified behaviour can be done here is not asked: M counts them all.

`quantify` reads the rows one by one, which suits a table. A planner that grounds wants fewer behaviours, those whose static
conditions hold (`feasible`), and faster. Two ways lead to the same arrays:

==============  ====================================================================================================
`by_query`      the query's rows as CSV, by Arrow into a dictionary and its indices: for any store
`by_join`       products and joins of the classes and relations that were read once: for a scene that was read anyway
==============  ====================================================================================================
"""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import prod
from typing import TypeAlias

import numpy as np
import pyoxigraph as ox
from numpy.typing import NDArray

from reasoner.graph.knowledge import SCENE, KnowledgeError, KnowledgeGraph, text
from reasoner.names import nearest
from reasoner.reading.problem import Reading
from reasoner.symbols import (
    Behavior,
    ClassCondition,
    Condition,
    GroundBehavior,
    Parameter,
    Problem,
    RelationCondition,
    Witness,
)

Ints = NDArray[np.int64]
Columns = dict[str, Ints]
"""A table: a column of individuals' numbers for each term."""


@dataclass(frozen=True)
class Some:
    """Some individuals fulfil all parts; `terms` are the parts' other variables."""

    terms: tuple[str, ...]
    parts: tuple[Static, ...]


Static: TypeAlias = "RelationCondition | ClassCondition | Some"


@dataclass(frozen=True)
class Quantified:
    """The quantified behaviours of one behaviour, in the order of their IDs.

    Attributes
    ----------
    behavior : str
    ids : array of int, shape (rows,)
    arguments : array of int, shape (rows, parameters)
        Positions in `individuals`.
    individuals : tuple of str
    """

    behavior: str
    ids: Ints
    arguments: Ints
    individuals: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.ids)

    def __iter__(self) -> Iterator[GroundBehavior]:
        """Yield the rows as values."""
        for number, row in zip(self.ids.tolist(), self.arguments.tolist(), strict=True):
            yield GroundBehavior(number, self.behavior, tuple(self.individuals[i] for i in row))


def quantify(graph: KnowledgeGraph, reading: Reading, level: int) -> tuple[GroundBehavior, ...]:
    """Return the quantified behaviours of a level with their IDs, from the graph by SPARQL.

    Examples
    --------
    >>> from reasoner.graph.knowledge import load
    >>> from reasoner.reading.problem import read
    >>> graph = load("beverage-serving")
    >>> for ground in quantify(graph, read(graph), 2)[:3]:
    ...     print(ground)
    0 B2_PICK left_hand bottle1
    1 B2_PICK left_hand bottle2
    2 B2_PICK left_hand cup1
    """
    domain = reading.problem.domain
    found: list[GroundBehavior] = []
    number = domain.first_ids.get(level, 0)
    for behavior in domain.at_level(level):
        for row in graph.select(query_for(reading, behavior), SCENE):
            arguments = tuple(reading.names.short(text(term)) for term in row[: len(behavior.parameters)])
            found.append(GroundBehavior(number + len(found), behavior.name, arguments))
    return tuple(found)


def behavior_named(reading: Reading, name: str) -> Behavior:
    """Return a behaviour by its name; the error of an unknown one has the nearest known name."""
    behaviors = reading.problem.domain.behaviors
    if name not in behaviors:
        raise KnowledgeError(f"unknown behaviour '{name}'{nearest(name, behaviors)} (known: {', '.join(behaviors)})")
    return behaviors[name]


# ------------------------------------------------------------------------------------------------------------ as a query


def query_for(reading: Reading, behavior: Behavior, *, feasible: bool = False, ordered: bool = True) -> str:
    """Return the SPARQL 1.1 query that quantifies a behaviour: one column per parameter, one row per assignment.

    Parameters
    ----------
    reading : Reading
        If it isn't of the whole scene, its individuals are the only ones that are asked for.
    behavior : Behavior
    feasible : bool
        Only those whose static conditions hold. A parameter whose type a relation implies then needs no pattern for it.
    ordered : bool
        Whether the rows come in the order of their IDs.

    Raises
    ------
    KnowledgeError
        The type of a parameter has no IRI, as the union of several classes hasn't.
    """
    conditions = static_conditions(behavior) if feasible else []
    implied = _implied(reading, {parameter.name: parameter.kind for parameter in behavior.parameters}, conditions)
    names = [parameter.name for parameter in behavior.parameters]
    ranked = [parameter for parameter in behavior.parameters if ordered or parameter.name not in implied]
    selects = [_select(reading, parameter, ordered) for parameter in ranked]
    patterns = [line for condition in conditions for line in _pattern(reading, condition, "  ")]
    order = " ".join(f"{name}_index STR({name})" for name in names) if ordered else ""
    return "\n".join(
        [
            f"# {behavior.name}({', '.join(f'{p.name[1:]}: {p.kind}' for p in behavior.parameters)}), "
            f"level {behavior.level}" + ", where its static conditions hold" * feasible,
            f"SELECT {' '.join(names) or '(1 AS ?once)'} WHERE {{",
            *patterns,
            *selects,
            "}" + (f" ORDER BY {order}" if order else ""),
        ]
    )


def _select(reading: Reading, parameter: Parameter, ordered: bool) -> str:
    """Return the sub-select that yields the individuals of a parameter's type."""
    name = parameter.name
    typed = _typed(reading, name, parameter.kind)
    if not ordered:
        return f"  {{ SELECT DISTINCT {name} WHERE {{ {typed} }} }}"
    return (
        f"  {{ SELECT DISTINCT {name} {name}_index WHERE {{\n"
        f"      {typed}\n"
        f"      OPTIONAL {{ {name} :index {name}_declared }}\n"
        f"      BIND(COALESCE({name}_declared, 1000000000) AS {name}_index) }} }}"
    )


def _typed(reading: Reading, term: str, kind: str) -> str:
    """Return the pattern that a term is of a class; in a slice, that it is one of the individuals of the slice."""
    if not reading.whole:
        members = (reading.names.iri(member) for member in reading.problem.classes.get(kind, ()))
        return f"VALUES {term} {{ {' '.join(str(ox.NamedNode(iri)) for iri in members)} }}"
    if kind not in reading.names:
        raise KnowledgeError(
            f"the type {kind} of {term} isn't in the ontology; the union of several classes has no query"
        )
    return f"{term} a owl:NamedIndividual ; a/rdfs:subClassOf* <{reading.names.iri(kind)}> ."


def static_conditions(behavior: Behavior) -> list[Static]:
    """Return the conditions that no state changes and that every quantified behaviour that can be done fulfils.

    Only parameters are left in them: a variable stands for some individual, each witness's for one of its own. Variables are
    eliminated one by one, that first which leaves the fewest others, so that no row is made of what nobody asks for.
    """
    parameters = {parameter.name for parameter in behavior.parameters}
    kinds = {variable.name: variable.kind for variable in behavior.variables}
    found: list[Static] = []
    waiting: list[tuple[Condition, Mapping[str, str]]] = [(condition, {}) for condition in behavior.preconditions]
    while waiting:
        condition, renamed = waiting.pop(0)
        if isinstance(condition, Witness) and not condition.negated:
            own = f"{condition.variable}_{len(kinds)}"
            kinds[own] = condition.kind
            waiting += [(inner, {**renamed, condition.variable: own}) for inner in condition.conditions]
        elif isinstance(condition, RelationCondition) and not condition.negated:
            arguments = tuple(renamed.get(term, term) for term in condition.arguments)
            found.append(RelationCondition(condition.relation, arguments))
        elif isinstance(condition, ClassCondition) and not condition.negated and condition.term in parameters:
            found.append(condition)
    others = set().union(*map(_variables, found)) - parameters
    found += [ClassCondition(name, kinds[name]) for name in sorted(others)]
    while others:
        groups = {name: [part for part in found if name in _variables(part)] for name in others}
        left = {name: tuple(sorted(set().union(*map(_variables, group)) - {name})) for name, group in groups.items()}
        name = min(others, key=lambda name: (len(left[name]), name))
        found = [part for part in found if part not in groups[name]] + [Some(left[name], tuple(groups[name]))]
        others.remove(name)
    return found


def _implied(reading: Reading, kinds: Mapping[str, str], conditions: Iterable[Static]) -> set[str]:
    """Return the terms whose type follows from a static condition, by what the relation holds between.

    None in a slice of a scene, since there the relation may hold between others, too.
    """
    found = set[str]()
    for condition in conditions if reading.whole else ():
        if isinstance(condition, Some):
            found |= _implied(reading, kinds, condition.parts)
        elif isinstance(condition, RelationCondition):
            tuples = reading.problem.relations.get(condition.relation, frozenset())
            for position, term in enumerate(condition.arguments):
                members = set(reading.problem.classes.get(kinds.get(term, ""), ()))
                if {row[position] for row in tuples if len(row) > position} <= members:
                    found.add(term)
    return found


def _pattern(reading: Reading, condition: Static, indent: str) -> Iterator[str]:
    """Yield the graph pattern of a static condition, line by line."""
    names = reading.names

    def term(name: str) -> str:
        return name if name.startswith("?") else f"<{names.iri(name)}>"

    if isinstance(condition, Some):
        select = f"SELECT DISTINCT {' '.join(condition.terms)} WHERE {{"
        yield f"{indent}{{ {select}" if condition.terms else f"{indent}FILTER EXISTS {{ {{"
        kinds = {part.term: part.kind for part in condition.parts if isinstance(part, ClassCondition)}
        implied = _implied(reading, kinds, condition.parts)
        for part in condition.parts:
            if not (isinstance(part, ClassCondition) and part.term in implied):
                yield from _pattern(reading, part, indent + "  ")
        yield f"{indent}}} }}"
        return
    if isinstance(condition, ClassCondition):
        yield indent + _typed(reading, condition.term, condition.kind)
        return
    relation, terms = f"<{names.iri(condition.relation)}>", [term(name) for name in condition.arguments]
    node = f"[] a :SituatedObjectInstance ; :relation {relation}"
    for position, name in enumerate(terms, start=1):
        own = ":about" if position == 1 else f":argument{position}"
        last = position == len(terms) and position > 1
        node += f" ; {f'({own}|:value)' if last else own} {name}"
    if len(terms) == 2:
        yield f"{indent}{{ {terms[0]} {relation} {terms[1]} }} UNION {{ {node} }}"
    else:
        yield f"{indent}{node} ."


def _variables(condition: Static) -> set[str]:
    if isinstance(condition, Some):
        return set(condition.terms)
    terms = condition.arguments if isinstance(condition, RelationCondition) else (condition.term,)
    return {term for term in terms if term.startswith("?")}


def by_query(graph: KnowledgeGraph, reading: Reading, behavior: Behavior, *, feasible: bool = False) -> Quantified:
    """Return the quantified behaviours of one behaviour by SPARQL.

    The rows come in no order, as CSV; Arrow turns each column into a dictionary with an index per row, if it is installed.

    Raises
    ------
    KnowledgeError
        As `query_for`.
    """
    answer = graph.query(query_for(reading, behavior, feasible=feasible, ordered=False), SCENE)
    individuals, number = _numbering(reading.problem)
    columns = _columns(answer, reading, number) if isinstance(answer, ox.QuerySolutions) else []
    if not behavior.parameters:
        return _numbered(reading.problem, behavior, np.empty((1, 0), np.int64), individuals)
    return _numbered(reading.problem, behavior, np.column_stack(columns), individuals)


def _columns(answer: ox.QuerySolutions, reading: Reading, number: Mapping[str, int]) -> list[Ints]:
    """Return the columns of a query's answer as numbers of individuals."""
    variables = [variable.value for variable in answer.variables]

    def numbers(iris: Iterable[str]) -> Ints:
        return np.array([number[reading.names.short(iri)] for iri in iris], np.int64)

    try:
        from pyarrow import csv, dictionary, int32, string
    except ImportError:
        rows = [tuple(map(text, tuple(row))) for row in answer]
        return [numbers(row[i] for row in rows) for i in range(len(variables))]
    data = answer.serialize(format=ox.QueryResultsFormat.CSV) or b""
    options = csv.ConvertOptions(column_types={name: dictionary(int32(), string()) for name in variables})
    table = csv.read_csv(io.BytesIO(data), convert_options=options).unify_dictionaries().combine_chunks()
    found = []
    for name in variables:
        column = table.column(name)
        if not column.num_chunks:
            found.append(np.empty(0, np.int64))
            continue
        chunk = column.chunk(0)
        found.append(numbers(chunk.dictionary.to_pylist())[chunk.indices.to_numpy()])
    return found


# ------------------------------------------------------------------------------------------------------------- as a join


def by_join(problem: Problem, behavior: Behavior, *, feasible: bool = False) -> Quantified:
    """Return the quantified behaviours of one behaviour by products and joins of what was read.

    Examples
    --------
    >>> from reasoner.graph.knowledge import load
    >>> from reasoner.reading.problem import read
    >>> problem = read(load("beverage-serving")).problem
    >>> place = problem.domain.behaviors["B2_PLACE"]
    >>> len(by_join(problem, place)), len(by_join(problem, place, feasible=True)) == len(problem.relations["canReach"])
    (16, True)
    """
    individuals, number = _numbering(problem)
    members = {
        p.name: np.array([number[name] for name in problem.classes.get(p.kind, ())], np.int64)
        for p in behavior.parameters
    }
    if feasible:
        parts = [_table(problem, condition, number) for condition in static_conditions(behavior)]
        parts += [({name: column}, len(column)) for name, column in members.items()]
        table, size = _join_all(parts, len(individuals))
        rows = np.column_stack([table[name] for name in members]) if members else np.empty((min(size, 1), 0), np.int64)
        return _numbered(problem, behavior, rows, individuals)
    rows = np.empty((prod(map(len, members.values())), len(members)), np.int64)
    repeats, times = len(rows), 1
    for place, column in enumerate(members.values()):
        repeats //= max(len(column), 1)
        rows[:, place] = np.tile(np.repeat(column, repeats), times)
        times *= len(column)
    first = _first_id(problem, behavior)
    return Quantified(behavior.name, np.arange(first, first + len(rows)), rows, individuals)


def _table(problem: Problem, condition: Static, number: Mapping[str, int]) -> tuple[Columns, int]:
    """Return what a static condition allows: a column per variable in it, and the number of rows."""
    if isinstance(condition, Some):
        table, size = _join_all([_table(problem, part, number) for part in condition.parts], len(number))
        if not condition.terms:
            return {}, min(size, 1)
        rows = np.unique(np.column_stack([table[term] for term in condition.terms]), axis=0)
        return {term: rows[:, i] for i, term in enumerate(condition.terms)}, len(rows)
    if isinstance(condition, ClassCondition):
        column = np.array([number[name] for name in problem.classes.get(condition.kind, ())], np.int64)
        return {condition.term: column}, len(column)
    terms = condition.arguments
    fitting = [
        [number[name] for name in row]
        for row in problem.relations.get(condition.relation, ())
        if len(row) == len(terms)
        and len({*zip(terms, row, strict=True)}) == len(set(terms))
        and all(term == name for term, name in zip(terms, row, strict=True) if not term.startswith("?"))
    ]
    rows = np.array(fitting, np.int64).reshape(len(fitting), len(terms))
    columns = {term: rows[:, i] for i, term in enumerate(terms) if term.startswith("?")}
    return columns, len(rows) if columns else min(len(rows), 1)


def _join_all(parts: Sequence[tuple[Columns, int]], radix: int) -> tuple[Columns, int]:
    """Return the natural join of some tables, those that share a term with what was joined before first."""
    waiting = sorted(parts, key=lambda part: part[1])
    table, size = waiting.pop(0) if waiting else ({}, 1)
    while waiting:
        at = next((i for i, (other, _) in enumerate(waiting) if other.keys() & table.keys()), 0)
        table, size = _join(table, size, *waiting.pop(at), radix)
    return table, size


def _join(left: Columns, size: int, right: Columns, rows: int, radix: int) -> tuple[Columns, int]:
    """Return the natural join of two tables with their numbers of rows, and its own."""
    shared = sorted(left.keys() & right.keys())
    if not shared:
        mine, theirs = np.repeat(np.arange(size), rows), np.tile(np.arange(rows), size)
    else:
        wanted, keys = (sum(table[name] * radix**i for i, name in enumerate(shared)) for table in (left, right))
        order = np.argsort(keys, kind="stable")
        low = np.searchsorted(keys, wanted, "left", sorter=order)
        counts = np.searchsorted(keys, wanted, "right", sorter=order) - low
        mine = np.repeat(np.arange(size), counts)
        within = np.arange(len(mine)) - np.repeat(np.cumsum(counts) - counts, counts)
        theirs = order[np.repeat(low, counts) + within]
    joined = {name: column[mine] for name, column in left.items()}
    joined |= {name: column[theirs] for name, column in right.items() if name not in joined}
    return joined, len(mine)


# ------------------------------------------------------------------------------------------------------------- numbering


def _numbering(problem: Problem) -> tuple[tuple[str, ...], dict[str, int]]:
    """Return all individuals, and the number of each."""
    individuals = tuple(dict.fromkeys(name for members in problem.classes.values() for name in members))
    return individuals, {name: i for i, name in enumerate(individuals)}


def _numbered(problem: Problem, behavior: Behavior, rows: Ints, individuals: tuple[str, ...]) -> Quantified:
    """Return rows with their IDs, in the order of these: mixed-radix numbers of the individuals' places in their classes."""
    ids = np.full(len(rows), _first_id(problem, behavior), np.int64)
    number = {name: i for i, name in enumerate(individuals)}
    step = 1
    for column, parameter in reversed(list(enumerate(behavior.parameters))):
        members = problem.classes.get(parameter.kind, ())
        place = np.zeros(len(individuals), np.int64)
        place[[number[name] for name in members]] = np.arange(len(members))
        ids += place[rows[:, column]] * step
        step *= len(members)
    if len(ids) > 1 and not (np.diff(ids) > 0).all():
        order = np.argsort(ids, kind="stable")
        ids, rows = ids[order], rows[order]
    return Quantified(behavior.name, ids, rows, individuals)


def _first_id(problem: Problem, behavior: Behavior) -> int:
    """Return the ID at which the numbers of a behaviour begin."""
    first = problem.domain.first_ids.get(behavior.level, 0)
    for other in problem.domain.at_level(behavior.level):
        if other.name == behavior.name:
            break
        first += prod(len(problem.classes.get(parameter.kind, ())) for parameter in other.parameters)
    return first

"""The rows of a query as a table for terminals and notebooks."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, SupportsIndex, TypeAlias, overload

from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.names import nearest, right_names

if TYPE_CHECKING:
    import pandas
    from pyoxigraph import BlankNode, Literal, NamedNode, Triple
    from rich.table import Table as RichTable

Term: TypeAlias = "NamedNode | BlankNode | Literal | Triple"
"""An RDF term in a query result of the store."""
STANDARD = {"sparql-json": "JSON", "sparql-xml": "XML", "tsv": "TSV", "sparql-csv": "CSV"}
"""Result formats of the SPARQL 1.1 recommendations, each with its format name in pyoxigraph."""


class Row(tuple[str | None, ...]):
    """A row of a table: a tuple whose cells can also be selected by column names."""

    _fields: tuple[str, ...]

    def __new__(cls, cells: Iterable[str | None], names: tuple[str, ...]) -> Row:
        """Create a row from its cells and the names of its columns."""
        made = super().__new__(cls, cells)
        made._fields = names
        return made

    def __getnewargs__(self) -> tuple[tuple[str | None, ...], tuple[str, ...]]:
        """Return the arguments of `__new__` for copying and pickling."""
        return tuple(self), self._fields

    @overload
    def __getitem__(self, index: SupportsIndex | str) -> str | None: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[str | None, ...]: ...

    def __getitem__(self, index: SupportsIndex | str | slice) -> str | tuple[str | None, ...] | None:
        """Return the cell at a position, the cell of a column, or the cells of a slice."""
        return super().__getitem__(column(self._fields, index) if isinstance(index, str) else index)

    def __getattr__(self, name: str) -> str | None:
        """Return the cell of the column with a name, so that ``row.cup`` works as in rows of rdflib."""
        if name.startswith("_"):
            raise AttributeError(f"a row has no '{name}'")
        try:
            return self[name]
        except KeyError as error:
            raise AttributeError(error.args[0]) from error


def column(names: tuple[str, ...], name: str) -> int:
    """Return the position of a column; raise `KeyError` with the names of all columns if the name is unknown."""
    if name.lstrip("?") not in names:
        raise KeyError(f"no column '{name}'{nearest(name, names)} (columns: {', '.join(names)})")
    return names.index(name.lstrip("?"))


@right_names("a table")
@dataclass(frozen=True)
class Table(Sequence[tuple[str | None, ...]]):
    """A query result: a sequence of rows with named columns.

    `terms` are the same rows with the RDF terms of the store, which have IRIs and datatypes. `truth` is the answer to an ASK
    query, and None for other queries. `empty` is the text that represents a table without rows. In a condition, the table of an
    ASK query counts as its answer; any other table counts as true if it has a row.

    Examples
    --------
    >>> import confab
    >>> table = confab.load("beverage-serving").query("SELECT ?b ?level WHERE { ?b c:level ?level } ORDER BY ?level ?b")
    >>> table[0], table[0]["level"], table["b"][:2], table.values()[0]
    (('B1_MOVE', '1'), '1', ['B1_MOVE', 'B1_POUR'], ('B1_MOVE', 1))
    >>> table.iris()[0][0]
    'https://w3id.org/confab/tabletop#B1_MOVE'
    """

    columns: tuple[str, ...]
    rows: tuple[tuple[str | None, ...], ...]
    terms: tuple[tuple[Term | None, ...], ...] = ()
    truth: bool | None = None
    empty: str = ""

    @overload
    def __getitem__(self, index: int) -> Row: ...
    @overload
    def __getitem__(self, index: str) -> list[str | None]: ...
    @overload
    def __getitem__(self, index: slice) -> list[Row]: ...

    def __getitem__(self, index: int | str | slice) -> Row | list[str | None] | list[Row]:
        """Return the row at an index, the rows of a slice, or the cells of a column."""
        if isinstance(index, str):
            return [row[column(self.columns, index)] for row in self.rows]
        if isinstance(index, slice):
            return [Row(row, self.columns) for row in self.rows[index]]
        return Row(self.rows[index], self.columns)

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.rows)

    def __bool__(self) -> bool:
        """Return the answer to an ASK query; for other queries, return whether the table has a row."""
        return bool(self.rows) if self.truth is None else self.truth

    def __iter__(self) -> Iterator[Row]:
        """Yield the rows."""
        return (Row(row, self.columns) for row in self.rows)

    def values(self) -> list[tuple[object, ...]]:
        """Return the rows with Python values for numbers, booleans and dates."""
        return [tuple(map(_value, row, terms)) for row, terms in zip(self.rows, self.terms or self.rows, strict=True)]

    def iris(self) -> Table:
        """Return the table with full IRIs instead of short names."""
        rows = tuple(tuple(None if t is None else str(getattr(t, "value", t)) for t in terms) for terms in self.terms)
        return replace(self, rows=rows) if self.terms else self

    def dataframe(self) -> pandas.DataFrame:
        """Return the rows as a pandas DataFrame with typed columns. The extra `notebook` installs pandas."""
        import pandas

        return pandas.DataFrame(self.values(), columns=list(self.columns)).convert_dtypes()

    def csv(self) -> str:
        """Return the rows as CSV with a header line."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(self.columns)
        writer.writerows(self.rows)
        return text.getvalue()

    def tsv(self) -> str:
        r"""Return the rows as tab-separated values, with a header line; tabs, line ends and backslashes in cells are escaped.

        >>> Table(("what", "where"), (("cup 1", "a\tb"),)).tsv()
        'what\twhere\ncup 1\ta\\tb\n'
        """
        escaped = str.maketrans({"\t": "\\t", "\n": "\\n", "\r": "\\r", "\\": "\\\\"})
        lines = [self.columns, *self.rows]
        return "".join("\t".join((cell or "").translate(escaped) for cell in line) + "\n" for line in lines)

    def records(self) -> list[dict[str, str | None]]:
        """Return a mapping of column names to cells for each row."""
        return [dict(zip(self.columns, row, strict=True)) for row in self.rows]

    def standard(self, form: str) -> bytes:
        """Return the query result in the SPARQL 1.1 format ``sparql-json``, ``sparql-xml``, ``sparql-csv`` or ``tsv``."""
        from pyoxigraph import QueryResultsFormat, QuerySolutions, Store, parse_query_results

        if form not in STANDARD:
            raise KnowledgeError(f"unknown form '{form}'; wanted {', '.join(STANDARD)}")
        chosen = getattr(QueryResultsFormat, STANDARD[form])
        if self.truth is not None:
            asked = Store().query("ASK {}" if self.truth else "ASK { FILTER(false) }")
            return asked.serialize(format=chosen) or b""
        lines = ["\t".join(f"?{name}" for name in self.columns)]
        lines += ["\t".join("" if t is None else str(t).replace("\t", "\\t") for t in row) for row in self.terms]
        found = parse_query_results("\n".join(lines) + "\n", format=QueryResultsFormat.TSV)
        assert isinstance(found, QuerySolutions)
        return found.serialize(format=chosen) or b""

    def turtle(self, prefixes: dict[str, str] | None = None) -> str:
        """Return the triples of a CONSTRUCT query as Turtle.

        Raises
        ------
        KnowledgeError
            The query isn't a CONSTRUCT query.
        """
        import pyoxigraph as ox

        if self.columns != ("subject", "predicate", "object") or not all(len(row) == 3 for row in self.terms):
            raise KnowledgeError("Turtle holds triples; wanted a CONSTRUCT query")
        triples = sorted({ox.Triple(*row) for row in self.terms}, key=str)  # type: ignore[arg-type]
        return (ox.serialize(triples, format=ox.RdfFormat.TURTLE, prefixes=prefixes) or b"").decode("utf-8")

    def __rich__(self) -> RichTable:
        """Return the table as a table of rich."""
        from rich.table import Table as RichTable

        table = RichTable()
        for at, name in enumerate(self.columns):
            words = any(" " in (row[at] or "") for row in self.rows)  # other columns have names, which aren't cut
            table.add_column(name, no_wrap=not words, overflow="fold")
        for row in self.rows:
            table.add_row(*("" if cell is None else cell for cell in row))
        return table

    def _repr_html_(self) -> str:
        from confab.page.markup import styled, tag
        from confab.page.pieces import table

        return styled(tag("p", self.empty) if self.empty and not self.rows else table(self.columns, self.rows))

    def __repr__(self) -> str:
        """Return the table as text."""
        if self.empty and not self.rows:
            return self.empty
        widths = [max(len(cell or "") for cell in column) for column in zip(self.columns, *self.rows, strict=True)]
        lines = [self.columns, *self.rows]
        return "\n".join(
            "  ".join((c or "").ljust(w) for c, w in zip(row, widths, strict=True)).rstrip() for row in lines
        )


def _value(cell: str | None, term: object) -> object:
    """Return a literal as a Python value if its datatype has a counterpart in Python, otherwise as text."""
    from pyoxigraph import Literal as Stored

    if not isinstance(term, Stored) or term.language is not None:
        return cell
    from decimal import Decimal

    from rdflib import Literal, URIRef

    value = Literal(term.value, datatype=URIRef(term.datatype.value)).value
    return cell if value is None else float(value) if isinstance(value, Decimal) else value

"""The rows of a query as a table for terminals and notebooks."""

from __future__ import annotations

import csv
import html
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
"""An RDF term as the store answers it."""
STANDARD = {"sparql-json": "JSON", "sparql-xml": "XML", "tsv": "TSV", "sparql-csv": "CSV"}
"""Forms of the SPARQL 1.1 recommendations, with pyoxigraph's names for them."""


class Row(tuple[str | None, ...]):
    """A row of a table: a tuple whose cells also have the names of their columns."""

    _fields: tuple[str, ...]

    def __new__(cls, cells: Iterable[str | None], names: tuple[str, ...]) -> Row:
        """Make a row of cells and their names."""
        made = super().__new__(cls, cells)
        made._fields = names
        return made

    def __getnewargs__(self) -> tuple[tuple[str | None, ...], tuple[str, ...]]:
        """Return the parts of a copy."""
        return tuple(self), self._fields

    @overload
    def __getitem__(self, index: SupportsIndex | str) -> str | None: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[str | None, ...]: ...

    def __getitem__(self, index: SupportsIndex | str | slice) -> str | tuple[str | None, ...] | None:
        """Return the cell of a position or of a column, or some cells."""
        return super().__getitem__(column(self._fields, index) if isinstance(index, str) else index)


def column(names: tuple[str, ...], name: str) -> int:
    """Return the position of a column; raise a `KeyError` that says which there are."""
    if name.lstrip("?") not in names:
        raise KeyError(f"no column '{name}'{nearest(name, names)} (columns: {', '.join(names)})")
    return names.index(name.lstrip("?"))


@right_names("a table")
@dataclass(frozen=True)
class Table(Sequence[tuple[str | None, ...]]):
    """Rows with named columns, for iteration, indexing, display and conversion into a DataFrame.

    `terms` are the rows as the store returned them, with IRIs and datatypes; `truth` is the answer of an ASK query and then also
    the truth value of the table.

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

    @overload
    def __getitem__(self, index: int) -> Row: ...
    @overload
    def __getitem__(self, index: str) -> list[str | None]: ...
    @overload
    def __getitem__(self, index: slice) -> list[Row]: ...

    def __getitem__(self, index: int | str | slice) -> Row | list[str | None] | list[Row]:
        """Return one row, some, or the cells of a column."""
        if isinstance(index, str):
            return [row[column(self.columns, index)] for row in self.rows]
        if isinstance(index, slice):
            return [Row(row, self.columns) for row in self.rows[index]]
        return Row(self.rows[index], self.columns)

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.rows)

    def __bool__(self) -> bool:
        """Return the truth of an ASK query; for other queries, whether there is a row."""
        return bool(self.rows) if self.truth is None else self.truth

    def __iter__(self) -> Iterator[Row]:
        """Yield the rows."""
        return (Row(row, self.columns) for row in self.rows)

    def values(self) -> list[tuple[object, ...]]:
        """Return the rows with numbers, truth values and dates as Python values."""
        return [tuple(map(_value, row, terms)) for row, terms in zip(self.rows, self.terms or self.rows, strict=True)]

    def iris(self) -> Table:
        """Return the table with whole IRIs in place of short names."""
        rows = tuple(tuple(None if t is None else str(getattr(t, "value", t)) for t in terms) for terms in self.terms)
        return replace(self, rows=rows) if self.terms else self

    def dataframe(self) -> pandas.DataFrame:
        """Return the rows as a pandas DataFrame with typed columns (pandas comes with the extra `notebook`)."""
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
        r"""Return the rows separated by tabs, with a header line; tabs, line ends and backslashes in cells are escaped.

        >>> Table(("what", "where"), (("cup 1", "a\tb"),)).tsv()
        'what\twhere\ncup 1\ta\\tb\n'
        """
        escaped = str.maketrans({"\t": "\\t", "\n": "\\n", "\r": "\\r", "\\": "\\\\"})
        lines = [self.columns, *self.rows]
        return "".join("\t".join((cell or "").translate(escaped) for cell in line) + "\n" for line in lines)

    def records(self) -> list[dict[str, str | None]]:
        """Return a mapping for each row."""
        return [dict(zip(self.columns, row, strict=True)) for row in self.rows]

    def standard(self, form: str) -> bytes:
        """Return the answer in a form of SPARQL 1.1: ``sparql-json``, ``sparql-xml``, ``sparql-csv`` or ``tsv``."""
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
            The query gave rows.
        """
        import pyoxigraph as ox

        if self.columns != ("subject", "predicate", "object") or not all(len(row) == 3 for row in self.terms):
            raise KnowledgeError("Turtle holds triples; wanted a CONSTRUCT query")
        triples = sorted({ox.Triple(*row) for row in self.terms}, key=str)  # type: ignore[arg-type]
        return (ox.serialize(triples, format=ox.RdfFormat.TURTLE, prefixes=prefixes) or b"").decode("utf-8")

    def __rich__(self) -> RichTable:
        """Return the table for rich."""
        from rich.table import Table as RichTable

        table = RichTable(*self.columns)
        for row in self.rows:
            table.add_row(*("" if cell is None else cell for cell in row))
        return table

    def _repr_html_(self) -> str:
        left = "style='text-align: left'"
        head = "".join(f"<th {left}>{html.escape(name)}</th>" for name in self.columns)
        body = "".join(
            "<tr>" + "".join(f"<td {left}>{html.escape(cell or '')}</td>" for cell in row) + "</tr>"
            for row in self.rows
        )
        return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"

    def __repr__(self) -> str:
        """Return the table as text."""
        widths = [max(len(cell or "") for cell in column) for column in zip(self.columns, *self.rows, strict=True)]
        lines = [self.columns, *self.rows]
        return "\n".join(
            "  ".join((c or "").ljust(w) for c, w in zip(row, widths, strict=True)).rstrip() for row in lines
        )


def _value(cell: str | None, term: object) -> object:
    """Return a literal as a Python value if its datatype has one, otherwise as its text."""
    from pyoxigraph import Literal as Stored

    if not isinstance(term, Stored) or term.language is not None:
        return cell
    from decimal import Decimal

    from rdflib import Literal, URIRef

    value = Literal(term.value, datatype=URIRef(term.datatype.value)).value
    return cell if value is None else float(value) if isinstance(value, Decimal) else value

"""Rows of a query as a table that shows well in a terminal and in a notebook."""

from __future__ import annotations

import csv
import html
import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas
    from rich.table import Table as RichTable


@dataclass(frozen=True)
class Table(Sequence[tuple[str | None, ...]]):
    """Rows with named columns; iterate over it, index it, show it, or turn it into a DataFrame."""

    columns: tuple[str, ...]
    rows: tuple[tuple[str | None, ...], ...]

    def __getitem__(self, index: int) -> tuple[str | None, ...]:  # type: ignore[override]
        """Return one row."""
        return self.rows[index]

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.rows)

    def __iter__(self) -> Iterator[tuple[str | None, ...]]:
        """Yield the rows."""
        return iter(self.rows)

    def dataframe(self) -> pandas.DataFrame:
        """Return the rows as a pandas DataFrame (pandas comes with the extra `notebook`)."""
        import pandas

        return pandas.DataFrame(list(self.rows), columns=list(self.columns))

    def csv(self) -> str:
        """Return the rows as CSV with a header line."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(self.columns)
        writer.writerows(self.rows)
        return text.getvalue()

    def records(self) -> list[dict[str, str | None]]:
        """Return the rows as one mapping each."""
        return [dict(zip(self.columns, row, strict=True)) for row in self.rows]

    def __rich__(self) -> RichTable:
        """Return the table for rich."""
        from rich.table import Table as RichTable

        table = RichTable(*self.columns)
        for row in self.rows:
            table.add_row(*("" if cell is None else cell for cell in row))
        return table

    def _repr_html_(self) -> str:
        head = "".join(f"<th>{html.escape(name)}</th>" for name in self.columns)
        body = "".join(
            "<tr>" + "".join(f"<td>{html.escape(cell or '')}</td>" for cell in row) + "</tr>" for row in self.rows
        )
        return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"

    def __repr__(self) -> str:
        """Return the table as text."""
        widths = [max(len(cell or "") for cell in column) for column in zip(self.columns, *self.rows, strict=True)]
        lines = [self.columns, *self.rows]
        return "\n".join(
            "  ".join((c or "").ljust(w) for c, w in zip(row, widths, strict=True)).rstrip() for row in lines
        )

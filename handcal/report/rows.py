"""Rows of numbers as CSV (RFC 4180, UTF-8)."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

_FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r")


def rows_csv(rows: Iterable[Mapping[str, Any]], columns: Sequence[str] | None = None) -> bytes:
    """Return rows as CSV; text that a spreadsheet would run as a formula gets an apostrophe.

    Parameters
    ----------
    rows : iterable of mapping
        Cells by column; missing ones and None stay empty.
    columns : sequence of str, optional
        Default: all, in order of first appearance.

    Raises
    ------
    ValueError
        If a row has a cell outside the columns.
    """
    rows = list(rows)
    names = columns or list(dict.fromkeys(name for row in rows for name in row))
    stream = io.StringIO(newline="")
    writer = csv.DictWriter(stream, names)
    writer.writeheader()
    for row in rows:
        writer.writerow({name: _cell(value) for name, value in row.items()})
    return stream.getvalue().encode(errors="replace")


def _cell(value: Any) -> Any:
    if isinstance(value, str) and value.startswith(_FORMULA_STARTS):
        return f"'{value}"
    return value

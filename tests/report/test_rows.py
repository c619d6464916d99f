"""Raw rows as CSV."""

from __future__ import annotations

import csv
import io

import pytest

from handcal.report.cells import rows_csv


def read(content: bytes) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(content.decode(), newline="")))


def test_columns_are_all_that_there_are_and_numbers_come_back() -> None:
    content = rows_csv([{"a": 0.1 + 0.2, "b": None}, {"a": 1, "c": 'x, "y"\nz'}])
    first, second = read(content)
    assert list(first) == ["a", "b", "c"]
    assert float(first["a"]) == 0.1 + 0.2
    assert (first["b"], first["c"], second["c"]) == ("", "", 'x, "y"\nz')


def test_columns_may_be_given() -> None:
    assert rows_csv([], ["a", "b"]) == b"a,b\r\n"
    with pytest.raises(ValueError, match="'c'"):
        rows_csv([{"c": 1}], ["a"])


@pytest.mark.parametrize("text", ["=1+1", "+1", "-1", "@x", "\tx", "\rx"])
def test_no_text_is_a_formula(text: str) -> None:
    assert read(rows_csv([{"a": text, "b": -1}]))[0] == {"a": f"'{text}", "b": "-1"}


def test_what_utf8_cannot_hold_is_replaced() -> None:
    assert read(rows_csv([{"a": "\ud800Zoë"}]))[0]["a"] == "?Zoë"

from __future__ import annotations

import pytest

from handcal_gui.widgets.times import local_time


def test_a_time_is_local() -> None:
    assert local_time("2026-11-21T12:34:56+00:00", "%M:%S") == "34:56"


@pytest.mark.parametrize("text", ["before noon", "", "0001-01-01T00:00:00+14:00"])
def test_what_is_no_time_is_shown_as_it_is(text: str) -> None:
    assert local_time(text) == text

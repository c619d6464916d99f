from __future__ import annotations

from handcal_gui.widgets.numbers import pluralize


def test_more_than_one_is_many() -> None:
    assert [pluralize(number, "trial") for number in (0, 1, 2)] == [
        "0 trials",
        "1 trial",
        "2 trials",
    ]

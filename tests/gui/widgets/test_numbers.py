from __future__ import annotations

import pytest

from handcal_gui.widgets.numbers import pluralize, signed


@pytest.mark.parametrize(
    ("value", "decimals", "text"),
    [(1.25, 2, "+1.25"), (-3.06, 1, "−3.1"), (-0.04, 1, "+0.0"), (-0.0, 0, "+0")],
)
def test_sign(value: float, decimals: int, text: str) -> None:
    assert signed(value, decimals) == text


def test_more_than_one_is_many() -> None:
    assert [pluralize(number, "trial") for number in (0, 1, 2)] == [
        "0 trials",
        "1 trial",
        "2 trials",
    ]

from __future__ import annotations

import pytest

from handcal_gui.evaluate.time_left import TimeLeft


@pytest.mark.parametrize(
    ("begun", "elapsed_s", "share", "told"),
    [
        (0.0, 10.0, 0.0, ""),
        (0.0, 30.0, 0.5, "less than a minute left"),
        (0.0, 60.0, 0.25, "about 3 min left"),
        (0.5, 60.0, 0.6, "about 4 min left"),  # what was done before took no time
        (0.0, 60.0, 0.005, "about 3 h 19 min left"),
        (0.0, 60.0, 1.0, "less than a minute left"),
    ],
)
def test_the_time_left_follows_the_pace(
    begun: float, elapsed_s: float, share: float, told: str
) -> None:
    times_s = iter((100.0, 100.0 + elapsed_s))
    assert TimeLeft(begun, lambda: next(times_s)).at(share) == told

import pytest
from hypothesis import given
from hypothesis import strategies as st

from handcal.core.errors import CancelledError
from handcal.core.progress import Progress

shares = st.floats(0.0, 1.0)


@given(st.lists(st.tuples(shares, shares).map(sorted), max_size=4), shares)
def test_parts_of_parts_stay_within_their_spans(spans: list[list[float]], share: float) -> None:
    shown: list[float] = []
    progress = Progress(lambda _what, whole: shown.append(whole))
    bounds = (0.0, 1.0)
    for low, high in spans:
        progress = progress.part(low, high)
        width = bounds[1] - bounds[0]
        bounds = bounds[0] + low * width, bounds[0] + high * width
    progress.at(share, "busy")
    assert bounds[0] - 1e-12 <= shown[0] <= bounds[1] + 1e-12
    assert progress.span == pytest.approx(bounds)


def test_a_cancelled_task_ends_before_it_reports() -> None:
    shown: list[float] = []
    progress = Progress(lambda _what, whole: shown.append(whole), is_cancelled=lambda: True)
    with pytest.raises(CancelledError, match="nothing has changed"):
        progress.at(0.5)
    with pytest.raises(CancelledError):
        progress.part(0.0, 0.5).check()
    assert shown == []


def test_a_part_names_the_activity_unless_another_is_given() -> None:
    shown: list[tuple[str, float]] = []
    progress = Progress(lambda what, share: shown.append((what, share)))
    part = progress.part(0.5, 1.0, "Writing")
    part.at(0.0)
    part.part(0.0, 0.5).at(1.0)
    part.at(1.0, "Moving")
    assert shown == [("Writing", 0.5), ("Writing", 0.75), ("Moving", 1.0)]


def test_a_task_that_keeps_what_is_done_is_not_ended_by_reporting() -> None:
    shown: list[float] = []
    Progress(lambda _what, share: shown.append(share), is_cancelled=lambda: True).show(0.5)
    assert shown == [0.5]

"""A blinded comparison: lots, answers, and nothing that tells the order before the report."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from handcal.calibration.states import ProcedureError
from handcal.core.types import Eye, Float64
from handcal.rig.example import example_rig
from handcal.session.comparison import Drawing, read_comparisons
from handcal.session.session import Session
from handcal.station.user_test.trials import Comparing

APPLIED_M: dict[Eye, Float64] = {"left": np.array([1e-3, 0.0, 0.0]), "right": np.zeros(3)}


@pytest.mark.parametrize("first", ["offline", "applied"])
def test_it_shows_both_in_the_order_of_the_lot_and_stores_the_answer(
    tmp_path: Path, first: Drawing
) -> None:
    shown: list[bool] = []
    with Session.create(tmp_path, example_rig(), {}) as session:
        comparing = Comparing(session, shown.append, lambda _both: first)
        with pytest.raises(ProcedureError, match="begin a comparison"):
            comparing.show("first")
        comparing.begin(APPLIED_M)
        assert comparing.shown == "first"
        with pytest.raises(ProcedureError, match="both drawings"):
            comparing.answer("first")
        comparing.show("second")
        comparing.show("first")
        comparing.answer("second")
        assert not comparing.has_seen_both
        with pytest.raises(ProcedureError, match="both drawings"):
            comparing.answer("second")
    is_first = first == "offline"
    assert shown == [is_first, not is_first, is_first, False]
    (stored,) = read_comparisons(Session.open(session.path).events)
    assert (stored.first, stored.answer) == (first, "second")


def test_it_ends_without_an_answer_when_another_phi_is_applied(tmp_path: Path) -> None:
    shown: list[bool] = []
    with Session.create(tmp_path, example_rig(), {}) as session:
        comparing = Comparing(session, shown.append, lambda _both: "offline")
        comparing.begin(APPLIED_M)
        comparing.check(dict(APPLIED_M))
        assert comparing.shown == "first"
        comparing.check({**APPLIED_M, "right": np.array([0.0, 1e-3, 0.0])})
        assert comparing.shown is None
        assert shown == [True, False]
    assert read_comparisons(Session.open(session.path).events) == []


def test_equal_drawings_are_not_compared(tmp_path: Path) -> None:
    with Session.create(tmp_path, example_rig(), {}) as session:
        comparing = Comparing(session, lambda _is_offline: pytest.fail("shown"))
        with pytest.raises(ProcedureError, match="offline calibration"):
            comparing.begin({"left": np.zeros(3), "right": np.zeros(3)})

"""A blinded comparison: lots, answers, and nothing that tells the order before the report."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from handcal.calibration.states import ProcedureError, State
from handcal.rig.example import example_rig
from handcal.session.session import Session
from handcal.session.trial import Drawing, read_comparisons
from handcal.station.user_test.trials import Trials

APPLIED_M = {"left": np.array([1e-3, 0.0, 0.0]), "right": np.zeros(3)}


class Room:
    """The trials of an applied calibration, and whether the headset drew offline, as told it."""

    def __init__(self, session: Session, first: Drawing) -> None:
        self.shown: list[bool] = []
        self.calibration = SimpleNamespace(state=State.APPLIED, applied_shift_m=dict(APPLIED_M))
        link: Any = SimpleNamespace(send_show=self.shown.append)
        calibration: Any = self.calibration
        self.trials = Trials(calibration, example_rig(), link, session, lambda _both: first)


@pytest.fixture
def make(tmp_path: Path) -> Iterator[Callable[[Drawing], Room]]:
    with Session.create(tmp_path, example_rig(), {}, name="one") as session:
        yield lambda first: Room(session, first)


def stored(tmp_path: Path) -> list[tuple[str, str]]:
    events = Session.open(tmp_path / "one").events
    return [(one.first, one.answer) for one in read_comparisons(events)]


@pytest.mark.parametrize("first", ["offline", "applied"])
def test_it_shows_both_in_the_order_of_the_lot_and_stores_the_answer(
    make: Callable[[Drawing], Room], tmp_path: Path, first: Drawing
) -> None:
    room = make(first)
    trials = room.trials
    with pytest.raises(ProcedureError, match="begin a comparison"):
        trials.show_compared("first")
    trials.compare()
    drawn = [trials.is_offline]
    with pytest.raises(ProcedureError, match="both drawings"):
        trials.answer("first")
    for place in ("second", "first"):
        trials.show_compared(place)
        drawn.append(trials.is_offline)
    trials.answer("second")
    assert (trials.compared, trials.has_compared_both, trials.is_offline) == (None, False, False)
    with pytest.raises(ProcedureError, match="both drawings"):
        trials.answer("second")
    is_first = first == "offline"
    assert drawn == [is_first, not is_first, is_first]
    assert stored(tmp_path) == [(first, "second")]


def test_it_ends_without_an_answer_when_another_phi_is_applied(
    make: Callable[[Drawing], Room], tmp_path: Path
) -> None:
    room = make("offline")
    room.trials.compare()
    room.trials.follow_procedure()
    assert room.trials.compared == "first"
    room.calibration.applied_shift_m["right"] = np.array([0.0, 1e-3, 0.0])
    room.trials.follow_procedure()
    assert room.trials.compared is None
    assert room.shown == [True, False]
    assert stored(tmp_path) == []


def test_equal_drawings_are_not_compared(make: Callable[[Drawing], Room]) -> None:
    room = make("offline")
    room.calibration.applied_shift_m["left"] = np.zeros(3)
    with pytest.raises(ProcedureError, match="offline calibration"):
        room.trials.compare()
    assert room.shown == []

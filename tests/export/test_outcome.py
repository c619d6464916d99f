"""Choice of the alignments to solve again and of the final φ."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from handcal.core.display import projection_matrix
from handcal.core.errors import FileError
from handcal.core.progress import Progress
from handcal.core.types import EYES, Verdict
from handcal.export.outcome import SessionOutcome, load_outcome
from handcal.register.results import results_json
from handcal.session.session import SessionRecord


def test_the_session_is_solved_to_what_it_was(outcome: SessionOutcome) -> None:
    assert outcome.results is not None
    assert results_json(outcome.results) == outcome.record.results


def test_what_was_set_by_hand_is_final_and_what_was_solved_otherwise(
    outcome: SessionOutcome,
) -> None:
    assert list(outcome.shifts_m["left"]) == ["set by hand", "solved", "offline"]
    assert list(outcome.shifts_m["right"]) == ["solved", "offline"]
    moved_m = outcome.drawn["left"].shift_m - outcome.shifts_m["left"]["solved"]
    np.testing.assert_allclose(moved_m, [0.001, 0.0, 0.0], atol=1e-15)


def test_applied_is_what_the_headset_rendered_with_in_the_end(outcome: SessionOutcome) -> None:
    assert outcome.is_applied("left", "set by hand")
    assert not outcome.is_applied("left", "solved")
    assert outcome.is_applied("right", "solved")
    assert not outcome.is_applied("right", "offline")
    waiting = replace(outcome.record, applied_shift_m={}, fine_tuned=None, is_applied=False)
    never = load_outcome(waiting)
    assert str(never.drawn["left"]) == "solved, not in the headset yet"
    assert not never.is_applied("left", "solved")
    assert never.is_applied("left", "offline")


def test_the_offline_calibration_is_final_where_it_is_kept(
    outcome: SessionOutcome, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert outcome.results is not None
    kept = replace(outcome.results, verdicts=dict.fromkeys(EYES, Verdict("keep", "as told")))
    monkeypatch.setattr("handcal.export.outcome.solve_sound", lambda record, *_: (record, kept))
    waiting = replace(outcome.record, fine_tuned=None, is_applied=False)
    again = load_outcome(waiting)
    assert list(again.shifts_m["right"]) == ["offline", "solved"]
    assert not again.drawn["right"].shift_m.any()


def test_the_expected_error_is_that_of_the_verdict_and_grows_with_a_move(
    outcome: SessionOutcome,
) -> None:
    assert outcome.results is not None
    benefit = outcome.results.benefits["left"]
    assert outcome.expected_arcmin("left", "solved") == benefit.after_arcmin
    assert outcome.expected_arcmin("left", "offline") == benefit.without_arcmin
    moved = outcome.expected_arcmin("left", "set by hand")
    assert moved is not None
    assert moved > benefit.after_arcmin


def test_projections_are_those_of_each_shift(outcome: SessionOutcome) -> None:
    display = outcome.record.rig.eyes["left"]
    for origin, shift_m in outcome.shifts_m["left"].items():
        projection = outcome.projection("left", origin)
        assert np.array_equal(projection.P, projection_matrix(display, shift_m))
        assert projection.width_px == display.width_px


def test_without_alignments_there_is_only_the_offline_calibration(empty: SessionRecord) -> None:
    outcome = load_outcome(empty)
    assert outcome.results is None
    assert outcome.drawn["left"].kind == "offline"
    assert outcome.expected_arcmin("left", "offline") is None
    assert outcome.is_applied("left", "offline")


def test_it_tells_how_far_it_is(record: SessionRecord) -> None:
    shares: list[float] = []
    load_outcome(record, Progress(lambda _what, share: shares.append(share)))
    assert shares == [0.0, 0.5]


def test_what_cannot_be_solved_is_refused_in_one_line(record: SessionRecord) -> None:
    few = replace(record.alignments[1], hand_m=np.zeros((5, 3)), hand_is_cut=np.zeros(5, bool))
    with pytest.raises(FileError, match=r"one cannot be solved: hand_m has 5 points"):
        load_outcome(replace(record, alignments={1: few}))

"""Choice of the alignments to solve again and of the final φ."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from handcal.core.types import EYES, Verdict
from handcal.export.outcome import SessionOutcome, load_outcome
from handcal.register.results import results_json
from handcal.session.session import SessionRecord


def test_the_session_is_solved_to_what_it_was(outcome: SessionOutcome) -> None:
    assert outcome.results is not None
    assert results_json(outcome.results) == outcome.record.results


def test_what_was_tuned_by_hand_is_final_and_what_was_solved_otherwise(
    outcome: SessionOutcome,
) -> None:
    assert list(outcome.shifts_m["left"]) == ["fine_tuned", "solved", "offline"]
    assert list(outcome.shifts_m["right"]) == ["solved", "offline"]
    assert (outcome.final("left"), outcome.final("right")) == ("fine_tuned", "solved")
    moved_m = outcome.final_shift_m("left") - outcome.shifts_m["left"]["solved"]
    np.testing.assert_allclose(moved_m, [0.001, 0.0, 0.0], atol=1e-15)


def test_an_undone_fine_tuning_is_not_final(outcome: SessionOutcome) -> None:
    solved_m = {eye: outcome.shifts_m[eye]["solved"] for eye in EYES}
    undone = load_outcome(replace(outcome.record, fine_tuned=solved_m))
    assert [undone.final(eye) for eye in EYES] == ["solved", "solved"]
    assert "fine_tuned" not in undone.shifts_m["left"]


def test_applied_is_what_the_headset_rendered_with_in_the_end(outcome: SessionOutcome) -> None:
    assert outcome.is_applied("left", "fine_tuned")
    assert not outcome.is_applied("left", "solved")
    assert outcome.is_applied("right", "solved")
    assert not outcome.is_applied("right", "offline")
    never = load_outcome(replace(outcome.record, applied_shift_m={}, fine_tuned=None))
    assert never.final("left") == "solved"
    assert not never.is_applied("left", "solved")
    assert never.is_applied("left", "offline")


def test_the_offline_calibration_is_final_where_it_is_kept(
    outcome: SessionOutcome, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert outcome.results is not None
    kept = replace(outcome.results, verdicts=dict.fromkeys(EYES, Verdict("keep", "as told")))
    monkeypatch.setattr("handcal.export.outcome.solve_sound", lambda *_: (outcome.record, kept))
    again = load_outcome(outcome.record)
    assert list(again.shifts_m["left"]) == ["fine_tuned", "offline", "solved"]
    assert list(again.shifts_m["right"]) == ["offline", "solved"]
    assert not again.final_shift_m("right").any()


def test_without_alignments_there_is_only_the_offline_calibration(empty: SessionRecord) -> None:
    outcome = load_outcome(empty)
    assert outcome.results is None
    assert outcome.final("left") == "offline"
    assert outcome.is_applied("left", "offline")

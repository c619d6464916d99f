from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from handcal.core.types import EYES, Alignment, Eye
from handcal.register.results import Results
from handcal.rig.example import example_rig
from handcal.session.session import Session, SessionRecord
from handcal.session.trial import Trial, make_trial
from handcal_gui.widgets.session_rows import (
    ALIGNMENT_COLUMNS,
    STATISTICS_COLUMNS,
    TRIAL_COLUMNS,
    Deletion,
    alignment_rows,
    deletions,
    statistics_rows,
    statistics_text,
    trial_rows,
)


def trial(eye: Eye, depth_m: float, off_m: float) -> Trial:
    return make_trial(example_rig().eyes[eye], eye, depth_m, np.zeros(3), [off_m, 0.0, 0.0])


def column(columns: Sequence[object], title: str) -> int:
    return [getattr(column, "title", column) for column in columns].index(title)


def phi_mm(cells: Sequence[str]) -> list[list[float]]:
    """Return φ1, φ2 and φ3 of each eye, from the columns that their headings name."""
    places = (column(ALIGNMENT_COLUMNS, f"φ{axis} mm") for axis in (1, 2, 3))
    columns = (cells[place].replace("−", "-").splitlines() for place in places)
    return [list(map(float, line)) for line in zip(*columns, strict=True)]


def test_alignments_as_text(record: SessionRecord, results: Results) -> None:
    rows = {row.key: row.cells for row in alignment_rows(record, results)}
    assert list(rows) == [1, 2]
    for number, cells in rows.items():
        assert isinstance(number, int)
        alignment, shifts = record.alignments[number], results.alignments[number]
        assert len(cells) == len(ALIGNMENT_COLUMNS)
        assert cells[:2] == (str(number), "Both eyes")
        angle_deg = np.degrees(np.linalg.norm(alignment.rotation_rad))
        assert float(cells[column(ALIGNMENT_COLUMNS, "Rotation °")]) == pytest.approx(
            angle_deg, abs=0.05
        )
        for eye, shown_mm in zip(EYES, phi_mm(cells), strict=True):
            np.testing.assert_allclose(shown_mm, 1e3 * shifts[eye].shift_m, atol=0.005)
        assert cells[column(ALIGNMENT_COLUMNS, "Point RMS mm")] == "\n".join(
            f"{1e3 * shift.rms_m:.2f}" for shift in shifts.values()
        )


def test_results_of_other_alignments_are_left_out(record: SessionRecord, results: Results) -> None:
    shorter = replace(record, alignments={1: record.alignments[1]})
    assert alignment_rows(shorter, results)[0].cells[3:8] == ("–",) * 5
    assert alignment_rows(record, None)[1].cells[3:8] == ("–",) * 5


def test_one_eye_alone(
    record: SessionRecord, results: Results, alignments: Sequence[Alignment]
) -> None:
    one = replace(alignments[0], eyes=("right",))
    alone = replace(
        results,
        alignments={1: {"right": results.alignments[1]["right"]}, 2: results.alignments[2]},
    )
    rows = alignment_rows(replace(record, alignments={1: one, 2: alignments[1]}), alone)
    cells = rows[0].cells
    assert cells[1] == "Right eye"
    np.testing.assert_allclose(
        phi_mm(cells), [1e3 * results.alignments[1]["right"].shift_m], atol=0.005
    )
    assert "\n" not in cells[column(ALIGNMENT_COLUMNS, "Point RMS mm")]


def test_trials_as_text(record: SessionRecord) -> None:
    with Session(record.path) as session:
        session.save_trial(trial("right", 0.4, 0.001))
    after = Session.open(record.path)
    (cells,) = (row.cells for row in trial_rows(after))
    assert len(cells) == len(TRIAL_COLUMNS)
    assert cells[:3] == ("1", "Right eye", "0.4")
    assert float(cells[3]) == pytest.approx(after.trials[1].error_px.mean(), abs=0.05)
    assert float(cells[4]) == pytest.approx(after.trials[1].error_arcmin.mean(), abs=0.05)


def test_statistics_as_text() -> None:
    trials = {1: trial("left", 0.4, 0.001), 3: trial("right", 0.6, 0.002)}
    rows = {row.label: row.cells for row in statistics_rows(trials)}
    assert list(rows) == ["All", "Left eye", "Right eye", "0.4 m", "0.6 m"]
    assert {len(cells) for cells in rows.values()} == {len(STATISTICS_COLUMNS)}
    means = [one.error_arcmin.mean() for one in trials.values()]
    sd = f"{np.std(means, ddof=1):.1f}"
    assert rows["All"][:5] == ("2", f"{np.mean(means):.1f}", sd, "1", "–")
    assert rows["Left eye"][2] == "–"  # one trial has no spread, whatever its corners
    assert statistics_text(trials).startswith("2 trials of 1 calibration: mean")


def test_statistics_of_several_calibrations() -> None:
    display = example_rig().eyes["left"]
    shifts_m = [np.zeros(3), np.zeros(3), np.full(3, 1e-3)]
    trials = {
        number: make_trial(display, "left", 0.5, shift_m, shift_m + off_m * np.eye(3)[0])
        for number, (shift_m, off_m) in enumerate(zip(shifts_m, (1e-3, 2e-3, 5e-3), strict=True))
    }
    first, second, third = (one.error_arcmin.mean() for one in trials.values())
    [row, *_] = statistics_rows(trials)
    between = np.std([(first + second) / 2, third], ddof=1)
    assert (row.cells[0], row.cells[3]) == ("3", "2")
    assert row.cells[4] == f"{between:.1f}"
    assert statistics_text(trials).endswith(f"SD between calibrations {between:.1f}′.")


def test_statistics_of_nothing() -> None:
    assert statistics_rows({}) == []
    assert statistics_text({}) == "No trials yet"


def test_deletions_in_their_order(record: SessionRecord) -> None:
    with Session(record.path) as session:
        for _ in range(2):
            session.save_trial(trial("left", 0.5, 0.001))
        session.delete("alignment", 2)
        session.delete("trial", 1)
        session.delete("alignment", 1)
        session.restore("alignment", 2)
    assert deletions(Session.open(record.path)) == [Deletion("trial", 1), Deletion("alignment", 1)]

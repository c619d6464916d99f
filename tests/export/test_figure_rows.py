"""The numbers behind the report's figures are those that are drawn."""

from __future__ import annotations

import numpy as np
import pytest

from handcal.core.geometry import transform
from handcal.export.figures import CELL_MM, residual_cells
from handcal.export.outcome import SessionOutcome
from handcal.export.report import (
    distance_rows,
    overlay_rows,
    residual_rows,
    running_mean_rows,
    session_report,
)
from handcal.report.document import Table


def test_distances_are_those_of_the_benefit(outcome: SessionOutcome) -> None:
    assert outcome.results is not None
    rows = list(distance_rows(outcome.results))
    of_right = outcome.results.benefits["right"].by_distance
    assert [row["after_high_arcmin"] for row in rows if row["eye"] == "right"] == [
        one.after_high_arcmin for one in of_right
    ]
    sections = {section.title: section for section in session_report(outcome).sections}
    table = sections["Error against distance"].items[0]
    assert isinstance(table, Table)
    assert [row[4] for row in table.rows] == [one.texts[1] for one in of_right]


def test_residuals_are_the_means_of_the_points_in_each_cell(outcome: SessionOutcome) -> None:
    assert outcome.results is not None
    alignment, shift = outcome.record.alignments[1], outcome.results.alignments[1]["left"]
    cells = residual_cells(alignment, "left", shift)
    rows = list(residual_rows(1, {"left": cells}))
    hand_mm = 1e3 * transform(alignment.T_E_W["left"], alignment.hand_m)[:, :2]
    assert sum(int(row["points"] or 0) for row in rows) == len(hand_mm)
    for row in rows:
        low_mm = np.array([row["x_mm"], row["y_mm"]], dtype=float)
        is_in = ((hand_mm >= low_mm - 1e-9) & (hand_mm < low_mm + CELL_MM - 1e-9)).all(axis=1)
        inliers_m = shift.residuals_m[is_in & np.isfinite(shift.residuals_m)]
        assert (row["points"], row["inliers"]) == (int(is_in.sum()), len(inliers_m))
        if len(inliers_m):
            assert row["mean_residual_mm"] == pytest.approx(1e3 * inliers_m.mean())
        else:
            assert row["mean_residual_mm"] is None


def test_outlines_are_told_corner_by_corner() -> None:
    square = np.array([[0.0, 0.0], [9.0, 0.0], [9.0, 9.0], [0.0, 0.0]])
    rows = list(overlay_rows(3, "left", {"before": {"hand": [], "cursor": [square, square + 1]}}))
    assert {(row["calibration"], row["of"]) for row in rows} == {("before", "cursor")}
    assert [row["outline"] for row in rows] == [1] * 4 + [2] * 4
    assert [[row["x_px"], row["y_px"]] for row in rows[:4]] == square.tolist()


def test_the_running_mean_is_of_each_eye_alone(outcome: SessionOutcome) -> None:
    record = outcome.record
    rows = list(running_mean_rows(record.trials))
    for eye in ("left", "right"):
        means = [trial.error_arcmin.mean() for trial in record.trials.values() if trial.eye == eye]
        found = [row["mean_so_far_arcmin"] for row in rows if row["eye"] == eye]
        np.testing.assert_allclose(np.array(found, dtype=float), np.cumsum(means) / [1, 2])


def test_every_figure_of_the_report_has_its_numbers(outcome: SessionOutcome) -> None:
    figures = {figure.name: figure for figure in session_report(outcome).figures}
    assert {name for name, figure in figures.items() if not figure.rows} <= {
        "overlay-left",  # too sparse clouds have no outline
        "overlay-right",
    }
    assert len(figures["trial-errors"].rows) == 4 * len(outcome.record.trials)

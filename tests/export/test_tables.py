"""The CSV files, as another program reads them."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np

from handcal.export.outcome import SessionOutcome, load_outcome
from handcal.export.tables import write_comparisons, write_parameters, write_trials
from handcal.session.comparison import COMPARED, Comparison, comparison_json
from handcal.session.journal import Event
from handcal.session.session import SessionRecord


def read(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file, strict=True))


def compared(outcome: SessionOutcome) -> SessionOutcome:
    """Return the outcome with a blinded comparison."""
    made = Comparison("applied", "second", {"left": np.array([1e-3, 2e-3, 3e-3])})
    event = Event(99, "2026-11-23T08:00:00+00:00", COMPARED, comparison_json(made))
    events = (*outcome.record.events, event)
    return replace(outcome, record=replace(outcome.record, events=events))


def triple(row: dict[str, str], name: str) -> list[float]:
    return [float(row[name.format(axis)]) for axis in (1, 2, 3)]


def test_parameters_hold_each_eye_of_each_alignment_fused_and_tuned(
    tmp_path: Path, outcome: SessionOutcome
) -> None:
    write_parameters(tmp_path / "p.csv", outcome)
    rows = read(tmp_path / "p.csv")
    assert [(row["source"], row["alignment"], row["eye"]) for row in rows] == [
        ("alignment", "1", "left"),
        ("alignment", "1", "right"),
        ("alignment", "3", "left"),
        ("fused", "", "left"),
        ("fused", "", "right"),
        ("fine-tuned", "", "left"),
    ]
    assert [(row["final"], row["applied"]) for row in rows[3:]] == [
        ("no", "no"),
        ("yes", "yes"),
        ("yes", "yes"),
    ]
    assert outcome.results is not None
    alone, fused = outcome.results.alignments[3]["left"], outcome.results.eyes["right"]
    assert triple(rows[2], "phi{}_mm") == (1e3 * alone.shift_m).tolist()
    assert triple(rows[4], "sigma{}_mm") == np.sqrt(np.diag(1e6 * fused.covariance_m2)).tolist()
    assert float(rows[4]["covariance23_mm2"]) == 1e6 * fused.covariance_m2[1, 2]
    assert float(rows[2]["rms_mm"]) == 1e3 * alone.rms_m
    assert int(rows[2]["iterations"]) == alone.iterations
    assert (rows[0]["eyes_open"], rows[2]["eyes_open"]) == ("left right", "left")
    assert rows[4]["verdict"] == outcome.results.verdicts["right"].name
    assert triple(rows[5], "phi{}_mm") == (1e3 * outcome.final_shift_m("left")).tolist()
    assert rows[5]["sigma1_mm"] == ""


def test_verifications_alone_have_no_numbers_of_a_registration(
    tmp_path: Path, verified: SessionRecord
) -> None:
    write_parameters(tmp_path / "p.csv", load_outcome(verified))
    rows = read(tmp_path / "p.csv")
    assert [row["source"] for row in rows] == ["fused", "fused"]
    assert {row[name] for row in rows for name in ("rms_mm", "inlier_ratio", "converged")} == {""}
    assert all(float(row["expected_error_arcmin"]) > 0.0 for row in rows)


def test_trials_hold_every_corner(tmp_path: Path, outcome: SessionOutcome) -> None:
    write_trials(tmp_path / "t.csv", outcome)
    rows = read(tmp_path / "t.csv")
    trials = outcome.record.trials
    assert len(rows) == 4 * len(trials)
    row, trial = rows[4 * 2 + 3], trials[3]
    assert (row["trial"], row["corner"], row["eye"]) == ("3", "4", trial.eye)
    assert float(row["target_depth_m"]) == trial.target_depth_m
    assert [float(row["truth_x_px"]), float(row["truth_y_px"])] == trial.truth_px[3].tolist()
    assert float(row["error_arcmin"]) == trial.error_arcmin[3]
    assert triple(row, "adjusted_phi{}_mm") == (1e3 * trial.adjusted_shift_m).tolist()


def test_comparisons_tell_the_order_and_are_only_written_if_there_are_any(
    tmp_path: Path, outcome: SessionOutcome
) -> None:
    write_comparisons(tmp_path / "none.csv", outcome)
    assert not (tmp_path / "none.csv").exists()
    write_comparisons(tmp_path / "c.csv", compared(outcome))
    (row,) = read(tmp_path / "c.csv")
    assert (row["first"], row["answer"], row["better"]) == ("applied", "second", "offline")
    assert triple(row, "left_phi{}_mm") == [1.0, 2.0, 3.0]
    assert row["right_phi1_mm"] == ""

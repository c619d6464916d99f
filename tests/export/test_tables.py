"""The CSV files, as another program reads them."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from handcal.core.types import EYES
from handcal.export.outcome import SessionOutcome, load_outcome
from handcal.export.tables import (
    table_rows,
    write_tables,
)
from handcal.export.tools import write_calibration_json
from handcal.session.journal import Event
from handcal.session.session import SessionRecord
from handcal.session.trial import COMPARED, Comparison, comparison_json


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


def parameters(path: Path, outcome: SessionOutcome) -> list[dict[str, str]]:
    write_tables(path, table_rows(outcome))
    return read(path / "parameters.csv")


def test_parameters_hold_each_eye_of_each_alignment_and_every_known_shift(
    tmp_path: Path, outcome: SessionOutcome
) -> None:
    rows = parameters(tmp_path, outcome)
    assert [(row["source"], row["alignment"], row["eye"], row["final"]) for row in rows] == [
        ("alignment", "1", "left", ""),
        ("alignment", "1", "right", ""),
        ("alignment", "3", "left", ""),
        ("set by hand", "", "left", "yes"),
        ("solved", "", "left", "no"),
        ("offline", "", "left", "no"),
        ("solved", "", "right", "yes"),
        ("offline", "", "right", "no"),
    ]
    assert [row["applied"] for row in rows[3:]] == ["yes", "no", "no", "yes", "no"]
    assert outcome.results is not None
    alone, solved = outcome.results.alignments[3]["left"], outcome.results.eyes["right"]
    assert triple(rows[2], "phi{}_mm") == (1e3 * alone.shift_m).tolist()
    assert triple(rows[6], "sigma{}_mm") == np.sqrt(np.diag(1e6 * solved.covariance_m2)).tolist()
    assert float(rows[6]["covariance23_mm2"]) == 1e6 * solved.covariance_m2[1, 2]
    assert float(rows[2]["rms_mm"]) == 1e3 * alone.rms_m
    assert int(rows[2]["iterations"]) == alone.iterations
    assert (rows[0]["eyes_open"], rows[2]["eyes_open"]) == ("left right", "left")
    assert rows[6]["verdict"] == outcome.results.verdicts["right"].name
    assert triple(rows[3], "phi{}_mm") == (1e3 * outcome.drawn["left"].shift_m).tolist()
    assert rows[3]["sigma1_mm"] == ""


def test_every_eye_has_one_final_row_whatever_is_drawn(
    tmp_path: Path, outcome: SessionOutcome, empty: SessionRecord, verified: SessionRecord
) -> None:
    offline = {eye: np.zeros(3) for eye in EYES}
    kept = load_outcome(replace(outcome.record, fine_tuned=offline, applied_shift_m=offline))
    earlier = {eye: np.full(3, 0.002) for eye in EYES}
    back = load_outcome(replace(outcome.record, fine_tuned=earlier, applied_shift_m=earlier))
    finals = {}
    for name, one in {
        "by hand": outcome,
        "kept": kept,
        "back": back,
        "empty": load_outcome(empty),
        "verified": load_outcome(verified),
    }.items():
        rows = [row for row in parameters(tmp_path, one) if row["final"] == "yes"]
        assert [row["eye"] for row in rows] == list(EYES)
        for row, eye in zip(rows, EYES, strict=True):
            assert triple(row, "phi{}_mm") == (1e3 * one.drawn[eye].shift_m).tolist()
        write_calibration_json(tmp_path / "c.json", one, 0.1, 10.0)
        eyes = json.loads((tmp_path / "c.json").read_text())["eyes"]
        assert [row["source"] for row in rows] == [eyes[eye]["final"] for eye in EYES]
        finals[name] = [row["source"] for row in rows]
    assert finals == {
        "by hand": ["set by hand", "solved"],
        "kept": ["offline", "offline"],
        "back": ["earlier", "earlier"],
        "empty": ["offline", "offline"],
        "verified": ["solved", "solved"],
    }


def test_final_rows_hold_what_a_study_needs_of_an_eye(
    tmp_path: Path, outcome: SessionOutcome, verified: SessionRecord
) -> None:
    rows = parameters(tmp_path, outcome)
    left, _ = (row for row in rows if row["final"] == "yes")
    assert outcome.results is not None
    benefit, trials = outcome.results.benefits["left"], outcome.trials["left"]
    assert float(left["before_arcmin"]) == benefit.without_arcmin
    assert float(left["expected_error_arcmin"]) == outcome.expected_arcmin("left", "set by hand")
    assert left["verdict"] == left["probability_better"] == "", "a φ set by hand is not judged"
    (solved,) = (row for row in rows if (row["source"], row["eye"]) == ("solved", "left"))
    assert float(solved["probability_better"]) == benefit.probability_better
    assert float(solved["depth_after_mm"]) == 1e3 * benefit.depth.after_m
    offline = next(row for row in rows if row["source"] == "offline")
    assert offline["verdict"] == offline["verifications"] == offline["before_arcmin"] == ""
    assert float(left["target_arcmin"]) == outcome.settings.verdict.target_arcmin
    assert (left["verifications"], left["verification_found_arcmin"]) == ("0", "")
    assert float(left["trials_mean_arcmin"]) == trials.mean_arcmin
    assert left["trials_over_target"] == ("yes" if trials.is_over else "no")
    checked = load_outcome(verified)
    rows = parameters(tmp_path, checked)
    assert checked.results is not None
    rows = [row for row in rows if row["source"] != "offline"]
    assert {(row["verifications"], row["verified"]) for row in rows} == {("1", "yes")}
    found = {float(row["verification_found_arcmin"]) for row in rows if row["eye"] == "left"}
    assert found == {checked.results.verified["left"].before_arcmin}


def test_verifications_alone_have_no_numbers_of_a_registration(
    tmp_path: Path, verified: SessionRecord
) -> None:
    rows = parameters(tmp_path, load_outcome(verified))
    assert [row["source"] for row in rows] == ["solved", "offline"] * 2
    assert {row[name] for row in rows for name in ("rms_mm", "inlier_ratio", "converged")} == {""}
    assert all(float(row["expected_error_arcmin"]) > 0.0 for row in rows)


def test_trials_hold_every_corner(tmp_path: Path, outcome: SessionOutcome) -> None:
    write_tables(tmp_path, table_rows(outcome))
    rows = read(tmp_path / "trials.csv")
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
    write_tables(tmp_path, table_rows(outcome))
    assert not (tmp_path / "comparisons.csv").exists()
    write_tables(tmp_path, table_rows(compared(outcome)))
    (row,) = read(tmp_path / "comparisons.csv")
    assert (row["first"], row["answer"], row["better"]) == ("applied", "second", "offline")
    assert triple(row, "left_phi{}_mm") == [1.0, 2.0, 3.0]
    assert row["right_phi1_mm"] == ""

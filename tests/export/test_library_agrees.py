"""The library, which reads what is stored, and the export, which solves again, say the same."""

from __future__ import annotations

import csv
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from handcal.core.types import EYES, Eye, Float64, Verification
from handcal.export.outcome import load_outcome
from handcal.export.tables import table_rows, write_tables
from handcal.register.results import read_solved_shift_m
from handcal.session.library import read_library
from handcal.session.session import Session, SessionRecord

Shifts = dict[Eye, Float64]
CHANGES: dict[str, Callable[[Shifts], Shifts]] = {
    "solved": lambda solved_m: solved_m,
    "offline": lambda solved_m: {eye: np.zeros(3) for eye in solved_m},
    "set by hand": lambda solved_m: {eye: one + 0.002 for eye, one in solved_m.items()},
}


@pytest.mark.parametrize("kind", CHANGES)
def test_one_final_shift_with_one_error(tmp_path: Path, record: SessionRecord, kind: str) -> None:
    path = Path(shutil.copytree(record.path, tmp_path / "sessions" / "one"))
    with Session(path) as session:
        session.save_fine_tuned(CHANGES[kind](read_solved_shift_m(record.results)))
    (entry,) = read_library(path.parent)
    outcome = load_outcome(Session.open(path))
    write_tables(tmp_path, table_rows(outcome))
    with (tmp_path / "parameters.csv").open(encoding="utf-8", newline="") as file:
        rows = {row["eye"]: row for row in csv.DictReader(file) if row["final"] == "yes"}
    for eye in EYES:
        listed, row = entry.eyes[eye], rows[eye]
        assert listed.final == row["source"] == kind
        assert row["verdict"] == (listed.verdict if listed.is_judged else "")
        assert row["verified"] == ("yes" if listed.is_verified else "no")
        assert listed.before_arcmin == pytest.approx(float(row["before_arcmin"]))
        assert listed.expected_arcmin == pytest.approx(float(row["expected_error_arcmin"]))
        assert listed.trials is not None
        assert listed.trials.count == int(row["trials"])
        assert listed.trials.mean_arcmin == pytest.approx(float(row["trials_mean_arcmin"]))
        assert ("yes" if listed.trials.is_over else "no") == row["trials_over_target"]


def test_an_eye_that_keeps_offline_has_what_its_verification_found(
    tmp_path: Path, record: SessionRecord
) -> None:
    path = Path(shutil.copytree(record.path, tmp_path / "sessions" / "one"))
    results = record.results
    assert results is not None
    kept = {**results["eyes"]["left"], "verdict": "keep", "measured_arcmin": [6.5, 2.8]}
    with Session(path) as session:
        verified = Verification((0.0, 0.0, 0.0), (1.0, 0.0), (0.001, 0.0, 0.0))
        session.save_facts(verified={"left": verified})
        session.save_results({**results, "eyes": {**results["eyes"], "left": kept}})
        session.save_applied({"left": np.zeros(3)})
    (entry,) = read_library(path.parent)
    left = entry.eyes["left"]
    assert (left.final, left.found_arcmin) == ("offline", 6.5)
    assert (left.expected_arcmin, left.remaining_arcmin) == (left.before_arcmin, None)

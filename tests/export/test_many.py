"""Export of several sessions: their numbers together, and one that fails spares the others."""

from __future__ import annotations

import csv
import json
import shutil
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from handcal.core.errors import CancelledError
from handcal.core.progress import Progress
from handcal.export.export import ExportSettings, export_sessions
from handcal.export.wearers import summarise_wearers, summary_rows, wearers_report
from handcal.io.resources import resource_path
from handcal.report.document import Table
from handcal.session.library import correct_wearer

SETTINGS = ExportSettings(("csv", "json"))
NAMES = ("Anna", "Bo", "Anna")


@pytest.fixture
def paths(tmp_path: Path) -> list[Path]:
    """Return three copies of the example, of two wearers."""
    example = resource_path("example_session")
    copies = [Path(shutil.copytree(example, tmp_path / "in" / name)) for name in ("a", "b", "c")]
    for path, name in zip(copies, NAMES, strict=True):
        correct_wearer(path, name)
    return copies


def read(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file, strict=True))


def row(wearer: str, session: str, eye: str, after: float, **cells: object) -> dict[str, object]:
    return {
        "wearer": wearer,
        "session": session,
        "begun_utc": "2026-11-28T03:44:00+00:00",
        "simulated": "",
        "final": "yes",
        "source": "solved",
        "eye": eye,
        "verdict": "accept",
        "before_arcmin": 2 * after,
        "expected_error_arcmin": after,
        "verification_found_arcmin": None,
        **cells,
    }


def test_the_tables_over_all_are_those_of_the_sessions_in_turn(
    paths: list[Path], tmp_path: Path
) -> None:
    made = export_sessions(paths, tmp_path / "out", ExportSettings(("csv", "json", "html")))
    assert made.missing == ()
    folders = sorted({file.parent.name for file in made.files if file.name == "calibration.json"})
    assert len(folders) == 3
    assert {name.split("-")[4] for name in folders} == {"Anna", "Bo"}, "by date, time and wearer"
    for name in ("parameters.csv", "trials.csv"):
        together = read(tmp_path / "out" / name)
        apart = [r for folder in folders for r in read(tmp_path / "out" / folder / name)]
        assert sorted(map(str, together)) == sorted(map(str, apart))
    finals = [r for r in read(tmp_path / "out" / "parameters.csv") if r["final"] == "yes"]
    assert len(finals) == 6
    counts = {r["quantity"]: r["values"] for r in read(tmp_path / "out" / "summary.csv")}
    assert (counts["wearers"], counts["sessions"], counts["eyes"]) == ("2", "3", "6")
    assert counts["accepted"] == str(sum(r["verdict"] == "accept" for r in finals))
    trials = {(r["session"], r["trial"]) for r in read(tmp_path / "out" / "trials.csv")}
    assert counts["trials"] == str(len(trials))
    data = json.loads((tmp_path / "out" / folders[0] / "calibration.json").read_text())
    assert data["simulated"] == finals[0]["simulated"]
    assert made.sentence in (tmp_path / "out" / "report.html").read_text()
    assert "2 wearers were calibrated (3 sessions, 6 eyes)" in made.sentence


def test_the_spread_counts_each_wearer_once() -> None:
    parameters = [
        row("Anna", "1", "left", 2.0),
        row("Anna", "1", "right", 4.0),
        row("Anna", "2", "left", 3.0, verdict="keep"),
        row("", "3", "left", 7.0, verified="yes", verification_found_arcmin=5.0),
        row("Cleo", "4", "left", 8.0, verdict=None, before_arcmin=None, expected_error_arcmin=None),
    ]
    corners: list[dict[str, object]] = [
        {"wearer": "Anna", "session": "1", "trial": trial, "error_arcmin": error}
        for trial, errors in {1: (1.0, 3.0), 2: (4.0, 4.0)}.items()
        for error in errors
    ]
    compared: list[dict[str, object]] = [
        {"better": better} for better in ("applied", "offline", "neither", "applied")
    ]
    tables: dict[str, Sequence[dict[str, object]]] = {
        "parameters.csv": parameters,
        "trials.csv": corners,
        "comparisons.csv": compared,
    }
    summary = summarise_wearers(tables)
    assert (summary.wearers, summary.sessions, summary.eyes) == (3, 4, 4)
    assert (summary.accepted, summary.verified, summary.trials) == (3, 1, 2)
    assert (summary.comparisons, summary.better_with, summary.better_without) == (4, 2, 1)
    after = summary.spreads["expected_error_arcmin"]
    assert (after.wearers, after.values, after.mean) == (2, 4, 5.0)
    assert after.sd_between == pytest.approx(np.std([3.0, 7.0], ddof=1))
    assert after.sd_within == pytest.approx(1.0)
    trials = summary.spreads["trials_error_arcmin"]
    assert (trials.values, trials.mean, trials.sd_between) == (2, 3.0, None)
    assert trials.sd_within == pytest.approx(np.std([2.0, 4.0], ddof=1))
    assert "5.0′ ± 2.8′ (mean ± SD between wearers, n = 2)" in summary.sentence
    assert "2 user-test trials the mean reprojection error of the φ calibrated then was 3.0′ (" in (
        summary.sentence
    )
    written = {r["quantity"]: r for r in summary_rows(summary)}
    assert written["expected_error_arcmin"]["mean"] == after.mean
    report = wearers_report(tables, ["d: it has no alignments"])
    assert report.lead == summary.sentence
    tables_shown = [one for part in report.sections for one in part.items if isinstance(one, Table)]
    assert [r[3] for r in tables_shown[1].rows] == [
        "Good",
        "Good",
        "No better than before",
        "Good",
        "not solved",
    ]
    assert report.sections[-1].items == ["d: it has no alignments"]


def test_one_that_fails_is_named_and_spares_the_others(paths: list[Path], tmp_path: Path) -> None:
    (paths[1] / "journal.jsonl").write_text("nonsense\n")
    shown: list[tuple[str, float]] = []
    progress = Progress(lambda what, share: shown.append((what, share)))
    made = export_sessions(paths, tmp_path / "out", SETTINGS, progress)
    assert sum(file.name == "calibration.json" for file in made.files) == 2
    [missing] = made.missing
    assert missing.startswith("b: ")
    assert "does not begin as the journal" in missing
    assert "1 wearer was calibrated (2 sessions" in made.sentence
    whats, shares = zip(*shown, strict=True)
    begins = "1 of 3: ", "2 of 3: ", "3 of 3: ", "All sessions"
    assert all(what.startswith(begins) for what in whats)
    solving = "3 of 3: Anna, exporting 1 of 2, Parameters and trials (CSV): solving"
    assert any(what.startswith(solving) for what in whats)
    assert list(shares) == sorted(shares)


def test_cancelling_within_a_session_keeps_those_before(paths: list[Path], tmp_path: Path) -> None:
    shown: list[str] = []
    progress = Progress(
        lambda what, _: shown.append(what), lambda: bool(shown and "2 of 3: Bo" in shown[-1])
    )
    made = export_sessions(paths, tmp_path / "out", SETTINGS, progress)
    assert made.missing == ("b: cancelled", "c: cancelled")
    finals = [r for r in read(tmp_path / "out" / "parameters.csv") if r["final"] == "yes"]
    assert {r["session"] for r in finals} == {"a"}
    with pytest.raises(CancelledError):
        export_sessions(paths, tmp_path / "other", SETTINGS, Progress(is_cancelled=lambda: True))
    assert not (tmp_path / "other").exists()

"""The report: its numbers, its places, and the file itself."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

from handcal.core.geometry import transform
from handcal.core.progress import Progress
from handcal.core.types import EYES, Eye, Float64, Verdict
from handcal.export.figures import CELL_MM, residual_cells
from handcal.export.outcome import SessionOutcome, load_outcome
from handcal.export.report import (
    distance_rows,
    residual_rows,
    running_mean_rows,
    session_report,
)
from handcal.register.benefit import expected_error_arcmin
from handcal.report.document import Table
from handcal.report.pdf import compose, write_pdf
from handcal.session.comparison import COMPARED, Answer, Comparison, Drawing, comparison_json
from handcal.session.journal import Event
from handcal.session.session import SessionRecord
from handcal.session.trial import Trial

COMPARED_M: dict[Eye, Float64] = {"left": np.array([1e-3, 0.0, 0.0])}
HOSTILE = ["\n\n../../x", "$\\frac{1}{0", "x" * 10_000, "\x00\u202e🙂中"]


@pytest.fixture(scope="module")
def pages(outcome: SessionOutcome) -> list[Figure]:
    return compose(session_report(outcome), Progress())


def texts(pages: list[Figure]) -> list[str]:
    return [text.get_text() for page in pages for text in page.texts]


def mm(value_m: float) -> str:
    return f"{1e3 * value_m:.2f}".replace("-", "−")


def test_it_says_what_was_found(pages: list[Figure], outcome: SessionOutcome) -> None:
    found = texts(pages)
    assert outcome.results is not None
    for eye, shift in outcome.results.eyes.items():
        for value, sigma in zip(shift.shift_m, np.sqrt(np.diag(shift.covariance_m2)), strict=True):
            assert f"{mm(value)}\u00a0±\u00a0{1e3 * sigma:.2f}" in found
        expected = expected_error_arcmin(outcome.record.rig.eyes[eye], shift)
        assert f"{expected:.1f}" in found
    for value in outcome.final_shift_m("left"):
        assert mm(value) in found
        assert f"{eye} {outcome.results.benefits[eye].depth}" in " ".join(found)
    assert outcome.results.eye_distance_m is not None
    assert f"Implied eye distance: {1e3 * outcome.results.eye_distance_m:.1f} mm." in found
    assert "=P-07, $x_" in found
    assert "50 % humidity: $\\frac{1}{2" in found
    assert "1335" in found
    assert f"{outcome.record.trials[1].error_arcmin.mean():.2f}" in found
    headings = ["Eye shift φ", "Alignments", "Convergence", "User test", "Notes", "Definitions"]
    large = [text for page in pages for text in page.texts if text.get_fontsize() == 12.5]
    assert [text.get_text() for text in large if text.get_text() in headings] == headings


def test_nothing_overlaps_or_leaves_its_page(pages: list[Figure]) -> None:
    for page in pages:
        page.draw_without_rendering()
        boxes = [text.get_window_extent() for text in page.texts if text.get_text()]
        boxes += [box for axes in page.axes if (box := axes.get_tightbbox()) is not None]
        for number, box in enumerate(boxes):
            assert page.bbox.x0 < box.x0 < box.x1 < page.bbox.x1
            for other in boxes[:number]:
                overlap = Bbox.intersection(box, other)
                assert overlap is None or min(overlap.width, overlap.height) < 1.5


def test_how_sure_the_mean_error_is_takes_several_calibrations(outcome: SessionOutcome) -> None:
    def said(trials: Sequence[Trial]) -> str:
        record = replace(outcome.record, trials=dict(enumerate(trials, 1)))
        report = session_report(replace(outcome, record=record))
        (test,) = (section for section in report.sections if section.title == "User test")
        return next(item for item in test.items if isinstance(item, str))

    trials = list(outcome.record.trials.values())
    assert "no interval" in said(trials)
    again = replace(trials[-1], calibrated_shift_m=np.zeros(3), error_arcmin=np.full(4, 20.0))
    first = np.mean([trial.error_arcmin.mean() for trial in trials[:-1]])
    assert said([*trials[:-1], again]).startswith(
        "1 of 4 trials judge an earlier φ than the result. "
        f"Mean over 2 calibrations of this wearer: {(first + 20.0) / 2.0:.2f} arcmin (95 % interval"
    )


def test_the_verdict_says_that_trials_contradict_it(outcome: SessionOutcome) -> None:
    assert outcome.results is not None
    shift_m = outcome.results.rendered_shift_m["left"]
    number, trial = next((n, t) for n, t in outcome.record.trials.items() if t.eye == "left")

    def lead(**changes: object) -> str:
        changed = replace(trial, error_arcmin=np.full(4, 20.7), **changes)  # type: ignore[arg-type]
        record = replace(outcome.record, trials={number: changed})
        return session_report(replace(outcome, record=record)).lead

    accepted = dict.fromkeys(EYES, Verdict("accept", "as told"))
    outcome = replace(outcome, results=replace(outcome.results, verdicts=accepted))
    said = ", but wrong by 20.7 arcmin in its trials (n = 1), over the lab's target of 8 arcmin"
    assert f"Left eye accepted{said}: as told; right eye accepted: as told" in lead(
        calibrated_shift_m=shift_m
    )
    assert said not in lead(calibrated_shift_m=shift_m + 1e-3), "a former calibration's"
    assert said not in session_report(outcome).lead


@pytest.mark.parametrize("text", HOSTILE)
def test_no_name_or_note_breaks_it(tmp_path: Path, empty: SessionRecord, text: str) -> None:
    hostile = replace(empty, wearer=text, notes=text, settings={text: {text: [text]}})
    outcome = replace(load_outcome(empty), record=hostile)
    write_pdf(tmp_path / "report.pdf", session_report(outcome), Progress())
    assert (tmp_path / "report.pdf").read_bytes().startswith(b"%PDF")
    assert [path.name for path in tmp_path.iterdir()] == ["report.pdf"]


def test_it_says_what_was_simulated(empty: SessionRecord) -> None:
    def simulated(**station: str) -> list[str]:
        settings = {**empty.settings, "station": station}
        outcome = load_outcome(replace(empty, settings=settings))
        [summary] = session_report(outcome).sections[0].items
        assert isinstance(summary, Table)
        return [value for name, value in summary.rows if name == "Simulated"]

    assert simulated(source="simulator", headset="virtual") == ["camera, headset and wearer"]
    assert simulated(source="realsense", headset="virtual") == ["headset and wearer"]
    assert simulated(source="realsense", headset="network") == []


def test_without_alignments_it_says_so(empty: SessionRecord) -> None:
    found = texts(compose(session_report(load_outcome(empty)), Progress()))
    assert "Nothing is solved: the session holds no alignment." in found
    assert "Convergence" not in found


def test_verifications_alone_have_no_numbers_of_a_registration(verified: SessionRecord) -> None:
    sections = session_report(load_outcome(verified)).sections
    tables = (one for section in sections for one in section.items if isinstance(one, Table))
    (solved,) = (one for one in tables if one.columns[1].title == "verdict")
    assert [row[3:6] for row in solved.rows] == [["–", "–", "–"]] * 2


@pytest.mark.process
def test_the_file_is_a4_with_its_fonts_and_all_pages(
    tmp_path: Path, outcome: SessionOutcome, pages: list[Figure]
) -> None:
    shares: list[float] = []
    path = tmp_path / "report.pdf"
    write_pdf(path, session_report(outcome), Progress(lambda _, share: shares.append(share)))
    assert shares == sorted(shares)
    content = path.read_bytes()
    assert len(re.findall(rb"/Type /Page\b", content)) == len(pages)
    sizes = set(re.findall(rb"/MediaBox \[ 0 0 (595\.27\d*) (841\.88\d*) \]", content))
    assert len(sizes) == 1
    assert b"/FontFile2" in content
    assert b"/Type3" not in content
    assert b"handcal" in content
    if shutil.which("pdftotext"):
        run = subprocess.run(["pdftotext", "-layout", path, "-"], capture_output=True, check=True)
        assert "Eye-display calibration" in run.stdout.decode()


def test_it_tells_the_order_of_blinded_comparisons(outcome: SessionOutcome) -> None:
    answers: list[tuple[Drawing, Answer]] = [
        ("offline", "second"),
        ("applied", "first"),
        ("applied", "second"),
        ("offline", "neither"),
    ]
    events = [
        Event(number, "2026-11-23T08:00:00+00:00", COMPARED, comparison_json(made))
        for number, made in enumerate((Comparison(*one, COMPARED_M) for one in answers), 100)
    ]
    record = replace(outcome.record, events=(*outcome.record.events, *events))
    sections = session_report(replace(outcome, record=record)).sections
    (blinded,) = (section for section in sections if section.title == "Blinded comparison")
    sentence, table = blinded.items
    assert isinstance(sentence, str)
    assert sentence.startswith("Better with the calibration: 2; without it: 1; neither: 1.")
    assert isinstance(table, Table)
    assert [row[3] for row in table.rows] == ["applied", "applied", "offline", "neither"]
    assert "Blinded comparison" not in {one.title for one in session_report(outcome).sections}


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

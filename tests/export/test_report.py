"""The report: its numbers, its places, and the file itself."""

from __future__ import annotations

import csv
import json
import re
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
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
    DEFINITIONS,
    distance_rows,
    residual_rows,
    running_mean_rows,
    session_report,
)
from handcal.export.tables import table_rows, write_tables
from handcal.export.tools import (
    write_calibration_json,
    write_calibration_yaml,
    write_openxr,
    write_unity,
)
from handcal.register.benefit import expected_error_arcmin
from handcal.register.verdict_words import VERDICT_WORDS
from handcal.report.document import Table
from handcal.report.pdf import compose, write_pdf
from handcal.session.drawn import DrawnShift
from handcal.session.journal import Event
from handcal.session.session import SessionRecord
from handcal.session.trial import (
    COMPARED,
    Answer,
    Comparison,
    Drawing,
    Trial,
    comparison_json,
    make_trial,
)

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
    for value in outcome.drawn["left"].shift_m:
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
        drawn = dict.fromkeys(EYES, DrawnShift("solved", shift_m, is_drawn=True))
        return session_report(replace(outcome, record=record, drawn=drawn)).lead

    accepted = dict.fromkeys(EYES, Verdict("accept", "as told"))
    outcome = replace(outcome, results=replace(outcome.results, verdicts=accepted))
    said = "Good, but wrong by 20.7′ in its trials (n = 1; target 8′)"
    assert f"Left eye: {said}" in lead(calibrated_shift_m=shift_m)
    assert said not in lead(calibrated_shift_m=shift_m + 1e-3), "a former calibration's"


def test_a_phi_set_by_hand_is_not_called_good(outcome: SessionOutcome) -> None:
    """Another φ was judged and verified, and is drawn in the figure."""
    assert outcome.results is not None
    accepted = dict.fromkeys(EYES, Verdict("accept", "as told"))
    by_hand = DrawnShift("set by hand", np.array([0.02, 0.0, 0.0]), is_drawn=True)
    outcome = replace(
        outcome,
        results=replace(outcome.results, verdicts=accepted),
        drawn={**outcome.drawn, "left": by_hand},
    )
    report = session_report(outcome)
    assert report.lead.startswith("Left eye: Set by hand, not judged, error ")
    assert "Right eye: Good, " in report.lead
    (reason,) = (
        item for one in report.sections for item in one.items if str(item).startswith("Left eye, ")
    )
    assert str(reason).startswith("Left eye, the solved φ, which is not final (Good): as told")
    sections = {section.title: section for section in report.sections}
    assert "left eye is another" in str(sections["Error against distance"].items[0])


def test_the_answer_comes_first_and_agrees_with_the_files(
    tmp_path: Path, verified: SessionRecord
) -> None:
    outcome = load_outcome(verified)
    report = session_report(outcome)
    answer = report.sections[0].items[0]
    assert isinstance(answer, Table)
    write_tables(tmp_path, table_rows(outcome))
    with (tmp_path / "parameters.csv").open(encoding="utf-8", newline="") as file:
        finals = [row for row in csv.DictReader(file) if row["final"] == "yes"]
    for cells, row in zip(answer.rows, finals, strict=True):
        assert cells[0] == row["eye"]
        assert cells[1] == VERDICT_WORDS[row["verdict"]]  # type: ignore[index]
        numbers = ("before_arcmin", "verification_found_arcmin", "expected_error_arcmin")
        assert list(cells[2:5]) == [f"{float(row[name]):.1f}" for name in numbers]
        assert cells[6] == row["verifications"]
        assert cells[8].startswith(row["source"])
        assert f"error {cells[4]}′" in report.lead
    (listed,) = (one for one in report.sections if one.title == "Verifications")
    (table,) = (one for one in listed.items if isinstance(one, Table))
    assert [row[:4] for row in table.rows] == [[eye, "1", "+1.0", "−2.0"] for eye in EYES]


def test_the_definition_of_the_expected_error_is_what_is_computed(outcome: SessionOutcome) -> None:
    """The mean over the corners at all three distances, by drawing eyes from the covariance."""
    distances = re.findall(r"\d\.\d", DEFINITIONS["expected error"])
    assert "mean over the corners" in DEFINITIONS["expected error"]
    assert outcome.results is not None
    shift, display = outcome.results.eyes["left"], outcome.record.rig.eyes["left"]
    rng = np.random.default_rng(0)
    eyes_m = rng.multivariate_normal(shift.shift_m, shift.covariance_m2, 400)
    errors = [
        make_trial(display, "left", float(depth_m), shift.shift_m, eye_m).error_arcmin.mean()
        for eye_m in eyes_m
        for depth_m in distances
    ]
    assert len(distances) == 3
    expected = outcome.expected_arcmin("left", "solved")
    assert np.mean(errors) == pytest.approx(expected, rel=0.1)


def test_only_settings_that_differ_from_the_defaults_are_listed(outcome: SessionOutcome) -> None:
    def listed(settings: dict[str, Any]) -> object:
        record = replace(outcome.record, settings=settings)
        sections = session_report(replace(outcome, record=record)).sections
        (section,) = (one for one in sections if one.title.startswith("Settings"))
        (item,) = section.items
        return [tuple(row) for row in item.rows] if isinstance(item, Table) else item

    usual = outcome.record.settings
    assert listed(usual) == "All settings are the defaults."
    calibration = {**usual["calibration"], "steady_s": 9.5}
    assert listed({"calibration": calibration}) == [("calibration.steady_s", "9.5")]


@pytest.mark.parametrize("text", HOSTILE)
def test_no_name_or_note_breaks_it(tmp_path: Path, empty: SessionRecord, text: str) -> None:
    hostile = replace(empty, wearer=text, notes=text, settings={text: {text: [text]}})
    outcome = replace(load_outcome(empty), record=hostile)
    write_pdf(tmp_path / "report.pdf", session_report(outcome), Progress())
    assert (tmp_path / "report.pdf").read_bytes().startswith(b"%PDF")
    assert [path.name for path in tmp_path.iterdir()] == ["report.pdf"]


def test_everything_says_what_was_simulated(tmp_path: Path, empty: SessionRecord) -> None:
    def simulated(**station: str) -> list[str]:
        settings = {**empty.settings, "station": station}
        outcome = load_outcome(replace(empty, settings=settings))
        [summary] = session_report(outcome).sections[0].items
        assert isinstance(summary, Table)
        write_calibration_json(tmp_path / "c.json", outcome, 0.1, 10.0)
        write_unity(tmp_path / "u.json", outcome, 0.1, 10.0)
        write_openxr(tmp_path / "x.json", outcome)
        write_calibration_yaml(tmp_path / "c.yaml", outcome)
        write_tables(tmp_path, table_rows(outcome))
        storage = cv2.FileStorage(str(tmp_path / "c.yaml"), cv2.FILE_STORAGE_READ)
        with (tmp_path / "parameters.csv").open(encoding="utf-8", newline="") as file:
            told = {row["simulated"] for row in csv.DictReader(file)}
        told.add(storage.getNode("simulated").string())
        for name in "cux":
            told.add(json.loads((tmp_path / f"{name}.json").read_text())["simulated"])
        shown = [value for name, value in summary.rows if name == "Simulated"]
        assert told == (set(shown) or {""}), "every file says the same"
        return shown

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
    (solved,) = (one for one in tables if one.columns[1].title.startswith("expected error"))
    assert [row[2:] for row in solved.rows] == [["–", "–", "–"]] * 2


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
    items = sections["Error against distance"].items
    (table,) = (item for item in items if isinstance(item, Table))
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

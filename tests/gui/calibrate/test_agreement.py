"""Page, copy and print say of a session what its library entry and its export say."""

from __future__ import annotations

import csv
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtWidgets import QLabel
from pytestqt.qtbot import QtBot

from handcal.core.types import EYES, Eye, Float64
from handcal.export.outcome import load_outcome
from handcal.export.report import session_report
from handcal.export.tables import table_rows, write_tables
from handcal.io.resources import resource_path
from handcal.register.results import read_solved_shift_m
from handcal.register.verdict_words import VERDICT_WORDS
from handcal.session.library import read_library
from handcal.session.session import Session
from handcal_gui.calibrate.parts.result_card import result_text
from handcal_gui.calibrate.review_page import ReviewPage
from handcal_gui.widgets.session_rows import session_facts
from tests.gui.helpers import show, text


@pytest.mark.parametrize("kind", ["solved", "offline", "set by hand"])
def test_one_final_shift_one_verdict_and_one_error(qtbot: QtBot, tmp_path: Path, kind: str) -> None:
    path = Path(shutil.copytree(resource_path("example_session"), tmp_path / "in" / "one"))
    with Session(path) as session:
        solved_m = read_solved_shift_m(session.contents.results)
        by_hand: dict[str, dict[Eye, Float64]] = {
            "solved": solved_m,
            "offline": {eye: np.zeros(3) for eye in EYES},
            "set by hand": {eye: shift_m + 0.002 for eye, shift_m in solved_m.items()},
        }
        session.save_fine_tuned(by_hand[kind])
    record = Session.open(path)
    outcome = load_outcome(record)
    assert outcome.results is not None
    target_arcmin = outcome.settings.verdict.target_arcmin
    copied = result_text(outcome.results, record, target_arcmin)
    report = session_report(outcome).lead
    (entry,) = read_library(path.parent)
    page = show(qtbot, ReviewPage(), 800, 900)
    page.show_session(record, outcome.results, target_arcmin)
    write_tables(tmp_path, table_rows(outcome))
    with (tmp_path / "parameters.csv").open(encoding="utf-8", newline="") as file:
        finals = [row for row in csv.DictReader(file) if row["final"] == "yes"]
    for eye, row in zip(EYES, finals, strict=True):
        assert (row["eye"], row["source"]) == (eye, kind)
        assert entry.eyes[eye].final == kind
        assert f"Final φ: {kind}" in copied
        assert text(page, f"card-drawn-{eye}").startswith(f"Final φ: {kind}")
        word = entry.eyes[eye].word
        assert word == VERDICT_WORDS.get(row["verdict"], kind.capitalize())  # type: ignore[arg-type]
        for said in (copied, text(page, f"card-verdict-{eye}"), report):
            assert word in said
        error = f"{float(row['expected_error_arcmin']):.1f}′"
        shown = text(page, f"card-verdict-{eye}") + text(page, f"card-drawn-{eye}")
        for said in (copied, shown, report):
            assert error in said
        assert entry.eyes[eye].expected_arcmin == pytest.approx(float(row["expected_error_arcmin"]))


def test_page_and_print_say_how_the_session_was_made(qtbot: QtBot) -> None:
    simulated = Session.open(resource_path("example_session"))
    facts = session_facts(simulated)
    assert facts["Simulated"] == simulated.simulated == "camera, headset and wearer"
    assert facts["Method"] == "consistent"
    station = {"source": "realsense", "headset": "network"}
    real = replace(simulated, settings={**simulated.settings, "station": station})
    assert "Simulated" not in session_facts(real)
    page = show(qtbot, ReviewPage(), 800, 900)
    page.show_session(simulated, None, 8.0)
    shown = {label.text() for label in page.findChildren(QLabel)}
    assert {*facts, *facts.values()} <= shown

"""The window on small screens and with larger texts: nothing scrolls, nothing leaves the screen."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Literal

import numpy as np
import pytest
from PySide6.QtCore import QObject, QPoint, QRect
from PySide6.QtWidgets import (
    QApplication,
    QLabel,
    QPushButton,
    QScrollArea,
    QTabWidget,
    QToolButton,
)
from pytestqt.qtbot import QtBot

from handcal.calibration.states import State
from handcal.core.types import EYES, Method, Verdict
from handcal.register.results import Results
from handcal.session.session import SessionRecord
from handcal.session.trial import make_trial
from handcal_gui.app.program import Program
from handcal_gui.calibrate.guide.picture import OF_THE_RESULT
from handcal_gui.calibrate.guide.step_views import align_view, verification_view
from handcal_gui.calibrate.guide.view import Action, WizardView
from handcal_gui.calibrate.parts.result_card import ResultCard
from handcal_gui.calibrate.results.compare_tab import CompareTab
from handcal_gui.calibrate.review_page import ReviewPage
from handcal_gui.calibrate.wearer_view.eye_canvas import EyeCanvas
from handcal_gui.calibrate.window import MainWindow, Page
from tests.gui.calibrate.window.conftest import Maker, main_button, say, shown
from tests.gui.helpers import child, text
from tests.gui.views import NUDGED, all_views, begun, fine_tuned


def scrolled_px(area: QObject | None) -> list[int]:
    """Return how far an area must be scrolled to see all of it."""
    for _ in range(3):  # a layout may ask for another
        QApplication.processEvents()
    assert isinstance(area, QScrollArea)
    return [bar.maximum() for bar in (area.horizontalScrollBar(), area.verticalScrollBar())]


def texts_of(view: WizardView) -> list[str]:
    return [one.text for one in view.preconditions]


_ACCEPTED = Verdict(
    "accept",
    "the verification found an error of 10.6′ and corrected it; expected error 12.8′ instead of "
    "29.6′; 99 % sure to be better than none",
)


def accepted(results: Results) -> Results:
    return replace(results, verdicts=dict.fromkeys(EYES, _ACCEPTED))


def with_trials(record: SessionRecord, results: Results) -> SessionRecord:
    """Return a record with a trial of each eye, far over any target."""
    trials = {}
    for number, (eye, calibrated_m) in enumerate(results.rendered_shift_m.items()):
        display = record.rig.eyes[eye]
        trials[number] = make_trial(display, eye, 0.4, calibrated_m, [0.05, 0.0, 0.0])
    return replace(record, trials=trials)


SMALL_PX = [(960, 510), (1280, 690), (1366, 738)]
EACH_TEXT = pytest.mark.parametrize("text_scale", [1.0, 1.25], indirect=True)


@EACH_TEXT
@pytest.mark.parametrize("arrangement", ["panels", "station"])
@pytest.mark.parametrize("size_px", SMALL_PX)
def test_no_step_needs_scrolling(
    program: Program,
    snapshot: Maker,
    size_px: tuple[int, int],
    arrangement: Literal["panels", "station"],
    results: Results,
) -> None:
    window, guide = program.window, program.wizard_panel
    window.show_page("start")
    window.resize(*size_px)
    window.use_arrangement(arrangement)
    window.show_page("live")
    window.reset_layout()
    viewport = guide.parent()
    assert viewport is not None
    area = viewport.parent()
    guide.start(begun())
    applied = snapshot(State.APPLIED)
    states = (State.SHOW_HAND, State.ALIGN, State.ALIGNED, State.SOLVED)
    procedure = replace(applied.procedure, results=accepted(results))
    tried = replace(applied, record=with_trials(applied.record, results), procedure=procedure)
    for seen in (*map(snapshot, states), applied, tried):
        guide.show_snapshot(seen)
        guide.picture.show_snapshot(seen)
        assert scrolled_px(area) == [0, 0], seen.procedure.state
        assert window.size().toTuple() == size_px
    card = guide.findChild(ResultCard)
    assert isinstance(card, ResultCard)
    assert card.visibleRegion().boundingRect() == card.rect()
    assert main_button(window).visibleRegion().boundingRect() == main_button(window).rect()


def test_a_window_without_panels_may_be_lower_than_one_with_them(window: MainWindow) -> None:
    window.show_page("live")
    window.resize(1920, 1050)
    window.use_arrangement("station")
    window.resize(960, 510)
    assert window.size().toTuple() == (960, 510)


@pytest.mark.parametrize("text_scale", [1.25], indirect=True)
@pytest.mark.parametrize("arrangement", ["panels", "station"])
def test_with_larger_texts_no_view_of_a_small_window_needs_scrolling(
    program: Program,
    snapshot: Maker,
    record: SessionRecord,
    arrangement: Literal["panels", "station"],
) -> None:
    window, picture = program.window, program.wizard_panel.picture
    window.resize(*SMALL_PX[0])
    window.use_arrangement(arrangement)
    window.show_page("live")
    viewport = program.wizard_panel.parent()
    assert viewport is not None
    nudging = snapshot(State.VERIFY, procedure={"verifying": NUDGED})
    for view in all_views(snapshot, record):
        seen = nudging if view.main.action is Action.VERIFIED else snapshot(State.APPLIED)
        say(program, seen, view)
        picture.show_snapshot(seen)
        assert scrolled_px(viewport.parent()) == [0, 0], view.sentence


def test_a_result_below_messages_needs_no_scrolling(
    program: Program, snapshot: Maker, record: SessionRecord, results: Results
) -> None:
    window, guide = program.window, program.wizard_panel
    window.resize(*SMALL_PX[0])
    window.show_page("live")
    viewport = guide.parent()
    assert viewport is not None
    seen = snapshot(State.APPLIED)
    procedure = replace(seen.procedure, results=accepted(results))
    seen = replace(seen, record=with_trials(seen.record, results), procedure=procedure)
    for view in all_views(snapshot, record):
        is_done = view.step in OF_THE_RESULT and view.main.action is not Action.VERIFIED
        if not is_done or any(one.verdict is None for one in view.preconditions):
            continue
        say(program, seen, replace(view, fact=6 * "drawn otherwise "))
        guide.picture.show_snapshot(seen)
        for message in (15 * "a message ", ""):
            window.banner.show_message(message)
            assert scrolled_px(viewport.parent()) == [0, 0], view.sentence


@pytest.mark.parametrize(("size_px", "eye_px"), [((960, 510), 220), ((1366, 738), 360)])
def test_an_eye_that_is_aligned_or_verified_has_room_below_a_message(
    program: Program, snapshot: Maker, size_px: tuple[int, int], eye_px: int
) -> None:
    window, guide = program.window, program.wizard_panel
    window.resize(*size_px)
    window.show_page("live")
    window.banner.show_message("Frames per second: often below the 8 needed; close other programs")
    verifying = snapshot(State.VERIFY, procedure={"verifying": NUDGED, "eyes": ("left",)})
    aligning = snapshot(State.ALIGN)
    for seen, view in (
        (verifying, verification_view(verifying, NUDGED)),
        (aligning, align_view(aligning)),
    ):
        say(program, seen, view)
        guide.picture.show_snapshot(seen)
        for _ in range(3):
            QApplication.processEvents()
        eyes = [one for one in guide.picture.findChildren(EyeCanvas) if one.isVisible()]
        assert [one.height() >= eye_px for one in eyes] == [True] * len(seen.procedure.eyes)
        texts = [one for one in guide.findChildren(QLabel) if one.text() in texts_of(view)]
        rows = {one.mapTo(guide, one.rect().center()).y() for one in texts}
        assert len(texts) == 3
        assert len(rows) == (1 if size_px == SMALL_PX[0] else 3)
        assert all(one.fontMetrics().horizontalAdvance(one.text()) <= one.width() for one in texts)


def test_a_turned_hand_moves_no_picture_in_a_low_window(program: Program, snapshot: Maker) -> None:
    window, guide = program.window, program.wizard_panel
    window.resize(*SMALL_PX[0])
    window.show_page("live")
    over = {"rotation_rad": np.array([0.2, 0.0, 0.0]), "is_over_limit": True}
    heights = []
    for seen in (snapshot(State.ALIGN), snapshot(State.ALIGN, observation=over)):
        view = align_view(seen)
        say(program, seen, view)
        guide.picture.show_snapshot(seen)
        for _ in range(3):
            QApplication.processEvents()
        heights += [
            one.height() for one in guide.picture.findChildren(EyeCanvas) if one.isVisible()
        ]
        texts = [one for one in guide.findChildren(QLabel) if one.text() in texts_of(view)]
        assert all(one.height() >= one.heightForWidth(one.width()) for one in texts), "whole"
    assert "tip your fingers" in texts_of(view)[1]
    assert len(set(heights)) == 1


@pytest.mark.parametrize(("size_px", "eye_px"), [((960, 540), 100), ((960, 510), 80)])
def test_the_eyes_above_a_result_have_room_in_a_small_window_with_a_message(
    program: Program,
    snapshot: Maker,
    record: SessionRecord,
    size_px: tuple[int, int],
    eye_px: int,
) -> None:
    window, picture = program.window, program.wizard_panel.picture
    window.resize(*size_px)
    window.show_page("live")
    window.banner.show_message("Frames per second: often below the 8 needed; close other programs")
    seen = snapshot(State.APPLIED)
    for view in all_views(snapshot, record):
        if view.step not in OF_THE_RESULT or view.main.action is Action.VERIFIED or view.fact:
            continue
        say(program, seen, view)
        picture.show_snapshot(seen)
        for _ in range(3):
            QApplication.processEvents()
        heights_px = [one.height() for one in picture.findChildren(EyeCanvas) if one.isVisible()]
        assert len(heights_px) == 2
        assert min(heights_px) >= eye_px, view.sentence


@EACH_TEXT
@pytest.mark.parametrize("size_px", SMALL_PX)
def test_no_panel_needs_scrolling(
    program: Program, snapshot: Maker, size_px: tuple[int, int]
) -> None:
    window, seen = program.window, snapshot(State.APPLIED)
    window.resize(*size_px)
    window.show_page("live")
    window.panels.link.show_pairing("192.168.178.105:50123", "a pairing key", is_virtual=True)
    window.panels.fine_tune.set_rig(seen.record.rig)
    for panel in window.panels.all():
        panel.show_snapshot(seen)
    for name, dock in window.docks.items():
        dock.raise_()
        if name == "link":  # its table scrolls
            continue
        for area in dock.findChildren(QScrollArea):
            assert scrolled_px(area) == [0, 0], name


@EACH_TEXT
def test_neither_the_start_page_nor_a_stored_session_needs_scrolling(
    qtbot: QtBot, program: Program, record: SessionRecord, results: Results
) -> None:
    window = program.window
    window.resize(*SMALL_PX[0])
    start = window.findChild(QPushButton, "start")
    assert isinstance(start, QPushButton)
    qtbot.waitUntil(start.isEnabled)  # all findings are shown
    review = window.findChild(ReviewPage)
    assert isinstance(review, ReviewPage)
    named, tried = replace(record, wearer=100 * "W"), with_trials(record, results)
    tuned = fine_tuned(tried, {eye: np.full(3, 0.001) for eye in EYES})
    shown: tuple[tuple[Page, SessionRecord, Results, str], ...] = (
        ("start", named, results, "↻ Repeat"),
        ("review", named, results, "↻ Repeat"),
        ("review", tried, accepted(results), "⚠ Trials over 8′"),
        ("review", tuned, accepted(results), "⚠ Trials over 8′"),
    )
    for page, one, found, word in shown:
        review.show_session(one, found, 8.0)
        window.show_page(page)
        assert text(review, "card-verdict-left") == f"Left eye: {word}"
        assert ("both eyes fine-tuned" in text(review, "reviewContents")) == (one is tuned)
        for area in window.findChildren(QScrollArea):
            if area.isVisible():
                assert scrolled_px(area) == [0, 0], (page, word)


@pytest.mark.parametrize("size_px", SMALL_PX)
def test_the_start_page_says_what_to_do_wherever_there_is_room(
    qtbot: QtBot, program: Program, size_px: tuple[int, int]
) -> None:
    page = program.start
    program.window.resize(*size_px)
    hint, fold = page.new.hint, child(page, QToolButton, "advanced")
    qtbot.waitUntil(hint.isVisible)
    if size_px == SMALL_PX[0]:
        fold.click()
        qtbot.waitUntil(hint.isHidden)  # the form needs its height
        fold.click()
        qtbot.waitUntil(hint.isVisible)


@EACH_TEXT
def test_the_panels_of_a_stored_session_have_the_room_that_its_page_leaves(
    program: Program, record: SessionRecord, results: Results
) -> None:
    window, panel = program.window, program.window.panels.results
    window.resize(*SMALL_PX[0])
    panel.show_results(results, record.alignments)
    window.show_page("review")
    panel.show_comparison(replace(results, method="paper"))
    tabs, compare = child(panel, QTabWidget, "results-tabs"), child(panel, CompareTab)
    tabs.setCurrentWidget(compare)
    for _ in range(3):
        QApplication.processEvents()
    bar = tabs.tabBar()
    assert all(bar.tabRect(i).width() >= bar.tabSizeHint(i).width() for i in range(bar.count()))
    assert compare.table.horizontalScrollBar().maximum() == 0


@EACH_TEXT
@pytest.mark.parametrize("size_px", SMALL_PX)
@pytest.mark.parametrize("method", ["paper", "icp-open3d"])
def test_a_comparison_of_methods_needs_no_scrolling_aside(
    program: Program, snapshot: Maker, results: Results, size_px: tuple[int, int], method: Method
) -> None:
    window, panel = program.window, program.window.panels.results
    window.resize(*size_px)
    window.show_page("live")
    window.panels.link.show_pairing("192.168.178.105:50123", "a pairing key", is_virtual=True)
    for one in window.panels.all():
        one.show_snapshot(snapshot(State.APPLIED))
    window.docks["results"].raise_()
    compare = child(panel, CompareTab)
    child(panel, QTabWidget, "results-tabs").setCurrentWidget(compare)
    panel.show_comparison(replace(results, method=method))
    for _ in range(3):
        QApplication.processEvents()
    table = compare.table
    assert table.horizontalScrollBar().maximum() == 0
    shown = [table.item(1, column).text() for column in range(3)]  # type: ignore[union-attr]
    assert all(" ".join(text.split()) in table.as_text() for text in shown)


@pytest.mark.parametrize("text_scale", [1.25, 1.5], indirect=True)
def test_larger_texts_need_no_larger_window(window: MainWindow) -> None:
    window.resize(1280, 690)
    window.show_page("live")
    QApplication.processEvents()
    assert window.size().toTuple() == (1280, 690)
    assert len(window.tabifiedDockWidgets(window.docks["camera"])) == len(window.docks) - 1


@pytest.mark.parametrize("screen_px", [(960, 540), (640, 480)])
def test_a_layout_of_a_large_screen_does_not_enlarge_the_window_beyond_a_small_one(
    qtbot: QtBot, program: Program, monkeypatch: pytest.MonkeyPatch, screen_px: tuple[int, int]
) -> None:
    window = program.window
    window.resize(1920, 1050)
    window.show_page("live")
    window.show_page("start")
    screen = QRect(0, 0, *screen_px)
    small = SimpleNamespace(availableSize=screen.size, availableGeometry=lambda: screen)
    monkeypatch.setattr(window, "screen", lambda: small)
    window.resize(screen.width(), screen.height() - 30)
    window.show_page("live")
    assert screen.size().boundedTo(window.size()) == window.size()
    assert shown(window) == set(window.docks), "in the layout of a small window"


def test_a_window_that_grows_stays_on_its_screen(qtbot: QtBot, window: MainWindow) -> None:
    screen = window.screen().availableGeometry()
    window.resize(500, 250)
    window.move(screen.bottomRight() - QPoint(500, 250))
    window.show_page("live")
    qtbot.waitUntil(lambda: screen.contains(window.frameGeometry()))

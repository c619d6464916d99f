from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QPoint
from PySide6.QtGui import QGuiApplication
from PySide6.QtPrintSupport import QPrinter
from PySide6.QtWidgets import QApplication, QToolButton
from pytestqt.qtbot import QtBot

from handcal.calibration.states import State
from handcal.core.types import EYES, Rig, Verdict
from handcal.session.trial import make_trial
from handcal.station.snapshot import Snapshot
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.calibrate.guide.picture import GuidePicture, ResultBar
from handcal_gui.calibrate.guide.view import Step
from handcal_gui.calibrate.parts.legend import LegendEntry
from handcal_gui.calibrate.wearer_view.eye_canvas import EyeCanvas
from handcal_gui.widgets.image_view import ImageView
from tests.gui.helpers import button, child, show, text
from tests.gui.views import fine_tuned, with_target

Maker = Callable[..., Snapshot]


def test_the_result_is_copied_and_printed(qtbot: QtBot, snapshot: Maker, tmp_path: Path) -> None:
    bar = show(qtbot, ResultBar(), 700, 300)
    qtbot.addWidget(bar.buttons)
    assert bar.text() == ""
    bar.show_snapshot(snapshot(State.APPLIED, settings=with_target(6.5)))
    button(bar.buttons, QToolButton, "Copy").click()
    copied = QGuiApplication.clipboard().text()
    assert copied.startswith("Wearer: without a name\n")
    assert "Target: 6.5′" in copied
    assert copied.count("Verification: not verified") == 2
    assert text(bar.buttons, "brief") == "Copied: the result"
    printer = QPrinter()
    printer.setOutputFileName(str(tmp_path / "result.pdf"))
    bar.print_to(printer)
    assert (tmp_path / "result.pdf").read_bytes().startswith(b"%PDF")


def test_the_copy_has_a_fine_tuned_shift(qtbot: QtBot, snapshot: Maker) -> None:
    seen = snapshot(State.APPLIED)
    assert seen.procedure.results is not None
    calibrated_m = seen.procedure.results.rendered_shift_m
    tuned_m = {**calibrated_m, "left": np.array([0.001, -0.002, 0.0])}
    bar = show(qtbot, ResultBar(), 700, 300)
    bar.show_snapshot(replace(seen, record=fine_tuned(seen.record, tuned_m)))
    assert "Left eye, fine-tuned: φ = (+1.00, −2.00, +0.00) mm" in bar.text().splitlines()
    assert "Right eye, fine-tuned" not in bar.text()


def test_it_follows_the_trials(qtbot: QtBot, snapshot: Maker, rig: Rig) -> None:
    seen = snapshot(State.APPLIED)
    results = seen.procedure.results
    assert results is not None
    accepted = replace(results, verdicts=dict.fromkeys(EYES, Verdict("accept", "as told")))
    seen = replace(seen, procedure=replace(seen.procedure, results=accepted))
    calibrated_m = accepted.eyes["left"].shift_m
    trial = make_trial(rig.eyes["left"], "left", 0.4, calibrated_m, [0.05, 0.0, 0.0])
    bar = show(qtbot, ResultBar(), 700, 300)
    for trials, word in (({}, "✓ Accept"), ({1: trial}, "⚠ Trials over 8′"), ({}, "✓ Accept")):
        bar.show_snapshot(replace(seen, record=replace(seen.record, trials=trials)))
        assert text(bar, "card-verdict-left") == f"Left eye: {word}"
        assert text(bar, "card-verdict-right") == "Right eye: ✓ Accept"
        assert f"Left eye: {word}" in bar.text()


def test_the_camera_is_shown_until_an_eye_s_view_helps(qtbot: QtBot, snapshot: Maker) -> None:
    picture = show(qtbot, GuidePicture(), 700, 500)
    camera = child(picture, ImageView)
    start, aligning = snapshot(), snapshot(State.ALIGN)
    picture.show_snapshot(replace(start, frame=None, views={}))
    assert camera.isVisible()
    assert "will appear here" in camera.message
    for step, shown, has_camera in (
        (Step.CONNECT, start, True),
        (Step.SHOW_HAND, start, True),
        (Step.ALIGN, aligning, False),
        (Step.ALIGN, replace(aligning, views={}), True),
        (Step.VERIFY, snapshot(State.APPLIED), False),
    ):
        picture.step = step
        picture.show_snapshot(shown)
        assert camera.isVisible() == has_camera
        assert camera.message == ""


def test_the_result_stands_beside_the_eyes_in_a_low_wide_window(
    qtbot: QtBot, snapshot: Maker
) -> None:
    picture = show(qtbot, GuidePicture(), 944, 230)  # of 1920x1080 at 200 %, without panels
    picture.step = Step.VERIFY
    picture.show_snapshot(snapshot(State.APPLIED))
    eye = next(one for one in picture.findChildren(EyeCanvas) if one.isVisible())
    qtbot.waitUntil(lambda: eye.height() > 150)
    assert picture.result.x() > eye.width()
    picture.resize(944, 300)
    key = child(picture, LegendEntry, "legend-hand")
    title = picture._titles["left"]

    def gap_px() -> int:
        bottom = key.mapTo(picture, key.rect().bottomLeft()).y()
        return title.mapTo(picture, title.rect().topLeft()).y() - bottom - 1

    qtbot.waitUntil(lambda: gap_px() >= SPACING_PX // 2)


@pytest.mark.parametrize("size_px", [(650, 700), (1580, 690)])  # of 1600x1000, with panels or not
def test_the_result_stands_right_below_the_eyes_where_there_is_height(
    qtbot: QtBot, snapshot: Maker, size_px: tuple[int, int]
) -> None:
    picture = show(qtbot, GuidePicture(), *size_px)
    picture.step = Step.VERIFY
    picture.show_snapshot(snapshot(State.APPLIED))
    eye = next(one for one in picture.findChildren(EyeCanvas) if one.isVisible())

    def is_close() -> bool:
        drawn_px = eye.width() * eye.crop_px.height() / eye.crop_px.width()
        key = child(picture, LegendEntry, "legend-hand")
        key_top = key.mapTo(picture, key.rect().topLeft()).y()
        above_px = key_top - eye.mapTo(picture, eye.rect().topLeft()).y() - drawn_px
        below_px = picture.result.y() - key_top - key.height()
        return picture.result.x() == 0 and above_px + below_px < 2 * SPACING_PX

    qtbot.waitUntil(is_close)


def shown_key(picture: GuidePicture) -> dict[str, int]:
    """Return where each entry of the legend that is shown begins."""
    QApplication.processEvents()
    entries = picture.findChildren(LegendEntry)
    return {one.text.split()[0]: one.x() for one in entries if one.isVisible()}


def test_a_key_tells_which_outlines_can_be_seen(qtbot: QtBot, snapshot: Maker) -> None:
    picture = show(qtbot, GuidePicture(), 700, 500)
    qtbot.addWidget(picture.result.buttons)
    picture.show_snapshot(snapshot())
    assert shown_key(picture) == {}, "of the camera's image"
    picture.step = Step.ALIGN
    picture.show_snapshot(snapshot(State.ALIGN))
    aligning = shown_key(picture)
    assert list(aligning) == ["Hand", "Drawn", "Cursor"]
    picture.step = Step.VERIFY
    applied = snapshot(State.APPLIED)
    picture.show_snapshot(applied)
    assert list(shown_key(picture)) == ["Hand", "Drawn", "Cursor"], "its line is still drawn"
    views = {eye: replace(one, cursor_px=one.cursor_px[:0]) for eye, one in applied.views.items()}
    picture.show_snapshot(replace(applied, views=views))
    verified = shown_key(picture)
    assert list(verified) == ["Hand", "Drawn"]
    button(picture.result.buttons, QToolButton, "Blink before/after").click()
    blinking = shown_key(picture)
    assert list(blinking) == ["Hand", "Drawn", "Before"]
    assert aligning.items() >= verified.items(), "nothing moves"
    assert blinking.items() >= verified.items()


def test_the_key_shows_the_style_of_each_line(qtbot: QtBot, snapshot: Maker) -> None:
    picture = show(qtbot, GuidePicture(), 700, 500)
    picture.step = Step.ALIGN
    picture.show_snapshot(snapshot(State.ALIGN))
    strokes = {}
    for what in ("hand", "drawn", "offline"):
        entry = child(picture, LegendEntry, f"legend-{what}")
        entry.show()
        QApplication.processEvents()
        image = entry.grab().toImage()
        width_px = 22
        row = [image.pixelColor(x, image.height() // 2).lightness() for x in range(width_px)]
        middle = (min(row) + max(row)) / 2
        strokes[what] = sum(a > middle >= b for a, b in pairwise([255, *row]))
        eyes = [one for one in picture.findChildren(EyeCanvas) if one.isVisible()]
        top = eyes[0].mapTo(picture, QPoint(0, 0)).y()
        bottom = entry.mapTo(picture, QPoint(0, entry.height())).y()
        assert 0 <= top - bottom <= 30, "the key stands by the pictures, whatever their height"
    assert strokes["hand"] <= 1 < strokes["drawn"] < strokes["offline"]


def test_before_and_after_are_shown_in_turn(qtbot: QtBot, snapshot: Maker) -> None:
    picture = show(qtbot, GuidePicture(), 700, 500)
    qtbot.addWidget(picture.result.buttons)
    picture.step = Step.VERIFY
    picture.show_snapshot(snapshot(State.APPLIED))
    left = next(one for one in picture.findChildren(EyeCanvas) if one.isVisible())
    for _ in range(3):  # a layout may ask for another
        QApplication.processEvents()
    after = left.grab().toImage()
    blink = button(picture.result.buttons, QToolButton, "Blink before/after")
    blink.click()
    before = left.grab().toImage()
    assert before != after
    qtbot.waitUntil(lambda: left.grab().toImage() == after)
    qtbot.waitUntil(lambda: left.grab().toImage() == before)
    blink.click()
    assert left.grab().toImage() == after


def test_a_low_window_leaves_out_eyes_too_small_to_see_anything(
    qtbot: QtBot, snapshot: Maker
) -> None:
    picture = show(qtbot, GuidePicture(), 500, 230)
    qtbot.addWidget(picture.result.buttons)
    picture.result.buttons.show()
    blink = button(picture.result.buttons, QToolButton, "Blink before/after")
    picture.step = Step.VERIFY
    eyes = picture.findChildren(EyeCanvas)
    for has_eyes in (False, True):
        picture.fit(has_details=has_eyes, has_eyes=has_eyes)
        picture.show_snapshot(snapshot(State.APPLIED))
        assert {eye.isVisible() for eye in eyes} == {has_eyes}
        assert blink.isVisible() == has_eyes, "there would be nothing to see"
        assert picture.result.isVisible()
    picture.fit(has_details=False, has_eyes=False)
    picture.step = Step.ALIGN
    picture.show_snapshot(snapshot(State.ALIGN))
    assert any(eye.isVisible() for eye in eyes)

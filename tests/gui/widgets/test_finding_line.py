"""A finding is shown by word and icon, not by colour alone, and fixed by a click."""

from __future__ import annotations

import numpy as np
import pytest
from PySide6.QtGui import QImage
from PySide6.QtWidgets import QLabel, QPushButton
from pytestqt.qtbot import QtBot

from handcal.station.checks.doctor import Finding, Health
from handcal_gui.widgets.finding_line import FindingLine
from tests.gui.helpers import child


def shape(line: FindingLine) -> bytes:
    """Return the icon without its colour."""
    label = child(line, QLabel, "xHealth")
    image = label.pixmap().toImage().convertToFormat(QImage.Format.Format_Alpha8)
    return np.frombuffer(image.constBits(), np.uint8).tobytes()


def test_each_health_has_a_shape_and_a_word(qtbot: QtBot) -> None:
    line = FindingLine("x")
    qtbot.addWidget(line)
    shapes, words = set(), set()
    for health in Health:
        line.show_finding(Finding("X", health, "found"))
        shapes.add(shape(line))
        label = child(line, QLabel, "xHealth")
        words.add(label.accessibleName())
    assert len(shapes) == len(words) == 3


@pytest.mark.parametrize(
    ("found", "advice", "shown"),
    [
        ("no camera", "", "No camera."),
        ("no camera", "plug one in", "No camera. Plug one in."),
        ("It ended.", "start again.", "It ended. Start again."),
    ],
)
def test_what_was_found_and_the_advice_are_sentences(
    qtbot: QtBot, found: str, advice: str, shown: str
) -> None:
    line = FindingLine("x")
    qtbot.addWidget(line)
    line.show_finding(Finding("X", Health.BROKEN, found, advice))
    text = child(line, QLabel, "xFound")
    assert text.text() == shown


def test_a_click_mends(qtbot: QtBot) -> None:
    line = FindingLine("x")
    qtbot.addWidget(line)
    mended: list[str] = []
    button = child(line, QPushButton, "xFix")
    line.show_finding(Finding("X", Health.BROKEN, "a"), "Mend", lambda: mended.append("a"))
    line.show_finding(Finding("X", Health.BROKEN, "b"), "Mend", lambda: mended.append("b"))
    assert not button.isHidden()
    button.click()
    assert mended == ["b"]
    line.show_finding(Finding("X", Health.GOOD, "c"))
    assert button.isHidden()

"""Tabs whose texts are whole."""

from __future__ import annotations

import numpy as np
import pytest
from PySide6.QtGui import QImage
from pytestqt.qtbot import QtBot

from handcal_gui.app.theme import scale_font, use_theme
from handcal_gui.calibrate.parts.tab_bar import TabBar
from tests.gui.helpers import show


def rows_of_text(bar: TabBar, index: int) -> int:
    """Return the height of a tab's text, in pixels of the screen."""
    image = bar.grab().toImage().convertToFormat(QImage.Format.Format_Grayscale8)
    line = image.bytesPerLine()
    pixels = np.frombuffer(image.constBits(), np.uint8).reshape(-1, line)
    tab = bar.tabRect(index).adjusted(6, 1, -6, -1)
    dark = (pixels[tab.top() : tab.bottom(), tab.left() : tab.right()] < 110).any(axis=1)
    return int(np.ptp(np.nonzero(dark)[0])) + 1


@pytest.mark.parametrize("scale", [1.0, 1.25, 1.5])
def test_no_letter_is_cut(qtbot: QtBot, scale: float) -> None:
    use_theme("light")
    bar = TabBar()
    bar.setDocumentMode(True)
    scale_font(bar, scale)
    for name in ("gggg", "gggg"):
        bar.addTab(name)
    show(qtbot, bar, 300, 60)
    heights = []
    for front in (0, 1):
        bar.setCurrentIndex(front)
        heights += [rows_of_text(bar, index) for index in (0, 1)]
    assert len(set(heights)) == 1
    use_theme("system")

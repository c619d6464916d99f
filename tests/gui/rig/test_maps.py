import numpy as np
from PySide6.QtGui import QColor
from pytestqt.qtbot import QtBot

from handcal.rig.boards.views import Coverage
from handcal_gui.rig.maps import CoverageMap


def test_the_fuller_a_cell_the_darker(qtbot: QtBot) -> None:
    shown = CoverageMap("Depth camera")
    qtbot.addWidget(shown)
    assert shown.caption == "Depth camera: –"
    hits = np.zeros((6, 8), np.int64)
    hits[5, 0], hits[5, 1] = 2, 20
    shown.show_coverage(Coverage(hits, 2 / 48))
    assert shown.caption == "Depth camera: 4 %"
    image = shown.grab().toImage()
    bottom = shown.height() - 4  # below the numbers
    some, many, none = (QColor(image.pixel(x, bottom)).lightness() for x in (3, 23, 43))
    assert none > some > many

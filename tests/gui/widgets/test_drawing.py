from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from handcal_gui.app.theme import use_theme
from handcal_gui.widgets.drawing import Drawing, themed_drawing
from tests.helpers import ROOT

DRAWINGS = sorted((ROOT / "docs" / "pictures").glob("*.svg"))


@pytest.fixture(autouse=True)
def system_theme(qtbot: QtBot) -> Iterator[None]:
    yield
    use_theme("system")


def test_a_drawing_follows_the_theme(qtbot: QtBot) -> None:
    use_theme("light")
    drawing = Drawing("docs/pictures/setup-stereo.svg")
    qtbot.addWidget(drawing)
    drawing.resize(620, 190)
    drawing.show()
    for theme in ("light", "dark", "contrast"):
        use_theme(theme)
        QApplication.processEvents()
        image = drawing.grab().toImage()
        colors = (image.pixelColor(x, y) for x in range(0, 620, 3) for y in range(0, 190, 3))
        ground, count = Counter(color.name() for color in colors).most_common(1)[0]
        assert ground == drawing.palette().base().color().name()
        assert count > 62 * 60


@pytest.mark.parametrize("path", DRAWINGS, ids=lambda path: path.stem)
def test_no_colour_of_a_drawing_stays_in_a_dark_theme(qtbot: QtBot, path: Path) -> None:
    use_theme("dark")
    themed = bytes(themed_drawing(path).data()).decode()
    assert not any(color in themed for color in ("#222", "#fff", "#888", "#dde6f0"))

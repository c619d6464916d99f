from __future__ import annotations

import numpy as np
import pytest
from PySide6.QtGui import QColor, QPalette
from pytestqt.qtbot import QtBot

from handcal_gui.app import theme
from handcal_gui.widgets.plots import Plot


@pytest.fixture
def plot(qtbot: QtBot) -> Plot:
    plot = Plot("some-plot", "Some plot", "Time (s)", "Distance (mm)")
    qtbot.addWidget(plot)
    plot.resize(300, 200)
    return plot


def test_a_line_has_the_colour_of_its_role_in_light_and_dark(
    plot: Plot, monkeypatch: pytest.MonkeyPatch
) -> None:
    line = plot.add_line("right")
    text = plot.item.getAxis("left").textPen().color()
    assert line.opts["pen"].color().name() == theme.colors().right
    monkeypatch.setattr(theme, "is_dark", lambda: True)
    plot.setPalette(QPalette(QColor("#202020")))
    assert theme.colors().right != theme._LIGHT.right
    assert line.opts["pen"].color().name() == theme.colors().right
    assert plot.item.getAxis("left").textPen().color() != text
    corner = plot.grab().toImage().pixelColor(0, 0)
    assert corner.name() == theme.colors().canvas


def test_clear_takes_away_lines_texts_and_legend(plot: Plot) -> None:
    plot.show_legend()
    plot.add_line("left", name="Left eye").setData([0, 1], [2, 3])
    plot.add_text("1", 1.0, 3.0)
    empty = len(plot.item.items)
    assert empty == 2
    plot.clear()
    assert not plot.item.items
    assert not plot.item.legend.items


def test_a_gap_is_not_bridged(plot: Plot) -> None:
    plot.item.setXRange(0, 4, padding=0)
    plot.item.setYRange(0, 2, padding=0)
    line = plot.add_line("red")

    def red_pixels() -> int:
        image = plot.grab().toImage()
        red = QColor(theme.colors().red)
        return sum(
            image.pixelColor(x, y) == red
            for x in range(image.width())
            for y in range(image.height())
        )

    line.setData([0, 1, 2, 3, 4], [1, 1, 1, 1, 1])
    whole = red_pixels()
    line.setData([0, 1, 2, 3, 4], [1, 1, np.nan, 1, 1])
    assert 0.3 * whole < red_pixels() < 0.7 * whole


def test_negative_numbers_on_an_axis_have_a_minus(plot: Plot) -> None:
    assert plot.item.getAxis("left").tickStrings([-1.5, 0.0], 1.0, 0.5) == ["−1.5", "0"]

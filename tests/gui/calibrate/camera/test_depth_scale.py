from __future__ import annotations

import numpy as np
import pytest
from pytestqt.qtbot import QtBot

from handcal.core.types import UInt8
from handcal_gui.calibrate.camera.panel import DepthColors, DepthLegend

GATE_M = (0.35, 0.70)


def colors_at(depth_m: list[float], scale_m: float = 0.001) -> UInt8:
    depth_colors = DepthColors(GATE_M)
    depth_colors.set_scale(scale_m)
    colors: UInt8 = depth_colors.colorize(
        np.round(np.array([depth_m]) / scale_m).astype(np.uint16)
    )[0]
    return colors


def saturation(color: UInt8) -> int:
    return int(color.max()) - int(color.min())


def test_holes_are_darker_than_any_depth() -> None:
    hole, *others = colors_at([0.0, 0.1, 0.2, 0.35, 0.7, 1.0, 5.0])
    assert hole.max() < 20
    assert all(color.max() > 60 for color in others)


def test_only_the_gate_is_in_colour() -> None:
    near, first, last, far = colors_at([0.33, 0.36, 0.69, 0.72])
    assert min(saturation(first), saturation(last)) > 2 * max(saturation(near), saturation(far))


def test_colours_go_from_bright_to_dark() -> None:
    brightness = colors_at(list(np.linspace(0.36, 0.69, 12))).sum(axis=1).astype(int)
    assert (np.diff(brightness) < 0).all()


@pytest.mark.parametrize("scale_m", [0.001, 0.0001, 0.000125])
def test_a_depth_has_one_colour_whatever_its_unit(scale_m: float) -> None:
    depth_m = [0.25, 0.4, 0.5, 0.6, 0.9]
    difference = colors_at(depth_m, scale_m).astype(int) - colors_at(depth_m)
    assert np.abs(difference).max() <= 3


def test_the_ramp_is_what_depths_are_drawn_in() -> None:
    ramp = DepthColors(GATE_M).ramp()
    assert len(ramp) == 255
    assert (ramp[0] == colors_at([0.2])[0]).all()
    assert (ramp[-1] == colors_at([1.0])[0]).all()


def test_the_legend_names_the_gate(qtbot: QtBot) -> None:
    legend = DepthLegend()
    qtbot.addWidget(legend)
    legend.show_colors(DepthColors(GATE_M))
    assert "0.35 to 0.70 m" in legend.toolTip()
    legend.resize(legend.width(), 200)
    picture = legend.grab().toImage()
    # Marks at the ends of the gate, beside the bar.
    line_px = legend.fontMetrics().height()
    text = legend.palette().windowText().color()
    for depth_m in (0.2, *GATE_M, 1.0):
        y = round(line_px / 2 + (depth_m - 0.2) / 0.8 * (200 - line_px))
        assert any(picture.pixelColor(13, y + dy) == text for dy in (-1, 0, 1))

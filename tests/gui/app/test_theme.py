"""Dark and light, also where the display itself knows neither."""

from __future__ import annotations

import weakref
from collections.abc import Iterator
from dataclasses import fields
from typing import ClassVar, Literal

import numpy as np
import pytest
from PySide6.QtGui import QColor, QGuiApplication, QIcon, QPalette
from PySide6.QtWidgets import QApplication, QWidget
from pytestqt.qtbot import QtBot

from handcal.core.types import Float64
from handcal_gui.app.theme import colors, follow_theme, icon, is_dark, use_theme
from handcal_gui.calibrate.parts.residual_scale import residual_ramp


@pytest.fixture
def themes(qtbot: QtBot) -> Iterator[None]:
    yield
    use_theme("system")


def middle(one: QIcon) -> QColor:
    """Return the colour of the stroke, wherever it is most opaque."""
    image = one.pixmap(24).toImage()
    pixels = [image.pixelColor(x, y) for x in range(24) for y in range(24)]
    return max(pixels, key=QColor.alpha)


@pytest.mark.usefixtures("themes")
def test_dark_is_dark_and_gives_way_again() -> None:
    use_theme("light")
    light, before = colors(), QGuiApplication.palette()
    use_theme("dark")
    assert is_dark()
    assert colors() != light
    palette = QGuiApplication.palette()
    text, ground = (
        palette.color(role) for role in (QPalette.ColorRole.Text, QPalette.ColorRole.Base)
    )
    assert text.lightness() - ground.lightness() > 128
    assert middle(icon("check")).lightness() > 128
    disabled = QPalette.ColorGroup.Disabled
    assert palette.color(disabled, QPalette.ColorRole.PlaceholderText) == palette.color(
        disabled, QPalette.ColorRole.Text
    )
    use_theme("light")
    assert not is_dark()
    assert QGuiApplication.palette() == before
    assert middle(icon("check")).lightness() < 128


@pytest.mark.usefixtures("themes")
def test_a_widget_follows_the_theme_while_it_lives(qtbot: QtBot) -> None:
    class Sign(QWidget):
        drawn: ClassVar[list[str]] = []

        def redraw(self) -> None:
            self.drawn.append(colors().good)

    use_theme("light")
    sign = Sign()
    follow_theme(sign, sign.redraw)
    light = colors().good
    assert Sign.drawn == [light]
    use_theme("dark")
    QApplication.processEvents()
    assert Sign.drawn[-1] == colors().good != light
    sign_died = weakref.ref(sign)
    del sign
    assert sign_died() is None, "following the theme must not keep a widget alive"
    Sign.drawn.clear()
    use_theme("light")
    QApplication.processEvents()
    assert not Sign.drawn


SEEN_BY = {
    "everybody": np.eye(3),
    "protanopes": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
                   [-0.003882, -0.048116, 1.051998]],
    "deuteranopes": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
                     [-0.011820, 0.042940, 0.968881]],
    "tritanopes": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602],
                   [0.004733, 0.691367, 0.303900]],
}  # fmt: skip
"""Colours that people see, in linear red, green and blue (Machado, Oliveira and Fernandes 2009, "A
physiologically-based model for simulation of color vision deficiency", severity 1.0)."""
TOLD_APART = (
    ("good", "warning"), ("good", "red"), ("warning", "red"), ("muted", "good"),
    ("muted", "warning"), ("live", "cursor"), ("live", "red"), ("cursor", "red"),
    ("left", "right"),
)  # fmt: skip
LEAST_DIFFERENCE = 20.0
"""In CIE 1976 L*a*b*, in which 2.3 is just noticeable; neighbouring areas need more."""


def linear_rgb(color: QColor) -> Float64:
    parts = np.array([color.redF(), color.greenF(), color.blueF()])
    return np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)


def lab(rgb: Float64) -> Float64:
    """Return L*, a* and b* of linear sRGB, with the white D65."""
    xyz_rgb = np.array(
        [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.072175],
         [0.0193339, 0.119192, 0.9503041]]
    )  # fmt: skip
    relative = xyz_rgb @ np.clip(rgb, 0.0, 1.0) / xyz_rgb.sum(axis=1)
    x, y, z = np.where(
        relative > 216 / 24389, np.cbrt(relative), (24389 / 27 * relative + 16) / 116
    )
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def contrast(one: QColor, other: QColor) -> float:
    """Return the contrast of two colours as WCAG 2 defines it, 1 to 21."""

    def luminance(color: QColor) -> float:
        return float(linear_rgb(color) @ [0.2126, 0.7152, 0.0722])

    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


@pytest.mark.usefixtures("themes")
@pytest.mark.parametrize(("theme", "least"), [("light", 4.4), ("dark", 4.5), ("contrast", 7.0)])
def test_every_colour_with_a_meaning_is_readable_as_text(
    theme: Literal["light", "dark", "contrast"], least: float
) -> None:
    use_theme(theme)
    ground = QGuiApplication.palette().window().color()
    for field in fields(colors()):
        if field.name != "canvas":
            shade = QColor(getattr(colors(), field.name))
            assert contrast(shade, ground) >= least, field.name
    assert contrast(QGuiApplication.palette().windowText().color(), ground) >= 7.0


@pytest.mark.usefixtures("themes")
@pytest.mark.parametrize("theme", ["light", "dark", "contrast"])
def test_colour_blind_people_tell_the_colours_of_states_apart(
    theme: Literal["light", "dark", "contrast"],
) -> None:
    use_theme(theme)
    for who, seen in SEEN_BY.items():
        for pair in TOLD_APART:
            one, other = (
                lab(np.array(seen) @ linear_rgb(QColor(getattr(colors(), name)))) for name in pair
            )
            assert np.linalg.norm(one - other) >= LEAST_DIFFERENCE, (who, pair)


@pytest.mark.usefixtures("themes")
@pytest.mark.parametrize("theme", ["dark", "contrast"])
def test_the_best_points_stand_out_from_the_canvas(theme: Literal["dark", "contrast"]) -> None:
    use_theme(theme)  # in light colours, the best points are the darkest
    assert contrast(QColor(*residual_ramp()[0].tolist()), QColor(colors().canvas)) >= 2.5

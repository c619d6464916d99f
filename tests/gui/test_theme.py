"""Dark and light, also where the display itself knows neither."""

from __future__ import annotations

import weakref
from collections.abc import Iterator
from dataclasses import fields
from typing import ClassVar, Literal

import pytest
from PySide6.QtGui import QColor, QGuiApplication, QIcon, QPalette
from PySide6.QtWidgets import QApplication, QWidget
from pytestqt.qtbot import QtBot

from handcal_gui.theme import colors, follow_theme, icon, is_dark, use_theme


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
    use_theme("light")
    assert not is_dark()
    assert QGuiApplication.palette() == before
    assert middle(icon("check")).lightness() < 128


def test_an_icon_takes_a_colour_with_a_meaning(qtbot: QtBot) -> None:
    red = middle(icon("check", "#ff0000"))
    assert (red.red(), red.green(), red.blue()) == (255, 0, 0)


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


def contrast(one: QColor, other: QColor) -> float:
    """Return the contrast of two colours as WCAG 2 defines it, 1 to 21."""

    def luminance(color: QColor) -> float:
        parts = (color.redF(), color.greenF(), color.blueF())
        linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts]
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]

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

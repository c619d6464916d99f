"""How the program looks: spacing, colours for light and dark, icons; the one place for them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from PySide6.QtCore import QByteArray, QRectF, Qt
from PySide6.QtGui import (
    QColor,
    QFont,
    QFontDatabase,
    QGuiApplication,
    QIcon,
    QPainter,
    QPalette,
    QPixmap,
)
from PySide6.QtSvg import QSvgRenderer

from handcal.resources import resource_path

SPACING_PX = 8
"""The unit of all margins and gaps, in device-independent pixels; use 0.5, 1, 2 or 3 of it."""


@dataclass(frozen=True, slots=True)
class Colors:
    """Colours with a meaning; everything else comes from the palette.

    Attributes
    ----------
    live, cursor : str
        The live hand while it may be confirmed, and the frozen one.
    red : str
        The live hand beyond the guard, and whatever is wrong.
    good, warning : str
    left, right : str
        The two eyes in plots.
    muted : str
        Less important text and grid lines.
    canvas : str
        Background of pictures and plots.
    """

    live: str
    cursor: str
    red: str
    good: str
    warning: str
    left: str
    right: str
    muted: str
    canvas: str


_LIGHT = Colors(
    live="#1f6fd6",
    cursor="#8a5a00",
    red="#c62828",
    good="#2e7d32",
    warning="#a15c00",
    left="#00707a",
    right="#8e3fa8",
    muted="#6b7280",
    canvas="#fbfbfc",
)
_DARK = Colors(
    live="#5aa2ff",
    cursor="#f0c060",
    red="#ff6b61",
    good="#6ccb72",
    warning="#f2b04c",
    left="#4dd0d9",
    right="#d391ea",
    muted="#9aa3ae",
    canvas="#16181c",
)


def use_theme(theme: Literal["system", "light", "dark"]) -> None:
    """Follow the system's colours, or not."""
    schemes = {
        "system": Qt.ColorScheme.Unknown,
        "light": Qt.ColorScheme.Light,
        "dark": Qt.ColorScheme.Dark,
    }
    hints = QGuiApplication.styleHints()
    QGuiApplication.setPalette(QPalette())
    hints.setColorScheme(schemes[theme])
    if theme == "dark" and hints.colorScheme() != Qt.ColorScheme.Dark:
        QGuiApplication.setPalette(_dark_palette())  # a plain X display knows no schemes


def is_dark() -> bool:
    """Whether the system, or the user, asks for dark."""
    return QGuiApplication.palette().window().color().lightness() < 128


def colors() -> Colors:
    """Return the colours of the present scheme; ask anew on ``QEvent.Type.PaletteChange``."""
    return _DARK if is_dark() else _LIGHT


def number_font(scale: float = 1.0) -> QFont:
    """Return a font whose digits are equally wide, so that changing numbers do not jump."""
    font = QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont)
    font.setPointSizeF(scale * QGuiApplication.font().pointSizeF())
    return font


def icon(name: str, color: str = "") -> QIcon:
    """Return the icon ``resources/icons/NAME.svg``, in the palette's text colour or another."""
    svg = resource_path(f"icons/{name}.svg").read_bytes()
    result = QIcon()
    text = QGuiApplication.palette().windowText().color()
    for mode, shade in (
        (QIcon.Mode.Normal, QColor(color) if color else text),
        (QIcon.Mode.Disabled, QColor(colors().muted)),
    ):
        tinted = svg.replace(b"currentColor", shade.name().encode())
        for size_px in (16, 24, 32, 48, 64):
            result.addPixmap(_draw(tinted, size_px), mode)
    return result


def _dark_palette() -> QPalette:
    palette = QPalette(QColor("#3a3d42"), QColor("#2b2d31"))
    for role, color in (
        (QPalette.ColorRole.Base, "#1e2023"),
        (QPalette.ColorRole.AlternateBase, "#25272b"),
        (QPalette.ColorRole.ToolTipBase, "#3a3d42"),
        (QPalette.ColorRole.ToolTipText, "#eceef1"),
        (QPalette.ColorRole.Text, "#eceef1"),
        (QPalette.ColorRole.WindowText, "#eceef1"),
        (QPalette.ColorRole.ButtonText, "#eceef1"),
        (QPalette.ColorRole.PlaceholderText, _DARK.muted),
        (QPalette.ColorRole.Highlight, "#2f6fb5"),
        (QPalette.ColorRole.HighlightedText, "#ffffff"),
        (QPalette.ColorRole.Link, _DARK.live),
    ):
        palette.setColor(role, QColor(color))
    for role in (
        QPalette.ColorRole.Text,
        QPalette.ColorRole.WindowText,
        QPalette.ColorRole.ButtonText,
    ):
        palette.setColor(QPalette.ColorGroup.Disabled, role, QColor("#7d848d"))
    return palette


def _draw(svg: bytes, size_px: int) -> QPixmap:
    pixmap = QPixmap(size_px, size_px)
    pixmap.fill(Qt.GlobalColor.transparent)
    painter = QPainter(pixmap)
    QSvgRenderer(QByteArray(svg)).render(painter, QRectF(0, 0, size_px, size_px))
    painter.end()
    return pixmap

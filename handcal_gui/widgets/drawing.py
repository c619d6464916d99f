"""The manual's drawings, in the colours of the theme."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QByteArray, QPointF, QRectF, QSizeF, Qt
from PySide6.QtGui import QColor, QGuiApplication, QPainter, QPaintEvent
from PySide6.QtSvg import QSvgRenderer
from PySide6.QtWidgets import QSizePolicy, QWidget

from handcal.io.resources import resource_path
from handcal_gui.app.theme import colors, follow_theme
from handcal_gui.app.translation import tr

_LARGEST_SCALE = 1.25
"""At which the text is half as large again as the window's."""
_LIVE_SHARE = 0.18
"""Of the live colour in filled parts, which hide the lines below them."""


def themed_drawing(path: Path) -> QByteArray:
    """Return an SVG drawing, made in black on white, in the colours of the theme.

    Raises
    ------
    OSError
        If it cannot be read.
    """
    palette = QGuiApplication.palette()
    svg = path.read_text("utf-8")
    for drawn, shown in {
        "'#222'": f"'{palette.text().color().name()}'",
        "'#fff'": f"'{palette.base().color().name()}'",
        "'#888'": f"'{colors().muted}'",
        "'#dde6f0'": f"'{_mixed(palette.base().color(), QColor(colors().live)).name()}'",
    }.items():
        svg = svg.replace(drawn, shown)
    return QByteArray(svg.encode())


def _mixed(ground: QColor, live: QColor) -> QColor:
    def part(one: int, other: int) -> int:
        return round(one + _LIVE_SHARE * (other - one))

    return QColor(
        part(ground.red(), live.red()),
        part(ground.green(), live.green()),
        part(ground.blue(), live.blue()),
    )


class Drawing(QWidget):
    """Shows a shipped SVG drawing, as large as fits and its text is not too large.

    Parameters
    ----------
    page : str
        As for `resource_path`.
    """

    def __init__(self, page: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("drawing")
        self.setAccessibleName(tr("Drawing of the arrangement"))
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self._path = resource_path(page)
        self._renderer = QSvgRenderer(self)
        follow_theme(self, self._load)

    @property
    def is_readable(self) -> bool:
        """True if the drawing was found and can be drawn."""
        return self._renderer.isValid()

    def paintEvent(self, _: QPaintEvent) -> None:
        """Draw as large as fits."""
        painter = QPainter(self)
        size = QSizeF(self._renderer.defaultSize())
        room = QSizeF(self.size()).boundedTo(size * _LARGEST_SCALE)
        size.scale(room, Qt.AspectRatioMode.KeepAspectRatio)
        place = QRectF(QPointF(), size)
        place.moveCenter(QRectF(self.rect()).center())
        self._renderer.render(painter, place)
        painter.end()

    def _load(self) -> None:
        self._renderer.load(themed_drawing(self._path))
        self._renderer.setAspectRatioMode(Qt.AspectRatioMode.KeepAspectRatio)

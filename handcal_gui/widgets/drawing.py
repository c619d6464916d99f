"""The manual's drawings, in the colours of the theme."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QByteArray, QPointF, QRectF, QSizeF, Qt
from PySide6.QtGui import QGuiApplication, QPainter, QPaintEvent
from PySide6.QtSvg import QSvgRenderer
from PySide6.QtWidgets import QSizePolicy, QWidget

from handcal.io.resources import resource_path
from handcal_gui.theme import colors, follow_theme
from handcal_gui.translation import tr

_LIVE_OPACITY = 0.18
"""Of the live colour in filled parts."""


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
        "'#dde6f0'": f"'{colors().live}' fill-opacity='{_LIVE_OPACITY}'",
    }.items():
        svg = svg.replace(drawn, shown)
    return QByteArray(svg.encode())


class Drawing(QWidget):
    """Shows a shipped SVG drawing, as large as fits.

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
        size.scale(QSizeF(self.size()), Qt.AspectRatioMode.KeepAspectRatio)
        place = QRectF(QPointF(), size)
        place.moveCenter(QRectF(self.rect()).center())
        self._renderer.render(painter, place)
        painter.end()

    def _load(self) -> None:
        self._renderer.load(themed_drawing(self._path))
        self._renderer.setAspectRatioMode(Qt.AspectRatioMode.KeepAspectRatio)

"""The manual's drawings, in the window."""

from __future__ import annotations

from PySide6.QtCore import QPointF, QRectF, QSizeF, Qt
from PySide6.QtGui import QPainter, QPaintEvent
from PySide6.QtSvg import QSvgRenderer
from PySide6.QtWidgets import QSizePolicy, QWidget

from handcal.io.resources import resource_path
from handcal_gui.translation import tr


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
        self._renderer = QSvgRenderer(str(resource_path(page)), self)
        self._renderer.setAspectRatioMode(Qt.AspectRatioMode.KeepAspectRatio)

    @property
    def is_readable(self) -> bool:
        """True if the drawing was found and can be drawn."""
        return self._renderer.isValid()

    def paintEvent(self, _: QPaintEvent) -> None:
        """Draw on white, in which the drawings are made."""
        painter = QPainter(self)
        size = QSizeF(self._renderer.defaultSize())
        size.scale(QSizeF(self.size()), Qt.AspectRatioMode.KeepAspectRatio)
        place = QRectF(QPointF(), size)
        place.moveCenter(QRectF(self.rect()).center())
        painter.fillRect(place, Qt.GlobalColor.white)
        self._renderer.render(painter, place)
        painter.end()

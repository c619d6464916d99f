"""A map of the image areas in which the board was seen."""

from __future__ import annotations

from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from handcal.rig.views import Coverage
from handcal_gui.theme import SPACING_PX, colors
from handcal_gui.translation import tr

_PLENTY = 6
"""Number of views from which on a cell has its full colour."""
_CELL_PX = 20, 16


class CoverageMap(QWidget):
    """Shows the number of views with a corner in each cell of the image, by colour and digits.

    Parameters
    ----------
    title : str
        Name of the camera.
    """

    def __init__(self, title: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("coverage")
        self.setAccessibleName(tr("Coverage, {}").format(title.lower()))
        self.setToolTip(
            tr(
                "Number of images with a corner of the board in each part of the view. Empty parts "
                "give no information about the lens there."
            )
        )
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self._title = title
        self._coverage: Coverage | None = None
        width, height = _CELL_PX
        self.setFixedSize(8 * width + 1, 6 * height + 3 * SPACING_PX + 1)

    def show_coverage(self, coverage: Coverage | None) -> None:
        """Show the coverage; None if there are no corners yet."""
        self._coverage = coverage
        self.setAccessibleDescription(self.caption)
        self.update()

    @property
    def caption(self) -> str:
        """The text above the cells."""
        share = "–" if self._coverage is None else f"{100 * self._coverage.share:.0f} %"
        return f"{self._title}: {share}"

    def paintEvent(self, _: QPaintEvent) -> None:
        """Draw the cells below the caption."""
        painter = QPainter(self)
        painter.setPen(self.palette().windowText().color())
        head = QRectF(0, 0, self.width(), 3 * SPACING_PX)
        painter.drawText(head, Qt.AlignmentFlag.AlignVCenter, self.caption)
        font = painter.font()
        font.setPointSizeF(0.8 * font.pointSizeF())
        painter.setFont(font)
        width, height = _CELL_PX
        for row in range(6):
            for column in range(8):
                cell = QRectF(column * width, row * height + 3 * SPACING_PX, width, height)
                self._paint_cell(painter, cell, self._hits(row, column))
        painter.end()

    def _hits(self, row: int, column: int) -> int:
        return 0 if self._coverage is None else int(self._coverage.hits[row, column])

    def _paint_cell(self, painter: QPainter, cell: QRectF, hits: int) -> None:
        fill = QColor(colors().live)
        fill.setAlphaF(0.7 * min(1.0, hits / _PLENTY))
        painter.fillRect(cell, self.palette().base())
        painter.fillRect(cell, fill)
        painter.setPen(QColor(colors().muted))
        painter.drawRect(cell)
        if hits:
            painter.setPen(self.palette().windowText().color())
            painter.drawText(cell, Qt.AlignmentFlag.AlignCenter, str(hits))

"""Maps of a camera's image: where the board was seen, and how uncertain the projection is."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np
from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from handcal.rig.boards.views import Coverage
from handcal.rig.lens.uncertainty import GRID, ProjectionUncertainty
from handcal_gui.app.theme import SPACING_PX, colors
from handcal_gui.app.translation import tr

_PLENTY = 6
"""Number of views from which on a cell has its full colour."""
_WIDTH_PX, _HEIGHT_PX = 160, 96
HEAD_PX = 3 * SPACING_PX


class CellMap(QWidget):
    """A camera's image in cells, below a caption.

    Parameters
    ----------
    title : str
        Name of the camera.
    grid : (int, int)
        Columns and rows.
    """

    def __init__(self, title: str, grid: tuple[int, int]) -> None:
        super().__init__()
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Preferred)
        self.setFixedWidth(_WIDTH_PX + 1)
        self.setMinimumHeight(_HEIGHT_PX // 2 + HEAD_PX + 1)
        self.setMaximumHeight(self.sizeHint().height())
        self._title = title
        self._grid = grid

    @property
    @abstractmethod
    def caption(self) -> str:
        """The text above the cells."""

    def sizeHint(self) -> QSize:
        """Return the size at which the digits are well legible."""
        return QSize(_WIDTH_PX + 1, _HEIGHT_PX + HEAD_PX + 1)

    def refresh(self) -> None:
        """Show what has changed."""
        self.setAccessibleDescription(self.caption)
        self.update()

    def paintEvent(self, _: QPaintEvent) -> None:
        """Draw the cells below the caption."""
        painter = QPainter(self)
        painter.setPen(self.palette().windowText().color())
        head = QRectF(0, 0, self.width(), HEAD_PX)
        painter.drawText(head, Qt.AlignmentFlag.AlignVCenter, self.caption)
        font = painter.font()
        font.setPointSizeF(0.8 * font.pointSizeF())
        painter.setFont(font)
        columns, rows = self._grid
        width, height = _WIDTH_PX / columns, (self.height() - HEAD_PX - 1) / rows
        for row in range(rows):
            for column in range(columns):
                cell = QRectF(column * width, row * height + HEAD_PX, width, height)
                painter.fillRect(cell, self.palette().base())
                painter.setPen(QColor(colors().muted))
                painter.drawRect(cell)
                self.paint_cell(painter, cell, row, column)
        painter.end()

    @abstractmethod
    def paint_cell(self, painter: QPainter, cell: QRectF, row: int, column: int) -> None:
        """Draw a cell's contents into its frame."""


def shade(painter: QPainter, cell: QRectF, opacity: float) -> None:
    """Fill a cell with the colour of what is measured, and draw its frame."""
    fill = QColor(colors().live)
    fill.setAlphaF(opacity)
    painter.fillRect(cell, fill)
    painter.drawRect(cell)


class CoverageMap(CellMap):
    """Shows the number of views with a corner in each cell of the image, by colour and digits."""

    def __init__(self, title: str) -> None:
        super().__init__(title, (8, 6))
        self.setObjectName("coverage")
        self.setAccessibleName(tr("Coverage, {}").format(title.lower()))
        self.setToolTip(
            tr(
                "Number of images with a corner of the board in each part of the view. Empty parts "
                "give no information about the lens there."
            )
        )
        self._coverage: Coverage | None = None

    def show_coverage(self, coverage: Coverage | None) -> None:
        """Show the coverage; None if there are no corners yet."""
        self._coverage = coverage
        self.refresh()

    @property
    def caption(self) -> str:
        """The text above the cells."""
        share = "–" if self._coverage is None else f"{100 * self._coverage.share:.0f} %"
        return f"{self._title}: {share}"

    def paint_cell(self, painter: QPainter, cell: QRectF, row: int, column: int) -> None:
        """Draw the number of views with a corner there."""
        hits = 0 if self._coverage is None else int(self._coverage.hits[row, column])
        if hits:
            shade(painter, cell, 0.7 * min(1.0, hits / _PLENTY))
            painter.setPen(self.palette().windowText().color())
            painter.drawText(cell, Qt.AlignmentFlag.AlignCenter, str(hits))


_LARGE_PX = 1.0
"""Uncertainty from which on a cell has its full colour."""


class UncertaintyMap(CellMap):
    """Shows by colour how uncertain the direction of a pixel is in each part of the image."""

    def __init__(self, title: str) -> None:
        super().__init__(title, GRID)
        self.setObjectName("uncertainty")
        self.setAccessibleName(tr("Uncertainty, {}").format(title.lower()))
        self.setToolTip(
            tr(
                "Standard deviation of the pixel at which a distant point appears; dark from 1 px "
                "on. Take images with the board in the dark parts. Crossed: not known."
            )
        )
        self._uncertainty: ProjectionUncertainty | None = None

    def show_uncertainty(self, uncertainty: ProjectionUncertainty | None) -> None:
        """Show the uncertainty; None if the camera was not solved."""
        self._uncertainty = uncertainty
        self.refresh()

    @property
    def caption(self) -> str:
        """The text above the cells."""
        if self._uncertainty is None:
            return f"{self._title}: –"
        found = self._uncertainty
        return f"{self._title}: ± {found.middle_px:.2f}, {found.edge_px:.2f} px"

    def paint_cell(self, painter: QPainter, cell: QRectF, row: int, column: int) -> None:
        """Draw the uncertainty there."""
        if self._uncertainty is None:
            return
        sigma_px = float(self._uncertainty.sigma_px[row, column])
        if np.isfinite(sigma_px):
            shade(painter, cell, 0.9 * min(1.0, sigma_px / _LARGE_PX))
        else:
            painter.drawLine(cell.topLeft(), cell.bottomRight())

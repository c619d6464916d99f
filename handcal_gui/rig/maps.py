"""Maps of a camera's image: where the board was seen, and how uncertain the projection is."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from handcal.core.types import Float64
from handcal.rig.boards.views import Coverage
from handcal.rig.lens.uncertainty import GRID, ProjectionUncertainty
from handcal_gui.app.theme import SPACING_PX, colors
from handcal_gui.app.translation import tr
from handcal_gui.widgets.fields import with_name

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
    name, label, tooltip : str
        Object name, what is shown, and its meaning.
    """

    def __init__(self, title: str, name: str, label: str, tooltip: str) -> None:
        super().__init__()
        with_name(self, name, label, tooltip)
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Preferred)
        self.setFixedWidth(_WIDTH_PX + 1)
        self.setMinimumHeight(_HEIGHT_PX // 2 + HEAD_PX + 1)
        self.setMaximumHeight(self.sizeHint().height())
        self._title = title
        self.caption = ""
        self._cells: list[list[tuple[float, str]]] = []

    def sizeHint(self) -> QSize:
        """Return the size at which the digits are well legible."""
        return QSize(_WIDTH_PX + 1, _HEIGHT_PX + HEAD_PX + 1)

    def show_cells(self, told: str, shades: Float64, texts: Sequence[Sequence[str]]) -> None:
        """Show the title and a text above the cells.

        Parameters
        ----------
        told : str
        shades : (rows, columns)
            Opacity of each cell's colour, 0..1; NaN for one that is crossed.
        texts : sequence of sequence of str
            In each cell.
        """
        self.caption = f"{self._title}: {told}"
        self._cells = [
            list(zip(*row, strict=True)) for row in zip(shades.tolist(), texts, strict=True)
        ]
        self.setAccessibleDescription(self.caption)
        self.update()

    def paintEvent(self, _: QPaintEvent) -> None:
        """Draw the cells below the caption."""
        painter = QPainter(self)
        text, frame = self.palette().windowText().color(), QColor(colors().muted)
        painter.setPen(text)
        head = QRectF(0, 0, self.width(), HEAD_PX)
        painter.drawText(head, Qt.AlignmentFlag.AlignVCenter, self.caption)
        font = painter.font()
        font.setPointSizeF(0.8 * font.pointSizeF())
        painter.setFont(font)
        height = (self.height() - HEAD_PX - 1) / len(self._cells)
        for row, cells in enumerate(self._cells):
            width = _WIDTH_PX / len(cells)
            for column, (opacity, number) in enumerate(cells):
                cell = QRectF(column * width, row * height + HEAD_PX, width, height)
                painter.fillRect(cell, self.palette().base())
                painter.setPen(frame)
                if math.isnan(opacity):
                    painter.drawLine(cell.topLeft(), cell.bottomRight())
                else:
                    fill = QColor(colors().live)
                    fill.setAlphaF(opacity)
                    painter.fillRect(cell, fill)
                painter.drawRect(cell)
                painter.setPen(text)
                painter.drawText(cell, Qt.AlignmentFlag.AlignCenter, number)
        painter.end()


class CoverageMap(CellMap):
    """Shows the number of views with a corner in each cell of the image, by colour and digits."""

    def __init__(self, title: str) -> None:
        super().__init__(
            title,
            "coverage",
            tr("Coverage, {}").format(title.lower()),
            tr(
                "Number of images with a corner of the board in each part of the view. Empty parts "
                "give no information about the lens there."
            ),
        )
        self.show_coverage(None)

    def show_coverage(self, coverage: Coverage | None) -> None:
        """Show the coverage; None if there are no corners yet."""
        hits = np.zeros((6, 8), int) if coverage is None else coverage.hits
        told = "–" if coverage is None else f"{100 * coverage.share:.0f} %"
        texts = [[str(number or "") for number in row] for row in hits.tolist()]
        self.show_cells(told, 0.7 * np.minimum(1.0, hits / _PLENTY), texts)


class UncertaintyMap(CellMap):
    """Shows by colour how uncertain the direction of a pixel is in each part of the image."""

    def __init__(self, title: str) -> None:
        super().__init__(
            title,
            "uncertainty",
            tr("Uncertainty, {}").format(title.lower()),
            tr(
                "Standard deviation of the pixel at which a distant point appears; dark from 1 px "
                "on. Take images with the board in the dark parts. Crossed: not known."
            ),
        )
        self.show_uncertainty(None)

    def show_uncertainty(self, found: ProjectionUncertainty | None) -> None:
        """Show the uncertainty; None if the camera was not solved."""
        sigma_px = np.zeros(GRID[::-1]) if found is None else found.sigma_px
        told = "–" if found is None else f"± {found.middle_px:.2f}, {found.edge_px:.2f} px"
        shades = 0.9 * np.minimum(1.0, np.where(np.isfinite(sigma_px), sigma_px, np.nan))
        self.show_cells(told, shades, [len(row) * ("",) for row in sigma_px])

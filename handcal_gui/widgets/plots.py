"""Plots; the only module that configures pyqtgraph."""

from __future__ import annotations

from typing import Any

import pyqtgraph as pg
from PySide6.QtCore import QSize, Qt
from PySide6.QtWidgets import QWidget

from handcal.report.cells import with_minus
from handcal_gui.app.theme import SPACING_PX, colors, follow_theme
from handcal_gui.widgets.layouts import vbox

pg.setConfigOptions(antialias=True)

_LINE_PX = 2
_SYMBOL_PX = 6
_LEGEND_COLUMNS = 9


class Plot(QWidget):
    """A non-interactive plot in the program's colours.

    Parameters
    ----------
    name : str
        Object name, the same in every language.
    label : str
        For screen readers.
    x_label, y_label : str
        With their units.
    parent : QWidget or None

    Attributes
    ----------
    item : pyqtgraph.PlotItem
        Plot item, for ranges and for items other than lines.
    """

    def __init__(
        self, name: str, label: str, x_label: str, y_label: str, parent: QWidget | None = None
    ) -> None:
        super().__init__(parent)
        self.setObjectName(name)
        self.setAccessibleName(label)
        self._lines: list[tuple[pg.PlotDataItem, str, bool]] = []
        self._texts: list[pg.TextItem] = []
        axes = {side: _Axis(side) for side in ("bottom", "left")}
        self._view = pg.PlotWidget(enableMenu=False, axisItems=axes)
        self._view.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self._view.setMinimumSize(100, 44)
        self.item = self._view.getPlotItem()
        # Never shown, it would outlive this; as a child, its fields would be among the panel's.
        self.destroyed.connect(self.item.ctrlMenu.deleteLater)
        self.item.hideButtons()
        self.item.setContentsMargins(*4 * (SPACING_PX // 2,))
        self.item.setMouseEnabled(x=False, y=False)
        for side, axis_label in (("bottom", x_label), ("left", y_label)):
            self.item.getAxis(side).enableAutoSIPrefix(False)
            self.item.setLabel(side, axis_label)
        vbox(self._view, on=self, margins=0)
        follow_theme(self, self._recolor)

    def sizeHint(self) -> QSize:
        """Prefer a size with space for the axes."""
        return QSize(300, 200)

    def show_legend(self) -> None:
        """Show a legend in a row above the plot, with each name once."""
        legend = pg.LegendItem(colCount=_LEGEND_COLUMNS, verSpacing=0)
        legend.layout.setContentsMargins(0, 0, 0, 0)
        legend.setParentItem(self.item)
        legend.anchor((1, 0), (1, 0))
        self.item.legend = legend
        self.item.layout.setRowFixedHeight(0, self.fontMetrics().height() + SPACING_PX // 2)
        self._recolor()

    def add_line(
        self, role: str, *, name: str | None = None, dashed: bool = False, symbol: str | None = None
    ) -> Any:
        """Add an empty line and return its pyqtgraph `PlotDataItem`.

        Parameters
        ----------
        role : str
            A field of `handcal_gui.app.theme.Colors`.
        name : str or None
            Name in the legend.
        dashed : bool
            Also draws larger, hollow symbols, so that the line differs from others not only by
            colour and is visible in front of them.
        symbol : str or None
            pyqtgraph's symbol at each point, such as ``"o"``.
        """
        named = {line.name() for line, _, _ in self._lines}
        line = self.item.plot(
            name=None if name in named else name,
            symbol=symbol,
            symbolSize=_SYMBOL_PX * (1.8 if dashed else 1.0),
            connect="finite",
        )
        self._lines.append((line, role, dashed))
        _color_line(line, role, dashed)
        return line

    def add_text(self, text: str, x: float, y: float) -> None:
        """Add a text to the right of a point, apart from its symbol."""
        written = pg.TextItem(text, self.palette().windowText().color())
        written.setAnchor((-2.0 * _SYMBOL_PX / max(written.boundingRect().width(), 1.0), 0.5))
        written.setPos(x, y)
        self.item.addItem(written)
        self._texts.append(written)

    def clear(self) -> None:
        """Remove all lines and texts."""
        for item in (*(line for line, _, _ in self._lines), *self._texts):
            self.item.removeItem(item)
        self._lines.clear()
        self._texts.clear()

    def _recolor(self) -> None:
        now, text = colors(), self.palette().windowText().color()
        self._view.setBackground(now.canvas)
        for side in ("bottom", "left"):
            self.item.getAxis(side).setPen(now.muted)
            self.item.getAxis(side).setTextPen(text)
        if self.item.legend is not None:
            self.item.legend.setLabelTextColor(text)
            for _, label in self.item.legend.items:
                label.setText(label.text)  # pyqtgraph applies the new colour only here
        for written in self._texts:
            written.setColor(text)
        for line in self._lines:
            _color_line(*line)


class _Axis(pg.AxisItem):  # type: ignore[misc]  # pyqtgraph has no types
    """An axis whose negative numbers have a minus, not a hyphen."""

    def tickStrings(self, values: list[float], scale: float, spacing: float) -> list[str]:
        return [with_minus(text) for text in super().tickStrings(values, scale, spacing)]


def _color_line(line: pg.PlotDataItem, role: str, dashed: bool) -> None:
    color = getattr(colors(), role)
    style = Qt.PenStyle.DashLine if dashed else Qt.PenStyle.SolidLine
    line.setPen(pg.mkPen(color, width=_LINE_PX, style=style))
    line.setSymbolPen(color)
    line.setSymbolBrush(None if dashed else color)

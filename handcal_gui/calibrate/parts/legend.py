"""Legend entries: a colour sample, a name or switch, and a number."""

from __future__ import annotations

from PySide6.QtCore import QLineF, QRectF, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QCheckBox, QLabel, QSizePolicy, QWidget

from handcal_gui.app.theme import SPACING_PX, colors
from handcal_gui.calibrate.parts.residual_scale import fill_with_ramp
from handcal_gui.widgets.layouts import hbox
from handcal_gui.widgets.number_label import NumberLabel

RESIDUALS = "residuals"
"""The role of points that are coloured by their residuals."""
_LINE_PX, _POINTS_PX = (22, 14), (14, 14)
"""Sizes of samples."""


def role_color(role: str, widget: QWidget) -> QColor:
    """Return a colour by its meaning: a field of `Colors`, or ``"text"``, the widget's own."""
    text = widget.palette().windowText().color()
    return text if role == "text" else QColor(getattr(colors(), role))


class LegendEntry(QWidget):
    """A colour sample with a name, which may be a switch, and optionally a number of fixed width.

    Parameters
    ----------
    key : str
        Object names are made of it, the same in every language.
    name : QLabel or QCheckBox
        Shows the name; a check box shows and hides what it names.
    role : str
        See `role_color`; or `RESIDUALS`.
    tooltip : str
    line : (float, Qt.PenStyle) or None
        Width in pixels and style of its line; None for points.
    widest : str
        The number's widest text; empty if it has none.
    """

    def __init__(
        self,
        key: str,
        name: QLabel | QCheckBox,
        role: str,
        tooltip: str,
        line: tuple[float, Qt.PenStyle] | None = None,
        widest: str = "",
    ) -> None:
        super().__init__()
        self.setObjectName(f"legend-{key}")
        self.setToolTip(tooltip)
        self._sample = _Sample(role, line)
        self._name = name
        self._name.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        self._number = NumberLabel(f"{self.objectName()}-number", widest, tooltip)
        if not widest:
            self._number.hide()  # shown, it would be a window: it has no parent yet
        hbox(self._sample, self._name, self._number, on=self, margins=0, spacing=SPACING_PX // 2)

    @property
    def text(self) -> str:
        """Name and number."""
        return f"{self._name.text()} {self._number.text()}"

    def show_name(self, name: str, role: str) -> None:
        """Change the name and the colour."""
        self._name.setText(name)
        self._sample.show_role(role)

    def show_number(self, number: str) -> None:
        """Show a number with its unit."""
        self._number.setText(number)


class _Sample(QWidget):
    """A sample of a line, or of a surface of points."""

    def __init__(self, role: str, line: tuple[float, Qt.PenStyle] | None) -> None:
        super().__init__()
        self._role = role
        self._line = line
        self.setFixedSize(*(_POINTS_PX if line is None else _LINE_PX))

    def show_role(self, role: str) -> None:
        if role != self._role:
            self._role = role
            self.update()

    def paintEvent(self, _: QPaintEvent) -> None:
        painter = QPainter(self)
        if self._role == RESIDUALS:
            fill_with_ramp(painter, QRectF(self.rect()))
            return
        color = role_color(self._role, self)
        if self._line is None:
            painter.fillRect(self.rect(), color)
            return
        width_px, style = self._line
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        across = self.height() // 2 + 0.5 * (round(width_px) % 2)  # or its edges are blurred
        painter.setPen(QPen(color, width_px, style, Qt.PenCapStyle.FlatCap))
        painter.drawLine(QLineF(0, across, self.width(), across))

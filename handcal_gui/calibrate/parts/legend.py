"""Legend entries: a colour sample, a name or switch, and a number."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache

from PySide6.QtCore import QLineF, QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QImage, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QCheckBox, QLabel, QSizePolicy, QWidget

from handcal_gui.app.theme import SPACING_PX, colors
from handcal_gui.calibrate.parts.residual_scale import fill_with_ramp
from handcal_gui.widgets.layouts import hbox
from handcal_gui.widgets.number_label import NumberLabel

RESIDUALS = "residuals"
"""The role of points that are coloured by their residuals."""
_LINE_PX, _POINTS_PX = (22, 14), (14, 14)
"""Sizes of samples."""
HALO_PX = 2.0
"""Added to the width of a line for that of its ground over an image."""
DOTS_APART = 7 / 3
"""Distance from dot to dot, in widths of the line: their halos do not touch."""
_ON_IMAGE = "#87918c"
"""Ground of samples of what is drawn over an image: no world is lighter or darker on average."""


def role_color(role: str, widget: QWidget) -> QColor:
    """Return a colour by its meaning: a field of `Colors`, or ``"text"``, the widget's own."""
    text = widget.palette().windowText().color()
    return text if role == "text" else QColor(getattr(colors(), role))


def draw_dots(
    painter: QPainter,
    places: Iterable[tuple[int, int]],
    color: QColor,
    width_px: float,
    halo: str = "",
) -> None:
    """Draw dots as wide as a line around pixels of a widget, optionally with halos of a colour."""
    dot = _dot(color.name(), width_px, halo, painter.device().devicePixelRatio())
    corner_px = int(width_px + HALO_PX) // 2
    for x, y in places:
        painter.drawImage(x - corner_px, y - corner_px, dot)  # faster than with a QPoint


@lru_cache(maxsize=32)
def _dot(color: str, width_px: float, halo: str, ratio: float) -> QImage:
    """Return a dot, which Qt copies several times faster than it draws one."""
    side_px = int(width_px + HALO_PX)
    dot = QImage(*2 * (round(ratio * side_px),), QImage.Format.Format_ARGB32_Premultiplied)
    dot.setDevicePixelRatio(ratio)
    dot.fill(Qt.GlobalColor.transparent)
    painter = QPainter(dot)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.setPen(Qt.PenStyle.NoPen)
    for shade, across_px in ((halo, side_px), (color, width_px)):
        if shade:
            painter.setBrush(QColor(shade))
            painter.drawEllipse(QPointF(side_px / 2, side_px / 2), across_px / 2, across_px / 2)
    painter.end()
    return dot


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

    def show_on_image(self, is_on_image: bool) -> None:
        """Show a line as it is drawn over an image, or on its own."""
        self._sample.show_on_image(is_on_image)

    def show_number(self, number: str) -> None:
        """Show a number with its unit."""
        self._number.setText(number)


class _Sample(QWidget):
    """A sample of a line, or of a surface of points."""

    def __init__(self, role: str, line: tuple[float, Qt.PenStyle] | None) -> None:
        super().__init__()
        self._role = role
        self._line = line
        self._is_on_image = False
        self.setFixedSize(*(_POINTS_PX if line is None else _LINE_PX))

    def show_role(self, role: str) -> None:
        if role != self._role:
            self._role = role
            self.update()

    def show_on_image(self, is_on_image: bool) -> None:
        if is_on_image != self._is_on_image:
            self._is_on_image = is_on_image
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
        halo = colors().canvas if self._is_on_image else ""
        if halo:
            painter.fillRect(self.rect(), QColor(_ON_IMAGE))
        middle = self.height() // 2
        if style is Qt.PenStyle.DotLine:
            apart_px = round(DOTS_APART * width_px)
            xs = range(apart_px // 2, self.width(), apart_px)
            draw_dots(painter, ((x, middle) for x in xs), color, width_px, halo)
            return
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        across = middle + 0.5 * (round(width_px) % 2)  # or its edges are blurred
        line = QLineF(0, across, self.width(), across)
        flat = Qt.PenCapStyle.FlatCap
        if halo:
            painter.setPen(QPen(QColor(halo), width_px + HALO_PX, Qt.PenStyle.SolidLine, flat))
            painter.drawLine(line)
        painter.setPen(QPen(color, width_px, style, flat))
        painter.drawLine(line)

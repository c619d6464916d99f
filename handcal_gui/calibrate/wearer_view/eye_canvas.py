"""One eye's view through its display: the world, the hand, and the drawn outlines."""

from __future__ import annotations

import math
from collections.abc import Collection
from itertools import product

import numpy as np
from pyqtgraph.functions import arrayToQPolygonF
from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QColor, QImage, QPainter, QPaintEvent, QPen, QPolygonF, QTransform
from PySide6.QtWidgets import QSizePolicy, QWidget

from handcal.core.types import Float64
from handcal.station.wearer_view import EyeView
from handcal_gui.app.theme import SPACING_PX, colors
from handcal_gui.calibrate.parts.legend import role_color
from handcal_gui.calibrate.parts.paint_turns import update_in_turn

LINES = {
    "hand": ("text", (1.0, Qt.PenStyle.SolidLine)),
    "drawn": ("live", (2.0, Qt.PenStyle.DashLine)),
    "cursor": ("cursor", (3.0, Qt.PenStyle.SolidLine)),
    "offline": ("muted", (2.0, Qt.PenStyle.DotLine)),
}
"""Colour of each kind of outline, and width in pixels and style of its line."""
_DASHES: dict[Qt.PenStyle, tuple[float, float]] = {
    Qt.PenStyle.DashLine: (4.0, 3.0),
    Qt.PenStyle.DotLine: (1.5, 1.5),
}
"""Lengths of dashes and gaps, in widths of the line."""
_HALO_PX = 2.0
"""Added to the width of a line for that of its ground over an image."""
_FEW_POINTS = 120
"""Outlines of so few points, such as a target, are drawn as they are."""
_SMOOTHED_POINTS = 5
"""A hand's outline has a point for each of the camera's pixels on it; so many neighbours are
averaged, which takes away the steps from pixel to pixel and leaves the webs between fingers."""
_SPACING_PX = 12.0
"""Between the points drawn, in pixels of the widget: Qt takes a microsecond or more for each."""
_MARGIN = 0.12
_WIDEST_CROP = 1.8
"""A crop is kept while it contains the hand and is at most this many times as wide or high."""


class EyeCanvas(QWidget):
    """Shows one eye's view, by default the part of the display with the hand and the target.

    Parameters
    ----------
    name : str
        For screen readers.
    parent : QWidget or None
    """

    def __init__(self, name: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setAccessibleName(name)
        self.setMinimumSize(120, 80)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)  # as ImageView
        self._view: EyeView | None = None
        self._image = QImage()
        self._message = ""
        self._crop = self._shown = QRectF()
        self._is_whole = self._is_offline_shown = False
        self._is_drawn_shown = True

    @property
    def crop_px(self) -> QRectF:
        """The part of the display that is shown, in its pixels; more if there is space."""
        return self._shown

    @property
    def display_px(self) -> QRectF:
        """The whole display, in its pixels; empty without a view."""
        return _display(self._view) if self._view else QRectF()

    def show_part(self, part_px: QRectF) -> None:
        """Show another part of the display, until the view changes."""
        if part_px != self._shown:
            self._shown = part_px
            update_in_turn(self)

    def show_view(self, view: EyeView | None, message: str = "") -> None:
        """Show a view, or a message over its dimmed image."""
        if view is self._view and message == self._message:
            return
        if view is not self._view:
            self._image = QImage() if view is None else _qimage(view)
        self._view, self._message = view, message
        self.setAccessibleDescription(message)
        self._choose_crop()
        update_in_turn(self)

    def show_whole(self, is_whole: bool) -> None:
        """Show the whole display, or crop it to the hand."""
        self._is_whole = is_whole
        self._crop = self._shown = QRectF()
        self._choose_crop()
        update_in_turn(self)

    def show_offline(self, is_shown: bool) -> None:
        """Show or hide the outline drawn with the offline projection."""
        self._is_offline_shown = is_shown
        update_in_turn(self)

    def show_drawn(self, is_shown: bool) -> None:
        """Show or hide the outline that the headset draws."""
        self._is_drawn_shown = is_shown
        update_in_turn(self)

    def paintEvent(self, _: QPaintEvent) -> None:
        """Draw the world and the outlines, or the message."""
        painter = QPainter(self)
        ground = self.palette().window().color()
        painter.fillRect(self.rect(), ground)
        if self._view is not None:
            self._paint_world(painter, self._view)
        if self._message:
            ground.setAlphaF(0.75)
            painter.fillRect(self.rect(), ground)
            painter.setPen(self.palette().windowText().color())
            within = self._place().adjusted(SPACING_PX, SPACING_PX, -SPACING_PX, -SPACING_PX)
            flags = Qt.AlignmentFlag.AlignCenter.value | Qt.TextFlag.TextWordWrap.value
            painter.drawText(within, flags, self._message)
        elif self._view is not None:
            self._paint_outlines(painter, self._view)

    def _paint_world(self, painter: QPainter, view: EyeView) -> None:
        painter.save()
        painter.setTransform(self._to_widget(), combine=True)
        painter.drawImage(_display(view), self._image)
        painter.restore()
        painter.setPen(QColor(colors().muted))
        painter.drawRect(self._place().adjusted(0.5, 0.5, -0.5, -0.5))

    def _paint_outlines(self, painter: QPainter, view: EyeView) -> None:
        """Draw the outlines, with halos that keep them visible over any world."""
        outlines = [
            ("hand", view.hand_px),
            ("hand", view.target_px),
            ("cursor", view.cursor_px),
        ]
        if self._is_drawn_shown:
            outlines += [("drawn", view.drawn.outline_px), ("drawn", view.drawn_target_px)]
        if self._is_offline_shown:
            outlines.insert(0, ("offline", view.offline.outline_px))
        to_widget = self._to_widget()
        painter.setClipRect(to_widget.mapRect(_display(view)))
        spacing_px = _SPACING_PX / to_widget.m11()
        lines = [
            (what, to_widget.map(_closed(simplified(px, spacing_px))))
            for what, px in outlines
            if len(px)
        ]
        scale = self.devicePixelRatio()
        if not self._image.isNull():
            for what, line in lines:
                painter.setPen(_pen(colors().canvas, scale * (LINES[what][1][0] + _HALO_PX)))
                painter.drawPolyline(line)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        for what, line in lines:
            role, (width_px, style) = LINES[what]
            pen = _pen(role_color(role, self), 1.0, style)
            if style in _DASHES:
                dash, gap = _DASHES[style]
                pen.setDashPattern([scale * dash * width_px, scale * gap * width_px - 1.0])
            painter.setPen(pen)
            _draw_wide(painter, line, round(scale * width_px))

    def _place(self) -> QRectF:
        """Return the part of the widget that the display takes; all of it without a view."""
        place = QRectF(self.rect())
        if self._view is None:
            return place
        return self._to_widget().mapRect(_display(self._view)).intersected(place)

    def _to_widget(self) -> QTransform:
        """Return the transform that fits the crop into the widget, close to the title above."""
        crop, display = self._shown, _display(self._view) if self._view else self._shown
        scale = min(self.width() / crop.width(), self.height() / crop.height())
        # A display that fits is centred, as its title is: one that follows the hand would jump.
        is_whole = scale * display.width() <= self.width()
        middle = display.center().x() if is_whole else crop.center().x()
        left = self.width() / 2 - scale * middle
        if not is_whole:  # no gap on one side while the other is cut off
            left = min(max(left, self.width() - scale * display.right()), -scale * display.left())
        top = min(self.height() / 2 - scale * crop.center().y(), -scale * display.top())
        return QTransform.fromTranslate(left, top).scale(scale, scale)

    def _choose_crop(self) -> None:
        """Crop to the hand, but keep the present crop while it still fits."""
        if self._view is None:
            return
        display = _display(self._view)
        view = self._view
        drawn_px = (view.drawn.outline_px, view.cursor_px, view.drawn_target_px)
        outlines_px = np.vstack([view.hand_px, *drawn_px, view.target_px])
        hand = _bounds(outlines_px).intersected(display) if len(outlines_px) else QRectF()
        if self._is_whole or hand.isEmpty():
            self._crop = display
        elif not self._crop.contains(hand) or not _is_close(self._crop, hand):
            margin = _MARGIN * max(hand.width(), hand.height())
            self._crop = hand.adjusted(-margin, -margin, margin, margin).intersected(display)
        self._shown = self._crop


def show_alike(canvases: Collection[EyeCanvas]) -> QRectF:
    """Show equally large parts of several displays, with the same rows.

    Returns the part of the last display that is shown, in its pixels; empty without any view.
    """
    part_px = QRectF()
    known = [canvas for canvas in canvases if not canvas.crop_px.isEmpty()]
    if not known:
        return part_px
    parts = [canvas.crop_px for canvas in known]
    top, bottom = min(one.top() for one in parts), max(one.bottom() for one in parts)
    width = max(one.width() for one in parts)
    for canvas, part in zip(known, parts, strict=True):
        display = canvas.display_px
        left = max(part.center().x() - width / 2, display.left())
        left = min(left, display.right() - width)
        part_px = QRectF(left, top, width, bottom - top)
        canvas.show_part(part_px)
    return part_px


def _display(view: EyeView) -> QRectF:
    return QRectF(-0.5, -0.5, view.width_px, view.height_px)


def _bounds(points_px: Float64) -> QRectF:
    (x0, y0), (x1, y1) = points_px.min(axis=0).tolist(), points_px.max(axis=0).tolist()
    return QRectF(x0, y0, x1 - x0, y1 - y0)


def _is_close(crop: QRectF, hand: QRectF) -> bool:
    wider, higher = crop.width() / hand.width(), crop.height() / hand.height()
    return min(wider, higher) < _WIDEST_CROP


def simplified(outline_px: Float64, spacing_px: float) -> Float64:
    """Return a closed outline without the camera's pixel steps, of as few points as it needs.

    Arrays are small: while NumPy works on large ones the engine runs, and the window waits for it.

    Parameters
    ----------
    outline_px : (N, 2) float64
    spacing_px : float
        Distance between points, in the same pixels.

    Returns
    -------
    (M, 2) float64
    """
    if len(outline_px) <= _FEW_POINTS:
        return outline_px
    steps_px = np.diff(outline_px[:_FEW_POINTS], axis=0)
    step_px = math.sqrt(np.sort((steps_px**2).sum(axis=1))[len(steps_px) // 2])  # the median
    every = max(1, int(spacing_px / max(step_px, 1e-9)))
    end = len(outline_px) - _SMOOTHED_POINTS + 1
    neighbours_px = [outline_px[k : end + k : every] for k in range(_SMOOTHED_POINTS)]
    mean_px: Float64 = sum(neighbours_px[1:], neighbours_px[0]) / _SMOOTHED_POINTS
    return mean_px


def _closed(outline_px: Float64) -> QPolygonF:
    line: QPolygonF = arrayToQPolygonF(*np.vstack([outline_px, outline_px[:1]]).T)
    return line


def _draw_wide(painter: QPainter, line: QPolygonF, width: int) -> None:
    """Draw a line, its width in the screen's pixels, as thin ones side by side.

    Qt is many times slower at smooth wide lines.
    """
    px = 1.0 / painter.device().devicePixelRatio()
    offsets = [px * (k - 0.5 * (width - 1)) for k in range(width)]
    for right, down in product(offsets, offsets):
        painter.drawPolyline(line.translated(right, down))


def _pen(color: QColor | str, width: float, style: Qt.PenStyle = Qt.PenStyle.SolidLine) -> QPen:
    """Return a pen that is as wide in the screen's pixels."""
    pen = QPen(QColor(color), width, style, Qt.PenCapStyle.FlatCap, Qt.PenJoinStyle.BevelJoin)
    pen.setCosmetic(True)
    return pen


def _qimage(view: EyeView) -> QImage:
    """Return the view's image in the format that Qt scales fastest; a null image without one."""
    if view.image is None:
        return QImage()
    height, width = view.image.shape[:2]
    rgb = QImage(view.image.data, width, height, 3 * width, QImage.Format.Format_RGB888)
    return rgb.convertToFormat(QImage.Format.Format_RGB32)

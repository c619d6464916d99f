"""The segmented hand drawn over an image."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import cv2
import numpy as np
from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QImage, QPainter, QPen, QTransform

from handcal.calibration.sight import Observation
from handcal.core.types import Bool, Float64, Frame, HandCloud
from handcal.hand.outline import contour_px
from handcal_gui.app.theme import colors

Draw: TypeAlias = Callable[[QPainter], None]
_MASK_ALPHA = 70
_LINE_PX = 2.0
_SMOOTHED_PX = 1.0
"""Largest deviation, as displayed, of the simplified line from the contour."""


@dataclass(frozen=True, slots=True, eq=False)
class HandOverlay:
    """A hand in one image."""

    cloud: HandCloud
    depth_px: Float64
    image_px: Float64
    """(M, 2); its contour in the depth image and in the displayed image."""
    is_red: bool
    """True if it is rotated beyond the limit of the guard."""

    def draw(self, painter: QPainter) -> None:
        """Draw box, mask and contour in the image's pixels; cut edges are dashed."""
        if not len(self.image_px):
            return
        color = QColor(colors().red if self.is_red else colors().live)
        # A contour follows pixels anyway, and antialiasing is five times slower.
        painter.setRenderHint(QPainter.RenderHint.Antialiasing, on=False)
        self._draw_mask(painter, QColor(color))
        strays_px = _SMOOTHED_PX / painter.deviceTransform().m11()
        for points_px, is_cut in contour_runs(self.image_px, self.cloud.contour_is_cut):
            _set_pen(painter, color, Qt.PenStyle.DashLine if is_cut else Qt.PenStyle.SolidLine)
            line_px = cv2.approxPolyDP(points_px.astype(np.float32), strays_px, closed=False)
            painter.drawPolyline([QPointF(x, y) for x, y in line_px.reshape(-1, 2).tolist()])

    def _draw_mask(self, painter: QPainter, color: QColor) -> None:
        x0, y0, x1, y1 = self.cloud.box_px
        step = max(1, int(1.0 / painter.deviceTransform().m11()))
        argb = _MASK_ALPHA << 24
        for channel, shift in ((color.red(), 16), (color.green(), 8), (color.blue(), 0)):
            argb |= channel * _MASK_ALPHA // 255 << shift
        shown = (self.cloud.mask[y0:y1:step, x0:x1:step] & np.uint8(1)) * np.uint32(argb)
        height, width = shown.shape
        # Premultiplied, the one format that Qt need not convert.
        mask = QImage(
            shown.data, width, height, 4 * width, QImage.Format.Format_ARGB32_Premultiplied
        )
        painter.save()
        if self.image_px is not self.depth_px:
            painter.setTransform(_fit(self.depth_px, self.image_px), combine=True)
        painter.drawImage(QRectF(x0 - 0.5, y0 - 0.5, step * width, step * height), mask)
        _set_pen(painter, QColor(colors().muted), Qt.PenStyle.SolidLine)
        painter.drawRect(QRectF(x0 - 0.5, y0 - 0.5, x1 - x0, y1 - y0))
        painter.restore()


def overlays(frame: Frame, seen: Observation) -> tuple[Draw | None, Draw | None]:
    """Return what draws the hand over the depth image and over the colour image, if it is seen."""
    if seen.cloud is None:
        return None, None
    depth_px, color_px = contour_px(seen.cloud, frame)
    return (
        HandOverlay(seen.cloud, depth_px, depth_px, seen.is_over_limit).draw,
        None
        if color_px is None
        else HandOverlay(seen.cloud, depth_px, color_px, seen.is_over_limit).draw,
    )


def contour_runs(points_px: Float64, is_cut: Bool) -> list[tuple[Float64, bool]]:
    """Split a closed contour into open lines along the silhouette and along cut edges.

    Parameters
    ----------
    points_px : (M, 2) float64
    is_cut : (M,) bool

    Returns
    -------
    list of (points_px, is_cut)
        In order; each starts at the end of the previous one.
    """
    count = len(points_px)
    cut_edges = is_cut & np.roll(is_cut, -1)  # edge i runs from point i to the next
    starts = np.flatnonzero(cut_edges != np.roll(cut_edges, 1))
    if not len(starts):
        return [(np.vstack([points_px, points_px[:1]]), bool(cut_edges.any()))]
    ends = np.append(starts[1:], starts[0] + count)
    return [
        (points_px[np.arange(start, end + 1) % count], bool(cut_edges[start]))
        for start, end in zip(starts, ends, strict=True)
    ]


def _fit(source_px: Float64, target_px: Float64) -> QTransform:
    """Return the scale and shift that map the bounding box of points to that of others."""
    # Column by column: ten times as fast as a reduction along the first axis.
    x0, x1, y0, y1 = (end for column in source_px.T for end in (column.min(), column.max()))
    u0, u1, v0, v1 = (end for column in target_px.T for end in (column.min(), column.max()))
    fit = QTransform.fromTranslate(u0, v0)
    fit.scale((u1 - u0) / max(x1 - x0, 1.0), (v1 - v0) / max(y1 - y0, 1.0))
    return fit.translate(-x0, -y0)


def _set_pen(painter: QPainter, color: QColor, style: Qt.PenStyle) -> None:
    """Set a pen whose width does not depend on the screen or the image."""
    pen = QPen(color, _LINE_PX * painter.device().devicePixelRatio(), style)
    pen.setCosmetic(True)
    painter.setPen(pen)

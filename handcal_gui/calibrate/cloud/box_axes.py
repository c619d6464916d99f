"""A bounding box with ticks in millimetres, and a scale bar."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product

import numpy as np
from PySide6.QtCore import QLineF, QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QPainter, QPen

from handcal.core.types import Float64
from handcal.report.cells import with_minus
from handcal_gui.app.theme import SPACING_PX, colors
from handcal_gui.calibrate.cloud.orbit import Orbit

NAMES = ("right", "down", "away")
_GRID_MM = 50.0
_STEPS_MM = (5, 10, 20, 50, 100, 200, 500)
_TICK_GAP_EMS = 3.5
"""Minimum distance between ticks, so that their labels do not touch."""
_LEAST_AXIS_PX = 40.0
"""Minimum length of an axis with ticks; axes along the line of sight are shorter."""


@dataclass(frozen=True, slots=True)
class Box:
    """An axis-aligned box with faces at multiples of 50 mm."""

    low_mm: tuple[float, float, float]
    high_mm: tuple[float, float, float]

    @classmethod
    def around(cls, points_mm: Float64) -> Box:
        """Return the smallest box that contains (N, 3) points, N ≥ 1."""
        # Column by column: ten times as fast as a reduction along the first axis.
        low = [_GRID_MM * math.floor(column.min() / _GRID_MM) for column in points_mm.T]
        high = [_GRID_MM * math.floor(column.max() / _GRID_MM + 1.0) for column in points_mm.T]
        return cls((low[0], low[1], low[2]), (high[0], high[1], high[2]))

    def still_fits(self, smallest: Box) -> bool:
        """Return whether it contains the smallest box and is at most 50 mm larger on each side."""
        below = np.subtract(smallest.low_mm, self.low_mm)
        above = np.subtract(self.high_mm, smallest.high_mm)
        slack = np.concatenate([below, above])
        return bool(np.all((slack >= 0.0) & (slack <= _GRID_MM)))

    @property
    def sides_mm(self) -> Float64:
        """(2, 3): lower and upper bounds."""
        return np.array([self.low_mm, self.high_mm])

    @property
    def corners_mm(self) -> Float64:
        """(8, 3): the corners."""
        return np.array(list(product(*self.sides_mm.T)))


def draw_box(painter: QPainter, box: Box, orbit: Orbit, *, is_labelled: bool = True) -> None:
    """Draw the box's far faces, and ticks labelled in millimetres along its outline.

    Parameters
    ----------
    painter : QPainter
        With its origin in the centre of the view.
    box : Box
    orbit : Orbit
    is_labelled : bool
        False leaves out the labels.
    """
    text, line = painter.pen().color(), QColor(colors().muted)
    line.setAlphaF(0.5)
    middle = orbit.project(box.corners_mm).mean(axis=0)[:2]
    steps = [_step_mm(painter, length) for length in _lengths(orbit)]
    painter.setPen(QPen(line, 1))
    ends = orbit.project(_far_lines(box, orbit, steps).reshape(-1, 3))[:, :2].reshape(-1, 4)
    painter.drawLines([QLineF(*end) for end in ends.tolist()])
    painter.setPen(text)
    for axis, step in enumerate(steps):
        if is_labelled and step is not None:
            _draw_ticks(painter, box, orbit, axis, step, middle)


def draw_scale(painter: QPainter, orbit: Orbit, corner: QPointF) -> None:
    """Draw a labelled scale bar of a round length, which ends at a lower right corner."""
    step_mm = _step_mm(painter, orbit.px_per_mm) or _STEPS_MM[-1]
    length_px = step_mm * orbit.px_per_mm
    bar = QLineF(corner.x() - length_px, corner.y(), corner.x(), corner.y())
    painter.setPen(QPen(painter.pen().color(), 2))
    painter.drawLine(bar)
    for end in (bar.p1(), bar.p2()):
        painter.drawLine(QLineF(end, end - QPointF(0, SPACING_PX / 2)))
    label = f"{step_mm} mm"
    width = painter.fontMetrics().horizontalAdvance(label)
    painter.drawText(
        QPointF(corner.x() - 0.5 * (length_px + width), corner.y() - SPACING_PX), label
    )


def _lengths(orbit: Orbit) -> Float64:
    """Return the projected length of a millimetre along each axis of the scene, in px."""
    lengths: Float64 = orbit.px_per_mm * np.linalg.norm(orbit.rotation[:2], axis=0)
    return lengths


def _step_mm(painter: QPainter, px_per_mm: float) -> int | None:
    """Return the smallest step with enough space between ticks; None if there is none."""
    gap_px = _TICK_GAP_EMS * painter.fontMetrics().height()
    return next((step for step in _STEPS_MM if step * px_per_mm >= gap_px), None)


def _ticks_mm(box: Box, axis: int, step_mm: int) -> list[int]:
    """Return the multiples of a step on an axis, without its ends."""
    first = math.floor(box.low_mm[axis] / step_mm) + 1
    last = math.ceil(box.high_mm[axis] / step_mm)
    return [step_mm * i for i in range(first, last)]


def _far_side(orbit: Orbit, axis: int) -> int:
    """Return 0 if the low side of an axis is the farther one, otherwise 1."""
    return int(orbit.rotation[2, axis] > 0.0)


def _far_lines(box: Box, orbit: Orbit, steps: list[int | None]) -> Float64:
    """Return the ends, (N, 2, 3), of the grid lines on the three far faces."""
    sides_mm = box.sides_mm
    lines = []
    for across in range(3):
        for axis in {0, 1, 2} - {across}:
            step_mm = steps[axis]
            inner = [] if step_mm is None else _ticks_mm(box, axis, step_mm)
            for place_mm in {*sides_mm[:, axis].tolist(), *inner}:
                ends = sides_mm.copy()
                ends[:, across] = sides_mm[_far_side(orbit, across), across]
                ends[:, axis] = place_mm
                lines.append(ends)
    return np.array(lines)


def _draw_ticks(
    painter: QPainter, box: Box, orbit: Orbit, axis: int, step_mm: int, middle: Float64
) -> None:
    """Label the ticks along one edge of the outline, and its end with the axis' direction."""
    start, end = _outline_edge(box, orbit, axis)
    along = (orbit.project(end[None]) - orbit.project(start[None]))[0, :2]
    if np.linalg.norm(along) < _LEAST_AXIS_PX:
        return
    outward = np.array([-along[1], along[0]]) / np.linalg.norm(along)
    outward *= np.sign(outward @ (orbit.project(start[None])[0, :2] - middle)) or 1.0
    ticks_mm = _ticks_mm(box, axis, step_mm)
    points = np.tile(end, (len(ticks_mm) + 1, 1))
    points[:-1, axis] = ticks_mm
    labels = [*(with_minus(str(tick_mm)) for tick_mm in ticks_mm), NAMES[axis]]
    for (x, y, _), label in zip(orbit.project(points), labels, strict=True):
        _write_beside(painter, np.array([x, y]), outward, label)


def _outline_edge(box: Box, orbit: Orbit, axis: int) -> tuple[Float64, Float64]:
    """Return both ends of the lowest outline edge along an axis; of the leftmost for "down".

    An edge belongs to the outline if one of its two faces is far and the other near.
    """
    sides_mm = box.sides_mm
    edges = []
    for is_far in (False, True):
        edge = sides_mm.copy()
        for other, other_is_far in ((axis - 2, is_far), (axis - 1, not is_far)):
            far = _far_side(orbit, other)
            edge[:, other] = sides_mm[far if other_is_far else 1 - far, other]
        edges.append(edge)

    def preference(edge: Float64) -> float:
        right, down, _ = orbit.project(edge).mean(axis=0)
        return float(-right if NAMES[axis] == "down" else down)

    start, end = max(edges, key=preference)
    return start, end


def _write_beside(painter: QPainter, at_px: Float64, outward: Float64, label: str) -> None:
    """Write a label next to a point, on its outer side."""
    box = QRectF(painter.fontMetrics().boundingRect(label))
    reach = SPACING_PX / 2 + 0.5 * (abs(outward[0]) * box.width() + abs(outward[1]) * box.height())
    box.moveCenter(QPointF(*(at_px + reach * outward)))
    painter.drawText(box, Qt.AlignmentFlag.AlignCenter | Qt.TextFlag.TextDontClip, label)

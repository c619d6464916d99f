"""The hand cloud panel: the frozen cursor and the live hand in 3D."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np
from PySide6.QtCore import QLineF, QPointF, QRectF, Qt
from PySide6.QtGui import (
    QColor,
    QMouseEvent,
    QPainter,
    QPaintEvent,
    QPen,
    QPixmap,
    QWheelEvent,
)
from PySide6.QtWidgets import QCheckBox, QSizePolicy, QToolButton, QWidget

from handcal.calibration.hands import PlacedHand
from handcal.core.geometry import invert, transform
from handcal.core.types import Alignment, Float64, UInt8
from handcal.register.guard import matched_pairs
from handcal.report.cells import with_minus
from handcal.station.snapshot import Snapshot
from handcal_gui.app.keys import add_action
from handcal_gui.app.preferences import HIDDEN_LAYERS
from handcal_gui.app.theme import SPACING_PX, colors, follow_theme, number_font
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.cloud.orbit import Direction, Orbit
from handcal_gui.calibrate.parts.legend import RESIDUALS, LegendEntry
from handcal_gui.calibrate.parts.missing import missing_text
from handcal_gui.calibrate.parts.paint_turns import update_in_turn
from handcal_gui.calibrate.parts.residual_scale import (
    ResidualScale,
    draw_crosses,
    residual_colors,
)
from handcal_gui.calibrate.parts.splat import rgb, splat
from handcal_gui.widgets.elided_label import ElidedLabel
from handcal_gui.widgets.fields import with_name
from handcal_gui.widgets.layouts import hbox, vbox

NAMES = ("right", "down", "away")
_GRID_MM = 50.0
_STEPS_MM = (5, 10, 20, 50, 100, 200, 500)
_TICK_GAP_EMS = 3.5
"""Minimum distance between ticks, so that their labels do not touch."""
_LEAST_AXIS_PX = 40.0
"""Minimum length of an axis with ticks; axes along the line of sight are shorter."""
_RAD_PER_PX = 0.01
_ZOOM_PER_NOTCH = 1.2
_KEY_TURN_RAD = math.radians(10.0)
_POINT_MM = 1.5
"""Size of a point, about the distance between neighbours on a hand; limited in pixels."""
_LEAST_POINT_PX, _MOST_POINT_PX = 2.0, 6.0
_LABELS_EMS = (7.0, 4.5)
"""Space for the box's labels: left and right together, and above and below together."""
_UNLABELLED_EMS = (1.0, 1.0)
_LEAST_LABELLED_EMS = 11.0
"""Height below which the box has no labels: the hand would be too small beside them."""
_EMPTY = tr("The hand cloud will appear here. Hold a hand in front of the depth camera.")
_FROM_CAMERA = tr("mm from the depth camera")
_FROM_CURSOR = tr("mm from the centre of the cursor")
_TURNED = tr("The live hand is rotated too far")
_HIDDEN = tr("All points are hidden. Switch cursor or hand on below.")
_DIRECTIONS = {
    "front": (Direction.FRONT, tr("Front"), "1", tr("As the wearer sees it (1)")),
    "side": (Direction.SIDE, tr("Side"), "2", tr("From the wearer's right (2)")),
    "top": (Direction.TOP, tr("Top"), "3", tr("From above (3)")),
    "reset": (
        Direction.ASLANT,
        tr("Reset"),
        "R",
        tr("Oblique view of the whole scene (R, or double-click)"),
    ),
}
_WIDEST = "9,999"
_MOST_POINTS = 6000
"""Maximum number of points drawn of each cloud, to keep up with the frame rate."""
_PAIRS_PERIOD_S = 0.5
_NONE = np.empty((0, 3))


@dataclass(frozen=True, slots=True, eq=False)
class _Axes:
    """Axes in which clouds are shown, with their origin and its name."""

    T_axes_W: Float64
    zero_m: Float64
    name: str

    def mm(self, points_W_m: Float64) -> Float64:
        """Return (N, 3) points of W in millimetres in these axes."""
        mm: Float64 = 1e3 * (transform(self.T_axes_W, points_W_m) - self.zero_m)
        return mm


@dataclass(frozen=True, slots=True, eq=False)
class _Cloud:
    """A cloud, coloured by its role or by its residuals."""

    layer: str
    """By which it can be hidden: "cursor", "hand", or "solved-cursor" of a finished alignment."""
    name: str
    role: str
    points_mm: Float64
    residuals_m: Float64 | None = None
    reach_m: float = 0.0
    """End of the residuals' colour scale."""

    def drawn(self) -> tuple[Float64, UInt8, Float64]:
        """Return at most `_MOST_POINTS` points with their colours, and points without a partner."""
        every = slice(None, None, max(1, -(-len(self.points_mm) // _MOST_POINTS)))
        points_mm = self.points_mm[every]
        if self.residuals_m is None:
            color = np.array(rgb(getattr(colors(), self.role)), np.uint8)
            return points_mm, np.tile(color, (len(points_mm), 1)), _NONE
        residuals_m = self.residuals_m[every]
        is_outlier = np.isnan(residuals_m)
        shades = residual_colors(residuals_m[~is_outlier], self.reach_m)
        return points_mm[~is_outlier], shades, points_mm[is_outlier]


class CloudPanel(QWidget):
    """Shows cursor and live hand in the depth camera's axes, which are nearly the wearer's.

    A finished alignment is shown in the axes of its first eye.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("cloud-panel")
        self._clouds: list[_Cloud] = []
        self._hidden = set(HIDDEN_LAYERS)
        self._cursor_layer = "cursor"
        self._text = ""
        self._next_pairs_s = 0.0
        self._view = CloudView()
        self._shows_cursor = self._switch(tr("Cursor"), "C", lambda: self._cursor_layer)
        self._shows_hand = self._switch(tr("Live hand"), "L", lambda: "hand")
        self._pairs = self._switch(tr("Pairs"), "P", lambda: "pairs")
        self._cursor = LegendEntry(
            "cursor",
            self._shows_cursor,
            "cursor",
            tr("Show the frozen hand; the number of its points (C)"),
            widest=_WIDEST,
        )
        self._hand = LegendEntry(
            "hand",
            self._shows_hand,
            "live",
            tr("Show the hand; the number of its points (L)"),
            widest=_WIDEST,
        )
        self._scale = ResidualScale()
        self._pairs.setObjectName("cloud-pairs")
        self._pairs.setToolTip(
            tr(
                "While aligning, join points of the live hand with the nearest points of "
                "the cursor "
                "once the hand is laid over it; updated twice a second (P)"
            )
        )
        self.setFocusProxy(self._view)
        self._lay_out()
        self.clear()
        follow_theme(self, self._draw)

    @property
    def hidden_layers(self) -> tuple[str, ...]:
        """Layers that are switched off, and "pairs"."""
        return tuple(sorted(self._hidden))

    def hide_layers(self, layers: Iterable[str]) -> None:
        """Hide these layers, and show all others."""
        self._hidden = set(layers)
        self._show_switches()
        self._draw()

    def clear(self, message: str = _EMPTY) -> None:
        """Clear the panel and show a message."""
        self._show("cursor", None, None, message)

    def show_snapshot(self, snapshot: Snapshot) -> None:
        """Show the cursor, if there is one, and the live hand."""
        seen, cursor = snapshot.observation, snapshot.procedure.cursor
        problem = missing_text(snapshot)
        if seen is None and not problem:
            return
        hand = seen.hand if seen and not problem else None
        placed = cursor or hand
        if placed is None:
            self.clear(problem or _EMPTY)
            return
        self._pairs.setEnabled(True)
        axes = _live_axes(cursor, placed)
        is_red = seen is not None and seen.is_over_limit
        role = "red" if is_red else "live"
        self._show(
            "cursor",
            None if cursor is None else axes.mm(cursor.points_W_m),
            None
            if hand is None
            else _Cloud("hand", tr("Live hand"), role, axes.mm(hand.points_W_m)),
            problem or (_TURNED if is_red else axes.name),
        )
        if cursor and hand and seen and seen.rotation_rad is not None and self._pairs.isChecked():
            self._join(cursor, hand, hand.T_W_D[:3, :3] @ seen.rotation_rad, axes)
        else:
            self._forget_pairs()

    def show_alignment(self, alignment: Alignment, residuals_m: Float64, reach_m: float) -> None:
        """Show a finished alignment, its hand coloured by (M,) residuals; NaN for outliers.

        The colour scale ends at `reach_m`. Its cursor would cover the colours, and is hidden at
        first.
        """
        T_E_W = alignment.T_E_W[alignment.eyes[0]]
        middle_m = np.median(transform(T_E_W, alignment.cursor_m), axis=0)
        axes = _Axes(T_E_W, middle_m, _FROM_CURSOR)
        self._forget_pairs()
        self._pairs.setEnabled(False)
        self._scale.show_reach(reach_m)
        hand_mm = axes.mm(alignment.hand_m)
        self._show(
            "solved-cursor",
            axes.mm(alignment.cursor_m),
            _Cloud("hand", tr("Hand"), RESIDUALS, hand_mm, residuals_m, reach_m),
            axes.name,
        )

    def _lay_out(self) -> None:
        buttons = []
        for name, (direction, text, _, tooltip) in _DIRECTIONS.items():
            button = with_name(QToolButton(), f"cloud-{name}", text, tooltip)
            button.setText(text)
            button.clicked.connect(lambda _, direction=direction: self._view.look(direction))
            buttons.append(button)
        controls = hbox(*buttons, 1, self._pairs, spacing=SPACING_PX // 2)
        unit = ElidedLabel()
        unit.setText(tr("points"))
        legend = hbox(self._cursor, (self._hand, 1), unit, spacing=SPACING_PX)
        vbox(
            controls,
            (self._view, 1),
            self._scale,
            legend,
            on=self,
            margins=SPACING_PX,
            spacing=SPACING_PX,
        )

    def _switch(self, text: str, key: str, layer: Callable[[], str]) -> QCheckBox:
        """Return a check box, also with a key, that shows and hides a layer."""
        switch = QCheckBox(text)

        def change(is_on: bool) -> None:
            self._hidden = self._hidden - {layer()} if is_on else self._hidden | {layer()}
            self._forget_pairs()
            self._draw()

        switch.clicked.connect(change)
        add_action(self, tr("Show or hide: {}").format(text), key, switch.click)
        return switch

    def _show_switches(self) -> None:
        self._shows_cursor.setChecked(self._cursor_layer not in self._hidden)
        self._shows_hand.setChecked("hand" not in self._hidden)
        self._pairs.setChecked("pairs" not in self._hidden)

    def _show(
        self, cursor_layer: str, cursor_mm: Float64 | None, hand: _Cloud | None, text: str
    ) -> None:
        self._cursor_layer = cursor_layer
        cursor = None
        if cursor_mm is not None:
            cursor = _Cloud(cursor_layer, tr("Cursor"), "cursor", cursor_mm)
        if hand is None:
            self._hand.show_name(tr("Live hand"), "live")
        for entry, cloud in ((self._cursor, cursor), (self._hand, hand)):
            if cloud is not None:
                entry.show_name(cloud.name, cloud.role)
            entry.show_number(f"{len(cloud.points_mm):,}" if cloud else tr("none"))
        self._show_switches()
        self._scale.setVisible(hand is not None and hand.residuals_m is not None)
        self._clouds = [cloud for cloud in (cursor, hand) if cloud is not None]
        self._text = text
        self._draw()

    def _draw(self) -> None:
        shown = [cloud for cloud in self._clouds if cloud.layer not in self._hidden]
        drawn = [cloud.drawn() for cloud in shown]
        points_mm = np.concatenate([_NONE, *(points for points, _, _ in drawn)])
        shades = np.concatenate([np.empty((0, 3), np.uint8), *(shades for _, shades, _ in drawn)])
        outliers_mm = np.concatenate([_NONE, *(outliers for _, _, outliers in drawn)])
        # Without a hand, the text says why there is none.
        is_hidden = not shown and any(cloud.layer == "hand" for cloud in self._clouds)
        text = _HIDDEN if is_hidden else self._text
        self._view.show_points(points_mm, shades, text, outliers_mm)

    def _join(self, cursor: PlacedHand, hand: PlacedHand, rotation_W: Float64, axes: _Axes) -> None:
        now_s = time.monotonic()
        if now_s >= self._next_pairs_s:
            self._next_pairs_s = now_s + _PAIRS_PERIOD_S
            clouds = cursor.points_W_m, hand.points_W_m
            pairs = matched_pairs(*clouds, rotation_W, cursor.cloud.is_cut)
            ends = (axes.mm(cloud[index]) for cloud, index in zip(clouds, pairs.T, strict=True))
            self._view.show_lines(*ends)

    def _forget_pairs(self) -> None:
        self._next_pairs_s = 0.0
        self._view.show_lines(_NONE, _NONE)


def _live_axes(cursor: PlacedHand | None, placed: PlacedHand) -> _Axes:
    """Return the depth camera's axes at the time of the cursor, or now if there is none."""
    T_D_W = invert(placed.T_W_D)
    if cursor is None:
        return _Axes(T_D_W, np.zeros(3), _FROM_CAMERA)
    return _Axes(T_D_W, transform(T_D_W, cursor.middle_W_m[None])[0], _FROM_CURSOR)


class CloudView(QWidget):
    """Shows coloured points in a box with millimetre axes, from any direction."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("cloud-view")
        self.setAccessibleName(tr("3D view of the hand cloud"))
        self.setToolTip(
            tr(
                "Drag to rotate, drag with the right or middle button to move, scroll to zoom, "
                "double-click to reset the view. Keys: arrows, +, −, 1, 2, 3 and R."
            )
        )
        self.setMinimumSize(160, 80)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)  # as ImageView
        self._points_mm, self._colors = _NONE, np.empty((0, 3), np.uint8)
        self._outliers_mm = self._from_mm = self._to_mm = _NONE
        self._text = ""
        self._box: Box | None = None
        self._orbit = Orbit()
        self._is_fitted = True
        self._dragged_from = QPointF()
        self._backdrop_key: object = None
        self._backdrop = QPixmap()
        self._add_actions()

    @property
    def orbit(self) -> Orbit:
        """The present view of the points."""
        return self._orbit

    def show_points(
        self, points_mm: Float64, point_colors: UInt8, text: str, outliers_mm: Float64 = _NONE
    ) -> None:
        """Show points with a caption, or a message if there are none; outliers are crosses.

        Parameters
        ----------
        points_mm : (N, 3) float64
            Right, down and away.
        point_colors : (N, 3) uint8
            RGB.
        text : str
        outliers_mm : (M, 3) float64
        """
        self._outliers_mm = outliers_mm
        self._points_mm, self._colors, self._text = points_mm, point_colors, text
        if len(points_mm):
            smallest = Box.around(points_mm)
            if self._box is None or not self._box.still_fits(smallest):
                self._box = smallest
        self.setAccessibleDescription(text)
        update_in_turn(self)

    def show_lines(self, from_mm: Float64, to_mm: Float64) -> None:
        """Show lines over the points, between (M, 3) start points and (M, 3) end points."""
        self._from_mm, self._to_mm = from_mm, to_mm
        update_in_turn(self)

    def look(self, direction: Direction) -> None:
        """Show the whole scene from one of the given directions."""
        self._orbit = self._orbit.looking(direction)
        self._is_fitted = True
        update_in_turn(self)

    def paintEvent(self, _: QPaintEvent) -> None:
        """Draw box, points, lines, scale and caption, or the message."""
        painter = QPainter(self)
        painter.setPen(self.palette().windowText().color())
        if not len(self._points_mm) or self._box is None:
            painter.fillRect(self.rect(), QColor(colors().canvas))
            margin = 2 * SPACING_PX
            within = self.rect().adjusted(margin, margin, -margin, -margin)
            flags = Qt.AlignmentFlag.AlignCenter.value | Qt.TextFlag.TextWordWrap.value
            painter.drawText(within, flags, self._text)
            return
        if self._is_fitted:
            em = self.fontMetrics().height()
            across, down = _LABELS_EMS if self._is_labelled else _UNLABELLED_EMS
            self._orbit = self._orbit.fitted(
                self._box.corners_mm, self.width() - across * em, self.height() - down * em
            )
        painter.drawPixmap(0, 0, self._draw_backdrop(self._box))
        self._paint_points(painter)
        self._paint_lines(painter)
        if self._is_labelled:  # the caption explains the labels
            top = SPACING_PX + self.fontMetrics().ascent()  # the scale bar is at the bottom
            painter.drawText(QPointF(SPACING_PX, top), self._text)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """Start dragging."""
        self._dragged_from = event.position()

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        """Rotate with the left button, move with any other."""
        moved = event.position() - self._dragged_from
        self._dragged_from = event.position()
        if event.buttons() & Qt.MouseButton.LeftButton:
            self._turn(-_RAD_PER_PX * moved.x(), _RAD_PER_PX * moved.y())
        else:
            self._change(self._orbit.panned(moved.x(), moved.y()))

    def mouseDoubleClickEvent(self, _: QMouseEvent) -> None:
        """Reset the view."""
        self.look(Direction.ASLANT)

    def wheelEvent(self, event: QWheelEvent) -> None:
        """Zoom."""
        self._change(self._orbit.zoomed(_ZOOM_PER_NOTCH ** (event.angleDelta().y() / 120)))

    def _add_actions(self) -> None:
        """Rotate by arrow keys, zoom by + and −, select a direction by 1, 2, 3 and R."""
        turn, zoom = _KEY_TURN_RAD, _ZOOM_PER_NOTCH
        for text, keys, do in (
            (tr("Rotate left"), "Left", lambda: self._turn(turn, 0.0)),
            (tr("Rotate right"), "Right", lambda: self._turn(-turn, 0.0)),
            (tr("Rotate up"), "Up", lambda: self._turn(0.0, -turn)),
            (tr("Rotate down"), "Down", lambda: self._turn(0.0, turn)),
            (tr("Zoom in"), "+ =", lambda: self._change(self._orbit.zoomed(zoom))),
            (tr("Zoom out"), "-", lambda: self._change(self._orbit.zoomed(1.0 / zoom))),
        ):
            add_action(self, text, keys, do, context=Qt.ShortcutContext.WidgetShortcut)
        for direction, text, key, _ in _DIRECTIONS.values():
            look = partial(self.look, direction)
            add_action(self, text, key, look, context=Qt.ShortcutContext.WidgetShortcut)

    def _turn(self, yaw_rad: float, pitch_rad: float) -> None:
        self._orbit = self._orbit.turned(yaw_rad, pitch_rad)
        update_in_turn(self)

    def _change(self, orbit: Orbit) -> None:
        """Set a zoom or position chosen by the user; the view is no longer fitted."""
        self._orbit = orbit
        self._is_fitted = False
        update_in_turn(self)

    def _paint_points(self, painter: QPainter) -> None:
        ratio, size = self.devicePixelRatio(), self._device_size()
        points_px = ratio * self._orbit.project(self._points_mm)
        points_px[:, :2] += np.divide(size, 2.0)
        background = rgb(colors().canvas)
        point_px = np.clip(_POINT_MM * self._orbit.px_per_mm, _LEAST_POINT_PX, _MOST_POINT_PX)
        image = splat(points_px, self._colors, background, size, round(ratio * point_px))
        painter.drawImage(QRectF(self.rect()), image)
        middle_px = np.array([self.width(), self.height()]) / 2.0
        outliers_px = self._orbit.project(self._outliers_mm)[:, :2] + middle_px
        draw_crosses(painter, outliers_px, point_px)
        painter.setPen(self.palette().windowText().color())

    def _paint_lines(self, painter: QPainter) -> None:
        if not len(self._from_mm):
            return
        painter.save()
        painter.translate(self.width() / 2, self.height() / 2)
        painter.setPen(QPen(QColor(colors().good), 1))
        ends = np.hstack([self._orbit.project(p)[:, :2] for p in (self._from_mm, self._to_mm)])
        painter.drawLines([QLineF(*end) for end in ends.tolist()])
        painter.restore()

    def _draw_backdrop(self, box: Box) -> QPixmap:
        """Return the canvas with box and scale; redrawn only if one of them has changed."""
        ratio = self.devicePixelRatio()
        key = box, self._orbit, self.size(), ratio, colors(), self.palette().cacheKey()
        if key != self._backdrop_key:
            self._backdrop_key = key
            self._backdrop = QPixmap(*self._device_size())
            self._backdrop.setDevicePixelRatio(ratio)
            self._backdrop.fill(QColor(colors().canvas))
            painter = QPainter(self._backdrop)
            painter.setPen(self.palette().windowText().color())
            corner = QPointF(self.width() - SPACING_PX, self.height() - SPACING_PX)
            draw_scale(painter, self._orbit, corner)
            painter.setFont(number_font(0.85))
            painter.translate(self.width() / 2, self.height() / 2)
            draw_box(painter, box, self._orbit, is_labelled=self._is_labelled)
            painter.end()
        return self._backdrop

    @property
    def _is_labelled(self) -> bool:
        return self.height() >= _LEAST_LABELLED_EMS * self.fontMetrics().height()

    def _device_size(self) -> tuple[int, int]:
        ratio = self.devicePixelRatio()
        return round(ratio * self.width()), round(ratio * self.height())


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

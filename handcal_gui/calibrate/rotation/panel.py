"""The rotation panel: the hand's rotation from the cursor, and advice to correct it."""

from __future__ import annotations

import math
from collections import deque
from functools import cache

import numpy as np
from PySide6.QtCore import QLineF, QPointF, QRectF, QSize, Qt
from PySide6.QtGui import (
    QColor,
    QFont,
    QPainter,
    QPainterPath,
    QPainterPathStroker,
    QPaintEvent,
    QPen,
    QPolygonF,
)
from PySide6.QtWidgets import QLabel, QSizePolicy, QWidget

from handcal.calibration.hands import PlacedHand
from handcal.calibration.states import Observation, State
from handcal.core.types import Float64
from handcal.register.guard import turn_advice
from handcal.session.record import SessionRecord
from handcal.station.snapshot import Snapshot
from handcal_gui.app.theme import SPACING_PX, colors, number_font, scale_font
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.parts.paint_turns import update_in_turn
from handcal_gui.widgets.layouts import hbox, vbox
from handcal_gui.widgets.numbers import pluralize
from handcal_gui.widgets.plots import Plot
from handcal_gui.widgets.sentence import sentence

# The drawing is 200 units wide and high; its origin is the centre of the hand.
_FINGERS = ((-16, 10, -50, -14), (-21, 0, -33, -52), (-7, -4, -11, -68), (7, -4, 10, -64),
            (20, 2, 29, -44))  # fmt: skip
_PALM = QRectF(-27, -14, 54, 54)
_WRIST = QRectF(-18, 30, 36, 50)
_RADIUS = 78.0
_ARROW_DEG = 70.0
_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
_FROM_DEG, _SPAN_DEG = 210.0, 240.0
"""Start of the scale, counter-clockwise from three o'clock, and its extent clockwise."""
_SCALE_LIMITS = 2.0
"""End of the scale in multiples of the limit, which is thus at the top."""
_WIDEST = 190
"""Maximum width of a line of text; the dial is 200 wide."""
_LEAST_PX = 9.0
"""Smallest readable text, on the screen."""
_HISTORY_S = 10.0
_HISTORY_PERIOD_S = 0.2
"""Interval of redrawing the history while the hand is still."""
_STEP_DEG = 0.3
"""A change that redraws it at once, or it would contradict the dial."""
_NEVER = -np.inf, np.nan
_HISTORY_LIMITS = 2.0
"""End of the history's scale in multiples of the limit, as for the dial."""
_PLOT_PX = 56
"""Least height of the history, most of it for the curve: it and the limit must be told apart."""
_STRAIGHT_RAD = np.radians(2.0)
"""Rotations below this need no correction: hardly more than the guard's own error."""
_SHAPE_M = 0.0015
"""A smaller change of shape, rms, is not mentioned."""
_NO_CURSOR = tr("While the wearer aligns, the hand's rotation from the cursor is shown here.")
_TAKEN = tr("The alignment is confirmed.")
_NO_HAND = tr("Hold the hand in view of the camera.")
_NO_IMAGE = tr("The camera gives no image; the message below the guide says why.")
_STRAIGHT = tr("The hand is rotated like the cursor.")
_REASONS = {
    "turned": tr("Last: hand turned."),
    "moved": tr("Last: moved too fast."),
    "shape changed": tr("Last: shape changed."),
    "no hand": tr("Last: no hand."),
    "no image": tr("Last: no image of that moment."),
    "clock set": tr("Last: headset's clock set."),
    "out of view": tr("Last: hand partly out of view."),
    "drawn otherwise": tr("Last: the drawn φ had changed."),
}
"""Reasons of the journal."""


class RotationPanel(QWidget):
    """Shows the angle and its limit, the way to turn, the recent history, and refusals."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("rotation-panel")
        self.setAccessibleName(tr("Rotation"))
        self._cursor: PlacedHand | None = None
        self._history: deque[tuple[float, float]] = deque()
        self._history_drawn = _NEVER
        self._dial = RotationDial()
        self._hand = TurningHand()
        self._advice = _text_label("rotation-advice", scale=1.2)
        self._advice.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self._refusals = _text_label("rotation-refusals", least_lines=1)
        self._plot = Plot(
            "rotation-history", tr("Rotation history"), tr("Last {:g} s").format(_HISTORY_S), ""
        )
        self._plot.setMinimumHeight(_PLOT_PX)
        self._plot.item.setXRange(-_HISTORY_S, 0.0, padding=0.0)
        self._plot.item.getAxis("bottom").setStyle(showValues=False, tickLength=0)
        self._plot.item.getAxis("left").setTicks([[]])  # until there is a limit
        self._limit_line = self._plot.add_line("red", dashed=True)
        self._angle_line = self._plot.add_line("live")
        self._limit_rad = 0.0
        self._lay_out()

    def show_snapshot(self, snapshot: Snapshot) -> None:
        """Show the rotation of a snapshot; without a new frame the angle stays."""
        procedure, observation = snapshot.procedure, snapshot.observation
        was = procedure.refused_for  # without an order that may no longer apply
        last = f"{was}." if was else procedure.refusal or _last_reason(snapshot.record)
        self._show_refusals(snapshot.record.refused, last)
        self._show_limit(snapshot.settings.guard.limit_rad)
        is_aligning = procedure.cursor is not None and procedure.state is State.ALIGN
        if self._history and not (is_aligning and procedure.cursor is self._cursor):
            self._history.clear()
            self._history_drawn = _NEVER
            self._angle_line.clear()
        self._cursor = procedure.cursor
        if not is_aligning:
            self._show_nothing("", _NO_CURSOR if procedure.cursor is None else _TAKEN)
        elif snapshot.camera.problem:
            self._show_nothing(tr("? No image"), _NO_IMAGE)
        elif observation is not None:
            self._show_observation(observation)
            self._show_history(1e-9 * snapshot.t_host_ns, observation.rotation_rad)

    def _show_observation(self, observation: Observation) -> None:
        if observation.rotation_rad is None:
            missing = tr("? No hand") if observation.cloud is None else tr("? Not placed")
            self._show_nothing(missing, sentence(observation.problem) or _NO_HAND)
            return
        angle_rad = float(np.linalg.norm(observation.rotation_rad))
        has_changed = observation.has_changed or (observation.shape_change_m or 0.0) > _SHAPE_M
        shape = f"{sentence(observation.shape_text)}." if has_changed else ""
        is_turned = angle_rad > self._limit_rad or (
            observation.is_over_limit and not observation.has_changed
        )
        if not is_turned and (angle_rad < _STRAIGHT_RAD or observation.has_changed):
            differs = observation.has_changed
            word = tr("▲ Shape differs") if differs else tr("✓ Straight")
            self._dial.show_angle(angle_rad, self._limit_rad, word, is_refused=differs)
            self._hand.show_turn("")
            self._advice.setText(shape or _STRAIGHT)
            return
        word = tr("▲ Turn back") if observation.is_over_limit else tr("✓ Within limit")
        advice = turn_advice(observation.rotation_rad)
        self._dial.show_angle(angle_rad, self._limit_rad, word)
        self._hand.show_turn(advice.axis, positive=advice.angle_rad > 0)
        self._advice.setText(
            tr("{} by {:.0f}°. {}")
            .format(advice.text, abs(np.degrees(advice.angle_rad)), shape)
            .strip()
        )

    def _show_nothing(self, word: str, text: str) -> None:
        self._dial.show_angle(None, self._limit_rad, word)
        self._hand.show_turn("")
        self._advice.setText(text)

    def _show_history(self, now_s: float, rotation_rad: Float64 | None) -> None:
        angle_rad = np.nan if rotation_rad is None else np.linalg.norm(rotation_rad)
        angle_deg = float(np.degrees(angle_rad))
        self._history.append((now_s, angle_deg))
        while self._history[0][0] < now_s - _HISTORY_S:
            self._history.popleft()
        drawn_s, drawn_deg = self._history_drawn
        has_moved = abs(angle_deg - drawn_deg) >= _STEP_DEG  # also not while the hand is lost
        if not has_moved and 0.0 <= now_s - drawn_s < _HISTORY_PERIOD_S:
            return
        self._history_drawn = now_s, angle_deg
        times_s, angles_deg = np.array(self._history).T
        top_deg = _HISTORY_LIMITS * float(np.degrees(self._limit_rad))
        self._angle_line.setData(times_s - now_s, np.minimum(angles_deg, top_deg))

    def _show_limit(self, limit_rad: float) -> None:
        if limit_rad == self._limit_rad:
            return
        self._limit_rad = limit_rad
        limit_deg = float(np.degrees(limit_rad))
        self._plot.item.setYRange(0.0, _HISTORY_LIMITS * limit_deg, padding=0.0)
        self._plot.item.getAxis("left").setTicks([[(limit_deg, f"{limit_deg:g}°")]])
        self._limit_line.setData([-_HISTORY_S, 0.0], [limit_deg, limit_deg])

    def _show_refusals(self, count: int, last: str) -> None:
        """Show the count of the journal, which the report shows too, and the last reason."""
        refused = tr("No confirmation refused.")
        if count or last:
            # The journal may follow the refusal by a frame.
            counted = pluralize(max(count, 1), tr("confirmation"), tr("confirmations"))
            refused = tr("{} refused.").format(counted)
        self._refusals.setText(f"{refused} {sentence(last)}".strip())

    def _lay_out(self) -> None:
        top = hbox((self._dial, 3), (self._hand, 2), spacing=SPACING_PX)
        vbox(
            (top, 3),
            self._advice,
            (self._plot, 2),
            self._refusals,
            on=self,
            margins=SPACING_PX,
            spacing=SPACING_PX // 2,
        )


def _last_reason(record: SessionRecord) -> str:
    """Return the reason of a session's last refusal; empty if there is none."""
    last = next((one for one in reversed(record.events) if one.name == "refused"), None)
    return "" if last is None else _REASONS.get(str(last.data.get("reason")), "")


def _text_label(name: str, scale: float = 1.0, least_lines: int = 2) -> QLabel:
    """Return a label with the height of at least two lines, or of another number."""
    label = QLabel()
    label.setObjectName(name)
    label.setTextFormat(Qt.TextFormat.PlainText)
    label.setWordWrap(True)
    label.setAlignment(Qt.AlignmentFlag.AlignTop)
    scale_font(label, scale)
    label.setMinimumHeight(least_lines * label.fontMetrics().lineSpacing() + 2)
    return label


class RotationDial(QWidget):
    """Large digits within an arc that fills towards the limit, and a symbol and word below."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("rotation-dial")
        self.setAccessibleName(tr("Rotation of the hand"))
        self.setToolTip(tr("Rotation of the hand from the cursor, and its limit"))
        self.setMinimumSize(100, 72)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self._angle_deg: float | None = None
        self._limit_deg = 9.0
        self._word, self._word_is_red = "", False
        self._seen: tuple[object, ...] = ()

    def sizeHint(self) -> QSize:
        """Prefer a square that is readable from across the room."""
        return QSize(220, 220)

    @property
    def is_over(self) -> bool:
        """True if the angle shown exceeds the limit."""
        return self._angle_deg is not None and self._angle_deg > self._limit_deg

    def show_angle(
        self, angle_rad: float | None, limit_rad: float, word: str, *, is_refused: bool = False
    ) -> None:
        """Show an angle and its meaning in a word or two; None if there is no angle.

        The word of what is refused whatever its angle has the colour of too large an angle.
        """
        self._angle_deg = None if angle_rad is None else math.degrees(angle_rad)
        self._limit_deg = math.degrees(limit_rad)
        self._word_is_red = is_refused
        if word != self._word:
            self._word = word
            self.setAccessibleDescription(word)
        seen = self._digits, self.is_over, self._limit_deg, word, is_refused
        if seen != self._seen:  # a tenth of a degree is no wider than the arc's end
            self._seen = seen
            update_in_turn(self)

    @property
    def _digits(self) -> str:
        return "–" if self._angle_deg is None else f"{self._angle_deg:.1f}°"

    def paintEvent(self, _: QPaintEvent) -> None:
        """Draw the arc, its limit, the digits and the word."""
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        side = min(self.width(), self.height() * 1.1)
        painter.translate(self.width() / 2, self.height() / 2 + 0.05 * side)
        painter.scale(side / 200, side / 200)
        self._paint_arc(painter)
        text = self.palette().windowText().color()
        fixed, normal = number_font(), self.font()
        _write(painter, fixed, self._digits, -14, 46, self._color())
        limit_size = round(min(max(13.0, _LEAST_PX * 200 / side), 23.0))
        _write(painter, normal, tr("limit {:.1f}°").format(self._limit_deg), 22, limit_size, text)
        color = QColor(colors().red) if self._word_is_red else self._color()
        _write(painter, normal, self._word, 64, 22, color)

    def _color(self) -> QColor:
        if self._angle_deg is None:
            return QColor(colors().muted)
        return QColor(colors().red if self.is_over else colors().live)

    def _paint_arc(self, painter: QPainter) -> None:
        box = QRectF(-84, -84, 168, 168)
        half = -_SPAN_DEG / _SCALE_LIMITS
        track, beyond = QColor(colors().muted), QColor(colors().red)
        track.setAlphaF(0.35)
        beyond.setAlphaF(0.35)
        _arc(painter, box, _FROM_DEG, half, QPen(track, 14))
        _arc(painter, box, _FROM_DEG + half, half, QPen(beyond, 14))
        if self._angle_deg is not None:
            part = min(1.0, self._angle_deg / (_SCALE_LIMITS * self._limit_deg))
            _arc(painter, box, _FROM_DEG, -part * _SPAN_DEG, QPen(self._color(), 14))
        painter.setPen(QPen(self.palette().windowText().color(), 4))
        painter.drawLine(QPointF(0, -94), QPointF(0, -72))


def _arc(painter: QPainter, box: QRectF, from_deg: float, span_deg: float, pen: QPen) -> None:
    pen.setCapStyle(Qt.PenCapStyle.FlatCap)
    painter.setPen(pen)
    painter.drawArc(box, round(16 * from_deg), round(16 * span_deg))


def _write(painter: QPainter, font: QFont, text: str, y: float, size: int, color: QColor) -> None:
    """Write one line centred at a height; smaller if it would be wider than the dial."""
    font.setWeight(QFont.Weight.Bold if size > 20 else QFont.Weight.Normal)
    font.setPixelSize(size)
    painter.setFont(font)
    width = painter.fontMetrics().horizontalAdvance(text)
    if width > _WIDEST:
        font.setPixelSize(int(size * _WIDEST / width))
        painter.setFont(font)
    painter.setPen(color)
    painter.drawText(QRectF(-100, y - 40, 200, 80), Qt.AlignmentFlag.AlignCenter, text)


class TurningHand(QWidget):
    """Shows a hand; `show_turn` adds an axis and an arrow."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("turning-hand")
        self.setAccessibleName(tr("Direction to turn the hand"))
        self.setToolTip(tr("Direction to turn the hand, as the wearer sees it"))
        self.setMinimumSize(80, 72)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self._turn = ("", False)

    def sizeHint(self) -> QSize:
        """Prefer a square."""
        return QSize(150, 150)

    def show_turn(self, axis: str, *, positive: bool = True) -> None:
        """Show a rotation about an axis of the depth camera, or none.

        Parameters
        ----------
        axis : {"x", "y", "z", ""}
            Right, down and away from the wearer.
        positive : bool
            By the right-hand rule about the axis.
        """
        if (axis, positive) != self._turn:
            self._turn = axis, positive
            self.update()

    def paintEvent(self, _: QPaintEvent) -> None:
        """Draw circle and axis, the hand over them, and the arrow on top."""
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        side = min(self.width(), self.height())
        painter.translate(self.width() / 2, self.height() / 2)
        painter.scale(side / 200, side / 200)
        axis, positive = self._turn
        muted = QColor(colors().muted)
        if axis:
            painter.setPen(QPen(muted, 2, Qt.PenStyle.DashLine))
            painter.drawPolyline(_on_screen(_circle(axis, 0.0, 360.0)))
            painter.drawPolyline(_on_screen(np.outer([-95.0, 95.0], _AXES[axis])))
        fill = QColor(muted)
        fill.setAlphaF(0.45)
        painter.setPen(QPen(muted, 2))
        painter.setBrush(fill)
        painter.drawPath(_hand())
        if axis:
            _paint_arrow(painter, axis, positive, self.palette().windowText().color())


def _paint_arrow(painter: QPainter, axis: str, positive: bool, color: QColor) -> None:
    end_deg = _ARROW_DEG if positive else -_ARROW_DEG
    bend = _on_screen(_circle(axis, -end_deg, end_deg))
    painter.setPen(QPen(color, 9, c=Qt.PenCapStyle.FlatCap, j=Qt.PenJoinStyle.RoundJoin))
    painter.setBrush(Qt.BrushStyle.NoBrush)
    painter.drawPolyline(bend)
    direction = QLineF(bend[-3], bend[-1]).unitVector()
    along = QPointF(direction.dx(), direction.dy())
    across = QPointF(-along.y(), along.x())
    tip = bend[-1]
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(color)
    painter.drawPolygon(QPolygonF([tip + along * 20, tip + across * 15, tip - across * 15]))


def _circle(axis: str, from_deg: float, to_deg: float) -> Float64:
    """Return an arc about an axis, (49, 3); 0° is nearest the wearer, or at the top for z."""
    start = np.array([0.0, -1.0, 0.0] if axis == "z" else [0.0, 0.0, -1.0])
    quarter_on = np.cross(_AXES[axis], start)
    angles = np.radians(np.linspace(from_deg, to_deg, 49))[:, None]
    return np.asarray(_RADIUS * (np.cos(angles) * start + np.sin(angles) * quarter_on))


def _on_screen(points: Float64) -> list[QPointF]:
    """Project obliquely: points farther from the wearer are higher and more to the right."""
    return [QPointF(x + 0.3 * z, y - 0.25 * z) for x, y, z in points.tolist()]


@cache
def _hand() -> QPainterPath:
    """Return the outline of a right hand, seen from its back."""
    bones = QPainterPath()
    for x0, y0, x1, y1 in _FINGERS:
        bones.moveTo(x0, y0)
        bones.lineTo(x1, y1)
    flesh = QPainterPathStroker()
    flesh.setWidth(12)
    flesh.setCapStyle(Qt.PenCapStyle.RoundCap)
    palm = QPainterPath()
    palm.addRoundedRect(_PALM, 14, 14)
    wrist = QPainterPath()
    wrist.addRect(_WRIST)
    return flesh.createStroke(bones).united(palm).united(wrist).simplified()

"""The rotation panel: the hand's rotation from the cursor, and advice to correct it."""

from __future__ import annotations

from collections import deque

import numpy as np
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QLabel, QWidget

from handcal.calibration.hands import PlacedHand
from handcal.calibration.states import Observation, State
from handcal.core.types import Float64
from handcal.register.guard import turn_advice
from handcal.session.record import SessionRecord
from handcal.station.snapshot import Snapshot
from handcal_gui.app.theme import SPACING_PX, scale_font
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.rotation.dial import RotationDial
from handcal_gui.calibrate.rotation.turning_hand import TurningHand
from handcal_gui.widgets.layouts import hbox, vbox
from handcal_gui.widgets.numbers import pluralize
from handcal_gui.widgets.plots import Plot
from handcal_gui.widgets.sentence import sentence

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
        self._refused = ("", "")
        self._fitted: object = None
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
        self._fit()

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
        self._refused = refused, f"{refused} {sentence(last)}".strip()

    def _fit(self) -> None:
        """Leave out what there is no room for: the last refusal's reason, then the history."""
        advice_px = self._advice.heightForWidth(self._advice.width())
        if self._fitted == (fitted := (self.size(), advice_px, self._refused)):
            return
        self._fitted = fitted
        count, reason = self._refused
        self._refusals.setToolTip(reason)
        for refused, has_history in ((reason, True), (count, True), (count, False)):
            self._refusals.setText(refused)
            self._plot.setVisible(has_history)
            if self._box.minimumHeightForWidth(self.width()) <= self.height():
                break

    def _lay_out(self) -> None:
        top = hbox((self._dial, 3), (self._hand, 2), spacing=SPACING_PX)
        self._box = vbox(
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

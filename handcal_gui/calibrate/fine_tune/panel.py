"""The fine-tune panel: φ of each eye set by hand, shown live in the headset."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from PySide6.QtCore import QEvent, QObject, Qt, Signal
from PySide6.QtGui import QAction, QActionGroup, QHideEvent, QKeyEvent
from PySide6.QtWidgets import (
    QAbstractButton,
    QApplication,
    QButtonGroup,
    QComboBox,
    QHBoxLayout,
    QLabel,
    QSizePolicy,
    QWidget,
)

from handcal.calibration.states import MAX_HAND_SET_SHIFT_M
from handcal.core.display import TARGET_DEPTHS_M, DrawnMove, effect_at
from handcal.core.types import EYES, Eye, Rig
from handcal.register.results import read_rendered_shift_m
from handcal.station.snapshot import Snapshot
from handcal_gui.app.keys import add_action
from handcal_gui.app.theme import SPACING_PX, follow_theme, icon
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.fine_tune.controls_area import ControlsArea
from handcal_gui.calibrate.fine_tune.editor import EyeShiftEditor
from handcal_gui.calibrate.fine_tune.history import ShiftHistory, Shifts, moved, same_shifts
from handcal_gui.calibrate.fine_tune.stream import Arrival, ShiftStream, find_obstacle
from handcal_gui.widgets.fields import let_keys_choose, tool_button
from handcal_gui.widgets.layouts import hbox, vbox
from handcal_gui.widgets.result_rows import EYE_NAMES

_CALIBRATED = tr(
    "The calibrated φ is the one with which the headset draws after the calibration: the solved "
    "φ, or 0 for an eye that keeps the offline calibration. A trial records its error."
)
_OFFLINE: Shifts = {eye: np.zeros(3) for eye in EYES}
_STEPS_MM = (0.1, 0.5, 1.0)
_MOVES: dict[int, tuple[int, int]] = {
    Qt.Key.Key_Left: (0, 1),
    Qt.Key.Key_Right: (0, -1),
    Qt.Key.Key_Up: (1, 1),
    Qt.Key.Key_Down: (1, -1),
    Qt.Key.Key_PageDown: (2, -1),
    Qt.Key.Key_PageUp: (2, 1),
}
"""Axis and direction of φ, opposite to the picture's, which moves in the key's direction."""
_ARRIVALS = {
    Arrival.SENDING: ("wait", tr("Sending to the headset…")),
    Arrival.ARRIVED: ("check", tr("In the headset. ← → φ1, ↑ ↓ φ2, PgUp PgDn φ3, E eye")),
    Arrival.LATE: ("warning", tr("Not acknowledged by the headset; see Link")),
}
_NO_SESSION = tr("Fine-tuning starts with a session.")


class FineTunePanel(QWidget):
    """Sets φ by hand while the wearer watches.

    Attributes
    ----------
    reset_action : QAction
        Sets φ to the solved one.
    shift_changed : Signal(object)
        φ of both eyes, a mapping of eye to (3,) metres, for the headset; at most 30 times a second.
    shift_settled : Signal()
        The last φ sent has been unchanged for 0.7 s and should be stored.
    """

    shift_changed = Signal(object)
    shift_settled = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("fineTune")
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self._rig: Rig | None = None
        self._solved: Shifts = {}
        self._calibrated: Shifts = {}
        self._obstacle = _NO_SESSION
        self._history = ShiftHistory(_OFFLINE)
        self._burst: object = None
        self._sign_name = "wait"
        self._stream = ShiftStream(self)
        self._stream.sent.connect(self.shift_changed)
        self._stream.settled.connect(self._end_burst)
        self._make_editors()
        self._make_actions()
        self._make_depths()
        self._lay_out()
        follow_theme(self, self._draw_icons)
        self._steps.actions()[0].trigger()
        self._show_status("wait", self._obstacle)
        self._refresh()

    @property
    def step_m(self) -> float:
        """The step of the arrow keys, in metres."""
        step_m: float = self._steps.checkedAction().data()
        return step_m

    def set_step_m(self, step_m: float) -> None:
        """Select the nearest available step."""
        min(self._steps.actions(), key=lambda step: abs(step.data() - step_m)).trigger()

    def set_rig(self, rig: Rig) -> None:
        """Start with another wearer or headset.

        Parameters
        ----------
        rig : Rig
            The offline calibration of the displays.
        """
        self._rig = rig
        self._stream.begin()
        self._obstacle = _NO_SESSION  # until its φ is known
        self._begin(ShiftHistory(_OFFLINE))
        self._refresh()

    def shift_m(self) -> Shifts:
        """Return φ of each eye, (3,), metres, as set here, and in the headset a little later.

        It is empty until it is known.
        """
        return {} if self._obstacle == _NO_SESSION else self._history.present

    def choose_eye(self, eye: Eye) -> None:
        """Let the keys move this eye."""
        self._editors[eye].chosen.setChecked(True)

    def settle(self) -> None:
        """Send φ as set at once, and end any comparison."""
        if self._shown() is not None:
            self._stop_showing()
            self._stream.preview(self._history.present)
            self._refresh()
        self._stream.flush()

    def show_snapshot(self, snapshot: Snapshot) -> None:
        """Show the headset's φ, unless it was set here, and whether it has arrived."""
        results = snapshot.procedure.results
        solved = {eye: shift.shift_m for eye, shift in results.eyes.items()} if results else {}
        calibrated = results.rendered_shift_m if results else {}
        obstacle = find_obstacle(snapshot)
        is_new = self._stream.see(snapshot)
        if is_new:
            applied, by_hand = snapshot.procedure.applied_shift_m, snapshot.record.set_by_hand_m
            if self._obstacle == _NO_SESSION and same_shifts({**applied, **by_hand}, applied):
                stored = read_rendered_shift_m(snapshot.record.results)
                self._history = ShiftHistory({**_OFFLINE, **stored}, by_hand)
            self._history.see(applied)
            self._begin(self._history)
        is_same = same_shifts(solved, self._solved) and same_shifts(calibrated, self._calibrated)
        if is_new or obstacle != self._obstacle or not is_same:
            self._obstacle, self._solved, self._calibrated = obstacle, solved, calibrated
            self._refresh()
        arrival = self._stream.arrival
        sign, text = ("wait", obstacle) if obstacle else _ARRIVALS[arrival]
        can_move = self._is_editable() and arrival is Arrival.ARRIVED
        if can_move and self._history.is_replaced:
            sign, text = "wait", tr("The φ you set was replaced. Ctrl+Z brings it back.")
            if not self._has_keys():
                text = tr("The φ you set was replaced. Ctrl+6, then Ctrl+Z brings it back.")
        elif can_move and not self._has_keys():
            sign, text = "fine-tune", tr("Ctrl+6, then ← → φ1, ↑ ↓ φ2, PgUp PgDn φ3, E eye")
            if self._area.shows_keys:
                text = tr("Ctrl+6, then the keys above")
        self._show_status(sign, text)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Move the selected eye by arrow keys."""
        move = _MOVES.get(event.key())
        if move is None or event.modifiers() & ~Qt.KeyboardModifier.KeypadModifier:
            super().keyPressEvent(event)
        elif self._is_editable():
            axis, direction = move
            eye = next(eye for eye in EYES if self._editors[eye].chosen.isChecked())
            self._move(eye, axis, direction * self.step_m)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Take the arrow keys from buttons, which would pass the focus on."""
        if not (isinstance(event, QKeyEvent) and event.type() == QEvent.Type.KeyPress):
            return super().eventFilter(watched, event)
        is_move = event.key() in _MOVES
        if is_move:
            self.keyPressEvent(event)
        return is_move

    def hideEvent(self, event: QHideEvent) -> None:
        """End any comparison, so that the headset keeps φ as set."""
        super().hideEvent(event)
        self.settle()

    def _has_keys(self) -> bool:
        focused = QApplication.focusWidget()
        return focused is self or (focused is not None and self.isAncestorOf(focused))

    def _draw_icons(self) -> None:
        for action, name in ((self._undo, "undo"), (self._redo, "redo")):
            action.setIcon(icon(name))
        self._sign.setPixmap(icon(self._sign_name).pixmap(2 * SPACING_PX))

    def _begin(self, history: ShiftHistory) -> None:
        self._history = history
        self._burst = None
        self._stop_showing()

    def _edit(self, eye: Eye, axis: int, value_m: float) -> None:
        self._move(eye, axis, value_m - float(self._history.present[eye][axis]))

    def _move(self, eye: Eye, axis: int, by_m: float) -> None:
        eyes = EYES if self._both.isChecked() else (eye,)
        shifts_m = moved(self._history.present, eyes, axis, by_m, MAX_HAND_SET_SHIFT_M)
        burst = (eyes, axis)
        self._history.change(shifts_m, goes_on=burst == self._burst)
        self._burst = burst
        self._send_present()

    def _reset(self, shifts_m: Shifts) -> None:
        self._burst = None
        self._history.change({**self._history.present, **shifts_m})
        self._send_present()

    def _go(self, step: Callable[[], None]) -> None:
        self._burst = None
        step()
        self._send_present()

    def _send_present(self) -> None:
        self._stream.send(self._history.present)
        self._refresh()

    def _end_burst(self) -> None:
        self._burst = None
        self.shift_settled.emit()

    def _show(self) -> None:
        self._stream.flush()
        self._stream.preview(self._drawn())
        self._refresh()

    def _shown(self) -> Shifts | None:
        """Return the φ shown for comparison in place of the one set, if any."""
        if self._show_solved.isChecked():
            return self._solved
        return _OFFLINE if self._show_offline.isChecked() else None

    def _drawn(self) -> Shifts:
        """Return the φ that the headset is to draw with: the one set, or shown for comparison."""
        return {**self._history.present, **(self._shown() or {})}

    def _stop_showing(self) -> None:
        for action in (self._show_solved, self._show_offline):
            action.setChecked(False)

    def _is_editable(self) -> bool:
        return not self._obstacle and self._shown() is None

    def _refresh(self) -> None:
        is_editable, is_ready = self._is_editable(), not self._obstacle
        for eye, editor in self._editors.items():
            editor.setEnabled(is_editable)
            editor.show_shift(self._drawn()[eye])
            editor.show_effect(self._effect(eye))
        self._undo.setEnabled(is_editable and self._history.can_undo)
        self._redo.setEnabled(is_editable and self._history.can_redo)
        self._reset_offline.setEnabled(is_editable)
        self.reset_action.setEnabled(is_editable and bool(self._solved))
        self._show_offline.setEnabled(is_ready)
        can_end = self._show_solved.isChecked()
        self._show_solved.setEnabled(is_ready and (bool(self._solved) or can_end))
        self._against.setText(
            tr("against the calibrated φ") if self._solved else tr("against the offline φ")
        )

    def _effect(self, eye: Eye) -> DrawnMove | None:
        if self._rig is None:
            return None
        before_m = self._calibrated.get(eye, _OFFLINE[eye])
        after_m, depth_m = self._drawn()[eye], self._depth.currentData()
        return effect_at(self._rig.eyes[eye], before_m, after_m, depth_m)

    def _show_status(self, icon_name: str, text: str) -> None:
        if (icon_name, text) != (self._sign_name, self._status.text()):
            self._sign_name = icon_name
            self._sign.setPixmap(icon(icon_name).pixmap(2 * SPACING_PX))
            self._status.setText(text)

    def _make_editors(self) -> None:
        self._editors = {eye: EyeShiftEditor(EYE_NAMES[eye], MAX_HAND_SET_SHIFT_M) for eye in EYES}
        self._eye_choice = QButtonGroup(self)
        for eye, editor in self._editors.items():
            editor.setObjectName(f"{eye}Editor")
            editor.edited.connect(partial(self._edit, eye))
            self._eye_choice.addButton(editor.chosen)
        self._editors["left"].chosen.setChecked(True)

    def _change_eye(self) -> None:
        next(e.chosen for e in self._editors.values() if not e.chosen.isChecked()).setChecked(True)

    def _make_actions(self) -> None:
        add = self._add_action
        self._undo = add(tr("Undo"), "Ctrl+Z", tr("Undo the last change"))
        self._undo.setObjectName("undo")
        self._undo.triggered.connect(lambda: self._go(self._history.undo))
        self._redo = add(tr("Redo"), "Ctrl+Shift+Z", tr("Redo the change"))
        self._redo.setObjectName("redo")
        self._redo.triggered.connect(lambda: self._go(self._history.redo))
        self._both = add(tr("Both eyes"), "L", tr("Move both eyes by the same amount"))
        self._both.setCheckable(True)
        self.reset_action = add(
            tr("Reset to solved"),
            "Shift+S",
            tr("Set φ to the one solved from the alignments, used or not"),
        )
        self.reset_action.triggered.connect(lambda: self._reset(self._solved))
        self._reset_offline = add(
            tr("Reset to offline"), "Shift+B", tr("Set φ to 0, the offline calibration")
        )
        self._reset_offline.triggered.connect(lambda: self._reset(_OFFLINE))
        self.reset_action.setIconText(tr("Solved"))
        self._reset_offline.setIconText(tr("Offline"))
        looks = QActionGroup(self)
        looks.setExclusionPolicy(QActionGroup.ExclusionPolicy.ExclusiveOptional)
        looks.triggered.connect(self._show)
        self._show_solved = add(
            tr("Show solved"),
            "S",
            tr("Show the φ solved from the alignments, used or not, while checked"),
        )
        self._show_offline = add(
            tr("Show offline"), "B", tr("Show φ = 0 in the headset while checked")
        )
        self._show_solved.setIconText(tr("Solved"))
        self._show_offline.setIconText(tr("Offline"))
        for action in (self._show_solved, self._show_offline):
            action.setCheckable(True)
            looks.addAction(action)
        self._steps = QActionGroup(self)
        self._steps.triggered.connect(self._set_step)
        for key, step_mm in enumerate(_STEPS_MM, 1):
            step = add(f"{step_mm:g}", str(key), tr("Arrows move by {:g} mm").format(step_mm))
            step.setWhatsThis(tr("Step of {:g} mm").format(step_mm))
            step.setCheckable(True)
            step.setData(1e-3 * step_mm)
            self._steps.addAction(step)
        add(tr("Other eye"), "E", "").triggered.connect(self._change_eye)

    def _add_action(self, text: str, keys: str, tooltip: str) -> QAction:
        return add_action(self, text, keys, tooltip=f"{tooltip} ({keys})" if keys else tooltip)

    def _set_step(self) -> None:
        for editor in self._editors.values():
            editor.set_step_mm(1e3 * self.step_m)

    def _make_depths(self) -> None:
        self._depth = QComboBox()
        self._depth.setAccessibleName(tr("Distance of the target"))
        self._depth.setToolTip(tr("Distance of the target from the eye, in metres"))
        for depth_m in TARGET_DEPTHS_M:
            self._depth.addItem(f"{depth_m:g} m", depth_m)
        self._depth.currentIndexChanged.connect(self._refresh)
        let_keys_choose(self._depth, self, tr("Next distance of the target"), "D")

    def _lay_out(self) -> None:
        self._against = QLabel()
        self._against.setToolTip(_CALIBRATED)
        self._sign, self._status = QLabel(), QLabel(wordWrap=True)
        self._status.setObjectName("status")
        self._status.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        steps, changes = self._steps.actions(), (self._undo, self._redo)
        show, reset = QLabel(tr("Show")), QLabel(tr("Reset to"))
        controls = vbox(
            _row(QLabel(tr("Step")), *steps, QLabel("mm"), None, self._both, *changes),
            _row(self._editors["left"], self._editors["right"]),
            _row(QLabel(tr("Effect at")), self._depth, self._against, None),
            _row(
                *(show, self._show_solved, self._show_offline, None),
                *(reset, self.reset_action, self._reset_offline),
                spacing=SPACING_PX // 4,
            ),
            spacing=SPACING_PX // 2,
        )
        status = _row(self._sign, self._status)
        status.setContentsMargins(SPACING_PX, 0, SPACING_PX, SPACING_PX // 4)
        self._area = ControlsArea(controls)
        vbox((self._area, 1), status, 0, on=self, margins=0)
        for one in self.findChildren(QAbstractButton):
            one.installEventFilter(self)


def _row(*items: QWidget | QAction | None, spacing: int = SPACING_PX) -> QHBoxLayout:
    """Return a row of widgets and buttons for actions; None is a stretch."""
    made = (tool_button(one) if isinstance(one, QAction) else one or 1 for one in items)
    return hbox(*made, spacing=spacing)

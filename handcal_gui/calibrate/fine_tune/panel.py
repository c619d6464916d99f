"""The fine-tune panel: φ of each eye set by hand, shown live in the headset."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Literal, TypeAlias

import numpy as np
from PySide6.QtCore import QObject, QSignalBlocker, Qt, QTimer
from PySide6.QtGui import (
    QAction,
    QActionGroup,
    QHideEvent,
    QKeyEvent,
    QUndoCommand,
    QUndoStack,
    QWheelEvent,
)
from PySide6.QtWidgets import (
    QButtonGroup,
    QComboBox,
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QRadioButton,
    QSlider,
    QToolButton,
    QWidget,
)

from handcal.calibration.states import MAX_HAND_SET_SHIFT_M, State
from handcal.core.display import TARGET_DEPTHS_M, DrawnMove, effect_at
from handcal.core.types import EYES, Eye, Float64, Rig
from handcal.report.cells import signed
from handcal.station.snapshot import Snapshot
from handcal_gui.app.keys import add_action
from handcal_gui.app.theme import SPACING_PX, follow_theme, icon, number_font
from handcal_gui.app.translation import tr
from handcal_gui.engine.engine_thread import Submit, calibrating, no_engine
from handcal_gui.widgets.fields import let_keys_choose, number, paragraph, tool_button
from handcal_gui.widgets.layouts import hbox, vbox
from handcal_gui.widgets.result_rows import EYE_NAMES

Shifts: TypeAlias = Mapping[Eye, Float64]
"""φ of each eye, (3,) float64, metres."""
Arrival: TypeAlias = Literal["sending", "arrived", "late"]
"""The state of the last φ sent to the headset."""
PERIOD_MS = 33
SETTLE_MS = 700
_LATE_NS = 2_000_000_000
_OBSTACLES = {
    State.ALIGN: tr("Confirm the alignment, solve and apply it first."),
    State.ALIGNED: tr("Solve and apply the alignment first."),
    State.SOLVED: tr("Apply the solved projections first."),
    State.APPLYING: tr("The headset is receiving the solved projections."),
    State.VERIFY: tr("An eye is being verified; confirm or skip that first."),
}
_CALIBRATED = tr(
    "The calibrated φ is the one with which the headset draws after the calibration: the solved "
    "φ, or 0 for an eye that keeps the offline calibration. A trial records its error."
)
_KEYS = tr("Arrow keys move the picture, PgUp and PgDn change its size. E changes the eye.")
_OFFLINE: Shifts = {eye: np.zeros(3) for eye in EYES}
_STEPS_MM = (0.1, 0.5, 1.0)
_SLIDER_MAX_MM = 15.0
_SLIDER_STEPS_PER_MM = 100
_MOVES: dict[int, tuple[int, int]] = {
    Qt.Key.Key_Left: (0, 1),
    Qt.Key.Key_Right: (0, -1),
    Qt.Key.Key_Up: (1, 1),
    Qt.Key.Key_Down: (1, -1),
    Qt.Key.Key_PageDown: (2, -1),
    Qt.Key.Key_PageUp: (2, 1),
}
"""Axis and direction of φ, opposite to the picture's, which moves in the key's direction."""
_DIRECTIONS = (
    tr("to the right of the rig's viewpoint (φ1); negative is to the left"),
    tr("below the rig's viewpoint (φ2); negative is above"),
    tr("in front of the rig's viewpoint, towards the display (φ3); negative is behind"),
)
_ARRIVALS: dict[Arrival, tuple[str, str]] = {
    "sending": ("wait", tr("Sending to the headset…")),
    "arrived": ("check", tr("In the headset.")),
    "late": ("warning", tr("Not acknowledged by the headset; see Link")),
}
_NO_SESSION = tr("Fine-tuning starts with a session.")
_FOR_TRIAL = tr("For the trial only: afterwards the final φ is drawn again.")


def moved(shifts_m: Shifts, eyes: Sequence[Eye], axis: int, by_m: float) -> Shifts:
    """Return the shifts with one component of some eyes moved by the same amount.

    The step is reduced if an eye would otherwise exceed the limit.
    """
    limit_m = MAX_HAND_SET_SHIFT_M
    lowest_m = max(-limit_m - shifts_m[eye][axis] for eye in eyes)
    highest_m = min(limit_m - shifts_m[eye][axis] for eye in eyes)
    step_m = np.zeros(3)
    step_m[axis] = min(max(by_m, lowest_m), highest_m)
    return {**shifts_m, **{eye: np.clip(shifts_m[eye] + step_m, -limit_m, limit_m) for eye in eyes}}


class FineTunePanel(QWidget):
    """Sets φ by hand while the wearer watches.

    Attributes
    ----------
    reset_action : QAction
        Sets φ to the solved one.
    submit : callable
        Gives the engine a command.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("fineTune")
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.submit: Submit = no_engine
        self._rig: Rig | None = None
        self._solved: Shifts = {}
        self._calibrated: Shifts = {}
        self._present: Shifts = _OFFLINE  # as set, whatever is shown for comparison
        self._obstacle = _NO_SESSION
        self._sign_name = "wait"
        self._history = QUndoStack(self)
        self._history.indexChanged.connect(self._refresh)
        self._burst = 0  # changes of one burst are undone together
        self._burst_of: tuple[tuple[Eye, ...], int] | None = None
        self._is_verifying = False
        self._stream = ShiftStream(self._send, self._record, self)
        self._make_actions()
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

    @property
    def is_touched(self) -> bool:
        """True if φ was moved by hand since others set it, or since a trial began."""
        return self._history.canUndo()

    def set_step_m(self, step_m: float) -> None:
        """Select the nearest available step."""
        min(self._steps.actions(), key=lambda step: abs(step.data() - step_m)).trigger()

    def set_rig(self, rig: Rig) -> None:
        """Start with another wearer or headset, with the offline calibration of the displays."""
        self._rig = rig
        self._stream.begin()
        self._obstacle = _NO_SESSION  # until its φ is known
        self._begin(_OFFLINE)

    def choose_eye(self, eye: Eye) -> None:
        """Let the keys move this eye."""
        self._editors[eye].chosen.setChecked(True)

    def settle(self) -> None:
        """Send φ as set at once, and end any comparison."""
        if self._shown() is not None:
            self._stop_showing()
            self._stream.preview(self._present)
            self._refresh()
        self._stream.flush()

    def begin_trial(self) -> None:
        """Forget the changes that were made for the trial before."""
        self._history.clear()

    def show_snapshot(self, snapshot: Snapshot) -> None:
        """Show the headset's φ, unless it was set here, and whether it has arrived."""
        results = snapshot.procedure.results
        solved = {eye: shift.shift_m for eye, shift in results.eyes.items()} if results else {}
        calibrated = dict(results.rendered_shift_m) if results else {}
        obstacle = find_obstacle(snapshot)
        if is_new := self._stream.see(snapshot):
            self._take_from_others(snapshot)
        is_same = is_same_shifts(solved, self._solved) and is_same_shifts(
            calibrated, self._calibrated
        )
        was, self._is_verifying = self._is_verifying, snapshot.procedure.verifying is not None
        if is_new or obstacle != self._obstacle or not is_same or was != self._is_verifying:
            self._obstacle, self._solved, self._calibrated = obstacle, solved, calibrated
            self._refresh()
        sign, text = ("wait", obstacle) if obstacle else _ARRIVALS[self._stream.arrival]
        if snapshot.trial_eye is not None and not obstacle:
            text = f"{text} {_FOR_TRIAL}"
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

    def hideEvent(self, event: QHideEvent) -> None:
        """End any comparison, so that the headset keeps φ as set."""
        super().hideEvent(event)
        self.settle()

    def draw(self, shifts_m: Shifts) -> None:
        """Set φ; what is drawn already is not sent again."""
        if not is_same_shifts(shifts_m, self._present):
            self._present = shifts_m
            self._stream.send(shifts_m)

    def _take_from_others(self, snapshot: Snapshot) -> None:
        """Show φ that was set elsewhere; what was set here is an undo away, except a trial's."""
        former, self._present = self._present, dict(snapshot.procedure.applied_shift_m)
        self._stop_showing()
        if snapshot.trial_eye is not None or not self._history.canUndo():
            self._history.clear()
        else:
            self._history.push(_Change(self, former, self._present, -1))

    def _begin(self, shifts_m: Shifts) -> None:
        self._present = shifts_m
        self._stop_showing()
        self._history.clear()
        self._refresh()

    def _edit(self, eye: Eye, axis: int, value_m: float) -> None:
        self._move(eye, axis, value_m - float(self._present[eye][axis]))

    def _move(self, eye: Eye, axis: int, by_m: float) -> None:
        eyes = EYES if self._both.isChecked() else (eye,)
        if (eyes, axis) != self._burst_of:
            self._burst, self._burst_of = self._burst + 1, (eyes, axis)
        self._change(moved(self._present, eyes, axis, by_m), self._burst)

    def _change(self, shifts_m: Shifts, burst: int = -1) -> None:
        if burst < 0:
            self._burst_of = None
        if not is_same_shifts(shifts_m, self._present):
            self._history.push(_Change(self, self._present, shifts_m, burst))

    def _send(self, shifts_m: Shifts) -> None:
        self.submit(tr("set φ"), calibrating(lambda c: c.set_shift(shifts_m)))

    def _record(self) -> None:
        self._burst_of = None
        self.submit(tr("record φ"), lambda station: station.trials.record_shift())

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
        return {**self._present, **(self._shown() or {})}

    def _stop_showing(self) -> None:
        for action in (self._show_solved, self._show_offline):
            action.setChecked(False)

    def _is_editable(self) -> bool:
        return not self._obstacle and self._shown() is None

    def _refresh(self) -> None:
        is_editable, is_ready = self._is_editable(), not self._obstacle
        for eye, editor in self._editors.items():
            editor.setEnabled(is_editable)
            editor.show_shift(self._drawn()[eye], self._effect(eye))
        self._undo.setEnabled(is_editable and self._history.canUndo())
        self._redo.setEnabled(is_editable and self._history.canRedo())
        self._reset_offline.setEnabled(is_editable)
        self.reset_action.setEnabled(is_editable and bool(self._solved))
        self._show_offline.setEnabled(is_ready)
        can_end = self._show_solved.isChecked()
        self._show_solved.setEnabled(is_ready and (bool(self._solved) or can_end))
        self._against.setText(
            tr("against the calibrated φ") if self._solved else tr("against the offline φ")
        )

    def _effect(self, eye: Eye) -> DrawnMove | None:
        if self._rig is None or self._is_verifying:  # the guide tells how the wearer moves it
            return None
        before_m = self._calibrated.get(eye, _OFFLINE[eye])
        after_m, depth_m = self._drawn()[eye], self._depth.currentData()
        return effect_at(self._rig.eyes[eye], before_m, after_m, depth_m)

    def _show_status(self, icon_name: str, text: str) -> None:
        if (icon_name, text) != (self._sign_name, self._status.text()):
            self._sign_name = icon_name
            self._status.setText(text)
            self._draw_icons()

    def _draw_icons(self) -> None:
        for action, name in ((self._undo, "undo"), (self._redo, "redo")):
            action.setIcon(icon(name))
        self._sign.setPixmap(icon(self._sign_name).pixmap(2 * SPACING_PX))

    def _change_eye(self) -> None:
        next(e.chosen for e in self._editors.values() if not e.chosen.isChecked()).setChecked(True)

    def _make_actions(self) -> None:
        add = self._add_action
        self._undo = add(tr("Undo"), "Ctrl+Z", tr("Undo the last change"))
        self._undo.setObjectName("undo")
        self._undo.triggered.connect(self._history.undo)
        self._redo = add(tr("Redo"), "Ctrl+Shift+Z", tr("Redo the change"))
        self._redo.setObjectName("redo")
        self._redo.triggered.connect(self._history.redo)
        self._both = add(tr("Both eyes"), "L", tr("Move both eyes by the same amount"))
        self._both.setCheckable(True)
        self.reset_action = add(
            tr("Reset to solved"),
            "Shift+S",
            tr("Set φ to the one solved from the alignments, used or not"),
        )
        self.reset_action.triggered.connect(lambda: self._change({**self._present, **self._solved}))
        self._reset_offline = add(
            tr("Reset to offline"), "Shift+B", tr("Set φ to 0, the offline calibration")
        )
        self._reset_offline.triggered.connect(lambda: self._change(_OFFLINE))
        self._show_solved = add(
            tr("Show solved"),
            "S",
            tr("Show the φ solved from the alignments, used or not, while checked"),
        )
        self._show_offline = add(
            tr("Show offline"), "B", tr("Show φ = 0 in the headset while checked")
        )
        looks = QActionGroup(self)
        looks.setExclusionPolicy(QActionGroup.ExclusionPolicy.ExclusiveOptional)
        looks.triggered.connect(self._show)
        for action, text in (
            (self.reset_action, tr("Solved")),
            (self._reset_offline, tr("Offline")),
            (self._show_solved, tr("Solved")),
            (self._show_offline, tr("Offline")),
        ):
            action.setIconText(text)
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

    def _lay_out(self) -> None:
        self._editors = {eye: _EyeEditor(eye, partial(self._edit, eye)) for eye in EYES}
        eye_choice = QButtonGroup(self)
        for editor in self._editors.values():
            eye_choice.addButton(editor.chosen)
        self._editors["left"].chosen.setChecked(True)
        self._depth = QComboBox()
        self._depth.setAccessibleName(tr("Distance of the target"))
        self._depth.setToolTip(tr("Distance of the target from the eye, in metres"))
        for depth_m in TARGET_DEPTHS_M:
            self._depth.addItem(f"{depth_m:g} m", depth_m)
        self._depth.currentIndexChanged.connect(self._refresh)
        let_keys_choose(self._depth, self, tr("Next distance of the target"), "D")
        self._against = QLabel()
        self._against.setToolTip(_CALIBRATED)
        self._sign, self._status = QLabel(), paragraph("status")
        steps, changes = self._steps.actions(), (self._undo, self._redo)
        show, reset = QLabel(tr("Show")), QLabel(tr("Reset to"))
        vbox(
            _row(QLabel(tr("Step")), *steps, QLabel("mm"), None, self._both, *changes),
            _row(self._editors["left"], self._editors["right"]),
            _row(QLabel(tr("Effect at")), self._depth, self._against, None),
            _row(show, self._show_solved, self._show_offline, None),
            _row(reset, self.reset_action, self._reset_offline, None),
            paragraph("keys", _KEYS),
            hbox(self._sign, (self._status, 1), spacing=SPACING_PX),
            0,
            on=self,
            margins=SPACING_PX,
            spacing=SPACING_PX // 2,
        )


class _Change(QUndoCommand):
    """A change of φ; those of one burst, as when a slider is dragged, are one."""

    def __init__(self, panel: FineTunePanel, before: Shifts, after: Shifts, burst: int) -> None:
        super().__init__(tr("φ"))
        self._panel, self._before, self._after, self._burst = panel, before, after, burst

    def id(self) -> int:
        return self._burst

    def mergeWith(self, other: QUndoCommand) -> bool:
        assert isinstance(other, _Change)
        self._after = other._after
        return True

    def redo(self) -> None:
        self._panel.draw(self._after)

    def undo(self) -> None:
        self._panel.draw(self._before)


class _Slider(QSlider):
    """A slider that the wheel scrolls past: scrolling the panels must not change φ."""

    def wheelEvent(self, event: QWheelEvent) -> None:
        event.ignore()


class _EyeEditor(QWidget):
    """φ of one eye in fields and sliders, with its effect on the drawn target."""

    def __init__(self, eye: Eye, edit: Callable[[int, float], object]) -> None:
        super().__init__()
        self.setObjectName(f"{eye}Editor")
        title = EYE_NAMES[eye]
        self.chosen = QRadioButton(title)
        self.chosen.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # or it would take the arrow keys
        self.chosen.setToolTip(tr("The arrow keys move this eye (E changes)"))
        grid = QGridLayout()
        grid.setVerticalSpacing(SPACING_PX // 4)
        grid.setHorizontalSpacing(SPACING_PX // 2)
        grid.setColumnStretch(2, 1)
        self._fields, self._sliders = [], []
        limit_mm, reach = 1e3 * MAX_HAND_SET_SHIFT_M, round(_SLIDER_STEPS_PER_MM * _SLIDER_MAX_MM)
        for axis in range(3):
            meaning = tr("Distance of the eye {}, in millimetres").format(_DIRECTIONS[axis])
            field = number(f"phi{axis + 1}", -limit_mm, limit_mm, 0.05, " mm", meaning)
            field.setAccessibleName(tr("{} φ{} in millimetres").format(title, axis + 1))
            field.setFont(number_font())
            field.setKeyboardTracking(False)
            field.valueChanged.connect(lambda mm, axis=axis: edit(axis, 1e-3 * mm))
            slider = _Slider(Qt.Orientation.Horizontal)
            slider.setObjectName(f"slider{axis + 1}")
            slider.setAccessibleName(f"{title} φ{axis + 1}")
            slider.setFocusPolicy(Qt.FocusPolicy.NoFocus)
            slider.setRange(-reach, reach)
            slider.setMinimumWidth(3 * SPACING_PX)
            slider.valueChanged.connect(
                lambda steps, axis=axis: edit(axis, 1e-3 * steps / _SLIDER_STEPS_PER_MM)
            )
            grid.addWidget(QLabel(f"φ{axis + 1}"), axis, 0)
            grid.addWidget(field, axis, 1)
            grid.addWidget(slider, axis, 2)
            self._fields.append(field)
            self._sliders.append(slider)
        self._effect = QLabel()
        self._effect.setObjectName("effect")
        self._effect.setFont(number_font())
        self._effect.setToolTip(
            tr("Shift and enlargement of the drawn target, relative to the φ compared with")
        )
        vbox(self.chosen, grid, self._effect, on=self, margins=0, spacing=SPACING_PX // 4)

    def show_shift(self, shift_m: Float64, effect: DrawnMove | None) -> None:
        """Show φ, (3,), metres, and the target's movement on the display; nothing is emitted."""
        for value_m, field, slider in zip(shift_m, self._fields, self._sliders, strict=True):
            value_mm = 1e3 * float(value_m)
            with QSignalBlocker(field), QSignalBlocker(slider):
                field.setValue(value_mm)
                slider.setValue(round(_SLIDER_STEPS_PER_MM * value_mm))
        self._effect.setText("")
        if effect is not None:
            rows = (
                (tr("Right"), effect.right_px, effect.right_arcmin),
                (tr("Up"), effect.up_px, effect.up_arcmin),
            )
            lines = [f"{name} {signed(px, 1)} px {signed(at, 1)}′" for name, px, at in rows]
            lines.append(tr("Size {} %").format(signed(100 * (effect.size_ratio - 1), 2)))
            self._effect.setText("\n".join(lines))

    def set_step_mm(self, step_mm: float) -> None:
        """Set the step of the fields' arrows and of clicks beside a slider's handle."""
        for field, slider in zip(self._fields, self._sliders, strict=True):
            field.setSingleStep(step_mm)
            slider.setPageStep(round(_SLIDER_STEPS_PER_MM * step_mm))


def _row(*items: QWidget | QAction | None) -> QHBoxLayout:
    """Return a row of widgets and buttons for actions; None is a stretch."""
    made: list[QWidget | int] = []
    for one in items:
        if isinstance(one, QAction):
            button: QToolButton = tool_button(one)
            button.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # or it would take the arrow keys
            made.append(button)
        else:
            made.append(one or 1)
    return hbox(*made, spacing=SPACING_PX // 2)


class ShiftStream(QObject):
    """Sends the newest shifts, and distinguishes them from shifts sent by others.

    Parameters
    ----------
    send : callable
        Has shifts rendered; called at most 30 times a second.
    store : callable
        Stores the last shifts sent; called when they are unchanged for 0.7 s.

    Attributes
    ----------
    arrival : Arrival
        As of the last snapshot seen.
    """

    def __init__(
        self,
        send: Callable[[Shifts], object],
        store: Callable[[], object],
        parent: QObject | None = None,
    ) -> None:
        super().__init__(parent)
        self._give, self._store = send, store
        self._pace = QTimer(self, interval=PERIOD_MS, singleShot=True)
        self._pace.timeout.connect(self._send)
        self._calm = QTimer(self, interval=SETTLE_MS, singleShot=True)
        self._calm.timeout.connect(store)
        self.begin()

    def begin(self) -> None:
        """Begin with another session: its shifts were sent by others, also if they are the same."""
        self._pace.stop()
        self._calm.stop()
        self.arrival: Arrival = "sending"
        self._newest: Shifts = {}
        self._sent_ns = 0
        self._seen_since = 1  # nothing was sent that the first snapshot may not show yet

    def send(self, shifts_m: Shifts) -> None:
        """Send shifts to be stored, unless others follow soon."""
        self.preview(shifts_m)
        self._calm.start()

    def preview(self, shifts_m: Shifts) -> None:
        """Send shifts only for comparison."""
        self._newest = shifts_m
        if not self._pace.isActive():
            self._pace.start()

    def flush(self) -> None:
        """Send waiting shifts and store them now."""
        if self._pace.isActive():
            self._pace.stop()
            self._send()
        if self._calm.isActive():
            self._calm.stop()
            self._store()

    def see(self, snapshot: Snapshot) -> bool:
        """Process the headset's present shifts; return whether they were sent by others."""
        procedure = snapshot.procedure
        self._seen_since += snapshot.t_host_ns > self._sent_ns
        # The engine may have been processing the first of them when this was requested.
        is_answered = not self._pace.isActive() and self._seen_since > 1
        if is_answered and procedure.is_applied:
            self.arrival = "arrived"
        else:
            is_late = snapshot.t_host_ns - self._sent_ns > _LATE_NS
            self.arrival = "late" if is_late else "sending"
        if not is_answered or is_same_shifts(self._newest, procedure.applied_shift_m):
            return False
        self._newest = procedure.applied_shift_m
        self._calm.stop()
        return True

    def _send(self) -> None:
        self._sent_ns, self._seen_since = time.monotonic_ns(), 0
        self._give(self._newest)


def is_same_shifts(one: Shifts, other: Shifts) -> bool:
    """Return whether both hold the same eyes with the same φ."""
    return set(one) == set(other) and all(np.array_equal(one[eye], other[eye]) for eye in one)


def find_obstacle(snapshot: Snapshot) -> str:
    """Return the reason why φ cannot be set by hand now; empty if it can."""
    if not snapshot.link.connected:
        return tr("The headset is not connected; see Link.")
    if snapshot.comparing is not None:  # which a change would end
        return tr("The wearer compares two drawings: answer in Trials, or stop comparing.")
    return _OBSTACLES.get(snapshot.procedure.state, "")

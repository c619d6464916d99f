"""One eye's shift in fields and sliders, with its effect on the drawn target."""

from __future__ import annotations

from typing import cast

from PySide6.QtCore import QEvent, QObject, QSignalBlocker, Qt, Signal
from PySide6.QtGui import QKeyEvent, QKeySequence
from PySide6.QtWidgets import (
    QGridLayout,
    QLabel,
    QRadioButton,
    QSlider,
    QWidget,
)

from handcal.core.display import DrawnMove
from handcal.core.types import Float64
from handcal.report.cells import signed
from handcal_gui.app.theme import SPACING_PX, number_font
from handcal_gui.app.translation import tr
from handcal_gui.widgets.fields import NumberField
from handcal_gui.widgets.layouts import vbox

_SLIDER_MAX_MM = 15.0
_SLIDER_STEPS_PER_MM = 100
_SLIDER_MIN_PX = 4 * SPACING_PX
_DIRECTIONS = (
    tr("to the right of the rig's viewpoint (φ1); negative is to the left"),
    tr("below the rig's viewpoint (φ2); negative is above"),
    tr("in front of the rig's viewpoint, towards the display (φ3); negative is behind"),
)
_EFFECTS = {
    tr("Right"): tr("Shift of the drawn target to the right"),
    tr("Up"): tr("Upward shift of the drawn target"),
    tr("Size"): tr("Enlargement of the drawn target"),
}


class EyeShiftEditor(QWidget):
    """Shows φ of one eye in millimetres and emits changes.

    Parameters
    ----------
    title : str
    limit_m : float
        Largest value of a component, either way.

    Attributes
    ----------
    edited : Signal(int, float)
        Component 0 to 2, and its new value in metres.
    chosen : QRadioButton
        The title; checked if the arrow keys move this eye.
    """

    edited = Signal(int, float)

    def __init__(self, title: str, limit_m: float, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.chosen = QRadioButton(title)
        self.chosen.setToolTip(tr("The arrow keys move this eye (E changes)"))
        self._fields = [self._make_field(title, axis, 1e3 * limit_m) for axis in range(3)]
        self._sliders = [self._make_slider(title, axis) for axis in range(3)]
        self._effects = {name: _number_label(tooltip) for name, tooltip in _EFFECTS.items()}
        vbox(
            self.chosen,
            self._lay_out_components(),
            self._lay_out_effects(),
            1,
            on=self,
            margins=0,
            spacing=SPACING_PX // 4,
        )

    def show_shift(self, shift_m: Float64) -> None:
        """Show φ, (3,), metres; nothing is emitted."""
        for value_m, field, slider in zip(shift_m, self._fields, self._sliders, strict=True):
            value_mm = 1e3 * float(value_m)
            with QSignalBlocker(field), QSignalBlocker(slider):
                field.setValue(value_mm)
                slider.setValue(round(_SLIDER_STEPS_PER_MM * value_mm))

    def show_effect(self, effect: DrawnMove | None) -> None:
        """Show the target's movement on the display; None if unknown."""
        if effect is None:
            texts = ("–", "–", "–")
        else:
            texts = (
                f"{signed(effect.right_px, 1)} px {signed(effect.right_arcmin, 1):>6}′",
                f"{signed(effect.up_px, 1)} px {signed(effect.up_arcmin, 1):>6}′",
                f"{signed(100 * (effect.size_ratio - 1), 2)} %",
            )
        for label, text in zip(self._effects.values(), texts, strict=True):
            label.setText(text)

    def set_step_mm(self, step_mm: float) -> None:
        """Set the step of the fields' arrows and of clicks beside a slider's handle."""
        for field, slider in zip(self._fields, self._sliders, strict=True):
            field.setSingleStep(step_mm)
            slider.setPageStep(round(_SLIDER_STEPS_PER_MM * step_mm))

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Leave undo and redo to the panel, and ignore the wheel unless a field has the focus."""
        if event.type() == QEvent.Type.ShortcutOverride and isinstance(event, QKeyEvent):
            undoes = (QKeySequence.StandardKey.Undo, QKeySequence.StandardKey.Redo)
            return any(event.matches(key) for key in undoes)
        if event.type() == QEvent.Type.Wheel and not cast(QWidget, watched).hasFocus():
            event.ignore()  # scrolling the panel must not change φ
            return True
        return super().eventFilter(watched, event)

    def _make_field(self, title: str, axis: int, limit_mm: float) -> NumberField:
        field = NumberField(2)
        field.setObjectName(f"phi{axis + 1}")
        field.setAccessibleName(tr("{} φ{} in millimetres").format(title, axis + 1))
        field.setToolTip(_tooltip(axis))
        field.setRange(-limit_mm, limit_mm)
        field.setSuffix(" mm")
        field.setFont(number_font())
        field.setAlignment(Qt.AlignmentFlag.AlignRight)
        field.setKeyboardTracking(False)
        field.valueChanged.connect(lambda mm: self.edited.emit(axis, 1e-3 * mm))
        field.installEventFilter(self)
        field.lineEdit().installEventFilter(self)
        return field

    def _make_slider(self, title: str, axis: int) -> QSlider:
        slider = QSlider(Qt.Orientation.Horizontal)
        slider.setMinimumWidth(_SLIDER_MIN_PX)
        slider.setObjectName(f"slider{axis + 1}")
        slider.setAccessibleName(f"{title} φ{axis + 1}")
        slider.setToolTip(
            tr("{}\nThe slider goes to ±{:g} mm").format(_tooltip(axis), _SLIDER_MAX_MM)
        )
        slider.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        slider.installEventFilter(self)
        reach = round(_SLIDER_STEPS_PER_MM * _SLIDER_MAX_MM)
        slider.setRange(-reach, reach)
        slider.valueChanged.connect(
            lambda steps: self.edited.emit(axis, 1e-3 * steps / _SLIDER_STEPS_PER_MM)
        )
        return slider

    def _lay_out_components(self) -> QGridLayout:
        grid = QGridLayout()
        grid.setVerticalSpacing(SPACING_PX // 4)
        for axis in range(3):
            name = QLabel(f"φ{axis + 1}")
            name.setToolTip(_tooltip(axis))
            grid.addWidget(name, axis, 0)
            grid.addWidget(self._fields[axis], axis, 1)
            grid.addWidget(self._sliders[axis], axis, 2)
        grid.setHorizontalSpacing(SPACING_PX // 2)
        grid.setColumnStretch(2, 1)
        return grid

    def _lay_out_effects(self) -> QGridLayout:
        grid = QGridLayout()
        grid.setVerticalSpacing(0)
        for row, (name, value) in enumerate(self._effects.items()):
            label = QLabel(name)
            label.setToolTip(value.toolTip())
            grid.addWidget(label, row, 0)
            grid.addWidget(value, row, 1)
        grid.setColumnStretch(1, 1)
        return grid


def _tooltip(axis: int) -> str:
    return tr("Distance of the eye {}, in millimetres").format(_DIRECTIONS[axis])


def _number_label(tooltip: str) -> QLabel:
    label = QLabel("–")
    label.setToolTip(tr("{}, relative to the φ compared with").format(tooltip))
    label.setFont(number_font())
    label.setAlignment(Qt.AlignmentFlag.AlignRight)
    return label

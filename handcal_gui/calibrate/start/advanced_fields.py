"""Rarely changed settings of calibration, recordings and simulator."""

from __future__ import annotations

from dataclasses import replace

from PySide6.QtCore import Qt, QTimer, Signal
from PySide6.QtWidgets import QCheckBox, QToolButton, QVBoxLayout, QWidget

from handcal.camera.playback import PlaybackSettings
from handcal.station.settings import StationSettings
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.start.calibration_fields import CalibrationFields
from handcal_gui.widgets.fields import choice, fill_row, number, whole_number, with_name

_SIDES = {"": tr("Chosen by the seed"), "left": tr("Left"), "right": tr("Right")}


class AdvancedFields(QWidget):
    """The advanced settings, collapsed at first.

    Attributes
    ----------
    changed : Signal()
    """

    changed = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._fold = with_name(QToolButton(autoRaise=True), "advanced")
        self._fold.setText(tr("&Advanced"))
        self._fold.setCheckable(True)
        self._fold.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        self._calibration = CalibrationFields()
        self._real_time = with_name(
            QCheckBox(tr("Real time")),
            "realTime",
            help_text=tr("Plays at the recorded rate; otherwise every frame, as fast as possible."),
        )
        self._loop = with_name(
            QCheckBox(tr("Loop")), "loop", help_text=tr("Starts again at the end.")
        )
        playback = QWidget()
        fill_row(playback, self._real_time, self._loop, grows=self._loop)
        self._calibration.add_row(tr("Recordings"), playback)
        self._seed = whole_number(
            "seed", 0, 999_999, tr("Seed of the simulated wearer, hand and room.")
        )
        self._loss = number(
            "loss", 0.0, 50.0, 1.0, " %", tr("Datagrams dropped in each direction.")
        )
        self._reorder = number(
            "reorder", 0.0, 50.0, 1.0, " %", tr("Datagrams delivered out of order.")
        )
        self._side = choice("side", tr("Simulated hand"), _SIDES, tr("The hand that is raised."))
        self._side.currentIndexChanged.connect(self.changed)
        self._calibration.add_row(tr("Simulated hand"), self._side)
        for label, field in (
            (tr("Simulated wearer"), self._seed),
            (tr("Simulated loss"), self._loss),
            (tr("Simulated reordering"), self._reorder),
        ):
            self._calibration.add_row(label, field)
            field.valueChanged.connect(self.changed)
        for box in (self._real_time, self._loop):
            box.toggled.connect(self.changed)
        self._calibration.changed.connect(self.changed)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(SPACING_PX)
        layout.addWidget(self._fold, 0, Qt.AlignmentFlag.AlignLeft)
        layout.addWidget(self._calibration)
        self._fold.toggled.connect(self._expand)
        self._fold.clicked.connect(self._enter)
        self._expand(False)

    def show_settings(self, settings: StationSettings) -> None:
        """Show the settings of a station."""
        self._calibration.show_settings(settings.calibration)
        self._real_time.setChecked(settings.playback.real_time)
        self._loop.setChecked(settings.playback.loop)
        self._seed.setValue(settings.seed)
        self._side.setCurrentIndex(self._side.findData(settings.side or ""))
        self._loss.setValue(100 * settings.loss)
        self._reorder.setValue(100 * settings.reorder)

    def take(self, settings: StationSettings) -> StationSettings:
        """Return settings with the values shown."""
        return replace(
            settings,
            calibration=self._calibration.take(settings.calibration),
            playback=PlaybackSettings(self._real_time.isChecked(), self._loop.isChecked()),
            seed=self._seed.value(),
            side=self._side.currentData() or None,
            loss=self._loss.value() / 100,
            reorder=self._reorder.value() / 100,
        )

    def _expand(self, is_open: bool) -> None:
        arrow = Qt.ArrowType.DownArrow if is_open else Qt.ArrowType.RightArrow
        self._fold.setArrowType(arrow)
        self._calibration.setVisible(is_open)

    def _enter(self, is_open: bool) -> None:
        """Lead to the first field if opened by key: the page has no letter left for each of them.

        With the mouse the keys stay where they are, or the wheel would change that field.
        """
        if is_open and not self._fold.underMouse():
            self._fold.setFocus()
            QTimer.singleShot(0, self, self.focusNextChild)  # once laid out, so that it is in sight

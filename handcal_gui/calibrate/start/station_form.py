"""The choice of camera, headset, rig and folder, each with the finding about it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QComboBox, QGridLayout, QWidget

from handcal.station.checks.doctor import Finding, Health
from handcal.station.checks.preflight import PARTS, Part, gate_problem
from handcal.station.settings import StationSettings, gate_of_camera_m, with_gate, with_usual_gate
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.start.advanced_fields import AdvancedFields
from handcal_gui.calibrate.start.camera_field import CameraField
from handcal_gui.calibrate.start.headset_field import HeadsetField
from handcal_gui.calibrate.start.plan_field import PlanField
from handcal_gui.widgets.fields import button, fill_row, label_for
from handcal_gui.widgets.finding_line import FindingLine
from handcal_gui.widgets.path_field import PathField

TITLES: dict[Part, str] = {
    "camera": tr("&Camera"),
    "headset": tr("Hea&dset"),
    "rig": tr("&Rig file"),
    "sessions": tr("&Session folder"),
}


class StationForm(QWidget):
    """A form for the settings of a station.

    Parameters
    ----------
    wearer : QWidget
        The field in the first row; not one of the station's settings.
    settings : StationSettings
    pairing_key : str
        For network headsets.

    Attributes
    ----------
    changed : Signal()
    rig_wanted, connect_wanted : Signal()
        The user wants to calibrate a rig, or to connect a headset.
    """

    changed = Signal()
    rig_wanted = Signal()
    connect_wanted = Signal()

    def __init__(
        self,
        wearer: QWidget,
        settings: StationSettings,
        pairing_key: str,
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self.setObjectName("stationForm")
        self._settings = settings
        self._camera = CameraField()
        self._headset = HeadsetField(pairing_key)
        self._rig = PathField(
            tr("Rig file"), "file", tr("Rig files (*.yaml *.yml)"), tr("Example rig")
        )
        self._rig.setToolTip(
            tr("The offline calibration of headset and camera; the virtual headset accepts any.")
        )
        self._calibrate_rig = button("calibrateRig", tr("Cali&brate…"), tr("Calibrate a rig"))
        self._calibrate_rig.clicked.connect(self.rig_wanted)
        self._sessions = PathField(tr("Session folder"), "folder")
        self._sessions.setToolTip(tr("Each calibration gets its own folder in this folder."))
        self._plan = PlanField()
        self._advanced = AdvancedFields()
        self._parts = self._plan, self._camera, self._headset, self._advanced
        self._findings = {part: FindingLine(part) for part in PARTS}
        self._finding_rows: dict[int, FindingLine] = {}
        self._lay_out(wearer)
        self.show_settings(settings)
        self._camera.changed.connect(self._suit_gate)
        for field in (self._rig, self._sessions, *self._parts):
            field.changed.connect(self.changed)

    @property
    def settings(self) -> StationSettings:
        """The settings as shown."""
        settings = replace(self._settings, rig=self._rig.path, sessions=self._sessions.path)
        for field in self._parts:
            settings = field.take(settings)
        return settings

    def show_settings(self, settings: StationSettings) -> None:
        """Show settings."""
        self._settings = settings
        for field in self._parts:
            field.show_settings(settings)
        self._rig.set_path(settings.rig)
        self._sessions.set_path(settings.sessions)

    def _suit_gate(self) -> None:
        """Show the depth gate usual for the camera now chosen."""
        former, self._settings = self._settings, self.settings
        suited = with_usual_gate(self._settings, former)
        if suited != self._settings:
            self.show_settings(suited)

    def set_rig(self, path: str) -> None:
        """Show another rig file."""
        self._rig.set_path(path)

    def set_pairing_key(self, pairing_key: str) -> None:
        """Show another key."""
        self._headset.set_pairing_key(pairing_key)

    def show_findings(self, findings: Mapping[Part, Finding]) -> None:
        """Show the finding about each part, with a button if one click can fix it."""
        letters = set[str]()
        for part, finding in findings.items():
            fix, changes = _fix(part, finding, self.settings)
            mend: Callable[[], object] = partial(self._change, changes)
            is_awaited = finding.health is Health.LIMITED and self.settings.headset == "network"
            if part == "headset" and is_awaited and not fix:
                fix, mend = tr("Co&nnect…"), self.connect_wanted.emit
            letter = fix.partition("&")[2][:1]
            if letter in letters:  # M, of which the camera comes first
                fix = fix.replace("&", "")
            letters.add(letter)
            self._findings[part].show_finding(finding, fix, mend)

    def fit(self, *, is_low: bool) -> None:
        """Give the findings the width of the labels, too, where height is scarce."""
        self._grid.setRowMinimumHeight(self._gap_row, 0 if is_low else SPACING_PX)
        for row, finding in self._finding_rows.items():
            self._grid.addWidget(finding, row, 0 if is_low else 1, 1, 2 if is_low else 1)

    def _change(self, changes: Mapping[str, Any]) -> None:
        self.show_settings(replace(self.settings, **changes))

    def _lay_out(self, wearer: QWidget) -> None:
        rig = QWidget()
        fill_row(rig, self._rig, self._calibrate_rig, grows=self._rig)
        fields: dict[Part, QWidget] = {
            "camera": self._camera,
            "headset": self._headset,
            "rig": rig,
            "sessions": self._sessions,
        }
        self._grid = grid = QGridLayout(self)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setHorizontalSpacing(2 * SPACING_PX)
        grid.setVerticalSpacing(SPACING_PX // 2)
        grid.setColumnStretch(1, 1)
        _add_row(grid, tr("&Wearer"), wearer)
        _add_row(grid, tr("&Plan"), self._plan)
        self._gap_row = grid.rowCount()
        for part in PARTS:
            _add_row(grid, TITLES[part], fields[part])
            self._findings[part].keep_room()
            self._finding_rows[grid.rowCount()] = self._findings[part]
            grid.addWidget(self._findings[part], grid.rowCount(), 1)
        grid.addWidget(self._advanced, grid.rowCount(), 1)
        grid.setRowStretch(grid.rowCount(), 1)  # or the fields move apart on a tall page
        self.fit(is_low=False)


def _add_row(grid: QGridLayout, title: str, field: QWidget) -> None:
    """Add a field, with its title aligned with the field's first line."""
    label = label_for(field, title)
    label.setMinimumHeight(QComboBox().sizeHint().height())
    row = grid.rowCount()
    grid.addWidget(label, row, 0, Qt.AlignmentFlag.AlignTop)
    grid.addWidget(field, row, 1)


def _fix(part: Part, finding: Finding, settings: StationSettings) -> tuple[str, dict[str, Any]]:
    """Return a fix for a part: a button's label and changed settings; empty if there is none."""
    is_broken = finding.health is Health.BROKEN
    if part == "camera" and gate_problem(settings) is not None:
        usual = with_gate(settings, gate_of_camera_m(settings))
        return tr("Use the usual gate"), {"calibration": usual.calibration}
    is_simulated, is_virtual = settings.source == "simulator", settings.headset == "virtual"
    if part == "camera" and is_broken:
        return tr("Use the si&mulator"), {"source": "simulator", "headset": "virtual"}
    if part == "headset" and is_simulated and not is_virtual:
        return tr("Use the virtual headset"), {"headset": "virtual"}
    if part == "headset" and is_virtual and not is_simulated:
        return tr("Use a networ&k headset"), {"headset": "network"}
    if part == "rig" and is_broken and settings.rig:
        return tr("Use the exa&mple"), {"rig": ""}
    return "", {}

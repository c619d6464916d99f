"""The form of a station: plan, camera, headset, rig, folder, and rarely changed settings."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

from PySide6.QtCore import Qt, QTimer, Signal
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QGridLayout,
    QLabel,
    QLineEdit,
    QStackedWidget,
    QToolButton,
    QWidget,
)

from handcal.camera.recordings import RECORDING_SUFFIXES
from handcal.camera.settings import RealSenseSettings
from handcal.core.types import EYES, PLAN_WORDS, Eye
from handcal.station.checks.doctor import Finding, Health
from handcal.station.checks.preflight import PARTS, Part, gate_problem
from handcal.station.settings import (
    HeadsetKind,
    Source,
    StationSettings,
    gate_of_camera_m,
    with_gate,
    with_usual_gate,
)
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.start.calibration_fields import CalibrationFields
from handcal_gui.calibrate.start.camera_settings import CameraSettingsDialog
from handcal_gui.connect.key_field import KeyField
from handcal_gui.widgets.entries_form import Bound
from handcal_gui.widgets.fields import (
    button,
    choice,
    fill_row,
    label_for,
    number,
    whole_number,
    with_name,
)
from handcal_gui.widgets.finding_line import FindingLine
from handcal_gui.widgets.layouts import vbox
from handcal_gui.widgets.path_field import PathField

TITLES: dict[Part, str] = {
    "camera": tr("&Camera"),
    "headset": tr("Hea&dset"),
    "rig": tr("&Rig file"),
    "sessions": tr("&Session folder"),
}
_PLANS = {name: PLAN_WORDS[name] for name in ("recommended", "paper")}
_PLAN_HELP = tr(
    "Recommended: the hand is raised once; the cursors are placed where they are most\n"
    "informative, and each eye is verified. The steps run automatically.\n"
    "As in the paper: the cursor is the hand where it is held; you choose the eyes in the guide."
)
_EYES: dict[str, str] = {
    "both": tr("Both eyes"),
    "left": tr("Left eye only"),
    "right": tr("Right eye only"),
}
_USABLE: dict[str, tuple[Eye, ...]] = {"both": EYES, "left": ("left",), "right": ("right",)}
_SOURCES: dict[Source, str] = {
    "simulator": tr("Simulator"),
    "realsense": "RealSense",
    "hololens2": "HoloLens 2",
    "oak": "OAK-D",
    "orbbec": "Orbbec",
    "recording": tr("Recording"),
}
_PATTERN = tr("RealSense recordings ({})").format(
    " ".join(f"*{suffix}" for suffix in RECORDING_SUFFIXES)
)
_HEADSETS: dict[HeadsetKind, str] = {
    "virtual": tr("Virtual headset"),
    "network": tr("Network headset"),
}
_SIDES = {"": tr("Chosen by the seed"), "left": tr("Left"), "right": tr("Right")}


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
    calibrate_rig : QPushButton
    connect_headset : callable
        Called to connect a headset that is awaited.
    """

    changed = Signal()

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
        self._is_showing = False
        self.connect_headset: Callable[[], object] = lambda: None
        self.calibrate_rig = button("calibrateRig", tr("Cali&brate…"), tr("Calibrate a rig"))
        self._findings = {part: FindingLine(part) for part in PARTS}
        self._calibration = CalibrationFields("calibration.")
        self._grid = grid = QGridLayout(self)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setHorizontalSpacing(2 * SPACING_PX)
        grid.setVerticalSpacing(SPACING_PX // 2)
        grid.setColumnStretch(1, 1)
        self._add_row(tr("&Wearer"), wearer)
        self._add_row(tr("&Plan"), self._plan_field())
        camera, source_fields = self._camera_field()
        headset, headset_fields = self._headset_field(pairing_key)
        rig = PathField(tr("Rig file"), "file", tr("Rig files (*.yaml *.yml)"), tr("Example rig"))
        rig.setToolTip(
            tr("The offline calibration of headset and camera; the virtual headset accepts any.")
        )
        self._rig = rig
        rig_row = QWidget()
        fill_row(rig_row, rig, self.calibrate_rig, grows=rig)
        sessions = PathField(tr("Session folder"), "folder")
        sessions.setToolTip(tr("Each calibration gets its own folder in this folder."))
        rows: dict[Part, QWidget] = {
            "camera": camera,
            "headset": headset,
            "rig": rig_row,
            "sessions": sessions,
        }
        for part in PARTS:
            self._add_row(TITLES[part], rows[part])
            self._findings[part].keep_room()
            grid.addWidget(self._findings[part], grid.rowCount(), 1)
        grid.addWidget(self._advanced(), grid.rowCount(), 1)
        grid.setRowStretch(grid.rowCount(), 1)  # or the fields move apart on a tall page
        self._bound = Bound(
            {"plan.name": self._plan, "rig": rig, "sessions": sessions}
            | source_fields
            | headset_fields
            | self._calibration.fields,
            {"loss": 100.0, "reorder": 100.0} | self._calibration.factors,
            self,
        )
        self.show_settings(settings)
        self._source.currentIndexChanged.connect(self._suit_gate)
        self._bound.changed.connect(self._on_changed)
        self._eyes.currentIndexChanged.connect(self._on_changed)

    @property
    def settings(self) -> StationSettings:
        """The settings as shown; the guide chooses the eyes of the paper's plan."""
        settings = self._bound.take(self._settings)
        is_recommended = settings.plan.name == "recommended"
        return replace(
            settings,
            realsense=replace(self._realsense, serial=settings.realsense.serial),
            plan=replace(
                settings.plan,
                usable_eyes=_USABLE[self._eyes.currentData()] if is_recommended else EYES,
                is_automatic=is_recommended,
            ),
        )

    def show_settings(self, settings: StationSettings) -> None:
        """Show settings."""
        self._is_showing = True
        self._settings = settings
        self._realsense = settings.realsense
        with self._calibration.any_gate():
            self._bound.show(settings)
        usable = {*settings.plan.usable_eyes}
        name = next(key for key, eyes in _USABLE.items() if {*eyes} == usable)
        self._eyes.setCurrentIndex(self._eyes.findData(name))
        self._is_showing = False
        self._on_changed()

    def set_rig(self, path: str) -> None:
        """Show another rig file."""
        self._rig.set_path(path)

    def set_pairing_key(self, pairing_key: str) -> None:
        """Show another key."""
        self._key.set_key(pairing_key)

    def show_findings(self, findings: Mapping[Part, Finding]) -> None:
        """Show the finding about each part, with a button if one click can fix it."""
        for part, finding in findings.items():
            fix, changes = _fix(part, finding, self.settings)
            mend: Callable[[], object] = partial(self._change, changes)
            is_awaited = finding.health is Health.LIMITED and self.settings.headset == "network"
            if part == "headset" and is_awaited and not fix:
                fix, mend = tr("Co&nnect…"), self.connect_headset
            self._findings[part].show_finding(finding, fix, mend)

    def edit_realsense(self) -> None:
        """Open the dialog with the settings of the RealSense."""
        dialog = CameraSettingsDialog(self._realsense, self)
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.accepted.connect(lambda: self._use_realsense(dialog.settings()))
        dialog.open()

    def _use_realsense(self, settings: RealSenseSettings) -> None:
        self._realsense = settings
        self._on_changed()

    def _change(self, changes: Mapping[str, Any]) -> None:
        self.show_settings(replace(self.settings, **changes))

    def _on_changed(self) -> None:
        """Show the fields that belong to what is chosen."""
        if self._is_showing:
            return
        page = self._details_of.get(self._source.currentData())
        self._details.setVisible(page is not None)  # or the row is as wide as the widest page
        if page is not None:
            self._details.setCurrentWidget(page)
        is_network = self._headset.currentData() == "network"
        for part in self._of_network:
            part.setVisible(is_network)
        self._eyes.setVisible(self._plan.currentData() == "recommended")
        self.changed.emit()

    def _suit_gate(self) -> None:
        """Show the depth gate usual for the camera now chosen."""
        if self._is_showing:
            return
        former, self._settings = self._settings, self.settings
        suited = with_usual_gate(self._settings, former)
        if suited != self._settings:
            self.show_settings(suited)

    def _plan_field(self) -> QWidget:
        self._plan = choice("plan", tr("Plan"), _PLANS, _PLAN_HELP)
        self._eyes = choice(
            "usableEyes", tr("Eyes"), _EYES, tr("Only one, if the wearer sees with one eye.")
        )
        row = QWidget()
        fill_row(row, self._plan, self._eyes, grows=self._eyes)
        return row

    def _camera_field(self) -> tuple[QWidget, dict[str, QWidget]]:
        self._source = choice("source", tr("Camera"), _SOURCES)
        any_serial = tr("Any serial number")
        serial = with_name(QLineEdit(placeholderText=any_serial), "serial", tr("Serial number"))
        edit = button(
            "editRealSense",
            tr("Settin&gs…"),
            tr("Camera settings"),
            tr("Image size, preset, exposure, laser power and filters."),
        )
        edit.clicked.connect(self.edit_realsense)
        realsense = QWidget()
        fill_row(realsense, serial, edit, grows=serial)
        host = with_name(
            QLineEdit(placeholderText=tr("Address of the headset")), "hololens2Host", tr("Address")
        )
        other = with_name(QLineEdit(placeholderText=any_serial), "otherSerial", tr("Serial number"))
        recording = PathField(tr("Recording"), "either", _PATTERN)
        self._details_of: dict[Source, QWidget] = {
            "realsense": realsense,
            "hololens2": host,
            "oak": other,
            "orbbec": other,
            "recording": recording,
        }
        self._details = QStackedWidget()
        for page in dict.fromkeys(self._details_of.values()):
            self._details.addWidget(page)
        row = QWidget()
        fill_row(row, self._source, self._details, grows=self._details)
        return row, {
            "source": self._source,
            "realsense.serial": serial,
            "hololens2.host": host,
            "serial": other,
            "recording": recording,
        }

    def _headset_field(self, pairing_key: str) -> tuple[QWidget, dict[str, QWidget]]:
        self._headset = choice("headset", tr("Headset"), _HEADSETS)
        host = with_name(
            QLineEdit(),
            "host",
            tr("Address to listen on"),
            tr("Address of this computer on which to listen for the headset; 0.0.0.0 for all."),
        )
        port = whole_number("port", 1, 65535, tr("UDP port that the headset connects to."))
        address, pairing, first, field = QWidget(), QWidget(), QWidget(), QWidget()
        fill_row(address, QLabel(tr("at")), host, QLabel(tr("port")), port, grows=host)
        self._key = KeyField(tr("Cop&y"))  # masked until the user reveals it
        self._key.set_key(pairing_key)
        fill_row(pairing, QLabel(tr("Pairing key")), self._key, grows=self._key)
        fill_row(first, self._headset, address, grows=address)
        vbox(first, pairing, on=field, margins=0, spacing=SPACING_PX // 2)
        self._of_network = address, pairing
        return field, {"headset": self._headset, "host": host, "port": port}

    def _advanced(self) -> QWidget:
        """Return the rarely changed settings, folded at first."""
        real_time = with_name(
            QCheckBox(tr("Real time")),
            "realTime",
            help_text=tr("Plays at the recorded rate; otherwise every frame, as fast as possible."),
        )
        loop = with_name(QCheckBox(tr("Loop")), "loop", help_text=tr("Starts again at the end."))
        playback = QWidget()
        fill_row(playback, real_time, loop, grows=loop)
        side = choice("side", tr("Simulated hand"), _SIDES, tr("The hand that is raised."))
        seed = whole_number("seed", 0, 999_999, tr("Seed of the simulated wearer, hand and room."))
        loss = number("loss", 0.0, 50.0, 1.0, " %", tr("Datagrams dropped in each direction."))
        reorder = number("reorder", 0.0, 50.0, 1.0, " %", tr("Datagrams delivered out of order."))
        self._calibration.add(tr("Recordings"), playback)
        self._calibration.fields |= {"playback.real_time": real_time, "playback.loop": loop}
        self._calibration.add(tr("Simulated hand"), side, "side")
        self._calibration.add(tr("Simulated wearer"), seed, "seed")
        self._calibration.add(tr("Simulated loss"), loss, "loss")
        self._calibration.add(tr("Simulated reordering"), reorder, "reorder")
        fold = with_name(QToolButton(), "advanced")
        fold.setAutoRaise(True)
        fold.setText(tr("&Advanced"))
        fold.setCheckable(True)
        fold.setArrowType(Qt.ArrowType.RightArrow)
        fold.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)

        def expand(is_open: bool) -> None:
            fold.setArrowType(Qt.ArrowType.DownArrow if is_open else Qt.ArrowType.RightArrow)
            self._calibration.setVisible(is_open)
            if is_open and not fold.underMouse():
                # Opened by a key: on to the first field, once it is in sight.
                fold.setFocus()
                QTimer.singleShot(0, self, self.focusNextChild)

        fold.toggled.connect(expand)
        self._calibration.hide()
        advanced = QWidget()
        parts = vbox(fold, self._calibration, on=advanced, margins=0, spacing=SPACING_PX)
        parts.setAlignment(fold, Qt.AlignmentFlag.AlignLeft)
        return advanced

    def _add_row(self, title: str, field: QWidget) -> None:
        """Add a field, with its title aligned with the field's first line."""
        label = label_for(field, title)
        label.setMinimumHeight(QComboBox().sizeHint().height())
        row = self._grid.rowCount()
        self._grid.addWidget(label, row, 0, Qt.AlignmentFlag.AlignTop)
        self._grid.addWidget(field, row, 1)


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
        return tr("Use the example"), {"rig": ""}
    return "", {}

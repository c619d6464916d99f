"""The dialog with the preferences."""

from __future__ import annotations

from dataclasses import replace

from PySide6.QtGui import QIcon
from PySide6.QtWidgets import QCheckBox, QComboBox, QDialog, QDialogButtonBox, QWidget

from handcal.station.checks.preflight import gate_problem
from handcal_gui.app.preferences import Preferences, Theme
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.start.calibration_fields import CalibrationFields
from handcal_gui.widgets.entries_form import Bound
from handcal_gui.widgets.fields import (
    choice,
    make_equally_wide,
    number,
    paragraph,
    whole_number,
    with_name,
)
from handcal_gui.widgets.finding_line import FindingLine
from handcal_gui.widgets.layouts import keep_space, scrollable, vbox
from handcal_gui.widgets.path_field import PathField

_THEMES: dict[Theme, str] = {
    "system": tr("Same as the system"),
    "light": tr("Light"),
    "dark": tr("Dark"),
    "contrast": tr("High contrast"),
}

_TARGET_HELP = tr("Largest expected error of an eye that is accepted, in arcminutes.")
_LEARNED = {
    "": tr("Nothing"),
    "eyes": tr("Where eyes are"),
    "eyes far": tr("Where eyes are, even if far"),
    "eyes wearers": tr("Eyes, and what is seen wrongly"),
    "eyes far wearers": tr("All of it, even if far"),
}
"""Words for what is learned from earlier sessions, and their text."""
_LEARN_HELP = tr(
    "Learn from the finished sessions in this folder with the same rig, once there are enough:\n"
    "where wearers' eyes are; and from wearers with several sessions, how far beside, and how\n"
    "much larger, people see the hand than it is (otherwise 1′ and 0.25 % are assumed). A mean of\n"
    "the eyes more than 4 mm from the rig's viewpoint is used only with 'even if far': a fault of\n"
    "the rig or of the depth camera's edges is more likely."
)
_SLICER = {
    "": tr("Off"),
    "127.0.0.1": tr("For this computer"),
    "0.0.0.0": tr("For other computers, too"),  # noqa: S104 (chosen by the user, who is warned)
}
"""Addresses on which OpenIGTLink is served."""
_SLICER_HELP = tr(
    "Serve OpenIGTLink during calibrations, for 3D Slicer and others. It has no password:\n"
    "any computer that reaches the address can read."
)
_PORT_HELP = tr("TCP port of OpenIGTLink.")
_LSL_HELP = tr(
    "Send the events of calibrations to the Lab Streaming Layer, on which any computer of the\n"
    "local network can read them."
)


class PreferencesDialog(QDialog):
    """Theme, session folder, bridges, and the settings of future calibrations.

    A depth gate without room for a hand is refused beside its fields.

    Parameters
    ----------
    preferences : Preferences
        The current preferences.
    """

    def __init__(self, preferences: Preferences, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("preferencesDialog")
        self.setWindowTitle(tr("Preferences"))
        self._preferences = preferences
        self._learn = choice("learnPrior", tr("Learned"), _LEARNED, _LEARN_HELP)
        host = preferences.bridges.slicer_host
        hosts = _SLICER if host in _SLICER else {**_SLICER, host: host}  # typed into the file
        self._slicer = choice("slicer", "OpenIGTLink", hosts, _SLICER_HELP)
        self._port = whole_number("slicerPort", 1, 65535, _PORT_HELP)
        self._slicer.currentIndexChanged.connect(self._allow_port)
        self._fields = fields = CalibrationFields("station.calibration.", has_letters=True)
        fields.add(
            tr("Tar&get"),
            number("target", 1.0, 60.0, 0.5, " ′", _TARGET_HELP),
            "station.calibration.solve.verdict.target_arcmin",
        )
        fields.add(tr("&Learned"), self._learn)
        fields.add_heading(tr("Sent to other programs by the next calibrations"))
        fields.add("Open&IGTLink", self._slicer, "bridges.slicer_host")
        fields.add(tr("&Port"), self._port, "bridges.slicer_port")
        events = with_name(QCheckBox(tr("Send &events")), "lsl", help_text=_LSL_HELP)
        fields.add("LSL", events, "bridges.lsl")
        fields.add_heading(tr("Program"))
        fields.add(tr("The&me"), choice("theme", tr("Theme"), _THEMES), "theme")
        fields.add(
            tr("Session f&older"), PathField(tr("Session folder"), "folder"), "station.sessions"
        )
        make_equally_wide(fields.findChildren(QComboBox))
        self._gate_found = FindingLine("gate")
        keep_space(self._gate_found)
        self._buttons = QDialogButtonBox(
            QDialogButtonBox.StandardButton.Ok
            | QDialogButtonBox.StandardButton.Cancel
            | QDialogButtonBox.StandardButton.RestoreDefaults
        )
        self._bound = Bound(fields.fields, fields.factors, self)
        self._lay_out()
        self._show(preferences)
        self._bound.changed.connect(self._refresh)
        self._refresh()

    def preferences(self) -> Preferences:
        """Return the preferences with the values shown."""
        shown = self._bound.take(self._preferences)
        station = shown.station
        learned = self._learn.currentData().split()
        station = replace(
            station,
            sessions=station.sessions or self._preferences.station.sessions,
            learn_prior="eyes" in learned,
            use_far_prior="far" in learned,
            learn_wearers="wearers" in learned,
        )
        return replace(shown, station=station)

    def _show(self, preferences: Preferences) -> None:
        """Show the values of preferences."""
        station = preferences.station
        with self._fields.any_gate():
            self._bound.show(preferences)
        words = {
            "eyes": station.learn_prior,
            "far": station.use_far_prior,
            "wearers": station.learn_wearers,
        }
        learned = " ".join(word for word, is_set in words.items() if is_set)
        self._learn.setCurrentIndex(max(0, self._learn.findData(learned)))
        self._allow_port()

    def _allow_port(self) -> None:
        self._port.setEnabled(bool(self._slicer.currentData()))

    def _refresh(self) -> None:
        """Show what is wrong with the depth gate, and allow OK unless something is refused."""
        problem = gate_problem(self.preferences().station)
        self._gate_found.setVisible(problem is not None)
        if problem is not None:
            self._gate_found.show_finding(problem)
        self._ok.setEnabled(problem is None)

    def _lay_out(self) -> None:
        buttons = self._buttons
        for one in buttons.buttons():
            one.setIcon(QIcon())  # like all other buttons
        buttons.accepted.connect(self.accept)
        buttons.rejected.connect(self.reject)
        self._ok = buttons.button(QDialogButtonBox.StandardButton.Ok)
        defaults = buttons.button(QDialogButtonBox.StandardButton.RestoreDefaults)
        defaults.setText(tr("Restore &defaults"))
        defaults.setToolTip(tr("Shows the default of every field; Cancel keeps the former values."))
        defaults.clicked.connect(lambda: self._show(Preferences()))
        area = scrollable(self._fields)
        about = paragraph(
            "about",
            tr("Change what you need and press OK. A running calibration keeps its settings."),
        )
        parts = about, (area, 1), self._gate_found, buttons
        vbox(*parts, on=self, margins=SPACING_PX * 3 // 2, spacing=SPACING_PX)
        bar_px = area.verticalScrollBar().sizeHint().width()
        area.setMinimumWidth(self._fields.sizeHint().width() + bar_px)
        self.resize(
            self._fields.sizeHint().width() + 16 * SPACING_PX,
            self._fields.sizeHint().height() + 20 * SPACING_PX,
        )

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
from handcal_gui.widgets.layouts import scrollable, vbox
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
        self._theme = choice("theme", tr("Theme"), _THEMES)
        self._sessions = PathField(tr("Session folder"), "folder")
        self._calibration = CalibrationFields(explains=True)
        self._target = number("target", 1.0, 60.0, 0.5, " ′", _TARGET_HELP)
        self._learn = choice("learnPrior", tr("Learned"), _LEARNED, _LEARN_HELP)
        host = preferences.bridges.slicer_host
        hosts = _SLICER if host in _SLICER else {**_SLICER, host: host}  # typed into the file
        self._slicer = choice("slicer", "OpenIGTLink", hosts, _SLICER_HELP)
        self._port = whole_number("slicerPort", 1, 65535, _PORT_HELP)
        self._slicer.currentIndexChanged.connect(
            lambda: self._port.setEnabled(bool(self._slicer.currentData()))
        )
        self._lsl = with_name(QCheckBox(tr("Send &events")), "lsl", help_text=_LSL_HELP)
        self._buttons = QDialogButtonBox(
            QDialogButtonBox.StandardButton.Ok
            | QDialogButtonBox.StandardButton.Cancel
            | QDialogButtonBox.StandardButton.RestoreDefaults
        )
        self._bound = Bound(
            {
                "theme": self._theme,
                "bridges.slicer_host": self._slicer,
                "bridges.slicer_port": self._port,
                "bridges.lsl": self._lsl,
                "station.sessions": self._sessions,
                "station.calibration.solve.verdict.target_arcmin": self._target,
            },
            parent=self,
        )
        self._lay_out()
        self._show(preferences)
        self._calibration.changed.connect(self._refresh)
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
            calibration=self._calibration.take(station.calibration),
        )
        return replace(shown, station=station)

    def _show(self, preferences: Preferences) -> None:
        """Show the values of preferences."""
        station = preferences.station
        self._bound.show(preferences)
        self._calibration.show_settings(station.calibration)
        words = {
            "eyes": station.learn_prior,
            "far": station.use_far_prior,
            "wearers": station.learn_wearers,
        }
        learned = " ".join(word for word, is_set in words.items() if is_set)
        self._learn.setCurrentIndex(max(0, self._learn.findData(learned)))
        self._port.setEnabled(bool(preferences.bridges.slicer_host))

    def _refresh(self) -> None:
        """Show what is wrong with the depth gate, and allow OK unless something is refused."""
        problem = gate_problem(self.preferences().station)
        self._calibration.show_gate_problem(problem)
        self._ok.setEnabled(problem is None)

    def _lay_out(self) -> None:
        add = self._calibration.add_row
        add(
            tr("Tar&get"),
            self._target,
            tr("Largest expected error of an accepted eye; 60′ is 1°."),
        )
        add(tr("&Learned"), self._learn, tr("What earlier sessions tell of the next wearer."))
        self._calibration.add_heading(tr("Sent to other programs by the next calibrations"))
        add("Open&IGTLink", self._slicer, tr("Poses and results, for 3D Slicer; no password."))
        add(tr("&Port"), self._port, tr("TCP port of OpenIGTLink on this computer."))
        add("LSL", self._lsl, tr("Marks events in recordings of other instruments."))
        self._calibration.add_heading(tr("Program"))
        add(tr("The&me"), self._theme, tr("Colours of all windows."))
        add(tr("Session f&older"), self._sessions)
        make_equally_wide(self._calibration.findChildren(QComboBox))
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
        area = scrollable(self._calibration)
        about = paragraph(
            "about",
            tr("Change what you need and press OK. A running calibration keeps its settings."),
        )
        margin_px = SPACING_PX * 3 // 2  # with it, all fields are in sight on a small screen
        vbox(about, (area, 1), buttons, on=self, margins=margin_px, spacing=SPACING_PX)
        form, foot = self._calibration.sizeHint(), about.sizeHint() + buttons.sizeHint()
        self.resize(
            form.width() + area.verticalScrollBar().sizeHint().width() + 4 * SPACING_PX,
            form.height() + foot.height() + 5 * SPACING_PX,
        )

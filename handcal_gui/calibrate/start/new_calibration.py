"""The form that starts a calibration."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from functools import partial

from PySide6.QtCore import Qt, QTimer, Signal
from PySide6.QtGui import QHideEvent, QKeyEvent, QShowEvent
from PySide6.QtWidgets import (
    QApplication,
    QComboBox,
    QCompleter,
    QLineEdit,
    QSizePolicy,
    QWidget,
)

from handcal.core.progress import Progress
from handcal.session.state import MAX_WEARER_CHARACTERS, clean_wearer
from handcal.station.checks.doctor import Finding, Health
from handcal.station.checks.preflight import Part, is_ready
from handcal.station.settings import StationSettings
from handcal_gui.app.keys import native
from handcal_gui.app.preferences import Preferences
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.start.card import Card
from handcal_gui.calibrate.start.station_form import StationForm
from handcal_gui.engine.latest_job import LatestJob
from handcal_gui.widgets.brief import limit_length
from handcal_gui.widgets.fields import button, main_button, paragraph, with_name
from handcal_gui.widgets.layouts import hbox, scrollable, vbox
from handcal_gui.widgets.sentence import sentence

Check = Callable[[StationSettings, str, Progress], Mapping[Part, Finding]]

_SETTLE_MS, _AGAIN_MS = 300, 3000
_AGAIN_BY_PROCESS_MS = 10_000
"""For a RealSense, which another process looks for: 0.2 s of processor time."""


class NewCalibration(Card):
    """Wearer, camera, headset, rig and folder, checked as they are chosen; Enter starts.

    Parameters
    ----------
    preferences : Preferences
    pairing_key : str
    check : callable
        Given settings, pairing key and a progress that may be cancelled, returns the finding about
        each part; called in a job.

    Attributes
    ----------
    start_requested : Signal(StationSettings, str)
        The settings of a station that has just passed its checks, and the wearer.
    form : StationForm
    cancel_requested : Signal()
        The user cancels the opening of the station.
    """

    start_requested = Signal(object, str)
    cancel_requested = Signal()

    def __init__(self, preferences: Preferences, pairing_key: str, check: Check) -> None:
        super().__init__(
            tr("Start a calibration"),
            tr("The settings are kept for the next wearer."),
            "hand",
        )
        self.setObjectName("newCalibration")
        self._key = pairing_key
        self._starting: str | None = None
        self._is_opening = False
        self._wearer = with_name(QComboBox(), "wearer", tr("Wearer's name or code"))
        name = QLineEdit(placeholderText=tr("Name or code"))
        limit_length(name, MAX_WEARER_CHARACTERS)
        name.textEdited.connect(self._drop_blanks)
        self._wearer.setLineEdit(name)
        self._wearer.setEditable(True)
        self._wearer.setInsertPolicy(QComboBox.InsertPolicy.NoInsert)
        completer = self._wearer.completer()
        assert completer is not None
        # A list: typed in by itself, a former wearer's name would be taken for the present one's.
        completer.setCompletionMode(QCompleter.CompletionMode.PopupCompletion)
        name.returnPressed.connect(partial(self._start_past, completer))
        self._wearer_problem = paragraph("wearerProblem")
        self._wearer_problem.hide()
        self._wearer.editTextChanged.connect(self._show_wearer_problem)
        wearer = QWidget()
        vbox(self._wearer, self._wearer_problem, on=wearer, margins=0, spacing=0)
        wearer.setFocusProxy(self._wearer)
        self.form = StationForm(wearer, preferences.station, pairing_key)
        self._problem = paragraph("startProblem")
        self._button = main_button("start", tr("Start calibration"))
        self._button.setToolTip(native("Return"))
        self._cancel = button("cancelOpening", tr("Cancel"), help_text=tr("Cancel the start (Esc)"))
        # Without focus, a second press of the key that started it does not cancel.
        self._cancel.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self._cancel.hide()
        self.setFocusPolicy(Qt.FocusPolicy.ClickFocus)
        self._lay_out()
        self._has_stopped = threading.Event()
        progress = Progress(is_cancelled=self._has_stopped.is_set)
        self._check = LatestJob(lambda asked: check(asked[0], asked[1], progress), self)
        self._check.answered.connect(self._on_findings)
        self._check.failed.connect(self._show_problem)
        self._settle = QTimer(self, interval=_SETTLE_MS, singleShot=True)
        self._again = QTimer(self, singleShot=True)
        self._settle.timeout.connect(self.check)
        self._again.timeout.connect(self.check)
        self.form.changed.connect(self._settle.start)
        self._button.clicked.connect(self.start)
        self._cancel.clicked.connect(self._cancel_opening)
        self._button.setEnabled(False)
        self.show_preferences(preferences)

    @property
    def settings(self) -> StationSettings:
        """The settings as shown."""
        return self.form.settings

    @property
    def is_changed(self) -> bool:
        """True if the settings are not those that were given to be shown."""
        return self.settings != self._given

    def show_preferences(self, preferences: Preferences) -> None:
        """Show the preferences, for the next wearer."""
        self.show_settings(preferences.station)
        self._wearer.setCurrentIndex(-1)
        self._wearer.clearEditText()

    def show_settings(self, settings: StationSettings) -> None:
        """Show other settings; a wearer's name that has been typed stays."""
        self.form.show_settings(settings)
        self._given = self.settings

    def show_wearers(self, names: Sequence[str]) -> None:
        """Offer the names of earlier wearers; what has been typed stays."""
        if list(names) == [self._wearer.itemText(i) for i in range(self._wearer.count())]:
            return
        typed = self._wearer.currentText()
        self._wearer.clear()
        self._wearer.addItems(list(names))
        self._wearer.setCurrentIndex(-1)
        self._wearer.setEditText(typed)

    def set_pairing_key(self, pairing_key: str) -> None:
        """Use another key for network headsets."""
        self._key = pairing_key
        self.form.set_pairing_key(pairing_key)
        self.check()

    def check(self) -> None:
        """Check the station with the settings shown, unless it may be in use or being opened.

        A dialog may hold the headset's port.
        """
        is_covered = QApplication.activeModalWidget() is not None
        if self.isVisible() and not self._is_opening and not is_covered:
            self._check.ask(self._question())
            if not self._button.isEnabled() and not self._problem.text():
                self._problem.setText(tr("Checking camera, headset and files…"))
        if self.isVisible():
            self._again.start(self._again_ms())

    def start(self) -> None:
        """Check the station again, and start if it is ready."""
        try:
            self._starting = clean_wearer(self._wearer.currentText())
        except ValueError:
            self._wearer.setFocus()  # the reason is below the name
            return
        self._button.setEnabled(False)
        self.check()

    def set_opening(self, is_opening: bool) -> None:
        """Disable the fields while a station is being opened, and show a Cancel button."""
        self._is_opening = is_opening
        self.form.setEnabled(not is_opening)
        self._cancel.setVisible(is_opening)
        self._cancel.setEnabled(True)
        self._problem.setText(tr("Opening camera and headset…") if is_opening else "")
        if is_opening:
            self._button.setEnabled(False)
            self.setFocus()
        else:
            self._wearer.setFocus()
            self.check()

    def stop(self) -> None:
        """Cancel background work and wait for its end; called before the program ends."""
        self._has_stopped.set()
        self._settle.stop()
        self._again.stop()
        self._check.stop()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Start on Enter; cancel the opening of a station on Esc."""
        # Ctrl+Return is the guide's: once too often, it would start without a name.
        is_plain = not event.modifiers() & ~Qt.KeyboardModifier.KeypadModifier
        if event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter) and is_plain:
            self._button.click()
        elif event.key() == Qt.Key.Key_Escape and self._is_opening:
            self._cancel.click()
        else:
            super().keyPressEvent(event)

    def showEvent(self, event: QShowEvent) -> None:
        """Check the station regularly while the form is shown, and focus the wearer's field."""
        super().showEvent(event)
        self._wearer.setFocus()
        self.check()

    def hideEvent(self, event: QHideEvent) -> None:
        """Stop checking the station."""
        super().hideEvent(event)
        self._settle.stop()
        self._again.stop()

    def _again_ms(self) -> int:
        return _AGAIN_BY_PROCESS_MS if self.settings.source == "realsense" else _AGAIN_MS

    def _question(self) -> tuple[StationSettings, str]:
        return self.form.settings, self._key

    def _on_findings(self, question: object, findings: Mapping[Part, Finding]) -> None:
        if self._is_opening or question != self._question():
            return  # outdated: an answer to the settings now shown will follow
        self.form.show_findings(findings)
        broken = [part.what for part in findings.values() if part.health is Health.BROKEN]
        self._problem.setText(tr("Fix first: {}.").format(", ".join(broken)) if broken else "")
        self._button.setEnabled(is_ready(findings))
        wearer, self._starting = self._starting, None
        if wearer is not None and is_ready(findings):
            self.start_requested.emit(self.form.settings, wearer)

    def _cancel_opening(self) -> None:
        self._cancel.setEnabled(False)
        self._problem.setText(tr("Cancelling once camera and headset are open…"))
        self.cancel_requested.emit()

    def _show_problem(self, why: str) -> None:
        self._starting = None
        self._problem.setText(why)

    def _drop_blanks(self, typed: str) -> None:
        """Take no blanks before a name: the space bar pressed the former page's button."""
        if typed != typed.lstrip():
            self._wearer.setEditText(typed.lstrip())

    def _start_past(self, completer: QCompleter) -> None:
        """Start on Enter while a list of names is open, which keeps the key from the form."""
        names = completer.popup()
        if names is not None and names.isVisible() and not names.currentIndex().isValid():
            self._button.click()

    def _show_wearer_problem(self, typed: str) -> None:
        try:
            clean_wearer(typed)
            problem = ""
        except ValueError as error:
            problem = f"{sentence(str(error))}."
        self._wearer_problem.setText(problem)
        self._wearer_problem.setVisible(bool(problem))

    def _lay_out(self) -> None:
        last = hbox((self._problem, 1), self._cancel, self._button, spacing=SPACING_PX)
        form = scrollable(self.form)
        # Or the page around it would scroll, and hide the button.
        form.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Ignored)
        self.body.addWidget(form, 1)
        self.body.addLayout(last)  # in sight, however long the form

"""The program: builds window, pages and panels, connects them, and closes them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from PySide6.QtCore import QByteArray, QObject, QSize, Qt, QTimer
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QApplication, QMessageBox

from handcal.calibration.plan import with_eyes
from handcal.calibration.solve_again import may_still_be_worn
from handcal.core.errors import FileError
from handcal.core.types import EyePlan
from handcal.session.session import Session
from handcal.station.settings import StationSettings
from handcal.station.station import Station
from handcal_gui import FIRST_SIZE_PX
from handcal_gui.app.menus import add_edit_menu, add_help_menu
from handcal_gui.app.preferences import CurrentPreferences, Preferences, PreferencesFile
from handcal_gui.app.separate_windows import SeparateWindows
from handcal_gui.app.theme import use_theme
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.control.live import CalibrationController
from handcal_gui.calibrate.control.review import ReviewController
from handcal_gui.calibrate.guide.view import Action
from handcal_gui.calibrate.guide.wizard import WizardPanel
from handcal_gui.calibrate.review_page import ReviewPage
from handcal_gui.calibrate.sections import Panels
from handcal_gui.calibrate.start.example import copy_example
from handcal_gui.calibrate.start.start_page import StartPage, ask_whether_worn
from handcal_gui.calibrate.window import MainWindow
from handcal_gui.widgets.fields import plain_message
from handcal_gui.widgets.sentence import sentence

_AGAIN_MS = 100
"""Wait for the code behind a closed question to go on."""


class Program(QObject):
    """Owns the window, with its pages and panels, and the controllers behind it.

    Parameters
    ----------
    file : PreferencesFile
    remembers : bool
        Whether changes of the preferences are written to the file.

    Attributes
    ----------
    window : MainWindow
    wizard_panel : WizardPanel
    live : CalibrationController
    review : ReviewController
    start : StartPage
    windows : SeparateWindows
    """

    def __init__(self, file: PreferencesFile, remembers: bool = True) -> None:
        super().__init__()
        self._current = CurrentPreferences(file, remembers)
        self._use_theme()
        QGuiApplication.styleHints().colorSchemeChanged.connect(self._use_theme)
        self.start = StartPage(self.preferences, self._current.pairings.open_key())
        self.wizard_panel = WizardPanel()
        review_page = ReviewPage()
        self.window = MainWindow(self.start, self.wizard_panel, review_page, Panels())
        self.live = CalibrationController(self.window, self.wizard_panel)
        self.review = ReviewController(self.window, review_page)
        self.windows = SeparateWindows(
            self.window,
            self.start,
            self.live,
            self.review,
            self._current,
            self.open_session,
            self.resume_session,
        )
        self._connect(review_page)
        self._make_menus()
        state = self._restore()
        self.show_start()
        self.window.setWindowState(state)
        self.window.banner.show_message(self._current.complaint)

    @property
    def preferences(self) -> Preferences:
        """The current preferences."""
        return self._current.now

    def use_for_one_run(self, settings: StationSettings) -> None:
        """Use settings of the station that are not remembered, such as those of a command."""
        self._current.use_for_one_run(settings)
        self.start.show_preferences(self.preferences)

    def start_calibration(self, settings: StationSettings, wearer: str) -> None:
        """Open a station for a wearer."""
        self._current.change(station=settings)
        followed = self._followed(settings)
        self._run(lambda: Station(followed, wearer, pairings=self._current.pairings))

    def resume_session(self, path: Path) -> None:
        """Resume a session with the headset still on, or begin another one from its result."""
        try:
            record = Session.open(path)
        except FileError as error:
            self.window.banner.show_message(str(error))
            return
        stayed_on: bool | None = True
        if record.is_solvable:  # or nothing in it depends on how the headset sits
            stayed_on = may_still_be_worn(record) and ask_whether_worn(self.window, record)
        if stayed_on is None:
            return
        if not stayed_on:
            self.begin_from(path)
            return
        if not self._may_leave():
            return
        self.start.keep_entries(self._current)
        followed = self._followed(self.preferences.station)
        self._run(lambda: Station(followed, resume=path, pairings=self._current.pairings))

    def begin_from(self, path: Path) -> None:
        """Begin a session from a stored one of the same wearer, whose φ is verified first."""
        if not self._may_leave():
            return
        station = self.preferences.station
        recommended = replace(station, plan=replace(station.plan, name="recommended"))
        settings = self._followed(recommended)
        try:
            record = Session.open(path)
        except FileError as error:
            self.window.banner.show_message(str(error))
            return
        plan = replace(settings.plan, usable_eyes=record.facts.usable_eyes)
        settings = replace(settings, plan=plan)
        self._run(
            lambda: Station(settings, record.wearer, pairings=self._current.pairings, former=path)
        )

    def open_session(self, path: Path) -> None:
        """Open a stored session for review."""
        if not self._may_leave():
            return
        self.start.keep_entries(self._current)
        self.live.stop()
        self.window.banner.clear()
        self.review.open(path)

    def open_example(self, sessions: Path) -> None:
        """Open the example session, copied to a session folder."""
        try:
            self.open_session(copy_example(sessions))
        except FileError as error:
            self.window.banner.show_message(str(error))

    def show_start(self) -> None:
        """End the calibration or review, and show the start page."""
        self.start.keep_entries(self._current)
        self.live.stop()
        self.review.close()
        self.start.set_opening(False)
        self.start.show_preferences(self.preferences)
        self.window.show_page("start")

    def end(self) -> None:
        """Close the window without asking, as nobody may be there to answer."""
        self.window.may_close = lambda: True
        if (asked := QApplication.activeModalWidget()) is not None:
            asked.close()
        self.window.close()
        if self.window.isVisible():  # it asked whether it may close, and has not gone on yet
            QTimer.singleShot(_AGAIN_MS, self.end)

    def close(self) -> None:
        """Save the window's layout and end all running work; safe to call twice."""
        self.start.keep_entries(self._current)
        self._current.change(
            geometry=self.window.saveGeometry().toBase64().toStdString(),
            layout=self.window.layout_text(),
            fine_tune_step_m=self.window.panels.fine_tune.step_m,
            hidden_layers=self.window.panels.cloud.hidden_layers,
        )
        self.windows.close()
        self.live.stop()
        self.review.close()
        self.start.stop()

    def _connect(self, review_page: ReviewPage) -> None:
        self.start.new.start_requested.connect(self.start_calibration)
        self.start.new.cancel_requested.connect(self.live.cancel)
        self.start.unfinished.chosen.connect(self.resume_session)
        self.start.recent.chosen.connect(self.open_session)
        self.start.open_example = self.open_example
        self.start.show_library = self.windows.show_library
        self.start.new.form.calibrate_rig.clicked.connect(lambda: self.windows.calibrate_rig())
        self.start.new.form.connect_headset = self.windows.connect_headset
        self.start.evaluate.clicked.connect(lambda: self.windows.evaluate())
        self.live.ended.connect(self._on_ended)
        self.live.opened.connect(self._current.add_session)
        self.live.on = {
            Action.EXPORT: self.windows.export,
            Action.NEXT_WEARER: self._show_next_wearer,
            Action.SLIPPED: self._begin_from_shown,
        }
        self.review.opened.connect(self._current.add_session)
        self.review.failed.connect(self._on_ended)
        review_page.export_button.clicked.connect(lambda: self.windows.export())
        review_page.openxr_button.clicked.connect(lambda: self.windows.use_in_openxr())
        review_page.resume_button.clicked.connect(self._resume_reviewed)
        review_page.again_button.clicked.connect(self._begin_from_shown)
        review_page.close_button.clicked.connect(self.show_start)
        self.wizard_panel.choose_eyes = self._choose_eyes
        self.wizard_panel.remember_hold = lambda is_held: self._current.change(
            runs_itself=not is_held
        )
        self.window.arrangement_changed.connect(
            lambda chosen: self._current.change(arrangement=chosen)
        )
        panels = self.window.panels
        panels.session.export_button.clicked.connect(lambda: self.windows.export())
        panels.session.inspect_button.clicked.connect(lambda: self.windows.inspect())
        panels.link.new_key.clicked.connect(self._renew_key)
        panels.link.connect_headset.clicked.connect(self.windows.connect_headset)
        self._current.not_saved.connect(self.window.banner.show_message)
        self.window.closing.connect(self.close)
        self.window.may_close = self._may_leave

    def _make_menus(self) -> None:
        add = self.window.add_action
        add("File", tr("&Next wearer"), "Ctrl+N", self._show_next_wearer)
        add("File", tr("&Open session…"), "Ctrl+O", self.windows.browse)
        add("File", tr("&Sessions…"), "Ctrl+L", self.windows.show_library)
        add("File", tr("&Export…"), "Ctrl+E", self.windows.export)
        add("File", tr("&Use in OpenXR programs…"), "", self.windows.use_in_openxr)
        add("File", tr("&Inspect in 3D"), "", self.windows.inspect)
        add("File", tr("Connect a &headset…"), "", self.windows.connect_headset)
        add("File", tr("&Calibrate a rig…"), "", self.windows.calibrate_rig)
        add("File", tr("E&valuate…"), "", self.windows.evaluate)
        add("File", tr("&Preferences…"), "Ctrl+,", self.windows.edit_preferences)
        add("File", tr("&Quit"), "Ctrl+Q", self.window.close)
        add("View", tr("&Reset layout"), "", self.window.reset_layout)
        add_edit_menu(self.window, self.windows.show_library)
        add_help_menu(self.window, self.windows.make_support_bundle)

    def _restore(self) -> Qt.WindowState:
        """Restore the window as it was left, and return its state, to be set in the end."""
        preferences = self.preferences
        self.window.panels.fine_tune.set_step_m(preferences.fine_tune_step_m)
        self.window.panels.cloud.hide_layers(preferences.hidden_layers)
        geometry = QByteArray.fromBase64(preferences.geometry.encode())
        if not self.window.restoreGeometry(geometry):  # none, or that of a far larger screen
            screen = QGuiApplication.primaryScreen().availableSize()
            self.window.resize(screen.boundedTo(QSize(*FIRST_SIZE_PX)))
        state = self.window.windowState()
        self.window.setWindowState(Qt.WindowState.WindowNoState)
        self.window.restore_layout(preferences.layout)
        self.window.use_arrangement(preferences.arrangement)
        return state

    def _use_theme(self) -> None:
        use_theme(self.preferences.theme)

    def _followed(self, settings: StationSettings) -> StationSettings:
        """Return settings whose plan the station follows, in the order of eyes that was chosen."""
        plan = replace(settings.plan, is_automatic=True)
        if plan.name == "paper":
            plan = with_eyes(plan, self.preferences.plan)
        return replace(settings, plan=plan)

    def _run(self, open_station: Callable[[], Station]) -> None:
        self.review.close()
        self.window.banner.clear()
        is_held = not self.preferences.runs_itself
        self.live.start(open_station, bridges=self.preferences.bridges, is_held=is_held)
        self.start.set_opening(True)
        self.window.show_page("start")

    def _show_next_wearer(self) -> None:
        if self._may_leave():
            self.window.banner.clear()  # what was said of the former wearer
            self.show_start()

    def _may_leave(self) -> bool:
        """Ask before a calibration ends whose newest data could not be written yet."""
        snapshot = self.live.snapshot
        problems = [snapshot.not_stored if snapshot else "", self.live.save_notes()]
        told = [sentence(problem) for problem in problems if problem]
        if not told:
            return True
        told.append(tr("They are lost if the calibration ends now. Cancel, and see to this first."))
        buttons = QMessageBox.StandardButton
        answer = QMessageBox.warning(
            self.window,
            tr("Not saved yet"),
            plain_message("\n\n".join(told)),
            buttons.Discard | buttons.Cancel,
            buttons.Cancel,
        )
        return answer == buttons.Discard

    def _choose_eyes(self, eyes: EyePlan) -> None:
        self._current.change(plan=eyes)
        self.live.choose_eyes(eyes)

    def _resume_reviewed(self) -> None:
        if self.review.record is not None:
            self.resume_session(self.review.record.path)

    def _begin_from_shown(self) -> None:
        record = self.windows.record
        if record is not None:
            self.begin_from(record.path)

    def _on_ended(self, why: str) -> None:
        if why:
            self.show_start()
            self.window.banner.show_message(why)
        elif self.window.page == "start":  # cancelled
            self.start.set_opening(False)

    def _renew_key(self) -> None:
        question = tr(
            "Make a new pairing key? From the next calibration on, no headset connects until the "
            "new key is entered in it."
        )
        buttons = QMessageBox.StandardButton
        if QMessageBox.question(self.window, tr("New key"), question) != buttons.Yes:
            return
        self._current.renew_pairing_key()
        self.start.new.set_pairing_key(self._current.pairings.open_key())
        self.window.banner.show_message(
            tr("A new pairing key was made. Enter it in the headsets before the next calibration.")
        )

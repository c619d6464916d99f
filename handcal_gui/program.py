"""The program: builds window, pages and panels, connects them, and closes them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QByteArray, QObject, QSize, Qt, Signal
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QDialog, QFileDialog, QWidget

from handcal.errors import FileError, HandcalError
from handcal.export.export import ExportSettings, export_session
from handcal.export.many import export_sessions
from handcal.link.server import HeadsetServer
from handcal.progress import Progress
from handcal.rig.rig_file import read_rig
from handcal.session.session import Session, SessionRecord
from handcal.station.settings import StationSettings
from handcal.station.station import Station
from handcal.station.support import SupportSettings
from handcal_gui import FIRST_SIZE_PX
from handcal_gui.control.compare import Comparison
from handcal_gui.control.inspection import Inspection
from handcal_gui.control.live import CalibrationController
from handcal_gui.control.review import ReviewController
from handcal_gui.dialogs.connect import ConnectDialog
from handcal_gui.dialogs.export import Export, ExportDialog
from handcal_gui.dialogs.preferences import PreferencesDialog
from handcal_gui.dialogs.support import SupportDialog
from handcal_gui.docks import Panels
from handcal_gui.edit_menu import add_edit_menu
from handcal_gui.evaluation_entries import EvaluationEntries
from handcal_gui.help_menu import add_help_menu
from handcal_gui.pages.review_page import ReviewPage
from handcal_gui.pages.start.example import copy_example
from handcal_gui.pages.start.start_page import StartPage
from handcal_gui.pages.wizard.wizard import WizardPanel
from handcal_gui.panels.camera.panel import CameraPanel
from handcal_gui.panels.cloud.panel import CloudPanel
from handcal_gui.panels.fine_tune.panel import FineTunePanel
from handcal_gui.panels.link.panel import LinkPanel
from handcal_gui.panels.results.panel import ResultsPanel
from handcal_gui.panels.rotation.panel import RotationPanel
from handcal_gui.panels.session.panel import SessionPanel
from handcal_gui.panels.trials.panel import TrialsPanel
from handcal_gui.panels.wearer_view.panel import WearerViewPanel
from handcal_gui.preferences import CurrentPreferences, Preferences, PreferencesFile
from handcal_gui.theme import use_theme
from handcal_gui.translation import tr
from handcal_gui.widgets.placement import keep_on_screen
from handcal_gui.window import MainWindow, Page
from handcal_gui.windows.manual import Manual

if TYPE_CHECKING:  # imported when they open: they take longer than all the rest
    from handcal_gui.windows.evaluation.window import EvaluationWindow
    from handcal_gui.windows.library.window import LibraryWindow
    from handcal_gui.windows.rig.wizard import RigWizard


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
    inspection : Inspection
    start : StartPage
    manual : Manual
    ending : Signal()
        The program is about to end; dialogs end their work.
    """

    ending = Signal()

    def __init__(self, file: PreferencesFile, remembers: bool = True) -> None:
        super().__init__()
        self._current = CurrentPreferences(file, remembers)
        self._use_theme()
        QGuiApplication.styleHints().colorSchemeChanged.connect(self._use_theme)
        panels = Panels(
            camera=CameraPanel(),
            cloud=CloudPanel(),
            wearer_view=WearerViewPanel(),
            rotation=RotationPanel(),
            results=ResultsPanel(),
            fine_tune=FineTunePanel(),
            trials=TrialsPanel(),
            session=SessionPanel(),
            link=LinkPanel(),
        )
        self.start = StartPage(self.preferences, self._current.pairings.open_key())
        self.wizard_panel = WizardPanel()
        review_page = ReviewPage()
        self.window = MainWindow(self.start, self.wizard_panel, review_page, panels)
        self.manual = Manual(self.window)
        comparison = Comparison(panels.results)
        self.live = CalibrationController(self.window, self.wizard_panel, comparison)
        self.review = ReviewController(self.window, review_page, comparison)
        self.inspection = Inspection(self.window)
        self._connect(review_page)
        self._make_menus()
        self._restore()
        self.show_start()
        self.window.banner.show_message(self._current.complaint)

    @property
    def preferences(self) -> Preferences:
        """The current preferences."""
        return self._current.now

    def start_calibration(self, settings: StationSettings, wearer: str) -> None:
        """Open a station for a wearer."""
        self._current.change(station=settings)
        self._run(lambda: Station(settings, wearer, pairings=self._current.pairings))

    def resume_session(self, path: Path) -> None:
        """Resume a session, at the station that was used last."""
        settings = self.preferences.station
        self._run(lambda: Station(settings, resume=path, pairings=self._current.pairings))

    def begin_from(self, path: Path) -> None:
        """Begin a session from a stored one of the same wearer, whose φ is verified first."""
        station = self.preferences.station
        plan = replace(station.plan, name="recommended", is_automatic=True)
        settings = replace(station, plan=plan)
        try:
            wearer = Session.open(path).wearer
        except FileError as error:
            self.window.banner.show_message(str(error))
            return
        self._run(lambda: Station(settings, wearer, pairings=self._current.pairings, former=path))

    def open_session(self, path: Path) -> None:
        """Open a stored session for review."""
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
        self.live.stop()
        self.review.close()
        self.start.set_opening(False)
        self.start.show_preferences(self.preferences)
        self.window.show_page("start")

    def export(self, folder: Path | None = None) -> ExportDialog | None:
        """Open the export dialog for the session shown; return None if it has no alignment.

        Parameters
        ----------
        folder : Path, optional
            Proposed folder; by default that of the last export.
        """
        record = self._record()
        if record is None or not record.alignments:
            self.window.banner.show_message(tr("There is no alignment to export yet."))
            return None
        folder = folder or Path(self.preferences.export_folder or record.path.parent)
        return self._open_export(record, folder, self.window, export_session, "")

    def show_library(self, folder: Path | None = None) -> LibraryWindow:
        """Show the sessions of a folder, by default of the session folder."""
        folder = folder or Path(self.start.new.settings.sessions)
        from handcal_gui.windows.library.window import LibraryWindow

        window = LibraryWindow(folder, self.window)
        window.open_requested.connect(self.open_session)
        window.resume_requested.connect(self.resume_session)
        window.export_requested.connect(lambda paths: self.export_many(paths, window))
        window.finished.connect(self.start.look_for_sessions)
        self._open(window, window.stop)
        return window

    def export_many(self, paths: Sequence[Path], parent: QWidget) -> ExportDialog | None:
        """Open the export dialog for several sessions, each to a folder of its own."""
        try:
            first = Session.open(paths[0])
        except FileError as error:
            self.window.banner.show_message(str(error))
            return None

        def export(
            _: SessionRecord, target: Path, settings: ExportSettings, progress: Progress
        ) -> tuple[Path, ...]:
            return export_sessions(paths, target, settings, progress)

        folder = Path(self.preferences.export_folder or paths[0].parent)
        return self._open_export(
            first, folder, parent, export, tr("{} sessions").format(len(paths))
        )

    def _open_export(
        self, record: SessionRecord, folder: Path, parent: QWidget, export: Export, name: str
    ) -> ExportDialog:
        dialog = ExportDialog(record, self.preferences.export, folder, parent, export, name)
        dialog.remembered.connect(self._remember_export)
        self._open(dialog, dialog.stop)
        return dialog

    def _open(self, dialog: QDialog, stop: Callable[[], object]) -> None:
        """Show a dialog, which `stop` ends before the program does."""
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.ending.connect(stop)
        dialog.open()
        keep_on_screen(dialog)

    def inspect(self) -> None:
        """Show the alignments of the session shown in a 3D window."""
        record = self._record()
        if record is None or not record.alignments:
            self.window.banner.show_message(tr("There is no alignment to inspect yet."))
            return
        self.window.banner.show_message(tr("The 3D window opens in a few seconds."))
        self.inspection.start(record)

    def connect_headset(self) -> ConnectDialog | None:
        """Open the dialog that pairs and tries a headset; return None if it cannot be opened."""
        settings, snapshot = self.start.new.settings, self.live.snapshot
        link = self.live.link
        try:
            rig = snapshot.record.rig if snapshot else read_rig(settings.rig_path)
            server = link or HeadsetServer(self._current.pairings, (settings.host, settings.port))
        except HandcalError as error:
            self.window.banner.show_message(str(error))
            return None
        dialog = ConnectDialog(server, rig, is_calibrating=link is not None, parent=self.window)
        dialog.finished.connect(self.start.new.check)
        self._open(dialog, dialog.stop)
        return dialog

    def calibrate_rig(self) -> RigWizard | None:
        """Open the wizard of the offline calibration; return None if its folder cannot be used."""
        from handcal_gui.windows.rig.project_folder import ProjectFolder
        from handcal_gui.windows.rig.wizard import RigWizard

        try:
            folder = ProjectFolder(self._current.folder / "rig")
        except FileError as error:
            self.window.banner.show_message(str(error))
            return None
        wizard = RigWizard(folder, self.window, self.start.new.settings.realsense)
        wizard.rig_saved.connect(self._use_rig)
        self._open(wizard, wizard.accept)
        return wizard

    def evaluate(self) -> EvaluationWindow:
        """Show the evaluation window; there is at most one."""
        from handcal_gui.windows.evaluation.specs import make_specs
        from handcal_gui.windows.evaluation.window import EvaluationWindow

        opened = [one for one in self.window.findChildren(EvaluationWindow) if one.isVisible()]
        if opened:
            opened[0].raise_()
            opened[0].activateWindow()
            return opened[0]
        entries = self.preferences.evaluation
        if not entries.users.sessions:
            users = replace(entries.users, sessions=self.start.new.settings.sessions)
            entries = replace(entries, users=users)
        window = EvaluationWindow(make_specs(), entries, self.window)
        window.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        window.remembered.connect(self._remember_evaluation)
        self.ending.connect(window.stop)
        window.show()
        keep_on_screen(window)
        return window

    def close(self) -> None:
        """Save the window's layout and end all running work; safe to call twice."""
        layouts = self.window.layouts()
        self._current.change(
            geometry=self.window.saveGeometry().toBase64().toStdString(),
            live_layout=layouts.get("live", ""),
            review_layout=layouts.get("review", ""),
            fine_tune_step_m=self.window.panels.fine_tune.step_m,
        )
        self.ending.emit()
        self.inspection.close()
        self.live.stop()
        self.review.close()
        self.start.stop()

    def _connect(self, review_page: ReviewPage) -> None:
        self.start.start_requested.connect(self.start_calibration)
        self.start.cancel_requested.connect(self.live.cancel)
        self.start.resume_requested.connect(self.resume_session)
        self.start.open_requested.connect(self.open_session)
        self.start.example_requested.connect(self.open_example)
        self.start.library_requested.connect(self.show_library)
        self.start.rig_wanted.connect(self.calibrate_rig)
        self.start.connect_wanted.connect(self.connect_headset)
        self.start.evaluation_wanted.connect(self.evaluate)
        self.live.ended.connect(self._on_ended)
        self.live.opened.connect(self._current.add_session)
        self.live.export_requested.connect(lambda: self.export())
        self.live.next_wearer_requested.connect(self.show_start)
        self.review.opened.connect(self._current.add_session)
        self.review.failed.connect(self._on_ended)
        review_page.export_requested.connect(lambda: self.export())
        review_page.resume_requested.connect(self._resume_reviewed)
        review_page.again_requested.connect(self._begin_from_shown)
        self.live.slipped.connect(self._begin_from_shown)
        review_page.close_requested.connect(self.show_start)
        self.wizard_panel.plan_changed.connect(lambda plan: self._current.change(plan=plan))
        self.wizard_panel.hold_changed.connect(
            lambda is_held: self._current.change(runs_itself=not is_held)
        )
        self.window.arrangement_changed.connect(
            lambda chosen: self._current.change(arrangement=chosen)
        )
        panels = self.window.panels
        panels.session.export_requested.connect(lambda: self.export())
        panels.session.inspect_requested.connect(self.inspect)
        self.inspection.failed.connect(self.window.banner.show_message)
        panels.link.new_key_requested.connect(self._renew_key)
        panels.link.connect_requested.connect(self.connect_headset)
        self._current.not_saved.connect(self.window.banner.show_message)
        self.window.closing.connect(self.close)

    def _make_menus(self) -> None:
        add = self.window.add_action
        add("File", tr("&Next wearer"), "Ctrl+N", self.show_start)
        add("File", tr("&Open session…"), "Ctrl+O", self._browse)
        add("File", tr("&Sessions…"), "Ctrl+L", self.show_library)
        add("File", tr("&Export…"), "Ctrl+E", self.export)
        add("File", tr("&Inspect in 3D"), "", self.inspect)
        add("File", tr("Connect a &headset…"), "", self.connect_headset)
        add("File", tr("&Calibrate a rig…"), "", self.calibrate_rig)
        add("File", tr("E&valuate…"), "", self.evaluate)
        add("File", tr("&Preferences…"), "Ctrl+,", self._edit_preferences)
        add("File", tr("&Quit"), "Ctrl+Q", self.window.close)
        add("View", tr("&Reset layout"), "", self.window.reset_layout)
        add_edit_menu(self.window, self.show_library)
        add_help_menu(self.window, self.manual, self.make_support_bundle)

    def _restore(self) -> None:
        preferences = self.preferences
        self.window.panels.fine_tune.set_step_m(preferences.fine_tune_step_m)
        if preferences.geometry:
            self.window.restoreGeometry(QByteArray.fromBase64(preferences.geometry.encode()))
        else:
            screen = QGuiApplication.primaryScreen().availableSize()
            self.window.resize(screen.boundedTo(QSize(*FIRST_SIZE_PX)))
        layouts: dict[Page, str] = {
            "live": preferences.live_layout,
            "review": preferences.review_layout,
        }
        self.window.restore_layouts({page: text for page, text in layouts.items() if text})
        self.window.use_arrangement(preferences.arrangement)

    def _use_theme(self) -> None:
        use_theme(self.preferences.theme)

    def _run(self, open_station: Callable[[], Station]) -> None:
        self.review.close()
        self.window.banner.clear()
        verdict = self.preferences.station.calibration.solve.verdict
        self.wizard_panel.picture.result.set_target(verdict.target_arcmin)
        is_held = not self.preferences.runs_itself
        chosen = self.preferences
        self.live.start(open_station, chosen.plan, bridges=chosen.bridges, is_held=is_held)
        self.start.set_opening(True)
        self.window.show_page("start")

    def _browse(self) -> None:
        folder = QFileDialog.getExistingDirectory(
            self.window, tr("Open a session's folder"), self.preferences.station.sessions
        )
        if folder:
            self.open_session(Path(folder))

    def _resume_reviewed(self) -> None:
        if self.review.record is not None:
            self.resume_session(self.review.record.path)

    def _begin_from_shown(self) -> None:
        record = self._record()
        if record is not None:
            self.begin_from(record.path)

    def _record(self) -> SessionRecord | None:
        """Return the session shown, as stored on the disk."""
        if self.live.snapshot is not None:
            return self.live.snapshot.record
        return self.review.record

    def _on_ended(self, why: str) -> None:
        if why:
            self.show_start()
            self.window.banner.show_message(why)
        elif self.window.page == "start":  # cancelled
            self.start.set_opening(False)

    def _renew_key(self) -> None:
        self._current.renew_pairing_key()
        self.start.set_pairing_key(self._current.pairings.open_key())
        self.window.banner.show_message(
            tr(
                "New pairing key created. Enter it in the headset; all others are "
                "disconnected, and "
                "the key is used from the next calibration on."
            )
        )

    def make_support_bundle(self) -> SupportDialog:
        """Open the dialog that writes a file to send with a bug report."""
        sessions = Path(self.start.new.settings.sessions)
        folder = self._current.folder
        settings = SupportSettings(folder, (sessions,))
        dialog = SupportDialog(settings, Path.home(), self.window)
        self._open(dialog, dialog.stop)
        return dialog

    def _edit_preferences(self) -> None:
        dialog = PreferencesDialog(self.preferences, self.window)
        keep_on_screen(dialog)
        if dialog.exec():
            self._current.use(dialog.preferences())
            self._use_theme()
            self.start.show_preferences(self.preferences)

    def _use_rig(self, path: Path) -> None:
        station = replace(self.preferences.station, rig=str(path))
        self._current.change(station=station)
        self.start.set_rig(path)

    def _remember_export(self, settings: ExportSettings, folder: Path) -> None:
        self._current.change(export=settings, export_folder=str(folder))

    def _remember_evaluation(self, entries: EvaluationEntries) -> None:
        self._current.change(evaluation=entries)

"""The windows and dialogs beside the main window: opened for its menus, ended with the program."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtWidgets import QApplication, QDialog, QFileDialog, QWidget

from handcal.core.errors import FileError, HandcalError
from handcal.core.progress import Progress
from handcal.export.export import (
    Exported,
    ExportSettings,
    export_name,
    export_session,
    export_sessions,
)
from handcal.export.outcome import load_outcome
from handcal.export.window_3d import inspect_session
from handcal.link.server import HeadsetServer
from handcal.rig.rig_file import read_rig
from handcal.session.session import SessionRecord
from handcal.station.checks.support import SupportSettings
from handcal_gui.app.menus import read_manual
from handcal_gui.app.preferences import CurrentPreferences
from handcal_gui.app.preferences_dialog import PreferencesDialog
from handcal_gui.app.support_dialog import SupportDialog
from handcal_gui.app.theme import use_theme
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.control.live import CalibrationController
from handcal_gui.calibrate.control.review import ReviewController
from handcal_gui.calibrate.start.start_page import StartPage
from handcal_gui.calibrate.window import MainWindow
from handcal_gui.connect.connect_dialog import ConnectDialog
from handcal_gui.connect.openxr_dialog import OpenxrDialog
from handcal_gui.engine.jobs import Job
from handcal_gui.evaluate.entries import EvaluationEntries, make_specs
from handcal_gui.library.export_dialog import Export, ExportDialog
from handcal_gui.widgets.numbers import pluralize

if TYPE_CHECKING:  # imported when they open: they take longer than all the rest
    from handcal_gui.evaluate.window import EvaluationWindow
    from handcal_gui.library.window import LibraryWindow
    from handcal_gui.rig.wizard import RigWizard


class SeparateWindows(QObject):
    """Opens windows and dialogs, and ends them with the program.

    Parameters
    ----------
    window : MainWindow
    start : StartPage
    live : CalibrationController
    review : ReviewController
    current : CurrentPreferences
    open_session, resume_session : callable
        Open a stored session, or resume it, by its folder.
    """

    _ending = Signal()

    def __init__(
        self,
        window: MainWindow,
        start: StartPage,
        live: CalibrationController,
        review: ReviewController,
        current: CurrentPreferences,
        open_session: Callable[[Path], object],
        resume_session: Callable[[Path], object],
    ) -> None:
        super().__init__()
        self._open_session, self._resume_session = open_session, resume_session
        self._window, self._start = window, start
        self._live, self._review = live, review
        self._current = current
        self._inspection: Job | None = None

    @property
    def record(self) -> SessionRecord | None:
        """The session shown, as stored on the disk."""
        if self._live.snapshot is not None:
            return self._live.snapshot.record
        return self._review.record

    def close(self) -> None:
        """End everything that was opened; safe to call twice."""
        self._ending.emit()
        self._end_inspection()

    def browse(self) -> None:
        """Let the user choose a session's folder, and open it."""
        folder = QFileDialog.getExistingDirectory(
            self._window, tr("Open a session's folder"), self._current.now.station.sessions
        )
        if folder:
            self._open_session(Path(folder))

    def export(self, folder: Path | None = None) -> ExportDialog | None:
        """Open the export dialog for the session shown, or the library to choose one.

        Returns None without a result to export.

        Parameters
        ----------
        folder : Path, optional
            Proposed folder; by default that of the last export, or one beside the session folder.
        """
        record = self.record
        if record is None:
            self.show_library()
            return None
        if not record.is_solvable:
            self._window.banner.show_message(tr("Nothing was exported: there is no result yet."))
            return None

        def export(target: Path, settings: ExportSettings, progress: Progress) -> Exported:
            return Exported(export_session(record, target, settings, progress))

        name, wearer = export_name(record), record.wearer
        folder = folder or self._export_folder(record.path.parent)
        return self._open_export(name, folder, export, wearer, self._window)

    def use_in_openxr(self) -> OpenxrDialog | None:
        """Open the dialog that gives the session's calibration to OpenXR programs, as `export`."""
        record = self.record
        if record is None:
            self.show_library()
            return None
        if not record.is_solvable:
            self._window.banner.show_message(tr("Nothing can be used: there is no result yet."))
            return None
        dialog = OpenxrDialog(record, self._window)
        self._open(dialog, dialog.stop)
        return dialog

    def show_library(self, folder: Path | None = None) -> LibraryWindow:
        """Show the sessions of a folder, by default of the session folder."""
        folder = folder or self._start.new.settings.sessions_path
        with _wait_cursor():
            from handcal_gui.library.window import LibraryWindow

        window = LibraryWindow(folder, self._window)
        window.open_requested.connect(self._open_session)
        window.resume_requested.connect(self._resume_session)
        window.export_requested.connect(lambda paths: self.export_many(paths, window))
        for changed in (window.changed, window.finished):  # closing cancels what runs
            changed.connect(self._review.read_wearer)
        window.finished.connect(self._start.look_for_sessions)
        self._open(window, window.stop)
        return window

    def export_many(self, paths: Sequence[Path], parent: QWidget) -> ExportDialog:
        """Open the export dialog for several sessions: each alone, and all together."""

        def export(target: Path, settings: ExportSettings, progress: Progress) -> Exported:
            return export_sessions(paths, target, settings, progress)

        title = pluralize(len(paths), tr("session"), tr("sessions"))
        name = f"{datetime.now():%Y-%m-%d}-{len(paths)}-sessions"
        folder = self._export_folder(paths[0].parent)
        return self._open_export(name, folder, export, title, parent)

    def inspect(self) -> None:
        """Show the alignments of the session shown in a 3D window, in place of one that is open."""
        record = self.record
        if record is None or not record.alignments:
            why = tr("there is no alignment yet") if record else tr("open a session first")
            self._window.banner.show_message(tr("There is nothing to inspect: {}.").format(why))
            return
        self._window.banner.show_notice(tr("The 3D window opens in a few seconds."))

        def work(progress: Progress) -> None:
            inspect_session(load_outcome(record, progress), progress=progress)

        self._end_inspection()
        self._inspection = Job(work)
        self._inspection.failed.connect(self._window.banner.show_message)
        self._inspection.start()

    def _end_inspection(self) -> None:
        if self._inspection is not None:
            self._inspection.abandon()
            self._inspection = None

    def connect_headset(self) -> ConnectDialog | None:
        """Open the dialog that pairs and tries a headset; return None if it cannot be opened."""
        settings, snapshot = self._start.new.settings, self._live.snapshot
        link = self._live.link
        try:
            rig = snapshot.record.rig if snapshot else read_rig(settings.rig_path)
            server = link or HeadsetServer(self._current.pairings, (settings.host, settings.port))
        except HandcalError as error:
            self._window.banner.show_message(str(error))
            return None
        dialog = ConnectDialog(server, rig, is_calibrating=link is not None, parent=self._window)
        dialog.finished.connect(self._start.new.check)
        self._open(dialog, dialog.stop)
        return dialog

    def calibrate_rig(self) -> RigWizard | None:
        """Open the wizard of the offline calibration; return None if its folder cannot be used."""
        with _wait_cursor():
            from handcal_gui.rig.project_folder import ProjectFolder
            from handcal_gui.rig.wizard import RigWizard

        try:
            folder = ProjectFolder(self._current.folder / "rig")
        except FileError as error:
            self._window.banner.show_message(str(error))
            return None
        read = partial(read_manual, self._window)
        realsense = self._start.new.settings.realsense
        wizard = RigWizard(folder, self._window, realsense, read, self._use_rig)
        wizard.finished.connect(self._start.new.check)
        self._open(wizard, wizard.accept)
        return wizard

    def evaluate(self) -> EvaluationWindow:
        """Show the evaluation window; there is at most one."""
        with _wait_cursor():
            from handcal_gui.evaluate.window import EvaluationWindow

        opened = [one for one in self._window.findChildren(EvaluationWindow) if one.isVisible()]
        if opened:
            opened[0].raise_()
            opened[0].activateWindow()
            return opened[0]
        self._start.keep_entries(self._current)
        entries, proposed = self._current.now.evaluation, self._current.now.station.sessions
        if not entries.users.sessions:
            entries = replace(entries, users=replace(entries.users, sessions=proposed))
        read = partial(read_manual, self._window)
        window = EvaluationWindow(make_specs(), entries, self._window, read)
        window.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        window.remembered.connect(partial(self._remember_evaluation, proposed))
        self._ending.connect(window.stop)
        window.show()
        return window

    def make_support_bundle(self) -> SupportDialog:
        """Open the dialog that writes a file to send with a bug report."""
        sessions = self._start.new.settings.sessions_path
        folder = self._current.folder
        settings = SupportSettings(folder, sessions)
        dialog = SupportDialog(settings, Path.home(), self._window)
        self._open(dialog, dialog.stop)
        return dialog

    def edit_preferences(self) -> None:
        """Let the user change the preferences."""
        self._start.keep_entries(self._current)
        dialog = PreferencesDialog(self._current.now, self._window)
        if dialog.exec():
            self._current.use(dialog.preferences())
            use_theme(self._current.now.theme)
            self._start.new.show_settings(self._current.now.station)

    def _export_folder(self, sessions: Path) -> Path:
        """Return the folder of the last export, or one beside a folder of sessions."""
        beside = sessions.absolute().parent / "handcal exports"
        return Path(self._current.now.export_folder or beside)

    def _open_export(
        self, name: str, folder: Path, export: Export, title: str, parent: QWidget
    ) -> ExportDialog:
        dialog = ExportDialog(name, self._current.now.export, folder, export, title, parent)
        dialog.remembered.connect(self._remember_export)
        self._open(dialog, dialog.stop)
        return dialog

    def _open(self, dialog: QDialog, stop: Callable[[], object]) -> None:
        """Show a dialog, which `stop` ends before the program does."""
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self._ending.connect(stop)
        dialog.open()

    def _use_rig(self, path: Path) -> None:
        station = replace(self._current.now.station, rig=str(path))
        self._current.change(station=station)
        self._start.new.form.set_rig(str(path))

    def _remember_export(self, settings: ExportSettings, folder: Path) -> None:
        self._current.change(export=settings, export_folder=str(folder))

    def _remember_evaluation(self, proposed: str, entries: EvaluationEntries) -> None:
        """Remember entries, except the folder of sessions that was only proposed."""
        if entries.users.sessions == proposed:
            entries = replace(entries, users=replace(entries.users, sessions=""))
        self._current.change(evaluation=entries)


@contextmanager
def _wait_cursor() -> Iterator[None]:
    """Show the wait cursor meanwhile: what a window needs takes up to some seconds to import."""
    QApplication.setOverrideCursor(Qt.CursorShape.WaitCursor)
    try:
        yield
    finally:
        QApplication.restoreOverrideCursor()

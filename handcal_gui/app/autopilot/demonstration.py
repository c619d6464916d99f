"""An automatic calibration of a simulated wearer, from the start page to the export."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from PySide6.QtCore import QObject
from PySide6.QtWidgets import QApplication

from handcal.core.errors import FileError
from handcal.station.settings import StationSettings
from handcal_gui.app.autopilot.autopilot import Autopilot
from handcal_gui.app.autopilot.screenshots import Screenshots
from handcal_gui.app.autopilot.tour import Tour
from handcal_gui.app.program import Program
from handcal_gui.calibrate.guide.view import Step, WizardView
from handcal_gui.library.export_dialog import ExportDialog


class Demonstration(QObject):
    """Calibrates, exports, and ends the program.

    Parameters
    ----------
    program : Program
    output : Path
        Folder for the session and, beside it, the export.
    screenshots : Path or None
        Folder for screenshots of every step, panel and dialog; None to save none.

    Attributes
    ----------
    complaint : str or None
        The reason for a failure; None after success.
    """

    def __init__(self, program: Program, output: Path, screenshots: Path | None) -> None:
        super().__init__(program)
        self.complaint: str | None = "ended before the calibration was complete"
        self._program = program
        self._output = output.absolute()
        self._screenshots = Screenshots(program.window, screenshots) if screenshots else None
        self._tour = Tour(program, self._screenshots) if self._screenshots else None
        self._has_toured = False
        if self._tour:
            self._tour.failed.connect(self._fail)
        self._autopilot = Autopilot(program.live, program.wizard_panel, self._look)
        self._autopilot.finished.connect(self._export)
        self._autopilot.stuck.connect(self._fail)
        program.live.ended.connect(self._fail)

    def start(self, settings: StationSettings) -> None:
        """Start the demonstration."""
        station = replace(settings, sessions=str(self._output))

        def calibrate() -> None:
            self._program.start_calibration(station, "Demonstration")
            self._program.wizard_panel.hold(True)  # for pictures of every step

        if self._tour:
            self._tour.begin(self._tour.start_page(), calibrate)
        else:
            calibrate()

    def _look(self, view: WizardView) -> None:
        if self._screenshots is None or self._tour is None:
            return
        try:
            self._screenshots.save_step(view)
        except FileError as error:
            self._fail(str(error))
        if view.step is Step.SAVE and not self._has_toured:
            self._has_toured = True
            self._autopilot.pause()
            self._tour.begin(self._tour.panels(), self._autopilot.resume)

    def _export(self) -> None:
        self._program.live.ended.disconnect(self._fail)  # from now on the engine may end
        dialog = self._program.windows.export(self._output)
        if dialog is None:
            self._fail("there was nothing to export")
            return
        dialog.succeeded.connect(lambda _files: self._after_export(dialog))
        dialog.failed.connect(self._fail)
        if self._tour:
            self._tour.begin(self._tour.export(dialog), lambda: None)
        else:
            dialog.start()

    def _after_export(self, dialog: ExportDialog) -> None:
        if self._tour:
            self._tour.begin(self._tour.after_export(dialog), self._finish)
        else:
            self._finish()

    def _finish(self) -> None:
        self.complaint = None
        QApplication.quit()

    def _fail(self, why: str) -> None:
        self.complaint = why or self.complaint
        QApplication.exit(1)

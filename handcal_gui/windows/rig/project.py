"""The rig that the wizard's pages work on, kept in the work folder as it changes."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from PySide6.QtCore import QObject, QTimer, Signal

from handcal.camera.settings import RealSenseSettings
from handcal.errors import FileError, HandcalError
from handcal.io.files import read_json
from handcal.rig.rig_file import read_rig
from handcal.types import Rig
from handcal_gui.windows.rig.project_folder import ProjectFolder
from handcal_gui.windows.rig.solve import Solved

_SETTLE_MS = 500


class RigProject(QObject):
    """Entries and rig, which the pages change.

    Parameters
    ----------
    folder : ProjectFolder
    realsense : RealSenseSettings

    Attributes
    ----------
    folder : ProjectFolder
    realsense : RealSenseSettings
        How one is run that images are taken with.
    inputs : RigInputs
    rig : Rig
        As far as it is calibrated.
    complaint : str
        What could not be read; empty if nothing.
    rig_changed : Signal()
        Another rig, or other intrinsics of the viewpoint camera.
    failed : Signal(str)
        It could not be kept.
    """

    rig_changed = Signal()
    failed = Signal(str)

    def __init__(
        self, folder: ProjectFolder, realsense: RealSenseSettings, parent: QObject | None = None
    ) -> None:
        super().__init__(parent)
        self.folder = folder
        self.realsense = realsense
        self.inputs, of_entries = folder.load()
        self.rig, of_rig = folder.load_rig()
        self.complaint = " ".join(filter(None, (of_entries, of_rig)))
        self._settle = QTimer(self, interval=_SETTLE_MS, singleShot=True)
        self._settle.timeout.connect(self.save)

    @property
    def camera_file(self) -> Path:
        """Where the viewpoint camera's intrinsics are, once they are known."""
        given = self.inputs.viewpoint.intrinsics
        return Path(given).expanduser() if given else self.folder.viewpoint

    @property
    def camera_verdict(self) -> str:
        """How the viewpoint camera's calibration ended; empty if there is none.

        A file that tells no verdict is taken to be good.
        """
        file = self.camera_file
        if not file.exists():
            return ""
        with suppress(FileError):
            verdict = read_json(file).get("verdict")
            return str(verdict.get("name")) if isinstance(verdict, dict) else "good"
        return "good"  # OpenCV's or ROS's

    def enter(self, **changes: Any) -> None:
        """Take fields of `RigInputs`."""
        inputs = replace(self.inputs, **changes)
        if inputs != self.inputs:
            self.inputs = inputs
            self._settle.start()

    def begin_from(self, path: Path) -> None:
        """Begin from a rig file, or raise HandcalError; what was calibrated before is given up."""
        self.take_rig(read_rig(path))

    def take_part(self, solved: Solved) -> str:
        """Put a calibrated part into the rig; return what became of it, for a person to read."""
        if solved.put is None:
            return "it was not put into the rig"
        try:
            self.take_rig(solved.put(self.rig))
        except HandcalError as error:
            return f"it was not put into the rig: {error}"
        return "it is in the rig now"

    def camera_solved(self) -> None:
        """Say that the viewpoint camera's intrinsics may be others now."""
        self.rig_changed.emit()

    def take_rig(self, rig: Rig) -> None:
        """Take another rig, or raise HandcalError if it is implausible or cannot be kept."""
        try:
            self.folder.save_rig(rig)
        except ValueError as error:
            raise HandcalError(f"this is no plausible rig: {error}") from error
        self.rig = rig
        self.rig_changed.emit()

    def save(self) -> None:
        """Keep the entries."""
        self._settle.stop()
        try:
            self.folder.save(self.inputs)
        except FileError as error:
            self.failed.emit(f"What was entered cannot be kept: {error}")

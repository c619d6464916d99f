"""The rig being calibrated, stored in the project folder after each change."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from PySide6.QtCore import QObject, QTimer, Signal

from handcal.camera.settings import RealSenseSettings
from handcal.errors import FileError, HandcalError
from handcal.io.files import read_json, user_path
from handcal.rig.rig_file import read_rig
from handcal.rig_types import Rig
from handcal_gui.translation import tr
from handcal_gui.windows.rig.project_folder import ProjectFolder
from handcal_gui.windows.rig.solve import SolvedPart

_SETTLE_MS = 500


class RigProject(QObject):
    """The entries and the rig that the wizard's pages edit.

    Parameters
    ----------
    folder : ProjectFolder
    realsense : RealSenseSettings

    Attributes
    ----------
    folder : ProjectFolder
    realsense : RealSenseSettings
        Settings of a RealSense that takes images.
    inputs : RigInputs
    rig : Rig
        The rig with all parts calibrated so far.
    complaint : str
        Message about files that could not be read; empty if there is none.
    rig_changed : Signal()
        The rig or the viewpoint camera's intrinsics have changed.
    failed : Signal(str)
        The entries could not be saved.
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
        """File of the viewpoint camera's intrinsics, once they are known."""
        given = self.inputs.viewpoint.intrinsics
        return user_path(given) if given else self.folder.viewpoint

    @property
    def camera_verdict(self) -> str:
        """Verdict on the viewpoint camera's calibration; empty if there is none.

        A file without a verdict counts as good.
        """
        file = self.camera_file
        if not file.exists():
            return ""
        with suppress(FileError):
            verdict = read_json(file).get("verdict")
            return str(verdict.get("name")) if isinstance(verdict, dict) else "good"
        return "good"  # a file by OpenCV or ROS

    def enter(self, **changes: Any) -> None:
        """Replace fields of `RigInputs`."""
        inputs = replace(self.inputs, **changes)
        if inputs != self.inputs:
            self.inputs = inputs
            self._settle.start()

    def start_from(self, path: Path) -> None:
        """Start from a rig file, or raise HandcalError; earlier calibrations are discarded."""
        self.use_rig(read_rig(path))

    def add_part(self, solved: SolvedPart) -> str:
        """Add a calibrated part to the rig; return the outcome as a message."""
        if solved.add_to is None:
            return tr("it was not added to the rig")
        try:
            self.use_rig(solved.add_to(self.rig))
        except HandcalError as error:
            return tr("it was not added to the rig: {}").format(error)
        return tr("it was added to the rig")

    def camera_solved(self) -> None:
        """Announce that the viewpoint camera's intrinsics may have changed."""
        self.rig_changed.emit()

    def use_rig(self, rig: Rig) -> None:
        """Replace the rig, or raise HandcalError if it is implausible or cannot be stored."""
        try:
            self.folder.save_rig(rig)
        except ValueError as error:
            raise HandcalError(tr("this rig is not plausible: {}").format(error)) from error
        self.rig = rig
        self.rig_changed.emit()

    def save(self) -> None:
        """Save the entries."""
        self._settle.stop()
        try:
            self.folder.save(self.inputs)
        except FileError as error:
            self.failed.emit(tr("The entries could not be saved: {}").format(error))

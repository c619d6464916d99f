"""The rig being calibrated, stored in the project folder after each change."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from PySide6.QtCore import QObject, QTimer, Signal

from handcal.camera.settings import RealSenseSettings
from handcal.core.errors import FileError, HandcalError
from handcal.core.types import Rig
from handcal.io.files import read_json, user_path
from handcal.rig.boards.board import Board
from handcal.rig.formats import read_intrinsics
from handcal.rig.rig_file import read_rig, write_rig
from handcal_gui.app.translation import tr
from handcal_gui.rig.project_folder import LastAcceptance, ProjectFolder
from handcal_gui.rig.solve import SolvedPart
from handcal_gui.rig.step_inputs import Step, changed_inputs, step_inputs

NOT_JUDGED, UNREADABLE = tr("not judged: the file has no verdict"), tr("the file cannot be read")
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
        The rig or the viewpoint camera's intrinsics have changed, or the board was found.
    inputs_changed : Signal()
        Other inputs were entered.
    failed : Signal(str)
        The entries could not be saved.
    """

    rig_changed = Signal()
    inputs_changed = Signal()
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

        Without one in the file, as in those by OpenCV or ROS, nobody has judged it.
        """
        file = self.camera_file
        if not file.exists():
            return ""
        try:
            read_intrinsics(file)
        except HandcalError:
            return UNREADABLE
        with suppress(FileError):
            verdict = read_json(file).get("verdict")
            if isinstance(verdict, dict):
                return str(verdict.get("name"))
        return NOT_JUDGED

    def enter(self, **changes: Any) -> None:
        """Replace fields of `RigInputs`; another board is one that has not been found."""
        inputs = replace(self.inputs, **changes)
        if inputs.board != self.inputs.board:
            inputs = replace(inputs, board_found=False)
        if inputs != self.inputs:
            self.inputs = inputs
            self._settle.start()
            self.inputs_changed.emit()

    def inputs_of(self, step: Step) -> dict[str, str]:
        """Return the present inputs of a step."""
        return step_inputs(self.inputs, step, self.camera_file)

    def outdated(self, step: Step) -> str:
        """Return in words which inputs of a solved step are no longer those it was solved with."""
        if step == "viewpoint":
            is_solved = self.camera_file == self.folder.viewpoint and self.camera_file.exists()
        else:
            is_solved = step in self.rig.origins
        then = self.inputs.solved.get(step, {})
        if not is_solved or not (changed := changed_inputs(then, self.inputs_of(step))):
            return ""
        return tr("solved with other inputs ({}): solve it again").format(changed)

    def note_solved(self, step: Step, inputs: Mapping[str, str]) -> None:
        """Remember the inputs with which a step was solved."""
        self.enter(solved={**self.inputs.solved, step: inputs})
        self.save()

    @property
    def saved_file(self) -> Path | None:
        """The file to which the present rig was saved; None if there is none, or it differs."""
        path = Path(self.inputs.saved)
        return path if self.inputs.saved and self.folder.is_rig(path) else None

    def save_rig_as(self, path: Path) -> None:
        """Save the rig file, or raise FileError."""
        write_rig(path, self.rig)
        self.folder.save_rig(self.rig)
        self.enter(saved=str(path.absolute()))
        self.rig_changed.emit()

    def note_found(self, board: Board) -> None:
        """Remember that a board was found in an image, if it is the one entered."""
        if board == self.inputs.board and not self.inputs.board_found:
            self.enter(board_found=True)
            self.rig_changed.emit()

    @property
    def acceptance(self) -> LastAcceptance | None:
        """The last acceptance of the present rig, whatever its name."""
        last = self.inputs.acceptance
        return last if last.made and last.rig == self.folder.rig_mark else None

    def note_accepted(self, words: str, *, is_passed: bool) -> None:
        """Remember an acceptance of the present rig."""
        made = datetime.now(UTC).isoformat(timespec="seconds")
        self.enter(acceptance=LastAcceptance(made, is_passed, words, self.folder.rig_mark))

    def start_from(self, path: Path) -> None:
        """Start from a rig file, or raise HandcalError; earlier calibrations are discarded."""
        self.use_rig(read_rig(path))
        solved = self.inputs.solved
        self.enter(solved={step: solved[step] for step in solved if step == "viewpoint"})

    def add_part(self, step: Step, solved: SolvedPart, inputs: Mapping[str, str]) -> str:
        """Add a part calibrated from inputs to the rig; return the outcome as a message."""
        if solved.add_to is None:
            return tr("it was not added to the rig")
        try:
            self.use_rig(solved.add_to(self.rig))
        except HandcalError as error:
            return tr("it was not added to the rig: {}").format(error)
        self.note_solved(step, inputs)
        return tr("it was added to the rig")

    def remember_sources(self, sources: Mapping[str, str]) -> None:
        """Remember the sources of images chosen for some cameras."""
        self.enter(sources={**self.inputs.sources, **sources})

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

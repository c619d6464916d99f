"""The entries of the rig wizard, and the folder that stores them."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, TypeAlias

from handcal.errors import FileError
from handcal.io.files import make_folder, read_json, write_json
from handcal.io.resources import resource_path
from handcal.io.settings import read_settings, settings_json
from handcal.rig.board import Board
from handcal.rig.camera import LensModel
from handcal.rig.print_page import Paper
from handcal.rig.rig_file import read_rig, write_rig
from handcal.rig.steps import DisplayInputs
from handcal.types import Rig

Distance: TypeAlias = Literal["measured", "solved"]


@dataclass(frozen=True, slots=True)
class StereoEntries:
    """Inputs of the depth camera's pose; paths are empty where there is none."""

    depth_images: str = ""
    headset_images: str = ""
    """Folders of the two cameras' images."""
    depth_intrinsics: str = ""
    headset_intrinsics: str = ""
    """Files; solved from the images if empty."""
    imager_intrinsics: str = ""
    depth_to_color: str = ""
    """Files: the depth imager's own, and its pose in the colour imager, if the images are the
    colour imager's."""
    lens: LensModel = "full"
    """Of intrinsics that are solved."""
    dropped: tuple[str, ...] = ()
    """Images left out, by the depth camera's name."""


@dataclass(frozen=True, slots=True)
class ViewpointEntries:
    """Inputs of the viewpoint camera's intrinsics, or the file that has them."""

    images: str = ""
    intrinsics: str = ""
    lens: LensModel = "full"
    dropped: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class DisplayEntries:
    """Inputs of one eye's display calibration."""

    grid_images: str = ""
    """Folder of images of the grid on the display."""
    square_px: int = 80
    """Side of the grid's squares."""
    board_images: str = ""
    tracked: str = ""
    """Folder of images of the tracked board, and the file of its poses."""
    stereo: str = ""
    """Instead of both, the JSON of a stereo calibration with the viewpoint camera as its depth
    camera."""
    view: str = ""
    """File of T_V_H, as the headset reports it; that of the rig if empty."""
    distance: Distance = "measured"
    """Source of z(C0→S): `distance_m`, or the angle that a square subtends."""
    distance_m: float = 2.0
    square_arcmin: float = 112.0
    nominal_m: float = 2.0
    """As measured; what a square subtends from the nominal distance."""
    dropped_grid: tuple[str, ...] = ()
    dropped_board: tuple[str, ...] = ()

    @property
    def inputs(self) -> DisplayInputs:
        """The same as the calibration takes it."""
        return DisplayInputs(
            square_px=self.square_px,
            distance_m=self.distance_m if self.distance == "measured" else None,
            square_arcmin=self.square_arcmin,
            nominal_m=self.nominal_m,
            pose_V_H=entered_path(self.view),
        )


@dataclass(frozen=True, slots=True)
class RigInputs:
    """Everything entered in the rig wizard."""

    board: Board = field(default_factory=Board)
    paper: Paper = "a4"
    stereo: StereoEntries = field(default_factory=StereoEntries)
    viewpoint: ViewpointEntries = field(default_factory=ViewpointEntries)
    left: DisplayEntries = field(default_factory=DisplayEntries)
    right: DisplayEntries = field(default_factory=DisplayEntries)


class ProjectFolder:
    """A folder that stores the entries, the images and the rig as far as it is calibrated.

    Parameters
    ----------
    path : Path
        Created if needed.

    Attributes
    ----------
    path : Path
    viewpoint : Path
        The viewpoint camera's intrinsics, once solved.

    Raises
    ------
    FileError
        If the folder cannot be created.
    """

    def __init__(self, path: Path) -> None:
        self.path = make_folder(path)
        self.viewpoint = path / "viewpoint.json"
        self._entries = path / "work.json"
        self._rig = path / "rig.yaml"

    def load(self) -> tuple[RigInputs, str]:
        """Return the entries, and a message about what went wrong; empty if nothing did.

        A file that cannot be used is kept beside, ending in ``.bad``.
        """
        if not self._entries.exists():
            return RigInputs(), ""
        try:
            return read_settings(RigInputs, read_json(self._entries), "work"), ""
        except FileError as error:
            return RigInputs(), f"The entries were reset: {error}; {_set_aside(self._entries)}"

    def save(self, inputs: RigInputs) -> None:
        """Write the entries, or raise FileError."""
        write_json(self._entries, settings_json(inputs))

    def load_rig(self) -> tuple[Rig, str]:
        """Return the rig as far as it is calibrated, the example at first, and what went wrong."""
        example = resource_path("example_rig.yaml")
        if not self._rig.exists():
            return read_rig(example), ""
        try:
            return read_rig(self._rig), ""
        except FileError as error:
            return read_rig(example), f"The rig was reset: {error}; {_set_aside(self._rig)}"

    def save_rig(self, rig: Rig) -> None:
        """Write the rig as far as it is calibrated.

        Raises
        ------
        ValueError
            If it is implausible.
        FileError
            If it cannot be written.
        """
        write_rig(self._rig, rig)


def entered_path(text: str) -> Path | None:
    """Return the path that was entered; None if the field is empty."""
    return Path(text).expanduser() if text else None


def _set_aside(path: Path) -> str:
    bad = path.with_name(f"{path.name}.bad")
    with suppress(OSError):
        path.replace(bad)
        return f"the old file was kept as {bad}"
    return "the old file cannot be renamed"

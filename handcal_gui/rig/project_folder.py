"""The entries of the rig wizard, and the folder that stores them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import Literal, TypeAlias

from handcal.core.entry import INTRINSICS_FILES, entry
from handcal.core.errors import FileError
from handcal.core.types import Rig
from handcal.io.files import make_folder, read_json, user_path, write_json
from handcal.io.resources import resource_path
from handcal.io.settings import read_settings, settings_json
from handcal.rig.boards.board import Board
from handcal.rig.boards.printing import Paper
from handcal.rig.formats import read_camera, read_intrinsics, read_pose
from handcal.rig.lens.camera import LensChoice
from handcal.rig.rig_file import read_rig, write_rig
from handcal.rig.steps import DisplayInputs, view_in
from handcal_gui.app.translation import tr

Distance: TypeAlias = Literal["measured", "solved"]
LENSES: dict[LensChoice, str] = {
    "auto": tr("The one that fits best"),
    "none": tr("No distortion"),
    "radial": "k1, k2",
    "full": "k1, k2, p1, p2, k3",
    "rational": tr("k1 to k6, p1, p2"),
    "fisheye": tr("Fisheye"),
}
_SOLVED = tr("Solved from the images")
_FORMATS = tr("As OpenCV, ROS, Kalibr, RealSense, Open3D, Azure Kinect or handcal write them.")
_IMAGER_HELP = tr(
    "Needed only if the images come from a colour imager beside the depth imager and the depth is "
    "not aligned to it. Take images… reads them from a RealSense."
)


def _images(label: str) -> str:
    return entry("", label, path="folder")


def _intrinsics(
    label: str, read: Callable[[Path], object], help_text: str = _FORMATS, hint: str = _SOLVED
) -> str:
    return entry("", label, help_text, hint=hint, path="file", files=INTRINSICS_FILES, read=read)


def _lens() -> LensChoice:
    told = tr("Distortion coefficients to solve for.")
    lens: LensChoice = entry("auto", tr("L&ens"), told, options=LENSES)
    return lens


@dataclass(frozen=True, slots=True)
class StereoEntries:
    """Inputs for the depth camera's pose; missing paths are empty."""

    depth_images: str = _images(tr("&Depth camera's images"))
    headset_images: str = _images(tr("&Headset camera's images"))
    """Folders of the two cameras' images."""
    depth_intrinsics: str = _intrinsics(tr("Depth camera's in&trinsics"), read_camera)
    headset_intrinsics: str = _intrinsics(tr("Headset camera's intrinsi&cs"), read_camera)
    """Files of intrinsics; solved from the images if empty."""
    imager_intrinsics: str = _intrinsics(
        tr("Depth ima&ger's intrinsics"), read_intrinsics, _IMAGER_HELP, tr("Not needed")
    )
    depth_to_color: str = entry(
        "",
        tr("Pose &from depth to colour"),
        _IMAGER_HELP,
        hint=tr("Not needed"),
        path="file",
        files=tr("Poses (*.yaml *.yml *.json)"),
        read=read_pose,
    )
    """Files with the depth imager's intrinsics and its pose in the colour imager, if the images
    come from the colour imager."""
    lens: LensChoice = _lens()
    """Lens model for solved intrinsics."""
    dropped: tuple[str, ...] = ()
    """Excluded images, by the depth camera's file name."""


@dataclass(frozen=True, slots=True)
class ViewpointEntries:
    """Inputs for the viewpoint camera's intrinsics, or a file that contains them."""

    images: str = _images(tr("&Viewpoint camera's images"))
    intrinsics: str = _intrinsics(tr("Viewpoint camera's in&trinsics"), read_intrinsics)
    lens: LensChoice = _lens()
    dropped: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class DisplayEntries:
    """Inputs for one eye's display calibration."""

    grid_images: str = _images(tr("Images of t&he grid"))
    """Folder of images of the grid on the display."""
    square_px: int = entry(
        80,
        tr("Grid s&quares"),
        tr("Side length of the grid's squares, in pixels."),
        limits=(20, 2000),
    )
    """Side length of the grid's squares."""
    board_images: str = _images(tr("Images o&f the board"))
    tracked: str = entry(
        "",
        tr("&Poses of the board"),
        tr("Poses of the board as tracked by the headset, for each image: {}, in metres.").format(
            '{"handcal_tracked": 1, "T_H_B": {"image.png": [4 rows of 4]}}'
        ),
        path="file",
        files=tr("Tracked poses (*.json)"),
    )
    """Folder of images of the tracked board, and file of its poses."""
    stereo: str = entry(
        "",
        tr("S&tereo calibration"),
        tr(
            "Instead of images and poses of the board: the result of 'handcal rig stereo' with the "
            "viewpoint camera as depth camera."
        ),
        hint=tr("Instead of the images of the board"),
        path="file",
        files=tr("Stereo calibrations (*.json)"),
    )
    """Alternative to both: the JSON file of a stereo calibration with the viewpoint camera as
    depth camera."""
    view: str = entry(
        "",
        tr("R&endering camera's pose"),
        tr(
            "Transform from the headset rig to this eye's rendering camera, T_V_H, as the headset "
            "reports it: 4 rows of 4 numbers, in metres; x right, y down, z forward. If empty, "
            "that of the initial rig is used."
        ),
        hint=tr("As in the rig"),
        path="file",
        files=tr("Matrices (*.txt *.json *.yaml *.yml)"),
        read=view_in,
    )
    """File of T_V_H as reported by the headset; that of the rig if empty."""
    distance: Distance = entry(
        "measured",
        tr("S&creen's distance"),
        tr(
            "Distance of the virtual screen from the viewpoint camera, z(C0→S): measured, for "
            "example by the camera's focus, or solved from the angle that a square subtends at the "
            "nominal distance."
        ),
        options={"measured": tr("measured"), "solved": tr("from the squares' angle")},
    )
    """Source of z(C0→S): `distance_m`, or the angle that a square subtends."""
    distance_m: float = entry(
        2.0,
        tr("Me&asured distance"),
        tr("Measured distance of the virtual screen, in metres."),
        limits=(0.1, 100.0),
    )
    square_arcmin: float = entry(
        112.0,
        tr("An&gle of a square"),
        tr("Angle that a square of the grid subtends, in arcminutes."),
        limits=(1.0, 1e4),
    )
    nominal_m: float = entry(
        2.0,
        tr("Nominal &distance"),
        tr("Nominal distance for this angle, from the manufacturer, in metres."),
        limits=(0.1, 100.0),
    )
    """The measured distance; the angle that a square subtends at the nominal distance."""
    dropped_grid: tuple[str, ...] = ()
    dropped_board: tuple[str, ...] = ()

    @property
    def inputs(self) -> DisplayInputs:
        """The same as inputs of the calibration."""
        return DisplayInputs(
            square_px=self.square_px,
            distance_m=self.distance_m if self.distance == "measured" else None,
            square_arcmin=self.square_arcmin,
            nominal_m=self.nominal_m,
            pose_V_H=entered_path(self.view),
        )


@dataclass(frozen=True, slots=True)
class LastAcceptance:
    """The result of an acceptance."""

    made: str = ""
    """Date and time, ISO 8601; empty if there was none."""
    is_passed: bool = False
    words: str = ""
    rig: str = ""
    """`ProjectFolder.rig_mark` of the rig."""


@dataclass(frozen=True, slots=True)
class RigInputs:
    """Everything entered in the rig wizard."""

    board: Board = field(default_factory=Board)
    board_found: bool = False
    """True once this board was found in an image."""
    paper: Paper = "a4"
    stereo: StereoEntries = field(default_factory=StereoEntries)
    viewpoint: ViewpointEntries = field(default_factory=ViewpointEntries)
    left: DisplayEntries = field(default_factory=DisplayEntries)
    right: DisplayEntries = field(default_factory=DisplayEntries)
    saved: str = ""
    """The rig file last saved."""
    solved: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    """For each solved step, its inputs at that time."""
    acceptance: LastAcceptance = LastAcceptance()
    sources: Mapping[str, str] = field(default_factory=dict)
    """The source of images last chosen for each camera."""
    chosen_folder: str = ""
    """Folder of the file last saved or opened."""


class ProjectFolder:
    """A folder that stores the entries, the images and the partly calibrated rig.

    Parameters
    ----------
    path : Path
        Created if needed.

    Attributes
    ----------
    path : Path
    viewpoint : Path
        File of the viewpoint camera's intrinsics, once solved.

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
        """Return the entries, and a message about any error; otherwise empty.

        A file that cannot be used is kept under a name that ends in ``.bad``.
        """
        if not self._entries.exists():
            return RigInputs(), ""
        try:
            return read_settings(RigInputs, read_json(self._entries), "work"), ""
        except FileError as error:
            return RigInputs(), tr("The entries were reset: {}; {}").format(
                error, _set_aside(self._entries)
            )

    def save(self, inputs: RigInputs) -> None:
        """Write the entries, or raise FileError."""
        write_json(self._entries, settings_json(inputs))

    def load_rig(self) -> tuple[Rig, str]:
        """Return the partly calibrated rig, initially the example, and a message on any error."""
        example = resource_path("example_rig.yaml")
        if not self._rig.exists():
            return read_rig(example), ""
        try:
            return read_rig(self._rig), ""
        except FileError as error:
            return read_rig(example), tr("The rig was reset: {}; {}").format(
                error, _set_aside(self._rig)
            )

    def save_rig(self, rig: Rig) -> None:
        """Write the partly calibrated rig.

        Raises
        ------
        ValueError
            If it is implausible.
        FileError
            If it cannot be written.
        """
        write_rig(self._rig, rig)

    @property
    def rig_mark(self) -> str:
        """Hash of the partly calibrated rig without its name; empty before anything is stored."""
        try:
            lines = self._rig.read_bytes().splitlines()
        except OSError:
            return ""
        return sha256(b"\n".join(one for one in lines if one[:5] != b"name:")).hexdigest()

    def is_rig(self, path: Path) -> bool:
        """Return whether a file is the same as the rig in this folder."""
        try:
            return path.read_bytes() == self._rig.read_bytes()
        except OSError:
            return False


def entered_path(text: str) -> Path | None:
    """Return the entered path; None if the field is empty."""
    return user_path(text) if text else None


def _set_aside(path: Path) -> str:
    bad = path.with_name(f"{path.name}.bad")
    with suppress(OSError):
        path.replace(bad)
        return tr("the old file was kept as {}").format(bad)
    return tr("the old file could not be renamed")

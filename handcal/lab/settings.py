"""Settings of studies and tests; all can be stored as JSON.

Paths are texts, empty where there is none.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeAlias

from handcal.core.entry import CUBE_FILES, INTRINSICS_FILES, RIG_FILES, entry
from handcal.core.errors import FileError
from handcal.core.types import Eye
from handcal.hand.settings import Roi
from handcal.io.files import user_path
from handcal.report.html import may_be_replaced
from handcal.session.journal import JOURNAL, find_journals
from handcal.sim.sensor import SensorName

Size: TypeAlias = Literal["full", "quick"]
"""``quick`` runs few trials, as a smoke test; its results are not meaningful."""


def _seed(label: str = "&Seed") -> int:
    told = "Random seed; the same seed gives the same numbers."
    return entry(1, label, told, limits=(0, 2**31 - 1))


def _processes() -> int:
    return entry(
        0,
        "&Processes",
        "Number of processes on this computer; more than its cores is not faster.",
        hint="One per core",
        limits=(0, 1024),
    )


def _scheduler() -> str:
    return entry(
        "",
        "&Dask scheduler",
        "Address of a Dask cluster that does the work instead, such as tcp://HOST:PORT.",
        hint="None: this computer",
    )


def results_folder(default: str) -> str:
    """Return the default of a field for the folder of an evaluation's results."""
    told = "Report, figures and raw numbers; an unfinished study there is resumed."
    return entry(default, "Results fold&er", told, path="folder")


@dataclass(frozen=True, slots=True)
class NoiseStudySettings:
    """Settings of a noise study."""

    size: Size = entry(
        "full",
        "Si&ze",
        "A quick run uses few trials; do not report its numbers.",
        options={"full": "Full", "quick": "Quick"},
    )
    seed: int = _seed()
    processes: int = _processes()
    """Processes on this computer; 0 for one on each core."""
    scheduler: str = _scheduler()
    """Address of a Dask scheduler that does the work instead, ``tcp://HOST:PORT``."""
    output: str = results_folder("results/study-noise")
    """Folder for this study only; an unfinished study in it is resumed."""
    open3d: bool = False
    """Solve by Open3D's ICP, too."""


@dataclass(frozen=True, slots=True)
class MethodComparisonSettings:
    """Settings of a method comparison; `seed` to `output` as in `NoiseStudySettings`."""

    wearers: int = entry(
        100, "&Wearers", "Simulated wearers; each uses every method.", limits=(2, 10_000)
    )
    """Simulated wearers in each population."""
    seed: int = _seed()
    processes: int = _processes()
    scheduler: str = _scheduler()
    output: str = results_folder("results/study-methods")
    size: Size = "full"
    noise_wearers: int = 0
    """Simulated wearers for a search of the noise with which the paper's method has its published
    error; 0 for no search."""


@dataclass(frozen=True, slots=True)
class ProcedureStudySettings:
    """Settings of a study of procedures; `seed` to `scheduler` as in `NoiseStudySettings`."""

    wearers: int = 100
    """Simulated wearers for each plan, variant and scale; the same ones for all."""
    seed: int = 1
    plans: tuple[str, ...] = ("paper", "recommended")
    """``paper``, ``recommended``, ``recommended-unverified``, or ``spaam-N``."""
    variants: tuple[str, ...] = ("plain",)
    """Of people, as in `handcal.sim.people`."""
    scales: tuple[float, ...] = (1.33,)
    """Errors of the wearers, as multiples of the simulator's usual wearer's."""
    eye_distance: Literal["none", "ruler", "headset"] = "none"
    """Source of the wearer's eye distance."""
    prior: Literal["none", "learned"] = "none"
    """Of the eyes; ``learned``: from simulated earlier sessions."""
    wearer_prior: Literal["default", "learned"] = "default"
    """Of what wearers see wrongly; ``learned``: from repeated sittings of other people of the
    variant."""
    sensor: SensorName = "d415"
    fatten_px: float | None = None
    """The depth camera, and by how much the edges in its images grow; None: as usual."""
    processes: int = 0
    scheduler: str = ""
    output: str = ""
    """Folder for this study only; an unfinished study in it is resumed. Empty: nothing is kept."""


@dataclass(frozen=True, slots=True)
class CubeTestSettings:
    """Settings of a cube test, on captures in a folder or on rendered ones."""

    captures: str = entry(
        "",
        "Ca&ptures",
        "POSITION/POSE/real.png and virtual.png, and POSITION/grid.png.",
        hint="Rendered by the simulator",
        path="folder",
    )
    """Folder of captures; without one they are rendered."""
    cube: str = entry("", "C&ube", hint="cube.json of the captures", path="file", files=CUBE_FILES)
    camera: str = entry(
        "",
        "Camera &intrinsics",
        "Intrinsics of the camera at the eye position.",
        hint="camera.json of the captures",
        path="file",
        files=INTRINSICS_FILES,
    )
    """Files of the cube and of the camera's intrinsics; without them, those with the captures."""
    output: str = results_folder("results/cube")
    """Folder for the report."""
    rig: str = entry("", "Ri&g file", hint="The example rig", path="file", files=RIG_FILES)
    """Rig file; without one, the shipped example."""
    eye: Eye = entry(
        "left",
        "&Display",
        "The display in front of the camera.",
        options={"left": "Left", "right": "Right"},
    )
    square_px: int = entry(
        80,
        "Grid s&quares",
        "Side length of the squares of the display's grid.",
        limits=(20, 2000),
    )
    """Side of the squares of the grid on the display."""
    seed: int = _seed("&Seed of the rendering")
    """Seed of rendered captures."""
    poses: int = entry(
        4,
        "Poses &at each position",
        "Poses of the cube at each position, rendered or captured.",
        limits=(1, 100),
    )
    """Poses of the cube at each position of the camera."""
    alignments: int = entry(
        1,
        "Align&ments per position",
        "Alignments at each position, if captures are rendered.",
        limits=(1, 20),
    )
    """Alignments of the hand at each position, for rendered captures."""
    prior: Literal["camera", "wearer"] = "camera"
    """For rendered captures, as in `CaptureSettings`."""


@dataclass(frozen=True, slots=True)
class UserTestSettings:
    """Settings of a user test's evaluation."""

    folders: tuple[str, ...] = ()
    """Sessions, and folders of sessions."""
    output: str = "results/users"
    """Folder for the report."""


@dataclass(frozen=True, slots=True)
class SegmentationTestSettings:
    """Settings of a test of the segmentation on frames with true masks."""

    folder: str = entry(
        "",
        "Fra&mes",
        "NAME_color.png, NAME_depth.png and NAME_handmask.png, and a meta.json.",
        path="folder",
    )
    """Folder of the frames, as `read_masked_frames` reads it."""
    roi: Roi = entry(
        "detector",
        "&Hand",
        "Where the hand is looked for in a frame.",
        options={
            "detector": "Where the detector sees one",
            "depth": "Nearest object, by depth alone",
        },
    )
    sheet: str = ""
    """PNG for a contact sheet of the frames; empty for none."""
    output: str = results_folder("")
    """Folder for the report; empty for none."""


def output_folder(text: str) -> Path:
    """Return the folder for results, whose earlier report may be replaced.

    Raises
    ------
    FileError
        If there is none, it is among sessions, or it holds files of the user's.
    """
    if not text:
        raise FileError("choose a folder for the results")
    folder = user_path(text).absolute()
    is_in_session = any(os.path.exists(path / JOURNAL) for path in (folder, *folder.parents))
    if is_in_session or find_journals(folder) or find_journals(folder.parent):
        raise FileError(f"{folder} holds sessions, or lies among them", "choose another folder")
    for file in (folder / "report.pdf", folder / "report.html"):
        if os.path.exists(file) and not may_be_replaced(file):
            raise FileError(
                f"{folder} holds files that are not of an evaluation, such as {file.name}",
                "choose another folder",
            )
    return folder

"""Rendered captures of a whole cube test, in the folders of a real one.

A camera replaces the eye at several positions of the eye box (Hu et al. 2021, assessment with
eye-replacement camera). At each position the display is calibrated by overlaying a hand seen
through it. Then a cube is tracked by the depth camera and captured, real and drawn.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from handcal.core.display import eye_projection, view_of_eye
from handcal.core.errors import FileError
from handcal.core.geometry import image_points, invert, project, rigid, transform
from handcal.core.progress import Progress
from handcal.core.types import Eye, EyeDisplay, Float64, Intrinsics, Rig, UInt8
from handcal.io.files import make_folder, sync_folder, write_json
from handcal.io.images import write_png
from handcal.register.fuse import FuseSettings
from handcal.register.prior import LearnedPrior, PriorSettings
from handcal.register.results import SolveSettings, solve_session
from handcal.rig.cube.cube import Cube, CubeError, cube_pose, find_cube
from handcal.rig.cube.cube_file import write_cube
from handcal.rig.displays.grid import Grid, draw_grid
from handcal.rig.formats import write_intrinsics
from handcal.sim.boards import PictureSettings
from handcal.sim.cube import CubePainter, draw_cube
from handcal.sim.hand import make_hand
from handcal.sim.overlay import overlay_by_eye
from handcal.sim.viewpoint import VIEWPOINT_CAMERA, photograph_display
from handcal.sim.wearer import draw_placement_error
from handcal.sim.wearer_settings import WearerSettings

POSITIONS = {
    "centre": (0.0, 0.0),
    "up": (0.0, -1.0),
    "down": (0.0, 1.0),
    "left": (-1.0, 0.0),
    "right": (1.0, 0.0),
}
"""Positions of the camera in the eye box: x right, y down."""

POSITION_M = 0.004
"""Distance from the centre of the eye box to the other positions."""
PLACE_SIGMA_M = 0.001
"""Standard deviation of the camera's position, each axis."""
_TURN_SIGMA_RAD = 0.02  # of the camera relative to the display, about each axis
_PICTURES = PictureSettings(samples=2)
_NEAR_M, _FAR_M, _ASIDE_M = 0.4, 0.6, 0.02
_EDGE_PX = 8.0
_MOST_TRIES = 300
# At this rotation three faces are visible.
_YAW_RAD, _PITCH_RAD, _ROLL_RAD = (0.45, 1.1), (0.3, 0.7), (-0.3, 0.3)
_VERTICES = np.array(list(product((-0.5, 0.5), repeat=3)))


@dataclass(frozen=True, slots=True)
class CaptureSettings:
    """Settings of a rendered cube test."""

    seed: int = 1
    eye: Eye = "left"
    positions: tuple[str, ...] = tuple(POSITIONS)
    """Positions of the camera; names in `POSITIONS`."""
    poses: int = 4
    """Poses of the cube at each position, 0.4 to 0.6 m away."""
    alignments: int = 1
    """Alignments of the hand at each position."""
    prior: Literal["camera", "wearer"] = "camera"
    """The solver's prior: the placement of the camera, which is only moved sideways; or the eye
    box of wearers."""
    points: int = 5000
    """Number of points of the hand's clouds."""
    depth_sigma_m: float = 0.001
    """Standard deviation of the depth camera's points."""
    wearer: WearerSettings = field(default_factory=WearerSettings)
    """Errors of overlaying the hand."""
    cube: Cube = field(default_factory=Cube)
    camera: Intrinsics = VIEWPOINT_CAMERA
    """The eye-replacement camera."""


def write_captures(folder: Path, rig: Rig, settings: CaptureSettings, progress: Progress) -> None:
    """Write the captures of a test, `camera.json`, `cube.json`, and the truth, `truth.json`.

    The cube is drawn with the offline calibration (``virtual-offline``), with φ solved from the
    alignments (``virtual-solved``), and with the true φ (``virtual-true``), which shows the error
    of the test itself.

    All files appear in the folder together, so that a cancelled test is not taken for a complete
    one.

    Parameters
    ----------
    folder : Path
        Must be empty if it exists.
    rig : Rig
    settings : CaptureSettings
    progress : Progress

    Raises
    ------
    CancelledError
    FileError
        If the folder is not empty, or cannot be written.
    CubeError
        If the cube is too large to be seen whole on the display and by the cameras.
    """
    if any(make_folder(folder).iterdir()):
        raise FileError(f"{folder} is not empty", "choose a new folder")
    with _appearing_in(folder) as rendering:
        _render(rendering, rig, settings, progress)


@contextmanager
def _appearing_in(folder: Path) -> Iterator[Path]:
    """Yield a hidden folder to fill; if that succeeds, its content is moved into `folder`."""
    hidden = make_folder(folder / ".rendering")
    try:
        yield hidden
        for made in hidden.iterdir():
            made.rename(folder / made.name)
        sync_folder(folder)
    except OSError as error:
        raise FileError(f"cannot write {folder}: {error.strerror or error}") from error
    finally:
        shutil.rmtree(hidden, ignore_errors=True)


def _render(folder: Path, rig: Rig, settings: CaptureSettings, progress: Progress) -> None:
    write_intrinsics(folder / "camera.json", settings.camera, "json")
    write_cube(folder / "cube.json", settings.cube)
    studio = _Studio(rig, settings)
    truth = {}
    for number, position in enumerate(settings.positions):
        rng = np.random.default_rng([settings.seed, number])
        middle_m = POSITION_M * np.array([*POSITIONS[position], 0.0])
        true_m = rng.normal(middle_m, PLACE_SIGMA_M)
        solved_m = studio.calibrate(true_m, rng)
        truth[position] = {"true_shift_m": true_m.tolist(), "solved_shift_m": solved_m.tolist()}
        T_E_C = rigid(rng.normal(0.0, _TURN_SIGMA_RAD, 3), true_m)
        shifts_m = {"offline": np.zeros(3), "solved": solved_m, "true": true_m}
        place = make_folder(folder / position)
        write_png(place / "grid.png", studio.capture_display(studio.grid, T_E_C, rng))
        for pose in range(settings.poses):
            done = (number + pose / settings.poses) / len(settings.positions)
            progress.at(done, f"Rendering {position}, pose {pose + 1}")
            images = make_folder(place / f"pose-{pose + 1}")
            for name, image in studio.capture_cube(T_E_C, shifts_m, rng):
                write_png(images / f"{name}.png", image)
    write_json(folder / "truth.json", {"eye": settings.eye, "positions": truth})


class _Studio:
    """A headset in front of a camera, with a hand and a cube."""

    def __init__(self, rig: Rig, settings: CaptureSettings) -> None:
        self._rig, self._settings = rig, settings
        self._display = rig.eyes[settings.eye]
        self._T_E_D = view_of_eye(self._display, np.eye(4)) @ rig.T_H_D
        self._hand = make_hand(settings.seed)
        self._seen_by_eye = CubePainter(settings.cube, settings.camera, _PICTURES)
        self._seen_by_depth = CubePainter(settings.cube, rig.depth_intrinsics, _PICTURES)
        self.grid = draw_grid(Grid(self._display.width_px, self._display.height_px))

    def calibrate(self, true_m: Float64, rng: np.random.Generator) -> Float64:
        """Return φ solved from alignments of the hand with its cursor."""
        settings = self._settings
        alignments = [
            overlay_by_eye(
                rng,
                self._hand,
                self._rig,
                {settings.eye: true_m},
                settings.points,
                settings.depth_sigma_m,
                placement_error=draw_placement_error(rng, settings.wearer),
            )
            for _ in range(settings.alignments)
        ]
        solve = SolveSettings(fuse=FuseSettings(prior=cube_prior(settings)))
        return solve_session(alignments, self._rig, solve).eyes[settings.eye].shift_m

    def capture_display(self, shown: UInt8, T_E_C: Float64, rng: np.random.Generator) -> UInt8:
        """Return the camera's image of the display in the dark."""
        settings = self._settings
        return photograph_display(
            shown,
            self._display,
            T_E_C[:3, :3],
            settings.camera,
            rng,
            shift_m=T_E_C[:3, 3],
            settings=_PICTURES,
        )

    def capture_cube(
        self, T_E_C: Float64, shifts_m: Mapping[str, Float64], rng: np.random.Generator
    ) -> Iterator[tuple[str, UInt8]]:
        """Yield captures of the cube at one pose: real, and drawn with each φ."""
        T_E_T, tracked = self._place_cube(T_E_C, shifts_m.values(), rng)
        yield "real", self._seen_by_eye.paint(invert(T_E_C) @ T_E_T, rng)
        for name, shift_m in shifts_m.items():
            shown = draw_cube(self._settings.cube, self._display, tracked, shift_m)
            yield f"virtual-{name}", self.capture_display(shown, T_E_C, rng)

    def _place_cube(
        self, T_E_C: Float64, shifts_m: Iterable[Float64], rng: np.random.Generator
    ) -> tuple[Float64, Float64]:
        """Return T_E_T, true and tracked, of a cube seen whole by display and cameras."""
        settings, depth_camera = self._settings, self._rig.depth_intrinsics
        for _ in range(_MOST_TRIES):
            T_E_T = some_cube_pose(self._display, rng.uniform(_NEAR_M, _FAR_M), rng)
            vertices_m = transform(T_E_T, settings.cube.side_m * _VERTICES)
            if not (
                _sees(settings.camera, T_E_C, vertices_m)
                and _sees(depth_camera, self._T_E_D, vertices_m)
                and all(_shows(self._display, shift_m, vertices_m) for shift_m in shifts_m)
            ):
                continue
            with suppress(CubeError):
                image = self._seen_by_depth.paint(invert(self._T_E_D) @ T_E_T, rng)
                T_D_T = cube_pose(find_cube(image, settings.cube), settings.cube, depth_camera)
                return T_E_T, self._T_E_D @ T_D_T
        raise CubeError(
            "part of the cube is off the display or out of a camera's view", "use a smaller one"
        )


def cube_prior(settings: CaptureSettings) -> PriorSettings:
    """Return the solver's prior of φ before the alignments.

    A camera on a stand is moved sideways on purpose, and stays in place along the line of sight. A
    wearer's eye does not: with the eye box as prior, alignments move φ along z by more than the
    stand's error.
    """
    if settings.prior == "wearer":
        return PriorSettings()
    near_m2 = PLACE_SIGMA_M**2
    aside_m2 = POSITION_M**2 + near_m2
    covariance_m2 = np.diag([aside_m2, aside_m2, near_m2] * 2)
    return PriorSettings(learned=LearnedPrior((0.0,) * 6, tuple(covariance_m2.ravel().tolist()), 1))


def some_cube_pose(display: EyeDisplay, depth_m: float, rng: np.random.Generator) -> Float64:
    """Return a random T_E_T of a cube on the display's axis with three visible faces."""
    middle_px = [(display.width_px - 1) / 2, (display.height_px - 1) / 2, 1.0]
    ray = np.linalg.solve(eye_projection(display)[:, :3], middle_px)
    aside_m = rng.uniform(-_ASIDE_M, _ASIDE_M, 2)
    yaw = rng.uniform(*_YAW_RAD) * rng.choice([-1.0, 1.0])
    turn = Rotation.from_euler("ZXY", [rng.uniform(*_ROLL_RAD), rng.uniform(*_PITCH_RAD), yaw])
    return rigid(turn.as_matrix(), depth_m * ray / ray[2] + [*aside_m, 0.0])


def _sees(camera: Intrinsics, T_E_camera: Float64, points_E_m: Float64) -> bool:
    pixels = image_points(transform(invert(T_E_camera), points_E_m), camera)
    return _within(pixels, camera.width, camera.height)


def _shows(display: EyeDisplay, shift_m: Float64, points_E_m: Float64) -> bool:
    pixels = project(eye_projection(display, shift_m), points_E_m)
    return _within(pixels, display.width_px, display.height_px)


def _within(pixels: Float64, width_px: int, height_px: int) -> bool:
    far_px = np.array([width_px, height_px]) - _EDGE_PX
    return bool(((pixels > _EDGE_PX) & (pixels < far_px)).all())

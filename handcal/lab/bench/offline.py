"""The whole offline calibration, from rendered photographs of a known rig."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from handcal.core.display import view_of_eye
from handcal.core.geometry import image_points, invert, rigid
from handcal.core.progress import Progress
from handcal.core.types import EYES, Eye, Float64, Intrinsics, Rig
from handcal.lab.bench.figure import BenchFigure
from handcal.lab.bench.settings import BenchSettings
from handcal.lab.bench.stand_in import ratio_of_means, reprojection_of_wearers
from handcal.lab.bench.trials import Measured
from handcal.report.statistics import MeanInterval
from handcal.rig.boards.board import Board
from handcal.rig.boards.views import BoardImage, board_image
from handcal.rig.displays.grid import Grid, GridView, draw_grid, find_grid
from handcal.rig.displays.homography import (
    DisplayHomography,
    DisplaySettings,
    calibrate_display,
    fit_homography,
    pixel_size_m,
    undistort,
)
from handcal.rig.example import FOCAL_PX, Z_E_S_M, example_rig
from handcal.rig.lens.camera import calibrate_camera
from handcal.rig.lens.stereo import calibrate_stereo
from handcal.rig.lens.viewpoint import viewpoint_from_stereo
from handcal.rig.steps import screen_of, with_display, with_stereo
from handcal.sim.boards import BoardPainter, PictureSettings, board_poses
from handcal.sim.viewpoint import VIEWPOINT_CAMERA, photograph_display

HEADSET_CAMERA = Intrinsics(
    1280, 720, 1010.0, 1008.0, 645.0, 356.0, (0.06, -0.13, 0.0006, -0.0004, 0.04)
)
_MADE = "simulated"
_CAMERA_TURN_RAD = 0.04
_MOST_RATIO = 1.1
# The manufacturer's figures for the example's displays: 2,456 px of focal length at 2 m.
_KNOWN_PIXELS = DisplaySettings(pixel_m=pixel_size_m(2.0 * np.arctan(0.5 / FOCAL_PX), 1.0, Z_E_S_M))
_FIGURES = (
    ("offline: rotation of T_H_D", "rotation_deg", 1.0, "°", 0.05),
    ("offline: translation of T_H_D", "translation_mm", 1.0, "mm", 0.3),
    ("offline: focal lengths", "focal_share", 100.0, "%", 0.3),
    ("offline: display homography", "homography_px", 1.0, "px", 0.3),
    ("offline: z(C0→S)", "distance_share", 100.0, "%", 2.0),
    ("offline: t(C0→V)", "viewpoint_mm", 1.0, "mm", None),
)


@dataclass(frozen=True, slots=True)
class OfflineSettings:
    """Settings of the photographs."""

    views: int = 20
    """Images of the board for each camera's intrinsics, and for each pair of cameras."""
    grids: int = 3
    """Images of each display."""
    viewpoint_camera: Intrinsics = VIEWPOINT_CAMERA
    headset_camera: Intrinsics = HEADSET_CAMERA
    """True intrinsics."""
    pictures: PictureSettings = field(default_factory=lambda: PictureSettings(samples=2))
    """Blur and noise."""


@dataclass(frozen=True, slots=True, eq=False)
class OfflineRun:
    """A rig calibrated from photographs, with the errors of its parts."""

    rig: Rig
    rotation_deg: float
    translation_mm: float
    """Error of T_H_D."""
    focal_share: float
    """Largest relative error of both cameras' focal lengths."""
    homography_px: float
    """Largest error on both displays, in display pixels."""
    distance_share: float
    """Larger relative error of z(C0→S)."""
    viewpoint_mm: float
    """Larger error of t(C0→V)."""


def measure_offline(settings: BenchSettings, progress: Progress) -> Measured:
    """Measure the accuracy of rigs calibrated from photographs; the worst one counts."""
    runs = []
    for seed in range(settings.offline_rigs):
        runs.append(calibrate_from_photographs(example_rig(), seed))
        progress.at(0.5 * (seed + 1) / settings.offline_rigs)
    ratios = _stand_in_ratios([run.rig for run in runs], settings.offline_wearers, progress)
    progress.at(1.0)
    figures = [
        BenchFigure(what, max(scale * getattr(run, name) for run in runs), unit, at_most=target)
        for what, name, scale, unit, target in _FIGURES
        if runs
    ]
    if ratios:
        worst = max(ratios, key=lambda one: one.mean)
        what = "offline: reprojection error, calibrated / true rig"
        figures += [
            BenchFigure(what, worst.mean, "", at_most=_MOST_RATIO),
            BenchFigure(f"{what}: least by 95 %", worst.low, ""),
            BenchFigure(f"{what}: most by 95 %", worst.high, ""),
        ]
    rows = [
        {name: getattr(run, name) for _, name, *_ in _FIGURES} | {"reprojection_ratio": asdict(one)}
        for run, one in zip(runs, ratios, strict=True)
    ]
    return Measured(figures, rows)


def _stand_in_ratios(rigs: list[Rig], wearers: int, progress: Progress) -> list[MeanInterval]:
    """Return the ratio of wearers' reprojection errors with each rig and with the true one."""
    if not rigs:
        return []
    count = 1 + len(rigs)
    errors = [
        reprojection_of_wearers(
            rig,
            example_rig(),
            wearers,
            progress.part(0.5 + 0.5 * number / count, 0.5 + 0.5 * (number + 1) / count),
        )
        for number, rig in enumerate([example_rig(), *rigs])
    ]
    return [ratio_of_means(one, errors[0]) for one in errors[1:]]


def calibrate_from_photographs(
    true: Rig, seed: int, settings: OfflineSettings | None = None
) -> OfflineRun:
    """Calibrate a rig as a technician does, from rendered images.

    Parameters
    ----------
    true : Rig
        Only the displays' sizes, T_V_H and the depth camera's intrinsics are used, which devices
        report; everything else is solved.
    seed : int
        Seed of poses and noise.
    settings : OfflineSettings, optional
    """
    settings = settings or OfflineSettings()
    studio = _Studio(true, seed, settings)
    viewpoint = calibrate_camera(studio.board_views(settings.viewpoint_camera)).pinhole
    headset = calibrate_camera(studio.board_views(settings.headset_camera)).pinhole
    pairs = studio.pairs(true.depth_intrinsics, true.T_H_D)
    stereo = calibrate_stereo(pairs, true.depth_intrinsics, headset)
    rig = with_stereo(replace(true, name="Calibrated from photographs"), stereo, _MADE)
    homography_px = []
    for eye in EYES:
        T_E_C = rigid(studio.rng.normal(0.0, _CAMERA_TURN_RAD, 3))
        T_H_C = invert(view_of_eye(true.eyes[eye], np.eye(4))) @ T_E_C
        place = calibrate_stereo(studio.pairs(settings.viewpoint_camera, T_H_C), viewpoint, headset)
        screen = screen_of(true, eye)
        seen = studio.grid_views(eye, T_E_C[:3, :3])
        homography = fit_homography(seen, viewpoint, screen.width_px, screen.height_px)
        found = calibrate_display(
            homography, viewpoint, viewpoint_from_stereo(place), screen, _KNOWN_PIXELS
        )
        rig = with_display(rig, eye, found, _MADE)
        homography_px.append(studio.homography_error_px(eye, T_E_C[:3, :3], homography, viewpoint))
    shifts_m = [rig.eyes[eye].t_C0_V_m - true.eyes[eye].t_C0_V_m for eye in EYES]
    distances = [rig.eyes[eye].z_C0_S_m / true.eyes[eye].z_C0_S_m for eye in EYES]
    focal_lengths = [
        (found.fx / there.fx, found.fy / there.fy)
        for found, there in (
            (viewpoint, settings.viewpoint_camera),
            (headset, settings.headset_camera),
        )
    ]
    turn = Rotation.from_matrix(true.T_H_D[:3, :3].T @ rig.T_H_D[:3, :3])
    return OfflineRun(
        rig=rig,
        rotation_deg=float(np.degrees(turn.magnitude())),
        translation_mm=1e3 * float(np.linalg.norm(rig.T_H_D[:3, 3] - true.T_H_D[:3, 3])),
        focal_share=float(np.abs(np.array(focal_lengths) - 1.0).max()),
        homography_px=max(homography_px),
        distance_share=float(np.abs(np.array(distances) - 1.0).max()),
        viewpoint_mm=1e3 * max(float(np.linalg.norm(shift_m)) for shift_m in shifts_m),
    )


class _Studio:
    """Takes photographs of a board with the cameras of a rig."""

    def __init__(self, true: Rig, seed: int, settings: OfflineSettings) -> None:
        self.rng = np.random.default_rng(seed)
        self._true = true
        self._settings = settings
        self._board = Board()
        cameras = settings.viewpoint_camera, settings.headset_camera, true.depth_intrinsics
        self._painters = {
            camera: BoardPainter(self._board, camera, settings.pictures) for camera in cameras
        }

    def board_views(self, camera: Intrinsics) -> list[BoardImage]:
        """Photograph the board with one camera."""
        poses = board_poses(self._board, camera, self._settings.views, self.rng)
        return [self._photograph(camera, T, number) for number, T in enumerate(poses)]

    def pairs(self, camera: Intrinsics, T_H_camera: Float64) -> list[tuple[BoardImage, BoardImage]]:
        """Photograph the board with one camera and the headset's."""
        headset = self._settings.headset_camera
        poses = board_poses(
            self._board, camera, self._settings.views, self.rng, others=((T_H_camera, headset),)
        )
        return [
            (
                self._photograph(camera, T, number),
                self._photograph(headset, T_H_camera @ T, number),
            )
            for number, T in enumerate(poses)
        ]

    def grid_views(self, eye: Eye, R_E_C: Float64) -> dict[str, GridView]:
        """Photograph the displayed grid with the viewpoint camera."""
        display, camera = self._true.eyes[eye], self._settings.viewpoint_camera
        grid = Grid(display.width_px, display.height_px)
        shown = draw_grid(grid)
        return {
            f"grid {number}": find_grid(
                photograph_display(
                    shown, display, R_E_C, camera, self.rng, settings=self._settings.pictures
                ),
                grid,
            )
            for number in range(self._settings.grids)
        }

    def homography_error_px(
        self, eye: Eye, R_E_C: Float64, found: DisplayHomography, camera: Intrinsics
    ) -> float:
        """Return the error of the solved homography on the display."""
        display = self._true.eyes[eye]
        x, y = np.linspace(0, display.width_px - 1, 9), np.linspace(0, display.height_px - 1, 9)
        display_px = np.dstack(np.meshgrid(x, y)).reshape(-1, 2)
        homogeneous = np.column_stack([display_px, np.ones(81)])
        rays = np.linalg.solve(display.K @ display.H0 @ R_E_C, homogeneous.T).T
        pixels = image_points(rays, self._settings.viewpoint_camera)
        H_S_C = np.linalg.inv(found.H_C_S)
        back_px = cv2.perspectiveTransform(undistort(pixels, camera)[None], H_S_C)[0]
        return float(np.linalg.norm(back_px - display_px, axis=1).max())

    def _photograph(self, camera: Intrinsics, T_C_B: Float64, number: int) -> BoardImage:
        return board_image(
            f"board {number}", self._painters[camera].paint(T_C_B, self.rng), self._board
        )

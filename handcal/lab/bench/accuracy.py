"""Accuracy against known truth: alignments of simulated hands, wearers, cameras and whole rigs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from itertools import product, takewhile
from typing import Any, cast

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from handcal.core.display import reprojection_arcmin, view_of_eye
from handcal.core.geometry import image_points, invert, rigid
from handcal.core.progress import Progress
from handcal.core.types import EYES, METHODS, Eye, Float64, Intrinsics, Method, Rig
from handcal.lab.bench.trials import (
    BenchFigure,
    BenchSettings,
    Errors,
    Measured,
    collect_errors,
    mean_length_mm,
    measured_alignment,
    run_trials,
    trial_alignment,
    trial_hand,
)
from handcal.lab.study.procedure_trial import ProcedureModel
from handcal.lab.study.procedures import ProcedureSettings, procedure_trial
from handcal.lab.study.run import Case
from handcal.lab.study.trials import floor_error_m, solve_trial
from handcal.register.guard import GuardSettings
from handcal.register.solve import solve_alignment
from handcal.report.statistics import MeanInterval, mean_interval
from handcal.rig.assemble import screen_of, with_display, with_stereo
from handcal.rig.boards.board import Board
from handcal.rig.boards.views import BoardImage, board_image
from handcal.rig.displays.display import (
    DisplayHomography,
    DisplaySettings,
    calibrate_display,
    fit_homography,
    pixel_size_m,
    undistort,
)
from handcal.rig.displays.grid import Grid, GridView, draw_grid, find_grid
from handcal.rig.example import FOCAL_PX, Z_E_S_M, example_rig
from handcal.rig.lens.camera import calibrate_camera
from handcal.rig.lens.stereo import calibrate_stereo
from handcal.rig.lens.viewpoint import viewpoint_from_stereo
from handcal.sim.alignments import AlignmentSettings
from handcal.sim.boards import BoardPainter, PictureSettings, board_poses
from handcal.sim.overlay import overlay_by_eye
from handcal.sim.sensor import SensorName
from handcal.sim.viewpoint import VIEWPOINT_CAMERA, photograph_display
from handcal.sim.wearer import draw_eyes, draw_placement_error
from handcal.sim.wearer_settings import WearerSettings

# The paper's own simulation (Hu et al. 2021, "Simulation test on rotation-constrained ICP").
#
# A hand, the cursor made from it with a known φ, and the cursor turned about a random point of the
# cloud. One set of data follows the paper, made from UQ itself (κ = 1); the other has a hand of
# constant size (κ = 1 - φ3φ4).

_SLOW = "paper", "linear"
_PUBLISHED_MM = 4.0
_FLOOR_RATIO = 1.1
# Lower limit of the floor and of the paper's error, which may be only rounding.
_ROUNDING_MM = 0.01
# The two sets of data, and whether their equation is exact.
_DATA = {"paper's data": False, "honest data": True}


def measure_paper_simulation(settings: BenchSettings, progress: Progress) -> Measured:
    """Compare the methods with each other, with the floor and with the published result."""

    def solve(case: tuple[str, float], trial: int) -> Errors:
        data, angle_deg = case
        making = AlignmentSettings(count=settings.points, exact=_DATA[data])
        made = trial_alignment(trial, angle_deg, making)
        errors = {_floor(of): floor_error_m(made, exact=exact) for of, exact in _DATA.items()}
        for method in METHODS:
            if method == "icp-open3d":
                continue
            if method not in _SLOW or trial < settings.slow_trials:
                errors[method] = solve_trial(made, method).shift_m - made.shift_m
        return errors

    cases = list(product(_DATA, settings.angles_deg))
    by_case = collect_errors(solve, cases, settings.trials, progress)
    figures = _published({angle: by_case["paper's data", angle] for angle in settings.angles_deg})
    for data in _DATA:
        figures += _compare(data, [by_case[data, angle] for angle in settings.angles_deg])
    rows = [
        _row(*case, name, errors_m)
        for case, errors in by_case.items()
        for name, errors_m in errors.items()
    ]
    return Measured(figures, rows)


def _floor(data: str) -> str:
    return f"floor for {data}"


def _published(by_angle: Mapping[float, Errors]) -> list[BenchFigure]:
    """Return the largest angle at which ``paper`` reaches the published accuracy."""

    def reach_deg(measure_mm: Callable[[Float64], float]) -> float:
        good = takewhile(lambda a: measure_mm(by_angle[a]["paper"]) <= _PUBLISHED_MM, by_angle)
        return max(good, default=0.0)

    measures: dict[str, Callable[[Float64], float]] = {
        "mean |Δφ|": mean_length_mm,
        "mean |Δφi|": lambda errors_m: float(np.mean(_components_mm(errors_m))),
    }
    return [
        BenchFigure(f"paper: {name} ≤ 4 mm up to (published: 9°)", reach_deg(measure), "°")
        for name, measure in measures.items()
    ]


def _compare(data: str, by_angle: Sequence[Errors]) -> list[BenchFigure]:
    """Compare ``consistent`` with the floor and with ``paper``, in the worst case."""
    limits = {_floor(data): _FLOOR_RATIO, "paper": 1.0}
    return [
        BenchFigure(
            f"worst consistent / {name.split()[0]}, {data}",
            max(_ratio(errors["consistent"], errors[name]) for errors in by_angle),
            "",
            at_most=limit,
        )
        for name, limit in limits.items()
    ]


def _ratio(errors_m: Float64, baseline_m: Float64) -> float:
    """Return the ratio of mean |Δφ| over the trials common to both."""
    shared = errors_m[: len(baseline_m)]
    return mean_length_mm(shared) / max(mean_length_mm(baseline_m), _ROUNDING_MM)


def _components_mm(errors_m: Float64) -> list[float]:
    components_mm: list[float] = (1e3 * np.abs(errors_m).mean(axis=0)).tolist()
    return components_mm


def _row(data: str, angle_deg: float, name: str, errors_m: Float64) -> dict[str, Any]:
    return {
        "data": data,
        "angle_deg": angle_deg,
        "method": name,
        "trials": len(errors_m),
        "mean_mm": mean_length_mm(errors_m),
        "component_means_mm": _components_mm(errors_m),
    }


# Clouds as from a sensor: cut at different places, sampled independently, noisy.

_CUT_SIGMA_M = 0.0015
_SIGMA_M = 0.0005, 0.002
_ANGLE_MAX_DEG = 9.0


def measure_cuts(settings: BenchSettings, progress: Progress) -> Measured:
    """Compare ``consistent`` on differently cut clouds with the floor."""

    def solve(angle_deg: float, trial: int) -> Errors:
        rng = np.random.default_rng([trial, 1])
        made = measured_alignment(rng, trial, angle_deg, _CUT_SIGMA_M, settings.points)
        solved = solve_trial(made, "consistent")
        error_m = solved.shift_m - made.shift_m
        return {
            "floor": floor_error_m(made, exact=True),
            "consistent": error_m,
            "whitened": np.linalg.solve(np.linalg.cholesky(solved.covariance_m2), error_m),
        }

    by_angle = collect_errors(solve, settings.cut_angles_deg, settings.trials, progress)
    rows = [
        {
            "angle_deg": angle_deg,
            "trials": settings.trials,
            "floor_mean_mm": mean_length_mm(errors["floor"]),
            "consistent_mean_mm": mean_length_mm(errors["consistent"]),
            "normalised_squared_error_mean": float(np.mean(np.sum(errors["whitened"] ** 2, 1))),
        }
        for angle_deg, errors in by_angle.items()
    ]
    straight, *turned = rows
    excess_mm = max(row["consistent_mean_mm"] - row["floor_mean_mm"] for row in turned)
    what = "other cut, noise: mean |Δφ|"
    return Measured(
        [
            BenchFigure(f"{what} at 0°", straight["consistent_mean_mm"], "mm", at_most=1.0),
            BenchFigure(f"{what} above floor", excess_mm, "mm", at_most=0.5),
        ],
        rows,
    )


def measure_covariance(settings: BenchSettings, progress: Progress) -> Measured:
    """Measure whether the covariance matches the errors.

    If it does, the squared error normalised by the covariance averages 3.
    """

    def solve(trial: int) -> float:
        rng = np.random.default_rng([trial, 2])
        angle_deg, sigma_m = rng.uniform(0.0, _ANGLE_MAX_DEG), rng.uniform(*_SIGMA_M)
        made = measured_alignment(rng, trial, angle_deg, sigma_m, settings.points)
        solved = solve_trial(made, "consistent")
        error_m = solved.shift_m - made.shift_m
        return float(error_m @ np.linalg.solve(solved.covariance_m2, error_m))

    squares = run_trials(solve, range(settings.covariance_trials), progress)
    mean = float(np.mean(squares))
    return Measured(
        [BenchFigure("normalised squared error, mean", mean, "", at_least=2.4, at_most=3.6)],
        {"trials": len(squares), "mean": mean, "median": float(np.median(squares))},
    )


# Ideal alignments by a simulated person without placement error.

_ASIDE_M, _ALONG_M = 0.005, 0.010
_BIAS_MM = 0.3


def measure_wearer(settings: BenchSettings, progress: Progress) -> Measured:
    """Measure the bias in φ3 for an eye 10 mm nearer to the display and 10 mm farther."""
    rig = example_rig()

    def solve(along_m: float, trial: int) -> Errors:
        rng = np.random.default_rng(trial)
        true_m = np.array([*rng.uniform(-_ASIDE_M, _ASIDE_M, 2), along_m])
        eye = EYES[trial % 2]
        alignment = overlay_by_eye(rng, trial_hand(trial), rig, {eye: true_m}, settings.points)
        methods: list[Method] = ["consistent"]
        if trial < settings.slow_trials:
            methods.append("paper")
        return {m: solve_alignment(alignment, rig, m)[eye].shift_m - true_m for m in methods}

    by_place = collect_errors(solve, (-_ALONG_M, _ALONG_M), settings.trials, progress)
    rows = [
        {"true_phi_3_mm": 1e3 * along_m, "method": method, "trials": len(errors_m)}
        | {"mean_error_mm": (1e3 * errors_m.mean(axis=0)).tolist()}
        for along_m, errors in by_place.items()
        for method, errors_m in errors.items()
    ]
    bias_mm = max(
        abs(1e3 * float(errors["consistent"][:, 2].mean())) for errors in by_place.values()
    )
    missed = np.mean(
        [-errors["paper"][:, 2].mean() / along_m for along_m, errors in by_place.items()]
    )
    return Measured(
        [
            BenchFigure("bias at φ3 = ±10 mm", bias_mm, "mm", at_most=_BIAS_MM),
            BenchFigure("share of φ3 that paper misses", 100 * float(missed), "%"),
        ],
        rows,
    )


# Whole calibrations with simulated depth cameras: a RealSense D415, and AHAT of a HoloLens 2.

_SEED = 1
_AT_MOST = 1.3
_CAMERAS: dict[str, SensorName] = {"D415": "d415", "AHAT": "ahat"}


def measure_cameras(settings: BenchSettings, progress: Progress) -> Measured:
    """Calibrate the same wearers with each camera, in one place on the headset."""
    if not settings.camera_wearers:
        progress.at(1.0)
        return Measured([], {})
    tasks = [(name, number) for number in range(settings.camera_wearers) for name in _CAMERAS]
    errors = run_trials(lambda task: _errors_arcmin(_CAMERAS[task[0]], task[1]), tasks, progress)
    by_camera: dict[str, list[float]] = {name: [] for name in _CAMERAS}
    for (name, _), found in zip(tasks, errors, strict=True):
        by_camera[name] += found
    mean = {name: float(np.mean(found)) for name, found in by_camera.items()}
    return Measured(
        [
            BenchFigure("calibration with a D415: mean error", mean["D415"], "′"),
            BenchFigure(
                "the same with a HoloLens 2's AHAT / D415",
                mean["AHAT"] / mean["D415"],
                "",
                at_most=_AT_MOST,
            ),
        ],
        {f"{name}_arcmin": found for name, found in by_camera.items()},
    )


def _errors_arcmin(sensor: SensorName, number: int) -> list[float]:
    """Return the error of each eye of a wearer after the recommended plan, verified."""
    plan: Case = {"wearer": number, "plan": "recommended", "variant": "plain", "scale": 1.0}
    rows = procedure_trial(ProcedureSettings(_SEED, ProcedureModel(sensor=sensor)), plan)
    return [cast("float", row["after_arcmin"]) for row in rows]


# Reprojection errors of wearers who calibrate with an imperfect rig.

_POINTS = 3000
_DEPTH_SIGMA_M = 0.001


def reprojection_of_wearers(rig: Rig, worn_rig: Rig, wearers: int, progress: Progress) -> Float64:
    """Return each wearer's mean reprojection error, arcmin, after one alignment with both eyes.

    They differ in eyes, hands and placement errors; wearer n is the same for every rig.

    Parameters
    ----------
    rig : Rig
        Rig used for calibration and rendering.
    worn_rig : Rig
        The true rig.
    wearers : int
    progress : callable
    """
    placement = WearerSettings()

    def reprojection(number: int) -> float:
        rng = np.random.default_rng(number)
        true_m = draw_eyes(rng, placement)
        error = draw_placement_error(rng, placement)
        while np.linalg.norm(error.rotation_rad) > GuardSettings().limit_rad:
            error = draw_placement_error(rng, placement)
        hand = trial_hand(number)
        alignment = overlay_by_eye(
            rng,
            hand,
            rig,
            true_m,
            _POINTS,
            _DEPTH_SIGMA_M,
            placement_error=error,
            worn_rig=worn_rig,
        )
        solved = solve_alignment(alignment, rig)
        solved_m = {eye: solved[eye].shift_m for eye in EYES}
        return reprojection_arcmin(rig, solved_m, true_m, worn_rig)

    return np.array(run_trials(reprojection, range(wearers), progress))


def ratio_of_means(errors: Float64, baseline: Float64) -> MeanInterval:
    """Return the ratio of two means (N,) over the same wearers, with its 95 % interval.

    The ratio is linearised (Cochran 1977, Sampling Techniques, section 6.4).
    """
    ratio = float(errors.mean() / baseline.mean())
    about = mean_interval((errors - ratio * baseline) / baseline.mean())
    return MeanInterval(ratio, ratio + about.low, ratio + about.high, about.level, about.clusters)


# The whole offline calibration, from rendered photographs of a known rig.

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

"""Registration beside other libraries: time and error together, and robustness."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from time import process_time
from typing import Any, TypeAlias

import numpy as np
import small_gicp
from scipy.spatial.transform import Rotation

from handcal.core.geometry import invert, rigid, transform
from handcal.core.progress import Progress
from handcal.core.types import Bool, Float64
from handcal.lab.bench.trials import (
    BenchFigure,
    BenchSettings,
    Measured,
    measured_alignment,
    trial_hand,
)
from handcal.lab.study.trials import solve_trial
from handcal.register.consistent import match_hands
from handcal.register.guard import RotationGuard
from handcal.register.rcicp import best_rigid
from handcal.register.solve import solve_eye_shift
from handcal.register.surface import describe_surface
from handcal.sim.alignments import SimulatedAlignment
from handcal.sim.raster import visible_points

# Other libraries at their best settings. Times are processor time, which other programs on the
# machine affect least.

RegisterAlignment: TypeAlias = Callable[[SimulatedAlignment], Float64 | None]
"""Return T_cursor_hand, (4, 4); None for what gives no movement."""

_SIGMA_M = 0.001
_ANGLE_MAX_DEG = 9.0
_REACH_M = 0.05
_ITERATIONS = 100
_BEST = "small_gicp GICP, 5 mm"
_SOLVE = "solve_eye_shift"
_FOLLOW = "guard, followed"
_GICP_RATIO, _GUARD_RATIO, _GUARD_ERROR_RATIO = 2.0, 0.5, 1.15
_MOST_MS = 150.0
# Larger clouds are registered fewer times, and not by Open3D, which takes seconds for each.
_MANY, _MANY_TRIALS = 50_000, 3


def measure_peers(settings: BenchSettings, progress: Progress) -> Measured:
    """Register the same clouds of several sizes by each library, in turn.

    Errors are those of the hand's centroid and of its rotation.
    """
    rows = []
    for number, points in enumerate(settings.peer_points):
        rows += _measure_size(points, settings.peer_trials)
        progress.at((number + 1) / len(settings.peer_points))
    at = {(row["method"], row["points"]): row for row in rows}
    usual = settings.peer_points[len(settings.peer_points) // 2]
    best, solve = at[_BEST, usual], at[_SOLVE, usual]
    own, guard = at["handcal", usual], at[_FOLLOW, usual]
    largest = at[_SOLVE, settings.peer_points[-1]]
    figures = [
        BenchFigure(f"{_SOLVE} / {_BEST}", solve["ms"] / best["ms"], "", at_most=_GICP_RATIO),
        BenchFigure(f"its registration's error / {_BEST}", own["mm"] / best["mm"], "", at_most=1.0),
        BenchFigure(f"{_FOLLOW} / {_BEST}", guard["ms"] / best["ms"], "", at_most=_GUARD_RATIO),
        BenchFigure(
            f"{_FOLLOW} / {_BEST}, rotation error",
            guard["deg"] / best["deg"],
            "",
            at_most=_GUARD_ERROR_RATIO,
        ),
        BenchFigure(
            f"{_SOLVE}, {largest['points']:,} points", largest["ms"], "ms", at_most=_MOST_MS
        ),
    ]
    return Measured(figures, rows)


def _measure_size(points: int, trials: int) -> list[dict[str, Any]]:
    """Return a row for each method: median time, and mean errors; the methods alternate."""
    times_ms: dict[str, list[float]] = {}
    errors: dict[str, list[tuple[float, float]]] = {}
    for trial in range(trials if points <= _MANY else min(trials, _MANY_TRIALS)):
        rng = np.random.default_rng([trial, 3])
        angle_deg = rng.uniform(0.0, _ANGLE_MAX_DEG)
        made = measured_alignment(rng, trial, angle_deg, _SIGMA_M, points)
        peers = _small_gicp() | (_open3d() if points <= _MANY else {})
        for name, register in (_own(made) | peers).items():
            start_s = process_time()
            T_cursor_hand = register(made)
            times_ms.setdefault(name, []).append(1e3 * (process_time() - start_s))
            if T_cursor_hand is not None:
                errors.setdefault(name, []).append(_errors(T_cursor_hand, made))
    rows: list[dict[str, Any]] = []
    for name, each_ms in times_ms.items():
        row: dict[str, Any] = {"method": name, "points": points}
        row |= {"ms": float(np.median(each_ms)), "shortest_ms": min(each_ms)}
        if name in errors:
            mm, deg = np.mean(errors[name], axis=0)
            row |= {"deg": float(deg)} | ({} if np.isnan(mm) else {"mm": float(mm)})
        rows.append(row)
    return rows


def _errors(T_cursor_hand: Float64, made: SimulatedAlignment) -> tuple[float, float]:
    """Return the errors of the centroid, mm, and of the rotation, degrees."""
    T_true = invert(made.T_E_W) @ best_rigid(made.known_hand_m, made.known_cursor_m) @ made.T_E_W
    middle_m = made.hand_m.mean(axis=0)[None]
    away_m = transform(T_cursor_hand, middle_m) - transform(T_true, middle_m)
    turned = Rotation.from_matrix(T_cursor_hand[:3, :3] @ T_true[:3, :3].T)
    # A rotation alone says nothing of the place.
    has_place = T_cursor_hand[:3, 3].any()
    away_mm = 1e3 * float(np.linalg.norm(away_m)) if has_place else np.nan
    return away_mm, float(np.degrees(turned.magnitude()))


def _own(made: SimulatedAlignment) -> dict[str, RegisterAlignment]:
    """Return handcal's registration, solver and guard; the guard has seen the hand move."""
    guard = RotationGuard(made.cursor_m, made.cursor_cut)
    middle_m = made.hand_m.mean(axis=0)
    T_before = rigid([0.02, -0.01, 0.015], middle_m + np.array([0.004, -0.003, 0.005]))
    guard.follow(transform(T_before, made.hand_m - middle_m), made.hand_cut)

    def register(made: SimulatedAlignment) -> Float64:
        clouds = made.cursor_m, made.hand_m, made.cursor_cut, made.hand_cut
        return match_hands(*clouds).rigid.T_target_source

    def solve(made: SimulatedAlignment) -> None:
        solve_eye_shift(
            made.cursor_m,
            made.hand_m,
            display_distance_m=made.display_distance_m,
            T_E_W=made.T_E_W,
            cursor_cut=made.cursor_cut,
            hand_cut=made.hand_cut,
        )

    def follow(made: SimulatedAlignment) -> Float64:
        return rigid(-guard.follow(made.hand_m, made.hand_cut))

    return {"handcal": register, _SOLVE: solve, _FOLLOW: follow}


def _small_gicp() -> dict[str, RegisterAlignment]:
    def align(kind: str, cube_m: float) -> RegisterAlignment:
        return lambda made: (
            small_gicp.align(
                made.cursor_m,
                made.hand_m,
                _start(made),
                registration_type=kind,
                voxel_resolution=0.01,
                downsampling_resolution=cube_m,
                max_correspondence_distance=_REACH_M,
                num_threads=1,
                max_iterations=_ITERATIONS,
            ).T_target_source
        )

    return {
        _BEST: align("GICP", 0.005),
        "small_gicp GICP, 3 mm": align("GICP", 0.003),
        "small_gicp VGICP, 5 mm": align("VGICP", 0.005),
    }


def _open3d() -> dict[str, RegisterAlignment]:
    """Return Open3D's registrations with normals and a sharp end; none if it is not installed."""
    try:
        import open3d
    except ImportError:
        return {}
    registration = open3d.pipelines.registration
    sharp = registration.ICPConvergenceCriteria(1e-8, 1e-8, _ITERATIONS)
    around = open3d.geometry.KDTreeSearchParamKNN(16)

    def clouds(made: SimulatedAlignment) -> list[Any]:
        found = []
        for points_m in (made.hand_m, made.cursor_m):
            cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points_m))
            cloud.estimate_normals(around)
            found.append(cloud)
        return found

    def to_plane(made: SimulatedAlignment) -> Float64:
        kind = registration.TransformationEstimationPointToPlane()
        found = registration.registration_icp(*clouds(made), _REACH_M, _start(made), kind, sharp)
        return np.array(found.transformation)

    def gicp(made: SimulatedAlignment) -> Float64:
        kind = registration.TransformationEstimationForGeneralizedICP()
        found = registration.registration_generalized_icp(
            *clouds(made), _REACH_M, _start(made), kind, sharp
        )
        return np.array(found.transformation)

    return {"Open3D point to plane": to_plane, "Open3D GICP": gicp}


def _start(made: SimulatedAlignment) -> Float64:
    return rigid(translation_m=made.cursor_m.mean(axis=0) - made.hand_m.mean(axis=0))


# Registration of clouds with outliers or missing parts, beside robust libraries; opened hands.

Cloud: TypeAlias = tuple[Float64, Bool]
"""Points (N, 3) in the camera's frame, and which are beside a cut edge."""
Spoil: TypeAlias = Callable[[np.random.Generator, Cloud, Float64], Cloud]
"""Spoil a cloud, given the palm's centre and the arm's direction, (2, 3)."""
Register: TypeAlias = Callable[[Cloud, Cloud], Float64]
"""Return T_target_source of a source and a target."""

_ANGLE_RAD, _AWAY_M = float(np.radians(3.0)), 0.02
_FOREARM_M = 0.02, 0.06
_OUTLIERS, _FLYING, _FLYING_M, _BORDER = 0.05, 0.10, 0.06, 0.3
# Its means are far from coinciding, and no library finds it always.
_BORDER_LOST = "30 % lost at the border"
_RIM_POINTS = 1500
_BORDER_BAND_M = 0.003
_FINE_REACH_M, _COARSE_CUBE_M, _CUBE_M, _FINE_CUBE_M = 0.006, 0.006, 0.005, 0.003
_TUKEY_M = (0.05, 0.02), (0.03, 0.005)
_FAILED_MM, _FAILED_DEG = 5.0, 5.0
_MOST_RATIO = 1.5
_OPENINGS = 0.0, 0.01, 0.02, 0.03
_MOST_SQUARED = 6.0


def measure_spoiled_clouds(settings: BenchSettings, progress: Progress) -> Measured:
    """Register spoiled clouds by handcal and by others; all start from coinciding means."""
    rows: list[dict[str, Any]] = []
    figures: list[BenchFigure] = []
    registers = {"handcal": _handcal} | _peers()
    for number, (condition, spoils) in enumerate(_CONDITIONS.items()):
        errors: dict[str, list[tuple[float, float]]] = {name: [] for name in registers}
        for trial in range(settings.spoiled_pairs):
            source, target, T_true = _make(trial, settings.points, spoils)
            for name, register in registers.items():
                errors[name].append(_miss(register(source, target), T_true, source[0]))
        found = {name: _row(condition, name, each) for name, each in errors.items()}
        rows += found.values()
        own, best = found["handcal"], min(found[name]["median_mm"] for name in _peers())
        ratio = own["median_mm"] / best
        figures.append(
            BenchFigure(f"{condition}: error / best library", ratio, "", at_most=_MOST_RATIO)
        )
        most = None if condition == _BORDER_LOST else 0.0
        figures.append(BenchFigure(f"{condition}: failures", own["failed"], "", at_most=most))
        progress.at(0.8 * (number + 1) / len(_CONDITIONS))
    for opening in _OPENINGS:
        squares = [_opened(trial, opening, settings.points) for trial in range(settings.trials)]
        what = f"hand opened by {100 * opening:.0f} %: squared error / covariance"
        figures.append(BenchFigure(what, float(np.mean(squares)), "", at_most=_MOST_SQUARED))
    progress.at(1.0)
    return Measured(figures, rows)


def _make(
    trial: int, points: int, spoils: tuple[Spoil | None, Spoil | None]
) -> tuple[Cloud, Cloud, Float64]:
    """Return two clouds of one hand, sampled and cut apart, and T_target_source."""
    rng = np.random.default_rng([trial, 4])
    hand = trial_hand(trial)
    place_m = [rng.normal(0.0, 0.03), rng.normal(0.0, 0.03), rng.uniform(0.42, 0.58)]
    T_D_hand = rigid(rng.normal(0.0, 0.15, 3), place_m)
    frame = np.array([T_D_hand[:3, 3], T_D_hand[:3, :3] @ hand.arm_axis])
    clouds = []
    for spoil in spoils:
        forearm_m = rng.uniform(*_FOREARM_M)
        cloud = visible_points(
            hand, T_D_hand, points, rng, forearm_m=forearm_m, depth_sigma_m=_SIGMA_M
        )
        clouds.append(cloud if spoil is None else spoil(rng, cloud, frame))
    axis = rng.normal(size=3)
    about_m = clouds[1][0][rng.integers(points // 2)]
    turn = rigid(_ANGLE_RAD * axis / np.linalg.norm(axis))
    moved_m = about_m + rng.normal(0.0, _AWAY_M, 3)
    T = rigid(translation_m=moved_m) @ turn @ rigid(translation_m=-about_m)
    return clouds[0], (transform(T, clouds[1][0]), clouds[1][1]), T


def _with(cloud: Cloud, more_m: Float64) -> Cloud:
    return np.vstack([cloud[0], more_m]), np.append(cloud[1], np.zeros(len(more_m), np.bool_))


def _outliers(rng: np.random.Generator, cloud: Cloud, _: Float64) -> Cloud:
    """Add points anywhere in the hand's box."""
    low_m, high_m = cloud[0].min(axis=0), cloud[0].max(axis=0)
    return _with(cloud, rng.uniform(low_m, high_m, (int(_OUTLIERS * len(cloud[0])), 3)))


def _flying(rng: np.random.Generator, cloud: Cloud, _: Float64) -> Cloud:
    """Add flying pixels: points of the rim, moved away along their rays."""
    surface = describe_surface(*cloud, _RIM_POINTS)
    rim_m = surface.points_m[surface.outline]
    chosen = rim_m[rng.integers(len(rim_m), size=int(_FLYING * len(cloud[0])))]
    chosen += rng.normal(0.0, _SIGMA_M, chosen.shape)
    return _with(
        cloud, chosen * (1.0 + rng.uniform(0.0, _FLYING_M, (len(chosen), 1)) / chosen[:, 2:])
    )


def _without_fingers(_: np.random.Generator, cloud: Cloud, frame: Float64) -> Cloud:
    """Drop the third of the hand at the finger tips, without telling that it is cut."""
    along_m = (cloud[0] - frame[0]) @ frame[1]
    low_m = along_m.min()
    is_kept = along_m > low_m + 0.3 * (np.quantile(along_m, 0.9) - low_m)
    return cloud[0][is_kept], cloud[1][is_kept]


def _at_border(_: np.random.Generator, cloud: Cloud, __: Float64) -> Cloud:
    """Drop one side of the hand, as at the border of the image, which is known."""
    limit_m = np.quantile(cloud[0][:, 0], _BORDER)
    is_kept = cloud[0][:, 0] > limit_m
    points_m = cloud[0][is_kept]
    return points_m, cloud[1][is_kept] | (points_m[:, 0] < limit_m + _BORDER_BAND_M)


_CONDITIONS: Mapping[str, tuple[Spoil | None, Spoil | None]] = {
    "clean": (None, None),
    "5 % outliers": (_outliers, _outliers),
    "5 % outliers in one cloud": (_outliers, None),
    "10 % flying pixels": (_flying, _flying),
    "fingers missing in one cloud": (_without_fingers, None),
    _BORDER_LOST: (_at_border, None),
}


def _handcal(source: Cloud, target: Cloud) -> Float64:
    return match_hands(target[0], source[0], target[1], source[1]).rigid.T_target_source


def _peers() -> dict[str, Register]:
    """Return the libraries at settings for outliers; without Open3D if it is not installed."""

    def gicp(source: Cloud, target: Cloud, T: Float64, reach_m: float, cube_m: float) -> Float64:
        found = small_gicp.align(
            target[0],
            source[0],
            T,
            registration_type="GICP",
            downsampling_resolution=cube_m,
            max_correspondence_distance=reach_m,
            num_threads=1,
            max_iterations=100,
        )
        return np.asarray(found.T_target_source)

    def once(source: Cloud, target: Cloud) -> Float64:
        return gicp(source, target, _means_together(source, target), _REACH_M, _CUBE_M)

    def twice(source: Cloud, target: Cloud) -> Float64:
        T = gicp(source, target, _means_together(source, target), _REACH_M, _COARSE_CUBE_M)
        return gicp(source, target, T, _FINE_REACH_M, _FINE_CUBE_M)

    peers: dict[str, Register] = {"small_gicp, 5 mm": once, "small_gicp, 6 then 3 mm": twice}
    try:
        import open3d
    except ImportError:
        return peers
    registration = open3d.pipelines.registration

    def tukey(source: Cloud, target: Cloud) -> Float64:
        clouds = []
        for points_m, _ in (source, target):
            cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points_m))
            cloud.estimate_normals(open3d.geometry.KDTreeSearchParamKNN(16))
            clouds.append(cloud)
        T = _means_together(source, target)
        sharp = registration.ICPConvergenceCriteria(1e-8, 1e-8, 100)
        for reach_m, width_m in _TUKEY_M:
            kind = registration.TransformationEstimationPointToPlane(
                registration.TukeyLoss(k=width_m)
            )
            T = registration.registration_icp(*clouds, reach_m, T, kind, sharp).transformation
        return np.array(T)

    return peers | {"Open3D point to plane, Tukey": tukey}


def _means_together(source: Cloud, target: Cloud) -> Float64:
    return rigid(translation_m=target[0].mean(axis=0) - source[0].mean(axis=0))


def _miss(T: Float64, T_true: Float64, source_m: Float64) -> tuple[float, float]:
    """Return the errors of the centroid, mm, and of the rotation, degrees."""
    middle_m = source_m.mean(axis=0)[None]
    away_m = transform(T, middle_m) - transform(T_true, middle_m)
    turned = Rotation.from_matrix(T[:3, :3] @ T_true[:3, :3].T)
    return 1e3 * float(np.linalg.norm(away_m)), float(np.degrees(turned.magnitude()))


def _row(condition: str, name: str, errors: list[tuple[float, float]]) -> dict[str, Any]:
    mm, deg = np.array(errors).T
    return {
        "condition": condition,
        "method": name,
        "median_mm": float(np.median(mm)),
        "percentile_95_mm": float(np.percentile(mm, 95)),
        "median_deg": float(np.median(deg)),
        "failed": int(np.sum((mm > _FAILED_MM) | (deg > _FAILED_DEG))),
    }


def _opened(trial: int, opening: float, points: int) -> float:
    """Return the normalised squared error of φ for a hand that opens, over the same pixels."""
    rng = np.random.default_rng([trial, 5])
    made = measured_alignment(rng, trial, rng.uniform(0.0, 3.0), _SIGMA_M, points)
    seen_m = transform(made.T_E_W, made.hand_m) - made.shift_m
    hand_m = transform(invert(made.T_E_W), made.shift_m + (1.0 + opening) * seen_m)
    solved = solve_trial(replace(made, hand_m=hand_m), "consistent")
    error_m = solved.shift_m - made.shift_m
    return float(error_m @ np.linalg.solve(solved.covariance_m2, error_m))

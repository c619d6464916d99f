"""Registration beside other libraries at their best settings: time and error together.

Times are processor time, which other programs on the machine affect least.
"""

from __future__ import annotations

from collections.abc import Callable
from time import process_time
from typing import Any, TypeAlias

import numpy as np
import small_gicp
from scipy.spatial.transform import Rotation

from handcal.core.geometry import invert, rigid, transform
from handcal.core.progress import Progress
from handcal.core.types import Float64
from handcal.lab.bench.figure import BenchFigure
from handcal.lab.bench.settings import BenchSettings
from handcal.lab.bench.trials import Measured, measured_alignment
from handcal.register.consistent import match_hands
from handcal.register.guard import RotationGuard
from handcal.register.rcicp import best_rigid
from handcal.register.solve import solve_eye_shift
from handcal.sim.alignments import SimulatedAlignment

Register: TypeAlias = Callable[[SimulatedAlignment], Float64 | None]
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


def _own(made: SimulatedAlignment) -> dict[str, Register]:
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


def _small_gicp() -> dict[str, Register]:
    def align(kind: str, cube_m: float) -> Register:
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


def _open3d() -> dict[str, Register]:
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

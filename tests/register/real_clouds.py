"""Errors and σ on clouds of real frames: ``python -m tests.register.real_clouds FOLDER [SEED]``.

FOLDER holds the sets of frames. Each frame is solved twice with other pixels, and pairs of
different frames of one hand, moved as its joints say; φ is known, and no wearer errs.
docs/registration.md has the figures.
"""

import json
import sys
from collections.abc import Iterator
from itertools import combinations
from pathlib import Path

import cv2
import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from handcal import solve_eye_shift
from handcal.core.geometry import rigid, transform
from handcal.core.types import Bool, EyeShift, Float64, Frame, Intrinsics
from handcal.hand.segment import segment_hand
from handcal.hand.settings import SegmentSettings
from handcal.register.guard import GuardSettings, rotation_between

DISTANCE_M = 2.0
ALL = SegmentSettings(points=40_000)
_SHIFT_MAX_M = 0.008
_MOST = 5000
_SAMPLES = 2
_CHANGES_M = (0.0, 0.0026), (0.0026, 0.005), (0.005, 0.012)
"""Bins of the joints' change of shape, rms."""

Cloud = tuple[Float64, Bool]
"""Points (N, 3) in the camera's frame, and which are beside a cut edge."""


def read_clouds(folder: Path, every: int = 1) -> Iterator[tuple[str, Cloud]]:
    """Segment every so-many-th frame of a folder by depth alone."""
    for name, about in list(json.loads((folder / "meta.json").read_text()).items())[::every]:
        depth = cv2.imread(str(folder / f"{name}_depth.png"), cv2.IMREAD_UNCHANGED)
        assert depth is not None
        camera = Intrinsics(depth.shape[1], depth.shape[0], *about["intrinsics"])
        frame = Frame(0, 0, 0, depth.astype(np.uint16), about["depth_unit_m"], camera)
        hand = segment_hand(frame, ALL)
        yield name, (hand.points_m.astype(np.float64), hand.is_cut)


def halves(rng: np.random.Generator, cloud: Cloud) -> tuple[Cloud, Cloud]:
    """Return two disjoint samples of a cloud, of at most 5,000 points each."""
    points_m, is_cut = cloud
    order = rng.permutation(len(points_m))
    half = min(_MOST, len(order) // 2)
    first, second = order[:half], order[half : 2 * half]
    return (points_m[first], is_cut[first]), (points_m[second], is_cut[second])


def solve_overlaid(phi_m: Float64, whole_m: Float64, cursor: Cloud, hand: Cloud) -> EyeShift:
    """Solve an alignment by an eye at φ that overlays a hand with its cursor, drawn for φ = 0.

    Parameters
    ----------
    phi_m : (3,) float64
    whole_m : (N, 3) float64
        The points that the eye overlays.
    cursor, hand : Cloud
        The hand as registered with its cursor.
    """
    return solve_eye_shift(
        cursor[0],
        hand[0] + _overlay(whole_m[::7], phi_m),
        display_distance_m=DISTANCE_M,
        cursor_cut=cursor[1],
        hand_cut=hand[1],
    )


def squared_error(solved: EyeShift, phi_m: Float64) -> float:
    """Return the squared error normalised by the covariance, 3 on average if that is right."""
    error_m = solved.shift_m - phi_m
    return float(error_m @ np.linalg.solve(solved.covariance_m2, error_m))


def _pixels(phi_m: Float64, points_m: Float64) -> Float64:
    """Return where an eye at φ sees points on the focal plane, m."""
    ratio = (DISTANCE_M - phi_m[2]) / (points_m[:, 2:] - phi_m[2])
    seen: Float64 = phi_m[:2] + (points_m[:, :2] - phi_m[:2]) * ratio
    return seen


def _overlay(cursor_m: Float64, phi_m: Float64) -> Float64:
    """Return the movement that puts a hand under its own cursor, drawn for φ = 0."""
    wanted = _pixels(np.zeros(3), cursor_m)

    def apart(moved_m: Float64) -> Float64:
        return 1e3 * (_pixels(phi_m, cursor_m + moved_m) - wanted).ravel()

    return np.asarray(least_squares(apart, np.zeros(3)).x)


def _report(title: str, shifts_m: list[Float64], found: list[EyeShift]) -> None:
    errors_mm = [
        1e3 * np.linalg.norm(one.shift_m - shift_m)
        for one, shift_m in zip(found, shifts_m, strict=True)
    ]
    squares = list(map(squared_error, found, shifts_m))
    sigmas_mm = [1e3 * np.sqrt(np.trace(one.covariance_m2)) for one in found]
    ratio = np.median(sigmas_mm) / np.sqrt(np.mean(np.square(errors_mm)))
    sys.stdout.write(
        f"{title:44} n {len(found):3}  mean {np.mean(errors_mm):6.3f} mm"
        f"  NEES {np.mean(squares):5.2f}  median σ / rms error {ratio:.2f}\n"
    )


def _same_frame(folder: Path, seed: int) -> None:
    shifts_m, found = [], []
    for number, (_, cloud) in enumerate(read_clouds(folder)):
        for sample in range(_SAMPLES):
            rng = np.random.default_rng([seed, number, sample])
            shifts_m.append(rng.uniform(-_SHIFT_MAX_M, _SHIFT_MAX_M, 3))
            found.append(solve_overlaid(shifts_m[-1], cloud[0], *halves(rng, cloud)))
    _report(f"disjoint samples, {folder.name}", shifts_m, found)


def _frame_pairs(folder: Path, seed: int) -> None:
    """Report each bin of the joints' change, without the hands that the guard refuses."""
    about = json.loads((folder / "meta.json").read_text())
    frames = list(read_clouds(folder))
    made: list[tuple[float, Float64, EyeShift]] = []
    for number, ((first, cursor), (second, hand)) in enumerate(combinations(frames, 2)):
        rng = np.random.default_rng([seed, number])
        phi_m = rng.uniform(-_SHIFT_MAX_M, _SHIFT_MAX_M, 3)
        to, of = (np.array(about[name]["joints3d_mm"]) / 1000.0 for name in (first, second))
        R, _ = Rotation.align_vectors(to - to.mean(0), of - of.mean(0))
        T = rigid(R.as_rotvec(), to.mean(0) - R.apply(of.mean(0)))
        change_m = float(np.sqrt(np.mean(np.sum((transform(T, of) - to) ** 2, axis=1))))
        chosen = [rng.permutation(len(points_m))[:_MOST] for points_m, _ in (cursor, hand)]
        cursor_part = cursor[0][chosen[0]], cursor[1][chosen[0]]
        hand_part = transform(T, hand[0][chosen[1]]), hand[1][chosen[1]]
        turned_rad = np.linalg.norm(rotation_between(cursor_part[0], hand_part[0]))
        if turned_rad <= GuardSettings().limit_rad:
            made.append((change_m, phi_m, solve_overlaid(phi_m, cursor[0], cursor_part, hand_part)))
    for low_m, high_m in _CHANGES_M:
        within = [(phi_m, one) for change_m, phi_m, one in made if low_m <= change_m < high_m]
        if within:
            title = f"{folder.name}, changed {1e3 * low_m:.1f} to {1e3 * high_m:.1f} mm"
            _report(title, *map(list, zip(*within, strict=True)))


if __name__ == "__main__":
    sets, chosen_seed = Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 0
    for name in ("color_aligned_640", "color_aligned_640_b", "sr300_320"):
        _same_frame(sets / name, chosen_seed)
    for name in ("color_aligned_640", "color_aligned_640_b"):
        _frame_pairs(sets / name, chosen_seed)

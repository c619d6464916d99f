"""SPAAM and INDICA on recorded calibrations of real wearers.

The data set of Itoh & Klinker 2014 (github.com/YutaItoh/HMD-Calibration, MIT): a base recording and
ten more of one display, each with 2D–3D alignments, eye positions from a tracker, and the
projection that the authors' SPAAM gave. Frames are the authors': the world camera's, z backward.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.io import loadmat
from scipy.io.matlab import MatReadError
from scipy.spatial.transform import Rotation

from handcal.core.display import arcmin_from_px
from handcal.core.errors import FileError
from handcal.core.geometry import project
from handcal.core.types import EyeDisplay, Float64
from handcal.lab.methods import (
    solve_eye_from_points,
    solve_indica_full,
    solve_indica_recycled,
    solve_spaam,
    split_projection,
)

BASE = "Base"
_LARGEST_BYTES = 1_000_000
_FLIP = np.diag([1.0, 1.0, -1.0])
_CLUSTER_ROUNDS = 100
_UNKNOWNS = 11


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """One recorded calibration."""

    points_m: Float64
    """(N, 3); the marker, in the world camera's frame."""
    pixels: Float64
    """(N, 2); crosshairs it was aligned with."""
    eye_m: Float64
    """(3,); the tracked eye, in the same frame."""
    P_authors: Float64
    """(3, 4); their SPAAM."""


@dataclass(frozen=True, slots=True, eq=False)
class RecordedSet:
    """All recordings, and the display that they share."""

    recordings: Mapping[str, Recording]
    """By name, the base first."""
    T_S_W: Float64
    """(3, 4); to the display's frame, z away from the eye."""
    focal_px_m: float
    """Pixels per metre on it."""
    centre_px: Float64
    """(2,)."""


@dataclass(frozen=True, slots=True)
class RecordedResult:
    """The result of one recording; errors are means over its alignments."""

    alignments: int
    spaam_px: float
    authors_spaam_px: float
    """Error of SPAAM on its own alignments, by our code and by the authors'."""
    difference_px: float
    """Largest difference, in x or y, between the markers drawn with both."""
    base_px: float
    """Error of the base recording's SPAAM, unchanged."""
    recycled_px: float
    full_px: float
    """Errors of INDICA's two setups."""
    pointing_sigma_px: float
    pointing_sigma_arcmin: float
    """Residual of SPAAM about each axis, with its 11 unknowns taken into account."""
    eye_miss_mm: tuple[float, float, float]
    """Offset of the tracked eye from the eye that fits the alignments best through the base's
    display: right, down along the pixel rows, away from the eye. The last is hardly determined."""


def read_recordings(folder: Path) -> RecordedSet:
    """Read the data set.

    Parameters
    ----------
    folder : Path
        With ``Base``, ``1`` …, the tracker's pose and the display's parameters.

    Raises
    ------
    FileError
        If a file is missing, larger than 1 MB, or holds something else.
    """
    tracker = _archived(folder / "PoseFromEyeCam2WorldCam.txt", 7)
    R_T_W, t_T_W_m = Rotation.from_quat(tracker[:4]).as_matrix(), tracker[4:]
    numbered = (path.name for path in folder.iterdir() if path.name.isdigit())
    recordings = {}
    for name in (BASE, *sorted(numbered, key=int)):
        path = folder / name
        eye_T_m = _choose_eye(_table(path / "eye_positions.txt", 3))
        recordings[name] = Recording(
            points_m=_table(path / "MarkerSPAAM_DataSPAAM3D.txt", 3),
            pixels=_table(path / "MarkerSPAAM_DataSPAAM2D.txt", 2),
            eye_m=R_T_W.T @ (eye_T_m - t_T_W_m),
            P_authors=_archived(path / "SPAAM_calibration.calib", 12).reshape(3, 4),
        )
    try:
        display = loadmat(_checked(folder / "display_param_nonlinear.mat"))
        # Stored with y and z inverted.
        T_S_W = np.column_stack([display["R_WS"], display["t_WS"]]) * [[1.0], [-1.0], [1.0]]
        size_px = np.array([display["w"].item(), display["h"].item()], dtype=np.float64)
        return RecordedSet(recordings, T_S_W, display["alpha"].item(), 0.5 * size_px - 0.5)
    except (KeyError, ValueError, TypeError, NotImplementedError, MatReadError) as error:
        raise FileError(f"{folder}: its display parameters cannot be read ({error})") from error


def evaluate_recordings(data: RecordedSet) -> dict[str, RecordedResult]:
    """Run SPAAM and both setups of INDICA on every recording.

    Raises
    ------
    FileError
        If a recording's alignments do not determine a projection.
    """
    P_base = _solve(BASE, data.recordings[BASE])
    K, R, viewpoint_m = split_projection(P_base)
    # Distance from the eye to the display, along the base's axes as the authors take it.
    distance_m = -float((R @ viewpoint_m)[2] + data.T_S_W[2, 3])
    display = EyeDisplay(
        K=K,
        H0=np.eye(3),
        t_C0_V_m=np.zeros(3),
        z_C0_S_m=distance_m,
        width_px=int(2.0 * data.centre_px[0] + 1.0),
        height_px=int(2.0 * data.centre_px[1] + 1.0),
        T_V_H=np.eye(4),
    )
    return {
        name: _evaluate(recording, _solve(name, recording), P_base, display, data)
        for name, recording in data.recordings.items()
    }


def _solve(name: str, recording: Recording) -> Float64:
    try:
        return solve_spaam(recording.points_m, recording.pixels)
    except ValueError as error:
        raise FileError(f"recording {name}: {error}") from error


def _evaluate(
    recording: Recording, P: Float64, P_base: Float64, display: EyeDisplay, data: RecordedSet
) -> RecordedResult:
    points_m, distance_m = recording.points_m, display.z_C0_S_m
    recycled = solve_indica_recycled(P_base, distance_m, recording.eye_m)
    full = solve_indica_full(data.focal_px_m, data.centre_px, data.T_S_W, recording.eye_m)
    spaam_px = _errors_px(P, recording)
    sigma_px = float(np.sqrt((spaam_px**2).sum() / (2 * len(spaam_px) - _UNKNOWNS)))
    theirs = _forward(recording.P_authors, points_m)
    _, R, viewpoint_m = split_projection(P_base)
    best_m = solve_eye_from_points((points_m - viewpoint_m) @ R.T, recording.pixels, display)
    right_mm, down_mm, away_mm = 1e3 * (R @ (recording.eye_m - viewpoint_m) - best_m)
    return RecordedResult(
        alignments=len(spaam_px),
        spaam_px=float(spaam_px.mean()),
        authors_spaam_px=float(_errors_px(theirs, recording).mean()),
        difference_px=float(np.abs(project(P, points_m) - project(theirs, points_m)).max()),
        base_px=float(_errors_px(P_base, recording).mean()),
        recycled_px=float(_errors_px(recycled, recording).mean()),
        full_px=float(_errors_px(full, recording).mean()),
        pointing_sigma_px=sigma_px,
        pointing_sigma_arcmin=float(arcmin_from_px(display, sigma_px)),
        eye_miss_mm=(float(right_mm), float(down_mm), float(away_mm)),
    )


def _errors_px(P: Float64, recording: Recording) -> Float64:
    return np.asarray(np.linalg.norm(project(P, recording.points_m) - recording.pixels, axis=1))


def _forward(P: Float64, points_m: Float64) -> Float64:
    """Return a projection with the sign that gives the aligned points a positive weight."""
    weights = points_m @ P[2, :3] + P[2, 3]
    return P if np.median(weights) > 0.0 else -P


def _choose_eye(candidates_m: Float64) -> Float64:
    """Return the eye among the tracker's candidates, which come in pairs of which one is wrong.

    As in the authors' code: the median of the tighter of two clusters, by medians and city-block
    distances. Theirs start at random, these from the two halves along the longest axis. z points to
    the eye.
    """
    offsets = candidates_m - np.median(candidates_m, axis=0)
    axis = np.linalg.svd(offsets - offsets.mean(axis=0))[2][0]
    second = offsets @ axis > 0.0
    for _ in range(_CLUSTER_ROUNDS):
        if not 1 < second.sum() < len(second) - 1:
            raise FileError("the tracked eye positions do not form two clusters")
        middles = [np.median(candidates_m[which], axis=0) for which in (~second, second)]
        far, near = (np.abs(candidates_m - middle).sum(axis=1) for middle in middles)
        if np.array_equal(far > near, second):
            break
        second = far > near
    spreads = [candidates_m[which].var(axis=0, ddof=1).mean() for which in (~second, second)]
    eye_m = middles[int(spreads[1] < spreads[0])]
    return np.array([eye_m[0], eye_m[1], -abs(eye_m[2])])


def _table(path: Path, columns: int) -> Float64:
    try:
        table = np.loadtxt(_checked(path), dtype=np.float64, ndmin=2)
    except ValueError as error:
        raise FileError(f"{path} is not a table of numbers: {error}") from error
    if table.shape[1:] != (columns,) or not np.isfinite(table).all():
        raise FileError(f"{path} must hold {columns} finite numbers in each line")
    return table


def _archived(path: Path, count: int) -> Float64:
    """Return the last numbers of a file by Ubitrack, a Boost text archive.

    A pose is a quaternion x, y, z, w and a position, with two counters between.
    """
    words = _checked(path).read_text(errors="replace").split()
    try:
        if count == 7:
            words = [*words[-9:-5], *words[-3:]]
        numbers = np.array([float(word) for word in words[-count:]])
    except ValueError as error:
        raise FileError(f"{path} is not a Ubitrack calibration: {error}") from error
    if len(numbers) != count or not np.isfinite(numbers).all():
        raise FileError(f"{path} must end with {count} finite numbers")
    return numbers


def _checked(path: Path) -> Path:
    if not path.is_file():
        raise FileError(f"{path} is missing: the data set is incomplete")
    if path.stat().st_size > _LARGEST_BYTES:
        raise FileError(f"{path} is larger than {_LARGEST_BYTES:,} bytes: not of the data set")
    return path

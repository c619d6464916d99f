"""Projection uncertainty of a camera over its image, and the view that would reduce it most.

As mrcal does, the uncertainty is not that of single parameters, which compensate each other, but of
the pixel at which a distant point appears. What a small rotation of the camera explains is left
out, since the pose of a camera is always solved with its intrinsics.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from handcal.core.frozen import freeze
from handcal.core.geometry import rigid
from handcal.core.types import Float64
from handcal.rig.lens.bundle import Setup, foreseen
from handcal.rig.lens.lens import Camera, LensModel, pixels_of, predict, to_plane

GRID = (12, 9)
"""Columns and rows of places in the image at which the uncertainty is known."""
_EDGE_PERCENTILE = 90.0
# Views tried: where the board's middle is, as a share of the image; its tilt; its size.
_PLACES = {
    f"at the {name}": place
    for name, place in {
        "upper left": (0.25, 0.25), "top": (0.5, 0.25), "upper right": (0.75, 0.25),
        "left": (0.25, 0.5), "middle": (0.5, 0.5), "right": (0.75, 0.5),
        "lower left": (0.25, 0.75), "bottom": (0.5, 0.75), "lower right": (0.75, 0.75),
    }.items()
}  # fmt: skip
_TILTS = {
    "facing the camera": (0.0, 0.0),
    "its upper edge tilted away": (-1.0, 0.0), "its lower edge tilted away": (1.0, 0.0),
    "its left edge tilted away": (0.0, -1.0), "its right edge tilted away": (0.0, 1.0),
}  # fmt: skip
_TILT_RAD = 0.7
_WIDTH_SHARES = (0.4, 0.7)
_LEAST_SEEN_SHARE = 0.6


@dataclass(frozen=True, slots=True, eq=False)
class ProjectionUncertainty:
    """Standard deviation of the pixel at which a camera sees a distant point."""

    sigma_px: Float64
    """(9, 12); in the worst direction, on a grid over the image; NaN where the lens model shows no
    direction."""
    middle_px: float
    edge_px: float
    """It is exceeded in half and in 10 % of the image."""

    def __post_init__(self) -> None:
        freeze(self, "sigma_px", np.float64, GRID[1], GRID[0])


@dataclass(frozen=True, slots=True, eq=False)
class NextView:
    """A view of the board that would reduce the uncertainty."""

    words: str
    """Place, tilt and size of the board in the image."""
    pose: Float64
    """(6,); of the board in the camera's frame: rotation vector, m."""
    uncertainty: float
    """Share of the uncertainty that remains with this view."""


def projection_uncertainty(
    camera: Camera, solved: list[int], covariance: Float64
) -> ProjectionUncertainty:
    """Return the projection uncertainty over the image.

    Parameters
    ----------
    camera : Camera
    solved : list of int
        Which of the camera's parameters were solved for; the others are taken as exact.
    covariance : (P, P) float64
        Of these.
    """
    return _uncertainty(_derivatives(camera, solved), covariance)


def next_view(
    camera: Camera,
    solved: list[int],
    covariance: Float64,
    points_m: Float64,
    noise_px: float,
    hits: NDArray[np.int64] | None = None,
) -> NextView | None:
    """Return the view, of a catalogue, after which the uncertainty at the image's edge is least.

    Parameters
    ----------
    camera : Camera
    solved : list of int
    covariance : (P, P) float64
        As for `projection_uncertainty`.
    points_m : (N, 3) float64
        The board's corners, in its frame.
    noise_px : float
        Standard deviation of a detected corner along each axis.
    hits : (R, C) int, optional
        Number of views in each cell of the image; views that reach the most empty cells come first.

    Returns
    -------
    NextView or None
        None if no view of the catalogue shows the board.
    """
    by = _derivatives(camera, solved)
    information = np.asarray(np.linalg.inv(covariance), np.float64)
    best: NextView | None = None
    most = -1
    for words, pose in zip(*candidate_views(camera, points_m), strict=True):
        pixels, derivatives = predict(points_m, pose, camera)
        is_seen = _inside(pixels, camera)
        new = 0 if hits is None else _new_cells(pixels[is_seen], camera, hits)
        seen = np.repeat(is_seen, 2)
        basis, _ = np.linalg.qr(derivatives[seen, :6])
        shared = derivatives[seen][:, [6 + number for number in solved]] / noise_px
        shared = shared - basis @ (basis.T @ shared)
        new_covariance = np.asarray(np.linalg.inv(information + shared.T @ shared), np.float64)
        after = _uncertainty(by, new_covariance).edge_px
        if best is None or (-new, after) < (-most, best.uncertainty):
            best, most = NextView(words, pose, after), new
    return best


def next_pair(
    setup: Setup,
    lenses: Sequence[LensModel | None],
    covariance: Float64,
    points_m: Float64,
    noise_px: float,
    limits: tuple[float, float],
) -> NextView | None:
    """Return the view by the first camera after which the pose between two is known best.

    Parameters
    ----------
    setup : Setup
        Both cameras and the pose between them.
    lenses : sequence of LensModel or None
        Of each camera, the model solved for; None if it is given.
    covariance : (P, P) float64
        Of the pose between the cameras and what is solved of them.
    points_m, noise_px
        As for `next_view`.
    limits : (float, float)
        Rotation, rad, and translation, m, that count the same.
    """
    words, poses = candidate_views(setup.cameras[0], points_m)
    if not words:
        return None
    new, seen_share = foreseen(points_m, replace(setup, poses=tuple(poses)), lenses)
    shown = np.flatnonzero((seen_share >= _LEAST_SEEN_SHARE).all(axis=1))
    if not len(shown):
        return None
    after = np.linalg.inv(np.linalg.inv(covariance) + new[shown] / noise_px**2)[:, :6, :6]
    after /= np.outer(*2 * [np.repeat(limits, 3)])
    worst = np.max(
        [np.linalg.eigvalsh(part)[:, -1] for part in (after[:, :3, :3], after[:, 3:, 3:])], axis=0
    )
    least = int(worst.argmin())
    return NextView(words[shown[least]], poses[shown[least]], float(worst[least]))


def _new_cells(pixels: Float64, camera: Camera, hits: NDArray[np.int64]) -> int:
    """Return the number of empty cells that pixels (N, 2) reach."""
    rows, columns = hits.shape
    x, y = (pixels / [camera.width, camera.height] * [columns, rows]).astype(int).T
    reached = np.zeros(hits.shape, np.bool_)
    reached[y, x] = True
    return int((reached & (hits == 0)).sum())


def candidate_views(camera: Camera, points_m: Float64) -> tuple[list[str], Float64]:
    """Return views that show most of a board, as words and as its poses (N, 6)."""
    middle_m = (points_m.min(axis=0) + points_m.max(axis=0)) / 2
    width_m = float(np.ptp(points_m[:, 0]))
    size = np.array([camera.width, camera.height])
    tilts = [rigid(_TILT_RAD * np.array([*axis, 0.0]))[:3, :3] for axis in _TILTS.values()]
    planes = to_plane(np.array(list(_PLACES.values())) * size, camera)
    rays = np.column_stack([planes, np.ones(len(planes))])
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    turns = np.stack([_facing(ray) @ tilt for ray in rays for tilt in tilts])
    rotations = np.stack([cv2.Rodrigues(turn)[0].ravel() for turn in turns])
    how = [f"{where}, {tilted}" for where in _PLACES for tilted in _TILTS]
    words, poses = [], []
    for share in _WIDTH_SHARES:
        distance_m = camera.fx * width_m / (share * camera.width)
        shift_m = distance_m * np.repeat(rays, len(tilts), axis=0) - turns @ middle_m
        in_camera_m = points_m @ turns.swapaxes(1, 2) + shift_m[:, None]
        pixels = pixels_of(in_camera_m.reshape(-1, 3), np.zeros(6), camera)
        is_seen = _inside(pixels.reshape(*in_camera_m.shape[:2], 2), camera)
        is_shown = in_camera_m[:, :, 2].min(axis=1) > 0.1 * distance_m
        is_shown &= is_seen.mean(axis=1) > _LEAST_SEEN_SHARE
        ending = f", {100 * share:.0f} % of the image wide"
        words += [how[number] + ending for number in np.flatnonzero(is_shown)]
        poses.append(np.hstack([rotations, shift_m])[is_shown])
    return words, np.concatenate(poses)


def _facing(ray: Float64) -> Float64:
    """Return the rotation (3, 3) of a board that faces the camera along a ray."""
    axis = np.cross([0.0, 0.0, 1.0], ray)
    angle = np.arctan2(np.linalg.norm(axis), ray[2])
    return rigid(angle * axis / max(float(np.linalg.norm(axis)), 1e-12))[:3, :3]


def _inside(pixels: Float64, camera: Camera) -> NDArray[np.bool_]:
    size = [camera.width - 1, camera.height - 1]
    return np.asarray(((pixels > 0) & (pixels < size)).all(axis=-1))


def _derivatives(camera: Camera, solved: list[int]) -> Float64:
    """Return derivatives (N, 2, P) of pixels on the grid; NaN where the lens shows no direction."""
    columns, rows = GRID
    x = (np.arange(columns) + 0.5) * camera.width / columns - 0.5
    y = (np.arange(rows) + 0.5) * camera.height / rows - 0.5
    pixels = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    plane = to_plane(pixels, camera)
    rays = np.column_stack([plane, np.ones(len(plane))])
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    back, by = predict(rays, np.zeros(6), camera)
    is_seen = np.linalg.norm(back - pixels, axis=1) < 0.5
    rows_seen = np.repeat(is_seen, 2)
    basis, _ = np.linalg.qr(by[rows_seen, :3])
    shared = by[rows_seen][:, [6 + number for number in solved]]
    result = np.full((len(pixels), 2, len(solved)), np.nan)
    result[is_seen] = (shared - basis @ (basis.T @ shared)).reshape(-1, 2, len(solved))
    return result


def _uncertainty(by: Float64, covariance: Float64) -> ProjectionUncertainty:
    spread = by @ covariance @ by.swapaxes(1, 2)
    half, off = np.trace(spread, axis1=1, axis2=2) / 2, spread[:, 0, 1]
    worst = half + np.hypot((spread[:, 0, 0] - spread[:, 1, 1]) / 2, off)
    sigma_px = np.sqrt(worst)
    return ProjectionUncertainty(
        sigma_px.reshape(GRID[::-1]),
        float(np.nanmedian(sigma_px)),
        float(np.nanpercentile(sigma_px, _EDGE_PERCENTILE)),
    )

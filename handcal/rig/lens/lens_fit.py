"""Fits of lens models to views of a board, and their comparison by held-out error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from handcal.core.types import Float64
from handcal.rig.boards.board import BoardView
from handcal.rig.lens.bundle import Adjusted, adjust, kept_by_all
from handcal.rig.lens.lens import (
    Camera,
    LensModel,
    as_lens,
    first_pose,
    pixels_of,
    solved_parameters,
    undistorted_camera,
)
from handcal.rig.lens.reprojection import Setup, Sighting, as_vector
from handcal.rig.lens.shape import FLAT, BoardShape, solve_shape
from handcal.rig.lens.uncertainty import ProjectionUncertainty, projection_uncertainty

# Focal lengths tried, in widths of the image, and the views that judge them.
_FOCAL_WIDTHS = np.geomspace(0.25, 4.0, 9)
_START_VIEWS = 8
# In the least held-out error, and in the least uncertainty at the image's edge.
_NEAR, _UNCERTAIN = 1.05, 2.0
# Prism and tilted are not among them: their coefficients shift the image's middle and so turn the
# camera, by half a degree on real wide-angle images, for a residual smaller by 7 %.
_COMPARED: tuple[LensModel, ...] = ("none", "radial", "full", "rational", "fisheye")


@dataclass(frozen=True, slots=True, eq=False)
class LensFit:
    """A lens model fitted to views."""

    lens: LensModel
    fit: Adjusted
    held_out_px2: Float64
    """(V,); mean square residual of each view with intrinsics from the others, to first order; over
    the corners that all models compared have kept. (0,) if there is no other model."""
    covariance: Float64 | None
    """`Adjusted.covariance`."""
    uncertainty: ProjectionUncertainty | None
    """None if the views do not determine the camera."""
    board: BoardShape = FLAT
    """As solved with the camera."""

    @property
    def camera(self) -> Camera:
        """The camera solved for."""
        return self.fit.setup.cameras[0]

    @property
    def edge_px(self) -> float:
        """`ProjectionUncertainty.edge_px`; infinite if the views do not determine the camera."""
        return np.inf if self.uncertainty is None else self.uncertainty.edge_px

    @property
    def held_out_px(self) -> float:
        """Square root of the mean of `held_out_px2`."""
        return float(np.sqrt(np.mean(self.held_out_px2)))


def fit_camera(
    views: Sequence[BoardView], lens: LensModel, start: Camera | None = None
) -> Adjusted | None:
    """Solve a camera and the board's poses from views of one size; None if nothing can be solved.

    Parameters
    ----------
    views : sequence of BoardView
    lens : LensModel
    start : Camera, optional
        A solution with a simpler model of the same kind. If not given, focal lengths are tried.
    """
    camera = as_lens(start, lens) if start else _first_camera(views, lens)
    poses = [None if camera is None else first_pose(seen, camera) for seen in views]
    if camera is None or any(pose is None for pose in poses):
        return None
    sightings = _sightings(views)
    vectors = tuple(as_vector(pose) for pose in poses if pose is not None)
    fit = adjust(sightings, Setup((camera,), vectors), [lens])
    # A plane has two poses of nearly the same image; with the first camera, PnP may take the other.
    poses = [first_pose(seen, fit.setup.cameras[0]) for seen in views]
    vectors = tuple(
        old
        if pose is None or _rms_px(seen, as_vector(pose), fit) > _rms_px(seen, old, fit)
        else as_vector(pose)
        for seen, pose, old in zip(views, poses, fit.setup.poses, strict=True)
    )
    if any(new is not old for new, old in zip(vectors, fit.setup.poses, strict=True)):
        fit = adjust(sightings, Setup(fit.setup.cameras, vectors), [lens])
    return fit if np.isfinite(fit.rms_px) else None


def fit_lens(views: Sequence[BoardView], lens: LensModel) -> LensFit | None:
    """Fit one lens model; None if nothing can be solved."""
    fit = fit_camera(views, lens)
    return None if fit is None else _judged(lens, fit, np.empty(0))


def shaped(solved: LensFit, views: Sequence[BoardView]) -> LensFit:
    """Return the fit with the board's shape solved for, or with what is not known of it."""
    fit, board = solve_shape(_sightings(views), solved.fit, [solved.lens])
    return replace(_judged(solved.lens, fit, solved.held_out_px2), board=board)


def compare_shaped(fits: Sequence[LensFit], views: Sequence[BoardView]) -> tuple[LensFit, ...]:
    """Return the fits with the board's shape solved for with each lens model."""
    results = [shaped(one, views) for one in fits]
    # A flat board's derivatives by its shape are of no held-out error.
    solved = [
        now.fit if now.board.words else one.fit for one, now in zip(fits, results, strict=True)
    ]
    kept = kept_by_all(solved)
    return tuple(
        replace(now, held_out_px2=fit.held_out_px2(kept))
        for now, fit in zip(results, solved, strict=True)
    )


def compare_lenses(views: Sequence[BoardView]) -> tuple[LensFit, ...]:
    """Fit all lens models; return those that could be solved."""
    fits: dict[LensModel, Adjusted] = {}
    start = None
    for lens in _COMPARED:
        fit = fit_camera(views, lens, None if lens == "fisheye" else start)
        if fit is not None:
            fits[lens] = fit
            start = fit.setup.cameras[0]
    kept = kept_by_all(tuple(fits.values()))
    return tuple(_judged(lens, fit, fit.held_out_px2(kept)) for lens, fit in fits.items())


def best_lens(fits: Sequence[LensFit]) -> LensFit:
    """Return the simplest model whose held-out error does not differ from the least.

    It does not if the difference, by views, is within one standard error (Breiman et al. 1984,
    Classification and Regression Trees, section 3.4.3). Left out beforehand are models whose error
    is not near the least, within 5 %, and those with more than twice the least uncertainty at the
    image's edge: their coefficients are not determined where the board was not seen. A fisheye is
    taken if no pinhole remains, because not everything can use one.
    """
    least_px = min(one.held_out_px for one in fits)
    near = [one for one in fits if one.held_out_px <= _NEAR * least_px]
    edge_px = min(one.edge_px for one in near)
    known = [one for one in near if one.edge_px <= _UNCERTAIN * edge_px] or near
    known = [one for one in known if one.lens != "fisheye"] or known
    least = min(known, key=lambda one: one.held_out_px)
    as_good = [one for one in known if one is least or not _is_worse(one, least)]
    return min(as_good, key=lambda one: _COMPARED.index(one.lens))


def _is_worse(one: LensFit, least: LensFit) -> bool:
    more_px2 = one.held_out_px2 - least.held_out_px2
    return bool(more_px2.mean() > more_px2.std(ddof=1) / np.sqrt(len(more_px2)))


def _sightings(views: Sequence[BoardView]) -> list[Sighting]:
    return [Sighting(number, 0, seen) for number, seen in enumerate(views)]


def _judged(lens: LensModel, fit: Adjusted, held_out_px2: Float64) -> LensFit:
    covariance = fit.covariance()
    uncertainty = None
    if covariance is not None:
        solved = solved_parameters(lens)
        uncertainty = projection_uncertainty(fit.setup.cameras[0], solved, covariance)
    return LensFit(lens, fit, held_out_px2, covariance, uncertainty)


def _first_camera(views: Sequence[BoardView], lens: LensModel) -> Camera | None:
    """Return the undistorted camera of the focal length that fits best; None if none fits."""
    few = views[:: -(-len(views) // _START_VIEWS)]
    focals_px = _FOCAL_WIDTHS * few[0].size[0]
    cameras = [undistorted_camera(lens, few[0].size, focal_px) for focal_px in focals_px]
    if lens != "fisheye":
        return cameras[_best_focal(few, cameras[0], focals_px)]
    best, least_px = None, np.inf
    for camera in cameras:
        poses = [first_pose(seen, camera) for seen in few]
        off_px = [
            seen.pixels - pixels_of(seen.points_m, as_vector(pose), camera)
            for seen, pose in zip(few, poses, strict=True)
            if pose is not None
        ]
        if len(off_px) == len(few):
            middle_px = float(np.median(np.linalg.norm(np.concatenate(off_px), axis=1)))
            if middle_px < least_px:
                best, least_px = camera, middle_px
    return best


def _best_focal(views: Sequence[BoardView], camera: Camera, focals_px: Float64) -> int:
    """Return the number of the focal length (F,) with the least median error without distortion.

    The pose of each view comes from its homography (Zhang 2000, section 3.1), which all focal
    lengths share.
    """
    off_px = []
    for seen in views:
        target_px = seen.pixels - [camera.cx, camera.cy]
        H = cv2.findHomography(seen.points_m[:, :2], target_px)[0]
        if H is None:
            return len(focals_px) // 2
        columns = H / np.stack([focals_px, focals_px, np.ones_like(focals_px)], 1)[:, :, None]
        lengths = np.linalg.norm(columns[:, :, :2], axis=1)
        columns = columns / np.sqrt(lengths.prod(axis=1))[:, None, None]
        a, b, t = columns.transpose(2, 0, 1)
        U, _, Vt = np.linalg.svd(np.stack([a, b, np.cross(a, b)], axis=2))
        in_camera_m = seen.points_m @ (U @ Vt).swapaxes(1, 2) + t[:, None]
        predicted = in_camera_m[:, :, :2] / in_camera_m[:, :, 2:] * focals_px[:, None, None]
        off_px.append(np.linalg.norm(predicted - target_px, axis=2))
    return int(np.median(np.concatenate(off_px, axis=1), axis=1).argmin())


def _rms_px(seen: BoardView, pose: Float64, fit: Adjusted) -> float:
    off_px = seen.pixels - pixels_of(seen.points_m, pose, fit.setup.cameras[0])
    return float(np.sqrt(np.mean(np.sum(off_px**2, axis=1))))

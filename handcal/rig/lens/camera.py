"""A camera's intrinsics from views of a board, with their uncertainty.

The method is Zhang's, "A flexible new technique for camera calibration", 2000, with any lens model
of `handcal.rig.lens.lens`. Models are compared by their error on views that are held out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Literal, TypeAlias, get_args

import cv2
import numpy as np

from handcal.core.frozen import freeze
from handcal.core.types import Float64, Intrinsics
from handcal.rig.boards.board import BoardView
from handcal.rig.boards.views import (
    ASKED_VIEWS,
    BoardImage,
    Coverage,
    ViewsError,
    WorstView,
    check_moved,
    coverage,
    used,
    worst_view,
)
from handcal.rig.lens.bundle import (
    Adjusted,
    Setup,
    Sighting,
    adjust,
    as_transform,
    as_vector,
    kept_by_all,
)
from handcal.rig.lens.fit import CalibrationVerdict, rms
from handcal.rig.lens.lens import (
    Camera,
    LensModel,
    as_lens,
    as_pinhole,
    first_pose,
    pixels_of,
    solved_parameters,
    undistorted_camera,
)
from handcal.rig.lens.shape import FLAT, MOST_BY_SHAPE, BoardShape, solve_shape
from handcal.rig.lens.uncertainty import ProjectionUncertainty, next_view, projection_uncertainty

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
    least_px = min(fit.held_out_px for fit in fits)
    near = [fit for fit in fits if fit.held_out_px <= _NEAR * least_px]
    edge_px = min(fit.edge_px for fit in near)
    known = [fit for fit in near if fit.edge_px <= _UNCERTAIN * edge_px] or near
    known = [fit for fit in known if fit.lens != "fisheye"] or known
    least = min(known, key=lambda fit: fit.held_out_px)
    as_good = [fit for fit in known if fit is least or not _is_worse(fit, least)]
    return min(as_good, key=lambda fit: _COMPARED.index(fit.lens))


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


LensChoice: TypeAlias = Literal["auto", LensModel]
LENS_CHOICES: tuple[str, ...] = ("auto", *get_args(LensModel))
MIN_VIEWS = 3
_NEAR_BY_SHAPE = 1.15


# With fewer views, the verdict asks for more.
_GOOD_VIEWS = 10
# Least share of the image's cells that contain a corner in any view.
_GOOD_COVERAGE = 0.6
# Least spread of the boards' normals about their mean, RMS.
_GOOD_SPREAD_RAD = 0.2
# Projection uncertainty exceeded in half of the image: good up to the larger of the two.
_GOOD_ARCMIN, _GOOD_PX = 2.0, 0.25
# Relative standard deviation of the focal lengths from which they are useless.
_BAD_FOCAL_SIGMA = 0.03
# A larger residual indicates a fault: board, focus or exposure.
_MOST_RMS_PX = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class CameraCalibration:
    """A camera's intrinsics, with their uncertainty."""

    intrinsics: Camera
    lens: LensModel
    covariance: Float64 | None
    """(P, P); of fx, fy, cx, cy and the coefficients solved for, in order; None if not
    determined."""
    rms_px: float
    """Root mean square distance between detected and predicted corners, without `left_out`."""
    residuals_px: Mapping[str, float]
    """The same for each view."""
    left_out: int
    """Number of single corners that contradict those beside them."""
    T_C_B: Mapping[str, Float64]
    """each (4, 4); the board's pose in each view."""
    dropped: tuple[str, ...]
    """Views excluded by the user."""
    coverage: Coverage
    worst: WorstView
    verdict: CalibrationVerdict
    uncertainty: ProjectionUncertainty | None
    """None if not determined."""
    board: BoardShape = FLAT
    """As solved with the camera."""
    compared: tuple[LensFit, ...] = ()
    """All lens models, if the best was to be chosen."""

    def __post_init__(self) -> None:
        freeze(self, "covariance", np.float64, None, None)
        object.__setattr__(self, "residuals_px", MappingProxyType(dict(self.residuals_px)))
        object.__setattr__(self, "T_C_B", MappingProxyType(dict(self.T_C_B)))

    @property
    def pinhole(self) -> Intrinsics:
        """The intrinsics; ViewsError if they are a fisheye's."""
        return as_pinhole(self.intrinsics, "the camera")

    @property
    def arcmin_per_px(self) -> float:
        """Angle that a pixel in the middle of the image covers, arcminutes."""
        return float(np.degrees(np.arctan(1 / self.intrinsics.fx)) * 60)

    @property
    def sigma(self) -> Float64:
        """Standard deviations of fx, fy, cx, cy and the coefficients solved for."""
        if self.covariance is None:
            return np.full(4, np.inf)
        return np.sqrt(np.diag(self.covariance))


def calibrate_camera(views: Sequence[BoardImage], lens: LensChoice = "full") -> CameraCalibration:
    """Solve a camera's intrinsics from views of a board.

    Raises
    ------
    ViewsError
        If fewer than `MIN_VIEWS` show the board, they are of mixed resolutions, or nothing can
        be solved from them.
    """
    found = used(views, MIN_VIEWS)
    check_moved(found)
    compared = compare_lenses(tuple(found.values())) if lens == "auto" else ()
    if lens != "auto":
        solved = fit_lens(tuple(found.values()), lens)
    else:
        solved = best_lens(compared) if compared else None
    if solved is not None and solved.fit.rms_px <= MOST_BY_SHAPE * _MOST_RMS_PX:
        solved, compared = _shaped(solved, tuple(found.values()), compared)
    if solved is None or not np.isfinite(solved.camera.fx) or not 0 < solved.camera.fx < np.inf:
        raise ViewsError(
            "nothing can be solved from these views: take more, of a board tilted in all directions"
        )
    fit, camera = solved.fit, solved.camera
    poses = {name: as_transform(pose) for name, pose in zip(found, fit.setup.poses, strict=True)}
    off_px = {name: off[kept] for name, off, kept in zip(found, fit.off_px, fit.kept, strict=True)}
    tilt_rad = {name: tilt(poses[name], seen) for name, seen in found.items()}
    worst = worst_view(
        {name: seen.only(kept) for (name, seen), kept in zip(found.items(), fit.kept, strict=True)},
        off_px,
        tilt_rad,
    )
    return CameraCalibration(
        intrinsics=camera,
        lens=solved.lens,
        covariance=solved.covariance,
        rms_px=fit.rms_px,
        residuals_px={name: rms(off) for name, off in off_px.items()},
        left_out=fit.left_out,
        T_C_B=poses,
        dropped=tuple(view.name for view in views if view.dropped),
        coverage=coverage(found.values()),
        worst=worst,
        verdict=_judge(solved, found, poses, worst),
        uncertainty=solved.uncertainty,
        board=solved.board,
        compared=compared,
    )


def _shaped(
    solved: LensFit, views: Sequence[BoardView], compared: tuple[LensFit, ...]
) -> tuple[LensFit, tuple[LensFit, ...]]:
    """Return the fit with the board's shape, and the lens models compared on that board."""
    result = shaped(solved, views)
    if not (compared and result.board.words):
        return result, compared
    kinds = [one for one in compared if (one.lens == "fisheye") == (solved.lens == "fisheye")]
    compared = compare_shaped(kinds, views)
    # Free corners mend a lens model too simple; with the right one a simpler board is enough.
    near_px = _NEAR_BY_SHAPE * min(one.held_out_px for one in compared)
    plainer = [one for one in compared if one.held_out_px < near_px and not one.board.is_uneven]
    return best_lens(plainer or compared), compared


def tilt(T_C_B: Float64, seen: BoardView) -> float:
    """Return the angle between the board's normal and the line of sight, rad."""
    middle_m = T_C_B[:3, :3] @ seen.points_m.mean(axis=0) + T_C_B[:3, 3]
    return float(np.arccos(np.clip(T_C_B[:3, 2] @ middle_m / np.linalg.norm(middle_m), -1, 1)))


def normal_spread(poses: Mapping[str, Float64]) -> float:
    """Return the RMS spread of the boards' normals about their mean, rad."""
    normals = np.stack([T[:3, 2] for T in poses.values()])
    mean = normals.mean(axis=0)
    mean /= np.linalg.norm(mean)
    angles = np.arccos(np.clip(normals @ mean, -1, 1))
    return float(np.sqrt(np.mean(angles**2)))


def _judge(
    solved: LensFit,
    found: Mapping[str, BoardView],
    poses: Mapping[str, Float64],
    worst: WorstView,
) -> CalibrationVerdict:
    rms_px, camera = solved.fit.rms_px, solved.camera
    covariance, uncertainty = solved.covariance, solved.uncertainty
    spread_rad = normal_spread(poses)
    if rms_px > _MOST_RMS_PX:
        return CalibrationVerdict(
            "bad",
            f"corners are {rms_px:.2f} px off, more than {_MOST_RMS_PX:g}: check that the "
            "board is flat, focus fixed and the lens model the right one; drop the worst image, "
            f"{worst.name}: {worst.why}",
        )
    focal_sigma = np.inf
    if covariance is not None:
        focal_sigma = float((np.sqrt(np.diag(covariance)[:2]) / [camera.fx, camera.fy]).max())
    if (
        covariance is None
        or uncertainty is None
        or focal_sigma > _BAD_FOCAL_SIGMA
        or spread_rad < _GOOD_SPREAD_RAD / 4
    ):
        return CalibrationVerdict(
            "bad",
            "all views show the board at nearly one angle, which leaves the focal length open: "
            "tilt it by 20° to 45° in all directions",
        )
    seen_area = coverage(found.values())
    wanting = []
    if len(poses) < _GOOD_VIEWS:
        wanting.append(f"{len(poses)} views, {ASKED_VIEWS} are better")
    if seen_area.share < _GOOD_COVERAGE:
        wanting.append(
            f"the board was seen in {100 * seen_area.share:.0f} % of the image only: bring it to "
            "its edges"
        )
    if spread_rad < _GOOD_SPREAD_RAD:
        wanting.append(f"it was tilted by {np.degrees(spread_rad):.0f}° only: tilt it more")
    arcmin_per_px = float(np.degrees(np.arctan(1 / camera.fx)) * 60)
    limit_px = max(_GOOD_PX, _GOOD_ARCMIN / arcmin_per_px)
    if uncertainty.middle_px > limit_px:
        wanting.append(
            f"the direction of a pixel is known to ± {uncertainty.middle_px:.2f} px only "
            f"({uncertainty.middle_px * arcmin_per_px:.1f}′)"
        )
    if wanting:
        largest = max(found.values(), key=lambda seen: len(seen.ids))
        add = next_view(
            camera,
            solved_parameters(solved.lens),
            covariance,
            largest.points_m,
            rms_px / np.sqrt(2),
            seen_area.hits if seen_area.share < _GOOD_COVERAGE else None,
        )
        if add is not None:
            wanting.append(f"next, the board {add.words}")
        return CalibrationVerdict("needs more views", "; ".join(wanting) + solved.board.also)
    return CalibrationVerdict(
        "good",
        f"corners are {rms_px:.2f} px off in {len(poses)} views over {100 * seen_area.share:.0f} % "
        f"of the image; the direction of a pixel is known to ± {uncertainty.middle_px:.2f} px "
        f"({uncertainty.middle_px * arcmin_per_px:.1f}′)" + solved.board.also,
    )

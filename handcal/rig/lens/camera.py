"""A camera's intrinsics from views of a board, with their uncertainty.

The method is Zhang's, "A flexible new technique for camera calibration", 2000, with any lens model
of `handcal.rig.lens.lens`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal, TypeAlias, get_args

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
from handcal.rig.lens.fit import rms
from handcal.rig.lens.lens import Camera, LensModel, as_pinhole, solved_parameters
from handcal.rig.lens.lens_fit import (
    LensFit,
    best_lens,
    compare_lenses,
    compare_shaped,
    fit_lens,
    shaped,
)
from handcal.rig.lens.reprojection import as_transform
from handcal.rig.lens.shape import FLAT, MOST_BY_SHAPE, BoardShape
from handcal.rig.lens.uncertainty import ProjectionUncertainty, next_view
from handcal.rig.verdict import CalibrationVerdict

LensChoice: TypeAlias = Literal["auto", LensModel]
LENS_CHOICES: tuple[str, ...] = ("auto", *get_args(LensModel))
MIN_VIEWS = 3
_NEAR_BY_SHAPE = 1.15


@dataclass(frozen=True, slots=True)
class CameraSettings:
    """Settings of the solver for intrinsics, and limits of a good result."""

    lens: LensChoice = "full"
    """Lens model, or auto: the one that fits best views that are not used to solve it."""
    good_views: int = 10
    """With fewer views, the verdict asks for more."""
    good_coverage: float = 0.6
    """Minimum share of the image's cells that contain a corner in any view."""
    good_spread_rad: float = 0.2
    """Least spread of the boards' normals about their mean, RMS."""
    max_projection_arcmin: float = 2.0
    max_projection_px: float = 0.25
    """Projection uncertainty exceeded in half of the image: good up to the larger of the two."""
    bad_focal_sigma: float = 0.03
    """Relative standard deviation of the focal lengths from which they are useless."""
    max_rms_px: float = 1.0
    """A larger residual indicates a fault: board, focus or exposure."""


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


def calibrate_camera(
    views: Sequence[BoardImage], settings: CameraSettings | None = None
) -> CameraCalibration:
    """Solve a camera's intrinsics from views of a board.

    Raises
    ------
    ViewsError
        If fewer than `MIN_VIEWS` show the board, they are of mixed resolutions, or nothing can
        be solved from them.
    """
    settings = settings or CameraSettings()
    found = used(views, MIN_VIEWS)
    check_moved(found)
    compared = compare_lenses(tuple(found.values())) if settings.lens == "auto" else ()
    if settings.lens != "auto":
        solved = fit_lens(tuple(found.values()), settings.lens)
    else:
        solved = best_lens(compared) if compared else None
    if solved is not None and solved.fit.rms_px <= MOST_BY_SHAPE * settings.max_rms_px:
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
        verdict=_judge(solved, found, poses, worst, settings),
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
    settings: CameraSettings,
) -> CalibrationVerdict:
    rms_px, camera = solved.fit.rms_px, solved.camera
    covariance, uncertainty = solved.covariance, solved.uncertainty
    spread_rad = normal_spread(poses)
    if rms_px > settings.max_rms_px:
        return CalibrationVerdict(
            "bad",
            f"corners are {rms_px:.2f} px off, more than {settings.max_rms_px:g}: check that the "
            "board is flat, focus fixed and the lens model the right one; drop the worst image, "
            f"{worst.name}: {worst.why}",
        )
    focal_sigma = np.inf
    if covariance is not None:
        focal_sigma = float((np.sqrt(np.diag(covariance)[:2]) / [camera.fx, camera.fy]).max())
    if (
        covariance is None
        or uncertainty is None
        or focal_sigma > settings.bad_focal_sigma
        or spread_rad < settings.good_spread_rad / 4
    ):
        return CalibrationVerdict(
            "bad",
            "all views show the board at nearly one angle, which leaves the focal length open: "
            "tilt it by 20° to 45° in all directions",
        )
    seen_area = coverage(found.values())
    wanting = []
    if len(poses) < settings.good_views:
        wanting.append(f"{len(poses)} views, {max(ASKED_VIEWS, settings.good_views)} are better")
    if seen_area.share < settings.good_coverage:
        wanting.append(
            f"the board was seen in {100 * seen_area.share:.0f} % of the image only: bring it to "
            "its edges"
        )
    if spread_rad < settings.good_spread_rad:
        wanting.append(f"it was tilted by {np.degrees(spread_rad):.0f}° only: tilt it more")
    arcmin_per_px = float(np.degrees(np.arctan(1 / camera.fx)) * 60)
    limit_px = max(settings.max_projection_px, settings.max_projection_arcmin / arcmin_per_px)
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
            seen_area.hits if seen_area.share < settings.good_coverage else None,
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

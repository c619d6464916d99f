"""A camera's intrinsics from views of a board, with their uncertainty.

The method is Zhang's, "A flexible new technique for camera calibration", 2000, by OpenCV.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Literal, TypeAlias

import cv2
import numpy as np
from numpy.typing import ArrayLike

from handcal.geometry import camera_matrix, rigid
from handcal.rig.board import BoardView
from handcal.rig.fit import marginal_covariance, rms
from handcal.rig.verdict import CalibrationVerdict
from handcal.rig.views import (
    BoardImage,
    Coverage,
    ViewsError,
    WorstView,
    coverage,
    one_size,
    used,
    worst_view,
)
from handcal.types import Float64, Intrinsics, freeze

LensModel: TypeAlias = Literal["none", "radial", "full", "rational"]
_FIX_HIGHER = cv2.CALIB_FIX_K1 | cv2.CALIB_FIX_K2 | cv2.CALIB_FIX_K3
_FLAGS: dict[LensModel, int] = {
    "none": cv2.CALIB_ZERO_TANGENT_DIST | _FIX_HIGHER,
    "radial": cv2.CALIB_ZERO_TANGENT_DIST | cv2.CALIB_FIX_K3,
    "full": 0,
    "rational": cv2.CALIB_RATIONAL_MODEL,
}
# Which of OpenCV's coefficients each solves for.
_SOLVED: dict[LensModel, tuple[int, ...]] = {
    "none": (),
    "radial": (0, 1),
    "full": (0, 1, 2, 3, 4),
    "rational": (0, 1, 2, 3, 4, 5, 6, 7),
}
MIN_VIEWS = 3


@dataclass(frozen=True, slots=True)
class CameraSettings:
    """Settings of the solver for intrinsics, and limits of a good result."""

    lens: LensModel = "full"
    """Distortion: none; k1, k2; k1, k2, p1, p2, k3; the same and k4 to k6."""
    good_views: int = 10
    """With fewer views, the verdict asks for more."""
    good_coverage: float = 0.6
    """Minimum share of the image's cells that contain a corner in any view."""
    good_spread_rad: float = 0.2
    """Least spread of the boards' normals about their mean, RMS."""
    max_focal_sigma: float = 0.001
    bad_focal_sigma: float = 0.03
    """Relative standard deviation of the focal lengths: good up to the first, useless from the
    second."""
    max_rms_px: float = 1.0
    """A larger residual indicates a fault: board, focus or exposure."""


@dataclass(frozen=True, slots=True, eq=False)
class CameraCalibration:
    """A camera's intrinsics, with their uncertainty."""

    intrinsics: Intrinsics
    covariance: Float64 | None
    """(P, P); of fx, fy, cx, cy and the coefficients solved for, in order; None if not
    determined."""
    rms_px: float
    """Root mean square distance between detected and predicted corners."""
    residuals_px: Mapping[str, float]
    """The same for each view."""
    T_C_B: Mapping[str, Float64]
    """each (4, 4); the board's pose in each view."""
    dropped: tuple[str, ...]
    """Views excluded by the user."""
    coverage: Coverage
    worst: WorstView
    verdict: CalibrationVerdict

    def __post_init__(self) -> None:
        freeze(self, "covariance", np.float64, None, None)
        object.__setattr__(self, "residuals_px", MappingProxyType(dict(self.residuals_px)))
        object.__setattr__(self, "T_C_B", MappingProxyType(dict(self.T_C_B)))

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
    intrinsics, poses = _solve(found, settings.lens)
    fits = {name: linearise(seen, poses[name], intrinsics) for name, seen in found.items()}
    off_px = {name: off for name, (off, _) in fits.items()}
    solved = solved_columns(settings.lens)
    everything_px = np.vstack(list(off_px.values()))
    covariance = marginal_covariance(
        ((by[:, solved], by[:, :6]) for _, by in fits.values()), everything_px.ravel()
    )
    tilt_rad = {name: tilt(poses[name], seen) for name, seen in found.items()}
    worst = worst_view(found, off_px, tilt_rad)
    seen_area = coverage(found.values())
    return CameraCalibration(
        intrinsics=intrinsics,
        covariance=covariance,
        rms_px=rms(everything_px),
        residuals_px={name: rms(off) for name, off in off_px.items()},
        T_C_B=poses,
        dropped=tuple(view.name for view in views if view.dropped),
        coverage=seen_area,
        worst=worst,
        verdict=_judge(
            intrinsics, covariance, rms(everything_px), poses, seen_area.share, worst, settings
        ),
    )


def linearise(seen: BoardView, T_C_B: Float64, intrinsics: Intrinsics) -> tuple[Float64, Float64]:
    """Return residuals (N, 2), detected minus predicted, px, and the derivatives of the predicted.

    The derivatives, (2N, 10 + coefficients), are by the rotation vector, the translation, fx, fy,
    cx, cy and the coefficients.
    """
    rotation, _ = cv2.Rodrigues(T_C_B[:3, :3])
    coefficients = np.array(intrinsics.distortion or (0.0,) * 4)
    expected, by = cv2.projectPoints(
        seen.points_m, rotation, T_C_B[:3, 3], camera_matrix(intrinsics), coefficients
    )
    off_px: Float64 = seen.pixels - expected.reshape(-1, 2)
    return off_px, np.asarray(by, dtype=np.float64)


def solved_columns(lens: LensModel) -> list[int]:
    """Return the columns of `linearise`'s derivatives that belong to a lens model's intrinsics."""
    return [*range(6, 10), *(10 + number for number in _SOLVED[lens])]


def lens_flags(lens: LensModel) -> int:
    """Return OpenCV's flags for a lens model."""
    return _FLAGS[lens]


def refined(intrinsics: Intrinsics, K: ArrayLike, coefficients: ArrayLike) -> Intrinsics:
    """Return the intrinsics from OpenCV's result, with the same number of coefficients."""
    K, found = np.asarray(K), np.asarray(coefficients).ravel()
    return replace(
        intrinsics,
        fx=float(K[0, 0]),
        fy=float(K[1, 1]),
        cx=float(K[0, 2]),
        cy=float(K[1, 2]),
        distortion=tuple(float(one) for one in found[: len(intrinsics.distortion)]),
    )


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


def _solve(
    found: Mapping[str, BoardView], lens: LensModel
) -> tuple[Intrinsics, dict[str, Float64]]:
    width, height = one_size(found)
    try:
        _, K, coefficients, rotations, translations, *_ = cv2.calibrateCameraExtended(
            [seen.points_m.astype(np.float32) for seen in found.values()],
            [seen.pixels.astype(np.float32) for seen in found.values()],
            (width, height),
            np.eye(3),
            np.zeros(8),
            flags=lens_flags(lens),
        )
    except cv2.error as error:
        raise ViewsError(
            "nothing can be solved from these views: take more, of a board tilted to every side"
        ) from error
    count = {"none": 0, "rational": 8}.get(lens, 5)
    intrinsics = refined(Intrinsics(width, height, 1, 1, 0, 0, (0.0,) * count), K, coefficients)
    if not np.isfinite([intrinsics.fx, intrinsics.fy, *intrinsics.distortion]).all():
        raise ViewsError("these views determine no camera: tilt the board to every side")
    poses = {
        name: rigid(cv2.Rodrigues(rotation)[0], translation.ravel())
        for name, rotation, translation in zip(found, rotations, translations, strict=True)
    }
    return intrinsics, poses


def _judge(
    intrinsics: Intrinsics,
    covariance: Float64 | None,
    rms_px: float,
    poses: Mapping[str, Float64],
    share: float,
    worst: WorstView,
    settings: CameraSettings,
) -> CalibrationVerdict:
    spread_rad = normal_spread(poses)
    if rms_px > settings.max_rms_px:
        return CalibrationVerdict(
            "bad",
            f"corners are {rms_px:.2f} px off, more than {settings.max_rms_px:g}: check that the "
            f"board is flat and focus fixed; drop the worst image, {worst.name}: {worst.why}",
        )
    focal_sigma = np.inf
    if covariance is not None:
        sigmas = np.sqrt(np.diag(covariance)[:2]) / [intrinsics.fx, intrinsics.fy]
        focal_sigma = float(sigmas.max())
    if focal_sigma > settings.bad_focal_sigma or spread_rad < settings.good_spread_rad / 4:
        return CalibrationVerdict(
            "bad",
            "all views show the board at nearly one angle, which does not tell the focal length: "
            "tilt it by 20° to 45° to every side",
        )
    wanting = []
    if len(poses) < settings.good_views:
        wanting.append(f"{len(poses)} views, {settings.good_views} are better")
    if share < settings.good_coverage:
        wanting.append(
            f"the board was seen in {100 * share:.0f} % of the image only: bring it to its edges"
        )
    if spread_rad < settings.good_spread_rad:
        wanting.append(f"it was tilted by {np.degrees(spread_rad):.0f}° only: tilt it more")
    if focal_sigma > settings.max_focal_sigma:
        wanting.append(f"the focal length is known to ± {100 * focal_sigma:.2f} % only")
    if wanting:
        return CalibrationVerdict("needs more views", "; ".join(wanting))
    return CalibrationVerdict(
        "good",
        f"corners are {rms_px:.2f} px off in {len(poses)} views over {100 * share:.0f} % of the "
        f"image; focal length ± {100 * focal_sigma:.2f} %",
    )

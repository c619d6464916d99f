"""The depth camera's pose in the headset's, from pairs of views of one board (paper: 0.52 px)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TypeAlias

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from handcal.geometry import camera_matrix, invert, rigid
from handcal.rig.board import BoardView, Int64
from handcal.rig.camera import (
    CameraCalibration,
    CameraSettings,
    LensModel,
    calibrate_camera,
    lens_flags,
    linearise,
    normal_spread,
    refined,
    solved_columns,
    tilt,
)
from handcal.rig.fit import marginal_covariance, rms
from handcal.rig.verdict import CalibrationVerdict
from handcal.rig.views import BoardImage, ViewsError, WorstView, one_size, worst_view
from handcal.types import Float64, Intrinsics, freeze

_Both: TypeAlias = tuple[Float64, Float64]  # of the depth camera's and the headset's image

MIN_PAIRS = 3
_MIN_SHARED_CORNERS = 8
# A single good pair gives the distance of the cameras to a few millimetres.
_DISAGREE_M = 0.02
_SWAPPED = "the cameras are swapped: the depth camera's images are the headset's, and the reverse"


@dataclass(frozen=True, slots=True)
class StereoSettings:
    """Limits of a good pose between two cameras."""

    camera: CameraSettings = field(default_factory=CameraSettings)
    """For intrinsics that are not given."""
    good_pairs: int = 10
    good_spread_rad: float = 0.15
    """Least spread of the boards' normals about their mean, RMS."""
    max_rms_px: float = 1.0
    max_angle_sigma_rad: float = 1e-3
    max_shift_sigma_m: float = 3e-4
    """Standard deviation of the rotation and the translation, each along its worst axis."""
    max_shift_m: float = 0.5
    """Maximum distance between two cameras on one headset."""


@dataclass(frozen=True, slots=True, eq=False)
class StereoCalibration:
    """The pose of the depth camera, with its uncertainty."""

    T_H_D: Float64
    """(4, 4); from the depth camera (or its colour imager) to the headset's."""
    covariance: Float64 | None
    """(6, 6); of T_H_D's rotation vector (rad) and translation (m), with the uncertainty of
    intrinsics that were solved, not of given ones. None if not determined."""
    depth: Intrinsics
    headset: Intrinsics
    """Given or solved."""
    rms_px: float
    """Over both images of all pairs."""
    residuals_px: Mapping[str, float]
    """For each pair, by the name of the depth camera's image."""
    spread_rad: float
    spread_m: float
    """RMS difference between T_H_D and the poses from single pairs."""
    dropped: tuple[str, ...]
    """Pairs excluded by the user."""
    worst: WorstView
    verdict: CalibrationVerdict

    def __post_init__(self) -> None:
        freeze(self, "T_H_D", np.float64, 4, 4)
        freeze(self, "covariance", np.float64, 6, 6)
        object.__setattr__(self, "residuals_px", MappingProxyType(dict(self.residuals_px)))


@dataclass(frozen=True, slots=True, eq=False)
class _Pair:
    """Corners that both cameras see."""

    depth: BoardView
    headset: BoardView


def calibrate_stereo(
    pairs: Sequence[tuple[BoardImage, BoardImage]],
    depth: Intrinsics | None = None,
    headset: Intrinsics | None = None,
    settings: StereoSettings | None = None,
) -> StereoCalibration:
    """Solve T_H_D from pairs of views, taken at the same moments, of one board.

    Parameters
    ----------
    pairs : sequence of (BoardImage, BoardImage)
        The depth camera's and the headset camera's. A pair with either dropped is left out.
    depth, headset : Intrinsics, optional
        If not given, solved from the same views, which then must be more and better.
    settings : StereoSettings, optional

    Raises
    ------
    ViewsError
        If fewer than `MIN_PAIRS` pairs show the board to both cameras, the images are of mixed
        resolutions or not of the size of given intrinsics, the cameras are swapped, one's images
        are mirrored, both's are the same, or nothing can be solved.
    """
    settings = settings or StereoSettings()
    both = _found_by_both(pairs)
    if all(np.array_equal(pair.depth.pixels, pair.headset.pixels) for pair in both.values()):
        raise ViewsError("both cameras' images are the same: choose each camera's own")
    _check_sizes(both, depth, headset)
    lens = settings.camera.lens
    free = solved_columns(lens)
    solved = (free if depth is None else [], free if headset is None else [])
    depth = depth or _solved([first for first, _ in pairs], "depth", settings.camera)
    headset = headset or _solved([second for _, second in pairs], "headset", settings.camera)
    rms_px = _rms_px(both, depth, headset)
    _check_not_swapped(both, depth, headset, rms_px)
    if rms_px > settings.max_rms_px:
        _check_not_mirrored(both, depth, headset, rms_px)
    # Solved intrinsics of both cameras are refined jointly if the pairs fit well.
    joint = lens if all(solved) and rms_px < settings.max_rms_px else None
    T_H_D, T_D_B, depth, headset = _solve(both, depth, headset, joint)
    off_px, by = _fit(both, depth, headset, T_H_D, T_D_B)
    everything_px = np.vstack([off for pair in off_px.values() for off in pair])
    rms_px = rms(everything_px)
    covariance = _covariance(by, T_H_D, T_D_B, solved, everything_px)
    alone = np.stack([_alone(pair, depth, headset) for pair in both.values()])
    apart = _differences(T_H_D, alone)
    worst = _worst(both, off_px, T_H_D, T_D_B)
    trouble = (
        _disagreement(tuple(both), alone) or f"drop the worst image, {worst.name}: {worst.why}"
    )
    return StereoCalibration(
        T_H_D=T_H_D,
        covariance=covariance,
        depth=depth,
        headset=headset,
        rms_px=rms_px,
        residuals_px={name: rms(np.vstack(off)) for name, off in off_px.items()},
        spread_rad=float(np.sqrt(np.mean(apart[:, 0] ** 2))),
        spread_m=float(np.sqrt(np.mean(apart[:, 1] ** 2))),
        dropped=tuple(first.name for first, second in pairs if first.dropped or second.dropped),
        worst=worst,
        verdict=_judge(T_H_D, covariance, rms_px, T_D_B, trouble, settings),
    )


def _found_by_both(pairs: Sequence[tuple[BoardImage, BoardImage]]) -> dict[str, _Pair]:
    """Return the corners that both cameras see, by the name of the depth camera's image."""
    both = {}
    for first, second in pairs:
        if first.found and second.found and not (first.dropped or second.dropped):
            _, of_first, of_second = np.intersect1d(
                first.found.ids, second.found.ids, assume_unique=True, return_indices=True
            )
            if len(of_first) >= _MIN_SHARED_CORNERS:
                both[first.name] = _Pair(
                    _only(first.found, of_first), _only(second.found, of_second)
                )
    if len(both) < MIN_PAIRS:
        problems = {view.problem for pair in pairs for view in pair if view.problem}
        seen = f": {'; '.join(sorted(problems)[:3])}" if problems else ""
        raise ViewsError(
            f"both cameras see the board in {len(both)} of {len(pairs)} pairs used, at least "
            f"{MIN_PAIRS} are needed{seen}"
        )
    return both


def _only(seen: BoardView, which: Int64) -> BoardView:
    return replace(
        seen, points_m=seen.points_m[which], pixels=seen.pixels[which], ids=seen.ids[which]
    )


def _check_sizes(
    both: Mapping[str, _Pair], depth: Intrinsics | None, headset: Intrinsics | None
) -> None:
    sizes = (
        one_size({name: pair.depth for name, pair in both.items()}),
        one_size({name: pair.headset for name, pair in both.items()}),
    )
    wanted = [(given.width, given.height) if given else None for given in (depth, headset)]
    if all(want in (None, size) for want, size in zip(wanted, sizes, strict=True)):
        return
    if all(want in (None, size) for want, size in zip(wanted, sizes[::-1], strict=True)):
        raise ViewsError(_SWAPPED)
    for which, want, size in zip(("depth", "headset"), wanted, sizes, strict=True):
        if want is not None and want != size:
            raise ViewsError(
                f"the {which} camera's intrinsics are for {want[0]}x{want[1]} pixels, its images "
                f"have {size[0]}x{size[1]}"
            )


def _solved(views: Sequence[BoardImage], which: str, settings: CameraSettings) -> Intrinsics:
    try:
        calibration: CameraCalibration = calibrate_camera(views, settings)
    except ViewsError as error:
        raise ViewsError(f"{which} camera: {error}") from error
    if calibration.verdict.name == "bad":
        raise ViewsError(f"{which} camera: {calibration.verdict.reason}")
    return calibration.intrinsics


def _solve(
    both: Mapping[str, _Pair], depth: Intrinsics, headset: Intrinsics, lens: LensModel | None = None
) -> tuple[Float64, dict[str, Float64], Intrinsics, Intrinsics]:
    """Return T_H_D, T_D_B of each pair, and the intrinsics, refined if a lens model is given."""
    flags = cv2.CALIB_FIX_INTRINSIC
    if lens is not None:
        flags = cv2.CALIB_USE_INTRINSIC_GUESS | lens_flags(lens)
    try:
        _, K_D, lens_D, K_H, lens_H, R, t, _, _, rotations, translations, _ = (
            cv2.stereoCalibrateExtended(
                [pair.depth.points_m.astype(np.float32) for pair in both.values()],
                [pair.depth.pixels.astype(np.float32) for pair in both.values()],
                [pair.headset.pixels.astype(np.float32) for pair in both.values()],
                camera_matrix(depth),
                _coefficients(depth),
                camera_matrix(headset),
                _coefficients(headset),
                (depth.width, depth.height),
                np.eye(3),
                np.zeros(3),
                flags=flags,
            )
        )
    except cv2.error as error:
        raise ViewsError(
            "nothing can be solved from these pairs: take more, of a board tilted to every side"
        ) from error
    T_D_B = {
        name: rigid(cv2.Rodrigues(rotation)[0], translation.ravel())
        for name, rotation, translation in zip(both, rotations, translations, strict=True)
    }
    if lens is not None:
        depth, headset = refined(depth, K_D, lens_D), refined(headset, K_H, lens_H)
    return rigid(R, t.ravel()), T_D_B, depth, headset


def _coefficients(intrinsics: Intrinsics) -> Float64:
    return np.array(intrinsics.distortion or (0.0,) * 5)


def _fit(
    both: Mapping[str, _Pair],
    depth: Intrinsics,
    headset: Intrinsics,
    T_H_D: Float64,
    T_D_B: Mapping[str, Float64],
) -> tuple[dict[str, _Both], dict[str, _Both]]:
    """Return each pair's residuals in both images, and the derivatives that `linearise` gives."""
    off_px, by = {}, {}
    for name, pair in both.items():
        off_depth, by_depth = linearise(pair.depth, T_D_B[name], depth)
        off_headset, by_headset = linearise(pair.headset, T_H_D @ T_D_B[name], headset)
        off_px[name] = off_depth, off_headset
        by[name] = by_depth, by_headset
    return off_px, by


def _covariance(
    by: Mapping[str, _Both],
    T_H_D: Float64,
    T_D_B: Mapping[str, Float64],
    solved: tuple[list[int], list[int]],
    off_px: Float64,
) -> Float64 | None:
    """Return the covariance of T_H_D, with that of the intrinsics `solved` from the same views."""
    blocks = []
    for name, (by_depth, by_headset) in by.items():
        by_board, by_place = _composed(T_D_B[name], T_H_D)
        of_depth, of_headset = by_depth[:, solved[0]], by_headset[:, solved[1]]
        shared = np.block(
            [
                [np.zeros((len(by_depth), 6)), of_depth, np.zeros_like(of_headset)],
                [by_headset[:, :6] @ by_place, np.zeros_like(of_depth), of_headset],
            ]
        )
        blocks.append((shared, np.vstack([by_depth[:, :6], by_headset[:, :6] @ by_board])))
    covariance = marginal_covariance(blocks, off_px.ravel())
    return None if covariance is None else covariance[:6, :6]


def _composed(T_D_B: Float64, T_H_D: Float64) -> tuple[Float64, Float64]:
    """Return the derivatives (6, 6) of T_H_B's rotation vector and shift by those of the two."""
    (r1, t1), (r2, t2) = ((cv2.Rodrigues(T[:3, :3])[0], T[:3, 3:]) for T in (T_D_B, T_H_D))
    (_, _, r_r1, r_t1, r_r2, r_t2, t_r1, t_t1, t_r2, t_t2) = cv2.composeRT(r1, t1, r2, t2)
    return np.block([[r_r1, r_t1], [t_r1, t_t1]]), np.block([[r_r2, r_t2], [t_r2, t_t2]])


def _alone(pair: _Pair, depth: Intrinsics, headset: Intrinsics) -> Float64:
    """Return T_H_D from a single pair."""
    return _pose(pair.headset, headset) @ invert(_pose(pair.depth, depth))


def _pose(seen: BoardView, camera: Intrinsics) -> Float64:
    _, rotation, translation = cv2.solvePnP(
        seen.points_m, seen.pixels, camera_matrix(camera), _coefficients(camera)
    )
    return rigid(cv2.Rodrigues(rotation)[0], translation.ravel())


def _differences(T: Float64, others: Float64) -> Float64:
    """Return rotation (rad) and distance (m) between `T` and each of (N, 4, 4) others, (N, 2)."""
    turns = Rotation.from_matrix(others[:, :3, :3]) * Rotation.from_matrix(T[:3, :3]).inv()
    shifts_m = np.linalg.norm(others[:, :3, 3] - T[:3, 3], axis=1)
    return np.stack([turns.magnitude(), shifts_m], axis=1)


def _check_not_swapped(
    both: Mapping[str, _Pair], depth: Intrinsics, headset: Intrinsics, rms_px: float
) -> None:
    same_size = (depth.width, depth.height) == (headset.width, headset.height)
    if same_size and _rms_px(both, headset, depth) < rms_px / 2:
        raise ViewsError(_SWAPPED)


def _check_not_mirrored(
    both: Mapping[str, _Pair], depth: Intrinsics, headset: Intrinsics, rms_px: float
) -> None:
    """Raise ViewsError if the pairs fit far better with one camera's images mirrored."""
    if any(_rms_px(*trial) < rms_px / 2 for trial in _unmirrored(both, depth, headset)):
        raise ViewsError(
            "one camera's images are mirrored, the other's not: switch that off in the camera "
            "(letters in its images, or a ChArUco board, tell which)"
        )


def _rms_px(both: Mapping[str, _Pair], depth: Intrinsics, headset: Intrinsics) -> float:
    T_H_D, T_D_B, _, _ = _solve(both, depth, headset)
    off_px, _ = _fit(both, depth, headset, T_H_D, T_D_B)
    return rms(np.vstack([off for pair in off_px.values() for off in pair]))


def _unmirrored(
    both: Mapping[str, _Pair], depth: Intrinsics, headset: Intrinsics
) -> Iterator[tuple[dict[str, _Pair], Intrinsics, Intrinsics]]:
    """Yield the pairs as they would be if the headset's images were not mirrored.

    A mirrored checkerboard was numbered with its rows or its columns reversed; intrinsics solved
    from mirrored images are mirrored, given ones are not.
    """
    for camera in (headset, replace(headset, cx=headset.width - 1 - headset.cx)):
        for axis in (0, 1):
            pairs = {
                name: replace(pair, headset=_mirror(pair.headset, axis))
                for name, pair in both.items()
            }
            yield pairs, depth, camera


def _mirror(seen: BoardView, axis: int) -> BoardView:
    """Mirror a view of a whole checkerboard, its corners numbered the other way along an axis."""
    pixels = seen.pixels.copy()
    pixels[:, 0] = seen.size[0] - 1 - pixels[:, 0]
    place_m = seen.points_m.copy()
    place_m[:, axis] = place_m[:, axis].min() + place_m[:, axis].max() - place_m[:, axis]
    # The points stay in the order that both cameras share.
    order = np.lexsort((place_m[:, 0].round(6), place_m[:, 1].round(6)))
    return replace(seen, pixels=pixels[order])


def _worst(
    both: Mapping[str, _Pair],
    off_px: Mapping[str, _Both],
    T_H_D: Float64,
    T_D_B: Mapping[str, Float64],
) -> WorstView:
    """Return the worst image of either camera."""
    found, off, tilts = {}, {}, {}
    for name, pair in both.items():
        poses = T_D_B[name], T_H_D @ T_D_B[name]
        for which, seen, off_image, T_C_B in zip(
            ("depth", "headset"), (pair.depth, pair.headset), off_px[name], poses, strict=True
        ):
            image = f"{which} camera's of {name}"
            found[image], off[image], tilts[image] = seen, off_image, tilt(T_C_B, seen)
    return worst_view(found, off, tilts)


def _disagreement(names: Sequence[str], alone: Float64) -> str:
    """Return a message if one pair contradicts the others or hardly two agree; else empty."""
    each = np.stack([_differences(T, alone) for T in alone])
    medians = np.median(each, axis=1)
    apart = each[medians[:, 1].argmin()]
    if np.median(apart[:, 1]) > _DISAGREE_M:
        return (
            "hardly two pairs agree: are the two images of a pair taken at the same moment, and "
            "numbered alike?"
        )
    odd = int(apart[:, 1].argmax())
    if apart[odd, 1] < _DISAGREE_M:
        return ""
    return (
        f"pair {names[odd]} alone puts the cameras {1e3 * apart[odd, 1]:.0f} mm elsewhere: the "
        "board moved between its two exposures, or they do not belong together; drop it"
    )


def _judge(
    T_H_D: Float64,
    covariance: Float64 | None,
    rms_px: float,
    T_D_B: Mapping[str, Float64],
    trouble: str,
    settings: StereoSettings,
) -> CalibrationVerdict:
    if rms_px > settings.max_rms_px:
        return CalibrationVerdict(
            "bad", f"corners are {rms_px:.2f} px off, more than {settings.max_rms_px:g}: {trouble}"
        )
    spread_rad = normal_spread(T_D_B)
    if covariance is None or spread_rad < settings.good_spread_rad / 4:
        return CalibrationVerdict(
            "bad",
            "all pairs show the board at nearly one angle: tilt it by 20° to 45° to every side",
        )
    shift_m = float(np.linalg.norm(T_H_D[:3, 3]))
    if shift_m > settings.max_shift_m:
        return CalibrationVerdict(
            "bad",
            f"the cameras come out {1e3 * shift_m:.0f} mm apart: is the squares' side right, and "
            "are both on the headset?",
        )
    angle_sigma, shift_sigma = (
        float(np.sqrt(np.linalg.eigvalsh(part).max()))
        for part in (covariance[:3, :3], covariance[3:, 3:])
    )
    known = f"± {np.degrees(angle_sigma):.3f}°, ± {1e3 * shift_sigma:.2f} mm"
    wanting = []
    if len(T_D_B) < settings.good_pairs:
        wanting.append(f"{len(T_D_B)} pairs, {settings.good_pairs} are better")
    if spread_rad < settings.good_spread_rad:
        wanting.append(f"the board was tilted by {np.degrees(spread_rad):.0f}° only")
    if angle_sigma > settings.max_angle_sigma_rad or shift_sigma > settings.max_shift_sigma_m:
        wanting.append(f"the pose is known to {known} only")
    if wanting:
        return CalibrationVerdict("needs more views", "; ".join(wanting))
    return CalibrationVerdict(
        "good",
        f"corners are {rms_px:.2f} px off in {len(T_D_B)} pairs; the pose is known to {known}",
    )

"""The depth camera's pose in the headset's, from pairs of views of one board (paper: 0.52 px).

Each pair alone gives the pose; the one nearest to the others starts a bundle adjustment.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from scipy.spatial.transform import Rotation

from handcal.core.frozen import freeze
from handcal.core.geometry import rigid
from handcal.core.types import Float64
from handcal.rig.boards.board import BoardView, square_m
from handcal.rig.boards.views import (
    ASKED_VIEWS,
    BoardImage,
    ViewsError,
    WorstView,
    check_moved,
    one_size,
    worst_view,
)
from handcal.rig.lens.bundle import Adjusted, Setup, Sighting, adjust, as_transform, as_vector
from handcal.rig.lens.camera import (
    CameraCalibration,
    LensChoice,
    calibrate_camera,
    normal_spread,
    tilt,
)
from handcal.rig.lens.fit import CalibrationVerdict, rms
from handcal.rig.lens.lens import Camera, LensModel, first_pose
from handcal.rig.lens.shape import FLAT, MOST_BY_SHAPE, BoardShape, solve_shape
from handcal.rig.lens.uncertainty import next_pair

_GOOD_PAIRS = 10
# Least spread of the boards' normals about their mean, RMS.
_GOOD_SPREAD_RAD = 0.15
_MOST_RMS_PX = 1.0
# Standard deviation of the rotation and the translation, each along its worst axis.
_GOOD_ANGLE_RAD, _GOOD_SHIFT_M = 1e-3, 3e-4
# Largest distance between two cameras on one headset.
_MOST_SHIFT_M = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class StereoCalibration:
    """The pose of the depth camera, with its uncertainty."""

    T_H_D: Float64
    """(4, 4); from the depth camera (or its colour imager) to the headset's."""
    covariance: Float64 | None
    """(6, 6); of T_H_D's rotation vector (rad) and translation (m), with the uncertainty of
    intrinsics that were solved, not of given ones. None if not determined."""
    depth: Camera
    headset: Camera
    """Given or solved."""
    rms_px: float
    """Over both images of all pairs, without `left_out`."""
    residuals_px: Mapping[str, float]
    """For each pair, by the name of the depth camera's image."""
    spread_rad: float
    spread_m: float
    """RMS difference between T_H_D and the poses from single pairs."""
    dropped: tuple[str, ...]
    """Pairs excluded by the user."""
    worst: WorstView
    verdict: CalibrationVerdict
    board: BoardShape = FLAT
    """As solved with the cameras."""
    left_out: int = 0
    """Number of single corners that contradict those beside them."""
    solved: tuple[CameraCalibration | None, CameraCalibration | None] = (None, None)
    """The depth and the headset camera, each by its own images; None if given."""

    def __post_init__(self) -> None:
        freeze(self, "T_H_D", np.float64, 4, 4)
        freeze(self, "covariance", np.float64, 6, 6)
        object.__setattr__(self, "residuals_px", MappingProxyType(dict(self.residuals_px)))
        errors = self.rms_px, self.spread_rad, self.spread_m, self.worst.rms_px
        if min(*errors, *self.residuals_px.values()) < 0.0:
            raise ValueError("rms_px, residuals_px, spread_rad and spread_m must not be negative")
        if self.covariance is not None:
            variances = np.linalg.eigvalsh(self.covariance)
            if variances[0] < -1e-9 * abs(variances[-1]):  # but for rounding
                raise ValueError("covariance must not hold negative variances")


def calibrate_stereo(
    pairs: Sequence[tuple[BoardImage, BoardImage]],
    depth: Camera | None = None,
    headset: Camera | None = None,
    lens: LensChoice = "full",
) -> StereoCalibration:
    """Solve T_H_D from pairs of views, taken at the same moments, of one board.

    Parameters
    ----------
    pairs : sequence of (BoardImage, BoardImage)
        The depth camera's and the headset camera's. A pair with either dropped is left out.
    depth, headset : Camera, optional
        If not given, solved from the same views, which then must be more and better.
    lens : LensChoice
        Lens model of intrinsics that are solved.

    Raises
    ------
    ViewsError
        If too few pairs show the board to both cameras, the images are of mixed resolutions or not
        of the size of given intrinsics, the cameras are swapped, one's images are mirrored, both's
        are the same, the board hardly moved, or nothing can be solved.
    """
    both = found_by_both(pairs)
    check_sizes(both, depth, headset)
    check_moved({name: pair.depth for name, pair in both.items()})
    lenses: list[LensModel | None] = [None, None]
    are_given = depth is not None and headset is not None
    of_depth = of_headset = None
    if depth is None:
        of_depth = _solved([first for first, _ in pairs], "depth", lens)
        depth, lenses[0] = of_depth.intrinsics, of_depth.lens
    if headset is None:
        of_headset = _solved([second for _, second in pairs], "headset", lens)
        headset, lenses[1] = of_headset.intrinsics, of_headset.lens
    if of_depth is None or of_headset is None:
        alone = each_alone(both, depth, headset)
    else:
        alone = _as_solved(pairs, both, of_depth, of_headset)
    fit = _fit(both, alone, (depth, headset), lenses)
    board, points_m = FLAT, max((pair.depth.points_m for pair in both.values()), key=len)
    if fit.rms_px <= MOST_BY_SHAPE * _MOST_RMS_PX:
        fit, board = solve_shape(_sightings(both), fit, lenses)
        if board.words:
            both = {
                name: Pair(board.of(pair.depth), board.of(pair.headset))
                for name, pair in both.items()
            }
            alone = each_alone(both, fit.setup.cameras[0], fit.setup.cameras[1], alone)
    if fit.rms_px > _MOST_RMS_PX:
        # Pairs that contradict each other bend intrinsics that are free until nothing is sound.
        lenses = [None, None]
        fit = _fit(both, alone, (depth, headset), lenses)
        _check_not_swapped(both, (depth, headset), fit.rms_px, are_given)
        _check_not_mirrored(both, (depth, headset), fit.rms_px)
    depth, headset = fit.setup.cameras
    if fit.setup.place is None:
        raise ValueError("a fit of two cameras has their pose")
    T_H_D = as_transform(fit.setup.place)
    T_D_B = {name: as_transform(pose) for name, pose in zip(both, fit.setup.poses, strict=True)}
    off_px = [off[kept] for off, kept in zip(fit.off_px, fit.kept, strict=True)]
    residuals_px = {
        name: rms(np.vstack(off_px[2 * number : 2 * number + 2]))
        for number, name in enumerate(both)
    }
    if not are_given:
        alone = each_alone(both, depth, headset, alone)
    worst = _worst(both, fit, T_H_D, T_D_B)
    apart = differences(T_H_D, alone.T_H_D)
    covariance = fit.covariance()
    return StereoCalibration(
        T_H_D=T_H_D,
        covariance=None if covariance is None else covariance[:6, :6],
        depth=depth,
        headset=headset,
        rms_px=fit.rms_px,
        residuals_px=residuals_px,
        spread_rad=float(np.sqrt(np.mean(apart[:, 0] ** 2))),
        spread_m=float(np.sqrt(np.mean(apart[:, 1] ** 2))),
        dropped=tuple(first.name for first, second in pairs if first.dropped or second.dropped),
        worst=worst,
        verdict=_judge(
            fit,
            covariance,
            lenses,
            T_D_B,
            points_m,
            why_apart(both, alone, np.array(list(residuals_px.values()))),
            worst,
            board,
        ),
        board=board,
        left_out=fit.left_out,
        solved=(of_depth, of_headset),
    )


def _solved(views: Sequence[BoardImage], which: str, lens: LensChoice) -> CameraCalibration:
    try:
        calibration = calibrate_camera(views, lens)
    except ViewsError as error:
        raise ViewsError(f"{which} camera: {error.what}", error.advice) from error
    if calibration.verdict.name == "bad":
        raise ViewsError(f"{which} camera: {calibration.verdict.reason}")
    return calibration


def _as_solved(
    pairs: Sequence[tuple[BoardImage, BoardImage]],
    both: Mapping[str, Pair],
    depth: CameraCalibration,
    headset: CameraCalibration,
) -> Alone:
    """Return the board's poses in the images as the solutions of the cameras have them."""
    names = [(first.name, second.name) for first, second in pairs if first.name in both]
    residuals_px = [(depth.residuals_px[a], headset.residuals_px[b]) for a, b in names]
    return Alone(
        np.stack([depth.T_C_B[name] for name, _ in names]),
        np.stack([headset.T_C_B[name] for _, name in names]),
        np.sqrt(np.mean(np.square(residuals_px), axis=1)),
    )


def _fit(
    both: Mapping[str, Pair],
    alone: Alone,
    cameras: tuple[Camera, Camera],
    lenses: Sequence[LensModel | None],
) -> Adjusted:
    """Adjust the cameras' pose, the board's in each pair, and intrinsics that are not given."""
    T_H_D = alone.T_H_D
    place = as_vector(T_H_D[middle(T_H_D)])
    poses = tuple(as_vector(T) for T in alone.T_D_B)
    return adjust(_sightings(both), Setup(cameras, poses, place), lenses)


def _sightings(both: Mapping[str, Pair]) -> list[Sighting]:
    return [
        Sighting(number, camera, seen)
        for number, pair in enumerate(both.values())
        for camera, seen in enumerate((pair.depth, pair.headset))
    ]


def _rms_px(both: Mapping[str, Pair], cameras: tuple[Camera, Camera]) -> float:
    """Return the residual with given intrinsics; infinite if there is no solution."""
    try:
        return _fit(both, each_alone(both, *cameras), cameras, (None, None)).rms_px
    except ViewsError:
        return np.inf


def _check_not_swapped(
    both: Mapping[str, Pair], cameras: tuple[Camera, Camera], rms_px: float, are_given: bool
) -> None:
    depth, headset = cameras
    same_size = (depth.width, depth.height) == (headset.width, headset.height)
    if are_given and same_size and _rms_px(both, (headset, depth)) < rms_px / 2:
        raise ViewsError(SWAPPED)


def _check_not_mirrored(
    both: Mapping[str, Pair], cameras: tuple[Camera, Camera], rms_px: float
) -> None:
    """Raise ViewsError if the pairs fit far better with one camera's images mirrored."""
    if any(_rms_px(*trial) < rms_px / 2 for trial in _unmirrored(both, *cameras)):
        raise ViewsError(
            "one camera's images are mirrored, the other's not: switch that off in the camera "
            "(letters in its images, or a ChArUco board, show which)"
        )


def _unmirrored(
    both: Mapping[str, Pair], depth: Camera, headset: Camera
) -> Iterator[tuple[dict[str, Pair], tuple[Camera, Camera]]]:
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
            yield pairs, (depth, camera)


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
    both: Mapping[str, Pair], fit: Adjusted, T_H_D: Float64, T_D_B: Mapping[str, Float64]
) -> WorstView:
    """Return the worst image of either camera."""
    found: dict[str, BoardView] = {}
    off_px, tilts = {}, {}
    residuals = iter(zip(fit.off_px, fit.kept, strict=True))
    for name, pair in both.items():
        poses = T_D_B[name], T_H_D @ T_D_B[name]
        for which, seen, T_C_B in zip(
            ("depth", "headset"), (pair.depth, pair.headset), poses, strict=True
        ):
            image = f"{which} camera's of {name}"
            off, kept = next(residuals)
            found[image], off_px[image] = seen.only(kept), off[kept]
            tilts[image] = tilt(T_C_B, seen)
    return worst_view(found, off_px, tilts)


def _judge(
    fit: Adjusted,
    covariance: Float64 | None,
    lenses: Sequence[LensModel | None],
    T_D_B: Mapping[str, Float64],
    points_m: Float64,
    apart: tuple[str, bool],
    worst: WorstView,
    board: BoardShape,
) -> CalibrationVerdict:
    rms_px = fit.rms_px
    why, is_few = apart
    if rms_px > _MOST_RMS_PX or (why and not is_few):
        trouble = why or f"drop the worst image, {worst.name}: {worst.why}"
        limit = f", more than {_MOST_RMS_PX:g}" if rms_px > _MOST_RMS_PX else ""
        return CalibrationVerdict("bad", f"corners are {rms_px:.2f} px off{limit}: {trouble}")
    spread_rad = normal_spread(T_D_B)
    if covariance is None or spread_rad < _GOOD_SPREAD_RAD / 4:
        return CalibrationVerdict(
            "bad",
            "all pairs show the board at nearly one angle: tilt it by 20° to 45° in all directions",
        )
    place = np.zeros(6) if fit.setup.place is None else fit.setup.place
    shift_m = float(np.linalg.norm(place[3:]))
    if shift_m > _MOST_SHIFT_M:
        return CalibrationVerdict(
            "bad",
            f"the cameras come out {1e3 * shift_m:.0f} mm apart: is the squares' side right, and "
            "are both on the headset?",
        )
    angle_sigma, shift_sigma = (
        float(np.sqrt(np.linalg.eigvalsh(part).max()))
        for part in (covariance[:3, :3], covariance[3:6, 3:6])
    )
    # In proportion to the squares, whose side nothing here can tell.
    known = (
        f"± {np.degrees(angle_sigma):.3f}°, ± {1e3 * shift_sigma:.2f} mm if a square is exactly "
        f"{1e3 * square_m(points_m):.2f} mm (1 % more is {10 * shift_m:.1f} mm more)"
    )
    wanting = [why] if why else []
    if len(T_D_B) < _GOOD_PAIRS:
        wanting.append(f"{len(T_D_B)} pairs, {ASKED_VIEWS} are better")
    if spread_rad < _GOOD_SPREAD_RAD:
        wanting.append(f"the board was tilted by {np.degrees(spread_rad):.0f}° only")
    if angle_sigma > _GOOD_ANGLE_RAD or shift_sigma > _GOOD_SHIFT_M:
        wanting.append(f"the pose is not known well: {known}")
    if wanting:
        limits = _GOOD_ANGLE_RAD, _GOOD_SHIFT_M
        add = next_pair(fit.setup, lenses, covariance, points_m, rms_px / np.sqrt(2), limits)
        if add is not None:
            wanting.append(f"next, the board {add.words} (in the depth camera's image)")
        return CalibrationVerdict("needs more views", "; ".join(wanting) + board.also)
    return CalibrationVerdict(
        "good",
        f"corners are {rms_px:.2f} px off in {len(T_D_B)} pairs; the pose is known to {known}"
        + board.also,
    )


MIN_PAIRS = 3
SWAPPED = "the cameras are swapped: the depth camera's images are the headset's, and the reverse"
_MIN_SHARED_CORNERS = 8
# A single good pair gives the distance of the cameras to a few millimetres.
_DISAGREE_M = 0.02
_DISAGREE_RAD = 0.1
# A pair's residual is more than this, and this times that of its two images solved separately.
_APART_PX, _APART_TIMES = 0.2, 1.5
_MAX_SHIFT = 5


@dataclass(frozen=True, slots=True, eq=False)
class Pair:
    """Corners that both cameras see."""

    depth: BoardView
    headset: BoardView


@dataclass(frozen=True, slots=True, eq=False)
class Alone:
    """The board's pose in each image, solved separately."""

    T_D_B: Float64
    T_H_B: Float64
    """(N, 4, 4); of each pair."""
    rms_px: Float64
    """(N,); over both images."""

    @property
    def T_H_D(self) -> Float64:
        """The cameras' pose by each pair, (N, 4, 4)."""
        return np.asarray(self.T_H_B @ np.linalg.inv(self.T_D_B), np.float64)


def found_by_both(pairs: Sequence[tuple[BoardImage, BoardImage]]) -> dict[str, Pair]:
    """Return the corners that both cameras see, by the name of the depth camera's image.

    Raises
    ------
    ViewsError
        If fewer than `MIN_PAIRS` pairs have any, or all pairs are of equal images.
    """
    both = {}
    for first, second in pairs:
        if first.found and second.found and not (first.dropped or second.dropped):
            _, of_first, of_second = np.intersect1d(
                first.found.ids, second.found.ids, assume_unique=True, return_indices=True
            )
            if len(of_first) >= _MIN_SHARED_CORNERS:
                both[first.name] = Pair(first.found.only(of_first), second.found.only(of_second))
    if len(both) < MIN_PAIRS:
        problems = {view.problem for pair in pairs for view in pair if view.problem}
        seen = f": {'; '.join(sorted(problems)[:3])}" if problems else ""
        raise ViewsError(
            f"both cameras see the board in {len(both)} of {len(pairs)} pairs used, at least "
            f"{MIN_PAIRS} are needed{seen}"
        )
    if all(np.array_equal(pair.depth.pixels, pair.headset.pixels) for pair in both.values()):
        raise ViewsError("both cameras' images are the same: choose each camera's own")
    return both


def check_sizes(both: Mapping[str, Pair], depth: Camera | None, headset: Camera | None) -> None:
    """Raise ViewsError unless the images are of the size of given intrinsics."""
    sizes = (
        one_size({name: pair.depth for name, pair in both.items()}),
        one_size({name: pair.headset for name, pair in both.items()}),
    )
    wanted = [(given.width, given.height) if given else None for given in (depth, headset)]
    if all(want in (None, size) for want, size in zip(wanted, sizes, strict=True)):
        return
    if all(want in (None, size) for want, size in zip(wanted, sizes[::-1], strict=True)):
        raise ViewsError(SWAPPED)
    for which, want, size in zip(("depth", "headset"), wanted, sizes, strict=True):
        if want is not None and want != size:
            raise ViewsError(
                f"the {which} camera's intrinsics are for {want[0]}x{want[1]} pixels, its images "
                f"have {size[0]}x{size[1]}"
            )


def each_alone(
    both: Mapping[str, Pair], depth: Camera, headset: Camera, start: Alone | None = None
) -> Alone:
    """Solve the board's pose in each image separately.

    Parameters
    ----------
    both : mapping of name to Pair
    depth, headset : Camera
    start : Alone, optional
        The same with similar cameras.

    Raises
    ------
    ViewsError
        If an image has no solution.
    """
    poses, off_px = [], []
    for camera, views, known in (
        (depth, [pair.depth for pair in both.values()], start.T_D_B if start else None),
        (headset, [pair.headset for pair in both.values()], start.T_H_B if start else None),
    ):
        found = []
        for number, (name, seen) in enumerate(zip(both, views, strict=True)):
            T = first_pose(seen, camera) if known is None else known[number]
            if T is None:
                raise ViewsError(f"the board's pose in pair {name} cannot be solved: drop it")
            found.append(as_vector(T))
        sightings = [Sighting(number, 0, seen) for number, seen in enumerate(views)]
        fit = adjust(sightings, Setup((camera,), tuple(found)), [None])
        poses.append(np.stack([as_transform(pose) for pose in fit.setup.poses]))
        off_px.append([off[kept] for off, kept in zip(fit.off_px, fit.kept, strict=True)])
    squares = [rms(np.vstack(offs)) for offs in zip(*off_px, strict=True)]
    return Alone(poses[0], poses[1], np.array(squares))


def middle(T_H_D: Float64) -> int:
    """Return which of the poses (N, 4, 4) is nearest to the others."""
    each = _apart(differences(T_H_D[:, None], T_H_D))
    return int(np.median(each, axis=1).argmin())


def differences(T: Float64, others: Float64) -> Float64:
    """Return rotation (rad) and distance (m) between poses (…, 4, 4), (…, 2)."""
    turns = others[..., :3, :3] @ T[..., :3, :3].swapaxes(-1, -2)
    turned_rad = Rotation.from_matrix(turns.reshape(-1, 3, 3)).magnitude()
    shifts_m = np.linalg.norm(others[..., :3, 3] - T[..., :3, 3], axis=-1)
    return np.stack([turned_rad.reshape(shifts_m.shape), shifts_m], axis=-1)


def why_apart(both: Mapping[str, Pair], alone: Alone, joint_px: Float64) -> tuple[str, bool]:
    """Return why pairs contradict each other, empty if they do not; True if only a few do.

    Parameters
    ----------
    both : mapping of name to Pair
    alone : Alone
        With the same intrinsics as the joint solution.
    joint_px : (N,) float64
        Residual of each pair in the joint solution.
    """
    names = np.array(list(both))
    is_off = (joint_px > _APART_TIMES * alone.rms_px) & (joint_px - alone.rms_px > _APART_PX)
    if not is_off.any():
        return "", False
    T_H_D = alone.T_H_D
    apart = differences(T_H_D[middle(T_H_D)], T_H_D)
    agree = _apart(apart) < 1.0
    if 2 * agree.sum() <= len(names):
        return (
            _shifted(alone)
            or _flipped(both, alone)
            or (
                "almost no two pairs agree, though the board's pose in each image is sound (to "
                f"{np.median(alone.rms_px):.2f} px): the two images of a pair were not taken at "
                "the same moment; synchronise the cameras, or hold the board on a stand"
            )
        ), False
    if not agree.all():
        odd = int(_apart(apart).argmax())
        return (
            _flipped(both, alone)
            or (
                f"pair {names[odd]} alone puts the cameras {1e3 * apart[odd, 1]:.0f} mm and "
                f"{np.degrees(apart[odd, 0]):.1f}° elsewhere: the board moved between its two "
                "exposures, or they do not belong together; drop it"
            )
        ), False
    if 2 * is_off.sum() > len(names):
        return (
            f"the cameras are not synchronised: the board's pose in each image is sound (to "
            f"{np.median(alone.rms_px):.2f} px), but not together (to {np.median(joint_px):.2f} "
            "px): the board moved between the two exposures of most pairs; synchronise the "
            "cameras, or hold the board on a stand"
        ), False
    listed = ", ".join(names[is_off][:10])
    return f"the board moved between the two exposures of {listed}: drop them", True


def _apart(differences: Float64) -> Float64:
    """Return the differences (…, 2) as one number each: 1 is as much as good pairs may differ."""
    worst: Float64 = np.max(differences / [_DISAGREE_RAD, _DISAGREE_M], axis=-1)
    return worst


def _shifted(alone: Alone) -> str:
    """Return a message if the pairs agree once one camera's images are counted from another."""
    count = len(alone.T_D_B)
    for shift in sorted(range(-_MAX_SHIFT, _MAX_SHIFT + 1), key=abs):
        first = slice(max(0, -shift), count - max(0, shift))
        second = slice(max(0, shift), count - max(0, -shift))
        moved = replace(alone, T_D_B=alone.T_D_B[first], T_H_B=alone.T_H_B[second])
        if shift and count - abs(shift) >= MIN_PAIRS:
            T_H_D = moved.T_H_D
            if np.mean(_apart(differences(T_H_D[middle(T_H_D)], T_H_D)) < 1.0) > 0.8:
                return (
                    "almost no two pairs agree, but the depth camera's image N and the headset "
                    f"camera's N{shift:+d} do: give both images of a moment the same number"
                )
    return ""


def _flipped(both: Mapping[str, Pair], alone: Alone) -> str:
    """Return a message if pairs agree once the board is turned by 180° in one camera's images."""
    views = list(both.values())
    points_m = [pair.depth.points_m for pair in views]
    extent_m = (
        np.min([p.min(axis=0) for p in points_m], axis=0),
        np.max([p.max(axis=0) for p in points_m], axis=0),
    )
    turn = rigid([0.0, 0.0, np.pi])
    turn[:3, 3] = extent_m[0] + extent_m[1]
    turned = replace(alone, T_H_B=alone.T_H_B @ turn)
    T_H_D = np.concatenate([alone.T_H_D, turned.T_H_D])
    count = len(views)
    best = T_H_D[middle(T_H_D)]
    near = (_apart(differences(best, T_H_D)) < 1.0).reshape(2, count)
    as_is, as_turned = near[0] & ~near[1], near[1] & ~near[0]
    if near.any(axis=0).mean() < 0.8 or not (as_is.any() and as_turned.any()):
        return ""
    fewer = as_is if as_is.sum() <= as_turned.sum() else as_turned
    names = ", ".join(np.array(list(both))[fewer][:5])
    return (
        f"the cameras take opposite corners of the board for its first in some pairs (as {names}): "
        "it looks the same turned by 180°; use a board with an even and an odd number of squares, "
        "or a ChArUco board"
    )

"""Pairs of views of one board by two cameras, and why pairs contradict each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from handcal.core.geometry import rigid
from handcal.core.types import Float64
from handcal.rig.boards.board import BoardView
from handcal.rig.boards.views import BoardImage, ViewsError, one_size
from handcal.rig.lens.bundle import adjust
from handcal.rig.lens.fit import rms
from handcal.rig.lens.lens import Camera, first_pose
from handcal.rig.lens.reprojection import Setup, Sighting, as_transform, as_vector

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

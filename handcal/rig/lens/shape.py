"""The shape of a printed board, solved with the cameras.

No board is as entered: paper bends, printers stretch, a row is printed beside its place. As mrcal
does, the bundle adjustment solves for the board, too: first how it bends and is stretched as a
whole, then where each corner is. The simplest shape that foresees views left out as well as any is
taken. What the views leave open of it is in the covariance of the cameras also of a flat board.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from handcal.core.types import Float64
from handcal.rig.boards.board import BoardView, square_m
from handcal.rig.boards.views import ViewsError
from handcal.rig.lens.bundle import (
    Adjusted,
    Problem,
    Setup,
    Sighting,
    adjust,
    as_transform,
    as_vector,
    kept_by_all,
    kept_only,
)
from handcal.rig.lens.lens import Camera, LensModel, first_pose

# Priors of boards in labs, one standard deviation: the height of a bend or a twist as a share of
# the board's width, the stretch in one direction, the shear, and a corner in squares.
_BENT, _STRETCHED, _SHEARED, _CORNER_SQUARES = 0.01, 0.01, 0.003, 0.02
_WHOLE = 5
MOST_BY_SHAPE = 5.0
"""A residual larger than good by more than this factor is not of the board's shape."""
# More corners than these are freed by rows and columns.
_MOST_FREE = 200
_MOST_BY_CHANCE = 1e-4
_SURE_SIGMAS, _STANDS_OUT = 3.0, 5.0
# Of the largest deviation: smaller ones are not named.
_NAMED_SHARE = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class BoardShape:
    """The difference of a board from the grid entered."""

    words: str
    """Empty if it does not."""
    off_m: Float64
    """(N, 3); by the corners' numbers, real minus entered places, but for size and pose; empty if
    it does not."""

    is_uneven: bool = False
    """True if single corners had to be freed."""

    @property
    def also(self) -> str:
        """The ending of a sentence that says it; empty if the board does not differ."""
        return f"; the board is not as entered: {self.words} (taken into account)" * bool(
            self.words
        )

    def of(self, seen: BoardView) -> BoardView:
        """Return a view with the corners at their real places on the board."""
        return replace(seen, points_m=seen.points_m + self.off_m[seen.ids]) if self.words else seen


FLAT = BoardShape("", np.empty((0, 3)))


def solve_shape(
    sightings: Sequence[Sighting],
    flat: Adjusted,
    lenses: Sequence[LensModel | None],
) -> tuple[Adjusted, BoardShape]:
    """Solve the board's shape with what is free of the cameras.

    Parameters
    ----------
    sightings : sequence of Sighting
    flat : Adjusted
        Fit of them with the board as entered.
    lenses : sequence of LensModel or None
        As for `adjust`.

    Returns
    -------
    Adjusted
        Of a flat board the given fit, with derivatives by the shape as well, so that `covariance`
        contains what is not known of it.
    BoardShape
    """
    points_m = _points(sightings)
    whole_m = _whole_modes(points_m)
    residuals = np.concatenate([block[2] for block in flat.blocks])
    noise_px = float(np.sqrt(np.mean(residuals**2)))
    some = kept_only(sightings, flat.kept)
    problem = Problem(some, lenses, flat.setup.place is not None, whole_m, noise_px)
    start = replace(flat.setup, shape=np.zeros(_WHOLE))
    open_shape = replace(flat, blocks=problem.blocks(problem.linear(start)), noise_px=noise_px)
    if not (_bends(open_shape) or _repeats(open_shape, some, len(points_m))):
        return open_shape, FLAT
    fits = [flat, adjust(sightings, start, lenses, modes_m=whole_m, noise_px=noise_px)]
    modes_m = whole_m
    if _repeats(fits[1], kept_only(sightings, fits[1].kept), len(points_m)):
        modes_m = np.concatenate([whole_m, _corner_modes(points_m, whole_m)], axis=2)
        setup, noise_px = fits[1].setup, fits[1].rms_px / np.sqrt(2)
        shape = np.append(setup.shape, np.zeros(modes_m.shape[2] - _WHOLE))
        start = replace(setup, shape=shape)
        fits.append(adjust(sightings, start, lenses, modes_m=modes_m, noise_px=noise_px))
    best = _simplest(fits)
    if best is flat:
        return open_shape, FLAT
    off_m = modes_m[:, :, : len(best.setup.shape)] @ best.setup.shape
    return best, BoardShape(
        _words(best, points_m, off_m), off_m, best is fits[-1] and len(fits) > 2
    )


def boards_seen(
    views: Mapping[str, BoardView], camera: Camera
) -> tuple[dict[str, BoardView], BoardShape]:
    """Return views of one board by a known camera with the corners at their real places.

    Raises
    ------
    ViewsError
        If the board's pose in a view cannot be solved.
    """
    poses = []
    for name, seen in views.items():
        pose = first_pose(seen, camera)
        if pose is None:
            raise ViewsError(f"the board's pose in {name} cannot be solved: drop it")
        poses.append(as_vector(pose))
    sightings = [Sighting(number, 0, seen) for number, seen in enumerate(views.values())]
    flat = adjust(sightings, Setup((camera,), tuple(poses)), [None])
    _, board = solve_shape(sightings, flat, [None])
    return {name: board.of(seen) for name, seen in views.items()}, board


def _points(sightings: Sequence[Sighting]) -> Float64:
    """Return the corners' entered places by number, (N, 3); NaN for those never seen."""
    points_m = np.full((1 + max(int(one.seen.ids.max()) for one in sightings), 3), np.nan)
    for one in sightings:
        points_m[one.seen.ids] = one.seen.points_m
    return points_m


def _whole_modes(points_m: Float64) -> Float64:
    """Return bend along x and y, twist, stretch of x over y, and shear, (N, 3, 5)."""
    low, high = np.nanmin(points_m, axis=0), np.nanmax(points_m, axis=0)
    half_m = (high - low)[:2] / 2
    u, v = ((points_m - (low + high) / 2)[:, :2] / half_m).T
    x_m, y_m = u * half_m[0], v * half_m[1]
    modes_m = np.zeros((len(points_m), 3, _WHOLE))
    modes_m[:, 2, 0] = 2 * half_m[0] * _BENT * (1 - u * u)
    modes_m[:, 2, 1] = 2 * half_m[1] * _BENT * (1 - v * v)
    modes_m[:, 2, :2] -= np.nanmean(modes_m[:, 2, :2], axis=0)
    modes_m[:, 2, 2] = 2 * half_m.max() * _BENT * u * v
    modes_m[:, 0, 3], modes_m[:, 1, 3] = _STRETCHED / 2 * x_m, -_STRETCHED / 2 * y_m
    modes_m[:, 0, 4], modes_m[:, 1, 4] = _SHEARED / 2 * y_m, _SHEARED / 2 * x_m
    return np.nan_to_num(modes_m)


def _corner_modes(points_m: Float64, whole_m: Float64) -> Float64:
    """Return modes (N, 3, K) that free each corner, or each row and column of a large board.

    They are orthogonal to moves, turns and the size of the board, and to its shape as a whole.
    """
    is_seen = np.flatnonzero(np.isfinite(points_m[:, 0]))
    seen_m = points_m[is_seen] - np.nanmean(points_m, axis=0)
    count = len(seen_m)
    if count <= _MOST_FREE:
        free = np.eye(count)
    else:
        free = np.hstack([_indicators(seen_m[:, axis]) for axis in (0, 1)])
    x, y = seen_m[:, 0], seen_m[:, 1]
    o, i = np.zeros(count), np.ones(count)
    taken = [[i, o, o], [o, i, o], [o, o, i], [o, o, x], [o, o, y], [y, -x, o], [x, y, o]]
    columns = [np.stack(one, axis=1).ravel() for one in taken]
    fixed = np.column_stack([*columns, whole_m[is_seen].reshape(3 * count, -1)])
    basis, _ = np.linalg.qr(fixed)
    rest = np.kron(free, np.eye(3))
    rest -= basis @ (basis.T @ rest)
    U, size, _ = np.linalg.svd(rest, full_matrices=False)
    independent = U[:, size > 1e-6 * size[0]]
    modes_m = np.zeros((len(points_m), 3, independent.shape[1]))
    # Scaled so that a corner moves by the prior, however many modes share it.
    each_m = _CORNER_SQUARES * square_m(points_m) * np.sqrt(3 * count / independent.shape[1])
    modes_m[is_seen] = each_m * independent.reshape(count, 3, -1)
    return modes_m


def _indicators(values: Float64) -> Float64:
    """Return which of the distinct values (K,) each of (N,) is, (N, K)."""
    rounded = values.round(6)
    return np.asarray(rounded[:, None] == np.unique(rounded), np.float64)


def _bends(fit: Adjusted) -> bool:
    """Return whether a shape as a whole explains more than chance, by one Gauss-Newton step."""
    reduced = []
    for shared, own, residuals in fit.blocks:
        basis, _ = np.linalg.qr(own)
        reduced.append(np.column_stack([shared, residuals]))
        reduced[-1] -= basis @ (basis.T @ reduced[-1])
    normal = sum(one.T @ one for one in reduced)
    priors = np.append(fit.priors_px**2, 0.0)
    normal = normal + np.diag(priors)
    first = normal.shape[0] - 1 - _WHOLE
    shared, rest = normal[:first, :first], normal[:first, first:]
    schur = normal[first:, first:] - rest.T @ np.linalg.lstsq(shared, rest, rcond=1e-13)[0]
    explained = schur[:-1, -1] @ np.linalg.lstsq(schur[:-1, :-1], schur[:-1, -1], rcond=1e-13)[0]
    rows = sum(len(one) for one in reduced)
    noise_px2 = (schur[-1, -1] - explained) / max(rows - 6 * len(reduced) - normal.shape[0], 1)
    return bool(explained > noise_px2 * chdtri(_WHOLE, _MOST_BY_CHANCE))


def _repeats(fit: Adjusted, sightings: Sequence[Sighting], count: int) -> bool:
    """Return whether residuals repeat by corner of the board more than by chance.

    Each corner alone is moved to where its residuals are least (score test).
    """
    turned, ids, off_px = [], [], []
    for frame, ((_, own, residuals), pose) in enumerate(
        zip(fit.blocks, fit.setup.poses, strict=True)
    ):
        # The derivatives by the pose's translation, turned to the board's axes.
        turned.append((own[:, 3:] @ as_transform(pose)[:3, :3]).reshape(-1, 2, 3))
        off_px.append(residuals.reshape(-1, 2))
        ids += [one.seen.ids for one in sightings if one.frame == frame]
    J, off, of = np.concatenate(turned), np.concatenate(off_px), np.concatenate(ids)
    information, gradient = np.zeros((count, 3, 3)), np.zeros((count, 3, 1))
    np.add.at(information, of, J.swapaxes(1, 2) @ J)
    np.add.at(gradient, of, J.swapaxes(1, 2) @ off[:, :, None])
    often = np.bincount(of, minlength=count) > 2
    # From views that are all alike a corner's depth is not known.
    inverse = np.linalg.pinv(information[often], rcond=1e-12, hermitian=True)
    explained = float(np.sum(gradient[often] * (inverse @ gradient[often])))
    freedom = 3 * int(often.sum())
    rest = off.size - freedom - 6 * len(fit.blocks)
    if rest <= 0 or not freedom:
        return False
    noise_px2 = (float(np.sum(off**2)) - explained) / rest
    return bool(explained > noise_px2 * chdtri(freedom, _MOST_BY_CHANCE))


def _simplest(fits: Sequence[Adjusted]) -> Adjusted:
    """Return the first fit whose held-out error is within one standard error of the least."""
    kept = kept_by_all(fits)
    held_out_px2 = np.stack([fit.held_out_px2(kept) for fit in fits])
    least = held_out_px2[held_out_px2.mean(axis=1).argmin()]
    more_px2 = held_out_px2 - least
    error_px2 = more_px2.std(axis=1, ddof=1) / np.sqrt(more_px2.shape[1])
    return fits[int(np.flatnonzero(more_px2.mean(axis=1) <= error_px2)[0])]


def _words(fit: Adjusted, points_m: Float64, off_m: Float64) -> str:
    """Return the kinds of a board's deviation, the largest first."""
    covariance = fit.whole_covariance()
    sigma = np.ones(_WHOLE)
    if covariance is not None:
        first = len(fit.is_coefficient)
        sigma = np.sqrt(np.diag(covariance))[first : first + _WHOLE]
    modes_m, whole = _whole_modes(points_m), fit.setup.shape[:_WHOLE].copy()
    wide_m, high_m = (np.nanmax(points_m, axis=0) - np.nanmin(points_m, axis=0))[:2]
    jump, steps = _jump(points_m, off_m)
    found = [jump] if jump[1] else []
    if found:  # a stretch and a shear as the other lines show them
        (x_x, y_x), (x_y, y_y) = steps / square_m(points_m)
        whole[3:] = (x_x - y_y) / _STRETCHED, (x_y + y_x) / _SHEARED
    bent_mm = 1e3 * _BENT * np.abs(whole[:2]) * [wide_m, high_m]
    sides = ("wider than high", "higher than wide")[int(whole[3] < 0)]
    words = [
        f"bent by {bent_mm[0]:.1f} mm over its width of {1e3 * wide_m:.0f} mm",
        f"bent by {bent_mm[1]:.1f} mm over its height of {1e3 * high_m:.0f} mm",
        f"twisted by {1e3 * _BENT * abs(whole[2]) * max(wide_m, high_m):.1f} mm at its corners",
        f"printed {100 * _STRETCHED * abs(whole[3]):.2f} % {sides}: measure both sides",
        f"printed {np.degrees(_SHEARED * abs(whole[4])):.2f}° from a right angle",
    ]
    sizes_m = np.abs(modes_m * whole).max(axis=(0, 1))
    found += [
        (float(size_m), text)
        for size_m, text, value, known in zip(sizes_m, words, whole, sigma, strict=True)
        if abs(value) > _SURE_SIGMAS * known
    ]
    uneven_m = float(np.abs(off_m - modes_m @ fit.setup.shape[:_WHOLE]).max())
    if len(fit.setup.shape) > _WHOLE and not jump[1]:
        found.append((uneven_m, f"uneven: single corners are off by {1e3 * uneven_m:.2f} mm"))
    if not found:
        return f"off by up to {1e3 * np.abs(off_m).max():.2f} mm from a flat grid"
    least_m = _NAMED_SHARE * max(found)[0]
    return ", ".join(text for size_m, text in sorted(found, reverse=True) if size_m >= least_m)


def _jump(points_m: Float64, off_m: Float64) -> tuple[tuple[float, str], Float64]:
    """Return how far a row or column is off in the print, in words, and the usual steps (2, 2).

    The steps are those from column to column and from row to row, m. The size is 0 if none is off
    by far more than the others.
    """
    jumps, usual = [(0.0, "")], []
    for axis, name in ((0, "column"), (1, "row")):
        among = _indicators(points_m[:, axis])
        means_m = among.T @ off_m[:, :2] / among.sum(axis=0)[:, None]
        steps_m = np.diff(means_m, axis=0)
        usual.append(np.median(steps_m, axis=0))
        apart_m = np.linalg.norm(steps_m - usual[-1], axis=1)
        largest = int(apart_m.argmax())
        if apart_m[largest] > _STANDS_OUT * np.median(apart_m):
            text = f"a {name} of corners is off by {1e3 * apart_m[largest]:.2f} mm, at {name} "
            jumps.append((float(apart_m[largest]), text + str(largest + 2)))
    return max(jumps), np.stack(usual)

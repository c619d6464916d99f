"""The hand's silhouette as it is drawn, from the border of its depth mask.

The two differ: a depth camera shows a hand larger, or smaller, than it is (`DepthEdges`). Clouds
are registered as measured, but the wearer compares what is drawn with the hand itself.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from handcal.core.types import Bool, DepthEdges, Float64, Frame, HandCloud, Intrinsics
from handcal.hand.color_edge import find_color_edge

_SMOOTH_PX = 4.0
"""Standard deviation of the smoothing of normals: several steps of a border along pixels, less than
the width of a finger."""
_STEP_SMOOTH_PX = 2.0
"""The same for the border beside which the edge in colour is sought: only its steps vanish."""
_STEPS = 4
"""Half the points over which a fold shows: a border along pixels turns at each of them."""
_BESIDE_CUT_PX = 10
"""So far from a cut the normal would turn with the corner between cut and silhouette."""
_INSIDE_PX = 1.25
_TURNED_RIM_M = 6e-5
"""The eyes, 5 to 9 cm beside the camera, see a finger from another side, where it reaches this much
farther beyond the rim that the camera sees: 0.06 and 0.11 % in size for the left and the right eye
of simulated hands."""
_FINGER_RADIUS_M = 0.008
_LEAST_TOLD = 0.5
"""Least share of the silhouette along which colour tells the hand from the background."""
_MOST_BEYOND = 0.1
"""Largest share of it whose edge in colour is too far away: 0.05 at most in real frames, 0.2 to 0.3
if their colour is moved by 6 to 10 px."""
_COLOR_SIGMA_PX = 0.5
"""Standard deviation of an outline that follows the edge in colour, as a whole: the image's blur,
and 0.1 to 0.4 px against another method (docs/segmentation.md)."""


def with_outline(cloud: HandCloud, frame: Frame, edges: DepthEdges) -> HandCloud:
    """Return a hand with the outline that is drawn.

    It follows the hand's edge in the colour image where there is one and its colours tell the hand
    from the background, otherwise what is known of the depth camera's edges.

    Parameters
    ----------
    cloud : HandCloud
    frame : Frame
        From which the hand was segmented.
    edges : DepthEdges
    """
    contour = _Contour.of(cloud.contour_m.astype(np.float64), frame.depth_intrinsics)
    seen = _seen_in_color(contour, cloud, frame, edges) if frame.color is not None else None
    if seen is None:
        move_px, sigma_px = edges.fatten_px * contour.inward, edges.sigma_px
    else:
        move_px, sigma_px = seen
    px_m = cloud.median_depth_m / frame.depth_intrinsics.fx
    move_px = move_px - _TURNED_RIM_M / px_m * contour.inward
    outline_m = contour.moved(move_px, cloud.contour_is_cut)
    outline_m *= 1.0 + _beyond_border_m(cloud, frame.depth_intrinsics, edges) / outline_m[:, 2:]
    return replace(
        cloud,
        outline_m=outline_m.astype(np.float32),
        outline_is_cut=cloud.contour_is_cut,
        outline_sigma_px=sigma_px,
    )


def _beyond_border_m(cloud: HandCloud, intrinsics: Intrinsics, edges: DepthEdges) -> float:
    """Return how far the rim, where a finger turns away, is behind what border pixels measure.

    In stereo images their depth is that of a finger's front a pixel and a quarter inside its rim
    (2.9 mm nearer at 0.43 m, 3.4 mm at 0.59 m in a D415's images of simulated hands), otherwise
    half a pixel (3.5 mm at 0.43 m in AHAT's). The eyes, beside the camera and behind it, would see
    a rim at that depth shifted and smaller.
    """
    px_m = cloud.median_depth_m / intrinsics.fx
    inside_px = _INSIDE_PX if edges.fatten_px > 0.0 else 0.5
    return float(np.sqrt(2.0 * _FINGER_RADIUS_M * inside_px * px_m))


def moved_inward(
    contour_m: Float64, intrinsics: Intrinsics, by_px: float, is_cut: Bool | None = None
) -> Float64:
    """Move a closed contour inward in the image, each point at its depth.

    Where the contour would fold, in sharp corners, the points follow their neighbours. A cut is no
    edge of the hand: only its ends move, with the silhouette that they adjoin.

    Parameters
    ----------
    contour_m : (N, 3) float64
        Closed, in order, in frame D.
    intrinsics : Intrinsics
        Of the depth camera.
    by_px : float
        Negative: outward.
    is_cut : (N,) bool, optional
        True on a cut edge.

    Returns
    -------
    (N, 3) float64
    """
    contour = _Contour.of(np.asarray(contour_m, np.float64), intrinsics)
    if is_cut is None:
        is_cut = np.zeros(len(contour_m), np.bool_)
    return contour.moved(by_px * contour.inward, is_cut)


@dataclass(frozen=True, slots=True, eq=False)
class _Contour:
    """A closed contour and its place in the image of an undistorted lens."""

    points_m: Float64
    """(N, 3); frame D."""
    focal_px: Float64
    """(2,)."""
    place_px: Float64
    """(N, 2); from the principal point."""
    inward: Float64
    """(N, 2); smoothed normals in the image, unit vectors."""

    @classmethod
    def of(cls, points_m: Float64, intrinsics: Intrinsics) -> Self:
        focal_px = np.array([intrinsics.fx, intrinsics.fy])
        place_px = points_m[:, :2] / points_m[:, 2:] * focal_px
        return cls(points_m, focal_px, place_px, inward_normals(place_px))

    def in_space(self, move_px: Float64) -> Float64:
        """Return movements (N, 3) in metres, at each point's depth."""
        move_m = np.zeros_like(self.points_m)
        move_m[:, :2] = move_px / self.focal_px * self.points_m[:, 2:]
        return move_m

    def moved(self, move_px: Float64, is_cut: Bool) -> Float64:
        """Return the points moved (N, 3), except where cuts or folds make them follow others."""
        kept = ~_widened(is_cut)
        before_px, after_px = (
            np.roll(one, -_STEPS, axis=0) - np.roll(one, _STEPS, axis=0)
            for one in (self.place_px, self.place_px + move_px)
        )
        kept &= np.einsum("ij,ij->i", before_px, after_px) > 0.0
        if not kept.any():
            return self.points_m
        at, known, turn = np.arange(len(kept)), np.flatnonzero(kept), len(kept)
        if len(known) < turn:
            move_px = np.column_stack(
                [np.interp(at, known, one, period=turn) for one in move_px[known].T]
            )
        return self.points_m + self.in_space(move_px)


def _seen_in_color(
    contour: _Contour, cloud: HandCloud, frame: Frame, edges: DepthEdges
) -> tuple[Float64, float] | None:
    """Return movements to the edge in colour (N, 2), in pixels, and their standard deviation.

    None if it cannot be seen along most of the silhouette, or not near enough: the hand may have
    moved between both images.
    """
    smooth_px = _smoothed(contour.place_px, _STEP_SMOOTH_PX)
    to_smooth_px = smooth_px - contour.place_px
    px_m = cloud.median_depth_m / float(contour.focal_px[0])
    found = find_color_edge(
        frame,
        contour.points_m + contour.in_space(to_smooth_px),
        contour.in_space(contour.inward),
        px_m,
        edges.fatten_px,
    )
    is_silhouette = ~cloud.contour_is_cut
    told = float(found.is_told[is_silhouette].mean()) if is_silhouette.any() else 0.0
    if told < _LEAST_TOLD or found.beyond > _MOST_BEYOND:
        return None
    sigma_px = told * _COLOR_SIGMA_PX + (1.0 - told) * edges.sigma_px
    return to_smooth_px + found.inward_px[:, None] * contour.inward, sigma_px


def inward_normals(closed_px: Float64) -> Float64:
    """Return the normals of a closed contour, smoothed.

    Parameters
    ----------
    closed_px : (N, 2) float64
        In order, in either direction; the points are about a pixel apart.

    Returns
    -------
    (N, 2) float64
        Unit vectors.
    """
    z = closed_px @ [1.0, 1j]
    z -= z.mean()
    frequency = 2.0 * np.pi * np.fft.fftfreq(len(z))
    derivative = 1j * frequency * np.exp(-0.5 * (frequency * _SMOOTH_PX) ** 2)
    along = np.fft.ifft(derivative * np.fft.fft(z))
    twice_area_px = np.sum(np.imag(np.conj(z) * np.roll(z, -1)))
    inward = 1j * np.sign(twice_area_px) * along / np.maximum(np.abs(along), 1e-9)
    return np.column_stack([inward.real, inward.imag])


def _smoothed(closed_px: Float64, sigma: float) -> Float64:
    """Return a closed contour (N, 2) smoothed along it by a Gaussian, in points."""
    frequency = 2.0 * np.pi * np.fft.fftfreq(len(closed_px))
    passed = np.exp(-0.5 * (frequency * sigma) ** 2)
    return np.fft.ifft(passed[:, None] * np.fft.fft(closed_px, axis=0), axis=0).real


def _widened(is_cut: Bool) -> Bool:
    """Return the points of a closed contour that are on a cut or at most `_BESIDE_CUT_PX` away."""
    around = np.ones(2 * _BESIDE_CUT_PX + 1)
    ends = np.pad(is_cut.astype(float), _BESIDE_CUT_PX, mode="wrap")
    widened: Bool = np.convolve(ends, around, mode="valid") > 0.5
    return widened

"""The hand's silhouette as it is drawn, from the border of its depth mask.

The two differ: a depth camera shows a hand larger, or smaller, than it is (`DepthEdges`). Clouds
are registered as measured, but the wearer compares what is drawn with the hand itself.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from handcal.core.types import Bool, DepthEdges, Float64, HandCloud, Intrinsics

_SMOOTH_PX = 4.0
"""Standard deviation of the smoothing of normals: several steps of a border along pixels, less than
the width of a finger."""
_STEPS = 4
"""Half the points over which a fold shows: a border along pixels turns at each of them."""
_BESIDE_CUT_PX = 10
"""So far from a cut the normal would turn with the corner between cut and silhouette."""


def with_outline(cloud: HandCloud, intrinsics: Intrinsics, edges: DepthEdges) -> HandCloud:
    """Return a hand with the outline that its depth camera's edges suggest.

    Parameters
    ----------
    cloud : HandCloud
    intrinsics : Intrinsics
        Of the depth camera.
    edges : DepthEdges
    """
    contour_m = cloud.contour_m.astype(np.float64)
    outline_m = moved_inward(contour_m, intrinsics, edges.fatten_px, cloud.contour_is_cut)
    return replace(
        cloud,
        outline_m=outline_m.astype(np.float32),
        outline_is_cut=cloud.contour_is_cut,
        outline_sigma_px=edges.sigma_px,
    )


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
    contour_m = np.asarray(contour_m, np.float64)
    if len(contour_m) < 3 or not by_px:
        return contour_m
    focal_px = np.array([intrinsics.fx, intrinsics.fy])
    place_px = contour_m[:, :2] / contour_m[:, 2:] * focal_px
    move_px = by_px * inward_normals(place_px)
    kept = np.ones(len(contour_m), np.bool_) if is_cut is None else ~_widened(is_cut)
    before_px, after_px = (
        np.roll(one, -_STEPS, axis=0) - np.roll(one, _STEPS, axis=0)
        for one in (place_px, place_px + move_px)
    )
    kept &= np.einsum("ij,ij->i", before_px, after_px) > 0.0
    if not kept.any():
        return contour_m
    if not kept.all():
        at, known, turns = np.arange(len(kept)), np.flatnonzero(kept), len(kept)
        move_px = np.column_stack(
            [np.interp(at, known, one, period=turns) for one in move_px[known].T]
        )
    moved_m = contour_m.copy()
    moved_m[:, :2] += move_px / focal_px * contour_m[:, 2:]
    return moved_m


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


def _widened(is_cut: Bool) -> Bool:
    """Return the points of a closed contour that are on a cut or at most `_BESIDE_CUT_PX` away."""
    around = np.ones(2 * _BESIDE_CUT_PX + 1)
    ends = np.pad(is_cut.astype(float), _BESIDE_CUT_PX, mode="wrap")
    widened: Bool = np.convolve(ends, around, mode="valid") > 0.5
    return widened

"""Measurement errors of a stereo depth camera.

Modelled on the Intel RealSense D415: the depth image is that of the left imager, and depth comes
from the disparity d = f B / z to the right imager, so that σz = z² σd / (f B).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import cv2
import numpy as np
from scipy.special import ndtri

from handcal.core.types import Bool, Float32, UInt16

SensorName: TypeAlias = Literal["d415", "ahat", "exact"]
"""A stereo camera with its faults at edges, a time-of-flight camera, and a stereo camera whose
edges are where those of the hand are."""


@dataclass(frozen=True, slots=True)
class SensorSettings:
    """Settings of the depth sensor."""

    fatten_px: float = 0.0
    """Width by which near surfaces grow over what is behind them, half of the matching window; on a
    D4xx 1 to 3 px. Of a fraction, as large a share of the edges grows by one more."""
    disparities: int | None = None
    """Number of disparities that the matching tries, 126 on a D4xx: what is nearer than f B over
    the largest of them, 0.44 m at 1280x720, has no depth. None: as many as needed."""
    disparity_shift: int = 0
    """Smallest disparity that it tries. A shift brings the nearest distance closer and loses what
    is farther than f B over the shift."""
    depth_scale_m: float = 0.0001
    """Metres per unit."""


_BASELINE_M = 0.055  # between the imagers of a D415 (data sheet)
_DISPARITY_SIGMA_PX = 0.08  # subpixel error of the matching
# Standard deviation of the Gaussian that correlates the errors of neighbours, which share matching
# windows.
_CORRELATION_PX = 2.0
_DISPARITY_STEP_PX = 1.0 / 32.0  # resolution of a D4xx's matching
# Width of the band along a depth edge where the matching window sees both sides, and the shares of
# the pixels in it without depth, and with a depth in between. A disparity difference above the last
# one is an edge, not a slope.
_EDGE_PX, _EDGE_HOLES, _EDGE_FLYING, _EDGE_STEP_PX = 3, 0.35, 0.15, 4.0
# Size of the patches in which an edge grows by one pixel more.
_PATCH_PX = 6.0


D415_FATTEN_PX = 2.35
"""With it the border of a simulated hand's mask lies as far outside the hand as in real frames, by
1.8 px (docs/segmentation.md)."""


PHASE_BORDER_PX = -0.5
"""Distance of that border outside the hand with a camera without matching windows, the centres of
whose outermost pixels lie inside."""


def fatten_of(name: SensorName, fatten_px: float | None) -> float:
    """Return how much the edges of a stereo camera grow, px, unless it is given."""
    usual_px = D415_FATTEN_PX if name == "d415" else 0.0
    return usual_px if fatten_px is None else fatten_px


EDGE_SIGMA_PX = 0.2
"""Standard deviation with which a depth check finds `border_px`."""


def border_px(fatten_px: float) -> float:
    """Return how far the border of a simulated hand's mask lies outside the hand, px.

    A line fitted to hands at 0.5 m with growths of 1 to 5 px, which it meets within 0.1 px: holes
    and flying pixels at the edge, which the mask leaves out, take one pixel back.
    """
    return 1.19 * fatten_px - 1.0


def fatten_for(border_px: float) -> float:
    """Return the growth with which the border lies as far outside: the reverse of `border_px`."""
    return (border_px + 1.0) / 1.19


def sense_depth(
    depth_m: Float32, focal_px: float, rng: np.random.Generator, settings: SensorSettings
) -> UInt16:
    """Return the measurement of an ideal depth image.

    Parameters
    ----------
    depth_m : (H, W) float32
        Positive everywhere.
    focal_px : float
        Horizontal focal length.
    rng : numpy.random.Generator
    settings : SensorSettings

    Returns
    -------
    (H, W) uint16
        In units of `settings.depth_scale_m`; 0 where there is no measurement.
    """
    fB = focal_px * _BASELINE_M
    disparity = np.float32(fB) / depth_m
    hidden = _not_tried(disparity, settings)
    if settings.fatten_px:
        disparity = _fattened(disparity, settings.fatten_px, rng)
    hidden |= _hidden_from_the_right(disparity)
    hidden |= _blur_edges(disparity, rng)
    noise_px = _correlated_noise(disparity.shape, _CORRELATION_PX, rng)
    disparity += _DISPARITY_SIGMA_PX * noise_px
    np.rint(disparity / _DISPARITY_STEP_PX, out=disparity)
    units = fB / _DISPARITY_STEP_PX / settings.depth_scale_m
    # OpenCV rounds, saturates, and gives 0 for a disparity of 0.
    measured = np.asarray(cv2.divide(units, disparity, dtype=cv2.CV_16U), dtype=np.uint16)
    measured[hidden] = 0
    return measured


def _fattened(disparity: Float32, by_px: float, rng: np.random.Generator) -> Float32:
    """Return a disparity image whose near surfaces have grown by a width."""
    whole = int(by_px)

    def grown(px: int) -> Float32:
        window = np.ones((2 * px + 1,) * 2, dtype=np.uint8)
        return np.asarray(cv2.dilate(disparity, window), dtype=np.float32)

    if whole == by_px:
        return grown(whole)
    more = _correlated_noise(disparity.shape, _PATCH_PX, rng) < ndtri(by_px - whole)
    return np.where(more, grown(whole + 1), grown(whole))


def _not_tried(disparity: Float32, settings: SensorSettings) -> Bool:
    """Return the pixels whose disparity is not among those that the matching tries."""
    missed = disparity < settings.disparity_shift
    if settings.disparities is not None:
        missed |= disparity > settings.disparity_shift + settings.disparities
    return np.asarray(missed)


def _hidden_from_the_right(disparity: Float32) -> Bool:
    """Return the pixels hidden from the right imager by a nearer surface.

    Pixel u appears at u − d there. A point to its right in the left image that appears at or left
    of it there occludes it.
    """
    right_px = np.arange(disparity.shape[1], dtype=np.float32) - disparity
    leftmost = np.minimum.accumulate(right_px[:, ::-1], axis=1)[:, ::-1]
    return right_px > leftmost


def _blur_edges(disparity: Float32, rng: np.random.Generator) -> Bool:
    """Spread flying pixels along depth edges, in place, and return where the edges are holes."""
    window = np.ones((_EDGE_PX, _EDGE_PX), dtype=np.uint8)
    far, near = cv2.erode(disparity, window), cv2.dilate(disparity, window)
    edge = np.flatnonzero(near - far > _EDGE_STEP_PX)
    fate = rng.random(len(edge))
    holes = np.zeros(disparity.shape, dtype=np.bool_)
    holes.flat[edge[fate < _EDGE_HOLES]] = True
    flying = edge[fate > 1.0 - _EDGE_FLYING]
    share = rng.random(len(flying), dtype=np.float32)
    disparity.flat[flying] = far.flat[flying] + share * (near.flat[flying] - far.flat[flying])
    return holes


def _correlated_noise(
    shape: tuple[int, ...], correlation_px: float, rng: np.random.Generator
) -> Float32:
    """Return correlated Gaussian noise of unit variance, drawn at half resolution."""
    half = rng.standard_normal((shape[0] // 2 + 1, shape[1] // 2 + 1), dtype=np.float32)
    smooth = cv2.GaussianBlur(half, (0, 0), correlation_px / 2.0)
    noise = np.asarray(cv2.resize(smooth, (shape[1], shape[0])), dtype=np.float32)
    noise /= noise.std()
    return noise

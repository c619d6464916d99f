"""The hand's silhouette as it is drawn, from the border of its depth mask.

The two differ: a depth camera shows a hand larger, or smaller, than it is (`DepthEdges`). Clouds
are registered as measured, but the wearer compares what is drawn with the hand itself. So the
outline follows the hand's edge in the colour image where it is seen.

Along each normal of the border the colours at the inner end are the hand's, those at the outer end
the background's. Between them every sample is more likely of one or the other, and the edge lies
where that changes: the cheapest path around the hand, by dynamic programming.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from handcal.core.geometry import image_points, transform
from handcal.core.types import Bool, DepthEdges, Float32, Float64, Frame, HandCloud, Intrinsics, Rig

_STEREO = DepthEdges(fatten_px=1.8, sigma_px=0.7, source="typical")
"""Active stereo: half of the matching window, 1 to 3 px on a D4xx; 1.0 to 2.4 px, 1.8 in the mean,
in the real frames of docs/segmentation.md."""
_TIME_OF_FLIGHT = DepthEdges(fatten_px=-0.5, sigma_px=0.5, source="typical")
"""Without matching windows the centres of the outermost pixels lie half a pixel inside. One that
sees both surfaces has a depth between them and may be left out, which is half a pixel either way:
a millimetre for their coarse images."""
_STRUCTURED_LIGHT = DepthEdges(fatten_px=-0.5, sigma_px=1.0, source="typical")
"""Each pixel decodes the pattern alone, but the projector's shadow and the blur of its stripes
remove or add a pixel."""
_UNKNOWN = DepthEdges(fatten_px=1.8, sigma_px=0.8, source="typical")
"""Most likely a stereo camera."""

_BY_MODEL = {
    "simulated camera": _STEREO,  # as the D415 on which it is modelled, whatever it simulates
    "realsense d4": _STEREO,
    "oak": _STEREO,
    "gemini": _STEREO,
    "hololens": _TIME_OF_FLIGHT,
    "ahat": _TIME_OF_FLIGHT,
    "azure kinect": _TIME_OF_FLIGHT,
    "femto": _TIME_OF_FLIGHT,
    "l515": _TIME_OF_FLIGHT,
    "sr30": _STRUCTURED_LIGHT,
}


def edges_of(rig: Rig, live_model: str = "") -> DepthEdges:
    """Return the measured edges of a rig's depth camera, or those typical of its model.

    Parameters
    ----------
    rig : Rig
    live_model : str
        Model of the connected camera, for a rig that names none.
    """
    if rig.depth_edges is not None:
        return rig.depth_edges
    model = (rig.depth_camera.model or live_model).lower()
    return next((edges for part, edges in _BY_MODEL.items() if part in model), _UNKNOWN)


# Every pixel or two of a border in 640x480. More would take longer and tell no more.
_MOST_RAYS = 400
_STEP_PX = 0.5
# The edge is searched this far to both sides; less where a finger, 8 mm to its middle, is thin.
_REACH_PX, _REACH_M = 6.0, 0.006
_MARGIN = 2  # steps at the ends of the search
# Samples beyond it at each end of a ray, and rays to both sides, that tell the colours.
_ENDS, _ALONG_M = 8, 0.010
# Least standard deviation of a colour, in shades of 255.
_NOISE = 8.0
# A sample tells at most this much (log of the likelihood ratio): shadows and nails are neither.
_CLIP = 3.0
# Cost of a step of the edge between neighbouring rays, and spread about where it is expected.
_TURN_COST, _PRIOR_PX = 0.5, 7.0
# Least squared distance of the two colours, in their standard deviations.
_LEAST_CONTRAST = 2.0
# The path is found in this many parts at once, each with neighbours in which it settles.
_PARTS, _SETTLE = 16, 16

_Steps: TypeAlias = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class ColorEdge:
    """The edge in colour beside a contour."""

    inward_px: Float64
    """(N,); from each point of the contour, in pixels of the depth image."""
    is_told: Bool
    """(N,); False where hand and background have too similar colours: the place expected."""
    beyond: float
    """Share of the rays told at whose ends the edge is, or beyond: much if the two images do not
    show the same place or time."""


def find_color_edge(
    frame: Frame, contour_m: Float64, inward_m: Float64, px_m: float, expected_px: float
) -> ColorEdge:
    """Find the hand's edge in colour beside the border of its mask.

    Parameters
    ----------
    frame : Frame
        With colour.
    contour_m : (N, 3) float64
        Closed, in order, in frame D.
    inward_m : (N, 3) float64
        Normals of the contour, as long as a pixel of the depth image is wide.
    px_m : float
        That width.
    expected_px : float
        Where the edge is expected, inward from the contour.
    """
    stride = -(-len(contour_m) // _MOST_RAYS)
    chosen = np.arange(0, len(contour_m), stride)
    reach = round(min(_REACH_PX, _REACH_M / px_m) / _STEP_PX)
    samples_px: Float64 = _STEP_PX * np.arange(-reach - _ENDS, reach + _ENDS + 1.0)
    colors, is_seen = _sample(frame, contour_m[chosen], inward_m[chosen], samples_px)
    along = round(_ALONG_M / (stride * px_m))
    ratio, contrast = _likelihood_ratio(colors, min(along, (len(chosen) - 1) // 2))
    is_told = is_seen & (contrast > _LEAST_CONTRAST)
    # An edge before sample s makes the samples up to s the background's.
    edges = np.arange(_ENDS, len(samples_px) - _ENDS + 1)
    inward_px = samples_px[edges] - 0.5 * _STEP_PX
    cost = np.cumsum(ratio, axis=1)[:, edges - 1] * is_told[:, None]
    cost += (0.5 * ((inward_px - expected_px) / _PRIOR_PX) ** 2).astype(np.float32)
    path = _cheapest_path(cost)
    found_px = inward_px[path]
    at_ends = is_told & ((path < _MARGIN) | (path >= len(edges) - _MARGIN))
    at, turn = np.arange(len(contour_m)), len(contour_m)
    return ColorEdge(
        np.interp(at, chosen, found_px, period=turn),
        np.interp(at, chosen, is_told.astype(np.float64), period=turn) > 0.5,
        int(at_ends.sum()) / max(1, int(is_told.sum())),
    )


def _sample(
    frame: Frame, contour_m: Float64, inward_m: Float64, samples_px: Float64
) -> tuple[Float32, Bool]:
    """Return colours (N, K, 3) at distances (K,) inward, and whether (N,) the image shows them."""
    camera = frame.color_intrinsics
    assert frame.color is not None
    assert camera is not None
    start_px, next_px = np.split(
        image_points(transform(frame.T_C_D, np.vstack([contour_m, contour_m + inward_m])), camera),
        2,
    )
    # In a straight line: lenses bend it by nothing in ten pixels.
    places_px = start_px[:, None] + samples_px[:, None] * (next_px - start_px)[:, None]
    x, y = np.moveaxis(places_px.astype(np.float32), -1, 0)
    ends_px = places_px[:, [0, -1]]
    is_seen = ((ends_px >= 0) & (ends_px <= [camera.width - 1, camera.height - 1])).all(axis=(1, 2))
    colors = cv2.remap(frame.color, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(colors, np.float32), np.asarray(is_seen)


def _likelihood_ratio(colors: Float32, along: int) -> tuple[Float32, Float64]:
    """Return how much likelier each sample (N, K) is of the hand, and the contrast (N,).

    Both colours are normal distributions, of the ends of `along` rays to both sides, with their
    mean covariance: a pixel that shows half of each is as likely of one as of the other.
    """
    background, spread_0 = _normal(colors[:, :_ENDS], along)
    hand, spread_1 = _normal(colors[:, -_ENDS:], along)
    apart = hand - background
    weights = np.linalg.solve(0.5 * (spread_0 + spread_1), apart[..., None])[..., 0]
    middle = np.einsum("ni,ni->n", 0.5 * (hand + background), weights)
    ratio = np.matmul(colors, weights.astype(np.float32)[..., None])[..., 0]
    ratio -= middle.astype(np.float32)[:, None]
    return np.clip(ratio, -_CLIP, _CLIP), np.einsum("ni,ni->n", apart, weights)


def _normal(colors: Float32, along: int) -> tuple[Float64, Float64]:
    """Return mean (N, 3) and covariance (N, 3, 3) of the colours (N, k, 3) of neighbouring rays."""
    colors = colors.astype(np.float64)
    squares = np.matmul(colors.swapaxes(1, 2), colors) / colors.shape[1]
    rows = np.column_stack([colors.mean(axis=1), squares.reshape(-1, 9)])
    rows = np.concatenate([rows[len(rows) - along :], rows, rows[:along]])
    sums = np.cumsum(np.concatenate([np.zeros((1, 12)), rows]), axis=0)
    moments = (sums[2 * along + 1 :] - sums[: -2 * along - 1]) / (2 * along + 1)
    mean = moments[:, :3]
    spread = moments[:, 3:].reshape(-1, 3, 3) - mean[:, :, None] * mean[:, None]
    return mean, spread + _NOISE**2 * np.eye(3)


def _cheapest_path(cost: Float32) -> _Steps:
    """Return the column of each row (N,) of a closed path that changes by one step at most."""
    rows, columns = cost.shape
    size = -(-rows // _PARTS)
    length = size + 2 * _SETTLE
    row = (size * np.arange(_PARTS) + np.arange(length)[:, None] - _SETTLE) % rows
    costs = cost[row]
    came = np.empty((length, _PARTS, columns), np.int8)
    padded = np.full((_PARTS, columns + 2), np.float32(np.inf))
    total = padded[:, 1:-1]
    total[:] = costs[0]
    for step in range(1, length):
        lower, higher = padded[:, :-2] + _TURN_COST, padded[:, 2:] + _TURN_COST
        best = np.minimum(np.minimum(lower, higher), total)
        came[step] = (best == higher).view(np.int8) - (best == lower).view(np.int8)
        came[step][best == total] = 0
        np.add(best, costs[step], out=total)
    path = np.empty((length, _PARTS), np.intp)
    parts = np.arange(_PARTS)
    path[-1] = total.argmin(axis=1)
    for step in range(length - 1, 0, -1):
        path[step - 1] = path[step] + came[step, parts, path[step]]
    return np.asarray(path[_SETTLE : _SETTLE + size].T.ravel()[:rows])


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
    camera = frame.depth_intrinsics
    contour_m = cloud.contour_m.astype(np.float64)
    inward = inward_normals(_places_px(contour_m, camera))
    # What nothing in colour shows is where this camera's edges usually are.
    move_px, sigma_px = edges.fatten_px * inward, edges.sigma_px
    if frame.color is not None and (
        moves := _to_color_edge(contour_m, inward, cloud, frame, edges)
    ):
        move_px, sigma_px = moves
    px_m = cloud.median_depth_m / camera.fx
    move_px = move_px - _TURNED_RIM_M / px_m * inward
    outline_m = moved_contour(contour_m, camera, move_px, cloud.contour_is_cut)
    outline_m *= 1.0 + _beyond_border_m(cloud, camera, edges) / outline_m[:, 2:]
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


def moved_contour(
    contour_m: Float64, intrinsics: Intrinsics, move_px: Float64, is_cut: Bool
) -> Float64:
    """Move a closed contour in the image, each point at its depth.

    Where the contour would fold, in sharp corners, the points follow their neighbours. A cut is no
    edge of the hand: only its ends move, with the silhouette that they adjoin.

    Parameters
    ----------
    contour_m : (N, 3) float64
        Closed, in order, in frame D.
    intrinsics : Intrinsics
        Of the depth camera.
    move_px : (N, 2) float64
        Of each point, in pixels of the depth image.
    is_cut : (N,) bool
        True on a cut edge.

    Returns
    -------
    (N, 3) float64
    """
    place_px = _places_px(contour_m, intrinsics)
    kept = ~_beside_cut(is_cut)
    before_px, after_px = (
        np.roll(contour_px, -_STEPS, axis=0) - np.roll(contour_px, _STEPS, axis=0)
        for contour_px in (place_px, place_px + move_px)
    )
    kept &= np.einsum("ij,ij->i", before_px, after_px) > 0.0
    if not kept.any():
        return contour_m
    at, known, turn = np.arange(len(kept)), np.flatnonzero(kept), len(kept)
    if len(known) < turn:
        move_px = np.column_stack(
            [np.interp(at, known, axis_px, period=turn) for axis_px in move_px[known].T]
        )
    return contour_m + _in_space_m(contour_m, intrinsics, move_px)


def _places_px(points_m: Float64, intrinsics: Intrinsics) -> Float64:
    """Return places (N, 2) in the image of an undistorted lens, from the principal point."""
    return points_m[:, :2] / points_m[:, 2:] * [intrinsics.fx, intrinsics.fy]


def _in_space_m(points_m: Float64, intrinsics: Intrinsics, move_px: Float64) -> Float64:
    """Return movements (N, 3) in metres, at each point's depth."""
    move_m = np.zeros_like(points_m)
    move_m[:, :2] = move_px / [intrinsics.fx, intrinsics.fy] * points_m[:, 2:]
    return move_m


def _to_color_edge(
    contour_m: Float64, inward: Float64, cloud: HandCloud, frame: Frame, edges: DepthEdges
) -> tuple[Float64, float] | None:
    """Return movements to the edge in colour (N, 2), in pixels, and their standard deviation.

    None if it cannot be seen along most of the silhouette, or not near enough: the hand may have
    moved between both images.
    """
    camera = frame.depth_intrinsics
    place_px = _places_px(contour_m, camera)
    to_smooth_px = _smoothed(place_px, _STEP_SMOOTH_PX) - place_px
    edge = find_color_edge(
        frame,
        contour_m + _in_space_m(contour_m, camera, to_smooth_px),
        _in_space_m(contour_m, camera, inward),
        cloud.median_depth_m / camera.fx,
        edges.fatten_px,
    )
    is_silhouette = ~cloud.contour_is_cut
    told = float(edge.is_told[is_silhouette].mean()) if is_silhouette.any() else 0.0
    if told < _LEAST_TOLD or edge.beyond > _MOST_BEYOND:
        return None
    sigma_px = told * _COLOR_SIGMA_PX + (1.0 - told) * edges.sigma_px
    return to_smooth_px + edge.inward_px[:, None] * inward, sigma_px


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


def _beside_cut(is_cut: Bool) -> Bool:
    """Return the points of a closed contour that are on a cut or at most `_BESIDE_CUT_PX` away."""
    around = np.ones(2 * _BESIDE_CUT_PX + 1)
    ends = np.pad(is_cut.astype(float), _BESIDE_CUT_PX, mode="wrap")
    beside: Bool = np.convolve(ends, around, mode="valid") > 0.5
    return beside


# A finger tip is farther from the wrist than the gaps beside it by at least this much.
_LEAST_FINGER_M = 0.012
_HALF_LENGTH_M = 0.006
_HALF_WIDTH_M = 0.0015


def outline_marks(outline_m: Float64, is_cut: Bool) -> Float64:
    """Return points that thicken an outline at the finger tips and at the ends of the wrist.

    They tell the wearer where the hand is to match its cursor, so that a turned hand is balanced
    between its ends. They extend equally to both sides of the outline, so they do not displace it.

    Parameters
    ----------
    outline_m : (N, 3) float64
        Closed outline in order, frame D.
    is_cut : (N,) bool
        True where the arm continues.

    Returns
    -------
    (K, 3) float64
        No points if no arm continues: the wrist is unknown then.
    """
    if not is_cut.any() or is_cut.all():
        return np.empty((0, 3))
    start, length = _longest_run(is_cut)
    outline_m = np.roll(outline_m, -start, axis=0)
    image_m = outline_m[:, :2]
    reach_m = np.linalg.norm(image_m[length:] - image_m[:length].mean(axis=0), axis=1)
    marked = [0, length - 1, *(length + tip for tip in _tips(reach_m))]
    step_m = np.linalg.norm(np.roll(image_m, -1, axis=0) - image_m, axis=1)
    along_m = np.cumsum(step_m)
    apart_m = np.abs(along_m[:, None] - along_m[marked])
    apart_m = np.minimum(apart_m, along_m[-1] - apart_m)
    near = (apart_m <= _HALF_LENGTH_M).any(axis=1)
    beside = max(1, round(_HALF_WIDTH_M / max(float(np.median(step_m)), 1e-6)))
    tangent = (np.roll(image_m, -beside, axis=0) - np.roll(image_m, beside, axis=0))[near]
    across = np.column_stack([tangent[:, 1], -tangent[:, 0], np.zeros(len(tangent))])
    across *= _HALF_WIDTH_M / np.maximum(np.linalg.norm(across, axis=1), 1e-9)[:, None]
    return np.vstack([outline_m[near] + across, outline_m[near] - across])


def _tips(reach_m: Float64) -> list[int]:
    """Return the peaks whose prominence is at least `_LEAST_FINGER_M`, the first of equal ones.

    As `scipy.signal.find_peaks`, whose import would nearly double that of a station.
    """
    tips = []
    last, lowest_m, is_rising = 0, float(reach_m[0]), False
    for index, value_m in enumerate(reach_m.tolist()):
        if is_rising and value_m > reach_m[last]:
            last = index
        elif is_rising and reach_m[last] - value_m >= _LEAST_FINGER_M:
            tips.append(last)
            lowest_m, is_rising = value_m, False
        elif not is_rising:
            lowest_m = min(lowest_m, value_m)
            is_rising = value_m - lowest_m >= _LEAST_FINGER_M
            last = index
    return tips


def _longest_run(is_cut: Bool) -> tuple[int, int]:
    """Return first index and length of the longest run of True around a closed outline."""
    first = int(np.flatnonzero(~is_cut)[0])
    edges = np.diff(np.roll(is_cut, -first).astype(np.int8), append=0)
    starts, ends = np.flatnonzero(edges == 1) + 1, np.flatnonzero(edges == -1) + 1
    longest = int((ends - starts).argmax())
    return int(starts[longest] + first) % len(is_cut), int((ends - starts)[longest])


def contour_px(cloud: HandCloud, frame: Frame) -> tuple[Float64, Float64 | None]:
    """Project a hand's contour into the depth and the colour image, lens distortion included.

    Parameters
    ----------
    cloud : HandCloud
    frame : Frame
        The frame of the cloud, or a later one of the same camera.

    Returns
    -------
    depth_px : (M, 2) float64
    color_px : (M, 2) float64 or None
        The same array if both images are aligned; None if the frame has no colour.
    """
    depth_px = image_points(cloud.contour_m, frame.depth_intrinsics)
    if frame.color_intrinsics is None:
        return depth_px, None
    if frame.color_intrinsics == frame.depth_intrinsics and (np.eye(4) == frame.T_C_D).all():
        return depth_px, depth_px
    return depth_px, image_points(transform(frame.T_C_D, cloud.contour_m), frame.color_intrinsics)

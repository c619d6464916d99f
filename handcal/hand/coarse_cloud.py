"""A frame's coarse depth image: the objects in it, in boxes of the colour image."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from handcal.core.geometry import camera_matrix, image_points, invert, transform
from handcal.core.types import Bool, Float64, Frame, Intrinsics
from handcal.hand.settings import NEARER_M, Roi, RoiSettings
from handcal.hand.view import Box, between, deproject, gate_problem, pixels_of, view_depth

STEP_PX = 8
"""Step of the coarse image, in pixels of the depth image: fine enough to locate a hand."""

_PIXELS_MIN = 6
_DEPTH_SPREAD_M = 0.10  # within one hand
_CROSSES = 0.1  # share of a hand beyond the gate that may leave too little of it within
# Something at the hand's place is an object if it fills this share of the box, and the box's
# surroundings, of the same area, less than this multiple as much; it is as deep as that share of
# its distance. This much larger than a hand it is one in a wrong unit.
_OBJECT_MIN, _AROUND_MAX, _OBJECT_DEPTH, _TOO_LARGE = 0.3, 0.5, 0.25, 1.3
_SHIFTS, _STILL_PX = 3, 1.0
_MEASURED_MIN = 0.1  # least share of a box with depth, to say how far it is


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """A hand in the depth image: box, depth, and the centroid and area of its pixels in the box."""

    score: float
    box: Float64
    depth_m: float
    offset: Float64
    pixels: int


class CoarseCloud:
    """The pixels of a frame's coarse depth image that lie within the depth gate."""

    def __init__(self, frame: Frame, gate_m: tuple[float, float]) -> None:
        assert frame.color_intrinsics is not None
        self.camera = frame.depth_intrinsics
        self._color_camera = frame.color_intrinsics
        self._T_C_D = frame.T_C_D
        self._aligned = self.camera == self._color_camera and bool((np.eye(4) == self._T_C_D).all())
        whole = 0, 0, self.camera.width, self.camera.height
        self._view = view_depth(frame, whole, STEP_PX)
        self._gate_m = gate_m
        self._rows, self._columns = pixels_of(between(self._view, *gate_m))
        self._px = STEP_PX * np.column_stack([self._columns, self._rows]).astype(np.float64)
        self._depth_m = self._view.depth[self._rows, self._columns] * self._view.scale_m

    def track(self, color_box: Float64, score: float) -> Track | None:
        """Return the nearest object in a box of the colour image."""
        inside = inside_box(self._color_px(self._rows, self._columns), color_box)
        if np.count_nonzero(inside) < _PIXELS_MIN:
            return None
        nearest_m = np.quantile(self._depth_m[inside], 0.1)
        inside &= self._depth_m < nearest_m + _DEPTH_SPREAD_M
        depth_m = float(np.median(self._depth_m[inside]))
        box = self._in_depth(color_box, depth_m)
        offset = self._px[inside].mean(0) - center(box)
        return Track(score, box, depth_m, offset, int(np.count_nonzero(inside)))

    def problem(self, color_box: Float64, settings: RoiSettings) -> str:
        """Return why a box of the colour image holds no object of its size within the gate."""
        rows, columns = pixels_of(self._view.depth > 0)
        inside = inside_box(self._color_px(rows, columns), color_box)
        depth_m = self._view.depth[rows, columns][inside] * self._view.scale_m
        area_px = float(np.prod(color_box[2:] - color_box[:2]))
        if len(depth_m) < max(_PIXELS_MIN, _MEASURED_MIN * area_px / STEP_PX**2):
            return (
                "the depth camera measures nothing where the hand is; move it back, or out of "
                "strong light"
            )
        gate_m = self._gate_m[0] + NEARER_M, self._gate_m[1]
        nearest_m = np.quantile(depth_m, 0.1)
        depth_m = depth_m[depth_m < nearest_m + _DEPTH_SPREAD_M]
        hand_m = float(np.median(depth_m))
        side_m = float(np.sqrt(area_px)) * hand_m / self._color_camera.fx
        if side_m < settings.side_min_m:
            return (
                f"a hand at the measured {hand_m:.2f} m would be only {100 * side_m:.0f} cm large: "
                "depth is in a wrong unit; correct the depth scale of the camera or recording"
            )
        if hand_m >= gate_m[0] and side_m > settings.side_max_m:
            if not self._is_object(color_box):
                return (
                    f"the depth camera measures only the background, at {hand_m:.2f} m, where the "
                    "hand is; the hand may be too near: move it back"
                )
            if side_m > _TOO_LARGE * settings.side_max_m:
                return (
                    f"a hand at the measured {hand_m:.2f} m would be {side_m:.1f} m large: depth "
                    "is in a wrong unit; correct the depth scale of the camera or recording"
                )
        return gate_problem(depth_m, gate_m, _CROSSES) or (
            "most of the hand is hidden or without depth; show all of it to the camera"
        )

    def _is_object(self, color_box: Float64) -> bool:
        """Return whether the nearest surface in a box of the colour image ends around it."""
        rows, columns = pixels_of(self._view.depth > 0)
        px, depth = self._color_px(rows, columns), self._view.depth[rows, columns]
        wider_px = (np.sqrt(2.0) - 1.0) / 2.0 * (color_box[2:] - color_box[:2])
        inside = inside_box(px, color_box)
        nearest = np.quantile(depth[inside], 0.1)
        near = depth < (1.0 + _OBJECT_DEPTH) * nearest
        wider = inside_box(px, color_box + np.concatenate([-wider_px, wider_px]))
        filled, around = (np.count_nonzero(near & one) for one in (inside, wider & ~inside))
        area = float(np.prod(color_box[2:] - color_box[:2])) / STEP_PX**2
        return bool(filled > max(_OBJECT_MIN * area, around / _AROUND_MAX))

    def follow(self, track: Track) -> Track | None:
        """Move a track's box with the pixels in it; None if most of them are gone."""
        near = np.abs(self._depth_m - track.depth_m) < _DEPTH_SPREAD_M
        px, depth_m = self._px[near], self._depth_m[near]
        box = track.box
        for _ in range(_SHIFTS):  # mean shift
            inside = inside_box(px, box)
            if np.count_nonzero(inside) < max(_PIXELS_MIN, track.pixels / 2):
                return None
            shift = px[inside].mean(0) - track.offset - center(box)
            box = box + np.concatenate([shift, shift])
            if np.abs(shift).max() < _STILL_PX:
                break
        return replace(track, box=box, depth_m=float(np.median(depth_m[inside])))

    def may_precede(self, track: Track, wanted: Roi) -> bool:
        """Return whether there is an object that would be preferred if it were a hand."""
        low, high = track.box[0::2] + np.array([-1, 1]) * (track.box[2] - track.box[0])
        x = self._px[:, 0]
        nearer = self._depth_m < track.depth_m - _DEPTH_SPREAD_M
        precedes = {"left": x < low, "right": x > high}.get(wanted, nearer)
        return bool(np.count_nonzero(precedes) >= _PIXELS_MIN)

    def surroundings(self, track: Track, margin: float) -> Box:
        """Return the part of the colour image around a track."""
        box = self._in_color(track.box, track.depth_m)
        wider = margin * (box[2:] - box[:2]).max()
        size = self._color_camera.width, self._color_camera.height
        low = np.floor(box[:2] - wider).clip(0, np.subtract(size, 1))
        high = np.ceil(box[2:] + wider).clip(low + 1, size)
        x0, y0, x1, y1 = np.concatenate([low, high]).astype(int).tolist()
        return x0, y0, x1, y1

    def clip(self, box: Float64) -> Box | None:
        """Return a box in whole pixels, clipped to the depth image; None if outside."""
        x0, y0 = np.floor(box[:2].clip(0)).astype(int).tolist()
        x1, y1 = np.ceil(box[2:].clip(0)).astype(int).tolist()
        x1, y1 = min(x1, self.camera.width), min(y1, self.camera.height)
        return (x0, y0, x1, y1) if x0 < x1 and y0 < y1 else None

    def _color_px(self, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> Float64:
        """Return coordinates of coarse pixels in the colour image, (N, 2)."""
        if self._aligned:
            return STEP_PX * np.column_stack([columns, rows]).astype(np.float64)
        points_m = deproject(self._view, rows, columns).T
        return image_points(transform(self._T_C_D, points_m), self._color_camera)

    def _in_depth(self, color_box: Float64, depth_m: float) -> Float64:
        """Map a box of the colour image to the depth image, for objects at a depth."""
        if self._aligned:
            return color_box
        return _moved(color_box, depth_m, self._color_camera, self.camera, invert(self._T_C_D))

    def _in_color(self, box: Float64, depth_m: float) -> Float64:
        """Map a box of the depth image to the colour image, for objects at a depth."""
        if self._aligned:
            return box
        return _moved(box, depth_m, self.camera, self._color_camera, self._T_C_D)


def inside_box(px: Float64, box: Float64) -> Bool:
    """Return which of (N, 2) pixels lie in a box, (N,)."""
    x, y = px.T
    inside: Bool = (x >= box[0]) & (y >= box[1]) & (x < box[2]) & (y < box[3])
    return inside


def center(box: Float64) -> Float64:
    """Return the centre of a box, (2,)."""
    center: Float64 = (box[:2] + box[2:]) / 2.0
    return center


def _moved(
    box: Float64, depth_m: float, camera: Intrinsics, other: Intrinsics, T_other_camera: Float64
) -> Float64:
    """Map a box of one camera's image to another camera, for objects at a depth."""
    rays = cv2.undistortPoints(
        box.reshape(2, 1, 2), camera_matrix(camera), np.array(camera.distortion)
    )
    corners_m = np.column_stack([rays.reshape(2, 2), np.ones(2)]) * depth_m
    return image_points(transform(T_other_camera, corners_m), other).ravel()

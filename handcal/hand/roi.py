"""The region of interest: a detector's box, tracked through the depth images."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from handcal.geometry import camera_matrix, image_points, invert, transform
from handcal.hand.detect import Detections, overlaps
from handcal.hand.settings import NEARER_M, Roi, SegmentSettings
from handcal.hand.view import Box, between, deproject, pixels_of, view_depth
from handcal.types import Bool, Float64, Frame, Intrinsics, UInt8

_STEP_PX = 8  # of the depth image: fine enough to locate a hand
_PIXELS_MIN = 6
_DEPTH_SPREAD_M = 0.10  # within one hand
_INSIDE_M = 0.05  # from an end of the gate to where all of a hand is within it
_SAME_OVERLAP = 0.3
_SHIFTS, _STILL_PX = 3, 1.0
_MEASURED_MIN = 0.1  # least share of a box with depth, to say how far it is
_NOT_SEEN = "no hand is seen in the colour image; raise the bare hand in front of the camera"


class Detector(Protocol):
    """Finds hands in a colour image."""

    def detect(self, color: UInt8, pixels: int | None = None) -> Detections:
        """Return the hands in an (H, W, 3) RGB image, scaled to about this many pixels."""
        ...


@dataclass(frozen=True, slots=True)
class RoiSettings:
    """Settings of choosing and tracking the hand.

    Times are rounded to frames.
    """

    sure_min: float = 0.7
    """Least score of a hand, as a share of the highest score."""
    check_s: float = 0.19
    """Time after which the detector checks a tracked hand again."""
    check_margin: float = 0.5
    """Margin of that check around the hand's box, as a multiple of its longer side."""
    check_pixels: int = 25_600
    """Pixels of that check: few, because it is repeated often."""
    search_s: float = 0.06
    """Time between searches of the whole image while no hand is tracked."""
    choose_s: float = 1.0
    """Least time between searches of the whole image while the tracked hand may be wrong."""
    misses: int = 2
    """A tracked hand is dropped after this many checks in a row without a detection."""
    filled_min: float = 0.25
    """Least share of a hand's box at the hand's depth."""
    side_min_m: float = 0.05
    side_max_m: float = 0.30
    """Range of the square root of the area of a hand's box, at its depth."""


@dataclass(frozen=True, slots=True, eq=False)
class _Track:
    """A hand in the depth image: box, depth, and the centroid and area of its pixels in the box."""

    score: float
    box: Float64
    depth_m: float
    offset: Float64
    pixels: int


class RoiFinder:
    """Finds one hand and tracks it from frame to frame.

    Between detections the box moves with the pixels in it at the hand's depth.

    Parameters
    ----------
    detector : Detector
    segmenting : SegmentSettings
        Its depth gate limits the search; its `roi` selects among several hands.
    settings : RoiSettings, optional

    Attributes
    ----------
    problem : str
        Why the last frame gave no hand, and what to do.
    """

    def __init__(
        self,
        detector: Detector,
        segmenting: SegmentSettings,
        settings: RoiSettings | None = None,
    ) -> None:
        self._detector = detector
        self.problem = _NOT_SEEN
        self._gate_m = segmenting.depth_min_m - NEARER_M, segmenting.depth_max_m
        self._wanted = segmenting.roi
        self._settings = settings or RoiSettings()
        self._track: _Track | None = None
        self._misses = 0
        self._seen_ns: int | None = None
        self._looked_ns: int | None = None
        self._chosen_ns = 0

    def find(self, frame: Frame) -> Box | None:
        """Return the hand's box in the depth image; None if no hand is seen, or without colour."""
        if frame.color is None:
            return None
        now_ns = frame.t_camera_ns
        if self._seen_ns is None or now_ns < self._seen_ns:
            self._track = self._looked_ns = None  # a recording has started or restarted
            self._seen_ns = now_ns
        half_frame_ns, self._seen_ns = (now_ns - self._seen_ns) / 2, now_ns
        cloud = _CoarseCloud(frame, self._gate_m)
        self._track = self._track and cloud.follow(self._track)
        wait_s = self._settings.search_s
        if self._track is not None and not self._misses:
            wait_s = self._settings.check_s
        if self._looked_ns is None or now_ns - self._looked_ns >= wait_s * 1e9 - half_frame_ns:
            self._looked_ns = now_ns
            self._look(frame.color, cloud, now_ns)
        return None if self._track is None else cloud.clip(self._track.box)

    def _look(self, color: UInt8, cloud: _CoarseCloud, now_ns: int) -> None:
        """Run the detector to confirm the track, drop it, or start one."""
        confirmed = self._track and self._confirm(self._track, color, cloud)
        if confirmed is not None:
            self._track, self._misses = confirmed, 0
            is_due = now_ns - self._chosen_ns >= self._settings.choose_s * 1e9
            if not (is_due and cloud.may_precede(confirmed, self._wanted)):
                return
        elif self._track is not None:
            self._misses += 1
            if self._misses < self._settings.misses:
                return
        self._misses = 0
        self._chosen_ns = now_ns
        self._track = self._choose(color, cloud) or confirmed

    def _choose(self, color: UInt8, cloud: _CoarseCloud) -> _Track | None:
        """Return the wanted hand, if the detector sees it in the whole image and in a crop.

        A hand seen only in the whole image would soon be dropped and detected again.
        """
        height, width = color.shape[:2]
        self.problem = _NOT_SEEN
        hands = self._hands(color, (0, 0, width, height), None, cloud)
        least = self._settings.sure_min * max((hand.score for hand in hands), default=0.0)
        sure = sorted((hand for hand in hands if hand.score >= least), key=self._order)
        confirmed = (self._confirm(hand, color, cloud) for hand in sure)
        return next(filter(None, confirmed), None)

    def _confirm(self, track: _Track, color: UInt8, cloud: _CoarseCloud) -> _Track | None:
        """Return the track as updated by the detector; None if it sees no hand there."""
        part = cloud.surroundings(track, self._settings.check_margin)
        hands = self._hands(color, part, self._settings.check_pixels, cloud)
        return next((hand for hand in hands if _overlap(hand, track) >= _SAME_OVERLAP), None)

    def _hands(
        self, color: UInt8, part: Box, pixels: int | None, cloud: _CoarseCloud
    ) -> list[_Track]:
        """Return the plausible hands detected in a part of the image."""
        x0, y0, x1, y1 = part
        found = self._detector.detect(color[y0:y1, x0:x1], pixels)
        boxes = found.boxes_px + np.array([x0, y0, x0, y0])
        hands: list[_Track] = []
        for box, score in zip(boxes, found.scores, strict=True):
            hand = cloud.track(box, float(score))
            problem = (
                cloud.problem(box, self._settings)
                if hand is None
                else self._problem(hand, box, cloud)
            )
            if hand is None or problem:
                if self.problem == _NOT_SEEN:  # that of the surest
                    self.problem = problem
                continue
            if not any(_on_one_hand(hand, surer) for surer in hands):
                hands.append(hand)
        return hands

    def _problem(self, track: _Track, color_box: Float64, cloud: _CoarseCloud) -> str:
        """Return why the content of a box is not of a hand's size or does not fill the box."""
        settings = self._settings
        side_px = np.sqrt(np.prod(track.box[2:] - track.box[:2]))
        side_m = float(side_px * track.depth_m / cloud.camera.fx)
        if not settings.side_min_m <= side_m <= settings.side_max_m:
            return (
                f"what looks like a hand {track.depth_m:.2f} m away is {100 * side_m:.0f} cm "
                "large; show the bare hand"
            )
        if track.pixels * _STEP_PX**2 < settings.filled_min * side_px**2:
            return cloud.problem(color_box, settings)
        return ""

    def _order(self, track: _Track) -> float:
        if self._wanted in ("left", "right"):
            return float(track.box[0] if self._wanted == "left" else -track.box[2])
        return track.depth_m


class _CoarseCloud:
    """The pixels of a frame's coarse depth image that lie within the depth gate."""

    def __init__(self, frame: Frame, gate_m: tuple[float, float]) -> None:
        assert frame.color_intrinsics is not None
        self.camera = frame.depth_intrinsics
        self._color_camera = frame.color_intrinsics
        self._T_C_D = frame.T_C_D
        self._aligned = self.camera == self._color_camera and bool((np.eye(4) == self._T_C_D).all())
        whole = 0, 0, self.camera.width, self.camera.height
        self._view = view_depth(frame, whole, _STEP_PX)
        self._gate_m = gate_m
        self._rows, self._columns = pixels_of(between(self._view, *gate_m))
        self._px = _STEP_PX * np.column_stack([self._columns, self._rows]).astype(np.float64)
        self._depth_m = self._view.depth[self._rows, self._columns] * self._view.scale_m

    def track(self, color_box: Float64, score: float) -> _Track | None:
        """Return the nearest object in a box of the colour image."""
        inside = _inside(self._color_px(self._rows, self._columns), color_box)
        if np.count_nonzero(inside) < _PIXELS_MIN:
            return None
        nearest_m = np.quantile(self._depth_m[inside], 0.1)
        inside &= self._depth_m < nearest_m + _DEPTH_SPREAD_M
        depth_m = float(np.median(self._depth_m[inside]))
        box = self._in_depth(color_box, depth_m)
        offset = self._px[inside].mean(0) - _center(box)
        return _Track(score, box, depth_m, offset, int(np.count_nonzero(inside)))

    def problem(self, color_box: Float64, settings: RoiSettings) -> str:
        """Return why a box of the colour image holds no object of its size within the gate."""
        rows, columns = pixels_of(self._view.depth > 0)
        inside = _inside(self._color_px(rows, columns), color_box)
        depth_m = self._view.depth[rows, columns][inside] * self._view.scale_m
        area_px = float(np.prod(color_box[2:] - color_box[:2]))
        if len(depth_m) < max(_PIXELS_MIN, _MEASURED_MIN * area_px / _STEP_PX**2):
            return (
                "the depth camera measures nothing where the hand is; move it back, or out of "
                "strong light"
            )
        near_m, far_m = self._gate_m[0] + NEARER_M, self._gate_m[1]
        nearest_m = np.quantile(depth_m, 0.1)
        hand_m = float(np.median(depth_m[depth_m < nearest_m + _DEPTH_SPREAD_M]))
        side_m = float(np.sqrt(area_px)) * hand_m / self._color_camera.fx
        if side_m < settings.side_min_m:
            return (
                f"a hand at the measured {hand_m:.2f} m would be only {100 * side_m:.0f} cm large: "
                "depth is in a wrong unit; correct the depth scale of the camera or recording"
            )
        where = f"at {100 * hand_m:.0f} cm"
        if hand_m < near_m:
            back_cm = 100 * (near_m + _INSIDE_M - hand_m)
            return f"the hand is too near, {where}; move it back by {back_cm:.0f} cm"
        if side_m > settings.side_max_m:
            return (
                f"the depth camera measures only the background, at {hand_m:.2f} m, where the hand "
                "is; the hand may be too near: move it back"
            )
        if hand_m > far_m:
            near_cm = 100 * (hand_m - far_m + _INSIDE_M)
            return f"the hand is too far, {where}; bring it nearer by {near_cm:.0f} cm"
        return "most of the hand is hidden or without depth; show all of it to the camera"

    def follow(self, track: _Track) -> _Track | None:
        """Move a track's box with the pixels in it; None if most of them are gone."""
        near = np.abs(self._depth_m - track.depth_m) < _DEPTH_SPREAD_M
        px, depth_m = self._px[near], self._depth_m[near]
        box = track.box
        for _ in range(_SHIFTS):  # mean shift
            inside = _inside(px, box)
            if np.count_nonzero(inside) < max(_PIXELS_MIN, track.pixels / 2):
                return None
            shift = px[inside].mean(0) - track.offset - _center(box)
            box = box + np.concatenate([shift, shift])
            if np.abs(shift).max() < _STILL_PX:
                break
        return replace(track, box=box, depth_m=float(np.median(depth_m[inside])))

    def may_precede(self, track: _Track, wanted: Roi) -> bool:
        """Return whether there is an object that would be preferred if it were a hand."""
        low, high = track.box[0::2] + np.array([-1, 1]) * (track.box[2] - track.box[0])
        x = self._px[:, 0]
        nearer = self._depth_m < track.depth_m - _DEPTH_SPREAD_M
        precedes = {"left": x < low, "right": x > high}.get(wanted, nearer)
        return bool(np.count_nonzero(precedes) >= _PIXELS_MIN)

    def surroundings(self, track: _Track, margin: float) -> Box:
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
            return _STEP_PX * np.column_stack([columns, rows]).astype(np.float64)
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


def _moved(
    box: Float64, depth_m: float, camera: Intrinsics, other: Intrinsics, T_other_camera: Float64
) -> Float64:
    """Map a box of one camera's image to another camera, for objects at a depth."""
    rays = cv2.undistortPoints(
        box.reshape(2, 1, 2), camera_matrix(camera), np.array(camera.distortion)
    )
    corners_m = np.column_stack([rays.reshape(2, 2), np.ones(2)]) * depth_m
    return image_points(transform(T_other_camera, corners_m), other).ravel()


def _inside(px: Float64, box: Float64) -> Bool:
    x, y = px.T
    inside: Bool = (x >= box[0]) & (y >= box[1]) & (x < box[2]) & (y < box[3])
    return inside


def _center(box: Float64) -> Float64:
    center: Float64 = (box[:2] + box[2:]) / 2.0
    return center


def _on_one_hand(track: _Track, other: _Track) -> bool:
    """Return whether one of two boxes contains the other's centre."""
    return bool(
        _inside(_center(track.box)[None], other.box).any()
        or _inside(_center(other.box)[None], track.box).any()
    )


def _overlap(track: _Track, other: _Track) -> float:
    return float(overlaps(track.box[None], other.box[None])[0, 0])

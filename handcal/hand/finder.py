"""Find the wearer's hand in successive frames: a detector's box, tracked through the depth images.

A frame's coarse depth image tells which objects are in a box of the colour image.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from handcal.core.errors import HandError, OutOfViewError
from handcal.core.geometry import camera_matrix, image_points, invert, transform
from handcal.core.types import Bool, Float64, Frame, HandCloud, Intrinsics, UInt8
from handcal.hand.detect import Detections, overlaps
from handcal.hand.segment import segment_hand, segmented_window
from handcal.hand.settings import NEARER_M, Roi, SegmentSettings
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
# Range of the square root of the area of a hand's box, at its depth, and the least share of the box
# at that depth.
_SIDE_M, _FILLED_MIN = (0.05, 0.30), 0.25


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

    def problem(self, color_box: Float64) -> HandError:
        """Return why a box of the colour image holds no object of its size within the gate."""
        rows, columns = pixels_of(self._view.depth > 0)
        inside = inside_box(self._color_px(rows, columns), color_box)
        depth_m = self._view.depth[rows, columns][inside] * self._view.scale_m
        area_px = float(np.prod(color_box[2:] - color_box[:2]))
        if len(depth_m) < max(_PIXELS_MIN, _MEASURED_MIN * area_px / STEP_PX**2):
            return HandError(
                "the depth camera measures nothing where the hand is",
                "move it back, or out of strong light",
            )
        gate_m = self._gate_m[0] + NEARER_M, self._gate_m[1]
        nearest_m = np.quantile(depth_m, 0.1)
        depth_m = depth_m[depth_m < nearest_m + _DEPTH_SPREAD_M]
        hand_m = float(np.median(depth_m))
        side_m = float(np.sqrt(area_px)) * hand_m / self._color_camera.fx
        if side_m < _SIDE_M[0]:
            return _wrong_unit(hand_m, f"only {100 * side_m:.0f} cm")
        if hand_m >= gate_m[0] and side_m > _SIDE_M[1]:
            if not self._is_object(color_box):
                return HandError(
                    f"the depth camera measures only the background, at {hand_m:.2f} m, where the "
                    "hand is",
                    "the hand may be too near: move it back",
                )
            if side_m > _TOO_LARGE * _SIDE_M[1]:
                return _wrong_unit(hand_m, f"{side_m:.1f} m")
        return gate_problem(depth_m, gate_m, _CROSSES) or HandError(
            "most of the hand is hidden or without depth", "show all of it to the camera"
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
        filled, around = (np.count_nonzero(near & part) for part in (inside, wider & ~inside))
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


def _wrong_unit(hand_m: float, size: str) -> HandError:
    return HandError(
        f"a hand at the measured {hand_m:.2f} m would be {size} large: depth is in a wrong unit",
        "correct the depth scale of the camera or recording",
    )


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


_SAME_OVERLAP = 0.3
_NOT_SEEN = HandError(
    "no hand is seen in the colour image", "raise the bare hand in front of the camera"
)
_SURE_MIN = 0.7  # least score of a hand, as a share of the highest score
# While a hand is tracked, the detector looks at it again after this time, with this margin (a
# multiple of the longer side of its box) and so few pixels, because it does so often; it is dropped
# after so many looks in a row without a detection. Times are rounded to frames.
_CHECK_S, _CHECK_MARGIN, _CHECK_PIXELS, _MISSES = 0.19, 0.5, 25_600, 2
# Between looks at the whole image: without a hand, and while the tracked one may be the wrong one.
_SEARCH_S, _CHOOSE_S = 0.06, 1.0


class Detector(Protocol):
    """Finds hands in a colour image."""

    def detect(self, color: UInt8, pixels: int | None = None) -> Detections:
        """Return the hands in an (H, W, 3) RGB image, scaled to about this many pixels."""
        ...


class RoiFinder:
    """Finds one hand and tracks it from frame to frame.

    Between detections the box moves with the pixels in it at the hand's depth.

    Parameters
    ----------
    detector : Detector
    segmenting : SegmentSettings
        Its depth gate limits the search; its `roi` selects among several hands.

    Attributes
    ----------
    problem : HandError
        Why the last frame gave no hand, and what to do.
    """

    def __init__(self, detector: Detector, segmenting: SegmentSettings) -> None:
        self._detector = detector
        self.problem = _NOT_SEEN
        self._gate_m = segmenting.depth_min_m - NEARER_M, segmenting.depth_max_m
        self._wanted = segmenting.roi
        self._track: Track | None = None
        self._misses = 0
        self._former_ns: int | None = None
        self._looked_ns: int | None = None
        self._chosen_ns = 0

    def find(self, frame: Frame) -> Box | None:
        """Return the hand's box in the depth image; None if no hand is seen, or without colour."""
        if frame.color is None:
            return None
        now_ns = frame.t_camera_ns
        if self._former_ns is None or now_ns < self._former_ns:
            self._track = self._looked_ns = None  # a recording has started or restarted
            self._former_ns = now_ns
        # A look is taken in the frame nearest to its time, which may be half a frame early.
        half_frame_ns, self._former_ns = (now_ns - self._former_ns) / 2, now_ns
        cloud = CoarseCloud(frame, self._gate_m)
        self._track = self._track and cloud.follow(self._track)
        wait_s = _SEARCH_S
        if self._track is not None and not self._misses:
            wait_s = _CHECK_S
        if self._looked_ns is None or now_ns - self._looked_ns >= wait_s * 1e9 - half_frame_ns:
            self._looked_ns = now_ns
            self._look(frame.color, cloud, now_ns)
        return None if self._track is None else cloud.clip(self._track.box)

    def _look(self, color: UInt8, cloud: CoarseCloud, now_ns: int) -> None:
        """Run the detector to confirm the track, drop it, or start one."""
        confirmed = self._track and self._confirm(self._track, color, cloud)[0]
        if confirmed is not None:
            self._track, self._misses = confirmed, 0
            is_due = now_ns - self._chosen_ns >= _CHOOSE_S * 1e9
            if not (is_due and cloud.may_precede(confirmed, self._wanted)):
                return
        elif self._track is not None:
            self._misses += 1
            if self._misses < _MISSES:
                return
        self._misses = 0
        self._chosen_ns = now_ns
        self._track = self._choose(color, cloud) or confirmed

    def _choose(self, color: UInt8, cloud: CoarseCloud) -> Track | None:
        """Return the wanted hand, if the detector sees it in the whole image and in a crop.

        A hand seen only in the whole image would soon be dropped and detected again.
        """
        height, width = color.shape[:2]
        hands, problem = self._hands(color, (0, 0, width, height), None, cloud)
        least = _SURE_MIN * max((hand.score for hand in hands), default=0.0)
        confirmed = None
        for hand in sorted((hand for hand in hands if hand.score >= least), key=self._order):
            confirmed, doubt = self._confirm(hand, color, cloud)
            problem = problem or doubt
            if confirmed is not None:
                break
        self.problem = problem or _NOT_SEEN
        return confirmed

    def _confirm(
        self, track: Track, color: UInt8, cloud: CoarseCloud
    ) -> tuple[Track | None, HandError | None]:
        """Return the track as updated by the detector, or why it sees no hand there, if known."""
        part = cloud.surroundings(track, _CHECK_MARGIN)
        hands, problem = self._hands(color, part, _CHECK_PIXELS, cloud)
        same = (hand for hand in hands if _overlap(hand, track) >= _SAME_OVERLAP)
        return next(same, None), problem

    def _hands(
        self, color: UInt8, part: Box, pixels: int | None, cloud: CoarseCloud
    ) -> tuple[list[Track], HandError | None]:
        """Return the plausible hands in a part of the image, and why the surest other is none."""
        x0, y0, x1, y1 = part
        detections = self._detector.detect(color[y0:y1, x0:x1], pixels)
        boxes = detections.boxes_px + np.array([x0, y0, x0, y0])
        hands: list[Track] = []
        beyond: list[Float64] = []
        first_problem: HandError | None = None
        for box, score in zip(boxes, detections.scores, strict=True):
            if any(inside_box(center(box)[None], other).any() for other in beyond):
                continue  # a part of that hand
            hand = cloud.track(box, float(score))
            problem = _problem(hand, box, cloud)
            if hand is None or problem is not None:
                if isinstance(problem, OutOfViewError):
                    beyond.append(box)
                first_problem = first_problem or problem  # the surest come first
            elif not any(_on_one_hand(hand, surer) for surer in hands):
                hands.append(hand)
        return hands, first_problem

    def _order(self, track: Track) -> float:
        if self._wanted in ("left", "right"):
            return float(track.box[0] if self._wanted == "left" else -track.box[2])
        return track.depth_m


def _problem(track: Track | None, color_box: Float64, cloud: CoarseCloud) -> HandError | None:
    """Return why the content of a box is not of a hand's size or does not fill the box."""
    if track is None:
        return cloud.problem(color_box)
    side_px = np.sqrt(np.prod(track.box[2:] - track.box[:2]))
    side_m = float(side_px * track.depth_m / cloud.camera.fx)
    if not _SIDE_M[0] <= side_m <= _SIDE_M[1]:
        return HandError(
            f"what looks like a hand {track.depth_m:.2f} m away is {100 * side_m:.0f} cm large",
            "show the bare hand",
        )
    if track.pixels * STEP_PX**2 < _FILLED_MIN * side_px**2:
        return cloud.problem(color_box)
    return None


def _on_one_hand(track: Track, other: Track) -> bool:
    """Return whether one of two boxes contains the other's centre."""
    return bool(
        inside_box(center(track.box)[None], other.box).any()
        or inside_box(center(other.box)[None], track.box).any()
    )


def _overlap(track: Track, other: Track) -> float:
    return float(overlaps(track.box[None], other.box[None])[0, 0])


_EDGE_PX = 3  # a hand this close to a side of its window may continue beyond it
_EVERYWHERE = 1000.0  # margin of a window that is the whole image
_IN_BOX_MIN = 0.3  # least share of the hand within its box, which covers at least the palm


class HandFinder:
    """Segments the hand in each frame of a camera.

    The hand is the one that the detector finds, or none. Without a detector or without colour, it
    is the nearest hand-sized object in the depth image.

    Parameters
    ----------
    settings : SegmentSettings
    detector : Detector, optional
    """

    def __init__(self, settings: SegmentSettings, detector: Detector | None = None) -> None:
        self._settings = settings
        self._roi = RoiFinder(detector, settings) if detector else None

    def find(self, frame: Frame) -> HandCloud:
        """Return the hand in the camera's next frame.

        Raises
        ------
        HandError
            See `segment_hand`; also if the detector sees no hand, or where it sees one the depth
            image shows none within reach. The text says why.
        """
        if self._roi is None or frame.color is None:
            return segment_hand(frame, self._settings)
        roi_px = self._roi.find(frame)
        if roi_px is None:
            raise HandError(*self._roi.problem.args)
        camera = frame.depth_intrinsics
        hand = segment_hand(frame, self._settings, roi_px)
        if not _is_within(hand.box_px, segmented_window(roi_px, camera, self._settings), camera):
            wider = replace(self._settings, roi_margin=_EVERYWHERE)
            hand = segment_hand(frame, wider, roi_px)
        x0, y0, x1, y1 = roi_px
        in_box = np.count_nonzero(hand.mask[y0:y1, x0:x1])
        if in_box < _IN_BOX_MIN * np.count_nonzero(hand.mask):
            raise HandError(
                "the detector and the depth image disagree about where the hand is",
                "hold it clear of other things",
            )
        return hand


def _is_within(box: Box, window: Box, camera: Intrinsics) -> bool:
    """Return whether a box keeps clear of a window's sides, other than the image's border."""
    gaps_px = np.subtract(box, window) * (1, 1, -1, -1)
    at_end = np.equal(window, (0, 0, camera.width, camera.height))
    return bool(((gaps_px > _EDGE_PX) | at_end).all())

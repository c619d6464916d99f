"""The region of interest: a detector's box, tracked through the depth images."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from handcal.core.types import Float64, Frame, UInt8
from handcal.hand.coarse_cloud import STEP_PX, CoarseCloud, Track, center, inside_box
from handcal.hand.detect import Detections, overlaps
from handcal.hand.settings import NEARER_M, RoiSettings, SegmentSettings
from handcal.hand.view import BEYOND, Box

_SAME_OVERLAP = 0.3
_NOT_SEEN = "no hand is seen in the colour image; raise the bare hand in front of the camera"


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
        self._track: Track | None = None
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
        cloud = CoarseCloud(frame, self._gate_m)
        self._track = self._track and cloud.follow(self._track)
        wait_s = self._settings.search_s
        if self._track is not None and not self._misses:
            wait_s = self._settings.check_s
        if self._looked_ns is None or now_ns - self._looked_ns >= wait_s * 1e9 - half_frame_ns:
            self._looked_ns = now_ns
            self._look(frame.color, cloud, now_ns)
        return None if self._track is None else cloud.clip(self._track.box)

    def _look(self, color: UInt8, cloud: CoarseCloud, now_ns: int) -> None:
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

    def _choose(self, color: UInt8, cloud: CoarseCloud) -> Track | None:
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

    def _confirm(self, track: Track, color: UInt8, cloud: CoarseCloud) -> Track | None:
        """Return the track as updated by the detector; None if it sees no hand there."""
        part = cloud.surroundings(track, self._settings.check_margin)
        hands = self._hands(color, part, self._settings.check_pixels, cloud)
        return next((hand for hand in hands if _overlap(hand, track) >= _SAME_OVERLAP), None)

    def _hands(
        self, color: UInt8, part: Box, pixels: int | None, cloud: CoarseCloud
    ) -> list[Track]:
        """Return the plausible hands detected in a part of the image."""
        x0, y0, x1, y1 = part
        found = self._detector.detect(color[y0:y1, x0:x1], pixels)
        boxes = found.boxes_px + np.array([x0, y0, x0, y0])
        hands: list[Track] = []
        beyond: list[Float64] = []
        for box, score in zip(boxes, found.scores, strict=True):
            if any(inside_box(center(box)[None], other).any() for other in beyond):
                continue  # a part of that hand
            hand = cloud.track(box, float(score))
            problem = self._problem(hand, box, cloud)
            if hand is None or problem:
                if problem.startswith(BEYOND):
                    beyond.append(box)
                if self.problem == _NOT_SEEN:  # that of the surest
                    self.problem = problem
                continue
            if not any(_on_one_hand(hand, surer) for surer in hands):
                hands.append(hand)
        return hands

    def _problem(self, track: Track | None, color_box: Float64, cloud: CoarseCloud) -> str:
        """Return why the content of a box is not of a hand's size or does not fill the box."""
        settings = self._settings
        if track is None:
            return cloud.problem(color_box, settings)
        side_px = np.sqrt(np.prod(track.box[2:] - track.box[:2]))
        side_m = float(side_px * track.depth_m / cloud.camera.fx)
        if not settings.side_min_m <= side_m <= settings.side_max_m:
            return (
                f"what looks like a hand {track.depth_m:.2f} m away is {100 * side_m:.0f} cm "
                "large; show the bare hand"
            )
        if track.pixels * STEP_PX**2 < settings.filled_min * side_px**2:
            return cloud.problem(color_box, settings)
        return ""

    def _order(self, track: Track) -> float:
        if self._wanted in ("left", "right"):
            return float(track.box[0] if self._wanted == "left" else -track.box[2])
        return track.depth_m


def _on_one_hand(track: Track, other: Track) -> bool:
    """Return whether one of two boxes contains the other's centre."""
    return bool(
        inside_box(center(track.box)[None], other.box).any()
        or inside_box(center(other.box)[None], track.box).any()
    )


def _overlap(track: Track, other: Track) -> float:
    return float(overlaps(track.box[None], other.box[None])[0, 0])

"""Segmentation of the wearer's hand in successive frames, guided by a detector."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from handcal.core.errors import HandError
from handcal.core.types import Frame, HandCloud, Intrinsics
from handcal.hand.roi import Detector, RoiFinder
from handcal.hand.segment import segment_hand, segmented_window
from handcal.hand.settings import SegmentSettings
from handcal.hand.view import Box

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
            raise HandError(self._roi.problem)
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

"""Segmentation of the wearer's hand in successive frames, guided by a detector."""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from handcal.errors import HandError
from handcal.hand.roi import Detector, RoiFinder
from handcal.hand.segment import segment_hand, segmented_window
from handcal.hand.settings import SegmentSettings
from handcal.hand.view import Box
from handcal.types import Frame, HandCloud, Intrinsics

_EDGE_PX = 3  # a hand this close to a side of its window may continue beyond it


class HandFinder:
    """Segments the hand in each frame of a camera.

    The detector only selects where to look first. If it sees no hand, or the hand extends beyond
    that region, the nearest hand-sized object in the depth image is used.

    Parameters
    ----------
    settings : SegmentSettings
    detector : Detector, optional
        Without it only the depth image is used.
    """

    def __init__(self, settings: SegmentSettings, detector: Detector | None = None) -> None:
        self._settings = settings
        self._roi = RoiFinder(detector, settings) if detector else None

    def find(self, frame: Frame) -> HandCloud:
        """Return the hand in the camera's next frame.

        Raises
        ------
        HandError
            See `segment_hand`.
        """
        roi_px = self._roi.find(frame) if self._roi else None
        if roi_px is not None:
            window = segmented_window(roi_px, frame.depth_intrinsics, self._settings)
            with suppress(HandError):
                hand = segment_hand(frame, self._settings, roi_px)
                if _is_within(hand.box_px, window, frame.depth_intrinsics):
                    return hand
        return segment_hand(frame, self._settings)


def _is_within(box: Box, window: Box, camera: Intrinsics) -> bool:
    """Return whether a box keeps clear of a window's sides, other than the image's border."""
    gaps_px = np.subtract(box, window) * (1, 1, -1, -1)
    at_end = np.equal(window, (0, 0, camera.width, camera.height))
    return bool(((gaps_px > _EDGE_PX) | at_end).all())

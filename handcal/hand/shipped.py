"""The hand detector shipped with handcal, in the variant that this processor runs faster."""

from __future__ import annotations

import time
from functools import cache
from typing import get_args

import numpy as np

from handcal.core.errors import FileError
from handcal.core.frozen import require_kind
from handcal.core.types import Frame, HandCloud
from handcal.hand.detect import DetectSettings, HandDetector
from handcal.hand.finder import HandFinder
from handcal.hand.settings import Roi, SegmentSettings
from handcal.io.resources import resource_path

FLOAT_MODEL, INTEGER_MODEL = "hand_detector.onnx", "hand_detector_int8.onnx"

_RUNS = 5
_GAIN_MIN = 1.2  # a smaller gain is not worth the rounding of integers
_IMAGE = np.zeros((720, 1280, 3), np.uint8)


def segment(frame: Frame, *, roi: Roi = "detector") -> HandCloud:
    """Segment the bare hand in one frame.

    The hand must be from 0.35 to 0.70 m away, all of it in the image. For a camera's frames one
    after the other use `make_finder`, which follows the hand.

    Parameters
    ----------
    frame : Frame
        Depth, and colour for the detector; aligned or not. Without colour, ``"depth"`` is used.
    roi : {"detector", "left", "right", "depth"}
        Where to look: where the shipped detector sees a hand in the colour image (of several the
        nearest, the leftmost or the rightmost), or for the nearest hand-sized object in the depth
        image.

    Returns
    -------
    HandCloud
        About 5,000 points of the visible surface and the outer contour, in metres in frame D, the
        depth camera's; the mask in the depth image. The forearm is cut 2 cm behind the wrist.

    Raises
    ------
    HandError
        If there is no hand, or the image does not show all of it; the text says why.
    ValueError
        If `roi` is unknown.
    TypeError
        If `frame` is no `Frame`.

    Examples
    --------
    A frame of the simulated camera:

    >>> import handcal
    >>> hand = handcal.segment(handcal.simulated_frame(), roi="depth")
    >>> hand.points_m.shape[1], f"{hand.median_depth_m:.2f} m"
    (3, '0.48 m')
    """
    require_kind("frame", frame, Frame)
    if roi not in get_args(Roi):
        raise ValueError(f"unknown roi {roi!r}: choose from {', '.join(get_args(Roi))}")
    return make_finder(SegmentSettings(roi=roi)).find(frame)


def make_finder(settings: SegmentSettings) -> HandFinder:
    """Return a finder of the hand in a camera's frames.

    It uses the depth image alone if the detector cannot be loaded; ``handcal doctor`` says why.
    """
    if settings.roi == "depth":
        return HandFinder(settings)
    try:
        return HandFinder(settings, _shipped())
    except FileError:
        return HandFinder(settings)


@cache
def _shipped() -> HandDetector:
    """Load the detector once; it has no state."""
    return load_detector()


def load_detector(settings: DetectSettings | None = None) -> HandDetector:
    """Return the detector with 8-bit integers where that is faster, otherwise with 32-bit floats.

    Only some processors multiply 8-bit integers faster (x86 with VNNI, recent Arm), so both are
    timed, which takes half a second.

    Raises
    ------
    FileError
        If a model is missing or damaged.
    """
    floats, integers = (
        HandDetector(resource_path(name), settings) for name in (FLOAT_MODEL, INTEGER_MODEL)
    )
    # Alternately and in processor time, so that other programs do not decide; the first run is
    # cold. Sums, because some systems count processor time in steps of 16 ms.
    times_s = [(_seconds(floats), _seconds(integers)) for _ in range(1 + _RUNS)]
    float_s, integer_s = np.sum(times_s[1:], axis=0)
    return integers if float_s > _GAIN_MIN * integer_s else floats


def _seconds(detector: HandDetector) -> float:
    """Return the processor time of one run."""
    started_s = time.thread_time()
    detector.detect(_IMAGE)
    return time.thread_time() - started_s

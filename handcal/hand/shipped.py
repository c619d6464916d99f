"""The hand detector shipped with handcal, in the variant that this processor runs faster."""

from __future__ import annotations

import time
from functools import cache

import numpy as np

from handcal.errors import FileError
from handcal.hand.detect import DetectSettings, HandDetector
from handcal.hand.finder import HandFinder
from handcal.hand.settings import SegmentSettings
from handcal.io.resources import resource_path

FLOAT_MODEL, INTEGER_MODEL = "hand_detector.onnx", "hand_detector_int8.onnx"

_RUNS = 5
_GAIN_MIN = 1.2  # a smaller gain is not worth the rounding of integers
_IMAGE = np.zeros((720, 1280, 3), np.uint8)


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

"""Average precision of a detector."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from handcal.core.types import Bool, Float64
from handcal.hand.detect import overlaps

MATCH_OVERLAP = 0.5
"""Minimum intersection over union for a detection to count as a hit."""


@dataclass(frozen=True, slots=True, eq=False)
class ImageResult:
    """Detections in one image, and its annotated hands."""

    boxes: Float64
    """(N, 4); found: x0, y0, x1, y1 in pixels."""
    scores: Float64
    """(N,)."""
    hands: Float64
    """(M, 4); True boxes."""


@dataclass(frozen=True, slots=True, eq=False)
class PrecisionRecall:
    """A detector's curve over falling score."""

    scores: Float64
    precision: Float64
    recall: Float64
    """(K,)."""
    average_precision: float
    """Area under the curve with precision made monotonic (all-point interpolation, Everingham et
    al. 2010); NaN where there are no hands."""


def precision_recall(results: Iterable[tuple[ImageResult, Bool]]) -> PrecisionRecall:
    """Match detections with annotated hands, at an intersection over union of 0.5.

    Parameters
    ----------
    results : iterable of (ImageResult, (M,) bool)
        For each image, a mask of the hands that count; detections of other hands are ignored.
    """
    scores, hits, hands = [], [], 0
    for result, counted in results:
        hit = _matches(result, counted)
        judged = ~np.isnan(hit)
        scores.append(result.scores[judged])
        hits.append(hit[judged])
        hands += int(np.count_nonzero(counted))
    if not hands:
        return PrecisionRecall(np.empty(0), np.empty(0), np.empty(0), float("nan"))
    score, hit = np.concatenate(scores), np.concatenate(hits)
    order = np.argsort(-score, kind="stable")
    right = np.cumsum(hit[order])
    precision = right / np.arange(1, len(right) + 1)
    recall = right / hands
    envelope = np.maximum.accumulate(precision[::-1])[::-1]
    area = float(np.sum(np.diff(recall, prepend=0.0) * envelope))
    return PrecisionRecall(score[order], precision, recall, area)


def _matches(result: ImageResult, counted: Bool) -> Float64:
    """Return for each box 1 if it is a hand's best, 0 if false, NaN if on an ignored hand."""
    overlap = overlaps(result.boxes, result.hands)
    free = counted.copy()
    hit = np.zeros(len(result.boxes))
    for box in np.argsort(-result.scores, kind="stable"):
        candidates = np.where(free, overlap[box], 0.0)
        if candidates.size and candidates.max() >= MATCH_OVERLAP:
            free[np.argmax(candidates)] = False
            hit[box] = 1.0
        elif (overlap[box][~counted] >= MATCH_OVERLAP).any():
            hit[box] = np.nan
    return hit


def wilson(hits: int, trials: int) -> tuple[float, float]:
    """Return the ends of Wilson's 95 % score interval of a share (1927); at least one trial."""
    share, z = hits / trials, 1.96
    widened = 1.0 + z**2 / trials
    middle = (share + z**2 / (2 * trials)) / widened
    half = z * math.sqrt(share * (1.0 - share) / trials + z**2 / (4 * trials**2)) / widened
    return max(0.0, middle - half), min(1.0, middle + half)

"""Precision and recall of a hand detector on annotated photographs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from handcal.core.progress import Progress
from handcal.hand.detect import CANDIDATE_SCORE_MIN, DetectSettings, overlaps
from handcal.hand.finder import Detector
from handcal.lab.evaluate.annotations import Photo
from handcal.lab.evaluate.conditions import UNCHANGED, Conditions, shown
from handcal.lab.evaluate.precision import (
    MATCH_OVERLAP,
    ImageResult,
    PrecisionRecall,
    precision_recall,
    wilson,
)

EVALUATED = DetectSettings(score_min=CANDIDATE_SCORE_MIN)
"""A precision/recall curve needs the uncertain detections too."""

_CURVE_POINTS = 200


@dataclass(frozen=True, slots=True)
class FoundShare:
    """Share of hands found at the product's threshold, with its Wilson interval at 95 %."""

    skin: str
    aspect: str
    """Empty for all."""
    hands: int
    found: int
    share: float
    low: float
    high: float


def detect_all(
    photos: Sequence[Photo],
    detector: Detector,
    progress: Progress = Progress(),
    conditions: Conditions = UNCHANGED,
) -> list[ImageResult]:
    """Run a detector on every photograph; the boxes are in the photograph's own pixels.

    Raises
    ------
    HandcalError
        If a photograph cannot be read or shown under the conditions.
    """
    results = []
    for number, photo in enumerate(photos, 1):
        view = shown(photo, conditions)
        found = detector.detect(view.image)
        results.append(ImageResult(view.in_photo(found.boxes_px), found.scores, photo.boxes))
        progress.at(number / len(photos), "Looking for hands")
    return results


def summary(photos: Sequence[Photo], results: Sequence[ImageResult]) -> dict[str, float | None]:
    """Return the average precision over all hands and over those that matter most.

    The keys are ``ap50``, ``ap50_large`` (the data set's own rule), and ``ap50_rel15`` and
    ``ap50_rel25`` (hands whose box's share of the image is that number squared, or more). None
    where there is no such hand. For the last two, smaller boxes on no hand are ignored, as in
    COCO's area ranges.
    """
    return _averages(_curves(photos, results))


def found_shares(photos: Sequence[Photo], results: Sequence[ImageResult]) -> list[FoundShare]:
    """Return the share of hands found over all photographs, then by skin and aspect if given.

    A hand is found if a box whose score is at least the product's threshold overlaps it by half.
    """
    groups: dict[tuple[str, str], list[bool]] = {("", ""): []}
    for photo, result in zip(photos, results, strict=True):
        sure = result.boxes[result.scores >= DetectSettings().score_min]
        best = overlaps(sure, photo.boxes).max(axis=0, initial=0.0)
        for group in {("", ""), (photo.skin, photo.aspect)}:
            groups.setdefault(group, []).extend((best >= MATCH_OVERLAP).tolist())
    return [
        FoundShare(
            *group, len(hits), sum(hits), sum(hits) / len(hits), *wilson(sum(hits), len(hits))
        )
        for group, hits in sorted(groups.items())
        if hits
    ]


def _curves(photos: Sequence[Photo], results: Sequence[ImageResult]) -> dict[str, PrecisionRecall]:
    everything = [np.ones(len(photo.boxes), bool) for photo in photos]
    large = [photo.large for photo in photos]
    return {
        "ap50": precision_recall(zip(results, everything, strict=True)),
        "ap50_large": precision_recall(zip(results, large, strict=True)),
        "ap50_rel15": _of_size(photos, results, 0.15),
        "ap50_rel25": _of_size(photos, results, 0.25),
    }


def _averages(curves: dict[str, PrecisionRecall]) -> dict[str, float | None]:
    return {
        name: None if math.isnan(curve.average_precision) else curve.average_precision
        for name, curve in curves.items()
    }


def _of_size(
    photos: Sequence[Photo], results: Sequence[ImageResult], size_min: float
) -> PrecisionRecall:
    """Return the curve over hands of a relative size, smaller boxes left out unless on a hand."""
    judged = []
    for photo, result in zip(photos, results, strict=True):
        on_hand = overlaps(result.boxes, result.hands).max(1, initial=0.0) >= MATCH_OVERLAP
        kept = on_hand | (photo.relative_sizes_of(result.boxes) >= size_min)
        found = ImageResult(result.boxes[kept], result.scores[kept], result.hands)
        judged.append((found, photo.relative_sizes >= size_min))
    return precision_recall(judged)


def evaluation(photos: Sequence[Photo], results: Sequence[ImageResult]) -> dict[str, Any]:
    """Return `summary`, counts, `found_shares` and the curve over all hands, JSON-able."""
    curves = _curves(photos, results)
    return {
        **_averages(curves),
        "images": len(photos),
        "hands": sum(len(photo.boxes) for photo in photos),
        "found": [asdict(share) for share in found_shares(photos, results)],
        "curve": _thinned(curves["ap50"]),
    }


def _thinned(curve: PrecisionRecall) -> dict[str, list[float]]:
    """Return points of the curve evenly spaced in recall."""
    last = max(0, len(curve.recall) - 1)
    wanted = np.linspace(0.0, curve.recall[-1] if len(curve.recall) else 0.0, _CURVE_POINTS)
    kept = np.unique(np.searchsorted(curve.recall, wanted).clip(0, last))[: len(curve.recall)]
    return {
        name: getattr(curve, name)[kept].round(4).tolist()
        for name in ("scores", "precision", "recall")
    }

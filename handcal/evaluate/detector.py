"""How well a detector finds the hands in annotated photographs."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from handcal.evaluate.annotations import Photo, read_image
from handcal.evaluate.precision import ImageResult, PrecisionRecall, precision_recall
from handcal.hand.roi import Detector

SCORE_MIN = 0.02
"""A precision/recall curve wants the doubtful detections too."""

_CURVE_POINTS = 200


def detect_all(
    photos: Sequence[Photo], detector: Detector, report: Callable[[float], None] | None = None
) -> list[ImageResult]:
    """Run a detector on every photograph; `report` is told the share that is done.

    Raises
    ------
    FileError
        If a photograph cannot be read.
    """
    results = []
    for number, photo in enumerate(photos, 1):
        found = detector.detect(read_image(photo.path))
        results.append(ImageResult(found.boxes_px, found.scores, photo.boxes))
        if report is not None:
            report(number / len(photos))
    return results


def summary(photos: Sequence[Photo], results: Sequence[ImageResult]) -> dict[str, float | None]:
    """Return the average precision over all hands and over those that matter most.

    The keys are ``ap50``, ``ap50_large`` (the data set's own rule), and ``ap50_rel15`` and
    ``ap50_rel25`` (hands whose box's share of the image is that number squared, or more). None
    where there is no such hand.
    """
    counted = {
        "ap50": [np.ones(len(photo.boxes), bool) for photo in photos],
        "ap50_large": [photo.large for photo in photos],
        "ap50_rel15": [photo.relative_sizes >= 0.15 for photo in photos],
        "ap50_rel25": [photo.relative_sizes >= 0.25 for photo in photos],
    }
    precisions = {
        name: precision_recall(zip(results, chosen, strict=True)).average_precision
        for name, chosen in counted.items()
    }
    return {name: None if math.isnan(ap) else ap for name, ap in precisions.items()}


def evaluation(photos: Sequence[Photo], results: Sequence[ImageResult]) -> dict[str, Any]:
    """Return `summary` with counts and the precision/recall curve over all hands, JSON-able."""
    everything = [np.ones(len(photo.boxes), bool) for photo in photos]
    curve = precision_recall(zip(results, everything, strict=True))
    return {
        **summary(photos, results),
        "images": len(photos),
        "hands": sum(len(photo.boxes) for photo in photos),
        "curve": _thinned(curve),
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

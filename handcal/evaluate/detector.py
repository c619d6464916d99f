"""How well hands are found in annotated photographs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from handcal.evaluate.annotations import Photo
from handcal.evaluate.precision import ImageResult, precision_recall


def summary(photos: Sequence[Photo], results: Sequence[ImageResult]) -> dict[str, float]:
    """Return the average precision over all hands and over those that count most.

    The keys are ``ap50``, ``ap50_large`` (the data set's own rule), and ``ap50_rel15`` and
    ``ap50_rel25`` (hands whose box's side is that share of the image's, by area).
    """
    counted = {
        "ap50": [np.ones(len(photo.boxes), bool) for photo in photos],
        "ap50_large": [photo.large for photo in photos],
        "ap50_rel15": [photo.relative_sizes >= 0.15 for photo in photos],
        "ap50_rel25": [photo.relative_sizes >= 0.25 for photo in photos],
    }
    return {
        name: precision_recall(zip(results, chosen, strict=True)).average_precision
        for name, chosen in counted.items()
    }

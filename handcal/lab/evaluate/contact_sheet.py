"""The detector's failures as one picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from handcal.core.types import Float64, UInt8
from handcal.hand.detect import DetectSettings, overlaps
from handcal.io.images import write_png
from handcal.lab.evaluate.annotations import Photo
from handcal.lab.evaluate.precision import MATCH_OVERLAP, ImageResult

_COLUMNS = 6
_TILE_PX, _MOST_TILES = 240, 36
_MISSED, _FALSE, _FOUND = (255, 60, 60), (255, 200, 0), (60, 220, 60)


def contact_sheet(
    photos: Sequence[Photo], results: Sequence[ImageResult], score_min: float
) -> UInt8:
    """Draw the photographs with the worst failures; mark missed hands and false detections.

    Parameters
    ----------
    photos : sequence of Photo
    results : sequence of ImageResult
        One for each photograph.
    score_min : float
        Detections with a lower score are ignored.

    Returns
    -------
    (h, w, 3) uint8
        RGB; empty if nothing went wrong.
    """
    failures = []
    for photo, result in zip(photos, results, strict=True):
        found = result.boxes[result.scores >= score_min]
        overlap = overlaps(found, photo.boxes)
        missed = photo.boxes[overlap.max(0, initial=0.0) < MATCH_OVERLAP]
        false = found[overlap.max(1, initial=0.0) < MATCH_OVERLAP]
        if len(missed) or len(false):
            failures.append((_area(missed) + _area(false), photo, found, missed, false))
    failures.sort(key=lambda failure: -failure[0])
    drawn = [_tile(*failure[1:]) for failure in failures[:_MOST_TILES]]
    drawn += [np.zeros((_TILE_PX, _TILE_PX, 3), np.uint8)] * (-len(drawn) % _COLUMNS)
    rows = [np.hstack(drawn[i : i + _COLUMNS]) for i in range(0, len(drawn), _COLUMNS)]
    return np.vstack(rows) if rows else np.zeros((0, 0, 3), np.uint8)


def write_contact_sheet(
    path: Path, photos: Sequence[Photo], results: Sequence[ImageResult]
) -> None:
    """Write a `contact_sheet` at the detector's default threshold, as PNG.

    Without failures it is one black tile.

    Raises
    ------
    FileError
        If it cannot be written, or its name does not end in ``.png``.
    """
    sheet = contact_sheet(photos, results, DetectSettings().score_min)
    write_png(path, sheet if sheet.size else np.zeros((_TILE_PX, _TILE_PX, 3), np.uint8))


def _area(boxes: Float64) -> float:
    """Return the boxes' joint area: large hands matter most."""
    return float(np.prod(boxes[:, 2:] - boxes[:, :2], axis=1).sum())


def _tile(photo: Photo, found: Float64, missed: Float64, false: Float64) -> UInt8:
    scale = _TILE_PX / max(photo.width, photo.height)
    size = max(1, round(scale * photo.width)), max(1, round(scale * photo.height))
    image = cv2.resize(photo.read(), size)
    for boxes, color, text in (
        (found, _FOUND, ""),
        (missed, _MISSED, "missed"),
        (false, _FALSE, "false"),
    ):
        for x0, y0, x1, y1 in (scale * boxes).astype(int).tolist():
            cv2.rectangle(image, (x0, y0), (x1, y1), color, 2)
            cv2.putText(image, text, (x0, y0 - 3), cv2.FONT_HERSHEY_SIMPLEX, 0.4, color, 1)
    tile = np.zeros((_TILE_PX, _TILE_PX, 3), np.uint8)
    tile[: size[1], : size[0]] = image
    return tile

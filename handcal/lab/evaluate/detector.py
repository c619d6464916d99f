"""The hand detector on annotated photographs: precision and recall, and its worst failures."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal, TypeAlias

import cv2
import numpy as np

from handcal.core.errors import HandcalError
from handcal.core.progress import Progress
from handcal.core.types import Bool, Float64, UInt8
from handcal.hand.detect import CANDIDATE_SCORE_MIN, DetectSettings, overlaps
from handcal.hand.roi import Detector
from handcal.io.images import write_png
from handcal.lab.evaluate.annotations import Photo

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


def _interval(hits: Sequence[bool]) -> tuple[float, float]:
    """Return the ends of Wilson's 95 % score interval of a share (1927)."""
    from scipy.stats import binomtest  # takes a second to import

    interval = binomtest(sum(hits), len(hits)).proportion_ci(0.95, "wilson")
    return float(interval.low), float(interval.high)


# Conditions under which photographs are shown to a detector: light, size of the hand, gloves.

Glove: TypeAlias = Literal["blue", "black"]

_SHAPE = (480, 640)  # of the image in which a hand is shown at a given height
_GRAY = 127
_GLOVES: dict[Glove, tuple[float, float, float]] = {
    "blue": (45.0, 95.0, 185.0),
    "black": (32.0, 32.0, 34.0),
}


@dataclass(frozen=True, slots=True)
class Conditions:
    """Changes of a photograph before the detector sees it; the defaults change nothing."""

    brightness: float = 1.0
    """Factor on the pixels' values."""
    hand_height: float | None = None
    """Height of the first hand's box as a share of a grey 640x480 image around the photograph."""
    glove: Glove | None = None
    """Colour given to everything in the hands' boxes that is not white, with its shading."""


UNCHANGED = Conditions()


@dataclass(frozen=True, slots=True, eq=False)
class Shown:
    """A photograph as the detector sees it."""

    image: UInt8
    """(H, W, 3); RGB."""
    scale: float
    offset_px: Float64
    """(2,); a pixel of the photograph is shown at `scale` times its place plus this."""

    def in_photo(self, boxes: Float64) -> Float64:
        """Return boxes (N, 4) of the shown image in the photograph's pixels."""
        original: Float64 = (boxes - np.tile(self.offset_px, 2)) / self.scale
        return original


def shown(photo: Photo, conditions: Conditions) -> Shown:
    """Return a photograph under the given conditions.

    Raises
    ------
    FileError
        If the photograph cannot be read.
    HandcalError
        If the hand's height is given and the photograph has no hand.
    """
    image = photo.read()
    if conditions.glove is not None:
        image = _gloved(image, photo.boxes, conditions.glove)
    if conditions.brightness != 1.0:
        image = (image * conditions.brightness).clip(0.0, 255.0).astype(np.uint8)
    if conditions.hand_height is None:
        return Shown(image, 1.0, np.zeros(2))
    if not len(photo.boxes):
        raise HandcalError(f"{photo.path} has no hand to scale", "leave out the hand's height")
    return _at_height(image, photo.boxes[0], conditions.hand_height)


def _at_height(image: UInt8, box: Float64, share: float) -> Shown:
    """Scale an image until a box has a height, and place the box in the middle of a grey image."""
    height, width = _SHAPE
    scale = float(share * height / (box[3] - box[1]))
    size = [max(1, round(scale * side)) for side in image.shape[1::-1]]
    method = cv2.INTER_AREA if scale < 1.0 else cv2.INTER_LINEAR
    scaled = np.asarray(cv2.resize(image, size, interpolation=method), np.uint8)
    wanted = np.array([width, height]) / 2 - scale * (box[:2] + box[2:]) / 2
    x, y = (int(place) for place in wanted.round())
    canvas = np.full((height, width, 3), _GRAY, np.uint8)
    part = scaled[max(0, -y) : max(0, height - y), max(0, -x) : max(0, width - x)]
    top, left = max(0, y), max(0, x)
    canvas[top : top + part.shape[0], left : left + part.shape[1]] = part
    return Shown(canvas, scale, np.array([x, y], np.float64))


def _gloved(image: UInt8, boxes: Float64, glove: Glove) -> UInt8:
    """Recolour the hands of a photograph on white, with their own shading."""
    height, width = image.shape[:2]
    inside = np.zeros((height, width), bool)
    for x0, y0, x1, y1 in boxes.round().astype(int).clip(0).tolist():
        inside[y0:y1, x0:x1] = True
    darkest = image.min(axis=2)  # white has no dark channel, skin has
    level, _ = cv2.threshold(darkest, 0, 255, cv2.THRESH_OTSU)
    hand = inside & (darkest <= level)
    light = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)[hand].astype(np.float64)
    shading = light / max(1.0, float(np.median(light))) if len(light) else light
    recoloured = image.copy()
    recoloured[hand] = (shading[:, None] * np.array(_GLOVES[glove])).clip(0.0, 255.0)
    return recoloured


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
        FoundShare(*group, len(hits), sum(hits), sum(hits) / len(hits), *_interval(hits))
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

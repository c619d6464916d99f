"""Find hands in a colour image with a network run by onnxruntime."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from handcal.core.errors import FileError
from handcal.core.frozen import freeze
from handcal.core.types import Float32, Float64, UInt8

STRIDES = (8, 16, 32)
"""Strides of the network's three levels, in pixels."""

CANDIDATE_SCORE_MIN = 0.02
"""Candidates with a lower score are ignored."""

DIM_PERCENTILE = 99
"""Percentile of an image's values by which it is dim; the pixels above may show a lamp."""

_ENDS = [("image", "tensor(uint8)"), ("raw", "tensor(float)")]
_GRAY = 127  # value of the network's zero padding
# Share of the largest scale. For 16:9 it saves an eighth of the canvas, much of it gray.
_LARGE_ENOUGH = 0.95
# Intersections over union: above the first, of two hands the one with the lower score is dropped;
# from the second on, a candidate has a vote on the best one's box, the mean of all that have,
# weighted by score (box voting, Gidaris & Komodakis 2015).
_OVERLAP_MAX, _AGREEMENT_MIN = 0.4, 0.6
_MOST_HANDS = 100  # as in COCO's average precision
# An image is dim if its `DIM_PERCENTILE` of the pixels' brightest channel is below the first; a
# gain raises that to the second. A larger gain would show noise rather than hands.
_DIM_BELOW, _BRIGHT, _GAIN_MAX = 160, 240, 4.0
# A second look is taken if the surest hand's score is in this range, and the square root of its
# share of the image at least that size. It has few pixels, because the network sees all fingers of
# a large hand only on a small image. Its margin is a multiple of the hand's longer side.
_UNSURE, _SECOND_SIZE_MIN, _SECOND_MARGIN, _SECOND_PIXELS = (0.2, 0.7), 0.1, 0.5, 18_432
_NEAR = 0.1  # least overlap of what a second look may add to the hand that it is about


@dataclass(frozen=True, slots=True)
class DetectSettings:
    """Settings of the detector."""

    pixels: int = 110_592
    """Largest number of pixels of the network's input; the image is scaled to it."""
    score_min: float = 0.3
    """Lowest score of a returned hand; at least `CANDIDATE_SCORE_MIN`."""


@dataclass(frozen=True, slots=True, eq=False)
class Detections:
    """Hands found in an image, highest score first."""

    boxes_px: Float64
    """(N, 4); x0, y0, x1, y1 from the image's upper left corner."""
    scores: Float64
    """(N,); overlap with the true box as predicted by the network, 0 to 1."""

    def __post_init__(self) -> None:
        freeze(self, "boxes_px", np.float64, None, 4)
        freeze(self, "scores", np.float64, None)


class HandDetector:
    """The network, ready to run on one thread.

    Parameters
    ----------
    model : Path
        ONNX, as `handcal.train` exports it.
    settings : DetectSettings, optional

    Attributes
    ----------
    model : Path

    Raises
    ------
    FileError
        If the model cannot be loaded or is another network, or onnxruntime cannot be imported.
    """

    def __init__(self, model: Path, settings: DetectSettings | None = None) -> None:
        self.model = model
        self._settings = settings or DetectSettings()
        try:
            onnxruntime = import_onnxruntime()
            options = onnxruntime.SessionOptions()
            options.intra_op_num_threads = 1
            options.log_severity_level = 3
            self._session = onnxruntime.InferenceSession(
                model, options, providers=["CPUExecutionProvider"]
            )
            ends = [*self._session.get_inputs(), *self._session.get_outputs()]
            if (found := [(end.name, end.type) for end in ends]) != _ENDS:
                raise ValueError(f"it maps {found}, not {_ENDS}")
        except Exception as error:  # onnxruntime's exceptions have no common base
            raise FileError(f"cannot load the hand detector {model}: {error}") from error

    def detect(self, color: UInt8, pixels: int | None = None) -> Detections:
        """Find the hands in an image.

        Parameters
        ----------
        color : (H, W, 3) uint8
            RGB.
        pixels : int, optional
            Overrides the settings' `pixels`; at least 1024. The network then looks once only.
        """
        if pixels is not None:
            return _at_least(self._settings.score_min, self._look(color, pixels))
        found = self._look(color, self._settings.pixels)
        part = _unsure_part(found, color.shape[:2])
        if part is not None:
            x0, y0, x1, y1 = part
            again = self._look(color[y0:y1, x0:x1], _SECOND_PIXELS)
            again = Detections(again.boxes_px + np.array([x0, y0, x0, y0]), again.scores)
            found = _with_second(found, again)
        return _at_least(self._settings.score_min, found)

    def _look(self, color: UInt8, pixels: int) -> Detections:
        """Run the network once; the scores are at least the lowest that a second look needs."""
        canvas, scale = letterbox(color, pixels)
        _, (width, height), _ = _fit(*color.shape[:2], pixels)
        canvas[:height, :width] = brightened(canvas[:height, :width])
        [raw] = self._session.run(["raw"], {"image": canvas[None]})
        settings = self._settings
        lowest = replace(settings, score_min=min(settings.score_min, _UNSURE[0]))
        boxes, scores = decode(raw, canvas.shape[:2], lowest)
        return Detections(boxes / scale, scores)


def import_onnxruntime() -> Any:
    """Return onnxruntime, imported with its telemetry off.

    It then keeps no device id in the user's folder and sends nothing. Call it before anything else
    imports onnxruntime.
    """
    # Both are read when the library is loaded; the second is the first's former name.
    for variable in ("ORT_DISABLE_TELEMETRY", "ORT_TELEMETRY_DISABLED"):
        os.environ[variable] = "1"
    import onnxruntime

    onnxruntime.disable_telemetry_events()  # Windows' own tracing knows no such variable
    return onnxruntime


def letterbox(color: UInt8, pixels: int) -> tuple[UInt8, float]:
    """Fit an image into the upper left of a canvas whose sides are multiples of the last stride.

    Parameters
    ----------
    color : (h, w, 3) uint8
    pixels : int
        Upper limit of the canvas, which is the smallest with nearly the largest image scale.

    Returns
    -------
    canvas : (H, W, 3) uint8
        The rest is grey.
    scale : float
        Scale of the image in the canvas.
    """
    scale, size, canvas_shape = _fit(*color.shape[:2], pixels)
    canvas = np.full((*canvas_shape, 3), _GRAY, np.uint8)
    while color.shape[0] >= 2 * size[1] and color.shape[1] >= 2 * size[0]:  # against aliasing
        color = _halved(color)
    cv2.resize(color, size, dst=canvas[: size[1], : size[0]])
    return canvas, scale


def brightened(color: UInt8) -> UInt8:
    """Return an image multiplied by a gain if it is dim; a bright one is returned as it is.

    The network has seen few dim images. Of the pixels' brightest channel, `DIM_PERCENTILE` decides.
    """
    rare = color[::2, ::2]
    brightest = np.maximum(np.maximum(rare[..., 0], rare[..., 1]), rare[..., 2])
    value = float(np.percentile(brightest, DIM_PERCENTILE))
    if value >= _DIM_BELOW:
        return color
    gain = min(_GAIN_MAX, _BRIGHT / max(value, 1.0))
    return np.asarray(cv2.convertScaleAbs(color, alpha=gain), np.uint8)


@lru_cache
def _fit(height: int, width: int, pixels: int) -> tuple[float, tuple[int, int], tuple[int, int]]:
    """Return an image's scale in its canvas, its width and height there, the canvas's shape."""
    cell = STRIDES[-1]
    cells = pixels // cell**2
    fits = [
        (min(columns * cell / width, rows * cell / height), columns, rows)
        for columns in range(1, cells + 1)
        for rows in range(1, cells // columns + 1)
    ]
    scale_min = _LARGE_ENOUGH * max(fits)[0]
    scale, columns, rows = min(
        (fit for fit in fits if fit[0] >= scale_min), key=lambda fit: (fit[1] * fit[2], -fit[0])
    )
    size = (
        min(max(1, round(scale * width)), columns * cell),
        min(max(1, round(scale * height)), rows * cell),
    )
    return scale, size, (rows * cell, columns * cell)


def _halved(color: UInt8) -> UInt8:
    height, width = (side // 2 for side in color.shape[:2])
    even = color[: 2 * height, : 2 * width]  # OpenCV is ten times slower with odd sizes
    return np.asarray(cv2.resize(even, (width, height), interpolation=cv2.INTER_AREA), np.uint8)


@lru_cache
def points(height: int, width: int) -> tuple[Float32, Float32]:
    """Return the network's anchor points for a canvas, (N, 2) in pixels, and strides (N,).

    Both arrays are read-only.
    """
    places, strides = [], []
    for stride in STRIDES:
        y, x = np.mgrid[0:height:stride, 0:width:stride]
        places.append(np.column_stack([x.ravel(), y.ravel()]))
        strides.append(np.full(x.size, stride))
    both = np.concatenate(places).astype(np.float32), np.concatenate(strides).astype(np.float32)
    for values in both:
        values.flags.writeable = False
    return both


def decode(
    raw: Float32, canvas_shape: tuple[int, int], settings: DetectSettings
) -> tuple[Float64, Float64]:
    """Return the boxes (N, 4) in the canvas and scores (N,) of raw predictions (5, P).

    Sorted by descending score, after non-maximum suppression and box voting.
    """
    logit_min = np.log(CANDIDATE_SCORE_MIN / (1.0 - CANDIDATE_SCORE_MIN))
    kept = np.flatnonzero(raw[0] > logit_min)
    kept = kept[np.argsort(-raw[0, kept], kind="stable")][:1000]
    at, strides = (values[kept] for values in points(*canvas_shape))
    left, top, right, bottom = np.exp(raw[1:, kept].astype(np.float64).clip(-6.0, 6.0)) * strides
    boxes = np.stack([at[:, 0] - left, at[:, 1] - top, at[:, 0] + right, at[:, 1] + bottom], axis=1)
    scores = 1.0 / (1.0 + np.exp(-raw[0, kept].astype(np.float64)))
    sure = boxes[: np.count_nonzero(scores >= settings.score_min)]
    chosen = _suppress(sure)
    votes = (overlaps(boxes[chosen], boxes) >= _AGREEMENT_MIN) * scores
    return votes @ boxes / votes.sum(axis=1, keepdims=True), scores[chosen]


def _unsure_part(found: Detections, shape: tuple[int, ...]) -> tuple[int, int, int, int] | None:
    """Return the surroundings of the surest hand as x0, y0, x1, y1; None if it is sure or small."""
    least, sure = _UNSURE
    if not len(found.scores) or not least <= found.scores[0] < sure:
        return None
    height, width = shape[:2]
    box = found.boxes_px[0]
    sides = box[2:] - box[:2]
    if np.prod(sides) < _SECOND_SIZE_MIN**2 * height * width:
        return None
    margin = _SECOND_MARGIN * sides.max()
    low = np.floor(box[:2] - margin).clip(0, [width - 1, height - 1])
    high = np.ceil(box[2:] + margin).clip(low + 1, [width, height])
    x0, y0, x1, y1 = np.concatenate([low, high]).astype(int).tolist()
    return x0, y0, x1, y1


def _with_second(first: Detections, second: Detections) -> Detections:
    """Add what a second look saw of the surest hand.

    Boxes that agree are averaged, weighted by score. Both are kept of two that do not: one around
    the palm alone is often surer than the one around palm and folded fingers.
    """
    boxes, scores = first.boxes_px.copy(), first.scores.copy()
    about = overlaps(second.boxes_px, boxes[:1])[:, 0] >= _NEAR
    for box, score in zip(second.boxes_px[about], second.scores[about], strict=True):
        shared = overlaps(box[None], boxes)[0]
        best = int(shared.argmax())
        if shared[best] < _AGREEMENT_MIN:
            boxes, scores = np.vstack([boxes, box]), np.append(scores, score)
            continue
        boxes[best] = (scores[best] * boxes[best] + score * box) / (scores[best] + score)
        scores[best] = max(scores[best], score)
    order = np.argsort(-scores, kind="stable")
    return Detections(boxes[order], scores[order])


def _at_least(score_min: float, found: Detections) -> Detections:
    kept = found.scores >= score_min
    return Detections(found.boxes_px[kept], found.scores[kept])


def overlaps(boxes: Float64, others: Float64) -> Float64:
    """Return the intersection over union of boxes (N, 4) with others (M, 4), as (N, M)."""
    low = np.maximum(boxes[:, None, :2], others[None, :, :2])
    high = np.minimum(boxes[:, None, 2:], others[None, :, 2:])
    shared = np.prod((high - low).clip(0.0), axis=2)
    areas, other_areas = (np.prod(b[:, 2:] - b[:, :2], axis=1) for b in (boxes, others))
    union = areas[:, None] + other_areas[None] - shared
    result: Float64 = shared / np.maximum(union, 1e-9)
    return result


def _suppress(boxes: Float64) -> list[int]:
    """Return the indices of boxes, sorted best first, that overlap no better one."""
    chosen: list[int] = []
    remaining = np.arange(len(boxes))
    while len(remaining) and len(chosen) < _MOST_HANDS:
        best, remaining = remaining[0], remaining[1:]
        chosen.append(int(best))
        apart = overlaps(boxes[best : best + 1], boxes[remaining])[0] <= _OVERLAP_MAX
        remaining = remaining[apart]
    return chosen

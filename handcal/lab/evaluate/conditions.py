"""Conditions under which photographs are shown to a detector: light, size of the hand, gloves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import cv2
import numpy as np

from handcal.core.errors import HandcalError
from handcal.core.types import Float64, UInt8
from handcal.lab.evaluate.annotations import Photo

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

"""Annotated photographs of hands, in the format of the Oxford Hands data as handcal keeps it.

A JSON object: file name to ``width``, ``height`` and ``hands``, each hand with ``box`` [x0, y0, x1,
y1], ``quad`` (its four corners) and ``large``. The data set counts pixels from 1: (1, 1) is the
middle of the first. ``skin`` and ``aspect`` of a photograph, if given, are names of its group.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from handcal.core.errors import FileError
from handcal.core.types import Bool, Float64, UInt8
from handcal.io.files import read_json
from handcal.io.images import read_image

_CORNER = 0.5  # the image's upper left corner in these coordinates
_NAME_MAX = 40  # letters of a group's name
_REACH = 10.0  # largest distance of a box from the image, in image sides


@dataclass(frozen=True, slots=True, eq=False)
class Photo:
    """One annotated photograph."""

    path: Path
    width: int
    height: int
    boxes: Float64
    """(M, 4); x0, y0, x1, y1 of each hand, px from the image's upper left corner."""
    quads: Float64
    """(M, 4, 2); the same hands' corners, px."""
    large: Bool
    """(M,); the data set's own rule."""
    skin: str = ""
    aspect: str = ""
    """Names of the skin's tone and of the side of the hand, empty if unknown."""

    @property
    def relative_sizes(self) -> Float64:
        """(M,) float64: `relative_sizes_of` the hands."""
        return self.relative_sizes_of(self.boxes)

    def relative_sizes_of(self, boxes: Float64) -> Float64:
        """Return the square root of each box's (N, 4) share of the image, (N,)."""
        sides = boxes[:, 2:] - boxes[:, :2]
        sizes: Float64 = np.sqrt(np.prod(sides, axis=1) / (self.width * self.height))
        return sizes

    def read(self) -> UInt8:
        """Return the photograph, (height, width, 3) RGB.

        Raises
        ------
        FileError
            If it cannot be read, or is of another size than was annotated.
        """
        flags = cv2.IMREAD_COLOR_RGB | cv2.IMREAD_IGNORE_ORIENTATION
        image: UInt8 = read_image(self.path, flags)
        height, width = image.shape[:2]
        if (width, height) != (self.width, self.height):
            raise FileError(
                f"{self.path} is {width}x{height} pixels, annotated as {self.width}x{self.height}"
            )
        return image


def read_annotations(images: Path, annotations: Path) -> list[Photo]:
    """Return the photographs that a file of annotations lists.

    Raises
    ------
    FileError
        If the file cannot be read, is not of that format or lists no photograph.
    """
    try:
        photos = [_photo(images, name, entry) for name, entry in read_json(annotations).items()]
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise FileError(f"{annotations} is not a file of hand annotations: {error!r}") from error
    if not photos:
        raise FileError(f"{annotations} lists no photograph", "choose another folder")
    return photos


def _photo(images: Path, name: str, entry: dict[str, Any]) -> Photo:
    # A name out of the folder, or that no file can have, is an attack or a mistake.
    if not name.isprintable() or {"..", Path(name).anchor} & set(Path(name).parts):
        raise ValueError(f"{name!r} is not the name of a photograph in {images}")
    hands = entry["hands"]
    width, height = int(entry["width"]), int(entry["height"])
    if width < 1 or height < 1:
        raise ValueError(f"{name} is {width}x{height} pixels large")
    boxes = np.array([hand["box"] for hand in hands], np.float64).reshape(-1, 4) - _CORNER
    quads = np.array([hand["quad"] for hand in hands], np.float64).reshape(-1, 4, 2) - _CORNER
    shown = boxes.clip(0.0, [width, height, width, height])
    if not ((shown[:, :2] < shown[:, 2:]).all() and np.isfinite(quads).all()):
        raise ValueError(f"{name} has a hand that is nowhere in it")
    if (np.abs(boxes) > _REACH * max(width, height)).any():
        raise ValueError(f"{name} has a hand many times its own size")
    large = [hand["large"] for hand in hands]
    if not all(isinstance(one, bool) for one in large):
        raise TypeError(f'{name}: "large" must be true or false')
    skin, aspect = entry.get("skin", ""), entry.get("aspect", "")
    if not all(isinstance(one, str) and len(one) <= _NAME_MAX for one in (skin, aspect)):
        raise TypeError(f'{name}: "skin" and "aspect" must be short texts')
    return Photo(images / name, width, height, boxes, quads, np.array(large, bool), skin, aspect)

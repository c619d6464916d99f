"""Annotated photographs of hands, in the format of the Oxford Hands data as handcal keeps it.

A JSON object: file name to ``width``, ``height`` and ``hands``, each hand with ``box`` [x0, y0, x1,
y1], ``quad`` (its four corners) and ``large``.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from handcal.errors import FileError
from handcal.files import read_json
from handcal.types import Bool, Float64, UInt8


@dataclass(frozen=True, slots=True, eq=False)
class Photo:
    """One annotated photograph.

    Attributes
    ----------
    path : Path
    width, height : int
    boxes : (M, 4) float64
        x0, y0, x1, y1 of each hand, px.
    quads : (M, 4, 2) float64
        The same hands' corners, px.
    large : (M,) bool
        The data set's own rule.
    """

    path: Path
    width: int
    height: int
    boxes: Float64
    quads: Float64
    large: Bool

    @property
    def relative_sizes(self) -> Float64:
        """(M,) float64: square root of each box's share of the image."""
        sides = self.boxes[:, 2:] - self.boxes[:, :2]
        sizes: Float64 = np.sqrt(np.prod(sides, axis=1) / (self.width * self.height))
        return sizes


def read_annotations(images: Path, annotations: Path) -> list[Photo]:
    """Return the photographs that a file of annotations lists.

    Raises
    ------
    FileError
        If the file cannot be read or is not of that format.
    """
    try:
        return [_photo(images / name, entry) for name, entry in read_json(annotations).items()]
    except (KeyError, TypeError, ValueError) as error:
        raise FileError(f"{annotations} is not a file of hand annotations: {error!r}") from error


def _photo(path: Path, entry: dict[str, Any]) -> Photo:
    hands = entry["hands"]
    width, height = int(entry["width"]), int(entry["height"])
    if width < 1 or height < 1:
        raise ValueError(f"{path.name} is {width}x{height} pixels large")
    return Photo(
        path,
        width,
        height,
        np.array([hand["box"] for hand in hands], np.float64).reshape(-1, 4),
        np.array([hand["quad"] for hand in hands], np.float64).reshape(-1, 4, 2),
        np.array([hand["large"] for hand in hands], bool),
    )


def read_image(path: Path, flags: int = cv2.IMREAD_COLOR_RGB) -> UInt8:
    """Return an image, by default as (h, w, 3) RGB.

    Raises
    ------
    FileError
        If it cannot be read.
    """
    image = cv2.imread(str(path), flags)
    if image is None:
        raise FileError(f"cannot read the image {path}")
    return image.astype(np.uint8, copy=False)

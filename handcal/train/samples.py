"""Training samples: crops of photographs, and simulated hands alone or pasted on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import torch
from torch import Tensor
from torch.utils.data import Dataset

from handcal.core.types import Float32, Float64, UInt8
from handcal.io.files import read_json
from handcal.io.images import read_image
from handcal.lab.evaluate.annotations import Photo
from handcal.train.augment import (
    blemish,
    box_corners,
    clipped,
    random_warp,
    relight,
    transform_corners,
)

_SHOWN_MIN = 0.35
_SMALLEST_PX = 9.0
_GRAY = (127, 127, 127)
# Photographs are annotated with rotated rectangles, which may be rotated further; the upright boxes
# of simulated hands only grow.
_PHOTO_TURN_RAD = 0.6
_SIMULATED_TURN_RAD = 0.2
# A hand with a smaller share of a blend is ignored.
_BLEND_MIN = 0.35


@dataclass(frozen=True, slots=True)
class SampleSettings:
    """Distribution of the samples."""

    side_px: int = 288
    """Side of the square crops; a multiple of the largest stride."""
    whole_px: float = 332.0
    """Side of a square with as many pixels as the detector's input."""
    zoomed: float = 0.5
    """Share of crops scaled so that one hand fills 12–85 % of the side, like a wearer's; the others
    have about the scale of the detector's input."""
    centered: float = 0.72
    """Share of these crops centred on that hand. The others show any part of the photograph at the
    same scale: faces, arms and other objects."""
    zoom_max: float = 4.0
    """Largest enlargement of a photograph."""
    large_weight: float = 2.0
    """Relative probability of photographs in which a hand fills 15 % or more."""
    simulated: float = 0.1
    pasted: float = 0.08
    """Shares of simulated images, and of photographs with a simulated hand."""
    blended: float = 0.2
    """Share of samples that blend two others."""
    disturbed: float = 1.0
    """Share of samples whose light and sharpness are changed."""


class Samples(Dataset[tuple[UInt8, Float32]]):
    """Sample i is a pure function of the seed and i, so that training can resume anywhere.

    Parameters
    ----------
    photos : sequence of Photo
    hands : Path
        Folder written by `render_hands`.
    settings : SampleSettings
    seed : int
    """

    def __init__(
        self, photos: Sequence[Photo], hands: Path, settings: SampleSettings, seed: int
    ) -> None:
        self._photos = photos
        self._hands = [
            (hands / name, np.array([box], np.float64))
            for name, box in read_json(hands / "boxes.json").items()
        ]
        self._settings = settings
        self._seed = seed
        weights = np.array(
            [
                settings.large_weight if photo.relative_sizes.max(initial=0.0) >= 0.15 else 1.0
                for photo in photos
            ]
        )
        self._bounds = np.cumsum(weights) / weights.sum()

    def __getitem__(self, index: int) -> tuple[UInt8, Float32]:
        """Return a crop (side, side, 3) and its boxes (M, 5) as `clipped` gives them."""
        rng = np.random.default_rng((self._seed, index))
        image, boxes = self._view(rng)
        if rng.random() < self._settings.blended:
            image, boxes = _blend(rng, image, boxes, *self._view(rng))
        if rng.random() < self._settings.disturbed:
            image = blemish(rng, relight(rng, image)).astype(np.uint8, copy=False)
        return image, boxes

    def _view(self, rng: np.random.Generator) -> tuple[UInt8, Float32]:
        kind = rng.random() - self._settings.simulated
        if kind < 0.0:
            return self._simulated(rng)
        image, boxes = self._photographed(rng)
        if kind < self._settings.pasted:
            image, boxes = self._paste(rng, image, boxes)
        return image, boxes

    def _photographed(self, rng: np.random.Generator) -> tuple[UInt8, Float32]:
        photo = self._photos[int(np.searchsorted(self._bounds, rng.random()))]
        warp = self._part(rng, photo)
        image = self._warped(photo.read(), warp)
        return image, self._clipped(transform_corners(warp, photo.quads))

    def _part(self, rng: np.random.Generator, photo: Photo) -> Float64:
        """Select a part of a photograph: around one of its hands, or anywhere."""
        settings = self._settings
        image_px = np.sqrt(photo.width * photo.height)
        scale = settings.whole_px / image_px * np.exp(rng.uniform(np.log(0.75), np.log(1.5)))
        center = rng.uniform(0.0, 1.0, 2) * (photo.width, photo.height)
        if len(photo.boxes):
            sizes = photo.relative_sizes
            hand = rng.choice(len(sizes), p=sizes / sizes.sum())
            if rng.random() < settings.zoomed:
                wanted_px = settings.side_px * np.exp(rng.uniform(np.log(0.12), np.log(0.85)))
                scale = min(wanted_px / (sizes[hand] * image_px), settings.zoom_max)
            if rng.random() < settings.centered:
                center = (photo.boxes[hand, :2] + photo.boxes[hand, 2:]) / 2
        size_px = photo.width, photo.height
        return random_warp(rng, size_px, center, scale, settings.side_px, _PHOTO_TURN_RAD)

    def _simulated(self, rng: np.random.Generator) -> tuple[UInt8, Float32]:
        picture, boxes, warp = self._raised(rng)
        return self._warped(picture[..., :3], warp), boxes

    def _paste(
        self, rng: np.random.Generator, image: UInt8, boxes: Float32
    ) -> tuple[UInt8, Float32]:
        """Draw a simulated hand over an image; hands that it covers are ignored."""
        picture, pasted, warp = self._raised(rng)
        cut = self._warped(np.ascontiguousarray(picture), warp, border=0)
        opaque = cv2.GaussianBlur(cut[..., 3:], (3, 3), 0.7)[..., None] / np.float32(255.0)
        blended = cut[..., :3] * opaque + image * (1.0 - opaque)
        for box in boxes:
            x0, y0, x1, y1 = box[:4].astype(int)
            box[4] = max(box[4], opaque[y0 : y1 + 1, x0 : x1 + 1].mean() > 0.3)
        return blended.astype(np.uint8), np.concatenate([boxes, pasted])

    def _raised(self, rng: np.random.Generator) -> tuple[UInt8, Float32, Float64]:
        """Return a simulated image (RGBA), with the box and map of a view of it."""
        path, box = self._hands[rng.integers(len(self._hands))]
        picture = read_image(path, cv2.IMREAD_UNCHANGED)[..., [2, 1, 0, 3]]
        hand_px = float(np.sqrt(np.prod(box[0, 2:] - box[0, :2])))
        wanted_px = self._settings.side_px * np.exp(rng.uniform(np.log(0.2), np.log(0.8)))
        center = (box[0, :2] + box[0, 2:]) / 2
        warp = random_warp(
            rng,
            picture.shape[1::-1],
            center,
            wanted_px / hand_px,
            self._settings.side_px,
            _SIMULATED_TURN_RAD,
        )
        boxes = self._clipped(transform_corners(warp, box_corners(box)))
        return picture, boxes, warp

    def _warped(self, image: UInt8, warp: Float64, border: int | None = None) -> UInt8:
        """Return the square to which the map transforms an image."""
        side = self._settings.side_px
        scale = np.sqrt(abs(np.linalg.det(warp[:, :2])))
        smooth = cv2.GaussianBlur(image, (0, 0), 0.35 / scale) if scale < 0.6 else image
        fill = _GRAY if border is None else (border,) * 4
        # OpenCV's origin is the centre of the first pixel.
        offset = warp[:, 2] + warp[:, :2] @ (0.5, 0.5) - 0.5
        square = cv2.warpAffine(
            smooth, np.column_stack([warp[:, :2], offset]), (side, side), borderValue=fill
        )
        return square.astype(np.uint8, copy=False)

    def _clipped(self, boxes: Float64) -> Float32:
        return clipped(boxes, self._settings.side_px, _SHOWN_MIN, _SMALLEST_PX)


def _blend(
    rng: np.random.Generator, image: UInt8, boxes: Float32, other: UInt8, other_boxes: Float32
) -> tuple[UInt8, Float32]:
    """Return a blend of two images (mixup; Zhang et al. 2019 for detectors)."""
    share = rng.uniform(0.5, 0.8)
    blend = cv2.addWeighted(image, share, other, 1.0 - share, 0.0).astype(np.uint8, copy=False)
    if 1.0 - share < _BLEND_MIN:
        other_boxes[:, 4] = 1.0
    return blend, np.concatenate([boxes, other_boxes])


def collate(samples: list[tuple[UInt8, Float32]]) -> tuple[Tensor, list[Tensor]]:
    """Return images (B, 3, side, side) uint8, channels last in memory, and their boxes."""
    images = torch.from_numpy(np.stack([image for image, _ in samples]))
    return images.permute(0, 3, 1, 2), [torch.from_numpy(boxes) for _, boxes in samples]

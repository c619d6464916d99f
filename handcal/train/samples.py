"""Training samples: crops of photographs, and simulated hands alone or pasted on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import torch
from cv2.typing import MatLike
from torch import Tensor
from torch.utils.data import Dataset

from handcal.core.types import Float32, Float64, UInt8
from handcal.io.files import read_json
from handcal.io.images import read_image
from handcal.lab.evaluate.annotations import Photo

# Side of a square with as many pixels as the detector's input.
_WHOLE_PX = 332.0
# Share of the crops around a hand that are centred on it. The others show any part of the
# photograph at the same scale: faces, arms and other objects.
_CENTERED = 0.72
_ZOOM_MAX = 4.0  # largest enlargement of a photograph
# Relative probability of photographs in which a hand fills 15 % or more.
_LARGE_WEIGHT = 2.0
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
    zoomed: float = 0.5
    """Share of crops scaled so that one hand fills 12–85 % of the side, like a wearer's; the others
    have about the scale of the detector's input."""
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
                _LARGE_WEIGHT if photo.relative_sizes.max(initial=0.0) >= 0.15 else 1.0
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
        scale = _WHOLE_PX / image_px * np.exp(rng.uniform(np.log(0.75), np.log(1.5)))
        center = rng.uniform(0.0, 1.0, 2) * (photo.width, photo.height)
        if len(photo.boxes):
            sizes = photo.relative_sizes
            hand = rng.choice(len(sizes), p=sizes / sizes.sum())
            if rng.random() < settings.zoomed:
                wanted_px = settings.side_px * np.exp(rng.uniform(np.log(0.12), np.log(0.85)))
                scale = min(wanted_px / (sizes[hand] * image_px), _ZOOM_MAX)
            if rng.random() < _CENTERED:
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


# Random views of an image, as a headset's camera might take them.
#
# Maps and boxes are in pixels from the image's upper left corner.


def transform_corners(warp: Float64, corners: Float64) -> Float64:
    """Return the upright boxes (M, 4) of corners (M, 4, 2) after an affine map (2, 3)."""
    moved = corners @ warp[:, :2].T + warp[:, 2]
    return np.concatenate([moved.min(1), moved.max(1)], axis=1)


def box_corners(boxes: Float64) -> Float64:
    """Return the corners (M, 4, 2) of upright boxes (M, 4)."""
    return boxes[:, [0, 1, 2, 1, 2, 3, 0, 3]].reshape(-1, 4, 2)


def random_warp(
    rng: np.random.Generator,
    size_px: tuple[int, int],
    center: Float64,
    scale: float,
    side_px: int,
    turn_rad: float,
) -> Float64:
    """Return a map (2, 3) of an image to a square of that side that shows `center`.

    It scales, rotates half the time, mirrors half the time, and stretches by up to 10 %; usually
    it is shifted so that little of the square is outside the image.

    Parameters
    ----------
    rng : numpy.random.Generator
    size_px : (int, int)
        Width and height of the image.
    center : (2,) float64
    scale : float
    side_px : int
    turn_rad : float
        Largest rotation.
    """
    angle = rng.uniform(-turn_rad, turn_rad) * (rng.random() < 0.5)
    stretch = np.exp(rng.uniform(-0.1, 0.1) / 2)
    mirror = rng.choice([-1.0, 1.0])
    cos, sin = np.cos(angle), np.sin(angle)
    linear = np.array([[cos, -sin], [sin, cos]]) @ np.diag([mirror * stretch, 1.0 / stretch])
    linear *= scale
    warp = np.column_stack([linear, side_px * rng.uniform(0.1, 0.9, 2) - linear @ center])
    if rng.random() < 0.9:
        whole = np.array([[0.0, 0.0, *size_px]])
        low, high = transform_corners(warp, box_corners(whole))[0].reshape(2, 2)
        slack = side_px - (high - low)  # negative where the image is larger than the square
        warp[:, 2] += low.clip(np.minimum(slack, 0.0), np.maximum(slack, 0.0)) - low
    return warp


def clipped(boxes: Float64, side_px: int, shown_min: float, smallest_px: float) -> Float32:
    """Return boxes clipped to the square, with 1 appended if too little is left to learn from.

    Parameters
    ----------
    boxes : (M, 4) float64
    side_px : int
    shown_min : float
        Least visible share of a hand.
    smallest_px : float
        Least square root of a hand's area.

    Returns
    -------
    (K, 5) float32
        Without boxes outside the view.
    """
    cut = boxes.clip(0.0, side_px)
    area, cut_area = (np.prod(b[:, 2:] - b[:, :2], axis=1) for b in (boxes, cut))
    unfit = (cut_area < shown_min * area) | (cut_area < smallest_px**2)
    seen = cut_area > 0.0
    boxes_left: Float32 = np.column_stack([cut, unfit])[seen].astype(np.float32)
    return boxes_left


def relight(rng: np.random.Generator, image: MatLike) -> MatLike:
    """Change hue, saturation, brightness and contrast, and the colour of the light."""
    if rng.random() < 0.5:
        hsv = cv2.cvtColor(image, cv2.COLOR_RGB2HSV_FULL)
        saturation = np.clip(np.arange(256) * rng.uniform(0.5, 1.5), 0, 255)
        hue = (np.arange(256) + rng.uniform(-12, 12)) % 256
        table = np.stack([hue, saturation, np.arange(256)], axis=1).astype(np.uint8)
        image = cv2.cvtColor(cv2.LUT(hsv, table[:, None]), cv2.COLOR_HSV2RGB_FULL)
    if rng.random() < 0.05:
        image = np.repeat(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)[..., None], 3, axis=2)
    if rng.random() < 0.7:
        strength = rng.choice([0.1, 0.3], p=[0.7, 0.3])
        gain = np.exp(rng.uniform(-0.5, 0.3)) * np.exp(rng.normal(0.0, strength / 2, 3))
        gamma = np.exp(rng.uniform(-0.4, 0.4))
        contrast = np.exp(rng.uniform(-0.4, 0.3))
        level = np.linspace(0.0, 1.0, 256)[:, None] ** gamma
        level = ((level - 0.5) * contrast + 0.5) * gain
        table = (255.0 * level).clip(0, 255).astype(np.uint8)
        image = cv2.LUT(image, table[:, None])
    return image


def blemish(rng: np.random.Generator, image: MatLike) -> MatLike:
    """Blur like a lens or a moving hand, and add sensor noise."""
    if rng.random() < 0.15:
        image = cv2.GaussianBlur(image, (0, 0), rng.uniform(0.4, 2.0))
    if rng.random() < 0.1:
        length = 2 * int(rng.integers(1, 5)) + 1  # odd, so that nothing is shifted
        line = np.zeros((length, length), np.float32)
        cv2.line(line, (0, length // 2), (length - 1, length // 2), 1.0)
        turn = cv2.getRotationMatrix2D((length / 2 - 0.5,) * 2, rng.uniform(0, 180), 1.0)
        kernel = cv2.warpAffine(line, turn, (length, length))
        image = cv2.filter2D(image, -1, kernel / kernel.sum())
    if rng.random() < 0.25:
        noise = rng.normal(0.0, rng.uniform(2.0, 14.0), image.shape)
        image = (image + noise).clip(0, 255).astype(np.uint8)
    return image

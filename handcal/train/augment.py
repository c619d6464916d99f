"""Random views of an image, as a headset's camera might take them.

Maps and boxes are in pixels from the image's upper left corner.
"""

from __future__ import annotations

import cv2
import numpy as np
from cv2.typing import MatLike

from handcal.core.types import Float32, Float64


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

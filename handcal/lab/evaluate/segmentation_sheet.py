"""Frames with their segmented hands and true masks as one picture."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from handcal.core.types import Bool, UInt8
from handcal.lab.evaluate.masked_frames import MaskedFrame
from handcal.lab.evaluate.segmentation import FrameFigures

_COLUMNS, _MOST_TILES = 4, 200
_TILE_PX = 320
_RIGHT, _WRONG, _MISSED = (60, 200, 60), (255, 60, 60), (60, 120, 255)


def tile(shot: MaskedFrame, mask: Bool | None, row: FrameFigures) -> UInt8:
    """Draw one frame: green where mask and truth agree, red beyond the truth, blue what is missed.

    Parameters
    ----------
    shot : MaskedFrame
    mask : (H, W) bool or None
        The segmented hand, if there is one.
    row : FrameFigures
        Its numbers, written above the picture.

    Returns
    -------
    (320, 320, 3) uint8
        RGB.
    """
    found = np.zeros_like(shot.is_hand) if mask is None else mask
    picture = _picture(shot)
    for part, color in (
        (found & shot.is_hand, _RIGHT),
        (found & ~shot.is_hand, _WRONG),
        (shot.is_hand & ~found, _MISSED),
    ):
        picture[part] = picture[part] // 2 + np.array(color, np.uint8) // 2
    height, width = picture.shape[:2]
    scale = _TILE_PX / max(width, height)
    size = max(1, round(scale * width)), max(1, round(scale * height))
    drawn = np.zeros((_TILE_PX, _TILE_PX, 3), np.uint8)
    drawn[_TILE_PX - size[1] :, : size[0]] = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    for number, line in enumerate((row.name, _numbers(row))):
        cv2.putText(
            drawn, line, (4, 14 + 16 * number), cv2.FONT_HERSHEY_SIMPLEX, 0.4, (255, 255, 255), 1
        )
    return drawn


def contact_sheet(tiles: Sequence[UInt8]) -> UInt8:
    """Arrange tiles in rows of four; at most 200 are shown."""
    shown = list(tiles[:_MOST_TILES])
    shown += [np.zeros((_TILE_PX, _TILE_PX, 3), np.uint8)] * (-len(shown) % _COLUMNS)
    rows = [np.hstack(shown[i : i + _COLUMNS]) for i in range(0, len(shown), _COLUMNS)]
    return np.vstack(rows)


def _picture(shot: MaskedFrame) -> UInt8:
    """Return the colour image, or the depth in grey: white at the camera, black from 1 m on."""
    frame = shot.frame
    if frame.color is not None:
        return frame.color.copy()
    near = np.where(frame.depth > 0, 1.0 - frame.depth * frame.depth_scale_m, 0.0)
    return np.repeat((255 * near.clip(0.0, 1.0)).astype(np.uint8)[..., None], 3, axis=2)


def _numbers(row: FrameFigures) -> str:
    if row.refused is not None:
        return row.refused
    texts = [f"IoU {row.iou:.2f}"]
    if row.kept is not None:
        texts.append(f"kept {100 * row.kept:.0f} %")
    if row.beyond_wrist_mm is not None:
        texts.append(f"wrist +{row.beyond_wrist_mm:.0f} mm".replace("+-", "-"))
    if row.area_change is not None:
        texts.append(f"area {100 * row.area_change:.1f} %")
    return ", ".join(texts)

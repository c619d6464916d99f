"""A segmented hand as pictures and as files for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from handcal.core.geometry import image_points
from handcal.core.types import Frame, HandCloud, UInt8
from handcal.io.files import make_folder, write_atomic, write_json, write_ply

_HAND_RGB = (0, 200, 80)
_CONTOUR_RGB = (0, 220, 255)
_CUT_RGB = (255, 40, 40)
_BOX_RGB = (255, 255, 255)


def write_segmentation(cloud: HandCloud, frame: Frame, folder: Path) -> None:
    """Write ``hand.ply``, ``contour.ply``, ``mask.png``, ``overlay.png`` and ``hand.json``.

    Clouds are in metres in the depth camera's frame, the hand in its own colours, the contour in
    blue and, along cut edges, in red. The mask is 255 on the hand. The JSON file gives ``box``
    (x0, y0, x1, y1; x1 and y1 exclusive), ``points``, ``contour_points`` and ``median_depth_m``.

    Parameters
    ----------
    cloud : HandCloud
    frame : Frame
        The frame that `cloud` was segmented in.
    folder : Path
        Created if missing.

    Raises
    ------
    FileError
        If a file cannot be written.
    """
    make_folder(folder)
    write_ply(folder / "hand.ply", cloud.points_m, cloud.colors)
    write_ply(folder / "contour.ply", cloud.contour_m, _contour_colors(cloud))
    _write_png(folder / "mask.png", cloud.mask)
    _write_png(folder / "overlay.png", draw_overlay(cloud, frame)[..., ::-1])
    write_json(
        folder / "hand.json",
        {
            "box": list(cloud.box_px),
            "points": len(cloud.points_m),
            "contour_points": len(cloud.contour_m),
            "median_depth_m": cloud.median_depth_m,
        },
    )


def draw_overlay(cloud: HandCloud, frame: Frame) -> UInt8:
    """Draw box, mask and contour over the depth camera's image.

    Returns
    -------
    (H, W, 3) uint8
        RGB, of the depth image's size.
    """
    picture = _picture(frame)
    on_hand = cloud.mask > 0
    picture[on_hand] = picture[on_hand] // 2 + np.array(_HAND_RGB, np.uint8) // 2
    columns, rows = np.rint(image_points(cloud.contour_m, frame.depth_intrinsics)).astype(int).T
    picture[rows, columns] = _contour_colors(cloud)
    x0, y0, x1, y1 = cloud.box_px
    cv2.rectangle(picture, (x0, y0), (x1 - 1, y1 - 1), _BOX_RGB)
    return picture


def _picture(frame: Frame) -> UInt8:
    """Return the colour image if the depth is aligned to it, else the depth in grey."""
    is_aligned = frame.color_intrinsics == frame.depth_intrinsics and np.array_equal(
        frame.T_C_D, np.eye(4)
    )
    if frame.color is not None and is_aligned:
        return frame.color.copy()
    near = 1.0 - frame.depth * frame.depth_scale_m  # white at the camera, black from 1 m on
    grey = np.where(frame.depth > 0, 255.0 * np.clip(near, 0.0, 1.0), 0.0).astype(np.uint8)
    return np.repeat(grey[..., None], 3, axis=2)


def _contour_colors(cloud: HandCloud) -> UInt8:
    colors = np.array([_CONTOUR_RGB, _CUT_RGB], np.uint8)
    return np.take(colors, cloud.contour_is_cut.astype(int), axis=0)


def _write_png(path: Path, image: NDArray[Any]) -> None:
    _, data = cv2.imencode(".png", image)
    write_atomic(path, data.tobytes())

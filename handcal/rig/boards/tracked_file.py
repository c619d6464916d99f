"""Tracked poses of a board, one for each image that the viewpoint camera took of it, as JSON.

``{"handcal_tracked": 1, "T_H_B": {"image.png": [[…], […], […], […]], …}}``: from the board to the
headset rig, in metres, at the moment of the image.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from handcal.core.errors import FileError
from handcal.core.geometry import is_rigid
from handcal.core.types import Float64
from handcal.io.files import read_json, write_json
from handcal.rig.boards.views import MAX_VIEWS

TRACKED_VERSION = 1
_REACH_M = 10.0
_ADVICE = "choose the file of tracked poses of the board"


def read_tracked(path: Path) -> dict[str, Float64]:
    """Read ``T_H_B`` (4, 4) by the image's name.

    Raises
    ------
    FileError
        If the file cannot be read, is not of this format, or a pose is not rigid.
    """
    try:
        values = read_json(path)
    except FileError as error:
        raise FileError(f"{error}", f"{_ADVICE}") from error
    if values.get("handcal_tracked") != TRACKED_VERSION:
        raise FileError(
            f"{path} holds no tracked poses that are known: handcal_tracked must be "
            f"{TRACKED_VERSION}",
            f"{_ADVICE}",
        )
    poses = values.get("T_H_B")
    if not isinstance(poses, dict) or not 0 < len(poses) <= MAX_VIEWS:
        raise FileError(f"{path}: T_H_B must hold 1 to {MAX_VIEWS} poses by image name")
    return {name: _pose(path, name, rows) for name, rows in poses.items()}


def write_tracked(path: Path, poses: Mapping[str, Float64]) -> None:
    """Write ``T_H_B`` by the image's name."""
    listed = {name: T_H_B.tolist() for name, T_H_B in poses.items()}
    write_json(path, {"handcal_tracked": TRACKED_VERSION, "T_H_B": listed})


def _pose(path: Path, name: str, rows: object) -> Float64:
    try:
        T = np.asarray(rows, dtype=np.float64)
    except (TypeError, ValueError):
        T = np.empty(0)
    if T.shape != (4, 4) or not is_rigid(T, _REACH_M):
        raise FileError(
            f"{path}: T_H_B of {name} must be a rigid 4×4 transform within {_REACH_M:g} m"
        )
    return T

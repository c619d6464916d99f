from pathlib import Path

import cv2
import numpy as np

from handcal.core.geometry import invert
from handcal.core.types import EYES, Float64, Intrinsics
from handcal.io.images import read_image
from handcal.rig.boards.finder import find_board
from handcal.rig.boards.tracked_file import read_tracked
from handcal.rig.example import example_rig
from handcal.rig.lens.viewpoint import board_pose
from handcal.sim.photographs import (
    BOARD,
    DEPTH_CAMERA,
    HEADSET_CAMERA,
    VIEWPOINT_CAMERA,
    write_photographs,
)


def seen_pose(path: Path, camera: Intrinsics) -> Float64:
    return board_pose(find_board(read_image(path, cv2.IMREAD_GRAYSCALE), BOARD), camera)


def test_what_is_seen_agrees_with_the_rig(tmp_path: Path) -> None:
    rig = example_rig()
    write_photographs(tmp_path, rig, 1, np.random.default_rng(3))
    T_D_B = seen_pose(tmp_path / "depth" / "depth-001.png", DEPTH_CAMERA)
    T_H_B = seen_pose(tmp_path / "headset" / "headset-001.png", HEADSET_CAMERA)
    np.testing.assert_allclose(T_H_B @ invert(T_D_B), rig.T_H_D, atol=0.01)
    assert len(list((tmp_path / "viewpoint").iterdir())) == 1
    for eye in EYES:
        tracked = read_tracked(tmp_path / f"tracked-{eye}.json")
        folder = tmp_path / f"board-{eye}"
        places = [
            T @ invert(seen_pose(folder / name, VIEWPOINT_CAMERA)) for name, T in tracked.items()
        ]
        assert len(places) == 8
        np.testing.assert_allclose(places, [places[0]] * 4, atol=0.01)
        assert len(list((tmp_path / f"grid-{eye}").iterdir())) == 2

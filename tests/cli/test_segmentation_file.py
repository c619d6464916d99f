"""Files of a segmented hand."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from handcal.cli.recordings import draw_overlay, write_segmentation
from handcal.core.errors import FileError
from handcal.core.geometry import rigid
from handcal.core.types import Frame, HandCloud, Intrinsics

CAMERA = Intrinsics(40, 30, 50.0, 50.0, 20.0, 15.0)


def make_frame(T_C_D: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> Frame:
    depth = np.full((30, 40), 500, np.uint16)
    color = np.full((30, 40, 3), (100, 0, 0), np.uint8)
    return Frame(0, 0, 0, depth, 0.001, CAMERA, color, CAMERA, T_C_D)


@pytest.fixture
def cloud() -> HandCloud:
    mask = np.zeros((30, 40), np.uint8)
    mask[10:20, 12:24] = 255
    corners = np.array([[12, 10], [23, 10], [23, 19], [12, 19]])
    contour_m = np.column_stack([(corners - (20.0, 15.0)) / 50.0 * 0.5, np.full(4, 0.5)])
    return HandCloud(
        t_camera_ns=0,
        t_host_ns=0,
        points_m=np.array([[0.1, 0.2, 0.5], [0.0, 0.0, 0.25]], np.float32),
        is_cut=np.array([False, True]),
        colors=np.array([[1, 2, 3], [4, 5, 6]], np.uint8),
        contour_m=contour_m.astype(np.float32),
        contour_is_cut=np.array([False, False, True, True]),
        mask=mask,
        box_px=(12, 10, 24, 20),
        median_depth_m=0.375,
    )


def test_files_hold_the_hand(cloud: HandCloud, tmp_path: Path) -> None:
    folder = tmp_path / "new" / "out"
    write_segmentation(cloud, make_frame(np.eye(4)), folder)
    assert {file.name for file in folder.iterdir()} == {
        "hand.ply",
        "contour.ply",
        "mask.png",
        "overlay.png",
        "hand.json",
    }
    assert json.loads((folder / "hand.json").read_text()) == {
        "box": [12, 10, 24, 20],
        "points": 2,
        "contour_points": 4,
        "median_depth_m": 0.375,
    }
    mask = cv2.imread(str(folder / "mask.png"), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(mask, cloud.mask)
    header, _, body = (folder / "hand.ply").read_bytes().partition(b"end_header\n")
    assert b"element vertex 2" in header
    np.testing.assert_array_equal(np.frombuffer(body[:12], "<f4"), cloud.points_m[0])
    assert body[12:15] == bytes([1, 2, 3])
    overlay = cv2.imread(str(folder / "overlay.png"), cv2.IMREAD_COLOR_RGB)
    np.testing.assert_array_equal(overlay, draw_overlay(cloud, make_frame(np.eye(4))))


def test_overlay_tints_the_hand_and_tells_cut_from_silhouette(cloud: HandCloud) -> None:
    picture = draw_overlay(cloud, make_frame(np.eye(4)))
    np.testing.assert_array_equal(picture[0, 0], (100, 0, 0))
    assert picture[15, 15, 1] > 50
    bare = replace(cloud, box_px=(0, 0, 40, 30))
    picture = draw_overlay(bare, make_frame(np.eye(4)))
    assert picture[10, 12, 2] > picture[10, 12, 0]
    assert picture[19, 12, 0] > picture[19, 12, 2]


def test_unaligned_color_is_not_drawn_under_the_depth_mask(cloud: HandCloud) -> None:
    picture = draw_overlay(cloud, make_frame(rigid(translation_m=[0.02, 0.0, 0.0])))
    np.testing.assert_array_equal(picture[0, 0], (127, 127, 127))


def test_folder_that_cannot_be_made_is_an_error(cloud: HandCloud, tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("")
    with pytest.raises(FileError):
        write_segmentation(cloud, make_frame(np.eye(4)), blocked / "out")

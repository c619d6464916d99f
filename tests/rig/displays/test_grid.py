from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from handcal.core.display import eye_projection
from handcal.core.errors import FileError
from handcal.core.geometry import camera_matrix, rigid
from handcal.core.types import UInt8
from handcal.io.images import write_png
from handcal.rig.boards.board import BoardError
from handcal.rig.displays.grid import (
    Grid,
    decode_gray_code,
    draw_grid,
    find_grid,
    flatness_arcmin,
    gray_patterns,
    read_gray_code,
)
from handcal.rig.displays.homography import fit_homography
from handcal.rig.example import example_rig
from handcal.sim.boards import PictureSettings
from handcal.sim.photographs import VIEWPOINT_CAMERA
from handcal.sim.viewpoint import photograph_display

GRID = Grid(660, 370, square_px=50)


def test_corners_are_found_where_they_are_drawn() -> None:
    view = find_grid(draw_grid(GRID), GRID)
    columns, rows = GRID.squares
    assert (columns, rows) == (13, 7)
    assert len(view.pixels) == (columns - 1) * (rows - 1)
    np.testing.assert_allclose(view.display_px, view.pixels, atol=0.02)
    # The grid's first inner corner lies between pixels, one square from the grid's edge.
    np.testing.assert_allclose(view.display_px[0], [5 + 50 - 0.5, 10 + 50 - 0.5])


def test_a_part_of_the_grid_tells_where_it_belongs() -> None:
    image = draw_grid(GRID)
    view = find_grid(np.ascontiguousarray(image[100:, 300:]), GRID)
    shift_px = view.display_px - view.pixels
    np.testing.assert_allclose(shift_px, np.tile([300.0, 100.0], (len(shift_px), 1)), atol=0.3)


def test_a_dark_display_is_refused() -> None:
    with pytest.raises(BoardError):
        find_grid(np.zeros((360, 640), np.uint8), GRID)


@pytest.mark.parametrize(
    ("size", "square_px", "problem"),
    [
        ((640, 360), 130, "no room for 3 squares"),
        ((640, 360), 19, "20 to 2000 pixels"),
        ((10**6, 360), 80, "at most 16384"),
    ],
)
def test_an_impossible_grid_is_refused(size: tuple[int, int], square_px: int, problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        Grid(*size, square_px)


DISPLAY = example_rig().eyes["left"]
SIZE = DISPLAY.width_px, DISPLAY.height_px
T_E_C = rigid([0.02, -0.03, 0.02], [0.001, 0.0, 0.002])


@lru_cache(maxsize=1)
def photographs() -> dict[str, UInt8]:
    rng = np.random.default_rng(1)
    return {
        name: photograph_display(
            pattern,
            DISPLAY,
            T_E_C[:3, :3],
            VIEWPOINT_CAMERA,
            rng,
            shift_m=T_E_C[:3, 3],
            settings=PictureSettings(samples=1),
        )
        for name, pattern in gray_patterns(*SIZE)
    }


def test_the_camera_finds_the_displays_pixels() -> None:
    seen = decode_gray_code(photographs(), *SIZE)
    assert len(seen.pixels) > 60
    found = fit_homography({"code": seen}, VIEWPOINT_CAMERA, *SIZE)
    true = eye_projection(DISPLAY, T_E_C[:3, 3])[:, :3] @ T_E_C[:3, :3]
    H = camera_matrix(VIEWPOINT_CAMERA) @ np.linalg.inv(true)
    corners = np.array([[0, 0, 1], [SIZE[0] - 1, 0, 1], [0, SIZE[1] - 1, 1], [*SIZE, 1]]).T
    seen_px, true_px = ((G @ corners)[:2] / (G @ corners)[2] for G in (found.H_C_S, H))
    assert np.abs(seen_px - true_px).max() < 0.2
    assert found.rms_px < 0.15


def test_a_flat_display_is_flat_and_a_bent_one_is_not() -> None:
    seen = decode_gray_code(photographs(), *SIZE)
    flat, bent = flatness_arcmin(seen, VIEWPOINT_CAMERA, *SIZE)
    assert flat < 1.0
    assert bent < 1.0
    x, y = (seen.display_px / SIZE - 0.5).T
    curved = seen.pixels + np.column_stack([40.0 * x * y, 60.0 * x**2])
    object.__setattr__(seen, "pixels", curved)
    flat, bent = flatness_arcmin(seen, VIEWPOINT_CAMERA, *SIZE)
    assert flat > 5.0
    assert bent < 1.0


def test_what_is_missing_or_unusable_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"32 of 32 images are missing, such as white\.png"):
        read_gray_code(tmp_path, *SIZE)
    dark = {name: np.zeros((90, 160), np.uint8) for name in photographs()}
    with pytest.raises(BoardError, match="0 parts of the display are seen"):
        decode_gray_code(dark, *SIZE)
    with pytest.raises(BoardError, match="different sizes"):
        decode_gray_code({**photographs(), "black": np.zeros((90, 160), np.uint8)}, *SIZE)
    for name, image in photographs().items():
        write_png(tmp_path / f"{name}.png", image)
    assert len(read_gray_code(tmp_path, *SIZE).pixels) > 60

import time
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from handcal.core.display import eye_projection
from handcal.core.errors import CancelledError, FileError
from handcal.core.geometry import image_points, invert, rigid, transform
from handcal.core.progress import Progress
from handcal.core.types import Float64, Intrinsics
from handcal.io.files import make_folder
from handcal.io.images import write_png
from handcal.lab.evaluate.cube_test import CubeMisalignment, cube_row, display_warp, judge_captures
from handcal.rig.cube import Cube, find_cube, marker_corners_m
from handcal.rig.displays.grid import Grid, draw_grid
from handcal.rig.displays.homography import RotationWarp
from handcal.rig.example import example_rig
from handcal.sim.boards import PictureSettings
from handcal.sim.cube import CubePainter
from handcal.sim.viewpoint import VIEWPOINT_CAMERA, photograph_display

CUBE = Cube()
CAMERA = Intrinsics(640, 360, 900.0, 898.5, 322.0, 177.5, (-0.08, 0.05, 0.0004, -0.0003, 0.0))
PICTURES = PictureSettings(samples=2)
GRID = Grid(1268, 720)
T_E_T = rigid([0.0, 0.0, 0.1], [0.01, -0.005, 0.45]) @ rigid([0.5, 0, 0]) @ rigid([0, 0.7, 0])
ASIDE_M = 0.002
MOVED = rigid(translation_m=[ASIDE_M, 0.0, 0.0]) @ T_E_T


@lru_cache(maxsize=1)
def painter() -> CubePainter:
    return CubePainter(CUBE, CAMERA, PICTURES)


def write_cube_seen(path: Path, T_C_T: Float64) -> None:
    make_folder(path.parent)
    write_png(path, painter().paint(T_C_T, np.random.default_rng(1)))


def test_what_cannot_be_used_is_named_and_the_rest_judged(tmp_path: Path) -> None:
    write_cube_seen(tmp_path / "a" / "1" / "real.png", T_E_T)
    write_cube_seen(tmp_path / "a" / "1" / "virtual-after.png", T_E_T)
    write_cube_seen(tmp_path / "a" / "1" / "virtual-before.png", MOVED)
    dark, small = np.zeros((360, 640), np.uint8), np.zeros((90, 160), np.uint8)
    write_png(tmp_path / "a" / "1" / "virtual-dark.png", dark)
    write_cube_seen(tmp_path / "a" / "2" / "virtual.png", T_E_T)
    write_cube_seen(tmp_path / "a" / "3" / "real.png", T_E_T)
    make_folder(tmp_path / "a" / "4")
    write_png(tmp_path / "a" / "4" / "real.png", small)
    write_png(tmp_path / "a" / "4" / "virtual.png", small)
    make_folder(tmp_path / "b" / "1")
    write_png(tmp_path / "b" / "1" / "real.png", dark)
    write_png(tmp_path / "b" / "1" / "virtual.png", dark)
    write_png(tmp_path / "b" / "grid.png", dark)
    test = judge_captures(tmp_path, CUBE, CAMERA, GRID)
    assert [(row["position"], row["pose"], row["drawn"]) for row in test.rows] == [
        ("a", "1", "after"),
        ("a", "1", "before"),
    ]
    after, before = test.rows
    assert after["err_t_xy_mm"] == pytest.approx(0.0, abs=0.01)
    assert before["err_t_x_mm"] == pytest.approx(1e3 * ASIDE_M, abs=0.1)
    assert before["err_t_y_mm"] == pytest.approx(0.0, abs=0.1)
    assert {name: why.split(":")[0] for name, why in test.left_out.items()} == {
        "a/2": "there is no real.png",
        "a/3": "there is no virtual.png",
        "a/1/virtual-dark.png": "the image is too dark",
        "a/4/real.png": "the frame is 160×90, the camera 640×360",
        "b/grid": "the image is too dark",
    }


def test_errors_are_along_the_axes_of_a_display_that_was_captured(tmp_path: Path) -> None:
    """A camera rolled against the display sees a shift to the right partly upwards."""
    T_E_C = rigid([0.0, 0.0, 0.4])
    display = example_rig().eyes["left"]
    for position in ("with", "without"):
        for name, pose in (("real", T_E_T), ("virtual", MOVED)):
            write_cube_seen(tmp_path / position / "1" / f"{name}.png", invert(T_E_C) @ pose)
    seen = photograph_display(
        draw_grid(GRID), display, T_E_C[:3, :3], CAMERA, np.random.default_rng(1), settings=PICTURES
    )
    write_png(tmp_path / "with" / "grid.png", seen)
    test = judge_captures(tmp_path, CUBE, CAMERA, GRID)
    offsets_mm = {
        row["position"]: (row["err_t_x_mm"], row["err_t_y_mm"], row["err_t_xy_mm"])
        for row in test.rows
    }
    assert not test.left_out
    assert offsets_mm["with"] == pytest.approx((2.0, 0.0, 2.0), abs=0.1)
    rolled = (2.0 * np.cos(0.4), 2.0 * np.sin(0.4), 2.0)
    assert offsets_mm["without"] == pytest.approx(rolled, abs=0.1)


def test_a_row_holds_magnitudes() -> None:
    found = CubeMisalignment(
        faces=2,
        depth_m=0.5,
        offset_m=np.array([[0.003, -0.004], [-0.003, 0.004]]),
        offset_rad=np.radians(np.array([[0.1, -0.0], [-0.1, 0.0]])),
        along_m=-0.002,
        rotation_rad=np.radians([-0.3, 0.0, 0.4]),
    )
    row = cube_row(found)
    assert row["faces"] == 2
    assert row["err_t_xy_mm"] == pytest.approx(5.0)
    assert (row["err_t_x_mm"], row["err_t_y_mm"]) == pytest.approx((3.0, 4.0))
    assert row["err_t_z_mm"] == pytest.approx(2.0)
    assert row["err_t_xy_arcmin"] == row["err_t_x_arcmin"] == pytest.approx(6.0)
    assert (row["err_R_x_deg"], row["err_R_z_deg"]) == pytest.approx((0.3, 0.4))
    assert row["err_R_deg"] == pytest.approx(0.5)


@pytest.mark.parametrize(
    "make", [lambda path: None, lambda path: (path / "a" / "1").mkdir(parents=True)]
)
def test_a_folder_without_captures_is_refused(
    tmp_path: Path, make: Callable[[Path], object]
) -> None:
    make(tmp_path)
    with pytest.raises(FileError, match="POSITION/POSE/real"):
        judge_captures(tmp_path, CUBE, CAMERA, GRID)


def test_it_can_be_given_up(tmp_path: Path) -> None:
    write_cube_seen(tmp_path / "a" / "1" / "real.png", T_E_T)
    write_cube_seen(tmp_path / "a" / "1" / "virtual.png", T_E_T)

    def give_up(what: str, share: float) -> None:
        assert (what, share) == ("Looking at a/1", 0.0)
        raise CancelledError("enough")

    with pytest.raises(CancelledError):
        judge_captures(tmp_path, CUBE, CAMERA, GRID, Progress(give_up))


@lru_cache(maxsize=1)
def turned_view() -> tuple[RotationWarp, Float64]:
    """Return the warp by a rendered image of the grid, and the true rotation R_S_C."""
    display = example_rig().eyes["left"]
    T_E_C = rigid([0.03, -0.02, 0.05], [0.002, -0.001, 0.001])
    rng = np.random.default_rng(3)
    with TemporaryDirectory() as folder:
        seen = photograph_display(
            draw_grid(GRID), display, T_E_C[:3, :3], CAMERA, rng, shift_m=T_E_C[:3, 3]
        )
        write_png(Path(folder, "grid.png"), seen)
        warp = display_warp(Path(folder), CAMERA, GRID)
    assert warp is not None
    # Steps of one pixel across and down on the display, as an eye at the camera's place sees it.
    steps = np.linalg.inv(eye_projection(display, T_E_C[:3, 3])[:, :3])
    x, y = (steps[:, axis] / np.linalg.norm(steps[:, axis]) for axis in range(2))
    away = np.cross(x, y)
    u, _, vt = np.linalg.svd(np.column_stack([x, y, away / np.linalg.norm(away)]))
    R_E_S = u @ vt
    return warp, R_E_S.T @ T_E_C[:3, :3]


def test_the_live_view_is_within_a_pixel_of_the_rendered_truth() -> None:
    warp, R_S_C = turned_view()
    seen = painter().paint(T_E_T, np.random.default_rng(4))
    found = find_cube(warp.warp(seen), CUBE)
    corners_m = transform(rigid(R_S_C) @ T_E_T, marker_corners_m(CUBE, found))
    true_px = image_points(corners_m, replace(CAMERA, distortion=()))
    off_px = np.linalg.norm(np.concatenate([*found.values()]) - true_px, axis=1)
    assert len(off_px) == 12
    assert off_px.max() < 1.0


def test_a_live_view_of_25_frames_a_second_leaves_most_of_a_processor() -> None:
    """40 ms of processor time a frame are there; the warp takes 5 on a slow one."""
    warp = RotationWarp(VIEWPOINT_CAMERA, rigid([0.03, -0.02, 0.05])[:3, :3])
    frame = np.zeros((720, 1280, 3), np.uint8)
    warp.warp(frame)
    begin_s = time.process_time()
    for _ in range(10):
        warp.warp(frame)
    assert (time.process_time() - begin_s) / 10 < 0.04


def test_without_the_grid_there_is_no_turned_view(tmp_path: Path) -> None:
    assert display_warp(tmp_path / "none", CAMERA, GRID) is None

"""The cube test: misalignment of known cubes, captures, and the report."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handcal.core.display import eye_projection
from handcal.core.errors import FileError
from handcal.core.geometry import image_points, invert, project, rigid, transform
from handcal.core.types import Float64, Intrinsics
from handcal.io.files import make_folder
from handcal.io.images import write_png
from handcal.lab.evaluate.cube_test import (
    CubeMisalignment,
    CubeRow,
    CubeTest,
    compare_cubes,
    cube_report,
    cube_row,
    cube_summary,
    display_warp,
    judge_captures,
)
from handcal.report.document import Table
from handcal.report.figures import draw_figure
from handcal.rig.cube.cube import Cube, CubeError, find_cube, marker_corners_m
from handcal.rig.displays.grid import Grid, draw_grid
from handcal.rig.displays.warp import RotationWarp
from handcal.rig.example import example_rig
from handcal.sim.boards import PictureSettings
from handcal.sim.cube import CubePainter
from handcal.sim.viewpoint import photograph_display

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


STRAIGHT_CAMERA = Intrinsics(1280, 720, 1800.0, 1797.0, 644.0, 355.0)
DISPLAY = example_rig().eyes["left"]
FACES = [0, 1, 4]
TURNED = rigid([0.5, 0, 0]) @ rigid([0, 0.7, 0])
POSE = rigid(translation_m=[0.01, -0.005, 0.5]) @ TURNED


def by_marker(pixels: Float64) -> dict[int, Float64]:
    return dict(zip(FACES, pixels.reshape(-1, 4, 2), strict=True))


def seen(pose: Float64) -> dict[int, Float64]:
    return by_marker(image_points(transform(pose, marker_corners_m(CUBE, FACES)), STRAIGHT_CAMERA))


def drawn_and_seen(
    pose: Float64, shift_m: list[float], true_shift_m: list[float]
) -> CubeMisalignment:
    """Compare a cube seen by an eye at one φ with the same drawn with another, without images."""
    points_m = transform(pose, marker_corners_m(CUBE, FACES))
    drawn_px = project(eye_projection(DISPLAY, shift_m), points_m)
    # From the eye's rays through these pixels of the display to the camera in its place.
    homogeneous = np.column_stack([drawn_px, np.ones(len(drawn_px))])
    rays = np.linalg.solve(eye_projection(DISPLAY, true_shift_m)[:, :3], homogeneous.T).T
    real = by_marker(image_points(points_m - true_shift_m, STRAIGHT_CAMERA))
    return compare_cubes(
        real, by_marker(image_points(rays, STRAIGHT_CAMERA)), CUBE, STRAIGHT_CAMERA
    )


@settings(deadline=None, max_examples=20)
@given(st.tuples(*[st.floats(-0.005, 0.005)] * 2))
def test_a_shift_across_the_line_of_sight_is_that_of_every_corner(aside: tuple[float, ...]) -> None:
    found = compare_cubes(
        seen(POSE), seen(rigid(translation_m=[*aside, 0.0]) @ POSE), CUBE, STRAIGHT_CAMERA
    )
    np.testing.assert_allclose(found.offset_m, np.tile(aside, (12, 1)), atol=1e-7)
    assert found.along_m == pytest.approx(0.0, abs=1e-6)
    np.testing.assert_allclose(found.rotation_rad, 0.0, atol=1e-5)


@settings(deadline=None, max_examples=20)
@given(st.tuples(*[st.floats(-0.05, 0.05)] * 3), st.floats(-0.01, 0.01))
def test_a_turn_and_a_shift_along_are_told(turn: tuple[float, ...], along_m: float) -> None:
    moved = POSE.copy()
    moved[:3, :3] = rigid(turn)[:3, :3] @ POSE[:3, :3]
    moved[2, 3] += along_m
    found = compare_cubes(seen(POSE), seen(moved), CUBE, STRAIGHT_CAMERA)
    np.testing.assert_allclose(found.rotation_rad, turn, atol=1e-6)
    assert found.along_m == pytest.approx(along_m, abs=1e-6)


def test_an_eye_aside_misses_by_what_similar_triangles_say() -> None:
    """Drawn on S at distance z_S, a point at z misses by δ (1 - z / z_S) where the eye is off δ."""
    delta_m = np.array([0.004, -0.003])
    found = drawn_and_seen(POSE, [0.0, 0.0, 0.0], [*delta_m, 0.0])
    depths_m = transform(POSE, marker_corners_m(CUBE, FACES))[:, 2:]
    expected_m = delta_m * (1.0 - depths_m / DISPLAY.z_C0_S_m)
    np.testing.assert_allclose(found.offset_m, expected_m, atol=2e-5)
    # 3 mm of 4 at half a metre: about 20 arcminutes.
    assert found.offset_m[:, 0].mean() == pytest.approx(0.003, abs=0.0001)
    expected_rad = expected_m / depths_m
    np.testing.assert_allclose(found.offset_rad, expected_rad, atol=np.radians(0.5 / 60))


def test_an_eye_nearer_sees_the_cube_farther() -> None:
    found = drawn_and_seen(POSE, [0.0, 0.0, 0.0], [0.0, 0.0, 0.005])
    # z is taken from the size: it grows by δ / z - δ / z_S too little.
    expected_m = 0.005 * (1.0 - 0.5 / DISPLAY.z_C0_S_m)
    assert found.along_m == pytest.approx(expected_m, rel=0.05)


def test_two_faces_must_be_seen_in_both() -> None:
    real, virtual = seen(POSE), seen(POSE)
    del real[0], virtual[1]
    with pytest.raises(CubeError, match="share 1 faces"):
        compare_cubes(real, virtual, CUBE, STRAIGHT_CAMERA)


def row(position: str, drawn: str, error_mm: float) -> CubeRow:
    return {"position": position, "pose": "1", "drawn": drawn, "faces": 3, "err_t_x_mm": error_mm}


def test_poses_at_one_position_are_not_independent() -> None:
    few = [row("a", "x", 1.0), row("b", "x", 3.0)]
    many = few + 9 * [row("a", "x", 1.0), row("b", "x", 3.0)]
    intervals = [cube_summary(rows)["x"]["err_t_x_mm"].interval for rows in (few, many)]
    assert intervals[0] == intervals[1]


def made_up() -> CubeTest:
    rng = np.random.default_rng(1)
    rows = []
    for position in ("centre", "up"):
        for pose in ("1", "2"):
            for drawn, size in (("offline", 3e-3), ("solved", 5e-4)):
                offset_m = rng.normal(0.0, size, (8, 2))
                found = CubeMisalignment(
                    2, 0.5, offset_m, offset_m / 0.5, rng.normal(0.0, size), rng.normal(0, 0.01, 3)
                )
                whose = {"position": position, "pose": pose, "drawn": drawn}
                rows.append({**whose, **cube_row(found)})
    return CubeTest(rows, {"up/3": "there is no real.png"})


def test_the_report_holds_what_the_summary_says() -> None:
    test = made_up()
    summary = cube_summary(test.rows)
    report = cube_report(test, summary, Cube(), CAMERA)
    tables = [
        item for section in report.sections for item in section.items if isinstance(item, Table)
    ]
    errors = {table.caption: {row[0]: row[1] for row in table.rows} for table in tables}
    z = summary["solved"]["err_t_z_mm"].spread
    shown = f"{z.mean:.2f}\u00a0±\u00a0{z.sd:.2f}"
    assert errors["solved, 4 pairs of captures"]["err_t z, mm"] == shown
    assert f"solved {summary['solved']['err_t_xy_arcmin'].spread.mean:.2f}" in report.lead
    published = next(table for table in tables if table.columns[0].title == "study")
    assert published.rows[1][3] == shown
    assert published.rows[2][:2] == ("Hu et al. 2021", "0.85 ± 0.52")
    assert ("up/3", "there is no real.png") in [
        tuple(row) for table in tables for row in table.rows
    ]
    assert all(figure.rows == test.rows for figure in report.figures)
    assert [draw_figure(figure).svg[:5] for figure in report.figures] == 2 * [b"<?xml"]

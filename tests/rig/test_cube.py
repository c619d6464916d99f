import shutil
import subprocess
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handcal.core.errors import FileError
from handcal.core.geometry import image_points, rigid, transform
from handcal.core.types import Float64, Intrinsics, UInt8
from handcal.io.files import write_json
from handcal.io.images import read_image
from handcal.rig.cube import (
    Cube,
    CubeError,
    CubeFilter,
    cube_corners_m,
    cube_pose,
    face_pose,
    facing_corners_m,
    find_cube,
    marker_corners_m,
    net_rectangles_m,
    read_cube,
    write_cube,
    write_cube_pdf,
)
from handcal.sim.boards import PictureSettings
from handcal.sim.cube import CubePainter

CUBE = Cube()
CAMERA = Intrinsics(640, 360, 900.0, 898.5, 322.0, 177.5, (-0.08, 0.05, 0.0004, -0.0003, 0.0))
# Front, right and top show.
POSE = rigid([0.0, 0.0, 0.1], [0.01, -0.005, 0.45]) @ rigid([0.5, 0, 0]) @ rigid([0, 0.7, 0])


def paint(pose: Float64 = POSE, cube: Cube = CUBE) -> UInt8:
    painter = CubePainter(cube, CAMERA, PictureSettings(samples=2))
    return painter.paint(pose, np.random.default_rng(1))


def seen(pose: Float64, cube: Cube, markers: list[int]) -> dict[int, Float64]:
    pixels = image_points(transform(pose, marker_corners_m(cube, markers)), CAMERA)
    return dict(zip(markers, pixels.reshape(-1, 4, 2), strict=True))


@pytest.mark.parametrize("marker", CUBE.ids)
def test_a_face_looks_out_of_the_cube_and_is_not_mirrored(marker: int) -> None:
    T = face_pose(CUBE, marker)
    assert np.linalg.det(T[:3, :3]) == pytest.approx(1.0)
    np.testing.assert_allclose(T[:3, 3], -0.03 * T[:3, 2])


def test_corners_are_found_to_a_fraction_of_a_pixel() -> None:
    found = find_cube(paint(), CUBE)
    assert list(found) == [0, 1, 4]
    expected = seen(POSE, CUBE, list(found))
    off_px = np.concatenate([found[marker] - expected[marker] for marker in found])
    assert np.sqrt((off_px**2).sum(axis=1).mean()) < 0.15
    np.testing.assert_allclose(cube_pose(found, CUBE, CAMERA), POSE, atol=0.002)


@settings(deadline=None, max_examples=30)
@given(
    st.tuples(*[st.floats(-3.0, 3.0)] * 3),
    st.sampled_from([(0, 1), (1, 2), (0, 4), (3, 5), (0, 1, 5)]),
)
def test_a_pose_is_found_from_exact_corners(turn: tuple[float, ...], markers: tuple[int]) -> None:
    pose = rigid(turn, [0.02, 0.01, 0.5])
    found = cube_pose(seen(pose, CUBE, list(markers)), CUBE, CAMERA)
    np.testing.assert_allclose(found, pose, atol=1e-5)


def test_another_object_than_the_cube_is_reported() -> None:
    with pytest.raises(CubeError, match="too dark"):
        find_cube(np.zeros((360, 640), np.uint8), CUBE)
    with pytest.raises(CubeError, match="which is not on this cube: show"):
        find_cube(paint(), Cube(ids=(10, 11, 12, 13, 14, 15)))
    straight_on = rigid(translation_m=[0.0, 0.0, 0.45])
    with pytest.raises(CubeError, match=r"only one face \(marker 0\)"):
        find_cube(paint(straight_on), CUBE)
    striped = np.tile(np.repeat(np.array([30, 220], np.uint8), 32), (360, 10))
    with pytest.raises(CubeError, match="no marker of the cube"):
        find_cube(striped, CUBE)


def test_two_cubes_in_an_image_are_refused() -> None:
    image = paint()
    half = cv2.resize(image, (320, 180), interpolation=cv2.INTER_AREA)
    with pytest.raises(CubeError, match="seen twice"):
        find_cube(np.hstack([image, np.pad(half, ((90, 90), (0, 0)), mode="edge")]), CUBE)


def test_corners_of_a_cube_with_other_faces_are_refused() -> None:
    with pytest.raises(CubeError, match="which marker is on which face"):
        cube_pose(find_cube(paint(), CUBE), Cube(ids=(0, 3, 2, 1, 4, 5)), CAMERA)


@pytest.mark.parametrize(
    ("wrong", "why"),
    [
        ({"side_m": 5.0}, "10 mm and 1 m"),
        ({"marker_m": 0.059}, "0.3 to 0.9"),
        ({"dictionary": "DICT_9X9"}, "unknown dictionary"),
        ({"ids": (0, 1, 2, 3, 4, 4)}, "six different"),
    ],
)
def test_a_cube_that_cannot_be_is_refused(wrong: dict[str, object], why: str) -> None:
    with pytest.raises(ValueError, match=why):
        Cube(**wrong)  # type: ignore[arg-type]


def test_a_cube_comes_back(tmp_path: Path) -> None:
    cube = Cube(0.0523, 0.0401, "DICT_5X5_50", (6, 1, 2, 3, 9, 5))
    write_cube(tmp_path / "cube.json", cube)
    assert read_cube(tmp_path / "cube.json") == cube


@pytest.mark.parametrize(
    ("values", "why"),
    [
        ({"handcal_cube": 2}, "handcal_cube must be 1"),
        ({"handcal_cube": 1, "edge_m": 0.06}, "has no edge_m"),
        ({"handcal_cube": 1, "side_m": 60.0}, "10 mm and 1 m"),
    ],
)
def test_another_file_is_refused(tmp_path: Path, values: dict[str, object], why: str) -> None:
    write_json(tmp_path / "cube.json", values)
    with pytest.raises(FileError, match=why):
        read_cube(tmp_path / "cube.json")


_FRAME_NS = 33_000_000


def test_the_filter_averages_at_rest_and_starts_again_after_a_jump() -> None:
    rng = np.random.default_rng(1)
    filter_ = CubeFilter()
    here, there = rigid([0.1, 0.2, 0.3], [0.0, 0.0, 0.5]), rigid(None, [0.1, 0.0, 0.6])
    off_m, raw_m, rested = [], [], []
    for number in range(60):
        T = here @ rigid(rng.normal(0, 0.002, 3), rng.normal(0, 0.001, 3))
        found = filter_.take(T, number * _FRAME_NS)
        rested.append(found.is_at_rest)
        if number > 30:
            off_m.append(np.linalg.norm(found.T_W_T[:3, 3] - here[:3, 3]))
            raw_m.append(np.linalg.norm(T[:3, 3] - here[:3, 3]))
    assert not any(rested[:18])
    assert all(rested[25:])
    assert np.mean(off_m) < 0.5 * np.mean(raw_m)
    moved = filter_.take(there, 60 * _FRAME_NS)
    assert not moved.is_at_rest
    assert moved.frames == 1
    np.testing.assert_allclose(moved.T_W_T, there)


def test_a_cube_in_slow_motion_is_not_at_rest() -> None:
    filter_ = CubeFilter()
    poses = (rigid(None, [0.002 * number, 0.0, 0.5]) for number in range(60))
    assert not any(filter_.take(T, n * _FRAME_NS).is_at_rest for n, T in enumerate(poses))


def test_a_cube_is_at_rest_again_after_the_camera_has_restarted() -> None:
    filter_, T = CubeFilter(), rigid(None, [0.0, 0.0, 0.5])
    before = [filter_.take(T, n * _FRAME_NS + 10**12) for n in range(40)]
    after = [filter_.take(T, n * _FRAME_NS) for n in range(40)]
    assert before[-1].is_at_rest
    assert not after[0].is_at_rest
    assert after[-1].is_at_rest


def test_the_cubes_faces_are_in_order() -> None:
    cube = Cube()
    corners_m = cube_corners_m(cube)
    np.testing.assert_allclose(np.abs(corners_m), 0.5 * cube.side_m)
    np.testing.assert_allclose(corners_m[4:] - corners_m[:4], [[0.0, 0.0, cube.side_m]] * 4)
    straight = rigid(None, [0.0, 0.0, 0.5])
    np.testing.assert_allclose(facing_corners_m(cube, straight), corners_m[:4])
    turned = rigid([0.0, 1.2, 0.0], [0.0, 0.0, 0.5])
    face_m = transform(turned, facing_corners_m(cube, turned))
    nearest_m = min((turned @ face_pose(cube, marker))[2, 3] for marker in cube.ids)
    np.testing.assert_allclose(face_m[:, 2].mean(), nearest_m)


PRINTED = Cube(ids=(7, 11, 2, 33, 4, 5))


def test_the_net_shows_every_marker_upright_on_its_face() -> None:
    scale = 4000  # pixels a metre: cells of whole pixels
    image = np.full((round(0.2 * scale), round(0.27 * scale)), 255, np.uint8)
    for left, top, right, bottom in np.rint((net_rectangles_m(PRINTED) + 0.008) * scale).astype(
        int
    ):
        image[top:bottom, left:right] = 0
    corners, ids, _ = cv2.aruco.ArucoDetector(PRINTED.marker_dictionary).detectMarkers(image)
    first = {
        int(marker): (found.reshape(4, 2)[0] / scale - 0.008) / PRINTED.side_m
        for marker, found in zip(ids.ravel(), corners, strict=True)
    }
    columns_rows = {33: (0, 1), 7: (1, 1), 11: (2, 1), 2: (3, 1), 4: (1, 0), 5: (1, 2)}
    assert first.keys() == columns_rows.keys()
    for marker, place in columns_rows.items():
        np.testing.assert_allclose(first[marker], np.array(place) + 0.125, atol=0.01)


@pytest.mark.process
def test_the_printed_net_has_its_true_size(tmp_path: Path) -> None:
    if shutil.which("pdftoppm") is None:
        pytest.skip("pdftoppm is not installed")
    write_cube_pdf(tmp_path / "net.pdf", PRINTED)
    command = ["pdftoppm", "-r", "101.6", "-gray", "-png", "-singlefile", "net.pdf", "net"]
    subprocess.run(command, cwd=tmp_path, check=True)
    image = read_image(tmp_path / "net.png", cv2.IMREAD_GRAYSCALE)
    corners, _, _ = cv2.aruco.ArucoDetector(PRINTED.marker_dictionary).detectMarkers(image)
    sides_mm = [
        np.linalg.norm(found.reshape(4, 2)[1] - found.reshape(4, 2)[0]) / 4 for found in corners
    ]
    assert len(sides_mm) == 6
    np.testing.assert_allclose(sides_mm, 45.0, atol=0.4)


def test_a_net_larger_than_the_paper_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="more than a4 has"):
        write_cube_pdf(tmp_path / "net.pdf", Cube(side_m=0.08))

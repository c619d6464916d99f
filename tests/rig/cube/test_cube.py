import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handcal.core.geometry import image_points, rigid, transform
from handcal.core.types import Float64, Intrinsics, UInt8
from handcal.rig.cube import Cube, CubeError, cube_pose, face_pose, find_cube, marker_corners_m
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


def test_the_net_closes() -> None:
    """Each side of the middle row is folded back from the one before it; top and bottom from it."""
    T_front_right = np.linalg.inv(face_pose(CUBE, 0)) @ face_pose(CUBE, 1)
    for left, right in ((0, 1), (1, 2), (2, 3), (3, 0)):
        step = np.linalg.inv(face_pose(CUBE, left)) @ face_pose(CUBE, right)
        np.testing.assert_allclose(step, T_front_right, atol=1e-12)
    # The lower edge of the top, and the upper edge of the bottom, are the front's.
    lower, upper = np.array([[0, 0.03, 0]]), np.array([[0, -0.03, 0]])
    front = face_pose(CUBE, 0)
    np.testing.assert_allclose(
        transform(face_pose(CUBE, 4), lower), transform(front, upper), atol=1e-12
    )
    np.testing.assert_allclose(
        transform(face_pose(CUBE, 5), upper), transform(front, lower), atol=1e-12
    )


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
        ({"ids": (0, 1, 2, 3, 4, 50)}, "of the 50"),
    ],
)
def test_a_cube_that_cannot_be_is_refused(wrong: dict[str, object], why: str) -> None:
    with pytest.raises(ValueError, match=why):
        Cube(**wrong)  # type: ignore[arg-type]

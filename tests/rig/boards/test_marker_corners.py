import cv2
import numpy as np
import pytest

from handcal.core.geometry import image_points, rigid, transform
from handcal.core.types import Float64, Intrinsics, UInt8
from handcal.rig.cube import Cube, marker_corners_m, refine_corners
from handcal.sim.boards import PictureSettings
from handcal.sim.cube import CubePainter

TRUE_PX = np.array([[60.3, 52.7], [148.2, 61.4], [141.1, 150.9], [49.8, 139.6]])


def square(blur_px: float) -> UInt8:
    """Return a dark square on white, each pixel the mean of eight by eight."""
    places = (np.arange(200 * 8) + 0.5) / 8 - 0.5
    x, y = np.meshgrid(places, places)
    inside = np.ones(x.shape, np.bool_)
    for (x0, y0), (x1, y1) in zip(TRUE_PX, np.roll(TRUE_PX, -1, axis=0), strict=True):
        inside &= (x1 - x0) * (y - y0) > (y1 - y0) * (x - x0)
    share = inside.reshape(200, 8, 200, 8).mean(axis=(1, 3))
    image = np.asarray(cv2.GaussianBlur(215.0 - 185.0 * share, (0, 0), blur_px))
    shades: UInt8 = np.rint(image).astype(np.uint8)
    return shades


@pytest.mark.parametrize("blur_px", [0.5, 1.0, 1.5])
def test_blur_does_not_move_the_corners(blur_px: float) -> None:
    rough_px = TRUE_PX + np.array([[0.8, -0.5], [-0.6, 0.7], [0.5, 0.6], [-0.7, -0.4]])
    found_px = refine_corners(square(blur_px), rough_px, 6)
    np.testing.assert_allclose(found_px, TRUE_PX, atol=0.1)


def test_a_square_without_contrast_is_left_about_where_it_was() -> None:
    flat: Float64 = refine_corners(np.full((200, 200), 127, np.uint8), TRUE_PX, 6)
    np.testing.assert_allclose(flat, TRUE_PX, atol=1e-6)


def test_a_marker_seen_from_the_side_keeps_its_corners() -> None:
    """Its cells are narrow across the long edges: only the border's counts there."""
    cube = Cube()
    camera = Intrinsics(640, 360, 1000.0, 1000.0, 320.0, 180.0)
    pose = rigid([0.0, 0.0, 0.1], [0.0, 0.0, 0.55]) @ rigid([0.35, 0.0, 0.0])
    image = CubePainter(cube, camera, PictureSettings(noise=0.0)).paint(
        pose, np.random.default_rng(1)
    )
    top_px = image_points(transform(pose, marker_corners_m(cube, [4])), camera)
    height_px = np.ptp(top_px[:, 1])
    assert height_px < 40
    found_px = refine_corners(image, top_px + 0.3, 6)
    np.testing.assert_allclose(found_px, top_px, atol=0.25)

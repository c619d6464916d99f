import numpy as np
import pytest
from PySide6.QtGui import QImage

from handcal_gui.calibrate.parts.splat import rgb, splat

RED, BLUE, BLACK = (255, 0, 0), (0, 0, 255), (0, 0, 0)


def _pixels(image: QImage) -> np.ndarray:
    """Return (h, w, 4) RGBA."""
    image = image.convertToFormat(QImage.Format.Format_RGBA8888)
    pixels = np.frombuffer(image.constBits(), np.uint8).copy()
    return pixels.reshape(image.height(), image.width(), 4)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_the_nearer_point_hides_the_farther(order: tuple[int, int]) -> None:
    points = np.array([[5.0, 5.0, 1.0], [5.0, 5.0, 2.0]])[list(order)]
    shades = np.array([RED, BLUE], np.uint8)[list(order)]
    pixels = _pixels(splat(points, shades, BLACK, (11, 11), 1))
    assert tuple(pixels[5, 5]) == (*RED, 255)
    assert np.count_nonzero(pixels[..., 3]) == 1


def test_a_point_is_a_square_around_its_place() -> None:
    pixels = _pixels(
        splat(np.array([[4.0, 6.0, 0.0]]), np.array([RED], np.uint8), BLACK, (12, 10), 3)
    )
    expected = np.zeros((10, 12), dtype=bool)
    expected[5:8, 3:6] = True
    np.testing.assert_array_equal(pixels[..., 3] == 255, expected)


def test_distance_fades_into_the_background() -> None:
    points = np.array([[2.0, 2.0, 0.0], [6.0, 2.0, 1.0]])
    pixels = _pixels(splat(points, np.array([RED, RED], np.uint8), (0, 100, 0), (9, 5), 1))
    near, far = pixels[2, 2, :3], pixels[2, 6, :3]
    assert tuple(near) == RED
    assert 0 < far[0] < near[0]
    assert far[1] > near[1]


def test_points_beyond_the_edges_are_left_out() -> None:
    points = np.array([[-1.0, 2.0, 0.0], [9.0, 2.0, 0.0], [4.0, -5.0, 0.0], [4.0, 99.0, 0.0]])
    shades = np.tile(np.array(RED, np.uint8), (4, 1))
    assert not _pixels(splat(points, shades, BLACK, (9, 5), 3))[..., 3].any()
    assert not _pixels(splat(points[:0], shades[:0], BLACK, (9, 5), 3))[..., 3].any()


def test_rgb_of_a_named_color() -> None:
    assert rgb("#0a141e") == (10, 20, 30)

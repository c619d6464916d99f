import numpy as np
import pytest

from handcal.train.samples import (
    blemish,
    box_corners,
    clipped,
    random_warp,
    relight,
    transform_corners,
)

BOX = np.array([[10.0, 20.0, 30.0, 60.0]])


def test_boxes_follow_the_map() -> None:
    warp = np.array([[-2.0, 0.0, 100.0], [0.0, 2.0, 5.0]])
    assert transform_corners(warp, box_corners(BOX)).tolist() == [[40.0, 45.0, 80.0, 125.0]]


def test_a_turned_quadrilateral_gets_the_box_about_it() -> None:
    quad = np.array([[[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]]])
    turned = transform_corners(np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0]]), quad)
    assert turned == pytest.approx(np.array([[-8.0, 0.0, 6.0, 14.0]]))


@pytest.mark.parametrize("seed", range(20))
def test_a_random_map_has_the_scale(seed: int) -> None:
    rng = np.random.default_rng(seed)
    warp = random_warp(rng, (400, 300), np.array([200.0, 150.0]), 1.5, 192, 0.4)
    assert abs(np.linalg.det(warp[:, :2])) == pytest.approx(1.5**2)
    across, down = np.linalg.norm(warp[:, :2], axis=0)
    assert across / down == pytest.approx(1.0, abs=0.11)
    assert abs(np.arctan2(warp[1, 0], abs(warp[0, 0]))) <= 0.4


def test_a_random_map_shows_the_centre_of_a_large_picture() -> None:
    rng = np.random.default_rng(0)
    center = np.array([2000.0, 1500.0])
    for _ in range(50):
        warp = random_warp(rng, (4000, 3000), center, 1.0, 192, 0.4)
        shown = warp[:, :2] @ center + warp[:, 2]
        assert (shown > 0.09 * 192).all()
        assert (shown < 0.91 * 192).all()


def test_boxes_are_cut_and_those_with_little_left_marked() -> None:
    boxes = np.array(
        [
            [10.0, 10.0, 50.0, 50.0],  # all in view
            [-30.0, 10.0, 10.0, 50.0],  # a quarter in view
            [100.0, 100.0, 104.0, 104.0],  # too small
            [-50.0, 0.0, -10.0, 40.0],  # out of view
        ]
    )
    cut = clipped(boxes, side_px=192, shown_min=0.35, smallest_px=9.0)
    assert cut.tolist() == [
        [10.0, 10.0, 50.0, 50.0, 0.0],
        [0.0, 10.0, 10.0, 50.0, 1.0],
        [100.0, 100.0, 104.0, 104.0, 1.0],
    ]


@pytest.mark.parametrize("seed", range(30))
def test_light_and_blemishes_keep_the_picture_a_picture(seed: int) -> None:
    rng = np.random.default_rng(seed)
    image = rng.integers(0, 256, (32, 32, 3), np.uint8)
    changed = blemish(rng, relight(rng, image))
    assert changed.shape == image.shape
    assert changed.dtype == np.uint8


@pytest.mark.parametrize("seed", range(60))
def test_blemishes_shift_nothing(seed: int) -> None:
    rows, columns = np.mgrid[:64, :64] * 4
    ramps = np.stack([rows, columns, rows], axis=2).astype(np.uint8)
    inner = np.s_[8:-8, 8:-8]
    blemished = blemish(np.random.default_rng(seed), ramps)
    shift_px = (blemished[inner].mean((0, 1)) - ramps[inner].mean((0, 1))) / 4.0
    assert shift_px == pytest.approx(np.zeros(3), abs=0.25)

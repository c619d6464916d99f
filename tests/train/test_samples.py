"""Samples of the training, and how they are changed."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

pytest.importorskip("torch")

from handcal.io.files import write_json
from handcal.lab.evaluate.annotations import Photo
from handcal.train.samples import (
    Samples,
    SampleSettings,
    blemish,
    clipped,
    collate,
    random_warp,
    transform_corners,
)

HAND = (120, 80, 180, 160)


def photo(path: Path) -> Photo:
    """Write a photograph in which the hand is the only thing that is bright."""
    x0, y0, x1, y1 = HAND
    image = np.full((300, 400, 3), 30, np.uint8)
    image[y0:y1, x0:x1] = 220
    cv2.imwrite(str(path), image)
    boxes = np.array([HAND], float)
    quads = np.array([[[x0, y0], [x1, y0], [x1, y1], [x0, y1]]], float)
    return Photo(path, 400, 300, boxes, quads, np.ones(1, bool))


@pytest.fixture(scope="module")
def samples(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Samples]:
    """Return samples of photographs, of simulated pictures, and of the two in one."""
    folder = tmp_path_factory.mktemp("pictures")
    picture = np.zeros((240, 424, 4), np.uint8)
    picture[60:160, 200:280] = 255
    cv2.imwrite(str(folder / "00000.png"), picture)
    write_json(folder / "boxes.json", {"00000.png": [200, 60, 280, 160]})
    photos = [photo(folder / "photo.png")]
    return {
        name: Samples(
            photos,
            folder,
            SampleSettings(simulated=sim, pasted=pasted, blended=blended, disturbed=disturbed),
            seed=1,
        )
        for name, sim, pasted, blended, disturbed in (
            ("photographed", 0.0, 0.0, 0.0, 1.0),
            ("simulated", 1.0, 0.0, 0.0, 1.0),
            ("pasted", 0.0, 1.0, 0.0, 1.0),
            ("blended", 0.0, 0.0, 1.0, 0.0),
        )
    }


@pytest.mark.parametrize("kind", ["photographed", "simulated"])
def test_boxes_are_on_the_hand_to_a_fraction_of_a_pixel(
    samples: dict[str, Samples], kind: str
) -> None:
    """Mirrored or not: what is off by a pixel one way is off the other way in the mirror."""
    off = []
    for index in range(60):
        image, boxes = samples[kind][index]
        gray = image.mean(2)
        if not len(boxes) or boxes[0, :4].min() < 5 or boxes[0, :4].max() > len(image) - 5:
            continue
        level = 0.25 * gray.min() + 0.75 * gray.max()  # beyond the image is gray
        bright = np.argwhere(gray > level)[:, ::-1] + 0.5
        center = (boxes[0, :2] + boxes[0, 2:4]) / 2
        off.append(bright.mean(0) - center)
    assert len(off) > 10
    assert np.median(np.abs(off), axis=0) == pytest.approx([0.0, 0.0], abs=0.15)


def test_a_pasted_hand_is_one_more(samples: dict[str, Samples]) -> None:
    without = [len(samples["photographed"][index][1]) for index in range(30)]
    pasted = [len(samples["pasted"][index][1]) for index in range(30)]
    assert sum(pasted) > sum(without)


def test_a_blend_shows_both_hands_and_leaves_out_the_fainter_one(
    samples: dict[str, Samples],
) -> None:
    """Of hands of 220 before walls of 30, blended: as bright as their share."""
    left_out = 0
    for index in range(60):
        image, boxes = samples["blended"][index]
        whole = [box for box in boxes if (box[2:4] - box[:2] > 20).all()]
        for x0, y0, x1, y1, is_left_out in whole:
            middle = image[int(y0 + y1) // 2, int(x0 + x1) // 2].mean()
            share_min = 0.2 if is_left_out else 0.35
            assert middle > 30 + share_min * 190 - 3
            left_out += bool(is_left_out)
    assert left_out > 5


def test_a_sample_is_the_same_every_time(samples: dict[str, Samples]) -> None:
    first, again = samples["pasted"][7], samples["pasted"][7]
    assert (first[0] == again[0]).all()
    assert (first[1] == again[1]).all()
    assert (samples["pasted"][8][0] != first[0]).any()


def test_a_batch_keeps_pictures_and_boxes_together(samples: dict[str, Samples]) -> None:
    drawn = [samples["simulated"][index] for index in range(3)]
    images, boxes = collate(drawn)
    side_px = SampleSettings().side_px
    assert images.shape == (3, 3, side_px, side_px)
    assert (images[1].numpy().transpose(1, 2, 0) == drawn[1][0]).all()
    assert [len(part) for part in boxes] == [len(part) for _, part in drawn]


BOX = np.array([[10.0, 20.0, 30.0, 60.0]])


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


@pytest.mark.parametrize("seed", range(60))
def test_blemishes_shift_nothing(seed: int) -> None:
    rows, columns = np.mgrid[:64, :64] * 4
    ramps = np.stack([rows, columns, rows], axis=2).astype(np.uint8)
    inner = np.s_[8:-8, 8:-8]
    blemished = blemish(np.random.default_rng(seed), ramps)
    shift_px = (blemished[inner].mean((0, 1)) - ramps[inner].mean((0, 1))) / 4.0
    assert shift_px == pytest.approx(np.zeros(3), abs=0.25)

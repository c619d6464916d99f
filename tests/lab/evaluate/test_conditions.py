from pathlib import Path

import cv2
import numpy as np
import pytest

from handcal.core.errors import HandcalError
from handcal.lab.evaluate.annotations import Photo
from handcal.lab.evaluate.detector import Conditions, shown

BOX = [30.0, 20.0, 70.0, 60.0]


@pytest.fixture
def photo(tmp_path: Path) -> Photo:
    image = np.full((80, 100, 3), 250, np.uint8)
    image[20:60, 30:70] = (170, 120, 100)
    image[20:60, 50:70] //= 2  # in shadow
    cv2.imwrite(str(tmp_path / "a.png"), image[..., ::-1])
    return Photo(
        tmp_path / "a.png", 100, 80, np.array([BOX]), np.zeros((1, 4, 2)), np.ones(1, bool)
    )


def test_nothing_is_changed_by_default(photo: Photo) -> None:
    view = shown(photo, Conditions())
    assert (view.image == photo.read()).all()
    assert view.in_photo(photo.boxes).tolist() == [BOX]


def test_brightness_multiplies(photo: Photo) -> None:
    assert (shown(photo, Conditions(brightness=0.3)).image[40, 40] == [51, 36, 30]).all()
    assert shown(photo, Conditions(brightness=9.0)).image.max() == 255


@pytest.mark.parametrize("share", [0.1, 1 / 3, 1.0])
def test_the_hand_has_the_height_and_is_in_the_middle(photo: Photo, share: float) -> None:
    view = shown(photo, Conditions(hand_height=share))
    assert view.image.shape == (480, 640, 3)
    middle = share * 480 / 2 * 0.9
    box = np.array([[320 - middle, 240 - middle, 320 + middle, 240 + middle]])
    low, high = view.in_photo(box)[0, :2], view.in_photo(box)[0, 2:]
    assert low == pytest.approx([32, 22], abs=0.6)
    assert high == pytest.approx([68, 58], abs=0.6)
    assert (view.image[240, 310] == [170, 120, 100]).all()


def test_a_photograph_without_a_hand_cannot_be_scaled(photo: Photo) -> None:
    empty = Photo(photo.path, 100, 80, np.zeros((0, 4)), np.zeros((0, 4, 2)), np.zeros(0, bool))
    with pytest.raises(HandcalError, match="no hand"):
        shown(empty, Conditions(hand_height=0.3))


def test_a_glove_covers_the_hand_and_keeps_the_shading(photo: Photo) -> None:
    image = shown(photo, Conditions(glove="blue")).image.astype(int)
    assert (image[10, 10] == 250).all()
    lit, shaded = image[40, 40], image[40, 60]
    assert lit[2] > lit[1] > lit[0]
    assert lit == pytest.approx(2 * shaded, abs=3)

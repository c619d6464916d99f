from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from handcal.core.errors import FileError
from handcal.core.progress import Progress
from handcal.core.types import Float64, UInt8
from handcal.hand.detect import Detections
from handcal.lab.evaluate.annotations import Photo
from handcal.lab.evaluate.detector import (
    Conditions,
    ImageResult,
    contact_sheet,
    detect_all,
    evaluation,
    found_shares,
    summary,
    write_contact_sheet,
)

SMALL, LARGE = [10.0, 10.0, 20.0, 20.0], [30.0, 20.0, 70.0, 60.0]


class Seer:
    """A detector that sees one box, wherever it looks."""

    def detect(self, color: UInt8, pixels: int | None = None) -> Detections:
        assert color.shape == (80, 100, 3)
        return Detections(np.array([LARGE]), np.array([0.8]))


@pytest.fixture
def photo(tmp_path: Path) -> Photo:
    path = tmp_path / "a.png"
    cv2.imwrite(str(path), np.full((80, 100, 3), 90, np.uint8))
    boxes = np.array([SMALL, LARGE])
    return Photo(path, 100, 80, boxes, np.zeros((2, 4, 2)), np.array([False, True]))


def found(boxes: list[list[float]], photo: Photo) -> ImageResult:
    at: Float64 = np.array(boxes).reshape(-1, 4)
    return ImageResult(at, np.full(len(at), 0.8), photo.boxes)


def test_each_number_counts_its_own_hands(photo: Photo) -> None:
    large_found = summary([photo], [found([LARGE], photo)])
    assert large_found == {"ap50": 0.5, "ap50_large": 1.0, "ap50_rel15": 1.0, "ap50_rel25": 1.0}
    small_found = summary([photo], [found([SMALL], photo)])
    assert small_found == {"ap50": 0.5, "ap50_large": 0.0, "ap50_rel15": 0.0, "ap50_rel25": 0.0}


def test_a_false_box_counts_among_hands_of_its_size_and_smaller(photo: Photo) -> None:
    false = [80.0, 60.0, 96.0, 76.0]  # 18 % of the image's side
    result = ImageResult(np.array([false, LARGE]), np.array([0.9, 0.8]), photo.boxes)
    wrong = summary([photo], [result])
    assert (wrong["ap50_rel15"], wrong["ap50_rel25"]) == (0.5, 1.0)


def test_no_hand_no_number(photo: Photo) -> None:
    nothing = Photo(photo.path, 100, 80, np.zeros((0, 4)), np.zeros((0, 4, 2)), np.zeros(0, bool))
    assert set(summary([nothing], [found([LARGE], nothing)]).values()) == {None}


def test_runs_the_detector_on_every_photograph(photo: Photo) -> None:
    shares: list[float] = []
    results = detect_all([photo, photo], Seer(), Progress(lambda _, share: shares.append(share)))
    assert [result.boxes.tolist() for result in results] == [[LARGE], [LARGE]]
    assert shares == [0.5, 1.0]


def test_a_photograph_that_is_missing_is_named(photo: Photo) -> None:
    photo.path.unlink()
    with pytest.raises(FileError, match=r"a\.png"):
        detect_all([photo], Seer())


def test_the_curve_goes_with_the_number(photo: Photo) -> None:
    result = evaluation([photo], [found([LARGE, [80.0, 0.0, 99.0, 9.0]], photo)])
    assert (result["images"], result["hands"]) == (1, 2)
    assert result["curve"]["recall"][-1] == 0.5
    assert result["curve"]["precision"][0] == 1.0


def test_the_curve_may_be_empty(photo: Photo) -> None:
    assert evaluation([photo], [found([], photo)])["curve"]["recall"] == []


def test_failures_are_drawn_and_successes_not(photo: Photo) -> None:
    right = found([SMALL, LARGE], photo)
    assert contact_sheet([photo], [right], 0.3).size == 0
    sheet = contact_sheet([photo], [found([SMALL], photo)], 0.3)
    red = (sheet[..., 0] > 200) & (sheet[..., 1] < 100)
    rows, columns = np.nonzero(red)
    # The missed hand's frame, at 2.4 times its size.
    assert columns.min() == pytest.approx(72, abs=2)
    assert rows.max() == pytest.approx(144, abs=2)


def test_doubtful_detections_are_no_failures(photo: Photo) -> None:
    doubtful = found([SMALL, LARGE, [80.0, 0.0, 99.0, 9.0]], photo)
    doubtful.scores[2] = 0.1
    assert contact_sheet([photo], [doubtful], 0.3).size == 0
    assert contact_sheet([photo], [doubtful], 0.05).size > 0


def test_a_tile_may_be_one_pixel_wide(tmp_path: Path) -> None:
    path = tmp_path / "strip.png"
    cv2.imwrite(str(path), np.full((2, 1200, 3), 90, np.uint8))
    boxes = np.array([[600.0, 0.0, 1200.0, 2.0]])
    strip = Photo(path, 1200, 2, boxes, np.zeros((1, 4, 2)), np.array([True]))
    sheet = contact_sheet([strip], [found([], strip)], 0.3)
    assert ((sheet[..., 0] > 200) & (sheet[..., 1] < 100)).any()


def test_the_sheet_is_written_as_a_picture(photo: Photo, tmp_path: Path) -> None:
    for number, boxes in enumerate(([SMALL], [SMALL, LARGE])):
        path = tmp_path / f"{number}.png"
        write_contact_sheet(path, [photo], [found(boxes, photo)])
        assert cv2.imread(str(path)) is not None
    with pytest.raises(FileError, match="png"):
        write_contact_sheet(tmp_path / "sheet.what", [photo], [found([SMALL], photo)])


def test_shares_are_counted_by_skin_and_aspect_at_the_products_threshold(photo: Photo) -> None:
    dark = replace(photo, skin="dark", aspect="palmar", boxes=np.array([LARGE]))
    fair = replace(photo, skin="fair", aspect="dorsal", boxes=np.array([LARGE]))
    doubtful = found([LARGE], dark)
    doubtful.scores[0] = 0.29
    everything, by_dark, by_fair = found_shares([dark, fair], [doubtful, found([LARGE], fair)])
    assert (everything.skin, everything.hands, everything.found) == ("", 2, 1)
    assert (by_dark.skin, by_dark.aspect, by_dark.share) == ("dark", "palmar", 0.0)
    assert (by_fair.skin, by_fair.aspect, by_fair.share) == ("fair", "dorsal", 1.0)


def test_photographs_without_groups_are_counted_once(photo: Photo) -> None:
    [everything] = found_shares([photo], [found([LARGE], photo)])
    assert (everything.hands, everything.found) == (2, 1)


def test_boxes_found_in_a_scaled_photograph_are_in_its_own_pixels(photo: Photo) -> None:
    class Bright:
        """Sees the box of what is bright."""

        def detect(self, color: UInt8, pixels: int | None = None) -> Detections:
            assert color.shape == (480, 640, 3)
            rows, columns = np.nonzero(color[..., 0] > 128)
            box = [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]
            assert box[3] - box[1] == pytest.approx(160, abs=1)
            return Detections(np.array([box], np.float64), np.array([0.8]))

    image = np.zeros((80, 100, 3), np.uint8)
    image[20:60, 30:70] = 255
    cv2.imwrite(str(photo.path), image)
    one = replace(photo, boxes=np.array([LARGE]))
    [result] = detect_all([one], Bright(), conditions=Conditions(hand_height=1 / 3))
    assert result.boxes == pytest.approx(np.array([LARGE]), abs=0.5)

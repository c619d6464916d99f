from pathlib import Path

import cv2
import numpy as np
import pytest

from handcal.errors import FileError
from handcal.hand.detect import Detections
from handcal.lab.evaluate.annotations import Photo
from handcal.lab.evaluate.contact_sheet import contact_sheet, write_contact_sheet
from handcal.lab.evaluate.detector import detect_all, evaluation, summary
from handcal.lab.evaluate.precision import ImageResult
from handcal.progress import Progress
from handcal.types import Float64, UInt8

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

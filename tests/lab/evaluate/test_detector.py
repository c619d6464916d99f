"""The hand detector on annotated photographs: precision, conditions, and the command."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from handcal.cli.main import main
from handcal.core.errors import FileError, HandcalError
from handcal.core.types import Float64, UInt8
from handcal.hand.detect import Detections
from handcal.lab.evaluate.annotations import Photo
from handcal.lab.evaluate.detector import (
    Conditions,
    ImageResult,
    PrecisionRecall,
    contact_sheet,
    detect_all,
    evaluation,
    found_shares,
    precision_recall,
    shown,
    summary,
    write_contact_sheet,
)

SMALL, LARGE = [10.0, 10.0, 20.0, 20.0], [30.0, 20.0, 70.0, 60.0]


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


def test_the_curve_goes_with_the_number(photo: Photo) -> None:
    result = evaluation([photo], [found([LARGE, [80.0, 0.0, 99.0, 9.0]], photo)])
    assert (result["images"], result["hands"]) == (1, 2)
    assert result["curve"]["recall"][-1] == 0.5
    assert result["curve"]["precision"][0] == 1.0


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


HAND = [0.0, 0.0, 10.0, 10.0]
OTHER = [50.0, 50.0, 70.0, 70.0]
NOWHERE = [90.0, 90.0, 99.0, 99.0]


def image(found: Sequence[tuple[list[float], float]], hands: Sequence[list[float]]) -> ImageResult:
    boxes = np.array([box for box, _ in found], float).reshape(-1, 4)
    scores = np.array([score for _, score in found], float)
    return ImageResult(boxes, scores, np.array(hands, float).reshape(-1, 4))


def curve(result: ImageResult, counted: Sequence[bool] | None = None) -> PrecisionRecall:
    chosen = np.ones(len(result.hands), bool) if counted is None else np.array(counted)
    return precision_recall([(result, chosen)])


def test_all_found_and_nothing_else() -> None:
    result = curve(image([(HAND, 0.9), (OTHER, 0.8)], [HAND, OTHER]))
    assert result.average_precision == 1.0
    assert result.recall.tolist() == [0.5, 1.0]


def test_a_false_detection_costs_only_what_comes_after_it() -> None:
    before = curve(image([(NOWHERE, 0.9), (HAND, 0.8)], [HAND]))
    after = curve(image([(HAND, 0.8), (NOWHERE, 0.1)], [HAND]))
    assert before.average_precision == 0.5
    assert after.average_precision == 1.0


def test_area_by_all_points() -> None:
    # Right, false, right of three hands: 1/3 at precision 1, 1/3 at 2/3, the third never found.
    result = curve(
        image([(HAND, 0.9), (NOWHERE, 0.8), (OTHER, 0.7)], [HAND, OTHER, [20, 0, 30, 9]])
    )
    assert result.average_precision == pytest.approx(1 / 3 + 2 / 9)


def test_a_hand_found_twice_is_right_once() -> None:
    result = curve(image([(HAND, 0.9), ([0, 0, 10, 9], 0.8)], [HAND, OTHER]))
    assert result.precision.tolist() == [1.0, 0.5]


def test_half_overlap_decides() -> None:
    found = curve(image([([0, 0, 10, 5], 0.9)], [HAND]))
    missed = curve(image([([0, 0, 10, 4.9], 0.9)], [HAND]))
    assert (found.average_precision, missed.average_precision) == (1.0, 0.0)


def test_hands_that_do_not_count_are_neither_right_nor_false() -> None:
    result = curve(image([(HAND, 0.9), (OTHER, 0.8)], [HAND, OTHER]), [False, True])
    assert result.average_precision == 1.0
    assert result.scores.tolist() == [0.8]


def test_scores_rank_across_images() -> None:
    sure = image([(HAND, 0.9)], [HAND])
    unsure = image([(NOWHERE, 0.5)], [HAND])
    counted = np.ones(1, bool)
    assert precision_recall([(unsure, counted), (sure, counted)]).average_precision == 0.5


def test_without_hands_there_is_no_precision() -> None:
    assert np.isnan(curve(image([(HAND, 0.9)], [])).average_precision)


BOX = [30.0, 20.0, 70.0, 60.0]


@pytest.fixture
def hand_photo(tmp_path: Path) -> Photo:
    image = np.full((80, 100, 3), 250, np.uint8)
    image[20:60, 30:70] = (170, 120, 100)
    image[20:60, 50:70] //= 2  # in shadow
    cv2.imwrite(str(tmp_path / "a.png"), image[..., ::-1])
    return Photo(
        tmp_path / "a.png", 100, 80, np.array([BOX]), np.zeros((1, 4, 2)), np.ones(1, bool)
    )


@pytest.mark.parametrize("share", [0.1, 1 / 3, 1.0])
def test_the_hand_has_the_height_and_is_in_the_middle(hand_photo: Photo, share: float) -> None:
    view = shown(hand_photo, Conditions(hand_height=share))
    assert view.image.shape == (480, 640, 3)
    middle = share * 480 / 2 * 0.9
    box = np.array([[320 - middle, 240 - middle, 320 + middle, 240 + middle]])
    low, high = view.in_photo(box)[0, :2], view.in_photo(box)[0, 2:]
    assert low == pytest.approx([32, 22], abs=0.6)
    assert high == pytest.approx([68, 58], abs=0.6)
    assert (view.image[240, 310] == [170, 120, 100]).all()


def test_a_photograph_without_a_hand_cannot_be_scaled(hand_photo: Photo) -> None:
    empty = Photo(
        hand_photo.path, 100, 80, np.zeros((0, 4)), np.zeros((0, 4, 2)), np.zeros(0, bool)
    )
    with pytest.raises(HandcalError, match="no hand"):
        shown(empty, Conditions(hand_height=0.3))


def test_a_glove_covers_the_hand_and_keeps_the_shading(hand_photo: Photo) -> None:
    image = shown(hand_photo, Conditions(glove="blue")).image.astype(int)
    assert (image[10, 10] == 250).all()
    lit, shaded = image[40, 40], image[40, 60]
    assert lit[2] > lit[1] > lit[0]
    assert lit == pytest.approx(2 * shaded, abs=3)


class Seer:
    """A detector that sees the hand, and another that is not there."""

    def detect(self, color: UInt8, pixels: int | None = None) -> Detections:
        assert color.shape == (96, 128, 3)
        return Detections(
            np.array([[10.0, 10.0, 60.0, 60.0], [70.0, 70.0, 90.0, 90.0]]), np.array([0.9, 0.8])
        )


def evaluate(
    monkeypatch: pytest.MonkeyPatch, *arguments: object, command: str = "detector"
) -> None:
    monkeypatch.setattr("sys.argv", ["handcal", "evaluate", command, *map(str, arguments)])
    main()


def test_writes_the_figures_and_the_failures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cv2.imwrite(str(tmp_path / "a.png"), np.full((96, 128, 3), 127, np.uint8))
    box = [10, 10, 60, 60]
    quad = [[10, 10], [60, 10], [60, 60], [10, 60]]
    hands = [{"box": box, "quad": quad, "large": True}]
    annotations = tmp_path / "annotations.json"
    annotations.write_text(json.dumps({"a.png": {"width": 128, "height": 96, "hands": hands}}))
    figures, sheet = tmp_path / "out" / "figures.json", tmp_path / "out" / "sheet.png"
    files = ("--images", tmp_path, "--annotations", annotations)
    monkeypatch.setattr("handcal.hand.shipped.load_detector", lambda settings: Seer())
    evaluate(monkeypatch, *files, "--json", figures, "--sheet", sheet)
    result = json.loads(figures.read_text())
    assert result["ap50"] == result["ap50_large"] == result["ap50_rel15"] == 1.0
    assert result["curve"]["precision"] == [1.0]
    assert (result["images"], result["hands"]) == (1, 1)
    assert cv2.imread(str(sheet)) is not None

from collections.abc import Sequence

import numpy as np
import pytest

from handcal.lab.evaluate.detector import ImageResult, PrecisionRecall, precision_recall, wilson

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


def test_without_detections_it_is_zero() -> None:
    assert curve(image([], [HAND])).average_precision == 0.0


def test_wilsons_interval_is_that_of_the_textbook() -> None:
    # Newcombe 1998, table I: 81 of 263 and 0 of 20.
    assert wilson(81, 263) == pytest.approx((0.2553, 0.3662), abs=2e-4)
    assert wilson(0, 20) == pytest.approx((0.0, 0.1611), abs=2e-4)
    assert wilson(20, 20) == pytest.approx((0.8389, 1.0), abs=2e-4)

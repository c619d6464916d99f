"""By depth alone, the hand's end of a limb is found, not its other end, or the hand is refused."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import numpy as np
import pytest

from handcal.core.errors import HandError
from handcal.core.types import HandCloud
from handcal.hand.segment import segment_hand
from handcal.hand.settings import SegmentSettings
from handcal.lab.evaluate.masked_frames import cropped, read_masked_frames, read_masked_names
from handcal.sim.hand import HandSettings

from .conftest import Shot, shoot

SETTINGS = SegmentSettings()
PHASES = tuple(product((0, 1), (0, 1)))
AT_M = (0.0, 0.0, 0.5)


def a_hand(size: float, curl_rad: float = 0.0, spread: float = 0.0) -> HandSettings:
    """Return a hand's shape, of a share of the usual size."""
    return HandSettings(
        length_m=0.187 * size, length_sigma_m=0.0, curl_more_rad=curl_rad, spread_more=spread
    )


def kept_and_beyond_m(shot: Shot, cloud: HandCloud, left: int, top: int) -> tuple[float, float]:
    """Return the share of the true hand in the mask, and how far it goes beyond the wrist."""
    on_hand = (shot.is_hand() & (shot.frame.depth > 0))[top:, left:]
    beyond_m = shot.beyond_wrist_m(cloud.points_m)
    return float((cloud.mask[on_hand] > 0).mean()), float(np.percentile(beyond_m, 99))


# Arms that end in view, as where a sleeve has no depth, behind bent fingers: before both ends were
# compared, the forearm was returned in some phases of the coarse grid, or in all.
@pytest.mark.parametrize(
    ("seed", "shape", "forearm_m", "roll_rad", "turn_rad"),
    [
        (3, a_hand(0.9, 1.3, -0.58), 0.219, -1.88, (0.29, 0.34, 0.09)),
        (3, a_hand(0.9, 1.3, -0.58), 0.219, -1.57, (0.29, 0.34, 0.09)),
        (15, a_hand(1.0, 1.3, 0.36), 0.129, -1.73, (-0.01, -0.27, -0.19)),
        (15, a_hand(1.0, 1.3, 0.36), 0.129, -1.57, (-0.01, -0.27, -0.19)),
        (11, a_hand(1.2, 1.3, 0.37), 0.136, -1.57, (-0.15, 0.33, 0.32)),
    ],
)
def test_a_forearm_is_not_a_hand(
    seed: int,
    shape: HandSettings,
    forearm_m: float,
    roll_rad: float,
    turn_rad: tuple[float, float, float],
) -> None:
    shot = shoot(
        seed, at_m=AT_M, turn_rad=turn_rad, roll_rad=roll_rad, forearm_m=forearm_m, shape=shape
    )
    for left, top in PHASES:
        try:
            cloud = segment_hand(cropped(shot.frame, left, top, 0, 0), SETTINGS)
        except HandError as error:
            assert "cannot be told from the arm" in str(error)  # noqa: PT017 - either is right
            continue
        kept, beyond_m = kept_and_beyond_m(shot, cloud, left, top)
        assert kept > 0.95
        assert beyond_m < 0.05


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("forearm_m", [0.12, 0.2])
def test_an_open_hand_whose_arm_ends_in_view_is_found(seed: int, forearm_m: float) -> None:
    shot = shoot(seed, at_m=AT_M, roll_rad=1.6, forearm_m=forearm_m, shape=a_hand(1.0))
    for left, top in PHASES:
        cloud = segment_hand(cropped(shot.frame, left, top, 0, 0), SETTINGS)
        kept, beyond_m = kept_and_beyond_m(shot, cloud, left, top)
        assert kept > 0.95
        assert beyond_m < 0.05


@pytest.mark.parametrize("roll_rad", [-2.95, -1.57, 1.57, 3.14])
def test_the_end_of_a_short_arm_is_no_part_of_the_hand(roll_rad: float) -> None:
    """With 8 cm of arm in view, its rounded end counted as narrower than the wrist."""
    shape, turn_rad = a_hand(1.1, 0.5, -0.05), (-0.13, -0.34, -0.24)
    shot = shoot(6, at_m=AT_M, turn_rad=turn_rad, roll_rad=roll_rad, forearm_m=0.054, shape=shape)
    for left, top in PHASES:
        try:
            cloud = segment_hand(cropped(shot.frame, left, top, 0, 0), SETTINGS)
        except HandError:
            continue
        assert kept_and_beyond_m(shot, cloud, left, top)[1] < 0.055


def test_a_real_hand_that_reaches_out_of_the_depth_gate_is_not_its_forearm(
    shared_data: Path,
) -> None:
    """In two of these frames the fingers are nearer than the gate."""
    folder = shared_data / "rgbd/sr300_320"
    for shot in read_masked_frames(folder, read_masked_names(folder)):
        mask = segment_hand(shot.frame, SETTINGS).mask > 0
        assert np.count_nonzero(mask & shot.is_hand) > 0.9 * np.count_nonzero(mask | shot.is_hand)


@pytest.mark.parametrize("seed", range(4))
def test_a_child_s_hand_is_segmented(seed: int) -> None:
    shot = shoot(seed, shape=a_hand(0.7))
    kept, beyond_m = kept_and_beyond_m(shot, segment_hand(shot.frame, SETTINGS), 0, 0)
    assert kept > 0.95
    assert beyond_m < 0.055


@pytest.mark.parametrize("seed", range(4))
def test_a_smaller_hand_is_refused_as_small_or_segmented_in_its_box(seed: int) -> None:
    shot = shoot(seed, shape=a_hand(0.55))
    with pytest.raises(HandError, match="smaller than a six-year-old's"):
        segment_hand(shot.frame, SETTINGS)
    rows, columns = np.nonzero(shot.is_hand())
    x0, y0, x1, y1 = map(int, (columns.min(), rows.min(), columns.max(), rows.max()))
    cloud = segment_hand(shot.frame, SETTINGS, (x0, y0, x1 + 1, y1 + 1))
    kept, beyond_m = kept_and_beyond_m(shot, cloud, 0, 0)
    assert kept > 0.95
    assert beyond_m < 0.05


def test_an_adult_s_hand_seen_from_its_edge_is_not_called_small() -> None:
    shot = shoot(0, turn_rad=(0.0, 1.6, 0.0))
    with pytest.raises(HandError, match="the hand is seen from its edge"):
        segment_hand(shot.frame, SETTINGS)

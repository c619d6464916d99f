"""The wrist of simulated hands that are tilted, seen from the edge, or badly framed."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from handcal.core.errors import HandError
from handcal.core.geometry import rotation_matrix, rotation_vector
from handcal.core.types import Float32
from handcal.hand.locate import find_wrist_m
from handcal.hand.segment import segment_hand
from handcal.hand.settings import SegmentSettings
from handcal.hand.view import Box

from .conftest import Shot, shoot

SETTINGS = SegmentSettings()


@cache
def turned(roll_rad: float, tilt_rad: float) -> Shot:
    """Return a hand turned about the forearm, then tilted: fingers toward the camera."""
    R = rotation_matrix(np.array([tilt_rad, 0.0, 0.0]))
    R @= rotation_matrix(np.array([0.0, roll_rad, 0.0]))
    x, y, z = rotation_vector(R).tolist()
    return shoot(3, at_m=(0.0, 0.01, 0.52), turn_rad=(x, y, z))


def box_of(shot: Shot) -> Box:
    rows, columns = np.nonzero(shot.is_hand())
    return int(columns.min()), int(rows.min()), int(columns.max()) + 1, int(rows.max()) + 1


def too_long_m(shot: Shot, box: Box, settings: SegmentSettings = SETTINGS) -> float:
    """Return by how much the hand's forearm is longer than it should be."""
    cloud = segment_hand(shot.frame, settings, box)
    beyond_m = shot.beyond_wrist_m(cloud.contour_m[cloud.contour_is_cut])
    return float(beyond_m.mean()) - settings.forearm_m


@pytest.mark.parametrize("tilt_rad", [-0.8, -0.4, 0.4, 0.8])
def test_a_tilted_hand_is_cut_where_an_upright_one_is(tilt_rad: float) -> None:
    upright, tilted = turned(0.0, 0.0), turned(0.0, tilt_rad)
    expected_m = too_long_m(upright, box_of(upright))
    assert abs(expected_m) < 0.01
    assert too_long_m(tilted, box_of(tilted)) == pytest.approx(expected_m, abs=0.013)


@pytest.mark.parametrize("roll_rad", [1.2, 1.6, 2.0])
def test_a_hand_seen_from_its_edge_is_cut_right_or_refused(roll_rad: float) -> None:
    shot = turned(roll_rad, 0.0)
    try:
        assert abs(too_long_m(shot, box_of(shot))) < 0.03
    except HandError as error:
        assert "its edge" in str(error)  # noqa: PT017 - either is right
    with pytest.raises(HandError, match=r"its edge|no hand-sized|turn its palm"):
        segment_hand(shot.frame, SETTINGS)


def test_an_arm_along_the_line_of_sight_is_refused() -> None:
    for tilt_rad in (-1.2, 1.2):
        shot = turned(0.0, tilt_rad)
        with pytest.raises(HandError, match="line of sight"):
            segment_hand(shot.frame, SETTINGS, box_of(shot))


def test_a_box_on_the_fingers_alone_gives_the_whole_hand() -> None:
    shot = turned(0.0, 0.0)
    x0, y0, x1, y1 = box_of(shot)
    # A finder searches the whole image if the hand reaches a side of its window.
    wide = replace(SETTINGS, roi_margin=2.0)
    assert abs(too_long_m(shot, (x0, y0, x1, (y0 + y1) // 2), wide)) < 0.025


def limb(width_m: Float32, pitch_m: float = 0.001) -> tuple[Float32, Float32]:
    """Return the points of a flat limb along x, and the area of each; widths per pitch."""
    along, across = np.meshgrid(np.arange(len(width_m)) - 60, np.arange(-60, 61), indexing="ij")
    inside = np.abs(across) * pitch_m < width_m[:, None] / 2.0
    points_m = np.stack([along, across, np.zeros_like(along)])[:, inside] * pitch_m
    return points_m.astype(np.float32), np.full(points_m.shape[1], pitch_m**2, np.float32)


def find(
    width_m: Float32, radius_m: float, exit_m: float = np.inf, end_m: float = np.inf
) -> tuple[float, float]:
    points_m, area_m2 = limb(width_m)
    palm_m, axis = np.array([[0, 0, 0.5], [1, 0, 0]], np.float32)
    ends = np.abs(points_m[0] - end_m) < 0.0015
    return find_wrist_m(points_m, area_m2, ends, palm_m, radius_m, axis, exit_m)


PLACE_M = np.arange(-0.06, 0.24, 0.001)


def test_the_wrist_is_the_narrow_place() -> None:
    width_m = (0.055 + 0.3 * np.abs(PLACE_M - 0.07)).clip(0, 0.085).astype(np.float32)
    wrist_m, sigma_m = find(width_m, 0.042)
    assert 0.06 < wrist_m < 0.075
    assert 0.0 < sigma_m < 0.02


def test_the_narrowest_place_is_just_behind_the_wrist() -> None:
    sharp_m = (0.045 + 1.2 * np.abs(PLACE_M - 0.07)).clip(0, 0.085).astype(np.float32)
    wrist_m, _ = find(sharp_m, 0.042)
    assert wrist_m == pytest.approx(0.066, abs=0.002)


def test_the_slanted_end_of_an_arm_that_leaves_the_view_is_not_its_wrist() -> None:
    width_m = 0.055 + 0.1 * np.abs(PLACE_M - 0.07)
    slanted_m = np.where(PLACE_M < 0.112, width_m - 1.2 * np.maximum(PLACE_M - 0.1, 0.0), 0.0)
    whole_m, _ = find(width_m.astype(np.float32), 0.042)
    cut_m, _ = find(slanted_m.astype(np.float32), 0.042, end_m=0.112)
    assert cut_m == pytest.approx(whole_m, abs=0.015)


@pytest.mark.parametrize("exit_m", [0.12, 0.14])
def test_seen_from_its_edge_the_wrist_is_up_to_four_centimetres_before_the_box_ends(
    exit_m: float,
) -> None:
    wrist_m, _ = find(np.full(len(PLACE_M), 0.045, np.float32), 0.02, exit_m)
    assert 0.03 < exit_m - wrist_m < 0.045


def test_a_limb_as_wide_everywhere_leaves_the_wrist_uncertain() -> None:
    width_m = np.full(len(PLACE_M), 0.045, np.float32)
    _, front_m = find(width_m, 0.042)
    _, edge_m = find(width_m, 0.02)
    _, in_box_m = find(width_m, 0.02, exit_m=0.08)
    assert edge_m > 1.5 * front_m
    assert in_box_m < 0.9 * edge_m


def test_a_place_wider_than_one_far_behind_is_not_the_wrist() -> None:
    narrow_m = (0.05 + 0.5 * np.abs(PLACE_M - 0.11)).clip(0, 0.08).astype(np.float32)
    wrist_m, _ = find(narrow_m, 0.042)
    assert wrist_m > 0.085


def test_a_gap_behind_the_fingers_of_a_fist_is_not_the_wrist() -> None:
    places_m, widths_m = [-0.06, 0.0, 0.02, 0.03, 0.05, 0.07, 0.09, 0.24], [9, 9, 4, 4, 11, 9, 6, 7]
    width_m = (0.01 * np.interp(PLACE_M, places_m, widths_m)).astype(np.float32)
    wrist_m, _ = find(width_m, 0.038)
    assert 0.07 < wrist_m < 0.1


def test_without_an_arm_there_is_no_wrist() -> None:
    ends = np.where(PLACE_M < 0.05, 0.08, 0.0).astype(np.float32)
    assert find(ends, 0.042) == (np.inf, 0.0)
    thin = np.where(PLACE_M < 0.05, 0.08, 0.02).astype(np.float32)
    assert find(thin, 0.042) == (np.inf, np.inf)

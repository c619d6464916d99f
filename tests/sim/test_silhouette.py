"""The silhouette of the own hand beside a drawn outline, against known truth."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from handcal.core.display import eye_projection, view_of_eye
from handcal.core.geometry import image_points, invert, rigid, transform
from handcal.core.types import EYES, Eye, Float64
from handcal.rig.example import example_rig
from handcal.sim.hand import HandModel, make_hand
from handcal.sim.raster import draw_hand
from handcal.sim.silhouette import (
    OutlineView,
    find_gaps,
    overlay_outline,
    silhouette,
    view_outline,
)
from handcal.sim.verifying import SeenDifference, see_difference
from tests.sim.rims import FINE, rim_outline

RIG = example_rig()
T_W_H = rigid([0.1, -0.2, 0.05], [0.3, -0.1, 0.2])
TRUE_M = np.array([0.003, -0.002, 0.004])
T_E_HAND = rigid([0.0, 0.1, 0.1], [0.01, 0.02, 0.5])
BESIDE_M = np.array([0.13, 0.0, 0.0])
"""With it, a third of the hand is beside the display."""


@pytest.fixture(scope="module")
def hand() -> HandModel:
    return make_hand(1)


@pytest.fixture(scope="module")
def rim_m(hand: HandModel) -> Float64:
    """The rim that the true eye sees, in axes of E, from the true eye."""
    return rim_outline(hand, rigid(None, -TRUE_M) @ T_E_HAND)


def pose_W(eye: Eye, T_E_hand: Float64 = T_E_HAND) -> Float64:
    return np.asarray(invert(view_of_eye(RIG.eyes[eye], T_W_H)) @ T_E_hand)


def drawn_with(eye: Eye, shift_m: Float64) -> Float64:
    """Return the pixels from points in H that are drawn with φ."""
    display = RIG.eyes[eye]
    return np.asarray(eye_projection(display, shift_m) @ view_of_eye(display, np.eye(4)))


def to_W(eye: Eye, rim_m: Float64) -> Float64:
    return transform(invert(view_of_eye(RIG.eyes[eye], T_W_H)), rim_m + TRUE_M)


def altered(
    rim_m: Float64, right_arcmin: float = 0.0, down_arcmin: float = 0.0, size: float = 0.0
) -> Float64:
    """Return a rim that the eye sees moved, or grown about its middle, at the same depth."""
    rays = rim_m[:, :2] / rim_m[:, 2:]
    middle = rays.mean(axis=0)
    moved = np.tan(np.radians(np.array([right_arcmin, down_arcmin]) / 60.0))
    rays = middle + (1.0 + size) * (rays - middle) + moved
    moved_m: Float64 = rim_m[:, 2:] * np.column_stack([rays, np.ones(len(rays))])
    return moved_m


def seen(
    hand: HandModel, rim_m: Float64, eye: Eye = "left", T_E_hand: Float64 = T_E_HAND
) -> SeenDifference | None:
    """Return what the true eye sees if an outline is drawn with the true φ."""
    drawn, outline_W_m = drawn_with(eye, TRUE_M), to_W(eye, rim_m)
    return see_difference(
        RIG.eyes[eye], TRUE_M, drawn, T_W_H, hand, pose_W(eye, T_E_hand), outline_W_m
    )


def view(rim_m: Float64, eye: Eye = "left") -> OutlineView:
    drawn = drawn_with(eye, TRUE_M)
    return view_outline(RIG.eyes[eye], TRUE_M, T_W_H, drawn, to_W(eye, rim_m))


@pytest.mark.parametrize("eye", EYES)
def test_an_exact_outline_leaves_no_gap_and_asks_for_nothing(
    hand: HandModel, rim_m: Float64, eye: Eye
) -> None:
    gaps = find_gaps(hand, pose_W(eye), view(rim_m, eye))
    assert gaps is not None
    assert abs(np.median(gaps.gap_px)) < 0.15
    assert np.sqrt(np.mean(gaps.gap_px**2)) < 0.6
    # Nearly every part of the line finds its part of the rim.
    assert len(gaps.gap_px) > 0.85 * np.isfinite(view(rim_m, eye).drawn_px[:, 0]).sum()
    found = seen(hand, rim_m, eye)
    assert found is not None
    assert max(abs(found.right_arcmin), abs(found.down_arcmin)) < 0.4
    assert abs(found.size) < 1e-3


@pytest.mark.parametrize(
    "change",
    [(4.0, 0.0, 0.0), (-4.0, 0.0, 0.0), (0.0, 4.0, 0.0), (-12.0, 9.0, 0.0), (0.0, 0.0, 0.01)],
)
def test_a_moved_or_grown_outline_is_found_as_such(
    hand: HandModel, rim_m: Float64, change: tuple[float, float, float]
) -> None:
    """The movement back would make it fit."""
    found = seen(hand, altered(rim_m, *change))
    assert found is not None
    assert found.right_arcmin == pytest.approx(-change[0], abs=0.6)
    # The middle of the line is not that of what is compared, so that growth moves a little.
    assert found.down_arcmin == pytest.approx(-change[1], abs=1.5 if change[2] else 0.6)
    assert found.size == pytest.approx(-change[2], abs=1e-3)


@pytest.mark.parametrize("away_m", [(0.006, -0.004, 0.012), (-0.006, 0.004, -0.03)])
@pytest.mark.parametrize("eyes", [("left",), EYES])
def test_a_displaced_hand_is_brought_back(
    hand: HandModel, rim_m: Float64, away_m: tuple[float, float, float], eyes: tuple[Eye, ...]
) -> None:
    T_W_hand = pose_W("left")
    R_W_E = invert(view_of_eye(RIG.eyes["left"], T_W_H))[:3, :3]
    views = [view(rim_m)]
    if eyes == EYES:
        T_right_hand = view_of_eye(RIG.eyes["right"], T_W_H) @ T_W_hand
        of_right_m = rim_outline(hand, rigid(None, -TRUE_M) @ T_right_hand)
        views.append(view(of_right_m, "right"))
    placed = overlay_outline(hand, rigid(translation_m=R_W_E @ away_m) @ T_W_hand, views)
    assert placed is not None
    error_m = R_W_E.T @ (placed[0] - T_W_hand)[:3, 3]
    assert np.abs(error_m[:2]).max() < 1e-4
    assert abs(error_m[2]) < 1e-3
    np.testing.assert_array_equal(placed[0][:3, :3], T_W_hand[:3, :3])
    assert placed[1] < 1.0


def test_a_hand_that_someone_sees_only_in_part_is_compared_in_that_part(
    hand: HandModel, rim_m: Float64
) -> None:
    """A thumb of another shape moves only those who look at it."""
    fingers = hand.wrist_m + 0.09 * -hand.arm_axis
    wrong_m = np.where(
        ((transform(invert(T_E_HAND), rim_m + TRUE_M) - fingers) @ hand.arm_axis > 0.0)[:, None],
        altered(rim_m, 6.0),
        rim_m,
    )

    def right_arcmin(fingers_only: bool) -> float:
        found = see_difference(
            RIG.eyes["left"],
            TRUE_M,
            drawn_with("left", TRUE_M),
            T_W_H,
            hand,
            pose_W("left"),
            to_W("left", wrong_m),
            (lambda points_m: (points_m - fingers) @ hand.arm_axis < 0.0) if fingers_only else None,
        )
        assert found is not None
        return found.right_arcmin

    assert abs(right_arcmin(True)) < 0.6
    assert right_arcmin(False) < -1.5


def test_points_outside_the_display_are_not_seen(hand: HandModel) -> None:
    T_E_hand = rigid(None, BESIDE_M) @ T_E_HAND
    rim_m = rim_outline(hand, rigid(None, -TRUE_M) @ T_E_hand)
    partly = view(rim_m)
    is_shown = np.isfinite(partly.drawn_px[:, 0])
    assert 0.3 < is_shown.mean() < 0.9
    display = RIG.eyes["left"]
    assert (partly.drawn_px[is_shown] <= [display.width_px - 0.5, display.height_px - 0.5]).all()
    # A wearer compares what is there.
    found = seen(hand, altered(rim_m, 4.0), "left", T_E_hand)
    assert found is not None
    assert found.right_arcmin == pytest.approx(-4.0, abs=0.6)
    # Of what is on no display, nothing is seen.
    gone_m = rim_m + np.array([2.0, 0.0, 0.0])
    assert not np.isfinite(view(gone_m).drawn_px).any()
    assert find_gaps(hand, pose_W("left", T_E_hand), view(gone_m)) is None
    assert overlay_outline(hand, pose_W("left", T_E_hand), [view(gone_m)]) is None
    assert seen(hand, gone_m, "left", T_E_hand) is None
    # Another eye that sees it is enough.
    both = [view(gone_m), view(rim_outline(hand, rigid(None, -TRUE_M) @ T_E_HAND), "right")]
    assert overlay_outline(hand, pose_W("right"), both) is not None


def test_an_inner_rim_of_the_hand_is_no_silhouette(hand: HandModel) -> None:
    """As that of a thumb before the palm, which no one takes for the rim of the hand."""
    T_eye_hand = rigid([0.0, np.radians(55.0), 0.0], [0.0, 0.05, 0.5])
    image = draw_hand(hand, T_eye_hand, FINE)
    is_hand = np.pad(np.isfinite(image.depth_m), 1).astype(np.uint8)
    inside_px = cv2.distanceTransform(is_hand, cv2.DIST_L2, 5)

    def inside_mm(points_m: Float64) -> Float64:
        """Return how far points are inside the image of the hand."""
        px = image_points(transform(T_eye_hand, points_m), FINE) - [image.x0 - 1, image.y0 - 1]
        column, row = np.rint(px).astype(int).T
        column = np.clip(column, 0, is_hand.shape[1] - 1)
        row = np.clip(row, 0, is_hand.shape[0] - 1)
        return np.asarray(500.0 / FINE.fx * inside_px[row, column], np.float64)

    eye_m = invert(T_eye_hand)[:3, 3]
    rim = silhouette(hand, eye_m)
    assert inside_mm(rim.points_m).max() < 2.5
    assert np.median(inside_mm(rim.points_m)) < 0.3
    # There are inner rims: surfaces that turn away from the eye and have the hand all around.
    to_eye = eye_m - hand.vertices_m
    to_eye = to_eye / np.linalg.norm(to_eye, axis=1)[:, None]
    turning = np.abs(np.einsum("ij,ij->i", hand.normals, to_eye)) < 0.1
    near = (hand.vertices_m - hand.wrist_m) @ hand.arm_axis < 0.02
    inner_m = hand.vertices_m[turning & near].astype(np.float64)
    assert np.count_nonzero(inside_mm(inner_m) > 5.0) > 30
    # The normals point away from the hand, across the line of sight.
    np.testing.assert_allclose(np.linalg.norm(rim.normals, axis=1), 1.0, atol=1e-6)
    sight = eye_m - rim.points_m
    sight /= np.linalg.norm(sight, axis=1)[:, None]
    assert np.abs(np.einsum("ij,ij->i", rim.normals, sight)).max() < 0.1

import re
from dataclasses import replace

import numpy as np
import pytest

from handcal.core.display import eye_projection, view_of_eye
from handcal.core.geometry import invert, rigid
from handcal.core.types import EYES, Eye, Float64, Rig
from handcal.rig.acceptance import (
    CameraMove,
    EyeAcceptance,
    accept_eye,
    camera_move,
    likely_cause,
    problem,
)
from handcal.rig.boards.views import ViewsError
from handcal.rig.displays.homography import DisplayHomography
from handcal.rig.example import example_rig
from handcal.rig.lens.viewpoint import TrackedView
from handcal.sim.boards import board_poses, board_view
from handcal.sim.photographs import BOARD, DEPTH_CAMERA, VIEWPOINT_CAMERA

RIG = example_rig()
PHI_M = np.array([0.002, -0.001, 0.003])


def accepted(
    true: Rig, believed: Rig, eye: Eye, noise_px: float = 0.0, shift_m: Float64 = PHI_M
) -> EyeAcceptance:
    """Return what is found with images of the true rig, and the file of the believed one."""
    rng = np.random.default_rng(1)
    display = true.eyes[eye]
    T_E_C = rigid([0.01, -0.02, 0.015], shift_m)
    camera = replace(VIEWPOINT_CAMERA, distortion=())
    K_C = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1.0]])
    shown = eye_projection(display, shift_m)[:, :3] @ T_E_C[:3, :3]
    homography = DisplayHomography(K_C @ np.linalg.inv(shown), {}, 0.0, 0.0)
    T_D_C = invert(view_of_eye(display, np.eye(4)) @ true.T_H_D) @ T_E_C
    poses = board_poses(BOARD, camera, 12, rng, others=((T_D_C, DEPTH_CAMERA),))
    pairs = {
        str(number): (
            board_view(BOARD, T, camera, rng, noise_px),
            board_view(BOARD, T_D_C @ T, DEPTH_CAMERA, rng, noise_px),
        )
        for number, T in enumerate(poses)
    }
    return accept_eye(believed, believed.eyes[eye], homography, camera, pairs, DEPTH_CAMERA)


def turned(rig: Rig, turn_rad: list[float], shift_m: list[float] | None = None) -> Rig:
    return replace(rig, T_H_D=rig.T_H_D @ rigid(turn_rad, shift_m))


def test_a_right_rig_passes_and_the_cameras_place_is_found() -> None:
    for eye in EYES:
        exact = accepted(RIG, RIG, eye)
        assert exact.worst_arcmin < 0.01
        np.testing.assert_allclose(exact.shift_m, PHI_M, atol=1e-5)
        noisy = accepted(RIG, RIG, eye, noise_px=0.05)
        assert noisy.worst_arcmin < 3.0
        assert problem(noisy) == ""


def test_a_turned_depth_camera_fails_and_is_named() -> None:
    was = turned(RIG, [0.0, np.radians(0.5), 0.0])
    found = {eye: accepted(RIG, was, eye, noise_px=0.05) for eye in EYES}
    assert all("more than 5′" in problem(one) for one in found.values())
    cause = likely_cause(found, EYES)
    assert "a depth camera turned by 0." in cause.words
    assert cause.again == ("T_H_D",)
    assert all(
        np.linalg.norm(one.turn_rad) == pytest.approx(np.radians(0.5), rel=0.2)
        for one in found.values()
    )


def test_a_depth_camera_that_has_only_shifted_passes() -> None:
    found = accepted(RIG, turned(RIG, [0.0, 0.0, 0.0], [0.002, 0.0, 0.0]), "left")
    assert problem(found) == ""
    assert np.linalg.norm(found.shift_m - PHI_M) == pytest.approx(0.002, rel=0.05)


def test_a_shift_of_the_depth_camera_is_found_by_tracked_boards() -> None:
    rng = np.random.default_rng(5)
    views = {
        str(number): TrackedView(
            board_view(BOARD, T_D_B, DEPTH_CAMERA, rng, 0.1),
            RIG.T_H_D @ T_D_B @ rigid(None, rng.normal(0.0, 0.0003, 3)),
        )
        for number, T_D_B in enumerate(board_poses(BOARD, DEPTH_CAMERA, 16, rng))
    }
    assert camera_move(RIG, views, DEPTH_CAMERA).problem == ""
    shift_m = np.array([0.002, 0.0, -0.001])
    T_H_D = rigid(None, -shift_m) @ RIG.T_H_D
    found = camera_move(replace(RIG, T_H_D=T_H_D), views, DEPTH_CAMERA)
    np.testing.assert_allclose(found.shift_m, shift_m, atol=0.0006)
    assert "the depth camera is shifted by" in likely_cause({}, (), found).words


def test_a_shift_is_said_with_its_directions() -> None:
    move = CameraMove(np.array([-0.01, 0.0, 0.002]), np.zeros(3), 0.0001, 0.0001)
    words = "shifted by 10.0 mm to the left, 2.0 mm forwards (± 0.1 mm)"
    assert move.words.startswith(words)
    assert f"the depth camera is {words}" in move.problem
    move = CameraMove(np.array([0.001, -0.003, -0.002]), np.zeros(3), 0.0001, 0.0001)
    assert "1.0 mm to the right, 3.0 mm upwards, 2.0 mm backwards" in move.words
    move = CameraMove(np.zeros(3), np.zeros(3), 0.0001, 0.0001)
    assert move.words.startswith("shifted by 0.0 mm (± 0.1 mm)")


def test_without_tracked_boards_a_small_rotation_may_be_a_shift() -> None:
    was = turned(RIG, [0.0, 0.0, 0.0], [0.005, 0.0, 0.0])
    shifted = {eye: accepted(RIG, was, eye) for eye in EYES}
    assert all(problem(one) for one in shifted.values())
    assert "or shifted by 5 mm" in likely_cause(shifted, EYES).words


def test_a_changed_display_is_not_taken_for_the_depth_camera() -> None:
    left = RIG.eyes["left"]
    H = np.array([[1.0, 0.0, 15.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    changed = replace(left, K=H @ left.K)
    was = replace(RIG, eyes={**RIG.eyes, "left": changed})
    found = {eye: accepted(RIG, was, eye, noise_px=0.05) for eye in EYES}
    assert problem(found["left"])
    alone = likely_cause({"left": found["left"]}, ["left"])
    assert "images of the other eye's display would show which" in alone.words
    assert alone.again == ()
    cause = likely_cause(found, ["left"])
    assert re.search(r"^left: .* rotation by 0\.\d+°; right passes .*left display", cause.words)
    assert cause.again == ("left",)


def test_two_eyes_that_fail_differently_are_told_apart() -> None:
    H = np.array([[1.0, 0.0, 15.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    shifts = {"left": H, "right": np.linalg.inv(H)}
    eyes = {eye: replace(RIG.eyes[eye], K=shifts[eye] @ RIG.eyes[eye].K) for eye in EYES}
    was = replace(RIG, eyes=eyes)
    cause = likely_cause({eye: accepted(RIG, was, eye) for eye in EYES}, EYES)
    assert re.search(
        r"^left: .* by 0\.\d+°; right: .* by 0\.\d+°; one depth camera cannot", cause.words
    )
    assert cause.again == EYES


def test_a_camera_far_from_the_eye_and_too_few_views_are_refused() -> None:
    far_m = np.array([0.02, 0.0, 0.0])
    assert "20 mm from the eye's place" in problem(accepted(RIG, RIG, "left", shift_m=far_m))
    display = RIG.eyes["left"]
    with pytest.raises(ViewsError, match="take at least 5"):
        accept_eye(
            RIG,
            display,
            DisplayHomography(np.eye(3), {}, 0.0, 0.0),
            VIEWPOINT_CAMERA,
            {},
            DEPTH_CAMERA,
        )

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handcal.core.geometry import rigid
from handcal.core.types import CameraIdentity, DepthCheck, Intrinsics
from handcal.rig.boards.views import ViewsError, WorstView
from handcal.rig.displays.homography import DisplayCalibration, DisplayHomography
from handcal.rig.example import example_rig
from handcal.rig.lens.fit import CalibrationVerdict
from handcal.rig.lens.stereo import StereoCalibration
from handcal.rig.rig_file import read_rig, write_rig
from handcal.rig.steps import with_display, with_stereo

RIG = example_rig()
MADE = "2026-11-21T16:00:00+00:00"
GOOD = CalibrationVerdict("good", "as it should be")
COLOR = Intrinsics(1280, 720, 925.0, 925.0, 642.0, 362.0, (0.1, -0.2, 0.0, 0.0, 0.05))
STEREO = StereoCalibration(
    T_H_D=rigid([0.1, 0.2, 0.3], [0.01, 0.02, 0.03]),
    covariance=np.diag([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]) * 1e-8,
    depth=COLOR,
    headset=COLOR,
    rms_px=0.31,
    residuals_px={"a": 0.3, "b": 0.32},
    spread_rad=0.001,
    spread_m=0.001,
    dropped=(),
    worst=WorstView("b", 0.32, "nothing"),
    verdict=GOOD,
)


def display_calibration() -> DisplayCalibration:
    return DisplayCalibration(
        display=replace(RIG.eyes["left"], z_C0_S_m=1.5),
        homography=DisplayHomography(np.eye(3), {"a": 0.1, "b": 0.2, "c": 0.1}, 0.15, 0.02),
        R_S_C=np.eye(3),
        turn_rad=0.001,
        covariance=np.diag([1.0, 2.0, 3.0, 4.0]) * 1e-6,
        verdict=CalibrationVerdict("needs more views", "too few"),
    )


def test_a_display_replaces_only_its_own_eye_and_tells_how(tmp_path: Path) -> None:
    rig = with_display(RIG, "left", display_calibration(), MADE)
    assert rig.eyes["left"].z_C0_S_m == 1.5
    assert rig.eyes["right"] is RIG.eyes["right"]
    assert set(RIG.origins) == set()
    write_rig(tmp_path / "rig.yaml", rig)
    origin = read_rig(tmp_path / "rig.yaml").origins["left"]
    assert (origin.made, origin.views, origin.rms_px) == (MADE, 3, 0.15)
    assert (origin.verdict, origin.reason) == ("needs more views", "too few")
    assert origin.parameters[-1] == "z_C0_S_m"
    np.testing.assert_array_equal(np.diag(origin.covariance), np.array([1, 2, 3, 4]) * 1e-6)


def test_parts_are_calibrated_one_after_the_other() -> None:
    rig = with_stereo(with_display(RIG, "left", display_calibration(), MADE), STEREO, MADE)
    assert set(rig.origins) == {"left", "T_H_D"}
    np.testing.assert_array_equal(rig.T_H_D, STEREO.T_H_D)
    assert rig.depth_intrinsics == COLOR


def test_depth_that_is_not_aligned_to_colour_has_its_own_place() -> None:
    T_C_D = rigid(None, [0.015, 0.0, 0.0])
    depth = RIG.depth_intrinsics
    rig = with_stereo(RIG, STEREO, MADE, depth_intrinsics=depth, T_C_D=T_C_D)
    np.testing.assert_allclose(rig.T_H_D, STEREO.T_H_D @ T_C_D)
    assert rig.depth_intrinsics == depth


def test_the_rig_s_camera_is_the_one_that_took_the_images() -> None:
    d415 = CameraIdentity("Intel RealSense D415", "123")
    check = DepthCheck(
        *("today", 9, 1.0, 0.0, np.eye(2), np.ones((1, 2)), np.zeros(1), np.zeros(1))
    )
    checked = replace(with_stereo(RIG, STEREO, depth_camera=d415), depth_check=check)
    assert checked.depth_camera == d415
    again = with_stereo(checked, STEREO)
    assert (again.depth_camera, again.depth_check) == (CameraIdentity(), None)
    assert with_display(checked, "left", display_calibration()).depth_check is check


def test_a_pose_that_is_not_determined_makes_no_rig() -> None:
    with pytest.raises(ViewsError, match="add others"):
        with_stereo(RIG, replace(STEREO, covariance=None), MADE)


def test_a_long_reason_is_shortened_to_what_the_file_takes(tmp_path: Path) -> None:
    wordy = replace(STEREO, verdict=CalibrationVerdict("bad", "why " * 500))
    write_rig(tmp_path / "rig.yaml", with_stereo(RIG, wordy, MADE))
    assert read_rig(tmp_path / "rig.yaml").origins["T_H_D"].reason.endswith("…")

"""A camera of the headset itself, whose frames tell its pose."""

from __future__ import annotations

import numpy as np

from handcal.calibration.states import State
from handcal.core.display import view_of_eye
from handcal.core.geometry import rigid
from handcal.core.types import EYES
from tests.calibration.stage import RIG, T_D_HAND, T_D_NEAR, T_W_H, Stage
from tests.helpers import eventually

T_W_D = T_W_H @ RIG.T_H_D
NEARLY = rigid(translation_m=[0.008, 0.0, 0.0]) @ T_W_H
ELSEWHERE = rigid(translation_m=[0.1, 0.0, 0.0]) @ T_W_H


def test_an_alignment_is_placed_by_the_frames_own_poses(stage: Stage) -> None:
    for _ in range(7):
        stage.see(T_D_HAND, NEARLY, told=T_W_D)
    eventually(lambda: stage.calibration.is_applied)
    stage.calibration.make_cursor()
    eventually(lambda: stage.shown().cursor_id > 0 and stage.shown().prompt)
    stage.see(T_D_NEAR, NEARLY, told=T_W_D)
    stage.press()
    stage.see(T_D_NEAR, NEARLY, told=T_W_D)
    assert stage.state() is State.ALIGNED
    (alignment,) = stage.calibration.alignments.values()
    for eye in EYES:
        np.testing.assert_allclose(
            alignment.T_E_W[eye], view_of_eye(RIG.eyes[eye], T_W_H), atol=1e-9
        )
    assert alignment.time_sigma_m < 1e-3


def test_a_frame_that_tells_its_pose_needs_none_from_the_app(stage: Stage) -> None:
    hand = stage.see(pose=False, told=T_W_D).hand
    assert hand is not None
    np.testing.assert_array_equal(hand.T_W_D, T_W_D)


def test_other_worlds_forbid_frames_until_they_agree(stage: Stage) -> None:
    seen = [stage.see(T_D_HAND, ELSEWHERE, told=T_W_D) for _ in range(20)]
    assert [one.contradiction is None for one in seen] == 19 * [True] + [False]
    assert seen[-1].contradiction is not None
    assert seen[-1].contradiction.name == "other-world"
    assert "100 mm and 0° from where" in seen[-1].contradiction.text
    assert seen[-1].hand is None
    assert stage.see(T_D_HAND, T_W_H, told=T_W_D).hand is not None

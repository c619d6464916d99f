"""Evidence against a calibration, from frames alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from handcal.calibration.evidence import FROZEN_FRAMES, Contradiction, Evidence
from handcal.core.types import CameraIdentity, DepthCheck, Frame
from handcal.rig.example import example_rig
from handcal.session.facts import CameraUsed

RIG = example_rig()
IDENTITY = CameraIdentity("Intel RealSense D415", "1234")


def frame(index: int, focal_scale: float = 1.0) -> Frame:
    camera = replace(
        RIG.depth_intrinsics,
        fx=focal_scale * RIG.depth_intrinsics.fx,
        fy=focal_scale * RIG.depth_intrinsics.fy,
    )
    depth = np.full((camera.height, camera.width), 500 + index, np.uint16)
    return Frame(index, index, index, depth, 0.001, camera)


def test_a_live_camera_of_the_rig_is_no_evidence() -> None:
    evidence = Evidence(RIG)
    assert all(evidence.see(frame(index), IDENTITY) is None for index in range(20))
    assert evidence.contradictions == ()


def test_a_picture_that_does_not_change_forbids_frames_until_it_does() -> None:
    evidence = Evidence(RIG)
    found = [evidence.see(replace(frame(0), index=n), IDENTITY) for n in range(FROZEN_FRAMES + 3)]
    assert [one is not None for one in found] == [False] * FROZEN_FRAMES + [True] * 3
    assert found[-1] is not None
    assert found[-1].name == "frozen-camera"
    assert evidence.see(frame(1), IDENTITY) is None
    assert evidence.contradictions == ()


@pytest.mark.parametrize(
    ("focal_scale", "serial", "said"),
    [
        (1.04, "1234", "focal length 4.0 % longer"),
        (1.0, "77", "another serial number: 77, not 1234"),
    ],
)
def test_another_camera_contradicts_for_good(focal_scale: float, serial: str, said: str) -> None:
    evidence = Evidence(replace(RIG, depth_camera=IDENTITY))
    evidence.see(frame(0, focal_scale), replace(IDENTITY, serial_number=serial))
    evidence.see(frame(1), IDENTITY)
    (contradiction,) = evidence.contradictions
    assert contradiction.name == "other-camera"
    assert said in contradiction.text


def test_another_camera_is_forgotten_if_it_is_replaced_before_any_alignment() -> None:
    evidence = Evidence(replace(RIG, depth_camera=IDENTITY))
    for serial, count in (("77", 1), ("1234", 0), ("77", 1)):
        evidence.see(frame(0), replace(IDENTITY, serial_number=serial), is_used=False)
        assert len(evidence.contradictions) == count
    evidence.see(frame(1), IDENTITY, is_used=True)
    assert evidence.contradictions


def test_a_biased_depth_camera_contradicts_once_the_rig_says_so() -> None:
    check = DepthCheck(
        scale=1.0,
        offset_m=0.02,
        covariance=np.diag([1e-8, 1e-8]),
        ranges_m=np.array([[0.4, 0.6]]),
        flatness_m=np.array([0.001]),
        flatness_sigma_m=np.array([0.0001]),
        views=10,
        made="2026-11-23T02:00:00+00:00",
    )
    (contradiction,) = Evidence(replace(RIG, depth_check=check)).contradictions
    assert contradiction.name == "depth-bias"
    assert "20" in contradiction.text
    good = replace(check, offset_m=0.0)
    assert Evidence(replace(RIG, depth_check=good)).contradictions == ()


def _names(evidence: Evidence) -> list[str]:
    return [one.name for one in evidence.contradictions]


def test_a_headset_may_draw_otherwise_once() -> None:
    evidence = Evidence(RIG)
    evidence.drawn_otherwise("other projections")
    evidence.drawn_as_sent()
    evidence.drawn_otherwise("other projections")
    assert _names(evidence) == []
    evidence.drawn_otherwise("other projections")
    assert _names(evidence) == ["stale-headset"]
    evidence.drawn_as_sent()
    assert _names(evidence) == []


def test_evidence_found_before_an_interruption_counts() -> None:
    earlier = Contradiction("other-camera", "the camera is not the rig's")
    assert _names(Evidence(RIG, [earlier])) == ["other-camera"]


def test_a_late_camera_forbids_frames_while_it_is_known_to_be_late() -> None:
    evidence = Evidence(RIG)
    assert evidence.see_delay(None, 0.12) is None
    assert evidence.see_delay(0.12, 0.12) is None
    found = evidence.see_delay(0.16, 0.12)
    assert found is not None
    assert found.name == "late-camera"
    assert "160 ms" in found.text
    assert evidence.contradictions == ()


@pytest.mark.parametrize("others", [{"serial_number": "77"}, {"model": "Recording of a room"}])
def test_a_resumed_session_uses_no_frame_of_another_camera(others: dict[str, str]) -> None:
    used = CameraUsed(IDENTITY, frame(0).depth_intrinsics, 0.001)
    evidence = Evidence(RIG, used=used)
    found = evidence.see(frame(0), replace(IDENTITY, **others))
    assert found is not None
    assert found.name == "session-camera"
    assert evidence.see(frame(1), IDENTITY) is None
    assert evidence.contradictions == ()  # the result is still that of its own camera

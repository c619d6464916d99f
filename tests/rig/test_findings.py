from dataclasses import replace

import numpy as np

from handcal.core.geometry import rigid
from handcal.core.types import (
    EYES,
    CameraIdentity,
    DepthCheck,
    DepthEdges,
    DisplayCheck,
    Eye,
    HeadsetIdentity,
    Origin,
    Rig,
)
from handcal.rig.example import example_rig
from handcal.rig.findings import RigFinding, display_finding, report_rig

RIG = example_rig()


def doubtful(rig: Rig) -> dict[str, str]:
    return {one.what: one.found for one in report_rig(rig) if not one.is_fine}


def test_the_example_is_in_order() -> None:
    assert doubtful(RIG) == {}
    told = {one.what: one.found for one in report_rig(RIG)}
    assert told["Distance of the viewpoints"] == "63 mm"
    assert told["left: display"] == "1268×720 px, 1.40′ per pixel, 29° across"


def test_exchanged_eyes_are_told() -> None:
    exchanged = replace(RIG, eyes={"left": RIG.eyes["right"], "right": RIG.eyes["left"]})
    assert doubtful(exchanged) == {"Viewpoints": "left and right are exchanged"}


def test_a_depth_camera_that_looks_away_is_reported() -> None:
    turned = replace(RIG, T_H_D=RIG.T_H_D @ rigid([np.radians(30.0), 0.0, 0.0]))
    assert set(doubtful(turned)) == {
        f"{eye}: seen by the depth camera at 0.4 to 0.6 m" for eye in ("left", "right")
    }


def test_screens_at_different_distances_are_doubtful() -> None:
    left = replace(RIG.eyes["left"], z_C0_S_m=0.5)
    found = doubtful(replace(RIG, eyes={**RIG.eyes, "left": left}))
    assert found == {"Difference of the virtual screens' distances": "1.5 dioptres"}


def test_a_part_that_was_not_good_is_reported_with_its_reason() -> None:
    origin = Origin("grid", "today", 3, 0.2, "bad", "the camera moved", ("x_m",), np.eye(1))
    found = doubtful(replace(RIG, origins={"left": origin}))
    assert found == {"Calibration of the left display": "bad: the camera moved (grid, today)"}


def depth_check(offset_m: float, sigma_m: float = 0.0005) -> DepthCheck:
    covariance = np.diag([0.0, sigma_m**2])
    ranges_m, flatness_m = np.array([[0.3, 0.8]]), np.array([0.002])
    return DepthCheck(
        *("today", 9, 1.0, offset_m, covariance, ranges_m, flatness_m, flatness_m / 10)
    )


def test_the_devices_and_a_small_bias_of_depth_are_told() -> None:
    rig = replace(
        RIG,
        depth_camera=CameraIdentity("Intel RealSense D415", "123"),
        headset=HeadsetIdentity("0a1b", runtime="OpenXR"),
        depth_check=depth_check(-0.003),
    )
    told = {one.what: one.found for one in report_rig(rig)}
    assert told["Depth camera"] == "Intel RealSense D415, serial number 123"
    assert told["Headset"] == "0a1b, OpenXR"
    assert told["Depth check"].startswith("−3.0 ± 0.5 mm at 0.4 m; flat to 2.0 mm (9 views, today)")
    assert doubtful(rig) == {}


def test_a_depth_that_may_be_biased_is_in_doubt() -> None:
    for check in (depth_check(0.01), depth_check(-0.01), depth_check(0.003, sigma_m=0.002)):
        assert set(doubtful(replace(RIG, depth_check=check))) == {"Depth check"}


def test_edges_that_were_never_measured_are_told_with_what_is_assumed() -> None:
    d415 = replace(RIG, depth_camera=CameraIdentity("Intel RealSense D415", "123"))
    told = {one.what: one for one in report_rig(d415)}["Depth edges outside the true ones"]
    assert not told.is_known
    assert told.found == "not measured, +1.8 ± 0.7 px assumed"
    assert told.command == "handcal rig depth"
    edges = DepthEdges(1.2, 0.3, "measured", 9, "today")
    told = {one.what: one for one in report_rig(replace(d415, depth_edges=edges))}[told.what]
    assert told.is_known
    assert told.found == "+1.2 ± 0.3 px (9 views, today)"


def test_a_display_check_of_one_eye_does_not_speak_for_the_other() -> None:
    def judge(**problems: str) -> RigFinding:
        eyes: dict[Eye, str] = {eye: problems[eye] for eye in EYES if eye in problems}
        return display_finding(DisplayCheck("today", "wearer", "0a1b", "", "", eyes))

    one = judge(left="")
    assert not one.is_judged
    assert one.found.startswith("left as sent; right not checked")
    assert judge(left="", right="").is_judged
    wrong = judge(right="it is mirrored")
    assert wrong.is_judged
    assert not wrong.is_fine

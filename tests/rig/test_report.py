from dataclasses import replace

import numpy as np

from handcal.geometry import rigid
from handcal.rig.example import example_rig
from handcal.rig.report import report_rig
from handcal.types import Origin, Rig

RIG = example_rig()


def doubtful(rig: Rig) -> dict[str, str]:
    return {one.what: one.found for one in report_rig(rig) if not one.is_fine}


def test_the_example_is_in_order() -> None:
    assert doubtful(RIG) == {}
    told = {one.what: one.found for one in report_rig(RIG)}
    assert told["Distance of the viewpoints"] == "63 mm"
    assert told["left: display"] == "1268×720 px, 1.40′ a pixel, 29° across"


def test_exchanged_eyes_are_told() -> None:
    exchanged = replace(RIG, eyes={"left": RIG.eyes["right"], "right": RIG.eyes["left"]})
    assert doubtful(exchanged) == {"Viewpoints": "left and right are exchanged"}


def test_a_depth_camera_that_looks_away_is_told() -> None:
    turned = replace(RIG, T_H_D=RIG.T_H_D @ rigid([np.radians(30.0), 0.0, 0.0]))
    assert set(doubtful(turned)) == {
        f"{eye}: seen by the depth camera at 0.4 to 0.6 m" for eye in ("left", "right")
    }


def test_a_display_too_near_and_a_viewpoint_too_far_are_told() -> None:
    left = replace(RIG.eyes["left"], z_C0_S_m=0.2, t_C0_V_m=np.array([0.0, 0.0, 0.03]))
    found = doubtful(replace(RIG, eyes={**RIG.eyes, "left": left}))
    assert {"left: z(C0→S)", "left: C0 from V"} <= set(found)


def test_a_part_that_was_not_good_is_told_with_its_reason() -> None:
    origin = Origin("grid", "today", 3, 0.2, "bad", "the camera moved", ("x_m",), np.eye(1))
    found = doubtful(replace(RIG, origins={"left": origin}))
    assert found == {"Calibration of left": "bad: the camera moved (grid, today)"}

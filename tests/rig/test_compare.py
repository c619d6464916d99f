from dataclasses import replace

import numpy as np
import pytest

from handcal.geometry import rigid
from handcal.rig.compare import compare_rigs
from handcal.rig.example import example_rig
from handcal.types import Rig

RIG = example_rig()


def differences(other: Rig) -> dict[str, float]:
    """Return the differences that are not zero, by name."""
    return {one.name: one.value for one in compare_rigs(RIG, other) if one.value > 1e-9}


def test_a_rig_does_not_differ_from_itself() -> None:
    assert differences(RIG) == {}


def test_a_moved_depth_camera_moves_what_it_tracks() -> None:
    T_H_D = rigid(None, [0.001, 0.0, 0.0]) @ RIG.T_H_D
    found = differences(replace(RIG, T_H_D=T_H_D))
    assert found.pop("T_H_D: moved") == pytest.approx(1.0)
    # 1 mm at 0.4, 0.5 and 0.6 m.
    arcmin = 60.0 * np.degrees(np.mean([0.001 / z for z in (0.4, 0.5, 0.6)]))
    for eye in ("left", "right"):
        assert found.pop(f"{eye}: target is drawn elsewhere") == pytest.approx(arcmin, rel=0.02)
    assert found == {}


def test_a_turned_depth_camera_is_told_in_degrees() -> None:
    T_H_D = RIG.T_H_D @ rigid([0.0, np.radians(0.3), 0.0])
    assert differences(replace(RIG, T_H_D=T_H_D))["T_H_D: turned"] == pytest.approx(0.3)


def test_a_display_differs_by_pixels_place_and_distance() -> None:
    left = RIG.eyes["left"]
    K = left.K + np.array([[0.0, 0.0, 3.0], [0.0, 0.0, 4.0], [0.0, 0.0, 0.0]])
    changed = replace(
        left, K=K, z_C0_S_m=1.02 * left.z_C0_S_m, t_C0_V_m=np.add(left.t_C0_V_m, [0.0, 0.0, 0.002])
    )
    found = differences(replace(RIG, eyes={**RIG.eyes, "left": changed}))
    assert found["left: largest move of a display pixel"] == pytest.approx(5.0)
    assert found["left: z(C0→S)"] == pytest.approx(2.0)
    assert found["left: C0 in V"] == pytest.approx(2.0)
    assert all(name.startswith("left") for name in found)


def test_another_depth_lens_is_told_in_pixels() -> None:
    longer = replace(RIG.depth_intrinsics, fx=1.01 * RIG.depth_intrinsics.fx)
    found = differences(replace(RIG, depth_intrinsics=longer))
    assert found == {"depth camera: largest move of a pixel": pytest.approx(6.395, rel=1e-3)}

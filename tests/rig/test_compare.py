from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handcal.camera.recordings import open_recording
from handcal.core.geometry import rigid
from handcal.core.types import CameraIdentity, Rig
from handcal.rig.compare import compare_camera, compare_rigs
from handcal.rig.example import example_rig

RIG = example_rig()


def differences(other: Rig) -> dict[str, float]:
    """Return the differences that are not zero, by name."""
    return {one.name: one.value for one in compare_rigs(RIG, other) if one.value > 1e-9}


def test_a_rig_does_not_differ_from_itself() -> None:
    assert differences(RIG) == {}


def test_a_moved_depth_camera_moves_what_it_tracks() -> None:
    T_H_D = rigid(None, [0.001, 0.0, 0.0]) @ RIG.T_H_D
    found = differences(replace(RIG, T_H_D=T_H_D))
    assert found.pop("depth camera (T_H_D): moved") == pytest.approx(1.0)
    # 1 mm at 0.4, 0.5 and 0.6 m.
    arcmin = 60.0 * np.degrees(np.mean([0.001 / z for z in (0.4, 0.5, 0.6)]))
    for eye in ("left", "right"):
        assert found.pop(f"{eye}: target is drawn elsewhere") == pytest.approx(arcmin, rel=0.02)
    assert found == {}


def test_a_display_differs_by_pixels_place_and_distance() -> None:
    left = RIG.eyes["left"]
    K = left.K + np.array([[0.0, 0.0, 3.0], [0.0, 0.0, 4.0], [0.0, 0.0, 0.0]])
    changed = replace(
        left, K=K, z_C0_S_m=1.02 * left.z_C0_S_m, t_C0_V_m=np.add(left.t_C0_V_m, [0.0, 0.0, 0.002])
    )
    found = differences(replace(RIG, eyes={**RIG.eyes, "left": changed}))
    assert found["left: largest move of a display pixel"] == pytest.approx(5.0)
    assert found["left: distance of the virtual screen"] == pytest.approx(2.0)
    assert found["left: viewpoint in the rendering camera"] == pytest.approx(2.0)
    assert all(name.startswith("left") for name in found)


D415 = CameraIdentity("Intel RealSense D415", "123", "5.16.0.1")
KNOWN = replace(RIG, depth_camera=D415)
LENS = RIG.depth_intrinsics


def test_the_rig_s_own_camera_does_not_differ() -> None:
    assert compare_camera(KNOWN, D415, LENS) == ()
    assert compare_camera(KNOWN, replace(D415, firmware="6.0")) == ()
    assert compare_camera(KNOWN, CameraIdentity(), LENS) == ()
    assert compare_camera(RIG, D415, LENS) == ()
    solved = replace(LENS, fx=1.004 * LENS.fx, fy=1.003 * LENS.fy, cx=LENS.cx + 2.0)
    assert compare_camera(KNOWN, D415, replace(solved, distortion=(0.004, 0.0, 0.0, 0.0))) == ()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"fx": 1.04 * LENS.fx, "fy": 1.04 * LENS.fy}, "focal length 4.0 % longer"),
        ({"fy": 0.98 * LENS.fy}, "focal length 2.0 % shorter"),
        ({"cx": LENS.cx + 3.0, "cy": LENS.cy - 4.0}, "principal point 5.0 px away"),
        ({"width": 848, "height": 480}, "images of 848x480 pixels, not 1280x720"),
    ],
)
def test_another_lens_is_reported_with_numbers(changes: dict[str, float], words: str) -> None:
    assert compare_camera(KNOWN, D415, replace(LENS, **changes)) == (words,)  # type: ignore[arg-type]


def test_another_device_is_named_and_so_is_its_lens() -> None:
    other = CameraIdentity("Intel RealSense D435", "456")
    longer = replace(LENS, fx=1.1 * LENS.fx, fy=1.1 * LENS.fy)
    assert compare_camera(KNOWN, other, longer) == (
        "another model: Intel RealSense D435, not Intel RealSense D415",
        "another serial number: 456, not 123",
        "focal length 10.0 % longer",
    )


def test_a_real_recording_differs_from_the_example_rig(shared_data: Path) -> None:
    pytest.importorskip("pyrealsense2")
    with open_recording(shared_data / "recordings" / "0925_012.bag") as camera:
        words = compare_camera(KNOWN, camera.identity, camera.depth_intrinsics)
        own = replace(RIG, depth_camera=camera.identity, depth_intrinsics=camera.depth_intrinsics)
        assert compare_camera(own, camera.identity, camera.depth_intrinsics) == ()
    assert words[1:3] == (
        "another serial number: 817512071792, not 123",
        "focal length 35.6 % shorter",
    )

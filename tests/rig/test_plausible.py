import dataclasses
from collections.abc import Callable

import numpy as np
import pytest

from handcal.core.geometry import rigid
from handcal.core.types import Float64, HeadsetIdentity, HeadsetView, Rig
from handcal.rig.example import example_rig
from handcal.rig.plausible import check_rig

LEFT = example_rig().eyes["left"]


def with_display(**changes: object) -> Rig:
    rig = example_rig()
    left = dataclasses.replace(rig.eyes["left"], **changes)  # type: ignore[arg-type]
    return dataclasses.replace(rig, eyes={"left": left, "right": rig.eyes["right"]})


def with_depth_camera(**changes: object) -> Rig:
    rig = example_rig()
    return dataclasses.replace(
        rig,
        depth_intrinsics=dataclasses.replace(rig.depth_intrinsics, **changes),  # type: ignore[arg-type]
    )


def edited(A: Float64, row: int, column: int, value: float) -> Float64:
    A = A.copy()
    A[row, column] = value
    return A


def with_reported(tangents: list[float], T_V_H: Float64 = LEFT.T_V_H) -> Rig:
    view = HeadsetView(T_V_H, np.array(tangents), 1280, 720)
    headset = HeadsetIdentity("00", "", "", "", 1, {"left": view})
    return dataclasses.replace(example_rig(), headset=headset)


FROM_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])
LEFT_HANDED = np.diag([1.0, 1.0, -1.0, 1.0])


def scaled(K: Float64, factor: float) -> Float64:
    factors: Float64 = np.array([[factor, 1.0, 1.0], [1.0, factor, 1.0], [1.0, 1.0, 1.0]])
    return K * factors


@pytest.mark.parametrize(
    ("make", "problem"),
    [
        (lambda: dataclasses.replace(example_rig(), name="two\nlines"), "name must be one line"),
        (lambda: with_display(K=edited(LEFT.K, 0, 0, -2456.0)), r"left\.K .* positive focal"),
        (lambda: with_display(K=edited(LEFT.K, 1, 1, np.nan)), r"left\.K .* finite"),
        (lambda: with_display(t_C0_V_m=[1.0, -2.0, 3.0]), r"left\.t_C0_V_m .* \(metres\)"),
        (lambda: with_display(z_C0_S_m=2000.0), r"left\.z_C0_S_m .* got 2000"),
        (lambda: with_display(width_px=0), "left: width_px .* got 0 and 720"),
        (lambda: with_display(T_V_H=LEFT_HANDED), r"left\.T_V_H .* right-handed"),
        (lambda: with_display(T_V_H=rigid(None, [30.0, 0, 0])), r"left\.T_V_H: the translation"),
        (lambda: with_depth_camera(fx=10.05), "depth_camera: fx is 10.05 px, but must lie between"),
        (lambda: with_depth_camera(fy=600.0), "fx is 1005 px and fy 600 px, but pixels are about"),
        (lambda: with_depth_camera(cx=0.0), "depth_camera: cx is 0 px, but must lie near the mid"),
        (lambda: with_depth_camera(width=720, height=1280), "cx is 639.5 .* another size of image"),
        (lambda: with_display(K=edited(LEFT.K, 0, 0, 24.56)), "left.K: fx is 24.56 px"),
        (lambda: with_display(K=edited(LEFT.K, 1, 2, 10.0)), "left.K: cy is 10 px"),
        (lambda: with_display(K=scaled(LEFT.K, 0.13)), "left.K: the display is 127° across"),
        (lambda: with_display(T_V_H=rigid(None, [0.06, 0.4, 0])), "T_V_H: .* 0.404 m from"),
        (lambda: with_display(T_V_H=FROM_OPENGL @ LEFT.T_V_H), "T_V_H: .* 179° away .* OpenGL"),
        (
            lambda: with_reported([-0.5, 0.5, -0.01, 0.01]),
            r"headset\.left\.tangents: fy is 36000 px",
        ),
        (lambda: with_reported([-0.5, 0.5, -0.3, 0.3], np.diag([-1.0, 1, -1, 1])), "180° away"),
        (lambda: with_depth_camera(distortion=(0.1,)), r"depth_camera\.distortion must hold"),
    ],
)
def test_an_implausible_field_is_named(make: Callable[[], Rig], problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        check_rig(make())

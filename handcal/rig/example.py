"""The example rig that the simulator and the demo start from."""

from __future__ import annotations

import numpy as np

from handcal.core.display import update_matrix
from handcal.core.geometry import invert, rigid
from handcal.core.types import EyeDisplay, Intrinsics, Rig

WIDTH_PX, HEIGHT_PX = 1268, 720
FOCAL_PX = 2456.0
Z_E_S_M = 2.0
HALF_EYE_DISTANCE_M = 0.0315


def example_rig() -> Rig:
    """Return a HoloLens-1-like headset with an Intel RealSense D415 bolted on top.

    Virtual image at 2 m, viewpoints 63 mm apart. The rig's origin H is its colour camera, 40 mm
    above and 50 mm in front of the middle of the viewpoints. The depth camera sits 70 mm above the
    viewpoints and looks 15° down, so that all of both displays lies in its view from 0.4 to 0.6 m.

    Examples
    --------
    >>> import handcal
    >>> handcal.example_rig().eyes["left"].z_C0_S_m
    2.0
    """
    return Rig(
        name="Example: HoloLens 1 with RealSense D415",
        eyes={"left": _display(-1.0), "right": _display(1.0)},
        T_H_D=rigid([np.radians(-15.0), 0.0, 0.0], [-0.0175, -0.030, 0.015]),
        # A D415's depth image is rectified, so it has no distortion.
        depth_intrinsics=Intrinsics(1280, 720, 1005.0, 1005.0, 639.5, 359.5),
    )


def _display(side: float) -> EyeDisplay:
    """Return one eye's display; `side` is -1 for the left and 1 for the right."""
    # The viewpoint camera was not quite on the display's axis: H0 is the update from E's to C0.
    off_axis_m = [0.0015 * side, -0.001, 0.0]
    t_C0_V_m = np.array([0.0005 * side, -0.001, 0.002])
    R_H_V = rigid([np.radians(0.2), np.radians(-0.5) * side, 0.0])[:3, :3]  # toed in
    C0_in_H_m = np.array([HALF_EYE_DISTANCE_M * side, 0.040, -0.050])
    T_H_V = rigid(R_H_V, C0_in_H_m + R_H_V @ t_C0_V_m)
    return EyeDisplay(
        K=np.array(
            [
                [FOCAL_PX, 0.0, (WIDTH_PX - 1) / 2],
                [0.0, FOCAL_PX, (HEIGHT_PX - 1) / 2],
                [0.0, 0.0, 1.0],
            ]
        ),
        H0=update_matrix(off_axis_m, Z_E_S_M)[:3, :3],
        t_C0_V_m=t_C0_V_m,
        z_C0_S_m=Z_E_S_M,
        width_px=WIDTH_PX,
        height_px=HEIGHT_PX,
        T_V_H=invert(T_H_V),
    )

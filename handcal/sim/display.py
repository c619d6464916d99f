"""A simulated headset seen by a viewpoint camera; its compositor may undo what the app draws."""

from __future__ import annotations

import time
from typing import Literal, TypeAlias, get_args

import cv2
import numpy as np

from handcal.camera.viewpoint import ViewpointCamera
from handcal.core.display import projection_matrix
from handcal.core.geometry import project, rigid
from handcal.core.types import Eye, Float64, Projection, Rig, UInt8
from handcal.link.client import HeadsetClient
from handcal.sim.boards import PictureSettings
from handcal.sim.photographs import VIEWPOINT_CAMERA
from handcal.sim.viewpoint import photograph_display

DisplayMode: TypeAlias = Literal[
    "obeys", "no-override", "one-for-both", "depth", "infinity", "image-plane"
]
"""Use that a headset makes of the projection.

`obeys`: draws with it. `no-override`: the app's projection has no effect. `one-for-both`: the left
eye's is used for both. The calibrated view is submitted and reprojected: `depth`, each point at its
own depth; `infinity`, on a plane far away; `image-plane`, on the virtual image's.
"""
DISPLAY_MODES: tuple[DisplayMode, ...] = get_args(DisplayMode)
_FAR_M = 1e6
_LINE_PX = 4
_SUBPIXEL_BITS = 4
_PICTURE = PictureSettings(samples=2)


class SimulatedDisplay(ViewpointCamera):
    """The picture of a simulated headset's display, from near the viewpoint of the rig.

    Parameters
    ----------
    client : HeadsetClient
        The headset's end of the link; it stays open.
    rig : Rig
        Its offline calibration is the runtime's own view.
    mode : DisplayMode
    seed : int
        Of the camera's direction and noise.

    Attributes
    ----------
    eye : eye
        The eye behind whose display the camera is.
    """

    name = "Simulated viewpoint camera"

    def __init__(
        self, client: HeadsetClient, rig: Rig, mode: DisplayMode = "obeys", seed: int = 1
    ) -> None:
        self.eye: Eye = "left"
        self._client = client
        self._rig = rig
        self._mode = mode
        self._rng = np.random.default_rng(seed)
        self._R_E_C = rigid(self._rng.normal(0.0, 0.02, 3))[:3, :3]

    def place(self, eye: Eye) -> None:
        """Put the camera behind the display of an eye."""
        self.eye = eye

    def read(self) -> tuple[UInt8, int]:
        """Return a picture of what is drawn now, and the present time."""
        t_ns = time.monotonic_ns()
        display = self._rig.eyes[self.eye]
        state = self._client.state()
        shown = np.zeros((display.height_px, display.width_px), np.uint8)
        if state.target is not None and state.target.eye == self.eye:
            corners_px = drawn_px(
                state.target.corners_V_m, state.drawn, self.eye, self._rig, self._mode
            )
            fine = np.rint(corners_px * 2**_SUBPIXEL_BITS).astype(np.int32)
            cv2.polylines(shown, [fine], True, 255, _LINE_PX, cv2.LINE_AA, shift=_SUBPIXEL_BITS)
        seen = photograph_display(
            shown, display, self._R_E_C, VIEWPOINT_CAMERA, self._rng, settings=_PICTURE
        )
        return np.repeat(seen[..., None], 3, axis=2), t_ns

    def close(self) -> None:
        """Stop; there is nothing to release."""


def drawn_px(
    points_V_m: Float64,
    projections: dict[Eye, Projection],
    eye: Eye,
    rig: Rig,
    mode: DisplayMode,
) -> Float64:
    """Return where a headset of this kind shows (N, 3) points of one eye's V, (N, 2) pixels."""
    display = rig.eyes[eye]
    own = projection_matrix(display)
    P = projections["left" if mode == "one-for-both" else eye].P
    match mode:
        case "no-override":
            return project(own, points_V_m)
        case "depth":
            return _reprojected(points_V_m, P, own, points_V_m[:, 2])
        case "infinity":
            return _reprojected(points_V_m, P, own, np.full(len(points_V_m), _FAR_M))
        case "image-plane":
            plane_m = display.z_C0_S_m - display.t_C0_V_m[2]
            return _reprojected(points_V_m, P, own, np.full(len(points_V_m), plane_m))
    return project(P, points_V_m)


def _reprojected(points_V_m: Float64, P: Float64, own: Float64, depths_m: Float64) -> Float64:
    """Return the pixels after a compositor has moved the image from the view P to its own.

    The compositor takes each drawn pixel for a point at a depth in V, seen from the centre of P.
    """
    centre_m = -np.linalg.solve(P[:, :3], P[:, 3])
    drawn = np.column_stack([project(P, points_V_m), np.ones(len(points_V_m))])
    rays = np.linalg.solve(P[:, :3], drawn.T).T
    reach = (depths_m - centre_m[2]) / rays[:, 2]
    return project(own, centre_m + reach[:, None] * rays)

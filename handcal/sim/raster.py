"""Rasterised images of a hand in a pinhole camera."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from handcal.core.geometry import camera_matrix, invert, project, rigid, transform
from handcal.core.types import Bool, Float32, Float64, Intrinsics
from handcal.sim.hand import HandModel

_NEAR_M, _FAR_M = 0.02, 10.0
_CUT_BAND_M = 0.003
# From OpenCV's axes to the rasteriser's, which are OpenGL's.
_FLIP = np.diag([1.0, -1.0, -1.0, 1.0])

D415 = Intrinsics(width=1280, height=720, fx=1005.0, fy=1005.0, cx=639.5, cy=359.5)
"""Depth of an Intel RealSense D415 at 1280x720: 65° across (data sheet)."""


@dataclass(frozen=True, slots=True, eq=False)
class HandImage:
    """The part of a camera's image that holds the hand."""

    x0: int
    y0: int
    """Its upper left pixel in the whole image."""
    depth_m: Float32
    """(h, w); z in the camera's frame; infinite outside the hand."""
    color: Float32
    """(h, w, 3); interpolated values of the vertices; 0 outside the hand."""


def draw_hand(
    hand: HandModel,
    T_D_hand: Float64,
    intrinsics: Intrinsics,
    vertex_colors: Float32 | None = None,
) -> HandImage:
    """Draw a hand by rasterising its triangles, each pixel sampled at its centre.

    A hand with a part nearer than 2 cm to the lens, or behind it, is not drawn.

    Parameters
    ----------
    hand : HandModel
    T_D_hand : (4, 4) float64
        From the hand's frame to the camera's.
    intrinsics : Intrinsics
        Its distortion is not simulated.
    vertex_colors : (V, 3) float32, optional
        0 to 1; black if absent.
    """
    x0, y0, x1, y1 = _box_px(hand, T_D_hand, intrinsics)
    size = (y1 - y0, x1 - x0)
    depth_m = np.full(size, _FAR_M, dtype=np.float32)
    color = np.zeros((*size, 3), dtype=np.float32)
    if depth_m.size:
        # The rasteriser has square pixels and a centred axis: shear to the box's centre.
        shear = np.eye(4)
        shear[0, :3] = intrinsics.fx, 0.0, intrinsics.cx - (x0 + x1 - 1) / 2
        shear[0] /= intrinsics.fy
        shear[1, 2] = (intrinsics.cy - (y0 + y1 - 1) / 2) / intrinsics.fy
        options = cv2.TriangleRasterizeSettings()
        options.setShadingType(cv2.RASTERIZE_SHADING_SHADED)
        # The mesh is closed: what faces away is hidden by what faces the camera.
        options.setCullingMode(cv2.RASTERIZE_CULLING_CW)
        colors = np.zeros_like(hand.vertices_m) if vertex_colors is None else vertex_colors
        cv2.triangleRasterize(
            hand.vertices_m[None],
            hand.triangles[None],
            colors[None],
            color,
            depth_m,
            (_FLIP @ shear @ T_D_hand).astype(np.float32),
            2.0 * np.arctan(size[0] / 2.0 / intrinsics.fy),
            _NEAR_M,
            _FAR_M,
            options,
        )
    depth_m[depth_m >= _FAR_M] = np.inf
    return HandImage(x0, y0, depth_m, color)


def _box_px(
    hand: HandModel, T_D_hand: Float64, intrinsics: Intrinsics
) -> tuple[int, int, int, int]:
    """Return x0, y0, x1, y1 (exclusive) around the hand, within the image; all 0 if too near."""
    vertices_m = transform(T_D_hand, hand.vertices_m)
    if vertices_m[:, 2].min() < _NEAR_M:
        return 0, 0, 0, 0
    u, v = project(camera_matrix(intrinsics) @ rigid()[:3], vertices_m).T.copy()
    x0, x1 = np.clip([np.floor(u.min()), np.ceil(u.max()) + 1], 0, intrinsics.width)
    y0, y1 = np.clip([np.floor(v.min()), np.ceil(v.max()) + 1], 0, intrinsics.height)
    return int(x0), int(y0), int(x1), int(y1)


def visible_points(
    hand: HandModel,
    T_D_hand: Float64,
    count: int,
    rng: np.random.Generator,
    *,
    intrinsics: Intrinsics = D415,
    forearm_m: float | None = None,
    depth_sigma_m: float = 0.0,
) -> tuple[Float64, Bool]:
    """Sample the surface seen by a camera, as from a segmented depth image.

    Parameters
    ----------
    hand : HandModel
    T_D_hand : (4, 4) float64
        From the hand's frame to the camera's.
    count : int
        Requested number of points; fewer are returned if fewer pixels see the hand.
    rng : numpy.random.Generator
    intrinsics : Intrinsics
    forearm_m : float, optional
        Drop points farther than this from the wrist along the arm.
    depth_sigma_m : float
        Standard deviation of independent noise on each point's z, along its ray.

    Returns
    -------
    points_m : (N, 3) float64
        In the camera's frame.
    is_cut : (N,) bool
        Within 3 mm of the forearm's cut, or on the image's border.
    """
    image = draw_hand(hand, T_D_hand, intrinsics)
    rows, columns = np.nonzero(np.isfinite(image.depth_m))
    depth_m = image.depth_m[rows, columns].astype(np.float64)
    u, v = columns + image.x0, rows + image.y0
    rays = np.column_stack(
        [(u - intrinsics.cx) / intrinsics.fx, (v - intrinsics.cy) / intrinsics.fy, np.ones(len(u))]
    )
    is_cut = (u == 0) | (v == 0) | (u == intrinsics.width - 1) | (v == intrinsics.height - 1)
    kept = np.arange(len(rays))
    if forearm_m is not None:
        on_hand_m = transform(invert(T_D_hand), rays * depth_m[:, None])
        beyond_m = (on_hand_m - hand.wrist_m) @ hand.arm_axis - forearm_m
        is_cut |= beyond_m > -_CUT_BAND_M
        kept = kept[beyond_m <= 0.0]
    chosen = np.sort(rng.choice(kept, min(count, len(kept)), replace=False))
    noisy_m = depth_m[chosen] + depth_sigma_m * rng.normal(size=len(chosen))
    return rays[chosen] * noisy_m[:, None], is_cut[chosen]

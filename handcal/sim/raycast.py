"""What a pinhole camera sees of a hand, by ray casting."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull

from handcal.geometry import camera_matrix, invert, project, transform
from handcal.sim.hand import HandModel
from handcal.types import Bool, Float32, Float64, Intrinsics

# Nearer than this, or behind, the hand's box in the image is not computed but taken as all of it.
_NEAR_M = 0.02
_CUT_BAND_M = 0.003

D415 = Intrinsics(width=1280, height=720, fx=1005.0, fy=1005.0, cx=639.5, cy=359.5)
"""Depth of an Intel RealSense D415 at 1280x720: 65° across (data sheet)."""


@dataclass(frozen=True, slots=True, eq=False)
class HandView:
    """The pixels of one image that show the hand.

    Attributes
    ----------
    rows, columns : (N,) int
    depth_m : (N,) float32
        z in the camera's frame.
    triangle : (N,) uint32
        Which triangle was hit, and
    weight : (N, 2) float32
        the barycentric weights of its second and third corner there.
    """

    rows: np.ndarray[tuple[int, ...], np.dtype[np.intp]]
    columns: np.ndarray[tuple[int, ...], np.dtype[np.intp]]
    depth_m: Float32
    triangle: np.ndarray[tuple[int, ...], np.dtype[np.uint32]]
    weight: Float32


class HandCaster:
    """Casts a camera's rays at one hand."""

    def __init__(self, hand: HandModel) -> None:
        import open3d as o3d  # imported late: 1.1 s

        self.hand = hand
        self._hull_m = hand.vertices_m[ConvexHull(hand.vertices_m).vertices]
        self._scene = o3d.t.geometry.RaycastingScene(nthreads=1)
        self._scene.add_triangles(
            o3d.core.Tensor.from_numpy(hand.vertices_m.copy()),
            o3d.core.Tensor.from_numpy(hand.triangles.astype(np.uint32)),
        )
        self._tensor = o3d.core.Tensor.from_numpy

    def cast(self, T_D_hand: Float64, intrinsics: Intrinsics) -> HandView:
        """Return what a camera sees of the hand; distortion is not simulated.

        Parameters
        ----------
        T_D_hand : (4, 4) float64
            From the hand's frame to the camera's.
        intrinsics : Intrinsics
        """
        x0, y0, x1, y1 = self._box_px(T_D_hand, intrinsics)
        T_hand_D = invert(T_D_hand)
        x = (np.arange(x0, x1) - intrinsics.cx) / intrinsics.fx
        y = (np.arange(y0, y1) - intrinsics.cy) / intrinsics.fy
        R = T_hand_D[:3, :3]
        rays = np.empty((y1 - y0, x1 - x0, 6), dtype=np.float32)
        rays[..., :3] = T_hand_D[:3, 3]
        # Rays of unit z: the distance to a hit is its depth.
        rays[..., 3:] = (x[:, None] * R[:, 0] + R[:, 2]) + (y[:, None] * R[:, 1])[:, None]
        hits = self._scene.cast_rays(self._tensor(rays), nthreads=1)
        depth_m = hits["t_hit"].numpy()
        rows, columns = np.nonzero(np.isfinite(depth_m))
        return HandView(
            rows + y0,
            columns + x0,
            depth_m[rows, columns],
            hits["primitive_ids"].numpy()[rows, columns],
            hits["primitive_uvs"].numpy()[rows, columns],
        )

    def closest(self, points_m: Float64) -> Float64:
        """Return the surface points (N, 3) nearest to `points_m`, both in the hand's frame."""
        query = self._tensor(np.ascontiguousarray(points_m, dtype=np.float32))
        nearest: Float64 = self._scene.compute_closest_points(query, nthreads=1)["points"].numpy()
        return nearest.astype(np.float64)

    def _box_px(self, T_D_hand: Float64, intrinsics: Intrinsics) -> tuple[int, int, int, int]:
        """Return x0, y0, x1, y1 (exclusive) around the hand, within the image."""
        size = np.array([intrinsics.width, intrinsics.height])
        hull_m = transform(T_D_hand, self._hull_m)
        if (hull_m[:, 2] < _NEAR_M).all():
            return 0, 0, 0, 0
        if (hull_m[:, 2] < _NEAR_M).any():
            return 0, 0, intrinsics.width, intrinsics.height
        P = np.column_stack([camera_matrix(intrinsics), np.zeros(3)])
        pixels = project(P, hull_m)
        low = np.floor(pixels.min(0)).clip(0, size).astype(int)
        high = np.ceil(pixels.max(0) + 1).clip(0, size).astype(int)
        return int(low[0]), int(low[1]), int(high[0]), int(high[1])


def visible_points(
    caster: HandCaster,
    T_D_hand: Float64,
    count: int,
    rng: np.random.Generator,
    *,
    intrinsics: Intrinsics = D415,
    forearm_m: float | None = None,
    depth_sigma_m: float = 0.0,
) -> tuple[Float64, Bool]:
    """Sample the surface that a camera sees, as a segmented depth image would give it.

    Parameters
    ----------
    caster : HandCaster
    T_D_hand : (4, 4) float64
        From the hand's frame to the camera's.
    count : int
        Points wanted; fewer come back if fewer pixels see the hand.
    rng : numpy.random.Generator
    intrinsics : Intrinsics
    forearm_m : float, optional
        Drop what lies farther than this from the wrist along the arm.
    depth_sigma_m : float
        Standard deviation of independent noise along each ray's z.

    Returns
    -------
    points_m : (N, 3) float64
        In the camera's frame.
    is_cut : (N,) bool
        Within 3 mm of the forearm's cut, or on the image's border.
    """
    view = caster.cast(T_D_hand, intrinsics)
    rays = np.column_stack(
        [
            (view.columns - intrinsics.cx) / intrinsics.fx,
            (view.rows - intrinsics.cy) / intrinsics.fy,
            np.ones(len(view.rows)),
        ]
    )
    depth_m = view.depth_m.astype(np.float64)
    is_cut = (
        (view.columns == 0)
        | (view.rows == 0)
        | (view.columns == intrinsics.width - 1)
        | (view.rows == intrinsics.height - 1)
    )
    kept = np.arange(len(rays))
    if forearm_m is not None:
        on_hand_m = transform(invert(T_D_hand), rays * depth_m[:, None])
        beyond_m = (on_hand_m - caster.hand.wrist_m) @ caster.hand.arm_axis - forearm_m
        is_cut |= beyond_m > -_CUT_BAND_M
        kept = kept[beyond_m <= 0]
    chosen = np.sort(rng.choice(kept, min(count, len(kept)), replace=False))
    noisy_m = depth_m[chosen] + depth_sigma_m * rng.normal(size=len(chosen))
    return rays[chosen] * noisy_m[:, None], is_cut[chosen]

"""Hands that a depth camera shows too large, and their true silhouettes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from handcal.core.geometry import invert, rigid, transform
from handcal.core.types import Bool, Float64, Frame, HandCloud, Intrinsics, UInt8
from handcal.hand.segment import segment_hand
from handcal.hand.settings import SegmentSettings
from handcal.rig.example import example_rig
from handcal.sim.hand import HandModel, make_hand
from handcal.sim.raster import D415, draw_hand
from handcal.sim.sensor import SensorSettings, sense_depth

SKIN = (205, 155, 130)
CAMERA_D_M: Float64 = np.zeros(3)


def fat_hand(
    seed: int, fatten_px: int, background: tuple[int, int, int] | None = None, zoom: float = 1.0
) -> tuple[HandCloud, Frame, HandModel, Float64]:
    """Return a hand as the example rig's camera segments it, its frame, and its pose in H.

    With colour before a background; of a lens `zoom` times as long as the depth camera's.
    """
    rig, rng = example_rig(), np.random.default_rng(seed)
    hand = make_hand(seed)
    T_H_hand = rigid(rng.normal(0, 0.08, 3), np.add([0, 0.088, 0.49], rng.normal(0, 0.01, 3)))
    image = draw_hand(hand, invert(rig.T_H_D) @ T_H_hand, D415)
    depth_m = np.full((D415.height, D415.width), 2.0, np.float32)
    height, width = image.depth_m.shape
    part = depth_m[image.y0 : image.y0 + height, image.x0 : image.x0 + width]
    np.copyto(part, image.depth_m, where=np.isfinite(image.depth_m))
    sensor = replace(SensorSettings(), fatten_px=fatten_px)
    depth = sense_depth(depth_m, D415.fx, rng, sensor)
    frame = Frame(0, 0, 0, depth, sensor.depth_scale_m, D415)
    cloud = segment_hand(frame, SegmentSettings(roi="depth"))
    if background is not None:
        camera = replace(D415, fx=zoom * D415.fx, fy=zoom * D415.fy)
        color = photograph(hand, invert(rig.T_H_D) @ T_H_hand, camera, background, rng)
        frame = replace(frame, color=color, color_intrinsics=camera)
    return cloud, frame, hand, T_H_hand


def photograph(
    hand: HandModel,
    T_D_hand: Float64,
    camera: Intrinsics,
    background: tuple[int, int, int],
    rng: np.random.Generator,
) -> UInt8:
    """Return a noisy image of a hand before leaves, or the like, of one colour."""
    image = draw_hand(hand, T_D_hand, camera)
    height, width = image.depth_m.shape
    is_hand = np.zeros((camera.height, camera.width, 1), np.float32)
    is_hand[image.y0 : image.y0 + height, image.x0 : image.x0 + width, 0] = np.isfinite(
        image.depth_m
    )
    leaves = cv2.GaussianBlur(rng.normal(0, 60, is_hand.shape), (0, 0), 2.0)[..., None]
    light = is_hand * SKIN + (1.0 - is_hand) * (background + leaves)
    light = cv2.GaussianBlur(light, (0, 0), 0.7) + rng.normal(0, 4, light.shape)
    return np.clip(light, 0, 255).astype(np.uint8)


@dataclass(frozen=True)
class Difference:
    """An outline beside the silhouette of the true hand, in the depth image."""

    outside_px: float
    right_px: float
    down_px: float
    size: float


def beside_truth(
    cloud: HandCloud, hand: HandModel, T_H_hand: Float64, eye_D_m: Float64 = CAMERA_D_M
) -> Difference:
    """Compare what is drawn, without its cut, with the silhouette: distance and similarity.

    As seen from the depth camera or, with the same lens, from a place in its frame.
    """
    T_E_D = rigid(None, -eye_D_m)
    finer, beyond_px = 3, 300  # an eye sees it elsewhere
    cx, cy = D415.cx + beyond_px, D415.cy + beyond_px
    camera = Intrinsics(
        width=finer * (D415.width + 2 * beyond_px),
        height=finer * (D415.height + 2 * beyond_px),
        fx=finer * D415.fx,
        fy=finer * D415.fy,
        cx=finer * (cx + 0.5) - 0.5,
        cy=finer * (cy + 0.5) - 0.5,
    )
    image = draw_hand(hand, T_E_D @ invert(example_rig().T_H_D) @ T_H_hand, camera)
    is_hand = np.pad(np.isfinite(image.depth_m), 30).astype(np.uint8)
    # Either distance is to the centre of the nearest pixel of the other kind.
    outside_px = np.asarray(cv2.distanceTransform(1 - is_hand, cv2.DIST_L2, 5), np.float64)
    outside_px -= cv2.distanceTransform(is_hand, cv2.DIST_L2, 5)
    outside_px = (outside_px - 0.5 * np.sign(outside_px)) / finer
    silhouette_m = transform(T_E_D, cloud.outline_m[~near_cut(cloud.outline_is_cut)])
    place_px = silhouette_m[:, :2] / silhouette_m[:, 2:] * D415.fx
    at = finer * (place_px + np.add([cx, cy], 0.5)) - 0.5
    column, row = (at - [image.x0 - 30, image.y0 - 30]).astype(np.float32).T
    slope = np.gradient(finer * cv2.GaussianBlur(outside_px, (0, 0), 3.0))
    gap_px, down, right = (
        cv2.remap(one.astype(np.float32), column, row, cv2.INTER_LINEAR).ravel()
        for one in (outside_px, *slope)
    )
    from_middle = place_px - place_px.mean(axis=0)
    across = right * from_middle[:, 0] + down * from_middle[:, 1]
    fitted, *_ = np.linalg.lstsq(np.column_stack([right, down, across]), gap_px, rcond=None)
    return Difference(float(gap_px.mean()), *map(float, fitted))


def near_cut(is_cut: Bool) -> Bool:
    """Return the points of a closed outline at most 25 steps from a cut."""
    return np.asarray(np.any([np.roll(is_cut, step) for step in range(-25, 26)], axis=0))

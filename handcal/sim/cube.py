"""Images of an ArUco cube with known truth, seen by a camera and drawn by a headset."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import ArrayLike

from handcal.core.display import eye_projection
from handcal.core.geometry import rigid
from handcal.core.types import EyeDisplay, Float32, Float64, Intrinsics, UInt8
from handcal.rig.cube import Cube, face_pose
from handcal.sim.boards import BLACK, WALL, WHITE, PictureSettings, expose, pixel_rays

_CELL_PX = 24  # of the texture
_SHOWN_SAMPLES = 2
_LEAST_LIGHT = 0.7  # on a face seen edge-on


class CubePainter:
    """Renders a camera's images of a cube; the lens is computed once."""

    def __init__(
        self, cube: Cube, camera: Intrinsics, settings: PictureSettings | None = None
    ) -> None:
        self._cube, self._camera = cube, camera
        self._settings = settings or PictureSettings()
        self._rays = pixel_rays(camera, self._settings.samples)

    def paint(self, T_C_T: Float64, rng: np.random.Generator) -> UInt8:
        """Return an image (H, W) of the cube at a pose in the camera's frame."""
        fine = np.full(self._rays.shape[:2], WALL, np.float32)
        _paint_faces(fine, self._rays, self._cube, T_C_T, BLACK, WHITE)
        size = self._camera.width, self._camera.height
        image = np.asarray(cv2.resize(fine, size, interpolation=cv2.INTER_AREA), np.float32)
        return expose(image, self._settings, rng)


def draw_cube(cube: Cube, display: EyeDisplay, T_E_T: Float64, shift_m: ArrayLike) -> UInt8:
    """Return the display's image, (height_px, width_px), of a cube drawn for an eye at φ.

    Parameters
    ----------
    cube : Cube
    display : EyeDisplay
    T_E_T : (4, 4) float64
        From the cube's frame to E.
    shift_m : (3,) array_like
        φ rendered with.
    """
    size = display.width_px, display.height_px
    P = eye_projection(display, shift_m)
    # P = P[:, :3] [I, -φ]: its centre is at φ.
    pixels = pixel_rays(Intrinsics(*size, 1.0, 1.0, 0.0, 0.0), _SHOWN_SAMPLES)
    rays = pixels @ np.linalg.inv(P[:, :3]).T.astype(np.float32)
    fine = np.zeros(rays.shape[:2], np.float32)
    from_eye = rigid(translation_m=-np.asarray(shift_m))
    _paint_faces(fine, rays, cube, from_eye @ T_E_T, 0.0, 255.0)
    shown: UInt8 = np.rint(cv2.resize(fine, size, interpolation=cv2.INTER_AREA)).astype(np.uint8)
    return shown


def _paint_faces(
    canvas: Float32, rays: Float32, cube: Cube, T: Float64, black: float, white: float
) -> None:
    """Draw the visible faces; rays (h, w, 3) start at the origin of the frame of `T`."""
    for marker in cube.ids:
        T_face = T @ face_pose(cube, marker)
        towards_m = T_face[:3, 3]
        facing = float(T_face[:3, 2] @ towards_m / np.linalg.norm(towards_m))
        if facing <= 0:
            continue
        # Where a ray meets the face's plane: ray ∝ x u + y v + middle.
        plane = np.column_stack([T_face[:3, :2], towards_m])
        u, v, ahead = np.moveaxis(rays @ np.linalg.inv(plane).T.astype(np.float32), 2, 0)
        half_m = 0.5 * cube.side_m * ahead
        on_face = (np.abs(u) <= half_m) & (np.abs(v) <= half_m)
        if not on_face.any():  # outside the image
            continue
        box = cv2.boundingRect(on_face.astype(np.uint8))
        part = np.s_[box[1] : box[1] + box[3], box[0] : box[0] + box[2]]
        on_face = on_face[part]
        texture = _texture(cube, marker)
        x, y = (
            (axis[part] / ahead[part] / cube.marker_m + 0.5) * len(texture) - 0.5 for axis in (u, v)
        )
        ink = cv2.remap(texture, x, y, cv2.INTER_LINEAR, borderValue=1.0)
        light = _LEAST_LIGHT + (1.0 - _LEAST_LIGHT) * facing
        canvas[part][on_face] = light * (black + (white - black) * ink[on_face])


def _texture(cube: Cube, marker: int) -> Float32:
    across = (cube.marker_dictionary.markerSize + 2) * _CELL_PX
    image = cv2.aruco.generateImageMarker(cube.marker_dictionary, marker, across)
    return np.asarray(image, np.float32) / 255.0

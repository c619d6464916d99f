"""The viewpoint camera's image, rotated to the display's axes, as an eye would see it.

A camera is never exactly parallel to the display. Objects aligned in its image must also be aligned
on the display: frames are undistorted and warped by the pure rotation between the two (Hu et al.
2021, assessment with eye-replacement camera).
"""

from __future__ import annotations

import cv2
import numpy as np

from handcal.core.geometry import camera_matrix
from handcal.core.types import Float64, Intrinsics, UInt8


def rotation_homography(camera: Intrinsics, R_S_C: Float64) -> Float64:
    """Return ``H = K R_S_C K⁻¹`` (3, 3): warped pixels from undistorted ones."""
    K = camera_matrix(camera)
    H: Float64 = K @ R_S_C @ np.linalg.inv(K)
    return H


class RotationWarp:
    """Undistorts and rotates frames of one camera; the pixel map is computed once.

    Parameters
    ----------
    camera : Intrinsics
        Intrinsics of the frames; warped frames have the same, without distortion.
    R_S_C : (3, 3) float64
        From the camera's axes to the display's.
    """

    def __init__(self, camera: Intrinsics, R_S_C: Float64) -> None:
        self._size = camera.height, camera.width
        K = camera_matrix(camera)
        self._x, self._y = cv2.initUndistortRectifyMap(
            K,
            np.array(camera.distortion),
            R_S_C,
            K,
            (camera.width, camera.height),
            cv2.CV_16SC2,
        )

    def warp(self, frame: UInt8) -> UInt8:
        """Return a frame, (H, W) or (H, W, 3) uint8, as seen along the display's axes.

        Raises
        ------
        ValueError
            If it does not have the camera's size.
        """
        if frame.shape[:2] != self._size:
            height, width = self._size
            raise ValueError(
                f"the frame is {frame.shape[1]}×{frame.shape[0]}, the camera {width}×{height}"
            )
        warped = cv2.remap(frame, self._x, self._y, cv2.INTER_LINEAR)
        return warped.astype(np.uint8, copy=False)

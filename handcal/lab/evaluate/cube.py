"""Misalignment of a virtual cube and the real one in captures by the eye-replacement camera.

As in Hu et al. 2021 (assessment with eye-replacement camera): across the line of sight by the
markers' corners in the image, along it and in rotation by the cube's pose from all of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from handcal.core.frozen import freeze
from handcal.core.geometry import camera_matrix, transform
from handcal.core.types import Float64, Intrinsics
from handcal.rig.cube import MIN_FACES, Cube, CubeError, cube_pose, marker_corners_m


@dataclass(frozen=True, slots=True, eq=False)
class CubeMisalignment:
    """The virtual cube minus the real one, in the axes of the (rotated) camera."""

    faces: int
    """Seen in both captures."""
    depth_m: float
    """z of the real cube's middle."""
    offset_m: Float64
    """(N, 2); of each corner across the line of sight, at the real corner's depth."""
    offset_rad: Float64
    """(N, 2); the same as angles."""
    along_m: float
    """Of the cube's middle along z."""
    rotation_rad: Float64
    """(3,); rotation vector from the real cube to the virtual one."""

    def __post_init__(self) -> None:
        freeze(self, "offset_m", np.float64, None, 2)
        freeze(self, "offset_rad", np.float64, len(self.offset_m), 2)
        freeze(self, "rotation_rad", np.float64, 3)


def compare_cubes(
    real_px: Mapping[int, Float64],
    virtual_px: Mapping[int, Float64],
    cube: Cube,
    camera: Intrinsics,
) -> CubeMisalignment:
    """Compare what `find_cube` found in a capture of the real cube and in one of the virtual.

    Only faces seen in both count, so that errors of the print cancel.

    Parameters
    ----------
    real_px, virtual_px : mapping of int to (4, 2) float64
        The corners of each marker.
    cube : Cube
    camera : Intrinsics
        Of both captures, without lens distortion: they are `RotationWarp`'s.

    Raises
    ------
    CubeError
        If fewer than two faces are seen in both, or the corners do not lie as on the cube.
    """
    shared = sorted(real_px.keys() & virtual_px.keys())
    if len(shared) < MIN_FACES:
        raise CubeError(
            f"the two captures share {len(shared)} faces, at least {MIN_FACES} are needed: they "
            "must show the same pose of the cube"
        )
    real_px, virtual_px = ({i: px[i] for i in shared} for px in (real_px, virtual_px))
    T_real, T_virtual = (cube_pose(px, cube, camera) for px in (real_px, virtual_px))
    real, virtual = (_plane(px, camera) for px in (real_px, virtual_px))
    depths_m = transform(T_real, marker_corners_m(cube, shared))[:, 2:]
    turn = Rotation.from_matrix(T_virtual[:3, :3] @ T_real[:3, :3].T)
    return CubeMisalignment(
        faces=len(shared),
        depth_m=float(T_real[2, 3]),
        offset_m=(virtual - real) * depths_m,
        offset_rad=np.arctan(virtual) - np.arctan(real),
        along_m=float(T_virtual[2, 3] - T_real[2, 3]),
        rotation_rad=turn.as_rotvec(),
    )


def _plane(corners_px: Mapping[int, Float64], camera: Intrinsics) -> Float64:
    """Return where corners are on the plane at unit distance, (N, 2)."""
    pixels = np.concatenate([*corners_px.values()])
    homogeneous = np.column_stack([pixels, np.ones(len(pixels))])
    return np.asarray(np.linalg.solve(camera_matrix(camera), homogeneous.T).T[:, :2])

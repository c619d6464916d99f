"""The offline calibration of a headset, as the rig file holds it.

Frames and axes are those of `handcal.core.types`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal, TypeAlias

import numpy as np

from handcal.core.frozen import brief, freeze
from handcal.core.types import EYES, CameraIdentity, Eye, Float64, HeadsetIdentity, Intrinsics

RigPart: TypeAlias = Literal["left", "right", "T_H_D"]
RIG_PARTS: tuple[RigPart, ...] = ("left", "right", "T_H_D")
PART_NAMES: dict[RigPart, str] = {
    "left": "left display",
    "right": "right display",
    "T_H_D": "depth camera's pose",
}


@dataclass(frozen=True, slots=True, eq=False)
class EyeDisplay:
    """One eye's offline calibration."""

    K: Float64
    """(3, 3); on-axis intrinsics of E, px."""
    H0: Float64
    """(3, 3); homography correction of the viewpoint C0 (paper, eq. for H)."""
    t_C0_V_m: Float64
    """(3,); position of V from C0 in E's axes, so that ``p_E = p_V + t_C0_V_m``."""
    z_C0_S_m: float
    """Distance from C0 to the display's focal plane S."""
    width_px: int
    height_px: int
    T_V_H: Float64
    """(4, 4); from the headset rig to the rendering camera, as the headset reports it."""

    __repr__ = brief

    def __post_init__(self) -> None:
        freeze(self, "K", np.float64, 3, 3)
        freeze(self, "H0", np.float64, 3, 3)
        freeze(self, "t_C0_V_m", np.float64, 3)
        freeze(self, "T_V_H", np.float64, 4, 4)


@dataclass(frozen=True, slots=True, eq=False)
class Origin:
    """The origin of one part of a rig: its method, date, data and uncertainty."""

    method: str
    """One line."""
    made: str
    """Date and time, ISO 8601."""
    views: int
    """Number of images, or pairs of images, used."""
    rms_px: float
    """Root mean square of the reprojection error."""
    verdict: str
    reason: str
    """One line each."""
    parameters: tuple[str, ...]
    """Names of the covariance's parameters, with units."""
    covariance: Float64
    """(n, n); covariance of the n `parameters`."""

    __repr__ = brief

    def __post_init__(self) -> None:
        freeze(self, "covariance", np.float64, len(self.parameters), len(self.parameters))


@dataclass(frozen=True, slots=True, eq=False)
class DepthCheck:
    """Measured depth compared with that of a board whose pose is known from colour images.

    ``measured depth = scale * true depth + offset_m``, along the depth camera's axis.
    """

    made: str
    """Date and time, ISO 8601."""
    views: int
    """Number of views of the board."""
    scale: float
    offset_m: float
    covariance: Float64
    """(2, 2); of `scale` and `offset_m`, in 1, m and m²."""
    ranges_m: Float64
    """(N, 2); nearest and farthest true depth of each range, ascending."""
    flatness_m: Float64
    """(N,); RMS distance of the measured points from the plane through them, by range."""
    flatness_sigma_m: Float64
    """(N,); its standard deviation."""

    __repr__ = brief

    def __post_init__(self) -> None:
        freeze(self, "covariance", np.float64, 2, 2)
        freeze(self, "ranges_m", np.float64, None, 2)
        freeze(self, "flatness_m", np.float64, len(self.ranges_m))
        freeze(self, "flatness_sigma_m", np.float64, len(self.ranges_m))

    def bias_m(self, depth_m: float) -> tuple[float, float]:
        """Return measured minus true depth at a true depth, and its standard deviation."""
        slope = np.array([depth_m, 1.0])
        variance_m2 = float(slope @ self.covariance @ slope)
        return (self.scale - 1.0) * depth_m + self.offset_m, float(np.sqrt(variance_m2))


@dataclass(frozen=True, slots=True)
class DisplayCheck:
    """The check that a headset draws as its projections say, observed from outside."""

    made: str
    """Date and time, ISO 8601."""
    observer: Literal["camera", "wearer"]
    device_id: str
    runtime: str
    app: str
    """The headset that was checked, as it introduced itself."""
    problems: Mapping[Eye, str]
    """Fault of each eye that was checked, in one line; empty if it obeys."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "problems", MappingProxyType(dict(self.problems)))


@dataclass(frozen=True, slots=True, eq=False)
class Rig:
    """The offline calibration: both eye displays and the pose of the depth camera."""

    name: str
    eyes: Mapping[Eye, EyeDisplay]
    T_H_D: Float64
    """(4, 4); from the depth camera to the headset rig."""
    depth_intrinsics: Intrinsics
    origins: Mapping[RigPart, Origin] = field(default_factory=dict)
    """Origin of each of `RIG_PARTS`, where it is known."""
    depth_camera: CameraIdentity = CameraIdentity()
    headset: HeadsetIdentity | None = None
    depth_check: DepthCheck | None = None
    """The devices of the rig and the check of its depth; empty or None if unknown."""
    display_check: DisplayCheck | None = None
    """The check that the headset draws what it is sent; None if there was none."""

    __repr__ = brief

    def __post_init__(self) -> None:
        freeze(self, "T_H_D", np.float64, 4, 4)
        object.__setattr__(self, "origins", MappingProxyType(dict(self.origins)))
        if set(self.eyes) != set(EYES):
            raise ValueError("Rig.eyes: both left and right are needed")
        object.__setattr__(self, "eyes", MappingProxyType(dict(self.eyes)))

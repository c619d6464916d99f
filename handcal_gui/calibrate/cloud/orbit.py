"""The view of a 3D scene in millimetres: rotation about a centre, orthographic projection."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from handcal.core.types import Float64

_QUARTER_RAD = np.pi / 2
_LEAST_PX_PER_MM, _MOST_PX_PER_MM = 0.05, 50.0


class Direction(Enum):
    """Viewing directions as yaw and pitch in rad; the wearer's view is the front."""

    FRONT = (0.0, 0.0)
    SIDE = (_QUARTER_RAD, 0.0)
    TOP = (0.0, _QUARTER_RAD)
    ASLANT = (-0.4, 0.3)


@dataclass(frozen=True, slots=True)
class Orbit:
    """A turntable view: the vertical stays upright, and the scale is the same everywhere."""

    yaw_rad: float = Direction.ASLANT.value[0]
    pitch_rad: float = Direction.ASLANT.value[1]
    """Rotation of the scene about its vertical, then about the view's horizontal."""
    px_per_mm: float = 1.0
    centre_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """The point of the scene in the centre of the view."""

    @property
    def rotation(self) -> Float64:
        """(3, 3): rotation from the scene's axes to the view's; right, down and away."""
        cy, sy = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        cp, sp = np.cos(self.pitch_rad), np.sin(self.pitch_rad)
        return np.array([[cy, 0.0, sy], [sp * sy, cp, -sp * cy], [-cp * sy, sp, cp * cy]])

    def project(self, points_mm: Float64) -> Float64:
        """Return (N, 3) pixels right, down and away from the centre of the view."""
        px: Float64 = (points_mm - self.centre_mm) @ (self.px_per_mm * self.rotation.T)
        return px

    def looking(self, direction: Direction) -> Orbit:
        """Return the view from one of the given directions."""
        yaw_rad, pitch_rad = direction.value
        return replace(self, yaw_rad=yaw_rad, pitch_rad=pitch_rad)

    def turned(self, yaw_rad: float, pitch_rad: float) -> Orbit:
        """Return the view rotated further; pitch is limited to straight from above or below."""
        pitch_rad = float(np.clip(self.pitch_rad + pitch_rad, -_QUARTER_RAD, _QUARTER_RAD))
        return replace(self, yaw_rad=self.yaw_rad + yaw_rad, pitch_rad=pitch_rad)

    def zoomed(self, factor: float) -> Orbit:
        """Return the view enlarged about its centre."""
        px_per_mm = float(np.clip(factor * self.px_per_mm, _LEAST_PX_PER_MM, _MOST_PX_PER_MM))
        return replace(self, px_per_mm=px_per_mm)

    def panned(self, right_px: float, down_px: float) -> Orbit:
        """Return the view with the scene moved across it."""
        return self._centred(-np.array([right_px, down_px, 0.0]) / self.px_per_mm)

    def fitted(self, corners_mm: Float64, width_px: float, height_px: float) -> Orbit:
        """Return the view with (N, 3) points centred, as large as they fit."""
        at_origin = replace(self, px_per_mm=1.0, centre_mm=(0.0, 0.0, 0.0))
        view_mm = at_origin.project(corners_mm)
        extent_mm = np.maximum(np.ptp(view_mm[:, :2], axis=0), 1e-9)
        px_per_mm = float(np.min([width_px, height_px] / extent_mm))
        middle_mm = 0.5 * (view_mm.min(axis=0) + view_mm.max(axis=0))
        return at_origin._centred(middle_mm).zoomed(px_per_mm)

    def _centred(self, offset_mm: Float64) -> Orbit:
        """Move the centre by an offset right, down and away in the view."""
        x, y, z = self.centre_mm + self.rotation.T @ offset_mm
        return replace(self, centre_mm=(float(x), float(y), float(z)))

"""Fields that several steps have."""

from __future__ import annotations

from PySide6.QtWidgets import QComboBox

from handcal.rig.camera import LensModel
from handcal_gui.widgets.fields import choice
from handcal_gui.widgets.path_field import INTRINSICS_FILES, PathField

_LENSES: dict[LensModel, str] = {
    "none": "No distortion",
    "radial": "k1, k2",
    "full": "k1, k2, p1, p2, k3",
    "rational": "k1 to k6, p1, p2",
}


def intrinsics_field(name: str) -> PathField:
    """Return a field for a file of intrinsics that are solved if there is none."""
    field = PathField(name, "file", INTRINSICS_FILES, "Solved from the images")
    field.setToolTip("OpenCV's FileStorage, ROS's camera_info or handcal's JSON.")
    return field


def lens_field() -> QComboBox:
    """Return a choice of lens models."""
    return choice("lens", "Lens", _LENSES, "Coefficients of distortion to solve for.")

"""Form fields shared by several steps."""

from __future__ import annotations

from PySide6.QtWidgets import QComboBox

from handcal.rig.formats import read_camera
from handcal.rig.lens.camera import LensChoice
from handcal_gui.app.translation import tr
from handcal_gui.widgets.fields import choice
from handcal_gui.widgets.path_field import INTRINSICS_FILES, PathField

LENSES: dict[LensChoice, str] = {
    "auto": tr("The one that fits best"),
    "none": tr("No distortion"),
    "radial": "k1, k2",
    "full": "k1, k2, p1, p2, k3",
    "rational": tr("k1 to k6, p1, p2"),
    "fisheye": tr("Fisheye"),
}


def intrinsics_field(name: str) -> PathField:
    """Return a field for a file of intrinsics, which are solved if it is empty."""
    field = PathField(
        name, "file", INTRINSICS_FILES, tr("Solved from the images"), read=read_camera
    )
    field.setToolTip(
        tr("As OpenCV, ROS, Kalibr, RealSense, Open3D, Azure Kinect or handcal write them.")
    )
    return field


def lens_field() -> QComboBox:
    """Return a choice of lens models."""
    return choice("lens", tr("Lens"), LENSES, tr("Distortion coefficients to solve for."))

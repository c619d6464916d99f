"""Fields for the settings of a calibration."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from PySide6.QtWidgets import QFormLayout, QLabel, QWidget

from handcal.core.types import Method
from handcal.hand.settings import Roi
from handcal_gui.app.theme import SPACING_PX, scale_font
from handcal_gui.app.translation import tr
from handcal_gui.widgets.fields import choice, label_for, number

_METHODS: dict[Method, str] = {
    "consistent": tr("Consistent (recommended)"),
    "linear": tr("Linear"),
    "paper": tr("As in the paper"),
    "icp": tr("Rigid ICP"),
    "icp-open3d": tr("Rigid ICP by Open3D"),
}
_METHOD_HELP = tr(
    "Solver of the eye shift φ from an alignment.\n"
    "Consistent: exact model; robust to cut edges and a rotated hand.\n"
    "Linear: assumes a scale of 1, which underestimates φ3.\n"
    "As in the paper: Hu et al. 2021; slow.\n"
    "Rigid ICP: the paper's baseline; by Open3D the same, if it is installed."
)
_ROIS: dict[Roi, str] = {
    "detector": tr("Colour and depth"),
    "left": tr("Colour and depth, leftmost"),
    "right": tr("Colour and depth, rightmost"),
    "depth": tr("Depth alone"),
}
_ROI_HELP = tr(
    "Method of finding the hand.\n"
    "Colour and depth: the hand detector selects where to search; of several hands\n"
    "the nearest, or the leftmost or rightmost in the camera's image.\n"
    "Depth alone: the nearest hand-sized object."
)
_NEAREST_M, _FARTHEST_M = 0.10, 2.00
_GATE_M = 0.05
"""Least depth of the gate."""


class CalibrationFields(QWidget):
    """A form for the settings of a calibration, and for what else is added to it.

    Parameters
    ----------
    root : str
        Place of the calibration's settings in those that are bound, such as ``calibration.``.
    has_letters : bool
        True if its labels have letters: beside other fields they would not be unique.

    Attributes
    ----------
    fields : dict of str to QWidget
        By the names of their settings, to be bound.
    factors : dict of str to float
        Of `Bound`.
    """

    def __init__(self, root: str, *, has_letters: bool = False) -> None:
        super().__init__()
        self.fields: dict[str, QWidget] = {}
        self.factors = {f"{root}guard.limit_rad": float(np.degrees(1.0))}
        self._has_letters = has_letters
        self._form = QFormLayout(self)
        self._form.setContentsMargins(0, 0, 0, 0)
        self._form.setSpacing(SPACING_PX)
        turned = tr(
            "Limit of the hand's rotation from the cursor, in degrees; beyond it an alignment "
            "is refused."
        )
        nearer = tr("Anything nearer to the camera is ignored; in metres.")
        farther = tr("Anything farther from the camera is ignored; in metres.")
        most_m, least_m = _FARTHEST_M - _GATE_M, _NEAREST_M + _GATE_M
        self._near = number("gateNear", _NEAREST_M, most_m, 0.05, " m", nearer)
        self._far = number("gateFar", least_m, _FARTHEST_M, 0.05, " m", farther)
        self._near.valueChanged.connect(self._limit_gate)
        self._far.valueChanged.connect(self._limit_gate)
        # First: it makes room for the other end.
        self.fields[f"{root}segment.depth_max_m"] = self._far
        guard = number("guard", 1.0, 45.0, 0.5, " °", turned)
        roi = choice("roi", tr("Hand found by"), _ROIS, _ROI_HELP)
        method = choice("method", tr("Solver"), _METHODS, _METHOD_HELP)
        self.add(tr("&Rotation guard"), guard, f"{root}guard.limit_rad")
        self.add(tr("Depth gate &from"), self._near, f"{root}segment.depth_min_m")
        self.add(tr("Depth gate &to"), self._far, f"{root}segment.depth_max_m")
        self.add(tr("&Hand found by"), roi, f"{root}segment.roi")
        self.add(tr("&Solver"), method, f"{root}solve.method")

    def add(self, text: str, field: QWidget, setting: str = "") -> None:
        """Add a field below, for a setting by its name; its meaning is in its tooltip."""
        text = text if self._has_letters else text.replace("&", "")
        self._form.addRow(label_for(field, text), field)
        if setting:
            self.fields[setting] = field

    def add_heading(self, text: str) -> None:
        """Add a heading below, for the fields added next."""
        heading = QLabel(text)
        scale_font(heading, 1.0, is_bold=True)
        heading.setContentsMargins(0, SPACING_PX, 0, 0)
        self._form.addRow(heading)

    @contextmanager
    def any_gate(self) -> Iterator[None]:
        """Take any depth gate meanwhile, as one end is shown before the other."""
        self._near.setMaximum(_FARTHEST_M - _GATE_M)
        self._far.setMinimum(_NEAREST_M + _GATE_M)
        yield
        self._limit_gate()

    def _limit_gate(self) -> None:
        """Keep the gate open: neither end moves the other."""
        self._near.setMaximum(self._far.value() - _GATE_M)
        self._far.setMinimum(self._near.value() + _GATE_M)

"""Fields for the settings of a calibration."""

from __future__ import annotations

import numpy as np
from PySide6.QtCore import Signal
from PySide6.QtGui import QPalette
from PySide6.QtWidgets import QGridLayout, QLabel, QWidget

from handcal.calibration.states import CalibrationSettings
from handcal.core.types import Method
from handcal.hand.settings import Roi
from handcal.station.checks.doctor import Finding
from handcal_gui.app.theme import SPACING_PX, scale_font
from handcal_gui.app.translation import tr
from handcal_gui.widgets.entries_form import Bound
from handcal_gui.widgets.fields import choice, label_for, number
from handcal_gui.widgets.finding_line import FindingLine

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
    """Fields for rotation guard, depth gate, hand search and solver.

    Parameters
    ----------
    explains : bool
        True if each field's meaning is shown beside it; it is always in the tooltip.

    Attributes
    ----------
    changed : Signal()
    gate_found : FindingLine
        The problem of the depth gate beside it, hidden while there is none.
    """

    changed = Signal()

    def __init__(self, parent: QWidget | None = None, *, explains: bool = False) -> None:
        super().__init__(parent)
        self._explains = explains
        self._guard = number(
            "guard",
            1.0,
            45.0,
            0.5,
            " °",
            tr(
                "Limit of the hand's rotation from the cursor, in degrees; beyond it an alignment "
                "is refused."
            ),
        )
        self._near = number(
            "gateNear",
            _NEAREST_M,
            _FARTHEST_M - _GATE_M,
            0.05,
            " m",
            tr("Anything nearer to the camera is ignored; in metres."),
        )
        self._far = number(
            "gateFar",
            _NEAREST_M + _GATE_M,
            _FARTHEST_M,
            0.05,
            " m",
            tr("Anything farther from the camera is ignored; in metres."),
        )
        self._roi = choice("roi", tr("Hand found by"), _ROIS, _ROI_HELP)
        self._method = choice("method", tr("Solver"), _METHODS, _METHOD_HELP)
        self.gate_found = FindingLine("gate")
        if (layout := self.gate_found.layout()) is not None:
            layout.setContentsMargins(0, 0, 0, 0)  # no higher than two rows of fields
        self.gate_found.hide()
        self._grid = QGridLayout(self)
        self._grid.setContentsMargins(0, 0, 0, 0)
        self._grid.setHorizontalSpacing(2 * SPACING_PX if explains else SPACING_PX)
        self._grid.setVerticalSpacing(SPACING_PX // 2 if explains else SPACING_PX)
        self._grid.setColumnStretch(2, 1)
        if explains:
            self.add_heading(tr("For the next calibrations"))
        turned = tr("The hand may be rotated this much from the cursor.")
        self.add_row(tr("&Rotation guard"), self._guard, turned)
        gate_row = self._grid.rowCount()
        nearest = tr("Nearest distance of the hand from the depth camera.")
        farthest = tr("Farthest distance of the hand from the depth camera.")
        self._gate_meanings = (
            self.add_row(tr("Depth gate &from"), self._near, nearest),
            self.add_row(tr("Depth gate &to"), self._far, farthest),
        )
        self._grid.addWidget(self.gate_found, gate_row, 2, 2, 1)  # in place of both meanings
        self.add_row(tr("&Hand found by"), self._roi, tr("Finds the hand in the camera's images."))
        solves = tr("Computes where the eyes are from each alignment.")
        self.add_row(tr("&Solver"), self._method, solves)
        self._near.valueChanged.connect(self._limit_gate)
        self._far.valueChanged.connect(self._limit_gate)
        self._bound = Bound(
            {
                "guard.limit_rad": self._guard,
                "segment.depth_max_m": self._far,
                "segment.depth_min_m": self._near,
                "segment.roi": self._roi,
                "solve.method": self._method,
            },
            {"guard.limit_rad": float(np.degrees(1.0))},
            self,
        )
        self._bound.changed.connect(self.changed)

    def show_settings(self, settings: CalibrationSettings) -> None:
        """Show settings."""
        self._near.setMaximum(_FARTHEST_M - _GATE_M)  # whatever is shown
        self._far.setMinimum(_NEAREST_M + _GATE_M)
        self._bound.show(settings)
        self._limit_gate()

    def take(self, settings: CalibrationSettings) -> CalibrationSettings:
        """Return settings with the entered values."""
        return self._bound.take(settings)

    def add_row(self, text: str, field: QWidget, meaning: str = "") -> QLabel | None:
        """Add a field below, and return its meaning beside it if the form explains fields.

        Only then has the label a letter: beside others the letters would not be unique.
        """
        row = self._grid.rowCount()
        label = label_for(field, text if self._explains else text.replace("&", ""))
        self._grid.addWidget(label, row, 0)
        if not (self._explains and meaning):
            self._grid.addWidget(field, row, 1, 1, 2)
            return None
        self._grid.addWidget(field, row, 1)
        explained = QLabel(meaning)
        explained.setForegroundRole(QPalette.ColorRole.PlaceholderText)
        self._grid.addWidget(explained, row, 2)
        return explained

    def add_line(self, line: QWidget) -> None:
        """Add a widget below that takes the whole width beside the labels."""
        self._grid.addWidget(line, self._grid.rowCount(), 1, 1, 2)

    def show_gate_problem(self, problem: Finding | None) -> None:
        """Show what is wrong with the depth gate in place of what it means."""
        self.gate_found.setVisible(problem is not None)
        for meaning in filter(None, self._gate_meanings):
            meaning.setVisible(problem is None)
        if problem is not None:
            self.gate_found.show_finding(problem)

    def add_heading(self, text: str) -> None:
        """Add a heading below, for the fields added next."""
        heading = QLabel(text)
        scale_font(heading, 1.0, is_bold=True)
        heading.setContentsMargins(0, SPACING_PX, 0, 0)
        self._grid.addWidget(heading, self._grid.rowCount(), 0, 1, 3)

    def _limit_gate(self) -> None:
        """Keep the gate open: neither end moves the other."""
        self._near.setMaximum(self._far.value() - _GATE_M)
        self._far.setMinimum(self._near.value() + _GATE_M)

"""The controls of the fine-tuning panel, for its tests."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtGui import QAction
from PySide6.QtWidgets import (
    QDoubleSpinBox,
    QLabel,
    QWidget,
)

from handcal.core.types import Eye
from handcal_gui.calibrate.fine_tune.panel import FineTunePanel

Show = Callable[..., None]


def editor(panel: FineTunePanel, eye: Eye) -> QWidget:
    [editor] = panel.findChildren(QWidget, f"{eye}Editor")
    return editor


def field(panel: FineTunePanel, eye: Eye, component: int) -> QDoubleSpinBox:
    [field] = editor(panel, eye).findChildren(QDoubleSpinBox, f"phi{component}")
    return field


def fields_mm(panel: FineTunePanel, eye: Eye) -> list[float]:
    return [field(panel, eye, component).value() for component in (1, 2, 3)]


def status(panel: FineTunePanel) -> str:
    [status] = panel.findChildren(QLabel, "status")
    return status.text()


def action(panel: FineTunePanel, text: str) -> QAction:
    return next(action for action in panel.actions() if action.text() == text)


def texts(widget: QWidget) -> list[str]:
    return [label.text() for label in widget.findChildren(QLabel)]

"""Screenshots of the window and its panels, for the guide and for checking changes."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QEvent
from PySide6.QtWidgets import QApplication, QWidget

from handcal.core.errors import FileError
from handcal.io.files import make_folder
from handcal_gui.calibrate.guide.view import STEPS, Step, WizardView


class Screenshots:
    """Saves screenshots as PNG files in a folder.

    Parameters
    ----------
    window : QWidget
    folder : Path
        Created if needed.

    Raises
    ------
    FileError
        If the folder cannot be created.
    """

    def __init__(self, window: QWidget, folder: Path) -> None:
        self._window = window
        self._folder = make_folder(folder)
        self._seen: dict[Step, set[str]] = {}

    def save_step(self, view: WizardView) -> None:
        """Save the window the first time that a step shows a main button."""
        seen = self._seen.setdefault(view.step, set())
        label = view.main.label
        if label in seen:
            return
        again = f"-{label}" if seen else ""
        seen.add(label)
        name = f"step-{STEPS.index(view.step) + 1}-{view.step.value}{again}"
        self.save(name.lower().replace(" ", "-"))

    def save(self, name: str, widget: QWidget | None = None) -> None:
        """Save a widget, by default the window; raise FileError if it cannot be written."""
        # A view that is just changing would be pictured with the layout of the former one.
        QApplication.sendPostedEvents(None, QEvent.Type.LayoutRequest.value)
        path = self._folder / f"{name}.png"
        if not (widget or self._window).grab().save(str(path)):
            raise FileError(f"cannot write {path}")

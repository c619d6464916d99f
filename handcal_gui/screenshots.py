"""Pictures of the window and its panels, for the guide and for looking at what has changed."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtWidgets import QApplication, QWidget

from handcal.errors import FileError
from handcal.files import make_folder
from handcal_gui.window import MainWindow
from handcal_gui.wizard.steps import STEPS, Step, View


class Screenshots:
    """Saves PNGs into a folder.

    Parameters
    ----------
    window : MainWindow
    folder : Path
        Created if needed.

    Raises
    ------
    FileError
        If the folder cannot be created.
    """

    def __init__(self, window: MainWindow, folder: Path) -> None:
        self._window = window
        self._folder = make_folder(folder)
        self._seen: set[Step] = set()

    def save_step(self, view: View) -> None:
        """Save the window the first time that a step is shown."""
        if view.step not in self._seen:
            self._seen.add(view.step)
            name = view.step.value.lower().replace(" ", "-")
            self.save(f"step-{STEPS.index(view.step) + 1}-{name}")

    def save_panels(self) -> None:
        """Save every panel that belongs to the page, at the size it has in its dock."""
        docks = self._window.docks
        front = [dock for dock in docks.values() if not dock.visibleRegion().isEmpty()]
        for name, dock in docks.items():
            if dock.isHidden():
                continue
            dock.raise_()
            QApplication.processEvents()
            self.save(f"panel-{name.replace('_', '-')}", dock.widget())
        for dock in front:
            dock.raise_()

    def save(self, name: str, widget: QWidget | None = None) -> None:
        """Save a widget, by default the window; FileError if it cannot be written."""
        path = self._folder / f"{name}.png"
        if not (widget or self._window).grab().save(str(path)):
            raise FileError(f"cannot write {path}")

"""A path to type, or to choose in a dialog."""

from __future__ import annotations

from typing import Literal

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QFileDialog, QLineEdit, QWidget

from handcal_gui.widgets.fields import beside, button

INTRINSICS_FILES = "Intrinsics: OpenCV, ROS, handcal (*.yaml *.yml *.json)"
"""Pattern of the files that hold a camera's intrinsics."""


class PathField(QWidget):
    """A line with a button beside it, or two where file and folder will both do.

    Parameters
    ----------
    name : str
        What is chosen, as the dialog's title says: "Rig file".
    kind : {"file", "folder", "either"}
    pattern : str
        Of the files offered, as `QFileDialog` takes it: ``"Recordings (*.db3 *.bag)"``.
    empty : str
        What no path means; shown in place of it.

    Attributes
    ----------
    name : str
    changed : Signal()
    """

    changed = Signal()

    def __init__(
        self,
        name: str,
        kind: Literal["file", "folder", "either"],
        pattern: str = "",
        empty: str = "",
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self.name = name
        self._pattern = pattern
        self._line = QLineEdit(placeholderText=empty, clearButtonEnabled=bool(empty))
        self._line.setAccessibleName(name)
        self._line.textChanged.connect(self.changed)
        buttons = []
        for one, ask in (("file", self.choose_file), ("folder", self.choose_folder)):
            if kind in (one, "either"):
                text = f"{one.capitalize()}…" if kind == "either" else "Choose…"
                buttons.append(button(f"{one}Choice", text, f"Choose {name.lower()}"))
                buttons[-1].clicked.connect(ask)
        beside(self, self._line, *buttons, grows=self._line)
        self.setFocusProxy(self._line)

    @property
    def path(self) -> str:
        """What the line says, without blanks around it."""
        return str(self._line.text()).strip()

    def set_path(self, path: str) -> None:
        """Show a path, with its end in view."""
        if path != self.path:
            self._line.setText(path)

    def choose_file(self) -> None:
        """Ask for a file in the system's dialog."""
        chosen, _ = QFileDialog.getOpenFileName(self, self.name, self.path, self._pattern)
        self.set_path(chosen or self.path)

    def choose_folder(self) -> None:
        """Ask for a folder in the system's dialog."""
        chosen = QFileDialog.getExistingDirectory(self, self.name, self.path)
        self.set_path(chosen or self.path)

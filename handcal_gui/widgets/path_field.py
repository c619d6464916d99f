"""A field for a path, typed or chosen in a dialog."""

from __future__ import annotations

from typing import Literal

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QFileDialog, QLineEdit, QWidget

from handcal_gui.translation import tr
from handcal_gui.widgets.fields import button, fill_row

INTRINSICS_FILES = tr("Intrinsics: OpenCV, ROS, handcal (*.yaml *.yml *.json)")
"""File filter for a camera's intrinsics."""


class PathField(QWidget):
    """A line edit with a button, or two buttons if both a file and a folder are accepted.

    Parameters
    ----------
    name : str
        Title of the dialog, such as "Rig file".
    kind : {"file", "folder", "either"}
    pattern : str
        File filter of `QFileDialog`, such as ``"Recordings (*.db3 *.bag)"``.
    empty : str
        Placeholder that explains the meaning of an empty path.

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
        for one, title, ask in (
            ("file", tr("File…"), self.choose_file),
            ("folder", tr("Folder…"), self.choose_folder),
        ):
            if kind in (one, "either"):
                text = title if kind == "either" else tr("Choose…")
                buttons.append(button(f"{one}Choice", text, tr("Choose {}").format(name.lower())))
                buttons[-1].clicked.connect(ask)
        fill_row(self, self._line, *buttons, grows=self._line)
        self.setFocusProxy(self._line)

    @property
    def path(self) -> str:
        """The entered path, without surrounding blanks."""
        return str(self._line.text()).strip()

    def set_path(self, path: str) -> None:
        """Show a path, scrolled to its end."""
        if path != self.path:
            self._line.setText(path)

    def choose_file(self) -> None:
        """Choose a file in the system's dialog."""
        chosen, _ = QFileDialog.getOpenFileName(self, self.name, self.path, self._pattern)
        self.set_path(chosen or self.path)

    def choose_folder(self) -> None:
        """Choose a folder in the system's dialog."""
        chosen = QFileDialog.getExistingDirectory(self, self.name, self.path)
        self.set_path(chosen or self.path)

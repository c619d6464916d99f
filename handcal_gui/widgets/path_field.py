"""A field for a path, typed or chosen in a dialog."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Literal

from PySide6.QtCore import Qt, SignalInstance
from PySide6.QtGui import QKeySequence, QShortcut
from PySide6.QtWidgets import (
    QFileDialog,
    QLineEdit,
    QPushButton,
    QWidget,
)

from handcal.core.errors import HandcalError
from handcal.io.files import user_path
from handcal_gui.app.keys import native
from handcal_gui.app.translation import tr
from handcal_gui.widgets.fields import button, fill_row, plain_tooltip

_KEY = "F4"
"""Opens the dialog of the field that has the focus, as it opens a list."""


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
    parent : QWidget or None
    read : callable, optional
        Reads the file; HandcalError if it cannot be used.

    Attributes
    ----------
    name : str
    """

    def __init__(
        self,
        name: str,
        kind: Literal["file", "folder", "either"],
        pattern: str = "",
        empty: str = "",
        parent: QWidget | None = None,
        read: Callable[[Path], object] | None = None,
    ) -> None:
        super().__init__(parent)
        self.name = name
        self._read = read
        self._checked: tuple[Path, int] | None = None
        self._problem = ""
        self._pattern = pattern
        self._line = QLineEdit(placeholderText=empty, clearButtonEnabled=bool(empty))
        self._line.setAccessibleName(name)
        self._line.textChanged.connect(self._show_whole_path)
        buttons: list[QPushButton] = []
        for one, title, ask in (
            ("file", tr("File…"), self.choose_file),
            ("folder", tr("Folder…"), self.choose_folder),
        ):
            if kind in (one, "either"):
                text = title if kind == "either" else tr("Choose…")
                keys = f"Shift+{_KEY}" if buttons else _KEY
                chosen = tr("Choose {}").format(name.lower())
                help_text = tr("{} ({} in the field)").format(chosen, native(keys))
                buttons.append(button(f"{one}Choice", text, chosen, help_text))
                buttons[-1].clicked.connect(ask)
                shortcut = QShortcut(QKeySequence(keys), self)
                shortcut.setContext(Qt.ShortcutContext.WidgetWithChildrenShortcut)
                shortcut.activated.connect(ask)
        fill_row(self, self._line, *buttons, grows=self._line)
        self.setFocusProxy(self._line)

    @property
    def changed(self) -> SignalInstance:
        """The signal of another path."""
        return self._line.textChanged

    @property
    def path(self) -> str:
        """The entered path, without surrounding blanks."""
        return str(self._line.text()).strip()

    @property
    def problem(self) -> str:
        """Return why the file cannot be used; empty if it can, or there is none to read."""
        if self._read is None or not self.path:
            return ""
        file, mark = user_path(self.path), None
        with suppress(OSError):
            mark = file, file.stat().st_mtime_ns
        if mark is None or mark != self._checked:
            self._checked, self._problem = mark, ""
            try:
                self._read(file)
            except HandcalError as error:
                self._problem = str(error)
        return self._problem

    def set_path(self, path: str) -> None:
        """Show a path."""
        if path != self.path:
            self._line.setText(path)

    def setToolTip(self, text: str) -> None:
        """Explain the field; the tooltip of the line has the whole path, too."""
        super().setToolTip(text)
        self._show_whole_path()

    def choose_file(self) -> None:
        """Choose a file in the system's dialog."""
        chosen, _ = QFileDialog.getOpenFileName(self, self.name, self.path, self._pattern)
        self.set_path(chosen or self.path)

    def choose_folder(self) -> None:
        """Choose a folder in the system's dialog."""
        chosen = QFileDialog.getExistingDirectory(self, self.name, self.path)
        self.set_path(chosen or self.path)

    def _show_whole_path(self) -> None:
        text = "\n".join(filter(None, (self.path, self.toolTip())))
        self._line.setToolTip(plain_tooltip(text))

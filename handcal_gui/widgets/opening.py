"""Opening files and folders with the system's programs for them."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import Qt, QUrl
from PySide6.QtGui import QDesktopServices, QGuiApplication
from PySide6.QtWidgets import QMessageBox, QWidget

from handcal_gui.app.translation import tr


def open_path(window: QWidget, path: Path) -> None:
    """Open a file or a folder; if no program does, say where it is."""
    text = str(path.absolute())
    if QDesktopServices.openUrl(QUrl.fromLocalFile(text)):
        return
    told = tr("No program opened it; the folder is at\n{}")
    if not path.is_dir():
        told = tr("No program opened it; the file is at\n{}")
    box = QMessageBox(QMessageBox.Icon.Information, "handcal", told.format(text), parent=window)
    box.setTextFormat(Qt.TextFormat.PlainText)
    box.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
    copy = box.addButton(tr("&Copy path"), QMessageBox.ButtonRole.AcceptRole)
    copy.clicked.connect(lambda: QGuiApplication.clipboard().setText(text))
    box.addButton(QMessageBox.StandardButton.Close)
    box.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    box.open()

"""A field for a secret, shown or copied on demand."""

from __future__ import annotations

from PySide6.QtWidgets import QLineEdit, QWidget

from handcal_gui.app.translation import tr
from handcal_gui.widgets.brief import copy_text
from handcal_gui.widgets.fields import button, fill_row, with_name


class KeyField(QWidget):
    """The pairing key, hidden until requested.

    Parameters
    ----------
    copy : str
        Text of the button that copies it, so that its letter can be its own.
    """

    def __init__(self, copy: str = tr("Co&py"), parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._key = with_name(
            QLineEdit(readOnly=True),
            "pairingKey",
            tr("Pairing key"),
            tr("Enter this key in the headset and nowhere else: any device with it can connect."),
        )
        self._reveal = button("showKey", tr("Show &key"), tr("Show the pairing key"))
        self._reveal.setMinimumWidth(self._reveal.sizeHint().width())
        self._reveal.setCheckable(True)
        copies = button("copyKey", copy, tr("Copy the pairing key"))
        fill_row(self, self._key, self._reveal, copies, grows=self._key)
        self.setFocusProxy(self._key)
        self._reveal.toggled.connect(self._show)
        copied = tr("Copied: the pairing key")
        copies.clicked.connect(lambda: copy_text(copies, self._key.text(), copied))
        self._show(False)

    def set_key(self, key: str) -> None:
        """Set another key, hidden at first."""
        self._key.setText(key)
        self._key.setCursorPosition(0)
        self._reveal.setChecked(False)

    def _show(self, is_shown: bool) -> None:
        modes = QLineEdit.EchoMode
        self._key.setEchoMode(modes.Normal if is_shown else modes.Password)
        self._reveal.setText(tr("Hide &key") if is_shown else tr("Show &key"))

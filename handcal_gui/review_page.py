"""The page of a finished session: what it is, and what may be done with it."""

from __future__ import annotations

from datetime import datetime

import numpy as np
from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QHBoxLayout, QLabel, QVBoxLayout, QWidget

from handcal.results import Results
from handcal.session import SessionRecord
from handcal_gui.fields import button
from handcal_gui.theme import SPACING_PX


class ReviewPage(QWidget):
    """Says what a session holds; the panels show it.

    Attributes
    ----------
    export_requested, resume_requested, close_requested : Signal()
    """

    export_requested = Signal()
    resume_requested = Signal()
    close_requested = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("reviewPage")
        self._title = QLabel()
        font = self._title.font()
        font.setPointSizeF(1.6 * font.pointSizeF())
        font.setBold(True)
        self._title.setFont(font)
        self._text = QLabel(wordWrap=True)
        self._text.setObjectName("reviewText")
        self._text.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self._text.setTextFormat(Qt.TextFormat.PlainText)
        self._export = button("reviewExport", "&Export…")
        self._resume = button("reviewResume", "&Go on with this session")
        self._resume.setToolTip("Open camera and headset, and add alignments, φ or trials to it")
        close = button("reviewClose", "&Close session")
        self._export.setDefault(True)
        self._export.clicked.connect(self.export_requested)
        self._resume.clicked.connect(self.resume_requested)
        close.clicked.connect(self.close_requested)
        buttons = QHBoxLayout()
        buttons.addWidget(self._export)
        buttons.addWidget(self._resume)
        buttons.addStretch()
        buttons.addWidget(close)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(*4 * (2 * SPACING_PX,))
        layout.setSpacing(2 * SPACING_PX)
        layout.addWidget(self._title)
        layout.addWidget(self._text)
        layout.addLayout(buttons)
        layout.addStretch()

    def show_session(self, record: SessionRecord, results: Results | None, note: str = "") -> None:
        """Show a session, solved again if it can be.

        Parameters
        ----------
        record : SessionRecord
        results : Results or None
            None while it is being solved, or if it cannot be.
        note : str
            What goes on, or why there are no results.
        """
        self._title.setText(record.wearer or "Session without a name")
        self._export.setEnabled(bool(record.alignments))
        started = datetime.fromisoformat(record.events[0].time).astimezone()
        lines = [
            f"{started:%d %B %Y, %H:%M}   ·   rig {record.rig.name}",
            f"{_count(len(record.alignments), 'alignment')}, {_count(len(record.trials), 'trial')}"
            f"   ·   {'finished' if record.is_finished else 'not finished'}",
            str(record.path),
            "",
        ]
        if results is not None:
            for eye, shift in results.shifts.items():
                phi_mm = "  ".join(f"{value:+.2f}" for value in np.multiply(1e3, shift.shift_m))
                verdict = results.verdicts[eye]
                lines.append(f"{eye.capitalize()} eye   φ = {phi_mm} mm   {verdict.name}")
                lines.append(f"    {verdict.reason}")
        lines.append(note)
        if record.torn_bytes:
            lines.append("The last line of its journal is unfinished, as after a crash.")
        self._text.setText("\n".join(lines).rstrip())


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"

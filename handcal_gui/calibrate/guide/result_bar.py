"""The result of a running calibration, with the buttons that pass it on."""

from __future__ import annotations

from collections.abc import Mapping

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QPagedPaintDevice, QTextDocument
from PySide6.QtWidgets import QWidget

from handcal.core.types import Eye
from handcal.register.results import Results
from handcal.register.verdict import VerdictSettings
from handcal.session.judged_trials import EyeTrials, eye_trials
from handcal.session.session import SessionRecord
from handcal.station.snapshot import Snapshot
from handcal_gui.app.keys import add_action
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.parts.result_card import ResultCard, result_text
from handcal_gui.widgets.brief import copy_text
from handcal_gui.widgets.fields import tool_button
from handcal_gui.widgets.layouts import hbox, vbox
from handcal_gui.widgets.printing import ask_printer
from handcal_gui.widgets.result_rows import EYE_NAMES, fine_tuned_texts
from handcal_gui.widgets.times import local_time


class ResultBar(QWidget):
    """The result card; its buttons to blink, copy and print stand elsewhere.

    Attributes
    ----------
    buttons : QWidget
    card : ResultCard
    blink_toggled : Signal(bool)
        Before and after should be shown in turn, or no longer.
    """

    blink_toggled = Signal(bool)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("resultBar")
        self._results: Results | None = None
        self._target_arcmin = VerdictSettings().target_arcmin
        self._record: SessionRecord | None = None
        self.card = ResultCard()
        self._blink = add_action(
            self, tr("Bl&ink before/after"), "", tooltip=tr("Show both in turn")
        )
        self._blink.setCheckable(True)
        self._blink.toggled.connect(self.blink_toggled)
        copy = add_action(self, tr("Cop&y"), "", self.copy, tooltip=tr("Copy the result as text"))
        window = Qt.ShortcutContext.WindowShortcut
        ask = add_action(self, tr("Print the result"), "Ctrl+P", self._ask_printer, context=window)
        ask.setIconText(tr("Print… (Ctrl+P)"))
        self._blink_button, *others = map(tool_button, (self._blink, copy, ask))
        self.buttons = QWidget()
        hbox(self._blink_button, *others, on=self.buttons, margins=0, spacing=SPACING_PX)
        vbox(self.card, on=self, margins=0)

    def show_snapshot(self, snapshot: Snapshot) -> None:
        """Show the results of a snapshot if they have changed."""
        results, shown = snapshot.procedure.results, self._record
        is_written = shown is None or snapshot.record.trials is not shown.trials
        self._record = snapshot.record
        self._target_arcmin = snapshot.settings.solve.verdict.target_arcmin
        if results is not self._results or is_written:
            self._results = results
            self.card.show_results(results, self._target_arcmin, self._trials())

    def offer_blinking(self, is_offered: bool) -> None:
        """Offer to show before and after in turn, where they are in sight."""
        self._blink_button.setVisible(is_offered)
        if not is_offered:
            self._blink.setChecked(False)

    def text(self) -> str:
        """Return the result as text; empty if there is none."""
        if self._results is None or self._record is None:
            return ""
        head = dict(_head(self._record))
        for eye, phi in fine_tuned_texts(self._results, self._record).items():
            head[tr("{}, fine-tuned").format(EYE_NAMES[eye])] = phi
        if self._record.went_back:
            head[tr("Drawn and exported")] = tr("with another φ, after going back")
        return result_text(self._results, self._target_arcmin, head, self._trials())

    def _trials(self) -> Mapping[Eye, EyeTrials]:
        if self._results is None or self._record is None:
            return {}
        return eye_trials(self._results, self._record, self._target_arcmin)

    def copy(self) -> None:
        """Copy the result as text."""
        copy_text(self.buttons, self.text(), tr("Copied: the result"))

    def print_to(self, printer: QPagedPaintDevice) -> None:
        """Print the result as text."""
        document = QTextDocument()
        document.setPlainText(self.text())
        document.print_(printer)

    def _ask_printer(self) -> None:
        ask_printer(self.buttons, self.print_to)


def _head(record: SessionRecord) -> Mapping[str, str]:
    return {
        tr("Wearer"): record.wearer or tr("without a name"),
        tr("Started"): local_time(record.events[0].time),
        tr("Rig"): record.rig.name,
        tr("Session"): record.path.name,
    }

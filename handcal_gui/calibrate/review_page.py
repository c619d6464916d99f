"""The page of a stored session: a summary, and buttons to export or resume it."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFormLayout, QLabel, QWidget

from handcal.register.results import Results
from handcal.session.session import SessionRecord
from handcal_gui.app.theme import SPACING_PX, scale_font
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.parts.result_card import ResultCard
from handcal_gui.widgets.elided_label import ElidedLabel
from handcal_gui.widgets.fields import button, main_button, paragraph
from handcal_gui.widgets.layouts import hbox, vbox
from handcal_gui.widgets.numbers import pluralize
from handcal_gui.widgets.sentence import sentence
from handcal_gui.widgets.session_rows import RESUME_HELP, session_facts

_EXPORT = tr("Look at the result, then export it, or resume the session to add to it.")
_RESUME = tr("Resume the session to make its first alignment.")


class ReviewPage(QWidget):
    """A summary of a session; the panels show its contents.

    Attributes
    ----------
    export_button, openxr_button, resume_button, again_button, close_button : QPushButton
        *again_button*: the wearer is to be calibrated again, beginning from this session.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("reviewPage")
        self._title: QLabel = ElidedLabel()
        scale_font(self._title, 1.6, is_bold=True)
        self._task = paragraph("reviewTask")
        self._facts = QFormLayout()
        self._facts.setHorizontalSpacing(2 * SPACING_PX)
        self._facts.setVerticalSpacing(SPACING_PX)
        self._card = ResultCard(is_explained=True)
        self.export_button = main_button("reviewExport", tr("E&xport…"))
        self.openxr_button = button("reviewOpenxr", tr("&Use in XR"))
        self.openxr_button.setToolTip(tr("Use for every OpenXR program on this computer"))
        self.resume_button = button("reviewResume", tr("&Resume"))
        self.resume_button.setToolTip(RESUME_HELP)
        self.again_button = button("reviewAgain", tr("Calibrate &again"))
        self.again_button.setToolTip(
            tr(
                "For the same wearer again, or after the headset has slipped: starts from "
                "this result and first verifies each eye"
            )
        )
        self.close_button = button("reviewClose", tr("Clo&se"))
        buttons = hbox(
            self.export_button,
            self.openxr_button,
            self.resume_button,
            self.again_button,
            0,
            self.close_button,
        )
        vbox(
            self._title,
            self._task,
            self._facts,
            self._card,
            buttons,
            0,
            on=self,
            margins=2 * SPACING_PX,
            spacing=2 * SPACING_PX,
        )

    def show_session(
        self,
        record: SessionRecord,
        results: Results | None,
        target_arcmin: float,
        note: str = "",
    ) -> None:
        """Show a session and, if it has been solved, its results.

        Parameters
        ----------
        record : SessionRecord
        results : Results or None
            None while it is being solved, or if it cannot be solved.
        target_arcmin : float
            The lab's target when the session was made.
        note : str
            The current activity, or the reason why there are no results or alignments.
        """
        self.show_wearer(record.wearer)
        self.export_button.setEnabled(record.is_solvable)
        self.openxr_button.setEnabled(record.is_solvable)
        self.again_button.setEnabled(results is not None)
        self._task.setText(_EXPORT if record.is_solvable else _RESUME)
        self._card.show_results(results, record, target_arcmin)
        self._card.setVisible(results is not None)
        while self._facts.rowCount():
            self._facts.removeRow(0)
        for name, (caption, fact) in _facts(record, note).items():
            text = paragraph(f"review{name}", fact)
            text.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
            self._facts.addRow(QLabel(caption, alignment=Qt.AlignmentFlag.AlignTop), text)

    def show_wearer(self, wearer: str) -> None:
        """Show the wearer's name as the title."""
        self._title.setText(wearer or tr("Session without a name"))


def _facts(record: SessionRecord, note: str) -> dict[str, tuple[str, str]]:
    """Return the caption and the text of each fact about a session, by its name."""
    state = tr("finished") if record.is_finished else tr("not finished")
    alignments, verified = len(record.alignments), len(record.facts.verified)
    counts = (
        pluralize(verified, tr("verified eye"), tr("verified eyes"))
        if verified and not alignments
        else pluralize(alignments, tr("alignment"), tr("alignments")),
        pluralize(len(record.trials), tr("trial"), tr("trials")),
    )
    facts = {name: (name, fact) for name, fact in session_facts(record).items()}
    facts["Contents"] = tr("Contents"), f"{', '.join(counts)}; {state}"
    facts["Folder"] = tr("Folder"), str(record.path)
    if note:
        facts["Note"] = tr("Note"), note
    if record.left_out:
        advice = tr("Repair, in All sessions (Ctrl+L), copies what is sound.")
        facts["Damaged"] = tr("Damaged"), f"{sentence(record.left_out)}. {advice}"
    if record.torn_bytes:
        facts["Journal"] = tr("Journal"), tr("The last line is incomplete, as after a crash.")
    return facts

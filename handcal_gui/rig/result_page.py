"""The last step: checking, comparing and saving the rig."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QHideEvent, QPixmap
from PySide6.QtWidgets import (
    QFormLayout,
    QHBoxLayout,
    QLineEdit,
    QMessageBox,
    QTabWidget,
    QWidget,
)

from handcal.core.entry import RIG_FILES
from handcal.core.errors import FileError, HandcalError
from handcal.core.types import PART_NAMES, RIG_PARTS, Rig
from handcal.io.files import user_path
from handcal.rig.findings import RigFinding, report_rig
from handcal.rig.plausible import MAX_NAME
from handcal.rig.rig_file import read_rig
from handcal.station.checks.doctor import Finding, Health
from handcal_gui.app.theme import SPACING_PX, colors, follow_theme, icon
from handcal_gui.app.translation import tr
from handcal_gui.rig.accept_dialog import AcceptDialog
from handcal_gui.rig.file_dialogs import ask_save
from handcal_gui.rig.project import RigProject
from handcal_gui.rig.rows import COLUMNS, difference_rows, rig_rows
from handcal_gui.rig.step_inputs import STEP_TITLES
from handcal_gui.widgets.action_strip import action_strip
from handcal_gui.widgets.fields import (
    button,
    label_for,
    main_button,
    make_linked,
    paragraph,
    with_name,
)
from handcal_gui.widgets.finding_line import FindingLine
from handcal_gui.widgets.layouts import vbox
from handcal_gui.widgets.path_field import PathField
from handcal_gui.widgets.sentence import sentence
from handcal_gui.widgets.table import Column, Row, Table
from handcal_gui.widgets.times import local_time

_CHECKS = "docs/tutorial.md#7-check-depth-and-displays"
_HOW = tr(
    "The depth and the displays are checked outside this window: "
    '<a href="{}">how to check them</a>.'
)
_TIME = re.compile(r"\d{4}-\d\d-\d\dT[\d:.]+(\+\d\d:\d\d|Z)?")
"""ISO 8601."""


class ResultPage(QWidget):
    """Shows the findings on the rig and its numbers, compares it with others, and saves it.

    Parameters
    ----------
    project : RigProject
    read : callable
        Shows a page of the manual.
    use : callable
        Takes a rig file for the next calibration.
    """

    def __init__(
        self,
        project: RigProject,
        read: Callable[[str], object] = lambda _page: None,
        use: Callable[[Path], object] = lambda _rig: None,
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self.setObjectName("resultPage")
        self._project = project
        self._use_rig = use
        self._acceptance: AcceptDialog | None = None
        self._name = with_name(QLineEdit(maxLength=MAX_NAME), "rigName", tr("Name of the rig"))
        self._name_problem = paragraph(
            "rigNameProblem", tr("Enter a name of printable characters, to save the rig.")
        )
        self._findings = Table("rigFindings", tr("Check of the rig"), wraps=True)
        self._findings.setIconSize(QSize(2 * SPACING_PX, 2 * SPACING_PX))
        self._how = make_linked(paragraph("howToCheck", _HOW.format(_CHECKS)))
        self._how.linkActivated.connect(read)
        self._numbers = Table("numbers-of-the-rig", tr("Numbers of the rig"))
        self._other = PathField(tr("Rig file to compare with"), "file", RIG_FILES)
        self._differences = Table("differences", tr("Differences"))
        self._compared = FindingLine("compared")
        self._end = FindingLine("savedRig")
        self.main = main_button("saveRig", tr("&Save rig file…"))
        self.strip = action_strip(self.main)
        self._accept = button(
            "acceptRig",
            tr("&Accept…"),
            help_text=tr("Check what the displays draw, with a camera at the eye position"),
        )
        self._use = button("useRig", tr("&Use for the next calibration"))
        self._lay_out()
        self.enter()
        self._other.changed.connect(self._compare)
        self._name.textChanged.connect(self._show_name_problem)
        self._name.editingFinished.connect(self._on_name_edited)
        self.main.clicked.connect(self.save)
        self._accept.clicked.connect(self._open_acceptance)
        self._use.clicked.connect(self._ask_to_use)
        project.rig_changed.connect(self.enter)
        follow_theme(self, self._show_findings)

    def enter(self) -> None:
        """Show the present rig."""
        rig = self._project.rig
        self._name.setText(rig.name)
        findings = (*report_rig(rig), *self._outdated(), self._accepted())
        self._shown = [_unless_initial(one, rig) for one in findings]
        self._show_findings()
        self._how.setVisible(any(one.command for one in findings))
        self._numbers.show_rows(COLUMNS, rig_rows(rig))
        saved = self._project.saved_file
        self._use.setEnabled(saved is not None)
        self._use.setToolTip("" if saved is not None else tr("Save the rig file first"))
        summary = _summary(rig, findings)
        if saved is not None:
            words = tr("saved as {}; {}").format(saved, summary.found)
            is_broken = summary.health is Health.BROKEN
            summary = Finding("", summary.health, words, summary.advice if is_broken else "")
        self._end.show_finding(summary)
        self._compare()

    def hideEvent(self, event: QHideEvent) -> None:
        """Store the typed name: clicking a button may leave the focus in the field."""
        self._on_name_edited()
        super().hideEvent(event)

    def save(self) -> None:
        """Choose a path and save the rig file."""
        plain = re.sub(r"[^A-Za-z0-9]+", "-", self._name.text()).strip("-").lower()
        proposed = f"{plain or 'rig'}.yaml"
        path = ask_save(self._project, self, tr("Save the rig file"), proposed, RIG_FILES)
        if path and self._confirm_mixed():
            self.save_as(path)

    def save_as(self, path: Path) -> None:
        """Save the rig file."""
        self._on_name_edited()
        try:
            self._project.save_rig_as(path)
        except FileError as error:
            found = tr("not saved: {}").format(error)
            advice = tr("save it in another folder, or under another name")
            self._end.show_finding(Finding("", Health.BROKEN, found, advice))

    def stop(self) -> None:
        """Close the acceptance, if it is open."""
        if self._acceptance is not None:
            self._acceptance.reject()

    def _show_findings(self) -> None:
        """Show the findings: failed and doubtful ones come first, then what is not known."""
        shown = sorted(self._shown, key=lambda one: (not one.has_failed, one.is_fine, one.is_known))
        is_fine = all(one.is_fine for one in shown)
        expected = () if is_fine else (Column(tr("Expected"), is_number=False),)
        columns = (
            Column(tr("Item"), is_number=False),
            Column(tr("Found"), is_number=False, is_rest=True),
            *expected,
        )
        rows = []
        for one in shown:
            found = _TIME.sub(lambda time: local_time(time[0]), one.found)
            cells = [
                sentence(text) for text in (one.what, found, "" if one.is_fine else one.expected)
            ]
            sign, shade, word = _sign(one)
            picture = partial(_picture, sign, shade) if sign else None
            row = Row("", tuple(cells[: len(columns)]), picture=picture, picture_text=word)
            rows.append(row)
        self._findings.show_rows(columns, rows)

    def _outdated(self) -> list[RigFinding]:
        """Return the steps that were solved with other inputs than the present ones."""
        expected = tr("solved with the present inputs")
        found = {title: self._project.outdated(step) for step, title in STEP_TITLES.items()}
        return [RigFinding(title, why, False, expected) for title, why in found.items() if why]

    def _accepted(self) -> RigFinding:
        """Return the last acceptance of this rig."""
        what, last = tr("Acceptance"), self._project.acceptance
        if last is None:
            return RigFinding(what, tr("not yet, or the rig has changed"), is_known=False)
        found = f"{local_time(last.made)}: {last.words}"
        passed = last.is_passed
        return RigFinding(what, found, passed, tr("the rig passes"), has_failed=not passed)

    def _confirm_mixed(self) -> bool:
        """Ask before a rig is saved whose parts are not all solved with the present inputs."""
        mixed = "\n".join(f"{one.what}: {one.found}." for one in self._outdated())
        if not mixed:
            return True
        yes, no = QMessageBox.StandardButton.Yes, QMessageBox.StandardButton.No
        text = tr("The rig is of mixed inputs. Save it nevertheless?\n\n{}").format(mixed)
        return QMessageBox.question(self, tr("Save the rig file"), text, yes | no, no) == yes

    def _open_acceptance(self) -> None:
        self._acceptance = AcceptDialog(self._project, self)
        self._acceptance.finished.connect(self.enter)
        self._acceptance.open()

    def _show_name_problem(self) -> None:
        self._name_problem.setVisible(not self._is_name)
        self.main.setEnabled(self._is_name)

    @property
    def _is_name(self) -> bool:
        name = self._name.text().strip()
        return bool(name) and name.isprintable()

    def _on_name_edited(self) -> None:
        name = self._name.text().strip()
        if name == self._project.rig.name or not self._is_name:
            return
        try:
            self._project.use_rig(replace(self._project.rig, name=name))
        except HandcalError as error:
            self._name.setText(self._project.rig.name)
            self._end.show_finding(Finding("", Health.BROKEN, str(error)))

    def _ask_to_use(self) -> None:
        if (saved := self._project.saved_file) is not None:
            self._use_rig(saved)
            text = tr("the next calibration uses this rig")
            self._end.show_finding(Finding("", Health.GOOD, text))

    def _compare(self) -> None:
        self._differences.hide()
        if not self._other.path:
            self._compared.show_finding(
                Finding(
                    "",
                    Health.LIMITED,
                    tr("choose a rig file, such as the last calibration of this rig"),
                )
            )
            return
        try:
            other = read_rig(user_path(self._other.path))
        except FileError as error:
            self._compared.show_finding(Finding("", Health.BROKEN, str(error)))
            return
        self._compared.show_finding(
            Finding("", Health.GOOD, tr("compared with {}").format(other.name))
        )
        self._differences.show_rows((tr("Difference"),), difference_rows(other, self._project.rig))
        self._differences.show()

    def _lay_out(self) -> None:
        check, compare = QWidget(), QWidget()
        vbox((self._findings, 1), self._how, on=check, margins=0, spacing=SPACING_PX)
        vbox(self._other, self._compared, (self._differences, 1), 0, on=compare, spacing=SPACING_PX)
        tabs = QTabWidget(documentMode=True)
        tabs.addTab(check, tr("C&heck"))
        tabs.addTab(self._numbers, tr("Nu&mbers"))
        tabs.addTab(compare, tr("Com&pare"))
        form = QFormLayout()
        form.setHorizontalSpacing(2 * SPACING_PX)
        form.addRow(label_for(self._name, tr("Nam&e")), self._name)
        form.addRow("", self._name_problem)
        self._name_problem.hide()
        foot = QHBoxLayout()
        foot.setSpacing(2 * SPACING_PX)
        foot.addWidget(self._end, 1, Qt.AlignmentFlag.AlignVCenter)
        foot.addWidget(self._accept)
        foot.addWidget(self._use)
        vbox(form, (tabs, 1), foot, on=self, margins=0, spacing=SPACING_PX)


def _picture(sign: str, shade: str) -> QPixmap:
    return icon(sign, getattr(colors(), shade)).pixmap(2 * SPACING_PX)


def _sign(finding: RigFinding) -> tuple[str, str, str]:
    """Return the icon of a finding, its colour, and the word for it; empty if it is not judged."""
    if finding.has_failed:
        return "cross", "red", tr("Failed")
    if not finding.is_known:
        return "wait", "muted", tr("Not known")
    if not finding.is_judged:
        return "", "", ""
    if finding.is_fine:
        return "check", "good", tr("Good")
    return "warning", "warning", tr("Doubtful")


def _unless_initial(finding: RigFinding, rig: Rig) -> RigFinding:
    """Return a finding without a judgement if it is fine but of the initial rig's values."""
    initial = [part for part in finding.parts if part not in rig.origins]
    if not initial or not finding.is_fine:
        return finding
    is_whole = len(initial) == len(finding.parts)
    told = tr("{}, as in the initial rig") if is_whole else tr("{}, partly as in the initial rig")
    return replace(finding, found=told.format(finding.found), expected="")


def _summary(rig: Rig, findings: Sequence[RigFinding]) -> Finding:
    """Return how many findings failed, are doubtful or not known, and what is not calibrated.

    Its advice says how to go on with a rig that is not saved.
    """
    failed = sum(one.has_failed for one in findings)
    doubtful = sum(not one.is_fine for one in findings) - failed
    missing = [part for part in RIG_PARTS if part not in rig.origins]
    unknown = sum(not one.is_known for one in findings) - len(missing)
    names = ", ".join(PART_NAMES[part] for part in missing)
    told = {
        tr("{} failed").format(failed): failed,
        tr("{} doubtful (see Check)").format(doubtful): doubtful,
        tr("{} not calibrated by handcal: {}").format(len(missing), names): missing,
        tr("{} not known or not made").format(unknown): unknown,
        tr("none doubtful"): not failed and not doubtful,
    }
    text = "; ".join(words for words, is_so in told.items() if is_so)
    health = Health.LIMITED if doubtful or unknown or missing else Health.GOOD
    if failed:
        health = Health.BROKEN
    advice = tr("save the rig file to use it")
    if missing:
        advice = tr("solve these steps, or save the rig file to use it as it is")
    if failed:
        advice = tr("follow the advice under Acceptance, then accept the rig again")
    return Finding("", health, text, advice)

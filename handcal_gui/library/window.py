"""The library: the sessions of a folder, searched, compared, exported, checked, deleted."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QAction, QShowEvent
from PySide6.QtWidgets import (
    QComboBox,
    QDialog,
    QInputDialog,
    QLabel,
    QLineEdit,
    QPushButton,
    QSplitter,
    QStackedWidget,
    QWidget,
)

from handcal.core.types import EYES, Eye
from handcal.session.library import LibraryEntry
from handcal.session.state import MAX_WEARER_CHARACTERS
from handcal_gui.app.keys import add_action
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.engine.jobs import Work
from handcal_gui.engine.latest_job import LatestJob
from handcal_gui.library.sessions import (
    COLUMNS,
    FILTERS,
    Change,
    Contents,
    calibrations_of,
    check_sessions,
    correct_names,
    delete_sessions,
    is_damaged,
    is_of,
    matches,
    read_contents,
    repair_beside,
    selection_text,
    session_row,
    undo,
    undoable,
)
from handcal_gui.widgets.brief import copy_text, limit_length
from handcal_gui.widgets.elided_label import ElidedLabel
from handcal_gui.widgets.error_bars import LIBRARY_LEGEND, PICTURE_HELP, PICTURE_PX, has_bars
from handcal_gui.widgets.fields import (
    button,
    choice,
    label_for,
    main_button,
    paragraph,
    plain_tooltip,
    with_name,
)
from handcal_gui.widgets.job_bar import JobBar
from handcal_gui.widgets.layouts import hbox, keep_space, vbox
from handcal_gui.widgets.numbers import pluralize
from handcal_gui.widgets.opening import open_path
from handcal_gui.widgets.plots import Plot
from handcal_gui.widgets.result_rows import EYE_NAMES, NOTHING
from handcal_gui.widgets.session_rows import RESUME_HELP
from handcal_gui.widgets.table import Table

_TASK = tr(
    "Select a session and open it, or several, with Ctrl or Shift, to export, check or delete them."
)
_MOST_TICKS = 20
_SYMBOLS: dict[Eye, str] = {"left": "o", "right": "t1"}


class LibraryWindow(QDialog):
    """Shows the sessions of a folder; nothing is read or written in the window's thread.

    Parameters
    ----------
    folder : Path
        Folder of sessions.

    Attributes
    ----------
    open_requested, resume_requested : Signal(Path)
        A session to open, or to resume.
    export_requested : Signal(object)
        The sessions to export, a list of Path.
    changed : Signal()
        Sessions may have been changed: names corrected, sessions deleted, restored or repaired.
    """

    open_requested = Signal(object)
    resume_requested = Signal(object)
    export_requested = Signal(object)
    changed = Signal()

    def __init__(self, folder: Path, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("library")
        self.setWindowTitle(tr("Sessions"))
        self._folder = folder
        self._contents = Contents()
        self._changes: list[Change] = [()]
        self._found_damaged: set[Path] = set()  # by the last check, which reads more
        self._is_read = False
        self._search = with_name(QLineEdit(clearButtonEnabled=True), "search", tr("Search"))
        self._search.setPlaceholderText(tr("Search wearer, date, notes, rig (Ctrl+F)"))
        self._kind = choice("kind", tr("Sessions shown"), FILTERS)
        self._table = Table("sessionTable", tr("Sessions"), chooses="several", is_sorted=True)
        self._table.setIconSize(PICTURE_PX)
        self._table.setMinimumHeight(12 * SPACING_PX)
        self._table.sortByColumn(1, Qt.SortOrder.DescendingOrder)
        self._legend = with_name(QLabel(LIBRARY_LEGEND), "legend", help_text=PICTURE_HELP)
        self._left_out = with_name(ElidedLabel(), "leftOut")
        self._means = paragraph("means")
        self._count = paragraph("count", tr("Reading {}…").format(folder))
        self._trend = TrendPlot()
        self._trend.setMinimumHeight(20 * SPACING_PX)
        self._trend_title = paragraph("trendTitle")
        self._message = paragraph("message")
        self._message.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self._jobs = JobBar()
        self._said = QStackedWidget()  # of one height, so that nothing moves with a job
        self._said.addWidget(self._message)
        self._said.addWidget(self._jobs)
        self._jobs.failed.connect(self._end)
        self._jobs.busy_changed.connect(self._show_busy)
        self._make_actions()
        self._lay_out()
        self._find = LatestJob(partial(read_contents, folder), self)
        self._find.answered.connect(lambda _, found: self._show(found))
        self._find.failed.connect(self._say)
        self._search.textChanged.connect(self._search_again)
        self._kind.currentIndexChanged.connect(self._search_again)
        self._table.chosen_changed.connect(self._refresh)
        self._table.hidden_changed.connect(self._show_left_out)
        self._table.doubleClicked.connect(self._open.trigger)
        self.finished.connect(self.stop)
        self._show_busy(False)

    @property
    def chosen(self) -> list[LibraryEntry]:
        """The sessions that are selected, in the order shown."""
        by_path = {entry.path: entry for entry in self._contents.entries}
        return [by_path[path] for path in self._table.chosen]

    def reload(self, checked: Collection[Path] = ()) -> None:
        """Read the folder again; sessions that have not changed only if they were just checked."""
        self._find.ask([one for one in self._contents.entries if one.path not in checked])

    def stop(self) -> None:
        """Cancel what is running; safe to call twice."""
        self._find.stop()
        self._jobs.stop()

    def showEvent(self, event: QShowEvent) -> None:
        """Read the folder."""
        super().showEvent(event)
        self._begin_search()
        self.reload()

    def _show(self, contents: Contents) -> None:
        before, self._contents = self._contents, contents
        if self._is_read:  # those that were deleted together are restored together
            self._changes.append(tuple(p for p in contents.deleted if p not in before.deleted))
        self._changes = undoable(self._changes, contents) or [contents.together]
        shown = {entry.path for entry in before.entries}
        made = {entry.path for entry in contents.entries} - shown if self._is_read else set()
        self._is_read = True
        self._legend.setVisible(any(has_bars(entry.eyes) for entry in contents.entries))
        if contents.entries != before.entries:
            self._show_rows()
        if made:  # a copy, or what was restored
            self._table.choose(made)
        self._refresh()

    def _show_rows(self) -> None:
        words, kind = self._search.text().casefold().split(), self._kind.currentData()
        entries = [e for e in self._contents.entries if is_of(e, kind) and matches(e, words)]
        self._table.show_rows(COLUMNS, [session_row(entry) for entry in entries])

    def _begin_search(self) -> None:
        self._search.setFocus(Qt.FocusReason.ShortcutFocusReason)
        self._search.selectAll()

    def _search_again(self) -> None:
        self._show_rows()
        self._refresh()

    def _refresh(self) -> None:
        chosen = self.chosen
        readable = [entry for entry in chosen if not entry.problem]
        is_free = not self._jobs.is_busy
        self._open.setEnabled(len(chosen) == len(readable) == 1)
        self._resume.setEnabled(len(chosen) == len(readable) == 1)
        self._export.setEnabled(any(entry.alignments or entry.eyes for entry in readable))
        self._correct.setEnabled(is_free and bool(readable))
        self._show_folder.setEnabled(len(chosen) == 1)
        self._copy.setEnabled(bool(chosen))
        self._check.setEnabled(is_free and bool(chosen))
        damaged = [one for one in readable if is_damaged(one) or one.path in self._found_damaged]
        self._repair.setEnabled(is_free and len(chosen) == len(damaged) == 1)
        self._delete.setEnabled(is_free and bool(chosen))
        self._refresh_undo()
        if self._is_read:
            self._show_counts(len(chosen))
        self._means.setText(selection_text(chosen))
        self._show_left_out()
        self._show_trend(chosen[0].wearer if chosen else "")

    def _show_counts(self, chosen: int) -> None:
        """Show how many sessions there are, or why none is shown, and what to do."""
        entries = self._contents.entries
        empty = sum(entry.is_empty for entry in entries)
        shown, total = len(self._table.keys), len(entries) - empty
        count = pluralize(total, tr("session"), tr("sessions"))
        if shown != total:
            count = tr("{} of {} sessions").format(shown, total)
        selected = tr(", {} selected").format(chosen) if chosen else ""
        left_out = tr("; not shown: {} empty").format(empty) if empty else ""
        self._count.setText(tr("{} in {}{}{}").format(count, self._folder, selected, left_out))
        hint = tr("No session matches. Search for something else, or choose All sessions.")
        if self._contents.is_missing:
            hint = tr(
                "This folder does not exist. Calibrate a wearer, which creates it, or choose "
                "another session folder on the start page."
            )
        elif not entries:
            hint = tr(
                "No session is in this folder yet. Calibrate a wearer, or choose another session "
                "folder on the start page."
            )
        self._table.show_hint(hint)

    def _show_left_out(self) -> None:
        """Show the values of a single selected session that have no column, or their names."""
        hidden, chosen = self._table.hidden, self._table.chosen
        titles = [title.split("\n")[0] for title in hidden]
        text = tr("A wider window also shows: {}").format(", ".join(titles)) if hidden else ""
        if len(chosen) == 1:
            values = (texts[chosen[0]] for texts in hidden.values())
            text = "; ".join(map("{}: {}".format, titles, values))
        self._left_out.setText(text)

    def _refresh_undo(self) -> None:
        """Offer to undo the last change made in this window, else the last deletion."""
        last = self._changes[-1]
        if isinstance(last, Mapping):
            names = ", ".join(sorted({name or NOTHING for name in last.values()}))
            verb, text = tr("&Undo"), tr("Name before: {}").format(names)
        else:
            count = len(last)
            sessions = pluralize(count, tr("session"), tr("sessions"))
            name = self._contents.last if count == 1 else sessions
            verb, text = tr("Re&store"), tr("Last deleted: {}").format(name) if count else ""
        self._undo.setText(verb)
        self._undo.setToolTip(plain_tooltip(tr("{} (Ctrl+Z)").format(text)))
        self._undo.setVisible(bool(text))
        self._undo.setEnabled(bool(text) and not self._jobs.is_busy)
        self._change_text.setText(text)
        self._change_text.setVisible(bool(text))  # or it halves the line of the count

    def _show_trend(self, wearer: str) -> None:
        found = calibrations_of(wearer, self._contents.entries)
        self._trend.setVisible(len(found) > 1)
        text = tr("Select a wearer with several calibrations to see how the errors changed.")
        if len(found) > 1:
            text = tr(
                "{}: {} calibrations, and the error expected after each, verified by the wearer or "
                "not"
            ).format(wearer, len(found))
            self._trend.show_calibrations(found)
        self._trend_title.setText(text)

    def _open_chosen(self) -> None:
        self.open_requested.emit(self.chosen[0].path)
        self.accept()

    def _resume_chosen(self) -> None:
        self.resume_requested.emit(self.chosen[0].path)
        self.accept()

    def _export_chosen(self) -> None:
        self.export_requested.emit([entry.path for entry in self.chosen])

    def _check_chosen(self) -> None:
        self._found_damaged.difference_update(paths := [one.path for one in self.chosen])
        self._start(partial(check_sessions, paths, self._found_damaged), paths)

    def _repair_chosen(self) -> None:
        self._start(partial(repair_beside, self.chosen[0].path))

    def _delete_chosen(self) -> None:
        self._start(partial(delete_sessions, [entry.path for entry in self.chosen]))

    def _ask_name(self) -> None:
        """Let the user correct the name of the chosen sessions' wearer."""
        chosen = [entry for entry in self.chosen if not entry.problem]
        known = {entry.wearer for entry in self._contents.entries} - {""}
        former = [name for entry in chosen for name in entry.former_wearers]
        names = dict.fromkeys([chosen[0].wearer, *former, *sorted(known, key=str.casefold)])
        dialog = QInputDialog(self)
        dialog.setWindowTitle(tr("Correct the name"))
        count = pluralize(len(chosen), tr("session"), tr("sessions"))
        dialog.setLabelText(tr("Name or code of the wearer of {}:").format(count))
        dialog.setComboBoxEditable(True)
        dialog.setComboBoxItems(list(names))
        dialog.setTextValue(chosen[0].wearer)
        dialog.resize(56 * SPACING_PX, 0)  # the title needs room beside the buttons of the frame
        box = dialog.findChildren(QComboBox)[0]
        field, completer = box.lineEdit(), box.completer()
        assert field is not None
        assert completer is not None
        limit_length(field, MAX_WEARER_CHARACTERS)
        completer.setCaseSensitivity(Qt.CaseSensitivity.CaseSensitive)  # p7 may become P7
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.textValueSelected.connect(lambda name: self._correct_names(chosen, name))
        dialog.open()

    def _correct_names(self, entries: Sequence[LibraryEntry], name: str) -> None:
        self._changes.append({entry.path: entry.wearer for entry in entries})
        self._start(partial(correct_names, {entry.path: name for entry in entries}))

    def _show_folder_of_chosen(self) -> None:
        open_path(self, self.chosen[0].path)

    def _copy_paths(self) -> None:
        paths = [str(entry.path.absolute()) for entry in self.chosen]
        count = pluralize(len(paths), tr("path"), tr("paths"))
        copy_text(self._table, "\n".join(paths), tr("Copied: {}").format(count))

    def _undo_last(self) -> None:
        self._start(partial(undo, self._changes[-1]))

    def _start(self, work: Work, checked: Collection[Path] = ()) -> None:
        if not self._jobs.is_busy:
            self._table.setFocus()  # or the search gets it from a button that is disabled
            self._say("")
            self._table.viewport().repaint()  # or each cell painted waits for the work
            self._jobs.run(tr("Starting"), work, partial(self._end, checked=checked))

    def _end(self, said: object, checked: Collection[Path] = ()) -> None:
        self._say(str(said))
        self.changed.emit()
        self.reload(checked)

    def _show_busy(self, is_busy: bool) -> None:
        self._said.setCurrentWidget(self._jobs if is_busy else self._message)
        self._refresh()

    def _say(self, message: str) -> None:
        self._message.setText(message)

    def _make_actions(self) -> None:
        """Make the actions of the context menu, most of which have a button and some a key."""
        self._open = self._act(
            tr("&Open"), "Return", self._open_chosen, tr("Review the selected session (Return)")
        )
        self._resume = self._act(tr("&Resume"), "", self._resume_chosen, RESUME_HELP)
        self._export = self._act(
            tr("&Export…"), "", self._export_chosen, tr("Export the selected sessions")
        )
        self._separate()
        self._correct = self._act(
            tr("&Name…"),
            "F2",
            self._ask_name,
            tr("Correct the wearer's name or code in the selected sessions (F2)"),
        )
        self._show_folder = self._act(tr("Show &folder"), "", self._show_folder_of_chosen)
        self._copy = self._act(tr("Cop&y path"), "Ctrl+C", self._copy_paths)
        self._separate()
        self._check = self._act(
            tr("&Check"), "", self._check_chosen, tr("Read every file of the selected sessions")
        )
        self._repair = self._act(
            tr("Re&pair"), "", self._repair_chosen, tr("Copy what is sound of a damaged session")
        )
        self._delete = self._act(
            tr("&Delete"), "Del", self._delete_chosen, tr("Delete the selected sessions (Del)")
        )
        self._table.setContextMenuPolicy(Qt.ContextMenuPolicy.ActionsContextMenu)
        self._undo = button("restoreSession", tr("Re&store"))
        self._undo.setAutoDefault(False)
        keep_space(self._undo)
        self._undo.clicked.connect(self._undo_last)
        add_action(self, tr("Search"), "Ctrl+F", self._begin_search)
        add_action(self, tr("Undo the last change"), "Ctrl+Z", self._undo.click)

    def _act(self, text: str, keys: str, do: Callable[[], None], help_text: str = "") -> QAction:
        return add_action(self._table, text, keys, do, tooltip=help_text)

    def _separate(self) -> None:
        line = QAction(self._table)
        line.setSeparator(True)
        self._table.addAction(line)

    def _lay_out(self) -> None:
        self._change_text = ElidedLabel()
        self._change_text.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        below = QWidget()
        parts = self._left_out, self._trend_title, (self._trend, 1)
        vbox(*parts, on=below, margins=0, spacing=SPACING_PX // 2)
        halves = QSplitter(Qt.Orientation.Vertical)
        halves.addWidget(self._table)
        halves.addWidget(below)
        halves.setStretchFactor(0, 3)
        halves.setStretchFactor(1, 1)
        halves.setChildrenCollapsible(False)
        buttons = (
            _pressed_for(action, button(name, action.text()))
            for name, action in {
                "correctName": self._correct,
                "deleteSessions": self._delete,
                "repairSession": self._repair,
                "checkSessions": self._check,
                "exportSessions": self._export,
                "resumeSession": self._resume,
            }.items()
        )
        # Enter in the search opens the first session that it finds.
        opening = _pressed_for(self._open, main_button("openSession", self._open.text()))
        shown = label_for(self._kind, tr("S&how"))
        close = button("closeLibrary", tr("C&lose"))
        close.setAutoDefault(False)
        close.clicked.connect(self.reject)
        vbox(
            paragraph("libraryTask", _TASK),
            hbox((self._search, 1), shown, self._kind, self._legend, spacing=SPACING_PX),
            (halves, 1),
            self._means,
            hbox((self._count, 1), (self._change_text, 1), self._undo, spacing=SPACING_PX),
            self._said,
            hbox(close, 1, *buttons, opening, spacing=SPACING_PX),
            on=self,
            margins=2 * SPACING_PX,
            spacing=SPACING_PX,
        )
        self.resize(144 * SPACING_PX, 84 * SPACING_PX)


def _pressed_for(action: QAction, made: QPushButton) -> QPushButton:
    """Make a button trigger an action, and be enabled while the action is."""
    made.setAutoDefault(made.isDefault())
    made.setToolTip(action.toolTip())
    made.setEnabled(action.isEnabled())
    made.clicked.connect(action.trigger)
    action.enabledChanged.connect(made.setEnabled)
    return made


class TrendPlot(Plot):
    """Shows the expected errors: filled symbols after a verification, hollow ones without it."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(
            "trend",
            tr("Trend"),
            tr("Calibration of this wearer, oldest first"),
            tr("Expected error (′)"),
            parent,
        )
        self.show_legend()
        self._target = self.add_line("muted", name=tr("Target"), dashed=True)
        self._verified = {
            eye: self.add_line(
                eye, name=tr("{}, verified").format(EYE_NAMES[eye]), symbol=_SYMBOLS[eye]
            )
            for eye in EYES
        }
        self._unverified = {
            eye: self.add_line(
                eye,
                name=tr("{}, not verified").format(EYE_NAMES[eye]),
                dashed=True,
                symbol=_SYMBOLS[eye],
            )
            for eye in EYES
        }

    def show_calibrations(self, entries: Sequence[LibraryEntry]) -> None:
        """Show the solved sessions of one wearer, the oldest first, and the newest target."""
        numbers, count = np.arange(1.0, len(entries) + 1.0), max(len(entries), 2)
        targets = [one.target_arcmin for one in entries if one.target_arcmin is not None][-1:]
        largest = max(1.0, *targets, 0.0)
        self._target.setData([0.8, count + 0.2][: 2 * len(targets)], 2 * targets)
        for eye in EYES:
            outcomes = [entry.eyes.get(eye) for entry in entries]
            verified = [None if one is None else one.remaining_arcmin for one in outcomes]
            unverified = [
                None if one is None or one.remaining_arcmin is not None else one.expected_arcmin
                for one in outcomes
            ]
            for line, errors in ((self._verified, verified), (self._unverified, unverified)):
                known = [np.nan if error is None else error for error in errors]
                largest = max(largest, *(error or 0.0 for error in errors))
                if any(error is not None for error in errors):
                    line[eye].setData(numbers, np.array(known, dtype=np.float64))
                else:
                    line[eye].clear()
        self.item.setYRange(0.0, 1.1 * largest, padding=0.0)
        self.item.setXRange(0.8, count + 0.2)
        ticks = [[(number, f"{number:g}") for number in numbers]]
        self.item.getAxis("bottom").setTicks(ticks if len(entries) <= _MOST_TICKS else None)

"""The library: the sessions of a folder, searched, compared, exported, checked, deleted."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from PySide6.QtCore import Qt, QUrl, Signal
from PySide6.QtGui import QAction, QDesktopServices, QGuiApplication, QShowEvent
from PySide6.QtWidgets import (
    QComboBox,
    QDialog,
    QInputDialog,
    QLineEdit,
    QPushButton,
    QSplitter,
    QWidget,
)

from handcal.session.library import LibraryEntry, deleted_sessions, read_library
from handcal.session.state import MAX_WEARER_CHARACTERS
from handcal_gui.engine.jobs import Job, Work
from handcal_gui.engine.latest_job import LatestJob
from handcal_gui.keys import add_action
from handcal_gui.theme import SPACING_PX
from handcal_gui.translation import tr
from handcal_gui.widgets.elided_label import ElidedLabel
from handcal_gui.widgets.fields import button, choice, paragraph, plain_tooltip, with_name
from handcal_gui.widgets.layouts import hbox, vbox
from handcal_gui.widgets.numbers import pluralize
from handcal_gui.widgets.result_rows import NOTHING
from handcal_gui.windows.library.sessions_model import FILTERS, SessionsFilter, SessionsModel
from handcal_gui.windows.library.sessions_table import SessionsTable
from handcal_gui.windows.library.tasks import (
    check_sessions,
    correct_names,
    delete_sessions,
    repair_beside,
    restore_deleted,
)
from handcal_gui.windows.library.trend_plot import TrendPlot, calibrations_of

_TREND_PX = 20 * SPACING_PX


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
        self._deleted: tuple[Path, ...] = ()
        self._former_names: dict[Path, str] = {}
        self._is_read = False
        self._job: Job | None = None
        self._sessions = SessionsModel()
        self._filter = SessionsFilter(self._sessions)
        self._search = with_name(QLineEdit(), "search", tr("Search"))
        self._search.setPlaceholderText(tr("Search wearer, date, rig, headset"))
        self._search.setClearButtonEnabled(True)
        self._kind = choice("kind", tr("Sessions shown"), FILTERS)
        self._table = SessionsTable(self._sessions, self._filter)
        self._count = paragraph("count")
        self._trend = TrendPlot()
        self._trend.setMinimumHeight(_TREND_PX)
        self._trend_title = paragraph("trendTitle")
        self._message = paragraph("message")
        self._message.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self._message.hide()  # until there is one
        self._make_actions()
        self._lay_out()
        self._find = LatestJob(lambda known: self._read(known), self)
        self._find.answered.connect(lambda _, found: self._show(*found))
        self._find.failed.connect(self._say)
        self._search.textChanged.connect(self._search_again)
        self._kind.currentIndexChanged.connect(self._search_again)
        self._table.selectionModel().selectionChanged.connect(self._refresh)
        self._table.doubleClicked.connect(self._open.trigger)
        self.finished.connect(self.stop)
        self._refresh()

    @property
    def chosen(self) -> list[LibraryEntry]:
        """The sessions that are selected, in the order shown."""
        return self._table.chosen

    def reload(self) -> None:
        """Read the folder again."""
        self._find.ask(self._sessions.entries)

    def stop(self) -> None:
        """Cancel what is running; safe to call twice."""
        self._find.stop()
        if self._job is not None:
            self._job.abandon()
            self._job = None

    def showEvent(self, event: QShowEvent) -> None:
        """Read the folder."""
        super().showEvent(event)
        self._begin_search()
        self.reload()

    def _read(
        self, known: Sequence[LibraryEntry]
    ) -> tuple[tuple[LibraryEntry, ...], tuple[Path, ...]]:
        return read_library(self._folder, known), deleted_sessions(self._folder)

    def _show(self, entries: tuple[LibraryEntry, ...], deleted: tuple[Path, ...]) -> None:
        shown = {entry.path for entry in self._sessions.entries}
        made = {entry.path for entry in entries} - shown if self._is_read else set()
        chosen = made or {entry.path for entry in self.chosen}  # a copy or what was restored
        self._deleted, self._is_read = deleted, True
        wearers = {entry.path: entry.wearer for entry in entries}
        self._former_names = {
            path: name
            for path, name in self._former_names.items()
            if wearers.get(path, name) != name  # else it was not corrected, or is undone
        }
        if entries != self._sessions.entries:
            self._sessions.show_entries(entries)
            self._table.choose(chosen)
            self._table.fit_columns()
        self._refresh()

    def _begin_search(self) -> None:
        self._search.setFocus(Qt.FocusReason.ShortcutFocusReason)
        self._search.selectAll()

    def _search_again(self) -> None:
        chosen = {entry.path for entry in self.chosen}
        self._table.clearSelection()  # else it changes, and all is refreshed, with every row
        self._filter.search(self._search.text(), self._kind.currentData())
        self._table.choose(chosen)
        self._refresh()

    def _refresh(self) -> None:
        chosen = self.chosen
        readable = [entry for entry in chosen if not entry.problem]
        is_free = self._job is None
        self._open.setEnabled(len(chosen) == len(readable) == 1)
        self._resume.setEnabled(len(readable) == 1 and not readable[0].is_finished)
        self._export.setEnabled(any(entry.alignments or entry.eyes for entry in readable))
        self._correct.setEnabled(is_free and bool(readable))
        self._show_folder.setEnabled(len(chosen) == 1)
        self._copy.setEnabled(bool(chosen))
        self._check.setEnabled(is_free and bool(chosen))
        self._repair.setEnabled(is_free and len(chosen) == 1)
        self._delete.setEnabled(is_free and bool(chosen))
        self._refresh_undo()
        shown, total = self._filter.rowCount(), self._sessions.rowCount()
        count = (
            pluralize(total, tr("session"), tr("sessions"))
            if shown == total
            else tr("{} of {} sessions").format(shown, total)
        )
        selected = tr(", {} selected").format(len(chosen)) if chosen else ""
        shown_count = tr("{} in {}{}").format(count, self._folder, selected)
        self._table.show_reason(_reason_for_none(shown, total) if self._is_read else "")
        reading = tr("Reading {}…").format(self._folder)
        self._count.setText(shown_count if self._is_read else reading)
        self._show_trend(chosen[0].wearer if chosen else "")

    def _refresh_undo(self) -> None:
        """Offer to undo the correction made in this window, else the last deletion."""
        if self._former_names:
            names = ", ".join(sorted({name or NOTHING for name in self._former_names.values()}))
            verb, text = tr("Undo"), tr("Name before: {}").format(names)
        else:
            last = self._deleted[-1].name if self._deleted else ""
            verb, text = tr("Restore"), tr("Last deleted: {}").format(last) if last else ""
        self._undo.setText(verb)
        self._undo.setToolTip(plain_tooltip(tr("{} (Ctrl+Z)").format(text)))
        self._undo.setVisible(bool(text))
        self._undo.setEnabled(bool(text) and self._job is None)
        self._change_text.setText(text)

    def _show_trend(self, wearer: str) -> None:
        found = calibrations_of(wearer, self._sessions.entries)
        self._trend.setVisible(len(found) > 1)
        text = tr("Select a wearer with several calibrations to see how the errors changed.")
        if len(found) > 1:
            text = tr("{}: {} calibrations").format(wearer, len(found))
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
        self._start(partial(check_sessions, [entry.path for entry in self.chosen]))

    def _repair_chosen(self) -> None:
        self._start(partial(repair_beside, self.chosen[0].path))

    def _delete_chosen(self) -> None:
        self._former_names = {}
        self._start(partial(delete_sessions, [entry.path for entry in self.chosen]))

    def _ask_name(self) -> None:
        """Let the user correct the name of the chosen sessions' wearer."""
        chosen = [entry for entry in self.chosen if not entry.problem]
        known = {entry.wearer for entry in self._sessions.entries} - {""}
        former = [name for entry in chosen for name in entry.former_wearers]
        names = dict.fromkeys([chosen[0].wearer, *former, *sorted(known, key=str.casefold)])
        dialog = QInputDialog(self)
        dialog.setWindowTitle(tr("Correct the name"))
        count = pluralize(len(chosen), tr("session"), tr("sessions"))
        dialog.setLabelText(tr("Name or code of the wearer of {}:").format(count))
        dialog.setComboBoxEditable(True)
        dialog.setComboBoxItems(list(names))
        dialog.setTextValue(chosen[0].wearer)
        box = dialog.findChildren(QComboBox)[0]
        field, completer = box.lineEdit(), box.completer()
        assert field is not None
        assert completer is not None
        field.setMaxLength(MAX_WEARER_CHARACTERS)
        completer.setCaseSensitivity(Qt.CaseSensitivity.CaseSensitive)  # p7 may become P7
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.textValueSelected.connect(lambda name: self._correct_names(chosen, name))
        dialog.open()

    def _correct_names(self, entries: Sequence[LibraryEntry], name: str) -> None:
        self._former_names = {entry.path: entry.wearer for entry in entries}
        self._start(partial(correct_names, {entry.path: name for entry in entries}))

    def _show_folder_of_chosen(self) -> None:
        QDesktopServices.openUrl(QUrl.fromLocalFile(str(self.chosen[0].path.absolute())))

    def _copy_paths(self) -> None:
        paths = (str(entry.path.absolute()) for entry in self.chosen)
        QGuiApplication.clipboard().setText("\n".join(paths))

    def _undo_last(self) -> None:
        if self._former_names:
            self._start(partial(correct_names, self._former_names))
        else:
            self._start(partial(restore_deleted, self._deleted[-1]))

    def _start(self, work: Work) -> None:
        if self._job is not None:
            return
        self._table.setFocus()  # or the search gets it from a button that is disabled
        self._job = Job(work)
        self._job.progressed.connect(lambda doing, _: self._say(f"{doing}…"))
        self._job.succeeded.connect(self._end)
        self._job.failed.connect(self._end)
        self._job.cancelled.connect(self._end)
        self._job.start()
        self._refresh()

    def _end(self, said: object = "") -> None:
        assert self._job is not None
        self._job.wait()
        self._job = None
        self._say(str(said))
        self.changed.emit()
        self.reload()
        self._refresh()

    def _say(self, message: str) -> None:
        self._message.setText(message)
        self._message.setVisible(bool(message))

    def _make_actions(self) -> None:
        """Make the actions of the context menu, most of which have a button and some a key."""
        self._open = self._act(
            tr("Open"), "Return", self._open_chosen, tr("Review the selected session (Return)")
        )
        self._resume = self._act(
            tr("Resume"), "", self._resume_chosen, tr("Continue the selected session")
        )
        self._export = self._act(
            tr("Export…"), "", self._export_chosen, tr("Export the selected sessions")
        )
        self._separate()
        self._correct = self._act(
            tr("Name…"),
            "F2",
            self._ask_name,
            tr("Correct the wearer's name or code in the selected sessions (F2)"),
        )
        self._show_folder = self._act(tr("Show folder"), "", self._show_folder_of_chosen)
        self._copy = self._act(tr("Copy path"), "Ctrl+C", self._copy_paths)
        self._separate()
        self._check = self._act(
            tr("Check"), "", self._check_chosen, tr("Read every file of the selected sessions")
        )
        self._repair = self._act(
            tr("Repair"), "", self._repair_chosen, tr("Copy what is sound to a new session")
        )
        self._delete = self._act(
            tr("Delete"), "Del", self._delete_chosen, tr("Delete the selected sessions (Del)")
        )
        self._table.setContextMenuPolicy(Qt.ContextMenuPolicy.ActionsContextMenu)
        self._undo = button("restoreSession", tr("Restore"))
        self._undo.setAutoDefault(False)
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
        below = QWidget()
        vbox(self._trend_title, (self._trend, 1), on=below, margins=0, spacing=0)
        halves = QSplitter(Qt.Orientation.Vertical)
        halves.addWidget(self._table)
        halves.addWidget(below)
        halves.setStretchFactor(0, 3)
        halves.setStretchFactor(1, 1)
        halves.setChildrenCollapsible(False)
        top = hbox((self._search, 1), self._kind, spacing=SPACING_PX)
        buttons = (
            _button_of(name, action)
            for name, action in {
                "correctName": self._correct,
                "deleteSessions": self._delete,
                "repairSession": self._repair,
                "checkSessions": self._check,
                "exportSessions": self._export,
                "resumeSession": self._resume,
                "openSession": self._open,
            }.items()
        )
        actions = hbox((self._change_text, 1), self._undo, *buttons, spacing=SPACING_PX)
        vbox(
            top,
            (halves, 1),
            self._count,
            self._message,
            actions,
            on=self,
            margins=2 * SPACING_PX,
            spacing=SPACING_PX,
        )
        self.resize(130 * SPACING_PX, 84 * SPACING_PX)


def _reason_for_none(shown: int, total: int) -> str:
    """Return the reason why no session is shown, and what to do; empty if one is."""
    if shown:
        return ""
    if total:
        return tr("No session matches. Search for something else, or choose All sessions.")
    return tr(
        "No session is in this folder yet. Calibrate a wearer, or choose another session folder "
        "on the start page."
    )


def _button_of(name: str, action: QAction) -> QPushButton:
    """Return a button that triggers an action, and is enabled while the action is."""
    made = button(name, action.text())
    made.setAutoDefault(False)
    made.setToolTip(action.toolTip())
    made.setEnabled(action.isEnabled())
    made.clicked.connect(action.trigger)
    action.enabledChanged.connect(made.setEnabled)
    return made

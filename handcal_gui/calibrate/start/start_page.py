"""The start page: start a calibration, resume one, open a session, or evaluate."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QIcon, QShowEvent
from PySide6.QtWidgets import (
    QFileDialog,
    QGridLayout,
    QHBoxLayout,
    QListWidget,
    QListWidgetItem,
    QMessageBox,
    QPushButton,
    QSizePolicy,
    QWidget,
)

from handcal.session.session import SessionRecord
from handcal.station.checks.preflight import check_station
from handcal_gui.app.preferences import CurrentPreferences, Preferences
from handcal_gui.app.theme import SPACING_PX, follow_theme, icon
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.start.card import Card
from handcal_gui.calibrate.start.new_calibration import Check, NewCalibration
from handcal_gui.calibrate.start.session_entries import Entry, KnownSessions, find_sessions
from handcal_gui.engine.latest_job import LatestJob
from handcal_gui.widgets.elided_label import ElidedLabel
from handcal_gui.widgets.error_bars import (
    PICTURE_HELP,
    PICTURE_LEGEND,
    PICTURE_PX,
    error_bars,
    has_bars,
    picture_text,
)
from handcal_gui.widgets.fields import button, paragraph, plain_message, plain_tooltip, with_name
from handcal_gui.widgets.layouts import hbox, scrollable, vbox
from handcal_gui.widgets.times import local_time

FindOffers = Callable[[Path, Sequence[Path]], KnownSessions]

_LARGEST_PX = 1600, 1000
"""Size beyond which a larger window leaves room around the page."""


def ask_whether_worn(parent: QWidget, record: SessionRecord) -> bool | None:
    """Ask whether the headset stayed on since a session's last event; None to do nothing."""
    wearer = record.wearer or tr("the wearer")
    text = tr("Did the headset stay on {} since {}?\n\n").format(
        wearer, local_time(record.events[-1].time)
    ) + tr(
        "If it was taken off or has slipped, it sits differently now. Then a new session begins "
        "from this result, and the wearer verifies each eye first."
    )
    box = QMessageBox(QMessageBox.Icon.Question, tr("Resume"), plain_message(text), parent=parent)
    worn = box.addButton(tr("It &stayed on"), QMessageBox.ButtonRole.YesRole)
    moved = box.addButton(tr("It was taken &off"), QMessageBox.ButtonRole.NoRole)
    box.addButton(QMessageBox.StandardButton.Cancel)
    box.setDefaultButton(moved)  # which is right in either case
    box.exec()
    clicked = box.clickedButton()
    return None if clicked not in (worn, moved) else clicked is worn


class StartPage(QWidget):
    """The first page: new calibration, unfinished and recent sessions, evaluation.

    Parameters
    ----------
    preferences : Preferences
    pairing_key : str
        For network headsets.
    check, find_sessions : callable
        Functions that check a station and find sessions; called in jobs.

    Attributes
    ----------
    new : NewCalibration
    unfinished, recent : SessionList
    evaluate : QPushButton
    show_library : callable
        Shows all sessions in a folder.
    open_example : callable
        Opens the example, copied to a folder of sessions.
    """

    def __init__(
        self,
        preferences: Preferences,
        pairing_key: str,
        check: Check = check_station,
        find_sessions: FindOffers = find_sessions,
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self.setObjectName("startPage")
        self.show_library: Callable[[Path], object] = lambda _folder: None
        self.open_example: Callable[[Path], object] = lambda _folder: None
        self._newest: tuple[Path, ...] = ()
        self._folder = Path()
        self.new = NewCalibration(preferences, pairing_key, check)
        self._resume = Card(
            tr("Resume"), tr("Continue a calibration that was interrupted."), "resume"
        )
        self._resume.setObjectName("resume")
        self._resume.hide()
        self.unfinished = SessionList(tr("Unfinished sessions"), tr("Res&ume"))
        self._resume.body.addWidget(self.unfinished)
        self._open = Card(
            tr("Open a session"), tr("Review it, compare methods, export it."), "folder"
        )
        self._open.setObjectName("open")
        self.recent = SessionList(tr("Recent sessions"), tr("&Open"))
        example = button("example", tr("E&xample"), tr("Open the example session"))
        example.setToolTip(tr("A simulated wearer's session, copied to the session folder"))
        browse = button("browse", tr("Choose fo&lder…"))
        library = button(
            "library", tr("All sess&ions…"), tr("Search, compare, export and repair sessions")
        )
        for added in (browse, example):
            self.recent.add_button(added)
        self._open.body.addWidget(self.recent, 1)
        self._open.add_to_head(library)
        self._evaluate = Card(
            tr("Evaluate"), tr("Simulated studies, the cube test, and the user test."), "results"
        )
        self.evaluate = button(
            "evaluate", tr("Evalua&te…"), help_text=tr("Measure the accuracy of calibrations")
        )
        self._evaluate.add_to_head(self.evaluate)
        self._lay_out()
        self._find = LatestJob(lambda question: find_sessions(*question), self)
        self.recent.say_empty(tr("Looking for sessions…"))
        self._find.answered.connect(self._show_sessions)
        self.new.form.changed.connect(self._look_in_another_folder)
        browse.clicked.connect(self.browse)
        example.clicked.connect(lambda: self.open_example(self._folder))
        library.clicked.connect(lambda: self.show_library(self._folder))
        self.show_preferences(preferences)

    def show_preferences(self, preferences: Preferences) -> None:
        """Show the preferences, for the next wearer."""
        self._newest = tuple(map(Path, preferences.sessions))
        self.new.show_preferences(preferences)
        self.look_for_sessions()

    def keep_entries(self, current: CurrentPreferences) -> None:
        """Remember the entries, also those with which nothing was started."""
        if self.new.is_changed:
            current.change(station=self.new.settings)

    def set_opening(self, is_opening: bool) -> None:
        """Allow only cancelling while a station is being opened."""
        self.new.set_opening(is_opening)
        for card in (self._resume, self._open):
            card.setEnabled(not is_opening)

    def browse(self) -> None:
        """Let the user choose the folder of a session to open."""
        folder = QFileDialog.getExistingDirectory(self, tr("Session folder"), str(self._folder))
        if folder:
            self.recent.chosen.emit(Path(folder))

    def stop(self) -> None:
        """Wait for background work to end; called before the program ends."""
        self.new.stop()
        self._find.stop()

    def showEvent(self, event: QShowEvent) -> None:
        """Search for sessions again."""
        super().showEvent(event)
        self.look_for_sessions()

    def _look_in_another_folder(self) -> None:
        if self.new.settings.sessions_path != self._folder:
            self.look_for_sessions()

    def look_for_sessions(self) -> None:
        """Search for sessions again."""
        self._folder = self.new.settings.sessions_path
        self._find.ask((self._folder, self._newest))

    def _show_sessions(self, _question: object, offers: KnownSessions) -> None:
        self.unfinished.show_entries(offers.unfinished)
        self._resume.setVisible(bool(offers.unfinished))
        self.recent.say_empty(tr("No session yet; the newest will be listed here."))
        self.recent.show_entries(offers.recent)
        self.new.show_wearers(offers.wearers)

    def _lay_out(self) -> None:
        cards = QWidget()
        # Below the others, so that nothing moves under the mouse when it appears.
        parts = (self._open, 1), self._evaluate, (self._resume, 1)
        vbox(*parts, on=cards, margins=0, spacing=2 * SPACING_PX)
        right = scrollable(cards)  # or a small window hides the button that starts
        right.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        room_px = cards.minimumSizeHint().width() + right.verticalScrollBar().sizeHint().width()
        right.setMinimumWidth(room_px)
        right.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Ignored)
        content = QWidget()
        content.setMaximumSize(*_LARGEST_PX)
        hbox(1, (content, 1000), 1, on=self, margins=0)
        grid = QGridLayout(content)
        grid.setContentsMargins(2 * SPACING_PX, SPACING_PX, 2 * SPACING_PX, SPACING_PX)
        grid.setSpacing(2 * SPACING_PX)
        grid.setColumnStretch(1, 3)
        grid.setColumnStretch(2, 2)
        grid.addWidget(self.new, 0, 1)
        grid.addWidget(right, 0, 2)


class SessionList(QWidget):
    """Lists sessions; a double click, Enter, or the button below chooses one.

    Parameters
    ----------
    name : str
        For screen readers, such as "Unfinished sessions".
    verb : str
        Label of the button.

    Attributes
    ----------
    chosen : Signal(Path)
    """

    chosen = Signal(object)

    def __init__(self, name: str, verb: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._list = with_name(QListWidget(), "sessions", name)
        self._list.setWordWrap(True)
        # As tall as the available space, not as the items need.
        self._list.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Ignored)
        self._list.setMinimumHeight(6 * SPACING_PX)  # two rows, or one of two lines
        self._list.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self._list.setAlternatingRowColors(True)
        self._list.setIconSize(PICTURE_PX)
        self._button = button("choose", verb)
        self._list.itemActivated.connect(self._choose)
        self._list.currentItemChanged.connect(self._refresh)
        self._button.clicked.connect(self._choose)
        self._empty = paragraph("empty")
        self._empty.setAlignment(Qt.AlignmentFlag.AlignTop)
        self._layout = vbox(
            (self._empty, 1), (self._list, 1), on=self, margins=0, spacing=SPACING_PX // 2
        )
        self._legend = with_name(ElidedLabel(), "legend")
        self._legend.setText(PICTURE_LEGEND)
        self._legend.setToolTip(PICTURE_HELP)
        self._buttons = QHBoxLayout()
        self._buttons.addWidget(self._legend, 1)
        self._buttons.addStretch()
        self._buttons.addWidget(self._button)
        self._layout.addLayout(self._buttons)
        self._entries: Sequence[Entry] = ()
        follow_theme(self, lambda: self.show_entries(self._entries))

    def show_entries(self, entries: Sequence[Entry]) -> None:
        """Replace the entries, keeping the selection if it is still listed and none is newer."""
        before, self._entries = {entry.path for entry in self._entries}, entries
        has_pictures = any(has_bars(entry.eyes) for entry in entries)
        kept = self._list.currentItem()
        kept_path = kept.data(Qt.ItemDataRole.UserRole) if kept is not None else None
        newest = next((entry.path for entry in entries if entry.is_enabled), None)
        if newest not in before:
            kept_path = newest
        self._list.clear()
        self._list.setVisible(bool(entries))
        self._empty.setVisible(not entries)
        self._legend.setVisible(has_pictures)
        for entry in entries:
            item = QListWidgetItem(entry.text)
            item.setData(Qt.ItemDataRole.UserRole, entry.path)
            why = "" if entry.is_enabled else entry.text  # of which a small list shows a part
            about = "\n".join(filter(None, (str(entry.path), why, picture_text(entry.eyes))))
            item.setToolTip(plain_tooltip(about))
            item.setData(Qt.ItemDataRole.AccessibleDescriptionRole, picture_text(entry.eyes))
            if has_pictures:
                item.setIcon(QIcon(error_bars(entry.eyes)))
            if not entry.is_enabled:
                item.setFlags(Qt.ItemFlag.ItemIsEnabled)
                item.setIcon(icon("warning"))
            self._list.addItem(item)
            if entry.is_enabled and (self._list.currentItem() is None or entry.path == kept_path):
                self._list.setCurrentItem(item)
        self._refresh()

    def say_empty(self, text: str) -> None:
        """Set the text that stands in place of an empty list."""
        self._empty.setText(text)

    def add_button(self, added: QPushButton) -> None:
        """Add a button before the list's own; the legend then has a line of its own."""
        self._layout.insertWidget(2, self._legend)
        self._buttons.insertWidget(1, added)

    def _choose(self) -> None:
        item = self._list.currentItem()
        if _may_be_chosen(item):
            self.chosen.emit(item.data(Qt.ItemDataRole.UserRole))

    def _refresh(self) -> None:
        self._button.setEnabled(_may_be_chosen(self._list.currentItem()))


def _may_be_chosen(item: QListWidgetItem | None) -> bool:
    return item is not None and bool(item.flags() & Qt.ItemFlag.ItemIsSelectable)

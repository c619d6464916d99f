"""The table of the library: one row for each session, searched, filtered and sorted."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias, cast

from PySide6.QtCore import (
    QAbstractTableModel,
    QModelIndex,
    QModelRoleData,
    QPersistentModelIndex,
    Qt,
)

from handcal.core.types import EYES, VerdictName
from handcal.session.judged_trials import is_doubted
from handcal.session.library import EyeOutcome, LibraryEntry
from handcal_gui.app.theme import number_font
from handcal_gui.app.translation import tr
from handcal_gui.widgets.error_bars import after_arcmin, error_bars, error_text, picture_text
from handcal_gui.widgets.fields import plain_tooltip
from handcal_gui.widgets.numbers import pluralize
from handcal_gui.widgets.result_rows import EYE_NAMES, NOTHING, VERDICT_WORDS, doubt_word
from handcal_gui.widgets.times import local_time

Filter: TypeAlias = Literal["all", "accepted", "repeat", "unfinished", "damaged"]
FILTERS: Mapping[Filter, str] = {
    "all": tr("All sessions"),
    "accepted": tr("Accepted"),
    "repeat": tr("Not accepted"),
    "unfinished": tr("Unfinished"),
    "damaged": tr("Damaged"),
}
_Index: TypeAlias = QModelIndex | QPersistentModelIndex
_NO_INDEX = QModelIndex()
_Kind: TypeAlias = Literal["before", "found", "after"]
_KINDS: Mapping[_Kind, Callable[[EyeOutcome], float | None]] = {
    "before": lambda one: one.before_arcmin,
    "found": lambda one: one.found_arcmin,
    "after": after_arcmin,
}


@dataclass(frozen=True, slots=True)
class _Column:
    title: str
    tooltip: str
    text: Callable[[LibraryEntry], str]
    key: Callable[[LibraryEntry], object]
    is_number: bool = False


def is_damaged(entry: LibraryEntry) -> bool:
    """Return whether a part of a session, or all of it, cannot be read."""
    return bool(entry.problem or entry.damaged)


def is_accepted(entry: LibraryEntry) -> bool:
    """Return whether every solved eye is accepted."""
    return bool(entry.eyes) and all(one.verdict == "accept" for one in entry.eyes.values())


def worst_arcmin(entry: LibraryEntry, kind: _Kind) -> float | None:
    """Return the error of the worse eye; None unless it is known of every solved eye."""
    errors = [_KINDS[kind](one) for one in entry.eyes.values()]
    known = [error for error in errors if error is not None]
    return max(known) if known and len(known) == len(errors) else None


def _state(entry: LibraryEntry) -> str:
    if entry.problem:
        return tr("Unreadable")
    if entry.repaired_as:
        return tr("Damaged, has a copy")
    if entry.damaged:
        return tr("Damaged: {}").format(pluralize(entry.damaged, tr("part"), tr("parts")))
    if entry.is_repaired:
        return tr("Repaired copy") if entry.is_finished else tr("Unfinished, repaired copy")
    return tr("Finished") if entry.is_finished else tr("Unfinished")


def _verdicts(entry: LibraryEntry) -> str:
    words = {
        eye: doubt_word(one.trials.target_arcmin)
        if one.trials is not None and is_doubted(one.verdict, one.trials)
        else VERDICT_WORDS.get(cast(VerdictName, one.verdict), one.verdict)
        for eye, one in entry.eyes.items()
    }
    if len(words) == len(EYES) and len(set(words.values())) == 1:
        return words[EYES[0]]
    each = ", ".join(f"{EYE_NAMES[eye].split()[0]} {word}" for eye, word in words.items())
    return each or (NOTHING if entry.problem else tr("Not solved"))


def _errors(kind: _Kind) -> Callable[[LibraryEntry], str]:
    def text(entry: LibraryEntry) -> str:
        if not entry.eyes:
            return NOTHING
        errors = (_KINDS[kind](entry.eyes[eye]) if eye in entry.eyes else None for eye in EYES)
        return " / ".join(NOTHING if one is None else f"{one:.1f}" for one in errors)

    return text


def _trials(entry: LibraryEntry) -> str:
    """Return the mean errors of the trials of each eye's last calibration, and their numbers."""
    if not entry.trials:
        return NOTHING
    trials = [entry.eyes[eye].trials if eye in entry.eyes else None for eye in EYES]
    if not any(trials):
        return tr("{} of earlier φ").format(entry.trials)
    means = " / ".join(NOTHING if one is None else f"{one.mean_arcmin:.1f}" for one in trials)
    counts = "/".join(str(one.count) if one else "0" for one in trials)
    is_over = any(one is not None and one.is_over for one in trials)
    return (tr("⚠ {} n={}") if is_over else tr("{} n={}")).format(means, counts)


def _worst_trials_arcmin(entry: LibraryEntry) -> float | None:
    found = (one.trials.mean_arcmin for one in entry.eyes.values() if one.trials is not None)
    return max(found, default=None)


def _known_first(value: float | None) -> float:
    return float("inf") if value is None else value


COLUMNS = (
    _Column(
        tr("Wearer"),
        tr("Name or code; of a session that cannot be read, its folder"),
        lambda e: e.wearer or (e.path.name if e.problem else NOTHING),
        lambda e: e.wearer.casefold(),
    ),
    _Column(
        tr("Date"),
        tr("Start, local time"),
        lambda e: local_time(e.started) or NOTHING,
        lambda e: e.started,
    ),
    _Column(
        tr("Rig"), tr("Name of the rig"), lambda e: e.rig or NOTHING, lambda e: e.rig.casefold()
    ),
    _Column(
        tr("Headset"),
        tr("Name of the headset"),
        lambda e: e.headset or NOTHING,
        lambda e: e.headset,
    ),
    _Column(
        tr("Verdict"),
        tr("Of the newest results; ⚠ trials of an accepted φ are over the lab's target on average"),
        _verdicts,
        _verdicts,
    ),
    _Column(
        tr("Before ′\nleft / right"),
        tr(
            "Error expected without the calibration, left / right, in arcminutes:\n"
            "the grey bars of the small picture"
        ),
        _errors("before"),
        lambda e: _known_first(worst_arcmin(e, "before")),
        is_number=True,
    ),
    _Column(
        tr("Found ′\nleft / right"),
        tr(
            "Error of the calibration that the wearer's verification found, and corrected, "
            "left / right,\nin arcminutes; – was not verified"
        ),
        _errors("found"),
        lambda e: _known_first(worst_arcmin(e, "found")),
        is_number=True,
    ),
    _Column(
        tr("After ′\nleft / right"),
        tr(
            "Error that is left, as expected from all that is known, left / right, in arcminutes:\n"
            "the coloured bars of the small picture"
        ),
        _errors("after"),
        lambda e: _known_first(worst_arcmin(e, "after")),
        is_number=True,
    ),
    _Column(
        tr("Trials ′\nleft / right"),
        tr(
            "Error of each eye's last calibrated φ relative to φ set by hand, left / right, in "
            "arcminutes:\nthe mean over its trials, and their numbers: 0 if all were of an earlier "
            "φ.\n"
            "⚠ over the lab's target: look at the trials; if φ was set well by hand, calibrate "
            "again"
        ),
        _trials,
        lambda e: _known_first(_worst_trials_arcmin(e)),
        is_number=True,
    ),
    _Column(tr("State"), tr("Check lists what is damaged; Repair copies the rest"), _state, _state),
)
NAMES = (2, 0)
"""Columns with names that are cut in a narrow window, in this order: rig, wearer."""
SPARED = (3, 5, 8, 2)
"""Columns left out where that is not enough, in this order: headset, before, trials, rig."""
_TOLD = (2, 3, 8)
"""Columns that each tooltip contains; it has the error before in a line of its own."""


@dataclass(frozen=True, slots=True)
class SessionRow:
    """A session with all that is shown of it."""

    entry: LibraryEntry
    texts: tuple[str, ...]
    keys: tuple[Any, ...]
    """By which each column is sorted."""
    searched: str
    """Text in which words are searched."""


def make_row(entry: LibraryEntry) -> SessionRow:
    """Return the row of a session; called in a thread, as hundreds take longer than a frame."""
    names = entry.wearer, local_time(entry.started), entry.rig, entry.headset, entry.path.name
    return SessionRow(
        entry,
        tuple(column.text(entry) for column in COLUMNS),
        tuple(column.key(entry) for column in COLUMNS),
        " ".join(names).casefold(),
    )


class SessionsModel(QAbstractTableModel):
    """The sessions of a kind that contain every word searched, sorted by a column.

    Qt asks for as little as possible: while a job runs, each of its calls has to wait until the
    job lets Python go. A proxy model would call for every cell of every session.

    Attributes
    ----------
    rows : tuple of SessionRow
        All sessions.
    shown : list of SessionRow
    """

    def __init__(self) -> None:
        super().__init__()
        self.rows: tuple[SessionRow, ...] = ()
        self.shown: list[SessionRow] = []
        self._longest: tuple[str, ...] = ()
        self._words: tuple[str, ...] = ()
        self._kind: Filter = "all"
        self._column, self._order = 1, Qt.SortOrder.DescendingOrder
        self._font = number_font()

    def show_rows(self, rows: Sequence[SessionRow]) -> None:
        """Replace the sessions."""
        self.rows = tuple(rows)
        self._longest = tuple(
            max(texts, key=len) for texts in zip(*(row.texts for row in rows), strict=True)
        )
        self._show()

    def search(self, text: str, kind: Filter) -> None:
        """Show other sessions of these."""
        self._words, self._kind = tuple(text.casefold().split()), kind
        self._show()

    def sort(self, column: int, order: Qt.SortOrder = Qt.SortOrder.AscendingOrder) -> None:
        """Sort by a column."""
        self._column, self._order = column, order
        self._show()

    def longest_text(self, column: int) -> str:
        """Return the longest text in a column; empty without sessions."""
        return self._longest[column] if self._longest else ""

    def rowCount(self, parent: _Index = _NO_INDEX) -> int:
        """Return the number of sessions shown."""
        return 0 if parent.isValid() else len(self.shown)

    def columnCount(self, parent: _Index = _NO_INDEX) -> int:
        """Return the number of columns."""
        return 0 if parent.isValid() else len(COLUMNS)

    def multiData(self, index: _Index, wanted: Iterable[QModelRoleData]) -> None:  # type: ignore[override]
        """Give all that is drawn of a cell at once."""
        for one in wanted:  # a span, of which PySide does not declare that it is iterable
            one.setData(self.data(index, one.role()))

    def data(self, index: _Index, role: int = Qt.ItemDataRole.DisplayRole) -> object:
        """Return a cell's text, picture, tooltip, font or alignment."""
        row, column = self.shown[index.row()], COLUMNS[index.column()]
        match role:
            case Qt.ItemDataRole.DisplayRole:
                return row.texts[index.column()]
            case Qt.ItemDataRole.DecorationRole if index.column() == 0:
                return error_bars(row.entry.eyes)
            case Qt.ItemDataRole.AccessibleDescriptionRole if index.column() == 0:
                return picture_text(row.entry.eyes)
            case Qt.ItemDataRole.ToolTipRole:
                return _tooltip(row, index.column())
            case Qt.ItemDataRole.FontRole if column.is_number:
                return self._font
            case Qt.ItemDataRole.TextAlignmentRole:
                return _alignment(column)
        return None

    def headerData(
        self,
        section: int,
        orientation: Qt.Orientation,
        role: int = Qt.ItemDataRole.DisplayRole,
    ) -> object:
        """Return a column's title or its meaning."""
        if orientation == Qt.Orientation.Vertical:
            return None
        column = COLUMNS[section]
        texts = {
            Qt.ItemDataRole.DisplayRole: column.title,
            Qt.ItemDataRole.ToolTipRole: column.tooltip,
            Qt.ItemDataRole.TextAlignmentRole: _alignment(column),
        }
        return texts.get(Qt.ItemDataRole(role))

    def _show(self) -> None:
        self.beginResetModel()
        found = [
            row
            for row in self.rows
            if _is_of(row.entry, self._kind) and all(word in row.searched for word in self._words)
        ]
        is_reversed = self._order == Qt.SortOrder.DescendingOrder
        self.shown = sorted(found, key=lambda row: row.keys[self._column], reverse=is_reversed)
        self.endResetModel()


def _tooltip(row: SessionRow, column: int) -> str:
    """Return what a cell shows, which may be cut, and what no column has room for."""
    entry = row.entry
    copy = tr("Repaired in {}").format(entry.repaired_as) if entry.repaired_as else ""
    spared = (
        f"{COLUMNS[i].title}: {row.texts[i]}"
        for i in _TOLD
        if i != column and row.texts[i] != NOTHING
    )
    errors = (error_text if column else picture_text)(entry.eyes)
    lines = row.texts[column], copy, entry.problem or str(entry.path), *spared, errors
    return plain_tooltip("\n".join(filter(None, lines)))


def _is_of(entry: LibraryEntry, kind: Filter) -> bool:
    match kind:
        case "all":
            return True
        case "accepted":
            return is_accepted(entry)
        case "repeat":
            return bool(entry.eyes) and not is_accepted(entry)
        case "unfinished":
            return not (entry.is_finished or entry.problem)
        case "damaged":
            return is_damaged(entry)


def _alignment(column: _Column) -> Qt.AlignmentFlag:
    # Right-aligned, a number ran into the text of the next column.
    side = Qt.AlignmentFlag.AlignHCenter if column.is_number else Qt.AlignmentFlag.AlignLeft
    return side | Qt.AlignmentFlag.AlignVCenter

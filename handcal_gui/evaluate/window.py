"""The evaluation window, which leaves the main window usable."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

from PySide6.QtCore import QSize, Qt, Signal
from PySide6.QtGui import QGuiApplication, QKeyEvent
from PySide6.QtWidgets import (
    QDialog,
    QLabel,
    QListWidget,
    QListWidgetItem,
    QStackedWidget,
    QWidget,
)

from handcal_gui.app.theme import SPACING_PX, scale_font
from handcal_gui.app.translation import tr
from handcal_gui.evaluate.entries import EvaluationEntries
from handcal_gui.evaluate.evaluation_page import EvaluationPage, EvaluationSpec
from handcal_gui.widgets.fields import button, with_name
from handcal_gui.widgets.job_bar import may_cancel
from handcal_gui.widgets.key_cap import KeyCap
from handcal_gui.widgets.layouts import hbox, vbox

_FIRST_SIZE = QSize(1240, 860)
_RAIL_PX = 24 * SPACING_PX


class EvaluationWindow(QDialog):
    """Offers evaluations, one of which can run at a time; closing asks, and cancels it.

    Parameters
    ----------
    specs : mapping of str to EvaluationSpec
        By field of the entries.
    entries : EvaluationEntries
        Initial settings.
    read : callable
        Shows a page of the manual.

    Attributes
    ----------
    remembered : Signal(EvaluationEntries)
        The settings as entered, to be proposed next time.
    """

    remembered = Signal(object)

    def __init__(
        self,
        specs: Mapping[str, EvaluationSpec],
        entries: EvaluationEntries,
        parent: QWidget | None = None,
        read: Callable[[str], object] = lambda _page: None,
    ) -> None:
        super().__init__(parent)
        self.setObjectName("evaluationWindow")
        self.setWindowTitle(tr("Evaluate"))
        # A separate window with all window buttons.
        self.setWindowFlags(Qt.WindowType.Window)
        self._entries = entries
        self._specs = specs
        self._is_closing = False
        self._rail = with_name(QListWidget(), "evaluationRail", tr("Evaluations"))
        self._title = QLabel()
        self._stack = QStackedWidget()
        self._pages: dict[str, EvaluationPage] = {}
        for name, spec in specs.items():
            page = EvaluationPage(spec, getattr(entries, name), read)
            page.busy_changed.connect(partial(self._change_busy, name))
            self._stack.addWidget(page)
            item = QListWidgetItem(spec.title)
            item.setSizeHint(QSize(0, 4 * SPACING_PX))
            self._rail.addItem(item)
            self._pages[name] = page
        self._close = button("close", tr("Cl&ose"), help_text=tr("The entries are kept"))
        self._close.clicked.connect(self.reject)
        self._lay_out()
        self._rail.currentRowChanged.connect(self._go_to)
        self._rail.setCurrentRow(0)
        self.resize(QGuiApplication.primaryScreen().availableSize().boundedTo(_FIRST_SIZE))

    @property
    def entries(self) -> EvaluationEntries:
        """The settings as entered."""
        return replace(self._entries, **{name: one.entries for name, one in self._pages.items()})

    @property
    def page(self) -> EvaluationPage:
        """The page shown."""
        return list(self._pages.values())[self._rail.currentRow()]

    def show_page(self, name: str) -> None:
        """Show an evaluation."""
        self._rail.setCurrentRow(list(self._pages).index(name))

    def reject(self) -> None:
        """Close; a running evaluation is cancelled first, if the user agrees."""
        for name, page in self._pages.items():
            question = tr("{} is running. {}").format(self._specs[name].title, page.kept)
            if page.is_busy and not self._is_closing and not may_cancel(self, question):
                return
        busy = [page for page in self._pages.values() if page.is_busy]
        self._is_closing = bool(busy)
        for page in busy:
            page.cancel()
        if not busy:
            self.stop()

    def stop(self) -> None:
        """Cancel the running evaluation, wait for its end, and close."""
        for page in self._pages.values():
            page.stop()
        self.remembered.emit(self.entries)
        super().reject()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Let Enter press only the button that has the focus."""
        if event.key() not in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
            super().keyPressEvent(event)

    def _go_to(self, row: int) -> None:
        self._title.setText(list(self._specs.values())[row].title)
        self._stack.setCurrentIndex(row)

    def _change_busy(self, name: str, is_busy: bool) -> None:
        for other, page in self._pages.items():
            page.wait_for(self._specs[name].title if is_busy and other != name else "")
        if is_busy:
            self.remembered.emit(self.entries)
        elif self._is_closing:
            self.stop()

    def _lay_out(self) -> None:
        scale_font(self._title, 1.6, is_bold=True)
        self._rail.setFixedWidth(_RAIL_PX)
        right = vbox(self._title, (self._stack, 1), spacing=SPACING_PX)
        close = hbox(self._close, KeyCap("closeKey", "Escape"), 1, spacing=SPACING_PX)
        left = vbox((self._rail, 1), close, spacing=SPACING_PX)
        hbox(left, (right, 1), on=self, margins=2 * SPACING_PX, spacing=2 * SPACING_PX)

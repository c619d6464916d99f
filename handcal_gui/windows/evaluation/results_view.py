"""Results of an evaluation: figures, numbers, and buttons for the files."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QLabel, QStackedLayout, QTabWidget, QWidget

from handcal.report.document import Figure, Report, Table
from handcal.types import UInt8
from handcal_gui.theme import SPACING_PX
from handcal_gui.translation import tr
from handcal_gui.widgets.elided_label import ElidedLabel
from handcal_gui.widgets.fields import button, fill_row, paragraph, with_name
from handcal_gui.widgets.image_view import ImageView
from handcal_gui.widgets.layouts import scrollable, vbox
from handcal_gui.widgets.number_table import NumberTable, Row
from handcal_gui.widgets.opening import open_path
from handcal_gui.widgets.sentence import sentence
from handcal_gui.windows.evaluation.work import Outcome


class ResultsView(QWidget):
    """Shows the main finding, the key tables, and each figure as written to file."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("results")
        self._folder = Path()
        self._pages: list[QWidget] = []
        self._empty = with_name(QLabel(tr("Figures and numbers will be shown here.")), "noResults")
        self._empty.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self._lead = paragraph("lead")
        self._lead.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self._tabs = with_name(QTabWidget(), "figures", tr("Results"))
        self._tabs.setElideMode(Qt.TextElideMode.ElideNone)
        self._path = with_name(ElidedLabel(), "resultsFolder")
        self._lay_out()

    @property
    def is_empty(self) -> bool:
        """True if no result is shown."""
        return self._stack.currentIndex() == 0

    def show_outcome(self, outcome: Outcome | None) -> None:
        """Show a result; None clears the view."""
        self._stack.setCurrentIndex(0 if outcome is None else 1)
        self._tabs.clear()
        for page in self._pages:
            page.deleteLater()
        self._pages = []
        if outcome is None:
            return
        self._folder = outcome.folder
        self._path.setText(str(outcome.folder))
        self._lead.setText(outcome.report.lead)
        tables = _key_tables(outcome.report)
        for title, table in zip(_titles(tables), tables, strict=True):
            self._add(title, _table_page(table))
        first = [item for section in outcome.report.sections[:1] for item in section.items]
        if terms := [item for item in first if isinstance(item, str)]:
            text = paragraph("terms", "\n\n".join(terms))
            text.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
            text.setAlignment(Qt.AlignmentFlag.AlignTop)
            text.setMargin(SPACING_PX)
            self._add(tr("Terms and methods"), scrollable(text))
        names = {figure.name for figure in outcome.report.figures}
        for figure, picture in zip(outcome.report.figures, outcome.pictures, strict=True):
            only = figure.name.removesuffix("-1")  # unless there is a second one
            name = figure.name if f"{only}-2" in names else only
            title = sentence(name.replace("-", " "))
            self._add(title, _figure_page(title, figure, picture))

    def _add(self, title: str, page: QWidget) -> None:
        self._pages.append(page)
        self._tabs.addTab(page, title)

    def _open(self, name: str) -> None:
        open_path(self, self._folder / name)

    def _lay_out(self) -> None:
        foot, buttons = QWidget(), []
        for name, text, file, help_text in (
            (
                "openPdf",
                tr("Open &report"),
                "report.pdf",
                tr("Report as PDF, for reading and archiving"),
            ),
            (
                "openHtml",
                tr("Open in &browser"),
                "report.html",
                tr("The same report as HTML, with the numbers of each figure"),
            ),
            (
                "openFolder",
                tr("Open &folder"),
                "",
                tr("Folder with report, figures and raw numbers as CSV"),
            ),
        ):
            buttons.append(button(name, text, help_text=help_text))
            buttons[-1].clicked.connect(lambda _checked=False, file=file: self._open(file))
        fill_row(foot, self._path, *buttons, grows=self._path)
        shown = QWidget()
        vbox(self._lead, (self._tabs, 1), foot, on=shown, margins=0, spacing=SPACING_PX)
        self._stack = QStackedLayout(self)
        self._stack.addWidget(self._empty)
        self._stack.addWidget(shown)


def _key_tables(report: Report) -> list[Table]:
    """Return the tables with a header, from the first section that has any."""
    for section in report.sections:
        tables = [item for item in section.items if isinstance(item, Table)]
        if shown := [table for table in tables if any(one.title for one in table.columns)]:
            return shown
    return []


def _titles(tables: list[Table]) -> list[str]:
    """Return the beginnings of the tables' captions; numbers if these do not tell them apart."""
    if len(tables) == 1:
        return [tr("Numbers")]
    titles = [sentence(one.caption.partition(",")[0].rstrip(".")) for one in tables]
    if all(titles) and len(set(titles)) == len(titles):
        return titles
    return [tr("Numbers {}").format(number) for number in range(1, len(tables) + 1)]


def _table_page(table: Table) -> QWidget:
    view = NumberTable("numbers", tr("Numbers"), hides=True)
    titles = [column.title for column in table.columns[1:]]
    view.show_rows(titles, [Row(cells[0], tuple(cells[1:])) for cells in table.rows])
    return _page(view, table.caption)


def _figure_page(title: str, figure: Figure, picture: UInt8) -> QWidget:
    view = ImageView(tr("Figure {}").format(title))
    view.setAccessibleDescription(figure.caption)
    view.show_image(picture)
    file = tr("Drawn on white, as in the exported figures/{}.png.").format(figure.name)
    return _page(view, f"{figure.caption} {file}".lstrip())


def _page(view: QWidget, caption: str) -> QWidget:
    page = QWidget()
    layout = vbox((view, 1), on=page, spacing=SPACING_PX)
    if caption:
        layout.addWidget(paragraph("caption", caption))
    return page

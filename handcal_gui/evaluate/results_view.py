"""Results of an evaluation: figures, numbers, and buttons for the files."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QMouseEvent
from PySide6.QtWidgets import (
    QComboBox,
    QDialog,
    QLabel,
    QStackedLayout,
    QStackedWidget,
    QWidget,
)

from handcal.core.types import UInt8
from handcal.report.document import Figure, Report
from handcal.report.document import Table as ReportTable
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.evaluate.work import Outcome
from handcal_gui.widgets.elided_label import ElidedLabel
from handcal_gui.widgets.fields import (
    button,
    choice,
    fill_row,
    label_for,
    paragraph,
    with_name,
)
from handcal_gui.widgets.image_view import ImageView
from handcal_gui.widgets.layouts import hbox, scrollable, vbox
from handcal_gui.widgets.opening import open_path
from handcal_gui.widgets.sentence import sentence
from handcal_gui.widgets.table import Column, Row, Table


class ResultsView(QWidget):
    """Shows the main finding, the key tables, and each figure as written to file.

    Parameters
    ----------
    coming : str
        Announces what will be shown here, while there is no result.
    """

    def __init__(self, coming: str = "", parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("results")
        self._folder = Path()
        self._makers: list[Callable[[], QWidget]] = []
        self._empty = paragraph("noResults", coming)
        self._empty.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self._lead = paragraph("lead")
        self._lead.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self._choice = choice("figures", tr("Figure or numbers"), {})
        self._choice.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToContents)
        self._pages = QStackedWidget()
        self._choice.currentIndexChanged.connect(self._pages.setCurrentIndex)
        self._enlarge = button("enlarge", tr("&View large"), help_text=tr("Fill the screen"))
        self._enlarge.clicked.connect(self.enlarge)
        self._path = with_name(ElidedLabel(), "resultsFolder")
        self._lay_out()

    @property
    def is_empty(self) -> bool:
        """True if no result is shown."""
        return self._stack.currentIndex() == 0

    def show_outcome(self, outcome: Outcome | None) -> None:
        """Show a result; None clears the view."""
        self._stack.setCurrentIndex(0 if outcome is None else 1)
        self._choice.clear()
        self._makers = []
        while (page := self._pages.widget(0)) is not None:
            self._pages.removeWidget(page)
            page.deleteLater()
        if outcome is None:
            return
        self._folder = outcome.folder
        self._path.setText(str(outcome.folder))
        self._lead.setText(outcome.report.lead)
        tables = _key_tables(outcome.report)
        for title, table in zip(_titles(tables), tables, strict=True):
            self._add(title, partial(_table_page, table))
        first = [item for section in outcome.report.sections[:1] for item in section.items]
        if terms := [item for item in first if isinstance(item, str)]:
            self._add(tr("Terms and methods"), partial(_text_page, "\n\n".join(terms)))
        names = {figure.name for figure in outcome.report.figures}
        for figure, picture in zip(outcome.report.figures, outcome.pictures, strict=True):
            only = figure.name.removesuffix("-1")  # unless there is a second one
            name = figure.name if f"{only}-2" in names else only
            title = sentence(name.replace("-", " "))
            self._add(title, partial(_figure_page, title, figure, picture))

    def enlarge(self) -> None:
        """Fill the screen with the figure or numbers shown."""
        large = with_name(QDialog(self), "large")
        large.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        large.setWindowTitle(self._choice.currentText())
        page = self._makers[self._choice.currentIndex()]()
        for sheet in page.findChildren(_Sheet):
            sheet.clicked.connect(large.close)
        close = button("closeLarge", tr("&Close"))
        close.clicked.connect(large.close)
        foot = hbox(1, QLabel(tr("Escape goes back.")), close, spacing=SPACING_PX)
        vbox((page, 1), foot, on=large, margins=SPACING_PX)
        large.setModal(True)
        large.showFullScreen()

    def _add(self, title: str, make: Callable[[], QWidget]) -> None:
        """Add a page, which can be made again to fill the screen."""
        page = make()
        for sheet in page.findChildren(_Sheet):
            sheet.setToolTip(tr("Click to fill the screen"))
            sheet.clicked.connect(self.enlarge)
        self._makers.append(make)
        self._pages.addWidget(page)
        self._choice.addItem(title)

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
        head, shown = QWidget(), QWidget()
        label = label_for(self._choice, tr("Figure or &numbers"))
        hbox(label, self._choice, 1, self._enlarge, on=head, margins=0, spacing=SPACING_PX)
        vbox(self._lead, head, (self._pages, 1), foot, on=shown, margins=0, spacing=SPACING_PX)
        self._stack = QStackedLayout(self)
        self._stack.addWidget(self._empty)
        self._stack.addWidget(shown)


class _Sheet(ImageView):
    """A figure that can be clicked."""

    clicked = Signal()

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        """Tell of the click."""
        if event.button() is Qt.MouseButton.LeftButton:
            self.clicked.emit()


def _key_tables(report: Report) -> list[ReportTable]:
    """Return the tables with a header, from the first section that has any."""
    for section in report.sections:
        tables = [item for item in section.items if isinstance(item, ReportTable)]
        if shown := [table for table in tables if any(one.title for one in table.columns)]:
            return shown
    return []


def _titles(tables: list[ReportTable]) -> list[str]:
    """Return the tables' names; numbers for those without one."""
    if len(tables) == 1:
        return [tr("Numbers")]
    return [one.name or tr("Numbers {}").format(n) for n, one in enumerate(tables, 1)]


def _table_page(table: ReportTable) -> QWidget:
    view = Table("numbers", tr("Numbers"))
    columns = [
        Column(one.title.replace(", ", "\n"), rank=i) for i, one in enumerate(table.columns[1:])
    ]
    caption = paragraph("caption", table.caption)

    def name_hidden() -> None:
        more = tr("There is no room for: {}. View large, or open the report.")
        hidden = more.format("; ".join(view.hidden).replace("\n", ", ")) if view.hidden else ""
        caption.setText(f"{table.caption} {hidden}".strip())

    view.hidden_changed.connect(name_hidden)
    view.show_rows(columns, [Row(cells[0], tuple(cells[1:])) for cells in table.rows])
    return _page(view, caption)


def _text_page(terms: str) -> QWidget:
    text = paragraph("terms", terms)
    text.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
    text.setAlignment(Qt.AlignmentFlag.AlignTop)
    text.setMargin(SPACING_PX)
    return scrollable(text)


def _figure_page(title: str, figure: Figure, picture: UInt8) -> QWidget:
    view = _Sheet(tr("Figure {}").format(title))
    view.setAccessibleDescription(figure.caption)
    view.setCursor(Qt.CursorShape.PointingHandCursor)
    view.show_image(picture)
    file = tr("Drawn on white, as in the exported figures/{}.png.").format(figure.name)
    return _page(view, paragraph("caption", f"{figure.caption} {file}".lstrip()))


def _page(view: QWidget, caption: QWidget) -> QWidget:
    page = QWidget()
    vbox((view, 1), caption, on=page, margins=0, spacing=SPACING_PX)
    return page

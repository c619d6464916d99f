"""The first step: the calibration target and the initial rig."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import get_args

from PySide6.QtWidgets import (
    QCheckBox,
    QFormLayout,
    QLabel,
    QMessageBox,
    QWidget,
)

from handcal.core.entry import RIG_FILES
from handcal.core.errors import FileError, HandcalError
from handcal.core.types import PART_NAMES, Rig, UInt8
from handcal.io.images import write_png
from handcal.io.resources import resource_path
from handcal.rig.boards.board import DICTIONARIES, Board, BoardKind
from handcal.rig.boards.printing import Paper, draw_board, write_board_pdf
from handcal.rig.compare import compare_rigs
from handcal.rig.rig_file import read_rig
from handcal.station.checks.doctor import Finding, Health
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.engine.latest_job import LatestJob
from handcal_gui.rig.file_dialogs import ask_open, ask_save
from handcal_gui.rig.project import RigProject
from handcal_gui.widgets.action_strip import action_strip
from handcal_gui.widgets.fields import (
    button,
    choice,
    fill_row,
    label_for,
    main_button,
    number,
    paragraph,
    whole_number,
    with_name,
)
from handcal_gui.widgets.finding_line import FindingLine
from handcal_gui.widgets.image_view import ImageView
from handcal_gui.widgets.layouts import hbox, vbox

_KINDS: dict[BoardKind, str] = {"charuco": "ChArUco", "checkerboard": tr("Checkerboard")}
_TINY = 1e-6
"""Difference of a number that was rounded."""
_PREVIEW_PX, _PICTURE_PX = 40, 100  # side of a square


class BoardPage(QWidget):
    """Describes, shows and saves the board, and selects the initial rig."""

    def __init__(self, project: RigProject, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("boardPage")
        self._project = project
        self._example = resource_path("example_rig.yaml")
        squares_help = tr("Squares, not inner corners.")
        self._kind = choice(
            "kind",
            tr("Kind of board"),
            _KINDS,
            tr("A ChArUco board may be partly hidden; a checkerboard must be seen whole."),
        )
        self._columns = whole_number("columns", 3, 40, squares_help)
        self._rows = whole_number("rows", 3, 40, squares_help)
        self._square = number(
            "square",
            1.0,
            1000.0,
            0.05,
            " mm",
            tr("Side length of a square, measured on the print."),
        )
        self._marker = number(
            "marker", 0.3, 950.0, 0.05, " mm", tr("Measured side length of a marker.")
        )
        self._dictionary = choice(
            "dictionary",
            tr("Dictionary"),
            {name: name for name in DICTIONARIES},
            tr("Dictionary of the markers."),
        )
        self._legacy = with_name(
            QCheckBox(tr("Print&ed by OpenCV before 4.6")),
            "legacy",
            help_text=tr("Boards with an even number of rows started with a white square."),
        )
        self._paper = choice(
            "paper",
            tr("Paper"),
            {paper: paper.capitalize() for paper in get_args(Paper)},
            tr("Size of the sheet of the PDF."),
        )
        self.main = main_button("savePdf", tr("Save as &PDF…"))
        self.main.setToolTip(tr("To scale, with a ruler to check the print"))
        self.strip = action_strip(self.main)
        self._picture = button(
            "savePicture", tr("Save &image…"), help_text=tr("PNG, to show on a screen")
        )
        self._begin = button("begin", tr("&Use another initial rig…"))
        self._afresh = button("afresh", tr("Use the e&xample"))
        self._rig, self._state = paragraph("initialRig"), paragraph("initialRigState")
        self._found = FindingLine("board")
        self._problem = ""
        self._preview = ImageView(tr("Preview of the board"))
        self._draw = LatestJob(_draw, self)
        self._draw.answered.connect(lambda _board, image: self._preview.show_image(image))
        self._show_board(project.inputs.board)
        self._paper.setCurrentIndex(self._paper.findData(project.inputs.paper))
        self._lay_out()
        for options in (self._kind, self._dictionary, self._paper):
            options.currentIndexChanged.connect(self._take)
        for spin in (self._columns, self._rows, self._square, self._marker):
            spin.valueChanged.connect(self._take)
        self._legacy.toggled.connect(self._take)
        self.main.clicked.connect(self._save_pdf)
        self._picture.clicked.connect(self._save_picture)
        self._begin.clicked.connect(self._ask_for_rig)
        self._afresh.clicked.connect(lambda: self._start_from(self._example))
        project.rig_changed.connect(self._show_rig)
        self._show_rig()
        self._take()

    def stop(self) -> None:
        """Wait for background work to end."""
        self._draw.stop()

    def enter(self) -> None:
        """Show whether the board has been found."""
        self._show_state()

    def _show_board(self, board: Board) -> None:
        self._kind.setCurrentIndex(self._kind.findData(board.kind))
        self._columns.setValue(board.squares[0])
        self._rows.setValue(board.squares[1])
        self._square.setValue(1e3 * board.square_m)
        self._marker.setValue(1e3 * board.marker_m)
        self._dictionary.setCurrentIndex(self._dictionary.findData(board.dictionary))
        self._legacy.setChecked(board.legacy)

    def _take(self) -> None:
        is_charuco = self._kind.currentData() == "charuco"
        for field in (self._marker, self._dictionary, self._legacy):
            field.setEnabled(is_charuco)
        try:
            board = Board(
                kind=self._kind.currentData(),
                squares=(self._columns.value(), self._rows.value()),
                square_m=round(self._square.value() / 1e3, 6),
                marker_m=round(self._marker.value() / 1e3, 6),
                dictionary=self._dictionary.currentData(),
                legacy=self._legacy.isChecked(),
            )
        except ValueError as error:
            self._preview.show_text(message=tr("No such board exists"))
            self._problem = str(error)
            self._show_state()
            return
        self._problem = ""
        self._preview.show_text()
        self._project.enter(board=board, paper=self._paper.currentData())
        self._show_state()
        self._draw.ask(board)

    def _show_state(self) -> None:
        inner = " × ".join(map(str, self._project.inputs.board.inner))
        corners = tr("{} inner corners").format(inner)
        advice = tr("no image shows this board yet: take images in the next step")
        found = Finding("", Health.LIMITED, corners, advice)
        for save in (self.main, self._picture):
            save.setEnabled(not self._problem)
        if self._problem:
            found = Finding("", Health.BROKEN, self._problem)
        elif self._project.inputs.board_found:
            found = Finding("", Health.GOOD, tr("{}, found in an image").format(corners))
        self._found.show_finding(found, is_waiting=found.advice == advice)

    def _save_pdf(self) -> None:
        title = tr("Save the board")
        if path := ask_save(self._project, self, title, "board.pdf", tr("PDF (*.pdf)")):
            self._save(lambda: write_board_pdf(path, *self._printed()), path)

    def _save_picture(self) -> None:
        title = tr("Save the board")
        if path := ask_save(self._project, self, title, "board.png", tr("PNG (*.png)")):
            self._save(lambda: _write_picture(path, self._project.inputs.board), path)

    def _printed(self) -> tuple[Board, Paper]:
        return self._project.inputs.board, self._project.inputs.paper

    def _save(self, write: Callable[[], None], path: Path) -> None:
        try:
            write()
        except (ValueError, FileError) as error:
            self._found.show_finding(Finding("", Health.BROKEN, tr("not saved: {}").format(error)))
            return
        advice = tr("print it at 100 % and measure the ruler and the squares")
        self._found.show_finding(Finding("", Health.GOOD, tr("saved as {}").format(path), advice))

    def _ask_for_rig(self) -> None:
        if path := ask_open(self._project, self, tr("Choose an initial rig"), tr(RIG_FILES)):
            self._start_from(path)

    def _start_from(self, path: Path) -> None:
        if not self._confirm_discard():
            return
        try:
            self._project.start_from(path)
        except HandcalError as error:
            self._found.show_finding(Finding("", Health.BROKEN, str(error)))

    def _confirm_discard(self) -> bool:
        """Ask before calibrated parts that have not been saved are discarded."""
        if not self._project.rig.origins or self._project.saved_file is not None:
            return True
        parts = ", ".join(PART_NAMES[part] for part in self._project.rig.origins)
        yes, no = QMessageBox.StandardButton.Yes, QMessageBox.StandardButton.No
        title = tr("Use another initial rig")
        text = tr("The rig has not been saved; this will be lost: {}. Continue?").format(parts)
        return QMessageBox.question(self, title, text, yes | no, no) == yes

    def _show_rig(self) -> None:
        rig = self._project.rig
        parts = ", ".join(PART_NAMES[part] for part in rig.origins)
        self._rig.setText(tr("In use: {}").format(rig.name))
        self._state.setText(
            tr("Calibrated: {}.").format(parts)
            if parts
            else tr("Nothing of this rig is calibrated yet.")
        )
        is_example = _is_same(rig, read_rig(self._example))
        self._afresh.setEnabled(not is_example)
        self._afresh.setToolTip(
            tr("The example is in use") if is_example else tr("Start afresh from the example rig")
        )

    def _lay_out(self) -> None:
        squares, paper = QWidget(), QWidget()
        fill_row(squares, self._columns, QLabel("×"), self._rows, grows=self._rows)
        hbox(self._paper, self._picture, 1, on=paper, margins=0, spacing=SPACING_PX)
        form = QFormLayout()
        form.setHorizontalSpacing(2 * SPACING_PX)
        form.setVerticalSpacing(SPACING_PX)
        for label, field in (
            (tr("Boar&d"), self._kind),
            (tr("S&quares"), squares),
            (tr("&Square"), self._square),
            (tr("&Marker"), self._marker),
            (tr("Di&ctionary"), self._dictionary),
            ("", self._legacy),
            (tr("P&aper"), paper),
        ):
            form.addRow(label_for(field, label), field)
        left = vbox(form, self._found, spacing=SPACING_PX)
        left.addWidget(
            paragraph(
                text=tr(
                    "The initial rig provides what the headset itself reports: the size of its "
                    "displays and the poses of its rendering cameras."
                )
            )
        )
        left.addLayout(hbox((self._rig, 1), self._afresh, spacing=SPACING_PX))
        left.addLayout(hbox((self._state, 1), self._begin, spacing=SPACING_PX))
        left.addStretch(1)
        hbox((left, 1), (self._preview, 1), on=self, margins=0, spacing=3 * SPACING_PX)


def _is_same(a: Rig, b: Rig) -> bool:
    """Return whether two rigs of which nothing was calibrated agree."""
    differences = [one.value for one in compare_rigs(a, b)]
    return a.name == b.name and not (a.origins or b.origins) and max(differences) < _TINY


def _draw(board: Board) -> UInt8:
    return draw_board(board, _PREVIEW_PX)


def _write_picture(path: Path, board: Board) -> None:
    write_png(path, draw_board(board, _PICTURE_PX))

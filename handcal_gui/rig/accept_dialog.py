"""A dialog that accepts a rig without a wearer: images taken live, and the page with the result."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from PySide6.QtCore import QSize
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QDialog, QGridLayout, QLabel, QWidget

from handcal.core.errors import HandcalError
from handcal.core.progress import Progress
from handcal.core.types import EYES, Eye
from handcal.io.images import IMAGE_SUFFIXES
from handcal.rig.acceptance.accept import FEWEST_VIEWS, LIMIT_ARCMIN
from handcal.rig.acceptance.acceptance import (
    Acceptance,
    AcceptanceSettings,
    passed_words,
    run_acceptance,
    view_rows,
)
from handcal.rig.assemble import screen_of
from handcal.rig.boards.board import Board
from handcal.rig.boards.choose import ALIKE, ChooseSettings
from handcal.rig.displays.grid import grid_on
from handcal.rig.rig_file import write_rig
from handcal.station.checks.doctor import Finding, Health
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.rig.project import RigProject
from handcal_gui.rig.solve import CAMERA_MISSING
from handcal_gui.rig.step_inputs import STEP_TITLES
from handcal_gui.rig.take_dialog import TakeDialog
from handcal_gui.widgets.action_strip import action_strip
from handcal_gui.widgets.drawing import Drawing
from handcal_gui.widgets.fields import button, main_button, paragraph
from handcal_gui.widgets.finding_line import FindingLine
from handcal_gui.widgets.job_bar import JobBar
from handcal_gui.widgets.layouts import vbox
from handcal_gui.widgets.opening import open_path
from handcal_gui.widgets.result_rows import EYE_NAMES
from handcal_gui.widgets.table import Row, Table

_HOW = tr(
    "For each eye, put the viewpoint camera behind its display. In a dark room, take "
    "images of the grid. Do not move camera or headset: switch the display off, and take images "
    "of the board with both cameras at {} or more distances, 0.35 to 0.65 m. The rig passes if "
    "the drawn corners of the board lie, on average, within {:g}′ of those seen."
).format(FEWEST_VIEWS, LIMIT_ARCMIN)
_COLUMNS = (tr("Corners"), tr("Mean, ′ (at most {:g})").format(LIMIT_ARCMIN), tr("Largest, ′"))
_TAKE: dict[Eye, dict[str, str]] = {
    "left": {"grid": tr("Take &grid…"), "board": tr("Take &board…")},
    "right": {"grid": tr("Take g&rid…"), "board": tr("Take bo&ard…")},
}
"""Text of each button; its letter is its own."""


class AcceptDialog(QDialog):
    """Takes the images of an acceptance, and shows whether the rig passes.

    Parameters
    ----------
    project : RigProject
        Images and page are stored in ``accept`` in the project's folder.
    """

    def __init__(self, project: RigProject, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("acceptDialog")
        self.setWindowTitle(tr("Accept the rig"))
        self._project = project
        self._folder = project.folder.path / "accept"
        self._page: Path | None = None
        self._counts = {eye: QLabel() for eye in EYES}
        self._found = FindingLine("accepted")
        self._drawing = Drawing("docs/pictures/setup-accept.svg")
        self._drawing.setMinimumHeight(10 * SPACING_PX)
        self._table = Table("drawn-against-seen", tr("Drawn and seen corners"))
        self._bar = JobBar()
        self._run = main_button("runAcceptance", tr("Check the rig"))
        self._open = button("openPage", tr("Open re&port"))
        self._close = button("close", tr("&Close"))
        self._run.clicked.connect(self.run)
        self._open.clicked.connect(self._open_page)
        self._close.clicked.connect(self.accept)
        self._bar.failed.connect(
            lambda why: self._found.show_finding(Finding("", Health.BROKEN, why))
        )
        self._bar.cancelled.connect(self._show_state)
        self._bar.busy_changed.connect(self._refresh)
        self._lay_out()
        self._refresh()
        self._show_state()

    def run(self) -> None:
        """Evaluate the eyes that have images."""
        project, folder = self._project, self._folder
        settings = AcceptanceSettings(
            folder,
            folder / "rig.yaml",
            folder / "page",
            project.inputs.board,
            project.inputs.left.square_px,
            self._eyes,
            project.camera_file,
        )
        rig = project.rig

        def work(progress: Progress) -> object:
            write_rig(settings.rig, rig)
            return run_acceptance(settings, progress)

        self._found.clear()
        self._bar.run(tr("Looking for grid and board"), work, self._show)

    def done(self, result: int) -> None:
        """Cancel the evaluation, and close."""
        self._bar.stop()
        super().done(result)

    @property
    def _eyes(self) -> tuple[Eye, ...]:
        return tuple(
            eye
            for eye in EYES
            if self._count(eye, "grid") and self._count(eye, "viewpoint") >= FEWEST_VIEWS
        )

    @property
    def _need(self) -> str:
        """Advice on what is missing before the rig can be accepted; empty if nothing is."""
        if not self._project.camera_file.exists():
            return CAMERA_MISSING
        if self._eyes:
            return ""
        return tr(
            "for one eye at least, take images of the grid and {} or more of the board"
        ).format(FEWEST_VIEWS)

    def _count(self, eye: Eye, what: str) -> int:
        folder = self._folder / eye / what
        if not folder.is_dir():
            return 0
        return sum(path.suffix.lower() in IMAGE_SUFFIXES for path in folder.iterdir())

    def _take(self, eye: Eye, what: str) -> None:
        project = self._project
        board, choose = project.inputs.board, ChooseSettings()
        folders = {
            tr("Viewpoint camera"): self._folder / eye / "viewpoint",
            tr("Depth camera"): self._folder / eye / "depth",
        }
        if what == "grid":
            try:
                board, choose = self._grid_board(eye), ALIKE
            except HandcalError as error:
                self._found.show_finding(Finding("", Health.BROKEN, str(error)))
                return
            folders = {tr("Viewpoint camera"): self._folder / eye / "grid"}
        count = self._count(eye, "grid" if what == "grid" else "viewpoint")
        dialog = TakeDialog(
            folders,
            board,
            choose,
            project.realsense,
            self,
            project.inputs.sources,
            1 if what == "grid" else FEWEST_VIEWS,
            count * [()],
        )
        dialog.remembered.connect(project.remember_sources)
        dialog.finished.connect(self._show_state)
        dialog.finished.connect(self._refresh)
        dialog.open()

    def _show_state(self) -> None:
        advice = self._need or tr("press Check the rig")
        finding = Finding("", Health.LIMITED, tr("not accepted yet"), advice)
        self._found.show_finding(finding, is_waiting=True)
        self._show_numbers(False)

    def _show_numbers(self, is_done: bool) -> None:
        """Show the numbers, or before there are any the drawing: both have no room."""
        self._table.setVisible(is_done)
        self._drawing.setVisible(not is_done)

    def _grid_board(self, eye: Eye) -> Board:
        screen = screen_of(self._project.rig, eye)
        square_px = self._project.inputs.left.square_px
        return grid_on(screen.width_px, screen.height_px, square_px).board

    def _show(self, found: Acceptance) -> None:
        self._page = found.files[-1]
        self._run.setText(tr("Check again"))
        rows = [
            Row(f"{EYE_NAMES[eye]}, {depth_m} m", tuple(numbers))
            for eye, one in found.eyes.items()
            for depth_m, *numbers in view_rows(one)
        ]
        self._table.show_rows(_COLUMNS, rows)
        self._show_numbers(True)
        if found.cause.words:
            text = tr("the rig fails: {}").format(found.cause.words)
            if found.cause.again:
                steps = tr(" and ").join(STEP_TITLES[part] for part in found.cause.again)
                text = tr("{} (step {})").format(text, steps)
            finding = Finding("", Health.BROKEN, text)
        else:
            is_whole = len(found.eyes) == len(EYES)
            eyes = passed_words(found.eyes)
            finding = Finding(
                "",
                Health.GOOD if is_whole else Health.LIMITED,
                tr("the rig passes: {}").format(eyes),
            )
        self._project.note_accepted(finding.found, is_passed=not found.cause.words)
        if found.left_out:
            name, why = next(iter(found.left_out.items()))
            words = tr("{} left out, such as {}: {}").format(len(found.left_out), name, why)
            finding = Finding("", finding.health, finding.found, words)
        self._found.show_finding(finding)
        self._refresh()

    def _open_page(self) -> None:
        if self._page is not None:
            open_path(self, self._page)

    def _refresh(self) -> None:
        for eye, shown in self._counts.items():
            grids, pairs = self._count(eye, "grid"), self._count(eye, "viewpoint")
            told = tr("Grid: {} of 1 or more images. Board: {} of {} or more pairs.")
            shown.setText(told.format(grids, pairs, FEWEST_VIEWS))
        self._run.setEnabled(not self._need and not self._bar.is_busy)
        self._run.setToolTip(self._need)
        self._open.setEnabled(self._page is not None)

    def _lay_out(self) -> None:
        images = QGridLayout()
        images.setHorizontalSpacing(2 * SPACING_PX)
        for row, eye in enumerate(EYES):
            images.addWidget(QLabel(EYE_NAMES[eye]), row, 0)
            for column, (what, text) in enumerate(_TAKE[eye].items(), 1):
                label = f"{text.replace('&', '').rstrip('…')}, {EYE_NAMES[eye].lower()}"
                take = button(f"{eye}-{what}", text, label)
                take.clicked.connect(partial(self._take, eye, what))
                images.addWidget(take, row, column)
            images.addWidget(self._counts[eye], row, 3)
        images.setColumnStretch(3, 1)
        foot = action_strip(self._run, self._close, self._open, bar=self._bar)
        vbox(
            paragraph("how", _HOW),
            (self._drawing, 1),
            images,
            self._found,
            (self._table, 1),
            foot,
            on=self,
            margins=2 * SPACING_PX,
            spacing=SPACING_PX,
        )
        screen = QGuiApplication.primaryScreen().availableSize()
        self.resize(self.sizeHint().boundedTo(screen - QSize(0, 6 * SPACING_PX)))

"""The images of a step: their list, the selected image, and the coverage of the view."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QLabel, QPushButton, QSplitter, QWidget

from handcal.core.progress import Progress
from handcal.io.files import user_path
from handcal.rig.boards.board import Board
from handcal.rig.boards.views import coverage
from handcal.station.checks.doctor import Finding, Health
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.rig.coverage_map import CoverageMap
from handcal_gui.rig.project import RigProject
from handcal_gui.rig.shot_list import ShotList
from handcal_gui.rig.shot_view import ShotView
from handcal_gui.rig.shots import Shot, look, other_board
from handcal_gui.rig.solve import SolvedPart
from handcal_gui.rig.uncertainty_map import UncertaintyMap
from handcal_gui.widgets.drawing import Drawing
from handcal_gui.widgets.fields import button, choice, paragraph
from handcal_gui.widgets.finding_line import FindingLine
from handcal_gui.widgets.job_bar import JobBar
from handcal_gui.widgets.layouts import hbox, vbox


class ImagesPanel(QWidget):
    """Searches folders of images for a board; single images can be excluded.

    Parameters
    ----------
    project : RigProject
        Is told of the board if it is found, and takes another that the images show.
    titles : sequence of str
        Name of the camera, or names of the two cameras of pairs.
    hint : str
        How to take the images.
    drawing : str
        Name of the drawing of the arrangement in the tutorial.
    take, again : str
        Texts of the buttons, so that two panels of a page can have different keys.

    Attributes
    ----------
    hint, drawing, buttons, search : QWidget
        How to take the images, and how their search goes on; the page places them.
    take, again : QPushButton
        Connected by the page; once `again` is pressed, `look` reads the folders again.
    shots : tuple of Shot
    dropped_changed : Signal()
        The images or the set of excluded images have changed.
    """

    dropped_changed = Signal()

    def __init__(
        self,
        project: RigProject,
        titles: tuple[str, ...],
        hint: str,
        drawing: str,
        take: str = tr("&Take images…"),
        again: str = tr("Find the board &again"),
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self._project = project
        self.buttons, self.search = QWidget(), QWidget()
        self.shots: tuple[Shot, ...] = ()
        self._question: tuple[tuple[Path, ...], Board] | None = None
        self._list = ShotList(tr("Images"))
        self._view = ShotView(titles)
        self._maps = tuple(CoverageMap(title) for title in titles)
        self._sigmas = tuple(UncertaintyMap(title) for title in titles)
        self._shown_map = choice(
            "map",
            tr("Map"),
            {"coverage": tr("Images of the board"), "uncertainty": tr("Uncertainty")},
            tr(
                "Images of the board: how many cover each part of the view. Uncertainty: how well "
                "the solved projection is known there, in pixels."
            ),
        )
        self._shown_map.currentIndexChanged.connect(self._show_map)
        self.drawing = Drawing(f"docs/pictures/{drawing}.svg")
        self._count = QLabel()
        self._count.setObjectName("count")
        self.hint = paragraph("hint", hint)
        self.hint.setAlignment(Qt.AlignmentFlag.AlignTop)  # where another one is longer
        self._trouble = FindingLine("images")
        self._trouble.hide()
        self.again = button("again", again, help_text=tr("Read the folders again"))
        self.take = button("take", take, help_text=tr("Take images with cameras of this computer"))
        self.again.setEnabled(False)
        self.again.clicked.connect(self.forget)
        self.bar = JobBar(tr("Cancel"))  # without a letter: two panels may search at once
        self.bar.failed.connect(self.show_trouble)
        self.bar.busy_changed.connect(self.bar.setVisible)
        self.bar.hide()
        self._list.chosen.connect(self._show_chosen)
        self._list.dropped_changed.connect(self._refresh)
        self._list.dropped_changed.connect(self.dropped_changed)
        self._lay_out()
        self._show_map()
        self._refresh()

    @property
    def used(self) -> int:
        """Number of images in which the board was found and that are not excluded."""
        out = frozenset(self._list.dropped)
        return sum(not shot.problem and shot.name not in out for shot in self.shots)

    @property
    def count(self) -> str:
        """The number of images used, in words; empty without images."""
        return tr("{} of {} used").format(self.used, len(self.shots)) if self.shots else ""

    def dropped_of(self, before: tuple[str, ...]) -> tuple[str, ...]:
        """Return the excluded images; `before` while no images are shown."""
        return self._list.dropped if self.shots else before

    def add_button(self, added: QPushButton) -> None:
        """Add a button in front of the panel's own."""
        self._button_row.insertWidget(0, added)
        QWidget.setTabOrder(added, self.take)

    def look(self, folders: Sequence[str], board: Board, dropped: Sequence[str]) -> None:
        """Search folders for the board, unless just done; do nothing if a folder is missing."""
        paths = tuple(user_path(folder) for folder in folders if folder)
        question = (paths, board)
        if question == self._question:
            return
        before = self._question[0] if self._question else ()
        if before and before != paths:
            dropped = ()  # they refer to other images
        self._question = question
        self.again.setEnabled(len(paths) == len(folders))
        self._show((), ())
        if len(paths) == len(folders):
            self.bar.run(
                tr("Looking for the board"),
                partial(_look, paths, board),
                lambda seen: self._show(seen[0], dropped, seen[1]),
            )
        else:
            self.bar.stop()

    def forget(self) -> None:
        """Make the next `look` read the folders again."""
        self._question = None

    def show_solved(self, solved: SolvedPart) -> None:
        """Show the residual of each image."""
        worst = (solved.worst.name, solved.worst.why) if solved.worst else ("", "")
        self._list.show_results(solved.residuals_px, solved.tilts_rad, worst)
        for shown, found in zip(self._sigmas, solved.uncertainties, strict=False):
            shown.show_uncertainty(found)

    def show_trouble(self, why: str) -> None:
        """Show why there are no images."""
        self._trouble.show_finding(Finding("", Health.BROKEN, why))
        self._trouble.show()

    def stop(self) -> None:
        """End background work."""
        self.bar.stop()
        self._view.stop()

    def _show(
        self, shots: tuple[Shot, ...], dropped: Sequence[str], other: Board | None = None
    ) -> None:
        self.shots = shots
        self._trouble.hide()
        self._view.show_shot(None)
        self._list.show_shots(shots, dropped)
        self._refresh()
        self.dropped_changed.emit()
        if self._question is not None and not all(shot.problem for shot in shots):
            self._project.note_found(self._question[1])
        if other is not None:
            self._offer(other)

    def _offer(self, other: Board) -> None:
        """Offer the board that the images show, if it is not the one entered."""
        entered = self._project.inputs.board
        if self._question is None or self._question[1] != entered:
            return  # not the printed board, but the grid on a display

        def use() -> None:
            self._project.enter(board=other)
            self.again.click()

        shown, expected = (f"{one.squares[0]} × {one.squares[1]}" for one in (other, entered))
        found = tr("the images show {}, the board page says {}").format(shown, expected)
        label = tr("Use {}").format(shown)
        if other.squares == entered.squares:
            found = tr("the images show a board printed by OpenCV before 4.6")
            if entered.legacy:
                found = tr("the images show a board printed by OpenCV 4.6 or later")
            label = tr("Use this board")
        self._trouble.show_finding(Finding("", Health.BROKEN, found), label, use)
        self._trouble.show()

    def _show_chosen(self, place: int) -> None:
        self._view.show_shot(self.shots[place] if place >= 0 else None)

    def _refresh(self) -> None:
        out = frozenset(self._list.dropped)
        kept = [shot for shot in self.shots if shot.name not in out]
        for number, shown in enumerate(self._maps):
            found = [one for shot in kept if (one := shot.views[number].found) is not None]
            shown.show_coverage(coverage(found) if found else None)
        self._count.setText(self.count or tr("No images yet"))

    def _show_map(self) -> None:
        is_coverage = self._shown_map.currentData() == "coverage"
        for shown in self._maps:
            shown.setVisible(is_coverage)
        for other in self._sigmas:
            other.setVisible(not is_coverage)

    def _lay_out(self) -> None:
        side = vbox(self._count, *self._maps, *self._sigmas, self._shown_map, 1, spacing=SPACING_PX)
        split = QSplitter(Qt.Orientation.Horizontal)
        split.setChildrenCollapsible(False)
        split.addWidget(self._list)
        split.addWidget(self._view)
        split.setStretchFactor(1, 1)
        hbox((split, 1), side, on=self, margins=SPACING_PX, spacing=2 * SPACING_PX)
        buttons = self.take, self.again
        self._button_row = hbox(*buttons, 1, on=self.buttons, margins=0, spacing=SPACING_PX)
        vbox(self._trouble, self.bar, on=self.search, margins=0, spacing=0)


def _look(
    folders: tuple[Path, ...], board: Board, progress: Progress
) -> tuple[tuple[Shot, ...], Board | None]:
    shots = look(folders, board, progress)
    return shots, other_board(shots, board)

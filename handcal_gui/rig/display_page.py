"""The fourth and fifth steps: one eye's display, seen by the viewpoint camera behind it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from PySide6.QtWidgets import QWidget

from handcal.core.errors import FileError, HandcalError
from handcal.core.types import Eye
from handcal.io.images import write_png
from handcal.rig.boards.board import Board
from handcal.rig.boards.choose import ALIKE
from handcal.rig.displays.grid import Grid, draw_grid, grid_on
from handcal.rig.steps import ASKED_BOARDS, ASKED_GRIDS, screen_of
from handcal.station.checks.doctor import Finding, Health
from handcal_gui.app.translation import tr
from handcal_gui.rig.file_dialogs import ask_save
from handcal_gui.rig.images_panel import ImagesPanel
from handcal_gui.rig.project import RigProject
from handcal_gui.rig.project_folder import DisplayEntries
from handcal_gui.rig.solve import CAMERA_MISSING, SolvedPart, solve_display
from handcal_gui.rig.step_page import StepPage, images_needed
from handcal_gui.widgets.entries_form import EntriesForm
from handcal_gui.widgets.fields import button, make_linked

_GRID_HINT = tr(
    "Save the grid and show it on this display unscaled. With the viewpoint camera at the eye "
    "position, focused on the display, take {} or more images in the dark."
).format(ASKED_GRIDS)
_BOARD_HINT = tr(
    "Leave the camera in its place and switch the display off. Take {} or more images of the board "
    "through it while the headset tracks the board. Save one JSON file with the name of each "
    'image and the pose of its board in the headset rig: <a href="{}">its contents</a>.'
).format(ASKED_BOARDS, "docs/rig-guide.md#left-and-right-display")


class DisplayPage(StepPage):
    """Images of the grid and of the tracked board, and the display calibrated from them.

    Parameters
    ----------
    project : RigProject
    eye : {"left", "right"}
    read : callable
        Shows a page of the manual.
    """

    def __init__(
        self,
        project: RigProject,
        eye: Eye,
        read: Callable[[str], object],
        parent: QWidget | None = None,
    ) -> None:
        camera = (tr("Viewpoint camera"),)
        of_grid = ("grid_images",), "dropped_grid", tr("&Take images…"), tr("Find the grid &again")
        grid = ImagesPanel(project, camera, _GRID_HINT, "setup-display", *of_grid)
        of_board = (
            *(("board_images",), "dropped_board"),
            *(tr("Ta&ke images…"), tr("Find t&he board again")),
        )
        board = ImagesPanel(project, camera, _BOARD_HINT, "setup-board", *of_board)
        panels = {tr("Grid on the displa&y"): grid, tr("Ca&mera pose"): board}
        form = EntriesForm(DisplayEntries)
        super().__init__(f"{eye}DisplayPage", eye, project, form, panels, parent)
        make_linked(board.hint).linkActivated.connect(read)
        self._eye: Eye = eye
        self._grid, self._board = grid, board
        self._save = button(
            "saveGrid", tr("Save &grid…"), help_text=tr("PNG, to show on the display")
        )
        grid.add_button(self._save)
        self._save.clicked.connect(self._save_grid)
        self._grid.take.clicked.connect(self._take_grid)
        self._board.take.clicked.connect(self._take_board)
        self.show_known()

    def board_of(self, panel: ImagesPanel) -> Board | None:
        """Return the grid on the display, or the entered board."""
        if panel is self._board:
            return super().board_of(panel)
        grid = self._shown()
        return None if grid is None else grid.board

    def enter(self) -> None:
        """Search the folders for grid and board, unless already done."""
        is_measured = self.entries.distance == "measured"
        self.form.field("distance_m").setEnabled(is_measured)
        for name in ("square_arcmin", "nominal_m"):
            self.form.field(name).setEnabled(not is_measured)
        super().enter()

    def solve(self) -> None:
        """Solve from the images that are not excluded."""
        work = partial(
            solve_display,
            self._grid.shots,
            self._board.shots,
            self.entries,
            self._eye,
            self.project.rig,
            self.project.camera_file,
        )
        self.box.run(work, self._show_solved)

    @property
    def need(self) -> str:
        """The viewpoint camera's intrinsics, or images, if there are none."""
        if not self.project.camera_file.exists():
            return CAMERA_MISSING
        grid = tr("to solve, take images of the grid, or choose their folder")
        board = tr(
            "to solve, take images of the board, or choose their folder or a stereo calibration in "
            "Inputs"
        )
        poses = tr(
            "to solve, choose the file of the poses of the board in Inputs, or a stereo calibration"
        )
        need = images_needed(self._grid, grid)
        if need or self.entries.stereo:
            return need
        return images_needed(self._board, board) or ("" if self.entries.tracked else poses)

    def _show_solved(self, solved: tuple[SolvedPart, SolvedPart]) -> None:
        display, place = solved
        self.box.show_solved(display, self.project.add_part(self._eye, display, self.solved_with))
        self._grid.show_solved(display)
        self._board.show_solved(place)
        self.show_if_changed()

    def _shown(self) -> Grid | None:
        """Return the grid for the display; if it does not fit, show why and return None."""
        screen = screen_of(self.project.rig, self._eye)
        try:
            return grid_on(screen.width_px, screen.height_px, self.entries.square_px)
        except HandcalError as error:
            self._grid.look(("",), self.project.inputs.board, ())
            self._grid.show_trouble(str(error))
            return None

    def _save_grid(self) -> None:
        if (grid := self._shown()) is None:
            return
        name = f"grid-{self._eye}.png"
        path = ask_save(self.project, self, tr("Save the grid"), name, tr("PNG (*.png)"))
        if path is None:
            return
        try:
            write_png(path, draw_grid(grid))
        except FileError as error:
            self._grid.show_trouble(str(error))
            return
        columns, rows = grid.squares
        saved = tr("{}×{} squares saved as {}").format(columns, rows, path)
        self.box.show_finding(Finding("", Health.GOOD, saved, tr("show it unscaled")))

    def _take_grid(self) -> None:
        if (grid := self._shown()) is None:
            return
        folder = self.project.folder.path / f"grid-{self._eye}"
        self.take_images(
            {tr("Viewpoint camera"): folder},
            grid.board,
            self._grid,
            lambda: self.form.enter(grid_images=str(folder)),
            ALIKE,
            asked=ASKED_GRIDS,
        )

    def _take_board(self) -> None:
        folder = self.project.folder.path / f"board-{self._eye}"
        self.take_images(
            {tr("Viewpoint camera"): folder},
            self.project.inputs.board,
            self._board,
            lambda: self.form.enter(board_images=str(folder)),
            asked=ASKED_BOARDS,
        )

"""Base of the wizard's pages that solve a step from images."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QTabWidget, QWidget

from handcal.rig.board import Board
from handcal.rig.choose import ChooseSettings
from handcal_gui.theme import SPACING_PX
from handcal_gui.widgets.entries_form import EntriesForm
from handcal_gui.widgets.layouts import scrollable, vbox
from handcal_gui.windows.rig.images_panel import ImagesPanel
from handcal_gui.windows.rig.project import RigProject
from handcal_gui.windows.rig.solve_box import SolveBox
from handcal_gui.windows.rig.take_dialog import TakeDialog


class StepPage(QWidget):
    """Fields at the top, images in the middle, and the result at the bottom.

    Parameters
    ----------
    name : str
        Object name.
    project : RigProject
    form : EntriesForm
    panels : mapping of str to ImagesPanel
        By title.

    Attributes
    ----------
    form : EntriesForm
    panels : tuple of ImagesPanel
    box : SolveBox
    """

    def __init__(
        self,
        name: str,
        project: RigProject,
        form: EntriesForm,
        panels: Mapping[str, ImagesPanel],
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self.setObjectName(name)
        self.project = project
        self.form = form
        self.panels = tuple(panels.values())
        self.box = SolveBox()
        self._lay_out(panels)
        form.changed.connect(self.keep)
        self.box.button.clicked.connect(self.solve)
        for panel in self.panels:
            panel.dropped_changed.connect(self.keep)
            panel.bar.busy_changed.connect(self._refresh)
            panel.again_requested.connect(self.enter)
            panel.board_found.connect(project.note_found)
        self.box.bar.busy_changed.connect(self._refresh)
        project.rig_changed.connect(self.show_known)

    def enter(self) -> None:
        """Search the entered folders, unless already done."""
        raise NotImplementedError

    def keep(self) -> None:
        """Store the entries, and search new folders for the board."""
        raise NotImplementedError

    def solve(self) -> None:
        """Solve from the images that are not excluded."""
        raise NotImplementedError

    def show_known(self) -> None:
        """Show the rig's present calibration of this part."""
        raise NotImplementedError

    def stop(self) -> None:
        """End background work."""
        for panel in self.panels:
            panel.stop()
        self.box.bar.stop()

    def take_images(
        self,
        folders: Mapping[str, Path],
        board: Board,
        panel: ImagesPanel,
        then: Callable[[], object],
        choose: ChooseSettings | None = None,
    ) -> None:
        """Take images with cameras, one folder for each, and then search them for the board."""

        def end() -> None:
            panel.forget()
            then()
            self.enter()

        dialog = TakeDialog(
            folders, board, choose or ChooseSettings(), self.project.realsense, self
        )
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.finished.connect(end)
        dialog.open()

    def _lay_out(self, panels: Mapping[str, ImagesPanel]) -> None:
        content = QWidget()
        layout = vbox(self.form, on=content, margins=0, spacing=SPACING_PX)
        if len(panels) == 1:
            layout.addWidget(self.panels[0], 1)
        else:
            tabs = QTabWidget(documentMode=True)
            for title, panel in panels.items():
                panel.setContentsMargins(*4 * (SPACING_PX,))
                tabs.addTab(panel, title)
            layout.addWidget(tabs, 1)
        # Or a low screen hides the button that solves.
        vbox((scrollable(content), 1), self.box, on=self, margins=0, spacing=SPACING_PX)

    def _refresh(self) -> None:
        is_looking = any(panel.bar.is_busy for panel in self.panels)
        self.box.button.setEnabled(not is_looking and not self.box.bar.is_busy)

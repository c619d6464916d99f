"""Base of the wizard's pages that solve a step from images."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from PySide6.QtCore import Qt
from PySide6.QtGui import QShowEvent
from PySide6.QtWidgets import QGridLayout, QTabWidget, QWidget

from handcal.core.types import Origin
from handcal.rig.boards.board import Board
from handcal.rig.boards.choose import ChooseSettings
from handcal.rig.boards.views import ASKED_VIEWS
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.rig.images_panel import ImagesPanel
from handcal_gui.rig.project import RigProject
from handcal_gui.rig.solve_box import SolveBox
from handcal_gui.rig.step_inputs import Step
from handcal_gui.rig.take_dialog import TakeDialog
from handcal_gui.widgets.action_strip import action_strip
from handcal_gui.widgets.entries_form import EntriesForm
from handcal_gui.widgets.layouts import scrollable, vbox
from handcal_gui.widgets.path_field import PathField

_FIRST_PANEL = 2
"""Place of the first panel of images among the tabs."""


class StepPage(QWidget):
    """Tabs with the set-up, the inputs, the images and the numbers, and the verdict below.

    Parameters
    ----------
    name : str
        Object name.
    step : {"T_H_D", "viewpoint", "left", "right"}
    project : RigProject
    form : EntriesForm
    panels : mapping of str to ImagesPanel
        By title.

    Attributes
    ----------
    form : EntriesForm
    panels : tuple of ImagesPanel
    box : SolveBox
    main : MainButton
    inputs : mapping of str to str
        The present inputs of the step, by field.
    solved_with : mapping of str to str
        The inputs from which it was last solved, or is being solved.
    strip : QWidget
        With the main button, for the bottom of the window.
    """

    def __init__(
        self,
        name: str,
        step: Step,
        project: RigProject,
        form: EntriesForm,
        panels: Mapping[str, ImagesPanel],
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self.setObjectName(name)
        self.project = project
        self.step = step
        self._entries_name = "stereo" if step == "T_H_D" else step
        self.inputs = self.solved_with = project.inputs_of(step)
        self.form = form
        self.form.show_entries(self.entries)
        self.panels = tuple(panels.values())
        self.box = SolveBox()
        self.main = self.box.button
        self.strip = action_strip(self.main, bar=self.box.bar)
        self._tabs = QTabWidget(documentMode=True)
        self._titles = tuple(panels)
        self._lay_out()
        form.changed.connect(self.keep)
        form.changed.connect(self._refresh)
        self.box.button.clicked.connect(self._solve)
        for panel in self.panels:
            panel.dropped_changed.connect(self.keep)
            panel.dropped_changed.connect(self._refresh)
            panel.bar.busy_changed.connect(self._refresh)
            panel.again.clicked.connect(self.enter)
            panel.dropped_changed.connect(self._show_images)
        self.box.bar.busy_changed.connect(self._refresh)
        self.box.shown.connect(self._refresh)
        project.rig_changed.connect(self.show_known)
        project.rig_changed.connect(self._refresh)
        project.inputs_changed.connect(self._refresh)

    @property
    def entries(self) -> Any:
        """The entries of this step."""
        return getattr(self.project.inputs, self._entries_name)

    def board_of(self, panel: ImagesPanel) -> Board | None:
        """Return what a panel's images show, the entered board; None if it cannot be shown."""
        del panel
        return self.project.inputs.board

    def enter(self) -> None:
        """Search the entered folders, unless already done."""
        for panel in self.panels:
            if (board := self.board_of(panel)) is not None:
                folders = [getattr(self.entries, name) for name in panel.folders]
                panel.look(folders, board, getattr(self.entries, panel.dropped))

    def keep(self) -> None:
        """Store the entries, and search new folders for the board."""
        entries = self.form.take(self.entries)
        dropped = {
            one.dropped: one.dropped_of(getattr(entries, one.dropped)) for one in self.panels
        }
        self.project.enter(**{self._entries_name: replace(entries, **dropped)})
        self.enter()

    def solve(self) -> None:
        """Solve from the images that are not excluded."""
        raise NotImplementedError

    def show_known(self) -> None:
        """Show the rig's present calibration of this part."""
        origins: Mapping[Any, Origin] = self.project.rig.origins
        self.box.show_origin(origins.get(self.step), self.project.outdated(self.step))

    @property
    def need(self) -> str:
        """Advice on what is missing before the step can be solved; empty if nothing is."""
        raise NotImplementedError

    def showEvent(self, event: QShowEvent) -> None:
        """Look again whether the step can be solved."""
        super().showEvent(event)
        self._refresh()

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
        asked: int = ASKED_VIEWS,
    ) -> None:
        """Take images with cameras, one folder for each, and then search them for the board."""
        places = tuple(folders.values())
        shots = [shot for shot in panel.shots if tuple(f.parent for f in shot.files) == places]
        found = [tuple(view.found for view in shot.views if view.found) for shot in shots]
        earlier = [views for views in found if len(views) == len(places)]

        def end() -> None:
            panel.forget()
            then()
            self.enter()

        project, choose = self.project, choose or ChooseSettings()
        dialog = TakeDialog(
            folders,
            board,
            choose,
            project.realsense,
            self,
            project.inputs.sources,
            asked,
            earlier,
        )
        dialog.remembered.connect(project.remember_sources)
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.finished.connect(end)
        dialog.open()

    def _solve(self) -> None:
        self._refresh()  # a file may have been written since
        self.solved_with = self.inputs
        self.solve()

    def show_if_changed(self) -> None:
        """Show no result of inputs that were changed while it was solved."""
        if self.inputs != self.solved_with:
            self.show_known()

    def _follow(self) -> None:
        """Show no longer a result or a failure of other inputs."""
        if (now := self.project.inputs_of(self.step)) != self.inputs:
            self.inputs = now
            self.show_known()

    def _lay_out(self) -> None:
        setup, inputs = QWidget(), QWidget()
        grid = QGridLayout(setup)
        grid.setContentsMargins(*4 * (SPACING_PX,))
        grid.setHorizontalSpacing(3 * SPACING_PX)
        grid.setVerticalSpacing(SPACING_PX)
        grid.setRowStretch(1, 1)
        for column, panel in enumerate(self.panels):
            grid.setColumnStretch(column, 1)
            for row, part in enumerate((panel.hint, panel.drawing, panel.buttons)):
                grid.addWidget(part, row, column)
        vbox(self.form, 1, on=inputs, margins=SPACING_PX)
        self._tabs.addTab(setup, tr("Set-&up"))
        self._tabs.addTab(inputs, tr("&Inputs"))
        for title, panel in zip(self._titles, self.panels, strict=True):
            self._tabs.addTab(panel, title)
        self._tabs.addTab(self.box.numbers, tr("Numbe&rs"))
        searches = (panel.search for panel in self.panels)
        tabs = scrollable(self._tabs)
        vbox((tabs, 1), *searches, self.box, on=self, margins=0, spacing=SPACING_PX // 2)

    def _show_images(self) -> None:
        """Show the images in place of how to take them, once all have been searched."""
        found = [place for place, one in enumerate(self.panels, _FIRST_PANEL) if one.shots]
        if found and self._tabs.currentIndex() == 0 and not self._is_looking:
            self._refresh()
            self._tabs.setCurrentIndex(found[0])

    @property
    def _is_looking(self) -> bool:
        return any(panel.bar.is_busy for panel in self.panels)

    def _refresh(self) -> None:
        self._follow()
        panels = zip(self._titles, self.panels, strict=True)
        for place, (title, panel) in enumerate(panels, _FIRST_PANEL):
            count = f" ({panel.count})" if panel.count else ""
            self._tabs.setTabText(place, f"{title}{count}")
        self._tabs.setTabEnabled(self._tabs.count() - 1, bool(self.box.table.keys))
        problems = (field.problem for field in self.form.findChildren(PathField))
        need = "" if self._is_looking else next(filter(None, problems), self.need)
        self.box.allow(need, is_busy=self._is_looking or self.box.bar.is_busy)


def images_needed(panel: ImagesPanel, request: str) -> str:
    """Return a request for images, unless some can be used."""
    if panel.used:
        return ""
    if not panel.shots:
        return request
    if all(shot.problem for shot in panel.shots):
        return tr("the board was found in no image: see the reason beside each")
    return tr("to solve, tick an image in which the board was found")

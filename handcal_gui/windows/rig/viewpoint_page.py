"""The third step: the intrinsics of the camera that is put where the eye will be."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from PySide6.QtWidgets import QWidget

from handcal.station.doctor import Finding, Health
from handcal_gui.widgets.entries_form import EntriesForm
from handcal_gui.widgets.path_field import INTRINSICS_FILES, PathField
from handcal_gui.windows.rig.images_panel import ImagesPanel
from handcal_gui.windows.rig.lens_fields import lens_field
from handcal_gui.windows.rig.project import RigProject
from handcal_gui.windows.rig.solve import Solved, solve_viewpoint
from handcal_gui.windows.rig.step_page import StepPage

_HINT = (
    "Take 20 or more images of the board with the viewpoint camera, its focus fixed as it will be "
    "behind the display: all over the view, up to its edges, tilted by 20° to 45° to every side."
)


class ViewpointPage(StepPage):
    """Images of the board, and the intrinsics solved from them; or a file that has them."""

    def __init__(self, project: RigProject, parent: QWidget | None = None) -> None:
        given = PathField("Intrinsics", "file", INTRINSICS_FILES, "Solved from the images")
        form = EntriesForm(
            {
                "images": ("Viewpoint camera's images", PathField("Viewpoint images", "folder")),
                "lens": ("Lens", lens_field()),
                "intrinsics": ("or its intrinsics", given),
            }
        )
        form.show_entries(project.inputs.viewpoint)
        panel = ImagesPanel(("Viewpoint camera",), _HINT)
        super().__init__("viewpointPage", project, form, {"Images": panel}, parent)
        self.panel = panel
        self.panel.take_requested.connect(self._take)
        self.show_known()

    def enter(self) -> None:
        """Look for the board in the folder, unless that was done."""
        entries = self.project.inputs.viewpoint
        self.panel.look((entries.images,), self.project.inputs.board, entries.dropped)

    def keep(self) -> None:
        """Keep what is entered, and look for the board where it is new."""
        entries = self.form.take(self.project.inputs.viewpoint)
        dropped = self.panel.dropped_of(entries.dropped)
        self.project.enter(viewpoint=replace(entries, dropped=dropped))
        self.show_known()
        self.enter()

    def solve(self) -> None:
        """Solve from the images that are not left out."""
        entries, output = self.project.inputs.viewpoint, self.project.folder.viewpoint
        self.box.run(partial(solve_viewpoint, self.panel.shots, entries, output), self._show_solved)

    def show_known(self) -> None:
        """Show whether there are intrinsics."""
        self.box.show_origin(None)
        file = self.project.camera_file
        if file.exists():
            self.box.show_finding(Finding("", Health.GOOD, f"the intrinsics are in {file}"))

    def _show_solved(self, solved: Solved) -> None:
        is_bad = solved.verdict.name == "bad"
        kept = "it is not used" if is_bad else "the displays are calibrated with it"
        self.project.camera_solved()
        self.box.show_solved(solved, kept)
        self.panel.show_solved(solved)

    def _take(self) -> None:
        folder = self.project.folder.path / "viewpoint"
        self.take_images(
            {"Viewpoint camera": folder},
            self.project.inputs.board,
            self.panel,
            lambda: self.form.enter(images=str(folder)),
        )

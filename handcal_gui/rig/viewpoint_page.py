"""The third step: the intrinsics of the viewpoint camera, which replaces the eye."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from PySide6.QtWidgets import QWidget

from handcal.rig.boards.views import ASKED_VIEWS
from handcal.rig.formats import read_intrinsics
from handcal.station.checks.doctor import Finding, Health
from handcal_gui.app.translation import tr
from handcal_gui.rig.images_panel import ImagesPanel
from handcal_gui.rig.lens_fields import lens_field
from handcal_gui.rig.project import UNREADABLE, RigProject
from handcal_gui.rig.solve import SolvedPart, solve_viewpoint
from handcal_gui.rig.solve_box import HEALTHS
from handcal_gui.rig.step_page import StepPage, images_needed
from handcal_gui.widgets.entries_form import EntriesForm
from handcal_gui.widgets.path_field import INTRINSICS_FILES, PathField

_HINT = tr(
    "Take {} or more images of the board with the viewpoint camera, with the focus that it will "
    "have behind the display: in all parts of the view up to its edges, tilted by 20° to 45° in "
    "all directions."
).format(ASKED_VIEWS)


class ViewpointPage(StepPage):
    """Images of the board and the intrinsics solved from them, or a file of intrinsics."""

    def __init__(self, project: RigProject, parent: QWidget | None = None) -> None:
        given = PathField(
            tr("Intrinsics"),
            "file",
            INTRINSICS_FILES,
            tr("Solved from the images"),
            read=read_intrinsics,
        )
        form = EntriesForm(
            {
                "images": (
                    tr("&Viewpoint camera's images"),
                    PathField(tr("Viewpoint images"), "folder"),
                ),
                "lens": (tr("L&ens"), lens_field()),
                "intrinsics": (tr("Its in&trinsics"), given),
            }
        )
        form.show_entries(project.inputs.viewpoint)
        panel = ImagesPanel(project, (tr("Viewpoint camera"),), _HINT, "setup-viewpoint")
        super().__init__(
            "viewpointPage", "viewpoint", project, form, {tr("I&mages"): panel}, parent
        )
        self.panel = panel
        self.panel.take.clicked.connect(self._take)
        self.show_known()

    def enter(self) -> None:
        """Search the folder for the board, unless already done."""
        entries = self.project.inputs.viewpoint
        self.panel.look((entries.images,), self.project.inputs.board, entries.dropped)

    def keep(self) -> None:
        """Store the entries, and search a new folder for the board."""
        entries = self.form.take(self.project.inputs.viewpoint)
        dropped = self.panel.dropped_of(entries.dropped)
        self.project.enter(viewpoint=replace(entries, dropped=dropped))
        self.enter()

    def solve(self) -> None:
        """Solve from the images that are not excluded."""
        entries, output = self.project.inputs.viewpoint, self.project.folder.viewpoint
        self.box.run(partial(solve_viewpoint, self.panel.shots, entries, output), self._show_solved)

    def show_known(self) -> None:
        """Show the file of intrinsics, if there is one."""
        outdated = self.project.outdated("viewpoint")
        self.box.show_origin(None, outdated)
        file = self.project.camera_file
        if not outdated and (verdict := self.project.camera_verdict):
            found = tr("the intrinsics are in {}: {}").format(file, verdict)
            finding = Finding("", HEALTHS.get(verdict, Health.LIMITED), found)
            if verdict == UNREADABLE:
                advice = tr("choose another file, or solve them")
                finding = Finding("", Health.BROKEN, found, advice)
            self.box.show_finding(finding)

    @property
    def need(self) -> str:
        """Images, if there are none."""
        request = tr("to solve, take images of the board, or choose their folder in Inputs")
        return images_needed(self.panel, request)

    def _show_solved(self, solved: SolvedPart) -> None:
        is_bad = solved.verdict.name == "bad"
        kept = tr("it is not used") if is_bad else tr("the displays will be calibrated with it")
        if not is_bad:
            self.project.note_solved("viewpoint", self.solved_with)
        self.project.camera_solved()
        self.box.show_solved(solved, kept)
        self.panel.show_solved(solved)
        self.show_if_changed()

    def _take(self) -> None:
        folder = self.project.folder.path / "viewpoint"
        self.take_images(
            {tr("Viewpoint camera"): folder},
            self.project.inputs.board,
            self.panel,
            lambda: self.form.enter(images=str(folder)),
        )

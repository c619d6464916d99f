"""The second and third step: the depth camera's pose, and the viewpoint camera's intrinsics."""

from __future__ import annotations

from functools import partial

from PySide6.QtWidgets import QWidget

from handcal.camera.take_board import DEPTH_TO_COLOR, IMAGER
from handcal.rig.boards.views import ASKED_VIEWS
from handcal.station.checks.doctor import Finding, Health
from handcal_gui.app.translation import tr
from handcal_gui.rig.images_panel import ImagesPanel
from handcal_gui.rig.project import UNREADABLE, RigProject
from handcal_gui.rig.project_folder import StereoEntries, ViewpointEntries
from handcal_gui.rig.solve import SolvedPart, solve_stereo, solve_viewpoint
from handcal_gui.rig.solve_box import HEALTHS
from handcal_gui.rig.step_page import StepPage, images_needed
from handcal_gui.widgets.entries_form import EntriesForm

_STEREO_HINT = tr(
    "Take {} or more pairs of simultaneous images of the board: near and far, in all parts of both "
    "views, tilted by 20° to 45° in all directions. Give the two images of a pair the same name, "
    "or let them end in the same number, as depth07.png and headset07.png do."
).format(ASKED_VIEWS)


class StereoPage(StepPage):
    """Pairs of images of the board, and the pose solved from them."""

    def __init__(self, project: RigProject, parent: QWidget | None = None) -> None:
        form = EntriesForm(StereoEntries)
        panel = ImagesPanel(
            project,
            (tr("Depth camera"), tr("Headset camera")),
            _STEREO_HINT,
            "setup-stereo",
            ("depth_images", "headset_images"),
        )
        super().__init__("stereoPage", "T_H_D", project, form, {tr("&Pairs"): panel}, parent)
        self.panel = panel
        self.panel.take.clicked.connect(self._take)
        self.show_known()

    def solve(self) -> None:
        """Solve from the pairs that are not excluded."""
        work = partial(solve_stereo, self.panel.shots, self.entries)
        self.box.run(work, self._show_solved)

    @property
    def need(self) -> str:
        """Pairs of images, if there are none."""
        request = tr("to solve, take pairs of images, or choose both folders in Inputs")
        return images_needed(self.panel, request)

    def _show_solved(self, solved: SolvedPart) -> None:
        self.box.show_solved(solved, self.project.add_part("T_H_D", solved, self.solved_with))
        self.panel.show_solved(solved)
        self.show_if_changed()

    def _take(self) -> None:
        path = self.project.folder.path
        folders = {tr("Depth camera"): path / "depth", tr("Headset camera"): path / "headset"}

        def then() -> None:
            # Not named `path`: Python 3.12 and 3.13 would then lose the one above (PEP 709).
            self.form.enter(**{f"{one.name}_images": str(one) for one in folders.values()})
            files = {"imager_intrinsics": IMAGER, "depth_to_color": DEPTH_TO_COLOR}
            told = {name: path / "depth" / file for name, file in files.items()}
            self.form.enter(**{name: str(file) for name, file in told.items() if file.exists()})

        self.take_images(folders, self.project.inputs.board, self.panel, then)


_VIEWPOINT_HINT = tr(
    "Take {} or more images of the board with the viewpoint camera, with the focus that it will "
    "have behind the display: in all parts of the view up to its edges, tilted by 20° to 45° in "
    "all directions."
).format(ASKED_VIEWS)


class ViewpointPage(StepPage):
    """Images of the board and the intrinsics solved from them, or a file of intrinsics."""

    def __init__(self, project: RigProject, parent: QWidget | None = None) -> None:
        form = EntriesForm(ViewpointEntries)
        panel = ImagesPanel(
            project, (tr("Viewpoint camera"),), _VIEWPOINT_HINT, "setup-viewpoint", ("images",)
        )
        super().__init__(
            "viewpointPage", "viewpoint", project, form, {tr("I&mages"): panel}, parent
        )
        self.panel = panel
        self.panel.take.clicked.connect(self._take)
        self.show_known()

    def solve(self) -> None:
        """Solve from the images that are not excluded."""
        entries, output = self.entries, self.project.folder.viewpoint
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

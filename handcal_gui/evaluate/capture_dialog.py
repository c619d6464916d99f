"""A dialog for taking the captures of a cube test with a camera, by key or at rest.

The live image is undistorted and turned to the display's axes once the position's grid is captured,
so that a hand aligned in it is aligned for an eye (Hu et al. 2021).
"""

from __future__ import annotations

import time
from collections.abc import Callable

from PySide6.QtCore import Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QCheckBox, QWidget

from handcal.camera.view_source import open_view_source
from handcal.camera.viewpoint import ViewpointCamera, list_viewpoints
from handcal.core.progress import Progress
from handcal.core.types import UInt8
from handcal.io.files import user_path
from handcal.lab.evaluate.cube_capture import RestWatch, instruction, keep_capture
from handcal.lab.evaluate.cube_folder import GRID, CapturePlan, PlannedCapture, missing_captures
from handcal.lab.evaluate.cube_test import cube_and_grid, position_warp
from handcal.rig.cube import Cube
from handcal.rig.displays.grid import Grid
from handcal.rig.displays.homography import RotationWarp
from handcal.station.checks.doctor import Finding, Health
from handcal_gui.app.theme import SPACING_PX, scale_font
from handcal_gui.app.translation import tr
from handcal_gui.engine.latest_job import LatestJob
from handcal_gui.evaluate.entries import CubeEntries
from handcal_gui.widgets.entries_form import EntriesForm
from handcal_gui.widgets.fields import paragraph, with_name
from handcal_gui.widgets.layouts import hbox, vbox
from handcal_gui.widgets.live_cameras import LiveCameras
from handcal_gui.widgets.sentence import sentence
from handcal_gui.widgets.table import Column, Row, Table
from handcal_gui.widgets.taking import BY_ITSELF, TakingDialog

_TURNED = tr("Turned to the display's axes")
_NOT_TURNED = tr("Along the camera's axes")
_ELSEWHERE = tr("Close this window to choose the file under Camera intrinsics.")
_WHEN = tr(
    "Take each image once the cube or the grid is at rest. Between two of the cube, cover it."
)
_NOT_BY_ITSELF = tr("Not automatically: stored images do not wait")


class CaptureDialog(TakingDialog):
    """Shows the live image and the next instruction; keeps only images with the expected content.

    Parameters
    ----------
    entries : CubeEntries
        With the folder of captures, which may already contain some of them.
    open_source : callable
        Like `open_view_source`.
    list_cameras : callable
        Like `list_viewpoints`.

    Attributes
    ----------
    form : EntriesForm
        Fields of the capture plan.
    """

    def __init__(
        self,
        entries: CubeEntries,
        parent: QWidget | None = None,
        open_source: Callable[..., ViewpointCamera] = open_view_source,
        list_cameras: Callable[[], list[int]] = list_viewpoints,
    ) -> None:
        cameras = LiveCameras((tr("Camera"),), open_source=open_source)
        super().__init__(
            *("captureDialog", tr("Take captures"), cameras, _WHEN),
            *(self._keep_at_rest, self._show_judged, parent),
        )
        self.entries = entries
        self._folder = user_path(entries.captures)
        self._plan: CapturePlan | None = None
        self._plan_problem = ""
        self._looked_for: tuple[Cube, Grid] | None = None
        self._list_cameras = list_cameras
        self.form = EntriesForm(CubeEntries, ("positions", "poses", "drawn", "with_grid"))
        self.form.show_entries(entries)
        self._list = Table("captures", tr("Images to take"), chooses="one")
        self._list.setMinimumWidth(36 * SPACING_PX)
        self._missing: frozenset[PlannedCapture] = frozenset()
        self._axes = paragraph("axes")
        self._instruction = paragraph("instruction")
        self._large = with_name(
            QCheckBox(tr("Lar&ge view")),
            "largeView",
            help_text=tr(
                "Fill the screen with the live image, to align a hand with it. Escape goes back."
            ),
        )
        self._watch: RestWatch | None = None
        self._warp: tuple[str, RotationWarp | None] = "", None
        self._turn = LatestJob(
            lambda position: position_warp(self.entries, self._folder, position), self
        )
        self._turn.answered.connect(self._show_turned)
        self._turn.failed.connect(self._show_not_turned)
        self._look = LatestJob(lambda plan: missing_captures(self._folder, plan), self)
        self._look.answered.connect(self._show_missing)
        self._look.failed.connect(super().show_failure)
        self.form.changed.connect(self._change_plan)
        self._list.chosen_changed.connect(self.refresh)
        self._list.chosen_changed.connect(self._turn_view)
        self._large.toggled.connect(self._enlarge)
        self._lay_out()
        self._list.setFocus()  # unlike a text field, it does not consume the space bar
        self._ask()
        self._bar.run(tr("Looking for cameras"), lambda *_: self._prepare(), self._begin)

    def start(self) -> None:
        """Show images of the chosen camera."""
        super().start()
        self._list.setFocus()

    def take(self) -> None:
        """Keep the present image as the selected capture, if it has the expected content."""
        images, chosen = self._cameras.images, self._chosen
        looked_for, watch = self._looked_for, self._watch
        if images is None or chosen is None or looked_for is None or watch is None:
            return

        def work(_: Progress) -> str:
            seen = keep_capture(images[0], self._folder, chosen, *looked_for)
            watch.took(images[0], chosen)
            return seen

        if not self._bar.is_busy:
            self._bar.run(
                tr("Checking the image"), work, lambda seen: self._show_taken(chosen, seen)
            )

    def asked(self) -> tuple[UInt8, PlannedCapture, int] | None:
        """Return the image, the capture to take next and the time; None if none is to be taken."""
        images, chosen = self._cameras.images, self._chosen
        if images is None or chosen is None or self._bar.is_busy or self._is_taken_again:
            return None
        return images[0], chosen, time.monotonic_ns()

    def done(self, result: int) -> None:
        """Close camera and dialog."""
        self._turn.stop()
        self._look.stop()
        super().done(result)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Leave the large view by Escape before the dialog."""
        if event.key() == Qt.Key.Key_Escape and self._large.isChecked():
            self._large.setChecked(False)
        else:
            super().keyPressEvent(event)

    def _keep_at_rest(self, seen: tuple[UInt8, PlannedCapture, int]) -> tuple[str, str]:
        """Keep an image at rest; return what it shows, or why not. Runs in the job's thread."""
        image, chosen, t_ns = seen
        assert self._looked_for is not None
        assert self._watch is not None
        why_not = self._watch.consider(image, chosen, t_ns)
        if why_not:
            return "", why_not
        return keep_capture(image, self._folder, chosen, *self._looked_for), ""

    def _show_judged(
        self, seen: tuple[UInt8, PlannedCapture, int], answer: tuple[str, str]
    ) -> None:
        shown, why_not = answer
        if shown:
            self._show_taken(seen[1], shown)
        else:
            self._found.show_finding(Finding("", Health.LIMITED, tr("waiting: {}").format(why_not)))

    def _turn_view(self) -> None:
        """Turn the live image as at the position of the selected capture."""
        chosen = self._chosen
        position = "" if chosen is None else chosen.where.split("/")[0]
        if position and position != self._warp[0]:
            self._warp = position, None
            self._show_through(None, _NOT_TURNED)
            self._turn.ask(position)

    def _show_turned(self, position: str, warp: RotationWarp | None) -> None:
        self._warp = position, warp
        if warp is None:
            first = tr("{}: capture the display's grid first").format(_NOT_TURNED)
            self._show_through(None, f"{first}.")
        else:
            self._show_through(self._warped, _TURNED)

    def _show_not_turned(self, why: str) -> None:
        self._show_through(None, f"{_NOT_TURNED}; {why}. {_ELSEWHERE}")

    def _show_through(self, warp: Callable[[UInt8], UInt8] | None, axes: str) -> None:
        self._cameras.show_through(warp)
        self._axes.setText(axes)

    def _warped(self, image: UInt8) -> UInt8:
        warp = self._warp[1]
        if warp is None:
            return image
        try:
            return warp.warp(image)
        except ValueError as error:  # an image of another size than the intrinsics'
            self._warp = self._warp[0], None
            self._show_not_turned(str(error))
            return image

    def _enlarge(self, is_large: bool) -> None:
        self.form.setVisible(not is_large)
        self._list.setVisible(not is_large)
        self._cameras.show_only_images(is_large)
        if is_large:
            self.showFullScreen()
        else:
            self.showNormal()

    def _prepare(self) -> tuple[tuple[Cube, Grid], list[int]]:
        return cube_and_grid(self.entries, self._folder), self._list_cameras()

    def _begin(self, found: tuple[tuple[Cube, Grid], list[int]]) -> None:
        self._looked_for, numbers = found
        self._watch = RestWatch(*self._looked_for)
        self._cameras.add_cameras(numbers)
        self.refresh()

    def _change_plan(self) -> None:
        self.entries = self.form.take(self.entries)
        self._ask()

    def _ask(self) -> None:
        """Check which planned captures are missing."""
        try:
            self._plan, self._plan_problem = self.entries.plan, ""
        except ValueError as error:
            self._plan, self._plan_problem = None, str(error)
            self._list.show_rows((), ())
        else:
            self._look.ask(self._plan)

    def _show_missing(self, plan: CapturePlan, missing: list[PlannedCapture]) -> None:
        """List the captures, and choose the next missing one after the chosen."""
        if plan != self._plan:
            return
        last = plan.captures.index(self._chosen) if self._chosen in plan.captures else -1
        self._missing = frozenset(missing)
        states = {True: tr("missing"), False: tr("✓ taken")}
        rows = [
            Row("", (f"{one.where}/{one.name}", states[one in self._missing]), key=one)
            for one in plan.captures
        ]
        columns = (Column(title, is_number=False) for title in (tr("Image"), tr("State")))
        self._list.show_rows(tuple(columns), rows)
        places = [place for place, one in enumerate(plan.captures) if one in self._missing]
        following = sorted(places, key=lambda place: (place < last, place))
        self._list.choose([plan.captures[place] for place in following[:1]])
        self.refresh()

    @property
    def _chosen(self) -> PlannedCapture | None:
        """The image to take next; None if none is listed or none is missing."""
        chosen: list[PlannedCapture] = self._list.chosen
        return chosen[0] if chosen else None

    @property
    def _is_taken_again(self) -> bool:
        """True if the selected image has been taken and would be replaced."""
        return self._chosen is not None and self._chosen not in self._missing

    def _show_taken(self, taken: PlannedCapture, seen: str) -> None:
        self._found.show_finding(
            Finding("", Health.GOOD, tr("taken: {}, {}").format(taken.file, seen))
        )
        if taken.kind == GRID:
            self._warp = "", None
        self._ask()

    def show_failure(self, why: str) -> None:
        """Show why an image was not taken, or why none can be taken."""
        if self._looked_for is None:
            where = tr("close this window to choose the files of the cube and the rig")
            self._found.show_finding(Finding("", Health.BROKEN, why, where))
        else:
            found = tr("not taken: {}").format(why)
            self._found.show_finding(Finding("", Health.LIMITED, found))

    def refresh(self) -> None:
        """Show what to take next, and whether it can be taken."""
        super().refresh()
        is_ready = self._looked_for is not None
        self._start.setEnabled(is_ready)
        is_free = is_ready and self._chosen is not None
        self._take.setEnabled(is_free and self._take.isEnabled())
        are_stored = self._cameras.are_stored  # and would be paired as they come, not as asked for
        self._by_itself.setText(_NOT_BY_ITSELF if are_stored else BY_ITSELF)
        self._by_itself.setEnabled(not are_stored)
        self._by_itself.setChecked(self._by_itself.isChecked() and not are_stored)
        self._take.setText(tr("Take again") if self._is_taken_again else tr("Take"))
        self._instruction.setText(self._next_instruction())

    def _next_instruction(self) -> str:
        if self._plan_problem:
            return f"{sentence(self._plan_problem)}."
        if self._list.keys and not self._missing and self._chosen is None:
            return tr("All captures have been taken.")
        if self._looked_for is None or self._chosen is None:
            return ""
        if self._cameras.images is None:
            return tr("Choose the camera, and press Show.")
        return f"{instruction(self._chosen)}."

    def _lay_out(self) -> None:
        scale_font(self._instruction, 1.6, is_bold=True)
        self._instruction.setMinimumHeight(self._instruction.fontMetrics().height())
        middle = hbox((self._cameras, 1), self._list, spacing=2 * SPACING_PX)
        vbox(
            self._instruction,
            self.form,
            (middle, 1),
            self._axes,
            self._found,
            self._foot(self._large),
            on=self,
            margins=2 * SPACING_PX,
            spacing=SPACING_PX,
        )

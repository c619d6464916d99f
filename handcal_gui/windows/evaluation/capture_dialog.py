"""A dialog for taking the captures of a cube test with a camera, one by one."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QCheckBox, QLineEdit, QWidget

from handcal.camera.view_source import open_view_source
from handcal.camera.viewpoint import ViewpointCamera, list_viewpoints
from handcal.lab.evaluate.cube_capture import instruction, keep_capture
from handcal.lab.evaluate.cube_folder import CapturePlan, PlannedCapture, missing_captures
from handcal.lab.evaluate.run import cube_and_grid
from handcal.rig.cube import Cube
from handcal.rig.grid import Grid
from handcal.station.doctor import Finding, Health
from handcal_gui.engine.latest_job import LatestJob
from handcal_gui.evaluation_entries import CubeEntries
from handcal_gui.theme import SPACING_PX, scale_font
from handcal_gui.widgets.entries_form import EntriesForm
from handcal_gui.widgets.fields import button, main_button, paragraph, whole_number, with_name
from handcal_gui.widgets.finding_line import FindingLine
from handcal_gui.widgets.job_bar import JobBar
from handcal_gui.widgets.layouts import hbox, vbox
from handcal_gui.widgets.live_cameras import LiveCameras
from handcal_gui.widgets.sentence import sentence
from handcal_gui.windows.evaluation.capture_list import CaptureList
from handcal_gui.windows.evaluation.preparation import PreparationDialog

_FIRST_SIZE = QSize(1120, 760)
MOST_POSES = 100


class CaptureDialog(PreparationDialog):
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
        super().__init__(parent)
        self.setObjectName("captureDialog")
        self.setWindowTitle("Take captures")
        self.entries = entries
        self._folder = Path(entries.captures).expanduser()
        self._plan: CapturePlan | None = None
        self._plan_problem = ""
        self._looked_for: tuple[Cube, Grid] | None = None
        self._list_cameras = list_cameras
        self.form = _plan_form()
        self.form.show_entries(entries)
        self._camera = LiveCameras(("Camera",), open_source=open_source)
        self._list = CaptureList()
        self._instruction = paragraph("instruction")
        self._found = FindingLine("capture")
        self._bar = JobBar()
        self._start = button("startCamera", "Show")
        self._take = main_button("takeCapture", "Take again")
        self._take.setMinimumWidth(self._take.sizeHint().width())
        self._take.setToolTip("Space bar")
        self._close = button("close", "Close")
        self._look = LatestJob(lambda plan: missing_captures(self._folder, plan), self)
        self._look.answered.connect(self._show_missing)
        self._look.failed.connect(self._show_failure)
        self.form.changed.connect(self._change_plan)
        self._camera.images_changed.connect(self._refresh)
        self._camera.failed.connect(self._show_failure)
        self._list.chosen_changed.connect(self._refresh)
        self._start.clicked.connect(self.start)
        self._take.clicked.connect(self.take)
        self._close.clicked.connect(self.accept)
        self._bar.busy_changed.connect(self._refresh)
        self._bar.failed.connect(self._show_not_done)
        self._lay_out()
        self._ask()
        self._found.show_finding(Finding("", Health.LIMITED, "choose the camera, and press Show"))
        self._bar.run("Looking for cameras", lambda *_: self._prepare(), self._begin)

    def start(self) -> None:
        """Show images of the chosen camera."""
        self._camera.start()
        self._list.setFocus()  # unlike a text field, it does not consume the space bar

    def take(self) -> None:
        """Keep the present image as the selected capture, if it has the expected content."""
        images, chosen, looked_for = self._camera.images, self._list.chosen, self._looked_for
        if images is None or chosen is None or looked_for is None or self._bar.is_busy:
            return
        self._bar.run(
            "Checking the image",
            lambda *_: keep_capture(images[0], self._folder, chosen, *looked_for),
            lambda seen: self._show_taken(chosen, seen),
        )

    def done(self, result: int) -> None:
        """Close camera and dialog."""
        self._camera.stop()
        self._look.stop()
        self._bar.stop()
        super().done(result)

    def _prepare(self) -> tuple[tuple[Cube, Grid], list[int]]:
        return cube_and_grid(self.entries, self._folder), self._list_cameras()

    def _begin(self, found: tuple[tuple[Cube, Grid], list[int]]) -> None:
        self._looked_for, numbers = found
        self._camera.add_cameras(numbers)
        self._refresh()

    def _change_plan(self) -> None:
        self.entries = self.form.take(self.entries)
        self._ask()

    def _ask(self) -> None:
        """Check which planned captures are missing."""
        try:
            self._plan, self._plan_problem = self.entries.plan, ""
        except ValueError as error:
            self._plan, self._plan_problem = None, str(error)
            self._list.show_captures((), ())
        else:
            self._look.ask(self._plan)

    def _show_missing(self, plan: CapturePlan, missing: list[PlannedCapture]) -> None:
        if plan == self._plan:
            self._list.show_captures(plan.captures, frozenset(missing))

    def _show_taken(self, taken: PlannedCapture, seen: str) -> None:
        self._found.show_finding(Finding("", Health.GOOD, f"taken: {taken.file}, {seen}"))
        self._ask()

    def _show_not_done(self, why: str) -> None:
        """Show why an image was not taken, or why none can be taken."""
        if self._looked_for is None:
            self._show_failure(why)
        else:
            self._found.show_finding(Finding("", Health.LIMITED, f"not taken: {why}"))

    def _show_failure(self, why: str) -> None:
        self._found.show_finding(Finding("", Health.BROKEN, why))

    def _refresh(self) -> None:
        is_ready = self._looked_for is not None and not self._bar.is_busy
        is_seen = self._camera.images is not None and self._list.chosen is not None
        self._start.setEnabled(self._looked_for is not None)
        self._take.setEnabled(is_ready and is_seen)
        self._take.setText("Take again" if self._list.chosen_is_taken else "Take")
        self._take.setShortcut(Qt.Key.Key_Space)  # setText removes the shortcut
        self._instruction.setText(self._next_instruction())

    def _next_instruction(self) -> str:
        if self._plan_problem:
            return f"{sentence(self._plan_problem)}."
        if self._list.is_complete and self._list.chosen is None:
            return "All captures have been taken."
        if self._looked_for is None or self._list.chosen is None:
            return ""
        return f"{instruction(self._list.chosen)}."

    def _lay_out(self) -> None:
        scale_font(self._instruction, 1.6, is_bold=True)
        self._instruction.setMinimumHeight(self._instruction.fontMetrics().height())
        middle = hbox((self._camera, 1), self._list, spacing=2 * SPACING_PX)
        foot = hbox(self._start, self._take, (self._bar, 1), self._close, spacing=SPACING_PX)
        vbox(
            self.form,
            (middle, 1),
            self._instruction,
            self._found,
            foot,
            on=self,
            margins=2 * SPACING_PX,
            spacing=SPACING_PX,
        )
        self.resize(QGuiApplication.primaryScreen().availableSize().boundedTo(_FIRST_SIZE))


def _plan_form() -> EntriesForm:
    positions = with_name(
        QLineEdit(),
        "positions",
        "Positions",
        "Positions of the camera in the eye box: names of folders, separated by commas.",
    )
    poses = whole_number("poses", 1, MOST_POSES, "Poses of the cube at each position.")
    drawn = with_name(
        QLineEdit(placeholderText="One", clearButtonEnabled=True),
        "drawn",
        "Renderings",
        "Names of the renderings to compare, such as: before, after.",
    )
    with_grid = with_name(
        QCheckBox("At &each position"),
        "withGrid",
        "Display's grid",
        "Without the grid, errors are measured along the camera's axes instead of the display's.",
    )
    return EntriesForm(
        {
            "positions": ("Positions", positions),
            "poses": ("Poses at each", poses),
            "drawn": ("Renderings", drawn),
            "with_grid": ("Display's grid", with_grid),
        }
    )

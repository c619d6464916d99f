"""Taking images with cameras of this computer."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from PySide6.QtCore import Qt, QTimer
from PySide6.QtWidgets import QDialog, QGridLayout, QHBoxLayout, QLabel, QVBoxLayout, QWidget

from handcal.camera.viewpoint import ViewpointCamera
from handcal.doctor import Finding, Health
from handcal.rig.board import Board
from handcal.rig.views import View
from handcal_gui.rig.job_bar import JobBar
from handcal_gui.rig.live import REALSENSE, Images, LiveImages, open_camera
from handcal_gui.rig.shots import keep_images
from handcal_gui.running.jobs import IsCancelled, Report
from handcal_gui.theme import SPACING_PX
from handcal_gui.widgets.fields import button, choice, main_button
from handcal_gui.widgets.finding_line import FindingLine
from handcal_gui.widgets.image_view import ImageView

_SOURCES = {str(number): f"Camera {number}" for number in range(10)} | {
    REALSENSE: "RealSense, colour"
}
_POLL_MS = 50


class TakeDialog(QDialog):
    """Shows what one or two cameras see, and takes images of it, all at the same moment.

    Parameters
    ----------
    folders : mapping of str to Path
        What each camera is, and where its images go; those that are there stay.
    board : Board
        Looked for in each image taken.
    open_camera : callable
        Given a source and the folder above the images', opens a camera.

    Attributes
    ----------
    shown_images : tuple of (H, W, 3) uint8, or None
        What is seen now; None while no camera is shown.
    """

    def __init__(
        self,
        folders: Mapping[str, Path],
        board: Board,
        parent: QWidget | None = None,
        open_camera: Callable[[str, Path], ViewpointCamera] = open_camera,
    ) -> None:
        super().__init__(parent)
        self.setObjectName("takeDialog")
        self.setWindowTitle("Take images")
        self._folders, self._board = dict(folders), board
        self._open_camera = open_camera
        self._live: LiveImages | None = None
        self.shown_images: Images | None = None
        self._sources = {title: choice("source", title, _SOURCES) for title in folders}
        self._views = {title: ImageView(title) for title in folders}
        self._found = FindingLine("taken")
        self._bar = JobBar()
        self._start = button("startCameras", "Show")
        self._take = main_button("takeImage", "Take")
        self._take.setShortcut(Qt.Key.Key_Space)
        self._take.setToolTip("Space bar")
        self._close = button("close", "Close")
        self._timer = QTimer(self, interval=_POLL_MS)
        self._timer.timeout.connect(self._poll)
        self._start.clicked.connect(self.start)
        self._take.clicked.connect(self.take)
        self._close.clicked.connect(self.accept)
        self._bar.busy_changed.connect(self._refresh)
        self._bar.failed.connect(self._show_failure)
        for number, source in enumerate(self._sources.values()):
            source.setCurrentIndex(number)
        self._lay_out()
        self._refresh()
        self._found.show_finding(Finding("", Health.LIMITED, "choose the cameras, and show them"))

    def start(self) -> None:
        """Show what the chosen cameras see."""
        self._stop_cameras()
        sources = [source.currentData() for source in self._sources.values()]
        if len(set(sources)) < len(sources):
            self._show_failure("one camera cannot be both: choose another")
            return
        opens = [
            partial(self._open_camera, source, folder.parent)
            for source, folder in zip(sources, self._folders.values(), strict=True)
        ]
        self._live = LiveImages(opens)
        self._live.failed.connect(self._show_failure)
        self._live.start()
        self._timer.start()
        for view in self._views.values():
            view.show_text(message="Opening the camera…")

    def take(self) -> None:
        """Keep the images shown, and look for the board in them."""
        images = self.shown_images
        if images is None or self._bar.is_busy:
            return

        def work(_report: Report, _is_cancelled: IsCancelled) -> object:
            return keep_images(images, tuple(self._folders.values()), self._board)

        self._bar.run("Looking for the board", work, self._show_taken)

    def done(self, result: int) -> None:
        """Close cameras and dialog."""
        self._stop_cameras()
        self._bar.stop()
        super().done(result)

    def _poll(self) -> None:
        newest = self._live.newest if self._live is not None else None
        if newest is None or newest is self.shown_images:
            return
        self.shown_images = newest
        for view, image in zip(self._views.values(), newest, strict=True):
            view.show_text()
            view.show_image(image)
        self._refresh()

    def _stop_cameras(self) -> None:
        self._timer.stop()
        if self._live is not None:
            self._live.stop()
            self._live = None
        self.shown_images = None
        self._refresh()

    def _show_failure(self, why: str) -> None:
        self._stop_cameras()
        for view in self._views.values():
            view.show_text(message="No picture")
        self._found.show_finding(Finding("", Health.BROKEN, why))

    def _show_taken(self, views: tuple[View, ...]) -> None:
        problem = "; ".join(f"{view.name}: {view.problem}" for view in views if view.problem)
        if problem:
            found = Finding("", Health.LIMITED, problem, "take another")
        else:
            counts = " and ".join(str(len(view.found.ids)) for view in views if view.found)
            found = Finding("", Health.GOOD, f"{views[0].name}: {counts} corners")
        self._found.show_finding(found)

    def _refresh(self) -> None:
        self._take.setEnabled(self.shown_images is not None and not self._bar.is_busy)

    def _lay_out(self) -> None:
        grid = QGridLayout()
        grid.setSpacing(SPACING_PX)
        for column, (title, source) in enumerate(self._sources.items()):
            row = QHBoxLayout()
            row.addWidget(QLabel(title))
            row.addWidget(source, 1)
            grid.addLayout(row, 0, column)
            grid.addWidget(self._views[title], 1, column)
            self._views[title].setMinimumSize(48 * SPACING_PX, 30 * SPACING_PX)
        grid.setRowStretch(1, 1)
        foot = QHBoxLayout()
        foot.setSpacing(SPACING_PX)
        foot.addWidget(self._start)
        foot.addWidget(self._take)
        foot.addWidget(self._bar, 1)
        foot.addWidget(self._close)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(*4 * (2 * SPACING_PX,))
        layout.setSpacing(SPACING_PX)
        layout.addLayout(grid, 1)
        layout.addWidget(self._found)
        layout.addLayout(foot)

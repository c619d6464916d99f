"""A dialog that tracks the cube live, and has the headset draw it where it stands."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TypeAlias

import numpy as np
from PySide6.QtCore import QPointF, QTimer
from PySide6.QtGui import QColor, QPainter, QPen
from PySide6.QtWidgets import QDialog, QWidget
from scipy.spatial.transform import Rotation

from handcal.core.progress import Progress
from handcal.core.types import Float64
from handcal.io.files import user_path
from handcal.station.checks.doctor import Finding, Health
from handcal.station.user_test.cube import (
    CubeSight,
    CubeTracking,
    TrackingOrder,
    track_cube,
)
from handcal_gui.app.theme import SPACING_PX, colors
from handcal_gui.app.translation import tr
from handcal_gui.evaluate.devices import depth_camera, paired_headset, pairing_problem
from handcal_gui.evaluate.entries import CubeEntries
from handcal_gui.widgets.action_strip import action_strip
from handcal_gui.widgets.entries_form import EntriesForm
from handcal_gui.widgets.fields import button, main_button, one_of
from handcal_gui.widgets.finding_line import FindingLine
from handcal_gui.widgets.image_view import ImageView
from handcal_gui.widgets.job_bar import JobBar
from handcal_gui.widgets.layouts import hbox, vbox
from handcal_gui.widgets.table import Row, Table

_POLL_MS = 30
_AXES = ("x", "y", "z")
# Of the vertices of `cube_corners_m`: around the front, around the back, and between the two.
_EDGES = tuple(
    edge for n in range(4) for edge in ((n, (n + 1) % 4), (4 + n, 4 + (n + 1) % 4), (n, 4 + n))
)
Track: TypeAlias = Callable[..., CubeTracking]


class TrackDialog(QDialog):
    """Shows the depth camera's image with the cube's edges, and the filtered pose beside it.

    Parameters
    ----------
    entries : CubeEntries
    track : callable
        Like `track_cube`.
    pairing_problem : callable
        As in `devices`.
    """

    def __init__(
        self,
        entries: CubeEntries,
        parent: QWidget | None = None,
        track: Track = track_cube,
        pairing_problem: Callable[[], str] = pairing_problem,
    ) -> None:
        super().__init__(parent)
        self.setObjectName("trackDialog")
        self.setWindowTitle(tr("Track the cube"))
        self.entries = entries
        self._track, self._pairing_problem = track, pairing_problem
        self._sight: CubeSight | None = None
        self._shown: CubeSight | None = None
        self.form = EntriesForm(CubeEntries, ("tracked_by",))
        self.form.show_entries(entries)
        self._view = ImageView(tr("Depth camera, colour"))
        self._view.setMinimumSize(56 * SPACING_PX, 32 * SPACING_PX)
        self._view.show_text(
            message=tr("The camera's image and the cube's edges will be shown here.")
        )
        self._pose = Table("pose-of-the-cube", tr("Pose of the cube"))
        self._pose.setMinimumWidth(44 * SPACING_PX)
        self._pose.hide()
        self._task = one_of(
            {
                "trackStart": tr("Choose what tracks the cube and press Start."),
                "trackMove": tr("Put the cube where the depth camera sees it. Press Stop to end."),
            }
        )
        self._found = FindingLine("track")
        self._bar = JobBar(tr("S&top"))
        self._start = main_button("start", tr("Start"))
        self._close = button("close", tr("&Close"))
        self._timer = QTimer(self, interval=_POLL_MS)
        self._timer.timeout.connect(self._poll)
        self.form.changed.connect(self._keep)
        self._start.clicked.connect(self.start)
        self._close.clicked.connect(self.accept)
        self._bar.failed.connect(self._show_failure)
        self._bar.busy_changed.connect(self._refresh)
        self._lay_out()
        self._refresh()

    def start(self) -> None:
        """Track until stopped."""
        entries, by = self.entries, self.entries.tracked_by
        order = TrackingOrder(_path(entries.rig), _path(entries.cube))
        connect = paired_headset if by == "network" else None
        camera = None if by == "virtual" else depth_camera

        def work(progress: Progress) -> CubeTracking:
            return self._track(order, connect, camera, self._see, progress)

        self._sight = self._shown = None
        self._view.show_image(None)
        self._view.show_text(message=tr("No image yet"))
        self._pose.hide()
        doing = tr("Waiting for the headset") if by == "network" else tr("Opening the camera")
        self._bar.run(doing, work, lambda _: self._refresh())

    def done(self, result: int) -> None:
        """Stop tracking, and close."""
        self._bar.stop()
        self._timer.stop()
        super().done(result)

    def _see(self, sight: CubeSight) -> None:
        """Keep the newest frame to be shown; runs in the job's thread."""
        self._sight = sight

    def _poll(self) -> None:
        sight = self._sight
        if sight is None or sight is self._shown:
            return
        if self._shown is None:
            self._bar.say(tr("Tracking"))
        self._shown = sight
        self._view.show_text()
        self._view.show_image(sight.frame.color)
        self._view.show_overlay(partial(_draw_edges, sight.corners_px))
        self._pose.show_rows(_AXES, _pose_rows(sight))
        self._pose.show()
        self._found.show_finding(_finding(sight))

    def _show_failure(self, why: str) -> None:
        self._found.show_finding(Finding("", Health.BROKEN, why))

    def _keep(self) -> None:
        self.entries = self.form.take(self.entries)
        self._found.clear()
        self._refresh()

    def _refresh(self) -> None:
        is_busy = self._bar.is_busy
        self._task.setCurrentIndex(int(is_busy))
        self.form.setEnabled(not is_busy)
        by_headset = self.entries.tracked_by == "network" and not is_busy
        problem = self._pairing_problem() if by_headset else ""
        self._start.setEnabled(not (is_busy or problem))
        self._pose.setEnabled(is_busy)  # dimmed like the image: it is no longer so
        if is_busy:
            self._timer.start()
            return
        self._timer.stop()
        if self._shown is not None:
            self._view.show_text(message=tr("Stopped"))
            self._found.show_finding(Finding("", Health.LIMITED, tr("the cube is not tracked")))
        if problem:
            advice = tr("or choose something else in Tracked by")
            self._found.show_finding(Finding("", Health.LIMITED, problem, advice))

    def _lay_out(self) -> None:
        middle = hbox((self._view, 2), (self._pose, 1), spacing=2 * SPACING_PX)
        foot = action_strip(self._start, self._close, bar=self._bar)
        vbox(
            self._task,
            self.form,
            (middle, 1),
            self._found,
            foot,
            on=self,
            margins=2 * SPACING_PX,
            spacing=SPACING_PX,
        )


def _path(text: str) -> Path | None:
    return user_path(text) if text else None


def _finding(sight: CubeSight) -> Finding:
    if sight.problem:
        return Finding("", Health.BROKEN, sight.problem)
    if sight.tracked is None:
        return Finding("", Health.LIMITED, tr("waiting for the head's pose"))
    if not sight.tracked.is_at_rest:
        return Finding("", Health.LIMITED, tr("the cube is moving"))
    return Finding("", Health.GOOD, tr("the cube is at rest"))


def _pose_rows(sight: CubeSight) -> list[Row]:
    """Return the filtered pose in the world, and the measured one relative to the camera."""
    rows = []
    if sight.tracked is not None:
        T_W_T = sight.tracked.T_W_T
        turn_deg = np.degrees(Rotation.from_matrix(T_W_T[:3, :3]).as_rotvec())
        averaged = tr("Filtered; from the cube's middle to the origin of the headset's world.")
        rows.append(Row(tr("In the room, mm"), _cells(1e3 * T_W_T[:3, 3], 1), averaged))
        rows.append(Row(tr("Rotation vector, °"), _cells(turn_deg, 2), averaged))
    if sight.T_D_T is not None:
        before = tr("Measured in this image; from the depth camera.")
        rows.append(Row(tr("From the camera, mm"), _cells(1e3 * sight.T_D_T[:3, 3], 1), before))
    return rows


def _cells(values: Float64, digits: int) -> tuple[str, ...]:
    return tuple(f"{value:.{digits}f}" for value in values)


def _draw_edges(corners_px: Float64 | None, painter: QPainter) -> None:
    """Draw the cube's edges as measured, in pixels of the colour image."""
    if corners_px is None:
        return
    pen = QPen(QColor(colors().live), 2.0 * painter.device().devicePixelRatio())
    pen.setCosmetic(True)
    painter.setPen(pen)
    corners = [QPointF(x, y) for x, y in corners_px.tolist()]
    for one, other in _EDGES:
        painter.drawLine(corners[one], corners[other])

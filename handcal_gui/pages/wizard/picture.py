"""The guide's picture: the camera's image, or what the wearer sees, with the result below it."""

from __future__ import annotations

from PySide6.QtCore import Qt, QTimer
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QBoxLayout, QLabel, QStackedLayout, QWidget

from handcal.hand.overlay import contour_px
from handcal.station.snapshot import Snapshot
from handcal.types import EYES, Eye, Frame
from handcal_gui.pages.wizard.result_bar import ResultBar
from handcal_gui.pages.wizard.view import Step
from handcal_gui.panels.camera.hand_overlay import HandOverlay
from handcal_gui.panels.wearer_view.eye_canvas import EyeCanvas, show_alike
from handcal_gui.panels.wearer_view.panel import origin_text
from handcal_gui.theme import SPACING_PX
from handcal_gui.translation import tr
from handcal_gui.widgets.image_view import ImageView
from handcal_gui.widgets.layouts import hbox, vbox
from handcal_gui.widgets.missing import missing_text
from handcal_gui.widgets.result_rows import EYE_NAMES

_BLINK_MS = 800
_LEAST_PX = 80, 48
_WIDE = 2.2
"""Width over height above which the result stands beside the eyes."""
_OF_THE_HAND = frozenset({Step.CONNECT, Step.SHOW_HAND, Step.MAKE_CURSOR})
OF_THE_RESULT = frozenset({Step.VERIFY, Step.SAVE})
"""Steps whose picture shows the result."""


class GuidePicture(QWidget):
    """One picture that fits the step; both eyes are shown at one height.

    Attributes
    ----------
    result : ResultBar
        The result below the eyes, with its buttons.
    step : Step
        The step that the picture is for.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("guidePicture")
        self.step = Step.CONNECT
        self._frame: Frame | None = None
        self._camera = ImageView(tr("Guide camera"))
        self._eyes = {eye: EyeCanvas(tr("Guide {}").format(EYE_NAMES[eye])) for eye in EYES}
        self._titles = {eye: QLabel(alignment=Qt.AlignmentFlag.AlignCenter) for eye in EYES}
        self._columns = {eye: QWidget() for eye in EYES}
        for eye, column in self._columns.items():
            self._eyes[eye].setMinimumSize(*_LEAST_PX)
            vbox(self._titles[eye], (self._eyes[eye], 1), on=column, margins=0, spacing=0)
        self.result = ResultBar()
        self.result.hide()
        self._is_before = False
        self._blink = QTimer(self, interval=_BLINK_MS)
        self._blink.timeout.connect(lambda: self._show_before(not self._is_before))
        self.result.blink_toggled.connect(self._set_blinking)
        views = QWidget()
        columns = hbox(*((one, 1) for one in self._columns.values()), spacing=SPACING_PX)
        self._layout = vbox((columns, 1), self.result, on=views, margins=0, spacing=SPACING_PX)
        self._views = views
        self._stack = QStackedLayout(self)
        for page in (self._camera, self._views):
            self._stack.addWidget(page)
        self._show_before(False)

    @property
    def wants_views(self) -> bool:
        """True if the picture is of the eyes' views."""
        return self.step not in _OF_THE_HAND

    def show_snapshot(self, snapshot: Snapshot) -> None:
        """Show the picture of a snapshot that fits the step."""
        verifying = snapshot.procedure.verifying
        is_result = self.step in OF_THE_RESULT and verifying is None
        # Of a cursor or a verification, only the eyes that it is for.
        is_of_some = self.step is Step.ALIGN or verifying is not None
        open_eyes = snapshot.procedure.eyes if is_of_some else EYES
        if self.wants_views and (snapshot.views or is_result):
            self._show_eyes(snapshot, open_eyes, is_result=is_result)
        else:
            self._show_camera(snapshot)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Put the result beside the eyes if that makes them larger."""
        super().resizeEvent(event)
        least_px = 2 * self.result.minimumSizeHint().width()
        is_wide = self.width() > max(_WIDE * self.height(), least_px)
        directions = QBoxLayout.Direction
        self._layout.setDirection(directions.LeftToRight if is_wide else directions.TopToBottom)
        self._layout.setStretchFactor(self.result, 1 if is_wide else 0)

    def _show_camera(self, snapshot: Snapshot) -> None:
        self.result.hide()  # or it takes its room in the layout
        self._stack.setCurrentWidget(self._camera)
        frame, seen = snapshot.frame, snapshot.observation
        if frame is not None and frame is not self._frame:
            self._frame = frame
            self._camera.show_image(frame.color)
        if frame is not None and seen is not None:
            outline = None
            if seen.cloud is not None:
                depth_px, color_px = contour_px(seen.cloud, frame)
                if color_px is not None:
                    overlay = HandOverlay(seen.cloud, depth_px, color_px, seen.is_over_limit)
                    outline = overlay.draw
            self._camera.show_overlay(outline)
        message = "" if frame is not None else tr("Waiting for the camera's first image…")
        self._camera.show_text(message=tr("No image") if snapshot.camera.problem else message)

    def _show_eyes(self, snapshot: Snapshot, eyes: tuple[Eye, ...], *, is_result: bool) -> None:
        message = missing_text(snapshot)
        for eye, canvas in self._eyes.items():
            self._columns[eye].setVisible(eye in eyes)
            view, results = snapshot.views.get(eye), snapshot.procedure.results
            canvas.show_view(view, message or ("" if view else tr("No hand")))
            is_solved = results is not None and eye in results.eyes
            when = (tr(", before the calibration") if self._is_before else tr(", now")) * is_result
            origin = origin_text(view, is_solved=is_solved)
            self._titles[eye].setText(f"{EYE_NAMES[eye]}{origin}{when}")
        show_alike([self._eyes[eye] for eye in eyes])
        self.result.setVisible(is_result)
        if is_result:
            self.result.show_snapshot(snapshot)
        self._stack.setCurrentWidget(self._views)

    def _set_blinking(self, is_blinking: bool) -> None:
        if is_blinking:
            self._blink.start()
        else:
            self._blink.stop()
        self._show_before(is_blinking)

    def _show_before(self, is_before: bool) -> None:
        """Show the outline as drawn before the calibration, or as it is drawn now."""
        self._is_before = is_before
        for canvas in self._eyes.values():
            canvas.show_offline(is_before)
            canvas.show_drawn(not is_before)

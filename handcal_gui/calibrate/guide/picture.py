"""The guide's picture: the camera's image, or what the wearer sees, with the result below it."""

from __future__ import annotations

from PySide6.QtCore import QRectF, Qt, QTimer
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QBoxLayout, QLabel, QStackedLayout, QWidget

from handcal.core.types import EYES, Eye, Frame
from handcal.hand.overlay import contour_px
from handcal.station.snapshot import Snapshot
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.camera.hand_overlay import HandOverlay
from handcal_gui.calibrate.guide.result_bar import ResultBar
from handcal_gui.calibrate.guide.view import Step
from handcal_gui.calibrate.parts.missing import missing_view_text
from handcal_gui.calibrate.wearer_view.eye_canvas import EyeCanvas, show_alike
from handcal_gui.calibrate.wearer_view.panel import origin_text, outline_legend
from handcal_gui.widgets.image_view import ImageView
from handcal_gui.widgets.layouts import hbox, vbox
from handcal_gui.widgets.result_rows import EYE_NAMES

_BLINK_MS = 800
_LEAST_PX = 80, 48
_ANY_HEIGHT_PX = 16_777_215
"""Qt's largest height of a widget."""
_ASPECT = 0.8
"""Height over width of a view, until one is known."""
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
        self._legend = outline_legend()
        self.result = ResultBar()
        self.result.hide()
        self._aspect = 0.0  # height over width of the views, the largest beside one result
        self._is_before = self._has_only_result = False
        self._blink = QTimer(self, interval=_BLINK_MS)
        self._blink.timeout.connect(lambda: self._show_before(not self._is_before))
        self.result.blink_toggled.connect(self._set_blinking)
        views = QWidget()
        self._both = QWidget()
        columns = ((one, 1) for one in self._columns.values())
        eyes = hbox(*columns, margins=0, spacing=SPACING_PX)
        # From the left, so that no entry moves when another is added.
        legend = hbox(*self._legend.values(), 1, margins=0, spacing=2 * SPACING_PX)
        # Above: below, it would be far from pictures that are less high than their place.
        self._rows = vbox(legend, (eyes, 1), on=self._both, margins=0)
        self._layout = vbox((self._both, 1), self.result, on=views, margins=0, spacing=SPACING_PX)
        self._views = views
        self._stack = QStackedLayout(self)
        for page in (self._camera, self._views):
            self._stack.addWidget(page)
        self._set_blinking(False)

    @property
    def wants_views(self) -> bool:
        """True if the picture is of the eyes' views."""
        return self.step not in _OF_THE_HAND

    @property
    def is_result_beside(self) -> bool:
        """True if the result is beside the eyes, not below them."""
        return self._layout.direction() is QBoxLayout.Direction.LeftToRight

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

    def begin(self) -> None:
        """Remove the image of the session before."""
        self._frame = None
        self._camera.show_image(None)
        self._camera.show_overlay(None)

    def fit(self, *, has_details: bool, has_eyes: bool) -> None:
        """Leave out of the result what a low window has no room for: the eyes only above it."""
        self.result.card.show_details(has_details)
        self._has_only_result = not has_eyes

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Put the result beside the eyes if that makes them larger."""
        super().resizeEvent(event)
        self._arrange()

    def _arrange(self) -> None:
        """Put the result below the eyes, or beside them if they are larger then."""
        width_px, height_px, card = self.width(), self.height(), self.result
        aspect = self._aspect or _ASPECT
        card_px = max(card.sizeHint().height(), card.heightForWidth(width_px))
        below_px = min(height_px - card_px, aspect * width_px / 2)
        beside_px = min(height_px, aspect * width_px / 4)
        is_wide = beside_px > below_px and width_px > 2 * card.minimumSizeHint().width()
        directions = QBoxLayout.Direction
        self._layout.setDirection(directions.LeftToRight if is_wide else directions.TopToBottom)
        self._layout.setStretchFactor(card, 1 if is_wide else 0)
        self._fit_eyes()

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
        message = "" if frame is not None else tr("The camera's image will appear here.")
        has_ended = frame is not None and snapshot.camera.problem
        self._camera.show_text(message=tr("No image") if has_ended else message)

    def _show_eyes(self, snapshot: Snapshot, eyes: tuple[Eye, ...], *, is_result: bool) -> None:
        message = missing_view_text(snapshot)
        for eye, canvas in self._eyes.items():
            self._columns[eye].setVisible(eye in eyes)
            view, results = snapshot.views.get(eye), snapshot.procedure.results
            canvas.show_view(view, message or ("" if view else tr("No hand")))
            is_solved = results is not None and eye in results.eyes
            when = (tr(", before the calibration") if self._is_before else tr(", now")) * is_result
            origin = origin_text(view, is_solved=is_solved)
            self._titles[eye].setText(f"{EYE_NAMES[eye]}{origin}{when}")
        has_image = any(view.image is not None for view in snapshot.views.values())
        for entry in self._legend.values():
            entry.show_on_image(has_image)
        has_cursor = any(len(view.cursor_px) for view in snapshot.views.values())
        self._legend["cursor"].setVisible(has_cursor or snapshot.procedure.cursor is not None)
        part_px = show_alike([self._eyes[eye] for eye in eyes])
        is_new = is_result and self.result.isHidden()
        self.result.setVisible(is_result)
        # Only higher while the result is shown, or the result would move with the hand.
        before = self._aspect * is_result
        self._aspect = before if part_px.isEmpty() else max(before, _aspect(part_px))
        if is_result:
            self.result.show_snapshot(snapshot)
        if is_new:
            self._arrange()
        has_eyes = not (is_result and not self.is_result_beside and self._has_only_result)
        self._both.setVisible(has_eyes)
        self.result.offer_blinking(has_eyes)
        self._fit_eyes()
        self._stack.setCurrentWidget(self._views)

    def _fit_eyes(self) -> None:
        """Make the eyes no higher than their picture, so that the result stands right below."""
        is_below = not self.is_result_beside and not self.result.isHidden()
        is_fitted = is_below and self._aspect > 0.0
        shown = sum(not column.isHidden() for column in self._columns.values())
        both_px = self.width() / (2 if self.is_result_beside else 1)
        width_px = (both_px - SPACING_PX * (shown - 1)) / max(shown, 1)
        title_px = self._titles["left"].sizeHint().height()
        legend_px = self._legend["hand"].sizeHint().height()
        fitted_px = title_px + max(round(self._aspect * width_px), _LEAST_PX[1]) + legend_px
        # A low window has no room to hold the key apart from the titles below it.
        gap_px = SPACING_PX // 2
        below_px = self.result.sizeHint().height() + SPACING_PX if is_below else 0
        is_low = self.height() - below_px < fitted_px + gap_px
        self._rows.setSpacing(0 if is_low else gap_px)
        fitted_px += self._rows.spacing()
        self._both.setMaximumHeight(fitted_px if is_fitted else _ANY_HEIGHT_PX)

    def _set_blinking(self, is_blinking: bool) -> None:
        if is_blinking:
            self._blink.start()
        else:
            self._blink.stop()
        self._legend["offline"].setVisible(is_blinking)
        self._show_before(is_blinking)

    def _show_before(self, is_before: bool) -> None:
        """Show the outline as drawn before the calibration, or as it is drawn now."""
        self._is_before = is_before
        for canvas in self._eyes.values():
            canvas.show_offline(is_before)
            canvas.show_drawn(not is_before)


def _aspect(part_px: QRectF) -> float:
    """Return height over width."""
    return part_px.height() / part_px.width()

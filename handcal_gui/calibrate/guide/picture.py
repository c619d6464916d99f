"""The guide's picture: the camera's image, or what the wearer sees, with the result below it."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import version

from PySide6.QtCore import Qt, QTimer
from PySide6.QtGui import QPagedPaintDevice, QTextDocument
from PySide6.QtWidgets import QLabel, QStackedLayout, QWidget

from handcal.core.types import EYES, Eye, Frame
from handcal.register.results import Results
from handcal.register.verdict import VerdictSettings
from handcal.session.session import SessionRecord
from handcal.station.snapshot import Snapshot
from handcal_gui.app.keys import add_action
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.camera.hand_overlay import overlays
from handcal_gui.calibrate.guide.view import Step
from handcal_gui.calibrate.parts.missing import missing_view_text
from handcal_gui.calibrate.parts.result_card import ResultCard, result_text
from handcal_gui.calibrate.wearer_view.eye_canvas import EyeCanvas, show_alike
from handcal_gui.calibrate.wearer_view.panel import origin_text, outline_legend
from handcal_gui.widgets.brief import copy_text
from handcal_gui.widgets.fields import tool_button
from handcal_gui.widgets.image_view import ImageView
from handcal_gui.widgets.layouts import hbox, vbox
from handcal_gui.widgets.printing import ask_printer
from handcal_gui.widgets.result_rows import EYE_NAMES
from handcal_gui.widgets.session_rows import session_facts

_BLINK_MS = 800
_LEAST_PX = 80, 48
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
        self._is_before = False
        self._blink = QTimer(self, interval=_BLINK_MS)
        self._blink.timeout.connect(lambda: self._show_before(not self._is_before))
        self.result.blink.toggled.connect(self._set_blinking)
        views = QWidget()
        both = QWidget()
        columns = ((one, 1) for one in self._columns.values())
        eyes = hbox(*columns, margins=0, spacing=SPACING_PX)
        # From the left, so that no entry moves when another is added.
        legend = hbox(*self._legend.values(), 1, margins=0, spacing=2 * SPACING_PX)
        vbox(legend, (eyes, 1), on=both, margins=0, spacing=SPACING_PX // 2)
        vbox(self.result, (both, 1), on=views, margins=0, spacing=SPACING_PX)
        self._views = views
        self._stack = QStackedLayout(self)
        for page in (self._camera, self._views):
            self._stack.addWidget(page)
        self._set_blinking(False)

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
        self.result.offer_blinking(is_result and snapshot.comparing is None)
        if self.wants_views and (snapshot.views or is_result):
            self._show_eyes(snapshot, open_eyes, is_result=is_result)
        else:
            self._show_camera(snapshot)

    def begin(self) -> None:
        """Remove the image of the session before."""
        self._frame = None
        self._camera.show_image(None)
        self._camera.show_overlay(None)

    def _show_camera(self, snapshot: Snapshot) -> None:
        self.result.hide()  # or it takes its room in the layout
        self._stack.setCurrentWidget(self._camera)
        frame, seen = snapshot.frame, snapshot.observation
        if frame is not None and frame is not self._frame:
            self._frame = frame
            self._camera.show_image(frame.color)
        if frame is not None and seen is not None:
            self._camera.show_overlay(overlays(frame, seen)[1])
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
        has_cursor = any(len(view.cursor_px) for view in snapshot.views.values())
        self._legend["cursor"].setVisible(has_cursor or snapshot.procedure.cursor is not None)
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
        self._legend["offline"].setVisible(is_blinking)
        self._show_before(is_blinking)

    def _show_before(self, is_before: bool) -> None:
        """Show the outline as drawn before the calibration, or as it is drawn now."""
        self._is_before = is_before
        for canvas in self._eyes.values():
            canvas.show_offline(is_before)
            canvas.show_drawn(not is_before)


class ResultBar(QWidget):
    """The result card; its buttons to blink, copy and print stand elsewhere.

    Attributes
    ----------
    buttons : QWidget
    card : ResultCard
    blink : QAction
        Checked while before and after are to be shown in turn.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("resultBar")
        self._results: Results | None = None
        self._target_arcmin = VerdictSettings().target_arcmin
        self._record: SessionRecord | None = None
        self.card = ResultCard()
        self.blink = add_action(
            self, tr("Bl&ink before/after"), "", tooltip=tr("Show both in turn")
        )
        self.blink.setCheckable(True)
        copy = add_action(self, tr("Cop&y"), "", self.copy, tooltip=tr("Copy the result as text"))
        window = Qt.ShortcutContext.WindowShortcut
        ask = add_action(self, tr("Print the result"), "Ctrl+P", self._ask_printer, context=window)
        ask.setIconText(tr("Print…"))
        self._blink_button, *others = map(tool_button, (self.blink, copy, ask))
        self.buttons = QWidget()
        hbox(self._blink_button, *others, on=self.buttons, margins=0, spacing=SPACING_PX)
        vbox(self.card, on=self, margins=0)

    def show_snapshot(self, snapshot: Snapshot) -> None:
        """Show the results of a snapshot if they have changed."""
        results, record = snapshot.procedure.results, snapshot.record
        self._target_arcmin = snapshot.settings.solve.verdict.target_arcmin
        if results is not self._results or record is not self._record:
            self._results, self._record = results, record
            self.card.show_results(results, record, self._target_arcmin)

    def offer_blinking(self, is_offered: bool) -> None:
        """Offer to show before and after in turn, where they are in sight."""
        self._blink_button.setVisible(is_offered)
        if not is_offered:
            self.blink.setChecked(False)

    def text(self) -> str:
        """Return the result as text; empty if there is none."""
        if self._results is None or self._record is None:
            return ""
        return result_text(self._results, self._record, self._target_arcmin, _head(self._record))

    def copy(self) -> None:
        """Copy the result as text."""
        copy_text(self.buttons, self.text(), tr("Copied: the result"))

    def print_to(self, printer: QPagedPaintDevice) -> None:
        """Print the result as text."""
        document = QTextDocument()
        document.setPlainText(self.text())
        document.print_(printer)

    def _ask_printer(self) -> None:
        ask_printer(self.buttons, self.print_to)


def _head(record: SessionRecord) -> Mapping[str, str]:
    return {
        tr("Wearer"): record.wearer or tr("without a name"),
        tr("Session"): record.path.name,
        **session_facts(record),
        tr("Made with"): tr("handcal {}").format(version("handcal")),
    }

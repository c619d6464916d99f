"""The wearer's view panel: hand and cursor seen by each eye through its display."""

from __future__ import annotations

from PySide6.QtWidgets import QCheckBox, QLabel, QWidget

from handcal.core.types import EYES, Eye
from handcal.station.snapshot import Snapshot
from handcal.station.wearer_view import EyeView, Overlay
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.parts.legend import LegendEntry
from handcal_gui.calibrate.parts.missing import missing_view_text
from handcal_gui.calibrate.wearer_view.eye_canvas import LINES, EyeCanvas, show_alike
from handcal_gui.widgets.layouts import hbox, vbox
from handcal_gui.widgets.number_label import UNKNOWN, NumberLabel

_TITLES: dict[Eye, str] = {"left": tr("Left eye"), "right": tr("Right eye")}
_EMPTY = tr("This eye's view will appear here. Hold a hand in front of the depth camera.")
_CLOSED = tr("Closed: this alignment is for the other eye.")
_ERROR = tr(
    "Mean distance between the hand's outline as the eye sees it and as {}, "
    "in the display's pixels and in minutes of arc (′)"
)
_LEGEND = {
    "hand": (tr("Hand"), tr("The hand, and the target of a trial, as seen by the eye")),
    "drawn": (
        tr("Drawn"),
        tr("Hand and target as drawn by the headset; they cover the others if φ is right"),
    ),
    "cursor": (tr("Cursor"), tr("The frozen hand as drawn by the headset")),
    "offline": (tr("Before"), tr("The hand's outline as drawn before calibration, with φ = 0")),
}

_NUMBER_SCALE = 0.85
"""Font scale at which both eyes' numbers fit side by side into a narrow column."""


class WearerViewPanel(QWidget):
    """Both eyes side by side, to show the effect of the calibration.

    With the simulator the images show the view of the true eyes; with a real headset they are
    predicted from the solved eye shift.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("wearer-view-panel")
        self._eyes = {eye: _EyeColumn(eye) for eye in EYES}
        self._entries = outline_legend()
        whole, before = QCheckBox(tr("&Whole display")), QCheckBox(tr("Before &calibration"))
        whole.setObjectName("wearer-view-whole")
        whole.setToolTip(tr("Show each whole display instead of the part with the hand"))
        before.setObjectName("wearer-view-before")
        before.setToolTip(_LEGEND["offline"][1])
        before.toggled.connect(self._entries["offline"].setVisible)
        for column in self._eyes.values():
            whole.toggled.connect(column.canvas.show_whole)
            before.toggled.connect(column.canvas.show_offline)
        self._lay_out(whole, before)
        before.setChecked(True)  # then: what it shows would be a window without a parent

    def show_snapshot(self, snapshot: Snapshot) -> None:
        """Show the eyes' views, the closed eye, or a message."""
        procedure, missing = snapshot.procedure, missing_view_text(snapshot)
        for eye, column in self._eyes.items():
            is_closed = procedure.cursor is not None and eye not in procedure.eyes
            message = _CLOSED if is_closed else missing
            is_solved = procedure.results is not None and eye in procedure.results.eyes
            column.show_view(snapshot.views.get(eye), message, is_solved=is_solved)
        show_alike([column.canvas for column in self._eyes.values()])

    def _lay_out(self, whole: QCheckBox, before: QCheckBox) -> None:
        both = hbox(*((column, 1) for column in self._eyes.values()), spacing=SPACING_PX)
        legend = hbox(*self._entries.values(), spacing=SPACING_PX)
        options = hbox(whole, before, 0, spacing=SPACING_PX)
        vbox(options, (both, 1), legend, on=self, margins=SPACING_PX, spacing=SPACING_PX)


class _EyeColumn(QWidget):
    """One eye's title, view and errors."""

    def __init__(self, eye: Eye) -> None:
        super().__init__()
        self._name = _TITLES[eye]
        self._title = QLabel(self._name)
        self.canvas = EyeCanvas(self._name)
        self.canvas.setObjectName(f"{eye}-eye")
        self._now = _ErrorRow(tr("Error"), _ERROR.format(tr("the headset draws it")))
        self._before = _ErrorRow(
            tr("Before"), _ERROR.format(tr("drawn before calibration (φ = 0)"))
        )
        self._now.emphasise()
        vbox(
            self._title,
            (self.canvas, 1),
            self._now,
            self._before,
            on=self,
            margins=0,
            spacing=SPACING_PX // 2,
        )
        self.show_view(None, "", is_solved=False)

    def show_view(self, view: EyeView | None, message: str, *, is_solved: bool) -> None:
        """Show a view or a message; errors only if the eye's position is known."""
        self.canvas.show_view(view, message or ("" if view else _EMPTY))
        self._title.setText(f"{self._name}{origin_text(view, is_solved=is_solved)}")
        is_known = view is not None and (view.is_true or is_solved) and not message
        # Of a real eye, whose position is only estimated, the solved φ has no error.
        is_predicted = is_solved and view is not None and not view.is_true
        self._now.set_name(tr("Against solved φ") if is_predicted else tr("Error"))
        self._now.show_overlay(view.drawn if view and is_known else None)
        self._before.show_overlay(view.offline if view and is_known else None)


def outline_legend() -> dict[str, LegendEntry]:
    """Return the legend's entries by the kinds of outlines, see `LINES`."""
    return {
        what: LegendEntry(what, QLabel(name), LINES[what][0], tooltip, LINES[what][1])
        for what, (name, tooltip) in _LEGEND.items()
    }


def origin_text(view: EyeView | None, *, is_solved: bool) -> str:
    """Return the source of the eye's position."""
    if view is None:
        return ""
    if view.is_true:
        return tr(", simulated")
    return tr(", predicted") if is_solved else tr(", not solved yet")


class _ErrorRow(QWidget):
    """The distance of a drawn outline from the hand."""

    def __init__(self, name: str, tooltip: str) -> None:
        super().__init__()
        self.setToolTip(tooltip)
        self._px = NumberLabel("error-px", "999.9 px", tooltip, _NUMBER_SCALE)
        self._arcmin = NumberLabel("error-arcmin", "999.9′", tooltip, _NUMBER_SCALE)
        self._name = QLabel(name)
        hbox((self._name, 1), self._px, self._arcmin, on=self, margins=0, spacing=SPACING_PX // 2)

    def emphasise(self) -> None:
        """Emphasise this row."""
        for label in self.findChildren(QLabel):
            font = label.font()
            font.setBold(True)
            label.setFont(font)

    def set_name(self, name: str) -> None:
        """Say what the distance is of."""
        self._name.setText(name)

    def show_overlay(self, overlay: Overlay | None) -> None:
        """Show an overlay's errors, if there is one with an outline."""
        is_known = overlay is not None and overlay.error_px is not None
        self._px.setText(f"{overlay.error_px:.1f} px" if overlay and is_known else UNKNOWN)
        self._arcmin.setText(f"{overlay.error_arcmin:.1f}′" if overlay and is_known else UNKNOWN)

"""The hand cloud panel: the frozen cursor and the live hand in 3D."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from PySide6.QtWidgets import QCheckBox, QHBoxLayout, QToolButton, QWidget

from handcal.calibration.hands import PlacedHand
from handcal.core.geometry import invert, transform
from handcal.core.types import Alignment, Float64, UInt8
from handcal.register.pairs import matched_pairs
from handcal.station.snapshot import Snapshot
from handcal_gui.app.keys import add_action
from handcal_gui.app.preferences import HIDDEN_LAYERS
from handcal_gui.app.theme import SPACING_PX, colors, follow_theme
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.cloud.cloud_view import CloudView
from handcal_gui.calibrate.cloud.orbit import Direction
from handcal_gui.calibrate.parts.legend import RESIDUALS, LegendEntry
from handcal_gui.calibrate.parts.missing import missing_text
from handcal_gui.calibrate.parts.residual_scale import ResidualScale, residual_colors
from handcal_gui.calibrate.parts.splat import rgb
from handcal_gui.widgets.elided_label import ElidedLabel
from handcal_gui.widgets.layouts import vbox

_EMPTY = tr("The hand cloud will appear here. Hold a hand in front of the depth camera.")
_FROM_CAMERA = tr("mm from the depth camera")
_FROM_CURSOR = tr("mm from the centre of the cursor")
_TURNED = tr("The live hand is rotated too far")
_HIDDEN = tr("All points are hidden. Switch cursor or hand on below.")
_DIRECTIONS = {
    "front": (Direction.FRONT, tr("Front"), tr("As the wearer sees it (1)")),
    "side": (Direction.SIDE, tr("Side"), tr("From the wearer's right (2)")),
    "top": (Direction.TOP, tr("Top"), tr("From above (3)")),
    "reset": (
        Direction.ASLANT,
        tr("Reset"),
        tr("Oblique view of the whole scene (R, or double-click)"),
    ),
}
_WIDEST = "9,999"
_MOST_POINTS = 6000
"""Maximum number of points drawn of each cloud, to keep up with the frame rate."""
_PAIRS_PERIOD_S = 0.5
_NONE = np.empty((0, 3))


@dataclass(frozen=True, slots=True, eq=False)
class _Axes:
    """Axes in which clouds are shown, with their origin and its name."""

    T_axes_W: Float64
    zero_m: Float64
    name: str

    def mm(self, points_W_m: Float64) -> Float64:
        """Return (N, 3) points of W in millimetres in these axes."""
        mm: Float64 = 1e3 * (transform(self.T_axes_W, points_W_m) - self.zero_m)
        return mm


@dataclass(frozen=True, slots=True, eq=False)
class _Cloud:
    """A cloud, coloured by its role or by its residuals."""

    layer: str
    """By which it can be hidden: "cursor", "hand", or "solved-cursor" of a finished alignment."""
    name: str
    role: str
    points_mm: Float64
    residuals_m: Float64 | None = None

    def drawn(self) -> tuple[Float64, UInt8]:
        """Return at most `_MOST_POINTS` points, and their colours."""
        every = slice(None, None, max(1, -(-len(self.points_mm) // _MOST_POINTS)))
        points_mm = self.points_mm[every]
        if self.residuals_m is not None:
            return points_mm, residual_colors(self.residuals_m[every])
        color = np.array(rgb(getattr(colors(), self.role)), np.uint8)
        return points_mm, np.tile(color, (len(points_mm), 1))


class CloudPanel(QWidget):
    """Shows cursor and live hand in the depth camera's axes, which are nearly the wearer's.

    A finished alignment is shown in the axes of its first eye.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("cloud-panel")
        self._clouds: list[_Cloud] = []
        self._hidden = set(HIDDEN_LAYERS)
        self._cursor_layer = "cursor"
        self._text = ""
        self._next_pairs_s = 0.0
        self._view = CloudView()
        self._shows_cursor = self._switch(tr("Cursor"), "C", lambda: self._cursor_layer)
        self._shows_hand = self._switch(tr("Live hand"), "L", lambda: "hand")
        self._pairs = self._switch(tr("Pairs"), "P", lambda: "pairs")
        self._cursor = LegendEntry(
            "cursor",
            self._shows_cursor,
            "cursor",
            tr("Show the frozen hand; the number of its points (C)"),
            widest=_WIDEST,
        )
        self._hand = LegendEntry(
            "hand",
            self._shows_hand,
            "live",
            tr("Show the hand; the number of its points (L)"),
            widest=_WIDEST,
        )
        self._scale = ResidualScale()
        self._pairs.setObjectName("cloud-pairs")
        self._pairs.setToolTip(
            tr(
                "While aligning, join points of the live hand with the nearest points of "
                "the cursor "
                "once the hand is laid over it; updated twice a second (P)"
            )
        )
        self.setFocusProxy(self._view)
        self._lay_out()
        self.clear()
        follow_theme(self, self._draw)

    @property
    def hidden_layers(self) -> tuple[str, ...]:
        """Layers that are switched off, and "pairs"."""
        return tuple(sorted(self._hidden))

    def hide_layers(self, layers: Iterable[str]) -> None:
        """Hide these layers, and show all others."""
        self._hidden = set(layers)
        self._show_switches()
        self._draw()

    def clear(self, message: str = _EMPTY) -> None:
        """Clear the panel and show a message."""
        self._show("cursor", None, None, message)

    def show_snapshot(self, snapshot: Snapshot) -> None:
        """Show the cursor, if there is one, and the live hand."""
        seen, cursor = snapshot.observation, snapshot.procedure.cursor
        problem = missing_text(snapshot)
        if seen is None and not problem:
            return
        hand = seen.hand if seen and not problem else None
        placed = cursor or hand
        if placed is None:
            self.clear(problem or _EMPTY)
            return
        self._pairs.setEnabled(True)
        axes = _live_axes(cursor, placed)
        is_red = seen is not None and seen.is_over_limit
        role = "red" if is_red else "live"
        self._show(
            "cursor",
            None if cursor is None else axes.mm(cursor.points_W_m),
            None
            if hand is None
            else _Cloud("hand", tr("Live hand"), role, axes.mm(hand.points_W_m)),
            problem or (_TURNED if is_red else axes.name),
        )
        if cursor and hand and seen and seen.rotation_rad is not None and self._pairs.isChecked():
            self._join(cursor, hand, hand.T_W_D[:3, :3] @ seen.rotation_rad, axes)
        else:
            self._forget_pairs()

    def show_alignment(self, alignment: Alignment, residuals_m: Float64 | None = None) -> None:
        """Show a finished alignment, its hand coloured by (M,) residuals; NaN for outliers.

        Its cursor would cover the colours, and is hidden at first.
        """
        T_E_W = alignment.T_E_W[alignment.eyes[0]]
        middle_m = np.median(transform(T_E_W, alignment.cursor_m), axis=0)
        axes = _Axes(T_E_W, middle_m, _FROM_CURSOR)
        self._forget_pairs()
        self._pairs.setEnabled(False)
        role = "live" if residuals_m is None else RESIDUALS
        self._show(
            "solved-cursor",
            axes.mm(alignment.cursor_m),
            _Cloud("hand", tr("Hand"), role, axes.mm(alignment.hand_m), residuals_m),
            axes.name,
        )

    def _lay_out(self) -> None:
        controls, legend = QHBoxLayout(), QHBoxLayout()
        controls.setSpacing(SPACING_PX // 2)
        for name, (direction, text, tooltip) in _DIRECTIONS.items():
            button = QToolButton()
            button.setObjectName(f"cloud-{name}")
            button.setText(text)
            button.setToolTip(tooltip)
            button.clicked.connect(lambda _, direction=direction: self._view.look(direction))
            controls.addWidget(button)
        controls.addStretch()
        controls.addWidget(self._pairs)
        legend.setSpacing(SPACING_PX)
        legend.addWidget(self._cursor)
        legend.addWidget(self._hand, 1)
        unit = ElidedLabel()
        unit.setText(tr("points"))
        legend.addWidget(unit)
        vbox(
            controls,
            (self._view, 1),
            self._scale,
            legend,
            on=self,
            margins=SPACING_PX,
            spacing=SPACING_PX,
        )

    def _switch(self, text: str, key: str, layer: Callable[[], str]) -> QCheckBox:
        """Return a check box, also with a key, that shows and hides a layer."""
        switch = QCheckBox(text)

        def change(is_on: bool) -> None:
            self._hidden = self._hidden - {layer()} if is_on else self._hidden | {layer()}
            self._forget_pairs()
            self._draw()

        switch.clicked.connect(change)
        add_action(self, tr("Show or hide: {}").format(text), key, switch.click)
        return switch

    def _show_switches(self) -> None:
        self._shows_cursor.setChecked(self._cursor_layer not in self._hidden)
        self._shows_hand.setChecked("hand" not in self._hidden)
        self._pairs.setChecked("pairs" not in self._hidden)

    def _show(
        self, cursor_layer: str, cursor_mm: Float64 | None, hand: _Cloud | None, text: str
    ) -> None:
        self._cursor_layer = cursor_layer
        cursor = None
        if cursor_mm is not None:
            cursor = _Cloud(cursor_layer, tr("Cursor"), "cursor", cursor_mm)
        if hand is None:
            self._hand.show_name(tr("Live hand"), "live")
        for entry, cloud in ((self._cursor, cursor), (self._hand, hand)):
            if cloud is not None:
                entry.show_name(cloud.name, cloud.role)
            entry.show_number(f"{len(cloud.points_mm):,}" if cloud else tr("none"))
        self._show_switches()
        self._scale.setVisible(hand is not None and hand.residuals_m is not None)
        self._clouds = [cloud for cloud in (cursor, hand) if cloud is not None]
        self._text = text
        self._draw()

    def _draw(self) -> None:
        shown = [cloud for cloud in self._clouds if cloud.layer not in self._hidden]
        drawn = [cloud.drawn() for cloud in shown]
        points_mm = np.concatenate([_NONE, *(points for points, _ in drawn)])
        shades = np.concatenate([np.empty((0, 3), np.uint8), *(shades for _, shades in drawn)])
        # Without a hand, the text says why there is none.
        is_hidden = not shown and any(cloud.layer == "hand" for cloud in self._clouds)
        self._view.show_points(points_mm, shades, _HIDDEN if is_hidden else self._text)

    def _join(self, cursor: PlacedHand, hand: PlacedHand, rotation_W: Float64, axes: _Axes) -> None:
        now_s = time.monotonic()
        if now_s >= self._next_pairs_s:
            self._next_pairs_s = now_s + _PAIRS_PERIOD_S
            clouds = cursor.points_W_m, hand.points_W_m
            pairs = matched_pairs(*clouds, rotation_W, cursor.cloud.is_cut)
            ends = (axes.mm(cloud[index]) for cloud, index in zip(clouds, pairs.T, strict=True))
            self._view.show_lines(*ends)

    def _forget_pairs(self) -> None:
        self._next_pairs_s = 0.0
        self._view.show_lines(_NONE, _NONE)


def _live_axes(cursor: PlacedHand | None, placed: PlacedHand) -> _Axes:
    """Return the depth camera's axes at the time of the cursor, or now if there is none."""
    T_D_W = invert(placed.T_W_D)
    if cursor is None:
        return _Axes(T_D_W, np.zeros(3), _FROM_CAMERA)
    return _Axes(T_D_W, transform(T_D_W, cursor.middle_W_m[None])[0], _FROM_CURSOR)

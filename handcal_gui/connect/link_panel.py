"""The link panel: connection to the headset, its quality, and pairing."""

from __future__ import annotations

from collections import deque

from PySide6.QtCore import QSize, Qt, Signal
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QScrollArea, QWidget

from handcal.link.statistics import LinkStatistics, link_rates
from handcal.station.snapshot import Snapshot
from handcal_gui.app.theme import SPACING_PX, colors, follow_theme, icon
from handcal_gui.app.translation import tr
from handcal_gui.connect.link_history import LinkHistory
from handcal_gui.connect.link_table import RATES_S, LinkTable
from handcal_gui.connect.pairing_box import PairingBox
from handcal_gui.widgets.fields import button
from handcal_gui.widgets.layouts import vbox
from handcal_gui.widgets.sentence import sentence

_PERIOD_S = 0.25
"""Interval of updating the numbers; faster changes cannot be read."""
_ICON_PX = 24
_NO_SESSION = tr("Not connected. Open a session on the start page.")


class LinkPanel(QWidget):
    """Shows the state of the link, and the pairing.

    Attributes
    ----------
    new_key_requested : Signal()
        The user requests another pairing key.
    connect_requested : Signal()
        The user wants to pair or try a headset.
    restart_headset_requested : Signal()
        The user requests a restart of the virtual headset.
    """

    new_key_requested = Signal()
    connect_requested = Signal()
    restart_headset_requested = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("link-panel")
        self._readings: deque[tuple[float, LinkStatistics]] = deque()
        self._is_connected: bool | None = None
        self._sign = QLabel()
        self._state = QLabel(textFormat=Qt.TextFormat.PlainText)
        self._state.setObjectName("link-state")
        self._state.setWordWrap(True)
        self._connect = button(
            "connect", tr("&Connect…"), tr("Pair a headset by QR code, and try it")
        )
        self._connect.hide()
        self._connect.clicked.connect(self.connect_requested)
        self._restart = button(
            "restartHeadset",
            tr("Res&tart headset"),
            help_text=tr("Restart the virtual headset's program"),
        )
        self._restart.clicked.connect(self.restart_headset_requested)
        self._restart.hide()
        self._table = LinkTable()
        self._history = LinkHistory()
        self._pairing = PairingBox()
        self._pairing.new_key_requested.connect(self.new_key_requested)
        self._pairing.hide()
        self._lay_out()
        self._show_state(is_connected=False, problem=_NO_SESSION)
        follow_theme(self, self._draw_sign)

    def show_pairing(self, address: str, key: str, *, is_virtual: bool = False) -> None:
        """Start with another link.

        Parameters
        ----------
        address : str
            Address to which the headset must connect, host:port.
        key : str
            Pairing key.
        is_virtual : bool
            True for the virtual headset, which can be restarted from here.
        """
        self._readings.clear()
        self._history.clear()
        self._pairing.show_pairing(address, key)
        self._pairing.show()
        self._connect.show()
        self._restart.setVisible(is_virtual)

    def show_snapshot(self, snapshot: Snapshot) -> None:
        """Show the state of the link, with numbers at a readable rate."""
        link, t_s = snapshot.link, 1e-9 * snapshot.t_host_ns
        self._show_state(is_connected=link.connected, problem=snapshot.link_problem)
        if self._readings and 0.0 <= t_s - self._readings[-1][0] < _PERIOD_S:
            return
        self._readings.append((t_s, link))
        while len(self._readings) > 2 and self._readings[1][0] <= t_s - RATES_S:
            self._readings.popleft()
        since_s, before = self._readings[0]
        rates = link_rates(before, link, t_s - since_s) if t_s > since_s else None
        self._table.show_link(link, rates)
        self._history.add(t_s, link.latency_ms, rates)

    def _show_state(self, *, is_connected: bool, problem: str) -> None:
        if is_connected is not self._is_connected:
            self._is_connected = is_connected
            self._draw_sign()
        word = tr("Connected") if is_connected else tr("Not connected")
        self._sign.setAccessibleName(word)
        # A problem says by itself that no headset is connected.
        both = f"{word}. {sentence(problem)}" if is_connected and problem else ""
        self._state.setText(both or sentence(problem) or word)

    def _draw_sign(self) -> None:
        drawn = (
            icon("link", colors().good)
            if self._is_connected
            else icon("link-off", colors().warning)
        )
        self._sign.setPixmap(drawn.pixmap(QSize(_ICON_PX, _ICON_PX), self.devicePixelRatio()))

    def _lay_out(self) -> None:
        top = QHBoxLayout()
        top.setSpacing(SPACING_PX)
        top.addWidget(self._sign, 0, Qt.AlignmentFlag.AlignTop)
        top.addWidget(self._state, 1)
        top.addWidget(self._restart, 0, Qt.AlignmentFlag.AlignTop)
        top.addWidget(self._connect, 0, Qt.AlignmentFlag.AlignTop)
        content = QWidget()
        vbox(
            top,
            self._pairing,
            self._table,
            (self._history, 1),
            0,
            on=content,
            margins=(SPACING_PX, SPACING_PX // 2, SPACING_PX, SPACING_PX // 2),
            spacing=SPACING_PX // 2,
        )
        area = QScrollArea()
        area.setWidget(content)
        area.setWidgetResizable(True)
        area.setFrameShape(QFrame.Shape.NoFrame)
        vbox(area, on=self, margins=0)

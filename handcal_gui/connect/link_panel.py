"""The link panel: connection to the headset, its quality, and pairing."""

from __future__ import annotations

from collections import deque

from PySide6.QtCore import QSize, Qt
from PySide6.QtWidgets import QFormLayout, QLabel, QWidget

from handcal.link.rates import LinkRates, link_rates
from handcal.link.statistics import LinkStatistics
from handcal.link.wire import Rejection
from handcal.report.cells import signed
from handcal.station.snapshot import Snapshot
from handcal_gui.app.theme import SPACING_PX, colors, follow_theme, icon, number_font
from handcal_gui.app.translation import tr
from handcal_gui.connect.key_field import KeyField
from handcal_gui.widgets.fields import button, label_for, with_name
from handcal_gui.widgets.layouts import hbox, scrollable, vbox
from handcal_gui.widgets.number_label import UNKNOWN
from handcal_gui.widgets.sentence import sentence
from handcal_gui.widgets.table import Row, Table

_PERIOD_S = 0.25
"""Interval of updating the numbers; faster changes cannot be read."""
_RATES_S = 2.0
"""Interval of rates and losses."""
_ICON_PX = 24
_NO_SESSION = tr("Not connected. Open a session on the start page.")
REJECTIONS = {
    Rejection.UNPAIRED: tr("Signed with another pairing key: enter the key above in the headset"),
    Rejection.CORRUPT: tr("Damaged in transit, or not meant for handcal"),
    Rejection.REPLAYED: tr(
        "Arrived twice or much too late; a few are normal in a wireless network"
    ),
    Rejection.OVERSIZED: tr("Longer than the protocol allows: check the headset's program"),
    Rejection.WRONG_VERSION: tr("The headset's program uses another protocol version: update it"),
    Rejection.WRONG_SESSION: tr("Sent before the headset reconnected; a few are normal"),
}
"""Explanation of each reason, and the remedy."""


class LinkPanel(QWidget):
    """Shows the state of the link, and the pairing.

    Attributes
    ----------
    connect_headset, new_key, restart_headset : QPushButton
        To pair or try a headset, to make another pairing key, and to restart the virtual headset;
        connected by the program.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("link-panel")
        self._readings: deque[tuple[float, LinkStatistics]] = deque()
        self._is_connected = False
        self._sign = QLabel()
        self._state = with_name(QLabel(textFormat=Qt.TextFormat.PlainText), "link-state")
        self._state.setWordWrap(True)
        self.connect_headset = button(
            "connect", tr("&Connect…"), tr("Pair a headset by QR code, and try it")
        )
        self.restart_headset = button(
            "restartHeadset",
            tr("Res&tart headset"),
            help_text=tr("Restart the virtual headset's program"),
        )
        self.new_key = button(
            "newKey",
            tr("&New key…"),
            tr("Make a new pairing key"),
            tr("The new key must then be entered in the headset."),
        )
        self._address = with_name(QLabel(), "pairing-address")
        self._address.setFont(number_font())
        self._address.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self._address.setToolTip(tr("Host and port that the headset must connect to, by UDP"))
        self._key = KeyField()
        self._pairing = QWidget()
        form = QFormLayout(self._pairing)
        form.setContentsMargins(0, 0, 0, 0)
        form.addRow(tr("Address"), hbox((self._address, 1), self.new_key))
        form.addRow(label_for(self._key, tr("Key")), self._key)
        self._table = Table("link-table", tr("Numbers of the link"))
        self._of_session = self._pairing, self.connect_headset, self.restart_headset
        for part in self._of_session:
            part.hide()
        content = QWidget()
        vbox(
            hbox(self._sign, (self._state, 1), self.restart_headset, self.connect_headset),
            self._pairing,
            (self._table, 1),
            on=content,
            margins=SPACING_PX,
            spacing=SPACING_PX,
        )
        vbox(scrollable(content), on=self, margins=0)
        self._show_state(is_connected=False, problem=_NO_SESSION)
        follow_theme(self, self._draw_sign)

    def show_pairing(self, address: str, key: str, *, is_virtual: bool = False) -> None:
        """Start with another link.

        Parameters
        ----------
        address : str
            Address to which the headset must connect, host:port.
        key : str
            Pairing key, hidden at first.
        is_virtual : bool
            True for the virtual headset, which can be restarted from here.
        """
        self._readings.clear()
        self._address.setText(address)
        self._key.set_key(key)
        for part in self._of_session:
            part.show()
        self.restart_headset.setVisible(is_virtual)

    def show_snapshot(self, snapshot: Snapshot) -> None:
        """Show the state of the link, with numbers at a readable rate."""
        link, t_s = snapshot.link, 1e-9 * snapshot.t_host_ns
        self._show_state(is_connected=link.connected, problem=snapshot.link_problem)
        if self._readings and 0.0 <= t_s - self._readings[-1][0] < _PERIOD_S:
            return
        self._readings.append((t_s, link))
        while len(self._readings) > 2 and self._readings[1][0] <= t_s - _RATES_S:
            self._readings.popleft()
        since_s, before = self._readings[0]
        rates = link_rates(before, link, t_s - since_s) if t_s > since_s else None
        self._table.show_rows((tr("To headset"), tr("From headset")), link_rows(link, rates))

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
        name, shade = ("link", "good") if self._is_connected else ("link-off", "warning")
        drawn = icon(name, getattr(colors(), shade))
        self._sign.setPixmap(drawn.pixmap(QSize(_ICON_PX, _ICON_PX), self.devicePixelRatio()))


def link_rows(link: LinkStatistics, rates: LinkRates | None) -> list[Row]:
    """Return the numbers of a link to and from the headset; those of a lost headset are past.

    Reasons of rejection are rows once they occur.
    """
    is_here = link.connected
    sent, received, lost, lost_inbound = 4 * (UNKNOWN,)
    if rates is not None:
        sent, received = (
            f"{one / 1e3:.1f} kB/s" for one in (rates.sent_bytes_s, rates.received_bytes_s)
        )
        lost, lost_inbound = _text(rates.lost, "%", 100.0), _text(rates.lost_inbound, "%", 100.0)
    rows = [
        Row(tr("Data"), (sent, received), tr("Kilobytes per second, over {:g} s").format(_RATES_S)),
        Row(
            tr("Lost"),
            (lost, lost_inbound),
            tr("Share of the datagrams that did not arrive, over {:g} s").format(_RATES_S),
        ),
        Row(
            tr("Latency"),
            ("", _text(link.latency_ms if is_here else None, "ms")),
            tr("Half the median time of a round trip to the headset, in milliseconds"),
        ),
        Row(
            tr("Poses"),
            ("", _text(link.pose_rate_hz if is_here else None, "Hz")),
            tr("Poses received from the headset per second"),
        ),
        Row(
            tr("Resent"),
            (str(link.resent), ""),
            tr("Fragments of messages retransmitted because they were not acknowledged in time"),
        ),
        Row(
            tr("In flight"),
            (str(link.unacked), ""),
            tr("Messages that the headset has not acknowledged yet"),
        ),
        Row(
            tr("Failed"),
            (str(link.failed), ""),
            tr("Messages that the headset did not acknowledge in time"),
        ),
        Row(
            tr("Clock"),
            (_clock(link) if is_here else UNKNOWN,),
            tr(
                "Headset's clock minus this computer's, in seconds, and its uncertainty, in "
                "milliseconds"
            ),
        ),
        Row(
            tr("Clock drift"),
            (_drift(link) if is_here else UNKNOWN,),
            tr(
                "Drift of the headset's clock over the last 30 seconds, in parts per million, and "
                "its uncertainty; positive is fast"
            ),
        ),
        Row(
            tr("Rejected"),
            ("", str(sum(link.rejected.values()))),
            tr("Datagrams that were not accepted, for the reasons below"),
        ),
    ]
    for reason, meaning in REJECTIONS.items():
        if count := link.rejected.get(reason, 0):
            label = tr("Rejected, {}").format(reason.replace("_", " "))
            rows.append(Row(label, ("", str(count)), meaning))
    return rows


def _clock(link: LinkStatistics) -> str:
    offset_ms, uncertainty_ms = link.clock_offset_ms, link.clock_uncertainty_ms
    if offset_ms is None or uncertainty_ms is None:
        return UNKNOWN
    return f"{signed(offset_ms / 1e3, 3)} s ± {uncertainty_ms:.1f} ms"


def _drift(link: LinkStatistics) -> str:
    drift_ppm, uncertainty_ppm = link.clock_drift_ppm, link.clock_drift_uncertainty_ppm
    if drift_ppm is None or uncertainty_ppm is None:
        return UNKNOWN
    return f"{signed(drift_ppm, 0)} ± {uncertainty_ppm:.0f} ppm"


def _text(value: float | None, unit: str, units_per_value: float = 1.0) -> str:
    return UNKNOWN if value is None else f"{units_per_value * value:.1f} {unit}"

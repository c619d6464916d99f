"""The link's numbers: a column for each direction, and a row for each reason of rejection."""

from __future__ import annotations

from collections.abc import Mapping

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QGridLayout, QLabel, QWidget

from handcal.link.rates import LinkRates
from handcal.link.statistics import LinkStatistics
from handcal.link.wire import Rejection
from handcal_gui.theme import SPACING_PX
from handcal_gui.translation import tr
from handcal_gui.widgets.number_label import UNKNOWN, NumberLabel
from handcal_gui.widgets.numbers import signed

RATES_S = 2.0
"""Interval of rates and losses."""

_OUT, _IN, _BOTH = 1, 2, 3
"""Columns of the table; the last spans both."""
_WIDEST = {_OUT: "9999.9 kB/s", _IN: "9999.9 kB/s", _BOTH: "−999999.999 s ± 9.9 ms"}
_ROWS = {
    tr("Latency"): {
        _IN: tr("Half the median time of a round trip to the headset, in milliseconds")
    },
    tr("Clock"): {
        _BOTH: tr(
            "Headset's clock minus this computer's, in seconds, and its uncertainty, "
            "in milliseconds"
        )
    },
    tr("Clock drift"): {
        _IN: tr("Drift of the headset's clock, in parts per million; positive is fast")
    },
    tr("Poses"): {_IN: tr("Poses received from the headset per second")},
    tr("Data"): {
        _OUT: tr("Kilobytes per second to the headset, over {:g} s").format(RATES_S),
        _IN: tr("Kilobytes per second from the headset, over {:g} s").format(RATES_S),
    },
    tr("Lost"): {
        _OUT: tr("Share of the datagrams to the headset that did not arrive, over {:g} s").format(
            RATES_S
        ),
        _IN: tr("Share of the headset's datagrams that did not arrive, over {:g} s").format(
            RATES_S
        ),
    },
    tr("Resent"): {
        _OUT: tr("Fragments of messages retransmitted because they were not acknowledged in time")
    },
    tr("Unacknowledged"): {_OUT: tr("Messages that the headset has not acknowledged yet")},
    tr("Failed"): {_OUT: tr("Messages that the headset did not acknowledge in time")},
    tr("Rejected"): {_IN: tr("Datagrams that were not accepted, for the reasons below")},
}
"""Captions, and what the numbers mean by column."""
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


class LinkTable(QWidget):
    """Shows the numbers of a link; reasons of rejection appear once they occur."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("link-table")
        self._grid = QGridLayout(self)
        self._grid.setContentsMargins(0, 0, 0, 0)
        self._grid.setHorizontalSpacing(2 * SPACING_PX)
        self._grid.setVerticalSpacing(0)
        self._grid.setColumnStretch(0, 1)
        for column, heading in ((_OUT, tr("To headset")), (_IN, tr("From headset"))):
            self._grid.addWidget(QLabel(heading), 0, column, Qt.AlignmentFlag.AlignRight)
        self._numbers = {
            (caption, column): number
            for caption, meanings in _ROWS.items()
            for column, number in self._add_row(caption, meanings)[1].items()
        }
        self._rejections: dict[str, tuple[QLabel, NumberLabel]] = {}
        for reason, meaning in REJECTIONS.items():
            caption, numbers = self._add_row(f"    {reason.replace('_', ' ')}", {_IN: meaning})
            self._rejections[reason] = caption, numbers[_IN]
        self._show_rejections({})

    def show_link(self, link: LinkStatistics, rates: LinkRates | None) -> None:
        """Show counters, and rates if known."""
        for cell, text in _texts(link, rates).items():
            self._numbers[cell].setText(text)
        self._show_rejections(link.rejected)

    def _show_rejections(self, rejected: Mapping[str, int]) -> None:
        for reason, (caption, number) in self._rejections.items():
            count = rejected.get(reason, 0)
            number.setText(str(count))
            caption.setVisible(count > 0)
            number.setVisible(count > 0)

    def _add_row(
        self, text: str, meanings: Mapping[int, str]
    ) -> tuple[QLabel, dict[int, NumberLabel]]:
        """Append a row; return its caption, and its numbers by column."""
        row = self._grid.rowCount()
        caption = QLabel(text)
        self._grid.addWidget(caption, row, 0)
        numbers = {}
        for column, meaning in meanings.items():
            caption.setToolTip(meaning)
            name = f"link-{text.strip().lower().replace(' ', '-')}-{column}"
            numbers[column] = NumberLabel(name, _WIDEST[column], meaning)
            place = (_OUT, 1, 2) if column == _BOTH else (column, 1, 1)
            self._grid.addWidget(numbers[column], row, *place)
        return caption, numbers


def _texts(link: LinkStatistics, rates: LinkRates | None) -> dict[tuple[str, int], str]:
    """Return the texts of the rows above, by caption and column."""
    drift_ppm = link.clock_drift_ppm
    texts = {
        (tr("Latency"), _IN): _text(link.latency_ms, "ms"),
        (tr("Clock"), _BOTH): _clock(link),
        (tr("Clock drift"), _IN): UNKNOWN if drift_ppm is None else f"{signed(drift_ppm, 1)} ppm",
        (tr("Poses"), _IN): _text(link.pose_rate_hz, "Hz"),
        (tr("Resent"), _OUT): str(link.resent),
        (tr("Unacknowledged"), _OUT): str(link.unacked),
        (tr("Failed"), _OUT): str(link.failed),
        (tr("Rejected"), _IN): str(sum(link.rejected.values())),
    }
    if rates is not None:
        texts |= {
            (tr("Data"), _OUT): _text(rates.sent_bytes_s / 1e3, "kB/s"),
            (tr("Data"), _IN): _text(rates.received_bytes_s / 1e3, "kB/s"),
            (tr("Lost"), _OUT): _text(rates.lost, "%", 100.0),
            (tr("Lost"), _IN): _text(rates.lost_inbound, "%", 100.0),
        }
    return texts


def _clock(link: LinkStatistics) -> str:
    offset_ms, uncertainty_ms = link.clock_offset_ms, link.clock_uncertainty_ms
    if offset_ms is None or uncertainty_ms is None:
        return UNKNOWN
    return f"{signed(offset_ms / 1e3, 3)} s ± {uncertainty_ms:.1f} ms"


def _text(value: float | None, unit: str, units_per_value: float = 1.0) -> str:
    return UNKNOWN if value is None else f"{units_per_value * value:.1f} {unit}"

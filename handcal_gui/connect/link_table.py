"""The link's numbers: a half for each direction, and a row for each reason of rejection."""

from __future__ import annotations

from collections.abc import Mapping

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QGridLayout, QLabel, QWidget

from handcal.link.statistics import LinkRates, LinkStatistics
from handcal.link.wire import Rejection
from handcal.report.cells import signed
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.widgets.elided_label import ElidedLabel
from handcal_gui.widgets.number_label import UNKNOWN, NumberLabel

RATES_S = 2.0
"""Interval of rates and losses."""

_OUT, _IN, _BOTH = 1, 2, 3
"""Halves of the table; the last spans both."""
_PLACES = {_OUT: (0, 1, 1), _IN: (2, 3, 1), _BOTH: (0, 1, 3)}
"""Columns of the caption and of the number, and how many the number spans."""
_WIDEST = {_OUT: "999.9 kB/s", _IN: "999.9 kB/s", _BOTH: "−999999.999 s ± 9.9 ms"}
_CAPTIONS = {
    "data": tr("Data"),
    "lost": tr("Lost"),
    "resent": tr("Resent"),
    "poses": tr("Poses"),
    "in-flight": tr("In flight"),
    "latency": tr("Latency"),
    "failed": tr("Failed"),
    "rejected": tr("Rejected"),
    "clock": tr("Clock"),
    "clock-drift": tr("Clock drift"),
}
_ROWS = {
    "data": {
        _OUT: tr("Kilobytes per second to the headset, over {:g} s").format(RATES_S),
        _IN: tr("Kilobytes per second from the headset, over {:g} s").format(RATES_S),
    },
    "lost": {
        _OUT: tr("Share of the datagrams to the headset that did not arrive, over {:g} s").format(
            RATES_S
        ),
        _IN: tr("Share of the headset's datagrams that did not arrive, over {:g} s").format(
            RATES_S
        ),
    },
    "resent": {
        _OUT: tr("Fragments of messages retransmitted because they were not acknowledged in time")
    },
    "poses": {_IN: tr("Poses received from the headset per second")},
    "in-flight": {_OUT: tr("Messages that the headset has not acknowledged yet")},
    "latency": {_IN: tr("Half the median time of a round trip to the headset, in milliseconds")},
    "failed": {_OUT: tr("Messages that the headset did not acknowledge in time")},
    "rejected": {_IN: tr("Datagrams that were not accepted, for the reasons below")},
    "clock": {
        _BOTH: tr(
            "Headset's clock minus this computer's, in seconds, and its uncertainty, "
            "in milliseconds"
        )
    },
    "clock-drift": {
        _BOTH: tr(
            "Drift of the headset's clock over the last 30 seconds, in parts per million, and its "
            "uncertainty; positive is fast"
        )
    },
}
"""Meaning of the numbers of each row, by half."""
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
        self._grid.setHorizontalSpacing(SPACING_PX)
        self._grid.setVerticalSpacing(0)
        for half, heading in ((_OUT, tr("To headset")), (_IN, tr("From headset"))):
            caption, number, _ = _PLACES[half]
            self._grid.setColumnStretch(caption, 1)
            self._grid.addWidget(QLabel(heading), 0, number, Qt.AlignmentFlag.AlignRight)
        self._rows = dict.fromkeys((_OUT, _IN), 1)  # the next free ones
        self._numbers = {
            (name, half): self._add_number(name, _CAPTIONS[name], half, meaning)[1]
            for name, meanings in _ROWS.items()
            for half, meaning in meanings.items()
        }
        self._rejections = {
            reason: self._add_number(
                reason.replace("_", "-"),
                tr("Rejected, {}").format(reason.replace("_", " ")),
                _IN,
                meaning,
                has_own_line=True,
            )
            for reason, meaning in REJECTIONS.items()
        }
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

    def _add_number(
        self, name: str, text: str, half: int, meaning: str, *, has_own_line: bool = False
    ) -> tuple[QLabel, NumberLabel]:
        """Append a number to a half; return its caption, and the number.

        On its own line, the caption has the room of the other half, too.
        """
        row = max(self._rows.values()) if half == _BOTH else self._rows[half]
        self._rows |= {one: row + 1 for one in self._rows if half in (one, _BOTH)}
        caption = ElidedLabel()
        caption.setText(text)
        caption.setToolTip(f"{text}: {meaning}")
        number = NumberLabel(f"link-{name}-{half}", _WIDEST[half], meaning)
        caption_column, number_column, columns = _PLACES[half]
        if has_own_line:
            self._grid.addWidget(caption, row, 0, 1, number_column)
        else:
            self._grid.addWidget(caption, row, caption_column)
        self._grid.addWidget(number, row, number_column, 1, columns)
        return caption, number


def _texts(link: LinkStatistics, rates: LinkRates | None) -> dict[tuple[str, int], str]:
    """Return the texts of the numbers above, by name and half; those of a lost headset are past."""
    is_here = link.connected
    texts = {
        ("latency", _IN): _text(link.latency_ms if is_here else None, "ms"),
        ("clock", _BOTH): _clock(link) if is_here else UNKNOWN,
        ("clock-drift", _BOTH): _drift(link) if is_here else UNKNOWN,
        ("poses", _IN): _text(link.pose_rate_hz if is_here else None, "Hz"),
        ("resent", _OUT): str(link.resent),
        ("in-flight", _OUT): str(link.unacked),
        ("failed", _OUT): str(link.failed),
        ("rejected", _IN): str(sum(link.rejected.values())),
    }
    if rates is not None:
        texts |= {
            ("data", _OUT): _text(rates.sent_bytes_s / 1e3, "kB/s"),
            ("data", _IN): _text(rates.received_bytes_s / 1e3, "kB/s"),
            ("lost", _OUT): _text(rates.lost, "%", 100.0),
            ("lost", _IN): _text(rates.lost_inbound, "%", 100.0),
        }
    return texts


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

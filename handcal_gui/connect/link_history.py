"""Plots of latency and losses over the last half minute."""

from __future__ import annotations

from collections import deque
from math import nan

import numpy as np
from PySide6.QtCore import QSize
from PySide6.QtWidgets import QWidget

from handcal.core.types import Float64
from handcal.link.statistics import LinkRates
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.widgets.layouts import hbox
from handcal_gui.widgets.plots import Plot

_LASTS_S = 30.0
_HEIGHTS_PX = 48, 200
"""Least and largest height."""
_TOPS = (5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0, 2000.0, 5000.0)
"""Allowed upper limits of the scales."""


class LinkHistory(QWidget):
    """Two plots side by side."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("link-history")
        self._moments: deque[tuple[float, float, float, float]] = deque()
        self._latency = _plot(
            "latency-history",
            tr("Latency history"),
            tr("Latency, last {:g} s").format(_LASTS_S),
            "ms",
        )
        self._latency.setToolTip(tr("Latency of the last {:g} s, in milliseconds").format(_LASTS_S))
        self._loss = _plot("loss-history", tr("Loss history"), tr("Lost: — to, - - from"), "%")
        self._loss.setToolTip(
            tr(
                "Share of the datagrams of the last {:g} s that did not arrive: to the "
                "headset (solid line) and from it (dashed)"
            ).format(_LASTS_S)
        )
        self._latency_line = self._latency.add_line("live")
        self._lost_line = self._loss.add_line("live")
        self._lost_inbound_line = self._loss.add_line("cursor", dashed=True)
        hbox(self._latency, self._loss, on=self, margins=0, spacing=SPACING_PX)
        self.setMinimumHeight(_HEIGHTS_PX[0])
        self.setMaximumHeight(_HEIGHTS_PX[1])

    def sizeHint(self) -> QSize:
        """Prefer the least height, because the numbers above come first."""
        return QSize(super().sizeHint().width(), _HEIGHTS_PX[0])

    def add(self, t_s: float, latency_ms: float | None, rates: LinkRates | None) -> None:
        """Add a point in time; unknown values leave a gap."""
        shares = (rates.lost, rates.lost_inbound) if rates else (None, None)
        lost, lost_inbound = (nan if share is None else 100.0 * share for share in shares)
        self._moments.append((t_s, nan if latency_ms is None else latency_ms, lost, lost_inbound))
        while self._moments[0][0] < t_s - _LASTS_S:
            self._moments.popleft()
        times_s, latencies_ms, losts, losts_inbound = np.array(self._moments).T
        self._latency_line.setData(times_s - t_s, latencies_ms)
        self._lost_line.setData(times_s - t_s, losts)
        self._lost_inbound_line.setData(times_s - t_s, losts_inbound)
        _scale(self._latency, latencies_ms, "ms")
        _scale(self._loss, np.concatenate([losts, losts_inbound]), "%")

    def clear(self) -> None:
        """Clear the plots."""
        self._moments.clear()
        for line in (self._latency_line, self._lost_line, self._lost_inbound_line):
            line.clear()


def _plot(name: str, label: str, x_label: str, unit: str) -> Plot:
    plot = Plot(name, label, x_label, "")
    plot.item.setXRange(-_LASTS_S, 0.0, padding=0.0)
    plot.item.getAxis("bottom").setStyle(showValues=False, tickLength=0)
    _scale(plot, np.empty(0), unit)
    return plot


def _scale(plot: Plot, values: Float64, unit: str) -> None:
    """Scale the axis from zero to above all values."""
    worst = np.max(values, where=~np.isnan(values), initial=0.0)
    top = next((top for top in _TOPS if top >= worst), _TOPS[-1])
    if plot.item.viewRange()[1][1] == top:
        return  # drawing an axis takes milliseconds
    plot.item.setYRange(0.0, top, padding=0.0)
    plot.item.getAxis("left").setTicks([[(0.0, "0"), (top, f"{top:g} {unit}")]])

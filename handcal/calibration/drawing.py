"""The projections that the headset draws with: φ of each eye, as sent and acknowledged."""

from __future__ import annotations

import time
from collections.abc import Mapping

import numpy as np

from handcal.core.display import projection_matrix
from handcal.core.types import EYES, Eye, Float64, Projection, Rig
from handcal.link.drawn import drawn_digest
from handcal.link.reliable import Delivery, Outgoing
from handcal.link.server import HeadsetServer


class Drawing:
    """Sends projections to the headset, and knows which have arrived.

    Parameters
    ----------
    rig : Rig
    link : HeadsetServer
    wearer : str
        Name or code, by which the headset keeps the projections.

    Attributes
    ----------
    shift_m : dict of eye to (3,) float64
        φ that the headset renders with; zero for the offline calibration.
    """

    def __init__(self, rig: Rig, link: HeadsetServer, wearer: str) -> None:
        self.shift_m: dict[Eye, Float64] = {eye: np.zeros(3) for eye in EYES}
        self._rig = rig
        self._link = link
        self._wearer = wearer
        self._rig_name = rig_name(rig)
        self._sent: dict[Eye, Outgoing] = {}

    @property
    def is_acked(self) -> bool:
        """True if the headset has acknowledged the newest projection of each eye."""
        return all(self.acked.values())

    @property
    def is_pending(self) -> bool:
        """True while a newest projection may still arrive."""
        return any(message.state is Delivery.PENDING for message in self._sent.values())

    @property
    def is_lost(self) -> bool:
        """True if a newest projection was given up."""
        return any(message.state is Delivery.FAILED for message in self._sent.values())

    @property
    def acked(self) -> dict[Eye, bool]:
        """True for each eye whose newest projection the headset has acknowledged."""
        return {eye: message.state is Delivery.ACKED for eye, message in self._sent.items()}

    def send(self, shifts_m: Mapping[Eye, Float64]) -> list[Outgoing]:
        """Send the projections of some eyes; `shift_m` stays as it is."""
        for eye, shift_m in shifts_m.items():
            display = self._rig.eyes[eye]
            projection = Projection(
                eye,
                projection_matrix(display, shift_m),
                display.width_px,
                display.height_px,
                display.T_V_H,
                projection_matrix(display),
                self._wearer,
                self._rig_name,
            )
            self._sent[eye] = self._link.send_projection(projection)
        return [self._sent[eye] for eye in shifts_m]

    def wait_acked(self, timeout_s: float) -> None:
        """Wait until the headset has acknowledged every projection; LinkError otherwise."""
        deadline_s = time.monotonic() + timeout_s
        for message in self._sent.values():
            self._link.wait_acked(message, max(0.0, deadline_s - time.monotonic()))


def rig_name(rig: Rig) -> str:
    """Return the rig's name in one line, with eight digits that change with its displays."""
    offline = {
        eye: Projection(eye, projection_matrix(view), view.width_px, view.height_px, view.T_V_H)
        for eye, view in rig.eyes.items()
    }
    name = "".join(character for character in rig.name if character >= " ")
    return f"{name[:80]} {drawn_digest(offline, None).hex()[:8]}"

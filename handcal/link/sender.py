"""Everything that the PC sends to be shown, and the digest of what the headset then draws."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from handcal.core.types import EYES, Eye, Projection
from handcal.link import handcal_pb2 as pb
from handcal.link import messages, nudges
from handcal.link.drawn import drawn_digest, drawn_projections
from handcal.link.endpoint import Endpoint
from handcal.link.nudges import VerifyRequest
from handcal.link.reliable import Outgoing
from handcal.link.settings import LinkSettings
from handcal.link.shapes import Shape, Target
from handcal.link.transport import Transport
from handcal.link.wire import Slot


class Sender(Endpoint):
    """The part of the PC's end that sends what the headset shows."""

    def __init__(self, transport: Transport, settings: LinkSettings) -> None:
        super().__init__(transport, settings)
        self._projections: dict[Eye, Projection] = {}
        self._cursor: pb.Cursor | None = None
        self._is_offline = False
        self._live_frame = 0

    def send_cursor(
        self, points_W_m: ArrayLike, cursor_id: int, eyes: Sequence[Eye] = EYES
    ) -> Outgoing:
        """Send the frozen hand, (N, 3) of frame W, reliably; no points remove it.

        `eyes` draw it; a headset of an older version draws it for both.

        Raises
        ------
        ValueError
            If the points are not finite, too many, or spread over more than 6.5 m.
        LinkError
            If the link is closed.
        """
        message = messages.cursor(points_W_m, cursor_id, eyes)
        with self._changed:
            outgoing = self._send_reliably(Slot.CURSOR, message)
            self._cursor = message.cursor
        return outgoing

    def send_live_hand(
        self,
        points_W_m: ArrayLike,
        is_over_limit: bool,
        eyes: Sequence[Eye] = EYES,
        is_outline: bool = False,
    ) -> None:
        """Send the live hand, (N, 3) of frame W, thinned evenly to the limit of one frame.

        `is_over_limit` means that it is rotated too far; the headset then draws it red. `eyes` draw
        it. `is_outline` means that the points are its closed outline, in order. The hand replaces
        any that has not been sent yet.

        Raises
        ------
        ValueError
            As `send_cursor`.
        LinkError
            If the link is closed.
        """
        points = np.asarray(points_W_m)
        thinned = points[:: max(1, math.ceil(len(points) / self._settings.live_points))]
        with self._changed:
            self._require_running()
            self._live_frame += 1
            self._stream.clear()
            self._stream.extend(
                messages.live_hand(thinned, is_over_limit, self._live_frame, eyes, is_outline)
            )

    def send_prompt(self, text: str, eyes: Sequence[Eye] = EYES) -> Outgoing:
        """Send a text to show and the eyes to keep open, reliably.

        Raises
        ------
        ValueError
            If the text is too long.
        LinkError
            If the link is closed.
        """
        return self._send_reliably(Slot.PROMPT, messages.prompt(text, eyes))

    def send_projection(self, projection: Projection) -> Outgoing:
        """Send an eye's projection, reliably.

        Raises
        ------
        ValueError
            If it is not finite.
        LinkError
            If the link is closed.
        """
        slot = messages.PROJECTION_SLOTS[projection.eye]
        with self._changed:
            outgoing = self._send_reliably(slot, messages.projection(projection))
            self._projections[projection.eye] = projection
        return outgoing

    def send_show(self, is_offline: bool) -> Outgoing:
        """Have the headset draw with the offline calibration, or with its projections again.

        Raises
        ------
        LinkError
            If the link is closed.
        """
        with self._changed:
            show = pb.Show(offline=is_offline)
            outgoing = self._send_reliably(Slot.SHOW, pb.Envelope(show=show))
            self._is_offline = is_offline
        return outgoing

    def send_target(self, target: Target | None) -> Outgoing:
        """Send the user test's target, reliably; None removes it.

        Raises
        ------
        ValueError
            If it is not finite.
        LinkError
            If the link is closed.
        """
        return self._send_reliably(Slot.TARGET, messages.target(target))

    def send_shape(self, shape: Shape | None) -> Outgoing:
        """Send a shape fixed in the world, reliably; None removes it.

        Raises
        ------
        ValueError
            If it is not finite.
        LinkError
            If the link is closed.
        """
        return self._send_reliably(Slot.SHAPE, messages.shape(shape))

    def send_verify(self, request: VerifyRequest | None) -> Outgoing:
        """Have the wearer move what an eye draws, reliably; None ends it.

        Raises
        ------
        LinkError
            If the link is closed.
        """
        return self._send_reliably(Slot.VERIFY, nudges.verify(request))

    def send_again(self) -> None:
        """Send the newest message of every slot again, as to a headset that has just connected.

        Raises
        ------
        LinkError
            If the link is closed.
        """
        with self._changed:
            self._require_running()
            self._outbox.restart(time.monotonic())

    def _difference(self, digest: bytes) -> str:
        """Return how a headset's drawing differs from what it was sent; empty if it does not."""
        drawn = drawn_projections(self._projections, self._is_offline)
        if digest == drawn_digest(drawn, self._cursor):
            return ""
        return "the headset draws other projections or another cursor than it was sent"

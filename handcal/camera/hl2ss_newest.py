"""The newest packets of a stream of hl2ss."""

from __future__ import annotations

import threading
import time
from collections import deque

from handcal.camera.hl2ss import Hl2ssConnection, Stream
from handcal.core.errors import CameraError, CameraTimeoutError
from handcal.io.closable import Closable

_POLL_S = 0.2
_KEPT = 4


class NewestPackets(Closable):
    """The newest packets of a stream, received by a thread of its own: older ones are dropped."""

    def __init__(self, connection: Hl2ssConnection, stream: Stream) -> None:
        self._connection = connection
        self._stream = stream
        self._packet: tuple[int, int, bytes] | None = None
        self._recent: deque[bytes] = deque(maxlen=_KEPT)
        self._error: CameraError | None = None
        self._is_closed = False
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._receive, name="hl2ss", daemon=True)
        self._thread.start()

    def take(self, name: str, timeout_s: float) -> tuple[int, int, bytes]:
        """Return number, time of arrival on the host's clock, and data of the newest packet.

        Raises
        ------
        CameraTimeoutError
            If there is no new one in time.
        CameraError
            If the stream has ended.
        """
        with self._changed:
            self._changed.wait_for(
                lambda: self._packet or self._error or self._is_closed, timeout_s
            )
            if self._is_closed:
                raise CameraError(f"{name} is closed", "open it again")
            if self._packet is not None:
                packet, self._packet = self._packet, None
                return packet
            if self._error is not None:
                raise self._error
        raise CameraTimeoutError(
            f"{name} sent no image for {timeout_s:g} s",
            "put the headset on, and keep hl2ss running",
        )

    def recent(self) -> list[bytes]:
        """Return the last few packets; CameraError if the stream has ended."""
        with self._changed:
            if self._error is not None:
                raise self._error
            return list(self._recent)

    def close(self) -> None:
        """End the stream; safe to call twice."""
        with self._changed:
            self._is_closed = True
            self._changed.notify_all()
        self._connection.close()
        self._thread.join()

    def _receive(self) -> None:
        number = 0
        while not self._is_closed:
            try:
                data = self._connection.receive_packet(self._stream, _POLL_S)
            except CameraTimeoutError:
                continue
            except CameraError as error:
                with self._changed:
                    self._error = error
                    self._changed.notify_all()
                return
            number += 1
            with self._changed:
                self._packet = number, time.monotonic_ns(), data
                self._recent.append(data)
                self._changed.notify_all()

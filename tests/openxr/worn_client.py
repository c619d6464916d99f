"""The OpenXR client in place of the virtual headset's, so that the simulated wearer can wear it.

`command` starts a virtual headset whose head and button are those of the test runtime, and whose
wearer sees what the OpenXR client was sent.
"""

from __future__ import annotations

import struct
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import handcal.cli.main
import handcal.sim.headset
from handcal.core.conventions import opengl_transform, pose
from handcal.core.types import Float64, HeadsetIdentity
from handcal.io.closable import Closable
from handcal.link.client import HeadsetClient, HeadsetState
from handcal.link.transport import Address
from handcal.openxr_client.client import run_openxr_client
from tests.helpers import ROOT

_WEARER = struct.Struct("<7d2q")
_PRESS_FRAMES = 5


def write_wearer(path: Path, T_W_H: Float64, is_pressed: bool = False, t_ns: int = 0) -> None:
    """Move the test runtime's head and button (TEST_HEAD), as of a time of the monotonic clock."""
    head = pose(opengl_transform(T_W_H))
    numbers = _WEARER.pack(*head.quaternion_xyzw, *head.position_m, is_pressed, t_ns)
    with path.open("r+b" if path.exists() else "wb") as file:
        file.write(numbers)


def command(head: Path) -> list[str]:
    """Return the command of the virtual headset, before its arguments."""
    code = f"import sys; sys.path.insert(0, {str(ROOT)!r}); "
    code += "from tests.openxr.worn_client import run; run()"
    return [sys.executable, "-c", code, str(head)]


def run() -> None:
    """Run ``handcal`` with the OpenXR client; the file for its head is the first argument."""
    head = Path(sys.argv.pop(1))

    def worn(
        server: Address,
        key: bytes,
        identity: HeadsetIdentity,
        clock_ns: Callable[[], int],
        **_: object,
    ) -> Worn:
        return Worn(head, server, key, identity, clock_ns)

    vars(handcal.sim.headset)["HeadsetClient"] = worn
    handcal.cli.main.main()


class Worn(Closable):
    """The interface of `HeadsetClient` for the wearer's side of the virtual headset."""

    def __init__(
        self,
        head: Path,
        server: Address,
        key: bytes,
        identity: HeadsetIdentity,
        clock_ns: Callable[[], int],
    ) -> None:
        self._head = head
        self._clock_ns = clock_ns
        self._link: HeadsetClient | None = None
        self._presses = 0
        self._is_closed = threading.Event()
        self.refusal = ""

        def connect(*arguments: Any) -> HeadsetClient:
            self._link = HeadsetClient(*arguments)
            return self._link

        arguments = server, key, identity.device_id, self._is_closed.is_set, connect
        self._thread = threading.Thread(target=run_openxr_client, args=arguments)
        self._thread.start()

    @property
    def connected(self) -> bool:
        return self._link is not None and self._link.connected

    @property
    def dismissed(self) -> bool:
        return self._link is not None and self._link.dismissed

    def state(self) -> HeadsetState:
        # The link is closed by the client's thread once it is dismissed.
        is_open = self._link is not None and self._thread.is_alive() and not self.dismissed
        return self._link.state() if self._link is not None and is_open else HeadsetState()

    def send_pose(self, T_W_H: Float64, t_headset_ns: int) -> None:
        self._presses = max(0, self._presses - 1)
        t_ns = t_headset_ns - (self._clock_ns() - time.monotonic_ns())
        write_wearer(self._head, T_W_H, self._presses > 0, t_ns)

    def confirm(self, *_: object) -> None:
        self._presses = _PRESS_FRAMES

    def close(self) -> None:
        """End the client; safe to call twice."""
        self._is_closed.set()
        self._thread.join()

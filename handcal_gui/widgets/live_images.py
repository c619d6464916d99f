"""Cameras of this computer, read in a thread; the newest images are polled."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Sequence
from contextlib import ExitStack

from PySide6.QtCore import QObject, Signal

from handcal.camera.viewpoint import ViewpointCamera
from handcal.core.errors import CameraTimeoutError, HandcalError
from handcal.core.types import UInt8
from handcal_gui.app.translation import tr
from handcal_gui.engine.worker import Worker

_LOG = logging.getLogger(__name__)

Images = tuple[UInt8, ...]
OpenCamera = Callable[[], ViewpointCamera]


class LiveImages(Worker):
    """Reads cameras in a thread until stopped, and keeps only the newest images.

    Parameters
    ----------
    cameras : sequence of callable
        Functions that open the cameras, called in the thread.

    Attributes
    ----------
    newest : tuple of (H, W, 3) uint8, or None
        One image of each camera, read immediately one after the other; None before the first.
    failed : Signal(str)
        Reason why a camera could not be opened or failed.
    """

    failed = Signal(str)

    def __init__(self, cameras: Sequence[OpenCamera], parent: QObject | None = None) -> None:
        super().__init__("handcal live images", parent)
        self.newest: Images | None = None
        self._cameras = tuple(cameras)
        self._stopped = threading.Event()

    def stop(self) -> None:
        """Close the cameras and wait until they are closed; pending signals are discarded."""
        self._stopped.set()
        self.wait()
        self._discard_pending()

    def _run(self) -> None:
        try:
            with ExitStack() as stack:
                cameras = [stack.enter_context(open_one()) for open_one in self._cameras]
                while not self._stopped.is_set():
                    try:
                        self.newest = tuple(camera.read()[0] for camera in cameras)
                    except CameraTimeoutError:
                        continue
        except HandcalError as error:
            self._emit_later(self.failed.emit, str(error))
        except Exception as error:
            _LOG.exception("unexpected error in live images")
            self._emit_later(
                self.failed.emit,
                tr("handcal hit an unexpected error ({}: {})").format(type(error).__name__, error),
            )

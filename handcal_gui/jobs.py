"""Work that takes longer than a frame: in a thread of its own, with progress and cancel."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable

from PySide6.QtCore import QObject, Signal

from handcal.errors import CancelledError, HandcalError

_LOG = logging.getLogger(__name__)

Report = Callable[[str, float], None]
IsCancelled = Callable[[], bool]
Work = Callable[[Report, IsCancelled], object]


class Job(QObject):
    """Calls `work` once, in a thread.

    Parameters
    ----------
    work : callable
        Given `report`, to be told what is going on and which share is done, and `is_cancelled`, to
        be asked often; raises CancelledError when it stops early.

    Attributes
    ----------
    progressed : Signal(str, float)
    succeeded : Signal(object)
        What `work` returned.
    failed : Signal(str)
        Why, for a person to read.
    cancelled : Signal()
    """

    progressed = Signal(str, float)
    succeeded = Signal(object)
    failed = Signal(str)
    cancelled = Signal()

    def __init__(self, work: Work, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._work = work
        self._cancelled = threading.Event()
        self._thread = threading.Thread(target=self._run, name="handcal job")

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def cancel(self) -> None:
        """Ask the work to stop; it says so by `cancelled`."""
        self._cancelled.set()

    def wait(self) -> None:
        """Wait for the end; cancel first unless the work is short."""
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        try:
            done = self._work(self.progressed.emit, self._cancelled.is_set)
        except CancelledError:
            self.cancelled.emit()
        except HandcalError as error:
            self.failed.emit(str(error))
        except Exception as error:
            _LOG.exception("a job broke down")
            self.failed.emit(f"handcal broke down ({type(error).__name__}: {error})")
        else:
            self.succeeded.emit(done)

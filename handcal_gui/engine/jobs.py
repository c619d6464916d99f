"""Work that takes longer than a frame: in a thread of its own, with progress and cancel."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable

from PySide6.QtCore import Signal

from handcal.errors import CancelledError, HandcalError
from handcal.progress import Progress
from handcal_gui.engine.worker import Worker

_LOG = logging.getLogger(__name__)
_STEPS = 1000

Report = Callable[[str, float], object]
IsCancelled = Callable[[], bool]
Work = Callable[[Progress], object]


class Job(Worker):
    """Calls `work` once, in a thread.

    Parameters
    ----------
    work : callable
        Given the job's progress, to report to often; raises CancelledError if it was cancelled.

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

    def __init__(self, work: Work) -> None:
        # Without a parent: it lives as long as its thread or whoever waits for it, and no longer.
        super().__init__("handcal job")
        self._work = work
        self._cancelled = threading.Event()
        self._reported = "", -1

    def cancel(self) -> None:
        """Ask the work to stop; it says so by `cancelled`, unless it comes to its end first."""
        self._cancelled.set()

    def abandon(self) -> None:
        """Have the work stop, and wait for it; nothing more is heard of it."""
        self.cancel()
        self.wait()
        self._discard_pending()

    def _run(self) -> None:
        try:
            done = self._work(Progress(self._report, self._cancelled.is_set))
        except CancelledError:
            self._emit_later(self.cancelled.emit)
        except HandcalError as error:
            self._emit_later(self.failed.emit, str(error))
        except Exception as error:
            _LOG.exception("a job broke down")
            self._emit_later(
                self.failed.emit, f"handcal broke down ({type(error).__name__}: {error})"
            )
        else:
            self._emit_later(self.succeeded.emit, done)

    def _report(self, doing: str, share: float) -> None:
        """Emit the progress if it has changed visibly, as signals from a thread queue up."""
        if self._reported != (doing, int(_STEPS * share)):
            self._reported = doing, int(_STEPS * share)
            self._emit_later(self.progressed.emit, doing, share)

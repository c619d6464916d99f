"""Jobs: work that takes longer than a frame, in a thread, with progress and cancellation."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable

from PySide6.QtCore import Signal

from handcal.core.errors import CancelledError, HandcalError
from handcal.core.progress import Progress
from handcal_gui.app.translation import tr
from handcal_gui.engine.worker import Worker

_LOG = logging.getLogger(__name__)
_STEPS = 1000

Work = Callable[[Progress], object]


class Job(Worker):
    """Calls a function once in a thread.

    Parameters
    ----------
    work : callable
        Given the job's progress, to report to often; raises CancelledError if it was cancelled.

    Attributes
    ----------
    progressed : Signal(str, float)
    succeeded : Signal(object)
        The value that `work` returned.
    failed : Signal(str)
        The reason, as a message for the user.
    cancelled : Signal()
    """

    progressed = Signal(str, float)
    succeeded = Signal(object)
    failed = Signal(str)
    cancelled = Signal()

    def __init__(self, work: Work) -> None:
        # Without a parent: it lives as long as its thread or its owner needs it.
        super().__init__("handcal job")
        self._work = work
        self._cancelled = threading.Event()
        self._reported = "", -1

    def cancel(self) -> None:
        """Ask the work to stop; `cancelled` is emitted unless it finishes first."""
        self._cancelled.set()

    def abandon(self) -> None:
        """Cancel the work, wait for its end, and discard its signals."""
        self.cancel()
        self.wait()
        self._discard_pending()

    def _run(self) -> None:
        try:
            result = self._work(Progress(self._report, self._cancelled.is_set))
        except CancelledError:
            self._emit_later(self.cancelled.emit)
        except HandcalError as error:
            self._emit_later(self.failed.emit, str(error))
        except Exception as error:
            _LOG.exception("a job failed unexpectedly")
            described = f"{type(error).__name__}: {error}"
            self._emit_later(
                self.failed.emit, tr("handcal hit an unexpected error ({})").format(described)
            )
        else:
            self._emit_later(self.succeeded.emit, result)

    def _report(self, activity: str, share: float) -> None:
        """Emit the progress if it has changed visibly, as signals from a thread queue up."""
        if self._reported != (activity, int(_STEPS * share)):
            self._reported = activity, int(_STEPS * share)
            self._emit_later(self.progressed.emit, activity, share)

"""Base class of objects that run in a thread and emit their signals in the window's thread."""

from __future__ import annotations

import threading
from collections.abc import Callable

from PySide6.QtCore import QCoreApplication, QEvent, QObject, Signal


class Worker(QObject):
    """Base class of objects that run once in a thread and report by signals.

    Signals wait in the window's event loop, like all signals from other threads. Once the thread
    has ended, pending signals can be delivered immediately or discarded, so that none arrives
    unexpectedly.

    Parameters
    ----------
    name : str
        Name of the thread.
    parent : QObject, optional
    """

    _posted = Signal(object)

    def __init__(self, name: str, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._posted.connect(self._deliver)
        self._thread = threading.Thread(target=self._run, name=name)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def wait(self) -> None:
        """Wait until the thread has ended."""
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        """Do the work; called in the thread."""
        raise NotImplementedError

    def _emit_later(self, emit: Callable[..., None], *args: object) -> None:
        """Emit a signal later, in the window's thread."""
        self._posted.emit((emit, args))

    def _deliver_pending(self) -> None:
        """Emit pending signals now."""
        QCoreApplication.sendPostedEvents(self, QEvent.Type.MetaCall.value)

    def _discard_pending(self) -> None:
        """Discard pending signals."""
        QCoreApplication.removePostedEvents(self, QEvent.Type.MetaCall.value)

    def _deliver(self, posted: tuple[Callable[..., None], tuple[object, ...]]) -> None:
        emit, args = posted
        emit(*args)

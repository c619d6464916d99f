"""What works in a thread of its own, and is heard in the window's."""

from __future__ import annotations

import threading
from collections.abc import Callable

from PySide6.QtCore import QCoreApplication, QEvent, QObject, Signal


class Worker(QObject):
    """Base of objects that run once, in a thread, and say by their signals how it goes.

    What is said waits in the window's event loop, like every signal from another thread; but once
    the thread has ended, it can be heard at once or forgotten, lest it come when nobody expects it.

    Parameters
    ----------
    name : str
        Of the thread.
    parent : QObject, optional
    """

    _posted = Signal(object)

    def __init__(self, name: str, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._posted.connect(self._deliver)
        self._thread = threading.Thread(target=self._run, name=name)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def wait(self) -> None:
        """Wait for the thread's end."""
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        """Do the work, in the thread."""
        raise NotImplementedError

    def _emit_later(self, emit: Callable[..., None], *what: object) -> None:
        """Have a signal emitted in the window's thread."""
        self._posted.emit((emit, what))

    def _deliver_pending(self) -> None:
        """Emit at once what waits to be."""
        QCoreApplication.sendPostedEvents(self, QEvent.Type.MetaCall.value)

    def _discard_pending(self) -> None:
        """Never emit what waits to be."""
        QCoreApplication.removePostedEvents(self, QEvent.Type.MetaCall.value)

    def _deliver(self, said: tuple[Callable[..., None], tuple[object, ...]]) -> None:
        emit, what = said
        emit(*what)

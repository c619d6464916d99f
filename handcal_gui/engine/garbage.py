"""Collection of unreachable Python objects, in the window's thread only."""

from __future__ import annotations

import gc

from PySide6.QtCore import QObject, QThread, QTimer

_PERIOD_MS = 1000


def collect_in_this_thread(parent: QObject) -> None:
    """Replace Python's own collection, which runs in any thread, by one in the window's thread.

    The parts of a closed window refer to each other, so that only a collection frees them. In the
    thread of a job it would do so while the window's thread uses Qt, which can crash.

    Parameters
    ----------
    parent : QObject
        Ends the collection when it is deleted.
    """
    gc.disable()
    timer = QTimer(parent, interval=_PERIOD_MS)
    timer.timeout.connect(_collect)
    timer.start()


def _collect() -> None:
    """Collect what Python would collect now, unless Qt waits for a dialog within an event."""
    counts, limits = gc.get_count(), gc.get_threshold()
    due = [age for age, count in enumerate(counts) if count > limits[age]]
    if due and QThread.currentThread().loopLevel() == 1:
        gc.collect(due[-1])

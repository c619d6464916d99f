"""Unreachable Qt objects are freed in the window's thread, whichever thread makes objects."""

from __future__ import annotations

import gc
import threading
import weakref
from collections.abc import Iterator

import pytest
from PySide6.QtCore import QObject
from pytestqt.qtbot import QtBot

from handcal_gui.engine import garbage


class _Loop(QObject):
    def __init__(self) -> None:
        super().__init__()
        self.itself = self


@pytest.fixture(autouse=True)
def _often(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(garbage, "_PERIOD_MS", 1)
    limits = gc.get_threshold()
    yield
    gc.set_threshold(*limits)


def test_a_thread_that_makes_objects_frees_none_of_qt(qtbot: QtBot) -> None:
    freed: list[threading.Thread] = []
    owner = QObject()
    gc.enable()  # as it is before
    garbage.collect_in_this_thread(owner)
    weakref.finalize(_Loop(), lambda: freed.append(threading.current_thread()))
    thread = threading.Thread(target=lambda: [[number] for number in range(100_000)])
    thread.start()
    thread.join()
    assert not freed
    gc.set_threshold(1, 1, 1)
    qtbot.waitUntil(lambda: bool(freed))
    assert freed == [threading.main_thread()]
    owner.deleteLater()

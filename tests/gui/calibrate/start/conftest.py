"""A start page whose equipment is simulated, and its widgets."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import pytest
from PySide6.QtWidgets import (
    QComboBox,
    QLabel,
    QPushButton,
    QWidget,
)
from pytestqt.qtbot import QtBot

from handcal.core.progress import Progress
from handcal.station.checks.doctor import Finding, Health
from handcal.station.checks.preflight import PARTS, Part
from handcal.station.settings import StationSettings
from handcal_gui.app.preferences import Preferences
from handcal_gui.calibrate.start.session_entries import KnownSessions
from handcal_gui.calibrate.start.start_page import StartPage

KEY = "0123456789abcdef0123456789abcdef"
NETWORK = {"headset": "network"}


class Inspector:
    """Stands in for the checks: says of each part what a test wants."""

    def __init__(self) -> None:
        self.healths: dict[Part, Health] = dict.fromkeys(PARTS, Health.GOOD)
        self.asked: list[tuple[StationSettings, str]] = []
        self.threads: set[threading.Thread] = set()
        self.offers = KnownSessions((), ())
        self.folders: list[Path] = []
        self.progress = Progress()

    def check(
        self, settings: StationSettings, pairing_key: str, progress: Progress
    ) -> Mapping[Part, Finding]:
        self.progress = progress
        self.asked.append((settings, pairing_key))
        self.threads.add(threading.current_thread())
        return {
            part: Finding(PARTS[part], health, f"found {settings.source}", "do this")
            for part, health in self.healths.items()
        }

    def find(self, folder: Path, recent: Sequence[Path]) -> KnownSessions:
        self.folders.append(folder)
        return self.offers


@pytest.fixture
def inspector() -> Inspector:
    return Inspector()


@pytest.fixture
def open_page(
    qtbot: QtBot, inspector: Inspector, tmp_path: Path
) -> Iterator[Callable[..., StartPage]]:
    pages: list[StartPage] = []

    def open_page(preferences: Preferences | None = None, **station: object) -> StartPage:
        settings = replace(StationSettings(sessions=str(tmp_path)), **station)  # type: ignore[arg-type]
        preferences = replace(preferences or Preferences(), station=settings)
        page = StartPage(preferences, KEY, inspector.check, inspector.find)
        pages.append(page)
        qtbot.addWidget(page)
        page.show()
        qtbot.waitUntil(lambda: bool(inspector.asked and text(page, "cameraFound")))
        return page

    yield open_page
    for page in pages:
        page.stop()


Kind = TypeVar("Kind", bound=QWidget)


def find(page: QWidget, kind: type[Kind], name: str = "") -> Kind:
    found = page.findChild(kind, name) if name else page.findChild(kind)
    assert isinstance(found, kind)
    return found


def button(page: QWidget, name: str) -> QPushButton:
    return find(page, QPushButton, name)


def text(page: QWidget, name: str) -> str:
    return find(page, QLabel, name).text()


def choose(page: QWidget, name: str, option: str) -> None:
    field = find(page, QComboBox, name)
    field.setCurrentIndex(field.findData(option))


def wearer(page: QWidget) -> QComboBox:
    return find(page, QComboBox, "wearer")

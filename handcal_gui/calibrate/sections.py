"""The panels beside the page: each below a line with its title, which opens or folds it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields
from typing import Protocol

from PySide6.QtCore import QEvent, Qt, Signal
from PySide6.QtGui import QCloseEvent, QKeyEvent
from PySide6.QtWidgets import (
    QApplication,
    QSizePolicy,
    QStackedWidget,
    QTabWidget,
    QToolButton,
    QWidget,
)

from handcal.calibration.states import State
from handcal.station.snapshot import Snapshot
from handcal_gui.app.keys import native
from handcal_gui.app.theme import SPACING_PX, follow_theme, icon
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.camera.panel import CameraPanel
from handcal_gui.calibrate.cloud.panel import CloudPanel
from handcal_gui.calibrate.fine_tune.panel import FineTunePanel
from handcal_gui.calibrate.results.panel import ResultsPanel
from handcal_gui.calibrate.rotation.panel import RotationPanel
from handcal_gui.calibrate.session.panel import SessionPanel
from handcal_gui.calibrate.trials.panel import TrialsPanel
from handcal_gui.calibrate.wearer_view.panel import WearerViewPanel
from handcal_gui.connect.link_panel import LinkPanel
from handcal_gui.widgets.layouts import hbox, vbox

TITLES = {
    "camera": tr("Camera"),
    "cloud": tr("Hand cloud"),
    "wearer_view": tr("Wearer's view"),
    "rotation": tr("Rotation"),
    "results": tr("Results"),
    "fine_tune": tr("Fine-tune"),
    "trials": tr("Trials"),
    "session": tr("Session"),
    "link": tr("Link"),
}
"""Of the panels, in the order of their keys, Ctrl+1 and so on."""
LEFT, RIGHT = ("camera", "cloud", "rotation"), ("results", "fine_tune")
TABS = ("wearer_view", "trials", "session", "link")
"""Panels in sections on either side of the page, and in tabs below the right ones."""


class Panel(Protocol):
    """The interface of every panel."""

    def show_snapshot(self, snapshot: Snapshot) -> None:
        """Show the panel's part of a snapshot."""

    def isVisible(self) -> bool:
        """Return whether it is on the screen."""
        ...


@dataclass(frozen=True, slots=True)
class Panels:
    """All panels of the window."""

    camera: CameraPanel
    cloud: CloudPanel
    wearer_view: WearerViewPanel
    rotation: RotationPanel
    results: ResultsPanel
    fine_tune: FineTunePanel
    trials: TrialsPanel
    session: SessionPanel
    link: LinkPanel

    def all(self) -> Iterator[Panel]:
        """Return an iterator over all panels."""
        return (getattr(self, field.name) for field in fields(self))


def with_content(snapshot: Snapshot) -> Mapping[str, bool]:
    """Return whether each section has something to show."""
    procedure, has_frame = snapshot.procedure, snapshot.frame is not None
    is_solved = procedure.results is not None
    return {
        "camera": has_frame,
        "cloud": has_frame,
        "rotation": procedure.cursor is not None,
        "results": is_solved,
        "fine_tune": is_solved and procedure.state is State.APPLIED,
    }


class Section(QWidget):
    """A panel below its title; it can also be a window of its own.

    Attributes
    ----------
    asked : Signal(bool)
        The user opens or folds it.
    """

    asked = Signal(bool)

    def __init__(self, name: str, panel: QWidget) -> None:
        super().__init__()
        title = TITLES[name]
        self.setObjectName(f"{name}Section")
        self.setWindowTitle(title)
        self.setProperty("panel", title)
        self._panel = panel
        self._title = _title_button()
        self._title.setText(title)
        self._title.setObjectName(f"{name}Title")
        self._title.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        self._title.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        keys = native(f"Ctrl+{list(TITLES).index(name) + 1}")
        self._title.setToolTip(tr("Open or fold {} ({})").format(title, keys))
        self._title.clicked.connect(self.asked)
        self._apart = _title_button()
        self._apart.setToolTip(tr("In a window of its own, or back beside the guide"))
        self._apart.setAccessibleName(tr("{} in a window of its own").format(title))
        self._apart.clicked.connect(self.set_apart)
        follow_theme(self, lambda: self._apart.setIcon(icon("float")))
        vbox(hbox((self._title, 1), self._apart), (panel, 1), on=self, margins=0, spacing=0)
        self.set_open(False)

    @property
    def is_open(self) -> bool:
        """True if the panel is shown below the title."""
        return self._title.isChecked()

    def set_open(self, is_open: bool) -> None:
        """Open or fold it."""
        self._title.setChecked(is_open)
        arrow = Qt.ArrowType.DownArrow if is_open else Qt.ArrowType.RightArrow
        self._title.setArrowType(arrow)
        self._panel.setVisible(is_open)
        vertical = QSizePolicy.Policy.Expanding if is_open else QSizePolicy.Policy.Maximum
        self.setSizePolicy(QSizePolicy.Policy.Preferred, vertical)

    def set_apart(self, is_apart: bool) -> None:
        """Make it a window of its own, or bring it back."""
        if is_apart:
            self.set_open(True)
        self._apart.setChecked(is_apart)
        # The kind of window in which the keys of its main window work, too, such as the space bar.
        self.setWindowFlag(Qt.WindowType.Tool, is_apart)
        self.show()
        self.asked.emit(self.is_open)

    def event(self, event: QEvent) -> bool:
        """Give keys that the panel does not take to the main window, as if it was still in it."""
        owner = self.parentWidget()
        if self.isWindow() and owner is not None and isinstance(event, QKeyEvent):
            return QApplication.sendEvent(owner.window(), event)
        return super().event(event)

    def closeEvent(self, event: QCloseEvent) -> None:
        """Bring the panel back instead."""
        event.ignore()
        self.set_apart(False)


def _title_button() -> QToolButton:
    made = QToolButton()
    made.setAutoRaise(True)
    made.setCheckable(True)
    return made


class Tabs(QTabWidget):
    """Panels in tabs; a click on the tab in front folds them, on any other tab opens them.

    Attributes
    ----------
    asked : Signal(bool)
        The user opens or folds them.
    """

    asked = Signal(bool)

    def __init__(self, panels: Mapping[str, QWidget]) -> None:
        super().__init__()
        self.setObjectName("tabs")
        self.setDocumentMode(True)
        self._names = list(panels)
        self._is_open = False
        for name, panel in panels.items():
            page = QWidget()
            page.setProperty("panel", TITLES[name])
            vbox(panel, on=page, margins=0)
            self.addTab(page, TITLES[name])
            keys = native(f"Ctrl+{list(TITLES).index(name) + 1}")
            self.setTabToolTip(self.count() - 1, f"{TITLES[name]} ({keys})")
        self.tabBarClicked.connect(self._on_clicked)
        self.set_open(False)

    @property
    def is_open(self) -> bool:
        """True if the tab in front is shown."""
        return self._is_open

    def set_open(self, is_open: bool) -> None:
        """Open or fold them."""
        self._is_open = is_open
        pages = self.findChild(QStackedWidget)
        assert pages is not None
        pages.setVisible(is_open)
        self.setMaximumHeight(16_777_215 if is_open else self.tabBar().sizeHint().height())
        self.setMinimumWidth(self.tabBar().sizeHint().width())  # all titles are in sight

    def show_panel(self, name: str) -> None:
        """Bring a tab to the front."""
        self.setCurrentIndex(self._names.index(name))

    def offer(self, names: Iterable[str]) -> None:
        """Offer only the tabs of some panels."""
        offered = set(names)
        for i, name in enumerate(self._names):
            self.setTabVisible(i, name in offered)

    def _on_clicked(self, index: int) -> None:
        if index >= 0:
            self.asked.emit(not self._is_open or index != self.currentIndex())


def column(*parts: QWidget) -> QWidget:
    """Return sections below one another."""
    made = QWidget()
    vbox(*parts, 0, on=made, margins=(0, SPACING_PX // 2, 0, 0), spacing=SPACING_PX // 4)
    return made


def share_height(made: QWidget, parts: Iterable[Section | Tabs]) -> None:
    """Give the height of a column to its open parts, or to the space below folded ones."""
    layout = made.layout()
    assert layout is not None
    for part in parts:
        layout.setStretchFactor(part, int(part.is_open))  # type: ignore[attr-defined]

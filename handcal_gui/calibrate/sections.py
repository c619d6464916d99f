"""The panels beside the page: each below a line with its title, which opens or folds it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Literal, Protocol

from PySide6.QtCore import QEvent, Qt
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


class Panel(Protocol):
    """The interface of every panel."""

    def show_snapshot(self, snapshot: Snapshot) -> None:
        """Show the panel's part of a snapshot."""

    def isVisible(self) -> bool:
        """Return whether it is on the screen."""
        ...


@dataclass(frozen=True, slots=True)
class Place:
    """The place of a panel in the window, and the snapshots that it is given."""

    title: str
    side: Literal["left", "right", "tabs"]
    """Sections on either side of the page, and tabs below the right ones."""
    has_content: Callable[[Snapshot], bool] = lambda _: False
    """Returns True if there is something to show, which opens its section."""
    is_of_stored: bool = False
    """True if it shows stored sessions, too."""
    shown: Literal["while visible", "always", "in turn"] = "while visible"
    """Always if it may be used before the next one, or has a history; in turn with others if it is
    slow to paint."""


def _at(*place: Any, **more: Any) -> dict[str, Place]:
    """Return the place of a panel as its field holds it."""
    return {"place": Place(*place, **more)}


def _has_frame(snapshot: Snapshot) -> bool:
    return snapshot.frame is not None


def _has_results(snapshot: Snapshot) -> bool:
    return snapshot.procedure.results is not None


def _has_cursor(snapshot: Snapshot) -> bool:
    return snapshot.procedure.cursor is not None


def _is_applied(snapshot: Snapshot) -> bool:
    return _has_results(snapshot) and snapshot.procedure.state is State.APPLIED


@dataclass(frozen=True, slots=True)
class Panels:
    """All panels of the window, in the order of their keys, Ctrl+1 and so on.

    A panel is added here, and nowhere else in the window.
    """

    camera: CameraPanel = field(
        default_factory=CameraPanel, metadata=_at(tr("Camera"), "left", _has_frame)
    )
    cloud: CloudPanel = field(
        default_factory=CloudPanel,
        metadata=_at(tr("Hand cloud"), "left", _has_frame, is_of_stored=True, shown="in turn"),
    )
    wearer_view: WearerViewPanel = field(
        default_factory=WearerViewPanel, metadata=_at(tr("Wearer's view"), "tabs", shown="in turn")
    )
    rotation: RotationPanel = field(
        default_factory=RotationPanel, metadata=_at(tr("Rotation"), "left", _has_cursor)
    )
    results: ResultsPanel = field(
        default_factory=ResultsPanel,
        metadata=_at(tr("Results"), "right", _has_results, is_of_stored=True),
    )
    fine_tune: FineTunePanel = field(
        default_factory=FineTunePanel,
        metadata=_at(tr("Fine-tune"), "right", _is_applied, shown="always"),
    )
    trials: TrialsPanel = field(
        default_factory=TrialsPanel,
        metadata=_at(tr("Trials"), "tabs", is_of_stored=True, shown="always"),
    )
    session: SessionPanel = field(
        default_factory=SessionPanel, metadata=_at(tr("Session"), "tabs", is_of_stored=True)
    )
    link: LinkPanel = field(
        default_factory=LinkPanel, metadata=_at(tr("Link"), "tabs", shown="always")
    )

    def all(self) -> Iterator[Panel]:
        """Return an iterator over all panels."""
        return (getattr(self, name) for name in PLACES)

    def shown(self, when: Literal["always", "in turn"]) -> list[Panel]:
        """Return the panels that are given snapshots always, or in turn."""
        return [getattr(self, name) for name, place in PLACES.items() if place.shown == when]


PLACES: dict[str, Place] = {one.name: one.metadata["place"] for one in fields(Panels)}
TITLES = {name: place.title for name, place in PLACES.items()}
LEFT, RIGHT, TABS = (
    tuple(name for name, place in PLACES.items() if place.side == side)
    for side in ("left", "right", "tabs")
)


class Section(QWidget):
    """A panel below its title; it can also be a window of its own.

    Parameters
    ----------
    name : str
    panel : QWidget
    choose : callable
        Called when the user opens or folds it.
    """

    def __init__(self, name: str, panel: QWidget, choose: Callable[[bool], object]) -> None:
        super().__init__()
        title = TITLES[name]
        self.setObjectName(f"{name}Section")
        self.setWindowTitle(title)
        self.setProperty("panel", title)
        self._panel, self._choose = panel, choose
        self._title = _title_button()
        self._title.setText(title)
        self._title.setObjectName(f"{name}Title")
        self._title.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        self._title.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        keys = native(f"Ctrl+{list(TITLES).index(name) + 1}")
        self._title.setToolTip(tr("Open or fold {} ({})").format(title, keys))
        self._title.clicked.connect(lambda: choose(self.is_open))
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
        self._choose(self.is_open)

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

    Parameters
    ----------
    panels : mapping of str to QWidget
    choose : callable
        Called when the user opens or folds them.
    """

    def __init__(self, panels: Mapping[str, QWidget], choose: Callable[[bool], object]) -> None:
        super().__init__()
        self._choose = choose
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
            self._choose(not self._is_open or index != self.currentIndex())


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

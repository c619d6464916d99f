"""Live images of chosen cameras, recordings or videos."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path

from PySide6.QtCore import QTimer, Signal
from PySide6.QtWidgets import QGridLayout, QHBoxLayout, QWidget

from handcal.camera.playback import PlaybackSettings
from handcal.camera.settings import RealSenseSettings
from handcal.camera.view_source import REALSENSE, open_view_source
from handcal.camera.viewpoint import ViewpointCamera
from handcal.core.types import CameraIdentity, Frame, UInt8
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.widgets.fields import choice, label_for
from handcal_gui.widgets.image_view import ImageView
from handcal_gui.widgets.live_images import Images, LiveImages
from handcal_gui.widgets.path_field import PathField

_RECORDED = "recorded"
_SOURCES = {REALSENSE: tr("RealSense, colour"), _RECORDED: tr("Recording or video")}
_PLAYBACK = PlaybackSettings(real_time=True, loop=True)
_POLL_MS = 15


class LiveCameras(QWidget):
    """Offers a choice for each camera, and shows simultaneous images of all of them.

    Below the image of a camera with depth stand its model and serial number.

    Parameters
    ----------
    titles : sequence of str
        Name of each camera.
    realsense : RealSenseSettings, optional
    tell : callable
        Called in another thread with a camera's title, first frame and identity, if the camera also
        has depth.
    open_source : callable
        Like `open_view_source`.

    Attributes
    ----------
    images : tuple of (H, W, 3) uint8, or None
        The present images; None while no camera is shown.
    are_stored : bool
        True if the images shown are those of a recording or video, which does not wait.
    images_changed : Signal()
    chosen_changed : Signal()
    failed : Signal(str)
        Reason why no camera is shown.
    """

    images_changed = Signal()
    chosen_changed = Signal()
    failed = Signal(str)

    def __init__(
        self,
        titles: Sequence[str],
        realsense: RealSenseSettings | None = None,
        tell: Callable[[str, Frame, CameraIdentity], object] = lambda *_: None,
        open_source: Callable[..., ViewpointCamera] = open_view_source,
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self.setObjectName("liveCameras")
        self.images: Images | None = None
        self.are_stored = False
        self._realsense, self._tell, self._open_source = realsense, tell, open_source
        self._live: LiveImages | None = None
        self._opened: dict[str, str] = {}
        self._devices: dict[str, str] = {}  # by title, as the cameras themselves say
        self._wanted: dict[str, str] = {}
        self._warp: Callable[[UInt8], UInt8] | None = None
        self._sources = {title: choice("source", title, _SOURCES) for title in titles}
        self._recorded = {
            title: PathField(
                tr("Recording or video, {}").format(title.lower()),
                "either",
                empty=tr("No recording or video"),
            )
            for title in titles
        }
        self._views = {title: ImageView(title) for title in titles}
        self._timer = QTimer(self, interval=_POLL_MS)
        self._timer.timeout.connect(self._poll)
        for title in titles:
            self._sources[title].currentIndexChanged.connect(self._follow_choice)
            self._recorded[title].changed.connect(self._follow_choice)
        self._lay_out()
        self._refresh()
        self._show_message(tr("The camera's image will be shown here."))

    def add_cameras(self, numbers: Iterable[int]) -> None:
        """Add cameras of this computer to the choices, by their numbers."""
        for place, source in enumerate(self._sources.values()):
            for number in sorted(numbers, reverse=True):
                source.insertItem(0, tr("Camera {}").format(number), str(number))
            if self._live is None:
                source.setCurrentIndex(place)
        if self._live is None:
            self.choose(self._wanted)

    def choose(self, chosen: Mapping[str, str]) -> None:
        """Choose by title, as `chosen` returns them, cameras and recordings that exist.

        Those of cameras that are added later are chosen then.
        """
        self._wanted = dict(chosen)
        for title, source in chosen.items():
            choices = self._sources.get(title)
            if choices is None or not source:
                continue
            if choices.findData(source) >= 0:
                choices.setCurrentIndex(choices.findData(source))
            elif Path(source).exists():
                choices.setCurrentIndex(choices.findData(_RECORDED))
                self._recorded[title].set_path(source)

    def start(self) -> None:
        """Show images of the chosen cameras."""
        self.stop()
        sources = self._opened = self.chosen
        self._devices.clear()
        if need := self.need:
            self.failed.emit(need)
            return
        self.are_stored = any(one.currentData() == _RECORDED for one in self._sources.values())
        self._live = LiveImages(
            [
                partial(
                    self._open_source,
                    *(source, self._realsense, _PLAYBACK, partial(self._tell_device, title)),
                )
                for title, source in sources.items()
            ]
        )
        self._live.failed.connect(self._fail)
        self._live.start()
        self._timer.start()
        self._show_message(tr("Opening the camera…"))

    def stop(self) -> None:
        """Close the cameras; safe to call twice."""
        self._timer.stop()
        if self._live is not None:
            self._live.stop()
            self._live = None
        self.images, self.are_stored = None, False
        self._show_message(tr("No image"))
        self.images_changed.emit()

    def show_through(self, warp: Callable[[UInt8], UInt8] | None) -> None:
        """Show all images warped; `images` are not."""
        self._warp = warp

    def show_only_images(self, is_only: bool) -> None:
        """Hide or show the choices of cameras."""
        for field in (*self._sources.values(), *self._recorded.values(), *self._labels):
            field.setVisible(not is_only)

    @property
    def chosen(self) -> dict[str, str]:
        """The source of each camera for `open_view_source`, by title; empty if none is chosen."""
        return {title: self._source(title) for title in self._sources}

    @property
    def need(self) -> str:
        """Advice on the choice that is missing before images can be shown; empty if none is."""
        for title, source in self.chosen.items():
            if not source:
                return tr("choose the recording or video of the {}").format(title.lower())
        if len(set(self.chosen.values())) < len(self._sources):
            return tr("both are the same camera: choose another for one of them")
        return ""

    def _follow_choice(self) -> None:
        """Stop once another camera is chosen than the one shown."""
        self._refresh()
        if self._live is not None and self.chosen != self._opened:
            self.stop()
        self.chosen_changed.emit()

    def _source(self, title: str) -> str:
        """Return a camera's source for `open_view_source`; empty if no recording is chosen."""
        chosen = str(self._sources[title].currentData())
        return self._recorded[title].path if chosen == _RECORDED else chosen

    def _poll(self) -> None:
        newest = self._live.newest if self._live is not None else None
        if newest is None or newest is self.images:
            return
        self.images = newest
        for (title, shown), image in zip(self._views.items(), newest, strict=True):
            shown.show_text(caption=self._devices.get(title, ""))
            shown.show_image(image if self._warp is None else self._warp(image))
        self.images_changed.emit()

    def _tell_device(self, title: str, frame: Frame, identity: CameraIdentity) -> None:
        """Note which of several cameras it is, to show it, and tell it on; in another thread."""
        parts = identity.model, identity.serial_number
        self._devices[title] = ", ".join(part for part in parts if part)
        self._tell(title, frame, identity)

    def _fail(self, why: str) -> None:
        self.stop()
        self.failed.emit(why)

    def _show_message(self, message: str) -> None:
        for shown in self._views.values():
            shown.show_text(message=message)

    def _refresh(self) -> None:
        for title, field in self._recorded.items():
            field.setEnabled(self._sources[title].currentData() == _RECORDED)

    def _lay_out(self) -> None:
        grid = QGridLayout(self)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setSpacing(SPACING_PX)
        self._labels = [label_for(source, f"&{title}") for title, source in self._sources.items()]
        for column, (title, source) in enumerate(self._sources.items()):
            row = QHBoxLayout()
            row.setSpacing(SPACING_PX)
            row.addWidget(self._labels[column])
            row.addWidget(source, 1)
            grid.addLayout(row, 0, column)
            grid.addWidget(self._recorded[title], 1, column)
            grid.addWidget(self._views[title], 2, column)
            self._views[title].setMinimumSize(56 * SPACING_PX, 24 * SPACING_PX)
        grid.setRowStretch(2, 1)
        grid.setHorizontalSpacing(3 * SPACING_PX)

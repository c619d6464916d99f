"""A dialog for taking images with cameras of this computer, or from recordings and videos."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QLabel, QWidget

from handcal.camera.settings import RealSenseSettings
from handcal.camera.take_board import are_kept, keep_imager, keep_images, see_board
from handcal.camera.view_source import open_view_source
from handcal.camera.viewpoint import ViewpointCamera, list_viewpoints
from handcal.core.progress import Progress
from handcal.rig.boards.board import Board, BoardView
from handcal.rig.boards.choose import ChooseSettings, ViewSelector, variety
from handcal.rig.boards.views import ASKED_VIEWS, BoardImage, board_image, coverage
from handcal.station.checks.doctor import Finding, Health
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.rig.maps import HEAD_PX, CoverageMap
from handcal_gui.widgets.fields import paragraph, with_name
from handcal_gui.widgets.layouts import hbox, vbox
from handcal_gui.widgets.live_cameras import LiveCameras
from handcal_gui.widgets.live_images import Images
from handcal_gui.widgets.sentence import sentence
from handcal_gui.widgets.taking import TakingDialog

_TAKEN = tr("this has been taken already")

_MAP_PX = 12 * SPACING_PX
"""Height of a map: the images need the room, and the digits remain legible."""


class TakeDialog(TakingDialog):
    """Shows live images of one or two cameras, and takes images with all of them at once.

    Parameters
    ----------
    folders : mapping of str to Path
        Name of each camera and the folder for its images; existing images are kept.
    board : Board
        Board to search for in each image taken.
    choose : ChooseSettings
        Criteria for images taken automatically.
    realsense : RealSenseSettings
    sources : mapping of str to str
        Source last chosen for each camera, by its name.
    asked : int
        Number of images, or pairs, with the board that the step asks for.
    earlier : sequence of tuple of BoardView
        The board in earlier images, by camera; empty tuples of images that were not searched.
    open_source : callable
        Like `open_view_source`.
    list_cameras : callable
        Like `list_viewpoints`.

    Attributes
    ----------
    remembered : Signal(dict)
        The sources that are shown, by the cameras' names.
    """

    remembered = Signal(object)

    def __init__(
        self,
        folders: Mapping[str, Path],
        board: Board,
        choose: ChooseSettings,
        realsense: RealSenseSettings,
        parent: QWidget | None = None,
        sources: Mapping[str, str] = MappingProxyType({}),
        asked: int = ASKED_VIEWS,
        earlier: Sequence[tuple[BoardView, ...]] = (),
        open_source: Callable[..., ViewpointCamera] = open_view_source,
        list_cameras: Callable[[], list[int]] = list_viewpoints,
    ) -> None:
        cameras = LiveCameras(
            tuple(folders),
            realsense,
            lambda title, frame, identity: keep_imager(folders[title], frame, identity),
            open_source,
        )
        help_text = tr(
            "Take an image whenever the board is at rest, sharp, and at a position not covered by "
            "earlier images."
        )
        super().__init__(
            *("takeDialog", tr("Take images"), cameras, help_text),
            *(self._keep_if_new, self._show_judged, parent),
        )
        self._folders, self._board, self._choose = dict(folders), board, choose
        self._selector, self._kept = self._new_selector(), 0
        self._asked, self._seen = asked, list(earlier)
        self._count = with_name(QLabel(), "takenCount")
        self._kinds = with_name(QLabel(), "takenKinds")
        self._kinds.setToolTip(
            tr(
                "Near: seen from the front, the board would fill half of the width or more; far: "
                "a third or less. Tilted: by 20° or more from the line of sight."
            )
        )
        self._maps = tuple(CoverageMap(title) for title in folders)
        self._task = paragraph("takeTask")
        cameras.chosen_changed.connect(self.refresh)
        self._by_itself.toggled.connect(self._reset)
        self._lay_out()
        self.refresh()
        self._show_coverage()
        self._bar.run(tr("Looking for cameras"), lambda *_: list_cameras(), cameras.add_cameras)
        cameras.choose(sources)

    @property
    def shown_images(self) -> Images | None:
        """The present images; None while no camera is shown."""
        return self._cameras.images

    def start(self) -> None:
        """Show the images of the chosen cameras."""
        super().start()
        self.remembered.emit(self._cameras.chosen)

    def take(self) -> None:
        """Save the present images, and search them for the board."""
        images = self.shown_images
        if images is None or self._bar.is_busy:
            return

        def work(_progress: Progress) -> object:
            folders = tuple(self._folders.values())
            if are_kept(images, folders):
                return []
            names = keep_images(images, folders)
            return [
                board_image(name, one, self._board) for name, one in zip(names, images, strict=True)
            ]

        self._bar.run(tr("Looking for the board"), work, self._show_taken)

    def asked(self) -> Images | None:
        """Return the present images."""
        return self.shown_images

    def refresh(self) -> None:
        """Show what to do next."""
        super().refresh()
        self._start.setEnabled(not self._cameras.need)
        task = tr("Press Take while nothing moves. Close when there are enough.")
        if self.shown_images is None:
            task = tr("Choose a camera or a recording, and press Show.")
            if need := self._cameras.need:
                task = f"{sentence(need)}."
        elif self._by_itself.isChecked():
            task = tr("Images are taken automatically. Close when there are enough.")
        self._task.setText(task)

    def _reset(self) -> None:
        self.stop_judging()
        self._selector, self._kept = self._new_selector(), 0

    def _new_selector(self) -> ViewSelector:
        return ViewSelector(self._choose, [title.lower() for title in self._folders])

    def _keep_if_new(self, images: Images) -> tuple[str, Sequence[BoardView | None]]:
        """Save images if useful; return why not, and what they show. Runs in the job's thread."""
        folders = tuple(self._folders.values())
        if self._cameras.are_stored and are_kept(images, folders):
            return _TAKEN, ()
        seen = see_board(images, self._board)
        why_not = self._selector.consider(seen)
        if not why_not:
            keep_images(images, folders)
        return why_not, seen

    def _show_judged(self, _images: Images, answer: tuple[str, Sequence[BoardView | None]]) -> None:
        why_not, seen = answer
        if not why_not:
            self._kept += 1
            self._add(seen)
        if self._selector.is_done:
            self._by_itself.setChecked(False)
            told = tr("{} taken: enough images").format(self._choose.most)
            finding = Finding("", Health.GOOD, told)
        elif why_not:
            finding = Finding("", Health.LIMITED, tr("{} taken; {}").format(self._kept, why_not))
        else:
            finding = Finding("", Health.GOOD, tr("{} taken").format(self._kept))
        self._found.show_finding(finding)

    def _show_taken(self, views: list[BoardImage]) -> None:
        problem = "; ".join(f"{view.name}: {view.problem}" for view in views if view.problem)
        if not views:
            found = Finding("", Health.LIMITED, _TAKEN, tr("take another"))
        elif problem:
            found = Finding("", Health.LIMITED, problem, tr("take another"))
        else:
            counts = tr(" and ").join(str(len(view.found.ids)) for view in views if view.found)
            found = Finding("", Health.GOOD, tr("{}: {} corners").format(views[0].name, counts))
            self._add([view.found for view in views])
        self._found.show_finding(found)

    def _add(self, seen: Sequence[BoardView | None]) -> None:
        self._seen.append(tuple(one for one in seen if one is not None))
        self._show_coverage()

    def _show_coverage(self) -> None:
        """Show how many of the images asked for there are, of which kinds, and what they cover."""
        told = tr("{} of {} usable images")
        if len(self._folders) > 1:
            told = tr("{} of {} usable pairs of images")
        self._count.setText(told.format(len(self._seen), self._asked))
        searched = [seen for seen in self._seen if seen]
        for camera, shown in enumerate(self._maps):
            found = [seen[camera] for seen in searched]
            shown.show_coverage(coverage(found) if found else None)
        if self._asked < ASKED_VIEWS:  # of a camera that stands still: they need not differ
            return
        kinds = variety((seen[0] for seen in searched), self._board)
        text = tr("{} tilted").format(kinds.tilted)
        if len(self._folders) > 1:
            text = tr("{} near, {} far, {} tilted").format(*kinds)
        self._kinds.setText(text)

    def _lay_out(self) -> None:
        covered = QLabel(tr("Covered so far:"))
        covered.setMinimumHeight(HEAD_PX)  # beside the captions of the maps
        count = hbox(self._count, self._kinds, 1, covered, spacing=2 * SPACING_PX)
        told = vbox(count, self._found, 1, spacing=SPACING_PX)
        for one in self._maps:
            one.setFixedHeight(_MAP_PX)
        vbox(
            self._task,
            (self._cameras, 1),
            hbox((told, 1), *self._maps, spacing=2 * SPACING_PX),
            self._foot(),
            on=self,
            margins=2 * SPACING_PX,
            spacing=SPACING_PX,
        )

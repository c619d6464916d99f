"""The images of a step: their list, the selected image, and the coverage of the view."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from PySide6.QtCore import QPointF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QImage, QPainter, QPen, QPixmap
from PySide6.QtWidgets import (
    QLabel,
    QPushButton,
    QSplitter,
    QWidget,
)

from handcal.core.errors import FileError
from handcal.core.progress import Progress
from handcal.core.types import UInt8
from handcal.io.files import user_path
from handcal.rig.boards.board import Board, BoardView
from handcal.rig.boards.views import BoardImage, coverage
from handcal.rig.lens.fit import CalibrationVerdict
from handcal.station.checks.doctor import Finding, Health
from handcal_gui.app.theme import SPACING_PX, colors
from handcal_gui.app.translation import tr
from handcal_gui.engine.latest_job import LatestJob
from handcal_gui.rig.maps import CoverageMap, UncertaintyMap
from handcal_gui.rig.project import RigProject
from handcal_gui.rig.shots import Shot, look, other_board, read_color
from handcal_gui.rig.solve import SolvedPart
from handcal_gui.widgets.drawing import Drawing
from handcal_gui.widgets.fields import button, choice, paragraph
from handcal_gui.widgets.finding_line import FindingLine
from handcal_gui.widgets.image_view import ImageView
from handcal_gui.widgets.job_bar import JobBar
from handcal_gui.widgets.layouts import hbox, vbox
from handcal_gui.widgets.number_label import UNKNOWN
from handcal_gui.widgets.sentence import sentence
from handcal_gui.widgets.table import Column, Row, Table


class ImagesPanel(QWidget):
    """Searches folders of images for a board; single images can be excluded.

    Parameters
    ----------
    project : RigProject
        Learns that its board was found, and takes another that the images show.
    titles : sequence of str
        Name of the camera, or names of the two cameras of pairs.
    hint : str
        How to take the images.
    drawing : str
        Name of the drawing of the arrangement in the tutorial.
    folders : sequence of str
    dropped : str
        Fields of the step's entries: folders of the images, and the excluded ones.
    take, again : str
        Texts of the buttons, so that two panels of a page can have different keys.

    Attributes
    ----------
    hint, drawing, buttons, search : QWidget
        How to take the images, and how their search goes on; the page places them.
    folders, dropped
        As given.
    take, again : QPushButton
        Connected by the page; once `again` is pressed, `look` reads the folders again.
    shots : tuple of Shot
    dropped_changed : Signal()
        The images or the set of excluded images have changed.
    """

    dropped_changed = Signal()

    def __init__(
        self,
        project: RigProject,
        titles: tuple[str, ...],
        hint: str,
        drawing: str,
        folders: Sequence[str] = (),
        dropped: str = "dropped",
        take: str = tr("&Take images…"),
        again: str = tr("Find the board &again"),
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self._project = project
        self.folders, self.dropped = tuple(folders), dropped
        self.buttons, self.search = QWidget(), QWidget()
        self.shots: tuple[Shot, ...] = ()
        self._question: tuple[tuple[Path, ...], Board] | None = None
        self._dropped: frozenset[str] = frozenset()
        self._list = Table("shots", tr("Images"), chooses="one")
        self._list.setIconSize(_PICTURE_PX)
        self._list.setMinimumSize(34 * SPACING_PX, 12 * SPACING_PX)
        self._list.offer_ticks(self._tick)
        self._view = ShotView(titles)
        self._maps = tuple(CoverageMap(title) for title in titles)
        self._sigmas = tuple(UncertaintyMap(title) for title in titles)
        self._shown_map = choice(
            "map",
            tr("Map"),
            {"coverage": tr("Images of the board"), "uncertainty": tr("Uncertainty")},
            tr(
                "Images of the board: how many cover each part of the view. Uncertainty: how well "
                "the solved projection is known there, in pixels."
            ),
        )
        self._shown_map.currentIndexChanged.connect(self._show_map)
        self.drawing = Drawing(f"docs/pictures/{drawing}.svg")
        self._count = QLabel()
        self._count.setObjectName("count")
        self.hint = paragraph("hint", hint)
        self.hint.setAlignment(Qt.AlignmentFlag.AlignTop)  # where another one is longer
        self._trouble = FindingLine("images")
        self._trouble.hide()
        self.again = button("again", again, help_text=tr("Read the folders again"))
        self.take = button("take", take, help_text=tr("Take images with cameras of this computer"))
        self.again.setEnabled(False)
        self.again.clicked.connect(self.forget)
        self.bar = JobBar(tr("Cancel"))  # without a letter: two panels may search at once
        self.bar.failed.connect(self.show_trouble)
        self.bar.busy_changed.connect(self.bar.setVisible)
        self.bar.hide()
        self._list.chosen_changed.connect(self._show_chosen)
        self._lay_out()
        self._show_map()
        self._refresh()

    @property
    def used(self) -> int:
        """Number of images in which the board was found and that are not excluded."""
        return sum(not shot.problem and shot.name not in self._dropped for shot in self.shots)

    @property
    def count(self) -> str:
        """The number of images used, in words; empty without images."""
        return tr("{} of {} used").format(self.used, len(self.shots)) if self.shots else ""

    def dropped_of(self, before: tuple[str, ...]) -> tuple[str, ...]:
        """Return the excluded images; `before` while no images are shown."""
        names = (shot.name for shot in self.shots)
        return tuple(name for name in names if name in self._dropped) if self.shots else before

    def add_button(self, added: QPushButton) -> None:
        """Add a button in front of the panel's own."""
        self._button_row.insertWidget(0, added)
        QWidget.setTabOrder(added, self.take)

    def look(self, folders: Sequence[str], board: Board, dropped: Sequence[str]) -> None:
        """Search folders for the board, unless just done; do nothing if a folder is missing."""
        paths = tuple(user_path(folder) for folder in folders if folder)
        question = (paths, board)
        if question == self._question:
            return
        before = self._question[0] if self._question else ()
        if before and before != paths:
            dropped = ()  # they refer to other images
        self._question = question
        self.again.setEnabled(len(paths) == len(folders))
        self._show((), ())
        if len(paths) == len(folders):
            self.bar.run(
                tr("Looking for the board"),
                partial(_look, paths, board),
                lambda seen: self._show(seen[0], dropped, seen[1]),
            )
        else:
            self.bar.stop()

    def forget(self) -> None:
        """Make the next `look` read the folders again."""
        self._question = None

    def show_solved(self, solved: SolvedPart) -> None:
        """Show the residual of each image."""
        self._show_rows(solved)
        for shown, found in zip(self._sigmas, solved.uncertainties, strict=False):
            shown.show_uncertainty(found)

    def show_trouble(self, why: str) -> None:
        """Show why there are no images."""
        self._trouble.show_finding(Finding("", Health.BROKEN, why))
        self._trouble.show()

    def stop(self) -> None:
        """End background work."""
        self.bar.stop()
        self._view.stop()

    def _show(
        self, shots: tuple[Shot, ...], dropped: Sequence[str], other: Board | None = None
    ) -> None:
        self.shots = shots
        self._trouble.hide()
        self._view.show_shot(None)
        self._dropped = frozenset(dropped)
        self._show_rows(_UNSOLVED, tr("⚠ Another board") if other else "")
        self._list.choose(self._list.keys[:1])
        self._refresh()
        self.dropped_changed.emit()
        if self._question is not None and not all(shot.problem for shot in shots):
            self._project.note_found(self._question[1])
        if other is not None:
            self._offer(other)

    def _offer(self, other: Board) -> None:
        """Offer the board that the images show, if it is not the one entered."""
        entered = self._project.inputs.board
        if self._question is None or self._question[1] != entered:
            return  # not the printed board, but the grid on a display

        def use() -> None:
            self._project.enter(board=other)
            self.again.click()

        shown, expected = (f"{one.squares[0]} × {one.squares[1]}" for one in (other, entered))
        found = tr("the images show {}, the board page says {}").format(shown, expected)
        label = tr("Use {}").format(shown)
        if other.squares == entered.squares:
            found = tr("the images show a board printed by OpenCV before 4.6")
            if entered.legacy:
                found = tr("the images show a board printed by OpenCV 4.6 or later")
            label = tr("Use this board")
        self._trouble.show_finding(Finding("", Health.BROKEN, found), label, use)
        self._trouble.show()

    def _show_rows(self, solved: SolvedPart, note: str = "") -> None:
        """List the images; a note stands in place of each problem if it explains all of them."""
        rows = []
        for shot in self.shots:
            *cells, own = (text(shot, solved) for text in _SHOWN.values())
            small = None if shot.small is None else partial(_picture, shot.small)
            is_ticked = shot.name not in self._dropped
            texts = (*cells, note or own)
            rows.append(Row("", texts, key=shot.name, picture=small, is_ticked=is_ticked))
        self._list.show_rows(tuple(_SHOWN), rows)

    def _tick(self, name: str, is_ticked: bool) -> None:
        self._dropped = self._dropped - {name} if is_ticked else self._dropped | {name}
        self._refresh()
        self.dropped_changed.emit()

    def _show_chosen(self) -> None:
        shots = {shot.name: shot for shot in self.shots}
        self._view.show_shot(next((shots[name] for name in self._list.chosen), None))

    def _refresh(self) -> None:
        kept = [shot for shot in self.shots if shot.name not in self._dropped]
        for number, shown in enumerate(self._maps):
            found = [one for shot in kept if (one := shot.views[number].found) is not None]
            shown.show_coverage(coverage(found) if found else None)
        self._count.setText(self.count or tr("No images yet"))

    def _show_map(self) -> None:
        is_coverage = self._shown_map.currentData() == "coverage"
        for shown in self._maps:
            shown.setVisible(is_coverage)
        for other in self._sigmas:
            other.setVisible(not is_coverage)

    def _lay_out(self) -> None:
        side = vbox(self._count, *self._maps, *self._sigmas, self._shown_map, 1, spacing=SPACING_PX)
        split = QSplitter(Qt.Orientation.Horizontal)
        split.setChildrenCollapsible(False)
        split.addWidget(self._list)
        split.addWidget(self._view)
        split.setStretchFactor(1, 1)
        split.setSizes([60 * SPACING_PX, 40 * SPACING_PX])
        hbox((split, 1), side, on=self, margins=SPACING_PX, spacing=2 * SPACING_PX)
        buttons = self.take, self.again
        self._button_row = hbox(*buttons, 1, on=self.buttons, margins=0, spacing=SPACING_PX)
        vbox(self._trouble, self.bar, on=self.search, margins=0, spacing=0)


def _look(
    folders: tuple[Path, ...], board: Board, progress: Progress
) -> tuple[tuple[Shot, ...], Board | None]:
    shots = look(folders, board, progress)
    return shots, other_board(shots, board)


def _corners(shot: Shot, _solved: SolvedPart) -> str:
    return " · ".join(str(len(one.found.ids)) if one.found else UNKNOWN for one in shot.views)


def _rms(shot: Shot, solved: SolvedPart) -> str:
    rms_px = solved.residuals_px.get(shot.name)
    return UNKNOWN if rms_px is None else f"{rms_px:.2f}"


def _tilt(shot: Shot, solved: SolvedPart) -> str:
    tilt_rad = solved.tilts_rad.get(shot.name)
    return UNKNOWN if tilt_rad is None else f"{np.degrees(tilt_rad):.0f}°"


def _note(shot: Shot, solved: SolvedPart) -> str:
    if shot.problem:
        return f"⚠ {sentence(shot.problem)}"
    # Of a pair, the worst is named after one image: "headset camera's of NAME".
    worst = solved.worst
    is_worst = worst is not None and worst.name.endswith(shot.name)
    return tr("Worst: {}").format(worst.why) if worst and is_worst else ""


_SHOWN: dict[Column, Callable[[Shot, SolvedPart], str]] = {
    Column(
        tr("Image"),
        tr("Unticked images are excluded; tick them to include them again."),
        is_number=False,
    ): lambda shot, _: shot.name,
    Column(tr("Corners"), tr("Number of board corners found in each camera's image.")): _corners,
    Column(
        tr("RMS, px"),
        tr("Root mean square distance between detected and expected corners, after solving."),
    ): _rms,
    Column(
        tr("Tilt"),
        tr("Angle between the board's normal and the line of sight, after solving."),
    ): _tilt,
    Column(
        tr("Note"),
        tr("Why no board was found, or what is wrong with the worst image."),
        is_number=False,
        is_rest=True,
    ): _note,
}
"""The columns of the list of images, with the text of each image."""
_PICTURE_PX = QSize(6 * SPACING_PX, 4 * SPACING_PX)
_UNSOLVED = SolvedPart(CalibrationVerdict("bad", ""), (), {})


def _picture(image: UInt8) -> QPixmap:
    height, width = image.shape[:2]
    shown = QImage(image.data, width, height, 3 * width, QImage.Format.Format_RGB888)
    keep, smooth = Qt.AspectRatioMode.KeepAspectRatio, Qt.TransformationMode.SmoothTransformation
    return QPixmap.fromImage(shown.copy()).scaled(_PICTURE_PX, keep, smooth)


_ARM = 0.006  # of a corner's cross, relative to the image's width


class ShotView(QWidget):
    """Shows one image, or the two of a pair, one above the other.

    Parameters
    ----------
    titles : sequence of str
        Camera of each image.
    """

    def __init__(self, titles: tuple[str, ...], parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._titles = titles
        self._shot: Shot | None = None
        self._images = tuple(ImageView(title) for title in titles)
        # Above the images, as over the maps: on small ones, they would hide what they are about.
        self._captions = tuple(paragraph("shotCaption") for _ in titles)
        self._read = LatestJob(_read, self)
        self._read.answered.connect(self._show_images)
        parts = zip(self._captions, self._images, strict=True)
        pairs = [
            (vbox(caption, (image, 1), spacing=SPACING_PX // 2), 1) for caption, image in parts
        ]
        vbox(*pairs, on=self, margins=0, spacing=SPACING_PX)
        self.setMinimumWidth(30 * SPACING_PX)
        self.show_shot(None)

    def show_shot(self, shot: Shot | None) -> None:
        """Load and show a shot; None clears the view."""
        self._shot = shot
        if shot is None:
            self._show_message(tr("The selected image will appear here"))
        else:
            self._read.ask(shot.files)

    def stop(self) -> None:
        """Wait for background work to end."""
        self._read.stop()

    def _show_images(self, files: tuple[Path, ...], images: tuple[UInt8 | str, ...]) -> None:
        if self._shot is None or files != self._shot.files:
            return
        texts = zip(self._captions, self._titles, strict=True)
        parts = zip(self._images, texts, self._shot.views, images, strict=True)
        for shown, (caption, title), view, image in parts:
            found = view.found
            shown.show_image(None if isinstance(image, str) else image)
            shown.show_overlay(None if found is None else partial(_draw_corners, found))
            shown.show_text(message=image if isinstance(image, str) else "")
            caption.setText(f"{title}: {_caption(view)}")

    def _show_message(self, message: str) -> None:
        for caption, shown in zip(self._captions, self._images, strict=True):
            caption.clear()
            shown.show_image(None)
            shown.show_overlay(None)
            shown.show_text(message=message)


def _read(files: tuple[Path, ...]) -> tuple[UInt8 | str, ...]:
    return tuple(_read_one(file) for file in files)


def _read_one(file: Path) -> UInt8 | str:
    """Return an image, or why it cannot be read: the other of a pair is shown nevertheless."""
    try:
        return read_color(file)
    except FileError as error:
        return str(error)


def _caption(view: BoardImage) -> str:
    if view.found is None:
        return view.problem
    blur_px = view.found.blur_px
    return tr("{} corners; edges {:.1f} px wide").format(len(view.found.ids), blur_px)


def _draw_corners(found: BoardView, painter: QPainter) -> None:
    """Draw a cross at every corner, and a circle around the board's first."""
    arm_px = _ARM * found.size[0]
    for width, color in ((4.0, "#ffffff"), (2.0, colors().red)):
        pen = QPen(QColor(color), width * painter.device().devicePixelRatio())
        pen.setCosmetic(True)
        painter.setPen(pen)
        for x, y in found.pixels.tolist():
            painter.drawLine(QPointF(x - arm_px, y), QPointF(x + arm_px, y))
            painter.drawLine(QPointF(x, y - arm_px), QPointF(x, y + arm_px))
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.drawEllipse(QPointF(*found.pixels[0].tolist()), 2.5 * arm_px, 2.5 * arm_px)

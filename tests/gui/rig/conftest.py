"""Photographs of a whole offline calibration, rendered once, and file dialogs with an answer."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from PySide6.QtWidgets import QFileDialog
from pytestqt.qtbot import QtBot

from handcal.core.types import Float64, Intrinsics, UInt8
from handcal.rig.boards import finder as board_finder
from handcal.rig.boards.board import Board, Int64
from handcal.rig.example import example_rig
from handcal.sim.photographs import BOARD, VIEWPOINT_CAMERA, write_photographs
from handcal_gui.rig.project_folder import (
    DisplayEntries,
    ProjectFolder,
    RigInputs,
    StereoEntries,
    ViewpointEntries,
)
from handcal_gui.rig.shots import read_color
from handcal_gui.rig.wizard import RigWizard

find_corners = board_finder.find_corners


@lru_cache(maxsize=500)
def _find_corners(pixels: bytes, shape: tuple[int, int], board: Board) -> tuple[Int64, Float64]:
    return find_corners(np.frombuffer(pixels, np.uint8).reshape(shape), board)


@pytest.fixture(scope="module", autouse=True)
def _corners_are_found_once() -> Iterator[None]:
    """Find the corners of each photograph once: most tests open a window on the same ones."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            board_finder,
            "find_corners",
            lambda gray, board: _find_corners(gray.tobytes(), gray.shape, board),
        )
        yield


@dataclass(frozen=True)
class Photographs:
    """Folders of photographs, the entries that name them, and the viewpoint camera."""

    folder: Path
    work: RigInputs
    viewpoint: Intrinsics

    def image(self, folder: str) -> UInt8:
        """Return the first image of a folder, RGB."""
        return read_color(self.folder / folder / f"{folder}-001.png")


@pytest.fixture(scope="session")
def photographs(tmp_path_factory: pytest.TempPathFactory) -> Photographs:
    """Return eight views for each camera, a pair without a board, and the left display's."""
    out = tmp_path_factory.mktemp("photographs")
    write_photographs(out, example_rig(), 8, np.random.default_rng(0))
    for folder in ("depth", "headset"):
        assert cv2.imwrite(
            str(out / folder / f"{folder}-099.png"), np.full((360, 640), 100, np.uint8)
        )
    work = RigInputs(
        board=BOARD,
        stereo=StereoEntries(str(out / "depth"), str(out / "headset")),
        viewpoint=ViewpointEntries(str(out / "viewpoint")),
        left=DisplayEntries(
            grid_images=str(out / "grid-left"),
            board_images=str(out / "board-left"),
            tracked=str(out / "tracked-left.json"),
        ),
    )
    return Photographs(out, work, VIEWPOINT_CAMERA)


@pytest.fixture
def folder(photographs: Any, tmp_path: Path) -> Path:
    """A work folder with everything entered, but nothing solved."""
    ProjectFolder(tmp_path / "rig").save(photographs.work)
    return tmp_path / "rig"


@pytest.fixture
def wizard(qtbot: QtBot, folder: Path) -> Iterator[RigWizard]:
    wizard = RigWizard(ProjectFolder(folder))
    qtbot.addWidget(wizard)
    wizard.show()
    yield wizard
    wizard.accept()


@pytest.fixture
def choose(monkeypatch: pytest.MonkeyPatch) -> Callable[[Path], None]:
    """Return a function that sets the answer of the file dialogs."""

    def answer(path: Path) -> None:
        for ask in ("getSaveFileName", "getOpenFileName"):
            monkeypatch.setattr(QFileDialog, ask, lambda *_: (str(path), ""))

    return answer

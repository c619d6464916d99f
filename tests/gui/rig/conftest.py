"""Photographs of a whole offline calibration, rendered once; and dialogs answered by tests."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest
from PySide6.QtWidgets import QFileDialog

from handcal.display import view_of_eye
from handcal.geometry import invert, rigid
from handcal.rig.board import Board
from handcal.rig.example import example_rig
from handcal.rig.grid import Grid, draw_grid
from handcal.rig.tracked_file import write_tracked
from handcal.sim.boards import BoardPainter, PictureSettings, board_poses
from handcal.sim.viewpoint import photograph_display
from handcal.types import Intrinsics, UInt8
from handcal_gui.rig.work import DisplayEntries, RigWork, StereoEntries, ViewpointEntries

BOARD = Board(squares=(8, 6))
DEPTH = Intrinsics(640, 360, 502.0, 502.0, 319.5, 179.5, (0.05, -0.1, 0.001, 0.0, 0.0))
HEADSET = Intrinsics(640, 360, 520.0, 521.0, 322.0, 176.0, (-0.08, 0.05, 0.0, 0.001, 0.0))
VIEWPOINT = Intrinsics(640, 360, 900.0, 898.5, 322.0, 177.5, (-0.08, 0.05, 0.0004, -0.0003, 0.0))
PICTURES = PictureSettings(samples=1)
VIEWS = 8


@dataclass(frozen=True)
class Photographs:
    """Where they are, as a technician would enter them, and the camera behind the display."""

    folder: Path
    work: RigWork
    viewpoint: Intrinsics

    def image(self, folder: str, number: int = 1) -> UInt8:
        """Return one of them, RGB."""
        image = cv2.imread(str(self.folder / folder / f"{folder}-{number:03}.png"))
        assert image is not None
        return np.ascontiguousarray(image[..., ::-1], np.uint8)


@pytest.fixture(scope="session")
def photographs(tmp_path_factory: pytest.TempPathFactory) -> Photographs:
    """Eight views for each camera, a pair without a board, and the left display's."""
    out, rng, rig = tmp_path_factory.mktemp("photographs"), np.random.default_rng(0), example_rig()
    depth, headset, viewpoint = (
        BoardPainter(BOARD, camera, PICTURES) for camera in (DEPTH, HEADSET, VIEWPOINT)
    )

    def save(folder: str, number: int, image: UInt8) -> str:
        path = out / folder / f"{folder}-{number:03}.png"
        path.parent.mkdir(exist_ok=True)
        assert cv2.imwrite(str(path), image)
        return path.name

    pairs = board_poses(BOARD, DEPTH, VIEWS, rng, others=((rig.T_H_D, HEADSET),))
    for number, T_D_B in enumerate(pairs, 1):
        save("depth", number, depth.paint(T_D_B, rng))
        save("headset", number, headset.paint(rig.T_H_D @ T_D_B, rng))
    for folder in ("depth", "headset"):
        save(folder, 99, np.full((360, 640), 100, np.uint8))
    for number, T_V_B in enumerate(board_poses(BOARD, VIEWPOINT, VIEWS, rng), 1):
        save("viewpoint", number, viewpoint.paint(T_V_B, rng))
    display, R_E_C = rig.eyes["left"], rigid([0.02, -0.01, 0.03])[:3, :3]
    shown = draw_grid(Grid(display.width_px, display.height_px))
    for number in range(1, 3):
        seen = photograph_display(shown, display, R_E_C, VIEWPOINT, rng)
        save("grid", number, seen)
    T_H_C = invert(view_of_eye(display, np.eye(4))) @ rigid(R_E_C)
    tracked = {}
    for number, T_C_B in enumerate(board_poses(BOARD, VIEWPOINT, 4, rng), 1):
        tracked[save("board", number, viewpoint.paint(T_C_B, rng))] = T_H_C @ T_C_B
    write_tracked(out / "tracked.json", tracked)
    return Photographs(out, _entries(out), VIEWPOINT)


def _entries(out: Path) -> RigWork:
    return RigWork(
        board=BOARD,
        stereo=StereoEntries(str(out / "depth"), str(out / "headset")),
        viewpoint=ViewpointEntries(str(out / "viewpoint")),
        left=DisplayEntries(
            grid_images=str(out / "grid"),
            board_images=str(out / "board"),
            tracked=str(out / "tracked.json"),
        ),
    )


@pytest.fixture
def choose(monkeypatch: pytest.MonkeyPatch) -> Callable[[Path], None]:
    """Answer the system's dialogs with a path."""

    def answer(path: Path) -> None:
        for ask in ("getSaveFileName", "getOpenFileName"):
            monkeypatch.setattr(QFileDialog, ask, lambda *_: (str(path), ""))

    return answer

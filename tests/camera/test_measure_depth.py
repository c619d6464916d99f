"""The depth check of a recording: which frames are used, and what is said when none is."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handcal.camera.folder import FolderCamera, record_folder
from handcal.camera.measure_depth import (
    STILLS,
    DepthSettings,
    MeasuredDepth,
    run_depth_check,
)
from handcal.core.progress import Progress
from handcal.core.types import DepthCheck, Frame
from handcal.rig.boards.board import Board
from handcal.rig.boards.views import ViewsError
from handcal.sim.boards import WHITE, BoardPainter, PictureSettings
from tests.board_frames import BOARD, COLOR, frames, poses

COUNT = 6


@pytest.fixture(scope="module")
def held_twice(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a recording of a board at rest in several places, two frames of each."""
    rng = np.random.default_rng(1)
    painter = BoardPainter(BOARD, COLOR, PictureSettings(samples=1))
    places = [T_D_B for T_D_B in poses(COUNT, rng, 0.33, 0.52) for _ in range(2)]
    folder = tmp_path_factory.mktemp("depth") / "take"
    record_folder(folder, frames(places, rng, offset_m=0.01, painter=painter))
    return folder


def check(
    folder: Path, settings: DepthSettings, progress: Progress = Progress(), board: Board = BOARD
) -> DepthCheck:
    return measure(folder, settings, progress, board).check


def measure(
    folder: Path, settings: DepthSettings, progress: Progress = Progress(), board: Board = BOARD
) -> MeasuredDepth:
    with FolderCamera(folder) as camera:
        return run_depth_check(camera, board, settings, progress)


def test_a_board_at_rest_is_used_once_in_each_place(held_twice: Path) -> None:
    shares: list[float] = []
    found = check(held_twice, DepthSettings(), Progress(lambda _, share: shares.append(share)))
    assert found.views == COUNT
    assert found.bias_m(0.5)[0] == pytest.approx(0.01, abs=0.0015)
    assert shares == sorted(shares)
    assert len(shares) == 2 * COUNT


def test_stills_are_all_used(held_twice: Path) -> None:
    assert check(held_twice, STILLS).views == 2 * COUNT
    few = replace(STILLS, choose=replace(STILLS.choose, most=COUNT + 1))
    assert check(held_twice, few).views == COUNT + 1
    every_other = replace(STILLS, every_s=1.5)
    assert check(held_twice, every_other).views == COUNT


def test_the_edges_are_measured_in_the_same_views(held_twice: Path) -> None:
    found = measure(held_twice, DepthSettings())
    assert found.edges is not None
    # The nearest board is larger than the image. Nothing fattens, and edges have holes.
    assert (found.edges.source, found.edges.views) == ("measured", COUNT - 1)
    assert found.edges.fatten_px == pytest.approx(-1.0, abs=0.3)
    assert found.why_no_edges == ""


def test_a_board_without_a_border_in_color_leaves_the_edges_unknown(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    painter = BoardPainter(BOARD, COLOR, PictureSettings(samples=1), wall=WHITE)
    places = poses(COUNT, rng, 0.33, 0.52)
    record_folder(tmp_path / "take", frames(places, rng, painter=painter))
    found = measure(tmp_path / "take", STILLS)
    assert found.check.views == COUNT
    assert found.edges is None
    assert found.why_no_edges.startswith(
        "0 views are too few: 5 are needed; in 6 others the border of its sheet is not seen"
    )


def test_the_reason_why_frames_were_not_used_is_given(held_twice: Path, tmp_path: Path) -> None:
    with pytest.raises(ViewsError, match=r"0 views .*; 12 frames were not used: the board is not"):
        check(held_twice, STILLS, board=replace(BOARD, dictionary="DICT_4X4_100"))

    def without_color() -> Iterator[Frame]:
        rng = np.random.default_rng(2)
        for frame in frames(poses(2, rng), rng):
            yield replace(frame, color=None, color_intrinsics=None, T_C_D=np.eye(4))

    record_folder(tmp_path / "gray", without_color())
    with pytest.raises(ViewsError, match="2 frames were not used: they have no colour"):
        check(tmp_path / "gray", STILLS)


def test_a_cancelled_search_uses_the_views_so_far(held_twice: Path) -> None:
    calls: list[str] = []
    progress = Progress(lambda what, _: calls.append(what), lambda: len(calls) >= 7)
    with pytest.raises(ViewsError, match=r"3 views .* are too few"):
        check(held_twice, DepthSettings(), progress)

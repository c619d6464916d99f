"""Taking images of a board by itself, from videos in which it moves and rests."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest

from handcal.camera.take_board import (
    DEPTH_TO_COLOR,
    IMAGER,
    TakeSettings,
    capture_views,
    keep_imager,
    keep_images,
)
from handcal.camera.viewpoint import open_viewpoint
from handcal.cli.main import main
from handcal.core.errors import CameraEndError
from handcal.core.geometry import interpolate_pose, rigid
from handcal.core.progress import Progress
from handcal.core.types import CameraIdentity, Float64, Frame, Intrinsics, UInt8
from handcal.io.closable import Closable
from handcal.io.images import read_image
from handcal.rig.boards.board import Board
from handcal.rig.boards.choose import ChooseSettings
from handcal.rig.boards.views import image_files, pair_views, read_views
from handcal.rig.formats import read_identity, read_intrinsics, read_pose
from handcal.sim.boards import BoardPainter, PictureSettings, board_poses

BOARD = Board(squares=(7, 5), square_m=0.035, marker_m=0.025)
CAMERA = Intrinsics(480, 360, 400.0, 401.0, 238.0, 181.0)
T_H_D = rigid([-0.1, 0.0, 0.0], [-0.02, -0.03, 0.01])
RESTS, FRAMES_EACH = 4, 3


def write_video(path: Path, T_camera_D: Float64) -> None:
    """Show the board at rest in some places, three frames each, and once on its way between."""
    rng = np.random.default_rng(3)
    painter = BoardPainter(BOARD, CAMERA, PictureSettings(samples=1))
    poses = board_poses(BOARD, CAMERA, RESTS, rng, others=((T_H_D, CAMERA),))
    video = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 10.0, (480, 360))
    for number, T in enumerate(poses):
        on_the_way = [interpolate_pose(poses[number - 1], T, 0.5)] if number else []
        for shown in [*on_the_way, *[T] * FRAMES_EACH]:
            gray = painter.paint(T_camera_D @ shown, rng)
            video.write(np.repeat(gray[..., None], 3, axis=2))
    video.release()


@pytest.fixture(scope="module")
def videos(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("videos")
    for name, T in (("depth", np.eye(4)), ("headset", T_H_D)):
        write_video(folder / f"{name}.avi", T)
    return folder / "depth.avi", folder / "headset.avi"


def test_each_rest_is_kept_once_and_in_pairs(videos: tuple[Path, Path], tmp_path: Path) -> None:
    folders = tmp_path / "depth", tmp_path / "headset"
    told: list[float] = []
    with open_viewpoint(videos[0]) as depth, open_viewpoint(videos[1]) as headset:
        taken = capture_views(
            (depth, headset),
            folders,
            BOARD,
            TakeSettings(),
            Progress(lambda _, share: told.append(share)),
        )
    assert taken.kept == RESTS
    assert taken.looked_at == RESTS * (FRAMES_EACH + 1) - 1
    assert sum(taken.passed_over.values()) == taken.looked_at - RESTS
    assert any("board moves" in why for why in taken.passed_over)
    assert any("seen like this before" in why for why in taken.passed_over)
    assert told == sorted(told)
    pairs = pair_views(*(read_views(image_files([folder]), BOARD) for folder in folders))
    assert len(pairs) == RESTS
    assert all(one.found for pair in pairs for one in pair)


def test_no_more_are_taken_than_asked_for(videos: tuple[Path, Path], tmp_path: Path) -> None:
    settings = TakeSettings(choose=ChooseSettings(most=2, apart_share=0.0))
    for _ in range(2):  # what is there stays
        with open_viewpoint(videos[0]) as camera:
            taken = capture_views((camera,), (tmp_path / "a",), BOARD, settings)
        assert taken.kept == 2
    names = [path.name for path in sorted((tmp_path / "a").iterdir())]
    assert names == [f"a-00{number}.png" for number in (1, 2, 3, 4)]


def test_it_ends_when_time_is_up_or_when_stopped(videos: tuple[Path, Path], tmp_path: Path) -> None:
    with open_viewpoint(videos[0]) as camera:
        settings = TakeSettings(seconds=0.35)
        taken = capture_views((camera,), (tmp_path / "a",), BOARD, settings)
    assert (taken.kept, taken.looked_at) == (1, 4)
    with open_viewpoint(videos[0]) as camera:
        taken = capture_views(
            *(
                (camera,),
                (tmp_path / "b",),
                BOARD,
                TakeSettings(),
                Progress(is_cancelled=lambda: True),
            )
        )
    assert taken.looked_at == 0


def test_images_of_a_moment_get_one_number(tmp_path: Path) -> None:
    folders = tmp_path / "depth", tmp_path / "headset [2]"
    red = np.zeros((64, 64, 3), np.uint8)
    red[..., 0] = 200
    keep_images([red], folders[:1])
    assert keep_images([red, red], folders) == ("depth-002.png", "headset [2]-002.png")
    assert keep_images([red], folders[1:]) == ("headset [2]-003.png",)
    stored = read_image(folders[1] / "headset [2]-002.png", cv2.IMREAD_COLOR_RGB)
    np.testing.assert_array_equal(stored, red)


class PacedCamera(Closable):
    """Gives images that hold their time, in tens of milliseconds, at a pace of its own."""

    name = "paced"

    def __init__(self, every_ms: int) -> None:
        self.every_ms = every_ms
        self.t_ms = -every_ms

    def read(self) -> tuple[UInt8, int]:
        self.t_ms += self.every_ms
        if self.t_ms > 2000:
            raise CameraEndError("the end")
        return np.full((1, 1, 3), self.t_ms // 10, np.uint8), self.t_ms * 1_000_000

    def close(self) -> None:
        pass


@pytest.mark.parametrize("paces_ms", [(30, 200), (200, 30)])
def test_cameras_of_different_paces_stay_together(
    paces_ms: tuple[int, int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    apart_ms: list[int] = []

    def look(images: Sequence[UInt8], _board: Board) -> tuple[None, None]:
        one, other = (int(image[0, 0, 0]) for image in images)
        apart_ms.append(10 * abs(one - other))
        return None, None

    monkeypatch.setattr("handcal.camera.take_board.see_board", look)
    cameras = [PacedCamera(pace_ms) for pace_ms in paces_ms]
    folders = tmp_path / "depth", tmp_path / "headset"
    capture_views(cameras, folders, BOARD, TakeSettings())  # type: ignore[arg-type]
    assert len(apart_ms) == 11
    assert max(apart_ms) <= 20


def test_the_depth_imager_is_kept_beside_its_colour(tmp_path: Path) -> None:
    T_C_D = rigid([0.0, 0.01, 0.0], [0.015, 0.0, 0.0])
    frame = Frame(
        *(1, 0, 0, np.zeros((360, 480), np.uint16), 1e-3, CAMERA),
        color=np.zeros((360, 480, 3), np.uint8),
        color_intrinsics=CAMERA,
        T_C_D=T_C_D,
    )
    d415 = CameraIdentity("Intel RealSense D415", "123")
    keep_imager(tmp_path / "depth", frame, d415)
    assert read_intrinsics(tmp_path / "depth" / IMAGER) == CAMERA
    assert read_identity(tmp_path / "depth" / IMAGER) == d415
    np.testing.assert_allclose(read_pose(tmp_path / "depth" / DEPTH_TO_COLOR), T_C_D, atol=1e-12)


def run(monkeypatch: pytest.MonkeyPatch, *words: object) -> int:
    """Run ``handcal rig take``; return its exit code."""
    monkeypatch.setattr(sys, "argv", ["handcal", "rig", "take", *map(str, words)])
    try:
        main()
    except SystemExit as ended:
        return int(str(ended.code))
    return 0


def test_the_command_says_what_it_kept_and_what_it_passed_over(
    videos: tuple[Path, Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    board = ("--squares", 7, 5, "--square-mm", 35, "--marker-mm", 25)
    out = tmp_path / "new [" / "views]"  # no markup
    assert run(monkeypatch, videos[0], *board, "--most", 2, "--output", out) == 0
    said = capsys.readouterr().out
    assert "2 kept in " in said
    assert "moments skipped: the board moves" in said
    assert len(list(out.glob("views*-*.png"))) == 2

    assert run(monkeypatch, videos[0], "--output", out, "--seconds", 0.5) == 1
    heard = capsys.readouterr()
    assert "skipped: the board is not seen" in heard.out
    assert "no image was kept" in heard.err

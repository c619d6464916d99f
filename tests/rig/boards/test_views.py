import dataclasses
from pathlib import Path

import cv2
import numpy as np
import pytest

from handcal.core.errors import FileError
from handcal.core.geometry import rigid
from handcal.core.progress import Progress
from handcal.core.types import Float64, Intrinsics
from handcal.rig.boards.board import Board, BoardView
from handcal.rig.boards.printing import draw_board
from handcal.rig.boards.views import (
    BoardImage,
    ViewsError,
    coverage,
    drop,
    image_files,
    one_size,
    pair_views,
    read_views,
    used,
    worst_view,
)
from handcal.rig.lens.fit import rms
from handcal.sim.boards import board_view

BOARD = Board()
CAMERA = Intrinsics(640, 480, 500.0, 500.0, 319.5, 239.5)


def _found(camera: Intrinsics = CAMERA) -> BoardView:
    T_C_B = rigid(None, [-0.125, -0.0875, 0.3])
    return board_view(BOARD, T_C_B, camera, np.random.default_rng(1), 0.0)


def test_images_are_read_and_what_is_wrong_is_kept(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "a2.png"), draw_board(BOARD, 40))
    cv2.imwrite(str(tmp_path / "a1.png"), np.full((480, 640), 10, np.uint8))
    (tmp_path / "a3.jpg").write_bytes(b"\xff\xd8 no image")
    cv2.imwrite(str(tmp_path / "a4.png"), np.zeros((16, 16), np.uint8))
    (tmp_path / "notes.txt").write_text("not looked at")
    told: list[str] = []
    files = image_files([tmp_path])
    views = read_views(files, BOARD, Progress(lambda what, _share: told.append(what)))
    assert told == [view.name for view in views] == ["a1.png", "a2.png", "a3.jpg", "a4.png"]
    assert [view.found is not None for view in views] == [False, True, False, False]
    problems = [view.problem for view in views]
    for problem, said in zip(problems, ("too dark", "", "a PNG, ", "at least 64"), strict=True):
        assert said in problem


def test_files_must_be_there_and_told_apart(tmp_path: Path) -> None:
    gone = tmp_path / "gone"
    with pytest.raises(
        FileError, match=f"^no PNG, JPEG, TIFF, BMP or PGM images: {gone} does not exist$"
    ):
        image_files([gone])
    both = f"^no PNG, JPEG, TIFF, BMP or PGM images in {tmp_path}: {gone} does not exist$"
    with pytest.raises(FileError, match=both):
        image_files([tmp_path, gone])
    with pytest.raises(FileError, match="no PNG, JPEG, TIFF, BMP or PGM"):
        image_files([tmp_path])
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "1.png").touch()
    with pytest.raises(FileError, match=r"2 images are called 1\.png"):
        image_files([tmp_path / "a", tmp_path / "b"])


def test_a_dropped_view_is_not_used_and_may_come_back() -> None:
    views = tuple(BoardImage(name, _found()) for name in "abc")
    fewer = drop(views, ["b"])
    assert list(used(fewer, 2)) == ["a", "c"]
    assert list(used(drop(fewer, []), 3)) == ["a", "b", "c"]
    with pytest.raises(ViewsError, match="no image d"):
        drop(views, ["d"])


def test_too_few_views_say_what_was_wrong_with_the_others() -> None:
    views = [
        BoardImage("a", _found()),
        BoardImage("b", None, "too dark"),
        BoardImage("c", None, "too dark"),
    ]
    with pytest.raises(ViewsError, match=r"1 of 3 images used, at least 2 .* mostly: too dark"):
        used(views, 2)


def test_mixed_resolutions_are_named() -> None:
    other = Intrinsics(320, 240, 250.0, 250.0, 159.5, 119.5)
    found = {"a": _found(), "b": _found(), "c": _found(other)}
    with pytest.raises(ViewsError, match=r"mixed .* most are 640x480, but not c \(320x240\)"):
        one_size(found)


def test_coverage_counts_the_views_with_a_corner_in_each_cell() -> None:
    near = coverage([_found(), _found()])
    assert near.hits.max() == 2
    assert near.share == np.mean(near.hits > 0)
    far = board_view(
        BOARD, rigid(None, [0.0, 0.0, 3.0]), CAMERA, np.random.default_rng(1), noise_px=0.0
    )
    assert coverage([far]).share < 0.1 < near.share


def test_pairs_end_in_the_same_number() -> None:
    left = [BoardImage(f"left{number:02}.jpg", None) for number in (1, 2, 4)]
    right = [BoardImage(f"2nd_right_{number}.png", None) for number in (4, 2, 3)]
    pairs = pair_views(left, right)
    assert [(a.name, b.name) for a, b in pairs] == [
        ("left02.jpg", "2nd_right_2.png"),
        ("left04.jpg", "2nd_right_4.png"),
    ]
    with pytest.raises(ViewsError, match="no two images belong together"):
        pair_views(left[:1], right)
    with pytest.raises(ViewsError, match="end in the same number"):
        pair_views([BoardImage("a1", None), BoardImage("b1", None)], right)


@pytest.mark.parametrize(
    ("left", "right", "pairs"),
    [
        (["a", "b", "c"], ["c", "a"], [("a", "a"), ("c", "c")]),
        (["0014_20260303_122139_601", "0017_20260303_122142_601", "0018_20260303_122143_130"],
         ["0017_20260303_122142_601", "0014_20260303_122139_601"],
         [("0014_20260303_122139_601",) * 2, ("0017_20260303_122142_601",) * 2]),
        (["left_3_601", "left_4_601"], ["right_4_601", "right_3_601"],
         [("left_3_601", "right_3_601"), ("left_4_601", "right_4_601")]),
        (["l_1700000001.121", "l_1700000002.130", "l_1700000003.125"],
         ["r_1700000002.125", "r_1700000003.130", "r_1700000001.130"],
         [("l_1700000001.121", "r_1700000001.130"), ("l_1700000002.130", "r_1700000002.125"),
          ("l_1700000003.125", "r_1700000003.130")]),
        (["L20261303_115959_950", "L20260303_120004_950"], [], []),
        (["L20260303_115959_950", "L20260303_120004_950"],
         ["R20260303_120005_020", "R20260303_120000_010"],
         [("L20260303_115959_950", "R20260303_120000_010"),
          ("L20260303_120004_950", "R20260303_120005_020")]),
        (["cam0_01", "cam0_02"], ["cam1_02", "cam1_01"],
         [("cam0_01", "cam1_01"), ("cam0_02", "cam1_02")]),
    ],
)  # fmt: skip
def test_pairs_by_names(left: list[str], right: list[str], pairs: list[tuple[str, str]]) -> None:
    views = ([BoardImage(f"{name}.png", None) for name in names] for names in (left, right))
    if not pairs:
        with pytest.raises(ViewsError, match="give the two of a pair the same name"):
            pair_views(*views)
    else:
        found = [(Path(a.name).stem, Path(b.name).stem) for a, b in pair_views(*views)]
        assert found == pairs


def test_a_pair_is_left_out_if_one_of_its_views_is() -> None:
    left = drop([BoardImage(f"left{number}.png", None) for number in (1, 2)], ["left1.png"])
    pairs = pair_views(left, [BoardImage(f"right{number}.png", None) for number in (1, 2)])
    assert [(a.dropped, b.dropped) for a, b in pairs] == [(True, True), (False, False)]


NEAR_CAMERA = Intrinsics(640, 480, 500.0, 500.0, 319.5, 239.5)
NAMES = ("a", "b", "c", "d")


def _seen_at(depth_m: float = 0.5, x_m: float = -0.125) -> BoardView:
    T_C_B = rigid(None, [x_m, -0.0875, depth_m])
    return board_view(Board(), T_C_B, NEAR_CAMERA, np.random.default_rng(1), noise_px=0.0)


def _off(scale_px: float = 0.1) -> Float64:
    return np.random.default_rng(2).normal(scale=scale_px, size=(54, 2))


def _why(worst: BoardView, off_px: Float64, tilt_rad: float = 0.3) -> str:
    found = {**dict.fromkeys(NAMES, _seen_at()), "c": worst}
    off = {**{name: _off() for name in NAMES}, "c": off_px}
    tilts = {**dict.fromkeys(NAMES, 0.3), "c": tilt_rad}
    result = worst_view(found, off, tilts)
    assert result.name == "c"
    assert result.rms_px == rms(off_px)
    return result.why


def test_what_stands_out_is_named() -> None:
    off_px = _off(0.3)
    assert "blurred: edges 6.0 px" in _why(dataclasses.replace(_seen_at(), blur_px=6.0), off_px)
    assert "small in it: squares of 10 px" in _why(_seen_at(depth_m=1.25), off_px)
    assert "steep in it: 57°, 17° in others" in _why(_seen_at(), off_px, tilt_rad=1.0)
    assert "corner of the image" in _why(_seen_at(depth_m=0.37, x_m=-0.26), off_px)
    assert "bent or moved" in _why(_seen_at(), np.full((54, 2), 0.5))
    assert _why(_seen_at(), off_px) == "nothing else about it stands out"


def test_a_few_mistaken_corners_are_pointed_at() -> None:
    off_px = _off()
    off_px[10] = [5.0, 0.0]
    x, y = _seen_at().pixels[10]
    assert f"1 of 54 corners are off by up to 5.0 px, most at ({x:.0f}, {y:.0f})" in _why(
        _seen_at(), off_px
    )


def test_a_view_little_worse_than_the_others_is_said_to_be() -> None:
    assert _why(_seen_at(), _off(0.12)).startswith("hardly more than the others' 0.14 px")

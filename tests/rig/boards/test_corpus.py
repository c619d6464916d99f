"""Boards photographed by others, with other people's results."""

import json
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handcal.core.geometry import rigid
from handcal.rig.boards.board import Board
from handcal.rig.boards.views import BoardImage, ViewsError, image_files, pair_views, read_views
from handcal.rig.lens.camera import calibrate_camera
from handcal.rig.lens.lens import FisheyeIntrinsics
from handcal.rig.lens.stereo import calibrate_stereo


@pytest.mark.campaign
def test_a_wide_lens_has_the_published_pose(shared_data: Path) -> None:
    folder = shared_data / "boards" / "wide_charuco"
    board = Board(
        squares=(31, 16),
        square_m=0.04933,
        marker_m=0.03846,
        dictionary="DICT_4X4_1000",
        legacy=True,
    )
    left, right = (
        read_views(sorted(folder.glob(f"{side}_*.png")), board) for side in ("left", "right")
    )
    assert all(view.found for view in (*left, *right))
    result = calibrate_stereo(pair_views(left, right), lens="auto")
    published = json.loads((folder / "authors_results.json").read_text())
    truth = rigid(np.array(published["rot"]), np.array(published["trans"]).ravel())
    turn = Rotation.from_matrix(truth[:3, :3].T @ result.T_H_D[:3, :3]).magnitude()
    off_m = np.linalg.norm(result.T_H_D[:3, 3] - truth[:3, 3])
    assert off_m < 0.003 * np.linalg.norm(truth[:3, 3])
    assert np.degrees(turn) < 0.1
    # Plain OpenCV with the rational model, free intrinsics and the same corners: 0.309 px.
    assert result.rms_px < 1.02 * 0.309
    assert result.verdict.name == "good"


@pytest.mark.campaign
def test_a_fisheye_is_recognised(shared_data: Path) -> None:
    folder = shared_data / "boards" / "fisheye_stereo_sourishg" / "imgs"
    board = Board(kind="checkerboard", squares=(10, 7), square_m=0.02423)
    left, right = (
        read_views(sorted(folder.glob(f"{side}*.jpg")), board) for side in ("left", "right")
    )
    result = calibrate_stereo(pair_views(left, right), lens="auto")
    assert isinstance(result.depth, FisheyeIntrinsics)
    assert isinstance(result.headset, FisheyeIntrinsics)
    # OpenCV's fisheye over 26 pairs: 0.59 px, (-111.0, -0.5, 4.3) mm.
    assert result.rms_px < 0.59
    assert np.linalg.norm(result.T_H_D[:3, 3]) == pytest.approx(0.111, rel=0.02)
    assert "moved between the two exposures" in result.verdict.reason


def test_pairs_with_equal_names_give_their_true_pose(shared_data: Path) -> None:
    folder = shared_data / "field" / "stereo_names"
    board = Board(kind="checkerboard", squares=(11, 8), square_m=0.02)
    left, right = (read_views(image_files([folder / side]), board) for side in ("left", "right"))
    pairs = pair_views(left, right)
    assert [a.name for a, _ in pairs] == [b.name for _, b in pairs] == [a.name for a in left]
    result = calibrate_stereo(pairs)
    truth = json.loads((folder / "truth.json").read_text())
    np.testing.assert_allclose(result.T_H_D[:3, 3], truth["t_m"], atol=2e-4)
    turn = Rotation.from_matrix(result.T_H_D[:3, :3]).as_rotvec(degrees=True)
    np.testing.assert_allclose(turn, truth["rotation_deg"], atol=0.03)


Pairs = Sequence[tuple[BoardImage, BoardImage]]


@pytest.fixture(scope="module")
def sample_pairs(shared_data: Path) -> Pairs:
    folder = shared_data / "boards" / "opencv_stereo"
    board = Board(kind="checkerboard", squares=(10, 7))
    left, right = (
        read_views(sorted(folder.glob(f"{side}*.jpg")), board) for side in ("left", "right")
    )
    return pair_views(left, right)


def with_right(pairs: Pairs, order: list[int]) -> Pairs:
    """Pair each left image with another right one."""
    return [(left, pairs[other][1]) for (left, _), other in zip(pairs, order, strict=False)]


@pytest.mark.parametrize(
    ("order", "reason"),
    [
        ([7, 4, 10, 1, 11, 0, 12, 2, 9, 3, 8, 5, 6], "not taken at the same moment"),
        ([*range(1, 13)], "headset camera's N-1 do"),
        ([0, 4, 2, 3, 1, *range(5, 13)], r"pair left0[25]\.jpg alone puts the cameras"),
    ],
    ids=["mixed up", "numbered from another", "two exchanged"],
)
def test_real_pairs_that_do_not_belong_together_are_refused(
    sample_pairs: Pairs, order: list[int], reason: str
) -> None:
    """The intrinsics are solved with them: contradictions once bent these, and were not named."""
    result = calibrate_stereo(with_right(sample_pairs, order))
    assert result.verdict.name == "bad"
    assert re.search(reason, result.verdict.reason), result.verdict.reason
    assert "(to 0." in result.verdict.reason or "sound" not in result.verdict.reason


def test_a_real_board_that_hardly_moved_is_refused(sample_pairs: Pairs) -> None:
    rng = np.random.default_rng(1)

    def again(view: BoardImage, number: int) -> BoardImage:
        assert view.found is not None
        pixels = view.found.pixels + rng.normal(0.0, 0.2, view.found.pixels.shape)
        return replace(view, name=f"{number}-{view.name}", found=replace(view.found, pixels=pixels))

    left, right = sample_pairs[3]
    alike = [(again(left, number), again(right, number)) for number in range(10)]
    with pytest.raises(ViewsError, match="the board hardly moved"):
        calibrate_stereo(alike)


def test_the_same_real_images_for_both_cameras_are_refused(sample_pairs: Pairs) -> None:
    with pytest.raises(ViewsError, match="both cameras' images are the same"):
        calibrate_stereo([(left, left) for left, _ in sample_pairs])


def test_opencvs_sample_is_solved_as_well_as_by_opencv_with_the_same_lens(
    sample_pairs: Pairs,
) -> None:
    assert calibrate_stereo(sample_pairs).rms_px < 1.002 * 0.194


def test_opencvs_sample_is_solved_as_well_with_the_lens_chosen_by_held_out_error(
    sample_pairs: Pairs,
) -> None:
    assert calibrate_stereo(sample_pairs, lens="auto").rms_px < 1.02 * 0.194


def test_the_lens_of_opencvs_sample_is_a_pinhole(shared_data: Path) -> None:
    folder = shared_data / "boards" / "opencv_stereo"
    board = Board(kind="checkerboard", squares=(10, 7))
    views = read_views(sorted(folder.glob("left*.jpg")), board)
    result = calibrate_camera(views, "auto")
    storage = cv2.FileStorage(str(folder / "left_intrinsics.yml"), cv2.FILE_STORAGE_READ)
    published = storage.getNode("camera_matrix").mat()
    assert abs(result.pinhole.fx / published[0, 0] - 1) < 0.01
    assert result.verdict.name == "good"


def test_a_wrong_number_of_squares_is_reported_with_names(shared_data: Path) -> None:
    folder = shared_data / "boards" / "opencv_stereo"
    board = Board(kind="checkerboard", squares=(12, 9))
    views = read_views(sorted(folder.glob("left*.jpg"))[:5], board)
    with pytest.raises(ViewsError, match=r"of 10×7 squares is seen.*\(left01.jpg, left02.jpg"):
        calibrate_camera(views)

import dataclasses
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handcal.core.geometry import invert, rigid
from handcal.core.types import Float64, Intrinsics
from handcal.rig.boards.board import Board, BoardView
from handcal.rig.boards.views import (
    BoardImage,
    ViewsError,
    board_image,
    drop,
    pair_views,
    read_views,
)
from handcal.rig.lens.stereo import StereoCalibration, calibrate_stereo
from handcal.sim.boards import board_poses, board_view

BOARD = Board()
CHECKERBOARD = Board(kind="checkerboard", squares=(10, 7))
DEPTH = Intrinsics(640, 480, 532.0, 531.0, 325.0, 238.0, (0.12, -0.25, 0.0006, -0.0004, 0.1))
HEADSET = Intrinsics(640, 360, 480.0, 481.0, 315.0, 184.0, (-0.09, 0.05, -0.0005, 0.0007, -0.01))
T_H_D = rigid([np.radians(-15.0), 0.01, 0.0], [-0.0175, -0.030, 0.015])
Pairs = tuple[tuple[BoardImage, BoardImage], ...]


def _poses(count: int, seed: int, second: Intrinsics = HEADSET) -> list[Float64]:
    rng = np.random.default_rng(seed)
    return board_poses(BOARD, DEPTH, count, rng, others=((T_H_D, second),))


def _pairs(
    count: int = 12, seed: int = 1, noise_px: float = 0.1, second: Intrinsics = HEADSET
) -> Pairs:
    rng = np.random.default_rng(seed)
    return tuple(
        _pair(number, T_D_B, T_D_B, rng, noise_px, second)
        for number, T_D_B in enumerate(_poses(count, seed, second))
    )


def _pair(
    number: int,
    T_D_B: Float64,
    T_moved: Float64,
    rng: np.random.Generator,
    noise_px: float = 0.1,
    second: Intrinsics = HEADSET,
) -> tuple[BoardImage, BoardImage]:
    """Return views of a board that may move between the two exposures."""
    return (
        BoardImage(f"d{number}", board_view(BOARD, T_D_B, DEPTH, rng, noise_px)),
        BoardImage(f"h{number}", board_view(BOARD, T_H_D @ T_moved, second, rng, noise_px)),
    )


def _errors(result: StereoCalibration) -> tuple[float, float]:
    """Return the errors of the rotation in degrees and of the translation in millimetres."""
    off = invert(T_H_D) @ result.T_H_D
    angle = Rotation.from_matrix(off[:3, :3]).magnitude()
    shift_m = np.linalg.norm(result.T_H_D[:3, 3] - T_H_D[:3, 3])
    return float(np.degrees(angle)), 1e3 * float(shift_m)


def _mirror(one: BoardImage) -> BoardImage:
    """Return what the detector finds of a checkerboard in a mirrored image."""
    seen = one.found
    assert seen is not None
    grid = seen.pixels.reshape(6, 9, 2)[::-1].reshape(-1, 2) * [-1, 1] + [seen.size[0] - 1, 0]
    return BoardImage(one.name, dataclasses.replace(seen, pixels=grid))


def test_without_noise_the_pose_comes_back() -> None:
    result = calibrate_stereo(_pairs(noise_px=0.0), DEPTH, HEADSET)
    assert _errors(result) == pytest.approx((0.0, 0.0), abs=1e-3)
    assert result.verdict.name == "good"
    assert (result.depth, result.headset) == (DEPTH, HEADSET)


@pytest.mark.parametrize("given", [True, False])
def test_the_covariance_is_as_the_errors_are(given: bool) -> None:
    errors = []
    for seed in range(4):
        result = calibrate_stereo(_pairs(seed=seed), *((DEPTH, HEADSET) if given else ()))
        assert result.covariance is not None
        off = np.concatenate(
            [
                Rotation.from_matrix(result.T_H_D[:3, :3]).as_rotvec()
                - Rotation.from_matrix(T_H_D[:3, :3]).as_rotvec(),
                result.T_H_D[:3, 3] - T_H_D[:3, 3],
            ]
        )
        errors.append(off @ np.linalg.solve(result.covariance, off) / 6)
    assert 0.3 < np.mean(errors) < 2.5


def test_corners_that_only_one_camera_sees_are_left_out() -> None:
    pairs = list(_pairs())
    for place, keep in ((0, slice(0, 40)), (1, slice(20, 54))):
        pairs[place] = (_only(pairs[place][0], keep), pairs[place][1])
    assert _errors(calibrate_stereo(pairs, DEPTH, HEADSET))[0] < 0.05


def _only(one: BoardImage, which: slice) -> BoardImage:
    seen = one.found
    assert isinstance(seen, BoardView)
    part = BoardView(
        seen.points_m[which], seen.pixels[which], seen.size, seen.ids[which], seen.blur_px
    )
    return BoardImage(one.name, part)


def test_swapped_cameras_are_named() -> None:
    swapped = [(second, first) for first, second in _pairs()]
    with pytest.raises(ViewsError, match="cameras are swapped"):
        calibrate_stereo(swapped, DEPTH, HEADSET)
    alike = dataclasses.replace(HEADSET, height=480, cy=244.0)
    swapped = [(second, first) for first, second in _pairs(second=alike)]
    with pytest.raises(ViewsError, match="cameras are swapped"):
        calibrate_stereo(swapped, DEPTH, alike)


@pytest.mark.parametrize("given", [True, False])
@pytest.mark.parametrize("which", [0, 1])
def test_one_mirrored_camera_is_named(which: int, given: bool) -> None:
    pairs = [
        tuple(_mirror(one) if place == which else one for place, one in enumerate(pair))
        for pair in _pairs()
    ]
    with pytest.raises(ViewsError, match="mirrored"):
        calibrate_stereo(pairs, *((DEPTH, HEADSET) if given else ()))  # type: ignore[arg-type]


def test_a_pair_that_does_not_belong_together_is_named_and_may_be_dropped() -> None:
    pairs = list(_pairs())
    pairs[3] = (pairs[3][0], pairs[4][1])
    result = calibrate_stereo(pairs, DEPTH, HEADSET)
    assert result.verdict.name == "bad"
    assert "pair d3 alone puts the cameras" in result.verdict.reason
    first = drop([pair[0] for pair in pairs], ["d3"])
    again = calibrate_stereo(
        list(zip(first, (pair[1] for pair in pairs), strict=True)), DEPTH, HEADSET
    )
    assert again.verdict.name == "good"
    assert again.dropped == ("d3",)


def test_pairs_numbered_differently_are_named() -> None:
    pairs = _pairs()
    shifted = [(pairs[place][0], pairs[place - 1][1]) for place in range(len(pairs))]
    verdict = calibrate_stereo(shifted, DEPTH, HEADSET).verdict
    assert verdict.name == "bad"
    assert "almost no two pairs agree" in verdict.reason


def test_cameras_that_are_not_synchronised_are_named() -> None:
    rng = np.random.default_rng(3)
    pairs = []
    for number, T_D_B in enumerate(_poses(12, 3)):
        moved = T_D_B @ rigid(rng.normal(scale=0.01, size=3), rng.normal(scale=0.002, size=3))
        pairs.append(_pair(number, T_D_B, moved, rng))
    verdict = calibrate_stereo(pairs, DEPTH, HEADSET).verdict
    assert verdict.name == "bad"
    assert "the cameras are not synchronised" in verdict.reason


def test_a_symmetric_board_that_flips_is_named() -> None:
    board = Board(kind="checkerboard", squares=(9, 7))
    rng = np.random.default_rng(4)
    pairs = []
    for number, T_D_B in enumerate(board_poses(board, DEPTH, 12, rng, others=((T_H_D, HEADSET),))):
        first, second = (
            board_view(board, T @ T_D_B, camera, rng, 0.1)
            for T, camera in ((np.eye(4), DEPTH), (T_H_D, HEADSET))
        )
        if number in (2, 7):
            second = dataclasses.replace(second, pixels=second.pixels[::-1])
        pairs.append((BoardImage(f"d{number}", first), BoardImage(f"h{number}", second)))
    verdict = calibrate_stereo(pairs, DEPTH, HEADSET).verdict
    assert verdict.name == "bad"
    assert "looks the same turned by 180°" in verdict.reason
    assert "(as d2, d7)" in verdict.reason


def test_a_board_that_hardly_moved_is_named() -> None:
    rng = np.random.default_rng(5)
    T_D_B = _poses(1, 5)[0]
    pairs = []
    for number in range(10):
        T = T_D_B @ rigid(rng.normal(scale=0.005, size=3), rng.normal(scale=0.001, size=3))
        pairs.append(_pair(number, T, T, rng))
    with pytest.raises(ViewsError, match="the board hardly moved between the images"):
        calibrate_stereo(pairs, DEPTH, HEADSET)


def test_cameras_too_far_apart_for_one_headset_are_bad() -> None:
    """As with the squares' side entered in another unit."""
    pairs = [
        tuple(replace_found(one, points_m=20.0 * one.found.points_m) for one in pair if one.found)
        for pair in _pairs()
    ]
    verdict = calibrate_stereo(pairs, DEPTH, HEADSET).verdict  # type: ignore[arg-type]
    assert verdict.name == "bad"
    assert "mm apart" in verdict.reason


def replace_found(image: BoardImage, **changes: Float64) -> BoardImage:
    assert image.found is not None
    return dataclasses.replace(image, found=dataclasses.replace(image.found, **changes))  # type: ignore[arg-type]


def test_a_few_bad_corners_are_left_out() -> None:
    pairs = list(_pairs())
    seen = pairs[0][1].found
    assert seen is not None
    pixels = seen.pixels.copy()
    pixels[[5, 20]] += [6.0, -4.0]
    pairs[0] = (pairs[0][0], BoardImage("h0", dataclasses.replace(seen, pixels=pixels)))
    result = calibrate_stereo(pairs, DEPTH, HEADSET)
    assert result.left_out == 2
    assert result.rms_px == pytest.approx(0.1 * np.sqrt(2), rel=0.1)


def test_too_few_pairs_and_one_angle() -> None:
    with pytest.raises(ViewsError, match="in 2 of 2 pairs used, at least 3"):
        calibrate_stereo(_pairs(2), DEPTH, HEADSET)
    assert calibrate_stereo(_pairs(4), DEPTH, HEADSET).verdict.name == "needs more views"
    rng = np.random.default_rng(1)
    level = []
    for number in range(12):
        T_D_B = rigid(None, [*rng.uniform([-0.15, -0.05], [-0.1, 0.0]), 0.6])
        level.append(_pair(number, T_D_B, T_D_B, rng))
    verdict = calibrate_stereo(level, DEPTH, HEADSET).verdict
    assert verdict.name == "bad"
    assert "one angle" in verdict.reason
    with pytest.raises(ViewsError, match="depth camera: all views show the board at nearly one"):
        calibrate_stereo(level)


def test_photographs_fit_better_than_by_plain_opencv(shared_data: Path) -> None:
    folder = shared_data / "boards" / "opencv_stereo"
    left, right = (
        read_views(sorted(folder.glob(f"{side}*.jpg")), CHECKERBOARD) for side in ("left", "right")
    )
    pairs = pair_views(left, right)
    result = calibrate_stereo(pairs)
    assert len(result.residuals_px) == 13
    assert result.rms_px < 0.45 / 2
    assert np.linalg.norm(result.T_H_D[:3, 3]) == pytest.approx(0.0832, abs=5e-4)
    assert "left08.jpg" in result.worst.name
    mirrored = tuple(
        board_image(file.name, np.ascontiguousarray(_gray(file)[:, ::-1]), CHECKERBOARD)
        for file in sorted(folder.glob("right*.jpg"))
    )
    with pytest.raises(ViewsError, match="mirrored"):
        calibrate_stereo(pair_views(left, mirrored))


def _gray(file: Path) -> np.ndarray:
    image = cv2.imread(str(file), cv2.IMREAD_GRAYSCALE)
    assert image is not None
    return image

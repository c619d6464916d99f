import dataclasses
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from handcal.core.geometry import image_points, rigid, transform
from handcal.core.types import Intrinsics, UInt8
from handcal.io.images import read_image
from handcal.rig.boards.board import Board, BoardError, corners_m
from handcal.rig.boards.finder import find_board
from handcal.rig.boards.printing import draw_board
from handcal.sim.boards import BoardPainter

CHARUCO = Board()
CHECKERBOARD = Board(kind="checkerboard")
LEGACY = Board(squares=(7, 8), legacy=True)
CAMERA = Intrinsics(640, 480, 532.0, 531.0, 325.0, 238.0, (-0.25, 0.08, 0.0008, -0.0005, -0.01))
SQUARE_PX = 40


@pytest.mark.parametrize("board", [CHARUCO, CHECKERBOARD, LEGACY])
def test_every_corner_of_a_drawn_board_is_found_where_it_was_drawn(board: Board) -> None:
    found = find_board(draw_board(board, SQUARE_PX), board)
    assert found.ids.tolist() == list(range(len(corners_m(board))))
    drawn = (found.points_m[:, :2] / board.square_m + 1) * SQUARE_PX - 0.5
    np.testing.assert_allclose(found.pixels, drawn, atol=0.05)
    assert found.blur_px < 1.5


@pytest.mark.parametrize("board", [CHARUCO, CHECKERBOARD])
def test_corners_of_a_tilted_board_are_found_to_a_tenth_of_a_pixel(board: Board) -> None:
    rng = np.random.default_rng(1)
    T_C_B = rigid([0.4, -0.3, 0.1], [-0.11, -0.07, 0.35])
    found = find_board(BoardPainter(board, CAMERA).paint(T_C_B, rng), board)
    assert len(found.ids) > 40
    true = image_points(transform(T_C_B, found.points_m), CAMERA)
    assert np.sqrt(np.mean(np.sum((found.pixels - true) ** 2, axis=1))) < 0.1


def test_a_blurred_image_is_recognised_by_its_edges() -> None:
    sharp = draw_board(CHECKERBOARD, SQUARE_PX)
    blurred = np.asarray(cv2.GaussianBlur(sharp, (0, 0), 2.0), np.uint8)
    assert find_board(blurred, CHECKERBOARD).blur_px > 3 * find_board(sharp, CHECKERBOARD).blur_px


def test_a_checkerboard_upside_down_is_numbered_from_its_own_upper_left() -> None:
    image = draw_board(CHECKERBOARD, SQUARE_PX)
    upright = find_board(image, CHECKERBOARD).pixels
    turned = find_board(np.rot90(image, 2).copy(), CHECKERBOARD).pixels
    size = np.array(image.shape[::-1])
    np.testing.assert_allclose(turned, size - 1 - upright, atol=0.05)


def test_a_checkerboard_that_cannot_tell_stands_upright() -> None:
    even = Board(kind="checkerboard", squares=(8, 6))
    turned = np.rot90(draw_board(even, SQUARE_PX), 2).copy()
    pixels = find_board(turned, even).pixels
    assert pixels[0, 0] < pixels[6, 0]
    assert pixels[0, 1] < pixels[-1, 1]


def _mirrored() -> UInt8:
    return draw_board(CHARUCO, SQUARE_PX)[:, ::-1].copy()


def _mostly_covered() -> UInt8:
    image = draw_board(CHARUCO, SQUARE_PX)
    image[:, 3 * SQUARE_PX :] = 255
    return image


@pytest.mark.parametrize(
    ("image", "board", "said"),
    [
        (_mirrored(), CHARUCO, "mirrored"),
        (draw_board(LEGACY, SQUARE_PX), dataclasses.replace(LEGACY, legacy=False), "before 4.6"),
        (
            draw_board(Board(dictionary="DICT_6X6_250"), SQUARE_PX),
            CHARUCO,
            "markers of another dictionary are seen .DICT_6X6",
        ),
        (
            draw_board(Board(squares=(12, 8)), SQUARE_PX),
            Board(squares=(5, 4)),
            "as on a board of 12×8 squares, not 5×4",
        ),
        (
            draw_board(CHARUCO, SQUARE_PX),
            dataclasses.replace(CHARUCO, squares=CHARUCO.squares[::-1]),
            "as on a board of 10×7 squares, not 7×10",
        ),
        (draw_board(CHECKERBOARD, SQUARE_PX), CHARUCO, "plain checkerboard of 10×7 squares"),
        (draw_board(CHARUCO, SQUARE_PX), Board(kind="checkerboard", squares=(9, 9)), "markers"),
        (
            draw_board(CHECKERBOARD, SQUARE_PX),
            Board(kind="checkerboard", squares=(8, 7)),
            "continues|is seen, not one of 8×7",
        ),
        (
            draw_board(CHECKERBOARD, SQUARE_PX),
            Board(kind="checkerboard", squares=(12, 9)),
            "10×7 squares is seen, not one of 12×9",
        ),
        (_mostly_covered(), CHARUCO, "only .* markers|too few corners"),
        (np.full((480, 640), 20, np.uint8), CHARUCO, "too dark"),
        (np.full((480, 640), 250, np.uint8), CHARUCO, "too bright"),
        (np.full((480, 640), 128, np.uint8), CHARUCO, "no contrast"),
    ],
)
def test_what_is_wrong_with_an_image_is_named_with_what_to_do(
    image: UInt8, board: Board, said: str
) -> None:
    with pytest.raises(BoardError, match=f"({said}).*[:;] ."):
        find_board(image, board)


def test_noise_is_no_board() -> None:
    noise = np.random.default_rng(1).integers(0, 255, (480, 640, 3), np.uint8)
    for board in (CHARUCO, CHECKERBOARD):
        with pytest.raises(BoardError, match="is seen: "):
            find_board(noise, board)


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"squares": (2, 7)}, "3 to 40 squares"),
        ({"squares": (41, 7)}, "3 to 40 squares"),
        ({"square_m": 0.0}, "between 1 mm and 1 m"),
        ({"marker_m": 0.025}, "0.3 to 0.95"),
        ({"dictionary": "DICT_9X9"}, "unknown dictionary DICT_9X9"),
        ({"squares": (20, 20)}, "has 100 markers, too few"),
    ],
)
def test_an_impossible_board_is_refused(fields: dict[str, object], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        dataclasses.replace(CHARUCO, **fields)  # type: ignore[arg-type]


def test_only_images_are_looked_at() -> None:
    images: list[NDArray[Any]] = [np.zeros((480, 640)), np.zeros((10, 640), np.uint8)]
    for image in images:
        with pytest.raises(ValueError, match="uint8 and at least 64"):
            find_board(image, CHARUCO)


def test_a_photograph_of_a_charuco_board(shared_data: Path) -> None:
    image = read_image(shared_data / "boards" / "charuco_photo.jpg", cv2.IMREAD_GRAYSCALE)
    board = Board(squares=(5, 7), square_m=0.04, marker_m=0.02, dictionary="DICT_6X6_250")
    assert len(find_board(image, board).ids) == 24
    with pytest.raises(BoardError, match="DICT_6X6"):
        find_board(image, dataclasses.replace(board, dictionary="DICT_4X4_50"))


def test_glare_beside_a_board_is_not_more_squares(shared_data: Path) -> None:
    file = shared_data / "field" / "glare" / "Image__2018-09-17__16-43-53.png"
    if not file.exists():
        pytest.skip(f"{file} is absent")
    image = read_image(file, cv2.IMREAD_GRAYSCALE)
    assert len(find_board(image, Board(kind="checkerboard", squares=(17, 11))).ids) == 160


def test_part_of_a_larger_checkerboard_is_not_taken_for_the_board(shared_data: Path) -> None:
    file = shared_data / "boards" / "opencv_stereo" / "left01.jpg"
    image = read_image(file, cv2.IMREAD_GRAYSCALE)
    with pytest.raises(BoardError, match="continues: it has more squares than 8×7"):
        find_board(image, Board(kind="checkerboard", squares=(8, 7)))


@pytest.mark.parametrize("name", ["left01", "left04", "left12"])
def test_a_grid_that_skips_corners_is_not_taken_for_the_board(shared_data: Path, name: str) -> None:
    image = read_image(
        shared_data / "boards" / "opencv_stereo" / f"{name}.jpg", cv2.IMREAD_GRAYSCALE
    )
    with pytest.raises(BoardError):
        find_board(image, Board(kind="checkerboard", squares=(9, 6)), explain=False)

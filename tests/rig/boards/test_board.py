import dataclasses
from pathlib import Path

import cv2
import numpy as np
import pytest

from handcal.core.geometry import image_points, rigid, transform
from handcal.core.types import Float64, Intrinsics, UInt8
from handcal.io.images import read_image
from handcal.rig.boards.board import Board, BoardError, corners_m
from handcal.rig.boards.finder import find_board
from handcal.rig.boards.printing import draw_board
from handcal.rig.cube import Cube, marker_corners_m, refine_corners
from handcal.sim.boards import BoardPainter, PictureSettings
from handcal.sim.cube import CubePainter

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
        (_mostly_covered(), CHARUCO, "only .* markers|too few corners"),
        (np.full((480, 640), 20, np.uint8), CHARUCO, "too dark"),
        (np.full((480, 640), 128, np.uint8), CHARUCO, "no contrast"),
    ],
)
def test_what_is_wrong_with_an_image_is_named_with_what_to_do(
    image: UInt8, board: Board, said: str
) -> None:
    with pytest.raises(BoardError, match=f"({said}).*[:;] ."):
        find_board(image, board)


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"squares": (2, 7)}, "3 to 40 squares"),
        ({"square_m": 0.0}, "between 1 mm and 1 m"),
        ({"marker_m": 0.025}, "0.3 to 0.95"),
        ({"dictionary": "DICT_9X9"}, "unknown dictionary DICT_9X9"),
        ({"squares": (20, 20)}, "has 100 markers, too few"),
    ],
)
def test_an_impossible_board_is_refused(fields: dict[str, object], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        dataclasses.replace(CHARUCO, **fields)  # type: ignore[arg-type]


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


TRUE_PX = np.array([[60.3, 52.7], [148.2, 61.4], [141.1, 150.9], [49.8, 139.6]])


def square(blur_px: float) -> UInt8:
    """Return a dark square on white, each pixel the mean of eight by eight."""
    places = (np.arange(200 * 8) + 0.5) / 8 - 0.5
    x, y = np.meshgrid(places, places)
    inside = np.ones(x.shape, np.bool_)
    for (x0, y0), (x1, y1) in zip(TRUE_PX, np.roll(TRUE_PX, -1, axis=0), strict=True):
        inside &= (x1 - x0) * (y - y0) > (y1 - y0) * (x - x0)
    share = inside.reshape(200, 8, 200, 8).mean(axis=(1, 3))
    image = np.asarray(cv2.GaussianBlur(215.0 - 185.0 * share, (0, 0), blur_px))
    shades: UInt8 = np.rint(image).astype(np.uint8)
    return shades


@pytest.mark.parametrize("blur_px", [0.5, 1.0, 1.5])
def test_blur_does_not_move_the_corners(blur_px: float) -> None:
    rough_px = TRUE_PX + np.array([[0.8, -0.5], [-0.6, 0.7], [0.5, 0.6], [-0.7, -0.4]])
    found_px = refine_corners(square(blur_px), rough_px, 6)
    np.testing.assert_allclose(found_px, TRUE_PX, atol=0.1)


def test_a_square_without_contrast_is_left_about_where_it_was() -> None:
    flat: Float64 = refine_corners(np.full((200, 200), 127, np.uint8), TRUE_PX, 6)
    np.testing.assert_allclose(flat, TRUE_PX, atol=1e-6)


def test_a_marker_seen_from_the_side_keeps_its_corners() -> None:
    """Its cells are narrow across the long edges: only the border's counts there."""
    cube = Cube()
    camera = Intrinsics(640, 360, 1000.0, 1000.0, 320.0, 180.0)
    pose = rigid([0.0, 0.0, 0.1], [0.0, 0.0, 0.55]) @ rigid([0.35, 0.0, 0.0])
    image = CubePainter(cube, camera, PictureSettings(noise=0.0)).paint(
        pose, np.random.default_rng(1)
    )
    top_px = image_points(transform(pose, marker_corners_m(cube, [4])), camera)
    height_px = np.ptp(top_px[:, 1])
    assert height_px < 40
    found_px = refine_corners(image, top_px + 0.3, 6)
    np.testing.assert_allclose(found_px, top_px, atol=0.25)

import numpy as np

from handcal.core.geometry import image_points, rigid, transform
from handcal.core.types import Intrinsics
from handcal.rig.boards.board import Board, corners_m
from handcal.sim.boards import BoardPainter, PictureSettings, board_poses

BOARD = Board(kind="checkerboard")
CAMERA = Intrinsics(320, 240, 266.0, 265.0, 162.0, 119.0, (-0.25, 0.08, 0.001, -0.001, -0.01))
T_C_B = rigid([0.3, -0.2, 0.1], [-0.11, -0.08, 0.4])


def test_squares_are_black_and_white_where_they_are_projected() -> None:
    image = BoardPainter(BOARD, CAMERA, PictureSettings(blur_px=0.0, noise=0.0)).paint(
        T_C_B, np.random.default_rng(1)
    )
    columns, rows = BOARD.squares
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(columns), np.arange(rows)))
    middles_m = BOARD.square_m * np.stack([x + 0.5, y + 0.5, np.zeros(len(x))], axis=1)
    places = np.rint(image_points(transform(T_C_B, middles_m), CAMERA)).astype(int)
    shades = image[places[:, 1], places[:, 0]]
    assert shades[(x + y) % 2 == 0].max() < 60
    assert shades[(x + y) % 2 == 1].min() > 150


def test_all_cameras_see_all_of_every_board() -> None:
    T_O_C = rigid([-0.2, 0.0, 0.0], [0.02, 0.03, 0.0])
    poses = board_poses(BOARD, CAMERA, 12, np.random.default_rng(1), others=((T_O_C, CAMERA),))
    assert len(poses) == 12
    for T in poses:
        for seen_from in (T, T_O_C @ T):
            pixels = image_points(transform(seen_from, corners_m(BOARD)), CAMERA)
            assert (pixels > 0).all()
            assert (pixels < [319, 239]).all()
    normals = np.array([T[:3, 2] for T in poses])
    assert np.arccos(normals[:, 2]).max() > 0.5

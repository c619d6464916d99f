"""Simulated frames of a board by a depth camera with colour, with a known error of its depth."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from handcal.core.geometry import image_points, invert, rigid, transform
from handcal.core.types import Float32, Float64, Frame, Intrinsics
from handcal.rig.boards.board import Board, BoardView, corners_m
from handcal.sim.boards import BoardPainter, board_view, pixel_rays
from handcal.sim.sensor import SensorSettings, sense_depth

BOARD = Board(squares=(8, 6), square_m=0.03, marker_m=0.022)  # large, for small images
DEPTH = Intrinsics(640, 360, 502.0, 503.0, 319.0, 179.0)
COLOR = Intrinsics(640, 360, 462.0, 461.0, 322.0, 182.0, (0.08, -0.15, 0.001, 0.0, 0.03))
T_C_D: Float64 = rigid([0.002, -0.003, 0.001], [0.015, 0.0, 0.0])
SENSOR = SensorSettings()
_WALL_M = 2.0


def poses(
    count: int, rng: np.random.Generator, near_m: float = 0.35, far_m: float = 0.8
) -> list[Float64]:
    """Return poses T_D_B of a board around the axis, tilted, at depths evenly apart."""
    middle_m = corners_m(BOARD).mean(axis=0)
    made = []
    for number, depth_m in enumerate(np.linspace(near_m, far_m, count)):
        turn = rigid([*rng.uniform(-0.4, 0.4, 2), rng.normal(0.0, 0.2)])
        place_m = np.array([0.04 * np.cos(2.4 * number), 0.025 * np.sin(2.4 * number), depth_m])
        made.append(rigid(turn[:3, :3], place_m - turn[:3, :3] @ middle_m))
    return made


def depth_image_m(T_D_B: Float64) -> Float32:
    """Return the true depth of the board, with one square of margin, before a wall."""
    T_B_D = invert(T_D_B)
    directions = pixel_rays(DEPTH, 1) @ T_B_D[:3, :3].T
    depth_m = -T_B_D[2, 3] / directions[..., 2]
    x, y = np.moveaxis(T_B_D[:2, 3] + depth_m[..., None] * directions[..., :2], 2, 0)
    columns, rows = BOARD.squares
    square = BOARD.square_m
    on_board = (x > -square) & (x < (columns + 1) * square)
    on_board &= (y > -square) & (y < (rows + 1) * square) & (depth_m > 0)
    return np.where(on_board, depth_m, _WALL_M).astype(np.float32)


def frames(
    T_D_Bs: list[Float64],
    rng: np.random.Generator,
    scale: float = 1.0,
    offset_m: float = 0.0,
    painter: BoardPainter | None = None,
    sensor: SensorSettings = SENSOR,
) -> Iterator[Frame]:
    """Yield a frame for each pose, a second apart; the colour is black without a painter."""
    for index, T_D_B in enumerate(T_D_Bs, 1):
        image = np.zeros((COLOR.height, COLOR.width), np.uint8)
        if painter is not None:
            image = painter.paint(T_C_D @ T_D_B, rng)
        measured_m = (scale * depth_image_m(T_D_B) + offset_m).astype(np.float32)
        yield Frame(
            index=index,
            t_camera_ns=index * 10**9,
            t_host_ns=0,
            depth=sense_depth(measured_m, DEPTH.fx, rng, sensor),
            depth_scale_m=sensor.depth_scale_m,
            depth_intrinsics=DEPTH,
            color=np.repeat(image[..., None], 3, axis=2),
            color_intrinsics=COLOR,
            T_C_D=T_C_D,
        )


def seen(T_D_B: Float64, rng: np.random.Generator, noise_px: float = 0.1) -> BoardView:
    """Return the corners that a detector finds in the colour image."""
    assert np.isfinite(image_points(transform(T_C_D @ T_D_B, corners_m(BOARD)), COLOR)).all()
    return board_view(BOARD, T_C_D @ T_D_B, COLOR, rng, noise_px)

"""Images of a calibration board with known truth: lens distortion, blur, noise, uneven light."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np

from handcal.core.geometry import camera_matrix, image_points, invert, rigid, transform
from handcal.core.types import Float32, Float64, Intrinsics, UInt8
from handcal.rig.boards.board import Board, BoardView, corners_m
from handcal.rig.boards.printing import draw_board

_SQUARE_PX = 64  # of the texture
BLACK, WHITE, WALL = 30.0, 215.0, 120.0
"""Reflectance of ink, paper and background."""


@dataclass(frozen=True, slots=True)
class PictureSettings:
    """Image quality of a simulated camera."""

    blur_px: float = 0.7
    """Standard deviation of the lens's blur."""
    noise: float = 3.0
    """Standard deviation of the sensor's noise, in shades of 255."""
    samples: int = 3
    """Rays along each side of a pixel."""


class BoardPainter:
    """Renders a camera's images of a board; the lens is computed once."""

    def __init__(
        self,
        board: Board,
        camera: Intrinsics,
        settings: PictureSettings | None = None,
        wall: float = WALL,
    ) -> None:
        self._board, self._camera, self._wall = board, camera, wall
        self._settings = settings or PictureSettings()
        print_ = draw_board(board, _SQUARE_PX).astype(np.float32) / 255
        texture = BLACK + (WHITE - BLACK) * print_
        self._texture = texture
        self._rays = pixel_rays(camera, self._settings.samples)

    def paint(self, T_C_B: Float64, rng: np.random.Generator) -> UInt8:
        """Return an image (H, W) of the board at a pose in the camera's frame."""
        T_B_C = invert(T_C_B)
        directions = self._rays @ T_B_C[:3, :3].T.astype(np.float32)
        at = []
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = -T_B_C[2, 3] / directions[..., 2]
            is_behind = ~(reach > 0)
            for axis in (0, 1):
                place = reach * directions[..., axis]  # in place from here: several times faster
                place += T_B_C[axis, 3]
                place[is_behind] = -1e3
                # The texture's pixel centres are at integers; its margin is one square.
                place /= self._board.square_m
                place += 1
                place *= _SQUARE_PX
                place -= 0.5
                at.append(np.clip(place, -1e4, 1e4, out=place).astype(np.float32))
        x, y = at
        fine = cv2.remap(self._texture, x, y, cv2.INTER_LINEAR, borderValue=self._wall)
        size = self._camera.width, self._camera.height
        image = np.asarray(cv2.resize(fine, size, interpolation=cv2.INTER_AREA), np.float32)
        return expose(image, self._settings, rng)


def expose(image: Float32, settings: PictureSettings, rng: np.random.Generator) -> UInt8:
    """Return a camera's image of light (H, W), 0 to 255: uneven, blurred, noisy."""
    height, width = image.shape
    falloff = rng.uniform(-0.15, 0.15, 2)
    light = 1 + np.add.outer(
        falloff[0] * np.linspace(-1, 1, height), falloff[1] * np.linspace(-1, 1, width)
    )
    if settings.blur_px > 0:
        image = np.asarray(cv2.GaussianBlur(image, (0, 0), settings.blur_px), np.float32)
    noisy = image * light + rng.normal(scale=settings.noise, size=image.shape)
    shades: UInt8 = np.clip(np.rint(noisy), 0, 255).astype(np.uint8)
    return shades


def board_view(
    board: Board, T_C_B: Float64, camera: Intrinsics, rng: np.random.Generator, noise_px: float
) -> BoardView:
    """Return the corners that a detector with Gaussian errors finds, without an image."""
    points_m = corners_m(board)
    pixels = image_points(transform(T_C_B, points_m), camera)
    return BoardView(
        points_m=points_m,
        pixels=pixels + rng.normal(scale=noise_px, size=pixels.shape),
        size=(camera.width, camera.height),
        ids=np.arange(len(points_m)),
        blur_px=2.0,
    )


def board_poses(
    board: Board,
    camera: Intrinsics,
    count: int,
    rng: np.random.Generator,
    *,
    max_tilt_rad: float = 0.7,
    others: tuple[tuple[Float64, Intrinsics], ...] = (),
) -> list[Float64]:
    """Return poses T_C_B of a hand-held board: all over the image, tilted in all directions.

    Parameters
    ----------
    board : Board
    camera : Intrinsics
    count : int
    rng : Generator
    max_tilt_rad : float
    others : tuple of (T_O_C, Intrinsics)
        Further cameras that must also see the whole board.
    """
    points_m = corners_m(board)
    middle_m = points_m.mean(axis=0)
    reach_m = np.linalg.norm(points_m.max(axis=0) - points_m.min(axis=0))
    poses: list[Float64] = []
    while len(poses) < count:
        tilt = max_tilt_rad * np.sqrt(rng.uniform(0.1, 1.0))
        towards = rng.uniform(-np.pi, np.pi)
        roll = rigid([0.0, 0.0, rng.normal(scale=0.3)])
        turn = rigid(tilt * np.array([np.cos(towards), np.sin(towards), 0.0])) @ roll
        depth_m = camera.fx * reach_m / (camera.width * rng.uniform(0.4, 0.95))
        aim_px = rng.uniform([0.2, 0.2], [0.8, 0.8]) * [camera.width, camera.height]
        ray = np.linalg.inv(camera_matrix(camera)) @ [*aim_px, 1.0]
        T_C_B = rigid(turn[:3, :3], depth_m * ray - turn[:3, :3] @ middle_m)
        views = ((np.eye(4), camera), *others)
        if all(_sees(transform(T_O_C @ T_C_B, points_m), seen_by) for T_O_C, seen_by in views):
            poses.append(T_C_B)
    return poses


def _sees(points_m: Float64, camera: Intrinsics) -> bool:
    if points_m[:, 2].min() <= 0:
        return False
    pixels = image_points(points_m, camera)
    edge_px = 0.02 * camera.width
    size = np.array([camera.width, camera.height])
    return bool((pixels > edge_px).all() and (pixels < size - edge_px).all())


@lru_cache(maxsize=2)
def pixel_rays(camera: Intrinsics, samples: int) -> Float32:
    """Return directions (H * samples, W * samples, 3) of rays through parts of the pixels."""
    within = (np.arange(samples) + 0.5) / samples - 0.5
    x = (np.arange(camera.width)[:, None] + within).ravel()
    y = (np.arange(camera.height)[:, None] + within).ravel()
    pixels = np.stack(np.meshgrid(x, y), axis=-1)
    if any(camera.distortion):
        undistorted = cv2.undistortPoints(
            pixels.reshape(-1, 1, 2),
            camera_matrix(camera),
            np.array(camera.distortion),
            criteria=(cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 40, 1e-9),
        )
        plane = undistorted.reshape(*pixels.shape)
    else:
        plane = (pixels - [camera.cx, camera.cy]) / [camera.fx, camera.fy]
    rays = np.dstack([plane, np.ones(plane.shape[:2])]).astype(np.float32)
    rays.flags.writeable = False  # cached
    return rays

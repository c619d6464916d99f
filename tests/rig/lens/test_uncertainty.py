import numpy as np
import pytest

from handcal.core.geometry import image_points, rigid
from handcal.core.types import Float64, Intrinsics
from handcal.rig.boards.board import Board, corners_m
from handcal.rig.boards.views import BoardImage
from handcal.rig.lens.bundle import Setup, as_transform, as_vector, foreseen
from handcal.rig.lens.camera import CameraCalibration, calibrate_camera
from handcal.rig.lens.lens import (
    parameters,
    pixels_of,
    solved_parameters,
    to_plane,
    with_parameters,
)
from handcal.rig.lens.uncertainty import candidate_views, next_view
from handcal.sim.boards import board_poses, board_view

BOARD = Board()
CAMERA = Intrinsics(640, 480, 532.0, 531.0, 325.0, 238.0, (-0.25, 0.08, 0.0008, -0.0005, -0.01))


def _views(count: int, seed: int) -> list[BoardImage]:
    rng = np.random.default_rng(seed)
    poses = board_poses(BOARD, CAMERA, count, rng)
    return [
        BoardImage(f"{number}", board_view(BOARD, T, CAMERA, rng, 0.1))
        for number, T in enumerate(poses)
    ]


def _projection_error_px(result: CameraCalibration) -> float:
    """Return the median error of pixels on a grid, without what a rotation explains."""
    pixels = np.stack(np.meshgrid(np.linspace(27, 612, 12), np.linspace(27, 452, 9)), -1)
    pixels = pixels.reshape(-1, 2)
    rays = np.column_stack([to_plane(pixels, CAMERA), np.ones(len(pixels))])
    off = image_points(rays, result.pinhole) - pixels
    turns = np.stack(
        [
            (image_points(rays @ rigid(1e-5 * axis)[:3, :3].T, CAMERA) - pixels).ravel()
            for axis in np.eye(3)
        ]
    ).T
    rest = off.ravel() - turns @ np.linalg.lstsq(turns, off.ravel(), rcond=None)[0]
    return float(np.median(np.linalg.norm(rest.reshape(-1, 2), axis=1)))


def test_the_uncertainty_is_as_the_errors_are() -> None:
    ratios = []
    for seed in range(8):
        result = calibrate_camera(_views(12, seed))
        assert result.uncertainty is not None
        ratios.append(_projection_error_px(result) / result.uncertainty.middle_px)
    assert 0.4 < np.mean(ratios) < 1.6


def test_what_pairs_would_tell_is_as_by_differences() -> None:
    points_m = corners_m(BOARD)
    place = np.array([0.02, -0.03, 0.01, -0.08, 0.005, 0.01])
    _, poses = candidate_views(CAMERA, points_m)
    poses = poses[[0, 44, -1]]
    setup = Setup((CAMERA, CAMERA), tuple(poses), place)
    found, seen_share = foreseen(points_m, setup, (None, "radial"))

    def pixels(values: Float64, camera: int) -> Float64:
        """Pixels by the place, the second camera's parameters and the board's pose."""
        if camera == 0:
            return pixels_of(points_m, values[12:], CAMERA)
        in_second = as_vector(as_transform(values[:6]) @ as_transform(values[12:]))
        solved = np.array([*values[6:12], *CAMERA.distortion[2:]])
        return pixels_of(points_m, in_second, with_parameters(CAMERA, solved))

    for number, pose in enumerate(poses):
        at = np.concatenate([place, parameters(CAMERA)[:6], pose])
        steps = 1e-6 * np.maximum(np.abs(at), 0.1)
        rows, shares = [], []
        for camera in (0, 1):
            by = [
                (pixels(at + step, camera) - pixels(at - step, camera)) / (2.0 * step.max())
                for step in np.diag(steps)
            ]
            here = pixels(at, camera)
            seen = ((here > 0) & (here < [CAMERA.width - 1, CAMERA.height - 1])).all(axis=1)
            rows.append(np.stack(by, axis=2)[seen].reshape(-1, len(at)))
            shares.append(seen.mean())
        J = np.concatenate(rows)
        basis, _ = np.linalg.qr(J[:, 12:])
        shared = J[:, :12] - basis @ (basis.T @ J[:, :12])
        scale = np.sqrt(np.diag(shared.T @ shared))
        expected = shared.T @ shared / np.outer(scale, scale)
        np.testing.assert_allclose(found[number] / np.outer(scale, scale), expected, atol=1e-4)
        np.testing.assert_allclose(seen_share[number], shares)


@pytest.mark.parametrize("seed", range(5))
def test_twenty_views_are_good(seed: int) -> None:
    assert calibrate_camera(_views(20, seed)).verdict.name == "good"


@pytest.mark.parametrize("seed", range(5))
def test_named_next_views_get_there(seed: int) -> None:
    rng = np.random.default_rng(seed)
    views = _views(7, seed)
    result = calibrate_camera(views)
    for number in range(5):
        if result.verdict.name == "good":
            break
        assert "next, the board at the" in result.verdict.reason
        covariance = result.covariance
        assert covariance is not None
        hits = result.coverage.hits if result.coverage.share < 0.6 else None
        add = next_view(
            result.intrinsics, solved_parameters("full"), covariance, corners_m(BOARD), 0.1, hits
        )
        assert add is not None
        pose = rigid(add.pose[:3], add.pose[3:])
        seen = board_view(BOARD, pose, CAMERA, rng, 0.1)
        inside = np.flatnonzero(((seen.pixels > 0) & (seen.pixels < [639, 479])).all(axis=1))
        views.append(BoardImage(f"next{number}", seen.only(inside)))
        result = calibrate_camera(views)
    assert result.verdict.name == "good"
    assert len(parameters(result.intrinsics)) == 9

"""A real see-through display against the model of a flat virtual screen: docs/offline.md."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from handcal.core.types import Float64
from handcal.rig.displays.grid import _arcmin, _terms, held_out_arcmin

# fx, fy, cx, cy of the undistorted maps, from cameraCalibration.json.
CAMERAS = {"left": (285.05, 286.14, 425.86, 409.55), "right": (284.03, 285.05, 423.17, 401.85)}
EYES = ("left", "right")
WIDTH = 848


def _pairs(folder: Path, name: str, eye: str) -> tuple[Float64, Float64]:
    """Return display points (N, 2), 0 to 1, and the camera's rays (N, 2) at z = 1."""
    columns = slice(EYES.index(eye) * WIDTH, (EYES.index(eye) + 1) * WIDTH)
    maps = []
    for axis in ("Width", "Height"):
        image = cv2.imread(str(folder / f"{name}_{axis}Calibration.png"), cv2.IMREAD_UNCHANGED)
        assert image is not None
        maps.append((image if image.ndim == 2 else image[..., 0])[:, columns] / 65535)
    is_seen = ((maps[0] > 0) & (maps[1] > 0)).astype(np.uint8)
    y, x = np.nonzero(cv2.erode(is_seen, np.ones((15, 15), np.uint8)))
    step = max(1, len(x) // 6000)
    y, x = y[::step], x[::step]
    fx, fy, cx, cy = CAMERAS[eye]
    display = np.stack([maps[0][y, x], maps[1][y, x]], axis=1)
    rays = np.stack([(x - cx) / fx, (y - cy) / fy], axis=1)
    for _ in range(5):  # borders of the mask
        terms = _terms(display, 5)
        off = _arcmin(terms @ np.linalg.lstsq(terms, rays, rcond=None)[0], rays)
        keep = off < 6 * np.median(off) + 1
        display, rays = display[keep], rays[keep]
    return display, rays


def _by_homography(source: Float64, target: Float64, at: Float64) -> Float64:
    H, _ = cv2.findHomography(source, target)
    return np.asarray(cv2.perspectiveTransform(at[:, None], H), np.float64)[:, 0]


def _predicted(display: Float64, rays: Float64, at: Float64, degree: int) -> Float64:
    """Return the rays of display points `at` by a homography and a polynomial, if any."""
    flat = _by_homography(display, rays, at)
    if not degree:
        return flat
    rest = rays - _by_homography(display, rays, display)
    bend = np.linalg.lstsq(_terms(display, degree), rest, rcond=None)[0]
    return np.asarray(flat + _terms(at, degree) @ bend, np.float64)


@pytest.mark.parametrize("eye", EYES)
def test_a_real_combiner_is_no_plane(shared_data: Path, eye: str) -> None:
    folder = shared_data / "boards" / "northstar_ost_graycode"
    limits = {0: (55, 85), 2: (15, 25), 3: (4, 6.5), 4: (3, 4.5)}
    for name in ("CD", "CU"):
        display, rays = _pairs(folder, name, eye)
        for degree, (low, high) in limits.items():
            flat, bent = held_out_arcmin(display, rays, degree)
            assert low < (bent if degree else flat) < high
    for name in ("MD", "MU"):
        assert held_out_arcmin(*_pairs(folder, name, eye))[0] < 2.0


@pytest.mark.parametrize("eye", EYES)
def test_its_distortion_changes_with_the_eye(shared_data: Path, eye: str) -> None:
    folder = shared_data / "boards" / "northstar_ost_graycode"
    (display, rays), (display_up, rays_up) = (_pairs(folder, name, eye) for name in ("CD", "CU"))
    for degree, (low, high) in {0: (50, 65), 4: (18, 26)}.items():
        before = _predicted(display, rays, display_up, degree)
        off = _arcmin(_by_homography(before, rays_up, before), rays_up)
        assert low < np.sqrt(np.mean(off**2)) < high

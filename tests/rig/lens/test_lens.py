import numpy as np
import pytest

from handcal.core.types import Intrinsics
from handcal.rig.lens.lens import Camera, FisheyeIntrinsics, derivatives_at, pixels_of, predict

COEFFICIENTS = (-0.31, 0.12, 1.3e-3, -7e-4, 0.05, 0.21, -0.04, 0.03, 1e-3, 2e-4, -1e-3, 3e-4)
CAMERAS = [
    *(Intrinsics(640, 480, 520.0, 515.0, 322.0, 238.5, COEFFICIENTS[:n]) for n in (0, 4, 5, 8, 12)),
    FisheyeIntrinsics(640, 480, 300.0, 301.0, 322.0, 238.5, (0.02, -0.01, 0.004, -0.001)),
]


@pytest.mark.parametrize("camera", CAMERAS, ids=lambda camera: str(len(camera.distortion)))
def test_derivatives_are_those_of_opencv(camera: Camera) -> None:
    rng = np.random.default_rng(4)
    points_m = rng.uniform([-0.5, -0.4, 0.6], [0.5, 0.4, 1.4], (50, 3))
    expected_px, by = predict(points_m, np.zeros(6), camera)
    pixels, by_point, by_parameters = derivatives_at(points_m, camera)
    np.testing.assert_allclose(pixels, expected_px, rtol=1e-9)
    np.testing.assert_allclose(by_point, by[:, 3:6], rtol=1e-7, atol=1e-7)
    np.testing.assert_allclose(by_parameters, by[:, 6:], rtol=1e-7, atol=1e-7)
    np.testing.assert_allclose(pixels_of(points_m, np.zeros(6), camera), expected_px, rtol=1e-9)

import numpy as np
import pytest

from handcal.core.display import eye_projection
from handcal.core.geometry import image_points, invert, rigid, transform
from handcal.core.types import Intrinsics
from handcal.rig.example import example_rig
from handcal.sim.boards import PictureSettings
from handcal.sim.viewpoint import photograph_display

DISPLAY = example_rig().eyes["right"]
CAMERA = Intrinsics(640, 360, 900.0, 905.0, 322.0, 177.0, (-0.1, 0.05, 0.001, 0.0, 0.0))
SHARP = PictureSettings(blur_px=0.3, noise=0.0, samples=2)


@pytest.mark.parametrize("shift_m", [[0.0, 0.0, 0.0], [0.004, -0.003, 0.006]])
def test_a_pixel_is_seen_where_a_point_of_the_focal_plane_is(shift_m: list[float]) -> None:
    """A point on S at z(C0→S) is drawn at the same pixel for every eye, and seen there."""
    point_E_m = np.array([[0.2, -0.12, DISPLAY.z_C0_S_m]])
    homogeneous = eye_projection(DISPLAY) @ [*point_E_m[0], 1.0]
    u, v = homogeneous[:2] / homogeneous[2]
    y, x = np.indices((DISPLAY.height_px, DISPLAY.width_px))
    shown = (255.0 * np.exp(-((x - u) ** 2 + (y - v) ** 2) / 50.0)).round().astype(np.uint8)
    T_E_C = rigid([0.03, -0.02, 0.1], shift_m)
    image = photograph_display(
        shown,
        DISPLAY,
        T_E_C[:3, :3],
        CAMERA,
        np.random.default_rng(0),
        shift_m=shift_m,
        settings=SHARP,
    )
    light = image.astype(float) - image.min()
    rows, columns = np.indices(light.shape)
    seen = [float((axis * light).sum() / light.sum()) for axis in (columns, rows)]
    expected = image_points(transform(invert(T_E_C), point_E_m), CAMERA)[0]
    np.testing.assert_allclose(seen, expected, atol=0.05)

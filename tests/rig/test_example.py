import re
from pathlib import Path

import numpy as np
import pytest

from handcal.core.display import projection_matrix
from handcal.core.geometry import camera_matrix, invert, project, transform
from handcal.core.types import EYES
from handcal.io.resources import resource_path
from handcal.rig.example import example_rig
from handcal.rig.rig_file import write_rig


def test_the_shipped_file_is_the_example(tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    write_rig(path, example_rig())
    number = re.compile(r"-?\d+\.\d*(?:e[-+]\d+)?")
    written, shipped = path.read_text(), resource_path("example_rig.yaml").read_text()
    # Processors differ in the last digits, and lines may break elsewhere.
    assert number.sub("", written).split() == number.sub("", shipped).split()
    values, expected = (np.array(number.findall(text), float) for text in (written, shipped))
    assert len(expected) > 50
    np.testing.assert_allclose(values, expected, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("distance_m", [0.4, 0.5, 0.6])
@pytest.mark.parametrize("eye", EYES)
def test_the_depth_camera_sees_everything_that_is_displayed(eye: str, distance_m: float) -> None:
    rig = example_rig()
    display = rig.eyes["left" if eye == "left" else "right"]
    width, height = display.width_px, display.height_px
    corners_px = np.array([[0, 0], [width, 0], [width, height], [0, height]]) - 0.5
    P = projection_matrix(display)
    # A point at the distance z from the viewpoint: p_V with ζ = z, from its pixel.
    rays = np.column_stack([corners_px, np.ones(4)]) * distance_m
    points_V_m = np.linalg.solve(P[:, :3], rays.T - P[:, 3:]).T
    np.testing.assert_allclose(project(P, points_V_m), corners_px, atol=1e-9)
    points_D_m = transform(invert(rig.T_H_D) @ invert(display.T_V_H), points_V_m)
    pixels = project(camera_matrix(rig.depth_intrinsics) @ np.eye(3, 4), points_D_m)
    size = rig.depth_intrinsics.width, rig.depth_intrinsics.height
    assert (pixels > 0).all()
    assert (pixels < size).all()

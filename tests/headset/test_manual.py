"""The package's manual: one text, with the figures that the code gives."""

from __future__ import annotations

import re

import numpy as np

from handcal.core.conventions import opengl_projection
from handcal.core.display import projection_matrix
from handcal.core.types import Float64, Projection
from handcal.rig.example import example_rig
from tests.headset.conftest import PACKAGE
from tests.helpers import ROOT

PAGE = (ROOT / "docs/headset.md").read_text()
SHIFT_M = (0.003, 0.001, 0.005)


def test_the_package_holds_the_page_and_its_steps() -> None:
    assert (PACKAGE / "Documentation~/com.handcal.headset.md").read_text() == PAGE
    steps = PAGE[PAGE.index("## From *Add") : PAGE.index("## What each")].strip()
    assert len(re.findall(r"^\d\. ", steps, re.MULTILINE)) == 5
    assert steps in (PACKAGE / "README.md").read_text()


def test_what_the_compositor_takes() -> None:
    rows = re.findall(r"^\| (.+) m \| (.+) px \| (\d+) % \| (\d+) % \| (\d+) % \|$", PAGE, re.M)
    display = example_rig().eyes["left"]
    P1, P0 = projection_matrix(display, SHIFT_M), projection_matrix(display)
    image_m = display.z_C0_S_m - display.t_C0_V_m[2]
    assert len(rows) == 4
    for distance, *figures in rows:
        point = np.array([0.05, 0.03, float(distance)])
        drawn_px = _pixel(P1, point)
        correction_px = np.linalg.norm(drawn_px - _pixel(P0, point))
        lost = [
            # The compositor takes the pixel for a point of this plane, seen in its own view.
            np.linalg.norm(_pixel(P0, _on_plane(P1, drawn_px, plane_m)) - drawn_px) / correction_px
            for plane_m in (float(distance), image_m, 1e6)
        ]
        found = [f"{correction_px:.1f}", *(f"{round(100 * share)}" for share in lost)]
        assert found == figures


def test_float32_moves_the_corners_by_little() -> None:
    display = example_rig().eyes["left"]
    size = display.width_px, display.height_px
    P = projection_matrix(display, SHIFT_M)
    exact = opengl_projection(Projection("left", P, *size), 0.1, 50.0)
    rounded = exact.astype(np.float32).astype(np.float64)
    moved_px = []
    for corner in np.stack(np.meshgrid([-1, 1], [-1, 1]), axis=-1).reshape(-1, 2):
        point = np.linalg.solve(exact, [*corner, 0.0, 1.0])
        seen = rounded @ (point / point[3])
        moved_px.append(0.5 * np.array(size) * (seen[:2] / seen[3] - corner))
    assert np.abs(moved_px).max() < 1e-4
    assert "less than 0.0001 px" in PAGE


def _pixel(P: Float64, point: Float64) -> Float64:
    m = P @ [*point, 1.0]
    pixel: Float64 = m[:2] / m[2]
    return pixel


def _on_plane(P: Float64, pixel_px: Float64, z_m: float) -> Float64:
    """Return the point at a distance that has a pixel."""
    centre, ray = (np.linalg.solve(P[:, :3], v) for v in (-P[:, 3], np.array([*pixel_px, 1.0])))
    point: Float64 = centre + (z_m - centre[2]) / ray[2] * ray
    return point

"""The North Star configuration, read back by the rules of its driver."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from handcal.core.conventions import opengl_transform
from handcal.core.geometry import invert, transform
from handcal.core.types import EYES, Eye, Float64
from handcal.export.north_star import write_northstar
from handcal.export.outcome import SessionOutcome
from tests.export.test_tools import POINTS_H_M, UP, wanted_px


def bearing_at(data: Mapping[str, Any], eye: Eye, u: float, v: float) -> Float64:
    """Interpolate as Monado's u_compute_distortion_ns_meshgrid, between four nodes."""
    columns, rows = data["num_grid_points_x"], data["num_grid_points_y"]
    grid = np.array(data[eye]["grid"])
    assert grid.shape == (rows, columns, 2)
    i, j = int(v * (rows - 1)), int(u * (columns - 1))
    down, right = v * (rows - 1) - i, u * (columns - 1) - j
    top = (1.0 - right) * grid[i, j] + right * grid[i, j + 1]
    bottom = (1.0 - right) * grid[i + 1, j] + right * grid[i + 1, j + 1]
    found: Float64 = (1.0 - down) * top + down * bottom
    return found


def test_north_star_sees_each_point_in_its_bearing(tmp_path: Path, outcome: SessionOutcome) -> None:
    write_northstar(tmp_path / "n.json", outcome)
    assert (tmp_path / "n.json").stat().st_size < 3 * 2**20  # Monado's limit
    data = json.loads((tmp_path / "n.json").read_text())
    assert (data["type"], data["version"]) == ("Moses Turner's distortion correction", 2)
    assert 45.0 < data["ipd"] < 85.0
    T_H_N = opengl_transform(np.array(data["handcal"]["rig_from_head"]))
    points_N_m = transform(invert(T_H_N), POINTS_H_M) @ UP
    left, right, up, down = np.tan(data["fov"])
    for eye, side in zip(EYES, (-0.5, 0.5), strict=True):
        display = outcome.record.rig.eyes[eye]
        seen = points_N_m - [side * data["ipd"] / 1e3, 0.0, 0.0]
        for (u_px, v_px), (x, y, z) in zip(wanted_px(outcome, eye), seen, strict=True):
            u, v = (u_px + 0.5) / display.width_px, (v_px + 0.5) / display.height_px
            found = bearing_at(data, eye, u, v)
            np.testing.assert_allclose(found, [x / -z, y / -z], atol=1e-5)  # 0.03 arcmin
            assert left < found[0] < right
            assert down < found[1] < up

"""The North Star configuration, read back by the rules of its driver."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handcal.cli.main import main
from handcal.core.errors import FileError
from handcal.core.geometry import invert, project, rigid, transform
from handcal.core.types import EYES, Eye, Float64
from handcal.export.north_star import write_northstar
from handcal.export.outcome import SessionOutcome
from tests.export.test_tools import UP

# Monado's limit of a configuration's size.
_MOST_BYTES = 3 * 2**20


def load(path: Path) -> dict[str, Any]:
    """Read a configuration as ``ns_optical_config_parse`` does, and return the kind it takes."""
    assert path.stat().st_size < _MOST_BYTES
    data: dict[str, Any] = json.loads(path.read_text())
    assert "leftEye" not in data  # the first kind that it looks for
    names = [f"{eye}_uv_to_rect_{axis}" for eye in EYES for axis in "xy"]
    data["kind"] = "polynomial" if all(len(data.get(name, ())) == 16 for name in names) else "mesh"
    if data["kind"] == "mesh":
        assert (data["type"], data["version"]) == ("meshgrid", 2)
    left, right, up, down = data["fov"]
    assert -np.pi / 2 < left < right < np.pi / 2
    assert -np.pi / 2 < down < up < np.pi / 2
    data["ipd_mm"] = next(data[key] for key in ("baseline", "ipd", "IPD") if key in data)
    assert 45.0 < data["ipd_mm"] < 85.0
    return data


def texture_at(data: dict[str, Any], eye: Eye, u: float, v: float) -> Float64:
    """Return where a point of the display looks into the rendered image, as ``ns_mesh_calc``."""
    if data["kind"] == "polynomial":
        i, j = np.divmod(np.arange(16), 4)
        powers = u**i * (1.0 - v) ** j
        right, down = powers @ data[f"{eye}_uv_to_rect_y"], powers @ data[f"{eye}_uv_to_rect_x"]
    else:
        columns, rows = data["num_grid_points_x"], data["num_grid_points_y"]
        grid = np.array(data[eye]["grid"])
        assert grid.shape == (rows, columns, 2)
        row, column = int(v * (rows - 1)), int(u * (columns - 1))
        below, beside = v * (rows - 1) - row, u * (columns - 1) - column
        top = (1.0 - beside) * grid[row, column] + beside * grid[row, column + 1]
        bottom = (1.0 - beside) * grid[row + 1, column] + beside * grid[row + 1, column + 1]
        right, down = (1.0 - below) * top + below * bottom
    edge = dict(zip(("left", "right", "up", "down"), np.tan(data["fov"]), strict=True))
    return np.array(
        [
            (right - edge["left"]) / (edge["right"] - edge["left"]),
            (down - edge["down"]) / (edge["up"] - edge["down"]),
        ]
    )


@pytest.mark.parametrize("name", ["northstar.json", "northstar_mesh.json"])
def test_each_point_is_seen_where_it_is(tmp_path: Path, outcome: SessionOutcome, name: str) -> None:
    """An application renders through the driver's views; the display shows it through the file."""
    write_northstar(tmp_path, outcome)
    data = load(tmp_path / name)
    assert data["kind"] == ("mesh" if "mesh" in name else "polynomial")
    T_H_N = np.array(data["handcal"]["rig_from_head"])
    left, right, up, down = np.tan(data["fov"])
    rng = np.random.default_rng(1)
    points_H_m = rng.uniform([-0.15, -0.1, 0.4], [0.15, 0.3, 2.0], (400, 3))
    for eye, side in zip(EYES, (-0.5, 0.5), strict=True):
        display = outcome.record.rig.eyes[eye]
        P = outcome.projection(eye).P @ display.T_V_H
        u, v = ((project(P, points_H_m) + 0.5) / [display.width_px, display.height_px]).T
        shown = (u > 0.0) & (u < 1.0) & (v > 0.0) & (v < 1.0)
        assert np.count_nonzero(shown) > 50
        x, y, z = (
            transform(invert(T_H_N), points_H_m @ UP) - [side * 1e-3 * data["ipd_mm"], 0, 0]
        ).T
        rendered = np.stack(
            [(x / -z - left) / (right - left), (up - y / -z) / (up - down)], axis=-1
        )
        found = np.array([texture_at(data, eye, *point) for point in np.stack([u, v], -1)[shown]])
        off_rad = (found - rendered[shown]) * [right - left, up - down]
        assert np.degrees(np.abs(off_rad)).max() * 60.0 < 0.002


def tracked(T: Float64, turn: str = "orientation") -> dict[str, object]:
    """Return a tracker's pose as in a configuration."""
    quaternion = Rotation.from_matrix(T[:3, :3]).as_quat().tolist()
    return {
        "position": dict(zip("xyz", T[:3, 3].tolist(), strict=True)),
        turn: dict(zip("xyzw", quaternion, strict=True)),
    }


def placed(value: dict[str, Any]) -> Float64:
    turn = value.get("orientation") or value["rotation"]
    return rigid(
        Rotation.from_quat([turn[axis] for axis in "xyzw"]).as_matrix(),
        [value["position"][axis] for axis in "xyz"],
    )


def test_trackers_stay_where_they_are(tmp_path: Path, outcome: SessionOutcome) -> None:
    T_H_slam, T_H_leap = rigid([0.3, -0.1, 0.2], [0.01, 0.06, -0.09]), rigid([0.1, 0.7, 0.0])
    in_unity = np.diag([1.0, 1.0, -1.0, 1.0])
    former = {
        "leftEye": {"ellipseMinorAxis": 1.0},
        "baseline": 64.0,
        "FOV": 0.7,
        "leapTracker": {"localPose": tracked(in_unity @ T_H_leap @ in_unity, "rotation")},
        "t265": {"active": True, "P_middleofeyes_to_trackingcenter_oxr": tracked(T_H_slam)},
        "mine": [1, 2],
    }
    path = tmp_path / "mine.json"
    path.write_text(json.dumps(former))
    for _ in range(2):  # again with what it has made itself
        write_northstar(tmp_path, outcome, path)
        for name in ("northstar.json", "northstar_mesh.json"):
            data = load(tmp_path / name)
            assert "FOV" not in data
            assert data["mine"] == [1, 2]
            assert data["t265"]["active"] is True
            T_H_N = np.array(data["handcal"]["rig_from_head"])
            slam = placed(data["t265"]["P_middleofeyes_to_trackingcenter_oxr"])
            np.testing.assert_allclose(T_H_N @ slam, T_H_slam, atol=1e-9)
            leap = in_unity @ placed(data["leapTracker"]["localPose"]) @ in_unity
            np.testing.assert_allclose(T_H_N @ leap, T_H_leap, atol=1e-9)
        path.write_text((tmp_path / "northstar.json").read_text())


@pytest.mark.parametrize(
    "bad",
    [
        {"t265": {"P_middleofeyes_to_trackingcenter_oxr": {"position": {"x": 1}}}},
        {"leapTracker": {"localPose": 3}},
        {"handcal": {"rig_from_head": [[1, 2], [3, 4]]}},
        {"handcal": 7},
    ],
)
def test_a_pose_that_is_none_is_refused(
    tmp_path: Path, outcome: SessionOutcome, bad: dict[str, object]
) -> None:
    (tmp_path / "bad.json").write_text(json.dumps(bad))
    with pytest.raises(FileError, match="not a North Star configuration"):
        write_northstar(tmp_path, outcome, tmp_path / "bad.json")
    assert not (tmp_path / "northstar.json").exists()


def test_the_command_replaces_a_configuration_and_keeps_it(
    tmp_path: Path, outcome: SessionOutcome, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "mine.json"
    path.write_text('{"baseline": 64, "mine": 1}')
    words = ["handcal", "export", str(outcome.record.path), f"--into={path}"]
    words += ["--format=northstar", f"--output={tmp_path / 'out'}"]
    monkeypatch.setattr("sys.argv", words)
    main()
    assert load(path)["kind"] == "polynomial"
    assert json.loads((tmp_path / "mine.json.before").read_text()) == {"baseline": 64, "mine": 1}
    assert path.read_text() == (tmp_path / "out" / "northstar.json").read_text()
    monkeypatch.setattr("sys.argv", [word for word in words if "format" not in word])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 2

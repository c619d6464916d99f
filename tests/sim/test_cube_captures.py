from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handcal.errors import CancelledError, FileError
from handcal.io.files import read_json
from handcal.lab.evaluate.cube_test import judge_captures
from handcal.progress import Progress
from handcal.rig.cube import Cube, CubeError
from handcal.rig.cube_file import read_cube
from handcal.rig.example import example_rig
from handcal.rig.formats import read_intrinsics
from handcal.rig.grid import Grid
from handcal.rig_types import Rig
from handcal.sim.cube_captures import CaptureSettings, write_captures
from handcal.types import Intrinsics

CAMERA = Intrinsics(640, 360, 900.0, 898.5, 322.0, 177.5, (-0.08, 0.05, 0.0004, -0.0003, 0.0))
SETTINGS = CaptureSettings(positions=("left",), poses=1, points=1000, camera=CAMERA)
GRID = Grid(634, 360)


def small_rig() -> Rig:
    """Return the example with displays half as fine."""
    rig = example_rig()
    half = np.diag([0.5, 0.5, 1.0])
    eyes = {
        eye: replace(display, K=half @ display.K, width_px=GRID.width_px, height_px=GRID.height_px)
        for eye, display in rig.eyes.items()
    }
    return replace(rig, eyes=eyes)


def test_a_calibrated_display_draws_the_cube_where_it_is(tmp_path: Path) -> None:
    write_captures(tmp_path, small_rig(), SETTINGS, Progress())
    names = {path.name for path in (tmp_path / "left" / "pose-1").iterdir()}
    virtual = {f"virtual-{drawn}.png" for drawn in ("offline", "solved", "true")}
    assert names == {"real.png"} | virtual
    cube, camera = read_cube(tmp_path / "cube.json"), read_intrinsics(tmp_path / "camera.json")
    assert camera == CAMERA
    test = judge_captures(tmp_path, cube, camera, GRID)
    assert not test.left_out
    errors = {
        row["drawn"]: {name: float(row[name]) for name in row if name.endswith(("_mm", "_deg"))}
        for row in test.rows
    }
    # What is left with the true φ is the test's own: tracking and finding corners.
    assert errors["true"]["err_t_xy_mm"] < 0.15
    assert errors["true"]["err_R_deg"] < 0.3
    assert errors["true"]["err_t_xy_mm"] < errors["solved"]["err_t_xy_mm"] < 2.0
    # About 4 mm to the left, seen on a display at 2 m from half a metre.
    true_m = read_json(tmp_path / "truth.json")["positions"]["left"]["true_shift_m"]
    factor = 1.0 - 1e-3 * errors["offline"]["depth_mm"] / 2.0
    expected_mm = 1e3 * factor * np.linalg.norm(true_m[:2])
    assert errors["offline"]["err_t_xy_mm"] == pytest.approx(expected_mm, rel=0.1)


def test_a_folder_that_holds_something_is_refused(tmp_path: Path) -> None:
    (tmp_path / "note.txt").touch()
    with pytest.raises(FileError, match="not empty"):
        write_captures(tmp_path, small_rig(), SETTINGS, Progress())


def test_what_is_given_up_leaves_nothing(tmp_path: Path) -> None:
    reports: list[str] = []

    def give_up(what: str, _share: float) -> None:
        reports.append(what)
        assert any(tmp_path.rglob("grid.png"))
        if len(reports) == 2:
            raise CancelledError("enough")

    with pytest.raises(CancelledError):
        write_captures(tmp_path, small_rig(), replace(SETTINGS, poses=2), Progress(give_up))
    assert not any(tmp_path.iterdir())


def test_a_cube_too_large_for_the_display_is_refused(tmp_path: Path) -> None:
    settings = replace(SETTINGS, cube=Cube(side_m=0.3, marker_m=0.2))
    with pytest.raises(CubeError, match="smaller"):
        write_captures(tmp_path, small_rig(), settings, Progress())

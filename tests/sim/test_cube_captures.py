from dataclasses import replace
from itertools import product
from pathlib import Path

import cv2
import numpy as np
import pytest

from handcal.core.display import eye_projection
from handcal.core.errors import CancelledError, FileError
from handcal.core.geometry import project, transform
from handcal.core.progress import Progress
from handcal.core.types import Float64, Intrinsics, Rig
from handcal.io.files import read_json
from handcal.lab.evaluate.cube_test import judge_captures
from handcal.register.fuse import FuseSettings
from handcal.register.prior import eye_prior
from handcal.register.results import SolveSettings, solve_session
from handcal.rig.cube.cube import Cube, CubeError
from handcal.rig.cube.cube_file import read_cube
from handcal.rig.cube.track import cube_corners_m
from handcal.rig.displays.grid import Grid
from handcal.rig.example import example_rig
from handcal.rig.formats import read_intrinsics
from handcal.sim.cube_captures import (
    PLACE_SIGMA_M,
    POSITION_M,
    POSITIONS,
    CaptureSettings,
    cube_prior,
    some_cube_pose,
    write_captures,
)
from handcal.sim.hand import make_hand
from handcal.sim.overlay import overlay_by_eye
from handcal.sim.wearer import draw_placement_error

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


def test_the_prior_along_the_line_of_sight_is_the_cameras_stand() -> None:
    def sigmas_m(settings: CaptureSettings) -> Float64:
        return np.sqrt(np.diag(eye_prior(cube_prior(settings)).covariance_m2)[:3])

    aside_m = np.hypot(POSITION_M, PLACE_SIGMA_M)
    assert sigmas_m(SETTINGS) == pytest.approx([aside_m, aside_m, PLACE_SIGMA_M])
    wearer_m = np.sqrt(np.diag(eye_prior().covariance_m2)[:3])
    assert sigmas_m(replace(SETTINGS, prior="wearer")) == pytest.approx(wearer_m)


@pytest.mark.campaign
def test_the_cube_gains_across_the_line_of_sight_and_loses_nothing_along_it() -> None:
    """By the exact model, 20 seeds of five positions each, four alignments at a position."""
    settings, rig = CaptureSettings(), example_rig()
    solve = SolveSettings(fuse=FuseSettings(prior=cube_prior(settings)))
    errors_m = []
    for seed, (number, place) in product(range(1, 21), enumerate(POSITIONS.values())):
        rng = np.random.default_rng([seed, number])
        hand = make_hand(seed)
        true_m = rng.normal(POSITION_M * np.array([*place, 0.0]), PLACE_SIGMA_M)
        alignments = [
            overlay_by_eye(
                rng,
                hand,
                rig,
                {"left": true_m},
                settings.points,
                settings.depth_sigma_m,
                placement_error=draw_placement_error(rng, settings.wearer),
            )
            for _ in range(4)
        ]
        solved_m = solve_session(alignments, rig, solve).eyes["left"].shift_m
        T_E_T = some_cube_pose(rig.eyes["left"], 0.5, rng)
        errors_m.append([drawn_off_m(T_E_T, true_m, drawn) for drawn in (np.zeros(3), solved_m)])
    offline_m, calibrated_m = np.mean(errors_m, axis=0)
    assert (calibrated_m[:2] < offline_m[:2] / 4).all()
    assert calibrated_m[2] <= offline_m[2]


def drawn_off_m(T_E_T: Float64, true_m: Float64, drawn_m: Float64) -> Float64:
    """Return the error, each axis, of a cube drawn with one φ as an eye at another sees it."""
    display, corners_m = example_rig().eyes["left"], cube_corners_m(Cube())
    corners_E_m = transform(T_E_T, corners_m)
    shown_px = project(eye_projection(display, drawn_m), corners_E_m)
    rays = np.linalg.solve(
        eye_projection(display, true_m)[:, :3], np.c_[shown_px, np.ones(len(shown_px))].T
    ).T
    seen = rays[:, :2] / rays[:, 2:]
    _, _, place_m = cv2.solvePnP(corners_m, seen, np.eye(3), None)
    real_m = corners_E_m - true_m
    aside_m = np.abs(seen * real_m[:, 2:] - real_m[:, :2]).mean(axis=0)
    return np.array([*aside_m, abs(place_m[2, 0] - (T_E_T[2, 3] - true_m[2]))])

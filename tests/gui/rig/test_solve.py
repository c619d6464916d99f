"""The jobs, tested against the ground truth of rendered images."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from datetime import datetime, tzinfo
from pathlib import Path
from typing import Any, Self

import cv2
import numpy as np
import pytest

from handcal.cli.main import parse
from handcal.core.display import view_of_eye
from handcal.core.errors import HandcalError
from handcal.core.geometry import invert, rigid
from handcal.io.files import write_json
from handcal.rig.boards.views import ViewsError, WorstView
from handcal.rig.displays.grid import grid_on
from handcal.rig.example import example_rig
from handcal.rig.formats import (
    read_intrinsics,
    read_tracked,
    stereo_json,
    write_intrinsics,
    write_tracked,
)
from handcal.rig.lens.fit import CalibrationVerdict
from handcal.rig.lens.stereo import StereoCalibration
from handcal.rig.rig_file import read_rig, write_rig
from handcal.rig.steps import screen_of
from handcal.sim.photographs import BOARD
from handcal_gui.rig.project_folder import DisplayEntries
from handcal_gui.rig.shots import Shot, look
from handcal_gui.rig.solve import (
    SolvedPart,
    solve_display,
    solve_stereo,
    solve_viewpoint,
)

RIG = example_rig()


def shots_of(photographs: Any, *folders: str, board: Any = None) -> tuple[Shot, ...]:
    paths = [photographs.folder / folder for folder in folders]
    board = board or photographs.work.board
    return look(paths, board)


@pytest.fixture(scope="module")
def display_shots(photographs: Any) -> tuple[tuple[Shot, ...], tuple[Shot, ...]]:
    screen = screen_of(RIG, "left")
    grid = grid_on(screen.width_px, screen.height_px, photographs.work.left.square_px)
    return shots_of(photographs, "grid-left", board=grid.board), shots_of(photographs, "board-left")


def test_the_depth_camera_is_where_it_was(photographs: Any) -> None:
    shots = shots_of(photographs, "depth", "headset")
    solved = solve_stereo(shots, replace(photographs.work.stereo, dropped=("depth-003.png",)))
    assert solved.verdict.name != "bad"
    rows = {row.label: row.cells for row in solved.rows}
    assert rows["If a square is"] == ("25.00 mm", "exactly"), "the ± of the position holds so"
    assert solved.add_to is not None
    rig = solved.add_to(RIG)
    assert np.linalg.norm(rig.T_H_D[:3, 3] - RIG.T_H_D[:3, 3]) < 0.0005
    assert rig.origins["T_H_D"].views == 7
    assert set(solved.residuals_px) == {f"depth-{n:03}.png" for n in range(1, 9) if n != 3}
    assert len(solved.tilts_rad) == 8
    assert all(0 < tilt < 0.8 for tilt in solved.tilts_rad.values())


def test_the_viewpoint_camera_is_kept_in_a_file(photographs: Any, tmp_path: Path) -> None:
    output = tmp_path / "viewpoint.json"
    entries = photographs.work.viewpoint
    solved = solve_viewpoint(shots_of(photographs, "viewpoint"), entries, output)
    assert solved.verdict.name != "bad"
    assert solved.add_to is None
    assert read_intrinsics(output).fx == pytest.approx(photographs.viewpoint.fx, rel=0.003)
    assert solved.rows[1].label == "Focal length fx"
    (uncertainty,) = solved.uncertainties
    assert uncertainty is not None
    compared = solve_viewpoint(
        shots_of(photographs, "viewpoint"), replace(entries, lens="auto"), output
    )
    labels = [row.label for row in compared.lenses]
    assert labels[0] == "No distortion"
    assert labels[-1] == "Fisheye"
    (chosen,) = (row for row in compared.lenses if row.label.endswith(" ✓"))
    assert float(chosen.cells[0]) == pytest.approx(0.075, abs=0.02)
    assert chosen.cells[1].startswith("± 0.")


def test_too_few_images_are_told(photographs: Any, tmp_path: Path) -> None:
    shots = shots_of(photographs, "viewpoint")[:2]
    with pytest.raises(HandcalError, match="at least 3"):
        solve_viewpoint(shots, photographs.work.viewpoint, tmp_path / "v.json")
    assert not (tmp_path / "v.json").exists()


def solve_left(
    photographs: Any, shots: Any, folder: Path, entries: DisplayEntries | None = None
) -> tuple[SolvedPart, SolvedPart]:
    camera = folder / "viewpoint.json"
    write_intrinsics(camera, photographs.viewpoint, "json")
    entries = entries or photographs.work.left
    grids, boards = shots
    return solve_display(grids, boards, entries, "left", RIG, camera)


def test_the_display_is_where_it_was(photographs: Any, display_shots: Any, tmp_path: Path) -> None:
    display, place = solve_left(photographs, display_shots, tmp_path)
    assert (display.verdict.name, place.verdict.name) == ("good", "good")
    assert display.add_to is not None
    found, truth = display.add_to(RIG).eyes["left"], RIG.eyes["left"]
    assert np.linalg.norm(found.t_C0_V_m - truth.t_C0_V_m) < 0.001
    np.testing.assert_allclose(found.K[0, 0], truth.K[0, 0], rtol=0.003)
    assert set(display.residuals_px) == {f"grid-left-{n:03}.png" for n in (1, 2, 3)}
    assert len(place.tilts_rad) == 8


def test_fewer_images_than_the_page_asks_for_are_not_good(
    photographs: Any, display_shots: Any, tmp_path: Path
) -> None:
    grids, boards = display_shots
    display, place = solve_left(photographs, (grids[:2], boards), tmp_path)
    assert display.verdict.name == "needs more views"
    assert "2 images of the grid, take 3 or more" in display.verdict.reason
    assert place.verdict.name == "good"
    display, place = solve_left(photographs, (grids, boards[:7]), tmp_path)
    assert display.verdict == place.verdict
    assert place.verdict.name == "needs more views"
    assert "7 images of the board, take 8 or more" in place.verdict.reason


def test_the_distance_can_be_solved(photographs: Any, display_shots: Any, tmp_path: Path) -> None:
    truth = RIG.eyes["left"]
    arcmin = 60 * np.degrees(2 * np.arctan(40 / truth.K[0, 0]))
    entries = replace(photographs.work.left, distance="solved", square_arcmin=float(arcmin))
    display, _ = solve_left(photographs, display_shots, tmp_path, entries)
    assert display.add_to is not None
    assert display.add_to(RIG).eyes["left"].z_C0_S_m == pytest.approx(truth.z_C0_S_m, rel=0.01)


def test_what_is_missing_is_named(photographs: Any, display_shots: Any, tmp_path: Path) -> None:
    (grids, boards), entries = display_shots, photographs.work.left
    with pytest.raises(HandcalError, match="intrinsics are missing"):
        solve_display(grids, boards, entries, "left", RIG, tmp_path / "none.json")
    with pytest.raises(HandcalError, match="tracked poses of the board are missing"):
        solve_left(photographs, display_shots, tmp_path, replace(entries, tracked=""))
    poses = read_tracked(Path(entries.tracked))
    del poses["board-left-002.png"]
    write_tracked(tmp_path / "some.json", poses)
    some = replace(entries, tracked=str(tmp_path / "some.json"))
    with pytest.raises(ViewsError, match=r"no tracked pose for board-left-002\.png"):
        solve_left(photographs, display_shots, tmp_path, some)


def test_a_stereo_calibration_tells_the_place_instead(
    photographs: Any, display_shots: Any, tmp_path: Path
) -> None:
    file, left = tmp_path / "stereo.json", RIG.eyes["left"]
    stereo = StereoCalibration(
        T_H_D=invert(view_of_eye(left, np.eye(4))) @ rigid([0.02, -0.01, 0.03]),
        covariance=1e-9 * np.eye(6),
        depth=photographs.viewpoint,
        headset=photographs.viewpoint,
        rms_px=0.1,
        residuals_px={"a.png": 0.1},
        spread_rad=0.0,
        spread_m=0.0,
        dropped=(),
        worst=WorstView("a.png", 0.1, "as told"),
        verdict=CalibrationVerdict("good", "as told"),
    )
    write_json(file, stereo_json(stereo))
    entries = replace(photographs.work.left, stereo=str(file), tracked="")
    display, place = solve_left(photographs, (display_shots[0], ()), tmp_path, entries)
    assert display.add_to is not None
    np.testing.assert_allclose(display.add_to(RIG).eyes["left"].t_C0_V_m, left.t_C0_V_m, atol=1e-9)
    assert place.residuals_px == {"a.png": 0.1}


@pytest.fixture
def one_thread() -> Iterator[None]:
    """Keep OpenCV to one thread: in several it adds in an order that differs from run to run."""
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    yield
    cv2.setNumThreads(before)


@pytest.mark.usefixtures("one_thread")
def test_command_and_wizard_write_the_same_bytes(
    photographs: Any, display_shots: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class AtNoon(datetime):
        @classmethod
        def now(cls, tz: tzinfo | None = None) -> Self:
            return cls(2026, 1, 1, 12, tzinfo=tz)

    monkeypatch.setattr("handcal.rig.steps.datetime", AtNoon)
    rig = tmp_path / "rig.yaml"
    write_rig(rig, RIG)
    commanded, entered = tmp_path / "commanded.yaml", tmp_path / "entered.yaml"
    board = (
        *("--kind", BOARD.kind, "--squares", *BOARD.squares, "--square-mm", 1e3 * BOARD.square_m),
        *("--marker-mm", 1e3 * BOARD.marker_m, "--dictionary", BOARD.dictionary),
    )
    stereo, folder = tmp_path / "stereo.json", photographs.folder
    cameras = "--depth", folder / "depth", "--headset", folder / "headset"
    command("stereo", *cameras, *board, "--drop", "depth-003.png", "--output", stereo)
    command("make", "--rig", rig, "--stereo", stereo, "--output", tmp_path / "half.yaml")
    display, _ = solve_left(photographs, display_shots, tmp_path)
    command(
        *("display", folder / "grid-left", "--eye", "left", "--rig", tmp_path / "half.yaml"),
        *("--camera-intrinsics", tmp_path / "viewpoint.json", "--output", commanded),
        *("--tracked", photographs.work.left.tracked, "--board-images", folder / "board-left"),
        *("--distance-m", photographs.work.left.distance_m, *board),
    )
    shots = shots_of(photographs, "depth", "headset")
    depth = solve_stereo(shots, replace(photographs.work.stereo, dropped=("depth-003.png",)))
    assert depth.add_to is not None
    assert display.add_to is not None
    write_rig(entered, display.add_to(depth.add_to(read_rig(rig))))
    assert entered.read_bytes() == commanded.read_bytes()
    assert entered.read_bytes() != rig.read_bytes()


def command(*words: object) -> None:
    """Run ``handcal rig WORDS``."""
    arguments = parse(["rig", *map(str, words)])
    arguments.command(arguments)

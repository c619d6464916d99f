"""The captures of a cube test: planned, taken, and found."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from handcal.camera.viewpoint import ViewpointCamera
from handcal.core.errors import CameraEndError
from handcal.core.geometry import rigid
from handcal.core.types import Intrinsics, UInt8
from handcal.io.images import write_png
from handcal.lab.evaluate.cube_capture import RestWatch, keep_capture, take_at_rest, take_captures
from handcal.lab.evaluate.cube_folder import (
    CapturePlan,
    PlannedCapture,
    find_captures,
    images_in,
    missing_captures,
)
from handcal.rig.cube.cube import Cube, CubeError
from handcal.rig.displays.grid import Grid, draw_grid
from handcal.sim.boards import PictureSettings
from handcal.sim.cube import CubePainter

CUBE, GRID = Cube(), Grid(640, 360)
PLAN = CapturePlan(positions=("centre",), poses=1, drawn=("a",))


@lru_cache(maxsize=1)
def cube_seen() -> UInt8:
    camera = Intrinsics(640, 360, 900.0, 900.0, 320.0, 180.0)
    pose = rigid([0, 0, 0.1], [0, 0, 0.45]) @ rigid([0.5, 0, 0]) @ rigid([0, 0.7, 0])
    painter = CubePainter(CUBE, camera, PictureSettings(samples=2))
    return painter.paint(pose, np.random.default_rng(1))


class Stage(ViewpointCamera):
    """A camera before which a person puts one thing after the other, as asked."""

    def __init__(self, scenes: list[UInt8]) -> None:
        self.name = "Stage"
        self._scenes = iter(scenes)
        self._scene: UInt8 = np.zeros((360, 640), np.uint8)
        self._before: Iterator[UInt8] = iter(())
        self.asked: list[str] = []

    def ask(self, what: str) -> None:
        self.asked.append(what)
        self._before = iter([self._scene])  # waits in the camera
        self._scene = next(self._scenes)

    def read(self) -> tuple[UInt8, int]:
        gray = next(self._before, self._scene)
        return np.repeat(gray[..., None], 3, axis=2), 0

    def close(self) -> None:
        pass


def test_it_takes_what_is_missing_and_asks_again_where_nothing_is_seen(tmp_path: Path) -> None:
    dark = np.zeros((360, 640), np.uint8)
    stage, said = Stage([draw_grid(GRID), dark, cube_seen(), cube_seen()]), list[str]()
    take_captures(stage, tmp_path, PLAN, CUBE, GRID, stage.ask, said.append)
    assert stage.asked == [
        "centre: show the grid on the display, darken the room",
        "centre/pose-1: switch the display off",
        "centre/pose-1: switch the display off",
        "centre/pose-1: show the virtual cube, cover the real one (a)",
    ]
    assert said[1:] == [
        "Not taken: the image is too dark: add light, or lengthen the exposure",
        "centre/pose-1/real.png: 3 faces of the cube",
        "centre/pose-1/virtual-a.png: 3 faces of the cube",
    ]
    assert said[0].startswith("centre/grid.png: ")
    poses, incomplete = find_captures(tmp_path)
    assert [pose.virtual.keys() for pose in poses] == [{"a"}]
    assert not incomplete
    assert missing_captures(tmp_path, PLAN) == []


def test_an_image_replaces_an_earlier_one_only_if_the_cube_is_seen(tmp_path: Path) -> None:
    capture = PlannedCapture("a/1", "real")
    seen = np.repeat(cube_seen()[..., None], 3, axis=2)
    earlier = tmp_path / "a" / "1" / "real.jpg"
    earlier.parent.mkdir(parents=True)
    earlier.write_bytes(b"")
    with pytest.raises(CubeError, match="dark"):
        keep_capture(np.zeros_like(seen), tmp_path, capture, CUBE, GRID)
    assert images_in(earlier.parent) == {"real": earlier}
    assert keep_capture(seen, tmp_path, capture, CUBE, GRID) == "3 faces of the cube"
    write_png(tmp_path / "expected.png", seen)
    kept = images_in(earlier.parent)["real"]
    assert kept.read_bytes() == (tmp_path / "expected.png").read_bytes()


@lru_cache(maxsize=1)
def cube_drawn() -> UInt8:
    """Return the cube as a display draws it: bright in the dark, slightly beside the real one."""
    moved = np.roll(cube_seen(), 2, axis=1).astype(np.float32)
    return (0.6 * moved).astype(np.uint8)


def look(scene: UInt8, number: int) -> UInt8:
    """Return an RGB image of a scene, with noise of its own."""
    noise = np.random.default_rng(number).normal(0.0, 2.0, scene.shape)
    return np.repeat(np.clip(scene + noise, 0, 255).astype(np.uint8)[..., None], 3, axis=2)


REAL, DRAWN = PlannedCapture("a/1", "real"), PlannedCapture("a/1", "virtual")


class Watched:
    """A watch that sees an image every 0.3 s."""

    def __init__(self) -> None:
        self._watch = RestWatch(CUBE, GRID)
        self._looks = 0

    def say(self, scene: UInt8, capture: PlannedCapture, looks: int = 1) -> str:
        for _ in range(looks):
            self._looks += 1
            said = self._watch.consider(
                look(scene, self._looks), capture, 300_000_000 * self._looks
            )
        return said


def test_a_cube_is_taken_once_it_is_at_rest() -> None:
    watched = Watched()
    assert "moves" in watched.say(cube_seen(), REAL, 2)
    assert "moves" in watched.say(np.roll(cube_seen(), 4, axis=1), REAL, 2)
    assert watched.say(np.roll(cube_seen(), 4, axis=1), REAL) == ""


def test_a_hand_before_the_real_cube_does_not_make_it_a_drawn_one() -> None:
    watched = Watched()
    assert watched.say(cube_seen(), REAL, 3) == ""
    assert "taken last" in watched.say(cube_seen(), DRAWN, 4)
    assert "dark" in watched.say(np.zeros_like(cube_seen()), DRAWN)
    assert "taken last" in watched.say(cube_seen(), DRAWN, 4)
    assert "dark" in watched.say(np.zeros_like(cube_seen()), DRAWN)
    assert watched.say(cube_drawn(), DRAWN, 3) == ""


class Film(ViewpointCamera):
    """A camera that sees scenes one after the other, each for a second, at 5 frames a second."""

    def __init__(self, scenes: list[UInt8]) -> None:
        self.name = "Film"
        self._frames = iter(scene for scene in scenes for _ in range(5))
        self._count = 0

    def read(self) -> tuple[UInt8, int]:
        scene = next(self._frames, None)
        if scene is None:
            raise CameraEndError("the film has ended")
        self._count += 1
        return look(scene, self._count), 200_000_000 * self._count

    def close(self) -> None:
        pass


def test_captures_are_taken_by_themselves(tmp_path: Path) -> None:
    dark, said = np.zeros((360, 640), np.uint8), list[str]()
    film = Film([draw_grid(GRID), dark, cube_seen(), dark, cube_drawn()])
    take_at_rest(film, tmp_path, PLAN, CUBE, GRID, said.append)
    assert missing_captures(tmp_path, PLAN) == []
    assert [line for line in said if line.startswith("centre")] == [
        "centre: show the grid on the display, darken the room",
        said[2],
        "centre/pose-1: switch the display off",
        "centre/pose-1/real.png: 3 faces of the cube",
        "centre/pose-1: show the virtual cube, cover the real one (a)",
        "centre/pose-1/virtual-a.png: 3 faces of the cube",
    ]
    assert said[2].startswith("centre/grid.png: ")


def touch(folder: Path, *files: str) -> None:
    for file in files:
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        (folder / file).touch()


def test_a_plan_is_gone_through_position_by_position() -> None:
    plan = CapturePlan(positions=("left", "right"), poses=1, drawn=("a", "b"))
    assert [capture.file for capture in plan.captures] == [
        f"{position}/{file}.png"
        for position in ("left", "right")
        for file in ("grid", "pose-1/real", "pose-1/virtual-a", "pose-1/virtual-b")
    ]


def test_what_is_there_in_any_format_is_not_missing(tmp_path: Path) -> None:
    plan = CapturePlan(positions=("left",), poses=1)
    assert missing_captures(tmp_path / "none", plan) == list(plan.captures)
    touch(tmp_path, "left/grid.JPG", "left/pose-1/real.png", "left/pose-1/virtual.txt")
    (missing,) = missing_captures(tmp_path, plan)
    assert missing.file == "left/pose-1/virtual.png"
    touch(tmp_path, missing.file)
    assert missing_captures(tmp_path, plan) == []
    (found,), incomplete = find_captures(tmp_path)
    assert (found.position, found.pose, found.real.name) == ("left", "pose-1", "real.png")
    assert not incomplete


@pytest.mark.parametrize(
    ("positions", "drawn", "message"),
    [
        (("../other",), (), "letters, digits, _ and -, not '../other'"),
        (("a",), ("b c",), "not 'b c'"),
        (("a", "b", "a"), (), "a is named twice"),
        ((), (), "at least one"),
    ],
)
def test_names_that_make_no_plan_are_refused(
    positions: tuple[str, ...], drawn: tuple[str, ...], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        CapturePlan(positions=positions, drawn=drawn)

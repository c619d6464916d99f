from pathlib import Path

import pytest

from handcal.core.errors import FileError
from handcal.lab.evaluate.cube_folder import CapturePlan, find_captures, missing_captures


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


def test_a_plan_without_grid_and_with_one_way_of_drawing() -> None:
    plan = CapturePlan(positions=("left",), poses=2, with_grid=False)
    names = [(capture.where, capture.name) for capture in plan.captures]
    assert names == [(f"left/pose-{pose}", name) for pose in (1, 2) for name in ("real", "virtual")]


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


def test_an_unreadable_folder_is_reported(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="cannot read"):
        find_captures(tmp_path / "none")


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

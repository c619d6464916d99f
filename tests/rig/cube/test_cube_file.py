from pathlib import Path

import pytest

from handcal.core.errors import FileError
from handcal.io.files import write_json
from handcal.rig.cube import Cube, read_cube, write_cube


def test_a_cube_comes_back(tmp_path: Path) -> None:
    cube = Cube(0.0523, 0.0401, "DICT_5X5_50", (6, 1, 2, 3, 9, 5))
    write_cube(tmp_path / "cube.json", cube)
    assert read_cube(tmp_path / "cube.json") == cube


@pytest.mark.parametrize(
    ("values", "why"),
    [
        ({}, "handcal_cube must be 1"),
        ({"handcal_cube": 2}, "handcal_cube must be 1"),
        ({"handcal_cube": 1, "edge_m": 0.06}, "has no edge_m"),
        ({"handcal_cube": 1, "side_m": "60"}, "side_m must be a finite number"),
        ({"handcal_cube": 1, "ids": [0, 1]}, "a list of 6 values"),
        ({"handcal_cube": 1, "side_m": 60.0}, "10 mm and 1 m"),
    ],
)
def test_another_file_is_refused(tmp_path: Path, values: dict[str, object], why: str) -> None:
    write_json(tmp_path / "cube.json", values)
    with pytest.raises(FileError, match=why):
        read_cube(tmp_path / "cube.json")

import json
from pathlib import Path

import numpy as np
import pytest

from handcal.core.errors import FileError
from handcal.core.geometry import rigid
from handcal.rig.formats import read_tracked, write_tracked


def test_poses_come_back_exactly(tmp_path: Path) -> None:
    poses = {"a.png": rigid([0.1, 0.2, 0.3], [0.1, 0.2, 0.5]), "b.png": np.eye(4)}
    write_tracked(tmp_path / "poses.json", poses)
    found = read_tracked(tmp_path / "poses.json")
    assert list(found) == ["a.png", "b.png"]
    for name, T in poses.items():
        np.testing.assert_array_equal(found[name], T)


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        ({}, "handcal_tracked must be 1"),
        ({"handcal_tracked": 2, "T_H_B": {}}, "handcal_tracked must be 1"),
        ({"handcal_tracked": 1, "T_H_B": []}, "T_H_B must hold"),
        ({"handcal_tracked": 1, "T_H_B": {}}, "1 to 500 poses"),
        ({"handcal_tracked": 1, "T_H_B": {"a": "x"}}, "T_H_B of a must be a rigid"),
        ({"handcal_tracked": 1, "T_H_B": {"a": [[1], [2, 3]]}}, "T_H_B of a"),
        ({"handcal_tracked": 1, "T_H_B": {"a": np.zeros((4, 4)).tolist()}}, "T_H_B of a"),
        ({"handcal_tracked": 1, "T_H_B": {"a": np.eye(3).tolist()}}, "T_H_B of a"),
    ],
)
def test_what_is_no_set_of_poses_is_named(tmp_path: Path, content: object, problem: str) -> None:
    path = tmp_path / "poses.json"
    path.write_text(json.dumps(content))
    with pytest.raises(FileError, match=problem):
        read_tracked(path)


@pytest.mark.parametrize("text", ["", "{}"])
def test_another_file_says_which_to_choose(tmp_path: Path, text: str) -> None:
    (tmp_path / "depth.json").write_text(text)
    with pytest.raises(FileError, match="; choose the file of tracked poses"):
        read_tracked(tmp_path / "depth.json")

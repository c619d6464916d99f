from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handcal.core.errors import FileError
from handcal.rig.boards.board import Board
from handcal.rig.example import example_rig
from handcal_gui.rig.project_folder import (
    DisplayEntries,
    ProjectFolder,
    RigInputs,
    StereoEntries,
)


def test_what_was_entered_is_there_again(tmp_path: Path) -> None:
    work = RigInputs(
        board=Board("checkerboard", (9, 7), 0.03),
        paper="a3",
        stereo=StereoEntries(depth_images="d", lens="rational", dropped=("a.png",)),
        right=DisplayEntries(distance="solved", square_arcmin=100.5),
    )
    ProjectFolder(tmp_path / "rig").save(work)
    assert ProjectFolder(tmp_path / "rig").load() == (work, "")


def test_the_rig_is_there_again(tmp_path: Path) -> None:
    folder = ProjectFolder(tmp_path)
    folder.save_rig(replace(example_rig(), name="ours"))
    rig, complaint = ProjectFolder(tmp_path).load_rig()
    assert (rig.name, complaint) == ("ours", "")
    np.testing.assert_array_equal(rig.T_H_D, example_rig().T_H_D)


@pytest.mark.parametrize("text", ["{", '{"board": {"squares": [1, 1]}}', '{"unknown": 1}'])
def test_broken_entries_are_set_aside(tmp_path: Path, text: str) -> None:
    (tmp_path / "work.json").write_text(text)
    work, complaint = ProjectFolder(tmp_path).load()
    assert work == RigInputs()
    assert "work.json.bad" in complaint
    assert (tmp_path / "work.json.bad").read_text() == text


def test_a_broken_rig_is_set_aside(tmp_path: Path) -> None:
    (tmp_path / "rig.yaml").write_text("handcal_rig: 99")
    rig, complaint = ProjectFolder(tmp_path).load_rig()
    assert rig.name == example_rig().name
    assert "rig.yaml.bad" in complaint


def test_no_folder_is_reported(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(FileError, match="file"):
        ProjectFolder(tmp_path / "file")

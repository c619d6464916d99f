"""The example session: copied once, and then the user's own."""

from __future__ import annotations

from pathlib import Path

import pytest

from handcal.core.errors import FileError
from handcal.core.types import EYES
from handcal.session.session import Session
from handcal_gui.calibrate.start.example import copy_example


def test_the_example_is_copied_once_and_is_complete(tmp_path: Path) -> None:
    path = copy_example(tmp_path / "sessions")
    record = Session.open(path)
    assert record.is_finished
    assert record.is_solved
    assert {eye for alignment in record.alignments.values() for eye in alignment.eyes} == set(EYES)
    assert {(trial.eye, trial.target_depth_m) for trial in record.trials.values()} == {
        (eye, depth_m) for eye in EYES for depth_m in (0.4, 0.5, 0.6)
    }
    with Session(path) as session:
        session.save_notes("my own")
    assert Session.open(copy_example(tmp_path / "sessions")).notes == "my own"
    assert [entry.name for entry in path.parent.iterdir()] == [path.name]


def test_a_folder_that_cannot_be_written_is_said(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(FileError, match="file"):
        copy_example(tmp_path / "file")

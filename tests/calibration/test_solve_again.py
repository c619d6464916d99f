from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handcal.calibration.solve_again import solve_again, stored_solve_settings
from handcal.core.errors import FileError
from handcal.core.types import Alignment
from handcal.register.results import SolveSettings
from handcal.rig.example import example_rig
from handcal.session.session import Session, SessionRecord


@pytest.fixture
def record(tmp_path: Path) -> SessionRecord:
    settings = {"calibration": {"solve": {"method": "linear"}}}
    with Session.create(tmp_path, example_rig(), settings) as session:
        return Session.open(session.path)


def test_settings_are_the_session_s_own(record: SessionRecord) -> None:
    assert stored_solve_settings(record).method == "linear"
    assert stored_solve_settings(replace(record, settings={})) == SolveSettings()


def test_settings_that_cannot_be_read_are_named_with_their_file(record: SessionRecord) -> None:
    wrong = replace(record, settings={"calibration": {"solve": {"method": "guess"}}})
    with pytest.raises(FileError, match=r"settings.json: calibration.solve.method must be one of"):
        stored_solve_settings(wrong)


def test_nothing_comes_of_no_alignment(record: SessionRecord) -> None:
    assert solve_again(record, SolveSettings()) is None


def test_what_cannot_be_solved_is_named(record: SessionRecord, alignment: Alignment) -> None:
    none = replace(alignment, hand_m=np.empty((0, 3)), hand_is_cut=np.empty(0, bool))
    hopeless = replace(record, alignments={1: none})
    with pytest.raises(FileError, match=f"{record.path.name} cannot be solved"):
        solve_again(hopeless, SolveSettings())

from __future__ import annotations

from pathlib import Path

import pytest

from handcal.core.types import Rig
from handcal.session.session import Session
from handcal_gui.widgets.times import local_time, session_time


def test_a_time_is_local() -> None:
    assert local_time("2026-11-21T12:34:56+00:00", "%M:%S") == "34:56"


@pytest.mark.parametrize("text", ["before noon", "", "0001-01-01T00:00:00+14:00"])
def test_what_is_no_time_is_shown_as_it_is(text: str) -> None:
    assert local_time(text) == text


def test_the_time_of_a_session_is_read_from_its_folder(tmp_path: Path, rig: Rig) -> None:
    with Session.create(tmp_path, rig, {}) as session:
        pass
    assert session_time(session.path.name) != session.path.name
    assert session_time("session-20261121-123456-000001") == local_time("2026-11-21T12:34:56Z")
    assert session_time("ada-1") == "ada-1"

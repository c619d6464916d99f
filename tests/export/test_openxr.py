"""The OpenXR layer is installed for one user, and a calibration is in force for one wearer."""

from __future__ import annotations

import json
import os
import shutil
from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from handcal.calibration.solve_again import Former
from handcal.core.errors import FileError
from handcal.export import openxr
from handcal.export.openxr import install_layer, layer_status, remove_layer, use_calibration
from handcal.io.resources import resource_path
from handcal.rig.rig_file import read_rig, write_rig
from handcal.session.in_force import end_at_begin, in_force_path
from handcal.session.session import Session, open_session
from handcal.station.settings import HeadsetKind, StationSettings
from handcal.station.station import resume_or_create

EXAMPLE = resource_path("example_session")


@pytest.fixture(autouse=True)
def user(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Give the test a user of its own, and a layer that has been built."""
    for name in ("XDG_CONFIG_HOME", "XDG_DATA_HOME"):
        monkeypatch.setenv(name, str(tmp_path / name))
    shipped = tmp_path / "shipped.so"
    shipped.write_bytes(b"a layer")
    monkeypatch.setattr(openxr, "_shipped_library", lambda: shipped)
    return tmp_path


@pytest.fixture
def session(tmp_path: Path) -> Path:
    return Path(shutil.copytree(EXAMPLE, tmp_path / "session"))


def test_installing_and_removing_leave_nothing(user: Path) -> None:
    assert not layer_status().is_installed
    manifest = install_layer()
    assert manifest == user / "XDG_DATA_HOME/openxr/1/api_layers/implicit.d/handcal.json"
    layer = json.loads(manifest.read_text())["api_layer"]
    assert Path(layer["library_path"]).read_bytes() == b"a layer"
    assert layer["disable_environment"] == openxr.OFF
    assert layer_status().is_current
    (user / "shipped.so").write_bytes(b"a newer layer")
    assert layer_status().is_installed
    assert not layer_status().is_current
    with Path(layer["library_path"]).open("rb") as running:
        install_layer()
        assert running.read() == b"a layer"  # a program that runs keeps what it has loaded
    assert layer_status().is_current
    use_calibration(open_session(EXAMPLE))
    assert remove_layer()
    assert not remove_layer()
    assert {one.name for one in user.rglob("*") if one.is_file()} == {"shipped.so"}


def test_a_calibration_is_in_force_for_twelve_hours_or_is_kept(session: Path) -> None:
    record = open_session(session)
    use_calibration(record)
    one = layer_status().in_force
    assert one is not None
    assert (one.wearer, one.session, one.headset) == (record.wearer, "session", record.rig.name)
    assert one.left_s == pytest.approx(12 * 3600, abs=10)
    use_calibration(record, keep=True)
    os.utime(in_force_path(), (0, 0))
    one = layer_status().in_force
    assert one is not None
    assert one.left_s is None
    assert one.age_s > 1e9


def test_it_ends_as_its_session_is_closed_or_another_begins(session: Path, tmp_path: Path) -> None:
    other = Path(shutil.copytree(EXAMPLE, tmp_path / "other"))
    for keep in (False, True):
        with Session(session):
            use_calibration(open_session(session), keep=keep)
            with Session(other):  # not a calibration: somebody corrects its notes
                pass
            assert in_force_path().exists()
        assert in_force_path().exists() == keep
    end_at_begin(other)
    assert in_force_path().exists()  # kept, and the rig is the same
    rig = read_rig(other / "rig.yaml")
    eye = rig.eyes["left"]
    moved = np.add(eye.t_C0_V_m, [0.001, 0.0, 0.0])
    write_rig(
        other / "rig.yaml", replace(rig, eyes={**rig.eyes, "left": replace(eye, t_C0_V_m=moved)})
    )
    end_at_begin(other)
    assert not in_force_path().exists()
    use_calibration(open_session(session))
    end_at_begin(session)
    assert not in_force_path().exists()


def test_the_next_wearers_session_ends_it(tmp_path: Path) -> None:
    use_calibration(open_session(EXAMPLE))
    for headset in get_args(HeadsetKind):
        settings = StationSettings(sessions=str(tmp_path / headset), headset=headset)
        with resume_or_create(settings, "next wearer", None, Former()):
            # A simulated wearer wears nothing.
            assert in_force_path().exists() == (headset == "virtual")
            use_calibration(open_session(EXAMPLE))


def test_what_the_layer_did_last_is_shown_as_plain_text(user: Path) -> None:
    use_calibration(open_session(EXAMPLE))
    told = {"state": "refused", "reason": "a \x1b[31m knob", "application": 7}
    (in_force_path().parent / "openxr-status.json").write_text(json.dumps(told))
    last = layer_status().last_program
    assert last is not None
    assert str(last) == "Last program: 7 on  (), 0 min ago: refused, a \ufffd[31m knob"


def test_damaged_files_are_named() -> None:
    use_calibration(open_session(EXAMPLE))
    in_force_path().write_text('{"expiresUnixS": "soon"}')
    with pytest.raises(FileError, match=r"openxr\.json is damaged; put a calibration"):
        layer_status()
    end_at_begin(EXAMPLE)
    assert layer_status().in_force is None

"""Preferences come back as they were; a damaged file costs nothing but the preferences."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtCore import QStandardPaths

from handcal.calibration.states import CalibrationSettings
from handcal.core.errors import FileError
from handcal.export.export import ExportSettings
from handcal.register.guard import GuardSettings
from handcal.station.settings import StationSettings
from handcal_gui.app.preferences import (
    PREFERENCES_VERSION,
    CurrentPreferences,
    Preferences,
    PreferencesFile,
)

CHANGED = Preferences(
    station=StationSettings(
        source="realsense",
        headset="network",
        port=50_000,
        calibration=CalibrationSettings(guard=GuardSettings(limit_rad=0.1)),
    ),
    plan="both",
    sessions=("/a/b",),
    export=ExportSettings(formats=("report", "zip"), near_m=0.2),
    export_folder="/c",
    fine_tune_step_m=1e-3,
    hidden_layers=("cursor",),
    theme="dark",
    geometry="AAAA",
    layout="BBBB",
)


@pytest.fixture
def file(tmp_path: Path) -> PreferencesFile:
    return PreferencesFile(tmp_path / "config" / "preferences.json")


def test_the_first_start_has_defaults_in_the_users_own_folders(file: PreferencesFile) -> None:
    preferences, problem = file.load()
    assert preferences == Preferences()
    assert problem == ""
    documents = QStandardPaths.StandardLocation.DocumentsLocation
    assert preferences.station.sessions.startswith(QStandardPaths.writableLocation(documents))


def test_a_folder_that_cannot_be_reached_is_reported(tmp_path: Path) -> None:
    current = CurrentPreferences(PreferencesFile(tmp_path / ("n" * 300) / "preferences.json"), True)
    assert current.now == Preferences()
    assert "File name too long" in current.complaint


def test_preferences_come_back(file: PreferencesFile) -> None:
    file.save(CHANGED)
    assert file.load() == (CHANGED, "")


@pytest.mark.parametrize("station", [3, None, {"calibration": []}, {"calibration": {"solve": 1}}])
def test_a_strange_value_is_kept_and_named_in_the_log(
    file: PreferencesFile, station: object, caplog: pytest.LogCaptureFixture
) -> None:
    file.path.parent.mkdir()
    file.path.write_text(json.dumps({"version": PREFERENCES_VERSION, "station": station}))
    preferences, said = file.load()
    assert preferences == Preferences()
    assert "were reset: check the start page and Preferences" in said
    assert file.path.with_name("preferences.json.bad").exists()
    assert "preferences.station" not in said  # no name of a field: the log has it
    assert "preferences.station" in caplog.text


@pytest.mark.parametrize("version", [0, 3, 5, "4", True, 4.0, None])
def test_another_version_is_refused_and_kept(
    file: PreferencesFile, version: object, caplog: pytest.LogCaptureFixture
) -> None:
    file.save(CHANGED)
    stored = json.dumps(json.loads(file.path.read_text()) | {"version": version})
    file.path.write_text(stored)
    preferences, said = file.load()
    assert preferences == Preferences()
    assert "were reset: check the start page and Preferences" in said
    assert "\n" not in said
    assert f"preferences.version is {version!r}, not 4" in caplog.text
    assert file.path.with_name("preferences.json.bad").read_text() == stored


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\xff\xfe",
        b"[]",
        b"[" * 100_000,
        b'{"version": 4, "theme": "pink"}',
        b'{"version": 4, "sessions": [1]}',
        b'{"version": 4, "export": {"formats": []}}',
        b'{"version": 4, "station": {"port": 1.5}}',
        b'{"version": 4, "later_version": 1}',
        b'{"version": 4, "": 1}',
        b" " * (16 * 2**20 + 1),
    ],
)
def test_a_bad_file_is_kept_beside(file: PreferencesFile, tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "config" / "preferences.json"
    path.parent.mkdir()
    path.write_bytes(content)
    preferences, problem = file.load()
    assert preferences == Preferences()
    assert "preferences.json.bad" in problem
    assert path.with_name("preferences.json.bad").read_bytes() == content
    assert file.load() == (Preferences(), "")


def test_what_cannot_be_saved_is_reported_and_leaves_the_old(
    file: PreferencesFile, monkeypatch: pytest.MonkeyPatch
) -> None:
    file.save(CHANGED)

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(FileError, match="No space left"):
        file.save(Preferences())
    assert file.load() == (CHANGED, "")


def test_sessions_are_remembered_newest_first(tmp_path: Path) -> None:
    preferences = Preferences()
    for name in ("a", "b", "a"):
        preferences = preferences.with_session(tmp_path / name)
    assert preferences.sessions == (str(tmp_path / "a"), str(tmp_path / "b"))
    for number in range(30):
        preferences = preferences.with_session(tmp_path / str(number))
    assert len(preferences.sessions) == 8
    assert preferences.sessions[0] == str(tmp_path / "29")


def test_the_pairing_key_is_made_once_and_apart(file: PreferencesFile, tmp_path: Path) -> None:
    key = file.pairings().open_key()
    assert file.pairings().open_key() == key
    path = tmp_path / "config" / "pairing.key"
    if os.name == "posix":
        assert path.stat().st_mode & 0o077 == 0
    file.save(replace(CHANGED, theme="light"))
    assert key not in json.dumps((tmp_path / "config" / "preferences.json").read_text())
    renewed = file.renew_pairing_key().open_key()
    assert renewed != key
    assert file.pairings().open_key() == renewed


@pytest.mark.parametrize("content", [b"", b"short", b"\xff" * 20, b"k" * 5000])
def test_a_damaged_key_is_said_and_replaced_only_on_request(
    file: PreferencesFile, tmp_path: Path, content: bytes
) -> None:
    path = tmp_path / "config" / "pairing.key"
    path.parent.mkdir()
    path.write_bytes(content)
    with pytest.raises(FileError, match=r"pairing\.key"):
        file.pairings()
    assert path.read_bytes() == content
    assert len(file.renew_pairing_key().open_key()) == 32

"""The support bundle: what it holds, and that no name is in it."""

from __future__ import annotations

import zipfile
from dataclasses import replace
from pathlib import Path

import pytest

from handcal.core.errors import CancelledError, FileError
from handcal.core.progress import Progress
from handcal.rig.example import example_rig
from handcal.session.library import delete_session
from handcal.session.session import Session
from handcal.station.checks import support
from handcal.station.checks.doctor import Finding, Health
from handcal.station.checks.support import (
    SupportSettings,
    default_settings,
    run_support,
    without_names,
)

WEARERS = ("Ada Lovelace", "P-07", "Zoë")


@pytest.fixture
def settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> SupportSettings:
    found = [Finding("Disk", Health.GOOD, "of ada lovelace", "ask ZOË")]
    monkeypatch.setattr(support, "examine", lambda: found)
    folder = tmp_path / "config"
    folder.mkdir()
    home = Path.home()
    (folder / "handcal.log").write_text(
        f"WARNING cannot read {home}/sessions/p-07/journal.jsonl\nADA LOVELACE Zoë P-071\n"
    )
    (folder / "pairing.key").write_text("a secret of the tests")
    with Session.create(tmp_path / "sessions", example_rig(), {}, wearer=WEARERS[1]) as one:
        one.correct_wearer("P-08")  # the log may hold either name
    for wearer in (WEARERS[0], WEARERS[2]):
        Session.create(tmp_path / "sessions", example_rig(), {}, wearer=wearer).close()
    return SupportSettings(folder, tmp_path / "sessions")


def contents(path: Path) -> dict[str, str]:
    with zipfile.ZipFile(path) as bundle:
        return {name: bundle.read(name).decode(errors="replace") for name in bundle.namelist()}


def test_it_holds_checks_versions_and_log_but_no_name(
    tmp_path: Path, settings: SupportSettings
) -> None:
    output = tmp_path / "out" / "bundle.zip"
    written = run_support(output, settings)
    found = contents(output)
    assert tuple(found) == written
    assert set(found) == {"README.txt", "doctor.txt", "versions.txt", "handcal.log"}
    assert "Disk: of [wearer] -> ask [wearer]" in found["doctor.txt"]
    assert "numpy " in found["versions.txt"]
    assert "~/sessions/[wearer]/journal.jsonl" in found["handcal.log"]
    assert "P-071" in found["handcal.log"]  # another word
    everything = "\n".join(found.values()).replace("P-071", "")
    for name in (*WEARERS, str(Path.home()), "a secret of the tests"):
        assert name.casefold() not in everything.casefold()
    assert [one.name for one in output.parent.iterdir()] == ["bundle.zip"]


def test_a_folder_that_holds_no_names_is_refused_and_nothing_is_written(
    tmp_path: Path, settings: SupportSettings
) -> None:
    """A mistyped folder, or the session itself, would leave the names in the log."""
    output = tmp_path / "bundle.zip"
    session, *_ = (tmp_path / "sessions").iterdir()
    (tmp_path / "empty").mkdir()
    for given, what in (("tpyo", "is not a folder"), ("empty", "holds no session"), (session, "")):
        wrong = replace(settings, sessions=(tmp_path / "sessions", tmp_path / given))
        with pytest.raises(FileError, match=f"{what}.*; give the folder in which the sessions are"):
            run_support(output, wrong)
    assert not output.exists()
    assert run_support(output, replace(settings, session_folder=tmp_path / "of no session yet"))


def test_names_of_further_and_of_deleted_sessions_are_taken_out(
    tmp_path: Path, settings: SupportSettings
) -> None:
    log = settings.log_folder / "handcal.log"
    log.write_text("Grace and P-07 and P-08")
    with Session.create(tmp_path / "more", example_rig(), {}, wearer="Grace"):
        pass
    for session in [*(tmp_path / "sessions").iterdir()]:
        delete_session(session)
    run_support(tmp_path / "bundle.zip", replace(settings, sessions=(tmp_path / "more",)))
    found = contents(tmp_path / "bundle.zip")["handcal.log"]
    assert found == "[wearer] and [wearer] and [wearer]"


def test_frames_only_if_wanted(tmp_path: Path, settings: SupportSettings) -> None:
    folder = tmp_path / "recording"
    (folder / "depth").mkdir(parents=True)
    (folder / "depth" / "1.png").write_bytes(b"a frame")
    output = tmp_path / "bundle.zip"
    with_frames = SupportSettings(settings.log_folder, frames=folder)
    assert "frames/depth/1.png" in run_support(output, with_frames)
    assert contents(output)["frames/depth/1.png"] == "a frame"
    run_support(output, settings)  # replaces it
    assert not any(name.startswith("frames") for name in contents(output))


def test_missing_or_huge_frames_are_said(
    tmp_path: Path, settings: SupportSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    output, frames = tmp_path / "bundle.zip", tmp_path / "hand.db3"
    wanted = SupportSettings(settings.log_folder, frames=frames)
    with pytest.raises(FileError, match="there are no frames in"):
        run_support(output, wanted)
    frames.write_bytes(b"12345")
    monkeypatch.setattr(support, "MAX_FRAMES_BYTES", 4)
    with pytest.raises(FileError, match="choose a recording of at most"):
        run_support(output, wanted)
    assert not output.exists()


def test_nothing_stays_of_a_cancelled_bundle(tmp_path: Path, settings: SupportSettings) -> None:
    frames = tmp_path / "hand.db3"
    frames.write_bytes(b"12345")
    asked = 0

    def is_cancelled() -> bool:
        nonlocal asked
        asked += 1
        return asked > 2

    wanted = SupportSettings(settings.log_folder, frames=frames)
    with pytest.raises(CancelledError):
        run_support(tmp_path / "out" / "bundle.zip", wanted, Progress(is_cancelled=is_cancelled))
    assert list((tmp_path / "out").iterdir()) == []


def test_a_damaged_log_or_preferences_is_no_obstacle(
    tmp_path: Path, settings: SupportSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(support, "configuration_folder", lambda: settings.log_folder)
    for content in (b"\xff{", b'{"station": []}', b'{"station": {"sessions": 3}}'):
        (settings.log_folder / "preferences.json").write_bytes(content)
        assert default_settings() == SupportSettings(settings.log_folder)
    (settings.log_folder / "handcal.log").write_bytes(b"\xff\x00 torn")
    assert "handcal.log" in run_support(tmp_path / "bundle.zip", settings)


def test_longer_names_go_first() -> None:
    assert without_names("Ann and Ann Lee", {"Ann", "Ann Lee"}) == "[wearer] and [wearer]"

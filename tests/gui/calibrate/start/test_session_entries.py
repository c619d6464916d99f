"""Texts of the start page for sessions that can be resumed, opened, or neither."""

from __future__ import annotations

import os
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

from handcal.core.types import Alignment
from handcal.io.lock import FileLock
from handcal.rig.example import example_rig
from handcal.session.library import EyeOutcome
from handcal.session.repair import repair_session
from handcal.session.session import Session
from handcal.session.state import VERIFYING
from handcal_gui.calibrate.start.session_entries import find_sessions
from tests.gui.views import VERIFIED


def make(folder: Path, wearer: str, alignments: Sequence[Alignment], *, is_done: bool) -> Path:
    with Session.create(folder, example_rig(), {}, name=f"s-{wearer}", wearer=wearer) as session:
        for alignment in alignments:
            session.save_alignment(alignment)
        if is_done:
            session.finish()
    return session.path


def test_unfinished_sessions_are_told_by_wearer_time_and_alignments(
    tmp_path: Path, alignment: Alignment
) -> None:
    path = make(tmp_path, "Ada", [alignment], is_done=False)
    make(tmp_path, "Bea", [alignment], is_done=True)
    make(tmp_path, "Cid", [], is_done=False)
    (entry,) = find_sessions(tmp_path, ()).unfinished
    assert entry.path == path
    assert entry.is_enabled
    assert entry.text.startswith(f"Ada · {datetime.now().astimezone():%Y-%m-%d}")
    assert entry.text.endswith(" · 1 alignment")


def test_sessions_that_were_only_verified_are_offered(tmp_path: Path) -> None:
    for wearer in ("Ada", "Bea"):
        with Session.create(tmp_path, example_rig(), {}, name=wearer, wearer=wearer) as session:
            session.save_facts(verified={"left": VERIFIED})
            if wearer == "Bea":
                session.finish()
    found = find_sessions(tmp_path, ())
    for (entry,), wearer in ((found.unfinished, "Ada"), (found.recent, "Bea")):
        assert entry.wearer == wearer
        assert entry.text.endswith(" · 1 verified eye")


def test_a_session_that_was_interrupted_in_its_first_verification_can_be_resumed(
    tmp_path: Path,
) -> None:
    with Session.create(tmp_path, example_rig(), {}, wearer="Ada") as session:
        session.record(VERIFYING, eye="left")
    (entry,) = find_sessions(tmp_path, ()).unfinished
    assert entry.text.startswith("Ada · ")
    assert entry.text.endswith(" · verification begun")


def test_a_damaged_session_is_reported_with_the_reason(
    tmp_path: Path, alignment: Alignment
) -> None:
    path = make(tmp_path, "Ada", [alignment, alignment], is_done=False)
    (path / "rig.yaml").write_text("nonsense")
    (entry,) = find_sessions(tmp_path, ()).unfinished
    assert entry.is_enabled  # the rest can be resumed
    assert entry.text.endswith(" · 2 alignments · damaged: 1 part left out")
    (path / "journal.jsonl").write_text("nonsense\n")
    (entry,) = find_sessions(tmp_path, ()).unfinished
    assert not entry.is_enabled
    assert "does not begin as the journal" in entry.text
    assert entry.text.endswith(
        "; make it readable, restore it from a backup, or delete it in All sessions"
    )
    (recent,) = find_sessions(tmp_path / "none", (path,)).recent
    assert recent.text == entry.text
    lock = FileLock(path / "lock")
    (entry,) = find_sessions(tmp_path, ()).unfinished
    lock.release()
    assert "is in use by process" in entry.text
    assert "backup" not in entry.text  # it says itself what to do


def test_of_a_repaired_session_only_the_copy_is_resumed(
    tmp_path: Path, alignment: Alignment
) -> None:
    path = make(tmp_path, "Ada", [alignment, alignment], is_done=False)
    (path / "alignments" / "1.npz").unlink()
    repair_session(path, tmp_path / "copy")
    found = find_sessions(tmp_path, ())
    assert [entry.path.name for entry in found.unfinished] == ["copy"]
    assert found.recent == ()


def test_of_a_finished_damaged_session_only_the_repaired_copy_is_offered(
    tmp_path: Path, alignment: Alignment
) -> None:
    path = make(tmp_path, "Ada", [alignment, alignment], is_done=True)
    (path / "alignments" / "1.npz").unlink()
    assert [entry.path for entry in find_sessions(tmp_path, (path,)).recent] == [path]
    repair_session(path, tmp_path / "copy")
    for recent in ((), (path,)):
        found = find_sessions(tmp_path, recent)
        assert [entry.path.name for entry in found.recent] == ["copy"]


def test_recent_sessions_that_are_gone_or_hold_nothing_are_left_out(
    tmp_path: Path, alignment: Alignment
) -> None:
    nameless = make(tmp_path, "", [alignment, alignment], is_done=True)
    with Session(nameless) as session:
        session.delete("alignment", 1)
    unused = make(tmp_path, "Cid", [], is_done=True)
    damaged = tmp_path / "damaged"
    damaged.mkdir()
    paths = [tmp_path / "gone", nameless, unused, damaged]
    recent = find_sessions(tmp_path / "nowhere", paths).recent
    assert [(entry.path, entry.is_enabled) for entry in recent] == [
        (nameless, True),
        (damaged, False),
    ]
    assert recent[0].text.startswith("Without a name · ")
    assert recent[0].text.endswith(" · 1 alignment")
    assert "journal.jsonl" in recent[1].text


def test_a_place_that_cannot_be_reached_hides_no_other_session(
    tmp_path: Path, alignment: Alignment
) -> None:
    path = make(tmp_path, "Ada", [alignment], is_done=True)
    unreachable = tmp_path / ("n" * 300)  # as a network drive that is gone, or another's folder
    (entry,) = find_sessions(unreachable, [unreachable / "session", path]).recent
    assert entry.path == path


def test_a_recent_session_shows_its_results_unless_they_are_damaged(
    tmp_path: Path, alignment: Alignment
) -> None:
    path = make(tmp_path, "Ada", [alignment], is_done=False)
    left = {"verdict": "accept", "benefit": {"without_arcmin": 20.0, "after_arcmin": 3.0}}
    with Session(path) as session:
        session.save_results({"version": 2, "eyes": {"left": left, "right": "damaged"}})
    (entry,) = find_sessions(tmp_path, [path]).recent
    assert entry.eyes == {"left": EyeOutcome("accept", 20.0, 3.0, None)}
    with Session(path) as session:
        session.save_results({"version": 2, "eyes": ["damaged"]})
    (entry,) = find_sessions(tmp_path, [path]).recent
    assert entry.eyes == {}


def test_a_new_user_finds_the_newest_sessions_of_the_folder(
    tmp_path: Path, alignment: Alignment
) -> None:
    ada, bea, cid = (make(tmp_path, name, [alignment], is_done=True) for name in ("a", "b", "c"))
    make(tmp_path, "d", [alignment], is_done=False)
    make(tmp_path, "e", [], is_done=True)
    for age_s, path in enumerate((bea, cid, ada)):
        os.utime(path / "journal.jsonl", (1e9 - age_s, 1e9 - age_s))
    found = find_sessions(tmp_path, ())
    assert [entry.path for entry in found.recent] == [bea, cid, ada]
    assert found.wearers == ("b", "c", "a", "d")
    opened_last = find_sessions(tmp_path, [ada])
    assert [entry.path for entry in opened_last.recent] == [ada, bea, cid]

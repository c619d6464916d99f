"""Sessions from somebody else with links to the user's own files; who may read a session."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from handcal.core.errors import FileError
from handcal.core.types import Alignment
from handcal.export.export import ExportSettings, export_session
from handcal.session.library import (
    correct_wearer,
    delete_session,
    read_library,
    unfinished_and_repaired,
)
from handcal.session.repair import check_session, repair_session
from handcal.session.session import Session, SessionRecord

pytestmark = pytest.mark.skipif(os.name == "nt", reason="Windows has no modes, and few links")

SECRET = b'{"devices": [{"key": "of the technician"}]}'
PARTS = (
    "lock", "journal.jsonl", "journal.end", "rig.yaml", "settings.json", "results.json",
    "notes.txt", "alignments/1.npz", "alignments",
)  # fmt: skip
FATAL = "lock", "journal.jsonl", "alignments"
"""Links with which a session cannot be continued."""


def use(path: Path) -> None:
    """Write to everything in a session."""
    with Session(path) as session:
        session.save_notes("new")
        session.save_results({})
        session.record("seen")


def export(path: Path) -> None:
    formats = ExportSettings(("json", "csv", "zip"))
    export_session(Session.open(path), path.parent / "export", formats)


USES: dict[str, Callable[[Path], object]] = {
    "use": use,
    "read": Session.open,
    "check": check_session,
    "repair": lambda path: repair_session(path, path.parent / "repaired"),
    "export": export,
    "library": lambda path: read_library(path.parent),
    "unfinished": lambda path: unfinished_and_repaired(path.parent),
    "correct": lambda path: correct_wearer(path, "Other"),
    "delete": delete_session,
}


@pytest.fixture
def foreign(tmp_path: Path, finished: SessionRecord) -> Path:
    path = Path(shutil.copytree(finished.path, tmp_path / "theirs" / "one"))
    with Session(path) as session:
        session.save_notes("theirs")
    return path


@pytest.fixture
def mine(tmp_path: Path) -> Path:
    """Return a folder of the user's own, with files that handcal would write, read or remove."""
    folder = tmp_path / "mine"
    folder.mkdir()
    for name in ("secret.key", ".x.0123456789abcdef", "1.npz", "3.npz"):
        (folder / name).write_bytes(SECRET)
    return folder


def put_link(part: Path, mine: Path) -> None:
    if part.is_dir():
        shutil.rmtree(part)
    part.unlink(missing_ok=True)
    part.symlink_to(mine if part.name == "alignments" else mine / "secret.key")


def contents(folder: Path) -> dict[str, bytes]:
    return {one.name: one.read_bytes() for one in folder.iterdir()}


@pytest.mark.parametrize("part", PARTS)
@pytest.mark.parametrize("name", USES)
def test_a_link_is_neither_followed_nor_changed(
    tmp_path: Path, foreign: Path, mine: Path, part: str, name: str
) -> None:
    put_link(foreign / part, mine)
    with suppress(FileError):
        USES[name](foreign)
    assert contents(mine) == dict.fromkeys(contents(mine), SECRET)
    assert len(contents(mine)) == 4
    written = (one for one in tmp_path.rglob("*") if one.is_file() and mine not in one.parents)
    assert not any(b"technician" in one.read_bytes() for one in written if not one.is_symlink())


@pytest.mark.parametrize("part", PARTS)
def test_a_link_is_named_in_one_line(foreign: Path, mine: Path, part: str) -> None:
    put_link(foreign / part, mine)
    if part in FATAL:
        with pytest.raises(FileError, match=f"{part} is a link, which is not followed") as error:
            Session(foreign)
        assert "\n" not in str(error.value)
    if part not in ("lock", "journal.jsonl"):
        damaged = {one.file: one.what for one in Session.open(foreign).damaged}
        assert f"{part} is a link" in damaged["alignments/1.npz" if part == "alignments" else part]


def test_notes_that_are_a_link_are_not_read(foreign: Path, mine: Path) -> None:
    put_link(foreign / "notes.txt", mine)
    assert Session.open(foreign).notes == ""


@pytest.mark.parametrize("part", ["journal.jsonl", "alignments", "lock"])
def test_a_link_put_in_place_of_a_part_in_use_is_not_followed(
    foreign: Path, mine: Path, alignment: Alignment, part: str
) -> None:
    with Session(foreign) as session:
        put_link(foreign / part, mine)
        with pytest.raises(FileError):
            session.save_alignment(alignment)
    assert contents(mine) == dict.fromkeys(contents(mine), SECRET)


def test_another_name_of_a_file_is_no_lock(foreign: Path, mine: Path) -> None:
    (foreign / "lock").unlink(missing_ok=True)
    os.link(mine / "secret.key", foreign / "lock")
    with pytest.raises(FileError, match="no lock of handcal"):
        Session(foreign)
    assert (mine / "secret.key").read_bytes() == SECRET


def test_a_session_itself_may_be_reached_by_a_link(tmp_path: Path, foreign: Path) -> None:
    (tmp_path / "short").symlink_to(foreign.parent)
    use(tmp_path / "short" / "one")
    assert Session.open(tmp_path / "short" / "one").notes == "new"


def test_a_link_in_place_of_the_deleted_sessions_is_not_followed(foreign: Path, mine: Path) -> None:
    (foreign.parent / ".deleted").symlink_to(mine)
    with pytest.raises(FileError, match="is a link"):
        delete_session(foreign)
    assert foreign.exists()


def test_a_repair_does_not_write_into_a_link(foreign: Path, mine: Path) -> None:
    (foreign.parent / ".new.repairing").symlink_to(mine)
    with pytest.raises(FileError, match="cannot write"):
        repair_session(foreign, foreign.parent / "new")
    assert len(contents(mine)) == 4


def test_others_cannot_read_a_session(
    tmp_path: Path, finished: SessionRecord, alignment: Alignment
) -> None:
    with Session.create(tmp_path, finished.rig, {}) as session:
        session.save_alignment(alignment)
        session.save_notes("a name")
        session.save_results({})
    copy = repair_session(session.path, tmp_path / "copy").path
    for one in (session.path, copy, *session.path.rglob("*"), *copy.rglob("*")):
        assert one.stat().st_mode & 0o077 == 0, one

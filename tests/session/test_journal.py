import json
import os
import sys
from pathlib import Path

import pytest

from handcal.core.errors import FileError
from handcal.core.types import Alignment
from handcal.rig.example import example_rig
from handcal.session import journal
from handcal.session.journal import JournalWriter, happens_now, journal_line, read_journal
from handcal.session.session import Session


def begin(path: Path) -> JournalWriter:
    path.write_bytes(journal_line(happens_now(1, "created", {})))
    return JournalWriter(path, read_journal(path))


def test_a_torn_line_is_left_out_and_goes_with_the_next(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    begin(path)
    with path.open("ab") as file:
        file.write(b'{"version": 3, "numb')
    torn = read_journal(path)
    assert (len(torn.events), torn.torn_bytes) == (1, 20)
    JournalWriter(path, torn).append(journal_line(happens_now(2, "next", {})))
    assert [event.name for event in read_journal(path).events] == ["created", "next"]


def test_a_full_journal_refuses_and_stays_readable(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "journal.jsonl"
    writer = begin(path)
    monkeypatch.setattr(journal, "MAX_JOURNAL_BYTES", 1000)
    with pytest.raises(FileError, match="is full; start another session"):
        writer.append(journal_line(happens_now(2, "long", {"text": "x" * 1000})))
    writer.append(journal_line(happens_now(2, "short", {})))
    assert [event.number for event in read_journal(path).events] == [1, 2]
    path.write_bytes(b"x" * 1001)
    with pytest.raises(FileError, match="larger than the 1,000 bytes"):
        read_journal(path)


@pytest.mark.parametrize("version", [0, 2, 4, "3", None])
@pytest.mark.parametrize("has_checksum", [True, False])
def test_another_version_is_refused_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, version: object, has_checksum: bool
) -> None:
    path = tmp_path / "journal.jsonl"
    with monkeypatch.context() as patch:
        patch.setattr(journal, "JOURNAL_VERSION", version)
        line = journal_line(happens_now(1, "created", {}))
    fields = json.loads(line)
    assert fields.pop("sha256")
    path.write_bytes(line if has_checksum else json.dumps(fields).encode() + b"\n")
    with pytest.raises(FileError) as refused:
        read_journal(path)
    said = str(refused.value)
    assert said.startswith(str(path))
    assert said.endswith(f"has version {version!r}, not 3; use the handcal that wrote it")
    assert "\n" not in said


@pytest.mark.skipif(sys.platform != "linux", reason="the files are told by Linux's /proc")
def test_each_event_and_each_new_file_are_on_the_disk_when_they_are_done(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, alignment: Alignment
) -> None:
    """A session that starts syncs its folders, an alignment its file and folder, an event itself.

    A power cut loses what is not synced; that cannot be tried in a test, but the calls are seen.
    """
    synced: list[tuple[Path, int]] = []

    def sync(descriptor: int) -> None:
        path = Path(f"/proc/self/fd/{descriptor}").readlink()
        synced.append((path, path.stat().st_size))

    monkeypatch.setattr(os, "fsync", sync)
    with Session.create(tmp_path, example_rig(), {}, name="one") as session:
        path = session.path / "journal.jsonl"
        assert {tmp_path, session.path} <= {folder for folder, _ in synced}
        synced.clear()
        session.record("said", text="φ")
        assert synced == [(path, path.stat().st_size)]
        synced.clear()
        session.save_alignment(alignment)
        stored = session.path / "alignments" / "1.npz"
        assert synced[0] == (stored, stored.stat().st_size)
        assert [one for one, _ in synced[1:]] == [stored.parent, path]
        assert synced[-1][1] == path.stat().st_size

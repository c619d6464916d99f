"""The zip file, which is the session again."""

from __future__ import annotations

import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handcal.core.errors import FileError
from handcal.core.progress import Progress
from handcal.export.export import write_archive
from handcal.session.session import Session, SessionRecord


def test_extracted_it_is_the_session(tmp_path: Path, record: SessionRecord) -> None:
    shares: list[float] = []
    write_archive(
        tmp_path / "s.zip", record, tmp_path, Progress(lambda _what, share: shares.append(share))
    )
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    with zipfile.ZipFile(tmp_path / "s.zip") as file:
        assert file.testzip() is None
        assert {entry.compress_type for entry in file.infolist()} == {zipfile.ZIP_DEFLATED}
        assert "one/lock" not in file.namelist()
        file.extractall(tmp_path)
    again = Session.open(tmp_path / "one")
    assert (again.wearer, again.notes, again.results) == (
        record.wearer,
        record.notes,
        record.results,
    )
    assert again.events == record.events
    assert (list(again.alignments), set(again.deleted_alignments)) == ([1, 3], {2})
    assert np.array_equal(again.alignments[3].hand_m, record.alignments[3].hand_m)
    with Session(tmp_path / "one") as session:
        session.finish()


def test_only_what_belongs_to_the_session_goes_in(tmp_path: Path, empty: SessionRecord) -> None:
    write_archive(tmp_path / "s.zip", empty, tmp_path)
    with zipfile.ZipFile(tmp_path / "s.zip") as file:
        file.extractall(tmp_path)
    folder = tmp_path / empty.path.name
    before = Session.open(folder)
    with Session(folder) as session:
        session.record("later")
    (folder / "exports").mkdir()
    (folder / "exports" / "report.pdf").touch()
    (folder / ".results.json.0123").touch()
    (folder / "passwords").symlink_to("/etc/passwd")
    (folder / "alignments" / "elsewhere").symlink_to("/etc")
    write_archive(tmp_path / "t.zip", before, folder / "exports")
    assert (tmp_path / "t.zip").read_bytes() == (tmp_path / "s.zip").read_bytes()


def test_too_much_is_refused(
    tmp_path: Path, record: SessionRecord, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("handcal.export.export.MAX_ARCHIVE_BYTES", 1000)
    with pytest.raises(FileError, match="more than the 1,000 that fit"):
        write_archive(tmp_path / "s.zip", record, tmp_path)
    assert not (tmp_path / "s.zip").exists()


def test_a_session_that_has_gone_is_reported(tmp_path: Path, record: SessionRecord) -> None:
    with pytest.raises(FileError, match="cannot write"):
        write_archive(tmp_path / "s.zip", replace(record, path=tmp_path / "x"), tmp_path)

"""A whole export: all of it or nothing, whatever happens in between."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
import zipfile
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from handcal.core.errors import CancelledError, FileError
from handcal.core.progress import Progress
from handcal.export.export import ExportSettings, export_session, write_archive
from handcal.export.formats import FORMATS, TOOL_FORMATS, Format
from handcal.session.session import Session, SessionRecord

resource = pytest.importorskip("resource")

ALL_FILES = {
    "report.pdf",
    "report.html",
    *(
        f"figures/{name}.{suffix}"
        for name in (
            "distances",
            "shifts",
            "ellipses",
            "convergence",
            "residuals-1",
            "residuals-3",
            "overlay-left",
            "overlay-right",
            "trial-errors",
            "running-mean",
        )
        for suffix in ("png", "csv")
    ),
    "parameters.csv",
    "trials.csv",
    "calibration.yaml",
    "calibration.json",
    "clouds/alignment-1-cursor.ply",
    "clouds/alignment-1-hand.ply",
    "clouds/alignment-3-cursor.ply",
    "clouds/alignment-3-hand.ply",
    "session.zip",
}
LIGHT: tuple[Format, ...] = ("csv", "yaml", "json", "ply", "zip")
# Exports a session, and is killed when half of it is done.
KILLED = """
import os, signal, sys
from pathlib import Path
from handcal.export.export import ExportSettings, export_session
from handcal.core.progress import Progress
from handcal.session.session import Session

def report(what, share):
    if share > 0.5:
        os.kill(os.getpid(), signal.SIGKILL)

settings = ExportSettings(("csv", "yaml", "json", "ply", "zip"))
export_session(Session.open(Path(sys.argv[1])), Path(sys.argv[2]), settings, Progress(report))
"""


def tree(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


def test_all_formats_of_a_session_that_was_only_verified(
    verified: SessionRecord, tmp_path: Path
) -> None:
    export_session(verified, tmp_path, ExportSettings((*FORMATS, *TOOL_FORMATS)))
    made = json.loads((tmp_path / "calibration.json").read_text())
    assert made["solved_eye_distance_m"] > 0.0
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "How it was solved" in text
    assert "stopped" not in text  # nothing was iterated
    assert "Residuals on the hand" not in text


def test_everything_is_exported_and_told(tmp_path: Path, record: SessionRecord) -> None:
    told: list[tuple[str, float]] = []
    asked_s = [time.process_time()]

    def ask() -> bool:
        asked_s.append(time.process_time())
        return False

    files = export_session(
        record, tmp_path / "out", ExportSettings(), Progress(lambda *step: told.append(step), ask)
    )
    assert {path.relative_to(tmp_path / "out").as_posix() for path in files} == ALL_FILES
    assert set(tree(tmp_path)) == {f"out/{name}" for name in ALL_FILES}
    shares = [share for _, share in told]
    assert shares == sorted(shares)
    assert (shares[0], shares[-1]) == (0.0, 1.0)
    titles = [f"Exporting {i} of 7, {info.title}" for i, info in enumerate(FORMATS.values(), 1)]
    whats = {what for what, _ in told}
    assert whats > set(titles)
    assert f"{titles[0]}: solving alignment 2 of 2" in whats
    assert np.diff(asked_s).max() < 2.0  # about 0.3 s of work; matplotlib's import takes longest


@pytest.mark.parametrize("name", LIGHT)
def test_a_format_writes_what_its_patterns_say(
    tmp_path: Path, record: SessionRecord, name: Format
) -> None:
    files = export_session(record, tmp_path, ExportSettings((name,)))
    matched = [path for pattern in FORMATS[name].patterns for path in tmp_path.glob(pattern)]
    assert sorted(matched) == sorted(files)
    assert set(tree(tmp_path)) <= ALL_FILES


@pytest.mark.parametrize("name", FORMATS)
def test_giving_up_at_any_time_leaves_all_as_it_was(
    tmp_path: Path, record: SessionRecord, name: Format
) -> None:
    (tmp_path / "old").mkdir()
    (tmp_path / "old" / "report.pdf").write_text("old")
    before = tree(tmp_path)
    for after in (0, 1, 2):
        for folder in (tmp_path / "old", tmp_path / "new"):
            give_up = Progress(is_cancelled=partial(next, iter([False] * after), True))
            with pytest.raises(CancelledError, match="nothing has changed"):
                export_session(record, folder, ExportSettings((name,)), give_up)
    assert tree(tmp_path) == before
    assert [path.name for path in tmp_path.iterdir()] == ["old"]


def test_a_full_disk_leaves_all_as_it_was(tmp_path: Path, record: SessionRecord) -> None:
    export_session(record, tmp_path / "out", ExportSettings(("csv",)))
    before = tree(tmp_path)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, limits[1]))
    try:
        for name in ("ply", "zip"):
            settings = ExportSettings(("csv", name))
            with pytest.raises(FileError, match="cannot write"):
                export_session(record, tmp_path / "out", settings)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert tree(tmp_path) == before


@pytest.mark.process
def test_a_killed_export_leaves_nothing_that_is_seen_and_the_next_cleans_up(
    tmp_path: Path, record: SessionRecord
) -> None:
    folder = tmp_path / "out"
    export_session(record, folder, ExportSettings(("csv",)))
    before = tree(folder)
    (tmp_path / "new").mkdir()
    for target in (folder, tmp_path / "new" / "one"):
        run = subprocess.run(
            [sys.executable, "-c", KILLED, str(record.path), str(target)],
            check=False,
            env=os.environ | {"OMP_NUM_THREADS": "1"},
        )
        assert run.returncode == -signal.SIGKILL
    seen = {name: text for name, text in tree(folder).items() if not name.startswith(".")}
    assert seen == before
    assert all(path.name.startswith(".") for path in (tmp_path / "new").iterdir())
    export_session(record, folder, ExportSettings(("json",)))
    assert set(tree(folder)) == {*before, "calibration.json"}


def test_a_new_export_replaces_the_old_one_of_its_formats(
    tmp_path: Path, record: SessionRecord
) -> None:
    export_session(record, tmp_path, ExportSettings(("csv", "ply")))
    fewer = replace(record, alignments={1: record.alignments[1]})
    export_session(fewer, tmp_path, ExportSettings(("ply",)))
    assert set(tree(tmp_path)) == {
        "clouds/alignment-1-cursor.ply",
        "clouds/alignment-1-hand.ply",
        "parameters.csv",
        "trials.csv",
    }


def test_a_session_without_alignments_is_exported_too(tmp_path: Path, empty: SessionRecord) -> None:
    export_session(empty, tmp_path, ExportSettings())
    without = {name for name in ALL_FILES if not name.startswith(("clouds/", "figures/"))}
    assert set(tree(tmp_path)) == without


def test_what_cannot_be_solved_is_not_exported(tmp_path: Path, record: SessionRecord) -> None:
    bare = replace(record.alignments[1], hand_m=np.zeros((5, 3)), hand_is_cut=np.zeros(5, bool))
    broken = replace(record, alignments={1: bare})
    with pytest.raises(FileError, match="cannot be solved"):
        export_session(broken, tmp_path / "out", ExportSettings())
    assert not list(tmp_path.iterdir())


def test_the_session_itself_stays_as_it_is(tmp_path: Path, record: SessionRecord) -> None:
    before = tree(record.path)
    export_session(record, tmp_path, ExportSettings(LIGHT))
    assert tree(record.path) == before


@pytest.mark.parametrize(
    ("formats", "near_m", "far_m", "problem"),
    [
        ((), 0.1, 1.0, "choose formats from report, html, csv"),
        (("docx",), 0.1, 1.0, "choose formats"),
        (("csv",), 0.0, 1.0, "near_m < far_m is needed, got 0 and 1"),
        (("csv",), 1.0, 0.5, "near_m < far_m"),
        (("csv",), 1.0, float("inf"), "near_m < far_m"),
    ],
)
def test_bad_settings_are_refused(
    formats: tuple[Format, ...], near_m: float, far_m: float, problem: str
) -> None:
    with pytest.raises(ValueError, match=problem):
        ExportSettings(formats, near_m, far_m)


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


SETTINGS = ExportSettings(("csv", "yaml"))

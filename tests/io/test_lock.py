import errno
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from handcal.core.errors import FileError
from handcal.io.lock import FileLock

HOLDER = """
import sys, time
from pathlib import Path
from handcal.io.lock import FileLock
lock = FileLock(Path(sys.argv[1]))
print("held", flush=True)
time.sleep(60)
"""


def test_only_one_can_hold_it_and_the_holder_is_named(tmp_path: Path) -> None:
    path = tmp_path / "lock"
    lock = FileLock(path)
    with pytest.raises(FileError, match=f"in use by process {os.getpid()}, this program;"):
        FileLock(path)
    lock.release()
    lock.release()
    FileLock(path).release()


@pytest.mark.process
def test_a_killed_holder_leaves_it_free(tmp_path: Path) -> None:
    path = tmp_path / "lock"
    with subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(path)], stdout=subprocess.PIPE
    ) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == b"held\n"
        with pytest.raises(FileError, match=f"in use by process {holder.pid}, another program;"):
            FileLock(path)
        holder.send_signal(signal.SIGKILL)
        holder.wait()
        FileLock(path).release()


def test_a_file_that_is_no_lock_is_refused_and_kept(tmp_path: Path) -> None:
    (tmp_path / "lock").write_text("somebody's notes")
    with pytest.raises(FileError, match="is no lock of handcal"):
        FileLock(tmp_path / "lock")
    assert (tmp_path / "lock").read_text() == "somebody's notes"


def test_a_missing_folder_says_so(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"cannot lock .*: No such file"):
        FileLock(tmp_path / "gone" / "lock")


def test_a_lock_that_was_deleted_or_replaced_is_noticed(tmp_path: Path) -> None:
    path = tmp_path / "lock"
    lock = FileLock(path)
    lock.require_held()
    path.unlink()
    with pytest.raises(FileError, match="its lock was deleted"):
        lock.require_held()
    other = FileLock(path)
    other.require_held()
    with pytest.raises(FileError, match="its lock was deleted"):
        lock.require_held()
    for one in (lock, other):
        one.release()


def test_a_folder_that_was_moved_is_no_work_of_another_program(tmp_path: Path) -> None:
    folder = tmp_path / "session"
    folder.mkdir()
    lock = FileLock(folder / "lock")
    folder.rename(tmp_path / "away")
    with pytest.raises(FileError, match=r"session: it was moved or deleted$"):
        lock.require_held()
    (tmp_path / "away").rename(folder)
    lock.require_held()
    lock.release()


def test_a_folder_that_cannot_be_written_says_what_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr("handcal.io.lock.open_no_link", refuse)
    with pytest.raises(FileError, match="Read-only file system; make it writable, or use a copy"):
        FileLock(tmp_path / "lock")

import json
import os
import sys
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from handcal.core.errors import FileError
from handcal.io.files import (
    make_folder,
    read_json,
    read_limited,
    remove_leftovers,
    require_writable,
    write_atomic,
    write_json,
    write_new,
    write_ply,
)


def test_write_replaces_the_whole_content_and_leaves_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "a.bin"
    write_atomic(path, b"a long first content")
    write_atomic(path, b"short")
    assert path.read_bytes() == b"short"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.skipif(os.name == "nt", reason="Windows has no modes")
@pytest.mark.parametrize(("folder", "file"), [(0o755, 0o644), (0o750, 0o640), (0o700, 0o600)])
def test_a_file_is_as_private_as_its_folder(tmp_path: Path, folder: int, file: int) -> None:
    tmp_path.chmod(folder)
    (tmp_path / "any").touch()
    usual = (tmp_path / "any").stat().st_mode
    write_atomic(tmp_path / "a.bin", b"a")
    write_new(tmp_path / "b.bin", b"b")
    for name in ("a.bin", "b.bin"):
        assert (tmp_path / name).stat().st_mode & 0o777 == usual & file


def test_a_failed_write_keeps_the_old_content(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.bin"
    write_atomic(path, b"old")

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(FileError, match="No space left on device"):
        write_atomic(path, b"new")
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows does not sync folders")
def test_file_then_folder_are_on_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    synced = []
    real = os.fsync

    def fsync(file: int) -> None:
        synced.append(
            (str(Path(f"/proc/self/fd/{file}").readlink()), (tmp_path / "a/b/c.bin").exists())
        )
        real(file)

    monkeypatch.setattr("os.fsync", fsync)
    folder = make_folder(tmp_path / "a" / "b")
    assert [path for path, _ in synced] == [str(tmp_path), str(tmp_path / "a")]
    synced.clear()
    write_atomic(folder / "c.bin", b"c")
    (temporary, was_there), (of_folder, is_there) = synced
    assert temporary.startswith(f"{folder}/.c.bin.")
    assert (was_there, of_folder, is_there) == (False, str(folder), True)


def test_only_leftovers_are_removed(tmp_path: Path) -> None:
    kept = {".hidden", "a.bin", ".a.bin.0123", ".a.bin.0123456789abcdex"}
    for name in (*kept, ".a.bin.0123456789abcdef"):
        (tmp_path / name).touch()
    (tmp_path / ".b.0123456789abcdef").mkdir()
    remove_leftovers(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == kept | {".b.0123456789abcdef"}


def test_a_new_file_takes_the_place_of_a_leftover(tmp_path: Path) -> None:
    path = tmp_path / "1.npz"
    for data in (b"a long leftover", b"new"):
        write_new(path, data)
        assert path.read_bytes() == data
    with pytest.raises(FileError, match=r"cannot write .*: No such file"):
        write_new(tmp_path / "gone" / "1.npz", b"")


@pytest.mark.skipif(sys.platform == "win32", reason="makes a pipe in a folder")
def test_a_pipe_is_neither_waited_for_nor_replaced(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(FileError, match=r"cannot read .*pipe: it is a device or a pipe"):
        read_limited(pipe, 10)
    with pytest.raises(FileError, match="cannot read /dev/zero: it is a device or a pipe"):
        read_limited(Path("/dev/zero"), 10)
    for path in (pipe, Path("/dev/null")):
        with pytest.raises(FileError, match=r"cannot write .*: it is a folder, a device or a pipe"):
            write_atomic(path, b"data")
    assert pipe.is_fifo()
    assert Path("/dev/null").is_char_device()


def test_reading_is_limited(tmp_path: Path) -> None:
    path = tmp_path / "a.bin"
    path.write_bytes(b"12345")
    assert read_limited(path, 5) == b"12345"
    with pytest.raises(FileError, match="larger than the 4 bytes"):
        read_limited(path, 4)
    with pytest.raises(FileError, match="cannot read"):
        read_limited(tmp_path / "missing", 4)
    with pytest.raises(FileError, match="cannot read"):
        read_limited(tmp_path, 4)


def test_make_folder_makes_parents_and_takes_an_existing_one(tmp_path: Path) -> None:
    path = tmp_path / "a" / "b"
    assert make_folder(path) == make_folder(path) == path
    assert path.is_dir()
    (tmp_path / "file").touch()
    with pytest.raises(FileError, match="cannot create the folder"):
        make_folder(tmp_path / "file" / "c")


@pytest.mark.skipif(not Path("/proc").exists(), reason="Linux has it")
def test_a_folder_that_stores_nothing_is_refused(tmp_path: Path) -> None:
    require_writable(tmp_path / "new" / "folder")
    with pytest.raises(FileError, match=r"(stored in|cannot write to) /proc; choose"):
        require_writable(Path("/proc/a/b"))


def test_json_keeps_every_bit_of_a_number(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    value = {"x": 0.1 + 0.2, "tiny": 5e-324, "text": "φ", "list": [1, None, True]}
    write_json(path, value)
    assert read_json(path) == value


def test_json_refuses_nan(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="JSON compliant"):
        write_json(tmp_path / "a.json", {"x": float("nan")})


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"{", "not valid JSON"),
        (b"", "not valid JSON"),
        (b"\xff", "not valid JSON"),
        (b"[" * 100_000, "not valid JSON"),
        (json.dumps([1]).encode(), "must hold a JSON object"),
        (b'{"x": 1%s}' % (b"0" * 400), "a whole number is too large"),
    ],
)
def test_bad_json_is_a_file_error(tmp_path: Path, content: bytes, problem: str) -> None:
    path = tmp_path / "a.json"
    path.write_bytes(content)
    with pytest.raises(FileError, match=problem):
        read_json(path)


def test_ply_keeps_doubles_and_further_properties_to_the_last_bit(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    points_m, residual_m = rng.normal(size=(9, 3)), rng.normal(size=9)
    residual_m[3] = np.nan
    is_cut = rng.integers(0, 2, 9, dtype=np.uint8)
    path = tmp_path / "a.ply"
    write_ply(path, points_m, properties={"residual_m": residual_m, "is_cut": is_cut})
    header, body = path.read_bytes().split(b"end_header\n")
    assert header.decode().splitlines()[3:] == [
        "element vertex 9",
        "property double x",
        "property double y",
        "property double z",
        "property double residual_m",
        "property uchar is_cut",
    ]
    read = np.frombuffer(body, np.dtype([("xyz", "<f8", 3), ("residual_m", "<f8"), ("cut", "u1")]))
    assert np.array_equal(read["xyz"], points_m)
    assert np.array_equal(read["residual_m"], residual_m, equal_nan=True)
    assert np.array_equal(read["cut"], is_cut)


def test_reading_allocates_the_files_size_not_the_limit(tmp_path: Path) -> None:
    path = tmp_path / "a.bin"
    path.write_bytes(b"a")
    tracemalloc.start()
    assert read_limited(path, 2**28) == b"a"
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 2**20


@pytest.mark.skipif(sys.platform != "linux", reason="there is no /proc")
def test_a_file_that_does_not_know_its_size_is_read_to_its_end() -> None:
    assert len(read_limited(Path("/proc/self/status"), 2**20)) > 100


@pytest.mark.skipif(os.name == "nt", reason="few may make links on Windows")
@pytest.mark.parametrize("inside", ["", "a", "a/b"])
@pytest.mark.parametrize("form", ["absolute", "relative", "other"])
def test_only_links_within_a_folder_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, inside: str, form: str
) -> None:
    (tmp_path / "elsewhere" / "b").mkdir(parents=True)
    (tmp_path / "elsewhere" / "b" / "x").touch()
    (tmp_path / "a").symlink_to("elsewhere")
    monkeypatch.chdir(tmp_path)
    root = Path() if form == "relative" else tmp_path
    folder = Path("nowhere") if form == "other" else root / inside
    if inside and form != "other":
        assert read_limited(root / "a" / "b" / "x", 1, folder) == b""
    else:
        with pytest.raises(FileError, match="a is a link"):
            read_limited(root / "a" / "b" / "x", 1, folder)

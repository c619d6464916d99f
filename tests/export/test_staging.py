"""Files that appear together or not at all."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from handcal.core.errors import FileError
from handcal.export.export import Staging


def tree(folder: Path) -> dict[str, str]:
    return {
        path.relative_to(folder).as_posix(): path.read_text()
        for path in folder.rglob("*")
        if path.is_file()
    }


def write(staging: Staging, **texts: str) -> None:
    for name, text in texts.items():
        (staging.path / name).write_text(text)


def test_a_new_folder_appears_with_all_its_files(tmp_path: Path) -> None:
    folder = tmp_path / "a" / "b"
    with Staging(folder) as staging:
        (staging.path / "clouds").mkdir()
        (staging.path / "clouds" / "x").write_text("1")
        write(staging, y="2")
        assert not (tmp_path / "a").exists()
        assert staging.publish([]) == (folder / "clouds" / "x", folder / "y")
    assert tree(tmp_path) == {"a/b/clouds/x": "1", "a/b/y": "2"}


def test_an_existing_folder_keeps_what_is_not_replaced(tmp_path: Path) -> None:
    (tmp_path / "clouds").mkdir()
    for name in ("clouds/1.ply", "clouds/2.ply", "clouds/mine.txt", "report.pdf", "notes.txt"):
        (tmp_path / name).write_text("old")
    with Staging(tmp_path) as staging:
        (staging.path / "clouds").mkdir()
        (staging.path / "clouds" / "1.ply").write_text("new")
        write(staging, **{"trials.csv": "new"})
        staging.publish(["clouds/*.ply", "trials.csv"])
    assert tree(tmp_path) == {
        "clouds/1.ply": "new",
        "clouds/mine.txt": "old",
        "report.pdf": "old",
        "notes.txt": "old",
        "trials.csv": "new",
    }


def test_if_one_file_cannot_be_replaced_none_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("a", "c", "old.ply"):
        (tmp_path / name).write_text("old")
    replace = Path.replace

    def refuse_c(path: Path, target: Path) -> Path:
        if target.name == "c" and path.parent.name == "new":
            raise PermissionError(13, "Permission denied", str(target))
        return replace(path, target)

    monkeypatch.setattr(Path, "replace", refuse_c)
    with Staging(tmp_path) as staging:
        write(staging, a="new", b="new", c="new")
        with pytest.raises(FileError, match=r"cannot write to .*: Permission denied \(c\)"):
            staging.publish(["*.ply"])
    assert tree(tmp_path) == {"a": "old", "c": "old", "old.ply": "old"}


def test_two_at_once_are_refused(tmp_path: Path) -> None:
    with Staging(tmp_path / "out") as first:
        with pytest.raises(FileError, match=f"^{re.escape(str(tmp_path / 'out'))} is in use"):
            Staging(tmp_path / "out")
        write(first, x="1")
        first.publish([])
    assert tree(tmp_path) == {"out/x": "1"}


def test_a_file_in_the_way_is_reported(tmp_path: Path) -> None:
    with Staging(tmp_path / "out") as staging:
        (tmp_path / "out").write_text("a file")
        write(staging, x="1")
        with pytest.raises(FileError, match="cannot create the folder"):
            staging.publish([])
    assert tree(tmp_path) == {"out": "a file"}


@pytest.mark.parametrize("name", ["file", "file/export"])
def test_a_file_as_the_folder_is_refused_before_anything_is_written(
    tmp_path: Path, name: str
) -> None:
    (tmp_path / "file").write_text("old")
    with pytest.raises(FileError, match="is a file, not a folder"):
        Staging(tmp_path / name)
    assert tree(tmp_path) == {"file": "old"}


@pytest.mark.skipif(not Path("/proc").exists(), reason="Linux has it")
def test_a_folder_that_cannot_be_created_is_named_as_it_was_chosen() -> None:
    with pytest.raises(FileError, match=r"^cannot create the folder /proc/a/b: No such file"):
        Staging(Path("/proc/a/b"))


def replace_cloud(folder: Path) -> None:
    with Staging(folder) as staging:
        (staging.path / "clouds").mkdir()
        (staging.path / "clouds" / "1.ply").write_text("new")
        staging.publish(["clouds/*.ply"])


@pytest.mark.parametrize("place", ["out/clouds", "out/.out.handcal-export"])
def test_a_linked_folder_among_the_files_is_not_written_to(tmp_path: Path, place: str) -> None:
    mine = tmp_path / "mine"
    for name in ("1.ply", "2.ply", "new/x", "old/x"):
        (mine / name).parent.mkdir(parents=True, exist_ok=True)
        (mine / name).write_text("mine")
    (tmp_path / "out").mkdir()
    (tmp_path / place).symlink_to(mine)
    before = tree(mine)
    with pytest.raises(FileError, match="is a link"):
        replace_cloud(tmp_path / "out")
    assert tree(mine) == before


def test_a_link_in_place_of_a_file_is_replaced_and_put_back_as_a_link(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mine, out = tmp_path / "mine", tmp_path / "out"
    mine.write_text("mine")
    out.mkdir()
    (out / "x").symlink_to(mine)
    monkeypatch.setattr("handcal.export.export.sync_folder", Path.rmdir)
    with Staging(out) as staging:
        write(staging, x="new")
        with pytest.raises(FileError, match="cannot write"):
            staging.publish([])
    assert (out / "x").readlink() == mine
    monkeypatch.undo()
    with Staging(out) as staging:
        write(staging, x="new")
        staging.publish([])
    assert (tree(out), mine.read_text()) == ({"x": "new"}, "mine")

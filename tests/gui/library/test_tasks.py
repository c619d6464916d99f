"""Tasks of the library: their messages stay short."""

from __future__ import annotations

from pathlib import Path

from handcal.core.progress import Progress
from handcal_gui.library.sessions import check_sessions, delete_sessions


def test_messages_name_a_few_of_many_sessions(tmp_path: Path) -> None:
    paths = [tmp_path / f"s-{number}" for number in range(20)]
    for path in paths:
        path.mkdir()
        (path / "journal.jsonl").write_text("nonsense\n")
    damaged: set[Path] = set()
    *lines, last = check_sessions(paths, damaged, Progress()).splitlines()
    assert damaged == {*paths}
    assert len(lines) == 8
    assert lines[0].startswith(f"× s-0: {paths[0] / 'journal.jsonl'} does not begin as the journal")
    assert lines[0].endswith("; make it readable, or restore it from a backup")
    assert last == "and 12 more"
    gone = [tmp_path / f"gone-{number}" for number in range(20)]
    assert len(delete_sessions(gone, Progress()).splitlines()) == 10


def test_a_cancelled_task_says_what_it_did(tmp_path: Path) -> None:
    asked = iter((False, False, True))
    gone = [tmp_path / f"gone-{number}" for number in range(5)]
    said = delete_sessions(gone, Progress(is_cancelled=lambda: next(asked)))
    first, cancelled, *failed = said.splitlines()
    assert (first, cancelled) == ("0 sessions deleted.", "Cancelled: 3 sessions left out.")
    assert len(failed) == 2

"""Sessions that survive other writers, kills, a full disk, and damaged files."""

import contextlib
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from handcal.core.errors import FileError
from handcal.core.types import Alignment
from handcal.rig.example import example_rig
from handcal.session.journal import happens_now, journal_line
from handcal.session.session import Session, SessionRecord
from handcal.session.state import SessionEvent
from handcal.session.trial import Trial
from tests.session.conftest import SETTINGS

# Writes alignments that tell their own number, deletes and restores them, and says when each round
# is safe.
WRITER = """
import sys
from pathlib import Path
import numpy as np
from handcal.session.session import Session
from handcal.session.trial import make_trial
from handcal.core.types import Alignment

path = Path(sys.argv[1])
record = Session.open(path)
pattern_m = np.random.default_rng(0).normal(size=(2000, 3)) / 20
number = len(record.alignments) + len(record.deleted_alignments)
trial = make_trial(record.rig.eyes["left"], "left", 0.5, np.zeros(3), np.full(3, 0.001))
with Session(path) as session:
    while True:
        cloud_m = pattern_m + number
        cut = np.zeros(2000, bool)
        number = session.save_alignment(
            Alignment(cloud_m, cloud_m, cut, cut, {"left": np.eye(4)}, ("left",), np.zeros(3), 0, 1)
        )
        session.delete("alignment", number)
        session.save_trial(trial)
        session.save_notes("x" * number)
        session.restore("alignment", number)
        session.save_results({"number": number})
        session.save_fine_tuned({"left": np.full(3, 1e-3 * number)})
        session.record("ready", text="x" * 1000)
        print(number, flush=True)
"""


def test_a_removed_folder_is_reported(session: Session, alignment: Alignment) -> None:
    shutil.rmtree(session.path)
    with pytest.raises(FileError, match="cannot write"):
        session.record("event")
    with pytest.raises(FileError, match="cannot write"):
        session.save_alignment(alignment)
    with pytest.raises(FileError, match="cannot write"):
        session.save_results({})


def test_a_second_writer_is_found_before_anything_is_written(
    tmp_path: Path, session: Session, alignment: Alignment
) -> None:
    (session.path / "lock").unlink()
    with Session(session.path) as second:
        second.save_alignment(alignment)
        before = (session.path / "journal.jsonl").read_bytes()
        for write in (
            lambda: session.record("event"),
            lambda: session.save_alignment(replace(alignment, t_b_ns=2)),
            lambda: session.save_notes("mine"),
        ):
            with pytest.raises(FileError, match=r"its lock was deleted, so another program"):
                write()
        session.close()
        assert (session.path / "journal.jsonl").read_bytes() == before
        second.save_alignment(alignment)
    record = Session.open(session.path)
    assert (len(record.alignments), record.notes, record.damaged) == (2, "", ())


def test_a_folder_that_was_restored_under_the_program_is_found(
    tmp_path: Path, session: Session
) -> None:
    copy = shutil.copytree(session.path, tmp_path / "copy")
    session.record("event")
    journal = session.path / "journal.jsonl"
    journal.write_bytes((copy / "journal.jsonl").read_bytes())
    with pytest.raises(FileError, match="changed or replaced by another program"):
        session.record("event")
    session.close()
    with Session(session.path) as again:
        again.path.rename(tmp_path / "aside")
        shutil.copytree(copy, again.path)
        with pytest.raises(FileError, match="replaced or restored"):
            again.record("event")


def test_leftovers_of_killed_writers_are_removed(session: Session) -> None:
    session.close()
    for name in (".notes.txt.0123456789abcdef", "alignments/.1.npz.0123456789abcdef"):
        (session.path / name).touch()
    Session(session.path).close()
    assert not list(session.path.rglob(".*"))


@contextlib.contextmanager
def disk_ends_at(size: int) -> Iterator[None]:
    """Let no file grow beyond `size` bytes: a write up to there is done, the rest fails."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_a_full_disk_loses_nothing_and_the_session_goes_on(
    session: Session, alignment: Alignment, trial: Trial
) -> None:
    session.record("first")
    journal = session.path / "journal.jsonl"
    with disk_ends_at(journal.stat().st_size + 10):
        with pytest.raises(FileError, match=r"cannot write .*journal"):
            session.record("second")
        with pytest.raises(FileError, match=r"cannot write .*journal"):
            session.save_alignment(alignment)
        with pytest.raises(FileError, match=r"cannot write .*journal"):
            session.save_trial(trial)  # which is not kept: a person sees that it failed
        torn = Session.open(session.path)
        assert torn.torn_bytes == 10
        assert [event.name for event in torn.events] == ["created", "first"]
        kept = ["second", "alignment_saved"]
        assert [event.name for event in session.contents.unwritten] == kept
        assert list(session.contents.alignments) == [1]
        assert session.contents.trials == {}
    session.record("third")
    whole = Session.open(session.path)
    assert whole.torn_bytes == 0
    assert [event.name for event in whole.events] == ["created", "first", *kept, "third"]
    assert list(whole.alignments) == [1]
    assert session.contents.unwritten == ()


@pytest.mark.process
@pytest.mark.parametrize("seed", range(6))
def test_a_session_survives_kill_9(tmp_path: Path, seed: int) -> None:
    pattern_m = np.random.default_rng(0).normal(size=(2000, 3)) / 20
    Session.create(tmp_path, example_rig(), SETTINGS, name="killed").close()
    path = tmp_path / "killed"
    for _ in range(1 + seed // 3):  # some are resumed after the kill, and killed again
        before = Session.open(path)
        command = [sys.executable, "-c", WRITER, str(path)]
        with subprocess.Popen(command, stdout=subprocess.PIPE) as writer:
            assert writer.stdout is not None
            said = writer.stdout.readline()
            time.sleep(random.Random(seed).uniform(0.0, 0.04))
            os.kill(writer.pid, signal.SIGKILL)
            said += writer.stdout.read()
        rounds, safe = len(said.split()), int(said.split()[-1])
        record = Session.open(path)
        stored = {**record.alignments, **record.deleted_alignments}
        assert safe <= len(stored) <= safe + 1
        assert set(record.deleted_alignments) <= {safe + 1, *before.deleted_alignments}
        for number, alignment in stored.items():
            np.testing.assert_array_equal(alignment.hand_m, pattern_m + (number - 1))
            assert alignment.hand_m.shape == (2000, 3)
        assert rounds <= len(record.trials) - len(before.trials) <= rounds + 1
        assert safe <= len(record.notes) <= safe + 1
        if len(stored) == safe:
            assert record.results == {"number": safe}
            assert record.is_solved
        assert record.applied_shift_m["left"][0] in (1e-3 * safe, 1e-3 * (safe + 1))


def test_a_newer_version_is_refused_as_a_whole(
    tmp_path: Path, finished: SessionRecord, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = Path(shutil.copytree(finished.path, tmp_path / "session"))
    journal = path / "journal.jsonl"
    monkeypatch.setattr("handcal.session.journal.JOURNAL_VERSION", 4)
    line = journal_line(happens_now(13, "later", {}))
    monkeypatch.undo()
    journal.write_bytes(journal.read_bytes() + line)
    with pytest.raises(FileError, match="has version 4, not 3; use the handcal that wrote it"):
        Session.open(path)


JSON = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(max_size=5),
    lambda part: (
        st.lists(part, max_size=4) | st.dictionaries(st.text(max_size=5), part, max_size=3)
    ),
    max_leaves=8,
)
FIELDS = [
    "number", "sha256", "before_sha256", "wearer", "before", "trial", "shift_m", "results",
    "is_solved", "notes_sha256",
]  # fmt: skip


@given(st.sampled_from(list(SessionEvent)), st.dictionaries(st.sampled_from(FIELDS), JSON))
@example(SessionEvent.COPIED, {"notes_sha256": "", "results": 1, "is_solved": True})
@settings(deadline=None)
def test_a_strange_event_is_refused_or_harmless(
    tmp_path_factory: pytest.TempPathFactory,
    finished: SessionRecord,
    event: SessionEvent,
    data: dict[str, object],
) -> None:
    path = Path(shutil.copytree(finished.path, tmp_path_factory.mktemp("copy") / "session"))
    with (path / "journal.jsonl").open("ab") as journal:
        journal.write(journal_line(happens_now(13, event, data)))
    record = Session.open(path)
    assert set(record.alignments) | set(record.deleted_alignments) <= {1, 2}
    assert record.trials or record.deleted_trials

import contextlib
import json
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
from hypothesis import given, settings
from hypothesis import strategies as st

from handcal.errors import FileError
from handcal.rig.example import example_rig
from handcal.session import MAX_ALIGNMENT_BYTES, Session, SessionRecord
from handcal.types import Alignment

SETTINGS = {"method": "consistent", "gate_m": [0.35, 0.7], "third": 1 / 3}
RESULTS = {"left": {"shift_m": [0.1 + 0.2, -1e-17, 3.0]}}

# Writes alignments that tell their own number, and says when each is safe.
WRITER = """
import sys
from pathlib import Path
import numpy as np
from handcal.session import Session
from handcal.types import Alignment

path = Path(sys.argv[1])
number = len(Session.open(path).alignments)
with Session(path) as session:
    while True:
        cloud_m = np.full((2000, 3), number)
        cut = np.zeros(2000, bool)
        number = session.save_alignment(
            Alignment(cloud_m, cloud_m, cut, cut, {"left": np.eye(4)}, ("left",), np.zeros(3), 0, 1)
        )
        session.save_results({"number": number})
        session.record("ready", text="x" * 1000)
        print(number, flush=True)
"""


@pytest.fixture
def session(tmp_path: Path) -> Iterator[Session]:
    with Session.create(tmp_path, example_rig(), SETTINGS, name="one") as session:
        yield session


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory, alignment: Alignment) -> SessionRecord:
    parent = tmp_path_factory.mktemp("sessions")
    with Session.create(parent, example_rig(), SETTINGS) as session:
        session.record("cursor_made", points=5000)
        session.save_alignment(alignment)
        session.record("refused", angle_rad=0.2)
        session.save_alignment(alignment)
        session.save_results(RESULTS)
    return Session.open(session.path)


def test_everything_comes_back(finished: SessionRecord, alignment: Alignment) -> None:
    names = [event.name for event in finished.events]
    assert names == [
        "created", "cursor_made", "alignment_saved", "refused", "alignment_saved", "solved",
    ]  # fmt: skip
    assert [event.number for event in finished.events] == [1, 2, 3, 4, 5, 6]
    assert finished.events[1].data == {"points": 5000}
    assert finished.settings == SETTINGS
    assert finished.results == RESULTS
    assert finished.rig.name == example_rig().name
    assert len(finished.alignments) == 2
    for stored in finished.alignments:
        assert stored.cursor_m.tobytes() == alignment.cursor_m.tobytes()
        assert stored.T_E_W["right"].tobytes() == alignment.T_E_W["right"].tobytes()
    assert finished.torn_bytes == 0


def test_a_new_session_has_no_results_and_can_be_read_while_written(session: Session) -> None:
    record = Session.open(session.path)
    assert record.results is None
    assert record.alignments == ()


def test_a_session_goes_on_where_it_ended(session: Session, alignment: Alignment) -> None:
    assert session.save_alignment(alignment) == 1
    session.close()
    with Session(session.path) as resumed:
        assert resumed.save_alignment(alignment) == 2
        resumed.record("done")
    assert [event.number for event in Session.open(session.path).events] == [1, 2, 3, 4]


def test_a_folder_is_never_taken_over(tmp_path: Path, session: Session) -> None:
    with pytest.raises(FileError, match=r"cannot create .*one: File exists"):
        Session.create(tmp_path, example_rig(), SETTINGS, name="one")
    with pytest.raises(FileError, match="in use by process"):
        Session(session.path)


def test_what_is_no_session_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"cannot read .*journal"):
        Session.open(tmp_path)
    with pytest.raises(FileError, match="cannot lock"):
        Session(tmp_path / "missing")


def test_names_of_its_own_events_and_nan_are_refused(session: Session) -> None:
    with pytest.raises(ValueError, match="written by the session itself"):
        session.record("alignment_saved", number=1)
    with pytest.raises(ValueError, match="JSON compliant"):
        session.record("bad", value=float("nan"))
    assert len(Session.open(session.path).events) == 1


def test_too_large_an_alignment_is_not_written(session: Session, alignment: Alignment) -> None:
    cloud_m = np.zeros((MAX_ALIGNMENT_BYTES // 24, 3))
    huge = Alignment(
        cloud_m,
        alignment.hand_m,
        np.zeros(len(cloud_m), bool),
        alignment.hand_is_cut,
        alignment.T_E_W,
        ("left",),
        np.zeros(3),
        0,
        1,
    )
    with pytest.raises(FileError, match="too large"):
        session.save_alignment(huge)
    assert Session.open(session.path).alignments == ()


def test_a_removed_folder_is_reported(session: Session, alignment: Alignment) -> None:
    shutil.rmtree(session.path)
    with pytest.raises(FileError, match="cannot write"):
        session.record("event")
    with pytest.raises(FileError, match="cannot write"):
        session.save_alignment(alignment)
    with pytest.raises(FileError, match="cannot write"):
        session.save_results({})


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
    session: Session, alignment: Alignment
) -> None:
    session.record("first")
    journal = session.path / "journal.jsonl"
    with disk_ends_at(journal.stat().st_size + 10):
        with pytest.raises(FileError, match=r"cannot write .*journal"):
            session.record("second")
        with pytest.raises(FileError, match=r"cannot write .*1\.npz"):
            session.save_alignment(alignment)
        torn = Session.open(session.path)
        assert torn.torn_bytes == 10
        assert [event.name for event in torn.events] == ["created", "first"]
    session.record("third")
    whole = Session.open(session.path)
    assert whole.torn_bytes == 0
    assert [event.name for event in whole.events] == ["created", "first", "third"]


@pytest.mark.parametrize("seed", range(6))
def test_a_session_survives_kill_9(tmp_path: Path, seed: int) -> None:
    Session.create(tmp_path, example_rig(), SETTINGS, name="killed").close()
    path = tmp_path / "killed"
    for _ in range(1 + seed // 3):  # some are resumed after the kill, and killed again
        before = len(Session.open(path).alignments)
        command = [sys.executable, "-c", WRITER, str(path)]
        with subprocess.Popen(command, stdout=subprocess.PIPE) as writer:
            assert writer.stdout is not None
            said = writer.stdout.readline()
            time.sleep(random.Random(seed).uniform(0.0, 0.04))
            os.kill(writer.pid, signal.SIGKILL)
            said += writer.stdout.read()
        safe = int(said.split()[-1])
        record = Session.open(path)
        assert safe > before
        assert safe <= len(record.alignments) <= safe + 1
        for index, alignment in enumerate(record.alignments):
            assert (alignment.hand_m == index).all()
            assert alignment.hand_m.shape == (2000, 3)
        assert record.results is not None
        assert safe <= record.results["number"] <= safe + 1


FILES = [
    "journal.jsonl",
    "rig.yaml",
    "settings.json",
    "results.json",
    "alignments/1.npz",
    "alignments/2.npz",
]


@given(st.sampled_from(FILES), st.floats(0, 1))
@settings(deadline=None)
def test_a_truncated_file_gives_the_data_or_a_file_error(
    tmp_path_factory: pytest.TempPathFactory,
    finished: SessionRecord,
    name: str,
    fraction: float,
) -> None:
    path = tmp_path_factory.mktemp("copy") / "session"
    shutil.copytree(finished.path, path)
    length = int(fraction * (path / name).stat().st_size)
    os.truncate(path / name, length)
    try:
        record = Session.open(path)
    except FileError:
        return
    assert record.settings == SETTINGS
    assert record.results == RESULTS
    assert record.events == finished.events[: len(record.events)]
    assert record.journal_bytes + record.torn_bytes == (path / "journal.jsonl").stat().st_size
    for stored, original in zip(record.alignments, finished.alignments, strict=False):
        assert stored.hand_m.tobytes() == original.hand_m.tobytes()


@pytest.mark.parametrize("name", [name for name in FILES if name != "results.json"])
def test_a_missing_file_is_named(tmp_path: Path, finished: SessionRecord, name: str) -> None:
    path = tmp_path / "session"
    shutil.copytree(finished.path, path)
    (path / name).unlink()
    with pytest.raises(FileError, match=f"cannot read .*{name}: No such file"):
        Session.open(path)


@pytest.mark.parametrize("name", ["rig.yaml", "alignments/1.npz", "alignments/2.npz"])
def test_a_changed_file_is_noticed(tmp_path: Path, finished: SessionRecord, name: str) -> None:
    path = tmp_path / "session"
    shutil.copytree(finished.path, path)
    content = bytearray((path / name).read_bytes())
    content[len(content) // 2] ^= 1
    (path / name).write_bytes(content)
    with pytest.raises(FileError, match=f"{name} is damaged"):
        Session.open(path)


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"version": 3}, "session version 3 is not 2 or 1"),
        ({"number": 7}, "line 2 is not the event expected there"),
        ({"event": 3}, "line 2 is not the event expected there"),
        ({"data": []}, "line 2 is not the event expected there"),
        (None, "line 2 is not an event of a session"),
    ],
)
def test_a_foreign_journal_is_refused(
    tmp_path: Path, finished: SessionRecord, change: dict[str, object] | None, problem: str
) -> None:
    path = tmp_path / "session"
    shutil.copytree(finished.path, path)
    journal = path / "journal.jsonl"
    lines = journal.read_text().splitlines()
    lines[1] = "[1, 2]" if change is None else json.dumps(json.loads(lines[1]) | change)
    journal.write_text("\n".join(lines) + "\n")
    with pytest.raises(FileError, match=problem):
        Session.open(path)


def test_a_journal_without_its_beginning_is_refused(
    tmp_path: Path, finished: SessionRecord
) -> None:
    path = tmp_path / "session"
    shutil.copytree(finished.path, path)
    (path / "journal.jsonl").write_text("")
    with pytest.raises(FileError, match="does not begin as the journal of a session"):
        Session.open(path)


def test_a_dropped_alignment_is_left_out_with_its_results(
    session: Session, alignment: Alignment
) -> None:
    second = replace(alignment, t_b_ns=2)
    session.save_alignment(alignment)
    session.save_alignment(second)
    session.save_results(RESULTS)
    session.drop_alignment()
    record = Session.open(session.path)
    assert [kept.t_b_ns for kept in record.alignments] == [alignment.t_b_ns]
    assert record.results is None

    session.close()
    with Session(session.path) as again:
        assert again.save_alignment(replace(alignment, t_b_ns=3)) == 3
        again.drop_alignment()
        again.drop_alignment()
        with pytest.raises(ValueError, match="no alignment to drop"):
            again.drop_alignment()
        with pytest.raises(ValueError, match="alignment_dropped"):
            again.record("alignment_dropped")
    assert Session.open(session.path).alignments == ()

"""Damage to any file of a session: it costs only itself, and is named."""

from __future__ import annotations

import shutil
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from handcal.core.errors import FileError
from handcal.core.types import Alignment
from handcal.rig.example import example_rig
from handcal.session.alignment_file import decode_alignment
from handcal.session.library import read_library
from handcal.session.repair import check_session, repair_session
from handcal.session.session import Session, SessionRecord
from handcal.session.trial import make_trial
from tests.helpers import ROOT

RESULTS = {"left": {"shift_m": [0.001, 0.0, 0.0]}}
ASIDE = ("path", "damaged", "journal_bytes", "torn_bytes")


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory, alignment: Alignment) -> SessionRecord:
    rig = example_rig()
    parent = tmp_path_factory.mktemp("sessions")
    with Session.create(parent, rig, {"third": 1 / 3}, name="sound", wearer="Ana") as session:
        for _ in range(3):
            session.save_alignment(alignment)
        session.delete("alignment", 2)
        session.save_facts(plan="each", evidence=("picture",))
        session.save_results(RESULTS)
        session.save_applied({"left": [0.001, 0.0, 0.0]})
        for depth_m in (0.4, 0.5, 0.6):
            session.save_trial(
                make_trial(rig.eyes["left"], "left", depth_m, [0.001, 0, 0], [0.002, 0, 0])
            )
        session.delete("trial", 1)
        session.save_notes("Größe passt.")
        session.finish()
    return Session.open(session.path)


FILES = (
    "journal.jsonl", "journal.end", "rig.yaml", "settings.json", "results.json", "notes.txt",
    "alignments/1.npz", "alignments/2.npz", "alignments/3.npz",
)  # fmt: skip


def canonical(value: Any) -> Any:
    """Return a value of a record in a form that is equal only for equal bits."""
    if isinstance(value, np.ndarray):
        return value.tobytes()
    if hasattr(value, "__dataclass_fields__"):
        return contents(value)
    if hasattr(value, "items"):
        return [(name, canonical(part)) for name, part in value.items()]
    if isinstance(value, tuple | list):
        return [canonical(part) for part in value]
    return repr(value)


def contents(record: Any) -> dict[str, Any]:
    """Return the content of a record, apart from its place and its damage."""
    return {
        one.name: canonical(getattr(record, one.name))
        for one in fields(record)
        if one.name not in ASIDE
    }


def damaged_bytes(data: bytes, kind: str, share: float, bit: int) -> bytes:
    at = min(int(share * len(data)), len(data) - 1)
    if kind == "truncated":
        return data[:at]
    changed = bytearray(data)
    if kind == "bit":
        changed[at] ^= 1 << bit
    elif kind == "zeros":
        end = min(len(data), at + 512)
        changed[at:end] = bytes(end - at)
    else:
        at = next((i for i in range(at, len(data)) if chr(data[i]).isdigit()), at)
        changed[at] = 48 + (changed[at] + bit) % 10
    return bytes(changed)


ANY_DAMAGE = (
    st.sampled_from(FILES),
    st.sampled_from(["truncated", "bit", "zeros", "digit"]),
    st.floats(0, 1),
    st.integers(0, 7),
)
ONE_FOLDER = [HealthCheck.function_scoped_fixture]


def spoil(sound: SessionRecord, path: Path, name: str, *damage: Any) -> SessionRecord | None:
    """Copy the session to `path` with one damage, and read it; None if its journal is empty."""
    shutil.rmtree(path, ignore_errors=True)
    shutil.copytree(sound.path, path)
    file = path / name
    file.write_bytes(damaged_bytes(file.read_bytes(), *damage))
    if name == "journal.jsonl" and b"\n" not in file.read_bytes():
        with pytest.raises(FileError, match="does not begin as the journal"):
            Session.open(path)
        return None
    return Session.open(path)


def check_damage(sound: SessionRecord, path: Path, name: str, *damage: Any) -> None:
    """Check that one damage is named, and costs only itself."""
    record = spoil(sound, path, name, *damage)
    if record is None:
        return
    if not record.damaged and not record.torn_bytes:
        assert contents(record) == contents(sound)
    if name != "journal.jsonl":
        assert {damage.file for damage in record.damaged} <= {name}
        kept = {*sound.alignments, *sound.deleted_alignments}
        lost = kept - {*record.alignments, *record.deleted_alignments}
        assert lost <= ({int(Path(name).stem)} if name.endswith(".npz") else set())


@given(*ANY_DAMAGE)
@settings(deadline=None, suppress_health_check=ONE_FOLDER)
def test_no_damage_is_silent_or_costs_the_rest(
    sound: SessionRecord, tmp_path: Path, name: str, kind: str, share: float, bit: int
) -> None:
    check_damage(sound, tmp_path / "session", name, kind, share, bit)


@pytest.mark.campaign
@given(*ANY_DAMAGE)
@settings(deadline=None, suppress_health_check=ONE_FOLDER, max_examples=3000)
def test_no_damage_of_thousands_is_silent(
    sound: SessionRecord, tmp_path: Path, name: str, kind: str, share: float, bit: int
) -> None:
    check_damage(sound, tmp_path / "session", name, kind, share, bit)


@given(*ANY_DAMAGE)
@settings(deadline=None, suppress_health_check=ONE_FOLDER, max_examples=15)
def test_a_repaired_session_is_sound_and_holds_what_could_be_read(
    sound: SessionRecord, tmp_path: Path, name: str, kind: str, share: float, bit: int
) -> None:
    path = tmp_path / "session"
    record = spoil(sound, path, name, kind, share, bit)
    assert check_session(path).state == (
        "none" if record is None else "damaged" if record.damaged else "sound"
    )
    if record is None:
        return
    shutil.rmtree(tmp_path / "repaired", ignore_errors=True)
    repaired = repair_session(path, tmp_path / "repaired")
    assert repaired.damaged == ()
    for part in ("rig", "settings", "alignments", "deleted_alignments", "trials", "notes", "facts"):
        assert canonical(getattr(repaired, part)) == canonical(getattr(record, part))
    for part in ("results", "is_solved", "is_applied", "is_finished"):
        assert getattr(repaired, part) == getattr(record, part)


@pytest.mark.parametrize("line", range(1, 15))
def test_every_line_costs_only_itself(sound: SessionRecord, tmp_path: Path, line: int) -> None:
    path = Path(shutil.copytree(sound.path, tmp_path / "session"))
    lines = (path / "journal.jsonl").read_bytes().split(b"\n")
    lines[line - 1] = lines[line - 1].replace(b'"time": "2', b'"time": "3')
    (path / "journal.jsonl").write_bytes(b"\n".join(lines))
    record = Session.open(path)
    found = {damage.line for damage in record.damaged if damage.file == "journal.jsonl"}
    assert line in found
    assert len(record.events) == len(sound.events) - 1
    with Session(path) as session:  # it can be resumed, and takes no number twice
        assert session.save_alignment(next(iter(sound.alignments.values()))) == 4
    assert len(Session.open(path).alignments) >= 2


def test_lines_that_are_missing_or_in_another_order_are_named(
    sound: SessionRecord, tmp_path: Path
) -> None:
    path = Path(shutil.copytree(sound.path, tmp_path / "session"))
    journal = path / "journal.jsonl"
    lines = journal.read_bytes().splitlines(keepends=True)
    for changed, what in (
        (lines[:4] + lines[5:], "event 5 is missing here"),
        (lines[:5] + lines[:1] + lines[5:], "not the event expected there"),
        ([*lines[:4], lines[5], lines[4], *lines[6:]], "not the event expected there"),
        (lines[:-2], f"events {len(lines) - 1} to {len(lines)} are missing here"),
    ):
        journal.write_bytes(b"".join(changed))
        assert what in " ".join(map(str, Session.open(path).damaged))


def test_notes_that_vanish_are_named(sound: SessionRecord, tmp_path: Path) -> None:
    path = Path(shutil.copytree(sound.path, tmp_path / "session"))
    (path / "notes.txt").unlink()
    assert [damage.file for damage in Session.open(path).damaged] == ["notes.txt"]


def test_a_crash_leaves_the_old_or_the_new_notes(tmp_path: Path) -> None:
    Session.create(tmp_path, example_rig(), {}, name="one").close()
    for place, old, new in ((0, "", "first"), (1, "first", "second")):
        with Session(tmp_path / "one") as session:
            session.save_notes(new)
            (session.path / "journal.end").unlink(missing_ok=True)
            shutil.copytree(session.path, tmp_path / f"{place}", dirs_exist_ok=True)
        assert Session.open(tmp_path / f"{place}").damaged == ()
        notes = tmp_path / f"{place}" / "notes.txt"
        if old:
            notes.write_text(old)
        else:
            notes.unlink()
        record = Session.open(tmp_path / f"{place}")
        assert (record.notes, record.damaged) == (old, ())
        notes.write_text("third")
        assert Session.open(tmp_path / f"{place}").damaged


def test_a_rig_is_read_from_the_journal_or_given(sound: SessionRecord, tmp_path: Path) -> None:
    path = Path(shutil.copytree(sound.path, tmp_path / "session"))
    (path / "rig.yaml").write_text("nonsense")
    assert canonical(Session.open(path).rig) == canonical(sound.rig)
    journal = path / "journal.jsonl"
    journal.write_bytes(journal.read_bytes().replace(b"created", b"CREATED", 1))
    with pytest.raises(FileError, match=r"repair the session with another copy of the rig file"):
        Session.open(path)
    assert check_session(path).state == "none"
    repaired = repair_session(path, tmp_path / "repaired", example_rig())
    assert repaired.damaged == ()
    assert canonical(repaired.alignments) == canonical(sound.alignments)
    assert (repaired.notes, len(repaired.trials)) == (sound.notes, 2)
    with pytest.raises(FileError, match=r"repaired exists; choose a new folder"):
        repair_session(path, tmp_path / "repaired", example_rig())


def test_a_repaired_session_goes_on(
    sound: SessionRecord, tmp_path: Path, alignment: Alignment
) -> None:
    path = Path(shutil.copytree(sound.path, tmp_path / "session"))
    (path / "alignments/1.npz").unlink()
    before = {file: file.read_bytes() for file in path.rglob("*") if file.is_file()}
    repaired = repair_session(path, tmp_path / "repaired")
    assert {file: file.read_bytes() for file in path.rglob("*") if file.is_file()} == before
    assert list(repaired.alignments) == [3]
    assert (repaired.results, repaired.is_solved) == (sound.results, False)
    assert repaired.events[0].time == sound.events[0].time
    with Session(repaired.path) as session:
        assert session.save_alignment(alignment) == 4
        session.restore("alignment", 2)
    again = Session.open(repaired.path)
    assert (list(again.alignments), again.damaged) == ([2, 3, 4], ())


def test_a_journal_can_be_checked_as_its_page_says(monkeypatch: pytest.MonkeyPatch) -> None:
    page = (ROOT / "docs/session.md").read_text("utf-8")
    code = page.split("```python\n")[1].split("```")[0]
    monkeypatch.chdir(ROOT / "resources/example_session")
    exec(code, {})
    with pytest.raises(AssertionError):
        exec(code.replace("-47", "-46"), {})


def test_a_sound_alignment_of_another_place_is_noticed(
    tmp_path: Path, alignment: Alignment
) -> None:
    """Files swapped within a session, or copied from another, are whole but not the journal's."""
    other = replace(alignment, t_b_ns=alignment.t_b_ns + 1)
    with Session.create(tmp_path, example_rig(), {}, name="one") as session:
        session.save_alignment(alignment)
        session.save_alignment(other)
    first, second = (session.path / "alignments" / f"{number}.npz" for number in (1, 2))
    content = first.read_bytes(), second.read_bytes()
    assert decode_alignment(content[1]).t_b_ns == other.t_b_ns
    second.write_bytes(content[0])
    record = Session.open(session.path)
    assert [damage.file for damage in record.damaged] == ["alignments/2.npz"]
    assert set(record.alignments) == {1}
    first.write_bytes(content[1])
    assert len(Session.open(session.path).damaged) == 2
    (entry,) = read_library(tmp_path)
    assert entry.damaged == 2
